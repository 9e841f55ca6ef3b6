"""What pages hold of answers, and how they are written."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes import lattice
from sfetcas import Scene, SceneError, load, solve
from sfetcas.cli import main
from sfetcas.pages import content
from sfetcas.pages.content import content_of
from sfetcas.pages.page import page_of

PROBLEMS = Path(__file__).parent.parent / "problems"

MOST = 2_000_000
"""Bytes of a page of a usual scene."""


@pytest.fixture(scope="module")
def bend():
    return solve(load(PROBLEMS / "bend_45_degrees.toml"))


def unpacked(found, text):
    return np.frombuffer(base64.b64decode(text), {64: "<f8", 32: "<f4"}[found["bits"]])


def held(page):
    """The table that a page holds, as a browser reads it."""
    (text,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def test_places_and_values_are_those_of_the_answer(bend):
    found = content_of(bend)
    assert found["bits"] == 64
    (member,) = found["members"]
    for state, step in zip(found["states"], bend.steps, strict=True):
        along = step.along("bend", member["x"])
        assert np.array_equal(unpacked(found, state["lines"]).reshape(-1, 3), along["position"])
        # A load at the tip bends and pulls by the same force everywhere.
        tension, shear = (unpacked(found, state["values"][key]) for key in ("tension", "shear"))
        assert np.hypot(tension, shear) == pytest.approx(np.full(len(tension), step.factor), rel=1e-12)
        assert state["told"]["nodes"]["tip"]["position"] == step.position("tip").tolist()
    # Where the JSON answer lists fields a page has them.
    assert set(bend.to_dict()["steps"][-1]["members"]["bend"]["s"]) <= set(member["x"])


def chain(count, **analysis):
    """A cantilever in so many members under a force at its tip."""
    nodes = {f"n{i}": {"position": [i / count, 0.0]} for i in range(count + 1)}
    nodes["n0"]["support"] = "clamped"
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": nodes,
            "members": {f"m{i}": {"nodes": [f"n{i}", f"n{i + 1}"], "section": "s"} for i in range(count)},
            "loads": {"f": {"type": "force", "node": f"n{count}", "value": [-1e-3, 1.0]}},
            "analysis": analysis,
        }
    )


@pytest.mark.parametrize(
    "scene",
    [
        lattice(180).replace({"analysis.steps": [0.5, 0.75, 1.0]}),
        chain(40, type="dynamic", end=0.1, accuracy=1e-2),
    ],
    ids=["steps", "motion"],
)
def test_many_members_leave_pages_small(scene):
    """Of a motion with a hundred answers only some are shown then."""
    page = page_of(solve(scene))
    assert len(page.encode()) < MOST
    found = held(page)
    assert found["bits"] == 32
    assert len(found["members"]) == len(scene.members)


def test_modes_that_only_twist_are_not_drawn_by_their_rounding():
    found = content_of(
        solve(
            Scene.from_dict(
                {
                    "dimension": "space",
                    "sections": {"s": {"EI2": 1e4, "EI3": 1e4, "GJ": 0.01, "rhoA": 1.0, "rhoI": [1.0, 0.5, 0.5]}},
                    "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
                    "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
                    "analysis": {"type": "modes", "modes": 2},
                }
            )
        )
    )
    for mode in found["modes"]:
        assert mode["text"].endswith("only twists")
        assert not unpacked(found, mode["real"]).any()
    bends = content_of(solve(load(PROBLEMS / "vibration_clamped_free.toml")))
    for mode in bends["modes"]:
        lines = unpacked(bends, mode["real"]).reshape(-1, 3)
        assert np.linalg.norm(lines, axis=1).max() / mode["scale"] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    "name",
    [
        "cantilever_inclined_force_all_equilibria",
        "column_supported_between",
        "floor_heavy_cantilever",
        "double_pendulum_rigid",
        "ropes_crossing",
        "tendon_helical",
        "vibration_tip_mass",
    ],
)
def test_pages_of_all_kinds_hold_what_the_answer_tells(name):
    answer = solve(load(PROBLEMS / f"{name}.toml"))
    page = page_of(answer)
    assert len(page.encode()) < MOST
    found = held(page)
    assert len(found["states"]) >= len(answer.steps)
    points = sum(len(member["x"]) for member in found["members"])
    for state in found["states"]:
        assert len(unpacked(found, state["lines"])) == 3 * points
        assert all(0 <= number < len(found["symbols"]) for number in state["symbols"])
    for mode in found["modes"]:
        assert len(unpacked(found, mode["real"])) == 3 * points
    supported = [name for name, node in answer.scene.nodes.items() if node.support != "free"]
    assert not supported or found["symbols"]


def test_states_of_a_path_have_the_certificates_of_its_points():
    path = solve(load(PROBLEMS / "lee_frame.toml"))
    found = content_of(path)
    points = [state for state in found["states"] if state["kind"] == "limit point"]
    assert [state["told"]["certificate"] for state in points] == [
        entry.certificate.to_dict() for entry in path.limit_points
    ]
    asked = [state for state in found["states"] if state["kind"] == "step"]
    assert [state["at"] for state in asked] == [entry.factor for entry in path.steps]


def test_where_contact_and_strings_change_on_a_path_is_told():
    path = solve(load(PROBLEMS / "arch_caught_by_a_string.toml"))
    assert path.transitions
    states = [state for state in content_of(path)["states"] if state["kind"] == "transition"]
    assert [state["at"] for state in states] == [one.factor for one in path.transitions]
    assert [state["told"]["changes"] for state in states] == [list(one.changes) for one in path.transitions]


def test_frequencies_along_a_path_are_those_of_its_points():
    path = solve(load(PROBLEMS / "beck_column_flutter.toml"))
    states = content_of(path)["states"]
    points = [state for state in states if state["kind"] not in ("step", "flutter point")]
    assert len(points) == len(path.points)
    for state, point in zip(points, path.points, strict=True):
        assert state["omega"] == pytest.approx(point.omega.tolist(), rel=1e-12)
    (flutter,) = (state for state in states if state["kind"] == "flutter point")
    assert flutter["omega"] == (path.flutter_points[0].omega,) * len(points[0]["omega"])


def test_long_paths_and_motions_keep_what_was_asked_for(monkeypatch):
    monkeypatch.setattr(content, "MOST_STATES", 12)
    path = solve(load(PROBLEMS / "lee_frame.toml"))
    kinds = [state["kind"] for state in content_of(path)["states"]]
    assert len(kinds) <= 12 + 2 + len(path.steps)
    assert kinds.count("limit point") == 2
    motion = solve(load(PROBLEMS / "double_pendulum_rigid.toml"))
    times = [state["at"] for state in content_of(motion)["states"]]
    assert len(motion.times) < len(times) <= 12
    assert set(motion.times.tolist()) <= set(times)


# -- written -----------------------------------------------------------------------------------------------------------


def test_the_command_writes_a_page_with_report_and_scene(tmp_path, capsys):
    file, page = PROBLEMS / "bend_45_degrees.toml", tmp_path / "bend.html"
    assert main(["page", str(file), str(page)]) == 0
    printed = capsys.readouterr().out
    found = held(page.read_text(encoding="utf-8"))
    assert found["scene"] == file.read_text(encoding="utf-8")
    # With the comparisons, but for the time that it took.
    said, shown = (
        [line for line in text.splitlines() if not line.startswith("solved in")] for text in (found["report"], printed)
    )
    assert said == shown
    assert any(line.split() == ["quantity", "value", "reference", "error", "tolerance"] for line in said)
    assert [one.name for one in tmp_path.iterdir()] == ["bend.html"]


TORN = """
[sections.s]
EI3 = 1.0
[nodes.A]
position = [0, 0]
support = "clamped"
[nodes.B]
position = [1, 0]
support = "clamped"
[members.m]
nodes = ["A", "B"]
section = "s"
[motions.pull]
node = "B"
displacement = [1, 0]
"""
"""A member that does not stretch, drawn to twice its length."""


@pytest.mark.parametrize(
    ("gravity", "up"),
    [
        ((0, -9.81, 0), 1),
        ((1e-15, -9.81, -2e-15), 1),
        ((9.81, 0, 0), 0),
        ((0, 0, 9.81), 2),
        ((0, 0, -9.81), 2),
        ((1.0, 1.0, 0.0), 2),
    ],
)
def test_gravity_goes_downwards_where_it_is_along_an_axis(bend, gravity, up):
    view = content._upright(gravity, bend.last.along("bend", np.linspace(0, 1, 9))["position"])
    down = np.array(gravity if gravity != (1.0, 1.0, 0.0) else [0, 0, -1])
    assert view.right @ down == pytest.approx(0.0, abs=1e-12)
    assert view.up @ down < -0.5 * np.linalg.norm(down)
    assert abs(view.up[up]) > 0.5
    # Seen from above, not in a mirror.
    assert np.cross(view.right, view.up) @ down < 0.0
    assert np.linalg.norm(view.right) == pytest.approx(1.0)
    assert np.linalg.norm(view.up) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("out", "code", "sentence"),
    [
        ("page.txt", 2, "found the ending '.txt' of a page, accepted: .html, .htm"),
        (
            "nowhere/page.html",
            2,
            "cannot be written; accepted: a plain file in a folder that exists and can be written",
        ),
        ("page.html", 3, "no solution"),
    ],
)
def test_what_fails_leaves_what_was_there(tmp_path, capsys, out, code, sentence):
    """A wrong place is told before anything is solved."""
    scene, page = tmp_path / "scene.toml", tmp_path / out
    scene.write_text(TORN, encoding="utf-8")
    if page.parent.exists():
        page.write_text("before", encoding="utf-8")
    before = sorted(one.name for one in tmp_path.iterdir())
    assert main(["page", str(scene), str(page)]) == code
    said = capsys.readouterr().err
    assert sentence in said
    assert len(said.splitlines()) == 1, said
    assert sorted(one.name for one in tmp_path.iterdir()) == before
    assert not page.exists() or page.read_text(encoding="utf-8") == "before"


FAILS = """
[sections.s]
EI3 = 1.0
rhoA = 1.0
[histories.on]
t = [0.02, 0.03]
value = [0.0, 1.0]
[nodes.A]
position = [0, 0]
support = "clamped"
[nodes.B]
position = [1, 0]
[members.m]
nodes = ["A", "B"]
section = "s"
[loads.tip]
type = "force"
node = "B"
value = [0.0, 1e9]
history = "on"
[analysis]
type = "dynamic"
end = 0.1
step = 0.02
output = 0.02
"""
"""A motion whose load grows beyond what its steps can follow."""


def test_a_motion_that_fails_on_its_way_leaves_a_page_of_what_was_reached(tmp_path, capsys):
    scene, page = tmp_path / "scene.toml", tmp_path / "page.html"
    scene.write_text(FAILS, encoding="utf-8")
    assert main(["page", str(scene), str(page)]) == 3
    said = capsys.readouterr()
    assert "no solution" in said.err
    times = [state["at"] for state in held(page.read_text(encoding="utf-8"))["states"]]
    assert times[0] == 0.0
    assert 0.0 < times[-1] < 0.1
    assert f"up to {times[-1]:.9g} s" in said.out


def test_the_scene_itself_is_no_page(tmp_path, capsys):
    scene = tmp_path / "scene.html"
    scene.write_text(TORN, encoding="utf-8")
    assert main(["page", str(scene), str(scene)]) == 2
    assert scene.read_text(encoding="utf-8") == TORN


def test_pages_from_python(tmp_path, bend):
    assert bend.page(tmp_path / "bend.html") == tmp_path / "bend.html"
    assert held((tmp_path / "bend.html").read_text(encoding="utf-8"))["report"] == repr(bend)
    with pytest.raises(SceneError, match=r"found the ending '\.png' of a page, accepted: \.html"):
        bend.page(tmp_path / "bend.png")
    frame = bend.view()._repr_html_()
    assert frame.startswith('<iframe sandbox="allow-scripts"')
    assert "<script" not in frame
