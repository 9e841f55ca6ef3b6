"""What is asked of a controlled motion: signals, limits, costs and constraints as CasADi expressions.

A *signal* is something that has a value at each time: a control, its rate, an answer of the scene by its name, time
itself.  It has three symbols: along the motion, at its begin, at its end.  A *quantity* has one value: the end time, a
variable of the scene, an integral, a control at which the motion comes to rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import casadi as ca
import numpy as np

from ..description.records import unknown
from ..dynamics.methods import RADAU
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.relations import Relation, relation

__all__ = ["Control", "Kind", "Signal", "Statement", "Variable", "bounds_of", "controls_of"]

Kind = Literal["control", "rate", "answer", "time"]
"""What a signal is of."""


@dataclass(frozen=True)
class Control:
    """A number of the scene that changes with time, within limits.

    Attributes
    ----------
    name : str
        Of one number, as ``loads.motor.value.2`` or ``histories.torque``.
    low, high : float
        In its own unit.
    rate : float
        Largest rate by which it changes, per s.
    """

    name: str
    low: float = -np.inf
    high: float = np.inf
    rate: float = np.inf


@dataclass(frozen=True)
class Variable:
    """A number of the scene that is looked for and constant in time.

    Attributes
    ----------
    name : str
    low, high : float
    """

    name: str
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Signal:
    """Something that has a value at each time.

    Attributes
    ----------
    kind : str
    name : str
    size : int
    along, begin, end : MX (size,)
        Its symbols.
    """

    kind: Kind
    name: str
    size: int
    along: ca.MX
    begin: ca.MX
    end: ca.MX


@dataclass
class Statement:
    """Everything that is asked; what is asked of is a scene that the statement does not know.

    Attributes
    ----------
    controls : sequence of Control
    variables : sequence of Variable
    duration : (float, float)
        Shortest and longest time, s.
    shares : ndarray (intervals,)
        Of the intervals in the time.
    order : int
        Of the controls in an interval: 0 constant, 1 linear and continuous.
    stages : int
        Of Radau IIA in an interval, 2 or 3.
    """

    controls: Sequence[Control]
    variables: Sequence[Variable]
    duration: tuple[float, float]
    shares: Array
    order: int
    stages: int
    signals: dict[tuple[str, str], Signal] = field(default_factory=dict)
    end_time: ca.MX = field(default_factory=lambda: ca.MX.sym("end_time"))
    integrals: list[tuple[ca.MX, ca.MX]] = field(default_factory=list)
    rows: list[tuple[str, Relation]] = field(default_factory=list)
    costs: list[ca.MX] = field(default_factory=list)
    rests: dict[str, ca.MX] = field(default_factory=dict)
    resting: bool = False

    def __post_init__(self) -> None:
        self.constants = {one.name: ca.MX.sym(one.name) for one in self.variables}

    @property
    def fractions(self) -> Array:
        """Of the time, at which the stages are, (intervals, stages)."""
        before = np.cumsum(self.shares) - self.shares
        return np.asarray(before[:, None] + self.shares[:, None] * RADAU[self.stages])

    # -- symbols --------------------------------------------------------------------------------------

    def signal(self, kind: Kind, name: str, size: int = 1) -> Signal:
        """A signal, made when it is first asked for."""
        key = (kind, name)
        if key not in self.signals:
            symbols = [ca.MX.sym(f"{kind} {name}{where}", size) for where in ("", " at t0", " at tf")]
            self.signals[key] = Signal(kind, name, size, *symbols)
        return self.signals[key]

    def control(self, name: str) -> Control:
        """A control by its name."""
        known = {one.name: one for one in self.controls}
        if name not in known:
            raise SceneError(f"control {name!r}: {unknown(name, list(known), 'such controls')}")
        return known[name]

    def at(self, expression: ca.MX, where: Literal["begin", "end"]) -> ca.MX:
        """An expression of signals at the begin or the end."""
        signals = list(self.signals.values())
        return ca.substitute([ca.MX(expression)], [s.along for s in signals], [getattr(s, where) for s in signals])[0]

    def integral(self, expression: ca.MX) -> ca.MX:
        """The integral of an expression over the time, by a symbol."""
        given = _expression(expression, "integral")
        if given.numel() != 1:
            raise SceneError(f"integral: found {given.numel()} numbers, accepted: one")
        symbol = ca.MX.sym(f"integral {len(self.integrals)}")
        self.integrals.append((symbol, given))
        return symbol

    def along(self, expression: ca.MX) -> bool:
        """Whether an expression changes with time."""
        own = {signal.along.__hash__() for signal in self.signals.values()}
        return any(symbol.__hash__() in own for symbol in ca.symvar(expression))

    # -- what is asked --------------------------------------------------------------------------------

    def subject_to(self, given: ca.MX, name: str) -> None:
        """A relation that holds at all times, or once if nothing in it changes with time.

        Raises
        ------
        SceneError
            What is given is no relation, or contradicts itself.
        """
        try:
            found = relation(given)
        except ValueError as error:
            raise SceneError(f"{name}: {error}") from None
        if (found.low > found.high).any():
            i = int((found.low > found.high).argmax())
            message = f"{name}: found {found.low[i]:g} as least and {found.high[i]:g} as largest value"
            raise SceneError(f"{message}, accepted: bounds that do not contradict each other")
        self.rows.append((name, found))

    def minimise(self, cost: ca.MX) -> None:
        """A term of the cost.

        Raises
        ------
        SceneError
            It changes with time.
        """
        cost = _expression(cost, "cost")
        if cost.numel() != 1:
            raise SceneError(f"cost: found {cost.numel()} numbers, accepted: one")
        if self.along(cost):
            raise SceneError(
                "cost: found what changes with time, accepted: integral(...), at_t0(...) or at_tf(...) of it"
            )
        self.costs.append(cost)


def bounds_of(name: str, given: object) -> tuple[float, float]:
    """Least and largest value of a number that is looked for.

    Raises
    ------
    SceneError
        They are none, or contradict each other.
    """
    try:
        low, high = (float(x) for x in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise SceneError(f"{name}: found {given!r}, accepted: a pair (least, largest)") from None
    if np.isnan([low, high]).any() or low > high:
        raise SceneError(f"{name}: found {low:g} to {high:g}, accepted: bounds from the least to the largest value")
    return low, high


def controls_of(given: Mapping[str, object], rates: Mapping[str, float]) -> list[Control]:
    """Controls by their bounds and largest rates."""
    for name, rate in rates.items():
        if name not in given:
            raise SceneError(f"rates: {unknown(name, list(given), 'such controls')}")
        if np.ndim(rate) or np.asarray(rate).dtype.kind not in "iuf" or not rate > 0.0:
            raise SceneError(f"rates: found {rate!r} for {name}, accepted: the largest rate, a number above zero")
    return [Control(name, *bounds_of(name, pair), rate=float(rates.get(name, np.inf))) for name, pair in given.items()]


def _expression(given: Any, what: str) -> ca.MX:
    """What CasADi takes for an expression.

    Raises
    ------
    SceneError
        It takes it for none.
    """
    try:
        return ca.MX(given)
    except NotImplementedError:
        raise SceneError(f"{what}: found {given!r}, accepted: an expression of CasADi or a number") from None
