"""Stiffness matrices of forces and moments, and centres of tension, shear and mass off the line of a member."""

import re

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import root
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import CrossSection, Scene, SceneError
from sfetcas.mathematics import quaternion
from sfetcas.mechanics import terms
from sfetcas.mechanics.elements import Element
from sfetcas.mechanics.load_terms import FollowingSpread
from sfetcas.mechanics.mass_centers import CentredWeight, MassPoints
from sfetcas.solvers.globalised import Code

# Of no symmetry; strains by forces and moments are up to two.
WHOLE = np.array(
    [
        [50.0, 3.0, -4.0, 1.0, 2.0, -1.5],
        [3.0, 20.0, 2.0, 0.8, -0.6, 1.0],
        [-4.0, 2.0, 30.0, -0.9, 0.7, 1.2],
        [1.0, 0.8, -0.9, 1.0, 0.2, -0.15],
        [2.0, -0.6, 0.7, 0.2, 1.5, 0.25],
        [-1.5, 1.0, 1.2, -0.15, 0.25, 2.0],
    ]
)
FORCE, MOMENT = np.array([0.3, 1.0, 2.0]), np.array([0.5, -0.3, 0.4])
BENT = {"EI2": 1.0, "EI3": 2.0, "GJ": 0.8}
SOFT = {"EA": 60.0, "GA2": 25.0, "GA3": 30.0}
HEAVY = {"rhoA": 1.0, "rhoI": [0.02, 0.012, 0.008]}
ASIDE = np.array([0.06, -0.04])
"""Where a line is that is moved, along b2 and b3."""
COARSE = {"members.m.element": "SFET4", "members.m.elements": 2}
"""A mesh that is as quick as it is accurate enough for two lines of one beam."""
FIRM = pytest.mark.parametrize("soft", [{}, SOFT], ids=["firm", "soft"])


def cantilever(section, **more):
    """A cantilever along x with a force and a moment at its end."""
    return Scene.from_dict(
        {
            "sections": {"s": section},
            "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {
                "force": {"type": "force", "node": "B", "value": FORCE.tolist()},
                "moment": {"type": "moment", "node": "B", "value": MOMENT.tolist()},
            },
            "analysis": {"accuracy": 1e-9},
            **more,
        }
    )


def moved(aside, soft, **more):
    """One beam, its line where it is or moved aside with all centres where they were; the force is at the same point.

    The node ``P`` is where the end of the line is that is not moved.
    """
    y, z = ASIDE if aside else (0.0, 0.0)
    back = {f"{which}_center": [-y, -z] for which in ("tension", "shear", "mass")} if aside else {}
    return Scene.from_dict(
        {
            "dimension": "space",
            "gravity": [0, 0, -3.0],
            "sections": {"s": {**BENT, **soft, **HEAVY, **back, "damping": 0.03}},
            "nodes": {
                "A": {"position": [0, y, z], "support": "clamped"},
                "B": {"position": [1, y, z]},
                "P": {"position": [1, 0, 0 if aside else 1e-3]},
            },
            "members": {
                "m": {"nodes": ["A", "B"], "section": "s"},
                "arm": {"nodes": ["B", "P"], "type": "rigid"},
            },
            "loads": {"f": {"type": "force", "node": "P" if aside else "B", "value": [-1.0, 1.5, 0.7]}},
            "analysis": {"accuracy": 1e-8},
            **more,
        }
    )


def pair(soft, **more):
    return [moved(aside, soft, **more) for aside in (False, True)]


def compliance(section):
    """Strains by forces and moments (6, 6) of a section that may be firm."""
    x = np.array([0.5])
    soft, arms, bent = section.compliance_of_forces(x)[0], section.arms(x)[0], section.compliance_matrix(x)[0]
    return np.block([[soft + arms @ bent @ arms.T, arms @ bent], [bent @ arms.T, bent]])


def shot(soft, load=None, follower=None):
    """End (3,), force and moment at the clamp of a cantilever along x of length one, by shooting with both of them.

    ``load``: force and moment at the end, fixed axes; ``follower``: force per length that turns with the sections.
    """
    end = np.concatenate([FORCE, MOMENT]) if load is None else load

    def rates(_, y):
        axes, force, moment = y[3:12].reshape(3, 3), y[12:15], y[15:]
        strains = soft @ np.concatenate([axes.T @ force, axes.T @ moment])
        forward = axes @ (strains[:3] + np.eye(3)[0])
        turned = np.cross(axes @ strains[3:], axes.T).T
        lost = np.zeros(3) if follower is None else -axes @ follower
        return [*forward, *turned.ravel(), *lost, *-np.cross(forward, force)]

    def at_end(begin):
        start = [0, 0, 0, *np.eye(3).ravel(), *begin]
        return solve_ivp(rates, (0, 1), start, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]

    begin = root(lambda b: at_end(b)[12:] - end, end, tol=1e-13).x
    return at_end(begin)[:3], begin


# -- the element ------------------------------------------------------------------------------------


@pytest.mark.parametrize("strains", [False, True])
@pytest.mark.parametrize("gauss", [False, True])
def test_derivatives_put_together_of_points_are_those_of_the_whole(gauss, strains):
    element, rng = Element(True, 2, gauss, strains, True), np.random.default_rng(2)
    turns, places, rows, data, load = element.sizes
    q = rng.normal(size=(4, turns)) * 0.2 + [[1.0], [0.0], [0.0], [0.0]]
    q /= np.linalg.norm(q, axis=0)
    given = [q, *(rng.normal(size=size) for size in ((3, places), data, load, rows))]
    for short, whole, arguments in (
        (element.rotation_gradient(), terms._rotation_gradient(element), given),
        (element.slopes(), terms._slopes(element), given[:4]),
        (element.curvatures(), terms._curvatures(element), [*given, 0.7]),
    ):
        for one, other in zip(short.call(arguments), whole.call(arguments), strict=True):
            # Sums of some hundred products of the size of one to ten.
            np.testing.assert_allclose(np.array(one), np.array(other), atol=1e-11)


@pytest.mark.parametrize("space", [False, True])
def test_rigid_motions_strain_nothing(space):
    """What is turned as a whole keeps its energy, and its chord turns with it."""
    element, rng = Element(space, 3, False, True, True), np.random.default_rng(5)
    turns, places, _, data, load = element.sizes
    numbers, strains = rng.normal(size=data), rng.normal(size=(element.axes, places))
    nodal = (
        rng.normal(size=(element.components, turns)) * 0.1 + np.eye(4)[:, :1] if space else rng.normal(size=(1, turns))
    )
    nodal = nodal / np.linalg.norm(nodal, axis=0) if space else nodal
    turn = rng.normal(size=element.components)
    turn = turn / np.linalg.norm(turn) if space else turn
    whole = quaternion.multiply(turn, nodal.T).T if space else nodal + turn
    energies = [float(terms.energies_of(element)(q, strains, numbers, np.zeros(load))[1]) for q in (nodal, whole)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-13)
    chords = [np.array(element.turned(q, strains, numbers)).sum(axis=1) for q in (nodal, whole)]
    np.testing.assert_allclose(quaternion.turned_by(turn, chords[0]), chords[1], atol=1e-12)


def test_elements_without_a_coupling_have_the_data_that_they_had():
    for soft in ({}, SOFT):
        element = sfetcas.solve(cantilever({**BENT, **soft}, analysis={})).last.fields.model.element
        assert element == Element(True, element.order, False, bool(soft), False)
    for kind in (Element(True, 3), Element(True, 3, False, True)):
        assert kind.yielding == (3 if kind.strains else 0)


# -- sections ---------------------------------------------------------------------------------------


def test_a_matrix_says_what_centres_say():
    """The stiffness about the centres moved to the line, against the numbers of the sections."""
    tension, shear = np.array([0.1, -0.05]), np.array([0.03, 0.08])
    strains = np.eye(6)
    # Stretch where the tension centre is, shear where that of shear is.
    strains[0, 4:] = tension[1], -tension[0]
    strains[1:3, 3] = -shear[1], shear[0]
    diagonal = np.diag([60.0, 25.0, 30.0, 0.8, 1.0, 2.0])
    matrix = CrossSection(stiffness=(strains.T @ diagonal @ strains).tolist())
    centres = CrossSection(**BENT, **SOFT, tension_center=tension, shear_center=shear)
    x = np.array([0.2, 0.9])
    for method in ("compliance_of_forces", "arms", "stiffness_matrix", "compliance", "stiffness"):
        one, other = (getattr(section, method)(x) for section in (matrix, centres))
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(compliance(matrix), np.linalg.inv(matrix._matrices(x)[0]), rtol=1e-11, atol=1e-15)


def test_matrices_at_fractions_are_entries_that_vary():
    double = (2.0 * WHOLE).tolist()
    section = CrossSection(stiffness={"at": [0, 1], "value": [WHOLE.tolist(), double]})
    np.testing.assert_allclose(section._matrices(np.array([0.5]))[0], 1.5 * WHOLE)
    assert not section.even
    again = CrossSection(**section.to_dict())
    np.testing.assert_allclose(again._matrices(np.array([0.3])), section._matrices(np.array([0.3])))


SINGULAR = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
SINGULAR[0, 5] = SINGULAR[5, 0] = 1.0


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"stiffness": [[1.0, 0.0], [0.0, 1.0]]}, "found 2 rows of 2, 2 entries, accepted: six rows of six entries"),
        ({"stiffness": 1.0}, "accepted: six rows of six entries, for N, Q2, Q3, M1, M2, M3"),
        (
            {"stiffness": (WHOLE + np.eye(6, k=1)).tolist()},
            "found 1.2 in row 4, column 5, and 0.2 in row 5, column 4, accepted: a symmetric matrix",
        ),
        ({"stiffness": SINGULAR.tolist()}, "accepted: a positive definite matrix"),
        (
            {"stiffness": (-WHOLE).tolist()},
            "found -50 in row 1, column 1, accepted: numbers above zero on the diagonal",
        ),
        ({"stiffness": WHOLE.tolist(), "EA": 1.0}, "found 'EA' beside a stiffness matrix, which has all of it"),
        ({"stiffness": WHOLE.tolist(), "shear_center": [0, 1]}, "found 'shear_center' beside a stiffness matrix"),
        ({**BENT, "tension_center": [0.1, 0, 0]}, "found 3 numbers, accepted: two, along b2 and b3"),
        ({**BENT, "mass_center": [0.1, 0]}, "found a mass centre without a mass, accepted: with rhoA"),
    ],
)
def test_sections_that_are_refused(section, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        CrossSection(**section)


# -- statics ----------------------------------------------------------------------------------------

SECTIONS = {
    "matrix": {"stiffness": WHOLE.tolist()},
    "firm": {**BENT, "tension_center": [0.1, -0.05], "shear_center": [0.03, 0.08]},
    "stretches": {**BENT, "EA": 60.0, "tension_center": [0.1, -0.05], "shear_center": [0.03, 0.08]},
    "soft": {**BENT, **SOFT, "tension_center": [0.1, -0.05], "shear_center": [0.03, 0.08]},
    "coupled": {**BENT, "coupling": [0.2, 0.3, -0.1], "shear_center": [0.1, -0.05]},
}


@pytest.mark.parametrize("name", ["matrix", "firm", "stretches"])
def test_shooting(name):
    """Large deflections, and what sections carry and how they yield, against the differential equations."""
    scene = cantilever(SECTIONS[name])
    soft = compliance(scene.sections["s"])
    found, (tip, begin) = sfetcas.solve(scene).last, shot(soft)
    np.testing.assert_allclose(found.position("B"), tip, atol=1e-9)
    along = found.along("m", [0.0, 0.4])
    np.testing.assert_allclose(along["moment"][0], begin[3:], atol=1e-9)
    # Balance of what is beyond the place, and strains of what is carried there.
    beyond = MOMENT + np.cross(tip - along["position"][1], FORCE)
    np.testing.assert_allclose(along["moment"][1], beyond, atol=1e-8)
    axes = quaternion.matrix(along["quaternion"][1])
    strains = soft @ np.concatenate([axes.T @ FORCE, axes.T @ beyond])
    np.testing.assert_allclose(np.concatenate([along["strain"][1], along["curvature"][1]]), strains, atol=1e-8)


def test_small_loads():
    """The closed form of the end: six freedoms by six loads, through the balance of the straight beam."""
    scene = cantilever(SECTIONS["matrix"])
    loads = 1e-6 * np.concatenate([FORCE, MOMENT])
    found = sfetcas.solve(scene.replace({"loads.force.value": loads[:3], "loads.moment.value": loads[3:]})).last

    def lever(s):
        r = 1.0 - s
        at = np.eye(6)
        at[3:, :3] = [[0, 0, 0], [0, 0, -r], [0, r, 0]]
        return at

    soft = np.linalg.inv(WHOLE)
    entries = [
        [quad(lambda s, i=i, j=j: (lever(s).T @ soft @ lever(s))[i, j], 0, 1)[0] for j in range(6)] for i in range(6)
    ]
    end = np.array(entries) @ loads
    # What is of second order is a millionth.
    np.testing.assert_allclose(found.position("B") - [1.0, 0.0, 0.0], end[:3], atol=5e-12)


def test_distributed_followers():
    """Forces along the member that turn with its sections, whose tangents change with the curvature."""
    spread = np.array([0.4, 1.2, -0.9])
    load = {"type": "distributed", "member": "m", "value": spread.tolist(), "frame": "follower"}
    mesh = {"members.m.element": "SFET4", "members.m.elements": 4}
    scene = cantilever(SECTIONS["matrix"], loads={"q": load}, dimension="space").replace(mesh)
    tip, begin = shot(compliance(scene.sections["s"]), np.zeros(6), spread)
    found = sfetcas.solve(scene).last
    # Of the discretisation, of order 6.
    np.testing.assert_allclose(found.position("B"), tip, atol=1e-6)
    np.testing.assert_allclose(-found.reaction("A")[1], begin[3:], atol=1e-6)


@FIRM
def test_a_line_that_is_moved_is_the_same_beam(soft):
    """Statics with weight: places, reactions, energies, and section forces of either line."""
    plain, aside = (sfetcas.solve(one).last for one in pair(soft))
    # Two meshes of the same answer: each is accurate to 1e-8.
    np.testing.assert_allclose(aside.position("P"), plain.position("B"), atol=1e-8)
    np.testing.assert_allclose(aside.reaction("A")[0], plain.reaction("A")[0], atol=1e-9)
    for key in ("elastic", "loads"):
        assert aside.energy[key] == pytest.approx(plain.energy[key], rel=1e-9)
    one, other = (found.along("m", [0.0, 0.37, 1.0]) for found in (plain, aside))
    arms = quaternion.rotate(one["quaternion"], np.array([0.0, *ASIDE]))
    np.testing.assert_allclose(other["position"], one["position"] + arms, atol=1e-8)
    np.testing.assert_allclose(other["force"], one["force"], atol=1e-8)
    np.testing.assert_allclose(other["moment"], one["moment"] - np.cross(arms, one["force"]), atol=1e-8)
    np.testing.assert_allclose(other["curvature"], one["curvature"], atol=1e-8)


@pytest.mark.parametrize(
    ("soft", "keys"),
    [
        (SOFT, {"stretch_law": {"type": "bilinear", "force": 0.5, "ratio": 0.3}}),
        (SOFT, {"law": {"type": "bilinear", "moment": 0.8, "ratio": 0.4}}),
        ({}, {"law": {"type": "elastic-plastic", "moment": 0.8, "ratio": 0.4}}),
    ],
    ids=["stretch law", "law", "memory"],
)
def test_laws_of_a_line_that_is_moved(soft, keys):
    keys = {f"sections.s.{key}": value for key, value in keys.items()}
    scenes = (one.replace(keys | {"analysis.accuracy": 1e-6}) for one in pair(soft))
    plain, aside = (sfetcas.solve(one).last for one in scenes)
    # Both are accurate to 1e-6.
    np.testing.assert_allclose(aside.position("P"), plain.position("B"), atol=1e-6)
    one, other = (found.along("m", [0.2, 0.7]) for found in (plain, aside))
    np.testing.assert_allclose(other["curvature"], one["curvature"], atol=1e-5)
    if soft:
        arms = np.array([0.0, *ASIDE])
        np.testing.assert_allclose(other["strain"], one["strain"] + np.cross(one["curvature"], arms), atol=1e-6)


def arc(aside, dimension, soft):
    """A quarter of a ring and the same with its line at another radius: numbers per length of the line change."""
    radius = 1.0
    line = radius - (0.1 if aside else 0.0)
    share = line / radius
    section = {"EI2": 0.7, "EI3": 1.0, "GJ": 0.5, "rhoA": 2.0, "rhoI": [0.02, 0.01, 0.01]}
    section |= {"EA": 40.0, "GA2": 20.0, "GA3": 20.0} if soft else {}
    # Strains are over the length of the line, and energies per length of it.
    section = {k: v * share if k[0] in "EG" else np.array(v) / share for k, v in section.items()}
    section |= {f"{which}_center": [-0.1, 0.0] for which in ("tension", "shear", "mass")} if aside else {}
    along = {"type": "arc", "angle": np.pi / 2, "normal": [0, 0, 1], "start": [1, 0, 0]}
    return Scene.from_dict(
        {
            "dimension": dimension,
            "gravity": [0.3, -1.0],
            "sections": {"s": section},
            "nodes": {
                "A": {"position": [0, radius - line], "support": "clamped"},
                "B": {"position": [line, radius]},
                "P": {"position": [1.0, 1.0 if aside else 1.001]},
            },
            "members": {
                "m": {"nodes": ["A", "B"], "section": "s", "shape": along},
                "arm": {"nodes": ["B", "P"], "type": "rigid"},
            },
            "loads": {"f": {"type": "force", "node": "P" if aside else "B", "value": [2.0, 1.0]}},
            "analysis": {"accuracy": 1e-8},
        }
    )


@FIRM
def test_an_arc_whose_line_is_moved(soft):
    """In the plane and in space; b2 of an arc that turns to the left points to its centre."""
    wanted = sfetcas.solve(arc(False, "plane", bool(soft))).last
    for dimension in ("plane", "space"):
        found = sfetcas.solve(arc(True, dimension, bool(soft))).last
        np.testing.assert_allclose(found.position("P"), wanted.position("B"), atol=1e-8)
        np.testing.assert_allclose(found.reaction("A")[0], wanted.reaction("A")[0], atol=1e-8)
        assert found.energy["elastic"] == pytest.approx(wanted.energy["elastic"], rel=1e-8)
    modes = {"analysis": {"type": "modes", "modes": 3, "accuracy": 1e-7}}
    found = [sfetcas.solve(arc(aside, "plane", bool(soft)).replace(modes)).omega for aside in (False, True)]
    np.testing.assert_allclose(*found, rtol=1e-7)


@pytest.mark.parametrize("across", ["b2", "b3"])
def test_plane_and_space(across):
    """What is in the plane stays there, whichever axis of the section is across it."""
    centre = [0.08, 0.0] if across == "b3" else [0.0, 0.08]
    section = {
        **BENT,
        "EA": 60.0,
        "GA2": 25.0,
        "GA3": 25.0,
        "rhoA": 1.0,
        "tension_center": centre,
        "mass_center": centre,
    }
    b2 = [0, 1, 0] if across == "b3" else [0, 0, 1]
    tips = []
    for dimension in ("auto", "space"):
        scene = cantilever(section, gravity=[0, -2.0], dimension=dimension).replace(
            {"members.m.b2": b2, "loads.force.value": [-1.0, 1.0], "loads.moment.value": [0, 0, 0.5]}
        )
        tips.append(sfetcas.solve(scene).last)
        assert scene.resolved_dimension == ("plane" if dimension == "auto" else "space")
    np.testing.assert_allclose(tips[0].position("B"), tips[1].position("B"), atol=1e-9)
    plane, space = (tip.along("m", [0.3]) for tip in tips)
    for key in ("moment", "curvature", "strain"):
        np.testing.assert_allclose(plane[key], space[key], atol=1e-8)


def test_what_leaves_the_plane():
    plane = {"loads": {"force": {"type": "force", "node": "B", "value": [0, 1]}}}
    for section, reason in (
        ({**BENT, "tension_center": [0.1, 0.0]}, ""),
        ({**BENT, "tension_center": [0.0, 0.1]}, "sections.s.tension_center is not in x-y"),
        ({**BENT, "shear_center": [0.0, 0.1]}, "sections.s.shear_center is not in x-y"),
        ({**BENT, "rhoA": 1.0, "mass_center": [0.0, 0.1]}, "sections.s.mass_center is not in x-y"),
        ({"stiffness": WHOLE.tolist()}, "sections.s.stiffness couples forces and bending in x-y with others"),
        ({"stiffness": np.diag(np.diag(WHOLE)).tolist()}, ""),
    ):
        scene = cantilever(section, **plane)
        assert scene.resolved_dimension == ("space" if reason else "plane")
        if reason:
            assert scene.dimension_reason.startswith(reason)
            with pytest.raises(SceneError, match=reason.split()[0]):
                cantilever(section, dimension="plane", **plane)


def test_column_whose_shear_centre_is_off():
    """A column in forks bends and twists: ``P (1 + P e^2/GJ) = pi^2 EI / L^2``.

    Across sections turned by theta the load has the share ``P theta``, which twists: ``GJ phi' = e P theta``.  The
    line follows the sections and what twist moves it, ``v' = theta + e phi'``, and ``EI theta'' = -P v'``.
    """
    offset, gj = 0.35, 0.8
    fork = {"support": "slider", "direction": [1, 0, 0], "rotation": "hinge", "axis": [0, 0, 1]}
    scene = cantilever(
        {"EI2": 50.0, "EI3": 1.0, "GJ": gj, "rhoA": 1.0, "shear_center": [0.0, offset]},
        dimension="space",
        nodes={"A": {"position": [0, 0, 0], "support": "hinge"}, "B": {"position": [1, 0, 0], **fork}},
        loads={"weight": {"type": "force", "node": "B", "value": [-1.0, 0, 0]}},
        analysis={"type": "modes", "modes": 1, "accuracy": 1e-8},
    )
    share = offset**2 / gj
    exact = (np.sqrt(1.0 + 4.0 * share * np.pi**2) - 1.0) / (2.0 * share)
    assert sfetcas.solve(scene).buckling[0] == pytest.approx(exact, rel=1e-8)
    path = {"analysis": {"type": "path", "range": [0, 1.2 * exact], "points": 40}}
    assert sfetcas.solve(scene.replace(path)).bifurcations[0].factor == pytest.approx(exact, rel=1e-5)


# -- motion -----------------------------------------------------------------------------------------


def test_modes_of_a_line_that_is_moved():
    """About a bent equilibrium, damped as Kelvin and Voigt say."""
    modes = {"type": "modes", "modes": 3, "accuracy": 1e-3}
    found = [sfetcas.solve(one.replace(COARSE)) for one in pair(SOFT, analysis=modes)]
    # Of the discretisation: two elements of order 6 at their ends.
    np.testing.assert_allclose(found[1].omega, found[0].omega, rtol=2e-5)
    np.testing.assert_allclose(*([mode.damping for mode in modes.modes] for modes in found), rtol=1e-4)


def test_a_moved_line_in_turning_axes():
    """Centrifugal and Coriolis forces act on the masses where they are: rest, and vibrations about it."""
    found, mesh = [], {"members.m.element": "SFET6", "members.m.elements": 4}
    for aside in (False, True):
        one = arc(aside, "plane", True).replace({**mesh, "rotating": [0, 0, 1.2], "analysis": {"accuracy": 1e-3}})
        modes = sfetcas.solve(one.replace({"analysis": {"type": "modes", "modes": 3, "accuracy": 1e-3}}))
        found.append((sfetcas.solve(one).last, modes.omega))
    (plain, _), (aside, _) = found
    np.testing.assert_allclose(aside.position("P"), plain.position("B"), atol=1e-6)
    np.testing.assert_allclose(aside.reaction("A")[0], plain.reaction("A")[0], atol=1e-6)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-5)
    # Sections carry what acts beyond them.
    force = aside.along("m", [1.0])["force"][0]
    np.testing.assert_allclose(force, [2.0, 1.0, 0.0], atol=1e-9)


def test_bending_and_torsion_together():
    """A pinned beam in forks whose masses hang to the side: two frequencies of a quadratic equation.

    With ``v = V sin(pi x), phi = F sin(pi x)``: ``(k_v - w^2 m)(k_t - w^2 (j + m e^2)) = (w^2 m e)^2``.
    """
    offset, inertia = 0.1, 0.02
    fork = {"support": "slider", "direction": [1, 0, 0], "rotation": "hinge", "axis": [0, 0, 1]}
    scene = cantilever(
        {"EI2": 900.0, "EI3": 1.0, "GJ": 0.2, "rhoA": 1.0, "rhoI": [inertia, 0, 0], "mass_center": [0.0, offset]},
        dimension="space",
        nodes={"A": {"position": [0, 0, 0], "support": "hinge"}, "B": {"position": [1, 0, 0], **fork}},
        loads={},
        analysis={"type": "modes", "modes": 2, "accuracy": 1e-7},
    )
    bending, twist, polar = np.pi**4, 0.2 * np.pi**2, inertia + offset**2
    squares = np.roots([polar - offset**2, -(bending * polar + twist), bending * twist])
    np.testing.assert_allclose(sfetcas.solve(scene).omega, np.sqrt(np.sort(squares)), rtol=1e-6)


@FIRM
@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha"])
def test_motion_of_a_line_that_is_moved(soft, integrator):
    analysis = {"type": "dynamic", "end": 0.1, "step": 0.02, "output": 0.05, "integrator": integrator}
    plain, aside = (sfetcas.solve(one.replace(COARSE)).steps for one in pair(soft, analysis=analysis))
    # Of the discretisation; forces are second derivatives of places.
    np.testing.assert_allclose(aside[-1].position("P"), plain[-1].position("B"), atol=2e-6)
    np.testing.assert_allclose(aside[-1].reaction("A")[0], plain[-1].reaction("A")[0], atol=2e-4)
    np.testing.assert_allclose(aside[-1].energy["total"], plain[-1].energy["total"], rtol=1e-4)


def test_velocities_along_a_member():
    """Of a line whose tangents change with the curvature, against differences of places in time."""
    analysis = {"type": "dynamic", "end": 0.01, "step": 1e-3, "output": 1e-3}
    scene = cantilever({"stiffness": WHOLE.tolist(), **HEAVY, "damping": 0.02}, analysis=analysis)
    steps = sfetcas.solve(scene.replace({"members.m.element": "SFET3", "members.m.elements": 1})).steps
    at = [step.along("m", [0.43]) for step in steps[-3:]]
    slope = (at[2]["position"] - at[0]["position"]) / 2e-3
    speed = np.linalg.norm(slope)
    # Differences are of second order in their step, over the times in which waves go along the member.
    np.testing.assert_allclose(at[1]["velocity"][0], slope[0], atol=2e-2 * speed)


def test_free_flight_keeps_momentum():
    """Nothing acts: the centre of mass goes straight on, and the angular momentum stays."""
    spin, arm = np.array([1.0, -0.6, -0.8]), np.array([0.0, 0.1, -0.05])
    scene = Scene.from_dict(
        {
            "dimension": "space",
            "sections": {"s": {**BENT, **HEAVY, "mass_center": arm[1:], "tension_center": [0.05, 0.0]}},
            "nodes": {
                "A": {"position": [0, 0, 0], "velocity": [0, 0.4, 0]},
                "B": {"position": [1, 0, 0], "velocity": [0, -0.4, 0.6]},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "spin": spin}},
            "analysis": {"type": "dynamic", "end": 0.2, "step": 0.01, "output": 0.1},
        }
    ).replace(COARSE)
    motion = sfetcas.solve(scene)
    linear, angular = (np.array([step.momentum[key] for step in motion.steps]) for key in ("linear", "angular"))
    # The velocity of the centre of mass is that of the line and the spin across the arm.
    np.testing.assert_allclose(linear[0], np.array([0, 0, 0.3]) + np.cross(spin, arm), atol=1e-8)
    np.testing.assert_allclose(linear, np.tile(linear[0], (len(linear), 1)), atol=1e-9)
    # Radau's method keeps what is linear; of angular momentum it loses what is of its order.
    np.testing.assert_allclose(angular, np.tile(angular[0], (len(angular), 1)), atol=1e-6)


@pytest.mark.parametrize("space", [False, True])
def test_terms_of_masses(space):
    """Couples of the weight are derivatives of its energy; points are where the line and the arms say."""
    rng, element = np.random.default_rng(3), Element(space, 2, False, True, True)
    weight = CentredWeight(space, 3)
    axes, turns = weight.axes, 3
    q = rng.normal(size=(4, turns)) * 0.3 + np.eye(4)[:, :1] if space else rng.normal(size=(1, turns))
    q = q / np.linalg.norm(q, axis=0) if space else q
    data, gravity = rng.normal(size=axes * turns), rng.normal(size=axes)
    gradient = np.array(terms.rotation_gradient(weight)(q, np.zeros((axes, 0)), data, gravity, np.zeros(0))[3]).ravel()
    couples = np.array(terms.densities_of(weight)(q, np.zeros((axes, 0)), data, gravity)[1]).ravel()
    np.testing.assert_allclose(gradient, -couples, atol=1e-13)
    points = MassPoints(space, element)
    _, places, rows, size, _ = points.sizes
    numbers, u = rng.normal(size=size), rng.normal(size=(axes, places))
    found = np.array(terms.rows_of(points)(q, u, numbers, np.zeros(0))).reshape(turns, axes)
    rest, arms = (numbers[i * rows : (i + 1) * rows].reshape(turns, axes) for i in range(2))
    turned = quaternion.turned_by(q.T, arms)
    whole = np.concatenate([np.zeros(turns * element.stiffnesses), numbers[2 * rows :]])
    tangents = (
        np.array(element.turned(q, u[:, 1:], whole))
        - whole[turns * element.stiffnesses :][: axes * turns].reshape(-1, axes).T
    )
    np.testing.assert_allclose(found[0], rest[0] + u[:, 0] + turned[0], atol=1e-13)
    np.testing.assert_allclose(found[-1], rest[-1] + u[:, 0] + tangents.sum(axis=1) + turned[-1], atol=1e-13)


def test_work_of_distributed_followers():
    """Virtual work: minus the forces are those of a dead load, where that is the same at this state."""
    element, rng = Element(True, 2, False, True, True), np.random.default_rng(4)
    kind = FollowingSpread(True, element)
    turns, places, _, size, loads = kind.sizes
    q = rng.normal(size=(4, turns)) * 0.3 + np.eye(4)[:, :1]
    q, u = q / np.linalg.norm(q, axis=0), rng.normal(size=(3, places))
    data, load = rng.normal(size=size), rng.normal(size=loads)
    forces = np.array(terms.rotation_forces(kind)(q, u, data, load, np.zeros(0))[1]).ravel()
    dead = np.array(terms.densities_of(kind)(q, u, data, load)[0]).reshape(turns, 3)
    points, step = MassPoints(True, element), 1e-6
    numbers = np.concatenate([np.zeros(6 * turns), data])

    def places_of(change):
        turn = quaternion.from_rotation_vector(change[: 3 * turns].reshape(turns, 3))
        moved = quaternion.multiply(turn, q.T).T
        at = terms.rows_of(points)(moved, u + change[3 * turns :].reshape(places, 3).T, numbers, np.zeros(0))
        return np.array(at).reshape(turns, 3)

    for i, direction in enumerate(np.eye(3 * (turns + places))):
        rate = (places_of(step * direction) - places_of(-step * direction)) / (2.0 * step)
        # Central differences.
        assert -forces[i] == pytest.approx((dead * rate).sum(), abs=1e-7)


# -- further analyses -------------------------------------------------------------------------------


def test_parameters():
    """Answers and derivatives by centres and by an entry of the matrix, against statics and differences."""
    section = {**BENT, **SOFT, **HEAVY, "tension_center": [0.1, -0.05], "mass_center": [0.05, 0.02]}
    asked = ["nodes.B.position", "members.m.curvature at 0.3"]
    scene = cantilever(section, gravity=[0, 0, -2.0], analysis={}).replace(COARSE)
    entries = {"sections.s.stiffness.0.5": None, "sections.s.stiffness.5.0": None}
    both = sfetcas.Parameter(-1.5, lambda x: dict.fromkeys(entries, x))
    for one, names in (
        (scene, ["sections.s.tension_center.0", "sections.s.mass_center.1"]),
        (cantilever({"stiffness": WHOLE.tolist()}, analysis={}).replace(COARSE), {"coupling": both}),
    ):
        family, step = sfetcas.parametric(one, names, asked), sfetcas.solve(one).last
        answer = family.solve({})
        told = step.along("m", [0.3])
        np.testing.assert_allclose(np.ravel(answer[asked[0]]), step.position("B"), atol=1e-8)
        np.testing.assert_allclose(np.ravel(answer[asked[1]]), told["curvature"][0], atol=1e-7)
        for name in names:
            at = {"coupling": -1.5, "sections.s.tension_center.0": 0.1, "sections.s.mass_center.1": 0.02}[name]
            ends = [family.solve({name: at + change}) for change in (-1e-3, 1e-3)]
            for key in asked:
                slope = (np.ravel(ends[1][key]) - np.ravel(ends[0][key])) / 2e-3
                # Central differences: second order in their step.
                np.testing.assert_allclose(np.ravel(answer.jacobian[key][name]), slope, atol=2e-5)


def test_design_finds_what_statics_says():
    """The shear centre at which a force across moves the end by so much."""
    section = {**BENT, "shear_center": [0.0, 0.1]}
    scene = cantilever(
        section, loads={"f": {"type": "force", "node": "B", "value": [0, 0.8, 0]}}, dimension="space"
    ).replace(COARSE)
    wanted = sfetcas.solve(scene.replace({"sections.s.shear_center": [0.0, 0.16]})).last.position("B")
    found = sfetcas.find(scene, {"sections.s.shear_center.1": (0.05, 0.3)}, {"nodes.B.position.1": wanted[1]})
    assert found.values["sections.s.shear_center.1"] == pytest.approx(0.16, abs=1e-5)


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C agrees with the process of the same functions."""
    mesh = {"members.m.element": "SFET3", "members.m.elements": 2}
    scene = cantilever({**SECTIONS["matrix"], "rhoA": 1.0, "mass_center": [0.1, 0]}, gravity=[0, 0, -1.0], analysis={})
    scene, asked = scene.replace(mesh), ["nodes.B.position", "members.m.curvature at 0.3"]
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["loads.force.value.1"], results=asked)
    outcome, results = solver.solve([1.0])
    assert outcome.code is Code.SOLVED
    found = sfetcas.solve(scene).last
    # To what the program stops at.
    np.testing.assert_allclose(results[:3], found.position("B"), atol=1e-7)
    np.testing.assert_allclose(results[3:], found.along("m", [0.3])["curvature"][0], atol=1e-6)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


@needs_compiler
def test_exported_steps(tmp_path):
    scene = arc(True, "plane", False).replace({"analysis": {"type": "dynamic", "end": 0.1, "step": 0.01}})
    sfetcas.export(
        scene.replace({"members.m.element": "SFET3", "members.m.elements": 1}), tmp_path / "c", name="motion"
    )
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


# -- what is refused --------------------------------------------------------------------------------

OFF = {**BENT, "rhoA": 1.0, "tension_center": [0.1, 0.0]}
HUNG = {**BENT, "rhoA": 1.0, "mass_center": [0.1, 0.0]}
MEMBER = {"nodes": ["A", "B"], "section": "s"}


@pytest.mark.parametrize(
    ("section", "more", "words"),
    [
        (OFF, {"members": {"m": {**MEMBER, "type": "small"}}}, "found the small member 'm', whose section 's' has"),
        (HUNG, {"members": {"m": {**MEMBER, "type": "rigid"}}}, "its mass at nodes, or a flexible member"),
        (
            OFF,
            {"actuations": {"a": {"member": "m", "value": [0, 0, 1.0]}}},
            "whose section has a tension centre off the line, accepted: one without",
        ),
        (
            HUNG,
            {"contacts": {"c": {"type": "plane", "point": [0, -1, 0], "normal": [0, 1, 0], "member": "m"}}},
            "whose section has a mass centre off the line, accepted: members without touch obstacles",
        ),
        (
            OFF,
            {"tendons": {"t": {"way": [{"member": "m", "offset": [0.1, 0]}], "tension": 1.0}}},
            "whose section has a tension centre off the line, accepted: discs, or a member without",
        ),
    ],
)
def test_refused(section, more, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        cantilever(section, **{"loads": {}, **more})


def test_refused_integrator():
    analysis = {"type": "dynamic", "end": 0.1, "integrator": "conserving"}
    words = "found a mass centre off the line with the integrator 'conserving', accepted: radau-3, radau-2, generalised"
    with pytest.raises(SceneError, match=words):
        sfetcas.solve(cantilever(HUNG, analysis=analysis))


def test_matrices_that_are_refused_for_what_they_are():
    """Nearly nothing on the diagonal is no lack of symmetry; what has no entries is no matrix."""
    small = WHOLE.copy()
    small[3, 3] = 1e-30
    for matrix, words in ((small, "positive definite"), (np.array(3.0), "six rows of six")):
        with pytest.raises(SceneError, match=words):
            CrossSection(stiffness=matrix)


def test_an_entry_beside_the_diagonal_is_no_parameter():
    scene = cantilever({"stiffness": WHOLE.tolist()})
    with pytest.raises(SceneError, match=r"a Parameter that gives both, .*stiffness\.3\.0"):
        sfetcas.parametric(scene, ["sections.s.stiffness.0.3"], ["nodes.B.position"])
