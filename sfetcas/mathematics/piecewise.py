"""Piecewise polynomials of one symbol, with the derivatives of their pieces, as expressions that become C."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import casadi as ca
import numpy as np

__all__ = ["piecewise"]


def piecewise(at: ca.MX, knots: Sequence[float], pieces: Sequence[Sequence[float]], ends: tuple[float, float]) -> ca.MX:
    """A function that is a polynomial between each two knots, and constant outside of them.

    A knot belongs to the piece after it, the last one to the piece before it: the derivatives there are those of this
    piece.  All operations are elementwise, so that the expression has derivatives, scalar form and C.

    Parameters
    ----------
    at : MX
        Where it is evaluated, one number.
    knots : (n,)
        Rising.
    pieces : (n - 1, any)
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
    terms = [ca.DM(list(column)) for column in zip_longest(*pieces, fillvalue=0.0)]
    value = terms[-1]
    x = (here - begins) / spans
    for term in reversed(terms[:-1]):
        value = term + value * x
    return inside * ca.dot(chosen, value) + before * ends[0] + after * ends[1]
