"""The result of a sweep: a table with a row for each case, its failures, statistics and files."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..description.answers import selected
from ..description.records import counted, say, unknown
from ..description.scene import Scene
from ..description.showing import first_lines, ranges_in_words, shown
from ..errors import SceneError
from ..files import write_file
from ..mathematics.arrays import Array
from ..quoting import csv_cell
from .cases import Cases
from .outcomes import Outcomes
from .quantities import Wanted
from .work import SHORT, SOLVED

__all__ = ["ENDINGS", "Failure", "Sweep", "check_table", "gathered"]

ENDINGS = (".csv", ".json", ".npz")
"""Accepted endings of table files."""


@dataclass(frozen=True)
class Failure:
    """A case without an answer.

    Attributes
    ----------
    case : int
        Its row in the table, from 0.
    values : mapping
        Values of the numbers that change, by name.
    status, reason : str
        ``refused``, ``failed`` or ``not run``, and why in a sentence.
    """

    case: int
    values: Mapping[str, float]
    status: str
    reason: str


@dataclass(frozen=True, eq=False)
class Sweep:
    """The result of :func:`~sfetcas.sweep`: the cases and their answers, in order.

    Attributes
    ----------
    scene : Scene
        The scene before its numbers were changed.
    cases : Cases
        A column for each single number.
    quantities : mapping of ndarray
        By the names given, (cases, k), in their units; nan where there is no answer.
    outcomes : Outcomes
        Status, notes and time of each case, a sequence.
    wall : float
        Wall time of the sweep, s.
    interrupted : bool
        Whether it was interrupted; the remaining cases were not run.
    """

    scene: Scene = field(repr=False)
    cases: Cases = field(repr=False)
    quantities: Mapping[str, Array] = field(repr=False)
    outcomes: Outcomes = field(repr=False)
    wall: float
    interrupted: bool = False

    def __len__(self) -> int:
        return len(self.outcomes)

    def __repr__(self) -> str:
        return shown(
            self,
            [f"{counted(len(self), 'case')}, {int(self.solved.sum())} solved in {self.wall:.3g} s"],
            [
                "interrupted" if self.interrupted else "",
                *ranges_in_words(self.cases.columns),
                *ranges_in_words(self.quantities),
                *first_lines(
                    self.failures, lambda one: f"case {one.case}: {one.status}: {one.reason}", "more failures"
                ),
            ],
        )

    @property
    def solved(self) -> Array:
        """Which cases have an answer, (cases,) of bool."""
        return np.isin(self.outcomes.column("status"), (SOLVED, SHORT))

    @property
    def failures(self) -> tuple[Failure, ...]:
        """The cases without an answer."""
        columns = self.cases.columns
        return tuple(
            Failure(i, {name: float(column[i]) for name, column in columns.items()}, outcome.status, outcome.reason)
            for i, outcome in sorted(self.outcomes.own.items())
            if outcome.status not in (SOLVED, SHORT)
        )

    @cached_property
    def table(self) -> Mapping[str, Array]:
        """All columns (cases,), in their units: numbers that change, quantities (``nodes.tip.position.0``), outcomes.

        A quantity with the name of a number that changes, as the position of a node, has the prefix ``answer.``.
        ``status``, ``reason`` and ``notes`` are texts; ``error_estimate`` is the largest of an answer, ``seconds`` the
        time of its solve.
        """
        found: dict[str, Array] = dict(self.cases.columns)
        for name, values in self.quantities.items():
            names = [name] if values.shape[1] == 1 else [_component(name, i) for i in range(values.shape[1])]
            for column, numbers in zip(names, values.T, strict=True):
                found[f"answer.{column}" if column in self.cases.columns else column] = numbers
        for key in ("status", "reason", "notes", "error_estimate", "seconds"):
            found[key] = self.outcomes.column(key)
        return MappingProxyType(found)

    def values(self, name: str) -> Array:
        """A quantity by the name given, (cases,) or for vectors (cases, k), or a column of the table; in its unit.

        Raises
        ------
        SceneError
            There is none of this name.
        """
        if name in self.quantities:
            found = self.quantities[name]
            return found[:, 0] if found.shape[1] == 1 else found
        if name not in self.table:
            raise SceneError(unknown(name, [*self.quantities, *self.table], "columns"))
        return self.table[name]

    def mean(self, name: str) -> Any:
        """Mean of a quantity over the solved cases, a number or (k,)."""
        return self._solved(name, 1).mean(axis=0)

    def deviation(self, name: str) -> Any:
        """Sample standard deviation over the solved cases (divided by their number less one), a number or (k,)."""
        return self._solved(name, 2).std(axis=0, ddof=1)

    def standard_error(self, name: str) -> Any:
        """Standard error of the mean for independent random cases; for a Latin hypercube the true one is smaller."""
        return self.deviation(name) / np.sqrt(self.solved.sum())

    def quantiles(self, name: str, probabilities: ArrayLike) -> Array:
        """Quantiles over the solved cases, by linear interpolation: (probabilities,) or (probabilities, k).

        Raises
        ------
        SceneError
            A probability is not between 0 and 1.
        """
        wanted = np.atleast_1d(np.asarray(probabilities, dtype=float))
        if not ((wanted >= 0.0) & (wanted <= 1.0)).all():
            raise SceneError(f"found {say(wanted.tolist())}, accepted: from 0 to 1", ("probabilities",))
        return np.quantile(self._solved(name, 1), wanted, axis=0)

    def _solved(self, name: str, least: int) -> Array:
        found = self.values(name)
        if found.dtype.kind != "f":
            raise SceneError(f"found the column {name!r}, accepted: one of numbers")
        chosen = found[self.solved]
        if len(chosen) < least:
            raise SceneError(f"found {counted(len(chosen), 'solved case')}, accepted: {least} at least")
        return chosen

    def save(self, path: str | Path) -> None:
        """Write the table, whole or not at all: ``.csv``, ``.json`` or ``.npz``.

        A missing number is an empty cell in CSV and null in JSON; all digits are kept.

        Raises
        ------
        SceneError
            The ending is another one, or the file could not be written.
        """
        check_table(Path(path))
        write_file(Path(path), self.write)

    def write(self, path: Path) -> None:
        """Write the table directly to a new file; :meth:`save` does so without leaving partial files."""
        writers = {".csv": self._write_csv, ".json": self._write_json, ".npz": self._write_npz}
        writers[path.suffix](path)

    def _write_csv(self, path: Path) -> None:
        columns = [_plain(column) for column in self.table.values()]
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(map(csv_cell, self.table))
            writer.writerows(map(csv_cell, row) for row in zip(*columns, strict=True))

    def _write_json(self, path: Path) -> None:
        answer = {
            "title": self.scene.title,
            "cases": len(self),
            "solved": int(self.solved.sum()),
            "interrupted": self.interrupted,
            "seconds": self.wall,
            "columns": {name: _plain(column) for name, column in self.table.items()},
        }
        path.write_text(json.dumps(answer, allow_nan=False, indent=1) + "\n", encoding="utf-8")

    def _write_npz(self, path: Path) -> None:
        columns: dict[str, Any] = dict(self.table)
        np.savez(path, **columns)


def _plain(column: Array) -> list[Any]:
    """A column as texts and numbers; None where it has none."""
    if column.dtype.kind != "f":
        return column.tolist()
    return [value if np.isfinite(value) else None for value in column.tolist()]


def check_table(path: Path) -> None:
    """Refuse a table file of another kind.

    Raises
    ------
    SceneError
        Its ending is not one of ENDINGS.
    """
    if path.suffix not in ENDINGS:
        raise SceneError(f"found the ending {path.suffix!r}, accepted: {', '.join(ENDINGS)}", (str(path),))


def gathered(
    scene: Scene,
    cases: Cases,
    wanted: Sequence[Wanted],
    outcomes: Outcomes,
    wall: float,
    interrupted: bool,
) -> Sweep:
    """The :class:`Sweep` of the outcomes of all cases."""
    quantities = {}
    for k, one in enumerate(wanted):
        found = outcomes.quantity(k)
        found.flags.writeable = False
        quantities[one.text] = found
    return Sweep(scene, cases, MappingProxyType(quantities), outcomes, wall, interrupted)


def _component(text: str, number: int) -> str:
    """A component of a quantity: its number stands before its place, ``members.beam.moment.2 at 0``."""
    name, _ = selected(text)
    return f"{name}.{number}{text[len(name) :]}"
