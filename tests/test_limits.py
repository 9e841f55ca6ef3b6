"""Pictures of what limits motion, and of several equilibria: drawn where they are, told apart, and told of."""

import itertools

import numpy as np
import pytest
import scenes
from matplotlib.collections import Collection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.text import Text
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.special import ellipk

from sfetcas import Scene, load, solve
from sfetcas.description.contacts import Contact
from sfetcas.description.obstacles import obstacle
from sfetcas.mathematics import quaternion
from sfetcas.pictures.charts import chart
from sfetcas.pictures.glyphs import sketch_all
from sfetcas.pictures.modeshapes import REACH
from sfetcas.pictures.plotting import picture
from sfetcas.pictures.sketch import Sketch, course_of, view_of

ALL = "problems/cantilever_inclined_force_all_equilibria.toml"


def hung(contact, dimension="plane"):
    """A cantilever that a tip force presses onto an obstacle."""
    loads = {"tip": {"type": "force", "node": "B", "value": [0, -0.2]}}
    table = scenes.cantilever((0, 0), dimension=dimension, loads=loads, contacts={"stop": contact})
    table["sections"] = {name: {"EI2": 0.1, "EI3": 0.1, "GJ": 0.1} for name in table["sections"]}
    return solve(scenes.made(table))


def sketched(solution):
    """What a picture of the last step shows, before it is drawn."""
    course = course_of(solution.scene, solution.steps)
    sketch = Sketch(solution.scene, solution.last, course, view_of(solution.last.model.space, course.last))
    sketch_all(sketch)
    return sketch


def named(figure, name, kind):
    return [artist for artist in figure.findobj(kind) if artist.get_gid() == name]


def legend(figure):
    (found,) = figure.legends
    return [text.get_text() for text in found.get_texts()]


ROUND = {"center": [0.5, -0.45, 0], "radius": 0.4, "members": "all"}
BELOW = {
    "plane": {"type": "plane", "point": [0, -0.05, 0], "normal": [0, 1, 0], "members": "all"},
    "circle": {"type": "circle", **ROUND},
    "large circle": {"type": "circle", "center": [0.5, -50.05], "radius": 50.0, "members": "all"},
    "cylinder": {"type": "cylinder", **ROUND},
    "large cylinder": {"type": "cylinder", "center": [0.5, -50.05], "radius": 50.0, "members": "all"},
    "sphere": {"type": "sphere", **ROUND},
    "large sphere": {"type": "sphere", "center": [0.5, -50.05, 0], "radius": 50.0, "members": "all"},
    "line": {"type": "line", "point": [0.6, -0.05, 0], "direction": [0, 0, 1], "side": [0, 1, 0], "members": "all"},
}


@pytest.mark.parametrize("name", ["plane", "circle", "large circle"])
def test_obstacles_in_the_plane_have_strokes_in_the_solid(name):
    solution = hung(BELOW[name])
    stop = obstacle(Contact(**BELOW[name]), False)
    figure = picture(solution)
    lines = named(figure, "contact-stop", Line2D)
    outline, strokes = (np.pad(line.get_xydata(), ((0, 0), (0, 1))) for line in lines)
    np.testing.assert_allclose(stop.gaps(outline, outline), 0.0, atol=1e-12 * stop.radius + 1e-12)
    near = np.linalg.norm(outline - [0.5, 0, 0], axis=1)
    assert near.max() < 1.2
    assert np.ptp(outline[:, 0]) > 0.7
    feet, heads = strokes[0::3], strokes[1::3]
    # Feet stand on chords of the outline, which are less than a hundredth of it.
    assert len(feet) >= 10
    np.testing.assert_allclose(stop.gaps(feet, feet), 0.0, atol=1e-3)
    assert (stop.gaps(heads, heads) < -5e-3).all()
    assert "obstacle" in legend(figure)


def test_obstacles_from_inside_have_strokes_outside():
    inside = {"type": "circle", "center": [0.5, 0.2], "radius": 0.6, "side": "inside", "members": "all"}
    _, strokes = named(picture(hung(inside)), "contact-stop", Line2D)
    apart = np.linalg.norm(strokes.get_xydata() - [0.5, 0.2], axis=1)
    assert (apart[1::3] > 0.605).all()


def test_points_are_wedges_with_their_tip_on_the_member():
    point = {"type": "point", "position": [0.6, -0.05], "side": [0, 1], "members": "all"}
    (wedge,) = named(picture(hung(point)), "contact-stop", Polygon)
    corners = wedge.get_xy()
    np.testing.assert_allclose(corners[0], [0.6, -0.05])
    assert (corners[1:3, 1] < -0.06).all()


@pytest.mark.parametrize("name", ["cylinder", "large cylinder", "sphere", "large sphere"])
def test_round_obstacles_in_space_are_wires_on_them_near_the_structure(name):
    figure = picture(hung(BELOW[name], "space"))
    stop = obstacle(Contact(**BELOW[name]), True)
    (wires,) = named(figure, "contact-stop", Line2D)
    points = np.array(wires.get_data_3d()).T
    gaps = np.isnan(points[:, 0])
    points = points[~gaps]
    assert gaps.sum() >= 10
    np.testing.assert_allclose(stop.gaps(points, points), 0.0, atol=1e-12 * stop.radius)
    assert np.linalg.norm(points - [0.5, 0, 0], axis=1).max() < 1.3
    assert np.ptp(points[:, 0]) > 0.7
    assert "obstacle" in legend(figure)


def test_planes_in_space_are_translucent_below_the_whole_structure():
    solution = hung(BELOW["plane"], "space")
    figure = picture(solution)
    (pane,) = named(figure, "contact-stop", Poly3DCollection)
    corners = np.asarray(pane._faces[0])
    np.testing.assert_allclose(corners[:, 1], -0.05, atol=1e-12)
    line = solution.last.along("m", np.linspace(0, 1, 9))["position"]
    assert (corners.min(axis=0)[[0, 2]] < line.min(axis=0)[[0, 2]]).all()
    assert (corners.max(axis=0)[[0, 2]] > line.max(axis=0)[[0, 2]]).all()
    assert pane.get_facecolor()[0, 3] < 0.5
    (lines,) = named(figure, "deformed", Collection)
    assert pane.get_zorder() < lines.get_zorder()


def test_lines_in_space_are_drawn_along_themselves():
    line, _ = named(picture(hung(BELOW["line"], "space")), "contact-stop", Line2D)
    points = np.array(line.get_data_3d()).T
    np.testing.assert_allclose(points[:, :2], [[0.6, -0.05]] * 2)
    assert np.ptp(points[:, 2]) > 0.5


def test_obstacles_far_away_are_not_drawn():
    far = {"type": "plane", "point": [0, -30, 0], "normal": [0, 1, 0], "members": "all"}
    for dimension in ("plane", "space"):
        figure = picture(hung(far, dimension))
        assert not [artist for artist in figure.findobj() if artist.get_gid() == "contact-stop"]
        assert "obstacle" not in legend(figure)


# -- stops and slots ------------------------------------------------------------------------------


@pytest.mark.parametrize("between", [None, ["ground", "m"], ["m", "ground"]])
def test_stops_of_angles_are_bars_at_the_limits(between):
    """Seen from the node they stand at the limits of the angle of the member, strokes beyond."""
    table = scenes.cantilever((0.0, 0.5))
    table["nodes"]["A"]["support"] = "hinge"
    low, high = (-0.7, 0.2) if between == ["m", "ground"] else (-0.2, 0.7)
    table["springs"] = {"k": {"node": "A", "stiffness": 3.0, "stop": [low, high]}}
    table["springs"]["k"] |= {} if between is None else {"between": between}
    lines = named(picture(solve(scenes.made(table))), "stop-k", Line2D)
    bars, strokes = lines[0::2], lines[1::2]
    for bar, hatch, limit, sign in zip(bars, strokes, (-0.2, 0.7), (-1, 1), strict=True):
        angles = np.arctan2(*bar.get_xydata().T[::-1])
        np.testing.assert_allclose(angles, limit, atol=1e-12)
        heads = hatch.get_xydata()[1::3]
        assert (sign * (np.arctan2(heads[:, 1], heads[:, 0]) - limit) > 0).all()


def test_stops_of_travels_are_bars_across_the_direction():
    table = scenes.cantilever((0.0, 0.5))
    stop = {"type": "translational", "node": "B", "stiffness": 1.0, "direction": [0, 1], "stop": [-0.3, 0.1]}
    table["springs"] = {"k": stop}
    solution = solve(scenes.made(table))
    low, _, high, _ = named(picture(solution), "stop-k", Line2D)
    x = solution.last.position("B")[0]
    for bar, limit in ((low, -0.3), (high, 0.1)):
        points = bar.get_xydata()
        np.testing.assert_allclose(points[:, 1], limit, atol=1e-12)
        np.testing.assert_allclose(points[:, 0].mean(), x, atol=1e-12)


def slotted(release):
    stiff = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}
    return {
        "sections": {"s": stiff},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "P": {"position": [1, 0], "direction": [1, 2]},
            "O": {"position": [0, -2], "support": "hinge"},
        },
        "members": {
            "lever": {"nodes": ["O", "P"], "type": "rigid"},
            "crank": {"nodes": ["A", "P"], "section": "s", "type": "flexible", "release": ["rigid", release]},
        },
        "springs": {"k": {"node": "O", "stiffness": 0.5}},
        "motions": {"drive": {"node": "A", "rotation": 0.3}},
    }


@pytest.mark.parametrize("release", ["slot", "slider"])
def test_slots_lie_along_the_turned_direction_with_their_pin_inside(release):
    solution = solve(scenes.made(slotted(release)))
    figure, step = picture(solution), solution.last
    slot = named(figure, "joint-crank", Line2D)[0].get_xydata()
    end, node = step.along("crank", [1.0])["position"][0, :2], step.position("P")[:2]
    assert np.linalg.norm(end - node) > 0.05
    along = (end - node) / np.linalg.norm(end - node)
    travels, beside = (slot - node) @ along, (slot - node) @ [-along[1], along[0]]
    assert travels.min() < 0.0 < np.linalg.norm(end - node) < travels.max()
    assert beside.max() == pytest.approx(-beside.min(), rel=1e-6)
    assert beside.max() < 0.1 * np.ptp(travels)
    (block,) = named(figure, "joint-crank", Polygon) if release == "slider" else [None]
    if block is not None:
        np.testing.assert_allclose(block.get_xy()[:4].mean(axis=0), end, atol=1e-9)
    # The direction is that of the slot: the ground holds nothing at P.
    assert not named(figure, "support-P", Line2D)


def test_universal_supports_are_drawn():
    table = scenes.cantilever((0.0, 1.0), dimension="space")
    table["nodes"]["A"] |= {"support": "universal", "axis": [0, 0, 1], "axis2": [0, 1, 0]}
    table["springs"] = {
        name: {"node": "A", "axis": axis, "stiffness": 5.0} for name, axis in (("z", [0, 0, 1]), ("y", [0, 1, 0]))
    }
    assert len(named(picture(solve(scenes.made(table))), "support-A", Line2D)) >= 4


# -- several equilibria ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seven():
    return solve(load(ALL))


def test_each_equilibrium_has_its_colour_its_number_and_its_entry(seven):
    figure = picture(seven)
    states = ["stable" if step.certificate.stable is True else "unstable" for step in seven.steps]
    assert {"stable", "unstable"} == set(states)
    expected = [f"{i}: {state}" for i, state in enumerate(states, 1)]
    expected[0] = "1 (bold): stable"
    assert set(expected) <= set(legend(figure))
    others = named(figure, "earlier", Collection)
    assert len({tuple(lines.get_color()[0]) for lines in others}) == len(seven.steps) - 1
    dashed = [lines.get_linestyle()[0][1] is not None for lines in others]
    assert dashed == [state == "unstable" for state in states[1:]]
    for number, step in enumerate(seven.steps[1:], 2):
        (label,) = [text for text in figure.axes[0].texts if text.get_gid() == f"equilibrium-{number}"]
        assert label.get_text() == str(number)
        np.testing.assert_allclose(others[number - 2].get_segments()[0][-1], step.position("tip")[:2], atol=1e-9)


def test_the_default_equilibrium_is_bold_with_its_reactions(seven):
    figure = picture(seven)
    (bold,) = named(figure, "deformed", Collection)
    np.testing.assert_allclose(bold.get_segments()[-1][1], seven.steps[0].position("tip")[:2], atol=1e-9)
    second = picture(seven, steps=[0, 1])
    (bold,) = named(second, "deformed", Collection)
    np.testing.assert_allclose(bold.get_segments()[-1][1], seven.steps[1].position("tip")[:2], atol=1e-9)
    assert "2 (bold): stable" in legend(second)


def test_many_equilibria_have_their_numbers_and_one_entry_a_kind(seven):
    """As many lines as a rich scene has, here the same ones again."""
    figure = picture(seven, steps=[*range(7), *range(7), 0])
    entries = [text for text in legend(figure) if "stable" in text]
    assert entries == ["others, stable", "others, unstable", "1 (bold): stable"]
    assert {text.get_text() for text in figure.axes[0].texts} >= {"2", "7"}


def test_undeformed_lines_do_not_look_like_unstable_ones(seven):
    figure = picture(seven)

    def longest_dash(lines):
        dashes = lines.get_linestyle()[0][1]
        return np.inf if dashes is None else max(dashes[0::2]) / lines.get_linewidth()[0]

    (rest,) = named(figure, "undeformed", Collection)
    others = named(figure, "earlier", Collection)
    assert len(others) == 6
    assert all(longest_dash(lines) > 3.0 * longest_dash(rest) for lines in others)


def test_many_steps_have_one_entry_for_each_stability():
    """A strut beyond its Euler load, told to stay straight."""
    analysis = {"unstable": "stay", "steps": [1, 1.5, 2, 2.2, 3, 3.5, 4, 5]}
    loads = {"f": {"type": "force", "node": "B", "value": [-1, 0]}}
    figure = picture(solve(scenes.made(scenes.cantilever((0, 0), loads=loads, analysis=analysis))))
    # Euler: pi^2/4 times the stiffness over the length squared.
    critical = np.pi**2 / 4 * scenes.SOFT["EI3"]
    factors = np.array(analysis["steps"][:-1])
    below, above = factors[factors < critical], factors[factors > critical]
    entries = [text for text in legend(figure) if "other factors" in text]
    assert entries == [
        f"{len(below)} other factors, {below.min():g} to {below.max():g}",
        f"{len(above)} other factors, {above.min():g} to {above.max():g}, unstable",
    ]


# -- many labels, universal joints ----------------------------------------------------------------


def comb(teeth, spacing):
    """Cantilevers side by side, each with a force of its own: a label for each force, reaction and moment."""
    nodes, members, loads = {}, {}, {}
    for i in range(teeth):
        nodes |= {
            f"a{i}": {"position": [i * spacing, 0], "support": "clamped"},
            f"b{i}": {"position": [i * spacing, 1]},
        }
        members[f"m{i}"] = {"nodes": [f"a{i}", f"b{i}"], "section": "s"}
        loads[f"f{i}"] = {"type": "force", "node": f"b{i}", "value": [0.1 + 0.0137 * i, 0]}
    table = {"sections": {"s": {"EI3": 1.0}}, "nodes": nodes, "members": members, "loads": loads}
    return solve(scenes.made(table))


def test_labels_that_would_overlap_are_left_out_and_counted():
    figure = picture(solution := comb(24, 0.04))
    said = [text for text in figure.findobj(Text) if (text.get_gid() or "").startswith(("load", "reaction"))]
    (note,) = named(figure, "left-out", Text)
    asked = {(label.text, label.colour) for label in sketched(solution).labels}
    assert 0 < int(note.get_text().split()[0]) == len(asked) - len(said)
    # The largest load, reaction and moment are told.
    force, moment = solution.scene.loads["f23"].vector[0], abs(solution.last.reaction("a23")[1][2])
    assert {f"{force:.3g} N", f"{moment:.3g} N m"} <= {text.get_text() for text in said}
    boxes = [text.get_window_extent() for text in said]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert [text.get_text() for text in named(picture(comb(2, 1.0)), "left-out", Text)] == [""]


def test_universal_joints_are_a_cross_of_their_two_axes():
    """As both sides carry them: the first as the first member, the second as the other."""
    table = {
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {
            "a": {"position": [0, 0, 0], "support": "clamped"},
            "b": {"position": [1, 0, 0], "joint": "universal", "axis": [0, 0, 1], "axis2": [0, 1, 0]},
            "c": {"position": [1.8, 0.3, 0.4], "joint": "hinge", "axis": [0, 0, 1]},
            "d": {"position": [2.4, 0, 0], "support": "clamped"},
        },
        "members": {f"m{i}": {"nodes": pair, "section": "s"} for i, pair in enumerate(("ab", "bc", "cd"))},
        "loads": {"f": {"type": "force", "node": "b", "value": [0, 0.3, -0.5]}},
    }
    table["members"] = {name: {**member, "nodes": list(member["nodes"])} for name, member in table["members"].items()}
    solution = solve(scenes.made(table))
    sketch = sketched(solution)
    marks = {name: [mark for mark in sketch.marks if mark.name == f"joint-{name}"] for name in ("b", "c")}
    assert [mark.kind for mark in marks["c"]] == ["dot"]
    assert [mark.kind for mark in marks["b"]] == ["dot", "line", "line"]
    for mark, member, axis, end in zip(marks["b"][1:], ("m0", "m1"), ([0, 0, 1], [0, 1, 0]), (1.0, 0.0), strict=True):
        turned = quaternion.rotate(solution.last.along(member, end)["quaternion"][0], np.array(axis, float))
        along = mark.points[1] - mark.points[0]
        assert along / np.linalg.norm(along) == pytest.approx(turned, abs=1e-12)
        # The unit of the drawing is the metre here.
        assert mark.points.mean(axis=0) == pytest.approx(solution.last.position("b"), abs=1e-12)


# -- charts of paths ------------------------------------------------------------------------------


def test_shapes_of_a_path_have_entries_dots_and_dashes_where_unstable():
    course, shapes = chart(path := solve(load("problems/lee_frame.toml"))).axes
    said = [text.get_text() for text in shapes.get_legend().get_texts()]
    assert said[0] == "undeformed"
    dots = [line for line in course.get_lines() if line.get_gid() == "shape"]
    assert len(dots) == len(said) - 1 >= 3
    lines = [line for line in shapes.get_lines() if line.get_gid() == "shape" and not line.get_label().startswith("_")]
    for dot, line, text in zip(dots, lines, said[1:], strict=True):
        assert text.startswith(f"factor {dot.get_ydata()[0]:.4g}")
        assert dot.get_color() == line.get_color()
        assert line.is_dashed() == text.endswith(", unstable")
    assert any(text.endswith(", unstable") for text in said)
    assert len({dot.get_color() for dot in dots}) == len(dots)
    assert path.branches[0].factors.max() > 2.4


def test_branches_to_both_sides_are_seen_apart():
    course, shapes = chart(solve(load("problems/cantilever_post_buckling.toml"))).axes
    assert course.get_xlabel() == "displacement of tip in y, m"
    said = [text.get_text() for text in shapes.get_legend().get_texts()]
    assert said == ["undeformed", "factor 23, branch 1", "factor 23, branch 2", "buckling mode, factor 22.21"]
    # Three shapes along each branch, the last one bold in colour and in the legend.
    lines = [line for line in shapes.get_lines() if line.get_gid() == "shape"]
    dots = [line for line in course.get_lines() if line.get_gid() == "shape"]
    assert len(lines) == len(dots) == 2 * 3 + 1
    assert [line.get_label().startswith("_") for line in lines] == [True, True, False] * 2 + [False]
    assert [line.get_color() for line in lines] == [dot.get_color() for dot in dots]


def test_paths_are_smooth_between_their_points():
    """Euler's elastica: its tip is farthest aside between two points of the path."""
    path = solve(load("problems/cantilever_post_buckling.toml"))
    course, _ = chart(path).axes
    aside = np.abs(path.positions("tip", 1)[:, 1]).max()
    drawn = [line for line in course.get_lines() if line.get_gid() == "stable"]
    farthest = max(float(np.abs(line.get_xdata()).max()) for line in drawn)
    closed = elastica_farthest_aside()
    # The largest point of the path is this much below; the curve misses it by less than a thousandth.
    assert aside < closed - 5e-3
    assert farthest == pytest.approx(closed, abs=1e-3)


def elastica_farthest_aside() -> float:
    """Largest deflection of the tip of a compressed cantilever of unit length: 2 k / K(k), k the sine of half the angle
    of the tip."""
    moduli = np.linspace(0.01, 0.999, 100_000)
    return float((2.0 * moduli / ellipk(moduli**2)).max())


def test_charts_draw_what_holds_the_structure():
    """At the places that supports have at the end of the path: one of the edges' beam slides with its middle."""
    scene = load("problems/knife_edges_limit_load.toml")
    coarse = scene.analysis.model_copy(update={"points": 30, "accuracy": 1e-2})
    path = solve(scene.model_copy(update={"analysis": coarse}))
    _, shapes = chart(path).axes
    drawn = [artist for artist in shapes.get_children() if (artist.get_gid() or "").startswith(("support", "contact"))]
    names = {artist.get_gid() for artist in drawn}
    held = {f"support-{name}" for name, node in path.scene.nodes.items() if node.support != "free"}
    assert names == held | {f"contact-{name}" for name in path.scene.contacts}
    pin = next(line for line in shapes.get_lines() if line.get_gid() in held and line.get_marker() == "o")
    assert pin.get_xydata()[0] == pytest.approx(path.positions("middle")[-1][:2], abs=1e-12)
    assert not any("load" in (artist.get_gid() or "") for artist in shapes.get_children())


def test_charts_in_space_show_what_buckles_sideways():
    found = load("problems/strip_lateral_buckling.toml").to_dict()
    found["analysis"] |= {"branches": 1, "accuracy": 1e-3}
    figure = chart(solve(Scene.from_dict({**found, "expect": []})))
    course, _, shapes = figure.axes
    assert course.get_xlabel() == "displacement of tip in z, m"
    drawn = {line.get_label(): np.stack(line.get_data_3d(), axis=1) for line in shapes.get_lines()}
    one, other = (drawn[f"factor 6, branch {number}"] for number in (1, 2))
    assert one == pytest.approx(other * [1.0, 1.0, -1.0], abs=1e-6)
    seen = [np.stack(proj3d.proj_transform(*line.T, shapes.get_proj())[:2], axis=1) for line in (one, other)]
    across = np.ptp(np.vstack(seen), axis=0)
    # The tips stand apart by a large part of the picture.
    assert np.linalg.norm(seen[0][-1] - seen[1][-1]) > 0.5 * across.max()
    # The axes reach over the whole figure, and hide nothing of the chart beside them.
    assert not shapes.patch.get_visible()


def test_rounding_does_not_fill_a_chart():
    course, shapes = chart(solve(load("problems/toggle_inextensible.toml"))).axes
    low, high = course.get_xlim()
    assert high - low > 0.01
    # One unit of length in both panels.
    assert course.get_xlabel() == "displacement of apex in y, m"
    assert shapes.get_ylabel() == "y, m"
    assert [text.get_text() for text in shapes.get_legend().get_texts()] == [
        "undeformed; all equilibria look like it",
        "buckling mode, factor 6.035",
    ]


def test_charts_draw_the_buckling_modes_of_a_column():
    course, shapes = chart(solve(load("problems/euler_column_clamped_free.toml"))).axes
    lines = [line for line in shapes.get_lines() if line.get_gid() == "shape"]
    dots = [line for line in course.get_lines() if line.get_gid() == "shape"]
    assert len(lines) == len(dots) == 3
    for number, (line, dot) in enumerate(zip(lines, dots, strict=True)):
        wave = (number + 0.5) * np.pi
        assert line.get_label() == f"buckling mode, factor {wave**2:.4g}"
        # The unit of the drawing is the metre here.
        x, y = line.get_data()
        closed = 1.0 - np.cos(wave * x)
        # The mesh of the path has factors to 1e-8, shapes to its root.
        np.testing.assert_allclose(y / y[-1], closed / closed[-1], atol=1e-4)
        assert np.abs(y).max() == pytest.approx(REACH, rel=1e-12)
        assert dot.get_ydata()[0] == pytest.approx(wave**2, rel=1e-7)
        assert dot.get_color() == line.get_color()
    assert "arbitrary size" in shapes.get_legend().get_title().get_text()
