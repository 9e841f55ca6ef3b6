"""Inertia of small members as that of a few points and numbers, which the frame of the body and its deformation carry.

With ``u_1`` the displacement of the first node, R the frame and e the deformation (numbers of
:class:`~sfetcas.mechanics.joints.Body`) these are

    X_0 = u_1 + R (x_0 + B_0 e),      X_j = R (x_j + B_j e),      z = N e,

each with the whole mass of the body.  The first point is its centre and alone carries momentum.  The others have the
spread of the body along its principal axes, as far as it has any, and turn and strain as the body does; the squares of
the numbers sum up to what is left of the mass matrix.  So

    1/2 sum m |X_j'|^2 + 1/2 m |z'|^2 = 1/2 w.M w

for velocities w of the nodes seen from the frame, of any large motion as long as e is small, and with it come the
centrifugal forces on a body without deformation.  That these grow with the deformation is of the order of what a
linear elasticity leaves out; it is left out as well, beside what the points tell of it.

Source: ours; the points are a factor of the moments of :class:`~sfetcas.mechanics.body_masses.BodyMass`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array
from .body_masses import BodyMass
from .connections import freedoms
from .joints import Body
from .terms import Side, Term

__all__ = ["BodyPoints", "points_of"]


@final
@dataclass(frozen=True)
class BodyPoints(Term):
    """Points and numbers that carry the inertia of a small member, see the module.

    Data: positions of the nodes (nodes x axes), [x B] of each point, N, by columns; dimensionless.

    Attributes
    ----------
    nodes, points, numbers : int
        Number of nodes of the member, of points and of numbers.
    """

    nodes: int
    points: int
    numbers: int

    @property
    def vectors(self) -> int:
        """Number of points; only these have momentum."""
        return self.points

    @property
    def from_place(self) -> int:
        """The centre."""
        return 1

    @property
    def _body(self) -> Body:
        """Whose frame and deformation these are."""
        return Body(self.space, self.nodes, 0)

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The components of the points, and the numbers."""
        n = self._body.freedoms
        data = self.axes * (self.nodes + self.points * (1 + n)) + self.numbers * n
        return self.nodes, self.nodes, self.axes * self.points + self.numbers, data, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Displaced points, relative to the undeformed first node, then the numbers."""
        body, axes = self._body, self.axes
        frame, e = body.frame(q), body.deformation(q, u, data[: axes * self.nodes])
        carried, width, found = ca.vertcat(1.0, e), axes * (1 + e.numel()), []
        for j in range(self.points):
            begin = axes * self.nodes + j * width
            seen = ca.mtimes(ca.reshape(data[begin : begin + width], axes, 1 + e.numel()), carried)
            point = self.forth(frame, ca.vertsplit(seen))
            found += point if j else [a + b for a, b in zip(u[0], point, strict=True)]
        rows = ca.reshape(data[axes * self.nodes + self.points * width :], self.numbers, e.numel())
        return [*found, *(ca.vertsplit(ca.mtimes(rows, e)) if self.numbers else ())]


def points_of(name: str, body: BodyMass, space: bool, length: float) -> tuple[BodyPoints, Array]:
    """The points and numbers of a small member, and their data with the unit ``length`` (m).

    Raises
    ------
    SceneError
        Moments of inertia that no body has, as one that is more than the sum of the others.
    """
    n, chosen = (3 if space else 2), freedoms(len(body.rest), space)
    shift, shear = body.shift[:n, chosen], body.shear[:n, :n, chosen]
    at, by = [body.centre[:n]], [shift]
    values, axes = np.linalg.eigh(body.spread[:n, :n])
    # With their mass, points at these places have the spread.
    for value, axis in zip(np.sqrt(np.maximum(values, 0.0) / body.mass), axes.T, strict=True):
        if value**2 * body.mass > tolerances.RANK * values[-1]:
            at.append(value * axis)
            by.append(np.einsum("a,abk->bk", axis, shear) / (body.mass * value))
    size = float(np.abs(body.rest).max())
    rows, lowest = _factor(body.matrix[np.ix_(chosen, chosen)] / body.mass, by, np.where(chosen % 6 < 3, 1.0, size))
    if min(float(values[0]) / values[-1], lowest) < -1e-6:
        found = ", ".join(f"{m:.6g}" for m in np.sort(np.trace(body.spread) - np.linalg.eigvalsh(body.spread)))
        raise SceneError(
            f"found principal moments of inertia {found} kg m2, accepted: those of a body, none more than the sum of "
            "the others",
            ("members", name),
        )
    unit = np.where(chosen % 6 < 3, length, 1.0) / length
    points = [np.column_stack([x / length, b * unit]).T.ravel() for x, b in zip(at, by, strict=True)]
    data = np.concatenate([(body.rest[:, :n] / length).ravel(), *points, (rows * unit).T.ravel()])
    return BodyPoints(space, len(body.rest), len(at), len(rows)), data


def _factor(matrix: Array, taken: list[Array], unit: Array) -> tuple[Array, float]:
    """Rows whose squares are what is left of a mass matrix (m2), and its lowest eigenvalue by the largest."""
    left = (matrix - sum(b.T @ b for b in taken)) / unit[:, None] / unit
    largest = float(np.abs(matrix / unit[:, None] / unit).max())
    values, vectors = np.linalg.eigh(left)
    kept = values > tolerances.RANK * largest
    return (vectors[:, kept] * np.sqrt(values[kept])).T * unit, float(values[0]) / largest
