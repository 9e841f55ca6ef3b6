"""Masses and dampers of a model: weights of the rates of positions, section axes and strains, dimensionless.

Masses of flexible members are lumped at the nodes of their elements (Lobatto quadrature: diagonal, constant, and as
accurate as the elements); a rigid member has its own consistent mass between its ends, which is exact; a small one
that of a few points which move with it (see :mod:`~sfetcas.mechanics.body_points`).

The unit of time is that in which the whole mass is one: ``sqrt(mass length^2 / moment)`` of the units of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..description.shapes import Straight, place
from ..description.tubes import mass_of_tubes
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, added, depends, numbers, plus
from ..mathematics.interpolation import differentiation, pieces
from ..mathematics.linear import SparseMap
from .bodies import body_of
from .body_masses import BodyMass, body_mass, euler_weights
from .body_points import BodyPoints, points_of
from .mass_centers import MassPoints, arms_of
from .mesh import within_elements
from .observed import Axes, SpringTravel, Strains, Stretches
from .terms import Term

__all__ = ["Masses", "Observables", "RigidMasses", "RotaryInertia", "masses_of"]


@dataclass(frozen=True, eq=False)
class Observables:
    """Quantities of one kind with their masses and dampers.

    Attributes
    ----------
    kind : Term
        Its rows are the quantities.
    turns, places : ndarray (n, rotations | places)
        Numbers of the rotations and places that they depend on.
    data : ndarray (n, data)
    mass, damping : ndarray (n, rows)
        Weights of the squares of accelerations and velocities.
    spring : int or None
        The group of springs whose angles or elongations these are, to find the angles that count turns.
    numbers : ndarray (n,) or None
        Their numbers in that group.
    at : ndarray (n, 2) or None
        For section axes the place and the element to whose balance of moments their inertia belongs, -1 for none; nodes
        that share a rotation have balances of their own.
    along : tuple (ndarray (n,), ndarray (n, nodes, axes)) or None
        For points that nodes of elements carry the numbers of these elements and the arms.
    sections : ndarray (n,) or None
        Of dampers in sections the numbers of their elements, or of their points, those of one element after the other.
    """

    kind: Term
    turns: Index
    places: Index
    data: Array
    mass: Array
    damping: Array
    spring: int | None = None
    numbers: Index | None = None
    at: Index | None = None
    along: tuple[Index, Array] | None = None
    sections: Index | None = None


@dataclass(frozen=True, eq=False)
class RotaryInertia:
    """That of what is no flexible member.

    Attributes
    ----------
    turns : ndarray (n,)
        Numbers of the rotations.
    at : ndarray (n, 2)
        Place and element to whose balance of moments they belong, as ``at`` of :class:`Observables`.
    spread : ndarray (n, 3, 3)
        Sums of weight times b b^T over the axes b that turn with them.
    """

    turns: Index
    at: Index
    spread: Array


@dataclass(frozen=True, eq=False)
class RigidMasses:
    """Masses and rotary inertia at the nodes of the elements of straight rigid members.

    Attributes
    ----------
    mass : ndarray (elements, p + 1)
    spins : ndarray (elements, p + 1, 3, 3)
        Rotary inertia, as of :class:`Masses`.
    """

    mass: Array
    spins: Array


@dataclass(frozen=True, eq=False)
class Masses:
    """All masses and dampers of a model.

    Attributes
    ----------
    time, mass : float
        Units of time and mass, s and kg.
    places : SparseMap (places, places)
        Mass matrix of the places.
    place_drag : ndarray (places,)
        Drag coefficients of the places.
    alone : SparseMap (places, places)
        The share of ``places`` that is of nodes and rigid members, not of flexible ones.
    inner, inner_drag : ndarray (elements, p + 1)
        Mass and drag of the inner nodes of flexible elements; zero at the ends, which are places.
    ends, ends_drag : ndarray (elements, p + 1)
        What the ends of flexible elements add to ``places`` and ``place_drag``; zero at inner nodes.
    at_ends : ndarray (elements, 2)
        Numbers of these places.
    rigid : RigidMasses
        What is along straight rigid members, which ``alone`` and ``rotary`` have as wholes.
    spins : ndarray (elements, p + 1, 3, 3)
        Rotary inertia of the nodes of flexible elements: sums of weight times b b^T over the axes b that turn along.
    rotary : RotaryInertia
        The same of nodes and rigid members.
    observables : tuple of Observables
        Section axes, strains, springs, points of small members.
    """

    time: float
    mass: float
    places: SparseMap
    place_drag: Array
    alone: SparseMap
    inner: Array
    inner_drag: Array
    ends: Array
    ends_drag: Array
    at_ends: Index
    rigid: RigidMasses
    spins: Array
    rotary: RotaryInertia
    observables: tuple[Observables, ...]


def _spread(frames: Array, inertia: Array) -> Array:
    """Sums (..., 3, 3) of weight times b b^T over section axes, the columns of (..., 3, 3), by moments (..., 3)."""
    return numbers(np.einsum("...ij,...j,...kj->...ik", frames, euler_weights(inertia), frames))


def masses_of(model: Any, *, moving: bool = True) -> Masses:
    """The masses of a :class:`~sfetcas.mechanics.model.Model` whose mesh has a place at every end of an element.

    Without ``moving`` the unit of mass is 1 kg, and section axes, which ``spins`` and ``rotary`` tell of, and what has
    dampers alone are no observables.  Then numbers of the scene may be symbols, but for those on which a small member's
    inertia depends, and all masses may vanish with them.

    Raises
    ------
    SceneError
        Nothing has mass; a small member's inertia depends on symbols.
    """
    return _Weigher(model).all(moving)


class _Weigher:
    """Collects the masses, in SI units."""

    def __init__(self, model: Any) -> None:
        self.model, self.scene = model, model.scene
        self.space, self.axes = model.space, model.element.axes
        count = len(model.segments.places)
        # Rows, columns and values of the mass matrix of the places, without what flexible members add.
        self.entries: list[tuple[Index, Index, Array]] = []
        self.drag = np.zeros(count)
        self.nodal, self.nodal_drag, self.within = (np.zeros(model.beams.weight.shape) for _ in range(3))
        # Sums of weight times b b^T over the axes b that turn with nodes of flexible elements, and by rotation, place
        # and element with everything else.
        self.spins = np.zeros((*model.beams.weight.shape, 3, 3))
        self.turning: dict[tuple[int, int, int], Array] = {}
        self.spins_within = np.zeros(self.spins.shape)
        rigid = [name for name, member in self.scene.members.items() if member.type == "rigid"]
        self.rigid = {int(model.rotations.ends[name][0]) for name in rigid}
        self.bodies: dict[str, BodyMass] = {}
        # Of points along members: elements, arms (m), masses and dampers, each by elements and nodes.
        self.points: list[tuple[Index, Array, Array, Array]] = []
        self.total: Any = 0.0

    def all(self, moving: bool) -> Masses:
        """Everything that the scene gives a mass or a damper."""
        model, scene = self.model, self.scene
        for name, member in scene.members.items():
            if member.type == "flexible":
                self._add_flexible(name)
            elif member.type == "rigid" and member.section is not None:
                self._add_rigid(name)
            elif member.type == "small" and (found := self._body(name)) is not None:
                self.bodies[name] = found
                self.total += found.mass
        for name, node in scene.nodes.items():
            number = model.segments.place(name)
            self._at(number, number, node.mass)
            self.total += node.mass
            self.drag = plus(self.drag, number, node.drag)
            turn = model.rotations.node_turn[name]
            if node.inertia is not None and turn is not None:
                self._turn(turn, np.diag(euler_weights(numbers(node.inertia))), place=number)
        length, moment = model.scales.length, model.scales.moment
        if self.total <= 0.0:
            raise SceneError("nothing has a mass, accepted: a section with rhoA, or a node with mass")
        mass = self.total if moving else 1.0
        time = np.sqrt(mass / moment) * length
        of_drag = mass / time
        inside = np.ones(self.nodal.shape[1])
        inside[[0, -1]] = 0.0
        owners = [model.segments.parts[i] for i in model.segments.owner]
        at_ends = [[model.segments.place(each) for each in (one.start, one.end)] for one in owners]
        number = np.array(at_ends, dtype=np.intp).ravel()
        masses, drags = (part[:, [0, -1]].ravel() for part in (self.nodal, self.nodal_drag))
        of_turning, keys = mass * length**2, np.array(list(self.turning), dtype=np.intp).reshape(-1, 3)
        spread = numbers(list(self.turning.values()) or np.zeros((0, 3, 3))) / of_turning
        groups = [*self._bodies(mass), *self._points(mass, of_drag)]
        if moving:
            groups += [*self._strains(time), *self._stretches(time), *self._relaxations(time), *self._springs(time)]
            groups = [*self._axes(of_turning), *groups]
        return Masses(
            time=time,
            mass=mass,
            places=self._on_places([*self.entries, (number, number, masses)], mass),
            place_drag=added(self.drag, number, drags) / of_drag,
            alone=self._on_places(self.entries, mass),
            inner=inside * self.nodal / mass,
            inner_drag=inside * self.nodal_drag / of_drag,
            ends=(1.0 - inside) * self.nodal / mass,
            ends_drag=(1.0 - inside) * self.nodal_drag / of_drag,
            at_ends=number.reshape(-1, 2),
            rigid=RigidMasses(self.within / mass, self.spins_within / of_turning),
            spins=self.spins / of_turning,
            rotary=RotaryInertia(keys[:, 0], keys[:, 1:], spread),
            observables=tuple(groups),
        )

    def _on_places(self, entries: Sequence[tuple[Index, Index, Array]], unit: Any) -> SparseMap:
        row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
        return SparseMap(row, column, value / unit, (len(self.drag), len(self.drag)))

    def _at(self, row: Any, column: Any, mass: Any) -> None:
        """Add entries of the mass matrix, one or several."""
        rows, columns = (np.atleast_1d(np.asarray(part, dtype=np.intp)) for part in (row, column))
        self.entries.append((rows, columns, np.atleast_1d(numbers(mass))))

    def _body(self, name: str) -> BodyMass | None:
        """Inertia of a small member, which is found in plain numbers."""
        body = body_of(self.scene, name)
        if body.weight is None:
            return None
        of_mass = [body.rest, body.stiff, body.mass, *vars(body.weight).values()]
        found = None if any(map(depends, of_mass)) else body_mass(self.scene, name)
        if any(map(depends, of_mass if found is None else vars(found).values())):
            message = "found a small member whose inertia depends on numbers that change, accepted: numbers on which it"
            raise SceneError(f"{message} does not depend", ("members", name))
        return found

    def _turn(self, turn: int, spread: Array, place: int = -1, element: int = -1) -> None:
        """Sum of weight times b b^T over axes b that turn with a rotation, of a node or a rigid member."""
        key = turn, place, element
        self.turning[key] = self.turning.get(key, np.zeros((3, 3))) + spread

    # -- members --------------------------------------------------------------------------------

    def _add_flexible(self, name: str) -> None:
        part, line = self.model.elements_of(name), self.scene.center_lines[name]
        section = self.scene.sections[str(self.scene.members[name].section)]
        x, weights = self._nodes(name)
        mass = (section.mass(x.ravel()).reshape(x.shape) + mass_of_tubes(self.scene, name, x)) * weights
        drag = section.drag * weights
        self.total += mass.sum()
        mass, drag = self._off_line(name, x, mass, drag)
        self.nodal, self.nodal_drag = plus(self.nodal, part, mass), plus(self.nodal_drag, part, drag)
        inertia = section.inertia(x.ravel())
        if inertia.any():
            frames = quaternion.matrix(line.quaternions(x.ravel()))
            spread = _spread(frames, inertia * weights.ravel()[:, None])
            self.spins = plus(self.spins, part, spread.reshape(*x.shape, 3, 3))

    def _off_line(self, name: str, x: Array, mass: Array, drag: Array) -> tuple[Array, Array]:
        """Masses and drags (elements, nodes) that are left on the line of a member; all others become points.

        Points are those with arms, and inner nodes of elements whose tangents change with the curvature: where these
        are follows not only from the rotations of the points of the element.
        """
        model, sections, member = self.model, self.scene.sections, self.scene.members[name]
        shifted, arms = member.shifted(sections), np.zeros((*x.shape, 3))
        part = model.elements_of(name)
        elements, inside, left = np.arange(part.start, part.stop), np.ones(x.shape), np.zeros(x.shape)
        inside[:, [0, -1]] = 0.0
        if member.overhangs(sections):
            arms = arms_of(self.scene, name, x.ravel()).reshape(arms.shape)
            self.points.append((elements, arms, mass, left))
            mass = left
        elif shifted:
            self.points.append((elements, arms, mass * inside, left))
            mass = mass * (1.0 - inside)
        if shifted and drag.any():
            self.points.append((elements, np.zeros(arms.shape), left, drag * inside))
            drag = drag * (1.0 - inside)
        return mass, drag

    def _add_rigid(self, name: str) -> None:
        """The mass spread over the straight line between the nodes: exact between the displacements of its ends."""
        member, scene = self.scene.members[name], self.scene
        section = scene.sections[str(member.section)]
        if section.missing(["rhoA"]):
            return
        x, w = pieces(section.panels, 9)
        start, end = (scene.nodes[n].position for n in member.nodes)
        chord = place(Straight(), start, end, member.b2, ("members", name))
        share = section.mass(x) * w * chord.length
        self.total += share.sum()
        a, b = (self.model.segments.place(self.model.segments.ends[name, i]) for i in range(2))
        for row, column, weight in ((a, a, (1 - x) ** 2), (a, b, x * (1 - x)), (b, a, x * (1 - x)), (b, b, x**2)):
            self._at(row, column, share @ weight)
        inertia = (section.inertia(x) * (w * chord.length)[:, None]).sum(axis=0)
        frame, part = quaternion.matrix(chord.quaternions(np.array([0.5])))[0], self.model.elements_of(name)
        self._turn(int(self.model.rotations.ends[name][0]), _spread(frame, inertia), element=part.start)
        if scene.center_lines[name].turning == 0.0:
            along, weights = self._nodes(name)
            self.within = plus(self.within, part, section.mass(along.ravel()).reshape(along.shape) * weights)
            spins = _spread(frame, section.inertia(along.ravel()) * weights.ravel()[:, None])
            self.spins_within = plus(self.spins_within, part, spins.reshape(*along.shape, 3, 3))

    def _nodes(self, name: str) -> tuple[Array, Array]:
        """Fractions of the length of a member at the nodes of its elements, and their weights, m, (elements, p + 1)."""
        element, cuts = self.model.element, self.model.mesh.cuts[name]
        lengths = np.diff(cuts)[:, None]
        return within_elements(cuts, element.nodes), self.scene.center_lines[name].length * lengths * element.weights

    # -- groups ---------------------------------------------------------------------------------

    def _axes(self, unit: float) -> list[Observables]:
        """Rotary inertia of all rotations that have any."""
        rotations, places = self.model.rotations, self.model.segments
        spread, shared = np.zeros((len(rotations.kind), 3, 3)), dict[tuple[int, int, int], Array]()

        def put(turn: int, place: int, element: int, own: Array) -> None:
            if turn in self.rigid:
                key = turn, place, element
                shared[key] = shared.get(key, np.zeros((3, 3))) + own
            else:
                spread[turn] += own

        for name, member in self.scene.members.items():
            part = self.model.elements_of(name) if member.type == "flexible" else slice(0)
            if self.spins[part].any():
                chain, own = rotations.turns[part].ravel(), self.spins[part].reshape(-1, 3, 3)
                np.add.at(spread, chain[1:-1], own[1:-1])
                for i in (0, -1):
                    put(int(chain[i]), places.place(places.ends[name, -i]), -1, own[i])
        for key, own in self.turning.items():
            put(*key, own)
        turns, at = np.arange(len(spread)), np.full((len(spread), 2), -1)
        if shared:
            keys = np.array(list(shared))
            turns, at = np.concatenate([turns, keys[:, 0]]), np.concatenate([at, keys[:, 1:]])
            spread = np.concatenate([spread, list(shared.values())])
        if not self.space:
            # The turning of one direction: about z, the sum of the weights of what lies in the plane.
            about = spread[:, 0, 0] + spread[:, 1, 1]
            used = np.flatnonzero(about)
            data = np.tile([1.0, 0.0], (len(used), 1))
            mass = np.repeat(about[used, None], 2, axis=1)
        else:
            used = np.flatnonzero(np.abs(spread).max(axis=(1, 2)))
            values, vectors = np.linalg.eigh(spread[used])
            data = vectors.transpose(0, 2, 1).reshape(-1, 9)
            mass = np.repeat(values, 3, axis=1)
        if not len(used):
            return []
        places = np.zeros((len(used), 0), dtype=np.intp)
        none = np.zeros(mass.shape)
        return [Observables(Axes(self.space), turns[used, None], places, data, mass / unit, none, at=at[used])]

    def _bodies(self, unit: float) -> list[Observables]:
        """Points and numbers of the small members, those of one kind together."""
        rotations, segments, scales = self.model.rotations, self.model.segments, self.model.scales
        found: dict[BodyPoints, list[tuple[Array, ...]]] = {}
        for name, body in self.bodies.items():
            kind, data = points_of(name, body, self.space, scales.length)
            places = [segments.place(segments.ends[name, i]) for i in range(kind.nodes)]
            mass = body.mass / unit * np.ones(kind.sizes[2])
            found.setdefault(kind, []).append((np.array(rotations.ends[name]), np.array(places), data, mass))
        groups = []
        for kind, members in found.items():
            turns, sides, data = (np.array([member[i] for member in members]) for i in range(3))
            mass = numbers([member[3] for member in members])
            groups.append(Observables(kind, turns, sides, data, mass, np.zeros(mass.shape)))
        return groups

    def _points(self, unit: float, of_drag: float) -> list[Observables]:
        """Points along members."""
        if not self.points:
            return []
        model, axes, length = self.model, self.axes, self.model.scales.length
        elements, arms, mass, drag = (np.concatenate(part) for part in zip(*self.points, strict=True))
        arms = arms[..., :axes] / length
        starts = [model.segments.place(part.start) for part in model.segments.parts]
        start = np.array(starts, dtype=np.intp)[model.segments.owner][elements]
        rest = np.zeros(arms.shape)
        for name in model.members:
            part, line, cuts = model.elements_of(name), self.scene.center_lines[name], model.mesh.cuts[name]
            x = within_elements(cuts, model.element.nodes)
            places = line.positions(x.ravel())[:, :axes].reshape(*x.shape, axes) / length
            own = np.flatnonzero((elements >= part.start) & (elements < part.stop))
            rest = plus(rest, own, (places - places[:, :1])[elements[own] - part.start])
        line_data = model.beams.flat("tangent", "compliance")[elements]
        data = np.hstack([rest.reshape(len(rest), -1), arms.reshape(len(arms), -1), line_data])
        places = np.hstack([start[:, None], model.segments.strains[elements]])
        mass, drag = (np.repeat(part, axes, axis=1) for part in (mass / unit, drag / of_drag))
        kind, turns = MassPoints(self.space, model.element), model.rotations.turns[elements]
        return [Observables(kind, turns, places, data, mass, drag, along=(elements, arms))]

    def _strains(self, time: float) -> list[Observables]:
        """Kelvin-Voigt damping of the flexible members that have any."""
        model, element = self.model, self.model.element
        n, groups = element.order + 1, []
        for name in model.members:
            member, line = self.scene.members[name], self.scene.center_lines[name]
            delay = 0.0 if member.type == "rigid" else self.scene.sections[str(member.section)].damping
            if not delay:
                continue
            cuts, part = model.mesh.cuts[name], model.elements_of(name)
            x = within_elements(cuts, element.nodes)
            section = self.scene.sections[str(member.section)]
            stiffness = section.stiffness(x.ravel())
            chosen = stiffness if self.space else stiffness[:, 1:2] if line.bending_axis == 2 else stiffness[:, 2:3]
            # Squares of derivatives by xi: weight over length.
            weights = (element.weights / (line.length * np.diff(cuts)[:, None])).ravel()[:, None]
            unit = model.scales.moment * time
            slopes = np.tile(differentiation(element.nodes).T.ravel(order="F"), (len(x), 1))
            axes = quaternion.matrix(line.quaternions(x.ravel()))
            if self.space and section.coupled:
                # About the principal axes of the stiffness.
                chosen, principal = np.linalg.eigh(section.stiffness_matrix(x.ravel()))
                axes = axes @ principal
            damping = (delay * weights * chosen / unit).reshape(len(x), -1)
            frames = axes.transpose(0, 2, 1).reshape(len(x), -1)
            data = np.hstack([slopes, frames]) if self.space else slopes
            groups.append((model.rotations.turns[part], data, damping, np.arange(part.start, part.stop)))
        if not groups:
            return []
        turns, data, damping, elements = (np.concatenate(part) for part in zip(*groups, strict=True))
        places, none = np.zeros((len(turns), 0), dtype=np.intp), np.zeros(damping.shape)
        return [Observables(Strains(self.space, n), turns, places, data, none, damping, sections=elements)]

    def _stretches(self, time: float) -> list[Observables]:
        """Kelvin-Voigt damping of stretch and shear: their energy is half the square of the scaled strains."""
        model, places, damping, points = self.model, [np.zeros(0, np.intp)], [np.zeros(0)], [np.zeros(0, np.intp)]
        for name in model.members:
            member, part = self.scene.members[name], model.elements_of(name)
            if not member.stretches(self.scene.sections):
                continue
            delay = self.scene.sections[str(member.section)].damping
            if delay:
                places.append(model.segments.strains[part].ravel())
                points.append(
                    np.arange(model.segments.strains.size).reshape(model.segments.strains.shape)[part].ravel()
                )
                damping.append(np.full(len(places[-1]), delay / time))
        return self._strained(places, damping, np.concatenate(points))

    def _strained(self, places: list[Index], damping: list[Array], points: Index | None = None) -> list[Observables]:
        """Dampers of scaled strains, which are numbered as places."""
        sides, weights = np.concatenate(places)[:, None], np.concatenate(damping)
        if not len(weights):
            return []
        each = np.repeat(weights[:, None], self.axes, axis=1)
        nothing, data = np.zeros((len(weights), 0), np.intp), np.zeros((len(weights), 0))
        return [Observables(Stretches(self.space), nothing, sides, data, np.zeros(each.shape), each, sections=points)]

    def _relaxations(self, time: float) -> list[Observables]:
        """Dampers of the branches in which members relax: their energy is half the square of scaled strains."""
        model, places, damping = self.model, [np.zeros(0, np.intp)], [np.zeros(0)]
        for name in model.members if model.segments.relaxing.shape[1] else ():
            part = model.elements_of(name)
            for i, branch in enumerate(self.scene.members[name].branches(self.scene.sections)):
                own = model.segments.relaxing[:, i, part].ravel()
                places.append(own[own >= 0])
                damping.append(np.full(len(places[-1]), branch.time / time))
        return self._strained(places, damping)

    def _springs(self, time: float) -> list[Observables]:
        """Dampers beside springs."""
        found = []
        for number, group in enumerate(self.model.terms):
            kind = group.kind
            if kind.table != "springs":
                continue
            damping = np.array([self.scene.springs[name].damping for name in group.names])
            chosen = np.flatnonzero(damping)
            if not len(chosen):
                continue
            travel, effort = map(self.model.scales.of, kind.answers.values())
            weight = damping[chosen, None] / (effort / travel * time)
            sides, none = (group.turns[chosen], group.places[chosen]), np.zeros(weight.shape)
            observed = SpringTravel(self.space, kind)
            found.append(Observables(observed, *sides, group.data[chosen], none, weight, number, chosen))
        return found
