"""Edges by points: against rings, closed forms and identities; over nodes, at corners, off ends, and back."""

import math

import numpy as np
import pytest
from scenes import SOFT, made

from sfetcas import Load, SceneError, assemble, load, solve
from sfetcas.mechanics.fields import transferred
from sfetcas.solvers.prepared import Prepared

TIP = {"type": "force", "node": "B"}


def edge(x, y, side=(0, 1), **more):
    return {"type": "point", "position": [x, y], "side": list(side), "members": "all", **more}


def over(contact, *, length=2.0, value=(0, -2), accuracy=1e-9, **more):
    """A cantilever along x, with a force at its tip, and obstacles."""
    contacts = contact if "type" not in contact else {"edge": contact}
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [length, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "contacts": contacts,
        "loads": {"F": {**TIP, "value": list(value)}},
        "analysis": {"accuracy": accuracy},
        **more,
    }


def chain(places, contacts, loads, **more):
    """Members one after the other, the first one clamped."""
    nodes = {f"n{i}": {"position": list(place)} for i, place in enumerate(places)}
    nodes["n0"]["support"] = "clamped"
    members = {f"m{i}": {"nodes": [f"n{i}", f"n{i + 1}"], "section": "s"} for i in range(len(places) - 1)}
    table = {"sections": {"s": {**SOFT}}, "nodes": nodes, "members": members, "contacts": contacts, "loads": loads}
    return table | {"analysis": {"accuracy": 1e-6, "steps": [0.3, 1.0]}} | more


def sagging(steps):
    """A cantilever that sags off an edge under its weight."""
    weight = {"w": {"type": "distributed", "member": "m", "value": [0, -60]}}
    analysis = {"accuracy": 1e-6, "steps": steps}
    return over(edge(0.9, -0.05), length=1.0, loads=weight, analysis=analysis)


# -- the same as other obstacles ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "section"),
    [((0, -2), {}), ((0, -15), {}), ((0, -4), {"EA": 50.0})],
    ids=["light", "strong", "stretching"],
)
def test_edge_that_pushes_is_a_ring_that_the_ground_holds(value, section):
    """The equations are the same, and so are eigenvalues: nothing is largest in the place on an edge."""
    table = over(edge(0.5, 0.0), value=value)
    table["sections"]["s"] |= section
    ringed = {key: entry for key, entry in table.items() if key != "contacts"}
    ringed |= {"nodes": table["nodes"] | {"R": {"position": [0.5, 0], "support": "hinge"}}}
    ringed |= {"rings": {"eye": {"node": "R", "member": "m"}}}
    one, ring = solve(made(table)).last, solve(made(ringed)).last
    found = one.contacts["edge"]
    # Two meshes of accuracy 1e-9, of a size of 2 m; forces and eigenvalues have derivatives of the positions.
    np.testing.assert_allclose(one.position("B"), ring.position("B"), atol=4e-9)
    np.testing.assert_allclose(found["force"], ring.reaction("R")[0], atol=1e-7 * np.linalg.norm(found["force"]))
    assert one.certificate.smallest == pytest.approx(ring.certificate.smallest, rel=1e-6)


@pytest.mark.parametrize("space", [False, True])
def test_member_with_a_radius_touches_an_edge_as_a_peg_of_that_radius(space):
    """The distance of the centre lines is all that counts."""
    line = {"type": "line", "point": [0.5, -0.3, 0], "direction": [0.2, 0, 1], "side": [0, 1, 0], "members": "all"}
    drum = {"type": "cylinder", "center": [0.5, -0.3, 0], "axis": [0.2, 0, 1], "radius": 0.1, "members": "all"}
    more = {"dimension": "space"} if space else {}
    contacts = line if space else edge(0.5, -0.3), drum if space else {**drum, "type": "circle"}
    if not space:
        del contacts[1]["axis"]
    steps = [
        solve(made(over({**contact, "member_radius": radius}, value=(0, -6), accuracy=1e-7, **more))).last
        for contact, radius in zip(contacts, (0.25, 0.15), strict=True)
    ]
    a, b = (step.contacts["edge"] for step in steps)
    # Rounding of the same equations.
    np.testing.assert_allclose(a["force"], b["force"], rtol=1e-10)
    assert a["at"] == pytest.approx(b["at"], abs=1e-12)
    assert abs(a["gap"]) < 1e-12


# -- forces ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.5, 0.1, 1)])
def test_line_in_space_pushes_across_itself_and_the_member(direction):
    line = {"type": "line", "point": [0.5, -0.05, 0], "direction": direction, "side": [0, 1, 0], "members": "all"}
    step = solve(made(over(line, value=(0, -1.5, 0.7), accuracy=1e-7, dimension="space"))).last
    entry = step.contacts["edge"]
    force, x = entry["force"] / np.linalg.norm(entry["force"]), np.array([entry["at"]])
    # Identities of the equations that are solved, to rounding.
    assert force @ np.array(direction) == pytest.approx(0.0, abs=1e-12)
    assert force @ step.fields.slopes("m", x)[0] == pytest.approx(0.0, abs=1e-12)
    out = step.fields.positions("m", x)[0] - [0.5, -0.05, 0]
    np.testing.assert_allclose(np.cross(out, direction), 0.0, atol=1e-12)


def test_force_is_the_slope_of_the_energy_by_the_place_of_the_edge():
    def total(x, y):
        return solve(made(over(edge(x, y), value=(0, -5)))).last.energy["total"]

    force, h = solve(made(over(edge(0.5, -0.1), value=(0, -5)))).last.contacts["edge"]["force"], 1e-3
    slope = [total(0.5 + h, -0.1) - total(0.5 - h, -0.1), total(0.5, -0.1 + h) - total(0.5, -0.1 - h)]
    # Central differences: h squared times a third derivative, some tens of N / m^2.
    np.testing.assert_allclose(np.array(slope) / (2.0 * h), force[:2], rtol=2e-5)


def test_limit_load_between_edges_is_where_stability_is_lost():
    """The same states under the force that presses the middle down instead of its displacement: 0.83 N is the most."""
    scene = load("problems/knife_edge_half_beam.toml")
    steps = solve(scene.replace(expect=())).steps
    middle = scene.nodes["middle"].replace(support="slider")
    for step, lost in ((steps[1], 0), (steps[3], 1)):
        force = {"P": Load(type="force", node="middle", value=(0.0, -step.contacts["edge"]["force"][1], 0.0))}
        free = scene.replace(expect=(), motions={}, loads=force, nodes={**scene.nodes, "middle": middle})
        prepared = Prepared(assemble(free, step.model.mesh))
        there = prepared.correct(
            transferred(step.model, step.fields.state, prepared.model), prepared.model.loading(1.0)
        )
        assert there.converged
        # It is the same state.
        assert there.fields.position("end") == pytest.approx(step.position("end"), abs=1e-9)
        assert there.negative == lost


def test_rigid_bar_rests_on_an_edge_as_a_lever():
    nodes = {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [2, 0]}}
    table = over(edge(0.7, -0.2), value=(0, -3), nodes=nodes, members={"m": {"nodes": ["A", "B"], "type": "rigid"}})
    entry = solve(made(table)).last.contacts["edge"]
    arm = math.hypot(0.7, 0.2)
    # Moments about the hinge; rounding.
    assert np.linalg.norm(entry["force"]) == pytest.approx(3.0 * 2.0 * 0.7 / arm**2, rel=1e-12)
    assert entry["at"] == pytest.approx(0.5 * arm, abs=1e-12)


# -- nodes and ends -------------------------------------------------------------------------------------


def test_member_slides_over_a_node_as_over_any_other_place():
    def pressed(*nodes):
        names = [f"n{i}" for i in range(len(nodes))]
        places = {name: {"position": [x, 0]} for name, x in zip(names, nodes, strict=True)}
        places[names[0]] |= {"support": "slider", "direction": [0, 1]}
        members = {f"m{i}": {"nodes": names[i : i + 2], "section": "s"} for i in range(len(nodes) - 1)}
        moves = {"p": {"node": names[0], "displacement": [0, -1]}}
        table = over(edge(1, 0), nodes=places, members=members, loads={}, motions=moves)
        return solve(made(table | {"analysis": {"accuracy": 1e-7, "steps": [0.1, 0.5, 0.8]}})).steps

    for one, two, member in zip(pressed(0, 3), pressed(0, 1.1, 3), ("m0", "m1", "m1"), strict=True):
        a, b = one.contacts["edge"], two.contacts["edge"]
        assert b["member"] == member
        places = 3.0 * a["at"], 1.1 * b["at"] if member == "m0" else 1.1 + 1.9 * b["at"]
        # Two meshes of accuracy 1e-7, of a size of 3 m.
        assert places[0] == pytest.approx(places[1], abs=3e-6)
        np.testing.assert_allclose(a["force"], b["force"], atol=3e-6)


def hanging(x, steps):
    """A rod that hangs from an arch, and an edge below the hinge between them."""
    nodes = {"A": {"position": [0, 0], "support": "hinge"}, "C": {"position": [0.9589, 0.0], "joint": "hinge"}}
    nodes["B"] = {"position": [1.75, -0.1]}
    arch = {"nodes": ["A", "C"], "section": "s", "shape": {"type": "arc", "angle": -1.0}}
    table = over(edge(x, -0.1), value=(0, -10), nodes=nodes, analysis={"accuracy": 1e-6, "steps": steps})
    table["members"] = {"m": arch, "k": {"nodes": ["C", "B"], "type": "rigid"}}
    return solve(made(table)).steps


def test_corner_of_a_chain_hangs_on_an_edge_and_holds_what_the_load_is_more():
    """The hinge between arch and rod is pressed onto the edge from both sides."""
    light, more, heavy = hanging(0.97, [0.1, 0.3, 1.0])
    for step in (light, more):
        np.testing.assert_allclose(step.position("C")[:2], [0.97, -0.1], atol=1e-12)
        assert step.certificate.stable is True
    # Nothing moves in between.
    np.testing.assert_allclose(more.contacts["edge"]["force"] - light.contacts["edge"]["force"], [0, 2, 0], atol=1e-9)
    # Beyond that the arch gives way.
    assert heavy.contacts["edge"]["member"] == "m"
    assert 0.9 < heavy.contacts["edge"]["at"] < 1.0


def test_two_members_that_come_to_a_corner_are_one_place():
    (step,) = hanging(0.96, [0.1])
    assert step.contacts["edge"]["at"] in (0.0, 1.0)
    # Rod and arch each push the hinge: moments about the end of the arch, and the rod hangs straight down.
    np.testing.assert_allclose(step.position("C")[:2], [0.96, -0.1], atol=1e-12)
    np.testing.assert_allclose(step.reaction("A")[0] + step.contacts["edge"]["force"], [0, 1, 0], atol=1e-9)


def test_what_slides_off_hangs_free_and_what_begins_anew_does_not():
    resting, fallen, again = solve(made(sagging([0.4, 1.0, 0.4]))).steps
    free = solve(made({**sagging([1.0]), "contacts": {}})).last
    assert resting.contacts["edge"]["at"] == pytest.approx(0.92695, abs=1e-4)
    assert fallen.contacts["edge"] | {"force": None} == dict.fromkeys(("force", "at", "gap", "member"))
    assert any("jumped near factor 0.46" in note for note in fallen.notes)
    # Two ways to one state, each to 1e-6 of a size of 1 m.
    np.testing.assert_allclose(fallen.position("B"), free.position("B"), atol=2e-6)
    np.testing.assert_allclose(again.position("B"), resting.position("B"), atol=1e-9)


def test_what_has_slid_off_may_pass_below_where_its_end_was():
    """The end falls forwards: the edge is then above the member, and pushes it no more."""

    def line(x, y, z, direction, side):
        return {"type": "line", "point": [x, y, z], "direction": direction, "side": side, "members": "all"}

    contacts = {
        "near": line(1.1558, 0.0067, 0.0119, [0.2786, -0.0651, 1.0], [-0.252661, 0.967555, 0.0]),
        "far": line(1.8943, 0.0962, 0.0333, [0.1832, 0.1728, 1.0], [-0.252661, 0.967555, 0.0]),
    }
    loads = {"F": {"type": "force", "node": "n2", "value": [-0.68, -7.63, 0.202]}}
    loads["w"] = {"type": "distributed", "member": "m0", "value": [0, -1.0, 0]}
    places = [0, 0, 0], [0.7344, 0.0, 0.0], [2.0044, 0.3316, 0.0381]
    table = chain(places, contacts, loads, dimension="space")
    table["sections"] = {"s": {"EI2": 1.4, "EI3": 1.0, "GJ": 0.8}}
    resting, fallen = solve(made(table)).steps
    assert resting.contacts["far"]["member"] == "m1"
    assert fallen.contacts["far"]["at"] is None
    assert fallen.contacts["near"]["member"] == "m1"
    assert fallen.certificate.stable is True


# -- the way --------------------------------------------------------------------------------------------


def test_end_that_moves_on_an_arc_does_not_pass_an_edge_that_its_chord_leaves_out():
    contacts = {"edge": edge(1.61085, -0.36276, (0.2175, 0.976))}
    loads = {"F": {"type": "force", "node": "n2", "value": [0.287, -5.263]}}
    step = solve(made(chain([[0, 0], [0.9025, 0], [1.6972, -0.1771]], contacts, loads))).steps[0]
    assert step.contacts["edge"]["member"] == "m1"
    assert step.contacts["edge"]["at"] == pytest.approx(0.9433, abs=1e-3)


def test_member_that_only_just_leaves_an_edge_does_not_pass_it():
    contacts = {f"e{i}": edge(x, y) for i, (x, y) in enumerate([(0.321017, 0), (0.438357, -0.02), (0.529061, -0.02)])}
    loads = {"F": {"type": "force", "node": "n2", "value": [0.56807, -3.05505]}}
    loads["M"] = {"type": "moment", "node": "n2", "value": -0.24938}
    step = solve(made(chain([[0, 0], [0.578, 0], [1.8235, -0.1395]], contacts, loads))).steps[0]
    assert [step.contacts[name]["at"] is None for name in contacts] == [True, True, False]
    # A hundred times what is accepted to be inside.
    assert 1e-5 < step.contacts["e0"]["gap"] < 1e-4


def test_fall_does_not_end_in_the_state_that_it_has_left():
    contacts = {"edge": edge(2.275421306, 0.4500576, (-0.5339, 0.8455))}
    loads = {"F": {"type": "force", "node": "n3", "value": [0.0183, -1.52]}}
    loads["M"] = {"type": "moment", "node": "n3", "value": 1.9036}
    step = solve(made(chain([[0, 0], [1.1304, 0], [1.7496, 0.2363], [2.5492, 0.7412]], contacts, loads))).last
    assert step.certificate.stable is True
    assert step.contacts["edge"]["at"] is None
    assert any("jumped near factor 0.62" in note for note in step.notes)


# -- beside others --------------------------------------------------------------------------------------


def test_edge_beside_a_rough_floor_and_other_members():
    floor = {"type": "plane", "point": [0, -0.9], "normal": [0, 1], "members": "all", "friction": 0.4}
    pair = {"type": "members", "members": ["m", "n"], "radius": 0.02}
    table = over({"edge": edge(0.5, -0.05), "floor": floor, "pair": pair}, value=(0, -5), accuracy=1e-5)
    table["nodes"] |= {"a": {"position": [1.0, -0.6], "support": "clamped"}, "b": {"position": [1.4, -0.6]}}
    table["members"]["n"] = {"nodes": ["a", "b"], "section": "s"}
    step = solve(made(table)).last
    found = step.contacts
    assert all(np.asarray(found[name]["force"]).reshape(-1, 3)[:, 1].min() > 0.0 for name in ("edge", "floor"))
    held = step.reaction("A")[0] + step.reaction("a")[0] + found["edge"]["force"] + found["floor"]["force"]
    # Rounding of forces of tens of newtons; what members push each other with is not of the outside.
    np.testing.assert_allclose(held, [0, 5, 0], atol=1e-8)


@pytest.mark.parametrize(
    ("contact", "sentence"),
    [
        (edge(0.5, -0.05, friction=0.3), "found friction on an edge, accepted: with 'member_radius', or none"),
        (edge(0.5, -0.05, member_radius=0.1), r"starts inside, by 0\.05 m"),
        (edge(0.5, 0.3, member_radius=0.1), r"starts inside, by 0\.4 m"),
    ],
)
def test_wrong_input_is_told_in_one_sentence(contact, sentence):
    with pytest.raises(SceneError, match=sentence) as told:
        made(over(contact))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
def test_what_nothing_holds_without_edges_is_not_led_through_them(accuracy):
    """A beam that may turn about its middle: a share of the way on which it comes to the edges was taken for its begin
    where it is beyond them already, so that they were on its other side.
    """
    scene = load("problems/knife_edges_middle_pressed_down.toml").replace({"analysis.accuracy": accuracy})
    last = solve(scene.replace({"analysis.steps": [0.1]})).last
    # Batista 2015, as in the problem; places are less accurate than positions.
    assert last.contacts["right_edge"]["at"] == pytest.approx(0.3353290672194, abs=100.0 * accuracy)
    assert last.position("right_end")[1] > 0.0
