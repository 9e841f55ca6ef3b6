"""The measurements run and print what they say; times are not judged."""

import contextlib
import re

import numpy as np
import pytest

from benchmarks import derivatives as benchmark_derivatives
from benchmarks import importing, scenes, speed
from benchmarks import many as benchmark_many
from benchmarks import motion as benchmark_motion
from benchmarks import random_run as benchmark_random
from benchmarks.__main__ import main
from sfetcas.checks import check
from sfetcas.description.scene import Analysis, Expect
from sfetcas.equilibria.statics import Settings, solve
from sfetcas.paths.paths import follow_path
from sfetcas.processes import cores


@pytest.fixture
def once(monkeypatch):
    """One timed run instead of the least of several."""
    least = speed.least
    monkeypatch.setattr(speed, "least", lambda call, runs: least(call, 1))


def rows(printed):
    """Cells of the rows of the first table in Markdown."""
    lines = [line for line in printed.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_benchmark_of_another_name_is_refused():
    accepted = (
        "net, path, motion, steps, code, accuracy, pieces, sweep, batch, estimates, import, extremes, "
        "compared, random, jitter, contact, members, ways, heap"
    )
    with pytest.raises(SystemExit, match=rf"found benchmark 'nets', accepted: .*{accepted}$"):
        main(["nets"])


def test_sweeps_are_measured_against_their_solves(capsys, monkeypatch):
    monkeypatch.setattr(benchmark_many, "CASES", 4)
    monkeypatch.setattr(benchmark_many, "_dask", contextlib.nullcontext)
    main(["sweep"])
    found = rows(capsys.readouterr().out)
    answers = ["the same", "the same", "others", "others"]
    assert [(row[0], row[-1]) for row in found] == [(space, same) for space in ("plane", "space") for same in answers]
    for row in found[:2] + found[4:6]:
        wall, solves, overhead = float(row[2]), float(row[3]), float(row[5].strip(" %"))
        # printed with two digits, of which a tenth of a second of solves is off by a twentieth
        assert cores() * wall / solves - 1.0 == pytest.approx(overhead / 100.0, rel=0.1)


def test_batches_are_measured(capsys, monkeypatch):
    monkeypatch.setattr(benchmark_many, "MANY", 3)
    monkeypatch.setattr(benchmark_many, "FEWER", 2)
    main(["batch"])
    found = rows(capsys.readouterr().out)
    assert [row[:3] for row in found] == [
        ["cantilever", "9", "zero"],
        ["cantilever", "9", "near"],
        ["tendon robot", "4", "zero"],
        ["tendon robot", "4", "near"],
    ]
    assert all(row[5] == "0" and float(row[6]) <= benchmark_many.ACCURACY for row in found)


def test_imports_are_measured(capsys, monkeypatch):
    monkeypatch.setattr(importing, "RUNS", 1)
    monkeypatch.setattr(importing, "COMMANDS", {"import casadi": ["-c", "pass"], "other": ["-c", "pass"]})
    main(["import"])
    (first, _, own), (other, _, multiple) = rows(capsys.readouterr().out)
    assert (first, own, other) == ("`import casadi`", "1.0", "`other`")
    assert float(multiple) > 0.0


def test_derivatives_are_measured_and_are_those_of_differences(capsys, monkeypatch):
    monkeypatch.setattr(benchmark_derivatives, "RUNS", 1)
    monkeypatch.setattr(
        benchmark_derivatives, "CASES", {"linkage": benchmark_derivatives.linkage, "bend": benchmark_derivatives.bend}
    )
    main(["derivatives"])
    cells = rows(capsys.readouterr().out)
    assert [row[0] for row in cells] == ["linkage", "bend"]
    assert [row[2] for row in cells] == ["10", "10"]
    # Rounding of 1e-13 over steps of 1e-2, and the rest of extrapolations.
    assert max(float(off) for row in cells for off in row[-2:]) < 1e-7


@pytest.mark.parametrize("members", [1, 7, 30, 100])
def test_net_has_as_many_members_as_asked_for_and_a_row_more_at_most(members):
    scene = scenes.woven(members)
    columns = sum(name.endswith(" 0") for name in scene.nodes) - 1
    assert members <= len(scene.members) < members + 2 * columns + 1
    assert len(scene.nodes) == len(scene.members) / (2 * columns + 1) * (columns + 1) + columns + 1


@pytest.mark.parametrize("kind", speed.NETS)
@pytest.mark.parametrize("members", [1, 7, 30])
def test_large_systems_are_of_their_kind(kind, members):
    scene = scenes.large(kind, members)
    assert members <= len(scene.members) <= 2 * members + 4
    types = {member.type for member in scene.members.values()}
    asked = {
        "rigid rows": {"flexible", "rigid"},
        "small": {"small"},
        "lattice": {"small"},
        "chain": {"flexible", "rigid"},
    }
    wanted = asked.get(kind, {"flexible", "small", "rigid"} if kind == "all types" else {"flexible"})
    assert types == wanted if members == 30 else types <= wanted


@pytest.mark.parametrize(
    ("kind", "members"), [("rigid rows", 250), ("lattice", 500), ("all types", 200), ("chain", 200)]
)
def test_large_systems_are_solved(kind, members):
    """Systems for which solvers of linear equations run out of what they estimated: the ground balances the loads."""
    scene = scenes.large(kind, members)
    step = solve(scene).last
    assert step.certificate.stable is True
    held = [name for name, node in scene.nodes.items() if node.support != "free"]
    force = sum(np.array(load.vector) for load in scene.loads.values())
    moment = sum(np.cross(step.position(load.node), load.vector) for load in scene.loads.values())
    for name in held:
        reaction, turning = step.reaction(name)
        force, moment = force + reaction, moment + turning + np.cross(step.position(name), reaction)
    # Residuals of 1e-12 of what is added up, by as many nodes; levers are the size of the scene.
    loads = sum(np.linalg.norm(load.vector) for load in scene.loads.values())
    assert np.abs(force).max() < 1e-9 * loads
    assert np.abs(moment).max() < 1e-9 * loads * scene.size


def test_nets_are_measured_in_processes_of_their_own(capsys, monkeypatch):
    monkeypatch.setattr(speed, "NETS", {"wavy strips": (3, 10), "lattice": (4,)})
    main(["net"])
    cases = [("wavy strips", 3), ("wavy strips", 10), ("lattice", 4)]
    for row, (kind, members) in zip(rows(capsys.readouterr().out), cases, strict=True):
        scene = scenes.large(kind, members)
        assert (row[0], int(row[1])) == (kind, len(scene.members))
        made, model, solving, total = (float(cell) for cell in row[4:8])
        # printed with two digits
        assert made + model + solving <= total + 0.02
        assert int(row[3]) == solve(scene).last.model.unknowns


def test_paths_are_measured(capsys, once, monkeypatch):
    monkeypatch.setattr(speed, "PATH_ACCURACIES", (1e-4,))
    main(["path"])
    found = rows(capsys.readouterr().out)
    assert len(found) == 3
    for _, _, points, limits, seconds, each, single, hundred in found:
        assert int(points) > 40
        assert int(limits) == 2
        # printed with two digits or more
        assert float(each) == pytest.approx(1e3 * float(seconds) / int(points), rel=0.01)
        assert float(hundred) == pytest.approx(100.0 * float(each) / float(single), rel=0.01)


@pytest.mark.parametrize(
    ("scene", "factors", "limit"),
    [(scenes.lee_frame(), [-1.5, 2.5], 1.8558746454), (scenes.arch(), [-100, 1000], 897.3089969723)],
    ids=["lee", "arch"],
)
def test_scenes_of_the_paths_are_those_of_the_literature(scene, factors, limit):
    # a millionth of the factor: far above the accuracy 1e-8 of limit points, far below any other frame's difference
    expect = Expect(quantity="factor", limit_point=1, value=limit, tolerance=1e-6 * limit, why="a millionth")
    analysis = Analysis(type="path", range=factors, accuracy=1e-8, points=60)
    asked = scene.replace(analysis=analysis, expect=[expect])
    (found,) = check(asked, follow_path(asked, Settings()))
    assert found.passed, found


def test_motion_is_measured_against_a_finer_run(monkeypatch, capsys):
    make, length, *_ = benchmark_motion.PROBLEMS["D1 pendulum"]
    monkeypatch.setattr(benchmark_motion, "PROBLEMS", {"pendulum": (make, length, (("SFET4", 2),), ("SFET5", 3, 1e-3))})
    monkeypatch.setattr(benchmark_motion, "TOLERANCES", {"radau-3": (1e-2,)})
    main(["motion"])
    ((problem, _, integrator, _, error, *_),) = rows(capsys.readouterr().out)[:1]
    assert (problem, integrator) == ("pendulum", "radau-3")
    # Two elements of order 3 resolve some waves of a sudden release: a percent, not more and not rounding.
    assert 1e-4 < float(error) < 3e-2


def test_random_scenes_are_counted(capsys):
    main(["random", "--count", "2", "--first", "8"])
    printed = capsys.readouterr().out
    assert "| of 2 scenes |" in printed
    rows = dict(re.findall(r"^\| ([\w :-]+) \| (\d+) \|", printed, re.MULTILINE))
    assert int(rows["solved"]) == 2
    assert "| otherwise | moved | reordered | assembly | gauss | space |" in printed


def test_what_takes_too_long_is_killed_and_counted():
    (outcome,) = benchmark_random.random_run([8], seconds=0.0)
    assert (outcome.kind, outcome.others) == ("too slow", {})


def test_a_heap_is_measured(capsys):
    """It falls for a moment, without gaining energy or penetrating."""
    main(["heap", "--rods", "3", "--end", "0.1", "--step", "0.005"])
    (found,) = rows(capsys.readouterr().out)
    assert found[:3] == ["3", "0.1", "20"]
    assert float(found[6]) < 1e-12
    assert float(found[7].split()[0]) <= 1e-6
