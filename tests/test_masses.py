"""Masses, dampers, loads and motions against closed forms and equations of motion written by hand."""

import math

import numpy as np
import pytest
from motions import FLAT, SMOOTH, THICK, cantilever, moved

import sfetcas
from sfetcas.mathematics import quaternion as quat

pytestmark = pytest.mark.usefixtures("interpreted")

GRAVITY = 9.81
CLOSE = 1e-6
"""Of lengths of 1: runs are asked for 1e-7."""
RATES = 1e-3
"""Of accelerations and reactions, which are second derivatives of what is asked for: of their size, some 10."""
ROD = {"rhoA": 1.2, "rhoI": [0.02, 0.01, 0.01]}
J = 1.2 / 3 + 0.01
"""Inertia of the rod about its end."""


def exact(table, end, **keys):
    return moved(table, end, accuracy=1e-7, **keys)


def runge_kutta(rate, x, end, steps=4000):
    """The state at the end by the classical method; its error is below 1e-10 here."""
    x, h = np.asarray(x, dtype=float), end / steps
    for i in range(steps):
        t = i * h
        a = rate(t, x)
        b = rate(t + h / 2, x + h / 2 * a)
        c = rate(t + h / 2, x + h / 2 * b)
        d = rate(t + h, x + h * c)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
    return x


def rod(**more):
    return {
        "sections": {"s": ROD},
        "nodes": {"A": {"position": [0, 0, 0], "support": "hinge"}, "B": {"position": [1, 0, 0]}},
        "members": {"r": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        **more,
    }


def direction(angle):
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def across(angle):
    return np.array([-math.sin(angle), math.cos(angle), 0.0])


# -- rigid bodies -----------------------------------------------------------------------------------------------------


def pendulum(t, x):
    return np.array([x[1], -1.2 * GRAVITY * 0.5 * math.cos(x[0]) / J])


@pytest.mark.parametrize(
    ("integrator", "dimension"),
    [("radau-3", "plane"), ("radau-2", "plane"), ("generalised-alpha", "space"), ("conserving", "space")],
)
def test_pendulum(integrator, dimension):
    table = rod(gravity=[0, -GRAVITY, 0], dimension=dimension)
    order2 = integrator in ("generalised-alpha", "conserving")
    step = moved(table, 1.3, accuracy=1e-5 if order2 else 1e-7, integrator=integrator).last
    angle, rate = runge_kutta(pendulum, [0, 0], 1.3)
    loose = 100 if order2 else 1
    assert np.abs(step.position("B") - direction(angle)).max() < loose * CLOSE
    assert np.abs(step.velocity("B") - rate * across(angle)).max() < loose * 1e-4
    turning = pendulum(0, [angle, rate])[1]
    acceleration = 0.5 * (turning * across(angle) - rate**2 * direction(angle))
    force, moment = step.reaction("A")
    assert np.abs(force - 1.2 * np.add(acceleration, [0, GRAVITY, 0])).max() < 10 * loose * RATES
    assert np.abs(moment).max() < 10 * loose * RATES
    assert step.energy["kinetic"] == pytest.approx(0.5 * J * rate**2, rel=loose * 1e-4)
    assert np.abs(step.momentum["angular"] - [0, 0, (0.1 + 0.01) * rate]).max() < loose * 1e-4


def test_double_pendulum():
    table = rod(gravity=[0, -GRAVITY, 0])
    table["nodes"]["B"] |= {"joint": "hinge", "mass": 0.3}
    table["nodes"]["C"] = {"position": [1.6, 0, 0], "mass": 0.2}
    table["members"]["q"] = {"nodes": ["B", "C"], "type": "rigid", "section": "s"}
    # Lagrange's equations: rods of lengths 1 and 0.6, masses at their ends.
    m, n, long = 1.2, 1.2 * 0.6, 0.6
    first = J + (0.3 + n + 0.2)
    second = n * long**2 / 3 + 0.01 * long + 0.2 * long**2
    lever = (n / 2 + 0.2) * long

    def rate(t, x):
        a, b, va, vb = x
        matrix = np.array([[first, lever * math.cos(a - b)], [lever * math.cos(a - b), second]])
        right = [
            -lever * math.sin(a - b) * vb**2 - GRAVITY * (m / 2 + 0.3 + n + 0.2) * math.cos(a),
            lever * math.sin(a - b) * va**2 - GRAVITY * lever * math.cos(b),
        ]
        return np.array([va, vb, *np.linalg.solve(matrix, right)])

    a, b, va, vb = runge_kutta(rate, [0, 0, 0, 0], 1.5)
    step = exact(table, 1.5).last
    assert np.abs(step.position("B") - direction(a)).max() < CLOSE
    assert np.abs(step.position("C") - direction(a) - long * direction(b)).max() < 10 * CLOSE
    assert np.abs(step.velocity("C") - va * across(a) - long * vb * across(b)).max() < 1e-3


INERTIA = np.array([0.3, 0.5, 0.7])


def top(spin, **node):
    """A light rigid arm, all mass and inertia at the node B, asymmetric."""
    return {
        "nodes": {
            "A": {"position": [0, 0, 0], **node},
            "B": {"position": [0.2, 0, 0.6], "mass": 1.5, "inertia": INERTIA.tolist()},
        },
        "members": {"arm": {"nodes": ["A", "B"], "type": "rigid", "spin": spin}},
    }


def tumbling(spin, lever, end):
    """End of the arm and rate of turning, by Euler's equations about its fixed end or the centre of mass."""
    inertia = np.diag(INERTIA) + 1.5 * (lever @ lever * np.eye(3) - np.outer(lever, lever))

    def rate(t, x):
        turn, w = quat.matrix(x[:4] / np.linalg.norm(x[:4])), x[4:]
        moment = np.cross(lever, turn.T @ [0, 0, -1.5 * GRAVITY])
        return np.concatenate(
            [
                0.5 * quat.multiply(x[:4], np.array([0.0, *w])),
                np.linalg.solve(inertia, moment - np.cross(w, inertia @ w)),
            ]
        )

    return runge_kutta(rate, [1, 0, 0, 0, *spin], end)


@pytest.mark.parametrize("integrator", ["radau-3", "conserving"])
def test_heavy_top(integrator):
    spin, lever = [0.5, 1.0, 6.0], np.array([0.2, 0.0, 0.6])
    x = tumbling(spin, lever, 1.5)
    table = {**top(spin, support="ball"), "gravity": [0, 0, -GRAVITY]}
    loose = 1 if integrator == "radau-3" else 1000
    step = moved(table, 1.5, accuracy=loose * 1e-7, integrator=integrator).last
    turn = quat.matrix(x[:4] / np.linalg.norm(x[:4]))
    assert np.abs(step.position("B") - turn @ lever).max() < 10 * loose * CLOSE
    assert abs(abs(step.quaternion("B") @ x[:4]) - 1.0) < loose * CLOSE
    moment = step.reaction("A")[1]
    assert np.abs(moment).max() < loose * 10 * RATES


def test_a_free_body_tumbles_by_euler():
    spin, lever = np.array([0.2, 4.0, 0.3]), np.zeros(3)
    x = tumbling(spin, lever, 2.0)
    velocity = np.array([0.3, -0.2, 0.5])
    table = top(spin.tolist(), velocity=(velocity + np.cross(spin, [-0.2, 0, -0.6])).tolist())
    table["nodes"]["B"]["velocity"] = velocity.tolist()
    step = exact(table, 2.0).last
    assert np.abs(step.position("B") - [0.2, 0, 0.6] - 2.0 * velocity).max() < CLOSE
    turn = quat.matrix(x[:4] / np.linalg.norm(x[:4]))
    assert np.abs(step.position("A") - step.position("B") + turn @ [0.2, 0, 0.6]).max() < 10 * CLOSE
    assert np.abs(step.momentum["angular"] - INERTIA * spin).max() < 1e-3
    assert np.abs(step.momentum["linear"] - 1.5 * velocity).max() < CLOSE


# -- dampers, drag ----------------------------------------------------------------------------------------------------


def slider(**more):
    """A mass on a guide along x, on a light rod that is there to have a member."""
    return {
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "slider", "direction": [1, 0, 0], "mass": 2.0},
            "B": {"position": [0, 1, 0]},
        },
        "members": {"r": {"nodes": ["A", "B"], "type": "rigid"}},
        **more,
    }


def damped(mass, damper, stiffness, speed, t):
    """A damped oscillator thrown from its rest."""
    decay = damper / mass / 2
    omega = math.sqrt(stiffness / mass - decay**2)
    return speed / omega * math.exp(-decay * t) * math.sin(omega * t)


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("spring", [{"direction": [1, 0, 0]}, {"anchor": [-1, 0, 0]}], ids=["along", "length"])
def test_damped_oscillator(dimension, spring):
    table = slider(dimension=dimension)
    table["nodes"]["A"]["velocity"] = [0.5, 0, 0]
    table["springs"] = {"s": {"type": "translational", "node": "A", "stiffness": 30.0, "damping": 1.6, **spring}}
    step = exact(table, 1.7).last
    assert step.position("A")[0] == pytest.approx(damped(2.0, 1.6, 30.0, 0.5, 1.7), abs=CLOSE)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_damped_turning(dimension):
    table = rod(dimension=dimension, springs={"s": {"node": "A", "stiffness": 12.0, "damping": 0.4}})
    table["members"]["r"]["spin"] = [0, 0, 2.0] if dimension == "space" else 2.0
    angle = damped(J, 0.4, 12.0, 2.0, 1.1)
    assert np.abs(exact(table, 1.1).last.position("B") - direction(angle)).max() < CLOSE


def test_drag_of_a_node():
    table = slider()
    table["nodes"]["A"] |= {"velocity": [1.5, 0, 0], "drag": 0.7}
    table["loads"] = {"pull": {"type": "force", "node": "A", "value": [3.0, 1.0, 0]}}
    k, t = 0.7 / 2.0, 2.0
    last = 3.0 / 0.7
    x = last * t + (1.5 - last) * (1 - math.exp(-k * t)) / k
    step = exact(table, t).last
    assert step.position("A")[0] == pytest.approx(x, abs=10 * CLOSE)
    assert step.velocity("A")[0] == pytest.approx(last + (1.5 - last) * math.exp(-k * t), abs=1e-4)
    assert np.abs(step.reaction("A")[0] - [0, -1, 0]).max() < RATES


@pytest.mark.parametrize("space", [False, True])
def test_drag_of_a_member(space):
    section = (THICK if space else FLAT) | {"drag": 0.6}
    table = cantilever(
        section, nodes={"A": {"position": [0, 0, 0], "velocity": [1, 2, 0]}, "B": {"position": [1, 0, 0]}}
    )
    del table["loads"]
    table["gravity"] = [0, -GRAVITY, 0]
    k, t = 0.6, 1.5
    fall = -GRAVITY / k
    there = [(1 - math.exp(-k * t)) / k, fall * t + (2 - fall) * (1 - math.exp(-k * t)) / k, 0]
    assert np.abs(exact(table, t).last.position("A") - there).max() < 10 * CLOSE


# -- small vibrations -------------------------------------------------------------------------------------------------

FIRST = 3.51601526850015
"""Square of the lowest root of 1 + cos cosh."""
SLENDER = {"EI3": 1.0, "rhoA": 1.0}
TIP = 1e-4
"""Deflections, m: the period changes by their square."""


def ringing(section, periods, **more):
    """A cantilever let go from a bent shape: times and deflections of its end."""
    table = cantilever(section)
    table["loads"]["tip"] = {"type": "force", "node": "B", "value": [0, 3 * TIP * 1.0]}
    begin = {"initial": "equilibrium", "cut": ["tip"]}
    period = 2 * math.pi / FIRST
    motion = moved(
        table, periods * period, period / 200, element="SFET5", elements=2, output=period / 200, **begin, **more
    )
    return motion.times, motion.positions("B")[:, 1]


def test_period_of_a_cantilever():
    times, y = ringing(SLENDER, 10)
    # The first mode by its projection on two windows of five periods each.
    half = len(times) // 2
    phases = [
        np.angle(np.trapezoid(y[part] * np.exp(-1j * FIRST * times[part]) * window(half), times[part]))
        for part in (slice(0, half), slice(half, 2 * half))
    ]
    shift = (phases[1] - phases[0] + math.pi) % (2 * math.pi) - math.pi
    assert abs(shift) < 1e-4


def window(n):
    """Smooth weights that other modes do not get through."""
    return np.sin(math.pi * (np.arange(n) + 0.5) / n) ** 4


def test_kelvin_voigt_decays_by_the_square_of_the_frequency():
    delay = 0.004
    times, y = ringing(SLENDER | {"damping": delay}, 10)
    half = len(times) // 2
    parts = (slice(0, half), slice(half, 2 * half))
    shares = [
        abs(np.trapezoid(y[part] * np.exp(-1j * FIRST * times[part]) * window(half), times[part])) for part in parts
    ]
    rate = math.log(shares[0] / shares[1]) / (times[half] - times[0])
    # To the square of the damping ratio.
    assert rate == pytest.approx(FIRST**2 * delay / 2, rel=1e-3)


# -- damping and rest -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("space", [False, True])
def test_a_cut_load_leaves_the_equilibrium_of_the_others(space):
    table = cantilever((THICK if space else FLAT) | {"damping": 0.5, "drag": 2.0}, (0.5, 2.0, 1.0 if space else 0.0))
    table["loads"]["tip"].pop("history")
    table["loads"]["stays"] = {"type": "force", "node": "B", "value": [-0.5, -1.0, 0.0]}
    motion = moved(table, 60.0, 0.1, elements=2, output=0.5, initial="equilibrium", cut=["tip"])
    static = {key: part for key, part in table.items() if key != "loads"} | {
        "loads": {"stays": table["loads"]["stays"]}
    }
    # The same elements: what is left lies in the plane.
    static["dimension"] = "space" if space else "plane"
    there = sfetcas.solve(sfetcas.Scene.from_dict(static), element="SFET4", elements=2).last
    both = sfetcas.solve(sfetcas.Scene.from_dict(table), element="SFET4", elements=2).last
    assert np.abs(motion.steps[0].position("B") - both.position("B")).max() < 1e-9
    assert np.abs(motion.last.position("B") - there.position("B")).max() < 1e-9
    energies = motion.energies()
    # Nothing but damping takes energy, to the accuracy of velocities.
    assert np.diff(energies).max() < 1e-6 * np.ptp(energies)
    assert energies[-1] == pytest.approx(there.energy["elastic"] + there.energy["loads"], abs=1e-9)


# -- reactions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("inertia", ["section", "node A", "node B", "mass"])
def test_reaction_of_a_driven_bar(dimension, inertia):
    """J alpha, whatever the inertia belongs to."""
    table = rod(
        dimension=dimension,
        motions={"crank": {"node": "A", "rotation": 1.5, "history": "on"}},
        histories={"on": SMOOTH},
    )
    table["sections"]["s"] = {"rhoA": 1.2, "rhoI": [0.02, 0.01, 0.01]} if inertia == "section" else {"rhoA": 1.2}
    about = J if inertia == "section" else J - 0.01
    if inertia.startswith("node"):
        table["nodes"][inertia[-1]]["inertia"] = [0.02, 0.03, 0.04]
        about += 0.04
    if inertia == "mass":
        table["nodes"]["B"]["mass"] = 0.5
        about += 0.5
    step = moved(table, 0.7, 0.01).last
    polynomial = np.polynomial.Polynomial(SMOOTH["polynomial"][0])
    angle, rate, turning = (1.5 * polynomial.deriv(k)(0.7) for k in range(3))
    assert np.abs(step.position("B") - direction(angle)).max() < 1e-12
    force, moment = step.reaction("A")
    assert moment[2] == pytest.approx(about * turning, abs=1e-3)
    mass = 0.6 + (0.5 if inertia == "mass" else 0.0)
    assert np.abs(force - mass * (turning * across(angle) - rate**2 * direction(angle))).max() < 1e-3
    assert step.motion("crank")["moment"] == pytest.approx(about * turning, abs=1e-3)


@pytest.mark.parametrize("space", [False, True])
def test_reactions_and_loads_change_the_momentum(space):
    table = cantilever(THICK if space else FLAT, (0.4, 1.0, -0.7 if space else 0.0))
    table["gravity"] = [0.5, -1.0, 0.3 if space else 0.0]
    table["nodes"]["B"] |= {"joint": "hinge", "mass": 0.2}
    table["nodes"]["C"] = {"position": [1.6, 0.3, 0], "support": "slider", "direction": [1, 0.2, 0], "rotation": "ball"}
    table["members"]["n"] = {"nodes": ["B", "C"], "section": "s", "type": "rigid"}
    h = 0.005
    motion = moved(table, 0.9, h, elements=2, output=h)
    factor = np.polynomial.Polynomial(SMOOTH["polynomial"][0])
    linear = np.array([step.momentum["linear"] for step in motion.steps])
    mass = 1.0 + 0.2 + math.hypot(0.6, 0.3)
    for k in (60, 110, 170):
        step = motion.steps[k]
        rate = (linear[k - 2] - 8 * linear[k - 1] + 8 * linear[k + 1] - linear[k + 2]) / (12 * h)
        acting = step.reaction("A")[0] + step.reaction("C")[0] + mass * np.array(table["gravity"])
        acting += factor(step.time) * np.array(table["loads"]["tip"]["value"])
        assert np.abs(rate - acting).max() < 1e-3
        # A slider takes no force along its guide.
        assert abs(step.reaction("C")[0] @ [1, 0.2, 0]) < 1e-3


# -- limits of members ------------------------------------------------------------------------------------------------


def elbow(kind, stiff=1.0, load=1.0, space=True):
    """A flexible strip with a member of another kind at its end."""
    table = cantilever(THICK, (0.3 * load, 1.0 * load, 0.5 * load if space else 0.0))
    table["sections"]["t"] = THICK | {key: THICK[key] * stiff for key in ("EI2", "EI3", "GJ")}
    table["nodes"]["C"] = {"position": [1.3, 0.5, 0.2 if space else 0.0]}
    table["members"]["n"] = {"nodes": ["B", "C"], "section": "t", "type": kind}
    return table


@pytest.mark.parametrize("space", [False, True])
def test_a_rigid_member_is_the_limit_of_stiff_ones(space):
    there = moved(elbow("rigid", space=space), 1.0, 0.02, elements=2).last.position("C")
    apart = [
        np.abs(moved(elbow("flexible", k, space=space), 1.0, 0.02, elements=2).last.position("C") - there).max()
        for k in (1e4, 1e6)
    ]
    # By the inverse of the stiffness.
    assert apart[1] < 2e-6
    assert apart[0] / apart[1] == pytest.approx(100, rel=0.1)


@pytest.mark.parametrize("space", [False, True])
def test_a_small_member_is_the_limit_of_flexible_ones(space):
    apart = []
    for load in (0.04, 0.02):
        small, flexible = (
            moved(elbow(kind, 30.0, load, space), 1.0, 0.02, element="SFET6", elements=2).last.position("C")
            for kind in ("small", "flexible")
        )
        apart.append(np.abs(small - flexible).max() / load)
    # Of the load: deformations are small, so that this is what the mesh and the points of the small member leave.
    assert max(apart) < 5e-6


def test_two_masses_on_a_spring():
    """Free on a guide each: they swing about their common centre, which goes on."""
    table = slider()
    table["nodes"]["A"]["velocity"] = [0.6, 0, 0]
    table["nodes"]["C"] = {
        "position": [2, 0, 0],
        "support": "slider",
        "direction": [1, 0, 0],
        "mass": 3.0,
        "velocity": [0, 0, 0],
    }
    table["nodes"]["D"] = {"position": [2, 1, 0]}
    table["members"]["q"] = {"nodes": ["C", "D"], "type": "rigid"}
    table["springs"] = {"s": {"type": "translational", "node": "A", "to": "C", "stiffness": 20.0}}
    t, omega = 1.9, math.sqrt(20.0 * (1 / 2.0 + 1 / 3.0))
    centre, apart = 0.6 * 2.0 / 5.0 * t, -0.6 / omega * math.sin(omega * t)
    step = exact(table, t).last
    assert step.position("A")[0] == pytest.approx(centre - 0.6 * apart, abs=10 * CLOSE)
    assert step.position("C")[0] == pytest.approx(2 + centre + 0.4 * apart, abs=10 * CLOSE)
