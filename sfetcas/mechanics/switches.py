"""Unilateral constraints with a switch: one model in which each of them is active or not by a number of its data.

The row of a constraint, a length or an angle less that at which it acts, gains an opening ``s``, ``gap - s = 0``, and a
row of its own

    a s + (1 - a) w = 0

with another displacement ``w`` that has a stiffness and nothing else.  With ``a = 1`` the opening is zero and the
multiplier of the gap is the reaction; with ``a = 0`` that is zero, as nothing else holds the opening, which then is the
gap.  Both are unknowns, so that a state tells all margins, and the matrix has as many negative eigenvalues as rows
either way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import numbers
from .connections import row_of
from .parts import Parts
from .segments import one_sided, switch_of
from .terms import One, Side, Term

__all__ = ["Opening", "Switch", "switches_in"]


@final
@dataclass(frozen=True)
class Opening(Term):
    """The opening of a unilateral constraint, the first displacement of a place, of which the second is idle."""

    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row."""
        return 0, 1, 1, 0, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the square of what is idle."""
        return 0.5 * u[0][1] ** 2

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Its share of the row of the constraint."""
        return [-u[0][0]]


@final
@dataclass(frozen=True)
class Switch(Term):
    """What says whether a unilateral constraint is active; data: 1 where it is, else 0."""

    switches: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row, one number."""
        return 0, 1, 1, 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The opening of what is active, what is idle of what is not."""
        return [data[0] * u[0][0] + (1.0 - data[0]) * u[0][1]]


def switches_in(parts: Parts) -> Iterator[One]:
    """Terms of the switches of a mesh that has them: active ones."""
    for table, name, side in one_sided(parts.scene) if parts.mesh.switched else ():
        what = switch_of(table, name, side)
        place = (parts.segments.place(what),)
        nothing, active = numbers(np.zeros(0)), numbers(np.ones(1))
        space = parts.element.space
        yield One(Opening(space), what, "", nothing, (), place, row_of(table, name, side))
        yield One(Switch(space), what, "", active, (), place, what)
