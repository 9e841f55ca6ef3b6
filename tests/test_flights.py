"""Motions against independent ones: free flight, pendulums of rigid rods, a driven slider-crank."""

from pathlib import Path

import numpy as np
import pytest

from sfetcas import Analysis, CrossSection, Member, Node, Scene, load, solve
from sfetcas.description.sections import Polynomial

PROBLEMS = Path(__file__).parent.parent / "problems"

GRAVITY, VELOCITY = np.array([0.0, -2.0, 0.0]), np.array([3.0, 4.0, 0.0])


def thrown():
    """A rod thrown and left to bend as it turns, over five of its lengths."""
    return Scene(
        gravity=list(GRAVITY),
        sections={"s": CrossSection(EI3=1.0, rhoA=1.0, rhoI=[0.0, 0.0, 0.01])},
        # An angular velocity of 6 - 4 s moves the point s by 6 s - 2 s^2 against the end, on the mean by 7/3.
        nodes={"A": Node(position=[0, 0], velocity=[VELOCITY[0], VELOCITY[1] - 7.0 / 3.0]), "B": Node(position=[1, 0])},
        members={"rod": Member(nodes=["A", "B"], section="s", spin=Polynomial(polynomial=[6.0, -4.0]))},
        analysis=Analysis(type="dynamic", end=2.0, output=0.5, accuracy=1e-4),
    )


def test_centre_of_a_thrown_rod_flies_as_a_point_and_its_angular_momentum_stays():
    motion = solve(thrown())
    first = motion.steps[0].momentum
    for step in motion.steps:
        # Radau keeps the linear momentum to rounding, what it loses of the others is of the order of the accuracy.
        assert step.momentum["linear"] == pytest.approx(VELOCITY + GRAVITY * step.time, abs=1e-10)
        assert step.momentum["angular"] == pytest.approx(first["angular"], abs=1e-5)
        assert step.energy["total"] == pytest.approx(motion.steps[0].energy["total"], abs=1e-4)


@pytest.mark.parametrize("integrator", ["radau-2", "generalised-alpha", "conserving"])
def test_steps_by_the_error_are_as_near_as_asked_for_with_every_integrator(integrator):
    scene = thrown()
    exact = solve(scene).last
    found = solve(driven(scene, integrator=integrator, accuracy=1e-3)).last
    # The accuracy asked for, of a rod of length 1.
    assert found.position("A") == pytest.approx(exact.position("A"), abs=1e-3)
    assert found.position("B") == pytest.approx(exact.position("B"), abs=1e-3)


def accelerations(theta, omega, g):
    """Of the angles of two equal rods, length and mass 1, from Lagrange's equations."""
    turn = theta[0] - theta[1]
    mass = np.array([[4.0 / 3.0, 0.5 * np.cos(turn)], [0.5 * np.cos(turn), 1.0 / 3.0]])
    force = 0.5 * np.sin(turn) * np.array([-(omega[1] ** 2), omega[0] ** 2]) - g * np.cos(theta) * np.array([1.5, 0.5])
    return np.linalg.solve(mass, force)


def swung(theta, g, end, steps):
    """The angles at the end of a motion from rest, by Runge and Kutta's method of order 4."""
    state, h = np.array([*theta, 0.0, 0.0]), end / steps

    def rate(y):
        return np.concatenate([y[2:], accelerations(y[:2], y[2:], g)])

    for _ in range(steps):
        k1 = rate(state)
        k2 = rate(state + 0.5 * h * k1)
        k3 = rate(state + 0.5 * h * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state[:2]


def test_double_pendulum_of_rigid_rods_swings_as_two_angles_do():
    scene = load(PROBLEMS / "double_pendulum_rigid.toml")
    motion = solve(scene)
    # Steps of 1 ms leave 5e-9 rad at 2 s (against shorter ones); ten times the accuracy of the scene.
    upper, lower = swung([0.0, 0.5 * np.pi], 9.81, 2.0, 2000)
    tip = np.array([np.cos(upper) + np.cos(lower), np.sin(upper) + np.sin(lower), 0.0])
    assert motion.last.position("B") == pytest.approx(tip, abs=1e-6)


def driven(scene, **keys):
    return scene.replace(expect=(), analysis=scene.analysis.replace(**keys))


def test_crank_gives_a_flexible_rod_the_energy_that_it_has():
    scene = load(PROBLEMS / "slider_crank_motion.toml")
    motion = solve(driven(scene, end=2.0, output=0.005, accuracy=1e-5))
    turn, history = scene.motions["crank"].rotation, scene.histories["turn"]
    power = [step.reaction("pivot")[1][2] * turn * history.rate(step.time) for step in motion.steps]
    energy = motion.energies() - motion.energies()[0]
    work = integrated(np.array(power), 0.005)
    # Moments contain accelerations and are near to 1e-2 N m between the ends of steps; their integral to 4e-4 N m.
    assert energy[::2] == pytest.approx(work, abs=1e-3)
    assert np.abs(energy).max() > 5.0


def test_loads_with_histories_give_the_energy_that_a_rod_gains():
    """Ramp, hold and wave of a dead force and of a follower: their power from outside, and the stated balance."""
    ramp, wave = [0, 0, 0, 10, -15, 6], [1, 0, 0, -5, 7.5, -3]
    table = {
        "sections": {"rod": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "mass": 0.3}},
        "members": {"m": {"nodes": ["A", "B"], "section": "rod"}},
        "histories": {"on": {"t": [0, 0.3, 0.5, 0.9], "polynomial": [ramp, [1], wave]}},
        "loads": {
            "dead": {"type": "force", "node": "B", "value": [0.3, -2.0], "history": "on"},
            "turning": {"type": "force", "node": "B", "value": [-0.5, 1.0], "frame": "follower", "history": "on"},
        },
        "analysis": {"type": "dynamic", "end": 1.0, "output": 0.005, "accuracy": 1e-4},
    }
    scene = Scene.from_dict(table)
    motion = solve(scene)
    history, steps = scene.histories["on"], motion.steps
    factor, rate = np.array([[history.factor(t), history.rate(t)] for t in motion.times]).T[:, :, None]
    turned, spun = scene.loads["turning"].vector, []
    for step in steps:
        c, s = np.cos(step.angle("B")), np.sin(step.angle("B"))
        spun.append([c * turned[0] - s * turned[1], s * turned[0] + c * turned[1], 0.0])
    size = np.array(scene.loads["dead"].vector) + np.array(spun)
    u, v = motion.positions("B") - [1, 0, 0], motion.velocities("B")
    gained = motion.energies("kinetic") + motion.energies("elastic")
    # Velocities are off by more than the positions, which are to 1e-4 of the rod: found 5e-6 N m of 0.26.
    assert gained[::2] == pytest.approx(integrated((factor * size * v).sum(axis=1), 0.005), abs=3e-5)
    # A turning force changes by its direction, too; differences over 5 ms.
    turning = np.gradient(np.array(spun), motion.times, axis=0, edge_order=2)
    changing = integrated(((rate * size + factor * turning) * u).sum(axis=1), 0.005)
    assert motion.energies()[::2] == pytest.approx(-changing, abs=3e-5)
    assert np.abs(changing).max() > 0.1


def test_a_moment_without_potential_is_no_loss_of_the_step():
    """A dead moment in space turns a free bar: it gives energy, which is in no potential."""
    table = {
        "dimension": "space",
        "sections": {"rod": {"rhoA": 1.0, "rhoI": [0.02, 0.01, 0.01]}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "ball"}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "rod", "type": "rigid"}},
        "loads": {"turn": {"type": "moment", "node": "B", "value": [0.2, 0.5, 0.4]}},
        "analysis": {"type": "dynamic", "end": 0.5, "output": 0.5, "step": 0.01},
    }
    motion = solve(Scene.from_dict(table))
    assert motion.energies()[-1] > 0.01
    assert motion.notes == ()


def integrated(values, h):
    """The integral from the begin to every other point, by Simpson's rule."""
    parts = h / 3.0 * (values[:-2:2] + 4.0 * values[1:-1:2] + values[2::2])
    return np.concatenate([[0.0], np.cumsum(parts)])


def test_stiffer_rod_of_a_slider_crank_comes_nearer_to_a_rigid_one():
    scene = driven(load(PROBLEMS / "slider_crank_motion.toml"), end=1.0, output=1.0, accuracy=1e-6)
    rigid = {name: member.replace(type="rigid") for name, member in scene.members.items()}
    exact = solve(scene.replace(members=rigid)).last.position("slider")
    crank = np.pi / 3.0 + scene.motions["crank"].rotation * scene.histories["turn"].factor(1.0)
    assert exact[0] == pytest.approx(0.5 * np.cos(crank) + np.sqrt(1.44 - 0.25 * np.sin(crank) ** 2), abs=1e-6)
    differences = []
    for stiffness in (50.0, 500.0):
        sections = {"rod": scene.sections["rod"].replace(EI3=stiffness)}
        slider = solve(scene.replace(sections=sections)).last.position("slider")
        differences.append(abs(slider[0] - exact[0]))
    # The bow of the rod is as 1/EI, what it takes from its chord as the square of that.
    assert differences[1] == pytest.approx(0.01 * differences[0], rel=0.2)
