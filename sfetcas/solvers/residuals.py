"""Criteria of convergence: relative residual, balance beside the loads, and what rounding explains."""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..mechanics.equations import Equations, Point, State

__all__ = ["EPSILON", "LEAST_SCALE", "balanced", "relative_residual", "rounded"]


def relative_residual(equations: Equations, point: Point) -> float:
    """Largest residual over its scale, dimensionless: see :class:`~sfetcas.mechanics.equations.Point`."""
    return float((np.abs(point.residual) / np.maximum(point.scale, LEAST_SCALE)).max(initial=0.0))


LEAST_SCALE = 1e-14
"""Least scale of a residual, dimensionless: it keeps the ratio finite where nothing acts and nothing is stiff."""


def balanced(equations: Equations, point: Point) -> bool:
    """Whether the residual is small beside the largest forces that act, not only beside stiffness."""
    n = equations.unknowns
    acting = (point.scale - equations.noise)[:n].max(initial=0.0)
    return float(np.abs(point.residual[:n]).max(initial=0.0)) <= tolerances.BALANCED * acting


EPSILON = 1e-15
"""Rounding of an unknown, over the largest of its kind or 1."""


def rounded(equations: Equations, state: State, point: Point) -> bool:
    """Whether rounding of the unknowns explains the whole residual, and that is small beside all that acts.

    A small residual that does not fall may also be a force that no unknown balances: rounding does not explain it.
    """
    if not relative_residual(equations, point) <= tolerances.BALANCED or not balanced(equations, point):
        return False
    rotation_unknowns, unknowns, total = equations.rotation_unknowns, equations.unknowns, equations.total
    sizes = [max(1.0, float(np.abs(part).max(initial=0.0))) for part in (state.q, state.y)]
    size = np.concatenate([np.repeat(sizes, [rotation_unknowns, unknowns - rotation_unknowns]), np.abs(state.lam)])
    noise = np.bincount(equations.row, np.abs(point.entries) * size[equations.column], minlength=total)
    return bool((np.abs(point.residual) <= EPSILON * noise).all())
