"""Rotations from one state of a model to another; whole turns of parts without fixed rotation do not count."""

from __future__ import annotations

import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.keeping import kept
from ..mechanics.equations import Equations, State
from ..mechanics.model import Model
from ..mechanics.rotations import RotationFreedom

__all__ = ["free_parts", "turned_between"]


def turned_between(equations: Equations, here: State, there: State, *, near: bool = False) -> Array:
    """Rotations from ``there`` to ``here`` as values of the rotation unknowns, (rotation unknowns,) rad.

    Plane angles count turns, except of parts in which no rotation is fixed: a whole turn of such a part is no
    difference.  States that are ``near`` each other are none apart.
    """
    model = equations.model
    vectors = _rotation_vectors(model, here, there) if model.space else here.q - there.q
    if not model.space and not near:
        _without_whole_turns(model, vectors)
    between = np.zeros(equations.rotation_unknowns)
    used = equations.number >= 0
    between[equations.number[used]] = vectors[used]
    return between


def _without_whole_turns(model: Model, angles: Array) -> None:
    for part in free_parts(model):
        angles[part] -= 2.0 * np.pi * np.round(angles[part].mean() / (2.0 * np.pi))


def _rotation_vectors(model: Model, here: State, there: State) -> Array:
    vectors = quaternion.rotation_vector(quaternion.multiply(here.q, quaternion.conjugate(there.q)))
    # The one unknown of a rotation about a held axis is the angle about it.
    hinged = model.rotations.kind == RotationFreedom.AXIS
    vectors[hinged, 0] = (vectors * model.rotations.axis).sum(axis=1)[hinged]
    return vectors


@kept(1)
def free_parts(model: Model) -> tuple[Index, ...]:
    """Sets of rotations that elements connect, and of which none is fixed: the numbers (n,) of each set."""
    turns = model.rotations.turns
    label, before = np.arange(len(model.rotations.kind)), np.zeros(0)
    while not np.array_equal(label, before):
        before = label.copy()
        np.minimum.at(label, turns, np.broadcast_to(label[turns].min(axis=1)[:, None], turns.shape))
    fixed = set(label[model.rotations.kind == RotationFreedom.FIXED].tolist())
    return tuple(np.flatnonzero(label == part) for part in np.unique(label).tolist() if part not in fixed)
