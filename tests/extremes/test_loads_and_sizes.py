"""Loads, turns, slenderness and units over many decades, against elliptic integrals, arcs and scaling."""

import numpy as np
import pytest
from scenes import cantilever, elastica, made

from benchmarks import extremes
from sfetcas.equilibria.statics import solve

PLANE_AND_SPACE = pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])


@pytest.mark.parametrize("load", [0.1, 1.0, 10.0, 100.0, 1e4, 9e4, 2e5])
def test_tip_of_the_elastica_by_carlson_is_that_by_quadrature(load):
    # Two ways of integration, each to rounding of what it adds up.
    np.testing.assert_allclose(extremes.elastica_tip(load)[:2], elastica(load), atol=2e-14)


def test_tip_of_the_elastica_goes_over_into_linear_theory_and_into_a_right_angle():
    below, above = extremes.elastica_tip(0.99999e-5), extremes.elastica_tip(1.00001e-5)
    # Between the two forms lies 2e-10 of load; the linear one leaves out 0.04 load^3.
    assert (above - below)[1] == pytest.approx(2e-10 / 3.0, rel=1e-4)
    below, above = extremes.elastica_tip(0.99999e5), extremes.elastica_tip(1.00001e5)
    slopes = [-np.sqrt(0.5) * 1e5**-1.5, 0.5 * (2.0 - np.sqrt(2.0)) * 1e5**-1.5]
    np.testing.assert_allclose((above - below)[:2], 2.0 * np.array(slopes), rtol=1e-6)


@PLANE_AND_SPACE
@pytest.mark.parametrize("load", [1e-8, 1e-4, 1.0, 1e4, 1e8])
def test_force_of_any_size(load, space):
    scene = extremes.cantilever(load, space)
    step = solve(scene).last
    tip = np.array(extremes.turned(extremes.elastica_tip(load), space))
    error = np.linalg.norm(step.position("B") - tip)
    # The estimate bounds the error of the mesh; rounding of a straight member and of the turned axes is 1e-15.
    assert error <= step.certificate.error_estimate + 1e-14
    assert step.certificate.stable is True
    if load < 1e-3:
        # What is small is right in its own digits: the load turns 1e-16 of unity where the axes are slanted.
        across = extremes.turned([0, 1, 0], space) @ step.position("B")
        assert across == pytest.approx(load / 3.0, rel=1e-8, abs=3e-16 if space else 0.0)
    # Tangents are of length one, and positions their integral, to rounding: the bound that inextensible asks for.
    assert extremes.length_error(step) < 1e-12


def test_length_error_sees_a_member_that_is_longer(monkeypatch):
    step = solve(extremes.cantilever(10.0)).last
    place = np.add(step.position("A"), [1e-9, 0.0, 0.0])
    monkeypatch.setattr(type(step), "position", lambda self, node: place)
    assert extremes.length_error(step) == pytest.approx(1e-9, rel=1e-4)


@PLANE_AND_SPACE
@pytest.mark.parametrize("turns", [1e-3, 0.5, 3.3, 10.25])
def test_rolled_up(turns, space):
    moment = 2.0 * np.pi * turns
    step = solve(extremes.cantilever(0.0, space, moment=moment)).last
    end = np.array([np.sin(moment), 1.0 - np.cos(moment), 0.0]) / moment
    error = np.linalg.norm(step.position("B") - extremes.turned(end, space))
    if space and turns > 10.0:
        # Unlike stiffnesses let it leave the plane on the way: another equilibrium, as its note says.
        assert any("other equilibria branch off there" in note for note in step.notes)
        return
    # What is estimated for angles that are exact; of quaternions the error of the same size.
    assert error <= 1.1 * step.certificate.error_estimate + 1e-14


def test_many_turns_are_counted():
    """A hundred turns are 786 elements: no more than once, as it takes seconds."""
    table = cantilever()
    table["loads"] = {"m": {"type": "moment", "node": "B", "value": 2.0 * np.pi * 40.25}}
    step = solve(made(table)).last
    radius = 1.0 / (2.0 * np.pi * 40.25)
    # Rounding of 250 rad is 3e-14, over some hundred elements.
    np.testing.assert_allclose(step.position("B"), [radius, radius, 0.0], atol=1e-12)
    assert step.angle("B") == pytest.approx(2.0 * np.pi * 40.25, rel=1e-13)


@pytest.mark.parametrize("shape", ["rectangle", "circle"])
@pytest.mark.parametrize("slenderness", [5.0, 1e3, 1e6])
def test_slenderness_by_material(slenderness, shape):
    step = solve(extremes.material_strip(slenderness, shape, 10.0)).last
    error = np.linalg.norm(step.position("B") - extremes.elastica_tip(10.0))
    assert error <= step.certificate.error_estimate
    # The same beam, whatever its section: mesh and answer are those of EI = 1, to rounding of the products.
    same = solve(extremes.material_strip(100.0, shape, 10.0)).last.position("B")
    np.testing.assert_allclose(step.position("B"), same, atol=1e-13)


@pytest.mark.parametrize(("length", "force"), [(1e-9, 1e-6), (1e-9, 1e6), (1e9, 1e-6), (1e9, 1e6), (1e-9, 1e24)])
def test_units_do_not_matter(length, force):
    one, other = (solve(extremes.frame(*units)).last for units in ((1.0, 1.0), (length, force)))
    # Rounding only: everything is made dimensionless first.
    np.testing.assert_allclose(other.position("B") / length, one.position("B"), atol=1e-14)
    np.testing.assert_allclose(other.reaction("A")[0] / force, one.reaction("A")[0], atol=1e-11)
    np.testing.assert_allclose(other.reaction("A")[1] / force / length, one.reaction("A")[1], atol=1e-11)
    assert other.certificate.error_estimate == pytest.approx(one.certificate.error_estimate, rel=1e-6)
