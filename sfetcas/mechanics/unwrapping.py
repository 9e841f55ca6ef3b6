"""Angles about axes in space that count turns.

A quaternion determines the angle of a hinge up to two turns, the direction of an axis up to one.  The missing turns are
part of the state: for each angle a reference value, updated with every step, and of all angles with the same rotation
the one nearest to it is taken.  So the energies of springs and the work of moments about hinges to the ground are
smooth at any number of turns.  In the plane rotations are angles, which count turns by themselves.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, numbers
from .loading import Loading
from .rotations import RotationFreedom
from .terms import GROUND, Group

__all__ = ["MISCOUNTED", "Unwrapping", "unwrapping_of"]

MISCOUNTED = 1e-6
"""Angle, rad, by which a counted angle may miss the one that a motion prescribes: they differ by turns or not."""


SWUNG = 1e-3
"""Cosine of half the swing of an axis below which the angle about it is not defined."""


@dataclass(frozen=True, eq=False)
class Unwrapping:
    """The angles of a model that count turns: of springs, stops and driven joints, and for moments about fixed axes.

    Attributes
    ----------
    sides : ndarray (n, 2)
        Numbers of the rotations, -1 for the ground; the angle is that of the second relative to the first.
    axis : ndarray (n, 3)
        Unit axis, carried by the first side.
    across : ndarray (n, 3)
        Direction carried by the second side whose angle about the axis it is, see
        :class:`~sfetcas.mechanics.joints.Turning`; zero for the angle of the rotation itself.
    parts : tuple of slice or None
        For each group of terms its angles; None where it has none.
    driven : tuple of (int, int, int, float)
        For angles that a driven joint prescribes: number of the angle, of group and term of the joint, and sign.
    names : tuple of str
        Description of each angle for messages.
    """

    sides: Index
    axis: Array
    across: Array
    parts: tuple[slice | None, ...]
    driven: tuple[tuple[int, int, int, float], ...]
    names: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of angles."""
        return len(self.sides)

    def angles(self, q: Array, unwrapped: Array) -> Array:
        """The angles (n,), rad, at q (rotations, 4): of all with the same rotation those nearest to ``unwrapped``."""
        if not self.count:
            return unwrapped
        sine, cosine, share = self._parts(q)
        raw = share * np.arctan2(sine, cosine)
        period = 2.0 * np.pi * share
        return np.asarray(raw + period * np.round((unwrapped - raw) / period))

    def _parts(self, q: Array) -> tuple[Array, Array, Array]:
        """Sines, cosines of the angles over the share, and the share, of :class:`~sfetcas.mechanics.joints.Turning`."""
        relative = q[self.sides[:, 1]]
        if not self._on_ground:
            q = np.vstack([q, [1.0, 0.0, 0.0, 0.0]])
            relative = quaternion.multiply(quaternion.conjugate(q[self.sides[:, 0]]), q[self.sides[:, 1]])
        sine, cosine = _dot(self.axis, relative[:, 1:]), relative[:, 0]
        if self._crossed.any():
            seen = quaternion.rotate(relative, self.across)
            sine = np.where(self._crossed, _dot(np.cross(self.axis, self.across), seen), sine)
            cosine = np.where(self._crossed, _dot(self.across, seen), cosine)
        return sine, cosine, self._share

    # Of a few angles in most scenes, and asked for at every step: what never changes is found once.

    @functools.cached_property
    def _on_ground(self) -> bool:
        """Whether the first sides are all the ground."""
        return bool((self.sides[:, 0] == GROUND).all() and (self.sides[:, 1] != GROUND).all())

    @functools.cached_property
    def _crossed(self) -> Array:
        return np.asarray(self.across.any(axis=1))

    @functools.cached_property
    def _share(self) -> Array:
        return np.where(self._crossed, 1.0, 2.0)

    def moved(self, q: Array, unwrapped: Array, turn: Array, there: Array) -> Array:
        """The angles (n,), rad, after ``q`` has changed by vectors ``turn`` (rotations, 3), rad, to ``there``."""
        if not self.count:
            return unwrapped
        if self._on_ground:
            gained = _dot(self.axis, turn[self.sides[:, 1]])
        else:
            turn, still = np.vstack([turn, np.zeros(3)]), np.vstack([q, [1.0, 0.0, 0.0, 0.0]])
            axis = quaternion.rotate(still[self.sides[:, 0]], self.axis)
            gained = _dot(axis, turn[self.sides[:, 1]] - turn[self.sides[:, 0]])
        return self.angles(there, self.angles(q, unwrapped) + gained)

    def held(self, kind: Index) -> Array:
        """Which of the angles (n,) prescribed rotations and driven joints determine."""
        held = np.asarray(np.append(kind == RotationFreedom.FIXED, True)[self.sides].all(axis=1))
        held[[angle for angle, *_ in self.driven]] = True
        return held

    def prescribed(self, kind: Index, loading: Loading) -> Array:
        """The angles (n,), rad, that prescribed rotations and driven joints determine; nan for all others."""
        if not self.count:
            return np.zeros(0)
        unwrapped = np.where(self.held(kind), self.of_vectors(loading.turn), np.nan)
        for angle, group, number, sign in self.driven:
            unwrapped[angle] = sign * float(loading.loads[group][number, 0])
        return unwrapped

    def of_vectors(self, turn: Array) -> Array:
        """The angles (n,), rad, where each rotation is by a vector ``turn`` (rotations, 3) about its fixed axis."""
        if not self.count:
            return np.zeros(0)
        turn = np.vstack([turn, np.zeros(3)])
        apart = turn[self.sides[:, 1]] - turn[self.sides[:, 0]]
        return np.asarray(np.sign(_dot(self.axis, apart)) * np.linalg.norm(apart, axis=1))

    def doubt(self, q: Array, unwrapped: Array, loading: Loading) -> str | None:
        """A sentence on why an angle is undetermined at a state; None where all are determined.

        The angle of a driven joint differs from the prescribed one by whole turns, or the axis of a spring between
        freely rotating sides has swung by half a turn, where the rotation does not determine the angle about it.
        """
        if not self.count:
            return None
        found, (sine, cosine, _) = self.angles(q, unwrapped), self._parts(q)
        for angle in np.flatnonzero(np.hypot(sine, cosine) < SWUNG).tolist():
            return f"{self.names[angle]}: its axis has swung half round, where its angle is not defined"
        for angle, group, number, sign in self.driven:
            wanted = sign * float(loading.loads[group][number, 0])
            if abs(found[angle] - wanted) > MISCOUNTED:
                stands = f"{self.names[angle]} stands at {found[angle]:g} rad"
                return f"{stands} where its joint is driven to {wanted:g}"
        return None


def unwrapping_of(terms: tuple[Group, ...], space: bool) -> Unwrapping:
    """The angles of a model that count turns; none in the plane."""
    sides: list[tuple[int, int]] = []
    axis: list[Array] = []
    across: list[Array] = []
    parts: list[slice | None] = []
    names: list[str] = []
    for group in terms:
        counted = group.kind.counted(group.data)
        if counted is None:
            parts.append(None)
            continue
        parts.append(slice(len(sides), len(sides) + len(group.names)))
        names += group.names if group.kind.is_load else [f"springs.{name}" for name in group.names]
        sides += [(a, b) for a, b in group.turns.tolist()]
        axis += list(counted[0])
        across += list(counted[1])
    pairs = np.array(sides, dtype=np.intp).reshape(-1, 2)
    lines = numbers(axis).reshape(-1, 3)
    return Unwrapping(
        sides=pairs,
        axis=lines,
        across=numbers(across).reshape(-1, 3),
        parts=tuple(parts),
        driven=tuple(_driven(terms[1:], pairs, lines)) if space else (),
        names=tuple(names),
    )


def _driven(connections: tuple[Group, ...], sides: Index, axis: Array) -> list[tuple[int, int, int, float]]:
    """Angles between the sides of a driven joint about its axis."""
    found = []
    for number, group in enumerate(connections):
        if group.kind.drives != "angle":
            continue
        for i, (pair, about) in enumerate(zip(group.turns, group.data, strict=True)):
            for angle, (own, line) in enumerate(zip(sides, axis, strict=False)):
                if set(own) != set(pair) or np.linalg.norm(np.cross(line, about)) > tolerances.PARALLEL:
                    continue
                sign = float(np.sign(line @ about)) * (1.0 if own[0] == pair[0] else -1.0)
                found.append((angle, number, i, sign))
    return found


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))
