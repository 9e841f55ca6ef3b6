"""Rotating axes: the potential of the centrifugal forces on all that has mass, and these forces.

In axes that rotate with ``Omega`` about the origin rest is an equilibrium of the loads and of the centrifugal forces,

    V = -1/2 sum m (|Omega x r|^2 - |Omega x r_0|^2) = -1/2 sum m (r + r_0).P (r - r_0),
    P = Omega.Omega 1 - Omega Omega^T,

over everything that carries mass: nodes and rigid members, elements, points of small members, and the section axes b of
all these, of which it is ``-1/2 P : (R S R^T - S)`` with ``S = sum m b b^T``.  It is zero for the undeformed scene.
These potentials are connections like those of springs, so that statics, paths and stability know of them; they do not
grow with the load factor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index, numbers, plus, values_of
from .elements import Element
from .loading import Loading
from .masses import Masses, RigidMasses, masses_of
from .mesh import within_elements
from .terms import Group, Side, Term

__all__ = [
    "CentrifugalElement",
    "CentrifugalPair",
    "CentrifugalSpin",
    "CentrifugalVectors",
    "RotatingFrame",
    "with_rotating_frame",
]


def _matrix(load: ca.SX, axes: int) -> ca.SX:
    """The matrix P, which is the load: it grows with the loads where these are followed from zero."""
    return ca.reshape(load, axes, axes)


def _potential(p: ca.SX, mass: ca.SX, start: ca.SX, moved: ca.SX) -> ca.SX:
    """That of a mass that has moved from where it was at the start."""
    return -0.5 * mass * ca.dot(2.0 * start + moved, ca.mtimes(p, moved))


@final
@dataclass(frozen=True)
class CentrifugalPair(Term):
    """Centrifugal potential of a mass-matrix entry of two places; data: undeformed positions, mass; load: P."""

    is_load: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Two places."""
        return 0, 2, 0, 2 * self.axes + 1, self.axes**2

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus half the mass times a product of the two positions, and what that was."""
        n, p = self.axes, _matrix(load, self.axes)
        start, moved = ([data[n * i : n * i + n] for i in range(2)], [ca.vertcat(*side) for side in u])
        changed = ca.dot(start[0], ca.mtimes(p, moved[1])) + ca.dot(moved[0], ca.mtimes(p, start[1] + moved[1]))
        return -0.5 * data[2 * n] * changed


@final
@dataclass(frozen=True)
class CentrifugalElement(Term):
    """Centrifugal potential of the nodes of an element, whose positions follow from the place at its start.

    Data: for each node its undeformed position, mass and integration weights, then tangents and compliances of all
    nodes; load: P.

    Attributes
    ----------
    element : Element
    """

    is_load: ClassVar[bool] = True
    along_element: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """All rotations of the element, its start, and its strains."""
        axes, (n, strains, *_) = self.axes, self.element.sizes
        return n, 1 + strains, 0, n * (axes + 1 + n) + self.element.line_data, axes**2

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The sum over the nodes."""
        p = _matrix(load, self.axes)
        return sum((_potential(p, *each) for each in self._nodes(q, u, data)), ca.SX(0))

    def densities(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
        """Forces at the nodes, and no couples."""
        p = _matrix(load, self.axes)
        forces = [mass * ca.mtimes(p, start + moved) for mass, start, moved in self._nodes(q, u, data)]
        return forces, [ca.SX.zeros(self.turns * len(q))]

    def _nodes(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
        """Mass, undeformed position and displacement of each node."""
        n, axes = self.element.order + 1, self.axes
        width = axes + 1 + n
        line = data[n * width :]
        changes, found = ca.horzcat(*self.element.tangents(q, u[1:], line)) - self.element.line(line)[0], []
        for k in range(n):
            own = data[k * width : (k + 1) * width]
            found.append((own[axes], own[:axes], ca.vertcat(*u[0]) + ca.mtimes(changes, own[axes + 1 :])))
        return found


@final
@dataclass(frozen=True)
class CentrifugalVectors(Term):
    """Centrifugal potential of the vectors that are the first rows of a quantity.

    Data: those of the quantity, for each vector its offset from the origin and its mass; load: P.

    Attributes
    ----------
    kind : Term
        The quantity.
    """

    is_load: ClassVar[bool] = True

    kind: Term

    @property
    def along_element(self) -> bool:  # type: ignore[override]
        """Whether they are carried by the nodes of an element."""
        return self.kind.along_element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Those of the quantity, without rows."""
        turns, places, _, data, _ = self.kind.sizes
        return turns, places, 0, data + self.kind.vectors * (self.axes + 1), self.axes**2

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The sum over the vectors."""
        p = _matrix(load, self.axes)
        return sum((_potential(p, *each) for each in self._vectors(q, u, data)), ca.SX(0))

    def densities(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]] | None:
        """Forces at the nodes of an element, and their couples about its line."""
        if not self.along_element:
            return None
        p = _matrix(load, self.axes)
        forces = [mass * ca.mtimes(p, start + moved) for mass, start, moved in self._vectors(q, u, data)]
        pairs = zip(self.kind.arms(q, data), forces, strict=True)
        return forces, [ca.cross(a, f) if self.space else a[0] * f[1] - a[1] * f[0] for a, f in pairs]

    def _vectors(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
        """Mass, what it was in the undeformed scene, and change of each."""
        axes, first, found = self.axes, self.kind.sizes[3], []

        def rows(q: list[Side], u: list[Side]) -> ca.SX:
            return ca.vertcat(*self.kind.residual(q, u, data[:first], ca.SX(0, 1)))

        still = [ca.SX(1)] + [ca.SX(0)] * 3 if self.space else [ca.SX(0)]
        before = rows([still] * len(q), [[ca.SX(0)] * axes] * len(u))
        moved = rows(q, u) - before
        for k in range(self.kind.vectors):
            own, at = data[first + k * (axes + 1) : first + (k + 1) * (axes + 1)], slice(k * axes, (k + 1) * axes)
            found.append((own[axes], own[:axes] + before[at], moved[at]))
        return found


@final
@dataclass(frozen=True)
class CentrifugalSpin(Term):
    """Centrifugal potential of axes that turn with a rotation, or with the nodes of an element, in space.

    Where axes turn in the plane about that of the rotating axes it does not change.  Data: for each node the sum S of
    mass times b b^T over its axes b in the undeformed scene; load: P.

    Attributes
    ----------
    nodes : int
        One, or those of an element.
    """

    is_load: ClassVar[bool] = True

    nodes: int

    @property
    def along_element(self) -> bool:  # type: ignore[override]
        """Whether they are those of the nodes of an element."""
        return self.nodes > 1

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations."""
        return self.nodes, 0, 0, 9 * self.nodes, 9

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The sum over the nodes."""
        p = _matrix(load, 3)
        return -0.5 * sum((ca.dot(p, now - rest) for now, rest in self._spread(q, data)), ca.SX(0))

    def densities(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]] | None:
        """No forces, and the couples b x m P b at the nodes of an element."""
        if not self.along_element:
            return None
        across = [ca.mtimes(now, _matrix(load, 3)) for now, _ in self._spread(q, data)]
        couples = [ca.vertcat(a[1, 2] - a[2, 1], a[2, 0] - a[0, 2], a[0, 1] - a[1, 0]) for a in across]
        return [ca.SX.zeros(3 * self.nodes)], couples

    def _spread(self, q: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        """S of each node, turned and as it was."""
        found = []
        for k, side in enumerate(q):
            rest = ca.reshape(data[9 * k : 9 * k + 9], 3, 3)
            turned = ca.horzcat(
                *[ca.vertcat(*self.forth(side, ca.vertsplit(axis))) for axis in ca.horzsplit(ca.SX.eye(3))]
            )
            found.append((ca.mtimes([turned, rest, turned.T]), rest))
        return found


@dataclass(frozen=True, eq=False)
class RotatingFrame:
    """The rotation of the axes of a model, and its centrifugal terms; dimensionless but for the speed.

    Attributes
    ----------
    omega : ndarray (3,)
        Angular velocity, rad/s.
    groups : tuple of int
        Numbers of the groups of connections that act not along elements: on places, which come first, small members,
        and what turns.
    at : tuple of (ndarray or None)
        Of each of these where its moments act, see ``at`` of :class:`~sfetcas.mechanics.masses.Observables`.
    rest : ndarray (places, axes)
        Undeformed positions of the places.
    rigid : RigidMasses
        Masses along straight rigid members.
    loading : Loading
        P on everything that has mass; no factor multiplies it.
    """

    omega: Array
    groups: tuple[int, ...]
    at: tuple[Index | None, ...]
    rest: Array
    rigid: RigidMasses
    loading: Loading


def with_rotating_frame(model: Any) -> Any:
    """A :class:`~sfetcas.mechanics.model.Model` with the centrifugal terms of its rotating axes added.

    Raises
    ------
    SceneError
        Nothing has mass.
    """
    masses = masses_of(model, moving=False)
    axes = model.element.axes
    speed = numbers(model.scene.rotating)
    omega = speed * masses.time
    matrix = ((omega @ omega) * np.eye(3) - np.outer(omega, omega))[:axes, :axes]
    rest, inner_rest = _at_rest(model)
    found = _groups(model, masses, rest, inner_rest)
    groups, before = tuple(group for group, _ in found), len(model.connections)
    nothing = tuple(np.zeros((len(group.names), axes**2)) for group in groups)
    kinds = tuple(group.kind for group in groups)
    loadings = {
        name: replace(load, loads=(*load.loads, *nothing), kinds=(*load.kinds, *kinds))
        for name, load in model.groups.items()
    }
    empty = loadings[None].scaled(0.0)
    here = tuple(np.tile(matrix.ravel(), (len(group.names), 1)) for group in groups)
    loading = replace(empty, loads=(*empty.loads[:before], *here))
    apart = [(before + i, at) for i, (group, at) in enumerate(found) if not group.kind.along_element]
    numbered, at = tuple(i for i, _ in apart), tuple(at for _, at in apart)
    rotating_frame = RotatingFrame(speed, numbered, at, rest, masses.rigid, loading)
    return replace(model, connections=(*model.connections, *groups), groups=loadings, rotating_frame=rotating_frame)


def _at_rest(model: Any) -> tuple[Array, Array]:
    """Undeformed positions of the places (places, axes) and of the nodes of elements (elements, p + 1, axes)."""
    scene, element, segments = model.scene, model.element, model.segments
    axes = element.axes
    inner = np.zeros((*model.beams.weight.shape, axes))
    for name in model.members:
        cuts, line, part = model.mesh.cuts[name], scene.center_lines[name], model.elements_of(name)
        x = within_elements(cuts, element.nodes)
        inner = plus(inner, part, line.positions(x.ravel())[:, :axes].reshape(*x.shape, axes))
    where = {name: numbers(node.position)[:axes] for name, node in scene.nodes.items()}
    where |= {place: where[scene.members[name].nodes[i]] for (name, i), place in segments.ends.items()}
    for part in segments.parts:
        where.setdefault(part.start, inner[part.elements.start, 0])
        where.setdefault(part.end, inner[part.elements.stop - 1, -1])
    rest = numbers([where.get(place, np.zeros(axes)) for place in segments.places])
    return rest / model.scales.length, inner / model.scales.length


def _groups(model: Any, masses: Masses, rest: Array, inner_rest: Array) -> list[tuple[Group, Index | None]]:
    """Masses of nodes and rigid members, of elements, section axes and small members; and where moments act."""
    element, space = model.element, model.space
    n, found = element.order + 1, list[tuple[Group, Index | None]]()

    def add(kind: Term, sides: tuple[Index, Index], data: Array, what: str, at: Any = None, elements: Any = ()) -> None:
        names = tuple(f"turning axes on {what} {i + 1}" for i in range(len(data)))
        labels, of = np.zeros((len(data), 0), np.intp), np.asarray(elements, dtype=np.intp)
        found.append((Group(kind, *sides, data, (), names, ("",) * len(data), labels=labels, elements=of), at))

    def joined(*parts: Array) -> Array:
        return np.hstack([part.reshape(len(parts[0]), -1) for part in parts])

    pairs, mass = np.stack([masses.alone.row, masses.alone.column], axis=1), masses.alone.value
    if len(pairs):
        add(CentrifugalPair(space), (np.zeros((len(pairs), 0), np.intp), pairs), joined(rest[pairs], mass), "mass")
    nodal = masses.inner + masses.ends
    heavy = np.flatnonzero(values_of(nodal).any(axis=1))
    if len(heavy):
        arms = np.broadcast_to(element.to_points / element.weights, (len(heavy), n, n))
        own = np.concatenate([inner_rest[heavy], nodal[heavy, :, None], arms], axis=2)
        segments = model.segments
        start = np.array([segments.place(part.start) for part in segments.parts], dtype=np.intp)[segments.owner]
        data = joined(own, model.beams.flat("tangent", "compliance")[heavy])
        sides = model.rotations.turns[heavy], np.hstack([start[heavy][:, None], segments.strains[heavy]])
        add(CentrifugalElement(space, element), sides, data, "element", elements=heavy)
    for group in masses.observables:
        vectors = group.kind.vectors
        mass = group.mass[:, : vectors * element.axes : element.axes]
        offset = np.zeros((len(group.data), vectors, element.axes))
        placed = slice(None), slice(0, group.kind.from_place)
        offset = plus(offset, placed, rest[group.places[:, :1]]) if group.kind.from_place else offset
        data = joined(group.data, np.concatenate([offset, mass[:, :, None]], axis=2))
        elements = () if group.along is None else group.along[0]
        add(CentrifugalVectors(space, group.kind), (group.turns, group.places), data, "body", group.at, elements)
    if not space:
        return found
    heavy, rotary = np.flatnonzero(values_of(masses.spins).any(axis=(1, 2, 3))), masses.rotary
    if len(heavy):
        sides = model.rotations.turns[heavy], np.zeros((len(heavy), 0), np.intp)
        add(CentrifugalSpin(space, n), sides, joined(masses.spins[heavy]), "sections of element", elements=heavy)
    if len(rotary.turns):
        sides = rotary.turns[:, None], np.zeros((len(rotary.turns), 0), np.intp)
        add(CentrifugalSpin(space, 1), sides, joined(rotary.spread), "inertia", rotary.at)
    return found
