"""Pictures of mode shapes: what is drawn is what the answer says, over the equilibrium, in every phase."""

import json

import numpy as np
import pytest
import scenes
from matplotlib.collections import LineCollection
from matplotlib.text import Text
from PIL import Image

from sfetcas import Scene, SceneError, solve
from sfetcas.cli import main
from sfetcas.pictures.animation import save_animation
from sfetcas.pictures.modeshapes import REACH, ModePanels, mode_picture, save_modes


def vibrating(count=4, **more):
    table = scenes.cantilever((0, 0), **more)
    table["sections"] = {name: {**section, "rhoA": 1.0} for name, section in table["sections"].items()}
    table["analysis"] = {"type": "modes", "modes": count}
    return {**table, "loads": more.get("loads", {})}


TWISTING = {
    "sections": {"s": {"EI2": 1e4, "EI3": 1e4, "GJ": 1.0, "rhoA": 1.0, "rhoI": [0.1, 0.05, 0.05]}},
    "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
    "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
    "dimension": "space",
    "analysis": {"type": "modes", "modes": 2},
}
"""A rod whose lowest modes twist it."""
FOLLOWED = {
    **vibrating(2, loads={"tip": {"type": "force", "node": "B", "value": [-25, 0], "frame": "follower"}}),
}
"""A cantilever that flutters: complex shapes."""


@pytest.fixture(scope="module")
def modes():
    return {
        "plane": solve(Scene.from_dict(vibrating())),
        "space": solve(Scene.from_dict({**vibrating(), "dimension": "space", "sections": SPATIAL})),
        "twist": solve(Scene.from_dict(TWISTING)),
        "flutter": solve(Scene.from_dict(FOLLOWED)),
    }


SPATIAL = {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0, "rhoI": [2e-3, 1e-3, 1e-3]}}


def named(figure, name, kind=LineCollection):
    return [artist for artist in figure.findobj(kind) if artist.get_gid() == name]


def texts(figure, name):
    return [text.get_text() for text in named(figure, name, Text)]


def test_each_panel_has_a_shape_its_frequency_and_what_holds_it(modes):
    found = modes["plane"]
    figure = mode_picture(found)
    assert texts(figure, "frequency") == [
        f"{i + 1}: {float(f'{mode.omega:.4g}'):g} rad/s, {float(f'{mode.omega / 2 / np.pi:.4g}'):g} Hz"
        for i, mode in enumerate(found.modes)
    ]
    assert len(named(figure, "shape")) == len(named(figure, "equilibrium")) == 4
    for number, (shape, later) in enumerate(zip(named(figure, "shape"), named(figure, "later"), strict=True)):
        (line,), (other,) = shape.get_segments(), later.get_segments()
        x = np.linspace(0, 1, len(line))
        moved = found.along(number, "m", x)["position"][:, :2]
        moved *= REACH * 1.0 / np.abs(moved).max()
        base = np.stack([x, 0 * x], axis=1)
        np.testing.assert_allclose(line, base + moved, atol=1e-9)
        np.testing.assert_allclose(other, base - moved, atol=1e-9)
    assert len(texts(mode_picture(found, count=2), "frequency")) == 2
    for count in (0, 5):
        with pytest.raises(SceneError, match="accepted: 1 to 4 modes"):
            mode_picture(found, count=count)


def test_shapes_along_members_are_those_of_the_answer(modes):
    for found in modes.values():
        for number, mode in enumerate(found.modes):
            entry = mode.members["m"]
            np.testing.assert_allclose(
                found.along(number, "m", entry["s"])["position"], entry["position"], atol=1e-9 * abs(entry["s"]).max()
            )
            end = found.along(number, "m", [1.0])
            np.testing.assert_allclose(end["rotation"][0], mode.nodes["B"]["rotation"], rtol=1e-6, atol=1e-6)
    with pytest.raises(SceneError, match="found mode 4, accepted: 0 to 3"):
        modes["plane"].along(4, "m", 0.0)
    with pytest.raises(SceneError, match="found member 'n'"):
        modes["plane"].along(0, "n", 0.0)


def test_a_shape_is_smooth_along_the_member(modes):
    (line,) = named(mode_picture(modes["plane"]), "shape")[3].get_segments()
    steps = np.diff(line, axis=0)
    turned = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert np.abs(turned).max() < 0.06


def test_complex_shapes_are_drawn_at_their_largest_phase(modes):
    found = modes["flutter"]
    assert found.modes[0].damping < 0.0
    panels = ModePanels(found, shown=False)
    sizes = []
    for phase in np.linspace(0, np.pi, 25):
        panels.show(phase)
        (line,) = named(panels.figure, "shape")[0].get_segments()
        sizes.append(float(((line - [[x, 0] for x in np.linspace(0, 1, len(line))]) ** 2).sum()))
    assert sizes[0] == pytest.approx(max(sizes))
    assert sizes[-1] == pytest.approx(sizes[0])
    assert min(sizes) > 1e-4 * sizes[0]
    assert "(grows)" in texts(panels.figure, "frequency")[0]


def test_what_only_twists_turns_bars(modes):
    figure = mode_picture(modes["twist"])
    shape = named(figure, "shape")[0].get_segments()
    line, *bars = shape
    np.testing.assert_allclose(line, named(figure, "equilibrium")[0].get_segments()[0], atol=1e-12)
    tilts = [np.ptp(bar, axis=0) for bar in bars]
    directions = [np.arctan2(*tilt) for tilt in tilts]
    assert len(bars) == 13
    assert abs(directions[-1] - directions[0]) > 0.3


@pytest.mark.parametrize("name", ["plane", "space", "twist", "flutter"])
def test_nothing_leaves_its_panel(modes, name):
    panels = ModePanels(modes[name], shown=False)
    panels.figure.draw_without_rendering()
    for phase in np.linspace(0, 2 * np.pi, 9):
        panels.show(phase)
        for lines in named(panels.figure, "shape"):
            (x0, x1), (y0, y1) = lines.axes.get_xlim(), lines.axes.get_ylim()
            for line in lines.get_segments():
                assert x0 < line[:, 0].min() <= line[:, 0].max() < x1
                assert y0 < line[:, 1].min() <= line[:, 1].max() < y1
    for panel in {lines.axes for lines in named(panels.figure, "shape")}:
        (x0, y0), (x1, y1) = panel.transData.transform([[0, 0], [1, 1]])
        assert x1 - x0 == pytest.approx(y1 - y0, rel=1e-6)
    boxes = [text.get_window_extent() for text in named(panels.figure, "frequency", Text)]
    assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]


def test_the_command_writes_and_moves_them(modes, tmp_path, capsys):
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(vibrating(2)))
    assert main(["run", str(file), "--plot", str(tmp_path / "a.png"), "--animate", str(tmp_path / "a.gif")]) == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 40
    capsys.readouterr()
    assert main(["run", str(file), "--plot", str(tmp_path / "a.png"), "--quantity", "modes.omega"]) == 2
    assert "--quantity: found without effect" in capsys.readouterr().err
    with pytest.raises(SceneError, match="accepted of modes: none"):
        save_animation(modes["plane"], tmp_path / "b.gif", colour="moment")
    with pytest.raises(SceneError, match=r"found the ending '\.bmp'"):
        save_modes(modes["plane"], tmp_path / "a.bmp")
