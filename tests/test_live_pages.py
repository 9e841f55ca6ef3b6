"""Live pages in a real browser: what the solver in the page finds is what the process finds, slider by slider."""

import importlib.util
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from sfetcas import Scene, SceneError, load, solve
from sfetcas.cli import main
from sfetcas.codegen.timestep import time_step
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


def energy(page, key):
    """An energy as the page tells it, in J."""
    return float(re.search(rf"{key} ([\d.e+-]+)", page.window.locator("#live-energy").inner_text())[1])


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
        # Four digits are told.
        assert energy(page, "elastic") == pytest.approx(step.energy["elastic"], rel=1e-3)
    entered(page, 0, 100.0)
    assert page.inked() != before
    slider = page.window.locator("#argument-0")
    slider.fill("300")
    page.settled()
    assert page.window.locator("#number-0").input_value() == "300"
    assert shown(page, "tip") == pytest.approx(bend.steps[0].position("tip").tolist(), abs=error)
    # The scale of the colours grows with what is coloured.
    shown_before = float(page.window.locator("#high").inner_text())
    entered(page, 0, 3000.0)
    assert float(page.window.locator("#high").inner_text()) > 1.2 * shown_before
    page.window.get_by_role("button", name="as in the scene").click()
    assert page.window.locator("#number-0").input_value() == "600"


def test_a_notebook_shows_a_live_page_in_a_frame(chromium, bend, tmp_path, monkeypatch):
    """Also there the solver runs."""
    answer, made = bend
    asked = []
    monkeypatch.setattr(page, "page_of", lambda *given, **how: asked.append(how) or made.read_text(encoding="utf-8"))
    shown = answer.view(live=True, arguments=["factor"])._repr_html_()
    assert asked == [{"live": True, "arguments": ["factor"]}]
    file = tmp_path / "notebook.html"
    file.write_text(f"<!DOCTYPE html><body>{shown}</body>", encoding="utf-8")
    window, said = chromium.new_page(), []
    window.on("console", lambda message: said.append(message.text))
    window.goto(file.as_uri())
    status = window.frame_locator("iframe").locator("#live-status")
    status.filter(has_text="Solved, residual").wait_for()
    assert said == []
    window.close()


def test_a_browser_that_cannot_run_the_solver_shows_the_answer(opened, chromium, bend):
    window = chromium.new_page(viewport={"width": 1100, "height": 700})
    window.add_init_script("delete window.DecompressionStream")
    page = opened(*bend, window=window)
    assert "The solver does not run in this browser" in page.window.locator("#panel-live").inner_text()
    assert page.inked() > 0
    assert page.run("sfetcas.state()") < len(bend[0].steps)


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


# -- motions -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    """A strip whose tip is pushed aside by a force that rises and stays, and its live page."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0, "damping": 0.05}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "elements": 4}},
            "histories": {"rise": {"t": [0.0, 0.5], "value": [0.0, 1.0]}},
            "loads": {"tip": {"type": "force", "node": "B", "value": [0.0, 1.0], "history": "rise"}},
            "analysis": {"type": "dynamic", "end": 2.0, "step": 0.01},
        }
    )
    answer = solve(scene)
    return answer, answer.page(tmp_path_factory.mktemp("swinging") / "page.html", live=True)


MOTIONS = (
    "swinging",
    "cantilever_plucked",
    "elbow_force_pulse",
    "flexible_parallelogram_motion",
    "pendulum_in_space",
    "slider_crank_motion",
    "double_pendulum_rigid",
    "flying_rod_in_space",
    "bead_on_circular_wire",
)
STEPS = 20

MOST = 2_000_000
"""Bytes of a page."""


@pytest.mark.parametrize("name", MOTIONS)
def test_the_page_takes_the_steps_of_the_process(opened, swinging, tmp_path, name):
    """With constant arguments, and as the histories of the scene go."""
    answer, file = swinging
    if name != "swinging":
        answer = solve(load(PROBLEMS / f"{name}.toml"))
        file = answer.page(tmp_path / "page.html", live=True)
    assert file.stat().st_size < MOST
    scene, page = answer.scene, opened(answer, file)
    shown = content_of(answer)["members"]
    flexible = {m["name"]: m["x"] for m in shown if m["type"] == "flexible"}
    own = time_step(scene, "live", places=flexible)
    defaults, names = own.arguments.defaults, [name for one in own.arguments.arguments for name in one.names]
    courses = {i: scene.histories[n.split(".")[1]] for i, n in enumerate(names) if n.startswith("histories.")}
    for given in (0.9 * defaults, None):
        there = page.run(
            "([count, values]) => sfetcas.steps(count, values)", [STEPS, None if given is None else given.tolist()]
        )
        assert there["status"] == 0
        state, time = own.begin, 0.0
        for _ in range(STEPS):
            values = np.tile(defaults if given is None else given, (len(own.times), 1))
            for i, course in courses.items() if given is None else ():
                values[:, i] = course.factor(time + own.usual * own.times)
            state, time = own.step(state, own.usual, values), time + own.usual
        here = own.outputs(state, values[-1])
        assert there["results"] == pytest.approx(here.tolist(), abs=1e-12 * np.abs(here).max())
        assert told(page).startswith("Time")


def stopped(page):
    """Stop the motion."""
    if page.window.locator("#live-run").inner_text() == "stop":
        page.window.locator("#live-run").click()
    page.settled()
    assert told(page).endswith("stopped")


def seconds(page):
    return float(re.search(r"[Tt]ime ([\d.e+-]+) s", told(page))[1])


def test_a_motion_runs_stops_and_begins_anew(opened, swinging):
    page = opened(*swinging)
    assert page.run("sfetcas.state()") > 0
    page.until("document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > 0.6")
    stopped(page)
    first, place = seconds(page), page.run("sfetcas.at({node: 'B'})")
    # The history of the scene went on by itself, and the tip with it.
    assert float(page.window.locator("#number-0").input_value()) == 1.0
    assert place[1] > 0.1
    # The load does all the work: damping takes a part of it.
    kinetic, elastic, total = (energy(page, key) for key in ("kinetic", "elastic", "total"))
    assert kinetic > 0.0 < elastic
    assert -1.001 * place[1] < total - kinetic - elastic < total < 0.0
    page.window.locator("#tab-answer").click()
    assert "reaction at A" in page.window.locator("#panel-answer").inner_text()
    page.window.locator("#tab-live").click()
    page.window.wait_for_timeout(100)
    assert seconds(page) == first
    page.window.locator("#live-run").click()
    page.until(f"document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > {first}")
    stopped(page)
    page.window.get_by_role("button", name="from the beginning").click()
    page.until("document.getElementById('live-status').textContent.includes('running')")
    stopped(page)
    assert seconds(page) < first
    # States of the answer are looked at meanwhile: what is not seen does not run.
    page.window.locator("#live-run").click()
    page.window.locator("#state").fill("0")
    page.until("document.getElementById('live-run').textContent === 'run'")
    assert page.run("sfetcas.state()") == 0


def test_a_force_is_dragged_while_it_moves(opened, swinging):
    page = opened(*swinging)
    page.until("document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > 0.6")
    stopped(page)
    (handle,) = page.run("sfetcas.handles()")
    origin = page.window.locator("#symbols").bounding_box()
    page.drag(np.add(handle["tip"], [origin["x"], origin["y"]]), 0, 60)
    value = float(page.window.locator("#number-2").input_value())
    # As long as the arrow was, so far it went down.
    length = np.linalg.norm(np.subtract(np.add(handle["tip"], [origin["x"], origin["y"]]), page.place(node="B")))
    assert value == pytest.approx(1.0 - 60.0 / length, abs=0.05)
    before = seconds(page)
    page.window.locator("#live-run").click()
    page.until(f"document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > {before + 0.1}")
    stopped(page)
    # A slider of a history takes it over; all goes on as in the scene again.
    entered(page, 0, 0.25)
    page.window.locator("#live-run").click()
    page.window.wait_for_timeout(100)
    stopped(page)
    assert float(page.window.locator("#number-0").input_value()) == 0.25
    page.window.get_by_role("button", name="as in the scene").click()
    page.window.locator("#live-run").click()
    page.until("document.getElementById('number-0').value === '1'")
    assert float(page.window.locator("#number-2").input_value()) == 1.0


def test_numbers_are_typed_while_a_motion_runs(opened, swinging):
    page = opened(*swinging)
    field = page.window.locator("#number-2")
    field.click()
    page.window.keyboard.press("Control+A")
    page.window.keyboard.type("0.25", delay=60)
    assert field.input_value() == "0.25"
    page.window.keyboard.press("Enter")
    page.settled()
    assert field.input_value() == "0.25"
    # What is no number changes nothing.
    field.fill("")
    field.press("Enter")
    page.until("document.getElementById('number-2').value === '0.25'")
    # Recorded states that are played make way.
    page.window.locator("#play").click()
    page.until("document.getElementById('live-run').textContent === 'run'")
    before = seconds(page)
    page.window.locator("#live-run").click()
    page.until(f"document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > {before + 0.3}")
    assert page.window.locator("#live-run").inner_text() == "stop"


def test_a_node_that_a_history_moves_is_given_back(opened):
    """From where a slider has put it, without a jump."""
    scene = Scene.from_dict(
        {
            "gravity": [0, -1],
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0, "damping": 0.05}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "elements": 4}},
            "histories": {"h": {"t": [0, 1, 2, 4], "value": [0, 1, 0, 0], "interpolation": "spline"}},
            "motions": {
                "up": {"node": "A", "displacement": [0, 0.5], "history": "h"},
                "turn": {"node": "A", "rotation": 0.5, "history": "h"},
            },
            "analysis": {"type": "dynamic", "end": 1.0, "step": 0.01},
        }
    )
    page = opened(solve(scene), live=True)
    page.window.locator("#live-speed").select_option("4")
    page.until("document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > 4.1")
    entered(page, 1, 0.3)
    page.until("Math.abs(sfetcas.at({node: 'A'})[1] - 0.15) < 1e-9")
    time = seconds(page)
    page.until(f"document.getElementById('live-status').textContent.match(/[0-9.]+/)[0] > {time + 1.0}")
    page.window.get_by_role("button", name="as in the scene").click()
    page.until("Math.abs(sfetcas.at({node: 'A'})[1]) < 1e-9")
    stopped(page)
    assert page.window.locator("#number-1").input_value() == "0"
    # The guide holds it there.
    assert 0.0 < float(re.search(r"closings met to ([\d.e+-]+),", told(page))[1]) < 1e-9


def test_a_motion_that_cannot_go_on_says_why(opened, swinging):
    """Here by a load outside of what numbers are."""
    page = opened(*swinging)
    stopped(page)
    entered(page, 2, 1e300)
    page.window.locator("#live-run").click()
    page.until("document.getElementById('live-status').textContent.startsWith('Stopped')")
    assert "no step: Newton's method did not converge" in told(page)
    assert page.inked() > 0
    # Where the load is another it goes on.
    entered(page, 2, 0.5)
    page.window.locator("#live-run").click()
    page.until("document.getElementById('live-status').textContent.endsWith('running')")
    entered(page, 2, 1e300)
    page.until("document.getElementById('live-status').textContent.startsWith('Stopped')")
    page.window.get_by_role("button", name="from the beginning").click()
    page.until("document.getElementById('live-status').textContent.endsWith('running')")


def test_histories_of_a_motion_are_arguments_anyway(monkeypatch, swinging):
    """The page knows the time, and what a history is then."""
    scene = swinging[0].scene
    monkeypatch.setattr(live, "_compiled", lambda folder, names: b"")
    made = live.live_of(scene, {"m": np.array([0.0, 1.0])}, ["loads.tip.value"])
    assert [one["name"] for one in made["arguments"]] == ["loads.tip.value", "histories.rise"]
    assert made["arguments"][1]["spans"] == [[0.0, 1.0]]
    assert made["histories"]["histories.rise"] == {"t": (0.0, 0.5), "pieces": ((0.0, 1.0),), "value": 0.0}


# -- what moves with it ------------------------------------------------------------------------------------------------


def rocker(dimension):
    """A curved rigid arm, hinged on the ground and held by a spring and a strip, that a force turns."""
    out = [0.0] if dimension == "space" else []
    axis = {"axis": [0, 0, 1]} if out else {}
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0} if out else {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0, *out], "support": "hinge", **axis},
                "B": {"position": [1, 0, *out]},
                "C": {"position": [2, 0, *out]},
            },
            "members": {
                "arm": {
                    "type": "rigid",
                    "nodes": ["A", "B"],
                    "shape": {"type": "arc", "angle": 2.0, **({"normal": [0, 0, 1]} if out else {})},
                },
                "strip": {"nodes": ["B", "C"], "section": "s", "elements": 4},
            },
            "springs": {
                "turn": {"type": "rotational", "node": "A", "stiffness": 2.0},
                "pull": {"type": "translational", "node": "B", "stiffness": 1.0, "anchor": [1, -1, *out]},
            },
            "loads": {"tip": {"type": "force", "node": "C", "value": [0, 1.0, *out]}},
            "analysis": {"steps": [1.0]},
        }
    )


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_rigid_members_and_symbols_move_as_in_an_answer(opened, dimension):
    scene = rocker(dimension)
    page = opened(solve(scene), live=True)
    entered(page, 0, 0.4)
    there = solve(scene.replace({"analysis.steps": [0.4]}))
    found = content_of(there)
    size = scene.size
    for m, member in enumerate(found["members"]):
        places = there.last.along(member["name"], np.array(member["x"]))["position"]
        for sample in (0, len(places) // 3, len(places) // 2, len(places) - 1):
            assert page.run("(what) => sfetcas.at(what)", {"member": m, "sample": sample}) == pytest.approx(
                places[sample].tolist(), abs=1e-3 * size
            )

    # Springs end where nodes are now, and on the ground where they did.
    def zigzag():
        drawn = [one["points"] for one in page.run("sfetcas.symbols()") if one.get("carriers") == ["B", None]]
        return np.reshape(max(drawn, key=lambda points: None not in points), (-1, 3)).astype(float)

    spring = zigzag()
    assert spring[0] == pytest.approx(there.last.position("B"), abs=1e-3 * size)
    assert spring[-1] == pytest.approx([1.0, -1.0, 0.0], abs=1e-3 * size)
    assert not any(one.get("acts") for one in page.run("sfetcas.symbols()"))

    def width(points):
        along = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
        across = points - points[0] - np.outer((points - points[0]) @ along, along)
        return np.linalg.norm(across, axis=1).max()

    # Also where the spring has turned and stretched it is as wide as in the answer.
    entered(page, 0, -1.0)
    assert width(zigzag()) == pytest.approx(width(spring), rel=1e-3)


def test_a_body_that_turns_freely_in_space_is_refused():
    """Nothing tells how a bow between two balls turns about the line between them."""
    scene = rocker("space").replace({"members.arm.release": ["ball", "ball"]})
    results = ["nodes.A.quaternion", "nodes.B.quaternion"]
    places = {name: np.array([0.0, 0.5, 1.0]) for name in scene.members}
    assert live._bodies(rocker("space"), places, results)["arm"]["node"] == "A"
    with pytest.raises(
        SceneError, match="'arm' that is curved and turns freely at all of its nodes, accepted: straight"
    ):
        live._bodies(scene, places, results)


@pytest.fixture(scope="module")
def arch(tmp_path_factory):
    """The path of an arch that is pressed down at its crown, its limit load, and a live page up to three times that."""
    path = solve(load(PROBLEMS / "arch_120_degrees_crown_load.toml"))
    limit = min(point.factor for point in path.limit_points if point.factor > 0)
    file = tmp_path_factory.mktemp("arch") / "page.html"
    return path, limit, path.page(file, live=True, arguments={"factor": (0.0, 3.0 * limit)})


def test_names_that_objects_have_are_names(opened):
    """Of rigid members, which pages look up by their names."""
    scene = rocker("plane").to_dict()
    scene["members"] = {"constructor": scene["members"]["arm"], "__proto__x": scene["members"]["strip"]}
    scene["nodes"]["D"] = {"position": [2.5, 0]}
    scene["members"]["toString"] = {"type": "rigid", "nodes": ["C", "D"]}
    page = opened(solve(Scene.from_dict(scene)), live=True)
    assert told(page).startswith("Solved, residual")


def test_a_path_is_followed_beside_its_diagram(opened, arch):
    """What the solver finds is a point of the chart."""
    path, limit, file = arch
    page = opened(path, file)
    assert page.window.locator("#panel-live .chart .cursor").get_attribute("visibility") == "visible"
    before = page.window.locator(".cursor").get_attribute("cy")
    entered(page, 0, 0.4 * limit)
    assert told(page).startswith("Solved, residual")
    assert float(page.window.locator(".cursor").get_attribute("cy")) < float(before)


def test_a_snap_is_told(opened, arch):
    """Beyond the limit load."""
    path, limit, file = arch
    page = opened(path, file)
    entered(page, 0, 0.4 * limit)
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


def test_the_slider_of_a_factor_goes_along_the_path(monkeypatch):
    """And begins on it, where the loads' own factor, 1, is not."""
    monkeypatch.setattr(live, "_compiled", lambda folder, names: b"")
    scene = load(PROBLEMS / "arch_120_degrees_crown_load.toml")
    for low, high in (scene.analysis.range, (0.0, 0.5)):
        found = live.live_of(scene.replace({"analysis.range": [low, high]}), {}, ["factor"])["arguments"][0]
        assert found["spans"] == [[low, high]]
        assert found["default"] == min(1.0, high)


# -- refused -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "words", "sentence"),
    [
        ("vibration_helix", ["--live"], "--live: found the analysis 'modes', accepted: 'static', 'path', 'dynamic'"),
        (
            "ball_bounces",
            ["--live"],
            "sfetcas: analysis.integrator: found 'radau-3' with contact, accepted for C: stepping",
        ),
        ("bend_45_degrees", ["--argument", "factor"], "--argument: found without effect, accepted: with --live"),
        ("bend_45_degrees", ["--live", "--argument", "loads.up.value"], "loads.up"),
        (
            "slider_crank_motion",
            ["--live", "--argument", "nodes.slider.mass"],
            "a number on which nothing depends in the steps of a motion, accepted: loads, motions, stiffness",
        ),
        (
            "bend_45_degrees",
            ["--live", "--argument", "sections.square.EI3=-1:1000000"],
            "sections.square.EI3: found -1 to 1e+06, accepted for this number: from zero on",
        ),
        (
            "bend_45_degrees",
            ["--live", "--argument", "loads.tip.value.2=nan:6"],
            "--argument: found 'loads.tip.value.2=nan:6', accepted: NAME or NAME=LOW:HIGH",
        ),
    ],
)
def test_what_no_live_page_shows_is_refused(tmp_path, capsys, name, words, sentence):
    out = tmp_path / "page.html"
    assert main(["page", str(PROBLEMS / f"{name}.toml"), str(out), *words]) == 2
    said = capsys.readouterr()
    assert sentence in said.err
    # Before anything is solved.
    assert not said.out
    assert not out.exists()


def test_steps_that_no_live_page_takes_are_refused(monkeypatch, swinging):
    monkeypatch.setattr(live, "_compiled", lambda folder, names: b"")
    scene = swinging[0].scene.replace({"analysis.step": 1e-8})
    with pytest.raises(SceneError, match=r"^analysis.step: found 1e-08 s, accepted of a live page: at least 5e-07 s"):
        live.live_of(scene, {"m": np.array([0.0, 1.0])})


def test_without_a_compiler_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(SceneError, match=r"found no compiler for WebAssembly, accepted: after pip install"):
        live.check_live(load(PROBLEMS / "bend_45_degrees.toml"))


needs_clang = pytest.mark.skipif(
    not (shutil.which("clang") and shutil.which("wasm-ld")), reason="no clang for WebAssembly here"
)


@needs_clang
def test_clang_compiles_what_zig_does(opened, swinging, tmp_path, monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else found(name))
    answer, file = swinging
    pages = [opened(answer, one) for one in (file, answer.page(tmp_path / "clang.html", live=True))]
    both = [page.run("sfetcas.steps(20, null)")["results"] for page in pages]
    assert both[0] == pytest.approx(both[1], abs=1e-12)


def test_a_compiler_that_fails_says_why(monkeypatch, tmp_path):
    """By its first error, not by the last line, that something went wrong."""
    monkeypatch.setattr(live, "_compiler", lambda: [sys.executable, str(tmp_path / "compiler.py")])
    (tmp_path / "compiler.py").write_text("raise SystemExit('glue.c: error: no stdio.h\\nclang: error: it failed')")
    with pytest.raises(SceneError, match=r"^live: the compiler for WebAssembly failed: glue.c: error: no stdio.h$"):
        live._compiled(tmp_path, [])
