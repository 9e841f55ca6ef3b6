"""Points of contact as terms: where it is on the members are unknowns, the gap is a row.

With the arc lengths ``s`` and ``t`` of a point on the first and the second member, the vector ``d`` between the centre
lines is held by

    d = r_1(s) - r_2(t),      |d| - (radius_1 + radius_2) = 0,

and the multiplier of the second row is minus the contact force.  That the Lagrangian is stationary in ``s`` and ``t``
says that the force is normal to both members: there the distance is least.  The Lagrangian is largest in ``s`` and
``t``, not least: of all places it is the worst that must not penetrate.  Sums over elements as of
:mod:`~sfetcas.mechanics.rings`.

Along a line on an obstacle ``d`` has means of the gap for its components, see :mod:`~sfetcas.mechanics.contact_lines`.
Elsewhere on an obstacle ``d`` begins at its place, a point of a plane, a centre or an axis ``a``, and its gap is

    n . d - radius_1      or      |d - (a . d) a| - (radius_1 + radius),      inside of it with the opposite sign.

On an edge of the direction ``a`` both components of ``d`` across it vanish, ``n . d = 0`` and ``(a x n) . d = 0`` with
any fixed ``n`` across it.  These rows say where the place is; the Lagrangian is not largest in it, and the force is
normal to the member and the edge.  As long as a point is new only the first of them holds, at a place that stays.

An obstacle that a node carries, at ``u_c`` and turned by ``R``, begins at the place to which that has brought it; its
gap is that of ``R^T d``, the vector as the obstacle sees it, and so is all that friction is about.

With friction the force on the first member is ``N n + T``, with ``N`` and the shares ``T_k`` of ``T`` along two
directions across ``n`` as unknowns: the displacements of a place at which nothing else is, and the forces on this place
are what they miss.  With the slip ``v``, how far places of the members that touch have moved along each other since the
last state of a way,

    v = d - d_0 - t_1 s + t_2 t,      v_k = 0 where |w| <= mu N, else T = mu N w / |w|,      w = T - c v,

where ``d_0`` and ``t`` are the vector and the tangents there in the last state: Coulomb's law, whatever the number
``c > 0``, which Newton's method alone depends on.  The force along the members has no part in where the nearest place
is, ``N n . t = 0``.

Source: Konyukhov and Izadi 2015, Introduction to Computational Contact Mechanics, chapter 11 (contact of curves);
Alart and Curnier 1991 (friction as an equation).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.contacts import contact_radius
from ..description.scene import Scene
from ..mathematics.arrays import Array, numbers, unit
from .beams import Scales, load_size
from .contact_lines import Carrier, carrier_of, pressed_along, tangential_at
from .mesh import ContactPoint
from .parts import Parts
from .rings import GuidedTerm, guided
from .segments import place_of_cut, standing
from .terms import GROUND, One, Side, Term

__all__ = ["Apart", "Gap", "Meeting", "contact_points_in", "loads_on", "undeformed_vectors"]


@final
@dataclass(frozen=True)
class Meeting(GuidedTerm):
    """The share of one element of the first or, with the opposite sign, the second member in the vector of a point."""

    table: ClassVar[str] = "contacts"


@final
@dataclass(frozen=True)
class Apart(Term):
    """The share of the vector itself, and of the first nodes of the members, or of the ends of elements where it stays.

    Places: the vector, these, that of the node which carries the obstacle, the places on the members.  Data: the place
    of the obstacle seen from that node.

    Attributes
    ----------
    members : int
        Two, or one on an obstacle.
    carried : bool
        Whether a node carries the obstacle.
    """

    members: int = 2
    carried: bool = False

    table: ClassVar[str] = "contacts"
    answers: ClassVar[Mapping[str, str]] = {
        "moved on first": "m",
        "moved on second": "m",
        **{f"force {axis}": "N" for axis in "xyz"},
    }
    shares_row: ClassVar[bool] = True

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return self.carried

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The places, and of an obstacle that is carried the rotation and data."""
        return int(self.carried), 1 + 2 * self.members + self.carried, self.axes, self.axes * self.carried, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """How far the vector has changed less what the starts of the members have moved."""
        second = [ca.SX(0)] * self.axes
        if self.members == 2:
            second = u[2]
        elif self.carried:
            arm = self.turned_forth(q[0], ca.vertsplit(data))
            second = [place + turned for place, turned in zip(u[2], arm, strict=True)]
        return [between - first + other for between, first, other in zip(u[0], u[1], second, strict=True)]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """How far the point has moved along the members, and the force (3,) on the first one."""
        moved = [*(place[0] for place in u[1 + self.members + self.carried :]), ca.SX(0)][:2]
        return [*moved, *ca.vertsplit(lam), *[ca.SX(0)] * (3 - self.axes)]


@final
@dataclass(frozen=True)
class Gap(Term):
    """Constraint: surfaces touch; data: the vector where the search begins, and the distance.

    Attributes
    ----------
    directed : bool
        Whether the distance is measured along a given normal, whose components are data before the others.
    across : bool
        Whether it is measured across an axis, whose components are data before the others.
    inside : bool
        Whether it is that to something round which members are inside of: it and the distance count with a minus.
    carried : bool
        Whether a node carries what it is measured from, whose rotation then is its side.
    """

    directed: bool
    across: bool = False
    inside: bool = False
    carried: bool = False

    table: ClassVar[str] = "contacts"
    answers: ClassVar[Mapping[str, str]] = {"push": "N"}

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return self.carried

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row."""
        return int(self.carried), 1, 1, self.axes * (1 + self.directed + self.across) + 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The gap."""
        return [self.gap(self.seen(q, u[0], data), data)]

    def seen(self, q: list[Side], u: Side, data: ca.SX) -> ca.SX:
        """How far the vector has changed (axes,), as the obstacle sees it."""
        moved = ca.vertcat(*u)
        if not self.carried:
            return moved
        begin = data[self.sizes[3] - 1 - self.axes : self.sizes[3] - 1]
        return moved + ca.vertcat(*self.turned_back(q[0], ca.vertsplit(begin + moved)))

    def gap(self, moved: ca.SX, data: ca.SX) -> ca.SX:
        """The gap where the vector has changed by some displacement (axes,)."""
        *ways, begin = ca.vertsplit(data[:-1], self.axes)
        between, distance = begin + moved, data[-1]
        if self.directed:
            return ca.dot(ways[0], between) - distance
        if self.across:
            between = between - ca.dot(ways[0], between) * ways[0]
        # On the axis of what is hollow there is no direction.
        return (-1.0 if self.inside else 1.0) * ca.sqrt(ca.sumsqr(between) + NOWHERE) - distance

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The contact force, above zero where it is a push."""
        return [-lam[0]]


@final
@dataclass(frozen=True)
class RoughGap(Term):
    """Contact with friction at a point.

    Places: the vector, the forces, the places on the members.  Data: of the gap, the coefficient, how firm it is, how
    much it yields and resists, directions along, the vector of the last state less that where the search begins,
    tangents of the members in the last state, and now.

    Attributes
    ----------
    smooth : Gap
        The gap.
    members : int
        Two, or one on an obstacle; none where all is measured along directions of its own.
    """

    smooth: Gap
    members: int

    table: ClassVar[str] = "contacts"
    answers: ClassVar[Mapping[str, str]] = {
        "push": "N",
        **{f"friction {axis}": "N" for axis in "xyz"},
        **{f"slip {axis}": "m" for axis in "xyz"},
        "beyond": "N",
    }

    @property
    def has_potential(self) -> bool:
        """It has none."""
        return False

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return self.smooth.carried

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Its places; no rows."""
        data = self.smooth.sizes[3] + LAW + self.axes * (self.axes + 2 * self.members)
        return self.smooth.sizes[0], 2 + self.members, 0, data, 0

    def _law(
        self, u: list[Side], data: ca.SX, friction: ca.SX, slip: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """The slip less what it gives way by, the force that the law is for, its size, its limit, how firm it is."""
        first = self.smooth.sizes[3]
        coefficient, firm, yields, _ = ca.vertsplit(data[first : first + LAW])
        slipped = slip + yields * friction
        way = friction - firm * slipped
        return slipped, way, ca.sqrt(ca.dot(way, way) + NOWHERE), coefficient * ca.fmax(u[1][0], 0.0), firm

    def _parts(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, list[ca.SX]]:
        """The gap, its normal, friction (axes,), the slip (axes,), and the tangents of the members, all as seen from
        the obstacle.
        """
        n, own = self.axes, data[self.smooth.sizes[3] + LAW :]
        vectors = ca.vertsplit(own, n)
        frame, origin, tangents = vectors[: n - 1], vectors[n - 1], vectors[n:]
        vector = ca.SX.sym("vector", n)
        gap = self.smooth.gap(vector, data[: self.smooth.sizes[3]])
        moved = self.smooth.seen(q, u[0], data[: self.smooth.sizes[3]])
        gap, normal = (ca.substitute(one, vector, moved) for one in (gap, ca.gradient(gap, vector)))
        force = sum((share * way for share, way in zip(u[1][1:], frame, strict=True)), start=ca.SX.zeros(n))
        slip = moved - origin
        for place, tangent, sign in zip(u[2:], tangents, (1.0, -1.0), strict=False):
            slip = slip - sign * place[0] * tangent
        along = [one - ca.dot(one, normal) * normal for one in (force, slip)]
        return gap, normal, along[0], along[1], tangents[self.members :]

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """On the vector minus the force of the point; on the forces what they miss; along the members."""
        gap, normal, friction, slip, tangents = self._parts(q, u, data)
        first, n = self.smooth.sizes[3], self.axes
        yields, resists = data[first + 2], data[first + 3]
        frame = ca.vertsplit(data[first + LAW :], n)[: n - 1]
        # The nearest force to w that Coulomb's law allows.
        slipped, way, size, limit, firm = self._law(u, data, friction, slip)
        # What is new sticks: how hard it pushes is not known yet.
        held = ca.logic_or(size <= limit, firm <= 0.0)
        missing = []
        for share, along in zip(u[1][1:], frame, strict=True):
            slides = share - limit * ca.dot(way, along) / size + resists * ca.dot(slip, along)
            missing.append(ca.if_else(held, -ca.dot(slipped, along), slides))
        nothing = [ca.SX(0)] * (n - 1)
        pairs = zip(tangents, (1.0, -1.0), strict=False)
        places = [part for tangent, sign in pairs for part in (sign * ca.dot(friction, tangent), *nothing)]
        moments, force = self._on(q, u, data, u[1][0] * normal + friction)
        return [*moments, *(-part for part in force), -gap - yields * u[1][0], *missing, *places]

    def _on(self, q: list[Side], u: list[Side], data: ca.SX, force: ca.SX) -> tuple[Side, Side]:
        """What a force, as seen from the obstacle, takes from the rotation of its node, and the force (axes,)."""
        if not self.smooth.carried:
            return [], ca.vertsplit(force)
        first = self.smooth.sizes[3]
        turned = ca.vertcat(*self.forth(q[0], ca.vertsplit(force)))
        arm = data[first - 1 - self.axes : first - 1] + ca.vertcat(*u[0])
        moment = ca.cross(arm, turned) if self.space else arm[0] * turned[1] - arm[1] * turned[0]
        return ca.vertsplit(moment), ca.vertsplit(turned)

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The force across, friction (3,) on the first member, how far that has slipped (3,), and by how much the force
        that the law is for is beyond its limit, so that it slides.
        """
        _, _, friction, slip, _ = self._parts(q, u, data)
        _, _, size, limit, _ = self._law(u, data, friction, slip)
        nothing = [ca.SX(0)] * (3 - self.axes)
        forces = [u[1][0], *self._on(q, u, data, friction)[1], *nothing]
        return [*forces, *ca.vertsplit(slip), *nothing, size - limit]


LAW = 4
"""Numbers of the law of friction among the data."""

RESISTS = 1e-10
"""Force over slip, of the loads over the unit of length, that resists what slides beside friction: where a structure
slides at all places, in several directions, it then does so by as little as it can.
"""

LEAST_YIELDING = 1e-13
"""How far what is rough gives way over the force, dimensionless, at least: rounding then does not decide how."""

NOWHERE = 1e-40
"""Square of a force, a slip and a distance that have no direction."""


def undeformed_vectors(scene: Scene, points: Sequence[ContactPoint]) -> list[Array]:
    """Vectors (3,) from second undeformed centre lines, or obstacles, to the first where points begin, m."""
    places: dict[tuple[str, float], Array] = {}
    for member in {member for point in points for member in point.members}:
        at = sorted({x for point in points for m, x in zip(point.members, point.at, strict=True) if m == member})
        found = scene.center_lines[member].positions(np.array(at))
        places |= {(member, x): place for x, place in zip(at, found, strict=True)}
    vectors = []
    for point in points:
        ends = [places[each] for each in zip(point.members, point.at, strict=True)]
        vectors.append(numbers(ends[0] - (ends[1] if len(ends) == 2 else scene.obstacles[point.contact].place)))
    return vectors


def loads_on(scene: Scene, scales: Scales) -> float:
    """Size of the loads, dimensionless, at least one: what is rough gives way, and resists, by shares of it."""
    return max(load_size(scene, scales.length) / scales.moment, 1.0)


def _distance(scene: Scene, point: ContactPoint) -> Any:
    """The distance of a point as the scene says it, m: its radii may depend on parameters."""
    contact = scene.contacts[point.contact]
    if contact.between_members:
        return sum(contact_radius(contact, scene.members[member], scene.sections) or 0.0 for member in point.members)
    return scene.obstacles[point.contact].distance


def contact_points_in(parts: Parts) -> Iterator[One]:
    """Terms of the points where members touch each other or obstacles."""
    segments, unit, axes, space = parts.segments, parts.scales.length, parts.element.axes, parts.element.space
    points, pressed = parts.mesh.points, _of_lines(parts)
    single = [point for point in points if not point.line]
    begins = {p.name: begin for p, begin in zip(single, undeformed_vectors(parts.scene, single), strict=True)}
    size = loads_on(parts.scene, parts.scales) if any(point.grip is not None for point in points) else 0.0
    axis = np.concatenate([np.eye(axes)[0], np.zeros(axes + 1)])
    for point in points:
        between = segments.place(point.between)
        if point.line:
            yield from pressed[point.name]
            yield _held(parts, point, Gap(space, True), axis, np.zeros(3), [], size)
            continue
        begin = begins[point.name]
        slides = [segments.place(point.place(i)) if free else GROUND for i, free in enumerate(point.slides)]
        stands = [standing(parts.mesh, point, side) for side in range(len(point.members))]
        starts = [
            segments.place(place_of_cut(parts.mesh, segments.ends, member, cut or 0))
            for member, cut in zip(point.members, stands, strict=True)
        ]
        carrier = carrier_of(parts, point.contact)
        apart = Apart(space, len(point.members), bool(carrier.node))
        places = (between, *starts, *carrier.places, *slides)
        yield One(apart, point.name, carrier.node, carrier.arm[:axes] / unit, carrier.turns, places, point.name)
        for side, member in enumerate(point.members):
            if stands[side] is not None:
                continue
            yield from guided(parts, Meeting, (point.name,) * 2, (member, point.at[side]), slides[side], side == 1)
        gap, ways = _gap(parts.scene, point, space)
        data = np.concatenate([begin[:axes], numbers([_distance(parts.scene, point)])]) / unit
        if point.met:
            # Where the edge is, both ways across it.
            other = np.cross(parts.scene.obstacles[point.contact].normal, ways[0])[:axes]
            place, row = (between,), f"{point.name}, beside"
            yield One(gap, point.name, "", numbers(np.concatenate([other, data])), (), place, row)
        data = numbers(np.concatenate([*(way[:axes] for way in ways), data]))
        yield _held(parts, point, gap, data, begin, slides, size)
        if point.tangent:
            yield tangential_at(parts, point, gap, data, carrier)


def _of_lines(parts: Parts) -> dict[str, list[One]]:
    """Terms of ends of elements on lines, by names of points: the mean of the gap is a component along a normal."""
    lines, found = dict[Any, list[ContactPoint]](), dict[str, list[One]]()
    for point in parts.mesh.points:
        if point.line:
            lines.setdefault((*point.pair, point.grip is None), []).append(point)
    for points in lines.values():
        stop = parts.scene.obstacles[points[0].contact]
        normal = tuple(stop.normal.tolist()) if stop.kind == "flat" else None
        gap, ways = _gap(parts.scene, replace(points[0], normal=normal), parts.element.space)
        # What is held, means, is not turned.
        gap = replace(gap, carried=False)
        found |= pressed_along(parts, points, gap, ways, stop.place, _distance(parts.scene, points[0]))
    return found


def _held(
    parts: Parts, point: ContactPoint, gap: Gap, data: Array, begin: Array, slides: list[int], size: float
) -> One:
    """The term that holds the gap; with friction the one that finds the forces, under loads of a size."""
    segments, unit, axes, grip = parts.segments, parts.scales.length, parts.element.axes, point.grip
    between = segments.place(point.between)
    carrier = carrier_of(parts, point.contact) if gap.carried else Carrier()
    if grip is None:
        place = (between,)
        return One(gap, point.name, carrier.node, numbers(data), carrier.turns, place, f"{point.name}, gap")
    yields = max(grip.yields / size, LEAST_YIELDING)
    origin = (np.array(grip.origin) - begin)[:axes] / unit
    further = [np.array(one)[:axes] for one in (*grip.before, *grip.now)]
    frame = [np.array(one)[:axes] for one in grip.frame]
    law = [grip.coefficient, grip.firm * size, yields, RESISTS * size]
    data = np.concatenate([data, law, *frame, origin, *further])
    places = (between, segments.place(point.pressed), *slides)
    members = 0 if point.line else len(point.members)
    rough = RoughGap(parts.element.space, gap, members)
    return One(rough, point.name, carrier.node, numbers(data), carrier.turns, places)


def _gap(scene: Scene, point: ContactPoint, space: bool) -> tuple[Gap, list[Array]]:
    """The constraint of a point, and the directions that belong to its data."""
    contact = scene.contacts[point.contact]
    carried = contact.node is not None
    if len(point.members) == 2:
        directed = point.normal is not None
        return Gap(space, directed), [np.array(point.normal)] if directed else []
    stop = scene.obstacles[point.contact]
    if point.normal is not None:
        # That of a plane may depend on parameters.
        return Gap(space, True, carried=carried), [stop.normal if stop.kind == "flat" else np.array(point.normal)]
    across = space and contact.type != "sphere"
    # An edge has its direction for a normal.
    axis = unit(contact.axis) if contact.type in ("circle", "cylinder") else stop.normal
    return Gap(space, False, across, stop.sign < 0.0, carried), [axis] if across else []
