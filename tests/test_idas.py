"""IDAS: the index-1 equations against other formulas, motions against other integrators and closed forms."""

import itertools
import signal
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
import scenes
from motions import FLAT, cantilever, changed, moved

import sfetcas
from sfetcas import Scene, SceneError, Settings, SolveError, Status, assemble, uniform_mesh
from sfetcas.description.loads import History
from sfetcas.dynamics import idas
from sfetcas.dynamics.index_one import IndexOne
from sfetcas.dynamics.inertia import Inertia
from sfetcas.dynamics.projecting import closed
from sfetcas.dynamics.simulation import simulate
from sfetcas.dynamics.stages import StageEquations
from sfetcas.mechanics.equations import Equations, State
from sfetcas.mechanics.masses import masses_of
from sfetcas.stopping import noted

ACCURACY = 1e-4
RAMP = {"t": [0, 0.2, 1], "polynomial": [[0, 0, 0, 10, -15, 6], [1]]}
OTHERS = "radau-3, radau-2, generalised-alpha or conserving"


def dynamic(table, end=0.4, **keys):
    """A scene at rest that is loaded and driven smoothly, with rotary inertia and damping."""
    sections = {name: {"rhoI": [2e-3, 1e-3, 1e-3], "damping": 2e-3, **s} for name, s in table["sections"].items()}
    driven = {
        kind: {name: {**record, "history": "on"} for name, record in table[kind].items()}
        for kind in ("loads", "motions")
        if kind in table
    }
    analysis = {"type": "dynamic", "end": end, "accuracy": ACCURACY, "output": end / 8, **keys}
    return {**table, **driven, "sections": sections, "histories": {"on": RAMP}, "analysis": analysis}


def followers():
    """A strip in space with a force that follows and a moment about a fixed axis: neither has a potential."""
    table = scenes.cantilever((0.0, 1.0, 0.5), dimension="space")
    table["loads"]["tip"]["frame"] = "follower"
    table["loads"]["turn"] = {"type": "moment", "node": "B", "value": [0.3, 0.2, 0.0]}
    return table


def sprung():
    """A strip on a hinge with rotational and translational springs and dampers."""
    table = scenes.cantilever((1.0, 1.0))
    table["nodes"]["A"]["support"] = "hinge"
    table["springs"] = {
        "foot": {"node": "A", "stiffness": 2.0, "rest": 0.2, "damping": 0.3},
        "pull": {"type": "translational", "node": "B", "anchor": [1.2, 0.5], "stiffness": 3.0, "damping": 0.5},
    }
    return table


SCENES = {
    "plane": scenes.plane_loads,
    "loop": scenes.arch,
    "guided and driven": scenes.guided,
    "hinge in a loop": scenes.four_bar,
    "springs": sprung,
    "space": scenes.bend_45,
    "driven in space": scenes.tripod,
    "hinges in space": scenes.hinged_space,
    "followers": followers,
}


@pytest.mark.parametrize("name", ["plane", "loop", "hinge in a loop", "springs", "space", "followers"])
def test_same_motion_as_radau(name):
    table = dynamic(SCENES[name]())
    one, other = (
        sfetcas.solve(Scene.from_dict({**table, "analysis": {**table["analysis"], "integrator": integrator}}))
        for integrator in ("idas", "radau-3")
    )
    assert one.integrator == "idas"
    for node in table["nodes"]:
        # Both are off by the accuracy, of a size of about one, at most.
        assert one.positions(node) == pytest.approx(other.positions(node), abs=2 * ACCURACY)
        # Steps of the other are about 1/50 s long, and its velocities slopes of positions that are off by the accuracy.
        assert one.velocities(node) == pytest.approx(other.velocities(node), abs=50 * ACCURACY)
    along = [
        [m.steps[i].fields.positions(name, np.array([0.4])) for i in (0, -1)]
        for m in (one, other)
        for name in table["members"]
    ]
    half = len(along) // 2
    for (_, end), (_, reference) in zip(along[:half], along[half:], strict=True):
        assert end == pytest.approx(reference, abs=2 * ACCURACY)
    assert max(np.abs(end - begin).max() for begin, end in along) > 50 * ACCURACY


# -- the equations ------------------------------------------------------------------------------------------


def any_state(table, seed=0):
    """The equations of a scene with a factor at each power of time, and a state of them far from rest."""
    model = assemble(
        Scene.from_dict(table), replace(uniform_mesh(Scene.from_dict(table), 3, 2), places=True), assembly="nodal"
    )
    equations = Equations(model)
    one = IndexOne(StageEquations(equations, masses_of(model)), 2)
    rng = np.random.default_rng(seed)
    factors = rng.uniform(-1, 1, (3, one.system.layout.factors))
    loading = one.system.loading(factors[0])
    state = State(
        model.prescribed_rotations(loading.turn),
        rng.uniform(-0.1, 0.1, one.states[1]),
        np.zeros(equations.rows),
        np.zeros(0),
    )
    state = replace(state, unwrapped=np.zeros(model.unwrapping.count))
    step = np.concatenate([rng.uniform(-0.5, 0.5, equations.unknowns), rng.uniform(-1, 1, equations.rows)])
    state = equations.moved(state, step)
    w, a = rng.uniform(-1, 1, (2, equations.unknowns))
    return one, equations, state, w, a, factors


def along(one, equations, state, w, a, factors, t):
    """State and factors at a time on the curve of these rates and accelerations; second order of rotations in t."""
    there = equations.moved(state, np.concatenate([t * w + 0.5 * t**2 * a, np.zeros(equations.rows)]))
    now = factors[0] + t * factors[1] + 0.5 * t**2 * factors[2]
    return equations.holding(there, one.system.loading(now)), now


def residual(one, state, w, a, factors):
    q = state.q[one.turning].ravel()
    given = (q, state.y, w, state.unwrapped, a, state.lam, *factors)
    return np.array(one.balance(*given)).ravel()


@pytest.mark.parametrize("name", ["guided and driven", "springs", "driven in space", "hinges in space", "followers"])
def test_balance_is_that_of_statics_with_inertia_as_loads(name):
    one, equations, state, w, a, factors = any_state(dynamic(SCENES[name]()))
    h, n, system = 1e-4, equations.unknowns, one.system
    x, gaps = [], []
    for t in h * np.arange(-2, 3):
        there, now = along(one, equations, state, w, a, factors, t)
        x.append(system.rates(there, now, np.zeros(n))[0])
        gaps.append(equations.at(there, system.loading(now)).residual[n:])
    first, second = np.array([1, -8, 0, 8, -1]) / (12 * h), np.array([-1, 16, -30, 16, -1]) / (12 * h**2)
    # Rotations on the curve are exact to the second order in t: central differences see that only.
    rates, changes = first @ np.array(x), second @ np.array(x)
    effective = equations.effective(state, system.loading(factors[0]))
    loaded = Inertia(system).loading(equations, state, effective, rates, changes)
    expected = np.concatenate([equations.at(state, loaded).residual[:n], second @ np.array(gaps)])
    # Second differences of rounding, 1e-16 / 1e-8, and their error of the fourth order.
    assert residual(one, state, w, a, factors) == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["guided and driven", "springs", "driven in space", "hinges in space", "followers"])
def test_matrix_is_the_derivative_but_for_centripetal_shares(name):
    one, equations, state, w, a, factors = any_state(dynamic(SCENES[name]()))
    n, rest = equations.unknowns, 0.0 * factors
    rest[0] = factors[0]
    given = (state.q[one.turning].ravel(), state.y, 0.0 * w, state.unwrapped, 0.0 * a, state.lam, *rest)
    symbols = [ca.MX.sym(f"s{i}", len(part)) for i, part in enumerate(given)]
    found = {}
    for i, key in ((0, "q"), (1, "y"), (2, "w"), (4, "a"), (5, "lam")):
        jacobian = ca.jacobian(one.balance(*symbols), symbols[i])
        found[key] = np.array(ca.Function("jacobian", symbols, [jacobian])(*given))

    def differences(function, size, h):
        columns = [(function(h * e) - function(-h * e)) / (2.0 * h) for e in np.eye(size)]
        return np.array(columns).reshape(size, -1).T

    by_a = differences(lambda e: residual(one, state, 0.0 * w, e, rest), n, 1.0)
    by_lam = differences(
        lambda e: residual(one, replace(state, lam=state.lam + e), 0.0 * w, 0.0 * a, rest), equations.rows, 1.0
    )
    by_w = differences(lambda e: residual(one, state, e, 0.0 * a, rest), n, 1.0)
    # Linear in these: differences of any length are exact.
    assert found["a"] == pytest.approx(by_a, abs=1e-12 * np.abs(by_a).max())
    assert found["lam"] == pytest.approx(by_lam, abs=1e-12 * np.abs(by_lam).max())
    # Squares of w drop out of central differences.
    assert found["w"] == pytest.approx(by_w, abs=1e-11 * max(1.0, np.abs(by_w).max()))

    def turned(e):
        there = equations.moved(state, np.concatenate([e, np.zeros(equations.rows)]))
        return residual(one, there, 0.0 * w, 0.0 * a, rest)[:n], there

    h = 1e-5
    by_place = differences(lambda e: turned(e)[0], n, h)
    q_by_place = differences(lambda e: turned(e)[1].q[one.turning].ravel(), n, h)
    y_by_place = differences(lambda e: turned(e)[1].y, n, h)
    both = found["q"][:n] @ q_by_place + found["y"][:n] @ y_by_place
    # Moments out of balance, which there are none of at a solution, count by half of what they turn by.
    left = residual(one, state, 0.0 * w, 0.0 * a, rest)
    for numbers in equations.number[equations.number.min(axis=1) >= 0] if equations.model.space else ():
        x, y, z = 0.5 * left[numbers]
        by_place[np.ix_(numbers, numbers)] += np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # Central differences of 1e-5: 1e-10 and rounding over 1e-5.
    assert both == pytest.approx(by_place, abs=1e-8 * np.abs(by_place).max())


def test_driven_rotations_have_their_centripetal_acceleration_where_their_angle_is_zero():
    table = dynamic(scenes.bend_45())
    table["motions"] = {"turn": {"node": "A", "rotation": [0.0, 0.0, 1.0], "history": "on"}}
    one = any_state(table)[0]
    model = one.system.model
    rest = model.prescribed_rotations(model.loading(0.0, 0.0).turn)[one.turning].ravel()
    groups = list(one.system.model.groups)
    rate = np.array([2.0 if name == "on" else 0.0 for name in groups])
    zero = np.zeros(len(groups))
    place = np.concatenate([rest, np.zeros(one.states[1]), zero])
    rates = np.concatenate([np.zeros(len(place) - len(groups)), rate])
    seen = [np.array(part).ravel() for part in one._seen(place, rates, 0.0 * place, np.zeros(one.states[3]))]
    axes = one.system.ranges[0]
    # The section axes of the node itself: three vectors of which two turn about z with 2 rad/s.
    first = one.system.masses.observables[0].turns[:, 0].tolist().index(model.rotations.node_turn["A"])
    d, second = (part[axes[0] + 9 * first : axes[0] + 9 * first + 9].reshape(3, 3) for part in (seen[0], seen[2]))
    assert second == pytest.approx(-4.0 * d * [1, 1, 0], abs=1e-12)
    assert np.abs(d[:, :2]).max() > 0.5


def test_histories_are_exact_polynomials_between_their_times():
    history = History(t=(0.0, 1.0, 3.0), polynomial=((0.0, 1.0, -2.0, 5.0), (4.0, 1.0)))
    for begin, end in ((0.25, 0.75), (1.0, 3.0), (2.0, 2.5), (3.0, 4.0), (-2.0, 0.0)):
        terms = history.between(begin, end)
        for s in (0.0, 0.3, 0.999):
            value = sum(c * s**k for k, c in enumerate(terms))
            # Rounding of numbers up to ten.
            assert value == pytest.approx(history.factor(begin + s * (end - begin)), abs=1e-14)


# -- motions that are known -----------------------------------------------------------------------------------


def double_pendulum(**keys):
    bar = {"rhoA": 1.3}
    analysis = {"type": "dynamic", "end": 2.0, "integrator": "idas", "output": 0.25, **keys}
    return {
        "sections": {"bar": bar},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [1, 0], "joint": "hinge"},
            "C": {"position": [1.7, 0], "mass": 0.4},
        },
        "members": {
            "upper": {"type": "rigid", "nodes": ["A", "B"], "section": "bar"},
            "lower": {"type": "rigid", "nodes": ["B", "C"], "section": "bar"},
        },
        "gravity": [0, -9.81],
        "analysis": analysis,
    }


def pendulum_tip(times):
    """Of the double pendulum by Lagrange's equations for its two angles, by a Runge-Kutta method of order 4."""
    l1, l2, m1, m2, m3, g = 1.0, 0.7, 1.3, 1.3 * 0.7, 0.4, 9.81
    a, b = l1**2 * (m1 / 3 + m2 + m3), l2**2 * (m2 / 3 + m3)
    c, p, r = l1 * l2 * (0.5 * m2 + m3), g * l1 * (0.5 * m1 + m2 + m3), g * l2 * (0.5 * m2 + m3)

    def rate(s):
        x, y, u, v = s
        k = c * np.cos(x - y)
        right = [-c * np.sin(x - y) * v**2 - p * np.cos(x), c * np.sin(x - y) * u**2 - r * np.cos(y)]
        det = a * b - k**2
        return np.array([u, v, (b * right[0] - k * right[1]) / det, (a * right[1] - k * right[0]) / det])

    state, found = np.zeros(4), []
    for begin, end in itertools.pairwise(times):
        h = (end - begin) / 800
        for _ in range(800):
            one = rate(state)
            two = rate(state + 0.5 * h * one)
            three = rate(state + 0.5 * h * two)
            state = state + h / 6 * (one + 2 * two + 2 * three + rate(state + h * three))
        x, y = state[:2]
        found.append([l1 * np.cos(x) + l2 * np.cos(y), l1 * np.sin(x) + l2 * np.sin(y), 0.0])
    return np.array(found)


def test_double_pendulum_of_rigid_members():
    motion = sfetcas.solve(Scene.from_dict(double_pendulum(accuracy=1e-7)))
    # The accuracy, of a size of 1.7; the Runge-Kutta method is off by 1e-10.
    assert motion.positions("C")[1:] == pytest.approx(pendulum_tip(motion.times), abs=2e-7)
    energy = motion.energies()
    # Its energies are some 30 N m: errors of 1e-7 in places and of as much over a tenth of a second in velocities.
    assert np.abs(energy - energy[0]).max() < 1e-5
    assert np.abs(motion.energies("kinetic")).max() > 10.0


def test_energy_of_a_strip_that_is_let_go():
    table = cantilever(FLAT, (1.0, 2.0))
    del table["loads"]["tip"]["history"]
    motion = moved(table, 1.0, integrator="idas", initial="equilibrium", cut=["tip"], accuracy=1e-5, output=0.1)
    total = motion.energies()
    # Errors of 1e-5 in places where the strip pushes back with some 10.
    assert np.abs(total - total[0]).max() < 1e-4
    assert motion.energies("elastic").min() < 0.5 * total[0]


def test_angles_count_turns_between_answers():
    """A bar on a spring turns five times between two answers: a harmonic motion."""
    table = {
        "dimension": "space",
        "sections": {"bar": {"rhoA": 3.0, "rhoI": [0.1, 0.0, 0.0]}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "hinge", "axis": [0, 0, 1]}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"type": "rigid", "nodes": ["A", "B"], "section": "bar", "spin": [0, 0, 40.0]}},
        "springs": {"s": {"node": "A", "stiffness": 0.5}},
    }
    motion = moved(table, 3.0, integrator="idas", output=1.0, accuracy=1e-6)
    # A moment of inertia of one.
    frequency = np.sqrt(0.5)
    angles = [step.spring("s").travel for step in motion.steps]
    # An angle of 1e-6 at the tip.
    assert angles == pytest.approx(40.0 / frequency * np.sin(frequency * motion.times), abs=2e-6)
    assert max(angles) > 16 * np.pi


def test_loads_that_jump_between_answers():
    table = cantilever(changed(FLAT, damping=0.01), histories={"on": {"t": [0, 0.333, 2], "polynomial": [[0], [1]]}})
    one, other = (
        moved(table, 1.0, integrator=name, output=0.25, accuracy=1e-5).positions("B") for name in ("idas", "radau-3")
    )
    # Both are off by the accuracy at most.
    assert one == pytest.approx(other, abs=2e-5)
    assert np.abs(one[-1] - one[0]).max() > 0.1


# -- projection -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["hinges in space", "driven in space", "hinge in a loop"])
def test_answers_are_closed_and_drift_is_told(name):
    motion = sfetcas.solve(Scene.from_dict(dynamic(SCENES[name](), integrator="idas")))
    for step in motion.steps:
        equations = step.mover.equations
        gaps = equations.at(step.state, step.loading).residual[equations.unknowns :]
        assert np.abs(gaps).max() < 1e-12
        if motion.last.model.space:
            assert np.einsum("ij,ij->i", step.state.q, step.state.q) == pytest.approx(1.0, abs=1e-14)
    # What was missing before: of the size of the tolerance, some 1e-7 to 1e-6.
    assert 1e-9 < motion.violation["closings"] < 1e-4
    assert (1e-9 if motion.last.model.space else -1.0) < motion.violation["norms"] < 1e-4


def test_velocities_are_those_that_joints_allow():
    motion = sfetcas.solve(Scene.from_dict(double_pendulum(accuracy=1e-3)))
    upper = motion.positions("B")
    lower, rate = motion.positions("C") - upper, motion.velocities("C") - motion.velocities("B")
    # Rigid bars turn: rounding of velocities of some 10 m/s.
    assert np.einsum("ij,ij->i", upper, motion.velocities("B")) == pytest.approx(0.0, abs=1e-12)
    assert np.einsum("ij,ij->i", lower, rate) == pytest.approx(0.0, abs=1e-12)
    assert np.abs(rate).max() > 1.0


def test_the_smallest_change_closes():
    one, equations, state, _, _, factors = any_state(dynamic(scenes.four_bar()))
    loading, n = one.system.loading(factors[0]), equations.unknowns
    state = replace(state, q=0.01 * state.q, y=0.01 * state.y)
    before = np.abs(equations.at(state, loading).residual[n:]).max()
    there, told = closed(equations, state, loading)
    assert told == before > 1e-3
    assert np.abs(equations.at(there, loading).residual[n:]).max() < 1e-14


# -- what it cannot take ------------------------------------------------------------------------------------


def refusal(table):
    with pytest.raises(SceneError) as caught:
        sfetcas.solve(Scene.from_dict(table))
    return str(caught.value)


def test_rotations_without_inertia():
    table = dynamic(scenes.bend_45(), integrator="idas")
    del table["sections"]["s"]["rhoI"]
    sentence = "analysis.integrator: found 'idas', but without 'rhoI' of the section s some rotations have no inertia, "
    assert refusal(table) == sentence + f"accepted: 'rhoI', or {OTHERS}"
    # In the plane rotations of a clamped strip move the masses within it; those of one on hinges move none of them all.
    table = dynamic(scenes.cantilever(), integrator="idas")
    del table["sections"]["s"]["rhoI"]
    assert sfetcas.solve(Scene.from_dict(table)).status is Status.SOLVED
    table["nodes"] |= {"A": {"position": [0, 0], "support": "hinge"}}
    assert refusal(table) == sentence + f"accepted: 'rhoI', or {OTHERS}"


def test_what_has_no_mass():
    table = double_pendulum()
    table["members"]["lower"]["section"] = None
    table["nodes"]["C"]["mass"] = 0.0
    del table["members"]["lower"]["section"]
    expected = f"found 'idas', but what turns or moves at lower, C has no inertia, accepted: {OTHERS}"
    assert refusal(table) == f"analysis.integrator: {expected}"


def test_closings_that_repeat_each_other():
    """A plane loop of hinges in space: that it stays in its plane is said three times."""
    table = double_pendulum()
    table["dimension"], table["sections"]["bar"]["rhoI"] = "space", [0.1, 0.05, 0.05]
    for name in "AB":
        table["nodes"][name]["axis"] = [0, 0, 1]
    table["nodes"]["C"] |= {"joint": "hinge", "axis": [0, 0, 1]}
    table["nodes"]["D"] = {"position": [1.5, -1], "support": "hinge", "axis": [0, 0, 1]}
    table["members"]["third"] = {"type": "rigid", "nodes": ["C", "D"], "section": "bar"}
    sentence = refusal(table)
    assert "but closings depend on each other (closing of upper, z" in sentence
    assert sentence.endswith("accepted: joints and supports of which none repeats what others hold")


def test_a_condition_ends_it():
    until = {"quantity": "nodes.C.position", "component": 1, "below": -1.0}
    motion = sfetcas.solve(Scene.from_dict(double_pendulum(accuracy=1e-6, until=until)))
    times = np.array([0.0, motion.last.time])
    # The accuracy, at both.
    assert motion.last.position("C") == pytest.approx(pendulum_tip(times)[0], abs=4e-6)
    assert motion.last.position("C")[1] == pytest.approx(-1.0, abs=4e-6)
    assert 0.0 < motion.last.time < 2.0


def test_steps_are_its_own():
    sentence = "analysis.step: found 0.1 s with 'idas', which chooses its steps itself, accepted: without 'step', or "
    assert refusal(double_pendulum(step=0.1)) == sentence + "another integrator"


def test_failure_says_when(monkeypatch):
    monkeypatch.setattr(idas, "STEPS", 40)
    with pytest.raises(SolveError, match=r"IDAS did not get on between [0-9.]+ and [0-9.]+ s: steps became") as caught:
        sfetcas.solve(Scene.from_dict(double_pendulum(accuracy=1e-6, output=0.5)))
    assert caught.value.status is Status.STOPPED
    assert caught.value.reached.last.time < 2.0


# -- interrupts -------------------------------------------------------------------------------------------------


def test_what_was_computed_is_kept():
    def interrupt(t):
        if t > 1.0:
            raise KeyboardInterrupt

    scene = Scene.from_dict(double_pendulum(accuracy=1e-2))
    motion = simulate(scene, Settings(), progress=interrupt)
    assert motion.status is Status.INTERRUPTED
    assert motion.times == pytest.approx(np.arange(0.0, 1.26, 0.25))


def test_interrupts_that_casadi_swallows_are_seen():
    # Whatever runs the tests may have been started with interrupts ignored.
    original = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        _check_interrupts()
    finally:
        signal.signal(signal.SIGINT, original)


def _check_interrupts():
    before = signal.getsignal(signal.SIGINT)
    with noted(forward=True) as seen:
        assert seen == []
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert seen == [signal.SIGINT]
    assert signal.getsignal(signal.SIGINT) is before
