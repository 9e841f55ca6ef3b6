"""Scenes of contact at random, in four families, each from its seed; dictionaries as in a scene file.

Everything has lengths and stiffness of order 1, loads from a third to some thirty EI/L^2.  The first obstacle stands in
the way that a chain takes without any.  What the chains of :mod:`.contact_oracle` do not know is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sfetcas.mathematics.arrays import Array

from .contact_chain import NotAChainError, member_points
from .contact_oracle import free_way

__all__ = ["FAMILIES", "contact_scene"]

Table = dict[str, Any]

Gap = Callable[[Array], Array]
"""Distances (n,) of places (n, 3) from an obstacle."""

FAMILIES = ("pegs", "drums", "floors", "spheres")

CLEAR = 0.01
"""Distance of undeformed members and of held nodes, wherever they are led, from obstacles, at least."""

TRIES = 60
"""Obstacles drawn for each that is wanted."""

REDRAWN = 20
"""Scenes drawn until one has an obstacle."""


def contact_scene(family: str, seed: int) -> Table:
    """A scene at random.

    Parameters
    ----------
    family : pegs, drums, floors or spheres
        Small circles; circles around the whole and large ones beside it; lines; spheres, cylinders and planes in
        space.
    seed : int
        The same seed gives the same scene.

    Example
    -------
    >>> contact_scene("pegs", 1) == contact_scene("pegs", 1)
    True
    """
    for again in range(REDRAWN):
        table = _Draw(np.random.default_rng([seed, FAMILIES.index(family), again]), family).scene(f"{family} {seed}")
        if table["contacts"]:
            break
    return table


class _Draw:
    def __init__(self, rng: np.random.Generator, family: str) -> None:
        self.rng, self.family, self.space = rng, family, family == "spheres"
        self.nodes: Table = {}
        self.members: Table = {}
        self.springs: Table = {}
        self.loads: Table = {}
        self.motions: Table = {}
        self.contacts: Table = {}
        self.bending = float(rng.choice([1.0, self.between(0.3, 3.0)]))

    def between(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 4)

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def vector(self, size: float = 1.0) -> list[float]:
        drawn = self.rng.normal(size=3 if self.space else 2)
        return [round(float(v), 4) for v in size * drawn / np.linalg.norm(drawn)]

    def load(self) -> float:
        """A force of a third to thirty EI/L^2."""
        return self.bending * float(10.0 ** self.rng.uniform(-0.5, 1.5))

    def scene(self, title: str) -> Table:
        kinds = {
            "cantilever": self.cantilever,
            "chain": self.chain,
            "bar": self.bar,
            "held": self.held,
            "portal": self.portal,
            "guided": self.guided,
        }
        shares = [4, 0, 0, 2, 2, 0] if self.space else [3, 3, 1, 3, 2, 1]
        kind = str(self.rng.choice(list(kinds), p=np.array(shares) / sum(shares)))
        kinds[kind]()
        section: Table = {"EI3": self.bending, "rhoA": 1.0}
        if self.space:
            section |= {"EI2": self.bending, "GJ": round(self.bending * self.between(0.5, 1.0), 4)}
        table: Table = {
            "title": f"{title}: {kind}",
            "dimension": "space" if self.space else "plane",
            "sections": {"s": section},
            "nodes": self.nodes,
            "members": self.members,
            "springs": self.springs,
            "loads": self.loads,
            "motions": self.motions,
        }
        if self.chance(0.3) or (self.family == "floors" and self.chance(0.5)) or not (self.loads or self.motions):
            down = [0.0, -1.0] if not self.space else [0.0, 0.0, -1.0]
            towards = down if self.chance(0.6) else self.vector()
            table["gravity"] = [round(v * self.load(), 4) for v in towards]
        self.obstacles(table)
        return table | {"contacts": self.contacts}

    # -- structures ---------------------------------------------------------------------------------------------------

    def node(self, name: str, place: Array | list[float], **more: Any) -> None:
        self.nodes[name] = {"position": [round(float(v), 6) for v in place], **more}

    def member(self, name: str, first: str, second: str, bent: float = 0.0, rigid: bool = False) -> None:
        self.members[name] = {"nodes": [first, second], "section": "s"}
        if rigid:
            self.members[name]["type"] = "rigid"
        elif self.chance(bent):
            angle = float(self.rng.choice([-1, 1])) * self.between(0.2, 1.8)
            self.members[name]["shape"] = {"type": "arc", "angle": angle}
            if self.space:
                chord = np.subtract(self.nodes[second]["position"], self.nodes[first]["position"])
                normal = np.cross(chord, self.vector())
                self.members[name]["shape"]["normal"] = (normal / np.linalg.norm(normal)).tolist()

    def push(self, node: str, turns: bool = True) -> None:
        """A force or, in the plane, a moment at a node; now and then a load along a member as well."""
        if turns and not self.space and self.chance(0.2):
            moment = float(self.rng.choice([-1, 1])) * 0.3 * self.load()
            self.loads["moment"] = {"type": "moment", "node": node, "value": round(moment, 4)}
        else:
            self.loads["force"] = {"type": "force", "node": node, "value": self.vector(self.load())}
        if self.chance(0.2):
            member = next(iter(self.members))
            self.loads["along"] = {"type": "distributed", "member": member, "value": self.vector(self.load())}

    def origin(self) -> list[float]:
        return [0.0, 0.0, 0.0] if self.space else [0.0, 0.0]

    def cantilever(self) -> None:
        self.node("A", self.origin(), support="clamped")
        self.node("B", [1.0, *self.origin()[1:]])
        self.member("b", "A", "B", 0.35)
        self.push("B")

    def chain(self) -> None:
        """Two or three members with hinges and springs between them."""
        count, at, way = int(self.rng.integers(2, 4)), np.zeros(2), self.between(-3.0, 3.0)
        self.node("n0", at, support="clamped")
        for i in range(count):
            way += self.between(-1.0, 1.0)
            at = at + self.between(0.5, 0.9) * np.array([math.cos(way), math.sin(way)])
            self.node(f"n{i + 1}", at, **({"joint": "hinge"} if i < count - 1 else {}))
            self.member(f"m{i}", f"n{i}", f"n{i + 1}", 0.2, rigid=self.chance(0.25))
            if i:
                between = [f"m{i - 1}", f"m{i}"]
                stiffness = round(self.bending * self.between(0.2, 2.0), 4)
                self.springs[f"k{i}"] = {
                    "type": "rotational",
                    "node": f"n{i}",
                    "between": between,
                    "stiffness": stiffness,
                }
        self.push(f"n{count}", turns=False)

    def bar(self) -> None:
        """A rigid bar on a hinge with a spring."""
        self.node("A", [0.0, 0.0], support="hinge")
        self.node("B", [1.0, 0.0])
        self.member("b", "A", "B", rigid=True)
        stiffness = round(self.bending * self.between(0.5, 2.0), 4)
        self.springs["k"] = {"type": "rotational", "node": "A", "stiffness": stiffness}
        self.push("B")

    def held(self) -> None:
        """An arc between two supports, one of them driven."""
        hinged = not self.space and self.chance(0.4)
        self.node("A", self.origin(), support="hinge" if hinged else "clamped")
        self.node("B", [1.2, *self.origin()[1:]], support="clamped")
        self.member("b", "A", "B", 1.0)
        if self.chance(0.3) and not self.space:
            self.motions["turn"] = {"node": "B", "rotation": self.between(-1.0, 1.0)}
        else:
            by = np.array(self.vector(self.between(0.05, 0.25)))
            by[0] = -abs(by[0])
            self.motions["shift"] = {"node": "B", "displacement": by.tolist()}

    def portal(self) -> None:
        """Two members from support to support, a load between them."""
        high = [0.6, self.between(0.2, 0.7)]
        self.node("A", self.origin(), support="clamped")
        self.node("C", [*high, self.between(-0.3, 0.3)] if self.space else high)
        self.node("B", [1.2, *self.origin()[1:]], support="clamped" if self.space or self.chance(0.5) else "hinge")
        self.member("left", "A", "C", 0.5)
        self.member("right", "C", "B", 0.5)
        self.push("C")

    def guided(self) -> None:
        """A beam whose end slides without turning."""
        self.node("A", [0.0, 0.0], support="clamped")
        self.node("B", [1.0, 0.0], support="slider", direction=[self.between(-0.5, 0.5), 1.0])
        self.member("b", "A", "B", 0.5)
        self.push("B", turns=False)

    # -- obstacles ----------------------------------------------------------------------------------------------------

    def obstacles(self, table: Table) -> None:
        points = member_points(table, 64)
        for motion in self.motions.values():
            if "displacement" in motion:
                place = np.zeros(3)
                by = motion["displacement"]
                place[: len(by)] = np.add(self.nodes[motion["node"]]["position"], by)
                start = np.zeros(3)
                start[: len(by)] = self.nodes[motion["node"]]["position"]
                points = np.vstack([points, start + np.linspace(0.0, 1.0, 9)[:, None] * (place - start)])
        try:
            way = free_way(table)
        except NotAChainError:
            way = points
        wanted = int(self.rng.choice([1, 2, 3], p=[0.55, 0.3, 0.15]))
        kinds = {"pegs": self.peg, "drums": self.drum, "floors": self.floor, "spheres": self.solid}
        for _ in range(TRIES):
            if len(self.contacts) == wanted:
                return
            contact, gap = kinds[self.family](points, points if self.contacts else way)
            stands_in_it = bool(float(gap(way).min()) < -CLEAR)
            if CLEAR < float(gap(points).min()) < 0.5 and (self.contacts or stands_in_it):
                self.contacts[f"{contact['type']}{len(self.contacts)}"] = contact

    def near(self, points: Array, distance: float) -> Array:
        """A place so far from some point of the members, in any direction."""
        away = np.zeros(3)
        away[: 3 if self.space else 2] = self.vector(distance)
        return np.asarray(points[int(self.rng.integers(len(points)))] + away)

    def listed(self, place: Array) -> list[float]:
        return [round(float(v), 4) for v in place[: 3 if self.space else 2]]

    def peg(self, points: Array, way: Array) -> tuple[Table, Gap]:
        radius = self.between(0.04, 0.25)
        center = self.listed(self.near(way, self.between(0.0, 1.0) * radius))
        contact = {"type": "circle", "center": center, "radius": radius, "members": "all"}
        return contact, lambda x: np.linalg.norm(x[:, :2] - center, axis=1) - radius

    def drum(self, points: Array, way: Array) -> tuple[Table, Gap]:
        inside = self.chance(0.5) and not any(c.get("side") == "inside" for c in self.contacts.values())
        if not inside:
            radius = self.between(0.4, 2.0)
            center = self.listed(self.near(way, self.between(0.5, 1.0) * radius))
            contact = {"type": "circle", "center": center, "radius": radius, "members": "all"}
            return contact, lambda x: np.linalg.norm(x[:, :2] - center, axis=1) - radius
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) + 0.1 * np.append(self.vector(), 0.0)
        center = self.listed(middle)
        radius = round(float(np.linalg.norm(points[:, :2] - center, axis=1).max()) + self.between(0.02, 0.3), 4)
        contact = {"type": "circle", "center": center, "radius": radius, "members": "all"}
        return contact | {"side": "inside"}, lambda x: radius - np.linalg.norm(x[:, :2] - center, axis=1)

    def floor(self, points: Array, way: Array) -> tuple[Table, Gap]:
        normal = np.zeros(3)
        normal[: 3 if self.space else 2] = self.vector()
        if self.chance(0.4):
            normal = np.array([0.0, 0.0, 1.0] if self.space else [0.0, 1.0, 0.0])
        place = (float((points @ normal).min()) - self.between(0.02, 0.4)) * normal
        contact = {"type": "plane", "point": self.listed(place), "normal": self.listed(normal), "members": "all"}
        return contact, lambda x: (x - [*contact["point"], 0.0][:3]) @ normal

    def solid(self, points: Array, way: Array) -> tuple[Table, Gap]:
        if self.chance(0.15):
            return self.floor(points, way)
        radius = self.between(0.08, 0.5)
        center = self.listed(self.near(way, self.between(0.0, 1.0) * radius))
        contact: Table = {"type": "sphere", "center": center, "radius": radius, "members": "all"}
        across = np.eye(3)
        if self.chance(0.5):
            axis = self.vector()
            contact |= {"type": "cylinder", "axis": axis}
            across -= np.outer(axis, axis) / np.dot(axis, axis)
        return contact, lambda x: np.linalg.norm((x - center) @ across, axis=1) - radius
