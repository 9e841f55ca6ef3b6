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

Where the length is given, the tension at the pulled end is the first displacement of a further such place, on which the
force is what the way is too short: each part adds its share.  Of a tendon that stretches a part of the length ``l``
under the tension ``T`` has the free length ``l / (1 + T / EA)``, with ``EA`` stiffness times whole free length, and
the displacement of that place is the elongation ``e`` that the whole tendon would have under the tension ``T_0 = k e``
at the pulled end.  So without friction the length is the free length and ``e``.  Where a rod pushes, friction holds it
back the other way: ``dT = -mu |T| |d tau|``.

Source: Euler 1762 (Eytelwein's formula); Rao, Peyron, Lilge and Burgner-Kahrs 2021 for the ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..description.tendons import Stretch, Tendon, breaks_along, length_of_piece, tangent
from ..errors import SceneError
from ..mathematics import interpolation
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.quaternion import product
from .mesh import Mesh
from .parts import Parts
from .segments import pulled_place, tensions_of
from .tendon_terms import Routed, Strung, loose_in, pull_of
from .terms import Group, One, Side, Term, rotation_forces

__all__ = ["RigidPart", "Rubbing", "is_let_out", "part_of", "rubbing_in", "settle", "turned_since"]


@dataclass(frozen=True)
class _Link(Term):
    """A part of a tendon that rubs.

    Data: number of its piece, its own number from the pulled end on, coefficient with its sign, vectors of the tension
    before and behind it in the undeformed scene; of one that stretches stiffness and whole length there; then its own,
    of which the last but one is its length there.  Load: the tension at the pulled end, or the shortening.

    Attributes
    ----------
    first, last : bool
        Whether it begins at the pulled end, and whether it ends at the other one.
    given : bool
        Whether the length of the tendon is given, not its tension.
    elastic, pushes : bool
        Whether a tendon of given length stretches, and whether it may push.
    """

    table: ClassVar[str] = "tendons"

    first: bool
    last: bool
    given: bool
    elastic: bool
    pushes: bool

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
        return 3 + 2 * self.axes + 2 * self.elastic

    @property
    def _further(self) -> int:
        """Number of places beside those of the part: tensions before and behind it, and what pulls."""
        return int(not self.first) + int(not self.last) + int(self.given)

    def _pulled(self, u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Tension at the pulled end."""
        if not self.given:
            return load
        if not self.elastic:
            return u[-1][0]
        return data[self._own - 2] * (u[-1][0] if self.pushes else ca.fmax(u[-1][0], 0.0))

    def _tension(self, pulled: ca.SX, share: ca.SX) -> ca.SX:
        """Tension where that of a tendon that is pulled, over that at the pulled end, is the share."""
        return ca.if_else(pulled < 0.0, pulled / share, pulled * share) if self.pushes else pulled * share

    def _entering(self, u: list[Side], data: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension before it over that at the pulled end, and the angle to the direction (axes,) in which it begins."""
        if self.first:
            return ca.SX(1), ca.SX(0)
        before = data[3 : 3 + self.axes] + ca.vertcat(*u[len(u) - self._further])
        tension = ca.norm_2(before)
        across = ca.cross(before, direction) if self.space else before[0] * direction[1] - before[1] * direction[0]
        across, along = across / tension, ca.dot(before, direction) / tension
        return tension, ca.atan2(_size(across), along)

    def _missing(self, u: list[Side], data: ca.SX, behind: ca.SX) -> list[ca.SX]:
        """Forces on the places that are tensions, where the tension behind it is the vector ``behind`` (axes,)."""
        found = [] if self.first else [ca.SX(0)] * self.axes
        if not self.last:
            rest = data[3 + self.axes : 3 + 2 * self.axes]
            found += ca.vertsplit(rest + ca.vertcat(*u[-2 if self.given else -1]) - behind)
        return found

    def _lacking(self, u: list[Side], data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> list[ca.SX]:
        """Force on the place that tells how it is pulled: how much free length of the tendon it has too little.

        From its lengths and tensions (points,).
        """
        if not self.given:
            return []
        lacking = data[data.shape[0] - 2] - ca.sum1(self._unstretched(data, load, lengths, tensions))
        if not self.first:
            return [lacking, *[ca.SX(0)] * (self.axes - 1)]
        lacking -= load
        if self.elastic and not self.pushes:
            # Slack, by so much.
            lacking += ca.fmin(u[-1][0], 0.0)
        return [lacking, *u[-1][1:]]

    def _unstretched(self, data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> ca.SX:
        """Free lengths (points,) of the tendon in it, from its lengths and tensions (points,)."""
        return lengths / (1.0 + tensions / self._rigidity(data, load)) if self.elastic else lengths

    def _rigidity(self, data: ca.SX, load: ca.SX) -> ca.SX:
        """Stiffness of an elastic tendon times its free length."""
        return data[self._own - 2] * (data[self._own - 1] - load)

    def _kept(self, data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> ca.SX:
        """Energy of an elastic tendon in it, from its lengths and tensions (points,)."""
        if not self.elastic:
            return ca.SX(0)
        free = self._unstretched(data, load, lengths, tensions)
        return 0.5 * ca.dot(free, tensions**2) / self._rigidity(data, load)


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
        """The sides of the part, the tensions before and behind it, and what pulls."""
        turns, places, _, data, _ = self.part.sizes
        return turns, places + self._further, 0, self._own + data, 1

    @property
    def points(self) -> int:
        """Number of vectors along it: points of the element, or one."""
        return self.part.sizes[0] if self.along_element else 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tensions of its points."""
        return self._told | {f"tension at point {k}": "N" for k in range(self.points)}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Lengths and tensions (points,) along it; the tension behind it over that at the pulled end."""
        vectors = self.part.along(q, u[: len(u) - self._further], data[self._own :])
        lengths = [ca.norm_2(vector) for vector in vectors]
        sign = -1.0 if self.backwards else 1.0
        ways = [sign * vector / length for vector, length in zip(vectors, lengths, strict=True)]
        within = ca.SX(1, 1)
        if self.along_element:
            ways = [ca.vertcat(*self.forth(q[k], ca.vertsplit(way))) for k, way in enumerate(ways)]
            within = self._turned(ca.horzcat(*ways))
        begin, end = (-1, 0) if self.backwards else (0, -1)
        entering, angle = self._entering(u, data, ways[begin])
        shares = [entering * ca.exp(-data[2] * (angle + each)) for each in ca.vertsplit(within)]
        pulled = self._pulled(u, data, load)
        tensions = ca.vertcat(*[self._tension(pulled, share) for share in shares])
        return ca.vertcat(*lengths), tensions, shares[end] * ways[end]

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
        """Tensions times the derivatives of the lengths; on its tensions what they miss, and the length it lacks."""
        lengths, tensions, behind = self._now(q, u, data, load)
        still = ca.SX.sym("still", self.points)
        own = u[: len(u) - self._further]
        sides = ca.vertcat(*[ca.vertcat(*side) for side in (*q, *own)])
        gradient = ca.substitute(ca.gradient(ca.dot(still, lengths), sides), still, tensions)
        found, width = [], self.components
        for i, side in enumerate(q):
            by_q = gradient[width * i : width * (i + 1)]
            if self.space:
                found += [0.5 * ca.dot(ca.vertcat(*product([0.0, *a], side)), by_q) for a in np.eye(3).tolist()]
            else:
                found.append(by_q)
        found += [*ca.vertsplit(gradient[width * len(q) :]), *self._missing(u, data, behind)]
        return [*found, *self._lacking(u, data, load, lengths, tensions)]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Tensions times the changes of the lengths, or of given length what it stores."""
        lengths, tensions, _ = self._now(q, u, data, load)
        if self.given:
            return self._kept(data, load, lengths, tensions)
        own, n = data[self._own :], self.axes
        rest = ca.vertcat(*[ca.norm_2(own[n * k : n * k + n]) for k in range(self.points)])
        return ca.dot(tensions, lengths - rest)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Energy of an elastic tendon."""
        lengths, tensions, _ = self._now(q, u, data, load)
        return self._kept(data, load, lengths, tensions)

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        lengths, tensions, behind = self._now(q, u, data, load)
        pulled = self._pulled(u, data, load)
        told = [pulled, ca.sum1(lengths), self._tension(pulled, ca.norm_2(behind)), data[0], data[1]]
        return [*told, *ca.vertsplit(tensions)]


@final
@dataclass(frozen=True)
class RigidPart(_Link):
    """A piece along a rigid member, with friction where it begins and within it.

    Own data: directions in which it begins and ends in the undeformed scene, the angle within; lengths of its points,
    and angles by which the way has turned there; the length, and zero.

    Attributes
    ----------
    points : int
        Points along it, of a tendon that stretches.
    """

    points: int

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotation of the member, the tensions before and behind it, and what pulls."""
        return 1, self._further, 0, self._own + 2 * self.axes + 3 + 2 * self.points, 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tension where it begins."""
        return self._told | {"tension at point 0": "N"}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension where it begins over that at the pulled end, and the vector of that behind it."""
        n, own = self.axes, data[self._own :]
        into, out = (ca.vertcat(*self.forth(q[0], ca.vertsplit(own[n * i : n * i + n]))) for i in range(2))
        share, angle = self._entering(u, data, into)
        share = share * ca.exp(-data[2] * angle)
        return share, share * ca.exp(-data[2] * own[2 * n]) * out

    def _along(self, u: list[Side], data: ca.SX, load: ca.SX, share: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Lengths and tensions (points,) along it; of what does not stretch the whole length alone."""
        pulled = self._pulled(u, data, load)
        if not self.points:
            return data[data.shape[0] - 2], self._tension(pulled, share)
        lengths, angles = ca.vertsplit(data[data.shape[0] - 2 - 2 * self.points : data.shape[0] - 2], self.points)
        tensions = [self._tension(pulled, share * ca.exp(-data[2] * angle)) for angle in ca.vertsplit(angles)]
        return lengths, ca.vertcat(*tensions)

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """None on the member; on its tensions what they miss, and the length it lacks."""
        share, behind = self._now(q, u, data)
        lacking = self._lacking(u, data, load, *self._along(u, data, load, share))
        return [*[ca.SX(0)] * self.turns, *self._missing(u, data, behind), *lacking]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """What it stores."""
        return self.stored(q, u, data, load)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Energy of an elastic tendon."""
        return self._kept(data, load, *self._along(u, data, load, self._now(q, u, data)[0]))

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        share, behind = self._now(q, u, data)
        pulled = self._pulled(u, data, load)
        at_ends = self._tension(pulled, ca.norm_2(behind)), self._tension(pulled, share)
        return [pulled, data[data.shape[0] - 2], at_ends[0], data[0], data[1], at_ends[1]]


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
        scene, mesh, tendon = self.parts.scene, self.parts.mesh, self.tendon
        links = [self.parts.segments.place(link) for link in tensions_of(scene, mesh, self.name)]
        told = pulled_place(scene, mesh, self.name)
        pulled = (self.parts.segments.place(told),) if told else ()
        found = self._loose()
        # Of what is let out the tension rises from the pulled end on.
        rate = numbers(tendon.friction) * (-1.0 if is_let_out(scene, mesh, self.name) else 1.0)
        rest = sum(loose.one.data[-2] for loose in found)
        elastic = [] if tendon.stiffness is None else [self._stiffness(), np.reshape(numbers(rest), (1,))]
        load = pull_of(tendon, rest, self.parts.scales) if told or not tendon.measured else 0.0
        for i, loose in enumerate(found):
            first, last = i == 0, i == len(found) - 1
            data = [
                np.array([float(loose.piece), float(i)]),
                np.reshape(numbers(rate), (1,)),
                loose.into if first else found[i - 1].out,
                loose.out,
                *elastic,
                loose.one.data,
            ]
            kind = replace(loose.kind, first=first, last=last, given=bool(told), elastic=bool(elastic))
            kind = replace(kind, pushes=tendon.pushes)
            yield One(
                kind,
                self.name,
                "",
                numbers(np.concatenate(data)),
                loose.one.turns,
                (*loose.one.places, *links[max(i - 1, 0) : i], *links[i : i + 1], *pulled),
                "",
                {tendon.history: np.reshape(numbers(load), (1,))},
                loose.one.element,
            )

    def _stiffness(self) -> Array:
        return np.array([1.0]) * self.tendon.stiffness * self.parts.scales.length / self.parts.scales.force

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
        return Rubbing(part.space, True, True, False, False, False, replace(part, given=False), backwards)

    def _held(self, number: int, piece: Stretch, backwards: bool) -> _Loose:
        parts, n = self.parts, self.parts.element.axes
        line = parts.scene.center_lines[piece.member]
        along = turned_along(piece, line, piece.start, piece.end)
        into, out = along.ends
        ways = (-1.0 * out[:n], -1.0 * into[:n]) if backwards else (into[:n], out[:n])
        length = length_of_piece(piece, line) / parts.scales.length
        points = [] if self.tendon.stiffness is None else [length * along.shares, along.since(backwards)]
        data = [*ways, np.array([along.angle]), *points, np.reshape(numbers(length), (1,)), np.zeros(1)]
        turns = (int(parts.rotations.turns[parts.beams.first[piece.member]][0]),)
        count = len(along.shares) if points else 0
        kind = RigidPart(parts.element.space, True, True, False, False, False, count)
        one = One(kind, self.name, "", numbers(np.concatenate([numbers(part) for part in data])), turns)
        return _Loose(number, one, kind, *ways)


@dataclass(frozen=True)
class _Turned:
    """How a way along a rigid member turns: angle, rad, and directions (3,) at its ends, in the fixed axes of the
    undeformed scene; at points in their order shares (points,) of the length, and angles (points,) since it began.
    """

    angle: float
    ends: tuple[Array, Array]
    shares: Array
    angles: Array

    def since(self, backwards: bool) -> Array:
        """Angles (points,) by which it has turned since it was entered."""
        return self.angle - self.angles if backwards else self.angles


def turned_along(piece: Stretch, line: Any, start: float, end: float) -> _Turned:
    """How a way along a rigid member turns between two fractions of its length."""
    end = max(end, start + NARROW)
    kinks = [at for at in (*line.breaks, *breaks_along(piece.way)) if start < at < end]
    cuts = np.unique([*np.linspace(start, end, PARTS + 1), *kinks])
    nodes, weights = interpolation.lobatto(POINTS)
    slope, since = interpolation.differentiation(nodes), interpolation.integration(nodes, nodes)
    angle, found, shares, angles = 0.0, list[Array](), list[Array](), list[Array]()
    for a, b in zip(cuts, cuts[1:], strict=False):
        middle = np.full(POINTS, 0.5 * (a + b))
        forward = values_of(tangent(piece.way, line, a + (b - a) * nodes, middle)[0])
        sizes = np.linalg.norm(forward, axis=1)
        ways = forward / sizes[:, None]
        rates = np.linalg.norm(slope @ ways, axis=1)
        if found:
            angle += float(2.0 * np.arcsin(min(0.5 * float(np.linalg.norm(ways[0] - found[-1][-1])), 1.0)))
        angles.append(angle + since @ rates)
        shares.append((b - a) * sizes * weights)
        angle += float(rates @ weights)
        found.append(ways)
    shared = np.concatenate(shares)
    return _Turned(angle, (found[0][0], found[-1][-1]), shared / shared.sum(), np.concatenate(angles))


def turned_since(line: Any, tendon: Tendon, piece: Stretch, x: Array) -> Array:
    """Angles (n,), rad, by which a way along a rigid member has turned from where a tendon enters it to fractions x."""
    backwards = piece.forwards == (tendon.pulled_at == "end")
    ends = [(at, piece.end) if backwards else (piece.start, at) for at in np.clip(x, piece.start, piece.end).tolist()]
    return np.array([turned_along(piece, line, a, b).angle if a < b else 0.0 for a, b in ends])


def is_let_out(scene: Scene, mesh: Mesh, name: str) -> bool:
    """Whether a tendon that rubs is let out: what a step says goes before what the scene says of its analysis."""
    told = {side for each, side in mesh.stops if each == name}
    return "released" in told or ("pulled" not in told and name in scene.released)


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
            # After it comes what pulls, where that is a place.
            after, axes = int(getattr(group.kind, "given", False)), model.element.axes
            behind, sides = group.places[i, -1 - after], (q[group.turns[i]].T, places[group.places[i]].T)
            missing = rotation_forces(group.kind)(*sides, values_of(group.data)[i], 0.0, [])[1].full().ravel()
            places[behind] -= missing[len(missing) - axes * (1 + after) :][:axes]
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
