"""Members pass no obstacle: the loads are followed from zero, and steps are short where one may have been passed."""

import math

import numpy as np
import pytest
from scenes import SOFT, made

from sfetcas import SceneError, solve
from sfetcas.checks import check

FLOOR = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}


def lever(value, contact, *, kind="flexible"):
    """A member of length 1 along x that a force turns; clamped if flexible, else hinged with a spring."""
    rigid = kind == "rigid"
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge" if rigid else "clamped"},
            "B": {"position": [1, 0]},
        },
        "members": {"m": {"nodes": ["A", "B"], "type": kind} if rigid else {"nodes": ["A", "B"], "section": "s"}},
        "contacts": {"stop": contact},
        "loads": {"F": {"type": "force", "node": "B", "value": value}},
    }
    if rigid:
        table["springs"] = {"k": {"type": "rotational", "node": "A", "stiffness": 1.0}}
    return table


def peg(x, y, radius, **more):
    return {"type": "circle", "center": [x, y], "radius": radius, "members": "all", **more}


def test_a_force_presses_a_strip_on_a_peg_and_not_past_it():
    """The state behind the peg is an equilibrium as well, clear of it and stable: loads from zero do not lead there."""
    answer = solve(made(lever([0, 12], peg(0.8, 0.3, 0.1)))).last
    tip = np.linalg.norm(answer.position("B")[:2] - [0.8, 0.3])
    assert answer.contacts["stop"]["force"][1] < -1.0
    # The strip ends close behind where it touches the peg, below it.
    assert answer.position("B")[1] < 0.3
    assert 0.1 < tip < 0.2


@pytest.mark.parametrize("value", [[0, 9], [-4, 30]])
def test_a_rigid_bar_is_held_at_the_angle_that_geometry_gives(value):
    """A bar through the origin touches a circle at the distance d below the direction of its centre."""
    center, radius = np.array([0.6, 0.35]), 0.07
    answer = solve(made(lever(value, peg(*center, radius), kind="rigid"))).last
    far = np.linalg.norm(center)
    angle = math.atan2(center[1], center[0]) - math.asin(radius / far)
    assert answer.angle("B") == pytest.approx(angle, abs=1e-9)
    assert answer.contacts["stop"]["at"] == pytest.approx(math.sqrt(far**2 - radius**2), abs=1e-9)
    # Moments about the hinge: force, spring, push of the peg.
    tip = answer.position("B")
    push = np.linalg.norm(answer.contacts["stop"]["force"])
    turns = tip[0] * value[1] - tip[1] * value[0] - angle - push * answer.contacts["stop"]["at"]
    assert turns == pytest.approx(0.0, abs=1e-8)


def test_a_cylinder_in_space_is_not_passed():
    flat = solve(made(lever([0, 12], peg(0.8, 0.3, 0.1)))).last
    drum = {"type": "cylinder", "center": [0.8, 0.3, 0], "axis": [0, 0, 1], "radius": 0.1, "members": "all"}
    table = lever([0, 12, 0], drum)
    table["sections"]["s"] = {"EI2": 5.0, "EI3": SOFT["EI3"], "GJ": 5.0}
    for node in table["nodes"].values():
        node["position"] = [*node["position"], 0]
    found = solve(made({**table, "dimension": "space"})).last
    np.testing.assert_allclose(found.position("B"), flat.position("B"), atol=2e-5)  # twice the accuracy


def test_the_answer_does_not_depend_on_steps():
    table = lever([0, 12], peg(0.8, 0.3, 0.1))
    table["analysis"] = {"steps": [0.3, 0.6, 1.0]}
    one, many = solve(made(lever([0, 12], peg(0.8, 0.3, 0.1)))).last, solve(made(table)).last
    np.testing.assert_allclose(many.position("B"), one.position("B"), atol=2e-5)


# -- moments and forces at nodes that touch --------------------------------------------------------


def lifted(**more):
    """A rod on a floor, hinged at one end, lifted at the other."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [3, 0]}},
        "members": {"rod": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {
            "w": {"type": "distributed", "member": "rod", "value": [0, -4]},
            "up": {"type": "force", "node": "B", "value": [0, 4]},
        },
        "contacts": {"floor": FLOOR},
        **more,
    }


@pytest.mark.parametrize("elements", [None, 5])
def test_a_hinge_of_what_lies_on_a_floor_exerts_no_moment(elements):
    table = lifted()
    if elements:
        table["members"]["rod"]["elements"] = elements
    answer = solve(made(table)).last
    force, moment = answer.reaction("A")
    assert np.abs(moment).max() == 0.0
    assert answer.contacts["floor"]["force"][1] + force[1] + 4.0 - 12.0 == pytest.approx(0.0, abs=1e-8)


def propped():
    """Two members joined at a node that sags onto a floor; both may touch it there."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0.05], "support": "clamped"},
            "M": {"position": [0.5, 0.05]},
            "B": {"position": [1, 0.05], "support": "slider", "direction": [1, 0]},
        },
        "members": {"l": {"nodes": ["A", "M"], "section": "s"}, "r": {"nodes": ["M", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "M", "value": [0, -40]}},
        "contacts": {"floor": FLOOR},
    }


def test_a_node_of_two_members_touches_once():
    """One touch with the whole force, which balances the load together with the supports."""
    table = propped()
    answer = solve(made(table)).last
    touch = answer.contacts["floor"]
    assert touch["at"] in (0.0, 1.0)
    total = touch["force"] + answer.reaction("A")[0] + answer.reaction("B")[0]
    np.testing.assert_allclose(total, [0, 40, 0], atol=1e-7)
    scene = made(
        {
            **table,
            "expect": [
                {
                    "quantity": "contacts.floor.force",
                    "value": touch["force"].tolist(),
                    "tolerance": 1e-6,
                    "source": "itself",
                }
            ],
        }
    )
    assert all(one.passed for one in check(scene, solve(scene)))


def test_several_touches_are_told_as_one_writes_them():
    """An expectation that does not fit names the numbers that the answer has, not an array."""
    table = lever([0, -30], {**FLOOR, "point": [0, -0.1]})
    table["expect"] = [{"quantity": "contacts.stop.force", "value": "none", "source": "wrong"}]
    scene = made(table)
    answer = solve(scene)
    table["expect"][0] |= {"value": [[0, 1], [0]], "tolerance": 1e-3}
    with pytest.raises(SceneError) as info:
        check(made(table), answer)
    assert "array" not in str(info.value)


def test_a_step_takes_no_other_branch_where_a_place_becomes_a_stretch():
    """A clamped arch shortened under a ceiling comes to lie along it; a long step led to a place of an unlike shape."""
    table = {
        "gravity": [12.3751, -0.4462, 0],
        "sections": {"s": {"EI3": 1.8136, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1.2, 0], "support": "clamped"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -0.3188}}},
        "motions": {"shift": {"node": "B", "displacement": [-0.1024, -0.0152]}},
        "contacts": {
            "top": {"type": "plane", "point": [0.0223, 0.2266], "normal": [-0.0979, -0.9952], "members": "all"}
        },
    }
    step = solve(made(table)).last
    # By thirteen steps, and within 1e-2 by a chain of 80 rigid links.
    assert step.contacts["top"]["at"] == pytest.approx([0.380085, 0.590994], abs=1e-4)
    assert not any("jumped" in note for note in step.notes)
