"""How answers print: a line, and a few more that say what a user wants to see first; words shared with the reports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, TypeVar

import numpy as np

from ..quoting import printable
from .records import brief, counted

__all__ = [
    "WAYS",
    "error_in_words",
    "few",
    "first_lines",
    "made",
    "named",
    "notes_in_words",
    "number_in_words",
    "ranges_in_words",
    "shown",
    "stability_in_words",
    "values_in_words",
]

T = TypeVar("T")

MOST = 4
"""Entries of a list that are printed; of the rest only how many there are."""

WAYS = ("way out", "ways out")
"""Negative eigenvalues in words."""


def shown(thing: object, head: Iterable[str], lines: Iterable[str] = ()) -> str:
    """The text of an object: the name of its class with what matters most, then lines below it; empty ones left out.

    Characters that a terminal would obey stand as escapes.
    """
    first = f"{type(thing).__name__}({', '.join(filter(None, head))})"
    return "\n".join(map(printable, [first, *(f"  {line}" for line in lines if line)]))


def made(thing: Any) -> str:
    """A dataclass as it would be made, without what stands at its default."""
    given = {one.name: getattr(thing, one.name) for one in fields(thing) if one.repr}
    differing = {one.name for one in fields(thing) if one.default is MISSING or given.get(one.name) != one.default}
    return f"{type(thing).__name__}({', '.join(f'{key}={brief(x)}' for key, x in given.items() if key in differing)})"


def few(texts: Iterable[str], most: int = MOST) -> str:
    """The first of some texts, and how many more there are.

    >>> few("abcdefg")
    'a, b, c, d, ... and 3 more'
    """
    known = list(texts)
    more = f", ... and {len(known) - most} more" if len(known) > most else ""
    return ", ".join(known[:most]) + more


def named(names: Iterable[str], kind: str, more: str | None = None) -> str:
    """How many there are of a kind, and the first names as texts: ``2 nodes: 'A', 'tip'``; empty without any.

    >>> named(["A", "a 'tip'"], "node"), named([], "node")
    ('2 nodes: \\'A\\', "a \\'tip\\'"', '')
    """
    known = list(names)
    return f"{counted(len(known), kind, more)}: {few(map(brief, known))}" if known else ""


def number_in_words(value: Any, unit: str = "", digits: int = 6) -> str:
    """A number or a vector with few digits and its unit; of a long vector the first entries.

    >>> number_in_words([0.25, -0.0, 1e9], "m"), number_in_words(1 / 3)
    ('(0.25, 0, 1e+09) m', '0.333333')
    """
    values = np.asarray(value, dtype=float)
    texts = [f"{x + 0.0:.{digits}g}" for x in values.ravel().tolist()]
    text = texts[0] if values.size == 1 else f"({few(texts)})"
    return f"{text} {unit}" if unit else text


def first_lines(items: Iterable[T], line: Callable[[T], str], kind: str = "more") -> list[str]:
    """A line for each of the first items, and how many more there are."""
    known = list(items)
    more = [f"... and {len(known) - MOST} {kind}"] if len(known) > MOST else []
    return [*map(line, known[:MOST]), *more]


def values_in_words(values: Mapping[str, Any], units: Mapping[str, str] | None = None) -> list[str]:
    """A line for each of the first values by name, with units where these are given."""
    return first_lines(values, lambda name: f"{name}: {number_in_words(values[name], (units or {}).get(name, ''))}")


def ranges_in_words(columns: Mapping[str, Any]) -> list[str]:
    """A line for each of the first columns (rows,) or (rows, n) by name: between which numbers it is, nan left out."""

    def line(name: str) -> str:
        column = np.asarray(columns[name], dtype=float)
        known = column[np.isfinite(column).reshape(len(column), -1).all(axis=1)]
        if not len(known):
            return f"{name}: no numbers"
        return f"{name}: from {number_in_words(known.min(axis=0))} to {number_in_words(known.max(axis=0))}"

    return first_lines(columns, line)


def stability_in_words(stable: Any, negative: int) -> str:
    """``stable``, ``neutral``, ``unstable (2 ways out)`` or ``stability not defined``."""
    if stable == "not defined":
        return "stability not defined"
    return {"True": "stable", "False": f"unstable ({counted(negative, *WAYS)})"}.get(str(stable), "neutral")


def error_in_words(error: float | None, quantity: str = "") -> str:
    """``estimated error 1.0e-05 of the size``, of another quantity by its name; or that there is no estimate."""
    if error is None:
        return "error not estimated"
    return f"estimated error {error:.1e} of {quantity or 'the size'}"


def notes_in_words(notes: Sequence[str]) -> list[str]:
    """A line with the first note, and how many more there are."""
    if not notes:
        return []
    return [f"note: {notes[0]}" + (f" (and {counted(len(notes) - 1, 'more note')}, see .notes)" if notes[1:] else "")]
