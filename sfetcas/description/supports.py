"""Which motions supports restrain, and which they can prescribe."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import first_of_largest
from .loads import Motion
from .records import enumerated, say
from .rings import Ring
from .springs import Spring
from .structure import SLIDING, Member, Node, unit
from .tendons import Tendon

__all__ = [
    "along",
    "check_driven_joint",
    "check_floating",
    "check_motion",
    "check_motions_once",
    "drives",
    "free_to_move",
    "turned_about",
    "upwards",
]

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]


def drives(node: Node, displacement: Triple | None) -> bool:
    """Whether a displacement drives a slider along its guide: it has a component along it."""
    if not node.slides or node.direction is None or displacement is None or not any(displacement):
        return False
    return bool(abs(np.dot(unit(displacement), unit(node.direction))) > tolerances.DECIMAL)


def fixed_directions(node: Node, displacement: Triple | None = None) -> Floats:
    """Unit directions (k, 3) in which the ground restrains a node's displacement; all for a driven slider."""
    if node.support == "free":
        return np.zeros((0, 3))
    if not node.slides or node.direction is None or drives(node, displacement):
        return np.eye(3)
    return np.eye(3) - np.outer(unit(node.direction), unit(node.direction))


def components(
    nodes: Iterable[str],
    members: Mapping[str, Member],
    springs: Mapping[str, Spring],
    tendons: Mapping[str, Tendon],
    rings: Mapping[str, Ring],
) -> Iterator[list[str]]:
    """Names of the nodes of each part of the structure that members, springs, tendons and rings connect."""
    neighbours: dict[str, list[str]] = {name: [] for name in nodes}
    pairs = [(m.nodes[0], other) for m in members.values() for other in m.nodes[1:]]
    pairs += [(s.node, s.to) for s in springs.values() if s.to is not None]
    pairs += [(ring.node, members[ring.member].nodes[0]) for ring in rings.values()]
    for tendon in tendons.values():
        pairs += pairwise(name for name in _passed(tendon, members) if name is not None)
    for first, second in pairs:
        neighbours[first].append(second)
        neighbours[second].append(first)
    left = dict.fromkeys(neighbours)
    while left:
        part = [next(iter(left))]
        del left[part[0]]
        for name in part:
            new = [other for other in dict.fromkeys(neighbours[name]) if other in left]
            part += new
            for other in new:
                del left[other]
        yield part


def _passed(tendon: Tendon, members: Mapping[str, Member]) -> list[str | None]:
    """Nodes that a tendon passes, or of the members that it passes the first; None for points of the ground."""
    return [way.node if way.member is None else members[way.member].nodes[0] for way in tendon.way]


def free_directions(fixed: Floats, dimension: str) -> Floats:
    """Unit directions (k, 3) normal to all restrained ones (m, 3), within x-y in a plane scene."""
    axes = 2 if dimension == "plane" else 3
    if not len(fixed):
        return np.eye(3)[:axes]
    _, values, rows = np.linalg.svd(fixed[:, :axes], full_matrices=False)
    return np.pad(rows[values < tolerances.PARALLEL], ((0, 0), (0, 3 - axes)))


def check_floating(
    nodes: Mapping[str, Node],
    members: Mapping[str, Member],
    springs: Mapping[str, Spring],
    motions: Mapping[str, Motion],
    dimension: str,
    tendons: Mapping[str, Tendon],
    rings: Mapping[str, Ring],
) -> None:
    """Refuse a part of the structure that supports do not hold in every direction.

    Raises
    ------
    SceneError
        Names the nodes of the part and how it can move.
    """
    moved = {motion.node: motion.displacement for motion in motions.values() if motion.displacement is not None}
    sprung: dict[str, list[Floats]] = {name: [] for name in nodes}
    for spring in springs.values():
        if spring.type == "translational" and spring.to is None and spring.stiffness > 0.0:
            along = spring.direction
            sprung[spring.node].append(np.eye(3) if along is None else np.array([unit(along)]))
    for tendon in tendons.values():
        # As springs to the ground: whether what pulls also holds is found with the loads.
        for one, other in pairwise(_passed(tendon, members)):
            held = one if other is None else other if one is None else None
            if held is not None:
                sprung[held].append(np.eye(3))
    for part in components(nodes, members, springs, tendons, rings):
        fixed = np.vstack([fixed_directions(nodes[name], moved.get(name)) for name in part])
        fixed = np.vstack([fixed, *(rows for name in part for rows in sprung[name])])
        free = free_directions(fixed, dimension)
        if len(free):
            raise SceneError(_floating(part, fixed, free[:, : 2 if dimension == "plane" else 3]))


def free_to_move(motion: str) -> str:
    """The sentence that refuses an unrestrained motion."""
    return f"free to move: {motion}; neither stiffness nor a load holds it, add a support, a spring or a motion"


def along(direction: Floats | Sequence[float]) -> str:
    """A direction in words."""
    return f"[{', '.join(f'{part + 0.0:.3g}' for part in direction)}]"


def upwards(direction: Floats) -> Floats:
    """The direction with its sign chosen such that its largest component, of equal ones the first, is positive."""
    return np.asarray(direction * np.sign(direction[first_of_largest(direction)]))


def _floating(part: list[str], fixed: Floats, free: Floats) -> str:
    nodes = enumerated(part, "node")
    if not len(fixed):
        return free_to_move(f"{nodes} moving along {', '.join('xyz'[: len(free)])} and turning")
    return free_to_move(f"{nodes} moving along {' and '.join(along(upwards(direction)) for direction in free)}")


def check_motions_once(motions: Mapping[str, Motion]) -> None:
    """Refuse two motions of the same kind of one node.

    Raises
    ------
    SceneError
        Names both.
    """
    taken: dict[tuple[str, str, tuple[str, str] | None], str] = {}
    for name, motion in motions.items():
        for kind in ("displacement", "rotation"):
            if getattr(motion, kind) is None:
                continue
            other = taken.setdefault((motion.node, kind, motion.between), name)
            if other != name:
                message = f"node {motion.node!r} has a {kind} from motions.{other} already"
                raise SceneError(message, ("motions", name, kind))


def check_motion(motion: Motion, node: Node, dimension: str, reason: str) -> None:
    """Refuse what the support of the node does not hold, and a rotation in the wrong form.

    Raises
    ------
    SceneError
        Place within the motion.
    """
    if node.support == "free":
        accepted = "a node with a support (a slider leaves it one direction), or a joint with the key 'between'"
        raise SceneError(f"found {motion.node!r}, which is free and cannot be moved, accepted: {accepted}", ("node",))
    if motion.rotation is not None:
        _check_rotation(motion, node, dimension, reason)


def _check_rotation(motion: Motion, node: Node, dimension: str, reason: str) -> None:
    where, found = ("rotation",), say(motion.rotation)
    number = isinstance(motion.rotation, float)
    if node.joint != "rigid":
        message = f"node {motion.node!r} has no rotation of its own, as its joint is a {node.joint}"
        raise SceneError(message, where)
    if node.turn == "ball":
        accepted = "only nodes that are clamped, a hinge or a slider that does not turn as a ball can be turned"
        raise SceneError(f"node {motion.node!r} turns freely as a ball; {accepted}", where)
    if node.turn == "hinge" and not number:
        raise SceneError(f"found {found}, accepted: a number, the angle about the axis of the hinge", where)
    if node.turn == "fixed" and number and dimension == "space":
        raise SceneError(f"found {found}, accepted: a rotation vector [x, y, z], as {reason}", where)


def turned_about(motion: Motion, node: Node, members: Mapping[str, Member]) -> Triple:
    """Axis (3,) about which a motion rotates its node or, at a driven joint, the second member."""
    if motion.between is None:
        return node.turn_axis
    hinged = node.joint != "rigid" or "hinge" in members[motion.between[1]].release
    return node.axis if hinged or node.direction is None else node.direction


def check_driven_joint(motion: Motion, node: Node, members: Mapping[str, Member]) -> None:
    """Refuse to drive what is no hinge or slide between two members.

    Raises
    ------
    SceneError
        Place within the motion.
    """
    assert motion.between is not None
    how = []
    for name in motion.between:
        member = members.get(name)
        if member is None or motion.node not in member.nodes:
            raise SceneError(f"found {name!r}, accepted: two members that end at {motion.node!r}", ("between",))
        release = member.release[member.nodes.index(motion.node)]
        how.append(node.joint if node.joint != "rigid" else release)
    if motion.rotation is not None and (
        not isinstance(motion.rotation, float) or not {"hinge", "cylindrical"} & {*how}
    ):
        accepted = "a number, the angle of a hinge between the two members"
        raise SceneError(
            f"found {say(motion.rotation)} where they are joined {' and '.join(how)}, accepted: {accepted}",
            ("rotation",),
        )
    if motion.displacement is not None and how[1] not in SLIDING:
        raise SceneError(
            f"the second member is joined as {how[1]}, accepted: as slider, cylindrical or slot", ("displacement",)
        )
