"""Contact with obstacles where it is an unknown where members touch: radii of members, laws, stretch, and with members.

The independent route is contact as conditions of elements, by another code: what has the radius ``r`` on something is
what has none on something that is larger by ``r``.
"""

import math

import numpy as np
import pytest

from sfetcas import Scene, SceneError, solve

LARGER = 0.1
FAR = {"accuracy": 1e-7}

FLOOR = {"type": "plane", "point": [0, -0.3], "normal": [0, 1]}
DRUM = {"type": "circle", "center": [0.6, -0.5], "radius": 0.3}
HOLE = {"type": "circle", "center": [0.5, 0.1], "radius": 0.65, "side": "inside"}


def cantilever(contact, load=(0, -3), section=None, **more):
    """A cantilever of unit length that is pressed on an obstacle by a force at its end."""
    table = {
        "sections": {"s": {"EI3": 1.0, **(section or {})}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "B", "value": list(load)}},
        "contacts": {"c": {**contact, "members": "all"}},
        "analysis": FAR,
    }
    return Scene.from_dict(table | more)


def smaller(contact):
    """An obstacle that is farther away by the radius of the members."""
    found = {**contact, "member_radius": LARGER}
    if contact["type"] == "plane":
        return found | {"point": [0, contact["point"][1] - LARGER]}
    return found | {"radius": contact["radius"] + (LARGER if contact.get("side") == "inside" else -LARGER)}


def force_of(step):
    return np.reshape(step.contacts["c"]["force"], (-1, 3)).sum(axis=0)


@pytest.mark.parametrize(
    ("contact", "load"),
    [(FLOOR, (0, -3)), (DRUM, (0, -3)), (DRUM, (0, -20)), (HOLE, (0, -4))],
    ids=["plane", "drum", "wound around a drum", "inside"],
)
def test_radius_of_a_member_is_a_larger_obstacle(contact, load):
    thin, thick = (solve(cantilever(c, load)).last for c in (contact, smaller(contact)))
    # Both are accurate to 1e-7 of the length; forces are ten times the tip force at most.
    np.testing.assert_allclose(thick.position("B"), thin.position("B"), atol=2e-7)
    np.testing.assert_allclose(force_of(thick), force_of(thin), atol=1e-4)
    assert thick.contacts["c"]["at"] == pytest.approx(thin.contacts["c"]["at"], abs=1e-5)
    assert abs(thick.contacts["c"]["gap"]) < 1e-12
    assert thick.certificate.stable is True


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 0, -2]])
def test_cylinder_in_space_is_a_circle_in_the_plane(axis):
    plane = solve(cantilever(smaller(DRUM))).last
    section = {"sections": {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0}}}
    cylinder = smaller(DRUM) | {"type": "cylinder", "axis": axis}
    space = solve(cantilever(cylinder, dimension="space", **section)).last
    np.testing.assert_allclose(space.position("B"), plane.position("B"), atol=2e-7)
    np.testing.assert_allclose(force_of(space), force_of(plane), atol=1e-4)


def test_distance_from_a_cylinder_is_that_from_its_axis():
    """Pushed along the axis too, against contact as conditions of elements on a cylinder that is larger."""
    section = {"sections": {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0}}, "dimension": "space"}
    cylinder = DRUM | {"type": "cylinder", "axis": [0.3, 0, 1]}
    thin, thick = (solve(cantilever(c, (0, -3, 0.7), **section)).last for c in (cylinder, smaller(cylinder)))
    assert abs(thin.position("B")[2]) > 0.05
    np.testing.assert_allclose(thick.position("B"), thin.position("B"), atol=2e-7)
    np.testing.assert_allclose(force_of(thick), force_of(thin), atol=1e-4)


def test_forces_along_a_member_that_touches_with_its_first_end():
    """The moment at a place is that of the load and the push beyond it."""
    step = solve(cantilever(smaller(FLOOR), members={"beam": {"nodes": ["B", "A"], "section": "s"}})).last
    assert step.contacts["c"]["at"] == 0.0
    along, force = step.along("beam", [0.02, 0.4]), force_of(step)[:2] + np.array([0.0, -3.0])
    np.testing.assert_allclose(np.abs(along["force"][:, :2]), [np.abs(force)] * 2, atol=1e-6)
    arms = along["position"] - step.position("B")
    moments = np.abs(arms[:, 0] * force[1] - arms[:, 1] * force[0])
    np.testing.assert_allclose(np.abs(along["moment"][:, 2]), moments, atol=1e-6)


def test_what_stretches_little_touches_a_drum_as_what_does_not():
    stiff = solve(cantilever(DRUM)).last
    stretched = [solve(cantilever(DRUM, section={"EA": size})).last for size in (1e3, 1e4)]
    apart = [np.abs(step.position("B") - stiff.position("B")).max() for step in stretched]
    # First order in the compliance: a tenth of it leaves a tenth.
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.02)
    assert apart[1] < 1e-3


def test_law_of_bending_that_is_linear_is_no_law():
    law = {"type": "table", "curvature": [-10, 0, 10], "moment": [-10, 0, 10]}
    plain, bent = (solve(cantilever(FLOOR, **more)).last for more in ({}, {"sections": {"s": {"law": law}}}))
    np.testing.assert_allclose(bent.position("B"), plain.position("B"), atol=2e-7)
    np.testing.assert_allclose(force_of(bent), force_of(plain), atol=1e-5)


def test_members_and_obstacles_together():
    """A beam is pressed on another one, whose end is pressed on a floor."""
    nodes = {
        "a0": {"position": [0, 0.1], "support": "clamped"},
        "a1": {"position": [1, 0.1]},
        "b0": {"position": [0.2, 0], "support": "clamped"},
        "b1": {"position": [1.4, 0]},
    }
    members = {"a": {"nodes": ["a0", "a1"], "section": "s"}, "b": {"nodes": ["b0", "b1"], "section": "s"}}
    contacts = {
        "pair": {"type": "members", "members": ["a", "b"], "radius": 0.02},
        "floor": {"type": "plane", "point": [0, -0.1], "normal": [0, 1], "member": "b"},
    }
    loads = {"F": {"type": "force", "node": "a1", "value": [0, -4]}}
    step = solve(
        cantilever(FLOOR, nodes=nodes, members=members, loads=loads, contacts=contacts, analysis={"accuracy": 1e-6})
    ).last
    floor, pair = step.contacts["floor"], step.contacts["pair"]
    assert floor["force"][1] > 0.0
    # The end of the lower one lies beyond the place that is pressed down: nothing bends it there.
    assert 0.8 < floor["at"][0] < 1.0 == floor["at"][1]
    np.testing.assert_allclose(step.along("b", [*floor["at"]])["position"][:, 1], -0.1, atol=1e-9)
    assert step.along("b", np.linspace(0, 1, 2001))["position"][:, 1].min() > -0.1 - 1e-9
    assert floor["force"][0] == pytest.approx(0.0, abs=1e-9)
    assert pair["force"][1] > 0.0
    assert abs(pair["gap"]) < 1e-9
    held = step.reaction("a0")[0] + step.reaction("b0")[0] + floor["force"]
    np.testing.assert_allclose(held, [0.0, 4.0, 0.0], atol=1e-8)


@pytest.mark.parametrize(
    ("contact", "more", "sentence"),
    [
        (FLOOR | {"member_radius": -0.1}, {}, "zero or above"),
        (FLOOR | {"member_radius": "wide"}, {}, "member_radius"),
        (FLOOR | {"member_radius": 0.4}, {}, r"starts inside, by 0\.1 m"),
    ],
)
def test_wrong_input_is_told_in_one_sentence(contact, more, sentence):
    with pytest.raises(SceneError, match=sentence) as told:
        cantilever(contact, **more)
    assert "\n" not in str(told.value)


def test_a_rod_that_stretches_rests_in_a_circle_on_its_ends_and_its_middle():
    """What touches at three places is a line from then on: its pushes go on, though its rows are others."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 0.01, "EA": 1000.0}},
            "nodes": {"a": {"position": [-0.2, -0.8]}, "b": {"position": [0.2, -0.8]}},
            "members": {"m": {"nodes": ["a", "b"], "section": "s"}},
            "loads": {"w": {"type": "distributed", "member": "m", "value": [0, -1]}},
            "contacts": {
                "bowl": {"type": "circle", "center": [0, 0], "radius": 1.0, "side": "inside", "members": "all"}
            },
            "analysis": {"accuracy": 1e-4},
        }
    )
    bowl = solve(scene).last.contacts["bowl"]
    assert (bowl["at"][0], bowl["at"][-1]) == (0.0, 1.0)
    # All of the weight.
    np.testing.assert_allclose(np.sum(bowl["force"], axis=0), [0.0, 0.4, 0.0], atol=1e-9)


@pytest.mark.parametrize("force", [5.0, 30.0])
def test_an_arch_that_snaps_lands_on_a_drum_on_both_sides(force):
    """It begins to fall so slowly that it would seem to rest where it was."""
    nodes = {
        "L": {"position": [-1, 0], "support": "hinge"},
        "M": {"position": [0, 0.2]},
        "R": {"position": [1, 0], "support": "hinge"},
    }
    table = {
        "sections": {"s": {"EI3": 1.0, "EA": 2000.0}},
        "nodes": nodes,
        "members": {"l": {"nodes": ["L", "M"], "section": "s"}, "r": {"nodes": ["M", "R"], "section": "s"}},
        "contacts": {
            "w": {"type": "circle", "center": [0, -0.6], "radius": 0.45, "member_radius": 0.03, "members": "all"}
        },
        "loads": {"F": {"type": "force", "node": "M", "value": [0, -force]}},
        "analysis": {"accuracy": 1e-6},
    }
    step = solve(Scene.from_dict(table)).last
    assert step.notes[0].startswith("jumped near factor")
    # Symmetric to the accuracy asked for.
    assert sum(step.contacts["w"]["at"]) == pytest.approx(1.0, abs=2e-6)
    up = np.sum(step.contacts["w"]["force"], axis=0)[1] + sum(step.reaction(name)[0][1] for name in "LR")
    assert up == pytest.approx(force, rel=1e-6)


def test_a_bar_that_its_spring_lets_turn_twice_stops_at_a_peg():
    """Where it would end it is near to where it was: whole turns between show in no direction."""
    moment, stiffness, reach, radius = 8.876, 0.7236, math.hypot(0.9569, 0.1826), 0.0772
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"b": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"type": "rotational", "node": "A", "stiffness": stiffness}},
        "loads": {"M": {"type": "moment", "node": "B", "value": moment}},
        "contacts": {"peg": {"type": "circle", "center": [0.9569, 0.1826], "radius": radius, "members": "all"}},
    }
    step = solve(Scene.from_dict(table)).last
    angle = math.atan2(0.1826, 0.9569) - math.asin(radius / reach)
    assert step.position("B") == pytest.approx([math.cos(angle), math.sin(angle), 0.0], abs=1e-9)
    lever = math.sqrt(reach**2 - radius**2)
    assert np.linalg.norm(step.contacts["peg"]["force"]) == pytest.approx(
        (moment - stiffness * angle) / lever, rel=1e-9
    )


def test_straight_strip_whose_ends_come_nearer_by_a_history_bends_towards_a_plate():
    """What has no place without loads begins at a small share of them, whether they grow evenly or by a history."""
    nodes = {
        "A": {"position": [0, 0], "support": "hinge"},
        "C": {"position": [0.5, 0], "start": [0.45, 0.19]},
        "B": {"position": [1, 0], "support": "hinge"},
        "plate": {"position": [0.45, 0.1], "support": "clamped"},
    }
    members = {name: {"nodes": ends, "section": "s"} for name, ends in (("l", ["A", "C"]), ("r", ["C", "B"]))}
    plate = {"type": "plane", "point": [0.45, 0.1], "normal": [0, -1], "members": "all", "node": "plate"}
    moves = {"B": [-0.02, 0], "plate": [0, -0.02]}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": nodes,
        "members": members,
        "contacts": {"c": plate},
        "analysis": {"accuracy": 1e-4},
    }
    answers = []
    for more in ({}, {"history": "even"}):
        motions = {name: {"node": name, "displacement": way, **more} for name, way in moves.items()}
        histories = {"histories": {"even": {"t": [0, 1], "value": [0, 1]}}} if more else {}
        answers.append(solve(Scene.from_dict({**table, "motions": motions, **histories})).last)
    evenly, by_history = answers
    # The same equations on the same mesh.
    np.testing.assert_allclose(by_history.position("C"), evenly.position("C"), atol=1e-9)
    assert by_history.position("C") == pytest.approx([0.49, 0.08, 0.0], abs=1e-4)
    # Along the plate there is none, to rounding.
    size = np.linalg.norm(force_of(evenly))
    np.testing.assert_allclose(force_of(by_history), force_of(evenly), rtol=1e-8, atol=1e-16 * size)


@pytest.mark.parametrize("spread", [False, True])
def test_a_rod_on_the_axis_of_a_tube_comes_down_as_on_a_floor(spread):
    """Seen from its axis a tube is as far everywhere; along it a rod is not bent, however thin it is."""
    radius, way = 0.01, np.array([0.0, -0.8, 0.6])

    def found(contact, load):
        loads = {"F": {"type": "distributed", "member": "beam", "value": load}}
        loads = loads if spread else {"F": {"type": "force", "node": "B", "value": load}}
        ends = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}}
        ends["B"] |= {"support": "slider", "direction": [1, 0, 0]} if spread else {}
        section = {"EI3": 1.0} if len(load) == 2 else {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}
        contact = {**contact, "members": "all"}
        more = {"nodes": ends, "sections": {"s": section}, "loads": loads, "contacts": {"c": contact}}
        return solve(cantilever({}, **more)).last

    size = 60.0 if spread else 1.0
    tube = {"type": "cylinder", "center": [0, 0, 0], "axis": [1, 0, 0], "radius": radius, "side": "inside"}
    one = found(tube, (size * way).tolist())
    other = found({"type": "plane", "point": [0, -radius], "normal": [0, 1]}, [0, -size])
    np.testing.assert_allclose(force_of(one), -way * force_of(other)[1], atol=1e-5 * size)
    for x in (0.25, 0.5, 1.0):
        here, there = (step.along("beam", [x])["position"][0] for step in (one, other))
        np.testing.assert_allclose(here, [there[0], *(-there[1] * way[1:])], atol=2e-7)
    assert one.model.mesh.elements <= 2 * other.model.mesh.elements
