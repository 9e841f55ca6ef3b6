"""Curves of quantities over the factor, over time and along paths, colours by quantity, and what controls do."""

import json

import numpy as np
import pytest
import scenes
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Text
from moving import FALLING

from sfetcas import Scene, SceneError, Settings, load, solve
from sfetcas.cli import main
from sfetcas.pictures.charts import chart
from sfetcas.pictures.colours import QUANTITIES
from sfetcas.pictures.controls import save_controls
from sfetcas.pictures.curves import clipped, curves
from sfetcas.pictures.modeshapes import mode_picture
from sfetcas.pictures.motions import histories, motion_picture
from sfetcas.pictures.plotting import picture
from sfetcas.pictures.sketch import unit_for, with_prefix
from sfetcas.trajectories.optimal_control import OptimalControl

TIGHT = Settings(accuracy=1e-6)


def named(figure, name, kind=Line2D):
    return [artist for artist in figure.findobj(kind) if artist.get_gid() == name]


def upright(figure):
    return [axes.get_ylabel() for axes in figure.axes]


# -- colours --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bent():
    """A cantilever with a rectangular section, pulled aside and along."""
    table = scenes.cantilever((2.0, 3.0))
    section = {"shape": "rectangle", "width": 0.02, "height": 0.01, "E": 1e9}
    return solve(scenes.made({**table, "sections": dict.fromkeys(table["sections"], section)}), TIGHT)


@pytest.fixture(scope="module")
def twisted():
    """An L in space, whose tip force bends and twists its first arm."""
    return solve(
        Scene.from_dict(
            {
                "sections": {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0}},
                "nodes": {
                    "A": {"position": [0, 0, 0], "support": "clamped"},
                    "B": {"position": [1, 0, 0]},
                    "C": {"position": [1, 1, 0]},
                },
                "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "s"}},
                "loads": {"tip": {"type": "force", "node": "C", "value": [0, 0, 0.3]}},
            }
        ),
        TIGHT,
    )


def drawn(solution, colour):
    """Values that colour the pieces of the first member, and what the bar says."""
    figure = picture(solution, colour=colour)
    (lines,) = [one for one in figure.findobj() if getattr(one, "get_gid", lambda: None)() == "deformed"]
    bars = [axes.get_ylabel() for axes in figure.axes if axes.get_label() == "<colorbar>"]
    return lines, np.asarray(lines.get_array()), bars


def fields(solution, member, count):
    x = np.linspace(0, 1, count + 1)
    found = solution.last.along(member, x)
    return {key: 0.5 * (values[1:] + values[:-1]) for key, values in found.items()}, x


def test_colours_in_the_plane_are_what_their_bars_say(bent):
    for colour, label in (
        ("tension", "axial force, N"),
        ("shear", "shear force, N"),
        ("curvature", "change of curvature about z, 1/m"),
        ("stress", "bending stress, MPa"),
    ):
        _, values, bars = drawn(bent, colour)
        assert bars == [label]
        found, _ = fields(bent, "m", len(values))
        turn = found["angle"]
        force = np.array([2.0, 3.0])
        wanted = {
            "tension": force[0] * np.cos(turn) + force[1] * np.sin(turn),
            "shear": force[1] * np.cos(turn) - force[0] * np.sin(turn),
            "curvature": found["curvature"][:, 2],
            # Half the height times E times the curvature.
            "stress": 1e-6 * 1e9 * 0.005 * np.abs(found["curvature"][:, 2]),
        }[colour]
        np.testing.assert_allclose(values, wanted, rtol=1e-3, atol=1e-3)


def test_twist_in_space_is_the_moment_along_the_tangent(twisted):
    lines, values, bars = drawn(twisted, "twist")
    assert bars == ["torsional moment, N m"]
    end = twisted.last.position("C") - twisted.last.position("A")
    moment = np.cross(end, [0.0, 0.0, 0.3])
    # At the clamp the tangent is x.
    assert values[0] == pytest.approx(moment[0], rel=0.02)
    assert lines.norm.vmin == -lines.norm.vmax
    assert drawn(twisted, "moment")[0].norm.vmin == 0.0


def test_every_colour_is_drawn_or_refused(twisted, bent):
    for colour in QUANTITIES:
        if colour == "stress":
            with pytest.raises(SceneError, match="found 'stress', but no section has a shape"):
                picture(twisted, colour=colour)
        else:
            assert drawn(twisted, colour)[2]
    # In the plane nothing twists: no colour bar.
    assert [axes.get_label() for axes in picture(bent, colour="twist").axes] == [""]


def test_members_without_a_value_are_grey(bent):
    table = bent.scene.to_dict()
    table["nodes"]["C"] = {"position": [2, 0]}
    table["members"]["rigid"] = {"nodes": ["B", "C"], "type": "rigid"}
    lines, values, _ = drawn(solve(Scene.from_dict(table), TIGHT), "stress")
    assert np.ma.getmaskarray(lines.get_array()).sum() >= 100
    assert np.isfinite(np.ma.masked_invalid(lines.get_array()).max())
    assert len(values) == 200


# -- quantities -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def steps():
    return solve(scenes.made(scenes.cantilever(analysis={"steps": [0.5, 1.0, 2.0]})), TIGHT)


def test_curves_go_through_the_steps(steps):
    figure = curves(steps, ["nodes.B.position", "reactions.A.moment.z", "certificate.negative"])
    assert upright(figure) == ["nodes.B.position, m", "reactions.A.moment.z, N m", "certificate.negative"]
    first, second, _ = figure.axes
    for line, i in zip(first.get_lines(), (0, 1), strict=True):
        np.testing.assert_allclose(line.get_ydata(), [step.position("B")[i] for step in steps.steps])
        np.testing.assert_allclose(line.get_xdata(), [0.5, 1.0, 2.0])
    (line,) = second.get_lines()
    np.testing.assert_allclose(line.get_ydata(), [step.reaction("A")[1][2] for step in steps.steps])


def test_solutions_plot_their_quantities(steps):
    assert upright(steps.plot("nodes.B.position.y")) == ["nodes.B.position.y, m"]
    assert upright(steps.plot(quantities=["nodes.B.position.x", "factor"])) == ["nodes.B.position.x, m", "factor"]
    with pytest.raises(SceneError, match="found quantity and quantities"):
        steps.plot("factor", quantities=["factor"])
    for how in ({"steps": [0]}, {"colour": "moment"}):
        with pytest.raises(SceneError, match="found quantities with steps or colour"):
            steps.plot("factor", **how)


@pytest.fixture(scope="module")
def path():
    table = scenes.cantilever((-1.0, 0.01), analysis={"type": "path", "range": [0, 5.0], "points": 60})
    return solve(scenes.made(table), Settings(accuracy=1e-4))


def test_quantities_of_a_path_stand_over_the_factor(path):
    figure = chart(path, "nodes.B.position.y")
    panel = figure.axes[0]
    assert (panel.get_ylabel(), panel.get_xlabel()) == ("nodes.B.position.y, m", "factor")
    found = np.concatenate([line.get_ydata() for line in panel.get_lines() if line.get_linestyle() in ("-", "--")])
    # The curve goes through all points.
    assert all(np.abs(found - value).min() < 1e-12 for value in path.positions("B")[:, 1])
    energies = np.concatenate([line.get_ydata() for line in chart(path, "energy.total").axes[0].get_lines()])
    assert all(np.abs(energies - path.configuration(p).energy["total"]).min() < 1e-12 for p in path.points)
    several = chart(path, quantities=["nodes.B.position", "reactions.A.force.x"])
    assert [label for label in upright(several) if label.startswith(("nodes", "reactions"))] == [
        "nodes.B.position.x, m",
        "nodes.B.position.y, m",
        "reactions.A.force.x, N",
    ]
    for wrong, sentence in (
        ("certificate.residual", "which is told of steps only"),
        ("modes.omega", "told of modes only"),
        ("nodes.C.position", "found 'C'"),
    ):
        with pytest.raises(SceneError, match=sentence):
            chart(path, wrong)
    with pytest.raises(SceneError, match="found quantity and quantities"):
        chart(path, "nodes.B.position", quantities=["nodes.B.position"])


def test_frequencies_of_a_path_with_modes_and_its_flutter_point():
    found = solve(load("problems/beck_column_flutter.toml"))
    figure = chart(found)
    (panel,) = [axes for axes in figure.axes if axes.get_ylabel() == "angular frequency, rad/s"]
    (mark,) = named(figure, "flutter point")
    assert mark.get_xdata()[0] == pytest.approx(found.flutter_points[0].factor)
    assert mark.get_ydata()[0] == pytest.approx(found.flutter_points[0].omega)
    lowest = [min(point.omega) for point in found.points]
    assert any(
        np.allclose(line.get_ydata(), lowest) for line in panel.get_lines() if len(line.get_ydata()) == len(lowest)
    )
    assert "angular frequency, rad/s" in upright(chart(found, "modes.omega"))


# -- axes -----------------------------------------------------------------------------------------


def test_values_far_beyond_all_others_do_not_stretch_an_axis():
    singular = 1.0 / np.abs(np.linspace(-1, 1, 200)) ** 3
    _, high = clipped(singular)
    assert 0 < high < 1e4 < 0.02 * singular.max()
    for calm in (np.linspace(0, 1, 200), np.sin(np.linspace(0, 20, 200)), np.linspace(0, 3, 100) ** 8, np.zeros(50)):
        assert clipped(calm) is None
    assert clipped(np.array([0.0, 1.0, 1e9])) is None
    assert clipped(np.append(np.linspace(0, 1, 50), np.nan)) is None


def test_where_a_curve_leaves_the_axes_it_is_said(path, monkeypatch):
    original = type(path.fields(path.points[0])).reaction

    def singular(self, node):
        force, moment = original(self, node)
        return force / max(abs(self.position("B")[0] - 0.5), 1e-9) ** 3, moment

    monkeypatch.setattr(type(path.fields(path.points[0])), "reaction", singular)
    figure = chart(path, "reactions.A.force.x")
    panel = figure.axes[0]
    low, high = panel.get_ylim()
    values = np.concatenate([line.get_ydata() for line in panel.get_lines() if line.get_linestyle() == "-"])
    assert np.abs(values).max() > 5.0 * max(abs(low), abs(high))
    assert named(figure, "leaves")
    figure.draw_without_rendering()
    (written,) = named(figure, "leaving", Text)
    assert not written.get_window_extent().overlaps(panel.get_legend().get_window_extent())
    note = written.get_text()
    assert note.startswith("leaves the axes: up to ")
    assert note.endswith("N")


@pytest.mark.parametrize(
    ("value", "unit", "factor", "text"),
    [
        (1.5e3, "N m", 1.0, "N m"),
        (1.5e4, "N m", 1e3, "kN m"),
        (2e-3, "1/m", 1e-3, "10⁻³/m"),
        (2e6, "kg m/s", 1e6, "10⁶ kg m/s"),
        (2e-9, "", 1e-9, "10⁻⁹"),
        (2e30, "m", 1e30, "10³⁰ m"),
        (0.0, "m", 1.0, "m"),
    ],
)
def test_units_have_prefixes_or_powers_of_ten(value, unit, factor, text):
    found = with_prefix(value, unit)
    assert found[0] == pytest.approx(factor)
    assert found[1] == text


def test_far_from_zero_the_unit_is_that_of_the_differences():
    assert unit_for(1e7 + np.linspace(0, 1, 5), "m") == (1.0, "m")
    assert unit_for(np.linspace(0, 1e7, 5), "m") == (1e6, "Mm")


# -- controls -------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0, 1])
def test_controls_are_drawn_with_bounds_beside_positions(order, tmp_path):
    scene = Scene.from_dict(
        {
            "title": "a rigid arm",
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {
                "hub": {"position": [0, 0], "support": "hinge", "inertia": [0, 0, 0.1]},
                "tip": {"position": [1, 0], "mass": 0.2},
            },
            "members": {"arm": {"nodes": ["hub", "tip"], "section": "s", "type": "rigid"}},
            "loads": {"motor": {"type": "moment", "node": "hub", "value": 0.0}},
        }
    )
    torque = "loads.motor.value"
    problem = OptimalControl(scene, {torque: (-2.0, 2.0)}, time=2.0, intervals=8, order=order)
    problem.subject_to(problem.at_tf(problem.answer("nodes.hub.angle")) == 1.0, name="turned")
    problem.rest_at_end()
    problem.minimise(problem.integral(problem.control(torque) ** 2))
    motion = problem.solve(replay=False)
    figure = motion.plot()
    assert upright(figure) == ["loads.motor.value, N m", "position of tip, m"]
    (steps,) = [one for one in figure.findobj() if getattr(one, "get_gid", lambda: None)() == "control"]
    drawn = steps.get_data().values if order == 0 else steps.get_ydata()
    np.testing.assert_allclose(drawn, motion.control(torque))
    assert {line.get_ydata()[0] for line in named(figure, "bound")} == {-2.0, 2.0}
    x, y = named(figure, "position")
    # At the ends of intervals it goes through the answer, and between them along the circle, but for collocation.
    np.testing.assert_allclose(x.get_ydata()[::8], motion.positions("tip")[:, 0], atol=1e-12)
    np.testing.assert_allclose(np.hypot(x.get_ydata(), y.get_ydata()), 1.0, atol=1e-4)
    # Of the least torque, which falls evenly with time; steps of an eighth of the time are off by some percent.
    share = x.get_xdata() / 2.0
    angle = np.arctan2(y.get_ydata(), x.get_ydata())
    np.testing.assert_allclose(angle, 3 * share**2 - 2 * share**3, atol=1e-3 if order else 0.02)
    save_controls(motion, tmp_path / "a.png", nodes=["hub", "tip"])
    with pytest.raises(SceneError, match="nodes: found 'end', accepted: hub, tip"):
        motion.plot(nodes=["end"])
    with pytest.raises(SceneError, match="node: found 'end'"):
        motion.interpolated("end")


# -- names ----------------------------------------------------------------------------------------

HOSTILE = ("</script>'\"", "$x_{ ^$ \u6881 last")


def hostile(analysis, **more):
    first, second = HOSTILE
    table = {
        **FALLING,
        "title": "$\\frac{ </script> \u6881\nsecond line",
        "nodes": {first: {"position": [1e7, 1e7], "support": "clamped"}, second: {"position": [1e7 + 1.0, 1e7]}},
        "members": {"$m_{": {"nodes": [first, second], "section": "strip", "element": "SFET3", "elements": 2}},
        "analysis": analysis,
        **more,
    }
    return solve(Scene.from_dict(table), Settings(accuracy=1e-3))


PULL = {"q$_": {"type": "force", "node": HOSTILE[1], "value": [0, -1e-9]}}
NAMED = [f"nodes.{HOSTILE[1]}.position", "members.$m_{.moment.z at 0"]


@pytest.mark.parametrize("kind", ["motion", "histories", "quantities", "path", "curves", "modes"])
def test_any_name_and_number_is_text_that_does_not_overlap(kind, tmp_path, monkeypatch):
    moving, loads = FALLING["analysis"], {"loads": PULL, "gravity": [0, 0]}
    figure = {
        "motion": lambda: motion_picture(hostile(moving)),
        "histories": lambda: histories(hostile(moving), HOSTILE),
        "quantities": lambda: motion_picture(hostile(moving), quantities=[*NAMED, "energy.total"]),
        "path": lambda: chart(hostile({"type": "path", "range": [0, 1], "points": 6}, **loads), quantities=NAMED),
        "curves": lambda: curves(hostile({"steps": [0.5, 1.0]}, **loads), NAMED),
        "modes": lambda: mode_picture(hostile({"type": "modes", "modes": 3}, gravity=[0, 0])),
    }[kind]()
    figure.savefig(tmp_path / "a.svg")
    found, original = [], Text.draw

    def told(text, renderer):
        if text.get_text() and text.get_visible():
            found.append(text)
        original(text, renderer)

    monkeypatch.setattr(Text, "draw", told)
    figure.draw_without_rendering()
    # Of letters at arrows the letters alone.
    boxes = [(text.get_text(), Text.get_window_extent(text).padded(-1.5)) for text in found]
    assert not [(a, b) for i, (a, one) in enumerate(boxes) for b, two in boxes[:i] if one.overlaps(two)]
    for text, box in boxes:
        assert box.x0 >= -1, text
        assert box.x1 <= figure.bbox.x1 + 1, text
        assert box.y0 >= -1, text
        assert box.y1 <= figure.bbox.y1 + 1, text
    # Legends keep clear of the numbers that axes add.
    for axes in figure.axes:
        added, legend = axes.yaxis.get_offset_text(), axes.get_legend()
        if added.get_text() and legend is not None:
            assert not added.get_window_extent().overlaps(legend.get_window_extent())
    texts = " ".join(text.replace("\n", " ") for text, _ in boxes)
    assert "$\\frac{ </script> \ufffd second line" in texts or kind == "histories"
    assert isinstance(figure.axes[0], Axes)


# -- the command ----------------------------------------------------------------------------------


def test_the_command_takes_colours_and_quantities(tmp_path, capsys, monkeypatch):
    file, out = tmp_path / "scene.json", tmp_path / "a.png"
    file.write_text(json.dumps(scenes.cantilever(analysis={"steps": [0.5, 1.0]})))
    usual = ["run", str(file), "--plot", str(out)]
    pictures = []
    for more in ([], ["--colour", "tension"], ["--quantity", "nodes.B.position.y", "--quantity", "energy.elastic"]):
        assert main([*usual, *more]) == 0
        pictures.append(out.read_bytes())
    assert len(set(pictures)) == 3
    capsys.readouterr()
    monkeypatch.setattr("sfetcas.cli.solve", lambda *_, **__: pytest.fail("solved"))
    for words, sentence in (
        ([*usual, "--colour", "red"], "--colour: found 'red'"),
        ([*usual, "--quantity", "nodes.C.position"], "--quantity: found 'C'"),
        (["run", str(file), "--quantity", "nodes.B.position"], "--quantity: found without effect"),
        (["run", str(file), "--colour", "moment"], "--colour: found without effect"),
        ([*usual, "--quantity", "energy.elastic", "--colour", "moment"], "--colour: found with --quantity"),
    ):
        assert main(words) == 2
        told = capsys.readouterr().err
        assert sentence in told
        assert told.count("\n") == 1
