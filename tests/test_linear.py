"""Sparse systems against LAPACK: with few constraints, with many, and where softness or missing pivots would harm."""

import numpy as np
import pytest

from sfetcas.mathematics import linear
from sfetcas.mathematics.core import core
from sfetcas.mathematics.linear import InertiaSolver, SparseSolver


def frame(seed, n=240, rows=80):
    """A bordered matrix as nets have it: banded stiffness, unknowns without any, sparse constraints; full."""
    rng = np.random.default_rng(seed)
    matrix = np.zeros((n + rows, n + rows))
    for i in range(n - 40):
        k = slice(i, min(i + 4, n - 40))
        part = rng.normal(size=(k.stop - i, k.stop - i))
        matrix[k, k] += part @ part.T
    for i in range(rows):
        # the last unknowns are displacements: nothing but constraints holds them
        touched = np.append(rng.choice(n - 40, 3, replace=False), n - 40 + i % 40)
        matrix[n + i, touched] = rng.normal(size=4)
        matrix[touched, n + i] = matrix[n + i, touched]
    return matrix


def solver_of(matrix, **options):
    """The solver with the pattern of a matrix, its whole diagonal in it, and the entries."""
    column, row = np.nonzero((matrix != 0.0).T | np.eye(len(matrix), dtype=bool))
    return SparseSolver(len(matrix), row, column, **options), matrix[row, column]


def residual(matrix, x, b):
    """Relative to matrix times solution."""
    return np.abs(matrix @ x - b).max() / (np.abs(matrix).max() * np.abs(x).max())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("few", [False, True])
def test_bordered_systems_are_solved_to_rounding(seed, few, monkeypatch):
    monkeypatch.setattr(linear, "FEW_ROWS", 1000 if few else 12)
    matrix = frame(seed)
    solver, entries = solver_of(matrix, rows=80)
    solver.factor(entries)
    for shape in ((320,), (320, 3)):
        b = np.random.default_rng(seed).normal(size=shape)
        x = solver.solve(b)
        assert x.shape == shape
        # csparse takes pivots down to 1e-8 of their column and loses digits by that
        assert residual(matrix, x, b) < (1e-10 if few else 1e-15)
        assert np.abs(x - np.linalg.solve(matrix, b)).max() < 1e-7 * np.abs(x).max()


def test_what_refinement_does_not_reach_is_solved_with_pivots(monkeypatch):
    """Two nearly equal constraints: the softness is as large as what tells them apart."""
    matrix = frame(0)
    matrix[-1], matrix[:, -1] = matrix[-2], matrix[:, -2]
    matrix[-1, :3] += 1e-6
    matrix[:3, -1] += 1e-6
    solver, entries = solver_of(matrix, rows=80)
    solver.factor(entries)
    b = np.random.default_rng(1).normal(size=320)
    soft = solver._matrix.copy()
    soft[solver._sparse.diagonal] += solver._sides
    _, error = solver._refined(solver._sparse.without_pivots, soft, b[:, None])
    assert error > linear.SOLVED
    assert residual(matrix, solver.solve(b), b) < 1e-15


def test_matrices_need_not_be_symmetric():
    matrix = frame(2)
    matrix[:50, 100:150] += np.diag(np.random.default_rng(3).normal(size=50))
    solver, entries = solver_of(matrix, rows=80, symmetric=False)
    solver.factor(entries)
    b = np.random.default_rng(4).normal(size=320)
    assert residual(matrix, solver.solve(b), b) < 1e-15


@pytest.mark.parametrize("rows", [0, 80])
@pytest.mark.parametrize("block", [0.0, 1.0])
def test_singular_matrices_have_no_solution(rows, block):
    matrix = np.eye(200)
    matrix[:2, :2] = block
    solver, entries = solver_of(matrix, rows=rows, symmetric=False)
    solver.factor(np.ones(len(entries)))
    solver.factor(entries)
    if block or core() is not None:
        with pytest.raises(np.linalg.LinAlgError, match="singular"):
            solver.solve(np.arange(200.0))
    else:
        assert not np.isfinite(solver.solve(np.arange(200.0))).all()


@pytest.mark.parametrize("rows", [0, 80])
def test_entries_that_were_zero_at_first_count_later(rows, monkeypatch):
    """What is zero is in no factors, as long as it is: of the first matrix the middle is diagonal, of the last too."""
    monkeypatch.setattr(linear, "FEW_ENTRIES", 0)
    matrix = frame(4) + 3.0 * np.eye(320)
    solver, entries = solver_of(matrix, rows=rows, symmetric=bool(rows))
    row, column = np.nonzero((matrix != 0.0).T | np.eye(len(matrix), dtype=bool))[::-1]
    middle = (row != column) & (row > 20) & (row < 120)
    apart = np.where(middle | middle[np.lexsort((column, row))], 0.0, entries)
    b = np.random.default_rng(5).normal(size=320)
    for given in (apart, entries, apart):
        full = np.zeros(matrix.shape)
        full[row, column] = given
        solver.factor(given)
        assert residual(full, solver.solve(b), b) < (1e-15 if rows else 1e-10)


@pytest.mark.parametrize("soft", [1e-12, 1e-6])
def test_negative_eigenvalues_are_counted_where_factors_miss_little(soft):
    """Without pivots the factors of a matrix with nothing on its diagonal are worthless, and say so."""
    matrix = frame(6)
    matrix[np.diag_indices(320)] += np.repeat([soft, -soft], [240, 80])
    row, column = np.nonzero((matrix != 0.0).T | np.eye(len(matrix), dtype=bool))[::-1]
    solver = InertiaSolver(320, row, column)
    try:
        solver.factor(matrix[row, column])
    except np.linalg.LinAlgError:
        # In some orders a pivot is lost in rounding altogether.
        assert soft < 1e-9
        return
    if soft > 1e-9:
        assert solver.missed() < 1e-3
        assert solver.negative() == (np.linalg.eigvalsh(matrix) < 0.0).sum() == 80
    else:
        assert not solver.missed() < 1.0
