"""Friction of obstacles in motion: sticking, sliding, impacts, against closed forms, SciPy and identities."""

import casadi as ca
import numpy as np
import pytest
from scenes import made
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sfetcas import SceneError, solve
from sfetcas.dynamics.rough_impacts import Rough, rough_impulses
from sfetcas.mechanics.contact_joints import OnRound, directions_along
from sfetcas.mechanics.masses import masses_of
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.mechanics.rubbing import _direction, _sliding, rubbing_of
from sfetcas.mechanics.spots import spots_of
from sfetcas.mechanics.unilateral import rows_of

G = 10.0
SLENDER = [1e-6, 0.0, 0.0]
FLOOR = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}

LOCATED = 1e-6
"""Share of the friction by which sliding begins late, see sfetcas.dynamics.events.GAP: what it changes is as small."""


def block(friction, slope, analysis, *, velocity=None, height=0.0, **more):
    """A heavy point of 2 kg on a plane that rises by an angle, on a body that stands up from it."""
    normal = np.array([-np.sin(slope), np.cos(slope)])
    start = {} if velocity is None else {"velocity": list(velocity)}
    foot = height * normal
    return {
        "gravity": [0, -G],
        "nodes": {
            "B": {"position": foot.tolist(), "mass": 2.0, "inertia": [0.01, 0.01, 0.01], **start},
            "C": {"position": (foot + 0.1 * normal).tolist(), **start},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "contacts": {"plane": {**FLOOR, "normal": normal.tolist(), "friction": friction}},
        "analysis": {"type": "dynamic", **analysis},
        **more,
    }


def uphill(slope):
    return np.array([np.cos(slope), np.sin(slope), 0.0])


def balance(motion):
    """Total energy with what friction and impacts took, over the times."""
    return np.array([step.energy["total"] + step.energy["dissipated"] for step in motion.steps])


METHODS = pytest.mark.parametrize(
    ("dimension", "integrator"),
    [("plane", "radau-3"), ("space", "radau-2"), ("plane", "generalised-alpha"), ("space", "radau-3")],
)


# -- what is accepted ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("friction", "analysis", "sentence"),
    [
        (-0.1, {"type": "dynamic", "end": 1.0}, "contacts.plane.friction: found -0.1, accepted: zero or above"),
        (float("nan"), {"type": "dynamic", "end": 1.0}, "contacts.plane.friction: found nan"),
        ("rough", {"type": "dynamic", "end": 1.0}, "contacts.plane.friction: found 'rough', accepted: a number"),
        (
            0.3,
            {"type": "dynamic", "end": 1.0, "integrator": "idas"},
            "contacts.plane: found with the integrator 'idas'",
        ),
    ],
)
def test_refused(friction, analysis, sentence):
    with pytest.raises(SceneError, match=sentence):
        made({**block(friction, 0.0, {}), "analysis": analysis})


def test_without_friction_nothing_is_modelled():
    """Rows that hold places are there for those that rub alone."""
    counts = {}
    for friction in (0.0, 0.3):
        scene = made(block(friction, 0.0, {"end": 1.0}))
        mesh = uniform_mesh(scene, 4, 1)
        mesh = mesh.__class__(**{**vars(mesh), "places": True})
        mesh = mesh.__class__(**{**vars(mesh), "spots": spots_of(scene, mesh)})
        model = assemble(scene, mesh, assembly="nodal")
        masses_of(model)
        counts[friction] = len(model.row_names), rubbing_of(model, rows_of(model))
    assert counts[0.0][1] is None
    assert counts[0.3][0] == counts[0.0][0] + 2
    assert len(counts[0.3][1]) == 2


# -- sliding and sticking -----------------------------------------------------------------------------------


@METHODS
def test_a_block_slides_down(dimension, integrator):
    slope, friction = 0.5, 0.3
    table = block(friction, slope, {"end": 1.0, "step": 0.05, "integrator": integrator}, dimension=dimension)
    motion = solve(made(table))
    acceleration = G * (np.sin(slope) - friction * np.cos(slope))
    # Parabolas are exact up to rounding for all methods; that it starts at once leaves the share of LOCATED.
    np.testing.assert_allclose(motion.last.position("B"), -0.5 * acceleration * uphill(slope), atol=1e-9)
    told = motion.last.contacts["plane"]
    push = 2.0 * G * np.cos(slope)
    np.testing.assert_allclose(told["friction"], friction * push * uphill(slope), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(told["force"], told["friction"] + push * np.array([-np.sin(slope), np.cos(slope), 0.0]))
    assert (told["touching"], told["sticking"]) == (["nodes.B"], [])
    assert motion.last.energy["dissipated"] == pytest.approx(friction * push * 0.5 * acceleration, rel=1e-9)
    assert motion.events == ()


@METHODS
def test_a_block_stays(dimension, integrator):
    """Friction holds what its coefficient allows, here by a thousandth more than it needs, without drift."""
    slope = 0.5
    table = block(1.001 * np.tan(slope), slope, {"end": 1.0, "step": 0.05, "integrator": integrator})
    motion = solve(made({**table, "dimension": dimension}))
    assert np.abs(motion.positions("B")).max() < 1e-14
    told = motion.last.contacts["plane"]
    np.testing.assert_allclose(told["friction"], 2.0 * G * np.sin(slope) * uphill(slope), atol=1e-9)
    assert told["sticking"] == ["nodes.B"]
    assert motion.last.energy["dissipated"] == 0.0


@METHODS
def test_a_block_that_is_thrown_comes_to_rest(dimension, integrator):
    """On a floor after v^2 / 2 mu g, and stays; in space its path is straight, whatever its direction."""
    friction, speed = 0.3, 2.0
    way = np.array([0.8, 0.0, 0.6]) if dimension == "space" else np.array([1.0, 0.0, 0.0])
    analysis = {"end": 1.0, "step": 0.02, "integrator": integrator}
    velocity = speed * (way if dimension == "space" else way[:2])
    motion = solve(made(block(friction, 0.0, analysis, velocity=velocity, dimension=dimension)))
    stop = speed**2 / (2.0 * friction * G) * way
    (event,) = motion.events
    assert (event.name, event.side, event.where, event.acts) == ("contacts.plane", "sticking", "nodes.B", True)
    # Steps follow the parabola exactly up to the instant, which is located to 1e-13 of a step.
    assert event.time == pytest.approx(speed / (friction * G), rel=1e-9)
    np.testing.assert_allclose(motion.last.position("B"), stop, atol=1e-9)
    rests = [step for step in motion.steps if step.time > event.time]
    assert np.ptp([step.position("B") for step in rests], axis=0).max() < 1e-13
    assert motion.last.energy["dissipated"] == pytest.approx(0.5 * 2.0 * speed**2, rel=1e-9)
    # The power of friction is linear in time, which every method integrates exactly.
    np.testing.assert_allclose(balance(motion), 4.0, rtol=1e-9)
    assert str(event) == f"at {event.time:.9g} s contacts.plane: nodes.B sticks"


def test_a_block_comes_back():
    """Thrown up where friction does not hold it, it turns round at once."""
    slope, friction = 0.5, 0.3
    motion = solve(made(block(friction, slope, {"end": 1.0, "step": 0.05}, velocity=2.0 * uphill(slope)[:2])))
    up = 2.0 / (G * (np.sin(slope) + friction * np.cos(slope)))
    down = 0.5 * G * (np.sin(slope) - friction * np.cos(slope)) * (1.0 - up) ** 2
    # It turns round where its speed is zero, which friction of the other sign leaves at a share of LOCATED.
    np.testing.assert_allclose(motion.last.position("B") @ uphill(slope), up - down, atol=1e-8)
    assert motion.events == ()
    np.testing.assert_allclose(balance(motion), balance(motion)[0], rtol=1e-8)


def test_swings_become_smaller_by_the_same_each_time():
    """On a spring each half swing is shorter by 2 mu m g / k, until what is left is less than friction holds."""
    friction, stiffness, rest = 0.3, 50.0, 0.55
    table = block(friction, 0.0, {"end": 2.0, "step": 0.01})
    table["springs"] = {
        "s": {"type": "translational", "node": "B", "stiffness": stiffness, "direction": [1, 0], "rest": rest}
    }
    motion = solve(made(table))
    dead, half = friction * 2.0 * G / stiffness, np.pi * np.sqrt(2.0 / stiffness)
    first = 2.0 * (rest - dead)
    last = first - 2.0 * (first - rest - dead)
    (event,) = motion.events
    # Radau's error of order 5 over two half swings of sixty steps each.
    assert event.time == pytest.approx(2.0 * half, rel=1e-7)
    assert motion.last.position("B")[0] == pytest.approx(last, abs=1e-8)
    np.testing.assert_allclose(motion.at(half).position("B")[0], first, atol=1e-3)
    assert motion.last.contacts["plane"]["friction"][0] == pytest.approx(-stiffness * (rest - last), abs=1e-6)


DRIVE = {
    "t": [0, 0.6, 1.2, 1.8, 2.4, 3.2, 4.0],
    "value": [0, 0.5, 0.5, 0.2, -0.5, 0.3, 0.8],
    "interpolation": "spline",
}
STIFFNESS, FRICTION = 20.0, 0.3


def driven(**analysis):
    """A block on a rough floor, and a spring whose other end is led to and fro."""
    table = block(FRICTION, 0.0, {"end": 3.0, **analysis})
    table["contacts"]["plane"]["members"] = ["bar"]
    table["nodes"] |= {"W": {"position": [-1.0, 0.5], "support": "clamped"}, "E": {"position": [-1.0, 0.8]}}
    table["members"]["wall"] = {"nodes": ["W", "E"], "type": "rigid"}
    table["histories"] = {"pull": DRIVE}
    table["motions"] = {"pull": {"node": "W", "displacement": [1.0, 0.0], "history": "pull"}}
    spring = {"type": "translational", "node": "B", "to": "W", "stiffness": STIFFNESS, "direction": [1, 0]}
    return made({**table, "springs": {"s": spring}})


def stick_slip(history, end):
    """Where the block is at the end, and when it begins to slide, to stick, and turns round without sticking."""
    most, t, x, told = FRICTION * 2.0 * G, 0.0, 0.0, []

    def pull(t, x):
        return STIFFNESS * (history.factor(t) - x)

    while True:
        fine = np.linspace(t, end, 20001)
        slips = np.flatnonzero([abs(pull(at, x)) > most + 1e-9 for at in fine])
        if not len(slips):
            return x, told
        t = brentq(lambda at, x=x: abs(pull(at, x)) - most, fine[slips[0] - 1], fine[slips[0]], xtol=1e-14)
        told.append((t, "slides"))
        while True:
            sign = np.sign(pull(t, x))

            def rates(at, y, sign=sign):
                return [y[1], (pull(at, y[0]) - sign * most) / 2.0]

            def halts(at, y, sign=sign, begin=t):
                return sign * y[1] if at > begin + 1e-6 else 1.0

            halts.terminal, halts.direction = True, -1
            found = solve_ivp(rates, (t, end), [x, 0.0], events=halts, rtol=1e-11, atol=1e-12, max_step=0.01)
            t, x = found.t[-1], found.y[0, -1]
            if t >= end:
                return x, told
            if abs(pull(t, x)) <= most:
                break
            told.append((t, "turns"))
        told.append((t, "sticks"))


@pytest.mark.parametrize(
    ("analysis", "tolerance"),
    [
        # Radau's method of order 5 in three hundred steps; the begin of sliding is late by the share LOCATED.
        ({"step": 0.01}, 1e-8),
        # Its estimate is of the whole motion, and is larger than the error.
        ({"accuracy": 1e-5}, 1e-5),
        # Order 2 with 0.01 s: (omega h)^2 / 12 of 3 m of way.
        ({"step": 0.01, "integrator": "generalised-alpha"}, 3e-3),
    ],
)
def test_a_block_sticks_and_slips(analysis, tolerance):
    scene = driven(**analysis)
    motion = solve(scene)
    place, told = stick_slip(scene.histories["pull"], 3.0)
    assert [what for _, what in told] == ["slides", "sticks", "slides", "turns"]
    assert motion.last.position("B")[0] == pytest.approx(place, abs=tolerance)
    assert [event.acts for event in motion.events] == [False, True, False]
    # Spring and friction change slowly: a millionth of the friction is half a millionth of a second of this motion.
    times = [event.time for event in motion.events]
    np.testing.assert_allclose(times, [t for t, _ in told[:3]], atol=max(1e-6, 0.1 * tolerance))
    for step in motion.steps:
        told = step.contacts["plane"]
        if told["sticking"]:
            assert abs(told["friction"][0]) <= 6.0 * (1.0 + 2.0 * LOCATED)
        else:
            assert abs(told["friction"][0]) == pytest.approx(6.0, rel=1e-9)


# -- in space and on what is round --------------------------------------------------------------------------


@pytest.mark.parametrize(("friction", "step", "stops"), [(0.7, 0.01, True), (0.7, 0.02, True), (0.4, 0.01, False)])
def test_a_block_slides_along_a_curve(friction, step, stops):
    """On a slope in space, thrown across it, it is turned downhill by its weight.

    Just before it stops its direction turns so fast that no step of 0.02 s ends there.
    """
    slope, velocity = 0.5, [0.0, 0.0, 2.0]
    table = block(friction, slope, {"end": 1.0, "step": step}, velocity=velocity, dimension="space")
    motion = solve(made(table))

    def rates(t, y):
        along, across = y[2:] / np.hypot(*y[2:])
        drag = friction * G * np.cos(slope)
        return [y[2], y[3], -G * np.sin(slope) - drag * along, -drag * across]

    def halts(t, y):
        return np.hypot(*y[2:]) - 1e-6

    halts.terminal = True
    found = solve_ivp(rates, (0, 1.0), [0, 0, 0, 2.0], events=halts, rtol=1e-11, atol=1e-13)
    place = motion.last.position("B")
    # Order 5 in steps of a hundredth of what lasts a second; the last of the speed is 1e-6 of it.
    np.testing.assert_allclose([place @ uphill(slope), place[2]], found.y[:2, -1], atol=1e-8)
    assert len(motion.events) == stops
    if stops:
        assert motion.events[0].time == pytest.approx(found.t[-1], abs=1e-6)
        assert motion.last.contacts["plane"]["sticking"] == ["nodes.B"]


def bowl(kind, dimension, friction, start):
    """A heavy point inside a circle, cylinder or sphere of radius one, on a short body that does not turn."""
    place = np.array([np.sin(start), -np.cos(start)])
    return {
        "gravity": [0, -G],
        "dimension": dimension,
        "nodes": {
            "B": {"position": place.tolist(), "mass": 2.0, "inertia": [0.01, 0.01, 0.01]},
            "C": {"position": (0.98 * place).tolist()},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "contacts": {
            "bowl": {
                "type": kind,
                "center": [0, 0],
                "radius": 1.0,
                "side": "inside",
                "members": "all",
                "friction": friction,
            }
        },
        "analysis": {"type": "dynamic", "end": 4.0, "step": 0.02},
    }


@pytest.mark.parametrize(("kind", "dimension"), [("circle", "plane"), ("cylinder", "space"), ("sphere", "space")])
def test_a_point_comes_to_rest_in_a_bowl(kind, dimension):
    """Its push depends on its speed; it sticks beside the lowest place."""
    friction, t, angle, times = 0.15, 0.0, 0.7, []
    motion = solve(made(bowl(kind, dimension, friction, angle)))
    while abs(np.tan(angle)) > friction:
        sign = -np.sign(angle)

        def rates(at, y, sign=sign):
            return [y[1], -G * np.sin(y[0]) - sign * friction * (G * np.cos(y[0]) + y[1] ** 2)]

        def halts(at, y, sign=sign, begin=t):
            return sign * y[1] if at > begin + 1e-6 else 1.0

        halts.terminal, halts.direction = True, -1
        found = solve_ivp(rates, (t, 4.0), [angle, 0.0], events=halts, rtol=1e-11, atol=1e-12)
        t, angle = found.t[-1], found.y[0, -1]
        times.append(t)
    assert len(times) > 1
    (event,) = motion.events
    # Order 5, fifty steps a swing.
    assert event.time == pytest.approx(times[-1], abs=1e-6)
    np.testing.assert_allclose(motion.last.position("B"), [np.sin(angle), -np.cos(angle), 0.0], atol=1e-7)
    np.testing.assert_allclose(motion.last.contacts["bowl"]["force"], [0.0, 2.0 * G, 0.0], atol=1e-6)
    # Friction times way, with velocities between steps that are less accurate than places.
    assert np.ptp(balance(motion)) < 1e-5


# -- impacts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize(("speed", "restitution", "friction"), [(3.0, 0.5, 0.2), (3.0, 0.0, 0.2), (1.0, 0.5, 0.5)])
def test_an_oblique_impact(dimension, speed, restitution, friction):
    """What keeps sliding loses mu (1 + e) times the speed across; what would lose more than it has does not slide."""
    analysis = {"end": 0.6, "step": 0.05}
    table = block(friction, 0.0, analysis, velocity=[speed, 0.0], height=1.0, dimension=dimension)
    table["contacts"]["plane"]["restitution"] = restitution
    motion = solve(made(table))
    across = np.sqrt(2.0 * G)
    lost = min(speed, friction * (1.0 + restitution) * across)
    event = motion.events[0]
    # Exact but for the rounding of a fall that parabolas describe.
    assert event.impulse == pytest.approx(2.0 * (1.0 + restitution) * across, rel=1e-9)
    taken = across**2 * (1.0 - restitution**2) + speed**2 - (speed - lost) ** 2
    assert event.dissipated == pytest.approx(taken, rel=1e-8)
    (after,) = motion.between([event.time + 1e-6])
    # In a microsecond friction takes away mu g of it.
    np.testing.assert_allclose(after.velocity("B")[[0, 2]], [speed - lost, 0.0], atol=1e-5)


@pytest.mark.parametrize(("friction", "sticks"), [(0.2, False), (0.9, True)])
def test_a_rod_hits_a_rough_floor(friction, sticks):
    """The impulse on one end has two directions, which its inertia couples."""
    tilt, height = 0.6, 0.45
    ends = {"A": [0.0, height], "B": [np.cos(tilt), height + np.sin(tilt)]}
    table = {
        "gravity": [0, -G],
        "sections": {"s": {"rhoA": 1.0, "rhoI": [0.0, 0.0, 0.0]}},
        "nodes": {name: {"position": place, "velocity": [0.5, 0.0]} for name, place in ends.items()},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "contacts": {"floor": {**FLOOR, "friction": friction}},
        "analysis": {"type": "dynamic", "end": 0.301, "step": 0.01},
    }
    motion = solve(made(table))
    before, arm = np.array([0.5, -np.sqrt(2 * G * height)]), -0.5 * np.array([np.cos(tilt), np.sin(tilt)])
    turned = np.array([-arm[1], arm[0]])
    yields = np.eye(2) + 12.0 * np.outer(turned, turned)
    held = np.linalg.solve(yields, -before)
    assert (abs(held[0]) <= friction * held[1]) == sticks
    # The push turns the rod so that its end goes backward after the impact, against which friction is.
    sliding = -before[1] / (yields[1] @ [friction, 1.0]) * np.array([friction, 1.0])
    assert sticks or (before + yields @ sliding)[0] < 0.0
    impulse = held if sticks else sliding
    event = motion.events[0]
    # Exact but for the rounding of the fall.
    assert event.impulse == pytest.approx(impulse[1], rel=1e-8)
    assert event.dissipated == pytest.approx(-impulse @ (before + 0.5 * yields @ impulse), rel=1e-8)


def test_impulses_with_friction():
    """Rows do not close further, friction is in its cone and against what slides, energy does not grow."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        count, space = int(rng.integers(1, 4)), int(rng.integers(1, 3))
        n = count * (1 + space)
        root = rng.standard_normal((n, n + 3))
        yields, speed = root @ root.T, rng.standard_normal(n)
        speed[:count] = -np.abs(speed[:count])
        rough = [
            Rough(i, count + space * i + np.arange(space), float(mu)) for i, mu in enumerate(0.6 * rng.random(count))
        ]
        wanted = -0.5 * rng.random() * speed[:count]
        found, lost, rebound = rough_impulses(yields, speed, wanted, rough)
        after, scale = speed + yields @ found, np.abs(speed).max()
        # Rounds end where they change nothing beyond 1e-15; they converge slowly where rows nearly depend on others.
        np.testing.assert_array_less(-found[:count], 1e-300)
        np.testing.assert_array_less(rebound - after[:count], 1e-8 * scale)
        np.testing.assert_allclose(found[:count] * (after[:count] - rebound), 0.0, atol=1e-8 * scale**2)
        assert lost >= 0.0
        assert lost == pytest.approx(-found @ (speed + after) / 2, abs=1e-9)
        for one in rough:
            push, slip = found[one.along], after[one.along]
            assert np.linalg.norm(push) <= one.coefficient * found[one.row] * (1.0 + 1e-12) + 1e-300
            # Where it slides it is as large as it can be and against it.
            missing = one.coefficient * found[one.row] * np.linalg.norm(slip) + push @ slip
            assert missing == pytest.approx(0.0, abs=1e-7 * scale**2)


def test_rebound_is_reduced_where_energy_would_grow():
    """Where rebound and friction of one place are strongly coupled, the push of the rebound lets friction drive it."""
    yields, speed = np.array([[1.0, -0.95], [-0.95, 1.0]]), np.array([-1.0, 1.13])
    found, lost, rebound = rough_impulses(yields, speed, np.array([0.9]), [Rough(0, np.array([1]), 0.92)])
    after = speed + yields @ found
    assert lost >= 0.0
    assert lost == pytest.approx(-found @ (speed + after) / 2, abs=1e-12)
    assert 0.0 <= rebound[0] < 0.9
    # Rounds end at 1e-15.
    assert after[0] == pytest.approx(rebound[0], abs=1e-12)


# -- several places -----------------------------------------------------------------------------------------


def ladder(angle, floor, wall, *, kind="rigid", dimension="plane", **analysis):
    """A rod that stands on a rough floor and leans against a rough wall."""
    section = {"rhoA": 1.0, "rhoI": SLENDER}
    section |= {} if kind == "rigid" else {"EI2": 100.0, "EI3": 100.0, "GJ": 100.0}
    return {
        "gravity": [0, -G],
        "dimension": dimension,
        "sections": {"s": section},
        "nodes": {"A": {"position": [np.cos(angle), 0]}, "B": {"position": [0, np.sin(angle)]}},
        "members": {
            "m": {"nodes": ["A", "B"], "type": kind, "section": "s"} | ({"elements": 1} if kind != "rigid" else {})
        },
        "contacts": {"floor": {**FLOOR, "friction": floor}, "wall": {**FLOOR, "normal": [1, 0], "friction": wall}},
        "analysis": {"type": "dynamic", **analysis},
    }


def slipping(angle, rate, floor, wall):
    """Acceleration of the angle, and the pushes of floor and wall, of a ladder that slips at both ends."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = [[-0.5 * s, floor, -1.0], [0.5 * c, -1.0, -wall], [1 / 12, 0.5 * (c - s * floor), -0.5 * (c * wall + s)]]
    return np.linalg.solve(matrix, [0.5 * c * rate**2, 0.5 * s * rate**2 - G, 0.0])


def slips(angle, floor, wall):
    """The slipping of a ladder up to where it leaves the wall."""

    def leaves(t, y):
        return slipping(*y, floor, wall)[2]

    leaves.terminal = True

    def rates(t, y):
        return [y[1], slipping(*y, floor, wall)[0]]

    return solve_ivp(rates, (0, 1), [angle, 0.0], events=leaves, dense_output=True, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_ladder_slips(dimension):
    angle, floor, wall = 0.9, 0.2, 0.3
    motion = solve(made(ladder(angle, floor, wall, dimension=dimension, end=0.5, step=0.01)))
    found = slips(angle, floor, wall)
    release = motion.events[0]
    assert (release.name, release.where, release.acts) == ("contacts.wall", "nodes.B", False)
    # As without friction.
    assert release.time == pytest.approx(found.t[-1], abs=1e-6)
    at, rate = found.sol(0.2)
    _, push, lean = slipping(at, rate, floor, wall)
    step = motion.at(0.2)
    assert step.position("A")[0] == pytest.approx(np.cos(at), abs=1e-8)
    np.testing.assert_allclose(step.contacts["floor"]["force"], [-floor * push, push, 0.0], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(step.contacts["wall"]["force"], [lean, wall * lean, 0.0], rtol=1e-5, atol=1e-9)
    # Velocities between steps are less accurate than places.
    assert np.ptp(balance(motion)[:42]) < 1e-6


def test_a_ladder_stands():
    """Both ends stick; how much of its weight the wall carries is open, and whatever is told balances."""
    motion = solve(made(ladder(1.2, 0.6, 0.6, end=0.3, step=0.05)))
    assert np.abs(motion.positions("A") - motion.positions("A")[0]).max() < 1e-13
    floor, wall = (motion.last.contacts[name] for name in ("floor", "wall"))
    assert (floor["sticking"], wall["sticking"]) == (["nodes.A"], ["nodes.B"])
    # Rounding of the least squares that share it.
    np.testing.assert_allclose(floor["force"] + wall["force"], [0.0, G, 0.0], atol=1e-9)
    turning = np.cross([np.cos(1.2), -np.sin(1.2), 0.0], floor["force"])[2] - 0.5 * np.cos(1.2) * G
    assert turning == pytest.approx(0.0, abs=1e-9)


def test_an_elastic_ladder_slips():
    """A stiff rod that bends slips nearly as one that does not: by its weight it bends by 5 / 384 EI."""
    angle, floor, wall = 0.9, 0.2, 0.3
    motion = solve(made(ladder(angle, floor, wall, kind="flexible", end=0.2, step=0.01)))
    at, _ = slips(angle, floor, wall).sol(0.2)
    # Its ends come nearer by the square of the sag, and it swings about that while it is let go at once.
    assert motion.last.position("A")[0] == pytest.approx(np.cos(at), abs=1e-3)
    for step in motion.steps[1:]:
        force = step.contacts["floor"]["force"]
        # Both follow from the same balance.
        assert force[0] == pytest.approx(-floor * force[1], rel=1e-9)


def test_what_moves_does_not_stick():
    """While a rod is straight and does not stretch, one end on the floor holds the other on the wall; not as it sags.

    No friction of the wall could hold it then, as what is nearly straight pulls without bound.
    """
    table = ladder(1.2, 0.9, 0.9, kind="flexible", end=0.1, step=0.01)
    table["sections"]["s"] |= {"EI2": 1.0, "EI3": 1.0, "damping": 0.01}
    motion = solve(made(table))
    heights = motion.positions("B")[:, 1]
    assert heights[0] - heights[-1] > 1e-3
    for step, before, after in zip(motion.steps[1:], heights, heights[1:], strict=False):
        # It may have moved by 1e-7 of the length within a step before that is noticed.
        assert not step.contacts["wall"]["sticking"] or before - after < 1e-6


def slab(friction, push, **analysis):
    """A rod that lies on a floor, which it touches with its ends, and is pushed along more and more."""
    return {
        "gravity": [0, -G],
        "sections": {"s": {"rhoA": 1.0, "rhoI": SLENDER}},
        "nodes": {"A": {"position": [0, 0]}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "loads": {"p": {"type": "force", "node": "A", "value": [push, 0], "history": "h"}},
        "histories": {"h": {"t": [0, 1], "value": [0, 1]}},
        "contacts": {"floor": {**FLOOR, "friction": friction}},
        "analysis": {"type": "dynamic", **analysis},
    }


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_two_feet_share_the_friction(dimension):
    """What one of two cannot hold the other does, up to mu m g of both; then the rod slides."""
    friction, push = 0.3, 5.0
    motion = solve(made({**slab(friction, push, end=1.0, step=0.02), "dimension": dimension}))
    start = friction * G / push
    t = 1.0 - start
    # The load is linear in time: Radau's parabolas are exact. It begins late by a share of LOCATED.
    assert motion.last.position("B")[0] - 1.0 == pytest.approx(push * t**3 / 6, abs=1e-6)
    before = motion.at(0.5)
    assert before.position("B")[0] == pytest.approx(1.0, abs=1e-12)
    # Accelerations are second differences of places over steps of 0.02 s.
    np.testing.assert_allclose(before.contacts["floor"]["friction"], [-0.5 * push, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(motion.last.contacts["floor"]["friction"], [-friction * G, 0.0, 0.0], atol=1e-8)
    assert motion.last.contacts["floor"]["sticking"] == []
    assert any(event.time == pytest.approx(start, abs=1e-5) for event in motion.events)


def test_a_motion_begins_in_equilibrium():
    """That is the one without friction, which then holds."""
    table = ladder(1.1, 0.5, 0.5, end=0.2, step=0.02, initial="equilibrium", cut=["stay"])
    table["loads"] = {"stay": {"type": "force", "node": "A", "value": [-0.5 * G / np.tan(1.1), 0]}}
    table["springs"] = {"s": {"type": "translational", "node": "A", "stiffness": 100.0, "direction": [1, 0]}}
    motion = solve(made(table))
    assert motion.last.contacts["floor"]["sticking"] == ["nodes.A"]
    assert np.abs(motion.positions("A") - motion.positions("A")[0]).max() < 1e-12


# -- derivatives --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("space", [False, True])
def test_derivatives_of_friction(space):
    """Those of the expressions against differences, at a place on a sphere or circle that slides aslant."""
    axes, rng = (3 if space else 2), np.random.default_rng(5)
    place, way, v = rng.standard_normal((3, axes))
    v = way + 0.3 * v
    data = np.concatenate([np.eye(axes).ravel(), place, [0.8, 1.0]])
    u, lam, weight = 0.1 * rng.standard_normal(axes), -1.7, 0.3
    function = _sliding(OnRound(space))
    residual, *slopes = (np.array(part) for part in function(u, data, lam, weight, way, v))
    given = [u, data, np.array([lam]), weight, way, v]
    for number, slope in zip((0, 2, 5), slopes, strict=True):
        for i in range(len(np.atleast_1d(given[number]))):
            ends = []
            for sign in (1.0, -1.0):
                moved = [np.array(part, dtype=float) for part in given]
                moved[number][i] += sign * 1e-6
                ends.append(np.array(function(*moved)[0]).ravel())
            # Central differences with 1e-6 have 1e-12 of the third derivative and 1e-10 of rounding.
            np.testing.assert_allclose(slope[:, i], (ends[0] - ends[1]) / 2e-6, atol=1e-8)
    direction, speed = (np.array(part).ravel() for part in _direction(OnRound(space))(u, data, way, v))
    normal = (u + place) / np.linalg.norm(u + place)
    along = v - (v @ normal) * normal
    np.testing.assert_allclose(residual.ravel(), weight * 1.7 * direction)
    # The share that does not turn beside the end of sliding is 1e-12 of it.
    np.testing.assert_allclose(direction, np.sign(speed) * along / np.linalg.norm(along), atol=1e-11)
    frames = directions_along(normal)
    np.testing.assert_allclose(
        frames @ np.column_stack([normal, frames.T]), np.eye(axes)[1:] @ np.eye(axes), atol=1e-15
    )
    assert isinstance(function, ca.Function)
