"""Live pages in a real browser: what the solver in the page finds is what the process finds, slider by slider."""

import importlib.util
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from sfetcas import Scene, SceneError, load, solve
from sfetcas.cli import main
from sfetcas.pages import live, page
from sfetcas.pages.content import content_of
from sfetcas.parametric.equilibrium import equilibrium_solver

pytest.importorskip("playwright")
PROBLEMS = Path(__file__).parent.parent / "problems"

if importlib.util.find_spec("ziglang") is None and not os.environ.get("CI"):
    pytest.skip("found no compiler for WebAssembly", allow_module_level=True)


@pytest.fixture(scope="module")
def bend(tmp_path_factory):
    """The bend and its live page, which takes some seconds to make."""
    answer = solve(load(PROBLEMS / "bend_45_degrees.toml"))
    return answer, answer.page(tmp_path_factory.mktemp("bend") / "page.html", live=True)


def entered(page, at, value):
    """Enter a number of an argument."""
    field = page.window.locator(f"#number-{at}")
    field.fill(repr(value))
    field.press("Tab")
    page.settled()


def told(page):
    return page.window.locator("#live-status").inner_text()


def shown(page, node):
    """The position of a node as the page tells it."""
    page.click(node=node)
    found = page.told("position")
    page.window.locator("#tab-live").click()
    return [float(one) for one in re.findall(r"-?\d[\d.]*(?:e[+-]?\d+)?", found)]


SCENES = (
    "bend_45_degrees",
    "cantilever_tip_force",
    "portal_frame",
    "cantilever_follower_force",
    "tendon_parallel",
    "cantilever_rolled_up",
    "blade_stretch_twist",
    "cantilever_buckled",
    "clamped_rod_end_twist",
    "cord_stiffens",
    "crank_rocker_rigid",
    "elbow_135_degrees",
    "flexible_parallelogram",
    "fourbar_curved_coupler",
    "fourbar_hinges_in_space",
    "heavy_cantilever_gravity",
    "helical_spring_cantilever",
    "hinged_rod_with_spring",
    "magnetic_gripper",
    "princeton_beam_stretching_shearing",
    "right_angled_frame_three_equilibria",
    "s_beam_tip_force",
    "spatial_tree",
    "tapered_cantilever_tip_load",
    "tendon_helical",
    "three_members_spring_and_guide",
)


def test_a_slider_changes_the_answer_as_another_run_does(opened, bend):
    bend, file = bend
    page = opened(bend, file)
    assert page.run("sfetcas.webgl")
    assert told(page).startswith("Solved, residual")
    before = page.inked()
    for step in bend.steps:
        entered(page, 0, step.factor)
        assert told(page).startswith("Solved, residual")
        # Both are within the accuracy of the true one.
        error = 10.0 * bend.scene.analysis.accuracy * 100.0
        assert shown(page, "tip") == pytest.approx(step.position("tip").tolist(), abs=error)
    entered(page, 0, 100.0)
    assert page.inked() != before
    slider = page.window.locator("#argument-0")
    slider.fill("300")
    page.settled()
    assert page.window.locator("#number-0").input_value() == "300"
    assert shown(page, "tip") == pytest.approx(bend.steps[0].position("tip").tolist(), abs=error)
    page.window.get_by_text("as in the scene").click()
    assert page.window.locator("#number-0").input_value() == "600"


def test_the_tip_of_a_force_is_dragged(opened, bend):
    bend, file = bend
    page = opened(bend, file)
    (handle,) = page.run("sfetcas.handles()")
    begin = page.place(node="tip")
    origin = page.window.locator("#symbols").bounding_box()
    x, y = np.add(handle["tip"], [origin["x"], origin["y"]])
    page.drag((x, y), 60, 50)
    values = [float(page.window.locator(f"#number-{k}").input_value()) for k in range(4)]
    assert values[0] == 600.0
    assert np.linalg.norm(values[1:]) != pytest.approx(1.0, abs=1e-3)
    assert page.place(node="tip") != pytest.approx(begin, abs=5.0)
    # The tip of the arrow went with the pointer, relative to the node that it acts on.
    (after,) = page.run("sfetcas.handles()")
    moved = np.subtract(after["tip"], handle["tip"]) - np.subtract(page.place(node="tip"), begin)
    assert moved == pytest.approx([60.0, 50.0], abs=1.0)
    there = solve(bend.scene.replace({"loads.tip.value": values[1:], "analysis.steps": [600.0]}))
    error = 10.0 * bend.scene.analysis.accuracy * 100.0
    assert shown(page, "tip") == pytest.approx(there.last.position("tip").tolist(), abs=error)


def test_numbers_of_one_force_are_one_arrow():
    """With the components that are no arguments as they are in the scene."""
    scene = load(PROBLEMS / "bend_45_degrees.toml").replace({"loads.tip.value": [0.5, 0.25, 1.0]})
    first = {"name": "loads.tip.value.2", "first": 0, "size": 1}
    arguments = [first, {"name": "factor", "first": 1, "size": 1}, {"name": "loads.tip.value.0", "first": 2, "size": 1}]
    (handle,) = live._handles(scene, arguments)
    assert handle["value"] == [0.5, 0.25, 1.0]
    assert handle["parts"] == [[2, 0], [0, 2]]


def test_settings_of_the_command_are_those_of_the_solver_in_the_page(tmp_path, monkeypatch):
    """A page of fewer elements has a solver of fewer."""
    given = []
    monkeypatch.setattr(page, "live_of", lambda scene, places, arguments, settings: given.append(settings) or {})
    words = ["page", str(PROBLEMS / "bend_45_degrees.toml"), str(tmp_path / "page.html"), "--live", "--elements", "3"]
    assert main([*words, "--accuracy", "1e-3"]) in (0, 1)
    assert given[0].elements == 3
    assert given[0].accuracy == 1e-3


def test_where_the_first_solve_finds_nothing_the_answer_stays(opened, bend, tmp_path):
    """As where the way of the steps is what an answer hangs on; here by a factor beyond all that can be computed."""
    answer, file = bend
    text = file.read_text(encoding="utf-8")
    assert text.count('"default":600.0') == 1
    lost = tmp_path / "lost.html"
    lost.write_text(text.replace('"default":600.0', '"default":1e300'), encoding="utf-8")
    page = opened(answer, lost)
    assert told(page).startswith("No solution")
    assert page.inked() > 0
    assert shown(page, "tip") == answer.last.position("tip").tolist()


def test_a_support_is_dragged(opened):
    """An elastica whose ends are pushed together."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [1, 0], "support": "clamped"},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "motions": {"push": {"node": "B", "displacement": [-0.3, 0.1]}},
            "analysis": {"accuracy": 1e-6},
        }
    )
    answer = solve(scene)
    page = opened(answer, live=True, arguments=["motions.push.displacement"])
    (handle,) = page.run("sfetcas.handles()")
    assert handle["kind"] == "place"
    x, y = page.place(node="B")
    page.drag((x, y), -30, 12)
    assert page.place(node="B") == pytest.approx([x - 30.0, y + 12.0], abs=0.5)
    assert told(page).startswith("Solved")


def test_a_snap_is_told(opened):
    """An arch whose crown is pressed down beyond its limit load."""
    path = solve(load(PROBLEMS / "arch_120_degrees_crown_load.toml"))
    limit = min(point.factor for point in path.limit_points if point.factor > 0)
    scene = path.scene.replace(analysis={"type": "static", "steps": [0.5 * limit], "accuracy": 1e-5})
    page = opened(solve(scene), live=True, arguments={"factor": (0.0, 3.0 * limit)})
    entered(page, 0, 0.7 * limit)
    assert told(page).startswith("Solved, residual")
    entered(page, 0, 1.4 * limit)
    assert "snapped" in told(page)
    entered(page, 0, 1.41 * limit)
    assert told(page).startswith("Solved, residual")
    # Beyond its range there is no solution: what is shown stays.
    where = page.place(member=0, sample=5)
    entered(page, 0, 4.0 * limit)
    assert told(page).startswith("No solution: an argument")
    assert page.place(member=0, sample=5) == where


@pytest.mark.parametrize("name", SCENES)
def test_the_page_finds_what_the_process_finds(opened, name):
    scene = load(PROBLEMS / f"{name}.toml")
    answer = solve(scene)
    page = opened(answer, live=True)
    found = content_of(answer)
    flexible = {m["name"]: m["x"] for m in found["members"] if m["type"] == "flexible"}
    solver = equilibrium_solver(scene, "live", places=flexible, stopped=scene.stopped, touching=True, watched=True)
    defaults = np.concatenate([one.default for one in solver.arguments.arguments])
    for share in (1.0, 0.9, 0.7):
        arguments = share * defaults
        there = page.run("(values) => sfetcas.solve(values, true)", arguments.tolist())
        assert there["status"] == 0
        _, here = solver.solve(arguments)
        assert there["results"] == pytest.approx(here.tolist(), abs=1e-12 * np.abs(here).max())


# -- refused -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "words", "sentence"),
    [
        ("lee_frame", ["--live"], "--live: found the analysis 'path', accepted: 'static'"),
        ("bend_45_degrees", ["--argument", "factor"], "--argument: found without effect, accepted: with --live"),
        ("bend_45_degrees", ["--live", "--argument", "loads.up.value"], "loads.up"),
    ],
)
def test_what_no_live_page_shows_is_refused(tmp_path, capsys, name, words, sentence):
    out = tmp_path / "page.html"
    assert main(["page", str(PROBLEMS / f"{name}.toml"), str(out), *words]) == 2
    assert sentence in capsys.readouterr().err
    assert not out.exists()


def test_without_a_compiler_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(SceneError, match=r"found no compiler for WebAssembly, accepted: after pip install"):
        live.check_live(load(PROBLEMS / "bend_45_degrees.toml"))
