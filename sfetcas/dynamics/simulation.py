"""The motion of a scene: model, beginning, steps, answers, and the check of the error by a finer run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..description.scene import Scene
from ..equilibria.meshing import Meshing
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from .beginning import at_rest, equilibrium_before, moving, posed, velocities
from .conserving import Conserving
from .inertia import Inertia
from .integrating import Memory, Stepper, Taken, integrate
from .masses import masses_of
from .methods import GeneralisedAlpha, Method, Radau
from .motion import Instant, Motion, Mover
from .sampling import Sampler
from .stages import StageEquations

__all__ = ["simulate"]

USUAL = "radau-3"
"""Integrator where none is asked for: of all it needs the least time for an accuracy of 1e-2 or finer (measured)."""

METHODS: dict[str, Method] = {m.name: m for m in (Radau(3), Radau(2), GeneralisedAlpha(), Conserving())}
"""Methods with steps of their own, by name."""

OUTPUTS = 100
"""Answers where no spacing is asked for."""

ROUNDS = 6
"""Finer runs at most."""


def simulate(scene: Scene, settings: Settings, progress: Callable[[float], Any] | None = None) -> Motion:
    """The motion of a scene.

    Parameters
    ----------
    progress : callable, optional
        Told the time reached, s, after each step.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        A step does not converge; ``reached`` is the motion up to there.
    """
    return _Simulation(scene, settings, progress).motion()


@dataclass
class _Run:
    """What one run on one mesh with one tolerance gave."""

    instants: list[Instant]
    count: int
    gap: float
    norm: float
    notes: tuple[str, ...]
    seconds: dict[str, float]
    failure: SolveError | None = None
    interrupted: bool = False


class _Simulation:
    def __init__(self, scene: Scene, settings: Settings, progress: Callable[[float], Any] | None) -> None:
        self.given, self.settings, self.progress = scene, settings, progress
        self.scene = moving(scene)
        if settings.gauss:
            raise SceneError("integration: found 'gauss', accepted with type 'dynamic': integration at the nodes")
        analysis = scene.analysis
        name = analysis.integrator or USUAL
        self.method = METHODS[name]
        meshing = Meshing(self.scene, settings)
        self.accuracy, self.asked = meshing.accuracy, meshing.asked
        self.prescribed = meshing._prescribed
        self.mesh: Mesh = replace(meshing.target, places=True)
        self.seconds = {"model": 0.0, "build": 0.0, "solve": 0.0}

    # -- times ----------------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """Times of the answers, s: the regular ones, and those of expectations."""
        analysis = self.scene.analysis
        end = analysis.duration
        spacing = analysis.output or end / OUTPUTS
        regular = spacing * np.arange(int(np.floor(end / spacing * (1.0 + 1e-12))) + 1)
        wanted = [expect.time for expect in self.scene.expect if expect.time is not None]
        return np.unique(np.concatenate([np.minimum(regular, end), wanted, [end]]))

    def _breaks(self, unit: float) -> list[float]:
        """Times at which loads or motions have a kink, and the end, dimensionless."""
        end = self.scene.analysis.duration
        return [t / unit for t in sorted({*(t for t in self._kinks if 0.0 < t < end), end})]

    @property
    def _kinks(self) -> set[float]:
        used = {load.history for load in self.scene.loads.values()}
        used |= {motion.history for motion in self.scene.motions.values()}
        return {t for name in used if name is not None for t in self.scene.histories[name].kinks}

    # -- one run ----------------------------------------------------------------------------------------

    def run(self, mesh: Mesh, tolerance: float) -> _Run:
        """The motion on a mesh."""
        begin = time.perf_counter()
        model = assemble(self.scene, mesh, assembly="nodal")
        equations = Equations(model)
        masses = masses_of(model)
        built = time.perf_counter()
        analysis = self.scene.analysis
        system = StageEquations(equations, masses)
        stepper = Stepper(system, self.method)
        self.seconds["model"] += built - begin
        self.seconds["build"] += time.perf_counter() - built
        memory, notes = self._memory(stepper)
        mover = Mover(equations, Inertia(system), masses.time, stepper.factors)
        sampler = Sampler(self.times / masses.time, self.method.stages)
        step = None if analysis.step is None else analysis.step / masses.time
        size = self.scene.size / model.scales.length
        first = None if step is not None else FIRST * analysis.duration / masses.time
        beyond = min((t for t in self._kinks if t >= analysis.duration), default=np.inf) / masses.time
        limits: dict[str, Any] = {"step": step, "tolerance": tolerance * size, "first": first, "beyond": beyond}
        steps = integrate(stepper, memory, self._breaks(masses.time), **limits)
        run = _Run([], 0, 0.0, 0.0, notes, {})
        solving = time.perf_counter()
        try:
            for taken in self._counted(steps, run, masses.time):
                run.instants += [mover.instant(sample) for sample in sampler.feed(taken)]
        except KeyboardInterrupt:
            run.interrupted = True
        except SolveError as error:
            run.failure = error
        run.instants += [mover.instant(sample) for sample in sampler.close()]
        self.seconds["solve"] += time.perf_counter() - solving
        return run

    def _counted(self, steps: Iterator[Taken], run: _Run, unit: float) -> Iterator[Taken]:
        for taken in steps:
            if taken.begin.t * unit >= self.scene.analysis.duration * (1.0 - 1e-12):
                yield taken
                continue
            run.count += 1
            run.gap = max(run.gap, taken.gap)
            if taken.after.q.shape[1] == 4:
                run.norm = max(run.norm, float(np.abs(np.einsum("ij,ij->i", taken.after.q, taken.after.q) - 1.0).max()))
            yield taken
            if self.progress is not None:
                self.progress(taken.after.t * unit)

    def _memory(self, stepper: Stepper) -> tuple[Memory, tuple[str, ...]]:
        """Where the motion begins."""
        system, model = stepper.system, stepper.system.model
        state = at_rest(model)
        notes: tuple[str, ...] = ()
        if self.scene.analysis.initial == "equilibrium":
            before = self.before
            state, notes = posed(model, before), before.notes
        equations = system.equations
        loading = model.loading(0.0).scaled(0.0)
        for name, factor in zip(system.groups, stepper.factors(0.0), strict=True):
            loading = loading.plus(model.groups[name].scaled(float(factor)))
        state = equations.holding(state, loading)
        rates, told = velocities(system, equations, state)
        x, v = system.rates(state, stepper.factors(0.0), rates)
        kept = np.zeros((self.method.kept, len(x)))
        kept[0] = v
        memory = Memory(0.0, state.q, state.y, state.lam, x, kept, state.wound)
        return memory, (*notes, *told)

    @property
    def before(self) -> Equilibrium:
        """The equilibrium before the motion, found once."""
        if self._before is None:
            self._before = equilibrium_before(self.given, replace(self.settings, accuracy=0.1 * self.accuracy))
        return self._before

    _before: Equilibrium | None = None

    # -- all --------------------------------------------------------------------------------------------

    def motion(self) -> Motion:
        """Runs until two agree."""
        analysis = self.scene.analysis
        mesh, tolerance = self.mesh, self._tolerance(self.accuracy)
        run, error = self.run(mesh, tolerance), None
        refinable = analysis.step is None or not self.prescribed
        for _ in range(ROUNDS if refinable else 0):
            if run.failure is not None or run.interrupted:
                break
            mesh = mesh if self.prescribed else mesh.refined()
            tolerance = self._tolerance(0.0, tolerance)
            finer = self.run(mesh, tolerance)
            error = self._difference(run, finer)
            run = finer
            if error <= self.accuracy:
                break
        return self._answer(run, error)

    def _tolerance(self, accuracy: float, before: float | None = None) -> float:
        """Tolerance of steps for an accuracy, or a finer one: steps of about half the length."""
        order, stages = self.method.order, self.method.stages
        of_step = stages + 1 if stages > 1 else 3
        return float((STRICT * accuracy) ** (of_step / order)) if before is None else before * 2.0**-of_step

    def _difference(self, coarse: _Run, fine: _Run) -> float:
        """Largest distance of nodes and middles of members, over the size of the scene."""
        if fine.failure is not None or fine.interrupted:
            return float(np.inf)
        scene, apart = self.scene, 0.0
        for one, other in zip(coarse.instants, fine.instants, strict=True):
            for node in scene.nodes:
                apart = max(apart, float(np.abs(one.position(node) - other.position(node)).max()))
            for member in one.model.members:
                middle = np.array([0.5])
                moved = one.fields.positions(member, middle) - other.fields.positions(member, middle)
                apart = max(apart, float(np.abs(moved).max()))
        return apart / scene.size

    def _answer(self, run: _Run, error: float | None) -> Motion:
        short = error is not None and not error <= self.accuracy and self.asked
        status = Status.SHORT if short else Status.SOLVED
        if run.failure is not None:
            status = run.failure.status
        elif run.interrupted:
            status = Status.INTERRUPTED
        motion = Motion(
            scene=self.given,
            status=status,
            steps=tuple(run.instants),
            seconds=dict(self.seconds),
            integrator=self.method.name,
            count=run.count,
            error_estimate=error,
            violation={"norms": run.norm, "closings": run.gap},
            notes=run.notes,
            failure="" if run.failure is None else run.failure.detail,
        )
        if run.failure is not None:
            if motion.steps:
                run.failure.reached = motion
            raise run.failure
        return motion


FIRST = 1e-3
"""First step that is tried, over the span."""

STRICT = 5.0
"""Steps are chosen for an error of this times the accuracy: a finer run follows."""
