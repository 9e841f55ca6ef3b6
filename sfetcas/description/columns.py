"""Columns of numbers in CSV files."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence

from ..errors import SceneError
from ..files import UnreadableError, read_file
from .records import counted, enumerated

__all__ = ["read_columns"]

LARGEST = 200_000_000
"""Bytes of a table: ten million numbers with all their digits."""


def read_columns(path: str | os.PathLike[str], row: str = "row", needed: Sequence[str] = ()) -> dict[str, list[float]]:
    """The columns of a CSV file by the names in its first line.

    Parameters
    ----------
    path
    row : str
        What a line of numbers is, for messages.
    needed : sequence of str
        Columns that there have to be.

    Raises
    ------
    SceneError
        There is no such file, or something else in it.
    """
    where = (os.fspath(path),)
    try:
        text = read_file(path, LARGEST, "a CSV table").decode("utf-8-sig")
        lines = [line for line in csv.reader(io.StringIO(text, newline=""), strict=True) if line]
    except FileNotFoundError:
        raise SceneError("there is no such file, accepted: a CSV table", where) from None
    except UnreadableError as error:
        raise SceneError(str(error), where) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise SceneError(f"could not be read as a CSV table: {error}", where) from None
    if len(lines) < 2:
        accepted = f"a line of names and a line of numbers for each {row}"
        raise SceneError(f"found {counted(len(lines), 'line')}, accepted: {accepted}", where)
    names = [name.strip() for name in lines[0]]
    if all(map(_is_number, names)):
        raise SceneError(f"found the numbers {enumerated(names)} in the first line, accepted: names there", where)
    if len(set(names)) < len(names):
        raise SceneError("found a name twice in the first line, accepted: each once", where)
    if not set(needed) <= set(names):
        accepted = f"columns {' and '.join(needed)} with these names in the first line, separated by commas"
        raise SceneError(f"found the columns {enumerated(names)}, accepted: {accepted}", where)
    columns: dict[str, list[float]] = {name: [] for name in names}
    for number, line in enumerate(lines[1:], start=1):
        if len(line) != len(names):
            message = f"found {counted(len(line), 'cell')} in {row} {number} and {len(names)} in the first line"
            raise SceneError(f"{message}, accepted: as many", where)
        for name, cell in zip(names, line, strict=True):
            columns[name].append(_cell(cell, (*where, f"{row} {number}", name)))
    return columns


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cell(text: str, where: tuple[str, ...]) -> float:
    try:
        return float(text)
    except ValueError:
        raise SceneError(f"found {text!r}, accepted: a number", where) from None
