"""The stationarity equations of a model in rotations about the fixed axes, and their Newton matrix.

Unknown changes are a rotation vector for each free rotation (an angle in the plane, one number about the axis
of a held hinge), the displacements kept as unknowns, and the multipliers of the closings.  Rotations are
updated by ``q <- exp(phi/2) q``, so that norms hold by construction and need neither rows nor multipliers.

This is the second, independent form of the problem that IPOPT solves with quaternion components and norms as
constraints; polish, certificate and continuation stand on it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..mathematics import interpolation, quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.kernels import Batch, Kernels, chosen
from ..mathematics.linear import SparseMap, SparseSolver
from .connections import Group
from .joints import Body, by_turning
from .loading import Loading
from .model import Model
from .rotations import Turn
from .segments import Segment
from .spinning import SPUN, SpunPair, SpunVectors
from .work import Work

__all__ = ["UNLOADED", "Equations", "Point", "State", "turned_tangents"]

UNLOADED = 1e-6
"""Share of the largest forces of a model below which forces at a node are rounding: 1e-16 of them is 1e-10 of this."""


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
    wound : ndarray
        Values near which the angles that count turns are counted, see :class:`~sfetcas.mechanics.winding.Winding`.
    """

    q: Array
    y: Array
    lam: Array
    wound: Array


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
        # Whether rows depend on each other where Newton's method began; looked for when it does.
        self.redundant: bool | None = None
        element = model.element
        self._number_unknowns()
        n = len(model.rotations.turns)
        calls = evaluations * n
        self._kernel = Batch(chosen(element.turning, calls, kernels), n)
        self._kernel.set(1, model.beams.stiffness)
        self._kernel.set(2, model.beams.tangent)
        self._owner, self._first = model.segments.owner, model.segments.first
        self._rest = np.add.reduceat(model.beams.tangent.sum(axis=1), self._first, axis=0)
        self._linked = [_Linked(self, group) for group in model.connections]
        self._pattern()
        # A hundredth of the stiffness against turning a node: 1e-14 of it is what rounding of rotations leaves.
        self.noise = np.abs(self.elastic_entries()[self.diagonal]) * 0.01
        for link in self._linked:
            link.add_noise(self.noise)
        # Sections turn: about any fixed axis rounding is that of the stiffest one, also where nothing resists a turn.
        free = self.number[(self.number >= 0).all(axis=1)]
        self.noise[free] = self.noise[free].max(axis=1, keepdims=True)
        self.noise[self._kept] = self.noise[self._kept].max(axis=1, keepdims=True)
        self.noise[self.unknowns :] = 1.0

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
        self.displacement_unknowns = len(model.positions.unknowns)
        kept = model.positions.kept
        self.place_number = np.where(kept < 0, -1, self.turning_unknowns + kept)
        self._kept = self.place_number[(kept >= 0).all(axis=1)]
        self.rows = len(model.positions.rows) + sum(len(group.rows) for group in model.connections)
        self.unknowns = self.turning_unknowns + self.displacement_unknowns
        about = np.flatnonzero(model.rotations.kind == Turn.AXIS) if model.space else np.array([], dtype=np.intp)
        self._basis = {int(i): _basis(model.rotations.axis[i]) for i in about}
        self._on_axes = [np.flatnonzero(np.isin(turns, about)) for turns in model.rotations.turns.T]
        self._free = np.flatnonzero(self.number[:, 0] >= 0)

    @functools.cached_property
    def elastic_displacements(self) -> Index:
        """Numbers of the displacement unknowns that springs, bodies and joints act upon."""
        touched = [link.cells[link.cells >= self.turning_unknowns] for link in self._linked]
        return np.unique(np.concatenate([np.zeros(0, np.intp), *touched]))

    @functools.cached_property
    def worked_displacements(self) -> Index:
        """The same and those that have entries in the energy: of pressure, which works on what it moves."""
        if self.model.has_potential or not self.model.conservative:
            return self.elastic_displacements
        pressed = self._work.row[(self._work.row >= self.turning_unknowns) & (self._work.column >= 0)]
        return np.union1d(self.elastic_displacements, pressed)

    @functools.cached_property
    def _transposed(self) -> Index:
        return np.lexsort((self.column, self.row))

    def symmetric(self, point: Point) -> Point:
        """The point with the symmetric part of the Newton matrix, where pressure leaves a mesh's share that is not."""
        if self.model.has_potential:
            return point
        return replace(point, entries=0.5 * (point.entries + point.entries[self._transposed]))

    @functools.cached_property
    def mass(self) -> Array:
        """Length that belongs to each turning unknown, for norms that do not depend on the mesh."""
        model = self.model
        lump = np.zeros(len(model.rotations.kind))
        w = model.beams.weight
        if model.element.gauss:
            w = w.sum(axis=1, keepdims=True) * interpolation.lobatto(model.element.order + 1)[1]
        np.add.at(lump, model.rotations.turns.ravel(), w.ravel())
        for name, member in model.scene.members.items():
            if member.type == "small":
                share = model.scene.center_lines[name].length / model.scales.length / len(member.nodes)
                np.add.at(lump, list(model.rotations.ends[name]), share)
        # What turns with nothing that has a length.
        lump = np.maximum(lump, 1e-6)
        mass = np.zeros(self.turning_unknowns)
        used = self.number >= 0
        mass[self.number[used]] = np.broadcast_to(lump[:, None], self.number.shape)[used]
        return mass

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the closing and hinge rows."""
        return self.model.row_names

    # -- pattern of the Newton matrix -----------------------------------------------------------

    def _pattern(self) -> None:
        """Row and column of every contribution, and where it goes among the entries of the matrix."""
        model = self.model
        width = model.rotations.turns.shape[1] * model.element.turns
        local = self.number[model.rotations.turns].reshape(-1, width)
        self._local = local
        rows, columns = [], []

        def add(r: Array, c: Array) -> None:
            rows.append(np.asarray(r).ravel())
            columns.append(np.asarray(c).ravel())

        shape = (*local.shape, local.shape[1])
        add(np.broadcast_to(local[:, None, :], shape), np.broadcast_to(local[:, :, None], shape))
        first_row = self.unknowns
        self._touch: list[tuple[slice, Array]] = []
        for part, touched, z in _touched(model.positions.Z, model.segments.parts, model.element.axes):
            if len(touched):
                self._touch.append((part.elements, z))
                cells = local[part.elements]
                size = (len(cells), len(touched), cells.shape[1])
                r = np.broadcast_to((first_row + touched)[None, :, None], size)
                c = np.broadcast_to(cells[:, None, :], size)
                r = np.where(c < 0, -1, r)
                add(r, c)
                add(c, r)
        w = model.positions.W
        add(first_row + w.row, self.turning_unknowns + w.column)
        add(self.turning_unknowns + w.column, first_row + w.row)
        for link in self._linked:
            cells, width = link.cells, link.cells.shape[1]
            size = (len(cells), width, width)
            add(np.broadcast_to(cells[:, None, :], size), np.broadcast_to(cells[:, :, None], size))
            labels = first_row + link.first_row + np.arange(len(cells) * link.rows).reshape(len(cells), -1)
            size = (len(cells), width, link.rows)
            r, c = np.broadcast_to(labels[:, None, :], size), np.broadcast_to(cells[:, :, None], size)
            r = np.where(c < 0, -1, r)
            add(r, c)
            add(c, r)
        if not model.has_potential:
            self._work = Work(model, self.number, self.place_number, self._basis)
            add(self._work.row, self._work.column)
        # The diagonal is always there: regularisation and shifts are put on it.
        total = self.unknowns + self.rows
        add(np.arange(total), np.arange(total))
        row, column = np.concatenate(rows), np.concatenate(columns)
        valid = (row >= 0) & (column >= 0)
        keys = column[valid] * total + row[valid]
        # What follows has entries on one side of the diagonal alone; of pressure the symmetric part is taken.
        mirrored = () if model.has_potential or not model.conservative else (row[valid] * total + column[valid],)
        places, inverse = np.unique(np.concatenate([keys, *mirrored]), return_inverse=True)
        self._valid, self._to_entry = np.flatnonzero(valid), inverse[: len(keys)]
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
        winding = self.model.winding
        wound = winding.prescribed(self.model.rotations.kind, loading)
        wound = np.where(np.isnan(wound), winding.of_vectors(loading.turn), wound)
        return State(self.model.held(loading), np.zeros(self.displacement_unknowns), np.zeros(self.rows), wound)

    def holding(self, state: State, loading: Loading) -> State:
        """The state with held rotations moved to their prescribed values."""
        q = np.where((self.model.rotations.kind == Turn.HELD)[:, None], self.model.held(loading), state.q)
        if not self.model.winding.count:
            return replace(state, q=q)
        wound = self.model.winding.prescribed(self.model.rotations.kind, loading)
        return replace(state, q=q, wound=np.where(np.isnan(wound), state.wound, wound))

    def segment_pulls(self, lam: Array, loading: Loading) -> Array:
        """Minus the constant part of the internal force of each segment, (segments, axes)."""
        positions = self.model.positions
        force = positions.Z.T @ lam[: len(positions.rows)] - positions.E.T @ loading.force.ravel()
        return np.asarray(force.reshape(self._rest.shape))

    def displacements(self, state: State, loading: Loading, reach: Array) -> tuple[Array, Array]:
        """Displacements of the places (places * axes,) and closing gaps, from the reaches of the elements."""
        positions = self.model.positions
        delta = (np.add.reduceat(reach, self._first, axis=0) - self._rest).ravel()
        nodal = positions.E @ delta + positions.Y @ state.y + positions.B @ loading.shift
        gap = positions.Z @ delta + positions.W @ state.y + positions.BZ @ loading.shift
        return nodal, gap

    def at(self, state: State, loading: Loading, *, convex: bool = False) -> Point:
        """The equations at a state; with ``convex`` the element matrices made positive."""
        model, positions = self.model, self.model.positions
        applied, loading = loading, self.effective(state, loading)
        constant = self.segment_pulls(state.lam, loading)[self._owner]
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
        residual = self._gathered(moments)
        # What a node adds up: moments of its elements, and within them the forces times the length they act on.
        carried = (np.abs(pull).sum(axis=2) * model.beams.weight).sum(axis=1)
        sums = np.abs(moments) + np.repeat(carried, len(model.element.nodes) * model.element.turns).reshape(
            moments.shape
        )
        scale = self._gathered(sums) + self.noise
        if loading.moment.any():
            potential -= self._work_of_moments(state, loading)
            couple = self._on_unknowns(loading.moment)
            residual[: self.turning_unknowns] -= couple
            scale[: self.turning_unknowns] += np.abs(couple)
        lam, force = state.lam[: len(positions.rows)], loading.force.ravel()
        if self.displacement_unknowns:
            displacement = slice(self.turning_unknowns, self.unknowns)
            residual[displacement] = positions.W.T @ lam - positions.Y.T @ force
            sums = positions.W.T.absolute @ np.abs(lam) + positions.Y.T.absolute @ np.abs(force)
            # A node at which next to nothing acts is judged by a millionth of what acts elsewhere.
            scale[displacement] += sums + UNLOADED * sums.max(initial=0.0) + 1e-12
        residual[self.unknowns : self.unknowns + len(gap)] = gap

        parts = [stiffness.ravel(), *self._closing_parts(spin), positions.W.value, positions.W.value]
        stored = float(strain.sum())
        for link, load in zip(self._linked, loading.loads, strict=True):
            energy, kept, link_parts = link.at(self, state, nodal, load, residual, scale, convex=convex)
            potential, stored, parts = potential + energy, stored + kept, parts + link_parts
        # A component along which nothing acts is judged by what acts across it.
        scale[self._kept] = scale[self._kept].max(axis=1, keepdims=True)
        if not model.has_potential:
            parts.append(self._work.entries(state.q, applied, convex=convex))
        values = np.concatenate([*parts, self._zeros])[self._valid]
        # Without any unknown the sum is of whole numbers.
        entries = np.bincount(self._to_entry, weights=values, minlength=len(self.row)).astype(float, copy=False)
        return Point(potential, stored, residual, scale, entries, np.array(spin))

    def slope(self, point: Point, rate: Loading) -> Array:
        """Derivative of the residual along a change of nodal loads and displacements at a point."""
        positions = self.model.positions
        constant = self.segment_pulls(np.zeros(self.rows), rate)[self._owner]
        slope = self._gathered(np.einsum("eca,ea->ec", point.spin, constant))
        slope[: self.turning_unknowns] -= self._on_unknowns(rate.moment)
        slope[self.turning_unknowns : self.unknowns] = -(positions.Y.T @ rate.force.ravel())
        slope[self.unknowns : self.unknowns + len(positions.rows)] = positions.BZ @ rate.shift
        return slope

    def basis(self, rotation: int) -> Array | None:
        """Axes (3, 3), columns, of a rotation that is held to the first of them; None of one that is not."""
        return self._basis.get(rotation)

    def places(self, state: State, loading: Loading) -> Array:
        """Displacements of all places at a state, (places * axes,), dimensionless."""
        self._kernel.set(0, state.q[self.model.rotations.turns])
        return self.displacements(state, loading, self._kernel()[4])[0]

    def _gathered(self, parts: Array) -> Array:
        """Moments on the nodes of the elements added up on the unknowns."""
        values = np.bincount(self._used_numbers, weights=parts.ravel()[self._used], minlength=self.total)
        # Without any element the sum is of whole numbers.
        return values.astype(float, copy=False)

    def shares(self, state: State, loading: Loading) -> tuple[Array, list[Array]]:
        """What elements and connections take from their surroundings at a state, dimensionless.

        Returns
        -------
        moments : ndarray (elements, p + 1, 3)
            Moments about the fixed axes on the nodes of the elements.
        links : list of ndarray (n, width)
            For each group of connections moments on its rotations, then forces on its places.
        """
        model, loading = self.model, self.acting(state, loading)
        self._kernel.set(0, state.q[model.rotations.turns])
        constant = self.segment_pulls(state.lam, loading)[self._owner]
        self._kernel.set(3, loading.pull + constant[:, None, :])
        _, _, moments, _, reach, _ = self._kernel()
        nodal, _ = self.displacements(state, loading, reach)
        three = np.zeros((len(moments), len(model.element.nodes), 3))
        three[:, :, 3 - model.element.turns :] = moments.reshape(three.shape[0], three.shape[1], model.element.turns)
        pairs = zip(self._linked, loading.loads, strict=True)
        links = [link.evaluated(self, state, nodal, load)[3].copy() for link, load in pairs]
        # What turning axes do is among the loads.
        spun = [isinstance(link.group.kind, SPUN) for link in self._linked]
        return three, [np.zeros_like(part) if skip else part for part, skip in zip(links, spun, strict=True)]

    def node_jacobian(self, state: State, loading: Loading, chosen: Index) -> tuple[Array, Array]:
        """Chosen displacements of nodes and their derivatives by the unknowns, (chosen, unknowns)."""
        model, positions = self.model, self.model.positions
        self._kernel.set(0, state.q[model.rotations.turns])
        self._kernel.set(3, loading.pull)
        _, _, moments, stiffness, reach, spin = self._kernel()
        spin = self._local_parts(moments, stiffness, spin)[2]
        maps = positions.E.rows(chosen).full().reshape(len(chosen), len(self._first), -1)[:, self._owner]
        values = np.einsum("rea,eca->rec", maps, spin).reshape(len(chosen), -1)
        jacobian = np.zeros((len(chosen), self.unknowns))
        used = self._local.ravel() >= 0
        np.add.at(jacobian.T, self._local.ravel()[used], values.T[used])
        jacobian[:, self.turning_unknowns :] = positions.Y.rows(chosen).full()
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
        self._add_links(values)
        found = np.bincount(self._to_entry, weights=values[self._valid], minlength=len(self.row))
        return found.astype(float, copy=False)

    def _add_links(self, values: Array) -> None:
        """Put the stiffness of springs and small members at the undeformed state to the contributions."""
        rest = self.start(self.model.loading(0.0, 0.0))
        rest = replace(rest, q=self._at_rest(len(rest.q)))
        nothing = np.zeros(self.total)
        where = self._size - self.total - (self._work.row.size if not self.model.has_potential else 0)
        for link in reversed(self._linked):
            places = np.zeros(len(self.model.segments.places) * self.model.element.axes)
            load = np.zeros((len(link.cells), link.group.kind.sizes[4]))
            _, _, (stiffness, spin, _) = link.at(self, rest, places, load, nothing.copy(), nothing.copy())
            where -= 2 * spin.size
            values[where - stiffness.size : where] = stiffness
            where -= stiffness.size

    def _at_rest(self, count: int) -> Array:
        rest = np.zeros((count, self.model.element.components))
        rest[:, 0] = 1.0 if self.model.space else 0.0
        return rest

    def effective(self, state: State, loading: Loading) -> Loading:
        """The loading with what follows the state as it is there."""
        return loading if self.model.has_potential else self._work.effective(state.q, loading)

    def acting(self, state: State, loading: Loading) -> Loading:
        """The effective loading, with the centrifugal forces in turning axes."""
        loading, spinning = self.effective(state, loading), self.model.spinning
        if spinning is None:
            return loading
        q, places = state.q, self.places(state, loading)
        u = places.reshape(len(self.model.segments.places), -1)
        axes, pairs = self.model.element.axes, zip(self._linked, loading.loads, strict=True)
        matrix = next(load[0] for link, load in pairs if isinstance(link.group.kind, SpunPair)).reshape(axes, axes)
        found = loading.plus(spinning.positional(self.model, u, turned_tangents(self.model, q), matrix))
        moment, force = found.moment.copy(), np.zeros_like(found.force)
        for link, load in zip(self._linked, loading.loads, strict=True):
            if isinstance(link.group.kind, SpunVectors):
                link.add_forces(-link.evaluated(self, state, places, load)[3], moment, force)
        return replace(found, moment=moment, force=found.force + force, own=found.own + force)

    def _on_unknowns(self, moments: Array) -> Array:
        """Moments about the fixed axes (rotations, 3) on the turning unknowns."""
        if not self.model.space:
            return np.asarray(moments[self._free, 2])
        moments = moments.copy()
        for i, basis in self._basis.items():
            moments[i] = moments[i] @ basis
        values = np.zeros(self.turning_unknowns)
        used = self.number >= 0
        values[self.number[used]] = moments[used]
        return values

    def _work_of_moments(self, state: State, loading: Loading) -> float:
        """Work of the moments that have a potential: about z in the plane, about the axis of a held hinge."""
        if not self.model.space:
            return float(loading.moment[:, 2] @ state.q[:, 0])
        winding = self.model.winding
        angles = winding.angles(state.q, state.wound)
        return sum(
            float(loading.moment[i] @ winding.axis[angle]) * float(angles[angle]) for i, angle in winding.about.items()
        )

    def _local_parts(self, moments: Array, stiffness: Array, spin: Array) -> tuple[Array, Array, Array]:
        """The kernel's results in the bases of the unknowns; read before the kernel is called again."""
        n, width = self._local.shape
        stiffness = stiffness.reshape(n, width, width)
        spin = spin.reshape(n, width, self.model.element.axes)
        self._turn_bases(moments, stiffness, spin)
        return moments, stiffness, spin

    def _turn_bases(self, moments: Array, stiffness: Array, spin: Array) -> None:
        """Turn the components of rotations about a held axis, in place, so that the first is about it."""
        for k, held in enumerate(self._on_axes):
            if not len(held):
                continue
            part = slice(3 * k, 3 * k + 3)
            bases = np.array([self._basis[i] for i in self.model.rotations.turns[held, k].tolist()])
            moments[held, part] = np.einsum("eij,ei->ej", bases, moments[held, part])
            stiffness[held, part] = np.einsum("eij,eik->ejk", bases, stiffness[held, part])
            stiffness[held, :, part] = np.einsum("eki,eij->ekj", stiffness[held, :, part], bases)
            spin[held, part] = np.einsum("eij,eik->ejk", bases, spin[held, part])

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
        symmetric = self.model.has_potential
        return SparseSolver(self.total, self.row, self.column, self.rows, symmetric=symmetric)

    def moved(self, state: State, step: Array) -> State:
        """The state after a step of all unknowns and multipliers."""
        model = self.model
        # What is held, number -1, turns by the zero at the end.
        turn = np.append(step, 0.0)[self.number]
        for i, basis in self._basis.items():
            turn[i] = basis @ turn[i]
        if model.space:
            q = quaternion.multiply(quaternion.from_rotation_vector(turn), state.q)
            q /= np.linalg.norm(q, axis=-1, keepdims=True)
        else:
            q = state.q + turn
        y = state.y + step[self.turning_unknowns : self.unknowns]
        wound = model.winding.moved(state.q, state.wound, turn, q)
        return State(q, y, state.lam + step[self.unknowns :], wound)


def turned_tangents(model: Model, q: Array) -> Array:
    """Turned tangents times weight and length at the integration points, (elements, points, axes)."""
    element, q = model.element, q[model.rotations.turns]
    if element.gauss:
        q = np.einsum("kj,ejc->ekc", interpolation.evaluation(element.nodes, element.points), q)
    if model.space:
        return quaternion.rotate(q / np.linalg.norm(q, axis=-1, keepdims=True), model.beams.tangent)
    c, s = np.cos(q[..., 0]), np.sin(q[..., 0])
    t = model.beams.tangent
    return np.stack([c * t[..., 0] - s * t[..., 1], s * t[..., 0] + c * t[..., 1]], axis=-1)


class _Linked:
    """The connections of one group in the unknowns of the equations."""

    def __init__(self, equations: Equations, group: Group) -> None:
        model = equations.model
        self.rows = group.kind.sizes[2]
        n, width = len(group.names), model.element.turns
        self.group = group
        before = model.connections[: next(i for i, g in enumerate(model.connections) if g is group)]
        self.first_row = len(model.positions.rows) + sum(len(g.rows) for g in before)
        # The ground is the last side: it has no unknowns.
        numbers = np.vstack([equations.number, np.full((1, width), -1)])
        moves = np.vstack([equations.place_number, np.full((1, model.element.axes), -1)])
        turning, moving = numbers[group.turns].reshape(n, -1), moves[group.places].reshape(n, -1)
        self.cells = np.concatenate([turning, moving], axis=1)
        self._batch = Batch(by_turning(group.kind), n)
        self._data, self._angles = group.data.copy(), model.winding.parts[len(before)]
        self._batch.set(2, self._data)
        self._about = np.argwhere(np.isin(group.turns, list(equations._basis))).tolist()

    def add_noise(self, noise: Array) -> None:
        """Judge the sides of a body by its largest stiffness: rounding of a stiff direction has levers."""
        kind = self.group.kind
        if isinstance(kind, Body):
            first = kind.nodes * kind.axes
            largest = np.abs(self.group.data[:, first : first + kind.freedoms * (kind.freedoms + 1) // 2]).max(axis=1)
            used = self.cells >= 0
            np.maximum.at(noise, self.cells[used], (0.01 * largest[:, None] * used)[used])

    def at(
        self,
        equations: Equations,
        state: State,
        places: Array,
        load: Array,
        residual: Array,
        scale: Array,
        *,
        convex: bool = False,
    ) -> tuple[float, float, list[Array]]:
        """Energy, its share without loads, and entries; what is out of balance is added to the residual."""
        group, n = self.group, len(self.cells)
        energy, stored, gaps, gradient, stiffness, spin = self.evaluated(equations, state, places, load)
        rows = slice(self.first_row, self.first_row + n * self.rows)
        width = self.cells.shape[1]
        gradient = gradient.copy()
        stiffness, spin = stiffness.reshape(n, width, width).copy(), spin.reshape(n, width, self.rows).copy()
        for h, side in self._about:
            _to_basis(equations._basis[int(group.turns[h, side])], side, gradient[h], stiffness[h], spin[h])
        if convex and not self.rows:
            stiffness = _positive_part(stiffness)
        used = self.cells >= 0
        np.add.at(residual, self.cells[used], gradient[used])
        np.add.at(scale, self.cells[used], np.abs(gradient)[used])
        residual[equations.unknowns + rows.start : equations.unknowns + rows.stop] = gaps.ravel()
        parts = [stiffness.ravel(), spin.ravel(), spin.ravel()]
        return float(energy.sum()), float(stored.sum()), parts

    def add_forces(self, forces: Array, moments: Array, on_places: Array) -> None:
        """Add moments and forces (n, width) on the sides to those of rotations (rotations, 3) and places, in place."""
        group, axes = self.group, on_places.shape[1]
        width = (forces.shape[1] - axes * group.places.shape[1]) // max(group.turns.shape[1], 1)
        for i, turns in enumerate(group.turns.T):
            used = turns >= 0
            np.add.at(moments[:, 3 - width :], turns[used], forces[used, i * width : (i + 1) * width])
        first = forces.shape[1] - axes * group.places.shape[1]
        for i, places in enumerate(group.places.T):
            used = places >= 0
            np.add.at(on_places, places[used], forces[used, first + i * axes : first + (i + 1) * axes])

    def evaluated(self, equations: Equations, state: State, places: Array, load: Array) -> list[Array]:
        """Results of :func:`~sfetcas.mechanics.joints.by_turning` at a state."""
        group, n = self.group, len(self.cells)
        q = np.vstack([state.q, equations._at_rest(1)])
        u = np.vstack([places.reshape(-1, equations.model.element.axes), np.zeros((1, equations.model.element.axes))])
        rows = slice(self.first_row, self.first_row + n * self.rows)
        for i, values in enumerate((q[group.turns], u[group.places])):
            if values.size:
                self._batch.set(i, values)
        if self._angles is not None:
            self._data[:, -1] = state.wound[self._angles]
            self._batch.set(2, self._data)
        if load.size:
            self._batch.set(3, load)
        if self.rows:
            self._batch.set(4, state.lam[rows])
        return self._batch()


def _to_basis(basis: Array, number: int, moments: Array, stiffness: Array, spin: Array) -> None:
    """Turn the components of one rotation of several, in place, to a basis; rotations about held axes are in space."""
    part = slice(3 * number, 3 * number + 3)
    moments[part] = moments[part] @ basis
    stiffness[part] = basis.T @ stiffness[part]
    stiffness[:, part] = stiffness[:, part] @ basis
    spin[part] = basis.T @ spin[part]


def _positive_part(matrices: Array) -> Array:
    """Symmetric matrices (n, k, k) with the absolute values of their eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    if (values >= 0.0).all():
        return matrices
    return np.asarray(np.einsum("nij,nj,nkj->nik", vectors, np.abs(values), vectors))


def _touched(z: SparseMap, parts: Sequence[Segment], axes: int) -> Iterator[tuple[Segment, Index, Array]]:
    """Of each segment the closing rows that it takes part in and their entries, (rows, axes)."""
    owner = z.column // axes
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(len(parts) + 1))
    for part, begin, end in zip(parts, bounds, bounds[1:], strict=False):
        here = order[begin:end]
        touched, row = np.unique(z.row[here], return_inverse=True)
        values = np.zeros((len(touched), axes))
        values[row, z.column[here] % axes] = z.value[here]
        yield part, touched, values


def _basis(axis: Array) -> Array:
    """Orthonormal basis whose first column is the axis."""
    return np.column_stack([axis, *np.linalg.svd(axis[None, :])[2][1:]])
