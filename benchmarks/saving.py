"""What benchmarks print, as Markdown and in files: ``python -m benchmarks NAME ... --save``.

``benchmarks/results`` has one file for each saved benchmark: what it printed below a head that tells date, machine and
versions.  Results that are data as well stand beside it as JSON.
"""

from __future__ import annotations

import contextlib
import datetime
import io
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import sfetcas
from sfetcas.tradeoff.machine import machine

__all__ = ["RESULTS", "described", "head", "row", "saved"]

RESULTS = Path(__file__).parent / "results"


def head(*cells: str) -> None:
    """Print the head of a Markdown table."""
    row(*cells)
    print("|" + "---|" * len(cells))


def row(*cells: object) -> None:
    """Print a row of a Markdown table at once, so that a long benchmark shows how far it is."""
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def described() -> dict[str, Any]:
    """Date, machine and versions of a measurement that is made now."""
    return {"date": datetime.date.today().isoformat(), "machine": {**machine(), "sfetcas": sfetcas.__version__}}


def saved(name: str, benchmark: Callable[[], Mapping[str, Any] | None], folder: Path = RESULTS) -> list[Path]:
    """Run a benchmark, print what it prints and write it into a folder too.

    Parameters
    ----------
    name : str
        Of the benchmark and of the files.
    benchmark : callable
        What it returns, if anything, is written as JSON, below date, machine and versions.
    folder : path

    Returns
    -------
    list of Path
        The files that were written.
    """
    # The load before the benchmark adds its own.
    about = described()
    text = io.StringIO()
    with _copied(text):
        data = benchmark()
    folder.mkdir(exist_ok=True)
    files = {folder / f"{name}.md": f"{_title(name, about)}\n{text.getvalue().strip()}\n"}
    if data is not None:
        files[folder / f"{name}.json"] = json.dumps({**about, **data}, indent=1, allow_nan=False) + "\n"
    for path, content in files.items():
        path.write_text(content, encoding="utf-8")
    return list(files)


def _title(name: str, about: Mapping[str, Any]) -> str:
    lines = [f"# Benchmark: {name}", "", f"`python -m benchmarks {name}`, {about['date']}", ""]
    return "\n".join([*lines, *(f"- {key}: {value}" for key, value in about["machine"].items()), ""])


class _Copy(io.TextIOBase):
    """A text stream that writes to two others."""

    def __init__(self, first: Any, second: Any) -> None:
        self.both = (first, second)

    def write(self, text: str) -> int:
        for stream in self.both:
            stream.write(text)
        return len(text)

    def flush(self) -> None:
        for stream in self.both:
            stream.flush()


@contextlib.contextmanager
def _copied(text: io.StringIO) -> Iterator[None]:
    with contextlib.redirect_stdout(_Copy(sys.stdout, text)):
        yield
