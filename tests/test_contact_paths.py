"""Paths in contact: against repeated solves, closed forms and a limit load; what begins and ends to touch; refusals."""

import json
from pathlib import Path as File

import numpy as np
import pytest

from sfetcas import Scene, SceneError, SolveError, Status, load, solve, switch
from sfetcas.cli import main
from sfetcas.pictures.charts import chart

PROBLEMS = File(__file__).parent.parent / "problems"
LIMIT, DEFLECTION, ARC = 1.66795210859543, 0.476377597825455, 1.13015070107339
"""Limit load of a beam between knife edges at -1 and 1, its deflection, and the beam's length from middle to edge."""


def table(name, **analysis):
    """The scene of a problem file as a dictionary, with another analysis and nothing expected."""
    found = load(PROBLEMS / f"{name}.toml").to_dict()
    found.pop("expect")
    found["analysis"] = analysis
    return found


def path_and_statics(found, span, steps, accuracy=1e-7):
    """The path of a scene, and its equilibria at some factors by themselves."""
    path = {"type": "path", "range": span, "steps": steps, "accuracy": accuracy}
    statics = {"steps": steps, "accuracy": accuracy}
    return [solve(Scene.from_dict({**found, "analysis": analysis})) for analysis in (path, statics)]


def kinds(path):
    """What touches along a path, each change once: (factor, number of places, number of stretches)."""
    told = []
    for point in path.points:
        found = [entry for name in path.scene.contacts for entry in path.configuration(point).touched(name)]
        entry = sum(np.ndim(one["at"]) == 0 for one in found), sum(np.ndim(one["at"]) == 1 for one in found)
        if not told or told[-1][1:] != entry:
            told.append((point.factor, *entry))
    return told


def half_beam(**analysis):
    """Half of the beam over knife edges, its middle a sleeve, under half of the force as the factor."""
    found = table("knife_edge_half_beam", **analysis)
    del found["motions"]
    found["loads"] = {"F": {"type": "force", "node": "middle", "value": [0, -0.5]}}
    return found


@pytest.fixture(scope="module")
def half_path():
    return solve(Scene.from_dict(half_beam(type="path", range=[0, 2], accuracy=1e-7, steps=[1.0])))


@pytest.fixture(scope="module")
def heavy():
    return path_and_statics(table("floor_heavy_cantilever"), [0, 30], [1.0, 6.0, 30.0], accuracy=1e-6)


# -- limit points ---------------------------------------------------------------------------------


def test_limit_load_between_knife_edges(half_path):
    (limit,) = half_path.limit_points
    # The accuracy asked for is 1e-7.
    assert limit.factor == pytest.approx(LIMIT, rel=1e-7)
    # Beside its limit the factor is flat: an error e of it goes with the root of e in the position.
    assert limit.position("middle")[1] == pytest.approx(-DEFLECTION, abs=1e-6)
    assert limit.contacts["edge"]["at"] == pytest.approx(ARC / 3.0, abs=1e-6)
    assert limit.certificate.error_estimate <= 1e-7
    assert half_path.status is Status.SOLVED


def test_stability_is_lost_at_the_limit_point(half_path):
    number = next(i for i, point in enumerate(half_path.points) if point.kind == "limit point")
    assert {point.stable for point in half_path.points[:number]} == {True}
    assert {point.negative for point in half_path.points[number + 1 :]} == {1}
    before, after = half_path.steps
    assert (before.certificate.stable, after.certificate.stable) == (True, False)


def test_path_over_the_force_is_that_over_the_displacement(half_path):
    """The same equilibria with the middle pressed down, which has no limit point: the force is the reaction."""
    pressed = [-entry.position("middle")[1] for entry in half_path.steps]
    found = solve(Scene.from_dict(table("knife_edge_half_beam", steps=pressed, accuracy=1e-8)))
    for ours, theirs in zip(half_path.steps, found.steps, strict=True):
        # 1e-8 asked for, times forces of 1 and what the place of contact gives.
        assert theirs.reaction("middle")[0][1] == pytest.approx(-0.5 * ours.factor, abs=1e-6)
        assert ours.contacts["edge"]["at"] == pytest.approx(theirs.contacts["edge"]["at"], abs=1e-6)


def test_work_of_the_loads_is_stored_along_the_path(half_path):
    """Frictionless obstacles that stand still do no work: the elastic energy is the integral of force over way."""
    factors = half_path.main.factors
    way = -half_path.positions("middle")[:, 1]
    done = np.concatenate([[0.0], np.cumsum(0.25 * (factors[1:] + factors[:-1]) * np.diff(way))])
    for entry in half_path.steps:
        near = np.interp(-entry.position("middle")[1], way, done)
        # The trapezoidal rule over some fifty points: 1e-3 of the energy.
        assert entry.energy["elastic"] == pytest.approx(near, rel=5e-3)


# -- against repeated solves ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "span", "steps", "accuracy"),
    [
        ("drum_cantilever_tip_force", [0, 2.5], [1.2, 2.5], 1e-5),
        ("floor_cantilever_tip_moment", [0, 2], [0.4, 1.0, 2.0], 1e-7),
        ("wall_hinged_beam_end_shortening", [0, 0.028], [0.015, 0.028], 1e-7),
    ],
)
def test_path_meets_the_equilibria_of_repeated_solves(name, span, steps, accuracy):
    path, statics = path_and_statics(table(name), span, steps, accuracy)
    assert [entry.factor for entry in path.steps] == steps
    assert path.status is Status.SOLVED
    for ours, theirs in zip(path.steps, statics.steps, strict=True):
        for node in path.scene.nodes:
            # Twice the accuracy asked for, times the largest size among these scenes.
            assert ours.position(node) == pytest.approx(theirs.position(node), abs=6.0 * accuracy)
        for contact, entry in theirs.contacts.items():
            assert np.shape(ours.contacts[contact]["force"]) == np.shape(entry["force"])
            # Forces of order 10: a hundred times the accuracy asked for.
            force = np.asarray(entry["force"])
            assert np.asarray(ours.contacts[contact]["force"]) == pytest.approx(force, abs=1e3 * accuracy)
        assert ours.certificate.stable is theirs.certificate.stable is True


def test_points_of_the_path_are_equilibria(heavy):
    path = heavy[0]
    for point in path.points[::7]:
        load = path.fields(point).outer_force[1]
        clamp = path.fields(point).reaction("clamp")[0][1]
        floor = look_up_force(path, point)
        # Forces of up to 30, in balance to rounding of Newton's method.
        assert clamp + floor + load == pytest.approx(0.0, abs=1e-9)


def look_up_force(path, point):
    return np.reshape(path.configuration(point).contacts["floor"]["force"], (-1, 3)).sum(axis=0)[1]


# -- what begins and ends to touch ----------------------------------------------------------------


def test_free_then_a_place_then_a_stretch(heavy):
    path, statics = heavy
    assert [entry[1:] for entry in kinds(path)] == [(0, 0), (1, 0), (0, 1)]
    touch, lies = path.transitions
    assert touch.changes == ("contacts.floor touches beam at 1",)
    assert lies.changes == ("beam begins to lie along contacts.floor",)
    # Where the tip comes down, and where its angle vanishes, in statics: the factors at which its gap, and its angle,
    # are zero by bisection over load steps, of which six digits are known.
    assert touch.factor == pytest.approx(1.65328, rel=1e-5)
    assert lies.factor == pytest.approx(15.02757, rel=1e-6)
    for ours, theirs in zip(path.steps, statics.steps, strict=True):
        # The accuracy asked for, twice.
        assert ours.position("tip") == pytest.approx(theirs.position("tip"), abs=2e-6)


def test_a_leaf_winds_round_a_stop_from_its_clamp_on():
    """At a clamp that is tangential to a drum nothing can push: it lies on that from where it is as curved as that."""
    found = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"root": {"position": [0, 0], "support": "clamped"}, "tip": {"position": [1, 0]}},
        "members": {"leaf": {"nodes": ["root", "tip"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "tip", "value": [0, -1]}},
        "contacts": {"drum": {"type": "circle", "center": [0, -5], "radius": 5, "member": "leaf"}},
        "analysis": {"type": "path", "range": [0, 0.4], "steps": [0.4], "accuracy": 1e-4},
    }
    path = solve(Scene.from_dict(found))
    (begins,) = path.transitions
    assert begins.changes == ("leaf begins to lie along contacts.drum",)
    # Its curvature there is that of the drum but for 1e-6, below which it begins to lie; it is the force times its arm.
    assert begins.factor * begins.position("tip")[0] == pytest.approx(0.2, abs=1.5e-6)
    end = path.steps[0].contacts["drum"]["at"][1]
    arm = path.steps[0].position("tip")[0] - 5.0 * np.sin(end / 5.0)
    assert 0.4 * arm == pytest.approx(0.2, rel=1e-5)


def test_a_stretch_becomes_a_place_and_lifts_off():
    """A heavy cantilever whose clamp is raised from near the floor: it lies, then touches with its tip, then hangs."""
    found = table("floor_heavy_cantilever", type="path", range=[0, 0.8], accuracy=1e-6)
    found["nodes"]["clamp"]["position"] = [0, 0.05]
    found["nodes"]["tip"]["position"] = [1, 0.05]
    found["loads"]["weight"] |= {"value": [0, -10], "history": "steady"}
    found["histories"] = {"steady": {"t": [0], "value": [1]}}
    found["motions"] = {"raised": {"node": "clamp", "displacement": [0, 1]}}
    path = solve(Scene.from_dict(found))
    assert [entry[1:] for entry in kinds(path)] == [(0, 1), (1, 0), (0, 0)]
    lies, hangs = path.transitions
    assert lies.changes == ("nothing lies along contacts.floor any more",)
    hangs = hangs.factor + 0.05
    # From there on the tip is as far below the clamp as that of a free cantilever, whatever the height.
    free = {**found, "contacts": {}, "motions": {}, "analysis": {"accuracy": 1e-6}}
    drop = 0.05 - solve(Scene.from_dict(free)).last.position("tip")[1]
    # The accuracy asked for, of a drop of 0.7.
    assert hangs == pytest.approx(drop, abs=2e-6)
    assert path.positions("tip")[-1][1] == pytest.approx(0.85 - drop, abs=1e-5)


@pytest.mark.parametrize("factor", [15.03, 15.05, 15.08])
def test_stretches_may_be_as_short_as_one_likes(factor):
    """Beside where the stretch begins its length grows with the weight as on the way to twice as much."""
    found = solve(Scene.from_dict(table("floor_heavy_cantilever", steps=[factor, 15.2], accuracy=1e-7)))
    (begin, end), (later, _) = (entry.contacts["floor"]["at"] for entry in found.steps)
    assert end == 1.0
    # From 15.0276 to 15.2 the length is 2.8e-3: linear in the weight but for a percent.
    share = (factor - 15.02757) / (15.2 - 15.02757)
    assert 1.0 - begin == pytest.approx(share * (1.0 - later), rel=0.02)


def test_a_member_leaves_an_edge():
    """A cantilever pressed on an edge by a force that falls off again: free where it would be alone."""
    found = table("drum_cantilever_tip_force", type="path", range=[0, 2], accuracy=1e-6, steps=[0.5, 2.0])
    found["contacts"] = {"edge": {"type": "point", "position": [0.6, -0.01], "side": [0, 1], "member": "beam"}}
    found["nodes"] = {"clamp": {"position": [0, 0], "support": "clamped"}, "tip": {"position": [1, 0]}}
    found["members"] = {"beam": {"nodes": ["clamp", "tip"], "section": "strip"}}
    found["sections"] = {"strip": {"EI3": 1.0}}
    found["histories"] = {"on_off": {"t": [0, 1, 2], "value": [0, 1, 0.01]}}
    found["loads"] = {"F": {"type": "force", "node": "tip", "value": [0.3, -1], "history": "on_off"}}
    path = solve(Scene.from_dict(found))
    assert path.status is Status.SOLVED
    assert [entry[1:] for entry in kinds(path)] == [(0, 0), (1, 0), (0, 0)]
    alone = solve(Scene.from_dict({**found, "contacts": {}, "analysis": {"accuracy": 1e-6, "steps": [2.0]}})).last
    # Twice the accuracy asked for.
    assert path.steps[-1].position("tip") == pytest.approx(alone.position("tip"), abs=2e-6)


def test_histories_with_knots_are_passed():
    """The force grows to its full value until 1 and falls again: the way back meets the same states."""
    found = half_beam(type="path", range=[0, 2], accuracy=1e-6, steps=[0.5, 1.5])
    found["loads"]["F"] |= {"value": [0, -0.7], "history": "up_and_down"}
    found["histories"] = {"up_and_down": {"t": [0, 1, 2], "value": [0, 1, 0]}}
    up, down = solve(Scene.from_dict(found)).steps
    # Twice the accuracy asked for, times the size.
    assert up.position("end") == pytest.approx(down.position("end"), abs=6e-6)
    assert abs(up.position("middle")[1]) > 0.05


# -- answers and refusals -------------------------------------------------------------------------


def test_answers_as_those_of_other_paths(half_path, tmp_path):
    told = half_path.to_dict()
    assert json.loads(json.dumps(told))["limit_points"][0]["contacts"]["edge"]["member"] == "half"
    assert len(told["path"]["factor"]) == len(told["path"]["nodes"]["middle"]["position"]) == len(half_path.points)
    assert chart(half_path).axes
    with pytest.raises(SceneError, match="bifurcation: the path has none"):
        switch(half_path)


def test_end_that_slips_through_ends_the_path(tmp_path, capsys):
    """Without loads from below the end of the beam comes to the edge: there the path ends, and says so."""
    found = half_beam(type="path", range=[-1, 2], accuracy=1e-6)
    file = tmp_path / "half.json"
    file.write_text(json.dumps(found))
    assert main(["run", str(file)]) == 1
    told = capsys.readouterr().out
    assert "it ends at factor -0.19" in told
    assert "half slides off contacts.edge with its end" in told


def test_pulled_off_its_only_hold():
    """Pulled up the beam leaves the edge at once, and nothing else holds it."""
    with pytest.raises(SolveError, match=r"no choice of what touches leads on: contacts\.edge"):
        solve(Scene.from_dict(half_beam(type="path", range=[-1, 0])))


def test_prescribed_elements_are_used():
    path = solve(Scene.from_dict(half_beam(type="path", range=[0, 2], accuracy=1e-2, points=12)), elements=4)
    assert path.model.mesh.elements == 4
    # Where it begins to touch the path begins twice: before and after.
    assert len(path.points) == 13


def test_an_end_that_lies_without_a_force_is_followed_to_the_end():
    """A cantilever 1 mm above a floor, pushed down in its middle: it lies from ``1/2 + 6 d / (F / 4)`` on.

    There it has neither slope nor moment, and the floor pushes with ``F / (4 b^2)``; beyond it is straight.
    """
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0.001], "support": "clamped"}, "B": {"position": [1, 0.001]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"f": {"type": "force", "member": "m", "at": 0.5, "value": [0, -1]}},
            "contacts": {"c": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}},
            "analysis": {"type": "path", "range": [0, 1.5], "accuracy": 1e-7, "steps": [0.5, 1.0, 1.5]},
        }
    )
    path = solve(scene)
    assert path.status is Status.SOLVED
    # Small deflections of 1 mm: to the square of the slope.
    assert [one.factor for one in path.transitions] == pytest.approx([0.0096, 0.048], rel=1e-5)
    for step in path.steps:
        begins = 0.5 + 0.024 / step.factor
        assert step.contacts["c"]["at"] == pytest.approx([begins, 1.0], abs=1e-6)
        assert step.contacts["c"]["force"][1] == pytest.approx(step.factor / (4.0 * begins**2), rel=1e-5)
