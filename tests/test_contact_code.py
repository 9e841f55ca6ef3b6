"""Generated C of scenes in which members touch something: the same touches, or a status says that it does not."""

import ctypes
import importlib
import subprocess
import sys

import numpy as np
import pytest
from scenes import CARRIED
from test_codegen import built, needs_compiler, said
from test_contact_design import DRUM, FLOOR, pressed, two
from test_member_contact import leaves

from sfetcas import Scene, SceneError, SolveError, export, solve
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.solvers.globalised import Code

LOADS = {"arguments": ["loads.F.value"]}


def solver_of(scene, **more):
    return equilibrium_solver(scene, "c", touching=True, watched=True, **more)


def test_status_says_whether_the_same_touches():
    scene = two()
    found, wanted = [], []
    solver, near = solver_of(scene, **LOADS), None
    for load in np.linspace(0.2, -8.0, 7):
        outcome, results = solver.solve(np.array([0.0, load]), near)
        near = outcome.state if outcome.code is Code.SOLVED else near
        found.append(outcome.code is Code.SOLVED)
        assert outcome.code in (Code.SOLVED, Code.TOUCHES)
        step = solve(scene.replace({"loads.F.value": [0, float(load)]})).last
        wanted.append([entry["at"] is not None for entry in step.contacts.values()] == [True, False])
        if found[-1]:
            # Places are within elements of the mesh of the first loads.
            position = solver.by_name(results)["nodes.B.position"]
            assert position == pytest.approx(step.position("B"), abs=2e-5)
        else:
            assert np.isnan(results).all()
    assert found == wanted
    assert 1 < sum(wanted) < 6


def test_place_that_comes_to_the_end_of_its_member_is_another_one():
    scene = pressed({"c": DRUM})
    solver, codes = solver_of(scene, arguments=["nodes.B.position.0"]), []
    for length in (1.0, 0.9, 0.8, 0.76, 0.7):
        codes.append(solver.solve(np.array([length]))[0].code)
        at = solve(scene.replace({"nodes.B.position": [length, 0]})).last.contacts["c"]["at"]
        assert codes[-1] is (Code.SOLVED if at is not None and at < 1.0 else Code.TOUCHES)
    assert codes[0] is Code.SOLVED
    assert codes[-1] is Code.TOUCHES


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_obstacle_that_a_node_carries_is_looked_at_where_it_is(dimension):
    """A cantilever lifts a drum to the one above it."""
    drum = {**CARRIED["contacts"]["c"], "type": "circle" if dimension == "plane" else "cylinder"}
    section = {"plane": {"EI3": 1.0}, "space": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}}[dimension]
    parts = {**CARRIED, "sections": {"s": section}, "contacts": {"c": drum}, "dimension": dimension}
    parts["nodes"] = {**CARRIED["nodes"], "C": {"position": [0, -0.4], "support": "clamped"}}
    parts["loads"] = {"P": {"type": "force", "node": "D", "value": [0, 1]}}
    scene = Scene.from_dict({**parts, "analysis": {"accuracy": 1e-6}})
    solver = solver_of(scene, arguments=["loads.P.value.1"])
    loads = (-1.0, 1.0, 2.0, 2.3, 3.0)
    found = [solver.solve(np.array([load]))[0].code for load in loads]
    touches = [solve(scene.replace({"loads.P.value.1": load})).last.contacts["c"]["at"] is not None for load in loads]
    assert found == [Code.TOUCHES if touched else Code.SOLVED for touched in touches]
    assert 0 < sum(touches) < len(loads)


def test_carried_obstacle_that_touches():
    scene = Scene.from_dict(
        {
            **CARRIED,
            "sections": {"s": {"EI3": 1.0}},
            "loads": {"F": {"type": "force", "node": "B", "value": [0, -2]}},
            "analysis": {"accuracy": 1e-8},
        }
    )
    solver = solver_of(scene, **LOADS)
    for load in (-2.5, -1.0, -0.5):
        outcome, results = solver.solve(np.array([0.0, load]))
        step = solve(scene.replace({"loads.F.value": [0, load]})).last
        assert outcome.code is (Code.TOUCHES if step.contacts["c"]["at"] is None else Code.SOLVED)
        if outcome.code is Code.SOLVED:
            # Places are within elements of the mesh of the first load.
            assert solver.by_name(results)["nodes.B.position"] == pytest.approx(step.position("B"), abs=1e-7)


def test_members_that_touch_each_other_are_looked_at_too():
    """One cantilever comes to rest on another one, which is beside it all along."""
    scene = leaves(accuracy=1e-6)
    solver, near = solver_of(scene, arguments=["loads.tip.value.1"]), None
    for load in (-0.03, -0.6, -3.0, -6.0):
        outcome, results = solver.solve(np.array([load]), near)
        step = solve(scene.replace({"loads.tip.value.1": load})).last
        touches = step.contacts["pair"]["at"] is not None
        assert outcome.code is (Code.SOLVED if touches else Code.TOUCHES)
        if touches:
            near = outcome.state
            # Places are within elements of the mesh of the default load.
            np.testing.assert_allclose(solver.by_name(results)["nodes.a1.position"], step.position("a1"), atol=1e-6)


def test_thin_rods_that_cross_do_not_touch_themselves():
    """Thinner than it is from one place that is looked at to the next."""
    table = {
        "sections": {"rod": {"shape": "circle", "radius": 0.005, "E": 1e8, "nu": 0.3}},
        "nodes": {
            "A1": {"position": [-0.5, 0, 0], "support": "clamped"},
            "A2": {"position": [0.5, 0, 0]},
            "B1": {"position": [0.1, -0.5, 0.02], "support": "clamped"},
            "B2": {"position": [0.1, 0.5, 0.02]},
        },
        "members": {
            "lower": {"nodes": ["A1", "A2"], "section": "rod"},
            "upper": {"nodes": ["B1", "B2"], "section": "rod"},
        },
        "loads": {"down": {"type": "force", "node": "B2", "value": [0, 0, -0.05]}},
        "contacts": {"cross": {"type": "members", "members": ["upper", "lower"]}},
        "analysis": {"accuracy": 1e-6},
    }
    scene = Scene.from_dict(table)
    solver = solver_of(scene, arguments=["factor"])
    outcome, results = solver.solve()
    assert outcome.code is Code.SOLVED
    np.testing.assert_allclose(
        solver.by_name(results)["nodes.B2.position"], solve(scene).last.position("B2"), rtol=0, atol=1e-6
    )


def test_what_is_not_found_for_the_arguments_of_the_scene_is_not_written(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.import_module("sfetcas.parametric.watching"), "LEAST", 1.0)
    with pytest.raises(SolveError, match=r"says for the arguments of the scene: no equilibrium with what touches"):
        export(leaves(), tmp_path / "leaves")
    assert not list(tmp_path.iterdir())


def test_members_that_cross_are_seen_as_near_as_they_are():
    """A cantilever over a rigid bar that crosses it, between the places that are looked at: at 0.613 and 0.29."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0, 0]},
            "C": {"position": [0.613 - 0.4 * 0.29, -0.05, -0.29], "support": "clamped"},
            "D": {"position": [0.613 + 0.4 * 0.71, -0.05, 0.71]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "r": {"nodes": ["C", "D"], "type": "rigid"}},
        "loads": {"F": {"type": "force", "node": "B", "value": [0, -0.1, 0]}},
        "contacts": {"c": {"type": "members", "members": ["m", "r"], "radius": 0.01}},
        "analysis": {"accuracy": 1e-7},
    }
    scene = Scene.from_dict(table)
    solver = solver_of(scene, arguments=["loads.F.value.1"])
    # As the cantilever bends in proportion to the load the gap of 0.03 is closed at -0.2004.
    gap = solve(scene.replace({"loads.F.value.1": -0.195})).last.contacts["c"]["gap"]
    load = -0.195 * 0.03 / (0.03 - gap)
    # A parabola of places a 64th apart is off by less than 1e-4 of the gap that there was.
    codes = [solver.solve(np.array([share * load]))[0].code for share in (0.997, 1.003)]
    assert codes == [Code.SOLVED, Code.TOUCHES]


def codes_of_both(solver, folder, cases):
    """The codes of an exported solver for arguments, cold, after its results in C have the bits of the process."""
    said(built(folder, "structure"))
    subprocess.run(["make", "CC=gcc", "-s"], cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / ("libstructure.dylib" if sys.platform == "darwin" else "libstructure.so")))
    doubles = ctypes.POINTER(ctypes.c_double)
    memory = ctypes.create_string_buffer(10_000_000)
    codes = []
    for case in cases:
        outcome, results = solver.solve(np.array(case))
        given, state, there = np.array(case), np.zeros(solver.method.states), np.zeros(solver.results.size)
        pointers = [x.ctypes.data_as(doubles) for x in (given, state, there)]
        codes.append(Code(library.structure_solve(memory, pointers[0], pointers[1], 0, pointers[2], None)))
        assert codes[-1] == outcome.code
        np.testing.assert_array_equal(there, results)
    return codes


@needs_compiler
def test_c_has_the_bits_of_the_process(tmp_path):
    made = export(pressed({"c": DRUM}), tmp_path / "c", **LOADS)
    cases = [[0.0, -2.0], [0.3, -2.5], [0.0, -1.0], [0.0, 1.0], [-10.0, -20.0]]
    codes = codes_of_both(made, tmp_path / "c", cases)
    # The last one is followed from the first.
    assert codes == [Code.SOLVED, Code.SOLVED, Code.TOUCHES, Code.TOUCHES, Code.SOLVED]
    assert "STRUCTURE_TOUCHES = 6" in (tmp_path / "c" / "structure.h").read_text()


def test_what_does_not_touch_is_looked_at_too():
    scene = pressed({"c": {**FLOOR, "point": [0, -1.2]}}, load=(0, -0.5))
    solver = solver_of(scene, **LOADS)
    assert solver.solve()[0].code is Code.SOLVED
    # From 0.9 on the tip would be below the floor, whatever the load.
    low = pressed({"c": {**FLOOR, "point": [0, -0.3]}}, load=(0, -0.5))
    assert [solver_of(low, **LOADS).solve(np.array([0.0, y]))[0].code for y in (-0.9, -1.1)] == [
        Code.SOLVED,
        Code.TOUCHES,
    ]


@pytest.mark.parametrize(
    ("contacts", "more", "given", "sentence"),
    [
        (
            {"c": DRUM},
            {},
            {"arguments": ["contacts.c.radius"]},
            "arguments.contacts.c.radius: found a number of an obst",
        ),
        ({"c": {"type": "point", "position": [0.6, -0.1], "side": [0, 1]}}, {}, {}, "an edge without member_radius"),
        ({"c": {**FLOOR, "friction": 0.2}}, {}, {}, "what sticks and slides depends on the steps before, and is not"),
    ],
    ids=["number", "edge", "friction"],
)
def test_refused(contacts, more, given, sentence, tmp_path):
    with pytest.raises(SceneError, match=sentence):
        export(pressed(contacts, **more), tmp_path / "c", **given)
