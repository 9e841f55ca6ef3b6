"""Motions that end at a condition: when a quantity first passes a value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from .. import tolerances
from ..description.task import Until
from ..equilibria.quantities import value_of
from ..errors import SceneError
from ..mathematics.arrays import Array
from .motion import MotionState, Mover
from .sampling import Sample, between

__all__ = ["Watch", "finer"]


class Watch:
    """Finds when a motion ends by ``until``: the first time at which a quantity passes a value."""

    def __init__(self, until: Until, mover: Mover) -> None:
        self._until, self._mover = until, mover
        self._values: list[float] = []
        self._last: int | None = None
        self.ended = False

    def passed(self, instants: Sequence[MotionState]) -> bool:
        """Whether the quantity has passed its value, with enough states beyond to interpolate the time."""
        while len(self._values) < len(instants):
            self._values.append(self._excess(instants[len(self._values)]))
        if self._last is None and self._values[-1] >= 0.0:
            self._last = len(self._values) - 1
        self.ended = self._last is not None
        return self._last is not None and (self._last == 0 or len(self._values) > self._last + AROUND // 2)

    def _excess(self, instant: MotionState) -> float:
        """How far the quantity is beyond its value."""
        until = self._until
        try:
            value = np.asarray(value_of(instant, until.quantity), dtype=float)
            if until.component is None and value.size != 1:
                raise SceneError(f"found a quantity with {value.size} components, accepted: with the key 'component'")
            number = float(value.ravel()[until.component or 0])
        except SceneError as error:
            raise error.within("analysis", "until", "quantity") from None
        return number - until.above if until.above is not None else float(until.below or 0.0) - number

    def up_to_end(
        self, instants: list[MotionState], times: Array, sample: Callable[[float], Sample] | None = None
    ) -> list[MotionState]:
        """The states at the times (n,) of the answer, s, up to the end, and the interpolated state at the end.

        ``sample`` tells the sample at a dimensionless time; by default it is interpolated between the states.
        """
        wanted = [
            instant for instant in instants if np.isclose(instant.time, times, rtol=tolerances.DECIMAL, atol=0.0).any()
        ]
        if self._last is None:
            return wanted
        end = self._end(instants, sample)
        return [*(instant for instant in wanted if instant.time < end.time), end]

    def note(self, instants: Sequence[MotionState]) -> str:
        """A sentence on how the motion ended."""
        until = self._until
        beyond = f"above {until.above:g}" if until.above is not None else f"below {until.below:g}"
        if self._last is None:
            return f"{until.quantity} never got {beyond}"
        when = "at its begin already" if self._last == 0 else f"at {instants[-1].time:.9g} s"
        return f"the motion ended {when}, as {until.quantity} was {beyond}"

    def _end(self, instants: list[MotionState], sample: Callable[[float], Sample] | None) -> MotionState:
        last = self._last
        assert last is not None
        if last == 0:
            return instants[0]
        first = max(0, min(last - AROUND // 2, len(instants) - AROUND))
        samples = [instant.sample for instant in instants[first : first + AROUND]]
        sample = partial(between, samples) if sample is None else sample
        low, high = instants[last - 1].sample.t, instants[last].sample.t
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            beyond = self._excess(self._mover.instant(sample(middle))) >= 0.0
            low, high = (low, middle) if beyond else (middle, high)
        return self._mover.instant(sample(high))


AROUND = 6
"""States between which the end of a motion is interpolated."""

HALVINGS = 40
"""Of the time between two of them: down to rounding."""

FINER = 8
"""Parts of the spacing of the answers in which the end of a motion is looked for."""


def finer(times: Array) -> Array:
    """Times (n,), s, with ``FINER`` parts to each spacing."""
    parts = np.arange(FINER) / FINER
    return np.append((times[:-1, None] + np.diff(times)[:, None] * parts).ravel(), times[-1])
