"""Displacements and rotations that belong to a small change of the unknowns: mode shapes of motions and of buckling."""

from __future__ import annotations

import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array
from .equations import Equations, State
from .fields import Fields
from .loading import Loading
from .model import Model

__all__ = ["STEP", "Displacements"]

STEP = 1e-5
"""Step of the central difference that turns changes into displacements; its relative error is the step squared."""


class Displacements:
    """What nodes and members do, to first order, where the unknowns of a state change.

    Parameters
    ----------
    equations : Equations
    state : State
    loading : Loading
    change : ndarray (unknowns,)
        Change of the unknowns, dimensionless; rotations in rad.
    """

    def __init__(self, equations: Equations, state: State, loading: Loading, change: Array) -> None:
        self._equations, self._change = equations, change
        size = float(np.abs(change).max(initial=0.0)) or 1.0
        step = np.zeros(equations.total)
        step[: equations.unknowns] = STEP / size * change
        self._ahead, self._behind = (
            Fields(equations, equations.moved(state, sign * step), loading) for sign in (1.0, -1.0)
        )
        self._scale = size / (2.0 * STEP)

    @property
    def model(self) -> Model:
        """That of the state."""
        return self._equations.model

    @property
    def spins(self) -> Array:
        """Rotation vectors (rotations, components) of all rotations, rad."""
        return self._equations.spins(self._change)

    @property
    def turned(self) -> Array:
        """Changes of the tangents (elements, points, axes) times weights and lengths, dimensionless."""
        return np.asarray(self._scale * (self._ahead.turned - self._behind.turned))

    def position(self, node: str) -> Array:
        """Displacement of a node, (3,) m."""
        return np.asarray(self._scale * (self._ahead.position(node) - self._behind.position(node)))

    def rotation(self, node: str) -> Array | None:
        """Rotation vector of a node, (3,) rad; None for a node without a rotation of its own."""
        turn = self._equations.model.rotations.node_turn[node]
        if turn is None:
            return None
        vector = self.spins[turn]
        return np.concatenate([np.zeros(3 - len(vector)), vector])

    def along(self, member: str, at: Array) -> dict[str, Array]:
        """Displacements ``position`` (n, 3) m and ``rotation`` (n, 3) rad at fractions (n,) of a member's length."""
        (place, one), (beside, other) = (side.placed(member, at) for side in (self._ahead, self._behind))
        if self.model.space:
            turn = quaternion.rotation_vector(quaternion.multiply(one, quaternion.conjugate(other)))
        else:
            turn = np.pad(one - other, ((0, 0), (2, 0)))
        return {"position": self._scale * (place - beside), "rotation": self._scale * turn}
