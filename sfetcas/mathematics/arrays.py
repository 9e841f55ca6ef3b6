"""Types of arrays; shapes, units and frames stand in the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["TINY", "Array", "Index", "first_of_largest", "fixed", "unit"]

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of numbers."""

Index = np.ndarray[Any, np.dtype[np.intp]]
"""An array of places in another one."""

TINY = 1e-300
"""Keeps zero from being divided by; no number that means anything is smaller."""


def first_of_largest(values: Array, alike: float = 1e-6) -> int:
    """Place of the entry of largest size; of those that miss it by less than the share ``alike`` the first.

    Entries that a symmetry makes the same differ by rounding, which chooses nothing then.
    """
    sizes = np.abs(values)
    return int(np.argmax(sizes >= (1.0 - alike) * sizes.max()))


def fixed(array: Array) -> Array:
    """The array itself, read-only from now on."""
    array.setflags(write=False)
    return array


def unit(vectors: object) -> Array:
    """Vectors (..., n), anything that NumPy makes an array of, divided by their lengths."""
    v = np.asarray(vectors, dtype=float)
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
