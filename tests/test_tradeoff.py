"""Accuracy against time: what is run, how it is judged, what is advised, and what is written."""

import csv
import io
import json
import os
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from scenes import cantilever, made

from sfetcas import SceneError, SolveError, dump, load
from sfetcas.analyses import solve
from sfetcas.cli import main
from sfetcas.mathematics.core import core
from sfetcas.pictures.fronts import front_picture
from sfetcas.tradeoff import measuring, trading
from sfetcas.tradeoff.machine import machine
from sfetcas.tradeoff.measuring import Measurement, Timing, measure
from sfetcas.tradeoff.observed import Observation, expected_error, observe
from sfetcas.tradeoff.peers import run_peer
from sfetcas.tradeoff.running import Apart, EndedError
from sfetcas.tradeoff.tables import as_csv, as_json, as_markdown
from sfetcas.tradeoff.trading import Limits, Row, Trade, again, trade, whole, with_peer
from sfetcas.tradeoff.variants import Variant, by_accuracy, families, other_ways

BEND = "problems/bend_45_degrees.toml"


# -- what is run ------------------------------------------------------------------------------------------


def test_families_have_all_elements_and_both_integrations_from_coarse_to_fine():
    found = families(made(cantilever()))
    assert {(f[0].element, f[0].integration) for f in found} == {
        (f"SFET{n}", way) for n in range(2, 10) for way in ("nodes", "gauss")
    }
    for family in found:
        counts = [variant.elements for variant in family]
        assert counts == sorted(counts)
        assert len({replace(variant, elements=None) for variant in family}) == 1


def test_families_of_a_motion_have_integrators_and_steps():
    found = families(load("problems/pendulum_flexible_smooth.toml"))
    assert {f[0].integrator for f in found} == {"radau-3", "radau-2", "generalised-alpha", "conserving"}
    assert all(f[i + 1].steps == 2 * f[i].steps for f in found for i in range(len(f) - 1))


def test_without_flexible_members_there_is_nothing_to_choose():
    assert families(load("problems/crank_rocker_rigid.toml")) == []


def test_other_ways_change_one_thing_each():
    base = Variant("SFET5", 4)
    for way in other_ways(made(cantilever()), base, "plane"):
        changed = [key for key in vars(base) if getattr(base, key) != getattr(way, key)]
        assert len(changed) == 1
    assert {way.name for way in other_ways(made(cantilever()), base, "plane")} == {
        "SFET5 x 4, compiled",
        "SFET5 x 4, interpreted",
        "SFET5 x 4, closing",
        "SFET5 x 4, nodal",
        "SFET5 x 4, newton",
        "SFET5 x 4, in space",
        *(["SFET5 x 4, without the core"] if core() is not None else []),
    }


def test_a_variant_without_the_core_does_without(monkeypatch):
    asked, scene = [], made(cantilever())

    def watched(*given):
        asked.append(core())
        return solve(*given)

    monkeypatch.setattr(measuring, "solve", watched)
    with_it, without = (measure(scene, Variant("SFET5", 4, core=use), 0) for use in (True, False))
    assert (with_it.failure, without.failure) == ("", "")
    assert asked[0] is core()
    assert asked[-1] is None
    assert core() is asked[0]


def test_a_variant_replaces_what_the_scene_says_of_elements():
    table = cantilever()
    table["members"]["m"] |= {"element": "SFET3", "elements": 7}
    scene, variant = made(table), Variant("SFET6", 2, dimension="space")
    step = solve(variant.scene(scene), variant.settings()).last
    assert step.model.element.name == "SFET6"
    assert step.model.mesh.elements == 2
    assert step.model.space
    motion = Variant("SFET3", 2, integrator="radau-2", steps=50).scene(load("problems/pendulum_flexible_smooth.toml"))
    assert motion.analysis.integrator == "radau-2"
    assert motion.analysis.step == pytest.approx(motion.analysis.duration / 50)


# -- how it is judged -----------------------------------------------------------------------------------------


def test_measurement_of_a_mesh_has_its_size_times_and_error():
    scene = load(BEND)
    found = measure(scene, Variant("SFET5", 2), 2, 30.0)
    answer = solve(Variant().scene(scene), Variant("SFET5", 2).settings())
    step = answer.last
    assert (found.unknowns, found.elements) == (step.model.unknowns, 2)
    assert found.whole.runs == 2
    assert found.again.runs == 6
    assert 0.0 < found.again.low <= found.again.median <= found.again.high
    assert found.model + found.solve < 1.5 * found.whole.high
    assert found.status == answer.status.name
    exact = measure(scene, Variant(accuracy=1e-11), 0)
    # Between the reference and the same state on a quarter of the lengths there is next to nothing.
    assert found.observation.error(exact.observation) == pytest.approx(found.own_error, rel=1e-3)


def test_what_is_refused_and_what_fails_is_told():
    scene = made(cantilever(dimension="plane"))
    flat = scene.replace(sections={"s": {"EI3": 1.0}})
    assert "the key 'EI2' is missing" in measure(flat, Variant("SFET3", 2, dimension="space")).failure
    assert measure(made(cantilever((0.0, 1e300))), Variant("SFET3", 2), 0).failure


def observation(*rows, keys=None, energies=()):
    rows = tuple(np.array(row, dtype=float) for row in rows)
    return Observation("positions", rows, (2.0,) * len(rows), keys or tuple(range(len(rows))), energies)


def test_error_is_the_largest_difference_over_its_unit():
    assert observation([1, 2], [3, 4.5]).error(observation([1, 2.25], [3, 4])) == 0.25
    assert observation([1, 2]).error(observation([1, 2], [3, 4])) == np.inf
    assert observation([1, 2]).error(observation([1, 2, 3])) == np.inf


def test_equilibria_of_one_factor_may_stand_in_any_order():
    one, other = observation([1], [2], keys=(1.0, 1.0)), observation([2], [1], keys=(1.0, 1.0))
    assert one.error(other) == 0.0
    assert observation([1], [2], keys=(1.0, 2.0)).error(observation([2], [1], keys=(1.0, 2.0))) == 0.5


def judged(found, reference):
    runs = trading._Trading(made(cantilever()), Limits(), "refined", print)
    runs.observed = reference
    return runs._judged(found)


def test_mirror_images_are_told_from_other_equilibria():
    reference = observation([1.0], energies=(3.0,))
    there = Measurement(Variant("SFET3", 2), observation=observation([-1.0], energies=(3.0,)), own_error=1e-5)
    row = judged(there, reference)
    assert (row.error, row.remark) == (1e-5, "mirrored")
    other = replace(there, observation=observation([-1.0], energies=(2.0,)))
    row = judged(other, reference)
    assert (row.error, row.remark) == (np.inf, "another equilibrium")
    # A coarse mesh that says itself that it is far off is just that.
    coarse = replace(other, own_error=0.9)
    assert judged(coarse, reference).error == 1.0


def test_answers_of_all_kinds_can_be_compared():
    for name, kind in (
        ("vibration_clamped_free", "frequencies"),
        ("lee_frame", "factors and crossings"),
        ("pendulum_flexible_smooth", "positions"),
    ):
        scene = load(f"problems/{name}.toml")
        answer = solve(scene, accuracy=1e-3)
        found = observe(scene, answer)
        assert found.kind == kind
        assert found.error(found) == 0.0
        worst, met, count = expected_error(scene, answer)
        # The literature's digits.
        assert 0.0 < worst < 1e-2
        assert met <= count
    path = made(cantilever(analysis={"type": "path", "range": [0, 1], "points": 5}))
    with pytest.raises(
        SceneError, match="found a path without critical points, accepted: one with such, or with 'steps'"
    ):
        observe(path, solve(path))


# -- processes of their own -----------------------------------------------------------------------------------


def test_work_apart_is_done_and_ended():
    apart = Apart()
    assert apart(60.0, os.getpid) != os.getpid()
    with pytest.raises(EndedError, match=r"took more than 0\.2 s"):
        apart(0.2, time.sleep, 30.0)
    with pytest.raises(EndedError, match="its process died"):
        apart(60.0, os._exit, 1)


@pytest.fixture
def few(monkeypatch):
    """Two meshes and two accuracies."""
    monkeypatch.setattr(trading, "families", lambda scene: [[Variant("SFET5", 1), Variant("SFET5", 4)]])
    monkeypatch.setattr(trading, "by_accuracy", lambda scene: by_accuracy(scene)[1:5:3])
    monkeypatch.setattr(trading, "other_ways", lambda scene, base, dimension: [replace(base, solver="newton")])


def test_trade_runs_all_and_finds_better_meshes_better(few):
    told = []
    found = trade(load(BEND), limits=Limits(repeats=1, longest=60.0, budget=600.0), progress=told.append)
    names = [row.name for row in found.rows]
    assert names[:4] == ["accuracy 1e-03", "accuracy 1e-06", "SFET5 x 1", "SFET5 x 4"]
    # Which of them come first depends on their times; the only one that is as near as 1e-6 is always there.
    others = [f"{base}, newton" for base in names[2:] if f"{base}, newton" in names]
    assert sorted(names[4:]) == others
    assert "SFET5 x 4, newton" in others
    assert told[1:] == names
    rows = dict(zip(names, found.rows))
    assert rows["SFET5 x 4"].error < 1e-2 * rows["SFET5 x 1"].error < 1e-4
    assert rows["accuracy 1e-06"].error <= 1e-6
    assert rows["SFET5 x 4"].measurement.memory is None or rows["SFET5 x 4"].measurement.memory > 0.0
    assert "1e-09 was not reached" in found.advice
    assert found.verdict(1e-6).startswith("accuracy = 1e-06: error ")
    assert found.verdict(1e-9) == ""


def test_what_the_budget_leaves_out_is_told(few):
    found = trade(load(BEND), limits=Limits(repeats=0, longest=60.0, budget=0.01))
    assert not found.rows
    assert any(note.endswith("variants were left out") for note in found.notes)


def test_errors_may_be_against_the_file(few):
    found = trade(load(BEND), limits=Limits(repeats=0, longest=60.0), against="file")
    # The literature has three digits, and its beam is a little softer.
    assert all(1e-5 < row.error < 1e-1 for row in found.rows)


def test_a_scene_without_an_answer_has_no_trade():
    table = cantilever()
    table["nodes"]["B"]["support"] = "ball"
    # Straight between held points: no finite force holds it.
    table["loads"] = {"across": {"type": "distributed", "member": "m", "value": [0, 1]}}
    with pytest.raises(SolveError, match="no reference could be had: "):
        trade(made(table), limits=Limits(longest=60.0))


@pytest.mark.parametrize(
    ("limits", "sentence"),
    [
        ({"repeats": -1}, "repeats: found -1, accepted: 0 to 1000"),
        ({"longest": 0.0}, "longest: found 0, accepted: seconds above zero"),
        ({"budget": np.inf}, "budget: found inf, accepted: seconds above zero"),
    ],
)
def test_limits_that_are_none_are_refused(limits, sentence):
    with pytest.raises(SceneError, match=sentence):
        Limits(**limits)


# -- what is advised and written ------------------------------------------------------------------------------


def row(name, error, seconds, again_seconds=None):
    repeated = None if again_seconds is None else Timing(again_seconds, again_seconds, again_seconds, 3)
    element, _, count = name.partition(" x ")
    variant = Variant(element, int(count)) if count else Variant(accuracy=float(name))
    timing = Timing(seconds, seconds, seconds, 3)
    return Row(Measurement(variant, first=2.0 * seconds, whole=timing, again=repeated, memory=1.0), error)


@pytest.fixture
def made_up():
    """A trade of round numbers: SFET3 x 9 is nothing for anybody."""
    rows = (
        row("1e-3", 1e-5, 0.020, 0.004),
        row("1e-6", 1e-7, 0.024, 0.005),
        row("SFET3 x 2", 5e-4, 0.010, 0.001),
        row("SFET3 x 9", 6e-4, 0.012, 0.009),
        row("SFET7 x 2", 5e-8, 0.022, 0.003),
    )
    reference = Measurement(Variant(accuracy=1e-12), estimate=1e-12, observation=observation([1.0]))
    return Trade(made(cantilever(title="A bar")), "positions", reference, "refined", rows, {"cores": "2"})


def test_front_is_what_nothing_beats(made_up):
    assert [r.name for r in made_up.front(whole)] == ["SFET3 x 2", "accuracy 1e-03", "SFET7 x 2"]
    assert [r.name for r in made_up.front(again)] == ["SFET3 x 2", "SFET7 x 2"]


def test_advice_takes_the_accuracy_where_it_costs_little_more(made_up):
    assert made_up.advice == (
        "for 1e-03 take SFET3 x 2 (10 ms, solved again 1 ms); "
        "for 1e-06 take accuracy 1e-06 (24 ms), to solve again and again SFET7 x 2 (3 ms); "
        "1e-09 was not reached."
    )
    assert made_up.verdict(1e-6) == "accuracy = 1e-06: error 1.0e-07 in 24 ms, 1.1 times the best mesh by hand"


def test_tables_have_each_setting(made_up):
    lines = list(csv.DictReader(io.StringIO(as_csv(made_up))))
    assert [line["setting"] for line in lines] == [r.name for r in made_up.rows]
    assert float(lines[2]["error"]) == 5e-4
    answer = json.loads(as_json(made_up))
    assert answer["front"]["again"] == ["SFET3 x 2", "SFET7 x 2"]
    assert [entry["whole"] for entry in answer["settings"]] == [0.020, 0.024, 0.010, 0.012, 0.022]
    every, short = as_markdown(made_up), as_markdown(made_up, every=False)
    assert "SFET3 x 9" in every
    assert "SFET3 x 9" not in short
    assert made_up.advice in short
    widths = {len(line) for line in every.splitlines() if line.startswith("|")}
    assert len(widths) == 1


def test_picture_has_both_costs_and_the_fronts(made_up, tmp_path):
    figure = front_picture(made_up)
    left, right = figure.axes
    assert (left.get_xlabel(), right.get_xlabel()) == ("a whole run", "a repeated solve alone")
    (front,) = (line for line in left.lines if line.get_label() == "best")
    np.testing.assert_allclose(front.get_xdata(), [0.010, 0.020, 0.022])
    np.testing.assert_allclose(front.get_ydata(), [5e-4, 1e-5, 5e-8])
    figure.savefig(tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 10_000


def test_machine_says_what_it_is():
    found = machine()
    assert {"processor", "cores", "python", "casadi", "numpy"} <= set(found)
    assert all(found.values())


# -- other programs -------------------------------------------------------------------------------------------


def peer_program(tmp_path, text):
    file = tmp_path / "peer.py"
    file.write_text(text)
    return f"{sys.executable} {file} {{file}}"


def test_a_peer_is_compared_node_by_node(tmp_path):
    scene = made(cantilever((0.0, 3.0)))
    reference = solve(scene, accuracy=1e-10)
    x, y, _ = reference.last.position("B")
    answer = {"label": "other", "again": 0.5, "steps": [{"factor": 1.0, "nodes": {"B": {"position": [x, y + 0.01]}}}]}
    missing = {"steps": [{"factor": 2.0, "nodes": {"B": {"position": [x, y]}}}]}
    program = peer_program(tmp_path, f"print({json.dumps(answer)!r}); print({json.dumps(missing)!r})")
    one, other = run_peer(program, tmp_path / "scene.toml", reference, 60.0)
    assert (one.label, one.again) == ("other", 0.5)
    assert one.error == pytest.approx(0.01 / scene.size)
    assert other.error == np.inf
    assert one.seconds > 0.0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("raise SystemExit('no licence')", "which ended with 1: no licence"),
        ("", "which ended with 0: nothing on its standard output"),
        ("print('hello')", "line 1 of what .* printed: found 'hello', accepted: an answer in JSON with 'steps'"),
        ("print('[1]')", r"line 1 of what .* printed: found '\[1\]', accepted: an answer in JSON"),
        ("import time; time.sleep(60)", "which took more than 2 s"),
    ],
)
def test_peers_that_do_not_answer_are_told(tmp_path, text, sentence):
    reference = solve(made(cantilever()))
    with pytest.raises(SceneError, match=sentence):
        run_peer(peer_program(tmp_path, text), tmp_path / "scene.toml", reference, 2.0)
    with pytest.raises(SceneError, match="accepted: a command"):
        run_peer("echo 'unclosed", tmp_path / "scene.toml", reference, 2.0)
    with pytest.raises(SceneError, match="found nothing, accepted: a command"):
        run_peer("", tmp_path / "scene.toml", reference, 2.0)
    with pytest.raises(SceneError, match="which cannot be run"):
        run_peer("no-such-program-here", tmp_path / "scene.toml", reference, 2.0)


def test_peers_are_for_statics(made_up, tmp_path):
    scene = load("problems/vibration_clamped_free.toml")
    with pytest.raises(SceneError, match="--peer: found type 'modes', accepted: 'static'"):
        with_peer(replace(made_up, scene=scene), "peer", tmp_path, 1.0)


# -- the command line -----------------------------------------------------------------------------------------


def test_command_line_prints_the_short_table_and_writes_all(few, tmp_path, capsys):
    scene = tmp_path / "bar.toml"
    dump(made(cantilever((0.0, 3.0))), scene)
    names = {key: str(tmp_path / f"out.{key}") for key in ("md", "csv", "json", "png")}
    program = peer_program(tmp_path, 'print(\'{"steps": [{"nodes": {"B": {"position": [1, 0]}}}]}\')')
    files = ["--markdown", names["md"], "--csv", names["csv"], "--json", names["json"], "--plot", names["png"]]
    assert main(["trade", str(scene), "--repeats", "1", "--longest", "60", *files, "--peer", program]) == 0
    printed = capsys.readouterr().out
    assert "| setting" in printed
    assert "| peer" in printed
    answer = json.loads((tmp_path / "out.json").read_text())
    assert answer["peers"][0]["error"] > 0.1
    assert (tmp_path / "out.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--plot", "out.xyz"], "found the ending '.xyz' of a picture"),
        (["--json", "no/such/out.json"], "no/such/out.json"),
        (["--json", "same.out", "--csv", "same.out"], "found twice, accepted: different files"),
        (["--repeats", "-3"], "repeats: found -3"),
        (["--accuracy-of", "nodes.Q.position"], "found 'Q', accepted"),
    ],
)
def test_bad_options_are_told_before_anything_is_written(options, sentence, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    dump(made(cantilever()), tmp_path / "bar.toml")
    assert main(["trade", "bar.toml", "--longest", "60", *options]) == 2
    assert sentence in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bar.toml"]
