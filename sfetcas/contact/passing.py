"""Whether members pass through each other, or through obstacles, between two states.

Steps are so short that members are between their places before and after.  What is nearest to something in one state
must not be on its other side in the other one; what touches something round in neither state must not come inside of
it on the straight way; and what begins to touch something round must do so near to where it was seen from there.
Where members pass edges is a question of its own, see :mod:`~sfetcas.contact.edges`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from ..description.obstacles import Obstacle
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import Fields
from .closest import Closest
from .edges import Edges
from .gripping import Placed
from .lines import points_in
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
        moved = 0.0
        for member in {member for pair in pairs for member in pair.members}:
            x = self.closest.samples(after.model.mesh, member)
            places = after.positions(member, x), before.positions(member, x)
            seen = {pair.contact for pair in pairs if member in pair.members}
            for contact in seen:
                one, other = (f.seen(contact, p, p)[0] for f, p in zip((after, before), places, strict=True))
                moved = max(moved, float(np.linalg.norm(one - other, axis=1).max()))
        found = self.closest.found(before, 2.0 * moved, pairs)
        vectors = Placed(self.scene, after, found).vectors
        crossed = [near for near, vector in zip(found, vectors, strict=True) if near.normal @ vector <= 0.0]
        angle = tangents_turned(before, after) if self.edges.pairs else 0.0
        return crossed + self.edges.crossed(before, after, angle)

    def swept(self, before: Fields, after: Fields) -> bool:
        """Whether places of members that move straight from one state to another come inside of a round obstacle that
        these touch in neither.
        """
        one, other = ({point.pair for point in fields.model.mesh.points} for fields in (before, after))
        for pair, stop, a, b in self._moves(before, after, one | other):
            if not pair.passable:
                continue
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
        middle = 0.125 * tangents_turned(before, after)
        one, other = ({point.pair for point in fields.model.mesh.points} for fields in (before, after))
        for pair, stop, a, b in self._moves(before, after, one & other):
            far = np.linalg.norm(b - a, axis=1)
            for share in SHARES:
                here = a + share * (b - a)
                apart = np.einsum("ni,ni->n", (here - stop.place) @ stop.across, stop.normals(here, here))
                aside = 4.0 * share * (1.0 - share) * middle * far
                if (apart - pair.distance < aside - self.tolerance).any():
                    return True
        return self._bulged_between(before, after, middle, one & other)

    def _bulged_between(self, before: Fields, after: Fields, middle: float, known: Collection[PairKey]) -> bool:
        """As :meth:`bulged` between members on the same elements, none of ``known`` pairs."""
        keys = {key for key, pair in self.closest.pairs.items() if pair.stop is None} - {*known}
        if not keys or not before.model.mesh.same(replace(after.model.mesh, points=before.model.mesh.points)):
            return False
        moved = (
            np.linalg.norm(after.positions(name, x) - before.positions(name, x), axis=1).max()
            for name in {name for key in keys for name in key[1]}
            for x in [self.closest.samples(after.model.mesh, name)]
        )
        reach = 2.0 * middle * float(max(moved))
        if reach <= self.tolerance:
            return False
        for share in SHARES:
            for near, far in self.closest.between(before, after, share, reach):
                if near.pair in keys and near.gap < 4.0 * share * (1.0 - share) * middle * far - self.tolerance:
                    return True
        return False

    def _moves(
        self, before: Fields, after: Fields, known: Collection[PairKey]
    ) -> Iterator[tuple[Pair, Obstacle, Array, Array]]:
        """Of members and obstacles that are no ``known`` pairs places (n, 3) in both states, as obstacles see them."""
        for pair in self.closest.pairs.values():
            if pair.stop is None or pair.edge or pair.key in known:
                continue
            x = self.closest.samples(after.model.mesh, pair.members[0])
            places = (f.positions(pair.members[0], x) for f in (before, after))
            a, b = (f.seen(pair.contact, p, p)[0] for f, p in zip((before, after), places, strict=True))
            yield pair, pair.stop, a, b

    def aside(self, before: Fields, after: Fields) -> bool:
        """Whether what begins to touch a round obstacle does so far round it from where it was: it may have gone deep
        into it on the way, where that pushes it to another side.
        """
        had = {point.pair for point in before.model.mesh.points}
        begun = [p for p in points_in(after) if len(p.members) == 1 and not p.edge and p.pair not in had]
        earlier, now = (Placed(self.scene, fields, begun) for fields in (before, after))
        stops = (self.closest.pairs[point.pair].stop for point in begun)
        cosines = [earlier.normal(i, stop) @ now.normal(i, stop) for i, stop in enumerate(stops)]
        return min(cosines, default=1.0) < np.cos(ROUND)


def tangents_turned(before: Fields, after: Fields) -> float:
    """Largest angle between tangents of the same place in two states, rad."""
    most = 1.0
    for member in after.model.members:
        x = np.linspace(0.0, 1.0, 33)
        most = min(most, float(np.einsum("ni,ni->n", before.tangents(member, x), after.tangents(member, x)).min()))
    return float(np.arccos(np.clip(most, -1.0, 1.0)))
