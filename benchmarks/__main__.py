"""Accuracy and speed measured: ``python -m benchmarks [NAME ...]``, from a clone of the repository.

Names are order, loads, size, repeated, derivatives, net, path, motion, steps, code, accuracy, pieces, sweep, import
and extremes; left out, all are run.  Four others, ``random``, ``jitter``, ``contact`` and ``ways``, stand alone, take
options (``--help``) and half an hour each.

Not a test: times are medians on the machine at hand, printed as tables.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

from sfetcas.errors import SceneError, SolveError

from .accuracy import knob
from .code import code
from .contact_run import contact
from .derivatives import derivatives
from .extremes import extremes
from .importing import importing
from .jitter import jitter
from .many import many
from .motion import motion, step_cost
from .pieces import pieces
from .random_run import random_scenes
from .speed import loads, net, order, path, repeated, size
from .ways import ways

__all__ = ["main"]


def main(names: list[str]) -> None:
    """Run the benchmarks of these names, all by default."""
    known = {"order": order, "loads": loads, "size": size, "repeated": repeated, "derivatives": derivatives}
    known |= {"net": net, "path": path, "motion": motion, "steps": step_cost, "code": code}
    known |= {"accuracy": knob, "pieces": pieces, "sweep": many, "import": importing, "extremes": extremes}
    alone: dict[str, Callable[[list[str]], None]] = {"random": random_scenes, "jitter": jitter}
    alone |= {"contact": contact, "ways": ways}
    if names[:1] and names[0] in alone:
        alone[names[0]](names[1:])
        return
    for name in names or list(known):
        if name not in known:
            raise SystemExit(f"found benchmark {name!r}, accepted: {', '.join([*known, *alone])}")
        try:
            known[name]()
        except (SceneError, SolveError) as error:
            print(f"{name}: {error}")
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
