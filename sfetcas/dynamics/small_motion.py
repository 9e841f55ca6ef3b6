"""Small motions about an equilibrium: the matrices of mass, damping, stiffness and constraints, and their eigenvalues.

The unknowns are those of :class:`~sfetcas.mechanics.equations.Equations`: rotation vectors about the fixed axes,
displacements, multipliers.  With the Jacobian ``J`` of the quantities that carry mass (see
:mod:`~sfetcas.mechanics.observed`) by the unknowns, ``K`` the Newton matrix at the equilibrium and ``G`` the rows,

    J^T m J x'' + (J^T c J + J^T m 2 Omega x J) x' + K x + G^T mu = 0,      G x = 0.

The mass matrix is singular (multipliers, and rotations without inertia, have none), which a shifted and inverted
pencil bears: ``(K - s M)^-1 M`` on the constraints has the eigenvalues ``1 / (omega^2 - s)``.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import TINY, Array, Index
from ..mathematics.constants import sparse
from ..mathematics.linear import SparseMap, SparseSolver, places_of
from ..mathematics.quaternion import cross_matrix
from ..mathematics.spectra import largest
from ..mechanics.batches import GroupBatch
from ..mechanics.equations import turned_points, turned_tangents
from ..mechanics.masses import masses_of
from ..mechanics.terms import rotation_gradient
from ..solvers.prepared import Solved
from .stages import StageEquations

__all__ = ["Eigenmotions", "SmallMotion"]

DUAL_REGULARISATION = 1e-14
"""Dual regularisation of rows that may depend on each other, beside entries of the size of one."""

UNRESISTED = 1e-13
"""Stiffness, over that of the rotation itself, of what neither mass nor stiffness holds, as a straight rod's spin."""

RIGID = 3e-14
"""Squares of frequencies below this share of what was added up, or 3000 times that of the units, are zero.

Rounding leaves a sixtieth of it; the slowest of the reference cases has 1e8 times as much.
"""

DOUBLE = 1e-12
"""As :data:`RIGID`, for exponents that are double zeros, which rounding perturbs by its square root."""

NEARER = 0.5
"""Share of the lowest square of a frequency by which the last shift lies below zero."""

FARTHER = 1e-5
"""Least distance of the shift below zero, as a share of the highest square of a frequency that is wanted.

At a critical point the lowest frequency vanishes, and a shift near it would drown all others.
"""

ATTEMPTS = 6
"""Spaces at most: one to find the size of what is looked for, one with rigid motions beside it, one at the end."""

VANISHING = 1e-13
"""Inverses below this share of the largest are those of motions without mass."""

WAVES = 1e-3
"""Share of an exponent that its imaginary part has to be: exponents crowd where damping stops all waves."""

NOTHING = 1e-4
"""Exponents below this may be zeros, of which two that fall together are known to the root of rounding."""

ROWS_MISSED = 1e-4
"""Share of a shape by which it may miss the rows: they are a little soft in the factors."""

OWN = 1e-5
"""Share of the terms of its equation that an exponent may miss: of those that are converged it is rounding."""

MOST_FREE = 40
"""Zero exponents that are looked for at most."""

ONE_MOTION = 1e-6
"""Shapes of zero exponents that differ by a smaller share, squared, are the same motion."""


@dataclass(frozen=True, eq=False)
class Eigenmotions:
    """Eigensolutions ``x exp(lambda t)`` of the linearised equations of motion, dimensionless.

    Attributes
    ----------
    exponents : ndarray (n,) complex
        The eigenvalues lambda of motions that oscillate, by rising imaginary part.
    shapes : ndarray (unknowns, n)
        Eigenvectors; real where there is neither damping nor rotation of the axes and all loads have a potential.
    rigid : int
        Number of rigid-body modes: motions with mass that no stiffness resists.
    growing : ndarray (k,)
        Positive real eigenvalues, of motions that leave an unstable equilibrium.
    """

    exponents: Array
    shapes: Array
    rigid: int
    growing: Array

    @property
    def omega(self) -> Array:
        """Angular frequencies (n,), dimensionless: imaginary parts of the exponents."""
        return np.asarray(self.exponents.imag)


class SmallMotion:
    """The linearised equations of motion about an equilibrium, dimensionless.

    Parameters
    ----------
    rest : Solved
        Of a model with a displacement at every end of an element, see :func:`~sfetcas.dynamics.modes.put_on`.

    Raises
    ------
    SceneError
        Nothing has mass.
    """

    def __init__(self, rest: Solved) -> None:
        self.rest, self.state, self.loading, self.point = rest, rest.state, rest.loading, rest.point
        self.equations, self.model = rest.equations, rest.model
        self.masses = masses_of(self.model)
        self._system = StageEquations(self.equations, self.masses, "interpreted")
        self.unknowns = self.equations.unknowns
        jacobian = self._jacobian()
        self.mass = _sandwich(jacobian, self._weights("mass"))
        self.damping = _sandwich(jacobian, self._weights("damping"))
        self.gyroscopic = self._gyroscopic(jacobian)

    # -- matrices -------------------------------------------------------------------------------

    @property
    def symmetric(self) -> bool:
        """Whether the stiffness matrix is symmetric: all loads have a potential."""
        return self.model.has_potential

    @property
    def plain(self) -> bool:
        """Whether the eigenvalues are squares of frequencies: there is no damping and no Coriolis force."""
        return not len(self.damping.value) and not len(self.gyroscopic.value)

    @functools.cached_property
    def stiffness(self) -> SparseMap:
        """Tangent stiffness matrix (unknowns, unknowns), without the constraints."""
        return self._part(slice(0, self.unknowns))

    @functools.cached_property
    def constraints(self) -> SparseMap:
        """Jacobian of the constraints, (rows, unknowns)."""
        return self._part(slice(self.unknowns, self.equations.total))

    def _part(self, rows: slice) -> SparseMap:
        equations = self.equations
        chosen = (equations.row >= rows.start) & (equations.row < rows.stop) & (equations.column < self.unknowns)
        row, column = equations.row[chosen] - rows.start, equations.column[chosen]
        return SparseMap(row, column, self.point.entries[chosen], (rows.stop - rows.start, self.unknowns))

    def _jacobian(self) -> ca.DM:
        """Quantities by unknowns."""
        system, model, axes = self._system, self.model, self.model.element.axes
        q = self.state.q
        turned = turned_tangents(model, self.state).reshape(-1, axes)
        # The derivative of a turned vector by a rotation vector is the cross product with it.
        rotation_jacobian = -cross_matrix(turned) if model.space else (turned[:, ::-1] * [-1.0, 1.0])[:, :, None]
        turns = model.element.turns
        points = np.arange(len(turned))
        row = np.broadcast_to((points[:, None] * axes + np.arange(axes))[:, :, None], rotation_jacobian.shape)
        cells = model.rotations.turns.ravel()[:, None] * turns + np.arange(turns)
        column = np.broadcast_to(cells[:, None, :], rotation_jacobian.shape)
        tangents = sparse(row, column, rotation_jacobian, (len(turned) * axes, system.full))
        if model.element.strains:
            tangents += self._strained(system)
        # Displacements of the places stand after the rotations in full coordinates.
        width = axes * system.places
        onto = sparse(np.arange(width), system.of_places + np.arange(width), np.ones(width), (width, system.full))
        parts = [ca.mtimes(system.by_place, onto)]
        if system.elements:
            parts[0] += ca.mtimes(system.by_tangent, tangents)
        for group, sides in zip(self.masses.observables, system.observed, strict=True):
            rows, n = group.kind.sizes[2], len(group.data)
            batch = GroupBatch(model, group, rotation_gradient(group.kind), system.angles_of(group))
            slopes = batch(q, self._nodal, self.state.unwrapped)[5].reshape(n, sides.shape[1], rows)
            r = np.broadcast_to(np.arange(n * rows).reshape(n, 1, rows), slopes.shape)
            c = np.broadcast_to(sides[:, :, None], slopes.shape)
            used = c >= 0
            parts.append(sparse(r[used], c[used], slopes[used], (n * rows, system.full)))
        return ca.mtimes(ca.vertcat(*parts), system.gather.T)[:, : self.unknowns]

    def _strained(self, system: StageEquations) -> ca.DM:
        """Turned tangents of all points by full coordinates, as far as strains change them."""
        model, axes = self.model, self.model.element.axes
        columns = model.beams.compliance.reshape(*model.segments.strains.shape, model.element.yielding, axes)[
            :, :, :axes
        ]
        q = turned_points(model, self.state.q)[:, :, None].repeat(axes, axis=2)
        values = quaternion.turned_by(q, columns).reshape(-1, axes, axes)
        strains = model.segments.strains.ravel()
        row = np.broadcast_to((np.arange(len(strains)) * axes)[:, None, None] + np.arange(axes), values.shape)
        column = np.broadcast_to(
            (system.of_places + axes * strains[:, None] + np.arange(axes))[..., None], values.shape
        )
        used = np.broadcast_to((strains >= 0)[:, None, None], values.shape)
        return sparse(row[used], column[used], values[used], (len(strains) * axes, system.full))

    @functools.cached_property
    def _nodal(self) -> Array:
        nodal = self.equations.places(self.state, self.loading)
        return nodal.reshape(len(self.model.segments.places), -1)

    def _weights(self, what: str) -> ca.DM:
        """Masses or dampers of all quantities."""
        system = self._system
        own = [getattr(group, what).ravel() for group in self.masses.observables]
        linear = system.mass if what == "mass" else system.drag
        return ca.sparsify(ca.diagcat(linear, *[ca.diag(ca.DM(part)) for part in own]))

    def _gyroscopic(self, jacobian: ca.DM) -> SparseMap:
        """Coriolis forces ``J^T m 2 Omega x J`` by velocities, in turning axes."""
        coriolis = self._system.coriolis
        if coriolis is None:
            return SparseMap(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), (self.unknowns, self.unknowns))
        return _sandwich(jacobian, coriolis, -1.0)

    # -- eigenvalues ----------------------------------------------------------------------------

    def eigenmotions(self, count: int, unstable: int = 0) -> Eigenmotions:
        """The lowest ``count`` motions that oscillate; fewer where there are no more.

        Parameters
        ----------
        count : int
        unstable : int
            Number of non-oscillating growing motions that are to be found as well.

        Raises
        ------
        numpy.linalg.LinAlgError
            The eigenvalue problem could not be solved.
        """
        if not self.plain:
            return self._quadratic(count, unstable)
        shift, wanted = -1.0, count + unstable
        for _ in range(ATTEMPTS):
            squares, shapes, exhausted = self._near(shift, wanted)
            rigid = np.abs(squares) <= RIGID * self._added(shapes)
            elastic = squares[~rigid]
            if not exhausted and len(elastic) < count + unstable:
                wanted = count + unstable + int(rigid.sum())
                continue
            if not len(elastic) or shift != -1.0:
                break
            # The nearer the shift to what is looked for the less rounding leaves of it.
            sizes = np.sort(np.abs(elastic))[: count + unstable]
            shift = -NEARER * float(max(sizes[0], FARTHER * sizes[-1]))
        return _sorted(squares, shapes, rigid, count, real=self.symmetric)

    def _near(self, shift: float, wanted: int) -> tuple[Array, Array, bool]:
        """Squares of frequencies nearest to the shift, shapes, and whether there are no more."""
        self._factor(-shift, 0.0)
        n = self.unknowns

        def apply(block: Array) -> Array:
            return self._solved(self.mass @ block)

        inner = self.mass.__matmul__
        inverse, shapes = largest(apply, n, wanted, inner if self.symmetric else None)
        exhausted = len(inverse) < wanted
        found = np.abs(inverse) > VANISHING * np.abs(inverse).max(initial=0.0)
        # Where nothing with mass can move, rounding of the rows is all that is left.
        missed = np.abs(self._missed(shapes)).max(axis=0) if self.equations.rows else np.zeros(len(inverse))
        found &= missed <= ROWS_MISSED * np.abs(shapes).max(axis=0, initial=TINY)
        return shift + 1.0 / inverse[found], shapes[:, found], exhausted or not found.all()

    def _missed(self, shapes: Array) -> Array:
        """What shapes miss the rows by."""
        return self.constraints @ shapes

    def _quadratic(self, count: int, unstable: int) -> Eigenmotions:
        """The same with damping: exponents nearest to a small number above zero."""
        n, shift = self.unknowns, 1.0
        self._factor(shift**2, shift)

        def apply(block: Array) -> Array:
            f, g = block[:n], block[n:]
            moved = self.damping @ f + self.gyroscopic @ f + self.mass @ (shift * f + g)
            x = -self._solved(moved)
            return np.concatenate([x, f + shift * x])

        def pick(inverse: Array) -> tuple[Index, bool]:
            """Waves with the smallest exponents, zeros, and motions that grow; of crowds that fade, none."""
            exponents = _exponents(shift, inverse)
            size = np.abs(exponents)
            waves = np.flatnonzero((exponents.imag > WAVES * size) & (size > NOTHING))
            waves = waves[np.argsort(size[waves], kind="stable")][:count]
            still = np.flatnonzero(size <= NOTHING)[:MOST_FREE]
            grows = (size > NOTHING) & (np.abs(exponents.imag) <= WAVES * size) & (exponents.real > 0.0)
            grows = np.flatnonzero(grows)[np.argsort(size[grows], kind="stable")][:unstable]
            picked = np.concatenate([waves, still, grows])
            return picked, len(waves) == count

        inverse, vectors = largest(apply, 2 * n, count + unstable, pick=pick)
        exponents, shapes = _exponents(shift, inverse), vectors[:n]
        own = self._solve(exponents, shapes)
        exponents, shapes = exponents[own], shapes[:, own]
        rigid = np.abs(exponents) ** 2 <= DOUBLE * self._added(shapes)
        return _sorted_exponents(exponents, shapes, self._independent(shapes[:, rigid]), rigid, count)

    def _solve(self, exponents: Array, shapes: Array) -> Array:
        """Which exponents and shapes solve their own equation: crowds of motions that fade leave others as well."""
        parts = [part @ shapes for part in (self.stiffness, self.mass)]
        damped = self.damping @ shapes + self.gyroscopic @ shapes
        with np.errstate(over="ignore", invalid="ignore"):
            terms = np.array(
                [
                    (shapes.conj() * part).sum(axis=0) * exponents**power
                    for part, power in ((parts[0], 0), (damped, 1), (parts[1], 2))
                ]
            )
            missed = np.abs(terms.sum(axis=0)) / np.maximum(np.abs(terms).sum(axis=0), TINY)
        return (missed < OWN) | (np.abs(exponents) <= NOTHING)

    def _independent(self, shapes: Array) -> int:
        """Number of motions among shapes: one without damping has the exponent zero twice."""
        parts = np.hstack([shapes.real, shapes.imag])
        kinetic = parts.T @ (self.mass @ parts)
        sizes = np.sqrt(np.maximum(np.diag(kinetic), TINY))
        used = sizes > ONE_MOTION * sizes.max(initial=0.0)
        values = np.linalg.eigvalsh((kinetic / np.outer(sizes, sizes))[np.ix_(used, used)])
        return int((values > ONE_MOTION * values.max(initial=0.0)).sum())

    def _added(self, shapes: Array) -> Array:
        """What is added up in squares of frequencies of shapes."""
        sizes = np.abs(shapes)
        added = (sizes * (self.stiffness.absolute @ sizes)).sum(axis=0)
        kinetic = (shapes.conj() * (self.mass @ shapes)).sum(axis=0).real
        return np.asarray(3000.0 + added / np.maximum(kinetic, TINY))

    def _factor(self, mass: float, damping: float) -> None:
        """Factors of ``K + damping C + mass M`` with the rows."""
        where, k, m, c = self._entries
        solver, diagonal = where
        entries = k + mass * m + damping * c
        entries[diagonal[: self.unknowns]] += UNRESISTED * self.equations.noise[: self.unknowns]
        # Beside rows of the size of one: loads may make the stiffness as large as any number.
        self._size = float(np.abs(entries[self._inside]).max(initial=TINY))
        entries[self._inside] /= self._size
        entries[diagonal[self.unknowns :]] -= DUAL_REGULARISATION
        solver.factor(entries)

    def _solved(self, block: Array) -> Array:
        rows = np.zeros((self.equations.rows, block.shape[1]))
        right = np.concatenate([block / self._size, rows])
        return np.asarray(self._entries[0][0].solve(right)[: self.unknowns])

    @functools.cached_property
    def _entries(self) -> tuple[tuple[SparseSolver, Index], Array, Array, Array]:
        """A solver of the pattern of all matrices, its diagonal, and the entries of each in that pattern."""
        equations, total = self.equations, self.equations.total
        flat = [
            column * total + row
            for row, column in (
                (equations.row, equations.column),
                (self.mass.row, self.mass.column),
                (self.damping.row, self.damping.column),
                (self.gyroscopic.row, self.gyroscopic.column),
            )
        ]
        places = np.unique(np.concatenate(flat))
        row, column = places % total, places // total
        values = (self.point.entries, self.mass.value, self.damping.value, self.gyroscopic.value)
        found = []
        for part, value in zip(flat, values, strict=True):
            entries = np.zeros(len(places))
            entries[np.searchsorted(places, part)] = value
            found.append(entries)
        self._inside = np.flatnonzero((row < self.unknowns) & (column < self.unknowns))
        solver = SparseSolver(
            total, row, column, equations.rows, symmetric=self.symmetric and self.model.rotating_frame is None
        )
        return (solver, np.flatnonzero(row == column)), found[0], found[1], found[2] + found[3]


def _sorted(squares: Array, shapes: Array, rigid: Array, count: int, *, real: bool) -> Eigenmotions:
    """Eigenmotions of squares of frequencies: of what is unsymmetric these may be complex, one way growing."""
    squares = np.where(np.abs(squares.imag) <= tolerances.REAL * np.abs(squares), squares.real, squares)
    grows = ~rigid & (squares.imag == 0.0) & (squares.real < 0.0)
    waves = np.flatnonzero(~rigid & ~grows)
    exponents = 1j * np.sqrt(squares[waves].astype(complex))
    exponents = np.where(exponents.imag < 0.0, -exponents, exponents)
    order = np.argsort(exponents.imag, kind="stable")[:count]
    shapes = shapes[:, waves[order]]
    growing = np.sort(np.sqrt(-squares[grows].real))
    return Eigenmotions(exponents[order], shapes.real if real else shapes, int(rigid.sum()), growing)


def _exponents(shift: float, inverse: Array) -> Array:
    """Exponents of eigenvalues of the inverse; those of what has no mass lie beyond all numbers."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = shift + 1.0 / inverse.astype(complex)
    return np.where(np.abs(inverse) > VANISHING * np.abs(inverse).max(initial=0.0), found, -1.0 / VANISHING)


def _sorted_exponents(exponents: Array, shapes: Array, free: int, rigid: Array, count: int) -> Eigenmotions:
    """Eigenmotions of the exponents themselves, of which ``free`` motions have zeros."""
    size = np.abs(exponents)
    waves = np.flatnonzero(~rigid & (exponents.imag > WAVES * size))
    order = waves[np.argsort(exponents[waves].imag, kind="stable")][:count]
    alone = np.sort(exponents[~rigid & (np.abs(exponents.imag) <= WAVES * size)].real)
    return Eigenmotions(exponents[order], shapes[:, order], free, alone[alone > 0.0])


def _sandwich(jacobian: ca.DM, weights: ca.DM, sign: float = 1.0) -> SparseMap:
    """``J^T m J``, exactly symmetric, or skew with the sign -1."""
    found = ca.mtimes(jacobian.T, ca.mtimes(weights, jacobian))
    (row, column), value = places_of(found.sparsity()), 0.5 * np.array(found.nonzeros())
    return SparseMap(np.append(row, column), np.append(column, row), np.append(value, sign * value), found.shape)
