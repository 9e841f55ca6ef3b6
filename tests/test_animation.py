"""Animations and files for ParaView: frames and points where the answer says, and every refusal."""

import base64
import builtins
import json
import re
import sys
import xml.etree.ElementTree as ElementTree

import matplotlib
import numpy as np
import pytest
import scenes
from matplotlib.animation import FFMpegWriter
from matplotlib.figure import Figure
from moving import FALLING, SPACE, STRUCK
from PIL import Image

from sfetcas import Scene, SceneError, Settings, solve
from sfetcas.cli import main
from sfetcas.pictures.animation import _Film, _paced, animation, save_animation
from sfetcas.pictures.files import ENDINGS as PICTURES
from sfetcas.pictures.files import save_figure
from sfetcas.pictures.paraview import save_vtk

ENDED = {**FALLING, "analysis": {**FALLING["analysis"], "output": 0.1}}
"""Four answers."""
STEPS = scenes.cantilever(analysis={"steps": [0.5, 1.0, 2.0]})
PATH = scenes.cantilever(analysis={"type": "path", "range": [0, 1.0], "points": 5})
BRANCHED = {"type": "path", "range": [0, 4.0], "branches": 1, "accuracy": 1e-3}


@pytest.fixture
def write(tmp_path):
    def written(table):
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(table))
        return path

    return written


def made(table):
    return solve(Scene.from_dict(table), Settings(accuracy=1e-4))


# -- animations -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("table", "frames"), [(ENDED, 101), (STEPS, 3), (PATH, 5)], ids=["motion", "steps", "path"])
def test_a_frame_for_each_step_and_many_of_a_motion(write, tmp_path, table, frames):
    out = tmp_path / "out.gif"
    assert main(["run", str(write(table)), "--animate", str(out)]) == 0
    with Image.open(out) as image:
        assert image.n_frames == frames
        assert image.size == (700, 500)
        shots = []
        for number in range(0, frames, 1 + frames // 10):
            image.seek(number)
            shots.append(np.asarray(image.convert("L"), float))
    assert all(np.abs(a - b).max() > 100 for a, b in zip(shots, shots[1:]))


@pytest.mark.parametrize("table", [ENDED, {**SPACE, "analysis": {**SPACE["analysis"], "end": 0.1}}])
def test_a_frame_shows_its_answer_and_supports_keep_their_sides(table):
    motion = made(table)
    film = _Film(motion.steps, ["now"] * len(motion.steps), 10, "", gravity=1.0)
    axes, seen = (3 if motion.last.model.space else 2), []
    for number, step in enumerate(motion.steps):
        film.show(number)
        lines = [line for line in film.figure.findobj() if getattr(line, "get_gid", lambda: None)() == "deformed"]
        for line, member in zip(lines, motion.scene.members.values(), strict=True):
            drawn = np.stack(line.get_data_3d() if axes == 3 else line.get_data(), axis=1)
            np.testing.assert_allclose(drawn[-1], step.position(member.nodes[1])[:axes], atol=1e-12)
        seen.append([mark.points for mark in film._marks(number) if mark.name == "support-A"])
    for marks in seen:
        np.testing.assert_array_equal(np.vstack(marks), np.vstack(seen[0]))
    assert len(film._sheet.drawn) == len(film._marks(0))  # those of earlier frames are gone


def test_an_obstacle_on_a_node_moves_with_it():
    table = {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "ram": {"position": [0.8, 0.2], "support": "clamped"},
        },
        "members": {"strip": {"nodes": ["A", "B"], "section": "strip"}},
        "motions": {"down": {"node": "ram", "displacement": [0, -0.3]}},
        "contacts": {
            "roll": {"type": "circle", "center": [0.8, 0.2], "radius": 0.05, "node": "ram", "member": "strip"},
            "floor": {"type": "circle", "center": [0.5, -0.3], "radius": 0.1, "member": "strip"},
        },
        "analysis": {"steps": [0.0, 0.5, 1.0]},
    }
    steps = solve(Scene.from_dict(table)).steps
    film = _Film(steps, ["now"] * 3, 10, "", gravity=0.0)
    middles = [
        {
            name: np.mean([np.nanmean(mark.points, axis=0) for mark in film._marks(i) if mark.name == name], axis=0)
            for name in ("contact-roll", "contact-floor")
        }
        for i in range(3)
    ]
    # Circles are drawn as polygons, which begin anywhere.
    down = [one["contact-roll"] - middles[0]["contact-roll"] for one in middles]
    np.testing.assert_allclose(down, [[0, 0, 0], [0, -0.15, 0], [0, -0.3, 0]], atol=1e-3)
    assert middles[2]["contact-floor"] == pytest.approx(middles[0]["contact-floor"])


@pytest.mark.parametrize(
    ("span", "count", "rate", "said"),
    [
        (4.0, 101, 25, ""),
        (1.0, 26, 25, ""),
        (16.0, 200, 12, ""),
        (0.02, 101, 25, " (slowed 200 times)"),
        (100.0, 200, 10, " (sped up 5 times)"),
        (0.0, 1, 25, ""),
    ],
)
def test_pace(span, count, rate, said):
    assert _paced(span) == (count, rate, said)


REFUSED = {
    "ending": (FALLING, "out.avi", "found the ending '.avi' of an animation, accepted: .gif, .mp4"),
    "one step": (scenes.cantilever(), "out.gif", "found one step to animate, accepted: a motion, modes, a path"),
    "all": (scenes.cantilever(analysis={"equilibria": "all", "steps": [1, 2]}), "out.gif", "found equilibria = 'all'"),
}


@pytest.mark.parametrize(("table", "name", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_animated_is_refused_before_it_is_solved(
    write, tmp_path, capsys, monkeypatch, table, name, sentence
):
    monkeypatch.setattr("sfetcas.cli.solve", lambda *_, **__: pytest.fail("solved"))
    assert main(["run", str(write(table)), "--animate", str(tmp_path / name)]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1
    assert not (tmp_path / name).exists()


def test_films_need_their_program(tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(SceneError, match=r"found the ending '\.mp4', but no program ffmpeg"):
        save_animation(made(ENDED), tmp_path / "out.mp4")


def test_what_ffmpeg_says_where_it_fails_is_told(tmp_path, monkeypatch, caplog):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\ncat > /dev/null\necho No space left >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setitem(matplotlib.rcParams, "animation.ffmpeg_path", str(program))
    with pytest.raises(SceneError, match=r"^the program ffmpeg failed: No space left$"):
        save_animation(made(STEPS), tmp_path / "out.mp4")
    assert caplog.text == ""


@pytest.mark.parametrize("ending", [*PICTURES, ".gif"])
def test_where_a_disk_is_full_it_is_said(tmp_path, ending):
    resource = pytest.importorskip("resource")
    path, limits = tmp_path / f"a{ending}", resource.getrlimit(resource.RLIMIT_FSIZE)
    answer = made(STEPS) if ending == ".gif" else None
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            save_animation(answer, path) if answer else save_figure(Figure(facecolor="red"), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_what_a_failed_motion_reached_is_animated(write, tmp_path):
    out = tmp_path / "out.gif"
    struck = {**STRUCK, "analysis": {**STRUCK["analysis"], "output": 0.05}}
    assert main(["run", str(write(struck)), "--animate", str(out)]) == 3
    with Image.open(out) as image:
        assert image.n_frames == 101


def test_colours_move_with_one_scale(tmp_path):
    solution = made(STEPS)
    steps, names = solution.steps, [f"{step.factor}" for step in solution.steps]
    film = _Film(steps, names, 10, "", gravity=0.0, colour="moment")
    for number, step in enumerate(steps):
        film.show(number)
        (pieces,) = [one for one in film.figure.findobj() if getattr(one, "get_gid", lambda: None)() == "deformed"]
        moments = step.along("m", np.linspace(0, 1, 1 + len(pieces.get_array())))["moment"][:, 2]
        np.testing.assert_allclose(pieces.get_array(), 0.5 * (moments[1:] + moments[:-1]), rtol=1e-6, atol=1e-9)
        assert pieces.norm.vmax == pytest.approx(steps[-1].along("m", [0.0])["moment"][0, 2], rel=0.02)


def test_branches_move_after_their_path():
    scene = Scene.from_dict(scenes.cantilever((-1.0, 0.0), analysis=BRANCHED))
    path = solve(scene)
    assert len(path.branches) == 3
    film = animation(path)._film
    assert film.count == sum(len(branch.points) for branch in path.branches)
    count = len(path.points)
    for number, text in (
        (0, "factor"),
        (count - 1, "factor"),
        (count, "branch 1, factor"),
        (film.count - 1, "branch 2"),
    ):
        film.show(number)
        assert film.figure.axes[0].get_title(loc="left").startswith(text)
    (line,) = [one for one in film.figure.findobj() if getattr(one, "get_gid", lambda: None)() == "deformed"]
    assert line.get_xydata()[-1] == pytest.approx(path.positions("B", 2)[-1][:2], abs=1e-9)


def test_an_animation_shows_itself_in_a_notebook_and_writes_a_file(tmp_path):
    solution = made(STEPS)
    shown = solution.animate()._repr_html_()
    head, _, content = shown.partition("base64,")
    assert head == '<img alt="animation" src="data:image/gif;'
    assert base64.b64decode(content.removesuffix('">')).startswith(b"GIF89a")
    file = solution.animate(tmp_path / "out.gif", colour="moment")
    assert file == tmp_path / "out.gif"
    assert file.read_bytes().startswith(b"GIF89a")
    with pytest.raises(SceneError, match="found one step to animate"):
        made(scenes.cantilever()).animate()
    with pytest.raises(SceneError, match="colour: found 'red'"):
        solution.animate(colour="red")
    missing = tmp_path / "missing" / "out.gif"
    with pytest.raises(SceneError, match=r"out.gif: found no folder .*missing, accepted: a file in a folder that exi"):
        solution.animate(missing)
    with pytest.raises(SceneError, match="found no folder"):
        solution.animate().save(missing)
    with pytest.raises(SceneError, match="found no folder"):
        save_figure(Figure(), missing.with_suffix(".png"))


# -- files for ParaView ------------------------------------------------------------------------------


def read(path):
    """Arrays of a .vtu by name: read here by the definition of the format, lengths as 8 bytes before each array."""
    head, _, raw = path.read_bytes().partition(b'<AppendedData encoding="raw">')
    raw = raw[raw.index(b"_") + 1 :]
    tree = ElementTree.fromstring(re.sub(rb"\s*$", b"", head) + b"</VTKFile>")
    kinds = {"Float64": "f8", "Int32": "i4", "UInt8": "u1", "Int64": "i8"}
    found = {}
    for entry in tree.iter("DataArray"):
        at = int(entry.get("offset"))
        length = int(np.frombuffer(raw[at : at + 8], "u8")[0])
        values = np.frombuffer(raw[at + 8 : at + 8 + length], kinds[entry.get("type")])
        columns = int(entry.get("NumberOfComponents"))
        found[entry.get("Name")] = values.reshape(-1, columns) if columns > 1 else values
    return tree, found


def collected(folder):
    entries = list(ElementTree.parse(folder / "answers.pvd").iter("DataSet"))
    return [float(entry.get("timestep")) for entry in entries], [folder / entry.get("file") for entry in entries]


@pytest.mark.parametrize("table", [ENDED, {**SPACE, "analysis": {**SPACE["analysis"], "end": 0.1}}, STEPS, PATH])
def test_files_hold_the_answers(tmp_path, table):
    answer = made(table)
    save_vtk(answer, tmp_path)
    times, files = collected(tmp_path)
    moving = "velocities" in dir(answer)
    steps = [answer.configuration(p) for p in answer.points] if "points" in dir(answer) else answer.steps
    np.testing.assert_allclose(times, answer.times if moving else np.arange(len(steps)))
    for step, file in zip(steps, files, strict=True):
        tree, found = read(file)
        (piece,) = tree.iter("Piece")
        members = answer.scene.members
        assert (int(piece.get("NumberOfCells")), len(found["points"])) == (
            len(members),
            int(piece.get("NumberOfPoints")),
        )
        assert found["types"].tolist() == [4] * len(members)  # polylines
        assert found["member"].tolist() == list(range(len(members)))
        np.testing.assert_array_equal(found["connectivity"], np.arange(len(found["points"])))
        begin = 0
        for end, (name, member) in zip(found["offsets"], members.items(), strict=True):
            along = step.along(name, found["s"][begin:end])
            np.testing.assert_allclose(found["points"][begin:end], along["position"], atol=1e-14)
            for key in ("quaternion", "force", "moment", "curvature"):
                np.testing.assert_allclose(found[key][begin:end], along[key], atol=1e-14)
            if moving:
                for place, node in zip((begin, end - 1), member.nodes, strict=True):
                    np.testing.assert_allclose(found["velocity"][place], step.velocity(node), atol=1e-14)
            begin = end
        if not moving:
            assert found["factor"] == [step.factor]


def test_the_folder_is_filled_at_once_and_replaced_only_where_it_is_ours(write, tmp_path, capsys):
    path, out = write(ENDED), tmp_path / "out"
    assert main(["run", str(path), "--vtk", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == [f"answer_{i:04d}.vtu" for i in range(4)] + ["answers.pvd"]
    # Fewer answers replace all of the earlier ones.
    path = write({**ENDED, "analysis": {**ENDED["analysis"], "output": 0.3}})
    assert main(["run", str(path), "--vtk", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["answer_0000.vtu", "answer_0001.vtu", "answers.pvd"]
    (out / "notes.txt").write_text("mine")
    for folder in (out, path, tmp_path / "no" / "out"):
        assert main(["run", str(path), "--vtk", str(folder)]) == 2
    told = capsys.readouterr().err
    assert told.count("accepted: a new folder, or one that is empty or has nothing but files of an earlier run") == 3
    assert len(list(out.iterdir())) == 4
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "scene.json"]


def test_without_the_library_the_extra_is_named(write, tmp_path, capsys, monkeypatch):
    monkeypatch.delitem(sys.modules, "sfetcas.pictures.paraview")
    original = builtins.__import__

    def missing(name, *more, **others):
        if name.startswith("pyevtk"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return original(name, *more, **others)

    monkeypatch.setattr(builtins, "__import__", missing)
    assert main(["run", str(write(ENDED)), "--vtk", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "found no library pyevtk" in told
    assert "pip install 'sfetcas[vtk]'" in told
    assert not (tmp_path / "out").exists()
