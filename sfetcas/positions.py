"""Displacements of nodes and closing equations as linear maps of what the members reach.

Two assemblies.  *closing*: the displacement of a node is the sum of the reaches of the members on a path from
the ground, and what is left are closing equations, one for each loop and each further held direction.  *nodal*:
displacements of free nodes are unknowns and each member has its closing equation.  Both are the same linear
maps with other entries: with ``Delta`` the reaches of the members less those of the undeformed scene, ``y`` the
displacements kept as unknowns and ``b`` the prescribed ones,

    u = E Delta + Y y + B b,      0 = Z Delta + W y + B_Z b.

Source: Barraco and Munteanu, Part 1, section 1 (the two ways of assembling).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .mesh import Mesh
from .scene import Scene
from .supports import drives

__all__ = ["Positions", "entries", "normals", "place_nodes"]


@dataclass(frozen=True)
class Positions:
    """The linear maps of the module's docstring.

    Attributes
    ----------
    E, Y, B : ndarray (nodes * axes, members * axes | unknowns | nodes * axes)
        Displacements of the nodes.
    Z, W, BZ : ndarray (rows, members * axes | unknowns | nodes * axes)
        Closing equations.
    rows, unknowns : tuple of str
        Names.
    """

    E: Array
    Y: Array
    B: Array
    Z: Array
    W: Array
    BZ: Array
    rows: tuple[str, ...]
    unknowns: tuple[str, ...]


def normals(direction: Array, axes: int) -> Array:
    """Unit vectors that complete a direction to an orthonormal basis, (axes - 1, axes)."""
    d = direction[:axes] / np.linalg.norm(direction[:axes])
    basis = np.linalg.svd(d[None, :])[2][1:]
    return np.asarray(basis)


def _slides(scene: Scene, name: str) -> bool:
    """A slider whose travel is not prescribed."""
    node = scene.nodes[name]
    moved = [motion.displacement for motion in scene.motions.values() if motion.node == name]
    return node.support == "slider" and not any(drives(node, displacement) for displacement in moved)


@dataclass
class _Place:
    """The displacement of a node as a linear expression in reaches, unknowns and prescribed displacements."""

    E: Array
    Y: Array
    B: Array

    def combined(self, other: _Place, matrix: Array, sign: float = 1.0) -> _Place:
        return _Place(
            self.E + sign * matrix @ other.E, self.Y + sign * matrix @ other.Y, self.B + sign * matrix @ other.B
        )


def place_nodes(scene: Scene, axes: int, closing: bool) -> Positions:
    """The maps of a scene in ``axes`` dimensions, by the closing or the nodal assembly."""
    nodes, members = list(scene.nodes), list(scene.members)
    free = [n for n in nodes if scene.nodes[n].support == "free"]
    sliding = [n for n in nodes if _slides(scene, n)]
    labels: list[str] = []
    eye = np.eye(axes)
    size_e, size_b = len(members) * axes, len(nodes) * axes
    size_y = len(free) * axes + len(sliding)

    def guide(name: str) -> Array:
        d = np.asarray(scene.nodes[name].direction)[:axes]
        return np.asarray(d / np.linalg.norm(d))

    def blank() -> _Place:
        return _Place(np.zeros((axes, size_e)), np.zeros((axes, size_y)), np.zeros((axes, size_b)))

    def prescribed(name: str) -> _Place:
        place = blank()
        number = nodes.index(name)
        place.B[:, number * axes : (number + 1) * axes] = eye
        return place

    def unknown(name: str) -> _Place:
        place = prescribed(name) if name in sliding else blank()
        width = 1 if name in sliding else axes
        place.Y[:, len(labels) : len(labels) + width] = guide(name)[:, None] if name in sliding else eye
        labels.extend([f"travel of {name}"] if name in sliding else [f"{name}.{c}" for c in "xyz"[:axes]])
        return place

    def reach(name: str) -> _Place:
        place = blank()
        number = members.index(name)
        place.E[:, number * axes : (number + 1) * axes] = eye
        return place

    places = {n: prescribed(n) for n in nodes if n not in free and n not in sliding}
    rows: list[tuple[str, _Place]] = []
    used: set[str] = set()
    if not closing:
        places |= {n: unknown(n) for n in (*free, *sliding)}
    touching: dict[str, list[str]] = {n: [] for n in nodes}
    for m in members:
        for n in scene.members[m].nodes:
            touching[n].append(m)

    def spread(front: list[str]) -> None:
        """Place nodes member by member, breadth first, so that paths are short."""
        while front:
            here = front.pop(0)
            for m in touching[here]:
                a, b = scene.members[m].nodes
                there = b if here == a else a
                if m in used or there in places:
                    continue
                used.add(m)
                found = places[here].combined(reach(m), eye, 1.0 if here == a else -1.0)
                if there in sliding:
                    across = normals(guide(there), axes)
                    gap = found.combined(prescribed(there), eye, -1.0)
                    rows.extend((f"{there} across its guide", _projected(gap, n[None, :])) for n in across)
                    along = guide(there)[:, None] @ guide(there)[None, :]
                    found = prescribed(there).combined(gap, along)
                places[there] = found
                front.append(there)

    spread(list(places))
    while len(places) < len(nodes):
        root = next(n for n in (*sliding, *free) if n not in places)
        places[root] = unknown(root)
        spread([root])
    for m in members:
        if m not in used:
            a, b = scene.members[m].nodes
            gap = places[a].combined(reach(m), eye).combined(places[b], eye, -1.0)
            rows.extend((f"closing of {m}, {'xyz'[i]}", _projected(gap, eye[i : i + 1])) for i in range(axes))
    count = len(labels)

    def stacked(parts: list[_Place], name: str, width: int) -> Array:
        return np.vstack([np.zeros((0, width)), *[getattr(part, name)[:, :width] for part in parts]])

    in_order = [places[n] for n in nodes]
    closings = [place for _, place in rows]
    return Positions(
        E=stacked(in_order, "E", size_e),
        Y=stacked(in_order, "Y", count),
        B=stacked(in_order, "B", size_b),
        Z=stacked(closings, "E", size_e),
        W=stacked(closings, "Y", count),
        BZ=stacked(closings, "B", size_b),
        rows=tuple(label for label, _ in rows),
        unknowns=tuple(labels),
    )


def _projected(place: _Place, matrix: Array) -> _Place:
    return _Place(matrix @ place.E, matrix @ place.Y, matrix @ place.B)


def entries(positions: Positions, mesh: Mesh) -> float:
    """Entries of the closing rows and unknowns: what the stationarity equations grow by."""
    counts = np.array([len(cuts) - 1 for cuts in mesh.cuts.values()])
    width = positions.Z.shape[1] // len(counts)
    touched = np.abs(positions.Z).reshape(len(positions.rows), len(counts), width).sum(axis=2) > 0.0
    return float((touched @ (counts * mesh.order)).sum() + 4 * positions.Y.shape[1])
