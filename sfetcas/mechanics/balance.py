"""Balance of nodes: reactions, what springs and small members do, and moments inside rigid members.

Every force and moment here is what one thing takes from its surroundings; at a node they add up to the load and
the reaction.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array, unit
from ..mathematics.keeping import kept
from ..mathematics.linear import SparseMap, smallest
from .batches import GroupBatch
from .connections import connections_of
from .equations import Equations, State
from .loading import Loading
from .model import Model
from .rotations import STIFF, Turn, end_joints
from .terms import GROUND, Group, answers_of

__all__ = ["Balance", "SpringState", "guide", "pinned_turns", "three"]

GROUPS = 64
"""Groups of connections of which something is kept at hand."""


@dataclass(frozen=True)
class SpringState:
    """A spring at a state: angle (rad) and moment (N m), or elongation (m) and force (N), on the second party."""

    rotational: bool
    travel: float
    effort: float
    stop: float | None = None

    def to_dict(self) -> dict[str, float]:
        """As in the JSON answer; ``stop`` is what a stop does, zero while it is not reached."""
        names = ("angle", "moment") if self.rotational else ("travel", "force")
        found = dict(zip(names, (self.travel, self.effort), strict=True))
        return found if self.stop is None else {**found, "stop": self.stop}


def three(a: Array) -> Array:
    """Vectors (..., 2) or (..., 3) as (..., 3)."""
    return a if a.shape[-1] == 3 else np.concatenate([a, np.zeros((*a.shape[:-1], 1))], axis=-1)


def guide(scene: Scene, node: str) -> Array | None:
    """Direction in which a support lets a node move; None where it does not, or a motion drives it."""
    record = scene.nodes[node]
    if not record.slides or any(m.node == node and m.displacement is not None for m in scene.motions.values()):
        return None
    along = np.asarray(record.direction, dtype=float)
    return np.asarray(along / np.linalg.norm(along))


def pinned_turns(model: Model, node: str) -> list[int]:
    """Rotations of member ends that a support itself pins, its node having none."""
    scene, rotations, record = model.scene, model.rotations, model.scene.nodes[node]
    if record.support == "free" or record.joint != "hinge":
        return []
    turns = [rotations.ends[n][m.nodes.index(node)] for n, m in scene.members.items() if node in m.nodes]
    # A member that is rigid up to another support that holds it is held there.
    elsewhere = {turn for n, turn in rotations.node_turn.items() if scene.nodes[n].turn not in ("free", "ball")}
    return [turn for turn in turns if turn not in elsewhere]


class Balance:
    """The balance of one state, dimensionless.

    Parameters
    ----------
    start_forces, end_forces : sequences of ndarray (axes,)
        Internal force at both ends of each segment.
    places : ndarray (places, axes)
        Displacements.
    """

    def __init__(
        self,
        equations: Equations,
        state: State,
        loading: Loading,
        start_forces: Sequence[Array],
        end_forces: Sequence[Array],
        places: Array,
    ) -> None:
        self.model, self._state, self._loading = equations.model, state, equations.acting(state, loading)
        self._moments, self._links = equations.shares(state, loading)
        self._start_forces, self._end_forces, self._places = start_forces, end_forces, places
        self._turns = equations.model.element.turns

    # -- shares of connections ------------------------------------------------------------------

    def _moment_of(self, links: Array, number: int, side: int) -> Array:
        moment = np.zeros(3)
        moment[3 - self._turns :] = links[number, side * self._turns : (side + 1) * self._turns]
        return moment

    def _force_of(self, group: Group, links: Array, number: int, side: int) -> Array:
        axes = self.model.element.axes
        first = group.turns.shape[1] * self._turns + side * axes
        return three(links[number, first : first + axes])

    @functools.cached_property
    def _totals(self) -> Array:
        """Moments (rotations, 3) that are left to supports."""
        model = self.model
        totals = -self._loading.moment
        np.add.at(totals, model.rotations.turns, self._moments)
        for group, links in zip(model.connections, self._links, strict=True):
            for side in range(group.turns.shape[1]):
                for number, turn in enumerate(group.turns[:, side]):
                    if turn != GROUND and not self._is_ground(group, number):
                        totals[turn] += self._moment_of(links, number, side)
        return totals

    @staticmethod
    def _is_ground(group: Group, number: int) -> bool:
        """A universal support: what it does is a reaction."""
        return group.kind.supports and bool((group.turns[number] == GROUND).any())

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force and moment about the node that the ground exerts."""
        return self._force(node), self._moment(node)

    def _force(self, node: str) -> Array:
        model, place = self.model, self.model.segments.place(node)
        force = -three(self._loading.own[place])
        for i, part in enumerate(model.segments.parts):
            if part.start == node:
                force = force - three(self._start_forces[i])
            if part.end == node:
                force = force + three(self._end_forces[i])
        for group, links in zip(model.connections, self._links, strict=True):
            for number, side in np.argwhere(group.places == place):
                force = force + self._force_of(group, links, number, side)
        along = guide(self.model.scene, node)
        # A guide does nothing along itself: what is left there is not exactly in balance.
        return force if along is None else force - (along @ force) * along

    def _moment(self, node: str) -> Array:
        number = self.model.rotations.node_turn[node]
        if number is None:
            return sum((self._totals[turn] for turn in pinned_turns(self.model, node)), np.zeros(3))
        if self._shared(number):
            return self._rigid[1].get(node, np.zeros(3))
        left = self._totals[number]
        free = self.model.rotations.kind[number] == Turn.FREE
        return left if free and self.model.scene.nodes[node].support == "universal" else self.held(number, left)

    def held(self, number: int, moment: Array) -> Array:
        """The share of a moment on a rotation that the ground holds: about what is free nothing does."""
        kind = self.model.rotations.kind[number]
        if kind == Turn.AXIS:
            axis = self.model.rotations.axis[number]
            return moment - (axis @ moment) * axis
        return np.zeros(3) if kind == Turn.FREE else moment

    def starting_moments(self, elements: slice) -> Array:
        """Moments (n, 3) that the surroundings exert on the first nodes of elements."""
        return np.asarray(self._moments[elements, 0])

    # -- rigid members ----------------------------------------------------------------------------

    def _shared(self, number: int) -> bool:
        return sum(other == number for other in self.model.rotations.node_turn.values()) > 1

    def start_moment(self, member: str) -> Array:
        """Moment that the surroundings exert on the first end of a member of elements."""
        if self.model.scene.members[member].type == "rigid":
            return self._rigid[0][member]
        return np.asarray(self._moments[self.model.beams.first[member], 0])

    @functools.cached_property
    def _rigid(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Moments on first ends of rigid members, and reactions of nodes that share a rotation.

        From the balance of every node that a rigid member is joined to.  Where that leaves a choice (rigid members
        in loops, one body with several supports) the smallest reactions are taken, then the smallest moments inside.
        """
        scene = self.model.scene
        names = [name for name in self.model.members if scene.members[name].type == "rigid"]
        nodes = list(dict.fromkeys(n for name in names for n in scene.members[name].nodes))
        held = [n for n in nodes if scene.nodes[n].turn not in ("free", "ball")]
        columns = {("member", name): i for i, name in enumerate(names)}
        columns |= {("node", n): len(names) + i for i, n in enumerate(held)}
        balances = [self._at_node(columns, names, node) for node in nodes]
        hinged: list[tuple[str, tuple[dict[int, float], Array]]] = []
        for name in names:
            for i, (node, joint) in enumerate(end_joints(scene, scene.members[name])):
                if joint in STIFF:
                    continue
                if self._grounded(node):
                    hinged.append((node, self._at_pin(columns, name, i)))
                else:
                    balances.append(self._at_pin(columns, name, i))
        rows = [({3 * i + k: gain for i, gain in row.items()}, right[k]) for row, right in balances for k in range(3)]
        for n, (row, right) in hinged:
            along = unit(scene.nodes[n].axis)
            rows.append(({3 * i + k: gain * along[k] for i, gain in row.items() for k in range(3)}, right @ along))
        for n in filter(self._turns_freely, held):
            first, axis = 3 * columns["node", n], np.asarray(scene.nodes[n].turn_axis)
            rows.append(({first + k: part for k, part in enumerate(unit(axis))}, 0.0))
        weights = np.repeat([INNER_WEIGHT, 1.0], [3 * len(names), 3 * len(held)])
        solved = _smallest(rows, weights).reshape(-1, 3)
        starts = {name: solved[i] for (kind, name), i in columns.items() if kind == "member"}
        return starts, {name: solved[i] for (kind, name), i in columns.items() if kind == "node"}

    def _grounded(self, node: str) -> bool:
        """Whether the ground holds member ends hinged at a node across the axis: no joint of theirs says how much."""
        record = self.model.scene.nodes[node]
        return self.model.space and record.joint == "hinge" and record.turn not in ("free", "ball", "universal")

    def _turns_freely(self, node: str) -> bool:
        """A supported hinge that nothing drives: the ground exerts no moment about its axis."""
        scene = self.model.scene
        driven = any(m.node == node and m.rotation is not None and m.between is None for m in scene.motions.values())
        return scene.nodes[node].turn == "hinge" and not driven

    def _at_node(
        self, columns: dict[tuple[str, str], int], rigid: list[str], node: str
    ) -> tuple[dict[int, float], Array]:
        """All that takes moments at a node, the reaction on the other side."""
        row, known = dict[int, float](), self._node_known(node)
        for name in rigid:
            for i, at in enumerate(self.model.scene.members[name].nodes):
                if at == node:
                    row[columns["member", name]] = 1.0 - 2.0 * i
                    known = known + i * self._gain(name)
        if ("node", node) in columns:
            row[columns["node", node]] = -1.0
        return row, -known

    def _at_pin(self, columns: dict[tuple[str, str], int], member: str, i: int) -> tuple[dict[int, float], Array]:
        """What the joint at a released end takes, a rigid member does not."""
        node, turn = self.model.scene.members[member].nodes[i], self.model.rotations.ends[member][i]
        right = -self._connected(node, turn) - i * self._gain(member)
        return {columns["member", member]: 1.0 - 2.0 * i}, right

    def _connected(self, node: str, turn: int | None = None) -> Array:
        """Moments that joints and springs at a node take from one rotation, or springs and slides from all.

        A hinge takes from one side what it gives to the other; a slide has a lever, a spring may go to the ground.
        """
        moment = np.zeros(3)
        for group, links in zip(self.model.connections, self._links, strict=True):
            if group.kind.table == "members":
                continue
            for number, side in np.argwhere(group.turns != GROUND):
                mine = group.kind.one_sided if turn is None else group.turns[number, side] == turn
                if mine and group.nodes[number] == node:
                    moment = moment + self._moment_of(links, number, side)
        return moment

    def spring_moment(self, node: str) -> Array:
        """Moment that rotational springs at a node take from its surroundings."""
        return self._connected(node)

    def _gain(self, member: str) -> Array:
        """Moment on the second end of a rigid member plus that on the first: what its forces leave."""
        part = self.model.elements_of(member)
        return self._moments[part].sum(axis=(0, 1)) - self._loading.jump[part].sum(axis=0)

    def _node_known(self, node: str) -> Array:
        """Moments that all but rigid members take at a node, less the load there."""
        model, scene = self.model, self.model.scene
        known = np.zeros(3)
        for name, member in scene.members.items():
            if node not in member.nodes or member.type == "rigid":
                continue
            i = member.nodes.index(node)
            if member.type == "small":
                known = known + self.body_ends(name)[i][1]
            else:
                part = model.elements_of(name)
                known = known + (self._moments[part.start, 0] if i == 0 else self._moments[part.stop - 1, -1])
        place = model.segments.place(node)
        return known + self._connected(node) - self._loading.couple[place]

    # -- springs and small members ----------------------------------------------------------------

    def spring(self, name: str) -> SpringState:
        """Angle and moment, or travel and force, and what its stop does, in SI units."""
        found, record = self.answers("springs", name), self.model.scene.springs[name]
        state = SpringState("angle" in found, *found.values())
        if record.stop is None:
            return state
        unit, row = self.model.scales.moment if state.rotational else self.model.scales.force, f"springs.{name}.stop"
        names = self.model.row_names
        effort = -float(self._state.lam[names.index(row)]) * unit if row in names else 0.0
        return replace(state, stop=effort)

    def answers(self, table: str, name: str) -> dict[str, float]:
        """What connections of a name tell under the keys of the answer, in SI units."""
        found: dict[str, float] = {}
        for number, i in connections_of(self.model.connections, table, name):
            units = self.model.connections[number].kind.answers
            values = self._answers(number)[i].tolist()
            found |= {key: x * self.model.scales.of(unit) for (key, unit), x in zip(units.items(), values, strict=True)}
        return found

    @kept(GROUPS)
    def _answers(self, number: int) -> Array:
        """What all connections of a group tell, (n, answers), dimensionless."""
        model, state, group = self.model, self._state, self.model.connections[number]
        first = len(model.positions.rows) + sum(len(other.rows) for other in model.connections[:number])
        batch = GroupBatch(model, group, answers_of(group.kind), model.winding.parts[number + 1])
        lam = state.lam[first : first + len(group.rows)]
        return batch(state.q, self._places, state.wound, self._loading.loads[number], lam)[0]

    def body_ends(self, member: str) -> list[tuple[Array, Array]]:
        """Force and moment that the surroundings exert on each end of a small member."""
        number, i = next(connections_of(self.model.connections, "members", member))
        group, links = self.model.connections[number], self._links[number]
        sides = range(group.places.shape[1])
        return [(self._force_of(group, links, i, k), self._moment_of(links, i, k)) for k in sides]


def _smallest(rows: Sequence[tuple[dict[int, float], float]], weights: Array) -> Array:
    """The smallest solution of rows, each its entries by column and its right side."""
    row = np.repeat(np.arange(len(rows)), [len(entries) for entries, _ in rows])
    column = np.concatenate([list(entries) for entries, _ in rows])
    value = np.concatenate([list(entries.values()) for entries, _ in rows])
    matrix = SparseMap(row, column, value, (len(rows), len(weights)))
    return smallest(matrix, np.array([right for _, right in rows]), weights)


INNER_WEIGHT = 1e-8
"""Weight of moments inside rigid members where reactions count 1: reactions are made small first."""
