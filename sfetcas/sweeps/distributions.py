"""What numbers are drawn from, each by its values at probabilities."""

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
        """Values (n,) at probabilities (n,) between 0 and 1, both left out."""
        standard = NormalDist()
        return self.mean + self.deviation * np.array([standard.inv_cdf(p) for p in probability.tolist()])


@dataclass(frozen=True)
class LogNormal:
    """What is above zero and whose logarithm is normal, of a mean and a standard deviation of itself.

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
        """Values (n,) at probabilities (n,) between 0 and 1, both left out."""
        variance = math.log1p((self.deviation / self.mean) ** 2)
        logarithm = Normal(math.log(self.mean) - 0.5 * variance, math.sqrt(variance))
        return np.exp(logarithm.at(probability))


@dataclass(frozen=True)
class Uniform:
    """Anything between two bounds, as probable as anything else there.

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
        """Values (n,) at probabilities (n,) between 0 and 1, both left out."""
        return self.low + (self.high - self.low) * probability


Distribution = Normal | LogNormal | Uniform
"""What there is."""


def _finite(value: float, name: str) -> None:
    try:
        number(value)
    except ValueError:
        raise SceneError(f"found {say(value)}, accepted: a finite number", (name,)) from None


def _positive(value: float, name: str) -> None:
    _finite(value, name)
    if value <= 0.0:
        raise SceneError(f"found {value:g}, accepted: a number above zero", (name,))
