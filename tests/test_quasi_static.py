"""Quasi-static trajectories: against statics of single points, closed forms, and a snap that is known."""

from pathlib import Path

import numpy as np
import pytest

from sfetcas import (
    Analysis,
    CrossSection,
    Load,
    Member,
    Motion,
    Node,
    QuasiStatic,
    Scene,
    SceneError,
    SolveError,
    changed,
    load,
    solve,
)

FOLDER = Path(__file__).parent.parent / "problems"


def cantilever(force=(0, 1)):
    """1 m, 1 N m2, a force at the tip."""
    return Scene(
        sections={"strip": CrossSection(EI3=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="strip")},
        loads={"tip": Load(type="force", node="tip", value=force)},
        analysis=Analysis(accuracy=1e-6),
    )


def test_tip_follows_a_circle():
    path = QuasiStatic(cantilever(), {"loads.tip.value": (-60.0, 60.0)}, points=7)
    tip, angle = path.answer("nodes.tip.position"), 0.5 * np.pi * path.s
    path.subject_to(tip[:, 0] == 0.55 + 0.1 * np.cos(angle), tip[:, 1] == 0.7 + 0.05 * np.sin(angle))
    answer = path.solve()
    assert answer.jumps == ()
    assert answer.stable
    for i in (2, 6):
        there = solve(changed(cantilever(), {"loads.tip.value": answer.inputs["loads.tip.value"][i]})).last
        wanted = 0.55 + 0.1 * np.cos(angle[i]), 0.7 + 0.05 * np.sin(angle[i])
        # Both meshes are within 1e-6 of the length.
        assert there.position("tip")[:2] == pytest.approx(wanted, abs=3e-6)


def test_a_mechanism_in_space_follows_its_output():
    """The crank that turns the rocker of a loop of hinges, which count turns."""
    scene = load(FOLDER / "fourbar_hinges_in_space.toml")
    scene = scene.replace(expect=(), analysis=Analysis(steps=[30.0]))
    path = QuasiStatic(scene, {"factor": (-400.0, 400.0)}, points=4, accuracy=1e-6)
    rocker = solve(scene).last.spring("foot").to_dict()["angle"] + 0.3 * path.s
    path.subject_to(path.answer("springs.foot.angle") == rocker)
    answer = path.solve()
    there = solve(answer.scene(3)).last
    # Rigid links: to rounding, and what IPOPT leaves.
    assert there.spring("foot").to_dict()["angle"] == pytest.approx(rocker[-1], abs=1e-8)
    assert answer.jumps == ()
    assert (np.diff(answer.inputs["factor"][:, 0]) > 0.0).all()


def test_smoothest_input_between_two_values_is_a_straight_line():
    """Of second derivatives nothing is less than none."""
    path = QuasiStatic(cantilever(), {"loads.tip.value.1": (-10.0, 10.0)}, points=6)
    force = path.input("loads.tip.value.1")
    path.subject_to(path.at(force, 0.0) == 0.5, path.at(force, 1.0) == 3.0)
    path.smooth("loads.tip.value.1")
    found = path.solve().inputs["loads.tip.value.1"].ravel()
    # The mean of squares is flat: its root is what IPOPT leaves.
    assert found == pytest.approx(0.5 + 2.5 * path.s, abs=1e-4)


def test_rates_are_limited():
    """At rest until the fastest rate just reaches the end: the least sum."""
    path = QuasiStatic(cantilever(), {"loads.tip.value.1": (0.0, 10.0)}, points=5)
    force = path.input("loads.tip.value.1")
    path.subject_to((path.rate(force) <= 4.0) >= -4.0, name="rate")
    path.subject_to(path.at(force, 1.0) == 3.0)
    path.minimise(sum(force[i] for i in range(5)))
    found = path.solve().inputs["loads.tip.value.1"].ravel()
    assert found == pytest.approx([0.0, 0.0, 1.0, 2.0, 3.0], abs=1e-6)


def test_a_variable_is_the_same_everywhere():
    path = QuasiStatic(
        cantilever(), {"loads.tip.value.1": (0.0, 10.0)}, points=3, variables={"sections.strip.EI3": (0.2, 5.0)}
    )
    tip = path.answer("nodes.tip.position")
    path.subject_to(tip[:, 1] == np.array([0.1, 0.2, 0.3]), path.at(path.input("loads.tip.value.1"), 1.0) == 2.0)
    answer = path.solve()
    stiffness = answer.values["sections.strip.EI3"][0]
    for i, height in enumerate((0.1, 0.2, 0.3)):
        force = answer.inputs["loads.tip.value.1"][i]
        there = changed(cantilever(), {"sections.strip.EI3": stiffness, "loads.tip.value.1": force})
        assert solve(there).last.position("tip")[1] == pytest.approx(height, abs=3e-6)
    assert force == pytest.approx(2.0, abs=1e-8)


def test_a_jump_is_reported():
    """Prescribed numbers drive a strip between clamps over the load at which it buckles to the other side."""
    scene = Scene(
        sections={"strip": CrossSection(EI3=1.0)},
        nodes={
            "foot": Node(position=[0, 0], support="clamped"),
            "head": Node(position=[1, 0], support="clamped"),
        },
        members={"strip": Member(nodes=["foot", "head"], section="strip")},
        motions={"press": Motion(node="head", displacement=[-0.1, 0.0], rotation=0.0)},
        loads={"side": Load(type="distributed", member="strip", value=[0, 30])},
        analysis=Analysis(accuracy=1e-5),
    )
    sides = np.linspace(30.0, -270.0, 7)[:, None]
    path = QuasiStatic(scene, {"loads.side.value.1": (-300.0, 300.0)}, points=7, guess={"loads.side.value.1": sides})
    path.subject_to(path.input("loads.side.value.1") == sides)
    answer = path.solve()
    middle = [case.along("strip", [0.5])["position"][0, 1] for case in answer.cases]
    snapped = tuple(i for i in range(1, 7) if middle[i] * middle[i - 1] < 0.0)
    assert len(snapped) == 1
    assert answer.jumps == snapped
    assert "is not the one that the point before leads to" in answer.notes[-1]


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        (lambda: QuasiStatic(cantilever(), {"loads.tip.value": (0, 1)}, points=2), "found 2, accepted: three or more"),
        (lambda: QuasiStatic(cantilever(), {}), "inputs: found none"),
        (lambda: QuasiStatic(cantilever(), {"loads.tip.value": (0, 1)}).input("tip"), "found 'tip'"),
        (lambda: QuasiStatic(cantilever(), {"loads.tip.value": (0, 1)}).smooth("loads.tip.value", order=3), "found 3"),
        (
            lambda: (path := QuasiStatic(cantilever(), {"loads.tip.value": (0, 1)}, 5)).at(
                path.input("loads.tip.value"), 0.3
            ),
            "found 0.3, accepted: a multiple of 0.25",
        ),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(action, sentence):
    with pytest.raises(SceneError) as caught:
        action()
    assert sentence in str(caught.value)


def test_an_end_that_cannot_be_reached_is_named():
    path = QuasiStatic(cantilever(), {"loads.tip.value.1": (0.0, 5.0)}, points=3)
    path.subject_to(path.at(path.answer("nodes.tip.position"), 1.0)[1] >= 0.9, name="end")
    with pytest.raises(SolveError, match="most is missed at end") as caught:
        path.solve()
    assert caught.value.last.inputs["loads.tip.value.1"][-1] == pytest.approx(5.0, rel=1e-3)
