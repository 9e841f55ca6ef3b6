"""Motions of scenes against themselves: placed, measured and modelled otherwise they are the same."""

import copy

import numpy as np
import pytest
from motions import FLAT, SMOOTH, THICK, cantilever, changed, moved, tip

import sfetcas
from sfetcas import Scene
from sfetcas.dynamics.simulation import Simulation
from sfetcas.mathematics import quaternion as quat

pytestmark = pytest.mark.usefixtures("interpreted")

SAME = 1e-10
"""Of the size: the same steps in other axes or units, with rounding of some hundred of them."""


def frame():
    """Members of all types, hinges, springs, masses, damping, a motion and loads of all kinds."""
    return {
        "gravity": [0.0, -2.0, 0.0],
        "sections": {"s": FLAT | {"damping": 0.01, "drag": 0.05}, "stiff": FLAT | {"EI3": 200.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "hinge"},
            "B": {"position": [1, 0.2, 0], "mass": 0.1, "inertia": [0.01, 0.01, 0.02], "drag": 0.1},
            "C": {"position": [1.8, -0.2, 0], "joint": "hinge"},
            "D": {"position": [2.5, 0.1, 0]},
            "E": {"position": [3.0, 0.4, 0], "velocity": [0.3, -0.2, 0.0]},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {"nodes": ["B", "C"], "section": "s", "type": "rigid"},
            "three": {"nodes": ["C", "D"], "section": "s"},
            "four": {"nodes": ["D", "E"], "section": "stiff", "type": "small"},
        },
        "springs": {
            "foot": {"node": "A", "stiffness": 3.0, "damping": 0.02},
            "knee": {"node": "C", "stiffness": 0.5, "between": ["two", "three"], "damping": 0.01},
            "line": {"type": "translational", "node": "E", "stiffness": 2.0, "anchor": [3, -1, 0], "damping": 0.05},
        },
        "loads": {
            "push": {"type": "force", "node": "E", "value": [0.5, 1.0, 0.0], "history": "on"},
            "follow": {"type": "force", "node": "D", "value": [0.0, -1.0, 0.0], "frame": "follower", "history": "on"},
            "spread": {"type": "distributed", "member": "three", "value": [0.4, -0.7, 0], "history": "on"},
            "twist": {"type": "moment", "node": "B", "value": [0, 0, 0.4], "history": "on"},
        },
        "motions": {"foot": {"node": "A", "displacement": [0.1, 0.2, 0.0], "history": "on"}},
        "histories": {"on": SMOOTH},
    }


def spatial():
    """Bent in space: clamped, with a hinge, a ball, a mass and dead, distributed and follower loads."""
    return {
        "gravity": [0.3, -1.0, -2.0],
        "sections": {"s": THICK | {"damping": 0.01, "drag": 0.05}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0.2, 0.1], "joint": "hinge", "axis": [0.0, 1.0, 0.3], "mass": 0.1},
            "C": {"position": [1.8, -0.2, 0.5], "mass": 0.2, "inertia": [0.02, 0.03, 0.04]},
            "D": {"position": [2.4, 0.1, 0.2]},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {"nodes": ["B", "C"], "section": "s"},
            "three": {"nodes": ["C", "D"], "section": "s", "type": "rigid"},
        },
        "springs": {
            "knee": {"node": "B", "stiffness": 2.0, "axis": [0.0, 1.0, 0.3], "between": ["one", "two"], "damping": 0.02}
        },
        "loads": {
            "push": {"type": "force", "node": "D", "value": [0.3, 1.0, -0.4], "history": "on"},
            "follow": {"type": "force", "node": "C", "value": [0.0, -0.3, 0.3], "frame": "follower", "history": "on"},
            "spread": {"type": "distributed", "member": "two", "value": [0.4, -0.7, 0.2], "history": "on"},
            "twist": {"type": "moment", "node": "C", "value": [0.1, 0.2, 0.4], "history": "on"},
        },
        "motions": {
            "foot": {"node": "A", "displacement": [0.1, 0.2, 0.3], "rotation": [0.2, -0.3, 0.4], "history": "on"}
        },
        "histories": {"on": SMOOTH},
    }


SCENES = {"plane": frame(), "space": spatial()}
scenes = pytest.mark.parametrize("table", SCENES.values(), ids=SCENES.keys())
ENDS = {"plane": "E", "space": "D"}


def ends(motion):
    return np.array([motion.last.position(name) for name in motion.last.model.nodes])


@pytest.fixture(scope="module", params=list(SCENES))
def plain(request):
    table = SCENES[request.param]
    return table, moved(table, 1.2, 0.02)


def turned(table, turn, shift):
    """A scene in other axes."""
    table = copy.deepcopy(table)

    def vector(value):
        return (turn @ np.resize(value, 3)).tolist()

    for node in table["nodes"].values():
        node["position"] = (turn @ node["position"] + shift).tolist()
        for key in ("velocity", "axis"):
            if key in node:
                node[key] = vector(node[key])
    for spring in table.get("springs", {}).values():
        if "anchor" in spring:
            spring["anchor"] = (turn @ spring["anchor"] + shift).tolist()
        if "axis" in spring:
            spring["axis"] = vector(spring["axis"])
    for load in table["loads"].values():
        load["value"] = vector(load["value"])
    for motion in table.get("motions", {}).values():
        for key in ("displacement", "rotation"):
            if key in motion:
                motion[key] = vector(motion[key])
    table["gravity"] = vector(table["gravity"])
    if "C" in table["nodes"] and "inertia" in table["nodes"]["C"]:
        table["nodes"]["C"]["inertia"] = [0.03, 0.03, 0.03]
    if turn[2, 2] < 1.0 or any("axis" in node for node in table["nodes"].values()):
        for member in table["members"].values():
            member["b2"] = vector([0.1, 0.3, 1.0])
    return table


def test_turned_and_moved():
    for name, angle, shift in (("plane", [0, 0, 0.8], [3.0, -1.0, 0.0]), ("space", [0.4, -0.7, 0.3], [1.0, 2.0, -3.0])):
        table = SCENES[name]
        turn = quat.matrix(quat.from_rotation_vector(np.array(angle)))
        first = ends(moved(turned(table, np.eye(3), np.zeros(3)), 1.2, 0.02))
        other = ends(moved(turned(table, turn, np.array(shift)), 1.2, 0.02))
        assert np.abs(other - (first @ turn.T + shift)).max() < SAME


def test_a_plane_scene_in_space():
    table = frame()
    thick = changed(table, dimension="space")
    for section in thick["sections"].values():
        section |= {"EI2": 5.0, "GJ": 3.0}
    # Angles and quaternions are interpolated otherwise: the same with fine elements only.
    plane, space = (ends(moved(each, 1.2, 0.02, element="SFET8", elements=2)) for each in (table, thick))
    assert np.abs(space - plane).max() < SAME


ORDERS = {"radau-3": (5, 0.02), "radau-2": (3, 0.02), "generalised-alpha": (2, 0.01), "conserving": (2, 0.01)}
"""Order and the longer of two steps, s."""


@pytest.mark.parametrize("integrator", ORDERS)
def test_integrators_agree_in_the_limit(plain, integrator):
    table, _ = plain
    if integrator == "conserving":
        del (table := copy.deepcopy(table))["loads"]["follow"]
    order, step = ORDERS[integrator]
    there = ends(moved(table, 1.2, 0.005))
    apart = [np.abs(ends(moved(table, 1.2, step / k, integrator)) - there).max() for k in (1, 2)]
    assert np.log2(apart[0] / apart[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("velocity", [[3.0, -2.0, 0.0], [30.0, -20.0, 10.0]])
@pytest.mark.parametrize("integrator", ORDERS)
def test_a_common_velocity_changes_nothing(velocity, integrator):
    table = changed(cantilever(THICK, (0.3, 1.0, -0.4)), nodes__A__support="free")
    table["nodes"]["B"] |= {"mass": 0.4, "velocity": [0.1, 0.5, -0.2]}
    table["nodes"]["A"]["velocity"] = [0.1, -0.5, 0.3]
    fast = copy.deepcopy(table)
    for node in fast["nodes"].values():
        node["velocity"] = np.add(node["velocity"], velocity).tolist()
    first, other = (ends(moved(each, 1.0, 0.05, integrator)) for each in (table, fast))
    assert np.abs(other - first - velocity).max() < SAME * max(np.abs(velocity))


UNITS = {"millimetres": 1e3, "micrometres": 1e6, "kilometres": 1e-3}


def measured(table, length, force=1.0):
    """A scene with seconds and other units of length and force: numbers are so many times as large."""
    table = copy.deepcopy(table)
    mass, moment = force / length, force * length
    for section in table["sections"].values():
        for key in ("EI2", "EI3", "GJ"):
            if key in section:
                section[key] *= force * length**2
        for key in ("rhoA", "drag"):
            section[key] = section.get(key, 0.0) * mass / length
        section["rhoI"] = [mass * length * part for part in section["rhoI"]]
    for node in table["nodes"].values():
        for key, unit in (("position", length), ("velocity", length), ("inertia", mass * length**2)):
            if key in node:
                node[key] = [unit * part for part in node[key]]
        for key in ("mass", "drag"):
            if key in node:
                node[key] *= mass
    for spring in table["springs"].values():
        line = spring.get("type") == "translational"
        for key in ("stiffness", "damping"):
            spring[key] *= mass if line else moment
        if "anchor" in spring:
            spring["anchor"] = [length * part for part in spring["anchor"]]
    of_loads = {"force": force, "moment": moment, "distributed": force / length}
    for load in table["loads"].values():
        load["value"] = [of_loads[load["type"]] * part for part in load["value"]]
    for motion in table["motions"].values():
        motion["displacement"] = [length * part for part in motion["displacement"]]
    table["gravity"] = [length * part for part in table["gravity"]]
    return table


@pytest.mark.parametrize("length", UNITS.values(), ids=UNITS.keys())
@pytest.mark.parametrize("force", [1.0, 1e-3])
@scenes
def test_units(table, length, force):
    first, other = moved(table, 1.2, 0.02), moved(measured(table, length, force), 1.2, 0.02)
    assert np.abs(ends(other) / length - ends(first)).max() < SAME
    assert other.last.energy["total"] / force / length == pytest.approx(first.last.energy["total"], rel=1e-8)
    assert np.abs(other.last.momentum["linear"] / force - first.last.momentum["linear"]).max() < 1e-8
    assert np.abs(other.last.momentum["angular"] / force / length - first.last.momentum["angular"]).max() < 1e-8
    assert np.abs(other.last.reaction("A")[0] / force - first.last.reaction("A")[0]).max() < 1e-8


@scenes
def test_units_with_steps_by_the_accuracy(table):
    there = ends(moved(table, 1.2, 0.01, element="SFET6", elements=3))
    for length in (1.0, 1e3, 1e-3):
        motion = moved(measured(table, length), 1.2, accuracy=1e-5)
        assert motion.error_estimate < 1e-5
        # Of the size of the scene, 3 m.
        assert np.abs(ends(motion) / length - there).max() < 3e-5


@scenes
def test_the_order_of_the_tables_changes_nothing(table):
    other = copy.deepcopy(table)
    for key in ("nodes", "members", "springs", "loads"):
        other[key] = dict(reversed(other[key].items()))
    first, second = moved(table, 1.2, 0.02).last, moved(other, 1.2, 0.02).last
    assert max(np.abs(first.position(n) - second.position(n)).max() for n in table["nodes"]) < SAME


def test_a_member_the_other_way_round():
    table = frame()
    other = copy.deepcopy(table)
    for name in ("one", "two", "three"):
        other["members"][name]["nodes"].reverse()
    assert np.abs(ends(moved(other, 1.2, 0.02)) - ends(moved(table, 1.2, 0.02))).max() < SAME


def test_a_member_cut_in_two():
    table = cantilever(THICK, (0.3, 1.0, -0.4))
    table["sections"]["s"] |= {"damping": 0.02}
    cut = copy.deepcopy(table)
    cut["nodes"]["M"] = {"position": [0.5, 0, 0]}
    cut["members"] = {"m": {"nodes": ["A", "M"], "section": "s"}, "n": {"nodes": ["M", "B"], "section": "s"}}
    one, two = moved(table, 1.2, 0.02, elements=4), moved(cut, 1.2, 0.02, elements=2)
    assert np.abs(tip(one) - tip(two)).max() < SAME
    # Of the error that reactions have by the step.
    assert np.abs(one.last.reaction("A")[1] - two.last.reaction("A")[1]).max() < 1e-5


def test_forces_that_are_open_are_shared_as_in_statics():
    """At rest, of a force at 0.3 of a rod between clamps 0.7 go to the nearer one, as where it stretches."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [1, 0], "support": "clamped"},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"f": {"type": "force", "member": "m", "at": 0.3, "value": [1, 0]}},
            "analysis": {"type": "dynamic", "end": 0.01, "initial": "equilibrium", "step": 0.005},
        }
    )
    for step in sfetcas.solve(scene).steps:
        np.testing.assert_allclose(step.reaction("A")[0], [-0.7, 0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(step.along("m", [0.1, 0.5])["force"][:, 0], [0.7, -0.3], atol=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1.0 / 0.7071, 0.7071**2])
def test_a_time_that_rounding_keeps_from_another_one_is_no_further_one(unit):
    """Eleven intervals, the sixth of which ends at a time that an expectation tells: 0.3 is not six times 0.05."""
    table = cantilever()
    table["analysis"] = {"type": "dynamic", "end": 0.55 * unit, "output": 0.05 * unit}
    table["expect"] = [{"quantity": "nodes.B.position", "time": 0.3 * unit, "value": [0, 0, 0], "tolerance": 1.0}]
    times = Simulation(Scene.from_dict(table), sfetcas.Settings(), None).times
    assert len(times) == 12
    assert {0.3 * unit, 0.55 * unit} <= set(times.tolist())
