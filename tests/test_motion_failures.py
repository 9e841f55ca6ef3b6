"""Motions that cannot be: what is refused, what is given up, and up to where; kinks of histories."""

import re

import numpy as np
import pytest
from motions import FLAT, THICK, cantilever, changed, moved, tip

import sfetcas
from sfetcas import Scene, SceneError, SolveError, solve

pytestmark = pytest.mark.usefixtures("interpreted")


def refused(table, message, **keys):
    with pytest.raises(SceneError, match=re.escape(message)):
        moved(table, 1.0, **keys)


def test_nothing_has_mass():
    table = changed(cantilever(), sections__s={"EI3": 1.0})
    refused(table, "sections.s: the key 'rhoA' is missing")


def test_velocities_that_joints_forbid():
    free = changed(cantilever(), nodes__A={"position": [0, 0, 0], "velocity": [1, 0, 0]})
    refused(changed(free, nodes__B__velocity=[2, 0, 0]), "contradicts the joints")
    with pytest.raises(SceneError) as found:
        moved(changed(free, nodes__B__velocity=[2, 0, 0]), 1.0)
    assert str(found.value).startswith("nodes.B.velocity")
    rigid = changed(free, members__m__type="rigid", members__m__spin=1.0, nodes__B__velocity=[1, 5, 0])
    with pytest.raises(SceneError) as found:
        moved(rigid, 1.0)
    assert str(found.value).startswith("nodes.B.velocity")


def test_velocities_that_joints_allow_nearly():
    free = changed(cantilever(), nodes__A={"position": [0, 0, 0], "velocity": [1, 0, 0]})
    motion = moved(changed(free, nodes__B__velocity=[1.0001, 0, 0]), 0.1, 0.05)
    # A third of the difference each, for two velocities and the length of the member.
    assert motion.notes[0].startswith("initial velocities were changed by up to 3.3e-05 of the largest")


def test_followers_have_no_energy_to_keep():
    table = changed(cantilever(), loads__tip__frame="follower")
    refused(table, "loads.tip: found a follower with the integrator 'conserving'", integrator="conserving")


def test_what_is_straight_between_clamps_and_keeps_its_length_is_named():
    held = {"position": [0.2, 0], "support": "clamped"}
    table = {
        "gravity": [0, -9.81],
        "sections": {"s": {"EI3": 1e-3, "rhoA": 0.1}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": held},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "analysis": {"type": "dynamic", "end": 0.1, "step": 0.01},
    }
    with pytest.raises(SolveError, match="a member is straight between places that come no closer"):
        solve(Scene.from_dict(table))
    # It may stretch, or its end may slide.
    table["sections"]["s"]["EA"] = 100.0
    assert solve(Scene.from_dict(table))


def test_gauss_integration_is_refused():
    scene = sfetcas.Scene.from_dict({**cantilever(), "analysis": {"type": "dynamic", "end": 1.0}})
    with pytest.raises(SceneError, match="integration: found 'gauss'"):
        sfetcas.solve(scene, gauss=True)


def test_a_step_that_is_too_long():
    """A load that is let loose after a while on a strip without damping."""
    table = cantilever(FLAT, (0.0, 400.0))
    table["histories"]["on"] = {"t": [0.5, 0.6], "value": [0.0, 1.0]}
    with pytest.raises(SolveError, match=r"did not converge at 0\.5 s in a step of 0\.1") as found:
        moved(table, 5.0, 0.25, output=0.1)
    reached = found.value.reached
    assert reached is not None
    assert reached.failure == found.value.detail
    assert 0.4 < reached.last.time < 5.0
    # What came before is the motion of the scene without load: rest.
    assert np.abs(reached.at(0.4).position("B") - [1, 0, 0]).max() < 1e-12


# -- histories --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("table", "off"), [(cantilever(), 0.473), (cantilever(THICK, (0.3, 1, 0.5)), 0.311)])
def test_a_load_that_switches_off_keeps_the_order(table, off):
    """The time is no multiple of any step."""
    table["histories"]["on"] = {"t": [0, off, 2.0], "polynomial": [[0, 0, 1, 1], [0.0]]}
    there = tip(moved(table, 1.3, 1 / 500, element="SFET3"))
    errors = [np.abs(tip(moved(table, 1.3, h, element="SFET3")) - there).max() for h in (1 / 32, 1 / 64)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(5, abs=0.6)


def test_times_of_answers():
    table = cantilever(expect=[{"quantity": "nodes.B.position", "value": [1, 0], "tolerance": 1, "time": 0.333}])
    motion = moved(table, 1.0, 0.05, output=0.25)
    assert np.array_equal(motion.times, [0, 0.25, 0.333, 0.5, 0.75, 1.0])
    assert motion.at(0.333).time == 0.333
    finer = moved(table, 1.0, 0.01, output=0.01)
    # Answers between steps are as good as those at their ends.
    for time in motion.times:
        assert np.abs(motion.at(time).position("B") - finer.at(time).position("B")).max() < 2e-6
    assert moved(table, 1.0, 0.05, output=0.3).times[-1] == 1.0


def test_begins_where_the_scene_is():
    motion = moved(changed(cantilever(), nodes__B__velocity=[0, 0.4, 0]), 1.0, 0.02, output=0.1)
    assert np.abs(motion.steps[0].position("B") - [1, 0, 0]).max() < 1e-14
    assert np.abs(motion.steps[0].velocity("B") - [0, 0.4, 0]).max() < 1e-3


def test_an_end_by_a_quantity():
    until = {"quantity": "nodes.B.position", "component": 1, "above": 0.2}
    motion = moved(cantilever(), 2.0, 0.02, output=0.05, until=until)
    assert motion.last.time < 2.0
    assert motion.last.position("B")[1] == pytest.approx(0.2, abs=1e-6)


def test_velocities_are_rates_of_positions():
    motion = moved(cantilever(THICK, (0.3, 1, 0.5)), 1.0, 0.01, output=0.01)
    slopes = (motion.positions("B")[2:] - motion.positions("B")[:-2]) / 0.02
    assert np.abs(motion.velocities("B")[1:-1] - slopes).max() < 1e-3
