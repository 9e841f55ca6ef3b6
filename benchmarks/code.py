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
from sfetcas.parametric.equilibrium import EquilibriumSolver

__all__ = ["code"]

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

PROGRAM = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>
#include "beam.h"
static beam_memory memory;
static double p[BEAM_ARGUMENTS + 1], x[BEAM_STATE], r[BEAM_RESULTS];
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}
int main(void) {
  double best[2] = {1e9, 1e9};
  beam_report report;
  int round, i, warm;
  beam_defaults(p);
  for (warm = 0; warm < 2; ++warm)
    for (round = 0; round < 50; ++round) {
      double begin = now();
      for (i = 0; i < 20; ++i) {
        double load = p[1];
        if (warm && i % 2) p[1] = 1.01 * load;
        @call@
        p[1] = load;
      }
      begin = (now() - begin) / 20;
      if (begin < best[warm]) best[warm] = begin;
    }
  printf("%.9g %.9g %d", best[0], best[1], report.iterations);
  return 0;
}
"""
SOLVE = "beam_solve(&memory, p, x, warm, r, &report);"
STEP = "if (i == 0) beam_begin(x); beam_step(&memory, 0.02, p, x, r, &report);"


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


def _measured(folder: Path, call: str) -> tuple[float, float, float]:
    """Seconds of compilation, and of a cold and a warm call."""
    (folder / "time.c").write_text(PROGRAM.replace("@call@", call))
    compiler = os.environ.get("CC", "cc")
    flags = ["-std=c99", "-O2", "-ffp-contract=off"]
    begin = time.perf_counter()
    subprocess.run([compiler, *flags, "-c", "-o", "beam.o", "beam.c"], cwd=folder, check=True)
    compiled = time.perf_counter() - begin
    subprocess.run([compiler, *flags, "-o", "time", "time.c", "beam.o", "-lm"], cwd=folder, check=True)
    said = subprocess.run([str(folder / "time")], check=True, capture_output=True, text=True).stdout.split()
    return compiled, float(said[0]), float(said[1])


def code() -> None:
    """Solves and steps of generated C."""
    if shutil.which(os.environ.get("CC", "cc")) is None:
        print("no C compiler, no measurement of C")
        return
    print("generated C                 unknowns  error    cold ms   warm ms  compiled s  source kB")
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
            compiled, cold, warm = _measured(folder, SOLVE)
            name = f"{'space' if space else 'plane'}, {elements} {element}"
            size = (folder / "beam.c").stat().st_size // 1000
            unknowns = solver.arguments.expressions.total
            print(
                f"{name:26s} {unknowns:8d} {error:9.1e} {1e3 * cold:9.4f} {1e3 * warm:9.4f} {compiled:9.2f} {size:9d}"
            )
        for method in STEPS:
            folder = Path(place) / method
            analysis = Analysis(type="dynamic", end=1.0, step=0.02, integrator=method)
            made = export(cantilever(True, "SFET5", 8, analysis), folder, name="beam", settings=Settings())
            assert isinstance(made, TimeStep)
            compiled, first, _ = _measured(folder, STEP)
            size = (folder / "beam.c").stat().st_size // 1000
            name = f"space, 8 SFET5, {method}"
            print(f"{name:35s} a step {1e3 * first:9.4f} ms {compiled:9.2f} s {size:9d} kB")
