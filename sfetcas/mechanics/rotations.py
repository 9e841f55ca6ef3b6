"""The rotations of a model: one for each node of the elements, shared where members are joined rigidly."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..description.obstacles import carriers
from ..description.scene import Member, Node, Scene
from ..mathematics.arrays import Array, Index, numbers, unit
from .elements import Element
from .mesh import Mesh

__all__ = ["STIFF", "Pin", "RotationFreedom", "Rotations", "end_joints", "number_rotations"]


class RotationFreedom(enum.IntEnum):
    """Restraint of a rotation by the ground: HELD is prescribed, AXIS turns about a fixed axis, FREE is free."""

    FIXED = 0
    AXIS = 1
    FREE = 2


@dataclass(frozen=True)
class Pin:
    """A rotation with a joint to another one.

    Attributes
    ----------
    node, joint : str
        The node, and the kind of joint: hinge, ball, universal or cylindrical.
    base : int or None
        Number of the other rotation; None for the ground.
    turn : int
        Number of the rotation.
    name : str
        The member, or the node where the joint is to the ground.
    """

    node: str
    joint: str
    base: int | None
    turn: int
    name: str


@dataclass(frozen=True, eq=False)
class Rotations:
    """Numbers and restraints of all rotations.

    Attributes
    ----------
    turns : ndarray (elements, p + 1)
        Numbers of the rotations at the nodes of each element.
    kind : ndarray (rotations,)
        Restraint of each rotation, see :class:`RotationFreedom`.
    axis : ndarray (rotations, 3)
        Unit axis of rotations of kind AXIS, fixed axes; without meaning for others.
    pins : tuple of Pin
        Joints of released ends and of supports.
    ends : mapping of str to tuple of int
        Numbers of the rotations at the ends of each member.
    node_turn : mapping of str to int or None
        Number of the rotation of each node; None where the node has no rotation of its own.
    """

    turns: Index
    kind: Index
    axis: Array
    pins: tuple[Pin, ...]
    ends: Mapping[str, tuple[int, ...]]
    node_turn: Mapping[str, int | None]

    def chain(self, elements: slice) -> Index:
        """Numbers of the rotations along consecutive elements, both ends included."""
        turns = self.turns[elements]
        return np.append(turns[:, :-1].ravel(), turns[-1, -1])


def number_rotations(scene: Scene, mesh: Mesh, element: Element) -> Rotations:
    """Number the rotations along the members and find how each is restrained."""
    numbering = _Numbers(scene, element.space)
    turns: list[list[int]] = []
    ends: dict[str, tuple[int, ...]] = {}
    for name, member in scene.members.items():
        first = numbering.of_end(name, 0)
        if member.type == "flexible":
            inner = [numbering.new() for _ in range((len(mesh.cuts[name]) - 1) * element.order - 1)]
        ends[name] = (first, *(numbering.of_end(name, i) for i in range(1, len(member.nodes))))
        if member.type == "rigid":
            turns += [[first] * (element.order + 1)] * (len(mesh.cuts[name]) - 1)
        elif member.type == "flexible":
            chain = [first, *inner, ends[name][-1]]
            turns += [chain[e : e + element.order + 1] for e in range(0, len(chain) - 1, element.order)]
    for name, node in scene.nodes.items():
        held = numbering.freedom[name] != RotationFreedom.FREE
        if node.joint == "rigid" and (held or name in carriers(scene.contacts)):
            numbering.of(("node", name))
    return Rotations(
        turns=np.array(turns, dtype=np.intp).reshape(-1, element.order + 1),
        kind=np.array(numbering.kind, dtype=np.intp),
        axis=unit(numbers(numbering.axis).reshape(-1, 3)),
        pins=tuple(_pins(scene, numbering)),
        ends=ends,
        node_turn={name: numbering.given.get(numbering.root(("node", name))) for name in scene.nodes},
    )


Key = tuple[str, str] | tuple[str, str, int]
"""What a rotation belongs to: ("node", name), or ("end", member, which) where the end is released."""


class _Numbers:
    """Numbers of rotations; what is joined rigidly, or by a rigid member, has the same."""

    def __init__(self, scene: Scene, space: bool) -> None:
        self.scene = scene
        self.kind: list[RotationFreedom] = []
        self.axis: list[tuple[float, float, float]] = []
        self.given: dict[Key, int] = {}
        self.freedom = {name: _node_freedom(node, scene, name, space) for name, node in scene.nodes.items()}
        self._parent: dict[Key, Key] = {}
        self._limits: dict[Key, list[tuple[RotationFreedom, tuple[float, float, float]]]] = {}
        for name, node in scene.nodes.items():
            if node.joint == "rigid" and self.freedom[name] != RotationFreedom.FREE:
                self._limits.setdefault(("node", name), []).append((self.freedom[name], node.turn_axis))
        for name, member in scene.members.items():
            for i, n in enumerate(member.nodes):
                if space and self.freedom[n] != RotationFreedom.FREE and scene.nodes[n].joint == "hinge":
                    self._limits.setdefault(("end", name, i), []).append((RotationFreedom.AXIS, scene.nodes[n].axis))
            if member.type == "rigid":
                self._join(*(self.key(name, i) for i in range(2)))

    def key(self, member: str, i: int) -> Key:
        """What the rotation at an end of a member belongs to."""
        node, joint = end_joints(self.scene, self.scene.members[member])[i]
        return ("node", node) if joint in STIFF else ("end", member, i)

    def root(self, key: Key) -> Key:
        """The one key that stands for all that share its rotation."""
        while key in self._parent:
            key = self._parent[key]
        return key

    def _join(self, a: Key, b: Key) -> None:
        a, b = self.root(a), self.root(b)
        if a != b:
            self._parent[b] = a
            self._limits[a] = self._limits.get(a, []) + self._limits.pop(b, [])

    def new(
        self, freedom: RotationFreedom = RotationFreedom.FREE, about: tuple[float, float, float] = (0.0, 0.0, 1.0)
    ) -> int:
        self.kind.append(freedom)
        self.axis.append(about)
        return len(self.kind) - 1

    def of(self, key: Key) -> int:
        """Number of the rotation of a key, given when it is first asked for."""
        root = self.root(key)
        if root not in self.given:
            self.given[root] = self.new(*_together(self._limits.get(root, [])))
        return self.given[root]

    def of_end(self, member: str, i: int) -> int:
        """Number of the rotation at an end of a member."""
        return self.of(self.key(member, i))


def _together(
    limits: list[tuple[RotationFreedom, tuple[float, float, float]]],
) -> tuple[RotationFreedom, tuple[float, float, float]]:
    """How a rotation may change under all of these: two hinges that are not parallel hold it."""
    about = (0.0, 0.0, 1.0)
    if any(freedom == RotationFreedom.FIXED for freedom, _ in limits):
        return RotationFreedom.FIXED, about
    axes = [unit(axis) for freedom, axis in limits if freedom == RotationFreedom.AXIS]
    if not axes:
        return RotationFreedom.FREE, about
    same = all(np.linalg.norm(np.cross(axes[0], axis)) < tolerances.PARALLEL for axis in axes)
    return (
        (RotationFreedom.AXIS, next(axis for freedom, axis in limits if freedom == RotationFreedom.AXIS))
        if same
        else (RotationFreedom.FIXED, about)
    )


STIFF = ("rigid", "slider")
"""How an end is joined to its node when it turns with it."""


def end_joints(scene: Scene, member: Member) -> list[tuple[str, str]]:
    """(node, joint) of the ends: the joint of the node, or the release of the end where the node is rigid."""
    pairs = zip(member.nodes, member.release, strict=True)
    return [(n, scene.nodes[n].joint if scene.nodes[n].joint != "rigid" else release) for n, release in pairs]


def _node_freedom(node: Node, scene: Scene, name: str, space: bool) -> RotationFreedom:
    driven = any(m.node == name and m.rotation is not None and m.between is None for m in scene.motions.values())
    if node.turn == "fixed" or (node.turn == "hinge" and driven):
        return RotationFreedom.FIXED
    return RotationFreedom.AXIS if node.turn == "hinge" and space else RotationFreedom.FREE


def _pins(scene: Scene, numbers: _Numbers) -> Iterator[Pin]:
    """What turns against what: released ends against the node, or where it does not turn against the first end."""
    ends_at: dict[str, list[tuple[str, int]]] = {name: [] for name in scene.nodes}
    for member_name, m in scene.members.items():
        for place, n in enumerate(m.nodes):
            ends_at[n].append((member_name, place))
    for name, node in scene.nodes.items():
        own = numbers.given.get(numbers.root(("node", name)))
        if own is not None and node.support == "universal":
            yield Pin(name, "universal", None, own, name)
        base = own
        for member, i in ends_at[name]:
            joint = end_joints(scene, scene.members[member])[i][1]
            turn = numbers.of_end(member, i)
            if joint in STIFF or (node.joint == "hinge" and numbers.freedom[name] != RotationFreedom.FREE):
                continue
            if base is None:
                base = turn
            elif base != turn:
                yield Pin(name, joint, base, turn, member)
