"""Friction where members touch at points: where each has slipped from, and whether it sticks or slides.

How far places slip is measured from the last state of the way, in which they touched already, or from where they were
when they began to touch: between the two states that is in the ratio of the gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array, unit
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Grip, Vector
from .closest import Closest

__all__ = ["FIRM", "Gripping"]

CENTRED = 1e-4
"""Angle, rad, and share of the size of the scene, by which a point may have moved from where friction is set up there:
what that leaves out is of second order.
"""

FIRM = (1e4, 1.0, 1e6, 0.0)
"""Numbers ``c`` of :mod:`~sfetcas.mechanics.contact_points`, dimensionless, that are tried one after the other; with
the last what is new sticks, all else has the first.
"""


@dataclass(eq=False)
class Gripping:
    """Friction of a scene on a way.

    Attributes
    ----------
    scene : Scene
    closest : Closest
    vector : callable
        (fields, point) -> the vector (3,) of a point, m.
    since : Fields or None
        The last state of the way; None where there is none, so that nothing has slipped.
    firm : float
        As of :class:`~sfetcas.mechanics.mesh.Grip`.
    """

    scene: Scene
    closest: Closest
    vector: Callable[[Fields, ContactPoint], Array]
    since: Fields | None = None
    firm: float = FIRM[0]

    def change(self) -> None:
        """Take the next of the numbers that Newton's method depends on."""
        self.firm = FIRM[(FIRM.index(self.firm) + 1) % len(FIRM)]

    def set_up(self, fields: Fields, point: ContactPoint) -> ContactPoint:
        """A point with its friction where it is now."""
        coefficient = self.scene.contacts[point.contact].friction
        if not coefficient:
            return point
        since = fields if self.since is None else self.since
        normal, now = self._normal(fields, point), self._tangents(fields, point)
        apart = self.vector(since, point)
        if point.grip is None or self.since is None:
            # The share of the way to this state after which they touched.
            distance = self.closest.pairs[point.pair].distance
            begin, end = (float(normal @ vector) - distance for vector in (apart, self.vector(fields, point)))
            share = float(np.clip(begin / (begin - end), 0.0, 1.0)) if begin > end else 0.0
            touched = share * (self.vector(fields, point) - apart)
        else:
            touched, share = np.array(point.grip.touched), point.grip.share
        return replace(
            point,
            grip=Grip(
                coefficient,
                self.firm or (0.0 if point.new else FIRM[0]),
                tuple(_told(way) for way in _across(normal, np.array(now[0]), fields.model.space)),
                _told(apart + touched),
                self._tangents(since, point),
                now,
                _told(touched),
                share,
            ),
        )

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
        return (
            point
            if point.grip is None
            else replace(point, grip=replace(point.grip, touched=(0.0, 0.0, 0.0), share=0.0))
        )

    def off_centre(self, fields: Fields, point: ContactPoint, now: ContactPoint) -> bool:
        """Whether a point has moved so far that friction has to be set up again where it is."""
        if point.grip is None:
            return False
        lengths = [self.closest.lengths[member] for member in point.members]
        along = max(abs(a - b) * size for a, b, size in zip(point.at, now.at, lengths, strict=True))
        turned = np.abs(np.array(point.grip.frame) @ self._normal(fields, now)).max()
        tangents = np.array(self._tangents(fields, now)) - np.array(point.grip.now)
        return bool(
            along > CENTRED * self.scene.size or turned > CENTRED or np.abs(tangents).max(initial=0.0) > CENTRED
        )

    def _normal(self, fields: Fields, point: ContactPoint) -> Array:
        """Unit normal (3,) at a point."""
        pair = self.closest.pairs[point.pair]
        if pair.stop is None:
            return unit(self.vector(fields, point))
        (member,), at = point.members, np.array(point.at)
        return np.asarray(pair.stop.normals(fields.positions(member, at), fields.tangents(member, at))[0])

    @staticmethod
    def _tangents(fields: Fields, point: ContactPoint) -> tuple[Vector, ...]:
        """Unit tangents of the members at a point."""
        pairs = zip(point.members, point.at, strict=True)
        return tuple(_told(fields.tangents(member, np.array([at]))[0]) for member, at in pairs)


def _across(normal: Array, tangent: Array, space: bool) -> list[Array]:
    """Unit vectors (3,) across a normal: one in the plane, two in space, the first along a tangent if it can be."""
    first = np.cross([0.0, 0.0, 1.0], normal)
    if not space:
        return [first]
    along = tangent - (tangent @ normal) * normal
    if np.linalg.norm(along) < 1e-3:
        along = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first = unit(along)
    return [first, np.cross(normal, first)]


def _told(vector: Array) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z
