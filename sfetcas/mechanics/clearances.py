"""How far members are from each other in a motion, as a row: the places where they are nearest are eliminated.

Along an element of either member the centre lines are polynomials ``r_1(s)`` and ``r_2(t)`` whose coefficients are the
turned tangents of its points.  The gap

    g = |d| - (radius_1 + radius_2),      d = r_1(s) - r_2(t),      with  d . r_1' = 0  and  d . r_2' = 0

is that at the nearest places ``s`` and ``t``, which Newton's method finds within the row.  It depends on the state
alone: its first derivatives are those at fixed places (``d . r'`` is zero), and in the second ones places follow by
one step of Newton's method from where they are.  A place that is held at the end of a member has no such condition.
Polynomials go on beyond the ends of elements: who uses the row looks where its places are.

Source: Konyukhov and Izadi 2015, Introduction to Computational Contact Mechanics, chapter 11 (contact of curves).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index, numbers
from .elements import Element
from .mesh import Approach, Mesh
from .parts import Parts
from .rings import up_to
from .segments import place_of_cut
from .terms import Group, One, Side, Term, name_of, rotation_gradient

__all__ = ["PARALLEL", "Clearance", "Rows", "clearances_in"]

STEPS = 6
"""Steps of Newton's method to the nearest places, from those at which a row was made, at most an element away."""

PARALLEL = 1e-8
"""Square of the sine of the angle of lines below which it is open where they are nearest."""


@final
@dataclass(frozen=True)
class Clearance(Term):
    """Constraint: the surfaces of two members touch where they are nearest.

    Rotations: those of the element of the first member, then of the second.  Places: the starts of these elements,
    then their strains.  Data: the vector between the starts in the undeformed scene, the distance of touching lines,
    the places from which the search goes out (2,), and lines of the elements; of a rigid member its chord.

    Attributes
    ----------
    one, other : Element or None
        None for a straight rigid member.
    one_held, other_held : bool
        Whether the place stays where the data say.
    steps : int
        Of Newton's method.
    """

    table: ClassVar[str] = "contacts"

    one: Element | None
    other: Element | None
    one_held: bool
    other_held: bool
    steps: int = STEPS

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        sides = [_side_sizes(element, self.axes) for element in (self.one, self.other)]
        turns, strains, data = (sum(part) for part in zip(*sides, strict=True))
        return turns, 2 + strains, 1, self.axes + 3 + data, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The gap."""
        lines = self._lines(q, u, data)
        at = data[self.axes + 1 : self.axes + 3]
        for _ in range(self.steps):
            at = self._nearer(*lines, at)
        return [self._apart(*lines, at) - data[self.axes]]

    def rotation_gradient(self) -> ca.Function:
        """As of :class:`.Term`: the derivatives of a gap with one step from the nearest places are exact."""
        if self.steps == 1:
            return super().rotation_gradient()
        whole = rotation_gradient(replace(self, steps=1))
        symbols = whole.sx_in()
        q, u, data, load, lam = symbols
        n = self.axes
        at, lines = data[n + 1 : n + 3], self._lines(_split(q), _split(u), data)
        for _ in range(self.steps):
            at = self._nearer(*lines, at)
        there = ca.vertcat(data[: n + 1], at, data[n + 3 :])
        found = whole.call([q, u, there, load, lam])
        return ca.Function(f"whole_{name_of(self)}", symbols, found, whole.name_in(), whole.name_out(), {"cse": True})

    def _lines(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """The vector between the starts of the elements, and turned tangents (axes, points) of their points."""
        n, found = self.axes, []
        turns, strains, rest = 0, 2, data[n + 3 :]
        for element in (self.one, self.other):
            count, more, size = _side_sizes(element, n)
            own = q[turns : turns + count]
            if element is None:
                found.append(ca.vertcat(*self.forth(own[0], ca.vertsplit(rest[:size]))))
            else:
                found.append(ca.horzcat(*element.tangents(own, u[strains : strains + more], rest[:size])))
            turns, strains, rest = turns + count, strains + more, rest[size:]
        return data[:n] + ca.vertcat(*u[0]) - ca.vertcat(*u[1]), found[0], found[1]

    def _apart(self, begin: ca.SX, one: ca.SX, other: ca.SX, at: ca.SX) -> ca.SX:
        return ca.norm_2(begin + self.along(self.one, one, at[0]) - self.along(self.other, other, at[1]))

    @staticmethod
    def along(element: Element | None, tangents: ca.SX, here: ca.SX) -> ca.SX:
        """The line from the start of the element up to a fraction of it."""
        return tangents * here if element is None else ca.mtimes(tangents, up_to(element, here))

    def _nearer(self, begin: ca.SX, one: ca.SX, other: ca.SX, at: ca.SX) -> ca.SX:
        """Places (2,) after a step of Newton's method, of those that are not held."""
        return _step(self, False)(begin, one, other, at)

    @functools.cached_property
    def places(self) -> ca.Function:
        """``(q, u, data) ->`` the nearest places (2,), held ones as they are; and where all would be if none were held.

        Fractions of the elements, or of a rigid member; where lines are nearly parallel nothing else would be nearer.
        """
        turns, places, _, size, _ = self.sizes
        q, u, data = ca.SX.sym("q", self.components, turns), ca.SX.sym("u", self.axes, places), ca.SX.sym("data", size)
        lines, at = self._lines(_split(q), _split(u), data), data[self.axes + 1 : self.axes + 3]
        for _ in range(self.steps):
            at = self._nearer(*lines, at)
        return ca.Function("places", [q, u, data], [at, _step(self, True)(*lines, at)])


@functools.cache
def _step(kind: Clearance, free: bool) -> ca.Function:
    """(begin, tangents, tangents, at) -> places after a step of Newton's method, of those that are not held.

    ``free``: of held ones as well; where lines are nearly parallel these stay.
    """
    symbols, at = [ca.SX.sym("begin", kind.axes)], ca.SX.sym("at", 2)
    for element in (kind.one, kind.other):
        symbols.append(ca.SX.sym("tangents", kind.axes, 1 if element is None else element.order + 1))
    d = symbols[0] + kind.along(kind.one, symbols[1], at[0]) - kind.along(kind.other, symbols[2], at[1])
    # Half the square of the distance has no corner where lines cross.
    h, slope = ca.hessian(0.5 * ca.dot(d, d), at)
    held = kind.one_held, kind.other_held
    moved = [ca.SX(0) if held[i] else -slope[i] / h[i, i] for i in range(2)]
    if free or not any(held):
        det, product = h[0, 0] * h[1, 1] - h[0, 1] ** 2, h[0, 0] * h[1, 1]
        across = ca.fmax(det, 1e-3 * PARALLEL * product)
        joint = h[0, 1] * slope[1] - h[1, 1] * slope[0], h[0, 1] * slope[0] - h[0, 0] * slope[1]
        crossing = det > (PARALLEL if any(held) else 0.0) * product
        moved = [ca.if_else(crossing, a / across, b) for a, b in zip(joint, moved, strict=True)]
    return ca.Function("nearer", [*symbols, at], [at + ca.vertcat(*moved)])


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of one kind in a model, and their sides, as of :class:`~sfetcas.mechanics.terms.Group`."""

    kind: Clearance
    approaches: list[Approach]
    turns: Index
    places: Index
    data: Array

    @classmethod
    def of(cls, groups: Sequence[Group], mesh: Mesh) -> Iterator[Rows]:
        """All of them among the terms of a model."""
        known = {near.name: near for near in mesh.approaches}
        for group in groups:
            if isinstance(group.kind, Clearance):
                approaches = [known[row] for row in group.rows]
                yield cls(group.kind, approaches, group.turns, group.places, group.data)

    def located(self, q: Array, places: Array) -> tuple[Array, Array]:
        """The nearest places (n, 2), and where they would be if none were held, fractions of elements.

        For rotations (rotations, components) and displacements of the places (places, axes).
        """
        n, (turns, size) = len(self.approaches), self.kind.sizes[:2]
        still = np.array([1.0, 0.0, 0.0, 0.0] if self.kind.space else [0.0])
        q, u = np.vstack([q, still])[self.turns], np.vstack([places, np.zeros(self.kind.axes)])[self.places]
        given = q.reshape(n * turns, -1).T, u.reshape(n * size, -1).T, self.data.T
        held, free = (np.array(part).T for part in self.kind.places.map(n)(*given))
        return held, free


def _split(sides: ca.SX) -> list[Side]:
    return [ca.vertsplit(side) for side in ca.horzsplit(sides)]


def _side_sizes(element: Element | None, axes: int) -> tuple[int, int, int]:
    """Numbers of rotations, strains and data of a member."""
    return (1, 0, axes) if element is None else (*element.sizes[:2], element.line_data)


def clearances_in(parts: Parts) -> Iterator[One]:
    """Terms of the places where members are near to each other in a motion."""
    mesh, segments, unit, axes = parts.mesh, parts.segments, parts.scales.length, parts.element.axes
    for near in mesh.approaches:
        starts, turns, places, strains, lines, at = [], (), [], (), [], []
        for member, e, x in zip(near.members, near.elements, near.at, strict=True):
            rigid = parts.scene.members[member].type == "rigid"
            cuts, number = mesh.cuts[member], parts.beams.first[member] + e
            begin, end = (0.0, 1.0) if rigid else cuts[e : e + 2]
            starts.append(parts.scene.center_lines[member].positions(np.array([begin]))[0])
            places.append(segments.place(place_of_cut(mesh, segments.ends, member, 0 if rigid else e)))
            own = parts.rotations.turns[number].tolist()
            turns += tuple(own[:1] if rigid else own)
            at.append((x - begin) / (end - begin))
            if rigid:
                lines.append(_chord(parts, member)[:axes] / unit)
                continue
            strains += tuple(segments.strains[number].tolist())
            lines += [parts.beams.tangent[number].ravel(), parts.beams.compliance[number].ravel()]
        one, other = (None if parts.scene.members[m].type == "rigid" else parts.element for m in near.members)
        kind = Clearance(parts.element.space, one, other, *near.held)
        between = (starts[0] - starts[1])[:axes] / unit
        data = numbers(np.concatenate([between, [near.distance / unit, *at], *lines]))
        yield One(kind, near.contact, "", data, turns, (*places, *strains), near.name)


def _chord(parts: Parts, member: str) -> Array:
    """The vector (3,) from the first to the second end of a member in the undeformed scene, m."""
    begin, end = parts.scene.center_lines[member].positions(np.array([0.0, 1.0]))
    return np.asarray(end - begin)
