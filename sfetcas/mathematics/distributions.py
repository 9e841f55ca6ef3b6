"""Quantiles and tails of the distributions that confidence needs, in closed form for whole degrees of freedom.

Source: Abramowitz and Stegun 1964, 26.4.4, 26.4.5 (chi-square) and 26.7.3, 26.7.4 (Student).
"""

from __future__ import annotations

import math
from statistics import NormalDist

__all__ = ["chi_square_tail", "normal_quantile", "student_quantile"]

MANY = 10_000
"""Degrees of freedom from which on Student's distribution is the normal one, to four digits."""


def normal_quantile(p: float) -> float:
    """Where the normal distribution reaches a probability."""
    return NormalDist().inv_cdf(p)


def student_quantile(p: float, freedom: int) -> float:
    """Where Student's distribution of so many degrees of freedom reaches a probability of a half or more.

    >>> round(student_quantile(0.975, 5), 6)
    2.570582
    """
    if freedom >= MANY:
        return normal_quantile(p)
    low, high = 0.0, 0.5 * math.pi
    # The share within plus and minus sqrt(freedom) tan(theta) grows with theta.
    for _ in range(60):
        theta = 0.5 * (low + high)
        low, high = (theta, high) if _within(theta, freedom) < 2.0 * p - 1.0 else (low, theta)
    return math.sqrt(freedom) * math.tan(low)


def _within(theta: float, freedom: int) -> float:
    """Share of Student's distribution between plus and minus sqrt(freedom) tan(theta)."""
    sine, square = math.sin(theta), math.cos(theta) ** 2
    odd = freedom % 2
    term = math.cos(theta) if odd else 1.0
    total = 0.0 if freedom == 1 else term
    for k in range(2 + odd, freedom, 2):
        term *= square * (k - 1) / k
        total += term if k <= freedom - 2 else 0.0
    return 2.0 / math.pi * (theta + sine * total) if odd else sine * total


def chi_square_tail(value: float, freedom: int) -> float:
    """Probability that chi-square of so many degrees of freedom is larger than a value.

    >>> round(chi_square_tail(11.0705, 5), 5)
    0.05
    """
    if value <= 0.0:
        return 1.0
    half, odd = 0.5 * value, freedom % 2
    start = math.erfc(math.sqrt(half)) if odd else 0.0
    shift = 0.5 * odd
    powers = (k + shift for k in range(freedom // 2))
    return start + math.fsum(math.exp(k * math.log(half) - half - math.lgamma(k + 1.0)) for k in powers)
