"""Members very stiff, short or unlike beside others, against arcs, linear theory and elliptic integrals."""

import numpy as np
import pytest
from scenes import elastica

from benchmarks import extremes
from sfetcas.equilibria.single import HIDDEN
from sfetcas.equilibria.statics import solve

PLANE_AND_SPACE = pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
CRITICAL = 0.25 * np.pi**2


@PLANE_AND_SPACE
@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 1e-3, 1.0, 1e6, 1e12])
def test_stiff_member_beside_a_soft_one(ratio, space):
    scene, place = extremes.series(ratio, space)
    step = solve(scene).last
    assert np.linalg.norm(step.position("C") - place) <= step.certificate.error_estimate
    # Statics alone: the moment is the same all along.
    moment = extremes.turned([0, 0, 2.0 * min(1.0, ratio)], space)
    np.testing.assert_allclose(step.reaction("A")[1], np.negative(moment), rtol=1e-9, atol=1e-12 * min(1.0, ratio))


@PLANE_AND_SPACE
@pytest.mark.parametrize("ratio", [1e-12, 1e-3, 1.0, 1e6, 1e12])
def test_frame_with_a_beam_of_any_stiffness(ratio, space):
    step = solve(extremes.portal(ratio, space)).last
    sway = (step.position("B") - extremes.turned([0, 1, 0], space)) @ np.array(extremes.turned([1, 0, 0], space))
    # Linear theory leaves out squares of the sway, 1e-5; twelve digits of the stiffness leave 1e-6 of it.
    assert sway == pytest.approx(1e-5, rel=1e-5)


@pytest.mark.parametrize("name", ["EI2", "EI3", "GJ"])
@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e6])
def test_quarter_circle_of_unlike_stiffnesses(name, ratio):
    step = solve(extremes.bend(name, ratio), accuracy=1e-9).last
    up = np.array(extremes.turned([0, 0, 1], True))
    # Squares of the deflection of 1e-5, times what is stiff beside what is soft.
    assert step.position("B") @ up == pytest.approx(1e-5, abs=1e-9)


def in_line(share, push, across):
    return solve(extremes.with_short_member(share, push, across)).last


@pytest.mark.parametrize("exponent", [1, 6, 9, 12])
def test_short_member_beside_long_ones(exponent):
    share = 10.0**-exponent
    step = in_line(share, 0.0, 10.0)
    error = np.linalg.norm(step.position("D")[:2] - (1.0 + share) * elastica(10.0))
    assert error <= step.certificate.error_estimate
    # Nothing neutral about it, though its own stiffness is 1e24 times that of all.
    assert step.certificate.stable is True


@pytest.mark.parametrize("exponent", [3, 6, 9, 11])
def test_short_member_hides_no_instability(exponent):
    """A column of three members beyond its critical load: rounding of the short one hid that it had to leave."""
    share = 10.0**-exponent
    step = in_line(share, 1.2 * CRITICAL, 0.0)
    height = (1.0 + share) * extremes.column_amplitude(1.2 * CRITICAL)
    assert abs(step.position("D")[1]) == pytest.approx(height, abs=step.certificate.error_estimate + 1e-9)
    assert step.certificate.stable is True


def with_stiff_branch(ratio, beyond):
    table = {
        "sections": {"s": {"EI3": 1.0}, "stiff": {"EI3": ratio}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "C": {"position": [1, 0.3]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "stiff"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [-(1.0 + beyond) * CRITICAL, 0]}},
    }
    return solve(extremes.Scene.from_dict(table)).last


@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e9])
def test_stiff_branch_hides_no_instability(ratio):
    step = with_stiff_branch(ratio, 0.2)
    height = extremes.column_amplitude(1.2 * CRITICAL)
    assert abs(step.position("B")[1]) == pytest.approx(height, abs=step.certificate.error_estimate + 1e-9)


def test_what_rounding_hides_is_told():
    """At a ratio of 1e15 rounding is as large as all that the column resists: straight or not is not to be told."""
    step = with_stiff_branch(1e15, 0.2)
    assert step.certificate.stable == "neutral"
    assert HIDDEN in step.notes
    assert HIDDEN not in with_stiff_branch(1e3, 0.2).notes
