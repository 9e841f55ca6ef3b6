"""What scenes with springs, rigid and small members, joints and followers must not say: one sentence each."""

import copy

import numpy as np
import pytest
from scenes import SOFT, cantilever, made

import sfetcas
from sfetcas import SceneError, SolveError, Status, solve

BAR = {
    "sections": {"s": {**SOFT}},
    "nodes": {
        "A": {"position": [0, 0], "support": "clamped"},
        "B": {"position": [1, 0]},
        "C": {"position": [2, 0.5]},
    },
    "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "s"}},
    "loads": {"f": {"type": "force", "node": "C", "value": [0, 1]}},
}
ROTATIONAL = {"node": "B", "stiffness": 2.0}
ALONG = {"type": "translational", "node": "B", "stiffness": 2.0}
SMALL = {"nodes": ["B", "C"], "type": "small"}


def springs(**spring):
    return {"springs": {"k": spring}}


def member(**more):
    return {"members": {"n": {"nodes": ["B", "C"], "section": "s", **more}}}


def nodes(**changes):
    return {"nodes": changes}


def body(entry=None, value=0.0, size=12):
    """A stiffness of two springs along b1, with one entry changed."""
    matrix = np.zeros((size, size))
    if size == 12:
        matrix[np.ix_([0, 6], [0, 6])] = [[5.0, -5.0], [-5.0, 5.0]]
    if entry:
        matrix[entry] += value
    return {"members": {"n": {**SMALL, "section": None, "stiffness": matrix.tolist()}}}


def merged(table, change):
    for key, value in change.items():
        if isinstance(value, dict) and isinstance(table.get(key), dict):
            merged(table[key], value)
        elif value is None:
            table.pop(key, None)
        else:
            table[key] = value
    return table


UNIVERSAL = {"B": {"joint": "universal", "axis": [1, 0, 0], "axis2": [0, 1, 0]}}
REFUSED = [
    # springs
    (springs(node="X", stiffness=1), "springs.k.node: found 'X'"),
    (springs(**ROTATIONAL | {"stiffness": -1}), "springs.k.stiffness: found -1, accepted: zero or a number above"),
    (springs(node="B"), "springs.k: the key 'stiffness' is missing"),
    (springs(**ROTATIONAL, axis=[0, 0, 0]), "springs.k.axis: found [0.0, 0.0, 0.0], accepted: a direction"),
    (springs(**ROTATIONAL, between=["m", "x"]), "springs.k.between: found 'x'"),
    (springs(**ROTATIONAL, between=["m"]), "springs.k.between: found ['m'], accepted: a list of two"),
    (springs(**ROTATIONAL, between=["m", "m"]), "springs.k.between: found 'm' twice, accepted: two parties"),
    (springs(**ROTATIONAL, between="ground"), "springs.k.between: found 'ground', accepted: a list of two"),
    (springs(**ROTATIONAL, length=1.0), "springs.k.length: not accepted: the spring is rotational"),
    (springs(**ROTATIONAL, to="A"), "springs.k.to: not accepted: the spring is rotational"),
    (springs(**ALONG, axis=[0, 0, 1]), "springs.k.axis: not accepted: the spring is translational"),
    (springs(**ALONG, between=["m", "n"]), "springs.k.between: not accepted: the spring is translational"),
    (springs(**ALONG, to="X"), "springs.k.to: found 'X'"),
    (springs(**ALONG, to="B"), "springs.k.to: found 'B', which is the node itself, accepted: another node"),
    (springs(**ALONG, to="A", anchor=[0, 1]), "springs.k: found the keys 'to' and 'anchor', accepted: one of them"),
    (springs(**ALONG, rest=0.1), "springs.k.rest: accepted with a direction only; the free length is the key 'length'"),
    (springs(**ALONG, direction=[0, 1], length=1), "springs.k.length: accepted without a direction only"),
    (springs(**ALONG, direction=[0, 0]), "springs.k.direction: found [0.0, 0.0, 0.0], accepted"),
    (springs(**ALONG, length=-1), "springs.k.length: found -1, accepted: zero or a number above"),
    (springs(**ROTATIONAL | {"type": "torsional"}), "springs.k.type: found 'torsional', accepted"),
    (
        springs(**ROTATIONAL) | nodes(B={"joint": "hinge"}),
        "springs.k.between: node 'B' has no rotation of its own, as its joint is a hinge; name the members",
    ),
    # types of members
    (member(type="rigid", elements=3), "members.n.elements: a rigid member is not cut into elements"),
    (member(type="small", element="SFET3"), "members.n.element: a small member is not cut into elements"),
    (member(stiffness=np.eye(12).tolist()), "members.n.stiffness: only a small member has a matrix"),
    (member(section=None), "members.n: the key 'section' is missing: a flexible member needs"),
    (member(type="small", section=None), "members.n: accepted for a small member: either a section or a stiffness"),
    (member(type="small", stiffness=np.eye(12).tolist()), "members.n: accepted for a small member: either"),
    (member(type="rigid", nodes=["A", "B", "C"]), "members.n.nodes: found 3 nodes, accepted: two; only a small"),
    (member(type="small", nodes=["A", "B", "C"]), "members.n: the key 'stiffness' is missing: a small member with"),
    (member(nodes=["B", "B"]), "members.n.nodes: found 'B' at both ends, accepted: two different nodes"),
    (member(release=["hinge"]), "members.n.release: found ['hinge'], accepted: a list of two"),
    (member(release=["hinge", "rigid", "rigid"]), "members.n.release: found 3 entries, accepted: one for each of 2"),
    (member(release=["slip", "rigid"]), "members.n.release.0: found 'slip', accepted"),
    (member(type="soft"), "members.n.type: found 'soft', accepted"),
    # matrices
    (body((2, 3), 1.0), "members.n.stiffness: is not symmetric: entry 3, 4 is 1 and entry 4, 3 is 0"),
    (body(size=6), "members.n.stiffness: found 6 x 6, accepted: 12 x 12, 6 for each of 2 nodes"),
    (body((0, 0), 1.0), "members.n.stiffness: resists the rigid motion along b1"),
    (body((5, 5), 1.0), "members.n.stiffness: resists the rigid motion turning about b3 at the first node"),
    (
        merged(body(), {"members": {"n": {"mass": np.eye(18).tolist()}}}),
        "members.n.mass: found 18 x 18, accepted: 12 x 12",
    ),
    (
        merged(body(), {"gravity": [0, -1]}),
        "members.n: the key 'mass' is missing: gravity acts on the member",
    ),
    (member(type="small", mass=np.eye(12).tolist()), "members.n.mass: accepted with a stiffness only"),
    (
        {"members": {"n": {**SMALL, "section": None, "stiffness": [[1, 2], [3]]}}},
        "members.n.stiffness: found [[1, 2], [3]], accepted: a square matrix of finite numbers",
    ),
    (
        {"members": {"n": {**SMALL, "section": None, "stiffness": "k.mtx"}}},
        "members.n.stiffness: there is no file k.mtx",
    ),
    # joints
    (nodes(B={"joint": "universal"}), "nodes.B: the key 'axis2' is missing: a universal joint has an axis on either"),
    (
        nodes(B={**UNIVERSAL["B"], "axis2": [1, 1, 0]}),
        "nodes.B.axis2: found [1.0, 1.0, 0.0], accepted: a direction normal to the key 'axis', [1.0, 0.0, 0.0]",
    ),
    (nodes(B={"axis2": [0, 1, 0]}), "nodes.B.axis2: neither the support nor the joint nor a member end"),
    (member(release=["slider", "rigid"]), "nodes.B: the key 'direction' is missing: a member end slides along"),
    (nodes(C={"support": "cylindrical"}), "nodes.C: the key 'direction' is missing"),
    (
        nodes(C={"support": "cylindrical", "direction": [1, 0], "rotation": "ball"}),
        "nodes.C.rotation: found 'ball', accepted: only for a slider",
    ),
    (nodes(B={"mass": -1}), "nodes.B.mass: found -1.0, accepted: zero or a number above"),
    (
        {"dimension": "plane"} | nodes(B={"direction": [1, 0]}) | member(release=["cylindrical", "rigid"]),
        "members.n.release: dimension is set to 'plane', but members.n.release turns about a line that is not along z",
    ),
    # driven joints
    ({"motions": {"d": {"node": "B", "rotation": 0.1, "between": ["m", "n"]}}}, "motions.d.rotation: found 0.1 where"),
    ({"motions": {"d": {"node": "B", "rotation": 0.1, "between": ["m", "x"]}}}, "motions.d.between: found 'x', acc"),
    (
        {"motions": {"d": {"node": "B", "displacement": [1, 0], "between": ["m", "n"]}}},
        "motions.d.displacement: the second member is joined as rigid, accepted: as slider, cylindrical or slot",
    ),
    # loads
    (
        nodes(B={"joint": "hinge"}) | {"loads": {"f": {"node": "B", "frame": "follower"}}},
        "loads.f.node: node 'B' has no rotation of its own to follow, as its joint is a hinge",
    ),
    (
        member(type="small") | {"loads": {"f": {"node": None, "member": "n", "at": 0.5, "frame": "follower"}}},
        "loads.f.member: found the small member 'n', accepted: a node there, or a fixed force or distributed load",
    ),
    ({"loads": {"f": {"frame": "corotating"}}}, "loads.f.frame: found 'corotating', accepted: fixed, follower"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "start"), REFUSED, ids=[sentence[:60] for _, sentence in REFUSED])
def test_refused_in_one_sentence_that_names_the_place(change, start):
    with pytest.raises(sfetcas.SceneError) as caught:
        made(merged(copy.deepcopy(BAR), copy.deepcopy(change)))
    message = str(caught.value)
    assert message.startswith(start), message
    assert "\n" not in message
    assert "Traceback" not in message


def test_indefinite_stiffness_names_its_eigenvalue_and_shape():
    """A spring that pushes along: symmetric, no resistance to rigid motions, and a negative eigenvalue."""
    table = merged(copy.deepcopy(BAR), body())
    matrix = np.array(table["members"]["n"]["stiffness"])
    matrix[np.ix_([3, 9], [3, 9])] = [[-1.0, 1.0], [1.0, -1.0]]
    table["members"]["n"]["stiffness"] = matrix.tolist()
    with pytest.raises(
        sfetcas.SceneError, match=r"members\.n\.stiffness: is indefinite: eigenvalue -1\.6 of the shape"
    ):
        made(table)


def test_what_stands_unchanged_is_accepted():
    made(BAR)
    table = copy.deepcopy(BAR)
    table["members"]["n"]["release"] = ["weld", "rigid"]
    assert made(table).members["n"].release == ("rigid", "rigid")
    made(merged(copy.deepcopy(BAR), nodes(**UNIVERSAL) | {"dimension": "space"}))


@pytest.mark.parametrize("support", ["hinge", "free"])
def test_part_held_by_a_translational_spring_needs_no_support(support):
    """Two springs hold a part as a support would; without them it floats."""
    table = cantilever()
    table["nodes"]["A"] = {"position": [0, 0]} if support == "free" else {"position": [0, 0], "support": "hinge"}
    hold = {"type": "translational", "node": "A", "stiffness": 3.0}
    table["springs"] = {"a": hold, "b": {**hold, "node": "B"}}
    step = sfetcas.solve(made(table)).last
    total = sum(step.spring(name).effort for name in "ab")
    assert np.isfinite(total)
    if support == "free":
        del table["springs"]
        with pytest.raises(sfetcas.SceneError, match="free to move: nodes A, B moving along x, y and turning"):
            made(table)


def test_release_at_a_joint_is_refused():
    table = cantilever()
    table["nodes"]["C"] = {"position": [2, 0]}
    table["nodes"]["B"] |= {"joint": "hinge", "direction": [1, 0]}
    table["members"]["n"] = {"nodes": ["B", "C"], "section": "s", "release": ["slider", "rigid"]}
    with pytest.raises(SceneError, match=r"^members\.n\.release: found 'slider' at node 'B', whose joint is 'hinge'"):
        made(table)


def test_driven_slider_crank_of_rigid_links():
    """A closing without any displacement kept as an unknown."""
    table = {
        "nodes": {
            "O": {"position": [0, 0], "support": "hinge"},
            "P": {"position": [0.8, 0.6], "joint": "hinge"},
            "Q": {"position": [3, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
        },
        "members": {"crank": {"nodes": ["O", "P"], "type": "rigid"}, "rod": {"nodes": ["P", "Q"], "type": "rigid"}},
        "motions": {"drive": {"node": "O", "rotation": 1.2}},
    }
    step = solve(made(table)).last
    angle, rod = np.arctan2(0.6, 0.8) + 1.2, np.hypot(2.2, 0.6)
    x = np.cos(angle) + np.sqrt(rod**2 - np.sin(angle) ** 2)
    np.testing.assert_allclose(step.position("Q"), [x, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("size", [1e-170, 1e150])
def test_lengths_whose_squares_are_no_numbers_are_refused(size):
    table = cantilever()
    table["nodes"]["B"]["position"] = [size, 0.0]
    with pytest.raises(SceneError, match=r"^members\.m: found a length of .* m, accepted: 1e-100 to 1e\+100 m"):
        made(table)


def two_loops(dimension="plane", **motions):
    """A four-bar linkage of rigid links, and a crank beside it."""
    at = {"A": (0, 0), "B": (0, 1), "C": (1.5, 1), "D": (1.5, 0), "E": (3, 0), "F": (3, 1)}
    how = {"A": "support", "B": "joint", "C": "joint", "D": "support", "E": "support"}
    links = {name: {"nodes": list(name.upper()), "type": "rigid"} for name in ("ab", "bc", "cd", "ef")}
    nodes = {name: {"position": list(p)} | ({how[name]: "hinge"} if name in how else {}) for name, p in at.items()}
    beside = {"beside": {"node": "E", "rotation": 0.2}}
    return made({"dimension": dimension, "nodes": nodes, "members": links, "motions": {**motions, **beside}})


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize(
    "other",
    [{"node": "D", "rotation": 0.5}, {"node": "C", "between": ["bc", "cd"], "rotation": 0.7}],
    ids=["support", "joint"],
)
def test_motions_that_contradict_each_other_are_named(dimension, other):
    """Those of the same loop, not what moves beside it; and none where they agree."""
    first = {"node": "A", "rotation": 0.3}
    sentence = r"\(motions\.first and motions\.other contradict each other in closing of bc, x, closing of bc, y\)$"
    with pytest.raises(SolveError, match=sentence) as caught:
        solve(two_loops(dimension, first=first, other=other))
    assert caught.value.status is Status.INFEASIBLE
    # A parallelogram turns both cranks alike, and its coupler against them by the same angle.
    agreeing = {**other, "rotation": 0.3}
    assert solve(two_loops(dimension, first=first, other=agreeing)).last.certificate.residual < 1e-12


def test_a_motion_beyond_reach_is_named():
    with pytest.raises(SolveError, match=r"; motions\.away asks for more than there is in closing of bc, x"):
        solve(two_loops(away={"node": "D", "displacement": [3.0, 0.0]}))
