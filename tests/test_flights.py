"""Free flight over many lengths: what no force changes, and what gravity does to the centre of mass."""

import numpy as np
import pytest

from sfetcas import Analysis, CrossSection, Member, Node, Scene, solve
from sfetcas.description.sections import Polynomial

GRAVITY, VELOCITY = np.array([0.0, -2.0, 0.0]), np.array([3.0, 4.0, 0.0])


def thrown():
    """A rod thrown and left to bend as it turns, over five of its lengths."""
    return Scene(
        gravity=list(GRAVITY),
        sections={"s": CrossSection(EI3=1.0, rhoA=1.0, rhoI=[0.0, 0.0, 0.01])},
        # An angular velocity of 6 - 4 s moves the point s by 6 s - 2 s^2 against the end, on the mean by 7/3.
        nodes={"A": Node(position=[0, 0], velocity=[VELOCITY[0], VELOCITY[1] - 7.0 / 3.0]), "B": Node(position=[1, 0])},
        members={"rod": Member(nodes=["A", "B"], section="s", spin=Polynomial(polynomial=[6.0, -4.0]))},
        analysis=Analysis(type="dynamic", end=2.0, output=0.5, accuracy=1e-4),
    )


def test_centre_of_a_thrown_rod_flies_as_a_point_and_its_angular_momentum_stays():
    motion = solve(thrown())
    first = motion.steps[0].momentum
    for step in motion.steps:
        # Radau keeps the linear momentum to rounding, what it loses of the others is of the order of the accuracy.
        assert step.momentum["linear"] == pytest.approx(VELOCITY + GRAVITY * step.time, abs=1e-10)
        assert step.momentum["angular"] == pytest.approx(first["angular"], abs=1e-5)
        assert step.energy["total"] == pytest.approx(motion.steps[0].energy["total"], abs=1e-4)
