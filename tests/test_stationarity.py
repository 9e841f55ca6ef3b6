"""The equations as one graph of expressions are those that are added up in arrays."""

import casadi as ca
import numpy as np
import pytest
import scenes
import systems
from scenes import model_of

from sfetcas.mechanics.beams import ELEMENT_DATA
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.expressions import LOADS, Expressions
from sfetcas.mechanics.inputs import Inputs
from sfetcas.solvers.program import Program

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
    point, flat, given = equations.at(state, loading), state.flat, program.given_of(loading)
    expressions = [ca.densify(program.stationarity.residual), program.potential, program.matrix]
    at = ca.Function("at", [program.state_symbol, program.symbol], expressions)
    residual, potential, matrix = (np.array(part) for part in at(flat, given))
    whole = np.zeros((equations.total,) * 2)
    whole[equations.row, equations.column] = point.entries
    assert np.abs(residual.ravel() - point.residual).max() <= ROUNDING * max(1.0, np.abs(point.residual).max())
    assert np.abs(matrix - whole).max() <= ROUNDING * np.abs(whole).max()
    if equations.model.has_potential:
        assert potential.item() == pytest.approx(point.potential, abs=1e-13 * max(1.0, abs(point.potential)))


@pytest.mark.parametrize(("name", "assembly", "gauss"), [case for case in CASES if not case[2]])
def test_same_states(name, assembly, gauss):
    equations, program, loading, state, random = made(name, assembly, gauss)
    given, inputs = program.given_of(loading), Inputs(equations)
    step = random.standard_normal(equations.total)
    taken = inputs.taken(inputs.of(loading))
    alike(inputs.begun(taken), equations.start(loading), 0.0)
    held = equations.holding(state, loading)
    alike(inputs.holding(state, taken), held, ROUNDING)
    assert np.array(program.hold(state.flat, given)).ravel() == pytest.approx(held.flat, abs=ROUNDING)
    moved = equations.moved(state, 0.3 * step)
    assert np.array(program.move(state.flat, step, 0.3)).ravel() == pytest.approx(moved.flat, abs=1e-13)
    alike(equations.state(state.flat), state, 0.0)


@pytest.mark.parametrize(("name", "assembly", "gauss"), [case for case in CASES if not case[2]])
def test_rows_of_inputs_are_those_of_expressions(name, assembly, gauss):
    """With all data and loads as what varies, too; and the equations with the data of a row are those of its model."""
    equations, program, loading, state, random = made(name, assembly, gauss)
    row = Inputs(equations).of(loading)
    assert np.array(program.row(program.given_of(loading))).ravel() == pytest.approx(row, abs=ROUNDING)
    every = [*ELEMENT_DATA, *LOADS]
    every += [f"{kind}_{i}" for i in range(len(equations.model.connections)) for kind in ("data", "loads")]
    whole = Program(program.expressions, dict.fromkeys(every, True))
    given = whole.given_of(loading)
    given[: whole.slice_of_loads.start] *= random.uniform(0.9, 1.1, whole.slice_of_loads.start)
    inputs = Inputs(equations, whole.varying)
    taken = inputs.taken(np.array(whole.row(given)).ravel())
    expressions = [ca.densify(whole.stationarity.residual), whole.potential, whole.matrix]
    at = ca.Function("at", [whole.state_symbol, whole.symbol], expressions)
    residual, potential, matrix = (np.array(part) for part in at(state.flat, given))
    point = taken.equations.under(state, taken.given)
    found = np.zeros((equations.total,) * 2)
    found[equations.row, equations.column] = point.entries
    assert np.abs(residual.ravel() - point.residual).max() <= ROUNDING * max(1.0, np.abs(point.residual).max())
    assert np.abs(matrix - found).max() <= ROUNDING * np.abs(found).max()
    if equations.model.has_potential:
        assert potential.item() == pytest.approx(point.potential, abs=1e-13 * max(1.0, abs(point.potential)))


def alike(one, other, close):
    for a, b in zip(vars(one).values(), vars(other).values(), strict=True):
        assert np.abs(a - b).max(initial=0.0) <= close


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("name", ["arch", "bend_45", "helix"])
def test_positive_matrix_is_positive_and_exact_where_nothing_pulls(name, gauss):
    equations, _, _, state, _ = made(name, "closing", gauss)

    def matrices(state, loading):
        given = equations.given(loading)
        for entries in (equations.under(state, given).entries, equations.convex_entries(state, given)):
            whole = np.zeros((equations.total,) * 2)
            whole[equations.row, equations.column] = entries
            yield whole[: equations.rotation_unknowns, : equations.rotation_unknowns]

    exact, positive = matrices(state, equations.model.loading(50.0))
    assert np.linalg.eigvalsh(exact)[0] < -1e-3
    assert np.linalg.eigvalsh(positive)[0] >= -1e-12 * np.abs(positive).max()
    # Of the undeformed, unloaded scene it is the matrix itself.
    rest = equations.model.loading(0.0, 0.0)
    exact, positive = matrices(equations.start(rest), rest)
    assert np.abs(exact - positive).max() <= 1e-12 * np.abs(exact).max()
