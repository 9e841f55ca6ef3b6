"""Quantities of a model whose rates carry inertia or are damped, as functions of its rotations and displacements.

Inertia and damping forces of a model are those of quantities ``X(q, u)``: positions, axes of sections, strains.
With a constant weight for each, ``T = 1/2 sum m X'.X'`` and the dissipation is ``1/2 sum c X'.X'``; what they ask of
rotations and displacements is ``J^T (m X'' + c X')`` with the Jacobian ``J`` of X.  Rotary inertia is that of section
axes ``d_i = R(q) b_i``: with the moments of inertia ``j_i`` about them

    1/2 omega.J omega = 1/2 sum rho_i |d_i'|^2,      rho_1 = (j_2 + j_3 - j_1) / 2, ...

so that every mass is constant and rotations are mere coordinates, with or without inertia of their own.

A quantity is a :class:`~sfetcas.mechanics.terms.Term` whose rows need not vanish: the same derivatives serve.

Source: Betsch and Steinmann 2001 (directors have a constant mass); the use for beams without inertia is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from .terms import Discrete, Side, Term

__all__ = ["Axes", "SpringTravel", "Strains", "Stretches"]


@final
@dataclass(frozen=True)
class Axes(Term):
    """Three directions (in the plane one) that turn with a rotation; data: the directions in the undeformed scene."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation; a row for each component of the directions."""
        n = 9 if self.space else 2
        return 1, 0, n, n, 0

    @property
    def discrete(self) -> Discrete:
        """``ends``: they turn with the side."""
        return "ends"

    @property
    def vectors(self) -> int:
        """Number of directions."""
        return self.sizes[2] // self.axes

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The rotated directions."""
        n = self.axes
        directions = [ca.vertsplit(data[n * i : n * i + n]) for i in range(data.numel() // n)]
        return [component for d in directions for component in self.forth(q[0], d)]


@final
@dataclass(frozen=True)
class Strains(Term):
    """Twist and bending times the length at the nodes of an element, about the axes of the sections.

    Kelvin-Voigt damping acts on their rates.  Data: derivatives of the interpolation by xi; in space the axes b1, b2,
    b3 of the section at each node, undeformed.

    Attributes
    ----------
    nodes : int
        Nodes of the element.
    """

    nodes: int

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation at each node; at each node three rows, in the plane one."""
        data = self.nodes * (self.nodes + (9 if self.space else 0))
        return self.nodes, 0, self.turns * self.nodes, data, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Twice the vector part of ``conj(q) q'``, or the derivative of the angle."""
        n = self.nodes
        slopes = ca.mtimes(ca.horzcat(*[ca.vertcat(*side) for side in q]), ca.reshape(data[: n * n], n, n))
        if not self.space:
            return ca.horzsplit(slopes)
        found = []
        for k in range(n):
            spin = 2.0 * ca.vertcat(*self.relative(q[k], ca.vertsplit(slopes[:, k]))[1:])
            axes = data[n * n + 9 * k : n * n + 9 * k + 9]
            found += [ca.dot(axes[3 * i : 3 * i + 3], spin) for i in range(3)]
        return found


@final
@dataclass(frozen=True)
class Stretches(Term):
    """The scaled strains of a point, or what of them has relaxed, whose rates a damper resists."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A place; a row for each component."""
        return 0, 1, self.axes, 0, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The strains themselves."""
        return u[0]


@final
@dataclass(frozen=True)
class SpringTravel(Term):
    """The angle or elongation of a spring, whose rate a damper parallel to it resists; data: as of the spring.

    Attributes
    ----------
    spring : Term
        The kind of the spring.
    """

    spring: Term

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        turns, places, _, data, _ = self.spring.sizes
        return turns, places, 1, data, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """As :meth:`.Term.travel` of the spring."""
        return [self.spring.travel(q, u, data)]
