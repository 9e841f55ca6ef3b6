"""Piecewise polynomials of one symbol, with the derivatives of their pieces, as expressions that become C."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

__all__ = ["piecewise"]


def piecewise(at: ca.MX, knots: ArrayLike, terms: ca.MX | ca.DM, ends: ca.MX | ca.DM) -> ca.MX:
    """A function that is a polynomial between each two knots, and constant outside of them.

    A knot belongs to the piece after it, the last one to the piece before it: the derivatives there are those of this
    piece.  All operations are elementwise, so that the expression has derivatives, scalar form and C.

    Parameters
    ----------
    at : MX
        Where it is evaluated, one number.
    knots : (n,)
        Rising.
    terms : (n - 1, any)
        Coefficients of each piece in the fraction of its interval.
    ends : (2,)
        Value before the first knot, and from the last on.
    """
    t = np.asarray(knots, dtype=float)
    if len(t) < 2:
        return ca.MX(ends[0])
    before, after = at < t[0], at > t[-1]
    inside = (1.0 - before) * (1.0 - after)
    # Outside a number within stands in its place: powers of what is far outside may overflow.
    here = inside * at + before * t[0] + after * t[-1]
    begins, spans = ca.DM(t[:-1]), ca.DM(np.diff(t))
    last = ca.DM(np.append(np.zeros(len(t) - 2), 1.0))
    chosen = (here >= begins) * ((here < ca.DM(t[1:])) + last * (here == float(t[-1])))
    columns = ca.horzsplit(ca.MX(terms))
    value, x = columns[-1], (here - begins) / spans
    for column in reversed(columns[:-1]):
        value = column + value * x
    return inside * ca.dot(chosen, value) + before * ends[0] + after * ends[1]
