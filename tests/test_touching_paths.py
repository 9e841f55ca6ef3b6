"""Paths over changes of what touches at points: closed forms, the older way without radii, statics, symmetry."""

import numpy as np
import pytest

from sfetcas import Scene, SceneError, Status, load, solve, switch

ACCURACY = 1e-7


def path_of(table, span, *, steps=(), **more):
    analysis = {"type": "path", "range": list(span), "accuracy": ACCURACY, **more}
    return solve(Scene.from_dict({**table, "analysis": analysis | ({"steps": list(steps)} if steps else {})}))


def at(table, factor):
    return solve(Scene.from_dict({**table, "analysis": {"steps": [factor], "accuracy": ACCURACY}})).last


def told(path):
    return [change for entry in path.transitions for change in entry.changes]


def cantilever(contact, **more):
    """A cantilever of unit length that is pressed on something by a force at its end."""
    return {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"a": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "B", "value": [0, -1]}},
        "contacts": {"c": {"members": "all", **contact}},
        **more,
    }


DRUM = {"type": "circle", "center": [0.6, -0.5], "radius": 0.3, "member_radius": 0.1}


def pushed_arch():
    """An arch between hinges, which are pushed up so that a peg presses on its middle."""
    return {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {x: {"position": [p, 0], "support": "hinge"} for x, p in (("L", -0.5), ("R", 0.5))},
        "members": {"a": {"nodes": ["L", "R"], "section": "s", "shape": {"type": "arc", "angle": -1.2}}},
        "contacts": {
            "peg": {"type": "circle", "center": [0, 0.35], "radius": 0.08, "member_radius": 0.02, "members": "all"}
        },
        "motions": {x: {"node": x, "displacement": [0, 1]} for x in "LR"},
    }


# -- closed forms ---------------------------------------------------------------------------------


def test_a_rigid_bar_on_a_spring_is_lifted_onto_a_peg():
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"m": {"type": "rigid", "nodes": ["A", "B"]}},
        "springs": {"k": {"node": "A", "stiffness": 2.0}},
        "contacts": {
            "peg": {"type": "circle", "center": [0.6, 0.25], "radius": 0.1, "member_radius": 0.02, "member": "m"}
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 1]}},
    }
    path = path_of(table, [0, 3], steps=[2.0])
    far, distance = np.hypot(0.6, 0.25), 0.12
    place, angle = np.sqrt(far**2 - distance**2), np.arctan2(0.25, 0.6) - np.arcsin(distance / far)
    (touch,) = path.transitions
    # Rounding: the bar is rigid, and the place of the event is sought to 1e-10 of a step.
    assert touch.factor == pytest.approx(2.0 * angle / np.cos(angle), rel=1e-8)
    assert touch.changes == (f"contacts.peg touches m at {place:.4g}",)
    assert not touch.turns
    step = path.steps[0]
    assert step.contacts["peg"]["at"] == pytest.approx(place, rel=1e-9)
    assert step.angle("B") == pytest.approx(angle, rel=1e-9)
    push = (2.0 * np.cos(angle) - 2.0 * angle) / place
    np.testing.assert_allclose(
        step.contacts["peg"]["force"], [push * np.sin(angle), -push * np.cos(angle), 0.0], atol=1e-9
    )


LIMIT = 1.66795210859543
"""Limit load of a beam between knife edges, as in ``test_contact_paths.py``: Jacobi functions."""


def test_limit_load_of_a_beam_between_edges_that_become_sharp():
    found = load("problems/knife_edge_half_beam.toml").to_dict()
    for key in ("expect", "motions"):
        del found[key]
    found["loads"] = {"F": {"type": "force", "node": "middle", "value": [0, -0.5]}}
    loads = []
    for radius in (0.02, 0.01):
        edge = {"type": "circle", "center": [1, -radius], "radius": radius / 2, "member_radius": radius / 2}
        path = path_of(found | {"contacts": {"edge": edge | {"member": "half"}}}, [0, 1.8], accuracy=1e-5)
        assert path.status is Status.SOLVED
        loads.append(path.limit_points[0].factor)
        stable = {point.stable for point in path.points[: [p.kind for p in path.points].index("limit point")]}
        assert stable == {True}
    # Extrapolated: what is left is of second order in the radius, a fiftieth of the first.
    assert 2.0 * loads[1] - loads[0] == pytest.approx(LIMIT, rel=5e-4)
    assert loads[1] - LIMIT > 0.02


# -- statics --------------------------------------------------------------------------------------


def test_a_place_touches_slides_and_leaves():
    found = cantilever(DRUM, histories={"h": {"t": [0, 1, 2], "value": [0, 3, 0]}})
    found["loads"]["F"]["history"] = "h"
    path = path_of(found, [0, 2], steps=[0.5, 1.0, 1.5, 1.9])
    touch, leave = path.transitions
    assert [entry.changes[0].split()[1] for entry in path.transitions] == ["touches", "leaves"]
    # The way back is the way there; where it leaves a push of 1e-8 is left.
    assert touch.factor + leave.factor == pytest.approx(2.0, abs=2e-8)
    np.testing.assert_allclose(touch.position("B"), leave.position("B"), atol=2e-7)
    for step in path.steps:
        alone = at(found, step.factor)
        np.testing.assert_allclose(step.position("B"), alone.position("B"), atol=2e-7)
        if alone.contacts["c"]["at"] is None:
            assert step.contacts["c"]["at"] is None
            continue
        # Forces are of order ten: a hundred times the accuracy asked for.
        np.testing.assert_allclose(step.contacts["c"]["force"], alone.contacts["c"]["force"], atol=1e-5)
    points = [i for i, point in enumerate(path.points) if point.kind == "transition"]
    # Each is there twice: before and after the change.
    both = [[path.configuration(path.points[i + k]).contacts["c"]["at"] for k in (0, 1)] for i in points]
    assert [[at is None for at in pair] for pair in both] == [[True, False], [False, True]]
    assert {point.stable for point in path.points} == {True}


def test_crossing_rods_pressed_together():
    table = {
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {
            "a0": {"position": [0, 0, 0.06], "support": "clamped"},
            "a1": {"position": [1, 0, 0.06]},
            "b0": {"position": [0.6, -0.5, 0], "support": "clamped"},
            "b1": {"position": [0.75, 0.5, 0]},
        },
        "members": {"a": {"nodes": ["a0", "a1"], "section": "s"}, "b": {"nodes": ["b0", "b1"], "section": "s"}},
        "contacts": {"x": {"type": "members", "members": ["a", "b"], "radius": 0.02}},
        "loads": {"F": {"type": "force", "node": "a1", "value": [0, 0.1, -1]}},
    }
    path = path_of(table, [0, 3], steps=[1.0, 3.0], accuracy=1e-6)
    assert told(path) == ["contacts.x: a at 0.6777 touches b at 0.5023"]
    # Without contact until then: the gap is closed there by a cantilever alone.
    free = at({**table, "contacts": {}}, path.transitions[0].factor)
    ends = [free.along(m, [x])["position"][0] for m, x in (("a", path.steps[0].contacts["x"]["at"]), ("b", 0.5))]
    assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.04, abs=1e-3)
    for step in path.steps:
        alone = solve(Scene.from_dict({**table, "analysis": {"steps": [step.factor], "accuracy": 1e-6}})).last
        for node in ("a1", "b1"):
            np.testing.assert_allclose(step.position(node), alone.position(node), atol=2e-6)
        assert step.contacts["x"]["other_at"] == pytest.approx(alone.contacts["x"]["other_at"], abs=1e-5)
    # Elements end at the places: with forces within elements it takes 256 of them.
    assert path.model.mesh.elements <= 32


def test_a_place_goes_over_a_node_from_member_to_member():
    """A beam of two members is a beam of one."""
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1.2, 0]}}
    drum = DRUM | {"center": [0.55, -0.5]}
    one = path_of(cantilever(drum, nodes=nodes), [0, 4], steps=[2.0, 3.0, 4.0])
    members = {"l": {"nodes": ["A", "M"], "section": "s"}, "r": {"nodes": ["M", "B"], "section": "s"}}
    two = path_of(
        cantilever(drum, nodes=nodes | {"M": {"position": [0.75, 0]}}, members=members), [0, 4], steps=[2.0, 3.0, 4.0]
    )
    assert told(two) == ["contacts.c touches l at 0.9126", "contacts.c goes on along r"]
    assert two.transitions[1].factor == pytest.approx(2.6691, rel=1e-4)
    for a, b in zip(one.steps, two.steps, strict=True):
        np.testing.assert_allclose(a.position("B"), b.position("B"), atol=3e-7)


@pytest.fixture(scope="module")
def off_a_log():
    """A cantilever whose end slips off a log and falls onto a floor."""
    floor = {"type": "plane", "point": [0, -0.18, 0], "normal": [0, 1, 0], "member_radius": 0.025}
    log = {"type": "cylinder", "center": [0.9, -0.37, 0], "radius": 0.26, "member_radius": 0.018, "axis": [-0.23, 0, 1]}
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"a": {"nodes": ["A", "B"], "section": "s"}},
        "contacts": {"floor": floor | {"member": "a"}, "log": log | {"member": "a"}},
        "loads": {
            "F": {"type": "force", "node": "B", "value": [-5.5, -16.3, 3.9]},
            "w": {"type": "distributed", "member": "a", "value": [0, -3.2, 0]},
        },
    }
    return table, path_of(table, [0, 1], steps=[0.25, 1.0], accuracy=1e-6)


def test_an_end_that_slips_off(off_a_log):
    _, path = off_a_log
    assert told(path) == [
        "contacts.log touches a at 0.946",
        "contacts.log comes to the end of a",
        "contacts.floor touches a at 1",
        "contacts.log leaves a at 1",
    ]
    # The factor turns where the end begins to slip, and at a corner where the floor catches it.
    assert [entry.turns for entry in path.transitions] == [False, False, True, False]
    assert len(path.limit_points) == 1
    assert [stable for stable, _, _ in path.main.stretches()] == [True, False, True]
    assert [step.certificate.stable for step in path.steps] == [True, False, True, True]


def test_statics_jumps_where_the_end_slips_off(off_a_log):
    table, path = off_a_log
    (limit,) = path.limit_points
    before, after = (at(table, way * limit.factor) for way in (0.99, 1.01))
    assert before.contacts["log"]["at"] < 1.0
    assert before.contacts["floor"]["at"] is None
    assert any("jumped" in note for note in after.notes)
    assert after.contacts["floor"]["at"] == after.contacts["log"]["at"] == 1.0
    for factor, number in ((0.25, 0), (1.0, 3)):
        # The accuracies of both.
        np.testing.assert_allclose(path.steps[number].position("B"), at(table, factor).position("B"), atol=2e-6)


def test_what_only_pegs_hold_up():
    """A rigid bar on a hinge rests on a peg, and what it carries comes down on another one until the first is left."""
    peg = {"type": "circle", "radius": 0.1, "member_radius": 0.02, "members": "all"}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [1, 0]},
            "C": {"position": [1.8, 0]},
        },
        "members": {"r": {"nodes": ["A", "B"], "type": "rigid"}, "f": {"nodes": ["B", "C"], "section": "s"}},
        "contacts": {"near": peg | {"center": [0.7, -0.12]}, "far": peg | {"center": [1.5, -0.16]}},
        "loads": {"F": {"type": "force", "node": "C", "value": [0, -1]}},
    }
    path = path_of(table, [0, 4], steps=[0.2, 1.0, 3.0], accuracy=1e-6)
    assert "at factor 0 nothing tells which way the path goes: it starts at factor 0.004" in path.notes
    assert [change.rsplit(" at ", 1)[0] for change in told(path)] == [
        "contacts.far touches f",
        "contacts.near leaves r",
    ]
    first, both, last = path.steps
    # Moments about the hinge, to rounding: the push on the bar is across it.
    push = np.linalg.norm(first.contacts["near"]["force"])
    assert 0.7 * push == pytest.approx(0.2 * first.position("C")[0], rel=1e-8)
    # All that carries is the sum of both pegs and the hinge.
    forces = [both.contacts[name]["force"] for name in ("near", "far")]
    np.testing.assert_allclose(sum(forces) + both.reaction("A")[0], [0.0, 1.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(last.position("C"), at(table, 3.0).position("C"), atol=2e-6)


# -- obstacles that nodes carry -------------------------------------------------------------------


def rising_drum(accuracy):
    """A drum that rises and turns about a point beside it and winds a cantilever up: path to factor 1."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "X": {"position": [0.6, -0.8], "support": "clamped"},
            "Y": {"position": [0.6, -1.2]},
        },
        "members": {"a": {"nodes": ["A", "B"], "section": "s"}, "arm": {"type": "rigid", "nodes": ["X", "Y"]}},
        "contacts": {
            "c": {"type": "circle", "center": [0.65, -0.5], "radius": 0.3, "member_radius": 0.05, "node": "X"}
            | {"member": "a"}
        },
        "motions": {"m": {"node": "X", "displacement": [-0.05, 0.6], "rotation": 0.7}},
    }
    return path_of(table, [0, 1], steps=[0.6, 1.0], accuracy=accuracy)


def test_estimated_errors_are_those_of_the_path():
    """The place ends near the clamp, where the element between them is halved from mesh to mesh like all others."""
    coarse, fine = (rising_drum(accuracy) for accuracy in (1e-5, 1e-7))
    for a, b in zip(coarse.steps, fine.steps, strict=True):
        apart = np.linalg.norm(a.position("B") - b.position("B")) / coarse.scene.size
        assert apart <= 1e-5
        # That of the finer one on top.
        assert apart <= a.certificate.error_estimate + 1e-7
        assert a.certificate.stable is True


def test_a_roll_on_a_lever():
    scene = load("problems/lever_presses_cantilever.toml")
    path = solve(scene.replace(analysis={"type": "path", "range": [0, 1], "steps": [0.5, 1.0], "accuracy": 1e-6}))
    assert told(path) == ["contacts.roll touches beam at 0.7001"]
    statics = solve(scene.replace(analysis={"steps": [0.5, 1.0], "accuracy": 1e-6}))
    for ours, theirs in zip(path.steps, statics.steps, strict=True):
        np.testing.assert_allclose(ours.position("B"), theirs.position("B"), atol=2e-6)
        np.testing.assert_allclose(ours.contacts["roll"]["force"], theirs.contacts["roll"]["force"], atol=1e-5)


# -- symmetry, bifurcations, snapping -------------------------------------------------------------


@pytest.fixture(scope="module")
def arch():
    return path_of(pushed_arch(), [0, 0.6], branches=1, steps=[0.2, 0.3], accuracy=1e-6)


def test_an_arch_on_a_peg_bifurcates_in_contact(arch):
    assert arch.status is Status.SOLVED
    (bifurcation,) = arch.main.bifurcations
    assert bifurcation.contacts["peg"]["at"] == pytest.approx(0.5, abs=1e-9)
    assert bifurcation.certificate.stable == "neutral"
    one, other = arch.branches[1:]
    for a, b in zip(one.steps, other.steps, strict=True):
        if a.contacts["peg"]["at"] is None:
            continue
        # Mirror images, and statics leaves the unstable path to one of the two.
        assert a.contacts["peg"]["at"] + b.contacts["peg"]["at"] == pytest.approx(1.0, abs=1e-6)
        alone = at(pushed_arch(), a.factor)
        assert min(abs(alone.contacts["peg"]["at"] - x.contacts["peg"]["at"]) for x in (a, b)) < 1e-5
        assert a.certificate.stable is b.certificate.stable is True
    with_peg = [step for step in arch.main.steps if step.contacts["peg"]["at"] is not None]
    assert with_peg
    assert {step.certificate.stable for step in with_peg} == {False}


def test_a_thin_arch_on_a_thicker_peg_is_the_same(arch):
    """Without a radius of members, too: nothing lies along the peg."""
    table = pushed_arch()
    table["contacts"]["peg"] = {"type": "circle", "center": [0, 0.35], "radius": 0.1, "member": "a"}
    path = path_of(table, [0, 0.6], steps=[0.2], accuracy=1e-6)
    # What is computed is the same but for rounding.
    assert [e.factor for e in path.bifurcations] == pytest.approx([e.factor for e in arch.main.bifurcations], rel=1e-8)
    assert told(path) == [change for entry in arch.main.transitions for change in entry.changes]
    np.testing.assert_allclose(
        path.steps[0].contacts["peg"]["force"], arch.steps[0].contacts["peg"]["force"], rtol=1e-7
    )


def test_a_line_begins_and_grows_on_a_floor():
    """With the factor as an unknown the states of load steps, at which it is given."""
    floor = {"type": "plane", "point": [0, -0.1], "normal": [0, 1], "member_radius": 0.05}
    found = cantilever(floor, loads={"w": {"type": "distributed", "member": "a", "value": [0, -1]}})
    path = path_of(found, [0, 8], steps=[6.0, 8.0], accuracy=1e-4)
    assert told(path) == ["contacts.c touches a at 1", "a begins to lie along contacts.c"]
    for step in path.steps:
        alone = at(found, step.factor)
        # The accuracy asked for.
        np.testing.assert_allclose(step.position("B"), alone.position("B"), atol=1e-4)
        # What the end of a line is off turns nothing to first order.
        assert step.contacts["c"]["at"][0] == pytest.approx(alone.contacts["c"]["at"][0], abs=1e-4)
        assert step.certificate.stable is True


def test_what_is_beyond_the_last_place_that_presses_lies_without_a_force():
    """The tip of a strip that is pushed against a wall turns up until it lies along it: from there nothing bends it."""
    table = {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {"base": {"position": [0, 0], "support": "clamped"}, "tip": {"position": [0.98, 0.15]}},
        "members": {"strip": {"nodes": ["base", "tip"], "section": "strip"}},
        "motions": {"push": {"node": "base", "displacement": [1.2, 0]}},
        "contacts": {"wall": {"type": "plane", "point": [1, 0], "normal": [-1, 0], "member": "strip"}},
    }
    path = path_of(table, [0, 0.54], steps=[0.52, 0.54], accuracy=1e-3)
    assert path.status is Status.SOLVED
    assert path.points[-1].factor == pytest.approx(0.54)
    assert told(path) == ["contacts.wall touches strip at 1", "strip begins to lie along contacts.wall"]
    for step in path.steps:
        alone = at(table, step.factor)
        # The push is that of the accuracy asked for.
        assert step.reaction("base")[0] == pytest.approx(alone.reaction("base")[0], abs=2e-3)
        assert step.along("strip", np.linspace(0.97, 1.0, 7))["position"][:, 0] == pytest.approx(1.0, abs=1e-6)


def test_a_column_between_walls():
    """Buckled against a wall, it begins to lie along it at four times Euler's load (Domokos, Holmes, Royce 1997)."""
    euler, scene = np.pi**2, load("problems/column_between_walls.toml")
    path = solve(scene.replace(analysis=scene.analysis.replace(range=(0.0, 4.1 * euler)), expect=()))
    assert [e.factor for e in path.main.bifurcations] == pytest.approx([euler, 4.0 * euler], rel=1e-6)
    for branch, name in zip(path.branches[1:], ("upper", "lower"), strict=True):
        touches, lies = branch.transitions
        assert touches.changes == (f"contacts.{name} touches column at 0.5",)
        assert lies.changes == (f"column begins to lie along contacts.{name}",)
        # Where slopes are small; here they are 0.16, whose square is 0.025.
        assert lies.factor == pytest.approx(4.0 * euler, rel=0.01)
        assert {stable for stable, _, _ in branch.stretches()} == {True}


def test_switching_to_a_branch_in_contact(arch):
    branch = switch(arch, 1, -1)
    (leaves,) = branch.transitions
    assert leaves.factor == pytest.approx(arch.branches[2].transitions[0].factor, rel=1e-6)
    assert leaves.turns
    # Beyond it the arch hangs free, and the factor falls to where it has been snapped through.
    assert branch.factors[-1] == pytest.approx(0.0, abs=1e-9)


def test_a_snapped_arch_lands_on_a_drum_with_both_halves_at_once():
    table = {
        "sections": {"s": {"EI3": 1.0, "EA": 2000.0}},
        "nodes": {
            "L": {"position": [-1, 0], "support": "hinge"},
            "M": {"position": [0, 0.2]},
            "R": {"position": [1, 0], "support": "hinge"},
        },
        "members": {"l": {"nodes": ["L", "M"], "section": "s"}, "r": {"nodes": ["M", "R"], "section": "s"}},
        "contacts": {
            "w": {"type": "circle", "center": [0, -0.6], "radius": 0.45, "member_radius": 0.03, "members": "all"}
        },
        "loads": {"F": {"type": "force", "node": "M", "value": [0, -1]}},
    }
    path, free = (
        path_of({**table, "contacts": c}, [-10, 60], steps=[50.0], accuracy=1e-6) for c in (table["contacts"], {})
    )
    (landing,) = path.transitions
    assert [change.split(" at ")[0] for change in landing.changes] == ["contacts.w touches l", "contacts.w touches r"]
    # Until then the arch does not know of the drum.
    assert [e.factor for e in path.limit_points] == pytest.approx([e.factor for e in free.limit_points], rel=2e-6)
    assert [e.factor for e in path.bifurcations] == pytest.approx([e.factor for e in free.bifurcations], rel=2e-6)
    alone = solve(Scene.from_dict({**table, "analysis": {"steps": [50.0], "accuracy": 1e-6}})).last
    np.testing.assert_allclose(path.steps[-1].position("M"), alone.position("M"), atol=4e-6)
    places = path.steps[-1].contacts["w"]["at"]
    assert sum(places) == pytest.approx(1.0, abs=1e-6)


def test_a_thin_peg_is_not_passed_between_two_points():
    found = cantilever({"type": "circle", "center": [0.8, -0.3], "radius": 5e-4, "member_radius": 5e-4})
    path = path_of(found, [0, 10], steps=[5.0])
    assert len(path.transitions) == 1
    np.testing.assert_allclose(path.steps[0].position("B"), at(found, 5.0).position("B"), atol=2e-7)


# -- what is refused, and how paths end -----------------------------------------------------------


def test_a_node_that_is_driven_onto_an_obstacle_ends_the_path():
    floor = {"type": "plane", "point": [0, -0.3], "normal": [0, 1], "member_radius": 0.05}
    found = cantilever(floor, loads={}, motions={"m": {"node": "A", "displacement": [0, -1]}})
    found["nodes"]["B"] = {"position": [0.8, 0.6]}
    path = path_of(found, [0, 1])
    assert "node A is led into contacts.c" in path.main.end
    assert path.points[-1].factor == pytest.approx(0.25, abs=1e-8)


def test_edge_with_a_radius_of_members():
    """A knife edge under a rod with a radius is a peg with that radius under a thin one."""
    edge = {"type": "point", "position": [0.6, -0.1], "side": [0, 1], "member_radius": 0.02}
    peg = {"type": "circle", "center": [0.6, -0.1], "radius": 0.02}
    rod, thin = (path_of(cantilever(contact), [0, 3], steps=[1.0, 3.0]) for contact in (edge, peg))
    for a, b in zip(rod.steps, thin.steps, strict=True):
        np.testing.assert_allclose(a.position("B"), b.position("B"), atol=2e-7)
    assert rod.transitions[0].factor == pytest.approx(thin.transitions[0].factor, rel=1e-6)


@pytest.mark.parametrize(
    ("contact", "analysis", "sentence"),
    [
        ({"friction": 0.2}, {"modes": 2}, "without modes"),
        ({}, {"modes": 2}, "without modes"),
    ],
)
def test_what_paths_with_radii_are_not_for(contact, analysis, sentence):
    with pytest.raises(SceneError, match=sentence):
        path_of(cantilever(DRUM | contact, sections={"s": {"EI3": 1.0, "rhoA": 1.0}}), [0, 1], **analysis)
