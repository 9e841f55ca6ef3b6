"""Many cases at once by the core: the answers of single solves, what is left to these, order, threads, bad input."""

import csv
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
import pytest
from scenes import arch, cantilever, made

from sfetcas import Analysis, Expect, SceneError, Settings, dump, load, parametric, solve, sweep
from sfetcas.checks import asked
from sfetcas.cli import main
from sfetcas.mathematics.core import core
from sfetcas.mechanics.accuracy import largest_difference, roughness
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields, transferred
from sfetcas.mechanics.model import assemble
from sfetcas.parametric import plain
from sfetcas.parametric.arguments import asked_for

PROBLEMS = Path(__file__).parent.parent / "problems"
ACCURACY = 1e-6


@pytest.fixture(autouse=True)
def library():
    if core() is None:
        pytest.skip("no core here, and no compiler that makes one")


class Here(Executor):
    """Does everything at once, by itself."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def beam(value=(0.0, 1.0), **more):
    """A cantilever of length and stiffness one under a force at its end."""
    return made(cantilever(value, analysis={"accuracy": ACCURACY}, **more))


def turned(more):
    """An arch between clamps, one of which moves."""
    scene = {**arch(), "analysis": {"accuracy": ACCURACY}, **more}
    scene["loads"]["down"]["value"] = [1.0, -3.0]
    return scene


def stretching():
    table = cantilever((0.5, 2.0), analysis={"accuracy": ACCURACY})
    table["sections"]["s"] |= {"EA": 100.0, "GA2": 60.0, "GA3": 60.0}
    return made(table)


def of(name, **more):
    return load(PROBLEMS / f"{name}.toml").replace({"analysis.steps": [1.0], "analysis.accuracy": ACCURACY, **more})


def drawn(ranges, count=6, seed=0):
    rng = np.random.default_rng(seed)
    return {name: rng.uniform(*span, count) for name, span in ranges.items()}


def blade(rotating=(0.0, 0.0, 1.0), **more):
    """A cantilever with mass in axes that rotate, in space with two forces."""
    table = cantilever((0.3, 0.5, 0.2)[: 3 if more else 2], analysis={"accuracy": ACCURACY}, **more)
    table["sections"]["s"] |= {"rhoA": 1.0, "EI2": 0.5, "GJ": 0.7} if more else {"rhoA": 1.0}
    return made({**table, "rotating": rotating})


SCENES = {
    "plane": (beam, {"loads.tip.value.1": (-12.0, 12.0), "sections.s.EI3": (0.7, 1.5)}, ["nodes.B.position"]),
    "stretching": (
        stretching,
        {"loads.tip.value.1": (1.0, 12.0), "sections.s.EA": (80.0, 120.0)},
        ["nodes.B.position", "members.m.strain at 0.3"],
    ),
    "closed": (
        lambda: made({**arch(), "analysis": {"accuracy": ACCURACY}}),
        {"loads.down.value.0": (0.0, 6.0), "sections.s.EI3": (0.9, 1.2)},
        ["members.m.position at 0.3", "reactions.A.force"],
    ),
    "space": (
        lambda: of("bend_45_degrees"),
        {"loads.tip.value.2": (10.0, 600.0), "sections.square.GJ": (7e5, 9e5)},
        ["nodes.tip.position", "reactions.root.force"],
    ),
    "tendons": (
        lambda: of("tendon_robot_along"),
        {"tendons.short.tension": (0.1, 4.0), "tendons.long.tension": (0.1, 4.0)},
        ["nodes.tip.position"],
    ),
    "turned": (
        lambda: made(turned({"motions": {"m": {"node": "B", "rotation": 1.0, "displacement": [-0.2, 0.1]}}})),
        {"motions.m.rotation": (-2.0, 2.0), "motions.m.displacement.1": (-0.2, 0.2), "sections.s.EI3": (0.9, 1.1)},
        ["members.m.position at 0.4", "reactions.B.force"],
    ),
    "turned in space": (
        lambda: made(
            turned({"motions": {"m": {"node": "B", "rotation": [0.5, 0.4, 0.3], "displacement": [-0.2, 0, 0]}}})
        ),
        {"motions.m.rotation.0": (-1.0, 1.0), "motions.m.rotation.2": (-1.0, 1.0)},
        ["members.m.position at 0.4", "reactions.B.force"],
    ),
    "linkage": (
        lambda: of("fourbar_curved_coupler"),
        {"factor": (-35.0, 40.0), "springs.return.stiffness": (2.0, 4.0)},
        ["nodes.C.position"],
    ),
    "rotating": (
        blade,
        {"rotating.2": (-4.0, 4.0), "loads.tip.value.1": (-3.0, 3.0), "sections.s.rhoA": (0.2, 2.0)},
        ["nodes.B.position", "reactions.A.force"],
    ),
    "rotating in space": (
        lambda: blade(dimension="space"),
        {"rotating.1": (-1.0, 1.0), "rotating.2": (-3.0, 3.0), "loads.tip.value.2": (-1.0, 1.0)},
        ["nodes.B.position", "reactions.A.force"],
    ),
    "discs": (lambda: of("tendon_robot_discs"), {"sections.wire.E": (4e10, 6e10)}, ["nodes.tip.position"]),
}


@pytest.mark.parametrize("name", SCENES)
def test_answers_are_those_of_single_solves(name):
    make, ranges, quantities = SCENES[name]
    scene, cases = make(), drawn(ranges)
    found, single = sweep(scene, cases, quantities, batch=True), sweep(scene, cases, quantities, executor=Here())
    assert not found.outcomes.own
    assert (found.table["status"] == "solved").all()
    errors = found.table["error_estimate"]
    assert (errors <= plain.LEFT_ALONE * ACCURACY).all()
    for quantity in quantities:
        mine, other = found.quantities[quantity], single.quantities[quantity]
        size = scene.size if "position" in quantity else float(np.abs(other).max())
        # Each is as far from the truth as it says of itself, and forces follow from positions.
        apart = np.linalg.norm(mine - other, axis=1) / size
        assert (apart <= 4.0 * (errors + single.table["error_estimate"])).all()


def test_error_estimates_are_those_of_a_mesh_with_half_the_elements():
    """With the answer far below its own error known from another solve."""
    # A place within an element: at their ends positions are more accurate.
    scene, force, place = beam(), [3.0, 10.0], "members.m.position at 0.33"
    found = sweep(scene, {"loads.tip.value.1": force}, [place], batch=True)
    for i, value in enumerate(force):
        exact = solve(scene.replace({"loads.tip.value.1": value}), accuracy=1e-11)
        error = float(np.linalg.norm(found.quantities[place][i] - asked(exact, Expect(quantity=place, value=True))))
        assert error <= found.table["error_estimate"][i]
        # Safety and places elsewhere, where the error is largest.
        assert found.table["error_estimate"][i] <= 100.0 * error


def test_what_is_not_plain_is_solved_by_itself():
    """Beyond the load at which Lee's frame snaps, at which single solves say so; below it is plain."""
    scene = load(PROBLEMS / "lee_frame.toml").replace({"analysis": Analysis(accuracy=ACCURACY), "expect": ()})
    # The largest load that it carries is 1.856.
    cases, quantity = {"loads.load.value.1": [-1.0, -1.8, -1.85, -1.9, -3.0]}, ["nodes.load.position"]
    found, single = (sweep(scene, cases, quantity, executor=Here(), batch=batch) for batch in (True, False))
    assert sorted(found.outcomes.own) == [3, 4]
    for i in (3, 4):
        assert found.outcomes[i].numbers[0].tolist() == single.outcomes[i].numbers[0].tolist()
        assert "jumped" in found.outcomes[i].notes


def test_columns_near_and_beyond_their_critical_load_are_left():
    """An eigenvalue that is zero to rounding, and a way that buckles, are no case for the core."""
    critical = np.pi**2 / 4.0
    cases = {"loads.tip.value.0": -critical * np.array([0.5, 1.0 - 1e-9, 1.0, 1.2])}
    found = sweep(beam((-1.0, 0.0)), cases, ["nodes.B.position"], batch=True)
    assert sorted(found.outcomes.own) == [1, 2, 3]
    assert np.abs(found.quantities["nodes.B.position"][0] - [1.0, 0.0, 0.0]).max() <= ACCURACY


def test_shafts_near_and_beyond_their_critical_speed_are_left():
    """One along its axis of rotation is straight up to 3.516 rad/s, and bent beyond."""
    scene = blade((1.0, 0.0, 0.0), dimension="space").replace(
        {"sections.s.EI2": 1.0, "sections.s.EI3": 1.0, "loads.tip.value": [0.0, 1e-3, 0.0]}
    )
    speeds = [0.0, 2.0, 3.3, 3.51599, 4.5]
    found = sweep(scene, {"rotating.0": speeds}, ["nodes.B.position"], batch=True)
    assert found.outcomes.own.keys() == {3, 4}
    aside = np.linalg.norm(found.quantities["nodes.B.position"][:, 1:], axis=1)
    # By small deflections the fourth derivative of the shape is the square of the speed times the shape.
    assert aside[0] == pytest.approx(1e-3 / 3.0, rel=1e-5)
    s = np.sqrt(speeds[1:3])
    dip = (np.sin(s) * np.cosh(s) - np.cos(s) * np.sinh(s)) / (s**3 * (1.0 + np.cos(s) * np.cosh(s)))
    np.testing.assert_allclose(aside[1:3], 1e-3 * dip, rtol=1e-3)
    assert found.table["status"][4] == "solved"
    assert aside[4] > 0.3


def test_of_several_steps_the_last_one_is_told():
    scene, cases = beam().replace({"analysis.steps": [0.5, 2.0]}), {"loads.tip.value.1": [1.0, 2.0]}
    one, other = (sweep(scene, cases, ["nodes.B.position"], executor=Here(), batch=batch) for batch in (True, False))
    assert not one.outcomes.own
    assert np.abs(one.values("nodes.B.position") - other.values("nodes.B.position")).max() <= ACCURACY
    with pytest.raises(SceneError, match=r"^quantities: .*step"):
        sweep(scene, cases, ["nodes.B.position step 0.5"], batch=True)


def test_order_and_threads_change_no_bit(monkeypatch):
    monkeypatch.setattr(plain, "CHUNK", 8)
    scene, cases = beam(), drawn(SCENES["plane"][1], count=30)
    one = sweep(scene, cases, ["nodes.B.position"], batch=True, workers=1)
    order = np.random.default_rng(1).permutation(30)
    mixed = {name: column[order] for name, column in cases.items()}
    two = sweep(scene, mixed, ["nodes.B.position"], batch=True, workers=3)
    for key in ("nodes.B.position", "error_estimate"):
        assert one.values(key)[order].tolist() == two.values(key).tolist()


def test_a_case_that_fails_changes_no_bit_of_those_after_it():
    """Softness that did not do is forgotten."""
    scene = load(PROBLEMS / "lee_frame.toml").replace({"analysis": Analysis(accuracy=ACCURACY), "expect": ()})
    forces, chosen = [-1.9, -30.0, 1e6, -1.0, -0.5], ["nodes.load.position"]

    def solved(loads):
        return sweep(scene, {"loads.load.value.1": loads}, chosen, batch=True, executor=Here())

    after, before = solved(forces), solved(forces[::-1])
    assert after.values(chosen[0])[3:].tolist() == before.values(chosen[0])[::-1][3:].tolist()


def moved_kinks():
    """A section whose stiffness has a kink."""
    table = cantilever(analysis={"accuracy": ACCURACY})
    table["sections"]["s"] |= {"EI3": {"at": [0, 0.4, 1], "value": [2.0, 1.0, 0.7]}}
    return made(table)


CHECKED = {
    # A kink within an element, which no halving shows.
    "sections.s.EI3.at.1": (moved_kinks, [0.4, 0.35, 0.6, 1.5], None),
    # Elements end where the load acts: it is left where that is elsewhere.
    "loads.tip.at": (
        lambda: made(
            {
                **cantilever(analysis={"accuracy": ACCURACY}),
                "loads": {"tip": {"type": "force", "member": "m", "at": 0.4, "value": [0, 1]}},
            }
        ),
        [0.4, 0.3, 0.6],
        [1, 2],
    ),
    # Ten numbers that a scene does not accept together.
    "sections.s.GJ": (
        lambda: made({**cantilever(analysis={"accuracy": ACCURACY}), "dimension": "space"}),
        [1.0, -1.0],
        [1],
    ),
    "nodes.B.position.0": (beam, [1.0, 0.7, 1.3], []),
}


@pytest.mark.parametrize("name", CHECKED)
def test_numbers_that_are_more_than_numbers_are_checked_against_models_made_anew(name):
    make, values, own = CHECKED[name]
    scene, quantity = make(), ["nodes.B.position"]
    if own is None:
        with pytest.raises(SceneError, match="found a place at which a quantity along a member has a kink"):
            sweep(scene, {name: values}, quantity, batch=True)
        return
    found, single = (sweep(scene, {name: values}, quantity, batch=batch, executor=Here()) for batch in (True, False))
    assert sorted(found.outcomes.own) == own
    assert found.table["status"].tolist() == single.table["status"].tolist()
    errors = found.table["error_estimate"] + single.table["error_estimate"]
    apart = np.linalg.norm(found.quantities[quantity[0]] - single.quantities[quantity[0]], axis=1)
    assert (apart[found.solved] <= 2.0 * errors[found.solved]).all()


@pytest.mark.parametrize("name", ["arch", "space", "rotating", "rotating in space"])
def test_a_row_is_the_model_of_its_case(name):
    """Data and loads from the functions of all numbers, against a model that is assembled for each."""
    make, ranges, quantities = SCENES["closed" if name == "arch" else name]
    scene = make()
    plain_ = plain.plain_cases(scene, asked_for(scene, list(ranges)), quantities, Settings())
    values = np.column_stack(list(drawn(ranges).values()))
    level = plain_._level(0)
    rows = level.rows(values)
    pairs = list(zip(values, rows, strict=True))
    assert all(plain_._size_of(*case) == scene.size for case in pairs)
    assert np.isnan([plain_._size_of(case, 1.001 * row) for case, row in pairs]).all()


@pytest.mark.parametrize("name", ["closed", "space", "discs", "stretching"])
def test_meshes_are_changed_and_compared_as_for_single_solves(name):
    """States on finer meshes, how far they are apart, roughness and errors, of many cases and of one."""
    make, ranges, quantities = SCENES[name]
    scene = make()
    cases = plain.plain_cases(scene, asked_for(scene, list(ranges)), quantities, Settings())
    values = np.column_stack(list(drawn(ranges, count=3).values()))
    coarse, fine = cases._level(0), cases._level(1)
    states, _, found = coarse.followed(coarse.rows(values), None)
    assert found.all()
    begun = fine.begun_at(states)
    solved, _, found = fine.corrected(fine.rows(values), begun)
    assert found.all()
    seen = [level.seen_at(cases._meshes[0])(values, there) for level, there in ((coarse, states), (fine, solved))]
    models = coarse.model, fine.model
    for i in range(len(values)):
        one, other, first = (
            level.arguments.program.equations.state(flat)
            for level, flat in ((coarse, states[i]), (fine, solved[i]), (fine, begun[i]))
        )
        for mine, wanted in zip(
            vars(first).values(), vars(transferred(models[0], one, models[1])).values(), strict=True
        ):
            np.testing.assert_allclose(mine, wanted, rtol=1e-12, atol=1e-13)
        assert fine.distance(begun, solved)[i] == pytest.approx(
            fine.prepared.distance(first, other), rel=1e-6, abs=1e-7
        )
        own, fields = coarse.arguments.scene_at(values[i]), []
        for level, state in ((coarse, one), (fine, other)):
            model = assemble(own, level.model.mesh, assembly=level.model.assembly, scales=level.model.scales)
            fields.append(Fields(Equations(model), state, model.loading(own.analysis.steps[-1])))
        apart = np.linalg.norm((seen[0][0] - seen[1][0])[i].reshape(-1, coarse.model.element.axes), axis=1).max()
        assert apart / scene.size == pytest.approx(largest_difference(*fields), rel=1e-6, abs=1e-13)
        for (_, rough), field in zip(seen, fields, strict=True):
            assert rough[i] == pytest.approx(roughness(field).max(), rel=1e-9)


def test_warm_starts_lead_to_the_same_where_there_is_one_equilibrium(monkeypatch):
    monkeypatch.setattr(plain, "CHUNK", 16)
    scene, cases = beam(), drawn({"loads.tip.value.1": (-4.0, 4.0)}, count=40)
    cold, warm = (sweep(scene, cases, ["nodes.B.position"], batch=True, warm=warm) for warm in (False, True))
    assert not warm.outcomes.own
    # Newton's method goes down to rounding from anywhere; softness of 1e-12 is what is left.
    assert np.abs(cold.values("nodes.B.position") - warm.values("nodes.B.position")).max() <= 1e-10


def test_nearest_of_those_before():
    values = np.array([[0.0, 0.0], [1.0, 0.0], [0.1, 0.0], [0.9, 1.0], [0.12, 0.0]])
    found = plain.nearest_before(values)
    assert found.tolist() == [-1, 0, 0, 1, 2]
    assert plain.nearest_before(np.ones((1, 2))).tolist() == [-1]
    rows = np.random.default_rng(0).normal(size=(100, 3))
    assert (plain.nearest_before(rows)[1:] < np.arange(1, 100)).all()


REFUSED = {
    "contact": ("floor_heavy_cantilever", "tip"),
    "loads without potential": ("cantilever_follower_force", "tip"),
    "histories": ("portal_frame", "left"),
}


@pytest.mark.parametrize("why", REFUSED)
def test_scenes_without_plain_cases_are_refused_with_a_sentence(why):
    name, node = REFUSED[why]
    scene = of(name, expect=[])
    section = next(iter(scene.sections))
    key = "EI3" if getattr(scene.sections[section], "EI3", None) else "E"
    with pytest.raises(SceneError, match=rf"^batch: found {why}, accepted: such a scene in a sweep without batch"):
        sweep(scene, {f"sections.{section}.{key}": [1.0, 2.0]}, [f"nodes.{node}.position"], batch=True)


def test_bad_input_is_one_sentence():
    scene, cases = beam(), {"loads.tip.value.1": [1.0]}
    with pytest.raises(SceneError, match="warm: found True without a batch"):
        sweep(scene, cases, ["nodes.B.position"], warm=True)
    with pytest.raises(SceneError, match="quantities"):
        sweep(scene, cases, ["certificate.residual"], batch=True)


def test_values_out_of_range_are_refused_as_by_single_solves():
    scene, cases = beam(), {"sections.s.EI3": [-1.0, 1.0]}
    found, single = (sweep(scene, cases, ["nodes.B.position"], executor=Here(), batch=batch) for batch in (True, False))
    assert found.outcomes[0].status == single.outcomes[0].status == "refused"
    assert found.outcomes[0].reason == single.outcomes[0].reason
    assert found.failures[0].case == 0
    assert found.outcomes[1].status == "solved"


def test_numbers_beyond_all_bounds_are_left_without_a_warning(recwarn):
    values = np.array([[1e300, 1.0], [1e200, 1e-200], [1.0, 1e300], [1.0, 1.0]])
    scene = beam()
    arguments = asked_for(scene, ["loads.tip.value.1", "sections.s.EI3"])
    found = plain.plain_cases(scene, arguments, ["nodes.B.position"], Settings()).solve(values, warm=True, threads=2)
    assert found.known.tolist()[:2] == [False, False]
    assert found.known[3]
    assert np.isfinite(found.numbers[found.known]).all()
    assert not recwarn.list


def test_without_a_core_cases_are_solved_one_by_one(monkeypatch):
    monkeypatch.setenv("SFETCAS_CORE", "off")
    scene, cases = beam(), {"loads.tip.value.1": [1.0, 2.0]}
    found = sweep(scene, cases, ["nodes.B.position"], executor=Here(), batch=True)
    assert sorted(found.outcomes.own) == [0, 1]
    assert found.solved.all()


def test_command_and_table(tmp_path, capsys):
    dump(beam(), tmp_path / "beam.toml")
    out = tmp_path / "cases.csv"
    arguments = ["sweep", str(tmp_path / "beam.toml"), "--vary", "loads.tip.value.1=0:10:5", "--batch", "--warm"]
    assert main([*arguments, "--out", str(out)]) == 0
    assert "5 cases of loads.tip.value.1: 5 solved" in capsys.readouterr().out
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["status"] for row in rows] == ["solved"] * 5
    assert float(rows[0]["nodes.B.position.0"]) == 1.0


def test_many_values_of_parameters():
    scene = beam()
    equilibrium = parametric(scene, ["loads.tip.value", "sections.s.EI3"], ["nodes.B.position", "energy.elastic"])
    forces = np.array([[0.0, 1.0], [1.0, -3.0], [0.0, 0.0]])
    told = []
    found = equilibrium.many({"loads.tip.value": forces, "sections.s.EI3": [1.0, 2.0, 1.0]}, progress=told.append)
    assert sum(told) == len(found) == 3
    assert not found.failures
    for i, force in enumerate(forces):
        single = equilibrium.solve({"loads.tip.value": force, "sections.s.EI3": [1.0, 2.0, 1.0][i]})
        assert np.abs(found["nodes.B.position"][i] - single["nodes.B.position"]).max() <= ACCURACY
        assert abs(found["energy.elastic"][i] - single["energy.elastic"]) <= 1e-4 * max(1.0, single["energy.elastic"])
    assert "3 cases, 3 solved" in repr(found)


def test_many_values_where_nothing_is_plain_are_solved_one_by_one():
    scene = of("floor_heavy_cantilever", expect=[])
    section = next(iter(scene.sections))
    equilibrium = parametric(scene, [f"sections.{section}.EI3"], ["nodes.tip.position"])
    default = float(equilibrium.defaults[f"sections.{section}.EI3"])
    found = equilibrium.many({f"sections.{section}.EI3": [default, -1.0]})
    assert np.isnan(found.errors).all()
    assert list(found.failures) == [1]
    assert "accepted: above zero" in found.failures[1]
    assert found["nodes.tip.position"][0].tolist() == equilibrium.solve()["nodes.tip.position"].tolist()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"loads.other.value": [1.0]}, "values: found 'loads.other.value', accepted: loads.tip.value.1"),
        ({"loads.tip.value.1": [1.0, np.nan]}, r"values.loads.tip.value.1: found \[1.0, nan\], accepted: finite"),
        (
            {"loads.tip.value.1": [[1.0, 2.0]]},
            r"found an array of shape \(1, 2\), accepted: finite numbers in an array",
        ),
        ({"loads.tip.value.1": "much"}, "accepted: finite numbers"),
    ],
)
def test_many_values_that_are_none(values, message):
    equilibrium = parametric(beam(), ["loads.tip.value.1"], ["nodes.B.position"])
    with pytest.raises(SceneError, match=message):
        equilibrium.many(values)
