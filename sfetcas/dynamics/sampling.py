"""States at given times: interpolation by polynomials through the ends of neighbouring time steps.

Positions at the ends of steps have the full order of the method; those at the stages within, and the velocities and
internal forces of the index-3 form, do not.  Derivatives of polynomials through the ends nearly do, and replace them.
Where too few steps are connected, between two kinks, or many steps are too long for one polynomial, the stages within
are interpolated instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array, unit
from ..mathematics.interpolation import differentiation, evaluation
from ..mechanics.rubbing import Rubs
from ..mechanics.unilateral import NONE, UnilateralRows
from .integrating import Memory, Taken

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
        Which unilateral constraints act, see :class:`~sfetcas.dynamics.integrating.Memory`.
    lost : float
        Energy lost in impacts, and by friction at obstacles, so far.
    rubs : Rubs or None
        What the places that rub on obstacles do, and the directions of sliding a little earlier.
    unilateral : UnilateralRows
        The constraints of ``acting``.
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
        return _within(self._steps, self._stages, t)


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

    def feed(self, taken: Taken) -> None:
        """Keep a further step."""
        if taken.begin.last is None:
            self._pieces.append([])
            self._number = 0
        piece = self._pieces[-1]
        if self._number and (self._number - 1) % self._every:
            # The last step is kept only until there is a later one.
            self._bytes -= _bytes(piece.pop())
        self._number += 1
        piece.append(replace(taken, begin=_alone(taken.begin), after=_alone(taken.after), lam=NOTHING))
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
        ends = [steps[-1].after.t for steps in self._pieces]
        piece = min(int(np.searchsorted(ends, t * (1.0 - 1e-14))), len(ends) - 1)
        return _within(self._pieces[piece], self._stages, t, whole=True)


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


def _within(steps: Sequence[Taken], stages: int, t: float, *, whole: bool = False) -> Sample:
    """The sample at a time within smoothly connected steps.

    Which polynomial is taken is decided at that time, or at the end for the ``whole`` step: then samples are
    continuous within it.
    """
    ends = [taken.after.t for taken in steps]
    k = min(int(np.searchsorted(ends, t * (1.0 - 1e-14))), len(ends) - 1)
    if whole and t != ends[k]:
        here, judged = (_polynomials(steps, stages, ends, k, at) for at in (t, ends[k]))
        found = [(sample, doubt) for (sample, _), (_, doubt) in zip(here, judged, strict=True)]
    else:
        found = _polynomials(steps, stages, ends, k, t)
    ends_only, doubt = found[0]
    sample = ends_only if len(found) == 1 or doubt <= DOUBTFUL * found[1][1] else found[1][0]
    if t != 0.0:
        return sample
    # How it begins is known; from rest nothing turns.
    v = steps[0].begin.rates[0]
    return replace(sample, v=v, spin=sample.spin if v.any() else np.zeros_like(sample.spin))


def _polynomials(
    steps: Sequence[Taken], stages: int, ends: Sequence[float], k: int, t: float
) -> list[tuple[Sample, float]]:
    """The samples within a step by the ends of many steps, and by all stages of few, with their doubts."""
    found = []
    for around, chosen in ((NODES, slice(-1, None)), (-(-NODES // stages), slice(0, None))):
        if chosen.start == 0 or len(ends) >= NODES:
            first = max(0, min(k - (around - 1) // 2, len(ends) - around))
            last = min(first + around, len(ends))
            # Beside an event there may be steps so short that the polynomial through all is none of a longer one.
            while first < k and steps[first].h < UNEVEN * steps[k].h:
                first += 1
            while last > k + 1 and steps[last - 1].h < UNEVEN * steps[k].h:
                last -= 1
            found.append(_interpolated(steps[first:last], steps[k], t, chosen if last - first > 1 else slice(0, None)))
    return found


def _interpolated(steps: Sequence[Taken], own: Taken, t: float, chosen: slice) -> tuple[Sample, float]:
    """The sample between steps, of which the chosen stages count, and how much one node less changes it."""
    begin, h = own.begin, own.h
    nodes, turns = [(steps[0].begin.t - begin.t) / h], []
    # Each step may be counted from an origin of its own.
    x = [steps[0].begin.x + steps[0].begin.origin[1]]
    y = [steps[0].begin.y + steps[0].begin.origin[0]]
    turns.append(_from(begin.q, steps[0].begin.q))
    for taken in steps:
        nodes += [(taken.begin.t - begin.t + c * taken.h) / h for c in taken.places[chosen]]
        x += list(taken.x[chosen] + taken.begin.origin[1])
        y += list(taken.begin.y + taken.shifts[chosen] + taken.begin.origin[0])
        turns += [_from(begin.q, turned_by(taken.begin.q, turn)) for turn in taken.turns[chosen]]
    at, here = np.array(nodes), np.array([(t - begin.t) / h])
    row = evaluation(at, here)
    middle = own.after.x + own.after.origin[1]
    quantities = np.array(x) - middle
    turn = np.einsum("n,nra->ra", row[0], np.array(turns))
    q, slope = turned_by(begin.q, turn), np.einsum("n,nra->ra", (row @ differentiation(at))[0], np.array(turns)) / h
    spin = slope if slope.shape[1] == 1 else quaternion.angular_velocity(turn, slope)
    v, a = _rates(at, here, quantities)
    # Without the node that is furthest.
    near = np.delete(np.arange(len(at)), int(np.abs(at - here).argmax()))
    doubt = np.abs(a - _rates(at[near], here, quantities[near])[1]).max(initial=0.0) if len(at) > 2 else 0.0
    position = middle + (row @ quantities)[0]
    given = (
        own.after.unwrapped,
        begin.remembered,
        begin.acting,
        begin.lost + _rubbed(own, float(here[0])),
        begin.rubs,
        begin.unilateral,
    )
    sample = Sample(t, q, (row @ np.array(y))[0], position, v / h, a / h**2, spin, *given)
    return sample, float(doubt) / h**2


def _rubbed(taken: Taken, share: float) -> float:
    """What friction at obstacles has taken away in a share of a step."""
    if not len(taken.rubbed):
        return 0.0
    row = evaluation(np.array([0.0, *taken.rubbed_at]), np.array([np.clip(share, 0.0, 1.0)]))[0]
    return float(row[1:] @ taken.rubbed)


def _rates(at: Array, here: Array, values: Array) -> tuple[Array, Array]:
    """First and second derivative of the polynomial through values."""
    slopes = evaluation(at, here) @ differentiation(at)
    return (slopes @ values)[0], (slopes @ differentiation(at) @ values)[0]


def between(samples: Sequence[Sample], t: float) -> Sample:
    """The sample at a time between others, by the polynomials through them."""
    near = min(samples, key=lambda sample: abs(sample.t - t))
    row = evaluation(np.array([sample.t for sample in samples]), np.array([t]))[0]
    turns = np.array([_from(near.q, sample.q) for sample in samples])

    def mean(part: str) -> Array:
        return np.tensordot(row, np.array([getattr(sample, part) for sample in samples]), 1)

    q = turned_by(near.q, np.einsum("n,nra->ra", row, turns))
    given = near.unwrapped, near.remembered, near.acting, near.lost, near.rubs, near.unilateral
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
