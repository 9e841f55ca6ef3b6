"""Lagrange interpolation on Gauss-Lobatto and Gauss points of [0, 1]: nodes, weights and matrices (NumPy).

Source: Abramowitz and Stegun 25.4.29 and 25.4.32; barycentric formulas as in Berrut and Trefethen 2004
(doi 10.1137/S0036144502417715).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from .arrays import Array, fixed, numbers

__all__ = [
    "cubic_spline",
    "differentiation",
    "evaluation",
    "fitted_spline",
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
    return _weights(nodes.tobytes())


@functools.lru_cache(maxsize=256)
def _weights(values: bytes) -> Array:
    nodes = np.frombuffer(values)
    difference = nodes[:, None] - nodes[None, :]
    np.fill_diagonal(difference, 1.0)
    return fixed(np.asarray(1.0 / np.prod(difference, axis=1)))


def evaluation(nodes: Array, x: ArrayLike) -> Array:
    """Matrix (len(x), len(nodes)) that takes nodal values to values at x."""
    x = np.atleast_1d(numbers(x))
    difference = x[:, None] - nodes[None, :]
    # Nearer than that the quotient would overflow.
    hit = np.abs(difference) < 1e-200
    if hit.any():
        quotient = _barycentric(nodes) / np.where(hit, 1.0, difference)
        quotient = np.where(hit.any(axis=1, keepdims=True), hit.astype(float), quotient)
    else:
        quotient = _barycentric(nodes) / difference
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
    return _tail(nodes.tobytes())


@functools.lru_cache(maxsize=256)
def _tail(values: bytes) -> Array:
    nodes = np.frombuffer(values)
    return fixed(np.asarray(np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1))[-1]))


def cubic_spline(x: ArrayLike, y: ArrayLike, ends: tuple[str, str] = ("clamped", "clamped")) -> Array:
    """The cubic spline through points, twice continuously differentiable between the first and the last.

    Parameters
    ----------
    x, y : (n,), n > 1
        Rising places and the values there.
    ends
        For the first and the last point: ``clamped``, zero slope, or ``not-a-knot``, where the two intervals beside
        the next point are one cubic.

    Returns
    -------
    ndarray (n - 1, 4)
        For each interval the coefficients of the powers of the fraction of it.  They are not finite where numbers
        overflow.
    """
    from scipy.interpolate import CubicSpline

    x, y = numbers(x), numbers(y)
    if not isinstance(y, np.ndarray):
        # Of values that depend on symbols it is linear.
        by_value = np.array([cubic_spline(x, one, ends) for one in np.eye(len(x))])
        return numbers(np.einsum("ijk,i->jk", by_value, y))
    # In units of the whole, in which nothing overflows that need not.
    span, size = float(x[-1] - x[0]), float(np.abs(y).max()) or 1.0
    with np.errstate(all="ignore"):
        places, steps = (x - x[0]) / span, np.diff(x) / span
        if not (np.diff(places) > 0.0).all() or not np.isfinite(places).all():
            return np.full((len(x) - 1, 4), np.nan)
        found = CubicSpline(places, y / size, bc_type=ends).c[::-1].T
        return numbers(size * found * steps[:, None] ** np.arange(4))


def fitted_spline(
    function: Callable[[float], float], start: float, end: float, tolerance: float, most: int
) -> tuple[Array, Array]:
    """A cubic spline that is as near to a function as is asked for.

    Intervals are halved where the spline misses the function, in the middle and at another place of the interval.  Ends
    where a zero slope misses it by no more get one.

    Parameters
    ----------
    function : callable
        x -> value, for ``start`` <= x <= ``end``.
    tolerance : float
        Largest difference, over the largest value met.
    most : int
        Largest number of intervals.

    Returns
    -------
    x : ndarray (n + 1,)
        Ends of the intervals.
    terms : ndarray (n, 4)
        As :func:`cubic_spline` gives them.

    Raises
    ------
    ArithmeticError
        The function jumps, or it changes too fast for so many intervals; the argument is the place.
    """
    x = np.linspace(start, end, FIRST + 1)
    known = {place: function(place) for place in x.tolist()}

    def missed(ends: tuple[str, str]) -> tuple[Array, Array]:
        """The spline, and by how much it misses the function in each interval."""
        terms = cubic_spline(x, [known[place] for place in x.tolist()], ends)
        off = np.zeros(len(terms))
        for share in LOOKED_AT:
            places = (x[:-1] + share * np.diff(x)).tolist()
            for place in places:
                if place not in known:
                    known[place] = function(place)
            off = np.maximum(off, np.abs(terms @ share ** np.arange(4) - [known[place] for place in places]))
        return terms, off

    while True:
        terms, off = missed(("not-a-knot", "not-a-knot"))
        allowed = tolerance * max(map(abs, known.values()))
        wrong = off > allowed
        if not wrong.any():
            break
        worst = int(off.argmax())
        if x[worst + 1] - x[worst] < SHORTEST * (end - start) or len(terms) > most:
            raise ArithmeticError(float(x[worst]))
        x = np.sort(np.concatenate([x, (x[:-1] + LOOKED_AT[0] * np.diff(x))[wrong]]))
    for ends in (("clamped", "clamped"), ("clamped", "not-a-knot"), ("not-a-knot", "clamped")):
        resting, off = missed(ends)
        if (off <= allowed).all():
            return x, resting
    return x, terms


FIRST = 16
"""Intervals with which :func:`fitted_spline` begins."""

LOOKED_AT = (0.5, 0.2113)
"""Fractions of an interval where a spline is compared with its function; the first becomes an end of two."""

SHORTEST = 2.0**-30
"""Share of the whole below which an interval holds a jump: the function changes there by more than is allowed."""
