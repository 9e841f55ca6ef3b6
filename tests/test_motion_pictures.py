"""Pictures of motions: what is drawn is where the answer says, has a name and a unit, and nothing overlaps."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text
from moving import FALLING, SPACE

from sfetcas import Scene, SceneError, solve
from sfetcas.dynamics import sampling
from sfetcas.pictures.files import ENDINGS
from sfetcas.pictures.motions import histories, most_moving, motion_picture, save_histories, save_motion


@pytest.fixture(scope="module")
def motions():
    return {name: solve(Scene.from_dict(table)) for name, table in (("plane", FALLING), ("space", SPACE))}


both = pytest.mark.parametrize("name", ["plane", "space"])


def named(figure, name, kind=Line2D):
    return [artist for artist in figure.findobj(kind) if artist.get_gid() == name]


def data(line):
    return np.stack(line.get_data_3d() if hasattr(line, "get_data_3d") else line.get_data(), axis=1)


@both
def test_positions_are_those_of_the_motion_evenly_over_the_time(motions, name):
    motion = motions[name]
    axes = 3 if motion.last.model.space else 2
    lines = named(motion_picture(motion), "strobe")
    members = list(motion.scene.members)
    assert len(lines) == 10 * len(members)
    wanted = np.linspace(0, motion.times[-1], 10)
    for i, (time, step) in enumerate(zip(wanted, motion.between(wanted), strict=True)):
        assert step.time == pytest.approx(time, abs=1e-12)
        for j, member in enumerate(members):
            drawn = data(lines[i * len(members) + j])
            for end, node in zip((0, -1), motion.scene.members[member].nodes, strict=True):
                # Rotations along the member and displacements of nodes are interpolated each by itself.
                np.testing.assert_allclose(drawn[end], step.position(node)[:axes], atol=1e-8)
    widths = [line.get_linewidth() for line in lines]
    assert widths == sorted(widths)
    assert widths[0] < widths[-1]
    shades = [sum(line.get_color()[:3]) for line in lines[:: len(members)]]
    assert shades == sorted(shades, reverse=True)


def test_way_of_the_free_end_goes_through_all_steps(motions):
    motion = motions["plane"]
    figure = motion_picture(motion)
    (way,) = named(figure, "way-B")
    fine = motion.resampled()
    np.testing.assert_allclose(data(way), fine.positions("B")[:, :2], atol=1e-12)
    assert set(motion.times) < set(fine.times)
    # 30 steps: more than answers, and none of them is left out.
    assert all(np.abs(fine.times - end).min() < 1e-12 for end in 0.01 * np.arange(31))
    assert [text.get_text() for text in named(figure, "way-B", Text)] == ["B"]
    assert not named(figure, "way-A")


@both
def test_histories_and_energies_are_those_of_the_motion(motions, name):
    figure = motion_picture(motions[name])
    motion = motions[name].resampled()
    above, below = (axes for axes in figure.axes if axes.get_ylabel().startswith(("position", "energy")))
    node = "C" if name == "space" else "B"
    assert most_moving(motion) == node
    assert above.get_ylabel() == f"position of {node}, m"
    assert below.get_ylabel() == "energy, N m"
    assert below.get_xlabel() == "time, s"
    for i, line in enumerate(above.get_lines()):
        assert line.get_label() == "xyz"[i]
        np.testing.assert_allclose(data(line), np.stack([motion.times, motion.positions(node)[:, i]], axis=1))
    assert [line.get_label() for line in below.get_lines()] == ["kinetic", "elastic", "loads", "total"]
    for line in below.get_lines():
        np.testing.assert_allclose(data(line)[:, 1], motion.energies(line.get_label()))


@both
def test_supports_joints_and_gravity_are_drawn(motions, name):
    figure = motion_picture(motions[name])
    assert named(figure, "support-A")
    assert len(named(figure, "joint-B")) == (name == "space")
    # Gravity has no factor: at any time it is the whole.
    assert [text.get_text() for text in named(figure, "gravity", Text)] == ["gravity 9.81 m/s²"]
    assert len(named(figure, "gravity", FancyArrowPatch)) == 1


def test_the_undeformed_scene_is_drawn_where_the_motion_begins_elsewhere(motions):
    assert not named(motion_picture(motions["plane"]), "undeformed")
    late = replace(motions["plane"], steps=motions["plane"].steps[8:])
    (line,) = named(motion_picture(late), "undeformed")
    np.testing.assert_allclose(data(line)[[0, -1]], [[0, 0], [1, 0]], atol=1e-12)


def test_small_and_quick_motions_have_prefixes():
    small = {
        **FALLING,
        "sections": {"strip": {"EI3": 1e-3, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [0.01, 0]}},
        "analysis": {"type": "dynamic", "end": 0.02, "step": 0.001, "output": 0.002},
    }
    figure = motion_picture(solve(Scene.from_dict(small)))
    labels = {axes.get_ylabel() for axes in figure.axes} | {axes.get_xlabel() for axes in figure.axes}
    assert {"x, mm", "y, mm", "position of B, mm", "time, ms", "time of the position, ms"} <= labels
    assert any(label.startswith("energy, ") and label.endswith("N m") and label != "energy, N m" for label in labels)


def few(table, output):
    return solve(Scene.from_dict({**table, "analysis": {**table["analysis"], "output": output}}))


@pytest.mark.parametrize("table", [FALLING, SPACE], ids=["plane", "space"])
def test_states_between_answers_are_those_of_a_run_that_is_asked_for_them(table):
    end = table["analysis"]["end"]
    coarse, close = few(table, end), few(table, end / 60)
    assert len(coarse.steps) == 2
    found = coarse.between(close.times)
    for one, other in zip(found, close.steps, strict=True):
        for node in close.scene.nodes:
            # The same steps; a run that goes on knows fewer of them beyond its first answers, and takes polynomials
            # of stages there.
            np.testing.assert_allclose(one.position(node), other.position(node), atol=1e-6)
            np.testing.assert_allclose(one.velocity(node), other.velocity(node), atol=1e-4)
        assert one.energy["total"] == pytest.approx(other.energy["total"], abs=1e-4)
    assert found[0] is coarse.steps[0]
    assert found[-1] is coarse.steps[1]
    drawn = data(named(motion_picture(coarse), f"way-{most_moving(close)}")[0])
    assert len(drawn) > 100


def test_times_outside_the_motion_are_refused(motions):
    for time in (-0.01, 0.31):
        with pytest.raises(SceneError, match=r"accepted: times from 0 to 0\.3 s"):
            motions["plane"].between([0.1, time])
    for times in ("a", [[0.0, 0.1]], {}):
        with pytest.raises(SceneError, match=r"^found .*, accepted: times from 0 to"):
            motions["plane"].between(times)


def test_a_motion_of_idas_is_drawn_through_its_answers():
    table = {key: value for key, value in FALLING["analysis"].items() if key != "step"}
    heavy = {"strip": {**FALLING["sections"]["strip"], "rhoI": [0.0, 0.0, 1e-3]}}
    analysis = {**table, "integrator": "idas", "output": 0.05}
    motion = solve(Scene.from_dict({**FALLING, "sections": heavy, "analysis": analysis}))
    assert motion.resampled() is motion
    with pytest.raises(SceneError, match="found integrator 'idas'"):
        motion.between([0.01])
    (above, *_) = (axes for axes in motion_picture(motion).axes if axes.get_ylabel().startswith("position"))
    assert len(data(above.get_lines()[0])) == len(motion.steps)
    assert above.get_lines()[0].get_marker() == "."


def test_a_record_of_many_steps_keeps_its_room(monkeypatch):
    full = few(FALLING, 0.3)
    monkeypatch.setattr(sampling, "ROOM", full.record._bytes // 3)
    thin = few(FALLING, 0.3)
    assert thin.record._bytes <= full.record._bytes // 3
    ends = thin.record.times
    assert len(ends) < len(full.record.times)
    assert {ends[0], full.record.times[-1]} <= {full.record.times[0], ends[-1]}
    times = ends[ends <= full.last.time / full.last.mover.time] * full.last.mover.time
    for one, other in zip(thin.between(times), full.between(times), strict=True):
        # Ends of steps that are kept are nodes of the polynomials.
        np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-12)
    # Between them by intervals of 0.04 s, in a fall of 0.3 s during which the beam vibrates.
    between = 0.5 * (times[1:] + times[:-1])
    for one, other in zip(thin.between(between), full.between(between), strict=True):
        np.testing.assert_allclose(one.position("B"), other.position("B"), atol=2e-4)


def test_quantities_over_time_by_name(motions):
    motion = motions["plane"]
    figure = motion_picture(motion, quantities=["members.beam.moment at 0.5", "energy.kinetic"])
    panels = [axes for axes in figure.axes if axes.get_ylabel().startswith(("members", "energy"))]
    names = [axes.get_ylabel().replace("\n", " ") for axes in panels]
    assert names == ["members.beam.moment at 0.5, N m", "energy.kinetic, J"]
    fine = motion.resampled()
    (line,) = panels[0].get_lines()
    moments = [step.along("beam", [0.5])["moment"][0, 2] for step in fine.steps]
    np.testing.assert_allclose(data(line), np.stack([fine.times, moments], axis=1))
    alone = histories(motion, quantities=["nodes.B.velocity"])
    assert [line.get_label() for line in alone.axes[0].get_lines()] == ["x", "y"]
    for wrong, sentence in (
        (["nodes.C.position"], "found 'C'"),
        (["certificate.residual"], "told of statics only"),
        (["members.beam.moment"], "accepted: members.beam.moment at 0.5, or another place"),
        (["nodes.B.position step 2"], "accepted: nodes.B.position"),
        ([], "accepted: a list of names"),
        ("nodes.B.position", "accepted: a list of names"),
    ):
        with pytest.raises(SceneError, match=sentence):
            motion_picture(motion, quantities=wrong)
    with pytest.raises(SceneError, match="found nodes and quantities"):
        histories(motion, ["B"], quantities=["energy.total"])


@both
@pytest.mark.parametrize("draw", [motion_picture, histories])
def test_nothing_is_clipped_or_overlaps(motions, name, draw, monkeypatch):
    figure, found, original = draw(motions[name]), [], Text.draw

    def told(text, renderer):
        if text.get_text() and text.get_visible():
            found.append(text)
        original(text, renderer)

    monkeypatch.setattr(Text, "draw", told)
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in found]
    for text, box in boxes:
        assert box.x0 >= 0, text
        assert box.y0 >= 0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= figure.bbox.y1, text
    padded = [(text, box.padded(-1)) for text, box in boxes]
    assert not [(a, b) for (a, one), (b, two) in itertools.combinations(padded, 2) if one.overlaps(two)]


def test_a_single_answer_is_drawn_without_complaint(motions):
    """As much as is known where a motion stops in its first step."""
    motion = replace(motions["plane"], steps=motions["plane"].steps[:1])
    figure = motion_picture(motion)
    assert len(named(figure, "strobe")) == 1
    figure.draw_without_rendering()


def test_histories_of_nodes_by_name(motions):
    motion = motions["space"].resampled()
    figure = histories(motions["space"], ["C", "B"])
    assert [axes.get_ylabel() for axes in figure.axes] == [
        f"{what} of {node}, {unit}" for node in "CB" for what, unit in (("position", "m"), ("velocity", "m/s"))
    ]
    lines = figure.axes[3].get_lines()
    for i, line in enumerate(lines):
        np.testing.assert_allclose(data(line)[:, 1], motion.velocities("B")[:, i])
    with pytest.raises(SceneError, match="found node 'D'"):
        histories(motion, ["D"])
    with pytest.raises(SceneError, match="found none, accepted: names of nodes"):
        histories(motion, [])


@pytest.mark.parametrize("save", [save_motion, save_histories])
@pytest.mark.parametrize("ending", [".png", ".svg", ".pdf"])
def test_files(motions, tmp_path, save, ending):
    path = tmp_path / f"out{ending}"
    save(motions["plane"], path)
    assert path.stat().st_size > 5000
    with pytest.raises(SceneError, match=f"found the ending '.bmp' of a picture, accepted: {', '.join(ENDINGS)}"):
        save(motions["plane"], tmp_path / "out.bmp")
    with pytest.raises(SceneError, match="found no ending"):
        save(motions["plane"], tmp_path / "out")


def test_states_between_are_continuous_within_steps():
    """Also where two interpolations are as good as each other and either is taken."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [0, 1]}},
            "analysis": {"type": "dynamic", "end": 0.2, "output": 0.1, "step": 0.05},
        }
    )
    times = np.linspace(0.0, 0.2, 801)
    states = solve(scene).between(times)
    places = np.array([state.position("B") for state in states])
    fastest = max(np.linalg.norm(state.velocity("B")) for state in states)
    # No further than the fastest velocity leads; a leap within a step was forty times that.
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 2.0 * fastest * times[1]
