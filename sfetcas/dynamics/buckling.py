"""Buckling factors: a linear estimate of the loads at which an unloaded structure buckles.

With ``H`` the Newton matrix, constraints included, at factor 0 and ``H'`` its derivative along the path there,

    (H + f H') x = 0.

Where the path bends only multipliers and not the structure, as of straight columns, ``H`` is linear in the factor and
``f`` is exact; elsewhere it is what linear theory says, with the rotations before buckling to the first order.

Source: Bathe 2014, Finite element procedures, section 6.8.2 (linearised buckling analysis).
"""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from ..mathematics.linear import SparseMap
from ..mathematics.spectra import largest
from ..solvers.arclength import Curve, Standing
from ..solvers.beginning import begin_path
from ..solvers.newton import largest_rotation
from ..solvers.prepared import Prepared

__all__ = ["buckling_factors"]

TURN = 0.01
"""Rotations, rad, over which matrices are differenced, by fourth order: 1e-8 is left out of what rotations do."""

IMAGINARY = 1e-6
"""Imaginary parts of inverse factors below this share are rounding."""

FAR = 1e-7
"""Inverse factors below this share of the largest, or of the largest rotation (rad) that the loads cause as they begin
to grow, are what differencing leaves: linear theory does not reach so far."""

BOTH_SIDES = 2
"""Factors looked for over those asked for, since negative ones (reversed loads) come in between."""


def buckling_factors(prepared: Prepared, count: int) -> Array:
    """The lowest linear buckling factors (n,) of the loads, dimensionless: positive ones first, each sign by rising
    size.

    There are at most ``count``; none where there is no equilibrium at factor 0, as of a mechanism stabilised by its
    loads.

    Raises
    ------
    SceneError, SolveError
        The equilibrium at factor 0 could not be found.
    numpy.linalg.LinAlgError
        The eigenvalue problem could not be solved.
    """
    curve, start, _ = begin_path(prepared, (0.0, 1.0))
    if start.factor != 0.0 or start.tangent.factor == 0.0:
        return np.zeros(0)
    change = _change(curve, start)
    if not len(change.value):
        return np.zeros(0)
    equations = prepared.equations
    primal = tolerances.PROXIMAL * prepared.weight
    equations.solver.factor(equations.regularised(start.point.entries, primal, tolerances.DUAL))

    def apply(block: Array) -> Array:
        return np.asarray(equations.solver.solve(-(change @ block)))

    inverse, _ = largest(apply, equations.total, BOTH_SIDES * count, symmetric=prepared.model.conservative)
    sizes = np.abs(inverse)
    turned = largest_rotation(equations, start.tangent.z) / abs(start.tangent.factor)
    certain = sizes > FAR * max(turned, sizes.max(initial=0.0))
    real = inverse[(np.abs(inverse.imag) <= IMAGINARY * sizes) & certain].real
    factors = 1.0 / real
    return np.asarray(factors[np.lexsort((np.abs(factors), factors < 0.0))][:count])


def _change(curve: Curve, start: Standing) -> SparseMap:
    """Derivative of the Newton matrix by the factor along the path."""
    equations = curve.equations
    rate, loads = start.tangent.z / start.tangent.factor, curve.rate(start.factor)
    turned = largest_rotation(equations, rate)
    h = 1.0 / max(turned / TURN, float(np.abs(rate).max(initial=0.0)), TINY)

    def entries(w: float) -> Array:
        loading = start.loading.plus(loads.scaled(w))
        return equations.at(curve.with_prescribed(equations.moved(start.state, w * rate), loading), loading).entries

    near, far = ((entries(w) - entries(-w)) / (2.0 * w) for w in (h, 2.0 * h))
    return SparseMap(equations.row, equations.column, (4.0 * near - far) / 3.0, (equations.total,) * 2)
