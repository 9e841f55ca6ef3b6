"""Terms of joints, springs and small members: constraints and energies of the rotations and places that they connect.

Each is a kind of :class:`~sfetcas.mechanics.terms.Term`: it depends only on its *sides*, rotations ``q`` since the
undeformed scene (an angle in the plane, a quaternion in space) and displacements ``u`` of places, and gives an energy,
or constraint rows, or both.  All data are dimensionless; vectors are in the fixed axes of the undeformed scene.  To add
a joint, write one class here and one row in ``tests/test_joints.py``; contact terms are in
:mod:`~sfetcas.mechanics.contact_joints`.

A ball needs no constraint, at a rigid joint both sides share one rotation, and in the plane a hinge needs no
constraint.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from .terms import Discrete, Side, Term

__all__ = [
    "Body",
    "DrivenSlide",
    "DrivenTurn",
    "Hinge",
    "LineSpring",
    "LineStop",
    "Slide",
    "Spring",
    "TurnSpring",
    "TurnStop",
    "Turning",
    "Universal",
]


def _dot(a: Side, b: Side) -> ca.SX:
    return ca.dot(ca.vertcat(*a), ca.vertcat(*b))


@final
@dataclass(frozen=True)
class Hinge(Term):
    """Constraint: two rotations differ about one axis only; data: two directions normal to the axis.  Space only."""

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Two rows."""
        return 2, 0, 2, 6, 0

    @property
    def discrete(self) -> Discrete:
        """Linear in the relative quaternion."""
        return "relative"

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Twice the components of ``conj(qa) qb`` across the axis."""
        across = ca.vertcat(*self.relative(*q)[1:])
        return [2.0 * ca.dot(data[3 * i : 3 * i + 3], across) for i in range(2)]


@final
@dataclass(frozen=True)
class Universal(Term):
    """Constraint: an axis of the first side stays normal to an axis of the second; data: both axes.  Space only."""

    supports: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 2, 0, 1, 6, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Cosine of the angle between the two axes."""
        a, b = ca.vertsplit(data[:3]), ca.vertsplit(data[3:])
        return [_dot(self.forth(q[0], a), self.forth(q[1], b))]


@final
@dataclass(frozen=True)
class DrivenTurn(Term):
    """Constraint: the angle between two rotations about an axis is prescribed; data: axis; load: angle, rad."""

    drives: ClassVar[str] = "angle"
    table: ClassVar[str] = "motions"
    answers: ClassVar[Mapping[str, str]] = {"moment": "N m"}

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 2, 0, 1, 3, 1

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The angle less the prescribed one; in space twice the sine of half this difference, which is smooth."""
        if not self.space:
            return [data[2] * (q[1][0] - q[0][0]) - load]
        r = self.relative(*q)
        about, half = ca.dot(data, ca.vertcat(*r[1:])), 0.5 * load
        return [2.0 * (ca.cos(half) * about - ca.sin(half) * r[0])]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The moment on the second side; in space the sign of the multiplier changes with each whole turn."""
        if not self.space:
            return [-lam]
        r, half = self.relative(*q), 0.5 * load
        return [-lam * ca.sign(ca.cos(half) * r[0] + ca.sin(half) * ca.dot(data, ca.vertcat(*r[1:])))]


@final
@dataclass(frozen=True)
class Slide(Term):
    """Constraint: a place moves along a line carried by a rotation at another one; data: directions across it."""

    one_sided: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row in the plane, two in space."""
        return 1, 2, self.axes - 1, self.axes * (self.axes - 1), 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Components of the relative displacement across the line, in the rotated axes of the first side."""
        gap = ca.vertcat(*self.back(q[0], [b - a for a, b in zip(*u, strict=True)]))
        n = self.axes
        return [ca.dot(data[n * i : n * i + n], gap) for i in range(n - 1)]


@final
@dataclass(frozen=True)
class DrivenSlide(Term):
    """Constraint: the displacement along the line of a slide is prescribed; data: direction; load: displacement."""

    drives: ClassVar[str] = "travel"
    table: ClassVar[str] = "motions"
    answers: ClassVar[Mapping[str, str]] = {"force": "N"}
    one_sided: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 1, 2, 1, self.axes, 1

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The displacement along the line less the prescribed one."""
        gap = ca.vertcat(*self.back(q[0], [b - a for a, b in zip(*u, strict=True)]))
        return [ca.dot(data, gap) - load]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The force on the second side along the line."""
        return [-lam]


@dataclass(frozen=True)
class Turning(Term):
    """Base class of terms of the angle of the second side against the first about an axis of the first; no places.

    Angles count turns: in the plane by themselves, in space by their distance from a reference value in the state.
    With ``r`` the relative quaternion the angle is twice ``atan2(axis.r, r_0)``, which is exact for a hinge.  At a
    universal joint the axis of the one side is normal to a direction ``c`` that the other carries, and the angle is
    that of ``c`` about the axis: then the moment is along the axis, and what is normal to both is left to the joint.

    Data: axis, at a universal joint ``c`` in the undeformed scene, then :attr:`own` numbers of the kind, in space last
    the reference value.

    Attributes
    ----------
    crossed : bool
        Whether it is at a universal joint.
    """

    crossed: bool = False

    one_sided: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def own(self) -> int:
        """Number of data of the kind itself."""

    @property
    def first(self) -> int:
        """Index at which the data of the kind itself begin."""
        return 6 if self.crossed else 3

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """No row."""
        return 2, 0, 0, self.first + self.own + self.space, 0

    def counted(self, data: Array) -> tuple[Array, Array] | None:
        """The axis (n, 3), and the direction ``c`` of a universal joint (n, 3), else zero; None in the plane."""
        axis = data[:, :3]
        return (axis, data[:, 3:6] if self.crossed else np.zeros(axis.shape)) if self.space else None

    def angle(self, q: list[Side], data: ca.SX) -> ca.SX:
        """The angle, rad."""
        axis = data[:3]
        r = self.relative(*q)
        if not self.space:
            return axis[2] * r[0]
        sine, cosine, share = ca.dot(axis, ca.vertcat(*r[1:])), r[0], 2.0
        if self.crossed:
            other = data[3:6]
            seen = ca.vertcat(*self.forth(r, ca.vertsplit(other)))
            sine, cosine, share = ca.dot(ca.cross(axis, other), seen), ca.dot(other, seen), 1.0
        unwrapped = data[self.first + self.own]
        c, s = ca.cos(unwrapped / share), ca.sin(unwrapped / share)
        return unwrapped + share * ca.atan2(sine * c - cosine * s, cosine * c + sine * s)


@final
@dataclass(frozen=True)
class TurnSpring(Turning):
    """A rotational spring about an axis of the first side; own data: stiffness, rest angle (rad)."""

    table: ClassVar[str] = "springs"
    answers: ClassVar[Mapping[str, str]] = {"angle": "rad", "moment": "N m"}

    @property
    def own(self) -> int:
        """Two: stiffness and rest angle."""
        return 2

    @property
    def discrete(self) -> Discrete:
        """Quadratic in the relative angle of the plane."""
        return "middle" if self.space else "relative"

    def travel(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """The angle, rad."""
        return self.angle(q, data)

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the stiffness times the squared angle from rest."""
        return 0.5 * data[self.first] * (self.angle(q, data) - data[self.first + 1]) ** 2

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The angle, and the moment on the second side."""
        angle = self.angle(q, data)
        return [angle, -data[self.first] * (angle - data[self.first + 1])]


@final
@dataclass(frozen=True)
class TurnStop(Turning):
    """Constraint: a rotational spring is at a stop; own data: angle of the stop, rad."""

    shares_row: ClassVar[bool] = True

    @property
    def own(self) -> int:
        """One: the angle of the stop."""
        return 1

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        turns, places, _, data, load = super().sizes
        return turns, places, 1, data, load

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The angle less that of the stop."""
        return [self.angle(q, data) - data[self.first]]


@final
@dataclass(frozen=True)
class LineStop(Term):
    """Constraint: a spring along a direction is at a stop; data: direction, displacement at the stop."""

    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One row."""
        return 0, 2, 1, self.axes + 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The displacement along the direction less that at the stop."""
        n = self.axes
        return [ca.dot(data[:n], ca.vertcat(*[b - a for a, b in zip(*u, strict=True)])) - data[n]]


@final
@dataclass(frozen=True)
class Spring(Term):
    """A spring between two places with a free length; data: vector between them, stiffness, free length."""

    table: ClassVar[str] = "springs"
    answers: ClassVar[Mapping[str, str]] = {"travel": "m", "force": "N"}

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """No row."""
        return 0, 2, 0, self.axes + 2, 0

    def travel(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """The elongation."""
        n = self.axes
        return ca.norm_2(data[:n] + ca.vertcat(*[b - a for a, b in zip(*u, strict=True)])) - data[n + 1]

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the stiffness times the squared elongation."""
        n = self.axes
        gap = data[:n] + ca.vertcat(*[b - a for a, b in zip(*u, strict=True)])
        return 0.5 * data[n] * self._square(gap, data[n + 1])

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The elongation, and the force on the second side, negative in tension."""
        travel = self.travel(q, u, data)
        return [travel, -data[self.axes] * travel]

    @staticmethod
    def _square(gap: ca.SX, free: ca.SX) -> ca.SX:
        """Square of the elongation; with a free length of zero it has no kink where the places meet."""
        square = ca.dot(gap, gap)
        # As a square, not as a sum that rounding leaves below zero at rest.
        longer = ca.sqrt(ca.if_else(free == 0.0, 1.0, square)) - free
        return ca.if_else(free == 0.0, square, longer**2)


@final
@dataclass(frozen=True)
class LineSpring(Term):
    """A spring that acts along a direction fixed in space; data: direction, stiffness, displacement at rest."""

    table: ClassVar[str] = "springs"
    answers: ClassVar[Mapping[str, str]] = {"travel": "m", "force": "N"}

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """No row."""
        return 0, 2, 0, self.axes + 2, 0

    def travel(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """Displacement of the second place relative to the first along the direction."""
        return ca.dot(data[: self.axes], ca.vertcat(*[b - a for a, b in zip(*u, strict=True)]))

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the stiffness times the squared displacement from rest."""
        n = self.axes
        return 0.5 * data[n] * (self.travel(q, u, data) - data[n + 1]) ** 2

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The displacement along the direction, and the force."""
        n, travel = self.axes, self.travel(q, u, data)
        return [travel, -data[n] * (travel - data[n + 1])]


@final
@dataclass(frozen=True)
class Body(Term):
    """A small member: a superelement with linear elasticity in a corotated frame, six (three) freedoms a node.

    The frame rotates with the mean of the nodal rotations.  The deformation ``e`` has for each node the displacement
    since the undeformed body relative to the first node, and the rotation relative to the frame, both in the axes of
    the frame.  The energy is ``1/2 e.K e``, and the constraint rows ``N e`` exclude deformations.  Loads along the body
    work on the rigid motion and on ``e``: ``-P.u_1 - tr(Q^T (R - I)) - tr(R^T T e)``.

    Data: positions of the nodes from the first one (nodes x axes), K (upper triangle by columns), N (rows x freedoms);
    load: P, Q, T.

    Attributes
    ----------
    nodes, stiff : int
        Number of nodes and of constraint rows.
    """

    table: ClassVar[str] = "members"
    answers: ClassVar[Mapping[str, str]] = {"energy": "J"}

    nodes: int
    stiff: int

    @property
    def freedoms(self) -> int:
        """Size of the deformation ``e``: 6 numbers a node in space, 3 in the plane."""
        return (self.axes + self.turns) * self.nodes

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Rotation and place of each node; a row for each excluded deformation."""
        n, axes = self.freedoms, self.axes
        data = self.nodes * axes + n * (n + 1) // 2 + self.stiff * n
        return self.nodes, self.nodes, self.stiff, data, axes + axes * axes + axes * axes * n

    def stiffest(self, data: Array) -> Array | None:
        """Largest entry of the stiffness matrix of each body, (n,)."""
        first = self.nodes * self.axes
        return np.asarray(np.abs(data[:, first : first + self.freedoms * (self.freedoms + 1) // 2]).max(axis=1))

    def frame(self, q: list[Side]) -> Side:
        """The rotation of the frame: the mean rotation of the nodes."""
        if not self.space:
            return [sum((side[0] for side in q), ca.SX(0)) / self.nodes]
        total = ca.vertcat(*q[0])
        for side in q[1:]:
            other = ca.vertcat(*side)
            total += ca.if_else(ca.dot(other, ca.vertcat(*q[0])) < 0.0, -1.0, 1.0) * other
        return ca.vertsplit(total / ca.norm_2(total))

    def deformation(self, q: list[Side], u: list[Side], rest: ca.SX) -> ca.SX:
        """The deformation ``e``: displacements, and twice the sines of half the rotations, in the axes of the frame."""
        frame, e = self.frame(q), []
        for i in range(self.nodes):
            d = ca.vertsplit(rest[self.axes * i : self.axes * (i + 1)])
            moved = self.back(frame, [u[i][k] - u[0][k] for k in range(self.axes)])
            e += [a + b for a, b in zip(moved, self.turned_back(frame, d), strict=True)]
            r = self.relative(frame, q[i])
            if self.space:
                sign = ca.if_else(r[0] < 0.0, -2.0, 2.0)
                e += [sign * component for component in r[1:]]
            else:
                e.append(2.0 * ca.sin(0.5 * r[0]))
        return ca.vertcat(*e)

    def _split(self, data: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        n, first = self.freedoms, self.nodes * self.axes
        upper = ca.SX(ca.Sparsity.upper(n), data[first : first + n * (n + 1) // 2])
        full = upper + upper.T - ca.diag(ca.diag(upper))
        return data[:first], full, ca.reshape(data[first + n * (n + 1) // 2 :], self.stiff, n)

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Elastic energy and potential of the loads along the body."""
        rest, stiffness, _ = self._split(data)
        e, axes, frame = self.deformation(q, u, rest), self.axes, self.frame(q)
        work = ca.dot(load[:axes], ca.vertcat(*u[0]))
        lever = ca.reshape(load[axes : axes + axes * axes], axes, axes)
        tensor = ca.reshape(load[axes + axes * axes :], axes * axes, self.freedoms)
        lever_now = lever + ca.reshape(ca.mtimes(tensor, e), axes, axes)
        for k in range(axes):
            unit = [ca.SX(float(k == i)) for i in range(axes)]
            work += ca.dot(lever_now[:, k], ca.vertcat(*self.forth(frame, unit))) - lever[k, k]
        return 0.5 * ca.dot(e, ca.mtimes(stiffness, e)) - work

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The strain energy."""
        return [self.energy(q, u, data, ca.SX.zeros(load.shape))]

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The deformations that are excluded, ``N e``."""
        rest, _, stiff = self._split(data)
        return ca.vertsplit(ca.mtimes(stiff, self.deformation(q, u, rest))) if self.stiff else []
