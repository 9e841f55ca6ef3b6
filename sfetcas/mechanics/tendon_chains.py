"""The parts of the tendons of a scene that rub, one after the other from the pulled end on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..description.scene import Scene
from ..description.tendons import Stretch, Tendon, breaks_along, length_of_piece, tangent
from ..errors import SceneError
from ..mathematics import interpolation
from ..mathematics.arrays import Array, numbers, values_of
from .mesh import Mesh
from .parts import Parts
from .segments import pulled_place, tensions_of
from .tendon_friction import RigidPart, Rubbing
from .tendon_terms import loose_in, pull_of
from .terms import Group, One, rotation_forces

__all__ = ["is_let_out", "part_of", "rubbing_in", "settle", "turned_since"]


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
