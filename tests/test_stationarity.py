"""The equations as one graph of expressions are those that are added up in arrays."""

import casadi as ca
import numpy as np
import pytest
import scenes
import systems
from scenes import model_of

from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.expressions import Expressions
from sfetcas.solvers.program import Program
from sfetcas.solvers.residuals import relative_residual

NAMES = ["plane_loads", "arch", "four_bar", "guided", "bend_45", "tripod", "hinged_space", "helix"]
NAMES += ["linked", "small_plane", "sliding_plane", "linked_space", "small_space", "sliding_space"]
FOLLOWING = ["following", "following_space"]

ROUNDING = 1e-14
"""Sums of a few dozen numbers of the size of one."""


def made(name, assembly, gauss):
    table = getattr(scenes, name, None) or getattr(systems, name)
    equations = Equations(model_of(table(), 2, 3, assembly=assembly, gauss=gauss), kernels="interpreted")
    program = Program(Expressions(equations, "interpreted"))
    loading = equations.model.loading(0.7)
    random = np.random.default_rng(3)
    state = equations.moved(equations.start(loading), 0.2 * random.standard_normal(equations.total))
    return equations, program, loading, state, random


# Both read the same terms and tables: each kind of scene once, assembled and integrated by turns.
CASES = [(name, ("closing", "nodal")[i % 2], i % 4 > 1) for i, name in enumerate(NAMES)]
CASES += [(n, a, False) for n in FOLLOWING for a in ("closing", "nodal")]


@pytest.mark.parametrize(("name", "assembly", "gauss"), CASES)
def test_same_residual_matrix_and_potential(name, assembly, gauss):
    equations, program, loading, state, _ = made(name, assembly, gauss)
    point, flat, given = equations.at(state, loading), program.flat(state), program.given_of(loading)
    residual, size, potential, gaps, entries = (np.array(part).ravel() for part in program.at(flat, given))
    whole = np.zeros((equations.total,) * 2)
    whole[equations.row, equations.column] = point.entries
    assert np.abs(residual - point.residual).max() <= ROUNDING * max(1.0, np.abs(point.residual).max())
    assert np.abs(np.array(ca.DM(program.sparsity, entries)) - whole).max() <= ROUNDING * np.abs(whole).max()
    assert size[0] == pytest.approx(relative_residual(equations, point), rel=1e-12)
    assert gaps[0] == pytest.approx(np.abs(point.residual[equations.unknowns :]).sum(), rel=1e-12)
    if equations.model.has_potential:
        assert potential[0] == pytest.approx(point.potential, abs=1e-13 * max(1.0, abs(point.potential)))
        assert [float(value) for value in program.merit(flat, given)] == pytest.approx(
            [potential[0], gaps[0]], rel=1e-12
        )


@pytest.mark.parametrize(("name", "assembly", "gauss"), [case for case in CASES if not case[2]])
def test_same_states(name, assembly, gauss):
    equations, program, loading, state, random = made(name, assembly, gauss)
    flat, given = program.flat(state), program.given_of(loading)
    step = random.standard_normal(equations.total)
    begin = program.flat(equations.start(loading))
    assert np.array(program.begin(given)).ravel() == pytest.approx(begin, abs=ROUNDING)
    held = program.flat(equations.holding(state, loading))
    assert np.array(program.hold(flat, given)).ravel() == pytest.approx(held, abs=ROUNDING)
    moved = program.flat(equations.moved(state, 0.3 * step))
    assert np.array(program.move(flat, step, 0.3)).ravel() == pytest.approx(moved, abs=1e-13)
    back = program.state(flat)
    assert all(np.array_equal(a, b) for a, b in zip(vars(back).values(), vars(state).values(), strict=True))


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("name", ["arch", "bend_45", "helix"])
def test_positive_matrix_is_positive_and_exact_where_nothing_pulls(name, gauss):
    equations, program, _, state, _ = made(name, "closing", gauss)
    flat = program.flat(state)

    def matrices(given):
        found = program.at(flat, given)[4], program.convex(flat, given)
        n = equations.rotation_unknowns
        return [np.array(ca.DM(program.sparsity, np.array(part).ravel()))[:n, :n] for part in found]

    exact, positive = matrices(program.given_of(equations.model.loading(50.0)))
    assert np.linalg.eigvalsh(exact)[0] < -1e-3
    assert np.linalg.eigvalsh(positive)[0] >= -1e-12 * np.abs(positive).max()
    # Of the undeformed, unloaded scene it is the matrix itself.
    rest = equations.model.loading(0.0, 0.0)
    flat = program.flat(equations.start(rest))
    exact, positive = matrices(program.given_of(rest))
    assert np.abs(exact - positive).max() <= 1e-12 * np.abs(exact).max()
