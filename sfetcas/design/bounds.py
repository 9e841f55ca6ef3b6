"""Detection of contradictory bounds and linear constraints before anything is solved."""

from __future__ import annotations

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.statements import Free, Required
from .formulation import Asked, Formulation

__all__ = ["refuse_contradictions"]


def refuse_contradictions(formulation: Formulation) -> None:
    """Refuse linear constraints that cannot be met within bounds and constraints before them.

    Raises
    ------
    SceneError
        Names the constraint, the value it requires, and the range that is possible.
    """
    known: list[Free | Asked] = [*formulation.free.values(), *formulation.asked.values()]
    symbols = [one.symbol for one in known]
    flat = ca.vertcat(ca.MX(0, 1), *(ca.vec(symbol) for symbol in symbols))
    low, high = np.full(flat.numel(), -np.inf), np.full(flat.numel(), np.inf)
    first = 0
    for one in known:
        size = one.symbol.numel()
        if isinstance(one, Free):
            low[first : first + size], high[first : first + size] = one.low.ravel("F"), one.high.ravel("F")
        first += size
    for required in formulation.required:
        slopes, offset = _linear(required, symbols, flat)
        for row in range(len(offset)):
            if np.isfinite(slopes[row]).all():
                _take(required, row, slopes[row], offset[row], low, high)


def _linear(required: Required, symbols: list[ca.MX], flat: ca.MX) -> tuple[Array, Array]:
    """Slopes (rows, numbers), not a number in rows that are not linear, and values at zero."""
    expression = required.relation.expression
    slopes = ca.jacobian(expression, flat)
    function = ca.Function("linear", symbols, [ca.densify(slopes), ca.densify(expression)])
    zeros = [np.zeros(symbol.shape) for symbol in symbols]
    at_zero, offset = (np.array(part) for part in function(*zeros))
    bends = ca.which_depends(ca.vec(expression), flat, 2, True)
    at_zero[np.asarray(bends, dtype=bool)] = np.nan
    return at_zero, offset.ravel()


def _take(required: Required, row: int, slope: Array, offset: float, low: Array, high: Array) -> None:
    """Refuse a row outside of what bounds leave, and tighten the bounds of a number that stands alone."""
    used = np.flatnonzero(slope)
    ends = np.stack([slope[used] * low[used], slope[used] * high[used]])
    least, most = offset + ends.min(axis=0).sum(), offset + ends.max(axis=0).sum()
    wanted = required.relation.low[row], required.relation.high[row]
    slack = tolerances.WRITTEN * max([1.0, *(abs(x) for x in (*wanted, least, most) if np.isfinite(x))])
    if wanted[0] > most + slack or wanted[1] < least - slack:
        asked = f"{wanted[0]:g}" if wanted[0] == wanted[1] else f"{wanted[0]:g} to {wanted[1]:g}"
        message = f"found {asked}, accepted: {least:g} to {most:g}, which bounds and other relations leave"
        raise SceneError(message, (required.name,))
    if len(used) == 1:
        at, by = used[0], slope[used[0]]
        a, b = sorted(((wanted[0] - offset) / by, (wanted[1] - offset) / by))
        low[at], high[at] = max(low[at], a), min(high[at], b)
