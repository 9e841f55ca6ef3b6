"""Paths on which strings go slack or become taut and stops are reached: closed forms, shooting, and load steps."""

import json

import numpy as np
import pytest
from scenes import made
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_stops import STOP, clamped, lever

from sfetcas import Scene, SceneError, SolveError, Status, check, load, parametric, solve, switch
from sfetcas.cli import main
from sfetcas.mechanics.margins import margins

ALWAYS = {"one": {"t": [-100, 100], "value": [1, 1]}}
"""A history with which lengths of strings do not grow with the factor."""


def string(node, hook, **given):
    return {"way": [{"node": node}, {"ground": hook}], "history": "one", **given}


def path_of(table, span, *, steps=(), **more):
    analysis = {"type": "path", "range": list(span), "accuracy": 1e-7, **more}
    analysis |= {"steps": list(steps)} if steps else {}
    return solve(Scene.from_dict({**table, "analysis": analysis}))


def at(table, factor):
    return solve(Scene.from_dict({**table, "analysis": {"steps": [factor], "accuracy": 1e-7}})).last


def bar(**more):
    """A rigid bar on a hinge, pressed up by a load at its tip against a spring that pulls it down onto a string."""
    return {
        "dimension": "plane",
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"m": {"type": "rigid", "nodes": ["A", "B"]}},
        "springs": {"k": {"node": "A", "stiffness": 2.0, "rest": -0.5}},
        "tendons": {"t": string("B", [1, 1], pull=0.0)},
        "histories": ALWAYS,
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 1.0]}},
        **more,
    }


def beam(slack):
    """A cantilever pressed down at its tip, above which a string hangs loose by ``slack``."""
    return {
        "dimension": "plane",
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "tendons": {"t": string("B", [1, 0.5], length=0.5 + slack)},
        "histories": ALWAYS,
        "loads": {"f": {"type": "force", "node": "B", "value": [0, -1.0]}},
    }


def test_a_bar_leaves_its_string_at_a_known_load():
    """The string holds the bar until the load is the moment of the spring, and does nothing beyond."""
    path = path_of(bar(), (0, 3), steps=(0.5, 2.0))
    (event,) = path.transitions
    assert event.factor == pytest.approx(1.0, abs=1e-12)
    assert (event.changes, event.turns) == (("tendons.t goes slack",), False)
    before, after = path.steps
    # 2 * 0.5 less the load.
    assert before.tendon("t")["tension"] == pytest.approx(0.5, abs=1e-12)
    assert before.spring("k").travel == pytest.approx(0.0, abs=1e-12)
    angle = brentq(lambda a: 2.0 * (a + 0.5) - 2.0 * np.cos(a), 0.0, 1.0, xtol=1e-14)
    assert after.spring("k").travel == pytest.approx(angle, abs=1e-11)
    assert after.tendon("t")["slack"]
    assert all(point.stable is True for point in path.points)


def deflected(force):
    """Tip (2,) of the cantilever under a force down, by shooting."""

    def end(moment):
        def rates(_, y):
            return [y[1], force * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(rates, (0, 1), [0, moment, 0, 0], rtol=1e-11, atol=1e-12).y[:, -1]

    return end(brentq(lambda m: end(m)[1], -4.0, 4.0, xtol=1e-13))[2:]


def test_a_beam_comes_to_hang_on_its_string():
    """At the load at which its free tip is as far from the hook as the string is long, by shooting."""
    taut = brentq(lambda p: np.linalg.norm(deflected(p) - [1, 0.5]) - 0.6, 0.2, 0.5, xtol=1e-9)
    path = path_of(beam(0.1), (0, 3), steps=(0.2, 2.0))
    (event,) = path.transitions
    assert event.changes == ("tendons.t becomes taut",)
    assert event.factor == pytest.approx(taut, abs=1e-7)  # the accuracy asked for
    number = [point.kind for point in path.points].index("transition")
    places, factors = path.positions("B"), path.main.factors
    before, after = (
        (places[i + 1, 1] - places[i, 1]) / (factors[i + 1] - factors[i]) for i in (number - 1, number + 1)
    )
    # A cantilever gives by a third of the force; on its string it hardly does.
    assert before == pytest.approx(-1.0 / 3.0, rel=0.1)
    assert abs(after) < 0.02
    # The same point twice, of both equations.
    np.testing.assert_allclose(places[number], places[number + 1], atol=1e-14)
    for step in path.steps:
        np.testing.assert_allclose(step.position("B"), at(beam(0.1), step.factor).position("B"), atol=2e-7)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_stop_is_reached_where_its_spring_alone_holds_the_rod_there(dimension):
    path = solve(
        made(lever([0.1, 2.5], dimension=dimension, analysis={"type": "path", "range": [0, 3], "steps": [0.1, 2.5]}))
    )
    (event,) = path.transitions
    assert event.changes == ("springs.k reaches its high stop",)
    assert event.spring("k").travel == pytest.approx(STOP[1], abs=1e-10)
    force = event.factor * made(lever([1.0])).loads["f"].value[1]
    # The clamp of the same rod takes what the spring does at its stop.
    assert clamped(STOP[1], force).reaction("A")[1][2] == pytest.approx(-2.0 * STOP[1], abs=1e-6)
    for step in path.steps:
        np.testing.assert_allclose(step.position("B"), solve(made(lever([step.factor]))).last.position("B"), atol=1e-6)


def test_an_arch_that_snaps_is_caught():
    """Beyond its limit point the path goes down to where the string is taut; there it turns up and is stable."""
    arch = load("problems/arch_145_degrees.toml")
    table = {
        "tendons": {"t": string("load", [0, 4], length=3.2)},
        "histories": ALWAYS,
        "analysis.range": [0, 25],
        "analysis.steps": [20],
        "analysis.accuracy": 1e-5,
        "expect": (),
    }
    path = solve(arch.replace(table))
    (event,) = path.transitions
    assert (event.changes, event.turns) == (("tendons.t becomes taut",), True)
    assert event.factor < path.limit_points[0].factor
    assert event.notes[0] == "the factor turns there, at a corner"
    assert [stable for stable, _, _ in path.main.stretches()] == [True, False, True]
    # The arch without string passes through the same point.
    alone = solve(arch.replace({"analysis.accuracy": 1e-5, "analysis.steps": [event.factor], "expect": ()}))
    apart = [np.linalg.norm(step.position("load") - event.position("load")) for step in alone.steps]
    assert min(apart) < 1e-4
    (held,) = path.steps
    assert np.linalg.norm(held.position("load") - [0, 4, 0]) == pytest.approx(3.2, abs=1e-10)
    assert held.tendon("t")["tension"] > 0.0
    assert held.certificate.stable


def test_a_branch_meets_a_string_too():
    """A column buckles to a side on which a string hangs loose, and to one where there is none."""
    table = {
        "dimension": "plane",
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "M": {"position": [0.5, 0]},
            "B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
        },
        "members": {"a": {"nodes": ["A", "M"], "section": "s"}, "b": {"nodes": ["M", "B"], "section": "s"}},
        "tendons": {"t": string("M", [0.5, -0.5], length=0.6)},
        "histories": ALWAYS,
        "loads": {"f": {"type": "force", "node": "B", "value": [-1.0, 0]}},
    }
    path = path_of(table, (0, 11), branches=1, accuracy=1e-6, points=30)
    assert path.bifurcations[0].factor == pytest.approx(np.pi**2, rel=1e-8)
    met = {branch.side: branch.transitions for branch in path.branches[1:]}
    up = next(side for side, found in met.items() if found)
    assert met[-up] == ()
    assert met[up][0].changes == ("tendons.t becomes taut",)
    assert np.linalg.norm(met[up][0].position("M") - [0.5, -0.5, 0]) == pytest.approx(0.6, abs=1e-8)
    # The mirrored branch passes there as well.
    again = switch(path, 1, up)
    assert again.transitions[0].factor == pytest.approx(met[up][0].factor, rel=1e-7)


def test_a_mechanism_that_two_strings_lock_ends_its_path():
    """One string lifts the bar by being shortened, the other one holds it down from where it is taut."""
    table = bar(
        tendons={
            "up": {"way": [{"node": "B"}, {"ground": [1, 1]}], "pull": 0.1},
            "down": string("B", [1, -1], length=1.05),
        }
    )
    path = path_of(table, (0, 3))
    # At y the bar is y long from both hooks but for the cosine: root of both lengths.
    angle = brentq(lambda a: np.hypot(np.cos(a) - 1.0, np.sin(a) + 1.0) - 1.05, 0.0, 0.2, xtol=1e-14)
    factor = (1.0 - np.hypot(np.cos(angle) - 1.0, np.sin(angle) - 1.0)) / 0.1
    assert path.status is Status.CUT
    assert path.main.end.endswith("no choice of what is taut and at a stop leads on: tendons.down")
    assert path.points[-1].factor == pytest.approx(factor, abs=1e-9)


def test_where_several_ways_lead_on_the_path_says_so():
    """A bar that stands under a load, held by two strings, which are let out: it may lean to either side."""
    table = bar(
        springs={},
        tendons={
            side: {"way": [{"node": "B"}, {"ground": [x, 1]}], "pull": -0.1} for side, x in (("left", -1), ("right", 1))
        },
        loads={"f": {"type": "force", "node": "B", "value": [0, -1.0], "history": "one"}},
    )
    table["nodes"]["B"]["position"] = [0, 1]
    with pytest.raises(SolveError, match=r"at its beginning 3 ways lead on, .* branches: tendons\.left slack"):
        path_of(table, (0, 1))


def test_what_a_path_tells_of_its_transitions(tmp_path, capsys):
    table = {**bar(), "analysis": {"type": "path", "range": [0, 3]}}
    expect = {"quantity": "factor transition 1", "value": 1.0, "tolerance": 1e-9}
    file = tmp_path / "bar.json"
    file.write_text(json.dumps({**table, "expect": [expect]}))
    assert main(["run", str(file), "--json", str(tmp_path / "out.json")]) == 0
    assert "transition 1: factor 1, tendons.t goes slack" in capsys.readouterr().out
    (told,) = json.loads((tmp_path / "out.json").read_text())["transitions"]
    assert (told["changes"], told["turns"], told["branch"]) == (["tendons.t goes slack"], False, 0)
    wrong = Scene.from_dict({**table, "expect": [{**expect, "value": 1.1}]})
    assert not check(wrong, solve(wrong))[0].passed
    missing = Scene.from_dict({**table, "expect": [{**expect, "quantity": "factor transition 2"}]})
    path = solve(missing)
    with pytest.raises(SceneError, match="transition: found 2, but the path has 1"):
        check(missing, path)


# -- load steps -----------------------------------------------------------------------------------------


def test_a_slack_string_with_a_history_that_nothing_else_has():
    """Its free length is that of the history, which is then of no load."""
    step = at(beam(0.1), 0.2)
    assert step.tendon("t") == {"tension": 0.0, "length": pytest.approx(0.5665, abs=1e-3), "slack": True}


def test_strings_that_cannot_be_taut_at_once_begin_slack():
    table = bar(tendons={side: string("B", [1, y], length=1.1) for side, y in (("up", 1), ("down", -1))})
    table["springs"]["k"]["rest"] = 0.0
    step = at(table, 0.1)
    assert all(step.tendon(name)["slack"] for name in ("up", "down"))
    angle = brentq(lambda a: 2.0 * a - 0.1 * np.cos(a), 0.0, 0.1, xtol=1e-14)
    assert step.spring("k").travel == pytest.approx(angle, abs=1e-12)


def test_all_equilibria_where_a_string_holds_one_of_them():
    """A bar that stands under a load leans to either side, to one only until its string is taut."""
    table = bar(springs={"k": {"node": "A", "stiffness": 1.0}}, tendons={"t": string("B", [1, 1], length=1.4)})
    table["nodes"]["B"]["position"] = [0, 1]
    table["loads"]["f"]["value"] = [0, -2.0]
    steps = solve(Scene.from_dict({**table, "analysis": {"equilibria": "all"}})).steps
    free = brentq(lambda a: a - 2.0 * np.sin(a), 1.0, 3.0, xtol=1e-14)
    held = brentq(lambda a: np.hypot(1.0 + np.sin(a), 1.0 - np.cos(a)) - 1.4, 0.0, 1.0, xtol=1e-14)
    angles = sorted(step.spring("k").travel for step in steps)
    np.testing.assert_allclose(angles, [-free, 0.0, held], atol=1e-8)
    for step in steps:
        angle, taut = step.spring("k").travel, not step.tendon("t")["slack"]
        assert step.certificate.stable is bool(abs(angle) > 0.1)
        assert taut == (angle > 0.1)
    assert "each of 2 choices of slack tendons and stops, of which 2 have any" in steps[0].notes[-1]


# -- at random ------------------------------------------------------------------------------------------


def random_table(seed):
    """One or two members with up to three strings and two loads."""
    rng = np.random.default_rng(seed)
    hinged = rng.random() < 0.4
    nodes = {"A": {"position": [0, 0], "support": "hinge" if hinged else "clamped"}}
    springs = {"k": {"node": "A", "stiffness": rng.uniform(1, 5)}} if hinged else {}
    if hinged and rng.random() < 0.6:
        springs["k"]["stop"] = [-rng.uniform(0.02, 0.4), rng.uniform(0.02, 0.4)]
    members, place, angle, before = {}, np.zeros(2), rng.uniform(-0.5, 1.0), "A"
    for i in range(int(rng.integers(1, 3))):
        angle += rng.uniform(-1, 1)
        place = place + rng.uniform(0.5, 1.0) * np.array([np.cos(angle), np.sin(angle)])
        node = "BC"[i]
        nodes[node] = {"position": place.round(3).tolist()}
        rigid = rng.random() < 0.3 and (hinged or i)
        members[f"m{i}"] = {"nodes": [before, node], **({"type": "rigid"} if rigid else {"section": "s"})}
        before = node
    tendons = {}
    for i in range(int(rng.integers(1, 4))):
        node = list(nodes)[int(rng.integers(1, len(nodes)))]
        hook = (np.array(nodes[node]["position"]) + rng.uniform(-0.8, 0.8, 2)).round(3).tolist()
        tendons[f"t{i}"] = string(node, hook, pull=-float(rng.choice([0.0, 0.02, 0.1])))
    loads = {
        f"f{i}": {
            "type": "force",
            "node": list(nodes)[-1 - i % (len(nodes) - 1)],
            "value": rng.uniform(-4, 4, 2).tolist(),
        }
        for i in range(int(rng.integers(1, 3)))
    }
    sections = {"s": {"EI3": 1.0}}
    found = {"dimension": "plane", "sections": sections, "nodes": nodes, "members": members, "springs": springs}
    return {**found, "tendons": tendons, "loads": loads, "histories": ALWAYS}


def against_steps(seed):
    """Number of steps that were compared; where a path has several equilibria at a factor one of them is the step."""
    table, factors, compared = random_table(seed), (0.3, 0.8), 0
    try:
        path = path_of(table, (0, 1), steps=factors, accuracy=1e-6)
    except SolveError:
        return 0
    for factor in factors:
        met = [step for step in path.steps if step.factor == factor]
        try:
            alone = at(table, factor)
        except SolveError:
            continue
        apart = [max(np.abs(s.position(n) - alone.position(n)).max() for n in table["nodes"]) for s in met]
        if apart:
            # Twice the accuracies of both.
            assert min(apart) < 4e-6, (seed, factor, apart)
            compared += 1
    return compared


@pytest.mark.parametrize(("first", "last", "least"), [(20, 21, 1), (26, 27, 2), (0, 40, 60)])
def test_paths_at_random_pass_through_load_steps(first, last, least):
    """Of the load steps some are not found: they begin with all strings taut, where the scene may have other shapes."""
    assert sum(map(against_steps, range(first, last))) >= least


@pytest.mark.parametrize("seed", [4, 9])
def test_a_step_that_the_search_does_not_find_is_found_along_a_path(seed):
    """All that may be slack or at a stop is on its right side, and the energy is least."""
    table = random_table(seed)
    step = at(table, 0.8)
    assert any("along a path" in note for note in step.notes)
    assert step.certificate.stable
    # Of tensions and gaps rounding is left.
    assert min(margins(step.fields).values()) > -1e-9


# -- parameters -----------------------------------------------------------------------------------------


def slopes(family, values, name, step):
    """Derivatives of the tip position by a number: exact, and by central differences."""
    here = family.solve(values)
    ends = [family.solve({**values, name: values[name] + d}, here)["nodes.B.position"] for d in (step, -step)]
    return here, here.jacobian["nodes.B.position"][name], (ends[0] - ends[1]) / (2.0 * step)


def test_parameters_know_which_string_is_taut():
    """To both sides of the change answers are those of statics, and derivatives those of differences."""
    table = {**beam(0.1), "analysis": {"steps": [1.0], "accuracy": 1e-9}}
    family = parametric(
        Scene.from_dict(table), ["factor", "tendons.t.length"], ["nodes.B.position", "tendons.t.tension"]
    )
    for factor, slack in ((0.2, True), (1.0, False), (2.0, False), (0.1, True)):
        values = {"factor": factor, "tendons.t.length": 0.6}
        alone = at(beam(0.1), factor)
        for name in values:
            # Of fourth digits of the step squared.
            here, exact, differences = slopes(family, values, name, 1e-5)
            np.testing.assert_allclose(exact, differences, atol=1e-8)
        np.testing.assert_allclose(here["nodes.B.position"], alone.position("B"), atol=2e-7)
        assert here["tendons.t.tension"] == pytest.approx(alone.tendon("t")["tension"], abs=1e-6)
        assert alone.tendon("t")["slack"] is slack
        np.testing.assert_allclose(here.certified().position("B"), here["nodes.B.position"], atol=1e-8)
    # A slack string does nothing, whatever its length: rounding of the system that has its opening, too.
    assert np.abs(exact).max() <= 1e-14


def test_parameters_know_which_stop_is_reached():
    family = parametric(made(lever([1.0])), ["factor"], ["nodes.B.position", "springs.k.angle"])
    start = None
    for factor, angle in ((0.5, None), (2.5, STOP[1]), (-3.0, STOP[0]), (0.5, None)):
        start = family.solve({"factor": factor}, start)
        alone = solve(made(lever([factor]))).last
        np.testing.assert_allclose(start["nodes.B.position"], alone.position("B"), atol=2e-8)
        assert angle is None or start["springs.k.angle"] == pytest.approx(angle, abs=1e-10)
        _, exact, differences = slopes(family, {"factor": factor}, "factor", 1e-5)
        np.testing.assert_allclose(exact, differences, atol=1e-8)


def test_where_a_string_is_neither_taut_nor_slack_there_are_no_derivatives():
    table = {**bar(), "analysis": {"steps": [0.5]}}
    family = parametric(Scene.from_dict(table), ["factor"], ["nodes.B.position"])
    answer = family.solve({"factor": 1.0})
    np.testing.assert_allclose(answer["nodes.B.position"], [1, 0, 0], atol=1e-12)
    with pytest.raises(
        SolveError, match=r"tendons\.t (goes slack|becomes taut) there, and derivatives differ to either"
    ):
        answer.jacobian  # noqa: B018
    for factor in (0.99, 1.01):
        _, exact, differences = slopes(family, {"factor": factor}, "factor", 1e-5)
        np.testing.assert_allclose(exact, differences, atol=1e-8)


def test_a_number_on_which_nothing_ever_depends_is_refused():
    table = {**beam(0.1), "analysis": {"steps": [0.2]}}
    table["histories"] = {**ALWAYS, "idle": {"t": [0, 1], "value": [0, 1]}}
    table["sections"]["other"] = {"EI3": 2.0}
    with pytest.raises(SceneError, match="found a number on which nothing depends"):
        parametric(Scene.from_dict(table), ["sections.other.EI3"])


# -- vibrations ---------------------------------------------------------------------------------------


def frequencies(table):
    return solve(Scene.from_dict({**table, "analysis": {"type": "modes", "modes": 3, "accuracy": 1e-7}})).omega


@pytest.mark.parametrize("stiffness", [{}, {"stiffness": 40.0}])
def test_vibrations_know_whether_the_string_is_taut(stiffness):
    table = beam(0.1)
    table["sections"]["s"]["rhoA"] = 1.0
    string = table["tendons"]["t"] | stiffness
    pushing, without = (table | {"tendons": tendons} for tendons in ({"t": string | {"pushes": True}}, {}))
    np.testing.assert_allclose(frequencies(table | {"tendons": {"t": string}}), frequencies(pushing), rtol=1e-7)
    for loose in (0.5, 1.0):
        string = table["tendons"]["t"] | stiffness | {"length": 0.5 + loose}
        np.testing.assert_allclose(frequencies(table | {"tendons": {"t": string}}), frequencies(without), rtol=1e-7)


@pytest.mark.parametrize("stiffness", [{}, {"stiffness": 40.0}])
def test_about_a_string_that_is_neither_taut_nor_slack_nothing_vibrates_linearly(stiffness):
    table = beam(0.0)
    table["sections"]["s"]["rhoA"] = 1.0
    table["tendons"]["t"] |= stiffness
    del table["loads"]
    with pytest.raises(SolveError, match=r"tendons\.t is neither taut nor slack") as error:
        frequencies(table)
    assert error.value.status is Status.KINK


def test_vibrations_at_a_stop_are_those_of_a_rod_held_there():
    rod = lever([1.0])
    free, held = rod | {"loads": {}}, clamped(STOP[1], 5.0).model.scene.to_dict()
    for table, other in (
        ({**rod, "loads": {"f": {"type": "force", "node": "B", "value": [0, 5.0]}}}, held),
        (free, {**free, "springs": {"k": {"node": "A", "stiffness": 2.0}}}),
    ):
        for scene in (table, other):
            scene["sections"] = {name: {**section, "rhoA": 1.0} for name, section in scene["sections"].items()}
        np.testing.assert_allclose(frequencies(table), frequencies(other), rtol=1e-7)
