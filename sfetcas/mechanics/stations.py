"""Stations along a member: their elements, and the weights by which fields there follow from values of the elements.

From values at the nodes or integration points of the element, in numbers and in expressions alike:

    rotation   = sum nodal q, normalised
    position   = that of the start of the element + sum gained (turned tangent - undeformed one)
    moment     = that at the first node of the element + sum gained (turned tangent x pull)
    force      = sum spread (distributed force) - pull at the first point
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from ..mathematics import interpolation
from ..mathematics.arrays import Array, Index
from .elements import Element

__all__ = ["Stations"]

FEW = 8
"""Stations up to which looking for equal ones costs more than it saves."""


class Stations:
    """Stations at fractions of the length of a member.

    Attributes
    ----------
    elements : ndarray (n,)
        Elements of the member in which they are, counted from 0.
    xi : ndarray (n,)
        Positions in these elements, 0 to 1.
    """

    def __init__(self, element: Element, cuts: Array, x: Array) -> None:
        self._element = element
        self.elements: Index = np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2)
        self.xi: Array = (x - cuts[self.elements]) / (cuts[self.elements + 1] - cuts[self.elements])

    @classmethod
    def within(cls, element: Element, elements: Index, xi: Array) -> Stations:
        """Stations at places xi (n,), 0 to 1, in elements (n,) of any members."""
        found = cls.__new__(cls)
        found._element, found.elements, found.xi = element, elements, xi
        return found

    def _rows(self, rows: Callable[[Array], Array]) -> Array:
        """Rows of a matrix for stations that, where they are many, often repeat."""
        if len(self.xi) < FEW:
            return np.asarray(rows(self.xi))
        xi, inverse = np.unique(self.xi, return_inverse=True)
        return np.asarray(rows(xi)[inverse])

    @functools.cached_property
    def nodal(self) -> Array:
        """Interpolation weights of the nodes, (n, nodes)."""
        return self._rows(lambda xi: interpolation.evaluation(self._element.nodes, xi))

    @functools.cached_property
    def at_points(self) -> Array:
        """Interpolation weights of values at the points, (n, points)."""
        return self._rows(lambda xi: interpolation.evaluation(self._element.points, xi))

    @functools.cached_property
    def slopes(self) -> Array:
        """Weights of the nodes in the derivative by xi, (n, nodes)."""
        return self._rows(lambda xi: interpolation.differentiation(self._element.nodes, xi))

    @functools.cached_property
    def gained(self) -> Array:
        """Weights (n, points) of values at the points, quadrature weights included, in their integral up to here."""
        return self._rows(lambda xi: interpolation.integration(self._element.points, xi)) / self._element.weights

    @property
    def spread(self) -> Array:
        """Weights (n, points) of the distributed forces at the points in the internal force at the station."""
        return 1.0 - self._element.to_points[:, 0] / self._element.weights[0] - self.gained
