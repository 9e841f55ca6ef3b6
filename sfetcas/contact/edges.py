"""Edges: on which side of them members are, and where what touches one is next.

A place on an edge is where the edge is, so that it takes no search; what can happen is that it comes to an end of its
member.  There it stays as long as the force ``f`` on the member is between the normals of the members that end there:
with unit vectors ``t`` from the node into these members, ``f . t <= 0`` of each.  Where that is above zero the place
slides into the member.  At a free end the member slides off where ``f . t < 0``, and may be on either side then.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..description.obstacles import Obstacle, swept
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint
from ..mechanics.segments import SAME_CUT
from .closest import Closest
from .pairs import Near, Pair, PairKey

__all__ = ["Edges"]

ROUNDING = 1e-9
"""Share of the force on a corner that is none: that along members, and that away from the edge."""

DEVIATION = 0.25
"""How far a way of given length is from its chord over length times turn: 1/8 of an arc, 1/4 of a corner."""

BESIDE = 10.0
"""Distance from an edge, over the penetration that is accepted, from which on the side tells where a member is."""


class Edges:
    """What touches edges, and what passes them.

    Parameters
    ----------
    scene : Scene
    closest : Closest
    tolerance : float
        Penetration that is accepted, m.
    """

    def __init__(self, scene: Scene, closest: Closest, tolerance: float) -> None:
        self.scene, self.closest, self.beside = scene, closest, BESIDE * tolerance
        self.pairs = [pair for pair in closest.pairs.values() if pair.edge]

    # -- sides ------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Members are where they are in the undeformed scene."""
        self.closest.sides |= {pair.key: pair.edge for pair in self.pairs}

    def begin(self, fields: Fields) -> None:
        """See on which sides members are in a state, which others follow: where they are nearly at an edge, as before.

        What passes an edge nowhere is on the side of what it continues, or may come to either.
        """
        sides = self.closest.sides
        touching = {point.pair: point.edge for point in fields.model.mesh.points if point.edge}
        for pair in self.pairs:
            former, sides[pair.key] = sides[pair.key], 0.0
            nearest = min(self.closest.found(fields, np.inf, [pair]), key=lambda one: one.gap, default=None)
            if nearest is not None:
                sides[pair.key] = nearest.edge if nearest.gap > self.beside else former
            sides[pair.key] = touching.get(pair.key, sides[pair.key])
        for _ in self.pairs:
            for pair in (pair for pair in self.pairs if not sides[pair.key]):
                beside = [sides[other.key] * way for end in (0, 1) for other, _, way in self._at_node(pair, end)]
                sides[pair.key] = next((side for side in beside if side), 0.0)

    def crossed(self, before: Fields, after: Fields, turned: float) -> list[Near]:
        """Where members that touch an edge in neither of two states may have passed it between them.

        They are certain to have where they have swept over it.  Ends have moved on arcs, not along their chords: where
        an edge is between the two the step is too long to tell.  ``turned`` is the largest rotation, rad.
        """
        points = [point for fields in (before, after) for point in fields.model.mesh.points if point.edge]
        touching = {point.pair for point in points}
        corners = [point for point in points if point.at[0] in (0.0, 1.0) and not any(point.slides)]
        touching |= {pair.key for point in corners for pair, *_ in self._beside(point)}
        # Where one of two members slides on an edge it does not pass the end that they share.
        held = {(name, node) for name, (member,) in touching for node in self.scene.members[member].nodes}
        found: list[Near] = []
        for pair in (pair for pair in self.pairs if pair.key not in touching):
            ends = zip((0, -1), self.scene.members[pair.members[0]].nodes, strict=True)
            free = [end for end, node in ends if (pair.contact, node) not in held]
            nearest, stop = self._nearest(before, pair), pair.stop
            assert stop is not None
            # What is accepted to be inside by a little has not passed.
            behind = replace(stop, place=stop.place - self.beside * nearest.normal)
            one, other = (self._course(fields, pair) for fields in (before, after))
            if swept(behind, one, other) or any(_beside_way(stop, one[end], other[end], turned) for end in free):
                found.append(nearest)
        return found

    def _nearest(self, fields: Fields, pair: Pair) -> Near:
        """Where a member passes an edge next to it; where it passes it nowhere, a place that is near to it."""
        passing = self.closest.found(fields, np.inf, [pair])
        if passing:
            return min(passing, key=lambda one: abs(one.gap))
        (x, places, _), stop = self.closest.course(fields, pair.members[0]), self.scene.obstacles[pair.contact]
        i = 1 + int(np.argmin(np.linalg.norm((places[1:-1] - stop.place) @ stop.across, axis=1)))
        (near,) = self.closest.beside(fields, pair, x[[i]], np.inf)
        side = float(np.copysign(1.0, near.gap))
        return replace(near, gap=abs(near.gap), normal=side * near.normal, edge=side)

    def _course(self, fields: Fields, pair: Pair) -> Array:
        """Positions (n, 3), m, along a member, that are where it passes an edge not beside it as chords are."""
        x, places, _ = self.closest.course(fields, pair.members[0])
        passing = np.array([one.at[0] for one in self.closest.found(fields, np.inf, [pair])])
        more = fields.positions(pair.members[0], passing)
        return np.insert(places, np.searchsorted(x, passing), more, axis=0)

    # -- ends of members --------------------------------------------------------------------------

    def freed(self, fields: Fields, point: ContactPoint) -> ContactPoint:
        """A point of a state where it slides from where it is, though not beyond ends."""
        at, sliding = point.at[0], any(point.slides)
        if SAME_CUT < at < 1.0 - SAME_CUT or (sliding and -SAME_CUT < at < 1.0 + SAME_CUT):
            return point if sliding else replace(point, slides=(True,), new=False)
        corner = replace(point, at=(float(at > 0.5),), slides=(False,), new=False)
        if sliding:
            return corner
        force = _direction(fields.contact_point(point)["force"])
        into = [force @ self._inwards(fields, pair, end) for pair, end, _ in self._beside(point)]
        if max(into) <= ROUNDING:
            return corner
        pair, end, way = self._beside(point)[int(np.argmax(into))]
        return replace(corner, members=pair.members, at=(float(end),), slides=(True,), edge=way * point.edge)

    def left(self, fields: Fields, point: ContactPoint) -> bool:
        """Whether a point of a state is at an end that the edge would have to pull, or that slides off it."""
        at = point.at[0]
        if SAME_CUT < at < 1.0 - SAME_CUT:
            return False
        held = not self.closest.pairs[point.pair].ends[int(at > 0.5)]
        if not held and (point.new or any(point.slides)):
            return False
        force = _direction(fields.contact_point(point)["force"])
        inwards = [self._inwards(fields, pair, end) for pair, end, _ in self._beside(point)]
        if held or (len(inwards) == 1 and force @ inwards[0] < -ROUNDING):
            self.closest.sides |= {pair.key: 0.0 for pair in self.pairs if pair.contact == point.contact}
            return True
        # Normals of all members, from the first to the second end of that of the point.
        way = (1.0 - 2.0 * float(at > 0.5)) * point.edge
        normals = np.cross(self.scene.obstacles[point.contact].normal, inwards)
        ways = np.array([way if pair.members == point.members else -way for pair, *_ in self._beside(point)])
        return bool((ways * (normals @ force)).max() < -ROUNDING)

    def outwards(self, fields: Fields, point: ContactPoint, pair: Pair, end: int) -> float:
        """Share of the push at an end of a member that is out of it; where it is below zero a point slides in."""
        return -float(_direction(fields.contact_point(point)["force"]) @ self._inwards(fields, pair, end))

    def slides_off(self, pair: Pair, end: int) -> bool:
        """Whether a member on an edge slides off it with an end: nothing else that the edge may push is there."""
        return bool(pair.edge) and not (pair.ends[end] and self._at_node(pair, end))

    def joined(self, points: tuple[ContactPoint, ...]) -> tuple[ContactPoint, ...]:
        """Points of which two that have slid to one node, on members that end there, are one corner."""
        kept: list[ContactPoint] = []
        for point in points:
            beside = (
                {(pair.key, float(end)) for pair, end, _ in self._beside(point)[1:]} if self._ends(point) else set()
            )
            same = [i for i, one in enumerate(kept) if self._ends(one) & beside]
            if same:
                kept[same[0]] = replace(point, at=(float(point.at[0] > 0.5),), slides=(False,))
            else:
                kept.append(point)
        return tuple(kept)

    def _ends(self, point: ContactPoint) -> set[tuple[PairKey, float]]:
        """The end of its member where a point on an edge is, if it is at one."""
        end = float(point.at[0] > 0.5)
        return {(point.pair, end)} if point.met and self.closest.alike(point.pair, point.at, (end,)) else set()

    def _beside(self, point: ContactPoint) -> list[tuple[Pair, int, float]]:
        """The member at the end of which a point is, and others there, as of :meth:`_at_node`."""
        pair, end = self.closest.pairs[point.pair], int(point.at[0] > 0.5)
        return [(pair, end, 1.0), *self._at_node(pair, end)]

    def _at_node(self, pair: Pair, end: int) -> list[tuple[Pair, int, float]]:
        """The others that an edge may push at an end of a member, 0 or 1, their ends there, and whether they run on, 1,
        or back, -1: their sides are others then.
        """
        found, node = list[tuple[Pair, int, float]](), self.scene.members[pair.members[0]].nodes[end]
        for other in self.pairs:
            nodes = self.scene.members[other.members[0]].nodes
            if other.contact == pair.contact and other is not pair and node in nodes:
                found.append((other, nodes.index(node), 1.0 if nodes.index(node) != end else -1.0))
        return found

    def _inwards(self, fields: Fields, pair: Pair, end: int) -> Array:
        """Tangent (3,) from an end of a member into it."""
        return np.asarray((1.0 - 2.0 * end) * fields.slopes(pair.members[0], np.array([float(end)]))[0])


def _beside_way(edge: Obstacle, begin: Array, end: Array, turned: float) -> bool:
    """Whether an edge may be between the way of a place (3,), m, that turns by some angle, rad, and its chord."""
    out, chord = (begin - edge.place) @ edge.across, (end - begin) @ edge.across
    share = np.clip(-(out @ chord) / max(chord @ chord, TINY), 0.0, 1.0)
    return bool(np.linalg.norm(out + share * chord) < DEVIATION * turned * np.linalg.norm(chord))


def _direction(force: Array) -> Array:
    """A force over its size; nothing where there is none."""
    return np.asarray(force / max(float(np.linalg.norm(force)), TINY))
