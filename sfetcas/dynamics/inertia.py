"""Inertia and damping evaluated numerically: forces, kinetic energy, momenta, and loads by d'Alembert's principle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import mapped
from ..mathematics.linear import SparseMap
from ..mechanics.balance import three
from ..mechanics.batches import GroupBatch
from ..mechanics.equations import Equations, State
from ..mechanics.inertia_loads import along_rigid, couples_along, put_moments, without_rigid
from ..mechanics.load_terms import carried
from ..mechanics.loading import Dampers, Loading
from ..mechanics.mass_centers import along_elements
from ..mechanics.relaxation import strain_units
from ..mechanics.terms import rotation_gradient
from .stages import StageEquations

__all__ = ["Inertia"]


class Inertia:
    """Masses and dampers of one model, applied to the rates of its quantities (:mod:`~sfetcas.mechanics.observed`).

    Everything is dimensionless; velocities and accelerations are arrays (quantities,).
    """

    def __init__(self, system: StageEquations) -> None:
        self.system, self._masses = system, system.masses
        self._model = model = system.model
        masses, axes = system.masses, system.axes
        self._inside = tuple(system.inner_nodes.T)
        self._inner = masses.inner[self._inside]
        self._inner_drag = masses.inner_drag[self._inside]
        self._coriolis = None if system.coriolis is None else mapped(system.coriolis)
        self._rest = np.zeros((system.linear // axes, axes))
        for name in model.nodes:
            self._rest[model.segments.place(name)] = np.asarray(model.scene.nodes[name].position)[:axes]
        for (name, i), end in model.segments.ends.items():
            node = model.scene.members[name].nodes[i]
            self._rest[model.segments.place(end)] = np.asarray(model.scene.nodes[node].position)[:axes]
        for name in model.members:
            self._place(name)
        self._rest /= model.scales.length
        self._batches = [
            GroupBatch(model, group, rotation_gradient(group.kind), system.angles_of(group))
            for group in masses.observables
        ]

    def _place(self, name: str) -> None:
        """Where the places and inner nodes of a member are in the undeformed scene."""
        model, system = self._model, self.system
        line, cuts, first = model.scene.center_lines[name], model.mesh.cuts[name], model.beams.first[name]
        for part in model.segments.parts:
            if part.member == name:
                for place, i in ((part.start, part.elements.start), (part.end, part.elements.stop)):
                    at = line.positions(np.array([cuts[i - first]]))[0]
                    self._rest[model.segments.place(place)] = at[: system.axes]
        mine = np.flatnonzero((system.inner_nodes[:, 0] >= first) & (system.inner_nodes[:, 0] < first + len(cuts) - 1))
        e, k = system.inner_nodes[mine].T
        x = cuts[e - first] + (cuts[e - first + 1] - cuts[e - first]) * model.element.nodes[k]
        self._rest[system.places + mine] = line.positions(x)[:, : system.axes]

    # -- of rates -------------------------------------------------------------------------------------

    def _linear(self, of_places: SparseMap, inner: Array, rates: Array) -> Array:
        """Weights times rates of positions (positions, axes)."""
        places = self.system.places
        on_places = np.stack([of_places @ column for column in rates[:places].T], axis=1)
        return np.concatenate([on_places, inner[:, None] * rates[places:]])

    def _split(self, rates: Array) -> tuple[Array, list[Array]]:
        system = self.system
        linear = rates[: system.linear].reshape(-1, system.axes)
        return linear, [rates[begin:end] for begin, end in system.ranges]

    def momenta(self, velocity: Array) -> tuple[Array, list[Array]]:
        """Mass times velocity: of the positions (positions, axes), and of each group of further quantities."""
        linear, others = self._split(velocity)
        groups = [group.mass.ravel() * rate for group, rate in zip(self._masses.observables, others, strict=True)]
        return self._linear(self._masses.places, self._inner, linear), groups

    def forces(self, velocity: Array, acceleration: Array) -> Array:
        """Inertia and damping forces, (quantities,): mass times acceleration plus damping times velocity."""
        system = self.system
        at_places = np.arange(system.places)
        drag = SparseMap(at_places, at_places, self._masses.place_drag, (system.places, system.places))
        linear, groups = self.momenta(acceleration)
        rates, others = self._split(velocity)
        linear = linear + self._linear(drag, self._inner_drag, rates)
        damped = [group.damping.ravel() * rate for group, rate in zip(self._masses.observables, others, strict=True)]
        forces = np.concatenate([linear.ravel(), *(a + b for a, b in zip(groups, damped, strict=True))])
        return forces if self._coriolis is None else forces + self._coriolis @ velocity

    def kinetic(self, velocity: Array) -> float:
        """Kinetic energy for velocities (quantities,), dimensionless."""
        linear, groups = self.momenta(velocity)
        rates, others = self._split(velocity)
        return 0.5 * float((linear * rates).sum() + sum(float(a @ b) for a, b in zip(groups, others, strict=True)))

    def momentum(self, x: Array, velocity: Array) -> tuple[Array, Array]:
        """Linear momentum and angular momentum about the centre of mass, (3,) each."""
        linear, groups = self.momenta(velocity)
        moved, others = self._split(x)
        positions = three(self._rest + moved)
        weights = self._linear(self._masses.places, self._inner, np.ones((len(positions), 1)))[:, 0]
        total = three(linear.sum(axis=0))
        first, mass = weights @ positions, float(weights.sum())
        angular = np.cross(positions, three(linear)).sum(axis=0)
        for group, value, momentum in zip(self._masses.observables, others, groups, strict=True):
            if not group.kind.vectors:
                continue
            count, kept = len(group.data), self.system.axes * group.kind.vectors
            parts = (part.reshape(count, -1)[:, :kept] for part in (value, momentum))
            vectors, its = (three(part.reshape(count, -1, self.system.axes)) for part in parts)
            if group.kind.from_place:
                placed = group.kind.from_place
                vectors = vectors.copy()
                vectors[:, :placed] += three(self._rest[group.places[:, :1]])
                own = group.mass[:, : self.system.axes * placed : self.system.axes]
                total, mass = total + its[:, :placed].sum(axis=(0, 1)), mass + own.sum()
                first = first + np.einsum("nk,nka->a", own, vectors[:, :placed])
            angular = angular + np.cross(vectors, its).sum(axis=(0, 1))
        return total, angular - np.cross(first / mass, total)

    # -- as loads ---------------------------------------------------------------------------------------

    def _felt(self, rates: Array, changes: Array) -> Array:
        """Accelerations (..., axes) of vectors with those of Coriolis, from their rates of the same shape."""
        crossing = self.system.crossing
        return changes if crossing is None else changes + rates @ crossing.T

    def _at_ends(self, rates: Array, felt: Array) -> Array:
        """Inertia and damping forces of the ends of elements, (elements, p + 1, axes), zero at inner nodes.

        Velocities and accelerations are those of the places, (places, axes).
        """
        masses = self._masses
        found = np.zeros((*masses.ends.shape, self.system.axes))
        for k, at in zip((0, -1), masses.at_ends.T, strict=True):
            found[:, k] = masses.ends[:, k, None] * felt[at] + masses.ends_drag[:, k, None] * rates[at]
        return found

    def _turning(self, q: Array, velocity: Array, acceleration: Array) -> Array:
        """Matrices (rotations, axes, axes) that give the accelerations of axes that turn with rotations from these."""
        system, found = self.system, np.zeros((len(q), self.system.axes, self.system.axes))
        for group, (begin, end) in zip(self._masses.observables, system.ranges, strict=True):
            if group.at is None:
                continue
            shape = len(group.data), group.kind.vectors, system.axes
            axes = quaternion.turned_by(q[group.turns], group.data.reshape(shape))
            rates, changes = (each[begin:end].reshape(shape) for each in (velocity, acceleration))
            changes = self._felt(rates, changes)
            if system.axes == 3:
                found[group.turns[:, 0]] = np.einsum("nia,nib->nab", changes, axes)
                continue
            (x, y), (u, v) = axes[:, 0].T, changes[:, 0].T
            along, across = x * u + y * v, x * v - y * u
            found[group.turns[:, 0]] = np.moveaxis(np.array([[along, -across], [across, along]]), 2, 0)
        return found

    def _without_flexible(self, couples: Array, moment: Array, couple: Array) -> None:
        """Take couples (elements, p + 1, turns) along flexible members from the ``moment`` (rotations, 3), and from the
        ``couple`` (places, 3) where they share a rotation with what is rigid, in place.
        """
        if not couples.any():
            return
        model, three_of = self._model, np.pad(couples, ((0, 0), (0, 0), (3 - couples.shape[2], 0)))
        turns = model.rotations.turns
        np.add.at(moment, turns, -three_of)
        told = {(int(turn), int(place)) for group in self._masses.observables if group.at is not None
                for turn, place in zip(group.turns[:, 0], group.at[:, 0], strict=True)}  # fmt: skip
        for name in model.members:
            part = model.elements_of(name)
            for i, element in ((0, part.start), (-1, part.stop - 1)):
                place = model.segments.place(model.segments.ends[name, -i])
                if (int(turns[element, i]), place) in told:
                    couple[place] -= three_of[element, i]

    def loading(
        self, equations: Equations, state: State, loading: Loading, velocity: Array, acceleration: Array
    ) -> Loading:
        """The loads at a state with the reversed inertia and damping forces added (d'Alembert).

        Velocities and accelerations are (quantities,).
        """
        system, model, forces = self.system, self._model, self.forces(velocity, acceleration)
        linear = -forces[: system.linear].reshape(-1, system.axes)
        on_places, inner = linear[: system.places], linear[system.places :]
        spread = np.zeros_like(loading.spread)
        spread[self._inside] = inner
        pull, carried_to = carried(spread, model.segments, model.element)
        # Places carry what is at the ends of elements, along which it is spread nevertheless.
        masses, (rates, changes) = self._masses, (self._split(each)[0] for each in (velocity, acceleration))
        felt = self._felt(rates, changes)[: system.places]
        spread -= self._at_ends(rates, felt)
        more = along_rigid(model, masses.rigid.mass, -felt)
        spread, pull = spread + more[0], pull + more[1]
        moment, own = np.zeros_like(loading.moment), on_places.copy()
        couple, jump = loading.couple.copy(), loading.jump.copy()
        along, torque = list[tuple[Index, Array, Array]](), np.zeros_like(loading.torque)
        places = equations.places(state, loading).reshape(system.places, system.axes)
        for group, batch, (begin, end) in zip(self._masses.observables, self._batches, system.ranges, strict=True):
            if group.along is not None:
                elements, arms = group.along
                along.append((elements, arms, -forces[begin:end].reshape(arms.shape)))
                continue
            shares = -batch(state.q, places, state.unwrapped, None, forces[begin:end])[3]
            width = system.turns
            if group.sections is not None and group.turns.shape[1]:
                torque[group.sections] += shares.reshape(len(shares), -1, width)
                continue
            for side, turns in enumerate(group.turns.T):
                used = turns >= 0
                part = shares[:, width * side : width * (side + 1)]
                three_of = np.zeros((len(part), 3))
                three_of[:, 3 - width :] = part
                np.add.at(moment, turns[used], three_of[used])
                put_moments(group.at, three_of, couple, jump)
            first = width * group.turns.shape[1]
            for side, at in enumerate(group.places.T):
                used, begin_of = at >= 0, first + system.axes * side
                np.add.at(own, at[used], shares[used, begin_of : begin_of + system.axes])
        loading = along_elements(model, state.q, loading, along)
        forces_on = -self._turning(state.q, velocity, acceleration)
        rigid, flexible = (
            couples_along(model, state.q, spins, forces_on) for spins in (masses.rigid.spins, masses.spins)
        )
        without_rigid(model, rigid, moment, jump)
        self._without_flexible(flexible, moment, couple)
        return replace(
            loading,
            force=loading.force + own + carried_to,
            own=loading.own + own,
            spread=loading.spread + spread,
            pull=loading.pull + pull,
            moment=loading.moment + moment,
            further=loading.further + moment,
            couple=couple,
            jump=jump,
            torque=loading.torque + rigid + flexible + torque,
            dampers=self._dampers(torque, forces),
        )

    def _dampers(self, torque: Array, forces: Array) -> Dampers | None:
        """What of the torque and of the forces (quantities,) is of dampers in sections."""
        model, weights = self._model, self._model.element.weights
        moment, scaled, strain = (np.zeros((*torque.shape[:2], 3)) for _ in range(3))
        if all(group.sections is None for group in self._masses.observables):
            return None
        for group, (begin, end) in zip(self._masses.observables, self.system.ranges, strict=True):
            rows, axes = forces[begin:end], self.system.axes
            if group.sections is None:
                continue
            if not group.turns.shape[1]:
                scaled.reshape(-1, 3)[group.sections, :axes] = rows.reshape(-1, axes)
                continue
            moments = rows.reshape(len(group.data), len(weights), -1) / weights[:, None]
            if model.space:
                frames = group.data[:, -9 * len(weights) :].reshape(*moments.shape, 3)
                moments = np.einsum("nki,nkia->nka", moments, frames)
            moment[group.sections] = np.pad(moments, ((0, 0), (0, 0), (3 - moments.shape[2], 0)))
        for name in model.members:
            part, chosen = model.elements_of(name), model.scene.center_lines[name].strained_axes(model.space)
            if scaled[part].any():
                strain[part][..., chosen] = scaled[part][..., : len(chosen)] * strain_units(model, name)
        return Dampers(torque, moment, strain)
