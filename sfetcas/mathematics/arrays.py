"""Types of arrays; shapes, units and frames stand in the docstrings."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import tolerances

__all__ = [
    "TINY",
    "Array",
    "Index",
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

TINY = 1e-300
"""Keeps zero from being divided by; no number that means anything is smaller."""


def first_of_largest(values: Array, alike: float | None = None) -> int:
    """Place of the entry of largest size; of those that miss it by less than the share ``alike`` the first.

    Without one the share is :data:`~sfetcas.tolerances.ALIKE`.  Entries that a symmetry makes the same differ by
    rounding, which chooses nothing then.
    """
    sizes, alike = np.abs(values), tolerances.ALIKE if alike is None else alike
    return int(np.argmax(sizes >= (1.0 - alike) * sizes.max()))


def fixed(array: Array) -> Array:
    """The array itself, read-only from now on."""
    if isinstance(array, np.ndarray):
        array.setflags(write=False)
    return array


def numbers(values: Any) -> Array:
    """An array of floats, or where some depend on parameters of these (:mod:`~sfetcas.mathematics.active`).

    Raises
    ------
    TypeError, ValueError
        They are no numbers.
    """
    if hasattr(values, "expression"):
        found: Array = values
        return found
    flat = values if isinstance(values, (list, tuple)) else ()
    first = next((each for each in flat if hasattr(each, "expression")), None)
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
    if hasattr(values, "expression"):
        return values
    if isinstance(values, (list, tuple, np.ndarray)):
        return next((found for each in values if (found := _depending(each)) is not None), None)
    return None


def plus(array: Array, key: Any, value: Any) -> Array:
    """The array after a value has been added to its entries at a key: the array itself, or one that depends on
    parameters where the value does."""
    if hasattr(value, "expression"):
        array = type(value).of(array)
    array[key] = array[key] + value
    return array


def scattered(count: int, index: Index, rows: Array) -> Array:
    """Sums (count, n) of the rows (m, n) that have the same index (m,)."""
    if hasattr(rows, "expression"):
        return numbers((np.arange(count)[:, None] == index) @ rows)
    found = np.zeros((count, rows.shape[1]))
    np.add.at(found, index, rows)
    return found


def values_of(value: Any) -> Any:
    """What numbers are at the values of the parameters that they depend on; anything else as it is, also in lists."""
    if type(value) in (list, tuple):
        return type(value)(values_of(each) for each in value)
    return getattr(value, "values", value) if hasattr(value, "expression") else value


def unit(vectors: object) -> Array:
    """Vectors (..., n), anything that NumPy makes an array of, divided by their lengths."""
    v = numbers(vectors)
    return numbers(v / np.linalg.norm(v, axis=-1, keepdims=True))


def length_of(vector: Array) -> Any:
    """Length of a vector, also where squares of its components are no numbers of the machine."""
    return math.hypot(*vector) if isinstance(vector, np.ndarray) else np.linalg.norm(vector)


def normals(direction: Array) -> Array:
    """Unit vectors that complete a direction (n,) to an orthonormal basis, (n - 1, n), n two or three."""
    d = unit(direction)
    if len(d) == 2:
        return numbers([[-d[1], d[0]]])
    # From the axis that is the farthest from it, of those as far the first.
    sizes, axis = np.abs(d), np.zeros(3)
    axis[int(np.argmax(sizes <= sizes.min() + tolerances.ALIKE))] = 1.0
    first = unit(np.cross(d, axis))
    return numbers([first, np.cross(d, first)])
