"""CasADi functions as tapes, the lists of operations that the core runs."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .arrays import Array

__all__ = ["KEPT", "NAMES", "Tape", "tape_of"]

# fmt: off
NAMES = [
    "IN", "OUT", "CONSTANT", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "SQ", "TWICE", "SQRT", "INV",
    "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "EXP", "LOG", "EXPM1", "LOG1P", "POW",
    "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ERF", "HYPOT", "FABS", "SIGN", "COPYSIGN", "FMIN",
    "FMAX", "FMOD", "REMAINDER", "FLOOR", "CEIL", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF",
]
# fmt: on
"""Operations of the core by name, in the order of its ``tape.c``."""

OTHERS = {
    "CONST": "CONSTANT",
    "INPUT": "IN",
    "OUTPUT": "OUT",
    "IF_ELSE_ZERO": "IF",
    "CONSTPOW": "POW",
    "LIFT": "ASSIGN",
}
"""What CasADi calls some of them."""

KEPT = 256
"""Functions whose tapes are kept at hand: those of the kinds of terms of some models."""


@dataclass(frozen=True, eq=False)
class Tape:
    """A function of SX as a list of operations.

    Attributes
    ----------
    code : ndarray (operations, 4) of int32
        Operation, slot of the result, and slots of what it takes.
    constant : ndarray (constants,)
    slots, arguments, results : int
        Numbers of slots, and of the entries of all arguments and all results, one after the other.
    parts : tuple of int
        Where each result begins among all, and their number.
    """

    code: Array
    constant: Array
    slots: int
    arguments: int
    results: int
    parts: tuple[int, ...]


@functools.cache
def _operations() -> dict[int, int]:
    """Number of the core's operation by that of CasADi."""
    theirs = {name[3:]: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
    names = {OTHERS.get(name, name): number for name, number in theirs.items() if name not in ("IN", "IF")}
    found = {names[name]: number for number, name in enumerate(NAMES)}
    return found | {theirs[name]: NAMES.index(ours) for name, ours in OTHERS.items()}


@functools.lru_cache(maxsize=KEPT)
def tape_of(function: ca.Function) -> Tape | None:
    """The tape of a function; None of one that has other operations than those of scalars."""
    try:
        scalar = function if function.is_a("SXFunction") else function.expand()
    except RuntimeError:
        return None
    known = _operations()
    inputs = np.cumsum([0, *(scalar.nnz_in(i) for i in range(scalar.n_in()))]).tolist()
    outputs = np.cumsum([0, *(scalar.nnz_out(i) for i in range(scalar.n_out()))]).tolist()
    code, constant = list[tuple[int, int, int, int]](), list[float]()
    for k in range(scalar.n_instructions()):
        theirs = scalar.instruction_id(k)
        to, taken = scalar.instruction_output(k), scalar.instruction_input(k)
        operation = known.get(theirs)
        if operation is None:
            return None
        if theirs == ca.OP_INPUT:
            code.append((operation, to[0], inputs[taken[0]] + taken[1], 0))
        elif theirs == ca.OP_OUTPUT:
            code.append((operation, outputs[to[0]] + to[1], taken[0], 0))
        elif theirs == ca.OP_CONST:
            code.append((operation, to[0], len(constant), 0))
            constant.append(scalar.instruction_constant(k))
        else:
            code.append((operation, to[0], taken[0], taken[-1]))
    table = np.array(code, np.int32).reshape(-1, 4)
    return Tape(table, np.array(constant), scalar.sz_w(), inputs[-1], outputs[-1], tuple(outputs))
