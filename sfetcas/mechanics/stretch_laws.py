"""Laws of stretch as terms: what their potentials are more, or less, than the quadratic one at rest.

An element has the compliance of its section at rest, and the scaled strain ``eta`` of each of its points the energy
``1/2 eta^2``.  Where the section has a law of stretch, a term at each point adds

    weight length d(epsilon),    d(epsilon) = W(epsilon) - 1/2 EA epsilon^2,    epsilon = eta / (weight length EA)^1/2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..description.stretch_laws import StretchLaw
from ..mathematics.arrays import Array, numbers
from ..mathematics.forms import Form
from ..mathematics.potentials import derivatives_of, deviation
from .laws import solved
from .parts import Parts
from .terms import One, Side, Term

__all__ = ["AtPoint", "least_tangent", "strain_by_force", "stretch_law_of", "stretch_laws_in"]


@final
@dataclass(frozen=True)
class AtPoint(Term):
    """The deviation of a law of stretch from its stiffness at rest, at one point.

    Data: weight times length times the unit of energy; strain over its unit by the scaled strain; the numbers of the
    form.

    Attributes
    ----------
    form : Form
    """

    strains_member: ClassVar[bool] = True

    form: Form

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The place that holds the strains of the point."""
        return 0, 1, 0, 2 + self.form.size, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Of the strain along, which is the first."""
        return data[0] * deviation(self.form, ca.vertcat(data[1] * u[0][0], 0.0, 0.0), data[2:])


def stretch_law_of(scene: Scene, member: str) -> StretchLaw | None:
    """The law of stretch of a member's section; None for linear ones, and members that have none."""
    name = scene.members[member].section
    return None if name is None else scene.sections[name].stretch_law


def stretch_laws_in(parts: Parts) -> Iterator[One]:
    """The terms at all points of elements whose sections have a law of stretch."""
    scene, scales, cuts = parts.scene, parts.scales, parts.mesh.cuts
    for name, first in parts.beams.first.items():
        law = stretch_law_of(scene, name)
        if law is None:
            continue
        x = cuts[name][:-1, None] + np.diff(cuts[name])[:, None] * parts.element.points
        count, size = x.shape
        compliance = scene.sections[str(scene.members[name].section)].compliance(x.ravel())[:, 0]
        values = law.values(1.0 / compliance)
        weight = parts.beams.weight[first : first + count].reshape(-1)
        scaled = np.sqrt(compliance * scales.force / weight) / values[:, 1]
        energy = weight * values[:, 0] * (scales.length / scales.moment)
        data = np.concatenate([np.stack([energy, scaled], axis=1), values[:, 2:]], axis=1)
        kind = AtPoint(parts.element.space, law.form)
        for i, place in enumerate(parts.segments.strains[first : first + count].ravel().tolist()):
            yield One(kind, name, "", numbers(data[i]), (), (place,), element=first + i // size)


# -- what a law says at given places ---------------------------------------------------------------------


def _stiffness_and_form(scene: Scene, member: str, x: Array) -> tuple[Array, Array, ca.Function]:
    """Matrices at rest (n, 3, 3), of the strain along alone, numbers (n, 2 + size), and the derivatives of the form."""
    law, section = stretch_law_of(scene, member), scene.sections[str(scene.members[member].section)]
    assert law is not None
    stiffness = 1.0 / section.compliance(x)[:, 0]
    rest = np.zeros((len(x), 3, 3))
    rest[:, 0, 0] = stiffness
    return rest, law.values(stiffness), derivatives_of(law.form)


def strain_by_force(scene: Scene, member: str, x: Array, force: Array, near: Array) -> Array:
    """Strains along (n,) at which a law of stretch gives axial forces (n,), N, at fractions x (n,).

    Newton's method from the strains ``near`` (n,), which are the answer where it does not lead to the forces.
    """
    wanted, start = (np.stack([part, 0.0 * part, 0.0 * part], axis=1) for part in (force, near))
    return solved(*_stiffness_and_form(scene, member, x), wanted, start, [0])[:, 0]


def least_tangent(scene: Scene, member: str, x: Array, strain: Array) -> Array:
    """Second derivatives (n,) of the potential over those at rest at strains (n,) along, at fractions x (n,)."""
    rest, values, derivatives = _stiffness_and_form(scene, member, x)
    wide = np.stack([strain, 0.0 * strain, 0.0 * strain], axis=1) / values[:, 1:2]
    hessian = derivatives.map(len(x))(wide.T, values[:, 2:].T)[2].full()[0, ::3]
    return np.asarray(1.0 + hessian * values[:, 0] / values[:, 1] ** 2 / rest[:, 0, 0])
