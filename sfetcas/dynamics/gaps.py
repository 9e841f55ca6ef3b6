"""Gaps of all that may touch in a motion with many touches, slips along surfaces, and their derivatives; dimensionless.

A gap is that between two places on members, or between a place on a member and an obstacle.  Its derivatives are those
at fixed places, as it is least there.  Between two states the normal ``(d_0 + d_1) / (|d_0| + |d_1|)`` and the mean of
the lines make them exact: times what the unknowns gain they give what the gap does.

A slip is how far the surfaces of two members at fixed places, or a place and what it touches of an obstacle, move along
each other from one state to another, in directions across the normal.  Surfaces turn with their members: at the arms
``a`` and ``b`` from the centre lines to where they touch, ``a + b = (d_0 + d_1) / 2``, members that turn by the
Rodrigues vectors ``psi`` and ``phi`` slip by

    t . (d_1 - d_0) - psi . (a x t) - phi . (b x t).

What an obstacle sees that a node carries is ``z = R^T d`` with the vector ``d`` from the node.  Its parts gain
``z_1 - z_0``: with the mean ``Rm`` of the rotations a force ``F = Rm f`` at the place, its opposite and the moment
``F x (d_0 + d_1) / 2`` on the node do the work ``f . (z_1 - z_0)`` exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..contact.closest import Closest
from ..contact.nearby import Places
from ..description.contacts import contact_radius
from ..description.obstacles import Obstacle
from ..mathematics import quaternion
from ..mathematics.arrays import TINY, Array, Index, Sparse
from ..mathematics.complementarity import Friction
from ..mechanics.center_lines import Curve, Lines, gathered, moment_of
from ..mechanics.mesh import Spot
from ..mechanics.spots import spots_of
from ..mechanics.terms import GROUND
from .stages import StageEquations

__all__ = ["Near", "Pose", "Rows", "Touching"]


PASSED, EARLY = 3, 1e-4
"""Steps of Newton's method to where places were nearest at the begin of a step, and the share of the way from there by
which forces act nearer to its end than where they would do no work.
"""


@dataclass(frozen=True, eq=False)
class Pose:
    """Where everything is: rotations (rotations, components), displacements (places, axes) of places, and the lines."""

    q: Array
    places: Array
    curve: Curve


@dataclass(frozen=True, eq=False)
class Near:
    """What is looked at: pairs of places on members, then numbers of spots on obstacles."""

    places: Places
    spots: Index

    def __len__(self) -> int:
        return len(self.places) + len(self.spots)

    def chosen(self, which: Index) -> Near:
        """Some of it, by rising numbers."""
        count = len(self.places)
        return Near(self.places.chosen(which[which < count]), self.spots[which[which >= count] - count])


@dataclass(frozen=True, eq=False)
class Rows:
    """Derivatives by full coordinates, in blocks of rows: numbers of coordinates (n, k), -1 for none, and values."""

    blocks: tuple[tuple[Index, Array], ...]
    axes: int

    def matrix(self, lines: Lines) -> Sparse:
        """By the unknowns, (rows, total)."""
        from scipy.sparse import vstack

        return vstack([gathered(lines.tables, *block) for block in self.blocks]).tocsr()

    def along(self, full: Array) -> Array:
        """What they give (rows,) for changes of full coordinates (full,)."""
        held = np.append(full, 0.0)
        return np.concatenate([(values * held[cells]).sum(axis=1) for cells, values in self.blocks])

    @property
    def directions(self) -> Array:
        """Vectors (rows, axes) along which forces act on the first of what touches."""
        return np.concatenate([values[:, : self.axes] for _, values in self.blocks])

    @property
    def lengths(self) -> Array:
        """Lengths (rows,) of these: in the middle of a step less than one, as directions change in it."""
        return np.asarray(np.linalg.norm(self.directions, axis=1))

    def of_forces(self, forces: Array, size: int) -> Array:
        """What forces (rows,) do to full coordinates (size,)."""
        found, begin = np.zeros(size + 1), 0
        for cells, values in self.blocks:
            np.add.at(found, cells, values * forces[begin : begin + len(cells), None])
            begin += len(cells)
        return found[:size]


@dataclass(frozen=True, eq=False)
class _Group:
    """Spots of one obstacle: it, their numbers, and its middle as seen from what carries it, dimensionless."""

    stop: Obstacle
    here: Index
    middle: Array


class Touching:
    """What may touch in a system, and the rows of what is near.

    Parameters
    ----------
    system : StageEquations
    """

    def __init__(self, system: StageEquations) -> None:
        model = system.model
        scene, self.unit, self.axes = model.scene, model.scales.length, model.element.axes
        self.nearby = Closest(scene).nearby(model, system.tables)
        self.lines = self.nearby.lines
        self.spots = spots_of(scene, model.mesh)
        self.distance = float(self.nearby.distance.min(initial=np.inf))
        contacts = [scene.contacts[pair.contact] for pair in self.nearby.pairs]
        every = contacts, [scene.contacts[spot.contact] for spot in self.spots]
        self.rebounds, self._coefficients = (
            tuple(np.array([getattr(contact, key) for contact in part]) for part in every)
            for key in ("restitution", "friction")
        )
        self.rubs = any(bool(part.any()) for part in self._coefficients)
        first = [
            contact_radius(contact, scene.members[pair.members[0]], scene.sections) or 0.0
            for pair, contact in zip(self.nearby.pairs, contacts, strict=True)
        ]
        self._share = np.array(first) / self.unit / self.nearby.distance
        # Places on obstacles are seen from the nodes that carry these.
        self.places = np.array([model.segments.place(spot.place) for spot in self.spots], np.intp)
        names = np.array([spot.contact for spot in self.spots], dtype=object)
        # Of what is round and stops from outside.
        self.radii = np.full(len(self.spots), np.inf)
        self._groups = list[_Group]()
        self._carriers, self._turns = (np.full(len(self.spots), GROUND, np.intp) for _ in range(2))
        self._rest = np.array([self._undeformed(scene, spot) for spot in self.spots]).reshape(-1, 3)[:, : self.axes]
        for name in dict.fromkeys(names):
            stop, here, base = scene.obstacles[name], np.flatnonzero(names == name), np.zeros(3)
            if stop.carrier is not None:
                base = np.asarray(scene.nodes[stop.carrier].position)
                self._carriers[here] = model.segments.place(stop.carrier)
                turn = model.rotations.node_turn[stop.carrier]
                self._turns[here] = GROUND if turn is None else turn
            self._rest[here] -= base[: self.axes] / self.unit
            if stop.kind == "round" and stop.sign > 0.0:
                self.radii[here] = stop.distance / self.unit
            self._groups.append(_Group(stop, here, (stop.place - base)[: self.axes] / self.unit))

    def _undeformed(self, scene: Any, spot: Spot) -> Array:
        return np.asarray(scene.center_lines[spot.member].positions(np.array([spot.at]))[0]) / self.unit

    def pose(self, q: Array, places: Array) -> Pose:
        """Of rotations (rotations, components) and displacements (places, axes)."""
        return Pose(q, places, self.lines.curve(q, places))

    # -- what is near ---------------------------------------------------------------------------------

    def gaps(self, pose: Pose, near: Near) -> Array:
        """Gaps (n,) of what is looked at."""
        return np.concatenate([self.nearby.gaps(pose.curve, near.places), self.on_obstacles(pose)[near.spots]])

    def on_obstacles(self, pose: Pose) -> Array:
        """Gaps (spots,) of all spots on obstacles."""
        seen, found = self._seen(pose)[0], np.zeros(len(self.spots))
        for group in self._groups:
            out = self._out(group, seen)
            flat = group.stop.kind == "flat"
            apart = out @ group.stop.normal[: self.axes] if flat else np.linalg.norm(out, axis=1)
            found[group.here] = group.stop.sign * apart - group.stop.distance / self.unit
        return found

    def friction(self, near: Near) -> Friction:
        """What of it rubs: the rows of gaps come first, then those of slips."""
        coefficients = np.concatenate([self._coefficients[0][near.places.pairs], self._coefficients[1][near.spots]])
        across = np.flatnonzero(coefficients > 0.0)
        along = len(near) + np.arange(len(across) * (self.axes - 1)).reshape(-1, self.axes - 1)
        return Friction(across, along, coefficients[across])

    def restitution(self, near: Near) -> Array:
        """Speed after an impact over that before, (n,)."""
        return np.concatenate([self.rebounds[0][near.places.pairs], self.rebounds[1][near.spots]])

    def passed(self, begin: Pose, end: Pose, near: Near) -> Near:
        """The same with places on members at which forces act in a step: between those nearest at its begin and end.

        Half of the way what slides is as near at the end as at the begin, so that forces across do no work on it.  They
        are a little later, where gaps do not open and no energy is gained.
        """
        lines, places, nearby = self.lines, near.places, self.nearby
        if not len(places):
            return near
        # What stays on both members is passed by the second one.
        moving = replace(places, held=np.where(places.held == 3, 1, places.held))
        earlier = nearby.nearest(begin.curve, moving, PASSED, self.distance)
        ways = [
            lines.lengths(a) - lines.lengths(b) for a, b in ((earlier.one, places.one), (earlier.other, places.other))
        ]

        def at(back: Array) -> Places:
            one, other = (lines.moved(x, back * way) for x, way in zip((places.one, places.other), ways, strict=True))
            return replace(places, one=one, other=other)

        def opens(back: Array) -> Array:
            there = at(back)
            return nearby.gaps(end.curve, there) - nearby.gaps(begin.curve, there)

        half = np.full(len(places), 0.5)
        first, last = opens(0.0 * half), opens(half)
        between = (first < 0.0) & (last > 0.0)
        slope = np.where(between, 2.0 * (last - first), 1.0)
        back = np.where(between, -first / slope, 0.0)
        back = np.where(between, np.clip(back - opens(back) / slope - EARLY, 0.0, 0.5), np.where(last > 0.0, 0.0, 0.5))
        return replace(near, places=at(np.where(opens(back) > 0.0, 0.0, back)))

    # -- rows -----------------------------------------------------------------------------------------

    def rows(self, begin: Pose, end: Pose, near: Near, slipping: Near | None = None, *, middle: bool = False) -> Rows:
        """Rows of gaps, then of slips since the begin of a step.

        Those in the ``middle`` give exactly what gaps and slips gain between the two.  Others are derivatives at the
        end: of speeds, or of gaps and of the slips at ``slipping`` since the begin.
        """
        blocks = list[tuple[Index, Array]]()
        normals, ways, curve = self._across_pairs(begin, end, near.places, middle)
        blocks.append(self._of_pairs(curve, near.places, normals))
        axes, apart = self._axes_of_spots(begin, end, near.spots, middle)
        across, along = self._across_spots(begin, end, near.spots, middle)
        blocks.append(self._of_spots(axes, apart, near.spots, across))
        if not self.rubs:
            return Rows(tuple(blocks), self.axes)
        rough, places = self._rough(near), near.places
        if slipping is not None:
            places = slipping.places
            _, ways, _ = self._across_pairs(begin, end, places, True)
        chosen, ways = places.chosen(np.repeat(rough[0], self.axes - 1)), ways[rough[0]].reshape(-1, self.axes)
        blocks.append(self._slips_of_pairs(begin, end, chosen, ways, middle, slipping is not None))
        own = np.repeat(rough[1], self.axes - 1)
        blocks.append(self._of_spots(axes[own], apart[own], near.spots[own], along[rough[1]].reshape(-1, self.axes)))
        return Rows(tuple(blocks), self.axes)

    def _rough(self, near: Near) -> tuple[Index, Index]:
        """Which pairs, and which spots, of what is looked at rub."""
        of_pairs, of_spots = self._coefficients
        return np.flatnonzero(of_pairs[near.places.pairs] > 0.0), np.flatnonzero(of_spots[near.spots] > 0.0)

    def slips(self, begin: Pose, end: Pose, near: Near) -> Array:
        """How far what rubs has slipped since the begin of a step, (slips,)."""
        if not self.rubs:
            return np.zeros(0)
        rough = self._rough(near)
        places = near.places.chosen(rough[0])
        _, ways, _ = self._across_pairs(begin, end, places, True)
        d0, d1 = (self.nearby.between(pose.curve, places) for pose in (begin, end))
        found = np.einsum("nka,na->nk", ways, d1 - d0)
        for along, arm in zip((places.one, places.other), self._arms(d0, d1, places), strict=True):
            turned = self.lines.of_sections(along, self.lines.turned(begin.q, end.q, along))
            found -= np.einsum("nka,na->nk", moment_of(arm[:, None, :], ways), turned)
        _, along_spots = self._across_spots(begin, end, near.spots, True)
        moved = (self._seen(end)[0] - self._seen(begin)[0])[near.spots]
        other = np.einsum("nka,na->nk", along_spots, moved)[rough[1]]
        return np.concatenate([found.ravel(), other.ravel()])

    # -- pairs ----------------------------------------------------------------------------------------

    def _across_pairs(self, begin: Pose, end: Pose, places: Places, middle: bool) -> tuple[Array, Array, Curve]:
        """Normals (n, axes), unit vectors (n, axes - 1, axes) across them, and the lines on which forces act."""
        before, d = (self.nearby.between(pose.curve, places) for pose in (begin, end))
        sum_of, apart = (d + before, _length(d) + _length(before)) if middle else (d, _length(d))
        curve = begin.curve.mean(end.curve) if middle else end.curve
        return sum_of / apart[:, None], _frames(before, sum_of), curve

    def _arms(self, d0: Array, d1: Array, places: Places) -> tuple[Array, Array]:
        """Vectors (n, axes) to the centre line of the first from where surfaces touch, and to there from the second."""
        share, middle = self._share[places.pairs][:, None], 0.5 * (d0 + d1)
        return share * middle, (1.0 - share) * middle

    def _of_pairs(self, curve: Curve, places: Places, ways: Array) -> tuple[Index, Array]:
        ones, others = (self.lines.entries(curve, along, ways) for along in (places.one, places.other))
        return np.concatenate([ones[0], others[0]], axis=1), np.concatenate([ones[1], -others[1]], axis=1)

    def _slips_of_pairs(
        self, begin: Pose, end: Pose, places: Places, ways: Array, middle: bool, turned: bool
    ) -> tuple[Index, Array]:
        before, d = (self.nearby.between(pose.curve, places) for pose in (begin, end))
        curve, found = begin.curve.mean(end.curve) if middle else end.curve, []
        arms = self._arms(before if middle else d, d, places)
        for sign, along, arm in zip((1.0, -1.0), (places.one, places.other), arms, strict=True):
            gain = self.lines.turned(begin.q, end.q, along) if turned else None
            moments = self.lines.shared(along, -moment_of(arm, ways), gain)
            cells, values = self.lines.entries(curve, along, sign * ways, moments)
            found.append((cells, values))
        cells, values = (np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        return cells, values

    # -- obstacles ------------------------------------------------------------------------------------

    def _seen(self, pose: Pose) -> tuple[Array, Array, Array]:
        """Places (spots, axes) as their obstacles see them, vectors from the nodes that carry these, and the rotations
        (spots, axes, axes) of these.
        """
        carried = self._carriers != GROUND
        held = np.where(carried[:, None], pose.places[self._carriers], 0.0)
        apart = self._rest + pose.places[self.places] - held
        turned = np.broadcast_to(np.eye(self.axes), (len(self.spots), self.axes, self.axes)).copy()
        own = np.flatnonzero(self._turns != GROUND)
        if len(own):
            q = pose.q[self._turns[own]]
            q = q / np.linalg.norm(q, axis=1, keepdims=True) if self.axes == 3 else q
            turned[own] = np.swapaxes(quaternion.turned_by(q[:, None, :], np.eye(self.axes)), -1, -2)
        return np.einsum("nba,nb->na", turned, apart), apart, turned

    def _out(self, group: _Group, seen: Array) -> Array:
        """Vectors (n, axes) from the middle of an obstacle, across its axis, to places that it sees (spots, axes)."""
        return np.asarray((seen[group.here] - group.middle) @ group.stop.across[: self.axes, : self.axes])

    def _across_spots(self, begin: Pose, end: Pose, spots: Index, middle: bool) -> tuple[Array, Array]:
        """Normals (n, axes), and unit vectors (n, axes - 1, axes) across them, as obstacles see them."""
        before, seen = self._seen(begin)[0], self._seen(end)[0]
        found, first = np.zeros_like(seen), np.zeros_like(seen)
        for group in self._groups:
            if group.stop.kind == "flat":
                found[group.here] = first[group.here] = group.stop.normal[: self.axes]
                continue
            earlier, out = self._out(group, before), self._out(group, seen)
            apart = _length(out)
            first[group.here] = earlier
            if middle:
                out, apart = out + earlier, apart + _length(earlier)
            found[group.here] = group.stop.sign * out / apart[:, None]
        return found[spots], _frames(first[spots], found[spots])

    def _axes_of_spots(self, begin: Pose, end: Pose, spots: Index, middle: bool) -> tuple[Array, Array]:
        """Rotations of what carries obstacles, and vectors from it to places, in fixed axes."""
        _, apart, turned = self._seen(end)
        if middle:
            _, earlier, other = self._seen(begin)
            apart, turned = 0.5 * (apart + earlier), 0.5 * (turned + other)
        return turned[spots], apart[spots]

    def _of_spots(self, turned: Array, apart: Array, spots: Index, ways: Array) -> tuple[Index, Array]:
        """Entries of directions (n, axes) as obstacles see them."""
        tables, forces = self.lines.tables, np.einsum("nab,nb->na", turned, ways)
        carriers, turns = self._carriers[spots], self._turns[spots]
        held = np.where((carriers == GROUND)[:, None], -1, tables.place_cells(carriers))
        turning = tables.width * turns[:, None] + np.arange(tables.width)
        turning = np.where((turns == GROUND)[:, None], -1, turning)
        cells = np.concatenate([tables.place_cells(self.places[spots]), held, turning], axis=1)
        return cells, np.concatenate([forces, -forces, moment_of(forces, apart)], axis=1)


def _length(vectors: Array) -> Array:
    """Lengths (n,) of vectors (n, axes), not zero."""
    return np.maximum(np.linalg.norm(vectors, axis=1), TINY)


def _frames(first: Array, normals: Array) -> Array:
    """Unit vectors (n, axes - 1, axes) across normals (n, axes) of any length, near to those across ``first``.

    They change as smoothly as the normals do.
    """
    n = normals / _length(normals)[:, None]
    if n.shape[1] == 2:
        return np.stack([-n[:, 1], n[:, 0]], axis=1)[:, None, :]
    ways = np.eye(3)[np.argmin(np.abs(first), axis=1)]
    one = np.cross(n, ways)
    one /= _length(one)[:, None]
    return np.stack([one, np.cross(n, one)], axis=1)
