"""Contact at a state: forces of obstacles, conditions of the places of contact, gaps along members.

A place of contact within a member is a further unknown beside the equilibrium with that place fixed:

* on a plane or a round obstacle the member is tangential to it there;
* to a point or an edge it is the nearest one;
* where a stretch begins or ends, the bending moment is that of the member in the shape of the obstacle.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import tolerances
from ..description.obstacles import edge_side, members_of, nearest, takes_part
from ..description.scene import Scene
from ..mathematics.arrays import Array, unit
from ..mechanics.equations import Equations, State
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading
from ..mechanics.mesh import Touch
from ..mechanics.rotations import STIFF, end_joints
from .closest import BEHIND_EDGE

__all__ = ["COARSE", "MOST_RISE", "NOISE", "Gap", "Loose", "Opened", "Touched", "answers", "edge_sides"]

COARSE = 1e-6
"""Penetration that is accepted on coarse meshes, on the way to the answer, share of the size of the scene."""

BESIDE_END = np.geomspace(1e-5, 1e-2, 10)
"""Distances from an end that touches at which gaps are computed as well, fractions of the length."""

NOISE = 1e-4
"""Penetration by oscillation of coarse meshes beside places where members leave, share of the size of the scene."""

GRID, FINER = 33, 6
"""Number of places in an interval among which the smallest gap is chosen, and number of times the interval is reduced
to its neighbours: to 6e-8 of itself, a gap within rounding."""

FIRST_RISE, MOST_RISE = 0.05, 0.9
"""Part of a stretch that is assumed to rise if there is no estimate, and largest part; shares of its length."""

SAMPLES = 12
"""Number of places in each element at which gaps are computed."""


@dataclass(frozen=True)
class Gap:
    """A run of places of a member that are inside an obstacle, and the deepest of them.

    Attributes
    ----------
    contact, member : str
    begin, end, at : float
        Fractions of the length; ``at`` is the deepest place.
    depth : float
        Gap there, m, negative.
    way : float
        As in :class:`~sfetcas.mechanics.mesh.Touch`.
    """

    contact: str
    member: str
    begin: float
    end: float
    at: float
    depth: float
    way: float = 1.0


@dataclass(frozen=True)
class Loose:
    """An end of a stretch, at an end of its member, that cannot lie on the obstacle.

    Attributes
    ----------
    at : float
        0 or 1.
    risen : float
        Estimated part of the member that rises from there, a fraction of its length.
    stays : bool
        Whether the end itself is pressed on the obstacle, and the member rises beside it.
    """

    at: float
    risen: float
    stays: bool


@dataclass(frozen=True)
class Opened:
    """A place of a stretch with a load that an obstacle cannot balance.

    Attributes
    ----------
    touch : Touch
    at : float
        Fraction of the length.
    node : str or None
        Node at this place.
    pull, couple : float
        Force away from the obstacle, N, and moment, N m.
    """

    touch: Touch
    at: float
    node: str | None
    pull: float
    couple: float


def edge_sides(scene: Scene) -> dict[tuple[str, str], float]:
    """For each edge and member 1 or -1: sign of (edge x tangent) on the allowed side, in the undeformed scene."""
    found = {}
    for name, stop in scene.obstacles.items():
        if stop.side is None:
            continue
        for member in members_of(scene.contacts[name], scene.members):
            line = scene.center_lines[member]
            found[name, member] = edge_side(stop, line.positions, line.tangents)
    return found


class Touched:
    """Forces, conditions and gaps of contact at one state of a model.

    Parameters
    ----------
    equations : Equations
    state : State
    loading : Loading
    """

    def __init__(self, equations: Equations, state: State, loading: Loading) -> None:
        self._take(Fields(equations, state, loading), state)

    @classmethod
    def of(cls, fields: Fields) -> Touched:
        """Contact at the state that fields evaluate."""
        self = cls.__new__(cls)
        self._take(fields, fields.state)
        return self

    def _take(self, fields: Fields, state: State) -> None:
        self.fields, self.model, self._state = fields, fields.model, state
        self.obstacles = self.model.scene.obstacles
        names = self.model.row_names
        self._row = {name: i for i, name in reversed(list(enumerate(names)))}

    # -- forces ---------------------------------------------------------------------------------

    def force(self, touch: Touch) -> Array:
        """Force (3,) of an obstacle on a member at a place or over a stretch, N."""
        model = self.model
        if touch.to is not None:
            return self._resultant(touch)
        normal = self.normal(touch, touch.at)
        force = -self._state.lam[self._row[touch.name]] * normal
        return np.asarray(force * model.scales.force)

    def _resultant(self, touch: Touch) -> Array:
        """Force over a stretch by the balance of its forces, N."""
        before, after = self._beside(touch, touch.at, -1.0), self._beside(touch, float(touch.to or 0.0), 1.0)
        total = before - after - self._load_between(touch.member, touch.at, float(touch.to or 0.0))
        total = total + sum((self._at_node(touch, at) for at in touch.places if at in (0.0, 1.0)), np.zeros(3))
        stop = self.obstacles[touch.contact]
        # What holds an end along a plane is not of the plane.
        return np.asarray(stop.across @ total if stop.kind == "flat" else total)

    def _beside(self, touch: Touch, at: float, way: float) -> Array:
        """Internal force just outside a stretch, N; inside it where a support or another stretch continues it."""
        model, record = self.model, self.model.scene.members[touch.member]
        if 0.0 < at < 1.0:
            x = np.nextafter(at, at + way)
            return np.asarray(self.fields.along(touch.member, np.array([x]))["force"][0])
        node = record.nodes[int(at)]
        if not self.takes_part(touch.contact, node) or self.goes_on(touch, at):
            return np.asarray(self.fields.along(touch.member, np.array([at]))["force"][0])
        beyond = self.fields.own_force(node) + self._other_pushes(node, touch.contact)
        for name, member in model.scene.members.items():
            if name != touch.member and node in member.nodes and name in model.members:
                ends = self.fields.along(name, np.array([0.0, 1.0]))["force"]
                beyond = beyond + ends[0] if member.nodes[0] == node else beyond - ends[1]
        return way * beyond

    def _other_pushes(self, node: str, contact: str) -> Array:
        """Force (3,) of all obstacles but one that touch a node by itself, N."""
        others = [t for t in self.model.mesh.touches if t.contact != contact and t.to is None]
        return sum(
            (self.force(t) for t in others if self.model.scene.members[t.member].node_at(t.at) == node), np.zeros(3)
        )

    def goes_on(self, touch: Touch, at: float) -> bool:
        """Whether another stretch of the same obstacle begins at the node where a stretch ends (``at`` 0 or 1)."""
        node = self.model.scene.members[touch.member].nodes[int(at)]
        for other in self.model.mesh.touches:
            if other is not touch and other.contact == touch.contact and other.to is not None:
                member = self.model.scene.members[other.member]
                if any(member.node_at(x) == node for x in other.places):
                    return True
        return False

    def _at_node(self, touch: Touch, at: float) -> Array:
        """Force on a node between two stretches, N, which counts with the first of them."""
        node = self.model.scene.members[touch.member].nodes[int(at)]
        if not self.takes_part(touch.contact, node) or not self.goes_on(touch, at):
            return np.zeros(3)
        here = [t for t in self.model.mesh.touches if t.contact == touch.contact and t.to is not None]
        first = next(t for t in here if any(self.model.scene.members[t.member].node_at(x) == node for x in t.places))
        return self.left_over(node, touch.contact)[1] if first is touch else np.zeros(3)

    def _load_between(self, member: str, begin: float, end: float) -> Array:
        """Distributed load between two places, N."""
        before = self.fields.load_before(member, np.array([begin, end]))
        return np.asarray((before[1] - before[0]) * self.model.scales.force)

    def push(self, touch: Touch) -> float:
        """Contact force of a touch along the normal of the obstacle, N; negative for tension."""
        return float(self.force(touch) @ self.normal(touch, touch.at))

    def pressures(self, touch: Touch, x: Array) -> Array:
        """Contact forces (n - 1,), N, between places x (n,) of a stretch, along the normals in their middles."""
        forces = self.fields.along(touch.member, x)["force"]
        loads = self.fields.load_before(touch.member, x) * self.model.scales.force
        pushed = -np.diff(forces, axis=0) - np.diff(loads, axis=0)
        middles = 0.5 * (x[1:] + x[:-1])
        return np.array([push @ self.normal(touch, at) for push, at in zip(pushed, middles, strict=True)])

    # -- what obstacles cannot hold -------------------------------------------------------------

    def loose_end(self, touch: Touch) -> Loose | None:
        """The end of a stretch at a node with tension or a clamping moment between it and the obstacle, or None."""
        model = self.model
        for at in touch.places if touch.to is not None else ():
            node = model.scene.members[touch.member].node_at(at)
            if not node or not self.takes_part(touch.contact, node) or self.goes_on(touch, at):
                continue
            axis = self.fields.pressed_moments(touch, np.array([at]))[1][0]
            moment, force = self.left_over(node, touch.contact)
            normal = self.normal(touch, at)
            push = float(force @ normal)
            # Positive where the moment at the end would bend the member away from the obstacle.
            away = np.cross(axis, self._tangent(touch, at)) @ normal
            bends = float((1.0 - 2.0 * at) * (moment @ axis) * away)
            held = model.scene.nodes[node].support != "free"
            if push < -tolerances.BALANCED * model.scales.force or (abs(bends) > 1e-8 and not held):
                return Loose(at, *self._risen(touch, push, bends * model.scales.moment, at))
        return None

    def left_over(self, node: str, contact: str) -> tuple[Array, Array]:
        """Moment (3,), dimensionless, and force (3,), N, on a node that only one obstacle can balance.

        They are the sum of the internal forces of its members, its loads, its springs and all other obstacles.
        """
        scene, fields = self.model.scene, self.fields
        moment, force = -fields.own_moment(node) + fields.balance.spring_moment(node), -fields.own_force(node)
        force = force - self._other_pushes(node, contact)
        for name, member in scene.members.items():
            for i, (at, joint) in enumerate(end_joints(scene, member)):
                if at != node or name not in self.model.members:
                    continue
                found = fields.along(name, np.array([float(i)]))
                force = force + (2.0 * i - 1.0) * found["force"][0]
                if joint in STIFF:
                    moment = moment + (2.0 * i - 1.0) * found["moment"][0] / self.model.scales.moment
        return moment, force

    def _risen(self, touch: Touch, push: float, bends: float, at: float) -> tuple[float, bool]:
        """How far a heavy beam rises from a plane under a force and a couple at its end, and whether the end stays.

        As a fraction of the length.  A couple that presses the end on the plane lifts what is beside it, over
        ``d = 2 sqrt(couple / pressure)``, and pushes the end by three quarters of the weight of that length.
        Otherwise the end rises as well, where ``bends - push d - pressure d^2 / 2`` vanishes.
        """
        pressure, span, length = self._pressure(touch, at), float(touch.to or 0.0) - touch.at, self._length(touch)
        weight = max(pressure, 0.0)
        stays = bends < 0.0 and push > -1.5 * np.sqrt(-bends * weight)
        if pressure <= 0.0:
            return FIRST_RISE * span, stays
        inner = push**2 + 2.0 * bends * pressure
        beside = 2.0 * np.sqrt(abs(bends) / pressure)
        rise = beside if stays or inner < 0.0 else (np.sqrt(inner) - push) / pressure
        return float(np.clip(rise / length, 1e-3 * span, MOST_RISE * span)), bool(stays)

    def _length(self, touch: Touch) -> float:
        return self.model.scene.center_lines[touch.member].length

    def _pressure(self, touch: Touch, at: float) -> float:
        """Pressure on a stretch beside a place of it, N/m."""
        span = float(touch.to or 0.0) - touch.at
        x = np.linspace(touch.at, float(touch.to or 0.0), 9)
        i = int(np.clip(np.round((at - touch.at) / span * 8.0 - 0.5), 1, 6))
        return float(self.pressures(touch, x)[i]) / (span / 8.0 * self._length(touch))

    def opened(self, touch: Touch, share: float) -> Opened | None:
        """A place within a stretch where a load lifts or rotates the member off the obstacle, or None.

        Loads smaller than ``share`` of the largest force or moment do not count.
        """
        model, fields = self.model, self.fields
        size, to = share * self._size, float(touch.to or 0.0)
        cuts, part = model.mesh.cuts[touch.member], model.elements_of(touch.member)
        inner = cuts[1:-1][(cuts[1:-1] > touch.at) & (cuts[1:-1] < to)]
        beside = np.stack([np.nextafter(inner, 0.0), inner], axis=1).ravel()
        forces = np.diff(fields.load_before(touch.member, beside), axis=0)[::2] if len(inner) else np.zeros((0, 3))
        turned = model.rotations.turns[part][1:, 0][(cuts[1:-1] > touch.at) & (cuts[1:-1] < to)]
        for at, force, turn in zip(inner.tolist(), forces, turned.tolist(), strict=True):
            pull, couple = float(force @ self.normal(touch, at)), fields.moment_on(turn)
            if pull > size or couple > size:
                return Opened(touch, at, None, max(pull, 0.0) * model.scales.force, couple * model.scales.moment)
        for at in (x for x in touch.places if x in (0.0, 1.0)):
            node = model.scene.members[touch.member].nodes[int(at)]
            if not self.takes_part(touch.contact, node) or not self.goes_on(touch, at):
                continue
            moment, force = self.left_over(node, touch.contact)
            pull = max(-float(force @ self.normal(touch, at)) / model.scales.force, 0.0)
            couple = abs(float(moment @ fields.pressed_moments(touch, np.array([at]))[1][0]))
            if pull > size or couple > size:
                return Opened(touch, at, node, pull * model.scales.force, couple * model.scales.moment)
        return None

    @functools.cached_property
    def _size(self) -> float:
        """Largest force or moment of the scene, dimensionless."""
        found = [1e-12]
        for name in self.model.members:
            along = self.fields.along(name, np.array([0.0, 0.5, 1.0]), dimensionless=True)
            found += [float(np.abs(along["force"]).max()), float(np.abs(along["moment"]).max())]
        return max([*found, self.fields.largest_load])

    def hump(self, opened: Opened) -> float:
        """Half of the length over which a heavy beam on a plane rises around a load, as a fraction of the member's.

        A force P against the pressure p opens ``1.5 P / p``, a couple C about ``2 sqrt(C / p)`` to either side.
        """
        touch = opened.touch
        pressure, span = self._pressure(touch, opened.at), float(touch.to or 0.0) - touch.at
        if pressure <= 0.0:
            return FIRST_RISE * span
        wide = max(0.75 * opened.pull / pressure, np.sqrt(2.0 * opened.couple / pressure)) / self._length(touch)
        return float(np.clip(wide, 1e-3 * span, MOST_RISE * span))

    def normal(self, touch: Touch, at: float) -> Array:
        """Unit normal (3,) of an obstacle at a place of a member, fixed axes."""
        x = np.array([at])
        place, tangent = self.fields.positions(touch.member, x), self.fields.tangents(touch.member, x)
        return np.asarray(self.obstacles[touch.contact].normals(place, tangent, touch.way)[0])

    def _tangent(self, touch: Touch, at: float) -> Array:
        return np.asarray(self.fields.tangents(touch.member, np.array([at]))[0])

    # -- conditions -----------------------------------------------------------------------------

    @functools.cached_property
    def conditions(self) -> Array:
        """Values (places,), dimensionless, that vanish at the right places of contact within members, in their order.

        At single places the slope along the obstacle, at an edge the distance along the member; at ends of stretches
        the jump of the moment.
        """
        found: list[float] = []
        for touch in self.model.mesh.touches:
            if touch.to is not None:
                found += self._moment_jumps(touch)
            elif 0.0 < touch.at < 1.0:
                sharp = self.obstacles[touch.contact].kind == "sharp"
                out = self._from_edge(touch) if sharp else self.normal(touch, touch.at)
                found.append(float(out @ self._tangent(touch, touch.at)))
        return np.array(found)

    def _from_edge(self, touch: Touch) -> Array:
        """Distance (3,) of a place from an edge, across it, dimensionless."""
        stop = self.obstacles[touch.contact]
        out = self.fields.positions(touch.member, np.array([touch.at]))[0] - stop.place
        if stop.side is not None:
            out = out + touch.offset * unit(stop.side)
        return np.asarray(out @ stop.across / self.model.scales.length)

    def _moment_jumps(self, touch: Touch) -> list[float]:
        """Moments just outside the ends of a stretch within the member, less those that the obstacle's shape takes."""
        ends = np.array([touch.at, float(touch.to or 0.0)])
        inner = (ends > 0.0) & (ends < 1.0)
        if not inner.any():
            return []
        beside = np.nextafter(ends, [-1.0, 2.0])[inner]
        outside = self.fields.along(touch.member, beside, dimensionless=True)["moment"]
        pressed, axes = self.fields.pressed_moments(touch, ends[inner])
        return [float(value) for value in np.einsum("ni,ni->n", outside, axes) - pressed]

    def gap_curvature(self, touch: Touch) -> float:
        """Second derivative of the gap along the member at a place of contact, 1/m."""
        x = np.array([touch.at])
        found = self.fields.along(touch.member, x)
        normal, tangent = self.normal(touch, touch.at), self._tangent(touch, touch.at)
        bent = self.fields.bend(touch.member, x, found)[0] @ normal
        stop = self.obstacles[touch.contact]
        if stop.kind != "round":
            return float(bent)
        along = tangent @ stop.across
        return float(bent + stop.sign * (along @ along) / stop.radius)

    # -- gaps -----------------------------------------------------------------------------------

    def samples(self, member: str) -> Array:
        """Fractions (n,) of the length at which gaps are computed, rising from 0 to 1, several in each element."""
        cuts = self.model.mesh.cuts[member]
        # Towards the ends of an element, where contact begins, the samples are dense.
        inner = 0.5 - 0.5 * np.cos(np.pi * np.arange(SAMPLES) / SAMPLES)
        return np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * inner).ravel(), 1.0)

    def gaps(self, contact: str, member: str, x: Array, offset: float, way: float = 1.0) -> Array:
        """Gaps (n,), m, at fractions x (n,) of a member, the obstacle moved back by ``offset``, m; negative inside."""
        place, tangent = self.fields.positions(member, x), self.fields.tangents(member, x)
        return self.obstacles[contact].gaps(place, tangent, offset, way)

    def inside(
        self,
        offsets: Mapping[str, float],
        ways: Mapping[tuple[str, str], float],
        limit: float,
        noise: float = 0.0,
    ) -> list[Gap]:
        """All runs of places deeper inside an obstacle than ``limit``, m, outside of the stretches on it.

        Beside places where a member leaves an obstacle ``noise``, m, is accepted.  ``offsets`` are the distances, m, by
        which obstacles are moved back, ``ways`` the allowed sides of edges.
        """
        found: list[Gap] = []
        for contact, stop in self.obstacles.items():
            for member in members_of(self.model.scene.contacts[contact], self.model.scene.members):
                offset = offsets.get(contact, 0.0)
                if stop.kind == "sharp":
                    found += self._over_edge(contact, member, offset, ways[contact, member], limit)
                else:
                    found += self._runs(contact, member, offset, limit, noise)
        return found

    def takes_part(self, contact: str, node: str) -> bool:
        """Whether an obstacle can exert a force on a node: supports and motions leave it free to move."""
        scene = self.model.scene
        return takes_part(node, scene.nodes[node], scene.motions.values(), self.obstacles[contact])

    def _runs(self, contact: str, member: str, offset: float, limit: float, noise: float) -> list[Gap]:
        x = self._with_smallest(contact, member, self._beside_ends(contact, member, self.samples(member)), offset)
        keep = np.ones(len(x), bool)
        keep[0], keep[-1] = (self.takes_part(contact, node) for node in self.model.scene.members[member].nodes)
        for touch in self.model.mesh.touches:
            if touch.contact == contact and touch.member == member and touch.to is not None:
                keep &= (x < touch.at) | (x > touch.to)
        gaps = self.gaps(contact, member, x, offset)
        deep = (gaps < -limit) & keep
        edges = np.flatnonzero(np.diff(np.concatenate([[False], deep, [False]]).astype(int)))
        runs = []
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            i = a + int(np.argmin(gaps[a:b]))
            if gaps[i] > -noise and self._wavers(contact, member, float(x[a]), float(x[b - 1])):
                continue
            runs.append(Gap(contact, member, float(x[a]), float(x[b - 1]), float(x[i]), float(gaps[i])))
        return runs

    def _beside_ends(self, contact: str, member: str, x: Array) -> Array:
        """The samples, and some close to ends that touch: what begins to lie there dips in over a short way."""
        touches = [t for t in self.model.mesh.touches if (t.contact, t.member) == (contact, member) and t.to is None]
        close = [abs(touch.at - BESIDE_END) for touch in touches if touch.at in (0.0, 1.0)]
        return np.unique(np.concatenate([x, *close]))

    def _wavers(self, contact: str, member: str, begin: float, end: float) -> bool:
        """Whether a run is in the element beside a place where curvatures already say that the member leaves.

        At a free end of a member they do not.
        """
        scene, cuts = self.model.scene, self.model.mesh.cuts[member]
        for touch in self.model.mesh.touches:
            if touch.contact != contact:
                continue
            for x in touch.places:
                place: float | None = x if touch.member == member else None
                if x in (0.0, 1.0):
                    node = scene.members[touch.member].nodes[int(x)]
                    if sum(node in other.nodes for other in scene.members.values()) == 1 and touch.to is None:
                        continue
                    nodes = scene.members[member].nodes
                    place = float(nodes.index(node)) if node in nodes else place
                if place is None:
                    continue
                cut = self.model.mesh.cut_at(member, place)
                low, high = cuts[max(cut - 1, 0)], cuts[min(cut + 1, len(cuts) - 1)]
                if low <= begin and end <= high:
                    return True
        return False

    def _with_smallest(self, contact: str, member: str, x: Array, offset: float) -> Array:
        """The samples, and between them where an obstacle that is smaller than their spacing may be entered."""
        stop = self.obstacles[contact]
        length = self.model.scene.center_lines[member].length
        if stop.kind != "round" or stop.radius > 4.0 * length * np.diff(x).max():
            return x
        gaps = self.gaps(contact, member, x, offset)
        inner = (gaps[1:-1] <= gaps[:-2]) & (gaps[1:-1] <= gaps[2:]) & (gaps[1:-1] < length * np.diff(x).max())
        i = np.flatnonzero(inner)
        return np.unique(np.append(x, self._smallest(contact, member, x[i], x[i + 2])))

    def _nearest(self, contact: str, member: str, x: Array) -> Array:
        """The place of the smallest gap, from the smallest of samples."""
        i = int(np.argmin(self.gaps(contact, member, x, 0.0)))
        return self._smallest(contact, member, x[[max(i - 1, 0)]], x[[min(i + 1, len(x) - 1)]])

    def _smallest(self, contact: str, member: str, low: Array, high: Array) -> Array:
        """The places (n,) of the smallest gaps between places (n,) and (n,)."""
        if not len(low):
            return low
        each = np.arange(len(low))
        for _ in range(FINER):
            inner = np.linspace(low, high, GRID, axis=1)
            gaps = self.gaps(contact, member, inner.ravel(), 0.0).reshape(inner.shape)
            k = np.argmin(gaps, axis=1)
            low, high = inner[each, np.maximum(k - 1, 0)], inner[each, np.minimum(k + 1, GRID - 1)]
        return 0.5 * (low + high)

    def _over_edge(self, contact: str, member: str, offset: float, way: float, limit: float) -> list[Gap]:
        if any(t.contact == contact and t.member == member for t in self.model.mesh.touches):
            return []
        found = []
        for x in self.passing(contact, member):
            gap = float(self.gaps(contact, member, np.array([x]), offset, way)[0])
            if gap < -limit and abs(gap) < BEHIND_EDGE * self.model.scene.size:
                found.append(Gap(contact, member, x, x, x, gap, way))
        return found

    def passing(self, contact: str, member: str) -> list[float]:
        """Fractions of the length at which a member comes nearest to an edge."""
        fields = self.fields
        positions, tangents = (lambda x: fields.positions(member, x)), (lambda x: fields.tangents(member, x))
        return nearest(self.obstacles[contact], positions, tangents, self.samples(member))

    def course(self, member: str) -> Array:
        """Positions (n, 3), m, along a member, near enough to each other to be joined by straight lines."""
        return self.fields.positions(member, self.samples(member))

    def smallest_gap(self, contact: str, way: Mapping[tuple[str, str], float]) -> float:
        """Smallest gap, m, between an obstacle and the members that it concerns; infinite if none passes an edge."""
        found = [np.inf]
        for member in members_of(self.model.scene.contacts[contact], self.model.scene.members):
            sharp = self.obstacles[contact].kind == "sharp"
            x = np.array(self.passing(contact, member)) if sharp else self.samples(member)
            if not sharp:
                x = self._nearest(contact, member, x)
            gaps = self.gaps(contact, member, x, 0.0, way.get((contact, member), 1.0)) if len(x) else x
            gaps = gaps[gaps > -BEHIND_EDGE * self.model.scene.size] if sharp else gaps
            if len(gaps):
                found.append(float(gaps[np.argmin(np.abs(gaps))] if sharp else gaps.min()))
        return min(found)


def answers(fields: Fields) -> dict[str, dict[str, Any]]:
    """For each obstacle ``force`` (3,) N, ``at`` (fraction or stretch), ``gap`` m and ``member``; lists for several."""
    touched, sides = Touched.of(fields), edge_sides(fields.model.scene)
    found: dict[str, dict[str, Any]] = {}
    for contact in touched.obstacles:
        touches = sorted((t for t in fields.model.mesh.touches if t.contact == contact), key=lambda t: t.at)
        if not touches:
            gap = touched.smallest_gap(contact, sides)
            known = gap if np.isfinite(gap) else None
            found[contact] = {"force": np.zeros(3), "at": None, "gap": known, "member": None}
            continue
        entries = [
            {
                "force": touched.force(touch),
                "at": touch.at if touch.to is None else [touch.at, touch.to],
                "gap": float(touched.gaps(contact, touch.member, np.array([touch.at]), 0.0, touch.way)[0]),
                "member": touch.member,
            }
            for touch in touches
        ]
        several = {key: [entry[key] for entry in entries] for key in entries[0]}
        found[contact] = entries[0] if len(entries) == 1 else several
    return found
