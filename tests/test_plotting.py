"""Pictures: what is drawn is where the answer says, has a name and a unit, and nothing is clipped."""

import itertools
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scenes
import systems
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text

from sfetcas import Scene, SceneError, Settings, load, solve
from sfetcas.pictures.files import ENDINGS
from sfetcas.pictures.plotting import picture, save_picture

TIGHT = Settings(accuracy=1e-6)


@pytest.fixture(scope="module")
def solved():
    """Answers of the zoo, solved once."""
    found = {}

    def of(name):
        if name not in found:
            found[name] = solve(scenes.made(scenes.ZOO[name]()), TIGHT)
        return found[name]

    return of


@pytest.fixture(autouse=True)
def _no_complaints(caplog):
    yield
    assert not [record for record in caplog.get_records("call") if record.name.startswith("matplotlib")]


def beam(value=(0.0, 1.0), **more):
    return solve(scenes.made(scenes.cantilever(value, **more)), TIGHT)


def named(figure, name, kind=Artist):
    return [artist for artist in figure.findobj(kind) if getattr(artist, "get_gid", lambda: None)() == name]


def segments(figure, name):
    (lines,) = named(figure, name)
    found = lines._segments3d if hasattr(lines, "_segments3d") else lines.get_segments()
    return [np.asarray(segment) for segment in found]


def texts(figure, name=None):
    return [text.get_text() for text in (named(figure, name, Text) if name else figure.findobj(Text))]


def arrow(figure, name):
    """Ends of the one arrow with this name, in the coordinates of its axes."""
    (found,) = arrows(figure, name)
    return found


def arrows(figure, name):
    return [patch._path_original.vertices for patch in named(figure, name, FancyArrowPatch)]


def bar(figure):
    (found,) = [axes for axes in figure.axes if "moment" in axes.get_ylabel()]
    return found


def labels_of_axes(figure):
    return {axes.get_xlabel() for axes in figure.axes}


# -- lines --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scenes.ZOO)
def test_lines_are_where_the_answer_says(solved, name):
    solution = solved(name)
    scene, step, figure = solution.scene, solution.last, picture(solution)
    axes = 3 if step.model.space else 2
    drawn, rest = segments(figure, "deformed"), segments(figure, "undeformed")
    starts = np.array([segment[0] for segment in drawn])
    ends = np.array([segment[1] for segment in drawn])
    assert len(rest) == len(scene.members)
    first = 0
    for member, line in zip(scene.members, rest, strict=True):
        x = np.linspace(0, 1, len(line))
        assert len(x) >= 101
        there = step.along(member, x)["position"][:, :axes]
        np.testing.assert_allclose(starts[first : first + len(x) - 1], there[:-1], atol=1e-12)
        np.testing.assert_allclose(ends[first : first + len(x) - 1], there[1:], atol=1e-12)
        np.testing.assert_allclose(line, scene.center_lines[member].positions(x)[:, :axes], atol=1e-12)
        first += len(x) - 1
    assert first == len(drawn)


def test_members_of_many_turns_are_drawn_smoothly():
    turns = beam((0, 0), loads={"roll": {"type": "moment", "node": "B", "value": 2 * np.pi * 20}})
    lines = np.array(segments(picture(turns), "deformed"))
    assert np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).max() * 2 * np.pi * 20 < 0.06


def test_earlier_steps_are_pale_and_only_the_chosen_ones_are_drawn():
    solution = beam(analysis={"steps": [0.5, 1, 2, 4]})
    figure = picture(solution)
    assert len(named(figure, "earlier")) == 3
    shades = [sum(lines.get_color()[0][:3]) for lines in named(figure, "earlier")]
    assert sorted(shades, reverse=True) == shades
    assert {"factor 0.5", "factor 1", "factor 2", "bold: factor 4"} <= set(texts(figure))
    some = picture(solution, steps=[0, 1])
    np.testing.assert_allclose(segments(some, "deformed")[-1][1], solution.steps[1].position("B")[:2], atol=1e-12)
    np.testing.assert_allclose(segments(some, "earlier")[0][-1], solution.steps[0].position("B")[:2], atol=1e-12)
    assert texts(some, "load-tip") == ["1 N"]


def test_many_steps_are_one_entry_of_the_legend():
    figure = picture(beam(analysis={"steps": np.linspace(0.02, 1, 50).tolist()}))
    assert 30 < len(named(figure, "earlier")) < 50
    assert [text for text in texts(figure) if "factor" in text] == ["39 other factors, 0.02 to 0.98", "bold: factor 1"]


@pytest.mark.parametrize("steps", [[], [1], [-2], [0, 3], 0, "last", [0.5]])
def test_steps_that_are_not_there_are_refused(steps):
    with pytest.raises(SceneError, match="accepted: a list of numbers of steps from 0 to 0"):
        picture(beam(), steps=steps)


# -- moments in colour ----------------------------------------------------------------------------


def test_colour_is_the_moment_about_z_with_its_sign():
    solution = beam((0.0, -3.0))
    (lines,) = named(figure := picture(solution), "deformed")
    moments = solution.last.along("m", np.linspace(0, 1, len(lines.get_array()) + 1))["moment"][:, 2]
    np.testing.assert_allclose(lines.get_array(), 0.5 * (moments[1:] + moments[:-1]), rtol=1e-6, atol=1e-9)
    assert moments.min() < -2
    assert bar(figure).get_ylabel() == "bending moment about z, N m"
    np.testing.assert_allclose(bar(figure).get_ylim(), [moments.min(), 0], rtol=0.01)
    assert lines.norm.vmin == -lines.norm.vmax
    figure.draw_without_rendering()
    assert len(np.unique(lines.get_edgecolor(), axis=0)) > 20


def test_colour_in_space_is_bending_without_twist():
    table = scenes.cantilever((0, 0))
    table["nodes"]["B"] = {"position": [1, 0, 0], "support": "slider", "direction": [1, 0, 0]}
    table |= {"dimension": "space", "loads": {}, "motions": {"twist": {"node": "B", "rotation": [0.3, 0, 0]}}}
    twisted = picture(solve(scenes.made(table), TIGHT))
    assert not [axes for axes in twisted.axes if "moment" in axes.get_ylabel()]
    table["motions"] = {"bend": {"node": "B", "rotation": [0.3, 0, 0.2]}}
    figure = picture(solution := solve(scenes.made(table), TIGHT))
    (lines,) = named(figure, "deformed")
    largest = abs(solution.last.along("m", [0.0])["moment"][0, 1:])
    assert bar(figure).get_ylabel() == "bending moment, N m"
    assert np.hypot(*largest) == pytest.approx(lines.get_array()[0], rel=0.05)
    assert lines.norm.vmin == 0


def test_size_of_the_moment_or_no_colour():
    solution = beam((0.0, -3.0))
    figure = picture(solution, colour="magnitude")
    assert named(figure, "deformed")[0].get_array().min() >= 0
    assert bar(figure).get_ylabel() == "size of bending moment, N m"
    assert len(picture(solution, colour="none").axes) == 1
    with pytest.raises(SceneError, match="accepted: curvature, magnitude, moment, none, shear, stress, tension, twist"):
        picture(solution, colour="red")


def test_no_bending_no_colour_bar():
    for value in ((2.0, 0.0), (0.0, 0.0)):
        figure = picture(beam(value))
        assert len(figure.axes) == 1
        assert len(named(figure, "deformed")) == 1


# -- loads, reactions, motions, supports ----------------------------------------------------------


def test_forces_and_reactions_are_arrows_with_their_amounts():
    solution = beam((3.0, 4.0), analysis={"steps": [1, 2]})
    figure = picture(solution)
    push = arrow(figure, "load-tip")
    np.testing.assert_allclose((push[1] - push[0]) / np.linalg.norm(push[1] - push[0]), [0.6, 0.8], atol=1e-9)
    assert np.linalg.norm(push - solution.last.position("B")[:2], axis=1).min() < 0.03
    assert texts(figure, "load-tip") == ["10 N"]
    (hold,) = [points for points in arrows(figure, "reaction-A") if len(points) == 2]
    np.testing.assert_allclose((hold[1] - hold[0]) / np.linalg.norm(hold[1] - hold[0]), [-0.6, -0.8], atol=1e-6)
    moment = abs(solution.last.reaction("A")[1][2])
    assert sorted(texts(figure, "reaction-A")) == sorted(["10 N", f"{moment:.3g} N m"])
    shaft = np.linalg.norm(push[1] - push[0])
    assert 0.08 < shaft < 0.2
    assert named(figure, "load-tip", FancyArrowPatch)[0].get_linewidth() > 1.4
    assert {"load", "reaction", "undeformed"} <= set(texts(figure))


def test_magnets_fields_and_natural_curvature_are_drawn():
    """Arrows of magnets turn with them, those of the field do not; curvature is drawn on the side it bends to."""
    tables = {
        "fields": {"up": {"value": [0, 0.5]}},
        "magnets": {"end": {"node": "B", "moment": [2.0, 0]}},
        "actuations": {"k": {"member": "m", "value": 0.8, "from": 0.2, "to": 0.6}},
    }
    solution = beam(loads={}, **tables)
    figure = picture(solution)
    (magnet,), (field,) = arrows(figure, "magnet-end"), arrows(figure, "field-up")
    angle = solution.last.angle("B")
    along = (magnet[1] - magnet[0]) / np.linalg.norm(magnet[1] - magnet[0])
    np.testing.assert_allclose(along, [np.cos(angle), np.sin(angle)], atol=1e-9)
    np.testing.assert_allclose(magnet.mean(axis=0), solution.last.position("B")[:2], atol=1e-9)
    assert abs(field[1] - field[0])[0] < 1e-9 < (field[1] - field[0])[1]
    assert texts(figure, "field-up") == ["0.5 T"]
    assert texts(figure, "actuation-k") == ["0.8 1/m"]
    (line,) = named(figure, "actuation-k", Line2D)
    places = solution.last.along("m", np.linspace(0.2, 0.6, 33))["position"][:, :2]
    # Bent to the left: above it.
    assert ((line.get_xydata() - places)[:, 1] > 0.0).all()
    assert {"magnetic field", "natural curvature"} <= set(texts(figure))


@pytest.mark.parametrize("sign", [1, -1])
def test_moments_turn_the_right_way(sign):
    solution = beam((0, 0), loads={"turn": {"type": "moment", "node": "B", "value": 0.7 * sign}})
    figure = picture(solution)
    points = arrow(figure, "load-turn") - solution.last.position("B")[:2]
    turned = points[:-1, 0] * points[1:, 1] - points[:-1, 1] * points[1:, 0]
    assert (np.sign(turned) == sign).all()
    assert texts(figure, "load-turn") == ["0.7 N m"]


def test_histories_decide_the_amounts():
    history = {"t": [0, 1], "value": [0, 5]}
    tip = {"type": "force", "node": "B", "value": [0, 1], "history": "up"}
    side = {"type": "force", "node": "B", "value": [1, 0], "history": "off"}
    off = {"t": [0, 1], "value": [1, 0]}
    figure = picture(beam(loads={"tip": tip, "side": side}, histories={"up": history, "off": off}))
    assert texts(figure, "load-tip") == ["5 N"]
    assert not named(figure, "load-side")


def test_every_load_support_motion_and_joint_is_drawn(solved):
    for name in scenes.ZOO:
        scene, figure = solved(name).scene, picture(solved(name))
        for load_name in scene.loads:
            assert named(figure, f"load-{load_name}", FancyArrowPatch), load_name
            assert texts(figure, f"load-{load_name}"), load_name
        for node, record in scene.nodes.items():
            assert bool(named(figure, f"support-{node}")) == (record.support != "free"), node
            assert bool(named(figure, f"reaction-{node}")) == (record.support != "free"), node
            assert bool(named(figure, f"joint-{node}", Line2D)) == (record.joint != "rigid"), node
        for member, record in scene.members.items():
            assert bool(named(figure, f"joint-{member}")) == (record.release != ("rigid", "rigid")), member
        for motion in scene.motions:
            assert named(figure, f"motion-{motion}", FancyArrowPatch), motion
        assert bool(named(figure, "gravity", FancyArrowPatch)) == (scene.gravity is not None)


def test_joints_are_white_circles_on_the_node(solved):
    solution = solved("four_bar")
    (dot,) = named(picture(solution), "joint-C")
    assert dot.get_marker() == "o"
    assert dot.get_markerfacecolor() == "white"
    np.testing.assert_allclose(np.ravel(dot.get_data()), solution.last.position("C")[:2])


def test_motions_go_from_the_old_to_the_new_place():
    table = scenes.cantilever((0, 0))
    table["nodes"]["B"]["support"] = "clamped"
    table |= {"loads": {}, "motions": {"lift": {"node": "B", "displacement": [-0.1, 0.2], "rotation": 0.5}}}
    figure = picture(solve(scenes.made(table), TIGHT))
    (straight,) = [points for points in arrows(figure, "motion-lift") if len(points) == 2]
    np.testing.assert_allclose(straight, [[1, 0], [0.9, 0.2]], atol=1e-9)
    assert sorted(texts(figure, "motion-lift")) == ["0.224 m", "0.5 rad"]


def test_a_moved_guide_is_told_as_given_not_as_its_node_goes():
    table = scenes.cantilever((0, 0))
    table["nodes"]["B"] |= {"support": "slider", "direction": [1, 0], "rotation": "hinge"}
    table |= {"loads": {}, "histories": {"half": {"t": [0, 1], "value": [0, 0.5]}}}
    table |= {"motions": {"drop": {"node": "B", "displacement": [0, -0.6], "history": "half"}}}
    solution = solve(scenes.made(table))
    assert np.linalg.norm(solution.last.position("B") - [1, 0, 0]) > 0.303
    figure = picture(solution)
    np.testing.assert_allclose(arrow(figure, "motion-drop"), [[1, 0], [1, -0.3]], atol=1e-12)
    assert texts(figure, "motion-drop") == ["0.3 m"]


def test_distributed_loads_follow_their_profile():
    spread = {"type": "distributed", "member": "m", "value": [0, -2], "profile": {"polynomial": [0, 1]}}
    figure = picture(beam(loads={"w": spread}))
    lengths = np.array([points[0][1] - points[1][1] for points in arrows(figure, "load-w")])
    assert len(lengths) >= 5
    assert (np.diff(lengths) > 0).all()
    assert texts(figure, "load-w") == ["2 N/m"]


def test_gravity_points_down_with_its_amount(solved):
    figure = picture(solved("arch"))
    start, end = arrow(figure, "gravity")
    assert end[1] < start[1]
    assert end[0] == pytest.approx(start[0])
    assert texts(figure, "gravity") == ["gravity 2 m/s²"]


# -- space ----------------------------------------------------------------------------------------


def test_marks_in_space_are_where_the_axes_put_the_points(solved):
    from mpl_toolkits.mplot3d import proj3d

    solution = solved("hinged_space")
    figure = picture(solution)
    (axes,) = [axes for axes in figure.axes if axes.name == "3d"]
    (dot,) = named(figure, "joint-B")
    x, y, _ = proj3d.proj_transform(*solution.last.position("B"), axes.get_proj())
    np.testing.assert_allclose(np.ravel(dot.get_data()), [x, y], atol=1e-12)
    figure.draw_without_rendering()
    assert dot.get_transform() == axes.transData
    ranges = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())])
    one, two, three = (
        np.linalg.norm(
            np.subtract(*axes.transData.transform(np.transpose(proj3d.proj_transform(*line, axes.get_proj())[:2])))
        )
        for line in (np.array([[0, 0, 0], e]).T for e in np.eye(3))
    )
    # Equal scales: the squares of the lengths of three projected unit vectors add up to twice the scale squared.
    scale = np.sqrt((one**2 + two**2 + three**2) / 2)
    assert ranges.min() > 0
    box = axes._box_aspect / np.linalg.norm(axes._box_aspect)
    np.testing.assert_allclose(box, ranges / np.linalg.norm(ranges), rtol=1e-9)
    assert 50 < scale * ranges.max() < 1050


def test_axes_of_the_plane_have_one_scale(solved):
    figure = picture(solved("plane_loads"))
    figure.draw_without_rendering()
    (x0, y0), (x1, y1) = figure.axes[0].transData.transform([[0, 0], [1, 1]])
    assert x1 - x0 == pytest.approx(y1 - y0, rel=1e-6)


# -- layout ---------------------------------------------------------------------------------------


def texts_drawn(monkeypatch):
    """A list of the texts that are drawn from now on: ticks have more, which stand anywhere."""
    found, draw = [], Text.draw

    def told(text, renderer):
        if text.get_text() and text.get_visible():
            found.append(text)
        draw(text, renderer)

    monkeypatch.setattr(Text, "draw", told)
    return found


@pytest.mark.parametrize("name", scenes.ZOO)
def test_nothing_is_clipped_and_labels_stand_apart(solved, name, monkeypatch):
    figure, drawn = picture(solved(name)), texts_drawn(monkeypatch)
    figure.draw_without_rendering()
    whole, drawn = figure.bbox, [text for text in drawn if text.axes is not bar(figure)]
    for artist in [*(t for t in drawn if t.get_gid()), *figure.findobj(FancyArrowPatch)]:
        box = artist.get_window_extent()
        assert box.x0 >= 0, artist
        assert box.y0 >= 0, artist
        assert box.x1 <= whole.x1, artist
        assert box.y1 <= whole.y1, artist
    boxes = [text.get_window_extent().padded(-2) for text in drawn]
    assert not [(a, b) for a, b in itertools.combinations(boxes, 2) if a.overlaps(b)]
    assert any(text.get_gid() for text in drawn)


@pytest.mark.parametrize("size", [1e-25, 1e-6, 0.05, 3e6, 1e20])
@pytest.mark.parametrize("name", ["plane_loads", "bend_45"])
def test_any_scale(tmp_path, name, size):
    table = scenes.transformed(scenes.ZOO[name](), length=size, force=size**0.5)
    figure = picture(solution := solve(scenes.made(table)))
    prefix = {1e-9: "n", 1e-6: "µ", 0.05: "m", 1.0: "", 4e3: "", 3e6: "M"}.get(size)
    if prefix is not None:
        assert f"x, {prefix}m" in labels_of_axes(figure)
    largest = max(np.abs(solution.last.along("m", [0.0, 0.601])["moment"]).max(axis=1))
    drawn, unit = named(figure, "deformed")[0].get_array(), bar(figure).get_ylabel().split(", ")[1]
    assert 0.1 <= np.abs(drawn).max() < 1e4
    if unit[0] in "mµnpfakMG":
        power = {"m": -3, "µ": -6, "n": -9, "p": -12, "f": -15, "a": -18, "k": 3, "M": 6, "G": 9}[unit[0]]
        assert np.abs(drawn).max() * 10.0**power == pytest.approx(largest, rel=0.25)
    figure.savefig(tmp_path / "a.png")
    for axes in figure.axes:
        ticks = [text.get_text() for text in axes.get_xticklabels()]
        assert all(len(tick) < 7 for tick in ticks)


@pytest.mark.parametrize("end", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-3, 0, 0], [1, 1, 1]])
@pytest.mark.parametrize("dimension", ["auto", "space"])
def test_straight_lines_have_room(end, dimension):
    table = scenes.cantilever((0, 0), dimension=dimension)
    table["nodes"]["B"]["position"] = end
    table["loads"]["tip"]["value"] = end
    figure = picture(solve(scenes.made(table)))
    figure.draw_without_rendering()
    (line,) = named(figure, "load-tip", FancyArrowPatch)
    assert line.get_window_extent().height + line.get_window_extent().width > 20


def test_far_from_the_origin():
    table = scenes.transformed(scenes.plane_loads(), shift=(1e7, -1e7, 0))
    figure = picture(solve(scenes.made(table)))
    figure.draw_without_rendering()
    (low, high), (below, above) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    # A member of length 1 begins there, and the limits are of its size.
    assert low < 1e7 < high < low + 10.0
    assert below < -1e7 < above < below + 10.0


@pytest.mark.parametrize(
    ("title", "shown"),
    [
        ("A $ sign, a_b^c and a \\ are no formula", "A $ sign, a_b^c and a \\ are no formula"),
        ("cost $x_{ and $", "cost $x_{ and $"),
        ("two\nlines\tand  blanks", "two lines and blanks"),
        ("\u6881 x\u7ed3", "\ufffd x\ufffd"),
        ("", None),
        ("   ", None),
    ],
)
def test_titles_of_any_text(tmp_path, title, shown):
    figure = picture(beam(title=title))
    assert figure.get_suptitle() == (shown or "")
    figure.savefig(tmp_path / "a.svg")


def test_long_titles_are_wrapped():
    middle = picture(beam(title="beam of a kind that needs saying " * 4)).get_suptitle()
    assert middle.count("\n") == 1
    assert max(map(len, middle.split("\n"))) <= 70
    longest = picture(beam(title="beam of a kind that needs saying " * 40)).get_suptitle()
    assert longest.count("\n") == 2
    assert longest.endswith("...")


def test_instability_is_said():
    solution = beam((-5.0, 0.0), analysis={"unstable": "stay"})
    assert solution.last.certificate.stable is False
    assert "factor 1, unstable" in texts(picture(solution))


# -- files ----------------------------------------------------------------------------------------

MAGIC = {
    ".pdf": b"%PDF",
    ".png": b"\x89PNG",
    ".svg": b"<?xml",
    ".jpg": b"\xff\xd8",
    ".jpeg": b"\xff\xd8",
    ".webp": b"RIFF",
}


@pytest.mark.parametrize("ending", [*ENDINGS, ".PNG"])
def test_files_are_of_the_kind_of_their_ending(tmp_path, ending):
    path = tmp_path / f"picture{ending}"
    save_picture(beam(), path)
    content = path.read_bytes()
    assert content.startswith(MAGIC[ending.lower()])
    assert len(content) > 5000


@pytest.mark.parametrize(("name", "found"), [("a.xyz", "'.xyz'"), ("a", "no ending"), ("a.toml", "'.toml'")])
def test_other_endings_are_refused_by_name(tmp_path, name, found):
    with pytest.raises(SceneError, match=rf"found .*{found.strip(chr(39))}.*accepted: \.pdf, \.png, \.svg"):
        save_picture(beam(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_threads_draw_the_same_as_one_alone(tmp_path, solved):
    names = ["plane_loads", "helix"]
    for name in names:
        save_picture(solved(name), tmp_path / f"{name}.png")
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda name: save_picture(solved(name), tmp_path / f"{name}_.png"), names))
    for name in names:
        assert (tmp_path / f"{name}.png").read_bytes() == (tmp_path / f"{name}_.png").read_bytes()


def test_no_window_is_ever_needed():
    code = "import sys, sfetcas.pictures.plotting; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_scene_files_draw(tmp_path):
    text = """
        [sections.s]
        EI3 = 1
        [nodes.A]
        position = [0, 0]
        support = "hinge"
        [nodes.B]
        position = [1, 0]
        support = "slider"
        direction = [1, 0]
        rotation = "hinge"
        [members.m]
        nodes = ["A", "B"]
        section = "s"
        release = ["hinge", "rigid"]
        [loads.down]
        type = "force"
        member = "m"
        at = 0.5
        value = [0, -1]
    """
    (tmp_path / "a.toml").write_text(text)
    figure = picture(solve(load(tmp_path / "a.toml")))
    assert texts(figure, "reaction-A") == ["0.5 N"]
    assert texts(figure, "reaction-B") == ["0.5 N"]


# -- springs --------------------------------------------------------------------------------------


def drawn(figure, name):
    """Points (n, 2) of the lines with this name, each an array without the gaps."""
    return [line.get_xydata()[np.isfinite(line.get_xydata()).all(axis=1)] for line in named(figure, name, Line2D)]


def test_translational_springs_reach_from_end_to_end():
    """A zigzag starts at the node and ends at the other node or where the ground holds it."""
    solution = solve(scenes.made(systems.linked()), TIGHT)
    figure, step = picture(solution), solution.last
    (rope,) = drawn(figure, "spring-rope")
    np.testing.assert_allclose(rope[[0, -1]], [step.position(n)[:2] for n in ("C", "A")], atol=1e-12)
    pull, *ground = drawn(figure, "spring-pull")
    np.testing.assert_allclose(pull[[0, -1]], [step.position("E")[:2], [2.0, 1.0]], atol=1e-12)
    assert len(ground) == 2
    push, *ground = drawn(figure, "spring-push")
    along = (push[-1] - push[0]) / np.linalg.norm(push[-1] - push[0])
    assert abs(along @ [1.0, 0.5]) == pytest.approx(np.hypot(1.0, 0.5), abs=1e-12)
    assert len(ground) == 2
    for line in (rope, pull, push):
        x, y = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
        beside = (line - line[0]) @ [-y, x]
        assert (np.diff(np.sign(beside[np.abs(beside) > 1e-9])) != 0).sum() >= 4


@pytest.mark.parametrize("name", ["linked", "linked_space"])
def test_rotational_springs_are_spirals_round_their_nodes(name):
    """Round the node and, in space, across the axis that the first party carries."""
    solution = solve(scenes.made(systems.SYSTEMS[name]()), TIGHT)
    figure = picture(solution)
    for spring, record in solution.scene.springs.items():
        lines = drawn(figure, f"spring-{spring}")
        if record.type == "translational":
            assert lines
        elif name == "linked":
            (spiral,) = lines
            radius = np.linalg.norm(spiral - solution.last.position(record.node)[:2], axis=1)
            assert (np.diff(radius) > 0.0).all()
            assert 0.02 < radius[-1] < 0.1
        else:
            (spiral,) = lines
            assert len(spiral) > 100


def test_a_spring_without_visible_length_hangs_on_the_ground():
    spring = {"type": "translational", "node": "B", "stiffness": 1e6, "length": 0.0}
    figure = picture(beam((0.0, 1e-3), springs={"stay": spring}))
    line, *ground = drawn(figure, "spring-stay")
    assert np.linalg.norm(line[-1] - line[0]) > 0.05
    assert len(ground) == 2


def test_a_node_without_members_that_carries_an_obstacle_is_drawn():
    """With what acts on it: a force and a moment of its support, a load, a motion."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "plate": {"position": [0.5, 0.2], "support": "clamped"},
        },
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "contacts": {"c": {"type": "plane", "point": [0, 0.2], "normal": [0, -1], "members": "all", "node": "plate"}},
        "motions": {"turn": {"node": "plate", "rotation": 0.1}},
        "loads": {
            "lift": {"type": "force", "node": "B", "value": [0, 2]},
            "press": {"type": "force", "node": "plate", "value": [0, 1]},
        },
    }
    figure = solve(Scene.from_dict(table)).plot()
    drawn = {artist.get_gid() for artist in figure.findobj() if artist.get_gid()}
    assert {"reaction-plate", "load-press"} <= {name.removesuffix("-label") for name in drawn}
