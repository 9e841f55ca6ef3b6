"""Impulses with Coulomb friction at one instant: along rows that act on one side, and in directions along obstacles.

With the opening speeds ``w`` of all directions before, and ``w+ = w + G p`` after the impulses ``p``,

    p_n >= 0,    w_n+ >= r,    p_n (w_n+ - r) = 0,
    |p_t| <= mu p_n,    p_t = -mu p_n w_t+ / |w_t+| where w_t+ is not zero,

where ``r`` are the speeds of rebound.  ``G`` is symmetric and has no eigenvalue below zero.  One row after the other is
solved by itself, again and again.  What is lost, ``-p . (w + w+) / 2``, is not below zero without rebound; where it
would be with it, all speeds of rebound are reduced.

Source: Moreau, Unilateral contact and dry friction in finite freedom dynamics, in: Nonsmooth Mechanics and
Applications, CISM 302 (1988); Jean, The non-smooth contact dynamics method, Computer Methods in Applied Mechanics and
Engineering 177 (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array, Index

__all__ = ["Rough", "rough_impulses"]


@dataclass(frozen=True, eq=False)
class Rough:
    """A row with friction: its number, those of the directions along, and the coefficient."""

    row: int
    along: Index
    coefficient: float


def rough_impulses(yielding: Array, speed: Array, rebound: Array, rough: Sequence[Rough]) -> tuple[Array, float, Array]:
    """Impulses (rows + directions,), the energy that is lost, and the speeds of rebound (rows,).

    Parameters
    ----------
    yielding : (rows + directions, rows + directions)
        Opening speeds for unit impulses.
    speed : (rows + directions,)
        Opening speeds before.
    rebound : (rows,)
        Wanted opening speeds afterwards.
    rough : of the rows that have friction
    """
    for share in REBOUNDS:
        found = _balanced(yielding, speed, share * rebound, rough)
        lost = -float(found @ (speed + 0.5 * yielding @ found))
        if lost >= 0.0 or not rebound.any():
            break
    return found, max(lost, 0.0), share * rebound


def _balanced(yielding: Array, speed: Array, rebound: Array, rough: Sequence[Rough]) -> Array:
    """Impulses for given speeds of rebound."""
    found, friction = np.zeros(len(speed)), {one.row: one for one in rough}
    stiff = {
        one.row: float(np.linalg.eigvalsh(yielding[np.ix_(one.along, one.along)]).max(initial=0.0)) for one in rough
    }
    floor = TINY + MASSLESS * float(np.abs(np.diag(yielding)).max(initial=0.0))
    for _ in range(SWEEPS):
        before = found.copy()
        for i, wanted in enumerate(rebound.tolist()):
            if yielding[i, i] > floor:
                missing = speed[i] + yielding[i] @ found - wanted
                found[i] = max(0.0, found[i] - missing / yielding[i, i])
            if i in friction and stiff[i] > floor:
                one = friction[i]
                slip = speed[one.along] + yielding[one.along] @ found
                wished = found[one.along] - slip / stiff[i]
                size, most = float(np.linalg.norm(wished)), one.coefficient * found[i]
                found[one.along] = wished * (most / size) if size > most else wished
        if np.abs(found - before).max(initial=0.0) <= AGREED * np.abs(found).max(initial=TINY):
            break
    return found


REBOUNDS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the speeds of rebound that are tried."""

SWEEPS, AGREED = 10000, 1e-15
"""Rounds over all rows at most, and the change of a round over the largest impulse at which they end."""

TINY, MASSLESS = 1e-300, 1e-12
"""Instead of zero, and the share of the largest yielding below which a direction does not yield."""
