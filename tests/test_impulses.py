"""Steps with impulses as C: against the same scheme in process, which finds what pushes in another way."""

import re
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from scenes import made
from test_codegen import built, needs_compiler, said
from test_contact_motion import FLOOR, G, ball, rod
from test_slack_motion import bob, string
from test_stepping import on_a_light_body

from sfetcas import SceneError, export, solve
from sfetcas.codegen.timestep import time_step
from sfetcas.dynamics.impulses import PushingRows
from sfetcas.dynamics.stepping import by_rows
from sfetcas.mathematics.complementarity import by_pivots

FAST = ["-O0", "-ffp-contract=off"]
"""Flags with which a compiler takes least time."""

BOWL = {"type": "circle", "center": [0, 0], "radius": 1.0, "side": "inside", "members": "all"}
LOG = {"type": "circle", "center": [0.3, 0.15], "radius": 0.3, "members": "all", "restitution": 0.5}


def stepped(table, step, end, **more):
    """The scene of a table in steps with impulses."""
    analysis = {**table["analysis"], "type": "dynamic", "step": step, "end": end, "output": end}
    return made({**table, "analysis": {**analysis, "integrator": "stepping", **more}})


def followed(scene, course=None, **more):
    """What the steps of a scene lead to, by name; the ``course`` of arguments is a function of the time."""
    step = time_step(scene, "motion", **more)
    h, state = scene.analysis.step, step.begin
    for k in range(round(scene.analysis.duration / h)):
        given = None if course is None else [course((k + share) * h) for share in step.times]
        state = step.step(state, h, given)
        given = None if given is None else given[-1]
        assert np.isfinite(state).all(), k
    found, first = {}, 0
    for result in step.results.results:
        found[result.name] = step.outputs(state, given)[first : first + result.size]
        first += result.size
    return found


def wedged():
    """A rigid rod that falls between a floor and a log, and has more places on both than it can rest on."""
    return {**rod(-0.54, 1.0, {}), "contacts": {"floor": {**FLOOR, "restitution": 0.5}, "log": LOG}}


def on_hinge(restitution):
    """A ball that falls on a rod on a hinge, which carries a plane."""
    stop = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": ["bar"], "node": "H"}
    table = ball({**stop, "restitution": restitution}, [0.3, 0.2], {})
    table["nodes"] |= {"H": {"position": [0, 0], "support": "hinge"}}
    table["nodes"] |= {"E": {"position": [-0.5, 0], "mass": 1.0, "inertia": [0.1, 0.1, 0.1]}}
    table["members"]["plate"] = {"nodes": ["H", "E"], "type": "rigid"}
    return table


def slanting():
    """A soft rod that falls on a slanting floor in space."""
    table = rod(0.3, 0.02, {}, kind="flexible", restitution=0.7)
    table["sections"]["s"]["rhoI"] = [1e-3, 5e-4, 5e-4]
    table["contacts"]["floor"]["normal"] = [0, 1, 0.3]
    return {**table, "dimension": "space"}


SCENES = {
    "a ball rebounds": (ball({**FLOOR, "restitution": 0.5}, [0, 1], {}), 0.01, 0.7),
    "thrown": (ball({**FLOOR, "restitution": 0.5}, [0, 0.3], {}, velocity=[1.0, -2.0]), 0.01, 0.4),
    "a rod falls flat": (rod(0.0, 0.2, {}), 0.005, 0.3),
    "a rod rebounds end by end": (rod(0.6, 0.45, {}, restitution=0.7), 0.005, 1.0),
    "a soft rod": (rod(0.3, 0.2, {}, kind="flexible"), 0.002, 0.3),
    "in space": (slanting(), 0.002, 0.1),
    "energy that would grow": (rod(0.6, 0.2, {}, restitution=1.0), 0.01, 0.8),
    "in a bowl": (ball(BOWL, [-0.8, -0.6], {}, out=(0.8, 0.6)), 0.01, 0.5),
    "wedged": (wedged(), 0.004, 0.5),
    "on a hinge": (on_hinge(0.0), 0.005, 0.4),
    "rebounds on a hinge": (on_hinge(0.6), 0.005, 0.4),
}  # fmt: skip


@pytest.mark.parametrize("name", list(SCENES))
def test_steps_are_those_of_the_search(name, monkeypatch):
    """The scheme is the same; what pushes is found by linear complementarity there, by changing sides here."""
    table, step, end = SCENES[name]
    scene = stepped(table, step, end)
    found, rows = followed(scene), solve(scene)
    monkeypatch.setattr("sfetcas.dynamics.simulation.by_rows", lambda scene: False)
    searched = solve(scene)
    # Both end Newton's method at 1e-8 in each of some hundred steps, whose errors impacts make larger.
    for node in scene.nodes:
        for there in (found[f"nodes.{node}.position"], rows.last.position(node)):
            np.testing.assert_allclose(there, searched.last.position(node), atol=1e-7)
    if not by_rows(scene):
        return
    told, known = ([(one.name, one.where, one.acts) for one in motion.events] for motion in (rows, searched))
    assert told == known
    lost = [motion.last.energy["dissipated"] for motion in (rows, searched)]
    assert lost[0] == pytest.approx(lost[1], abs=1e-6)
    forces = [next(iter(motion.last.contacts.values()))["force"] for motion in (rows, searched)]
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-5)


STOPPED = {
    "a string": (bob({"t": string(length=1.0)}, [0.6, 0.0], {}), 0.6),
    "two strings": (bob({"t": string(length=1.0), "u": string((0.5, 0.2), length=0.8)}, [0.6, 0.0], {}), 0.5),
    "a stop": (
        {
            **rod(0.0, 0.0, {}),
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
            "springs": {"k": {"node": "A", "stiffness": 0.5, "stop": [-0.6, 0.3]}},
            "contacts": {},
        },
        0.6,
    ),
    "a string and a floor": (
        {
            **bob({"t": string(length=1.0)}, [0.6, 0.0], {}),
            "contacts": {"f": {**FLOOR, "point": [0, -0.9], "restitution": 0.4}},
        },
        0.6,
    ),
}


@pytest.mark.parametrize("name", list(STOPPED))
def test_strings_and_stops_come_nearer_to_what_is_found_event_by_event(name):
    """Where they act is somewhere in a step: errors fall as the step does, or faster; in C the steps are the same."""
    table, end = STOPPED[name]
    nodes = list(table["nodes"])
    exact = solve(made({**table, "analysis": {"type": "dynamic", "end": end, "output": end, "accuracy": 1e-8}})).last
    missed = []
    for step in (0.01, 0.0025):
        scene = stepped(table, step, end)
        motion = solve(scene)
        missed.append(max(np.abs(motion.last.position(node) - exact.position(node)).max() for node in nodes))
        assert motion.last.energy["dissipated"] > 0.1
    # Where nothing is left but the state at rest there is no error.
    assert missed[1] < max(0.6 * missed[0], 1e-10)
    assert missed[1] < 0.01
    found = followed(scene)
    for node in nodes:
        np.testing.assert_allclose(found[f"nodes.{node}.position"], motion.last.position(node), atol=1e-9)


def test_what_strings_take_is_dissipated():
    """Energy and what is told as dissipated are the same in all steps; the string is told to act from where it does."""
    table, end = STOPPED["a string"]
    motion = solve(stepped(table, 0.01, end, output=0.05))
    totals = [step.energy["total"] + step.energy["dissipated"] for step in motion.steps]
    np.testing.assert_allclose(totals, totals[0], atol=1e-10)
    (event,) = motion.events
    assert (event.name, event.side, event.acts) == ("tendons.t", "taut", True)
    assert 0.0 <= event.time - np.sqrt(2 * 0.8 / G) <= 0.01 + 1e-9
    assert motion.last.tendon("t")["slack"] is False


@pytest.mark.parametrize("step", [0.007, 0.008])
def test_all_of_the_speed_is_kept_beside_light_bodies(step):
    found = followed(stepped(on_a_light_body(0.01), step, 0.28))
    assert found["nodes.P.velocity"][1] - found["nodes.B.velocity"][1] == pytest.approx(-3.0, rel=1e-6)


def test_strings_beside_friction_are_refused():
    table, end = STOPPED["a string and a floor"]
    table = {**table, "contacts": {"f": {**FLOOR, "point": [0, -0.9], "friction": 0.4}}}
    with pytest.raises(
        SceneError, match=r"tendons\.t: found beside contacts\.f with the integrator 'stepping', which does"
    ):
        stepped(table, 0.01, end)


def test_a_floor_that_a_motion_raises():
    """Arguments say in each step where it is; what rests on it goes with it."""
    table = rod(0.2, 0.1, {})
    table["nodes"]["F"] = {"position": [0.3, 0], "support": "clamped"}
    table["contacts"]["floor"]["node"] = "F"
    table["motions"] = {"up": {"node": "F", "displacement": [0, 1], "history": "h"}}
    table["histories"] = {"h": {"t": [0, 0.2, 0.4, 0.6], "value": [0, 0, 0.02, 0.1], "interpolation": "spline"}}
    scene = stepped(table, 0.005, 0.5)
    history = scene.histories["h"]
    found = followed(scene, lambda t: [history.factor(t)], arguments=["histories.h"])
    last = solve(scene).last
    assert last.position("A")[1] > 0.05
    for node in "AB":
        np.testing.assert_allclose(found[f"nodes.{node}.position"], last.position(node), atol=1e-9)
        # The rate of the motion is that of the second half of a step: a quarter of a step before.
        assert found[f"nodes.{node}.velocity"][1] == pytest.approx(history.rate(0.5 - 0.005 / 4), rel=1e-3)


def test_numbers_of_an_obstacle_are_arguments():
    """A floor that is 0.2 m higher than that of the scene."""
    scene = stepped(ball(FLOOR, [0, 1], {}), 0.01, 0.8)
    found = followed(scene, lambda t: [0.2], arguments=["contacts.stop.point.1"])
    assert found["nodes.B.position"][1] == pytest.approx(0.2, abs=1e-10)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_what_rests_is_told_with_its_force(dimension):
    """The mean force of a step: that of an impact once more, then the weight."""
    scene = stepped({**ball(FLOOR, [0, 1], {}), "dimension": dimension}, 0.01, 0.8)
    np.testing.assert_allclose(followed(scene)["contacts.stop.force"], [0.0, 2.0 * G, 0.0], atol=1e-8)
    step = time_step(scene, "motion", results=["contacts.stop.force"])
    state, total = step.begin, 0.0
    for _ in range(80):
        state = step.step(state, 0.01)
        total += 0.01 * step.outputs(state)[1]
    # It has no momentum at the end.
    assert total == pytest.approx(2.0 * G * 0.8, rel=1e-8)


def test_energy_never_grows():
    """Of a rod that rebounds from floor and log; by the momenta between steps."""
    scene = stepped(wedged(), 0.004, 0.6)
    names = [f"nodes.{node}.{key}" for node in "AB" for key in ("position", "velocity")]
    step = time_step(scene, "motion", results=names)
    state, energies = step.begin, []
    for _ in range(150):
        state = step.step(state, 0.004)
        a, u, b, v = step.outputs(state).reshape(4, 3)
        energies.append(0.5 * np.dot(u + v, u + v) / 4.0 + np.dot(u - v, u - v) / 24.0 + 0.5 * G * (a[1] + b[1]))
    # Beside that of a thin rod it has SLENDER's inertia about its axis, which does not turn in the plane.
    assert np.diff(energies).max() < 1e-9
    assert energies[0] - energies[-1] > 1.0


def test_tendons_that_stretch_may_be_beside_obstacles():
    """What pulls at once is asked for before the first step."""
    table = rod(0.1, 0.02, {}, kind="flexible")
    table["nodes"]["A"] |= {"position": [0, 0.05], "support": "clamped"}
    table["tendons"] = {"t": {"way": [{"ground": [0, 1]}, {"node": "B"}], "length": 1.41, "stiffness": 100.0}}
    scene = stepped(table, 0.005, 0.2)
    np.testing.assert_allclose(followed(scene)["nodes.B.position"], solve(scene).last.position("B"), atol=1e-9)


def test_ranges_and_radii_of_arguments_are_kept():
    scene = stepped(ball({**LOG, "friction": 0.0}, [0.3, 1.0], {}), 0.01, 0.1)
    made_with = time_step(scene, "motion", arguments={"contacts.stop.radius": (0.2, 0.4)})
    assert np.isfinite(made_with.step(made_with.begin, 0.01, [0.4])).all()
    assert np.isnan(made_with.step(made_with.begin, 0.01, [0.41])).all()
    free = time_step(scene, "motion", arguments=["contacts.stop.radius"])
    assert np.isfinite(free.step(free.begin, 0.01, [0.41])).all()
    assert np.isnan(free.step(free.begin, 0.01, [0.0])).all()
    with pytest.raises(SceneError, match="found what impacts have of the scene, accepted: another number"):
        time_step(scene, "motion", arguments=["contacts.stop.restitution"])


@needs_compiler
def test_c_takes_these_steps(tmp_path):
    """To the last bit, with impacts and rest among the first steps."""
    table = rod(0.1, 0.02, {}, kind="flexible", restitution=0.3)
    ranges = {"gravity.1": (-10.5, -9.5)}
    made = export(stepped(table, 0.01, 0.3), tmp_path / "c", name="motion", arguments=ranges)
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion", flags=FAST))
    text = "import motion\nm = motion.Motion()\nfor _ in range(30): print(*m.step(0.01)['contacts.floor.force'])"
    subprocess.run(
        ["make", "libmotion.so", f"CFLAGS={' '.join(FAST)}"], cwd=tmp_path / "c", check=True, capture_output=True
    )
    run = subprocess.run([sys.executable, "-c", text], cwd=tmp_path / "c", capture_output=True, text=True, check=True)
    state, forces, every = made.begin, [], made.results.results
    first = sum(one.size for one in every[: [one.name for one in every].index("contacts.floor.force")])
    for _ in range(30):
        state = made.step(state, 0.01)
        forces.append(made.outputs(state)[first : first + 3].tolist())
    assert [[float(x) for x in line.split()] for line in run.stdout.splitlines()] == forces
    assert np.max(forces) > 2.0 * G
    text = "import motion\nm = motion.Motion()\nprint(m.step(0.01, {'gravity.1': -11.0})['message'])"
    run = subprocess.run([sys.executable, "-c", text], cwd=tmp_path / "c", capture_output=True, text=True, check=True)
    assert "an argument outside of its range" in run.stdout


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"integrator": "radau-3"}, "analysis.integrator: found 'radau-3' with contact, accepted for C: stepping"),
        ({"integrator": None}, "analysis.integrator: found 'radau-3' with contact, accepted for C: stepping"),
        ({"friction": 0.3}, "contacts.stop.friction: what sticks and slides depends on the steps before, and is not"),
        ({"integrator": "radau-3", "stop": True}, "found 'radau-3' with stops, or tendons that may be slack, accepted"),
        ({"type": "members"}, "contacts.stop: where members are near to each other is found by a search"),
    ],
)
def test_what_is_not_exported(more, sentence, tmp_path):
    integrator = more.pop("integrator", "stepping")
    stopped = more.pop("stop", False)
    table = STOPPED["a stop"][0] if stopped else ball({**FLOOR, **more}, [0, 1], {})
    if "type" in more:
        table["contacts"]["stop"] = {"type": "members", "members": "all", "radius": 0.01}
        table["nodes"] |= {"D": {"position": [1, 1], "mass": 1.0}, "E": {"position": [1, 2]}}
        table["members"]["other"] = {"nodes": ["D", "E"], "type": "rigid"}
    with pytest.raises(SceneError, match=re.escape(sentence)):
        export(stepped(table, 0.01, 0.1, integrator=integrator), tmp_path / "c")


@pytest.mark.parametrize("change", ["none", "clamped", "bent", "joined", "hinged"])
def test_what_nothing_keeps_from_spinning_about_itself_is_refused(change):
    table = rod(0.3, 0.2, {}, kind="flexible")
    table = {**table, "dimension": "space"}
    if change == "clamped":
        table["nodes"]["A"]["support"] = "clamped"
    if change == "bent":
        table["members"]["m"]["shape"] = {"type": "arc", "angle": 0.5}
    if change in ("joined", "hinged"):
        table["nodes"]["C"] = {"position": [0, 1.0]}
        table["members"]["n"] = {**table["members"]["m"], "nodes": ["A", "C"]}
        table["nodes"]["A"] |= {} if change == "joined" else {"joint": "ball"}
    scene = stepped(table, 0.01, 0.1)
    if change in ("none", "hinged"):
        with pytest.raises(SceneError, match=r"members\.m\.section: found one without inertia about its axis, about"):
            time_step(scene, "motion")
    else:
        assert time_step(scene, "motion").method.name == "stepping"


def test_strings_do_not_spin_what_has_no_inertia_about_itself():
    table = {**rod(0.3, 0.2, {}, kind="flexible"), "dimension": "space", "contacts": {}}
    table["tendons"] = {"t": {"way": [{"ground": [0, 1]}, {"node": "A"}], "length": 1.0}}
    with pytest.raises(SceneError, match=r"members\.m\.section: found one without inertia about its axis, about"):
        solve(stepped(table, 0.01, 0.1))


def test_a_step_in_which_something_turns_too_far_is_not_taken():
    table = rod(0.0, 1.0, {})
    for node, speed in (("A", -60), ("B", 60)):
        table["nodes"][node] |= {"velocity": [0, speed]}
    step = time_step(stepped(table, 0.01, 0.1), "motion")
    assert np.isfinite(step.step(step.begin, 0.005)).all()
    assert np.isnan(step.step(step.begin, 0.02)).all()


# -- which rows push ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_one_sided_rows_are_those_of_linear_complementarity(seed):
    """Of masses, and of as many rows as there are unknowns, or three times as many, which follow from each other."""
    random = np.random.default_rng(seed)
    n, rows = 6, 6 if seed % 2 else 18
    mass = random.normal(size=(n, n))
    mass, across = mass @ mass.T + np.eye(n), random.normal(size=(rows, n))
    signs = random.choice([-1.0, 1.0], size=rows)
    right, gaps = 5.0 * random.normal(size=n), np.maximum(random.normal(size=rows), 0.0)
    inverse = np.linalg.inv(mass)
    # Gaps are g + H w of M w = r + H^T f: rows of the equations are -sign H, and forces sign times what stands there.
    forces = by_pivots(across @ inverse @ across.T, gaps + across @ inverse @ right)
    g = -signs[:, None] * across
    matrix = ca.DM(np.block([[mass, g.T], [g, -1e-13 * np.eye(rows)]]))
    symbols = ca.MX.sym("matrix", matrix.sparsity()), ca.MX.sym("right", n + rows)
    solved = PushingRows(list(range(n, n + rows)), signs).solved(*symbols, ca.MX.zeros(rows), ca.MX.ones(rows), 1e-10)
    x, pushing, failed = ca.Function("solved", symbols, solved)(matrix, np.concatenate([right, signs * gaps]))
    assert float(failed) == 0.0
    assert forces is not None
    assert (forces > 0.0).any()
    x = np.array(x).ravel()
    np.testing.assert_allclose(x[:n], inverse @ (right + across.T @ forces), atol=1e-8)
    assert (signs * x[n:] >= -1e-9).all()
    assert set(np.unique(np.array(pushing))) <= {0.0, 1.0}
