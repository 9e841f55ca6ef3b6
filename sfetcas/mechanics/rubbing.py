"""Coulomb friction where obstacles stop members in a motion: which places stick and slide, and the forces of those that
slide.

A place that sticks is held along the obstacle by rows of :class:`~sfetcas.mechanics.contact_joints.Sticking`, whose
multipliers are the friction.  On one that slides with the velocity ``v`` along the obstacle the force is

    - mu N d,      d = v / |v|,

with the multiplier of its gap as ``N``.  ``d`` follows from the *way* ``a`` along the obstacle that it was a little
earlier: with the shares ``v = s a + w``, ``w`` across ``a``, it is ``(a + w / s) / |a + w / s|``, in the plane ``a``.
This goes on smoothly where ``s`` falls through zero: steps may go beyond the end of sliding, where they are cut.

Displacements and velocities along a plane that motions displace are those relative to it.

Everything is dimensionless; ``m`` is the number of places that rub.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import cast

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from ..mathematics.constants import picked
from .contact_joints import Facing, directions_along
from .model import Model
from .terms import GROUND, name_of
from .unilateral import UnilateralRows

__all__ = ["STILL", "Rubbing", "Rubs", "Sliding", "rubbing_of", "sliding_term"]

STILL = 1e-6
"""Speed along an obstacle, dimensionless, up to which a place may begin to stick."""


@dataclass(frozen=True, eq=False)
class Rubs:
    """What the places that rub do; what does not touch neither sticks nor slides.

    Attributes
    ----------
    sticks, slides : ndarray (m,)
        1 or 0.
    holds : ndarray (m, axes - 1)
        Which rows hold those that stick, 1 or 0: not those that follow from others, as the second of two places on a
        rigid body, whose friction would be open.
    ways : ndarray (m, axes)
        Unit vectors in the direction of sliding, or of the last one.
    frames : ndarray (m, axes - 1, axes)
        Unit vectors along the obstacles where places stick or have begun to touch.
    held : ndarray (m, axes - 1)
        The displacements along them that places keep that stick.
    """

    sticks: Array
    slides: Array
    holds: Array
    ways: Array
    frames: Array
    held: Array

    @property
    def flat(self) -> Array:
        """All of it as one vector, as :meth:`Rubbing.parts` takes it apart."""
        return np.concatenate([self.slides, self.holds.ravel(), self.ways.ravel(), self.told.ravel()])

    @property
    def told(self) -> Array:
        """Where and along what places are held, (m, told)."""
        return np.concatenate([self.frames, self.held[:, :, None]], axis=2).reshape(len(self.sticks), -1)

    def drifted(self, u: Array) -> float:
        """How far displacements (m, axes) are at most from those that places keep that stick."""
        missed = np.einsum("mka,ma->mk", self.frames, u) - self.held
        return float(np.abs(missed * self.sticks[:, None]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Kind:
    """The places that rub on flat, or on round, obstacles: their numbers among all, and the data of their gaps."""

    kind: Facing
    members: Index
    data: Array


@dataclass(frozen=True, eq=False)
class Sliding:
    """Places that rub on obstacles of one kind, as terms of :func:`sliding_term`.

    Attributes
    ----------
    kind : Term
        The constraint of the gap.
    members : ndarray (n,)
        Their numbers among all that rub.
    turns : ndarray (n, 0)
    places : ndarray (n, 2)
        The place, and the one that carries the obstacle, -1 for none.
    data : ndarray (n, data)
        Those of the gap; then the coefficient where it slides, else zero, and the way.
    gaps : ndarray (n,)
        Numbers of the rows of the gaps.
    """

    kind: Facing
    members: Index
    turns: Index
    places: Index
    data: Array
    gaps: Index


class Rubbing:
    """The places of a model that rub on obstacles.

    Attributes
    ----------
    of : ndarray (m,)
        Their numbers among the unilateral rows.
    gaps : ndarray (m,)
        Numbers of the rows of their gaps.
    names : list of str
        Names of these rows.
    rows : ndarray (m, axes - 1)
        Numbers of the rows that hold them.
    places : ndarray (m,)
        Numbers of their places.
    carriers : ndarray (m,)
        Numbers of the places that carry the obstacles; -1 where these stay.
    turns : ndarray (m,)
        Numbers of their rotations.
    coefficients : ndarray (m,)
    groups : mapping of int to ndarray
        Groups of terms that hold them, and which of them.
    """

    def __init__(self, model: Model, unilateral: UnilateralRows) -> None:
        self.axes, self._model = model.element.axes, model
        parts = unilateral.parts
        self.of = np.array([i for i, part in enumerate(parts) if part.spot is not None and part.spot.rubs], np.intp)
        spots = [spot for spot in (parts[i].spot for i in self.of) if spot is not None]
        self.gaps, self.names = unilateral.rows[self.of], [spot.name for spot in spots]
        self.places = np.array([model.segments.place(spot.place) for spot in spots], np.intp)
        self.coefficients = np.array([model.scene.contacts[spot.contact].friction for spot in spots])
        first = len(model.positions.rows)
        numbers = range(1, len(model.terms))
        stops = [model.scene.obstacles[spot.contact] for spot in spots]
        self.carriers = np.array(
            [GROUND if stop.carrier is None else model.segments.place(stop.carrier) for stop in stops], np.intp
        )
        carriers = [stop.carrier for stop in stops]
        turns = [None if node is None else model.rotations.node_turn[node] for node in carriers]
        self.turns = np.array([GROUND if turn is None else turn for turn in turns], np.intp)
        starts = [model.scene.center_lines[spot.member].positions(np.array([spot.at]))[0] for spot in spots]
        bases = [np.zeros(3) if node is None else model.scene.nodes[node].position for node in carriers]
        self._arms = (np.array(starts) - np.array(bases))[:, : self.axes] / model.scales.length
        self.rows, self.groups = np.zeros((len(spots), self.axes - 1), np.intp), dict[int, Index]()
        for i in numbers:
            if model.terms[i].kind.along_face:
                # Beside the place it has that of what carries the obstacle.
                carried = model.terms[i].places.shape[1] > 1
                self.groups[i] = np.flatnonzero((self.carriers != GROUND) == carried)
                self.rows[self.groups[i]] = first + model.terms[i].labels
        # Each gap is a row of the group of flat or of round obstacles.
        self._kinds = []
        for i in numbers:
            group = model.terms[i]
            if not group.kind.on_face:
                continue
            labels = (first + group.labels).ravel()
            members = np.flatnonzero(np.isin(self.gaps, labels))
            own = np.array([int(np.flatnonzero(labels == row)[0]) for row in self.gaps[members]], np.intp)
            if len(members):
                self._kinds.append(_Kind(cast(Facing, group.kind), members, group.data[own]))

    def __len__(self) -> int:
        return len(self.of)

    @property
    def size(self) -> int:
        """Numbers that tell what they do, see :attr:`Rubs.flat`."""
        return len(self) * (2 * self.axes + self.told)

    @property
    def told(self) -> int:
        """Numbers of one place that tell where and along what it is held."""
        return (self.axes - 1) * (self.axes + 1)

    def parts(self, flat: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """The parts of :attr:`Rubs.flat`.

        ``slides`` (m,), ``holds`` (m * (axes - 1),), ``ways`` (axes, m), and (told, m) where and along what places are
        held.
        """
        m = len(self)
        slides, holds, ways, told = ca.vertsplit(flat, [0, m, self.axes * m, 2 * self.axes * m, self.size])
        return slides, holds, ca.reshape(ways, self.axes, m), ca.reshape(told, self.told, m)

    # -- numbers ----------------------------------------------------------------------------------------

    def displacements(self, y: Array, shift: Array | None = None) -> Array:
        """Displacements (m, axes) of the places for the displacement unknowns; no motion is prescribed to them.

        ``shift`` (places * axes,) are the prescribed displacements of other places, without which they are not those
        relative to obstacles that these carry; normals and directions on planes are the same.
        """
        found = (self._model.positions.Y @ y).reshape(-1, self.axes)[self.places]
        return np.asarray(found if shift is None else found - self._of_carriers(shift))

    def _of_carriers(self, x: Array) -> Array:
        """Those (m, axes) of what carries the obstacles, of displacements or velocities of all places."""
        each = x[: self.axes * len(self._model.segments.places)].reshape(-1, self.axes)
        return np.where(self.carriers[:, None] == GROUND, 0.0, each[self.carriers])

    def arms(self, y: Array, shift: Array) -> Array:
        """The places (m, axes) seen from the nodes that carry their obstacles; arguments of :meth:`displacements`."""
        return np.asarray(self._arms + self.displacements(y, shift))

    def of_quantities(self, x: Array) -> Array:
        """Positions or velocities (m, axes) of the places, relative to obstacles that move, among those of all
        quantities (quantities,).
        """
        each = x[: self.axes * len(self._model.segments.places)].reshape(-1, self.axes)
        return np.asarray(each[self.places] - self._of_carriers(x))

    def normals(self, u: Array) -> Array:
        """Unit normals (m, axes) of the obstacles for displacements (m, axes) of the places."""
        found = np.zeros((len(self), self.axes))
        for one in self._kinds:
            found[one.members] = np.array(_normal(one.kind)(u[one.members].T, one.data.T)).T
        return found

    def along(self, u: Array, velocities: Array) -> Array:
        """The shares (m, axes) of velocities (m, axes) of the places along the obstacles."""
        normals = self.normals(u)
        return np.asarray(velocities - (velocities * normals).sum(axis=1, keepdims=True) * normals)

    def idle(self, u: Array) -> Rubs:
        """Nothing sticks or slides; the frames are those at displacements (m, axes) of the places."""
        frames = np.array([directions_along(normal) for normal in self.normals(u)])
        held = np.einsum("mka,ma->mk", frames, u)
        nothing = np.zeros(len(self))
        return Rubs(nothing, nothing, 0.0 * held, frames[:, 0].copy(), frames, held)

    def directions(self, u: Array, velocities: Array, ways: Array) -> tuple[Array, Array]:
        """Directions of sliding (m, axes), and the speeds (m,) along the ways: below zero beyond the end of sliding."""
        found, speeds = np.zeros((len(self), self.axes)), np.zeros(len(self))
        for one in self._kinds:
            k = one.members
            given = u[k].T, one.data.T, ways[k].T, velocities[k].T
            d, s = (np.array(part) for part in _direction(one.kind)(*given))
            found[k], speeds[k] = d.T, s.ravel()
        return found, speeds

    def power(self, rubs: Rubs, u: Array, velocities: Array, lam: Array) -> float:
        """What friction takes away, of all places, by time, for the multipliers (rows,)."""
        d, _ = self.directions(u, velocities, rubs.ways)
        pushes = -lam[self.gaps] * rubs.slides
        return float(self.coefficients * pushes @ (d * velocities).sum(axis=1))

    # -- as terms ---------------------------------------------------------------------------------------

    def sliding(self) -> list[Sliding]:
        """The places as groups of terms."""
        nothing = np.zeros((len(self), self.axes + 1))
        return [
            Sliding(
                one.kind,
                one.members,
                np.zeros((len(one.members), 0), np.intp),
                np.stack([self.places[one.members], self.carriers[one.members]], axis=1),
                np.concatenate([one.data, nothing[one.members]], axis=1),
                self.gaps[one.members],
            )
            for one in self._kinds
        ]

    def sliding_of(self, rubs: Rubs) -> Array:
        """The last of their data, (m, 1 + axes)."""
        return np.concatenate([(self.coefficients * rubs.slides)[:, None], rubs.ways], axis=1)

    # -- expressions ------------------------------------------------------------------------------------

    def forces(self, places: ca.MX, lam: ca.MX, flat: ca.MX, rates: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """What sliding takes from the places, as a residual (axes, m), and its derivatives.

        By displacements (axes, axes * m), by the multipliers of the gaps (axes, m), and by velocities (axes, axes * m).

        Parameters
        ----------
        places, rates : MX (places * axes,)
            Displacements and velocities of all places.
        lam : MX (rows,)
        flat : MX
            :attr:`Rubs.flat`.
        """
        axes, m = self.axes, len(self)
        slides, _, ways, _ = self.parts(flat)
        own = (axes * self.places[:, None] + np.arange(axes)).ravel()
        u, v = (ca.reshape(picked(part, own), axes, m) for part in (places, rates))
        moving = np.flatnonzero(self.carriers != GROUND)
        if len(moving):
            its = (axes * self.carriers[moving][:, None] + np.arange(axes)).ravel()
            u, v = ca.MX(u), ca.MX(v)
            for part, every in ((u, places), (v, rates)):
                part[:, moving.tolist()] -= ca.reshape(picked(every, its), axes, len(moving))
        pushes = picked(lam, self.gaps)
        found = [ca.MX.zeros(axes, m), ca.MX.zeros(axes, axes * m), ca.MX.zeros(axes, m), ca.MX.zeros(axes, axes * m)]
        for one in self._kinds:
            k = one.members.tolist()
            weights = slides[k] * ca.DM(self.coefficients[one.members])
            given = u[:, k], ca.DM(one.data.T), pushes[k].T, weights.T, ways[:, k], v[:, k]
            wide = (axes * one.members[:, None] + np.arange(axes)).ravel().tolist()
            parts = _sliding(one.kind).map(len(k))(*given)
            for whole, part, columns in zip(found, parts, (k, wide, k, wide), strict=True):
                whole[:, columns] = part
        return found[0], found[1], found[2], found[3]


def rubbing_of(model: Model, unilateral: UnilateralRows) -> Rubbing | None:
    """The places of a model that rub on obstacles; None where there are none."""
    rubs = any(part.spot is not None and part.spot.rubs for part in unilateral.parts)
    return Rubbing(model, unilateral) if rubs else None


def _symbols(kind: Facing) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Displacement, data of the gap, way and velocity of a place."""
    axes = kind.axes
    return ca.SX.sym("u", axes), ca.SX.sym("data", kind.sizes[3]), ca.SX.sym("way", axes), ca.SX.sym("v", axes)


def _normal_of(kind: Facing, u: ca.SX, data: ca.SX) -> ca.SX:
    (gap,) = kind.missed(ca.vertsplit(u), data)
    return ca.gradient(gap, u)


@functools.cache
def _normal(kind: Facing) -> ca.Function:
    """``(u, data) ->`` unit normal of an obstacle."""
    u, data, _, _ = _symbols(kind)
    return ca.Function(f"normal_{name_of(kind)}", [u, data], [ca.densify(_normal_of(kind, u, data))])


def _direction_of(kind: Facing, u: ca.SX, data: ca.SX, way: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Direction of sliding, and the speed along the way."""
    normal = _normal_of(kind, u, data)
    along, v = way - ca.dot(normal, way) * normal, v - ca.dot(normal, v) * normal
    a = along / ca.sqrt(ca.sumsqr(along) + NOTHING)
    speed = ca.dot(v, a)
    if not kind.space:
        return a, speed
    # Beside the end of sliding, where both are rounding, it goes straight on.
    slope = (v - speed * a) * speed / (speed**2 + STRAIGHT**2)
    return (a + slope) / ca.sqrt(1.0 + ca.sumsqr(slope)), speed


@functools.cache
def _direction(kind: Facing) -> ca.Function:
    """``(u, data, way, v) ->`` direction of sliding, and the speed along the way."""
    symbols = _symbols(kind)
    found = [ca.densify(part) for part in _direction_of(kind, *symbols)]
    return ca.Function(f"direction_{name_of(kind)}", list(symbols), found)


@functools.cache
def _sliding(kind: Facing) -> ca.Function:
    """``(u, data, lam, weight, way, v) ->`` residual of the force of friction on a place; its derivatives by u, lam, v.

    ``weight`` is the coefficient where it slides, else zero.
    """
    u, data, way, v = _symbols(kind)
    lam, weight = ca.SX.sym("lam"), ca.SX.sym("weight")
    direction, _ = _direction_of(kind, u, data, way, v)
    # The push of the obstacle is minus the multiplier.
    residual = -weight * lam * direction
    found = [residual, *(ca.jacobian(residual, part) for part in (u, lam, v))]
    arguments = [u, data, lam, weight, way, v]
    return ca.Function(f"sliding_{name_of(kind)}", arguments, [ca.densify(x) for x in found], {"cse": True})


@functools.cache
def sliding_term(kind: Facing) -> ca.Function:
    """``(u, data, v, lam) ->`` residual of the force of friction on a place; its derivatives by the place, lam, and v.

    ``data`` are those of :class:`Sliding`, ``u`` (axes, 2) displacements of the place and of what carries the obstacle,
    ``v`` is the velocity relative to it.
    """
    own, axes = kind.sizes[3], kind.axes
    u, data, lam = ca.SX.sym("u", axes, 2), ca.SX.sym("data", own + 1 + axes), ca.SX.sym("lam")
    v = ca.SX.sym("v", axes)
    found = _sliding(kind)(u[:, 0] - u[:, 1], data[:own], lam, data[own], data[own + 1 :], v)
    return ca.Function(f"sliding_term_{name_of(kind)}", [u, data, v, lam], list(found))


NOTHING = 1e-60
"""Added to the square of a length that may be zero where nothing slides."""

STRAIGHT = 1e-6
"""Speed, dimensionless, below which the direction of sliding no longer turns."""
