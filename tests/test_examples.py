"""The problems that are programs: each checks itself."""

import functools
import importlib.util
from pathlib import Path

import entries
import numpy as np
import pytest

FOLDER = Path(__file__).parent.parent / "problems"
PROGRAMS = sorted(FOLDER.glob("*.py"))
DIGEST = entries.program_digest()


@functools.cache
def imported(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_are_programs():
    assert PROGRAMS


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program_checks_itself(path, monkeypatch, tmp_path):
    module, made = imported(path), entries.kept(path, DIGEST)
    if made is not None:
        # What the gallery has found and drawn with this very program needs no second run.
        assert made.comparisons
        assert [found.quantity for found in made.comparisons if not found.passed] == []
        return
    differences = module.check()
    assert differences
    for name, difference in differences.items():
        assert difference <= module.TOLERANCE, name
    if path.stem in DESIGNS:
        # Here, as what was found is at hand.
        drawn(module, monkeypatch, tmp_path / "design.png")


def drawn(module, monkeypatch, file):
    if module.__name__ == "flexure_hinge_least_shift":
        # Shifts are checked above; a curve of them takes a solution a point.
        monkeypatch.setattr(module, "shift", lambda crossing, angle: abs(crossing - module.WITTRICK) * angle)
    figure = module.picture()
    figure.savefig(file)
    assert file.stat().st_size > 10_000
    assert all(axes.has_data() for axes in figure.axes)


def test_a_wrong_line_is_noticed(monkeypatch):
    module = imported(FOLDER / "tip_on_a_line.py")
    scene = module.with_slider()
    monkeypatch.setattr(module, "HEIGHT", module.HEIGHT + 1e-6)
    monkeypatch.setattr(module, "with_slider", lambda: scene)
    assert module.check()["tip against slider"] > module.TOLERANCE


def test_a_wrong_angle_of_the_parallelogram_is_noticed(monkeypatch):
    module = imported(FOLDER / "parallelogram_transmission.py")
    expected = module.expected
    monkeypatch.setattr(module, "expected", lambda scene, quantity: expected(scene, quantity) + 1e-5)
    differences = module.check()
    wrong = {name for name, difference in differences.items() if difference > module.TOLERANCE}
    assert wrong == {"flexible links, alpha against shooting", "flexible links, beta against shooting"}


def test_output_angle_of_rigid_links_follows_the_input_and_that_of_flexible_ones_does_not():
    module = imported(FOLDER / "parallelogram_transmission.py")
    assert module.transmission(module.rigid()).ratio == pytest.approx(1.0, abs=module.TOLERANCE)
    ratio = module.transmission(module.flexible()).ratio
    # Slopes of chords lie between those at their ends.
    alpha, beta = (module.expected(module.flexible(), f"nodes.{node}.angle") for node in "15")
    chords = np.diff(beta) / np.diff(alpha)
    assert ((ratio[1:] < chords) & (chords < ratio[:-1])).all()
    assert ratio.max() < 0.5


def test_picture_shows_the_mechanism_at_each_moment_and_both_curves(tmp_path):
    module = imported(FOLDER / "parallelogram_transmission.py")
    figure = module.picture()
    figure.savefig(tmp_path / "transmission.png")
    assert (tmp_path / "transmission.png").stat().st_size > 10_000
    shapes, curves = figure.axes
    # of each member a line, and the hinges
    assert len(shapes.lines) == (len(module.MOMENTS) + 1) * 5
    alpha, beta = np.radians(curves.lines[1].get_data())
    assert np.diff(alpha)[-1] < 0.0 < np.diff(alpha)[0]
    chosen = module.expected(module.flexible(), "nodes.1.angle")
    before = alpha.argmax() + 1
    # Straight between the 50 points of the curve.
    on_curve = np.interp(chosen, alpha[:before], beta[:before])
    assert on_curve == pytest.approx(module.expected(module.flexible(), "nodes.5.angle"), abs=2e-3)


def test_a_wrong_point_of_the_strip_and_bounds_that_are_too_narrow_are_noticed(monkeypatch):
    # One of its own: what it has computed once it keeps.
    module = imported.__wrapped__(FOLDER / "identification_of_stiffness.py")
    shot, noise = module.shot, module.noise
    monkeypatch.setattr(module, "shot", lambda force: shot(force) * (1.0 + 1e-5))
    assert min(module.recovered().values()) > module.TOLERANCE
    monkeypatch.setattr(module, "EXPERIMENTS", 20)
    monkeypatch.setattr(module, "noise", lambda: 3.0 * noise())
    assert min(module.trusted().values()) > module.TOLERANCE


def test_picture_shows_the_strip_and_its_ellipse(tmp_path):
    module = imported(FOLDER / "identification_of_stiffness.py")
    figure = module.picture()
    figure.savefig(tmp_path / "strip.png")
    strips, ellipse = figure.axes
    assert len(module.table()) == 5
    curve, estimate = (ellipse.lines[i].get_xydata() for i in (0, 5))
    assert curve.mean(axis=0) == pytest.approx(estimate[0], rel=0.01)
    assert len(strips.lines) >= 2 * len(module.FORCES)


def test_links_that_do_not_become_as_stiff_as_said_are_noticed(monkeypatch):
    module = imported(FOLDER / "mechanism_two_loops.py")
    scene = module.scene
    monkeypatch.setattr(module, "scene", lambda kind="flexible", stiffer=1.0: scene(kind, stiffer**0.99))
    assert min(module.check().values()) > module.TOLERANCE


def test_tables_of_the_two_loops_have_a_row_a_kind_and_a_row_a_stiffness(monkeypatch):
    module = imported(FOLDER / "mechanism_two_loops.py")
    monkeypatch.setattr(module, "RUNS", 1)
    monkeypatch.setattr(module, "STIFFER", module.STIFFER[:2])
    assert [line.split()[0] for line in module.side_by_side()[1:]] == list(module.KINDS)
    assert [float(line.split()[0]) for line in module.agreement()[1:]] == list(module.STIFFER)


DESIGNS = (
    "constant_force_flexure",
    "flexure_hinge_least_shift",
    "rest_shape_hangs_straight",
    "shape_control_three_moments",
)


def test_a_wrong_closed_form_of_the_rest_shape_is_noticed(monkeypatch):
    module = imported(FOLDER / "rest_shape_hangs_straight.py")
    monkeypatch.setattr(module, "EXACT", module.EXACT * (1.0 + 1e-6))
    assert max(module.check().values()) > module.TOLERANCE
