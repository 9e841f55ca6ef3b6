"""What may touch what: members with each other, with themselves and with obstacles; and where they are near."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..description.obstacles import Obstacle
from ..mathematics.arrays import Array

__all__ = ["NEXT_TO", "ONE", "SAME", "Near", "Pair", "PairKey", "doing", "penetrating"]

SAME = 0.5
"""Minima nearer to each other than this part of the distance of the centre lines are one, along both members."""

ONE = 0.2
"""As ``SAME``, a share of that, of points that touch: such points are one."""

NEXT_TO = 0.95
"""Part of half a turn of the smallest circle within which places along members are not near to each other."""

LEFT = 1e-3
"""Share of the distance of what is round, or of two members, that is left where these are drawn back."""

PairKey = tuple[str, tuple[str, ...]]
"""Name of a contact, and the members that touch each other, or the one that touches its obstacle."""


@dataclass(frozen=True)
class Near:
    """A local minimum of the distance between two members, or of a member from an obstacle.

    Attributes
    ----------
    contact : str
    members : (str, str) or (str,)
    at : tuple of float
        Fractions of their lengths.
    normal : ndarray (3,)
        Unit vector from the second centre line, or the obstacle, to the first, as an obstacle that moves sees it.
    gap : float
        Distance of the surfaces, m; below zero where they penetrate.
    distance, edge : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    """

    contact: str
    members: tuple[str, ...]
    at: tuple[float, ...]
    normal: Array
    gap: float
    distance: float
    edge: float = 0.0

    @property
    def pair(self) -> PairKey:
        """What it is a minimum of."""
        return self.contact, self.members


@dataclass(frozen=True)
class Pair:
    """Two members that may touch, one that may touch itself, or one that may touch an obstacle.

    Attributes
    ----------
    contact : str
    members : (str, str) or (str,)
    distance : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    width : float
        Length along the members within which minima are one, over ``SAME``, m.
    stop : Obstacle or None
        It is where it is in the undeformed scene: of one that moves what touches it is seen from it.
    ends : (bool, bool)
        Whether an obstacle can push the ends of the member.
    edge : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    """

    contact: str
    members: tuple[str, ...]
    distance: float
    width: float
    stop: Obstacle | None = None
    ends: tuple[bool, bool] = (True, True)
    edge: float = 0.0

    @property
    def key(self) -> PairKey:
        """Its name."""
        return self.contact, self.members

    @property
    def turn(self) -> float:
        """Radius of what a member may be bent round, m: of an obstacle, or of its own surface on an edge."""
        if self.stop is None or self.stop.kind != "round":
            return np.inf
        return self.stop.radius or self.distance

    @property
    def passable(self) -> bool:
        """Whether members may have passed each other or the obstacle: what is beyond a plane is inside of it."""
        return self.stop is None or (self.stop.kind == "round" and self.stop.sign > 0.0)

    def drawn_back(self, by: float) -> Pair:
        """The same where surfaces are drawn back by a length, m: members are on one side of what is round as before.

        An edge, which has no inside, stays.
        """
        most = 0.0 if self.edge else (1.0 - LEFT) * self.distance if self.passable else np.inf
        return replace(self, distance=self.distance - min(by, most))

    @property
    def normal(self) -> tuple[float, float, float] | None:
        """The direction along which the distance is always measured; None where that is another one at each place."""
        if self.stop is None or self.stop.kind != "flat":
            return None
        x, y, z = self.stop.normal.tolist()
        return x, y, z


def penetrating(members: tuple[str, ...], at: Iterable[float], deep: float) -> str:
    """``members 'a' and 'b' penetrate by 0.01 m at 0.5 and 0.2 of their lengths``: how deep, m, and where."""
    (a, b), (s, t) = members, at
    found = f"members {a!r} and {b!r} penetrate" if a != b else f"member {a!r} penetrates itself"
    return f"{found} by {deep:.3g} m at {s:.4g} and {t:.4g} of {'their lengths' if a != b else 'its length'}"


def doing(contact: str, members: tuple[str, ...], at: Iterable[float], verb: str) -> str:
    """What a place of a contact does, a sentence: ``contacts.peg touches beam at 0.5``; of two members
    ``contacts.c: a at 0.2 touches b at 0.7``.
    """
    places = [f"{member} at {x:.4g}" for member, x in zip(members, at, strict=True)]
    if len(places) == 1:
        return f"contacts.{contact} {verb} {places[0]}"
    return f"contacts.{contact}: {f' {verb} '.join(places)}"
