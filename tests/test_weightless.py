"""Flexible members without mass between masses: their shape follows from the forces at each instant."""

import math
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from test_codegen import built, needs_compiler, said

from sfetcas import Scene, SceneError, SolveError, export, parametric, solve

LIGHT = {"EI2": 1.0, "EI3": 2.0, "GJ": 0.5, "rhoA": 0.0}


def strip(analysis, *, tip=None, section=None, **more):
    """A clamped strip of 1 m and 1 N m2 without mass, with a mass of 1 kg at its tip."""
    table = {
        "sections": {"s": section or {"EI3": 1.0, "rhoA": 0.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0], "mass": 1.0, **(tip or {})},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "analysis": analysis,
    }
    return Scene.from_dict(table | more)


MODES = {"type": "modes", "modes": 6, "accuracy": 1e-8}


def test_a_mass_on_a_light_strip_swings_as_on_a_spring():
    # 3 EI / (m L^3).
    assert solve(strip(MODES)).omega == pytest.approx([math.sqrt(3)], rel=1e-8)
    body = solve(strip(MODES, tip={"inertia": [0.1, 0.1, 0.1]})).omega
    stiffness, mass = np.array([[12.0, -6.0], [-6.0, 4.0]]), np.diag([1.0, 0.1])
    wanted = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))
    assert body == pytest.approx(wanted, rel=1e-8)
    space = solve(strip(MODES, section=LIGHT, tip={"inertia": [0.2, 0, 0]}, dimension="space")).omega
    # About both axes, and twist.
    assert space == pytest.approx(sorted([math.sqrt(3), math.sqrt(0.5 / 0.2), math.sqrt(6)]), rel=1e-8)


def test_two_masses_on_a_free_light_strip():
    nodes = {"A": {"position": [0, 0], "mass": 1.0, "inertia": [0.1] * 3}, "B": {"position": [1, 0], "mass": 1.0}}
    # Turning of A against the line through both: 3 EI (1/J + 1/(mu L^2)) with the reduced mass mu of 1/2 kg.
    wanted = math.sqrt(3 * (1 / 0.1 + 2))
    assert solve(strip(MODES, nodes=nodes)).omega == pytest.approx([wanted], rel=1e-8)


def test_a_mass_on_a_turning_light_strip():
    # Drawn by N = m w^2 L it has the stiffness N / (L - tanh(k L) / k), k^2 = N / EI; the axes take away m w^2.
    stiffness = 4.0 / (1.0 - math.tanh(2.0) / 2.0)
    found = solve(strip(MODES, rotating=[0, 0, 2.0])).omega
    assert found == pytest.approx([math.sqrt(stiffness - 4.0)], rel=1e-8)


def test_a_mass_on_a_bent_light_strip_swings_by_its_static_stiffness():
    loads = {"pull": {"type": "force", "node": "B", "value": [-0.5, 3.0]}}
    found = solve(strip(MODES, loads=loads)).omega
    still = strip({"accuracy": 1e-8}, loads=loads)
    # Displacements alone: the tip turns as it wants.
    compliance = parametric(still, ["factor"], ["compliance.B"]).solve()["compliance.B"][:2, :2]
    wanted = np.sqrt(1.0 / np.sort(np.linalg.eigvalsh(compliance))[::-1])
    assert found == pytest.approx(wanted, rel=1e-6)


def pull_of(place, near):
    """Force (2,) at the tip that bends the strip to a place, and the moment at its root; ``near``: a first guess."""

    def ended(unknown):
        fx, fy, moment = unknown

        def bent(_, y):
            angle, curvature = y[2:]
            return [math.cos(angle), math.sin(angle), curvature, fx * math.sin(angle) - fy * math.cos(angle)]

        end = solve_ivp(bent, (0, 1), [0, 0, 0, moment], rtol=1e-10, atol=1e-11, method="DOP853").y[:, -1]
        return [end[0] - place[0], end[1] - place[1], end[3]]

    return fsolve(ended, near, xtol=1e-10)


@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha"])
def test_a_plucked_mass_moves_as_an_elastica_pulls_it(integrator):
    loads = {"pluck": {"type": "force", "node": "B", "value": [0.0, 3.0]}}
    analysis = {"type": "dynamic", "end": 0.6, "initial": "equilibrium", "cut": ["pluck"], "integrator": integrator}
    motion = solve(strip({**analysis, "accuracy": 1e-5, "output": 0.1}, loads=loads))
    begin = motion.steps[0].position("B")[:2]
    guess = [np.array([0.0, 3.0, 3.0 * begin[0]])]

    def moved(_, state):
        guess[0] = pull_of(state[:2], guess[0])
        return [*state[2:], *(-guess[0][:2])]

    times = [step.time for step in motion.steps]
    wanted = solve_ivp(moved, (0, 0.6), [*begin, 0, 0], t_eval=times, rtol=1e-7, atol=1e-8).y[:2].T
    assert np.abs(wanted[-1] - wanted[0]).max() > 0.1
    # The accuracy asked for.
    np.testing.assert_allclose(motion.positions("B")[:, :2], wanted, atol=1e-5)
    energy = [step.energy["total"] for step in motion.steps]
    np.testing.assert_allclose(energy, energy[0], atol=1e-4)


def test_a_mass_swings_to_and_fro_through_the_straight_strip():
    tip = {"velocity": [0, 0.01]}
    motion = solve(strip({"type": "dynamic", "end": 6.0, "accuracy": 1e-5, "output": 0.5}, tip=tip))
    omega = math.sqrt(3)
    # The stiffness grows by some squares of the deflection of 0.006 m; 1e-5 is the accuracy asked for.
    wanted = 0.01 / omega * np.sin(omega * motion.times)
    np.testing.assert_allclose(motion.positions("B")[:, 1], wanted, atol=2e-5)


def test_a_light_strip_is_the_limit_of_heavier_ones():
    nodes = {
        "A": {"position": [0, 0], "support": "clamped"},
        "C": {"position": [0.5, 0], "mass": 0.5},
        "B": {"position": [1, 0], "mass": 1.0},
    }
    members = {"one": {"nodes": ["A", "C"], "section": "s"}, "two": {"nodes": ["C", "B"], "section": "s"}}
    found = [
        solve(strip(MODES, section={"EI3": 1.0, "rhoA": mass}, nodes=nodes, members=members)).omega[:2]
        for mass in (0.0, 1e-4, 2e-4)
    ]
    # The frequencies fall evenly with a small mass: less than its square, 4e-8, times some 10, is left.
    np.testing.assert_allclose(found[0], 2 * found[1] - found[2], rtol=1e-6)


def test_light_and_heavy_members_move_together():
    table = {
        "sections": {"heavy": {"EI3": 1.0, "rhoA": 1.0}, "light": {"EI3": 1.0, "rhoA": 0.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "C": {"position": [0.5, 0]},
                  "B": {"position": [1, 0], "mass": 0.2}},
        "members": {"one": {"nodes": ["A", "C"], "section": "heavy"}, "two": {"nodes": ["C", "B"], "section": "light"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 0.5]}},
        "analysis": {"type": "dynamic", "end": 1.0, "accuracy": 1e-4},
    }  # fmt: skip
    motion = solve(Scene.from_dict(table))
    # Work of the load is what there is.
    assert motion.last.energy["total"] == pytest.approx(0.0, abs=1e-4)


@needs_compiler
def test_steps_with_a_light_strip_in_c(tmp_path):
    scene = strip({"type": "dynamic", "end": 0.5, "step": 0.01},
                  loads={"tip": {"type": "force", "node": "B", "value": [0, 1]}})  # fmt: skip
    export(scene, tmp_path / "c", name="motion")
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


def test_gravity_does_not_act_on_what_has_no_mass():
    light = solve(strip({}, gravity=[0, -2.0])).last
    point = solve(strip({}, loads={"w": {"type": "force", "node": "B", "value": [0, -2.0]}})).last
    np.testing.assert_allclose(light.position("B"), point.position("B"), atol=1e-10)


MOVING = {"type": "dynamic", "end": 0.5, "step": 0.01}
PUSHED = {"tip": {"type": "force", "member": "m", "at": 0.5, "value": [0, 1]}}
FREE = {"A": {"position": [0, 0], "velocity": [0, 1]}, "B": {"position": [1, 0], "mass": 1.0}}


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"tip": {"mass": 0.0}}, r"scene without mass, which could not be set in motion"),
        ({"loads": PUSHED}, r"forces at t = 0 act on what has no inertia, at m.*, and it would jump, accepted: a mass"),
        ({"nodes": FREE}, r"without 'rhoI' of the section s some rotations have no inertia, and no stiffness either"),
        (
            {"analysis": {**MOVING, "integrator": "conserving"}},
            r"analysis.integrator: found 'conserving' with a flexible member without mass",
        ),
        ({"section": {"EI3": 1.0, "rhoA": -1.0}}, r"sections.s.rhoA: found -1, accepted: zero or a number above"),
        ({"section": {"EI3": 1.0}}, r"sections.s: the key 'rhoA' is missing: members.m moves"),
    ],
)
def test_what_forces_leave_open_or_let_jump_is_refused(more, sentence):
    with pytest.raises(SceneError, match=f"^{sentence}"):
        solve(strip(**{"analysis": MOVING, **more}))


def test_a_load_that_grows_from_zero_may_act_on_a_light_strip():
    growing = {"growing": {"t": [0, 1], "value": [0, 1], "interpolation": "spline"}}
    loads = {"tip": {**PUSHED["tip"], "history": "growing"}}
    motion = solve(strip(MOVING, loads=loads, histories=growing))
    assert motion.last.position("B")[1] > 0.0


def test_a_light_strip_that_is_drawn_straight_again_is_told():
    loads = {"tip": {"type": "force", "node": "B", "value": [0, 3.0]}}
    with pytest.raises(SolveError, match=re.escape("where it is drawn straight, or snaps, it would have to jump")):
        solve(strip({"type": "dynamic", "end": 3.0, "accuracy": 1e-3}, loads=loads))
