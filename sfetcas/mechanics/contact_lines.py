"""Contact along a line as terms: a member that lies on an obstacle is pressed all along, not at ends of elements.

Each end ``i`` of elements on the line has a force ``N_i``.  Along the elements beside it this is shared out with a
weight ``w_i`` that is largest there, falls evenly to zero at their other ends, and has the integral one: all together
are a pressure that is linear along each element.  Its row is the mean of the gap ``g`` with the same weight,

    d_i - integral w_i(s) g(r(s)) ds = 0,      d_i = 0,

so that the multiplier of the first row is the force.  One force may also be spread along one of both elements alone:
the pressure is then linear along each element, but may jump between them.  With friction further components of ``d_i``
are the means of how far places have moved along directions ``t`` across the normal, and their multipliers are the
friction, also shared out.  The integrals are sums over the points at which elements are integrated.

Source: mortar methods; Wriggers 2006, Computational Contact Mechanics, section 8.3.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, numbers
from .elements import Element
from .mesh import ContactPoint
from .parts import Parts
from .segments import beside_line, place_of_cut, weights_towards
from .terms import One, Side, Term

__all__ = ["Mean", "Pressed", "pressed_along"]


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

    Places: the strains of the element, its start.  Data: tangents and compliances of its points, their undeformed
    places seen from the obstacle, what the gap is measured by, the share of the element, and with friction directions
    across the normal, those of each point together.

    Attributes
    ----------
    element : Element
    gap : Term
        The gap, see :class:`~sfetcas.mechanics.contact_points.Gap`.
    rising : bool
        Whether the weight rises from the start of the element to its end.
    rough : bool
        Whether there is friction.
    """

    element: Element
    gap: Term
    rising: bool
    rough: bool = False

    table: ClassVar[str] = "contacts"
    along_element: ClassVar[bool] = True
    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, its places; a row for each mean."""
        turns, strains, *_ = self.element.sizes
        points, n = len(self.element.points), self.axes
        data = self.element.line_data + points * n + self._ways + 1 + (points * n * (n - 1) if self.rough else 0)
        return turns, strains + 1, n if self.rough else 1, data, 0

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
        """How far points have moved (axes,), their places before, a column each, and directions of each."""
        element, n, points = self.element, self.axes, len(self.element.points)
        line, places, rest = ca.vertsplit(data, [0, element.line_data, element.line_data + points * n, data.shape[0]])
        changed = ca.horzcat(*element.tangents(q, u[:-1], line)) - element.line(line)[0]
        moved = ca.mtimes(changed, ca.DM((element.to_points / element.weights).T))
        ways = ca.vertsplit(rest[self._ways + 1 :], n) if self.rough else []
        each = [ways[k * (n - 1) : (k + 1) * (n - 1)] for k in range(points)]
        return [ca.vertcat(*u[-1]) + moved[:, k] for k in range(points)], ca.reshape(places, n, points), each

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
        return [part for force in told for part in (*ca.vertsplit(force), *[ca.SX(0)] * (3 - n))]


def pressed_along(parts: Parts, point: ContactPoint, gap: Term, ways: list[Array], origin: Array) -> Iterator[One]:
    """Terms of one end of elements on a line.

    Parameters
    ----------
    parts : Parts
    point : ContactPoint
    gap : Term
        How it is measured, see :class:`~sfetcas.mechanics.contact_points.Gap`.
    ways : list of ndarray
        Directions that belong to the data of that.
    origin : ndarray (3,)
        Place of the obstacle, m.
    """
    member, unit, axes, grip = point.members[0], parts.scales.length, parts.element.axes, point.grip
    yield One(
        Mean(parts.element.space, grip is not None),
        point.name,
        "",
        np.zeros(0),
        (),
        (parts.segments.place(point.between),),
        point.name,
    )
    cuts, line, along = parts.mesh.cuts[member], parts.scene.center_lines[member], np.zeros((0, 3))
    if grip is not None:
        along = np.array(grip.along)
    begin = 0
    for element, rising, share in beside_line(parts.mesh, point):
        number = parts.beams.first[member] + element
        x = cuts[element] + parts.element.points * (cuts[element + 1] - cuts[element])
        own = along[begin : begin + len(x) * (axes - 1), :axes]
        begin += len(own)
        data = [
            parts.beams.tangent[number].ravel(),
            parts.beams.compliance[number].ravel(),
            ((line.positions(x) - origin)[:, :axes] / unit).ravel(),
            *(way[:axes] for way in ways),
            np.array([point.distance / unit, share]),
            own.ravel(),
        ]
        start = parts.segments.place(place_of_cut(parts.mesh, parts.segments.ends, member, element))
        yield One(
            Pressed(parts.element.space, parts.element, gap, rising, grip is not None),
            point.name,
            "",
            numbers(np.concatenate(data)),
            tuple(parts.rotations.turns[number].tolist()),
            (*parts.segments.strains[number].tolist(), start),
            point.name,
            element=number,
        )
