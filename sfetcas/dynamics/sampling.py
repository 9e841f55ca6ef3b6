"""States at given times: interpolation by polynomials through the ends of neighbouring time steps.

Positions at the ends of steps have the full order of the method; those at the stages within, and the velocities and
internal forces of the index-3 form, do not.  Derivatives of polynomials through the ends nearly do, and replace them.
Where too few steps are connected, between two kinks, or many steps are too long for one polynomial, the stages within
are interpolated instead.
"""

from __future__ import annotations

import functools
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array, unit
from ..mathematics.interpolation import differentiation, evaluation
from ..mathematics.keeping import kept
from ..mechanics.rubbing import Rubs
from ..mechanics.unilateral import NONE, UnilateralRows
from .taken import Memory, Taken

__all__ = ["Sample", "Sampler", "StepRecord", "between", "turned_by"]

DOUBTFUL = 10.0
"""How much more one node less may change the polynomial through ends: that of all stages does not show its error."""

UNEVEN = 0.05
"""Length of a step over that of another one below which no polynomial goes through both: steps change slowly, and end
where something happens.
"""

NODES = 6
"""Intervals of the polynomials, where so many are smoothly connected."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A state of the motion, dimensionless.

    Attributes
    ----------
    t : float
    q : ndarray (rotations, components)
        Quaternions or angles.
    y : ndarray (displacement unknowns,)
    x, v, a : ndarray (quantities,)
        Quantities that carry mass or are damped, and their first and second rates.
    spin : ndarray (rotations, turns)
        Angular velocities about the fixed axes.
    unwrapped : ndarray
        Angles that count turns.
    remembered : ndarray
        What members remember at the begin of the step in which it is.
    acting : ndarray
        Which unilateral constraints act, see :class:`~sfetcas.dynamics.taken.Memory`.
    lost : float
        Energy lost in impacts, and by friction at obstacles, so far.
    rubs : Rubs or None
        What the places that rub on obstacles do, and the directions of sliding a little earlier.
    unilateral : UnilateralRows
        The constraints of ``acting``.
    dragged : ndarray (full,)
        Forces of all friction by full coordinates, where they are told; else empty.
    rubbed : mapping
        For the spots and approaches of these the force (axes,) of friction, and whether it sticks.
    pushed : mapping
        For spots and approaches the force across surfaces, where steps tell it as their mean: accelerations, which say
        it otherwise, may go to and fro from step to step.
    """

    t: float
    q: Array
    y: Array
    x: Array
    v: Array
    a: Array
    spin: Array
    unwrapped: Array
    remembered: Array = field(default_factory=lambda: np.zeros(0))
    acting: Array = field(default_factory=lambda: np.zeros(0))
    lost: float = 0.0
    rubs: Rubs | None = None
    unilateral: UnilateralRows = NONE
    dragged: Array = field(default_factory=lambda: np.zeros(0))
    rubbed: Mapping[Any, tuple[Array, bool]] = field(default_factory=dict)
    pushed: Mapping[Any, float] = field(default_factory=dict)


class Sampler:
    """Interpolates samples of a motion at rising times, each as soon as the steps around it are known.

    Parameters
    ----------
    times : (n,), rising, dimensionless
    stages : int
        Number of stages of a step.
    """

    def __init__(self, times: Sequence[float] | Array, stages: int) -> None:
        self._times, self._next = list(times), 0
        self._steps: list[Taken] = []
        self._stages = stages

    def feed(self, taken: Taken) -> Iterator[Sample]:
        """Yields the samples that become possible with a further step."""
        if taken.begin.last is None:
            yield from self.close()
        self._steps.append(taken)
        # Steps beyond the one a time lies in make its polynomial a central one.
        settled = len(self._steps) - 1 - NODES // 2
        if settled >= 0:
            yield from self._up_to(self._steps[settled].after.t)
        if len(self._steps) > 2 * NODES:
            del self._steps[0]

    def close(self) -> Iterator[Sample]:
        """Samples of the steps so far, which nothing continues smoothly."""
        if self._steps:
            yield from self._up_to(self._steps[-1].after.t)
        self._steps.clear()

    def _up_to(self, end: float) -> Iterator[Sample]:
        while self._next < len(self._times) and self._times[self._next] <= end * (1.0 + tolerances.DECIMAL):
            yield self.at(self._times[self._next])
            self._next += 1

    def at(self, t: float) -> Sample:
        """The sample at a time within the steps that are there."""
        steps = self._steps
        return _begun(_within(steps, self._stages, _number(steps, t), t).sample(t), steps[0])


class StepRecord:
    """The time steps of a motion, from which its state at any time is interpolated when it is asked for.

    It keeps at most ``ROOM`` bytes: of a motion with more steps it keeps every second one, every fourth, and so on.

    Parameters
    ----------
    stages : int
        Number of stages of a step.
    """

    def __init__(self, stages: int) -> None:
        self._stages = stages
        # Each piece is smooth; the steps of one piece are numbered from 1.
        self._pieces: list[list[Taken]] = []
        self._number, self._every, self._bytes = 0, 1, 0
        # The end of the last step, and what is kept of it: most steps begin there.
        self._last: tuple[Memory, Memory] | tuple[None, None] = None, None
        # Of the step that was asked for last: many times lie in each.
        self._kept: _Polynomial | None = None

    def feed(self, taken: Taken) -> None:
        """Keep a further step."""
        self._kept = None
        if taken.begin.last is None:
            self._pieces.append([])
            self._number = 0
        piece = self._pieces[-1]
        if self._number and (self._number - 1) % self._every:
            # The last step is kept only until there is a later one.
            self._bytes -= _bytes(piece.pop())
        self._number += 1
        before, known = self._last
        begin = known if known is not None and before is taken.begin else _alone(taken.begin)
        after = _alone(taken.after)
        self._last = taken.after, after
        piece.append(replace(taken, begin=begin, after=after, lam=NOTHING))
        self._bytes += _bytes(taken)
        if self._bytes > ROOM:
            self._every *= 2
            self._pieces = [[*steps[:-1:2], steps[-1]] for steps in self._pieces]
            self._bytes = sum(_bytes(step) for steps in self._pieces for step in steps)

    @property
    def times(self) -> Array:
        """Begin of the first step and ends of those that are kept, rising, dimensionless; empty without a step."""
        ends = [step.after.t for steps in self._pieces for step in steps]
        return np.array([self._pieces[0][0].begin.t, *ends] if ends else [])

    def sample(self, t: float) -> Sample:
        """The state at a dimensionless time between the first and the last of :attr:`times`."""
        last = [steps[-1] for steps in self._pieces]
        steps = self._pieces[_number(last, t)]
        k = _number(steps, t)
        if self._kept is None or self._kept.own is not steps[k]:
            # Decided at the end of the step: samples are continuous within it.
            self._kept = _within(steps, self._stages, k, steps[k].after.t)
        return _begun(self._kept.sample(t), steps[0])


ROOM = 2**25
"""Bytes of the steps that a motion keeps."""

NOTHING = np.zeros(0)


def _alone(memory: Memory) -> Memory:
    """A state without the steps before it and the multipliers, which interpolation does not need."""
    return replace(memory, last=None, lam=NOTHING)


def _bytes(taken: Taken) -> int:
    """Size of what is kept of a step, nearly."""
    after = taken.after
    more = after.rates, after.remembered
    return sum(part.nbytes for part in (taken.turns, taken.shifts, taken.x, after.q, after.y, after.x, *more))


def _number(steps: Sequence[Taken], t: float) -> int:
    """Which of smoothly connected steps a time lies in."""
    return min(bisect_left(steps, t * (1.0 - 1e-14), key=lambda taken: taken.after.t), len(steps) - 1)


def _within(steps: Sequence[Taken], stages: int, k: int, judged: float) -> _Polynomial:
    """The polynomial of a step of many, by the ends of many or by all stages of few, which is decided at a time."""
    found = []
    for around, chosen in ((NODES, slice(-1, None)), (-(-NODES // stages), slice(0, None))):
        if chosen.start == 0 or len(steps) >= NODES:
            first = max(0, min(k - (around - 1) // 2, len(steps) - around))
            last = min(first + around, len(steps))
            # Beside an event there may be steps so short that the polynomial through all is none of a longer one.
            while first < k and steps[first].h < UNEVEN * steps[k].h:
                first += 1
            while last > k + 1 and steps[last - 1].h < UNEVEN * steps[k].h:
                last -= 1
            found.append(_through(steps[first:last], steps[k], chosen if last - first > 1 else slice(0, None)))
    return found[0] if len(found) == 1 or found[0].doubt(judged) <= DOUBTFUL * found[1].doubt(judged) else found[1]


def _through(steps: Sequence[Taken], own: Taken, chosen: slice) -> _Polynomial:
    """The polynomial through the begin of steps and their chosen stages, about one of the steps."""
    begin, h = own.begin, own.h
    at, turns = [(steps[0].begin.t - begin.t) / h], [_from(begin.q, steps[0].begin.q)]
    # Each step may be counted from an origin of its own.
    x = [steps[0].begin.x + steps[0].begin.origin[1]]
    y = [steps[0].begin.y + steps[0].begin.origin[0]]
    for taken in steps:
        at += [(taken.begin.t - begin.t + c * taken.h) / h for c in taken.places[chosen]]
        x += list(taken.x[chosen] + taken.begin.origin[1])
        y += list(taken.begin.y + taken.shifts[chosen] + taken.begin.origin[0])
        turns += [_from(begin.q, turned_by(taken.begin.q, turn)) for turn in taken.turns[chosen]]
    middle = own.after.x + own.after.origin[1]
    return _Polynomial(own, np.array(at), middle, np.array(x) - middle, np.array(y), np.array(turns))


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """A motion beside one of its time steps.

    Attributes
    ----------
    own : Taken
        The step.
    at : ndarray (n,)
        Its nodes, as shares of the step from its begin.
    middle, x, y, turns : ndarray
        Quantities at the end of the step, and at the nodes from there; displacements; rotation vectors from the begin.
    """

    own: Taken
    at: Array
    middle: Array
    x: Array
    y: Array
    turns: Array

    def sample(self, t: float) -> Sample:
        """The state at a time."""
        own, begin, h, row = self.own, self.own.begin, self.own.h, self._row(t)
        turn = np.einsum("n,nra->ra", row[0], self.turns)
        q, slope = turned_by(begin.q, turn), np.einsum("n,nra->ra", (row @ self._slopes)[0], self.turns) / h
        spin = slope if slope.shape[1] == 1 else quaternion.angular_velocity(turn, slope)
        v, a = _rates(row, self._slopes, self.x)
        lost = begin.lost + _rubbed(own, float(self._place(t)[0]))
        given = own.after.unwrapped, begin.remembered, begin.acting, lost, begin.rubs, begin.unilateral
        position = self.middle + (row @ self.x)[0]
        return Sample(t, q, (row @ self.y)[0], position, v / h, a / h**2, spin, *given)

    def doubt(self, t: float) -> float:
        """How much one node less changes accelerations at a time."""
        if len(self.at) <= 2:
            return 0.0
        here = self._place(t)
        # Without the node that is furthest.
        near = np.delete(np.arange(len(self.at)), int(np.abs(self.at - here).argmax()))
        at, x = self.at[near], self.x[near]
        other = _rates(evaluation(at, here), differentiation(at), x)[1]
        change = _rates(self._row(t), self._slopes, self.x)[1] - other
        return float(np.abs(change).max(initial=0.0)) / self.own.h**2

    def _place(self, t: float) -> Array:
        return np.array([(t - self.own.begin.t) / self.own.h])

    # What is judged at a time is often sampled there.
    @kept(1)
    def _row(self, t: float) -> Array:
        return evaluation(self.at, self._place(t))

    @functools.cached_property
    def _slopes(self) -> Array:
        return differentiation(self.at)


def _begun(sample: Sample, first: Taken) -> Sample:
    """The sample, at time zero with what is known of how the first step begins: from rest nothing turns."""
    if sample.t != 0.0:
        return sample
    v = first.begin.rates[0]
    return replace(sample, v=v, spin=sample.spin if v.any() else np.zeros_like(sample.spin))


def _rubbed(taken: Taken, share: float) -> float:
    """What friction at obstacles has taken away in a share of a step."""
    if not len(taken.rubbed):
        return 0.0
    row = evaluation(np.array([0.0, *taken.rubbed_at]), np.array([np.clip(share, 0.0, 1.0)]))[0]
    return float(row[1:] @ taken.rubbed)


def _rates(row: Array, derivative: Array, values: Array) -> tuple[Array, Array]:
    """First and second derivative of the polynomial through values, by the rows that evaluate it and differentiate."""
    slopes = row @ derivative
    return (slopes @ values)[0], (slopes @ derivative @ values)[0]


def between(samples: Sequence[Sample], t: float) -> Sample:
    """The sample at a time between others, by the polynomials through them."""
    near = min(samples, key=lambda sample: abs(sample.t - t))
    row = evaluation(np.array([sample.t for sample in samples]), np.array([t]))[0]
    turns = np.array([_from(near.q, sample.q) for sample in samples])

    def mean(part: str) -> Array:
        return np.tensordot(row, np.array([getattr(sample, part) for sample in samples]), 1)

    q = turned_by(near.q, np.einsum("n,nra->ra", row, turns))
    given = (
        near.unwrapped,
        near.remembered,
        near.acting,
        near.lost,
        near.rubs,
        near.unilateral,
        near.dragged,
        near.rubbed,
    )
    return Sample(t, q, mean("y"), mean("x"), mean("v"), mean("a"), mean("spin"), *given)


def turned_by(q: Array, turn: Array) -> Array:
    """Rotations (rotations, components) turned further by vectors (rotations, turns), fixed axes."""
    if q.shape[1] == 1:
        return q + turn
    return unit(quaternion.multiply(quaternion.from_rotation_vector(turn), q))


def _from(q: Array, there: Array) -> Array:
    """Rotation vectors (rotations, turns) from rotations to others."""
    if q.shape[1] == 1:
        return there - q
    return quaternion.rotation_vector(quaternion.multiply(there, quaternion.conjugate(q)))
