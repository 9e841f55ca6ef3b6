"""Histories through tables of values and from functions: smooth ones drive motions."""

import math

import numpy as np
import pytest
from test_codegen import built, needs_compiler, said

from sfetcas import History, Scene, SceneError, assemble, dump, export, load, parametric, solve, solve_model

T = [0.0, 0.3, 1.0, 1.2, 2.0]
VALUE = [0.0, 0.4, 1.0, 0.8, 0.5]
SPLINE = History(t=T, value=VALUE, interpolation="spline")

ROUNDING = 1e-12
"""Values are about 1, their second derivatives about 10."""


def acceleration(history, t, side):
    """The second derivative just before (-1) or after (1) t, by the difference of rates, exact to h of a cubic."""
    h = 1e-6
    return side * (history.rate(t + side * h) - history.rate(t, side)) / h


def test_a_spline_goes_through_its_values_smoothly_and_rests_at_its_ends():
    assert [SPLINE.factor(t) for t in T] == pytest.approx(VALUE, abs=ROUNDING)
    assert [SPLINE.factor(t) for t in (-1, 5)] == [VALUE[0], pytest.approx(VALUE[-1], abs=ROUNDING)]
    assert [SPLINE.rate(0.0), SPLINE.rate(2.0, -1)] == pytest.approx([0.0, 0.0], abs=ROUNDING)
    for t in T[1:-1]:
        assert SPLINE.rate(t, -1) == pytest.approx(SPLINE.rate(t, 1), abs=ROUNDING)
        # The step of 1e-6 times third derivatives of about 100.
        assert acceleration(SPLINE, t, -1) == pytest.approx(acceleration(SPLINE, t, 1), abs=1e-3)
    assert list(SPLINE.jumps()) == []
    # Between them nothing jumps; outside it is constant, so that the acceleration begins at once.
    assert SPLINE.kinks == (T[0], T[-1])


def test_what_follows_a_history_stops_where_it_turns_back_or_has_a_corner():
    # Of the values of the spline the third is the largest.
    assert SPLINE.knots == (0.0, 1.0, 2.0)
    assert SPLINE.replace(interpolation="linear").knots == tuple(T)
    assert History(t=[0, 1, 2], polynomial=[[0, 0, 1], [1, 2, 1]]).knots == (0.0, 2.0)
    assert History(t=[0, 1, 2], polynomial=[[0, 0, 1], [2, 2]]).knots == (0.0, 1.0, 2.0)


def test_a_path_along_many_measured_values_has_few_points():
    t = np.linspace(0, 2, 2001)
    table = {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 1], "history": "on"}},
        "histories": {"on": {"t": t, "value": np.sin(t) ** 2, "interpolation": "spline"}},
        "analysis": {"type": "path", "range": [0, 2], "accuracy": 1e-2},
    }
    path = solve(Scene.from_dict(table))
    assert path.points[-1].factor == 2.0
    # Steps of a path that has no corners; there would be one for each value.
    assert len(path.points) < 100


def test_a_history_is_evaluated_at_many_times_at_once():
    t = np.linspace(-1, 3, 12).reshape(3, 4)
    np.testing.assert_array_equal(SPLINE.factor(t), [[SPLINE.factor(x) for x in row] for row in t])


def test_a_spline_is_exact_for_a_cubic_at_rest_at_both_ends():
    rest = History(t=np.linspace(0, 2, 6), value=[3 * x**2 - 2 * x**3 for x in np.linspace(0, 1, 6)])
    for history in (rest.replace(interpolation="spline"), History(t=[0, 2], value=[0, 1], interpolation="spline")):
        found = [history.factor(t) for t in (0.1, 0.9, 1.7)]
        assert found == pytest.approx([3 * x**2 - 2 * x**3 for x in (0.05, 0.45, 0.85)], abs=ROUNDING)
    assert History(t=[1], value=[5], interpolation="spline").factor(0) == 5.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"t": [0, 1], "polynomial": [[1]], "interpolation": "spline"},
            "interpolation: found 'spline' with polynomials",
        ),
        ({"t": [0, 1], "value": [0, 1], "interpolation": "cubic"}, "interpolation: found 'cubic', accepted: linear, "),
        (
            {"t": [0, 1e-300, 1e300], "value": [0, 1, 2], "interpolation": "spline"},
            "interpolation: found t or values too",
        ),
        ({"table": "none.csv"}, "table.none.csv: there is no such file, accepted: a CSV table"),
        ({"t": [0, 1], "value": math.sin}, "value: found a function, accepted: a list of numbers; History.of(function"),
        ({"table": 3}, "table: found 3, accepted: the name of a CSV file"),
        ({"table": "none.csv", "t": [0, 1]}, "found 'table' and 't', accepted: one of them"),
    ],
)
def test_wrong_histories_are_refused_in_a_sentence(values, message):
    with pytest.raises(SceneError) as refused:
        History.from_dict(values)
    assert str(refused.value).startswith(message)


# -- from a file ------------------------------------------------------------------------------------


def bar(**more):
    """A rod that turns about a hinge, rigid: all it does is prescribed."""
    return {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "mass": 1.0}},
        "members": {"rod": {"nodes": ["A", "B"], "type": "rigid"}},
        "motions": {"turn": {"node": "A", "rotation": 0.5, "history": "measured"}},
        "analysis": {"type": "dynamic", "end": 2.5, "accuracy": 1e-6},
        **more,
    }


def test_a_table_beside_the_scene_file_drives_a_motion(tmp_path):
    rows = "".join(f"{t},ignored,{value}\n".replace("ignored", "7") for t, value in zip(T, VALUE))
    (tmp_path / "motion.csv").write_text("t, other, value\n" + rows)
    dump(Scene.from_dict(bar(motions={}, analysis={"steps": [1.0]}, gravity=[0, -1])), tmp_path / "scene.json")
    text = (tmp_path / "scene.json").read_text().rstrip()[:-1]
    history = '"histories": {"measured": {"table": "motion.csv", "interpolation": "spline"}}'
    (tmp_path / "scene.json").write_text(f"{text}, {history}}}")
    scene = load(tmp_path / "scene.json")
    assert scene.histories["measured"] == SPLINE
    # What is written has the numbers, wherever the table is by then.
    (tmp_path / "motion.csv").unlink()
    dump(scene, tmp_path / "again.toml")
    assert load(tmp_path / "again.toml") == scene


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,x\n0,1\n", "found the columns t, x, accepted: columns t and value with these names in the first line"),
        (
            "t;value\n0;1\n",
            "found the columns t;value, accepted: columns t and value with these names in the first line, s",
        ),
        ("t,value\n0,a\n", "row 1.value: found 'a', accepted: a number"),
        ("t,value\n", "found 1 line, accepted: a line of names and a line of numbers for each row"),
        ("t,value\n0,nan\n", "value: found nan, accepted: a finite number"),
        ("t,value\n1,0\n0,1\n", "t: found [1.0, 0.0], accepted: rising numbers"),
    ],
)
def test_wrong_tables_are_refused_in_a_sentence(tmp_path, text, message):
    (tmp_path / "motion.csv").write_text(text)
    with pytest.raises(SceneError) as refused:
        History.from_dict({"table": tmp_path / "motion.csv"})
    assert message in str(refused.value)


def test_a_spline_through_measured_values_drives_a_node():
    table = bar(histories={"measured": {"t": T, "value": VALUE, "interpolation": "spline"}})
    motion = solve(Scene.from_dict(table))
    turned = np.array([0.5 * SPLINE.factor(t) for t in motion.times])
    # Prescribed: right to rounding.
    np.testing.assert_allclose(
        motion.positions("B")[:, :2], np.column_stack([np.cos(turned), np.sin(turned)]), atol=1e-10
    )
    table["histories"]["measured"].pop("interpolation")
    with pytest.raises(SceneError, match=r"velocity of the motion 'turn' would jump|start with a jump"):
        Scene.from_dict(table)


def test_statics_and_parameters_go_along_a_spline():
    strip = {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 2], "history": "on"}},
        "histories": {"on": SPLINE},
        "analysis": {"steps": [0.15, 0.7]},
    }
    scene = Scene.from_dict(strip)
    plain = scene.replace({"loads.tip.history": None, "analysis.steps": [SPLINE.factor(0.7)]})
    wanted = solve(plain).last.position("B")
    # Both to the accuracy of 1e-4.
    np.testing.assert_allclose(solve(scene).last.position("B"), wanted, atol=1e-4)
    answer = parametric(scene, ["histories.on"], ["nodes.B.position"]).solve()
    np.testing.assert_allclose(answer["nodes.B.position"], wanted, atol=1e-4)


# -- from a function --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("function", "end", "tolerance"),
    [
        (lambda t: (1 - math.cos(t)) / 2, math.pi, 1e-6),
        (lambda t: (1 - np.cos(t)) / 2, math.pi, 1e-10),
        (lambda t: math.sin(40 * t) * math.exp(-t), 3.0, 1e-6),
        (lambda t: 1e-7 * math.tanh(1e3 * (t - 0.3)), 1.0, 1e-6),
        (lambda t: abs(t - 0.3), 1.0, 1e-5),
        (lambda t: 0.0, 1.0, 1e-6),
        (lambda t: 3.0, 1.0, 1e-6),
        (lambda t: t, 1.0, 1e-6),
    ],
)
def test_a_history_follows_a_function(function, end, tolerance):
    history = History.of(function, 0.0, end, tolerance=tolerance)
    t = np.random.default_rng(1).uniform(0.0, end, 2000)
    found, wanted = (np.array([one(x) for x in t.tolist()]) for one in (history.factor, function))
    # Between the places where it is compared it may miss a little more.
    assert np.abs(found - wanted).max() <= 3 * tolerance * np.abs(wanted).max()
    assert all(x in (0.0, end) for x, *_ in history.jumps())


def test_a_function_that_rests_at_its_ends_drives_a_motion():
    history = History.of(lambda t: (1 - math.cos(math.pi * t)) / 2, 0.0, 1.0)
    assert (history.rate(0.0), list(history.jumps())) == (0.0, [])
    motion = solve(Scene.from_dict(bar(histories={"measured": history})))
    angle = 0.5 * (1 - math.cos(math.pi * 0.5)) / 2
    # 1e-6 of half a radian.
    assert motion.at(0.5).position("B")[:2] == pytest.approx([math.cos(angle), math.sin(angle)], abs=1e-6)
    # A function that moves at its end goes on as it does, and stops there.
    (stop,) = History.of(lambda t: t**2, 0.0, 1.0).jumps()
    assert stop == pytest.approx((1.0, 0.0, -2.0), abs=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((lambda t: float(t > 0.3), 0, 1), r"History.of: the function jumps or changes too fast near t = 0.3"),
        ((lambda t: math.nan, 0, 1), r"History.of.the function at t = 0: found nan, accepted: a finite number"),
        ((lambda t: "1", 0, 1), r"History.of.the function at t = 0: found '1', accepted: a number"),
        ((lambda t: [t], 0, 1), r"History.of.the function at t = 0: found \[0.0\], accepted: a number"),
        ((math.sin, 1, 1), r"History.of: found 1 to 1, accepted: a start before the end"),
        ((math.sin, 0, math.inf), r"History.of.end: found inf, accepted: a finite number"),
        ((math.sin, 0, 1e-320), r"History.of: found 0.0 to 1e-320, accepted: ends with numbers between them"),
        ((math.sin, 1, math.nextafter(1, 2)), r"History.of: found 1.0 to 1.0000000000000002, accepted: ends with"),
        ((math.sin, -1e308, 1e308), r"History.of: found -1e\+308 to 1e\+308, accepted: ends with numbers"),
        ((VALUE, 0, 1), r"History.of: found \[0.0, 0.4, .*\], accepted: a function of t"),
    ],
)
def test_functions_that_cannot_be_followed_are_refused(arguments, message):
    with pytest.raises(SceneError, match=f"^{message}"):
        History.of(*arguments)


def test_what_the_function_raises_is_its_own():
    with pytest.raises(ZeroDivisionError):
        History.of(lambda t: 1.0 / t, 0.0, 1.0)


# -- over the factor as a parameter -----------------------------------------------------------------

COURSES = {
    "linear": {"t": [0.2, 0.5, 1.0], "value": [0.1, 0.7, 0.4]},
    "spline": {"t": T, "value": VALUE, "interpolation": "spline"},
    # It jumps at 0.6.
    "polynomial": {"t": [0.0, 0.6, 2.0], "polynomial": [[0.1, 0.5, -0.2, 0.3], [0.9, -0.4]]},
    "one value": {"t": [0.4], "value": [0.6]},
}


def driven(course):
    """A clamped rod whose one end is turned, beside loads with and without a history and gravity."""
    return Scene.from_dict(
        {
            "gravity": [0, -0.3],
            "sections": {"strip": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "strip", "elements": 2}},
            "loads": {
                "tip": {"type": "force", "node": "B", "value": [0.2, 2], "history": "on"},
                "wind": {"type": "distributed", "member": "beam", "frame": "section", "value": [0, 0.5, 0],
                         "history": "on"},
                "end": {"type": "moment", "node": "B", "value": 0.3},
            },
            "motions": {"turn": {"node": "A", "rotation": 0.4, "history": "on"}},
            "histories": {"on": COURSES[course]},
            "analysis": {"steps": [0.9]},
        }
    )  # fmt: skip


ANSWERS = ["nodes.B.position", "reactions.A.moment", "energy.elastic"]


@pytest.mark.parametrize("course", COURSES)
def test_histories_are_evaluated_at_a_factor_that_is_a_parameter(course):
    scene = driven(course)
    made = parametric(scene, ["factor"], ANSWERS)
    mesh, assembly = made.solver.model.mesh, made.solver.model.assembly
    # Before, within, at a knot, and after the history.
    for factor in (0.1, 0.3, 0.6, 0.7, 2.5):
        answer = made.solve({"factor": factor})
        wanted = solve_model(assemble(scene, mesh, assembly=assembly), factor)
        np.testing.assert_allclose(answer["nodes.B.position"], wanted.position("B"), atol=1e-9)
        assert answer["energy.elastic"] == pytest.approx(wanted.energy["elastic"], abs=1e-9)


@pytest.mark.parametrize("course", COURSES)
def test_derivatives_by_the_factor_go_through_histories(course):
    made = parametric(driven(course), ["factor", "loads.tip.value"], ANSWERS)
    h = 1e-4
    for factor in (0.1, 0.35, 0.7):
        answer = made.solve({"factor": factor})
        ends = [made.solve({"factor": factor + side * h}) for side in (-1, 1)]
        for name in ANSWERS:
            low, high = (end.answers[name] for end in ends)
            # Central differences: h^2 of third derivatives of about 10.
            np.testing.assert_allclose(answer.jacobian[name]["factor"], (high - low) / (2 * h), atol=1e-6)
            low, high = (end.jacobian[name]["factor"] for end in ends)
            second = answer.hessian(name)["factor"]["factor"]
            np.testing.assert_allclose(second, (high - low) / (2 * h), atol=1e-5)


NUMBERS = {
    "linear": "histories.on.value.1",
    "spline": "histories.on.value.2",
    "polynomial": "histories.on.polynomial.1.0",
    "one value": "histories.on.value.0",
}


@pytest.mark.parametrize("course", COURSES)
def test_numbers_of_a_history_are_parameters_with_and_without_the_factor(course):
    scene, name, h = driven(course).replace({"factor": 0.8}), NUMBERS[course], 1e-4
    both, alone = (parametric(scene, names, ANSWERS) for names in (["factor", name], [name]))
    (value,) = alone.solver.arguments.defaults
    changed = solve_model(assemble(scene.replace({name: value + 0.1}), alone.solver.model.mesh), 0.8)
    for made in (both, alone):
        answer = made.solve()
        ends = [made.solve({name: value + side * h}) for side in (-1, 1)]
        for key in ANSWERS:
            # Central differences: h^2 of third derivatives of about 10.
            slope = (ends[1][key] - ends[0][key]) / (2 * h)
            np.testing.assert_allclose(answer.jacobian[key][name], slope, atol=1e-6)
            assert np.abs(slope).max() > 1e-3
        found = made.solve({name: value + 0.1})["nodes.B.position"]
        np.testing.assert_allclose(found, changed.position("B"), atol=1e-9)


def test_times_of_a_history_are_no_parameters():
    for name in ("histories.on.t.1", "histories.on.t"):
        with pytest.raises(SceneError, match=r"found a time or factor at which a history has a knot, accepted: its v"):
            parametric(driven("linear"), [name], ANSWERS)


def test_a_derivative_at_the_end_of_a_history_is_that_within():
    scene = driven("linear")
    within = parametric(scene, ["factor"], ANSWERS).solve({"factor": 1.0 - 1e-9})
    end = parametric(scene, ["factor"], ANSWERS).solve({"factor": 1.0})
    for name in ANSWERS:
        # What changes over 1e-9.
        np.testing.assert_allclose(end.jacobian[name]["factor"], within.jacobian[name]["factor"], atol=1e-7)


def test_a_history_that_is_a_parameter_itself_does_not_follow_the_factor():
    scene = driven("linear")
    made = parametric(scene, ["factor", "histories.on"], ANSWERS)
    on = scene.histories["on"].factor(0.3)
    both = made.solve({"factor": 0.3, "histories.on": on})
    one = parametric(scene, ["factor"], ANSWERS).solve({"factor": 0.3})
    np.testing.assert_allclose(both["nodes.B.position"], one["nodes.B.position"], atol=1e-9)
    rate = both.jacobian["nodes.B.position"]
    total = rate["factor"] + scene.histories["on"].rate(0.3) * rate["histories.on"]
    np.testing.assert_allclose(one.jacobian["nodes.B.position"]["factor"], total, atol=1e-9)


@needs_compiler
@pytest.mark.parametrize("course", ["linear", "spline", "polynomial"])
def test_histories_in_c_follow_the_factor(course, tmp_path):
    scene = driven(course)
    made = export(scene, tmp_path / "c", name="arm", arguments=["factor"], results=ANSWERS, sensitivities=True)
    factors = (0.1, 0.3, 0.6, 0.7, 2.5)
    text = '#include "arm.h"\n#include <stdio.h>\nstatic arm_memory m;\n'
    text += "static double x[ARM_STATE], p[1], r[ARM_RESULTS], d[ARM_RESULTS];\n"
    text += f"static const double factors[] = {{{', '.join(map(str, factors))}}};\n"
    text += "int main(void){int i, k; for (k = 0; k < 5; ++k) { p[0] = factors[k];\n"
    text += "arm_solve(&m, p, x, 0, r, 0); arm_sensitivities(&m, p, x, d);\n"
    text += 'for (i = 0; i < ARM_RESULTS; ++i) printf("%.17g %.17g ", r[i], d[i]);}\nreturn 0;}\n'
    (tmp_path / "c" / "every.c").write_text(text)
    program = built(tmp_path / "c", "arm", source="every.c")
    found = np.array([float(x) for x in said(program).split()]).reshape(len(factors), -1, 2)
    for factor, here in zip(factors, found, strict=True):
        outcome, results = made.solve(np.array([factor]))
        slopes = made.sensitivities([factor], outcome.state, made.prepare([factor]))
        np.testing.assert_array_equal(here.T, [results, np.array(slopes).ravel()])
    # As the static answers of the scene itself, on the same mesh.
    wanted = [solve_model(assemble(scene, made.model.mesh), factor).position("B") for factor in factors]
    np.testing.assert_allclose(found[:, :3, 0], wanted, atol=1e-9)
