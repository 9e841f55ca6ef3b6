"""Contact along a line as terms: a member that lies on an obstacle is pressed all along, not at ends of elements.

Each end ``i`` of elements on the line has a force ``N_i``.  Along the elements beside it this is shared out with a
weight ``w_i`` that is largest there, falls evenly to zero at their other ends, and has the integral one: all together
are a pressure that is linear along each element.  Its row is the mean of the gap ``g`` with the same weight,

    d_i - integral w_i(s) g(r(s)) ds = 0,      d_i = 0,

so that the multiplier of the first row is the force.  One force may also be spread along one of both elements alone:
the pressure is then linear along each element, but may jump between them.  With friction further components of ``d_i``
are the means of how far places have moved along directions ``t`` across the normal, and their multipliers are the
friction, also shared out.  The integrals are sums over the points at which elements are integrated.
All this is seen from an obstacle that a node carries, as in :mod:`~sfetcas.mechanics.contact_points`.

Source: mortar methods; Wriggers 2006, Computational Contact Mechanics, section 8.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, numbers
from .elements import Element
from .mesh import ContactPoint
from .parts import Parts
from .segments import beside_line, place_of_cut, standing, weights_towards
from .terms import One, Side, Term

__all__ = ["Carrier", "Mean", "Pressed", "Tangential", "carrier_of", "pressed_along", "tangential_at"]


@dataclass(frozen=True, eq=False)
class Carrier:
    """The node that carries the obstacle of a point.

    Attributes
    ----------
    node : str
        Empty where the obstacle stays.
    turns, places : tuple of int
        Numbers of its rotation and its place.
    arm : ndarray (3,)
        Place of the obstacle in the undeformed scene, seen from the node, m.
    """

    node: str = ""
    turns: tuple[int, ...] = ()
    places: tuple[int, ...] = ()
    arm: Array = field(default_factory=lambda: np.zeros(0))


def carrier_of(parts: Parts, contact: str) -> Carrier:
    """What carries the obstacle of a contact."""
    node = parts.scene.contacts[contact].node
    turn = None if node is None else parts.rotations.node_turn[node]
    if node is None or turn is None:
        return Carrier()
    arm = parts.scene.obstacles[contact].place - numbers(parts.scene.nodes[node].position)
    return Carrier(node, (turn,), (parts.segments.place(node),), arm)


@final
@dataclass(frozen=True)
class Mean(Term):
    """The means themselves.

    Attributes
    ----------
    rough : bool
        Whether there is friction.
    """

    rough: bool = False

    table: ClassVar[str] = "contacts"
    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place; no data."""
        return 0, 1, self.axes if self.rough else 1, 0, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The means."""
        return list(u[0][: self.sizes[2]])


@final
@dataclass(frozen=True)
class Pressed(Term):
    """The share of one element in the means of one of its ends.

    Places: the strains of the element, its start, and that of the node which carries the obstacle, whose rotation is
    the last.  Data: tangents and compliances of its points, their undeformed places seen from the obstacle, what the
    gap is measured by, the share of the element, with friction directions across the normal, those of each point
    together, and the place of the obstacle seen from its node.

    Attributes
    ----------
    element : Element
    gap : Term
        The gap, see :class:`~sfetcas.mechanics.contact_points.Gap`.
    rising : bool
        Whether the weight rises from the start of the element to its end.
    rough : bool
        Whether there is friction.
    carried : bool
        Whether a node carries the obstacle.
    """

    element: Element
    gap: Term
    rising: bool
    rough: bool = False
    carried: bool = False

    table: ClassVar[str] = "contacts"
    along_element: ClassVar[bool] = True
    shares_row: ClassVar[bool] = True

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return self.carried

    @property
    def largest_at(self) -> int:
        """The end of elements that it belongs to."""
        return int(self.rising)

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, its places; a row for each mean."""
        turns, strains, *_ = self.element.sizes
        points, n, more = len(self.element.points), self.axes, int(self.carried)
        data = self.element.line_data + points * n + self._ways + 1 + (points * n * (n - 1) if self.rough else 0)
        return turns + more, strains + 1 + more, n if self.rough else 1, data + n * more, 0

    @property
    def _ways(self) -> int:
        """Data of the gap before the place of its member: directions; behind it is the distance."""
        return self.gap.sizes[3] - self.axes

    @property
    def answers(self) -> dict[str, str]:  # type: ignore[override]
        """Components of the push and of the friction at each point of the element."""
        side = "before" if self.rising else "beyond"
        kinds = ("push", "friction") if self.rough else ("push",)
        points = range(len(self.element.points))
        return {f"{kind} {axis} at {k} {side}": "N" for kind in kinds for k in points for axis in "xyz"}

    def _split(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[list[ca.SX], ca.SX, list[list[ca.SX]]]:
        """How far points have moved (axes,), as the obstacle sees it, their places before, a column each, and
        directions of each.
        """
        element, n, points = self.element, self.axes, len(self.element.points)
        turns, strains, *_ = element.sizes
        line, places, rest = ca.vertsplit(data, [0, element.line_data, element.line_data + points * n, data.shape[0]])
        changed = ca.horzcat(*element.tangents(q[:turns], u[:strains], line)) - element.line(line)[0]
        moved = ca.mtimes(changed, ca.DM((element.to_points / element.weights).T))
        ways = ca.vertsplit(rest[self._ways + 1 :], n) if self.rough else []
        each = [ways[k * (n - 1) : (k + 1) * (n - 1)] for k in range(points)]
        before = ca.reshape(places, n, points)
        found = [ca.vertcat(*u[strains]) + moved[:, k] for k in range(points)]
        return [self._seen(q, u, data, one, before[:, k]) for k, one in enumerate(found)], before, each

    def _seen(self, q: list[Side], u: list[Side], data: ca.SX, moved: ca.SX, before: ca.SX) -> ca.SX:
        """How far a point has moved that was at a place before, as the obstacle sees it."""
        if not self.carried:
            return moved
        arm = ca.vertcat(*self.turned_forth(q[-1], ca.vertsplit(data[-self.axes :])))
        moved = moved - ca.vertcat(*u[-1]) - arm
        return moved + ca.vertcat(*self.turned_back(q[-1], ca.vertsplit(before + moved)))

    def _shares(self, data: ca.SX) -> list[ca.SX]:
        """Weights of the points."""
        points = self.element.points if self.rising else 1.0 - self.element.points
        start = self.element.line_data + len(points) * self.axes + self._ways
        return [data[start] * w for w in weights_towards(points, self.element.weights).tolist()]

    def _gap_data(self, data: ca.SX, place: ca.SX) -> ca.SX:
        """Data of the gap of a point that was at a place, seen from the obstacle."""
        first = self.element.line_data + len(self.element.points) * self.axes
        *ways, distance = ca.vertsplit(data[first : first + self._ways])
        return ca.vertcat(*ways, place, distance)

    def _gap(self, moved: ca.SX, data: ca.SX) -> ca.SX:
        (gap,) = self.gap.residual([], [ca.vertsplit(moved)], data, ca.SX(0, 1))
        return gap

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Minus the share of the element in the means."""
        moved, places, ways = self._split(q, u, data)
        rows = [ca.SX(0)] * self.sizes[2]
        for k, share in enumerate(self._shares(data)):
            means = [self._gap(moved[k], self._gap_data(data, places[:, k])), *(ca.dot(w, moved[k]) for w in ways[k])]
            rows = [row - share * mean for row, mean in zip(rows, means, strict=True)]
        return rows

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The forces on the points, across and along."""
        moved, places, ways = self._split(q, u, data)
        at, n = ca.SX.sym("moved", self.axes), self.axes
        across, along = list[ca.SX](), list[ca.SX]()
        for k, share in enumerate(self._shares(data)):
            normal = ca.gradient(self._gap(at, self._gap_data(data, places[:, k])), at)
            across.append(share * lam[0] * ca.substitute(normal, at, moved[k]))
            friction = sum((lam[i + 1] * way for i, way in enumerate(ways[k])), start=ca.SX.zeros(n))
            along.append(share * friction)
        told = [*across, *(along if self.rough else [])]
        if self.carried:
            told = [ca.vertcat(*self.forth(q[-1], ca.vertsplit(force))) for force in told]
        return [part for force in told for part in (*ca.vertsplit(force), *[ca.SX(0)] * (3 - n))]


@final
@dataclass(frozen=True)
class Tangential(Term):
    """Constraint: where elements end at a point of contact the member is tangential to the obstacle.

    Places: the strains of the element, the vector of the point.  The rotation of the node that carries the obstacle is
    the last.  Data: tangents and compliances of the points of the element, the length of the tangent, and what the gap
    is measured by.

    Attributes
    ----------
    element : Element
    gap : Term
        The gap, see :class:`~sfetcas.mechanics.contact_points.Gap`.
    last : bool
        Whether the element ends there; else it begins there.
    """

    element: Element
    gap: Term
    last: bool

    table: ClassVar[str] = "contacts"
    along_element: ClassVar[bool] = True

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return bool(self.gap.sizes[0])

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, its places; one row."""
        turns, strains, *_ = self.element.sizes
        return turns + self.gap.sizes[0], strains + 1, 1, self.element.line_data + 1 + self.gap.sizes[3], 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Sine of the angle between the member and the obstacle."""
        turns, strains, *_ = self.element.sizes
        line, length, rest = ca.vertsplit(data, [0, self.element.line_data, self.element.line_data + 1, data.shape[0]])
        tangent = self.element.tangents(q[:turns], u[:strains], line)[-1 if self.last else 0] / length
        # By how much the gap changes where its vector does along the member.
        moved = ca.SX.sym("moved", self.axes)
        (gap,) = self.gap.residual(q[turns:], [ca.vertsplit(moved)], rest, load)
        there = ca.substitute(ca.gradient(gap, moved), moved, ca.vertcat(*u[strains]))
        return [ca.dot(there, tangent)]


def tangential_at(parts: Parts, point: ContactPoint, gap: Term, data: Array, carrier: Carrier) -> One:
    """The term of a point at which elements of a member end.

    Parameters
    ----------
    parts : Parts
    point : ContactPoint
    gap : Term
        How its gap is measured, with its data.
    data : ndarray
        These.
    carrier : Carrier
        What carries the obstacle.
    """
    member, cut = point.members[0], standing(parts.mesh, point, 0)
    assert cut is not None
    number = parts.beams.first[member] + max(cut - 1, 0)
    tangents = parts.beams.tangent[number]
    length = np.linalg.norm(tangents[-1 if cut else 0])
    own = [tangents.ravel(), parts.beams.compliance[number].ravel(), np.array([length]), data]
    return One(
        Tangential(parts.element.space, parts.element, gap, cut > 0),
        point.name,
        carrier.node,
        numbers(np.concatenate(own)),
        (*parts.rotations.turns[number].tolist(), *carrier.turns),
        (*parts.segments.strains[number].tolist(), parts.segments.place(point.between)),
        f"{point.name}, tangent",
        element=number,
    )


def pressed_along(
    parts: Parts, points: Sequence[ContactPoint], gap: Term, ways: list[Array], origin: Array, distance: Any
) -> dict[str, list[One]]:
    """Terms of ends of elements on a line, those of each point by its name.

    Parameters
    ----------
    parts : Parts
    points : sequence of ContactPoint
        Of one member on one obstacle, all with friction or all without.
    gap : Term
        How it is measured, see :class:`~sfetcas.mechanics.contact_points.Gap`.
    ways : list of ndarray
        Directions that belong to the data of that.
    origin : ndarray (3,)
        Place of the obstacle, m.
    distance : float
        From it, or the plane, to the centre line, m.
    """
    segments, element, mesh, unit = parts.segments, parts.element, parts.mesh, parts.scales.length
    axes = element.axes
    member, rough, carrier = points[0].members[0], points[0].grip is not None, carrier_of(parts, points[0].contact)
    cuts, first = mesh.cuts[member], parts.beams.first[member]
    each = [(point, *one) for point in points for one in beside_line(mesh, point)]
    own, n = np.array([cut for _, cut, *_ in each]), len(each)
    number, begins = first + own, cuts[own]
    x = begins[:, None] + element.points * (cuts[own + 1] - begins)[:, None]
    places = parts.scene.center_lines[member].positions(x.ravel()) - origin
    along = [np.array(point.grip.along)[:, :axes] for point in points if point.grip is not None]
    every = np.ones((n, 1))
    data = [
        parts.beams.tangent[number].reshape(n, -1),
        parts.beams.compliance[number].reshape(n, -1),
        (places[:, :axes] / unit).reshape(n, -1),
        *(every * way[:axes] for way in ways),
        every * (distance / unit),
        numbers([share for *_, share in each])[:, None],
        *([np.concatenate(along).reshape(n, -1)] if rough else []),
        every * (carrier.arm[:axes] / unit),
    ]
    rows = numbers(np.concatenate(data, axis=1))
    pressed = {ends: Pressed(element.space, element, gap, ends, rough, bool(carrier.node)) for ends in (False, True)}
    mean = Mean(element.space, rough)
    found = {
        point.name: [One(mean, point.name, "", np.zeros(0), (), (segments.place(point.between),), point.name)]
        for point in points
    }
    turns, strains = parts.rotations.turns[number].tolist(), segments.strains[number].tolist()
    for i, (point, cut, rising, _) in enumerate(each):
        start = segments.place(place_of_cut(mesh, segments.ends, member, cut))
        sides = (*turns[i], *carrier.turns), (*strains[i], start, *carrier.places)
        one = One(pressed[rising], point.name, carrier.node, rows[i], *sides, point.name, element=first + cut)
        found[point.name].append(one)
    return found
