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

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..description.scene import Scene
from ..description.supports import drives
from ..errors import SceneError
from ..mathematics.arrays import Array, Index, depends, normals, numbers, unit
from ..mathematics.keeping import Recent
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


ROOM, LARGEST, EACH = 128_000, 2_000, 200
"""Places and segments of all maps together that are kept for models of the same structure, those of the largest, and
what each counts for beside them.
"""

_KNOWN: Recent[tuple[Positions, Assembly]] = Recent(ROOM, EACH + LARGEST)

Source = tuple[str, int]
"""What a displacement depends on: the chord (E), unknowns (Y) or prescribed displacement (B) of a number."""


def _guide(scene: Scene, name: str) -> tuple[float, ...]:
    """Unit vector along the guide of a node."""
    direction, axes = numbers(scene.nodes[name].direction), 2 if scene.resolved_dimension == "plane" else 3
    if depends(direction):
        message = "found a guide that turns with parameters, accepted: one that stays, as unknowns go along it"
        raise SceneError(message, ("nodes", name, "direction"))
    return tuple(unit(direction[:axes]).tolist())


@dataclass
class _Place:
    """A displacement as a sum of matrices times sources: (axes, axes), or (axes, 1) for a single unknown."""

    terms: dict[Source, Array] = field(default_factory=dict)

    def plus(self, other: _Place) -> _Place:
        # What is not added to is shared, not copied: far places of a chain have many terms.
        terms = dict(self.terms)
        for source, matrix in other.terms.items():
            total = terms[source] + matrix if source in terms else matrix
            terms[source] = total
            if not total.any():
                del terms[source]
        return _Place(terms)


class _Products:
    """Products of matrices, each of which is made once: equal entries of maps are then one matrix."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Array, Array, Array]] = {}

    def times(self, matrix: Array, place: _Place) -> _Place:
        """A matrix times a place."""
        return _Place({source: self._product(matrix, term) for source, term in place.terms.items()})

    def _product(self, a: Array, b: Array) -> Array:
        key = (id(a), id(b))
        if key not in self._known:
            # Kept with their product, so that no others have their identities.
            self._known[key] = (a, b, a @ b)
        return self._known[key][2]


class _Placing:
    """The places while they are found one after the other."""

    def __init__(self, structure: _Structure, closing: bool) -> None:
        self.segments, self.axes, self.bodies = structure.segments, structure.axes, structure.bodies
        self.guides = {name: np.array(guide) for name, guide in structure.guides.items()}
        self.eye, self._products = np.eye(self.axes), _Products()
        self._minus, self._rows = -self.eye, [row[None, :] for row in self.eye]
        self._columns: dict[tuple[int, ...], Array] = {}
        self.labels: list[str] = []
        self.rows: list[tuple[str, _Place]] = []
        self.closes: list[int] = []
        self.places: dict[str, _Place] = {}
        self.retained = np.full((len(self.segments.places), self.axes), -1, dtype=np.intp)
        self.number = {name: i for i, name in enumerate(self.segments.places)}
        self.free, self.sliding = set(self.segments.places) - structure.held, set(self.guides)
        self._touching: dict[str, list[int]] = {n: [] for n in self.segments.places}
        for i, part in enumerate(self.segments.parts):
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
                gap = self.places[part.start].plus(self._chord(i)).plus(self._negative(self.places[part.end]))
                self._close(gap, [f"closing of {part.member}, {c}" for c in "xyz"[: self.axes]], self._rows, i)

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

    def _negative(self, place: _Place) -> _Place:
        return self._products.times(self._minus, place)

    def _prescribed(self, name: str) -> _Place:
        return _Place({("B", self.number[name]): self.eye})

    def _chord(self, number: int) -> _Place:
        return _Place({("E", number): self.eye})

    def _unknown(self, name: str) -> _Place:
        """A free place, or a slider by its travel."""
        first = len(self.labels)
        if name in self.sliding:
            self.labels.append(f"travel of {name}")
            return self._prescribed(name).plus(_Place({("Y", first): self.guides[name][:, None]}))
        self.labels += [f"{name}.{c}" for c in "xyz"[: self.axes]]
        return _Place({("Y", first): self.eye})

    def _keep(self, name: str) -> None:
        """A place by its components; on a guide with the equations that keep it there."""
        first = len(self.labels)
        if name in self.segments.strained:
            chosen = tuple(self.segments.strained[name])
            for i, component in enumerate(chosen):
                self.retained[self.number[name], component] = first + i
            self.labels += [f"{name}, {component}" for component in self.segments.strained[name].values()]
            if chosen not in self._columns:
                self._columns[chosen] = self.eye[:, chosen]
            self.places[name] = _Place({("Y", first): self._columns[chosen]})
            return
        self.retained[self.number[name]] = first + np.arange(self.axes)
        self.labels += [f"{name}.{c}" for c in "xyz"[: self.axes]]
        self.places[name] = _Place({("Y", first): self.eye})
        if name in self.sliding:
            self._across(name, self.places[name])

    def _across(self, name: str, found: _Place) -> _Place:
        """Rows that keep a place on its guide; its displacement along it."""
        gap, guide = found.plus(self._negative(self._prescribed(name))), self.guides[name]
        across = [row[None, :] for row in normals(guide)]
        self._close(gap, [f"{name} across its guide"] * len(across), across)
        return self._prescribed(name).plus(self._products.times(guide[:, None] @ guide[None, :], gap))

    def _close(self, gap: _Place, names: list[str], directions: Iterable[Array], segment: int = -1) -> None:
        for name, direction in zip(names, directions, strict=True):
            self.rows.append((name, self._products.times(direction, gap)))
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
                chord = self._chord(i) if here == part.start else self._negative(self._chord(i))
                found = self.places[here].plus(chord)
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
    guides = {name: _guide(scene, name) for name in scene.nodes if _slides(scene, name)}
    held = frozenset(name for name, node in scene.nodes.items() if node.support != "free")
    structure = _Structure(segments, axes, bodies, guides, held, mesh.order, assembly)
    return _KNOWN.found(structure.key, structure.placed, lambda _: structure.size)


@dataclass(frozen=True, eq=False)
class _Structure:
    """Everything that the maps are made of: of ``segments`` what :attr:`key` has, unit vectors along guides, nodes that
    supports hold or guide, and what :func:`place_nodes` is given.
    """

    segments: Segments
    axes: int
    bodies: Mapping[str, int]
    guides: Mapping[str, tuple[float, ...]]
    held: frozenset[str]
    order: int
    assembly: Assembly

    @property
    def key(self) -> Any:
        """What distinguishes it from others."""
        segments, strained = self.segments, self.segments.strained
        parts = tuple((p.member, p.elements.start, p.elements.stop, p.start, p.end) for p in segments.parts)
        components = tuple((name, tuple(own.items())) for name, own in strained.items())
        given = (
            self.axes,
            tuple(self.bodies.items()),
            tuple(self.guides.items()),
            self.held,
            self.order,
            self.assembly,
        )
        return segments.places, segments.retained, parts, components, *given

    @property
    def size(self) -> int:
        """What the maps count for among those that are kept."""
        return EACH + len(self.segments.places) + len(self.segments.parts)

    def placed(self) -> tuple[Positions, Assembly]:
        """The maps, and the assembly that they are of."""
        assembly = self.assembly
        names: tuple[Assembly, ...] = ("closing", "nodal") if assembly == "auto" else (assembly,)
        both = {name: _Placing(self, name == "closing") for name in names}
        if assembly == "auto":
            closing, nodal = (_entries(both[name], self.order) for name in ("closing", "nodal"))
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


def _entries(placing: _Placing, order: int) -> int:
    """Number of entries that closing rows and displacement unknowns add to the Newton matrix, for ``auto``."""
    parts = placing.segments.parts
    touched = ({number for kind, number in gap.terms if kind == "E"} for _, gap in placing.rows)
    count = sum(parts[i].elements.stop - parts[i].elements.start for row in touched for i in row)
    return count * order + 4 * len(placing.labels)
