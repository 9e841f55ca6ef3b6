"""What falls onto obstacles, rolls there and comes to rest."""

import numpy as np
import pytest
from scenes import SOFT, made
from test_contacts import balance, smallest_gap

from sfetcas import SolveError, solve


def chain(seed, kind):
    """A heavy chain at random above a floor or a drum, with forces, couples and hinges here and there."""
    rng = np.random.default_rng(seed)
    count, height = int(rng.integers(1, 5)), rng.uniform(0.05, 0.5)
    places = np.cumsum(np.vstack([[0.0, height], rng.uniform([0.2, -0.15], [0.6, 0.15], (count, 2))]), axis=0)
    places[:, 1] = np.maximum(places[:, 1], 0.02)
    nodes = {f"n{i}": {"position": p.tolist()} for i, p in enumerate(places)}
    nodes["n0"]["support"] = "clamped" if kind != "hinged" else "hinge"
    loads = {}
    for i in range(1, count + 1):
        loads[f"f{i}"] = {"type": "force", "node": f"n{i}", "value": rng.uniform([-1.5, -4], [1.5, 4]).tolist()}
        if kind == "couples":
            loads[f"c{i}"] = {"type": "moment", "node": f"n{i}", "value": float(rng.uniform(-2, 2))}
    members = {f"m{i}": {"nodes": [f"n{i}", f"n{i + 1}"], "section": "s"} for i in range(count)}
    for name in members:
        loads[f"w{name}"] = {"type": "distributed", "member": name, "value": [0, -float(rng.uniform(2, 20))]}
    if kind == "within":
        for name in members:
            lift = [0.0, float(rng.uniform(-6, 6))]
            loads[f"p{name}"] = {"type": "force", "member": name, "at": float(rng.uniform(0.2, 0.8)), "value": lift}
    floor = {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}
    return {
        "sections": {"s": {**SOFT}},
        "nodes": nodes,
        "members": members,
        "loads": loads,
        "contacts": {"floor": floor},
    }


@pytest.mark.parametrize("kind", ["forces", "couples", "within", "hinged"])
@pytest.mark.parametrize("seed", range(1))
def test_heavy_chains_over_a_floor_are_solved(kind, seed):
    """No matter how they come to lie: nothing inside, obstacles and supports carry the loads, stable."""
    table = chain(seed, kind)
    step = solve(made(table)).last
    assert step.certificate.stable is True
    assert smallest_gap(step) > -1e-5  # a tenth of the accuracy
    loads = np.zeros(3)
    for entry in table["loads"].values():
        if entry["type"] != "moment":
            ends = [
                np.array(table["nodes"][n]["position"])
                for n in table["members"].get(entry.get("member"), {}).get("nodes", ())
            ]
            length = np.linalg.norm(ends[1] - ends[0]) if entry["type"] == "distributed" else 1.0
            loads[:2] += np.array(entry["value"]) * length
    # The floor pushes across itself: what acts along it the support alone takes.
    np.testing.assert_allclose(balance(step), -loads, atol=1e-5 * np.abs(loads).max())  # places of contact
    for push_here in np.atleast_2d(step.contacts["floor"]["force"]):
        assert push_here[1] >= 0.0


def ring_on_floor(force, nodes):
    """A ring that is pressed down by its top, in a sleeve there; ``nodes``: angles of further nodes from the top."""
    radius = 0.1
    angles = [0.0, *nodes, 2.0 * np.pi]
    names = ["top", *(f"n{i}" for i in range(len(nodes))), "top"]
    table = {
        "sections": {"s": {"EI3": 0.175}},
        "nodes": {"top": {"position": [0, 0.2], "support": "slider", "direction": [0, 1]}},
        "members": {},
        "loads": {"p": {"type": "force", "node": "top", "value": [0, -force]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}},
        "analysis": {"accuracy": 1e-5},
    }
    for name, angle in zip(names[1:-1], nodes, strict=True):
        table["nodes"][name] = {"position": [-radius * np.sin(angle), radius * (1.0 + np.cos(angle))]}
    for i, (a, b) in enumerate(zip(angles[:-1], angles[1:], strict=True)):
        shape = {"type": "arc", "angle": float(b - a)}
        table["members"][f"m{i}"] = {"nodes": [names[i], names[i + 1]], "section": "s", "shape": shape}
    return table


@pytest.mark.parametrize("force", [30.0, 36.0, 42.0, 48.0])
def test_rolling_at_a_node_is_as_stable_as_between_nodes(force):
    """The place of contact moves when the ring rolls: with or without a node there it is the same ring."""
    at_node, between = (solve(made(ring_on_floor(force, n)), accuracy=1e-7).last for n in ([np.pi], [1.9, 4.2]))
    assert at_node.certificate.stable is between.certificate.stable is True
    # The accuracy asked for, twice, times the size.
    assert at_node.position("top")[1] == pytest.approx(between.position("top")[1], abs=1e-7)
    # Eigenvalues by lumped masses on two meshes, of a thirtieth of that of the free ring at the end: three digits.
    assert at_node.certificate.smallest == pytest.approx(between.certificate.smallest, rel=3e-3)
    assert not any("jumped" in note or "left" in note for note in at_node.notes)


def test_flattened_ring_rolls_away_and_says_so():
    """Where it has become flat on the floor nothing keeps it from rolling to one side."""
    step = solve(made(ring_on_floor(52.0, [np.pi]))).last
    assert step.certificate.stable is True
    assert step.notes[0].startswith("jumped near factor")
    assert step.notes[0].endswith("left an unstable equilibrium there along its unstable mode")


def test_a_ring_that_rolls_to_one_side_stays_there():
    """From one step to the next the state goes on on its own branch, not over the unstable one to the other side."""
    table = ring_on_floor(50.0, [np.pi])
    table["analysis"]["steps"] = [1.0, 1.1]
    sides = [step.contacts["floor"]["member"] for step in solve(made(table)).steps]
    assert sides[0] == sides[1]


def fallen(**more):
    return {
        "gravity": [0, -9.81],
        "sections": {"s": {"EI3": 2.0, "rhoA": 0.5}},
        "nodes": {"a": {"position": [0, 0.3]}, "b": {"position": [1, 0.3]}},
        "members": {"beam": {"nodes": ["a", "b"], "section": "s"}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}},
        **more,
    }


def test_what_only_friction_would_hold_is_refused_with_the_direction():
    with pytest.raises(SolveError, match=r"nothing holds it along \[1, 0\], as contacts\.floor only pushes across it"):
        solve(made(fallen()))
    # A weak spring is enough.
    step = solve(made(fallen(springs={"s": {"type": "translational", "node": "a", "stiffness": 0.01}}))).last
    assert step.position("a")[1] == pytest.approx(0.0, abs=1e-6)


def test_node_that_is_held_inside_an_obstacle_is_named():
    table = fallen(motions={"down": {"node": "a", "displacement": [0, -0.305]}})
    table["nodes"]["a"]["support"] = "clamped"
    with pytest.raises(SolveError, match=r"node a is held 0\.005 m inside contacts\.floor"):
        solve(made(table))


def test_chain_that_falls_onto_a_slope_lies_on_it_in_one_stretch():
    """A chain that falls onto a slope lies on it to its hinge."""
    nodes = {"n0": [0, 0], "n1": [0.88, 0.177], "n2": [1.685, 0.087], "n3": [2.224, -0.175]}
    table = {
        "gravity": [0, -9.81],
        "sections": {"a": {"EI3": 1, "rhoA": 0.3}},
        "nodes": {name: {"position": position} for name, position in nodes.items()},
        "members": {f"m{i}": {"nodes": [f"n{i}", f"n{i + 1}"], "section": "a"} for i in range(3)},
        "loads": {"f": {"type": "force", "node": "n1", "value": [-0.972, -14.16]}},
        "contacts": {"p": {"type": "plane", "point": [0, -0.793], "normal": [-0.1625, 1], "members": "all"}},
        "analysis": {"accuracy": 1e-5},
    }
    table["nodes"]["n0"]["support"], table["nodes"]["n2"]["joint"] = "ball", "hinge"
    table["members"]["m2"]["type"] = "rigid"
    step = solve(made(table)).last
    assert step.certificate.stable is True
    assert smallest_gap(step) > -1e-5  # the accuracy


@pytest.mark.parametrize("height", [0.02, 0.05, 0.1])
def test_a_link_that_falls_a_little_does_not_turn_over(height):
    """Hinged to a short way above the floor it comes to lie beyond the hinge."""
    table = {
        "sections": {"s": {"EI3": 1.0, "rhoA": 2.0}},
        "nodes": {
            "A": {"position": [0, 0.05], "support": "clamped"},
            "B": {"position": [0.6, 0.03], "joint": "hinge"},
            "C": {"position": [1.4, height]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "s"}},
        "gravity": [0, -5],
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "members": "all"}},
    }
    step = solve(made(table)).last
    length = float(np.hypot(0.8, height - 0.03))
    # It lies straight: its end is its length beyond the hinge, to the accuracy of 1e-4.
    np.testing.assert_allclose(step.position("C") - step.position("B"), [length, 0.0, 0.0], atol=2e-4)
