"""The cases of a sweep: values of numbers of a scene, given, as all combinations, or drawn at random."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..description.columns import read_columns
from ..description.records import counted, say, whole
from ..description.scene import Scene
from ..description.showing import ranges_in_words, shown
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..parametric.arguments import argument, with_values
from .distributions import Distribution

__all__ = ["MOST_CASES", "Cases", "cases_from", "grid", "read_cases", "sampled"]

MOST_CASES = 10_000_000
"""Largest number of cases."""


@dataclass(frozen=True, eq=False)
class Cases:
    """A table of values of numbers of a scene, a row for each case.

    Attributes
    ----------
    columns : mapping of ndarray
        By the names of :func:`~sfetcas.changed`, in the units of the scene: (cases,) for a number,
        (cases, k) for a list of k numbers.
    random : bool
        Whether the cases are a random sample, so that statistics over them have a meaning.

    Raises
    ------
    SceneError
        There is no column or no case, columns are of unlike length, or an entry is no finite number.
    """

    columns: Mapping[str, Array]
    random: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.columns, Mapping) or not self.columns:
            raise SceneError(f"found {say(self.columns)}, accepted: a table of at least one named column", ("cases",))
        found = {_name(name): _column(name, values) for name, values in self.columns.items()}
        lengths = {name: len(column) for name, column in found.items()}
        (first, length), *others = lengths.items()
        for name, other in others:
            if other != length:
                message = f"found {other} in {name} and {length} in {first}"
                raise SceneError(f"{message}, accepted: columns of the same length", ("cases",))
        object.__setattr__(self, "columns", MappingProxyType(found))

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __repr__(self) -> str:
        sample = "a random sample" if self.random else ""
        return shown(self, [counted(len(self), "case"), sample], ranges_in_words(self.columns))

    def single(self, scene: Scene) -> Cases:
        """The cases with a column for each single number: ``loads.tip.value.0``, ... instead of ``loads.tip.value``.

        Raises
        ------
        SceneError
            The scene has no such numbers, or not as many.
        """
        found: dict[str, Array] = {}
        for name, column in self.columns.items():
            try:
                known = argument(scene, name)
                # What is accepted by name alone shows with the scene's own numbers.
                with_values(scene, {name: known.default})
            except SceneError as error:
                raise SceneError(error.bare, ("cases", name)) from None
            rows = column.reshape(len(column), -1)
            if rows.shape[1] != len(known.names):
                message = f"found {counted(rows.shape[1], 'number')} a case"
                raise SceneError(f"{message}, accepted: {len(known.names)}, {', '.join(known.names)}", ("cases", name))
            for single, values in zip(known.names, rows.T, strict=True):
                if single in found:
                    raise SceneError(f"found {single} more than once, accepted: each number once", ("cases",))
                found[single] = values
        return Cases(found, self.random)


def cases_from(table: Any) -> Cases:
    """Cases from a table of columns; :class:`Cases` are returned as they are.

    Raises
    ------
    SceneError
        It is no table of columns.
    """
    return table if isinstance(table, Cases) else Cases(table)


def grid(values: Mapping[str, Sequence[ArrayLike] | Array]) -> Cases:
    """All combinations of values, in the units of the scene; the last name varies fastest.

    ``grid({"loads.tip.value.1": [0, 5, 10], "sections.strip.EI3": [1, 2]})`` has six cases.

    Raises
    ------
    SceneError
        As :class:`Cases`, or there would be too many.
    """
    lists = {
        name: column for name, values in values.items() for name, column in cases_from({name: values}).columns.items()
    }
    count = float(np.prod([float(len(column)) for column in lists.values()]))
    if count > MOST_CASES:
        raise SceneError(f"found {count:.3g} combinations, accepted: {MOST_CASES} at most", ("cases",))
    rows = list(itertools.product(*(range(len(column)) for column in lists.values())))
    chosen = np.array(rows, dtype=np.intp).reshape(len(rows), len(lists))
    return Cases({name: column[chosen[:, i]] for i, (name, column) in enumerate(lists.items())})


def sampled(
    count: int,
    distributions: Mapping[str, Distribution],
    *,
    seed: int = 0,
    method: Literal["random", "latin"] = "random",
) -> Cases:
    """Cases drawn at random, reproducible by the seed.

    Parameters
    ----------
    count : int
        Number of cases.
    distributions : mapping
        ``{"sections.strip.EI3": Normal(1.0, 0.05), "loads.tip.value.1": Uniform(9, 11)}``; numbers are drawn
        independently.
    seed : int, optional
    method : str, optional
        ``random``: independent cases; a larger ``count`` adds further ones.  ``latin``: a Latin hypercube, in which
        each of ``count`` equally probable intervals of each number has one case; means are more accurate then.

    Raises
    ------
    SceneError
        Anything that is not accepted.
    """
    count = whole(count, 1, MOST_CASES, what="number of cases", name="count")
    if method not in ("random", "latin"):
        raise SceneError(f"found {say(method)}, accepted: 'random' or 'latin'", ("method",))
    seed = whole(seed, 0, name="seed")
    if not isinstance(distributions, Mapping) or not distributions:
        raise SceneError(f"found {say(distributions)}, accepted: a table of at least one distribution", ("cases",))
    for name, one in distributions.items():
        if not isinstance(one, Distribution):
            accepted = "Normal(mean, deviation), LogNormal(mean, deviation) or Uniform(low, high)"
            raise SceneError(f"found {say(one)}, accepted: {accepted}", ("cases", str(name)))
    random = np.random.default_rng(seed)
    places = random.random((count, len(distributions)))
    if method == "latin":
        strata = random.permuted(np.tile(np.arange(count), (len(distributions), 1)), axis=1).T
        places = (strata + places) / count
    # Zero and one are no probabilities of what has no bounds.
    inside = np.clip(places, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)
    return Cases({name: one.at(inside[:, i]) for i, (name, one) in enumerate(distributions.items())}, random=True)


def read_cases(path: Path) -> Cases:
    """Cases from a CSV file, with the names of numbers in its first line.

    Raises
    ------
    SceneError
        There is no such file, or something else in it.
    """
    columns = read_columns(path, "case")
    try:
        return Cases({name: np.array(column) for name, column in columns.items()})
    except SceneError as error:
        raise error.within(str(path)) from None


def _name(name: object) -> str:
    if not isinstance(name, str):
        raise SceneError(f"found {say(name)}, accepted: names of numbers, as 'loads.tip.value.1'", ("cases",))
    return name


def _column(name: str, values: Any) -> Array:
    """A column as a read-only array of finite numbers."""
    accepted = "a list of finite numbers, or of lists of as many"
    try:
        found = np.array(values)
    except (TypeError, ValueError):
        raise SceneError(f"found {say(values)}, accepted: {accepted}", ("cases", name)) from None
    if found.dtype.kind not in "iuf" or found.ndim not in (1, 2) or not found.size:
        raise SceneError(f"found {say(values)}, accepted: {accepted}", ("cases", name))
    bad = np.flatnonzero(~np.isfinite(found.astype(float)).reshape(len(found), -1).all(axis=1))
    if len(bad):
        raise SceneError(
            f"found {say(found[bad[0]].tolist())} in case {bad[0]}, accepted: finite numbers", ("cases", name)
        )
    column = found.astype(float)
    column.flags.writeable = False
    return column
