"""Contact beside springs with stops and tendons that may be slack: by hand, and with forces in their places."""

import numpy as np
import pytest
from scenes import made
from test_codegen import needs_compiler
from test_contact_code import codes_of_both
from test_member_contact import leaves

from sfetcas import SceneError, export, parametric, solve
from sfetcas.parametric.arguments import with_values
from sfetcas.solvers.globalised import Code

FLOOR = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}
PEG = {"type": "circle", "center": [0.5, -0.1], "radius": 0.1, "member": "m"}


def bars(force, push):
    """Two hinged rigid bars: a spring with a stop holds the first one, springs and a floor the second one."""
    return made(
        {
            "nodes": {
                "A": {"position": [0, 0], "support": "hinge"},
                "B": {"position": [1, 0], "joint": "hinge"},
                "C": {"position": [2, 0]},
            },
            "members": {
                "one": {"nodes": ["A", "B"], "type": "rigid"},
                "two": {"nodes": ["B", "C"], "type": "rigid"},
            },
            "springs": {
                "k": {"node": "A", "stiffness": 2.0, "stop": [-0.1, 0.1]},
                "s": {"node": "B", "between": ["one", "two"], "stiffness": 0.3},
            },
            "contacts": {"floor": {**FLOOR, "point": [0, -0.3], "members": ["two"]}},
            "loads": {
                "f": {"type": "force", "node": "B", "value": [0, -force]},
                "p": {"type": "force", "node": "C", "value": [0, -push]},
            },
            "analysis": {"accuracy": 1e-8},
        }
    )


def test_a_stop_and_a_floor_by_the_balance_of_rigid_bars():
    step, force, push = solve(bars(10.0, 3.0)).last, 10.0, 3.0
    low = np.arcsin(0.3 - np.sin(0.1))
    bent = 0.3 * (low - 0.1)
    floor = push - bent / np.cos(low)
    stop = (force + push - floor) * np.cos(0.1) + bent - 2.0 * 0.1
    # All is rigid: to rounding.
    assert step.contacts["floor"]["force"][1] == pytest.approx(floor, rel=1e-9)
    assert step.spring("k").stop == pytest.approx(stop, rel=1e-9)
    # Under less the floor is reached, and the stop is not.
    free = solve(bars(0.1, 0.5)).last
    assert free.spring("k").stop == 0.0
    assert free.spring("k").travel > -0.1
    assert free.contacts["floor"]["force"][1] > 0.1


def beam(**more):
    """A cantilever of the length and stiffness one."""
    return {
        "dimension": "plane",
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0.05], "support": "clamped"}, "B": {"position": [1, 0.05]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "analysis": {"accuracy": 1e-8},
        **more,
    }


def stopped(low, high=1.0):
    return {"k": {"type": "translational", "node": "B", "stiffness": 0.0, "direction": [0, 1], "stop": [low, high]}}


def string(length, node="B"):
    return {"t": {"way": [{"ground": [1.0, 1.0]}, {"node": node}], "length": length}}


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_stop_and_an_edge_by_the_linear_theory_of_beams(way):
    """Displacements by a force in the middle and one at the tip, of beams that are bent by so little."""
    height, deep, force = 1e-4, 5e-4, 0.01
    middle, tip = np.linalg.solve([[1 / 24, 5 / 48], [5 / 48, 1 / 3]], [-height, -deep])
    table = beam(
        contacts={"peg": {"type": "point", "position": [0.5, -way * height], "side": [0, way], "member": "m"}},
        springs=stopped(-deep) if way > 0.0 else stopped(-1.0, deep),
        loads={"f": {"type": "force", "node": "B", "value": [0, -way * force]}},
        analysis={"accuracy": 1e-12},
    )
    table["nodes"] = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}}
    step = solve(made(table)).last
    # What is not linear is the square of slopes of 1e-3.
    assert step.contacts["peg"]["force"][1] == pytest.approx(way * middle, rel=1e-4)
    assert step.spring("k").stop == pytest.approx(way * (tip + force), rel=1e-4)


HEAVY = {"gravity": [0, -10], "contacts": {"floor": FLOOR}}
BENT = {"contacts": {"peg": PEG}, "loads": {"f": {"type": "force", "node": "B", "value": [0, -3]}}}


@pytest.mark.parametrize(
    ("tables", "low"), [(HEAVY, -0.02), (HEAVY, -0.0495), (BENT, -0.2)], ids=["off the floor", "near it", "peg"]
)
def test_the_force_of_a_stop_in_its_place(tables, low):
    """What a stop gives is a force, and given as a load it leaves everything where it was."""
    step = solve(made(beam(**tables, springs=stopped(low)))).last
    loads = {**tables.get("loads", {}), "k": {"type": "force", "node": "B", "value": [0, step.spring("k").stop]}}
    loaded = solve(made(beam(**{**tables, "loads": loads}))).last
    assert step.spring("k").travel == pytest.approx(low, abs=1e-12)
    assert step.spring("k").stop > 0.1
    (name,) = tables["contacts"]
    assert step.contacts[name]["force"][1] > 0.1
    # Twice the accuracy asked for.
    np.testing.assert_allclose(step.position("B"), loaded.position("B"), atol=2e-8)
    np.testing.assert_allclose(step.contacts[name]["force"], loaded.contacts[name]["force"], atol=1e-5)


@pytest.mark.parametrize("tables", [HEAVY, BENT], ids=["floor", "peg"])
def test_what_is_off_its_stop_and_slack_does_nothing(tables):
    """At each load factor by itself."""
    table = beam(**tables, springs=stopped(-0.5), tendons=string(1.5))
    table["analysis"]["steps"] = [0.5, 1.0]
    without = {key: value for key, value in table.items() if key not in ("springs", "tendons")}
    (name,) = tables["contacts"]
    for step, alone in zip(solve(made(table)).steps, solve(made(without)).steps, strict=True):
        assert step.tendon("t")["slack"]
        assert step.spring("k").stop == 0.0
        np.testing.assert_allclose(step.position("B"), alone.position("B"), atol=2e-8)
        np.testing.assert_allclose(step.contacts[name]["force"], alone.contacts[name]["force"], atol=1e-5)
        assert step.contacts[name]["force"][1] > 0.1


def test_a_taut_string_beside_a_peg_is_its_force():
    step = solve(made(beam(**BENT, tendons=string(1.2)))).last
    pull, tension = np.array([1.0, 1.0, 0.0]) - step.position("B"), step.tendon("t")["tension"]
    assert np.linalg.norm(pull) == pytest.approx(1.2, abs=1e-12)
    assert tension > 0.1
    value = (tension * pull / np.linalg.norm(pull))[:2].tolist()
    loads = {**BENT["loads"], "t": {"type": "force", "node": "B", "value": value}}
    loaded = solve(made(beam(**{**BENT, "loads": loads}))).last
    assert step.contacts["peg"]["force"][1] > 0.1
    np.testing.assert_allclose(step.position("B"), loaded.position("B"), atol=2e-8)
    np.testing.assert_allclose(step.contacts["peg"]["force"], loaded.contacts["peg"]["force"], atol=1e-5)


@pytest.mark.parametrize(("length", "slack"), [(1.5, True), (1.1, False)])
def test_a_string_beside_members_that_touch_each_other(length, slack):
    step = solve(leaves(tendons=string(length, "a1"))).last
    told, loads = step.tendon("t"), dict(leaves().to_dict()["loads"])
    assert told["slack"] is slack
    if not slack:
        pull = np.array([1.0, 1.0, 0.0]) - step.position("a1")
        assert np.linalg.norm(pull) == pytest.approx(length, abs=1e-12)
        value = told["tension"] * pull / np.linalg.norm(pull)
        loads["t"] = {"type": "force", "node": "a1", "value": value.tolist()}
    loaded = solve(leaves(loads=loads)).last
    assert np.linalg.norm(step.contacts["pair"]["force"]) > 0.1
    # Twice the accuracy asked for.
    np.testing.assert_allclose(step.position("a1"), loaded.position("a1"), atol=2e-7)
    np.testing.assert_allclose(step.contacts["pair"]["force"], loaded.contacts["pair"]["force"], atol=1e-5)


def test_friction_beside_what_may_act_or_not_is_refused():
    """Which of them act is found for each step by itself."""
    rough = {"peg": {**PEG, "friction": 0.3}}
    with pytest.raises(SceneError, match=r"contacts\.peg: found friction beside stops"):
        made(beam(**{**BENT, "contacts": rough}, tendons=string(1.5)))


# -- as parameters, and in generated C ---------------------------------------------------------------------

PARAMETRIC = {
    "bars": (
        lambda: bars(10.0, 3.0),
        ["f.value.1", "p.value.1"],
        [(-9, -2.5), (-0.1, -0.5), (-10, -0.2), (-0.1, -0.01)],
    ),
    "peg, free": (
        lambda: made(beam(**HARDLY, springs=stopped(-0.2))),
        ["f.value.1"],
        [(-2.5,), (-1.2,), (-4,), (-0.3,)],
    ),
    "peg": (lambda: made(beam(**BENT, springs=stopped(-0.2))), ["f.value.1"], [(-2.5,), (-1.0,), (-0.4,), (-4,)]),
    "string": (lambda: made(beam(**BENT, tendons=string(1.2))), ["f.value.1"], [(-2.5,), (-1,), (-0.3,), (-4,)]),
    "floor": (
        lambda: made(beam(**HEAVY, springs=stopped(-0.02), loads=LIFT)),
        ["f.value.1"],
        [(1,), (3,), (-1,), (6,)],
    ),
    "each other": (lambda: leaves(tendons=string(1.1, "a1")), ["tip.value.1"], [(-2,), (-4,)]),
}
HARDLY = {**BENT, "loads": {"f": {"type": "force", "node": "B", "value": [0, -1]}}}
LIFT = {"f": {"type": "force", "node": "B", "value": [0, 0.5]}}


def told(step, asked):
    """Answers of statics by their names."""
    found = {}
    for name in asked:
        table, record, key = name.split(".")
        if table == "nodes":
            found[name] = step.position(record)
        elif table == "contacts":
            found[name] = step.contacts[record]["force"]
        else:
            found[name] = step.spring(record).stop if key == "stop" else step.tendon(record)["tension"]
    return found


def asked_of(scene):
    node = next(node for node, record in reversed(scene.nodes.items()) if record.support == "free")
    stops = [f"springs.{name}.stop" for name, one in scene.springs.items() if one.stop is not None]
    tensions = [f"tendons.{name}.tension" for name in scene.tendons]
    return [f"nodes.{node}.position", *(f"contacts.{name}.force" for name in scene.contacts), *stops, *tensions]


@pytest.mark.parametrize("name", ["bars", "peg", "peg, free", "string", "floor"])
def test_what_touches_and_what_stops_is_found_for_each_number(name):
    make, numbers, cases = PARAMETRIC[name]
    scene, changing = make(), [f"loads.{number}" for number in numbers]
    asked = asked_of(scene)
    solver, acted = parametric(scene, changing, asked), set()
    for case in cases:
        values = dict(zip(changing, case, strict=True))
        answer, expected = solver.solve(values), told(solve(with_values(scene, values)).last, asked)
        # The mesh is that of the scene's own numbers, with which places are elsewhere within its elements.
        for key, value in expected.items():
            near = 1e-6 if key.startswith("nodes") else 2e-4
            np.testing.assert_allclose(answer[key], value, atol=near, err_msg=f"{key} at {case}")
        acted.add(tuple(bool(np.abs(expected[key]).max() > 1e-6) for key in asked[1:]))
    assert len(acted) > 1


@pytest.mark.parametrize("name", ["peg", "string"])
def test_derivatives_with_both(name):
    make, numbers, _ = PARAMETRIC[name]
    scene, number = make(), f"loads.{numbers[0]}"
    asked = asked_of(scene)
    solver = parametric(scene, [number], asked)
    at = solver.solve()
    there = float(np.squeeze(at.values[number]))
    ahead, back = (solver.solve({number: there + h}, start=at) for h in (1e-4, -1e-4))
    for key in asked:
        slope = (np.asarray(ahead[key]) - back[key]) / 2e-4
        np.testing.assert_allclose(np.squeeze(at.jacobian[key][number]), slope, atol=1e-6, err_msg=key)
    assert np.abs(at.jacobian[asked[-1]][number]).max() > 0.1


@needs_compiler
@pytest.mark.parametrize("name", ["bars", "peg", "peg, free", "string", "each other"])
def test_both_in_c(name, tmp_path):
    """The bits of the process, which finds what statics finds, or says that something else touches."""
    make, numbers, cases = PARAMETRIC[name]
    scene, changing = make(), [f"loads.{number}" for number in numbers]
    asked = asked_of(scene)
    solver = export(scene, tmp_path / "c", name="structure", arguments=changing, results=asked)
    codes = codes_of_both(solver, tmp_path / "c", [[float(x) for x in case] for case in cases])
    for case, code in zip(cases, codes, strict=True):
        if code is Code.TOUCHES:
            continue
        results = solver.by_name(solver.solve(np.array(case, dtype=float))[1])
        expected = told(solve(with_values(scene, dict(zip(changing, case, strict=True)))).last, asked)
        for key, value in expected.items():
            near = 1e-6 if key.startswith("nodes") else 2e-4
            np.testing.assert_allclose(results[key], value, atol=near, err_msg=f"{key} at {case}")
    assert Code.SOLVED in codes
    assert (Code.TOUCHES in codes) == (name != "each other")


@pytest.mark.parametrize("name", ["peg", "peg, free"])
def test_arguments_are_followed_from_an_equilibrium(name):
    """With what acts there, and not what does elsewhere."""
    make, numbers, _ = PARAMETRIC[name]
    solver = parametric(make(), [f"loads.{number}" for number in numbers]).solver
    row, start = solver.followed_from
    found = solver.method(row, start, warm=True)
    assert found.code is Code.SOLVED
    # On the mesh of the answer, whose places are elsewhere within these elements.
    np.testing.assert_allclose(found.state[solver.switches.multipliers], start[solver.switches.multipliers], atol=1e-4)


@pytest.mark.parametrize("length", [1.0, 1.2])
def test_a_choice_that_was_tried_is_not_the_end(length):
    """A wheel on an arm below a beam: without the string the stop is passed, and with either alone the other one."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "C": {"position": [1, 0]},
            "P": {"position": [0.5, -0.8], "support": "hinge"},
            "Q": {"position": [0.5, -0.2]},
        },
        "members": {"m": {"nodes": ["A", "C"], "section": "s"}, "arm": {"nodes": ["P", "Q"], "type": "rigid"}},
        "contacts": {"wheel": {"type": "circle", "center": [0.5, -0.2], "radius": 0.15, "node": "Q", "member": "m"}},
        "springs": {
            "k": {"node": "P", "stiffness": 0.5, "stop": [-0.3, 0.2]},
            "z": {"type": "translational", "node": "C", "stiffness": 0, "direction": [0, 1], "stop": [-0.3, 0.3]},
        },
        "tendons": {"t": {"way": [{"ground": [-0.3, -0.2]}, {"node": "Q"}], "length": length}},
        "loads": {
            "f": {"type": "force", "node": "C", "value": [0, -1.5]},
            "q": {"type": "force", "node": "Q", "value": [0.3, 0]},
        },
        "analysis": {"accuracy": 1e-7},
    }
    step = solve(made(table)).last
    alone = solve(made({key: value for key, value in table.items() if key != "tendons"})).last
    # The string is slack, and leaves all as it is without.
    assert step.tendon("t")["slack"]
    assert step.tendon("t")["length"] == pytest.approx(np.linalg.norm(alone.position("Q") - [-0.3, -0.2, 0]), abs=1e-7)
    assert step.tendon("t")["length"] < length
    assert alone.spring("k").travel == pytest.approx(-0.3, abs=1e-12)
    np.testing.assert_allclose(step.position("C"), alone.position("C"), atol=2e-7)
    np.testing.assert_allclose(step.contacts["wheel"]["force"], alone.contacts["wheel"]["force"], atol=1e-5)
    assert alone.contacts["wheel"]["force"][1] > 1.0
