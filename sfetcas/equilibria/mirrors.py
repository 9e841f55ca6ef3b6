"""Mirror images of states: symmetries of the undeformed centre lines map equilibria to candidates for further ones.

A reflection or half turn ``S`` of the undeformed centre lines onto themselves carries a member's places to those
of its image; a rotation vector ``r`` there becomes ``det(S) S r``.  Supports, stiffness and loads need not be
symmetric: images are starting points for Newton's method, not answers.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.fields import rotations_along
from ..mechanics.model import Model
from ..mechanics.rotations import RotationFreedom
from ..solvers.prepared import Solved

__all__ = ["Mirror", "has_twin", "mirrored", "mirrors"]

OTHER_STATE, STAYS = 1e-2, 1e-3
"""Rotations, rad, by which a mirror image differs from its state, and by which it may miss what is in balance."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A symmetry of the undeformed centre lines.

    Attributes
    ----------
    matrix : ndarray (3, 3)
        Orthogonal map of positions relative to the centre of the scene, dimensionless.
    images : mapping of str to (str, bool)
        For each member the member that is mapped onto it, and whether the two run in opposite directions.
    """

    matrix: Array
    images: dict[str, tuple[str, bool]]


def mirrors(model: Model) -> tuple[Mirror, ...]:
    """All symmetries of the undeformed centre lines about fixed axes and principal axes, without the identity."""
    x = np.linspace(0.0, 1.0, 9)
    places = {name: model.scene.center_lines[name].positions(x) for name in model.members}
    if not places:
        return ()
    cloud = np.vstack(list(places.values()))
    ends = 0.5 * (cloud.max(axis=0) + cloud.min(axis=0))
    found: list[Mirror] = []
    for middle in (cloud.mean(axis=0), ends):
        principal = np.linalg.eigh((cloud - middle).T @ (cloud - middle))[1]
        for axes, signs in itertools.product((np.eye(3), principal), itertools.product((1.0, -1.0), repeat=3)):
            matrix = axes @ np.diag(signs) @ axes.T
            in_plane = model.space or np.allclose(matrix[2], [0.0, 0.0, 1.0])
            known = any(np.allclose(matrix, other.matrix) for other in found)
            # The identity of a straight plane scene about its own line is a mirror: only the matrix counts.
            if not in_plane or known or np.allclose(matrix, np.eye(3)):
                continue
            images = _images(places, middle, matrix, tolerances.ALIKE * model.scene.size)
            if images is not None:
                found.append(Mirror(matrix, images))
    return tuple(found)


def has_twin(found: Solved) -> bool:
    """Whether a mirror image of an equilibrium is another equilibrium with the same energy."""
    prepared, loading = found.prepared, found.loading
    for mirror in mirrors(prepared.model):
        image = prepared.equations.holding(mirrored(prepared.model, found.state, mirror), loading)
        if prepared.distance(image, found.state) < OTHER_STATE:
            continue
        there = prepared.correct(image, loading)
        level = abs(there.point.potential - found.point.potential) <= tolerances.LEVEL * abs(found.point.potential)
        if there.converged and level and prepared.distance(there.state, image) < STAYS:
            return True
    return False


def _images(places: dict[str, Array], middle: Array, matrix: Array, near: float) -> dict[str, tuple[str, bool]] | None:
    images: dict[str, tuple[str, bool]] = {}
    for name, line in places.items():
        for other, source in places.items():
            image = middle + (source - middle) @ matrix.T
            for backwards in (False, True):
                if name not in images and np.abs((image[::-1] if backwards else image) - line).max() < near:
                    images[name] = other, backwards
    return images if len(images) == len(places) else None


def mirrored(model: Model, state: State, mirror: Mirror) -> State:
    """The mirror image of a state's rotations; prescribed rotations and multipliers are not mapped."""
    sign = float(np.linalg.det(mirror.matrix))
    q = state.q.copy()
    for name, (source, backwards) in mirror.images.items():
        x = model.along(name)
        values = rotations_along(model, state.q, source, 1.0 - x if backwards else x)
        if model.space:
            values = np.column_stack([values[:, 0], sign * values[:, 1:] @ mirror.matrix.T])
        else:
            values = sign * mirror.matrix[2, 2] * values
        q[model.chain(name)] = values
    if model.space:
        _onto_axes(model, q)
    nothing = {name: np.zeros_like(getattr(state, name)) for name in ("y", "lam", "unwrapped")}
    return replace(state, q=q, **nothing)


def _onto_axes(model: Model, q: Array) -> None:
    """Leave of rotations about held axes what is about these, in place: nothing else would bring them back."""
    about = np.flatnonzero(model.rotations.kind == RotationFreedom.AXIS)
    axis = model.rotations.axis[about]
    q[about, 1:] = (q[about, 1:] * axis).sum(axis=1, keepdims=True) * axis
    size = np.linalg.norm(q[about], axis=1, keepdims=True)
    q[about] = np.where(size > 0.0, q[about] / np.where(size > 0.0, size, 1.0), [1.0, 0.0, 0.0, 0.0])
