"""Problems on which programs are compared, the rows of the comparison, and the search for the best setting.

S1, S1b, S2b and S4 are those of :mod:`~benchmarks.scenes`, D1 the pendulum of :mod:`~benchmarks.motion`.  Each program
is given several elements, meshes and settings of its solver; of those that reach a wanted error the fastest one counts.
Errors are against the exact solution of the model that a program solves: beams that stretch and shear where it needs
finite stiffnesses, which are then :data:`STIFF` EI/L².
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.mathematics.arrays import Array

from .motion import pendulum
from .scenes import bend, cantilever, on_slider
from .shooting import exact_tip
from .timing import times

__all__ = [
    "LONGEST",
    "MOTION",
    "NEAR",
    "PENDULUM_STIFF",
    "RUNS",
    "SAMPLES",
    "STATICS",
    "STIFF",
    "Candidate",
    "Problem",
    "Row",
    "fastest",
]

STIFF = 1e6
"""EA and GA of programs that need them, over EI/L²."""

PENDULUM_STIFF = 1e5
"""The same in N of the pendulum, where fast waves along the beam would ask for short steps."""

NEAR = 0.97
"""Warm solves begin from the equilibrium under so many times the load."""

SAMPLES = np.arange(1, 101) / 100.0
"""Times at which the tip of the pendulum is compared, s."""

RUNS, LONGEST = 40, 2.0
"""Largest number of timed runs of the best settings, and seconds after which no further one begins."""

TRIED = 3
"""Of settings that are nearly as fast in the search so many are timed."""


@dataclass(frozen=True)
class Problem:
    """One equilibrium problem.

    Attributes
    ----------
    name, title : str
    scene : Scene
    node : str
        Node whose position is compared.
    length : float
        By which errors are divided, m.
    targets : tuple of float
        Errors that are wanted.
    cantilever : Scene
        The same problem as a cantilever, for the exact solution.
    """

    name: str
    title: str
    scene: Scene
    node: str
    length: float
    targets: tuple[float, ...]
    cantilever: Scene

    @property
    def stiffness(self) -> float:
        """EA and GA in N of programs that need them."""
        (line,) = self.cantilever.center_lines.values()
        (section,) = self.cantilever.sections.values()
        return STIFF * float(section.EI3) / line.length**2  # type: ignore[arg-type]

    def exact(self, axial: float = np.inf, shear: float = np.inf) -> Array:
        """Exact position (3,) of the node in m for EA and GA in N."""
        place = exact_tip(self.cantilever, axial, shear)
        # By symmetry half of the beam on hinge and slider is a cantilever, clamped in the middle, seen upside down.
        return place if self.cantilever is self.scene else place * np.array([1.0, -1.0, 1.0])

    def error(self, place: Array, exact: Array) -> float:
        """Largest difference of a coordinate over the length."""
        return float(np.abs(np.asarray(place) - exact).max()) / self.length


def _problem(name: str, title: str, scene: Scene, length: float = 1.0) -> Problem:
    return Problem(name, title, scene, "tip", length, (1e-3, 1e-5, 1e-7), scene)


_SLIDER = Problem(
    "S4",
    "beam on hinge and slider, force in the middle, F L²/EI = 20",
    on_slider(),
    "middle",
    2.0,
    (1e-3, 1e-5, 1e-7),
    cantilever([0.0, 2.5]),
)

STATICS: dict[str, Problem] = {
    problem.name: problem
    for problem in (
        _problem("S1", "cantilever, F L²/EI = 10", cantilever([0.0, 10.0])),
        _problem("S1b", "cantilever, F L²/EI = 100", cantilever([0.0, 100.0])),
        _SLIDER,
        _problem("S2b", "45° bend in space, 600 lb", bend(600.0), 25.0 * np.pi),
    )
}
"""Equilibria by their names."""

MOTION = Problem(
    "D1", "flexible pendulum released from level, 1 s", pendulum(), "tip", 1.0, (1e-3, 1e-4, 1e-5), pendulum()
)
"""Its error is the largest of all :data:`SAMPLES`."""


@dataclass(frozen=True)
class Row:
    """What one program needed for one problem.

    Attributes
    ----------
    problem, program : str
    kind : str
        ``whole run``: from the scene to a certified answer with its error bar, model and mesh included.  ``cold``: the
        solve alone, on a model that is ready, from the undeformed state.  ``warm``: the same from an answer near by.
        ``C, cold`` and ``C, warm``: exported code.
    target : float
        Error that was wanted.
    setting : str
        Element, number of elements, settings of the solver.
    error : float
        Over the length.
    seconds, median : float
        Least and median wall time.
    """

    problem: str
    program: str
    kind: str
    target: float
    setting: str
    error: float
    seconds: float
    median: float


@dataclass(frozen=True)
class Candidate:
    """A setting of a program, with what the search found.

    Attributes
    ----------
    setting : str
    error : float
        Over the length.
    seconds : float
        Least wall time in the search.
    run : callable
        Solves again.
    ready : callable
        Called once before, untimed.
    """

    setting: str
    error: float
    seconds: float
    run: Callable[[], object]
    ready: Callable[[], object] = int


def fastest(problem: Problem, program: str, kind: str, candidates: Iterable[Candidate]) -> list[Row]:
    """The fastest candidate for each wanted error, timed again; a wanted error that none reaches has no row."""
    known, rows = list(candidates), []
    timed: dict[str, tuple[float, float]] = {}
    for target in problem.targets:
        fit = sorted((each for each in known if each.error <= target), key=lambda each: each.seconds)[:TRIED]
        for each in fit:
            if each.setting not in timed:
                each.ready()
                seconds, _ = times(each.run, RUNS, LONGEST)
                timed[each.setting] = min(seconds), statistics.median(seconds)
        if fit:
            best = min(fit, key=lambda each: timed[each.setting])
            rows.append(Row(problem.name, program, kind, target, best.setting, best.error, *timed[best.setting]))
    return rows
