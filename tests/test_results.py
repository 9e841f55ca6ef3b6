"""What benchmarks save, and the comparison with other programs: the search, the exact solutions, the tables."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks import __main__ as program
from benchmarks import compared, compared_exudyn, compared_opensees, compared_problems, compared_sfetcas, saving
from benchmarks.code import has_compiler
from benchmarks.compared_problems import MOTION, STATICS, Candidate
from benchmarks.extremes import elastica_tip
from benchmarks.shooting import exact_tip
from benchmarks.speed import TIP
from sfetcas.equilibria.statics import solve

README = Path(__file__).parent.parent / "README.md"

SAVED = sorted(saving.RESULTS.glob("*.md"))


# -- saved results --------------------------------------------------------------------------------


def test_what_is_printed_is_saved_with_date_machine_and_versions(tmp_path, capsys, monkeypatch):
    def measured():
        print("Words\n")
        saving.head("a", "b")
        saving.row("c", 1)
        return {"rows": [1.5]}

    monkeypatch.setattr(saving, "machine", lambda: {"processor": "a fast one", "casadi": "3.8"})
    text, data = saving.saved("name", measured, tmp_path)
    table = "Words\n\n| a | b |\n|---|---|\n| c | 1 |\n"
    assert capsys.readouterr().out == table
    content = text.read_text()
    assert content.endswith("\n" + table)
    assert re.match(
        r"# Benchmark: name\n\n`python -m benchmarks name`, \d{4}-\d\d-\d\d\n\n- processor: a fast one\n", content
    )
    assert json.loads(data.read_text()).keys() == {"date", "machine", "rows"}


def test_a_benchmark_without_data_saves_its_text_alone(tmp_path):
    (text,) = saving.saved("name", lambda: print("x"), tmp_path)
    assert text.name == "name.md"


def test_save_is_a_word_of_the_command_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(program, "order", lambda: print("measured"))
    monkeypatch.setattr(program, "saved", lambda name, benchmark: [tmp_path / name])
    program.main(["order", "--save"])
    assert capsys.readouterr().out == f"saved {tmp_path / 'order'}\n\n"
    program.main(["order"])
    assert capsys.readouterr().out == "measured\n\n"


@pytest.mark.parametrize("path", SAVED, ids=[path.stem for path in SAVED])
def test_saved_tables_are_markdown(path):
    """Each table has a bar below its head, and rows that are as long."""
    text = path.read_text(encoding="utf-8")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        head, bar, *lines = table.splitlines()
        assert re.fullmatch(r"(\|-+)+\|", bar)
        assert lines
        assert {line.count("|") for line in (head, bar, *lines)} == {head.count("|")}
    assert f"python -m benchmarks {path.stem}" in text


# -- exact solutions ------------------------------------------------------------------------------


def test_shooting_gives_the_elastica():
    found = STATICS["S1"].exact()
    # Integration to 1e-13, elliptic integrals to rounding.
    assert found == pytest.approx(elastica_tip(10.0), abs=1e-11)


def test_shooting_gives_the_bend_in_space():
    problem = STATICS["S2b"]
    answer = solve(problem.scene, accuracy=1e-10).last
    assert problem.error(answer.position("tip"), problem.exact()) < 1e-10


def test_shooting_stretches_and_shears():
    """A small force along the beam stretches it by F/EA, one across it shears it by F/GA besides bending it."""
    scene = STATICS["S1"].scene
    for force, change in (([1e-3, 0.0], [1e-3 / 50.0, 0.0, 0.0]), ([0.0, 1e-3], [0.0, 1e-3 / 20.0, 0.0])):
        loads = {"tip": scene.loads["tip"].replace(value=force)}
        rigid, soft = (exact_tip(scene.replace(loads=loads), *given) for given in ((), (50.0, 20.0)))
        # Linear but for squares of the force.
        assert soft - rigid == pytest.approx(change, abs=1e-6)


def test_half_of_the_beam_on_hinge_and_slider_is_a_cantilever():
    problem = STATICS["S4"]
    answer = solve(problem.scene, accuracy=1e-10).last
    assert problem.error(answer.position("middle"), problem.exact()) < 1e-10


# -- the search -----------------------------------------------------------------------------------


def test_the_fastest_that_reaches_an_error_is_found(monkeypatch):
    monkeypatch.setattr(compared_problems, "times", lambda run, runs, longest: ([run()], None))
    problem = STATICS["S1"]
    candidates = [
        Candidate("coarse", 1e-2, 1e-6, lambda: 1e-6),
        Candidate("fair", 1e-4, 2e-3, lambda: 3e-3),
        # Timed again it turns out to be the faster one.
        Candidate("fine", 1e-6, 3e-3, lambda: 2e-3),
    ]
    rows = compared_problems.fastest(problem, "a program", "cold", candidates)
    assert [(row.target, row.setting, row.seconds) for row in rows] == [(1e-3, "fine", 2e-3), (1e-5, "fine", 2e-3)]


# -- the programs ---------------------------------------------------------------------------------


@pytest.fixture
def short(monkeypatch):
    """Everything is timed once."""
    times = compared_problems.times
    for module in (compared_problems, compared_sfetcas):
        monkeypatch.setattr(module, "times", lambda call, runs, longest=1.0: times(call, 1))


def test_own_rows_are_of_all_kinds_and_reach_the_wanted_errors(monkeypatch, short):
    monkeypatch.setattr(compared_sfetcas, "MESHES", {"SFET5": (2,)})
    monkeypatch.setattr(compared_sfetcas, "has_compiler", lambda: False)
    rows = compared_sfetcas.rows("S1")
    # Two elements reach 1e-5; whole runs choose finer ones.
    wanted = {(kind, target) for kind in ("whole run", "whole run, Newton") for target in (1e-3, 1e-5, 1e-7)}
    wanted |= {(kind, target) for kind in ("cold", "warm") for target in (1e-3, 1e-5)}
    assert {(row.kind, row.target) for row in rows} == wanted
    assert all(0.0 < row.error <= row.target for row in rows)
    named = {"2 SFET5, prepared model", "2 SFET5, parametric solver"}
    assert {row.setting for row in rows if row.kind == "warm"} <= named


@pytest.mark.skipif(not has_compiler(), reason="no C compiler")
def test_own_exported_rows_reach_the_wanted_errors(monkeypatch, short):
    problem, exact = STATICS["S1"], np.append(TIP, 0.0)
    meshes = [compared_sfetcas._Mesh(problem, "SFET3", 2, exact), compared_sfetcas._Mesh(problem, "SFET5", 1, exact)]
    for mesh in meshes:
        # As a search would have found: the first is too coarse.
        mesh.error = {"SFET3": 1.0, "SFET5": 5e-4}[mesh.element]
    rows = compared_sfetcas._exported(problem, meshes, exact)
    assert [(row.kind, row.target, row.setting) for row in rows] == [
        (kind, 1e-3, "1 SFET5") for kind in ("C, cold", "C, warm")
    ]
    assert 1e-4 < rows[0].error < 1e-3


def test_exudyn_solves_the_same_problem(monkeypatch, short):
    pytest.importorskip("exudyn")
    monkeypatch.setattr(compared_exudyn, "PLANE", {"ge2d3": (4,)})
    monkeypatch.setattr(compared_exudyn, "LOAD_STEPS", {"plane": (2,)})
    rows = compared_exudyn.rows("S1")
    assert [(row.kind, row.target) for row in rows] == [("cold", 1e-3), ("warm", 1e-3)]


def test_opensees_solves_the_same_problem(monkeypatch, short):
    pytest.importorskip("openseespy")
    try:
        compared_opensees._opensees()
    except RuntimeError as error:
        pytest.skip(str(error))
    monkeypatch.setattr(compared_opensees, "COUNTS", {"space": (8,)})
    monkeypatch.setattr(compared_opensees, "LOAD_STEPS", {"space": (2,)})
    rows = compared_opensees.rows("S2b")
    assert [(row.kind, row.target) for row in rows] == [("cold", 1e-3), ("warm", 1e-3)]


# -- the tables -----------------------------------------------------------------------------------


def result(rows, versions=("exudyn", "openseespy")):
    keys = ("problem", "program", "kind", "target", "seconds")
    given = [{**dict(zip(keys, row)), "error": 1e-9, "median": 1.0, "setting": "a mesh"} for row in rows]
    problems = {problem.name: problem.title for problem in (*STATICS.values(), MOTION)}
    return {"versions": dict.fromkeys(versions, "1"), "problems": problems, "rows": given, "left_out": ["None."]}


def test_small_table_shows_the_best_of_the_others_and_what_is_not_reached():
    rows = [
        ("S1", "sfetcas", "whole run", 1e-3, 0.0312),
        ("S1", "sfetcas", "cold", 1e-3, 0.00174),
        ("S1", "sfetcas", "warm", 1e-3, 0.000514),
        ("S1", "sfetcas", "C, cold", 1e-3, 0.0000031),
        ("S1", "exudyn", "cold", 1e-3, 0.00024),
        ("S1", "exudyn", "warm", 1e-3, 0.00001),
        ("S1", "openseespy", "cold", 1e-3, 0.00014),
        ("S1", "openseespy", "warm", 1e-3, 0.0001),
    ]
    table = compared.small_table(result(rows)).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    assert len(cells) == 2 + len(compared.SHOWN)
    assert cells[2][1:] == ["1e-03", "31", "1.7 / 0.51", "0.0031", "0.14 / 0.10 (openseespy)"]
    assert cells[3][1:] == ["1e-07", "-", "-", "-", "not reached"]


def test_large_table_has_a_table_for_each_problem_and_what_was_left_out():
    rows = [
        ("S1", "exudyn", "cold", 1e-5, 0.001),
        ("S1", "exudyn", "cold", 1e-3, 0.001),
        ("S1", "sfetcas", "cold", 1e-3, 0.002),
    ]
    text = compared.large_table(result(rows))
    lines = [[cell.strip() for cell in line.split("|")] for line in text.splitlines() if line.startswith("| 1e")]
    assert [line[1:3] for line in lines] == [["1e-03", "sfetcas"], ["1e-03", "exudyn"], ["1e-05", "exudyn"]]
    # Seconds of the row, in ms.
    assert lines[0][5] == "2.0"
    assert text.count("## ") == 5
    assert text.endswith("None.")


def test_a_program_that_is_not_installed_is_left_out(monkeypatch, capsys):
    monkeypatch.setattr(compared.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(compared, "_measured", lambda program, problem: ([], "" if problem == "S1" else "too slow"))
    found = compared.compared()
    assert "exudyn is not installed: its rows are left out." in found["left_out"]
    assert "sfetcas has no rows of D1: too slow." in capsys.readouterr().out


def test_readme_has_the_table_of_the_saved_results():
    text, file = README.read_text(encoding="utf-8"), saving.RESULTS / "compared.json"
    if "<!-- compared -->" not in text:
        pytest.skip("the README does not show the comparison")
    assert f"<!-- compared -->\n{compared.small_table(json.loads(file.read_text()))}\n" in text
