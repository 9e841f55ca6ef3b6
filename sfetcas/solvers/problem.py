"""The equilibrium of a model as a nonlinear program that a user can extend.

Unknowns are the components of the quaternions (angles in the plane) of all rotations that are not held, and the
displacements kept as unknowns; rows are the norms of the quaternions, the closings and the joints.  Each element
function is derived once for its type, mapped over the elements and scattered by constant matrices, so the
effort of building does not grow with the number of elements.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics import interpolation, quaternion
from ..mathematics.arrays import Array
from ..mathematics.constants import constant, times
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import SparseMap
from ..mathematics.nlp import NLP
from ..mathematics.quaternion import product
from ..mechanics.connections import Group
from ..mechanics.equations import State
from ..mechanics.joints import by_components
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rotations import Turn
from .program import Program

__all__ = ["EquilibriumProblem"]


def _matrix(rows: Array, columns: Array, values: Array, shape: tuple[int, int]) -> ca.DM:
    """Constant sparse matrix; entries at the same place are added."""
    rows, columns, values = (np.asarray(a).ravel() for a in (rows, columns, values))
    keep = values != 0.0
    rows, columns, values = rows[keep], columns[keep], values[keep]
    place, inverse = np.unique(columns.astype(np.int64) * shape[0] + rows, return_inverse=True)
    summed = np.bincount(inverse, weights=values, minlength=len(place))
    pointers = np.searchsorted(place // shape[0], np.arange(shape[1] + 1)).tolist()
    return ca.DM(ca.Sparsity(shape[0], shape[1], pointers, (place % shape[0]).tolist()), summed)


def _dm(matrix: SparseMap) -> ca.DM:
    return _matrix(matrix.row, matrix.column, matrix.value, matrix.shape)


@dataclass(frozen=True)
class _Reduction:
    """Components of all rotations as held values plus a constant matrix times the unknowns.

    ``index`` and ``weight`` (rotations * components, 2) give the at most two unknowns of each component: in
    space a rotation about a held axis is ``(c, s axis)`` with two unknowns.
    """

    index: Array
    weight: Array
    unknowns: int
    first: Array


def _reduction(model: Model) -> _Reduction:
    components, widths = model.element.components, model.widths
    first = np.cumsum(widths) - widths
    index = np.zeros((len(widths), components, 2), dtype=np.intp)
    weight = np.zeros((len(widths), components, 2))
    free = np.flatnonzero(widths == components)
    for c in range(components):
        index[free, c, 0], weight[free, c, 0] = first[free] + c, 1.0
    for i in np.flatnonzero((model.rotations.kind == Turn.AXIS) & (widths == 2)):
        index[i, 0, 0], weight[i, 0, 0] = first[i], 1.0
        index[i, 1:, 0], weight[i, 1:, 0] = first[i] + 1, model.rotations.axis[i]
    return _Reduction(index.reshape(-1, 2), weight.reshape(-1, 2), int(widths.sum()), first)


def _pairs(index: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Rows, columns and weights of dense symmetric blocks over the unknowns behind components (n, width, 2)."""
    n, width = index.shape[:2]
    # Rotations about a held axis are the only ones with a second unknown a component.
    used = 2 if (weight[..., 1] != 0.0).any() else 1
    index, weight = index[..., :used], weight[..., :used]
    shape = (n, width, width, used, used)
    r = np.broadcast_to(index[:, None, :, :, None], shape)
    c = np.broadcast_to(index[:, :, None, None, :], shape)
    return r, c, weight[:, None, :, :, None] * weight[:, :, None, None, :]


class _Link:
    """The connections of one group in the unknowns of the program.

    Attributes
    ----------
    index, weight : ndarray (n, width, 2)
        Unknowns behind the components of the rotations, then of the displacements, of each connection.
    collect : DM
        Takes derivatives by these components to derivatives by the unknowns.
    """

    def __init__(self, problem: EquilibriumProblem, number: int, group: Group) -> None:
        self.group = group
        model, reduction = problem.model, problem._reduction
        n, (turns, places, self._rows, _, loads) = len(group.names), group.kind.sizes
        components, axes = model.element.components, model.element.axes
        ground = (len(model.rotations.kind), len(model.segments.places))
        turn, place = (np.where(a < 0, last, a) for a, last in zip((group.turns, group.places), ground, strict=True))
        turning, moving = _with_ground(problem, reduction)
        cells = turn[..., None] * components + np.arange(components), place[..., None] * axes + np.arange(axes)
        flat = [cell.reshape(n, -1) for cell in cells]
        self.index = np.concatenate([turning[0][flat[0]], moving[0][flat[1]]], axis=1)
        self.weight = np.concatenate([turning[1][flat[0]], moving[1][flat[1]]], axis=1)
        self.cells = np.concatenate(flat, axis=1)
        q = ca.vertcat(problem._q, ca.DM([1.0, 0.0, 0.0, 0.0] if components == 4 else [0.0]))
        u = ca.vertcat(problem.kept_displacements, ca.DM.zeros(axes))
        self._arguments = [
            ca.reshape(q[flat[0].ravel().tolist()], components, turns * n) if turns else ca.MX(components, 0),
            ca.reshape(u[flat[1].ravel().tolist()], axes, places * n) if places else ca.MX(axes, 0),
            _with_near(ca.MX(ca.DM(group.data.T)), problem._near, model.winding.parts[number]),
            ca.reshape(problem._loads[number], loads, n),
        ]
        self._function = by_components(group.kind).map(n)
        energy, rows, gradient, jacobian, _ = self._call(ca.MX.zeros(self._rows, n), ca.MX.ones(1, n))
        self.energy, self.rows, self.gradient, self.jacobian = ca.sum2(energy), rows, gradient, jacobian
        columns = np.broadcast_to(np.arange(self.cells.size)[:, None], (self.cells.size, 2))
        shape = (problem.x.numel(), self.cells.size)
        self.collect = _matrix(self.index.reshape(-1, 2), columns, self.weight.reshape(-1, 2), shape)

    def _call(self, lam: ca.MX, weight: ca.MX) -> Any:
        return self._function(*self._arguments, lam, weight)

    def hessian(self, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        """Hessian of the Lagrangian's share by the components."""
        n = len(self.group.names)
        hessian: ca.MX = self._call(ca.reshape(lam_g, self._rows, n), ca.repmat(lam_f, 1, n))[4]
        return hessian


def _with_ground(problem: EquilibriumProblem, reduction: _Reduction) -> list[tuple[Array, Array]]:
    """Index and weight of the components of rotations and of displacements, those of the ground last."""
    model = problem.model
    kept = model.positions.kept.ravel()
    index = np.stack([np.where(kept < 0, 0, reduction.unknowns + kept), np.zeros_like(kept)], axis=1)
    weight = np.stack([(kept >= 0).astype(float), np.zeros(len(kept))], axis=1)
    nothing = [np.zeros((size, 2)) for size in (model.element.components, model.element.axes)]
    pairs = ((reduction.index, reduction.weight), (index, weight))
    return [
        (np.vstack([i, none.astype(np.intp)]), np.vstack([w, none]))
        for (i, w), none in zip(pairs, nothing, strict=True)
    ]


def _with_near(data: ca.MX, near: ca.MX, angles: slice | None) -> ca.MX:
    """Data of a group, those of angles that count turns with the values near which they are counted."""
    return data if angles is None else ca.vertcat(data[:-1, :], near[angles].T)


class EquilibriumProblem:
    """The nonlinear program of a model, with the means to write terms by the names of the scene.

    Attributes
    ----------
    nlp : NLP
        The program of a loading; its objective is the potential energy over ``model.scales.moment``.
    kernels : str
        As of :class:`~sfetcas.solvers.prepared.Prepared`; only interpreted ones can be differentiated again by CasADi.
    """

    def __init__(self, model: Model, loading: Loading, guess: State, *, kernels: Kernels = "auto") -> None:
        self.model = model
        self._wound = guess.wound
        self._kernels: Kernels = kernels
        self._reduction = _reduction(model)
        self._symbols()
        self.nlp = NLP(
            x=self.x,
            p=self.p,
            f=self._objective(),
            g=ca.vertcat(self._norms(), self._closings(), self._linked_rows()),
            lower=np.zeros(len(self.row_names)),
            upper=np.zeros(len(self.row_names)),
            x_lower=np.full(self.x.numel(), -np.inf),
            x_upper=np.full(self.x.numel(), np.inf),
            guess=self.unknowns(guess),
            p_value=self.parameters(loading),
            rows=self.row_names,
            gradient=self._gradient(),
            jacobian=self._jacobian(),
            hessian=self._hessian,
        )

    # -- symbols --------------------------------------------------------------------------------

    def _symbols(self) -> None:
        model, element, positions = self.model, self.model.element, self.model.positions
        n, points = model.beams.weight.shape
        turning = self._reduction.unknowns
        self.x = ca.MX.sym("x", turning + positions.Y.shape[1])
        sizes = (
            n * points * element.axes,
            len(model.rotations.kind) * element.components,
            len(positions.rows),
            self.x.numel(),
            positions.B.shape[1],
            model.winding.count,
            *(len(group.names) * group.kind.sizes[4] for group in model.connections),
        )
        self.p = ca.MX.sym("p", sum(sizes))
        pull, held, offset, force, shift, self._near, *self._loads = ca.vertsplit(
            self.p, np.cumsum([0, *sizes]).tolist()
        )
        self._pull = ca.reshape(pull, element.axes, n * points)
        self._offset, self._force, self._b = offset, force, shift
        index, weight = self._reduction.index, self._reduction.weight
        rows = np.broadcast_to(np.arange(len(index))[:, None], index.shape)
        self._spread = _matrix(rows, index, weight, (len(index), self.x.numel()))
        self._q = held + ca.mtimes(self._spread, self.x)
        components = element.components
        of_elements = (model.rotations.turns.ravel()[:, None] * components + np.arange(components)).ravel()
        self._cells = of_elements
        self._q_elements = ca.reshape(self._q[of_elements.tolist()], components, n * points)
        self._stiffness = ca.MX(ca.DM(model.beams.stiffness.reshape(n * points, element.stiffnesses).T))
        self._tangent = ca.MX(ca.DM(model.beams.tangent.reshape(n * points, element.axes).T))
        norms = [f"norm of rotation {i}" for i in self._unit]
        self.row_names = (*norms, *positions.rows, *(row for group in model.connections for row in group.rows))
        self._links = [_Link(self, i, group) for i, group in enumerate(model.connections)]

    @functools.cached_property
    def _unit(self) -> list[int]:
        """Rotations with a norm to hold."""
        return np.flatnonzero(self.model.widths >= 2).tolist() if self.model.space else []

    @functools.cached_property
    def _norm_parts(self) -> tuple[Array, Array]:
        """Row and unknown of each component in the norms."""
        widths, first = self.model.widths, self._reduction.first
        pairs = [(r, first[i] + c) for r, i in enumerate(self._unit) for c in range(widths[i])]
        rows, columns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        return rows, columns

    def _map(self, name: str, calls: float = 12.0) -> ca.Function:
        n, function = len(self.model.rotations.turns), getattr(self.model.element, name)
        return chosen(function, calls * n, self._kernels).map(n)

    @property
    def _data(self) -> tuple[ca.MX, ca.MX, ca.MX]:
        return self._stiffness, self._tangent, self._pull

    # -- functions and first derivatives ---------------------------------------------------------

    def _objective(self) -> ca.MX:
        energy = ca.MX(0)
        if len(self.model.rotations.turns):
            energy = ca.sum2(self._map("energy")(self._q_elements, *self._data))
        for link in self._links:
            energy += link.energy
        return energy - ca.dot(self._force, self.x)

    @functools.cached_property
    def _collect(self) -> ca.DM:
        """Takes derivatives by the components at the nodes of the elements to derivatives by the unknowns."""
        index, weight = self._reduction.index[self._cells], self._reduction.weight[self._cells]
        columns = np.broadcast_to(np.arange(len(index))[:, None], index.shape)
        return _matrix(index, columns, weight, (self.x.numel(), len(index)))

    def _gradient(self) -> ca.MX:
        total = -self._force
        if len(self.model.rotations.turns):
            gradient = self._map("gradient")(self._q_elements, *self._data)[1]
            total += ca.mtimes(self._collect, ca.vec(gradient))
        for link in self._links:
            total += ca.mtimes(link.collect, ca.vec(link.gradient))
        return ca.densify(total)

    @functools.cached_property
    def _to_rows(self) -> ca.DM:
        """Takes the reaches of the elements to the closing rows."""
        return self._by_elements(self.model.positions.Z)

    def _by_elements(self, z: SparseMap) -> ca.DM:
        """A map of the reaches of segments as one of the reaches of their elements."""
        axes, parts = self.model.element.axes, self.model.segments.parts
        start = np.array([part.elements.start for part in parts], dtype=np.intp)[z.column // axes]
        count = np.array([part.elements.stop for part in parts], dtype=np.intp)[z.column // axes] - start
        element = np.concatenate([np.zeros(0, np.intp), *(a + np.arange(n) for a, n in zip(start, count, strict=True))])
        column = element * axes + np.repeat(z.column % axes, count)
        shape = (z.shape[0], len(self.model.segments.owner) * axes)
        return _matrix(np.repeat(z.row, count), column, np.repeat(z.value, count), shape)

    def _closings(self) -> ca.MX:
        if not self.model.positions.rows:
            return ca.MX(0, 1)
        return self._by_reaches(self.model.positions.Z) + self._by_kept(self.model.positions.W) + self._offset

    def _by_reaches(self, z: SparseMap) -> ca.MX:
        """A map of the reaches of segments times these."""
        if not len(self.model.rotations.turns):
            return ca.MX.zeros(z.shape[0])
        reach = self._map("reach")(self._q_elements, self._tangent)
        return ca.mtimes(self._by_elements(z), ca.vec(reach))

    def _by_kept(self, w: SparseMap) -> ca.MX:
        """A map of the displacements kept as unknowns times these; without any of them x has no such slice."""
        if not w.shape[1]:
            return ca.MX.zeros(w.shape[0])
        return ca.mtimes(_dm(w), self.x[self._reduction.unknowns :])

    def _norms(self) -> ca.MX:
        rows, columns = self._norm_parts
        adder = _matrix(rows, columns, np.ones(len(rows)), (len(self._unit), self.x.numel()))
        return ca.mtimes(adder, self.x**2) - 1.0 if self._unit else ca.MX(0, 1)

    def _linked_rows(self) -> ca.MX:
        return ca.vertcat(ca.MX(0, 1), *(ca.vec(link.rows) for link in self._links if link.group.rows))

    def _scattered(self, parts: list[tuple[Array, Array, Array, ca.MX]], shape: tuple[int, int]) -> ca.MX:
        """Sparse matrix from (row, column, weight, values) with several entries (…, k) for each value."""
        places = np.concatenate([(c.astype(np.int64) * shape[0] + r).ravel() for r, c, _, _ in parts])
        weights = np.concatenate([w.ravel() for _, _, w, _ in parts])
        sources, offset = [], 0
        for r, _, _, values in parts:
            count = values.numel()
            sources.append(offset + np.repeat(np.arange(count), r.size // max(count, 1)))
            offset += count
        source = np.concatenate(sources)
        keep = weights != 0.0
        unique, inverse = np.unique(places[keep], return_inverse=True)
        adder = _matrix(inverse, source[keep], weights[keep], (len(unique), offset))
        pointers = np.searchsorted(unique // shape[0], np.arange(shape[1] + 1)).tolist()
        sparsity = ca.Sparsity(shape[0], shape[1], pointers, (unique % shape[0]).tolist())
        return ca.MX(sparsity, ca.mtimes(adder, ca.vertcat(*[ca.vec(v) for _, _, _, v in parts])))

    def _jacobian(self) -> ca.MX:
        positions = self.model.positions
        blocks, width = [], self.x.numel()
        if self._unit:
            rows, columns = self._norm_parts
            norm = [(rows, columns, np.full(len(rows), 2.0), self.x[columns.tolist()])]
            blocks.append(self._scattered(norm, (len(self._unit), width)))
        if positions.rows:
            blocks.append(self._closing_jacobian())
        for link in self._links:
            (n, components), count = link.cells.shape, link.group.kind.sizes[2]
            if count:
                labels = np.arange(n * count).reshape(n, 1, count, 1)
                shape = (n, components, count, 2)
                r = np.broadcast_to(labels, shape)
                c, w = (np.broadcast_to(a[:, :, None, :], shape) for a in (link.index, link.weight))
                blocks.append(self._scattered([(r, c, w, link.jacobian)], (n * count, width)))
        return ca.vertcat(*blocks) if blocks else ca.MX(0, width)

    def _closing_jacobian(self) -> ca.MX:
        model, positions = self.model, self.model.positions
        turning = self._reduction.unknowns
        parts: list[tuple[Array, Array, Array, ca.MX]] = []
        if len(model.rotations.turns):
            parts.append(self._reach_jacobian())
        w_map = positions.W
        if len(w_map.row):
            parts.append((w_map.row, turning + w_map.column, w_map.value, ca.MX.ones(len(w_map.row))))
        return self._scattered(parts, (len(positions.rows), self.x.numel()))

    def _reach_jacobian(self) -> tuple[Array, Array, Array, ca.MX]:
        """Rows, unknowns, weights and values of the closings' derivative through the reaches."""
        model, positions, axes = self.model, self.model.positions, self.model.element.axes
        jacobian = self._map("reach_jacobian")(self._q_elements, self._tangent)[1]
        n, width = model.rotations.turns.shape[0], model.rotations.turns.shape[1] * model.element.components
        cells = self._cells.reshape(n, width)
        index, weight = self._reduction.index[cells], self._reduction.weight[cells]
        # Each reach component goes to at most `most` rows: padded lists of rows and weights.
        by_column = positions.Z.T
        counts = np.bincount(by_column.row, minlength=by_column.shape[0])
        most = max(1, int(counts.max(initial=0)))
        rank = np.arange(len(by_column.row)) - np.repeat(np.cumsum(counts) - counts, counts)
        order, value = (np.zeros((by_column.shape[0], most), kind) for kind in (np.intp, float))
        order[by_column.row, rank], value[by_column.row, rank] = by_column.column, by_column.value
        owner = model.segments.owner
        rows, values = order.reshape(-1, axes, most)[owner], value.reshape(-1, axes, most)[owner]
        shape = (n, width, axes, most, 2)
        r = np.broadcast_to(rows[:, None, :, :, None], shape)
        c = np.broadcast_to(index[:, :, None, None, :], shape)
        w = values[:, None, :, :, None] * weight[:, :, None, None, :]
        return r, c, w, jacobian

    def _hessian(self, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        model, element = self.model, self.model.element
        n, points = model.beams.weight.shape
        norms, closings = len(self._unit), len(model.positions.rows)
        pull = lam_f * self._pull
        if closings and n:
            constant = ca.mtimes(self._to_rows.T, lam_g[norms : norms + closings])
            spread = np.repeat(np.arange(n), points)
            pull += ca.reshape(constant, element.axes, n)[:, spread.tolist()]
        parts: list[tuple[Array, Array, Array, ca.MX]] = []
        if n:
            hessian = self._map("hessian")(self._q_elements, lam_f * self._stiffness, self._tangent, pull)
            cells = self._cells.reshape(n, -1)
            parts.append((*_pairs(self._reduction.index[cells], self._reduction.weight[cells]), hessian))
        if norms:
            rows, columns = self._norm_parts
            parts.append((columns, columns, np.full(len(rows), 2.0), lam_g[rows.tolist()]))
        first = norms + closings
        for link in self._links:
            own = link.hessian(lam_f, lam_g[first : first + len(link.group.rows)])
            parts.append((*_pairs(link.index, link.weight), own))
            first += len(link.group.rows)
        return self._scattered(parts, (self.x.numel(), self.x.numel()))

    @functools.cached_property
    def kept_displacements(self) -> ca.MX:
        """Displacements of all places whose components are unknowns or prescribed, (places * axes,); others wrong."""
        positions = self.model.positions
        return self._by_kept(positions.Y) + ca.mtimes(_dm(positions.B), self._b)

    # -- expressions by place ---------------------------------------------------------------------

    def displacement(self, node: int) -> ca.MX:
        """Displacement of a node, dimensionless."""
        positions, axes = self.model.positions, self.model.element.axes
        rows = np.arange(node * axes, (node + 1) * axes)
        e = positions.E.rows(rows)
        constant = ca.DM(-(e @ self._rest)) + ca.mtimes(_dm(positions.B.rows(rows)), self._b)
        return ca.densify(self._by_reaches(e) + self._by_kept(positions.Y.rows(rows)) + constant)

    @functools.cached_property
    def _rest(self) -> Array:
        """Reaches of the segments in the undeformed scene, (segments * axes,)."""
        model = self.model
        rest = np.zeros((len(model.segments.parts), model.element.axes))
        np.add.at(rest, model.segments.owner, model.beams.tangent.sum(axis=1))
        return rest.ravel()

    def rotation(self, number: int) -> ca.MX:
        """Components of a rotation."""
        components = self.model.element.components
        return self._q[number * components : (number + 1) * components]

    def strain(self, member: str, at: float) -> ca.MX:
        """Curvature minus that of the unloaded member, dimensionless, about the section's axes."""
        model, element = self.model, self.model.element
        cuts = model.mesh.cuts[member]
        e = int(np.clip(np.searchsorted(cuts, at, side="right") - 1, 0, len(cuts) - 2))
        length = model.beams.weight[model.elements_of(member)][e].sum()
        xi = np.array([(at - cuts[e]) / (cuts[e + 1] - cuts[e])])
        points = len(element.nodes)
        number = model.elements_of(member).start + e
        q = self._q_elements[:, number * points : (number + 1) * points]
        here = ca.mtimes(q, ca.DM(interpolation.evaluation(element.nodes, xi).T))
        slope = ca.mtimes(q, ca.DM(interpolation.differentiation(element.nodes, xi).T)) / length
        if not model.space:
            return slope
        parts = ca.vertsplit(here)
        spin = product([parts[0], -parts[1], -parts[2], -parts[3]], ca.vertsplit(slope))[1:]
        frame = quaternion.matrix(model.scene.center_lines[member].quaternions(np.array([at])))[0]
        return ca.mtimes(ca.DM(frame.T), 2.0 * ca.vertcat(*spin)) / ca.dot(here, here)

    # -- numbers --------------------------------------------------------------------------------

    def parameters(self, loading: Loading, near: State | None = None) -> Array:
        """Values of the parameters for a loading; angles that count turns are counted near those of a state."""
        model, positions = self.model, self.model.positions
        held = np.where((model.rotations.kind == Turn.HELD)[:, None], model.held(loading), 0.0)
        offset = positions.BZ @ loading.shift - positions.Z @ self._rest
        constant = -(positions.E.T @ loading.force.ravel()).reshape(-1, model.element.axes)
        pull = loading.pull + constant[model.segments.owner][:, None, :]
        force = np.zeros(self.x.numel())
        if not model.space:
            free = np.flatnonzero(model.widths)
            force[self._reduction.first[free]] = loading.moment[free, 2]
        force[self._reduction.unknowns :] = positions.Y.T @ loading.force.ravel()
        loads = [load.ravel() for load in loading.loads]
        wound = self._wound if near is None else near.wound
        return np.concatenate([pull.ravel(), held.ravel(), offset, force, loading.shift, wound, *loads])

    def parameters_by(self, program: Program, near: Array) -> ca.MX:
        """The same as an expression of what is given; data are those of the model."""
        model, positions, given = self.model, self.model.positions, program.given
        still = ca.MX(model.element.components, len(model.rotations.kind))
        held = program.expressions.held(ca.densify(still), given)
        moments = [ca.MX(0)] * self.x.numel()
        if not model.space:
            for i in np.flatnonzero(model.widths).tolist():
                moments[self._reduction.first[i]] = given.moment[i]
        force = ca.vertcat(ca.MX(0, 1), *moments)
        kept = times(constant(positions.Y).T, given.force)
        force += ca.vertcat(ca.MX.zeros(self._reduction.unknowns), kept)
        offset = times(constant(positions.BZ), given.shift) - ca.DM(positions.Z @ self._rest)
        whole = [ca.vec(self._only_held(held)), offset, force, given.shift, ca.MX(ca.DM(near))]
        return ca.vertcat(given.pull, *whole, *given.loads)

    def _only_held(self, q: ca.MX) -> ca.MX:
        """Rotations that are held; all others zero."""
        model = self.model
        flags = np.repeat((model.rotations.kind == Turn.HELD)[None, :], model.element.components, axis=0)
        rest = np.zeros(flags.shape)
        if model.space:
            # What no motion turns stands as it stood.
            rest[0] = (model.rotations.kind == Turn.HELD) & ~self._driven
        return q * ca.DM(flags.astype(float)) + ca.DM(rest)

    @property
    def _driven(self) -> Array:
        """Which rotations motions prescribe."""
        return np.any([group.turn.any(axis=1) for group in self.model.groups.values()], axis=0)

    def unknowns(self, state: State) -> Array:
        """The unknowns of the program at a state."""
        q = state.q.ravel()
        x = np.zeros(self.x.numel())
        index, weight = self._reduction.index, self._reduction.weight
        np.add.at(x, index.ravel(), (weight * q[:, None]).ravel())
        x[self._reduction.unknowns :] = state.y
        return x

    def state(self, x: Array, lam: Array, loading: Loading, near: State | None = None) -> State:
        """The state of a solution; quaternions are made exactly unit, turns counted near those of another state."""
        model = self.model
        held = np.where((model.rotations.kind == Turn.HELD)[:, None], model.held(loading), 0.0).ravel()
        weight, index = self._reduction.weight, self._reduction.index
        q = (held + (weight * x[index]).sum(axis=1)).reshape(len(model.rotations.kind), -1)
        if model.space:
            # A quaternion that is zero has no direction: what is not finite is no solution.
            with np.errstate(divide="ignore", invalid="ignore"):
                q = q / np.linalg.norm(q, axis=-1, keepdims=True)
        rows = self.rows_of_equations
        wound = model.winding.angles(q, self._wound if near is None else near.wound)
        return State(q, x[self._reduction.unknowns :].copy(), lam[rows], wound)

    @property
    def rows_of_equations(self) -> slice:
        """The rows that are also rows of the stationarity equations: closings and joints."""
        return slice(len(self._unit), len(self.row_names))

    def multipliers(self, state: State) -> Array:
        """Multipliers of all rows at a state, those of the norms zero."""
        return np.concatenate([np.zeros(len(self._unit)), state.lam])
