"""Upper estimates of the force and moment in each member before anything is solved, for the choice of the first mesh.

Forces are in balance at every node, so the forces in the members are a flow from the loads to the ground.  In a tree
this determines them: a member carries what acts beyond it.  In a structure with loops the distribution is known only
when it is solved; the flow for equal resistances of all members gives the magnitude of the shares.  Loops carry forces
of their own beside it, as the middle of a rope does that carries loads at its ends: a member of loops is taken to carry
several times the largest share of any member of them.  Guides and springs close loops, but the flow does not end in
them, as it might not in truth.

Magnitudes are added up whatever the directions, as loads may turn.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..description.loads import Load
from ..description.scene import Scene
from ..description.tendons import Piece, Stretch, Tendon, offsets
from ..mathematics.arrays import Array, Index, values_of
from ..mathematics.linear import SparseSolver

__all__ = ["Carried", "carried", "loose_ends", "magnetic", "natural_turning"]

ALLOWANCE = 4.0
"""A member of loops is taken to carry so many times the largest share of them, though no more than all loads."""

GROUND = 0
"""Number of the ground; nodes come after it."""


@dataclass(frozen=True)
class Carried:
    """Magnitude of the force (N) and of the moment (N m) in a member."""

    force: float
    moment: float


def carried(scene: Scene) -> dict[str, Carried]:
    """Estimates for each member: forces at the largest factor of the analysis, moments at factor 1."""
    number = {name: i + 1 for i, name in enumerate(scene.nodes)}
    acting = _Acting(scene, number)
    own, at_nodes = acting.along, acting.at_nodes
    total = at_nodes.sum(axis=0)
    if not total.any() or scene.contacts:
        # An obstacle may hold a member anywhere.
        return {name: Carried(*total) for name in scene.members}
    edges, owner = _edges(scene, number)
    place = np.array([GROUND, *(GROUND if _holds(scene, name) else i for name, i in number.items())])
    flow = _flow(place[edges], at_nodes, _parts(place[edges], len(place))[0])
    loops = _parts(place[np.vstack([edges, _yielding(scene, number)])], len(place))[1][: len(edges)]
    for loop in np.unique(loops[loops >= 0]):
        flow[loops == loop] = ALLOWANCE * flow[loops == loop].max(axis=0)
    reaching = {name: own.get(name, np.zeros(2)) for name in scene.members}
    for edge, name in enumerate(owner):
        if name is not None:
            # Half of what acts along the member has come in at its far end.
            reaching[name] = np.maximum(reaching[name], flow[edge] + 0.5 * own.get(name, np.zeros(2)))
    return {name: Carried(*np.minimum(found, total)) for name, found in reaching.items()}


class _Acting:
    """(force, moment) of what acts along each member, and at each node, where members hand theirs to their ends."""

    def __init__(self, scene: Scene, number: dict[str, int]) -> None:
        self._scene, self._number = scene, number
        self._largest = _largest(scene, None)
        self.along: dict[str, Array] = {}
        self.at_nodes = np.zeros((len(number) + 1, 2))
        self._ending: dict[str, list[str]] = {name: [] for name in scene.nodes}
        for name, member in scene.members.items():
            for node in member.nodes:
                self._ending[node].append(name)
        for load in scene.loads.values():
            self._take(load)
        strength = _strength(scene)
        for magnet in scene.magnets.values():
            if magnet.node is not None:
                self.at_nodes[self._number[magnet.node], 1] += math.hypot(*magnet.vector) * strength(magnet.node)
        for name, tendon in scene.tendons.items():
            self._string(name, tendon)
        if scene.gravity is not None:
            self._weigh(float(np.linalg.norm(scene.gravity)) * self._largest)

    def _add(self, member: str, size: Array) -> None:
        self.along[member] = self.along.get(member, 0.0) + size
        ends = self._scene.members[member].nodes
        for node in ends:
            self.at_nodes[self._number[node]] += size / len(ends)

    def _take(self, load: Load) -> None:
        size = np.array([0.0, math.hypot(*load.vector)])
        if load.type != "moment":
            # Whole turns need few elements: moments count as they are given, forces with their factor.
            size = size[::-1] * self._share(load)
        if load.type == "distributed":
            size = size * (load.to - load.from_) * self._scene.center_lines[str(load.member)].length
        if load.node is None:
            self._add(str(load.member), size)
        elif load.type == "moment" and _holds(self._scene, load.node):
            # What holds a node need not hold it against turning.
            for name in self._ending[load.node]:
                self._add(name, size)
        else:
            self.at_nodes[self._number[load.node]] += size

    def _string(self, name: str, tendon: Tendon) -> None:
        """What a tendon of given tension bends the members by that it runs along, and pulls at those that it joins."""
        if tendon.measured or not tendon.force:
            return
        reached: dict[str, Array] = {}
        for piece in self._scene.tendon_pieces[name]:
            for member, apart, arm in self._strung(piece):
                reached[member] = np.maximum(reached.get(member, 0.0), np.array([float(apart), arm]))
        for member, size in reached.items():
            self._add(member, abs(tendon.force) * self._share(tendon) * size)

    def _strung(self, piece: Piece) -> Iterator[tuple[str, bool, float]]:
        """Members at which a piece pulls, whether from elsewhere, and how far from the centre line it is, m."""
        if isinstance(piece, Stretch):
            x = np.linspace(piece.start, piece.end, 9)
            yield piece.member, False, float(np.linalg.norm(offsets(piece.way, x, x)[0], axis=1).max())
            return
        for hole in piece:
            members = self._ending.get(str(hole.node), []) if hole.member is None else [hole.member]
            for member in members:
                yield member, piece[0].member != piece[1].member or hole.member is None, float(np.linalg.norm(hole.arm))

    def _share(self, load: Load | Tendon) -> float:
        return _largest(self._scene, load.history)

    def _weigh(self, pull: float) -> None:
        scene, x = self._scene, np.linspace(0.0, 1.0, 5)
        for name, member in scene.members.items():
            if member.section is not None:
                mass = float(scene.sections[member.section].mass(x).mean()) * scene.center_lines[name].length
                self._add(name, np.array([pull * mass, 0.0]))
        for name, node in scene.nodes.items():
            self.at_nodes[self._number[name], 0] += pull * node.mass


def _largest(scene: Scene, history: str | None) -> float:
    """Largest factor in the steps of the analysis of what has a history, or grows with the load factor."""
    steps = scene.analysis.steps
    return max(abs(factor if history is None else scene.histories[history].factor(factor)) for factor in steps)


def _strength(scene: Scene) -> Callable[[str], float]:
    """The magnetic field, T, at factor 1, added up in magnitude, at a node in the undeformed scene."""

    def at(node: str) -> float:
        fields = scene.fields.values()
        return float(sum(_finite(field.of(scene.nodes[node].position)) for field in fields))

    return at


def _finite(values: Array) -> float:
    """Largest magnitude, T, of field vectors (..., 3), without what is not finite."""
    with np.errstate(all="ignore"):
        sizes = np.linalg.norm(values, axis=-1)
    return float(np.where(np.isfinite(sizes), sizes, 0.0).max())


def magnetic(scene: Scene, member: str) -> float:
    """Magnitude, N, of the force at an end that would bend a magnetised member as the fields do: moment per length
    times the field.
    """
    x, found = np.linspace(0.0, 1.0, 9), 0.0
    for magnet in scene.magnets.values():
        if magnet.member == member:
            places = scene.center_lines[member].positions(x)
            strength = sum(
                _largest(scene, field.history) * _finite(field.of(places)) for field in scene.fields.values()
            )
            found += float(np.linalg.norm(magnet.along(x), axis=1).max() * strength)
    return found


def natural_turning(scene: Scene, member: str) -> float:
    """Angle, rad, by which actuations at factor 1, and tubes, bend and twist a free member, at most."""
    found = 0.0
    for actuation in scene.actuations.values():
        if actuation.member == member:
            low, high = actuation.part
            most = np.linalg.norm(actuation.along(np.linspace(low, high, 9)), axis=1).max()
            found += float(most) * (high - low) * scene.center_lines[member].length
    for name, runs in scene.tube_runs.items():
        spans = [(run.end - run.start) * scene.center_lines[member].length for run in runs if run.member == member]
        found += float(np.linalg.norm(values_of(scene.tubes[name].vector))) * sum(spans)
    return found


def loose_ends(scene: Scene) -> dict[str, tuple[bool, bool]]:
    """Of each flexible member whether nothing bends it at its first end, and at its second.

    Forces alone act there on a member that is straight unloaded: it follows them without a boundary layer.
    """
    flexible = [name for name, member in scene.members.items() if member.type == "flexible"]
    if scene.contacts or scene.tendons or scene.rings:
        return dict.fromkeys(flexible, (False, False))
    turned = {spring.node for spring in scene.springs.values() if spring.type == "rotational"}
    turned |= {motion.node for motion in scene.motions.values() if motion.rotation is not None}
    turned |= {str(load.node) for load in scene.loads.values() if load.type == "moment"}
    turned |= {str(magnet.node) for magnet in scene.magnets.values()}
    turned |= {name for name, node in scene.nodes.items() if node.inertia is not None}
    ending = Counter(node for member in scene.members.values() for node in member.nodes)
    free = {"ball", "slot", "hinge"} if scene.resolved_dimension == "plane" else {"ball", "slot"}
    # What bends a member all along ends at its ends; what is off its line bends it by forces.
    bent = {str(load.member) for load in scene.loads.values() if load.type == "moment"}
    bent |= {magnet.member for magnet in scene.magnets.values() if magnet.member is not None}
    bent |= {actuation.member for actuation in scene.actuations.values()}
    bent |= {run.member for runs in scene.tube_runs.values() for run in runs}

    def loose(node: str, release: str) -> bool:
        record = scene.nodes[node]
        released = release in free or record.joint in free
        return node not in turned and (released or (ending[node] == 1 and record.turn in {"free", *free}))

    found = {}
    for name in flexible:
        member = scene.members[name]
        along = name in bent or scene.center_lines[name].turning > 0.0 or member.off_line(scene.sections)
        first, second = (not along and loose(*end) for end in zip(member.nodes, member.release, strict=True))
        found[name] = first, second
    return found


def _holds(scene: Scene, name: str) -> bool:
    """Whether a node is held in every direction; a guide lets loads along it pass on."""
    node = scene.nodes[name]
    return node.support != "free" and not node.slides


def _edges(scene: Scene, number: dict[str, int]) -> tuple[Index, list[str | None]]:
    """What passes forces on, (edges, 2) numbers of nodes, and the member that each belongs to; springs have none."""
    edges: list[tuple[int, int]] = []
    owner: list[str | None] = []
    for name, member in scene.members.items():
        for node in member.nodes[1:]:
            edges.append((number[member.nodes[0]], number[node]))
            owner.append(name)
    for spring in scene.springs.values():
        if spring.to is not None:
            edges.append((number[spring.node], number[spring.to]))
            owner.append(None)
    return np.array(edges, dtype=np.intp).reshape(-1, 2), owner


def _yielding(scene: Scene, number: dict[str, int]) -> Index:
    """What joins nodes to the ground and may let loads pass or not: guides and springs, (n, 2) numbers of nodes."""
    ends = [name for name, node in scene.nodes.items() if node.slides]
    ends += [spring.node for spring in scene.springs.values() if spring.type == "translational" and spring.to is None]
    return np.array([(number[name], GROUND) for name in ends], dtype=np.intp).reshape(-1, 2)


def _flow(edges: Index, sources: Array, grounded: Array) -> Array:
    """Sizes of the flow through edges that all resist alike, (edges, 2); parts that nothing holds carry everything."""
    flow = np.broadcast_to(sources.sum(axis=0), (len(edges), 2)).copy()
    free = np.flatnonzero(grounded)
    free = free[free != GROUND]
    index = np.full(len(grounded), len(free))
    index[free] = np.arange(len(free))
    supported = grounded[edges[:, 0]]
    a, b = index[edges[supported]].T
    levels = np.vstack([_levels(a, b, sources[free]), np.zeros((1, 2))])
    flow[supported] = np.abs(levels[a] - levels[b])
    return flow


def _levels(a: Index, b: Index, sources: Array) -> Array:
    """Levels of nodes from which as much flows down the edges as comes in; the ground has the last number."""
    count = len(sources)
    if not count:
        return sources
    row, column = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    value = np.repeat([1.0, 1.0, -1.0, -1.0], len(a))
    inside = (row < count) & (column < count)
    places, inverse = np.unique(column[inside] * count + row[inside], return_inverse=True)
    solver = SparseSolver(count, places % count, places // count)
    solver.factor(np.bincount(inverse.ravel(), weights=value[inside]))
    return solver.solve(sources)


def _parts(edges: Index, count: int) -> tuple[Array, Index]:
    """Which nodes are joined to the ground, and of each edge the loops it is one of, -1 where it is a bridge.

    Depth first search (Tarjan 1974): an edge is a bridge when nothing beyond it leads back before it.
    """
    at: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for edge, (a, b) in enumerate(edges.tolist()):
        at[a].append((edge, b))
        at[b].append((edge, a))
    time = np.full(count, -1)
    parent = np.full(count, -1)
    order: list[int] = []
    grounded = 0
    for root in range(count):
        stack = [(root, -1)]
        while stack:
            node, edge = stack.pop()
            if time[node] < 0:
                time[node], parent[node] = len(order), edge
                order.append(node)
                stack += [(other, e) for e, other in at[node] if time[other] < 0]
        grounded = grounded or len(order)
    back = time.copy()
    for node in reversed(order):
        for edge, other in at[node]:
            if edge != parent[node]:
                back[node] = min(back[node], back[other] if parent[other] == edge else time[other])
    loop = np.full(count, -1)
    for node in order:
        entered = parent[node]
        before = -1 if entered < 0 else edges[entered].sum() - node
        loop[node] = time[node] if entered < 0 or back[node] == time[node] else loop[before]
    joined = loop[edges[:, 0]] == loop[edges[:, 1]]
    return time < grounded, np.where(joined, loop[edges[:, 0]], -1)
