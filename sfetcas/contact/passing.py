"""Whether members pass through each other, or through obstacles, between two states.

Steps are so short that members are between their places before and after.  What is nearest to something in one state
must not be on its other side in the other one; what touches something round in neither state must not come inside of
it on the straight way; and what begins to touch something round must do so near to where it was seen from there.
Where members pass edges is a question of its own, see :mod:`~sfetcas.contact.edges`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..description.obstacles import Obstacle
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import Fields
from .closest import Closest
from .edges import Edges
from .gripping import Placed
from .pairs import Near, Pair, PairKey

__all__ = ["ROUND", "Passing", "tangents_turned"]

SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Where on the way between two states it is looked: also near to its ends, as at one of them it may touch."""

ROUND = 0.5
"""Angle round an obstacle by which what begins to touch it may be from where it was, rad."""


class Passing:
    """What members may have passed through on a step.

    Parameters
    ----------
    scene : Scene
    closest : Closest
    edges : Edges
    tolerance : float
        Penetration that is accepted, m.
    """

    def __init__(self, scene: Scene, closest: Closest, edges: Edges, tolerance: float) -> None:
        self.scene, self.closest, self.edges, self.tolerance = scene, closest, edges, tolerance

    def passed(self, before: Fields, after: Fields) -> bool:
        """Whether a member may have passed through another one, or an obstacle, between two states.

        What was nearest before, and is nearest after, must not have changed sides.
        """
        crossed = self.crossed(before, after) or self.crossed(after, before)
        return bool(crossed) or self.swept(before, after)

    def crossed(self, before: Fields, after: Fields) -> list[Near]:
        """Where members are nearest in one state that are on other sides of each other in another one."""
        pairs = [pair for pair in self.closest.pairs.values() if pair.passable]
        found = self.closest.found(before, 2.0 * self._farthest(before, after, pairs), pairs)
        vectors = Placed(self.scene, after, found).vectors
        crossed = [near for near, vector in zip(found, vectors, strict=True) if near.normal @ vector <= 0.0]
        angle = tangents_turned(before, after) if self.edges.pairs else 0.0
        return crossed + self.edges.crossed(before, after, angle)

    def swept(self, before: Fields, after: Fields) -> bool:
        """Whether places of members that move straight from one state to another come inside of a round obstacle that
        these touch in neither.
        """
        touched = _touching(before) | _touching(after)
        pairs = [pair for pair in self.closest.pairs.values() if pair.passable and pair.key not in touched]
        for pair, stop, a, b in self._moves(before, after, pairs):
            first, way = (a - stop.place) @ stop.across, (b - a) @ stop.across
            size = np.maximum(np.einsum("ni,ni->n", way, way), TINY)
            share = np.clip(-np.einsum("ni,ni->n", first, way) / size, 0.0, 1.0)
            if (np.linalg.norm(first + share[:, None] * way, axis=1) < pair.distance - self.tolerance).any():
                return True
        return False

    def bulged(self, before: Fields, after: Fields) -> bool:
        """Whether places of members that turn may have been inside of what these touch in one state at most: they move
        on arcs, of which the middle is an eighth of their length times the angle aside of the straight way.
        """
        middle, touched = 0.125 * tangents_turned(before, after), _touching(before) & _touching(after)
        pairs = [pair for pair in self.closest.pairs.values() if pair.key not in touched]
        for pair, stop, a, b in self._moves(before, after, pairs):
            far = np.linalg.norm(b - a, axis=1)
            for share in SHARES:
                here = a + share * (b - a)
                apart = np.einsum("ni,ni->n", (here - stop.place) @ stop.across, stop.normals(here, here))
                if (apart - pair.distance < _risen(middle, share) * far - self.tolerance).any():
                    return True
        return self._bulged_between(before, after, [pair for pair in pairs if pair.stop is None], middle)

    def _bulged_between(self, before: Fields, after: Fields, pairs: Sequence[Pair], middle: float) -> bool:
        """As :meth:`bulged` between members, on the same elements."""
        if not pairs or not before.model.mesh.same(replace(after.model.mesh, points=before.model.mesh.points)):
            return False
        reach = 2.0 * middle * self._farthest(before, after, pairs)
        if reach <= self.tolerance:
            return False
        keys = {pair.key for pair in pairs}
        for share in SHARES:
            found = [near for near in self.closest.on_way(before, after, share, reach) if near.pair in keys]
            ends = zip(*(Placed(self.scene, fields, found).vectors for fields in (before, after)), strict=True)
            for near, (one, other) in zip(found, ends, strict=True):
                if near.gap < _risen(middle, share) * float(np.linalg.norm(other - one)) - self.tolerance:
                    return True
        return False

    def _farthest(self, before: Fields, after: Fields, pairs: Sequence[Pair]) -> float:
        """How far places of members of some pairs move at most, m, as obstacles see them."""
        moved = 0.0
        for member in {member for pair in pairs for member in pair.members}:
            x = self.closest.samples(after.model.mesh, member)
            places = before.positions(member, x), after.positions(member, x)
            for contact in {pair.contact for pair in pairs if member in pair.members}:
                a, b = _seen(contact, (before, after), places)
                moved = max(moved, float(np.linalg.norm(b - a, axis=1).max()))
        return moved

    def _moves(
        self, before: Fields, after: Fields, pairs: Iterable[Pair]
    ) -> Iterator[tuple[Pair, Obstacle, Array, Array]]:
        """Of pairs with an obstacle, but edges, that and places (n, 3) of the member in both states as it sees them."""
        for pair in pairs:
            if pair.stop is None or pair.edge:
                continue
            x = self.closest.samples(after.model.mesh, pair.members[0])
            places = before.positions(pair.members[0], x), after.positions(pair.members[0], x)
            yield pair, pair.stop, *_seen(pair.contact, (before, after), places)

    def aside(self, before: Fields, after: Fields) -> bool:
        """Whether what begins to touch a round obstacle does so far round it from where it was: it may have gone deep
        into it on the way, where that pushes it to another side.
        """
        had = _touching(before)
        begun = [p for p in after.contact_points if len(p.members) == 1 and not p.edge and p.pair not in had]
        earlier, now = (Placed(self.scene, fields, begun) for fields in (before, after))
        stops = (self.closest.pairs[point.pair].stop for point in begun)
        cosines = [earlier.normal(i, stop) @ now.normal(i, stop) for i, stop in enumerate(stops)]
        return min(cosines, default=1.0) < np.cos(ROUND)


def _touching(fields: Fields) -> set[PairKey]:
    """The pairs that touch in a state."""
    return {point.pair for point in fields.model.mesh.points}


def _seen(contact: str, states: tuple[Fields, Fields], places: tuple[Array, Array]) -> tuple[Array, Array]:
    """Places (n, 3) in two states as the obstacle of a contact sees them."""
    one, other = (fields.seen(contact, here, here)[0] for fields, here in zip(states, places, strict=True))
    return one, other


def _risen(middle: float, share: float) -> float:
    """How far an arc is from the straight way at a share of that, over its length, by that in its middle."""
    return 4.0 * share * (1.0 - share) * middle


def tangents_turned(before: Fields, after: Fields) -> float:
    """Largest angle between tangents of the same place in two states, rad."""
    most = 1.0
    for member in after.model.members:
        x = np.linspace(0.0, 1.0, 33)
        most = min(most, float(np.einsum("ni,ni->n", before.tangents(member, x), after.tangents(member, x)).min()))
    return float(np.arccos(np.clip(most, -1.0, 1.0)))
