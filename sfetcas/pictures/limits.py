"""What limits motion, put to a sketch: obstacles, stops of springs, and slots in which member ends slide.

Strokes stand on the side where nothing can go.
"""

from __future__ import annotations

import math

import numpy as np

from ..description.obstacles import Obstacle
from ..description.springs import Spring
from ..description.structure import SLIDING, Member, unit
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from .sketch import BEHIND, SUPPORT, Sketch, broken, flat_unit, left_of, norm

__all__ = ["across", "sketch_obstacle", "sketch_slots", "sketch_stops", "turned_party"]

REACH = 0.75
"""Obstacles are drawn so far from the middle of the structure, over the size of the picture."""
MARGIN = 0.08
"""Planes and cylinders are drawn so far beyond the structure; the other constants are meant like this."""
STROKE = 0.018
SPACING = 0.03
"""Length and distance of strokes."""
EDGE = 0.03
"""Height of the wedge that stands for a point."""
STOP = (0.05, 0.1)
"""Radii between which the stop of a rotational spring is drawn."""
BAR = 0.028
"""Half the width of the stop of a spring along a direction."""
SLOT = 0.012
"""Half the width of a slot."""
WIRE = "#A0A0A0"
GLASS = "#8A9BB030"


def across(normal: Array, near: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that form a right-handed frame with a normal, the first as near as can be to ``near``."""
    for first in (near, *np.eye(3)):
        found = first - (first @ normal) * normal
        if norm(found) > 0.05 * norm(first) > 0.0:
            one = found / norm(found)
            break
    return one, np.cross(normal, one)


def _strokes(sketch: Sketch, line: Array, into: Array, name: str, level: float = 5.0) -> None:
    """Slanting strokes from a polyline (n, 3) into the solid, whose direction is (3,) or (n, 3)."""
    steps = np.diff(line, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    total, size = float(lengths.sum()), sketch.size
    count = max(3, int(total / (SPACING * size)))
    at = (np.arange(count) + 0.5) / count * total
    reached = np.concatenate([[0.0], np.cumsum(lengths)])
    piece = np.clip(np.searchsorted(reached, at) - 1, 0, len(steps) - 1)
    along = steps[piece] / np.maximum(lengths[piece, None], np.finfo(float).tiny)
    feet = line[piece] + (at - reached[piece])[:, None] * along
    heads = feet + STROKE * size * math.sqrt(0.5) * (np.broadcast_to(into, line.shape)[piece] - along)
    strokes = broken(*np.stack([feet, heads], axis=1))
    sketch.line(strokes, name, width=0.7, level=level)


# Obstacles


def sketch_obstacle(sketch: Sketch, name: str, stop: Obstacle) -> None:
    """An obstacle as far as it is near the structure."""
    label, plane = f"contact-{name}", sketch.view.angles is None
    if stop.kind == "flat":
        (_sketch_wall if plane else _sketch_pane)(sketch, label, stop)
    elif stop.side is not None:
        (_sketch_wedge if plane else _sketch_edge)(sketch, label, stop)
    elif plane:
        _sketch_round(sketch, label, stop)
    else:
        rank = np.linalg.matrix_rank(stop.across)
        lines = (_cylinder if rank == 2 else _sphere)(sketch, stop)
        if lines:
            sketch.line(broken(*lines), label, colour=WIRE, width=0.7, level=BEHIND)


def _middle(sketch: Sketch) -> Array:
    points = sketch.course.everything
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _foot(sketch: Sketch, stop: Obstacle) -> Array | None:
    """Where the middle of the structure stands over a plane; None where the plane is far from all of it."""
    gaps = (sketch.course.everything - stop.place / sketch.course.unit) @ stop.normal
    middle = _middle(sketch)
    gap = (middle - stop.place / sketch.course.unit) @ stop.normal
    return None if np.abs(gaps).min() > REACH * sketch.size else np.asarray(middle - gap * stop.normal)


def _sketch_wall(sketch: Sketch, name: str, stop: Obstacle) -> None:
    foot = _foot(sketch, stop)
    if foot is not None:
        along = np.cross([0.0, 0.0, 1.0], stop.normal)
        reached = (sketch.course.everything - foot) @ along
        margin = MARGIN * sketch.size
        line = foot + np.array([[reached.min() - margin], [reached.max() + margin]]) * along
        sketch.line(line, name)
        _strokes(sketch, line, -stop.normal, name)


def _sketch_pane(sketch: Sketch, name: str, stop: Obstacle) -> None:
    """A translucent rectangle under the structure, with strokes at its rim."""
    foot = _foot(sketch, stop)
    if foot is None:
        return
    one, two = across(stop.normal, np.eye(3)[int(np.argmin(np.abs(stop.normal)))])
    spread = (sketch.course.everything - foot) @ np.stack([one, two], axis=1)
    low, high = spread.min(axis=0) - MARGIN * sketch.size, spread.max(axis=0) + MARGIN * sketch.size
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    points = foot + corners @ np.stack([one, two])
    sketch.area(points, name, GLASS, BEHIND)
    _strokes(sketch, np.vstack([points, points[:1]]), -stop.normal, name, BEHIND)


def _sketch_wedge(sketch: Sketch, name: str, stop: Obstacle) -> None:
    assert stop.side is not None
    down = -stop.side / norm(stop.side) * EDGE * sketch.size
    aside = 0.4 * np.array([-down[1], down[0], 0.0])
    tip = stop.place / sketch.course.unit
    sketch.area(np.array([tip, tip + down - aside, tip + down + aside]), name, SUPPORT)


def _sketch_edge(sketch: Sketch, name: str, stop: Obstacle) -> None:
    place = stop.place / sketch.course.unit
    middle = place + ((_middle(sketch) - place) @ stop.normal) * stop.normal
    line = middle + REACH * sketch.size * np.array([[-1.0], [1.0]]) * stop.normal
    sketch.line(line, name, width=2.0, level=BEHIND)
    assert stop.side is not None
    _strokes(sketch, line, -stop.side / norm(stop.side), name, BEHIND)


def _arc(sketch: Sketch, stop: Obstacle) -> tuple[Array, float]:
    """Where the structure is seen from a centre, (3,), and the angle to both sides within which it is near it.

    The angle is pi where all is near, and zero where nothing is.
    """
    out = (_middle(sketch) - stop.place / sketch.course.unit) @ stop.across
    apart, radius, reach = norm(out), stop.radius / sketch.course.unit, REACH * sketch.size
    if apart < 1e-9 * radius:
        return np.zeros(3), math.pi if radius <= reach else 0.0
    cosine = (apart * apart + radius * radius - reach * reach) / (2.0 * apart * radius)
    return out / apart, math.acos(min(1.0, max(-1.0, cosine)))


def _sketch_round(sketch: Sketch, name: str, stop: Obstacle) -> None:
    towards, half = _arc(sketch, stop)
    if half == 0.0:
        return
    angle = math.atan2(towards[1], towards[0]) + np.linspace(-half, half, 361)
    out = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    line = (stop.place + stop.radius * out) / sketch.course.unit
    sketch.line(line, name)
    _strokes(sketch, line, -stop.sign * out, name)


def _turns(half: float, count: int) -> Array:
    """Angles of wires: evenly all round, or from one end of an arc to the other."""
    return np.linspace(-half, half, count, endpoint=half < math.pi)


def _cylinder(sketch: Sketch, stop: Obstacle) -> list[Array]:
    """Wires along a cylinder, and arcs round it."""
    towards, half = _arc(sketch, stop)
    if half == 0.0:
        return []
    axis = np.linalg.svd(stop.across)[2][2]
    one, two = across(axis, towards)
    place, radius = stop.place / sketch.course.unit, stop.radius / sketch.course.unit
    travel = (sketch.course.everything - place) @ axis
    low, high = travel.min() - MARGIN * sketch.size, travel.max() + MARGIN * sketch.size

    def wire(angle: Array, along: Array) -> Array:
        turn = angle[:, None]
        return np.asarray(place + radius * (np.cos(turn) * one + np.sin(turn) * two) + along[:, None] * axis)

    round_about = np.linspace(-half, half, 91)
    arcs = [wire(round_about, np.full(91, at)) for at in np.linspace(low, high, 5)]
    lines = [wire(np.full(2, angle), np.array([low, high])) for angle in _turns(half, 16)]
    return arcs + lines


def _sphere(sketch: Sketch, stop: Obstacle) -> list[Array]:
    """Circles of latitude and longitude; where only a part of a sphere is near, about the place next to it."""
    towards, half = _arc(sketch, stop)
    if half == 0.0:
        return []
    pole = towards if half < math.pi else np.array([0.0, 0.0, 1.0])
    one, two = across(pole, np.array([1.0, 0.0, 0.0]))
    place, radius = stop.place / sketch.course.unit, stop.radius / sketch.course.unit

    def wire(polar: Array, angle: Array) -> Array:
        sine, turn = np.sin(polar)[:, None], angle[:, None]
        round_about = np.cos(turn) * one + np.sin(turn) * two
        return np.asarray(place + radius * (np.cos(polar)[:, None] * pole + sine * round_about))

    whole, polar = np.linspace(0.0, 2.0 * math.pi, 91), np.linspace(0.0, half, 46)
    latitudes = [wire(np.full(91, at), whole) for at in np.linspace(0.0, half, 8)[1:]]
    return latitudes + [wire(polar, np.full(46, turn)) for turn in _turns(math.pi, 12)]


# Stops and slots


def _end(member: Member, node: str) -> Array:
    """Fraction (1,) at which the fields of a member are those at a node."""
    return np.array([member.nodes.index(node) / (len(member.nodes) - 1)])


def turned_party(sketch: Sketch, party: str, node: str) -> Array:
    """Rotation (4,), a unit quaternion since the undeformed scene, of a party of a rotational spring."""
    if party in sketch.scene.members:
        return np.asarray(sketch.step.along(party, _end(sketch.scene.members[party], node))["quaternion"][0])
    turned = None if party == "ground" else sketch.step.quaternion(party)
    return np.array([1.0, 0.0, 0.0, 0.0]) if turned is None else turned


def sketch_stops(sketch: Sketch, name: str, spring: Spring) -> None:
    """Hatched bars where what a spring is between can go no further."""
    if spring.stop is not None:
        (_sketch_stop_angles if spring.type == "rotational" else _sketch_stop_travels)(sketch, name, spring)


def _sketch_stop_angles(sketch: Sketch, name: str, spring: Spring) -> None:
    """As the first party carries them, unless it moves and the second is the ground."""
    assert spring.stop is not None
    (first, second), (low, high) = spring.between or ("ground", spring.node), spring.stop
    if second == "ground":
        first, second, low, high = second, first, -high, -low
    carried, axis = turned_party(sketch, first, spring.node), np.array(unit(sketch.scene.spring_axis(name)))
    pointer = across(axis, _undeformed(sketch, second, spring.node))[0]
    for limit, sign in ((low, -1.0), (high, 1.0)):
        if abs(limit) < 2.0 * math.pi:
            turn = quaternion.from_rotation_vector(limit * axis)
            along = quaternion.rotate(carried, quaternion.rotate(turn, pointer))
            beyond = sign * np.cross(quaternion.rotate(carried, axis), along)
            _bar(sketch, name, sketch.at(spring.node) + sketch.size * np.outer(STOP, along), beyond)


def _undeformed(sketch: Sketch, party: str, node: str) -> Array:
    """Tangent (3,) in the undeformed scene of a member out of a node; for a node of the first member there."""
    scene = sketch.scene
    member = party if party in scene.members else next(m for m, found in scene.members.items() if node in found.nodes)
    first, last = scene.center_lines[member].tangents(np.array([0.0, 1.0]))
    return np.asarray(first if scene.members[member].nodes[0] == node else -last)


def _sketch_stop_travels(sketch: Sketch, name: str, spring: Spring) -> None:
    assert spring.stop is not None
    assert spring.direction is not None
    along, travel = np.array(unit(spring.direction)), sketch.step.spring(name).travel
    flat = sketch.view.raised(left_of(flat_unit(sketch.view.flat(along), (1.0, 0.0))))
    for limit, sign in zip(spring.stop, (-1.0, 1.0), strict=True):
        off = (limit - travel) / sketch.course.unit
        if abs(off) < REACH * sketch.size:
            bar = sketch.at(spring.node) + off * along + BAR * sketch.size * np.array([[-1.0], [1.0]]) * flat
            _bar(sketch, name, bar, sign * along)


def _bar(sketch: Sketch, name: str, points: Array, beyond: Array) -> None:
    sketch.line(points, f"stop-{name}", width=1.6)
    _strokes(sketch, points, beyond, f"stop-{name}")


def sketch_slots(sketch: Sketch, name: str, member: Member) -> None:
    """The slots or guides in which the ends of a member slide, with pins or blocks."""
    for node, release in zip(member.nodes, member.release, strict=True):
        if release in SLIDING:
            _sketch_slot(sketch, name, node, sketch.along(name, _end(member, node))[0], release == "slot")


def _sketch_slot(sketch: Sketch, member: str, node: str, end: Array, pin: bool) -> None:
    direction = sketch.scene.nodes[node].direction
    assert direction is not None
    along = quaternion.rotate(turned_party(sketch, node, node), np.array(unit(direction)))
    aside = sketch.view.raised(left_of(flat_unit(sketch.view.flat(along), (1.0, 0.0))))
    place, width, name = sketch.at(node), SLOT * sketch.size, f"joint-{member}"
    travel = float((end - place) @ along)
    low, high = min(0.0, travel) - 3.0 * width, max(0.0, travel) + 3.0 * width
    turn = np.linspace(0.5 * math.pi, 1.5 * math.pi, 13)[:, None]
    caps = [
        place + at * along + sign * width * (np.cos(turn) * along + np.sin(turn) * aside)
        for at, sign in ((low, 1.0), (high, -1.0))
    ]
    sketch.line(np.vstack([*caps, caps[0][:1]]), name, width=1.0, level=4.5)
    if pin:
        sketch.dot(end, name)
    else:
        corners = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
        sketch.area(end + width * corners @ np.stack([along, aside]), name)
