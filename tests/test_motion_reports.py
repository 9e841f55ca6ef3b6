"""Motions on the command line: report, JSON, a bar on a terminal, and what is left where they stop early."""

import copy
import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios

import numpy as np
import pytest
from moving import FALLING, STRUCK

from sfetcas import Scene, SolveError, Status, solve
from sfetcas.cli import main

PNG = b"\x89PNG"


@pytest.fixture
def write(tmp_path):
    """A scene as a file."""

    def written(table, **analysis):
        table = copy.deepcopy(table)
        table["analysis"] |= analysis
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(table))
        return path

    return written


def leaves(table, path=()):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key), value


def test_report_and_json_of_a_motion(write, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert main(["run", str(write(FALLING)), "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    for part in ("a hinged beam falls", "radau-3, 30 steps in time, 16 answers up to 0.3 s", "at 0 s", "at 0.3 s"):
        assert part in printed
    for what in ("model", "build", "solve"):
        assert re.search(rf"solved in [\d.]+ s \(.*{what} [\d.]+ s", printed)
    assert "momentum" not in printed  # the ground takes it

    def refuse(constant):
        raise AssertionError(f"{constant} in the JSON answer")

    answer = json.loads(out.read_text(), parse_constant=refuse)
    motion = solve(Scene.from_dict(FALLING))
    np.testing.assert_allclose(answer["times"], np.arange(16) * 0.02, atol=1e-15)
    np.testing.assert_allclose(answer["nodes"]["B"]["position"], motion.positions("B"), atol=1e-12)
    for table in ("nodes", "reactions", "energy", "momentum"):
        for path, values in leaves(answer[table]):
            assert len(values) == 16, path
    # What is printed as largest is the largest of the answer.
    away = np.linalg.norm(np.array(answer["nodes"]["B"]["position"]) - [1, 0, 0], axis=1)
    assert f"farthest from where it began: node B, {away.max():.6g} m at 0.3 s" in printed
    force = np.linalg.norm(answer["reactions"]["A"]["force"], axis=1)
    assert f"at A, {force.max():.6g} N at {answer['times'][force.argmax()]:.6g} s" in printed
    total = np.array(answer["energy"]["total"])
    assert f"off its first value by at most {np.abs(total - total[0]).max():.1e} N m" in printed


def test_momentum_is_told_where_nothing_holds_the_structure(write, capsys):
    nodes = {"A": {"position": [0, 0], "velocity": [0, 1]}, "B": {"position": [1, 0], "velocity": [0, -1]}}
    thrown = {**FALLING, "gravity": [0, 0], "nodes": nodes}
    assert main(["run", str(write(thrown))]) == 0
    printed = capsys.readouterr().out
    # m l^2 / 12 times -2 rad/s, the masses being exact for what turns rigidly; what is off is how far
    # the equations of the steps are solved.
    found = re.search(r"angular momentum: \(0, 0, (\S+)\) kg m2/s at first, off by at most (\S+)", printed)
    assert float(found[1]) == pytest.approx(-2.0 / 12.0, abs=1e-9)
    assert float(found[2]) < 1e-9
    assert "linear momentum: (" in printed
    assert "reaction" not in printed


def test_a_step_that_fails_leaves_what_was_reached(write, tmp_path, capsys):
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    assert main(["run", str(write(STRUCK)), "--json", str(out), "--plot", str(picture)]) == 3
    caught = capsys.readouterr()
    assert "did not converge at 0.1 s" in caught.err
    assert caught.err.count("\n") == 1
    assert "at 0.1 s" in caught.out
    answer = json.loads(out.read_text())
    assert answer["status"] == Status.STOPPED.value
    assert "did not converge at 0.1 s" in answer["failure"]
    np.testing.assert_allclose(answer["times"], np.arange(6) * 0.02, atol=1e-15)
    assert len(answer["nodes"]["B"]["position"]) == 6
    assert picture.read_bytes().startswith(PNG)


def test_a_motion_that_fails_at_once_gives_no_numbers(write, tmp_path, capsys):
    out = tmp_path / "out.json"
    heavy = {**FALLING, "gravity": [0, -1e4]}
    assert main(["run", str(write(heavy, step=0.3)), "--json", str(out)]) == 3
    caught = capsys.readouterr()
    assert "did not converge at 0 s" in caught.err
    assert caught.out == ""
    assert not out.exists()


def stopping(monkeypatch, after):
    """Somebody presses Ctrl-C after some time of the motion: after each step beyond it this is raised."""

    def stopped(reached):
        if reached >= after:
            raise KeyboardInterrupt

    monkeypatch.setattr("sfetcas.cli.solve", lambda *given, progress: solve(*given, progress=stopped))


@pytest.mark.parametrize("expect", [[], [{"quantity": "nodes.A.position", "value": [0, 0], "tolerance": 1e-9}]])
def test_an_interrupted_motion_keeps_what_it_has(write, tmp_path, capsys, monkeypatch, expect):
    stopping(monkeypatch, 0.15)
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    path = write({**FALLING, "expect": expect})
    assert main(["run", str(path), "--json", str(out), "--plot", str(picture)]) == 130
    assert picture.read_bytes().startswith(PNG)
    caught = capsys.readouterr()
    assert caught.err == "sfetcas: interrupted: the motion is known up to 0.14 of 0.3 s\n"
    assert Status.INTERRUPTED.value in caught.out
    assert "quantity" not in caught.out  # nothing is compared
    answer = json.loads(out.read_text())
    assert answer["status"] == Status.INTERRUPTED.value
    assert answer["times"][-1] == pytest.approx(0.14)
    assert main(["check", str(path), str(path)]) == 130
    assert capsys.readouterr().err.count("interrupted") == 1


def test_interrupted_before_the_first_answer_there_is_nothing(write, tmp_path, capsys, monkeypatch):
    def broken(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("sfetcas.dynamics.integrators.integrate", broken)
    out = tmp_path / "out.json"
    assert main(["run", str(write(FALLING)), "--json", str(out)]) == 130
    assert capsys.readouterr().err == "sfetcas: interrupted; nothing was written\n"
    assert not out.exists()


def test_progress_is_told_after_each_step_of_each_run():
    times = []
    solve(Scene.from_dict(FALLING), progress=times.append)
    np.testing.assert_allclose(times[:30], np.arange(1, 31) * 0.01, rtol=1e-12)
    free = copy.deepcopy(FALLING)
    del free["analysis"]["step"]
    free["analysis"]["accuracy"] = 1e-2
    times = []
    solve(Scene.from_dict(free), progress=times.append)
    assert (np.diff(times) <= 0).sum() >= 1  # a finer run begins anew


def test_what_progress_raises_is_not_swallowed():
    def broken(_):
        raise SolveError(Status.FAILED, "enough")

    with pytest.raises(SolveError, match="enough"):
        solve(Scene.from_dict(FALLING), progress=broken)


def shown(path, *command):
    """What a run writes to a terminal as its standard error, and to its standard output."""
    leader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    run = [sys.executable, "-m", "sfetcas", *command, str(path)]
    process = subprocess.Popen(run, stderr=terminal, stdout=subprocess.PIPE, env={**os.environ, "TERM": "xterm"})
    os.close(terminal)
    told = b""
    while True:
        try:
            part = os.read(leader, 4096)
        except OSError:  # how Linux says that nobody has the terminal open any more
            break
        if not part:
            break
        told += part
    printed = process.communicate()[0].decode()
    os.close(leader)
    assert process.returncode == 0
    return told.decode(), printed


def test_a_terminal_shows_a_bar_that_vanishes(write):
    free = copy.deepcopy(FALLING)
    del free["analysis"]["step"]
    told, printed = shown(write(free, accuracy=1e-3), "run")
    assert "run 1:" in told
    assert "run 2:" in told
    assert "of 0.3 s" in told
    # The last that is written wipes the line.
    assert told.rstrip("\r").rsplit("\r", 1)[-1].strip() == ""
    assert "solved in" in printed


def test_nobody_pays_for_a_bar_that_is_not_seen(write):
    code = (
        "import sys\nfrom sfetcas.cli import main\n"
        f"main(['run', {str(write(FALLING))!r}])\nprint('tqdm' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"
    assert done.stderr == ""
