"""Unit quaternions (Euler-Rodrigues parameters), scalar first.

A unit quaternion ``q = (q0, q1, q2, q3)`` turns a vector ``v`` into ``R(q) v``; ``q`` and ``-q`` are the
same rotation; ``multiply(a, b)`` turns by ``b`` first.  Every function takes NumPy arrays whose last axis
holds the components; :func:`product` and :func:`turned` also take lists of CasADi scalars, so that the
formulas stand once.

Source: Barraco and Munteanu, A special finite element ..., Part 1, section 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from .arrays import TINY, Array, depends, numbers

__all__ = [
    "Components",
    "angular_velocity",
    "conjugate",
    "cross_matrix",
    "from_rotation_vector",
    "matrix",
    "multiply",
    "product",
    "rotate",
    "rotation_vector",
    "turned",
    "turned_by",
]


class Components:
    """Numbers of components in the plane or in space; a base class for classes with a field ``space``."""

    space: bool

    @property
    def components(self) -> int:
        """Components of a rotation: 4 of a quaternion, or 1 angle."""
        return 4 if self.space else 1

    @property
    def turns(self) -> int:
        """Components of a rotation vector: 3, or 1 in the plane."""
        return 3 if self.space else 1

    @property
    def axes(self) -> int:
        """Components of a position: 3, or 2 in the plane."""
        return 3 if self.space else 2


def product(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Hamilton product ``a b`` of two quaternions given as four components each."""
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]


def turned(q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """``R(q) v`` for ``|q| = 1``; in general ``|q|^2 R v``, since it is homogeneous of degree two in ``q``."""
    pure = product(q, [0.0, *v])
    return product(pure, [q[0], -q[1], -q[2], -q[3]])[1:]


def _components(a: ArrayLike) -> list[Array]:
    a = numbers(a)
    return [a[..., i] for i in range(a.shape[-1])]


def _stacked(parts: list[Array]) -> Array:
    """The inverse; sums of products have the shape that all are broadcast to."""
    if any(depends(part) for part in parts):
        return np.moveaxis(numbers(parts), 0, -1)
    found = np.empty((*np.shape(parts[0]), len(parts)))
    for i, part in enumerate(parts):
        found[..., i] = part
    return found


def _single(a: ArrayLike) -> TypeGuard[Array]:
    """Whether this is an array of one quaternion or vector: the formulas take a tenth of the time with its floats."""
    return type(a) is np.ndarray and a.ndim == 1 and a.dtype == float


def multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Product of quaternion arrays of shape (..., 4), broadcast against each other."""
    if _single(a) and _single(b):
        return np.array(product(a.tolist(), b.tolist()))
    return _stacked(product(_components(a), _components(b)))


def conjugate(q: ArrayLike) -> Array:
    """The inverse of unit quaternions, (..., 4)."""
    return numbers(numbers(q) * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """``R(q) v``: vectors v (..., 3), in any unit, rotated by unit quaternions q (..., 4)."""
    if _single(q) and _single(v):
        return np.array(turned(q.tolist(), v.tolist()))
    return _stacked(turned(_components(q), _components(v)))


def turned_by(q: Array, v: Array) -> Array:
    """Vectors (..., axes) rotated by unit quaternions (..., 4), or in the plane by angles (..., 1)."""
    if q.shape[-1] == 4:
        return rotate(q, v)
    c, s = np.cos(q[..., 0]), np.sin(q[..., 0])
    return _stacked([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1]])


def matrix(q: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4); the columns are the rotated unit vectors."""
    q = numbers(q)
    return np.swapaxes(rotate(q[..., None, :], np.eye(3)), -1, -2)


def from_rotation_vector(phi: ArrayLike) -> Array:
    """``(cos |phi|/2, sin |phi|/2 phi/|phi|)`` for rotation vectors (..., 3) in rad.

    The sign is kept for more than half a turn, so that a field of quaternions built from a continuous field
    of rotation vectors is continuous.
    """
    phi = np.asarray(phi, dtype=float)
    half = 0.5 * np.linalg.norm(phi, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * phi * np.sinc(half / np.pi)], axis=-1)


def angular_velocity(phi: ArrayLike, rate: ArrayLike) -> Array:
    """Angular velocity (..., 3), fixed axes, of a rotation by rotation vectors phi (..., 3), rad, with given rate.

    ``w = phi' + (1 - cos a)/a^2 phi x phi' + (a - sin a)/a^3 phi x (phi x phi')`` with the angle a.
    """
    phi, rate = np.asarray(phi, dtype=float), np.asarray(rate, dtype=float)
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    once = np.cross(phi, rate)
    # Below this angle the differences lose digits, and the next terms of the series are rounding.
    small, a = angle < 1e-3, np.maximum(angle, 1e-3)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (a - np.sin(a)) / a**3)
    return np.asarray(rate + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * once + second * np.cross(phi, once))


def cross_matrix(v: ArrayLike) -> Array:
    """Matrices (..., 3, 3) of the cross product ``v x`` with vectors v (..., 3), in their unit."""
    return np.cross(np.eye(3), np.asarray(v, dtype=float)[..., None, :])


def rotation_vector(q: ArrayLike) -> Array:
    """Rotation vectors (..., 3) in rad, of half a turn at most, of unit quaternions (..., 4)."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    return np.asarray(q[..., 1:] * (2.0 * np.arctan2(sine, q[..., :1]) / np.maximum(sine, TINY)))
