"""Lagrange interpolation on Gauss-Lobatto and Gauss points of [0, 1]: nodes, weights and matrices (NumPy).

Source: Abramowitz and Stegun 25.4.29 and 25.4.32; barycentric formulas as in Berrut and Trefethen 2004
(doi 10.1137/S0036144502417715).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from .arrays import Array, fixed, numbers

__all__ = [
    "differentiation",
    "evaluation",
    "gauss",
    "integration",
    "legendre_tail",
    "legendre_values",
    "lobatto",
    "pieces",
    "power_series",
]


@functools.cache
def gauss(n: int) -> tuple[Array, Array]:
    """The n Gauss points of [0, 1] and their weights (sum 1), (n,) each; exact to degree 2n - 1."""
    x, w = legendre.leggauss(n)
    return fixed(0.5 * (x + 1.0)), fixed(0.5 * w)


@functools.cache
def lobatto(n: int) -> tuple[Array, Array]:
    """The n >= 2 Gauss-Lobatto points of [0, 1], both ends included, and their weights, (n,) each; degree 2n - 3."""
    top = np.zeros(n)
    top[-1] = 1.0
    slope = legendre.legder(top)
    x = np.concatenate([[-1.0], np.sort(legendre.legroots(slope).real), [1.0]]) if n > 2 else np.array([-1.0, 1.0])
    for _ in range(2):
        inner = x[1:-1]
        x[1:-1] = inner - legendre.legval(inner, slope) / legendre.legval(inner, legendre.legder(slope))
    x = 0.5 * (x - x[::-1])
    w = 2.0 / (n * (n - 1) * legendre.legval(x, top) ** 2)
    return fixed(0.5 * (x + 1.0)), fixed(0.5 * w)


def pieces(breaks: Sequence[float], n: int) -> tuple[Array, Array]:
    """The Gauss-Lobatto points and weights of each piece of [0, 1] between these places."""
    x, w = lobatto(n)
    edges = np.array([0.0, *breaks, 1.0])
    lengths = np.diff(edges)[:, None]
    return (edges[:-1, None] + lengths * x).ravel(), (lengths * w).ravel()


def _barycentric(nodes: Array) -> Array:
    difference = nodes[:, None] - nodes[None, :]
    np.fill_diagonal(difference, 1.0)
    return np.asarray(1.0 / np.prod(difference, axis=1))


def evaluation(nodes: Array, x: ArrayLike) -> Array:
    """Matrix (len(x), len(nodes)) that takes nodal values to values at x."""
    x = np.atleast_1d(numbers(x))
    difference = x[:, None] - nodes[None, :]
    # Nearer than that the quotient would overflow.
    hit = np.abs(difference) < 1e-200
    quotient = _barycentric(nodes) / np.where(hit, 1.0, difference)
    quotient = np.where(hit.any(axis=1, keepdims=True), hit.astype(float), quotient)
    return numbers(quotient / quotient.sum(axis=1, keepdims=True))


def differentiation(nodes: Array, x: ArrayLike | None = None) -> Array:
    """Matrix (len(x), len(nodes)) that takes nodal values to derivatives at x (default: at the nodes)."""
    w = _barycentric(nodes)
    difference = nodes[:, None] - nodes[None, :]
    np.fill_diagonal(difference, 1.0)
    matrix = (w[None, :] / w[:, None]) / difference
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix if x is None else evaluation(nodes, x) @ matrix


def integration(nodes: Array, x: ArrayLike) -> Array:
    """Matrix (len(x), len(nodes)) that takes nodal values to integrals from 0 to x of their interpolant."""
    x = np.atleast_1d(numbers(x))
    points, weights = gauss((len(nodes) + 1) // 2 + 1)
    inner = evaluation(nodes, (x[:, None] * points).ravel()).reshape(len(x), len(points), len(nodes))
    return numbers(x[:, None] * np.einsum("k,xkn->xn", weights, inner))


def power_series(x: Array, terms: Sequence[Any]) -> Array:
    """``c0 + c1 x + c2 x^2 + ...`` at x (...), in the unit of the coefficients."""
    total = terms[-1] + 0.0 * x
    for term in reversed(terms[:-1]):
        total = term + total * x
    return numbers(total)


def legendre_values(x: Array, degree: int) -> Array:
    """Legendre polynomials of degree 0, 1, ... at x (...), (..., degree + 1)."""
    found = [1.0 + 0.0 * x, x]
    for k in range(2, degree + 1):
        found.append((found[-1] * x * (2 * k - 1) - found[-2] * (k - 1)) / k)
    return np.moveaxis(numbers(found[: degree + 1]), 0, -1)


def legendre_tail(nodes: Array) -> Array:
    """Row (len(nodes),) that takes nodal values to the coefficient of the highest Legendre polynomial."""
    return np.asarray(np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1))[-1])
