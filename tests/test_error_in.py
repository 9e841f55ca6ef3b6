"""Estimated errors of reactions and section forces in motions: against runs a hundred times as accurate."""

from pathlib import Path

import pytest

import sfetcas
from sfetcas.dynamics.motion import apart_in
from sfetcas.equilibria.quantities import Quantity

PROBLEMS = Path(__file__).parent.parent / "problems"

CASES = {
    "pendulum_flexible_smooth": ("reactions.A.force", "members.rod.moment at 0.5", "members.rod.force at 0.25"),
    "pendulums_rigid": ("reactions.A0.force", "reactions.A1.force"),
    "cantilever_falling": ("reactions.A.force", "members.rod.moment at 0.5", "members.rod.force at 0.25"),
    "slider_crank_motion": ("reactions.slider.force", "members.rod.moment at 0.5", "members.rod.force at 0.25"),
    "cantilever_force_pulse": ("reactions.A.moment", "members.rod.moment at 0.5", "members.rod.force at 0.25"),
    "elbow_force_pulse": ("reactions.A.force", "members.first.moment at 0.5", "members.first.force at 0.25"),
}


@pytest.mark.parametrize("name", CASES)
def test_estimates_bound_the_errors_and_are_not_far_from_them(name):
    scene = sfetcas.load(PROBLEMS / f"{name}.toml")
    near = sfetcas.solve(scene, accuracy=1e-5)
    for accuracy in (1e-2, 1e-3):
        motion = sfetcas.solve(scene, accuracy=accuracy)
        for text in CASES[name]:
            true = apart_in(Quantity.named(text, scene), motion.steps, near.steps)
            # The difference of two runs is the error of the first of them, and the second one is several orders better
            # where it converges by the fifth order of the integrator: measured 2.8 to 60 times the error.
            assert true <= motion.error_in(text) <= 300.0 * true, (accuracy, text)


def test_the_quantity_of_the_accuracy_has_the_estimate_of_the_answer():
    """But for what is taken off for the order, which is a factor of three at most."""
    scene, text = sfetcas.load(PROBLEMS / "pendulum_flexible_smooth.toml"), "reactions.A.force"
    motion = sfetcas.solve(scene, accuracy=1e-3, accuracy_of=text)
    assert motion.error_of == text
    assert motion.error_estimate <= motion.error_in(text) <= 3.0 * motion.error_estimate * (1.0 + 1e-12)
    assert motion.error_in("nodes.B.position") < motion.error_in(text)


def in_steps():
    given = {"type": "dynamic", "end": 0.1, "step": 0.05}
    return sfetcas.solve(sfetcas.load(PROBLEMS / "pendulum_flexible_smooth.toml").replace({"analysis": given}))


def test_one_run_has_none():
    motion = in_steps()
    assert motion.error_estimate is None
    assert motion.error_in("reactions.A.force") is None


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("reactions.Z.force", "found 'Z', accepted: A, B"),
        ("members.rod.moment", "accepted: members.rod.moment at 0.5, or another place"),
        ("members.rod.moment at 2", "found 2"),
        ("certificate.stable", "told of statics only"),
    ],
)
def test_wrong_names_are_refused(name, sentence):
    motion = in_steps()
    with pytest.raises(sfetcas.SceneError, match="name: ") as caught:
        motion.error_in(name)
    assert sentence in str(caught.value)


def test_ends_that_differ_are_compared():
    """With `until` the two runs end at times that differ, and here have no other common time but the begin."""
    table = sfetcas.load(PROBLEMS / "pendulums_rigid.toml").replace({"expect": ()})
    until = {"quantity": "nodes.B3.position", "component": 1, "below": 0.5}
    given = {"type": "dynamic", "end": 2.0, "output": 2.0, "until": until, "accuracy": 1e-3}
    motion = sfetcas.solve(table.replace({"analysis": given}))
    assert motion.last.time < 2.0
    one, two = motion.coarser[-1], motion.last
    assert one.time != two.time
    apart = abs(one.reaction("A3")[0] - two.reaction("A3")[0]).max()
    largest = max(abs(step.reaction("A3")[0]).max() for step in motion.steps)
    # Norms of vectors and their largest components differ by the root of three at most.
    assert motion.error_in("reactions.A3.force") >= apart / largest / 3.0**0.5 > 1e-9
