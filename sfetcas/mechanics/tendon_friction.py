"""Friction of tendons in their guides: a tension that changes along the way.

Where a tendon slides over a guide its tension changes by ``dT = -mu T |d tau|``, with the coefficient ``mu`` and the
angle ``|d tau|`` by which its unit tangent ``tau`` turns: falling from the pulled end on where it is pulled, rising
where it is released.  At an eyelet the angle is that between the neighbouring straight pieces; along an element it is
the integral of the curvature of the way, of the derivative of the polynomial through the tangents of its points.

Of a part the generalised forces are its tension times the derivative of its length with the tension held: what guides
take from the tendon by friction is then in them, and no energy gives it.  The tension behind a part, as a vector along
the way over that at the pulled end, is the displacement of a place at which nothing else is, from its value without
friction in the undeformed scene; the force on this place is what it misses to be that of the part.  So each part knows
of the next one alone.

Source: Euler 1762 (Eytelwein's formula); Rao, Peyron, Lilge and Burgner-Kahrs 2021 for the ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.tendons import Stretch, Tendon, breaks_along, tangent
from ..errors import SceneError
from ..mathematics import interpolation
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.quaternion import product
from .parts import Parts
from .segments import tensions_of
from .tendon_terms import Routed, Strung, length_of_piece, loose_in
from .terms import Group, One, Side, Term, rotation_forces

__all__ = ["RigidPart", "Rubbing", "part_of", "rubbing_in", "settle", "turned_since"]


@dataclass(frozen=True)
class _Link(Term):
    """A part of a tendon that rubs.

    Data: number of its piece, its own number from the pulled end on, coefficient with its sign, vectors of the tension
    before and behind it in the undeformed scene; then its own.  Load: the tension at the pulled end.

    Attributes
    ----------
    first, last : bool
        Whether it begins at the pulled end, and whether it ends at the other one.
    """

    table: ClassVar[str] = "tendons"

    first: bool
    last: bool

    @property
    def has_potential(self) -> bool:
        """False."""
        return False

    @property
    def proportional(self) -> bool:
        """False."""
        return False

    @property
    def _told(self) -> dict[str, str]:
        """What all parts answer, with the units."""
        behind = "far_tension" if self.last else "behind"
        return {"tension": "N", "length": "m", behind: "N", "piece": "1", "number": "1"}

    @property
    def _own(self) -> int:
        """Number of data before its own."""
        return 3 + 2 * self.axes

    @property
    def _links(self) -> int:
        """Number of places that are its tensions."""
        return int(not self.first) + int(not self.last)

    def _entering(self, u: list[Side], data: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension before it over that at the pulled end, and the angle to the direction (axes,) in which it begins."""
        if self.first:
            return ca.SX(1), ca.SX(0)
        before = data[3 : 3 + self.axes] + ca.vertcat(*u[len(u) - self._links])
        tension = ca.norm_2(before)
        across = ca.cross(before, direction) if self.space else before[0] * direction[1] - before[1] * direction[0]
        across, along = across / tension, ca.dot(before, direction) / tension
        return tension, ca.atan2(_size(across), along)

    def _missing(self, u: list[Side], data: ca.SX, behind: ca.SX) -> list[ca.SX]:
        """Forces on the places that are tensions, where the tension behind it is the vector ``behind`` (axes,)."""
        found = [] if self.first else [ca.SX(0)] * self.axes
        if not self.last:
            found += ca.vertsplit(data[3 + self.axes : self._own] + ca.vertcat(*u[-1]) - behind)
        return found


def _size(vector: ca.SX) -> ca.SX:
    """Length of a vector, less :data:`SMOOTH` where it is longer: with a derivative everywhere."""
    return ca.sqrt(ca.sumsqr(vector) + SMOOTH**2) - SMOOTH


SMOOTH = 1e-10
"""Angle, rad, below which the friction of a turn grows with its square: else a straight way would have no derivative.

So much of a turn is lost at most, which changes a tension by this times the coefficient of friction."""


@final
@dataclass(frozen=True)
class Rubbing(_Link):
    """A straight piece, or what is along an element, with friction where it begins and within it.

    Attributes
    ----------
    part : Routed or Strung
        The same without friction, whose data are its own.
    backwards : bool
        Whether it goes against the direction of the element.
    """

    part: Routed | Strung
    backwards: bool

    @property
    def along_element(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.along_element

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.one_sided

    @property
    def apart(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.apart

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The sides of the part, and the tensions before and behind it."""
        turns, places, _, data, _ = self.part.sizes
        return turns, places + self._links, 0, self._own + data, 1

    @property
    def points(self) -> int:
        """Number of vectors along it: points of the element, or one."""
        return self.part.sizes[0] if self.along_element else 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tensions of its points."""
        return self._told | {f"tension at point {k}": "N" for k in range(self.points)}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, list[ca.SX], ca.SX]:
        """Lengths (points,) along it, and at these the tensions over that at the pulled end; the tension behind it."""
        vectors = self.part.along(q, u[: len(u) - self._links], data[self._own :])
        lengths = [ca.norm_2(vector) for vector in vectors]
        sign = -1.0 if self.backwards else 1.0
        ways = [sign * vector / length for vector, length in zip(vectors, lengths, strict=True)]
        within = ca.SX(1, 1)
        if self.along_element:
            ways = [ca.vertcat(*self.forth(q[k], ca.vertsplit(way))) for k, way in enumerate(ways)]
            within = self._turned(ca.horzcat(*ways))
        begin, end = (-1, 0) if self.backwards else (0, -1)
        tension, angle = self._entering(u, data, ways[begin])
        tensions = [tension * ca.exp(-data[2] * (angle + each)) for each in ca.vertsplit(within)]
        return ca.vertcat(*lengths), tensions, tensions[end] * ways[end]

    def _turned(self, ways: ca.SX) -> ca.SX:
        """Angles (points,) by which the way has turned since it began, from its directions (axes, points)."""
        nodes = interpolation.lobatto(self.points)[0]
        slopes = ca.mtimes(ways, ca.DM(interpolation.differentiation(nodes).T))
        # What is left of the slope across the way.
        across = [slopes[:, k] - ca.dot(slopes[:, k], ways[:, k]) * ways[:, k] for k in range(self.points)]
        rates = ca.vertcat(*[_size(each) for each in across])
        since = interpolation.integration(nodes, nodes)
        return ca.mtimes(ca.DM(since[-1] - since if self.backwards else since), rates)

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Tensions times the derivatives of the lengths; on its tensions what they miss."""
        lengths, tensions, behind = self._now(q, u, data)
        still = ca.SX.sym("still", self.points)
        own = u[: len(u) - self._links]
        sides = ca.vertcat(*[ca.vertcat(*side) for side in (*q, *own)])
        gradient = ca.gradient(ca.dot(still, lengths), sides)
        gradient = load * ca.substitute(gradient, still, ca.vertcat(*tensions))
        found, width = [], self.components
        for i, side in enumerate(q):
            by_q = gradient[width * i : width * (i + 1)]
            if self.space:
                found += [0.5 * ca.dot(ca.vertcat(*product([0.0, *a], side)), by_q) for a in np.eye(3).tolist()]
            else:
                found.append(by_q)
        return [*found, *ca.vertsplit(gradient[width * len(q) :]), *self._missing(u, data, behind)]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Tensions times the changes of the lengths."""
        lengths, tensions, _ = self._now(q, u, data)
        own, n = data[self._own :], self.axes
        rest = ca.vertcat(*[ca.norm_2(own[n * k : n * k + n]) for k in range(self.points)])
        return load * ca.dot(ca.vertcat(*tensions), lengths - rest)

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        lengths, tensions, behind = self._now(q, u, data)
        told = [load, ca.sum1(lengths), load * ca.norm_2(behind), data[0], data[1]]
        return [*told, *[load * tension for tension in tensions]]


@final
@dataclass(frozen=True)
class RigidPart(_Link):
    """A piece along a rigid member, with friction where it begins and within it.

    Own data: directions in which it begins and ends in the undeformed scene, the angle within, the length, and zero.
    """

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotation of the member, and the tensions before and behind it."""
        return 1, self._links, 0, self._own + 2 * self.axes + 3, 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tension where it begins."""
        return self._told | {"tension at point 0": "N"}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension where it begins over that at the pulled end, and the vector of that behind it."""
        n, own = self.axes, data[self._own :]
        into, out = (ca.vertcat(*self.forth(q[0], ca.vertsplit(own[n * i : n * i + n]))) for i in range(2))
        tension, angle = self._entering(u, data, into)
        tension = tension * ca.exp(-data[2] * angle)
        return tension, tension * ca.exp(-data[2] * own[2 * n]) * out

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """None on the member; on its tensions what they miss."""
        return [*[ca.SX(0)] * self.turns, *self._missing(u, data, self._now(q, u, data)[1])]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        tension, behind = self._now(q, u, data)
        return [load, data[data.shape[0] - 2], load * ca.norm_2(behind), data[0], data[1], load * tension]


# -- of a scene -------------------------------------------------------------------------------------


def rubbing_in(parts: Parts) -> Iterator[One]:
    """Terms of the tendons of a scene that rub.

    Raises
    ------
    SceneError
        Elements are integrated at Gauss points.
    """
    for name, tendon in parts.scene.tendons.items():
        if tendon.rubs:
            if parts.element.gauss:
                message = "found Gauss integration, accepted with friction: integration at the nodes"
                raise SceneError(message, ("tendons", name, "friction"))
            yield from _Chain(parts, name, tendon).all()


@dataclass(frozen=True)
class _Loose:
    """A part before it is linked: its term without friction, where there is one, and its directions at its ends."""

    piece: int
    one: One
    kind: Rubbing | RigidPart
    into: Array
    out: Array


@dataclass(frozen=True, eq=False)
class _Chain:
    parts: Parts
    name: str
    tendon: Tendon

    def all(self) -> Iterator[One]:
        scene, load = self.parts.scene, self.tendon.force / self.parts.scales.force
        links = tensions_of(scene, self.parts.mesh, self.name)
        places = [self.parts.segments.place(link) for link in links]
        found = self._loose()
        # Of what is released the tension rises from the pulled end on.
        released = (self.name, "released") in self.parts.mesh.stops or self.name in scene.released
        rate = numbers(self.tendon.friction) * (-1.0 if released else 1.0)
        for i, loose in enumerate(found):
            first, last = i == 0, i == len(found) - 1
            before = loose.into if first else found[i - 1].out
            data = [
                np.array([float(loose.piece), float(i)]),
                np.reshape(numbers(rate), (1,)),
                before,
                loose.out,
                loose.one.data,
            ]
            sides = (*loose.one.places, *places[max(i - 1, 0) : i], *places[i : i + 1])
            yield One(
                replace(loose.kind, first=first, last=last),
                self.name,
                "",
                numbers(np.concatenate(data)),
                loose.one.turns,
                sides,
                "",
                {self.tendon.history: np.reshape(numbers(load), (1,))},
                loose.one.element,
            )

    def _loose(self) -> list[_Loose]:
        """All parts from the pulled end on."""
        scene, n, found = self.parts.scene, self.parts.element.axes, list[_Loose]()
        reverse = self.tendon.pulled_at == "end"
        for number, (piece, ones) in enumerate(loose_in(self.parts, self.name)):
            if isinstance(piece, tuple):
                way = ones[0].data[:n] / np.linalg.norm(ones[0].data[:n])
                found.append(_Loose(number, ones[0], self._rubbing(ones[0], False), way, way))
                continue
            backwards = piece.forwards == reverse
            if scene.members[piece.member].type == "rigid":
                found.append(self._held(number, piece, backwards))
                continue
            own = []
            for one in ones:
                count = len(one.turns)
                ends = [one.data[n * k : n * k + n] for k in ((count - 1, 0) if backwards else (0, count - 1))]
                into, out = ((-1.0 if backwards else 1.0) * end / np.linalg.norm(end) for end in ends)
                own.append(_Loose(number, one, self._rubbing(one, backwards), into, out))
            found += own if piece.forwards else own[::-1]
        return found[::-1] if reverse else found

    def _rubbing(self, one: One, backwards: bool) -> Rubbing:
        part: Any = one.kind
        return Rubbing(part.space, True, True, part, backwards)

    def _held(self, number: int, piece: Stretch, backwards: bool) -> _Loose:
        parts, n = self.parts, self.parts.element.axes
        line = parts.scene.center_lines[piece.member]
        angle, into, out = turned_along(piece, line, piece.start, piece.end)
        ways = (-1.0 * out[:n], -1.0 * into[:n]) if backwards else (into[:n], out[:n])
        length = length_of_piece(piece, line) / parts.scales.length
        data = np.concatenate([*ways, np.array([angle]), np.reshape(numbers(length), (1,)), np.zeros(1)])
        turns = (int(parts.rotations.turns[parts.beams.first[piece.member]][0]),)
        kind = RigidPart(parts.element.space, True, True)
        return _Loose(number, One(kind, self.name, "", numbers(data), turns), kind, *ways)


def turned_along(piece: Stretch, line: Any, start: float, end: float) -> tuple[float, Array, Array]:
    """Angle, rad, by which a way along a rigid member turns between two fractions of its length, and its directions
    (3,) at both, in the fixed axes of the undeformed scene.
    """
    end = max(end, start + NARROW)
    kinks = [at for at in (*line.breaks, *breaks_along(piece.way)) if start < at < end]
    cuts = np.unique([*np.linspace(start, end, PARTS + 1), *kinks])
    nodes, weights = interpolation.lobatto(POINTS)
    slope, angle, found = interpolation.differentiation(nodes), 0.0, list[Array]()
    for a, b in zip(cuts, cuts[1:], strict=False):
        middle = np.full(POINTS, 0.5 * (a + b))
        forward = values_of(tangent(piece.way, line, a + (b - a) * nodes, middle)[0])
        ways = forward / np.linalg.norm(forward, axis=1)[:, None]
        angle += float(np.linalg.norm(slope @ ways, axis=1) @ weights)
        if found:
            angle += float(2.0 * np.arcsin(min(0.5 * float(np.linalg.norm(ways[0] - found[-1][-1])), 1.0)))
        found.append(ways)
    return angle, found[0][0], found[-1][-1]


def turned_since(line: Any, tendon: Tendon, piece: Stretch, x: Array) -> Array:
    """Angles (n,), rad, by which a way along a rigid member has turned from where a tendon enters it to fractions x."""
    backwards = piece.forwards == (tendon.pulled_at == "end")
    ends = [(at, piece.end) if backwards else (piece.start, at) for at in np.clip(x, piece.start, piece.end).tolist()]
    return np.array([turned_along(piece, line, a, b)[0] if a < b else 0.0 for a, b in ends])


def settle(model: Any, q: Array, y: Array) -> None:
    """Set the tensions among displacement unknowns (n,) to those of rotations and other displacements, in place.

    One part after the other, as each says the tension behind it.
    """
    retained, known = model.positions.retained, list[tuple[str, int, Group, int]]()
    for group in model.connections:
        if group.kind.table == "tendons" and "piece" in group.kind.answers:
            order = values_of(group.data)[:, 1].astype(int).tolist()
            known += [(name, number, group, i) for i, (name, number) in enumerate(zip(group.names, order, strict=True))]
    if not known:
        return
    places = np.where(retained >= 0, np.append(y, 0.0)[retained], 0.0)
    # A side that is the ground, after all others.
    places, q = np.vstack([places, np.zeros(model.element.axes)]), np.vstack([q, np.eye(1, model.element.components)])
    if not model.space:
        q[-1] = 0.0
    for _, _, group, i in sorted(known, key=lambda part: part[:2]):
        if group.places.shape[1] and not getattr(group.kind, "last", True):
            behind, sides = group.places[i, -1], (q[group.turns[i]].T, places[group.places[i]].T)
            missing = rotation_forces(group.kind)(*sides, values_of(group.data)[i], 0.0, [])[1]
            places[behind] -= missing.full().ravel()[-model.element.axes :]
            y[retained[behind]] = places[behind]


def part_of(model: Any, name: str, piece: int, element: int) -> tuple[int, int]:
    """Number of the group among the terms, and in it of the part of a piece of a tendon that rubs.

    Of the part along an element, or with -1 of all of the piece; -1 twice where there is none.
    """
    for number, group in enumerate(model.terms):
        if group.kind.table == "tendons" and name in group.names:
            own = np.equal(group.names, name) & (group.elements == element)
            for i in np.flatnonzero(own & (values_of(group.data)[:, 0] == piece)).tolist():
                return number, i
    return -1, -1


PARTS, POINTS = 16, 6
"""Parts of a rigid member over which the turn of a way along it is integrated, and points of each."""

NARROW = 1e-9
"""Least part of the length between the ends of such an integral."""
