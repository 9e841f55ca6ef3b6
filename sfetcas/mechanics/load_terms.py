"""Loads as terms: moments on rotations, and follower forces and moments.

A follower force gives a generalised force ``R(q) f`` on its place and nothing on the rotation that it turns with; along
an element the forces at its points are moved to its first place, and their moments act on its nodes.  A moment has a
potential in the plane, and about the axis of a rotation that is restrained to it; in space a moment on a free rotation
has none, whether fixed or follower.

Source: Barraco and Munteanu, Part 1, section 4 (virtual work).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.loads import Load
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers, scattered, values_of
from ..mathematics.kernels import Batch
from ..mathematics.quaternion import product
from .elements import Element
from .joints import Turning
from .mesh import Mesh
from .parts import Parts
from .rotations import STIFF, RotationFreedom, Rotations, end_joints
from .segments import Segments
from .terms import GROUND, Discrete, Group, One, Side, Term, densities_of

__all__ = [
    "AxisMoment",
    "Follower",
    "FollowingMoment",
    "FollowingSpread",
    "Moment",
    "carried",
    "cut_of",
    "followed_elements",
    "inner_cut",
    "loads_in",
    "present",
    "pull_within",
    "spread_of",
]


@final
@dataclass(frozen=True)
class Follower(Term):
    """A force on a place that turns with a rotation; load: its components in the undeformed scene."""

    is_load: ClassVar[bool] = True
    follows: ClassVar[bool] = True

    @property
    def has_potential(self) -> bool:
        """False."""
        return False

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation and a place."""
        return 1, 1, 0, 0, self.axes

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Minus the rotated force, on the place."""
        nothing = [ca.SX(0)] * self.turns
        return [*nothing, *[-f for f in self.forth(q[0], ca.vertsplit(load))]]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus the rotated force times the displacement."""
        return -ca.dot(ca.vertcat(*self.forth(q[0], ca.vertsplit(load))), ca.vertcat(*u[0]))


@final
@dataclass(frozen=True)
class FollowingSpread(Term):
    """Forces at the nodes of an element that turn with them.

    Data: tangents and compliances of the nodes, load: forces there, of the undeformed scene.

    Attributes
    ----------
    element : Element
        The element, which integrates at its nodes.
    """

    is_load: ClassVar[bool] = True
    follows: ClassVar[bool] = True
    along_element: ClassVar[bool] = True

    element: Element

    @property
    def has_potential(self) -> bool:
        """False."""
        return False

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, the place at its start, and its strains."""
        turns, strains, _, _, loads = self.element.sizes
        return turns, 1 + strains, 0, self.element.line_data, loads

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Moments on the nodes by the forces beyond each, minus the sum of the forces on the place, and on strains."""
        tangents, forces, carried = self._now(q, u, data, load)
        moments = []
        for tangent, force in zip(tangents, carried, strict=True):
            levers = ca.cross(tangent, force) if self.space else tangent[0] * force[1] - tangent[1] * force[0]
            moments += [-m for m in ca.vertsplit(levers)]
        if self.element.shifted:
            moments = self._moments(q, tangents, carried)
        total = sum(forces[1:], forces[0])
        straining = []
        for k in range(len(u) - 1):
            by_strain = ca.jacobian(tangents[k], ca.vertcat(*u[1 + k]))
            straining += [-f for f in ca.vertsplit(ca.mtimes(by_strain.T, carried[k]))]
        return [*moments, *[-f for f in ca.vertsplit(total)], *straining]

    def _moments(self, q: list[Side], tangents: list[ca.SX], carried: list[ca.SX]) -> list[ca.SX]:
        """Moments on the nodes where a tangent changes with the curvature, and so with the rotations of all of them."""
        found: list[ca.SX] = []
        for side in q:
            by_side = ca.jacobian(ca.vertcat(*tangents), ca.vertcat(*side))
            work = ca.mtimes(by_side.T, ca.vertcat(*carried))
            if self.space:
                basis = [ca.vertcat(*product([0.0, *axis], side)) for axis in np.eye(3).tolist()]
                found += [-0.5 * ca.dot(one, work) for one in basis]
            else:
                found.append(-work)
        return found

    def densities(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]] | None:
        """The rotated forces, and no couples."""
        return self._now(q, u, data, load)[1], [ca.SX.zeros(self.turns * len(q))]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus the rotated forces times the displacements of the nodes."""
        tangents, forces, carried = self._now(q, u, data, load)
        total = -ca.dot(sum(forces[1:], forces[0]), ca.vertcat(*u[0]))
        for tangent, rest, force in zip(tangents, ca.horzsplit(self.element.line(data)[0]), carried, strict=True):
            total -= ca.dot(force, tangent - rest)
        return total

    def _now(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
        """Turned tangents and forces, and the share of the forces beyond each node that its tangent carries."""
        element, n = self.element, self.axes
        beyond = element.to_points / element.weights
        tangents = element.tangents(q, u[1:], data)
        forces = [ca.vertcat(*self.forth(side, ca.vertsplit(load[n * k : n * k + n]))) for k, side in enumerate(q)]
        carried = [
            sum((float(beyond[j, k]) * force for j, force in enumerate(forces)), ca.SX.zeros(n))
            for k in range(len(forces))
        ]
        return tangents, forces, carried


@final
@dataclass(frozen=True)
class Moment(Term):
    """A dead moment on a rotation, in the plane about z; load: its components in the fixed axes."""

    is_load: ClassVar[bool] = True
    is_couple: ClassVar[bool] = True

    @property
    def has_potential(self) -> bool:
        """True in the plane."""
        return not self.space

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation."""
        return 1, 0, 0, 0, self.turns

    @property
    def discrete(self) -> Discrete:
        """Linear in the angle of the plane."""
        return "middle" if self.space else "relative"

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """In the plane the angle times minus the moment."""
        return ca.SX(0) if self.space else -load * q[0][0]

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Minus the moment in space."""
        return [-m for m in ca.vertsplit(load)] if self.space else []


@final
@dataclass(frozen=True)
class FollowingMoment(Term):
    """A follower moment on a rotation, in space; load: its components in the undeformed scene."""

    is_load: ClassVar[bool] = True
    follows: ClassVar[bool] = True

    @property
    def has_potential(self) -> bool:
        """False."""
        return False

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation."""
        return 1, 0, 0, 0, 3

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Minus the rotated moment."""
        return [-m for m in self.forth(q[0], ca.vertsplit(load))]


@final
@dataclass(frozen=True)
class AxisMoment(Turning):
    """A moment on a rotation restrained to an axis, in space; it works on the counted angle; load: components."""

    is_load: ClassVar[bool] = True
    is_couple: ClassVar[bool] = True

    @property
    def own(self) -> int:
        """Zero."""
        return 0

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The ground and the rotation."""
        turns, places, rows, data, _ = super().sizes
        return turns, places, rows, data, 3

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The angle times minus the moment about the axis."""
        return -ca.dot(data[:3], load) * self.angle(q, data)

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Minus the moment across the axis, which the support takes."""
        across = load - ca.dot(data[:3], load) * data[:3]
        return [*ca.vertsplit(across), *ca.vertsplit(-across)]


# -- of a scene -------------------------------------------------------------------------------------


def _turning_of(rotations: Rotations, name: str, node: str) -> int:
    """Rotation of a node that a load acts on.

    Raises
    ------
    SceneError
        There is none.
    """
    number = rotations.node_turn[node]
    if number is None:
        raise SceneError(f"nothing turns with node {node!r}, so no moment or follower can act on it", ("loads", name))
    return number


def cut_of(mesh: Mesh, load: Load) -> int:
    """Index of the end of elements of its member at which a load acts."""
    return mesh.cut_at(str(load.member), load.at or 0.0)


def loads_in(parts: Parts) -> Iterator[One]:
    """The loads of a scene that are terms, each under the name ``loads.NAME``.

    Raises
    ------
    SceneError
        A moment or follower acts on a node without a rotation of its own.
    """
    scene, rotations, space, nothing = parts.scene, parts.rotations, parts.element.space, np.zeros(0)
    for name, load in scene.loads.items():
        follows = load.frame == "follower" and (space or load.type != "moment")
        if load.type == "distributed" or not (follows or load.type == "moment"):
            continue
        number, where = _rotation(parts, name, load), (f"loads.{name}", _node_of(parts, load))
        if load.type == "force":
            place = _place(parts.mesh, parts.segments, load)
            yield One(Follower(space), *where, nothing, (number,), (place,))
        elif follows:
            yield One(FollowingMoment(space), *where, nothing, (number,))
        elif space and rotations.kind[number] == RotationFreedom.AXIS:
            axis = numbers([*rotations.axis[number], 0.0])
            yield One(AxisMoment(space), *where, axis, (GROUND, number))
        else:
            yield One(Moment(space), *where, nothing, (number,))
    line = parts.beams.flat("tangent", "compliance")
    for e in followed_elements(parts):
        if parts.element.gauss:
            raise SceneError("distributed followers need integration at the nodes, found Gauss integration")
        kind = FollowingSpread(space, parts.element)
        start = parts.segments.place(parts.segments.parts[parts.segments.owner[e]].start)
        sides = tuple(rotations.turns[e].tolist()), (start, *parts.segments.strains[e].tolist())
        yield One(kind, f"element {e}", "", line[e], *sides, element=e)


def followed_elements(parts: Parts) -> list[int]:
    """Numbers of the elements under follower distributed loads; each of them is a segment."""
    found: set[int] = set()
    for load in parts.scene.loads.values():
        if load.type == "distributed" and load.follows:
            member = str(load.member)
            cuts = parts.mesh.cuts[member]
            inside = load.inside(values_of(0.5 * (cuts[1:] + cuts[:-1])))
            found |= set((parts.beams.first[member] + np.flatnonzero(inside)).tolist())
    return sorted(found)


def _rotation(parts: Parts, name: str, load: Load) -> int:
    """Rotation that a load acts on or turns with."""
    if load.node is not None:
        return _turning_of(parts.rotations, name, load.node)
    runs = [part.elements for part in parts.segments.parts if part.member == load.member]
    chain = parts.rotations.chain(slice(runs[0].start, runs[-1].stop))
    return int(chain[cut_of(parts.mesh, load) * parts.element.order])


def _node_of(parts: Parts, load: Load) -> str:
    """The node that a load acts on, also at an end of a member that turns with it; empty within members."""
    if load.node is not None:
        return load.node
    member, cut = str(load.member), cut_of(parts.mesh, load)
    if 0 < cut < len(parts.mesh.cuts[member]) - 1:
        return ""
    node, joint = end_joints(parts.scene, parts.scene.members[member])[1 if cut else 0]
    return node if joint in STIFF else ""


def _place(mesh: Mesh, segments: Segments, load: Load) -> int:
    """Place that a force which follows acts on."""
    if load.node is not None:
        return segments.place(load.node)
    parts = [part for part in segments.parts if part.member == load.member]
    at = parts[0].elements.start + cut_of(mesh, load)
    return segments.place(next((part.start for part in parts if part.elements.start == at), parts[-1].end))


def carried(forces: Array, segments: Segments, element: Element) -> tuple[Array, Array]:
    """Pull (elements, points, axes) and forces on places (places, axes) by given forces along the elements.

    The pull at a point is minus the load between it and the end of its segment.  Within an element this uses the
    transpose of the matrix that integrates the rotated tangents, so that the discrete potential has exactly this
    gradient.
    """
    on_element = forces.sum(axis=1)
    pull = pull_within(forces, element)
    alone, starts = segments.single
    on_places = scattered(len(segments.places), starts, on_element[alone])
    for part in segments.longer:
        here = part.elements
        if not forces[here].any():
            continue
        beyond = np.cumsum(on_element[here][::-1], axis=0)[::-1]
        pull[here] -= (beyond - on_element[here])[:, None, :]
        on_places[segments.place(part.start)] += beyond[0]
    return pull, on_places


def pull_within(forces: Array, element: Element) -> Array:
    """Pull (elements, points, axes) within each element by the forces along it alone, as of :func:`carried`."""
    pull: Array = -np.einsum("jk,eja->eka", element.to_points, forces) / element.weights[:, None]
    return pull


# -- what they are at a state -----------------------------------------------------------------------


def present(model: Any, q: Array, places: Array, loading: Any) -> Any:
    """The :class:`~sfetcas.mechanics.loading.Loading` with loads that turn as dead loads at a state.

    Rotations are (rotations, components), displacements (places, axes).  It serves to evaluate answers: what turns is
    added to the dead loads, and its terms have no loads.
    """
    if not (loading.follows or loading.of(_has_densities)):
        return loading
    found = {
        name: getattr(loading, name).copy()
        for name in ("force", "own", "spread", "moment", "further", "couple", "jump", "torque")
    }
    along, loads = np.zeros_like(loading.spread), list(loading.loads)
    for i, (group, load) in enumerate(zip(model.connections, loading.loads, strict=True)):
        if _has_densities(group.kind):
            batch = _densities(group.kind, len(load))
            for k, values in enumerate((q[group.turns], places[group.places], group.data, load)):
                batch.set(k, values)
            forces, couples = batch()
            number = group.elements
            np.add.at(along, number, forces.reshape(len(number), *along.shape[1:]))
            np.add.at(found["torque"], number, couples.reshape(len(number), *loading.torque.shape[1:]))
            loads[i] = np.zeros_like(load)
            continue
        if not group.kind.follows:
            continue
        loads[i] = np.zeros_like(load)
        on_places = group.places.shape[1]
        width = model.element.axes if on_places else 3
        turned = quaternion.turned_by(q[group.turns], load.reshape(len(load), -1, width))
        if on_places:
            for part in ("force", "own"):
                np.add.at(found[part], group.places[:, 0], turned[:, 0])
        else:
            for part in ("moment", "further"):
                np.add.at(found[part], group.turns[:, 0], turned[:, 0])
            _put(model, group, turned[:, 0], found)
    pull, carried_to = carried(along, model.segments, model.element)
    found["spread"] += along
    found["force"] += carried_to
    before = loading.before or loading.loads
    return replace(loading, **found, pull=loading.pull + pull, loads=tuple(loads), before=before)


@functools.lru_cache(maxsize=16)
def _densities(kind: Term, n: int) -> Batch:
    """What a kind gives along n elements, evaluated at once."""
    return Batch(densities_of(kind), n)


def _has_densities(kind: Term) -> bool:
    """Whether a kind gives forces or couples along an element."""
    return kind.along_element and bool(densities_of(kind).size1_out(0))


def _put(model: Any, group: Group, moments: Array, found: Mapping[str, Array]) -> None:
    """Add moments to those on nodes, and to those at cuts within members."""
    for name, node, moment in zip(group.names, group.nodes, moments, strict=True):
        if node:
            found["couple"][model.segments.place(node)] += moment
            continue
        element = inner_cut(model.mesh, model.beams.first, model.scene.loads[name.removeprefix("loads.")])
        if element is not None:
            found["jump"][element] += moment


def inner_cut(mesh: Mesh, first: Mapping[str, int], load: Load) -> int | None:
    """Element that begins where a load acts within its member; None where it acts at an end of the member."""
    member, cut = str(load.member), cut_of(mesh, load)
    return first[member] + cut if 0 < cut < len(mesh.cuts[member]) - 1 else None


def spread_of(expressions: Any, q: ca.MX, y: ca.MX, given: Any) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Distributed forces (axes, points of all elements) at a state, the pull of those that turn alone, and couples.

    The first argument is an :class:`~sfetcas.mechanics.expressions.Expressions`; couples are (turns, points).
    """
    model, axes, n = expressions.model, expressions.axes, expressions.points
    spread = ca.reshape(given.spread, axes, -1)
    pull, torque = ca.MX(*spread.shape), ca.MX(expressions.turns, spread.shape[1])
    for number, group in enumerate(model.terms):
        if not _has_densities(group.kind):
            continue
        points = (group.elements[:, None] * n + np.arange(n)).ravel()
        sides = expressions.sides(group, q, expressions.retained_places(y, given))
        data = ca.MX(given.data[number - 1])
        function = expressions.many(densities_of(group.kind), len(group.data))
        forces, couples = function(*sides, data, expressions.load(number, given))
        turned = ca.reshape(forces, axes, len(points))
        beyond = ca.DM(-model.element.to_points / model.element.weights)
        onto = ca.DM.triplet(
            list(range(len(points))), points.tolist(), ca.DM.ones(len(points)), len(points), spread.shape[1]
        )
        spread += ca.mtimes(turned, onto)
        pull += ca.mtimes(ca.mtimes(turned, ca.kron(ca.DM.eye(len(group.data)), beyond)), onto)
        torque += ca.mtimes(ca.reshape(couples, expressions.turns, len(points)), onto)
    return spread, pull, torque
