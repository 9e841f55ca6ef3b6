"""Scenes at random: valid ones of every kind that statics knows but contact and stops, each from its seed.

Lengths, stiffness and loads vary over decades but stay sensible: loads from a hundredth to some fifty EI/L^2.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.description.shapes import Curvature, place
from sfetcas.description.structure import SLIDING
from sfetcas.mathematics.arrays import Array
from sfetcas.mathematics.quaternion import from_rotation_vector, matrix, multiply, rotate

__all__ = ["random_scene", "reordered", "transformed"]

Table = dict[str, Any]

NEAREST = 0.2
"""Distance of nodes at least, in a box of side 2."""

TRIES = 200
"""Places tried for a node; beyond, the scene has fewer."""


def random_scene(seed: int, dimension: Literal["plane", "space"] | None = None) -> Scene:
    """A scene at random.

    Parameters
    ----------
    seed : int
        The same seed gives the same scene.
    dimension : plane or space, optional
        Left out, either.

    Example
    -------
    >>> random_scene(1).to_dict() == random_scene(1).to_dict()
    True
    """
    space = seed % 2 == 1 if dimension is None else dimension == "space"
    return _Draw(np.random.default_rng([seed, int(space)]), space).scene(f"random {seed}")


class _Draw:
    """One scene on its way: everything is drawn in a box of side 2 with EI of order 1, then put into other units."""

    def __init__(self, rng: np.random.Generator, space: bool) -> None:
        self.rng, self.space = rng, space
        self.points: list[Array] = []
        self.pairs: list[tuple[int, int]] = []
        self.nodes: Table = {}
        self.members: Table = {}
        self.springs: Table = {}
        self.loads: Table = {}
        self.motions: Table = {}
        self.sections: Table = {}

    # -- numbers --------------------------------------------------------------------------------

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one(self, kinds: Sequence[Any], weights: Sequence[float] | None = None) -> Any:
        shares = None if weights is None else np.array(weights) / np.sum(weights)
        return kinds[int(self.rng.choice(len(kinds), p=shares))]

    def decades(self, low: float, high: float) -> float:
        return float(10.0 ** self.rng.uniform(low, high))

    def vector(self, size: float = 1.0) -> list[float]:
        """In any direction of the plane or of space."""
        drawn = self.rng.normal(size=3) * [1, 1, self.space]
        return list((size * drawn / np.linalg.norm(drawn)).tolist())

    def axis(self) -> list[float]:
        return self.vector() if self.space else [0.0, 0.0, 1.0]

    def universal(self) -> Table:
        first = np.array(self.vector())
        across = np.cross(first, self.vector())
        return {"axis": first.tolist(), "axis2": (across / np.linalg.norm(across)).tolist()}

    # -- parts ----------------------------------------------------------------------------------

    def scene(self, title: str) -> Scene:
        rng = self.rng
        self.draw_sections()
        self.draw_members(int(rng.integers(1, 6)))
        self.draw_joints()
        self.draw_supports()
        self.draw_springs()
        self.draw_loads()
        self.draw_motions()
        table: Table = {
            "title": title,
            "dimension": "space" if self.space else "plane",
            "sections": self.sections,
            "nodes": self.nodes,
            "members": self.members,
            "springs": self.springs,
            "loads": self.loads,
            "motions": self.motions,
        }
        if self.chance(0.4):
            table["gravity"] = self.vector(self.decades(-1.0, 1.0))
        if self.chance(0.15):
            table["analysis"] = {"steps": [0.5, 1.0]}
            if self.chance(0.5):
                table["histories"] = {"course": {"t": [0.0, 0.4, 1.0], "value": [0.0, rng.uniform(-1.0, 1.0), 1.0]}}
                next(iter(self.loads.values()))["history"] = "course"
        return Scene.from_dict(transformed(table, length=self.decades(-2.0, 2.0), force=self.decades(-2.0, 4.0)))

    def draw_sections(self) -> None:
        for number in range(int(self.rng.integers(1, 4))):
            bending, mass = self.decades(-1.0, 1.0), self.decades(-1.0, 0.5)
            section: Table = {
                "EI3": bending,
                "EI2": bending * self.decades(-0.5, 1.5),
                "GJ": bending * self.decades(-0.5, 1.0),
                "rhoA": mass,
            }
            for key in ("EI2", "EI3", "GJ", "rhoA"):
                if self.chance(0.15):
                    end = section[key] * self.rng.uniform(0.3, 2.0)
                    section[key] = (
                        {"at": [0.0, self.rng.uniform(0.2, 0.8), 1.0], "value": [section[key], end, section[key]]}
                        if self.chance(0.5)
                        else {"polynomial": [section[key], end - section[key]]}
                    )
            self.sections[f"s{number}"] = section

    def somewhere(self) -> Array | None:
        """A place for a new node, away from the others."""
        for _ in range(TRIES):
            point = self.rng.uniform(-1.0, 1.0, size=3) * [1, 1, self.space]
            if self.away(point):
                return np.asarray(point)
        return None

    def away(self, point: Array) -> bool:
        return all(float(np.linalg.norm(point - other)) > NEAREST for other in self.points)

    def draw_members(self, count: int) -> None:
        """A tree of members, then some that close loops."""
        self.add_node(np.zeros(3))
        for number in range(count):
            first = int(self.rng.integers(0, len(self.points)))
            kind = self.one(["flexible", "rigid", "small"], [7, 1.5, 1.5])
            led = self.led_from(first) if kind == "flexible" and self.chance(0.3) else None
            shape, end = (None, self.somewhere()) if led is None else led
            if end is None or (led is not None and len(self.points) > 1 and not self.away(end)):
                continue
            second = self.add_node(end)
            self.add_member(f"m{number}", kind, first, second, shape or self.shape_between(first, second, kind, 0.5))
        loops = int(self.one([0, 1, 2], [6, 3, 1])) if len(self.points) > 2 else 0
        for number in range(loops):
            first, second = (int(i) for i in self.rng.choice(len(self.points), 2, replace=False))
            if (first, second) not in self.pairs and (second, first) not in self.pairs:
                kind = self.one(["flexible", "rigid", "small"], [8, 1, 1])
                self.add_member(f"c{number}", kind, first, second, self.shape_between(first, second, kind, 0.8))

    def add_node(self, point: Array) -> int:
        self.nodes[f"n{len(self.points)}"] = {"position": point.tolist()}
        self.points.append(point)
        return len(self.points) - 1

    def add_member(self, name: str, kind: str, first: int, second: int, shape: Table) -> None:
        self.members[name] = {"nodes": [f"n{first}", f"n{second}"], "type": kind, "section": self.a_section()}
        b2 = shape.pop("b2", None)
        self.members[name] |= ({"shape": shape} if shape["type"] != "straight" else {}) | ({"b2": b2} if b2 else {})
        self.pairs.append((first, second))

    def a_section(self) -> str:
        return str(self.one(list(self.sections)))

    def shape_between(self, first: int, second: int, kind: str, bent: float) -> Table:
        """A shape with given ends."""
        if not self.chance(bent):
            return {"type": "straight"}
        a, b = self.points[first], self.points[second]
        across = np.cross(b - a, self.vector()) if self.space else np.array([0.0, 0.0, 1.0])
        across = across / np.linalg.norm(across)
        if kind == "flexible" and self.chance(0.25):
            side = np.cross(across, b - a)
            inner = [a + s * (b - a) + self.rng.uniform(-0.25, 0.25) * side for s in (0.33, 0.67)]
            return {"type": "spline", "points": [p.tolist() for p in (a, *inner, b)]}
        most = 2.5 if kind == "flexible" else 1.2
        angle = float(self.one([-1, 1])) * self.rng.uniform(0.1, most)
        return {"type": "arc", "angle": angle, "normal": across.tolist()}

    def led_from(self, first: int) -> tuple[Table, Array]:
        """A shape that says itself where it ends, and that place."""
        start, length = self.points[first], self.rng.uniform(0.4, 1.8)
        if self.space and self.chance(0.4):
            axis, radius, turns = np.array(self.vector()), self.rng.uniform(0.1, 0.4), self.rng.uniform(0.2, 2.0)
            outward = np.cross(axis, self.vector())
            outward *= radius / np.linalg.norm(outward)
            pitch = self.rng.uniform(-0.6, 0.6)
            center = start - outward
            turned = rotate(from_rotation_vector(2.0 * np.pi * turns * axis), outward)
            shape = {"type": "helix", "radius": radius, "pitch": pitch, "turns": turns, "axis": axis.tolist()}
            return {**shape, "center": center.tolist()}, center + turned + pitch * turns * axis
        kappas = {"kappa3": self.rng.uniform(-2.5, 2.5, size=int(self.rng.integers(1, 4)))}
        tangent = np.array(self.vector())
        b2 = np.cross([0.0, 0.0, 1.0], tangent)
        if self.space:
            kappas |= {key: self.rng.uniform(-1.5, 1.5, size=2) for key in ("kappa2", "twist")}
            b2 = np.cross(tangent, self.vector())
        b2 /= np.linalg.norm(b2)
        shape = {"type": "curvature", "length": length, "start": tangent.tolist(), "b2": b2.tolist()}
        end = start + length * _reach(tangent, b2, {key: length * value for key, value in kappas.items()})
        shape |= {key: value.tolist() for key, value in kappas.items()}
        given = Curvature(**{key: value for key, value in shape.items() if key != "b2"})
        return shape, end - place(given, start, end, b2).end_gap

    def ends_at(self, node: str) -> list[str]:
        return [name for name, member in self.members.items() if node in member["nodes"]]

    def draw_joints(self) -> None:
        for name, node in self.nodes.items():
            ends = self.ends_at(name)
            if len(ends) < 2 or not self.chance(0.35):
                continue
            kinds = ["hinge", "ball", "universal"] if self.space else ["hinge", "ball"]
            if self.chance(0.5):
                self.join(node, self.one(kinds))
                continue
            # The last member that came to a node ends a branch or closes a loop.
            member = self.members[ends[-1]]
            sliding = ["slider", "slot", *(["cylindrical"] if self.space else [])]
            # What slides at the end of a branch is held by nothing but luck.
            closes = ends[-1].startswith("c") or self.chance(0.1)
            how = self.one([*kinds, *(sliding if closes else [])])
            self.join(node, how, "release")
            before = member.get("release", ["rigid", "rigid"])
            member["release"] = [how if end == name else old for end, old in zip(member["nodes"], before, strict=True)]

    def join(self, node: Table, how: str, key: str = "joint") -> None:
        """Joint of a node, or what the release of an end needs there."""
        if key == "joint":
            node["joint"] = how
        if how == "hinge":
            node["axis"] = self.axis()
        elif how == "universal":
            node |= self.universal()
        elif how in SLIDING:
            node["direction"] = self.vector()

    def draw_supports(self) -> None:
        names = list(self.nodes)
        kinds = ["clamped", "hinge", "ball", "slider"] + (["cylindrical", "universal"] if self.space else [])
        root = self.one([k for k in kinds if k != "slider"], [6, 1, 1] + ([1, 1] if self.space else []))
        self.hold(names[0], root)
        for name in names[1:]:
            if self.chance(0.2):
                self.hold(name, self.one(kinds))

    def hold(self, name: str, how: str) -> None:
        """A support, where it does not want another axis or direction than what is joined there."""
        node = self.nodes[name]
        if how in ("hinge", "universal") and "axis" in node:
            how = "clamped"
        if how in ("slider", "cylindrical") and "direction" in node:
            how = "ball"
        if how == "cylindrical" and "axis" in node:
            how = "clamped"
        node["support"] = how
        if how == "hinge":
            node["axis"] = self.axis()
        elif how == "universal":
            node |= self.universal()
        elif how in ("slider", "cylindrical"):
            node["direction"] = self.vector()
        if how == "slider":
            node["rotation"] = self.one(["fixed", "ball", *([] if "axis" in node else ["hinge"])])
            if node["rotation"] == "hinge":
                node["axis"] = self.axis()

    def draw_springs(self) -> None:
        for name, node in self.nodes.items():
            ends = self.ends_at(name)
            turns = node.get("support") in ("hinge", "ball") or node.get("rotation") in ("hinge", "ball")
            hinged = node.get("support") == "hinge" or node.get("rotation") == "hinge"
            if turns and "joint" not in node and (hinged or not self.space) and self.chance(0.6):
                self.springs[f"foot {name}"] = self.rotational(name, {})
            released = [m for m in ends if "hinge" in self.members[m].get("release", ())]
            if len(ends) > 1 and (node.get("joint") == "hinge" or released) and self.chance(0.75):
                between = [next(m for m in ends if m not in released[:1]), (released or ends[1:])[0]]
                if len(set(between)) == 2:
                    self.springs[f"joint {name}"] = self.rotational(name, {"between": between})
        root = self.nodes["n0"]
        if root["support"] == "cylindrical":
            # Nothing else may hold the whole along it.
            along = {"type": "translational", "node": "n0", "direction": root["direction"]}
            self.springs["guide"] = {**along, "stiffness": self.decades(-1.5, 1.5)}
        for number in range(int(self.one([0, 1, 2], [7, 2, 1]))):
            self.springs[f"line {number}"] = self.translational()

    def rotational(self, node: str, more: Table) -> Table:
        rest = {"rest": self.rng.uniform(-0.8, 0.8)} if self.chance(0.3) else {}
        return {"type": "rotational", "node": node, "stiffness": self.decades(-1.5, 2.0), **rest, **more}

    def translational(self) -> Table:
        names = list(self.nodes)
        first = int(self.rng.integers(0, len(names)))
        spring: Table = {"type": "translational", "node": names[first], "stiffness": self.decades(-1.5, 1.5)}
        kind = self.one(["anchor", "to", "direction"])
        if kind == "direction":
            spring |= {"direction": self.vector()} | ({"rest": self.rng.uniform(-0.3, 0.3)} if self.chance(0.5) else {})
        elif kind == "to" and len(names) > 1:
            second = (first + int(self.rng.integers(1, len(names)))) % len(names)
            gap = float(np.linalg.norm(self.points[first] - self.points[second]))
            spring |= {"to": names[second]} | ({"length": gap * self.rng.uniform(0.3, 1.2)} if self.chance(0.5) else {})
        else:
            anchor = self.points[first] + self.rng.uniform(0.3, 1.0) * np.array(self.vector())
            spring |= {"anchor": anchor.tolist()} | ({"length": self.rng.uniform(0.1, 0.6)} if self.chance(0.5) else {})
        return spring

    def draw_loads(self) -> None:
        follows, count = self.chance(0.2), int(self.rng.integers(1, 4))
        for number in range(count):
            frame = {"frame": "follower"} if follows and self.chance(0.6) else {}
            size = self.decades(-2.0, 1.4)
            kind = self.one(["force", "moment", "distributed"], [5, 1 if follows or not self.space else 0.2, 2])
            if kind == "distributed":
                load = self.spread(size, frame)
            else:
                value = self.vector(size) if kind == "force" or self.space else [0.0, 0.0, size * self.one([-1, 1])]
                load = {"type": kind, "value": value, **self.point_of(kind, frame)}
            self.loads[f"q{number}"] = load

    def spread(self, size: float, frame: Table) -> Table:
        name = str(self.one(list(self.members)))
        value = self.vector(size)
        load: Table = {"type": "distributed", "member": name, "value": value}
        if self.members[name]["type"] == "flexible":
            load |= {"frame": "section", "value": [0.0, size, 0.0]} if frame and self.chance(0.5) else frame
        if self.chance(0.3):
            load["profile"] = {"polynomial": self.rng.uniform(-1.0, 2.0, size=2).tolist()}
        elif self.chance(0.1):
            load["profile"] = {"at": [0.0, 0.4, 1.0], "value": [0.0, 1.0, 0.3]}
        return load

    def point_of(self, kind: str, frame: Table) -> Table:
        """Where a force or moment acts, and whether it follows."""
        rigid = [name for name, node in self.nodes.items() if "joint" not in node]
        nodes = rigid if frame or kind == "moment" else list(self.nodes)
        plain = kind == "force" and not frame
        members = [name for name, member in self.members.items() if plain or member["type"] != "small"]
        if members and (not nodes or self.chance(0.3)):
            return {"member": self.one(members), "at": self.rng.uniform(0.05, 0.95), **frame}
        # Nearer to the end of the list nodes are farther from the root.
        return (
            {"node": nodes[int(self.rng.integers(len(nodes) // 2, len(nodes)))], **frame} if nodes else self.at_root()
        )

    def at_root(self) -> Table:
        """The first member, rigid or flexible, or its start: what always takes a load."""
        return {"member": next(iter(self.members)), "at": 0.5}

    def draw_motions(self) -> None:
        for name, node in self.nodes.items():
            support = node.get("support", "free")
            if support in ("clamped", "ball", "hinge") and self.chance(0.15):
                self.motions[f"moved {name}"] = {"node": name, "displacement": self.vector(self.rng.uniform(0.01, 0.3))}
            if support == "clamped" and "joint" not in node and self.chance(0.15):
                angle = self.rng.uniform(-1.0, 1.0)
                self.motions[f"turned {name}"] = {"node": name, "rotation": self.vector(angle) if self.space else angle}
            spring = self.springs.get(f"joint {name}")
            if spring is None and node.get("joint") == "hinge" and self.chance(0.2):
                between, angle = self.ends_at(name)[:2], self.rng.uniform(-1.0, 1.0)
                self.motions[f"driven {name}"] = {"node": name, "between": between, "rotation": angle}


def _reach(tangent: Array, b2: Array, kappas: Table) -> Array:
    """End (3,) of a line of unit length with these curvatures times length, from zero."""
    zero = (0.0,)
    rates = [kappas.get(key, zero) for key in ("twist", "kappa2", "kappa3")]
    frame, end, points = np.column_stack([tangent, b2, np.cross(tangent, b2)]), np.zeros(3), 60
    turn, h = np.array([1.0, 0.0, 0.0, 0.0]), 1.0 / 60

    def at(x: float) -> Array:
        return np.array([np.polynomial.polynomial.polyval(x, rate) for rate in rates])

    for i in range(points):
        # Magnus of order 4 and Simpson's rule: 1e-7 and less, below what the end may be off.
        x = i * h
        begin, middle, last = at(x), at(x + 0.5 * h), at(x + h)
        first = 0.25 * h * (begin + middle) + h * h / 48.0 * np.cross(begin, middle)
        whole = h * (begin + 4.0 * middle + last) / 6.0 + h * h / 12.0 * np.cross(begin, last)
        half = multiply(turn, from_rotation_vector(first))
        after = multiply(turn, from_rotation_vector(whole))
        end += h / 6.0 * (matrix(turn)[:, 0] + 4.0 * matrix(half)[:, 0] + matrix(after)[:, 0])
        turn = after / np.linalg.norm(after)
    return np.asarray(frame @ end)


# Other units, other axes, another order

UNITS: dict[str, dict[str, tuple[int, int, int]]] = {
    "sections": dict.fromkeys(("EI2", "EI3", "GJ"), (1, 2, 0))
    | dict.fromkeys(("EA", "GA2", "GA3"), (1, 0, 0))
    | {"rhoA": (1, -2, 2), "rhoI": (1, 0, 2), "damping": (0, 0, 1), "drag": (1, -2, 1), "rho": (1, -4, 2)}
    | dict.fromkeys(("E", "G"), (1, -2, 0))
    | dict.fromkeys(("width", "height", "radius", "outer", "inner"), (0, 1, 0)),
    "nodes": {"mass": (1, -1, 2), "inertia": (1, 1, 2), "drag": (1, -1, 1)},
    "shape": dict.fromkeys(("radius", "pitch", "length"), (0, 1, 0))
    | dict.fromkeys(("kappa2", "kappa3", "twist"), (0, -1, 0)),
    "rotational": {"stiffness": (1, 1, 0), "damping": (1, 1, 1)},
    "translational": {"stiffness": (1, -1, 0), "damping": (1, -1, 1)}
    | dict.fromkeys(("rest", "length", "stop"), (0, 1, 0)),
    "contacts": {"radius": (0, 1, 0), "member_radius": (0, 1, 0)},
    "actuations": {"value": (0, -1, 0)},
    "histories": {"t": (0, 0, 1)},
    "analysis": dict.fromkeys(("end", "output", "step"), (0, 0, 1)),
}
"""Units of what the keys of a scene give as numbers: powers of force, length and time; others have none."""

VALUES = {"force": (1, 0, 0), "moment": (1, 1, 0), "distributed": (1, -1, 0)}
"""The same of loads by their type."""

POINTS = ("position", "start", "anchor", "point", "center")
"""Keys of places."""

DIRECTIONS = ("axis", "axis2", "direction", "normal", "side", "b2")
"""Keys of vectors without a unit; of shapes ``start`` is one, too."""


def transformed(
    table: Table,
    turn: Array | None = None,
    shift: Sequence[float] = (0.0, 0.0, 0.0),
    length: float = 1.0,
    force: float = 1.0,
    time: float | None = None,
) -> Table:
    """A scene turned by a rotation matrix, moved, in other units of length, force and time.

    Parameters
    ----------
    table : dict
        As ``Scene.to_dict`` gives it, without what analyses are told by name.
    turn : (3, 3), optional
    shift : (3,), in the old unit of length
    length, force, time : new units of the old ones; left out, that of time leaves accelerations as they are
    """
    turn = np.eye(3) if turn is None else np.asarray(turn)
    table, scene = copy.deepcopy(table), Scene.from_dict(table)
    lines = scene.center_lines
    space = table.get("dimension") == "space"
    units = np.array([force, length, np.sqrt(length) if time is None else time])

    def unit(powers: tuple[int, int, int]) -> float:
        return float(np.prod(units**powers))

    def vector(value: Any, factor: float = 1.0) -> Any:
        return (factor * turn @ value).tolist()

    def point(value: Any) -> Any:
        return (length * (turn @ value + shift)).tolist()

    def measured(entry: Table, kind: str) -> None:
        entry |= {key: _times(entry[key], unit(powers)) for key, powers in UNITS[kind].items() if key in entry}

    def placed(entry: Table) -> None:
        entry |= {key: point(entry[key]) for key in POINTS if key in entry}
        # The side of what is round is a word.
        entry |= {key: vector(entry[key]) for key in DIRECTIONS if not isinstance(entry.get(key, ""), str)}

    for kind in ("sections", "nodes", "contacts", "actuations", "histories"):
        for entry in table.get(kind, {}).values():
            if kind != "histories" or table.get("analysis", {}).get("type") == "dynamic":
                measured(entry, kind)
    measured(table.get("analysis", {}), "analysis")
    for node in table["nodes"].values():
        if "axis" not in node and "hinge" in (node.get("support"), node.get("rotation"), node.get("joint")):
            node["axis"] = [0.0, 0.0, 1.0]
        placed(node)
        node |= {"velocity": vector(node["velocity"], unit((0, 1, -1)))} if "velocity" in node else {}
        # About the fixed axes: right where the turn takes these to each other.
        node |= {"inertia": (np.abs(turn) @ node["inertia"]).tolist()} if "inertia" in node else {}
    for contact in table.get("contacts", {}).values():
        if contact["type"] == "cylinder":
            contact.setdefault("axis", [0.0, 0.0, 1.0])
        placed(contact)
    for name, member in table["members"].items():
        member["b2"] = vector(matrix(lines[name].quaternions([0.0]))[0][:, 1])
        shape = member.get("shape", {})
        measured(shape, "shape")
        # What is a place of a node is a direction here.
        start = {"start": vector(shape.pop("start"))} if "start" in shape else {}
        placed(shape)
        shape |= start
        if shape.get("type") == "arc":
            shape.setdefault("normal", vector([0.0, 0.0, 1.0]))
        if "points" in shape:
            shape["points"] = [point(place) for place in shape["points"]]
        for key, powers in (("stiffness", (1, -1, 0)), ("mass", (1, -1, 2))):
            if key in member:
                sides = np.tile(np.repeat([1.0, length], 3), len(member[key]) // 6)
                member[key] = (unit(powers) * np.outer(sides, sides) * member[key]).tolist()
        if "spin" in member:
            spin = member["spin"]
            fixed = isinstance(spin, (list, tuple))
            member["spin"] = vector(spin, 1.0 / units[2]) if fixed else _times(spin, 1.0 / units[2])
    for spring in table.get("springs", {}).values():
        # What turns has a rest and a stop in rad.
        measured(spring, spring["type"])
        placed(spring)
    for load in table.get("loads", {}).values():
        factor = unit(VALUES[load["type"]])
        value = [0.0, 0.0, load["value"]] if np.isscalar(load["value"]) else load["value"]
        own = load.get("frame") == "section"
        load["value"] = (factor * np.array(value)).tolist() if own else vector(value, factor)
    for motion in table.get("motions", {}).values():
        if "displacement" in motion:
            motion["displacement"] = vector(motion["displacement"], length)
        if "rotation" in motion and not np.isscalar(motion["rotation"]):
            motion["rotation"] = vector(motion["rotation"])
        elif "rotation" in motion and space and scene.nodes[motion["node"]].turn == "fixed":
            motion["rotation"] = vector([0.0, 0.0, motion["rotation"]])
    for key, powers in (("gravity", (0, 1, -2)), ("rotating", (0, 0, -1))):
        if key in table:
            table[key] = vector(table[key], unit(powers))
    return table


def _times(value: Any, unit: float) -> Any:
    """A number, numbers, or a table or polynomial of them."""
    if isinstance(value, dict):
        return {key: entry if key == "at" else _times(entry, unit) for key, entry in value.items()}
    return [_times(entry, unit) for entry in value] if isinstance(value, (list, tuple)) else unit * value


def reordered(table: Table, seed: int = 0) -> Table:
    """The same table with its nodes, members, springs, loads and motions in another order.

    Members keep theirs where a universal joint tells the first of them from the others.
    """
    rng, table = np.random.default_rng(seed), copy.deepcopy(table)
    kept = any(node.get("joint") == "universal" for node in table["nodes"].values())
    for key in ("nodes", "springs", "loads", "motions", "contacts", "members"):
        if key not in table or (kept and key == "members"):
            continue
        entries = list(table[key].items())
        table[key] = dict(entries[i] for i in rng.permutation(len(entries)))
    return table
