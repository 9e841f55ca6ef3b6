"""Error estimates by comparing meshes, and a measure of where a mesh is too coarse.

Positions at the ends of elements are of order 2p, between them of order ``min(2p, p + 2)``.  What a halving of all
elements changes is therefore the error before it, and ``2**-min(2p, p + 2)`` of that the error after it; that the
solution is as smooth as this supposes is seen from its highest Legendre coefficients, which fall by ``2**-p``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..mathematics import interpolation
from ..mathematics.arrays import Array, Index
from .displacements import Displacements
from .fields import Fields
from .model import Model
from .tubes import roughness as twisted

__all__ = [
    "WITHIN",
    "gain",
    "gained",
    "halving",
    "largest_difference",
    "remaining",
    "remaining_by_order",
    "roughness",
    "roughness_of_change",
]

SAFETY = 4.0
"""Estimates are this many times what the order of the elements says of the error that is left."""

WITHIN = np.array([0.0, 0.35, 0.55, 0.74])
"""Where in an element positions are compared.

Their leading error vanishes at its ends and at the zeros of the Jacobi polynomial (2, 2) of degree p - 2, among them
the middle where p is odd: each of these places is away from them for some p, and for all p one of them is.
"""

BLUR = 1e-12
"""Differences of positions below this share of the size are rounding, which no halving makes less."""


def largest_difference(coarse: Fields, fine: Fields) -> float:
    """Largest distance between positions on two meshes, at and within coarse elements, over the scene's size."""
    cuts = list(coarse.model.mesh.cuts.values())
    if not cuts:
        return 0.0
    # Their ends, too, where members begin and end.
    x = [np.append((own[:-1, None] + np.diff(own)[:, None] * WITHIN).ravel(), 1.0) for own in cuts]
    sides = []
    for side in (coarse, fine):
        elements, xi = _located(side.model, list(coarse.model.mesh.cuts), x)
        sides.append(side.moved_within(elements, xi) * side.model.scales.length)
    return float(np.linalg.norm(sides[0] - sides[1], axis=1).max()) / coarse.model.scene.size


def _located(model: Model, members: Sequence[str], x: Sequence[Array]) -> tuple[Index, Array]:
    """Elements (n,) of a model in which fractions x of the lengths of members are, and where in these, 0 to 1."""
    cuts = [model.mesh.cuts[name] for name in members]
    # All members one behind the other: what is on an end of elements is so after equal shifts, too.
    shifted = np.concatenate([own[:-1] + 2.0 * i for i, own in enumerate(cuts)])
    asked = np.concatenate([own + 2.0 * i for i, own in enumerate(x)])
    found = np.searchsorted(shifted, asked, side="right") - 1
    begins, lengths = np.concatenate([own[:-1] for own in cuts]), np.concatenate([np.diff(own) for own in cuts])
    numbers = np.concatenate(
        [model.beams.first[name] + np.arange(len(own) - 1) for name, own in zip(members, cuts, strict=True)]
    )
    return numbers[found], (np.concatenate(x) - begins[found]) / lengths[found]


def halving(coarse: Fields, fine: Fields) -> tuple[float, float]:
    """Relative difference of the positions after all elements were halved, and the estimated error that remains."""
    difference = largest_difference(coarse, fine)
    return difference, remaining(difference, gained(coarse, fine))


def gained(coarse: Fields, fine: Fields, *, positions: bool = True) -> float:
    """Ratio of the error on the fine mesh to that on the coarse one, estimated from roughness; 1 where roughness grew.

    Parameters
    ----------
    positions : bool
        The error of positions, of order ``min(2p, p + 2)`` between the ends of elements; else of quantities of order p.
    """
    before, after = (float(roughness(side).max(initial=0.0)) for side in (coarse, fine))
    return float(gain(before, after, coarse.model.element.order, positions=positions))


def gain(before: ArrayLike, after: ArrayLike, order: int, *, positions: bool = True) -> Array:
    """As :func:`gained`, from the largest roughness on the coarse mesh and on the fine one, numbers or arrays."""
    before, after = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    power = min(2.0 * order, order + 2.0) if positions else float(order)
    # Never more than the order says.
    ratio = np.divide(after, before, out=np.ones(before.shape), where=before > 0.0)
    return np.asarray(np.clip(ratio, 0.5**order, 1.0) ** (power / order))


def remaining(difference: Any, gain: Any) -> Any:
    """Estimated error after all elements were halved.

    Parameters
    ----------
    difference : float or ndarray
        Relative difference that the halving made.
    gain : float or ndarray
        Ratio of the errors, see :func:`gained`.
    """
    # The order is that of small errors: of larger ones the next term is as much as the square root of them.
    gain = np.maximum(gain, np.sqrt(difference))
    found = np.maximum(difference * np.minimum(1.0, SAFETY * gain), np.minimum(difference, BLUR))
    return found if np.ndim(found) else float(found)


def remaining_by_order(difference: Any, order: int) -> Any:
    """What the order of a quantity says of its error after all elements were halved, with a margin."""
    return SAFETY * 0.5**order * difference


def roughness(fields: Fields) -> Array:
    """A measure of how rough the solution is in each element, (elements,): sizes of its highest Legendre coefficients.

    It adds those of the rotations, rad, and those of the tangents times the element's length over the scene's size.
    Rotations count in full, since everything beyond moves with them.  Errors of the positions are about the square of
    these: elements are superconvergent.
    """
    model = fields.model
    angles, chord = _highest(model, fields.q[model.rotations.turns], fields.turned)
    found = np.asarray((2.0 if model.space else 1.0) * angles + chord)
    return found + twisted(model, fields.twisted) if model.scene.tubes else found


def _highest(model: Model, nodal: Array, turned: Array) -> tuple[Array, Array]:
    """Sizes (elements,) of the highest Legendre coefficients of rotations at the nodes (elements, points, ...), and of
    tangents, times weights and the length of the element, over the size of the scene.
    """
    element = model.element
    angles = np.linalg.norm(np.einsum("j,ejc->ec", interpolation.legendre_tail(element.nodes), nodal), axis=1)
    tangents = turned / element.weights[:, None]
    tails = np.einsum("k,eka->ea", interpolation.legendre_tail(element.points), tangents)
    return angles, np.linalg.norm(tails, axis=1) * model.scales.length / model.scene.size


def roughness_of_change(changes: Sequence[Displacements]) -> Array:
    """The roughness (elements,) of a small change, in parts as the real and the imaginary one, over its size; errors of
    the frequency of a mode are about the square of the largest, most a tenth to a half of it (measured).
    """
    rough, size = np.zeros(changes[0].model.mesh.elements), 0.0
    for change in changes:
        model, turned = change.model, change.turned
        spins = change.spins
        rough = rough + np.sum(_highest(model, spins[model.rotations.turns], turned), axis=0)
        length = model.scales.length / model.scene.size
        moved = np.abs(turned / model.element.weights[:, None]).max(initial=0.0) * length
        size = max(size, float(np.abs(spins).max(initial=0.0) + moved))
    return np.asarray(rough / (size or 1.0))
