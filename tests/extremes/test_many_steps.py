"""Ten thousand steps in time, and steps far too short and too long."""

import numpy as np
import pytest

from benchmarks import extremes
from sfetcas import SolveError

pytestmark = pytest.mark.usefixtures("interpreted")


def test_energy_and_momenta_stay_over_ten_thousand_steps():
    motion = extremes.solve_motion(extremes.flight(False, 10_000))
    assert motion.count == 10_000
    # Rounding of 1e4 steps, 1e-16 each, over a step of 1e-2 in the velocities.
    assert extremes.drift(motion) < 1e-9
    assert motion.violation["closings"] < 1e-13
    assert motion.notes == ()


@pytest.mark.parametrize(("step", "told"), [(1e-9, "so short that rounding decides"), (1e2, "the step is long for it")])
def test_steps_that_are_no_steps_are_told(step, told):
    """Radau takes the shortest, generalised-alpha the longest; without a word neither was an answer."""
    method = "radau-3" if step < 1.0 else "generalised-alpha"
    motion = extremes.solve_motion(extremes.pendulum(step, 20.0 * step if step < 1.0 else 5.0 * step, method))
    assert len(motion.notes) == 1
    assert told in motion.notes[0]


@pytest.mark.parametrize("method", ["radau-3", "radau-2", "generalised-alpha", "conserving"])
@pytest.mark.parametrize("step", [1e-6, 1e-2])
def test_steps_that_suit_are_not(step, method):
    motion = extremes.solve_motion(extremes.pendulum(step, 20.0 * step, method))
    assert motion.notes == ()
    # At first the tip falls freely, by g t^2 / 2; as a stiff bar would, by 3/4 of g t^2.  5e-3 is what steps leave.
    fallen = -motion.last.position("B")[1] / (9.81 * (20.0 * step) ** 2)
    assert 0.5 - 5e-3 < fallen < 0.75 + 5e-3


@pytest.mark.parametrize("method", ["radau-3", "radau-2", "conserving"])
def test_step_beyond_all_periods_is_refused(method):
    with pytest.raises(SolveError, match=r"Newton's method did not converge at 0 s in a step of 1e\+06 s"):
        extremes.solve_motion(extremes.pendulum(1e6, 5e6, method))


def test_a_damped_motion_may_lose_energy_without_a_note():
    scene = extremes.pendulum(0.01, 2.0, "radau-3").to_dict()
    scene["sections"]["s"]["drag"] = 5.0
    motion = extremes.solve_motion(extremes.Scene.from_dict(scene))
    assert np.ptp(motion.energies()) > 0.5
    assert motion.notes == ()
