"""Rows that push one way only: which of them act, and lines on obstacles, where that is solved for."""

from dataclasses import replace

import numpy as np
import pytest
from test_points_on_obstacles import FLOOR, LARGER, cantilever, smaller

from sfetcas import load, solve
from sfetcas.mathematics import complementarity
from sfetcas.mathematics.complementarity import by_pivots, needs_none
from sfetcas.mathematics.core import core, without_core
from sfetcas.solvers.arclength import Curve, Tangent, bordered
from sfetcas.solvers.between_states import turned_between
from sfetcas.solvers.newton import correct
from sfetcas.solvers.one_sided import IN_VAIN, OneSided
from sfetcas.solvers.prepared import Prepared


@pytest.mark.parametrize("seed", range(20))
def test_pushes_and_gaps_are_complementary(seed):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((12, 12))
    matrix, given = root @ root.T + 1e-3 * np.eye(12), rng.standard_normal(12)
    x = by_pivots(matrix, given)
    rest = given + matrix @ x
    # Rounding is that of the solution of a linear system of this condition.
    size = 1e-9 * np.abs(x).max()
    assert (x >= -size).all()
    assert (rest >= -size).all()
    assert np.abs(x * rest).max() <= size * np.abs(x).max()
    # By minimisation: the x is that of the least 1/2 x M x + given x with none below zero.
    assert 0.5 * x @ matrix @ x + given @ x == pytest.approx(-0.5 * x @ matrix @ x, abs=1e-9 * np.abs(x).max() ** 2)


def test_pivots_in_blocks_that_go_round_end():
    """All wrong signs at once go round for ever here: found by a search among positive definite matrices."""
    matrix = np.array(
        [
            [22.05, -6.0, -3.0, -12.0, -11.0, 4.0],
            [-6.0, 24.05, -13.0, 13.0, -11.0, -10.0],
            [-3.0, -13.0, 20.05, -9.0, 10.0, 0.0],
            [-12.0, 13.0, -9.0, 25.05, -6.0, 4.0],
            [-11.0, -11.0, 10.0, -6.0, 25.05, 6.0],
            [4.0, -10.0, 0.0, 4.0, 6.0, 17.05],
        ]
    )
    given = np.array([4.0, -3.0, -3.0, -2.0, -3.0, 2.0])
    x = by_pivots(matrix, given)
    rest = given + matrix @ x
    # Rounding of numbers of the size of a hundred.
    assert min(x.min(), rest.min()) > -1e-12
    assert np.abs(x * rest).max() < 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_rows_that_depend_on_each_other_have_a_solution(seed):
    """More forces than motions, of whole numbers: ties between pivots that rounding must not break."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(-2, 3, size=(12, 3)).astype(float)
    matrix, given = rows @ rows.T, rows @ rng.standard_normal(3)
    x = by_pivots(matrix, given)
    rest = given + matrix @ x
    # Rounding of numbers of the size of ten.
    assert min(x.min(), rest.min()) > -1e-12
    assert abs(x @ rest) < 1e-9


@pytest.mark.parametrize("seed", [4, 12, 58, 63])
def test_more_rows_than_are_independent_do_not_contradict_each_other(seed):
    """Gaps of which forces can close only some: what closes all of too many was told, with a gap far below zero."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((18, 6))
    matrix, given = rows @ rows.T, np.maximum(rng.standard_normal(18), 0.0) + 5.0 * rows @ rng.standard_normal(6)
    x = by_pivots(matrix, given)
    rest = given + matrix @ x
    # Rounding of numbers of the size of a hundred, of a matrix that has next to no more than six rows.
    assert min(x.min(), rest.min()) > -1e-10
    assert np.abs(x * rest).max() < 1e-8


def test_of_two_solutions_the_one_to_which_the_change_leads_is_found():
    """What the second force yields to grows with itself: the gap there may stay open, or be closed by a push."""
    matrix, given = np.array([[1.0, 0.0], [3.0, -1.0]]), np.array([-1.0, -1.0])
    np.testing.assert_allclose(by_pivots(matrix, given), [1.0, 2.0], rtol=1e-14)
    # From where both gaps are open the first force grows by s, and leaves 1 - 2 s + 3 s of the other gap.
    np.testing.assert_allclose(by_pivots(matrix, given, np.array([0.0, 1.0])), [1.0, 0.0], rtol=1e-14)


def test_where_nothing_is_wrong_but_by_rounding_the_matrix_does_not_matter():
    """A push of rounding, however small, would be one more row that acts."""
    for given in ([1.0, 0.0], [1.0, -1e-15], [0.0, 0.0]):
        assert needs_none(np.array(given))
        np.testing.assert_array_equal(by_pivots(np.eye(2), np.array(given), np.ones(2)), [0.0, 0.0])
    assert not needs_none(np.array([1.0, -1e-9]))


def test_what_each_row_would_change_is_found_only_where_rows_change(monkeypatch):
    """A column each of them: on long lines most of what a step costs."""
    columns = list[bool]()
    moved = OneSided._moved

    def counted(self, point, slope, *, every=False):
        columns.append(every)
        return moved(self, point, slope, every=every)

    monkeypatch.setattr(OneSided, "_moved", counted)
    solve(load("problems/cable_dragged_over_sea_bed.toml"))
    # Where it slides no place begins or ceases to touch: all of it lies there from the begin.
    assert columns.count(False) > 50
    assert sum(columns) < 0.1 * len(columns)


def test_what_has_no_solution_is_told():
    assert by_pivots(np.array([[-1.0]]), np.array([-1.0])) is None


def test_heavy_beam_on_a_floor_presses_with_its_weight_and_where_it_begins_to_lie():
    """Against contact as conditions of elements, another code; elements follow where the line ends."""
    loads = {"w": {"type": "distributed", "member": "beam", "value": [0, -40.0]}}
    floor = {**FLOOR, "point": [0, -0.1]}
    other, step = (solve(cantilever(one, loads=loads)).last for one in (floor, smaller(floor)))
    x = np.linspace(0.0, 1.0, 33)
    # The accuracy of both is 1e-7 of 1 m.
    np.testing.assert_allclose(step.along("beam", x)["position"], other.along("beam", x)["position"], atol=2e-7)
    np.testing.assert_allclose(step.contacts["c"]["force"], other.contacts["c"]["force"], rtol=1e-6, atol=1e-9)
    # Where a force of 10 stands is known to the root of what it bends.
    np.testing.assert_allclose(step.contacts["c"]["at"], other.contacts["c"]["at"], atol=3e-5)
    mesh, fields = step.model.mesh, step.fields
    end, lengths = step.contacts["c"]["at"][0], np.diff(mesh.cuts["beam"])
    told = [(point, fields.contact_point(point)["push"]) for point in mesh.points]
    within = [(p, push) for p, push in told if p.line and p.at[0] > end + 0.1]
    assert len(within) > 4
    for point, push in within:
        cut = mesh.cut_at("beam", point.at[0])
        assert push == pytest.approx(0.5 * 40.0 * lengths[cut - point.sides[0]], rel=1e-4)
    # Halving where the line ends takes five times as many.
    assert mesh.elements < 80


def test_line_that_grows_and_shrinks_has_the_force_of_its_length():
    """A strip that is heavy against its stiffness is lifted by its end: half of what hangs is on the hand."""
    floor = {**FLOOR, "point": [0, -LARGER], "member_radius": LARGER}
    scene = cantilever(
        floor,
        section={"EI3": 1e-4},
        nodes={"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        loads={
            "w": {"type": "distributed", "member": "beam", "value": [0, -4.0]},
            "F": {"type": "force", "node": "B", "value": [0, 0.2]},
        },
        analysis={"accuracy": 1e-6, "steps": [0.5, 1.0, 0.5]},
    )
    steps = solve(scene).steps
    ups = [step.contacts["c"]["force"][1] for step in steps]
    held = [up + 0.2 * step.factor + step.reaction("A")[0][1] for up, step in zip(ups, steps, strict=True)]
    np.testing.assert_allclose(held, [4.0 * step.factor for step in steps], rtol=1e-9)
    # What has been lifted lies down where it lay: without friction the way does not matter.
    np.testing.assert_allclose(ups[0], ups[2], rtol=1e-6)


def test_where_again_and_again_no_rows_may_act_nothing_is_near(monkeypatch):
    """Each step costs as much as one that leads somewhere, and there were thirty of them."""
    loads = {"w": {"type": "distributed", "member": "beam", "value": [0, -40.0]}}
    step = solve(cantilever(smaller({**FLOOR, "point": [0, -0.1]}), loads=loads)).last
    prepared = Prepared(step.model)
    equations, state = prepared.equations, step.fields.state
    # Moved by far more than what suffices without a choice.
    state = replace(state, y=state.y + 1e-3)
    rows = np.arange(equations.unknowns, equations.total)[-2:]
    tried = []
    monkeypatch.setattr("sfetcas.solvers.one_sided.by_pivots", lambda *problem: tried.append(problem))
    system = OneSided(equations, prepared.model.loading(1.0), prepared.weight, pushing=rows, acting=np.ones(2, bool))
    assert not correct(system, state).converged
    assert len(tried) == IN_VAIN


def test_with_an_unknown_factor_the_solution_is_across_a_direction():
    """An equilibrium, but for the choice of what pushes, and no nearer to the expected one along the direction."""
    loads = {"w": {"type": "distributed", "member": "beam", "value": [0, -40.0]}}
    step = solve(cantilever(smaller({**FLOOR, "point": [0, -0.1]}), loads=loads)).last
    prepared = Prepared(step.model)
    equations, names = prepared.equations, list(step.model.row_names)
    equations.redundant = False
    curve = Curve(prepared, 1.0)
    now = curve.standing(step.fields.state, 1.0, Tangent(np.zeros(equations.total), 1.0))
    state, factor = curve.predicted(now, 0.01)
    rows = [
        equations.unknowns + names.index(point.rows(2)[-1]) for point in step.model.mesh.points if not any(point.slides)
    ]
    acting, border = np.ones(len(rows), bool), bordered(curve, now.tangent)
    # Rotations alone, to be added up again.
    border.row[equations.rotation_unknowns :] = 0.0
    loading = curve.loading(factor)
    system = OneSided(equations, loading, prepared.weight, pushing=np.array(rows), acting=acting, border=border)
    found = correct(system, state, factor=factor)
    assert found.converged
    turned = turned_between(equations, found.state, state)
    across = border.row[: len(turned)] @ turned + border.share * (found.loading.factor - factor)
    # Rounding; the factor has changed by some 6e-7.
    assert across == pytest.approx(0.0, abs=1e-12)
    assert abs(found.loading.factor - factor) > 1e-7
    assert found.residual < 1e-9


@pytest.mark.parametrize("along", [False, True])
def test_single_pivots_of_the_core_are_those_without_it(along):
    """Also where several rows are as good, as of whole numbers, and where none leads on."""
    if core() is None:
        pytest.skip("there is no core")
    rng, ended = np.random.default_rng(7), set[bool]()
    for i in range(200):
        n = int(rng.integers(1, 25))
        vectors = rng.standard_normal((n, int(rng.integers(1, n + 2))))
        matrix, given = vectors @ vectors.T, rng.standard_normal(n)
        matrix = matrix + 0.5 * (i % 3 == 0) * (vectors[:, :1] - vectors[:, :1].T)
        if i % 4 == 0:
            rows = rng.integers(-2, 3, size=(n, 3)).astype(float)
            matrix, given = rows @ rows.T, rows @ rng.integers(-2, 3, size=3).astype(float)
        back = np.abs(rng.standard_normal(n)) - given if along else None
        found = complementarity._by_single_pivots(matrix, given, back)
        with without_core():
            other = complementarity._by_single_pivots(matrix, given, back)
        ended.add(found is None)
        assert (found is None) == (other is None)
        assert found is None or (found == other).all()
    assert ended == {False, True}
