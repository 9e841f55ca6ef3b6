"""Inertia of small members as that of a few points, which the frame of the body and its deformation carry.

With ``u_1`` the displacement of the first node, R the frame and e the deformation (numbers of
:class:`~sfetcas.mechanics.joints.Body`) the points are

    X_0 = u_1 + R (x_0 + B_0 e),      X_j = R (x_j + B_j e),

each with the whole mass of the body.  The first is its centre and alone carries momentum.  The next have the spread
of the body along its principal axes, as far as it has any, and turn and stretch as the body does; the last begin at
zero, and their squares sum up to what is left of the mass matrix.  So

    1/2 sum m |X_j'|^2 = 1/2 w.M w

for velocities w of the nodes seen from the frame, of any large motion as long as e is small, and with it come the
centrifugal forces on small deformations.  Those are quantities with constant masses, as all inertia here is.

Source: the decomposition is ours; it is the pivoted factor of the moments of :class:`~sfetcas.mechanics.body_masses`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.body_masses import SMALLEST, BodyMass
from ..mechanics.connections import freedoms
from ..mechanics.joints import Body, Connection, Side

__all__ = ["BodyPoints", "points_of"]


@final
@dataclass(frozen=True)
class BodyPoints(Connection):
    """Points of a small member; data: rest vectors (nodes x axes), then of each point x (axes) and B (by columns).

    Attributes
    ----------
    nodes, points : int
        Number of macro-nodes and of points.
    """

    nodes: int
    points: int

    @property
    def _body(self) -> Body:
        """Whose frame and deformation these are."""
        return Body(self.space, self.nodes, 0)

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The components of the points."""
        data = self.axes * (self.nodes + self.points * (1 + self._body.freedoms))
        return self.nodes, self.nodes, self.axes * self.points, data, 0

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The points as they are now, the first from the place of the first node in the undeformed scene."""
        body, n, first = self._body, self.axes, self.axes * self.nodes
        frame, e = body.frame(q), body.deformation(q, u, data[:first])
        found = []
        for j in range(self.points):
            given = ca.reshape(data[first + j * n * (1 + e.numel()) :][: n * (1 + e.numel())], n, 1 + e.numel())
            point = self.forth(frame, ca.vertsplit(ca.mtimes(given, ca.vertcat(1.0, e))))
            found += point if j else [a + b for a, b in zip(u[0], point, strict=True)]
        return found


def points_of(name: str, body: BodyMass, space: bool, length: float) -> tuple[BodyPoints, Array]:
    """The points of a small member, and their data with the unit ``length`` (m).

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
        if value**2 * body.mass > SMALLEST * values[-1]:
            at.append(value * axis)
            by.append(np.einsum("a,abk->bk", axis, shear) / (body.mass * value))
    size = float(np.abs(body.rest).max())
    rest, lowest = _factor(body.matrix[np.ix_(chosen, chosen)] / body.mass, by, np.where(chosen % 6 < 3, 1.0, size))
    if min(float(values[0]) / values[-1], lowest) < -1e-6:
        found = ", ".join(f"{m:.6g}" for m in np.sort(np.trace(body.spread) - np.linalg.eigvalsh(body.spread)))
        raise SceneError(
            f"found principal moments of inertia {found} kg m2, accepted: those of a body, none more than the sum of "
            "the others",
            ("members", name),
        )
    missing = -len(rest) % n
    by += list(np.vstack([rest, np.zeros((missing, len(chosen)))]).reshape(-1, n, len(chosen)))
    at += [np.zeros(n)] * (len(by) - len(at))
    unit = np.where(chosen % 6 < 3, length, 1.0) / length
    points = [np.column_stack([x / length, b * unit]).T.ravel() for x, b in zip(at, by, strict=True)]
    data = np.concatenate([(body.rest[:, :n] / length).ravel(), *points])
    return BodyPoints(space, len(body.rest), len(at)), data


def _factor(matrix: Array, taken: list[Array], unit: Array) -> tuple[Array, float]:
    """Rows whose squares are what is left of a mass matrix (m2), and its lowest eigenvalue by the largest."""
    left = (matrix - sum(b.T @ b for b in taken)) / unit[:, None] / unit
    largest = float(np.abs(matrix / unit[:, None] / unit).max())
    values, vectors = np.linalg.eigh(left)
    kept = values > SMALLEST * largest
    return (vectors[:, kept] * np.sqrt(values[kept])).T * unit, float(values[0]) / largest
