"""The outcomes of many cases: of plain ones in columns, which take little memory, of all others one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, overload

import numpy as np

from ..mathematics.arrays import Array
from .work import SOLVED, Outcome

__all__ = ["Outcomes"]


@dataclass(frozen=True, eq=False)
class Outcomes(Sequence[Outcome]):
    """The outcome of each case, in their order.

    Attributes
    ----------
    own : mapping of int to Outcome
        By their numbers those of cases that are not plain.
    numbers : sequence of ndarray (cases, k)
        Of plain ones, which are solved without a note, the values of each quantity.
    errors, seconds : ndarray (cases,)
        Their error estimates and times.
    """

    own: Mapping[int, Outcome]
    numbers: Sequence[Array]
    errors: Array
    seconds: Array

    @classmethod
    def of(cls, outcomes: Iterable[Outcome]) -> Outcomes:
        """Outcomes of which none is plain."""
        own = dict(enumerate(outcomes))
        return cls(own, (), np.full(len(own), np.nan), np.full(len(own), np.nan))

    def __len__(self) -> int:
        return len(self.errors)

    @overload
    def __getitem__(self, number: int) -> Outcome: ...

    @overload
    def __getitem__(self, number: slice) -> tuple[Outcome, ...]: ...

    def __getitem__(self, number: int | slice) -> Outcome | tuple[Outcome, ...]:
        if isinstance(number, slice):
            return tuple(self[i] for i in range(*number.indices(len(self))))
        i = range(len(self))[number]
        known = self.own.get(i)
        if known is not None:
            return known
        numbers = tuple(values[i] for values in self.numbers)
        return Outcome(SOLVED, "", numbers, "", float(self.errors[i]), float(self.seconds[i]))

    def column(self, key: str) -> Array:
        """A field of all outcomes but their numbers, (cases,): texts, or numbers."""
        plain: dict[str, Any] = {"status": SOLVED, "error_estimate": self.errors, "seconds": self.seconds}
        kind: type = {one.name: float if one.type == "float" else object for one in fields(Outcome)}[key]
        found: Array = np.empty(len(self), dtype=kind)
        found[:] = plain.get(key, "")
        for i, outcome in self.own.items():
            found[i] = getattr(outcome, key)
        return found if kind is float else found.astype(str)

    def quantity(self, number: int) -> Array:
        """The values of a quantity, (cases, k): nan where there are none, or fewer."""
        rows = {i: outcome.numbers[number] for i, outcome in self.own.items() if outcome.numbers}
        plain = self.numbers[number] if len(self.numbers) else np.full((len(self), 1), np.nan)
        found = np.full((len(self), max([1, plain.shape[1], *map(len, rows.values())])), np.nan)
        found[:, : plain.shape[1]] = plain
        for i, row in rows.items():
            found[i, : len(row)] = row
        return found
