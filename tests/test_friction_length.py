"""Friction of tendons whose length is given: closed forms, the runs with a given tension, work, and every analysis."""

import json
import re

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from test_codegen import built, needs_compiler, said
from test_friction import MU, ends, falling
from test_tendons import DIMENSIONS, EI, D, T, rod

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.cli import main
from sfetcas.solvers.globalised import Code

K = 600.0
"""Stiffness of a tendon, N/m."""


def tension(pull, mu=MU):
    """At the pulled end of a tendon parallel to the rod: its angle is ``pull / D``."""
    return EI * np.expm1(mu * pull / D) / (mu * D)


def free(k=K):
    """Free length of an elastic one under the tension T: of each part its length over ``1 + T / EA``."""

    def lacking(length):
        def share(s):
            return (1.0 - falling(s) * D**2 / EI) / (1.0 + falling(s) / (k * length))

        return quad(share, 0, 1, epsabs=1e-13)[0] - length

    return brentq(lacking, 0.5, 1.0, xtol=1e-15)


def stored(k=K):
    """Energy of that rod and tendon: half of force times strain over the free length."""
    length = free(k)

    def share(s):
        t = falling(s)
        return 0.5 * (t * D) ** 2 / EI + 0.5 * t**2 / (k * length) * (1.0 - t * D**2 / EI) / (1.0 + t / (k * length))

    return quad(share, 0, 1, epsabs=1e-13)[0]


@pytest.mark.parametrize(
    ("how", "dimension", "solver"),
    [
        *((how, "plane", "newton") for how in ("pull", "length", "pushes", "elastic", "elastic and pushes")),
        *((how, "space", "newton") for how in ("pull", "elastic")),
        ("pull", "plane", "ipopt"),
    ],
)
def test_the_tension_is_found(how, dimension, solver):
    """That of the closed form, and with it all that there is with the tension given."""
    place, angle = ends()
    pull = {"pull": 1.0 - free(), "stiffness": K} if how.startswith("elastic") else {"pull": D * angle}
    pull = {"length": 1.0 - D * angle} if how == "length" else pull
    scene = rod(dimension=dimension, friction=MU, pushes=how.endswith("pushes"), **pull)
    step = sfetcas.solve(scene, solver=solver, accuracy=1e-9).last
    told = step.tendon("t")
    # Each element loses at most 1e-10 rad of the turn.
    assert told["tension"] == pytest.approx(T, abs=1e-9)
    assert told["far_tension"] == pytest.approx(falling(1.0), abs=1e-9)
    np.testing.assert_allclose(step.position("B")[:2], place, atol=1e-9)
    x = np.array([0.1, 0.4, 0.9])
    np.testing.assert_allclose(step.along("m", x)["moment"][:, 2], falling(x) * D, atol=1e-9)
    bent = quad(lambda s: 0.5 * (falling(s) * D) ** 2 / EI, 0, 1, epsabs=1e-13)[0]
    exact = stored() if how.startswith("elastic") else bent
    assert step.to_dict()["energy"]["elastic"] == pytest.approx(exact, abs=1e-9)
    assert told.get("slack", False) is False
    assert step.certificate.stable == "not defined"


def test_around_a_rod():
    """A coil in space: with the length that a tension gives that tension comes back, on the same elements."""
    way = [{"member": "m", "helix": {"radius": 0.05, "turns": 0.5, "phase": 0.3}}]
    given = sfetcas.solve(rod(way, tension=T, friction=MU), element="SFET3", elements=2).last
    rest, told = given.fields.balance.rest_length("t"), given.tendon("t")
    scene = rod(way, pull=rest - told["length"], friction=MU, pushes=True)
    found = sfetcas.solve(scene, element="SFET3", elements=2).last
    for key in ("tension", "far_tension"):
        assert found.tendon("t")[key] == pytest.approx(told[key], rel=1e-9)
    np.testing.assert_allclose(found.position("B"), given.position("B"), atol=1e-11)


def test_work_is_stored_or_lost():
    """Work of the pull over a path from nothing, by eight Gauss points, which are exact to rounding for it.

    What is lost is friction times how far the tendon slides: beyond the place ``s`` the way has become shorter by ``D``
    times the angle that the rod turns from there on.
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    pulls, most = 0.5 * (nodes + 1.0), 0.05
    scene = rod(dimension="plane", pull=most, friction=MU, analysis={"steps": [*pulls.tolist(), 1.0], "accuracy": 1e-8})
    steps = sfetcas.solve(scene).steps
    work = 0.5 * most * sum(w * step.tendon("t")["tension"] for w, step in zip(weights, steps, strict=False))

    def slid(s, pull, h=1e-5):
        def beyond(p):
            return D * np.log((1 + MU * tension(p) * D / EI) / (1 + MU * tension(p) * D * s / EI)) / MU

        return (beyond(pull + h) - beyond(pull - h)) / (2.0 * h)

    def lost(pull):
        def rate(s):
            t = falling(s, MU, tension(pull))
            return MU * t * (t * D / EI) * slid(s, pull)

        return quad(rate, 0, 1)[0]

    exact = quad(lost, 0.0, most)[0]
    elastic = steps[-1].to_dict()["energy"]["elastic"]
    assert exact > 0.04 * work
    # Differences over 1e-5 are exact to their square.
    assert work - elastic == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("history", [None, {"t": [0, 2], "value": [0, 2]}])
def test_there_and_back(history):
    """Where it is let out both ends have changed: the tension rises from the pulled end on."""
    factors = [0.5, 1.0, 1.0, 0.5]
    scene = rod(pull=0.02, friction=MU, analysis={"steps": factors, "accuracy": 1e-8})
    if history is not None:
        scene = scene.replace({"histories": {"h": history}, "tendons.t.history": "h"})
    steps = sfetcas.solve(scene).steps
    for step, factor, released in zip(steps, factors, (False, False, False, True), strict=True):
        told, near = step.tendon("t"), tension(0.02 * factor)
        far = near * np.exp(-MU * 0.02 * factor / D)
        assert told["released"] is released
        # The accuracy asked for is that of positions.
        assert (told["tension"], told["far_tension"]) == pytest.approx((far, near) if released else (near, far), 1e-7)


def test_a_rod_that_is_pushed():
    """A shortening below zero lets out: what pushes has less at its far end; then pulled back, more."""
    steps = sfetcas.solve(rod(pull=-0.02, pushes=True, friction=MU, analysis={"steps": [1.0, 0.5], "accuracy": 1e-8}))
    out, back = (step.tendon("t") for step in steps.steps)
    exact = [-tension(0.02), -tension(0.02) * np.exp(-0.2 * MU)]
    assert (out["released"], out["tension"], out["far_tension"]) == (True, *(pytest.approx(one, 1e-7) for one in exact))
    exact = [-tension(0.01) * np.exp(-0.1 * MU), -tension(0.01)]
    assert (back["released"], back["tension"], back["far_tension"]) == (
        False,
        *(pytest.approx(one, 1e-7) for one in exact),
    )
    elastic = rod(length=1.02, pushes=True, stiffness=K, friction=MU)
    told = sfetcas.solve(elastic).last.tendon("t")
    assert told["tension"] < told["far_tension"] < 0.0
    assert told["released"]


def test_no_pull_is_none_that_lets_out():
    """Nor is rounding: what else pulls on the tendon finds it pulled."""
    for none in ({"pull": 0.0}, {"pull": -1e-15}, {"length": 1.0}, {"length": 1.0 + 1e-15}):
        scene = rod(dimension="plane", pushes=True, friction=MU, **none)
        scene = scene.replace({"loads": {"f": {"type": "force", "node": "B", "value": [0, -1]}}})
        told = sfetcas.solve(scene).last.tendon("t")
        assert told["released"] is False
        assert told["tension"] > told["far_tension"] > 0.0


def test_slack():
    """Let out too far it has no tension, in a sweep over a load without a gap of answers where it becomes slack."""
    for more in ({}, {"stiffness": K}):
        told = sfetcas.solve(rod(pull=-0.01, friction=MU, **more)).last.tendon("t")
        assert (told["tension"], told["far_tension"], told["slack"]) == (0.0, 0.0, True)
        assert told["length"] == pytest.approx(1.0)
        scene = rod(dimension="plane", pull=0.02, friction=MU, **more)
        scene = scene.replace({"loads": {"f": {"type": "force", "node": "B", "value": [0, 0]}}})
        found = [sfetcas.solve(scene.replace({"loads.f.value.1": f})).last.tendon("t") for f in (0.1, 0.5, 0.8, 0.82)]
        tensions = [told["tension"] for told in found]
        assert [told["slack"] for told in found] == [False, False, False, True]
        assert tensions[0] > tensions[1] > tensions[2] > tensions[3] == 0.0


def lever(**more):
    """A rigid quarter of a circle on a hinge with a spring, along which a tendon goes from the ground to the ground."""
    way = [{"ground": [-1, 0.1]}, {"member": "m", "offset": 0.1}, {"ground": [0.2, 1.6]}]
    arc = {"nodes": ["A", "B"], "section": "s", "type": "rigid", "shape": {"type": "arc", "angle": 0.5 * np.pi}}
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 1]}},
            "members": {"m": arc},
            "springs": {"k": {"node": "A", "stiffness": 20.0}},
            "tendons": {"t": {"way": way, "friction": MU, **more}},
        }
    )


def test_around_what_is_rigid():
    """The free length of an elastic one by hand, with the capstan's tension around a rigid quarter of a circle."""
    given = sfetcas.solve(lever(tension=T)).last
    angle, told = given.spring("k").travel, given.tendon("t")
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    into, out = turn @ [0.0, 0.1] - [-1.0, 0.1], np.array([0.2, 1.6]) - turn @ [0.9, 1.0]
    lengths = np.linalg.norm(into), np.linalg.norm(out)
    first = abs(np.arctan2(into[1], into[0]) - angle)
    last = first + 0.5 * np.pi + abs(np.arctan2(out[1], out[0]) - angle - 0.5 * np.pi)
    assert told["far_tension"] == pytest.approx(T * np.exp(-MU * last), rel=1e-9)
    k = 50.0

    def lacking(length):
        def under(turned):
            return 1.0 / (1.0 + T * np.exp(-MU * turned) / (k * length))

        arc = 0.9 * quad(lambda turned: under(first + turned), 0.0, 0.5 * np.pi, epsabs=1e-13)[0]
        return lengths[0] * under(0.0) + arc + lengths[1] * under(last) - length

    length = brentq(lacking, 1.0, 10.0, xtol=1e-14)
    for more in ({"length": length, "stiffness": k}, {"length": told["length"]}):
        found = sfetcas.solve(lever(**more)).last
        np.testing.assert_allclose(found.tendon("t")["tensions"], told["tensions"], rtol=1e-9)
        assert found.spring("k").travel == pytest.approx(angle, rel=1e-9)
    mirrored = [{"ground": [0.2, 1.6]}, {"member": "m", "offset": 0.1, "from": 1, "to": 0}, {"ground": [-1, 0.1]}]
    other = lever(length=length, stiffness=k, pulled_at="end").replace({"tendons.t.way": mirrored})
    np.testing.assert_allclose(sfetcas.solve(other).last.tendon("t")["tensions"], told["tensions"], rtol=1e-9)


def test_without_friction():
    """Zero friction tells the same tension at both ends, and is the limit of little."""
    for more in ({}, {"stiffness": K}):
        none, few = (sfetcas.solve(rod(pull=0.01, friction=mu, **more)).last for mu in (0.0, 1e-9))
        bare = sfetcas.solve(rod(pull=0.01, **more)).last
        np.testing.assert_array_equal(none.state.q, bare.state.q)
        assert none.tendon("t")["far_tension"] == none.tendon("t")["tension"] == bare.tendon("t")["tension"]
        assert none.tendon("t")["tensions"] == [none.tendon("t")["tension"]]
        assert "far_tension" not in bare.tendon("t")
        for end in ("tension", "far_tension"):
            assert few.tendon("t")[end] == pytest.approx(none.tendon("t")[end], abs=1e-9)
    scene = rod(tension=T, friction=0.0)
    family = sfetcas.parametric(scene, ["tendons.t.friction"], ["tendons.t.far_tension"])
    by_friction = family.solve({"tendons.t.friction": 0.0}).jacobian["tendons.t.far_tension"]["tendons.t.friction"]
    assert by_friction.item() == pytest.approx(-(T**2) * D / EI, rel=1e-8)
    assert Scene.from_dict(scene.to_dict()).tendons["t"].friction == 0.0


# -- analyses ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("more", [{"pushes": True}, {"stiffness": K}], ids=["pushes", "elastic"])
def test_path(more):
    analysis = {"type": "path", "range": [0, 3], "steps": [2.0]}
    scene = rod(dimension="plane", pull=0.01, friction=MU, **more)
    (step,) = sfetcas.solve(scene.replace(analysis=analysis), accuracy=1e-8).steps
    still = sfetcas.solve(scene.replace({"tendons.t.pull": 0.02}), accuracy=1e-8).last
    # The accuracy of both.
    np.testing.assert_allclose(step.position("B"), still.position("B"), atol=1e-7)
    for end in ("tension", "far_tension"):
        assert step.tendon("t")[end] == pytest.approx(still.tendon("t")[end], rel=1e-6)


@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha"])
@pytest.mark.parametrize("more", [{"pushes": True}, {"stiffness": K}], ids=["pushes", "elastic"])
def test_motion(integrator, more):
    """Pulled or let out slowly it is where statics has it, and it begins with the tension of its equilibrium."""
    for course, factors in (([0, 0, 0, 10, -15, 6], [1.0]), ([1, 0, 0, -5, 7.5, -3], [1.0, 0.5])):
        analysis = {"type": "dynamic", "end": 6.0, "output": 6.0, "integrator": integrator, "initial": "equilibrium"}
        scene = rod(dimension="plane", pull=0.02, friction=MU, **more)
        moving = scene.replace({"histories": {"h": {"t": [0, 6], "polynomial": [course]}}, "tendons.t.history": "h"})
        begin, end = sfetcas.solve(moving.replace(analysis=analysis)).steps
        still = sfetcas.solve(scene.replace(analysis={"steps": factors})).last
        assert end.tendon("t")["released"] is (len(factors) > 1)
        for key in ("tension", "far_tension"):
            # A thousandth is what swings.
            assert end.tendon("t")[key] == pytest.approx(still.tendon("t")[key], rel=1e-3)
        np.testing.assert_allclose(end.position("B"), still.position("B"), atol=1e-3)
        if len(factors) > 1:
            # Let out from the begin on, where both ends have changed.
            rest = sfetcas.solve(scene).last.tendon("t")
            assert begin.tendon("t")["far_tension"] == pytest.approx(rest["tension"], rel=1e-4)
            assert begin.tendon("t")["tension"] == pytest.approx(rest["far_tension"], rel=1e-4)


def test_steps_are_those_of_positions():
    """Tensions, which are unknowns beside them, make no step shorter."""
    histories = {"h": {"t": [0, 1], "polynomial": [[0, 0, 0, 10, -15, 6]]}}
    counts = []
    for more in ({"friction": MU}, {}):
        scene = rod(dimension="plane", pull=0.02, pushes=True, **more)
        moving = scene.replace({"histories": histories, "tendons.t.history": "h"})
        counts.append(sfetcas.solve(moving.replace(analysis={"type": "dynamic", "end": 1.5, "output": 1.5})).count)
    # Their errors would ask for three times as many.
    assert counts[0] <= 1.5 * counts[1]


@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha", "conserving"])
def test_an_elastic_string_begins_with_its_tension(integrator):
    """Without friction too: in equilibrium it keeps that at rest."""
    analysis = {"type": "dynamic", "end": 1.0, "output": 0.5, "integrator": integrator, "initial": "equilibrium"}
    scene = rod(dimension="plane", pull=0.02, stiffness=K)
    rest = sfetcas.solve(scene).last.tendon("t")["tension"]
    for step in sfetcas.solve(scene.replace(analysis=analysis)).steps:
        # Motions have a mesh of their own: the default accuracy.
        assert step.tendon("t")["tension"] == pytest.approx(rest, rel=1e-4)


@DIMENSIONS
@pytest.mark.parametrize("more", [{"pushes": True}, {"stiffness": K}], ids=["pushes", "elastic"])
def test_parameters(dimension, more):
    """Answers are those of statics, and derivatives those of differences."""
    asked = ["nodes.B.position", "tendons.t.tension", "tendons.t.far_tension", "members.m.moment at 0.3"]
    asked += ["energy.elastic"]
    scene = rod(dimension=dimension, pull=0.02, friction=MU, **more, analysis={"accuracy": 1e-8})
    names = ["tendons.t.friction", "tendons.t.pull", *(["tendons.t.stiffness"] if "stiffness" in more else [])]
    family, at = sfetcas.parametric(scene, names, asked), {"tendons.t.friction": 0.2, "tendons.t.pull": 0.03}
    answer = family.solve(at)
    step = sfetcas.solve(scene.replace(at)).last
    exact = [step.position("B"), *(step.tendon("t")[key] for key in ("tension", "far_tension"))]
    exact += [step.along("m", [0.3])["moment"][0], step.to_dict()["energy"]["elastic"]]
    for name, value in zip(asked, exact, strict=True):
        np.testing.assert_allclose(np.ravel(answer[name]), np.ravel(value), atol=1e-7)
    for name, h in zip(names, (1e-5, 1e-6, 1e-2), strict=False):
        middle = {**at, "tendons.t.stiffness": K} if len(names) == 3 else at
        low, high = (family.solve({**middle, name: middle[name] + sign * h}) for sign in (-1.0, 1.0))
        for one in asked:
            slope = (np.ravel(high[one]) - np.ravel(low[one])) / (2.0 * h)
            # Central differences: rounding over h, and h squared.
            np.testing.assert_allclose(np.ravel(answer.jacobian[one][name]), slope, rtol=1e-6, atol=1e-7)


def test_design():
    """What turns the end by half a radian is an offset times that."""
    found = sfetcas.find(
        rod(pull=0.02, pushes=True, friction=MU), {"tendons.t.pull": (1e-3, 0.2)}, {"nodes.B.angle": 0.5}
    )
    assert found.values["tendons.t.pull"] == pytest.approx(0.5 * D, rel=1e-6)


@needs_compiler
def test_exported_code(tmp_path):
    """Programs in C of an equilibrium and of a time step agree with the process of the same functions."""
    scene = rod(dimension="plane", pull=0.02, pushes=True, friction=MU)
    arguments, results = ["tendons.t.pull", "tendons.t.friction"], ["nodes.B.position", "tendons.t.far_tension"]
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=arguments, results=results)
    outcome, found = solver.solve([0.03, 0.2])
    assert outcome.code is Code.SOLVED
    step = sfetcas.solve(scene.replace({"tendons.t.pull": 0.03, "tendons.t.friction": 0.2})).last
    # The default accuracy of both meshes.
    np.testing.assert_allclose(found, [*step.position("B"), step.tendon("t")["far_tension"]], atol=1e-4)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words
    course = {"t": [0, 6], "polynomial": [[0, 0, 0, 10, -15, 6]]}
    analysis = {"type": "dynamic", "end": 6.0, "step": 0.05}
    moving = scene.replace({"histories": {"h": course}, "tendons.t.history": "h", "analysis": analysis})
    sfetcas.export(moving, tmp_path / "motion", name="motion", results=results)
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "motion", "motion"))


def pushed():
    """A force that may be controlled beside a tendon that rubs."""
    scene = rod(dimension="plane", pull=0.02, stiffness=K, friction=MU)
    scene = scene.replace({"loads": {"f": {"type": "force", "node": "B", "value": [0, 0.1]}}})
    return scene.replace(analysis={"type": "dynamic", "end": 1.0, "initial": "equilibrium"})


def test_optimal_control():
    """A replay takes an integrator that knows friction."""
    found = sfetcas.OptimalControl(pushed(), {"loads.f.value.1": (-1, 1)}, time=1.0, intervals=4).solve()
    assert found.replayed(tail=0.0).integrator == "radau-3"


def test_what_is_controlled():
    """The pull would let out as well, and a replay that conserves energy is refused."""
    with pytest.raises(SceneError, match=r"controls\.tendons\.t: found a control of a pull that may rise and fall"):
        sfetcas.OptimalControl(pushed(), {"tendons.t.pull": (0, 0.02)}, time=1.0, intervals=4).solve()
    held = {"loads.f.value.1": sfetcas.History(t=[0, 1], value=[0.1, 0.1])}
    with pytest.raises(SceneError, match="found 'conserving' with friction in the guides of a tendon"):
        sfetcas.respond(pushed(), held, 1.0, integrator="conserving")


def test_the_report_tells_both_ends(tmp_path, capsys):
    scene = rod(dimension="plane", pull=0.02, friction=MU, analysis={"steps": [1.0, 0.5]})
    (tmp_path / "scene.json").write_text(json.dumps(scene.to_dict()), encoding="utf-8")
    assert main(["run", str(tmp_path / "scene.json")]) == 0
    words = capsys.readouterr().out
    near, far = tension(0.01), tension(0.01) * np.exp(-0.1 * MU)
    assert re.search(r"tendon t: tension 4\.12\d+ N, far_tension 3\.88\d+ N, length 0\.98 m\n", words)
    assert re.search(rf"tension {far:.3f}\d+ N, far_tension {near:.3f}\d+ N, length 0\.99 m, released\n", words)


def test_refused():
    swings = {"h": {"t": [0, 1, 2], "value": [0, 1, 0], "interpolation": "spline"}}
    rises = {"h": {"t": [0, 2], "value": [0, 1]}}
    scene = rod(pull=0.02, pushes=True, friction=MU).replace({"histories": swings, "tendons.t.history": "h"})
    with pytest.raises(SceneError, match=r"found a pull that rises and falls, near the time 1, where friction would"):
        scene.replace(analysis={"type": "dynamic", "end": 2.0})
    slack = rod(pull=0.02, friction=MU)
    with pytest.raises(
        SceneError, match=r"tendons\.t\.friction: found with a given length in a motion, .*: pushes = true"
    ):
        slack.replace({"tendons.t.history": "h", "histories": rises, "analysis": {"type": "dynamic", "end": 2.0}})
    with pytest.raises(
        SceneError, match=r"tendons\.t: whether a tendon is slack .* without friction, accepted: pushes"
    ):
        sfetcas.parametric(slack, ["tendons.t.pull"], ["nodes.B.position"])
    with pytest.raises(SceneError, match=r"tendons\.t\.friction: found with modes, in which it would slide to and fro"):
        rod(pull=0.02, pushes=True, friction=MU, analysis={"type": "modes"})
