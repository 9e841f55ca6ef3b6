"""How data depend on numbers: polynomials found by probing, exact or to rounding, or a refusal.

Most of what a scene says enters the data of a model linearly, or as a product of such numbers: then a few probes give
it exactly.  What does not is expanded in Chebyshev polynomials over the range that the number may have.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.arrays import TINY, Array
from ..mathematics.constants import times

__all__ = ["Dependence", "Number", "found"]

EXACT = 1e-12
"""Share of its largest value that a polynomial of a datum may miss where it is tested: rounding of the probes."""

ROUNDING = 1e-3
"""What is less than this share of EXACT beside other data of its row is rounding of them."""

DEGREES = (2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Degrees that are tried one after the other."""

GLOBAL = 4
"""Up to this degree a polynomial holds beyond the range it was found in: stiffness goes with the fourth power."""

UNLIKE = 1e3
"""Sizes of terms that differ by more lose digits of the least squares."""

HIGHEST = 1.3
"""A power series of a sum has more of its mixed terms than of its pure ones: a little more than one."""

TESTS = 8
"""Probes that are not fitted, but tell what a fit misses."""

MISSED = 30.0
"""Times EXACT that a polynomial without high products may miss there: what least squares leave of rounding."""

MOST_PROBES = 3000
"""Probes at most for numbers that act together."""


@dataclass(frozen=True)
class Number:
    """One number that data depend on.

    Attributes
    ----------
    name : str
    value : float
        Where data are known exactly.
    low, high : float or None
        Its range, where it is given.
    """

    name: str
    value: float
    low: float | None = None
    high: float | None = None

    @property
    def span(self) -> tuple[float, float]:
        """Where it is probed: centre and half width."""
        if self.low is not None and self.high is not None:
            return 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return self.value, 0.5 * abs(self.value) or 1.0


@dataclass(frozen=True)
class _Together:
    """Numbers that act together: their polynomial is a sum over products of Chebyshev polynomials.

    ``short`` leaves products out whose degrees, each over the largest of its number, add up to more than HIGHEST.
    """

    numbers: tuple[int, ...]
    degrees: tuple[int, ...]
    short: bool
    entries: Array
    coefficients: Array


@dataclass(frozen=True)
class Dependence:
    """Data as a function of numbers.

    Attributes
    ----------
    numbers : tuple of Number
    base : ndarray (data,)
        Where all numbers have their values.
    groups : tuple
        Polynomials of what differs from the base.
    """

    numbers: tuple[Number, ...]
    base: Array
    groups: tuple[_Together, ...]

    @property
    def changing(self) -> Array:
        """Which of the data depend on any number, (data,) bool."""
        flags = np.zeros(len(self.base), dtype=bool)
        for group in self.groups:
            flags[group.entries] = True
        return flags

    def value(self, p: ca.MX, part: slice = slice(None)) -> ca.MX:
        """The data, all or a part of them, for numbers (numbers,)."""
        total = ca.MX(ca.DM(self.base[part]))
        for group in self.groups:
            coefficients = _scattered(group, len(self.base))[part]
            if not coefficients.any():
                continue
            chosen = [self.numbers[i] for i in group.numbers]
            terms = _basis(chosen, group.degrees, group.short)(p[list(group.numbers)])
            total += times(ca.sparsify(ca.DM(coefficients)), terms)
        return total


def _scattered(group: _Together, size: int) -> Array:
    whole = np.zeros((size, group.coefficients.shape[1]))
    whole[group.entries] = group.coefficients
    return whole


def _polynomials(x: ca.SX, number: Number, degree: int) -> list[ca.SX]:
    """Chebyshev polynomials of a number in its span; of degree one the difference from its value itself."""
    if degree == 1:
        return [ca.SX(1), x - number.value]
    centre, half = number.span
    t = (x - centre) / half
    terms = [ca.SX(1), t]
    for _ in range(degree - 1):
        terms.append(2 * t * terms[-1] - terms[-2])
    return terms


def _basis(numbers: Sequence[Number], degrees: Sequence[int], short: bool) -> ca.Function:
    """(numbers) -> all products of their polynomials but the constant one, less what they are at the values."""
    x = ca.SX.sym("x", len(numbers))
    each = [_polynomials(x[i], number, degree) for i, (number, degree) in enumerate(zip(numbers, degrees, strict=True))]
    products = [(0.0, ca.SX(1))]
    for terms, degree in zip(each, degrees, strict=True):
        products = [(k + i / degree, a * b) for k, a in products for i, b in enumerate(terms)]
    chosen = [product for share, product in products if not short or share <= HIGHEST]
    all_of_them = ca.vertcat(*chosen[1:])
    known = ca.evalf(ca.substitute(all_of_them, x, ca.DM([number.value for number in numbers])))
    return ca.Function("basis", [x], [all_of_them - ca.DM(known)])


def found(numbers: Sequence[Number], probe: Callable[[Sequence[float]], Array], lengths: Array) -> Dependence:
    """The dependence of what a probe gives on numbers.

    Parameters
    ----------
    numbers : sequence of Number
    probe : callable
        Data for values of the numbers.
    lengths : ndarray of int
        Of rows of data that belong together, as those of an element: rounding is judged row by row.

    Raises
    ------
    SceneError
        No polynomial tells it.
    """
    probing = _Probing(numbers, probe, lengths)
    groups = tuple(probing.fitted(group) for group in probing.groups())
    result = Dependence(tuple(numbers), probing.base, tuple(group for group in groups if len(group.entries)))
    probing.check(result)
    return result


class _Probing:
    """Probes of one set of numbers."""

    def __init__(self, numbers: Sequence[Number], probe: Callable[[Sequence[float]], Array], lengths: Array) -> None:
        self.numbers, self._probe = list(numbers), probe
        self._values = [number.value for number in numbers]
        self.base = probe(self._values)
        self.unit = np.zeros(len(self.base))
        self._lengths, self._rows = lengths, np.cumsum(lengths) - lengths
        self._see(self.base)

    def _see(self, data: Array) -> None:
        """Judge each datum by the largest value that was seen of it, and rounding by the largest beside it."""
        own = np.abs(data)
        beside = np.maximum.reduceat(own, self._rows) if len(own) else own
        np.maximum(self.unit, np.maximum(own, ROUNDING * np.repeat(beside, self._lengths)), out=self.unit)

    def at(self, changes: dict[int, float]) -> Array:
        """Data where some numbers have other values."""
        values = list(self._values)
        for i, value in changes.items():
            values[i] = value
        data = self._probe(values)
        if data.shape != self.base.shape or not np.isfinite(data).all():
            raise SceneError(f"{self._told(changes)}: found no such model")
        self._see(data)
        return data

    def _told(self, changes: dict[int, float]) -> str:
        return ", ".join(f"{self.numbers[i].name} = {value:.6g}" for i, value in changes.items())

    def differs(self, a: Array, b: Array, times: float = 1.0) -> Array:
        """Which data differ by more than rounding, or some times that."""
        return np.abs(a - b) > times * EXACT * np.maximum(self.unit, TINY)

    def groups(self) -> list[tuple[int, ...]]:
        """Numbers that act together on any datum."""
        count = len(self.numbers)
        ends = [self._end(i) for i in range(count)]
        self.moved = [self.at({i: ends[i]}) for i in range(count)]
        for number, moved in zip(self.numbers, self.moved, strict=True):
            if not self.differs(moved, self.base).any():
                message = "found a number on which nothing depends, accepted: one that the equilibrium depends on"
                raise SceneError(message, ("arguments", number.name))
        parent = list(range(count))

        def root(i: int) -> int:
            while parent[i] != i:
                i = parent[i]
            return i

        def mixed(chosen: Sequence[int]) -> bool:
            """Whether some numbers do more together than each does by itself."""
            apart = sum((self.moved[i] - self.base for i in chosen), self.base)
            return bool(self.differs(self.at({i: ends[i] for i in chosen}), apart, 4.0).any())

        # Mostly none do: one probe says so.
        if count > 1 and mixed(range(count)):
            for i, j in itertools.combinations(range(count), 2):
                if mixed((i, j)):
                    parent[root(i)] = root(j)
        roots = [root(i) for i in range(count)]
        return [tuple(i for i in range(count) if roots[i] == r) for r in dict.fromkeys(roots)]

    def _end(self, i: int) -> float:
        number = self.numbers[i]
        centre, half = number.span
        # Anywhere but where symmetry might hide something.
        return centre + 0.83 * half if number.value <= centre + 0.4 * half else centre - 0.83 * half

    def degree(self, i: int) -> int:
        """Least degree that tells how data depend on one number, the others at their values."""
        number = self.numbers[i]
        centre, half = number.span
        if self._linear(i):
            return 1
        tests = [centre + half * x for x in (-0.97, -0.31, 0.47, 0.89)]
        wanted = [self.at({i: x}) for x in tests]
        for degree in DEGREES:
            nodes = centre + half * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
            values = np.stack([self.at({i: x}) for x in nodes.tolist()])
            fit = np.polynomial.chebyshev.chebfit((nodes - centre) / half, values, degree)
            there = [np.asarray(np.polynomial.chebyshev.chebval((x - centre) / half, fit)) for x in tests]
            if not any(self.differs(a, b).any() for a, b in zip(there, wanted, strict=True)):
                if degree > GLOBAL and number.low is None:
                    break
                return degree
        else:
            degree = DEGREES[-1] + 1
        if number.low is None:
            accepted = "NAME=LOW:HIGH, in Python {name: (low, high)}, as the model is no power of it"
            raise SceneError(f"found no range, accepted: {accepted}", ("arguments", number.name))
        message = f"found {number.low:g} to {number.high:g}, where no polynomial tells how the model depends on it"
        raise SceneError(f"{message}, accepted: a smaller range", ("arguments", number.name))

    def _linear(self, i: int) -> bool:
        """Whether data depend on one number linearly, the others at their values."""
        number = self.numbers[i]
        (centre, half), slope = number.span, (self.moved[i] - self.base) / (self._end(i) - number.value)
        for x in (centre - 0.61 * half, centre + 0.37 * half):
            if self.differs(self.at({i: x}), self.base + slope * (x - number.value), 2.0).any():
                return False
        return True

    def fitted(self, group: tuple[int, ...]) -> _Together:
        """The polynomial of numbers that act together."""
        degrees = tuple(self.degree(i) for i in group)
        if degrees == (1,):
            values = (self.moved[group[0]] - self.base)[None, :]
            rows = np.array([[self._end(group[0]) - self.numbers[group[0]].value]])
            return self._solved(group, degrees, rows, values, short=False)
        brief = self._short(group, degrees) if len(group) > 1 and max(degrees) > 2 else None
        if brief is not None:
            return brief
        count = int(np.prod([degree + 1 for degree in degrees]))
        names = ", ".join(self.numbers[i].name for i in group)
        if count > MOST_PROBES:
            raise SceneError(f"found {names}, which act together, accepted: fewer of them", ("arguments",))
        grids = []
        for i, degree in zip(group, degrees, strict=True):
            centre, half = self.numbers[i].span
            nodes = centre + half * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
            grids.append(nodes.tolist() if degree > 1 else [self.numbers[i].value, self._end(i)])
        points = list(itertools.product(*grids))
        basis = _basis([self.numbers[i] for i in group], degrees, False)
        rows = np.array([np.array(basis(ca.DM(point))).ravel() for point in points])
        values = np.stack([self.at(dict(zip(group, point, strict=True))) for point in points]) - self.base
        return self._solved(group, degrees, rows, values, short=False)

    def _short(self, group: tuple[int, ...], degrees: tuple[int, ...]) -> _Together | None:
        """The polynomial without high products, from a fraction of the probes; None where it misses the model."""
        chosen = [self.numbers[i] for i in group]
        basis = _basis(chosen, degrees, True)
        random, size = np.random.default_rng(1), int(1.5 * basis.numel_out(0)) + TESTS
        if size > MOST_PROBES:
            return None
        # As dense at the ends as where Chebyshev polynomials are told apart.
        points = np.cos(np.pi * random.uniform(size=(size, len(group))))
        points = np.array([n.span[0] for n in chosen]) + np.array([n.span[1] for n in chosen]) * points
        rows = np.array([np.array(basis(ca.DM(point))).ravel() for point in points])
        values = np.stack([self.at(dict(zip(group, point, strict=True))) for point in points.tolist()]) - self.base
        found = self._solved(group, degrees, rows[TESTS:], values[TESTS:], short=True)
        told = np.zeros_like(values[:TESTS])
        told[:, found.entries] = rows[:TESTS] @ found.coefficients.T
        missed = [self.differs(a, b, MISSED).any() for a, b in zip(told, values[:TESTS], strict=True)]
        return None if any(missed) else found

    def _solved(
        self, group: tuple[int, ...], degrees: tuple[int, ...], rows: Array, values: Array, *, short: bool
    ) -> _Together:
        """Coefficients by what the basis is at some probes, and what data gain there."""
        entries = np.flatnonzero((np.abs(values) > EXACT * np.maximum(self.unit, TINY)).any(axis=0))
        largest = np.abs(rows).max(axis=0)
        # Of one size where they are as unlike as products of moduli and widths.
        size = largest if largest.max(initial=0.0) > UNLIKE * largest.min(initial=np.inf) else np.ones(len(largest))
        coefficients = (np.linalg.lstsq(rows / size, values[:, entries], rcond=None)[0] / size[:, None]).T
        coefficients[np.abs(coefficients) * largest < 1e-3 * EXACT * self.unit[entries, None]] = 0.0
        return _Together(group, degrees, short, entries, coefficients)

    def check(self, result: Dependence) -> None:
        """Refuse what misses the model at random values.

        Raises
        ------
        SceneError
            It does.
        """
        if not self.numbers:
            return
        p = ca.MX.sym("p", len(self.numbers))
        value = ca.Function("value", [p], [result.value(p)])
        random = np.random.default_rng(0)
        for _ in range(4):
            spans = [number.span for number in self.numbers]
            point = [c + h * x for (c, h), x in zip(spans, random.uniform(-0.95, 0.95, len(spans)), strict=True)]
            wanted = self.at(dict(enumerate(point)))
            missed = np.abs(np.array(value(point)).ravel() - wanted) > 1e2 * EXACT * np.maximum(self.unit, TINY)
            if missed.any():
                names = ", ".join(number.name for number in self.numbers)
                message = f"found {names}, for which together the model is no polynomial"
                raise SceneError(f"{message}, accepted: fewer of them", ("arguments",))
