"""Terms of contact with obstacles: constraints that keep places and sections on an obstacle, and penalty energies.

They are terms as joints are, see :mod:`~sfetcas.mechanics.joints`.  All data are dimensionless.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from .terms import Side, Term

__all__ = [
    "Along",
    "AlongRound",
    "Bent",
    "Facing",
    "OnEdge",
    "OnPlane",
    "OnRound",
    "Sticking",
    "directions_along",
]

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


@final
@dataclass(frozen=True)
class OnEdge(Term):
    """Constraint: a section touches an edge; data: edge direction, undeformed tangent, edge to place, side.

    The gap is measured across the edge and the tangent of the section.  It is the distance where the place is the one
    nearest to the edge, and then the contact force acts at the place.
    """

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 1, 1, 1, 6 + self.axes + 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The gap."""
        tangent = ca.vertcat(*self.forth(q[0], ca.vertsplit(data[3 : 3 + self.axes])))
        tangent = tangent if self.space else ca.vertcat(tangent, 0.0)
        across = ca.cross(data[:3], tangent)
        across = data[6 + self.axes] * across / ca.norm_2(across)
        return [ca.dot(across[: self.axes], ca.vertcat(*u[0]) + data[6 : 6 + self.axes])]


@final
@dataclass(frozen=True)
class Along(Term):
    """Constraint: the tangent of a section lies in a plane; data: normal of the plane, undeformed tangent."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 1, 0, 1, 2 * self.axes, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Sine of the angle to the plane."""
        n = self.axes
        return [ca.dot(data[:n], ca.vertcat(*self.forth(q[0], ca.vertsplit(data[n:]))))]


@final
@dataclass(frozen=True)
class AlongRound(Term):
    """Constraint: a section is tangential to a circle; data: centre to place, undeformed tangent.  Plane only."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 1, 1, 1, 2 * self.axes, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Sine of the angle to the tangent of the circle."""
        n = self.axes
        out = ca.vertcat(*u[0]) + data[:n]
        return [ca.dot(out, ca.vertcat(*self.forth(q[0], ca.vertsplit(data[n:])))) / ca.norm_2(out)]


@final
@dataclass(frozen=True)
class Bent(Term):
    """Constraint: the difference of two rotations, given by a circle between them; data: angle, rad.  Plane only."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 2, 0, 1, 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The difference of the angles less the given one."""
        return [q[1][0] - q[0][0] - data]
