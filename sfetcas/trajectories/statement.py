"""What is asked of a controlled motion: signals, limits, costs and constraints as CasADi expressions.

A *signal* is something that has a value at each time: a control, its rate, an answer of the scene by its name, time
itself.  It has three symbols: along the motion, at its begin, at its end.  A *quantity* has one value: the end time, a
variable of the scene, an integral, a control at which the motion comes to rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from ..description.records import unknown
from ..dynamics.methods import RADAU
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.statements import Bounds, Statement, bounds_of
from ..parametric.arguments import Parameter

__all__ = ["Control", "Kind", "MotionStatement", "Signal", "Variable", "controls_of", "variable_of"]

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
    parameter : Parameter or None
        What numbers of the scene follow a name of one's own.
    """

    name: str
    low: float
    high: float
    parameter: Parameter | None = None


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


class MotionStatement(Statement):
    """Everything that is asked of a motion; of which scene it does not know.

    Parameters
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

    Attributes
    ----------
    signals : dict
    end_time : MX
    integrals : list of (MX, MX)
        Their symbols, and what is integrated.
    rests : dict of str to MX
        Controls at which the motion comes to rest.
    resting : bool
    constants : dict of str to MX
        Symbols of the variables.
    """

    def __init__(
        self,
        controls: Sequence[Control],
        variables: Sequence[Variable],
        duration: tuple[float, float],
        shares: Array,
        order: int,
        stages: int,
    ) -> None:
        super().__init__()
        self.controls, self.variables, self.duration = controls, variables, duration
        self.shares, self.order, self.stages = shares, order, stages
        self.signals: dict[tuple[str, str], Signal] = {}
        self.end_time = self.known(ca.MX.sym("end_time"))
        self.integrals: list[tuple[ca.MX, ca.MX]] = []
        self.rests: dict[str, ca.MX] = {}
        self.resting = False
        self.constants = {one.name: self.known(ca.MX.sym(one.name)) for one in variables}

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
            symbols = [self.known(ca.MX.sym(f"{kind} {name}{where}", size)) for where in ("", " at t0", " at tf")]
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
        given = self.one(expression, "integral")
        self.refuse_strange("integral", given)
        symbol = self.known(ca.MX.sym(f"integral {len(self.integrals)}"))
        self.integrals.append((symbol, given))
        return symbol

    def along(self, expression: ca.MX) -> bool:
        """Whether an expression changes with time."""
        own = {signal.along.__hash__() for signal in self.signals.values()}
        return any(symbol.__hash__() in own for symbol in ca.symvar(expression))

    def rest(self, name: str) -> ca.MX:
        """What a control is at rest."""
        return self.rests.setdefault(name, self.known(ca.MX.sym(f"{name} at rest")))

    def minimise(self, cost: Any) -> None:
        """A term of the cost, which has one value."""
        expression = self.one(cost, "minimise")
        if self.along(expression):
            accepted = "integral(...), at_t0(...) or at_tf(...) of it"
            raise SceneError(f"found what changes with time, accepted: {accepted}", ("minimise",))
        super().minimise(expression)


def variable_of(name: str, given: Bounds | Parameter) -> Variable:
    """A variable by its bounds, or as a :class:`~sfetcas.parametric.arguments.Parameter` with bounds.

    Raises
    ------
    SceneError
        They are none, or contradict each other.
    """
    if not isinstance(given, Parameter):
        return Variable(name, *bounds_of(name, given))
    if given.low is None or given.high is None:
        raise SceneError("found no bounds, accepted: a lower and an upper bound, low and high", (name,))
    return Variable(name, *bounds_of(name, (given.low, given.high)), given)


def controls_of(given: Mapping[str, object], rates: Mapping[str, float]) -> list[Control]:
    """Controls by their bounds and largest rates."""
    for name, rate in rates.items():
        if name not in given:
            raise SceneError(f"rates: {unknown(name, list(given), 'such controls')}")
        if np.ndim(rate) or np.asarray(rate).dtype.kind not in "iuf" or not rate > 0.0:
            raise SceneError(f"rates: found {rate!r} for {name}, accepted: the largest rate, a number above zero")
    return [Control(name, *bounds_of(name, pair), rate=float(rates.get(name, np.inf))) for name, pair in given.items()]
