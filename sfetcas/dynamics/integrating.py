"""Time stepping: fixed steps or error control, with a restart at each kink of loads or prescribed motions."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mathematics.arrays import Array, Index
from ..mathematics.interpolation import differentiation, evaluation, integration
from ..mathematics.kernels import Batch
from ..mechanics.masses import Observables
from ..mechanics.rubbing import Rubs
from ..mechanics.segments import pulled_place
from .core_steps import core_step
from .methods import Method, Radau
from .stages import StageEquations
from .steps import step_function
from .taken import Before, Memory, Taken

__all__ = ["LONGER", "SHORTEST", "Passed", "Stepper", "Watching", "integrate"]


SHORTEST = 5e-7
"""Shortest step, in the unit of time: rounding of places over its square is a thousandth of what accelerates.

It dies away from step to step then; of a tenth of this step it is much of what accelerates, and grows.
"""


@dataclass(frozen=True, eq=False)
class Passed:
    """What has happened within a time step: the steps up to then, perhaps none, the state after it, and whether the
    system is another one from then on.
    """

    steps: list[Taken]
    after: Memory
    over: bool = False


class Watching(Protocol):
    """Says what happens within time steps, as :class:`~sfetcas.dynamics.events.Events` does."""

    def within(self, taken: Taken) -> Passed | None:
        """What happens first in a step that was taken; None where nothing does."""

    def longest(self, memory: Memory) -> float:
        """The longest step that may be taken from a state."""

    def far(self, taken: Taken) -> bool:
        """Whether a step went so far that something may have happened in it unseen: a shorter one is taken instead."""


def _arms(group: Observables) -> Array:
    """What the error of quantities counts beside that of positions: the arm on which their share of all mass would be.

    A body may turn without moving anything but its section axes; of a thin member these count as much as it is thick.
    """
    return np.minimum(np.sqrt(len(group.data) * np.abs(group.mass.ravel())), 1.0)


class Stepper:
    """Takes time steps of one system by one method.

    Parameters
    ----------
    system : StageEquations
    method : Method
    """

    def __init__(self, system: StageEquations, method: Method) -> None:
        self.system, self.method = system, method
        self._by_core = core_step(system, method) if system.kernels in ("auto", "core") else None
        # Tensions are no positions: their rates, which nothing resists, may be those of rounding.
        positions, axes = np.ones(system.linear), system.axes
        positions[(axes * system.model.segments.of_tendons[:, None] + np.arange(axes)).ravel()] = 0.0
        self.judged = np.concatenate([positions, *map(_arms, system.masses.observables)])
        self.time = system.masses.time
        self.count = 0

    @functools.cached_property
    def function(self) -> ca.Function:
        """A step as a CasADi function, see :func:`~sfetcas.dynamics.steps.step_function`."""
        return step_function(self.system, self.method)

    @functools.cached_property
    def _batch(self) -> Batch:
        return Batch(self.function, 1)

    def step(self, memory: Memory, h: float) -> Taken:
        """The step of length h, dimensionless, from a state; see :attr:`.Taken.converged`."""
        system, method, n = self.system, self.method, self.system.layout
        stages, last = method.stages, memory.last
        # What jumps at the end of the step does so after it.
        times = np.minimum(memory.t + h * method.loaded, np.nextafter(memory.t + h, -np.inf))
        factors = np.array([system.factors(t) for t in times])
        turns = np.zeros((stages, n.rotations, system.turns)) if last is None else last.turns
        shifts = np.zeros((stages, n.y)) if last is None else last.shifts
        ratio = 0.0 if last is None else h / last.h
        take = self._by_core or self._by_function
        q, y, lam, turns, shifts, x, rates, size, iterations, gap = take(memory, h, ratio, factors, turns, shifts)
        self.count += 1
        q, lam, x = q.reshape(n.rotations, -1), lam.reshape(stages, n.lam), x.reshape(stages, n.x)
        unwrapping, unwrapped, remembered = system.model.unwrapping, memory.unwrapped, memory.remembered
        unwrapped = unwrapping.angles(q, unwrapped) if unwrapping.count else unwrapped
        # All stages of a step know what was remembered at its begin; its end is remembered by the next one.
        remembered = system.memory.after(q, y, remembered) if system.memory.size else remembered
        turns, shifts = turns.reshape(stages, n.rotations, -1), shifts.reshape(stages, n.y)
        after = replace(
            memory,
            t=memory.t + h,
            q=q,
            y=y,
            lam=lam[-1],
            x=x[-1],
            rates=rates.reshape(method.kept, n.x),
            unwrapped=unwrapped,
            last=Before(h, turns, shifts, np.vstack([memory.x, x]), memory.rates[0]),
            remembered=remembered,
        )
        change = float(size[0]) if np.isfinite(x).all() else np.inf
        parts = turns, shifts, x, lam
        taken = Taken(memory, after, h, method.places, *parts, change, int(np.nan_to_num(iterations[0])), float(gap[0]))
        if memory.rubs is not None and np.isfinite(change):
            taken = self._rubbed(taken, memory.rubs)
        return self._nearby(taken)

    def _by_function(
        self, memory: Memory, h: float, ratio: float, factors: Array, turns: Array, shifts: Array
    ) -> tuple[Array, ...]:
        """A step where the core takes none, as of :class:`~sfetcas.dynamics.core_steps.CoreStep`."""
        rubs = [] if memory.rubs is None else [memory.rubs.flat]
        remembered = memory.remembered[: self.system.memory.size]
        counted = np.concatenate([memory.unwrapped, remembered, *rubs, memory.acting, memory.held])
        given = (memory.q, memory.y, memory.lam, turns, shifts, memory.x, memory.rates)
        for i, values in enumerate((*given, np.array([ratio]), np.array([h]), factors, counted)):
            if values.size:
                self._batch.set(i, values)
        # Stopped by a matrix without an inverse, a step leaves no numbers.
        for result in self._batch.results:
            result[...] = np.nan
        return tuple(part.ravel().copy() for part in self._batch())

    def _rubbed(self, taken: Taken, rubs: Rubs) -> Taken:
        """The step with what friction took, and with the directions of sliding at its end."""
        rubbing, method, begin = self.system.rubbing, self.method, taken.begin
        assert rubbing is not None
        end = rubbing.of_quantities(taken.after.rates[0])
        if not rubs.slides.any():
            taken = replace(taken, rubbed=np.zeros(len(taken.rubbed_at)))
        elif method.stages == 1:
            ends = (begin.y, begin.rates[0], begin.lam), (taken.after.y, taken.after.rates[0], taken.after.lam)
            first, last = (
                rubbing.power(rubs, rubbing.displacements(y), rubbing.of_quantities(v), lam) for y, v, lam in ends
            )
            # The power is taken to be linear in time.
            taken = replace(taken, rubbed=taken.h * np.array([0.375 * first + 0.125 * last, 0.5 * (first + last)]))
        else:
            nodes = np.array([0.0, *method.places])
            v = (differentiation(nodes) @ np.vstack([begin.x, taken.x]))[1:] / taken.h
            powers = [
                rubbing.power(rubs, rubbing.displacements(begin.y + shift), rubbing.of_quantities(rate), lam)
                for shift, rate, lam in zip(taken.shifts, v, taken.lam, strict=True)
            ]
            taken = replace(taken, rubbed=taken.h * integration(method.places, method.places) @ powers)
        ways, _ = rubbing.directions(rubbing.displacements(taken.after.y), end, rubs.ways)
        after = replace(taken.after, lost=begin.lost + float(taken.rubbed[-1]), rubs=replace(rubs, ways=ways))
        return replace(taken, after=after)

    def _nearby(self, taken: Taken) -> Taken:
        """The step counted from places near what flies freely."""
        if self.system.floating is None or not np.isfinite(taken.after.y).all():
            return taken
        by_y, by_x = self.system.floating
        far = np.rint(taken.after.y @ by_y / by_y.sum(axis=0))
        if not far.any():
            return taken
        y, x = by_y @ far, by_x @ far
        return replace(taken, begin=taken.begin.moved(y, x), after=taken.after.moved(y, x), x=taken.x - x)

    def predicted(self, memory: Memory, h: float) -> Array:
        """Quantities (quantities,) after a step of length h, extrapolated from the step before, dimensionless."""
        last = memory.last
        assert last is not None
        if self.method.stages == 1:
            velocity = memory.rates[0]
            mean = (velocity - last.velocity) / last.h
            acceleration = memory.rates[2] if self.method.kept > 1 else mean
            return np.asarray(memory.x + h * velocity + 0.5 * h * h * acceleration)
        nodes = np.array([0.0, *self.method.places])
        row = evaluation(nodes, 1.0 + h / last.h)[0]
        return np.asarray(row @ last.x)

    def refreshed(self, memory: Memory, h: float) -> Memory:
        """The state for a restart: accelerations, where the method keeps them, are those just after the kink."""
        fresh = replace(memory, last=None)
        if self.method.kept == 1:
            return self._told(fresh, self.step(fresh, h)) if len(self._pulled) else fresh
        starter = self.starter
        short = starter.step(replace(fresh, rates=memory.rates[:1]), START * h)
        nodes = np.array([0.0, *starter.method.places])
        values = np.vstack([memory.x, short.x])
        slopes = differentiation(nodes)
        # The polynomial through the stages and the velocity at the begin, twice differentiated there.
        missed = memory.rates[0] * short.h - (slopes @ values)[0]
        second = (slopes @ slopes @ values)[0] + missed * _bend(nodes)
        acceleration = second / short.h**2
        rates = np.stack([memory.rates[0], *[acceleration] * (self.method.kept - 1)])
        return self._told(replace(fresh, rates=rates), short)

    @functools.cached_property
    def starter(self) -> Stepper:
        """What takes a short step from a state without accelerations: the method itself where it keeps none."""
        return self if self.method.kept == 1 else Stepper(self.system, Radau(2))

    @functools.cached_property
    def _pulled(self) -> Index:
        """Numbers of the places that tell how tendons of given length are pulled that rub."""
        model, tendons = self.system.model, self.system.model.scene.tendons.items()
        names = [pulled_place(model.scene, model.mesh, name) for name, tendon in tendons if tendon.rubs]
        return np.array([model.segments.place(name) for name in names if name], dtype=np.intp)

    def _told(self, memory: Memory, taken: Taken) -> Memory:
        """The state with these as they are just after it: what is pulled at once says nothing of before."""
        if not len(self._pulled) or not taken.converged:
            return memory
        retained, axes = self.system.model.positions.retained[self._pulled], self.system.axes
        now = memory.y + evaluation(np.asarray(taken.places), np.zeros(1))[0] @ taken.shifts
        y, x = memory.y.copy(), memory.x.copy()
        y[retained] = now[retained]
        x[axes * self._pulled[:, None] + np.arange(axes)] = now[retained]
        return replace(memory, y=y, x=x)


START = 0.05
"""Share of a step in which the accelerations at its begin are found."""


def _bend(nodes: Array) -> float:
    """Second derivative at the first node of the polynomial that vanishes at all and has the slope 1 there."""
    rest = nodes[1:] - nodes[0]
    # (x - x0) prod (x - xk) / prod (x0 - xk): slope 1 at x0, second derivative 2 sum 1 / (x0 - xk).
    return float(2.0 * np.sum(-1.0 / rest))


def integrate(
    stepper: Stepper,
    memory: Memory,
    breaks: Sequence[float],
    *,
    step: float | None = None,
    tolerance: float | None = None,
    first: float | None = None,
    beyond: float = 0.0,
    events: Watching | None = None,
) -> Iterator[Taken]:
    """Integrate up to the last of the breaks; every break is the end of a step.

    A few further steps make the last answers, which are interpolated, as accurate as all others.

    Parameters
    ----------
    breaks : (n,), rising times at which loads or motions have kinks, then the end; all times are dimensionless
    step : fixed length; the steps between two breaks are equal and no longer
    tolerance : instead of ``step``: permitted error of a step, over the unit of length
    first : length of the first step that is tried; after an event none that is longer is
    beyond : time after the last break up to which loads and motions are smooth
    events : what ends steps where something happens, after which the integration begins anew, or is over

    Raises
    ------
    SolveError
        A step does not converge; the steps before have been given.
    """
    begins = first
    for end in breaks:
        while end > memory.t:
            going: _Fixed | _Adaptive
            if step is not None:
                going = _Fixed(stepper, step, events)
            else:
                assert tolerance is not None
                going = _Adaptive(stepper, tolerance, first, events)
            passed: Passed | None = None
            for taken in going.until(memory, end):
                passed = None if events is None else events.within(taken)
                yield from [taken] if passed is None else passed.steps
                memory = taken.after if passed is None else passed.after
                if passed is not None:
                    break
            if passed is not None and passed.over:
                return
            # Of two first steps each is half as long as what is tried: event by event they would become ever shorter.
            if passed is None or going.h is None:
                first = going.h
            else:
                # Longer ones would damp what an event sets swinging before it is seen.
                first = min(max(LONGER * going.h, LONGER * SHORTEST), np.inf if begins is None else begins)
            if passed is None or end - memory.t <= tolerances.DECIMAL * end:
                break
    for _ in range(BEYOND):
        last = memory.last
        if last is None or memory.t + last.h > beyond:
            break
        taken = stepper.step(memory, last.h)
        if not taken.converged or (events is not None and _happens(events, taken)):
            break
        memory = taken.after
        yield taken


def _happens(events: Watching, taken: Taken) -> bool:
    """Whether anything happens in a step beyond the end, of which no more is asked."""
    try:
        return events.within(taken) is not None
    except SolveError:
        return True


LONGER = 4.0
"""Length of the first step that is tried after an event, over the last step before, or over the shortest one."""

BEYOND = 3
"""Steps beyond the end at most."""


def _longest(events: Watching | None, memory: Memory) -> float:
    """The longest step that may be taken from a state."""
    return np.inf if events is None else events.longest(memory)


def _far(events: Watching | None, taken: Taken) -> bool:
    """Whether a step went farther than what is watched allows."""
    return events is not None and events.far(taken)


class _Fixed:
    """Equal steps up to a break, no longer than a given length; divided where one may be too long."""

    def __init__(self, stepper: Stepper, step: float, events: Watching | None) -> None:
        self._stepper, self.h, self._events = stepper, step, events

    def until(self, memory: Memory, end: float) -> Iterator[Taken]:
        """The steps."""
        span = end - memory.t
        count = max(1, int(np.ceil(span / self.h - 1e-9)))
        memory = self._stepper.refreshed(memory, span / count)
        for k in range(count):
            left = (end - memory.t) / (count - k)
            while left > tolerances.DECIMAL * span:
                h = left / max(1, int(np.ceil(left / _longest(self._events, memory))))
                taken = self._stepper.step(memory, h)
                while taken.converged and _far(self._events, taken):
                    h *= 0.5
                    taken = self._stepper.step(memory, h)
                if not taken.converged:
                    raise _failed(self._stepper, taken)
                memory, left = taken.after, left - h
                yield taken


class _Adaptive:
    """Steps by the error up to a break."""

    def __init__(self, stepper: Stepper, tolerance: float, first: float | None, events: Watching | None) -> None:
        self._stepper, self._tolerance, self.h, self._events = stepper, tolerance, first, events
        s = stepper.method.stages
        # Order in h of what a step differs from how the one before went on.
        self._order = s + 1 if s > 1 else 3

    def until(self, memory: Memory, end: float) -> Iterator[Taken]:
        """The steps."""
        span = end - memory.t
        h = min(span if self.h is None else self.h, span, _longest(self._events, memory))
        least = tolerances.DECIMAL * span
        for taken in self._begun(memory, h, least):
            memory = taken.after
            yield taken
        h = self.h = min(self.h or h, span)
        while end - memory.t > least:
            left, h = end - memory.t, min(h, _longest(self._events, memory))
            # The last steps share what is left evenly.
            h = left if left <= h * 1.0001 else 0.5 * left if left < 2.0 * h else h
            taken = self._stepper.step(memory, h)
            error = self._error(memory, taken)
            if error > REJECTED or _far(self._events, taken):
                if h < least:
                    raise _failed(self._stepper, taken)
                h = self._scaled(h, max(error, REJECTED), 0.5)
                continue
            memory = taken.after
            yield taken
            h = self.h = max(self._scaled(h, error, GROWTH), least)

    def _scaled(self, h: float, error: float, most: float) -> float:
        share = 0.25 if not np.isfinite(error) else 0.9 * max(error, 1e-12) ** (-1.0 / self._order)
        return h * float(np.clip(share, 0.2, most))

    def _error(self, memory: Memory, taken: Taken) -> float:
        """Over the tolerance, of the positions."""
        if not taken.converged:
            return float(np.inf)
        expected = self._stepper.predicted(memory, taken.h) + memory.origin[1]
        missed = (taken.after.position - expected) * self._stepper.judged
        return float(np.abs(missed).max()) / self._tolerance

    def _begun(self, memory: Memory, h: float, least: float) -> list[Taken]:
        """The first two steps, each half of one that agrees with them."""
        stepper = self._stepper
        while True:
            fresh = stepper.refreshed(memory, h)
            whole, half = stepper.step(fresh, h), stepper.step(fresh, 0.5 * h)
            error = np.inf
            if whole.converged and half.converged:
                other = stepper.step(half.after, 0.5 * h)
                if other.converged and not (_far(self._events, half) or _far(self._events, other)):
                    missed = (whole.after.position - other.after.position) * stepper.judged
                    error = float(np.abs(missed).max()) / self._tolerance
                    if error <= 1.0:
                        self.h = 0.5 * h
                        return [half, other]
            if h < least:
                raise _failed(stepper, half)
            h *= float(np.clip(0.8 * error ** (-1.0 / (stepper.method.order + 1)), 0.1, 0.5))


GROWTH = 2.0
"""A step is at most so many times as long as the one before."""

REJECTED = 2.0
"""Error over the tolerance from which a step is taken again."""


def _failed(stepper: Stepper, taken: Taken) -> SolveError:
    seconds = taken.begin.t * stepper.time
    detail = f"Newton's method did not converge at {seconds:.6g} s in a step of {taken.h * stepper.time:.3g} s"
    return SolveError(Status.STOPPED, detail, taken.begin)
