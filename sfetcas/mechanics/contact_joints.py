"""Terms of contact with obstacles in motions: constraints that keep places on an obstacle, or where they stick.

They are terms as joints are, see :mod:`~sfetcas.mechanics.joints`.  All data are dimensionless.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from .terms import Side, Term

__all__ = ["Facing", "OnPlane", "OnRound", "Sticking", "directions_along"]

PUSHED = {f"force {axis}": "N" for axis in "xyz"}
"""What a place is told that lies on an obstacle."""

CENTRE = 1e-60
"""Added to the square of a distance, dimensionless: below rounding wherever the distance is not itself nothing."""


@dataclass(frozen=True)
class Facing(Term):
    """Constraint on a place as an obstacle sees it.

    Places: it, and the node that carries the obstacle, whose rotation is the side.  Data: those of the constraint; then
    where the place and the obstacle are in the undeformed scene, seen from the obstacle and from its node.

    Attributes
    ----------
    carried : bool
        Whether a node carries the obstacle.
    """

    carried: bool = False

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """Whether it turns the node that carries the obstacle."""
        return self.carried

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The place, and what carries the obstacle."""
        more = int(self.carried)
        return more, 1 + more, self.rows, self.own + 2 * self.axes * more, 0

    @property
    @abc.abstractmethod
    def rows(self) -> int:
        """Number of its rows."""

    @property
    @abc.abstractmethod
    def own(self) -> int:
        """Number of the data of the constraint."""

    @abc.abstractmethod
    def missed(self, u: Side, data: ca.SX) -> list[ca.SX]:
        """The rows for a displacement."""

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The force (3,) of the obstacle on the place, where there is one row."""
        if not self.answers:
            return []
        at = [ca.SX.sym("u", self.axes), *map(ca.vcat, u[1:])]
        row = ca.vcat(self.residual(q, [ca.vertsplit(one) for one in at], data, load))
        force = -lam * ca.substitute(ca.gradient(row, at[0]), at[0], ca.vcat(u[0]))
        return [*ca.vertsplit(force), *[ca.SX(0)] * (3 - self.axes)]

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The rows."""
        if not self.carried:
            return self.missed(u[0], data)
        n, begin, arm = self.axes, data[-2 * self.axes : -self.axes], data[-self.axes :]
        turned = ca.vertcat(*self.turned_forth(q[0], ca.vertsplit(arm)))
        moved = ca.vertcat(*u[0]) - ca.vertcat(*u[1]) - turned
        seen = moved + ca.vertcat(*self.turned_back(q[0], ca.vertsplit(begin + moved)))
        return self.missed(ca.vertsplit(seen), data[: data.shape[0] - 2 * n])


@final
@dataclass(frozen=True)
class OnPlane(Facing):
    """A place lies on a plane; data: unit normal, gap in the undeformed scene."""

    on_face: ClassVar[bool] = True
    answers: ClassVar[Mapping[str, str]] = PUSHED
    """The force of the obstacle, with its unit."""

    @property
    def rows(self) -> int:
        """One."""
        return 1

    @property
    def own(self) -> int:
        """Normal and gap."""
        return self.axes + 1

    def missed(self, u: Side, data: ca.SX) -> list[ca.SX]:
        """The gap."""
        return [_gap_of_plane(u, data)]


@final
@dataclass(frozen=True)
class OnRound(Facing):
    """A place lies on a circle, cylinder or sphere; data: projection, centre to place, radius, sign."""

    on_face: ClassVar[bool] = True
    answers: ClassVar[Mapping[str, str]] = PUSHED
    """The force of the obstacle, with its unit."""

    @property
    def rows(self) -> int:
        """One."""
        return 1

    @property
    def own(self) -> int:
        """Projection, centre to place, radius, sign."""
        return self.axes * self.axes + self.axes + 2

    def missed(self, u: Side, data: ca.SX) -> list[ca.SX]:
        """The gap."""
        return [_gap_of_round(u, data)]


@final
@dataclass(frozen=True)
class Sticking(Facing):
    """A place does not move along an obstacle; data: for each direction along it, a unit vector and the displacement
    that it keeps.
    """

    along_face: ClassVar[bool] = True

    @property
    def rows(self) -> int:
        """One in the plane, two in space."""
        return self.axes - 1

    @property
    def own(self) -> int:
        """A vector and a number for each row."""
        return (self.axes - 1) * (self.axes + 1)

    def missed(self, u: Side, data: ca.SX) -> list[ca.SX]:
        """How far it is from where it is to stay."""
        n = self.axes
        parts = [data[k * (n + 1) : (k + 1) * (n + 1)] for k in range(n - 1)]
        return [ca.dot(part[:n], ca.vertcat(*u)) - part[n] for part in parts]


def directions_along(normal: Array) -> Array:
    """Unit vectors (axes - 1, axes) across a unit normal (axes,) and each other."""
    if len(normal) == 2:
        return np.array([[-normal[1], normal[0]]])
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first = first / np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def _gap_of_plane(u: Side, data: ca.SX) -> ca.SX:
    return ca.dot(data[: len(u)], ca.vertcat(*u)) + data[len(u)]


def _gap_of_round(u: Side, data: ca.SX) -> ca.SX:
    n = len(u)
    out = ca.mtimes(ca.reshape(data[: n * n], n, n), ca.vertcat(*u) + data[n * n : n * n + n])
    # At the centre itself, where a bar across a bowl may be, the distance still has derivatives.
    distance = ca.sqrt(ca.sumsqr(out) + CENTRE)
    return data[n * n + n + 1] * (distance - data[n * n + n])
