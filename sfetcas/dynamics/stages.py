"""The equations of motion at the stages of a time step, and one Newton iteration of them, as CasADi Functions.

At each stage the equations are those of statics, with the same kernels, plus inertia and damping forces as further
loads: ``M X'' + C X'`` of the quantities ``X`` (see :mod:`~sfetcas.mechanics.observed`).  A method of integration says
how rates at its stages depend on the quantities there,

    X'_i = sum_j C_ij (X_j - X_0) + v_i,      X''_i = sum_j B_ij (X_j - X_0) + a_i,

with ``v``, ``a`` from what came before; nothing else here knows it.  Norms hold by construction, closings are
equations of every stage: index 3, with multipliers as internal forces.

Unknown changes are those of :class:`~sfetcas.mechanics.equations.Equations`: rotation vectors about the fixed axes,
displacements, multipliers; their matrix has the entries of statics on its diagonal blocks and those of inertia and
damping on all of them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np

from ..mathematics.arrays import Index
from ..mathematics.constants import sparse, times
from ..mathematics.linear import pattern, places_of
from ..mechanics.expressions import Given, moved_by
from ..mechanics.stationarity import Forces, Stationarity, summed
from ..mechanics.tables import Pattern
from ..mechanics.terms import Term, rotation_forces, rotation_gradient
from .system import System

__all__ = ["DUAL_REGULARISATION", "StageEquations", "solution"]


class StageEquations(System):
    """The equations of motion at the stages of a time step, and Newton's method for them."""

    def iteration(self, stages: int) -> ca.Function:
        """One Newton iteration of all stages of a step.

        ``(q, y, lam, x0, v, a, C, B, factors, unwrapped) -> (q, y, lam, size)``: q (components, rotations * stages), y,
        lam, v, a and factors with a column for each stage, C and B (stages, stages); ``size`` is the largest rotation
        or displacement by which anything changed.
        """
        n = self.layout
        q = ca.MX.sym("q", n.components, n.rotations * stages)
        y, lam = ca.MX.sym("y", n.y, stages), ca.MX.sym("lam", n.lam, stages)
        x0, v, a = ca.MX.sym("x0", n.x), ca.MX.sym("v", n.x, stages), ca.MX.sym("a", n.x, stages)
        c, b = ca.MX.sym("C", stages, stages), ca.MX.sym("B", stages, stages)
        factors, unwrapped = ca.MX.sym("factors", n.factors, stages), ca.MX.sym("unwrapped", n.unwrapped)
        parts = ca.horzsplit(q, n.rotations)
        given = [self.given(factors[:, i]) for i in range(stages)]
        x = ca.horzcat(*[self.moving(parts[i], y[:, i], given[i], unwrapped) - x0 for i in range(stages)])
        rates, accelerations = ca.mtimes(x, c.T) + v, ca.mtimes(x, b.T) + a
        forces = self.forces(rates, accelerations)
        found = [
            _Stage(self, parts[i], y[:, i], lam[:, i], forces[:, i], given[i], unwrapped, rates[:, i])
            for i in range(stages)
        ]
        entries = [stage.entries for stage in found]
        for i, one in enumerate(found):
            entries += [one.coupled(other, c[i, j], b[i, j]) for j, other in enumerate(found)]
        # Of the last stage: that of the first of two stages of Radau's vanishes.
        inertia = [b[stages - 1, stages - 1]] * stages
        step = self.solved(entries, inertia, ca.horzcat(*[stage.residual for stage in found]), unwrapped)
        turned, shift, more, size = self.moved(parts, step)
        results = [ca.horzcat(*turned), y + shift, lam + more, size]
        names = ["q", "y", "lam", "x0", "v", "a", "C", "B", "factors", "unwrapped"]
        arguments = [q, y, lam, x0, v, a, c, b, factors, unwrapped]
        return ca.Function(f"iteration_{stages}", arguments, results, names, ["q_next", "y_next", "lam_next", "size"])

    def solved(self, entries: list[ca.MX], inertia: list[ca.MX], residual: ca.MX, unwrapped: ca.MX) -> ca.MX:
        """The Newton step of all stages, (total, stages), for matrix entries in the order of their positions.

        ``inertia`` multiplies the accelerations in each stage.  Relative to the masses so weighted, the constraint rows
        of the matrix (not of the equations) get a small diagonal, so that dependent constraints do not make it
        singular, and a large one where a row does not act.
        """
        stages = residual.shape[1]
        matrix, system = self.matrix(entries, inertia, unwrapped)
        left = ca.vec(residual.T)
        found = self._eliminated(matrix, left[system.order], stages)
        return -ca.reshape(found[system.back], stages, self.total).T

    def matrix(self, entries: list[ca.MX], inertia: list[ca.MX], unwrapped: ca.MX) -> tuple[ca.MX, Pattern]:
        """The matrix of :meth:`solved`, and the order of its unknowns."""
        stages = len(inertia)
        system = self._system(stages)
        dual = [-DUAL_REGULARISATION / part for part in inertia]
        if len(self.unilateral):
            dual += [-(1.0 - self.switches(unwrapped)) / (DUAL_REGULARISATION * part) for part in inertia]
        return ca.MX(system.pattern, ca.mtimes(system.sums, ca.vertcat(*entries, *dual))), system

    def _eliminated(self, matrix: ca.MX, right: ca.MX, stages: int) -> ca.MX:
        """Solution of a system of all stages; what relaxes, which stands last, is eliminated first."""
        n, count = (self.total - len(self._relaxing)) * stages, len(self._relaxing)
        if not count:
            return solution(matrix, right)
        # Each of these unknowns is coupled with itself alone, and with those of the elements.
        own = ca.Sparsity.dense(stages, stages)
        where = ca.diagcat(*[own] * count)
        row, column = (n + part for part in places_of(where))
        entries = matrix.nz[matrix.sparsity().get_nz((row + column * matrix.shape[0]).tolist())]
        inverse = ca.MX(where, ca.vec(_inverse(stages).map(count)(ca.reshape(entries, stages**2, count))))
        across, back = matrix[:n, n:], ca.mtimes(inverse, matrix[n:, :n])
        rest = ca.mtimes(inverse, right[n:])
        first = solution(matrix[:n, :n] - ca.mtimes(across, back), right[:n] - ca.mtimes(across, rest))
        return ca.vertcat(first, rest - ca.mtimes(back, first))

    @functools.cached_property
    def _relaxing(self) -> Index:
        """Numbers of the unknowns that hold what has relaxed."""
        model = self.model
        places = model.segments.relaxing.ravel()
        found = model.positions.retained[places[places >= 0]].ravel()
        return np.asarray(self.equations.rotation_unknowns + found[found >= 0])

    def moved(self, q: list[ca.MX], step: ca.MX) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX]:
        """Rotations of all stages after a step, changes of displacements and multipliers, and the largest movement."""
        rotation_unknowns, unknowns = self.equations.rotation_unknowns, self.equations.unknowns
        there, size = [], ca.MX(0)
        for i, part in enumerate(q):
            spin = self.spins(step[:, i])
            there.append(moved_by(self, part, spin))
            size = ca.fmax(size, ca.norm_inf(ca.vertcat(0.0, ca.vec(spin), step[rotation_unknowns:unknowns, i])))
        return there, step[rotation_unknowns:unknowns, :], step[unknowns:, :], size

    def stage(self, q: ca.MX, y: ca.MX, lam: ca.MX, forces: ca.MX, factors: ca.MX, unwrapped: ca.MX) -> _Stage:
        """Residual and matrix entries of a stage for given inertia and damping forces."""
        return _Stage(self, q, y, lam, forces, self.given(factors), unwrapped)

    def static_matrix(self, stage: _Stage) -> ca.MX:
        """Derivative (total, total) of a stage's residual by its unknowns for given inertia and damping forces."""
        return summed((self.total,) * 2, self.tables.tied(self.entry_places.static), stage.entries)

    def coupling_matrix(self, stage: _Stage, c: float, b: float) -> ca.MX:
        """Its derivative (total, total) where rates are multiplied by c and accelerations by b: ``c D + b M``."""
        return summed((self.total,) * 2, self.entry_places.coupled.places, stage.coupled(stage, ca.MX(c), ca.MX(b)))

    def momenta(self, q: ca.MX, y: ca.MX, factors: ca.MX, unwrapped: ca.MX, v: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Jacobian (rows, unknowns) of the rows, masses (unknowns, unknowns), and the momenta (unknowns,) of rates v
        (quantities,) of the quantities.
        """
        nothing, unknowns = ca.MX.zeros(self.layout.lam), self.equations.unknowns
        still, forces = ca.MX.zeros(self.layout.x, 1), self.forces(ca.MX.zeros(self.layout.x, 1), v)
        moving, resting = (self.stage(q, y, nothing, part, factors, unwrapped) for part in (forces, still))
        rows = self.static_matrix(resting)[unknowns:, :unknowns]
        mass = self.coupling_matrix(resting, 0.0, 1.0)[:unknowns, :unknowns]
        return rows, mass, (moving.residual - resting.residual)[:unknowns]

    def further(self, forces: ca.MX) -> Forces:
        """Inertia and damping forces (quantities,) of what is linear, as forces on places and pulls along elements."""
        linear = forces[: self.linear]
        return Forces(times(self.by_place.T, linear), times(self.by_tangent.T, linear))

    def pushed(
        self, function: Callable[[Term], ca.Function], q: ca.MX, places: ca.MX, unwrapped: ca.MX, forces: ca.MX
    ) -> Iterator[tuple[Index, list[ca.MX]]]:
        """Of each group of observables its sides, and a function of its kind at forces (quantities,) on its values."""
        observables = zip(self.masses.observables, self.observed, self.ranges, strict=True)
        for group, sides, (begin, end) in observables:
            n = len(group.data)
            own = ca.reshape(forces[begin:end], group.kind.sizes[2], n)
            data = *self.sides(group, q, places), self.seen_data(group, unwrapped)
            yield sides, list(self.many(function(group.kind), n)(*data, ca.MX(0, n), own))

    def balance(
        self, q: ca.MX, y: ca.MX, lam: ca.MX, forces: ca.MX, given: Given, unwrapped: ca.MX
    ) -> tuple[Stationarity, ca.MX]:
        """The equations of statics at a state with inertia and damping forces (quantities,), and of these forces what
        observables take from rotations and places, in full coordinates.
        """
        places, rows = self.displacements(q, y, given), self.tables.of_rows
        static = Stationarity(self, q, y, lam, given, unwrapped, self.further(forces), entries=False)
        taken = ca.MX(rows, 1)
        for sides, (_, acting) in self.pushed(rotation_forces, q, places, unwrapped, forces):
            flat = sides.ravel()
            used = np.flatnonzero((flat >= 0) & (flat < rows))
            taken += times(sparse(flat[used], used, np.ones(len(used)), (rows, len(flat))), ca.vec(acting))
        return static, taken

    @functools.cached_property
    def entry_places(self) -> StagePlaces:
        """Positions of its matrix entries."""
        return StagePlaces(self)

    def _system(self, stages: int) -> Pattern:
        """Pattern of the matrix of all stages, unknown by unknown, each with its stages."""
        probe = self.entry_places
        static = self.tables.tied(probe.static)
        one, coupled = probe.static.count, probe.coupled.places
        rows, columns = (np.concatenate([static[k], coupled[k], np.arange(self.total)]) for k in (0, 1))
        both = np.unique(np.concatenate([columns * self.total + rows, rows * self.total + columns]))
        amd = pattern(self.total, both % self.total, both // self.total).amd()
        order = np.array(amd, dtype=np.intp)
        last = np.isin(order, self._relaxing)
        place = np.argsort(np.concatenate([order[~last], order[last]]))
        blocks = [(i, i, static, one + 1) for i in range(stages)]
        blocks += [(i, j, coupled, probe.coupled.count) for i in range(stages) for j in range(stages)]
        rows = np.arange(self.equations.unknowns, self.total)
        blocks += [(i, i, (rows, rows, np.ones(len(rows)), np.zeros(len(rows), np.intp)), 1) for i in range(stages)]
        if len(self.unilateral):
            own = self.equations.unknowns + self.switching
            blocks += [(i, i, (own, own, np.ones(len(own)), np.arange(len(own))), len(own)) for i in range(stages)]
        size, first, flat, weights, entries = self.total * stages, 0, [], [], []
        for i, j, (r, c, weight, number), count in blocks:
            flat.append((place[c] * stages + j) * size + place[r] * stages + i)
            weights.append(weight)
            entries.append(first + number)
            first += count
        places, inverse = np.unique(np.concatenate(flat), return_inverse=True)
        sums = sparse(inverse.ravel(), np.concatenate(entries), np.concatenate(weights), (len(places), first))
        # Unknown a of stage i stands at place[a] * stages + i of the system, at a * stages + i of the residual.
        back = (place[:, None] * stages + np.arange(stages)).ravel()
        found = pattern(size, places % size, places // size)
        return Pattern(found, sums, np.argsort(back).tolist(), back.tolist())


def solution(matrix: ca.MX, right: ca.MX) -> ca.MX:
    """Of a linear system (n, n) with right sides (n, m)."""
    # Entries differ by the square of the step: none is too small to divide by.
    return ca.solve(matrix, right, "qr", {"eps": 1e-300})


@functools.cache
def _inverse(size: int) -> ca.Function:
    """The inverse of a matrix (size, size), both as columns."""
    matrix = ca.SX.sym("matrix", size, size)
    return ca.Function("inverse", [ca.vec(matrix)], [ca.densify(ca.vec(ca.inv(matrix)))], {"cse": True})


DUAL_REGULARISATION = 1e-10
"""Dual regularisation of closings in the matrix over the inverse of what resists them, the whole mass being one."""


class StagePlaces:
    """Rows and columns of the matrix entries of a stage, and of a pair of stages, in the order of :class:`_Stage`."""

    def __init__(self, system: StageEquations) -> None:
        tables = system.tables
        self.static, self.coupled = tables.static_entries(), tables.entries()
        static, coupled, cells = self.static, self.coupled, tables.sides[0]
        for sides in system.observed:
            static.add(sides[:, None, :], sides[:, :, None])
            coupled.add(sides[:, None, :], sides[:, :, None])
        inside = system.massive
        own, at = cells[inside], tables.place_cells(system.start[inside])
        coupled.add(own[:, None, :], own[:, :, None])
        coupled.add(own[:, :, None], at[:, None, :])
        coupled.add(at[:, None, :], own[:, :, None])
        for matrix in (system.place_mass, system.place_drag):
            row, column = places_of(matrix.sparsity())
            coupled.add(system.of_places + row, system.of_places + column)
        self.sliding = coupled.count
        """Where the entries of places that slide begin among those that couple stages."""
        if (rubbing := system.rubbing) is not None:
            rubbed = tables.place_cells(rubbing.places)
            static.add(rubbed[:, None, :], rubbed[:, :, None])
            static.add(rubbed, tables.of_rows + rubbing.gaps[:, None])
            coupled.add(rubbed[:, None, :], rubbed[:, :, None])
        if system.crossing is None:
            return
        for sides in system.observed:
            coupled.add(sides[:, None, :], sides[:, :, None])
        if len(inside):
            coupled.add(own[:, None, :], own[:, :, None])
            coupled.add(own[:, :, None], at[:, None, :])
            coupled.add(at[:, None, :], own[:, :, None])
        row, column, _ = system.place_weights
        coupled.add(tables.place_cells(row)[:, :, None], tables.place_cells(column)[:, None, :])


class _Stage:
    """Residual and entries of one stage at given inertia and damping forces."""

    def __init__(
        self,
        system: StageEquations,
        q: ca.MX,
        y: ca.MX,
        lam: ca.MX,
        forces: ca.MX,
        given: Given,
        unwrapped: ca.MX,
        rates: ca.MX | None = None,
    ) -> None:
        self._system = system
        lam = system.switched(lam, unwrapped)
        # What acts along the elements: loads, internal forces, inertia.
        places = system.displacements(q, y, given)
        static = Stationarity(system, q, y, lam, given, unwrapped, system.further(forces))
        entries, shares = static.entries, []
        self._rotation_jacobian = static.rotation_jacobian[:, system.massive_columns]
        self._rotation_jacobians = []
        for sides, found in system.pushed(rotation_gradient, q, places, unwrapped, forces):
            shares.append((sides, found[3]))
            entries.append(ca.vec(found[4]))
            self._rotation_jacobians.append(found[5])
        if system.rubbing is not None:
            velocities = ca.MX.zeros(places.shape) if rates is None else rates[: places.shape[0]]
            rubbed = system.rubbing.forces(places, lam, system.rubs(unwrapped), velocities)
            shares.append((system.tables.place_cells(system.rubbing.places), rubbed[0]))
            entries += [ca.vec(rubbed[1]), ca.vec(rubbed[2])]
            self._rubbed_by_rates = ca.vec(rubbed[3])
        self.residual = static.gathered(shares)
        if len(system.unilateral):
            n = system.equations.unknowns
            self.residual = ca.vertcat(self.residual[:n], system.missed(self.residual[n:], unwrapped))
        self.entries = ca.vertcat(*entries, ca.MX(1))

    def coupled(self, other: _Stage, c: ca.MX, b: ca.MX) -> ca.MX:
        """Entries of this stage's residual by the quantities of another one."""
        system, entries = self._system, []
        for group, mine, its in zip(
            system.masses.observables, self._rotation_jacobians, other._rotation_jacobians, strict=True
        ):
            n = len(group.data)
            weight = b * ca.DM(group.mass.T) + c * ca.DM(group.damping.T)
            entries.append(ca.vec(system.paired(group.kind.sizes[2], mine.shape[1] // n, n)(mine, its, weight)))
        if len(system.massive):
            entries += system.hung(self._rotation_jacobian, other._rotation_jacobian, c, b)
        entries += [b * system.place_mass.nz[:], c * system.place_drag.nz[:]]
        if system.rubbing is not None:
            entries.append(c * self._rubbed_by_rates)
        if system.crossing is not None:
            entries += self._turning(other, c)
        return ca.vertcat(*entries)

    def _turning(self, other: _Stage, c: ca.MX) -> list[ca.MX]:
        """What Coriolis forces add to these entries."""
        system, entries = self._system, []
        assert system.crossing is not None
        cross = ca.DM(system.crossing)
        for group, mine, its in zip(
            system.masses.observables, self._rotation_jacobians, other._rotation_jacobians, strict=True
        ):
            n = len(group.data)
            turned_its = ca.mtimes(ca.DM(system.turned_rows(group)), its)
            function = system.paired(group.kind.sizes[2], mine.shape[1] // n, n)
            entries.append(ca.vec(function(mine, turned_its, c * ca.DM(group.mass.T))))
        if len(system.massive):
            of_mass = system.hung(self._rotation_jacobian, ca.mtimes(cross, other._rotation_jacobian), ca.MX(0), c)
            across = system.hung(ca.mtimes(cross.T, self._rotation_jacobian), other._rotation_jacobian, ca.MX(0), c)
            entries += [of_mass[0], across[1], of_mass[2]]
        return [*entries, c * ca.DM(np.outer(system.place_weights[2], cross.full()).ravel())]
