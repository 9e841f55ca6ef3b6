"""Tubes and members pushed out step after step: closed forms, shooting, snaps of a pendulum, hysteresis."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root
from test_codegen import built, needs_compiler, said
from test_tubes import TUBES, pair, robot, shot, twins

import sfetcas
from sfetcas import SceneError, SolveError
from sfetcas.cli import main
from sfetcas.equilibria.quantities import value_of
from sfetcas.mechanics.fields import transferred
from sfetcas.mechanics.mesh import first_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.mechanics.tubes import angles_along
from sfetcas.solvers.globalised import Code

# -- closed forms ------------------------------------------------------------------------------------


def arcs(*parts):
    """End of arcs (length, curvature), one after the other from the origin along x."""
    place, angle = np.zeros(2), 0.0
    for length, bend in parts:
        turned = angle + bend * length
        if bend:
            place = place + np.array([np.sin(turned) - np.sin(angle), np.cos(angle) - np.cos(turned)]) / bend
        else:
            place = place + length * np.array([np.cos(angle), np.sin(angle)])
        angle = turned
    return np.array([*place, 0.0])


def test_a_straight_member_is_bent_by_the_part_of_a_tube_that_is_in_front():
    """By two thirds of its curvature: each step of a sequence outwards and back."""
    task = {"steps": [0.25, 1.0, 0.5], "accuracy": 1e-9}
    scene = pair(own=0.0, GJ=1.0, length=0.6, start=-0.2, curved_from=0.1, insertion=0.5, analysis=task)
    for step in sfetcas.solve(scene).steps:
        base = -0.2 + 0.5 * step.factor
        begin, end = max(base + 0.1, 0.0), base + 0.6
        expected = arcs((begin, 0.0), (end - begin, 2.0), (1.0 - end, 0.0))
        np.testing.assert_allclose(step.position("B"), expected, atol=1e-9)
        assert step.certificate.stable
        assert not step.snaps


def test_a_member_grows_out_of_its_clamp():
    """A cantilever under its weight and an end force becomes longer: each step is that of the longer one."""
    scene = sfetcas.Scene.from_dict(
        {
            "gravity": [0, -2.0],
            "sections": {"s": {"EI3": 1.0, "rhoA": 0.5}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [0.5, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "insertion": 1.0, "insertion_history": "out"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [0, -1.0], "history": "still"}},
            "histories": {"out": {"t": [0, 2, 3], "value": [0, 1, 0.2]}, "still": {"t": [0, 1], "value": [1, 1]}},
            "analysis": {"steps": [1, 2, 3], "accuracy": 1e-8},
        }
    )
    for step, length in zip(sfetcas.solve(scene).steps, [1.0, 1.5, 0.7], strict=True):
        # Gravity grows with the factor: theta'' = (weight (length - s) + force) cos(theta).
        weight = 2.0 * 0.5 * step.factor

        def rate(s, y, weight=weight, length=length):
            return [y[1], (weight * (length - s) + 1.0) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        def shot_from(bend, rate=rate, length=length):
            return solve_ivp(rate, [0, length], [0.0, bend, 0.0, 0.0], rtol=1e-11, atol=1e-12).y[:, -1]

        end = shot_from(brentq(lambda bend: shot_from(bend)[1], -9.0, 0.0, xtol=1e-13))
        np.testing.assert_allclose(step.position("B"), [end[2], end[3], 0.0], atol=1e-8)


def test_a_column_that_grows_buckles_at_its_critical_length():
    """Euler's column, at pi / 2 times the root of stiffness over load; drawn in again it is straight again."""
    scene = sfetcas.Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "insertion": 1.0, "insertion_history": "out"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [-1, 0], "history": "still"}},
            "histories": {"out": {"t": [0, 1, 2], "value": [0, 1, 0]}, "still": {"t": [0, 1], "value": [1, 1]}},
            "analysis": {"steps": [0.7, 2]},
        }
    )
    buckled, again = sfetcas.solve(scene).steps
    # An eigenvalue counts as negative below 1e-7 of the stiffness of the column, which 3e-8 of the length bring.
    assert buckled.snaps == pytest.approx([0.5 * np.pi - 1.0], abs=1e-7)
    assert buckled.position("B")[1] < -0.5
    assert not again.snaps
    np.testing.assert_allclose(again.position("B"), [1.0, 0.0, 0.0], atol=1e-9)


# -- two equal tubes: a pendulum whose length grows ----------------------------------------------------

TURN, BEHIND = 2.0, 0.9
"""sqrt(c) of the pendulum theta'' = c sin(theta) of two equal tubes, 1/m, and length behind the members at first, m."""


def sliding(**changes):
    """Two equal tubes, one metre long, of which one is pushed in from behind the members by 0.9 m."""
    slides = {"tubes.t.rotation": 0.0, "tubes.t.start": -BEHIND, "tubes.t.insertion": BEHIND, "members.m.elements": 4}
    return twins(TURN).replace({**slides, **changes})


def test_opposed_tubes_part_where_the_pendulum_buckles():
    """They stay opposed until sqrt(c) tan(sqrt(c) L) = 2 / a, with the length L in each other and a behind.

    Behind the members a tube twists with its whole stiffness, where two are in each other with half of it.
    """
    behind = brentq(lambda a: TURN * np.tan(TURN * (1.0 - a)) - 2.0 / a, 0.25, 0.6)
    task = {"tubes.t.angle": np.pi, "analysis.steps": [0.6], "members.m.elements": 2}
    solution = sfetcas.solve(sliding(**task))
    parted = solution.last
    # Elements of a quarter of the length, as these are halved, leave 2e-8 of eigenvalues.
    assert parted.snaps == pytest.approx([1.0 - behind / BEHIND], abs=1e-7)
    assert "snapped at factor 0.54609" in parted.notes[0]
    assert "tubes.t.insertion 0.49148" in parted.notes[0]
    assert abs(parted.tube("t")["angle"] - np.pi) > 0.5
    assert parted.certificate.stable is True
    assert json.loads(json.dumps(solution.to_dict()))["steps"][0]["snaps"] == list(parted.snaps)


def test_parted_tubes_come_together_again():
    """Drawn back to where they were opposed, at the same place and without a snap."""
    parted, again = sfetcas.solve(sliding(**{"tubes.t.angle": np.pi, "analysis.steps": [0.7, 0.5]})).steps
    alone = sfetcas.solve(again.model.scene.replace({"analysis.steps": [0.5]})).last
    assert parted.snaps
    assert not again.snaps
    assert again.certificate.stable is True
    assert again.tube("t")["angle"] == pytest.approx(np.pi, abs=1e-5)
    np.testing.assert_allclose(again.position("B"), alone.position("B"), atol=1e-7)


def base_angle(end, length):
    """Angle of a base that holds the front at an angle, and its derivative by that, with the twist behind."""

    def rate(s, y):
        return [y[1], TURN**2 * np.sin(y[0]), y[3], TURN**2 * np.cos(y[0]) * y[2]]

    y = solve_ivp(rate, [0, length], [end, 0.0, 1.0, 0.0], rtol=1e-12, atol=1e-14).y[:, -1]
    behind = 1.0 - length
    return y[0] + 0.5 * behind * y[1], y[2] + 0.5 * behind * y[3]


def test_hysteresis_of_an_insertion():
    """Pushed in, turned beyond half a turn, drawn out: there the pair snaps, and pushed in again it stays snapped."""
    angle = 3.3
    histories = {
        "histories.turn": {"t": [0, 1, 2], "value": [0, 0, 1]},
        "histories.push": {"t": [0, 1, 2, 3, 4], "value": [0, 1, 1, 0.5, 1]},
        "tubes.t.rotation": angle,
        "tubes.t.history": "turn",
        "tubes.t.insertion_history": "push",
    }
    inside, turned, out, again = sfetcas.solve(sliding(**histories, **{"analysis.steps": [1, 2, 3, 4]})).steps
    assert inside.tube("t")["angle"] == pytest.approx(0.0, abs=1e-9)
    # The fold: no change of the base angle with that of the front.
    fold = root(lambda u: np.subtract(base_angle(*u), (angle, 0.0)), [1.9, 0.9], tol=1e-13)
    assert fold.success
    pushed = 1.0 - (1.0 - fold.x[1]) / BEHIND
    assert [step.snaps for step in (inside, turned, again)] == [(), (), ()]
    # Of the halves of the elements that are followed 1e-8 is left.
    assert out.snaps == pytest.approx([2.0 + (1.0 - pushed) / 0.5], abs=1e-7)
    # The same pose twice, on either branch.
    for step, side in ((turned, -1.0), (again, 1.0)):
        end = step.tube("t")["angle"]
        assert side * (end - np.pi) > 1.0
        assert base_angle(end, 1.0)[0] == pytest.approx(angle, abs=1e-5)
        assert step.certificate.stable is True


def test_an_unstable_state_may_be_kept():
    """With unstable = "stay" opposed tubes stay opposed."""
    task = {"steps": [0.7], "unstable": "stay"}
    kept = sfetcas.solve(sliding(**{"tubes.t.angle": np.pi, "analysis": task, "members.m.elements": 2})).last
    assert kept.certificate.negative == 1
    assert kept.tube("t")["angle"] == pytest.approx(np.pi, abs=1e-9)
    assert not kept.snaps


def test_a_fold_ends_the_way_where_no_snap_is_followed():
    """With unstable = "stay" there is no state to stay at; the sentence says where."""
    histories = {
        "histories.turn": {"t": [0, 1, 2], "value": [0, 0, 1]},
        "histories.push": {"t": [0, 1, 2, 3], "value": [0, 1, 1, 0.5]},
        "tubes.t.rotation": 3.3,
        "tubes.t.history": "turn",
        "tubes.t.insertion_history": "push",
    }
    with pytest.raises(
        SolveError,
        match=r"at factor 3: .* not be followed beyond factor 2\.3637.*insertion 0\.7363.*rotation 3\.3 rad",
    ) as e:
        sfetcas.solve(sliding(**histories, **{"analysis": {"steps": [2, 3], "unstable": "stay"}}))
    assert len(e.value.reached.steps) == 1


# -- three tubes ---------------------------------------------------------------------------------------

FORCE = (0.0, 0.1, -0.2)


def advanced(second=0.03, third=0.06):
    """A robot whose tubes are all pushed out, each at its own rate, and partly drawn back."""
    histories = {"all": {"t": [0, 1, 2], "value": [0, 1, 0.3]}, "still": {"t": [0, 1], "value": [1, 1]}}
    pushed = {"tubes.two.insertion": second, "tubes.three.insertion": third, "members.shaft.insertion": 0.02}
    named = {name.replace("insertion", "insertion_history"): "all" for name in pushed}
    held = {f"histories.{name}": history for name, history in histories.items()} | {"loads.f.history": "still"}
    return robot(FORCE).replace({**pushed, **named, **held, "analysis": {"steps": [0.4, 1.0, 2.0], "accuracy": 1e-8}})


@pytest.mark.parametrize("shares", [{0.7: 0.7}, {0.4: 0.4, 1.0: 1.0, 2.0: 0.3}], ids=["out", "sequence"])
def test_three_tubes_pushed_out_by_shooting(shares):
    """Bases come to the end of their guide, a front passes the node between two members, and the shaft grows."""
    scene = advanced().replace({"analysis.steps": [*shares]})
    for step, share in zip(sfetcas.solve(scene).steps, shares.values(), strict=True):
        tip, fronts, _ = shot(FORCE, (0.03 * share, 0.06 * share), 0.02 * share)
        assert not step.snaps
        np.testing.assert_allclose(step.position("tip"), tip, atol=1e-8)
        np.testing.assert_allclose([step.tube(name)["angle"] for name in TUBES], fronts, atol=1e-6)


def test_the_angle_of_a_front_goes_on_along_the_next_member():
    """Carried to where a tube has just passed a node, all of it is turned there as its front was before."""
    before, after = (robot().replace({"tubes.three.start": -0.04 + side * 1e-7}) for side in (-1.0, 1.0))
    step = sfetcas.solve(before).last
    target = assemble(after, first_mesh(after, 4))
    state = transferred(step.model, step.state, target)
    angles = np.append(state.y, 0.0)[target.positions.retained[:, 0]]
    base = TUBES["three"]["angle"]
    found, _, there = angles_along(target, "three", "end", np.array([0.0, 5e-7]), angles)
    assert there.all()
    np.testing.assert_allclose(found, step.tube("three")["angle"] - base, atol=1e-6)


def test_each_step_is_the_scene_by_itself():
    """Whatever the way there, as nothing snaps, also with bases that have left their guide."""
    for step in sfetcas.solve(advanced(0.045, 0.07)).steps:
        own = step.model.scene
        assert not own.inserts
        alone = sfetcas.solve(own.replace({"analysis.steps": [step.factor]})).last
        np.testing.assert_allclose(step.position("tip"), alone.position("tip"), atol=1e-8)
        for name in TUBES:
            assert step.tube(name) == pytest.approx(alone.tube(name), abs=1e-6)


# -- along tubes ---------------------------------------------------------------------------------------


def test_tubes_tell_what_they_carry_along_their_length():
    """Against shooting: turn and twist of both tubes at a section; nothing at the front, a constant torque behind."""
    step, where = sfetcas.solve(robot(FORCE), accuracy=1e-8).last, 0.07
    reached = shot(FORCE, at=where)[2]
    for i, (name, tube) in enumerate(TUBES.items(), start=1):
        share = (where - tube["start"]) / tube["length"]
        found = step.along_tube(name, [0.0, 0.01, share, 1.0])
        # Derivatives of angles are of lower order than these.
        assert found["turn"][2] == pytest.approx(reached[i], abs=1e-7)
        assert found["curvature"][2, 0] == pytest.approx(reached[3 + i], abs=1e-4)
        torque, told = found["moment"][:, 0], step.tube(name)
        np.testing.assert_allclose(torque[:2], -told["torque"], rtol=1e-6)
        assert torque[3] == pytest.approx(0.0, abs=1e-5 * abs(torque[0]))
        assert found["turn"][0] == tube["angle"]
        assert found["turn"][3] == pytest.approx(told["angle"], abs=1e-12)
        assert value_of(step, f"tubes.{name}.moment.b1 at 0.01") == pytest.approx(torque[1], rel=1e-9)
        # Strain energy: half the moments times what they bend, from one end to the other.
        listed = step.to_dict()["tubes"][name]
        at, moments = (np.array(listed[key]) for key in ("s", "moment"))
        assert at[0] == 0.0
        assert at[-1] == 1.0
        section = step.model.scene.sections[tube["section"]]
        x, w = np.polynomial.legendre.leggauss(6)
        energy = 0.0
        for a, b in zip(at, at[1:], strict=False):
            moments = step.along_tube(name, a + (b - a) * (0.5 + 0.5 * x))["moment"]
            firm = np.array([section.GJ, section.EI2, section.EI3])
            energy += 0.25 * (b - a) * tube["length"] * w @ (moments**2 / firm).sum(axis=1)
        assert energy == pytest.approx(told["energy"], rel=1e-5)


def test_all_tubes_together_carry_the_section_moment():
    """Turned into the axes of the member, with the moment of the member itself."""
    step, x = sfetcas.solve(robot(FORCE, b2=[0.0, 0.6, 0.8]), accuracy=1e-7).last, np.array([0.2, 0.35])
    line, found = step.model.scene.center_lines["end"], step.along("end", x)
    own = sfetcas.mathematics.quaternion.multiply(found["quaternion"], line.quaternions(x))
    frames = sfetcas.mathematics.quaternion.matrix(own)
    section = step.model.scene.sections["one"].stiffness_matrix(x)
    total = np.einsum("nij,nj->ni", section, found["curvature"] - line.curvatures(x))
    (run,) = [run for run in step.model.scene.tube_runs["two"] if run.member == "end"]
    inside = x < run.end
    assert inside.all()
    told = step.along_tube("two", (run.begin + x * line.length) / TUBES["two"]["length"])
    angle = told["turn"] - run.turned
    c, s = np.cos(angle), np.sin(angle)
    torque, second, third = told["moment"].T
    total += np.stack([torque, c * second - s * third, s * second + c * third], axis=1)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", frames, total), found["moment"], atol=1e-9)


# -- where a tube begins as a parameter -----------------------------------------------------------------


def test_the_start_of_a_tube_is_a_parameter():
    """Ends of elements go along, and with them the twist behind, the weight, and all that is told."""
    asked = ["nodes.B.position", "tubes.t.torque", "tubes.t.angle", "tubes.t.energy"]
    bent = {"length": 0.7, "curved_from": 0.3, "start": -0.2, "angle": 1.0, "analysis": {"accuracy": 1e-6}}
    scene = pair(own=0.0, GJ=1.0, **bent).replace(gravity=[0, 0, -0.3])
    family, at = sfetcas.parametric(scene, ["tubes.t.start"], asked), {"tubes.t.start": -0.12}
    answer, step = family.solve(at), sfetcas.solve(scene.replace(at)).last
    np.testing.assert_allclose(np.ravel(answer["nodes.B.position"]), step.position("B"), atol=2e-6)
    for key, value in step.tube("t").items():
        assert float(np.ravel(answer[f"tubes.t.{key}"])[0]) == pytest.approx(value, rel=1e-5, abs=1e-6)
    near = [np.ravel(family.solve({"tubes.t.start": x})["nodes.B.position"]) for x in (-0.12001, -0.11999)]
    told = answer.jacobian["nodes.B.position"]["tubes.t.start"]
    # Central differences of 0.01 mm, whose error falls with its square.
    np.testing.assert_allclose(np.ravel(told), (near[1] - near[0]) / 2e-5, rtol=1e-5, atol=1e-7)


def test_starts_of_several_tubes_are_parameters():
    """Along two members, each within a range of its own."""
    masses = {"sections.one.rhoA": 2.0, "sections.two.rhoA": 3.0, "sections.three.rhoA": 5.0}
    scene = robot(FORCE).replace({"gravity": [0, 0, -9.81], **masses, "analysis.accuracy": 1e-7})
    ranges = {"tubes.two.start": (-0.055, -0.025), "tubes.three.start": (-0.07, -0.05)}
    family = sfetcas.parametric(scene, ranges, ["nodes.tip.position"])
    at = {"tubes.two.start": -0.045, "tubes.three.start": -0.055}
    answer, step = family.solve(at), sfetcas.solve(scene.replace(at)).last
    np.testing.assert_allclose(np.ravel(answer["nodes.tip.position"]), step.position("tip"), atol=1e-8)
    for name, x in at.items():
        near = [np.ravel(family.solve(at | {name: x + h})["nodes.tip.position"]) for h in (-1e-5, 1e-5)]
        told = np.ravel(answer.jacobian["nodes.tip.position"][name])
        # Central differences of 0.01 mm, whose error falls with its square: 3e-7 here.
        np.testing.assert_allclose(told, (near[1] - near[0]) / 2e-5, rtol=2e-6)


def test_a_design_finds_how_far_a_tube_lies():
    """From the place of the tip back to the start that leads to it, along the member."""
    scene = pair(own=0.0, GJ=1.0, length=0.5, start=0.2, curved_from=0.1, dead=[0, 0, 0.2])
    wanted = sfetcas.solve(scene.replace({"tubes.t.start": 0.31}), accuracy=1e-8).last.position("B")
    design = sfetcas.Design(scene, {"tubes.t.start": (0.02, 0.4)})
    design.subject_to(design.answer("", "nodes.B.position")[1] == wanted[1])
    # The accuracy of the design over the slope of the place by the start, 0.8.
    assert design.solve().values["tubes.t.start"] == pytest.approx(0.31, abs=1e-4)


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C takes the start of a tube."""
    scene = pair(own=0.0, GJ=1.0, length=0.5, start=0.2, curved_from=0.1, analysis={"accuracy": 1e-4})
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["tubes.t.start"], results=["nodes.B.position"])
    outcome, found = solver.solve([0.31])
    assert outcome.code is Code.SOLVED
    np.testing.assert_allclose(found, arcs((0.41, 0.0), (0.4, 2.0), (0.19, 0.0)), atol=1e-4)
    assert "cases agree" in said(built(tmp_path / "c", "c"))


@pytest.mark.parametrize(
    ("changes", "asked", "words"),
    [
        ({"tubes.t.start": 0.0}, "tubes.t.start", "found 0, with which the tube begins, ends or becomes curved at 0 m"),
        ({"tubes.t.start": 0.5}, "tubes.t.start", "becomes curved at 1 m along its members, where something else does"),
        (
            {"sections.outer.GJ": {"at": [0, 1], "value": [1, 2]}},
            "tubes.t.start",
            "varies along it, accepted: one with",
        ),
        ({}, "tubes.t.length", "found a number that changes the elements, and with them the unknowns"),
        ({}, "tubes.t.insertion", "found a number that changes the elements, and with them the unknowns"),
        ({}, "members.m.insertion", "found a number that changes the elements, and with them the unknowns"),
    ],
)
def test_refused_parameters(changes, asked, words):
    """Where ends of elements would meet, or the section would be another one at each place."""
    with pytest.raises(SceneError) as refused:
        sfetcas.parametric(pair(length=0.5, start=0.2).replace(changes), [asked], ["nodes.B.position"])
    assert words in str(refused.value)


def test_refused_ranges():
    """Tubes that might meet, starts beyond what is beside them, and places within elements that move."""
    with pytest.raises(SceneError, match=r"found tubes.three.start and tubes.two.start, which may meet, accepted"):
        sfetcas.parametric(robot(), ["tubes.two.start", "tubes.three.start"], ["nodes.tip.position"])
    with pytest.raises(SceneError, match=r"found -0.2 to 0.1, accepted: a range between -0.07 and -0.01"):
        sfetcas.parametric(robot(), {"tubes.two.start": (-0.2, 0.1)}, ["nodes.tip.position"])
    with pytest.raises(SceneError, match=r"along a member on which a load or a tube moves, accepted: answers of nodes"):
        sfetcas.parametric(pair(length=0.5, start=0.2), ["tubes.t.start"], ["members.m.position at 0.5"])


# -- what is refused, and what shows it ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tubes.t.insertion": 0.6}, "tubes.t.insertion: at factor 0.875 found an end at 1.025 m along"),
        ({"tubes.t.insertion": -0.6}, "tubes.t.insertion: at factor 0.875 found a base at -0.525 m and a length of"),
        ({"tubes.t.insertion_history": "h"}, "tubes.t.insertion_history: found 'h', accepted: none, as the scene has"),
        ({"analysis.type": "modes"}, "found with the analysis 'modes', accepted: 'static', whose steps follow it"),
        ({"analysis": {"type": "path", "range": [0, 1]}}, "found with the analysis 'path', accepted: 'static'"),
        ({"analysis": {"type": "dynamic", "end": 1, "initial": "equilibrium"}}, "the analysis 'dynamic', accepted"),
        ({"analysis.equilibria": "all"}, "analysis.equilibria: found 'all', accepted: 'one' with tubes.t.insertion"),
        ({"members.m.insertion": 0.1, "members.m.shape": {"type": "arc", "angle": 1}}, "of the shape 'arc', accepted"),
        ({"members.m.insertion": -2.0, "tubes.t.insertion": 0}, "tubes.t.insertion: at factor 0.3125 found"),
        ({"members.m.insertion": 0.1, "nodes.B.support": "ball"}, "the node 'B' beyond it, which the ground holds"),
        ({"members.m.insertion": 0.1, "nodes.A.support": "ball"}, "the first node 'A', accepted: a clamped one"),
        ({"members.m.insertion": 0.1, "sections.inner.EI3": {"at": [0, 1], "value": [1, 2]}}, "which varies along"),
        (
            {"members.m.insertion": 0.1, "loads.g": {"type": "force", "member": "m", "at": 0.5, "value": [0, 1]}},
            "found the load 'g' on a part of it, accepted: nothing that keeps its place on a member that grows",
        ),
        (
            {
                "members.m.insertion": 0.1,
                "springs.s": {"type": "translational", "node": "B", "direction": [0, 1, 0], "stiffness": 1.0},
            },
            "found the translational spring 's', accepted: none beside a member that grows",
        ),
        (
            {
                "histories.h": {"t": [0, 1, 2], "polynomial": [[0, 0.5], [0.8, 0.1]]},
                "tubes.t.insertion_history": "h",
            },
            "tubes.t.insertion_history: found 'h', which jumps, accepted: a history without jumps",
        ),
        ({"tubes.t.angle": 1e30}, "tubes.t.angle: found 1e+30, accepted: an angle from -1e+06 to 1e+06 rad"),
        ({"tubes.t.rotation": 2.0, "analysis.steps": [1e7]}, "tubes.t.rotation: found 2e+07 rad for the factor 1e+07"),
    ],
)
def test_refused(changes, words):
    """Each with a sentence that names it."""
    with pytest.raises(SceneError) as refused:
        pair(own=0.0, length=0.5, insertion=0.1).replace(changes)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda s: sfetcas.parametric(s, ["tubes.t.angle"], ["nodes.B.position"]),
        lambda s: sfetcas.export(s, "never", arguments=["tubes.t.angle"]),
        lambda s: sfetcas.assemble(s, sfetcas.first_mesh(s, 4)),
        lambda s: sfetcas.Design(s),
    ],
    ids=["parametric", "export", "assemble", "design"],
)
def test_what_knows_no_steps(call):
    """What knows one pose only refuses one that changes from step to step."""
    with pytest.raises(SceneError, match=r"tubes.t.insertion: found 0.1, .* knows no steps, accepted: solve"):
        call(pair(own=0.0, length=0.5, insertion=0.1))


def test_pictures_are_of_each_step():
    """The band of a tube is where it is then."""
    pytest.importorskip("matplotlib").use("Agg")
    from test_plotting import drawn

    (line,) = drawn(sfetcas.solve(PUSHED).last.plot(), "tube-t")
    assert [line[0, 0], line[-1, 0]] == pytest.approx([0.4, 0.9], abs=1e-6)


def test_info_is_of_the_scene_before(tmp_path, capsys):
    """``sfetcas info`` counts the unknowns at factor 0."""
    (tmp_path / "scene.json").write_text(json.dumps(PUSHED.to_dict()))
    assert main(["info", str(tmp_path / "scene.json")]) == 0
    assert "angles of tubes" in capsys.readouterr().out


PUSHED = pair(own=0.0, other=0.0, GJ=1.0, length=0.5, insertion=0.4)
"""A straight tube on a straight member."""
