"""Generated C measured: seconds of a solve and of a step, size and compilation; part of ``python -m benchmarks``.

A cantilever under a transverse tip force of 10 EI/L^2, and one in space under two; warm solves go to and fro between
loads that differ by a hundredth.  Errors are those of the tip against many more elements.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from sfetcas.codegen.folder import export
from sfetcas.codegen.timestep import TimeStep
from sfetcas.description.scene import Analysis, Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.equilibria.settings import Settings
from sfetcas.mathematics.arrays import Array
from sfetcas.parametric.equilibrium import EquilibriumSolver

from .saving import head, row

__all__ = ["CLOCK", "code", "compiled_program", "has_compiler", "timed"]

CASES = (
    (False, "SFET9", 2),
    (False, "SFET7", 4),
    (False, "SFET5", 8),
    (True, "SFET7", 4),
    (True, "SFET5", 8),
    (True, "SFET5", 32),
)
"""Space or plane, element, number of elements."""

STEPS = ("generalised-alpha", "radau-3")
"""Integrators whose steps are measured."""

CLOCK = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "beam.h"
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}
"""
"""Head of a program that measures times."""

PROGRAM = (
    CLOCK
    + """
static beam_memory memory;
static double p[BEAM_ARGUMENTS + 1], x[BEAM_STATE], r[BEAM_RESULTS];
int main(void) {
  beam_report report;
  int round, i, warm;
  beam_defaults(p);
  for (warm = 0; warm < 2; ++warm)
    for (round = 0; round < 50; ++round) {
      double begin = now();
      for (i = 0; i < 20; ++i) {
        double load = p[@argument@];
        if (warm && i % 2) p[@argument@] = @share@ * load;
        @call@
        p[@argument@] = load;
      }
      printf("%.9g ", (now() - begin) / 20);
    }
  return 0;
}
"""
)
"""Prints the seconds of a call in fifty rounds of twenty, first cold, then warm."""

SOLVE = "beam_solve(&memory, p, x, warm, r, &report);"
"""A solve by the program."""

STEP = "if (i == 0) beam_begin(x); beam_step(&memory, 0.02, p, x, r, &report);"
"""A step of a motion; each round begins anew."""


def cantilever(space: bool, element: str, elements: int, analysis: Analysis) -> Scene:
    """A cantilever under a tip force."""
    section = CrossSection(EI2=1.0, EI3=1.0, GJ=1.0, rhoA=1.0, rhoI=[2e-4, 1e-4, 1e-4])
    return Scene(
        dimension="space" if space else "plane",
        sections={"s": section},
        nodes={"A": Node(position=[0, 0], support="clamped"), "B": Node(position=[1, 0])},
        members={"m": Member(nodes=["A", "B"], section="s", element=element, elements=elements)},
        loads={"tip": Load(type="force", node="B", value=[0, 10, 3] if space else [0, 10])},
        analysis=analysis,
    )


def compiled_program(folder: Path, source: str) -> tuple[float, Path]:
    """Compile an export called ``beam`` and a program for it.

    Parameters
    ----------
    folder : path
        Of the export.
    source : str
        The program in C; its clock is ``now()`` of :data:`CLOCK`.

    Returns
    -------
    float
        Seconds of the compilation of the export.
    path
        The program.
    """
    (folder / "time.c").write_text(source)
    compiler = os.environ.get("CC", "cc")
    flags = ["-std=c99", "-O2", "-ffp-contract=off"]
    begin = time.perf_counter()
    subprocess.run([compiler, *flags, "-c", "-o", "beam.o", "beam.c"], cwd=folder, check=True)
    seconds = time.perf_counter() - begin
    subprocess.run([compiler, *flags, "-o", "time", "time.c", "beam.o", "-lm"], cwd=folder, check=True)
    return seconds, folder / "time"


def timed(folder: Path, call: str = SOLVE, argument: int = 1, share: float = 1.01) -> tuple[float, Array]:
    """Compile an export called ``beam`` and time it.

    Parameters
    ----------
    folder : path
        Of the export.
    call : str
        Statement in C: :data:`SOLVE` or :data:`STEP`.
    argument, share
        Warm calls go to and fro between the default of this argument and so many times it.

    Returns
    -------
    float
        Seconds of the compilation.
    (2, rounds) ndarray
        Seconds of cold and of warm calls.
    """
    source = PROGRAM.replace("@call@", call).replace("@argument@", str(argument)).replace("@share@", str(share))
    compiled, program = compiled_program(folder, source)
    said = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout.split()
    return compiled, np.array(said, float).reshape(2, -1)


def has_compiler() -> bool:
    """Whether there is a C compiler."""
    return shutil.which(os.environ.get("CC", "cc")) is not None


def code() -> None:
    """Solves and steps of generated C."""
    if not has_compiler():
        print("no C compiler, no measurement of C")
        return
    print("Generated C, least times; cold: from the undeformed state, warm: from an answer at a load 1 % away\n")
    head("cantilever", "unknowns", "error", "cold, ms", "warm, ms", "compiled, s", "source, kB")
    with tempfile.TemporaryDirectory() as place:
        for number, (space, element, elements) in enumerate(CASES):
            folder = Path(place) / str(number)
            options = {"arguments": ["loads.tip.value"], "results": ["nodes.B.position"]}
            scene, far = (cantilever(space, *mesh, Analysis()) for mesh in ((element, elements), ("SFET9", 12)))
            solver = export(scene, folder, name="beam", **options)
            finer = export(far, Path(place) / f"{number}_far", name="beam", **options)
            assert isinstance(solver, EquilibriumSolver)
            assert isinstance(finer, EquilibriumSolver)
            error = float(np.abs(solver.solve()[1] - finer.solve()[1]).max())
            compiled, seconds = timed(folder)
            cold, warm = 1e3 * seconds.min(axis=1)
            size = (folder / "beam.c").stat().st_size // 1000
            name = f"{'space' if space else 'plane'}, {elements} {element}"
            unknowns = solver.arguments.expressions.total
            row(name, unknowns, f"{error:.1e}", f"{cold:.4f}", f"{warm:.4f}", f"{compiled:.2f}", size)
        print()
        head("time step", "ms", "compiled, s", "source, kB")
        for method in STEPS:
            folder = Path(place) / method
            analysis = Analysis(type="dynamic", end=1.0, step=0.02, integrator=method)
            made = export(cantilever(True, "SFET5", 8, analysis), folder, name="beam", settings=Settings())
            assert isinstance(made, TimeStep)
            compiled, seconds = timed(folder, STEP)
            size = (folder / "beam.c").stat().st_size // 1000
            row(f"space, 8 SFET5, {method}", f"{1e3 * seconds[0].min():.4f}", f"{compiled:.2f}", size)
