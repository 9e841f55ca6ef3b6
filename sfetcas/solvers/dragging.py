"""Drag towards a state: what moves slowly through something viscous, one implicit step after the other.

Each step minimises the energy plus half of ``drag * M`` times the square of the rotations since the state before, so
that a structure which falls goes downhill the way that drag lets it, whatever stops it there.  Step by step this is the
gradient flow of the energy, also known as pseudo-transient continuation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..mechanics.equations import Equations, Point, State
from .deflation import turned_between

__all__ = ["Drag"]


@dataclass(frozen=True)
class Drag:
    """Couples that resist rotations since a state.

    Attributes
    ----------
    equations : Equations
    since : State
    size : float
        Couple by rotation and by the weight of :attr:`Equations.mass`, in units of the model.
    """

    equations: Equations
    since: State
    size: float

    def __call__(self, state: State, point: Point) -> Point:
        """The point of the equations with drag."""
        equations, n = self.equations, self.equations.turning_unknowns
        couples = self.size * equations.mass * turned_between(equations, state, self.since)
        residual, entries, scale = point.residual.copy(), point.entries.copy(), point.scale.copy()
        residual[:n] += couples
        scale[:n] += abs(couples)
        entries[equations.diagonal[:n]] += self.size * equations.mass
        return replace(point, residual=residual, entries=entries, scale=scale)
