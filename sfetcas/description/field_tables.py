"""Magnetic fields as tables of measured or computed values on a grid, between which cubic splines go."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import depends
from .columns import read_columns
from .records import Numbers, Record, counted, enumerated, say

__all__ = ["FieldTable", "Tabulated"]

LEAST = 4
"""Points that a cubic spline needs along an axis."""


@final
class FieldTable(Record):
    """A magnetic field at the points of a grid: columns of which each row is one point, in any order.

    Between the points it is the tensor product of cubic splines through the values, with continuous first and second
    derivatives.  The places along an axis may have different distances; each of them has to be met by all of the other
    axes.  Without ``z`` the field is the same along z.

    Parameters
    ----------
    x : (n,), m, fixed axes
        Places of the points.
    y : (n,), m, fixed axes
        The same.
    z : (n,), m, fixed axes
        The same.  Default: the field does not change along z.
    Bx : (n,), T, fixed axes
        The field there at factor 1.
    By : (n,), T, fixed axes
        The same.
    Bz : (n,), T, fixed axes
        The same.  Default: zero.
    """

    x: Numbers
    y: Numbers
    z: Numbers | None = None
    Bx: Numbers
    By: Numbers
    Bz: Numbers | None = None

    @model_validator(mode="after")
    def _check(self) -> FieldTable:
        self._refuse_parameters()
        for key in ("x", "y", "z", "Bx", "By", "Bz"):
            column = getattr(self, key)
            if column is not None and len(column) != len(self.x):
                raise SceneError(f"found {counted(len(column), 'number')}, accepted: {len(self.x)}, as of x", (key,))
        for name, places in self.grid.items():
            if len(places) < LEAST:
                found = f"found {counted(len(places), 'place')} along {name}"
                raise SceneError(f"{found}, accepted: at least {LEAST}, which cubic splines need", (name,))
            span = places[-1] - places[0]
            for a, b in pairwise(places.tolist()):
                if b - a <= tolerances.WRITTEN * span:
                    message = f"found {a!r} and {b!r}, which are the same but for rounding"
                    raise SceneError(f"{message}, accepted: each place of the grid written alike", (name,))
        wanted = int(np.prod([len(places) for places in self.grid.values()]))
        points = list(zip(*(getattr(self, name) for name in self.grid), strict=True))
        if len(set(points)) < len(points):
            double = next(point for point in points if points.count(point) > 1)
            raise SceneError(f"found the point {say(double)} twice, accepted: each point of the grid once")
        if len(points) < wanted:
            sizes = " times ".join(str(len(places)) for places in self.grid.values())
            message = f"found {len(points)} points, which are no whole grid of {sizes} places along"
            raise SceneError(f"{message} {enumerated(tuple(self.grid))}, accepted: one point for each of {wanted}")
        return self

    def _refuse_parameters(self) -> None:
        for key in ("x", "y", "z", "Bx", "By", "Bz"):
            column = getattr(self, key)
            if any(depends(entry) for entry in (column, *(column or ()))):
                raise SceneError("found a number that varies, accepted: numbers, as tables have no parameters", (key,))

    @cached_property
    def grid(self) -> Mapping[str, NDArray[np.float64]]:
        """Places (n,), m, of the grid along each of its axes, rising."""
        columns = {"x": self.x, "y": self.y, **({} if self.z is None else {"z": self.z})}
        return {name: np.unique(np.asarray(column, dtype=float)) for name, column in columns.items()}

    @cached_property
    def largest(self) -> float:
        """Largest magnitude, T."""
        return float(np.linalg.norm(self._values, axis=1).max())

    @cached_property
    def digest(self) -> int:
        """A number that tells tables apart, computed once."""
        return hash(self._columns)

    @property
    def _values(self) -> NDArray[np.float64]:
        """The field (n, 3) at the points."""
        nothing = np.zeros(len(self.x))
        return np.stack([self.Bx, self.By, nothing if self.Bz is None else self.Bz], axis=1)

    @cached_property
    def spline(self) -> Any:
        """The splines through the values, a :class:`~sfetcas.mathematics.splines.GridSpline`."""
        # A scene by itself needs no CasADi.
        from ..mathematics.splines import GridSpline

        self._refuse_parameters()
        order = np.lexsort([getattr(self, name) for name in self.grid])
        return GridSpline(list(self.grid.values()), self._values[order])

    def __call__(self, place: Any) -> Any:
        """The field (3,), T, at a place (3,), m, numbers or CasADi expressions.

        Beyond the grid, where solvers may look on their way but no answer may be, it goes on straight.
        """
        return self.spline(place)

    @cached_property
    def ends(self) -> Mapping[str, tuple[float, float]]:
        """Least and largest place of the grid along each of its axes, m."""
        return {name: (float(places[0]), float(places[-1])) for name, places in self.grid.items()}

    def outside(self, places: NDArray[np.float64]) -> tuple[str, float, float, float] | None:
        """Of the first of the places (n, 3), m, outside of the grid: axis, where it is, and the ends of the grid."""
        for i, (name, (low, high)) in enumerate(self.ends.items()):
            far = np.flatnonzero(np.abs(places[:, i] - 0.5 * (low + high)) > (0.5 + tolerances.WRITTEN) * (high - low))
            if len(far):
                return name, float(places[far[0], i]), low, high
        return None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FieldTable) and self._columns == other._columns

    def __hash__(self) -> int:
        return self.digest

    @property
    def _columns(self) -> tuple[Any, ...]:
        return self.x, self.y, self.z, self.Bx, self.By, self.Bz


def _tabulated(value: Any) -> Any:
    if isinstance(value, (FieldTable, Mapping)):
        return value
    if not isinstance(value, (str, os.PathLike)):
        accepted = "the name of a CSV file, or columns x, y, Bx, By, in space also z, Bz"
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    columns = read_columns(value, "point", ("x", "y", "Bx", "By"))
    return {name: columns[name] for name in columns if name in FieldTable.model_fields}


Tabulated = Annotated[FieldTable, BeforeValidator(_tabulated)]
"""A :class:`FieldTable` from its columns, or from a CSV file of them."""
