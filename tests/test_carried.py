"""What members are taken to carry: trees exactly, loops generously, and never more than all loads."""

import numpy as np
import pytest
from scenes import SOFT, made

from benchmarks.scenes import woven
from sfetcas import first_mesh
from sfetcas.mechanics.carried import _parts, carried, loose_ends
from sfetcas.mechanics.mesh import every_other


def tree(parents, forces, **more):
    """A tree in the plane: node k hangs on node ``parents[k - 1]``, node 0 is clamped."""
    nodes = {"0": {"position": [0, 0], "support": "clamped"}}
    members, rng = {}, np.random.default_rng(0)
    for k, parent in enumerate(parents, start=1):
        place = np.asarray(nodes[str(parent)]["position"]) + rng.normal(size=2)
        nodes[str(k)] = {"position": place.tolist()}
        members[str(k)] = {"nodes": [str(parent), str(k)], "section": "s"}
    loads = {str(k): {"type": "force", "node": str(k), "value": [0.0, f]} for k, f in forces.items()}
    return {"sections": {"s": {**SOFT}}, "nodes": nodes, "members": members, "loads": loads, **more}


def beyond(parents, forces, k):
    """Loads on node k and on all that hangs on it."""
    return abs(forces.get(k, 0.0)) + sum(beyond(parents, forces, i) for i, p in enumerate(parents, 1) if p == k)


@pytest.mark.parametrize("seed", range(3))
def test_member_of_a_tree_carries_what_acts_beyond_it(seed):
    rng = np.random.default_rng(seed)
    parents = [int(rng.integers(0, k)) for k in range(1, 30)]
    forces = {int(k): float(rng.normal()) for k in rng.choice(np.arange(1, 30), 12, replace=False)}
    found = carried(made(tree(parents, forces, analysis={"steps": [0.5, -2.0]})))
    for k in range(1, 30):
        # forces at the largest factor; rounding of a solve with thirty unknowns
        assert found[str(k)].force == pytest.approx(2.0 * beyond(parents, forces, k), rel=1e-12, abs=1e-12)


def test_member_carries_its_own_load_and_weight_as_well():
    table = tree([0, 1], {2: 3.0}, gravity=[0, -10])
    table["loads"]["q"] = {"type": "distributed", "member": "1", "value": [4.0, 0.0]}
    scene = made(table)
    length = {name: line.length for name, line in scene.center_lines.items()}
    found, weight = carried(scene), 10.0 * SOFT["rhoA"]
    assert found["2"].force == pytest.approx(3.0 + weight * length["2"], rel=1e-12)
    assert found["1"].force == pytest.approx(3.0 + weight * length["2"] + (weight + 4.0) * length["1"], rel=1e-12)


def test_few_members_in_loops_carry_everything_as_does_what_only_guides_or_springs_hold():
    # Two members between supports, then a guide or a spring in place of the second support.
    for end in ({"support": "clamped"}, {"support": "slider", "direction": [1, 0]}, {}):
        table = tree([0, 1], {1: 5.0})
        table["nodes"]["2"] |= end
        if not end:
            table["springs"] = {"k": {"type": "translational", "node": "2", "stiffness": 1.0}}
        assert [found.force for found in carried(made(table)).values()] == [5.0, 5.0]
    table["nodes"]["0"] = {"position": [0, 0], "support": "slider", "direction": [0, 1]}
    assert [found.force for found in carried(made(table)).values()] == [5.0, 5.0]


def test_obstacles_may_hold_any_member():
    table = tree([0, 1], {1: 5.0})
    table["contacts"] = {
        "wall": {"type": "line", "members": ["2"], "point": [0, -9], "direction": [1, 0], "side": [0, 1]}
    }
    assert [found.force for found in carried(made(table)).values()] == [5.0, 5.0]


def test_moment_on_a_hinged_foot_turns_what_stands_on_it():
    table = tree([0, 1], {})
    table["nodes"]["0"]["support"] = "hinge"
    table["nodes"]["2"]["support"] = "hinge"
    table["loads"] = {"m": {"type": "moment", "node": "0", "value": 7.0}}
    assert [found.moment for found in carried(made(table)).values()] == [7.0, 7.0]


def test_members_of_a_net_share_the_loads():
    """A row pulled at every node: what a member carries does not grow with the net, nor does its mesh."""
    few, many = woven(30), woven(600)
    largest = [max(found.force for found in carried(scene).values()) for scene in (few, many)]
    assert largest[1] < 1.2 * largest[0] < 0.3 * sum(np.linalg.norm(load.vector) for load in many.loads.values())
    per_member = [first_mesh(scene, 4).elements / len(scene.members) for scene in (few, many)]
    assert per_member[0] == per_member[1]


@pytest.mark.parametrize("seed", range(8))
def test_bridges_are_what_falls_apart_without_them(seed):
    """Against removing edges one by one, on random graphs with parallel edges and parts the ground is not joined to."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 15))
    edges = rng.integers(0, count, (int(rng.integers(1, 20)), 2))

    def joined(chosen):
        """For each two nodes whether edges join them."""
        reach = np.eye(count, dtype=bool)
        for _ in range(count):
            for a, b in edges[chosen]:
                reach[a] = reach[b] = reach[a] | reach[b]
        return reach | reach.T

    grounded, loops = _parts(edges, count)
    everything = joined(np.arange(len(edges)))
    np.testing.assert_array_equal(grounded, everything[0])
    without = [joined(np.delete(np.arange(len(edges)), e)) for e in range(len(edges))]
    together = np.logical_and.reduce([everything, *without])
    for e, (a, b) in enumerate(edges):
        assert (loops[e] < 0) == (not without[e][a, b])
        for f in np.flatnonzero(loops >= 0):
            if loops[e] >= 0:
                # of the same loops: no single edge keeps them together
                assert (loops[e] == loops[f]) == together[a, edges[f, 0]]


ENDS = {
    "free": ({}, True),
    "in space": ({"dimension": "space"}, True),
    "moment": ({"loads": {"m": {"type": "moment", "node": "B", "value": 1.0}}}, False),
    "moment along": ({"loads": {"m": {"type": "moment", "member": "m", "at": 0.5, "value": 1.0}}}, False),
    "spring": ({"springs": {"k": {"node": "B", "stiffness": 1.0}}}, False),
    "pulled by a spring": ({"springs": {"k": {"type": "translational", "node": "B", "stiffness": 1.0}}}, True),
    "held": ({"nodes": {"B": {"position": [1, 0], "support": "slider", "direction": [1, 0]}}}, False),
    "hinge": ({"nodes": {"B": {"position": [1, 0], "support": "hinge"}}}, True),
    "hinge in space": ({"dimension": "space", "nodes": {"B": {"position": [1, 0], "support": "hinge"}}}, False),
    "ball in space": ({"dimension": "space", "nodes": {"B": {"position": [1, 0], "support": "ball"}}}, True),
    "goes on": ({"nodes": {"C": {"position": [2, 0]}}, "members": {"n": {"nodes": ["B", "C"], "section": "s"}}}, False),
    "goes on from a hinge": (
        {
            "nodes": {"B": {"position": [1, 0], "joint": "hinge"}, "C": {"position": [2, 0]}},
            "members": {"n": {"nodes": ["B", "C"], "section": "s"}},
        },
        True,
    ),
    "released": (
        {
            "nodes": {"C": {"position": [2, 0]}},
            "members": {
                "m": {"nodes": ["A", "B"], "section": "s", "release": ["rigid", "hinge"]},
                "n": {"nodes": ["B", "C"], "section": "s"},
            },
        },
        True,
    ),
    "curved": (
        {"members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.5}}}},
        False,
    ),
    "actuated": ({"actuations": {"a": {"member": "m", "value": 1.0}}}, False),
    "heavy end": ({"nodes": {"B": {"position": [1, 0], "mass": 1.0, "inertia": [0, 0, 1.0]}}}, False),
}
"""What is at the second end of a member, and whether nothing bends it there."""


@pytest.mark.parametrize("name", ENDS)
def test_elements_are_short_where_something_bends_the_end(name):
    more, loose = ENDS[name]
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"f": {"type": "distributed", "member": "m", "value": [0, -1e6]}},
    }
    for key, records in more.items():
        table[key] = {**table.get(key, {}), **records} if isinstance(records, dict) else records
    scene = made(table)
    assert loose_ends(scene)["m"] == (False, loose)
    lengths = np.diff(first_mesh(scene, 4).cuts["m"])
    # Layers are a thousandth of the length.
    assert lengths[0] < 2e-3
    assert (lengths[-1] > 0.1) == loose


def test_half_of_a_mesh_keeps_ends_where_something_acts():
    table = tree([0], {1: 1.0})
    table["loads"]["within"] = {"type": "force", "member": "1", "at": 0.3, "value": [0, 1.0]}
    scene = made(table)
    cuts = np.array([0.0, 0.3, 0.5, 0.75, 1.0])
    assert every_other(scene, "1", cuts).tolist() == [0.0, 0.3, 0.5, 1.0]
    assert every_other(scene, "1", np.array([0.0, 0.15, 0.3, 0.65, 1.0])).tolist() == [0.0, 0.3, 1.0]
