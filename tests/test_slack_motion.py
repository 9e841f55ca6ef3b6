"""Strings that become slack and taut, and springs that reach their stops, in motion: against closed forms and SciPy."""

import json

import numpy as np
import pytest
from scenes import made
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import sfetcas
from sfetcas import SceneError, SolveError, dump, solve
from sfetcas.cli import main
from sfetcas.dynamics import events
from sfetcas.dynamics.impacts import _pushing

G = 10.0


def bob(tendons, at, analysis, *, mass=2.0, velocity=None, **more):
    """A heavy body that does not turn unless something makes it, on strings."""
    start = {} if velocity is None else {"velocity": velocity}
    return {
        "gravity": [0, -G],
        "nodes": {
            "B": {"position": at, "mass": mass, "inertia": [0.01, 0.01, 0.01], **start},
            "C": {"position": [at[0], at[1] + 1.0], **start},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "tendons": tendons,
        "analysis": {"type": "dynamic", **analysis},
        **more,
    }


def string(place=(0, 0), **keys):
    return {"way": [{"ground": list(place)}, {"node": "B"}], **keys}


# -- impacts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dimension", "integrator"), [("plane", "radau-3"), ("space", "radau-3"), ("plane", "generalised-alpha")]
)
def test_a_string_catches_what_falls(dimension, integrator):
    """A body falls beside its anchor: time and impulse of the impact, what is lost, what stays."""
    one = string(length=1.0)
    table = bob({"t": one}, [0.6, 0.0], {"end": 0.6, "integrator": integrator}, dimension=dimension)
    table["analysis"]["step"] = 0.02 if integrator == "radau-3" else 2e-3
    motion = solve(made(table))
    (event,) = motion.events
    time, speed = np.sqrt(2 * 0.8 / G), np.sqrt(2 * 0.8 * G)
    # Free fall is a polynomial that methods of order two and more have no error in.
    assert event.time == pytest.approx(time, rel=1e-9)
    assert (event.name, event.side, event.acts) == ("tendons.t", "taut", True)
    assert event.impulse == pytest.approx(2.0 * 0.8 * speed, rel=1e-9)
    assert event.dissipated == pytest.approx(0.5 * 2.0 * (0.8 * speed) ** 2, rel=1e-9)
    before, after = (min(motion.between([t]), key=lambda step: step.time) for t in (time - 1e-4, time + 1e-4))
    assert before.tendon("t")["slack"]
    assert not after.tendon("t")["slack"]
    # Angular momentum about the anchor changes by the moment of the weight only, and the string is not stretched.
    about = [np.cross(step.position("B"), step.velocity("B"))[2] for step in (before, after)]
    # To what velocities between long steps have: a jump would be of the order of one.
    assert about[1] - about[0] == pytest.approx(-0.6 * G * 2e-4, abs=1e-4)
    last = motion.last
    assert last.tendon("t")["length"] == pytest.approx(1.0, abs=1e-9)
    energy = [step.energy for step in motion.steps]
    total = np.array([one["total"] + one["dissipated"] for one in energy])
    # Velocities between long steps are less accurate than positions.
    np.testing.assert_allclose(total, 0.0, atol=3e-4 * energy[-1]["dissipated"])
    assert [one["dissipated"] for one in energy] == pytest.approx(
        [0.0 if step.time <= time else event.dissipated for step in motion.steps]
    )


THROWN = np.sqrt(3.5 * G)


@pytest.fixture(scope="module")
def thrown():
    """A bob thrown along the lowest point of a string of length one: position by time, times of its two events."""

    def swings(t, y):
        return [y[1], -G * np.sin(y[0])]

    def pulls(t, y):
        return y[1] ** 2 + G * np.cos(y[0])

    pulls.terminal, pulls.direction = True, -1
    fine = {"rtol": 1e-13, "atol": 1e-14, "method": "DOP853", "dense_output": True}
    first = solve_ivp(swings, (0, 5), [0.0, THROWN], events=pulls, **fine)
    release, (angle, rate) = first.t[-1], first.y[:, -1]
    assert np.cos(angle) == pytest.approx(2 / 3 - THROWN**2 / (3 * G), abs=1e-12)
    place, velocity = np.array([np.sin(angle), -np.cos(angle)]), rate * np.array([np.cos(angle), np.sin(angle)])

    def flies(s):
        return place + velocity * s + np.array([0.0, -0.5 * G]) * s * s

    flight = brentq(lambda s: np.linalg.norm(flies(s)) - 1.0, 0.1, 3.0, xtol=1e-15)
    there, speed = flies(flight), velocity - np.array([0.0, G * flight])
    again = [np.arctan2(there[0], -there[1]), there[0] * speed[1] - there[1] * speed[0]]
    second = solve_ivp(swings, (0, 5), again, **fine)

    def at(t):
        if release < t <= release + flight:
            return flies(t - release)
        angle = first.sol(t)[0] if t <= release else second.sol(t - release - flight)[0]
        return np.array([np.sin(angle), -np.cos(angle)])

    return at, release, release + flight, 0.5 * (there @ speed) ** 2


# Errors fall by 2 to the order: 32, 8 and 4; some less is allowed as steps are long.
@pytest.mark.parametrize(
    ("integrator", "steps", "least", "error"),
    [("radau-3", 16, 20.0, 1e-4), ("radau-2", 32, 6.5, 1e-2), ("generalised-alpha", 64, 3.3, 5e-2)],
)
def test_the_order_is_kept_over_release_and_impact(thrown, integrator, steps, least, error):
    at, release, impact, lost = thrown
    errors = []
    for count in (steps, 2 * steps):
        table = bob({"t": string(pull=0.0)}, [0, -1], {"end": 1.6}, mass=1.0, velocity=[THROWN, 0])
        table["analysis"] |= {"step": 1.6 / count, "integrator": integrator}
        motion = solve(made(table))
        errors.append(max(np.abs(step.position("B")[:2] - at(step.time)).max() for step in motion.steps))
        slack, taut = motion.events
        assert (slack.acts, taut.acts) == (False, True)
        assert slack.impulse == slack.dissipated == 0.0
        assert taut.time == pytest.approx(impact, abs=errors[-1])
        assert slack.time == pytest.approx(release, abs=errors[-1])
        assert taut.dissipated == pytest.approx(lost, abs=40.0 * errors[-1])
        assert motion.violation["closings"] < 1e-14
    assert errors[1] < min(error, errors[0] / least)


def test_two_links_caught_by_a_string():
    """Two hinged rods with masses, caught by a string: against SciPy, with the impulse by its own matrix."""
    anchor, length = np.array([1.0, 0.5]), 1.4

    def places(y):
        first = np.array([np.cos(y[0]), np.sin(y[0])])
        return first, first + np.array([np.cos(y[1]), np.sin(y[1])])

    def parts(y):
        (a, b), (c, d) = y[:2], y[2:4]
        mass = np.array([[2.0, np.cos(a - b)], [np.cos(a - b), 1.0]])
        forces = np.array([-np.sin(a - b) * d * d - 2 * G * np.cos(a), np.sin(a - b) * c * c - G * np.cos(b)])
        return mass, forces

    def row(y):
        tip = places(y)[1] - anchor
        return tip @ np.array([[-np.sin(y[0]), -np.sin(y[1])], [np.cos(y[0]), np.cos(y[1])]]) / np.linalg.norm(tip)

    def free(t, y):
        return [*y[2:], *np.linalg.solve(*parts(y))]

    def held(t, y):
        mass, forces = parts(y)
        h, small = row(y), 1e-6
        moved = (row(y + small * np.array([*y[2:], 0, 0])) - row(y - small * np.array([*y[2:], 0, 0]))) / (2 * small)
        matrix = np.block([[mass, h[:, None]], [h[None, :], np.zeros((1, 1))]])
        return [*y[2:], *np.linalg.solve(matrix, [*forces, -moved @ y[2:]])[:2]]

    def reaches(t, y):
        return np.linalg.norm(places(y)[1] - anchor) - length

    reaches.terminal, reaches.direction = True, 1
    fine = {"rtol": 1e-11, "atol": 1e-12, "method": "DOP853"}
    fall = solve_ivp(free, (0, 1), [0, 0, 0, 0], events=reaches, **fine)
    # It begins with a string that is longer than needed by far: the first event is not the begin.
    assert fall.t[-1] > 0.1
    y = fall.y[:, -1]
    mass, h = parts(y)[0], row(y)
    impulse = (h @ y[2:]) / (h @ np.linalg.solve(mass, h))
    y[2:] -= np.linalg.solve(mass, h) * impulse
    end = fall.t[-1] + 0.15
    swing = solve_ivp(held, (fall.t[-1], end), y, **fine)
    table = {
        "gravity": [0, -G],
        "nodes": {
            "O": {"position": [0, 0], "support": "hinge"},
            "A": {"position": [1, 0], "mass": 1.0, "joint": "hinge"},
            "B": {"position": [2, 0], "mass": 1.0},
        },
        "members": {"a": {"nodes": ["O", "A"], "type": "rigid"}, "b": {"nodes": ["A", "B"], "type": "rigid"}},
        "tendons": {"t": string(anchor, length=length)},
        "analysis": {"type": "dynamic", "end": end, "step": 0.01},
    }
    motion = solve(made(table))
    event = motion.events[0]
    assert event.time == pytest.approx(fall.t[-1], abs=1e-7)
    assert event.impulse == pytest.approx(impulse, rel=1e-5)
    assert event.dissipated == pytest.approx(0.5 * impulse**2 * (h @ np.linalg.solve(mass, h)), rel=1e-5)
    for name, place in zip("AB", places(swing.y[:, -1]), strict=True):
        # Twice the size times the accuracy.
        np.testing.assert_allclose(motion.last.position(name)[:2], place, atol=4e-7)


def _corner(along, **analysis):
    """A body that falls between two strings, between which there is an acute angle where both are taut."""
    strings = {name: string([x, 0.0], length=1.0) for name, x in (("left", -0.6), ("right", 0.6))}
    return made(bob(strings, [along, -0.2], {"end": 1.0, **(analysis or {"step": 0.05})}))


@pytest.mark.parametrize("along", [0.0, 1e-11, 0.1])
def test_between_two_strings_it_comes_to_rest(along):
    """Both at once, or from one to the other and back ever sooner: then it hangs on both."""
    motion = solve(_corner(along))
    np.testing.assert_allclose(motion.last.position("B"), [0.0, -0.8, 0.0], atol=1e-9)
    tensions = [motion.last.tendon(name)["tension"] for name in ("left", "right")]
    # Weight over twice the cosine; both at rest, to rounding of accelerations.
    np.testing.assert_allclose(tensions, 2.0 * G / (2.0 * 0.8), rtol=1e-6)
    assert motion.last.energy["kinetic"] < 1e-12
    assert motion.last.energy["dissipated"] == pytest.approx(2.0 * G * 0.6, rel=1e-4)
    assert all(event.impulse >= 0.0 and event.dissipated >= 0.0 for event in motion.events)
    # As often as velocities fall by the cosine of the angle between the strings until the way between is nothing.
    assert len({event.time for event in motion.events}) == (1 if along < 0.1 else pytest.approx(11, abs=2))


def test_impulses_are_complementary():
    rng = np.random.default_rng(0)
    for _ in range(50):
        n = int(rng.integers(1, 6))
        # Rows may depend on each other.
        root = rng.standard_normal((n, int(rng.integers(1, n + 1))))
        yielding, speed = root @ root.T, root @ rng.standard_normal(root.shape[1])
        found = _pushing(yielding, speed)
        left = speed - yielding @ found
        assert (found >= 0.0).all()
        # Rounding of matrices whose condition is up to some millions.
        np.testing.assert_array_less(left, 1e-9)
        assert abs(found @ left) < 1e-9


def test_momenta_of_what_flies_stay():
    """Two bodies that fly apart, far from the origin, until a string off their centres of mass is taut."""
    table = {
        "dimension": "space",
        "nodes": {
            "A": {"position": [0, 0], "mass": 2.0, "inertia": [0.1, 0.1, 0.1], "velocity": [20.0, 5.0]},
            "B": {"position": [1, 0], "mass": 1.0, "inertia": [0.1, 0.1, 0.1], "velocity": [22.0, 7.0]},
            "C": {"position": [0, 0.5]},
            "D": {"position": [1, 0.5]},
        },
        "members": {"a": {"nodes": ["A", "C"], "type": "rigid"}, "b": {"nodes": ["B", "D"], "type": "rigid"}},
        "tendons": {"t": {"way": [{"node": "C"}, {"node": "D"}], "length": 1.5}},
        "analysis": {"type": "dynamic", "end": 0.4, "step": 0.01},
    }
    motion = solve(made(table))
    (event,) = motion.events
    assert event.dissipated > 0.1
    linear, angular = (np.array([step.momentum[kind] for step in motion.steps]) for kind in ("linear", "angular"))
    # The integrator keeps the linear one to rounding, the angular one to its order.
    np.testing.assert_allclose(linear, [[62.0, 17.0, 0.0]] * len(linear), atol=1e-8)
    np.testing.assert_allclose(angular, [angular[0]] * len(angular), atol=1e-5)


# -- stops --------------------------------------------------------------------------------------------------


def _on_spring(**analysis):
    table = {
        "nodes": {
            "B": {"position": [0, 0], "mass": 1.0, "support": "slider", "direction": [1, 0], "velocity": [2.0, 0.0]},
            "C": {"position": [0, 1]},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "springs": {
            "k": {"type": "translational", "node": "B", "stiffness": 9.0, "direction": [1, 0], "stop": [-0.2, 0.3]}
        },
        "analysis": {"type": "dynamic", "end": 2.0, **(analysis or {"step": 0.02})},
    }
    return made(table)


def test_a_spring_hits_both_its_stops():
    """It stops at each and goes back at once, with the energy of the spring alone."""
    high = np.arcsin(0.45) / 3.0
    low = high + np.arccos(-2.0 / 3.0) / 3.0
    motion = solve(_on_spring())
    told = [(event.time, event.side, event.acts, event.impulse) for event in motion.events]
    speeds = 2.0 * np.sqrt(1.0 - 0.45**2), 3.0 * np.sqrt(0.3**2 - 0.2**2)
    assert told == [
        (pytest.approx(high, abs=1e-7), "high", False, pytest.approx(speeds[0], rel=1e-6)),
        (pytest.approx(low, abs=1e-7), "low", False, pytest.approx(speeds[1], rel=1e-6)),
    ]
    for step in motion.steps:
        t = step.time
        place = 2 / 3 * np.sin(3 * t) if t < high else 0.3 * np.cos(3 * (t - high))
        place = -0.2 * np.cos(3 * (t - low)) if t > low else place
        assert step.position("B")[0] == pytest.approx(place, abs=2e-7)
    assert motion.last.energy["total"] == pytest.approx(0.18, rel=1e-6)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_pendulum_stays_at_its_stop(dimension):
    table = {
        "dimension": dimension,
        "gravity": [0, -G],
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "mass": 1.0}},
        "members": {"bar": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"node": "A", "stiffness": 0.0, "stop": [-0.5, 0.3]}},
        "analysis": {"type": "dynamic", "end": 0.5, "step": 0.02},
    }
    motion = solve(made(table))
    (event,) = motion.events
    assert (event.name, event.side, event.acts, event.turns) == ("springs.k", "low", True, True)
    assert event.impulse == pytest.approx(np.sqrt(2 * G * np.sin(0.5)), rel=1e-5)
    spring = motion.last.spring("k")
    # Stops close where they are passed by the rounding of openings, 1e-12.
    assert spring.travel == pytest.approx(-0.5, abs=2e-12)
    assert spring.stop == pytest.approx(G * np.cos(0.5), rel=1e-9)
    assert motion.last.energy["dissipated"] == pytest.approx(G * np.sin(0.5), rel=1e-5)


# -- begin, end, what is told -------------------------------------------------------------------------------


def test_it_begins_with_what_is_taut_in_equilibrium():
    """A load holds a body on a spring so that its string is slack; without it the spring pulls it taut."""
    table = {
        "nodes": {
            "B": {"position": [0, 0], "mass": 1.0, "support": "slider", "direction": [1, 0]},
            "C": {"position": [0, 1]},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "springs": {"k": {"type": "translational", "node": "B", "stiffness": 9.0, "direction": [1, 0]}},
        "loads": {
            "hold": {"type": "force", "node": "B", "value": [-2.7, 0.0]},
            "push": {"type": "force", "node": "B", "value": [1.8, 0]},
        },
        "tendons": {"t": {"way": [{"ground": [-1, 0]}, {"node": "B"}], "length": 1.0}},
        "analysis": {"type": "dynamic", "end": 0.8, "step": 0.02, "initial": "equilibrium", "cut": ["hold"]},
    }
    motion = solve(made(table))
    assert motion.steps[0].tendon("t")["slack"]
    assert motion.steps[0].position("B")[0] == pytest.approx(-0.1, abs=1e-9)
    # About 0.2 with the amplitude 0.3; at zero it stops, as the load pulls the string.
    (event,) = motion.events
    assert event.time == pytest.approx(np.arccos(2 / 3) / 3, abs=1e-6)
    assert motion.last.tendon("t")["tension"] == pytest.approx(1.8, rel=1e-6)
    uncut = table | {"analysis": table["analysis"] | {"cut": []}}
    uncut["loads"] = {"push": table["loads"]["push"]}
    still = solve(made(uncut))
    assert not still.events
    assert still.last.tendon("t")["tension"] == pytest.approx(1.8, rel=1e-9)


@pytest.mark.parametrize("gravity", [-G, G])
def test_a_string_at_its_length_is_taut_where_it_pulls(gravity):
    table = bob({"t": string(pull=0.0)}, [0, -1], {"end": 0.1, "step": 0.05}) | {"gravity": [0, gravity]}
    motion = solve(made(table))
    step = motion.last
    assert step.tendon("t")["slack"] is (gravity > 0.0)
    assert step.tendon("t")["tension"] == pytest.approx(20.0 if gravity < 0.0 else 0.0, rel=1e-7)
    assert step.position("B")[1] == pytest.approx(-1.0 + (0.05 if gravity > 0.0 else 0.0), abs=1e-7)


def test_it_ends_at_a_condition_behind_an_impact():
    """The end is not interpolated across the impact."""
    table = bob({"t": string(length=1.0)}, [0.6, 0.0], {"end": 1.0, "output": 0.25, "step": 0.01})
    table["analysis"]["until"] = {"quantity": "nodes.B.position", "component": 0, "below": 0.58}
    found = solve(made(table)).last
    time = np.sqrt(2 * 0.8 / G)
    # Shortly after the impact at (0.6, -0.8) it goes on along the circle, with 0.6 of its speed.
    swing = solve_ivp(
        lambda t, y: [y[1], -G * np.sin(y[0])], (0, 0.1), [np.arcsin(0.6), -0.6 * np.sqrt(16.0)],
        rtol=1e-11, atol=1e-12, events=lambda t, y: np.sin(y[0]) - 0.58,
    )  # fmt: skip
    assert found.position("B")[0] == pytest.approx(0.58, abs=1e-9)
    assert found.time == pytest.approx(time + swing.t_events[0][0], abs=1e-6)


def _beam(**analysis):
    table = {
        "gravity": [0, -3.0],
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0, "damping": 0.02}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "mass": 1.0}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "tendons": {"t": {"way": [{"ground": [1, 0.5]}, {"node": "B"}], "pull": -0.05}},
        "analysis": {"type": "dynamic", "end": 0.3, **analysis},
    }
    return made(table)


def test_a_beam_caught_by_a_string():
    """Two integrators on different meshes agree on the impact and on where the beam is afterwards."""
    one = solve(_beam(accuracy=3e-3))
    other = solve(_beam(integrator="generalised-alpha", step=2e-3, accuracy=1e-4))
    assert len(one.events) == len(other.events) == 1
    # On a coarser mesh more of the mass of the beam takes part in the impact, some percent of that at the tip.
    assert one.events[0].impulse == pytest.approx(other.events[0].impulse, rel=3e-2)
    assert one.events[0].dissipated == pytest.approx(other.events[0].dissipated, rel=3e-2)
    for step in one.steps[::10]:
        near = other.at(step.time)
        np.testing.assert_allclose(step.position("B"), near.position("B"), atol=2e-3)
        middle = np.array([0.5])
        np.testing.assert_allclose(step.fields.positions("m", middle), near.fields.positions("m", middle), atol=2e-3)
    # Once taut the length is given.
    assert one.last.tendon("t")["length"] == pytest.approx(0.55, abs=1e-9)


def test_a_string_is_wound_up_until_it_lifts():
    """A slack string is shortened until it is taut; then the body follows, and its stop lets go."""
    table = bob({"t": string([0, 2], length=1.5, history="winch")}, [0, 0], {"end": 1.0, "step": 0.05})
    table["nodes"]["B"] |= {"support": "slider", "direction": [0, 1]}
    table["histories"] = {"winch": {"t": [0, 1], "polynomial": [[-1.0, 0.0, 2.0]]}}
    table["springs"] = {
        "floor": {"type": "translational", "node": "B", "stiffness": 0.0, "direction": [0, 1], "stop": [0, 1]}
    }
    motion = solve(made(table))
    # The string has the length 2 - (2 - 1.5) (2 t^2 - 1), and pulls from 2 t^2 = 1 on with the speed 2 t.
    time = np.sqrt(0.5)
    np.testing.assert_allclose([event.time for event in motion.events], time, atol=1e-6)
    hit = next(event for event in motion.events if event.name == "tendons.t")
    assert hit.impulse == pytest.approx(2.0 * 2.0 * time, rel=1e-5)
    assert motion.at(0.5).spring("floor").stop == pytest.approx(20.0, rel=1e-6)
    assert motion.last.position("B")[1] == pytest.approx(0.5, abs=1e-6)
    assert motion.last.tendon("t")["tension"] == pytest.approx(2.0 * (G + 2.0), rel=1e-5)


def test_what_is_told(tmp_path, capsys):
    file = tmp_path / "bob.json"
    dump(made(bob({"t": string(length=1.0)}, [0.6, 0.0], {"end": 0.5, "step": 0.05})), file)
    assert main(["run", str(file), "--json", str(tmp_path / "answer.json")]) == 0
    text = capsys.readouterr().out
    assert "  at 0.4 s tendons.t: taut, after an impulse of 6.4 N s, 10.24 N m dissipated" in text
    answer = json.loads((tmp_path / "answer.json").read_text())
    (event,) = answer["events"]
    assert event["name"] == "tendons.t"
    assert answer["tendons"]["t"]["slack"][0] is True
    assert answer["tendons"]["t"]["slack"][-1] is False
    assert answer["energy"]["dissipated"][-1] == pytest.approx(event["dissipated"], rel=1e-12)


@pytest.mark.parametrize("integrator", ["idas", "conserving"])
def test_integrators_that_find_no_events_are_refused(integrator):
    with pytest.raises(SceneError, match=rf"tendons\.left: found with the integrator '{integrator}', which does not"):
        _corner(0.1, integrator=integrator)
    with pytest.raises(SceneError, match=rf"springs\.k\.stop: found with the integrator '{integrator}', which does"):
        _on_spring(integrator=integrator)


def test_a_string_too_short_at_the_begin_is_refused():
    with pytest.raises(SceneError, match=r"tendons\.t: found 0\.1 m shorter than its way at t = 0, accepted: as long"):
        solve(made(bob({"t": string(length=0.5)}, [0.6, 0.0], {"end": 0.5})))


@pytest.mark.parametrize(("scene", "number"), [(_corner(0.1), "tendons.left.length"), (_on_spring(), "springs.k.rest")])
def test_what_needs_smooth_equations_is_refused(scene, number, tmp_path):
    search = r"(whether a tendon is slack|which stops act) is found by a search"
    with pytest.raises(
        SceneError, match="found 'radau-3' with stops, or tendons that may be slack, accepted for C: step"
    ):
        sfetcas.export(scene, tmp_path)
    with pytest.raises(SceneError, match=search):
        sfetcas.Design(scene)
    with pytest.raises(SceneError, match=search):
        sfetcas.OptimalControl(scene, {number: (0, 1)}, time=1.0)
    with pytest.raises(SceneError, match=search):
        sfetcas.motion_functions(scene)


def test_events_without_end_are_refused(monkeypatch):
    """More events than a share of the motion may have end it with a sentence."""
    monkeypatch.setattr(events, "MOST", 3)
    monkeypatch.setattr(events, "BRIEF", 1.0)
    with pytest.raises(
        SolveError, match=r"one impact or release follows another, 3 of them, of tendons\.right, tend"
    ) as told:
        solve(_corner(0.1))
    assert told.value.reached is not None
