"""The equilibrium as an open program: further rows and terms, read by name."""

import casadi as ca
import numpy as np
import pytest
from scenes import bend_45, cantilever, four_bar, hinged_space, model_of

from sfetcas import SceneError, SolveError, equilibrium_nlp
from sfetcas.equilibria.statics import solve_model
from sfetcas.errors import Status
from sfetcas.mathematics.nlp import Ipopt, Solver
from sfetcas.solvers.prepared import Prepared

TIGHT = Ipopt(tolerance=1e-11)


@pytest.mark.parametrize("factory", [cantilever, four_bar, bend_45, hinged_space])
def test_without_additions_it_is_the_equilibrium(factory):
    prepared = Prepared(model_of(factory(), 3, 4))
    step = solve_model(prepared)
    answer = equilibrium_nlp(prepared).solve(TIGHT)
    for node in step.model.nodes:
        np.testing.assert_allclose(answer.position(node), step.position(node), atol=1e-8)
    member = step.model.members[0]
    found = answer.value(answer.problem.curvature(member, 0.5))
    # Curvature from the derivative of the rotations: of order p only, 3 elements of order 4.
    strain = step.along(member, 0.5)["curvature"][0] - step.model.scene.center_lines[member].curvatures([0.5])[0]
    np.testing.assert_allclose(
        found, strain[2] if not step.model.space else strain, atol=5e-2 * (1 + np.abs(strain).max())
    )
    np.testing.assert_allclose(answer.state.q, step.state.q, atol=1e-7)
    np.testing.assert_allclose(answer.state.lam, step.state.lam, atol=1e-5)


def on_line(height, force=5.0):
    problem = equilibrium_nlp(model_of(cantilever((0.0, force)), 4, 5))
    y = problem.position("B")[1]
    return problem.with_row("line", y, height).solve(TIGHT)


def test_tip_kept_on_a_line():
    answer = on_line(0.2)
    assert answer.position("B")[1] == pytest.approx(0.2, abs=1e-10)
    # The force that keeps it: a support by a slider that turns as a ball gives the same reaction.
    table = cantilever((0.0, 5.0))
    table["nodes"]["B"] |= {"support": "slider", "direction": [1, 0], "rotation": "ball"}
    table["motions"] = {"up": {"node": "B", "displacement": [0, 0.2]}}
    step = solve_model(model_of(table, 4, 5))
    np.testing.assert_allclose(answer.position("B"), step.position("B"), atol=1e-9)
    assert answer.multiplier("line") == pytest.approx(-step.reaction("B")[0][1], abs=1e-6)
    assert answer.multiplier("line") > 1.0


def test_relations_are_said_as_in_all_problems():
    problem = equilibrium_nlp(model_of(cantilever((0.0, 5.0)), 4, 5))
    tip = problem.answer("nodes.B.position")
    kept = problem.subject_to(tip[1] == 0.2, name="line").solve(TIGHT)
    assert kept.position("B") == pytest.approx(on_line(0.2).position("B"), abs=1e-12)
    assert kept.multiplier("line") == pytest.approx(on_line(0.2).multiplier("line"), abs=1e-9)
    higher = problem.answer("nodes.B.position.y")
    above = problem.subject_to(0.75 <= (higher <= 0.8), name="window").solve(TIGHT)  # noqa: SIM300
    assert above.position("B")[1] == pytest.approx(0.75, abs=1e-8)
    bent = problem.answer("members.m.curvature at 0.5")
    assert float(above.value(bent)) == pytest.approx(float(above.value(problem.curvature("m", 0.5))))
    sprung = problem.minimise(2.0 * tip[1] ** 2).solve(TIGHT)
    assert sprung.position("B")[1] < problem.solve(TIGHT).position("B")[1] - 0.01
    with pytest.raises(SceneError, match="found the symbol 'stranger'"):
        problem.subject_to(ca.MX.sym("stranger") == 1.0)
    with pytest.raises(SceneError, match=r"answer: found 'nodes\.B\.velocity', accepted: nodes\.NAME\.position"):
        problem.answer("nodes.B.velocity")


def test_multiplier_is_minus_the_derivative_of_the_energy():
    h = 1e-3
    energies = [on_line(0.2 + k * h).result.f for k in (-2, -1, 1, 2)]
    slope = (energies[0] - 8 * energies[1] + 8 * energies[2] - energies[3]) / (12 * h)
    # grad f + J^T lam = 0 makes df/d(bound) = -lam.
    assert on_line(0.2).multiplier("line") == pytest.approx(-slope, abs=1e-6)


def test_unit_of_a_row_and_of_the_scene_do_not_change_the_multiplier():
    plain = on_line(0.2).multiplier("line")
    problem = equilibrium_nlp(model_of(cantilever((0.0, 5.0)), 4, 5))
    scaled = problem.with_row("line", problem.position("B")[1], 0.2, unit=1e-3).solve(TIGHT)
    assert scaled.multiplier("line") == pytest.approx(plain, rel=1e-6)
    table = cantilever((0.0, 5.0 * 7.0))
    table["nodes"]["B"]["position"] = [30.0, 0]
    table["sections"]["s"] = {"EI3": 900.0 * 7.0}
    problem = equilibrium_nlp(model_of(table, 4, 5))
    large = problem.with_row("line", problem.position("B")[1], 6.0, unit=30.0).solve(TIGHT)
    assert large.multiplier("line") == pytest.approx(7.0 * plain, rel=1e-6)
    assert large.position("B")[1] == pytest.approx(6.0, abs=1e-8)


def test_curvature_is_bounded():
    """The root is the place of largest curvature; held to less, the beam bends more evenly and less far."""
    problem = equilibrium_nlp(model_of(cantilever((0.0, 5.0)), 4, 5))
    free = problem.solve(TIGHT)
    curvature = problem.curvature("m", 0.0)
    assert free.value(curvature) > 2.6
    held = problem.with_row("root", curvature, -2.0, 2.0).solve(TIGHT)
    assert held.value(curvature) == pytest.approx(2.0, abs=1e-7)
    assert held.multiplier("root") > 0.0
    assert held.position("B")[1] < free.position("B")[1]
    loose = problem.with_row("root", curvature, -9.0, 9.0).solve(TIGHT)
    assert loose.multiplier("root") == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(loose.position("B"), free.position("B"), atol=1e-7)


def test_a_spring_as_a_further_energy():
    """A soft spring at the tip against the same force by hand."""
    k = 3.0
    problem = equilibrium_nlp(model_of(cantilever((0.0, 5.0)), 4, 5))
    x, y = ca.vertsplit(problem.position("B"))
    sprung = problem.with_energy(0.5 * k * ((x - 1.0) ** 2 + y**2)).solve(TIGHT)
    tip = sprung.position("B")
    by_hand = solve_model(model_of(cantilever((-k * (tip[0] - 1), 5.0 - k * tip[1])), 4, 5))
    np.testing.assert_allclose(by_hand.position("B"), tip, atol=1e-8)
    assert sprung.value(y) == pytest.approx(tip[1], abs=1e-14)


def test_rotation_by_name():
    table = cantilever((0.0, 3.0), dimension="space")
    problem = equilibrium_nlp(model_of(table, 3, 4))
    step = solve_model(problem.prepared)
    np.testing.assert_allclose(problem.solve(TIGHT).value(problem.rotation("B")), step.quaternion("B"), atol=1e-8)
    plane = equilibrium_nlp(model_of(cantilever((0.0, 3.0)), 3, 4))
    angle = plane.with_row("angle", plane.rotation("B"), 0.3).solve(TIGHT)
    assert angle.value(plane.rotation("B")) == pytest.approx(0.3, abs=1e-10)
    # What holds the angle is a moment, and the moment at the tip says so.
    held = cantilever((0.0, 3.0))
    held["loads"]["m"] = {"type": "moment", "node": "B", "value": -float(angle.multiplier("angle")[0])}
    np.testing.assert_allclose(solve_model(model_of(held, 3, 4)).position("B"), angle.position("B"), atol=1e-8)


def test_rows_of_two_numbers_have_two_multipliers():
    problem = equilibrium_nlp(model_of(cantilever((0.0, 1.0)), 4, 5))
    both = problem.with_row("first", problem.rotation("B"), 0.4).with_row("tip", problem.position("B"), [0.8, 0.3])
    answer = both.solve(TIGHT)
    np.testing.assert_allclose(answer.position("B"), [0.8, 0.3, 0], atol=1e-9)
    table = cantilever((0.0, 1.0))
    table["nodes"]["B"]["support"] = "clamped"
    table["motions"] = {"m": {"node": "B", "displacement": [-0.2, 0.3], "rotation": 0.4}}
    step = solve_model(model_of(table, 4, 5))
    force, moment = step.reaction("B")
    np.testing.assert_allclose(answer.multiplier("tip"), -force[:2], atol=1e-5)
    np.testing.assert_allclose(answer.multiplier("first"), -moment[2], atol=1e-5)


def test_other_solvers():
    """Any nlpsol plugin, as the documentation of ``solve`` says."""
    problem = equilibrium_nlp(model_of(cantilever((0.0, 1.0)), 3, 3))
    problem = problem.with_row("line", problem.position("B")[1], 0.2)
    quiet = dict.fromkeys(("print_time", "print_header", "print_iteration", "print_status"), False)
    options = {"qpsol": "qrqp", **quiet, "qpsol_options": {"print_iter": False, "print_header": False}}
    answer = problem.solve(Solver("sqpmethod", options))
    assert answer.position("B")[1] == pytest.approx(0.2, abs=1e-8)
    np.testing.assert_allclose(answer.position("B"), problem.solve(TIGHT).position("B"), atol=1e-6)


def test_what_cannot_be():
    problem = equilibrium_nlp(model_of(cantilever((0.0, 1.0)), 3, 3))
    with pytest.raises(SolveError) as caught:
        problem.with_row("far", problem.position("B")[0], 1.5).solve()
    assert caught.value.status is Status.INFEASIBLE
    with pytest.raises(SceneError, match="found node 'C'"):
        problem.position("C")
    with pytest.raises(SceneError, match="found member"):
        problem.curvature("x", 0.5)
    with pytest.raises(SceneError, match="found row 'lin'; did you mean 'line'"):
        problem.with_row("line", problem.position("B")[1], 0.2).solve().multiplier("lin")
    hinged = equilibrium_nlp(model_of(four_bar(), 2, 3))
    with pytest.raises(SceneError, match="no rotation of its own"):
        hinged.rotation("C")


def test_factor_scales_loads():
    step = solve_model(model_of(cantilever((0.0, 2.5)), 3, 4))
    answer = equilibrium_nlp(model_of(cantilever((0.0, 5.0)), 3, 4), 0.5).solve(TIGHT)
    np.testing.assert_allclose(answer.position("B"), step.position("B"), atol=1e-8)
