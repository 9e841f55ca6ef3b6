"""CasADi functions of a single term evaluated numerically for all terms of a group at once."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from ..mathematics.kernels import Batch
from .elements import Element
from .model import Model
from .tables import Acting

__all__ = ["GroupBatch", "at_rest"]


def at_rest(element: Element, count: int) -> Array:
    """Rotations (count, components) of the undeformed scene: identity quaternions, or zero angles."""
    rest = np.zeros((count, element.components))
    rest[:, 0] = 1.0 if element.space else 0.0
    return rest


class GroupBatch:
    """A function (q, u, data, load, lam) of a single term, evaluated for all terms of a group.

    Parameters
    ----------
    model : Model
    group : Acting
        The rotations and places that the terms connect, and their data.
    function : Function
    angles : slice or ndarray, optional
        Numbers of the turn-counting angles that stand last in the data, see
        :class:`~sfetcas.mechanics.unwrapping.Unwrapping`.
    """

    def __init__(self, model: Model, group: Acting, function: ca.Function, angles: slice | Index | None = None) -> None:
        self._group, self._angles, self._data = group, angles, group.data.copy()
        self._batch = Batch(function, len(group.data))
        self._batch.set(2, self._data)
        # The ground is the last of the rotations and of the places.
        self._rest = at_rest(model.element, 1) if (group.turns < 0).any() else None
        self._still = np.zeros((1, model.element.axes)) if (group.places < 0).any() else None

    def __call__(
        self, q: Array, places: Array, unwrapped: Array, load: Array | None = None, lam: Array | None = None
    ) -> list[Array]:
        """Results at rotations, displacements (places, axes) and values near which angles are counted.

        They are overwritten by the next call.
        """
        group = self._group
        if group.turns.size:
            self._batch.set(0, (q if self._rest is None else np.vstack([q, self._rest]))[group.turns])
        if group.places.size:
            self._batch.set(1, (places if self._still is None else np.vstack([places, self._still]))[group.places])
        if self._angles is not None:
            self._data[:, -1] = unwrapped[self._angles]
            self._batch.set(2, self._data)
        for number, values in ((3, load), (4, lam)):
            if values is not None and values.size:
                self._batch.set(number, values)
        return self._batch()
