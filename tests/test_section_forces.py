"""What sections carry in motions and in rotating axes, where masses and dampers act along members."""

import numpy as np
import pytest

from sfetcas import Scene, solve

AT = np.array([0.0, 0.15, 0.4, 0.75, 1.0])


def bar(kind, section, nodes=None, **more):
    """A straight member along x from A at 0.5 to B at 1.5."""
    places = {"A": {"position": [0.5, 0], "support": "clamped"}, "B": {"position": [1.5, 0]}} | (nodes or {})
    members = {"m": {"nodes": ["A", "B"], "section": "s", "type": kind}}
    return Scene.from_dict({"sections": {"s": section}, "nodes": places, "members": members, **more})


# -- rotating axes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["flexible", "rigid"])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_bar_that_goes_round_carries_what_is_beyond(kind, dimension):
    """N = rhoA Om^2 (R^2 - r^2) / 2 + m Om^2 R with a mass at its tip."""
    section = {"EI3": 1.0, "rhoA": 2.0} | ({"EI2": 1.0, "GJ": 1.0} if dimension == "space" else {})
    tip = {"B": {"position": [1.5, 0], "mass": 0.3}}
    step = solve(bar(kind, section, tip, dimension=dimension, rotating=[0, 0, 3.0])).last
    r = 0.5 + AT
    found = step.along("m", AT)
    np.testing.assert_allclose(found["force"][:, 0], 9.0 * (1.5**2 - r**2) + 9.0 * 0.3 * 1.5, rtol=1e-12, atol=1e-12)
    assert np.abs(found["moment"]).max() < 1e-12
    assert step.reaction("A")[0] == pytest.approx([-18.0 - 4.05, 0.0, 0.0])


@pytest.mark.parametrize("kind", ["flexible", "rigid"])
def test_section_axes_of_a_pitched_blade_twist_it(kind):
    """The propeller moment, by length rho (I3 - I2) Om^2 sin(2 p) / 2, turns the broad side of a blade flat."""
    pitch, inertia, speed = 0.4, np.array([0.5, 0.4, 0.1]), 2.0
    section = {"EI2": 1e8, "EI3": 1e8, "GJ": 1e8, "rhoA": 1.0, "rhoI": inertia.tolist()}
    scene = bar(kind, section, dimension="space", rotating=[0, 0, speed])
    coarse = {"members.m.element": "SFET3", "members.m.elements": 1} if kind == "flexible" else {}
    step = solve(scene.replace({"members.m.b2": [0, np.cos(pitch), np.sin(pitch)], **coarse})).last
    torque = step.along("m", AT)["moment"][:, 0]
    # Of particles on the section axes, b2 and b3 among them, that have these moments of inertia.
    weights = 0.5 * inertia.sum() - inertia
    expected = -(weights[1] - weights[2]) * speed**2 * np.sin(pitch) * np.cos(pitch) * (1.0 - AT)
    np.testing.assert_allclose(torque, expected, rtol=1e-8, atol=1e-12)
    assert step.reaction("A")[1][0] == pytest.approx(-torque[0])


def test_energies_in_rotating_axes_are_zero_in_the_undeformed_scene():
    still = solve(bar("flexible", {"EI3": 1.0, "rhoA": 2.0}, rotating=[0, 0, 3.0])).last
    assert still.energy["loads"] == pytest.approx(0.0, abs=1e-12)
    # A mass on a spring moves from 1 to r: k (r - 1) = m Om^2 r.
    nodes = {"A": {"position": [1, 0], "mass": 2.0, "support": "slider", "direction": [1, 0]}}
    nodes |= {"B": {"position": [1, 0.1], "mass": 0.0}}
    spring = {"k": {"type": "translational", "node": "A", "direction": [1, 0], "stiffness": 8.0}}
    members = {"m": {"nodes": ["A", "B"], "type": "rigid"}}
    scene = Scene.from_dict({"nodes": nodes, "members": members, "springs": spring, "rotating": [0, 0, 1.0]})
    step = solve(scene).last
    r = step.position("A")[0]
    assert r == pytest.approx(8.0 / 6.0)
    assert step.energy["loads"] == pytest.approx(-(r**2 - 1.0))
    assert step.energy["elastic"] == pytest.approx(4.0 * (r - 1.0) ** 2)


# -- motions ---------------------------------------------------------------------------------------------


def test_a_rigid_bar_that_falls_carries_its_inertia():
    """Let go at a level: the shear is rhoA g (3/4 (L^2 - x^2) / L - (L - x)), and its moment skew."""
    scene = bar("rigid", {"rhoA": 2.0}, {"A": {"position": [0.5, 0], "support": "hinge"}}, gravity=[0, -9.81])
    motion = solve(scene.replace({"analysis": {"type": "dynamic", "end": 0.02, "output": 0.02, "accuracy": 1e-6}}))
    found, weight = motion.at(0.0).along("m", AT), 2.0 * 9.81
    shear = weight * (0.75 * (1.0 - AT**2) - (1.0 - AT))
    np.testing.assert_allclose(found["force"][:, 1], shear, atol=1e-6 * weight)
    np.testing.assert_allclose(found["moment"][:, 2], 0.25 * weight * AT * (1.0 - AT) ** 2, atol=1e-6 * weight)


@pytest.mark.parametrize("section", [{}, {"rhoI": [0.02, 0.01, 0.01]}, {"damping": 0.02}, {"drag": 0.5}])
@pytest.mark.parametrize("kind", ["flexible", "rigid"])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_ends_carry_what_acts_on_them(kind, section, dimension):
    """A force and a couple at the tip, and at the foot what the ground does."""
    more = {"EI2": 1.0, "GJ": 1.0} if dimension == "space" else {}
    loads = {
        "f": {"type": "force", "node": "B", "value": [0.0, 0.6]},
        "c": {"type": "moment", "node": "B", "value": 0.2},
    }
    if dimension == "space":
        loads |= {"c": {"type": "moment", "node": "B", "value": [0.05, 0.1, 0.2]}}
    held = "clamped" if kind == "flexible" else "hinge" if dimension == "plane" else "ball"
    scene = bar(kind, {"EI3": 1.0, "rhoA": 1.0, **more, **section}, {"A": {"position": [0.5, 0], "support": held}})
    if kind == "rigid" and dimension == "space":
        # A rod on a ball spins without resistance else.
        scene = scene.replace({"nodes.B.inertia": [0.01, 0.01, 0.01]})
    analysis = {"type": "dynamic", "end": 0.2, "output": 0.1, "step": 0.005}
    more = {"dimension": dimension, "loads": loads, "analysis": analysis, "gravity": [0, -1.0]}
    if kind == "flexible":
        more |= {"members.m.elements": 8, "members.m.element": "SFET4"}
    last = solve(scene.replace(more)).last
    found = last.along("m", [0.0, 1.0])
    (force, moment), scale = last.reaction("A"), np.abs(last.along("m", AT)["moment"]).max()
    np.testing.assert_allclose(found["force"][0], -force, atol=1e-9)
    np.testing.assert_allclose(found["moment"][0], -moment, atol=1e-9)
    # As near as eight elements in steps of 5 ms are to the waves of sudden loads.
    np.testing.assert_allclose(found["force"][1], [0, 0.6, 0], atol=1e-3)
    inertia = scene.nodes["B"].inertia
    couple = np.atleast_1d(loads["c"]["value"])
    if inertia is None:
        np.testing.assert_allclose(found["moment"][1][3 - len(couple) :], couple, atol=1e-2 * scale)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_curvatures_and_strains_of_a_damped_member_are_those_of_its_moments(dimension):
    """Moments have the part of dampers, as Kelvin and Voigt say; what is left bends the sections as they are bent."""
    section = {"EI3": 1.0, "rhoA": 1.0, "EA": 50.0, "GA2": 20.0, "damping": 0.03}
    section |= {"EI2": 0.5, "GJ": 0.7, "GA3": 30.0} if dimension == "space" else {}
    value = [3.0, 1.0, 0.5][: 3 if dimension == "space" else 2]
    loads = {"f": {"type": "force", "node": "B", "value": value}}
    analysis = {"type": "dynamic", "end": 0.3, "output": 0.1, "accuracy": 1e-5}
    last = solve(bar("flexible", section, loads=loads, analysis=analysis, dimension=dimension)).last
    found, fields = last.along("m", AT), last.fields
    np.testing.assert_allclose(
        found["curvature"], fields._changes("m", AT), atol=3e-5 * np.abs(found["curvature"]).max()
    )
    np.testing.assert_allclose(found["strain"], fields._strains("m", AT), atol=1e-4 * np.abs(found["strain"]).max())
    # The dampers carry much of it.
    assert np.abs(found["moment"] - found["curvature"])[:, 2].max() > 0.05


# -- small members -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_stiff_small_member_carries_what_a_stiff_flexible_one_does(dimension):
    """Its weight, a load that rises along it, and what its end is given."""
    section = {"EI3": 1e6, "rhoA": 2.0} | ({"EI2": 1e6, "GJ": 1e6} if dimension == "space" else {})
    loads = {"f": {"type": "force", "node": "B", "value": [0.5, -1.0, 0.7][: 3 if dimension == "space" else 2]}}
    loads["wind"] = {"type": "distributed", "member": "m", "value": [0, 3.0], "profile": {"polynomial": [0, 1]}}
    if dimension == "space":
        loads["c"] = {"type": "moment", "node": "B", "value": [0.3, 0.2, 0.1]}
    more = {"loads": loads, "gravity": [0, -9.81], "dimension": dimension}
    small, flexible = (solve(bar(kind, section, **more)).last.along("m", AT) for kind in ("small", "flexible"))
    # Both bend by 1e-6 of their length.
    np.testing.assert_allclose(small["force"], flexible["force"], atol=1e-4)
    np.testing.assert_allclose(small["moment"], flexible["moment"], atol=1e-4)
    assert np.abs(np.diff(flexible["moment"][:, 2], 2)).max() > 0.5
