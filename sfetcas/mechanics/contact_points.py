"""Points of contact between members as terms: where it is on both members are unknowns, the gap is a row.

With the arc lengths ``s`` and ``t`` of a point on the first and the second member, the vector ``d`` between the centre
lines is held by

    d = r_1(s) - r_2(t),      |d| - (radius_1 + radius_2) = 0,

and the multiplier of the second row is minus the contact force.  That the Lagrangian is stationary in ``s`` and ``t``
says that the force is normal to both members: there the distance is least.  The Lagrangian is largest in ``s`` and
``t``, not least: of all places it is the worst that must not penetrate.  Sums over elements as of
:mod:`~sfetcas.mechanics.rings`.

Source: Konyukhov and Izadi 2015, Introduction to Computational Contact Mechanics, chapter 11 (contact of curves).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array, numbers
from .mesh import ContactPoint
from .parts import Parts
from .rings import GuidedTerm, guided
from .terms import GROUND, One, Side, Term

__all__ = ["Apart", "Gap", "Meeting", "contact_points_in", "undeformed_distance"]


@final
@dataclass(frozen=True)
class Meeting(GuidedTerm):
    """The share of one element of the first or, with the opposite sign, the second member in the vector of a point."""

    table: ClassVar[str] = "contacts"


@final
@dataclass(frozen=True)
class Apart(Term):
    """The share of the vector itself and of the first nodes of both members.

    Places: the vector, the two nodes, the places on both members.
    """

    table: ClassVar[str] = "contacts"
    answers: ClassVar[Mapping[str, str]] = {
        "moved on first": "m",
        "moved on second": "m",
        **{f"force {axis}": "N" for axis in "xyz"},
    }
    shares_row: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Five places; no data."""
        return 0, 5, self.axes, 0, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """How far the vector has changed less what the starts of the members have moved."""
        return [between - first + second for between, first, second in zip(*u[:3], strict=True)]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """How far the point has moved along both members, and the force (3,) on the first one."""
        return [u[3][0], u[4][0], *ca.vertsplit(lam), *[ca.SX(0)] * (3 - self.axes)]


@final
@dataclass(frozen=True)
class Gap(Term):
    """Constraint: the surfaces of two members touch; data: the vector where the search begins, sum of the radii.

    Attributes
    ----------
    directed : bool
        Whether the distance is measured along a given normal, whose components are data before the others.
    """

    directed: bool

    table: ClassVar[str] = "contacts"
    answers: ClassVar[Mapping[str, str]] = {"push": "N"}

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row."""
        return 0, 1, 1, self.axes * (1 + self.directed) + 1, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The gap."""
        normal, begin, distance = ca.vertsplit(
            data, [0, self.axes * self.directed, self.axes * (1 + self.directed), data.numel()]
        )
        between = begin + ca.vertcat(*u[0])
        return [(ca.dot(normal, between) if self.directed else ca.norm_2(between)) - distance]

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The contact force, above zero where the members push each other."""
        return [-lam[0]]


def undeformed_distance(scene: Scene, point: ContactPoint) -> Array:
    """Vector (3,) from the second to the first undeformed centre line where a point begins, m."""
    lines = [scene.center_lines[member] for member in point.members]
    first, second = (line.positions(np.array([at]))[0] for line, at in zip(lines, point.at, strict=True))
    return np.asarray(first - second)


def contact_points_in(parts: Parts) -> Iterator[One]:
    """Terms of the points where members touch each other."""
    segments, unit, axes, space = parts.segments, parts.scales.length, parts.element.axes, parts.element.space
    for point in parts.mesh.points:
        between = segments.place(point.between)
        slides = [segments.place(point.place(i)) if point.slides[i] else GROUND for i in (0, 1)]
        starts = [segments.place(segments.ends[member, 0]) for member in point.members]
        yield One(Apart(space), point.name, "", np.zeros(0), (), (between, *starts, *slides), point.name)
        for side, member in enumerate(point.members):
            yield from guided(parts, Meeting, (point.name,) * 2, (member, point.at[side]), slides[side], side == 1)
        data = np.append(undeformed_distance(parts.scene, point)[:axes], point.distance) / unit
        normal = np.zeros(0) if point.normal is None else np.array(point.normal)[:axes]
        gap = Gap(space, point.normal is not None)
        yield One(gap, point.name, "", numbers(np.concatenate([normal, data])), (), (between,), f"{point.name}, gap")
