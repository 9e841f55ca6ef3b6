"""Sections whose moment is not proportional to the change of the curvature: every analysis, by independent ways."""

import pickle
import re
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, root
from scipy.spatial.transform import Rotation
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import CrossSection, Scene, SceneError, SolveError, Status
from sfetcas.equilibria.ways import Ways
from sfetcas.mathematics.forms import Form
from sfetcas.mathematics.potentials import derivatives_of
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields
from sfetcas.mechanics.law_limits import beyond_laws
from sfetcas.mechanics.laws import AlongElement
from sfetcas.mechanics.terms import Term
from sfetcas.solvers.globalised import Code

BILINEAR = {"type": "bilinear", "moment": 1.0, "ratio": 0.2}
RAMBERG = {"type": "ramberg-osgood", "moment": 1.0, "alpha": 0.3, "exponent": 4.0}
KNOTS, MOMENTS = [0.0, 1.0, 2.0, 4.0, 8.0], [0.0, 1.0, 1.6, 2.2, 2.6]
TABLE = {"type": "table", "curvature": KNOTS, "moment": MOMENTS}
UNEQUAL = {"type": "table", "curvature": [-8.0, -3.0, -1.0, 0.0, 1.0, 3.0, 8.0], "moment": [-3, -2, -1, 0, 1, 1.3, 1.8]}
QUARTIC = {"type": "potential", "potential": lambda k: 0.5 * ca.sumsqr(k) + 0.1 * k[2] ** 4 + 0.05 * k[1] ** 4}
LINEAR = {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0}


def given(law):
    """The section with a law and such stiffnesses as that begins with."""
    about = law.get("about", "b3")
    if law["type"] == "potential":
        return {"law": law}
    own = ("EI3", "EI2") if about == "both" else (f"EI{about[1]}",)
    return {"law": law} | {k: v for k, v in LINEAR.items() if law["type"] != "table" or k not in own}


PCHIPS = (
    PchipInterpolator(UNEQUAL["curvature"], UNEQUAL["moment"]),
    PchipInterpolator([-x for x in KNOTS[:0:-1]] + KNOTS, [-x for x in MOMENTS[:0:-1]] + MOMENTS),
)


def moment_of(law, k):
    """The moments of the laws above by other formulas, at curvatures of both signs."""
    a = abs(k)
    if law is BILINEAR:
        return np.sign(k) * (min(a, 1.0) + 0.2 * max(a - 1.0, 0.0))
    if law is RAMBERG:
        return np.sign(k) * brentq(lambda m: m + 0.3 * m**4 - a, 0.0, a + 1.0, xtol=1e-14)
    if law is QUARTIC:
        return k + 0.4 * k**3
    return float(PCHIPS[law["moment"][0] == 0.0](k))


def curvature_of(law, m):
    a = abs(m)
    if law is BILINEAR:
        return np.sign(m) * (min(a, 1.0) + max(a - 1.0, 0.0) / 0.2)
    if law is RAMBERG:
        return np.sign(m) * (a + 0.3 * a**4)
    if law["type"] == "table" and law["moment"] in (MOMENTS, UNEQUAL["moment"]):
        return float(PCHIPS[law is TABLE].solve(m, extrapolate=False)[0]) if m else 0.0
    return brentq(lambda k: moment_of(law, k) - m, -7.99, 7.99, xtol=1e-14) if m else 0.0


LAWS = pytest.mark.parametrize(
    "law", [BILINEAR, RAMBERG, TABLE, UNEQUAL, QUARTIC], ids=["bilinear", "ramberg", "table", "unequal", "given"]
)


def scene(law=BILINEAR, load=None, section=None, **more):
    """A cantilever of one metre along x, with a force or a moment at its end."""
    return Scene.from_dict(
        {
            "sections": {"s": given(law) if section is None else section},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"tip": {"type": "moment", "node": "B", "value": 1.5} if load is None else load},
            "analysis": {"accuracy": 1e-8},
            **more,
        }
    )


def force(value):
    return {"type": "force", "node": "B", "value": value}


def arc(k):
    return [np.sin(k) / k, (1.0 - np.cos(k)) / k]


def shot(law, load):
    """Tip and moment at the clamp of the plane cantilever under a force, by shooting with the angle at the tip."""

    def course(angle):
        def rates(_, y):
            # From the tip to the clamp.
            return [
                np.cos(y[2]),
                np.sin(y[2]),
                -curvature_of(law, y[3]),
                load[1] * np.cos(y[2]) - load[0] * np.sin(y[2]),
            ]

        return solve_ivp(rates, (0, 1), [0, 0, angle, 0], rtol=1e-9, atol=1e-10, max_step=0.02).y[:, -1]

    found = course(brentq(lambda angle: course(angle)[2], 0.1, 1.8, xtol=1e-10))
    return found[:2], found[3]


@LAWS
@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_arc(law, dimension, sign):
    """A moment at the end bends to an arc with the curvature at which the law gives it."""
    found = sfetcas.solve(scene(law, {"type": "moment", "node": "B", "value": 1.5 * sign}, dimension=dimension)).last
    k = curvature_of(law, 1.5 * sign)
    # Mesh error asked for, 1e-8.
    np.testing.assert_allclose(found.position("B")[:2], arc(k), atol=1e-8)
    along = found.fields.along("beam", np.array([0.0, 0.3, 1.0]))
    np.testing.assert_allclose(along["moment"][:, 2], 1.5 * sign, atol=1e-9)
    np.testing.assert_allclose(along["curvature"][:, 2], k, rtol=1e-8)
    np.testing.assert_allclose(found.reaction("A")[1], [0, 0, -1.5 * sign], atol=1e-9)
    # The energy is the integral of the moment.
    kinks = [x * np.sign(k) for x in KNOTS[1:] if x < abs(k)]
    energy = quad(lambda x: moment_of(law, x), 0.0, k, points=kinks or None, epsabs=1e-11)[0]
    assert found.strain == pytest.approx(energy, rel=1e-8)
    assert found.fields.strain_energy("beam") == pytest.approx(found.strain, rel=1e-12)


@pytest.mark.parametrize("solver", ["ipopt", "newton"])
@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
def test_integration(solver, gauss):
    """Both solvers and both ways to integrate give the shape that shooting gives."""
    tip, moment = shot(RAMBERG, [0.0, 3.0])
    found = sfetcas.solve(scene(RAMBERG, force([0.0, 3.0]), dimension="space"), solver=solver, gauss=gauss).last
    # Tolerances of the shooting, 1e-9 a step.
    np.testing.assert_allclose(found.position("B")[:2], tip[:2], atol=1e-7)
    assert found.fields.along("beam", np.array([0.0]))["moment"][0, 2] == pytest.approx(moment, abs=1e-7)


@LAWS
def test_force(law):
    """A force at the end, with moments all along: shape and moment at the clamp of a shooting."""
    load = [-0.3, 1.5]
    tip, moment = shot(law, load)
    found = sfetcas.solve(scene(law, force(load))).last
    # Kinks of laws limit the shooting, whose steps do not know them, to 1e-6.
    np.testing.assert_allclose(found.position("B")[:2], tip[:2], atol=3e-6)
    assert found.fields.along("beam", np.array([0.0]))["moment"][0, 2] == pytest.approx(moment, abs=1e-5)
    assert found.certificate.stable is True


def kinked(load):
    """Tip of the bilinear cantilever by shooting in pieces between the kinks."""

    def course(angle):
        def rates(_, y):
            return [
                np.cos(y[2]),
                np.sin(y[2]),
                -curvature_of(BILINEAR, y[3]),
                load[1] * np.cos(y[2]) - load[0] * np.sin(y[2]),
            ]

        def yields(_, y):
            return y[3] - 1.0

        yields.terminal, yields.direction = True, 1.0
        way = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853", "max_step": 0.05}
        first = solve_ivp(rates, (0, 1), [0, 0, angle, 0], events=yields, **way)
        return solve_ivp(rates, (first.t[-1], 1), first.y[:, -1], **way).y[:, -1]

    return course(brentq(lambda angle: course(angle)[2], 0.1, 1.8, xtol=1e-13))[:2]


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8])
def test_accuracy_with_a_kink(accuracy):
    """Where the stiffness jumps within an element the mesh follows, and the estimate holds."""
    found = sfetcas.solve(scene(BILINEAR, force([-0.3, 1.5])), accuracy=accuracy).last
    error = np.abs(found.position("B")[:2] - kinked([-0.3, 1.5])).max()
    assert error < found.certificate.error_estimate <= accuracy


@pytest.mark.parametrize("solver", ["ipopt", "newton"])
def test_solvers_meet_kinks(solver):
    found = sfetcas.solve(scene(BILINEAR, force([-0.3, 1.5])), accuracy=1e-6, solver=solver).last
    np.testing.assert_allclose(found.position("B")[:2], kinked([-0.3, 1.5]), atol=1e-6)


def test_all_equilibria():
    """A column beyond its critical load that softens: both sides of the post-buckled shape and the straight one."""
    one = scene(RAMBERG, force([-2.6, 0.0]), analysis={"equilibria": "all", "accuracy": 1e-6})
    found = sfetcas.solve(one).steps
    ways = sorted((round(float(step.position("B")[1]), 4), step.certificate.negative) for step in found)
    assert len(found) >= 3
    assert ways[0][0] == -ways[-1][0] < -0.1
    assert (0.0, 1) in ways


def test_copies():
    """Scenes with laws go to other processes, and by name to other values."""
    for law in (QUARTIC, TABLE, BILINEAR):
        assert pickle.loads(pickle.dumps(scene(law))) == scene(law)
    softer = scene(BILINEAR).replace({"sections.s.law.moment": 0.5})
    assert softer.sections["s"].law == sfetcas.Bilinear(moment=0.5, ratio=0.2)
    swept = sfetcas.sweep(
        scene(BILINEAR), sfetcas.grid({"sections.s.law.ratio": [0.2, 0.5]}), ["nodes.B.angle"], workers=1
    )
    np.testing.assert_allclose(np.ravel(swept.values("nodes.B.angle")), [3.5, 2.0], atol=1e-6)


def test_moments_are_slopes_of_the_potential():
    """Moments by balance meet dW/dkappa of the curvature of the elements, with the order of the elements."""
    miss = []
    for elements in (4, 8, 16):
        one = scene(QUARTIC, force([0.3, 2.0, 1.1]))
        one = one.replace({"members.beam.elements": elements, "members.beam.element": "SFET4"})
        fields, x = sfetcas.solve(one).last.fields, np.linspace(0.05, 0.95, 19)
        change = fields._changes("beam", x)
        slopes = change + change**3 * [0.0, 0.2, 0.4]
        moments = np.einsum(
            "nij,ni->nj",
            fields._frames("beam", x, fields.along("beam", x)["rotation"]),
            fields.along("beam", x)["moment"],
        )
        miss.append(np.abs(moments - slopes).max())
    # Cubic rotations have slopes of third order: an eighth for each halving.
    assert miss[0] / miss[1] > 5.0
    assert miss[1] / miss[2] > 5.0
    assert miss[2] < 1e-3


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
def test_derivatives_of_points_are_those_of_the_whole(gauss):
    """In space the functions put together of points are those of the expression of the whole element."""
    rng = np.random.default_rng(3)
    kind = AlongElement(True, 3, gauss, 0, Form("ramberg_osgood", 0))
    q = rng.normal(size=(4, 3)) * 0.2 + [[1.0], [0], [0], [0]]
    data = rng.uniform(0.5, 2.0, kind.sizes[3])
    given = [q / np.linalg.norm(q, axis=0), np.zeros((3, 0)), data, np.zeros(0), np.zeros(0)]
    for name, count, more in (
        ("rotation_gradient", 5, []),
        ("rotation_forces", 5, []),
        ("slopes", 4, []),
        ("curvatures", 5, [0.7]),
    ):
        arguments = [*given[:count], *more]
        ours, theirs = (getattr(owner, name)(kind).call(arguments) for owner in (AlongElement, Term))
        for one, other in zip(ours, theirs, strict=True):
            # Rounding of sums of numbers of size one to ten.
            np.testing.assert_allclose(one.full(), other.full(), atol=1e-12)


def test_both_axes_of_a_round_section():
    """Bending about both axes: under a force across in any direction the shape is that of the plane, turned."""
    law = {**RAMBERG, "about": "both"}
    plane = sfetcas.solve(scene(RAMBERG, force([0, 2.0, 0]))).last.position("B")
    for angle in (0.4, 1.9):
        across = [0.0, 2.0 * np.cos(angle), 2.0 * np.sin(angle)]
        found = sfetcas.solve(scene(law, force(across), dimension="space")).last.position("B")
        np.testing.assert_allclose(found, [plane[0], plane[1] * np.cos(angle), plane[1] * np.sin(angle)], atol=2e-8)


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize(("b2", "sign"), [([0, 0, 1], 1.0), ([0, 0, -1], -1.0)])
def test_other_axis(b2, sign, dimension):
    """A law about b2, which is along z or against it: of unequal signs the other one is met."""
    section = {"EI3": 1.0, "GJ": 1.0, "law": {**UNEQUAL, "about": "b2"}}
    one = scene(UNEQUAL, section=section, dimension=dimension).replace({"members.beam.b2": b2})
    k = sign * curvature_of(UNEQUAL, sign * 1.5)
    found = sfetcas.solve(one).last
    np.testing.assert_allclose(found.position("B")[:2], arc(k), atol=1e-8)
    curvature = found.fields.along("beam", np.array([0.5]))["curvature"][0]
    np.testing.assert_allclose(curvature, [0.0, sign * k, 0.0], atol=1e-8)


def test_ribbon_by_ipopt():
    one = scene(section=RIBBON, load=force([0.0, 0.004, -0.03]), dimension="space").replace(
        {"nodes.B.position": [0.1, 0, 0], "members.beam.b2": [0, 0, 1]}
    )
    found = [sfetcas.solve(one, solver=solver, accuracy=1e-6).last.position("B") for solver in ("newton", "ipopt")]
    np.testing.assert_allclose(*found, atol=1e-7)


def test_curved_member():
    """A law acts on the change of the curvature: an arc of natural curvature 1 under a moment is another arc."""
    shape = {"type": "curvature", "kappa3": [1.0], "length": 1.0, "start": [1, 0]}
    place = arc(1.0)
    one = scene(RAMBERG).replace({"nodes.B.position": place, "members.beam.shape": shape})
    np.testing.assert_allclose(
        sfetcas.solve(one).last.position("B")[:2], arc(1.0 + curvature_of(RAMBERG, 1.5)), atol=1e-8
    )


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
def test_turned_scene(gauss):
    """Member, axis b2 and load turned by any rotation: the answer turns with them."""
    law = {
        "type": "potential",
        "potential": lambda k: 0.5 * ca.sumsqr(k) + 0.3 * k[0] * k[1] + 0.1 * (k[2] + k[1]) ** 4,
    }
    turn = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
    load, tips = np.array([-0.3, 1.2, 0.8]), []
    for axes in (np.eye(3), turn):
        one = scene(law, force((axes @ load).tolist()), dimension="space").replace(
            {"nodes.B.position": axes[:, 0].tolist(), "members.beam.b2": axes[:, 1].tolist()}
        )
        found = sfetcas.solve(one, gauss=gauss).last
        curvature = found.fields.along("beam", np.array([0.0]))["curvature"]
        tips.append((axes.T @ found.position("B"), axes.T @ found.reaction("A")[1], curvature))
    for one, other in zip(*tips, strict=True):
        # Two runs to the accuracy of 1e-8.
        np.testing.assert_allclose(one, other, atol=1e-7)
    moment, k = -tips[0][1], tips[0][2][0]
    slopes = k + 0.3 * np.array([k[1], k[0], 0.0]) + 0.4 * (k[2] + k[1]) ** 3 * np.array([0.0, 1.0, 1.0])
    np.testing.assert_allclose(moment, slopes, atol=1e-7)


# -- analyses --------------------------------------------------------------------------------------------


def test_path():
    """Each point of a path over the factor is an arc."""
    path = sfetcas.solve(scene(RAMBERG, analysis={"type": "path", "range": [0, 1.0]}))
    for factor, place in zip(path.main.factors, path.positions("B"), strict=True):
        k = curvature_of(RAMBERG, 1.5 * factor)
        np.testing.assert_allclose(place[:2], arc(k) if k else [1.0, 0.0], atol=1e-4)


def test_buckling_of_a_softened_column():
    """A column bent into its soft range: frequencies about the bent state are those of the tangent stiffness."""
    section = {**given(BILINEAR), "rhoA": 1.0}
    bent = scene(section=section, analysis={"type": "modes", "modes": 2, "accuracy": 1e-7})
    soft = {"EI3": 0.2, "EI2": 1.0, "GJ": 1.0, "rhoA": 1.0}
    # The same arc of a linear section of the tangent stiffness 0.2 that is naturally bent by what is missing.
    k = 1.0 + 0.5 / 0.2
    natural = k - 1.5 / 0.2
    shape = {"type": "curvature", "kappa3": [natural], "length": 1.0, "start": [1, 0]}
    other = scene(section=soft, analysis=bent.analysis).replace(
        {"nodes.B.position": arc(natural), "members.beam.shape": shape}
    )
    np.testing.assert_allclose(sfetcas.solve(bent).omega, sfetcas.solve(other).omega, rtol=1e-5)


@pytest.mark.parametrize("integrator", ["radau-3", "conserving", "idas"])
def test_motion_keeps_energy(integrator):
    """A strip under a sudden force swings far into its soft range; its energies sum to what they were."""
    one = scene(
        QUARTIC,
        force([0.0, 1.5]),
        {**given(QUARTIC), "rhoA": 1.0},
        analysis={"type": "dynamic", "end": 0.6, "integrator": integrator, "accuracy": 1e-4, "output": 0.1},
    ).replace({"members.beam.elements": 1, "members.beam.element": "SFET4"})
    motion = sfetcas.solve(one)
    kinetic, elastic, _ = energies = np.array([instant.energies for instant in motion.steps]).T
    assert min(kinetic.max(), elastic.max()) > 0.1
    # Ten times the accuracy of the positions.
    assert np.abs(energies.sum(axis=0)).max() < 1e-3


def test_parameters():
    """Derivatives of the answer by numbers of the laws, from the formula of the arc."""
    family = sfetcas.parametric(
        scene(RAMBERG),
        ["sections.s.law.moment", "sections.s.law.exponent", "sections.s.EI3"],
        ["nodes.B.angle", "members.beam.energy", "members.beam.moment at 0.5"],
    )
    values = {"sections.s.law.moment": 1.1, "sections.s.law.exponent": 3.5, "sections.s.EI3": 1.3}
    answer = family.solve(values)

    def angle(moment, exponent, stiffness):
        return 1.5 / stiffness + 0.3 * moment / stiffness * (1.5 / moment) ** exponent

    assert answer["nodes.B.angle"] == pytest.approx(angle(*values.values()), abs=1e-6)
    moment, exponent, stiffness = values.values()
    # 1.5 times the angle, less the complementary energy.
    complementary = 1.5**2 / 2.0 + 0.3 * 1.5 ** (exponent + 1.0) / moment ** (exponent - 1.0) / (exponent + 1.0)
    energy = 1.5 * angle(*values.values()) - complementary / stiffness
    assert answer["members.beam.energy"] == pytest.approx(energy, abs=1e-6)
    assert answer["members.beam.moment at 0.5"][2] == pytest.approx(1.5, abs=1e-9)
    for i, name in enumerate(values):
        step = np.eye(3)[i] * 1e-5
        at = np.array(list(values.values()))
        slope = (angle(*(at + step)) - angle(*(at - step))) / 2e-5
        assert answer.jacobian["nodes.B.angle"][name].item() == pytest.approx(slope, abs=1e-5)


@pytest.mark.parametrize(("law", "name"), [(TABLE, "sections.s.law.moment.2"), (QUARTIC, None)], ids=["table", "given"])
def test_parameters_of_data(law, name):
    """Entries of tables and parameters of potentials are numbers like others."""
    if name is None:
        law = {
            "type": "potential",
            "potential": lambda k, p: 0.5 * ca.sumsqr(k) + p[0] * k[2] ** 4,
            "parameters": [0.1],
        }
        name = "sections.s.law.parameters.0"
    family = sfetcas.parametric(scene(law), [name], ["nodes.B.angle"])
    value = 1.6 if law is TABLE else 0.1
    angles = [family.solve({name: value + step}) for step in (-1e-4, 0.0, 1e-4)]
    slope = (angles[2]["nodes.B.angle"] - angles[0]["nodes.B.angle"]) / 2e-4
    assert abs(slope) > 0.1
    assert angles[1].jacobian["nodes.B.angle"][name].item() == pytest.approx(slope, rel=1e-4)
    if law is not TABLE:
        k = brentq(lambda k: k + 0.4 * k**3 - 1.5, 0, 2)
        assert angles[1]["nodes.B.angle"] == pytest.approx(k, abs=1e-6)


def test_bending_stiffness_as_parameter_of_shapes():
    """Dimensions of a shape move its law with them."""
    one = scene(section={**FLAT, "law": {"type": "plateau", "stress": STRESS}}, load=BENDING)
    family = sfetcas.parametric(one, ["sections.s.height"], ["nodes.B.angle"])
    found = family.solve({"sections.s.height": 1.1 * HEIGHT})["nodes.B.angle"]
    start = 2.0 * STRESS / (E * 1.1 * HEIGHT)
    most = WIDTH * (1.1 * HEIGHT) ** 2 / 4.0 * STRESS
    assert found == pytest.approx(start / np.sqrt(3.0 * (1.0 - BENDING["value"] / most)), rel=1e-6)


def test_following_load_beside_a_law():
    """Moments by balance of a member that both a law and a distributed follower act along: none at the free end."""
    press = {"press": {"type": "distributed", "member": "beam", "value": [0, 2.0], "frame": "follower"}}
    found = sfetcas.solve(scene(RAMBERG, loads=press)).last
    x = np.linspace(0.0, 1.0, 5)
    along = found.fields.along("beam", x)
    np.testing.assert_allclose(along["moment"][-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(along["moment"][0], -found.reaction("A")[1], atol=1e-9)
    expected = [curvature_of(RAMBERG, m) for m in along["moment"][:, 2]]
    np.testing.assert_allclose(along["curvature"][:, 2], expected, atol=1e-9)
    family = sfetcas.parametric(scene(RAMBERG, loads=press), ["sections.s.EI3"], ["members.beam.moment at 0.5"])
    moment = np.ravel(family.solve()["members.beam.moment at 0.5"])
    np.testing.assert_allclose(moment, along["moment"][2], atol=1e-5)


def test_design():
    """The moment at which the strip softens such that its end turns by three radians."""
    found = sfetcas.find(scene(BILINEAR), {"sections.s.law.moment": (0.5, 1.4)}, {"nodes.B.angle": 3.0})
    # M0 + 0.2 (3 - M0) = 1.5
    assert found.values["sections.s.law.moment"] == pytest.approx((1.5 - 0.6) / 0.8, rel=1e-5)


def test_optimal_control():
    """A torque bends a strip without mass slowly: what it does is the energy of the law."""
    section = {**given(RAMBERG), "rhoA": 0.01, "damping": 0.05}
    one = scene(RAMBERG, section=section).replace({"members.beam.elements": 1, "members.beam.element": "SFET4"})
    problem = sfetcas.OptimalControl(one, {"loads.tip.value": (-9, 9)}, time=3.0, intervals=8)
    problem.minimise(problem.integral(problem.control("loads.tip.value") ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.angle")) == 1.0, name="turned")
    problem.rest_at_end()
    found = problem.solve(replay=False)
    assert found.answer("nodes.B.angle").ravel()[-1] == pytest.approx(1.0, abs=1e-6)


@needs_compiler
@pytest.mark.parametrize("law", [RAMBERG, TABLE], ids=["ramberg", "table"])
def test_exported_code(tmp_path, law):
    """The program in C agrees with the functions of CasADi to the last digits."""
    solver = sfetcas.export(
        scene(law), tmp_path / "c", name="c", arguments=["loads.tip.value"], results=["nodes.B.angle"]
    )
    outcome, results = solver.solve([1.4])
    assert outcome.code is Code.SOLVED
    assert results[0] == pytest.approx(curvature_of(law, 1.4), abs=1e-5)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


@needs_compiler
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_steps_in_c(tmp_path, dimension):
    """Time steps as a program in C, to the last bit."""
    inertia = {"rhoA": 1.0, "rhoI": [0.01, 0.01, 0.01]}
    motion = {"type": "dynamic", "end": 0.5, "integrator": "radau-3", "step": 0.01}
    one = scene(RAMBERG, force([0.0, 2.0]), given(RAMBERG) | inertia, analysis=motion, dimension=dimension)
    sfetcas.export(
        one.replace({"members.beam.elements": 2, "members.beam.element": "SFET3"}), tmp_path / "c", name="motion"
    )
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


def test_rigid_end():
    """A law beside a rigid member: the moment at the clamp of the rigid part is in balance."""
    one = Scene.from_dict(
        {
            "sections": {"s": given(BILINEAR), "stiff": {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "M": {"position": [0.3, 0]},
                "B": {"position": [1, 0]},
            },
            "members": {
                "stiff": {"nodes": ["A", "M"], "section": "stiff", "type": "rigid"},
                "beam": {"nodes": ["M", "B"], "section": "s"},
            },
            "loads": {"tip": force([0.0, 2.0])},
        }
    )
    found = sfetcas.solve(one).last
    x = found.position("B")[0]
    np.testing.assert_allclose(found.reaction("A")[1][2], -2.0 * x, atol=1e-7)
    np.testing.assert_allclose(found.fields.along("beam", np.array([0.0]))["moment"][0, 2], 2.0 * (x - 0.3), atol=1e-7)


# -- laws of shapes --------------------------------------------------------------------------------------

E, STRESS, WIDTH, HEIGHT = 7e10, 6e8, 0.004, 0.002
FLAT = {"shape": "rectangle", "width": WIDTH, "height": HEIGHT, "E": E, "nu": 0.3}
WIRE = {"shape": "circle", "radius": 0.001, "E": E, "nu": 0.3}


def told(section, k):
    """Moment about b3 by a law at a curvature, from its term."""
    section = CrossSection(**section)
    values, x = section.law.values(section, np.zeros(1)), np.zeros(3)
    x[2] = k / values[0, 1]
    gradient = derivatives_of(section.law.form)(x, values[0, 2:])[1].full()[2, 0]
    return section.stiffness_matrix(np.zeros(1))[0, 2, 2] * k + gradient * values[0, 0] / values[0, 1]


def summed(section, curve, k):
    """The same by integrating stress over many fibres, with the neutral axis by bisection."""
    y = (np.arange(40000) + 0.5) / 40000 * 2.0 - 1.0
    if section["shape"] == "rectangle":
        y, area = y * HEIGHT / 2.0, np.full(len(y), WIDTH * HEIGHT / len(y))
    else:
        radius, inner = section.get("radius", section.get("outer")), section.get("inner", 0.0)
        y = y * radius
        chord = 2.0 * (np.sqrt(radius**2 - y**2) - np.sqrt(np.maximum(inner**2 - y**2, 0.0)))
        area = chord * 2.0 * radius / len(y)
    e = brentq(lambda e: float(curve(e + k * y) @ area), -0.2, 0.2, xtol=1e-15)
    return float((curve(e + k * y) * y) @ area)


def test_plateau():
    """The closed form of a rectangle against fibres, and the linear part before."""
    section = {**FLAT, "law": {"type": "plateau", "stress": STRESS}}
    start = 2.0 * STRESS / (E * HEIGHT)
    for k in (0.5 * start, start, 1.01 * start, 2.0 * start, 10.0 * start):
        moment = summed(section, lambda e: np.clip(E * e, -STRESS, STRESS), k)
        # Sums over 40000 fibres.
        assert told(section, k) == pytest.approx(moment, rel=1e-7)
        if k > start:
            ideal = WIDTH * HEIGHT**2 / 4.0 * STRESS * (1.0 - (start / k) ** 2 / 3.0)
            assert told(section, k) == pytest.approx(ideal, rel=1e-12)


BENDING = {"type": "moment", "node": "B", "value": 2.2}
CURVE = [-0.06, -0.01, 0.0, 0.008, 0.05], [-9e8, -7e8, 0.0, 5.6e8, 6e8]


@pytest.mark.parametrize(
    "section",
    [FLAT, WIRE, {"shape": "tube", "outer": 0.001, "inner": 0.0007, "E": E, "nu": 0.3}],
    ids=["rectangle", "circle", "tube"],
)
def test_stress_strain(section):
    """Unequal in tension and compression: moments of the table against fibres with a shifted neutral axis."""
    law = {"type": "stress-strain", "strain": CURVE[0], "stress": CURVE[1]}
    law |= {"about": "b3"} if section is FLAT else {}
    one = {**section, "law": law}
    made = CrossSection(**one)
    last = made.law.reach(made, np.zeros(1))[0, 1]
    for share in (0.05, 0.2, 0.3, 0.6, 0.99):
        moment = summed(section, lambda e: np.interp(e, *CURVE), share * last)
        # Cubics between 64 knots, and sums over fibres with chords that end steeply: 1e-6.
        assert told(one, share * last) == pytest.approx(moment, rel=3e-6)


def test_table_is_pchip():
    for k in (0.3, 1.7, 3.0, 3.9, -2.2):
        assert told(given(TABLE), k) == pytest.approx(moment_of(TABLE, k), rel=1e-12)
        # In the last intervals SciPy may end flat, this does not.
        assert told(given(UNEQUAL), k) == pytest.approx(moment_of(UNEQUAL, k), rel=1e-12)


# -- ribbons ---------------------------------------------------------------------------------------------


def profile_energy(width, thick, young, nu, k, t):
    """Energy per length of a strip with curvature k and twist t, by finite differences of its profile across.

    Minimised over the curvature across, c, with the strain along whose second derivative is t^2 - k c, and which has
    neither resultant nor moment.
    """
    n = 400
    y, h = np.linspace(-width / 2, width / 2, n + 1), width / n
    w = np.full(n + 1, h)
    w[[0, -1]] = h / 2
    # Strain from its second derivative: integrate twice, take away mean and slope.
    twice = np.tril(np.ones((n + 1, n + 1)), -1) * (y[:, None] - y[None, :]) * w
    basis = np.stack([np.ones(n + 1), y], axis=1)
    project = np.eye(n + 1) - basis @ np.linalg.solve(basis.T @ (w[:, None] * basis), basis.T * w)
    strain = project @ twice
    plate = young * thick**3 / (12.0 * (1.0 - nu**2))
    # plate/2 (k^2 + 2 nu k c + c^2 + 2 (1 - nu) t^2) + E h/2 (strain (t^2 - k c))^2
    matrix = plate * np.diag(w) + young * thick * k**2 * strain.T @ (w[:, None] * strain)
    vector = -plate * nu * k * w + young * thick * k * strain.T @ (w * (strain @ np.full(n + 1, t**2)))
    c = np.linalg.solve(matrix, vector)
    bending = 0.5 * plate * (w @ (k**2 + 2 * nu * k * c + c**2 + 2 * (1 - nu) * t**2))
    return bending + 0.5 * young * thick * (w @ (strain @ (t**2 - k * c)) ** 2)


RIBBON = {
    "shape": "rectangle",
    "width": 0.02,
    "height": 0.0004,
    "E": 2e9,
    "nu": 0.3,
    "law": {"type": "audoly-neukirch"},
}


def potential(section, change):
    """W of a law at changes of the curvatures, J/m."""
    section = CrossSection(**section)
    values, change = section.law.values(section, np.zeros(1))[0], np.asarray(change)
    deviation = float(derivatives_of(section.law.form)(change / values[1], values[2:])[0])
    return 0.5 * change @ section.stiffness_matrix(np.zeros(1))[0] @ change + values[0] * deviation


@pytest.mark.parametrize(("k", "t"), [(0.3, 0.2), (1.0, 2.0), (5.0, 1.0), (30.0, 20.0), (0.01, 3.0)])
def test_ribbon_is_its_profile(k, t):
    """The potential of a ribbon against the profile across it, solved in numbers."""
    numbers = (RIBBON["width"], RIBBON["height"], RIBBON["E"], RIBBON["nu"])
    # Second order differences with 400 steps.
    assert potential(RIBBON, [t, 0.0, k]) == pytest.approx(profile_energy(*numbers, k, t), rel=2e-3)


def test_ribbon_tends_to_sadowsky():
    """Large curvatures: D w/2 (k^2 + t^2)^2 / k^2, with a relative error that falls with the root of the curvature."""
    width, thick, young, nu = RIBBON["width"], RIBBON["height"], RIBBON["E"], RIBBON["nu"]
    plate = young * thick**3 / (12.0 * (1.0 - nu**2))
    miss = []
    for k in (1e3, 1e5):
        t = 0.4 * k
        sadowsky = 0.5 * plate * width * (k**2 + t**2) ** 2 / k**2
        miss.append(abs(potential(RIBBON, [t, 0.0, k]) / sadowsky - 1.0))
    assert miss[1] < 2e-3
    assert miss[0] / miss[1] == pytest.approx(10.0, rel=0.1)


def ribbon_energy(t, b, k):
    """The formula of the ribbon for RIBBON, also of complex numbers; E w^3 h/12 about the stiff axis."""
    width, thick, young, nu = (RIBBON[key] for key in ("width", "height", "E", "nu"))
    plate, size = young * thick**3 / (12.0 * (1.0 - nu**2)), np.sqrt(k * k)
    x = np.sqrt(width * np.sqrt(3.0 * (1.0 - nu**2)) * width / thick * size)
    share = 1.0 - 2.0 / x * (np.cosh(x) - np.cos(x)) / (np.sinh(x) + np.sin(x))
    bent = (1.0 - nu**2) * k**2 + 2.0 * (1.0 - nu) * t**2 + (nu * k**2 + t**2) ** 2 / k**2 * share
    return 0.5 * plate * width * bent + 0.5 * young * thick * width**3 / 12.0 * b**2


def test_ribbon_by_shooting():
    """A ribbon clamped at one end under a force across at the other one, twisted by it, in space."""
    load = np.array([0.0, 0.004, -0.03])

    def moments(change):
        """Of the formula, by complex steps."""
        return np.array([ribbon_energy(*(change + 1e-30j * axis)).imag / 1e-30 for axis in np.eye(3)])

    def curvatures(moment, near):
        found = root(lambda c: moments(c) - moment, near, tol=1e-14)
        return found.x

    rest = CrossSection(**RIBBON).stiffness([0.0])[0]

    def end(moment, length=0.1):
        near = [np.zeros(3)]

        def rates(_, y):
            axes, m = y[3:12].reshape(3, 3), y[12:]
            own = axes.T @ m
            near[0] = curvatures(own, near[0] if near[0].any() else own / rest + 1e-3)
            return [*axes[:, 0], *np.cross(axes @ near[0], axes.T).T.ravel(), *-np.cross(axes[:, 0], load)]

        # b2 along z, so that b3 is against y.
        start = np.stack([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]], axis=1)
        return solve_ivp(rates, (0, 0.999 * length), [0, 0, 0, *start.ravel(), *moment], rtol=1e-8, atol=1e-10).y[:, -1]

    one = scene(section=RIBBON, load=force(load.tolist()), dimension="space").replace(
        {"nodes.B.position": [0.1, 0, 0], "members.beam.b2": [0, 0, 1]}
    )
    found = sfetcas.solve(one, accuracy=1e-8).last
    along = found.fields.along("beam", np.array([0.0, 0.999]))
    last = end(along["moment"][0])
    # The shooting stops short of the free end, where the curvature vanishes and the formula of the profile is 0/0.
    np.testing.assert_allclose(last[:3], along["position"][1], atol=1e-7)
    np.testing.assert_allclose(last[12:], along["moment"][1], atol=1e-9)
    straight = sfetcas.solve(one.replace({"sections.s.law": None}), accuracy=1e-8).last
    assert np.abs(straight.position("B") - found.position("B")).max() > 1e-3


def sadowsky(**more):
    return {**RIBBON, "law": {"type": "sadowsky"}, **more}


PLATE = RIBBON["E"] * RIBBON["height"] ** 3 / (12.0 * (1.0 - RIBBON["nu"] ** 2)) * RIBBON["width"]
"""Plate stiffness of RIBBON times its width, N m2."""


@pytest.mark.parametrize(("k", "t"), [(7.0, 2.0), (-3.0, 2.9), (2.0, -2.0), (1.0, 4.0), (0.0, 3.0)])
def test_ribbon_of_sadowsky_has_its_energy(k, t):
    exact = 0.5 * PLATE * ((k**2 + t**2) ** 2 / k**2 if abs(t) <= abs(k) else 4.0 * t**2)
    # It is smoothed over 1e-3 1/m.
    assert potential(sadowsky(), [t, 0.0, k]) == pytest.approx(exact, rel=1e-6)


def test_ribbon_of_sadowsky_is_convex_and_has_no_corner():
    law = CrossSection(**sadowsky()).law
    function, rng = derivatives_of(law.form), np.random.default_rng(3)
    rest = np.diag([2.0, 0.0, 1.0])
    for x in rng.normal(size=(60, 3)) * np.exp(rng.uniform(-3, 6, size=(60, 1))):
        bend = function(x, [])[2].full() + rest
        assert np.linalg.eigvalsh(bend)[0] > -1e-12 * np.abs(bend).max()
        # At the twist beyond which bending has no stiffness, from both sides.
        at = np.array([np.hypot(x[2], 1.0), 0.0, x[2]])
        sides = [function(at * [share, 1.0, 1.0], [])[1].full() for share in (1.0 - 1e-9, 1.0 + 1e-9)]
        np.testing.assert_allclose(*sides, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("t", [6.0, 9.9])
def test_ribbon_of_sadowsky_is_a_helix(t):
    """Curvature k and twist t all along, under the force and the moment at its end that such a helix needs.

    In section axes M = dW is constant, so that M' = w x M, w = (t, 0, k), is the moment of a force along w.
    """
    k, length = 10.0, 0.3
    ratio, w = 1.0 + (t / k) ** 2, np.array([t, 0.0, k])
    moment = PLATE * np.array([2.0 * ratio * t, 0.0, (2.0 * ratio - ratio**2) * k])
    load = (k * moment[0] - t * moment[2]) / k * w
    turned = Rotation.from_rotvec(w * length).as_matrix()
    ends = [quad(lambda s, i=i: Rotation.from_rotvec(w * s).as_matrix()[i, 0], 0, length)[0] for i in range(3)]
    loads = {"f": force(load.tolist()), "m": {"type": "moment", "node": "B", "value": (turned @ moment).tolist()}}
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [length, 0, 0]}}
    found = sfetcas.solve(scene(section=sadowsky(), nodes=nodes, loads=loads, dimension="space")).last
    np.testing.assert_allclose(found.position("B"), ends, atol=1e-7)
    np.testing.assert_allclose(found.along("beam", [0.1, 0.7])["curvature"], [w, w], atol=1e-5)


def test_where_no_equilibrium_is_found_the_law_is_named():
    one = scene(section=sadowsky(), load=force([0.0, 0.0, -0.1]), dimension="space")
    pilot = sfetcas.Prepared(sfetcas.assemble(one, sfetcas.uniform_mesh(one, 1, 2)))
    for status, named in ((Status.ITERATIONS, True), (Status.INFEASIBLE, False)):
        error = Ways.named(None, pilot, SolveError(status, "it failed"))
        assert error.detail.startswith("it failed")
        assert ("where a ribbon twists more than it bends, accepted there: 'audoly-neukirch'" in error.detail) is named


def test_ribbons_of_vanishing_thickness_are_that_of_sadowsky():
    """Of one plate stiffness: what the thickness changes falls with its root, and two of them tell the limit."""

    def end(law, thick):
        section = {**RIBBON, "height": thick, "E": RIBBON["E"] * (RIBBON["height"] / thick) ** 3, "law": {"type": law}}
        one = scene(section=section, load=force([0.0, 0.03, -0.1]), dimension="space")
        one = one.replace({"nodes.B.position": [0.1, 0, 0], "members.beam.b2": [0, 0, 1]})
        return sfetcas.solve(one, element="SFET4", elements=4).last

    found, thick, thin = end("sadowsky", 4e-4), *(end("audoly-neukirch", h).position("B") for h in (4e-5, 4e-7))
    assert found.certificate.stable
    np.testing.assert_allclose(found.position("B")[[0, 2]], ((10.0 * thin - thick) / 9.0)[[0, 2]], atol=4e-6)
    assert np.abs(thick - found.position("B")).max() > 1e-4


def test_ribbon_of_sadowsky_tells_where_it_has_no_stiffness():
    """Twisted alone it needs 4 D w t, and bends as it likes; in the plane its stiffness is D w."""
    nodes = {
        "A": {"position": [0, 0, 0], "support": "clamped"},
        "B": {
            "position": [0.3, 0, 0],
            "support": "slider",
            "direction": [1, 0, 0],
            "rotation": "hinge",
            "axis": [1, 0, 0],
        },
    }
    motions = {"turn": {"node": "B", "rotation": 1.0}}
    found = sfetcas.solve(scene(section=sadowsky(), nodes=nodes, loads={}, motions=motions, dimension="space"))
    assert found.last.reaction("B")[1][0] == pytest.approx(4.0 * PLATE / 0.3, rel=1e-6)
    assert any("no stiffness against bending where the twist is larger than the" in note for note in found.last.notes)
    bent = sfetcas.solve(scene(section=sadowsky(), load={"type": "moment", "node": "B", "value": PLATE})).last
    np.testing.assert_allclose(bent.position("B")[:2], arc(1.0), atol=1e-7)
    assert not any("stiffness" in note for note in bent.notes)


# -- what is told and refused ----------------------------------------------------------------------------


def test_end_of_a_table_is_told():
    short = {"type": "table", "curvature": [0.0, 1.0, 2.0], "moment": [0.0, 1.0, 1.6]}
    notes = sfetcas.solve(scene(short, {"type": "moment", "node": "B", "value": 1.9})).last.notes
    assert any("ends at a curvature of 2 1/m, and member 'beam' bends by" in note for note in notes)
    assert not sfetcas.solve(scene(short)).last.notes


def test_lost_convexity_is_told():
    """A strip whose moment falls between curvatures 0.714 and 1.667, bent to an arc of curvature 1.2 or 0.6."""
    law = {"type": "potential", "potential": lambda k: 0.5 * ca.sumsqr(k) - k[2] ** 3 / 3.0 + 0.07 * k[2] ** 4}
    found = sfetcas.solve(scene(law, {"type": "moment", "node": "B", "value": 0.2})).last
    assert not found.notes
    for k, told in ((0.6, ()), (1.2, ("is not convex at changes of the curvatures of (0, 0, 1.2) 1/m, as of",))):
        q = np.zeros_like(found.state.q)
        q[found.model.chain("beam"), 0] = k * found.model.along("beam")
        bent = Fields(Equations(found.model), replace(found.state, q=q), found.loading)
        notes = beyond_laws(bent).values()
        assert len(notes) == len(told)
        assert all(words in note for words, note in zip(told, notes, strict=True))


def test_path_tells_the_end_of_a_table():
    short = {"type": "table", "curvature": [0.0, 1.0, 2.0], "moment": [0.0, 1.0, 1.6]}
    tip = {"type": "moment", "node": "B", "value": 2.0}
    path = sfetcas.solve(scene(short, tip, analysis={"type": "path", "range": [0, 1.0]}))
    (note,) = path.notes
    factor = float(re.match(r"at factor (\S+) the law 'table' of section 's' ends at a curvature of 2 1/m", note)[1])
    # The first point beyond a moment of 1.6.
    assert factor == pytest.approx(min(f for f in path.main.factors if f > 0.8), rel=1e-5)


def test_stress_is_not_told():
    """Linear elastic stress would be false; strain by curvature alone too where the neutral axis moves."""
    found = sfetcas.solve(
        scene(
            section={**FLAT, "law": {"type": "plateau", "stress": STRESS}},
            load={"type": "moment", "node": "B", "value": 0.5},
        )
    )
    assert "bending_stress" not in found.last.to_dict()["members"]["beam"]


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"law": {"type": "bilinar", "moment": 1, "ratio": 0.1}, "EI3": 1.0}, "sections.s.law.type: found 'bilinar'"),
        (
            {"law": {**BILINEAR, "ratio": 0.0}, "EI3": 1.0},
            "sections.s.law.ratio: found 0, accepted: a number above zero",
        ),
        ({"law": BILINEAR, "GJ": 1.0}, "the key 'EI3' is missing: the law 'bilinear' begins with that stiffness"),
        ({"law": {**RAMBERG, "exponent": 1.0}, "EI3": 1.0}, "found 1, accepted: above 1"),
        ({"law": {**TABLE, "moment": [0, 1, 0.9, 2, 3]}}, "sections.s.law.moment: found 0.9 after 1, accepted: rising"),
        ({"law": {"type": "table", "curvature": [0.0], "moment": [0.0]}}, "accepted: two or more numbers from 0 on"),
        ({"law": {"type": "table", "curvature": [0.0, 1.0], "moment": [0.1, 1.0]}}, "found 0.1 at 0, accepted: 0"),
        ({"law": {"type": "table", "curvature": [0.0, 1.0], "moment": [0.0]}}, "found 1 entries beside 2"),
        ({"law": TABLE, "EI3": 1.0}, "found 'EI3' beside the law 'table', which says that stiffness"),
        ({"law": {"type": "plateau", "stress": 1.0}, "EI3": 1.0}, "found 'plateau' without a shape"),
        (
            {**WIRE, "law": {"type": "plateau", "stress": 1.0}},
            "found 'plateau' with a circle, accepted: with a rectangle",
        ),
        ({**FLAT, "law": {"type": "audoly-neukirch"}}, "accepted: a height of at most a fifth of the width"),
        ({"law": {**BILINEAR, "about": "both"}, "EI3": 1.0, "EI2": 2.0}, "the same stiffness about both axes"),
        ({"law": BILINEAR, **LINEAR, "coupling": [0.1, 0, 0]}, "found a law beside a coupling"),
        (
            {**FLAT, "law": {"type": "stress-strain", "strain": [0, 0.01], "stress": [0, 6e8], "about": "b3"}},
            "found a slope of 6e+10 at zero strain, accepted: E of the section, 7e+10",
        ),
        ({"law": {"type": "potential", "potential": lambda k: -ca.sumsqr(k)}}, "accepted: a potential that is convex"),
        (
            {"law": {"type": "potential", "potential": lambda k: ca.sumsqr(k) + k[2]}},
            "found moments of [0.0, 0.0, 1.0]",
        ),
        ({"law": {"type": "potential", "potential": lambda k: ca.norm_2(k)}}, "two derivatives at rest"),
        ({"law": {"type": "potential", "potential": 3.0}}, "found 3.0, accepted: a function of the three changes"),
    ],
)
def test_refused(section, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        scene(section=section)


@pytest.mark.parametrize("kind", ["rigid", "small"])
def test_members_that_do_not_bend_so(kind):
    with pytest.raises(SceneError, match=re.escape(f"found a section with the law 'bilinear' of a {kind} member")):
        scene(members={"beam": {"nodes": ["A", "B"], "section": "s", "type": kind}})


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_curvature_as_answer_of_parametric_solvers(dimension):
    """Of a bilinear law under a moment beyond its knee k = M0 + (M - M0) / 0.2, with its derivatives."""
    names, asked = ["loads.tip.value", "sections.s.law.moment"], "members.beam.curvature at 0.3"
    family = sfetcas.parametric(scene(BILINEAR, dimension=dimension), names, [asked])
    answer = family.solve({"sections.s.law.moment": 0.9})
    np.testing.assert_allclose(answer[asked], [0.0, 0.0, 0.9 + 0.6 / 0.2], atol=1e-9)
    slopes = [answer.jacobian[asked][name].ravel()[2] for name in names]
    np.testing.assert_allclose(slopes, [5.0, -4.0], atol=1e-8)


@pytest.mark.parametrize("law", [RAMBERG, None], ids=["ramberg-osgood", "ribbon"])
def test_curvatures_of_statics_and_parametric_solvers(law):
    """Both say the same on one mesh, under a force across both axes."""
    section, load = (RIBBON, [0.0, 0.004, -0.03]) if law is None else (given(law), [0.3, -0.8, 0.5])
    bent = scene(section=section, load=force(load), dimension="space")
    mesh, places = sfetcas.Settings(element="SFET5", elements=4), [0.0, 0.3, 0.9]
    asked = [f"members.beam.curvature at {x}" for x in places]
    found = sfetcas.parametric(bent, ["loads.tip.value"], asked, settings=mesh).solve()
    exact = sfetcas.solve(bent, mesh).last.along("beam", places)["curvature"]
    # Both to the residuals of their solvers.
    np.testing.assert_allclose([found[name] for name in asked], exact, atol=1e-8)


def test_files(tmp_path):
    """What is written is read again, also a potential."""
    for law in (TABLE, QUARTIC):
        one = scene(law)
        sfetcas.dump(one, tmp_path / "a.json")
        assert sfetcas.load(tmp_path / "a.json") == one
