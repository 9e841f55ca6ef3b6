"""Accuracy and speed measured: ``python -m benchmarks [NAME ...] [--save]``, from a clone of the repository.

Names are order, loads, size, repeated, whole, derivatives, net, path, motion, steps, code, accuracy, pieces, sweep,
batch, estimates, import, extremes and compared; left out, all are run.  ``--save`` writes what each prints into
``benchmarks/results``, too.

Others, ``random``, ``jitter``, ``contact``, ``members``, ``ways`` and ``heap``, stand alone, take options (``--help``)
and half an hour each.

Not a test: times are those of the machine at hand, the least of several or medians as the tables say.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any

from sfetcas.errors import SceneError, SolveError

from .accuracy import estimates, knob
from .code import code
from .compared import compared
from .contact_run import contact
from .derivatives import derivatives
from .extremes import extremes
from .heap import heap
from .importing import importing
from .jitter import jitter
from .many import batch, many
from .member_run import members
from .motion import motion, step_cost
from .pieces import pieces
from .random_run import random_scenes
from .saving import saved
from .speed import loads, net, order, path, repeated, size, whole
from .ways import ways

__all__ = ["main"]

Benchmark = Callable[[], Mapping[str, Any] | None]
"""Prints tables, and may return what is to be saved as data."""


def main(words: list[str]) -> None:
    """Run the benchmarks of these names, all by default; with ``--save`` among the words save their results."""
    known: dict[str, Benchmark] = {"order": order, "loads": loads, "size": size}
    known |= {
        "repeated": repeated,
        "whole": whole,
        "derivatives": derivatives,
        "net": net,
        "path": path,
        "motion": motion,
    }
    known |= {"steps": step_cost, "code": code, "accuracy": knob, "pieces": pieces, "sweep": many, "batch": batch}
    known |= {"estimates": estimates, "import": importing, "extremes": extremes, "compared": compared}
    alone: dict[str, Callable[[list[str]], None]] = {"random": random_scenes, "jitter": jitter}
    alone |= {"contact": contact, "members": members, "ways": ways, "heap": heap}
    if words[:1] and words[0] in alone:
        alone[words[0]](words[1:])
        return
    names = [word for word in words if word != "--save"]
    for name in names or list(known):
        if name not in known:
            raise SystemExit(f"found benchmark {name!r}, accepted: {', '.join([*known, *alone])}")
        try:
            _run(name, known[name], save="--save" in words)
        except (SceneError, SolveError) as error:
            print(f"{name}: {error}")
        print()


def _run(name: str, benchmark: Benchmark, *, save: bool) -> None:
    if not save:
        benchmark()
        return
    for file in saved(name, benchmark):
        print(f"saved {file}")


if __name__ == "__main__":
    main(sys.argv[1:])
