"""Friction of tendons in their guides: a tension that changes along the way.

Where a tendon slides over a guide its tension changes by ``dT = -mu T |d tau|``, with the coefficient ``mu`` and the
angle ``|d tau|`` by which its unit tangent ``tau`` turns: falling from the pulled end on where it is pulled, rising
where it is released.  At an eyelet the angle is that between the neighbouring straight pieces; along an element it is
the integral of the curvature of the way, of the derivative of the polynomial through the tangents of its points.

Of a part the generalised forces are its tension times the derivative of its length with the tension held: what guides
take from the tendon by friction is then in them, and no energy gives it.  The tension behind a part, as a vector along
the way over that at the pulled end, is the displacement of a place at which nothing else is, from its value without
friction in the undeformed scene; the force on this place is what it misses to be that of the part.  So each part knows
of the next one alone.

Where the length is given, the tension at the pulled end is the first displacement of a further such place, on which the
force is what the way is too short: each part adds its share.  Of a tendon that stretches a part of the length ``l``
under the tension ``T`` has the free length ``l / (1 + T / EA)``, with ``EA`` stiffness times whole free length, and
the displacement of that place is the elongation ``e`` that the whole tendon would have under the tension ``T_0 = k e``
at the pulled end.  So without friction the length is the free length and ``e``.  Where a rod pushes, friction holds it
back the other way: ``dT = -mu |T| |d tau|``.

Source: Euler 1762 (Eytelwein's formula); Rao, Peyron, Lilge and Burgner-Kahrs 2021 for the ways.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics import interpolation
from ..mathematics.quaternion import product
from .tendon_terms import Routed, Strung
from .terms import Side, Term

__all__ = ["RigidPart", "Rubbing"]


@dataclass(frozen=True)
class _Link(Term):
    """A part of a tendon that rubs.

    Data: number of its piece, its own number from the pulled end on, coefficient with its sign, vectors of the tension
    before and behind it in the undeformed scene; of one that stretches stiffness and whole length there; then its own,
    of which the last but one is its length there.  Load: the tension at the pulled end, or the shortening.

    Attributes
    ----------
    first, last : bool
        Whether it begins at the pulled end, and whether it ends at the other one.
    given : bool
        Whether the length of the tendon is given, not its tension.
    elastic, pushes : bool
        Whether a tendon of given length stretches, and whether it may push.
    """

    table: ClassVar[str] = "tendons"

    first: bool
    last: bool
    given: bool
    elastic: bool
    pushes: bool

    @property
    def has_potential(self) -> bool:
        """False."""
        return False

    @property
    def proportional(self) -> bool:
        """False."""
        return False

    @property
    def _told(self) -> dict[str, str]:
        """What all parts answer, with the units."""
        behind = "far_tension" if self.last else "behind"
        return {"tension": "N", "length": "m", behind: "N", "piece": "1", "number": "1"}

    @property
    def _own(self) -> int:
        """Number of data before its own."""
        return 3 + 2 * self.axes + 2 * self.elastic

    @property
    def _further(self) -> int:
        """Number of places beside those of the part: tensions before and behind it, and what pulls."""
        return int(not self.first) + int(not self.last) + int(self.given)

    def _pulled(self, u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Tension at the pulled end."""
        if not self.given:
            return load
        if not self.elastic:
            return u[-1][0]
        return data[self._own - 2] * (u[-1][0] if self.pushes else ca.fmax(u[-1][0], 0.0))

    def _tension(self, pulled: ca.SX, share: ca.SX) -> ca.SX:
        """Tension where that of a tendon that is pulled, over that at the pulled end, is the share."""
        return ca.if_else(pulled < 0.0, pulled / share, pulled * share) if self.pushes else pulled * share

    def _entering(self, u: list[Side], data: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension before it over that at the pulled end, and the angle to the direction (axes,) in which it begins."""
        if self.first:
            return ca.SX(1), ca.SX(0)
        before = data[3 : 3 + self.axes] + ca.vertcat(*u[len(u) - self._further])
        tension = ca.norm_2(before)
        across = ca.cross(before, direction) if self.space else before[0] * direction[1] - before[1] * direction[0]
        across, along = across / tension, ca.dot(before, direction) / tension
        return tension, ca.atan2(_size(across), along)

    def _missing(self, u: list[Side], data: ca.SX, behind: ca.SX) -> list[ca.SX]:
        """Forces on the places that are tensions, where the tension behind it is the vector ``behind`` (axes,)."""
        found = [] if self.first else [ca.SX(0)] * self.axes
        if not self.last:
            rest = data[3 + self.axes : 3 + 2 * self.axes]
            found += ca.vertsplit(rest + ca.vertcat(*u[-2 if self.given else -1]) - behind)
        return found

    def _lacking(self, u: list[Side], data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> list[ca.SX]:
        """Force on the place that tells how it is pulled: how much free length of the tendon it has too little.

        From its lengths and tensions (points,).
        """
        if not self.given:
            return []
        lacking = data[data.shape[0] - 2] - ca.sum1(self._unstretched(data, load, lengths, tensions))
        if not self.first:
            return [lacking, *[ca.SX(0)] * (self.axes - 1)]
        lacking -= load
        if self.elastic and not self.pushes:
            # Slack, by so much.
            lacking += ca.fmin(u[-1][0], 0.0)
        return [lacking, *u[-1][1:]]

    def _unstretched(self, data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> ca.SX:
        """Free lengths (points,) of the tendon in it, from its lengths and tensions (points,)."""
        return lengths / (1.0 + tensions / self._rigidity(data, load)) if self.elastic else lengths

    def _rigidity(self, data: ca.SX, load: ca.SX) -> ca.SX:
        """Stiffness of an elastic tendon times its free length."""
        return data[self._own - 2] * (data[self._own - 1] - load)

    def _kept(self, data: ca.SX, load: ca.SX, lengths: ca.SX, tensions: ca.SX) -> ca.SX:
        """Energy of an elastic tendon in it, from its lengths and tensions (points,)."""
        if not self.elastic:
            return ca.SX(0)
        free = self._unstretched(data, load, lengths, tensions)
        return 0.5 * ca.dot(free, tensions**2) / self._rigidity(data, load)


def _size(vector: ca.SX) -> ca.SX:
    """Length of a vector, less :data:`SMOOTH` where it is longer: with a derivative everywhere."""
    return ca.sqrt(ca.sumsqr(vector) + SMOOTH**2) - SMOOTH


SMOOTH = 1e-10
"""Angle, rad, below which the friction of a turn grows with its square: else a straight way would have no derivative.

So much of a turn is lost at most, which changes a tension by this times the coefficient of friction."""


@final
@dataclass(frozen=True)
class Rubbing(_Link):
    """A straight piece, or what is along an element, with friction where it begins and within it.

    Attributes
    ----------
    part : Routed or Strung
        The same without friction, whose data are its own.
    backwards : bool
        Whether it goes against the direction of the element.
    """

    part: Routed | Strung
    backwards: bool

    @property
    def along_element(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.along_element

    @property
    def one_sided(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.one_sided

    @property
    def apart(self) -> bool:  # type: ignore[override]
        """As of the part."""
        return self.part.apart

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The sides of the part, the tensions before and behind it, and what pulls."""
        turns, places, _, data, _ = self.part.sizes
        return turns, places + self._further, 0, self._own + data, 1

    @property
    def points(self) -> int:
        """Number of vectors along it: points of the element, or one."""
        return self.part.sizes[0] if self.along_element else 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tensions of its points."""
        return self._told | {f"tension at point {k}": "N" for k in range(self.points)}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Lengths and tensions (points,) along it; the tension behind it over that at the pulled end."""
        vectors = self.part.along(q, u[: len(u) - self._further], data[self._own :])
        lengths = [ca.norm_2(vector) for vector in vectors]
        sign = -1.0 if self.backwards else 1.0
        ways = [sign * vector / length for vector, length in zip(vectors, lengths, strict=True)]
        within = ca.SX(1, 1)
        if self.along_element:
            ways = [ca.vertcat(*self.forth(q[k], ca.vertsplit(way))) for k, way in enumerate(ways)]
            within = self._turned(ca.horzcat(*ways))
        begin, end = (-1, 0) if self.backwards else (0, -1)
        entering, angle = self._entering(u, data, ways[begin])
        shares = [entering * ca.exp(-data[2] * (angle + each)) for each in ca.vertsplit(within)]
        pulled = self._pulled(u, data, load)
        tensions = ca.vertcat(*[self._tension(pulled, share) for share in shares])
        return ca.vertcat(*lengths), tensions, shares[end] * ways[end]

    def _turned(self, ways: ca.SX) -> ca.SX:
        """Angles (points,) by which the way has turned since it began, from its directions (axes, points)."""
        nodes = interpolation.lobatto(self.points)[0]
        slopes = ca.mtimes(ways, ca.DM(interpolation.differentiation(nodes).T))
        # What is left of the slope across the way.
        across = [slopes[:, k] - ca.dot(slopes[:, k], ways[:, k]) * ways[:, k] for k in range(self.points)]
        rates = ca.vertcat(*[_size(each) for each in across])
        since = interpolation.integration(nodes, nodes)
        return ca.mtimes(ca.DM(since[-1] - since if self.backwards else since), rates)

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Tensions times the derivatives of the lengths; on its tensions what they miss, and the length it lacks."""
        lengths, tensions, behind = self._now(q, u, data, load)
        still = ca.SX.sym("still", self.points)
        own = u[: len(u) - self._further]
        sides = ca.vertcat(*[ca.vertcat(*side) for side in (*q, *own)])
        gradient = ca.substitute(ca.gradient(ca.dot(still, lengths), sides), still, tensions)
        found, width = [], self.components
        for i, side in enumerate(q):
            by_q = gradient[width * i : width * (i + 1)]
            if self.space:
                found += [0.5 * ca.dot(ca.vertcat(*product([0.0, *a], side)), by_q) for a in np.eye(3).tolist()]
            else:
                found.append(by_q)
        found += [*ca.vertsplit(gradient[width * len(q) :]), *self._missing(u, data, behind)]
        return [*found, *self._lacking(u, data, load, lengths, tensions)]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Tensions times the changes of the lengths, or of given length what it stores."""
        lengths, tensions, _ = self._now(q, u, data, load)
        if self.given:
            return self._kept(data, load, lengths, tensions)
        own, n = data[self._own :], self.axes
        rest = ca.vertcat(*[ca.norm_2(own[n * k : n * k + n]) for k in range(self.points)])
        return ca.dot(tensions, lengths - rest)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Energy of an elastic tendon."""
        lengths, tensions, _ = self._now(q, u, data, load)
        return self._kept(data, load, lengths, tensions)

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        lengths, tensions, behind = self._now(q, u, data, load)
        pulled = self._pulled(u, data, load)
        told = [pulled, ca.sum1(lengths), self._tension(pulled, ca.norm_2(behind)), data[0], data[1]]
        return [*told, *ca.vertsplit(tensions)]


@final
@dataclass(frozen=True)
class RigidPart(_Link):
    """A piece along a rigid member, with friction where it begins and within it.

    Own data: directions in which it begins and ends in the undeformed scene, the angle within; lengths of its points,
    and angles by which the way has turned there; the length, and zero.

    Attributes
    ----------
    points : int
        Points along it, of a tendon that stretches.
    """

    points: int

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotation of the member, the tensions before and behind it, and what pulls."""
        return 1, self._further, 0, self._own + 2 * self.axes + 3 + 2 * self.points, 1

    @property
    def answers(self) -> Mapping[str, str]:  # type: ignore[override]
        """Tension at the pulled end, length, tension behind it, its numbers, tension where it begins."""
        return self._told | {"tension at point 0": "N"}

    def _now(self, q: list[Side], u: list[Side], data: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Tension where it begins over that at the pulled end, and the vector of that behind it."""
        n, own = self.axes, data[self._own :]
        into, out = (ca.vertcat(*self.forth(q[0], ca.vertsplit(own[n * i : n * i + n]))) for i in range(2))
        share, angle = self._entering(u, data, into)
        share = share * ca.exp(-data[2] * angle)
        return share, share * ca.exp(-data[2] * own[2 * n]) * out

    def _along(self, u: list[Side], data: ca.SX, load: ca.SX, share: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Lengths and tensions (points,) along it; of what does not stretch the whole length alone."""
        pulled = self._pulled(u, data, load)
        if not self.points:
            return data[data.shape[0] - 2], self._tension(pulled, share)
        lengths, angles = ca.vertsplit(data[data.shape[0] - 2 - 2 * self.points : data.shape[0] - 2], self.points)
        tensions = [self._tension(pulled, share * ca.exp(-data[2] * angle)) for angle in ca.vertsplit(angles)]
        return lengths, ca.vertcat(*tensions)

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """None on the member; on its tensions what they miss, and the length it lacks."""
        share, behind = self._now(q, u, data)
        lacking = self._lacking(u, data, load, *self._along(u, data, load, share))
        return [*[ca.SX(0)] * self.turns, *self._missing(u, data, behind), *lacking]

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """What it stores."""
        return self.stored(q, u, data, load)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Energy of an elastic tendon."""
        return self._kept(data, load, *self._along(u, data, load, self._now(q, u, data)[0]))

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """As :attr:`answers`."""
        share, behind = self._now(q, u, data)
        pulled = self._pulled(u, data, load)
        at_ends = self._tension(pulled, ca.norm_2(behind)), self._tension(pulled, share)
        return [pulled, data[data.shape[0] - 2], at_ends[0], data[0], data[1], at_ends[1]]
