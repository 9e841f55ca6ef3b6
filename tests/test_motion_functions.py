"""The equations of motion as plain functions: against the simulation, and against each other."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from sfetcas import (
    Analysis,
    CrossSection,
    History,
    Load,
    Member,
    Node,
    Scene,
    SceneError,
    Spring,
    Tendon,
    load,
    motion_functions,
    respond,
    uniform_mesh,
)

PROBLEMS = Path(__file__).parent.parent / "problems"
SECTION = CrossSection(EI3=1.0, EI2=1.5, GJ=0.7, rhoA=1.0, rhoI=[3e-2, 1e-2, 2e-2], damping=0.01)


def arm(dimension="plane", length=1.0):
    value = [0, 0, 0.0] if dimension == "space" else 0.0
    return Scene(
        dimension=dimension,
        gravity=[0, -2],
        sections={"strip": SECTION},
        nodes={"hub": Node(position=[0, 0], support="hinge"), "tip": Node(position=[length, 0], mass=0.2)},
        members={"arm": Member(nodes=["hub", "tip"], section="strip", element="SFET3", elements=1)},
        springs={"hub": Spring(node="hub", stiffness=2.0)},
        loads={"motor": Load(type="moment", node="hub", value=value)},
    )


def loop():
    """A four-bar with a flexible coupler."""
    return Scene(
        sections={"strip": SECTION, "bar": CrossSection(rhoA=1.0)},
        nodes={
            "A": Node(position=[0, 0], support="hinge", inertia=[0, 0, 0.1]),
            "B": Node(position=[0, 1], joint="hinge"),
            "C": Node(position=[1, 1], joint="hinge"),
            "D": Node(position=[1, 0], support="hinge"),
        },
        members={
            "crank": Member(nodes=["A", "B"], type="rigid", section="bar"),
            "coupler": Member(nodes=["B", "C"], section="strip", element="SFET3", elements=1),
            "rocker": Member(nodes=["D", "C"], type="rigid", section="bar"),
        },
        loads={"motor": Load(type="moment", node="A", value=0.0)},
    )


SCENES = {
    "plane": (arm(), "loads.motor.value", "tip", {}),
    "space": (arm("space"), "loads.motor.value.2", "tip", {}),
    "loop": (loop(), "loads.motor.value", "C", {}),
}
"""Scenes, what drives them, a node that is looked at, and what else is given."""


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("name", SCENES)
def test_integrating_the_functions_gives_the_motion(name):
    scene, torque, node, _ = SCENES[name]
    model = motion_functions(scene, [torque], [f"nodes.{node}.position", f"nodes.{node}.velocity"])
    x, z, u = ca.SX.sym("x", model.sizes["x"]), ca.SX.sym("z", model.sizes["z"]), ca.SX.sym("u")
    ode, alg = model.dae(x, z, u, ca.SX(0, 1))
    problem = {"x": x, "z": z, "p": u, "ode": ode, "alg": alg}
    end = ca.integrator("end", "idas", problem, 0.0, 0.1, {"abstol": 1e-9, "reltol": 1e-9})
    last = end(x0=model.begin, z0=model.explicit(model.begin, 1.5, [])[1], p=1.5)["xf"]
    found = np.array(model.outputs_of(last, 1.5, [])).ravel()
    mesh = replace(uniform_mesh(scene, 2, 1), places=True)
    steady = {torque: History(t=[0, 1], value=[1.5, 1.5])}
    moved = respond(scene, steady, 0.1, times=np.array([0.0, 0.1]), mesh=mesh, accuracy=1e-7, integrator="radau-3")
    # The accuracy of the replay, and what index 1 drifts in some hundred steps of 1e-9.
    np.testing.assert_allclose(found[:3], moved.positions(node)[-1], atol=5e-7)
    np.testing.assert_allclose(found[3:], moved.instants[-1].velocity(node), atol=2e-5)
    for drift in model.invariants(last, 1.5, []):
        assert np.abs(np.array(drift)).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("name", SCENES)
def test_forms_agree_and_derivatives_are_those_of_differences(name):
    scene, torque, _, _ = SCENES[name]
    model = motion_functions(scene, [torque])
    u = np.array([0.7])
    rates, z = model.explicit(model.begin, u, [])
    at = (model.begin, z, u, [])
    ode, alg = model.dae(*at)
    np.testing.assert_allclose(np.array(ode), np.array(rates), atol=1e-12)
    # Rounding of accelerations that mass matrices of thin nodes leave.
    assert np.abs(np.array(alg)).max() < 1e-9
    assert np.abs(np.array(model.implicit(rates, *at))).max() < 1e-9
    slopes = dict(zip(model.jacobians.name_out(), model.jacobians(*at), strict=True))
    step = 1e-6
    for k in range(0, model.sizes["x"], 3):
        there, back = (model.begin + sign * step * np.eye(model.sizes["x"])[k] for sign in (1, -1))
        values = [np.array(model.alg(state, z, u, [])).ravel() for state in (there, back)]
        wanted = (values[0] - values[1]) / (2.0 * step)
        # Central differences: 1e-12 of curvature, 1e-10 of rounding.
        np.testing.assert_allclose(np.array(slopes["alg_x"])[:, k], wanted, atol=1e-6 * (1.0 + np.abs(wanted).max()))


def test_states_are_in_si_units():
    small, large = (motion_functions(arm(length=x), ["loads.motor.value"], ["nodes.tip.position"]) for x in (1.0, 2.0))
    assert (
        np.array(large.outputs_of(large.begin, 0.0, []))[0, 0]
        == 2.0 * np.array(small.outputs_of(small.begin, 0.0, []))[0, 0]
    )
    # At rest the torque over the inertia about the hinge, per s2: J = 1/3 rhoA L^3 + m L^2 and the sections' own.
    w = small.parts["w"]
    rates = [np.array(m.explicit(m.begin, 1.0, [])[0]).ravel()[w][0] for m in (small, large)]
    still = [np.array(m.explicit(m.begin, 0.0, [])[0]).ravel()[w][0] for m in (small, large)]
    assert rates[0] - still[0] > 2.0 * (rates[1] - still[1]) > 0.0


def test_parameters_are_arguments():
    model = motion_functions(arm(), ["loads.motor.value"], parameters=["springs.hub.stiffness"])
    turned = model.begin.copy()
    turned[0] += 0.1
    soft, stiff = (np.array(model.explicit(turned, 0.0, k)[1]) for k in (2.0, 20.0))
    assert np.abs(soft - stiff).max() > 0.1


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"inputs": ["loads.motor.valeu"]}, "did you mean 'value'"),
        ({"outputs": ["nodes.tpi.position"]}, "tpi"),
        ({"outputs": ["reactions.hub.force"]}, "outputs.reactions.hub.force: found what constraints or inertia exert"),
        ({"inputs": ["sections.strip.EI3"]}, "accepted: a component of the value of a load"),
        ({"parameters": ["sections.strip.rhoA"]}, "found sections.strip.rhoA, with which masses change"),
        ({"parameters": ["members.arm.elements"]}, "members.arm.elements"),
    ],
)
def test_bad_input_is_one_sentence(given, sentence):
    with pytest.raises(SceneError, match=sentence):
        motion_functions(arm(), **given)


def test_what_turns_without_inertia_is_refused():
    # Nothing resists a twist.
    thin = arm("space").replace(sections={"strip": SECTION.replace(rhoI=None)})
    with pytest.raises(SceneError, match="found rotations without inertia"):
        motion_functions(thin, ["loads.motor.value.2"])
    with pytest.raises(SceneError, match=r"found stretch or shear, of which a part has no inertia.*sections without"):
        motion_functions(arm().replace(sections={"strip": SECTION.replace(EA=400.0)}))


def test_what_the_multiplier_of_a_constraint_tells_is_no_output():
    """The tension of a tendon of a given length, which was told as zero."""
    tied = arm().replace(
        tendons={"stay": Tendon(way=[{"ground": [0, 1]}, {"node": "tip"}], length=2.0**0.5, pushes=True)},
        analysis=Analysis(type="dynamic", end=1.0, initial="equilibrium"),
    )
    with pytest.raises(SceneError, match=r"^outputs.tendons.stay.tension: found what constraints or inertia exert"):
        motion_functions(tied, outputs=["tendons.stay.tension"])


def test_where_nothing_turns_the_functions_are_those_of_what_moves():
    bead = load(PROBLEMS / "bead_on_circular_wire.toml")
    functions = motion_functions(bead, outputs=["nodes.bead.position"])
    assert np.array(functions.outputs_of(functions.begin, [], [])).ravel() == pytest.approx(
        bead.nodes["bead"].position, abs=1e-12
    )
