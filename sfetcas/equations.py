"""The stationarity equations of a model in rotations about the fixed axes, and their Newton matrix.

Unknown changes are a rotation vector for each free rotation (an angle in the plane, one number about the axis
of a held hinge), the displacements kept as unknowns, and the multipliers of the closings.  Rotations are
updated by ``q <- exp(phi/2) q``, so that norms hold by construction and need neither rows nor multipliers.

This is the second, independent form of the problem that IPOPT solves with quaternion components and norms as
constraints; polish, certificate and continuation stand on it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from . import interpolation, quaternion
from .arrays import Array, Index
from .joints import hinge
from .kernels import Batch, Kernels, chosen
from .linear import SparseSolver
from .loading import Loading
from .model import Model
from .rotations import Turn

__all__ = ["Equations", "Point", "State"]


@dataclass(frozen=True)
class State:
    """A trial state, dimensionless.

    Attributes
    ----------
    q : ndarray (rotations, 4 or 1)
        Unit quaternions or angles since the undeformed scene.
    y : ndarray
        Displacements kept as unknowns.
    lam : ndarray
        Multipliers of the closing rows, then of the hinge rows.
    """

    q: Array
    y: Array
    lam: Array


@dataclass(frozen=True)
class Point:
    """The equations at a state.

    Attributes
    ----------
    potential, strain : float
        Potential energy (zero for the undeformed, unloaded scene) and its elastic part.
    residual : ndarray (unknowns + rows,)
        Out-of-balance moments and forces, then closing gaps.
    scale : ndarray (unknowns + rows,)
        What rounding of each residual is judged by: the moments and forces added up at the node, no less than a
        hundredth of its stiffness; 1 for gaps.
    entries : ndarray
        Entries of the Newton matrix, in the order of :attr:`Equations.row` and :attr:`Equations.column`.
    """

    potential: float
    strain: float
    residual: Array
    scale: Array
    entries: Array
    spin: Array


class Equations:
    """The stationarity equations of one model, prepared for repeated evaluation."""

    def __init__(self, model: Model, *, kernels: Kernels = "auto", evaluations: float = 12.0) -> None:
        self.model = model
        element, positions = model.element, model.positions
        self._number_unknowns()
        n = len(model.rotations.turns)
        calls = evaluations * n
        self._kernel = Batch(chosen(element.turning, calls, kernels), n)
        self._kernel.set(1, model.beams.stiffness)
        self._kernel.set(2, model.beams.tangent)
        self._first = np.array([model.beams.first[name] for name in model.members])
        self._rest = np.add.reduceat(model.beams.tangent.sum(axis=1), self._first, axis=0)
        self._z = positions.Z.reshape(len(positions.rows), len(model.members), element.axes)
        self._pattern()
        if len(model.rotations.hinges):
            self._hinge = Batch(hinge(), len(model.rotations.hinges))
            self._hinge.set(1, model.rotations.hinge_axes)
        # A hundredth of the stiffness against turning a node: 1e-14 of it is what rounding of rotations leaves.
        self._noise = np.abs(self.elastic_entries()[self.diagonal]) * 0.01
        self._noise[self.unknowns :] = 1.0

    # -- numbering ------------------------------------------------------------------------------

    def _number_unknowns(self) -> None:
        model, turns = self.model, self.model.element.turns
        count = np.where(model.rotations.kind == Turn.FREE, turns, np.where(model.rotations.kind == Turn.AXIS, 1, 0))
        ends = np.cumsum(count)
        self.number = np.full((len(count), turns), -1, dtype=np.intp)
        for i in range(turns):
            here = count > i
            self.number[here, i] = (ends - count)[here] + i
        self.turning_unknowns = int(ends[-1]) if len(ends) else 0
        self.displacement_unknowns = model.positions.Y.shape[1]
        self.rows = len(model.positions.rows) + 2 * len(model.rotations.hinges)
        self.unknowns = self.turning_unknowns + self.displacement_unknowns
        about = np.flatnonzero(model.rotations.kind == Turn.AXIS) if model.space else np.array([], dtype=np.intp)
        self._basis = {int(i): _basis(model.rotations.axis[i]) for i in about}
        self._on_axes = np.argwhere(np.isin(model.rotations.turns, about)).tolist()
        self._free = np.flatnonzero(self.number[:, 0] >= 0)

    @functools.cached_property
    def mass(self) -> Array:
        """Length that belongs to each turning unknown, for norms that do not depend on the mesh."""
        model = self.model
        lump = np.zeros(len(model.rotations.kind))
        w = model.beams.weight
        if model.element.gauss:
            w = w.sum(axis=1, keepdims=True) * interpolation.lobatto(model.element.order + 1)[1]
        np.add.at(lump, model.rotations.turns.ravel(), w.ravel())
        mass = np.zeros(self.turning_unknowns)
        used = self.number >= 0
        mass[self.number[used]] = np.broadcast_to(lump[:, None], self.number.shape)[used]
        return mass

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the closing and hinge rows."""
        count = len(self.model.rotations.hinges)
        hinges = (f"hinge {i}, {side} direction" for i in range(count) for side in ("first", "second"))
        return (*self.model.positions.rows, *hinges)

    # -- pattern of the Newton matrix -----------------------------------------------------------

    def _pattern(self) -> None:
        """Row and column of every contribution, and where it goes among the entries of the matrix."""
        model = self.model
        local = self.number[model.rotations.turns].reshape(len(model.rotations.turns), -1)
        self._local = local
        rows, columns = [], []

        def add(r: Array, c: Array) -> None:
            rows.append(np.asarray(r).ravel())
            columns.append(np.asarray(c).ravel())

        shape = (*local.shape, local.shape[1])
        add(np.broadcast_to(local[:, None, :], shape), np.broadcast_to(local[:, :, None], shape))
        first_row = self.unknowns
        self._touch: list[tuple[slice, Array]] = []
        for m, name in enumerate(model.members):
            touched = np.flatnonzero(np.abs(self._z[:, m]).sum(axis=1))
            if len(touched):
                elements = model.elements_of(name)
                self._touch.append((elements, self._z[touched, m]))
                cells = local[elements]
                size = (len(cells), len(touched), cells.shape[1])
                r = np.broadcast_to((first_row + touched)[None, :, None], size)
                c = np.broadcast_to(cells[:, None, :], size)
                r = np.where(c < 0, -1, r)
                add(r, c)
                add(c, r)
        r, c = np.nonzero(model.positions.W)
        add(first_row + r, self.turning_unknowns + c)
        add(self.turning_unknowns + c, first_row + r)
        self._w_entries = model.positions.W[r, c]
        if len(model.rotations.hinges):
            cells = self.number[model.rotations.hinges].reshape(len(model.rotations.hinges), -1)
            size = (len(cells), 6, 6)
            add(np.broadcast_to(cells[:, None, :], size), np.broadcast_to(cells[:, :, None], size))
            labels = first_row + len(model.positions.rows) + np.arange(2 * len(cells)).reshape(-1, 2)
            size = (len(cells), 6, 2)
            r, c = np.broadcast_to(labels[:, None, :], size), np.broadcast_to(cells[:, :, None], size)
            r = np.where(c < 0, -1, r)
            add(r, c)
            add(c, r)
        # The diagonal is always there: regularisation and shifts are put on it.
        total = self.unknowns + self.rows
        add(np.arange(total), np.arange(total))
        row, column = np.concatenate(rows), np.concatenate(columns)
        valid = (row >= 0) & (column >= 0)
        places, inverse = np.unique(column[valid] * total + row[valid], return_inverse=True)
        self._valid, self._to_entry = np.flatnonzero(valid), inverse
        self._size = len(valid)
        self._zeros = np.zeros(total)
        self._used = np.flatnonzero(local.ravel() >= 0)
        self._used_numbers = local.ravel()[self._used]
        self.row, self.column = places % total, places // total
        self.diagonal = np.flatnonzero(self.row == self.column)
        self.total = total

    # -- evaluation -----------------------------------------------------------------------------

    def start(self, loading: Loading) -> State:
        """The undeformed scene with held rotations at their prescribed values."""
        return State(self.model.held(loading), np.zeros(self.displacement_unknowns), np.zeros(self.rows))

    def holding(self, state: State, loading: Loading) -> State:
        """The state with held rotations moved to their prescribed values."""
        q = np.where((self.model.rotations.kind == Turn.HELD)[:, None], self.model.held(loading), state.q)
        return replace(state, q=q)

    def member_pulls(self, lam: Array, loading: Loading) -> Array:
        """Minus the constant part of the internal force of each member, (members, axes)."""
        positions = self.model.positions
        force = positions.Z.T @ lam[: len(positions.rows)] - positions.E.T @ loading.force.ravel()
        return np.asarray(force.reshape(self._rest.shape))

    def displacements(self, state: State, loading: Loading, reach: Array) -> tuple[Array, Array]:
        """Displacements of the nodes (nodes * axes,) and closing gaps, from the reaches of the elements."""
        positions = self.model.positions
        delta = (np.add.reduceat(reach, self._first, axis=0) - self._rest).ravel()
        nodal = positions.E @ delta + positions.Y @ state.y + positions.B @ loading.shift
        gap = positions.Z @ delta + positions.W @ state.y + positions.BZ @ loading.shift
        return nodal, gap

    def at(self, state: State, loading: Loading, *, convex: bool = False) -> Point:
        """The equations at a state; with ``convex`` the element matrices made positive."""
        model, positions = self.model, self.model.positions
        constant = self.member_pulls(state.lam, loading)[model.beams.owner]
        self._kernel.set(0, state.q[model.rotations.turns])
        pull = loading.pull + constant[:, None, :]
        self._kernel.set(3, pull)
        strain, work, moments, stiffness, reach, spin = self._kernel()
        moments, stiffness, spin = self._local_parts(moments, stiffness, spin)
        if convex:
            stiffness = _positive_part(stiffness)
        nodal, gap = self.displacements(state, loading, reach)

        potential = float(strain.sum() + work.sum() - (constant * reach).sum())
        potential -= float((loading.pull * model.beams.tangent).sum())
        potential -= float(loading.force.ravel() @ nodal)
        residual = np.bincount(self._used_numbers, weights=moments.ravel()[self._used], minlength=self.total)
        # What a node adds up: moments of its elements, and within them the forces times the length they act on.
        carried = (np.abs(pull).sum(axis=2) * model.beams.weight).sum(axis=1)
        sums = np.abs(moments) + np.repeat(carried, len(model.element.nodes) * model.element.turns).reshape(
            moments.shape
        )
        scale = np.bincount(self._used_numbers, weights=sums.ravel()[self._used], minlength=self.total) + self._noise
        if not model.space:
            potential -= float(loading.couple @ state.q[:, 0])
            couple = loading.couple[self._free]
            residual[: self.turning_unknowns] -= couple
            scale[: self.turning_unknowns] += np.abs(couple)
        lam, force = state.lam[: len(positions.rows)], loading.force.ravel()
        if self.displacement_unknowns:
            displacement = slice(self.turning_unknowns, self.unknowns)
            residual[displacement] = positions.W.T @ lam - positions.Y.T @ force
            scale[displacement] = np.abs(positions.W.T) @ np.abs(lam) + np.abs(positions.Y.T) @ np.abs(force) + 1e-12
        residual[self.unknowns : self.unknowns + len(gap)] = gap

        parts = [stiffness.ravel(), *self._closing_parts(spin), self._w_entries, self._w_entries]
        if len(model.rotations.hinges):
            parts += self._hinge_parts(state, residual)
        values = np.concatenate([*parts, self._zeros])[self._valid]
        entries = np.bincount(self._to_entry, weights=values, minlength=len(self.row))
        return Point(potential, float(strain.sum()), residual, scale, entries, np.array(spin))

    def slope(self, point: Point, rate: Loading) -> Array:
        """Derivative of the residual along a change of nodal loads and displacements at a point."""
        positions = self.model.positions
        slope = np.zeros(self.total)
        constant = self.member_pulls(np.zeros(self.rows), rate)[self.model.beams.owner]
        moments = np.einsum("eca,ea->ec", point.spin, constant).ravel()
        slope += np.bincount(self._used_numbers, weights=moments[self._used], minlength=self.total)
        slope[self.number[self._free, 0]] -= rate.couple[self._free]
        slope[self.turning_unknowns : self.unknowns] = -positions.Y.T @ rate.force.ravel()
        slope[self.unknowns : self.unknowns + len(positions.rows)] = positions.BZ @ rate.shift
        return slope

    def end_moments(self, state: State, loading: Loading) -> dict[str, Array]:
        """Moment (3,) about the fixed axes that the surroundings exert on the first end of each member."""
        model = self.model
        self._kernel.set(0, state.q[model.rotations.turns])
        constant = self.member_pulls(state.lam, loading)[model.beams.owner]
        self._kernel.set(3, loading.pull + constant[:, None, :])
        moments = self._kernel()[2]
        turns = model.element.turns
        first = [moments[model.beams.first[name], :turns] for name in model.members]
        return {
            n: m.copy() if turns == 3 else np.array([0.0, 0.0, m[0]]) for n, m in zip(model.members, first, strict=True)
        }

    def node_jacobian(self, state: State, loading: Loading, chosen: Index) -> tuple[Array, Array]:
        """Chosen displacements of nodes and their derivatives by the unknowns, (chosen, unknowns)."""
        model, positions = self.model, self.model.positions
        self._kernel.set(0, state.q[model.rotations.turns])
        self._kernel.set(3, loading.pull)
        _, _, moments, stiffness, reach, spin = self._kernel()
        spin = self._local_parts(moments, stiffness, spin)[2]
        maps = positions.E[chosen].reshape(len(chosen), len(model.members), -1)[:, model.beams.owner]
        values = np.einsum("rea,eca->rec", maps, spin).reshape(len(chosen), -1)
        jacobian = np.zeros((len(chosen), self.unknowns))
        used = self._local.ravel() >= 0
        np.add.at(jacobian.T, self._local.ravel()[used], values.T[used])
        jacobian[:, self.turning_unknowns :] = positions.Y[chosen]
        return self.displacements(state, loading, reach)[0][chosen], jacobian

    def elastic_entries(self) -> Array:
        """Entries of the Newton matrix of the strain energy alone at the undeformed state, without closings."""
        model = self.model
        rest = np.zeros((*model.rotations.turns.shape, model.element.components))
        rest[..., 0] = 1.0 if model.space else 0.0
        self._kernel.set(0, rest)
        self._kernel.set(3, np.zeros_like(model.beams.tangent))
        _, _, moments, stiffness, _, spin = self._kernel()
        stiffness = self._local_parts(moments, stiffness, spin)[1].ravel()
        values = np.zeros(self._size)
        values[: len(stiffness)] = stiffness
        return np.bincount(self._to_entry, weights=values[self._valid], minlength=len(self.row))

    def _local_parts(self, moments: Array, stiffness: Array, spin: Array) -> tuple[Array, Array, Array]:
        """The kernel's results in the bases of the unknowns; read before the kernel is called again."""
        n, width = self._local.shape
        stiffness = stiffness.reshape(n, width, width)
        spin = spin.reshape(n, width, self.model.element.axes)
        self._turn_bases(moments, stiffness, spin)
        return moments, stiffness, spin

    def _hinge_parts(self, state: State, residual: Array) -> list[Array]:
        model = self.model
        first = len(model.positions.rows)
        self._hinge.set(0, state.q[model.rotations.hinges])
        self._hinge.set(2, state.lam[first:])
        rows, spin, stiffness = self._hinge()
        n = len(rows)
        stiffness, spin = stiffness.reshape(n, 6, 6).copy(), spin.reshape(n, 6, 2).copy()
        moments = np.einsum("ncr,nr->nc", spin, state.lam[first:].reshape(n, 2))
        for h, side in np.argwhere(np.isin(model.rotations.hinges, list(self._basis))):
            basis, part = self._basis[int(model.rotations.hinges[h, side])], slice(3 * side, 3 * side + 3)
            moments[h, part] = moments[h, part] @ basis
            stiffness[h, part] = basis.T @ stiffness[h, part]
            stiffness[h, :, part] = stiffness[h, :, part] @ basis
            spin[h, part] = basis.T @ spin[h, part]
        cells = self.number[model.rotations.hinges].reshape(n, -1)
        np.add.at(residual, cells[cells >= 0], moments[cells >= 0])
        residual[self.unknowns + first :] = rows.ravel()
        return [stiffness.ravel(), spin.ravel(), spin.ravel()]

    def _turn_bases(self, moments: Array, stiffness: Array, spin: Array) -> None:
        """Turn the components of rotations about a held axis, in place, so that the first is about it."""
        for e, k in self._on_axes:
            basis, part = self._basis[int(self.model.rotations.turns[e, k])], slice(3 * k, 3 * k + 3)
            moments[e, part] = moments[e, part] @ basis
            stiffness[e, part] = basis.T @ stiffness[e, part]
            stiffness[e, :, part] = stiffness[e, :, part] @ basis
            spin[e, part] = basis.T @ spin[e, part]

    def _closing_parts(self, spin: Array) -> list[Array]:
        parts = []
        for elements, z in self._touch:
            part = np.einsum("ra,eca->erc", z, spin[elements]).ravel()
            parts += [part, part]
        return parts

    # -- steps ----------------------------------------------------------------------------------

    @functools.cached_property
    def solver(self) -> SparseSolver:
        """Solver of the Newton matrix."""
        # Chains with few closings are banded; the bordered matrices of frames need a better ordering.
        return SparseSolver(self.total, self.row, self.column, "mumps" if self.rows > FEW_ROWS else "csparse")

    def moved(self, state: State, step: Array) -> State:
        """The state after a step of all unknowns and multipliers."""
        model = self.model
        turn = np.where(self.number >= 0, step[self.number], 0.0)
        for i, basis in self._basis.items():
            turn[i] = basis @ turn[i]
        if model.space:
            q = quaternion.multiply(quaternion.from_rotation_vector(turn), state.q)
            q /= np.linalg.norm(q, axis=-1, keepdims=True)
        else:
            q = state.q + turn
        y = state.y + step[self.turning_unknowns : self.unknowns]
        return State(q, y, state.lam + step[self.unknowns :])


FEW_ROWS = 12
"""Up to this many closings csparse is faster than MUMPS, beyond it can be ten times slower (measured)."""


def _positive_part(matrices: Array) -> Array:
    """Symmetric matrices (n, k, k) with the absolute values of their eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    if (values >= 0.0).all():
        return matrices
    return np.asarray(np.einsum("nij,nj,nkj->nik", vectors, np.abs(values), vectors))


def _basis(axis: Array) -> Array:
    """Orthonormal basis whose first column is the axis."""
    return np.column_stack([axis, *np.linalg.svd(axis[None, :])[2][1:]])
