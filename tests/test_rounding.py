"""Decisions near rounding: what is certain either way is told apart from it, in whatever units."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import made, model_of

import sfetcas
from sfetcas.description.scene import Scene
from sfetcas.solvers import newton
from sfetcas.solvers.divergence import TangentTest
from sfetcas.solvers.prepared import Prepared


def hinged_lever(spring: float, beside: float = 0.0) -> Scene:
    """A lever on a hinge with a spring (N m/rad), alone or with a cantilever of stiffness ``beside`` next to it."""
    table = {
        "sections": {"s": {"EI3": 1.0}, "stiff": {"EI3": beside or 1.0}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "hinge"}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "springs": {"c": {"type": "rotational", "node": "A", "stiffness": spring}},
        "loads": {"p": {"type": "moment", "node": "A", "value": [0, 0, 0.1 * spring]}},
    }
    if beside:
        table["nodes"] |= {"C": {"position": [0, 1, 0], "support": "clamped"}, "D": {"position": [1, 1, 0]}}
        table["members"]["n"] = {"nodes": ["C", "D"], "section": "stiff"}
    return made(table)


def prepared_of(scene: Scene, elements: int = 8) -> Prepared:
    return Prepared(model_of(scene, elements), kernels="interpreted")


@pytest.mark.parametrize("beside", [0.0, 1e4])
def test_what_holds_a_mechanism_is_judged_by_the_softest_member(beside):
    """3e-8 of EI/L holds the lever, if barely, whatever stands beside it."""
    step = sfetcas.solve(hinged_lever(3e-8, beside)).last
    assert step.position("B")[:2] == pytest.approx([np.cos(0.1), np.sin(0.1)], abs=1e-6)


def test_tangent_and_energy_have_the_same_unit():
    """Next to what is stiff all weights are far below one."""
    prepared = prepared_of(hinged_lever(0.3, 1e4))
    found = prepared.correct(prepared.equations.start(prepared.model.loading(1.0)), prepared.model.loading(1.0))
    energy = prepared.stability(found)
    assert prepared.softest < 1e-3
    tangent = TangentTest(prepared.equations, prepared.softest, True).test(found.point)
    assert tangent.smallest == pytest.approx(energy.smallest, rel=1e-6)


@pytest.mark.parametrize("turns", [20, 30, 40])
def test_residual_that_rounding_of_rotations_explains_has_converged(turns):
    """Rolled up, rotations of 100 rad leave a residual of about 1e-12 or more, which no further step makes smaller."""
    scene = made(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"p": {"type": "moment", "node": "B", "value": [0, 0, 2.0 * np.pi * turns]}},
        }
    )
    prepared = prepared_of(scene, 8 * turns)
    loading = prepared.model.loading(1.0)
    found = prepared.correct(prepared.equations.start(loading), loading, tolerance=1e-14)
    assert found.residual > 1e-14
    assert found.converged
    # The same residual in a row that the state does not explain is none.
    worst = int(np.abs(found.point.residual).argmax())
    off = found.point.residual.copy()
    off[worst] = 1e-10 * found.point.scale[worst]
    assert not newton._rounded(prepared.equations, found.state, replace(found.point, residual=off))


def test_rows_next_to_straight_are_told_from_straight():
    """A slope of 1e-8 gives closings of that size; their squares would be rounding of the others."""
    scene = made(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0, 0], "support": "hinge"},
                "B": {"position": [0.6, 0.8, 0], "support": "hinge"},
            },
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        }
    )
    prepared = prepared_of(scene)
    equations, nothing = prepared.equations, prepared.model.loading(0.0)
    straight = equations.start(nothing)
    x = prepared.model.along("m")
    bowed = replace(straight, q=straight.q + 1e-8 * np.cos(np.pi * x)[:, None])
    loose = [newton.loose_rows(equations, equations.at(s, nothing), 1e-10).shape[-1] for s in (straight, bowed)]
    assert loose == [1, 0]
