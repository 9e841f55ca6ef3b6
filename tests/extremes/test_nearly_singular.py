"""Rings nearly closed, links nearly in line, columns nearly at their critical load."""

import numpy as np
import pytest

from benchmarks import extremes
from sfetcas import SceneError, SolveError, Status
from sfetcas.equilibria.statics import solve
from sfetcas.equilibria.ways import CHANGE_POINT

PLANE_AND_SPACE = pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
CRITICAL = 0.25 * np.pi**2
ONE, UNLIKE, ALIKE = {"EI3": 1.0}, {"EI2": 5.0, "EI3": 1.0, "GJ": 1.0}, {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}


@PLANE_AND_SPACE
@pytest.mark.parametrize("exponent", [0, 3, 8, 15])
def test_ring_that_is_nearly_closed(exponent, space):
    scene, end = extremes.ring(10.0**-exponent, space)
    step = solve(scene).last
    assert np.linalg.norm(step.position("B") - end) / scene.size <= step.certificate.error_estimate


def test_ring_that_is_closed_by_its_angle_is_refused():
    with pytest.raises(SceneError, match=r"accepted: an angle between -2 pi and 2 pi"):
        extremes.ring(0.0, False)


@pytest.mark.parametrize("kind", ["rigid", "flexible", "small"])
@pytest.mark.parametrize("exponent", [1, 2, 4, 6, 12])
def test_four_bar_from_beside_its_dead_point(exponent, kind):
    scene, place = extremes.four_bar(10.0**-exponent, kind)
    step = solve(scene).last
    right = np.linalg.norm(step.position("C") - place) < 1e-12  # closings are met to rounding
    assert right or CHANGE_POINT in step.notes
    # A hundredth of a radian is far enough, and nothing to be told.
    assert (CHANGE_POINT in step.notes) == (exponent > 2)


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
@pytest.mark.parametrize("exponent", [1, 3, 5, 8, 12])
def test_two_bars_nearly_in_line(exponent, kind):
    rise = 10.0**-exponent
    if exponent > 6:
        with pytest.raises(SolveError, match=r"^no finite force holds .*\(free to move: members AB, BC"):
            solve(extremes.bars(rise, kind))
        return
    step = solve(extremes.bars(rise, kind)).last
    # A length of 1, rounded, tells the rise to 1e-16 over its square.
    assert -2.0 * rise * step.reaction("A")[0][0] == pytest.approx(1.0, rel=1e-12 + 1e-15 / rise**2)


@pytest.mark.parametrize("section", [ONE, UNLIKE, ALIKE], ids=["plane", "unlike", "alike"])
@pytest.mark.parametrize("beyond", [-1e-6, 0.0, 1e-6, 1e-4, 0.1])
def test_column_beside_its_critical_load(beyond, section):
    space = len(section) > 1
    solution = solve(extremes.column(beyond, section, space), accuracy=1e-8)
    step, axis = solution.last, np.array(extremes.turned([1, 0, 0], space))
    height = np.linalg.norm(np.cross(step.position("B"), axis))
    amplitude = extremes.column_amplitude(CRITICAL * (1.0 + beyond))
    # By the square root of what is beyond: 2 sqrt(2 beyond) / (pi / 2), to the next order.
    assert amplitude == pytest.approx(
        np.sqrt(max(beyond, 0.0)) * 4.0 * np.sqrt(2.0) / np.pi, rel=1.2 * abs(beyond) + 1e-9
    )
    assert height == pytest.approx(amplitude, abs=1e-8)
    # A section alike in all directions may bend to any side: the energy is flat along these.
    flat = beyond == 0.0 or (section is ALIKE and beyond > 0.0)
    assert step.certificate.stable == ("neutral" if flat else True)
    # Along a flat energy rounding once led astray from mesh to mesh, and meshes to 5e4 elements.
    assert solution.status is Status.SOLVED
    assert step.model.mesh.elements <= 16


@pytest.mark.parametrize("beyond", [-1e-8, 1e-8])
def test_column_too_near_its_critical_load_is_neutral(beyond):
    assert solve(extremes.column(beyond, ONE, False)).last.certificate.stable == "neutral"
