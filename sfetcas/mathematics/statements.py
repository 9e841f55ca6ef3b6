"""Statement of an optimisation problem in CasADi expressions: unknowns, constraints and objective.

Constraints are ``x == 2``, ``x <= 3``, ``-1 <= (x <= 1)``, element by element.  This module is independent of
mechanics; other modules make symbols for numbers and answers of a scene and register them (:meth:`Statement.known`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..errors import SceneError
from .arrays import Array
from .relations import Relation, relation

__all__ = ["Bounds", "Free", "Problem", "Required", "Statement", "bounds_of"]

Bounds = tuple[float, float]
"""Least and largest value; infinite where there is none."""


@dataclass(frozen=True, eq=False)
class Free:
    """A block of unknowns, in its own unit.

    Attributes
    ----------
    name : str
    symbol : MX
        Its symbol in expressions, in the shape of the guess.
    guess, low, high : ndarray
        Start values and bounds, all of one shape.
    """

    name: str
    symbol: ca.MX
    guess: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Required:
    """A constraint, with its name."""

    name: str
    relation: Relation


def bounds_of(name: str, given: object) -> Bounds:
    """Lower and upper bound of an unknown.

    Raises
    ------
    SceneError
        They are not two numbers, or contradict each other.
    """
    try:
        low, high = (float(x) for x in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise SceneError(f"found {given!r}, accepted: a lower and an upper bound", (name,)) from None
    if not low <= high:
        raise SceneError(f"found the bounds {low:g} and {high:g}, accepted: the lower one first", (name,))
    return low, high


class Statement:
    """An optimisation problem: unknowns, constraints and objective.

    Attributes
    ----------
    free : dict of str to Free
    required : list of Required
    costs : list of MX
        Terms of the objective.
    """

    def __init__(self) -> None:
        self.free: dict[str, Free] = {}
        self.required: list[Required] = []
        self.costs: list[ca.MX] = []
        self._symbols: dict[int, ca.MX] = {}

    @property
    def in_words(self) -> str:
        """How much there is of it: ``2 unknowns, 1 constraint, 1 term to minimise``."""
        counts = {"unknown": len(self.free), "constraint": len(self.required), "cost": len(self.costs)}
        return ", ".join(f"{number} {kind}{'' if number == 1 else 's'}" for kind, number in counts.items())

    def known(self, symbol: ca.MX) -> ca.MX:
        """Register a symbol that expressions may contain, and return it."""
        # Kept, so that no other symbol gets its hash.
        self._symbols[symbol.__hash__()] = symbol
        return symbol

    def unknown(self, name: str, guess: ArrayLike, low: ArrayLike = -np.inf, high: ArrayLike = np.inf) -> ca.MX:
        """Add unknowns under a name and return their symbol.

        Parameters
        ----------
        guess : number, (n,) or (n, m): start values, and the shape
        low, high : bounds, broadcast to it

        Raises
        ------
        SceneError
            A name that is there already, bounds that contradict each other, or a guess outside.
        """
        if name in self.free:
            raise SceneError(f"found the unknown {name!r} twice, accepted: once")
        start = np.atleast_1d(np.asarray(guess, dtype=float))
        least, most = (np.broadcast_to(np.asarray(x, dtype=float), start.shape) for x in (low, high))
        for a, x, b in zip(least.flat, start.flat, most.flat, strict=True):
            bounds_of(name, (a, b))
            if not a <= x <= b:
                raise SceneError(f"found the guess {x:g}, accepted: {a:g} to {b:g}, as its bounds say", (name,))
        self.free[name] = Free(name, self.known(ca.MX.sym(name, *start.shape)), start, least, most)
        return self.free[name].symbol

    def subject_to(self, *given: ca.MX, name: str = "") -> None:
        """Add constraints.

        Parameters
        ----------
        name : name in messages and among the multipliers; by default made from the expression

        Raises
        ------
        SceneError
            What is given is no relation, its bounds contradict each other, or it has a symbol of another problem.
        """
        for one in given:
            try:
                found = relation(one)
            except ValueError as error:
                raise SceneError(str(error), (name or "subject_to",)) from None
            symbols = ", ".join(dict.fromkeys(symbol.name() for symbol in ca.symvar(found.expression)))
            called = name or symbols or "subject_to"
            wrong = found.low > found.high
            if wrong.any():
                low, high = found.low[wrong][0], found.high[wrong][0]
                raise SceneError(f"found {low:g} <= ... <= {high:g}, accepted: the lower bound first", (called,))
            self.refuse_strange(called, found.expression)
            self.required.append(Required(self._once(called), found))

    def minimise(self, cost: Any) -> None:
        """Add a term to the objective.

        Raises
        ------
        SceneError
            No expression, more than one number, or a symbol of another problem.
        """
        expression = self.one(cost, "minimise")
        self.refuse_strange("minimise", expression)
        self.costs.append(expression)

    @property
    def objective(self) -> ca.MX:
        """The sum of all costs."""
        return sum(self.costs, ca.MX(0))

    @staticmethod
    def one(given: Any, where: str) -> ca.MX:
        """An expression of one number.

        Raises
        ------
        SceneError
            It is none.
        """
        try:
            expression = ca.MX(given)
        except NotImplementedError:
            raise SceneError(f"found {given!r}, accepted: an expression of CasADi or a number", (where,)) from None
        if expression.numel() != 1:
            raise SceneError(f"found {expression.numel()} numbers, accepted: one", (where,))
        return expression

    def refuse_strange(self, name: str, expression: ca.MX) -> None:
        """Refuse an expression with a symbol that does not belong to this problem.

        Raises
        ------
        SceneError
            Names it.
        """
        for symbol in ca.symvar(expression):
            if symbol.__hash__() not in self._symbols:
                accepted = "symbols that this problem has given: of its variables, answers and unknowns"
                raise SceneError(f"found the symbol {symbol.name()!r}, accepted: {accepted}", (name,))

    def _once(self, name: str) -> str:
        names = {one.name for one in self.required}
        if name not in names:
            return name
        return next(f"{name} ({i})" for i in range(2, len(names) + 3) if f"{name} ({i})" not in names)


class Problem:
    """Base class of problems that users state: their common methods.

    Attributes
    ----------
    statement : Statement
    """

    statement: Statement

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.statement.in_words})"

    def subject_to(self, *relations: ca.MX, name: str = "") -> None:
        """Add constraints: ``x == 2``, ``x <= 3``, ``-1 <= (x <= 1)``, element by element.

        Parameters
        ----------
        name : name in messages and among the multipliers; by default made from the expression

        Raises
        ------
        SceneError
            What is given is no relation, its bounds contradict each other, or it has a symbol of another problem.
        """
        self.statement.subject_to(*relations, name=name)

    def minimise(self, cost: ca.MX | float) -> None:
        """Add a term to the objective.

        Raises
        ------
        SceneError
            More than one number, or a symbol of another problem.
        """
        self.statement.minimise(cost)
