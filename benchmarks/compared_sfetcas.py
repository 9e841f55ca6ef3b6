"""This package on the problems of the comparison; part of ``python -m benchmarks compared``.

Whole runs ask for the wanted error as ``accuracy`` and choose everything themselves, by IPOPT or by the globalised
Newton method.  Repeated solves are those of a prepared model on prescribed meshes by either of them, and of the solver
that is exported, in process.  Exported C is compiled with ``-O2``; its motion is that of radau-3 with constant steps.
"""

from __future__ import annotations

import statistics
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sfetcas.codegen.folder import export
from sfetcas.description.scene import Analysis, Scene
from sfetcas.dynamics.simulation import simulate
from sfetcas.equilibria.settings import Settings
from sfetcas.equilibria.single import solve_model
from sfetcas.equilibria.statics import solve
from sfetcas.errors import SolveError
from sfetcas.mathematics.arrays import Array
from sfetcas.mechanics.elements import ELEMENTS
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.parametric.equilibrium import EquilibriumSolver, equilibrium_solver
from sfetcas.solvers.prepared import Prepared

from .code import CLOCK, compiled_program, has_compiler, timed
from .compared_problems import LONGEST, MOTION, NEAR, RUNS, SAMPLES, STATICS, Candidate, Problem, Row, fastest
from .motion import PROBLEMS, TOLERANCES, run
from .timing import times

__all__ = ["rows"]

PROGRAM = "sfetcas"

WHOLE: dict[str, Literal["ipopt", "newton"]] = {"whole run": "ipopt", "whole run, Newton": "newton"}
"""Whole runs by what solves the minimisation."""

MESHES = {"SFET3": (2, 4, 8, 16), "SFET5": (1, 2, 3, 4, 6, 8, 12), "SFET7": (1, 2, 3, 4, 6), "SFET9": (1, 2, 3, 4)}
"""Elements and their numbers in each member."""

EXPORTED = 2
"""So many meshes are exported for each wanted error: those with the fewest unknowns that reach it."""

MOTION_RUNS = 10
"""Timed runs of the best motions, and of each exported one."""

PENDULUM_CODE = {"SFET5": (3, 4, 6), "SFET7": (2, 3, 4, 6, 8)}
PENDULUM_STEPS = (0.01, 0.005, 0.0025, 0.00125)
"""Meshes and steps in s of exported motions."""


def _row(problem: Problem, kind: str, target: float, setting: str, error: float, seconds: list[float]) -> Row:
    return Row(problem.name, PROGRAM, kind, target, setting, error, min(seconds), statistics.median(seconds))


# -- equilibria -----------------------------------------------------------------------------------


def rows(name: str) -> list[Row]:
    """The rows of a problem by its name."""
    return _pendulum_rows() if name == MOTION.name else _static_rows(STATICS[name])


def _static_rows(problem: Problem) -> list[Row]:
    exact = problem.exact()
    rows = []
    for target in problem.targets:
        for kind, solver in WHOLE.items():
            seconds, solution = times(partial(solve, problem.scene, accuracy=target, solver=solver), RUNS, LONGEST)
            error = problem.error(solution.last.position(problem.node), exact)
            rows.append(_row(problem, kind, target, f"accuracy = {target:.0e}", error, seconds))
    found: dict[str, list[Candidate]] = {"cold": [], "warm": []}
    meshes = []
    for element, counts in MESHES.items():
        for count in counts:
            mesh = _Mesh(problem, element, count, exact)
            meshes.append(mesh)
            for kind, each in mesh.repeated():
                found[kind].append(each)
    for kind, candidates in found.items():
        rows += fastest(problem, PROGRAM, kind, candidates)
    return rows + (_exported(problem, meshes, exact) if has_compiler() else [])


class _Mesh:
    """A problem on a prescribed mesh, with its number of unknowns and its error."""

    def __init__(self, problem: Problem, element: str, count: int, exact: Array) -> None:
        self.problem, self.element, self.count, self.exact = problem, element, count, exact
        self.name = f"{count} {element}" + (" each" if len(problem.scene.members) > 1 else "")
        self.scene, self.place = _meshed(problem.scene, element, count), f"nodes.{problem.node}.position"
        self.model = assemble(problem.scene, uniform_mesh(problem.scene, ELEMENTS.index(element) + 1, count))
        self.error = np.inf

    def repeated(self) -> Iterator[tuple[str, Candidate]]:
        """Cold and warm solves of a prepared model by each solver, and by the one that is exported."""
        prepared = Prepared(self.model)
        try:
            near = solve_model(prepared, NEAR)
            for solver in WHOLE.values():
                words = f"{self.name}, prepared model, {'IPOPT' if solver == 'ipopt' else 'Newton'}"
                yield "cold", self._candidate(words, self._positions(prepared, solver=solver))
            yield "warm", self._candidate(f"{self.name}, prepared model", self._positions(prepared, start=near))
            own = equilibrium_solver(self.scene, "beam", arguments=["factor"], results=[self.place])
            near_by, _ = own.solve(np.array([NEAR]))
            words = f"{self.name}, parametric solver"
            yield "cold", self._candidate(words, lambda: own.solve()[1])
            yield "warm", self._candidate(words, lambda: own.solve(start=near_by.state)[1])
        except SolveError:
            # A mesh too coarse for the load.
            return

    def _positions(self, prepared: Prepared, **how: Any) -> Callable[[], Array]:
        return lambda: solve_model(prepared, **how).position(self.problem.node)

    def _candidate(self, setting: str, call: Callable[[], Array]) -> Candidate:
        seconds, position = times(call, 2)
        self.error = self.problem.error(position, self.exact)
        return Candidate(setting, self.error, min(seconds), call)

    def exported(self, folder: Path) -> tuple[float, Array]:
        """Error, and seconds (2, rounds) cold and warm, of an exported solver with the load factor as its argument."""
        solver = export(self.scene, folder, name="beam", arguments=["factor"], results=[self.place])
        assert isinstance(solver, EquilibriumSolver)
        _, seconds = timed(folder, argument=0, share=NEAR)
        return self.problem.error(solver.solve()[1], self.exact), seconds


def _meshed(scene: Scene, element: str, count: int) -> Scene:
    members = {name: member.replace(element=element, elements=count) for name, member in scene.members.items()}
    return scene.replace(members=members)


def _exported(problem: Problem, meshes: list[_Mesh], exact: Array) -> list[Row]:
    """The fastest of a few exported solvers for each wanted error."""
    measured: dict[str, tuple[float, Array]] = {}
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as place:
        for target in problem.targets:
            fit = sorted((mesh for mesh in meshes if mesh.error <= target), key=lambda mesh: mesh.model.unknowns)
            for mesh in fit[:EXPORTED]:
                if mesh.name not in measured:
                    measured[mesh.name] = mesh.exported(Path(place) / mesh.name.replace(" ", "_"))
            reached = {name: found for name, found in measured.items() if found[0] <= target}
            for which, kind in enumerate(("C, cold", "C, warm")):
                if reached:
                    name = min(reached, key=lambda name: reached[name][1][which].min())
                    error, seconds = reached[name]
                    rows.append(_row(problem, kind, target, name, error, list(seconds[which])))
    return rows


# -- the pendulum ---------------------------------------------------------------------------------


def _pendulum_rows() -> list[Row]:
    """The rows of the pendulum; errors are against a far finer run."""
    _, _, meshes, (element, count, tolerance) = PROBLEMS["D1 pendulum"]
    exact = run(MOTION.scene, "radau-3", (element, count), tolerance)[0][:, :2]
    rows = []
    for target in MOTION.targets:
        scene = MOTION.scene.replace(analysis=Analysis(type="dynamic", end=float(SAMPLES[-1]), accuracy=target))
        seconds, motion = times(partial(simulate, scene, Settings()), RUNS, LONGEST)
        tips = np.array([state.position(MOTION.node)[:2] for state in motion.steps[1:]])
        error = float(np.abs(tips - [1.0, 0.0] - exact).max())
        rows.append(_row(MOTION, "whole run", target, f"accuracy = {target:.0e}", error, seconds))
    for target, found in _integrations(meshes, exact).items():
        name, mesh, tolerance, error = found
        seconds = [run(MOTION.scene, name, mesh, tolerance)[2] for _ in range(MOTION_RUNS)]
        setting = f"{mesh[1]} {mesh[0]}, {name}, tolerance {tolerance:.0e}"
        rows.append(_row(MOTION, "cold", target, setting, error, seconds))
    return rows + (_exported_motions(exact) if has_compiler() else [])


def _integrations(
    meshes: tuple[tuple[str, int], ...], exact: Array
) -> dict[float, tuple[str, tuple[str, int], float, float]]:
    """For each wanted error the fastest integrator, mesh and tolerance of a model that is ready, with its error."""
    best: dict[float, tuple[str, tuple[str, int], float, float]] = {}
    least = dict.fromkeys(MOTION.targets, np.inf)
    for mesh in meshes:
        for name, tolerances in TOLERANCES.items():
            for tolerance in tolerances:
                tips, _, seconds, _ = run(MOTION.scene, name, mesh, tolerance)
                error = float(np.abs(tips[:, :2] - exact).max())
                for target in MOTION.targets:
                    if error <= target and seconds < least[target]:
                        least[target], best[target] = seconds, (name, mesh, tolerance, error)
    return best


COURSE = (
    CLOCK
    + """
static beam_memory memory;
static double p[BEAM_ARGUMENTS], x[BEAM_STATE], r[BEAM_RESULTS], places[200];
int main(int count, char **words) {
  double h = atof(words[1]);
  int steps = atoi(words[2]), runs = atoi(words[3]), run, i, j;
  (void)count;
  for (run = 0; run < runs; ++run) {
    double begin = now();
    beam_defaults(p);
    beam_begin(x);
    for (i = 0; i < 100; ++i) {
      for (j = 0; j < steps; ++j)
        if (beam_step(&memory, h, p, x, r, 0) != BEAM_DONE) return 1;
      places[2 * i] = r[0];
      places[2 * i + 1] = r[1];
    }
    printf("%.9g ", now() - begin);
  }
  for (i = 0; i < 200; ++i) printf("%.17g ", places[i]);
  return 0;
}
"""
)
"""Follows the motion by steps of words[1] seconds, words[2] of them from one sample to the next, words[3] times."""


def _exported_motions(exact: Array) -> list[Row]:
    """The fastest of some exported motions for each wanted error."""
    rows: dict[float, Row] = {}
    analysis = Analysis(type="dynamic", end=float(SAMPLES[-1]), step=PENDULUM_STEPS[0], integrator="radau-3")
    with tempfile.TemporaryDirectory() as place:
        for element, counts in PENDULUM_CODE.items():
            for count in counts:
                folder = Path(place) / f"{element}_{count}"
                scene = _meshed(MOTION.scene, element, count).replace(analysis=analysis)
                export(scene, folder, name="beam", results=[f"nodes.{MOTION.node}.position"])
                _, program = compiled_program(folder, COURSE)
                for step in PENDULUM_STEPS:
                    words = [f"{step!r}", f"{round(SAMPLES[0] / step)}", f"{MOTION_RUNS}"]
                    said = subprocess.run([str(program), *words], check=False, capture_output=True, text=True)
                    if said.returncode:
                        continue
                    numbers = [float(word) for word in said.stdout.split()]
                    tips = np.array(numbers[MOTION_RUNS:]).reshape(-1, 2)
                    error = float(np.abs(tips - [1.0, 0.0] - exact).max())
                    setting = f"{count} {element}, radau-3, steps of {1e3 * step:g} ms"
                    for target in MOTION.targets:
                        row = _row(MOTION, "C, cold", target, setting, error, numbers[:MOTION_RUNS])
                        if error <= target and (target not in rows or row.seconds < rows[target].seconds):
                            rows[target] = row
    return [rows[target] for target in MOTION.targets if target in rows]
