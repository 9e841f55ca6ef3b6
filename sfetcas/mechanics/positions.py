"""Displacements of places and loop closures as linear maps of the chords of segments.

The *reach* of a segment is the vector from its first to its last place.  Two assemblies: *closing*: the displacement of
a place is the sum of the changes of reach along a path from the ground, and what is left are closing equations, one
for each loop and each further restrained direction; *nodal*: displacements of free places are unknowns and each segment
has its closing equation.  Both are the same linear maps with other entries: with ``Delta`` the changes of the reaches
since the undeformed scene, ``y`` the displacement unknowns and ``b`` the prescribed displacements,

    u = E Delta + Y y + B b,      0 = Z Delta + W y + B_Z b.

A place that is *retained* has its displacement among ``y`` (or prescribed), component by component, in either assembly.

Source: Barraco and Munteanu, Part 1, section 1 (the two ways of assembling).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..description.scene import Scene
from ..description.supports import drives
from ..errors import SceneError
from ..mathematics.arrays import Array, Index, normals, numbers, unit
from ..mathematics.linear import SparseMap
from .mesh import Mesh
from .segments import Segments

__all__ = ["Assembly", "Positions", "place_nodes"]


Assembly = Literal["auto", "closing", "nodal"]
"""Which displacements are unknowns, see :func:`~sfetcas.mechanics.model.assemble`."""


@dataclass(frozen=True)
class Positions:
    """The linear maps of the module's docstring, dimensionless.

    Attributes
    ----------
    E, Y, B : SparseMap (places * axes, segments * axes | unknowns | places * axes)
        Displacements of the places.
    Z, W, BZ : SparseMap (rows, segments * axes | unknowns | places * axes)
        Gaps of the closing equations.
    rows, unknowns : tuple of str
        Names of the closing equations and of the displacement unknowns.
    retained : ndarray (places, axes)
        For each component of a retained place its index in ``y``; -1 where it is prescribed or has none.
    closes : ndarray (rows,)
        Number of the segment whose chord a row closes, -1 of other rows.
    """

    E: SparseMap
    Y: SparseMap
    B: SparseMap
    Z: SparseMap
    W: SparseMap
    BZ: SparseMap
    rows: tuple[str, ...]
    unknowns: tuple[str, ...]
    retained: Index
    closes: Index


def _slides(scene: Scene, name: str) -> bool:
    """A slider whose travel is not prescribed."""
    node = scene.nodes[name]
    moved = [motion.displacement for motion in scene.motions.values() if motion.node == name]
    return node.slides and not any(drives(node, displacement) for displacement in moved)


Source = tuple[str, int]
"""What a displacement depends on: the chord (E), unknowns (Y) or prescribed displacement (B) of a number."""


@dataclass
class _Place:
    """A displacement as a sum of matrices times sources: (axes, axes), or (axes, 1) for a single unknown."""

    terms: dict[Source, Array] = field(default_factory=dict)

    def plus(self, other: _Place, sign: float = 1.0) -> _Place:
        # What is not added to is shared, not copied: far places of a chain have many terms.
        terms = dict(self.terms)
        for source, matrix in other.terms.items():
            signed = matrix if sign == 1.0 else sign * matrix
            total = terms[source] + signed if source in terms else signed
            terms[source] = total
            if not total.any():
                del terms[source]
        return _Place(terms)

    def times(self, matrix: Array) -> _Place:
        return _Place({source: matrix @ term for source, term in self.terms.items()})


class _Placing:
    """The places while they are found one after the other."""

    def __init__(self, scene: Scene, segments: Segments, axes: int, closing: bool, bodies: Mapping[str, int]) -> None:
        self.scene, self.segments, self.axes, self.bodies = scene, segments, axes, bodies
        self.eye = np.eye(axes)
        self.labels: list[str] = []
        self.rows: list[tuple[str, _Place]] = []
        self.closes: list[int] = []
        self.places: dict[str, _Place] = {}
        self.retained = np.full((len(segments.places), axes), -1, dtype=np.intp)
        self.number = {name: i for i, name in enumerate(segments.places)}
        self.free = {n for n in segments.places if n not in scene.nodes or scene.nodes[n].support == "free"}
        self.sliding = {n for n in scene.nodes if _slides(scene, n)}
        self._touching: dict[str, list[int]] = {n: [] for n in segments.places}
        for i, part in enumerate(segments.parts):
            self._touching[part.start].append(i)
            self._touching[part.end].append(i)
        self._used: set[int] = set()
        self._find(closing)

    def _find(self, closing: bool) -> None:
        loose = [n for n in self.segments.places if n in self.free or n in self.sliding]
        for name in self.segments.places:
            if name not in self.free and name not in self.sliding:
                self.places[name] = self._prescribed(name)
        for name in loose:
            if name in self.segments.retained:
                self._keep(name)
            elif not closing:
                self.places[name] = self._unknown(name)
        self._spread(list(self.places))
        for root in (*(n for n in loose if n in self.sliding), *(n for n in loose if n in self.free)):
            if root not in self.places:
                self.places[root] = self._unknown(root)
                self._spread([root])
        within = self._loops_within_bodies()
        for i, part in enumerate(self.segments.parts):
            if i not in self._used | within:
                gap = self.places[part.start].plus(self._chord(i)).plus(self.places[part.end], -1.0)
                self._close(gap, [f"closing of {part.member}, {c}" for c in "xyz"[: self.axes]], self.eye, i)

    def _loops_within_bodies(self) -> set[int]:
        """Segments that close a loop of rigid members that share one rotation: it stays closed by itself."""
        parent: dict[Source, Source] = {}

        def root(place: Source) -> Source:
            while place in parent:
                place = parent[place]
            return place

        found = set()
        for i in sorted(range(len(self.segments.parts)), key=lambda i: i not in self._used):
            part = self.segments.parts[i]
            if part.member not in self.bodies:
                continue
            start, end = (root((place, self.bodies[part.member])) for place in (part.start, part.end))
            if start != end:
                parent[start] = end
            elif i not in self._used:
                found.add(i)
        return found

    def _guide(self, name: str) -> Array:
        direction = numbers(self.scene.nodes[name].direction)
        if hasattr(direction, "expression"):
            message = "found a guide that turns with parameters, accepted: one that stays, as unknowns go along it"
            raise SceneError(message, ("nodes", name, "direction"))
        return unit(direction[: self.axes])

    def _prescribed(self, name: str) -> _Place:
        return _Place({("B", self.number[name]): self.eye})

    def _chord(self, number: int) -> _Place:
        return _Place({("E", number): self.eye})

    def _unknown(self, name: str) -> _Place:
        """A free place, or a slider by its travel."""
        first = len(self.labels)
        if name in self.sliding:
            self.labels.append(f"travel of {name}")
            return self._prescribed(name).plus(_Place({("Y", first): self._guide(name)[:, None]}))
        self.labels += [f"{name}.{c}" for c in "xyz"[: self.axes]]
        return _Place({("Y", first): self.eye})

    def _keep(self, name: str) -> None:
        """A place by its components; on a guide with the equations that keep it there."""
        first = len(self.labels)
        if name in self.segments.strained:
            chosen = list(self.segments.strained[name])
            self.retained[self.number[name], chosen] = first + np.arange(len(chosen))
            self.labels += [f"{name}, {component}" for component in self.segments.strained[name].values()]
            self.places[name] = _Place({("Y", first): self.eye[:, chosen]})
            return
        self.retained[self.number[name]] = first + np.arange(self.axes)
        self.labels += [f"{name}.{c}" for c in "xyz"[: self.axes]]
        self.places[name] = _Place({("Y", first): self.eye})
        if name in self.sliding:
            self._across(name, self.places[name])

    def _across(self, name: str, found: _Place) -> _Place:
        """Rows that keep a place on its guide; its displacement along it."""
        gap = found.plus(self._prescribed(name), -1.0)
        across = normals(self._guide(name))
        self._close(gap, [f"{name} across its guide"] * len(across), across)
        along = self._guide(name)[:, None] @ self._guide(name)[None, :]
        return self._prescribed(name).plus(gap.times(along))

    def _close(self, gap: _Place, names: list[str], directions: Array, segment: int = -1) -> None:
        for name, direction in zip(names, directions, strict=True):
            self.rows.append((name, gap.times(direction[None, :])))
            self.closes.append(segment)

    def _spread(self, front: list[str]) -> None:
        """Find places segment by segment, breadth first, so that ways are short."""
        for here in front:
            for i in self._touching[here]:
                part = self.segments.parts[i]
                there = part.end if here == part.start else part.start
                if i in self._used or there in self.places:
                    continue
                self._used.add(i)
                found = self.places[here].plus(self._chord(i), 1.0 if here == part.start else -1.0)
                self.places[there] = self._across(there, found) if there in self.sliding else found
                front.append(there)

    def matrices(self, parts: list[_Place], height: int) -> dict[str, SparseMap]:
        """The terms of each kind of all parts below each other, each part of some height."""
        shared: dict[str, dict[int, tuple[Array, list[int], list[int]]]] = {"E": {}, "Y": {}, "B": {}}
        for i, part in enumerate(parts):
            for (kind, number), matrix in part.terms.items():
                _, rows, columns = shared[kind].setdefault(id(matrix), (matrix, [], []))
                rows.append(i * height)
                columns.append(number if kind == "Y" else number * self.axes)
        segments = self.segments
        sizes = {
            "E": len(segments.parts) * self.axes,
            "Y": len(self.labels),
            "B": len(segments.places) * self.axes,
        }
        return {kind: _sparse(found, (len(parts) * height, sizes[kind])) for kind, found in shared.items()}


def _sparse(shared: dict[int, tuple[Array, list[int], list[int]]], shape: tuple[int, int]) -> SparseMap:
    """Matrices, each at several rows and columns, as one."""
    row, column, value = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
    for matrix, rows, columns in shared.values():
        r, c = np.nonzero(matrix)
        row.append((np.array(rows)[:, None] + r).ravel())
        column.append((np.array(columns)[:, None] + c).ravel())
        value.append(np.tile(matrix[r, c], len(rows)))
    return SparseMap(np.concatenate(row), np.concatenate(column), np.concatenate(value), shape)


def place_nodes(
    scene: Scene, segments: Segments, axes: int, bodies: Mapping[str, int], mesh: Mesh, assembly: Assembly
) -> tuple[Positions, Assembly]:
    """The maps of a scene in ``axes`` dimensions, and the assembly that they are of.

    That is ``closing`` or ``nodal``, or for ``auto`` the one whose Newton matrix has fewer entries.  ``bodies`` has the
    number of the rotation of each rigid member.  A loop within one rigid body has no closing equation: the force around
    it is indeterminate, and the last member is taken to carry none.
    """
    names: tuple[Assembly, ...] = ("closing", "nodal") if assembly == "auto" else (assembly,)
    both = {name: _Placing(scene, segments, axes, name == "closing", bodies) for name in names}
    if assembly == "auto":
        closing, nodal = (_entries(both[name], mesh) for name in ("closing", "nodal"))
        assembly = "closing" if closing <= nodal else "nodal"
    return _positions(both[assembly]), assembly


def _positions(placing: _Placing) -> Positions:
    up = placing.matrices([placing.places[n] for n in placing.segments.places], placing.axes)
    low = placing.matrices([place for _, place in placing.rows], 1)
    return Positions(
        E=up["E"],
        Y=up["Y"],
        B=up["B"],
        Z=low["E"],
        W=low["Y"],
        BZ=low["B"],
        rows=tuple(label for label, _ in placing.rows),
        unknowns=tuple(placing.labels),
        retained=placing.retained,
        closes=np.array(placing.closes, dtype=np.intp),
    )


def _entries(placing: _Placing, mesh: Mesh) -> int:
    """Number of entries that closing rows and displacement unknowns add to the Newton matrix, for ``auto``."""
    parts = placing.segments.parts
    touched = ({number for kind, number in gap.terms if kind == "E"} for _, gap in placing.rows)
    count = sum(parts[i].elements.stop - parts[i].elements.start for row in touched for i in row)
    return count * mesh.order + 4 * len(placing.labels)
