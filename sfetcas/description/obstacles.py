"""The geometry of obstacles: gaps and normals, of arrays of points, in SI units and fixed axes.

Three kinds: *flat* (a plane), *round* (a circle, cylinder or sphere), and *sharp* (a point in the plane or a line in
space: a member slides over it, and the normal is that of the member).  For members of some
radius it is round.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array, numbers, unit
from .contacts import Contact
from .loads import Motion
from .structure import Node

__all__ = [
    "Obstacle",
    "carriers",
    "check_start",
    "edge_side",
    "edge_slopes",
    "members_of",
    "nearest",
    "obstacle",
    "swept",
    "takes_part",
]


@dataclass(frozen=True, eq=False)
class Obstacle:
    """An obstacle in numbers, SI units and fixed axes.

    Attributes
    ----------
    kind : str
        ``flat``, ``round`` or ``sharp``.
    place : ndarray (3,)
        A point of a plane, a centre, or a point of an edge, m.
    across : ndarray (3, 3)
        Projection onto the directions of the distance: onto the normal, across an axis, across an edge.
    normal : ndarray (3,)
        Unit normal of a plane; direction of an edge (z for a point in the plane); zero for round obstacles.
    radius : float
        m; zero of an edge that members of some radius touch, which then is round.
    sign : float
        1, or -1 where members are inside.
    side : ndarray (3,)
        For an edge: direction towards the permitted side.
    carrier : str or None
        Node with which it moves and turns; all else is said of the undeformed scene then.
    member_radius : float
        Distance of the centre lines of members from their surfaces, m.
    """

    kind: Literal["flat", "round", "sharp"]
    place: Array
    across: Array
    normal: Array
    radius: float = 0.0
    sign: float = 1.0
    side: Array | None = None
    carrier: str | None = None
    member_radius: float = 0.0

    @property
    def distance(self) -> float:
        """Distance of centre lines that touch it from its middle, or from a plane, times the sign, m."""
        return self.member_radius + self.sign * self.radius

    def gaps(self, points: Array, tangents: Array, way: float = 1.0) -> Array:
        """Distances (n,), m, of points (n, 3) of a member, negative inside; of an edge along the member's normal."""
        if self.kind == "round":
            return self.sign * (np.linalg.norm((points - self.place) @ self.across, axis=1) - self.radius)
        return np.einsum("ni,ni->n", points - self.place, self.normals(points, tangents, way))

    def normals(self, points: Array, tangents: Array, way: float = 1.0) -> Array:
        """Unit normals (n, 3), fixed axes, towards the side on which members are allowed."""
        if self.kind == "flat":
            return np.broadcast_to(self.normal, points.shape)
        if self.kind == "round":
            out = (points - self.place) @ self.across
            return self.sign * out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), TINY)
        normals = way * np.cross(self.normal, tangents)
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), TINY))

    def moved(self, turned: Array, shift: Array) -> Obstacle:
        """The obstacle rotated by a matrix (3, 3) about the origin, and then shifted by a vector (3,), m."""
        across = turned @ self.across @ turned.T
        return replace(self, place=turned @ self.place + shift, across=across, normal=turned @ self.normal)

    def curvature(self, point: Array, tangent: Array) -> float:
        """Signed curvature of the section of the obstacle in the plane, 1/m: counter-clockwise along the tangent."""
        if self.kind != "round":
            return 0.0
        out = (point - self.place) / self.radius
        return float(-(out @ np.cross([0.0, 0.0, 1.0], tangent)) / self.radius)


def obstacle(contact: Contact, space: bool) -> Obstacle:
    """The obstacle of a contact in numbers; in the plane a line along z is a point, and one within x-y a wall."""
    eye, thick = np.eye(3), contact.member_radius
    if contact.type == "plane" or (contact.type == "line" and not space and abs(unit(contact.direction)[2]) < 0.5):
        side = None if contact.side is None else np.asarray(contact.side, dtype=float)
        normal = unit(contact.normal) if contact.type == "plane" else np.cross([0, 0, 1.0], unit(contact.direction))
        normal = -normal if side is not None and side @ normal < 0.0 else normal
        at, across = numbers(contact.point), np.outer(normal, normal)
        return Obstacle("flat", at, across, normal, carrier=contact.node, member_radius=thick)
    if contact.type in ("point", "line"):
        point = contact.position if contact.type == "point" else contact.point
        edge = eye[2] if contact.type == "point" else unit(contact.direction)
        side = np.asarray(contact.side, dtype=float)
        kind: Literal["round", "sharp"] = "round" if thick > 0.0 else "sharp"
        return Obstacle(kind, numbers(point), eye - np.outer(edge, edge), edge, side=side, member_radius=thick)
    axis = unit(contact.axis)
    across = eye if contact.type == "sphere" else eye - np.outer(axis, axis)
    sign = -1.0 if contact.side == "inside" else 1.0
    at, radius, nothing = numbers(contact.center), contact.radius or 0.0, np.zeros(3)
    return Obstacle("round", at, across, nothing, radius, sign, carrier=contact.node, member_radius=thick)


def carriers(contacts: Mapping[str, Contact]) -> frozenset[str]:
    """Names of the nodes that carry obstacles."""
    return frozenset(contact.node for contact in contacts.values() if contact.node is not None)


def members_of(contact: Contact, members: Iterable[str]) -> list[str]:
    """Names of the members that an obstacle stops, of all there are."""
    if contact.member is not None:
        return [contact.member]
    return list(members) if contact.members == "all" else list(contact.members or ())


def takes_part(name: str, node: Node, motions: Iterable[Motion], stop: Obstacle) -> bool:
    """Whether an obstacle can push a node: it is free, or its guide leads towards the obstacle and is not driven.

    The node that carries the obstacle moves with it.
    """
    if name == stop.carrier:
        return False
    if node.support == "free":
        return True
    if not node.slides or any(m.node == name and m.displacement is not None for m in motions):
        return False
    if stop.carrier is not None:
        # What turns may come to push along the guide.
        return True
    guide = np.asarray(node.direction, dtype=float)
    towards = stop.normal if stop.kind == "flat" else guide @ stop.across
    return bool(abs(guide @ towards) > tolerances.PARALLEL * np.linalg.norm(guide))


def swept(stop: Obstacle, before: Array, after: Array) -> bool:
    """Whether a curve that moves from points (n, 3) to points (m, 3), m, passes over the middle of an obstacle.

    The closed curve of both and of what joins their ends then winds round the middle.  Planes, spheres, and obstacles
    that members are inside of, cannot be passed over.
    """
    if stop.kind == "flat" or stop.sign < 0.0 or np.linalg.matrix_rank(stop.across) != 2:
        return False
    basis = np.linalg.svd(stop.across)[2][:2]
    around = (np.vstack([before, after[::-1], before[:1]]) - stop.place) @ basis.T
    angles = np.unwrap(np.arctan2(around[:, 1], around[:, 0]))
    return bool(abs(angles[-1] - angles[0]) > np.pi)


Curve = Callable[[Array], Array]


def nearest(edge: Obstacle, positions: Curve, tangents: Curve, samples: Array) -> list[float]:
    """Fractions of the length, near the ``samples`` (n,), at which a curve is locally nearest to an edge."""
    slopes = edge_slopes(edge, positions, tangents, samples)
    found = []
    for i in np.flatnonzero((slopes[:-1] <= 0.0) & (slopes[1:] > 0.0)):
        low, high = samples[i], samples[i + 1]
        for _ in range(FINER):
            inner = np.linspace(low, high, PARTS + 1)
            before = edge_slopes(edge, positions, tangents, inner[1:-1]) <= 0.0
            k = PARTS - 1 if before.all() else int(np.argmin(before))
            low, high = inner[k], inner[k + 1]
        found.append(float(low))
    return found


PARTS, FINER = 32, 10
"""Parts into which a sampling interval is cut, so many times: to rounding."""


def edge_slopes(edge: Obstacle, positions: Curve, tangents: Curve, x: Array) -> Array:
    """Distances (n,) of places of a curve before (negative) an edge, along the tangents there, m."""
    return np.einsum("ni,ni->n", (positions(x) - edge.place) @ edge.across, tangents(x))


def edge_side(edge: Obstacle, positions: Curve, tangents: Curve) -> float:
    """1 or -1: sign of (edge x tangent) on the allowed side, where an undeformed member is nearest to an edge."""
    x = np.linspace(0.0, 1.0, 257)
    near = np.argmin(np.linalg.norm((positions(x) - edge.place) @ edge.across, axis=1))
    normal = np.cross(edge.normal, tangents(x[near : near + 1])[0])
    return 1.0 if edge.side is None or normal @ edge.side >= 0.0 else -1.0


def check_start(obstacle: Obstacle, positions: Curve, tangents: Curve, size: float, radius: float = 0.0) -> None:
    """Refuse a member of given radius, m, that is inside an obstacle in the undeformed scene.

    Raises
    ------
    SceneError
        Where it is how far inside, or that it runs along the side that a point or line names.
    """
    x = np.linspace(0.0, 1.0, 257)
    if obstacle.kind == "sharp":
        x = np.array(nearest(obstacle, positions, tangents, x))
        if not len(x):
            return
        assert obstacle.side is not None
        normals = obstacle.normals(positions(x), tangents(x))
        side = normals @ obstacle.side
        if (np.abs(side) < tolerances.PARALLEL * np.linalg.norm(obstacle.side)).any():
            raise SceneError("passes along the key 'side', accepted: a direction across the member")
        gaps = np.sign(side) * np.einsum("ni,ni->n", positions(x) - obstacle.place, normals) - radius
    else:
        if obstacle.side is not None:
            check_start(replace(obstacle, kind="sharp"), positions, tangents, size, radius)
        gaps = obstacle.gaps(positions(x), tangents(x)) - radius
    deepest = int(np.argmin(gaps))
    if gaps[deepest] < -tolerances.CLOSED * size:
        raise SceneError(f"starts inside, by {-gaps[deepest]:.3g} m at the fraction {x[deepest]:.3g} of its length")
