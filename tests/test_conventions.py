"""Signs of springs and of what drives, as the conventions of the documentation state them."""

import pytest

from sfetcas import Scene, solve


def turned(motions, springs, **node):
    """A rigid rod on a node that a motion drives, with a spring that resists."""
    table = {
        "nodes": {"A": {"position": [0, 0], **node}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "motions": {"d": motions},
        "springs": {"k": springs},
    }
    return solve(Scene.from_dict(table)).last


@pytest.mark.parametrize("sign", [1, -1])
def test_signs_of_springs_and_motions_are_as_said(sign):
    hinge = {"support": "hinge", "axis": [0, 0, sign]}
    spring = {"node": "A", "stiffness": 2.0, "rest": 0.1, "axis": [0, 0, 1]}
    step = turned({"node": "A", "rotation": 0.5}, spring, **hinge)
    # prescribed: right to rounding
    assert step.angle("A") == pytest.approx(0.5 * sign, abs=1e-12)
    state = step.spring("k").to_dict()
    assert state == pytest.approx({"angle": 0.5 * sign, "moment": -2.0 * (0.5 * sign - 0.1)}, abs=1e-12)
    # The ground makes the motion against the spring, about the hinge's own axis.
    assert step.motion("d")["moment"] == pytest.approx(-sign * state["moment"], abs=1e-12)
    slider = {"support": "slider", "direction": [sign, 0]}
    along = {"type": "translational", "node": "B", "stiffness": 3.0, "direction": [1, 0], "rest": 0.05}
    step = turned({"node": "A", "displacement": [0.2, 0]}, along, **slider)
    assert step.spring("k").to_dict() == pytest.approx({"travel": 0.2, "force": -3.0 * 0.15}, abs=1e-12)
    assert step.motion("d")["force"][0] == pytest.approx(0.45, abs=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_driven_slides_go_by_the_component_along_the_direction(sign):
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0], "direction": [sign, 0]},
            "C": {"position": [2, 0]},
        },
        "members": {
            "a": {"nodes": ["A", "B"], "type": "rigid"},
            "b": {"nodes": ["B", "C"], "section": "s", "release": ["slider", "rigid"]},
        },
        "motions": {"d": {"node": "B", "between": ["a", "b"], "displacement": [0.2, 0]}},
        "loads": {"pull": {"type": "force", "node": "C", "value": [0.3, 0]}},
    }
    step = solve(Scene.from_dict(table)).last
    assert step.along("b", [0.0])["position"][0, 0] == pytest.approx(1.2, abs=1e-12)
    # On the second member, along the direction: it holds what pulls away.
    assert step.motion("d")["force"] == pytest.approx(-0.3 * sign, abs=1e-9)


def test_driven_joint_is_held_against_its_spring():
    """Both count the second member against the first."""
    table = {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [0, 1], "joint": "hinge"},
            "C": {"position": [1, 1], "support": "clamped"},
        },
        "members": {
            "crank": {"nodes": ["A", "B"], "type": "rigid"},
            "beam": {"nodes": ["B", "C"], "section": "strip"},
        },
        "springs": {"knee": {"node": "B", "between": ["crank", "beam"], "stiffness": 10.0}},
        "motions": {"knee": {"node": "B", "between": ["crank", "beam"], "rotation": 0.5}},
    }
    step = solve(Scene.from_dict(table)).last
    # prescribed: right to rounding
    assert step.spring("knee").to_dict() == pytest.approx({"angle": 0.5, "moment": -5.0}, abs=1e-9)
