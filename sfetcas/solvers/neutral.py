"""Neutral motions: families of equilibria, as the buckled shape of a ring that can travel round it.

A curve of equilibria then is one of many, and does not go along such motions.  The mesh resists them a little where the
structure does not; the residual along them is this artefact of the mesh: it is ignored, and no step of Newton's method
goes along them.  From point to point of a curve the motions are updated by one inverse iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array

__all__ = ["Neutral"]


@dataclass(frozen=True, eq=False)
class Neutral:
    """Neutral motions of one state, dimensionless.

    Attributes
    ----------
    weighted : ndarray (total, motions)
        The rotation unknowns of the motions times their weight, zero elsewhere.
    motions : ndarray (total, motions)
        The motions with all unknowns, and with the rates of the multipliers; ``weighted.T @ motions`` is the identity.
    """

    weighted: Array
    motions: Array

    @staticmethod
    def right(shapes: Array, weight: Array, total: int) -> Array:
        """Right sides (total, motions) of an inverse iteration from shapes (rotation unknowns, motions).

        Weight times the shapes, orthonormalised in the weight; zero for displacements and rows.
        """
        weighted = np.zeros((total, shapes.shape[1]))
        root = np.sqrt(weight)[:, None]
        columns, turn = np.linalg.qr(root * shapes)
        weighted[: len(weight)] = root * columns * np.where(np.diag(turn) < 0.0, -1.0, 1.0)
        return weighted

    @classmethod
    def answered(cls, weighted: Array, answer: Array, weight: Array) -> tuple[Neutral, Array]:
        """The motions and their eigenvalues (motions,) from the solution for the right sides ``weighted``.

        ``answer`` (total, motions) is the solution with the Newton matrix.
        """
        compliance = weighted.T @ answer
        values = np.linalg.eigvals(np.linalg.inv(compliance))
        right = cls.right(answer[: len(weight)], weight, len(answer))
        return cls(right, answer @ np.linalg.inv(right.T @ answer)), values.real

    def moved(self, answer: Array) -> Neutral:
        """The motions at another state, from the solution (total, motions) of its matrix for ``weighted``."""
        return Neutral(self.weighted, answer @ np.linalg.inv(self.weighted.T @ answer))

    def without(self, step: Array) -> Array:
        """A step (total,), or several (total, n), without its part along the motions."""
        return np.asarray(step - self.motions @ (self.weighted.T @ step))

    def balanced(self, residual: Array) -> Array:
        """A residual (total,) without its part along the motions."""
        return np.asarray(residual - self.weighted @ (self.motions.T @ residual))
