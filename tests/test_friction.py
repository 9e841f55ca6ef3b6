"""Friction of tendons in their guides: closed forms, shooting, a scene with a tendon for each piece, and every
analysis."""

import re

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, root
from test_codegen import built, needs_compiler, said
from test_tendons import DIMENSIONS, EI, D, T, robot, rod

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.mathematics import quaternion
from sfetcas.solvers.globalised import Code

MU = 0.3
"""Coefficient of friction."""


def falling(s, mu=MU, tension=T):
    """Tension along a rod bent by a tendon parallel to it, ``T' = -mu T kappa`` with ``kappa = T d / EI``."""
    return tension / (1.0 + mu * tension * D * s / EI)


def ends(mu=MU, tension=T):
    """End of that rod, and its angle there."""

    def angle(s):
        return np.log1p(mu * tension * D * s / EI) / mu

    return np.array([quad(lambda s, f=f: f(angle(s)), 0, 1, epsabs=1e-13)[0] for f in (np.cos, np.sin)]), angle(1.0)


@DIMENSIONS
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
def test_along_a_rod(dimension, solver):
    """The closed form; what sections carry is stiffness times curvature."""
    step = sfetcas.solve(rod(dimension=dimension, tension=T, friction=MU), solver=solver, accuracy=1e-9).last
    place, angle = ends()
    # Each element loses at most 1e-10 rad of the turn.
    np.testing.assert_allclose(step.position("B")[:2], place, atol=1e-9)
    assert step.tendon("t")["far_tension"] == pytest.approx(falling(1.0), abs=2e-9)
    assert step.tendon("t")["tension"] == pytest.approx(T, abs=1e-12)
    assert step.tendon("t")["length"] == pytest.approx(1.0 - D * angle, abs=1e-9)
    x = np.array([0.1, 0.4, 0.9])
    along = step.along("m", x)
    np.testing.assert_allclose(along["moment"][:, 2], falling(x) * D, atol=1e-9)
    turned = np.log1p(MU * T * D * x / EI) / MU
    np.testing.assert_allclose(along["force"][:, 0], -falling(x) * np.cos(turned), atol=1e-8)
    np.testing.assert_allclose(step.reaction("A"), 0.0, atol=1e-9)
    assert step.certificate.stable == "not defined"


def test_the_other_end_and_backwards():
    """Pulled at the other end it is the mirror image, whichever way the way is told."""
    for way, end in (((0, 1), "end"), ((1, 0), "start")):
        parts = [{"member": "m", "offset": D, "from": way[0], "to": way[1]}]
        step = sfetcas.solve(rod(parts, tension=T, friction=MU, pulled_at=end), accuracy=1e-9).last
        x = np.array([0.2, 0.7])
        np.testing.assert_allclose(step.along("m", x)["moment"][:, 2], falling(1.0 - x) * D, atol=1e-9)


def test_without_friction_nothing_is_added():
    """Zero friction is no friction, in the unknowns and to the last bit of the answer; the limit is the same."""
    for scene in (rod(tension=T), robot(True)):
        none = scene.replace({f"tendons.{name}.friction": 0.0 for name in scene.tendons})
        one, other = (sfetcas.solve(each).last for each in (scene, none))
        assert one.model.unknowns == other.model.unknowns
        np.testing.assert_array_equal(one.state.q, other.state.q)
    few = sfetcas.solve(rod(tension=T, friction=1e-9), accuracy=1e-9).last
    np.testing.assert_allclose(few.position("B"), sfetcas.solve(rod(), accuracy=1e-9).last.position("B"), atol=1e-9)


def test_steps():
    """Pulled while the tension rises, let out where it falls, and as before where it stays."""
    factors, out = [0.5, 1.0, 1.0, 0.5, 0.5, 1.0], [False, False, False, True, True, False]
    for history in (None, {"t": [0, 2], "value": [0, 2]}):
        scene = rod(tension=T, friction=MU, analysis={"steps": factors, "accuracy": 1e-8})
        if history is not None:
            scene = scene.replace({"histories": {"h": history}, "tendons.t.history": "h"})
        for step, factor, released in zip(sfetcas.solve(scene).steps, factors, out, strict=True):
            told = step.tendon("t")
            far = falling(1.0, -MU if released else MU, factor * T)
            assert (told["released"], told["far_tension"]) == (released, pytest.approx(far, abs=1e-8))


def test_helix():
    """A tendon wound around a rod, against shooting with the tension as a further unknown of the equations.

    The section says the curvature of the rod by the tension, the curvature of the way says how the tension falls.
    """
    stiffness, rate, radius = np.array([1.5, EI, EI]), 3.0 * np.pi, 0.05
    way = [{"member": "m", "helix": {"radius": radius, "turns": 1.5, "phase": 0.3}}]

    def section(s, tension):
        angle = 0.3 + rate * s
        offset = radius * np.array([0.0, np.cos(angle), np.sin(angle)])
        slope = radius * rate * np.array([0.0, -np.sin(angle), np.cos(angle)])

        def along(k):
            found = np.array([1.0, 0.0, 0.0]) + np.cross(k, offset) + slope
            return found / np.linalg.norm(found)

        k = root(lambda k: stiffness * k + np.cross(offset, tension * along(k)), np.zeros(3), tol=1e-14).x
        return k, along(k)

    def fall(s, tension):
        k, tau = section(s, tension)
        step = 1e-4
        by_s = (section(s + step, tension)[1] - section(s - step, tension)[1]) / (2 * step)
        by_tension = (section(s, tension + step)[1] - section(s, tension - step)[1]) / (2 * step)

        def missing(slope):
            return slope + MU * tension * np.linalg.norm(by_s + by_tension * slope + np.cross(k, tau))

        return k, brentq(missing, -50.0, 0.0, xtol=1e-12)

    def slope(s, state):
        k, by_s = fall(s, state[7])
        spin = 0.5 * quaternion.multiply(state[3:7], np.array([0.0, *k]))
        return np.concatenate([quaternion.rotate(state[3:7], np.array([1.0, 0.0, 0.0])), spin, [by_s]])

    x = np.array([0.1, 0.35, 0.8, 1.0])
    begin = [0, 0, 0, 1, 0, 0, 0, 12.0]
    exact = solve_ivp(slope, (0.0, 1.0), begin, t_eval=x, rtol=1e-8, atol=1e-9, method="DOP853").y
    step = sfetcas.solve(rod(way, tension=12.0, friction=MU), accuracy=1e-8).last
    # Differences over 1e-4 are exact to their square.
    np.testing.assert_allclose(step.position("B"), exact[:3, -1], atol=1e-7)
    # The accuracy asked for is that of positions; what the way turns is of lower order by one.
    assert step.tendon("t")["far_tension"] == pytest.approx(exact[7, -1], rel=1e-6)
    assert exact[7, -1] < 4.0
    bent = [section(at, tension)[0] for at, tension in zip(x, exact[7], strict=True)]
    np.testing.assert_allclose(step.along("m", x)["curvature"], bent, atol=1e-6)


def test_order_of_convergence():
    """Elements of five nodes half as long: the turn of the way is of fourth order, as it has a derivative more."""
    way = [{"member": "m", "helix": {"radius": 0.05, "turns": 1.5, "phase": 0.3}}]
    scene = rod(way, tension=12.0, friction=MU)
    exact = sfetcas.solve(scene, accuracy=1e-9).last.tendon("t")["far_tension"]
    coarse, fine = (
        abs(sfetcas.solve(scene, element="SFET5", elements=n).last.tendon("t")["far_tension"] - exact) for n in (8, 16)
    )
    # Half-way between third and fourth order.
    assert coarse > 2.0**3.5 * fine


# -- eyelets -------------------------------------------------------------------------------------------


def test_discs():
    """Friction at discs, by a scene with a tendon of its own for each gap, whose tensions are found by iteration."""
    offset, tension, count = [0.06, 0.04], 8.0, 3
    way = [{"ground": [-0.2, 0.3, 0.1]}, {"member": "m", "offset": offset, "discs": count}]
    step = sfetcas.solve(rod(way, tension=tension, friction=MU), accuracy=1e-9).last
    tensions = np.full(count + 1, tension)
    for _ in range(30):
        ways = [[way[0], {"member": "m", "offset": offset, "discs": [0.0]}]]
        ways += [[{"member": "m", "offset": offset, "discs": [i / count, (i + 1) / count]}] for i in range(count)]
        gaps = {f"t{k}": {"way": ways[k], "tension": each} for k, each in enumerate(tensions.tolist())}
        found = sfetcas.solve(rod(tendons=gaps), accuracy=1e-9).last
        along = found.along("m", np.linspace(0.0, 1.0, count + 1))
        holes = along["position"] + quaternion.rotate(along["quaternion"], np.array([0.0, *offset]))
        parts = np.diff(np.vstack([way[0]["ground"], holes]), axis=0)
        parts /= np.linalg.norm(parts, axis=1)[:, None]
        turned = np.arccos((parts[1:] * parts[:-1]).sum(axis=1))
        before, tensions = tensions, tension * np.exp(-MU * np.concatenate([[0.0], np.cumsum(turned)]))
        if np.abs(tensions - before).max() < 1e-10:
            break
    np.testing.assert_allclose(step.tendon("t")["tensions"], tensions, rtol=1e-8)
    np.testing.assert_allclose(step.position("B"), found.position("B"), atol=1e-8)
    np.testing.assert_allclose(step.along("m", [0.4])["moment"], found.along("m", [0.4])["moment"], atol=1e-7)
    assert tensions[-1] < 0.75 * tension


def lever(**more):
    """A rigid lever about a hinge with a spring, which a string pulls that goes through an eyelet of its."""
    return Scene.from_dict(
        {
            "dimension": more.pop("dimension", "plane"),
            "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "hinge", "axis": [0, 0, 1]},
                "B": {"position": [1, 0]},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "springs": {"k": {"node": "A", "stiffness": 2.0}},
            "tendons": {
                "t": {
                    "way": [{"ground": [0.5, 1.0]}, {"node": "B", "offset": [0, 0.1]}, {"ground": [1.5, 0.6]}],
                    "tension": T,
                    "friction": MU,
                }
            },
            **more,
        }
    )


@DIMENSIONS
def test_a_lever(dimension):
    """An eyelet of a rigid lever by hand: moments of both pieces, with tensions by the angle between them."""

    def pieces(angle):
        hole = np.array([np.cos(angle) - 0.1 * np.sin(angle), np.sin(angle) + 0.1 * np.cos(angle)])
        to, on = np.array([0.5, 1.0]) - hole, np.array([1.5, 0.6]) - hole
        to, on = to / np.linalg.norm(to), on / np.linalg.norm(on)
        return hole, to, on, np.exp(-MU * np.arccos(-to @ on))

    def missing(angle):
        hole, to, on, share = pieces(angle)
        force = T * (to + share * on)
        return hole[0] * force[1] - hole[1] * force[0] - 2.0 * angle

    exact = brentq(missing, 0.0, 0.7, xtol=1e-14)
    step = sfetcas.solve(lever(dimension=dimension)).last
    np.testing.assert_allclose(step.position("B")[:2], [np.cos(exact), np.sin(exact)], atol=1e-9)
    far = T * pieces(exact)[3]
    np.testing.assert_allclose(step.tendon("t")["tensions"], [T, far], atol=1e-8)
    _, to, on, share = pieces(exact)
    np.testing.assert_allclose(step.reaction("A")[0][:2], -T * (to + share * on), atol=1e-8)


def test_along_what_is_rigid():
    """Around a rigid quarter of a circle, and where straight pieces meet it."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 1]}},
            "members": {
                "m": {
                    "nodes": ["A", "B"],
                    "section": "s",
                    "type": "rigid",
                    "shape": {"type": "arc", "angle": 0.5 * np.pi},
                }
            },
            "tendons": {
                "t": {
                    "way": [{"ground": [-1, 0.1]}, {"member": "m", "offset": 0.1}, {"ground": [2, 2]}],
                    "tension": T,
                    "friction": MU,
                }
            },
        }
    )
    step = sfetcas.solve(scene).last
    last = np.array([2.0, 2.0]) - [0.9, 1.0]
    turned = 0.5 * np.pi + np.arctan2(last[0], last[1])
    exact = [T, T * np.exp(-MU * 0.5 * np.pi), T * np.exp(-MU * turned)]
    np.testing.assert_allclose(step.tendon("t")["tensions"], exact, rtol=1e-8)
    # The clamp holds what both ends pull.
    pulled = T * np.array([-1.0, 0.0]) + exact[2] * last / np.linalg.norm(last)
    np.testing.assert_allclose(step.reaction("A")[0][:2], -pulled, atol=1e-8)
    # Half-way: what is beyond pulls at the cut, but for the string itself.
    force = exact[2] * last / np.linalg.norm(last) - T * np.exp(-MU * 0.25 * np.pi) * np.sqrt(0.5)
    np.testing.assert_allclose(step.along("m", [0.5])["force"][0][:2], force, atol=1e-8)


# -- analyses ------------------------------------------------------------------------------------------


def test_path():
    scene = rod(dimension="plane", tension=T, friction=MU, analysis={"type": "path", "range": [0, 3], "steps": [2.0]})
    (step,) = sfetcas.solve(scene, accuracy=1e-8).steps
    np.testing.assert_allclose(step.position("B")[:2], ends(tension=2.0 * T)[0], atol=1e-7)


@pytest.mark.parametrize(
    ("integrator", "dimension"), [("radau-3", "plane"), ("generalised-alpha", "plane"), ("radau-2", "plane")]
)
def test_motion(integrator, dimension):
    """Pulled slowly it is where statics says, but for what swings; let out, where statics lets it out."""
    for course, steps in (([0, 0, 0, 10, -15, 6], [1.0]), ([1, 0, 0, -5, 7.5, -3], [1.0, 0.5])):
        history = {"h": {"t": [0, 6], "polynomial": [course]}}
        analysis = {"type": "dynamic", "end": 6.0, "output": 6.0, "integrator": integrator, "initial": "equilibrium"}
        scene = rod(dimension=dimension, tension=T, friction=MU, analysis=analysis).replace(
            {"histories": history, "tendons.t.history": "h"}
        )
        first, last = sfetcas.solve(scene).steps
        still = sfetcas.solve(rod(dimension="plane", tension=T, friction=MU, analysis={"steps": steps})).last
        assert last.tendon("t")["released"] is (len(steps) > 1)
        assert last.tendon("t")["far_tension"] == pytest.approx(still.tendon("t")["far_tension"], rel=2e-3)
        np.testing.assert_allclose(last.position("B"), still.position("B"), atol=2e-3)
        if len(steps) > 1:
            assert first.tendon("t")["far_tension"] == pytest.approx(falling(1.0, -MU), rel=1e-4)


@DIMENSIONS
def test_parameters(dimension):
    """Answers and their derivatives by tension and friction, also from and to none."""
    asked = ["nodes.B.position", "tendons.t.far_tension", "members.m.moment at 0.3", "members.m.force at 0.3"]
    scene = rod(dimension=dimension, tension=T, friction=MU, analysis={"accuracy": 1e-8})
    family = sfetcas.parametric(scene, ["tendons.t.friction", "tendons.t.tension"], asked)
    answer = family.solve({"tendons.t.friction": 0.2, "tendons.t.tension": 2.0})
    np.testing.assert_allclose(np.ravel(answer[asked[0]])[:2], ends(0.2, 2.0)[0], atol=1e-8)
    far = falling(1.0, 0.2, 2.0)
    assert answer[asked[1]] == pytest.approx(far, abs=1e-8)
    np.testing.assert_allclose(np.ravel(answer[asked[2]])[2], falling(0.3, 0.2, 2.0) * D, atol=1e-8)
    by_friction = answer.jacobian["tendons.t.far_tension"]["tendons.t.friction"].item()
    assert by_friction == pytest.approx(-(far**2) * D / EI, abs=1e-7)
    step = sfetcas.solve(scene.replace({"tendons.t.friction": 0.2, "tendons.t.tension": 2.0})).last
    np.testing.assert_allclose(np.ravel(answer[asked[3]]), step.along("m", [0.3])["force"][0], atol=1e-7)
    none = family.solve({"tendons.t.friction": 0.0})
    plain = sfetcas.solve(rod(dimension=dimension), accuracy=1e-8).last
    np.testing.assert_allclose(np.ravel(none[asked[0]]), plain.position("B"), atol=1e-8)


def test_design():
    """What turns the end by half a radian, against the closed form."""
    found = sfetcas.find(rod(tension=T, friction=MU), {"tendons.t.tension": (1e-3, 20.0)}, {"nodes.B.angle": 0.5})
    assert found.values["tendons.t.tension"] == pytest.approx(np.expm1(0.5 * MU) * EI / (MU * D), rel=1e-5)


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C agrees with the process of the same functions, and with statics."""
    way = [{"ground": [-0.3, 0.2]}, {"member": "m", "offset": D, "from": 0.3, "to": 1.0}]
    scene = rod(way, "plane", tension=T, friction=MU)
    arguments, results = ["tendons.t.tension", "tendons.t.friction"], ["nodes.B.position", "tendons.t.far_tension"]
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=arguments, results=results)
    outcome, found = solver.solve([T, 0.2])
    assert outcome.code is Code.SOLVED
    step = sfetcas.solve(scene.replace({"tendons.t.friction": 0.2})).last
    exact = [*step.position("B"), step.tendon("t")["far_tension"]]
    # The default accuracy of both meshes.
    np.testing.assert_allclose(found, exact, atol=1e-4)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


# -- what is refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pull", "words"),
    [
        ({"pressure": 1.0, "area": 1.0}, "tendons.t.friction: found with a pressure"),
        ({"stiffness": 1.0}, "tendons.t.friction: found without a pull, accepted: with a tension, a pull or a length"),
        ({"tension": 1.0, "friction": None, "pulled_at": "end"}, "tendons.t.pulled_at: found without a friction"),
        ({"tension": 1.0, "pulled_at": "tip"}, "tendons.t.pulled_at: found 'tip', accepted"),
        ({"tension": 1.0, "friction": -0.1}, "tendons.t.friction: found -0.1, accepted: zero or a number above zero"),
    ],
)
def test_refused(pull, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        rod(**{"friction": MU, **pull})


def test_refused_analyses():
    """Where a tendon would slide to and fro, and where friction has no place."""
    scene = rod(tension=T, friction=MU)
    swings = {"h": {"t": [0, 1, 2], "value": [0, 1, 0]}}
    for analysis, words in (
        ({"type": "modes"}, "tendons.t.friction: found with modes, in which it would slide to and fro"),
        ({"type": "dynamic", "end": 1.0, "integrator": "idas"}, "found 'idas' with friction in the guides"),
        ({"type": "dynamic", "end": 2.0}, "found a tension that rises and falls, near the time 1, where friction"),
        ({"type": "path", "range": [0, 2]}, "found a tension that rises and falls, near the factor 1, where friction"),
    ):
        with pytest.raises(SceneError, match=words):
            scene.replace({"histories": swings, "tendons.t.history": "h", "analysis": analysis})
    with pytest.raises(SceneError, match=r"tendons\.t\.friction: found Gauss integration"):
        sfetcas.solve(scene, gauss=True)
    moving = scene.replace(analysis={"type": "dynamic", "end": 1.0})
    with pytest.raises(SceneError, match=r"controls\.tendons\.t: found a control of a tension that may rise and fall"):
        sfetcas.OptimalControl(moving, {"tendons.t.tension": (0, 1)}, time=1.0, intervals=4).solve()
