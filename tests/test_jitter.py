"""Answers do not hang on rounding: not on the last digits, nor on order, axes or units."""

import numpy as np
import pytest
from scenes import made

import sfetcas
from benchmarks.jitter import answered, differences, jittered
from benchmarks.random_scenes import random_scene


def pressed(space=False, supports=("clamped", "clamped"), force=60.0, **more):
    """A straight column in two members, pressed beyond its critical load: its twins have the same energy."""
    first, last = supports
    end = {"position": [1, 0, 0], "support": "slider", "direction": [1, 0, 0]}
    return made(
        {
            "dimension": "space" if space else "plane",
            "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
            "nodes": {
                "A": {"position": [0, 0, 0], "support": first},
                "M": {"position": [0.5, 0, 0]},
                "B": end if last == "clamped" else {**end, "rotation": "hinge"},
            },
            "members": {"b": {"nodes": ["M", "B"], "section": "s"}, "a": {"nodes": ["A", "M"], "section": "s"}},
            "loads": {"p": {"type": "force", "node": "B", "value": [-force, 0, 0]}},
            **more,
        }
    )


def bar_on_springs():
    """A bar on equal springs along three axes at both ends: frequencies of shapes in which nothing turns are equal."""
    return made(
        {
            "dimension": "space",
            "nodes": {
                "A": {"position": [0, 0, 0], "mass": 1.0, "inertia": [1, 1, 1]},
                "B": {"position": [1, 0, 0], "mass": 1.0},
            },
            "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
            "springs": {
                f"{node}{i}": {
                    "type": "translational",
                    "node": node,
                    "stiffness": 2.0,
                    "direction": np.eye(3)[i].tolist(),
                }
                for node in "AB"
                for i in range(3)
            },
            "analysis": {"type": "modes", "modes": 4},
        }
    )


SCENES = {
    "bar on equal springs": bar_on_springs(),
    "mechanism that falls far": random_scene(229),
    "motion that asks for what there is not": random_scene(258),
    "symmetric column": pressed(),
    "round column in space": pressed(space=True),
    "plane, random": random_scene(2010),
    "space, random": random_scene(2011),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_same_answer_after_what_nobody_means(name):
    scene = SCENES[name]
    first = answered(scene)
    assert differences(scene, jittered(scene, 1), first) == []


@pytest.mark.parametrize("seed", [0, 2])
def test_a_ladder_stands_in_whatever_axes_and_units(seed):
    """Newton's method may lead first to where it has slid down far and would stand again."""
    analysis = {"accuracy": 1e-5, "steps": [0.1]}
    scene = sfetcas.load("problems/ladder_pushed_down.toml").replace(analysis=analysis, expect=[])
    assert differences(scene, jittered(scene, seed)) == []


def test_twins_are_chosen_by_a_rule_and_told():
    """The start of the member that comes first in the alphabet turns towards +z, whatever the file's order is."""
    step = sfetcas.solve(pressed()).last
    assert any("mirror image" in note for note in step.notes)
    assert step.along("a", [0.5])["angle"][0] > 0.3
    # Named the other way round it is the second half that turns like that first: by the names alone, the other twin.
    table = pressed().to_dict()
    table["members"]["c"] = table["members"].pop("a")
    assert sfetcas.solve(made(table)).last.along("c", [0.5])["angle"][0] < -0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_small_load_across_chooses_the_twin_and_nothing_is_told(side):
    """1e-6 of the load is far beyond the gap of 1e-9 within which energies are the same."""
    loads = {
        "p": {"type": "force", "node": "B", "value": [-60.0, 0, 0]},
        "q": {"type": "force", "node": "M", "value": [0, 6e-5 * side, 0]},
    }
    step = sfetcas.solve(pressed(loads=loads)).last
    assert side * step.position("M")[1] > 0.1
    assert not any("mirror image" in note for note in step.notes)


def test_jitter_changes_every_number_but_not_the_scene():
    scene = SCENES["space, random"]
    change = jittered(scene, 3)
    for name, node in scene.nodes.items():
        there = np.array(change.scene.nodes[name].position)
        apart = np.abs(change.back(there, 1) - node.position).max() / scene.size
        assert 0.0 < apart < 1e-12
    assert list(change.scene.nodes) != list(scene.nodes)


@pytest.mark.parametrize("direction", [(6, -8), (-6, -8), (5, -12), (7, -24)])
def test_what_stands_upright_stays_or_leaves_by_the_rule_in_whatever_axes(direction):
    """A pendulum begun upright: along axes that no binary number gives, rounding leads it off."""
    gravity = 9.81 * np.array(direction) / np.linalg.norm(direction)
    up = -gravity / 9.81
    table = {
        "gravity": gravity.tolist(),
        "sections": {"s": {"rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": up.tolist()}},
        "members": {"rod": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "analysis": {"unstable": "stay"},
    }
    stays = sfetcas.solve(made(table)).last
    assert stays.certificate.stable is False
    assert stays.angle("B") == pytest.approx(0.0, abs=1e-9)
    # Between a spring that pulls it up and its weight there are two places of the same energy.
    spring = {"type": "translational", "node": "B", "stiffness": 20.0, "anchor": (2.0 * up).tolist()}
    leaves = sfetcas.solve(made({**table, "springs": {"k": spring}, "analysis": {}})).last
    assert leaves.certificate.stable is True
    assert leaves.angle("B") > 0.1
    # Without it half a turn, not two and a half, as IPOPT takes it in long steps.
    falls = sfetcas.solve(made({**table, "analysis": {}})).last
    assert falls.angle("B") == pytest.approx(np.pi, abs=1e-6)
