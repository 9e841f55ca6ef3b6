"""Scenes in rotating axes: parameters, designs, generated C and optimal control."""

import numpy as np
import pytest
from systems import EVERYTHING
from test_codegen import built, needs_compiler, said
from test_trajectories import arm
from test_trajectories import turning as turn_of

from sfetcas import Design, Ipopt, Node, Scene, SceneError, export, parametric, solve
from sfetcas.parametric.arguments import with_values

SCENES = ["plane_loads", "bend_45", "linked_space", "small_space", "sliding_plane", "following_space", "hinged_space"]


def turning(name, omega, *, dynamic=False):
    """A scene with mass and rotary inertia everywhere, in rotating axes."""
    table = EVERYTHING[name]()
    for section in table["sections"].values():
        section.setdefault("rhoA", 0.3)
        section.setdefault("rhoI", [0.03, 0.02, 0.01])
    analysis = {"type": "dynamic", "end": 0.2, "step": 0.005} if dynamic else {"accuracy": 1e-5}
    return Scene.from_dict({**table, "rotating": omega, "analysis": analysis})


def answers_of(step, name, places):
    table, record, key = name.split(".")
    if table == "members":
        return step.along(record, places[record])[key]
    if table == "reactions":
        return step.reaction(record)[key == "moment"]
    return step.position(record)


@pytest.mark.parametrize("omega", [(0, 0, 0.7), (0.3, 0.4, 0.5)])
@pytest.mark.parametrize("name", SCENES)
def test_parameters_are_numbers_of_the_scene(name, omega):
    """Speed, masses and rotary inertia: what the scene itself says with other ones, reactions and sections too."""
    scene = turning(name, omega)
    section = next(m.section for m in scene.members.values() if m.type == "flexible")
    values = {"rotating.2": 0.9, f"sections.{section}.rhoA": 0.4}
    if scene.resolved_dimension == "space":
        values[f"sections.{section}.rhoI.1"] = 0.035
    places = {name: [0.0, 0.3, 0.77, 1.0] for name, member in scene.members.items() if member.type == "flexible"}
    asked = [f"nodes.{node}.position" for node in scene.nodes]
    asked += [f"members.{member}.{key}" for member in places for key in ("force", "moment")]
    held = [node for node, record in scene.nodes.items() if record.support != "free"]
    asked += [f"reactions.{node}.{key}" for node in held for key in ("force", "moment")]
    found = parametric(scene, list(values), asked, places=places).solve(values)
    step = solve(with_values(scene, values)).last
    for key in asked:
        expected = answers_of(step, key, places)
        # Each on the mesh that the accuracy asks for with its own numbers.
        np.testing.assert_allclose(found[key], expected, atol=2e-5 * max(1.0, np.abs(expected).max()), err_msg=key)


def test_speed_that_lifts_a_weight():
    """A bob on a light rigid rod hangs outwards at the angle a with Om^2 L cos a = g."""
    nodes = {
        "A": {"position": [0, 0, 0], "support": "hinge", "axis": [0, 1, 0]},
        "B": {"position": [0.6, 0, -0.8], "mass": 2.0},
    }
    scene = Scene.from_dict(
        {
            "nodes": nodes,
            "members": {"rod": {"nodes": ["A", "B"], "type": "rigid"}},
            "gravity": [0, 0, -9.81],
            "rotating": [0, 0, 3.7],
        }
    )
    design = Design(scene, {"rotating.2": (3.5, 6.0)})
    design.subject_to(design.answer("", "nodes.B.position")[2] == -0.5)
    answer = design.solve()
    assert answer.values["rotating.2"] == pytest.approx(np.sqrt(9.81 / 0.5), rel=1e-6)
    assert solve(answer.scene()).last.position("B")[2] == pytest.approx(-0.5, abs=1e-6)


@needs_compiler
@pytest.mark.parametrize("name", ["linked_space", "sliding_plane"])
def test_c_gives_the_bits_of_the_process(name, tmp_path):
    scene = turning(name, (0.0, 0.0, 0.7))
    export(scene, tmp_path / "c", name="turning", arguments=["rotating.2", "sections.s.rhoA"])
    assert "3 of 3 cases agree, 3 of them to the last bit" in said(built(tmp_path / "c", "turning"))


@needs_compiler
def test_c_takes_the_steps_of_the_integrator(tmp_path):
    export(turning("linked_space", (0.3, 0.4, 0.5), dynamic=True), tmp_path / "c", name="turning")
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "turning"))


def test_what_turns_the_axes_is_no_number_of_a_motion(tmp_path):
    with pytest.raises(SceneError, match="arguments: found numbers that turn the axes, accepted: loads, motions"):
        export(turning("bend_45", (0, 0, 0.7), dynamic=True), tmp_path / "c", arguments=["rotating.2"])


def test_small_members_whose_inertia_changes_are_refused():
    with pytest.raises(SceneError, match=r"members\.two: found a small member whose inertia depends on numbers"):
        parametric(turning("small_plane", (0, 0, 0.7)), ["nodes.C.position.0"])


def test_optimal_control_knows_of_the_forces_of_rotating_axes():
    """A hub at the centre feels nothing of them; one beside it does, and the replay by time steps says the same."""
    still, centred, beside = (
        turn_of(arm(0, nodes=hub_at(x), **more))
        for x, more in ((0.0, {}), (0.0, {"rotating": [0, 0, 2.0]}), (0.3, {"rotating": [0, 0, 2.0]}))
    )
    motions = [problem.solve(ipopt=Ipopt(1e-9, 100)) for problem in (still, centred, beside)]
    assert motions[1].cost == pytest.approx(motions[0].cost, rel=1e-6)
    assert motions[2].cost < 0.9 * motions[0].cost
    # Of ten intervals of collocation, over the size of the scene.
    assert motions[2].check.difference < 1e-4


def hub_at(x):
    return {
        "hub": Node(position=[x, 0], support="hinge", inertia=[0, 0, 0.1]),
        "tip": Node(position=[1 + x, 0], mass=0.2),
    }


def test_what_has_no_mass_any_more_turns_without_forces():
    """Numbers with which all mass vanishes are numbers like others, and masses below zero are none."""
    nodes = {"A": {"position": [0.5, 0], "support": "clamped"}, "B": {"position": [1.5, 0], "mass": 0.2}}
    table = {"sections": {"s": {"EI3": 1.0}}, "nodes": nodes, "members": {"m": {"nodes": ["A", "B"], "section": "s"}}}
    loads = {"f": {"type": "force", "node": "B", "value": [0, 0.5]}}
    table["sections"]["s"]["rhoA"] = 0.0
    scene = Scene.from_dict({**table, "loads": loads, "rotating": [0, 0, 2.0]})
    solver = parametric(scene, ["nodes.B.mass"], ["nodes.B.position", "reactions.A.force"])
    still = solve(Scene.from_dict({**table, "loads": loads})).last
    np.testing.assert_allclose(solver.solve({"nodes.B.mass": 0.0})["nodes.B.position"], still.position("B"), atol=1e-6)
    heavy = solver.solve({"nodes.B.mass": 0.4})
    pulled = 0.4 * 4.0 * heavy["nodes.B.position"]
    np.testing.assert_allclose(heavy["reactions.A.force"], [-pulled[0], -0.5 - pulled[1], 0.0], rtol=1e-9)
    with pytest.raises(SceneError, match=r"values\.nodes\.B\.mass: found -1, accepted: zero or more"):
        solver.solve({"nodes.B.mass": -1.0})
