"""When a state is in balance: what is out of balance beside what acts, and what rounding explains of it."""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..mechanics.equations import Equations, Point, State

__all__ = ["LEAST_SCALE", "balanced", "relative_residual", "rounded"]


def relative_residual(equations: Equations, point: Point) -> float:
    """Largest out-of-balance moment or force over what is added up at its node, or largest gap."""
    return float((np.abs(point.residual) / np.maximum(point.scale, LEAST_SCALE)).max(initial=0.0))


LEAST_SCALE = 1e-14
"""Of the units of the model: where nothing acts and nothing is stiff, less than this is nothing."""


def balanced(equations: Equations, point: Point) -> bool:
    """Whether what is out of balance is little beside all that acts, too, and not only beside what is stiff."""
    n = equations.unknowns
    acting = (point.scale - equations.noise)[:n].max(initial=0.0)
    return float(np.abs(point.residual[:n]).max(initial=0.0)) <= tolerances.BALANCED * acting


EPSILON = 1e-15
"""Rounding of unknowns over the largest of their kind, or one."""


def rounded(equations: Equations, state: State, point: Point) -> bool:
    """Whether rounding of the unknowns explains what is out of balance, and balance beside all that acts is good.

    A residual that does not fall may as well be what no unknown balances, however small it is: that explains nothing.
    """
    if not relative_residual(equations, point) <= tolerances.BALANCED or not balanced(equations, point):
        return False
    rotation_unknowns, unknowns, total = equations.rotation_unknowns, equations.unknowns, equations.total
    sizes = [max(1.0, float(np.abs(part).max(initial=0.0))) for part in (state.q, state.y)]
    size = np.concatenate([np.repeat(sizes, [rotation_unknowns, unknowns - rotation_unknowns]), np.abs(state.lam)])
    noise = np.bincount(equations.row, np.abs(point.entries) * size[equations.column], minlength=total)
    return bool((np.abs(point.residual) <= EPSILON * noise).all())
