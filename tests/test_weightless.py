"""Flexible members without mass that move between masses."""

import re

import numpy as np
import pytest
from scipy.linalg import eigh

import sfetcas
from sfetcas import Scene, SceneError

STIFFNESS = np.array([[12.0, -6.0], [-6.0, 4.0]])
"""Of a clamped strip of one metre and 1 N m2, by deflection and angle of its end."""
MASS = np.diag([1.0, 0.1])


def scene(section, load, **analysis):
    """A clamped strip with a mass at its end."""
    end = {"position": [1, 0], "mass": MASS[0, 0], "inertia": [MASS[1, 1]] * 3}
    return Scene.from_dict(
        {
            "sections": {"s": section},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": end},
            "members": {"strip": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"tip": {"type": "force", "node": "B", "value": load}} if any(load) else {},
            "analysis": analysis,
        }
    )


def test_modes_are_those_of_two_freedoms():
    modes = sfetcas.solve(scene({"EI3": 1.0, "rhoA": 0.0}, [0, 0], type="modes", modes=2, accuracy=1e-8))
    np.testing.assert_allclose(modes.omega, np.sqrt(eigh(STIFFNESS, MASS)[0]), rtol=1e-8)


@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha"])
def test_small_motion_is_that_of_two_freedoms(integrator):
    """Under a small sudden force, against the sum of the two modes."""
    force, end = 1e-4, 2.0
    motion = sfetcas.solve(
        scene({"EI3": 1.0, "rhoA": 0.0}, [0, force], type="dynamic", end=end, integrator=integrator, step=0.005)
    )
    squares, shapes = eigh(STIFFNESS, MASS)
    swing = shapes @ ((shapes.T @ [force, 0.0]) * (1.0 - np.cos(np.sqrt(squares) * end)) / squares)
    # Second order methods with some four hundred steps in two periods.
    assert motion.steps[-1].position("B")[1] == pytest.approx(swing[0], rel=2e-3)


def test_large_motion_keeps_energy():
    motion = sfetcas.solve(scene({"EI3": 1.0, "rhoA": 0.0}, [0, 1.5], type="dynamic", end=2.0, accuracy=1e-5))
    energies = np.array([sum(instant.energies) for instant in motion.steps])
    # Ten times the accuracy of the positions.
    assert np.abs(energies).max() < 1e-4
    assert motion.steps[-1].position("B")[1] > 0.2


def test_refused():
    with pytest.raises(SceneError, match=re.escape("found the weightless member 'strip' with the integrator")):
        sfetcas.solve(scene({"EI3": 1.0, "rhoA": 0.0}, [0, 1], type="dynamic", end=1.0, integrator="conserving"))
    massless = {"B": {"position": [1, 0]}, "A": {"position": [0, 0], "support": "clamped"}}
    with pytest.raises(SceneError, match="scene without mass, which could not be set in motion"):
        scene({"EI3": 1.0, "rhoA": 0.0}, [0, 1], type="dynamic", end=1.0).replace(nodes=massless)
    with pytest.raises(SceneError, match="the key 'rhoA' is missing"):
        scene({"EI3": 1.0}, [0, 1], type="dynamic", end=1.0)
    with pytest.raises(SceneError, match=re.escape("sections.s.rhoA: found -1, accepted: a number above zero")):
        scene({"EI3": 1.0, "rhoA": -1.0}, [0, 1], type="dynamic", end=1.0)
