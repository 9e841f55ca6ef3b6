"""Curves of unit length by their rotation: closed form for constant curvature, panels of polynomials else.

The rotation turns e1, e2, e3 into b1 (tangent), b2, b3 and follows l' = l (0, kappa) / 2 over x in [0, 1]
with the curvature kappa about b1 (twist), b2, b3 in rad over the whole length.  Cubic splines, whose rotation
is found from their shape, are here too.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from .arrays import cross, fixed, length_of, numbers, unit, values_of
from .interpolation import gauss, legendre_values
from .quaternion import conjugate, multiply, product, rotate

__all__ = [
    "FORWARD",
    "POINTS",
    "Curve",
    "Panels",
    "Screw",
    "collocate",
    "cubic_spline",
    "derivatives",
    "equal_arcs",
    "refine",
]

Floats = NDArray[np.float64]

FORWARD = np.array([1.0, 0.0, 0.0])


class Curve(abc.ABC):
    """Places and rotations over x in [0, 1] for unit length from the origin.

    A new kind gives ``positions`` (n, 3), ``quaternions`` (n, 4), continuous in sign, and ``curvatures``
    (n, 3) at x (n,), the fractions ``samples`` that tell whether it is plane, and ``turning`` (rad).
    """

    __slots__ = ()

    @abc.abstractmethod
    def positions(self, x: Floats) -> Floats: ...

    @abc.abstractmethod
    def quaternions(self, x: Floats) -> Floats: ...

    @abc.abstractmethod
    def curvatures(self, x: Floats) -> Floats: ...

    @property
    @abc.abstractmethod
    def samples(self) -> Floats: ...

    @property
    @abc.abstractmethod
    def turning(self) -> float: ...


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Screw(Curve):
    """The frame ``first`` (4,) turns evenly by ``turns`` about the fixed ``axis`` (3,), unit or zero."""

    first: Floats
    axis: Floats
    turns: float

    def positions(self, x: Floats) -> Floats:
        tangent = rotate(self.first, FORWARD)
        if not self.turns:
            # Straight, as most are: this is asked for again and again.
            return np.outer(x, tangent)
        along = (self.axis @ tangent) * self.axis
        total = 2.0 * math.pi * self.turns
        rest = _turned(self.turns, x)[1]
        forward = np.sin(2.0 * math.pi * rest) / total
        aside = 2.0 * np.sin(math.pi * rest) ** 2 / total
        return numbers(
            np.outer(x, along) + np.outer(forward, tangent - along) + np.outer(aside, cross(self.axis, tangent))
        )

    def quaternions(self, x: Floats) -> Floats:
        if not self.turns:
            return np.tile(self.first, (len(x), 1))
        whole, rest = _turned(self.turns, x)
        sign = 1.0 - 2.0 * np.mod(whole, 2.0)
        real, imaginary = sign * np.cos(math.pi * rest), sign * np.sin(math.pi * rest)
        return multiply(np.column_stack([real, np.outer(imaginary, self.axis)]), self.first)

    def curvatures(self, x: Floats) -> Floats:
        if not self.turns:
            return np.zeros((len(x), 3))
        constant = rotate(conjugate(self.first), 2.0 * math.pi * self.turns * self.axis)
        return np.tile(constant, (len(x), 1))

    @property
    def samples(self) -> Floats:
        return np.linspace(0.0, 1.0, 9 if self.turns else 2)

    @property
    def turning(self) -> float:
        return 2.0 * math.pi * abs(self.turns)


def _turned(turns: float, x: Floats) -> tuple[Floats, Floats]:
    """Whole turns in turns x and the rest, in about [-1/2, 1/2] and exact but for its own rounding.

    Source: Dekker 1971, splitting of a product into exact parts (doi 10.1007/BF01397083).
    """
    whole = np.round(turns * x)
    (a, b), (c, d) = _halves(numbers(turns)), _halves(x)
    return whole, ((a * c - whole) + a * d + b * c) + b * d


def _halves(v: Floats) -> tuple[Floats, Floats]:
    shifted = 134217729.0 * v  # 2^27 + 1
    high = shifted - (shifted - v)
    return high, v - high


# Polynomials on panels, through the Gauss points of each

ORDER = 12
MANY = 20000
POINTS, WEIGHTS = gauss(ORDER)
ONE = np.array([1.0, 0.0, 0.0, 0.0])


def _matrices() -> tuple[Floats, Floats]:
    """From values at the Gauss points to the Legendre series of the values and of their integral from 0."""
    values = legendre.legvander(2.0 * POINTS - 1.0, ORDER - 1)
    # not by the weights, whose rounding grows towards the edges
    to_series = np.asarray(np.linalg.inv(values), float)
    integral = 0.5 * legendre.legint(np.eye(ORDER), lbnd=-1.0, axis=0)
    return fixed(to_series), fixed(integral @ to_series)


SERIES, INTEGRAL = _matrices()
RUNNING = fixed(legendre.legvander(2.0 * POINTS - 1.0, ORDER) @ INTEGRAL)
"""From values at the Gauss points to integrals from 0 to each of them."""


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panels(Curve):
    """Legendre series on m panels.

    Attributes
    ----------
    edges : (m + 1,)
        Fractions from 0 to 1.
    places, rotations, bending : (m, k, 3), (m, k, 4), (m, k, 3)
        Coefficients of the series.
    turning : rad
    """

    turning: float
    edges: Floats
    places: Floats
    rotations: Floats
    bending: Floats

    def _at(self, series: Floats, x: Floats) -> Floats:
        panel = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(series) - 1)
        left, right = self.edges[panel], self.edges[panel + 1]
        basis = legendre_values(2.0 * (x - left) / (right - left) - 1.0, series.shape[1] - 1)
        return numbers(np.einsum("nk,nkc->nc", basis, series[panel]))

    def positions(self, x: Floats) -> Floats:
        return self._at(self.places, x)

    def quaternions(self, x: Floats) -> Floats:
        return unit(self._at(self.rotations, x))

    def curvatures(self, x: Floats) -> Floats:
        return self._at(self.bending, x)

    @property
    def samples(self) -> Floats:
        return np.concatenate([self.edges, 0.5 * (self.edges[1:] + self.edges[:-1])])


def collocate(widths: Floats, rates: Floats, first: Floats, fixed_axes: bool) -> Panels:
    """Rotations by collocation at the Gauss points and places by their integral.

    Parameters
    ----------
    widths : (m,)
        Widths of the panels, of sum 1; small ones could not be told from the edges to all digits.
    rates : (m, ORDER, 3)
        Curvature at the Gauss points of each panel, below one half rad a panel.
    first : (4,)
        Quaternion at the start.
    fixed_axes : bool
        Whether the curvature is given about fixed axes, without twist, and not about those of the section.
    """
    # About fixed axes, 2 l' = (0, w) l: then the conjugate of l follows the law for the section with -w.
    flip = conjugate if fixed_axes else numbers
    edges = np.concatenate([[0.0], np.cumsum(widths[:-1]), [1.0]])
    widths = widths[:, None, None]
    halves = 0.5 * widths * np.concatenate([0.0 * rates[:, :, :1], -rates if fixed_axes else rates], axis=2)
    local = np.broadcast_to(ONE, halves.shape)
    for _ in range(12):  # the n-th sweep leaves (1/4)^n / n!
        local = ONE + RUNNING @ multiply(local, halves)
    change = multiply(local, halves)
    firsts = _chain(flip(first), ONE + WEIGHTS @ change)[:, None, :]
    series = INTEGRAL @ change
    series[:, 0] = series[:, 0] + ONE
    rotations = flip(multiply(firsts, local))
    tangents = rotate(rotations, FORWARD)
    places = widths * (INTEGRAL @ tangents)
    places[1:, 0] = places[1:, 0] + np.cumsum(widths[:-1, 0] * (WEIGHTS @ tangents[:-1]), axis=0)
    bending = rates if not fixed_axes else rotate(conjugate(rotations), rates) * [0.0, 1.0, 1.0]
    return Panels(
        turning=float(values_of(np.sum(widths[:, 0] * (np.linalg.norm(rates, axis=2) @ WEIGHTS)[:, None]))),
        edges=fixed(edges),
        places=fixed(places),
        rotations=fixed(flip(multiply(firsts, series))),
        bending=fixed(SERIES @ bending),
    )


def _chain(first: Floats, turns: Floats) -> Floats:
    """Quaternions (m, 4) at the starts of m panels that turn by ``turns`` (m, 4), one after the other."""
    chain = [first.tolist()]
    for turn in turns[:-1].tolist():
        following = product(chain[-1], turn)
        size = length_of(numbers(following))
        chain.append([entry / size for entry in following])
    return numbers(chain)


Sample = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]
"""From the left and right edges (m,) of panels to their widths (m,) as fractions of the length, the curvature
(m, ORDER, 3) at their Gauss points and further values (m, ORDER, k), about one, to be resolved too."""


def refine(sample: Sample, edges: Floats) -> tuple[Floats, Floats]:
    """Halve panels until each turns by at most one half rad and its polynomials have all digits.

    Returns
    -------
    edges : (m + 1,)
        The edges given and those between.
    good : (m,) of bool
        Whether the panel turns by at most one half rad: not so where a curve stands still or turns too much.
    """
    most = MANY + 4 * len(edges)
    while True:
        left, right = edges[:-1], edges[1:]
        widths, rates, more = sample(left, right)
        good = np.linalg.norm(rates, axis=2).max(axis=1) * widths <= 0.5
        fine = good & _resolved(widths, rates, more, np.abs(right) / (right - left))
        halved = ~fine & (right - left > 1e-13)
        if not halved.any() or len(edges) > most:
            return edges, good
        edges = np.sort(np.concatenate([edges, (0.5 * (left + right))[halved]]))


def _resolved(widths: Floats, rates: Floats, more: Floats, rounding: Floats) -> Floats:
    """Whether the last coefficients of the series of each panel are small, with what rounding of x leaves."""
    size = max(1.0, float(np.max(np.abs(rates), initial=0.0, where=np.isfinite(rates))))
    turns = np.concatenate([rates * widths[:, None, None], rates / size, more], axis=2)
    tail = np.abs(SERIES[-2:] @ turns).max(axis=1)
    noise = np.finfo(float).eps * rounding[:, None] * np.ptp(turns, axis=1)
    return np.asarray((tail <= 2e-14 + 4.0 * noise).all(axis=1))


# Cubic splines


def cubic_spline(steps: Floats) -> Floats:
    """Cubic spline over the sum of the chords, by the steps (m, 3) from point to point.

    Returns
    -------
    cubics : (m, 3, 3)
        Coefficients of w, w^2 and w^3 of each piece, w from 0 to 1; the piece begins at its point.

    Source: de Boor, A Practical Guide to Splines, chapter IV (end condition "not a knot").
    """
    h = np.linalg.norm(steps, axis=1)[:, None]
    chords = steps / h
    ends = _end_slopes(h, chords)
    before, after = h * (ends[:-1] - chords), h * (ends[1:] - chords)
    return np.stack([h * ends[:-1], -2.0 * before - after, before + after], axis=1)


def _end_slopes(h: Floats, chords: Floats) -> Floats:
    """Slopes (m + 1, 3) at the points, from the lengths (m, 1) and slopes (m, 3) of the chords."""
    if len(h) == 1:
        return np.vstack([chords, chords])
    if len(h) == 2:
        middle = (h[1] * chords[0] + h[0] * chords[1]) / h.sum()
        return np.stack([2.0 * chords[0] - middle, middle, 2.0 * chords[1] - middle])
    pairs = h[:-1] + h[1:]
    right = np.vstack(
        [
            ((h[0] + 2.0 * pairs[0]) * h[1] * chords[0] + h[0] ** 2 * chords[1]) / pairs[0],
            3.0 * (h[1:] * chords[:-1] + h[:-1] * chords[1:]),
            ((h[-1] + 2.0 * pairs[-1]) * h[-2] * chords[-1] + h[-1] ** 2 * chords[-2]) / pairs[-1],
        ]
    )
    middle = np.concatenate([h[1], 2.0 * pairs[:, 0], h[-2]])
    below, above = np.append(h[1:], pairs[-1]), np.append(pairs[0], h[:-1])
    return _tridiagonal(below, middle, above, right)


def _tridiagonal(below: Floats, middle: Floats, above: Floats, right: Floats) -> Floats:
    """Solution (n, 3) by elimination without pivoting, for pivots that stay above zero."""
    middle, right = middle.copy(), right.copy()
    for k in range(1, len(middle)):
        factor = below[k - 1] / middle[k - 1]
        middle[k] -= factor * above[k - 1]
        right[k] -= factor * right[k - 1]
    right[-1] /= middle[-1]
    for k in range(len(middle) - 2, -1, -1):
        right[k] = (right[k] - above[k] * right[k + 1]) / middle[k]
    return right


def derivatives(cubics: Floats, piece: Floats, w: Floats) -> tuple[Floats, Floats]:
    """First and second derivatives (m, k, 3) by w of the cubics ``piece`` (m,) at w (m, k)."""
    c1, c2, c3 = np.moveaxis(cubics[piece][:, None], 2, 0)
    w = w[:, :, None]
    return c1 + w * (2.0 * c2 + 3.0 * w * c3), 2.0 * c2 + 6.0 * w * c3


def equal_arcs(cubics: Floats, left: Floats, right: Floats) -> tuple[Floats, Floats, Floats]:
    """Arc lengths of panels and where their Gauss points in arc length are.

    Parameters
    ----------
    cubics : (k, 3, 3)
        As :func:`cubic_spline` gives them.
    left, right : (m,)
        Edges of the panels, the number of the cubic plus w.

    Returns
    -------
    arcs : (m,)
        Arc lengths.
    speeds : (m, ORDER)
        Derivatives of the arc length at the Gauss points in w.
    at : (m, ORDER)
        w of the Gauss points in arc length.
    """
    piece = np.floor(left).astype(int)
    low, width = (left - piece)[:, None], (right - left)[:, None]
    speeds = np.linalg.norm(derivatives(cubics, piece, low + width * POINTS)[0], axis=2)
    mean = (speeds @ WEIGHTS)[:, None]
    series = speeds @ INTEGRAL.T
    part = numbers(np.tile(POINTS, (len(left), 1)))
    for _ in range(8):  # Newton: on a panel that is fine enough the speed hardly changes
        speed = np.linalg.norm(derivatives(cubics, piece, low + width * part)[0], axis=2)
        reached = np.einsum("mkc,mc->mk", legendre_values(2.0 * part - 1.0, ORDER), series)
        step = np.where(speed > 0.0, reached - mean * POINTS, 0.0) / np.where(speed > 0.0, speed, 1.0)
        part = np.clip(part - step, 0.0, 1.0)
    return mean[:, 0] * width[:, 0], speeds, low + width * part
