"""Generated C of scenes with stops and strings: for all values it finds which of them are taut and at a stop."""

import importlib
import itertools
from pathlib import Path

import numpy as np
import pytest
from scenes import made
from test_codegen import needs_compiler
from test_contact_code import codes_of_both
from test_stops import STOP, lever

from sfetcas import Scene, SceneError, SolveError, export, load, parametric, solve
from sfetcas.mechanics.margins import margins
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.solvers.globalised import Code

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


def changed(scene, number, value):
    return scene.replace({"analysis.steps": [value]} if number == "factor" else {number: value})


@pytest.mark.parametrize("name", SCENES)
def test_what_acts_is_that_of_statics(name):
    """Each solver, made for one load, finds for all others what acts in statics."""
    scene, number, values = SCENES[name]()
    answers = {value: solve(changed(scene, number, value)).last for value in values}
    assert len({answer.model.mesh.stops for answer in answers.values()}) > 1
    for here in values:
        solver = solver_of(changed(scene, number, here), arguments=[number])
        for there, answer in answers.items():
            outcome, results = solver.solve(np.array([there]))
            assert outcome.code is Code.SOLVED, (here, there)
            acting = [one.active(answer.model.mesh.stops) for one in solver.switches.constraints]
            np.testing.assert_array_equal(solver.switches.acting(outcome.state) != 0.0, acting)
            node = "B" if "B" in scene.nodes else "load"
            # Meshes of one load may be coarser than the other one asks for.
            found = solver.by_name(results)[f"nodes.{node}.position"]
            assert found == pytest.approx(answer.position(node), abs=1e-5)


@pytest.mark.parametrize("name", SCENES)
def test_margins_are_those_of_statics(name):
    scene, number, values = SCENES[name]()
    for value in values:
        there = changed(scene, number, value)
        solver = solver_of(there, arguments=[number])
        state = solver.solve(np.array([value]))[0].state
        switches, answer = solver.switches, solve(there, elements=4).last
        acting = switches.acting(state) != 0.0
        found = switches.signs * np.where(acting, state[switches.multipliers], -state[switches.openings])
        wanted = [margins(answer.fields)[one] for one in switches.constraints]
        # Differences of the meshes.
        assert found == pytest.approx(wanted, rel=1e-5, abs=1e-6)
        assert (found >= 0.0).all()
        # What does not act is exactly zero.
        assert not state[np.where(acting, switches.openings, switches.multipliers)].any()


def test_a_warm_start_keeps_what_acts_or_switches_it():
    scene, number, values = SCENES["stop and string"]()
    solver = solver_of(scene, arguments=[number])
    state = None
    for value in [*values, *values[::-1]]:
        warm, results = solver.solve(np.array([value]), start=state)
        cold, wanted = solver.solve(np.array([value]))
        assert (warm.code, cold.code) == (Code.SOLVED, Code.SOLVED)
        # Rounding of Newton's method from another state.
        assert results == pytest.approx(wanted, rel=1e-8, abs=1e-9)
        state = warm.state


def test_of_what_a_symmetry_makes_the_same_the_first_is_switched_first():
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "tendons": {
            name: {"way": [{"node": "B"}, {"ground": [1.0, y]}], "length": 0.5}
            for name, y in (("up", 0.5), ("down", -0.5))
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 0.0]}},
    }
    scene = Scene.from_dict(table)
    solver = solver_of(scene, arguments=["loads.f.value.1", "tendons.up.length", "tendons.down.length"])
    for force, up, down in itertools.product((-3.0, 0.0, 3.0), (0.55, 0.7), (0.55, 0.7)):
        outcome, results = solver.solve(np.array([force, up, down]))
        there = scene.replace({"loads.f.value.1": force, "tendons.up.length": up, "tendons.down.length": down})
        answer = solve(there).last
        assert outcome.code is Code.SOLVED
        acting = [one.active(answer.model.mesh.stops) for one in solver.switches.constraints]
        np.testing.assert_array_equal(solver.switches.acting(outcome.state) != 0.0, acting)
        assert solver.by_name(results)["nodes.B.position"] == pytest.approx(answer.position("B"), abs=1e-6)


def test_a_place_of_a_stop_may_be_an_argument():
    scene = made(lever([3.0]))
    solver = solver_of(scene, arguments=["springs.k.stop.1"])
    for high in (0.5, 0.3, 0.1):
        outcome, results = solver.solve(np.array([high]))
        assert outcome.code is Code.SOLVED
        wanted = solve(scene.replace({"springs.k.stop": [STOP[0], high]})).last.position("B")
        assert solver.by_name(results)["nodes.B.position"] == pytest.approx(wanted, abs=1e-7)
    # The free lever turns by 1.06 rad.
    outcome, results = solver.solve(np.array([1.5]))
    assert outcome.code is Code.SOLVED
    free = solve(scene.replace({"springs.k.stop": [STOP[0], 1.5]})).last
    assert not free.model.mesh.stops
    assert solver.by_name(results)["nodes.B.position"] == pytest.approx(free.position("B"), abs=1e-6)
    # Zero is between the sides of a stop, and that of an angle is an angle.
    assert solver.solve(np.array([-0.1]))[0].code is Code.BAD_ARGUMENT
    assert [one.unit for one in solver.arguments.arguments] == ["rad"]


def test_a_number_on_which_nothing_depends_is_refused():
    with pytest.raises(SceneError, match=r"arguments.analysis.accuracy: found a number on which nothing depends"):
        solver_of(made(along()), arguments=["analysis.accuracy"])
    # That of a loose string is one on which it depends that it is loose.
    loose = solver_of(made(along()).replace({"loads.f.value.1": -0.2}), arguments=["tendons.string.length"])
    tensions = []
    for length in (0.6, 0.4):
        outcome, results = loose.solve(np.array([length]))
        assert outcome.code is Code.SOLVED
        tensions.append(loose.by_name(results)["tendons.string.tension"])
    assert tensions[0] == 0.0 < tensions[1]


@needs_compiler
@pytest.mark.parametrize("name", ["stop and string", "hinge in space"])
def test_c_has_the_bits_of_the_process(name, tmp_path):
    scene, number, values = SCENES[name]()
    solver = export(scene, tmp_path / "c", arguments=[number], sensitivities=True)
    codes = codes_of_both(solver, tmp_path / "c", [[value] for value in (*values, np.nan)])
    assert codes == [*[Code.SOLVED] * len(values), Code.BAD_ARGUMENT]


@needs_compiler
def test_c_begins_anew_as_the_process_does(tmp_path):
    """Beyond its snap the arch has no equilibrium without the string that is loose before."""
    scene, number, _ = SCENES["arch and string"]()
    # Compliances hang on what acts, too.
    names = ["nodes.load.position", "tendons.string.tension", "compliance.load"]
    solver = export(changed(scene, number, 3.0), tmp_path / "c", arguments=[number], results=names)
    assert codes_of_both(solver, tmp_path / "c", [[20.0]]) == [Code.SOLVED]


def test_compliance_is_that_with_what_acts():
    for value in (-3.0, 0.5, 2.0):
        scene = made(along()).replace({"loads.f.value.1": value})
        solver = solver_of(scene, arguments=["loads.f.value.1"], results=["compliance.H"])
        outcome, results = solver.solve()
        found = parametric(scene, ["loads.f.value.1"], ["compliance.H"]).solve()
        pushed = []
        for force in (-1e-4, 1e-4):
            push = {"type": "force", "node": "H", "value": [0, force]}
            pushed.append(solve(scene.replace({"loads.push": push})).last.position("H")[1])
        # Central differences of positions to 1e-12 or so.
        wanted = pytest.approx((pushed[1] - pushed[0]) / 2e-4, rel=1e-6)
        assert outcome.code is Code.SOLVED
        assert solver.by_name(results)["compliance.H"][1, 1] == wanted
        assert found["compliance.H"][1, 1] == wanted


def linked():
    """Two rigid links with a string and stops of which only a path along growing loads finds a choice that holds."""
    turning = {"node": "B", "between": ["AB", "BC"], "stiffness": 1.915, "stop": [-0.0264, 0.0214]}
    sliding = {"type": "translational", "node": "C", "direction": [-1.5301, -0.4778], "stiffness": 0.385}
    return Scene.from_dict(
        {
            "nodes": {
                "A": {"position": [0, 0], "support": "hinge"},
                "B": {"position": [-1.0174, -0.2867], "joint": "hinge"},
                "C": {"position": [-1.5893, -0.5793]},
            },
            "members": {name: {"nodes": list(name), "type": "rigid"} for name in ("AB", "BC")},
            "springs": {"k": turning, "t": {**sliding, "stop": [-0.2768, 0.0802]}},
            "tendons": {"s": {"way": [{"node": "C"}, {"ground": [-1.4788, -0.5155]}], "length": 0.1356}},
            "loads": {"m": {"type": "moment", "node": "C", "value": -0.196}},
        }
    )


def test_what_is_found_along_a_path_only_is_parametric_and_exported():
    scene = linked()
    wanted = solve(scene).last
    assert any("along a path" in note for note in wanted.notes)
    names = ["nodes.C.position", "tendons.s.tension", "springs.k.stop", "springs.t.stop"]
    found = parametric(scene, ["loads.m.value"], names).solve()
    solver = solver_of(scene, results=names)
    outcome, results = solver.solve()
    assert outcome.code is Code.SOLVED
    told = [wanted.position("C"), wanted.tendon("s")["tension"], *(wanted.fields.spring(k).stop for k in ("k", "t"))]
    for by_name in (found.answers, solver.by_name(results)):
        for name, value in zip(names, told, strict=True):
            assert by_name[name] == pytest.approx(value, abs=1e-12)
    assert [one.unit for one in solver.results.results] == ["m", "N", "N m", "N"]


def test_where_newton_fails_from_afar_parameters_begin_with_statics():
    """Two strings hold the end of a straight rod between them, which keeps its length."""
    length = 0.5**0.5
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "tendons": {
                name: {"way": [{"node": "B"}, {"ground": [0.5, y]}], "length": length}
                for name, y in (("up", 0.5), ("down", -0.5))
            },
            "loads": {"f": {"type": "force", "node": "B", "value": [0, 1]}},
            "analysis": {"accuracy": 1e-7},
        }
    )
    numbers = ["loads.f.value", "tendons.up.length", "tendons.down.length"]
    values = {"loads.f.value": [2, -2], **dict.fromkeys(numbers[1:], 0.99999 * length)}
    found = parametric(scene, numbers, ["nodes.B.position", "tendons.up.tension", "tendons.down.tension"])
    outcome, _ = found.solver.solve(found.flat(values))
    assert outcome.code is Code.STALLED
    answer, wanted = found.solve(values), solve(found.scene_at(values)).last
    assert answer["nodes.B.position"] == pytest.approx(wanted.position("B"), abs=1e-9)
    for name in ("up", "down"):
        # Of positions to 1e-9, beside a shortening of 1e-5.
        assert answer[f"tendons.{name}.tension"] == pytest.approx(wanted.tendon(name)["tension"], rel=1e-4)


def test_derivatives_are_those_of_what_acts():
    scene, number, values = SCENES["stop and string"]()
    solver = solver_of(scene, arguments=[number])
    for value in values:
        outcome, _ = solver.solve(np.array([value]))
        given = solver.switches.given(np.array(solver.prepare([value])).ravel(), solver.switches.acting(outcome.state))
        found = np.array(solver.sensitivities([value], outcome.state, given)).ravel()
        near = [solver.solve(np.array([value + step]))[1] for step in (-1e-4, 1e-4)]
        # Central differences, of results of the size of the loads.
        assert found == pytest.approx((near[1] - near[0]) / 2e-4, rel=1e-5, abs=1e-5)


def test_where_no_choice_holds_nothing_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.import_module("sfetcas.parametric.switched"), "BEYOND", -1.0)
    with pytest.raises(SolveError, match=r"says for the arguments.*no choice of stops and strings"):
        export(made(lever([1.0])), tmp_path / "lever")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["springs.k.stop", "springs.k.stop.0", "springs.k.stop.1"])
def test_sides_of_a_stop_have_their_signs(name):
    """As single numbers and as two."""
    solver = parametric(made(along()), [name], ["nodes.B.position"])
    wrong, accepted = {"stop": ([0.1, 0.2], "less"), "0": (0.1, "less"), "1": (-0.1, "more")}[name.split(".")[-1]]
    with pytest.raises(SceneError, match=f"found -?0.1, accepted: zero or {accepted}"):
        solver.solve({name: wrong})
