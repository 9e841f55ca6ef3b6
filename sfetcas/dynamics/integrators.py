"""Integrators: each takes a system from its initial state through the times of the answer, behind one interface."""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from .approaching import Approaching
from .events import Event, Events
from .integrating import LONGER, SHORTEST, Stepper, integrate
from .methods import Method
from .sampling import Sample, Sampler, StepRecord
from .stages import StageEquations
from .taken import Memory, Taken

__all__ = ["InitialState", "Integrator", "Stages", "TimeGrid"]


@dataclass(frozen=True, eq=False)
class InitialState:
    """The initial state of a motion, dimensionless.

    Attributes
    ----------
    state : State
    rates : ndarray (unknowns,)
        Angular velocities about the fixed axes, rates of the displacement unknowns.
    x, v : ndarray (quantities,)
        Quantities that carry mass or are damped, and their rates.
    touching : ndarray (rows,)
        Unilateral constraints that may act at once: 1 of those that are closed, else 0.
    near : Approaching or None
        What follows members that may touch each other.
    """

    state: State
    rates: Array
    x: Array
    v: Array
    touching: Array = field(default_factory=lambda: np.zeros(0))
    near: Approaching | None = None


@dataclass(frozen=True, eq=False)
class TimeGrid:
    """Times and accuracy of an integration; times are dimensionless.

    Attributes
    ----------
    times : ndarray (n,)
        Times of the answer, rising; the last one is the end.
    breaks : list of float
        Times at which loads or motions have a kink, and the end.
    beyond : float
        Time after the end up to which loads and motions are smooth.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    rounds : int
        Number of coarser runs before this one.
    size : float
        Size of the scene over the unit of length.
    step : float or None
        Prescribed step; None for error control.
    """

    times: Array
    breaks: list[float]
    beyond: float
    accuracy: float
    rounds: int
    size: float
    step: float | None

    @property
    def end(self) -> float:
        """The time at which the motion ends, dimensionless."""
        return self.breaks[-1]


class Integrator(abc.ABC):
    """Base class of integrators; a subclass gives :meth:`samples`.

    Parameters
    ----------
    system : StageEquations
    progress : callable or None
        Called with the time reached, s.

    Attributes
    ----------
    count : int
        Number of steps so far.
    gap, norm : float
        Largest error so far of the constraints, and of the unit norms of quaternions.
    record : StepRecord or None
        The steps so far; None where there is nothing to interpolate between them with.
    events : list of Event
        What unilateral constraints have done so far.
    """

    record: StepRecord | None = None

    def __init__(self, system: StageEquations, progress: Callable[[float], Any] | None = None) -> None:
        self.system, self._progress = system, progress
        self.count, self.gap, self.norm = 0, 0.0, 0.0
        self.events: list[Event] = []

    @abc.abstractmethod
    def samples(self, begun: InitialState, course: TimeGrid) -> Iterator[Sample]:
        """Yields the states at the times of the answer, each as soon as it is known.

        Raises
        ------
        SceneError
            The integrator cannot treat the scene.
        SolveError
            It cannot go on; the states before have been given.
        """

    def rest(self) -> Iterator[Sample]:
        """Further states that are known where the motion was ended early."""
        return iter(())

    def proceed(self, t: float) -> None:
        """Report to ``progress`` that a dimensionless time has been reached."""
        if self._progress is not None:
            self._progress(t * self.system.masses.time)


@final
class Stages(Integrator):
    """Integration by a method with stages (:class:`~sfetcas.dynamics.methods.Method`)."""

    def __init__(
        self, system: StageEquations, progress: Callable[[float], Any] | None = None, *, method: Method
    ) -> None:
        super().__init__(system, progress)
        self._method, self._sampler = method, Sampler([], method.stages)

    def samples(self, begun: InitialState, course: TimeGrid) -> Iterator[Sample]:
        """States interpolated by polynomials through ends of steps; as of :meth:`Integrator.samples`."""
        method, state, near = self._method, begun.state, begun.near
        rates = np.zeros((method.kept, len(begun.x)))
        rates[0] = begun.v
        begin = self.system.memory.begun
        given = state.q, state.y, state.lam, begun.x, rates, state.unwrapped
        rubbing = self.system.rubbing
        rubs = None if rubbing is None else rubbing.idle(rubbing.displacements(state.y))
        still = 0.0 * begun.touching
        start = Memory(0.0, *given, remembered=begin, acting=begun.touching, held=still, rubs=rubs)
        memory: Memory | None = replace(start, unilateral=self.system.unilateral)
        self._sampler, self.record = Sampler(course.times, method.stages), StepRecord(method.stages)
        first = None if course.step is not None else max(FIRST * course.end, min(course.end, SHORTEST))
        while memory is not None:
            memory = memory if near is None else near.renewed(memory)
            stepper = Stepper(self.system if near is None else near.system, method)
            for taken in self._steps(stepper, memory, course, first, near):
                within = taken.begin.t < course.end * (1.0 - tolerances.DECIMAL)
                if within:
                    self._judge(taken)
                self.record.feed(taken)
                yield from self._sampler.feed(taken)
                if within:
                    self.proceed(taken.after.t)
                first = None if first is None else max(LONGER * taken.h, LONGER * SHORTEST)
            memory = None if near is None else near.over
            if memory is not None and course.end - memory.t <= tolerances.DECIMAL * course.end:
                memory = None
        yield from self.rest()

    def _steps(
        self, stepper: Stepper, memory: Memory, course: TimeGrid, first: float | None, near: Approaching | None
    ) -> Iterator[Taken]:
        """The steps from a state to the end, or until members come near to each other that have not been so before."""
        late = LATE * course.accuracy * course.size * 0.5**course.rounds
        events: Events | None = None
        if near is not None:
            events = near.watching(stepper, course.end, late)
        elif len(self.system.unilateral):
            events = Events(stepper, course.end, late)
        if events is not None:
            self.events = events.found
            h = course.step or first or course.end
            memory = events.begun(memory, h) if memory.t == 0.0 else events.resumed(memory, h)
        yield from integrate(
            stepper,
            memory,
            course.breaks,
            step=course.step,
            tolerance=self._tolerance(course),
            first=first,
            beyond=course.beyond,
            events=events if near is None else near,
        )

    def rest(self) -> Iterator[Sample]:
        """Samples of the last steps, where there are no further ones to interpolate with."""
        return self._sampler.close()

    def _judge(self, taken: Taken) -> None:
        self.count += 1
        self.gap = max(self.gap, taken.gap)
        q = taken.after.q
        if q.shape[1] == 4:
            self.norm = max(self.norm, float(np.abs(np.einsum("ij,ij->i", q, q) - 1.0).max()))

    def _tolerance(self, course: TimeGrid) -> float:
        """Tolerance of steps, in the unit of length; each round has steps of about half the length."""
        order, stages = self._method.order, self._method.stages
        of_step = stages + 1 if stages > 1 else 3
        first = (self._method.gain * course.accuracy) ** (of_step / order)
        return float(course.size * first * 2.0 ** (-of_step * course.rounds))


LATE = 0.1
"""Share of the accuracy by which members may be inside obstacles where events follow each other quickly."""

FIRST = 1e-3
"""First step that is tried, over the span."""
