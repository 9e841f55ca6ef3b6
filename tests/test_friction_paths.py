"""Paths with friction where members touch: how far loads go before all slips, by closed forms and independent ways."""

import numpy as np
import pytest

from sfetcas import Scene, SceneError, SolveError, Status, load, solve

FLOOR = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}
FLOOR_MU, WALL_MU, LENGTH = 0.4, 0.3, 2.0


def path(end, **more):
    return {"type": "path", "range": [0, end], **more}


def block(spring=0.0, **analysis):
    """A bar of 2 N on a floor, drawn along it by a force that grows to 2 N."""
    table = {
        "nodes": {"A": {"position": [0, 0]}, "B": {"position": [1, 0]}},
        "members": {"bar": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {
            "a": {"type": "force", "node": "A", "value": [0, -1], "history": "weight"},
            "b": {"type": "force", "node": "B", "value": [0, -1], "history": "weight"},
            "pull": {"type": "force", "node": "B", "value": [2, 0]},
        },
        "histories": {"weight": {"t": [0], "value": [1]}},
        "contacts": {"floor": FLOOR | {"friction": 0.3}},
        "analysis": path(1, **analysis),
    }
    if spring:
        table["springs"] = {"k": {"type": "translational", "node": "A", "stiffness": spring}}
    return Scene.from_dict(table)


def test_what_nothing_else_holds_slides_away_at_the_limit_of_friction():
    """Of 2 N of weight friction holds 0.6 N, at 0.3 of the pull."""
    found = solve(block())
    assert found.status is Status.SOLVED
    assert "from factor 0.3 on what touches slides away under the same loads" in found.main.end
    (slips,) = found.transitions
    assert slips.factor == pytest.approx(0.3, abs=1e-10)
    assert slips.changes == ("contacts.floor slides along bar at 0", "contacts.floor slides along bar at 1")
    assert not found.limit_points


@pytest.mark.parametrize("stiffness", [10.0, 0.1])
def test_a_block_on_a_spring_sticks_and_then_slides(stiffness):
    """However soft the spring is: beyond 0.3 it takes all that is pulled more."""
    found = solve(block(stiffness, steps=[0.2, 0.6, 1.0]))
    (slips,) = found.transitions
    # The two ends slide one after the other: how they share is known to rounding over what is rough gives way by.
    assert slips.factor == pytest.approx(0.3, rel=1e-5)
    moved = [step.position("A")[0] for step in found.steps]
    # What is rough gives way by 1e-9 of the loads.
    assert moved == pytest.approx([0.0, 0.6 / stiffness, 1.4 / stiffness], rel=1e-8, abs=1e-9)
    assert [step.contacts["floor"]["sticking"] for step in found.steps] == [True, False, False]


def ladder(**analysis):
    """A ladder with its weight in its middle; its foot is pushed away from the wall by a force of at most 1 N."""
    points = {"foot": [0.5, 0.0], "middle": [0.25, 0.8], "top": [0.0, 1.6]}
    return Scene.from_dict(
        {
            "nodes": {name: {"position": at} for name, at in points.items()},
            "members": {
                "low": {"nodes": ["foot", "middle"], "type": "rigid"},
                "high": {"nodes": ["middle", "top"], "type": "rigid"},
            },
            "loads": {
                "weight": {"type": "force", "node": "middle", "value": [0, -1], "history": "weight"},
                "push": {"type": "force", "node": "foot", "value": [1, 0]},
            },
            "histories": {"weight": {"t": [0], "value": [1]}},
            "contacts": {
                "floor": FLOOR | {"friction": FLOOR_MU},
                "wall": FLOOR | {"normal": [1, 0], "friction": WALL_MU},
            },
            "analysis": path(1, **analysis),
        }
    )


def push(tangent):
    """What pushes the foot of a ladder that slides at floor and wall, by the tangent of its angle to the floor."""
    wall = 0.5 / (tangent + WALL_MU)
    return FLOOR_MU * (1.0 - WALL_MU * wall) - wall


def test_a_ladder_is_pushed_to_its_limit_and_slides_down_beyond_it():
    """The path turns there, at a corner: lower on the wall less is needed to push it."""
    found = solve(ladder())
    (slips,) = found.transitions
    assert slips.turns
    assert slips.changes == ("contacts.floor slides along low at 0",)
    # To what corners are located to, a ten-millionth of a length along the path, and the next one beyond it.
    assert slips.factor == pytest.approx(push(1.6 / 0.5), abs=1e-6)
    corner = next(i for i, point in enumerate(found.points) if point.kind == "transition")
    beyond = found.points[corner + 1 :]
    assert len(beyond) > 3
    for point in beyond:
        here = found.fields(point)
        foot, top = here.position("foot"), here.position("top")
        assert np.hypot(foot[0], top[1]) == pytest.approx(np.hypot(0.5, 1.6), abs=1e-9)
        assert point.factor == pytest.approx(push(top[1] / foot[0]), abs=1e-9)
    assert found.points[-1].factor == pytest.approx(0.0, abs=1e-12)


def test_a_gripper_holds_what_the_finger_presses():
    """Along the path all is as in load steps; the block slips when it weighs mu times what the finger presses."""
    scene = load("problems/gripper_holds_by_friction.toml")
    steps = solve(scene).steps
    found = solve(scene.replace(analysis=path(3, steps=[1, 2, 3], accuracy=1e-6)))
    for one, other in zip(found.steps, steps, strict=True):
        np.testing.assert_allclose(one.position("block"), other.position("block"), atol=2e-6)
        np.testing.assert_allclose(one.contacts["block"]["force"], other.contacts["block"]["force"], atol=2e-6)
    held = solve(scene.replace(analysis=path(3, accuracy=1e-6), springs={}))
    (slips,) = held.transitions
    assert "slides away" in held.main.end
    # The elastica of the problem file: mu N with the block where it was gripped.
    weight = np.interp(slips.factor, [1, 2, 3], [0, 0.1, 0.3])
    assert weight == pytest.approx(0.126602254530, abs=1e-7)


def strip(friction, *, kind="path", end=1.0, accuracy=1e-6, **analysis):
    """A strip that hangs from a clamp which drives it across a bump: its tip slides over that."""
    contact = {"type": "circle", "center": [0.3, -1.18], "radius": 0.2, "members": "all"}
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [0, -1]}},
            "members": {"strip": {"nodes": ["A", "B"], "section": "s", "elements": 6}},
            "motions": {"drive": {"node": "A", "displacement": [0.5, 0]}},
            "contacts": {"bump": contact | ({"friction": friction} if friction else {})},
            "analysis": {"type": kind, "accuracy": accuracy, **analysis}
            | ({"range": [0, end]} if kind == "path" else {}),
        }
    )


def test_what_slides_over_a_bump_is_that_of_load_steps():
    """The reaction at the clamp, along a path by its arc length and by steps of the loads."""
    factors = [0.3, 0.6, 0.95]
    along = solve(strip(0.3, steps=factors))
    (touches,) = along.transitions
    assert touches.changes == ("contacts.bump touches strip at 1",)
    steps = solve(strip(0.3, kind="static", steps=factors, accuracy=1e-5))
    for one, other in zip(along.steps, steps.steps, strict=True):
        np.testing.assert_allclose(one.reaction("A")[0], other.reaction("A")[0], atol=1e-4)


def test_friction_that_goes_to_zero_leaves_the_path_without_it():
    """Where the strip is about to be dragged off the bump: what friction changes that by falls with the coefficient."""
    paths = (solve(strip(mu, end=1.5, accuracy=1e-5, points=32)) for mu in (0.0, 0.002, 0.004))
    free, less, more = (found.limit_points[0].factor for found in paths)
    assert free + 3e-4 < less < more
    # Of first order, and a hundredth of it of second.
    assert more - free == pytest.approx(2.0 * (less - free), rel=0.02)


def test_a_rope_on_a_drum_slips_at_its_limit():
    """A weight at one end, pulled at the other: it holds up to e^(mu pi) times the weight."""
    arc = {"type": "arc", "angle": -np.pi}
    found = solve(
        Scene.from_dict(
            {
                "sections": {"rope": {"EI3": 1e-5, "EA": 1000.0}},
                "nodes": {"hangs": {"position": [-1, 0]}, "pulled": {"position": [1, 0]}},
                "members": {"rope": {"nodes": ["hangs", "pulled"], "section": "rope", "shape": arc}},
                "loads": {
                    "weight": {"type": "force", "node": "hangs", "value": [0, -1], "history": "weight"},
                    "same": {"type": "force", "node": "pulled", "value": [0, -1], "history": "weight"},
                    "pull": {"type": "force", "node": "pulled", "value": [0, -1]},
                },
                "histories": {"weight": {"t": [0], "value": [1]}},
                "contacts": {
                    "drum": {"type": "circle", "center": [0, 0], "radius": 1.0, "members": "all", "friction": 0.3}
                },
                "analysis": path(3, accuracy=1e-3),
            }
        )
    )
    # It is lost where all but a little slips.
    assert found.points[-1].factor == pytest.approx(np.exp(0.3 * np.pi) - 1.0, abs=2e-4)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"modes": 2}, "accepted"),
    ],
)
def test_refused(more, sentence):
    with pytest.raises(SceneError, match=sentence):
        solve(ladder(**more))


def test_a_node_that_is_held_inside_an_obstacle_is_named_at_once():
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0.1], "support": "clamped"}, "B": {"position": [1, 0.1]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "motions": {"down": {"node": "A", "displacement": [0, -0.2], "history": "first"}},
        "loads": {"aside": {"type": "force", "node": "B", "value": [0.1, 0]}},
        "histories": {"first": {"t": [0], "value": [1]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all", "friction": 0.2}},
        "analysis": path(1),
    }
    with pytest.raises(SolveError, match=r"node A is held 0\.1 m inside contacts\.floor"):
        solve(Scene.from_dict(table))


def test_what_is_drawn_aside_turns_and_slides_away_in_the_end():
    """A body on three feet of 1 N each that is drawn at one of them: its feet slip one after the other, and it turns
    until all friction, 0.9 of 2 N, is against the pull.
    """
    found = solve(block_in_space(0.3, 2.0, path(1, accuracy=1e-4)))
    assert [slips.changes[0].split(" at ")[0] for slips in found.transitions] == [
        "contacts.floor slides along bar",
        "contacts.floor slides along bar",
        "contacts.floor slides along across",
    ]
    assert found.points[-1].factor == pytest.approx(0.45, abs=1e-8)
    assert "slides away" in found.main.end
    assert found.status is Status.SOLVED


def block_in_space(friction, pull, analysis):
    nodes = {"A": [0, 0, 0], "B": [1, 0, 0], "C": [0, 1, 0]}
    weights = {name: {"type": "force", "node": name, "value": [0, 0, -1], "history": "weight"} for name in nodes}
    return Scene.from_dict(
        {
            "nodes": {name: {"position": at} for name, at in nodes.items()},
            "members": {
                "bar": {"nodes": ["A", "B"], "type": "rigid"},
                "across": {"nodes": ["A", "C"], "type": "rigid"},
            },
            "loads": weights | {"pull": {"type": "force", "node": "B", "value": [pull, 0, 0]}},
            "histories": {"weight": {"t": [0], "value": [1]}},
            "contacts": {"floor": FLOOR | {"normal": [0, 0, 1], "point": [0, 0, 0], "friction": friction}},
            "analysis": analysis,
        }
    )


def test_a_rod_that_lies_across_another_one_is_drawn_along_it():
    """It sticks, and slides from where the load steps say that it does."""

    def crossing(analysis):
        points = {"A": [0, 0, 0.1], "B": [1, 0, 0.1], "C": [0.8, -0.5, 0], "D": [0.8, 0.5, 0]}
        clamped = {"support": "clamped"}
        return Scene.from_dict(
            {
                "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0, "EA": 1000.0}},
                "nodes": {n: {"position": at} | (clamped if n != "B" else {}) for n, at in points.items()},
                "members": {
                    "over": {"nodes": ["A", "B"], "section": "s"},
                    "under": {"nodes": ["C", "D"], "section": "s"},
                },
                "loads": {
                    "down": {"type": "force", "node": "B", "value": [0, 0, -1], "history": "down"},
                    "aside": {"type": "force", "node": "B", "value": [0, 1, 0]},
                },
                "histories": {"down": {"t": [0], "value": [1]}},
                "contacts": {"c": {"type": "members", "members": ["over", "under"], "radius": 0.02, "friction": 0.3}},
                "analysis": {"accuracy": 1e-4, "steps": [0.2, 1.0]} | analysis,
            }
        )

    found, steps = solve(crossing(path(1.5))), solve(crossing({"type": "static"}))
    (slips,) = found.transitions
    assert slips.changes == (f"contacts.c: over at {slips.contacts['c']['at']:.4g} slides along under at 0.5",)
    assert 0.2 < slips.factor < 0.25
    for one, other in zip(found.steps, steps.steps, strict=True):
        np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-4)
        assert one.contacts["c"]["sticking"] == other.contacts["c"]["sticking"]


@pytest.mark.parametrize("start", [0.0, 0.4])
def test_a_bar_does_not_pass_a_wall_that_reaches_a_little_into_its_circle(start):
    """By half a thousandth of its length: it stops there, whatever turns it."""
    found = solve(
        Scene.from_dict(
            {
                "nodes": {
                    "O": {"position": [0, 0], "support": "hinge"},
                    "T": {"position": [np.cos(start), np.sin(start)]},
                },
                "members": {"bar": {"nodes": ["O", "T"], "type": "rigid"}},
                "springs": {"k": {"node": "O", "stiffness": 1.0}},
                "loads": {"m": {"type": "moment", "node": "T", "value": 3.0}},
                "contacts": {"wall": FLOOR | {"point": [0, 0.9995], "normal": [0, -1], "friction": 0.2}},
                "analysis": path(1, accuracy=1e-5),
            }
        )
    )
    (touches,) = found.transitions
    # It touches when it is in by a tenth of the accuracy, at a slope of 0.03 and for 3 N m.
    assert touches.factor == pytest.approx((np.arcsin(0.9995) - start) / 3.0, abs=2e-5)
    assert found.last.position("T")[1] == pytest.approx(0.9995, abs=1e-4)


def test_loads_that_rise_and_fall_leave_what_has_slipped_where_it_is():
    """A history draws the block out, lets it go, and draws it again: as load steps, each factor once."""
    history = {"t": [0, 1, 2, 3], "value": [0, 1, 0, 0.5]}
    scene = block(10.0).replace({"histories.pull": history, "loads.pull.history": "pull"})
    found = solve(scene.replace(analysis={"type": "path", "range": [0, 3], "steps": [0.5, 1, 1.5, 2, 3]}))
    moved = [step.position("A")[0] for step in found.steps]
    assert moved == pytest.approx([0.04, 0.14, 0.14, 0.06, 0.06], abs=1e-8)
    verbs = [change.changes[0].split()[1] for change in found.transitions]
    assert verbs == ["slides", "sticks", "slides", "sticks"]
    assert [change.factor for change in found.transitions] == pytest.approx([0.3, 1.0, 1.6, 2.0], abs=1e-5)


def test_what_slides_under_its_weight_alone_has_no_path():
    slope = {"point": [0, 0], "normal": [-0.6, 0.8], "friction": 0.5}
    scene = block().replace({"nodes.B.position": [0.8, 0.6], "contacts.floor": FLOOR | slope})
    with pytest.raises(
        SolveError, match=r"the path begins were followed to .*, where all that touches is about to slide"
    ):
        solve(scene)


@pytest.mark.parametrize("values", [[0, 0.5, 1.0], [0, 0.9, 1.0]])
def test_a_knot_while_something_slides_changes_nothing(values):
    """The path comes to the end of the range, and to the knot, by itself: what slides there slides on."""
    history = {"t": [0, 1, 2], "value": values}
    scene = block(10.0).replace({"histories.pull": history, "loads.pull.history": "pull"})
    found = solve(scene.replace(analysis={"type": "path", "range": [0, 2], "steps": [1, 2]}))
    # What is pulled beyond 0.6 N goes into the spring.
    assert [s.position("A")[0] for s in found.steps] == pytest.approx(
        [max(2.0 * v - 0.6, 0.0) / 10.0 for v in values[1:]], abs=1e-8
    )
    assert len(found.transitions) == 1
    assert not found.limit_points
    assert found.status is Status.SOLVED


def test_two_blocks_on_springs_stick_and_slide_back_one_after_the_other():
    """A load that turns: friction of 0.4 and 0.8 N, springs of 10 and 5 N/m, 4 N drawn and let go."""
    nodes = {"A": [0, 0], "B": [1, 0], "C": [2, 0], "D": [3, 0]}
    always = {name: {"type": "force", "node": name, "value": [0, -1], "history": "always"} for name in nodes}
    rough = {"one": 0.2, "two": 0.4}
    spring = {"type": "translational", "node": "B", "to": "C", "stiffness": 5.0, "length": 1.0}
    found = solve(
        Scene.from_dict(
            {
                "nodes": {name: {"position": at} for name, at in nodes.items()},
                "members": {
                    "one": {"nodes": ["A", "B"], "type": "rigid"},
                    "two": {"nodes": ["C", "D"], "type": "rigid"},
                },
                "springs": {"wall": {"type": "translational", "node": "A", "stiffness": 10.0}, "between": spring},
                "loads": always | {"pull": {"type": "force", "node": "D", "value": [4, 0], "history": "pull"}},
                "histories": {"always": {"t": [0], "value": [1]}, "pull": {"t": [0, 1, 2], "value": [0, 1, 0]}},
                "contacts": {
                    name: {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": name, "friction": mu}
                    for name, mu in rough.items()
                },
                "analysis": {"type": "path", "range": [0, 2], "steps": [1, 1.5, 2], "accuracy": 1e-5},
            }
        )
    )
    assert [step.position("A")[0] for step in found.steps] == pytest.approx([0.28, 0.28, 0.12], abs=1e-7)
    assert [step.position("C")[0] - 2.0 for step in found.steps] == pytest.approx([0.92, 0.84, 0.28], abs=1e-7)
    assert [change.factor for change in found.transitions] == pytest.approx([0.2, 0.3, 1.0, 1.4, 1.6], abs=1e-5)
