"""The command line as other programs use it: exit codes, one sentence, answers, nothing half-written."""

import io
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import tomli
from moving import FALLING

from sfetcas import Scene, SceneError, cli, outputs
from sfetcas.cli import main
from sfetcas.description.records import counted

PROBLEMS = Path(__file__).parent.parent / "problems"

BEAM = """
title = "beam"
[sections.strip]
EI3 = 1.0
[nodes.A]
position = [0, 0]
support = "clamped"
[nodes.B]
position = [1, 0]
[members.beam]
nodes = ["A", "B"]
section = "strip"
[loads.tip]
type = "force"
node = "B"
value = [0, 1]
"""


@pytest.fixture
def scene(tmp_path):
    """A scene file with its text changed."""

    def write(*changes, name="scene.toml", more=""):
        text = BEAM
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / name
        path.write_text(text + more)
        return path

    return write


def test_run_prints_a_report_and_writes_the_answer(scene, tmp_path, capsys):
    out = tmp_path / "answer.json"
    assert main(["run", str(scene()), "--json", str(out), "--accuracy", "1e-8"]) == 0
    printed = capsys.readouterr().out
    for part in ("beam", "plane: all positions", "node B", "reaction A", "stable", "solved in"):
        assert part in printed
    answer = json.loads(out.read_text())
    assert answer["status"] == "solved"
    assert answer["dimension"] == "plane"
    assert answer["unknowns"] > 0
    assert set(answer["seconds"]) == {"model", "solve"}
    (step,) = answer["steps"]
    # The elliptic-integral tip of a cantilever under F L^2/EI = 1; the accuracy asked for is 1e-8.
    np.testing.assert_allclose(step["nodes"]["B"]["position"], [0.943566763716623, 0.301720773799814, 0], atol=1e-8)
    np.testing.assert_allclose(step["nodes"]["B"]["angle"], 0.461351949711879, atol=1e-7)
    half = step["nodes"]["B"]["angle"] / 2
    np.testing.assert_allclose(step["nodes"]["B"]["quaternion"], [np.cos(half), 0, 0, np.sin(half)], atol=1e-15)
    np.testing.assert_allclose(step["reactions"]["A"]["force"], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(step["reactions"]["A"]["moment"], [0, 0, -0.943566763716623], atol=1e-7)
    beam = step["members"]["beam"]
    assert beam["s"][0] == 0
    assert beam["s"][-1] == 1
    assert {len(v) for v in beam.values() if isinstance(v, list)} == {len(beam["s"])}
    np.testing.assert_allclose(beam["moment"][0], [0, 0, 0.943566763716623], atol=1e-7)
    np.testing.assert_allclose(beam["curvature"][0], beam["moment"][0], atol=1e-12)
    np.testing.assert_allclose(beam["force"][0], [0, 1, 0], atol=1e-12)
    assert step["energy"]["elastic"] + step["energy"]["loads"] == pytest.approx(step["energy"]["total"])
    proof = step["certificate"]
    assert proof["stable"] is True
    assert proof["negative"] == 0
    assert 0 <= proof["residual"] < 1e-12
    assert 0 < proof["error_estimate"] <= 1e-8


def test_only_what_rounding_may_hide_is_printed_as_zero(scene, capsys):
    """Beside a force of 1 N: 1e-14 N may be rounding, 1e-12 N is told."""
    for small, printed in ((1e-14, 0.0), (1e-12, -1e-12)):
        assert main(["run", str(scene(("value = [0, 1]", f"value = [{small}, 1]")))]) == 0
        force = re.search(r"reaction A: force \((\S+), -1, 0\) N", capsys.readouterr().out)[1]
        # Forces are rounded to 1e-16 of the largest.
        assert float(force) == pytest.approx(printed, abs=1e-14 if printed else 0.0)


def test_small_numbers_among_small_ones_are_printed(scene, capsys):
    """A load of 1e-15 N has a reaction of 1e-15 N: there is nothing beside which it were rounding."""
    assert main(["run", str(scene(("value = [0, 1]", "value = [0, 1e-15]")))]) == 0
    force = re.search(r"reaction A: force \(\S+, (\S+), 0\) N", capsys.readouterr().out)[1]
    assert float(force) == pytest.approx(-1e-15, rel=1e-3, abs=0.0)


def test_json_scene_is_the_toml_scene(scene, tmp_path, capsys):
    import sfetcas

    path = tmp_path / "scene.json"
    sfetcas.dump(sfetcas.load(scene()), path)
    assert main(["run", str(path)]) == 0
    from_json = capsys.readouterr().out
    assert main(["run", str(scene())]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith("solved in")]
    assert [line for line in from_json.splitlines() if not line.startswith("solved in")] == lines


def test_overrides_choose_the_mesh(scene, tmp_path):
    out = tmp_path / "answer.json"
    assert main(["run", str(scene()), "--element", "SFET3", "--elements", "5", "--json", str(out)]) == 0
    assert len(json.loads(out.read_text())["steps"][0]["members"]["beam"]["s"]) == 11


def test_short_of_the_accuracy_asked_for_is_exit_1(scene, capsys):
    assert main(["run", str(scene()), "--element", "SFET2", "--elements", "2", "--accuracy", "1e-9"]) == 1
    assert "solved, but not to the accuracy asked for" in capsys.readouterr().out


EXPECT = """
[[expect]]
quantity = "nodes.B.position"
value = [0.9435, 0.3017]
tolerance = {tolerance}
why = "printed with 4 digits"
"""


@pytest.mark.parametrize(("tolerance", "code", "word"), [("1e-4", 0, "ok"), ("1e-6", 1, "FAILED")])
def test_check_compares(scene, capsys, tolerance, code, word):
    path = scene(more=EXPECT.format(tolerance=tolerance))
    assert main(["check", str(path)]) == code
    printed = capsys.readouterr().out
    assert word in printed
    assert "nodes.B.position" in printed
    assert "0.9435" in printed


def test_info_shows_blocks_and_reasons(scene, capsys):
    assert main(["info", str(scene())]) == 0
    printed = capsys.readouterr().out
    assert "angles: 1 for each" in printed
    assert "all positions, shapes" in printed
    assert main(["info", str(PROBLEMS / "spatial_loop_hinge.toml")]) == 0
    printed = capsys.readouterr().out
    for block in ("quaternions", "norms", "closings"):
        assert block in printed


BAD = {
    "unknown key": ((('section = "strip"', 'section = "strip"\nshap = 1'),), "did you mean 'shape'"),
    "wrong type": ((("EI3 = 1.0", 'EI3 = "stiff"'),), "sections.strip.EI3"),
    "nan": ((("EI3 = 1.0", "EI3 = nan"),), "nan"),
    "negative stiffness": ((("EI3 = 1.0", "EI3 = -1.0"),), "EI3"),
    "no support": ((('support = "clamped"\n', ""),), "free to move"),
    "no load": ((('[loads.tip]\ntype = "force"\nnode = "B"\nvalue = [0, 1]\n', ""),), "without load"),
    "space without GJ": ((("value = [0, 1]", "value = [0, 1, 1]"),), "EI2"),
    "later key": ((("value = [0, 1]", "value = [0, 1]\n[springs.s]\nnode = 'A'"),), "springs"),
    "syntax": ((("[nodes.A]", "[nodes.A"),), "line"),
}


@pytest.mark.parametrize(("changes", "part"), BAD.values(), ids=BAD)
def test_bad_input_is_one_sentence_and_exit_2(scene, tmp_path, capsys, changes, part):
    out = tmp_path / "answer.json"
    path = scene(*changes)
    assert main(["run", str(path), "--json", str(out)]) == 2
    caught = capsys.readouterr()
    assert caught.out == ""
    assert len(caught.err.strip().splitlines()) == 1
    assert str(path) in caught.err
    assert part in caught.err
    assert not out.exists()


@pytest.mark.parametrize("option", [["--accuracy", "2"], ["--elements", "0"]])
def test_bad_overrides_are_exit_2(scene, capsys, option):
    assert main(["run", str(scene()), *option]) == 2
    assert "accepted" in capsys.readouterr().err


def test_missing_file_and_folder_are_exit_2(tmp_path, capsys):
    assert main(["run", str(tmp_path / "no.toml")]) == 2
    assert main(["run", str(tmp_path)]) == 2
    assert main(["run", str(tmp_path / "empty.toml")]) == 2
    (tmp_path / "empty.toml").write_text("")
    assert main(["run", str(tmp_path / "empty.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 4


def test_no_solution_is_exit_3_without_numbers(scene, tmp_path, capsys):
    out = tmp_path / "answer.json"
    pulled = scene(
        ("position = [1, 0]", 'position = [1, 0]\nsupport = "clamped"'),
        more="[motions.pull]\nnode = 'B'\ndisplacement = [0.5, 0]\n",
    )
    assert main(["run", str(pulled), "--json", str(out)]) == 3
    caught = capsys.readouterr()
    assert "no solution" in caught.err
    assert "position" not in caught.out
    assert not out.exists()


def test_output_that_cannot_be_written_is_exit_2_and_leaves_the_old_one(scene, tmp_path, capsys):
    assert main(["run", str(scene()), "--json", str(tmp_path / "no" / "answer.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert main(["run", str(scene()), "--json", str(tmp_path)]) == 2
    out = tmp_path / "answer.json"
    out.write_text("old")
    unsolvable = scene(("EI3 = 1.0", "EI3 = 0"))
    assert main(["run", str(unsolvable), "--json", str(out)]) == 2
    assert out.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["answer.json", "scene.toml"]


def test_output_that_cannot_be_written_costs_no_report(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(outputs, "_json", lambda *_: lambda answer, path: path.joinpath("absent").read_text())
    assert main(["run", str(scene()), "--json", str(tmp_path / "answer.json")]) == 2
    caught = capsys.readouterr()
    assert "node B: position" in caught.out
    assert caught.err.count("could not be written") == caught.err.count("\n") == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a disk that is full")
@pytest.mark.parametrize("command", ["info", "run"])
@pytest.mark.parametrize("buffering", [-1, 0])
def test_a_report_that_cannot_be_written_is_told_and_costs_no_file(
    scene, tmp_path, capsys, monkeypatch, command, buffering
):
    out = tmp_path / "answer.json"
    with io.TextIOWrapper(open("/dev/full", "wb", buffering), write_through=not buffering) as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main([command, str(scene()), *(["--json", str(out)] if command == "run" else [])]) == 2
    message = "sfetcas: what is printed cannot be written: No space left on device\n"
    assert capsys.readouterr().err == message
    assert out.exists() == (command == "run")


@pytest.mark.parametrize(
    ("text", "argument"),
    [
        ("loads.a=2.value", ("loads.a=2.value", None)),
        ("loads.a=2.value.1=-1e3:.5", ("loads.a=2.value.1", (-1000.0, 0.5))),
        ("sections.s=1.E=1:2", ("sections.s=1.E", (1.0, 2.0))),
        ("sections.s=1.E", ("sections.s=1.E", None)),
    ],
)
def test_names_may_have_signs_of_equality(text, argument):
    assert cli._span(text) == argument


def test_places_are_behind_the_last_sign_of_equality():
    assert cli._place("a=2=0,0.5, 1") == ("a=2", (0.0, 0.5, 1.0))
    with pytest.raises(SceneError, match=r"--places: found 'a=x', accepted: MEMBER=0,0\.5,1"):
        cli._place("a=x")
    with pytest.raises(SceneError, match="--argument: found 'a=1:2:3', accepted: NAME or NAME=LOW:HIGH"):
        cli._span("a=1:2:3")


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_closed_streams_are_no_mistake(tmp_path, monkeypatch, stream):
    (tmp_path / "falls.json").write_text(json.dumps({**FALLING, "analysis": {"type": "dynamic", "end": 0.02}}))
    monkeypatch.setattr(sys, stream, None)
    assert main(["run", str(tmp_path / "falls.json")]) == 0


def test_command_line_as_a_process(scene):
    run = [sys.executable, "-m", "sfetcas", "run", str(scene())]
    done = subprocess.run(
        run, capture_output=True, text=True, check=True, env={**os.environ, "PYTHONWARNINGS": "error"}
    )
    assert done.stderr == ""
    assert "\n  stable, smallest eigenvalue" in done.stdout


def test_importing_costs_no_matplotlib():
    code = "import sys, sfetcas, sfetcas.cli; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_outputs_replace_plain_files_only(scene, tmp_path, capsys):
    path = scene()
    before = path.read_text()
    link = tmp_path / "link.json"
    link.symlink_to(tmp_path / "target.json")
    for out in (path, link):
        assert main(["run", str(path), "--json", str(out)]) == 2
    assert capsys.readouterr().err.count("accepted") == 2
    assert path.read_text() == before
    assert link.is_symlink()


@pytest.mark.parametrize("value", ['["x", 1]', "[[0, 0], 1]", "[1, 2, 3, 4]"])
def test_an_expectation_of_the_wrong_shape_is_exit_2(scene, capsys, value):
    text = EXPECT.format(tolerance="1e-4").replace("[0.9435, 0.3017]", value)
    assert main(["check", str(scene(more=text))]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


EXTREME = {
    "load": ((("value = [0, 1]", "value = [0, 1e160]"),), "", "nothing resists its bending"),
    "load, too large for a length": (
        (("value = [0, 1]", "value = [1e308, 1e308]"),),
        "",
        "beside loads of 1.41e+308 N m",
    ),
    "size": ((("position = [1, 0]", "position = [1e90, 0]"),), "", "nothing resists its bending"),
    "history": (
        (("value = [0, 1]", "value = [0, 1]\nhistory = 'h'"),),
        "[histories.h]\nt = [0, 1]\nvalue = [0, 1e305]\n",
        "nothing resists its bending",
    ),
    "ratio": (
        (("EI3 = 1.0", "EI3 = {at = [0, 1], value = [1e-300, 1e300]}"),),
        "",
        "a stiffness of 1e-300 N m beside a stiffness of 1e+300 N m",
    ),
    "name": ((("[nodes.B]", f"[nodes.{'n' * 5000}]"),), "", "nnn..."),
    "step": ((), "[analysis]\nsteps = [1e300]\n", "nothing resists its bending"),
}


@pytest.mark.parametrize(("changes", "more", "part"), EXTREME.values(), ids=EXTREME)
@pytest.mark.parametrize("command", ["run", "check", "info"])
def test_extreme_input_is_one_short_sentence(scene, capfd, command, changes, more, part):
    """Also where CasADi and NumPy would warn of every number that they cannot hold."""
    assert main([command, str(scene(*changes, more=more))]) == 2
    told = capfd.readouterr().err
    assert part in told
    assert told.count("\n") == 1
    assert len(told) < 500


def test_half_a_character_is_no_json(scene, capsys):
    table = tomli.loads(scene().read_text())
    for changed in (
        {**table, "title": "\ud800"},
        {**table, "nodes": {**table["nodes"], "\ud800": table["nodes"]["B"]}},
    ):
        path = scene(name="scene.json")
        path.write_text(json.dumps(changed))
        assert main(["run", str(path)]) == 2
        assert "not read as JSON: found '\\ud800', half of a character" in capsys.readouterr().err
    # A pair of halves is one character.
    path.write_text(json.dumps({**table, "title": "\U0001d4b3"}))
    assert main(["info", str(path)]) == 0


@pytest.mark.parametrize("out", ["/proc/answer.json", "n" * 300 + ".json", "/dev/null"])
def test_places_that_take_no_file_are_refused_before_anything_is_solved(scene, capsys, monkeypatch, out):
    monkeypatch.setattr("sfetcas.cli.solve", lambda *_, **__: pytest.fail("solved"))
    assert main(["run", str(scene()), "--json", out]) == 2
    assert "cannot be written; accepted: a plain file" in capsys.readouterr().err


def test_a_picture_of_numbers_that_overflow_is_told_as_one(scene, tmp_path, capsys):
    """The answer stands, and is written; its picture cannot be."""
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    moved = scene(more="[motions.m]\nnode = 'A'\ndisplacement = [1e300, 0]\n")
    assert main(["run", str(moved), "--json", str(out), "--plot", str(picture)]) == 2
    assert f"{picture}: could not be written: overflow" in capsys.readouterr().err
    assert json.loads(out.read_text())["status"] == "solved"
    assert not picture.exists()


def test_answer_and_picture_are_two_files(scene, tmp_path, capsys):
    out = tmp_path / "out.png"
    assert main(["run", str(scene()), "--json", str(out), "--plot", str(out)]) == 2
    assert "found for --json and for --plot, accepted: two files" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("error", [RuntimeError("lost"), ValueError("shapes"), KeyError("name"), ZeroDivisionError()])
def test_a_mistake_of_the_program_is_told_as_one(scene, tmp_path, capsys, monkeypatch, error):
    """Neither an answer nor "no solution": a traceback, a sentence that asks to report it, a code of its own."""

    def broken(*_, **__):
        raise error

    monkeypatch.setattr("sfetcas.cli.solve", broken)
    out = tmp_path / "answer.json"
    assert main(["run", str(scene()), "--json", str(out)]) == 70
    caught = capsys.readouterr()
    assert "Traceback" in caught.err
    assert type(error).__name__ in caught.err
    assert caught.err.splitlines()[-1].startswith("sfetcas: internal error: a mistake of sfetcas")
    assert "report" in caught.err
    assert not out.exists()


def test_a_mistake_while_a_scene_is_made_is_no_syntax_error(scene, capsys, monkeypatch):
    def broken(*_, **__):
        raise ValueError("shapes do not fit")

    monkeypatch.setattr("sfetcas.description.scenefile.Scene.from_dict", broken)
    assert main(["run", str(scene())]) == 70
    assert "not read as" not in capsys.readouterr().err


UNLOADED = ('[loads.tip]\ntype = "force"\nnode = "B"\nvalue = [0, 1]\n', "")


def test_info_needs_no_load(scene, capsys):
    assert main(["info", str(scene(UNLOADED))]) == 0
    printed = capsys.readouterr().out
    assert "angles: 1 for each" in printed
    assert "mobility 0" in printed
    assert main(["info", str(scene(UNLOADED, ('"clamped"', '"hinge"')))]) == 0
    free = capsys.readouterr().out
    assert "mobility 1: member beam turning with node B moving" in free
    assert "counts as held" not in free
    driven = (
        '[loads.tip]\ntype = "force"\nnode = "B"\nvalue = [0, 1]\n',
        '[motions.turn]\nnode = "A"\nrotation = 0.1\n',
    )
    assert main(["info", str(scene(driven, ('"clamped"', '"hinge"')))]) == 0
    assert "mobility 0 (what motions drive counts as held)" in capsys.readouterr().out


@pytest.mark.parametrize("file", sorted(PROBLEMS.glob("*.toml")), ids=lambda file: file.stem)
def test_info_of_every_problem_without_its_loads(file, tmp_path, capsys):
    """Loads and motions say nothing about what is modelled; only the mesh to begin with may differ."""
    import sfetcas

    table = sfetcas.load(file).to_dict()
    for key in ("loads", "motions", "gravity", "expect", "analysis"):
        table.pop(key, None)
    for entry in (*table["nodes"].values(), *table["members"].values()):
        # A beginning in time is for motions alone.
        for key in ("velocity", "spin"):
            entry.pop(key, None)
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(table))
    code = main(["info", str(path)])
    caught = capsys.readouterr()
    # A slider that only a motion holds floats without it.
    assert code == 0 or "free to move: " in caught.err
    assert code != 0 or "mobility" in caught.out


@pytest.mark.parametrize(("number", "said"), [(0, "0 ways out"), (1, "1 way out"), (2, "2 ways out")])
def test_counted_nouns(number, said):
    assert counted(number, "way out", "ways out") == said


def test_reports_count_in_words(tmp_path, capsys):
    """One rigid crank: nothing is in the plural that is one."""
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"crank": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"node": "A", "stiffness": 1.0}},
        "loads": {"push": {"type": "force", "node": "B", "value": [-2.0, 0.0]}},
        "analysis": {"unstable": "stay"},
    }
    path = tmp_path / "crank.json"
    path.write_text(json.dumps(table))
    assert main(["run", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "unstable (1 way out)" in printed
    assert "no flexible member, 1 unknown," in printed


class _Heard(io.StringIO):
    """A stream that says when something has been written to its end: a thread writes while the test waits."""

    def __init__(self):
        super().__init__()
        self.written = threading.Event()

    def flush(self):
        super().flush()
        self.written.set()


@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_a_long_run_without_a_terminal_says_now_and_then_how_far_it_is(kind, monkeypatch):
    stream = _Heard()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(cli, "EVERY", 0.01)
    moving = {"type": "dynamic", "end": 2.0} if kind == "dynamic" else {}
    scene = Scene.from_dict(tomli.loads(BEAM.replace("EI3 = 1.0", "EI3 = 1.0\nrhoA = 1.0")) | {"analysis": moving})
    expected = "sfetcas: run 1: 25 %, 0.5 of 2 s, " if kind == "dynamic" else "sfetcas: static, "
    with cli._progress(scene) as progress:
        if progress is not None:
            progress(0.5)
        # The first line may be older than the progress told; a busy machine may take its time, but not this long.
        for _ in range(2):
            stream.written.clear()
            assert stream.written.wait(60.0)
    assert expected in stream.getvalue()
    assert all(line.startswith("sfetcas: ") and line.endswith(" s so far") for line in stream.getvalue().splitlines())


def test_a_note_of_several_steps_is_printed_once(tmp_path, capsys):
    file = tmp_path / "follower.toml"
    file.write_text(BEAM + 'frame = "follower"\n[analysis]\nsteps = [0.1, 0.2, 0.3]\n')
    assert main(["run", str(file)]) == 0
    assert capsys.readouterr().out.count("note: loads without potential") == 1


def test_seconds_are_those_of_solving_and_not_of_pictures(monkeypatch, capsys):
    clock = [0.0]

    class Slow:
        def write(self, solution):
            clock[0] += 1000.0

    monkeypatch.setattr(cli.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(cli, "outputs_of", lambda options, scene: [Slow()])
    assert main(["run", str(PROBLEMS / "cantilever_tip_force.toml")]) == 0
    assert "solved in 0.000 s" in capsys.readouterr().out
