"""Statement of an optimal control problem: signals, bounds, costs and constraints as CasADi expressions.

A *signal* is a function of time: a control, its rate, an answer of the scene by its name, time itself.  It has three
symbols: along the motion, at its begin, at its end.  A *quantity* has one value: the end time, a variable of the scene,
an integral, a control at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from ..description.records import counted, unknown
from ..dynamics.methods import RADAU
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.statements import Bounds, Statement, bounds_of
from ..parametric.arguments import Parameter

__all__ = ["Control", "Kind", "MotionStatement", "Signal", "Variable", "controls_of", "variable_of"]

Kind = Literal["control", "rate", "answer", "time"]
"""Kinds of signals."""


@dataclass(frozen=True)
class Control:
    """A number of the scene that changes with time, within bounds.

    Attributes
    ----------
    name : str
        Name of a single number, as ``loads.motor.value.2`` or ``histories.torque``.
    low, high : float
        Bounds, in its unit.
    rate : float
        Largest rate, in its unit per s.
    """

    name: str
    low: float = -np.inf
    high: float = np.inf
    rate: float = np.inf


@dataclass(frozen=True)
class Variable:
    """An unknown number of the scene that is constant in time.

    Attributes
    ----------
    name : str
    low, high : float
        Bounds, in its unit.
    parameter : Parameter or None
        For a user-defined name: the numbers of the scene that depend on it.
    """

    name: str
    low: float
    high: float
    parameter: Parameter | None = None


@dataclass(frozen=True, eq=False)
class Signal:
    """A function of time, by its symbols.

    Attributes
    ----------
    kind : str
    name : str
    size : int
    along, begin, end : MX (size,)
        Symbols along the motion, at its begin and at its end.
    """

    kind: Kind
    name: str
    size: int
    along: ca.MX
    begin: ca.MX
    end: ca.MX


class MotionStatement(Statement):
    """The statement of an optimal control problem, independent of the scene.

    Parameters
    ----------
    controls : sequence of Control
    variables : sequence of Variable
    duration : (float, float)
        Bounds of the end time, s.
    shares : ndarray (intervals,)
        Length of each interval over the end time.
    order : int
        Controls in an interval: 0 constant, 1 linear and continuous.
    stages : int
        Stages of Radau IIA in an interval, 2 or 3.

    Attributes
    ----------
    signals : dict
    end_time : MX
    integrals : list of (MX, MX)
        Symbols of integrals, and their integrands.
    rests : dict of str to MX
        Symbols of the controls at rest.
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
    def in_words(self) -> str:
        """How much there is of it, with controls and variables."""
        own = f"{counted(len(self.controls), 'control')}, {counted(len(self.variables), 'variable')}"
        return f"{own}, {super().in_words}"

    @property
    def fractions(self) -> Array:
        """Times of the stages over the end time, (intervals, stages)."""
        before = np.cumsum(self.shares) - self.shares
        return np.asarray(before[:, None] + self.shares[:, None] * RADAU[self.stages])

    # -- symbols --------------------------------------------------------------------------------------

    def signal(self, kind: Kind, name: str, size: int = 1) -> Signal:
        """The signal of a kind and name, made at its first use."""
        key = (kind, name)
        if key not in self.signals:
            symbols = [self.known(ca.MX.sym(f"{kind} {name}{where}", size)) for where in ("", " at t0", " at tf")]
            self.signals[key] = Signal(kind, name, size, *symbols)
        return self.signals[key]

    def control(self, name: str) -> Control:
        """A control by its name; SceneError if there is none."""
        known = {one.name: one for one in self.controls}
        if name not in known:
            raise SceneError(f"control {name!r}: {unknown(name, list(known), 'such controls')}")
        return known[name]

    def at(self, expression: ca.MX, where: Literal["begin", "end"]) -> ca.MX:
        """The value of an expression of signals at the begin or the end."""
        signals = list(self.signals.values())
        return ca.substitute([ca.MX(expression)], [s.along for s in signals], [getattr(s, where) for s in signals])[0]

    def integral(self, expression: ca.MX) -> ca.MX:
        """The symbol of the integral of an expression over the whole time."""
        given = self.one(expression, "integral")
        self.refuse_strange("integral", given)
        symbol = self.known(ca.MX.sym(f"integral {len(self.integrals)}"))
        self.integrals.append((symbol, given))
        return symbol

    def along(self, expression: ca.MX) -> bool:
        """Whether an expression depends on time."""
        own = {signal.along.__hash__() for signal in self.signals.values()}
        return any(symbol.__hash__() in own for symbol in ca.symvar(expression))

    def rest(self, name: str) -> ca.MX:
        """The symbol of the value of a control at rest."""
        return self.rests.setdefault(name, self.known(ca.MX.sym(f"{name} at rest")))

    def minimise(self, cost: Any) -> None:
        """Add a term to the cost; SceneError for an expression that depends on time."""
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
    """Controls from their bounds and largest rates; SceneError for rates of other names, or not above zero."""
    for name, rate in rates.items():
        if name not in given:
            raise SceneError(f"rates: {unknown(name, list(given), 'such controls')}")
        if np.ndim(rate) or np.asarray(rate).dtype.kind not in "iuf" or not rate > 0.0:
            raise SceneError(f"rates: found {rate!r} for {name}, accepted: the largest rate, a number above zero")
    return [Control(name, *bounds_of(name, pair), rate=float(rates.get(name, np.inf))) for name, pair in given.items()]
