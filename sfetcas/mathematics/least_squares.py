"""Nonlinear least squares between bounds: Levenberg and Marquardt's method with exact derivatives.

Source: Nocedal and Wright 2006, section 10.3; bounds by projection, what pushes against one being held (section 16.7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .arrays import Array

__all__ = ["Evaluated", "Minimum", "least_squares"]


@dataclass(frozen=True, eq=False)
class Evaluated:
    """Residuals (m,) somewhere, and what gives their derivatives (m, n) there."""

    residuals: Array
    jacobian: Callable[[], Array]


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the method ended.

    Attributes
    ----------
    x : ndarray (n,)
    here : Evaluated
    jacobian : ndarray (m, n)
    held : ndarray (n,) of bool
        What pushes against a bound.
    converged : bool
    iterations : int
    """

    x: Array
    here: Evaluated
    jacobian: Array
    held: Array
    converged: bool
    iterations: int


FIRMEST = 1e16
"""Damping at which no step is left."""


def least_squares(
    function: Callable[[Array], Evaluated | None],
    x: Array,
    low: Array,
    high: Array,
    *,
    positive: Array | None = None,
    tolerance: float = 1e-8,
    iterations: int = 100,
) -> Minimum | None:
    """The least sum of squares from a start, between bounds; None where the start has no residuals.

    Parameters
    ----------
    function : callable
        Residuals at x; None where there are none: the step is then shortened.
    x, low, high : ndarray (n,)
        Of the size of one.
    positive : (n,) of bool, optional
        What is above zero without a lower bound near which it would be sensible: no step takes it below a fifth.
    tolerance : float
        Steps shorter than this have converged.
    """
    here = function(x)
    if here is None:
        return None
    damping, converged, count = 1e-4, False, 0
    jacobian = here.jacobian()
    while count < iterations and not converged and damping < FIRMEST:
        count += 1
        step = _step(jacobian, here.residuals, damping, _held(x, jacobian.T @ here.residuals, low, high))
        there = np.clip(x + step, low, high)
        if positive is not None:
            there = np.where(positive, np.maximum(there, 0.2 * x), there)
        length = float(np.abs(there - x).max(initial=0.0))
        found = function(there)
        if found is not None and found.residuals @ found.residuals <= here.residuals @ here.residuals:
            x, here, damping = there, found, max(0.01 * damping, 1e-12)
            jacobian = here.jacobian()
            converged = length <= tolerance
        else:
            # Of steps that rounding decides the sum of squares does not fall.
            converged = found is not None and length <= tolerance
            damping *= 10.0
    held = _held(x, jacobian.T @ here.residuals, low, high)
    return Minimum(x, here, jacobian, held, converged, count)


def _held(x: Array, slope: Array, low: Array, high: Array) -> Array:
    return np.asarray(((x <= low) & (slope > 0.0)) | ((x >= high) & (slope < 0.0)))


def _step(jacobian: Array, residuals: Array, damping: float, held: Array) -> Array:
    """The damped step of what is not held."""
    free, step = ~held, np.zeros(len(held))
    own = jacobian[:, free]
    size = np.linalg.norm(own, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    rows = np.vstack([own, np.sqrt(damping) * np.diag(size)])
    right = np.concatenate([-residuals, np.zeros(len(size))])
    step[free] = np.linalg.lstsq(rows / size, right, rcond=None)[0] / size
    return step
