"""Short lines on obstacles: a heavy cantilever that touches a floor, against the elastica by shooting."""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import sfetcas

WEIGHT, HEIGHT = 10.0, 0.05
"""Per length, of a cantilever with L = EI = 1, and of its clamp over the floor."""


@functools.cache
def lifted(force):
    """A cantilever that sinks onto the floor, its tip lifted by a force.

    Where it leaves the floor its curvature is zero; on either side of that V' = q, EI kappa' = -V cos(theta).
    """

    def beyond(length, shear):
        def change(s, u):
            return [np.cos(u[2]), np.sin(u[2]), u[3], (shear - WEIGHT * s) * np.cos(u[2])]

        return solve_ivp(change, (0, length), [0.0] * 4, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    free = brentq(lambda n: beyond(n, WEIGHT * n - force)[3], 0.1, 0.4, xtol=1e-13)
    # Seen from the floor, mirrored.
    held, _ = fsolve(lambda z: beyond(*z)[1:3] - [HEIGHT, 0.0], [0.7, 3.0], xtol=1e-13)
    tip = beyond(free, WEIGHT * free - force)
    begin, end = float(held), 1.0 - free
    return begin, end, np.array([beyond(held, _)[0] + end - begin + tip[0], tip[1]])


def scene(force, accuracy):
    return sfetcas.Scene.from_dict(
        {
            "dimension": "plane",
            "gravity": [0, -WEIGHT],
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, HEIGHT], "support": "clamped"}, "B": {"position": [1, HEIGHT]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "m"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [0, force]}},
            "analysis": {"accuracy": accuracy},
        }
    )


@pytest.mark.parametrize("accuracy", [1e-5, 1e-7, 1e-8])
@pytest.mark.parametrize("force", [1.05, 1.1069, 1.11, 1.122])
def test_short_lines_against_the_elastica(force, accuracy):
    """Of a length from 0.015 down to 0.0002, where one place and a line are the same."""
    begin, end, tip = lifted(force)
    step = sfetcas.solve(scene(force, accuracy)).last
    assert 1e-4 < end - begin < 0.026
    np.testing.assert_allclose(step.position("B")[:2], tip, atol=accuracy)
    low, high = np.broadcast_to(step.contacts["floor"]["at"], 2)
    if low == high:
        assert begin < low < end
    else:
        # What presses between two places, at most a tenth of their forces here, moves them by a twelfth of its share.
        np.testing.assert_allclose([low, high], [begin, end], atol=0.1 / 12.0 * 2.0 * (end - begin))


@pytest.mark.parametrize("off", [0.0, 3e-14, -7e-14])
def test_a_line_whose_ends_alone_were_found_first_is_one_line(off):
    """Between its ends its weight presses: without that it would be in the floor by less than the accuracy."""
    begin, end, _ = lifted(0.93)
    floor = sfetcas.solve(scene(0.93 * (1.0 + off), 1e-6)).last.contacts["floor"]
    assert isinstance(floor["member"], str)
    # Where a line ends is known less well than positions.
    np.testing.assert_allclose(floor["at"], [begin, end], atol=1e-5)


def drum_cantilever(steps, cut=None):
    """`problems/drum_cantilever_tip_force.toml`, its beam in two at a node where that changes nothing."""
    table = sfetcas.load("problems/drum_cantilever_tip_force.toml").to_dict()
    table["analysis"] = {"accuracy": 1e-7, "steps": steps}
    table.pop("expect")
    if cut:
        table["nodes"]["cut"] = {"position": [2.0 * cut, 0]}
        ends = {"one": ["clamp", "cut"], "other": ["cut", "tip"]}
        table["members"] = {name: {"nodes": nodes, "section": "strip"} for name, nodes in ends.items()}
        table["contacts"]["drum"] = {**table["contacts"]["drum"], "members": list(ends)}
        table["contacts"]["drum"].pop("member")
    return sfetcas.solve(sfetcas.Scene.from_dict(table))


@pytest.mark.parametrize(("steps", "cut"), [([8.0], 0.43), ([0.5, 1.2, 2.5, 6.0, 15.0], 0.45)])
def test_a_line_that_goes_over_a_node_is_the_same_line(steps, cut):
    """Where it ends is located also where no place slides there, and no element at the node is a sliver."""
    for one, other in zip(drum_cantilever(steps).steps, drum_cantilever(steps, cut).steps, strict=True):
        # The accuracy asked for, of the size of the scene.
        np.testing.assert_allclose(other.position("tip"), one.position("tip"), atol=2e-7)
        assert other.notes == one.notes
        assert min(np.diff(cuts).min() for cuts in other.model.mesh.cuts.values()) > 1e-4
