"""Tubes with one centre line: closed forms, the pendulum of two tubes, shooting, energies, and every analysis."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.codegen.timestep import time_step
from sfetcas.mechanics import terms
from sfetcas.mechanics.elements import element_by_name
from sfetcas.mechanics.fields import transferred
from sfetcas.mechanics.model import assemble
from sfetcas.mechanics.tubes import TubeAlong, angles_along
from sfetcas.solvers.globalised import Code

E, G = 58e9, 21.5e9
"""Moduli of nickel titanium, Pa."""


def pair(own=2.0, other=3.0, GJ=1e6, analysis=None, dead=None, **tube):
    """A member of bending stiffness 1 N m2, an arc of one metre, in a tube of 2 N m2 on all its length."""
    end = [np.sin(own) / own, (1.0 - np.cos(own)) / own] if own else [1.0, 0.0]
    shape = {"type": "arc", "angle": own} if own else {"type": "straight"}
    return Scene.from_dict(
        {
            "sections": {
                "inner": {"EI2": 1.0, "EI3": 1.0, "GJ": GJ, "rhoA": 1.0, "rhoI": [0.002, 0.001, 0.001]},
                "outer": {"EI2": 2.0, "EI3": 2.0, "GJ": 2.0 * GJ, "rhoA": 0.5},
            },
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": end}},
            "members": {"m": {"nodes": ["A", "B"], "section": "inner", "shape": shape}},
            "tubes": {"t": {"members": "m", "section": "outer", "length": 1.0, "curvature": other, **tube}},
            "loads": {} if dead is None else {"f": {"type": "force", "node": "B", "value": dead}},
            "analysis": analysis or {},
        }
    )


# -- closed forms ------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["ipopt", "newton"])
def test_aligned_tubes_share_the_mean_curvature(solver):
    """Weighted by the stiffnesses; each is bent by the difference from its own, and stores half its square."""
    step = sfetcas.solve(pair(GJ=1.0), solver=solver, accuracy=1e-9).last
    mean = (1.0 * 2.0 + 2.0 * 3.0) / 3.0
    expected = np.array([np.sin(mean), 1.0 - np.cos(mean), 0.0]) / mean
    np.testing.assert_allclose(step.position("B"), expected, atol=1e-9)
    np.testing.assert_allclose(step.along("m", [0.0, 0.3, 1.0])["curvature"], [[0.0, 0.0, mean]] * 3, atol=1e-9)
    assert step.tube("t")["energy"] == pytest.approx(0.5 * 2.0 * (mean - 3.0) ** 2, rel=1e-9)
    table = step.to_dict()
    assert table["members"]["m"]["energy"] == pytest.approx(0.5 * 1.0 * (mean - 2.0) ** 2, rel=1e-9)
    assert table["energy"]["total"] == pytest.approx(0.5 * 2.0 * (mean - 3.0) ** 2 + 0.5 * (mean - 2.0) ** 2)
    assert step.tube("t")["torque"] == pytest.approx(0.0, abs=1e-12)
    assert step.certificate.stable


def test_without_twist_the_curvatures_add_as_vectors():
    """The base is turned from b2 towards b3; 1e-6 is the ratio of bending and torsional stiffness."""
    angle = -2.0
    step = sfetcas.solve(pair(angle=angle), accuracy=1e-8).last
    mean = (np.array([0.0, 2.0]) + 2.0 * 3.0 * np.array([-np.sin(angle), np.cos(angle)])) / 3.0
    np.testing.assert_allclose(step.along("m", 0.5)["curvature"][0, 1:], mean, atol=2e-5)
    # The work of the base: derivative of the energy of both, 1/2 (k1 k2 / (k1 + k2)) |difference|^2, by the angle.
    assert step.tube("t")["torque"] == pytest.approx(2.0 / 3.0 * 2.0 * 3.0 * np.sin(angle), rel=1e-5)


def test_beyond_the_front_end_the_member_is_alone():
    """And before the part that is curved by itself the tube is straight."""
    scene = pair(own=0.0, GJ=1.0, length=0.6, curved_from=0.25)
    step = sfetcas.solve(scene, accuracy=1e-9).last
    bent = step.along("m", [0.1, 0.24, 0.26, 0.59, 0.61, 1.0])["curvature"][:, 2]
    np.testing.assert_allclose(bent, [0, 0, 2, 2, 0, 0], atol=1e-8)
    # Straight, an arc of 0.35 m, and straight again.
    c, s = np.cos(0.7), np.sin(0.7)
    np.testing.assert_allclose(step.position("B"), [0.25 + 0.5 * s + 0.4 * c, 0.5 * (1.0 - c) + 0.4 * s, 0], atol=1e-9)
    cuts = step.model.mesh.cuts["m"]
    np.testing.assert_allclose([min(abs(cuts - 0.25)), min(abs(cuts - 0.6))], 0.0, atol=1e-12)


# -- two equal tubes: a pendulum ---------------------------------------------------------------------


def twins(turn, **analysis):
    """Two equal tubes of curvature 2/m and length 1 m, for which theta'' = c sin(theta) with sqrt(c) = ``turn``."""
    kinds = {"EI2": 1.0, "EI3": 1.0, "GJ": 4.0 / turn**2}
    scene = pair(2.0, 2.0, rotation=2.0 * np.pi)
    return scene.replace({"sections.inner": kinds, "sections.outer": kinds, "analysis": analysis})


def base_angle(end, turn):
    """Angle at the base and its derivative by that at the front end: theta'(1) = 0, theta'' = turn^2 sin(theta)."""

    def rate(s, y):
        return [y[1], turn**2 * np.sin(y[0]), y[3], turn**2 * np.cos(y[0]) * y[2]]

    found = solve_ivp(rate, [0, 1], [end, 0.0, 1.0, 0.0], rtol=1e-11, atol=1e-13).y[:, -1]
    return found[0], found[2]


def test_a_pair_snaps_where_the_pendulum_folds():
    """Beyond L sqrt(c) = pi/2 the base angle has a maximum over the front angle: there they snap."""
    turn = 2.0
    path = sfetcas.solve(twins(turn, type="path", range=[0, 1], accuracy=1e-6).replace({"members.m.elements": 4}))
    end = brentq(lambda b: base_angle(b, turn)[1], 0.1, 3.1)
    fold = base_angle(end, turn)[0]
    assert np.pi < fold < 2.0 * np.pi
    found = [point.factor * 2.0 * np.pi for point in path.limit_points]
    # The mirror image of the first is where it would snap back.
    np.testing.assert_allclose(found, [fold, 2.0 * np.pi - fold], atol=2e-6)
    assert path.limit_points[0].tube("t")["angle"] == pytest.approx(end, abs=1e-3)
    # Between the folds three equilibria, the middle one of them not stable: pi at both ends is one.
    assert [step.certificate.stable for step in path.steps] == [True]


def test_a_pair_that_is_short_does_not_snap():
    """Below L sqrt(c) = pi/2."""
    path = sfetcas.solve(twins(1.5, type="path", range=[0, 1]).replace({"members.m.elements": 2}))
    assert not path.limit_points


def test_statics_follows_the_rotation_and_tells_the_snap():
    """Beyond the fold the stable equilibrium is that after the snap; before it that which the rotation leads to."""
    turn = 2.0
    solution = sfetcas.solve(twins(turn, steps=[0.54, 0.56]), accuracy=1e-7)
    before, after = solution.steps
    assert before.certificate.stable
    assert after.certificate.stable
    assert before.tube("t")["angle"] < np.pi < after.tube("t")["angle"]
    for step in (before, after):
        found = base_angle(step.tube("t")["angle"], turn)[0]
        assert found == pytest.approx(step.factor * 2.0 * np.pi, abs=1e-5)
    assert any("left an unstable equilibrium" in note for note in after.notes)


# -- any tubes: shooting -----------------------------------------------------------------------------


def hollow(outer, inner):
    """Bending and torsional stiffness of a tube of nickel titanium by its diameters, m."""
    second = np.pi * (outer**4 - inner**4) / 64.0
    return {"EI2": E * second, "EI3": E * second, "GJ": G * 2.0 * second}


SECTIONS = {"one": hollow(1.2e-3, 0.9e-3), "two": hollow(1.6e-3, 1.42e-3), "three": hollow(2.39e-3, 2.01e-3)}
STRAIGHT, CURVED, OWN = 0.12, 0.09, 14.0
"""Lengths of the parts of the innermost tube, m, and its curvature, 1/m."""
TUBES = {
    "two": {"section": "two", "start": -0.03, "length": 0.19, "curvature": 9.0, "curved_from": 0.11, "angle": 1.9},
    "three": {"section": "three", "start": -0.06, "length": 0.16, "curvature": 6.0, "curved_from": 0.1, "angle": -0.8},
}


def robot(force=(0.0, 0.0, 0.0), analysis=None, b2=None):
    """A robot of three tubes; the axes of the curved part of the innermost may be turned about the tangent."""
    x = STRAIGHT + np.sin(OWN * CURVED) / OWN
    nodes = {
        "base": {"position": [0, 0, 0], "support": "clamped"},
        "bend": {"position": [STRAIGHT, 0, 0]},
        "tip": {"position": [x, (1.0 - np.cos(OWN * CURVED)) / OWN, 0]},
    }
    arc = {"type": "arc", "angle": OWN * CURVED}
    members = {
        "shaft": {"nodes": ["base", "bend"], "section": "one"},
        "end": {"nodes": ["bend", "tip"], "section": "one", "shape": arc, **({"b2": b2} if b2 else {})},
    }
    return Scene.from_dict(
        {
            "sections": SECTIONS,
            "nodes": nodes,
            "members": members,
            "tubes": {name: {"members": ["shaft", "end"], **tube} for name, tube in TUBES.items()},
            "loads": {"f": {"type": "force", "node": "tip", "value": list(force)}} if any(force) else {},
            "analysis": analysis or {},
        }
    )


def shot(force, slid=(0.0, 0.0), grown=0.0, at=None):
    """Tip, front angles and unknowns of :func:`robot` by the equations of Rucker, Jones and Webster, and shooting.

    The two outer tubes are pushed out by lengths ``slid``, the innermost by ``grown``; also angles and rates at ``at``.
    """
    force, straight = np.asarray(force, dtype=float), STRAIGHT + grown
    tubes = [("one", 0.0, straight + CURVED, straight, OWN, 0.0)]
    for t, more in zip(TUBES.values(), slid, strict=True):
        begin = t["start"] + more
        curved = begin + t["curved_from"]
        tubes.append((t["section"], -begin, begin + t["length"], curved, t["curvature"], t["angle"]))
    ends = sorted({0.0, *(t[2] for t in tubes), *(t[3] for t in tubes)})
    pieces = list(zip(ends, ends[1:], strict=False))

    def rate(s, y, here):
        axes, moment, angles, twists = y[3:12].reshape(3, 3), y[12:15], y[15:18], y[18:21]
        local = axes.T @ moment
        bent, stiff = np.zeros(2), 0.0
        for (name, _, end, curved, own, _), angle in zip(tubes, angles, strict=True):
            if end > here:
                natural = own * (curved < here) * np.array([-np.sin(angle), np.cos(angle)])
                bent, stiff = bent + SECTIONS[name]["EI2"] * natural, stiff + SECTIONS[name]["EI2"]
        across = (local[1:] + bent) / stiff
        others = [i for i in (1, 2) if tubes[i][2] > here]
        first = (local[0] - sum(SECTIONS[tubes[i][0]]["GJ"] * twists[i] for i in others)) / SECTIONS["one"]["GJ"]
        curvature = np.array([first, *across])
        turning, gained = np.zeros(3), np.zeros(3)
        for i in others:
            name, _, _, curved, own, _ = tubes[i]
            c, s_ = np.cos(angles[i]), np.sin(angles[i])
            second = c * across[0] + s_ * across[1]
            turning[i] = twists[i] - first
            # Its own curvature is about its b3: the bending moment about its b2 twists it.
            gained[i] = SECTIONS[name]["EI2"] / SECTIONS[name]["GJ"] * second * own * (curved < here)
        skew = np.array(
            [[0, -curvature[2], curvature[1]], [curvature[2], 0, -curvature[0]], [-curvature[1], curvature[0], 0]]
        )
        tangent = axes[:, 0]
        return np.concatenate([tangent, (axes @ skew).ravel(), -np.cross(tangent, force), turning, gained])

    def march(unknown):
        moment, twists = unknown[:3] * SCALE, np.array([0.0, *unknown[3:]])
        angles = [angle + behind * twist for (_, behind, *_, angle), twist in zip(tubes, twists, strict=True)]
        y = np.concatenate([np.zeros(3), np.eye(3).ravel(), moment, angles, twists])
        fronts = {}
        for a, b in pieces:
            if at is not None and a <= at <= b:
                fronts["at"] = solve_ivp(rate, (a, at), y, args=(0.5 * (a + b),), rtol=1e-10, atol=1e-12).y[15:21, -1]
            y = solve_ivp(rate, (a, b), y, args=(0.5 * (a + b),), rtol=1e-10, atol=1e-12).y[:, -1]
            fronts |= {i: (y[15 + i], y[18 + i]) for i in (1, 2) if tubes[i][2] == b}
        return y, fronts

    def missed(unknown):
        y, fronts = march(unknown)
        return np.array([*(y[12:15] / SCALE), fronts[1][1], fronts[2][1]])

    guess = np.concatenate([np.cross([0.18, 0.0, 0.0], force) / SCALE, [0.0, 0.0]])
    found = root(missed, guess, tol=1e-11)
    assert np.abs(missed(found.x)).max() < 1e-8
    y, fronts = march(found.x)
    return y[:3], [fronts[1][0], fronts[2][0]], found.x if at is None else fronts["at"]


SCALE = 0.01
"""Unit of moments, N m."""


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), (0.0, 0.1, -0.25)])
def test_three_tubes_by_shooting(force):
    """Fewer tubes from section to section, parts behind the base, a dead force at the tip."""
    step = sfetcas.solve(robot(force), accuracy=1e-8).last
    tip, fronts, base = shot(force)
    np.testing.assert_allclose(step.position("tip"), tip, atol=1e-8)
    np.testing.assert_allclose([step.tube(name)["angle"] for name in TUBES], fronts, atol=1e-6)
    torques = [SECTIONS[name]["GJ"] * twist for name, twist in zip(TUBES, base[3:], strict=True)]
    np.testing.assert_allclose([step.tube(name)["torque"] for name in TUBES], -np.array(torques), rtol=1e-5)
    np.testing.assert_allclose(step.along("shaft", 0.0)["moment"][0], base[:3] * SCALE, atol=1e-7)
    assert step.certificate.stable


def test_members_one_after_the_other_may_have_different_axes():
    """The angle of a tube goes on along its members, whatever their axes b2."""
    turned = robot(b2=[0.0, 0.6, 0.8])
    steps = [sfetcas.solve(scene, accuracy=1e-7).last for scene in (robot(), turned)]
    np.testing.assert_allclose(steps[0].position("tip"), steps[1].position("tip"), atol=1e-8)
    for name in TUBES:
        assert steps[0].tube(name) == pytest.approx(steps[1].tube(name), abs=1e-7)


# -- identities --------------------------------------------------------------------------------------


@pytest.mark.parametrize("gauss", [False, True])
def test_derivatives_of_points_are_those_of_the_energy(gauss):
    """Put together from points, in both charts, as from the whole expression."""
    kind = TubeAlong(True, element_by_name("SFET3", True, gauss))
    rng = np.random.default_rng(1)
    given = [rng.normal(size=terms.rotation_gradient(kind).size_in(i)) for i in range(5)]
    given[0] /= np.linalg.norm(given[0], axis=0)
    for short, whole, arguments in (
        (terms.rotation_gradient, terms._rotation_gradient, given),
        (terms.slopes_of, terms._slopes, given[:4]),
        (terms.curvatures_of, terms._curvatures, [*given, 0.7]),
    ):
        for a, b in zip(short(kind).call(arguments), whole(kind).call(arguments), strict=True):
            # Sums of some hundred products of numbers around one.
            np.testing.assert_allclose(a.full(), b.full(), atol=1e-10)
    forces, every = (part(kind).call(given) for part in (terms.rotation_forces, terms.rotation_gradient))
    np.testing.assert_allclose(forces[1].full(), every[3].full(), atol=1e-10)


def test_the_work_of_the_bases_is_the_change_of_energy():
    """Under a dead load: the torques times the angles through which the bases turn, by Gauss points on the way."""
    x, w = np.polynomial.legendre.leggauss(4)
    places = [0.0, *(0.5 + 0.5 * x), 1.0]
    turned = {"two": 0.5, "three": -0.3}
    # The load is there from the start, so that nothing but the bases does work on both.
    changes = {f"tubes.{name}.rotation": angle for name, angle in turned.items()}
    changes |= {"histories.still": {"t": [0, 1], "value": [1, 1]}, "loads.f.history": "still"}
    scene = robot((0.0, 0.1, -0.25)).replace({**changes, "analysis": {"steps": places}})
    first, *within, last = sfetcas.solve(scene, accuracy=1e-7).steps
    work = sum(0.5 * w[i] * step.tube(n)["torque"] * a for i, step in enumerate(within) for n, a in turned.items())
    before, after = (step.to_dict()["energy"]["total"] for step in (first, last))
    # Four Gauss points miss 4e-6 of the work.
    assert work == pytest.approx(after - before, rel=2e-5)


def test_curvature_is_that_of_the_rotations():
    """What balance says of the shared curvature is what the rotations say, to the order of these."""
    step = sfetcas.solve(robot((0.0, 0.1, -0.25), b2=[0.0, 0.6, 0.8]), accuracy=1e-8).last
    for member in ("shaft", "end"):
        x = np.array([0.13, 0.55, 0.9])
        changes = step.fields._changes(member, x) + step.model.scene.center_lines[member].curvatures(x)
        np.testing.assert_allclose(step.along(member, x)["curvature"], changes, atol=2e-3)


def test_weight_mass_and_stiffness():
    """Tubes weigh, swing and buckle with the member: three times the stiffness and one and a half times the mass."""
    scene = pair(own=0.0, other=0.0, GJ=1.0)
    step = sfetcas.solve(scene.replace(gravity=[0, 0, -2.0])).last
    np.testing.assert_allclose(step.reaction("A")[0], [0.0, 0.0, 3.0], atol=1e-9)
    light = scene.replace({"sections.inner.rhoI": None, "analysis": {"type": "modes", "accuracy": 1e-6}})
    omega = np.array(sfetcas.solve(light).omega)
    expected = 1.8751040687119611**2 * np.sqrt(3.0 / 1.5)
    np.testing.assert_allclose(omega[:2], expected, rtol=1e-6)
    pressed = {"loads.f": {"type": "force", "node": "B", "value": [-1, 0, 0]}, "members.m.elements": 2}
    buckling = sfetcas.solve(light.replace(pressed)).buckling
    np.testing.assert_allclose(np.ravel(buckling)[:2], 3.0 * np.pi**2 / 4.0, rtol=1e-5)


def test_small_vibrations_of_the_twist():
    """A straight tube that is free in front does not resist the twist of the member, and has no inertia of its own."""
    scene = pair(own=0.0, other=0.0, GJ=1.0).replace({"sections.inner.rhoI": [0.4, 0.0, 0.0]})
    found = sfetcas.solve(scene.replace({"analysis": {"type": "modes", "accuracy": 1e-6, "modes": 6}}))
    torsion = 0.5 * np.pi * np.sqrt(1.0 / 0.4)
    assert np.abs(np.array(found.omega) - torsion).min() < 1e-5 * torsion


def test_angles_go_to_another_mesh():
    """Where elements are halved the polynomials of the coarse ones go on."""
    coarse = sfetcas.solve(robot(), accuracy=1e-3).last
    fine = assemble(coarse.model.scene, coarse.model.mesh.refined())
    state = transferred(coarse.model, coarse.state, fine)
    x = np.linspace(0.0, 1.0, 17)
    for tube, member in (("two", "shaft"), ("two", "end"), ("three", "shaft")):
        before, after = (
            angles_along(model, tube, member, x, np.append(y, 0.0)[model.positions.retained[:, 0]])[0]
            for model, y in ((coarse.model, coarse.state.y), (fine, state.y))
        )
        assert np.abs(before).max() > 0.1
        np.testing.assert_allclose(after, before, atol=1e-12)


# -- every analysis ----------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha"])
def test_a_slow_rotation_goes_through_equilibria(integrator):
    """From one pose to another; what swings is as small as the square of slowness."""
    history = {"t": [0.0, 60.0], "value": [0.0, 1.0], "interpolation": "spline"}
    task = {"type": "dynamic", "end": 60.0, "initial": "equilibrium", "integrator": integrator, "step": 1.5}
    turned = {"tubes.t.rotation": 1.5, "tubes.t.history": "turn", "histories.turn": history}
    scene = pair(GJ=1.0).replace({**turned, "analysis": task, "members.m.elements": 2})
    found = sfetcas.solve(scene).steps[-1]
    still = sfetcas.solve(pair(GJ=1.0, angle=1.5)).last
    np.testing.assert_allclose(found.position("B"), still.position("B"), atol=2e-3)
    assert found.tube("t")["angle"] == pytest.approx(still.tube("t")["angle"], abs=2e-3)


def test_time_steps():
    """Those of generated C, from equilibrium without the load at the tip, are those of the simulation."""
    task = {"type": "dynamic", "end": 0.2, "initial": "equilibrium", "cut": ["f"], "step": 0.04, "output": 0.2}
    scene = pair(GJ=1.0, dead=[0, 0.2, 0.3], angle=0.8).replace({"analysis": task, "members.m.elements": 1})
    made = time_step(scene, "motion", results=["nodes.B.position", "tubes.t.angle"])
    state = made.begin
    for _ in range(5):
        state = made.step(state, 0.04)
    last = sfetcas.solve(scene).last
    assert np.linalg.norm(last.velocity("B")) > 1e-2
    np.testing.assert_allclose(made.outputs(state), [*last.position("B"), last.tube("t")["angle"]], atol=1e-9)


def test_parameters():
    """Angles, curvatures and stiffnesses as parameters, and what is told of tubes."""
    names = ["tubes.t.angle", "tubes.t.curvature", "sections.outer.EI2", "tubes.t.rotation"]
    asked = ["nodes.B.position", "tubes.t.torque", "tubes.t.angle", "tubes.t.energy", "members.m.moment at 0.4"]
    scene = pair(GJ=1.0, dead=[0, 0.2, 0.3], start=-0.2, length=1.1, analysis={"accuracy": 1e-8})
    family = sfetcas.parametric(scene, names, asked)
    at = {"tubes.t.angle": 1.1, "tubes.t.curvature": 2.5, "sections.outer.EI2": 1.7, "tubes.t.rotation": 0.3}
    answer, step = family.solve(at), sfetcas.solve(scene.replace(at)).last
    np.testing.assert_allclose(np.ravel(answer["nodes.B.position"]), step.position("B"), atol=1e-8)
    for key, value in step.tube("t").items():
        assert float(np.ravel(answer[f"tubes.t.{key}"])[0]) == pytest.approx(value, rel=1e-6)
    told = step.along("m", 0.4)["moment"][0]
    np.testing.assert_allclose(np.ravel(answer["members.m.moment at 0.4"]), told, atol=1e-7)


def test_insertion_is_another_scene():
    """Slid forward by a tenth of a metre: the same tube as one that begins there."""
    scene = pair(own=0.0, GJ=1.0, length=0.5, curved_from=0.2, start=-0.1, angle=0.4)
    slid = sfetcas.solve(scene.replace({"tubes.t.start": 0.0}), accuracy=1e-8).last
    again = sfetcas.solve(pair(own=0.0, GJ=1.0, length=0.5, curved_from=0.2, angle=0.4), accuracy=1e-8).last
    np.testing.assert_allclose(slid.position("B"), again.position("B"), atol=1e-9)
    assert np.linalg.norm(sfetcas.solve(scene).last.position("B") - slid.position("B")) > 0.05


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C agrees with the process of the same functions."""
    scene = pair(GJ=1.0, dead=[0, 0.2, 0.3], rotation=1.0, analysis={"accuracy": 1e-4})
    results = ["nodes.B.position", "tubes.t.torque"]
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["tubes.t.angle"], results=results)
    outcome, found = solver.solve([0.5])
    assert outcome.code is Code.SOLVED
    step = sfetcas.solve(scene.replace({"tubes.t.angle": 0.5}), accuracy=1e-7).last
    np.testing.assert_allclose(found, [*step.position("B"), step.tube("t")["torque"]], atol=1e-4)
    assert "cases agree" in said(built(tmp_path / "c", "c"))


def test_picture():
    """A tube is drawn as a band below its members."""
    pytest.importorskip("matplotlib").use("Agg")
    from test_plotting import drawn, named

    figure = sfetcas.solve(pair(GJ=1.0, length=0.6)).last.plot()
    (line,) = drawn(figure, "tube-t")
    assert len(line) == 97
    assert named(figure, "tube-t")[0].get_linewidth() > 3.0


# -- what is refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tubes.t.members": ["n"]}, "tubes.t.members: found 'n', accepted: m"),
        ({"tubes.t.members": []}, "tubes.t.members: found an empty list, accepted: at least one"),
        ({"tubes.t.section": "none"}, "tubes.t.section: found 'none', accepted: inner, outer"),
        ({"tubes.t.length": 1.2}, "tubes.t.length: found an end at 1.2 m along the members, accepted: up to their end"),
        ({"tubes.t.start": -1.0}, "found a base at -1 m and a length of 1 m, accepted: a tube that reaches beyond"),
        ({"tubes.t.start": -0.2, "tubes.t.curvature": [1, 0, 0]}, "curved_from: found a twist that begins at 0 m"),
        ({"tubes.t.history": "h"}, "tubes.t.history: found 'h', but the scene has no histories"),
        ({"sections.outer.EA": 1e3}, "section 'outer' stretches or shears, accepted: one that does not"),
        ({"sections.inner.EA": 1e3}, "tubes.t.members: found the member 'm', whose section 'inner' stretches"),
        ({"sections.outer.GJ": None}, "lacks the key 'GJ'"),
        ({"dimension": "plane"}, "dimension is set to 'plane', but tubes.t turns about the tangent"),
        ({"rotating": [0, 0, 1]}, "rotating: found with tubes, accepted: without them"),
        ({"gravity": [0, 0, 1], "sections.outer.rhoA": None}, "sections.outer: the key 'rhoA' is missing: gravity"),
        (
            {"tendons.s": {"way": [{"member": "m", "offset": [0.1, 0.0]}], "tension": 1.0}},
            "members: found the member 'm', along which a tendon goes, accepted: tendons through discs",
        ),
        ({"analysis": {"type": "dynamic", "end": 1.0}}, "analysis.initial: found 'undeformed', where tubes"),
        (
            {"analysis": {"type": "modes"}, "sections.outer.damping": 0.1},
            "section: found a section with damping or drag, accepted: both at the member alone",
        ),
    ],
)
def test_refused(changes, words):
    """Each with a sentence that names it."""
    with pytest.raises(SceneError) as refused:
        pair().replace(changes)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tubes.two.members": ["end", "shaft"]}, "found 'shaft' after 'end', which ends at node 'tip', accepted: a"),
        ({"nodes.bend.joint": "ball"}, "with a joint at node 'bend', accepted: members joined rigidly"),
        ({"members.end.shape": {"type": "straight"}}, "with a kink at node 'bend', accepted: a centre line whose"),
        ({"members.shaft.type": "rigid"}, "found the member 'shaft', which is rigid, accepted: flexible ones"),
    ],
)
def test_refused_chains(change, words):
    """Members that are no one centre line."""
    with pytest.raises(SceneError) as refused:
        robot().replace(change)
    assert words in str(refused.value)


@pytest.mark.parametrize("integrator", ["conserving", "idas"])
def test_refused_integrators(integrator):
    """They need inertia of all that moves."""
    task = {"type": "dynamic", "end": 1.0, "initial": "equilibrium", "integrator": integrator}
    with pytest.raises(SceneError, match=r"accepted: radau-3, radau-2, generalised-alpha"):
        sfetcas.solve(pair(GJ=1.0).replace(analysis=task))


def test_refused_parameters():
    """What moves elements, and what no expression tells."""
    with pytest.raises(SceneError, match="found the curvature along a member with tubes, accepted: its position"):
        sfetcas.parametric(pair(GJ=1.0), ["tubes.t.angle"], ["members.m.curvature at 0.5"])
    with pytest.raises(SceneError, match="found a number that changes the elements"):
        sfetcas.parametric(pair(GJ=1.0), ["tubes.t.length"], ["nodes.B.position"])


# -- beside obstacles --------------------------------------------------------------------------------


def test_touching_a_ball():
    """What it gives is a force, and given as a load it leaves everything where it was."""
    fine = {"accuracy": 1e-8}
    scene = pair(GJ=1.0, rotation=1.0, analysis=fine)
    free = sfetcas.solve(scene).last
    # Beside the place where the tubes would be without it, off the plane of their curvature.
    center = free.along("m", [0.8])["position"][0] + np.array([0.0, 0.02, 0.08])
    assert np.linalg.norm(free.along("m", [0.8])["position"][0] - center) < 0.1
    ball = {"type": "sphere", "center": center.tolist(), "radius": 0.1, "member": "m"}
    touching = sfetcas.solve(scene.replace({"contacts.ball": ball})).last
    found = touching.contacts["ball"]
    load = {"type": "force", "member": "m", "at": found["at"], "value": found["force"].tolist()}
    loaded = sfetcas.solve(scene.replace({"loads.f": load})).last
    assert np.linalg.norm(found["force"]) > 0.01
    # The accuracy asked for.
    np.testing.assert_allclose(touching.position("B"), loaded.position("B"), atol=1e-8)
    assert touching.tube("t")["torque"] == pytest.approx(loaded.tube("t")["torque"], abs=1e-7)


def test_lying_on_a_floor():
    """Straight tubes without loads of their own are one rod of the sum of their stiffnesses."""
    tables = {
        "nodes": {"A": {"position": [0, 0.05], "support": "clamped"}, "B": {"position": [1, 0.05]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "m"}},
        "loads": {"w": {"type": "distributed", "member": "m", "value": [0, -40.0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "own"}},
        "analysis": {"accuracy": 1e-7},
        "dimension": "space",
    }

    def section(share):
        return {"EI2": share, "EI3": share, "GJ": share}

    both = {"sections": {"own": section(0.4), "other": section(0.6)}, "tubes": {"t": {"members": "m", "length": 1.0}}}
    both["tubes"]["t"]["section"] = "other"
    tubes = sfetcas.solve(Scene.from_dict({**tables, **both})).last
    one = sfetcas.solve(Scene.from_dict({**tables, "sections": {"own": section(1.0)}})).last
    assert np.ptp(one.contacts["floor"]["at"]) > 0.05
    np.testing.assert_allclose(tubes.contacts["floor"]["at"], one.contacts["floor"]["at"], atol=1e-7)
    np.testing.assert_allclose(tubes.position("B"), one.position("B"), atol=1e-7)
