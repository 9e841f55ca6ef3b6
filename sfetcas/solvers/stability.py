"""Stability of an equilibrium: inertia of the energy on the closings, smallest eigenvalue, unstable mode.

With ``H`` the second derivative of the Lagrangian by rotations, ``A`` the Jacobian of the closings and ``M`` a diagonal
weight, the eigenvalues ``mu`` of ``H x = mu M x`` on the null space of ``A`` decide: all above zero is a strict minimum
of the potential, along the eigenvector of one below zero the potential falls.  They are counted through Sylvester's law
of inertia: the negative eigenvalues of ``H - sigma M`` less those of the Schur complement
``A (H - sigma M)^-1 A^T``.

The weight of a rotation is the length of member at it times the smallest ratio of stiffness to squared length of all
members: the eigenvalues are pure numbers, of the size of one for modes of the softest member.

Places at which members touch each other are unknowns in which the Lagrangian is largest, not least: of all places the
worst one must not penetrate.  Each adds a negative eigenvalue, which is left out of all counts; with the places
eliminated the others have the signs of the energy of what moves (Haynsworth's additivity of inertia).

Under pressure that has a potential, as even pressure on a closed ring, the Newton matrix is symmetric but for errors of
the mesh; its symmetric part is taken, whose eigenvalues are those of the energy to second order in these errors.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.core import Counting
from ..mathematics.linear import BLURRED, MISSES, InertiaSolver, Product, SparseSolver, blurred
from ..mechanics.equations import Equations, Point
from ..mechanics.evaluation import BLOCK
from .redundancy import independent
from .sides import Sides, alike

__all__ = ["ENTRIES_BLUR", "LIGHT", "Inertia", "Stability", "StabilityTest"]

ENTRIES_BLUR = 2e-15
"""Eigenvalues that rounding of the matrix leaves, share of its largest weighted entry; added to ``NEUTRAL``."""

GRADED = 1e-5
"""Limit of zero eigenvalues, dimensionless, above which rounding is estimated for each mode by itself.

Larger limits come from members that are very short or stiff beside others.
"""

DENSE = 120
"""Up to this many unknowns all eigenvalues by LAPACK are cheaper than factorisations (measured)."""


@dataclass(frozen=True)
class Inertia:
    """Numbers of negative eigenvalues, and of those that are zero to rounding."""

    negative: int
    zero: int


@dataclass(frozen=True)
class Stability:
    """Result of the test.

    Attributes
    ----------
    stable : bool, "neutral", or "not defined" for loads without potential
    negative : int
        Number of negative eigenvalues: independent directions in which the potential falls.
    smallest : float
        Smallest eigenvalue by :attr:`.Equations.mass`, dimensionless; inf if nothing can move, nan if not computed.
    shape : ndarray (rotation unknowns,)
        Eigenvector of the smallest eigenvalue (the unstable mode), largest entry 1 rad, with the sign that
        :mod:`~sfetcas.solvers.sides` chooses.
    travel : ndarray (displacement unknowns,)
        The displacements in it, dimensionless.
    limit : float
        Size up to which its eigenvalue ``mu`` of the module's docstring counts as zero.
    """

    stable: bool | str
    negative: int
    smallest: float
    shape: Array
    travel: Array
    limit: float = field(default_factory=lambda: tolerances.NEUTRAL)

    @property
    def hidden(self) -> bool:
        """Whether it is called neutral because of rounding of stiff members, not because of a flat energy."""
        return self.stable == "neutral" and self.limit > GRADED


class StabilityTest:
    """The test for one model, prepared for repeated use."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        # Displacements that springs and bodies act upon are unknowns as rotations are; others follow from the closings.
        self._chosen = np.concatenate([np.arange(equations.rotation_unknowns), equations.worked_displacements])
        self._n = n = len(self._chosen)
        place = np.full(equations.total, -1, dtype=np.intp)
        place[self._chosen] = np.arange(n)
        row, column = place[equations.row], place[equations.column]
        self._in_h = np.flatnonzero((row >= 0) & (column >= 0))
        self._h_row, self._h_column = row[self._in_h], column[self._in_h]
        self._in_a = np.flatnonzero((equations.row >= equations.unknowns) & (column >= 0))
        self._a_column = column[self._in_a]
        self._diagonal = np.flatnonzero(self._h_row == self._h_column)
        self._apart = equations.model.mesh.sliding

    @functools.cached_property
    def _combine(self) -> Array:
        return _left_null_space(self.equations)

    @functools.cached_property
    def weight(self) -> Array:
        """The weight M of the module's docstring, (rotation unknowns,)."""
        return self.equations.mass * self.softest

    @functools.cached_property
    def _weights(self) -> Array:
        """Weight (n,) of rotation unknowns and, very small, of the displacements that springs and bodies act upon."""
        count = len(self.equations.worked_displacements)
        return np.concatenate([self.weight, np.full(count, LIGHT * self.softest)])

    @functools.cached_property
    def _masses(self) -> Array:
        return np.concatenate([self.equations.mass, np.full(len(self.equations.worked_displacements), LIGHT)])

    @functools.cached_property
    def softest(self) -> float:
        """Smallest ratio of stiffness (bending, torsion) to squared length of all members, dimensionless.

        It is the ratio of :attr:`weight` to :attr:`.Equations.mass`.
        """
        model = self.equations.model
        x, softest = np.linspace(0.0, 1.0, 5), np.inf
        for name, member in model.scene.members.items():
            line = model.scene.center_lines[name]
            if member.section is None or member.type == "rigid":
                continue
            values = model.scene.sections[str(member.section)].stiffness(x)
            values = values if model.space else values[:, [1 if line.bending_axis == 2 else 2]]
            softest = min(softest, float(np.nanmin(values)) / line.length**2)
        softest = softest if np.isfinite(softest) else model.scales.moment / model.scales.length
        return softest / model.scales.moment * model.scales.length

    def _rows(self, point: Point) -> Array:
        """Weighted Jacobian (rows, n) of the independent closings, displacements without stiffness eliminated."""
        equations = self.equations
        if not equations.rows:
            return np.zeros((0, self._n))
        rows = np.zeros((equations.rows, self._n))
        rows[equations.row[self._in_a] - equations.unknowns, self._a_column] = point.entries[self._in_a]
        return (independent(equations, point, self._combine).T @ rows) / np.sqrt(self._weights)

    def _weighted(self, point: Point) -> Array:
        root = np.sqrt(self._weights)
        return np.asarray(point.entries[self._in_h] / (root[self._h_row] * root[self._h_column]))

    def test(self, point: Point) -> Stability:
        """Inertia, smallest eigenvalue and its mode at an equilibrium."""
        equations, point = self.equations, self.equations.symmetric(point)
        rotation_unknowns, nothing = equations.rotation_unknowns, np.zeros(equations.displacement_unknowns)
        if self._n == 0:
            return Stability(True, 0, np.inf, np.zeros(0), nothing)
        entries = self._weighted(point)
        limit = self._limit(entries)
        if self._is_graded(limit):
            values, vectors, negative, limit = self._most_doubtful(point, entries)
        else:
            found = self._lowest(point, limit) if self._is_dense else self._sparse(point, entries, limit)
            values, vectors, negative = found or self._dense(point, entries, limit)
        if not len(values):
            return Stability(True, 0, np.inf, np.zeros(rotation_unknowns), nothing)
        stable: bool | str = bool(values[0] > limit)
        if negative == 0 and not stable:
            stable = "neutral"
        shape = self.sides.taken(vectors / np.sqrt(self._weights)[:, None], self._weights)
        quotient = float(values[0]) / float(shape @ (self._masses * shape))
        turned = shape[:rotation_unknowns] if np.abs(shape[:rotation_unknowns]).max(initial=0.0) > 0.0 else shape
        shape = shape / np.abs(turned).max()
        travel = nothing.copy()
        travel[equations.worked_displacements - rotation_unknowns] = shape[rotation_unknowns:]
        return Stability(stable, negative, quotient, shape[:rotation_unknowns], travel, limit)

    @functools.cached_property
    def sides(self) -> Sides:
        """The rule for signs of eigenvectors and for vectors of equal eigenvalues."""
        return Sides(self.equations, self.equations.worked_displacements)

    def _all(self, point: Point, entries: Array, limit: float) -> tuple[Array, Array | float] | None:
        """All eigenvalues (n,) and the limits up to which they count as zero; None if they are counted by factors."""
        if self._is_graded(limit):
            values, _, limits = self._mode_by_mode(point, entries)
            return values, limits
        if self._is_dense:
            return np.linalg.eigvalsh(self._projected(entries, self._rows(point))[0])[self._apart :], limit
        return None

    def negative(self, point: Point) -> int:
        """Number of negative eigenvalues alone, at a fraction of the cost of :meth:`test`."""
        point = self.equations.symmetric(point)
        clear = self._clearly_negative(point.entries)
        if clear is not None:
            return clear
        entries = self._weighted(point)
        limit = self._limit(entries)
        known = self._all(point, entries, limit)
        if known is None:
            return self._below(point, entries, -limit)
        return int((known[0] < -known[1]).sum())

    def depth(self, point: Point, near: float = 0.0) -> float:
        """Minus the lowest eigenvalue by :attr:`.Equations.mass`, dimensionless; zero if none is negative.

        In large models a bound of it by the signs of pivots alone; the search begins at ``near``, an earlier value.
        """
        if self._n == 0:
            return 0.0
        point = self.equations.symmetric(point)
        entries = self._weighted(point)
        limit = self._limit(entries)
        known = self._all(point, entries, limit)
        if known is not None:
            values, limits = known
            return -float(values[0]) * self.softest if (values < -limits).any() else 0.0
        if not self._below(point, entries, -limit):
            return 0.0
        deep = max(near / self.softest / DEEPER, limit)
        while deep < LOWEST and self._below(point, entries, -deep):
            deep *= DEEPER
        return deep * self.softest

    @staticmethod
    def _limit(entries: Array) -> float:
        """Size of eigenvalues up to which they count as zero, whatever their mode."""
        return tolerances.NEUTRAL + ENTRIES_BLUR * float(np.abs(entries).max())

    def _is_graded(self, limit: float) -> bool:
        return limit > GRADED and self._n <= FULL

    def _most_doubtful(self, point: Point, entries: Array) -> tuple[Array, Array, int, float]:
        """Eigenvalues from the lowest one over its own limit on, its vector, the number of negative ones, its limit."""
        values, vectors, limits = self._mode_by_mode(point, entries)
        if not len(values):
            return values, vectors, 0, tolerances.NEUTRAL
        lowest = int(np.argmin(values / limits))
        return values[lowest:], vectors[:, [lowest]], int((values < -limits).sum()), float(limits[lowest])

    def _mode_by_mode(self, point: Point, entries: Array) -> tuple[Array, Array, Array]:
        """All eigenvalues (n,), rising, their vectors as columns, and the limits (n,) up to which they are rounding.

        Rounding of an entry is relative to that entry, not to the largest one, so that modes which do not bend stiff
        members have small limits.  With its diagonal scaled to ones the matrix keeps this accuracy.
        """
        size = np.abs(entries)
        scale = 1.0 / np.sqrt(size[self._diagonal] + 1.0)
        scaled = entries * scale[self._h_row] * scale[self._h_column]
        h, basis = self._projected(scaled, self._rows(point) * scale)
        mass = basis.T @ (scale[:, None] ** 2 * basis)
        shift = -1.0
        while shift > -LOWEST:
            try:
                root = np.linalg.cholesky(h - shift * mass)
                break
            except np.linalg.LinAlgError:
                shift *= 8.0
        else:
            raise SolveError(Status.FAILED, "stiffness on the closings that has no bound, of a state far from rest")
        half = np.linalg.solve(root, mass)
        inverse = np.linalg.solve(root, half.T)
        found, vectors = np.linalg.eigh(0.5 * (inverse + inverse.T))
        values = (shift + 1.0 / np.maximum(found[::-1], 1.0 / LOWEST))[self._apart :]
        vectors = scale[:, None] * (basis @ np.linalg.solve(root.T, vectors[:, ::-1]))[:, self._apart :]
        vectors = vectors / np.linalg.norm(vectors, axis=0)
        rounding = blurred(self._h_row, self._h_column, entries, vectors)
        return values, vectors, tolerances.NEUTRAL + rounding + ENTRIES_BLUR * abs(shift)

    @property
    def _is_dense(self) -> bool:
        # Displacements without stiffness of their own make the sparse factorisation without pivots break down.
        return self._n <= (DENSE_WITH_TRAVEL if len(self.equations.worked_displacements) else DENSE)

    def spectrum(self, point: Point, count: int) -> tuple[Array, Array]:
        """All eigenvalues (n,), dimensionless, 0 for neutral ones, and the lowest modes.

        Modes are rows (count or fewer, rotation unknowns), largest entry 1 rad.
        """
        point = self.equations.symmetric(point)
        entries, rows = self._weighted(point), self._rows(point)
        projected, basis = self._projected(entries, rows)
        values, vectors = np.linalg.eigh(projected)
        rotation_unknowns, root = self.equations.rotation_unknowns, np.sqrt(self._weights)[:, None]
        # All modes that share the eigenvalue of the last one are needed to choose it by the rule of sides.
        most = min(count, len(values))
        most += alike(values[most - 1 :]) - 1 if most else 0
        shapes = self.sides.in_groups(values[:most], basis @ vectors[:, :most] / root, self._weights)
        shapes = shapes[:rotation_unknowns, :count].T
        limit = tolerances.NEUTRAL + ENTRIES_BLUR * float(np.abs(entries).max(initial=0.0))
        return np.where(np.abs(values) <= limit, 0.0, values), shapes / np.abs(shapes).max(axis=1, keepdims=True)

    def inertia(self, point: Point, *, doubtful: bool = True) -> Inertia:
        """Numbers of negative and of zero eigenvalues alone; in large models the latter only if ``doubtful``."""
        point = self.equations.symmetric(point)
        clear = self._clearly_negative(point.entries)
        if clear is not None:
            return Inertia(clear, 0)
        entries = self._weighted(point)
        limit = self._limit(entries)
        if self._is_bordered and self._n > DENSE and not self._is_graded(limit):
            found = self._counted_apart(point, entries, limit)
            if found is not None:
                return found
        known = self._all(point, entries, limit)
        if known is None:
            below = self._below(point, entries, -limit)
            return Inertia(below, 0) if not doubtful else Inertia(below, self._below(point, entries, limit) - below)
        values, limits = known
        below = int((values < -limits).sum())
        return Inertia(below, int((values <= limits).sum()) - below)

    def around_zero(self, point: Point, *, sharp: bool = True) -> tuple[int, Array, Array]:
        """Eigenvalues around zero, dimensionless, with the number of smaller ones and their modes.

        Returns
        -------
        int
            Number of eigenvalues below the first listed, those of places left out; -1 if not counted.
        ndarray (n,)
            Eigenvalues, rising: in small models all, in large ones the ``NEAREST`` to zero.
        ndarray (rotation unknowns, n)
            Modes as columns, rad.

        In large models ``sharp`` iterates until the modes are accurate, and does not count; otherwise eigenvalues are
        accurate to a millionth of themselves or to rounding, and smaller ones are counted.
        """
        point = self.equations.symmetric(point)
        entries, turning = self._weighted(point), self.equations.rotation_unknowns
        root = np.sqrt(self._weights)[:, None]
        if self._is_dense:
            projected, basis = self._projected(entries, self._rows(point))
            values, vectors = np.linalg.eigh(projected)
            return -self._apart, values, (basis @ vectors / root)[:turning]
        values, vectors = self._inverse_iterated(point, entries, sharp=sharp)
        size, before = float(np.abs(values).max()), -1
        if not sharp:
            # A count by factors is unreliable beside a neutral mode: below all listed, or well away from zero.
            apart = size >= CLEAR_OF_ZERO and values[0] > -CLEAR_OF_ZERO
            before = self._below(point, entries, -CLEAR_OF_ZERO if apart else float(values[0] - 1e-6 * size))
        return before, values, (vectors / root)[:turning]

    def _projected(self, entries: Array, rows: Array) -> tuple[Array, Array]:
        """The dense matrix on the null space of the rows, and an orthonormal basis of that space as columns."""
        h = np.zeros((self._n, self._n))
        h[self._h_row, self._h_column] = entries
        if not len(rows):
            return h, np.eye(self._n)
        basis = np.linalg.qr(rows.T, mode="complete")[0][:, len(rows) :]
        return basis.T @ h @ basis, basis

    def _lowest(self, point: Point, limit: float) -> tuple[Array, Array, int] | None:
        """The lowest eigenvalues and vectors by the core, of a stable state; None where it is none, or not found.

        Where more eigenvalues may be alike than the core finds at once all of them are computed.
        """
        if self.counting is None or self._n - self.equations.rows < 2 * BLOCK:
            return None
        if self._clearly_negative(point.entries) != 0:
            return None
        found = self.equations.lowest(point.entries, self.counting[1], -limit, SETTLED, DUAL)
        if found is None or alike(found[0]) == BLOCK:
            return None
        values, vectors = found
        return values, np.sqrt(self._weights)[:, None] * vectors[: alike(values), self._chosen].T, 0

    def _dense(self, point: Point, entries: Array, limit: float) -> tuple[Array, Array, int]:
        projected, basis = self._projected(entries, self._rows(point))
        values, vectors = (part[..., self._apart :] for part in np.linalg.eigh(projected))
        if not len(values):
            return values, basis, 0
        return values, basis @ vectors[:, : alike(values)], int((values < -limit).sum())

    def _sparse(self, point: Point, entries: Array, limit: float) -> tuple[Array, Array, int]:
        negative = self._below(point, entries, -limit)
        shift = -limit
        while negative and self._below(point, entries, shift) > 0:
            shift *= 8.0 if shift < -0.1 else 1000.0
        values, vectors = self._subspace(point, entries, shift)
        vectors = vectors[:, : alike(values)]
        if negative == 0 and values[0] < -limit:
            values[0] = -limit
        return values, vectors, negative

    @property
    def _is_bordered(self) -> bool:
        return self.equations.rows > MANY_ROWS or bool(len(self.equations.worked_displacements))

    def _counted_apart(self, point: Point, entries: Array, limit: float) -> Inertia | None:
        """The inertia by counts away from zero, and by eigenvalues between these; None if the two disagree.

        At zero itself a neutral direction leaves no digits in the factors of the bordered matrix.
        """
        low, high = (
            self._from_factors(point, shift, (BORDER_REGULARISATION,)) for shift in (-CLEAR_OF_ZERO, CLEAR_OF_ZERO)
        )
        if low is None or high is None or limit > 0.1 * CLEAR_OF_ZERO or high - low > NEAREST:
            return None
        if low == high:
            return Inertia(low, 0)
        values = self._inverse_iterated(point, entries, sharp=False)[0]
        values = values[np.abs(values) < CLEAR_OF_ZERO]
        if len(values) != high - low:
            return None
        return Inertia(low + int((values < -limit).sum()), int((np.abs(values) <= limit).sum()))

    def _below(self, point: Point, entries: Array, shift: float) -> int:
        """Number of eigenvalues on the null space of the rows below the shift."""
        if self._is_bordered:
            return self._below_bordered(point, shift)
        rows = self._rows(point)
        shifted = entries.copy()
        shifted[self._diagonal] -= shift
        self._ldl.factor(shifted)
        if not len(rows):
            return self._ldl.negative() - self._apart
        schur = rows @ self._ldl.solve(rows.T)
        values = np.linalg.eigvalsh(0.5 * (schur + schur.T))
        return self._ldl.negative() - int((values < 0.0).sum()) - self._apart

    def _below_bordered(self, point: Point, shift: float) -> int:
        """As :meth:`_below` from the whole Newton matrix with a slight primal and dual regularisation.

        Each row of the closings adds a negative eigenvalue.  The regularisation changes an eigenvalue by its share of
        the stiffness, rounding by the inverse of it: both stay below a millionth.
        """
        # Without pivoting the factors break down for displacements between two slides, or between many rigid members.
        # Models too large for dense matrices are then counted with more regularisation.
        found = self._from_factors(
            point, shift, (BORDER_REGULARISATION,) if self._n <= FULL else BORDER_REGULARISATIONS
        )
        return self._below_dense(point, shift) if found is None else found

    def _from_factors(self, point: Point, shift: float, regularisations: tuple[float, ...]) -> int | None:
        """As :meth:`_below_bordered` with the first regularisation whose factors are accurate; None if none is."""
        equations = self.equations
        entries, diagonal = point.entries.copy(), equations.diagonal
        entries[diagonal[self._chosen]] -= shift * self._weights
        size = float(np.abs(entries[diagonal[: equations.rotation_unknowns]]).max(initial=1.0))
        for regularisation in regularisations:
            regularised = entries.copy()
            regularised[diagonal[equations.rotation_unknowns : equations.unknowns]] += regularisation * self.softest
            regularised[diagonal[equations.unknowns :]] -= regularisation / size
            try:
                self._bordered.factor(regularised)
                missed = self._bordered.missed()
            except np.linalg.LinAlgError:
                continue
            if missed < BROKEN:
                return self._bordered.negative() - equations.rows - self._apart
        return None

    def _below_dense(self, point: Point, shift: float) -> int:
        values = np.linalg.eigvalsh(self._projected(self._weighted(point), self._rows(point))[0])
        return int((values[self._apart :] < shift).sum())

    def _clearly_negative(self, entries: Array) -> int | None:
        """Number of negative eigenvalues where the core tells it and none is near zero; see :meth:`counting`."""
        if self._n == 0:
            return 0
        if self.equations.rows and self.equations.redundant:
            return None
        return None if self.counting is None else self.equations.clearly_negative(entries, self.counting[0])

    @property
    def is_held(self) -> bool:
        """Whether clearly nothing of the undeformed structure can move without strain; False where the core does not
        tell.

        Nor where displacements have no stiffness of their own: whether closings determine them it does not know.
        """
        known = self._n == self.equations.unknowns and self.counting is not None
        return known and self._clearly_negative(self.equations.undeformed_entries) == 0

    @functools.cached_property
    def counting(self) -> tuple[Counting, Array] | None:
        """How the core tells that all eigenvalues are above ``CLEAR_OF_ZERO``, and an array that lives as long.

        None without a core, for loads without potential, and where there is a place that slides, whose negative
        eigenvalue does not count.
        """
        if self._apart or not self.equations.by_core or not self.equations.model.has_potential:
            return None
        weight = np.zeros(self.equations.total)
        weight[self._chosen] = self._weights
        found = Counting(
            weight=weight.ctypes.data,
            shift=CLEAR_OF_ZERO,
            softest=self.softest,
            soft=BORDER_REGULARISATION,
            rounding=ENTRIES_BLUR,
            graded=GRADED,
            broken=BROKEN,
            blurred=BLURRED,
            signs=SIGNS,
            rounds=MISSES,
        )
        return found, weight

    @functools.cached_property
    def _bordered(self) -> InertiaSolver:
        return InertiaSolver(self.equations.total, self.equations.row, self.equations.column)

    @functools.cached_property
    def _ldl(self) -> InertiaSolver:
        return InertiaSolver(self._n, self._h_row, self._h_column)

    @functools.cached_property
    def _times(self) -> Product:
        """The product of the weighted matrix with a block of vectors (n, k)."""
        return Product(self._n, self._h_row, self._h_column)

    def _subspace(self, point: Point, entries: Array, shift: float) -> tuple[Array, Array]:
        """Smallest eigenvalues (k,) above the shift and their vectors (n, k), by inverse iteration of a subspace.

        The shifted Newton matrix keeps the vectors on the closings; it is as sparse as that of a solve.
        """
        equations, n = self.equations, self._n
        root = np.sqrt(self._weights)[:, None]
        block = np.random.default_rng(0).standard_normal((n, min(4, n)))
        loads = np.zeros((equations.total, block.shape[1]))
        smallest = np.array([np.inf])
        for count in range(60):
            loads[self._chosen] = root * block
            block = np.linalg.qr(root * self._solved(point, shift, loads)[self._chosen])[0]
            product = self._times(entries, block)
            new, turn = np.linalg.eigh(block.T @ product)
            block = block @ turn
            if abs(new[0] - smallest[0]) <= 1e-7 * max(abs(new[0]), abs(shift)):
                return new, block
            smallest = new
            if count >= 2:
                # Each solve factorises anyway: a nearer shift is free and converges ten times as fast.
                shift = new[0] - 0.1 * (new[-1] - new[0]) - 1e-3 * abs(new[0])
        return smallest, block

    @functools.cached_property
    def _solver(self) -> SparseSolver:
        equations = self.equations
        if equations.model.has_potential:
            return equations.solver
        return SparseSolver(equations.total, equations.row, equations.column, equations.rows)

    def _solved(self, point: Point, shift: float, loads: Array) -> Array:
        """Solution (total, k) with the shifted Newton matrix, with dual regularisation for redundant rows."""
        equations = self.equations
        for dual in (DUAL, 1e-12, 1e-10):
            shifted = point.entries.copy()
            shifted[equations.diagonal[self._chosen]] -= shift * self._weights
            shifted[equations.diagonal[equations.unknowns :]] -= dual
            self._solver.factor(shifted)
            try:
                return np.asarray(self._solver.solve(loads))
            except np.linalg.LinAlgError:
                continue
        raise SolveError(Status.FAILED, "the tangent stays singular however it is shifted")

    def _inverse_iterated(self, point: Point, entries: Array, *, sharp: bool) -> tuple[Array, Array]:
        """The ``NEAREST`` eigenvalues to zero, rising, and their vectors as columns, by inverse iteration."""
        equations, n = self.equations, self._n
        root, width = np.sqrt(self._weights)[:, None], min(2 * NEAREST, n)
        block = np.random.default_rng(0).standard_normal((n, width))
        loads, last = np.zeros((equations.total, width)), np.full(min(NEAREST, width), np.inf)
        shifted = point.entries.copy()
        shifted[equations.diagonal[self._chosen]] += SHIFT * self._weights
        shifted[equations.diagonal[equations.unknowns :]] -= DUAL
        self._solver.factor(shifted)
        for _ in range(60):
            loads[self._chosen] = root * block
            block = np.linalg.qr(root * self._solver.solve(loads)[self._chosen])[0]
            product = self._times(entries, block)
            values, turn = np.linalg.eigh(block.T @ product)
            block = block @ turn
            nearest = np.sort(np.argsort(np.abs(values))[:NEAREST])
            size = np.abs(values[nearest])
            if (np.abs(values[nearest] - last) <= (1e-10 * size.max() if sharp else 1e-6 * size + 1e-10)).all():
                break
            last = values[nearest]
        return values[nearest], block[:, nearest]


SETTLED = 1e-12
"""Change of the lowest eigenvalues, share of them, at which the core has found them."""

DUAL = 1e-14
"""Dual regularisation of inverse iteration, for redundant rows."""

DEEPER = 4.0
"""Factor by which the bound of :meth:`StabilityTest.depth` grows until no eigenvalue is below it."""

LOWEST = 1e30
"""Size of negative eigenvalues, dimensionless, at which the search for a bound ends."""

SHIFT = 1.3e-4
"""Minus the shift of inverse iteration around zero, dimensionless: at zero neutral directions would hide all others."""

CLEAR_OF_ZERO = 1e-4
"""Distance from zero at which factors of the bordered matrix count eigenvalues; their error is a hundredth of it."""

NEAREST = 4
"""Number of eigenvalues computed around zero in large models: in space two may vanish at once."""

DENSE_WITH_TRAVEL = 500
"""Value of :data:`DENSE` for models in which displacement unknowns have stiffness."""

MANY_ROWS = 150
"""Number of closings above which their dense Schur complement costs more than the bordered matrix (measured)."""

LIGHT = 1e-3
"""Mass of a displacement unknown, dimensionless, beside that of rotations, the length of member over the scale."""

BORDER_REGULARISATION = 1e-9
"""Regularisation of the bordered matrix: dual of closings, primal of displacements, beside the rest."""

BORDER_REGULARISATIONS = (BORDER_REGULARISATION, 10.0 * BORDER_REGULARISATION, 100.0 * BORDER_REGULARISATION)
"""Regularisations that are tried one after the other in models too large for dense matrices."""

FULL = 600
"""Largest number of unknowns for which dense matrices take less than a second."""

SIGNS = 1e-11
"""Least share of what was added up for a pivot that is left of it where its sign is told: rounding leaves 1e-16 times
the number of terms, rows that depend on each other 1e-12, eigenvalues away from zero 1e-8."""

BROKEN = 0.3
"""Share of the bordered matrix that its factors may miss: from 1 on pivots may have other signs."""


def _left_null_space(equations: Equations) -> Array:
    """Orthonormal combinations (rows, n) of the rows in which no displacement without stiffness appears."""
    w = np.zeros((equations.rows, equations.displacement_unknowns))
    w[: len(equations.model.positions.rows)] = equations.model.positions.W.full()
    w = np.delete(w, equations.worked_displacements - equations.rotation_unknowns, axis=1)
    if not w.shape[1]:
        return np.eye(equations.rows)
    left, sizes, _ = np.linalg.svd(w)
    rank = int((sizes > tolerances.RANK * sizes.max(initial=0.0)).sum())
    return np.asarray(left[:, rank:])
