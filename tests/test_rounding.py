"""Decisions near rounding: what is certain either way is told apart from it, in whatever units."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import made, model_of, three_parallel_cranks

import sfetcas
from sfetcas import tolerances
from sfetcas.description.scene import Scene
from sfetcas.description.supports import upwards
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.solvers import guess, redundancy, residuals
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
    assert prepared.softest < 1e-3
    tangent = TangentTest(prepared.equations, prepared.softest)
    lowest = tangent.around_zero(found.point)[1][0]
    # The tangent tells eigenvalues in units of the softest, the energy by masses.
    assert lowest * prepared.softest == pytest.approx(found.stability.smallest, rel=1e-6)


@pytest.mark.parametrize("turns", [20, 30, 40])
def test_residual_that_rounding_of_rotations_explains_has_converged(turns, monkeypatch):
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
    monkeypatch.setattr(tolerances, "CONVERGED", 1e-14)
    found = prepared.correct(prepared.equations.start(loading), loading)
    assert found.residual > tolerances.CONVERGED
    assert found.converged
    # The same residual in a row that the state does not explain is none.
    worst = int(np.abs(found.point.residual).argmax())
    off = found.point.residual.copy()
    off[worst] = 1e-10 * found.point.scale[worst]
    assert not residuals.rounded(prepared.equations, found.state, replace(found.point, residual=off))


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
    loose = [redundancy.loose_rows(equations, equations.at(s, nothing), 1e-10).shape[-1] for s in (straight, bowed)]
    assert loose == [1, 0]


def round_rod(order: int = 1, moved: float = 0.0) -> Scene:
    """A round cantilever in space: each frequency of bending has two shapes."""
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [0.6, 0.3, 0.2 + moved]}}
    return made(
        {
            "dimension": "space",
            "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}},
            "nodes": dict([*nodes.items()][::order]),
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "analysis": {"type": "modes", "modes": 3},
        }
    )


def test_shapes_of_equal_frequencies_are_chosen_by_a_rule():
    """Also that of which only one is asked for; the second of a pair lies across the first."""
    found = [sfetcas.solve(scene).modes for scene in (round_rod(), round_rod(-1, 1e-14))]
    ends = np.array([[mode.nodes["B"]["position"] for mode in modes] for modes in found])
    assert ends[1] == pytest.approx(ends[0], abs=1e-5)
    assert ends[0, 0] @ ends[0, 1] == pytest.approx(0.0, abs=1e-5)
    assert ends[0, 2] == pytest.approx(ends[0, 0], abs=1e-5)


def test_shapes_of_equal_eigenvalues_are_chosen_by_a_rule():
    """Two of bending and one of twist: where a search for all equilibria begins does not hang on rounding."""
    found = []
    for moved in (0.0, 1e-14):
        prepared = prepared_of(round_rod(1, moved), 4)
        still = prepared.model.loading(0.0)
        found.append(prepared.correct(prepared.equations.start(still), still).spectrum(2))
    assert found[0][0][:3] == pytest.approx(np.full(3, np.pi**2 / 4.0), rel=1e-4)
    assert found[1][1] == pytest.approx(found[0][1], abs=1e-5)


def test_directions_of_equal_components_have_the_sign_of_the_first():
    found = [upwards(np.array([-0.5, 0.5 + rounding, -0.1])) for rounding in (-1e-14, 1e-14)]
    assert found[0][0] > 0.0
    assert found[1][0] > 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_twins_of_generated_code_are_those_of_a_solve(side):
    """In space the start of the column turns about its own b3, wherever that points: no start has to say so."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 9.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "M": {"position": [0.5, 0, 0]},
            "B": {"position": [1, 0, 0], "support": "slider", "direction": [1, 0, 0]},
        },
        "members": {
            "m": {"nodes": ["A", "M"], "section": "s", "b2": [0, side, 0]},
            "n": {"nodes": ["M", "B"], "section": "s", "b2": [0, side, 0]},
        },
        "loads": {"p": {"type": "force", "node": "B", "value": [-60.0, 0, 0]}},
    }
    scene = made(table)
    bent = sfetcas.solve(scene).last.position("M")[1]
    assert side * bent > 0.3
    solver = equilibrium_solver(scene, "column", results=["nodes.M.position"])
    assert solver.start is None
    assert solver.by_name(solver.solve()[1])["nodes.M.position"][1] == pytest.approx(bent, abs=1e-4)


@pytest.mark.parametrize("shift", [1e-12, 1e-11, 1e-10, 1e-9])
def test_links_that_fit_to_all_digits_of_their_places_move(shift):
    """A third crank that is parallel but for rounding of its place holds nothing: 10 N m phi = 1 N 1 m cos(phi)."""
    step = sfetcas.solve(made(three_parallel_cranks(shift, (1.0, 0.0, 0.0)))).last
    phi = np.arcsin(step.position("A")[0])
    # What rounding of the place lets the answer miss by.
    assert 10.0 * phi == pytest.approx(np.cos(phi), abs=1e-6)
    assert step.certificate.residual <= shift + 1e-13
    assert any("redundant" in note for note in step.notes)


def test_links_that_do_not_quite_fit_are_refused():
    """Nothing moves, and what holds would be 1e7 times the load: no number is right to its digits."""
    with pytest.raises(sfetcas.SolveError, match="no finite force"):
        sfetcas.solve(made(three_parallel_cranks(1e-7, (1.0, 0.0, 0.0))))


@pytest.mark.parametrize("shift", [0.0, 1e-13, 1e-11, 1e-9, 1e-8])
def test_links_that_fit_do_not_hold_what_falls(shift):
    """20 N on top of the cranks against 10 N m/rad: upright is unstable, whatever the last digits of places are."""
    step = sfetcas.solve(made(three_parallel_cranks(shift, (0.0, -20.0, 0.0), unstable="stay"))).last
    assert step.certificate.stable is False
    assert step.certificate.negative == 1


@pytest.mark.parametrize("shift", [0.0, 1e-13, 1e-11, 1e-9])
def test_links_that_fit_fall_together(shift):
    """They come to rest where 10 N m phi = 20 N 1 m sin(phi), towards +z, as the rule of mirror images is."""
    step = sfetcas.solve(made(three_parallel_cranks(shift, (0.0, -20.0, 0.0)))).last
    x, y, _ = step.position("A")
    phi = np.arctan2(-x, y)
    assert phi > 1.0
    # What rounding of the place lets the answer miss by.
    assert phi == pytest.approx(2.0 * np.sin(phi), abs=1e-6)
    assert step.certificate.stable is True
    assert any("jumped" in note for note in step.notes)


def test_of_shapes_whose_gaps_differ_by_rounding_that_of_less_energy_begins():
    """Also where the gaps lie to both sides of a number with six digits, and beside one whose gap is not closed."""
    state = object()
    gap = 5e-7
    sides = [(gap * (1.0 - 1e-12), 2.0, state), (gap * (1.0 + 1e-12), 1.0, state), (1.0, 0.0, state)]
    assert guess.least(sides)[1] == 1.0
