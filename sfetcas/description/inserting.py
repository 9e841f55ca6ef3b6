"""Tubes and members that are pushed out as the load factor grows: the scene at a factor, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import SceneError
from .shapes import Straight
from .tubes import Tube, check_reach

__all__ = ["check_insertion", "gone_to", "inserted", "pushed", "refuse_insertion", "share_of", "stops_between"]

SAMPLES = 17
"""Places between two knots of histories at which it is looked at how far tubes reach."""


def pushed(scene: Any) -> Iterator[tuple[str, str, Any]]:
    """Table, name and record of all tubes and members that are pushed out."""
    for table in ("tubes", "members"):
        for name, record in getattr(scene, table).items():
            if record.insertion:
                yield table, name, record


def inserted(scene: Any, factor: float) -> Any:
    """The scene as it is at a load factor: tubes and members have gone forward by then, and go no further.

    Raises
    ------
    SceneError
        A tube reaches beyond its members there.
    """
    if not scene.inserts:
        return scene
    changes: dict[str, Any] = {}
    positions = {name: np.asarray(node.position) for name, node in scene.nodes.items()}
    for table, name, record in pushed(scene):
        gone = gone_to(scene, record, factor)
        changes[f"{table}.{name}.insertion"] = 0.0
        if table == "tubes":
            changes[f"tubes.{name}.start"] = record.start + gone
            continue
        along = gone * _direction(scene, name)
        for node in _beyond(scene, name):
            positions[node] = positions[node] + along
            changes[f"nodes.{node}.position"] = tuple(positions[node].tolist())
    return scene.replace(changes)


def stops_between(scene: Any, begin: float, end: float) -> tuple[float, ...]:
    """Load factors from one to another, both included, with those at which histories have a knot between them."""
    low, high = min(begin, end), max(begin, end)
    knots = {t for name in scene.histories_used for t in scene.histories[name].knots if low < t < high}
    return (begin, *sorted(knots, reverse=end < begin), end)


def refuse_insertion(scene: Any, message: str) -> None:
    """Refuse a scene in which something is pushed out.

    Raises
    ------
    SceneError
        Names it, with the message.
    """
    for table, name, record in pushed(scene):
        found = f"found {record.insertion:g}, which load steps follow one after the other"
        raise SceneError(f"{found}: {message}", (table, name, "insertion"))


def check_insertion(scene: Any) -> None:
    """Refuse analyses that follow no insertion, members that cannot grow, and tubes that leave their members.

    Raises
    ------
    SceneError
        Names the key.
    """
    for table in ("tubes", "members"):
        for name, record in getattr(scene, table).items():
            if record.insertion_history is not None and record.insertion_history not in scene.histories:
                known = ", ".join(scene.histories) or "none, as the scene has no histories"
                message = f"found {record.insertion_history!r}, accepted: {known}"
                raise SceneError(message, (table, name, "insertion_history"))
    for table, name, record in pushed(scene):
        where = (table, name, "insertion")
        if scene.analysis.type != "static":
            message = f"found with the analysis {scene.analysis.type!r}, accepted: 'static', whose steps follow it"
            raise SceneError(message, where)
        _check_beside(scene, where)
        history = record.insertion_history
        if history is not None and any(step for _, step, _ in scene.histories[history].jumps()):
            message = f"found {history!r}, which jumps, accepted: a history without jumps"
            raise SceneError(message, (table, name, "insertion_history"))
        if table == "members":
            _check_growing(scene, name)
    if any(pushed(scene)):
        _check_reaches(scene)


def _check_beside(scene: Any, where: Sequence[str]) -> None:
    """Refuse what is not followed while something is pushed out."""
    beside = "accepted: none beside an insertion"
    if scene.analysis.equilibria == "all":
        raise SceneError(f"found {'all'!r}, accepted: 'one' with {'.'.join(where)}", ("analysis", "equilibria"))
    if scene.remembers:
        raise SceneError(f"found with a law that has memory, {beside}".replace("none", "no such law"), tuple(where))
    if scene.contacts:
        raise SceneError(f"found {next(iter(scene.contacts))!r}, {beside}", ("contacts",))
    if scene.rotating is not None:
        raise SceneError(f"found rotating axes, {beside}", ("rotating",))
    for name, spring in scene.springs.items():
        if spring.stop is not None:
            raise SceneError(f"found a stop, {beside}", ("springs", name, "stop"))
    for name, tendon in scene.tendons.items():
        if tendon.may_be_slack or tendon.rubs:
            found = "one that may be slack" if tendon.may_be_slack else "one with friction"
            raise SceneError(f"found {found}, {beside}", ("tendons", name))


def _check_growing(scene: Any, name: str) -> None:
    """Refuse a member that is not straight and even, not clamped, or with what keeps a place on it or beyond it."""
    member, where = scene.members[name], ("members", name, "insertion")
    first, last = member.nodes[0], member.nodes[-1]
    if member.type != "flexible" or not isinstance(member.shape, Straight):
        kind = member.type if member.type != "flexible" else f"of the shape {member.shape.type!r}"
        raise SceneError(f"found with a member that is {kind}, accepted: a flexible and straight one", where)
    if scene.nodes[first].support != "clamped" or member.release[0] != "rigid":
        message = f"found with the first node {first!r}, accepted: a clamped one, to which the member is joined rigidly"
        raise SceneError(message, where)
    section = scene.sections[member.section]
    if not section.even:
        message = f"found with the section {member.section!r}, which varies along the member, accepted: an even one"
        raise SceneError(message, where)
    accepted = "accepted: nothing that keeps its place on a member that grows"
    for key, load in scene.loads.items():
        if load.member == name and (load.at is not None or load.profile is not None or load.part != (0.0, 1.0)):
            raise SceneError(f"found the load {key!r} on a part of it, {accepted}", where)
    for table in ("actuations", "magnets"):
        for key, acting in getattr(scene, table).items():
            if acting.member == name:
                raise SceneError(f"found {table}.{key} along it, {accepted}", where)
    # Their lengths without force are those of the undeformed scene, which changes as the member grows.
    for key in scene.tendons:
        raise SceneError(f"found the tendon {key!r}, accepted: none beside a member that grows", where)
    for key, spring in scene.springs.items():
        if spring.type == "translational":
            message = f"found the translational spring {key!r}, accepted: none beside a member that grows"
            raise SceneError(message, where)
    beyond = _beyond(scene, name)
    if first in beyond:
        message = f"found with members that lead from {last!r} back to {first!r}, accepted: a free way outwards"
        raise SceneError(message, where)
    for node in beyond:
        if scene.nodes[node].support != "free":
            message = f"found the node {node!r} beyond it, which the ground holds, accepted: nodes that go along"
            raise SceneError(message, where)


def _check_reaches(scene: Any) -> None:
    """Refuse tubes that leave their members, and members that are drawn in altogether, at some factor on the way."""
    lengths = {name: line.length for name, line in scene.center_lines.items()}
    for begin, end in pairwise((0.0, *scene.analysis.steps)):
        stops = stops_between(scene, begin, end)
        for factor in np.unique([np.linspace(a, b, SAMPLES) for a, b in pairwise(stops)]):
            now = dict(lengths)
            for table, name, record in pushed(scene):
                if table == "members":
                    now[name] += gone_to(scene, record, factor)
                    if not now[name] > 0.0:
                        message = f"found a length of {now[name]:.6g} m left at factor {factor:.6g}"
                        raise SceneError(f"{message}, accepted: one above zero", ("members", name, "insertion"))
            for name, tube in scene.tubes.items():
                try:
                    there: Tube = tube.replace(start=tube.start + gone_to(scene, tube, factor), insertion=0.0)
                    check_reach(there, sum(now[member] for member in tube.members))
                except SceneError as error:
                    raise SceneError(f"at factor {factor:.6g} {error.bare}", ("tubes", name, "insertion")) from None


def gone_to(scene: Any, record: Any, factor: float) -> float:
    """How far a tube or a member has gone forward at a load factor, m."""
    return float(record.insertion * share_of(scene, record.insertion_history, factor))


def share_of(scene: Any, history: str | None, factor: float) -> float:
    """What multiplies an input at a load factor: its history's value there, or the factor itself."""
    return float(factor if history is None else scene.histories[history].factor(float(factor)))


def _direction(scene: Any, member: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Unit vector (3,) from the first to the last node of a member."""
    nodes = scene.members[member].nodes
    along = np.subtract(scene.nodes[nodes[-1]].position, scene.nodes[nodes[0]].position)
    return np.asarray(along / np.linalg.norm(along))


def _beyond(scene: Any, member: str) -> list[str]:
    """The nodes that go along with the end of a member that grows: those that other members join to it."""
    found = [scene.members[member].nodes[-1]]
    for node in found:
        for name, other in scene.members.items():
            if name != member and node in other.nodes:
                found += [end for end in other.nodes if end not in found]
    return found
