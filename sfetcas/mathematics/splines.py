"""Cubic splines between values on a grid, as functions of numbers and of expressions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from .arrays import Array

__all__ = ["GridSpline"]


class GridSpline:
    """The tensor product of cubic splines through values on a grid.

    Parameters
    ----------
    grid : sequence of ndarray (n,)
        Rising places along each axis, four or more.
    values : ndarray (points, components)
        At all points of the grid, along the first axis fastest.
    """

    def __init__(self, grid: Sequence[Array], values: Array) -> None:
        # It takes a while to import.
        from scipy.interpolate import make_interp_spline

        self.ends = [(float(places[0]), float(places[-1])) for places in grid]
        components, knots = values.shape[1], list[list[float]]()
        values = values.reshape(*(len(places) for places in grid[::-1]), components)
        for axis, places in enumerate(grid[::-1]):
            spline = make_interp_spline(places, values, axis=axis)
            values, knots = np.moveaxis(spline.c, 0, axis), [spline.t.tolist(), *knots]
        whole, degrees = {"never_inline": True}, [3] * len(grid)
        self._value = ca.Function.bspline("spline", knots, values.ravel().tolist(), degrees, components, whole)
        place = ca.MX.sym("place", len(grid))
        self._slopes = ca.Function("slopes", [place], [ca.jacobian(self._value(place), place)], whole)

    def __call__(self, place: Any) -> Any:
        """Values (components,) at a place (axes or more,); beyond the grid it goes on straight."""
        if isinstance(place, np.ndarray):
            return self(ca.DM(place)).full().ravel()
        kept = [ca.fmin(ca.fmax(place[i], low), high) for i, (low, high) in enumerate(self.ends)]
        beyond = ca.vertcat(*[place[i] - each for i, each in enumerate(kept)])
        return self._value(ca.vertcat(*kept)) + ca.mtimes(self._slopes(ca.vertcat(*kept)), beyond)

    def beyond(self, place: ca.SX) -> list[ca.SX]:
        """How far a place (axes or more,) is outside of the grid along each axis; zero within."""
        ends = enumerate(self.ends)
        return [ca.fmax(ca.fmax(low - place[i], place[i] - high), 0.0) for i, (low, high) in ends]
