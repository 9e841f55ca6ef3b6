"""How near an answer is: differences between meshes, and where a mesh is too coarse."""

from __future__ import annotations

import numpy as np

from ..mathematics import interpolation
from ..mathematics.arrays import Array
from .fields import Fields

__all__ = ["every_other", "largest_difference", "roughness"]


def largest_difference(coarse: Fields, fine: Fields) -> float:
    """Largest distance of positions at ends and middles of the coarse elements, over the size of the scene."""
    largest = 0.0
    for name, cuts in coarse.model.mesh.cuts.items():
        x = np.sort(np.concatenate([cuts, 0.5 * (cuts[1:] + cuts[:-1])]))
        a, b = (side.positions(name, x) for side in (coarse, fine))
        largest = max(largest, float(np.linalg.norm(a - b, axis=1).max()))
    return largest / coarse.model.scene.size


def roughness(fields: Fields) -> Array:
    """Highest Legendre coefficients of the rotations, rad, and of the reach over the scene's size, (elements,).

    Rotations count in full, since all that is beyond turns with them; turned tangents count with the length of
    the element.  Errors of the positions are about the square of these: elements are superconvergent.
    """
    model, element = fields.model, fields.model.element
    nodal = fields.q[model.rotations.turns]
    angles = np.linalg.norm(np.einsum("j,ejc->ec", interpolation.legendre_tail(element.nodes), nodal), axis=1)
    tangents = fields.turned / element.weights[:, None]
    tails = np.einsum("k,eka->ea", interpolation.legendre_tail(element.points), tangents)
    reach = np.linalg.norm(tails, axis=1) * model.scales.length / model.scene.size
    return np.asarray((2.0 if model.space else 1.0) * angles + reach)


def every_other(cuts: Array) -> Array:
    """Cuts of a mesh with half the elements."""
    return cuts if len(cuts) < 3 else np.unique(np.append(cuts[::2], cuts[-1]))
