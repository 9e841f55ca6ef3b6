"""Rotating axes: the potential of the centrifugal forces on all that has mass, and these forces.

In axes that rotate with ``Omega`` about the origin rest is an equilibrium of the loads and of the centrifugal forces,

    V = -1/2 sum m |Omega x r|^2 = -1/2 sum m r.P r,      P = Omega.Omega 1 - Omega Omega^T,

over everything that carries mass: places and inner nodes of elements, section axes, points of small members.  Their
potentials are connections like those of springs, so that statics, paths and stability know of them; they do not
grow with the load factor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from ..mathematics.kernels import Batch
from .elements import Element
from .load_terms import carried
from .loading import Loading
from .masses import Masses, Observables, masses_of
from .terms import Group, Side, Term, rows_of

__all__ = ["CentrifugalInner", "CentrifugalPair", "CentrifugalVectors", "RotatingFrame", "with_rotating_frame"]


def _matrix(load: ca.SX, axes: int) -> ca.SX:
    """The matrix P, which is the load: it grows with the loads where these are followed from zero."""
    return ca.reshape(load, axes, axes)


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
        """Minus half the mass times a product of the two positions."""
        n = self.axes
        a, b = (data[n * i : n * i + n] + ca.vertcat(*u[i]) for i in range(2))
        return -0.5 * data[2 * n] * ca.dot(a, ca.mtimes(_matrix(load, n), b))


@final
@dataclass(frozen=True)
class CentrifugalInner(Term):
    """Centrifugal potential of the inner nodes of an element, whose positions follow from the place at its start.

    Data: for each node its undeformed position, mass and integration weights, then tangents and compliances of all
    nodes; load: P.

    Attributes
    ----------
    element : Element
    """

    is_load: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """All rotations of the element, its start, and its strains."""
        axes, (n, strains, *_) = self.axes, self.element.sizes
        return n, 1 + strains, 0, (n - 2) * (axes + 1 + n) + self.element.line_data, axes**2

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The sum over the inner nodes."""
        n, axes = self.element.order + 1, self.axes
        width = axes + 1 + n
        line = data[(n - 2) * width :]
        changes = ca.horzcat(*self.element.tangents(q, u[1:], line)) - self.element.line(line)[0]
        total, p = ca.SX(0), _matrix(load, axes)
        for k in range(n - 2):
            own = data[k * width : (k + 1) * width]
            r = own[:axes] + ca.vertcat(*u[0]) + ca.mtimes(changes, own[axes + 1 :])
            total -= 0.5 * own[axes] * ca.dot(r, ca.mtimes(p, r))
        return total


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
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Those of the quantity, without rows."""
        turns, places, _, data, _ = self.kind.sizes
        return turns, places, 0, data + self.kind.vectors * (self.axes + 1), self.axes**2

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The sum over the vectors."""
        axes, first = self.axes, self.kind.sizes[3]
        rows = ca.vertcat(*self.kind.residual(q, u, data[:first], ca.SX(0, 1)))
        total, p = ca.SX(0), _matrix(load, axes)
        for k in range(self.kind.vectors):
            own = data[first + k * (axes + 1) : first + (k + 1) * (axes + 1)]
            r = own[:axes] + rows[k * axes : (k + 1) * axes]
            total -= 0.5 * own[axes] * ca.dot(r, ca.mtimes(p, r))
        return total


@dataclass(frozen=True, eq=False)
class RotatingFrame:
    """The rotation of the axes of a model, and its centrifugal terms; dimensionless.

    Attributes
    ----------
    masses : Masses
    omega : ndarray (3,)
        Angular velocity times the unit of time of the masses.
    pairs : int
        Index of the group of connections with the masses at places.
    bodies : range
        Indices of the groups with section axes and small members.
    rest, inner_rest : ndarray (places, axes), (elements, p + 1, axes)
        Positions of the places and of the nodes of elements in the undeformed scene.
    loading : Loading
        P on everything that has mass; no factor multiplies it.
    """

    masses: Masses
    omega: Array
    pairs: int
    bodies: range
    rest: Array
    inner_rest: Array
    loading: Loading

    def positional(self, model: Any, u: Array, turned: Array, matrix: Array) -> Loading:
        """Centrifugal forces on places and inner nodes as loads, for displacements u (places, axes) and rotated
        tangents.

        ``matrix`` is P (axes, axes).
        """
        element, segments = model.element, model.segments
        arms = element.to_points / element.weights
        start = np.array([segments.place(part.start) for part in segments.parts], dtype=np.intp)[segments.owner]
        inner = self.inner_rest + u[start][:, None] + np.einsum("kj,eja->eka", arms, turned - model.beams.tangent)
        spread = self.masses.inner[:, :, None] * (inner @ matrix)
        own = np.stack([self.masses.places @ column for column in ((self.rest + u) @ matrix).T], axis=1)
        pull, on_places = carried(spread, segments, element)
        return replace(model.groups[None].scaled(0.0), force=own + on_places, own=own, spread=spread, pull=pull)

    def at_points(self, model: Any, observed: Observables, q: Array, places: Array, matrix: Array) -> Array:
        """Centrifugal forces (n, nodes, axes) on points along elements, for displacements ``places`` (places * axes,).

        ``matrix`` is P (axes, axes).
        """
        axes, batch = model.element.axes, Batch(rows_of(observed.kind), len(observed.data))
        u = places.reshape(len(model.segments.places), axes)
        given = (q[observed.turns], u[observed.places], observed.data, np.zeros((len(observed.data), 0)))
        for k, values in enumerate(given):
            batch.set(k, values)
        rows = batch()[0].reshape(len(observed.data), -1, axes) + self.rest[observed.places[:, :1]]
        return np.asarray(observed.mass.reshape(rows.shape) * (rows @ matrix))


def with_rotating_frame(model: Any) -> Any:
    """A :class:`~sfetcas.mechanics.model.Model` with the centrifugal terms of its rotating axes added.

    Raises
    ------
    SceneError
        Nothing has mass.
    """
    masses = masses_of(model)
    axes = model.element.axes
    omega = np.asarray(model.scene.rotating, dtype=float) * masses.time
    matrix = ((omega @ omega) * np.eye(3) - np.outer(omega, omega))[:axes, :axes]
    rest = _at_rest(model)
    before, (on_places, on_bodies) = len(model.connections), _groups(model, masses, *rest)
    groups = (*on_places, *on_bodies)
    bodies = range(before + len(on_places), before + len(groups))
    nothing = tuple(np.zeros((len(group.names), axes**2)) for group in groups)
    kinds = tuple(group.kind for group in groups)
    loadings = {
        name: replace(load, loads=(*load.loads, *nothing), kinds=(*load.kinds, *kinds))
        for name, load in model.groups.items()
    }
    empty = loadings[None].scaled(0.0)
    here = tuple(np.tile(matrix.ravel(), (len(group.names), 1)) for group in groups)
    loading = replace(empty, loads=(*empty.loads[:before], *here))
    rotating_frame = RotatingFrame(masses, omega, before, bodies, *rest, loading)
    return replace(model, connections=(*model.connections, *groups), groups=loadings, rotating_frame=rotating_frame)


def _at_rest(model: Any) -> tuple[Array, Array]:
    scene, element, segments = model.scene, model.element, model.segments
    axes = element.axes
    rest = np.zeros((len(segments.places), axes))
    inner = np.zeros((*model.beams.weight.shape, axes))
    for name, node in scene.nodes.items():
        rest[segments.place(name)] = np.asarray(node.position)[:axes]
    for (name, i), place in segments.ends.items():
        rest[segments.place(place)] = np.asarray(scene.nodes[scene.members[name].nodes[i]].position)[:axes]
    for name in model.members:
        cuts, line, part = model.mesh.cuts[name], scene.center_lines[name], model.elements_of(name)
        x = cuts[:-1, None] + np.diff(cuts)[:, None] * element.nodes
        inner[part] = line.positions(x.ravel())[:, :axes].reshape(*x.shape, axes)
    for part in segments.parts:
        rest[segments.place(part.start)] = inner[part.elements.start, 0]
        rest[segments.place(part.end)] = inner[part.elements.stop - 1, -1]
    return rest / model.scales.length, inner / model.scales.length


def _group(kind: Term, turns: Index, places: Index, data: Array, what: str) -> Group:
    names = tuple(f"turning axes on {what} {i + 1}" for i in range(len(data)))
    labels = np.zeros((len(data), 0), np.intp)
    return Group(kind, turns, places, data, (), names, ("",) * len(data), labels=labels)


def _groups(model: Any, masses: Masses, rest: Array, inner_rest: Array) -> tuple[list[Group], list[Group]]:
    """Masses at places and, behind them, within elements; section axes and small members."""
    element, space = model.element, model.space
    n = element.order + 1

    def joined(*parts: Array) -> Array:
        return np.hstack([part.reshape(len(parts[0]), -1) for part in parts])

    pairs, mass = np.stack([masses.places.row, masses.places.column], axis=1), masses.places.value
    if not len(pairs):
        # No place has mass of its own where all of it is along members; the group tells P nevertheless.
        pairs, mass = np.zeros((1, 2), np.intp), np.zeros(1)
    data = joined(rest[pairs], mass)
    found = [_group(CentrifugalPair(space), np.zeros((len(pairs), 0), np.intp), pairs, data, "mass")]
    heavy = np.flatnonzero(masses.inner.any(axis=1))
    if len(heavy):
        arms = np.broadcast_to(element.to_points / element.weights, (len(heavy), n, n))
        own = np.concatenate([inner_rest[heavy], masses.inner[heavy, :, None], arms], axis=2)[:, 1:-1]
        segments = model.segments
        start = np.array([segments.place(part.start) for part in segments.parts], dtype=np.intp)[segments.owner]
        data = joined(own, model.beams.flat("tangent", "compliance")[heavy])
        turns, places = model.rotations.turns[heavy], np.hstack([start[heavy][:, None], segments.strains[heavy]])
        found.append(_group(CentrifugalInner(space, element), turns, places, data, "element"))
    bodies = []
    for group in masses.observables:
        vectors = group.kind.vectors
        if not vectors:
            continue
        mass = group.mass[:, : vectors * element.axes : element.axes]
        added = np.zeros((len(group.data), vectors, element.axes))
        added[:, : group.kind.from_place] = rest[group.places[:, :1]]
        data = joined(group.data, np.concatenate([added, mass[:, :, None]], axis=2))
        bodies.append(_group(CentrifugalVectors(space, group.kind), group.turns, group.places, data, "body"))
    return found, bodies
