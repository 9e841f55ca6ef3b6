"""The model of a scene on a mesh: element data, rotations, positions and closing equations as arrays.

Everything here is dimensionless: lengths by the longest member, energies by the largest bending stiffness over
that length, so that micrometres and kilometres are the same problem.  All displacements are from the undeformed
scene.  A model holds only what its scene requires; :attr:`Model.blocks` says what, how much and why.

Two assemblies.  *closing*: the displacement of a node is the sum of the reaches of the members on a path from
the ground, and what is left are closing equations, one for each loop and each further held direction.  *nodal*:
displacements of free nodes are unknowns and each member has its closing equation.  Both are the same linear
maps with other entries: with ``Delta`` the reaches of the members, ``y`` the displacements kept as unknowns and
``b`` the prescribed ones,

    u = E Delta + Y y + B b,      0 = Z Delta + W y + B_Z b.
"""

from __future__ import annotations

import enum
import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from . import quaternion
from .arrays import Array, Index
from .elements import Element, element_by_name
from .errors import SceneError
from .mesh import SAME, Mesh
from .scene import Load, Node, Scene
from .sections import evaluate

__all__ = ["Block", "Loading", "Model", "Positions", "Scales", "Turn", "assemble"]


@dataclass(frozen=True)
class Scales:
    """Units of a model: length (m), force (N) and moment or energy (N m)."""

    length: float
    moment: float

    @property
    def force(self) -> float:
        """Unit of force, N."""
        return self.moment / self.length


class Turn(enum.IntEnum):
    """How the rotation of a node may change."""

    HELD = 0
    AXIS = 1
    FREE = 2


@dataclass(frozen=True)
class Block:
    """One kind of unknowns or rows of a model: its number and why it is there."""

    name: str
    size: int
    why: str


@dataclass(frozen=True)
class Positions:
    """The linear maps of the module's docstring; nodes, members and rows times axes, flattened."""

    E: Array
    Y: Array
    B: Array
    Z: Array
    W: Array
    BZ: Array
    rows: tuple[str, ...]
    unknowns: tuple[str, ...]


@dataclass(frozen=True)
class Loading:
    """Loads and motions of one load factor, dimensionless.

    Attributes
    ----------
    force : ndarray (nodes, axes)
        Dead forces on macro-nodes, the resultants of the loads along members put to their first nodes.
    couple : ndarray (rotations,)
        Moments about z on rotations; plane only.
    pull : ndarray (elements, points, axes)
        Minus the internal force at the integration points that the loads along the member cause.
    spread : ndarray (elements, points, axes)
        Distributed force times weight times length; what ``pull`` was made of, for section forces.
    shift : ndarray (nodes * axes,)
        Prescribed displacements, zero for nodes that are free.
    turn : ndarray (rotations, 3)
        Prescribed rotation vectors of held rotations.
    """

    force: Array
    couple: Array
    pull: Array
    spread: Array
    shift: Array
    turn: Array

    def scaled(self, factor: float) -> Loading:
        """All loads and motions times a factor."""
        return Loading(*(factor * getattr(self, name) for name in PARTS))

    def unloaded(self) -> Loading:
        """The motions alone."""
        zero = {name: np.zeros_like(getattr(self, name)) for name in ("force", "couple", "pull", "spread")}
        return replace(self, **zero)

    def plus(self, other: Loading) -> Loading:
        """The sum of two loadings."""
        return Loading(*(getattr(self, name) + getattr(other, name) for name in PARTS))


PARTS = ("force", "couple", "pull", "spread", "shift", "turn")


@dataclass(frozen=True, eq=False)
class Model:
    """A scene on a mesh, ready to be solved any number of times; made by :func:`assemble`.

    Attributes
    ----------
    scene, mesh, element, scales, assembly
        What it was made of.
    stiffness : ndarray (elements, points, stiffnesses)
        Stiffness times weight over length, fixed axes of the undeformed scene.
    tangent : ndarray (elements, points, axes)
        Tangent of the unloaded centre line times weight times length.
    weight : ndarray (elements, points)
        Weight times length.
    owner : ndarray (elements,)
        Number of the member that an element belongs to.
    turns : ndarray (elements, p + 1)
        Numbers of the rotations at the nodes of an element.
    kind : ndarray (rotations,)
        :class:`Turn` of each rotation.
    axis : ndarray (rotations, 3)
        Axis of the rotations of kind AXIS, fixed axes.
    hinges : ndarray (n, 2), hinge_axes : ndarray (n, 2, 3)
        Pairs of rotations joined by a hinge in space and two directions normal to its axis, undeformed scene.
    ends : mapping of str to (int, int)
        Rotations at the two ends of a member.
    node_turn : mapping of str to int or None
        Rotation of a node; None where the node has no rotation of its own.
    """

    scene: Scene
    mesh: Mesh
    element: Element
    scales: Scales
    assembly: str
    stiffness: Array
    tangent: Array
    weight: Array
    owner: Index
    turns: Index
    kind: Index
    axis: Array
    hinges: Index
    hinge_axes: Array
    ends: Mapping[str, tuple[int, int]]
    node_turn: Mapping[str, int | None]
    positions: Positions
    groups: Mapping[str | None, Loading]
    blocks: tuple[Block, ...]
    dimension: str
    reason: str
    first: Mapping[str, int] = field(repr=False)

    @property
    def space(self) -> bool:
        """Quaternions and three axes, or angles and two."""
        return self.element.space

    @property
    def unknowns(self) -> int:
        """Unknowns of the minimisation: components of rotations, displacements kept; without multipliers."""
        return int(self.widths.sum()) + self.positions.Y.shape[1]

    @functools.cached_property
    def widths(self) -> Index:
        """Unknown numbers of each rotation in the minimisation: 4, 2 or 0 in space; 1 or 0 in the plane."""
        table = np.array([0, 2, 4]) if self.space else np.array([0, 1, 1])
        return table[self.kind]

    @functools.cached_property
    def members(self) -> tuple[str, ...]:
        """Names of the members, in the order of :attr:`owner`."""
        return tuple(self.scene.members)

    @functools.cached_property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, in the order of the displacements."""
        return tuple(self.scene.nodes)

    def elements_of(self, member: str) -> slice:
        """The elements of a member, first to last."""
        start = self.first[member]
        return slice(start, start + len(self.mesh.cuts[member]) - 1)

    def chain(self, member: str) -> Index:
        """Numbers of the rotations along a member, both ends included."""
        turns = self.turns[self.elements_of(member)]
        return np.append(turns[:, :-1].ravel(), turns[-1, -1])

    def along(self, member: str) -> Array:
        """Fractions of the length at which the rotations of :meth:`chain` stand."""
        cuts = self.mesh.cuts[member]
        inner = cuts[:-1, None] + np.diff(cuts)[:, None] * self.element.nodes[:-1]
        return np.append(inner.ravel(), 1.0)

    def factors(self, factor: float) -> dict[str | None, float]:
        """Multiplier of each group of loads: the factor, or that of the history at the factor."""
        histories = self.scene.histories
        return {name: factor if name is None else histories[name].factor(factor) for name in self.groups}

    def loading(self, factor: float, share: float = 1.0) -> Loading:
        """Loads and motions at a load factor, all of them times ``share``."""
        parts = [self.groups[name].scaled(share * value) for name, value in self.factors(factor).items()]
        total = parts[0]
        for part in parts[1:]:
            total = total.plus(part)
        return total

    def held(self, loading: Loading) -> Array:
        """Rotations with the held ones at their prescribed values and all others at rest, (rotations, comps)."""
        if not self.space:
            return loading.turn[:, 2:3].copy()
        return quaternion.from_rotation_vector(loading.turn)


def assemble(
    scene: Scene,
    mesh: Mesh,
    *,
    assembly: Literal["auto", "closing", "nodal"] = "auto",
) -> Model:
    """The model of a scene on a mesh.

    Parameters
    ----------
    scene : Scene
    mesh : Mesh
        Element order, integration and cuts of each member.
    assembly : str
        ``closing`` (unknowns are rotations only), ``nodal`` (and displacements of macro-nodes), or ``auto``: the
        one whose stationarity equations have fewer entries.

    Raises
    ------
    SceneError
        A moment on a node that nothing turns with, a held structure that nothing can load.
    """
    space = scene.resolved_dimension == "space"
    element = element_by_name(f"SFET{mesh.order + 1}", space, mesh.gauss)
    scales = _scales(scene)
    data = _element_data(scene, mesh, element, scales)
    rotations = _rotations(scene, mesh, element)
    both = {name: _positions(scene, element.axes, name == "closing") for name in ("closing", "nodal")}
    if assembly == "auto":
        assembly = "closing" if _cost(both["closing"], mesh) <= _cost(both["nodal"], mesh) else "nodal"
    model = Model(
        scene=scene,
        mesh=mesh,
        element=element,
        scales=scales,
        assembly=assembly,
        positions=both[assembly],
        groups=_groups(scene, mesh, element, scales, rotations, data),
        blocks=(),
        dimension=scene.resolved_dimension,
        reason=scene.dimension_reason,
        **data,
        **rotations,
    )
    object.__setattr__(model, "blocks", _blocks(model))
    return model


def _scales(scene: Scene) -> Scales:
    length = max(line.length for line in scene.center_lines.values())
    x = np.linspace(0.0, 1.0, 5)
    stiffest = max(float(np.nanmax(scene.sections[m.section].stiffness(x))) for m in scene.members.values())
    return Scales(length, stiffest / length)


def _element_data(scene: Scene, mesh: Mesh, element: Element, scales: Scales) -> dict[str, Any]:
    stiffness, tangent, weight = [], [], []
    owner: list[Index] = []
    first: dict[str, int] = {}
    for number, (name, member) in enumerate(scene.members.items()):
        cuts, line = mesh.cuts[name], scene.center_lines[name]
        x = cuts[:-1, None] + np.diff(cuts)[:, None] * element.points
        length = line.length / scales.length * np.diff(cuts)
        w = length[:, None] * element.weights
        values = scene.sections[member.section].stiffness(x.ravel()) / (scales.moment * scales.length)
        frames = quaternion.matrix(line.quaternions(x.ravel()))
        # Integrals over xi of squares of derivatives by xi: weight over length.
        per_length = (element.weights / length[:, None])[..., None]
        stiffness.append(_in_fixed_axes(values, frames, element, line.bending_axis).reshape(*x.shape, -1) * per_length)
        tangent.append(frames[:, : element.axes, 0].reshape(*x.shape, -1) * w[..., None])
        weight.append(w)
        first[name] = sum(len(part) for part in owner)
        owner.append(np.full(len(w), number))
    return {
        "stiffness": np.concatenate(stiffness),
        "tangent": np.concatenate(tangent),
        "weight": np.concatenate(weight),
        "owner": np.concatenate(owner),
        "first": first,
    }


def _in_fixed_axes(values: Array, frames: Array, element: Element, bending_axis: int) -> Array:
    """Stiffness (n, 3) about b1, b2, b3 in the fixed axes: upper triangles (n, 6), or about z (n, 1)."""
    if not element.space:
        return values[:, 1:2] if bending_axis == 2 else values[:, 2:3]
    full = np.einsum("nij,nj,nkj->nik", frames, values, frames)
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def _rotations(scene: Scene, mesh: Mesh, element: Element) -> dict[str, Any]:
    """Number the rotations along the members and say how each may change."""
    kind: list[Turn] = []
    axis: list[tuple[float, float, float]] = []
    node_turn: dict[str, int | None] = dict.fromkeys(scene.nodes)
    at_node: dict[str, list[tuple[str, int]]] = {name: [] for name in scene.nodes}

    def new(turn: Turn, about: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> int:
        kind.append(turn)
        axis.append(about)
        return len(kind) - 1

    carried = {name for m in scene.members.values() for name, how in _end_joints(scene, m) if how == "rigid"}

    def end(name: str, joint: str) -> int:
        node = scene.nodes[name]
        turn = _node_turn(node, scene, name, element.space)
        if node.joint == "rigid" and node_turn[name] is None and (name in carried or turn != Turn.FREE):
            node_turn[name] = new(turn, node.axis)
        if joint == "rigid":
            number = node_turn[name]
            assert number is not None
            return number
        pinned = node.joint == "hinge" and turn != Turn.FREE
        number = new(Turn.AXIS if pinned and element.space else Turn.FREE, node.axis)
        at_node[name].append((joint, number))
        return number

    turns, ends = [], {}
    for name, member in scene.members.items():
        (a, joint_a), (b, joint_b) = _end_joints(scene, member)
        n = len(mesh.cuts[name]) - 1
        start = end(a, joint_a)
        inner = [new(Turn.FREE) for _ in range(n * element.order - 1)]
        chain = [start, *inner, end(b, joint_b)]
        turns += [chain[e * element.order : (e + 1) * element.order + 1] for e in range(n)]
        ends[name] = (chain[0], chain[-1])
    pairs, normals = _hinges(scene, at_node, node_turn, kind) if element.space else ([], [])
    return {
        "turns": np.array(turns, dtype=np.intp),
        "kind": np.array(kind, dtype=np.intp),
        "axis": np.array([np.asarray(a) / np.linalg.norm(a) for a in axis]),
        "hinges": np.array(pairs, dtype=np.intp).reshape(-1, 2),
        "hinge_axes": np.array(normals, dtype=float).reshape(-1, 2, 3),
        "ends": ends,
        "node_turn": node_turn,
    }


def _end_joints(scene: Scene, member: Any) -> list[tuple[str, str]]:
    """(node, joint) of the two ends: the joint of the node, or the release of the end where the node is rigid."""
    pairs = zip(member.nodes, member.release, strict=True)
    return [(n, scene.nodes[n].joint if scene.nodes[n].joint != "rigid" else release) for n, release in pairs]


def _node_turn(node: Node, scene: Scene, name: str, space: bool) -> Turn:
    driven = any(m.node == name and m.rotation is not None for m in scene.motions.values())
    by_support = {"clamped": "fixed", "hinge": "hinge", "slider": node.rotation}.get(node.support, "ball")
    if by_support == "fixed" or (by_support == "hinge" and driven):
        return Turn.HELD
    return Turn.AXIS if by_support == "hinge" and space else Turn.FREE


def _hinges(
    scene: Scene, at_node: Mapping[str, list[tuple[str, int]]], node_turn: Mapping[str, int | None], kind: list[Turn]
) -> tuple[list[tuple[int, int]], list[Array]]:
    """Pairs of rotations that a hinge joins, against the node or, where it has none, against the first end."""
    pairs: list[tuple[int, int]] = []
    normals: list[Array] = []
    for name, released in at_node.items():
        hinged = [number for joint, number in released if joint == "hinge" and kind[number] == Turn.FREE]
        base = node_turn[name]
        if base is None and hinged:
            base, *hinged = hinged
        for number in hinged:
            assert base is not None
            pairs.append((base, number))
            normals.append(_normals(np.asarray(scene.nodes[name].axis), 3))
    return pairs, normals


def _normals(direction: Array, axes: int) -> Array:
    """Unit vectors that complete a direction to an orthonormal basis, (axes - 1, axes)."""
    d = direction[:axes] / np.linalg.norm(direction[:axes])
    basis = np.linalg.svd(d[None, :])[2][1:]
    return np.asarray(basis)


def _slides(scene: Scene, name: str) -> bool:
    """A slider whose travel is not prescribed."""
    node = scene.nodes[name]
    if node.support != "slider":
        return False
    d = np.asarray(node.direction)
    shifts = [np.asarray(m.displacement) for m in scene.motions.values() if m.node == name and m.displacement]
    return not any(abs(d @ shift) > SAME * np.linalg.norm(shift) * np.linalg.norm(d) for shift in shifts)


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


def _positions(scene: Scene, axes: int, closing: bool) -> Positions:
    """The linear maps between reaches of members and displacements of nodes."""
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
                    across = _normals(guide(there), axes)
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


def _cost(positions: Positions, mesh: Mesh) -> float:
    """Entries of the closing rows and unknowns: what the stationarity equations grow by."""
    counts = np.array([len(cuts) - 1 for cuts in mesh.cuts.values()])
    width = positions.Z.shape[1] // len(counts)
    touched = np.abs(positions.Z).reshape(len(positions.rows), len(counts), width).sum(axis=2) > 0.0
    return float((touched @ (counts * mesh.order)).sum() + 4 * positions.Y.shape[1])


def _groups(
    scene: Scene, mesh: Mesh, element: Element, scales: Scales, rotations: Mapping[str, Any], data: Mapping[str, Any]
) -> dict[str | None, Loading]:
    """Unit loadings of all loads and motions that share a multiplier."""
    nodes = list(scene.nodes)
    shape = data["weight"].shape

    def empty() -> Loading:
        return Loading(
            np.zeros((len(nodes), element.axes)),
            np.zeros(len(rotations["kind"])),
            np.zeros((*shape, element.axes)),
            np.zeros((*shape, element.axes)),
            np.zeros(len(nodes) * element.axes),
            np.zeros((len(rotations["kind"]), 3)),
        )

    groups: dict[str | None, Loading] = {None: empty()}
    for name, load in scene.loads.items():
        group = groups.setdefault(load.history, empty())
        if load.type == "moment":
            _add_moment(group, load, name, scene, mesh, element, scales, rotations, data)
        elif load.node is not None:
            group.force[nodes.index(load.node)] += np.asarray(load.vector)[: element.axes] / scales.force
        else:
            assert load.member is not None
            _add_along(group, load, load.member, scene, mesh, element, scales, data)
    if scene.gravity is not None and np.any(scene.gravity):
        for member in scene.members:
            _add_weight(groups[None], member, scene, mesh, element, scales, data)
    for motion in scene.motions.values():
        group = groups.setdefault(motion.history, empty())
        number = nodes.index(motion.node)
        if motion.displacement is not None:
            shift = np.asarray(motion.displacement)[: element.axes] / scales.length
            group.shift[number * element.axes : (number + 1) * element.axes] += shift
        if motion.rotation is not None:
            group.turn[rotations["node_turn"][motion.node]] += _rotation_vector(motion.rotation, scene, motion.node)
    return groups


def _rotation_vector(rotation: Any, scene: Scene, node: str) -> Array:
    if np.ndim(rotation) == 1:
        return np.asarray(rotation, dtype=float)
    axis = np.asarray(scene.nodes[node].axis, dtype=float)
    return np.asarray(float(rotation) * axis / np.linalg.norm(axis))


def _add_moment(
    group: Loading,
    load: Load,
    name: str,
    scene: Scene,
    mesh: Mesh,
    element: Element,
    scales: Scales,
    rotations: Mapping[str, Any],
    data: Mapping[str, Any],
) -> None:
    if load.node is not None:
        number = rotations["node_turn"][load.node]
        if number is None:
            raise SceneError(f"nothing turns with node {load.node!r}, so no moment can act on it", ("loads", name))
    else:
        assert load.member is not None
        assert load.at is not None
        number = _chain(load.member, mesh, element, rotations, data)[_cut(mesh, load.member, load.at) * element.order]
    group.couple[number] += load.vector[2] / scales.moment


def _chain(
    member: str, mesh: Mesh, element: Element, rotations: Mapping[str, Any], data: Mapping[str, Any]
) -> list[int]:
    start = data["first"][member]
    turns = rotations["turns"][start : start + len(mesh.cuts[member]) - 1]
    return [*turns[:, :-1].ravel().tolist(), int(turns[-1, -1])]


def _cut(mesh: Mesh, member: str, at: float) -> int:
    return int(np.argmin(np.abs(mesh.cuts[member] - at)))


def _add_along(
    group: Loading,
    load: Load,
    member: str,
    scene: Scene,
    mesh: Mesh,
    element: Element,
    scales: Scales,
    data: Mapping[str, Any],
) -> None:
    """A force at a place of a member, or one spread along it."""
    value = np.asarray(load.vector, dtype=float)[: element.axes] / scales.force
    start = data["first"][member]
    if load.type == "force":
        cut = _cut(mesh, member, 1.0 if load.at is None else load.at)
        group.pull[start : start + cut] -= value
        group.force[list(scene.nodes).index(scene.members[member].nodes[0])] += value
        return
    cuts = mesh.cuts[member]
    x = cuts[:-1, None] + np.diff(cuts)[:, None] * element.points
    profile = 1.0 if load.profile is None else evaluate(load.profile, x.ravel()).reshape(x.shape)[..., None]
    _spread(group, member, profile * value * scales.length * np.ones((*x.shape, 1)), scene, mesh, element, data)


def _add_weight(
    group: Loading,
    member: str,
    scene: Scene,
    mesh: Mesh,
    element: Element,
    scales: Scales,
    data: Mapping[str, Any],
) -> None:
    cuts = mesh.cuts[member]
    x = cuts[:-1, None] + np.diff(cuts)[:, None] * element.points
    mass = scene.sections[scene.members[member].section].mass(x.ravel()).reshape(x.shape)
    gravity = np.asarray(scene.gravity, dtype=float)[: element.axes] / scales.force
    _spread(group, member, mass[..., None] * gravity * scales.length, scene, mesh, element, data)


def _spread(
    group: Loading, member: str, density: Array, scene: Scene, mesh: Mesh, element: Element, data: Mapping[str, Any]
) -> None:
    """Add a force per length (elements, points, axes): the adjoint of summing up the displacements.

    The pull at a point is minus the load beyond it; within an element "beyond" is the transpose of the
    matrix that integrates the turned tangents, so that the discrete potential has exactly this gradient.
    """
    start = data["first"][member]
    weight = data["weight"][start : start + len(density)]
    on_element = np.einsum("ek,eka->ea", weight, density)
    beyond = np.cumsum(on_element[::-1], axis=0)[::-1] - on_element
    length = weight.sum(axis=1)[:, None, None]
    inside = length * np.einsum("jk,ej,eja->eka", element.to_points, weight, density) / weight[..., None]
    group.spread[start : start + len(density)] += weight[..., None] * density
    group.pull[start : start + len(density)] -= beyond[:, None, :] + inside
    group.force[list(scene.nodes).index(scene.members[member].nodes[0])] += on_element.sum(axis=0)


def _blocks(model: Model) -> tuple[Block, ...]:
    """What the model consists of, and why."""
    kind = model.kind
    free, about = int((kind == Turn.FREE).sum()), int((kind == Turn.AXIS).sum())
    blocks = []
    if model.space:
        blocks.append(Block("quaternions", 4 * free, f"4 for each of {free} free rotations: {model.reason}"))
        if about:
            blocks.append(Block("hinge rotations", 2 * about, "2 for each rotation held but for its hinge axis"))
        blocks.append(Block("norms", free + about, "a quaternion of a free rotation is unit; held ones need no row"))
    else:
        blocks.append(Block("angles", free, f"1 for each of {free} free rotations: {model.reason}"))
    if model.positions.unknowns:
        why = "nodal assembly" if model.assembly == "nodal" else "nothing but guides hold the structure"
        blocks.append(Block("displacements", len(model.positions.unknowns), f"{why}: positions are unknowns"))
    if model.positions.rows:
        why = "one for each member" if model.assembly == "nodal" else "one for each loop and further held direction"
        blocks.append(Block("closings", len(model.positions.rows), f"{why}; the multipliers are forces"))
    if len(model.hinges):
        blocks.append(Block("hinges", 2 * len(model.hinges), "a hinge between members keeps two directions together"))
    return tuple(blocks)
