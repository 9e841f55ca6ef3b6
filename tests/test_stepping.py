"""Steps with impulses: closed forms, momenta, energy, penetration, friction, agreement with motions event by event."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import made
from scipy.sparse import csc_matrix
from test_contact_motion import FLOOR, G, balance, ball, rod

from sfetcas import SceneError, SolveError, solve
from sfetcas.contact.closest import Closest
from sfetcas.contact.nearby import Nearby
from sfetcas.dynamics.beginning import at_rest
from sfetcas.dynamics.gaps import Near, Touching
from sfetcas.mathematics import complementarity
from sfetcas.mathematics.complementarity import Friction, complementary
from sfetcas.mechanics.center_lines import Along, Lines, gained
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble

RADIUS = 0.01


def stepped(table, step, **more):
    """The motion of a table in steps with impulses."""
    analysis = {**table["analysis"], "step": step, "integrator": "stepping", **more}
    return solve(made({**table, "analysis": analysis}))


def bars(kind, end, *, space=True, restitution=0.0, friction=0.0, **more):
    """Two bars that fly towards each other, crosswise in space; in the plane an end hits a side.

    With friction the first one also moves along the other.
    """
    nodes = {"a": [-0.5, 0.0, 0.0], "b": [0.5, 0.0, 0.0], "c": [0.2, 0.1, -0.5], "d": [0.2, 0.1, 0.5]}
    if not space:
        nodes |= {"c": [0.1, 0.05, 0.0], "d": [0.4, 0.8, 0.0]}
    axes, up = 3 if space else 2, {"a": 0.5, "b": 0.5, "c": -0.5, "d": -0.5}
    elements = {"elements": 4} if kind == "flexible" else {}
    section = {"EI2": 0.5, "EI3": 0.5, "GJ": 0.5, "rhoA": 1.0, "rhoI": [2e-4, 1e-4, 1e-4]}
    return {
        "dimension": "space" if space else "plane",
        "sections": {"s": {**section, **more}},
        "nodes": {
            n: {"position": at[:axes], "velocity": [0.3 * (friction > 0.0) * (n in "ab"), up[n]]}
            for n, at in nodes.items()
        },
        "members": {
            m: {"nodes": list(ends), "section": "s", "type": kind, **elements} for m, ends in (("m", "ab"), ("n", "cd"))
        },
        "contacts": {
            "c": {
                "type": "members",
                "members": "all",
                "radius": RADIUS,
                "restitution": restitution,
                "friction": friction,
            }
        },
        "analysis": {"type": "dynamic", "end": end, "output": end / 10},
    }


def deepest(motion, contact="c"):
    """The smallest gap at the times of the answer, m."""
    return min(float(np.min(step.contacts[contact]["gap"])) for step in motion.steps)


# -- one body -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_ball_comes_to_rest(dimension):
    """It keeps no speed, and the floor then carries its weight."""
    motion = stepped({**ball(FLOOR, [0, 1], {"end": 0.8}), "dimension": dimension}, 0.01)
    assert motion.last.position("B")[1] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(motion.last.contacts["stop"]["force"], [0.0, 20.0, 0.0], atol=1e-9)
    assert motion.last.contacts["stop"]["touching"] == ["nodes.B"]
    assert motion.last.energy["dissipated"] == pytest.approx(20.0, rel=1e-9)
    (event,) = motion.events
    # Found at the end of the step in which it happens, whose weight it contains.
    assert 0.0 <= event.time - np.sqrt(2 / G) <= 0.01 + 1e-9
    assert event.impulse == pytest.approx(2.0 * np.sqrt(2 * G), rel=0.03)


def test_a_ball_bounces_and_finer_steps_come_nearer_to_where_it_is():
    """The impact is somewhere in a step, so that heights are of first order."""
    table = ball({**FLOOR, "restitution": 0.5}, [0, 1], {"end": 0.7, "output": 0.7})
    speed, t = 0.5 * np.sqrt(2 * G), 0.7 - np.sqrt(2 / G)
    exact = speed * t - 0.5 * G * t**2
    for step in (0.02, 0.005, 0.00125):
        # It leaves the floor up to a step too late, and its speed at the begin of that step is up to G h too low.
        assert abs(stepped(table, step).last.position("B")[1] - exact) < (speed + G * t) * step


@pytest.mark.parametrize("side", ["inside", "outside"])
def test_a_point_slides_on_a_circle_and_loses_next_to_nothing(side):
    """Until it leaves the outside, or swings through the bottom inside: to second order in the step."""
    inside = side == "inside"
    start = np.array([-0.8, -0.6]) if inside else np.array([0.6, 0.8])
    stop = {"type": "circle", "center": [0, 0], "radius": 1.0, "side": side, "members": "all"}
    end = 0.5 if inside else 0.15
    table = ball(stop, start, {"end": end, "output": end / 5}, out=-start if inside else start)
    motions = [stepped(table, step) for step in (end / 50, end / 100, end / 200)]
    for motion in motions:
        assert np.diff(motion.energies()).max() < 1e-13
        # Where it is on the circle it is so to rounding.
        np.testing.assert_allclose(np.linalg.norm(motion.positions("B")[:, :2], axis=1), 1.0, atol=1e-12)
    lost = [motion.energies()[0] - motion.energies()[-1] for motion in motions]
    assert lost[0] > 4.0 * lost[1] > 16.0 * lost[2]
    a, b, c = (motion.last.position("B") for motion in motions)
    assert np.linalg.norm(a - b) / np.linalg.norm(b - c) == pytest.approx(4.0, rel=0.1)


def test_a_rod_falls_flat_and_stays():
    """Both ends share its weight, and all that it had is lost."""
    motion = stepped(rod(0.0, 0.2, {"end": 0.3, "output": 0.05}), 0.005)
    np.testing.assert_allclose(motion.last.contacts["floor"]["force"], [0.0, G, 0.0], atol=1e-9)
    assert motion.last.energy["dissipated"] == pytest.approx(0.2 * G, rel=1e-9)
    assert np.abs(balance(motion)).max() < 1e-12


def test_forces_on_a_soft_rod_are_what_its_momentum_gains():
    """In each step; balanced by accelerations, which go to and fro from step to step, they would pull at times."""
    motion = stepped(rod(0.3, 0.1, {"end": 0.2, "output": 0.002}, kind="flexible"), 0.002)
    momenta = np.array([step.momentum["linear"][1] for step in motion.steps])
    forces = np.array([step.contacts["floor"]["force"][1] for step in motion.steps])
    np.testing.assert_allclose(forces[1:], np.diff(momenta) / 0.002 + G, atol=1e-8)
    assert forces.min() > -1e-9
    assert forces.max() > 2.0 * G


def test_energy_does_not_grow_where_a_step_turns_far():
    """A limp rod of which an end is whirled round when it hits the floor: beyond a radian a step is divided."""
    table = rod(0.3, 0.1, {"end": 0.26, "output": 0.01}, kind="flexible")
    table["sections"]["s"] |= {"EI3": 1e-3, "rhoI": [1e-6, 5e-7, 5e-7]}
    energies = stepped(table, 0.002).energies()
    # It grew to 162 J.
    assert np.diff(energies).max() < 1e-9


def test_what_has_no_inertia_about_itself_is_named():
    """A thin rod in space on a slanting floor, of which nothing says how fast it spins."""
    table = {**rod(0.0, 0.2, {"end": 0.4}), "dimension": "space"}
    table["sections"]["s"].pop("rhoI")
    table["contacts"]["floor"]["normal"] = [0, 1, 0.3]
    with pytest.raises(SolveError, match=r"members\.m has no inertia about its axis, see rhoI"):
        stepped(table, 0.02)


@pytest.mark.parametrize("by_rows", [True, False])
def test_what_is_heavy_elsewhere_changes_nothing(by_rows, monkeypatch):
    """A rod of 1 kg that hits a floor, alone and in a scene with a body of a million tons."""
    monkeypatch.setattr("sfetcas.dynamics.simulation.by_rows", lambda scene: by_rows)
    ends = []
    for mass in (None, 1e9):
        table = rod(0.3, 0.1, {"end": 0.2}, restitution=0.5)
        table["contacts"]["floor"]["members"] = ["m"]
        if mass:
            table["nodes"] |= {
                "C": {"position": [0, 50], "mass": mass, "inertia": [mass] * 3},
                "D": {"position": [1, 50]},
            }
            table["members"]["other"] = {"nodes": ["C", "D"], "type": "rigid"}
        ends.append(stepped(table, 0.01).last.velocity("B"))
    # What is left of it is rounding of the heavy one.
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)


def on_a_light_body(mass):
    """A ball that hits a plane on a light body, without gravity; it keeps all of its speed."""
    stop = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": ["bar"], "node": "P", "restitution": 1.0}
    table = ball(stop, [0.0, 0.3], {}, velocity=[0, -3.0])
    table["gravity"] = [0, 0]
    table["nodes"] |= {
        "P": {"position": [0, 0], "mass": mass, "inertia": [0.1 * mass] * 3},
        "Q": {"position": [0.2, -0.2]},
    }
    table["members"]["plate"] = {"nodes": ["P", "Q"], "type": "rigid"}
    return table


@pytest.mark.parametrize("step", [0.007, 0.008])
@pytest.mark.parametrize("mass", [0.1, 0.01])
def test_all_of_the_speed_is_kept_beside_light_bodies(mass, step):
    """No rounding makes the restitution half of one."""
    motion = stepped({**on_a_light_body(mass), "analysis": {"type": "dynamic", "end": 0.3}}, step)
    left = motion.last.velocity("P")[1] - motion.last.velocity("B")[1]
    assert left == pytest.approx(-3.0, rel=1e-6)


def test_a_rod_tips_over_as_event_by_event():
    table = rod(0.6, 0.45, {"end": 0.4, "output": 0.1})
    exact = solve(made({**table, "analysis": {**table["analysis"], "integrator": "radau-3", "step": 0.01}}))
    missed = []
    for step in (0.005, 0.0025):
        motion = stepped(table, step)
        missed.append(np.abs(motion.positions("B") - exact.positions("B")).max())
        assert np.diff(motion.energies()).max() < 1e-12
    assert missed[1] < 0.6 * missed[0]
    assert missed[1] < 1e-4


# -- two bodies ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("space", "restitution"), [(False, 0.0), (True, 0.6)])
def test_rigid_bars_hit_each_other_as_event_by_event(space, restitution):
    """Between impacts nothing acts: what is told is as accurate as steps are, of second order."""
    table = bars("rigid", 0.3, space=space, restitution=restitution)
    exact = solve(made({**table, "analysis": {**table["analysis"], "integrator": "radau-3", "step": 0.005}}))
    missed = []
    for step in (0.004, 0.002):
        motion = stepped(table, step)
        missed.append(np.abs(motion.positions("d") - exact.positions("d")).max())
    assert missed[1] < 0.5 * missed[0]
    assert missed[1] < 1e-6
    assert motion.last.energy["total"] == pytest.approx(exact.last.energy["total"], rel=1e-5)
    assert deepest(motion) > -1e-6 * RADIUS


@pytest.mark.parametrize(
    ("kind", "space", "restitution", "friction"),
    [
        ("rigid", True, 0.6, 0.4),
        ("flexible", False, 1.0, 0.4),
        ("flexible", False, 0.0, 0.0),
        ("flexible", False, 1.0, 0.0),
        ("flexible", True, 0.0, 0.4),
        ("flexible", True, 1.0, 0.0),
    ],
)
def test_bars_keep_momenta_and_lose_energy(kind, space, restitution, friction):
    """With friction at the surfaces of both, not at their centre lines, angular momentum too."""
    motion = stepped(bars(kind, 0.3, space=space, restitution=restitution, friction=friction), 0.006)
    assert motion.events
    for kind in ("linear", "angular"):
        values = np.array([step.momentum[kind] for step in motion.steps])
        # Newton's method ends one iteration after a change of 1e-8 at most, of which old factors leave a hundredth.
        np.testing.assert_allclose(values, np.tile(values[0], (len(values), 1)), atol=1e-10)
    # Rounding of energies of 0.2 J.
    assert np.diff(motion.energies()).max() < 1e-13
    assert motion.energies()[-1] < 0.99 * motion.energies()[0]
    np.testing.assert_allclose(balance(motion), balance(motion)[0], atol=1e-11)
    assert deepest(motion) > -1e-6 * RADIUS


def test_a_bar_falls_on_a_beam_that_is_clamped_and_carries_a_hinge():
    """Supports and joints beside contact: forces on the beam are told, nothing penetrates, no energy is gained."""
    table = bars("flexible", 0.5)
    table["gravity"] = [0, -G]
    table["nodes"]["a"] = {"position": [-0.5, 0, 0], "support": "clamped"}
    table["nodes"]["b"] = {"position": [0.5, 0, 0], "joint": "hinge"}
    table["nodes"]["e"] = {"position": [0.8, 0, 0]}
    table["sections"]["stiff"] = {**table["sections"]["s"], "EI2": 50.0, "EI3": 50.0, "GJ": 50.0}
    table["members"]["m"]["section"] = "stiff"
    table["members"]["arm"] = {"nodes": ["b", "e"], "section": "s", "type": "rigid"}
    for node in "cd":
        table["nodes"][node].pop("velocity")
    motion = stepped(table, 0.004)
    assert motion.events
    assert np.diff(motion.energies()).max() < 1e-12
    assert deepest(motion) > -1e-6 * RADIUS
    np.testing.assert_allclose(motion.positions("a"), np.tile([-0.5, 0, 0], (len(motion.steps), 1)), atol=1e-12)


def test_what_is_missed_before_a_step_is_found_after_it(monkeypatch):
    """Also if nothing at all is found before it."""
    found = Nearby.found

    def blind(self, curve, reach, *, ends=True):
        there = found(self, curve, reach, ends=ends)
        return there.chosen(np.zeros(0, int)) if ends else there

    monkeypatch.setattr(Nearby, "found", blind)
    motion = stepped(bars("rigid", 0.12), 0.004, output=0.004)
    assert motion.events
    assert deepest(motion) > -1e-6 * RADIUS


def test_rods_that_lie_along_each_other_do_not_penetrate_anywhere():
    """One falls on a beam and slides along it: touches wander from element to element."""
    table = bars("flexible", 0.24, space=False)
    table["gravity"] = [0, -G]
    table["sections"]["s"] |= {"EI3": 0.02}
    for member in "mn":
        table["members"][member]["elements"] = 2
    table["nodes"] = {
        "a": {"position": [-0.5, 0.0], "support": "clamped"},
        "b": {"position": [0.5, 0.0], "support": "slider", "direction": [1.0, 0.0]},
        "c": {"position": [-0.45, 0.0205], "velocity": [0.5, -1.0]},
        "d": {"position": [0.45, 0.024], "velocity": [0.5, -1.0]},
    }
    motion = stepped(table, 0.004, output=0.004)
    assert np.diff(motion.energies()).max() < 1e-12
    assert deepest(motion) > -1e-6 * RADIUS


# -- friction -----------------------------------------------------------------------------------------------

DIAMETER, SLOPE = 2 * RADIUS, 0.3


def slope(friction, *, crosswise, speed=0.0, end=0.2):
    """A held rail that goes down in the plane, and a block on it with two round feet; or two rails, a rod across."""
    down, up = (np.array(v) for v in ([np.cos(SLOPE), -np.sin(SLOPE)], [np.sin(SLOPE), np.cos(SLOPE)]))
    axes = 3 if crosswise else 2

    def at(along, across, aside=0.0):
        return [*(along * down + across * up), aside][:axes]

    rails = {f"rail{k}": z for k, z in enumerate((-0.2, 0.2) if crosswise else (0.0,))}
    nodes, members = {}, {}
    for rail, z in rails.items():
        nodes |= {f"{rail} a": {"position": at(-0.2, 0.0, z), "support": "clamped"}}
        nodes |= {f"{rail} b": {"position": at(1.0, 0.0, z)}}
        members[rail] = {"nodes": [f"{rail} a", f"{rail} b"]}
    if crosswise:
        chain, ways = ["m", "n"], [(0.0, DIAMETER, -0.3), (0.0, DIAMETER, 0.3)]
    else:
        chain, ways = ["m", "k", "l", "n"], [(0.0, DIAMETER), (0.0, 0.05), (0.1, 0.05), (0.1, DIAMETER)]
    start = {} if speed == 0.0 else {"velocity": [*(speed * down), 0.0][:axes]}
    nodes |= {name: {"position": at(*way), **start} for name, way in zip(chain, ways, strict=True)}
    members |= {f"{a}{b}": {"nodes": [a, b]} for a, b in itertools.pairwise(chain)}
    touching = [*rails, "mn"] if crosswise else [*rails, "mk", "ln"]
    return {
        "dimension": "space" if crosswise else "plane",
        "gravity": [0, -G],
        "sections": {"s": {"shape": "circle", "radius": RADIUS, "E": 1e9, "nu": 0.3, "rho": 1000.0}},
        "nodes": nodes,
        "members": {name: {**member, "section": "s", "type": "rigid"} for name, member in members.items()},
        "contacts": {"c": {"type": "members", "members": touching, "friction": friction}},
        "analysis": {"type": "dynamic", "end": end, "output": end / 5},
    }


def moved_down(motion):
    """How far it has moved down the slope at the times of the answer, m."""
    at = motion.positions("m")
    return (at - at[0]) @ [np.cos(SLOPE), -np.sin(SLOPE), 0.0]


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_a_block_slides_on_a_rail_or_sticks(friction):
    """Below the angle of friction it does not creep; above it slides with g (sin a - mu cos a)."""
    motion = stepped(slope(friction, crosswise=False), 0.01)
    told, weight = motion.last.contacts["c"], 0.16 * np.pi * RADIUS**2 * 1000.0 * G
    pull, push = np.sin(SLOPE), np.cos(SLOPE)
    if friction > np.tan(SLOPE):
        # Rounding of places of 0.1 m.
        assert np.abs(moved_down(motion)).max() < 1e-13
        assert all(told["sticking"])
        np.testing.assert_allclose(np.linalg.norm(np.sum(told["friction"], axis=0)), pull * weight, rtol=1e-6)
    else:
        fall = 0.5 * G * (pull - friction * push) * motion.times**2
        # Normals turn by a tenth in a step in which it moves by a tenth of their distance: to the square of half of it.
        np.testing.assert_allclose(moved_down(motion), fall, rtol=2e-3, atol=1e-6)
        assert not any(told["sticking"])
        np.testing.assert_allclose(np.linalg.norm(told["friction"], axis=1).sum(), friction * push * weight, rtol=1e-3)
    assert np.diff(motion.energies()).max() < 1e-15
    assert deepest(motion) > -1e-6 * RADIUS


def test_a_block_that_slides_up_or_down_stops_where_its_energy_says():
    """It is held back by mu N - W sin a, and then stays."""
    friction, speed = 0.6, 0.3
    motion = stepped(slope(friction, crosswise=False, speed=speed), 0.01)
    way = 0.5 * speed**2 / (G * (friction * np.cos(SLOPE) - np.sin(SLOPE)))
    # Of the first order: it stops within a step, in which it moves by up to 1 % of the way.
    assert moved_down(motion)[-1] == pytest.approx(way, rel=1e-2)
    assert moved_down(motion)[-1] == pytest.approx(moved_down(motion)[-2], abs=1e-13)
    assert np.diff(motion.energies()).max() < 1e-15


@pytest.mark.parametrize("friction", [0.08, 0.4])
def test_a_rod_rolls_or_slides_down_two_rails(friction):
    """It rolls with 2/3 g sin a if friction can be a third of the pull, and spins more slowly than it slides else."""
    motion = stepped(slope(friction, crosswise=True), 0.01)
    pull, push = np.sin(SLOPE), np.cos(SLOPE)
    rolls = friction > np.tan(SLOPE) / 3.0
    faster = G * pull * 2.0 / 3.0 if rolls else G * (pull - friction * push)
    # As the block, at up to twice the speed.
    np.testing.assert_allclose(moved_down(motion), 0.5 * faster * motion.times**2, rtol=2e-3, atol=1e-6)
    spin = faster / RADIUS if rolls else 2.0 * friction * G * push / RADIUS
    assert motion.last.angular_velocity("m")[2] == pytest.approx(-spin * motion.times[-1], rel=5e-3)
    assert motion.last.contacts["c"]["sticking"] == [rolls, rolls]
    np.testing.assert_allclose(balance(motion), balance(motion)[0], atol=1e-8)


def test_a_ball_slides_on_a_floor_and_stops():
    """After v^2 / 2 mu g, and stays."""
    table = ball({**FLOOR, "friction": 0.5}, [0, 0], {"end": 0.3, "output": 0.05}, velocity=[1.0, 0.0])
    motion = stepped(table, 0.01)
    assert motion.last.position("B")[0] == pytest.approx(0.1, abs=1e-6)
    assert motion.last.contacts["stop"]["sticking"] == ["nodes.B"]
    sliding = motion.at(0.1).contacts["stop"]
    np.testing.assert_allclose(sliding["friction"], [-10.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(sliding["force"], [-10.0, 20.0, 0.0], atol=1e-9)
    assert motion.last.energy["dissipated"] == pytest.approx(1.0, rel=1e-9)


# -- many ---------------------------------------------------------------------------------------------------


def heap(count, kind="flexible", friction=0.0):
    """Rods that lie above each other and fall on a floor."""
    rng, nodes, members = np.random.default_rng(1), {}, {}
    for k in range(count):
        angle, tilt = rng.uniform(0, np.pi), rng.uniform(-0.02, 0.02)
        middle, half = np.array([0.0, 0.02 + 0.04 * k, 0.0]), 0.3 * np.array([np.cos(angle), tilt, np.sin(angle)])
        nodes |= {f"a{k}": {"position": list(middle - half)}, f"b{k}": {"position": list(middle + half)}}
        members[f"m{k}"] = {"nodes": [f"a{k}", f"b{k}"], "section": "s", "type": kind}
        members[f"m{k}"] |= {"elements": 4} if kind == "flexible" else {}
    return {
        "dimension": "space",
        "gravity": [0, -G, 0],
        "sections": {"s": {"shape": "circle", "radius": RADIUS, "E": 1e7, "nu": 0.3, "rho": 1000.0}},
        "nodes": nodes,
        "members": members,
        "contacts": {
            "c": {"type": "members", "members": "all", "radius": RADIUS, "friction": friction},
            "floor": {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0], "members": "all", "friction": friction},
        },
        "analysis": {"type": "dynamic", "end": 0.2, "output": 0.02},
    }


@pytest.mark.parametrize(("kind", "friction"), [("rigid", 0.3), ("rigid", 0.0), ("flexible", 0.0), ("flexible", 0.3)])
def test_a_heap_falls_without_gaining_energy_or_penetrating(kind, friction):
    motion = stepped(heap(4, kind, friction), 0.002)
    touched = {event.name for event in motion.events}
    assert touched == {"contacts.c", "contacts.floor"}
    weight = 4 * 0.6 * np.pi * RADIUS**2 * 1000.0 * G
    assert np.diff(motion.energies()).max() < 1e-13 * weight
    assert deepest(motion) > -1e-6 * RADIUS
    assert min(float(motion.positions(f"a{k}")[:, 1].min()) for k in range(4)) > -1e-9
    np.testing.assert_allclose(balance(motion), 0.0, atol=1e-9)


# -- refusals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"initial": "equilibrium"}, r"analysis.initial: found 'equilibrium' with the integrator 'stepping'"),
        ({"step": None}, r"analysis.step: the key 'step' is missing"),
    ],
)
def test_what_steps_with_impulses_do_not_know_is_refused(change, message):
    table = rod(0.3, 0.1, {"end": 0.2, "integrator": "stepping", "step": 0.01})
    table["analysis"] |= change
    table["analysis"] = {key: value for key, value in table["analysis"].items() if value is not None}
    with pytest.raises(SceneError, match=message):
        solve(made(table))


def test_friction_between_members_is_refused_where_it_is_not_known():
    """Event by event, and where it would spin a member without inertia."""
    table = bars("rigid", 0.1, friction=0.3)
    with pytest.raises(SceneError, match=r"contacts.c.friction: found between members in a motion, .* 'stepping'"):
        solve(made(table))
    table["sections"]["s"].pop("rhoI")
    with pytest.raises(SceneError, match=r"contacts.c: found the member 'm', which friction would spin .* rhoI"):
        stepped(table, 0.01)


def test_what_begins_inside_is_refused():
    table = bars("rigid", 0.1)
    for node in "cd":
        table["nodes"][node]["position"][1] = 0.01
    with pytest.raises(
        SceneError,
        match=r"contacts.c: members 'n' and 'm' penetrate by 0.01 m at [\d.]+ and [\d.]+ of their lengths at t = 0",
    ):
        stepped(table, 0.01)


# -- parts --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dense", [0, complementarity.DENSE])
@pytest.mark.parametrize(("count", "rank"), [(6, 6), (8, 5)])
def test_complementarity_against_all_choices(count, rank, dense, monkeypatch):
    """Also where rows depend on each other: then what they do together is unique."""
    monkeypatch.setattr(complementarity, "DENSE", dense)
    rng = np.random.default_rng(count)
    rows = rng.normal(size=(count, rank))
    matrix, b = rows @ rows.T, rows @ rng.normal(size=rank)
    found = np.zeros(count)
    for _ in range(4):
        # From solution to solution what makes it unique dies away.
        found = complementary(csc_matrix(matrix), b, found)
    assert found is not None
    opening = matrix @ found + b
    assert found.min() >= 0.0
    assert opening.min() > -1e-8
    assert abs(found @ opening) < 1e-8
    best = [
        rows[list(chosen)].T @ x
        for size in range(count + 1)
        for chosen in itertools.combinations(range(count), size)
        for x in [np.linalg.lstsq(matrix[np.ix_(chosen, chosen)], -b[list(chosen)], rcond=None)[0]]
        if (x >= -1e-12).all() and (matrix[:, list(chosen)] @ x + b >= -1e-9).all()
    ]
    np.testing.assert_allclose(rows.T @ found, best[0], atol=1e-7)


def test_rounds_over_rough_contacts_that_lead_away_are_given_up(monkeypatch):
    """Friction turns impulses about: contacts one by one may ask each other for more and more, up to an overflow."""
    monkeypatch.setattr(complementarity, "_by_newton_with_friction", lambda *a: None)
    matrix = np.eye(4)
    # Both slide, and the friction of each presses the other one.
    matrix[[2, 3], [0, 1]], matrix[[1, 0], [2, 3]] = 10.0, 2.0
    law = Friction(np.arange(2), 2 + np.arange(2).reshape(2, 1), np.array([5.0, 5.0]))
    assert complementary(csc_matrix(matrix), np.array([-1.0, -2.0, 0.5, 0.3]), np.zeros(4), law) is None


@pytest.mark.parametrize("directions", [1, 2])
@pytest.mark.parametrize("start", ["newton", "rounds"])
def test_impulses_obey_the_law_of_coulomb(directions, start, monkeypatch):
    """Of as many contacts as there are unknowns, also where Newton's method does not end by itself."""
    rng, count = np.random.default_rng(directions), 12
    if start == "rounds":
        own, tries = complementarity._by_newton_with_friction, itertools.count()
        monkeypatch.setattr(
            complementarity, "_by_newton_with_friction", lambda *a: None if next(tries) < 6 else own(*a)
        )
    size = count * (1 + directions)
    rows = rng.normal(size=(size, 2 * size))
    matrix, b = rows @ rows.T / size, rows @ rng.normal(size=2 * size)
    law = Friction(
        np.arange(count), count + np.arange(count * directions).reshape(count, -1), rng.uniform(0.3, 2, count)
    )
    found = complementary(csc_matrix(matrix), b, np.zeros(size), law)
    found = complementary(csc_matrix(matrix), b, found, law)
    opening = matrix @ found + b
    pushes, slips, along = found[:count], opening[law.along], found[law.along]
    speed, most = np.linalg.norm(slips, axis=1), law.coefficients * pushes
    # A small diagonal of 1e-9 has its share after two solutions.
    assert min(found[:count].min(), opening[:count].min()) > -1e-8
    assert np.abs(pushes * opening[:count]).max() < 1e-8
    assert (np.linalg.norm(along, axis=1) < most + 1e-9).all()
    slides = speed > 1e-5
    assert slides.sum() > 1
    assert (~slides & (pushes > 0.0)).sum() > 1
    np.testing.assert_allclose(along[slides], -(most[slides] / speed[slides])[:, None] * slips[slides], atol=1e-5)


def _near(dimension, seed=3):
    """Equations and a state of rods at random, of which some are rigid and one is curved."""
    rng, nodes, members = np.random.default_rng(seed), {}, {}
    axes = 3 if dimension == "space" else 2
    for k in range(8):
        middle, way = rng.uniform(-0.4, 0.4, axes), rng.normal(size=axes)
        # An arc is in a plane that is known.
        way[2:] *= k != 2
        half = 0.5 * way / np.linalg.norm(way)
        nodes |= {f"a{k}": {"position": list(middle - half)}, f"b{k}": {"position": list(middle + half)}}
        kinds = ({"type": "rigid"}, {}, {"shape": {"type": "arc", "angle": 0.5}})
        members[f"m{k}"] = {"nodes": [f"a{k}", f"b{k}"], "section": "s", **kinds[k % 3 if k < 3 else 1]}
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}
    contact = {"type": "members", "members": "all", "radius": RADIUS, "friction": 0.3}
    table = {"dimension": dimension, "sections": {"s": section}, "nodes": nodes, "members": members}
    scene = made({**table, "contacts": {"c": contact}})
    mesh = uniform_mesh(scene, 2, 5)
    model = assemble(scene, replace(mesh, places=True, spots=()), assembly="nodal")
    equations = Equations(model)
    return equations, at_rest(model)


def _curve(lines, equations, state):
    places = (equations.model.positions.Y @ state.y).reshape(-1, lines.axes)
    return lines.curve(state.q, places)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_lines_have_the_derivatives_of_their_positions(dimension):
    equations, state = _near(dimension)
    lines, rng = Lines(equations.model, equations.model.members, equations.tables), np.random.default_rng(0)
    change = np.concatenate([0.3 * rng.normal(size=equations.unknowns), np.zeros(equations.rows)])
    state = equations.moved(state, change)
    along = Along(np.arange(len(lines.owner)), rng.uniform(size=len(lines.owner)))
    ways = rng.normal(size=(len(along), lines.axes))
    found = lines.derivatives(_curve(lines, equations, state), along, ways)
    step = rng.normal(size=equations.total)
    step[equations.unknowns :] = 0.0
    ends = [
        (ways * lines.positions(_curve(lines, equations, equations.moved(state, s * step)), along)).sum(axis=1)
        for s in (1e-6, -1e-6)
    ]
    np.testing.assert_allclose(found @ step, (ends[0] - ends[1]) / 2e-6, atol=1e-8)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_gaps_and_slips_gain_what_their_rows_say(dimension):
    """Exactly between two states that differ much; and in small steps of the end by its derivatives."""
    equations, state = _near(dimension)
    touching = Touching(SimpleNamespace(model=equations.model, tables=equations.tables))
    rng, axes = np.random.default_rng(0), touching.axes

    def pose(state):
        return touching.pose(state.q, (equations.model.positions.Y @ state.y).reshape(-1, axes))

    def moved(state, size):
        step = np.concatenate([size * rng.normal(size=equations.unknowns), np.zeros(equations.rows)])
        return equations.moved(state, step), step

    after, _ = moved(state, 0.1)
    begin, end = pose(state), pose(after)
    near = Near(touching.nearby.found(begin.curve, 0.2), np.zeros(0, int))
    assert len(near) > 5
    full = np.concatenate([gained(begin.q, end.q).ravel(), (end.places - begin.places).ravel()])
    rows = touching.rows(begin, end, near, middle=True)
    slips = touching.slips(begin, end, near)
    assert len(slips) == (axes - 1) * len(near)
    told = np.concatenate([touching.gaps(end, near) - touching.gaps(begin, near), slips])
    np.testing.assert_allclose(rows.along(full), told, atol=1e-13)
    matrix = touching.rows(begin, end, near, near).matrix(touching.lines)
    further, step = moved(after, 1e-6)
    there = pose(further)
    # Directions across the normal turn with it, which Newton's method leaves out: by the slip over the distance.
    apart = np.linalg.norm(touching.nearby.between(end.curve, near.places), axis=1)
    left_out = 1e-4 * (1.0 + np.abs(told).max() / apart.min())
    change = np.concatenate([touching.gaps(there, near), touching.slips(begin, there, near)]) - np.concatenate(
        [touching.gaps(end, near), slips]
    )
    np.testing.assert_allclose(matrix[: len(near)] @ step, change[: len(near)], atol=1e-9)
    assert np.abs(matrix[len(near) :] @ step - change[len(near) :]).max() < left_out


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_the_same_minima_are_found_as_by_the_search_of_statics(dimension):
    equations, state = _near(dimension)
    nearby = Closest(equations.model.scene).nearby(equations.model, equations.tables)
    closest, curve = Closest(equations.model.scene), _curve(nearby.lines, equations, state)
    reach, unit = 0.1, equations.model.scales.length
    found = nearby.found(curve, reach / unit, ends=False)
    gaps = np.sort(nearby.gaps(curve, found)) * unit
    fields = Fields(equations, state, equations.model.loading(0.0))
    wanted = np.sort([near.gap for near in closest.found(fields, reach)])
    assert len(wanted) > 5
    # Lines of curved members between the ends of their elements differ by the error of the mesh.
    np.testing.assert_allclose(gaps, wanted, atol=1e-5)
