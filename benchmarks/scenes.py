"""Scenes of the benchmarks: those of the literature for which other programs' figures are known, and large systems.

S1, S1b are a cantilever under F L^2/EI = 10 and 100; S2, S2b the 45-degree bend under 300 and 600; S3, S3b a roll-up of
1 and 5 turns; S4 a beam on hinge and slider; Lee's frame and the arch of 215 degrees are for paths.  Nets, lattices,
trees and chains have as many members as wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sfetcas.description.scene import Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.description.shapes import Arc

__all__ = [
    "arch",
    "bend",
    "cantilever",
    "large",
    "lattice",
    "lee_frame",
    "of_all_types",
    "on_slider",
    "rolled",
    "woven",
]


def cantilever(force: list[float], dimension: str = "plane") -> Scene:
    """Straight cantilever, L = EI = GJ = 1."""
    return Scene(
        dimension=dimension,
        sections={"unit": CrossSection(EI2=1.0, EI3=1.0, GJ=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="unit")},
        loads={"tip": Load(type="force", node="tip", value=force)},
    )


def bend(force: float) -> Scene:
    """The 45-degree bend of Bathe and Bolourchi: radius 100, E I = G J = 1e7/12."""
    stiffness = 1e7 / 12.0
    end = [100.0 * np.sin(np.pi / 4), 100.0 * (1.0 - np.cos(np.pi / 4))]
    return cantilever([0.0, 0.0, force], "space").replace(
        sections={"unit": CrossSection(EI2=stiffness, EI3=stiffness, GJ=stiffness)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=end)},
        members={"beam": Member(nodes=["root", "tip"], section="unit", shape=Arc(angle=np.pi / 4))},
    )


def rolled(turns: float) -> Scene:
    """A cantilever rolled up by a moment."""
    moment = Load(type="moment", node="tip", value=2.0 * np.pi * turns)
    return cantilever([0.0, 1.0]).replace(loads={"tip": moment})


def on_slider() -> Scene:
    """Two members of length 1 on hinge and slider, 5 N in the middle."""
    nodes = {
        "left": Node(position=[0, 0], support="hinge"),
        "middle": Node(position=[1, 0]),
        "right": Node(position=[2, 0], support="slider", direction=[1, 0], rotation="hinge"),
    }
    members = {
        "first": Member(nodes=["left", "middle"], section="unit"),
        "second": Member(nodes=["middle", "right"], section="unit"),
    }
    force = Load(type="force", node="middle", value=[0, -5])
    return cantilever([0.0, 1.0]).replace(nodes=nodes, members=members, loads={"middle": force})


def lee_frame() -> Scene:
    """The frame of Lee, Manuel and Rossow: it snaps through at 1.856."""
    nodes = {
        "foot": Node(position=[0, 0], support="hinge"),
        "corner": Node(position=[0, 120]),
        "load": Node(position=[24, 120]),
        "end": Node(position=[120, 120], support="hinge"),
    }
    pairs = {"column": ("foot", "corner"), "short": ("corner", "load"), "long": ("load", "end")}
    return Scene(
        sections={"strip": CrossSection(EI3=1440.0)},
        nodes=nodes,
        members={name: Member(nodes=pair, section="strip") for name, pair in pairs.items()},
        loads={"load": Load(type="force", node="load", value=[0, -1])},
    )


def arch() -> Scene:
    """The arch of DaDeppo and Schmidt, 215 degrees, hinged and clamped; it snaps through at 897."""
    half = math.radians(107.5)
    x, y = 100.0 * math.sin(half), 100.0 * math.cos(half)
    nodes = {
        "left": Node(position=[-x, y], support="hinge"),
        "load": Node(position=[0, 100]),
        "right": Node(position=[x, y], support="clamped"),
    }
    pairs = {"first": ("left", "load"), "second": ("load", "right")}
    return Scene(
        sections={"strip": CrossSection(EI3=1e6)},
        nodes=nodes,
        members={name: Member(nodes=pair, section="strip", shape=Arc(angle=-half)) for name, pair in pairs.items()},
        loads={"load": Load(type="force", node="load", value=[0, -1])},
    )


def woven(members: int) -> Scene:
    """A net of at least so many wavy strips welded at their crossings, its lowest row clamped, its highest one pulled.

    Squares of 0.1 m; the strips are arcs of 0.8 rad that bulge to either side in turn, so that the net can stretch.
    Columns c and rows r of squares have r (c + 1) upright strips and r c level ones.
    """
    columns = max(1, round((math.sqrt(8 * members + 1) - 1) / 4))
    rows = math.ceil(members / (2 * columns + 1))
    nodes, strips, loads = {}, {}, {}
    for j in range(rows + 1):
        for i in range(columns + 1):
            here, bulge = f"{i} {j}", 0.8 * (-1) ** (i + j)
            nodes[here] = Node(position=[0.1 * i, 0.1 * j], support="free" if j else "clamped")
            if j < rows:
                strips[f"up {here}"] = _wavy(here, f"{i} {j + 1}", -bulge)
            if j > 0 and i < columns:
                strips[f"right {here}"] = _wavy(here, f"{i + 1} {j}", bulge)
            if j == rows:
                loads[here] = Load(type="force", node=here, value=[0.3, 0.6])
    return Scene(sections={"strip": CrossSection(EI3=0.01)}, nodes=nodes, members=strips, loads=loads)


def _wavy(first: str, second: str, angle: float) -> Member:
    return Member(nodes=[first, second], section="strip", shape=Arc(angle=angle))


def _of_types(scene: Scene, kind: Callable[[int, bool], str]) -> Scene:
    """A net with its members of other types, each by its number and whether it is level."""
    members = {
        name: Member(nodes=member.nodes, section="strip", shape=member.shape, type=kind(i, name.startswith("right")))
        for i, (name, member) in enumerate(scene.members.items())
    }
    return scene.replace(members=members)


def with_rigid_rows(members: int) -> Scene:
    """The net with rigid level members: each row turns as one."""
    return _of_types(woven(members), lambda i, level: "rigid" if level else "flexible")


def of_superelements(members: int) -> Scene:
    """The net of small members."""
    return _of_types(woven(members), lambda i, level: "small")


def of_all_types(members: int) -> Scene:
    """The net with flexible and small members, some of its level ones rigid."""
    names = ("flexible", "small", "rigid")
    return _of_types(woven(members), lambda i, level: names[i % (3 if level else 2)])


def lattice(members: int) -> Scene:
    """A square lattice of at least so many straight small members, its feet clamped, its top pushed and pulled."""
    n = math.ceil(math.sqrt(members / 2 + 1 / 16) - 1 / 4)
    nodes, bars, loads = {}, {}, {}
    for j in range(n + 1):
        for i in range(n + 1):
            here = f"{i} {j}"
            nodes[here] = Node(position=[0.1 * i, 0.1 * j], support="free" if j else "clamped")
            if j > 0:
                bars[f"up {here}"] = Member(nodes=[f"{i} {j - 1}", here], section="strip", type="small")
            if i > 0 and j > 0:
                bars[f"right {here}"] = Member(nodes=[f"{i - 1} {j}", here], section="strip", type="small")
            if j == n:
                loads[here] = Load(type="force", node=here, value=[0.3 / n, 0.2 / n])
    return Scene(sections={"strip": CrossSection(EI3=0.01)}, nodes=nodes, members=bars, loads=loads)


def tree(members: int) -> Scene:
    """A tree of so many flexible members, two at each end of another, its leaves pulled."""
    nodes = {"0": Node(position=[0, 0], support="clamped")}
    branches, loads = {}, {}
    for k in range(1, members + 1):
        x, y, _ = nodes[str((k - 1) // 2)].position
        nodes[str(k)] = Node(position=[x + 0.3 * math.sin(3.0 * k), y + 1.0 + 0.2 * math.cos(5.0 * k)])
        branches[str(k)] = Member(nodes=[str((k - 1) // 2), str(k)], section="twig")
        if 2 * k >= members:
            loads[str(k)] = Load(type="force", node=str(k), value=[0.01, 0.02])
    return Scene(sections={"twig": CrossSection(EI3=1.0)}, nodes=nodes, members=branches, loads=loads)


def chain(members: int) -> Scene:
    """Rigid links hinged to each other between two supports, loaded at each hinge; the middle one is flexible."""
    members = max(members, 2)
    nodes, links, loads = {"0": Node(position=[0, 0], support="hinge")}, {}, {}
    for k in range(1, members + 1):
        place = [float(k), -0.3 * members * math.sin(math.pi * k / members)]
        nodes[str(k)] = Node(position=place, joint="hinge") if k < members else Node(position=place, support="hinge")
        kind = "flexible" if k == (members + 1) // 2 else "rigid"
        links[str(k)] = Member(nodes=[str(k - 1), str(k)], section="rod", type=kind)
        if k < members:
            loads[str(k)] = Load(type="force", node=str(k), value=[0.0, -0.5])
    return Scene(sections={"rod": CrossSection(EI3=100.0)}, nodes=nodes, members=links, loads=loads)


def large(kind: str, members: int) -> Scene:
    """A system of a kind of NETS with at least so many members."""
    made = {
        "wavy strips": woven,
        "rigid rows": with_rigid_rows,
        "small": of_superelements,
        "all types": of_all_types,
        "lattice": lattice,
        "tree": tree,
        "chain": chain,
    }
    return made[kind](members)
