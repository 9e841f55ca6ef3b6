"""Reactions of supports as constant linear maps of the forces and moments that terms take.

Every term takes moments from its rotations and forces from its places (its share of the residual).  These numbers, one
after the other, group by group, are the *cells* of a state; loads on nodes and within members that are in no term come
after them.  Each reaction is the same linear combination of cells and of multipliers of the loop closures in every
state, in numbers and in expressions alike.

Nodes of a rigid body share its rotation, so the balance of the rotation alone does not separate their reactions.  Which
support exerts which part follows from the balance of moments of each node that rigid members join, with the moments on
the first ends of these as unknowns.  Where that leaves a choice (rigid members in loops, a body with several supports)
the smallest reactions are taken, then the smallest moments inside.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array, Index, unit
from ..mathematics.linear import SparseMap, smallest
from .connections import connections_of
from .load_terms import inner_cut
from .model import Model
from .rotations import STIFF, RotationFreedom, end_joints
from .tables import Tables
from .terms import GROUND

__all__ = ["Reactions", "RigidBalance", "shares_rotation"]

INNER_WEIGHT = 1e-8
"""Weight of moments inside rigid members where reactions count 1: reactions are made small first."""

FREE = ("free", "ball")
"""How a support may leave a node to turn."""


@dataclass(frozen=True, eq=False)
class RigidBalance:
    """Balance of moments of the nodes that rigid members join: ``matrix @ moments = known @ cells``; dimensionless.

    Attributes
    ----------
    matrix : SparseMap (rows, unknowns)
        Unknowns are moments on first ends of rigid members, then reactions of nodes, each with ``width`` components.
    known : SparseMap (rows, cells)
        The cells here include moments on places and elements that are in no term.
    weights : ndarray (unknowns,)
        Weights in the norm that is minimised.
    unknowns : mapping of (str, str) to int
        Number of each moment: ("member", name) or ("node", name).
    width : int
        Components of a moment: 3 in space, 1 in the plane.
    """

    matrix: SparseMap
    known: SparseMap
    weights: Array
    unknowns: dict[tuple[str, str], int]
    width: int

    def solved(self, cells: Array) -> dict[tuple[str, str], Array]:
        """The moments (width,) of smallest norm that balance given cells (cells,), dimensionless."""
        found = smallest(self.matrix, self.known @ cells, self.weights)[0].reshape(-1, self.width)
        return {key: found[i] for key, i in self.unknowns.items()}

    def share(self, node: str) -> SparseMap:
        """The linear map (width, cells) from cells to the reaction of a node in this solution."""
        first, shares = self.unknowns["node", node] * self.width, []
        for unknown in range(first, first + self.width):
            # Multipliers of the rows say what each of them adds to one unknown of the smallest solution.
            along = np.zeros(len(self.weights))
            along[unknown] = 1.0 / self.weights[unknown]
            shares.append(self.known.T @ -smallest(self.matrix, self.matrix @ along, self.weights)[1])
        row, column = np.nonzero(shares)
        return SparseMap(row, column, np.array(shares)[row, column], (self.width, self.known.shape[1]))


Entries = tuple[Array, Array, Array]
"""Rows, columns and values."""

Block = tuple[dict[int, float], list[Index], Array | None]
"""Unknowns of a balance with their signs, cells (width,) that it adds up, and the one axis about which it holds."""


class Reactions:
    """Linear maps from the forces of the terms to the reactions at the nodes of a model.

    Attributes
    ----------
    model : Model
    cells : int
        Number of the cells of terms.
    """

    def __init__(self, tables: Tables) -> None:
        self._tables, self.model, self._width = tables, tables.model, tables.width
        self._first = np.cumsum([0, *(sides.size for sides in tables.sides)])
        self.cells = int(self._first[-1])

    @functools.cached_property
    def left(self) -> SparseMap:
        """Sum of the cells on each rotation and place, in full coordinates: the moments and forces that supports
        balance.

        The side of a universal support that is the ground does not count: what it takes is the reaction itself.
        """
        full = []
        for group, sides in zip(self.model.terms, self._tables.sides, strict=True):
            ground = group.kind.supports & (group.turns == GROUND).any(axis=1)
            full.append(np.where(ground[:, None], -1, sides).ravel())
        row = np.concatenate(full)
        used = np.flatnonzero(row >= 0)
        return SparseMap(row[used], used, np.ones(len(used)), (self._tables.of_rows, self.cells))

    @functools.cached_property
    def forces(self) -> SparseMap:
        """Map to the forces of supports (places * axes,) from forces left on places, then multipliers of the loop
        closures.

        A support takes what is left on its place, and the internal forces of the segments that begin or end there.
        """
        model = self.model
        positions, axes, size = model.positions, model.element.axes, self._tables.of_rows - self._tables.of_places
        places = [model.segments.place(name) for name, node in model.scene.nodes.items() if node.support != "free"]
        supported = np.isin(np.arange(size // axes), places)
        own = np.flatnonzero(np.repeat(supported, axes))
        parts = [(own, own, np.ones(len(own)))]
        begin = np.array([model.segments.place(part.start) for part in model.segments.parts], dtype=np.intp)
        end = np.array([model.segments.place(part.end) for part in model.segments.parts], dtype=np.intp)
        for matrix, first in ((positions.E, 0), (positions.Z, size)):
            for place, sign in ((begin, 1.0), (end, -1.0)):
                at, used = place[matrix.column // axes], supported[place[matrix.column // axes]]
                row = axes * at + matrix.column % axes
                parts.append((row[used], first + matrix.row[used], sign * matrix.value[used]))
        return _map(parts, (size, size + len(positions.rows)))

    # -- what supports hold -----------------------------------------------------------------------

    def pushed(self, node: str) -> Array:
        """Projection (3, 3) of forces onto those that a support can exert: none along a guide that is not driven."""
        record, found = self.model.scene.nodes[node], np.eye(3)
        driven = any(m.node == node and m.displacement is not None for m in self.model.scene.motions.values())
        if record.slides and not driven:
            along = unit(record.direction)
            found -= np.outer(along, along)
        return found

    def fixed_directions(self, number: int) -> Array:
        """Projection (3, 3) of moments onto those that the ground can exert on a rotation: none about free axes."""
        kind = self.model.rotations.kind[number]
        if kind == RotationFreedom.AXIS:
            axis = self.model.rotations.axis[number]
            return np.asarray(np.eye(3) - np.outer(axis, axis))
        return np.zeros((3, 3)) if kind == RotationFreedom.FREE else np.eye(3)

    def turned(self, node: str) -> list[tuple[int, Array]]:
        """Numbers of the rotations on which a support exerts moments, with the projection (3, 3) onto these moments."""
        number, record = self.model.rotations.node_turn[node], self.model.scene.nodes[node]
        if number is None:
            return [(turn, np.eye(3)) for turn in self._pinned(node)]
        free = self.model.rotations.kind[number] == RotationFreedom.FREE
        return [(number, np.eye(3) if free and record.support == "universal" else self.fixed_directions(number))]

    def _pinned(self, node: str) -> list[int]:
        """Rotations of member ends that a support itself pins, its node having none."""
        scene, rotations, record = self.model.scene, self.model.rotations, self.model.scene.nodes[node]
        if record.support == "free" or record.joint != "hinge":
            return []
        turns = [rotations.ends[n][m.nodes.index(node)] for n, m in scene.members.items() if node in m.nodes]
        # A member that is rigid up to another support that holds it is held there.
        elsewhere = {turn for n, turn in rotations.node_turn.items() if scene.nodes[n].turn not in FREE}
        return [turn for turn in turns if turn not in elsewhere]

    # -- rigid members ----------------------------------------------------------------------------

    @functools.cached_property
    def rigid(self) -> RigidBalance:
        """The balance of moments of all nodes that rigid members are joined to."""
        scene, width = self.model.scene, self._width
        names = [name for name in self.model.members if scene.members[name].type == "rigid"]
        nodes = list(dict.fromkeys(n for name in names for n in scene.members[name].nodes))
        turning = [n for n in nodes if scene.nodes[n].turn not in FREE]
        keys = [*(("member", name) for name in names), *(("node", n) for n in turning)]
        unknowns = {key: i for i, key in enumerate(keys)}
        blocks = [self._at_node(unknowns, names, node) for node in nodes]
        hinged: list[Block] = []
        for name in names:
            for i, (node, joint) in enumerate(end_joints(scene, scene.members[name])):
                if joint in STIFF:
                    continue
                gains, cells = self._at_pin(unknowns, name, i)
                if self._grounded(node):
                    hinged.append((gains, cells, unit(scene.nodes[node].axis)))
                else:
                    blocks.append((gains, cells, None))
        freely = [n for n in turning if self._turns_freely(n)]
        blocks += hinged
        blocks += [({unknowns["node", n]: 1.0}, [], unit(scene.nodes[n].turn_axis)) for n in freely]
        weights = np.repeat([INNER_WEIGHT, 1.0], [width * len(names), width * len(turning)])
        return RigidBalance(*self._written(blocks, len(weights)), weights, unknowns, width)

    def _written(self, blocks: list[Block], size: int) -> tuple[SparseMap, SparseMap]:
        """Matrices by unknowns and, on the other side, by cells."""
        matrix, known, row, each = list[Entries](), list[Entries](), 0, np.arange(self._width)
        for gains, cells, axis in blocks:
            rows, scale = (row + each, np.ones(self._width)) if axis is None else (row + 0 * each, axis[-self._width :])
            matrix += [(rows, self._width * unknown + each, gain * scale) for unknown, gain in gains.items()]
            known += [(rows, some, -scale) for some in cells]
            row += self._width if axis is None else 1
        every = self.cells + self._width * (len(self.model.segments.places) + len(self.model.beams.weight))
        return _map(matrix, (row, size)), _map(known, (row, every))

    def _grounded(self, node: str) -> bool:
        """Whether the ground holds member ends hinged at a node across the axis: no joint of theirs says how much."""
        record = self.model.scene.nodes[node]
        return self.model.space and record.joint == "hinge" and record.turn not in (*FREE, "universal")

    def _turns_freely(self, node: str) -> bool:
        """A supported hinge that nothing drives: the ground exerts no moment about its axis."""
        scene = self.model.scene
        driven = any(m.node == node and m.rotation is not None and m.between is None for m in scene.motions.values())
        return scene.nodes[node].turn == "hinge" and not driven

    def _at_node(self, unknowns: dict[tuple[str, str], int], rigid: list[str], node: str) -> Block:
        """All that takes moments at a node, the reaction on the other side."""
        gains, cells = dict[int, float](), list(self._known(node))
        for name in rigid:
            for i, at in enumerate(self.model.scene.members[name].nodes):
                if at == node:
                    gains[unknowns["member", name]] = 1.0 - 2.0 * i
                    cells += self._gain(name) if i else []
        if ("node", node) in unknowns:
            gains[unknowns["node", node]] = -1.0
        return gains, cells, None

    def _at_pin(
        self, unknowns: dict[tuple[str, str], int], member: str, i: int
    ) -> tuple[dict[int, float], list[Index]]:
        """What the joint at a released end takes, a rigid member does not."""
        node, turn = self.model.scene.members[member].nodes[i], self.model.rotations.ends[member][i]
        cells = [*self.connected(node, turn), *(self._gain(member) if i else ())]
        return {unknowns["member", member]: 1.0 - 2.0 * i}, cells

    # -- cells ------------------------------------------------------------------------------------

    def _cell(self, number: int, i: int, side: int) -> Index:
        """Cells of the moment of a term on one of its rotations."""
        begin = self._first[number] + i * self._tables.sides[number].shape[1] + side * self._width
        return np.asarray(begin + np.arange(self._width))

    def _beside(self, number: int) -> Index:
        """Cells of loads in no term: couples on places, then on the starts of elements within members."""
        return np.asarray(self.cells + number * self._width + np.arange(self._width))

    def connected(self, node: str, turn: int | None = None) -> Iterator[Index]:
        """Cells (width,) of what joints and springs at a node take from one rotation, or those that do not cancel from
        all.

        A hinge takes from one side what it gives to the other; slides have a lever, springs may go to the ground, and
        loads act on one side.
        """
        for number, i, side in self._joined.get(node, ()):
            group = self.model.terms[number]
            if (group.kind.one_sided or group.kind.is_load) if turn is None else group.turns[i, side] == turn:
                yield self._cell(number, i, side)

    @functools.cached_property
    def _joined(self) -> dict[str, list[tuple[int, int, int]]]:
        """Group, number and side of all that takes a moment at a node but members."""
        found: dict[str, list[tuple[int, int, int]]] = {}
        for number, group in enumerate(self.model.terms[1:], start=1):
            own = group.kind.table == "members" or group.kind.spans
            # Sides of what runs along an element are first the nodes of that.
            first = self.model.element.order + 1 if group.kind.along_element else 0
            for i, side in np.argwhere(group.turns != GROUND).tolist() if not own else ():
                if side < first:
                    continue
                node = self.model.segments.places[group.places[i, side]] if group.kind.apart else group.nodes[i]
                found.setdefault(self._ending.get(node, node), []).append((number, i, side))
        return found

    def _known(self, node: str) -> Iterator[Index]:
        """Cells of all but rigid members at a node."""
        model, last = self.model, self.model.element.order
        for name, member in model.scene.members.items():
            if node not in member.nodes or member.type == "rigid":
                continue
            i = member.nodes.index(node)
            if member.type == "small":
                number, k = next(connections_of(model.connections, "members", name))
                yield self._cell(number + 1, k, i)
            else:
                part = model.elements_of(name)
                yield from self._on_element(part.start, 0) if i == 0 else self._on_element(part.stop - 1, last)
        yield from self.connected(node)
        yield self._beside(model.segments.place(node))

    def _on_element(self, element: int, k: int) -> Iterator[Index]:
        """Cells on a node of an element, of loads along it too."""
        yield self._cell(0, element, k)
        for number, i, first in self._along.get(element, ()):
            yield self._cell(number, i, first + k)

    @functools.cached_property
    def _along(self) -> dict[int, list[tuple[int, int, int]]]:
        """Group, number, and the side that is the first node of the element, of loads and tendons along elements."""
        found: dict[int, list[tuple[int, int, int]]] = {}
        for number, group in enumerate(self.model.terms):
            count = 1 if group.kind.along_element else group.kind.spans
            for i, element in enumerate(group.elements.tolist() if count else ()):
                for k in range(count):
                    found.setdefault(element + k, []).append((number, i, k * self.model.element.order))
        return found

    @functools.cached_property
    def _within(self) -> dict[int, list[tuple[int, int, int]]]:
        """Group, number and side of the moments at the starts of elements within members."""
        model, found = self.model, dict[int, list[tuple[int, int, int]]]()
        for name, load in model.scene.loads.items():
            element = None if load.type != "moment" or load.node else inner_cut(model.mesh, model.beams.first, load)
            if element is None:
                continue
            for number, group in enumerate(model.terms):
                if f"loads.{name}" in group.names:
                    term = number, group.names.index(f"loads.{name}"), group.turns.shape[1] - 1
                    found.setdefault(element, []).append(term)
        for number, i, side, element in self.jumping:
            found.setdefault(element, []).append((number, i, side))
        return found

    @functools.cached_property
    def jumping(self) -> list[tuple[int, int, int, int]]:
        """Group, number and side of what has a moment at a place within a member, and the element that begins there."""
        model, places = self.model, self.model.segments.places
        begins = {part.start: part.elements.start for part in model.segments.parts}
        ends = {*model.nodes, *model.segments.ends.values()}
        found = []
        for number, group in enumerate(model.terms):
            for i, side in np.argwhere(group.turns != GROUND).tolist() if group.kind.apart else ():
                name = places[group.places[i, side]]
                if name in begins and name not in ends:
                    found.append((number, i, side, begins[name]))
        return found

    @functools.cached_property
    def _ending(self) -> dict[str, str]:
        """The node of each place at which the end of a member slides."""
        scene, ends = self.model.scene, self.model.segments.ends
        return {place: scene.members[name].nodes[-1 if i else 0] for (name, i), place in ends.items()}

    def _gain(self, member: str) -> list[Index]:
        """Cells of the moment on the second end of a rigid member plus that on the first: what its forces leave."""
        part, places = self.model.elements_of(member), len(self.model.segments.places)
        found = list[Index]()
        for e in range(part.start, part.stop):
            found += [cell for k in range(self.model.element.order + 1) for cell in self._on_element(e, k)]
            found += [self._beside(places + e), *(self._cell(*term) for term in self._within.get(e, ()))]
        return found


def shares_rotation(model: Model, node: str) -> bool:
    """Whether another support restrains the rotation of a node as well, so that :attr:`Reactions.rigid` is needed."""
    number, nodes = model.rotations.node_turn[node], model.scene.nodes
    if number is None:
        return False
    every = model.rotations.node_turn.items()
    return any(turn == number and other != node and nodes[other].turn not in FREE for other, turn in every)


def _map(parts: list[Entries], shape: tuple[int, int]) -> SparseMap:
    """The matrix of entries."""
    none = (np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    row, column, value = (np.concatenate(part) for part in zip(none, *parts, strict=True))
    return SparseMap(row, column, value, shape)
