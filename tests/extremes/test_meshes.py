"""One element and ten thousand; nodes of quaternions more than half a turn apart."""

import numpy as np
import pytest
from scenes import elastica

from benchmarks import extremes
from sfetcas import SolveError
from sfetcas.equilibria.statics import solve

PLANE_AND_SPACE = pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])


@PLANE_AND_SPACE
@pytest.mark.parametrize("order", range(2, 10))
def test_one_element_knows_its_error(order, space):
    tip = np.array(extremes.turned([*elastica(10.0), 0.0], space))
    step = solve(extremes.cantilever(10.0, space, element=f"SFET{order}", elements=1)).last
    error = np.linalg.norm(step.position("B") - tip)
    # Two elements are no limit: against them the error looks smaller than it is, by no more than a half at order 1.
    assert error <= 1.5 * step.certificate.error_estimate
    assert step.model.mesh.elements == 1
    # Its length is that of its rule, whatever the error.
    assert extremes.length_error(step) < 1e-12


def test_coarse_moments_are_told_where_positions_do_not_show_them():
    """Positions of a twisted rod are exact on any mesh, its moment is not: off by a half on one element SFET2."""
    step = solve(extremes.twisted(0.3, "SFET2", 1)).last
    assert step.certificate.error_estimate < 1e-12
    assert abs(step.reaction("B")[1][0] / (0.6 * np.pi) - 1.0) > 0.4
    assert any("section moments differ by 41 % of the largest" in note for note in step.notes)
    fine = solve(extremes.twisted(0.3, "SFET5", 2)).last
    assert not any("section moments" in note for note in fine.notes)


def test_ten_thousand_elements():
    step = solve(extremes.cantilever(10.0, element="SFET5", elements=10_000)).last
    # 1e4 elements of condition 1e8 would leave 1e-8 of differences; sums of tangents leave 1e-13.
    assert np.linalg.norm(step.position("B")[:2] - elastica(10.0)) < 1e-12
    assert step.certificate.error_estimate < 1e-12


MOST = {
    ("SFET2", 1): 0.6,
    ("SFET3", 1): 0.3,
    ("SFET3", 2): 0.6,
    ("SFET5", 1): 0.6,
    ("SFET5", 2): 1.3,
    ("SFET9", 1): 0.6,
}
"""Turns that elements can take: up to here the twist is found, if coarse."""


@pytest.mark.parametrize("turns", [0.6, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("mesh", MOST)
def test_turns_between_nodes_are_not_lost(turns, mesh):
    """Whole turns between nodes look like none: the twist is right, told to be coarse, or refused."""
    scene = extremes.twisted(turns, *mesh)
    if turns > MOST[mesh]:
        with pytest.raises(SolveError, match=r"asked for (turn|snap) .*: take more"):
            solve(scene)
        return
    step = solve(scene).last
    moment = step.reaction("B")[1][0] / (2.0 * np.pi * turns)
    told = any("section moments differ" in note for note in step.notes)
    # From a tenth on the note tells.
    assert told or moment == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("turns", [0.3, 1.0, 20.0])
def test_turns_are_followed_on_a_mesh_of_its_own(turns):
    step = solve(extremes.twisted(turns, None, None)).last
    # Elements of a fifteenth of a turn or less, of order 4: 1e-10 of the moment.
    assert not step.notes
    assert step.reaction("B")[1][0] == pytest.approx(2.0 * np.pi * turns, rel=1e-9)


@pytest.mark.parametrize("mesh", [("SFET2", 1), ("SFET3", 2), ("SFET5", 1)])
def test_moments_of_several_turns_on_one_element(mesh):
    scene = extremes.cantilever(0.0, True, moment=6.0 * np.pi, element=mesh[0], elements=mesh[1])
    with pytest.raises(SolveError, match="take more"):
        solve(scene)
