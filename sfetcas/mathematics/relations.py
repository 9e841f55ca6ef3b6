"""Relations as CasADi writes them, ``x == 2``, ``x <= 3``, ``-1 <= (x <= 1)``, as rows with bounds."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .arrays import Array

__all__ = ["Relation", "relation"]


@dataclass(frozen=True, eq=False)
class Relation:
    """Constraints ``low <= expression <= high``, in the unit of the expression.

    Attributes
    ----------
    expression : MX (rows,)
    low, high : ndarray (rows,)
    """

    expression: ca.MX
    low: Array
    high: Array


def relation(given: ca.MX) -> Relation:
    """The rows and bounds of a relation, element by element.

    Raises
    ------
    ValueError
        What is given is no relation, one of constants only, or one with what is no number.
    """
    found = _rows(given)
    if np.isnan([*found.low, *found.high]).any() or (np.isinf(found.low) & (found.low == found.high)).any():
        raise ValueError("found not a finite number as a bound, accepted: numbers")
    return found


def _rows(given: ca.MX) -> Relation:
    if not isinstance(given, ca.MX):
        raise ValueError(f"found {given!r}, accepted: a relation of expressions as x == 2, x <= 3 or -1 <= (x <= 1)")
    if given.is_binary() and given.op() == ca.OP_EQ:
        return _bounded(given.dep(0), given.dep(1), equal=True)
    chain = _chain(given)
    if len(chain) == 2:
        return _bounded(*chain, equal=False)
    if len(chain) == 3:
        low, middle, high = chain
        if not (low.is_constant() and high.is_constant()):
            raise ValueError("found a double inequality between expressions, accepted: numbers on both sides")
        size = middle.numel()
        return Relation(ca.vec(middle), _numbers(low, size), _numbers(high, size))
    raise ValueError("found an expression, accepted: a relation as x == 2, x <= 3 or -1 <= (x <= 1)")


def _chain(given: ca.MX) -> list[ca.MX]:
    """What rises from left to right."""
    if not (given.is_binary() and given.op() in (ca.OP_LE, ca.OP_LT)):
        return [given]
    return [*_chain(given.dep(0)), *_chain(given.dep(1))]


def _numbers(given: ca.MX, size: int) -> Array:
    values = np.array(given.to_DM()).ravel(order="F")
    return np.broadcast_to(values, (size,)).astype(float)


def _bounded(left: ca.MX, right: ca.MX, *, equal: bool) -> Relation:
    if left.is_constant() and right.is_constant():
        raise ValueError("found a relation of numbers only, accepted: one that some unknown stands in")
    if left.is_constant():
        size = right.numel()
        bound = _numbers(left, size)
        return Relation(ca.vec(right), bound, bound if equal else np.full(size, np.inf))
    if right.is_constant():
        size = left.numel()
        bound = _numbers(right, size)
        return Relation(ca.vec(left), bound if equal else np.full(size, -np.inf), bound)
    rows = ca.vec(left - right)
    size = rows.numel()
    return Relation(rows, np.full(size, 0.0 if equal else -np.inf), np.zeros(size))
