"""Symbols of supports, joints, springs, tendons, motions, loads and reactions, put to a sketch.

What comes first has the free choice of place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.actuation import Actuation, Magnet, MagneticField
from ..description.contacts import Contact
from ..description.loads import Load, Motion
from ..description.rings import Ring
from ..description.sections import evaluate
from ..description.springs import Spring
from ..description.structure import SLIDING, Member, Node, unit
from ..description.supports import turned_about
from ..description.tendons import Hole, Stretch, Tendon, tangent
from ..description.tubes import Tube
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from .limits import across, sketch_obstacle, sketch_slots, sketch_stops, turned_party
from .sketch import (
    FIELD,
    LOAD,
    MAGNET,
    MOTION,
    NATURAL,
    REACTION,
    TENDON,
    Ink,
    Sketch,
    broken,
    dense,
    flat_unit,
    left_of,
    norm,
    tangents_of,
)

__all__ = ["STANDING", "sketch_all", "sketch_carried", "sketch_loads", "sketch_supports"]

ARROW = 0.12
"""Length of the longest arrow over the size of the picture; sizes below are shares of it, too."""
SYMBOL = 0.03
SPRING = "#5A5A5A"
RING = "#2F6F8F"
TUBE = "#B4BAC3"
SPIRAL = 0.026
"""Outer radius of the spiral of a rotational spring."""
SHORT = 0.03
"""Springs shorter than this are not seen."""
MAGNETS, MAGNET_ARROW = 3, 0.08
"""Number of arrows along a magnetised member, and their length."""
SIDES = ((0, -1), (0, 1), (-1, 0), (1, 0))
"""Where the ground is put, the first that is free: below, above, left, right."""
TURNS = {LOAD: 0.05, REACTION: 0.063, MOTION: 0.076}
"""Radii of circular arrows."""


STANDING = ("support-", "contact-")
"""Marks that do not turn with the structure."""


def sketch_all(sketch: Sketch) -> None:
    """Sketch everything but the centre lines; what comes first has the free choice of place."""
    sketch_supports(sketch)
    sketch_loads(sketch)


def sketch_loads(sketch: Sketch) -> None:
    """Add symbols of loads, motions, fields, magnets and reactions to a sketch."""
    _sketch_tables(sketch, LOADS)


def sketch_carried(sketch: Sketch, first: Sketch) -> None:
    """Add what :func:`sketch_supports` would: supports and standing obstacles as in the sketch of the first state, only
    carried along, so that they keep their sides; all else as it is now.
    """
    nodes = {f"support-{name}": sketch.at(name) - first.at(name) for name in sketch.scene.nodes}
    moved = {f"contact-{name}" for name, contact in sketch.scene.contacts.items() if contact.node}
    standing = [mark for mark in first.marks if mark.name.startswith(STANDING) and mark.name not in moved]
    sketch.marks += [replace(mark, points=mark.points + nodes.get(mark.name, 0.0)) for mark in standing]
    _sketch_tables(sketch, CARRIED)


def sketch_supports(sketch: Sketch) -> None:
    """Add symbols of obstacles, supports, joints, springs and tendons to a sketch."""
    _sketch_tables(sketch, SUPPORTS)


def _sketch_tables(sketch: Sketch, glyphs: Iterable[tuple[str, Glyph]]) -> None:
    for table, glyph in glyphs:
        for name, record in getattr(sketch.scene, table).items():
            glyph(sketch, name, record)


def _circle(radius: float, centre: tuple[float, float]) -> Array:
    angle = np.linspace(0.0, 2.0 * math.pi, 33)
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1)


# Supports and joints


@dataclass(frozen=True, eq=False)
class _Symbol:
    """Where a symbol is drawn, by which name: its own axes go along the ground and, from the place, towards it."""

    sketch: Sketch
    name: str
    place: Array
    down: Array

    def put(self, shape: Any) -> Array:
        """Points (n, 2) of the symbol, in units of the size of symbols, in fixed axes (n, 3)."""
        flat = np.asarray(shape, float) @ np.stack([left_of(self.down), self.down])
        return self.place + self.sketch.view.raised(SYMBOL * self.sketch.size * flat)

    def line(self, shape: Any) -> None:
        """Draw a polyline of the symbol."""
        self.sketch.line(self.put(shape), self.name)

    def area(self, shape: Any) -> None:
        """Draw a polygon of the symbol."""
        self.sketch.area(self.put(shape), self.name)

    def ground(self, depth: float, half: float = 1.25, side: float = 1.0) -> None:
        """Draw a hatched line."""
        self.line([[-half, depth], [half, depth]])
        strokes = np.linspace(-half, half, 7)[1:]
        hatch = [np.array([[x, depth], [x - 0.4, depth + 0.4 * side]]) for x in strokes]
        self.sketch.line(self.put(broken(*hatch)), self.name, width=0.8)

    def triangle(self, half: float, height: float) -> None:
        """Draw a triangle with a pin in the node."""
        self.area([[0, 0], [-half, height], [half, height]])
        self.sketch.dot(self.place, self.name)


def _symbol(sketch: Sketch, node: str, down: Array) -> _Symbol:
    """Where the symbol of a node's support is drawn."""
    return _Symbol(sketch, f"support-{node}", sketch.at(node), down)


def _sketch_contact(sketch: Sketch, name: str, contact: Contact) -> None:
    if not contact.between_members:
        sketch_obstacle(sketch, name, sketch.step.fields.obstacle(name))


def _sketch_moving_contact(sketch: Sketch, name: str, contact: Contact) -> None:
    if contact.node:
        _sketch_contact(sketch, name, contact)


def _sketch_joint(sketch: Sketch, name: str, node: Node) -> None:
    if node.joint != "rigid":
        sketch.dot(sketch.at(name), f"joint-{name}")
    if node.joint == "universal":
        first, *others = (member for member, found in sketch.scene.members.items() if name in found.nodes)
        _sketch_cross(sketch, f"joint-{name}", sketch.at(name), name, (first, others[0]))


def _sketch_support(sketch: Sketch, name: str, node: Node) -> None:
    if node.support == "free":
        return
    symbol = _symbol(sketch, name, _below(sketch, name, SIDES))
    if node.support == "clamped":
        _sketch_clamp(sketch, name)
    elif node.support == "hinge":
        if sketch.view.angles is not None:
            _sketch_rod(sketch, name, node.axis, 1.8)
        symbol.triangle(0.75, 1.2)
        symbol.ground(1.2)
    elif node.support == "ball":
        symbol.area(_circle(0.5, (0.0, 0.5)))
        symbol.ground(1.0)
    elif node.support == "universal":
        for axis in filter(None, (node.axis, node.axis2)):
            _sketch_rod(sketch, name, axis, 1.4)
        symbol.area(_circle(0.3, (0.0, 0.0)))
        symbol.line([[0.0, 0.3], [0.0, 1.2]])
        symbol.ground(1.2)
    elif node.slides and node.direction is not None:
        _sketch_slider(sketch, name, node, unit(node.direction))


def _below(sketch: Sketch, node: str, directions: Sequence[Any]) -> Array:
    """The first of the directions (2,) that no member takes, or the freest."""
    leaving = sketch.view.flat(sketch.leaving(node))
    blocked = [max(0.72, float((leaving @ np.array(direction)).max(initial=0.0))) for direction in directions]
    return np.array(directions[int(np.argmin(blocked))], float)


def _sketch_clamp(sketch: Sketch, name: str) -> None:
    """A hatched wall across the members; in space a plate."""
    into = -sketch.leaving(name).sum(axis=0)
    if sketch.view.angles is None:
        _symbol(sketch, name, flat_unit(sketch.view.flat(into), (0.0, -1.0))).ground(0.0, half=1.4)
        return
    normal = into / norm(into) if norm(into) > 0.05 else np.array([0.0, 0.0, 1.0])
    one, two = across(normal, np.array([0.0, 0.0, 1.0]))
    corners = np.array([one + two, one - two, -one - two, two - one])
    sketch.area(sketch.at(name) + SYMBOL * sketch.size * corners, f"support-{name}", "#BBBBBBB0", 2.0)


def _sketch_rod(sketch: Sketch, name: str, direction: Iterable[float], half: float) -> None:
    """A line through a node: the axis of a hinge or the guide of a slider in space."""
    along = half * SYMBOL * sketch.size * np.array(unit(direction))
    sketch.line(sketch.at(name) + np.array([-along, along]), f"support-{name}", width=1.6, level=4.0)


def _sketch_slider(sketch: Sketch, name: str, node: Node, direction: tuple[float, float, float]) -> None:
    along = flat_unit(sketch.view.flat(direction), (1.0, 0.0))
    normal = left_of(along) * (1.0 if along[0] < 0.0 or (along[0] == 0.0 and along[1] < 0.0) else -1.0)
    symbol = _symbol(sketch, name, _below(sketch, name, [normal, -normal]))
    if sketch.view.angles is not None:
        _sketch_rod(sketch, name, direction, 3.0)
        symbol.area(
            [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] if node.rotation == "fixed" else _circle(0.5, (0, 0))
        )
    elif node.rotation == "fixed":
        symbol.ground(0.6, half=1.6)
        symbol.ground(-0.6, half=1.6, side=-1.0)
    else:
        symbol.triangle(0.65, 1.0)
        for x in (-0.4, 0.4):
            symbol.area(_circle(0.2, (x, 1.2)))
        symbol.ground(1.4)


def _sketch_release(sketch: Sketch, name: str, member: Member) -> None:
    """A small circle in the member, just beside each node to which it is not rigidly joined."""
    line = sketch.course.last[sketch.course.members.index(name)]
    for end, points in zip((0, 1), (line, line[::-1]), strict=True):
        if member.release[-end] not in ("rigid", *SLIDING):
            beside = np.linalg.norm(points - points[0], axis=1) > 0.02 * sketch.size
            place = points[int(np.argmax(beside))]
            sketch.dot(place, f"joint-{name}")
            if member.release[-end] == "universal":
                node = member.nodes[-end]
                _sketch_cross(sketch, f"joint-{name}", place, node, (node, name))


def _sketch_cross(sketch: Sketch, name: str, place: Array, node: str, sides: tuple[str, str]) -> None:
    """The two axes of a universal joint, each as its side carries it, over the circle of the joint."""
    found = sketch.scene.nodes[node]
    for side, axis in zip(sides, (found.axis, found.axis2), strict=True):
        assert axis is not None
        along = SYMBOL * sketch.size * quaternion.rotate(turned_party(sketch, side, node), np.array(unit(axis)))
        sketch.line(place + np.array([-along, along]), name, width=1.2, level=8.5)


# Springs


def _sketch_spring(sketch: Sketch, name: str, spring: Spring) -> None:
    (_sketch_spiral if spring.type == "rotational" else _sketch_zigzag)(sketch, name, spring)
    sketch_stops(sketch, name, spring)


def _sketch_spiral(sketch: Sketch, name: str, spring: Spring) -> None:
    """A spiral about the axis of a rotational spring, as its first party carries it."""
    carrier = (spring.between or ("ground",))[0]
    axis = quaternion.rotate(turned_party(sketch, carrier, spring.node), np.array(unit(sketch.scene.spring_axis(name))))
    one, two = across(axis, sketch.direction(spring.node))
    angle = np.linspace(0.5 * math.pi, 5.0 * math.pi, 121)[:, None]
    radius = SPIRAL * sketch.size * angle / angle[-1]
    points = sketch.at(spring.node) + radius * (np.cos(angle) * one + np.sin(angle) * two)
    sketch.line(points, f"spring-{name}", colour=SPRING, width=0.9, level=4.5)


def _sketch_zigzag(sketch: Sketch, name: str, spring: Spring) -> None:
    """A zigzag between the ends of a translational spring, the ground hatched.

    A spring to the ground without a visible length, and one that acts along a direction only, is drawn as a short
    one that the ground holds there.
    """
    end = sketch.at(spring.node)
    start = sketch.at(spring.to) if spring.to is not None else _anchor(sketch, spring, end)
    apart = start - end
    if norm(apart) < SHORT * sketch.size:
        return
    along = apart / norm(apart)
    aside = sketch.view.raised(left_of(flat_unit(sketch.view.flat(along), (1.0, 0.0))))
    teeth = int(np.clip(round(1.2 * norm(apart) / (SYMBOL * sketch.size)), 5, 60))
    share = np.array([0.0, 0.15, *(0.15 + 0.7 * (np.arange(teeth) + 0.5) / teeth), 0.85, 1.0])
    side = np.array([0.0, 0.0, *(1.0 - 2.0 * (np.arange(teeth) % 2)), 0.0, 0.0])
    points = end + share[:, None] * apart + 0.5 * SYMBOL * sketch.size * side[:, None] * aside
    sketch.line(points, f"spring-{name}", colour=SPRING, width=0.9, level=4.5)
    if spring.to is None:
        down = flat_unit(sketch.view.flat(along), (0.0, -1.0))
        _Symbol(sketch, f"spring-{name}", start, down).ground(0.0, half=0.8)


def _anchor(sketch: Sketch, spring: Spring, end: Array) -> Array:
    """Where a spring is seen to be held by the ground, (3,)."""
    length = 3.5 * SYMBOL * sketch.size
    if spring.direction is not None:
        along = np.array(unit(spring.direction))
        sides = [-along, along]
        flat = [flat_unit(sketch.view.flat(side), (0.0, -1.0)) for side in sides]
        chosen = _below(sketch, spring.node, flat)
        side = next(side for side, seen in zip(sides, flat, strict=True) if np.array_equal(seen, chosen))
        return np.asarray(end + length * side)
    place = np.array(spring.anchor or sketch.scene.nodes[spring.node].position) / sketch.course.unit
    if norm(place - end) >= SHORT * sketch.size:
        return place
    return np.asarray(end + length * sketch.view.raised(_below(sketch, spring.node, SIDES)))


# Tendons


def _sketch_tendon(sketch: Sketch, name: str, tendon: Tendon) -> None:
    """A line along the way, and what carries each hole; thin where the tendon is slack."""
    width = 0.7 if sketch.step.tendon(name).get("slack") else 1.4
    for piece in sketch.scene.tendon_pieces[name]:
        if isinstance(piece, Stretch):
            line = sketch.scene.center_lines[piece.member]
            x = np.linspace(piece.start, piece.end, 97)
            arms = tangent(piece.way, line, x, x)[1] / sketch.course.unit
            turned = quaternion.rotate(sketch.step.along(piece.member, x)["quaternion"], arms)
            sketch.line(sketch.along(piece.member, x) + turned, f"tendon-{name}", colour=TENDON, width=width, level=6.5)
            continue
        arms = np.array([_arm(sketch, hole) for hole in piece])
        sketch.line(arms[:, 1], f"tendon-{name}", colour=TENDON, width=width, level=6.5)
        for arm in arms:
            if norm(arm[1] - arm[0]) > 0.0:
                sketch.line(arm, f"hole-{name}", colour=SPRING, width=0.7, level=4.5)


# Tubes


def _sketch_tube(sketch: Sketch, name: str, tube: Tube) -> None:
    """A wide band below its members, the wider the shorter it is, so that each is seen."""
    # Where tubes are pushed out each step has its own scene.
    scene = sketch.step.model.scene
    reach = scene.tubes[name].start + tube.length
    longer = sum(other.start + other.length > reach for other in scene.tubes.values())
    for run in scene.tube_runs[name]:
        line = sketch.along(run.member, np.linspace(run.start, run.end, 97))
        sketch.line(line, f"tube-{name}", colour=TUBE, width=9.0 + 3.0 * longer, level=1.5 - 0.1 * longer)


# Rings


def _sketch_ring(sketch: Sketch, name: str, ring: Ring) -> None:
    """A circle around the member where the ring is."""
    angle = np.linspace(0.0, 2.0 * math.pi, 49)[:, None]
    radius = 0.4 * SYMBOL * sketch.size
    around = radius * sketch.view.raised(np.hstack([np.cos(angle), np.sin(angle)]))
    sketch.line(sketch.at(ring.node) + around, f"ring-{name}", colour=RING, width=1.4, level=8.7)


def _arm(sketch: Sketch, hole: Hole) -> Array:
    """What a hole is fixed to, and where it is in the picture, (2, 3)."""
    x, turned = np.array([hole.at]), None
    if hole.member is not None:
        turned, base = sketch.step.along(hole.member, x)["quaternion"][0], sketch.along(hole.member, x)[0]
    elif hole.node is not None:
        turned, base = sketch.step.quaternion(hole.node), sketch.at(hole.node)
    else:
        base = hole.position / sketch.course.unit
    arm = hole.arm if turned is None else quaternion.rotate(turned, hole.arm)
    return np.asarray(base + np.outer([0.0, 1.0], arm / sketch.course.unit))


# Motions, loads and reactions


def _sketch_motion(sketch: Sketch, name: str, motion: Motion) -> None:
    factor, node = sketch.factor(motion.history), sketch.scene.nodes[motion.node]
    ink = Ink(f"motion-{name}", MOTION, 1.4, dotted=True)
    if motion.displacement is not None and motion.between is not None:
        # How far one side slides along the other, not where both go; what is given across the line does nothing.
        assert node.direction is not None
        along = np.array(unit(node.direction))
        travel = factor * float(along @ np.array(motion.displacement))
        sketch.write_value(travel, "m", sketch.at(motion.node), np.array([0.0, 1.0]), ink)
    elif motion.displacement is not None:
        # As given: a guide that is moved leaves its node to slide somewhere else.
        shift = factor * np.array(motion.displacement) / sketch.course.unit
        way, length = np.array(node.position) / sketch.course.unit + np.outer([0.0, 1.0], shift), norm(shift)
        if length > 0.02 * sketch.size:
            sketch.arrow(way, ink)
        if length > 0.0:
            away = flat_unit(left_of(sketch.view.flat(shift) / length), (0.0, 1.0))
            sketch.write_value(length * sketch.course.unit, "m", way.mean(axis=0), away, ink)
    if motion.rotation is not None:
        turn = motion.rotation
        about = np.array(unit(turned_about(motion, node, sketch.scene.members)))
        vector = factor * (turn * about if isinstance(turn, float) else np.array(turn))
        ink = Ink(f"motion-{name}", MOTION, 1.2, dotted=True)
        _sketch_turn(sketch, sketch.at(motion.node), sketch.direction(motion.node), vector, "rad", ink)


def _sketch_load(sketch: Sketch, name: str, load: Load) -> None:
    value = sketch.factor(load.history) * np.array(load.vector)
    if not value.any():
        return
    if load.type == "distributed":
        return _sketch_distributed(sketch, name, load, value)
    ink = Ink(f"load-{name}", LOAD, 1.8)
    if load.node is not None:
        point, along, turned = sketch.at(load.node), sketch.direction(load.node), sketch.step.quaternion(load.node)
    else:
        assert load.member is not None
        x = np.array([load.at])
        point, along = sketch.along(load.member, x)[0], tangents_of(sketch.step, load.member, x)[0]
        turned = sketch.step.along(load.member, x)["quaternion"][0]
    if load.frame == "follower" and turned is not None:
        value = quaternion.rotate(turned, value)
    if load.type == "moment":
        _sketch_turn(sketch, point, along, value, "N m", ink)
    else:
        _sketch_force(sketch, point, value, ink)


def _sketch_reaction(sketch: Sketch, name: str, node: Node) -> None:
    if node.support == "free":
        return
    (force, moment), largest = sketch.step.reaction(name), sketch.largest_force
    point, arm = sketch.at(name), sketch.step.model.scales.length
    moments = [largest * arm, norm(moment), sketch.course.largest_moment]
    ink = Ink(f"reaction-{name}", REACTION, 1.1)
    rounding = 1e-11 * sketch.step.model.scales.force
    if norm(force) > max(tolerances.NEGLIGIBLE * max(largest, max(moments) / arm), rounding):
        _sketch_force(sketch, point, force, ink, pushing=True)
    if norm(moment) > max(tolerances.NEGLIGIBLE * max(moments), rounding * arm):
        _sketch_turn(sketch, point, sketch.direction(name), moment, "N m", ink)


def _sketch_pushes(sketch: Sketch, name: str, contact: Contact) -> None:
    """What an obstacle pushes with."""
    for number, (member, at, force) in enumerate(sketch.step.pushes(name)):
        if norm(force) > tolerances.NEGLIGIBLE * sketch.largest_force:
            point = sketch.along(member, np.array([at]))[0]
            _sketch_force(sketch, point, force, Ink(f"push-{name}", REACTION, 1.1), number, pushing=True)


def _sketch_force(
    sketch: Sketch, point: Array, value: Array, ink: Ink, number: int = 0, *, pushing: bool = False
) -> None:
    """An arrow that starts at the point or, ``pushing``, ends there; the other way round where that hides less, or
    where the one of this name and number did.
    """
    direction = value / norm(value)
    length = ARROW * max(0.45, norm(value) / sketch.largest_force) * sketch.size
    pulled = point + np.outer([0.012 * sketch.size, length], direction)
    pushed = pulled - (length + 0.012 * sketch.size) * direction
    ways = [(pushed, 0), (pulled, 1)] if pushing else [(pulled, 1), (pushed, 0)]
    if (ink.name, number) not in sketch.sides:
        hidden = [_hidden(sketch, way, point) for way, _ in ways]
        sketch.sides[ink.name, number] = hidden.index(min(hidden))
    points, free = ways[sketch.sides[ink.name, number]]
    sketch.arrow(points, ink)
    away = flat_unit(sketch.view.flat(points[free] - point) / length, (0.0, 1.0))
    sketch.write_value(norm(value), "N", points[free], away, ink)


def _hidden(sketch: Sketch, points: Array, point: Array) -> int:
    """How much of an arrow (2, 3) is near what is sketched, besides what is at its point."""
    flat, here, crowd = sketch.view.flat(points), sketch.view.flat(point), sketch.crowd
    crowd = crowd[np.linalg.norm(crowd - here, axis=1) > 0.03 * sketch.size]
    path = dense(flat, 0.005 * sketch.size)
    apart = np.hypot(*(crowd[None, :, :] - path[:, None, :]).transpose(2, 0, 1))
    return int((apart.min(axis=1, initial=np.inf) < 0.015 * sketch.size).sum())


def _sketch_turn(sketch: Sketch, point: Array, along: Array, vector: Array, letters: str, ink: Ink) -> None:
    """A circular arrow about a vector, open towards the member, whose tangent is ``along``."""
    size = norm(vector)
    if size == 0.0:
        return
    radius = TURNS[ink.colour]
    one, two = across(vector / size, along)
    angle = np.radians(np.linspace(50.0, 310.0, 60))[:, None]
    sketch.arrow(point + radius * sketch.size * (np.cos(angle) * one + np.sin(angle) * two), ink)
    away = flat_unit(-sketch.view.flat(one), (0.0, 1.0))
    sketch.write_value(size, letters, point, away, ink, gap=radius)


def _sketch_distributed(sketch: Sketch, name: str, load: Load, value: Array) -> None:
    """Small arrows onto the member with a line over their ends."""
    assert load.member is not None
    x = np.linspace(*load.part, 49)
    length = sketch.scene.center_lines[load.member].length
    profile = np.ones(len(x)) if load.profile is None else evaluate(load.profile, x, length)
    peak = float(np.abs(profile).max())
    if peak == 0.0:
        return
    places = sketch.along(load.member, x)
    values = np.broadcast_to(value, places.shape)
    if load.frame == "section":
        values = quaternion.rotate(sketch.step.model.scene.center_lines[load.member].quaternions(x), values)
    if load.frame != "fixed":
        values = quaternion.rotate(sketch.step.along(load.member, x)["quaternion"], values)
    ends = places - 0.6 * ARROW * sketch.size * (profile / peak)[:, None] * values / norm(value)
    ink = Ink(f"load-{name}", LOAD, 1.0)
    sketch.line(ends, ink.name, colour=LOAD, width=0.8)
    for i in range(0, len(x), 6):
        if abs(profile[i]) > 0.2 * peak:
            sketch.arrow(np.array([ends[i], places[i]]), ink)
    top = _label_place(np.abs(profile))
    away = flat_unit(sketch.view.flat(ends[top] - places[top]) / (0.6 * ARROW * sketch.size), (0.0, 1.0))
    sketch.write_value(peak * norm(value), "N/m", ends[top], away, ink)


def _sketch_actuation(sketch: Sketch, name: str, actuation: Actuation) -> None:
    """A line on the side to which natural curvature bends a member, and an arrow about its axis where it is twisted."""
    x = np.linspace(*actuation.part, 33)
    natural = sketch.factor(actuation.history) * actuation.along(x)
    peak = int(np.linalg.norm(natural, axis=1).argmax())
    if not natural[peak].any():
        return
    found, places = sketch.step.along(actuation.member, x), sketch.along(actuation.member, x)
    frames = quaternion.multiply(found["quaternion"], sketch.scene.center_lines[actuation.member].quaternions(x))
    tangents, bend = quaternion.rotate(frames, np.array([1.0, 0.0, 0.0])), quaternion.rotate(frames, natural)
    inwards = np.cross(bend, tangents)
    most = float(np.linalg.norm(inwards, axis=1).max())
    colour = NATURAL[int(sketch.view.angles is None and bend[peak, 2] < 0.0)]
    ink = Ink(f"actuation-{name}", colour, 1.2)
    away = flat_unit(sketch.view.flat(tangents[peak]), (0.0, 1.0))
    if most > 0.0:
        line = places + 0.4 * SYMBOL * sketch.size * inwards / most
        sketch.line(line, ink.name, colour=colour, width=2.2, level=4.2)
        away = flat_unit(sketch.view.flat(inwards[peak]) / most, (0.0, 1.0))
    middle = len(x) // 2
    if abs(natural[middle, 0]) > tolerances.NEGLIGIBLE * most:
        one, two = across(math.copysign(1.0, natural[middle, 0]) * tangents[middle], tangents[middle])
        angle = np.radians(np.linspace(20.0, 320.0, 50))[:, None]
        radius = 0.8 * SYMBOL * sketch.size
        sketch.arrow(places[middle] + radius * (np.cos(angle) * one + np.sin(angle) * two), ink)
    sketch.label(f"{norm(natural[peak]):.3g} 1/m", places[peak], away, ink, gap=0.02)


def _magnet_at(sketch: Sketch, magnet: Magnet) -> tuple[Array, Array]:
    """Places (n, 3), drawn units, and directions (n, 3) of a magnet, of the length of its largest moment 1."""
    if magnet.node is not None:
        turned = sketch.step.quaternion(magnet.node)
        moments = np.array(magnet.vector) if turned is None else quaternion.rotate(turned, np.array(magnet.vector))
        return sketch.at(magnet.node)[None, :], moments[None, :] / norm(moments)
    member, (low, high) = str(magnet.member), magnet.part
    x = low + (high - low) * (np.arange(MAGNETS) + 0.5) / MAGNETS
    turned = sketch.step.along(member, x)["quaternion"]
    frames = quaternion.multiply(turned, sketch.scene.center_lines[member].quaternions(x))
    moments = quaternion.rotate(frames, magnet.along(x))
    return sketch.along(member, x), moments / np.linalg.norm(moments, axis=1).max()


def _sketch_magnet(sketch: Sketch, name: str, magnet: Magnet) -> None:
    """Arrows from south to north."""
    ink = Ink(f"magnet-{name}", MAGNET, 2.0)
    for place, moment in zip(*_magnet_at(sketch, magnet), strict=True):
        half = 0.5 * MAGNET_ARROW * sketch.size * moment
        if norm(moment) > SHORT:
            sketch.arrow(place + np.array([-half, half]), ink)


def _sketch_field(sketch: Sketch, name: str, field: MagneticField) -> None:
    """Thin arrows of the field at the magnets, and its largest value there."""
    factor = sketch.factor(field.history)
    places = np.concatenate([_magnet_at(sketch, magnet)[0] for magnet in sketch.scene.magnets.values()])
    values = factor * field.of(places * sketch.course.unit)
    sizes = np.linalg.norm(values, axis=1)
    most = float(sizes.max())
    if most == 0.0:
        return
    ink = Ink(f"field-{name}", FIELD, 0.9)
    for place, value in zip(places, values, strict=True):
        if norm(value) > SHORT * most:
            sketch.arrow(place + np.outer([0.0, 0.7 * ARROW * sketch.size / most], value), ink)
    top = int(sizes.argmax())
    end = places[top] + 0.7 * ARROW * sketch.size * values[top] / most
    sketch.write_value(most, "T", end, flat_unit(sketch.view.flat(values[top]) / most, (0.0, 1.0)), ink)


def _label_place(profile: Array) -> int:
    """Index of the largest value; the middle one of several."""
    largest = np.flatnonzero(profile >= profile.max() * (1.0 - 1e-9))
    return int(largest[len(largest) // 2])


Glyph = Callable[[Sketch, str, Any], None]
"""Sketches what belongs to a record: (sketch, name, record)."""

MOVING: tuple[tuple[str, Glyph], ...] = (
    ("nodes", _sketch_joint),
    ("members", _sketch_release),
    ("members", sketch_slots),
    ("springs", _sketch_spring),
    ("tendons", _sketch_tendon),
    ("tubes", _sketch_tube),
    ("rings", _sketch_ring),
)
"""Glyphs of what moves with a structure."""

SUPPORTS: tuple[tuple[str, Glyph], ...] = (("contacts", _sketch_contact), ("nodes", _sketch_support), *MOVING)
"""Glyphs of what holds a structure, by the tables of the scene: all that a new kind of record needs for a picture."""

CARRIED: tuple[tuple[str, Glyph], ...] = (("contacts", _sketch_moving_contact), *MOVING)
"""Those of which another state than the first needs new marks."""

LOADS: tuple[tuple[str, Glyph], ...] = (
    ("motions", _sketch_motion),
    ("loads", _sketch_load),
    ("actuations", _sketch_actuation),
    ("fields", _sketch_field),
    ("magnets", _sketch_magnet),
    ("nodes", _sketch_reaction),
    ("contacts", _sketch_pushes),
)
"""Glyphs of what acts on it."""
