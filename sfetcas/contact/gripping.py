"""Friction where members touch at points: where each has slipped from, and whether it sticks or slides.

How far places slip is measured from the last state of the way, in which they touched already, or from where they were
when they began to touch: between the two states that is in the ratio of the gaps.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..description.obstacles import Obstacle
from ..description.scene import Scene
from ..mathematics.arrays import Array, unit
from ..mechanics.balance import three
from ..mechanics.contact_joints import directions_along
from ..mechanics.fields import Fields
from ..mechanics.mesh import YIELDING, ContactPoint, Grip, Mesh, Vector
from ..mechanics.segments import stations_of_line
from .closest import Closest
from .pairs import Near, PairKey

__all__ = ["CENTRED", "FIRM", "Gripping", "Placed"]

CENTRED = 1e-5
"""Angle, rad, and share of the size of the scene, by which a point may have moved from where friction is set up there:
what that leaves out is of second order.
"""

FIRM = (1e4, 1.0, 1e6, 0.0)
"""Numbers ``c`` of :mod:`~sfetcas.mechanics.contact_points`, dimensionless, that are tried one after the other; with
the last what is new sticks, all else has the first.
"""

SOFT, STRONG = 1e-2, 16.0
"""How far what is rough gives way at first, dimensionless, and by how much friction is larger, where none of these
numbers leads to a state.
"""


class Placed:
    """Where points are in a state: all of a member at once; on an obstacle that moves as it sees them.

    Attributes
    ----------
    places, tangents : list of list of ndarray (3,)
        Of each point positions, m, and unit tangents of its members.
    vectors : list of ndarray (3,)
        From the second centre line, or the obstacle, to the first, m.
    """

    def __init__(self, scene: Scene, fields: Fields, points: Sequence[ContactPoint | Near]) -> None:
        sides = [(i, side) for i, point in enumerate(points) for side in range(len(point.members))]
        self.places: list[list[Array]] = [[np.zeros(3)] * len(point.members) for point in points]
        self.tangents: list[list[Array]] = [[np.zeros(3)] * len(point.members) for point in points]
        for member in {member for point in points for member in point.members}:
            chosen = [(i, side) for i, side in sides if points[i].members[side] == member]
            at = np.array([points[i].at[side] for i, side in chosen])
            found = zip(chosen, fields.positions(member, at), fields.tangents(member, at), strict=True)
            for (i, side), *here in found:
                if fields.motion_of(points[i].contact) is not None:
                    here = [part[0] for part in fields.seen(points[i].contact, *(part[None] for part in here))]
                self.places[i][side], self.tangents[i][side] = here
        self._points, self._normals = points, dict[tuple[str, int], dict[int, Array]]()
        self.vectors = [
            here[0] - (here[1] if len(here) == 2 else scene.obstacles[point.contact].place)
            for here, point in zip(self.places, points, strict=True)
        ]

    def normal(self, i: int, stop: Obstacle | None) -> Array:
        """Unit normal (3,) at a point, on an obstacle or on the second member."""
        if stop is None:
            # Centre lines that cross, as none do that rest, may as well be on either side of each other.
            across = (self.vectors[i], np.cross([0.0, 0.0, 1.0], self.tangents[i][0]), np.array([1.0, 0.0, 0.0]))
            return unit(next(vector for vector in across if vector.any()))
        contact = self._points[i].contact
        if (key := (contact, id(stop))) not in self._normals:
            # Those of all points on the obstacle.
            own = [k for k, point in enumerate(self._points) if point.contact == contact]
            places, tangents = (np.array([part[k][0] for k in own]) for part in (self.places, self.tangents))
            self._normals[key] = dict(zip(own, stop.normals(places, tangents), strict=True))
        return self._normals[key][i]


@dataclass(eq=False)
class Gripping:
    """Friction of a scene on a way.

    Attributes
    ----------
    scene : Scene
    closest : Closest
    since : Fields or None
        The last state of the way; None where there is none, so that nothing has slipped.
    firm, yields : float
        As of :class:`~sfetcas.mechanics.mesh.Grip`.
    strength : float
        Coefficients of friction over those of the scene.
    """

    scene: Scene
    closest: Closest
    since: Fields | None = None
    firm: float = FIRM[0]
    yields: float = YIELDING
    strength: float = 1.0

    def change(self) -> None:
        """Take the next of the numbers that Newton's method depends on."""
        self.firm = FIRM[(FIRM.index(self.firm) + 1) % len(FIRM)]

    def soften(self, part: float) -> None:
        """Let what is rough give way: at 0 by much, and it sticks; friction then falls to that of the scene, and from
        the middle on what sticks gets firm, which it is at 1.
        """
        limits, firms = min(1.0, 2.0 * part), max(0.0, 2.0 * part - 1.0)
        self.firm = FIRM[-1] if part <= 0.0 else FIRM[1] if part < 1.0 else FIRM[0]
        self.yields, self.strength = SOFT * (YIELDING / SOFT) ** firms, STRONG ** (1.0 - limits)

    def set_up(self, fields: Fields, mesh: Mesh, points: Sequence[ContactPoint]) -> tuple[ContactPoint, ...]:
        """Points on a mesh with their friction where they are now."""
        if not self.scene.rubs:
            return tuple(points)
        now = Placed(self.scene, fields, points)
        before = now if self.since is None else Placed(self.scene, self.since, points)
        set_up = [self._set_up(fields, point, i, now, before) for i, point in enumerate(points)]
        for key, numbers in _on_lines(set_up).items():
            own = [set_up[i] for i in numbers]
            for i, point in zip(numbers, self._along_line(fields, mesh, key, own), strict=True):
                set_up[i] = point
        return tuple(set_up)

    def _set_up(self, fields: Fields, point: ContactPoint, i: int, now: Placed, before: Placed) -> ContactPoint:
        coefficient = self.scene.contacts[point.contact].friction
        if not coefficient:
            return point
        normal, vector, apart = now.normal(i, self.closest.pairs[point.pair].stop), now.vectors[i], before.vectors[i]
        if point.grip is None and not point.new:
            # Beside what touches already it has hardly moved before it touches.
            touched, share = np.zeros(3), 0.0
        elif point.grip is None or self.since is None:
            # The share of the way to this state after which they touched.
            distance = self.closest.pairs[point.pair].distance
            begin, end = float(normal @ apart) - distance, float(normal @ vector) - distance
            share = float(np.clip(begin / (begin - end), 0.0, 1.0)) if begin > end else 0.0
            touched = share * (vector - apart)
        else:
            touched, share = np.array(point.grip.touched), point.grip.share
        # Along a line they follow for all points of it.
        frame, earlier, here = tuple[Vector, ...](), tuple[Vector, ...](), tuple[Vector, ...]()
        origin: Vector = (0.0, 0.0, 0.0)
        if not point.line:
            frame = tuple(_told(three(way)) for way in directions_along(normal[: fields.model.element.axes]))
            origin = _told(apart + touched)
            earlier, here = (tuple(map(_told, placed.tangents[i])) for placed in (before, now))
        firm = self.firm or (0.0 if point.new else FIRM[0])
        strength = coefficient * self.strength
        return replace(
            point, grip=Grip(strength, firm, frame, origin, earlier, here, _told(touched), share, yields=self.yields)
        )

    def _along_line(
        self, fields: Fields, mesh: Mesh, pair: PairKey, points: Sequence[ContactPoint]
    ) -> Iterator[ContactPoint]:
        """Points on a line with directions at each of their places."""
        (contact, (member,)), since = pair, fields if self.since is None else self.since
        stations, shares = zip(*(stations_of_line(mesh, point) for point in points), strict=True)
        x, ends = np.concatenate(stations), np.cumsum([len(at) for at in stations])[:-1]
        normals, tangents = self._surface(fields, pair, x)
        ways = [unit(tangents - np.einsum("ni,ni->n", tangents, normals)[:, None] * normals)]
        if fields.model.space:
            ways.append(np.cross(normals, ways[0]))
        directions = np.stack(ways, axis=1)
        places, _ = since.seen(contact, since.positions(member, x), tangents)
        moved = np.einsum("nki,ni->nk", directions, places - self.scene.center_lines[member].positions(x))
        frame = tuple(_told(np.eye(3)[i + 1]) for i in range(len(ways)))
        parts = zip(points, shares, np.split(directions, ends), np.split(moved, ends), strict=True)
        for point, share, along, way in parts:
            assert point.grip is not None
            origin = three(np.array([0.0, *(share @ (way + along @ np.array(point.grip.touched)))]))
            told = tuple(map(tuple, along.reshape(-1, 3).tolist()))
            grip = replace(point.grip, frame=frame, origin=_told(origin), before=(), now=(), along=told)
            yield replace(point, grip=grip)

    def _surface(self, fields: Fields, pair: PairKey, x: Array) -> tuple[Array, Array]:
        """Unit normals (n, 3) of an obstacle at fractions x (n,) of the length of a member on it, and unit tangents
        (n, 3), as the obstacle sees them.
        """
        (contact, (member,)), stop = pair, self.closest.pairs[pair].stop
        assert stop is not None
        places, tangents = fields.seen(contact, fields.positions(member, x), fields.tangents(member, x))
        return stop.normals(places, tangents), tangents

    def begins(self, points: Iterable[ContactPoint], limit: float) -> float | None:
        """Share of a step after which places begin to touch, the first of those that have moved before by more than a
        share of the size of the scene; None where none has.
        """
        late = [
            p.grip for p in points if p.grip is not None and np.linalg.norm(p.grip.touched) > limit * self.scene.size
        ]
        return min((grip.share for grip in late), default=None)

    def begun(self, point: ContactPoint) -> ContactPoint:
        """A point of a state from which the next step of a way begins."""
        if point.grip is None:
            return point
        return replace(point, grip=replace(point.grip, touched=(0.0, 0.0, 0.0), share=0.0))

    def off_centre(self, fields: Fields, points: Sequence[ContactPoint], now: Sequence[ContactPoint]) -> bool:
        """Whether a point has moved so far that friction has to be set up again where it is."""
        if not any(point.grip for point in points):
            return False
        for key, numbers in _on_lines(points).items():
            grips = [(points[i], grip) for i in numbers if (grip := points[i].grip) is not None]
            x = np.concatenate([stations_of_line(fields.model.mesh, point)[0] for point, _ in grips])
            ways = np.concatenate([grip.along for _, grip in grips]).reshape(len(x), -1, 3)
            if np.abs(np.einsum("nki,ni->nk", ways, self._surface(fields, key, x)[0])).max() > CENTRED:
                return True
        placed = Placed(self.scene, fields, now)
        single = (i for i, point in enumerate(points) if point.grip is not None and not point.line)
        return any(self._off(i, points[i], now[i], placed) for i in single)

    def _off(self, i: int, point: ContactPoint, now: ContactPoint, placed: Placed) -> bool:
        assert point.grip is not None
        lengths = [self.closest.lengths[member] for member in point.members]
        along = max(abs(a - b) * size for a, b, size in zip(point.at, now.at, lengths, strict=True))
        turned = np.abs(np.array(point.grip.frame) @ placed.normal(i, self.closest.pairs[now.pair].stop)).max()
        tangents = np.abs(np.array(placed.tangents[i]) - np.array(point.grip.now)).max()
        return bool(along > CENTRED * self.scene.size or turned > CENTRED or tangents > CENTRED)


def _on_lines(points: Sequence[ContactPoint]) -> dict[PairKey, list[int]]:
    """Numbers of the rough points on each line."""
    found: dict[PairKey, list[int]] = {}
    for i, point in enumerate(points):
        if point.line and point.grip is not None:
            found.setdefault(point.pair, []).append(i)
    return found


def _told(vector: Array) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z
