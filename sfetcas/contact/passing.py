"""Whether members pass through each other, or through obstacles, between two states.

Steps are so short that members are between their places before and after.  What is nearest to something in one state
must not be on its other side in the other one; what touches something round in neither state must not come inside of
it on the straight way; and what begins to touch something round must do so near to where it was seen from there.
Where members pass edges is a question of its own, see :mod:`~sfetcas.contact.edges`.
"""

from __future__ import annotations

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import TINY
from ..mechanics.fields import Fields
from .closest import Closest
from .edges import Edges
from .gripping import Placed
from .lines import points_in
from .pairs import Near

__all__ = ["ROUND", "Passing", "tangents_turned"]

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
        touched = {point.pair for fields in (before, after) for point in fields.model.mesh.points}
        for pair in self.closest.pairs.values():
            stop = pair.stop
            if stop is None or pair.edge or not pair.passable or pair.key in touched:
                continue
            x = self.closest.samples(after.model.mesh, pair.members[0])
            places = (f.positions(pair.members[0], x) for f in (before, after))
            a, b = (f.seen(pair.contact, p, p)[0] for f, p in zip((before, after), places, strict=True))
            first, way = (a - stop.place) @ stop.across, (b - a) @ stop.across
            size = np.maximum(np.einsum("ni,ni->n", way, way), TINY)
            share = np.clip(-np.einsum("ni,ni->n", first, way) / size, 0.0, 1.0)
            if (np.linalg.norm(first + share[:, None] * way, axis=1) < pair.distance - self.tolerance).any():
                return True
        return False

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
