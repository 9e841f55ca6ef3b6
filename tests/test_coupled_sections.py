"""Sections whose stiffness couples twist and bending."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import sfetcas
from sfetcas import Scene, SceneError

GJ, EI2, EI3 = 0.7, 2.0, 1.0
ROLL = 0.6
COUPLED = {"GJ": 1.0, "EI2": 3.0, "EI3": 1.5, "coupling": [0.35, -0.5, 0.4]}
FORCE = [0.4, 1.1, -0.8]


def scene(section, b2=None, small=False, **more):
    """A cantilever along x with a force across at its end."""
    member = {"nodes": ["A", "B"], "section": "s"} | ({} if b2 is None else {"b2": b2})
    return Scene.from_dict(
        {
            "dimension": "space",
            "sections": {"s": section},
            "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
            "members": {"beam": member | ({"type": "small"} if small else {})},
            "loads": {"tip": {"type": "force", "node": "B", "value": FORCE}},
            "analysis": {"accuracy": 1e-8},
            **more,
        }
    )


def rolled():
    """The same beam twice: its axes b2, b3 rolled about the tangent, and as a matrix in the axes that are not."""
    c, s = np.cos(ROLL), np.sin(ROLL)
    turn = np.array([[c, -s], [s, c]])
    bending = turn @ np.diag([EI2, EI3]) @ turn.T
    full = {"GJ": GJ, "EI2": bending[0, 0], "EI3": bending[1, 1], "coupling": [0.0, 0.0, bending[0, 1]]}
    diagonal = {"GJ": GJ, "EI2": EI2, "EI3": EI3}
    more = {"rhoA": 1.0, "rhoI": [0.02, 0.01, 0.01], "damping": 0.05}
    return [scene(diagonal | more, [0.0, c, s]), scene(full | more, [0.0, 1.0, 0.0])]


def matrix(section):
    a, b, c = section["coupling"]
    return np.array([[section["GJ"], a, b], [a, section["EI2"], c], [b, c, section["EI3"]]])


def shot(stiffness, force):
    """Tip and the moment at the clamp of a cantilever along x, by shooting with the moment there."""
    soft, force = np.linalg.inv(stiffness), np.asarray(force)

    def rates(_, y):
        axes, moment = y[3:12].reshape(3, 3), y[12:]
        spin = axes @ (soft @ (axes.T @ moment))
        turned = np.cross(spin, axes.T).T
        return [*axes[:, 0], *turned.ravel(), *-np.cross(axes[:, 0], force)]

    def end(moment):
        return solve_ivp(rates, (0, 1), [0, 0, 0, *np.eye(3).ravel(), *moment], rtol=1e-11, atol=1e-12).y[:, -1]

    moment = root(lambda m: end(m)[12:], np.cross([1.0, 0, 0], force), tol=1e-12).x
    return end(moment)[:3], moment


def test_rolled_axes_are_a_matrix():
    found = [sfetcas.solve(one).last for one in rolled()]
    # Two answers of a mesh that is fine enough for 1e-8.
    np.testing.assert_allclose(found[0].position("B"), found[1].position("B"), atol=1e-8)
    np.testing.assert_allclose(found[0].reaction("A")[1], found[1].reaction("A")[1], atol=1e-7)


@pytest.mark.parametrize("section", [COUPLED, {**COUPLED, "coupling": [0.5, 0.0, 0.0]}], ids=["all", "one"])
def test_shooting(section):
    found = sfetcas.solve(scene(section)).last
    tip, moment = shot(matrix(section), FORCE)
    np.testing.assert_allclose(found.position("B"), tip, atol=1e-7)
    np.testing.assert_allclose(-found.reaction("A")[1], moment, atol=1e-7)
    # The curvature of the answer is that of its moment.
    along = found.fields.along("beam", np.array([0.0]))
    np.testing.assert_allclose(along["curvature"][0], np.linalg.solve(matrix(section), moment), atol=1e-7)


def test_modes_and_damping():
    """Frequencies and damping ratios of the rolled beam and of the matrix are the same."""
    found = [
        sfetcas.solve(one.replace(loads={}, analysis={"type": "modes", "modes": 4, "accuracy": 1e-7}))
        for one in rolled()
    ]
    np.testing.assert_allclose(found[0].omega, found[1].omega, rtol=1e-6)
    damping = [[mode.damping for mode in modes.modes] for modes in found]
    np.testing.assert_allclose(damping[0], damping[1], rtol=1e-5)
    # Kelvin-Voigt: half the retardation time times the frequency, of a mode without damping.
    np.testing.assert_allclose(damping[0][0], 0.025 * found[0].omega[0], rtol=2e-2)


def test_motion():
    ends = []
    for one in rolled():
        moving = one.replace(analysis={"type": "dynamic", "end": 0.4, "accuracy": 1e-5, "output": 0.1})
        ends.append(sfetcas.solve(moving).steps[-1].position("B"))
    np.testing.assert_allclose(*ends, atol=2e-5)


def test_small_member():
    """Small forces: a superelement deflects as the flexible member does."""
    weak = {"loads.tip.value": [0.0, 1e-4, 2e-4]}
    ends = [
        sfetcas.solve(scene(COUPLED, small=small).replace(weak)).last.position("B") - [1.0, 0.0, 0.0]
        for small in (False, True)
    ]
    # Twist and deflection, both some 4e-5, make a relative difference of their size.
    np.testing.assert_allclose(ends[0][1:], ends[1][1:], rtol=2e-5)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_buckling_about_the_weak_axis(share):
    """A column leaves the straight line at pi^2/4 of the smallest stiffness, which compliance of bending gives."""
    softness = np.linalg.inv(matrix(COUPLED))[1:, 1:]
    critical = 0.25 * np.pi**2 / np.linalg.eigvalsh(softness)[-1]
    found = sfetcas.solve(scene(COUPLED).replace({"loads.tip.value": [-share * critical, 0, 0]})).last
    assert found.certificate.stable is True
    assert (np.linalg.norm(found.position("B")[1:]) > 0.1) == (share > 1.0)


def test_parameters():
    """Derivatives of an answer by a coupling are those of differences, and the curvature is told."""
    name, asked = "sections.s.coupling.1", ["nodes.B.position", "members.beam.curvature at 0"]
    family = sfetcas.parametric(scene(COUPLED), [name], asked)
    answers = [family.solve({name: -0.5 + step}) for step in (-1e-3, 0.0, 1e-3)]
    for key in asked:
        slope = (np.ravel(answers[2][key]) - np.ravel(answers[0][key])) / 2e-3
        # Central differences: second order in their step.
        np.testing.assert_allclose(np.ravel(answers[1].jacobian[key][name]), slope, atol=1e-5)
    moment = shot(matrix(COUPLED), FORCE)[1]
    np.testing.assert_allclose(np.ravel(answers[1][asked[1]]), np.linalg.solve(matrix(COUPLED), moment), atol=1e-5)


def test_stress_is_not_told():
    """A shape with a coupling is of a material of which one modulus does not give the stress."""
    shaped = {"shape": "rectangle", "width": 0.02, "height": 0.01, "E": 1e6, "nu": 0.3}
    for more, told in (({}, True), ({"coupling": [2e-4, 0, 0]}, False)):
        found = sfetcas.solve(scene(shaped | more).replace({"loads.tip.value": [0, 1e-3, 0]})).last
        assert ("bending_stress" in found.along("beam", [0.0])) is told


def test_plane_or_space():
    """Bending in x-y that is coupled with twist leaves the plane; what is coupled out of the plane alone does not."""
    for coupling, dimension in (([0.3, 0, 0], "plane"), ([0, 0.3, 0], "space"), ([0, 0, 0.3], "space")):
        one = scene({**COUPLED, "coupling": coupling}).replace({"dimension": "auto", "loads.tip.value": [0, 1]})
        assert one.resolved_dimension == dimension
    assert one.dimension_reason.startswith("sections.s.coupling couples bending in x-y")


def test_varying():
    """A coupling that goes linearly along the member, as table and as polynomial."""
    kinds = [{"at": [0, 0.5, 1], "value": [0.2, 0.3, 0.4]}, {"polynomial": [0.2, 0.2]}]
    tips = [sfetcas.solve(scene({**COUPLED, "coupling": [kind, 0, 0]})).last.position("B") for kind in kinds]
    np.testing.assert_allclose(*tips, atol=1e-8)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"coupling": [2.0, 0, 0]}, "sections.s.coupling: found [2.0, 0.0, 0.0] beside GJ, EI2 and EI3 of 1, 3, 1.5"),
        ({"coupling": [{"polynomial": [0.0, 2.0]}, 0, 0]}, "at 1 of the length"),
        ({"coupling": [0.1, 0]}, "found 2 numbers, accepted: three"),
        ({"GJ": None}, "the key 'GJ' is missing: a section with a coupling needs GJ, EI2 and EI3"),
    ],
)
def test_refused(change, words):
    section = {key: value for key, value in {**COUPLED, **change}.items() if value is not None}
    with pytest.raises(SceneError, match=re.escape(words)):
        scene(section)
