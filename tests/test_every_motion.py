"""Every joint, spring, load and motion of the systems of statics moves: methods agree, and damping ends in statics."""

import copy

import numpy as np
import pytest
from motions import SMOOTH
from systems import EVERYTHING, FOLLOWING

import sfetcas
from sfetcas import Scene

pytestmark = pytest.mark.usefixtures("interpreted")

STEP = 0.02


def driven(name, *, section=None, node=None):
    """A system whose loads and motions come up smoothly within 1 s; sections and nodes get further keys."""
    table = EVERYTHING[name]()
    for kind in ("loads", "motions"):
        for record in table.get(kind, {}).values():
            record["history"] = "on"
    table["histories"] = {"on": SMOOTH}
    for each in table["sections"].values():
        each.setdefault("rhoA", 0.5)
        each |= section or {}
    for each in table["nodes"].values():
        each |= node or {}
    return table


def motion(table, end, step, integrator="radau-3", **settings):
    analysis = {"type": "dynamic", "end": end, "step": step, "integrator": integrator, "output": end}
    scene = Scene.from_dict({**copy.deepcopy(table), "analysis": analysis})
    return sfetcas.solve(scene, element="SFET4", elements=1, **settings)


def places(step):
    """Nodes and middles of members."""
    members = [name for name, member in step.model.scene.members.items() if member.type == "flexible"]
    middles = [step.along(name, [0.5])["position"][0] for name in members]
    return np.array([*(step.position(name) for name in step.model.nodes), *middles])


STIFF = ("guided", "small_plane", "small_space")
"""Systems with members that vibrate faster than steps resolve: no order is seen there."""


@pytest.mark.parametrize("name", list(EVERYTHING)[::2])
def test_methods_agree(name):
    table = driven(name, node={"mass": 0.1}, section={"damping": 0.01})
    ways = ["generalised-alpha"] if name in FOLLOWING else ["generalised-alpha", "conserving"]
    there = places(motion(table, 0.6, STEP / 2).last)
    for way in ways:
        apart = [np.abs(places(motion(table, 0.6, STEP / k, way).last) - there).max() for k in (1, 2)]
        assert apart[1] < 2e-3
        # Second order: a quarter at half the step.
        assert apart[0] / apart[1] > 3.5 if name not in STIFF else apart[1] < 1e-4


def undriven(table, last):
    """The same under constant loads and motions, to be looked for near where the motion ended."""
    table = {key: copy.deepcopy(part) for key, part in table.items() if key != "histories"}
    for kind in ("loads", "motions"):
        for record in table.get(kind, {}).values():
            del record["history"]
    # Of two stable equilibria that of the loads growing together is not the one in which this motion comes to rest.
    for name, node in table["nodes"].items() if "collar" in table.get("motions", {}) else ():
        if "support" not in node:
            node["start"] = last.position(name).tolist()
    return Scene.from_dict(table)


@pytest.mark.parametrize("name", list(EVERYTHING)[1::2])
def test_damping_ends_in_statics(name):
    table = driven(name, section={"damping": 1.0, "drag": 3.0}, node={"mass": 0.1, "drag": 3.0})
    last = motion(table, 200.0, 0.2, "radau-2").last
    there = sfetcas.solve(undriven(table, last), element="SFET4", elements=1).last
    # What is left of the slowest motion.
    assert np.abs(places(last) - places(there)).max() < 1e-6
    for node, record in there.model.scene.nodes.items():
        if record.support != "free":
            for one, other in zip(last.reaction(node), there.reaction(node), strict=True):
                assert np.abs(one - other).max() < 1e-5
    assert last.energy["elastic"] == pytest.approx(there.energy["elastic"], abs=1e-5)
