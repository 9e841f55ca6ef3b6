"""Motions at the edge: what turns only, what is let go, short steps, heavy masses, damping beyond critical."""

import math

import numpy as np
import pytest

import sfetcas
from sfetcas import Scene, Status

ROD = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}


def cantilever(**tables):
    return {
        "sections": {"r": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"b": {"nodes": ["A", "B"], "section": "r"}},
        "loads": {"F": {"type": "force", "node": "B", "value": [0, 1]}},
        **tables,
    }


def solved(table, **keys):
    return sfetcas.solve(Scene.from_dict({**table, "analysis": {"type": "dynamic", **keys}}))


def test_torsional_pendulum_is_followed_though_nothing_moves():
    table = {
        "dimension": "space",
        "sections": {"r": {**ROD, "rhoI": [2e-5, 1e-5, 1e-5]}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0, 0], "inertia": [0.1, 0.1, 0.1]},
        },
        "members": {"b": {"nodes": ["A", "B"], "section": "r"}},
        "loads": {"M": {"type": "moment", "node": "B", "value": [0.1, 0, 0]}},
    }
    motion = solved(table, end=5.0, output=1.0)
    # A third of the inertia of the rod swings with that of its end.
    omega = math.sqrt(1.0 / (0.1 + 2e-5 / 3.0))
    angles = [2.0 * math.atan2(step.quaternion("B")[1], step.quaternion("B")[0]) for step in motion.steps]
    # The accuracy, 1e-4, counts angles by the arm of the inertia, 0.3 m.
    assert angles == pytest.approx(0.1 * (1.0 - np.cos(omega * motion.times)), abs=4e-4)


def test_body_whose_only_support_is_let_go_flies():
    motion = solved(cantilever(), end=0.02, accuracy=1e-2, initial="equilibrium", release=["A"])
    # The load goes on: momentum is force times time, whatever vibrates.
    assert motion.last.momentum["linear"] == pytest.approx([0, 0.02, 0], abs=1e-6)


def test_slider_is_let_go_with_its_direction():
    nodes = {
        "A": {"position": [0, 0], "support": "clamped"},
        "B": {"position": [1, 0], "support": "slider", "direction": [1, 0]},
    }
    motion = solved(cantilever(nodes=nodes), end=0.05, step=0.005, initial="equilibrium", release=["B"])
    assert motion.last.position("B")[1] > 1e-4


@pytest.mark.parametrize("end", [1e-3, 1e-7])
def test_short_spans_are_no_singular_steps(end):
    motion = solved(cantilever(), end=end, output=end)
    # The force moves what its waves have reached, at these times more than a hundredth of the mass.
    assert 0.0 < motion.last.position("B")[1] < 50.0 * end**2
    assert motion.status is Status.SOLVED


def test_heavy_tip_moves_as_a_point():
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "mass": 1e6}}
    motion = solved(cantilever(nodes=nodes), end=2.0, output=2.0)
    # Neither the beam nor its stiffness of 3 N/m matters beside 1e6 kg: F t^2 / 2 m.
    assert motion.last.position("B")[1] == pytest.approx(2e-6, rel=1e-4)


def test_loop_of_rigid_links_with_hinges_in_space_is_that_of_the_plane():
    links = {n: {"nodes": list(n.upper()), "type": "rigid", "section": "r"} for n in ("ab", "bc", "cd")}
    table = {
        "gravity": [0, -9.81],
        "sections": {"r": {**ROD, "rhoI": [0, 0, 0]}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [0.1, 0.3], "joint": "hinge"},
            "C": {"position": [1, 0.5], "joint": "hinge"},
            "D": {"position": [1, 0], "support": "hinge"},
        },
        "members": links,
    }
    plane, space = (solved({**table, "dimension": d}, end=0.2, output=0.2, step=0.01) for d in ("plane", "space"))
    # Two of the three hinges of a link repeat what the others hold: the softness of rows leaves 1e-10.
    assert space.last.position("C") == pytest.approx(plane.last.position("C"), abs=1e-8)


def test_slack_rope_begins_in_its_equilibrium():
    table = {
        "gravity": [0, -9.81],
        "sections": {"rope": {"EI3": 0.001, "rhoA": 0.2}},
        "nodes": {"l": {"position": [0, 0], "support": "hinge"}, "r": {"position": [2, 0], "support": "hinge"}},
        "members": {"rope": {"nodes": ["l", "r"], "section": "rope", "shape": {"type": "arc", "angle": 2.0}}},
    }
    motion = solved(table, end=0.3, accuracy=1e-3, initial="equilibrium", output=0.3)
    first, last = (step.along("rope", [0.5])["position"] for step in (motion.steps[0], motion.last))
    assert np.abs(last - first).max() < 1e-3


def test_interrupted_check_leaves_the_whole_motion():
    ends = []

    def told(reached):
        if ends and reached < ends[-1]:
            raise KeyboardInterrupt
        ends.append(reached)

    scene = Scene.from_dict({**cantilever(), "analysis": {"type": "dynamic", "end": 0.2, "accuracy": 1e-3}})
    motion = sfetcas.solve(scene, progress=told)
    assert motion.status is Status.INTERRUPTED
    assert motion.last.time == pytest.approx(0.2)
    assert motion.error_estimate is None


@pytest.mark.parametrize(("damping", "waves"), [(0.01, 5), (0.1, 1), (1.0, 0)])
def test_waves_that_are_damped_beyond_critical_are_none(damping, waves):
    table = cantilever(sections={"r": {"EI3": 1.0, "rhoA": 1.0, "damping": damping}})
    del table["loads"]
    modes = sfetcas.solve(Scene.from_dict({**table, "analysis": {"type": "modes", "modes": 6}}))
    undamped = np.array([3.51601526850015, 22.0344915646668, 61.6972144135491, 120.901916052306, 199.859530116803])
    ratios = 0.5 * damping * undamped
    below = ratios < 1.0
    expected = np.sort(undamped[below] * np.sqrt(1.0 - ratios[below] ** 2))
    assert len(modes.omega) == waves == below.sum()
    # The accuracy asked for, 1e-4, of frequencies near critical grows by what their square loses.
    assert modes.omega == pytest.approx(expected, rel=1e-2)


def test_what_cannot_move_has_no_modes():
    table = cantilever(members={"b": {"nodes": ["A", "B"], "section": "r", "type": "rigid"}})
    modes = sfetcas.solve(Scene.from_dict({**table, "analysis": {"type": "modes"}}))
    assert len(modes.omega) == 0
