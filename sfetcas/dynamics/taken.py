"""What is passed from time step to time step, and what a step that was taken tells."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.rubbing import Rubs
from ..mechanics.unilateral import NONE, UnilateralRows
from .steps import LAST_CHANGE

__all__ = ["Before", "Memory", "Taken"]


@dataclass(frozen=True, eq=False)
class Before:
    """What the next step takes from the one before it, dimensionless; nothing of those before that.

    Attributes
    ----------
    h : float
        Its length.
    turns : ndarray (stages, rotations, turns)
        Rotation vectors since its begin.
    shifts : ndarray (stages, displacements)
        Changes of the displacements since its begin.
    x : ndarray (1 + stages, quantities)
        The quantities at its begin and its stages.
    velocity : ndarray (quantities,)
        Their rates at its begin.
    """

    h: float
    turns: Array
    shifts: Array
    x: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class Memory:
    """The state that is passed from step to step, dimensionless.

    Attributes
    ----------
    t : float
    q : ndarray (rotations, components)
        Quaternions or angles.
    y, lam : ndarray
        Displacement unknowns, multipliers.
    x : ndarray (quantities,)
        The quantities that carry mass or are damped, see :mod:`~sfetcas.mechanics.observed`.
    rates : ndarray (kept, quantities)
        Their rates that the method keeps, velocities first.
    unwrapped : ndarray
        Values of the angles that count turns.
    origin : tuple of ndarray
        Offsets of ``y`` and ``x``, moved along with a structure that flies far, so that no digits are lost.
    last : Before or None
        The step before; None after a restart.
    remembered : ndarray
        What members remember, see :class:`~sfetcas.mechanics.memory.Remembering`.
    acting : ndarray
        For each unilateral constraint of the system whether it acts, 1 or 0.
    held : ndarray
        The values of their rows at which those hold that act: next to zero, unless they began to act late.
    lost : float
        Energy lost in impacts, and by friction at obstacles, so far.
    rubs : Rubs or None
        What the places that rub on obstacles do; None where there are none.
    unilateral : UnilateralRows
        The constraints of ``acting``, which change where members come near to each other.
    """

    t: float
    q: Array
    y: Array
    lam: Array
    x: Array
    rates: Array
    unwrapped: Array
    origin: tuple[Array, Array] = (np.zeros(1), np.zeros(1))
    last: Before | None = None
    remembered: Array = field(default_factory=lambda: np.zeros(0))
    acting: Array = field(default_factory=lambda: np.zeros(0))
    held: Array = field(default_factory=lambda: np.zeros(0))
    lost: float = 0.0
    rubs: Rubs | None = None
    unilateral: UnilateralRows = NONE

    @property
    def position(self) -> Array:
        """The quantities without the offset of ``origin``, (quantities,)."""
        return self.x + self.origin[1]

    def moved(self, y: Array, x: Array) -> Memory:
        """The same state with the offsets of displacements and quantities increased by ``y`` and ``x``."""
        last = None if self.last is None else replace(self.last, x=self.last.x - x)
        return replace(self, y=self.y - y, x=self.x - x, origin=(self.origin[0] + y, self.origin[1] + x), last=last)


@dataclass(frozen=True, eq=False)
class Taken:
    """A time step that was taken, dimensionless.

    Attributes
    ----------
    begin, after : Memory
        The state before and after it.
    h : float
        Its length.
    places : ndarray (stages,)
        Positions of the stages in the step, as fractions of h; the last one is 1.
    turns : ndarray (stages, rotations, turns)
        Rotation vectors since its begin.
    shifts : ndarray (stages, displacements)
        Changes of the displacements since its begin.
    x : ndarray (stages, quantities)
    lam : ndarray (stages, multipliers)
    size : float
        Largest change in the last Newton iteration.
    iterations : int
    gap : float
        Largest gap of the constraints at its end.
    rubbed : ndarray (n,)
        What friction at obstacles has taken away since its begin at :attr:`rubbed_at`; empty where nothing rubs.
    """

    begin: Memory
    after: Memory
    h: float
    places: Array
    turns: Array
    shifts: Array
    x: Array
    lam: Array
    size: float
    iterations: int
    gap: float
    rubbed: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def rubbed_at(self) -> Array:
        """The stages as fractions of h; where there is but one also the middle."""
        return self.places if len(self.places) > 1 else np.array([0.5, 1.0])

    @property
    def converged(self) -> bool:
        """Whether Newton's method has converged in this step."""
        return self.size <= LAST_CHANGE
