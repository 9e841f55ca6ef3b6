"""Motions along which an equilibrium stays one: a curve of equilibria is then one of many, and does not go along them.

A mesh resists such a motion a little where the structure does not, as a round ring of elements does that of its buckled
shape round it.  What is out of balance along the motion is then the mesh's share: it is left, and no step of Newton's
method goes along the motion.  From point to point of a curve the motion is found anew by one inverse iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array

__all__ = ["Neutral"]


@dataclass(frozen=True, eq=False)
class Neutral:
    """Motions of one state.

    Attributes
    ----------
    weighted : ndarray (total, motions)
        The rotation unknowns of the motions times their weight, zero elsewhere.
    motions : ndarray (total, motions)
        The same motions with the displacements and multipliers that belong to them; ``weighted.T @ motions`` is the
        unit matrix.
    """

    weighted: Array
    motions: Array

    @staticmethod
    def right(shapes: Array, weight: Array, total: int) -> Array:
        """Right sides (total, motions) for which the Newton matrix answers with the motions, near these shapes."""
        weighted = np.zeros((total, shapes.shape[1]))
        root = np.sqrt(weight)[:, None]
        columns, turn = np.linalg.qr(root * shapes)
        weighted[: len(weight)] = root * columns * np.where(np.diag(turn) < 0.0, -1.0, 1.0)
        return weighted

    @classmethod
    def answered(cls, weighted: Array, answer: Array, weight: Array) -> tuple[Neutral, Array]:
        """The motions from the answer of the Newton matrix to weighted shapes, and their eigenvalues."""
        compliance = weighted.T @ answer
        values = np.linalg.eigvals(np.linalg.inv(compliance))
        right = cls.right(answer[: len(weight)], weight, len(answer))
        return cls(right, answer @ np.linalg.inv(right.T @ answer)), values.real

    def moved(self, answer: Array) -> Neutral:
        """What stands still with the same weighted shapes at a state whose Newton matrix answers so to these."""
        return Neutral(self.weighted, answer @ np.linalg.inv(self.weighted.T @ answer))

    def without(self, step: Array) -> Array:
        """A step (total,) or several, (total, n), but for what goes along the motions."""
        return np.asarray(step - self.motions @ (self.weighted.T @ step))

    def balanced(self, residual: Array) -> Array:
        """What is out of balance (total,) but for the share along the motions."""
        return np.asarray(residual - self.weighted @ (self.motions.T @ residual))
