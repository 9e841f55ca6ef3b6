"""Obstacles that nodes carry, in statics and in motions: by other scenes with the same forces, and by closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sfetcas import Scene, SceneError, solve

STRIP = {"sections": {"strip": {"EI3": 1.0}}, "analysis": {"accuracy": 1e-6}}
A, B, W = np.array([0.0, 0, 0]), np.array([1.0, 0, 0]), np.array([0.6, -0.5, 0.2])
LOAD = np.array([0.3, -3.0, 0.4])
ROLL = {"type": "circle", "center": [0.8, -0.2], "radius": 0.1, "member": "beam"}
OBSTACLES = {
    "sphere": {"type": "sphere", "center": [0.6, -0.4, 0.05], "radius": 0.3},
    "cylinder": {"type": "cylinder", "center": [0.6, -0.4, 0.0], "radius": 0.3, "axis": [0.2, 0.1, 1]},
    "plane": {"type": "plane", "point": [0.6, -0.2, 0.0], "normal": [0.1, 1, 0.2]},
    "inside": {"type": "cylinder", "center": [0.5, 0.1, 0], "radius": 0.65, "side": "inside"},
}


def cantilever(contacts, nodes=None, members=None, **more):
    """A cantilever of unit length in the plane beside what else there is."""
    ends = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}}
    beam = {"beam": {"nodes": ["A", "B"], "section": "strip"}}
    table = {"nodes": ends | (nodes or {}), "members": beam | (members or {}), "contacts": contacts}
    return solve(Scene.from_dict(STRIP | table | more)).last


def in_space(obstacle, vector=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0)):
    """A cantilever pressed on an obstacle that a node without members carries, all moved rigidly, and the matrix."""
    turned = Rotation.from_rotvec(vector).as_matrix()
    motions = {
        name: {"node": name, "displacement": (turned @ x + shift - x).tolist(), "rotation": list(vector)}
        for name, x in (("A", A), ("W", W))
    }
    held = {name: {"position": x.tolist(), "support": "clamped"} for name, x in (("A", A), ("W", W))}
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": held | {"B": {"position": B.tolist()}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "B", "value": (turned @ LOAD).tolist()}},
        "contacts": {"c": {**OBSTACLES[obstacle], "member": "beam", "node": "W"}},
        "motions": motions if np.any(vector) else {},
        "analysis": {"accuracy": 1e-6},
    }
    return solve(Scene.from_dict(table)).last, turned


@pytest.mark.parametrize("obstacle", list(OBSTACLES))
def test_what_moves_rigidly_with_all_else_has_the_same_forces(obstacle):
    still, _ = in_space(obstacle)
    moved, turned = in_space(obstacle, (0.3, -0.5, 0.6), (0.1, 0.2, -0.3))
    # Accurate to 1e-6 of positions; forces are some ten times the stiffness over the squared length.
    assert np.linalg.norm(still.contacts["c"]["force"]) > 1.0
    np.testing.assert_allclose(turned.T @ moved.contacts["c"]["force"], still.contacts["c"]["force"], atol=1e-5)
    for node in ("A", "W"):
        for mine, its in zip(moved.reaction(node), still.reaction(node), strict=True):
            np.testing.assert_allclose(turned.T @ mine, its, atol=1e-5)
    # What the obstacle does to the beam the beam does to the obstacle: all of it is in balance, to rounding.
    forces = {node: moved.reaction(node)[0] for node in ("A", "W")} | {"B": turned @ LOAD}
    moments = sum(moved.reaction(node)[1] for node in ("A", "W"))
    np.testing.assert_allclose(sum(forces.values()), 0.0, atol=1e-12)
    about = moments + sum(np.cross(moved.position(node), force) for node, force in forces.items())
    np.testing.assert_allclose(about, 0.0, atol=1e-12)


def test_driven_obstacle_is_a_support_that_moves_the_other_way():
    held = {"W": {"position": [0.8, -0.3], "support": "clamped"}}
    up = {"m": {"node": "W", "displacement": [0, 0.4]}}
    pushed = cantilever({"roll": ROLL | {"node": "W"}}, held, motions=up)
    # By contact as conditions of elements, another code.
    other = cantilever({"roll": ROLL}, motions={"m": {"node": "A", "displacement": [0, -0.4]}})
    np.testing.assert_allclose(pushed.position("B"), other.position("B") + np.array([0, 0.4, 0]), atol=1e-6)
    np.testing.assert_allclose(pushed.contacts["roll"]["force"], other.contacts["roll"]["force"], atol=1e-5)
    np.testing.assert_allclose(pushed.reaction("A"), other.reaction("A"), atol=1e-5)


@pytest.mark.parametrize("carrier", ["E", "H"])
def test_roll_on_a_lever_is_the_round_end_of_a_member(carrier):
    """At whichever end of a rigid lever, against contact between two members."""
    nodes = {"H": {"position": [1.2, 0.11], "support": "hinge"}, "E": {"position": [0.7, 0.11]}}
    lever = {
        "members": {"lever": {"nodes": ["H", "E"], "type": "rigid"}},
        "springs": {"s": {"node": "H", "stiffness": 0.2}},
        "loads": {"M": {"type": "moment", "node": "E", "value": 0.25}},
    }
    roll = ROLL | {"center": [0.7, 0.11], "node": carrier}
    round_end = {"type": "members", "members": ["beam", "lever"], "radius": 0.05}
    mine, its = (cantilever({"c": contact}, nodes, **lever) for contact in (roll, round_end))
    assert mine.position("B")[1] < -0.05
    np.testing.assert_allclose(mine.contacts["c"]["force"], its.contacts["c"]["force"], atol=1e-6)
    for node in ("B", "E"):
        np.testing.assert_allclose(mine.position(node), its.position(node), atol=1e-6)
    np.testing.assert_allclose(mine.reaction("H"), its.reaction("H"), atol=1e-6)


def test_plane_at_the_end_of_a_flexible_member_bends_it():
    """The end of one cantilever presses on a plane at that of another: its force and moment bend that one alone."""
    nodes = {"C": {"position": [1.2, 0.4], "support": "clamped"}, "D": {"position": [0.6, 0.4]}}
    other = {"other": {"nodes": ["C", "D"], "section": "strip"}}
    pad = {"type": "plane", "point": [0.6, 0.1], "normal": [0, -1], "member": "beam", "node": "D"}
    loads = {"F": {"type": "force", "node": "B", "value": [0.2, 1.5]}}
    both = cantilever({"pad": pad}, nodes, other, loads=loads)
    force = -both.contacts["pad"]["force"]
    lever = both.position("B") - both.position("D")
    moment = float(lever[0] * force[1] - lever[1] * force[0])
    alone = {
        "nodes": nodes,
        "members": other,
        "loads": {
            "F": {"type": "force", "node": "D", "value": force.tolist()},
            "M": {"type": "moment", "node": "D", "value": moment},
        },
    }
    bent = solve(Scene.from_dict(STRIP | alone)).last
    assert abs(moment) > 0.1
    np.testing.assert_allclose(bent.position("D"), both.position("D"), atol=1e-6)
    assert bent.angle("D") == pytest.approx(both.angle("D"), abs=1e-6)
    np.testing.assert_allclose(bent.reaction("C"), both.reaction("C"), atol=1e-5)
    # The push is across the plane where that is now.
    across = np.array([np.sin(both.angle("D")), -np.cos(both.angle("D")), 0.0])
    np.testing.assert_allclose(np.cross(across, force), 0.0, atol=1e-9)


def test_strip_lies_on_a_floor_that_is_lifted():
    """Along a line, against a floor that stays under a support that is lowered."""
    floor = {"type": "plane", "point": [0, -0.3], "normal": [0, 1], "member": "beam"}
    held = {"W": {"position": [0.8, -0.5], "support": "clamped"}}
    weight = {"w": {"type": "distributed", "member": "beam", "value": [0, -60.0]}}
    lifted = cantilever(
        {"floor": floor | {"node": "W"}}, held, loads=weight, motions={"m": {"node": "W", "displacement": [0, 0.2]}}
    )
    stays = cantilever({"floor": floor | {"point": [0, -0.1], "member_radius": 1e-9}}, loads=weight)

    def push(step):
        return np.reshape(step.contacts["floor"]["force"], (-1, 3)).sum(axis=0)

    # 36 N of the weight of 60 N are on the floor: places are known to 1e-6, and what is free of the strip, 0.6 m
    # clamped at both ends, has 192 EI / l^3 = 900 N/m.
    np.testing.assert_allclose(push(lifted), push(stays), atol=1e-3)
    assert push(lifted)[1] > 30.0
    np.testing.assert_allclose(lifted.position("B"), stays.position("B"), atol=1e-6)
    force, moment = lifted.reaction("W")
    np.testing.assert_allclose(force, push(lifted), atol=1e-9)
    rest = lifted.reaction("A")[1] + moment + np.cross(lifted.position("W"), force)
    centre = np.trapezoid(lifted.along("beam", np.linspace(0, 1, 401))["position"][:, 0], dx=1 / 400)
    # The weight has its lever, by the trapezoidal rule to 1e-6.
    assert rest[2] == pytest.approx(60.0 * centre, abs=1e-3)


# Friction in statics


def block(friction, steps, **motion):
    """A bar that lies with its weight on a plane which a node beside it carries."""
    return {
        "nodes": {
            "A": {"position": [0, 0]},
            "B": {"position": [1, 0]},
            "F": {"position": [0.3, -0.5], "support": "clamped"},
        },
        "members": {"bar": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {n: {"type": "force", "node": n, "value": [0, -1], "history": "weight"} for n in "AB"},
        "histories": {"weight": {"t": [0], "value": [1]}},
        "contacts": {
            "floor": {
                "type": "plane",
                "point": [0, 0],
                "normal": [0, 1],
                "member": "bar",
                "node": "F",
                "friction": friction,
            }
        },
        "motions": {"m": {"node": "F", **motion}},
        "analysis": {"steps": list(steps), "accuracy": 1e-6},
    }


def test_plane_drags_a_block_along_until_it_slips():
    """Against a spring of 10 N/m: friction of 0.6 N is reached at 0.06 m; back it goes with the plane until -0.06 m."""
    spring = {"k": {"type": "translational", "node": "A", "stiffness": 10.0}}
    table = block(0.3, (0.25, 1.0, 0.75, -0.5), displacement=[0.2, 0.1]) | {"springs": spring}
    table["springs"]["k"]["direction"] = [1, 0]
    steps = solve(Scene.from_dict(table)).steps
    # What is rough gives way by 1e-9.
    assert [step.position("A")[0] for step in steps] == pytest.approx([0.05, 0.06, 0.01, -0.06], abs=1e-8)
    assert [step.contacts["floor"]["sticking"] for step in steps] == [True, False, True, False]
    assert [step.reaction("F")[0][0] for step in steps] == pytest.approx([0.5, 0.6, 0.1, -0.6], abs=1e-7)
    assert [step.position("A")[1] for step in steps] == pytest.approx([0.025, 0.1, 0.075, -0.05], abs=1e-8)


def test_block_stays_on_a_plane_that_is_tilted():
    """By less than the angle of friction: it goes round with the plane."""
    step = solve(Scene.from_dict(block(0.3, (0.5, 1.0), rotation=0.2))).last
    base, turned = np.array([0.3, -0.5]), Rotation.from_euler("z", 0.2).as_matrix()[:2, :2]
    # What is rough gives way by 1e-9.
    np.testing.assert_allclose(step.position("A")[:2], base - turned @ base, atol=1e-8)
    across = turned @ [0.0, 1.0]
    np.testing.assert_allclose(step.contacts["floor"]["friction"][:2] @ across, 0.0, atol=1e-9)
    assert np.linalg.norm(step.contacts["floor"]["friction"]) == pytest.approx(2.0 * np.sin(0.2), abs=1e-7)
    lever = turned @ (np.array([0.5, 0.0]) - base)
    assert step.reaction("F")[1][2] == pytest.approx(2.0 * lever[0], abs=1e-7)


def test_drum_that_turns_rubs_on_what_lies_on_it():
    """Its moment is the friction times its radius, one way and the other."""
    table = {
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "W": {"position": [0.8, -0.1], "support": "clamped"},
        },
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"F": {"type": "force", "node": "B", "value": [0, -2], "history": "w"}},
        "histories": {"w": {"t": [0], "value": [1]}},
        "contacts": {"c": ROLL | {"center": [0.8, -0.1], "node": "W", "friction": 0.3}},
        "motions": {"m": {"node": "W", "rotation": 0.2}},
        "analysis": {"steps": [1.0, 0.5], "accuracy": 1e-3},
    }
    for step, sign in zip(solve(Scene.from_dict(STRIP | table)).steps, (-1.0, 1.0), strict=True):
        told = step.contacts["c"]
        rubs = float(np.linalg.norm(told["friction"]))
        # A sliding place is at the limit, to rounding.
        assert rubs == pytest.approx(0.3 * np.linalg.norm(told["force"] - told["friction"]), rel=1e-9)
        assert np.sign(told["friction"][0]) == sign
        # What is rough gives way by 1e-9, by which the lever is shorter.
        assert step.reaction("W")[1][2] == pytest.approx(-sign * 0.1 * rubs, abs=1e-8)


# Motions


def thrown(restitution):
    """A bar over a floor that rises as t^2 / 2."""
    return {
        "sections": {"b": {"rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0.1]},
            "B": {"position": [1, 0.1]},
            "F": {"position": [0.3, -0.5], "support": "clamped"},
        },
        "members": {"bar": {"nodes": ["A", "B"], "type": "rigid", "section": "b"}},
        "contacts": {
            "c": {
                "type": "plane",
                "point": [0, 0],
                "normal": [0, 1],
                "member": "bar",
                "node": "F",
                "restitution": restitution,
            }
        },
        "motions": {"m": {"node": "F", "displacement": [0, 1], "history": "h"}},
        "histories": {"h": {"t": [0, 2], "polynomial": [[0, 0, 2.0]]}},
        "analysis": {"type": "dynamic", "end": 0.8, "output": 0.4, "accuracy": 1e-7},
    }


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_rising_floor_throws_a_bar(restitution):
    """What hits at rest a floor of the speed v leaves with (1 + e) v."""
    motion = solve(Scene.from_dict(thrown(restitution)))
    hit = np.sqrt(0.2)
    speed = (1.0 + restitution) * hit
    assert motion.events[0].time == pytest.approx(hit, abs=1e-6)
    assert motion.last.position("A")[1] == pytest.approx(0.1 + speed * (0.8 - hit), abs=1e-6)
    assert motion.last.contacts["c"]["gap"] == pytest.approx(0.1 + speed * (0.8 - hit) - 0.32, abs=1e-6)


def test_rising_floor_carries_a_bar_that_does_not_rebound():
    last = solve(Scene.from_dict(thrown(0.0))).last
    assert last.position("A")[1] == pytest.approx(0.32, abs=1e-8)
    np.testing.assert_allclose(last.reaction("F")[0], [0, 1.0, 0], atol=1e-8)
    assert last.reaction("F")[1][2] == pytest.approx(0.2, abs=1e-8)


def test_a_level_bar_leaves_a_floor_that_stops_rising_with_both_ends_at_once():
    """Where the floor is braked by more than gravity; the two releases are one to rounding, which must not turn it."""
    table = {
        "sections": {"s": {"rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0]},
            "B": {"position": [0.4, 0]},
            "G": {"position": [0, -1], "support": "clamped"},
        },
        "members": {"bar": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
        "gravity": [0, -10],
        "motions": {"g": {"node": "G", "displacement": [0, 0.3], "history": "h"}},
        "histories": {"h": {"t": [0, 0.1], "polynomial": [[0, 0, 0, 10, -15, 6]]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "bar", "node": "G"}},
        "analysis": {"type": "dynamic", "end": 0.3, "accuracy": 1e-4, "output": 0.3},
    }
    motion = solve(Scene.from_dict(table))
    rises = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    shares = (0.3 * rises.deriv(2) + 10 * 0.1**2).roots()
    (share,) = [z.real for z in shares if abs(z.imag) < 1e-12 and 0.5 < z.real < 0.7]
    assert [event.time for event in motion.events] == pytest.approx([0.1 * share] * 2, abs=1e-7)
    flies = 0.3 - 0.1 * share
    height = 0.3 * rises(share) + 3.0 * rises.deriv()(share) * flies - 5.0 * flies**2
    # Either end: without a torque the bar does not turn.
    for end in "AB":
        assert motion.last.position(end)[1] == pytest.approx(height, abs=1e-6)


def bead(dimension):
    """A bead on an arm that turns with the speed of one."""
    return {
        "dimension": dimension,
        "nodes": {
            "A": {"position": [0.5, 0], "mass": 2.0, "inertia": [1e-3] * 3, "velocity": [0, 0.5]},
            "B": {"position": [0.5, 0.1]},
            "W": {"position": [0, 0], "support": "clamped"},
        },
        "members": {"bead": {"nodes": ["A", "B"], "type": "rigid"}},
        "contacts": {"arm": {"type": "plane", "point": [0.2, 0], "normal": [0, 1], "member": "bead", "node": "W"}},
        "motions": {"m": {"node": "W", "rotation": [0, 0, 1] if dimension == "space" else 1.0, "history": "h"}},
        "histories": {"h": {"t": [0, 2], "polynomial": [[0, 2.0]]}},
        "analysis": {"type": "dynamic", "end": 1.0, "output": 1.0, "accuracy": 1e-6},
    }


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_bead_is_thrown_outwards_along_an_arm_that_turns(dimension):
    """Without friction at the distance s0 cosh(w t), pushed by 2 m w^2 s0 sinh(w t)."""
    start, mass, t = 0.5, 2.0, 1.0
    last = solve(Scene.from_dict(bead(dimension))).last
    far, push = start * np.cosh(t), 2.0 * mass * start * np.sinh(t)
    np.testing.assert_allclose(last.position("A"), [far * np.cos(t), far * np.sin(t), 0], atol=1e-6)
    np.testing.assert_allclose(last.contacts["arm"]["force"], [-push * np.sin(t), push * np.cos(t), 0], atol=1e-5)
    np.testing.assert_allclose(last.reaction("W")[1], [0, 0, push * far], atol=1e-5)


def flying():
    """A bar whose end flies towards another one that rests."""
    return {
        "sections": {"b": {"rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0]},
            "B": {"position": [1, 0]},
            "C": {"position": [1.05, 0.3], "velocity": [0, -1]},
            "D": {"position": [1.5, 0.8]},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "type": "rigid", "section": "b"},
            "other": {"nodes": ["C", "D"], "type": "rigid", "section": "b", "spin": 1.0},
        },
        "analysis": {"type": "dynamic", "end": 0.8, "output": 0.8, "accuracy": 1e-7},
    }


@pytest.mark.parametrize("restitution", [1.0, 0.3])
def test_bodies_that_fly_exchange_momentum_and_keep_its_sum(restitution):
    """Round the end of one body or of the other: the same motion, whichever carries the obstacle."""
    places = {"center": [1.05, 0.3], "member": "one", "node": "C"}, {"center": [1, 0], "member": "other", "node": "B"}
    found = []
    for place in places:
        contact = {"type": "circle", "radius": 0.1, "restitution": restitution, **place}
        motion = solve(Scene.from_dict(flying() | {"contacts": {"c": contact}}))
        first, last = motion.at(0.0), motion.last
        assert len(motion.events) == 1
        for kind in ("linear", "angular"):
            np.testing.assert_allclose(last.momentum[kind], first.momentum[kind], atol=1e-6)
        lost = motion.events[0].dissipated
        assert (lost > 0.05) == (restitution < 1.0)
        assert last.energy["kinetic"] + lost == pytest.approx(first.energy["kinetic"], abs=1e-6)
        found.append([last.position(node) for node in "ABCD"])
    np.testing.assert_allclose(*found, atol=1e-6)


def belt():
    """A block on a belt whose speed grows with the square of time."""
    return {
        "gravity": [0, -10],
        "sections": {"b": {"rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0]},
            "B": {"position": [1, 0]},
            "F": {"position": [0.3, -0.5], "support": "clamped"},
        },
        "members": {"block": {"nodes": ["A", "B"], "type": "rigid", "section": "b"}},
        "contacts": {
            "belt": {
                "type": "plane",
                "point": [0, 0],
                "normal": [0, 1],
                "member": "block",
                "node": "F",
                "friction": 0.2,
            }
        },
        "motions": {"m": {"node": "F", "displacement": [1, 0], "history": "h"}},
        "histories": {"h": {"t": [0, 2], "polynomial": [[0, 0, 0, 16 / 3]]}},
        "analysis": {"type": "dynamic", "end": 1.0, "output": 0.25, "accuracy": 1e-6},
    }


def test_belt_that_speeds_up_drags_a_block_until_it_slips():
    """The acceleration 4 t grows beyond that of friction, 2, at half a second."""
    motion = solve(Scene.from_dict(belt()))
    assert motion.at(0.25).position("A")[0] == pytest.approx(4 * 0.25**3 / 6, abs=1e-7)
    assert motion.at(0.25).contacts["belt"]["friction"][0] == pytest.approx(1.0, abs=1e-6)
    last = motion.last
    assert last.position("A")[0] == pytest.approx(1 / 12 + 0.25 + 0.25, abs=1e-6)
    np.testing.assert_allclose(last.reaction("F")[0], [2, 10, 0], atol=1e-6)
    # Of the push behind the node that carries the belt, and of friction above it.
    lever = last.position("A")[0] + 0.5 - last.position("F")[0]
    assert last.reaction("F")[1][2] == pytest.approx(10 * lever - 2 * 0.5, abs=1e-5)


# Motions in steps with impulses


def stepped(table, step):
    """The motion of a table in fixed steps."""
    analysis = {key: value for key, value in table["analysis"].items() if key != "accuracy"}
    return solve(Scene.from_dict({**table, "analysis": {**analysis, "integrator": "stepping", "step": step}}))


@pytest.mark.parametrize("restitution", [1.0, 0.0])
def test_rising_floor_throws_or_carries_a_bar_in_steps(restitution):
    last = stepped(thrown(restitution), 0.02).last
    hit = np.sqrt(0.2)
    if restitution:
        # It flies for 0.35 s. It is hit within a step, in which the floor gains 0.02 m/s; it throws with twice that.
        speed = 2.0 * hit
        assert abs(last.position("A")[1] - 0.1 - speed * (0.8 - hit)) < 0.02 * (speed + 2.0 * (0.8 - hit))
        assert last.contacts["c"]["touching"] == []
    else:
        # The floor has a constant acceleration, for which steps are exact.
        assert last.position("A")[1] == pytest.approx(0.32, abs=1e-9)
        np.testing.assert_allclose(last.reaction("F")[0], [0, 1.0, 0], atol=1e-9)
        assert last.reaction("F")[1][2] == pytest.approx(0.2, abs=1e-9)


def test_bead_is_thrown_outwards_along_an_arm_that_turns_in_steps():
    """To second order."""
    missed = []
    for step in (0.1, 0.05):
        last = stepped(bead("space"), step).last
        missed.append(np.linalg.norm(last.position("A") - 0.5 * np.cosh(1.0) * np.array([np.cos(1), np.sin(1), 0.0])))
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.2)
    assert missed[1] < 1e-3
    # Forces are those in the middle of the last step.
    push = 2.0 * np.sinh(1.0 - 0.025)
    assert np.linalg.norm(last.contacts["arm"]["force"]) == pytest.approx(push, rel=1e-2)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_bodies_that_fly_keep_their_momenta_in_steps(friction):
    """Angular momentum too: what is pushed and rubbed acts back on the node that carries the obstacle."""
    contact = {"type": "circle", "radius": 0.1, "restitution": 0.3, "friction": friction}
    table = flying() | {"contacts": {"c": {**contact, "center": [1.05, 0.3], "member": "one", "node": "C"}}}
    table["analysis"] = table["analysis"] | {"output": 0.08}
    motion = stepped(table, 0.02)
    for kind in ("linear", "angular"):
        np.testing.assert_allclose(motion.last.momentum[kind], motion.at(0.0).momentum[kind], atol=1e-11)
    assert np.diff(motion.energies()).max() < 1e-13
    assert motion.energies()[-1] < motion.energies()[0] - 0.05
    kept = [step.energy["total"] + step.energy["dissipated"] for step in motion.steps]
    np.testing.assert_allclose(kept, kept[0], atol=1e-10)


def test_belt_drags_a_block_in_steps():
    """It begins to slide within a step, in which accelerations differ by up to 0.16: by a speed of 0.003 for 0.5 s."""
    last = stepped(belt(), 0.04).last
    assert last.position("A")[0] == pytest.approx(1 / 12 + 0.25 + 0.25, abs=2e-3)
    np.testing.assert_allclose(last.reaction("F")[0], [2, 10, 0], atol=1e-9)
    assert last.contacts["belt"]["sticking"] == []


# What is refused


def scene(changes, kind="static"):
    table = {
        **STRIP,
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "W": {"position": [0.8, -0.3], "support": "clamped"},
        },
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"F": {"type": "force", "node": "B", "value": [0, -1]}},
        "contacts": {"c": {**ROLL, "node": "W"}},
        "analysis": {"type": kind},
    }
    return Scene.from_dict(table).replace(changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contacts.c.node": "X"}, "contacts.c.node: found 'X'"),
        ({"nodes.W.support": "free", "nodes.W.joint": "rigid"}, "nodes.W: node without member"),
        (
            {"nodes.B.joint": "hinge", "contacts.c.node": "B", "nodes.W": None},
            "no rotation of its own that an obstacle",
        ),
        ({"contacts.c": {"type": "point", "position": [1, 0], "side": [0, 1], "member": "beam", "node": "W"}}, "node"),
        ({"contacts.c": {"type": "members", "members": ["beam"], "radius": 0.01, "node": "W"}}, "node: not accepted"),
        ({"members.beam.type": "rigid", "contacts.c.node": "B", "nodes.W": None}, "an end of the rigid member 'beam'"),
    ],
)
def test_refused(changes, message):
    with pytest.raises(SceneError) as error:
        scene(changes)
    assert message in str(error.value)
