"""Obstacles in motion: impacts, sliding, lifting off and rest, against closed forms, SciPy and identities."""

import json

import numpy as np
import pytest
from scenes import made
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import sfetcas
from sfetcas import Scene, SceneError, dump, solve
from sfetcas.cli import main
from sfetcas.dynamics.impacts import Collision, Impacts
from sfetcas.mechanics.equations import State
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.spots import fine_enough, spots_of

G = 10.0
SLENDER = [1e-6, 0.0, 0.0]
FLOOR = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}


def ball(contact, at, analysis, *, velocity=None, out=(0.0, 1.0), **more):
    """A heavy point at B, on a body that does not turn unless something makes it."""
    start = {} if velocity is None else {"velocity": velocity}
    return {
        "gravity": [0, -G],
        "nodes": {
            "B": {"position": list(at), "mass": 2.0, "inertia": [0.01, 0.01, 0.01], **start},
            "C": {"position": [at[0] + 0.1 * out[0], at[1] + 0.1 * out[1]], **start},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "contacts": {"stop": contact},
        "analysis": {"type": "dynamic", **analysis},
        **more,
    }


def rod(tilt, height, analysis, *, kind="rigid", restitution=0.0, **more):
    """A uniform rod of the mass and length one, whose first end is at a height above a floor."""
    section = (
        {"rhoA": 1.0, "rhoI": SLENDER}
        if kind == "rigid"
        else {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0, "damping": 0.02}
    )
    other = {} if kind == "rigid" else {"elements": 4}
    return {
        "gravity": [0, -G],
        "sections": {"s": section},
        "nodes": {
            "A": {"position": [0, height]},
            "B": {"position": [np.cos(tilt), height + np.sin(tilt)]},
        },
        "members": {"m": {"nodes": ["A", "B"], "type": kind, "section": "s", **other}},
        "contacts": {"floor": {**FLOOR, "restitution": restitution}},
        "analysis": {"type": "dynamic", **analysis},
        **more,
    }


def balance(motion):
    """Total energy and what impacts took, over the times."""
    return np.array([step.energy["total"] + step.energy["dissipated"] for step in motion.steps])


# -- impacts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dimension", "integrator"), [("plane", "radau-3"), ("space", "radau-2"), ("plane", "generalised-alpha")]
)
def test_a_ball_bounces(dimension, integrator):
    """Each flight lasts half as long as the one before, and all of them come to an end."""
    table = ball({**FLOOR, "restitution": 0.5}, [0, 1], {"end": 1.6, "step": 0.02, "integrator": integrator})
    motion = solve(made({**table, "dimension": dimension}))
    fall, speed = np.sqrt(2 / G), np.sqrt(2 * G)
    times = fall + 2 * speed / G * np.cumsum([0.0, 0.5, 0.25, 0.125, 0.0625])
    hits = motion.events[:5]
    np.testing.assert_allclose([event.time for event in hits], times, rtol=1e-8)
    speeds = speed * 0.5 ** np.arange(5)
    np.testing.assert_allclose([event.impulse for event in hits], 2.0 * 1.5 * speeds, rtol=1e-7)
    np.testing.assert_allclose([event.dissipated for event in hits], 0.75 * speeds**2, rtol=1e-7)
    assert {(event.name, event.where, event.side, event.acts) for event in hits} == {
        ("contacts.stop", "nodes.B", "touching", False)
    }
    # In the middle of its second flight it is a quarter as high as at the begin; the third is a quarter of that.
    tops = [min(motion.between([t]), key=lambda step: step.time) for t in 0.5 * (times[:2] + times[1:3])]
    np.testing.assert_allclose([top.position("B")[1] for top in tops], [0.25, 0.0625], atol=1e-7)
    assert motion.events[-1].acts
    assert motion.events[-1].time == pytest.approx(fall + 2 * speed / G, abs=5e-3)
    last = motion.last
    np.testing.assert_allclose(last.contacts["stop"]["force"], [0.0, 20.0, 0.0], atol=1e-6)
    assert last.contacts["stop"]["touching"] == ["nodes.B"]
    assert last.energy["dissipated"] == pytest.approx(20.0, rel=1e-6)
    # Velocities between long steps are less accurate than positions.
    assert balance(motion).max() < 1e-6


def test_bounces_that_are_no_larger_than_the_accuracy_end():
    """Not every one of them is a step."""
    table = ball({**FLOOR, "restitution": 0.5}, [0, 1], {"end": 1.36, "step": 0.02})
    table["nodes"]["C"]["position"] = [0, 1.2]
    motion = solve(made(table))
    assert len(motion.events) < 30
    assert motion.events[-1].acts
    assert motion.last.contacts["stop"]["force"][1] == pytest.approx(20.0)


def test_without_restitution_it_stays_and_with_all_of_it_nothing_is_lost():
    still = solve(made(ball(FLOOR, [0, 1], {"end": 1.0, "step": 0.05})))
    (event,) = still.events
    assert (event.acts, event.impulse) == (True, pytest.approx(2.0 * np.sqrt(2 * G), rel=1e-9))
    assert still.last.position("B")[1] == pytest.approx(0.0, abs=1e-9)
    lively = solve(made(ball({**FLOOR, "restitution": 1.0}, [0, 1], {"end": 2.0, "step": 0.05})))
    assert len(lively.events) == 2
    assert lively.last.energy["dissipated"] == pytest.approx(0.0, abs=1e-9)
    t = 2.0 - 4.0 * np.sqrt(2 / G)
    assert lively.last.position("B")[1] == pytest.approx(1.0 - 0.5 * G * t**2, abs=1e-7)


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("restitution", [0.0, 0.4])
def test_a_rod_hits_the_floor_with_one_end(dimension, restitution):
    """Impulse, what is lost, and how fast the rod turns then, in closed form."""
    tilt, height = 0.6, 0.45
    table = rod(tilt, height, {"end": 0.4, "step": 0.01}, restitution=restitution)
    motion = solve(made({**table, "dimension": dimension}))
    event, speed, c = motion.events[0], np.sqrt(2 * G * height), np.cos(tilt)
    # The mass that the end has across the floor is 1 / (1 + 3 cos^2).
    impulse = (1.0 + restitution) * speed / (1.0 + 3.0 * c * c)
    assert event.time == pytest.approx(speed / G, rel=1e-9)
    assert (event.where, event.acts) == ("nodes.A", restitution == 0.0)
    assert event.impulse == pytest.approx(impulse, rel=1e-9)
    assert event.dissipated == pytest.approx(0.5 * impulse * (1.0 - restitution) * speed, rel=1e-9)
    (after,) = motion.between([event.time + 1e-5])
    # Clockwise, as the end is left of the middle.
    assert after.angular_velocity("A")[2] == pytest.approx(-6.0 * c * impulse, rel=3e-4)
    assert after.momentum["linear"][1] == pytest.approx(impulse - speed, rel=3e-4)
    assert np.abs(after.momentum["linear"][[0, 2]]).max() < 1e-9


def test_a_beam_falls_flat():
    """All ends of elements hit at once, each with what its mass has."""
    motion = solve(made(rod(0.0, 0.2, {"end": 0.3, "step": 0.02}, kind="flexible")))
    hits = motion.events[:5]
    np.testing.assert_allclose([event.time for event in hits], 0.2, rtol=1e-9)
    assert sorted(event.where for event in hits) == [
        "members.m at 0.25", "members.m at 0.5", "members.m at 0.75", "nodes.A", "nodes.B",
    ]  # fmt: skip
    # Lobatto's weights of five nodes: 1/20 at each end of an element.
    shares = {event.where: event.impulse / 2.0 for event in hits}
    assert shares["nodes.A"] == pytest.approx(0.25 / 20, rel=1e-6)
    assert shares["members.m at 0.5"] == pytest.approx(0.25 / 10, rel=1e-6)
    assert sum(event.dissipated for event in hits) == pytest.approx(0.5 * 4.0 * sum(shares.values()), rel=1e-6)


def test_a_beam_comes_to_rest_on_the_floor():
    """Places of it hit and leave the floor again and again, which ends; then the floor carries its weight."""
    motion = solve(made(rod(0.3, 0.1, {"end": 1.0, "step": 0.02}, kind="flexible")))
    assert len({event.time for event in motion.events}) > 5
    total, lost = balance(motion), [step.energy["dissipated"] for step in motion.steps]
    assert (np.diff(total) < 1e-3).all()
    assert (np.diff(lost) >= 0.0).all()
    last = motion.last.contacts["floor"]
    np.testing.assert_allclose(last["force"], [0.0, G, 0.0], atol=1e-2)
    # A tenth of the accuracy, and less than the sag between two hinges.
    assert last["gap"] > -1e-5 - 5 * G * 0.25**4 / 384
    assert {"nodes.A", "nodes.B"} <= set(last["touching"])


def test_impulses_with_restitution():
    """What rows allow holds afterwards, impulses do not pull, and energy does not grow, however restitutions differ."""
    rng = np.random.default_rng(1)
    for _ in range(100):
        n = int(rng.integers(1, 7))
        root = rng.standard_normal((n, n + 2))
        yielding, speed = root @ root.T, rng.standard_normal(n)
        same = rng.random() < 0.5
        restitution = np.full(n, rng.random()) if same else rng.random(n)
        found, left, lost, rebound = Collision._hit(yielding, speed, restitution)
        scale = max(1.0, np.abs(speed).max())
        assert (found >= 0.0).all()
        assert lost >= 0.0
        assert lost == pytest.approx(found @ speed - 0.5 * found @ yielding @ found, abs=1e-8 * scale**2)
        np.testing.assert_array_less(left + rebound, 1e-6 * scale)
        np.testing.assert_allclose(found * (left + rebound), 0.0, atol=1e-6 * scale**2)
        np.testing.assert_array_less(rebound, restitution * np.maximum(speed, 0.0) + 1e-15)
        if same:
            np.testing.assert_allclose(rebound, restitution * np.maximum(speed, 0.0))


def test_what_comes_to_rest_loses_what_its_momenta_say(monkeypatch):
    """Of nearest velocities with and without rows that rest, the kinetic energy is half of velocities times momenta."""
    seen, at = [], Impacts.at

    def looked(impacts, memory):
        seen.append((impacts, memory, at(impacts, memory)))
        return seen[-1][-1]

    monkeypatch.setattr(Impacts, "at", looked)
    solve(made(rod(0.3, 0.1, {"end": 0.3, "step": 0.02}, kind="flexible")))
    system, lost = seen[0][0].system, []
    for impacts, memory, collision in seen[::10]:
        state = State(memory.q, memory.y, memory.lam, memory.unwrapped)
        given = state.q.T, state.y, system.factors(memory.t), system.counted(state)

        def kinetic(acting, given=given, impacts=impacts, collision=collision):
            velocity = collision.nearest(acting)
            momentum = np.array(impacts.momenta(*given, velocity)[2]).ravel()
            return 0.5 * (collision._allowed(acting) * collision._unit) @ momentum

        moving, resting = np.zeros(len(collision._rows), bool), np.ones(len(collision._rows), bool)
        lost.append(collision.held_back(moving, resting))
        assert lost[-1] == pytest.approx(kinetic(moving) - kinetic(resting), rel=1e-6, abs=1e-12)
    assert max(lost) > 1e-3


# -- sliding and lifting off --------------------------------------------------------------------------------

LADDER = 1.2


def ladder(**analysis):
    """A rod that stands on a floor and leans against a wall, both smooth."""
    return {
        "gravity": [0, -G],
        "sections": {"s": {"rhoA": 1.0, "rhoI": SLENDER}},
        "nodes": {"A": {"position": [np.cos(LADDER), 0]}, "B": {"position": [0, np.sin(LADDER)]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "contacts": {"floor": FLOOR, "wall": {**FLOOR, "normal": [1, 0]}},
        "analysis": {"type": "dynamic", **analysis},
    }


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_ladder_leaves_the_wall(dimension):
    """It does so where its top has fallen by a third."""
    motion = solve(made({**ladder(end=0.75, step=0.01), "dimension": dimension}))

    def along_wall(t, y):
        return [y[1], -1.5 * G * np.cos(y[0])]

    def fallen(t, y):
        return np.sin(y[0]) - 2 / 3 * np.sin(LADDER)

    fallen.terminal = True
    found = solve_ivp(along_wall, (0, 2), [LADDER, 0.0], events=fallen, rtol=1e-11, atol=1e-12)
    release, *hits = motion.events
    assert (release.name, release.where, release.acts, release.impulse) == ("contacts.wall", "nodes.B", False, 0.0)
    assert release.time == pytest.approx(found.t[-1], abs=1e-6)
    first, last = motion.steps[0], motion.last
    # At the begin both forces are those of the accelerations at rest.
    turning = 1.5 * G * np.cos(LADDER)
    (soon,) = motion.between([1e-3])
    for step in (first, soon):
        wall, floor = (step.contacts[name]["force"] for name in ("wall", "floor"))
        np.testing.assert_allclose(wall, [0.5 * np.sin(LADDER) * turning, 0.0, 0.0], rtol=1e-3, atol=1e-9)
        np.testing.assert_allclose(floor, [0.0, G - 0.5 * np.cos(LADDER) * turning, 0.0], rtol=1e-3, atol=1e-9)
    assert first.contacts["wall"]["touching"] == ["nodes.B"]
    # Then it goes on with the speed that it has along the floor, until it falls flat.
    angle, rate = found.y[:, -1]
    along = -0.5 * np.sin(angle) * rate

    def slides(t, y):
        c, s = np.cos(y[0]), np.sin(y[0])
        return [y[1], (-0.5 * G * c + 0.25 * c * s * y[1] ** 2) / (0.25 * c * c + 1 / 12)]

    def flat(t, y):
        return y[0]

    flat.terminal = True
    falls = solve_ivp(slides, (0, 1), [angle, rate], events=flat, rtol=1e-11, atol=1e-12)
    assert {event.where for event in hits} == {"nodes.A", "nodes.B"}
    np.testing.assert_allclose([event.time for event in hits], found.t[-1] + falls.t[-1], atol=1e-6)
    speed = -falls.y[1, -1]
    assert sum(event.dissipated for event in hits) == pytest.approx(speed**2 / 6, rel=1e-5)
    last = motion.last
    place = 0.5 * np.cos(angle) + along * (last.time - found.t[-1])
    np.testing.assert_allclose(last.position("A")[:2], [place + 0.5, 0.0], atol=1e-6)
    assert last.contacts["wall"]["touching"] == []
    assert last.contacts["wall"]["gap"] == pytest.approx(last.position("B")[0], abs=1e-9)
    np.testing.assert_allclose(last.contacts["wall"]["force"], 0.0)
    np.testing.assert_allclose(balance(motion), 0.0, atol=3e-6)


ROUND = {
    "circle": {"type": "circle", "center": [0, 0], "radius": 0.5},
    "cylinder": {"type": "cylinder", "center": [0, 0, 0], "radius": 0.5, "axis": [0, 0, 1]},
    "sphere": {"type": "sphere", "center": [0, 0, 0], "radius": 0.5},
}


@pytest.mark.parametrize("kind", ROUND)
def test_it_slides_off_what_is_round(kind):
    """It leaves where the cosine of the angle from the top is 2/3 + v^2 / (3 g r)."""
    speed = 1.0
    table = ball({**ROUND[kind], "member": "bar"}, [0, 0.5], {"end": 0.4, "step": 0.01}, velocity=[speed, 0])
    motion = solve(made({**table, "dimension": "plane" if kind == "circle" else "space"}))
    event = motion.events[-1]
    assert not event.acts
    angle = np.arccos(2 / 3 + speed**2 / (3 * G * 0.5))

    def slides(t, y):
        return [y[1], G / 0.5 * np.sin(y[0])]

    course = solve_ivp(slides, (0, 1), [0.0, speed / 0.5], dense_output=True, rtol=1e-11, atol=1e-12)
    assert event.time == pytest.approx(brentq(lambda t: course.sol(t)[0] - angle, 0, 1), abs=1e-5)
    for step in motion.steps[::7]:
        if step.time < event.time:
            turned, rate = course.sol(step.time)
            np.testing.assert_allclose(
                step.position("B")[:2], 0.5 * np.array([np.sin(turned), np.cos(turned)]), atol=1e-6
            )
            push = 2.0 * (G * np.cos(turned) - 0.5 * rate**2)
            force = step.contacts["stop"]["force"]
            np.testing.assert_allclose(force[:2], push * np.array([np.sin(turned), np.cos(turned)]), atol=2e-3)
    assert motion.last.contacts["stop"]["gap"] > 1e-3


def test_it_swings_in_a_bowl():
    """Inside a circle it is a pendulum."""
    bowl = {"type": "circle", "center": [0, 0], "radius": 0.5, "side": "inside", "member": "bar"}
    motion = solve(made(ball(bowl, [0.4, -0.3], {"end": 0.8, "step": 0.01}, out=(0.0, 1.0))))
    swing = solve_ivp(
        lambda t, y: [y[1], -G / 0.5 * np.sin(y[0])], (0, 0.8), [np.arcsin(0.8), 0.0], rtol=1e-11, atol=1e-12
    )
    angle = swing.y[0, -1]
    np.testing.assert_allclose(motion.last.position("B")[:2], [0.5 * np.sin(angle), -0.5 * np.cos(angle)], atol=1e-6)
    assert not motion.events


def test_a_rigid_bar_rests_across_a_drum():
    """Its places are so near to each other that it dips in by no more than the accuracy."""
    table = {
        "gravity": [0, -G],
        "sections": {"s": {"rhoA": 1.0}},
        "nodes": {"A": {"position": [-0.5, 0.55]}, "B": {"position": [0.5, 0.55]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "contacts": {"drum": {**ROUND["circle"], "members": "all"}},
        "analysis": {"type": "dynamic", "end": 0.3, "step": 0.02, "accuracy": 1e-3},
    }
    motion = solve(made(table))
    assert motion.events[0].time == pytest.approx(0.1, abs=3e-3)
    dips = min(step.contacts["drum"]["gap"] for step in motion.steps)
    assert dips > -1e-3
    np.testing.assert_allclose(motion.last.contacts["drum"]["force"], [0.0, G, 0.0], atol=1e-6)
    cuts = motion.last.model.mesh.cuts["m"]
    assert np.diff(cuts).max() <= np.sqrt(8 * 0.5 * 1e-3)


# -- begin, rest --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
@pytest.mark.parametrize("restitution", [0.0, 0.9])
def test_what_lies_at_rest_stays(kind, restitution):
    motion = solve(made(rod(0.0, 0.0, {"end": 0.3, "step": 0.05}, kind=kind, restitution=restitution)))
    assert not motion.events
    last = motion.last
    np.testing.assert_allclose(last.contacts["floor"]["force"], [0.0, G, 0.0], atol=1e-4)
    for name in "AB":
        assert np.abs(last.position(name)[1]) < 1e-12
    assert len(last.contacts["floor"]["touching"]) == (2 if kind == "rigid" else 5)


def lying(**more):
    table = {
        "gravity": [0, -G],
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0, "damping": 0.05}},
        "nodes": {"A": {"position": [0, 0.05], "support": "clamped"}, "B": {"position": [1, 0.05]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "contacts": {"floor": FLOOR},
        "analysis": {"type": "dynamic", "end": 0.2, "step": 0.02, "initial": "equilibrium"},
    }
    return made({**table, **more})


def test_it_begins_in_equilibrium_on_an_obstacle():
    """The force of the floor is that of statics, to what few places make of a stretch, and stays."""
    motion = solve(lying())
    static = solve(lying(analysis={}), accuracy=1e-6).last.contacts["floor"]
    assert not motion.events
    for step in motion.steps:
        np.testing.assert_allclose(step.contacts["floor"]["force"], static["force"], rtol=4e-2, atol=1e-9)
        assert step.position("B")[1] == pytest.approx(motion.steps[0].position("B")[1], abs=1e-4)
    cuts = motion.last.model.mesh.cuts["m"]
    # Where a line ends hardly moves anything: it is known less well than positions, which have 1e-5 here.
    assert min(np.abs(cuts - np.atleast_1d(static["at"])[0])) < 1e-4


@pytest.mark.parametrize("stop", [False, True])
def test_it_begins_where_a_short_stretch_lies_on_the_floor(stop):
    """Both ends of the stretch are ends of elements; what lifts the tip is a load, or a stop of a spring."""
    force = {"loads": {"up": {"type": "force", "node": "B", "value": [0, 0.93]}}}
    spring = {"type": "translational", "node": "B", "stiffness": 0.0, "direction": [0, 1], "stop": [-0.0495, 1]}
    held = {"springs": {"k": spring}} if stop else force
    motion = solve(lying(**held))
    static = solve(lying(**held, analysis={}), accuracy=1e-6).last
    first, cuts = motion.steps[0], motion.last.model.mesh.cuts["m"]
    begin, end = static.contacts["floor"]["at"]
    # Its ends alone stand for so short a stretch: its weight between them moves them by a twelfth of its share.
    moved = G * (end - begin) ** 2 / 12.0
    for at, force in ((begin, 2.5), (end, 0.8)):
        assert min(np.abs(cuts - at)) < moved / force
    assert not motion.events
    np.testing.assert_allclose(
        first.contacts["floor"]["force"], static.contacts["floor"]["force"], rtol=4e-2, atol=1e-9
    )
    assert len(first.contacts["floor"]["touching"]) == 2
    for step in motion.steps:
        assert step.position("B")[1] == pytest.approx(first.position("B")[1], abs=1e-4)


def test_a_damped_beam_ends_in_the_equilibrium_of_statics():
    table = {"A": {"position": [0, 0.2], "support": "clamped"}, "B": {"position": [1, 0.2]}}
    section = {"EI3": 1.0, "rhoA": 1.0, "damping": 0.5, "drag": 2.0}
    given = {"nodes": table, "sections": {"s": section}}
    motion = solve(lying(**given, analysis={"type": "dynamic", "end": 3.0, "step": 0.03}))
    static = solve(lying(**given, analysis={})).last
    assert motion.last.contacts["floor"]["force"][1] == pytest.approx(static.contacts["floor"]["force"][1], rel=1e-4)
    np.testing.assert_allclose(motion.last.position("B"), static.position("B"), atol=3e-5)


# -- places that obstacles stop -----------------------------------------------------------------------------


def test_places_are_stopped_once_and_what_is_held_is_not():
    table = {
        "sections": {"s": {"rhoA": 1.0, "EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 1], "support": "clamped"},
            "B": {"position": [1, 1]},
            "C": {"position": [2, 1]},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {"nodes": ["B", "C"], "type": "rigid", "section": "s"},
        },
        "contacts": {"floor": FLOOR, "wall": {**FLOOR, "point": [3, 0], "normal": [-1, 0], "members": ["two"]}},
        "analysis": {"type": "dynamic", "end": 1.0},
    }
    scene = made(table)
    spots = spots_of(scene, uniform_mesh(scene, 4, 2))
    assert [(spot.contact, spot.where) for spot in spots] == [
        ("floor", "nodes.B"), ("floor", "members.one at 0.5"), ("floor", "nodes.C"),
        ("wall", "nodes.B"), ("wall", "nodes.C"),
    ]  # fmt: skip


def test_elements_are_short_enough():
    table = lying(gravity=[0, -1000.0]).model_copy()
    mesh = uniform_mesh(table, 4, 1)
    finer = fine_enough(table, mesh, 1e-4, ())
    h = np.diff(finer.cuts["m"]).max()
    assert len(finer.cuts["m"]) > 2
    assert 1000.0 * h**4 / 384 <= 16 * 1e-4 * table.size * 1.01
    assert fine_enough(table, mesh, 1e-4, {"m"}).same(mesh)


# -- what is told, what is refused --------------------------------------------------------------------------


def test_what_is_told(tmp_path, capsys):
    file = tmp_path / "ball.json"
    table = ball({**FLOOR, "restitution": 0.5}, [0, 0.2], {"end": 0.3, "step": 0.05})
    table["expect"] = [{"quantity": "contacts.stop.gap", "time": 0.2, "value": 0.0, "tolerance": 1e-6}]
    dump(made(table), file)
    assert main(["run", str(file), "--json", str(tmp_path / "answer.json")]) == 0
    text = capsys.readouterr().out
    assert "  at 0.2 s contacts.stop: nodes.B hits it and leaves, after an impulse of 6 N s, 3 N m dissipated" in text
    answer = json.loads((tmp_path / "answer.json").read_text())
    assert [event["where"] for event in answer["events"]] == ["nodes.B"]
    told = answer["contacts"]["stop"]
    assert told["gap"][0] == pytest.approx(0.2)
    assert told["touching"][0] == []
    assert np.shape(told["force"]) == (len(answer["times"]), 3)
    assert answer["energy"]["dissipated"][-1] == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"restitution": -0.1},
            "contacts.stop.restitution: found -0.1, accepted: a share of the speed before, from 0 to 1",
        ),
        (
            {"restitution": 1.5},
            "contacts.stop.restitution: found 1.5, accepted: a share of the speed before, from 0 to 1",
        ),
        ({"restitution": "much"}, "contacts.stop.restitution: found 'much', accepted: a number"),
    ],
)
def test_restitutions_that_are_none_are_refused(changed, message):
    with pytest.raises(SceneError) as caught:
        made(ball({**FLOOR, **changed}, [0, 1], {"end": 1.0}))
    assert str(caught.value) == message


@pytest.mark.parametrize("integrator", ["idas", "conserving"])
def test_integrators_that_find_no_events_are_refused(integrator):
    with pytest.raises(SceneError, match=rf"contacts\.stop: found with the integrator '{integrator}', which does not"):
        made(ball(FLOOR, [0, 1], {"end": 1.0, "integrator": integrator}))


def test_edges_are_refused():
    with pytest.raises(
        SceneError, match=r"contacts\.stop\.type: found a point that members slide over, accepted in a mo"
    ):
        made(ball({"type": "point", "position": [0.5, 0], "side": [0, 1], "member": "bar"}, [0, 1], {"end": 1.0}))
    edge = {"type": "line", "point": [0.5, 0, 0], "direction": [0, 0, 1], "side": [0, 1, 0], "member": "bar"}
    with pytest.raises(
        SceneError, match=r"contacts\.stop\.type: found a line that members slide over, accepted in a mot"
    ):
        made(ball(edge, [0, 1], {"end": 1.0}, dimension="space"))


def test_members_without_mass_are_refused():
    table = rod(0.0, 0.2, {"end": 0.1}, kind="flexible")
    table["sections"]["s"]["rhoA"] = 0.0
    table["nodes"]["B"]["mass"] = 1.0
    del table["gravity"]
    with pytest.raises(
        SceneError, match=r"contacts\.floor: found the member 'm', whose section is without mass, so that"
    ):
        made(table)


def test_shapes_that_begin_inside_are_refused():
    table = rod(0.0, 0.1, {"end": 0.1}, kind="flexible")
    table["members"]["m"]["turned"] = -0.5
    with pytest.raises(
        SceneError, match=r"contacts\.floor: found nodes\.B inside, by 0\.379 m at t = 0, accepted: memb"
    ):
        solve(made(table))


def test_what_needs_smooth_equations_is_refused(tmp_path):
    scene = made(rod(0.1, 0.2, {"end": 0.1}))
    with pytest.raises(SceneError, match="found 'radau-3' with contact, accepted for C: stepping"):
        sfetcas.export(scene, tmp_path)
    for refused in (
        lambda: sfetcas.OptimalControl(scene, {"sections.s.rhoA": (0, 1)}, time=1.0),
        lambda: sfetcas.motion_functions(scene),
    ):
        with pytest.raises(SceneError, match="contact is found by a search"):
            refused()


@pytest.mark.parametrize("integrator", ["radau-3", "stepping"])
@pytest.mark.parametrize("side", ["outside", "inside", "edge", "plane"])
def test_members_of_some_radius_are_stopped_by_their_surfaces(side, integrator):
    """As centre lines are by a larger circle outside, a smaller one inside, a circle round an edge, a higher plane."""
    start = np.array([-0.8, -0.6]) if side == "inside" else np.array([0.6, 0.8])
    thick = {
        "outside": {"type": "circle", "center": [0, 0], "radius": 0.9},
        "inside": {"type": "circle", "center": [0, 0], "radius": 1.1, "side": "inside"},
        "edge": {"type": "point", "position": [0.6, -0.3], "side": [0, 1]},
        "plane": {"type": "plane", "point": [0, 0.3], "normal": [0, 1]},
    }[side]
    thin = {
        "outside": thick | {"radius": 1.0},
        "inside": thick | {"radius": 1.0},
        "edge": {"type": "circle", "center": [0.6, -0.3], "radius": 0.1},
        "plane": thick | {"point": [0, 0.4]},
    }[side]
    ends = []
    for stop in (thick | {"member_radius": 0.1}, thin):
        analysis = {"end": 0.5, "output": 0.5, "step": 0.01, "integrator": integrator}
        out = -start if side == "inside" else start
        motion = solve(made(ball({**stop, "members": "all"}, start, analysis, out=out)))
        assert motion.events or side in ("outside", "inside")
        assert motion.last.contacts["stop"]["gap"] > -1e-9
        ends.append(motion.last.position("B"))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)


def test_members_of_some_radius_have_no_friction_in_motion():
    table = ball({**FLOOR, "member_radius": 0.1, "friction": 0.3}, [0, 1], {"end": 0.1})
    with pytest.raises(
        SceneError, match=r"contacts\.stop\.member_radius: found a radius of members with friction in a"
    ):
        made(table)


def beam_on_pegs(**analysis):
    """A beam that falls level on two pegs, at a fifth of its length from both ends, and bounces."""
    peg = {"type": "circle", "radius": 0.05, "members": "all", "restitution": 0.5}
    return Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "sections": {"strip": {"EI3": 5.0, "rhoA": 0.5, "damping": 0.002}},
            "nodes": {"A": {"position": [-0.5, 0.3]}, "B": {"position": [0.5, 0.3]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
            "contacts": {"left": {**peg, "center": [-0.3, 0]}, "right": {**peg, "center": [0.3, 0]}},
            "analysis": {"type": "dynamic", "end": 0.26, "accuracy": 1e-2, **analysis},
        }
    )


def test_what_an_impact_sets_swinging_is_not_damped_by_a_long_step():
    """It leaves the pegs again, as in short equal steps; so long a step as in free fall left it lying there."""
    motion = solve(beam_on_pegs())
    other = solve(beam_on_pegs(step=1e-3), elements=20)
    for found in (motion, other):
        assert not np.any(found.last.contacts["left"]["touching"])
    assert other.last.position("A")[1] > 0.06
    np.testing.assert_allclose(motion.last.position("A"), other.last.position("A"), rtol=0, atol=1e-2)


def deepest(motion):
    """How deep a straight member is inside of the floor at most, seen at many places along it."""
    x = np.linspace(0.0, 1.0, 65)
    return max(-float(step.along("m", x)["position"][:, 1].min()) for step in motion.steps)


def test_in_steps_that_are_given_flexible_members_do_not_sink_into_obstacles():
    """Between ends of elements nothing stops them: elements are halved there."""
    table = {
        "gravity": [0, -10],
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0.1]}, "B": {"position": [0.8, 0.7]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "contacts": {"f": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}},
        "analysis": {"type": "dynamic", "end": 0.3, "output": 0.02, "accuracy": 1e-2},
    }
    table["analysis"] |= {"integrator": "stepping", "step": 1e-2}
    scene = Scene.from_dict(table)
    motion = solve(scene)
    assert deepest(motion) < 1e-2 * scene.size
    assert not motion.notes
    few = solve(scene, elements=2)
    # What is prescribed stays, and is told.
    assert deepest(few) > 3e-2
    assert any("contacts.f, which stops ends of elements" in note for note in few.notes)


@pytest.mark.parametrize("speed", [1e-6, 1e4])
def test_what_nothing_pulls_moves_alike_at_any_speed(speed):
    """A rough rod that hits a floor, without gravity: there is no unit of force but that of its own motion."""

    def thrown(fast):
        velocity = [fast, -fast]
        return solve(
            Scene.from_dict(
                {
                    "sections": {"s": {"rhoA": 1.0}},
                    "nodes": {
                        "A": {"position": [0, 0.1], "velocity": velocity},
                        "B": {"position": [0.8, 0.7], "velocity": velocity},
                    },
                    "members": {"m": {"type": "rigid", "nodes": ["A", "B"], "section": "s"}},
                    "contacts": {"f": {**FLOOR, "friction": 0.3}},
                    "analysis": {"type": "dynamic", "end": 1.0 / fast, "accuracy": 1e-5},
                }
            )
        )

    other, slow = thrown(speed), thrown(1.0)
    np.testing.assert_allclose([e.time * speed for e in other.events], [e.time for e in slow.events], rtol=1e-5)
    np.testing.assert_allclose(other.last.position("A"), slow.last.position("A"), rtol=0, atol=1e-6)
    assert other.last.energy["dissipated"] == pytest.approx(speed**2 * slow.last.energy["dissipated"], rel=1e-5)


def over_a_peg(radius, **analysis):
    """A bar that falls on a thin peg beside its middle."""
    return Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "sections": {"s": {"rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0]}, "B": {"position": [1, 0.05]}},
            "members": {"bar": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "contacts": {"peg": {"type": "circle", "center": [0.2, -0.21], "radius": radius, "member": "bar"}},
            "analysis": {"type": "dynamic", "end": 0.25, "output": 0.25, "accuracy": 1e-3, **analysis},
        }
    )


@pytest.mark.parametrize(
    ("radius", "analysis", "late"),
    [
        (0.01, {}, 5e-4),  # the accuracy over the speed
        (0.02, {"integrator": "stepping", "step": 0.02}, 0.02),  # the end of a step
        (0.01, {"integrator": "stepping", "step": 0.05}, 0.05),
    ],
    ids=["event by event", "stepping", "in long steps"],
)
def test_nothing_falls_through_a_thin_peg_within_a_step(radius, analysis, late):
    """In a step it moves by far more than the peg is thick."""
    found = solve(over_a_peg(radius, **analysis))
    hit = np.sqrt(2.0 * (0.22 - radius * np.hypot(1.0, 0.05)) / 9.81)
    assert hit - 1e-9 < found.events[0].time < hit + late
    # It turns about the peg; in free fall it would be at -0.31.
    assert found.last.position("A")[1] > -0.25


def test_what_may_slip_through_between_the_places_that_stop_is_told():
    (note,) = solve(over_a_peg(1e-3, integrator="stepping", step=0.05, end=0.05, output=0.05)).notes
    assert note.startswith("contacts.peg stops 'bar' at places that are 0.00391 m apart, more than its diameter")
