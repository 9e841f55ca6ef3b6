"""Loads, prescribed motions and the histories that drive them."""

from __future__ import annotations

import os
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from itertools import pairwise
from math import isfinite, perm
from typing import Any, Literal, overload

import numpy as np
from pydantic import Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array
from ..mathematics.interpolation import cubic_spline, fitted_spline
from .columns import read_columns
from .records import Fraction, Numbers, OnPart, Record, Turn, Vector, number, say
from .sections import Varying

__all__ = ["History", "Load", "Motion"]


class History(Record):
    """A factor as a function of time, or in statics of the load factor; constant before the first t and after the last.

    :meth:`of` makes one from a Python function.

    Parameters
    ----------
    t : (n,), s, or in statics load factors
        Rising.  Outside the factor is constant.  In a scene file the key ``table`` may name a CSV file with columns
        ``t`` and ``value`` instead of both keys.
    value : (n,)
        Factors at these.
    interpolation : text
        Between the values: ``linear``, or ``spline``: the cubic spline through them, with continuous rate and
        acceleration, which begins and ends with zero rate, as the factor is constant outside.  Motions need such a
        smooth history.  It goes through all values; smooth measured ones before where they are noisy.
    polynomial : (n - 1, any)
        Instead of values: for each interval coefficients c0, c1, ... in the fraction of the interval, from 0 to 1.

    Examples
    --------
    >>> History(t=[0, 2], value=[0, 1], interpolation="spline").factor(0.5)
    0.15625
    """

    t: Numbers
    value: Numbers | None = None
    interpolation: Literal["linear", "spline"] = "linear"
    polynomial: tuple[Numbers, ...] | None = None

    @classmethod
    def of(cls, function: Callable[[float], float], start: float, end: float, *, tolerance: float = 1e-6) -> History:
        """A history that goes as a function does: a cubic spline with continuous rate and acceleration.

        Intervals are halved until the spline is as near to the function as is asked for.  It is constant outside of
        ``start`` and ``end``: where the function has zero slope at an end, so has the history; elsewhere its rate jumps
        there, which motions do not accept during the analysis.

        Parameters
        ----------
        function : callable
            t -> factor, numbers; of t in s, or in statics of the load factor.
        start, end : float
            Where it begins and ends, s.
        tolerance : float
            Largest difference over the largest value of the function.

        Raises
        ------
        SceneError
            The function has values that are no finite numbers, jumps, or changes too fast.

        Examples
        --------
        >>> import math
        >>> wave = History.of(lambda t: (1 - math.cos(t)) / 2, 0.0, math.pi)
        >>> round(wave.factor(1.0), 6), wave.rate(0.0)
        (0.229849, 0.0)
        """
        name = f"{cls.__name__}.of"
        start, end, tolerance = (
            _given(value, (name, key)) for key, value in (("start", start), ("end", end), ("tolerance", tolerance))
        )
        if not start < end:
            raise SceneError(f"found {start:g} to {end:g}, accepted: a start before the end", (name,))
        if not np.spacing(max(abs(start), abs(end))) < APART * (end - start) < np.inf:
            accepted = "ends with numbers between them to be told apart in double precision"
            raise SceneError(f"found {start!r} to {end!r}, accepted: {accepted}", (name,))
        if not FINEST <= tolerance <= 1.0:
            raise SceneError(f"found {tolerance:g}, accepted: from {FINEST:g} to 1", (name, "tolerance"))
        if not callable(function):
            raise SceneError(f"found {say(function)}, accepted: a function of t", (name,))

        def value(t: float) -> float:
            return _given(function(t), (name, f"the function at t = {t:g}"))

        try:
            t, terms = fitted_spline(value, start, end, tolerance, MOST_INTERVALS)
        except ArithmeticError as error:
            if not error.args or not isinstance(error.args[0], float):
                raise
            message = f"the function jumps or changes too fast near t = {error.args[0]:.9g}"
            raise SceneError(f"{message}, accepted: a continuous function, or a larger tolerance", (name,)) from None
        return cls(t=tuple(t.tolist()), polynomial=tuple(map(tuple, terms.tolist())))

    @model_validator(mode="before")
    @classmethod
    def _from_table(cls, values: Any) -> Any:
        """Columns of a file in place of t and value."""
        if not isinstance(values, Mapping):
            return values
        if callable(values.get("value")):
            accepted = "a list of numbers; History.of(function, start, end) follows a function"
            raise SceneError(f"found a function, accepted: {accepted}", ("value",))
        if "table" not in values:
            return values
        name, twice = values["table"], [key for key in ("t", "value", "polynomial") if key in values]
        if twice:
            raise SceneError(f"found 'table' and {twice[0]!r}, accepted: one of them")
        if not isinstance(name, (str, os.PathLike)):
            raise SceneError(f"found {say(name)}, accepted: the name of a CSV file", ("table",))
        try:
            columns = read_columns(name, needed=("t", "value"))
        except SceneError as error:
            raise error.within("table") from None
        others = {key: value for key, value in values.items() if key != "table"}
        return {**others, "t": columns["t"], "value": columns["value"]}

    @model_validator(mode="after")
    def _check(self) -> History:
        if any(right <= left for left, right in pairwise(self.t)):
            raise SceneError(f"found {say(self.t)}, accepted: rising numbers", ("t",))
        if (self.value is None) == (self.polynomial is None):
            raise SceneError("accepted: either value or polynomial, one of them")
        if self.value is not None and len(self.value) != len(self.t):
            raise SceneError(f"found {len(self.value)} numbers, accepted: {len(self.t)}, one for each t", ("value",))
        if self.polynomial is not None and not len(self.polynomial) == len(self.t) - 1 > 0:
            accepted = "one list of coefficients for each interval of t, at least one"
            raise SceneError(
                f"found {len(self.polynomial)} for {len(self.t)} numbers t, accepted: {accepted}",
                ("polynomial",),
            )
        if self.interpolation == "spline":
            self._check_spline()
        return self

    def _check_spline(self) -> None:
        if self.polynomial is not None:
            raise SceneError("found 'spline' with polynomials, accepted: with values", ("interpolation",))
        if not all(isfinite(c) for terms in self.pieces for c in terms):
            message = (
                "found t or values too far apart for a spline in double precision, accepted: linear, or other units"
            )
            raise SceneError(message, ("interpolation",))

    @cached_property
    def pieces(self) -> tuple[tuple[float, ...], ...]:
        """For each interval of ``t`` coefficients c0, c1, ... in its fraction, from 0 to 1, dimensionless."""
        if self.polynomial is not None:
            return self.polynomial
        assert self.value is not None
        if self.interpolation == "linear" or len(self.t) == 1:
            return tuple((left, right - left) for left, right in pairwise(self.value))
        return tuple(map(tuple, cubic_spline(self.t, self.value).tolist()))

    @overload
    def factor(self, t: float) -> float: ...

    @overload
    def factor(self, t: Array) -> Array: ...

    def factor(self, t: float | Array) -> float | Array:
        """The factor at t.

        Parameters
        ----------
        t : s, or the step's factor in statics; a number, or an array of any shape

        Returns
        -------
        factor : dimensionless, in the shape of t
        """
        if isinstance(t, np.ndarray) and t.ndim:
            return np.array([self.factor(each) for each in t.ravel().tolist()]).reshape(t.shape)
        t = min(max(t, self.t[0]), self.t[-1])
        i = min(bisect_right(self.t, t), len(self.t) - 1) - 1
        if i < 0:
            return self._value(0)
        x = (t - self.t[i]) / (self.t[i + 1] - self.t[i])
        if self.polynomial is None and self.interpolation == "linear":
            return self._value(i) * (1.0 - x) + self._value(i + 1) * x
        return sum(c * x**k for k, c in enumerate(self.pieces[i]))

    def rate(self, t: float, side: Literal[-1, 1] = 1) -> float:
        """The derivative of the factor at t, zero outside of the history.

        Parameters
        ----------
        t : s
        side : 1 just after t, -1 just before; they differ at most at the numbers of the key ``t``

        Returns
        -------
        rate : 1/s
        """
        i = (bisect_right(self.t, t) if side > 0 else bisect_left(self.t, t)) - 1
        if not 0 <= i < len(self.t) - 1:
            return 0.0
        span = self.t[i + 1] - self.t[i]
        x = (t - self.t[i]) / span
        return sum(k * c * x ** (k - 1) for k, c in enumerate(self.pieces[i]) if k) / span

    def between(self, begin: float, end: float) -> tuple[float, ...]:
        """The factor as a polynomial between two times in one interval of ``t``, or outside of all.

        Returns
        -------
        terms : c0, c1, ... - of the powers of (t - begin)/(end - begin)
        """
        i = bisect_right(self.t, 0.5 * (begin + end)) - 1
        if not 0 <= i < len(self.t) - 1:
            return (self.factor(begin),)
        span = self.t[i + 1] - self.t[i]
        first, slope = (begin - self.t[i]) / span, (end - begin) / span
        found = [0.0]
        for c in reversed(self.pieces[i]):
            found = [first * a + slope * b for a, b in zip([*found, 0.0], [0.0, *found], strict=True)]
            found[0] += c
        return tuple(found[: len(self.pieces[i])])

    def jumps(self) -> Iterator[tuple[float, float, float]]:
        """Where the factor or its rate jumps by more than rounding: t, jump of the factor, jump of the rate in 1/s.

        A history jumps at its ends too where its rate there is not zero, as it is constant outside.
        """
        largest, fastest = self.rounding
        last = len(self.t) - 1
        for i, t in enumerate(self.t):
            step = self.pieces[i][0] - sum(self.pieces[i - 1]) if 0 < i < last else 0.0
            kink = self.rate(t, 1) - self.rate(t, -1)
            step, kink = step if abs(step) > largest else 0.0, kink if abs(kink) > fastest else 0.0
            if step or kink:
                yield t, step, kink

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Values of t where the factor or its first or second derivative jumps, by more than six-digit rounding."""
        size = max(abs(self.factor(self.t[0])), *(sum(map(abs, self.pieces[i])) for i in range(len(self.t) - 1)), 0.0)
        found = []
        for i, t in enumerate(self.t):
            left = (self.pieces[i - 1], self.t[i] - self.t[i - 1]) if i else None
            right = (self.pieces[i], self.t[i + 1] - t) if i < len(self.t) - 1 else None
            span = min(piece[1] for piece in (left, right) if piece) if left or right else 1.0
            jumps = [
                (_derivative(*right, 0.0, k) if right else 0.0) - (_derivative(*left, 1.0, k) if left else 0.0)
                for k in (1, 2)
            ]
            jumps = [jump * span**k for k, jump in zip((1, 2), jumps, strict=True)]
            step = right[0][0] - sum(left[0]) if left and right else 0.0
            if max(map(abs, (step, *jumps))) > SMOOTH * size:
                found.append(t)
        return tuple(found)

    @cached_property
    def knots(self) -> tuple[float, ...]:
        """Values of t over which no step goes that follows it: all of linear ones, else kinks and where it turns back.

        A spline through measured values has thousands of intervals, which are no corners.
        """
        if self.polynomial is None and self.interpolation == "linear":
            return self.t
        values = [self.factor(t) for t in self.t]
        turns = {
            t for t, a, b, c in zip(self.t[1:], values, values[1:], values[2:], strict=False) if (b - a) * (c - b) < 0.0
        }
        return tuple(sorted({*self.kinks, *turns}))

    @cached_property
    def rounding(self) -> tuple[float, float]:
        """Bounds below which a jump is rounding of the coefficients: of the factor, and of its rate in 1/s."""
        size, rate = abs(self.factor(self.t[0])), 0.0
        for i, (left, right) in enumerate(pairwise(self.t)):
            terms = self.pieces[i]
            size = max(size, sum(map(abs, terms)))
            rate = max(rate, sum(k * abs(c) for k, c in enumerate(terms)) / (right - left))
        return tolerances.WRITTEN * size, tolerances.WRITTEN * rate

    def _value(self, i: int) -> float:
        assert self.value is not None
        return self.value[i]


def _given(value: Any, where: tuple[str, ...]) -> float:
    try:
        return number(value)
    except ValueError as error:
        raise SceneError(str(error), where) from None


FINEST = 1e-12
"""Least tolerance of a history made from a function: rounding of its spline leaves less."""

APART = 1e-6
"""Share of the interval of a function that still holds numbers of double precision."""

MOST_INTERVALS = 100_000
"""Of a history made from a function."""


def _derivative(terms: tuple[float, ...], span: float, x: float, k: int) -> float:
    """A derivative of a polynomial in the fraction x of a span of time."""
    return sum(perm(j, k) * c * x ** (j - k) for j, c in enumerate(terms) if j >= k) / max(span**k, TINY)


SMOOTH = 1e-6
"""Jumps over the largest value, of derivatives times the interval's length, up to which a history goes on smoothly."""


class Load(OnPart, Record):
    """A force, a moment or a distributed force.

    Parameters
    ----------
    type : text
        ``force`` (N), ``moment`` (N m) or ``distributed`` (N per metre of the undeformed member).
    node : name
        Name of the node that it acts on.
    member : name
        Instead of a node: name of the member that it acts on.
    at : 1
        On a member, unless distributed: fraction of its length.
    from_ : 1
        Of a distributed load: fraction of the length where it begins.  In Python ``from_``, in files ``from``.
    to : 1
        Of a distributed load: fraction of the length where it ends.
    value : (3,), N, N m or N/m, fixed axes of the undeformed scene
        The load.  A moment about z may be one number.
    frame : text
        ``fixed``: a dead load.  ``follower``: it turns with the node, or with the section that it acts on.
        ``section``, of a distributed load: the ``value`` is along b1, b2, b3 of the sections and turns with
        them.
    profile : number or varying
        Of a distributed load: factor along the member.
    history : name
        Name of a history that replaces the load factor of the step.
    """

    type: Literal["force", "moment", "distributed"]
    node: str | None = None
    member: str | None = None
    at: Fraction | None = None
    from_: Fraction = Field(default=0.0, alias="from")
    to: Fraction = 1.0
    value: Turn
    frame: Literal["fixed", "follower", "section"] = "fixed"
    profile: Varying | None = None
    history: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Load:
        self._check_place()
        if self.type != "moment" and isinstance(self.value, float):
            accepted = "[x, y] or [x, y, z]; only a moment may be one number"
            raise SceneError(f"found {self.value:g}, accepted: {accepted}", ("value",))
        if self.type != "distributed" and self.frame == "section":
            raise SceneError(f"found 'section', accepted of a {self.type}: fixed or follower", ("frame",))
        if self.type != "distributed" and self.profile is not None:
            raise SceneError(f"not accepted with a {self.type}; only a distributed load has a profile", ("profile",))
        for key, value, default in (("from", self.from_, 0.0), ("to", self.to, 1.0)):
            if self.type != "distributed" and value != default:
                raise SceneError(f"not accepted with a {self.type}; a distributed load begins and ends", (key,))
        return self

    def _check_place(self) -> None:
        if self.type == "distributed":
            return self._check_distributed()
        if self.node is None and self.member is None:
            raise SceneError("neither node nor member is given, accepted: one of them, on which the load acts")
        if self.node is not None and self.member is not None:
            raise SceneError(f"found node {self.node!r} and member {self.member!r}, accepted: one of them")
        if self.node is not None and self.at is not None:
            raise SceneError(f"found {self.at:g}, accepted: only with a member, and here a node is given", ("at",))
        if self.member is not None and self.at is None:
            raise SceneError(f"the key 'at' is missing: the fraction of the length where the {self.type} acts")

    def _check_distributed(self) -> None:
        if self.node is not None:
            raise SceneError(f"found {self.node!r}, accepted: a member, as the load is distributed", ("node",))
        if self.member is None:
            raise SceneError("the key 'member' is missing: a distributed load acts along a member")
        if self.at is not None:
            accepted = "accepted: 'from' and 'to', between which a distributed load acts"
            raise SceneError(f"found {self.at:g}, {accepted}", ("at",))
        self._check_part()

    @property
    def follows(self) -> bool:
        """Whether it is a follower load."""
        return self.frame != "fixed" and self.type != "moment"

    @property
    def vector(self) -> tuple[float, float, float]:
        """The value with three components (3,), N, N m or N/m, fixed axes; a single number is a moment about z."""
        return self.value if isinstance(self.value, tuple) else (0.0, 0.0, self.value)


class Motion(Record):
    """A prescribed displacement or rotation at a support, or of a joint between two members.

    Parameters
    ----------
    node : name
        Name of a supported node, or of a joint that is driven.
    displacement : (3,), m, fixed axes
        Displacement since the undeformed scene.  At a driven slider the component along its ``direction``
        counts.
    rotation : rad
        A number about the axis of a hinge (about z where the node is clamped in a plane scene), else a rotation
        vector (3,) in the fixed axes.
    between : list of two names
        Drives a joint instead of a support: two members that end at the node, hinged there (``rotation`` of the
        second against the first), or the second released as a slider (``displacement``).
    history : name
        Name of a history that replaces the load factor of the step.
    """

    node: str
    displacement: Vector | None = None
    rotation: Turn | None = None
    between: tuple[str, str] | None = None
    history: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Motion:
        if self.displacement is None and self.rotation is None:
            raise SceneError("neither displacement nor rotation is given, accepted: one of them or both")
        return self
