"""Cubic splines between values on a grid, as functions of numbers and of expressions."""

from __future__ import annotations

import functools
import hashlib
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from .arrays import Array

__all__ = ["GridSpline", "Knotted", "spline_of"]

HIGHEST = 3
"""Highest order of derivatives that have functions of their own: what goes on straight has stiffnesses with three."""


@dataclass(frozen=True, eq=False)
class Knotted:
    """A tensor product of cubic splines.

    Attributes
    ----------
    knots : tuple of ndarray (places + 4,)
        Along each axis.
    values : ndarray (points * components,)
        Coefficients: components fastest, then places along the first axis.
    components : int
    """

    knots: tuple[Array, ...]
    values: Array
    components: int

    @functools.cached_property
    def name(self) -> str:
        """The same for all that are the same function."""
        content = repr((self.components, [knots.tolist() for knots in self.knots], self.values.tolist()))
        return f"spline_{hashlib.sha256(content.encode()).hexdigest()[:24]}"


_SPLINES = weakref.WeakValueDictionary[str, Knotted]()
"""Splines that are alive, by their names: a function of CasADi's that is called somewhere tells no more than a name."""


def spline_of(function: ca.Function) -> tuple[Knotted, int] | None:
    """The spline of which a function gives the derivatives of an order; None of others.

    Its result numbers components fastest, then axes of the first derivative, of the second one, and so on.
    """
    name, _, order = function.name().rpartition("_")
    return (_SPLINES[name], int(order)) if name in _SPLINES else None


def _derivatives(spline: Knotted) -> list[ca.Function]:
    """Functions of a place for the derivatives of a spline of all orders, each the Jacobian of the one before.

    They stay calls in expressions, so that what runs these may know what a spline is, see :func:`spline_of`.
    """
    axes, name, values = len(spline.knots), spline.name, spline.values.tolist()
    knots, place = [one.tolist() for one in spline.knots], ca.MX.sym("place", axes)
    found = [ca.Function.bspline("value", knots, values, [3] * axes, spline.components)(place)]
    for _ in range(HIGHEST):
        found.append(ca.densify(ca.jacobian(found[-1], place)))
    functions = list[ca.Function]()
    for order in range(HIGHEST, -1, -1):
        options: dict[str, Any] = {"never_inline": True}
        if functions:
            same = ca.MX(*found[order].shape)
            names = (["i0", "out_o0"], ["jac_o0_i0"])
            jacobian = ca.Function(f"jac_{name}_{order}", [place, same], [functions[-1](place)], *names)
            options |= {"custom_jacobian": jacobian, "enable_forward": False, "enable_reverse": False}
        functions.append(ca.Function(f"{name}_{order}", [place], [found[order]], options))
    return functions[::-1]


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
        components, knots = values.shape[1], list[Array]()
        values = values.reshape(*(len(places) for places in grid[::-1]), components)
        for axis, places in enumerate(grid[::-1]):
            spline = make_interp_spline(places, values, axis=axis)
            values, knots = np.moveaxis(spline.c, 0, axis), [spline.t, *knots]
        found = Knotted(tuple(knots), values.ravel(), components)
        # One for all that are equal: functions of one are known as long as any of them lives.
        self._spline = _SPLINES.setdefault(found.name, found)
        self._value, self._slopes = _derivatives(self._spline)[:2]

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
