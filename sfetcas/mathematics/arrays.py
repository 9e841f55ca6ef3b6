"""Types and small functions of arrays; shapes, units and frames are given in docstrings."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import tolerances

__all__ = [
    "TINY",
    "Array",
    "Index",
    "Sparse",
    "added",
    "cross",
    "depends",
    "first_of_largest",
    "fixed",
    "length_of",
    "normals",
    "numbers",
    "plus",
    "scattered",
    "unit",
    "values_of",
]

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of numbers."""

Index = np.ndarray[Any, np.dtype[np.intp]]
"""An array of places in another one."""

Sparse = Any
"""A sparse matrix of SciPy, which is imported only where it is needed."""

TINY = 1e-300
"""Keeps zero from being divided by; no number that means anything is smaller."""


def first_of_largest(values: Array, alike: float | None = None) -> int:
    """Index of the first entry (n,) whose magnitude is largest up to the relative difference ``alike``.

    By default that is :data:`~sfetcas.tolerances.ALIKE`: entries that are equal by symmetry differ by rounding, which
    then does not decide.
    """
    sizes, alike = np.abs(values), tolerances.ALIKE if alike is None else alike
    return int(np.argmax(sizes >= (1.0 - alike) * sizes.max()))


def depends(value: Any) -> bool:
    """Whether a value, in any unit, is active: a number or an array of numbers that depend on symbols."""
    return hasattr(value, "expression")


def fixed(array: Array) -> Array:
    """The array (...) itself, made read-only; in any unit."""
    if isinstance(array, np.ndarray):
        array.setflags(write=False)
    return array


def numbers(values: Any) -> Array:
    """Values as an array (...) of floats, in their unit; an active one where some depend on parameters.

    Raises
    ------
    TypeError, ValueError
        They are no numbers.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    if depends(values):
        found: Array = values
        return found
    flat = values if isinstance(values, (list, tuple)) else ()
    first = next((each for each in flat if depends(each)), None)
    if first is None:
        try:
            return np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            first = _depending(values)
            if first is None:
                raise
    found = type(first).of(values)
    return found


def _depending(values: Any) -> Any:
    """One of the values that depends on parameters, None where none does."""
    if depends(values):
        return values
    if isinstance(values, (list, tuple, np.ndarray)):
        return next((found for each in values if (found := _depending(each)) is not None), None)
    return None


def plus(array: Array, key: Any, value: Any) -> Array:
    """The array (...) with a value of the same unit added to its entries at ``key``.

    It is modified in place, unless the value is active: then the result is a new active array.
    """
    if depends(value):
        array = type(value).of(array)
    array[key] = array[key] + value
    return array


def added(array: Array, index: Index, rows: Array) -> Array:
    """The array (n, ...) with rows (m, ...) of the same unit added to those of an index (m,), some more than once.

    It is modified in place, unless either is active: then the result is a new active array.
    """
    if depends(array) or depends(rows):
        onto = (np.arange(len(array))[:, None] == index) @ rows.reshape(len(rows), int(np.prod(rows.shape[1:])))
        return numbers(array + onto.reshape(array.shape))
    if array.ndim == 1:
        # The same sums, in the same order, many times faster.
        array += np.bincount(index, weights=rows, minlength=len(array))
    else:
        np.add.at(array, index, rows)
    return array


def scattered(count: int, index: Index, rows: Array) -> Array:
    """Sums (count, n) of the rows (m, n) with the same index (m,)."""
    return added(np.zeros((count, rows.shape[1])), index, rows)


def values_of(value: Any) -> Any:
    """The values of active numbers, also in lists; anything else unchanged."""
    if type(value) in (list, tuple):
        return type(value)(values_of(each) for each in value)
    return getattr(value, "values", value) if depends(value) else value


def unit(vectors: object) -> Array:
    """Unit vectors of vectors (..., n), given as anything that NumPy makes an array of."""
    v = numbers(vectors)
    return numbers(v / np.linalg.norm(v, axis=-1, keepdims=True))


def cross(a: Any, b: Any) -> Array:
    """Cross product of vectors (..., 3)."""
    if type(a) is type(b) is np.ndarray and a.shape == b.shape == (3,):
        # NumPy's own takes twenty times as long for single vectors.
        (x, y, z), (u, v, w) = a.tolist(), b.tolist()
        return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    return np.cross(a, b)


def length_of(vector: Array) -> Any:
    """Length of a vector (n,), in its unit, also where squares of components overflow or underflow."""
    return math.hypot(*vector) if isinstance(vector, np.ndarray) else np.linalg.norm(vector)


def normals(direction: Array) -> Array:
    """Unit vectors that complete a direction (n,) to an orthonormal basis, (n - 1, n), n two or three."""
    d = unit(direction)
    if len(d) == 2:
        return numbers([[-d[1], d[0]]])
    # From the axis that is the farthest from it, of those as far the first.
    sizes, axis = np.abs(d), np.zeros(3)
    axis[int(np.argmax(sizes <= sizes.min() + tolerances.ALIKE))] = 1.0
    first = unit(cross(d, axis))
    return numbers([first, cross(d, first)])
