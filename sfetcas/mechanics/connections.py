"""The joints, springs and small members of a scene as groups of one kind each, dimensionless."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..description.obstacles import Obstacle
from ..description.scene import Scene
from ..description.structure import SLIDING
from ..description.supports import turned_about
from ..mathematics.arrays import Array, Index, normals, numbers, unit
from .beams import Scales
from .bodies import BodyData, body_of
from .contact_joints import Facing, OnPlane, OnRound, Sticking, directions_along
from .elements import Element
from .joints import (
    Body,
    DrivenSlide,
    DrivenTurn,
    Hinge,
    LineSpring,
    LineStop,
    Slide,
    Spring,
    TurnSpring,
    TurnStop,
    Universal,
)
from .mesh import Mesh, Spot
from .parts import Parts
from .rotations import Pin, Rotations, end_joints
from .segments import Segments
from .terms import GROUND, Group, One

__all__ = ["body_numbers", "connections_in", "connections_of", "freedoms", "row_of", "stopped_in"]


def row_of(table: str, name: str, side: str) -> str:
    """Name of the row of a unilateral constraint: a string, or one of the stops of a spring."""
    return f"springs.{name}, {side} stop" if table == "springs" else f"{table}.{name}"


def connections_in(parts: Parts) -> Iterator[One]:
    """Terms of joints, driven joints, springs, small members and active stops."""
    maker = _Maker(parts.scene, parts.segments, parts.rotations, parts.element.space, parts.scales)
    yield from maker.all()
    yield from maker.stops(parts.mesh)


def stopped_in(parts: Parts) -> Iterator[One]:
    """Terms of places that obstacles stop in a motion."""
    yield from _Stopper(parts.scene, parts.mesh, parts.segments, parts.rotations, parts.element, parts.scales).all()


def connections_of(groups: Sequence[Group], table: str, name: str) -> Iterator[tuple[int, int]]:
    """For each group with terms of the record ``name`` in ``table``: number of the group, number of the term in it."""
    for number, group in enumerate(groups):
        if group.kind.table == table and name in group.names:
            yield number, group.names.index(name)


@dataclass(frozen=True, eq=False)
class _Maker:
    scene: Scene
    segments: Segments
    rotations: Rotations
    space: bool
    scales: Scales

    @property
    def axes(self) -> int:
        return 3 if self.space else 2

    def all(self) -> Iterator[One]:
        """Every connection of the scene."""
        for pin in self.rotations.pins:
            yield from self._pin(pin)
        for name, member in self.scene.members.items():
            for i, (node, joint) in enumerate(end_joints(self.scene, member)):
                if joint in SLIDING:
                    yield self._slide(name, i, node)
        yield from self._motions()
        for name in self.scene.springs:
            yield self._spring(name)
        for name, member in self.scene.members.items():
            if member.type == "small":
                yield self._body(name)

    def _pin(self, pin: Pin) -> Iterator[One]:
        node = self.scene.nodes[pin.node]
        sides = (GROUND if pin.base is None else pin.base, pin.turn)
        name = f"{pin.joint} of {pin.name} at {pin.node}" if pin.name != pin.node else f"{pin.joint} at {pin.node}"
        if not self.space:
            return
        if pin.joint in ("hinge", "cylindrical"):
            axis = node.axis if pin.joint == "hinge" else node.direction
            yield One(Hinge(True), name, pin.node, normals(numbers(axis)).ravel(), sides, row=name)
        elif pin.joint == "universal":
            axes = unit([node.axis, node.axis2])
            yield One(Universal(True), name, pin.node, axes.ravel(), sides, row=name)

    def _slide(self, member: str, i: int, node: str) -> One:
        direction = numbers(self.scene.nodes[node].direction)[: self.axes]
        places = self.segments.place(node), self.segments.place(self.segments.ends[member, i])
        name = f"slide of {member} at {node}"
        return One(Slide(self.space), name, node, normals(direction).ravel(), (self._base(node),), places, name)

    def _base(self, node: str) -> int:
        """Rotation that carries the lines of a node."""
        number = self.rotations.node_turn[node]
        return GROUND if number is None else number

    def _end(self, member: str, node: str) -> int:
        i = self.scene.members[member].nodes.index(node)
        return self.rotations.ends[member][i]

    def _motions(self) -> Iterator[One]:
        for name, motion in self.scene.motions.items():
            if motion.between is None:
                continue
            node, row = self.scene.nodes[motion.node], f"motions.{name}"
            first, second = motion.between
            if motion.rotation is not None:
                axis = turned_about(motion, node, self.scene.members)
                sides = self._end(first, motion.node), self._end(second, motion.node)
                yield One(DrivenTurn(self.space), name, motion.node, unit(axis), sides, row=row)
            if motion.displacement is not None:
                i = self.scene.members[second].nodes.index(motion.node)
                places = self.segments.place(motion.node), self.segments.place(self.segments.ends[second, i])
                along = unit(node.direction)[: self.axes]
                yield One(DrivenSlide(self.space), name, motion.node, along, (self._base(motion.node),), places, row)

    def _spring(self, name: str) -> One:
        spring, scales = self.scene.springs[name], self.scales
        if spring.type == "rotational":
            crossed, sides, head = self._measured(name)
            data = numbers([*head, spring.stiffness / scales.moment, spring.rest, *self._unwrapped])
            return One(TurnSpring(self.space, crossed), name, spring.node, data, sides)
        other, places = spring.to, self._ends_of(name)
        stiffness = spring.stiffness * scales.length**2 / scales.moment
        if spring.direction is not None:
            data = numbers([*unit(spring.direction)[: self.axes], stiffness, spring.rest / scales.length])
            return One(LineSpring(self.space), name, spring.node, data, (), places)
        start = self.scene.nodes[spring.node].position
        anchor = self.scene.nodes[other].position if other is not None else spring.anchor or start
        gap = numbers(start) - numbers(anchor)
        length = np.linalg.norm(gap) if spring.length is None else spring.length
        data = numbers([*gap[: self.axes] / scales.length, stiffness, length / scales.length])
        return One(Spring(self.space), name, spring.node, data, (), places)

    def _ends_of(self, name: str) -> tuple[int, int]:
        """Places between which a translational spring acts."""
        spring = self.scene.springs[name]
        first = GROUND if spring.to is None else self.segments.place(spring.to)
        return first, self.segments.place(spring.node)

    def stops(self, mesh: Mesh) -> Iterator[One]:
        """Springs that stand at a stop."""
        for name, side in mesh.stops:
            if side in ("slack", "released", "pulled"):
                continue
            spring, row = self.scene.springs[name], row_of("springs", name, side)
            assert spring.stop is not None
            at = spring.stop[0 if side == "low" else 1]
            if spring.type == "rotational":
                crossed, sides, head = self._measured(name)
                data = numbers([*head, at, *self._unwrapped])
                stop = TurnStop(self.space, crossed)
                yield One(stop, f"{side} stop of {name}", spring.node, data, sides, row=row)
                continue
            data = numbers([*unit(spring.direction)[: self.axes], at / self.scales.length])
            yield One(LineStop(self.space), f"{side} stop of {name}", spring.node, data, (), self._ends_of(name), row)

    @property
    def _unwrapped(self) -> tuple[float, ...]:
        """Value near which an angle in space is counted, in the undeformed scene."""
        return (0.0,) if self.space else ()

    def _measured(self, name: str) -> tuple[bool, tuple[int, int], list[float]]:
        """Whether a rotational spring is at a universal joint, its sides, and the directions of its data.

        At a universal joint a spring about one of the two axes is put on the side that carries this axis.
        """
        spring, (first, second) = self.scene.springs[name], self.parties(name)
        axis, node = unit(self.scene.spring_axis(name)), self.scene.nodes[spring.node]
        for pin in self.rotations.pins:
            base = GROUND if pin.base is None else pin.base
            if not self.space or pin.joint != "universal" or {base, pin.turn} != {first, second}:
                continue
            one, two = unit(node.axis), unit(node.axis2)
            for carrier, other, along, across in ((base, pin.turn, one, two), (pin.turn, base, two, one)):
                if np.linalg.norm(np.cross(axis, along)) < tolerances.PARALLEL:
                    return True, (carrier, other), [*(axis if carrier == first else -axis), *across]
        return False, (first, second), [*axis]

    def parties(self, name: str) -> tuple[int, int]:
        """Rotations of the two parties of a rotational spring."""
        spring = self.scene.springs[name]
        found = []
        for party in spring.between or ("ground", spring.node):
            if party == "ground":
                found.append(GROUND)
            elif party == spring.node and party not in self.scene.members:
                found.append(self._base(party))
            else:
                found.append(self._end(party, spring.node))
        return found[0], found[1]

    def _body(self, name: str) -> One:
        member, body = self.scene.members[name], body_of(self.scene, name)
        data, stiff = body_numbers(body, self.space, self.scales)
        places = tuple(self.segments.place(self.segments.ends[name, i]) for i in range(len(member.nodes)))
        kind = Body(self.space, len(member.nodes), stiff)
        return One(
            kind, name, member.nodes[0], data, self.rotations.ends[name], places, f"member {name} does not stretch"
        )


@dataclass(frozen=True, eq=False)
class _Stopper:
    """Places that obstacles stop in a motion."""

    scene: Scene
    mesh: Mesh
    segments: Segments
    rotations: Rotations
    element: Element
    scales: Scales

    def all(self) -> Iterator[One]:
        """Every place of the mesh."""
        for spot in self.mesh.spots or ():
            yield self._stopped(spot)
            if spot.rubs:
                yield self._sticking(spot)

    def _stopped(self, spot: Spot) -> One:
        """A place that an obstacle stops in a motion."""
        space = self.element.space
        stop = self.scene.obstacles[spot.contact]
        start = self.scene.center_lines[spot.member].positions(np.array([spot.at]))[0] - stop.place
        flat = stop.kind == "flat"
        data = self._flat(stop, start) if flat else self._round(stop, start)
        carried = stop.carrier is not None
        kind = OnPlane(space, carried) if flat else OnRound(space, carried)
        return self._facing(kind, spot, stop, data, spot.name)

    def _facing(self, kind: Facing, spot: Spot, stop: Obstacle, data: Array, row: str) -> One:
        """A constraint on a place of a member that an obstacle sees."""
        place, axes, unit = self.segments.place(spot.place), self.element.axes, self.scales.length
        turn = None if stop.carrier is None else self.rotations.node_turn[stop.carrier]
        if stop.carrier is None or turn is None:
            return One(kind, spot.contact, "", data, (), (place,), row)
        start = self.scene.center_lines[spot.member].positions(np.array([spot.at]))[0] - stop.place
        arm = stop.place - np.asarray(self.scene.nodes[stop.carrier].position)
        data = np.concatenate([data, start[:axes] / unit, arm[:axes] / unit])
        places = (place, self.segments.place(stop.carrier))
        return One(kind, spot.contact, stop.carrier, data, (turn,), places, row)

    def _sticking(self, spot: Spot) -> One:
        """A place that an obstacle holds along it: in the undeformed scene, or where a motion says."""
        axes, line, x = self.element.axes, self.scene.center_lines[spot.member], np.array([spot.at])
        stop = self.scene.obstacles[spot.contact]
        normal = stop.normals(line.positions(x), line.tangents(x))[0, :axes]
        data = np.append(directions_along(normal), np.zeros((axes - 1, 1)), axis=1).ravel()
        return self._facing(Sticking(self.element.space, stop.carrier is not None), spot, stop, data, spot.along)

    def _flat(self, stop: Obstacle, start: Array) -> Array:
        """Data of a place on a plane; ``start`` is where it begins, from the obstacle's place, m."""
        gap = start @ stop.normal - stop.distance
        return np.append(stop.normal[: self.element.axes], gap / self.scales.length)

    def _round(self, stop: Obstacle, start: Array) -> Array:
        """Data of a place on something round."""
        axes, unit = self.element.axes, self.scales.length
        across = stop.across[:axes, :axes].T.ravel()
        # Of centre lines it is as much larger, or inside smaller, as members are thick.
        return np.concatenate([across, start[:axes] / unit, [stop.sign * stop.distance / unit, stop.sign]])


def body_numbers(body: BodyData, space: bool, scales: Scales) -> tuple[Array, int]:
    """Data (numbers,) of :class:`~sfetcas.mechanics.joints.Body`, dimensionless, and its number of constraint rows."""
    chosen = freedoms(len(body.rest), space)
    unit = np.tile([scales.length] * 3 + [1.0] * 3, len(body.rest))
    stiffness = (body.stiffness * unit[:, None] * unit[None, :] / scales.moment)[np.ix_(chosen, chosen)]
    stiff = (body.stiff * unit)[:, chosen]
    norms = np.linalg.norm(stiff, axis=1, keepdims=True)
    axes = 3 if space else 2
    upper = stiffness.T[np.tril_indices(len(chosen))]
    rest = (body.rest[:, :axes] / scales.length).ravel()
    return np.concatenate([rest, upper, (stiff / norms).T.ravel()]), len(stiff)


def freedoms(nodes: int, space: bool) -> Index:
    """Indices, among six degrees of freedom a node, of those of a model: all, or in the plane x, y and about z."""
    each = np.arange(6) if space else np.array([0, 1, 5])
    return (6 * np.arange(nodes)[:, None] + each).ravel()
