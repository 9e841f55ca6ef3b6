"""This package beside other programs on the same problems, in one run; part of ``python -m benchmarks``.

The other programs are Exudyn and OpenSees (``pip install exudyn openseespy``); one that is not installed is left out.
Each program solves each problem in a process of its own and on one thread, with the fastest of many settings that
reach a wanted error, which is chosen knowing the exact solution.  See :mod:`~benchmarks.compared_problems`.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from sfetcas.tradeoff.tables import markdown_table

from . import compared_exudyn, compared_opensees, compared_sfetcas
from .compared_problems import MOTION, NEAR, PENDULUM_STIFF, STATICS, STIFF, Row
from .worker import Worker

__all__ = ["compared", "large_table", "small_table"]

OWN = "sfetcas"

OTHERS = ("exudyn", "openseespy")
"""Packages of other programs."""

ROWS: dict[str, Callable[[str], list[Row]]] = {
    OWN: compared_sfetcas.rows,
    "exudyn": compared_exudyn.rows,
    "openseespy": compared_opensees.rows,
}
"""What measures each program; :data:`OWN` and those of :data:`OTHERS` that are installed are run."""

LEFT_OUT = {
    ("openseespy", MOTION.name): "in the plane its corotational frames fail once a section has turned by half a turn, "
    "in space they need 10 s for an error of 1.3e-3"
}
"""Why a program is not run on a problem, as measured with any of its integrators, initial accelerations given."""

LONGEST = 1200.0
"""Seconds that a program may take for a problem, the search for its settings included."""

SHOWN = (
    ("S1", 1e-3),
    ("S1", 1e-7),
    ("S1b", 1e-5),
    ("S4", 1e-5),
    ("S2b", 1e-3),
    ("S2b", 1e-5),
    ("D1", 1e-3),
    ("D1", 1e-4),
)
"""Problems and wanted errors of the small table."""

HEADS = (
    "problem",
    "error",
    "whole run: IPOPT / Newton, ms",
    "solved again: cold / warm, ms",
    "exported C: cold / warm, ms",
    "others: cold / warm, ms",
)

INTRODUCTION = f"""\
Milliseconds of wall time on one thread, the least of several runs. Of many elements, meshes and settings of each
program the fastest that reaches a wanted error is shown; it is chosen knowing the exact solution, as nobody can in
practice. Errors are of the compared place over the length, in a motion the largest at a hundred times, against the
exact solution of the model that a program solves: inextensible here; in the other programs EA, and GA where beams
shear, are {STIFF:,.0f} EI/L², in the pendulum {PENDULUM_STIFF:,.0f} N.

A whole run chooses the mesh by itself, checks the branch and estimates the error. *Cold* is the solve alone, of a model
that is ready, from the undeformed state; *warm* is the same from an equilibrium at {NEAR:g} of the load. Of a motion it
is the integration alone, without an estimate of its error.
"""
"""Stands above the tables."""

KINDS = {
    "whole run": "whole run: mesh, branch, certificate, error bar",
    "whole run, Newton": "whole run by Newton's method",
    "cold": "solve alone, cold",
    "warm": "solve alone, warm",
    "C, cold": "exported C, cold",
    "C, warm": "exported C, warm",
}
"""What is timed, as the large table has it."""

TITLES = {problem.name: problem.title for problem in (*STATICS.values(), MOTION)}


def compared() -> Mapping[str, Any]:
    """Measure all programs, print the tables and return what is in them."""
    # Before the processes begin that inherit it.
    os.environ["OMP_NUM_THREADS"] = "1"
    installed = [name for name in OTHERS if importlib.util.find_spec(name) is not None]
    left_out = [f"{name} is not installed: its rows are left out." for name in OTHERS if name not in installed]
    rows: list[Row] = []
    for problem in TITLES:
        for program in (OWN, *installed):
            found, failure = _measured(program, problem)
            rows += found
            if failure:
                left_out.append(f"{program} has no rows of {problem}: {failure.rstrip('.')}.")
    results = {
        "versions": {name: version(name) for name in installed},
        "problems": TITLES,
        "rows": [asdict(each) for each in rows],
        "left_out": left_out,
    }
    print(INTRODUCTION)
    print(f"{small_table(results)}\n\n{large_table(results)}")
    return results


def _measured(program: str, problem: str) -> tuple[list[Row], str]:
    """Rows of a program, or why there are none."""
    if (program, problem) in LEFT_OUT:
        return [], LEFT_OUT[program, problem]
    worker = Worker(LONGEST)
    try:
        found, failure = worker.ask(ROWS[program], problem)
    finally:
        worker.close()
    return found or [], failure


def large_table(results: Mapping[str, Any]) -> str:
    """All rows in Markdown, a table for each problem.

    Parameters
    ----------
    results : mapping
        As :func:`compared` returns it.
    """
    lines = []
    heads = ("wanted error", "program", "what is timed", "error", "least, ms", "median, ms", "setting")
    for problem, title in results["problems"].items():
        cells: list[tuple[str, ...]] = [
            (
                f"{each['target']:.0e}",
                each["program"],
                KINDS[each["kind"]],
                f"{each['error']:.1e}",
                _digits(1e3 * each["seconds"]),
                _digits(1e3 * each["median"]),
                each["setting"],
            )
            for each in results["rows"]
            if each["problem"] == problem
        ]
        cells.sort(key=lambda line: (-float(line[0]), line[1] != OWN, line[1]))
        lines += [f"## {problem}: {title}", "", *markdown_table(heads, cells), ""]
    return "\n".join([*lines, *results["left_out"]])


def small_table(results: Mapping[str, Any]) -> str:
    """The table of the README: least times in ms, of the other programs those of the one that is fastest cold.

    Parameters
    ----------
    results : mapping
        As :func:`compared` returns it, or read from its file.
    """
    least = {(r["problem"], r["target"], r["program"], r["kind"]): 1e3 * r["seconds"] for r in results["rows"]}
    others = [name for name in OTHERS if name in results["versions"]]

    def pair(problem: str, target: float, program: str, *kinds: str) -> str:
        found = [least[problem, target, program, kind] for kind in kinds if (problem, target, program, kind) in least]
        return " / ".join(map(_digits, found)) or "-"

    lines: list[tuple[str, ...]] = []
    for problem, target in SHOWN:
        known = {name: least.get((problem, target, name, "cold")) for name in others}
        reached = {name: seconds for name, seconds in known.items() if seconds is not None}
        other = "not reached"
        if reached:
            best = min(reached, key=lambda name: reached[name])
            other = f"{pair(problem, target, best, 'cold', 'warm')} ({best})"
        lines.append(
            (
                f"{problem}: {results['problems'][problem]}",
                f"{target:.0e}",
                pair(problem, target, OWN, "whole run", "whole run, Newton"),
                pair(problem, target, OWN, "cold", "warm"),
                pair(problem, target, OWN, "C, cold", "C, warm"),
                other,
            )
        )
    return "\n".join(markdown_table(HEADS, lines))


def _digits(value: float) -> str:
    """Two significant digits, all of what stands before the point."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:#.2g}"
