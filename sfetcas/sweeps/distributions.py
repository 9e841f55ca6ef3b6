"""Distributions that numbers are drawn from, by their inverse cumulative distribution functions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from ..description.records import number, say
from ..errors import SceneError
from ..mathematics.arrays import Array

__all__ = ["Distribution", "LogNormal", "Normal", "Uniform"]


@dataclass(frozen=True)
class Normal:
    """The normal distribution of a mean and a standard deviation.

    Raises
    ------
    SceneError
        The deviation is not above zero.
    """

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        _finite(self.mean, "mean")
        _positive(self.deviation, "deviation")

    def at(self, probability: Array) -> Array:
        """Inverse cumulative distribution: values (n,) at probabilities (n,) strictly between 0 and 1."""
        standard = NormalDist()
        return self.mean + self.deviation * np.array([standard.inv_cdf(p) for p in probability.tolist()])


@dataclass(frozen=True)
class LogNormal:
    """The log-normal distribution; mean and standard deviation are those of the number, not of its logarithm.

    Raises
    ------
    SceneError
        The mean or the deviation is not above zero.
    """

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        _positive(self.mean, "mean")
        _positive(self.deviation, "deviation")

    def at(self, probability: Array) -> Array:
        """Inverse cumulative distribution: values (n,) at probabilities (n,) strictly between 0 and 1."""
        variance = math.log1p((self.deviation / self.mean) ** 2)
        logarithm = Normal(math.log(self.mean) - 0.5 * variance, math.sqrt(variance))
        return np.exp(logarithm.at(probability))


@dataclass(frozen=True)
class Uniform:
    """The uniform distribution between two bounds.

    Raises
    ------
    SceneError
        The bounds contradict each other.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        _finite(self.low, "low")
        _finite(self.high, "high")
        if not self.low < self.high:
            raise SceneError(f"found {self.low:g} to {self.high:g}, accepted: a range from low to high", ("Uniform",))

    def at(self, probability: Array) -> Array:
        """Inverse cumulative distribution: values (n,) at probabilities (n,) strictly between 0 and 1."""
        return self.low + (self.high - self.low) * probability


Distribution = Normal | LogNormal | Uniform
"""Any of the distributions."""


def _finite(value: float, name: str) -> None:
    try:
        number(value)
    except ValueError:
        raise SceneError(f"found {say(value)}, accepted: a finite number", (name,)) from None


def _positive(value: float, name: str) -> None:
    _finite(value, name)
    if value <= 0.0:
        raise SceneError(f"found {value:g}, accepted: a number above zero", (name,))
