"""Scenes at random in which members touch each other, by kinds, each from its seed; dictionaries as in a scene file.

Lengths and stiffness are of order 1, loads from a third to some thirty EI/L^2, radii from 0.3 to 3 % of the length.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

__all__ = ["KINDS", "member_scene"]

Table = dict[str, Any]


class _Draw:
    """What is drawn at random."""

    def __init__(self, seed: int, kind: int) -> None:
        self.rng = np.random.default_rng([seed, kind])
        self.radius = round(float(10.0 ** self.rng.uniform(-2.5, -1.5)), 5)

    def between(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 4)

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def load(self, low: float = 0.3, high: float = 30.0) -> float:
        return round(float(10.0 ** self.rng.uniform(math.log10(low), math.log10(high))), 4)

    def section(self) -> Table:
        bending = self.between(0.5, 2.0)
        return {"EI2": bending, "EI3": bending, "GJ": round(0.77 * bending, 4), "rhoA": 1.0}

    def clear(self, least: float = 0.0) -> float:
        """Distance of centre lines that do not touch, by a random gap."""
        return round(2.0 * self.radius + max(least, self.between(0.001, 0.05)), 5)

    def table(self, space: bool, nodes: Table, members: Table, **others: Any) -> Table:
        """A scene of sections at random, one for each flexible member."""
        sections = {f"of {name}": self.section() for name in members}
        for name, member in members.items():
            member.setdefault("section", f"of {name}")
        contact = {"type": "members", "members": "all", "radius": self.radius}
        scene = {"sections": sections, "nodes": nodes, "members": members, "contacts": {"c": contact}}
        return {"dimension": "space" if space else "plane", **scene, "analysis": {"accuracy": 1e-5}, **others}


def _held(*position: float, support: str = "clamped", **keys: Any) -> Table:
    return {"position": list(position), "support": support, **keys}


def _node(*position: float) -> Table:
    return {"position": list(position)}


def _crossed(draw: _Draw) -> Table:
    """Two cantilevers that cross each other in space, the upper one pulled down at its tip."""
    angle, x, z = draw.between(0.5, 2.6), draw.between(0.4, 0.95), draw.clear()
    way = np.array([math.cos(angle), math.sin(angle), 0.0])
    begin, share = np.array([x, 0.0, 0.0]), draw.between(0.3, 0.9)
    nodes = {"a0": _held(0.0, 0.0, z), "a1": _node(1.0, 0.0, z)}
    nodes |= {"b0": _held(*(begin - share * way).round(6)), "b1": _node(*(begin + (1.0 - share) * way).round(6))}
    members = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"]}}
    load = {"type": "force", "node": "a1", "value": [0.0, draw.between(-1.0, 1.0), -draw.load()]}
    return draw.table(True, nodes, members, loads={"tip": load})


def _bridge(draw: _Draw) -> Table:
    """A rod that lies on two others and is pressed on them."""
    z, nodes, members = draw.clear(), Table(), Table()
    for name, x in (("a", draw.between(-0.4, -0.2)), ("b", draw.between(0.2, 0.4))):
        nodes |= {f"{name}0": _held(x, -0.5, 0.0), f"{name}1": _held(x + draw.between(-0.1, 0.1), 0.5, 0.0)}
        nodes[f"{name}1"] |= {"support": "slider", "direction": [0, 1, 0]}
        members[name] = {"nodes": [f"{name}0", f"{name}1"]}
    guide: dict[str, Any] = {"support": "slider", "direction": [0, 0, 1], "rotation": "ball"}
    nodes |= {"c0": _node(-0.6, draw.between(-0.2, 0.2), z), "m": _held(0.0, 0.0, z, **guide), "c1": _node(0.6, 0.0, z)}
    members |= {"c": {"nodes": ["c0", "m"]}, "d": {"nodes": ["m", "c1"]}}
    members["d"]["section"] = "of c"
    press, springs = draw.load(1.0), Table()
    if not draw.chance(0.7):
        # Nothing but the other rods holds it up: it shall not slide off them aside, nor bend and fall between them.
        nodes["m"]["rotation"] = "fixed"
        press = min(press, 5.0)
    else:
        spring = {"type": "translational", "node": "m", "stiffness": 1.0, "anchor": [0.0, 0.0, 1.0 + z], "length": 1.0}
        springs = {"soft": spring}
        for name, y in (("c0", nodes["c0"]["position"][1]), ("c1", 0.0)):
            x = nodes[name]["position"][0]
            springs[name] = {"type": "translational", "node": name, "stiffness": 1.0, "anchor": [x, y + 1.0, z]}
    loads = {"press": {"type": "force", "node": "m", "value": [0.0, 0.0, -press]}}
    gravity = [0.0, 0.0, -0.5]
    return draw.table(True, nodes, members, loads=loads, gravity=gravity, springs=springs)


def _leaves(draw: _Draw) -> Table:
    """Leaf springs of different length, clamped one above the other, the tip of the longest pulled down."""
    nodes, members, y, length = Table(), Table(), 0.0, 1.0
    for name in "abcd"[: int(draw.rng.integers(2, 5))]:
        nodes |= {f"{name}0": _held(0.0, y), f"{name}1": _node(length, y)}
        members[name] = {"nodes": [f"{name}0", f"{name}1"]}
        y, length = round(y - draw.clear(), 5), round(length * draw.between(0.6, 0.97), 4)
    load = {"type": "force", "node": "a1", "value": [draw.between(-0.5, 0.5), -draw.load()]}
    return draw.table(False, nodes, members, loads={"tip": load})


def _parallel(draw: _Draw) -> Table:
    """Two beams on the same supports, pressed together along their length."""
    y, q = draw.clear(), draw.load(3.0, 100.0)
    held = "clamped" if draw.chance(0.5) else "hinge"
    turning = "fixed" if held == "clamped" else "hinge"
    guide: dict[str, Any] = {"support": "slider", "direction": [1, 0], "rotation": turning}
    nodes = {"a0": _held(0.0, y, support=held), "a1": _held(1.0, y, **guide)}
    nodes |= {"b0": _held(0.0, 0.0, support=held), "b1": _held(draw.between(0.8, 1.2), 0.0, **guide)}
    members = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"]}}
    load = {"type": "distributed", "member": "a", "value": [0.0, -q]}
    return draw.table(False, nodes, members, loads={"press": load})


def _loop(draw: _Draw) -> Table:
    """A beam whose ends are brought together, or turned too, so that it closes to a loop.

    Between the ends, which are held, there is room for it to bend: else no force would bring them there.
    """
    members = {"a": {"nodes": ["a0", "a1"], "shape": {"type": "arc", "angle": -draw.between(0.3, 1.0)}}}
    nodes = {"a0": _held(0.0, 0.0), "a1": _held(1.0, 0.0)}
    room = round(2.0 * draw.radius + draw.between(0.06, 0.3), 5)
    if draw.chance(0.5):
        move = {"displacement": [round(room - 1.0, 5), 0.0], "rotation": 0.0}
    else:
        move = {"displacement": [round(room - 1.0, 5), draw.between(0.0, 0.1)], "rotation": draw.between(3.5, 6.0)}
    aside = {"type": "distributed", "member": "a", "value": [0.0, draw.between(0.5, 2.0)]}
    motions = {"close": {"node": "a1", **move}}
    return draw.table(False, nodes, members, loads={"aside": aside}, motions=motions)


def _twisted(draw: _Draw) -> Table:
    """Two rods between a wall and a plate that is turned and pulled."""
    apart, pull = draw.clear() / 2.0, draw.load(1.0, 30.0)
    nodes = {"a0": _held(0.0, apart, 0.0), "b0": _held(0.0, -apart, 0.0)}
    nodes |= {"p": _held(1.0, 0.0, 0.0, support="slider", direction=[1, 0, 0])}
    nodes |= {"a1": _node(1.0, apart, 0.0), "b1": _node(1.0, -apart, 0.0)}
    members: Table = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"]}}
    members |= {"pa": {"nodes": ["p", "a1"], "type": "rigid"}, "pb": {"nodes": ["p", "b1"], "type": "rigid"}}
    turn = {"node": "p", "rotation": [round(2.0 * math.pi * draw.between(0.3, 1.5), 4), 0.0, 0.0]}
    load = {"type": "force", "node": "p", "value": [pull, 0.0, 0.0]}
    contact = {"type": "members", "members": ["a", "b"], "radius": draw.radius}
    return draw.table(True, nodes, members, loads={"pull": load}, motions={"turn": turn}, contacts={"c": contact})


def _ropes(draw: _Draw) -> Table:
    """Three heavy ropes that cross each other, held by balls at their ends, which come nearer."""
    nodes, members, motions = Table(), Table(), Table()
    z, clamped = 0.0, draw.chance(0.6)
    for i, name in enumerate("abc"):
        angle = i * math.pi / 3.0 + draw.between(-0.2, 0.2)
        way, middle = (
            np.array([math.cos(angle), math.sin(angle), 0.0]),
            np.array([*draw.rng.uniform(-0.05, 0.05, 2), z]),
        )
        down = round(-i * draw.between(0.1, 0.2), 4)
        for k, sign in ((0, -0.5), (1, 0.5)):
            side = np.array([-math.sin(angle), math.cos(angle), 0.0])
            support = {"support": "hinge", "axis": side.round(6).tolist()} if k == 0 else {"support": "ball"}
            support = {"support": "clamped"} if clamped else support
            nodes[f"{name}{k}"] = _held(*(middle + sign * way).round(6), **support)
            inward = -0.2 * sign * way
            motions[f"{name}{k}"] = {"node": f"{name}{k}", "displacement": [*inward[:2].round(6).tolist(), down]}
        members[name] = {"nodes": [f"{name}0", f"{name}1"]}
        z = round(z + draw.clear(), 5)
    return draw.table(True, nodes, members, motions=motions, gravity=[0.0, 0.0, -draw.load(3.0, 100.0)])


def _bar(draw: _Draw) -> Table:
    """A rigid bar on a hinge that falls on a flexible beam."""
    space, y = draw.chance(0.5), draw.clear(0.02)
    x, length = draw.between(0.3, 0.8), draw.between(0.4, 1.0)
    if space:
        nodes = {"b0": _held(x, -0.5 * length, y, support="hinge", axis=[1, 0, 0]), "b1": _node(x, 0.5 * length, y)}
        value = [0.0, 0.0, -draw.load()]
    else:
        nodes = {"b0": _held(x - 0.7, y, support="hinge"), "b1": _node(round(x - 0.7 + length, 4), y)}
        value = [0.0, -draw.load()]
    nodes |= {"a0": _held(0.0, *[0.0] * (1 + space)), "a1": _node(1.0, *[0.0] * (1 + space))}
    members = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"], "type": "rigid"}}
    return draw.table(space, nodes, members, loads={"down": {"type": "force", "node": "b1", "value": value}})


def _hinged(draw: _Draw) -> Table:
    """Two members with a hinge between them, pressed on a third one."""
    y, x = draw.clear(0.01), draw.between(0.4, 0.6)
    nodes = {"a0": _held(0.0, y), "h": {**_node(x, y), "joint": "hinge"}, "a1": _held(1.0, y)}
    nodes["a1"] |= {"support": "slider", "direction": [1, 0], "rotation": "hinge"}
    nodes |= {"b0": _held(0.0, 0.0, support="clamped"), "b1": _node(draw.between(0.5, 1.1), 0.0)}
    members = {"a": {"nodes": ["a0", "h"]}, "b": {"nodes": ["h", "a1"]}, "c": {"nodes": ["b0", "b1"]}}
    loads = {"press": {"type": "force", "node": "h", "value": [0.0, -draw.load()]}}
    return draw.table(False, nodes, members, loads=loads)


def _arcs(draw: _Draw) -> Table:
    """Two half-rings, or a half-ring and a beam, pressed on each other."""
    shift, y, round_too = draw.between(-0.4, 0.4), draw.clear(), draw.chance(0.6)
    size = draw.between(0.3, 0.5)
    # The first one opens upwards: its lowest point is above the top of the second one.
    top = y + size + (0.5 if round_too else 0.0)
    nodes = {
        "a0": _held(shift - size, round(top, 5)),
        "a1": _held(round(shift + size, 5), round(top, 5)),
    }
    nodes |= {"b0": _held(-0.5, 0.0), "b1": _held(0.5, 0.0)}
    second = {"shape": {"type": "arc", "angle": -round(math.pi, 12)}} if round_too else {}
    members = {"a": {"nodes": ["a0", "a1"], "shape": {"type": "arc", "angle": math.pi}}}
    members["b"] = {"nodes": ["b0", "b1"], **second}
    if not round_too:
        nodes["b1"] |= {"support": "slider", "direction": [1, 0]}
    down = -draw.between(0.05, 0.3)
    motions = {f"down {n}": {"node": n, "displacement": [0.0, down]} for n in ("a0", "a1")}
    return draw.table(False, nodes, members, motions=motions)


def _ends(draw: _Draw) -> Table:
    """A member whose end is pushed against the side of another one."""
    x, y = draw.between(0.3, 0.9), draw.clear()
    tilt = draw.between(-0.4, 0.4)
    length = draw.between(0.5, 1.0)
    nodes = {"a0": _held(0.0, 0.0), "a1": _node(1.0, 0.0), "b1": _node(x, y)}
    nodes["b0"] = _held(round(x + length * math.sin(tilt), 5), round(y + length * math.cos(tilt), 5))
    members = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"]}}
    motions = {"push": {"node": "b0", "displacement": [draw.between(-0.1, 0.1), -draw.between(0.05, 0.4)]}}
    return draw.table(False, nodes, members, motions=motions)


def _lifted(draw: _Draw) -> Table:
    """A beam pressed on another one, and lifted off again by a second load at later steps."""
    space, z = draw.chance(0.5), draw.clear()
    flat = [0.0] if space else []
    nodes = {"a0": _held(0.0, *flat, z), "a1": _node(1.0, *flat, z)}
    ends = ([0.7, -0.4, 0.0], [0.6, 0.6, 0.0]) if space else ([0.0, 0.0], [draw.between(0.7, 1.2), 0.0])
    nodes |= {"b0": _held(*ends[0]), "b1": _node(*ends[1])}
    members = {"a": {"nodes": ["a0", "a1"]}, "b": {"nodes": ["b0", "b1"]}}
    force = draw.load()
    loads = {
        "down": {"type": "force", "node": "a1", "value": [0.0, *flat, -force], "history": "down"},
        "up": {"type": "force", "node": "a1", "value": [0.0, *flat, draw.between(1.0, 1.5) * force], "history": "up"},
    }
    histories = {"down": {"t": [0.0, 1.0], "value": [0.0, 1.0]}, "up": {"t": [1.0, 2.0], "value": [0.0, 1.0]}}
    analysis = {"accuracy": 1e-5, "steps": [0.5, 1.0, 1.5, 2.0]}
    return draw.table(space, nodes, members, loads=loads, histories=histories, analysis=analysis)


KINDS: dict[str, Callable[[_Draw], Table]] = {
    "crossed": _crossed,
    "bridge": _bridge,
    "leaves": _leaves,
    "parallel": _parallel,
    "loop": _loop,
    "twisted": _twisted,
    "ropes": _ropes,
    "bar": _bar,
    "hinged": _hinged,
    "arcs": _arcs,
    "ends": _ends,
    "lifted": _lifted,
}
"""What is drawn, by its name."""


def member_scene(kind: str, seed: int) -> Table:
    """A scene at random.

    Parameters
    ----------
    kind : one of KINDS
    seed : int
        The same seed gives the same scene.

    Example
    -------
    >>> member_scene("leaves", 1) == member_scene("leaves", 1)
    True
    """
    return {"title": f"{kind} {seed}", **KINDS[kind](_Draw(seed, list(KINDS).index(kind)))}
