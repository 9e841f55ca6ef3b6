"""Rings as terms: a node stays on the centre line of a member, at a place that is an unknown.

With the arc length ``s`` of the ring, in the undeformed member, the constraint is

    u(node) - u(start of the member) - (r(s) - r(0)) + (r_0(s_0) - r_0(0)) = 0,

where ``r`` is the line as it is and ``r_0`` the undeformed one, at which the ring begins at ``s_0``.  Along an element
the line is the integral of the polynomial through the tangents at its points: it ends where the chord ends.  Each
element adds its part up to ``s``, so that the place goes from element to element by itself; the tangent is continuous
there, hence the constraint has continuous derivatives.  The multiplier is the force of the ring on the member with its
sign reversed; that the Lagrangian is stationary in ``s`` says that this force is normal to the tangent.

The place is the first displacement of a place of its own, as arc length over the unit of length since ``s_0``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import numbers
from .elements import Element
from .parts import Parts
from .segments import place_of_ring
from .terms import One, Side, Term

__all__ = ["Driven", "Guided", "GuidedTerm", "Ringed", "guided", "reach_of_rings", "rings_in", "up_to"]


@dataclass(frozen=True)
class GuidedTerm(Term):
    """The share of one element in a constraint on the place of its member at an unknown arc length.

    Data: tangents and compliances of the points of the element, then arc lengths of its start and its end, and ``s_0``.

    Attributes
    ----------
    element : Element
    first, last : bool
        Whether it is the first and the last element of its member, which go on beyond the end.
    opposite : bool
        Whether the place of the member counts with the other sign.
    """

    along_element: ClassVar[bool] = True
    shares_row: ClassVar[bool] = True
    pulls: ClassVar[bool] = True

    element: Element
    first: bool
    last: bool
    opposite: bool = False

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element and its strains; behind these the place along the member, once for each row.

        The forces on it cancel from row to row: sides of their own let it be seen beside what they are zero.
        """
        turns, strains, *_ = self.element.sizes
        return turns, strains + self.axes, self.axes, self.element.line_data + 3, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The part of the element up to ``s_0``, undeformed, less that up to ``s``."""
        start, end, begin = ca.vertsplit(data[-3:])
        line = data[:-3]
        now = ca.horzcat(*self.element.tangents(q, u[: -self.axes], line))
        rest = ca.mtimes(self.element.line(line)[0], self._weights(begin, start, end))
        moved = [self._weights(begin + place[0], start, end) for place in u[-self.axes :]]
        return [self._signed(rest[i] - ca.mtimes(now[i, :], here)) for i, here in enumerate(moved)]

    def _signed(self, value: ca.SX) -> ca.SX:
        return -value if self.opposite else value

    def _weights(self, s: ca.SX, start: ca.SX, end: ca.SX) -> ca.SX:
        """Weights (points,) of the tangents of the points in the line from the start of the element up to ``s``."""
        here = (s - start) / (end - start)
        if not self.last:
            here = ca.if_else(s <= end, here, 1.0)
        if not self.first:
            here = ca.if_else(s > start, here, 0.0)
        return up_to(self.element, here)

    def pull(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The force that the element carries to the place, at its start."""
        begins = 1.0 if self.first else ca.if_else(data[-1] + u[-1][0] > data[-3], 1.0, 0.0)
        return ca.vertsplit(-self._signed(lam) * begins)


@final
@dataclass(frozen=True)
class Guided(GuidedTerm):
    """The share of one element in the constraint of a ring."""

    table: ClassVar[str] = "rings"


def up_to(element: Element, here: Any) -> Any:
    """Weights (points,) of the tangents of the points of an element in the line from its start up to ``here``, a symbol
    from 0 to 1.

    These tangents are times length and weight, so that up to 1 all weights are one.
    """
    # Powers of what goes from -1 to 1 keep their digits up to the highest order.
    t = 2.0 * here - 1.0
    powers = np.vander(2.0 * element.points - 1.0, increasing=True)
    raised = [(t ** (k + 1) - (-1.0) ** (k + 1)) / (2.0 * (k + 1)) for k in range(len(element.points))]
    return ca.mtimes(ca.DM(np.linalg.inv(powers).T / element.weights[:, None]), ca.vertcat(*raised))


@final
@dataclass(frozen=True)
class Ringed(Term):
    """The share of the node of a ring, and of the first node of its member; the third place is that of the ring."""

    table: ClassVar[str] = "rings"
    answers: ClassVar[Mapping[str, str]] = {"moved": "m", **{f"force {axis}": "N" for axis in "xyz"}}
    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Three places; no data."""
        return 0, 3, self.axes, 0, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The displacement of the node since that of the start of the member."""
        return [node - start for node, start in zip(u[0], u[1], strict=True)]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """How far the ring has moved along the member, and its force on the member (3,)."""
        return [u[2][0], *ca.vertsplit(lam), *[ca.SX(0)] * (3 - self.axes)]


@final
@dataclass(frozen=True)
class Driven(Term):
    """Constraint: how far a ring moves along its member is prescribed."""

    table: ClassVar[str] = "rings"
    drives: ClassVar[str] = "travel"
    answers: ClassVar[Mapping[str, str]] = {"drive": "N"}

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row, one load."""
        return 0, 1, 1, 0, 1

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The arc length that the ring has moved less the prescribed one."""
        return [u[0][0] - load[0]]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The force on the ring along the member, towards its second node."""
        return [-lam[0]]


def rings_in(parts: Parts) -> Iterator[One]:
    """Terms of the rings of a scene."""
    scene, segments, unit = parts.scene, parts.segments, parts.scales.length
    for name, ring in scene.rings.items():
        place, row = segments.place(place_of_ring(name)), f"rings.{name}"
        start = segments.place(segments.ends[ring.member, 0])
        places = (segments.place(ring.node), start, place)
        yield One(Ringed(parts.element.space), name, ring.node, np.zeros(0), (), places, row)
        yield from guided(parts, Guided, (name, row), (ring.member, scene.ring_places[name]), place)
        if ring.travel is not None:
            load = {ring.history: np.reshape(numbers(ring.travel / unit), (1,))}
            yield One(Driven(parts.element.space), name, "", np.zeros(0), (), (place,), f"{row}.travel", load)


def guided(
    parts: Parts,
    kind: type[GuidedTerm],
    names: tuple[str, str],
    at: tuple[str, float],
    place: int,
    opposite: bool = False,
) -> Iterator[One]:
    """The shares of all elements of a member in the constraint on one of its places.

    Parameters
    ----------
    parts : Parts
    kind : subclass of GuidedTerm
    names : (str, str)
        Name of the record and of the rows.
    at : (str, float)
        The member, and where the place begins, a fraction of its length.
    place : int
        Number of the place whose first displacement is how far it has moved; the ground where it stays.
    opposite : bool
        As of :class:`GuidedTerm`.
    """
    member, unit = at[0], parts.scales.length
    length = parts.scene.center_lines[member].length / unit
    cuts, first = parts.mesh.cuts[member], parts.beams.first[member]
    for i in range(len(cuts) - 1):
        term = kind(parts.element.space, parts.element, i == 0, i == len(cuts) - 2, opposite)
        number = first + i
        line = [parts.beams.tangent[number].ravel(), parts.beams.compliance[number].ravel()]
        ends = [np.reshape(numbers(s), (1,)) for s in (cuts[i] * length, cuts[i + 1] * length, at[1] * length)]
        turns = tuple(parts.rotations.turns[number].tolist())
        sides = (*parts.segments.strains[number].tolist(), *[place] * parts.element.axes)
        data = numbers(np.concatenate([*line, *ends]))
        yield One(term, names[0], "", data, turns, sides, names[1], element=number)


def reach_of_rings(model: Any) -> Iterator[tuple[int, float, float]]:
    """Of each ring of a model the number of the unknown displacement that is its place, and least and largest value.

    Between these it is on its member; dimensionless.
    """
    for name, ring in model.scene.rings.items():
        number = int(model.positions.retained[model.segments.place(place_of_ring(name)), 0])
        length = model.scene.center_lines[ring.member].length / model.scales.length
        at = model.scene.ring_places[name]
        yield number, -at * length, (1.0 - at) * length
