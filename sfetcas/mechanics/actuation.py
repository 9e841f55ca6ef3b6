"""Natural curvature and twist that grow with loads, as a term along the elements.

With ``kappa`` the change of curvature and twist since the undeformed scene, and ``k0`` what actuations add to the
natural one, the strain energy is

    1/2 (kappa - k0).C (kappa - k0) = 1/2 kappa.C kappa - kappa.C k0 + 1/2 k0.C k0.

The first part is that of the element.  The second is a term of its own, whose load is ``k0`` at the integration points;
the third has no derivative by the unknowns and is only reported.  The section moment ``C (kappa - k0)`` follows from
balance, as for every element.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers
from .elements import Element
from .mesh import within_elements
from .parts import Parts
from .terms import Discrete, One, Side, Term

__all__ = ["NaturalCurvature", "actuations_in", "points_of"]


@final
@dataclass(frozen=True)
class NaturalCurvature(Term):
    """What natural curvature and twist add to the strain energy of an element.

    Data: stiffnesses of the points, as of the element, and its length; load: natural curvature and twist at the points
    times the unit of length, about the fixed axes of the undeformed scene, in the plane about z.

    Attributes
    ----------
    element : Element
    """

    table: ClassVar[str] = "actuations"
    along_element: ClassVar[bool] = True
    strains_member: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element."""
        n = self.element.order + 1
        return n, 0, 0, n * self.element.stiffnesses + 1, n * self.turns

    @property
    def proportional(self) -> bool:
        """True: the part of the energy that rotations change is linear in the natural curvature."""
        return True

    @property
    def discrete(self) -> Discrete:
        """Linear in the curvature."""
        return "strains"

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus the elastic moment of the change of curvature times the natural curvature."""
        efforts, changes = self.efforts(data, load)[1], self.element.changes(q)
        return ca.dot(efforts, ca.horzcat(*changes))

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The energy of a member that is held straight against its natural curvature."""
        stiffness, natural = self._split(data, load)
        found = ca.SX(0)
        for k in range(natural.shape[1]):
            found += 0.5 * ca.dot(natural[:, k], ca.mtimes(self.element.section(stiffness[:, k]), natural[:, k]))
        return found

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """All of it: a member that is bent by its natural curvature stores nothing."""
        return self.energy(q, u, data, load) + self.work(q, u, data, load)

    def efforts(self, data: ca.SX, load: ca.SX) -> tuple[Any, ca.SX]:
        """The element, and minus the moments (turns, points) by which its natural curvature would be straightened."""
        stiffness, natural = self._split(data, load)
        columns = [-ca.mtimes(self.element.section(stiffness[:, k]), natural[:, k]) for k in range(natural.shape[1])]
        return self.element, ca.horzcat(*columns)

    def _split(self, data: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Stiffnesses, and natural curvatures times the length of the element, a column for each point."""
        n = self.element.order + 1
        return ca.reshape(data[:-1], self.element.stiffnesses, n), data[-1] * ca.reshape(load, self.turns, n)


def points_of(parts: Parts, member: str) -> Array:
    """Fractions (elements, points) of a member's length of its integration points."""
    cuts = parts.mesh.cuts[member]
    return within_elements(cuts, parts.element.points)


def actuations_in(parts: Parts) -> Iterator[One]:
    """One term for each element with natural curvature or twist, whatever gives it."""
    scene, element, turns = parts.scene, parts.element, parts.element.turns
    for member in dict.fromkeys(actuation.member for actuation in scene.actuations.values()):
        x, line, first = points_of(parts, member), scene.center_lines[member], parts.beams.first[member]
        frames = line.quaternions(x.ravel())
        found: dict[tuple[int, str | None], Any] = {}
        for actuation in scene.actuations.values():
            if actuation.member != member:
                continue
            natural = quaternion.rotate(frames, actuation.along(x.ravel()))[:, 3 - turns :] * parts.scales.length
            natural = natural.reshape(len(x), -1)
            for e in np.flatnonzero(actuation.inside(x.mean(axis=1))).tolist():
                key = e, actuation.history
                found[key] = found[key] + natural[e] if key in found else natural[e]
        for e in sorted({e for e, _ in found}):
            loads = {history: value for (at, history), value in found.items() if at == e}
            number = first + e
            data = np.concatenate([parts.beams.stiffness[number].ravel(), numbers([parts.beams.weight[number].sum()])])
            sides = tuple(parts.rotations.turns[number].tolist())
            yield One(
                NaturalCurvature(element.space, element),
                f"element {number}",
                "",
                data,
                sides,
                loads=loads,
                element=number,
            )
