"""The rotations of a model: one for each node of the elements, shared where members are joined rigidly."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Index
from .elements import Element
from .mesh import Mesh
from .positions import normals
from .scene import Member, Node, Scene

__all__ = ["Rotations", "Turn", "number_rotations"]


class Turn(enum.IntEnum):
    """How the rotation of a node may change."""

    HELD = 0
    AXIS = 1
    FREE = 2


@dataclass(frozen=True, eq=False)
class Rotations:
    """Numbers and freedoms of all rotations.

    Attributes
    ----------
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

    turns: Index
    kind: Index
    axis: Array
    hinges: Index
    hinge_axes: Array
    ends: Mapping[str, tuple[int, int]]
    node_turn: Mapping[str, int | None]

    def chain(self, elements: slice) -> Index:
        """Numbers of the rotations along consecutive elements, both ends included."""
        turns = self.turns[elements]
        return np.append(turns[:, :-1].ravel(), turns[-1, -1])


def number_rotations(scene: Scene, mesh: Mesh, element: Element) -> Rotations:
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
    pairs, across = _hinges(scene, at_node, node_turn, kind) if element.space else ([], [])
    return Rotations(
        turns=np.array(turns, dtype=np.intp),
        kind=np.array(kind, dtype=np.intp),
        axis=np.array([np.asarray(a) / np.linalg.norm(a) for a in axis]),
        hinges=np.array(pairs, dtype=np.intp).reshape(-1, 2),
        hinge_axes=np.array(across, dtype=float).reshape(-1, 2, 3),
        ends=ends,
        node_turn=node_turn,
    )


def _end_joints(scene: Scene, member: Member) -> list[tuple[str, str]]:
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
    across: list[Array] = []
    for name, released in at_node.items():
        hinged = [number for joint, number in released if joint == "hinge" and kind[number] == Turn.FREE]
        base = node_turn[name]
        if base is None and hinged:
            base, *hinged = hinged
        for number in hinged:
            assert base is not None
            pairs.append((base, number))
            across.append(normals(np.asarray(scene.nodes[name].axis), 3))
    return pairs, across
