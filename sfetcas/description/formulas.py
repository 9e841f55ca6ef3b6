"""Numbers along a member by a formula: ``1 - 0.5*x**2``, ``sin(pi*x)``, ``exp(-s/0.3)``.

A formula is parsed, never run as a program: of Python's grammar it has numbers, names of places, ``pi``, arithmetic
and a few functions, and nothing else.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from pydantic import model_validator

from ..errors import SceneError
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.interpolation import evaluation, lobatto
from .records import Record, say

__all__ = ["SAMPLES", "Formula"]

LONGEST = 500
"""Characters of a formula."""

SAMPLES = 1001
"""Places along a member at which a formula has to be finite, and between which an argument of ``abs`` turns its sign
once at most."""

OPERATIONS: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "sqrt": np.sqrt,
    "log": np.log,
    "abs": np.abs,
}
ROUGH = 0.01
"""Share of the largest value by which polynomials between the edges of a formula may miss it."""

NARROWEST = 1e-4
"""Width of the narrowest parts that a formula is divided into."""

PLACES = ("x", "s")
ACCEPTED = f"numbers, {', '.join(PLACES)}, pi, + - * / ** ( ) and {', '.join(FUNCTIONS)}"


@dataclass(frozen=True)
class _Parsed:
    """A formula as a function of the values of its names; arguments of ``abs`` are such functions, too."""

    value: Callable[[Mapping[str, Any]], Any]
    names: frozenset[str]
    turning: tuple[Callable[[Mapping[str, Any]], Any], ...]


@functools.lru_cache(maxsize=256)
def _parsed(text: str) -> _Parsed:
    if len(text) > LONGEST:
        _refuse(text, f"which has {len(text)} characters", f"up to {LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        _refuse(text, f"which is no formula ({getattr(error, 'msg', None) or error})")
    names: set[str] = set()
    turning: list[Callable[[Mapping[str, Any]], Any]] = []

    def known(node: ast.expr) -> Callable[[Mapping[str, Any]], Any]:
        match node:
            case ast.Constant(value=int() | float() as constant) if not isinstance(constant, bool):
                return _constant(text, constant)
            case ast.Name(id="pi"):
                return _constant(text, np.pi)
            case ast.Name(id=name) if name in PLACES:
                names.add(name)
                return lambda at: at[name]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATIONS:
                one = known(operand)
                return lambda at: OPERATIONS[type(op)](one(at))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATIONS:
                a, b = known(left), known(right)
                return lambda at: OPERATIONS[type(op)](a(at), b(at))
            case ast.Call(func=ast.Name(id=name), args=[ast.expr() as argument], keywords=[]) if name in FUNCTIONS:
                inner = known(argument)
                if name == "abs":
                    turning.append(inner)
                return lambda at: FUNCTIONS[name](inner(at))
        _refuse(text, f"in which {ast.unparse(node)!r} has no meaning")

    try:
        value = known(tree)
    except RecursionError:
        _refuse(text, "which is nested too deeply")
    return _Parsed(value, frozenset(names), tuple(turning))


def _constant(text: str, value: float) -> Callable[[Mapping[str, Any]], Any]:
    try:
        # Powers of whole numbers would take for ever where those of floats overflow.
        number = np.float64(value)
    except OverflowError:
        _refuse(text, "with a number that is too large")
    return lambda at: number


def _refuse(text: str, why: str, accepted: str = ACCEPTED) -> NoReturn:
    raise SceneError(f"found {say(text)}, {why}, accepted: {accepted}")


class Formula(Record):
    """A formula of the place along the member, as ``"1 - 0.5*x**2"`` or ``"sin(pi*x)"``.

    Parameters
    ----------
    formula : text
        Of ``x``, the fraction of the length, and ``s``, the length from the first node in m (not in a section, which
        members of different lengths may share): numbers, ``pi``, ``+ - * / **``, parentheses and the functions
        ``sin``, ``cos``, ``tan``, ``exp``, ``sqrt``, ``log`` and ``abs``.
    """

    formula: str

    @model_validator(mode="after")
    def _check(self) -> Formula:
        if not self.uses_length:
            self.check_finite(1.0)
        return self

    @property
    def uses_length(self) -> bool:
        """Whether it depends on the length ``s``, not on the fraction ``x`` alone."""
        return "s" in _parsed(self.formula).names

    def at(self, x: Array, length: float = np.nan) -> Array:
        """Values (n,) at fractions x (n,) of a length in m."""
        with np.errstate(all="ignore"):
            return numbers(_parsed(self.formula).value({"x": x, "s": x * length}) + 0.0 * x)

    def check_finite(self, length: float, *where: str) -> None:
        """Refuse a formula that has no finite number somewhere along a length in m; ``where`` it stands.

        Raises
        ------
        SceneError
            Says where.
        """
        x = np.linspace(0.0, 1.0, SAMPLES)
        wrong = ~np.isfinite(self.at(x, float(values_of(length))))
        if wrong.any():
            found = f"found {say(self.formula)}, which is no finite number at {x[wrong][0]:g} of the length"
            raise SceneError(f"{found}, accepted: a finite number everywhere", where)

    def edges(self, length: float = np.nan) -> tuple[float, ...]:
        """Fractions strictly between 0 and 1 between which polynomials of degree 4 come near to it: halves of halves.

        None where one polynomial does.
        """
        nodes, length = lobatto(5)[0], float(values_of(length))
        places = np.linspace(0.0, 1.0, 13)
        between = evaluation(nodes, places)
        size = float(np.abs(self.at(np.linspace(0.0, 1.0, SAMPLES), length)).max())
        # As narrow as a sixteenth a feature is looked for; what is found is divided further.
        left, width, found = np.arange(16) / 16, 1.0 / 16, set[float]()
        while len(left) and width > NARROWEST:
            at = left[:, None] + width * places
            wrong = np.abs(self._grid(left[:, None] + width * nodes, length) @ between.T - self._grid(at, length))
            left = left[wrong.max(axis=1) > ROUGH * size]
            width *= 0.5
            found |= {*left.tolist(), *(left + width).tolist(), *(left + 2.0 * width).tolist()}
            left = np.sort(np.concatenate([left, left + width]))
        return tuple(sorted(found - {0.0, 1.0}))

    def _grid(self, x: Array, length: float) -> Array:
        return self.at(x.ravel(), length).reshape(x.shape)

    def breaks(self, length: float = np.nan) -> tuple[float, ...]:
        """Fractions strictly between 0 and 1 where an argument of ``abs`` turns its sign."""
        x, found = np.linspace(0.0, 1.0, SAMPLES), set()
        for turning in _parsed(self.formula).turning:

            def sign(at: Array, turning: Any = turning) -> Array:
                with np.errstate(all="ignore"):
                    return np.sign(turning({"x": at, "s": at * float(values_of(length))}) + 0.0 * at)

            signs = sign(x)
            found |= set(x[1:-1][signs[1:-1] == 0.0].tolist())
            changing = signs[:-1] * signs[1:] < 0.0
            left, right, first = x[:-1][changing], x[1:][changing], signs[:-1][changing]
            for _ in range(60):
                middle = 0.5 * (left + right)
                before = sign(middle) == first
                left, right = np.where(before, middle, left), np.where(before, right, middle)
            found |= set(right.tolist())
        return tuple(sorted(found))
