"""Whether a scene lies in x-y, and if not, the first thing that does not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array, values_of
from ..mathematics.quaternion import matrix, rotate
from .actuation import Actuation, Magnet, MagneticField
from .contacts import Contact
from .loads import Load, Motion
from .sections import CrossSection
from .shapes import CenterLine
from .springs import Spring
from .structure import Member, Node
from .tendons import Tendon, Way, offsets
from .tubes import Tube

__all__ = ["out_of_plane"]

Triple = tuple[float, float, float]
Finding = tuple[tuple[str, ...], str]


def out_of_plane(
    nodes: Mapping[str, Node],
    lines: Mapping[str, CenterLine],
    loads: Mapping[str, Load],
    motions: Mapping[str, Motion],
    springs: Mapping[str, Spring],
    gravity: Triple | None,
    members: Mapping[str, Member],
    contacts: Mapping[str, Contact],
    rotating: Triple | None,
    sections: Mapping[str, CrossSection],
    actuations: Mapping[str, Actuation],
    fields: Mapping[str, MagneticField],
    magnets: Mapping[str, Magnet],
    tendons: Mapping[str, Tendon],
    tubes: Mapping[str, Tube],
) -> Finding | None:
    """Place in the scene and description of the first thing that does not lie in x-y; None where all does."""
    if gravity is not None and _leaves(gravity):
        return ("gravity",), "has a z component"
    if rotating is not None and _turns_out(rotating):
        return ("rotating",), "is not along z"
    findings = (
        _nodes(nodes),
        _members(lines),
        _sections(members, lines, sections),
        _spins(members),
        _loads(loads, lines),
        _motions(motions),
        _springs(springs),
        _cylindrical(nodes, members),
        _contacts(contacts),
        _actuations(actuations, lines),
        _fields(fields, nodes),
        _magnets(magnets, lines),
        _tendons(tendons, lines),
        _tubes(tubes),
    )
    return next((finding for group in findings for finding in group), None)


def _nodes(nodes: Mapping[str, Node]) -> Iterator[Finding]:
    size = max((abs(entry) for node in nodes.values() for entry in node.position[:2]), default=0.0)
    for name, node in nodes.items():
        for key in ("position", "start"):
            point = getattr(node, key)
            if point is not None and abs(point[2]) > tolerances.DECIMAL * size:
                yield ("nodes", name, key), "has a z component"
        if node.velocity is not None and _leaves(node.velocity):
            yield ("nodes", name, "velocity"), "has a z component"
        if node.axis2 is not None:
            yield ("nodes", name, "axis2"), "makes a joint that turns about two axes"
        if node.direction is not None and _leaves(node.direction):
            yield ("nodes", name, "direction"), "has a z component"
        if _turns_out(node.axis):
            yield ("nodes", name, "axis"), "is not along z"


def _members(lines: Mapping[str, CenterLine]) -> Iterator[Finding]:
    x = np.linspace(0.0, 1.0, 33)
    for name, line in lines.items():
        if line.planar:
            continue
        if np.abs(line.tangents(x)[:, 2]).max() > tolerances.DECIMAL:
            yield ("members", name, "shape"), "leaves x-y"
        elif np.abs(line.curvatures(x)[:, 0]).max() * line.length > tolerances.DECIMAL:
            yield ("members", name, "shape"), "twists"
        else:
            yield ("members", name, "b2"), "is neither along z nor in x-y"


def _sections(
    members: Mapping[str, Member], lines: Mapping[str, CenterLine], sections: Mapping[str, CrossSection]
) -> Iterator[Finding]:
    for name, member in members.items():
        section = None if member.section is None else sections.get(member.section)
        if section is None or member.type == "rigid" or not lines[name].planar:
            continue
        leaves = section.leaves(lines[name].bending_axis)
        if leaves is not None:
            yield ("sections", str(member.section), leaves[0]), leaves[1]


def _spins(members: Mapping[str, Member]) -> Iterator[Finding]:
    for name, member in members.items():
        if isinstance(member.spin, tuple) and _turns_out(member.spin):
            yield ("members", name, "spin"), "is not about z"
        if any(part != 0.0 for part in member.turned_about[:2]):
            yield ("members", name, "turned"), "is not about z"


def _cylindrical(nodes: Mapping[str, Node], members: Mapping[str, Member]) -> Iterator[Finding]:
    for name, node in nodes.items():
        if node.support == "cylindrical":
            yield ("nodes", name, "support"), "turns about a line that is not along z"
    for name, member in members.items():
        if "cylindrical" in member.release:
            yield ("members", name, "release"), "turns about a line that is not along z"


def _loads(loads: Mapping[str, Load], lines: Mapping[str, CenterLine]) -> Iterator[Finding]:
    for name, load in loads.items():
        if load.frame == "section":
            # Along a plane line the sections turn about z: what leaves x-y at the start does so everywhere.
            start = lines[str(load.member)].quaternions(np.zeros(1))
            if _leaves(rotate(start, np.asarray(load.vector))[0]):
                yield ("loads", name, "value"), "leaves x-y"
            continue
        if load.type == "moment" and _turns_out(load.vector):
            yield ("loads", name, "value"), "is not about z"
        if load.type != "moment" and _leaves(load.vector):
            yield ("loads", name, "value"), "has a z component"


def _motions(motions: Mapping[str, Motion]) -> Iterator[Finding]:
    for name, motion in motions.items():
        if motion.displacement is not None and _leaves(motion.displacement):
            yield ("motions", name, "displacement"), "has a z component"
        if isinstance(motion.rotation, tuple) and _turns_out(motion.rotation):
            yield ("motions", name, "rotation"), "is not about z"


def _springs(springs: Mapping[str, Spring]) -> Iterator[Finding]:
    for name, spring in springs.items():
        if spring.axis is not None and _turns_out(spring.axis):
            yield ("springs", name, "axis"), "is not along z"
        for key in ("anchor", "direction"):
            vector = getattr(spring, key)
            if vector is not None and _leaves(vector):
                yield ("springs", name, key), "has a z component"


def _contacts(contacts: Mapping[str, Contact]) -> Iterator[Finding]:
    for name, contact in contacts.items():
        if contact.normal is not None and _leaves(contact.normal):
            yield ("contacts", name, "normal"), "has a z component"
        if contact.direction is not None and _leaves(contact.direction) and _turns_out(contact.direction):
            yield ("contacts", name, "direction"), "is neither along z nor in x-y"
        if _turns_out(contact.axis):
            yield ("contacts", name, "axis"), "is not along z"
        if contact.type == "sphere" and contact.center is not None and contact.center[2] != 0.0:
            yield ("contacts", name, "center"), "has a z component"


def _actuations(actuations: Mapping[str, Actuation], lines: Mapping[str, CenterLine]) -> Iterator[Finding]:
    for name, actuation in actuations.items():
        # Along a plane line the sections turn about z: what bends out of x-y at the start does so everywhere.
        start = lines[actuation.member].quaternions(np.zeros(1))
        turned = rotate(start, np.asarray(actuation.vector))[0]
        if _turns_out(tuple(turned.tolist())):
            yield ("actuations", name, "value"), "bends or twists out of x-y"


def _fields(fields: Mapping[str, MagneticField], nodes: Mapping[str, Node]) -> Iterator[Finding]:
    for name, field in fields.items():
        for key in ("value", "moment", "position"):
            vector = getattr(field, key)
            if vector is not None and _leaves(vector):
                yield ("fields", name, key), "has a z component"
        if field.function is not None:
            values = field.of([node.position for node in nodes.values()])
            if np.abs(values[:, 2]).max() > tolerances.DECIMAL * np.abs(values).max():
                yield ("fields", name, "function"), "has a z component"
        if field.gradient is None:
            continue
        slopes = np.abs(field.gradient)[:2]
        if slopes[:, 2].max() > tolerances.DECIMAL * slopes.max():
            yield ("fields", name, "gradient"), "changes the field along z or towards z"


def _magnets(magnets: Mapping[str, Magnet], lines: Mapping[str, CenterLine]) -> Iterator[Finding]:
    for name, magnet in magnets.items():
        if magnet.member is None:
            if _leaves(magnet.vector):
                yield ("magnets", name, "moment"), "has a z component"
            continue
        start = lines[magnet.member].quaternions(np.zeros(1))
        if _leaves(rotate(start, np.asarray(magnet.vector))[0]):
            yield ("magnets", name, "moment_density"), "leaves x-y"


def _tendons(tendons: Mapping[str, Tendon], lines: Mapping[str, CenterLine]) -> Iterator[Finding]:
    for name, tendon in tendons.items():
        for i, way in enumerate(tendon.way):
            winds = way.helix is not None and way.helix.turns != 0.0
            if winds or any(_leaves(arm) for arm in _arms(way, lines)):
                yield ("tendons", name, "way", str(i)), "leaves x-y"


def _tubes(tubes: Mapping[str, Tube]) -> Iterator[Finding]:
    for name in tubes:
        yield ("tubes", name), "turns about the tangent"


def _arms(way: Way, lines: Mapping[str, CenterLine]) -> Iterator[Triple | Array]:
    """Points of the ground, or arms along the way, in the fixed axes."""
    if way.ground is not None:
        yield way.ground
    elif way.node is not None:
        yield np.array([*map(float, way.offset or ()), 0.0, 0.0, 0.0])[:3]  # type: ignore[arg-type]
    elif way.member is not None:
        x = np.linspace(*way.ends, 9) if not way.holes else np.array(way.holes)
        frames, across = matrix(lines[way.member].quaternions(x)), values_of(offsets(way, x, x)[0])
        yield from np.einsum("nij,nj->ni", frames[:, :, 1:], across)


def _leaves(vector: Triple | Array) -> bool:
    return abs(vector[2]) > tolerances.DECIMAL * max(abs(vector[0]), abs(vector[1]))


def _turns_out(vector: Triple) -> bool:
    return max(abs(vector[0]), abs(vector[1])) > tolerances.DECIMAL * abs(vector[2])
