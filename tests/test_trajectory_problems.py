"""The problems that are motions with optimal controls: what their pictures show, and that they notice errors.

That each checks itself is in ``test_examples.py``.
"""

import numpy as np
import pytest
from test_examples import FOLDER, imported

from sfetcas.errors import SceneError


def drawn(figure, path):
    figure.savefig(path)
    return path.stat().st_size


@pytest.fixture(scope="module")
def arm():
    return imported(FOLDER / "arm_rest_to_rest.py")


@pytest.fixture(scope="module")
def slew():
    return imported(FOLDER / "slew_in_least_time.py")


def test_commands_of_the_rigid_arm_turn_it_by_the_angle_from_rest_to_rest(arm):
    t = np.linspace(0.0, arm.TIME, 20001)
    for history in (arm.bang_bang(), arm.smooth()):
        acceleration = np.array([history.factor(x) for x in t[:-1]]) / arm.inertia()
        step = t[1]
        # Sums of 20,000 rectangles, which err by a step at the jumps.
        assert acceleration.sum() * step == pytest.approx(0.0, abs=1e-3)
        assert np.cumsum(acceleration).sum() * step**2 == pytest.approx(arm.ANGLE, rel=1e-3)


def test_picture_of_the_arm_shows_three_commands_and_what_they_leave(arm, tmp_path):
    figure = arm.picture(2, 16)
    torques, left, shapes = figure.axes
    assert [line.get_label() for line in torques.lines] == list(arm.COMMANDS)
    worst = {line.get_label(): line.get_ydata().max() for line in left.lines}
    assert worst["optimal"] < 0.1 * min(worst["bang-bang"], worst["smooth"])
    assert len(shapes.lines) == 14
    assert drawn(figure, tmp_path / "arm.png") > 10_000


def test_a_wrong_inertia_of_the_arm_is_noticed(arm, monkeypatch):
    monkeypatch.setattr(arm, "inertia", lambda: 1.01 * (arm.HUB + 1.0 / 3.0 + arm.TIP))
    assert arm.check(2, 16)["effort of the rigid arm"] > arm.TOLERANCE


def test_switches_of_the_slew_are_counted_and_cost_time(slew):
    assert slew.switches(np.array([1.0, 0.3, -1.0, -0.2, 1.0])) == 2
    assert slew.linear_time() > slew.rigid_time()


def test_bare_beam_of_the_slew_has_the_frequencies_of_handbooks(slew, monkeypatch):
    monkeypatch.setattr(slew, "HUB", 0.0)
    monkeypatch.setattr(slew, "TIP", 0.0)
    wave = np.sqrt(slew.frequencies(2) * np.sqrt(slew.DENSITY / slew.STIFFNESS))
    # Pinned and free, k L: digits of handbooks.
    np.testing.assert_allclose(wave, [3.926602, 7.068583], rtol=1e-6)


def test_a_law_of_another_size_misses_the_rigid_links_moment(monkeypatch):
    module = imported(FOLDER / "parallelogram_follows_law.py")
    assert module.miss("rigid links", 1, 10) < module.TOLERANCE
    right = module.rigid_moment()
    monkeypatch.setattr(module, "rigid_moment", lambda: type(right)(t=right.t, polynomial=[[0.0], [0.0]]))
    module.response.cache_clear()
    assert module.miss("rigid links", 1, 10) == pytest.approx(1.0)


def test_pendulum_is_swung_up_by_less_than_its_weight(tmp_path):
    module = imported(FOLDER / "pendulum_swing_up.py")
    swing = module.swing(0, 24)
    angle = swing.motion.answer("nodes.hinge.angle").ravel()
    assert angle[-1] == pytest.approx(np.pi, abs=1e-6)
    # It swings back before it rises.
    assert angle.min() < -0.3
    assert np.abs(swing.motion.control(module.TORQUE)).max() < 0.5 * module.WEIGHT
    with pytest.raises(SceneError, match="answer"):
        swing.motion.answer("nodes.tip.position")
