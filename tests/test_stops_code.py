"""Generated C of scenes with stops and strings: the same are taut and at a stop, or a status says that they are not."""

import importlib
import itertools
from pathlib import Path

import numpy as np
import pytest
from scenes import made
from test_codegen import needs_compiler
from test_contact_code import codes_of_both
from test_stops import STOP, lever

from sfetcas import SceneError, SolveError, export, load, solve
from sfetcas.mechanics.margins import margins
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.parametric.watching import BEYOND
from sfetcas.solvers.globalised import Code
from sfetcas.solvers.prepared import Prepared, Solved

PROBLEMS = Path(__file__).parent.parent / "problems"


def solver_of(scene, **more):
    return equilibrium_solver(scene, "c", stopped=True, touching=True, watched=True, **more)


def along():
    """A clamped rod with a stop for its tip, and a string from its middle that hangs loose first."""
    table = lever([1.0])
    table["nodes"]["A"]["support"] = "clamped"
    table["nodes"]["H"] = {"position": [0.5, 0]}
    table["members"] = {n: {"nodes": list(n), "section": "s"} for n in ("AH", "HB")}
    table["springs"] = {
        "k": {"type": "translational", "node": "B", "stiffness": 0.5, "direction": [0, 1], "stop": [-0.1, 0.2]}
    }
    table["tendons"] = {"string": {"way": [{"node": "H"}, {"ground": [0.6, -0.5]}], "length": 0.6}}
    return table


def wound():
    """A rod on a hinge, wound up by a moment to a stop beyond a turn."""
    table = lever([1.0], dimension="space", stop=(-4.0, 7.5))
    table["nodes"]["A"] |= {"axis": [0, 0, 1]}
    table["loads"]["f"] = {"type": "moment", "node": "B", "value": [0, 0, 1.0]}
    return table


SCENES = {
    "wound": lambda: (made(wound()), "loads.f.value.2", (14.8, 14.9, 15.1, 15.2)),
    "hinge": lambda: (made(lever([1.0])), "loads.f.value.1", (-9.0, -3.0, 0.5, 2.0, 9.0)),
    "hinge in space": lambda: (made(lever([1.0], dimension="space")), "loads.f.value.1", (-3.0, 0.5, 3.0)),
    "stop and string": lambda: (made(along()), "loads.f.value.1", (-3.0, -0.2, 0.5, 2.0, 6.0)),
    "arch and string": lambda: (
        load(PROBLEMS / "arch_caught_by_a_string.toml").replace(
            {"analysis": {"steps": [5], "accuracy": 1e-8}, "expect": ()}
        ),
        "factor",
        (3.0, 5.0, 20.0),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_status_says_whether_the_same_acts(name):
    """Of two loads each solver made for one knows the other one if in statics the same acts."""
    scene, number, values = SCENES[name]()
    answers, solvers = {}, {}
    for value in values:
        there = scene.replace({"analysis.steps": [value]} if number == "factor" else {number: value})
        answers[value] = solve(there).last
        solvers[value] = solver_of(there, arguments=[number])
    acting = {value: answer.model.mesh.stops for value, answer in answers.items()}
    assert len(set(acting.values())) > 1
    for here, there in itertools.product(values, values):
        outcome, results = solvers[here].solve(np.array([there]))
        same = acting[here] == acting[there]
        assert outcome.code is (Code.SOLVED if same else Code.TOUCHES), (here, there)
        if same:
            node = "B" if "B" in scene.nodes else "load"
            # Meshes of one load may be coarser than the other one asks for.
            found = solvers[here].by_name(results)[f"nodes.{node}.position"]
            assert found == pytest.approx(answers[there].position(node), abs=1e-5)
        else:
            assert np.isnan(results).all()


@pytest.mark.parametrize("name", SCENES)
def test_margins_are_those_of_statics(name):
    scene, number, values = SCENES[name]()
    for value in values:
        solver = solver_of(
            scene.replace({"analysis.steps": [value]} if number == "factor" else {number: value}), arguments=[number]
        )
        p = np.array([value])
        outcome, _ = solver.solve(p)
        found = np.array(solver.margins(p, outcome.state, solver.prepare(p))).ravel() + BEYOND
        state = solver.arguments.program.equations.state(outcome.state)
        loading = solver.model.loading(value if number == "factor" else scene.analysis.steps[-1])
        wanted = margins(Solved.taken(Prepared(solver.model), state, loading).fields)
        # Rounding of sums over the elements, of numbers of the size of the loads.
        assert found == pytest.approx(list(wanted.values()), abs=1e-9 * max(1.0, abs(value)))


def test_a_place_of_a_stop_may_be_an_argument():
    scene = made(lever([3.0]))
    solver = solver_of(scene, arguments=["springs.k.stop.1"])
    for high in (0.5, 0.3, 0.1):
        outcome, results = solver.solve(np.array([high]))
        assert outcome.code is Code.SOLVED
        wanted = solve(scene.replace({"springs.k.stop": [STOP[0], high]})).last.position("B")
        assert solver.by_name(results)["nodes.B.position"] == pytest.approx(wanted, abs=1e-7)
    # The free lever would turn by 1.06 rad.
    assert solver.solve(np.array([1.5]))[0].code is Code.TOUCHES
    # Zero is between the sides of a stop, and that of an angle is an angle.
    assert solver.solve(np.array([-0.1]))[0].code is Code.BAD_ARGUMENT
    assert [one.unit for one in solver.arguments.arguments] == ["rad"]


def test_a_number_on_which_nothing_depends_is_refused():
    with pytest.raises(SceneError, match=r"arguments.analysis.accuracy: found a number on which nothing depends"):
        solver_of(made(along()), arguments=["analysis.accuracy"])
    # That of a loose string is one on which it depends that it is loose.
    loose = solver_of(made(along()).replace({"loads.f.value.1": -0.2}), arguments=["tendons.string.length"])
    assert [loose.solve(np.array([length]))[0].code for length in (0.6, 0.4)] == [Code.SOLVED, Code.TOUCHES]


@needs_compiler
def test_c_has_the_bits_of_the_process(tmp_path):
    solver = export(made(along()), tmp_path / "c", arguments=["loads.f.value.1"], sensitivities=True)
    codes = codes_of_both(solver, tmp_path / "c", [[value] for value in (1.0, 0.9, 6.0, -3.0, 0.5, np.nan)])
    assert {Code.SOLVED, Code.TOUCHES, Code.BAD_ARGUMENT} <= set(codes)


def test_what_is_not_found_for_the_arguments_of_the_scene_is_not_written(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.import_module("sfetcas.parametric.watching"), "BEYOND", 1.0)
    with pytest.raises(SolveError, match=r"says for the arguments of the scene: .*: others are"):
        export(made(lever([1.0])), tmp_path / "lever")
    assert not list(tmp_path.iterdir())
