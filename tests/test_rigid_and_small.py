"""Rigid members as limits of stiff ones, small members as limits of small loads, matrices from files."""

import copy
import json
import re
import zipfile
from contextlib import nullcontext
from itertools import pairwise

import numpy as np
import pytest
from scenes import SOFT, UNLIKE, arc_across, made, model_of, textbook
from systems import linked, linked_space, small_space

import sfetcas
from sfetcas.cli import main
from sfetcas.description.matrices import read_matrix
from sfetcas.equilibria.statics import solve_model
from sfetcas.equilibria.ways import Ways
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics.fields import Fields


def answer(table, elements=4, order=6, **options):
    return solve_model(model_of(table, elements, order, **options))


def angle_to(vector):
    return float(np.arctan2(vector[1], vector[0]))


# -- rigid ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [linked, linked_space])
def test_rigid_is_the_limit_of_stiff(scene):
    """The coupler ever stiffer: positions and reactions differ by the inverse of its stiffness."""
    table = scene()
    rigid, errors = answer(table), []
    for stiffness in (1e4, 1e5):
        stiff = copy.deepcopy(table)
        stiff["sections"]["steel"] = dict.fromkeys(("EI2", "EI3", "GJ"), stiffness) | {"rhoA": 1e-12}
        stiff["members"]["coupler"] |= {"type": "flexible", "section": "steel"}
        found = answer(stiff)
        errors.append([np.linalg.norm(found.position(n) - rigid.position(n)) for n in "BC"]
                      + [np.linalg.norm(found.reaction("D")[0] - rigid.reaction("D")[0])])  # fmt: skip
    one, two = np.array(errors)
    assert one.max() < 1e-3
    # The next term is smaller by the stiffness ratio.
    np.testing.assert_allclose(one / two, 10.0, rtol=1e-2)


SHAPES = {
    "straight": {"type": "straight"},
    "arc": arc_across([0.3, 0.8, 0.2], [1.1, 0.9, 0.5], 2.3, [0, 0.2, 1]),
    "other arc": arc_across([0.3, 0.8, 0.2], [1.1, 0.9, 0.5], -4.0, [1, 0.2, 0]),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shape_of_a_rigid_member_does_not_matter(shape):
    table = linked_space()
    table["loads"] = {"f": {"type": "force", "node": "C", "value": [0.5, -1.0, 0.8]}}
    straight = copy.deepcopy(table)
    straight["members"]["coupler"]["shape"] = SHAPES["straight"]
    table["members"]["coupler"]["shape"] = SHAPES[shape]
    one, two = answer(straight), answer(table)
    for node in one.model.nodes:
        np.testing.assert_allclose(two.position(node), one.position(node), atol=1e-12)
    ends = [step.along("coupler", [0.0, 1.0]) for step in (one, two)]
    for key in ("position", "force", "moment"):
        np.testing.assert_allclose(ends[1][key], ends[0][key], atol=1e-10)
    # Every place of it moves as one body.
    line = two.model.scene.center_lines["coupler"]
    x = np.array([0.0, 0.21, 0.5, 0.83, 1.0])
    places, turn = two.along("coupler", x)["position"], two.quaternion("B")
    rest = line.positions(x)
    np.testing.assert_allclose(places, places[0] + quat.rotate(turn, rest - rest[0]), atol=1e-12)


def chain(links, space=False):
    """Rigid links, each hinged at the one before, hanging from the tip of a flexible cantilever, with weight."""
    nodes = {"root": {"position": [0, 0], "support": "clamped"}, "n0": {"position": [1, 0], "joint": "hinge"}}
    members = {"beam": {"nodes": ["root", "n0"], "section": "s"}}
    for i in range(links):
        nodes[f"n{i + 1}"] = {"position": [1 + 0.01 * (i + 1), 0.003 * (i % 2)], "joint": "hinge"}
        members[f"link{i}"] = {"nodes": [f"n{i}", f"n{i + 1}"], "type": "rigid", "section": "s"}
    del nodes[f"n{links}"]["joint"]
    table = {"sections": {"s": {**SOFT}}, "nodes": nodes, "members": members, "gravity": [0, -1.0]}
    return table | ({"dimension": "space"} if space else {})


@pytest.mark.parametrize("space", [False, True])
def test_a_hundred_rigid_links_cost_a_hundred_poses_at_most(space):
    alone = chain(1, space)
    del alone["members"]["link0"], alone["nodes"]["n1"], alone["nodes"]["n0"]["joint"]
    one = model_of(alone, 4, 4)
    # A pose is a rotation and a place; links on hinges need the rotation only.
    assert model_of(chain(100, space), 4, 4).unknowns == one.unknowns + 100 * (4 if space else 1)
    nodal, both = (model_of(table, 4, 4, assembly="nodal") for table in (alone, chain(100, space)))
    assert both.unknowns <= nodal.unknowns + 100 * (7 if space else 3)


def test_info_shows_what_rigid_links_cost(tmp_path, capsys):
    file = tmp_path / "chain.json"
    sfetcas.dump(made(chain(100)), file)
    assert main(["info", str(file)]) == 0
    shown = capsys.readouterr().out
    unknowns = re.search(r"(\d+)  unknowns of the minimisation", shown)
    # The beam begins with a few elements of a few angles each, the links have one angle each.
    assert unknowns
    assert 100 < int(unknowns.group(1)) < 150
    assert "member link7: rigid, length" in shown
    # What bends is cut into elements, and forty motions are enough to know that nothing holds the links.
    elements = re.search(r"begins with (\d+) elements", shown)
    assert elements
    assert int(elements.group(1)) == int(re.search(r"(\d+) elements, length", shown).group(1))
    told = next(line for line in shown.splitlines() if "mobility" in line)
    assert told.startswith("  mobility 40 or more: ")
    assert told.endswith(" more")


def test_free_motions_in_the_same_words_are_told_once():
    found = sfetcas.Prepared(model_of(chain(100), 4, 4)).diagnosis
    distinct = list(dict.fromkeys(found.motions))
    assert len(distinct) < found.mobility
    assert found.described(found.mobility).split("; ") == distinct
    *said, more = found.described(4).split("; ")
    assert said == distinct[:4]
    assert more == f"and {sum(motion not in said for motion in found.motions)} more"


def test_hundred_links_hang_straight_down():
    """A chain of rigid links hangs along the weight from the tip of the beam, which feels their weight as a force."""
    step = sfetcas.solve(made(chain(100))).last
    tip = step.position("n0")
    links = np.array([step.position(f"n{i}") for i in range(101)])
    # All hang along y: the heights are the sums of the lengths.
    rest = np.array([step.model.scene.nodes[f"n{i}"].position for i in range(101)])
    lengths = np.linalg.norm(np.diff(rest, axis=0), axis=1)
    np.testing.assert_allclose(links[:, 0], tip[0], atol=1e-9)
    np.testing.assert_allclose(links[:, 1], tip[1] - np.concatenate([[0], np.cumsum(lengths)]), atol=1e-9)
    weight = SOFT["rhoA"] * (lengths.sum() + 1.0)
    assert step.reaction("root")[0][1] == pytest.approx(weight, rel=1e-9)


def four_bar_angles(crank, links):
    """Coupler and rocker of a four-bar from the crank angle: intersection of two circles, above the base."""
    a, b, c, d = links
    start = a * np.array([np.cos(crank), np.sin(crank)])
    to = np.array([d, 0.0]) - start
    distance = np.linalg.norm(to)
    along = (b**2 - c**2 + distance**2) / (2 * distance)
    across = np.sqrt(b**2 - along**2)
    joint = start + (along * to + across * np.array([-to[1], to[0]])) / distance
    return angle_to(joint - start), angle_to(joint - [d, 0.0]), joint


def four_bar(turn, space=False):
    """A crank-rocker of rigid links: crank at 60 degrees when undeformed, driven."""
    links = (0.4, 1.1, 0.9, 1.2)
    coupler, _, joint = four_bar_angles(np.pi / 3, links)
    hinge = {"support": "hinge"}
    return {
        "dimension": "space" if space else "plane",
        "nodes": {
            "A": {"position": [0, 0]} | hinge,
            "B": {"position": (0.4 * np.array([0.5, np.sqrt(0.75)])).tolist(), "joint": "hinge"},
            "C": {"position": joint.tolist(), "joint": "hinge"},
            "D": {"position": [1.2, 0]} | hinge,
        },
        "members": {
            "crank": {"nodes": ["A", "B"], "type": "rigid"},
            "coupler": {"nodes": ["B", "C"], "type": "rigid"},
            "rocker": {"nodes": ["C", "D"], "type": "rigid"},
        },
        "motions": {"m": {"node": "A", "rotation": turn}},
        "loads": {"f": {"type": "force", "node": "C", "value": [3.0, -2.0]}},
    }, coupler


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("turn", [0.5, -1.0, 2.0])
def test_rigid_four_bar_against_geometry_and_virtual_work(turn, space):
    table, before = four_bar(turn, space)
    step = sfetcas.solve(made(table)).last
    links = (0.4, 1.1, 0.9, 1.2)
    coupler, _, joint = four_bar_angles(np.pi / 3 + turn, links)
    np.testing.assert_allclose(step.position("C")[:2], joint, atol=1e-12)
    q = step.along("coupler", 0.5)["quaternion"][0]
    assert 2 * np.arctan2(q[3], q[0]) == pytest.approx(coupler - before, abs=1e-12)
    h = 1e-5
    way = (four_bar_angles(np.pi / 3 + turn + h, links)[2] - four_bar_angles(np.pi / 3 + turn - h, links)[2]) / (2 * h)
    # The driving moment does the work that the force takes; differences of second order.
    assert step.reaction("A")[1][2] == pytest.approx(-way @ [3.0, -2.0], abs=1e-8)
    total = step.reaction("A")[0] + step.reaction("D")[0]
    np.testing.assert_allclose(total, [-3.0, 2.0, 0.0], atol=1e-10)


def test_redundant_hinges_in_space_have_the_smallest_reactions_and_a_note():
    table, _ = four_bar(0.5, space=True)
    step = sfetcas.solve(made(table)).last
    flat = sfetcas.solve(made(four_bar(0.5)[0])).last
    for node in "AD":
        # Along z and across it the hinges could hold anything; the smallest is nothing.
        np.testing.assert_allclose(step.reaction(node)[0], flat.reaction(node)[0], atol=1e-9)
        np.testing.assert_allclose(step.reaction(node)[1], flat.reaction(node)[1], atol=1e-9)
    assert any("not unique" in note for note in step.notes), step.notes
    assert not flat.notes


def test_pendulum_without_stiffness_does_not_wind_up():
    """Unloaded it has no stiffness at all; the way of the loads from zero must not turn it round and round."""
    table = {
        "sections": {"s": {"rhoA": 1.5}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [0, -0.8]}},
        "members": {"rod": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
        "gravity": [0, -9.81],
        "loads": {"f": {"type": "force", "node": "B", "value": [2.0, 0]}},
    }
    step = sfetcas.solve(made(table)).last
    assert step.angle("A") == pytest.approx(np.arctan(2 * 2.0 / (1.5 * 0.8 * 9.81)), abs=1e-12)


def test_moments_inside_a_rigid_member_against_statics():
    """A rigid bar, clamped, with a force, a couple and a spread load inside: shear and moment by hand."""
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [2, 0]}},
        "members": {"bar": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {
            "tip": {"type": "force", "node": "B", "value": [0.7, -1.0]},
            "f": {"type": "force", "member": "bar", "at": 0.25, "value": [0, 3.0]},
            "c": {"type": "moment", "member": "bar", "at": 0.6, "value": 0.9},
            "w": {"type": "distributed", "member": "bar", "value": [0, -2.0]},
        },
    }
    step = sfetcas.solve(made(table)).last
    for x in (0.0, 0.1, 0.4, 0.59, 0.61, 0.9, 1.0):
        s, left = 2 * x, 2 * (1 - x)
        shear = -1.0 - 2.0 * left + (3.0 if x < 0.25 else 0.0)
        moment = -1.0 * left - left**2 + (3.0 * (0.5 - s) if x < 0.25 else 0.0) + (0.9 if x < 0.6 else 0.0)
        found = step.along("bar", x)
        np.testing.assert_allclose(found["force"][0], [0.7, shear, 0], atol=1e-12)
        assert found["moment"][0, 2] == pytest.approx(moment, abs=1e-12)
    np.testing.assert_allclose(step.reaction("A")[1], -step.along("bar", 0.0)["moment"][0], atol=1e-12)


def test_moments_inside_rigid_members_of_a_frame():
    """A rigid T: each arm carries what acts beyond it, also where three arms share a rotation."""
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0, 1]},
            "T": {"position": [0, 1.5]},
            "L": {"position": [-0.5, 1.5]},
            "R": {"position": [0.7, 1.5]},
        },
        "members": {
            "post": {"nodes": ["A", "B"], "section": "s"},
            "stem": {"nodes": ["B", "T"], "type": "rigid"},
            "left": {"nodes": ["L", "T"], "type": "rigid"},
            "right": {"nodes": ["T", "R"], "type": "rigid"},
        },
        "loads": {
            "l": {"type": "force", "node": "L", "value": [0.2, -0.8]},
            "r": {"type": "force", "node": "R", "value": [0.1, -0.3]},
            "m": {"type": "moment", "node": "R", "value": 0.25},
        },
    }
    step = sfetcas.solve(made(table)).last
    t, left, right = (step.position(n) for n in "TLR")
    fl, fr, couple = np.array([0.2, -0.8, 0]), np.array([0.1, -0.3, 0]), np.array([0, 0, 0.25])
    ml, mr = np.cross(left - t, fl), np.cross(right - t, fr) + couple
    np.testing.assert_allclose(step.along("right", 0.0)["moment"][0], mr, atol=1e-12)
    np.testing.assert_allclose(step.along("right", 1.0)["moment"][0], couple, atol=1e-12)
    # Drawn towards the node: what is beyond is the rest of the frame.
    np.testing.assert_allclose(step.along("left", 1.0)["moment"][0], -ml, atol=1e-12)
    np.testing.assert_allclose(step.along("left", 0.0)["moment"][0], 0.0, atol=1e-12)
    np.testing.assert_allclose(step.along("stem", 1.0)["moment"][0], ml + mr, atol=1e-12)
    foot = ml + mr + np.cross(t - step.position("B"), fl + fr)
    np.testing.assert_allclose(step.along("stem", 0.0)["moment"][0], foot, atol=1e-12)
    np.testing.assert_allclose(step.along("post", 1.0)["moment"][0], foot, atol=1e-11)


# -- small = flexible under small loads ---------------------------------------------------------------------

END = [0.8, 0.5, 0.3]
VARYING = {
    key: {"at": [0, 0.4, 1], "value": [2.0 * k, k, 0.6 * k]} for key, k in (("EI2", 1.5), ("EI3", 1.0), ("GJ", 0.8))
}
KINDS = {
    "straight": ([1, 0, 0], {"type": "straight"}, UNLIKE, False),
    "straight, space": (END, {"type": "straight"}, UNLIKE, True),
    "arc": ([1, 0, 0], {"type": "arc", "angle": 1.4}, SOFT, False),
    "varying": ([1, 0, 0], {"type": "arc", "angle": 0.6}, VARYING | {"rhoA": 0.4}, False),
    "varying, space": (END, {"type": "straight"}, VARYING | {"rhoA": {"at": [0, 1], "value": [0.3, 0.9]}}, True),
    "arc, space": (END, arc_across([0, 0, 0], END, 2.0, [0, 0.3, 1]), UNLIKE, True),
}
LOADS = {
    "force": {"f": {"type": "force", "node": "B", "value": [0.4, 1.0, -0.7]}},
    "moment": {"f": {"type": "moment", "node": "B", "value": 1.0}},
    "spread": {"f": {"type": "distributed", "member": "m", "value": [0.3, 1, 0.8], "profile": {"polynomial": [1, 2]}}},
    "inside": {"f": {"type": "force", "member": "m", "at": 0.3, "value": [0.6, 2.0, 1.5]}},
    "gravity": {},
}


def beam(kind, load, small):
    end, shape, section, space = KINDS[kind]
    table = {
        "dimension": "space" if space else "plane",
        "sections": {"s": section},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": end}},
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s", "shape": shape, "type": "small" if small else "flexible"}
        },
        "loads": copy.deepcopy(LOADS[load]),
    }
    if load == "gravity":
        table["gravity"] = [0.2, -2.0, 1.0 if space else 0.0]
    for entry in table["loads"].values():
        if entry["type"] != "moment" and not space:
            entry["value"] = entry["value"][:2]
    return table


def near(prepared, factor):
    """The answer under a small load by Newton's method alone, which does not ask for a potential."""
    loading = prepared.model.loading(factor)
    found = prepared.correct(prepared.equations.start(loading), loading)
    assert found.converged
    return Fields(prepared.equations, found.state, loading)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("kind", KINDS)
def test_small_is_flexible_for_small_loads(kind, load):
    """What a linear deformation leaves out is of second order in the load: the first order is met exactly."""
    table = beam(kind, load, True)
    if KINDS[kind][3] and load == "moment":
        table["loads"]["f"]["value"] = [0.5, 0.4, 1.0]
    flexible = copy.deepcopy(table)
    flexible["members"]["m"]["type"] = "flexible"
    small, whole = (sfetcas.Prepared(model_of(t, 8, 6)) for t in (table, flexible))
    gaps, moved = [], []
    for factor in (1e-2, 1e-3):
        one, two = (near(p, factor) for p in (small, whole))
        gaps.append(np.linalg.norm(one.position("B") - two.position("B")))
        moved.append(np.linalg.norm(two.position("B") - KINDS[kind][0]))
        np.testing.assert_allclose(one.reaction("A")[0], two.reaction("A")[0], atol=1e-12)
    assert moved[0] > 1e-4
    order = np.log10(gaps[0] / gaps[1])
    assert 1.9 < order < 3.1, order
    assert gaps[0] < 0.05 * moved[0]


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize(("force", "told"), [(0.15, False), (1.5, True)])
def test_a_small_member_that_bends_far_is_told(dimension, force, told):
    """A cantilever by one small member: the tip goes F L3 / 3 EI across, whatever carries its foot and turns it."""
    table = {
        "dimension": dimension,
        "sections": {"one": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"arm": {"nodes": ["A", "B"], "section": "one", "type": "small"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, force]}},
    }
    notes = sfetcas.solve(made(table)).last.notes
    assert [note for note in notes if "small member 'arm' bends by" in note] == list(notes)
    assert bool(notes) is told
    # Beyond its length nothing is true of it.
    far = {**table, "loads": {"f": {**table["loads"]["f"], "value": [0, 1e4 * force]}}}
    with pytest.raises(sfetcas.SolveError, match=r"a small member bends .*'arm' by .* make it flexible"):
        sfetcas.solve(made(far))
    # Turned as a whole it does not bend.
    table["motions"] = {"m": {"node": "A", "rotation": 2.0 if dimension == "plane" else [0, 0, 2.0]}}
    table["loads"]["f"]["value"] = [0.0, 0.01]
    assert sfetcas.solve(made(table)).last.notes == ()


def test_loads_that_cannot_be_followed_are_followed_once(monkeypatch):
    """Of a small member it is asked first where growing loads lead; the answer without them does not ask again."""
    asked = []
    monkeypatch.setattr(Ways, "_grown", lambda *_: asked.append("grown"))
    table = {
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"arm": {"nodes": ["A", "B"], "section": "s", "type": "small"}},
        "loads": {"p": {"type": "force", "node": "B", "value": [0, 0.01, 0]}},
    }
    assert sfetcas.solve(made(table)).last.way == ("minimum",)
    assert asked == ["grown"]


@pytest.mark.parametrize("obstacle", [False, True])
def test_a_path_ends_where_a_small_member_bends_too_far(obstacle):
    """What lies beyond is not told as if it were true: in statics it is refused."""
    table = {
        "sections": {"one": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"arm": {"nodes": ["A", "B"], "section": "one", "type": "small"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 1]}},
        "analysis": {"type": "path", "range": [0, 60], "steps": [1.0, 50.0]},
    }
    if obstacle:
        table["nodes"]["C"] = {"position": [1.5, 0]}
        table["members"]["tail"] = {"nodes": ["B", "C"], "section": "one"}
        table["contacts"] = {"floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "member": "tail"}}
    path = sfetcas.solve(made(table))
    assert path.status is sfetcas.Status.CUT
    assert [step.factor for step in path.branches[0].steps] == [1.0]
    assert re.search("beyond factor .* a small member bends beyond linear elasticity .'arm' by", path.branches[0].end)
    last = path.branches[0].points[-1].factor
    # A step of the path is a thirtieth of its range at most.
    for factor, refused in ((0.99 * last, False), (last + 60.0 / 30.0, True)):
        static = made({**table, "analysis": {"type": "static", "steps": [factor]}})
        with pytest.raises(sfetcas.SolveError, match="small member bends") if refused else nullcontext():
            sfetcas.solve(static)


@pytest.mark.parametrize(("force", "told"), [(1.0, "bends"), (30.0, "refused"), (1e-3, "")])
def test_a_small_member_that_bends_far_in_a_motion_is_told(force, told):
    table = {
        "sections": {"one": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "C": {"position": [1.5, 0]},
        },
        "members": {
            "arm": {"nodes": ["A", "B"], "section": "one", "type": "small"},
            "tail": {"nodes": ["B", "C"], "section": "one"},
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [0, force]}},
        "analysis": {"type": "dynamic", "end": 1.0, "step": 0.05, "output": 0.1},
    }
    if told == "refused":
        with pytest.raises(sfetcas.SolveError, match=r"a small member bends .*at 0\.\d* s: 'arm' by") as failed:
            sfetcas.solve(made(table))
        assert 0.0 < failed.value.reached.steps[-1].time < 1.0
    else:
        notes = sfetcas.solve(made(table)).notes
        assert bool(notes) is bool(told)
        assert all(re.match(r"at .* s the small member 'arm' bends by", note) for note in notes)


@pytest.mark.parametrize("load", ["force", "spread", "inside", "gravity"])
@pytest.mark.parametrize("kind", ["arc", "varying", "arc, space", "varying, space"])
def test_small_turned_far_is_flexible_turned_far(kind, load):
    """The same with the foot turned by a radian and more: loads keep their directions while the body turns."""
    table = beam(kind, load, True)
    table["motions"] = {
        "turn": {"node": "A", "rotation": [0.5, -0.9, 0.7] if KINDS[kind][3] else 1.2, "history": "all"}
    }
    table["histories"] = {"all": {"t": [0, 1], "value": [1, 1]}}
    flexible = copy.deepcopy(table)
    flexible["members"]["m"]["type"] = "flexible"
    small, whole = (sfetcas.Prepared(model_of(t, 8, 6)) for t in (table, flexible))
    gaps = []
    for factor in (1e-2, 1e-3):
        one, two = (solve_model(p, factor) for p in (small, whole))
        gaps.append(np.linalg.norm(one.position("B") - two.position("B")))
        np.testing.assert_allclose(one.reaction("A")[0], two.reaction("A")[0], atol=1e-12)
    assert np.log10(gaps[0] / gaps[1]) > 1.85
    assert gaps[0] < 1e-3


def test_stiff_body_turned_far_is_solved_to_its_rounding():
    """Axially 1e9 times as stiff as in bending, at the end of a flexible member that turns by a radian."""
    table = condensed(matrix_of_unlike(1e9).tolist())
    table["sections"] = {"s": {**UNLIKE}}
    table["nodes"]["root"] = {"position": [-1, 0.2, 0], "support": "clamped"}
    del table["nodes"]["A"]["support"]
    table["members"]["beam"] = {"nodes": ["root", "A"], "section": "s"}
    table["loads"]["f"]["value"] = [-1.0, 4.0, -3.0]
    step = sfetcas.solve(made(table)).last
    assert 2 * np.arccos(abs(step.quaternion("A")[0])) > 1.0
    # Rounding of places of the size of one times the stiffness, 1e-16 x 1e9.
    np.testing.assert_allclose(step.reaction("root")[0], [1.0, -4.0, 3.0], atol=1e-6)
    section = copy.deepcopy(table)
    section["members"]["m"] = {"nodes": ["A", "B"], "type": "small", "section": "s"}
    other = sfetcas.solve(made(section)).last
    np.testing.assert_allclose(step.position("B"), other.position("B"), atol=1e-6)


def test_deflection_across_a_straight_beam_is_right_to_the_third_order():
    """By symmetry the second order is along the beam only."""
    tables = [beam("straight", "force", small) for small in (True, False)]
    for table in tables:
        table["loads"]["f"]["value"] = [0, 1.0]
    small, whole = (sfetcas.Prepared(model_of(t, 8, 6)) for t in tables)
    gaps = [abs(solve_model(small, f).position("B")[1] - solve_model(whole, f).position("B")[1]) for f in (0.1, 0.01)]
    assert np.log10(gaps[0] / gaps[1]) == pytest.approx(3.0, abs=0.05)


# -- condensed matrices -------------------------------------------------------------------------------------


def consistent_mass(length, rho):
    """Consistent mass of the same beam without rotary inertia."""
    m, n = np.zeros((12, 12)), length
    m[np.ix_([0, 6], [0, 6])] = rho * n / 6 * np.array([[2, 1], [1, 2]])
    c = np.array([[156, 22 * n, 54, -13 * n], [22 * n, 4 * n**2, 13 * n, -3 * n**2],
                  [54, 13 * n, 156, -22 * n], [-13 * n, -3 * n**2, -22 * n, 4 * n**2]]) * rho * n / 420  # fmt: skip
    for place, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        s = np.diag([1, sign, 1, sign])
        index = [place, turn, place + 6, turn + 6]
        m[np.ix_(index, index)] = s @ c @ s
    return m


LENGTH = float(np.linalg.norm(END))


def condensed(stiffness, mass=None, force=(0.4, 1.0, -0.7)):
    table = beam("straight, space", "force", True)
    del table["members"]["m"]["section"], table["sections"]
    table["members"]["m"]["stiffness"] = stiffness
    table["loads"]["f"]["value"] = list(force)
    if mass is not None:
        table["members"]["m"]["mass"] = mass
        table["gravity"] = [0.3, 0.2, -1.0]
    return table


def matrix_of_unlike(ea=1e7):
    return textbook(LENGTH, ea, UNLIKE["GJ"], UNLIKE["EI2"], UNLIKE["EI3"])


def test_section_and_textbook_matrix_are_one_body():
    """A matrix as other programs write it, and the section: the same answer up to the axial stiffness."""
    section = answer(beam("straight, space", "force", True))
    errors = []
    for ea in (1e6, 1e7):
        given = answer(condensed(matrix_of_unlike(ea).tolist()))
        errors.append(np.linalg.norm(given.position("B") - section.position("B")))
        np.testing.assert_allclose(given.reaction("A")[0], section.reaction("A")[0], atol=1e-9)
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=1e-2)


def test_weight_of_a_condensed_mass():
    """A consistent mass has the weight of its beam: the same small deflection as of the section under gravity."""
    table = beam("straight, space", "gravity", True)
    table["gravity"] = [0.3, 0.2, -1.0]
    given = condensed(matrix_of_unlike(1e9).tolist(), consistent_mass(LENGTH, UNLIKE["rhoA"]).tolist(), (0, 0, 0))
    one, two = answer(table), answer(given)
    np.testing.assert_allclose(two.reaction("A")[0], one.reaction("A")[0], atol=1e-12)
    np.testing.assert_allclose(two.position("B"), one.position("B"), atol=1e-8)
    # About the foot, where the weight is displaced to first order; beams differ in how, at the second.
    np.testing.assert_allclose(
        two.reaction("A")[1], one.reaction("A")[1], atol=1e-2 * np.abs(one.reaction("A")[1]).max()
    )


def three_nodes():
    """Two textbook beams in line as one body on three nodes."""
    half = textbook(0.5 * LENGTH, 1e7, UNLIKE["GJ"], UNLIKE["EI2"], UNLIKE["EI3"])
    k = np.zeros((18, 18))
    k[:12, :12] += half
    k[6:, 6:] += half
    return k


def test_body_on_three_nodes():
    """Loads on the inner and the last node of one body: as two bodies in line, and as a beam, for small loads."""
    middle = (0.5 * np.array(END)).tolist()
    table = condensed(three_nodes().tolist())
    table["nodes"]["M"] = {"position": middle}
    table["members"]["m"]["nodes"] = ["A", "M", "B"]
    table["loads"]["g"] = {"type": "force", "node": "M", "value": [-0.8, 0.5, 1.2]}
    whole = beam("straight, space", "force", False)
    whole["loads"]["g"] = {"type": "force", "member": "m", "at": 0.5, "value": [-0.8, 0.5, 1.2]}
    one, two = sfetcas.Prepared(model_of(table)), sfetcas.Prepared(model_of(whole, 8, 6))
    gaps = []
    for factor in (1e-2, 1e-3):
        a, b = solve_model(one, factor), solve_model(two, factor)
        gaps.append(np.linalg.norm(a.position("B") - b.position("B")))
        inner = b.along("m", 0.5)["position"][0]
        assert np.linalg.norm(a.position("M") - inner) < 1e-2 * np.linalg.norm(inner - middle)
        # Rounding of places times the axial stiffness, 1e7.
        np.testing.assert_allclose(a.reaction("A")[0], b.reaction("A")[0], atol=1e-8)
    assert np.log10(gaps[0] / gaps[1]) > 1.9


def market(matrix, layout, symmetry):
    n = len(matrix)
    lines = [f"%%MatrixMarket matrix {layout} real {symmetry}", "% a comment"]
    if layout == "array":
        lines.append(f"{n} {n}")
        lines += [f"{matrix[i, j]:.17g}" for j in range(n) for i in range(j if symmetry == "symmetric" else 0, n)]
    else:
        kept = [(i, j) for j in range(n) for i in range(n) if matrix[i, j] and (symmetry == "general" or i >= j)]
        lines.append(f"{n} {n} {len(kept)}")
        lines += [f"{i + 1} {j + 1} {matrix[i, j]:.17g}" for i, j in kept]
    return "\n".join(lines) + "\n"


FILES = [("array", "general"), ("array", "symmetric"), ("coordinate", "general"), ("coordinate", "symmetric")]


@pytest.mark.parametrize("how", [*FILES, "npz", "npz alone", "npy"])
def test_matrices_from_files_beside_the_scene(how, tmp_path, monkeypatch):
    k, m = matrix_of_unlike(), consistent_mass(LENGTH, 0.4)
    folder = tmp_path / "scene"
    folder.mkdir()
    if how == "npz":
        names = ["k.npz", "k.npz"]
        np.savez(folder / "k.npz", stiffness=k, mass=m)
    elif how == "npz alone":
        names = ["k.npz", "m.npz"]
        np.savez(folder / "k.npz", any_name=k)
        np.savez_compressed(folder / "m.npz", m=m)
    elif how == "npy":
        names = ["k.npy", "m.npy"]
        np.save(folder / "k.npy", k)
        np.save(folder / "m.npy", m)
    else:
        names = ["k.mtx", "m.mtx"]
        for name, matrix in zip(names, (k, m), strict=True):
            (folder / name).write_text(market(matrix, *how))
    table = condensed(names[0], names[1])
    text = sfetcas.Scene.from_dict(condensed(k.tolist(), m.tolist())).to_dict()
    text["members"]["m"] |= {"stiffness": names[0], "mass": names[1]}
    (folder / "scene.json").write_text(json.dumps(text))
    # Wherever the program runs, the files are beside the scene; a dictionary means the working folder.
    monkeypatch.chdir(tmp_path)
    scene = sfetcas.load("scene/scene.json")
    np.testing.assert_array_equal(np.array(scene.members["m"].stiffness), k)
    np.testing.assert_array_equal(np.array(scene.members["m"].mass), m)
    monkeypatch.chdir(folder)
    assert made(table) == scene


def fortran(text):
    """Exponents as Fortran writes those of double precision."""
    return re.sub(r"(\d)e([+-]?\d)", r"\1D\2", text)


WRITTEN = {
    "byte order mark": lambda text: "\ufeff" + text,
    "Fortran": fortran,
    "Fortran, small letters": lambda text: fortran(text).replace("D", "d"),
    "upper case": str.upper,
    "line ends of Windows": lambda text: text.replace("\n", "\r\n"),
    "blank lines": lambda text: "\n" + text.replace("\n", "\n\n") + "  \n",
    "comments between": lambda text: re.sub("\n", "\n  % 1.0 and 2.0\n%\n", text),
    "a comment in another language": lambda text: text.replace("a comment", "Prüfmatrix, Länge 1 m"),
}
"""How programs write the same matrix."""


@pytest.mark.parametrize("how", WRITTEN)
@pytest.mark.parametrize(("layout", "symmetry"), FILES)
def test_matrix_market_as_programs_write_it(how, layout, symmetry, tmp_path):
    k = 1e-7 * matrix_of_unlike()
    text = market(k, layout, symmetry)
    (tmp_path / "k.mtx").write_bytes(WRITTEN[how](text).encode())
    np.testing.assert_array_equal(read_matrix(tmp_path / "k.mtx"), k)


BAD_FILES = {
    "absent.mtx": (None, "there is no file"),
    "absent.npz": (None, "there is no file"),
    "text.npz": (b"no archive", "holds no arrays of numbers of numpy"),
    "binary.mtx": (b"\xff\xfe\x00\x01", "is no text, accepted: Matrix Market, or .npz"),
    "empty.mtx": (b"", "does not begin as Matrix Market does"),
    "csv.mtx": (b"1, 2\n3, 4\n", "does not begin as Matrix Market does"),
    "complex.mtx": (b"%%MatrixMarket matrix array complex general\n1 1\n1 0\n", "is complex, accepted: real"),
    "skew.mtx": (b"%%MatrixMarket matrix array real skew-symmetric\n1 1\n", "is skew-symmetric, accepted: general"),
    "short.mtx": (b"%%MatrixMarket matrix array real general\n2 2\n1 2 3\n", "does not hold the entries"),
    "zero.mtx": (b"%%MatrixMarket matrix coordinate real general\n2 2 1\n0 1 5\n", "does not hold the entries"),
    "outside.mtx": (b"%%MatrixMarket matrix coordinate real general\n2 2 1\n3 1 5\n", "does not hold the entries"),
    "huge.mtx": (
        b"%%MatrixMarket matrix coordinate real general\n900000000 900000000 0\n",
        "does not hold the entries",
    ),
    "infinite.mtx": (b"%%MatrixMarket matrix array real general\ninf 1\n1\n", "does not hold the entries"),
    "between.mtx": (b"%%MatrixMarket matrix coordinate real general\n2 2 1\n1.5 1 5\n", "does not hold the entries"),
    "less.mtx": (b"%%MatrixMarket matrix coordinate real general\n2 2 -1\n1 1 5\n", "does not hold the entries"),
    "words.mtx": (b"%%MatrixMarket matrix array real general\n1 1\none\n", "does not hold the entries"),
    "flat.mtx": (b"%%MatrixMarket matrix array real general\n1 2\n1\n2\n", "a square matrix of finite numbers"),
    "nan.mtx": (b"%%MatrixMarket matrix array real general\n1 1\nnan\n", "a square matrix of finite numbers"),
    "small.mtx": (b"%%MatrixMarket matrix array real general\n1 1\n1.0\n", "found 1 x 1, accepted: 12 x 12"),
    "folder.mtx": ("folder", "this is a folder, accepted: a matrix"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_wrong_matrix_files_are_refused_in_one_sentence(name, tmp_path):
    content, sentence = BAD_FILES[name]
    if content == "folder":
        (tmp_path / name).mkdir()
    elif content is not None:
        (tmp_path / name).write_bytes(content)
    text = sfetcas.Scene.from_dict(condensed(matrix_of_unlike().tolist())).to_dict()
    text["members"]["m"]["stiffness"] = name
    (tmp_path / "scene.json").write_text(json.dumps(text))
    with pytest.raises(sfetcas.SceneError) as caught:
        sfetcas.load(tmp_path / "scene.json")
    message = str(caught.value)
    assert sentence in message
    assert "members.m.stiffness" in message
    assert "\n" not in message


def test_npz_without_an_array_is_refused_by_its_name(tmp_path):
    with zipfile.ZipFile(tmp_path / "text.npz", "w") as archive:
        archive.writestr("stiffness.npy", "no array")
    np.savez(tmp_path / "objects.npz", stiffness=np.array([None, "a"], dtype=object))
    np.savez(tmp_path / "flat.npz", stiffness=np.ones((12, 11)))
    for name, sentence in (
        ("text.npz", "text.npz holds no arrays of numbers"),
        ("objects.npz", "objects.npz holds no arrays of numbers"),
        ("flat.npz", "found 12 x 11 numbers, accepted: a square matrix"),
    ):
        with pytest.raises(sfetcas.SceneError, match=sentence):
            made(condensed(str(tmp_path / name)))


def test_npz_with_several_arrays_needs_the_name(tmp_path):
    np.savez(tmp_path / "k.npz", a=np.eye(2), b=np.eye(2))
    np.savez(tmp_path / "c.npz", stiffness=np.eye(12) * 1j)
    for name, sentence in (("k.npz", "holds a, b, accepted: stiffness, or one array alone"), ("c.npz", "complex128")):
        with pytest.raises(sfetcas.SceneError, match=sentence):
            made(condensed(str(tmp_path / name)))


# -- extreme ratios ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1e-8, 1e-4, 1.0, 1e4, 1e8])
@pytest.mark.parametrize("space", [False, True])
def test_reactions_balance_whatever_the_stiffness_ratio(ratio, space):
    """A flexible, a small and a rigid member in a loop, the small one softer or stiffer by eight powers of ten."""
    other = {key: ratio * value for key, value in (("EI2", 2.0), ("EI3", 1.0), ("GJ", 0.8))}
    table = {
        "dimension": "space" if space else "plane",
        "sections": {"s": {**SOFT}, "t": other},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0.3]},
            "C": {"position": [1.2, -0.2]},
            "D": {"position": [2, 0], "support": "clamped"},
        },
        "members": {
            "soft": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.8}},
            "link": {"nodes": ["B", "C"], "type": "rigid"},
            "small": {"nodes": ["C", "D"], "section": "t", "type": "small", "shape": {"type": "arc", "angle": -0.6}},
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [0.2, -0.5, 0.3 if space else 0]}},
    }
    step = sfetcas.solve(made(table)).last
    assert step.certificate.residual < 1e-10
    force, moment = np.array(table["loads"]["f"]["value"], float), np.zeros(3)
    moment = np.cross(step.position("B"), force)
    for node in "AD":
        f, m = step.reaction(node)
        force, moment = force + f, moment + m + np.cross(step.position(node), f)
    np.testing.assert_allclose(force, 0.0, atol=1e-8)
    np.testing.assert_allclose(moment, 0.0, atol=1e-8)


@pytest.mark.parametrize("stiffness", [1e10, 1e12, 1e16])
def test_a_load_far_below_the_stiffness_of_a_spring_is_carried(stiffness):
    """A rigid rod on a pin and a spring at its end: the spring takes the whole force across the rod."""
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"rod": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"type": "translational", "node": "B", "stiffness": stiffness, "direction": [0, 1]}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 0.01]}},
    }
    assert sfetcas.solve(made(table)).last.spring("k").effort == pytest.approx(-0.01, rel=1e-9)


@pytest.mark.parametrize("axial", [1e6, 1e9, 1e12])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_load_far_below_the_stiffness_of_a_small_member_is_carried(axial, dimension):
    """A cantilever far stiffer along than across: the moment at its foot is the force times its arm."""
    table = textbook_cantilever(axial) | {"dimension": dimension}
    step = sfetcas.solve(made(table)).last
    assert step.position("B")[1] == pytest.approx(0.01 / 3.0, rel=1e-4)
    # Rounding of the length leaves 1e-16 of the axial stiffness, a hundredth of that as a moment.
    moment = step.reaction("A")[1][2]
    assert moment == pytest.approx(-0.01 * step.position("B")[0], rel=1e-8 + 1e-20 * axial / 0.01)


def textbook_cantilever(axial):
    """A small member from its 12 x 12 matrix with EI = GJ = L = 1, clamped, under a force across its end."""
    stiffness = np.zeros((12, 12))
    stretch = np.outer([1.0, -1.0], [1.0, -1.0])
    for freedoms, size in (([0, 6], axial), ([3, 9], 1.0)):
        stiffness[np.ix_(freedoms, freedoms)] = size * stretch
    bent = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    stiffness[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])] = bent
    stiffness[np.ix_([2, 4, 8, 10], [2, 4, 8, 10])] = bent * np.outer(signs, signs)
    return {
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "small", "stiffness": stiffness}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 0.01]}},
    }


def test_small_scene_bends():
    """The zoo's small members are tried where frames turn a lot."""
    step = answer(small_space())
    assert 2 * np.arccos(abs(step.quaternion("C")[0])) > 0.25


def held_body(nodes, order=1):
    """A rigid body of members between supported hinges, each its place and axis, with an arm that bends."""
    names = list(nodes)
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 5.0, "EI3": 5.0, "GJ": 4.0}},
        "nodes": {n: {"position": at, "support": "hinge", "axis": axis} for n, (at, axis) in nodes.items()},
        "members": {f"m{i}": {"nodes": [a, b][::order], "type": "rigid"} for i, (a, b) in enumerate(pairwise(names))},
        "loads": {"f": {"type": "force", "node": "end", "value": [0.3, 0.5, -0.4]}},
        "analysis": {"accuracy": 1e-6},
    }
    table["nodes"]["end"] = {"position": [0.8, 0.1, 1.0]}
    table["members"]["arm"] = {"nodes": [names[1], "end"], "section": "s"}
    return table


COLLINEAR = {"a": ([0, 0, 0], [0, 0, 1]), "b": ([0, 0, 1], [0, 0, 1]), "c": ([0, 0, 2], [0, 0, 1])}
SKEW = {"a": ([0, 0, 0], [1, 0, 0]), "b": ([0, 0, 1], [0, 1, 0]), "c": ([0.5, 0, 1.4], [0, 0.6, 0.8])}


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("nodes", [COLLINEAR, SKEW])
def test_redundant_reactions_are_the_smallest_that_balance(nodes, order):
    """Against the pseudo-inverse of the six balances of the body; no hinge has a moment about its axis."""
    table = held_body(nodes, order)
    if nodes is COLLINEAR:
        table["springs"] = {"s": {"node": "b", "stiffness": 3.0}}
    step = sfetcas.solve(made(table)).last
    at, force, length = step.position("end"), np.array([0.3, 0.5, -0.4]), step.model.scales.length
    columns, found = [], []
    for name, (place, axis) in nodes.items():
        axis, place = np.array(axis), np.array(place)
        across = np.eye(3) - np.outer(axis, axis)
        columns += [np.append(e, np.cross(place, e)) for e in np.eye(3)]
        columns += [np.append(np.zeros(3), length * across @ e) for e in np.eye(3)]
        reaction, moment = step.reaction(name)
        assert moment @ axis == pytest.approx(0.0, abs=1e-10)
        found.append(np.append(reaction, moment / length))
    load = np.append(force, np.cross(at, force))
    # What the spring does about the hinges is no reaction.
    if nodes is COLLINEAR:
        load[5] += step.spring("s").effort
    smallest = np.linalg.pinv(np.array(columns).T) @ -load
    # Moments inside count 1e-8 beside reactions; the arm is balanced to 1e-10.
    np.testing.assert_allclose(np.concatenate(found), smallest, atol=1e-7)
    assert any("not unique" in note for note in step.notes)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_small_member_alone_between_held_points_tells_that_its_pull_is_not_known(dimension):
    """It does not stretch: what the load along it does to either end is open, and the halves are the smallest."""
    table = {
        "dimension": dimension,
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "ball"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "small"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [3.0, 1.0]}},
    }
    step = sfetcas.solve(made(table)).last
    assert any("reactions are not unique" in note and "member m" in note for note in step.notes)
    np.testing.assert_allclose(step.reaction("A")[0], [-1.5, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(step.reaction("B")[0], [-1.5, -1.0, 0.0], atol=1e-12)


def test_loops_within_one_rigid_body_need_no_closings():
    """A ladder of rigid members is one body: no redundant rows, and the answer of a single member in its place."""
    table = {
        "nodes": {f"n{i}{j}": {"position": [0.5 * i, 0.4 * j]} for i in range(6) for j in range(2)},
        "members": {f"v{i}": {"nodes": [f"n{i}0", f"n{i}1"], "type": "rigid"} for i in range(6)},
        "sections": {"s": {"EI3": 1.0}},
        "springs": {"s": {"node": "n00", "stiffness": 2.0}},
        "loads": {"f": {"type": "force", "node": "e", "value": [0.4, -0.7]}},
        "analysis": {"accuracy": 1e-7},
    }
    for i, (a, b) in enumerate(pairwise(range(6))):
        table["members"] |= {f"h{i}{j}": {"nodes": [f"n{a}{j}", f"n{b}{j}"], "type": "rigid"} for j in range(2)}
    table["nodes"]["n00"]["support"] = "hinge"
    table["nodes"]["e"] = {"position": [3.2, 0.5]}
    table["members"]["f"] = {"nodes": ["n51", "e"], "section": "s"}
    step = sfetcas.solve(made(table)).last
    assert not step.model.positions.rows
    table["nodes"] = {n: table["nodes"][n] for n in ("n00", "n51", "e")}
    table["members"] = {"f": table["members"]["f"], "one": {"nodes": ["n00", "n51"], "type": "rigid"}}
    alone = sfetcas.solve(made(table)).last
    # Twice the accuracy asked for, times the size.
    np.testing.assert_allclose(step.position("e"), alone.position("e"), atol=6e-7)
    for found, wanted in zip(step.reaction("n00"), alone.reaction("n00"), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_spring_turns_about_the_axis_of_its_hinge():
    table = {
        "nodes": {"A": {"position": [0, 0, 0], "support": "hinge", "axis": [0, 1, 0]}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"s": {"node": "A", "stiffness": 2.0}},
        "loads": {"c": {"type": "moment", "node": "B", "value": [0, 0.5, 0]}},
    }
    step = sfetcas.solve(made(table)).last
    assert step.spring("s").travel == pytest.approx(0.25, abs=1e-12)
    table["springs"]["s"]["axis"] = [0, 0, 1]
    with pytest.raises(
        sfetcas.SceneError, match=r"^springs\.s\.axis: found \[0.0, 0.0, 1.0\], accepted: along the axis"
    ):
        made(table)


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize(("given", "bending"), [("section", 3.0), ("matrix", 1.0)])
def test_a_pull_that_small_members_do_not_feel_across_is_told(space, given, bending):
    """At a tenth of 12 EI / L^2 a note begins; it is the force along the bar that counts, wherever that points."""
    member = {"nodes": ["A", "B"], "type": "small"}
    member |= (
        {"section": "s"} if given == "section" else {"stiffness": textbook_cantilever(1e7)["members"]["m"]["stiffness"]}
    )
    table = {
        "dimension": "space" if space else "plane",
        "sections": {"s": {"EI2": bending, "EI3": bending, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0.6, 0.8], "support": "slider", "direction": [0.6, 0.8]},
        },
        "members": {"m": member},
    }
    for part, told in ((0.09, False), (0.11, True), (-0.11, True)):
        force = 12.0 * bending * part * np.array([0.6, 0.8])
        table["loads"] = {"F": {"type": "force", "node": "B", "value": force.tolist()}}
        notes = sfetcas.solve(made(table)).last.notes
        assert any(f"carries {abs(part):.2g} of 12 EI / L^2" in note for note in notes) is told
