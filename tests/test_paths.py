"""Paths: what they meet, where, and that they are equilibria to the accuracy asked for."""

import copy
import json
import time
from dataclasses import replace
from pathlib import Path as File
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import ZOO, cantilever

from sfetcas import Scene, SceneError, SolveError, Status, check, dump, load, solve, solve_model, switch
from sfetcas.cli import main
from sfetcas.equilibria.settings import Settings
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.paths import paths, switching
from sfetcas.pictures.charts import chart
from sfetcas.solvers.arclength import Curve, Tangent
from sfetcas.solvers.critical import Event, events_between, root
from sfetcas.solvers.prepared import Prepared
from sfetcas.solvers.tracing import Traced, _with_crossed_folds, trace

PROBLEMS = File(__file__).parent.parent / "problems"
P_LEE = (1.85587465394782, -0.942128745387476)
"""Limit loads of Lee's frame: collocation and shooting, agreeing to 1e-14."""
EULER = {
    ("clamped", None): np.pi**2 * np.array([0.25, 2.25, 6.25]),
    ("hinge", "hinge"): np.pi**2 * np.array([1.0, 4.0, 9.0]),
    ("clamped", "fixed"): np.array([4.0 * np.pi**2, 80.7629142257065, 16.0 * np.pi**2]),
}


def table(name, **analysis):
    """The scene of a problem file as a dictionary, with another analysis and nothing expected."""
    found = load(PROBLEMS / f"{name}.toml").to_dict()
    found.pop("expect")
    found["analysis"] = {"type": "path", **analysis}
    return found


def made(found, **changes):
    found = copy.deepcopy(found)
    for place, value in changes.items():
        *outer, last = place.split("__")
        here = found
        for key in outer:
            here = here[key]
        here[last] = value
    return Scene.from_dict(found)


def lee(**analysis):
    return table("lee_frame", **{"range": [-1.5, 2.5], **analysis})


def column(foot="clamped", head=None, *, space=False, **analysis):
    found = table("euler_column_clamped_free", **analysis)
    found["nodes"]["foot"]["support"] = foot
    if head is not None:
        found["nodes"]["head"] |= {"support": "slider", "direction": [1, 0], "rotation": head}
    if space:
        found["dimension"] = "space"
        found["sections"]["strip"] = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}
    return found


def curve_of(scene, elements=2):
    """The curve of a scene from the undeformed state on a uniform mesh, and its first point."""
    prepared = Prepared(assemble(scene, uniform_mesh(scene, 4, elements)))
    curve = Curve(prepared, max(map(abs, scene.analysis.span)))
    state = prepared.equations.start(prepared.model.loading(0.0))
    return curve, curve.standing(state, 0.0, Tangent(np.zeros(prepared.equations.total), 1.0))


@pytest.fixture(scope="module")
def lee_path():
    return solve(made(lee(accuracy=1e-8, steps=[0.5])))


# -- what a path consists of ----------------------------------------------------------------------


def test_points_are_what_repeated_solves_find(lee_path):
    prepared = lee_path.prepared
    first = [point for point in lee_path.points if not point.kind][:12]
    before = None
    for point in first[1:]:
        before = solve_model(prepared, point.factor, start=before)
        # Both are polished to rounding; the frame is 120 m high.
        assert lee_path.fields(point).position("load") == pytest.approx(before.position("load"), abs=1e-9)
        # The energy is level there.
        assert lee_path.configuration(point).energy == pytest.approx(before.energy, rel=1e-9)


def test_every_point_is_an_equilibrium(lee_path):
    for point in lee_path.points:
        found = lee_path.prepared.equations.at(point.state, point.loading)
        # 1e-10 is what the steps converge to; a point between would miss by 1e-3.
        assert (np.abs(found.residual) / found.scale).max() < 2e-10


def test_energy_grows_by_the_work_of_the_load(lee_path):
    energy = [lee_path.configuration(point).energy["elastic"] for point in lee_path.points]
    sunk = -lee_path.positions("load")[:, 1]
    factors = lee_path.main.factors
    work = np.sum(0.5 * (factors[1:] + factors[:-1]) * np.diff(sunk))
    # Trapezoids over about 70 steps.
    assert work == pytest.approx(energy[-1] - energy[0], rel=5e-3)
    assert energy[-1] > 50.0


def test_neighbours_are_near_and_look_the_same_way():
    scene = made(lee())
    curve, start = curve_of(scene)
    points = trace(curve, start, scene.analysis.span, 200).points
    for a, b in zip(points, points[1:], strict=False):
        assert curve.inner(a.tangent, b.tangent) > np.cos(0.63)
        assert curve.prepared.distance(a.state, b.state) < 0.6


def test_range_and_points_end_a_path():
    path = solve(made(lee(range=[-3, 1.0])))
    assert path.main.factors[[0, -1]].tolist() == [0.0, 1.0]
    assert "leaves the range at 1" in path.main.end
    down = solve(made(lee(range=[-2, 0])))
    assert down.main.factors.min() == pytest.approx(-2.0, abs=1e-12)
    assert np.all(np.diff(down.main.factors) < 0.0)
    short = solve(made(lee(points=7)))
    assert len(short.points) == 7
    assert short.main.end == "7 points"


def test_crossings_stand_in_the_order_met(lee_path):
    path = solve(made(lee(steps=[0.5, -0.5, 1.0], accuracy=1e-5)))
    assert [step.factor for step in path.steps] == [0.5, 1.0, 1.0, 0.5, -0.5, -0.5, 0.5, 1.0]
    assert [step.certificate.stable for step in path.steps] == [True, True, False, False, False, True, True, True]
    assert path.last is path.steps[-1]


def test_crossings_within_one_step_are_in_order_on_the_way_down_too():
    path = solve(made(lee(steps=[0.5, 0.5001, 0.4999], range=[-1.5, 1.9])))
    assert [step.factor for step in path.steps] == [0.4999, 0.5, 0.5001, 0.5001, 0.5, 0.4999, 0.4999, 0.5, 0.5001]


def test_a_factor_that_is_not_met_has_no_crossing():
    scene = made(lee(range=[0, 1.0], steps=[0.0, 0.5, 1.0, 2.0]))
    path = solve(scene)
    assert [step.factor for step in path.steps] == [0.0, 0.5, 1.0]


# -- limit points ---------------------------------------------------------------------------------


def test_limit_points_of_lee_frame_with_few_elements():
    # Asked of the library: 1e-6 relative with at most 16 elements SFET5 in total.
    found = lee()
    for name, count in (("column", 6), ("short", 3), ("long", 7)):
        found["members"][name] |= {"elements": count, "element": "SFET5"}
    path = solve(made(found))
    assert path.model.mesh.elements == 16
    for entry, reference in zip(path.limit_points, P_LEE, strict=True):
        assert entry.factor == pytest.approx(reference, rel=1e-6)
        assert abs(entry.factor / reference - 1.0) < entry.certificate.error_estimate


def test_pressure_that_bends_nothing_needs_few_elements():
    """Ten times the first of its critical loads would wind up a beam that nothing closes to a ring."""
    ring = table("ring_normal_pressure", range=[0, 10], accuracy=1e-6)
    for member in ring["members"].values():
        del member["element"], member["elements"]
    path = solve(made(ring))
    assert path.model.mesh.elements <= 16
    assert [point.factor for point in path.branches[0].bifurcations] == pytest.approx([3.0, 8.0], rel=1e-6)


def test_limit_point_of_the_215_degree_arch_with_few_elements():
    path = solve(made(table("arch_215_degrees", range=[0, 1000], points=40)), element="SFET5", elements=8)
    assert path.model.mesh.elements == 16
    assert path.limit_points[0].factor == pytest.approx(897.308996972261, rel=1e-6)


def test_the_factor_stands_still_at_a_limit_point():
    scene = made(lee())
    curve, start = curve_of(scene, 4)
    traced = trace(curve, start, scene.analysis.span, 200)
    limits = [event for event in traced.events if event.kind == "limit"]
    assert len(limits) == 2
    for event in limits:
        # 1e-11 of the step is where the root is sought.
        assert abs(event.standing.tangent.factor) < 1e-8
        i = traced.points.index(event.standing)
        sides = {np.sign(traced.points[j].factor - event.standing.factor) for j in (i - 1, i + 1)}
        assert len(sides) == 1


def test_limit_loads_converge_with_order_eight():
    errors = []
    for elements in (2, 4):
        scene = made(lee())
        curve, start = curve_of(scene, elements)
        events = trace(curve, start, scene.analysis.span, 200).events
        errors.append(abs(events[0].standing.factor - P_LEE[0]))
    # Order 2 p = 8 promises a factor of 256.
    assert errors[1] < errors[0] / 100.0
    assert errors[1] > 1e-13


def test_error_estimates_are_above_the_errors_but_not_by_far(lee_path):
    rough = solve(made(lee(accuracy=1e-4)))
    for entry, reference in zip(rough.limit_points, P_LEE, strict=True):
        error = abs(entry.factor / reference - 1.0)
        assert 1e-12 < error < entry.certificate.error_estimate < 1e-4
    assert max(abs(e.factor / r - 1.0) for e, r in zip(lee_path.limit_points, P_LEE, strict=True)) < 1e-8


@pytest.mark.parametrize("assembly", ["closing", "nodal"])
def test_assemblies_agree(assembly, lee_path):
    path = solve(made(lee(accuracy=1e-8)), assembly=assembly)
    assert path.model.assembly == assembly
    # The same mesh and equations, other unknowns: rounding.
    for one, other in zip(path.limit_points, lee_path.limit_points, strict=True):
        assert one.factor == pytest.approx(other.factor, rel=1e-9)


@pytest.mark.parametrize(
    ("accuracy", "more", "order"),
    [(1e-4, {}, 4), (1e-6, {}, 6), (1e-6, {"dimension": "space"}, 4), (1e-6, {"analysis__modes": 2}, 4)],
)
def test_elements_are_of_higher_order_where_that_saves_a_halving(accuracy, more, order):
    found = lee(accuracy=accuracy, range=[0, 1.0])
    found["sections"]["strip"] |= {"EI2": 720.0, "GJ": 720.0, "rhoA": 1.0}
    path = solve(made(found, **more))
    # Modes have a mesh of their own.
    assert path.model.element.order == order
    assert path.error_estimate <= accuracy


@pytest.mark.parametrize(("name", "order"), [("arch_caught_by_a_string", 6), ("column_between_walls", 4)])
def test_in_contact_the_estimate_relies_on_low_order(monkeypatch, name, order):
    """Forces of contact within elements are kinks."""
    tracing = paths.PathTracing(load(PROBLEMS / f"{name}.toml"), Settings(accuracy=1e-5))
    found, once = [], tracing._errors
    monkeypatch.setattr(tracing, "_errors", lambda *levels: found.append(once(*levels)) or found[-1])
    path = tracing.path()
    assert path.model.element.order == 6
    assert path.error_estimate == pytest.approx(max(found[-1].values()) / 2.0**order)


def test_space_finds_what_the_plane_finds():
    # Meshes differ: ends that nothing bends in the plane a hinge in space may bend.
    found = lee(accuracy=1e-7)
    found["sections"]["strip"] |= {"EI2": 20000.0, "GJ": 20000.0}
    plane, space = solve(made(found)), solve(made(found, dimension="space"))
    assert space.model.space
    for one, other in zip(plane.limit_points, space.limit_points, strict=True):
        assert one.factor == pytest.approx(other.factor, rel=1e-7)
    assert space.positions("load")[-1] == pytest.approx(plane.positions("load")[-1], abs=1e-4)
    # Stiff against leaving the plane, so there is no other bifurcation.
    assert not space.bifurcations


# -- bifurcations ---------------------------------------------------------------------------------


@pytest.mark.parametrize("ends", EULER, ids=str)
def test_columns_lose_one_stability_at_each_critical_load(ends):
    criticals = EULER[ends]
    path = solve(made(column(*ends, range=[0, 1.05 * criticals[-1]], accuracy=1e-8)))
    assert [entry.factor for entry in path.bifurcations] == pytest.approx(criticals, rel=1e-8)
    for point in path.points:
        if not point.kind:
            assert point.negative == int((criticals < point.factor).sum())
            assert point.stable == (point.negative == 0)
    assert not path.limit_points
    # Inextensible and straight: nothing moves.
    assert np.ptp(path.positions("head"), axis=0).max() < 1e-12


def test_bifurcation_and_limit_point_are_told_apart():
    path = solve(made(table("arch_180_degrees_crown_load", range=[0, 20], accuracy=1e-6)))
    (swaying,), (snapping,) = path.bifurcations, path.limit_points
    # Two collocation orders agree to 2e-10 on it; 1e-6 was asked for.
    assert swaying.factor == pytest.approx(5.86053763487863, rel=1e-6)
    assert swaying.factor < snapping.factor
    assert swaying.position("crown")[0] == pytest.approx(0.0, abs=1e-8)
    kinds = [point.kind for point in path.points if point.kind]
    assert kinds == ["bifurcation", "limit point"]
    assert [stable for stable, _, _ in path.main.stretches()] == [True, False]


def test_several_eigenvalues_that_vanish_at_once_are_one_bifurcation():
    path = solve(made(column(space=True, range=[0, 30])))
    assert [entry.factor for entry in path.bifurcations] == pytest.approx(EULER["clamped", None][:2], rel=1e-6)
    assert all("2 eigenvalues vanish at once" in entry.notes[0] for entry in path.bifurcations)
    assert [point.negative for point in path.points if not point.kind][-1] == 4


def test_eigenvalues_that_are_near_are_two_bifurcations():
    found = column(space=True, range=[0, 3])
    found["sections"]["strip"]["EI2"] = 1.001
    path = solve(made(found))
    expected = EULER["clamped", None][0] * np.array([1.0, 1.001])
    assert [entry.factor for entry in path.bifurcations] == pytest.approx(expected, rel=1e-6)
    assert not any(entry.notes for entry in path.bifurcations)


def test_large_models_find_the_same_bifurcations():
    # Beyond 120 unknowns eigenvalues come from inverse iteration, not from LAPACK.
    criticals = np.pi**2 * np.arange(1, 7) ** 2
    path = solve(made(column("hinge", "hinge", range=[0, 400])), elements=40, element="SFET5")
    assert path.model.unknowns > 120
    assert [e.factor for e in path.bifurcations] == pytest.approx(criticals, rel=1e-8)
    assert [e.certificate.negative for e in path.bifurcations] == [0, 1, 2, 3, 4, 5]


# -- branches -------------------------------------------------------------------------------------


def test_branches_lead_off_to_both_sides():
    path = solve(made(column(range=[0, 5], branches=1, steps=[4.0])))
    straight, one, other = path.branches
    assert (straight.bifurcation, one.bifurcation, one.side, other.side) == (0, 1, 1, -1)
    assert [step.certificate.stable for step in path.steps] == [False, True, True]
    _, up, down = (step.position("head") for step in path.steps)
    assert up[1] > 0.5
    # Mirror images, each to the accuracy of 1e-4 and far better.
    assert up == pytest.approx(down * [1.0, -1.0, 1.0], abs=1e-9)
    assert one.factors[0] == pytest.approx(np.pi**2 / 4.0, rel=1e-3)


def test_branches_of_a_bent_path_are_mirror_images_from_the_start():
    path = solve(made(table("arch_180_degrees_crown_load", range=[0, 8], branches=1)))
    one, other = path.branches[1:]
    # The point that they leave from is symmetric to rounding, though the equations leave it open there.
    assert one.factors[0] == pytest.approx(other.factors[0], rel=1e-10)
    places = [path.positions("crown", i)[0] for i in (1, 2)]
    assert places[0] == pytest.approx(places[1] * [-1.0, 1.0, 1.0], abs=1e-9)
    assert abs(places[0][0]) > 1e-3


def test_branch_is_what_statics_leads_to():
    path = solve(made(column(range=[0, 5], branches=1, steps=[4.0], accuracy=1e-7)))
    found = column()
    found["analysis"] = {"steps": [4.0], "accuracy": 1e-7}
    still = solve(made(found)).last
    gaps = [np.abs(step.position("head") - still.position("head")).max() for step in path.steps[1:]]
    assert min(gaps) < 2e-7


def test_toggle_snaps_back_along_unstable_branches():
    path = solve(made(table("toggle_inextensible", range=[0, 10], branches=1, steps=[3.0])))
    assert len(path.branches) == 3
    for branch in path.branches[1:]:
        assert branch.factors[0] < path.bifurcations[0].factor
        assert branch.steps[0].certificate.negative == 1
    left, right = (branch.steps[0].position("apex") for branch in path.branches[1:])
    middle = path.scene.nodes["apex"].position[0]
    assert left[0] - middle == pytest.approx(middle - right[0], abs=1e-9)
    assert abs(left[0] - middle) > 1e-3


def test_switch_follows_the_branch_on_request():
    scene = made(column(range=[0, 5], branches=1))
    path = solve(scene)
    for branch in path.branches[1:]:
        again = switch(path, 1, branch.side)
        # The same mesh and the same steps, from the same point to rounding.
        assert again.factors[-1] == branch.factors[-1]
        ends = [path.fields(b.points[-1]).position("head") for b in (again, branch)]
        assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    with pytest.raises(SceneError, match="the path has none"):
        switch(solve(made(column(range=[0, 2]))))
    with pytest.raises(SceneError, match="found 2, accepted: 1 to 1"):
        switch(path, 2)
    with pytest.raises(SceneError, match="found 0, accepted: 1 or -1"):
        switch(path, 1, 0)
    with pytest.raises(SceneError, match="found 2, accepted: 1 to 1, those that vanish there"):
        switch(path, 1, 1, shape=2)


def test_branches_in_space_are_neutral_where_they_may_turn_about_the_column():
    path = solve(made(column(space=True, range=[0, 4], branches=1, steps=[3.0])))
    straight, *sides = path.steps
    assert straight.certificate.negative == 2
    assert [step.certificate.stable for step in sides] == ["neutral", "neutral"]
    assert {point.stable for point in path.branches[1].points} == {"neutral"}
    other = switch(path, 1, 1, shape=2)
    # The second shape is across the first: buckled to z instead of y.
    assert abs(path.fields(other.points[-1]).position("head")[2]) > 0.3
    plane = solve(made(column(range=[0, 4], branches=1, steps=[3.0])))
    # Both to 1e-4 of accuracy and far better.
    assert sides[0].position("head")[:2] == pytest.approx(plane.steps[1].position("head")[:2], abs=1e-6)


# -- motions and histories ------------------------------------------------------------------------


def test_shortened_straight_beam_starts_where_it_has_bent():
    found = column("clamped")
    found["nodes"]["head"] = {"position": [1, 0], "support": "clamped"}
    del found["loads"]
    found["motions"] = {"push": {"node": "head", "displacement": [-1, 0]}}
    found["analysis"] = {"type": "path", "range": [0, 0.6], "steps": [0.5], "accuracy": 1e-6}
    path = solve(made(found))
    assert path.main.factors[0] == pytest.approx(6e-4)
    assert "no slack" in path.notes[0]
    assert all(point.stable is True for point in path.points)
    # Close to the beginning the reaction is that of the first Euler load.
    force = path.fields(path.points[0]).reaction("head")[0]
    assert force[0] == pytest.approx(-4.0 * np.pi**2, rel=1e-3)


def test_end_twist_buckles_where_greenhill_says():
    path = solve(made(table("twisted_rod_clamped", range=[0, 13], accuracy=1e-6)))
    (bend,) = path.bifurcations
    # 2 x 4.493.. / (GJ/EI): closed form.
    assert bend.factor == pytest.approx(11.9824252210908, rel=1e-6)


def moved(**more):
    """A cantilever whose support moves, with what is fixed to that too."""
    found = cantilever((0.3, 1.2), analysis={"type": "path", "range": [0, 1]}, **more)
    return found | {"motions": {"up": {"node": "A", "displacement": [0, 0.3]}}}


STRUNG = {
    "spring": moved(springs={"k": {"type": "translational", "node": "B", "to": "A", "stiffness": 3.0, "length": 0.4}}),
    "string": moved(tendons={"t": {"way": [{"node": "A", "offset": [0, 0.2]}, {"node": "B"}], "tension": 1.0}}),
    "friction": moved(
        tendons={"t": {"way": [{"member": "m", "offset": -0.05, "discs": 3}], "tension": 1.0, "friction": 0.3}}
    ),
}


@pytest.mark.parametrize(
    "found",
    [table("twisted_rod_clamped", range=[0, 13]), lee(), None, *STRUNG.values()],
    ids=["rod", "lee", "history", *STRUNG],
)
def test_derivative_by_the_factor_is_that_of_the_equations(found):
    scene = made(with_history() if found is None else found)
    curve, start = curve_of(scene)
    rng = np.random.default_rng(1)
    state = curve.equations.moved(start.state, 0.1 * rng.standard_normal(curve.equations.total))
    state = replace(state, lam=rng.standard_normal(len(state.lam)))
    factor, h = 0.4, 1e-4

    def residual(at):
        loading = curve.model.loading(at)
        return curve.equations.at(curve.equations.holding(state, loading), loading).residual

    point = curve.equations.at(curve.equations.holding(state, curve.loading(factor)), curve.loading(factor))
    numeric = (residual(factor + h) - residual(factor - h)) / (2.0 * h)
    exact = curve.slope(state, factor, point)
    assert np.abs(exact).max() > 0.1
    # Central differences: h^2 and rounding over h.
    assert exact == pytest.approx(numeric, abs=2e-7 * np.abs(exact).max())


@pytest.mark.parametrize("found", STRUNG.values(), ids=STRUNG)
def test_what_is_fixed_to_a_moved_support_shortens_no_steps(found):
    path = solve(made(found))
    assert path.main.factors[-1] == pytest.approx(1.0)
    # Of the usual length.
    assert len(path.points) < 50


def with_history():
    found = column(range=[0, 3], steps=[0.5, 1.0, 2.5])
    found["loads"] = {
        "side": {"type": "force", "node": "head", "value": [0, 1], "history": "roof"},
        "push": {"type": "force", "node": "head", "value": [-0.5, 0]},
    }
    found["histories"] = {"roof": {"t": [0, 1, 2], "value": [1, 4, 0]}}
    return found


def test_histories_are_followed_over_their_knots():
    found = with_history()
    path = solve(made(found))
    found["analysis"] = {"steps": [0.5, 1.0, 2.5]}
    still = solve(made(found))
    assert path.main.factors[[0, -1]].tolist() == [0.0, 3.0]
    assert {1.0, 2.0} <= set(path.main.factors)
    # At factor 0 the history already bends the column.
    assert path.positions("head")[0][1] == pytest.approx(1.0 / 3.0, abs=0.05)
    for step, other in zip(path.steps, still.steps, strict=True):
        # Each to 1e-4 of accuracy, and superconvergent.
        assert step.position("head") == pytest.approx(other.position("head"), abs=2e-5)


def test_stretched_chain_ends_the_path():
    found = column("hinge", range=[0, 1])
    found["nodes"]["head"] = {"position": [1, 0], "support": "hinge"}
    found["members"]["column"]["shape"] = {"type": "arc", "angle": 2.0}
    del found["loads"]
    found["motions"] = {"pull": {"node": "head", "displacement": [1, 0]}}
    path = solve(made(found))
    assert path.status is Status.CUT
    # The arc is 1 / sin(1) long.
    assert path.main.factors[-1] == pytest.approx(1.0 / np.sin(1.0) - 1.0, abs=2e-4)
    assert "could not be followed beyond" in path.main.end


def test_straight_beam_between_walls_has_no_path():
    found = column("hinge", range=[0, 1])
    found["nodes"] |= {"head": {"position": [1, 0], "support": "hinge"}}
    found["loads"] = {"side": {"type": "force", "member": "column", "at": 0.5, "value": [0, 1]}}
    with pytest.raises(SolveError, match=r"no finite force holds the members .fully stretched between held points"):
        solve(made(found))


# -- accuracy and effort --------------------------------------------------------------------------


def test_short_of_the_accuracy_on_a_mesh_that_was_asked_for():
    path = solve(made(lee(accuracy=1e-8)), elements=1, element="SFET5")
    assert path.status is Status.SHORT
    assert path.model.mesh.elements == 3
    assert path.error_estimate > 1e-8


@pytest.mark.parametrize("element", ["SFET3", "SFET9"])
def test_other_elements_reach_the_same_limit_load(element):
    path = solve(made(lee(range=[-1.2, 2.0], accuracy=1e-5)), element=element)
    assert path.status is Status.SOLVED
    assert [e.factor for e in path.limit_points] == pytest.approx(P_LEE, rel=1e-5)


def test_hundred_points_cost_less_than_25_cold_solves():
    along, alone = made(lee(range=[-1.5, 2.5], steps=[1.0])), lee()
    alone["analysis"] = {"steps": [1.0], "unstable": "stay"}
    alone = made(alone)

    def timed(scene):
        times = []
        for _ in range(5):
            begin = time.perf_counter()
            done = solve(scene)
            times.append(time.perf_counter() - begin)
        return min(times), done

    (cold, _), (path, done) = timed(alone), timed(along)
    # Whole runs to the same accuracy, errors estimated: measured 18.
    assert path / len(done.points) * 100.0 < 25.0 * cold


# -- roots ----------------------------------------------------------------------------------------


def test_root_is_found_in_few_evaluations():
    calls = []

    def function(x):
        calls.append(x)
        return x**3 - 2.0

    found = root(function, 0.0, -2.0, 2.0, 6.0)
    assert found == pytest.approx(2.0 ** (1.0 / 3.0), abs=1e-10)
    # Halving alone would take 36.
    assert len(calls) < 15


def test_root_without_bracket_is_the_better_end():
    assert root(lambda x: x + 1.0, 0.0, 1.0, 1.0, 2.0) == 0.0
    assert root(lambda x: np.nan, 0.0, -1.0, 1.0, 3.0) == 0.0


def test_events_are_found_in_order_within_one_step():
    scene = made(column(range=[0, 70]))
    curve, start = curve_of(scene, 6)
    end = curve.corrected(*curve.predicted(start, 70.0 / curve.unit), start.tangent, 70.0 / curve.unit)
    assert end.inertia.negative == 3
    events = events_between(curve, start, end)
    # Six elements of order 4: the third load to 2e-7.
    assert [event.standing.factor for event in events] == pytest.approx(EULER["clamped", None], rel=1e-6)


# -- files, checks, pictures ----------------------------------------------------------------------


def test_json_has_arrays_over_the_points(lee_path):
    answer = json.loads(json.dumps(lee_path.to_dict(), allow_nan=False))
    path, count = answer["path"], len(lee_path.points)
    assert {len(path[key]) for key in ("factor", "stable", "negative", "arc", "kind")} == {count}
    assert np.shape(path["nodes"]["load"]["position"]) == (count, 3)
    assert len(path["nodes"]["corner"]["angle"]) == count
    assert np.all(np.diff(path["arc"]) > 0.0)
    assert [entry["factor"] for entry in answer["limit_points"]] == pytest.approx(P_LEE, rel=1e-8)
    assert answer["bifurcations"] == []
    assert {"nodes", "reactions", "members", "certificate", "branch"} <= set(answer["limit_points"][0])
    assert [entry["factor"] for entry in answer["steps"]] == [0.5, 0.5, 0.5]


def test_json_of_branches_and_space():
    path = solve(made(column(space=True, range=[0, 4], branches=1, steps=[3.0])))
    answer = path.to_dict()
    assert [entry["branch"] for entry in answer["steps"]] == [0, 1, 2]
    assert [(branch["bifurcation"], branch["side"]) for branch in answer["branches"]] == [(1, 1), (1, -1)]
    assert len(answer["branches"][0]["path"]["nodes"]["head"]["quaternion"][0]) == 4


def test_expectations_by_crossing_limit_point_and_bifurcation():
    found = lee(steps=[0.5])
    found["expect"] = [
        {"quantity": "factor", "limit_point": 2, "value": P_LEE[1], "tolerance": 1e-4},
        {"quantity": "certificate.stable", "step": 0.5, "crossing": 2, "value": False},
        {"quantity": "certificate.stable", "step": 0.5, "value": True},
        {"quantity": "factor", "limit_point": 1, "value": 1.8, "tolerance": 1e-4},
    ]
    scene = made(found)
    path = solve(scene)
    assert [c.passed for c in check(scene, path)] == [True, True, True, False]
    found["expect"] = [{"quantity": "factor", "bifurcation": 1, "value": 1.0, "tolerance": 1.0}]
    with pytest.raises(SceneError, match=r"expect\.0\.bifurcation: found 1, but the path has 0"):
        check(made(found), path)


def test_command_line_tells_of_the_path(tmp_path, capsys):
    source, answer, picture = PROBLEMS / "cantilever_post_buckling.toml", tmp_path / "a.json", tmp_path / "a.png"
    assert main(["run", str(source), "--json", str(answer), "--plot", str(picture), "--accuracy", "1e-8"]) == 0
    said = capsys.readouterr().out
    assert "path: " in said
    assert "stable from factor 0 to 2.4674011" in said
    assert "bifurcation 1: factor 2.467401100" in said
    assert "branch 2 at bifurcation 1, side -1" in said
    assert "factor 2.50539, crossing 1 of 3, on the path" in said
    assert "factor 2.50539, crossing 3 of 3, on branch 2" in said
    assert "the factor leaves the range at 23" in said
    assert "FAILED" not in said
    assert json.loads(answer.read_text())["bifurcations"][0]["factor"] == pytest.approx(np.pi**2 / 4.0)
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_chart_marks_what_is_unstable_and_where(lee_path):
    figure = chart(lee_path)
    course, shapes = figure.axes
    assert "displacement of load in y" in course.get_xlabel()
    lines = {line.get_gid(): line for line in course.get_lines()}
    assert lines["unstable"].get_linestyle() == "--"
    assert lines["stable"].get_linestyle() == "-"
    assert lines["limit point"].get_ydata() == pytest.approx(P_LEE, rel=1e-8)
    unstable = np.asarray(lines["unstable"].get_ydata())
    # The unstable stretch lies between the two limit points.
    assert [unstable.max(), unstable.min()] == pytest.approx(P_LEE, rel=1e-8)
    drawn = [line for line in shapes.get_lines() if line.get_gid() == "shape"]
    assert len(drawn) >= 3 * len(lee_path.model.members)


def test_chart_of_motions_shows_a_reaction():
    found = table("twisted_rod_clamped", range=[0, 5])
    course, *_ = chart(solve(made(found))).axes
    assert course.get_xlabel() == "factor"
    assert course.get_ylabel() == "moment at last about x, N m"
    line = course.get_lines()[0]
    # GJ / L times the twist, on a mesh for 1e-4.
    assert np.asarray(line.get_ydata())[-1] == pytest.approx(0.75 * 5.0, rel=1e-6)


# -- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("analysis", "sentence"),
    [
        ({"type": "path"}, "analysis: the key 'range' is missing: a path is followed between two factors"),
        ({"type": "path", "range": [2, 1]}, "analysis.range: found [2.0, 1.0], accepted: two rising numbers"),
        ({"type": "path", "range": [1, 2]}, "analysis.range: found [1.0, 2.0], accepted: two rising numbers with zero"),
        ({"type": "path", "range": [0, 0]}, "analysis.range: found [0.0, 0.0], accepted: two rising numbers"),
        ({"type": "path", "range": [0, 1, 2]}, "analysis.range: found [0.0, 1.0, 2.0], accepted: two rising"),
        ({"type": "path", "range": [0, 1], "points": 1}, "analysis.points: found 1, accepted: a whole number from 2"),
        ({"type": "path", "range": [0, 1], "points": 9.5}, "analysis.points: found 9.5, accepted: a whole number"),
        ({"type": "path", "range": [0, 1], "branches": -1}, "analysis.branches: found -1, accepted: a whole number"),
        ({"range": [0, 1]}, "analysis.range: found type 'static', accepted: type 'path' with this key"),
        ({"points": 9}, "analysis.points: found type 'static', accepted: type 'path' with this key"),
    ],
)
def test_bad_analyses_are_refused_with_one_sentence(analysis, sentence):
    found = lee()
    found["analysis"] = analysis
    with pytest.raises(SceneError) as error:
        made(found)
    assert str(error.value).startswith(sentence)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("expect", "sentence"),
    [
        ({"crossing": 1}, "expect.0.crossing: the key 'step' is missing"),
        ({"limit_point": 0}, "expect.0.limit_point: found 0, accepted: a whole number from 1"),
        (
            {"limit_point": 1, "bifurcation": 1},
            "expect.0: accepted: one of the keys step, time, limit_point, bifurcation, flutter_point, transition",
        ),
        (
            {"step": 1.0, "limit_point": 1},
            "expect.0: accepted: one of the keys step, time, limit_point, bifurcation, flutter_point, transition",
        ),
    ],
)
def test_bad_expectations_are_refused_with_one_sentence(expect, sentence):
    found = lee()
    found["expect"] = [{"quantity": "factor", "value": 1.0, "tolerance": 1.0, **expect}]
    with pytest.raises(SceneError) as error:
        made(found)
    assert str(error.value).startswith(sentence)


def test_expectations_of_paths_need_a_path():
    found = lee()
    found["analysis"] = {}
    found["expect"] = [{"quantity": "factor", "value": 1.0, "tolerance": 1.0, "limit_point": 1}]
    with pytest.raises(SceneError, match=r"expect\.0\.limit_point: found the analysis 'static', accepted: 'path'"):
        made(found)


def test_motions_that_cannot_be_made_have_no_path():
    found = column("hinge", range=[0, 1])
    found["nodes"]["head"] = {"position": [1, 0], "support": "hinge"}
    del found["loads"]
    found["motions"] = {"pull": {"node": "head", "displacement": [1, 0]}}
    with pytest.raises(SolveError, match="no shape of the members"):
        solve(made(found))


# -- every kind of scene --------------------------------------------------------------------------


@pytest.mark.parametrize("assembly", ["closing", "nodal"])
@pytest.mark.parametrize("name", ZOO)
def test_path_leads_where_statics_does(name, assembly):
    found = {**ZOO[name](), "analysis": {"steps": [0.5, 1.0], "accuracy": 1e-5, "unstable": "stay"}}
    still = solve(Scene.from_dict(found), assembly=assembly)
    found["analysis"] = {"type": "path", "range": [0, 1.0], "steps": [0.5, 1.0], "accuracy": 1e-5}
    path = solve(Scene.from_dict(found), assembly=assembly)
    assert path.main.factors[-1] == 1.0
    assert [step.factor for step in path.steps] == [0.5, 1.0]
    for along, alone in zip(path.steps, still.steps, strict=True):
        assert along.certificate.stable == alone.certificate.stable
        for node in path.model.nodes:
            # Both to 1e-5 of the size.
            assert along.position(node) == pytest.approx(alone.position(node), abs=2e-5 * path.scene.size)


def test_path_scenes_survive_their_files(tmp_path):
    scene = load(PROBLEMS / "cantilever_post_buckling.toml")
    dump(scene, tmp_path / "again.json")
    assert load(tmp_path / "again.json") == scene
    assert scene.analysis.span == (0.0, 23.0)


def test_branch_that_is_a_loop_is_followed_once():
    """From the bifurcation of a shallow arch the leaning branch meets the other end of the path and comes back."""
    left, right = [[-1, 0], [-0.5, 0.25], [0, 0.35]], [[0, 0.35], [0.5, 0.25], [1, 0]]
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "a": {"position": [-1, 0], "support": "hinge"},
            "t": {"position": [0, 0.35]},
            "b": {"position": [1, 0], "support": "hinge"},
        },
        "members": {
            "l": {"nodes": ["a", "t"], "section": "s", "shape": {"type": "spline", "points": left}},
            "r": {"nodes": ["t", "b"], "section": "s", "shape": {"type": "spline", "points": right}},
        },
        "loads": {"f": {"type": "force", "node": "t", "value": [0, -1]}},
        "analysis": {"type": "path", "range": [-5, 40], "branches": 1},
    }
    path = solve(made(table))
    first = path.bifurcations[0].factor
    _, loop = path.branches
    assert any("bifurcation 1 to the side -1: branch 1 leads along there" in note for note in path.notes)
    assert loop.end == "it closes on itself"
    assert loop.factors.max() <= first * (1.0 + 1e-6)  # the loop hangs from the bifurcation
    assert loop.factors[-1] == loop.factors[0]
    assert path.positions("t", 1)[-1] == pytest.approx(path.positions("t", 1)[0], abs=0.0)
    # At its lowest point it crosses, without a change of stability, a symmetric path that is not followed.
    assert [entry.factor for entry in loop.bifurcations] == pytest.approx([loop.factors.min()], rel=1e-12)
    assert loop.limit_points == ()
    assert len({entry.factor for entry in path.limit_points + path.bifurcations}) == 3


def test_branch_between_two_bifurcations_is_listed_once():
    """A shallow arch between springs snaps; its leaning branch joins the two bifurcations of the path."""
    guide = {"support": "slider", "direction": [1, 0], "rotation": "ball"}
    arc, spring = {"type": "arc", "angle": -0.394791}, {"stiffness": 1000, "direction": [1, 0]}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"a": {"position": [-1, 0], **guide}, "t": {"position": [0, 0.2]}, "b": {"position": [1, 0], **guide}},
        "members": {
            "l": {"nodes": ["a", "t"], "section": "s", "shape": arc},
            "r": {"nodes": ["t", "b"], "section": "s", "shape": arc},
        },
        "springs": {end: {"type": "translational", "node": end, **spring} for end in ("a", "b")},
        "loads": {"f": {"type": "force", "node": "t", "value": [0, -1]}},
        "analysis": {"type": "path", "range": [-60, 60], "branches": 2, "steps": [0.5], "accuracy": 1e-4},
    }
    path = solve(made(table))
    assert len(path.branches) == 2
    assert [len(path.limit_points), len(path.bifurcations)] == [2, 2]
    assert path.branches[1].limit_points + path.branches[1].bifurcations == ()
    # The branch hangs between the two: nothing of it has a factor beyond theirs.
    ends = sorted(entry.factor for entry in path.bifurcations)
    found = path.branches[1].factors
    assert [found.min(), found.max()] == pytest.approx(ends, rel=2e-3)
    # It leans to both sides at one factor; the symmetric path has the factor three times.
    leaning = [float(step.position("t")[0]) for step in path.branches[1].steps]
    assert len(path.main.steps) == 3
    assert len(leaning) == 2
    assert sum(leaning) == pytest.approx(0.0, abs=1e-6)
    assert abs(leaning[0]) > 1e-3


@pytest.mark.parametrize("ratio", [900.0, 1e4])
def test_strips_as_thin_as_leaf_springs_are_followed_in_space(ratio):
    """Buckled sideways their stiff axis turns: rounding of it stands in all components, and stops no path."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": ratio, "GJ": 1.5}},
        "nodes": {"r": {"position": [0, 0, 0], "support": "clamped"}, "t": {"position": [1, 0, 0]}},
        "members": {"b": {"nodes": ["r", "t"], "section": "s"}},
        "loads": {"f": {"type": "force", "node": "t", "value": [0, -1, 0.01]}},
        "analysis": {"type": "path", "range": [0, 20], "steps": [2, 8, 16], "accuracy": 1e-6},
    }
    path = solve(Scene.from_dict(table))
    assert path.status is Status.SOLVED
    table["analysis"] = {"steps": [2, 8, 16], "accuracy": 1e-6}
    found = solve(Scene.from_dict(table))
    for ours, theirs in zip(path.steps, found.steps, strict=True):
        # Twice the accuracy asked for.
        np.testing.assert_allclose(ours.position("t"), theirs.position("t"), atol=2e-6)
        assert ours.certificate.stable is theirs.certificate.stable is True
    assert not any("jumped" in note for step in found.steps for note in step.notes)


def test_what_is_printed_is_short():
    path = solve(load(PROBLEMS / "lee_frame.toml"))
    step = path.steps[0]
    assert repr(step).startswith("Equilibrium(factor=")
    # No arrays and no scene: some numbers and notes each.
    assert len(repr(step)) < 600
    assert len(repr(path)) < 600 * (1 + len(path.steps) + len(path.limit_points))


def test_no_point_of_a_path_is_outside_its_range(monkeypatch):
    """Rounding may put a singular point at the end of the range, and a branch from one, beyond it."""
    from sfetcas.paths import paths
    from sfetcas.solvers import tracing

    def at(standing, factor):
        return replace(standing, loading=replace(standing.loading, factor=factor))

    def moved(events):
        return [replace(e, standing=at(e.standing, -1e-24 if e.standing.factor < 15 else 20)) for e in events]

    monkeypatch.setattr(tracing, "events_between", lambda *ends: moved(events_between(*ends)))
    monkeypatch.setattr(paths, "switched", lambda curve, event, *_: at(event.standing, -1e-3))
    scene = Scene(
        sections={"s": {"EI3": 1.0}},
        nodes={"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        members={"m": {"nodes": ["A", "B"], "section": "s", "elements": 2}},
        loads={"l": {"type": "force", "node": "B", "value": [-1, 0]}},
        analysis={"type": "path", "range": [0, 30], "branches": 1},
    )
    path = solve(scene)
    assert len(path.branches) == 1
    assert all(0.0 <= factor <= 30.0 for factor in path.main.factors)
    assert [point.kind for point in path.points].count("bifurcation") == 1
    assert "the branch leaves the range at once" in path.notes[0]


def test_meshes_that_never_correspond_are_told(monkeypatch):
    """Each mesh is made to cross the factor asked for once more than the one before."""
    levels, real = [], switching.at_factors

    def more(curve, points, factors):
        levels.append(curve.model.mesh.elements)
        return len(levels) * real(curve, points, factors)

    monkeypatch.setattr(switching, "at_factors", more)
    monkeypatch.setattr(paths, "AFFORDED", 0)
    path = solve(made(column(range=[0, 2], steps=[1.0], accuracy=1e-6)))
    assert (path.status, path.error_estimate) == (Status.SHORT, None)
    told = f"meshes of {levels[0]} and {levels[1]} elements do not agree: they have 1 and 2 crossings"
    assert len(levels) == 2
    assert any(note.startswith(told) for note in path.notes)


def test_root_at_the_kink_of_the_lower_of_two_eigenvalues_is_found_in_few_steps():
    """Two that vanish together with different slopes: the lower one has no slope there."""
    asked = []

    def lower(x):
        asked.append(x)
        return min(0.3 - x, 3.0 * (0.3 - x)) + 0.01 * (0.3 - x) ** 2

    assert root(lower, 0.0, lower(0.0), 1.0, lower(1.0)) == pytest.approx(0.3, abs=1e-9)
    assert len(asked) < 15


def test_a_stretch_that_ends_at_an_event_keeps_it():
    """Folds at which no eigenvalue changes its sign are looked for up to the next ordinary point, or to the end."""
    points = [SimpleNamespace(arc=float(i), inertia=SimpleNamespace(zero=0, negative=0)) for i in range(4)]
    last = Event("limit", points[3])
    found = _with_crossed_folds(Traced(points, [last], "range"), 0)
    assert found.points == points
    assert found.events == [last]


def pressed_arch(side):
    """A hinged arch pressed at its crown, a little to one side."""
    half = 0.6
    foot, rise = np.sin(half), 1.0 - np.cos(half)
    arc = {"type": "arc", "angle": -half}
    return Scene.from_dict(
        {
            "sections": {"strip": {"EI3": 1.0}},
            "nodes": {
                "left": {"position": [-foot, 0], "support": "hinge"},
                "crown": {"position": [0, rise]},
                "right": {"position": [foot, 0], "support": "hinge"},
            },
            "members": {
                "first": {"nodes": ["left", "crown"], "section": "strip", "shape": arc},
                "second": {"nodes": ["crown", "right"], "section": "strip", "shape": arc},
            },
            "loads": {"press": {"type": "force", "node": "crown", "value": [side, -1]}},
            "analysis": {"type": "path", "range": [-30, 30], "accuracy": 1e-6},
        }
    )


def test_path_that_comes_near_to_another_one_turns_away_from_it():
    """Pressed a little aside, an arch has a limit point where the even one has a bifurcation.

    It is lower by a share of the two thirds power of the imperfection (Koiter), the same one for all.
    """
    even, sides = solve(pressed_arch(0.0)), np.array([1e-3, 1e-4, 1e-5, 1e-6])
    (bifurcation,) = (entry.factor for entry in even.bifurcations if entry.factor > 0.0)
    paths = [solve(pressed_arch(side)) for side in sides]
    assert not any(path.bifurcations for path in paths)
    # Up to the crest, down the bent branch, and up again where it comes to the even path from the other side.
    assert all(path.limit_points[0].factor > 0.0 > path.limit_points[1].factor for path in paths)
    assert all(path.points[-1].stable for path in paths)
    lowered = np.array([bifurcation - path.limit_points[0].factor for path in paths]) / sides ** (2.0 / 3.0)
    # The next term is of the order of the third root of the imperfection, a tenth for the largest.
    np.testing.assert_allclose(lowered, lowered.mean(), rtol=0.1)


def test_path_that_turns_beside_another_curve_says_so():
    """The two halves of this ring have different meshes: to the equations it is not even."""
    uneven = table("ring_normal_pressure", range=[0, 9], accuracy=1e-3)
    uneven["members"]["upper"].update(element="SFET4", elements=8)
    uneven["members"]["lower"].update(element="SFET4", elements=13)
    path = solve(Scene.from_dict(uneven))
    assert not path.bifurcations
    (note,) = (note for note in path.notes if "comes close to another curve" in note)
    assert "an uneven mesh is one" in note
    even = solve(Scene.from_dict(table("ring_normal_pressure", range=[0, 4], accuracy=1e-3)))
    assert even.bifurcations
    assert not any("comes close to another curve" in note for note in even.notes)


@pytest.mark.parametrize("ratio", [1e6, 1e9])
def test_bifurcations_are_kept_where_stiff_members_leave_few_digits_of_eigenvalues(ratio):
    """Two columns under a girder that bends no more: they sway at pi^2 EI/L^2, and buckle alone at four times that."""
    frame = {
        "sections": {"soft": {"EI3": 1.0}, "stiff": {"EI3": ratio}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0, 1]},
            "C": {"position": [1, 1]},
            "D": {"position": [1, 0], "support": "clamped"},
        },
        "members": {
            "left": {"nodes": ["A", "B"], "section": "soft"},
            "girder": {"nodes": ["B", "C"], "section": "stiff"},
            "right": {"nodes": ["D", "C"], "section": "soft"},
        },
        "loads": {
            "one": {"type": "force", "node": "B", "value": [0, -1]},
            "other": {"type": "force", "node": "C", "value": [0, -1]},
        },
        "analysis": {"type": "path", "range": [0, 60]},
    }
    path = solve(Scene.from_dict(frame))
    assert path.notes == ()
    # Of 1e9 an eigenvalue is known to 1e-5 of its change along the path; the mesh leaves less.
    sways, *alone = (entry.factor for entry in path.bifurcations)
    assert sways == pytest.approx(np.pi**2, rel=1e-4)
    np.testing.assert_allclose(alone, 4.0 * np.pi**2, rtol=1e-4)
    assert alone


def test_a_path_that_ends_before_its_range_does_is_cut():
    """After as many points as are taken by default; where a number is given that many are asked for."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"M": {"type": "moment", "node": "B", "value": 1.0}},
        "analysis": {"type": "path", "range": [0, 1e3]},
    }
    scene = Scene.from_dict(table)
    path = solve(scene)
    assert path.status is Status.CUT
    assert "200 points" in path.main.end
    assert solve(scene.replace({"analysis.points": 20})).status is Status.SOLVED


@pytest.mark.parametrize(("pull", "moment"), [(1.0, 9.134730089), (10.0, 10.428856439)])
def test_a_clamped_rod_that_is_pulled_leaves_the_straight_line_at_a_larger_twist(pull, moment):
    """M L / B at T L^2 / B, from the roots of Greenhill's equation for clamped ends; without a pull as the problem."""
    scene = load("problems/twisted_rod_clamped.toml").replace(expect=())
    load_ = {"type": "force", "node": "last", "value": [pull, 0, 0], "history": "always"}
    changes = {"analysis.range": [0, 15], "loads.pull": load_, "histories.always": {"t": [0], "value": [1]}}
    path = solve(scene.replace(changes))
    # Its stiffness against twist is 0.75; factors are located to 1e-8 of themselves.
    assert 0.75 * path.bifurcations[0].factor == pytest.approx(moment, rel=1e-8)


@pytest.mark.parametrize("aside", [1e-9, 1e-8, 1e-7])
def test_where_an_imperfection_is_too_small_to_be_followed_the_bifurcation_is_that_without_it(aside):
    """Between the two curves there is no equilibrium: where Newton's method ceased to find one was 6e-5 of it off."""
    scene = load("problems/arch_120_degrees_crown_load.toml").replace({"analysis.accuracy": 1e-7, "expect": ()})
    (one,) = solve(scene.replace({"loads.load.value": [aside, -1.0]})).bifurcations
    (other,) = solve(scene).bifurcations
    # A change of the load of this size changes all else by as much; roots are found to 1e-9.
    assert one.factor == pytest.approx(other.factor, rel=aside + 1e-9)
