"""Snapping structures: all states against paths, the default answer against small steps, pressure, and the words."""

import json
import math
import re

import numpy as np
import pytest
from scenes import cantilever, made

from sfetcas import Scene, SceneError, assemble, solve, solve_model, switch, uniform_mesh
from sfetcas.cli import main
from sfetcas.equilibria.mirrors import mirrored, mirrors
from sfetcas.mathematics import quaternion
from sfetcas.mechanics.rotations import RotationFreedom
from sfetcas.solvers.prepared import Prepared

SPAN, STIFFNESS = 0.4, 0.35


def arch(**parts):
    return Scene(**arch_table(**parts))


def arch_table(support="hinge", rise=0.08, side=0.0, dimension="plane", **analysis):
    """Two halves of a circular arch of steel strip 20 x 1 mm, pressed down at the crown by 1 N times the factor."""
    half, z = 0.5 * SPAN, [0.0] if dimension == "space" else []
    angle = 2.0 * math.atan2(rise, half)
    foot = {"support": support} | ({"axis": [0, 0, 1]} if z and support == "hinge" else {})
    half_arch = {"section": "strip", "shape": {"type": "arc", "angle": -angle}}
    return {
        "dimension": dimension,
        "sections": {"strip": {"shape": "rectangle", "width": 0.02, "height": 0.001, "E": 2.1e11, "nu": 0.3}},
        "nodes": {
            "left": {"position": [-half, 0, *z], **foot},
            "crown": {"position": [0, rise, *z]},
            "right": {"position": [half, 0, *z], **foot},
        },
        "members": {"a": {"nodes": ["left", "crown"], **half_arch}, "b": {"nodes": ["crown", "right"], **half_arch}},
        "loads": {"f": {"type": "force", "node": "crown", "value": [side, -1.0, *z]}},
        "analysis": analysis,
    }


def toggle(support="clamped", **analysis):
    """Two straight strips that meet at an angle: they snap through by buckling."""
    straight = {"section": "s"}
    table = {
        "sections": {"s": {"EI3": STIFFNESS}},
        "nodes": {
            "left": {"position": [-0.2, 0], "support": support},
            "crown": {"position": [0, 0.08]},
            "right": {"position": [0.2, 0], "support": support},
        },
        "members": {"a": {"nodes": ["left", "crown"], **straight}, "b": {"nodes": ["crown", "right"], **straight}},
        "loads": {"f": {"type": "force", "node": "crown", "value": [0, -1.0]}},
        "analysis": analysis,
    }
    return Scene(**table)


def column(**analysis):
    """Clamped and pressed at 20 degrees from its axis."""
    turn = math.radians(160.0)
    return Scene(**cantilever((math.cos(turn), math.sin(turn))) | {"analysis": analysis})


def bow(**analysis):
    """A clamped strip with the shape of a shallow bow, which stands on either side without load."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": BOW}},
        "loads": {"f": {"type": "force", "member": "m", "at": 0.5, "value": [0, -1.0]}},
        "analysis": analysis,
    }
    return Scene(**table)


BOW = {"type": "spline", "points": [[0, 0], [0.1, 0.007], [0.3, 0.04], [0.5, 0.06], [0.7, 0.04], [0.9, 0.007], [1, 0]]}

CASES = {
    "hinged arch": (arch, {}, 20.0),
    "hinged arch near its limit": (arch, {}, 60.0),
    "hinged arch pulled up": (arch, {}, -20.0),
    "hinged arch, force inclined": (arch, {"side": 0.05}, 30.0),
    "shallow hinged arch": (arch, {"rise": 0.03}, 10.0),
    "clamped arch": (arch, {"support": "clamped"}, 60.0),
    "clamped arch in space": (arch, {"support": "clamped", "dimension": "space"}, 60.0),
    "straight strips, clamped": (toggle, {}, 20.0),
    "straight strips, hinged": (toggle, {"support": "hinge"}, 20.0),
    "clamped bow": (bow, {}, 20.0),
    "inclined column": (column, {}, 30.0),
}
"""Scene, what it is made of, and the factor at which all states are asked for."""

SLOW = (
    "straight strips, hinged",
    "hinged arch near its limit",
    "hinged arch pulled up",
    "hinged arch, force inclined",
    "shallow hinged arch",
    "clamped arch in space",
)
"""Others of their kind say the same in less time."""


def shape(step):
    return np.vstack([step.along(name, np.linspace(0.05, 0.95, 10))["position"] for name in step.model.scene.members])


@pytest.mark.parametrize("name", [name for name in CASES if name not in SLOW])
def test_all_finds_each_state_that_paths_pass(name):
    make, parts, factor = CASES[name]
    several = [shape(step) for step in solve(make(**parts, steps=[factor], equilibria="all")).steps]
    wide = max(3.0 * abs(factor), 100.0)
    path = solve(make(**parts, type="path", range=[-wide, wide], steps=[factor], branches=6, points=300))
    assert len(path.steps) > 0
    # Both are as accurate as asked for, 1e-4 of the size; states that a path passes lie far apart.
    near = 4e-4 * path.scene.size
    for crossing in path.steps:
        assert min(np.abs(shape(crossing) - other).max() for other in several) < near


def test_all_finds_the_state_that_has_snapped_through():
    steps = solve(arch(steps=[18.0], equilibria="all")).steps
    stable = sorted(step.position("crown")[1] for step in steps if step.certificate.stable is True)
    assert len(stable) == 2
    # By symmetry the crown stays in the middle; the snapped arch hangs below its feet.
    assert stable[0] < -0.08 < 0.0 < stable[1]


# -- the default answer ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def buckling():
    """The factor at which the symmetric states of the hinged arch bifurcate, before their limit."""
    (found, *_) = solve(arch(type="path", range=[0, 100], accuracy=1e-6)).bifurcations
    return found.factor


@pytest.mark.parametrize("share", [0.3, 0.97, 0.999])
def test_below_the_limit_the_default_answer_is_where_small_steps_from_zero_lead(share, buckling):
    factor = share * buckling
    answer = solve(arch(steps=[factor]), accuracy=1e-7).last
    scene = arch()
    prepared, step = Prepared(assemble(scene, uniform_mesh(scene, 6, 4))), None
    for part in np.linspace(0.0, factor, 40):
        step = solve_model(prepared, part, start=step)
    assert not answer.notes
    # Newton's method from the state before, on a mesh with errors of 1e-6 of the size.
    np.testing.assert_allclose(answer.position("crown"), step.position("crown"), atol=1e-6)


@pytest.mark.parametrize("share", [1.001, 1.1, 2.0])
def test_above_the_limit_the_default_answer_has_snapped_and_says_where(share, buckling):
    answer = solve(arch(steps=[share * buckling])).last
    assert answer.certificate.stable is True
    assert answer.position("crown")[1] < -0.08
    (note,) = answer.notes
    told = float(re.search(r"jumped near factor ([0-9.e+]+):", note)[1])
    # The way is followed until a stable and an unstable state are 2 % apart; the number has three digits.
    assert told == pytest.approx(buckling, rel=0.025)


def test_steps_in_sequence_tell_the_factor_of_the_jump_and_come_back_to_the_first_branch(buckling):
    steps = solve(arch(steps=[60.0, 70.0, 80.0, 60.0])).steps
    assert [bool(step.notes) for step in steps] == [False, True, False, False]
    told = float(re.search(r"near factor ([0-9.e+]+):", steps[1].notes[0])[1])
    # Here too: until stable and unstable are 2 % of the way apart, which is shorter.
    assert told == pytest.approx(buckling, rel=0.025)
    np.testing.assert_allclose(steps[3].position("crown"), steps[0].position("crown"), atol=1e-9)


# -- pressure -------------------------------------------------------------------------------------


def half_ring(**analysis):
    hinge = {"support": "hinge"}
    table = {
        "sections": {"r": {"EI3": 0.175}},
        "nodes": {"a": {"position": [0.1, 0], **hinge}, "b": {"position": [-0.1, 0], **hinge}},
        "members": {"u": {"nodes": ["a", "b"], "section": "r", "shape": {"type": "arc", "angle": math.pi}}},
        "loads": {"p": {"type": "distributed", "member": "u", "value": [0, 1], "frame": "section"}},
        "analysis": analysis,
    }
    return Scene(**table)


CRITICAL = 3.0 * 0.175 / 0.1**3
"""Of a hinged half ring, ``(pi^2 / a^2 - 1) EI / R^3`` with half its angle a (Timoshenko and Gere)."""


def test_an_unstable_arch_under_pressure_is_left_like_under_any_other_load():
    before, after = (solve(half_ring(steps=[share * CRITICAL])).last for share in (0.99, 1.3))
    stayed = solve(half_ring(steps=[1.3 * CRITICAL], unstable="stay")).last
    assert before.certificate.stable is True
    assert not before.notes
    assert after.certificate.stable is True
    told = float(re.search(r"jumped near factor ([0-9.e+]+):", after.notes[0])[1])
    # Followed until stable and unstable are 2 % apart.
    assert told == pytest.approx(CRITICAL, rel=0.025)
    assert stayed.certificate.negative == 1
    # The ring is a circle, which pressure does not change, until it buckles.
    np.testing.assert_allclose(stayed.along("u", [0.5])["position"][0, :2], [0.0, 0.1], atol=1e-9)


def test_what_pressure_leads_to_lies_on_the_branch_that_crosses_there():
    factor = 1.3 * CRITICAL
    left = solve(half_ring(steps=[factor]), accuracy=1e-6).last
    path = solve(half_ring(type="path", range=[0, 1.5 * CRITICAL], steps=[factor], accuracy=1e-6))
    branches = [switch(path, 1, side) for side in (1, -1)]
    middles = [step.along("u", [0.5])["position"][0] for branch in branches for step in branch.steps]
    found = left.along("u", [0.5])["position"][0]
    # Both to 1e-6 of the size of 0.2, twice that at most.
    assert min(np.abs(found - middle).max() for middle in middles) < 4e-7


def test_an_arch_snaps_through_under_pressure():
    table = arch_table(steps=[100.0, 600.0])
    even = {"type": "distributed", "value": [0, -1], "frame": "section"}
    before, after = solve(Scene(**table | {"loads": {name: {**even, "member": name} for name in "ab"}})).steps
    # Pressure leaves a circle as it is.
    np.testing.assert_allclose(before.position("crown")[:2], [0.0, 0.08], atol=1e-9)
    assert after.position("crown")[1] < -0.08
    assert after.certificate.stable is True
    assert "jumped near factor" in after.notes[0]


def test_an_unstable_state_that_no_way_leads_from_says_so():
    """A torque twists a rod for ever: beyond its buckling load it loops through itself again and again."""
    slider = {"support": "slider", "direction": [1, 0, 0], "rotation": "hinge", "axis": [1, 0, 0]}
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.3, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0, 0], **slider},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"M": {"type": "moment", "node": "B", "value": [11.0, 0, 0]}},
    }
    answer = solve(Scene(**table)).last
    assert answer.certificate.negative > 0
    assert any("no way from it to a stable one was found" in note for note in answer.notes)


# -- what the search refuses, and what it does not ------------------------------------------------


def test_all_says_truly_why_it_refuses_pressure_and_followers():
    with pytest.raises(SceneError, match="the energy of pressure"):
        solve(half_ring(steps=[100.0], equilibria="all"))
    table = cantilever((0.0, 1.0), analysis={"equilibria": "all"})
    (load,) = table["loads"].values()
    load["frame"] = "follower"
    with pytest.raises(SceneError, match="loads without potential have no energy"):
        solve(Scene(**table))


def strip(moment=0.5, **analysis):
    """A strip on a sprung hinge, turned in its stiff direction by a moment and buckled in the other one."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 0.5, "EI3": 5.0, "GJ": 1.0}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "hinge", "axis": [0, 0, 1]}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "springs": {"k": {"node": "A", "stiffness": 20.0, "axis": [0, 0, 1]}},
        "loads": {
            "M": {"type": "moment", "node": "A", "value": [0, 0, moment]},
            "P": {"type": "force", "node": "B", "value": [-3.0, 0, 0]},
        },
        "analysis": analysis,
    }
    return Scene(**table)


def test_moments_about_hinges_in_space_are_searched_and_left():
    steps = solve(strip(equilibria="all")).steps
    assert [step.certificate.negative for step in steps] == [0, 0, 1]
    up, down = (step.position("B") for step in steps[:2])
    # Mirror images in the plane of the moment, to the default accuracy of each.
    np.testing.assert_allclose(up, down * [1, 1, -1], atol=2e-4)
    assert "jumped near factor" in steps[0].notes[0]
    # Out of the plane the strip is a column: EI2 pi^2 / 4 L^2, slightly less as the moment turns it.
    told = float(re.search(r"near factor ([0-9.e+]+):", steps[0].notes[0])[1])
    assert told * 3.0 == pytest.approx(0.125 * math.pi**2, rel=0.03)


def test_mirrored_rotations_of_hinges_in_space_stay_about_their_axes():
    scene = strip()
    prepared = Prepared(assemble(scene, uniform_mesh(scene, 4, 4)), kernels="interpreted")
    loading = prepared.model.loading(1.0)
    rng = np.random.default_rng(2)
    state = prepared.equations.start(loading)
    state = prepared.equations.moved(state, rng.standard_normal(prepared.equations.total))
    rotations = prepared.model.rotations
    about = rotations.kind == RotationFreedom.AXIS
    assert about.any()
    images = mirrors(prepared.model)
    assert len(images) > 1
    for image in images:
        turned = quaternion.rotate(mirrored(prepared.model, state, image).q[about], rotations.axis[about])
        np.testing.assert_allclose(turned, rotations.axis[about], atol=1e-12)


# -- words ----------------------------------------------------------------------------------------


def test_how_the_search_was_done_is_told_once():
    steps = solve(column(steps=[30.0], equilibria="all")).steps
    assert len(steps) > 1
    told = [any("a scan of the angle" in note for note in step.notes) for step in steps]
    assert told == [True] + [False] * (len(steps) - 1)


def test_switch_takes_a_whole_path():
    path = solve(arch(type="path", range=[0, 70]))
    with pytest.raises(SceneError, match="path: found a Branch, accepted: the answer of a scene"):
        switch(path.branches[0])
    with pytest.raises(SceneError, match="path: found a Solution"):
        switch(solve(arch()))


def test_a_closed_branch_is_told_once_and_no_stretch_of_it_at_one_factor(tmp_path, capsys):
    # The branch meets its mirror image at its lowest factor, where both sides are unstable: no stretch of its own.
    file = tmp_path / "arch.json"
    file.write_text(json.dumps(arch_table(type="path", range=[-150, 200], branches=1)))
    main(["run", str(file)])
    said = capsys.readouterr().out
    assert said.count("it closes on itself") == 1
    assert said.count("factor -35.3757438") == 1
    assert not re.search(r"from factor (\S+) to \1$", said, re.MULTILINE)


def toggle(start, unstable, **analysis):
    """Two arcs, joined rigidly and hinged at their feet: snapped through they stay there without a load."""
    hinge, bow = {"support": "hinge"}, {"type": "arc", "angle": -0.58291}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "a": {"position": [0, 0], **hinge},
            "crown": {"position": [0.5, 0.15], "start": start},
            "b": {"position": [1, 0], **hinge},
        },
        "members": {
            "l": {"nodes": ["a", "crown"], "section": "s", "shape": bow},
            "r": {"nodes": ["crown", "b"], "section": "s", "shape": bow},
        },
        "loads": {"p": {"type": "force", "node": "crown", "value": [0, -1.0]}},
        "analysis": {"unstable": unstable, **analysis},
    }
    return made(table)


@pytest.mark.parametrize(
    ("start", "unstable", "ways"), [([0.5, -0.15], "leave", 0), ([0.5, 0.0], "stay", 1), ([0.5, 0.0], "leave", 0)]
)
def test_start_places_choose_the_same_equilibrium_in_statics_and_on_a_path(start, unstable, ways):
    """Below, or the unstable one between: found by Newton's method from the start, not by sliding down from it."""
    step = solve(toggle(start, unstable)).last
    path = solve(toggle(start, unstable, type="path", range=[0, 1], points=40))
    assert step.certificate.negative == ways
    height = step.position("crown")[1]
    assert height < -0.1 if start[1] else abs(height) < 0.08 if ways else height > 0.1
    # Both to 1e-4 of the scene's size.
    np.testing.assert_allclose(path.last.position("crown"), step.position("crown"), atol=2e-4)
    assert any("start places" in note for note in path.notes)


def test_straight_columns_that_snap_say_so():
    """Three hinged columns joined at the top, once statically indeterminate: they bend at no load but the critical."""
    places = {"a": -0.5, "b": 0.0, "c": 0.5}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"top": {"position": [0, 0]}}
        | {name: {"position": [x, -1], "support": "hinge"} for name, x in places.items()},
        "members": {name: {"nodes": ["top", name], "section": "s"} for name in places},
        "loads": {"p": {"type": "force", "node": "top", "value": [0, -1]}},
    }
    below = solve(made(table | {"analysis": {"steps": [23.0]}})).last
    np.testing.assert_allclose(below.position("top"), 0.0, atol=1e-9)
    snapped = solve(made(table | {"analysis": {"steps": [60.0]}})).last
    jumps = [re.search(r"jumped near factor ([0-9.e+]+):", note) for note in snapped.notes]
    told = [float(jump[1]) for jump in jumps if jump]
    critical = solve(made(table | {"analysis": {"type": "path", "range": [0, 30]}})).bifurcations[0].factor
    # The way is followed until a stable and an unstable state are 2 % apart.
    assert told[0] == pytest.approx(critical, rel=0.025)
    assert snapped.position("top")[1] < -0.5


@pytest.mark.parametrize("turns", [1, 2, 5])
def test_what_snaps_while_a_lever_turns_round_stays_snapped(turns):
    """The lever's spring pulls the arch through on each turn and is too soft to push it back when it comes again."""
    rise = 0.15
    half = {"section": "s", "shape": {"type": "arc", "angle": -2.0 * np.arctan(rise)}}
    scene = made(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {
                "L": {"position": [-1, 0], "support": "hinge"},
                "M": {"position": [0, rise]},
                "R": {"position": [1, 0], "support": "hinge"},
                "O": {"position": [0, -1.7], "support": "hinge"},
                "P": {"position": [0, -0.9]},
            },
            "members": {
                "a": {"nodes": ["L", "M"], **half},
                "b": {"nodes": ["M", "R"], **half},
                "lever": {"nodes": ["O", "P"], "type": "rigid"},
            },
            "springs": {"s": {"type": "translational", "node": "P", "to": "M", "stiffness": 3.0, "length": 0.9 + rise}},
            "motions": {"round": {"node": "O", "rotation": 2.0 * np.pi * turns}},
        }
    )
    step = solve(scene).last
    assert step.position("M")[1] < -rise
    assert sum("jumped" in note for note in step.notes) == 1
