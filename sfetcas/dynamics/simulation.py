"""Dynamic analysis: model, initial state, time integration, and error estimates by runs on finer discretisations."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from .. import tolerances
from ..contact.closest import Closest
from ..contact.pairs import Near, PairKey
from ..description.scene import Scene
from ..description.sections import HEAVY
from ..equilibria.meshing import Meshing
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium, superelement_notes, touched_notes
from ..errors import LIMITS, SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.threads import single_threaded
from ..mechanics.equations import Equations, State
from ..mechanics.law_limits import first_beyond_laws
from ..mechanics.masses import masses_of
from ..mechanics.mesh import Approach, Mesh
from ..mechanics.model import Model, assemble
from ..mechanics.spots import ending_at, fine_enough, slips_between, spots_of
from ..mechanics.unilateral import all_stops, rows_of
from ..solvers.guess import lacks_slack
from ..stopping import arrived
from .approaching import Approaching
from .beginning import at_rest, equilibrium_before, moving, posed, velocities
from .conserving import Conserving
from .events import TOGETHER
from .idas import Idas
from .inertia import Inertia
from .inertialess import check_balanced, check_resisted
from .integrating import SHORTEST
from .integrators import InitialState, Integrator, Stages, TimeGrid
from .methods import GeneralisedAlpha, Radau
from .motion import MotionState, Mover, StopEvent, Trajectory, apart_in
from .sampling import StepRecord
from .shaping import shaped, stretched
from .stages import StageEquations
from .stepping import Stepping, by_rows
from .watching import Watch, finer

__all__ = ["INTEGRATORS", "Simulation", "left", "simulate"]

USUAL = "radau-3"
"""Default integrator: of all it needs the least time for an accuracy of 1e-2 or finer (measured)."""

INTEGRATORS: dict[str, Callable[[StageEquations, Callable[[float], Any] | None], Integrator]] = {
    **{m.name: partial(Stages, method=m) for m in (Radau(3), Radau(2), GeneralisedAlpha(), Conserving())},
    "stepping": Stepping,
    "idas": Idas,
}
"""Integrators by name: (system, progress) -> Integrator; ``progress`` is called with the time reached, s."""

USUAL_STEPS, CALLS = 100, 6
"""Expected number of steps of a first run, and of calls of a kernel in a step, to decide whether compiling pays."""

OUTPUTS = 100
"""Number of spacings of the answers by default."""

GAINED = 3.0
"""Difference of two runs over the assumed error of the finer one: 2^order - 1 for order 2."""

UNSUPPORTED = 3.0
"""Largest ratio of the error estimate to the last difference of runs where the differences do not converge."""

SENSITIVE = (
    "runs of finer and finer steps do not come nearer to each other: so sensitive a motion cannot be told for so long"
)
"""A note where the differences of runs support no error estimate."""

ON_COARSER = "what was reached is the motion on a coarser mesh"
"""Of a failure on a finer mesh than one on which the motion went to its end."""

RESCUES = 2
"""Number of finer meshes that are tried where the first run fails."""

ROUNDS = 6
"""Largest number of finer runs."""


@single_threaded
def simulate(scene: Scene, settings: Settings, progress: Callable[[float], Any] | None = None) -> Trajectory:
    """Dynamic analysis of a scene.

    Parameters
    ----------
    progress : callable, optional
        Called with the time reached, s, after each time step.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        A step does not converge; ``reached`` is the motion up to there.
    """
    return Simulation(scene, settings, progress).motion()


@dataclass
class MeshRun:
    """The result of one run on one mesh: states, number of steps, largest errors of constraints and norms, notes,
    times, steps, events, and where members dip into obstacles by more than is accepted, with the times.
    """

    instants: list[MotionState]
    count: int
    gap: float
    norm: float
    notes: tuple[str, ...]
    seconds: dict[str, float]
    failure: SolveError | None = None
    interrupted: bool = False
    record: StepRecord | None = None
    events: tuple[StopEvent, ...] = ()
    dips: tuple[tuple[float, Near], ...] = ()


class Simulation:
    """The dynamic analysis of a scene: its runs on finer and finer discretisations."""

    def __init__(self, scene: Scene, settings: Settings, progress: Callable[[float], Any] | None = None) -> None:
        self.given, self.settings, self.progress = scene, settings, progress
        self.scene = moving(scene)
        self.superelements = [name for name, member in scene.members.items() if member.type == "small"]
        if settings.gauss:
            raise SceneError("integration: found 'gauss', accepted with type 'dynamic': integration at the nodes")
        analysis = scene.analysis
        self.name = analysis.integrator or USUAL
        meshing = Meshing(self.scene, settings)
        self.accuracy, self.asked, self.quantity = meshing.accuracy, meshing.asked, meshing.quantity
        self.prescribed = meshing.prescribed
        mesh = replace(meshing.target, places=True, stops=all_stops(scene))
        self.mesh: Mesh = fine_enough(self.scene, mesh, self.accuracy, meshing.fixed)
        self.seconds = {"model": 0.0, "build": 0.0, "solve": 0.0}

    # -- times ----------------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """Times of the answer (n,), s, rising: evenly spaced ones, and those of expectations."""
        analysis = self.scene.analysis
        end = analysis.duration
        spacing = analysis.output or end / OUTPUTS
        regular = spacing * np.arange(int(np.floor(end / spacing * (1.0 + tolerances.DECIMAL))) + 1)
        told = np.unique([*(expect.time for expect in self.scene.expect if expect.time is not None), end])
        # A multiple of the spacing that rounding alone keeps from a time that is told is that time.
        regular = np.minimum(regular, end)
        others = np.abs(regular[:, None] - told).min(axis=1) > tolerances.DECIMAL * end
        return np.unique(np.concatenate([regular[others], told]))

    def _breaks(self, unit: float) -> list[float]:
        """Times at which loads or motions have a kink, and the end, dimensionless."""
        end = self.scene.analysis.duration
        found: list[float] = []
        for t in sorted(t for t in self._kinks if tolerances.DECIMAL * end < t < end - tolerances.DECIMAL * end):
            if not found or t - found[-1] > tolerances.DECIMAL * end:
                found.append(t)
        return [t / unit for t in (*found, end)]

    @property
    def _kinks(self) -> set[float]:
        return {t for name in self.scene.histories_used for t in self.scene.histories[name].kinks}

    # -- one run ----------------------------------------------------------------------------------------

    def run(self, mesh: Mesh, rounds: int, before: int | None = None) -> MeshRun:
        """The motion on a mesh, after so many coarser runs, the last of which took so many steps."""
        begin = time.perf_counter()
        stepping = self.name == "stepping" and not by_rows(self.scene)
        if self.scene.contacts:
            mesh = replace(mesh, spots=() if stepping else spots_of(self.scene, mesh))
        model = assemble(self.scene, mesh, assembly="nodal")
        equations = Equations(model, kernels=self.settings.kernels)
        masses = masses_of(model)
        built = time.perf_counter()
        analysis = self.scene.analysis
        steps = USUAL_STEPS if before is None else 2 * before
        steps = steps if analysis.step is None else int(analysis.duration / analysis.step)
        unilateral = rows_of(model)

        def system_of(equations: Equations) -> StageEquations:
            rows = rows_of(equations.model)
            return StageEquations(equations, masses, self.settings.kernels, CALLS * max(steps, 1), rows)

        system = system_of(equations)
        integrator = INTEGRATORS[self.name](system, self.progress)
        self.seconds["model"] += built - begin
        self.seconds["build"] += time.perf_counter() - built
        mover = Mover(equations, Inertia(system), masses.time, system.factors)
        begun, notes = self.begun(system, mover.free if len(unilateral) else None)
        meeting = any(contact.between_members for contact in self.scene.contacts.values()) and not stepping
        if meeting:

            def with_rows(approaches: tuple[Approach, ...]) -> StageEquations:
                near = assemble(self.scene, replace(mesh, approaches=approaches), assembly="nodal")
                return system_of(Equations(near, kernels=self.settings.kernels))

            begun = replace(begun, near=Approaching(mover, with_rows))
        beyond = min((t for t in self._kinks if t >= analysis.duration), default=np.inf)
        watch = None if analysis.until is None else Watch(analysis.until, mover)
        times = self.times if watch is None else finer(self.times)
        course = TimeGrid(
            times=times / masses.time,
            breaks=self._breaks(masses.time),
            beyond=beyond / masses.time,
            accuracy=self.accuracy,
            rounds=rounds,
            size=self.scene.size / model.scales.length,
            step=None if analysis.step is None else max(analysis.step / masses.time, SHORTEST),
        )
        run = MeshRun([], 0, 0.0, 0.0, notes, {})
        solving = time.perf_counter()
        try:
            for sample in integrator.samples(begun, course):
                instant = mover.instant(sample)
                self._refuse_beyond_limits(instant)
                run.instants.append(instant)
                if watch is not None and watch.passed(run.instants):
                    break
        except KeyboardInterrupt:
            arrived()
            run.interrupted = True
        except SolveError as error:
            if not run.instants:
                self.refuse_unresisted(system, begun)
            if error.status is Status.STOPPED:
                hints = {TAUT: lacks_slack(equations), SNAPS: self.weightless, ALONG: bool(meeting)}
                if hint := next((words for words, true in hints.items() if true), ""):
                    error = SolveError(error.status, f"{error.detail}; {hint}", error.last)
            run.failure = error
        beyond = run.failure is not None and run.failure.status in LIMITS
        if not beyond and (watch is None or not watch.ended):
            run.instants += [mover.instant(sample) for sample in integrator.rest()]
        if watch is not None:
            record = integrator.record if self.scene.hits else None
            run.instants = watch.up_to_end(run.instants, self.times, None if record is None else record.sample)
            run.notes = (*run.notes, watch.note(run.instants))
        run.count, run.gap, run.norm, run.record = integrator.count, integrator.gap, integrator.norm, integrator.record
        ended = run.instants[-1].time if run.instants else 0.0
        run.events = tuple(event for event in map(mover.event, integrator.events) if event.time <= ended)
        run.dips = tuple(self._dips(run.instants))
        self.seconds["solve"] += time.perf_counter() - solving
        return run

    @functools.cached_property
    def _closest(self) -> Closest:
        return Closest(self.scene, 0.1 * self.accuracy)

    def _dips(self, instants: list[MotionState]) -> Iterator[tuple[float, Near]]:
        """Where members dip into obstacles by more than the accuracy, between ends of elements, where nothing stops
        them, and when.
        """
        stopping = [pair for pair in self._closest.pairs.values() if pair.stop is not None and not pair.edge]
        for instant in instants if stopping else ():
            found = self._closest.found(instant.fields, -self.accuracy * self.scene.size, stopping)
            yield from ((instant.time, near) for near in found)

    @functools.cached_property
    def weightless(self) -> bool:
        """Whether a flexible member has no mass somewhere: its shape then follows from the forces at each instant."""
        members = (one for one in self.scene.members.values() if one.type == "flexible")
        return any(not self.scene.sections[str(one.section)].mass(HEAVY).all() for one in members)

    def _refuse_beyond_limits(self, instant: MotionState) -> None:
        limit = instant.fields.beyond_limits() if self.scene.limited else None
        if limit is not None:
            raise SolveError(limit.status, f"at {instant.time:.6g} s: {limit.detail}")

    def refuse_unresisted(self, system: StageEquations, begun: InitialState) -> None:
        """Refuse what neither inertia nor stiffness resists where the motion begins.

        Raises
        ------
        SceneError
            Names sections, members or nodes.
        """
        check_resisted(system.equations, _resistance(system, begun))

    def begun(self, system: StageEquations, free: Equations | None = None) -> tuple[InitialState, tuple[str, ...]]:
        """Where the motion begins, and what is to be said of it; ``free`` are equations without unilateral ones."""
        model = system.model
        state = at_rest(model)
        notes: tuple[str, ...] = ()
        if self.scene.analysis.initial == "equilibrium":
            before = self.before
            state, notes = posed(model, before), before.notes
        equations, factors = system.equations, system.factors(0.0)
        loading = system.loading(factors)
        state = stretched(equations, equations.holding(state, loading), loading)
        if any(member.turned is not None for member in self.scene.members.values()):
            if free is not None:
                loading = system.loading_of(free.model, 0.0)
            found, notes = shaped(free or equations, system.state_of((free or equations).model, state), loading)
            state = replace(found, lam=state.lam, unwrapped=model.unwrapping.angles(found.q, state.unwrapped))
        touching = self._touching(system, state)
        if self.weightless:
            if self.name in ("conserving", "stepping"):
                message = (
                    f"found {self.name!r} with a flexible member without mass, whose shape it lets swing without end"
                )
                accepted = "accepted: radau-3, radau-2 or generalised-alpha, or a small rhoA"
                raise SceneError(f"{message}, {accepted}", ("analysis", "integrator"))
            beginning = _Beginning(system, touching)
            if self.scene.analysis.initial == "equilibrium":
                state = beginning.settled(state, factors)
            beginning.check(state, factors)
        if free is not None:
            equations = free
        rates, more = velocities(system, equations, system.state_of(equations.model, state))
        return InitialState(state, rates, *system.rates(state, factors, rates), touching), (*notes, *more)

    def _touching(self, system: StageEquations, state: State) -> Array:
        """Unilateral constraints that may act at the begin, (rows,), 1 or 0."""
        rows = system.unilateral
        if not len(rows):
            return np.zeros(0)
        opened = system.openings(state, 0.0)
        of_obstacles = np.array([part.spot is not None for part in rows.parts])
        begins = self.scene.analysis.initial == "equilibrium"
        near = (RESTING * self.accuracy if begins else tolerances.CLOSED) * self.scene.size / system.model.scales.length
        touching = of_obstacles & (opened <= near)
        if of_obstacles.any():
            self._refuse_inside(system, np.where(of_obstacles, opened, np.inf))
        if begins:
            return np.where(of_obstacles, touching, rows.acting(self.before.model.mesh.stops)).astype(float)
        opened = np.where(of_obstacles, np.inf, opened)
        worst = int(np.argmin(opened))
        if opened[worst] < -TOGETHER:
            table, name = rows.names[worst].split(".", 1)
            missing = -opened[worst] * system.model.scales.length
            message = (
                f"found {missing:.3g} m shorter than its way at t = 0, accepted: as long, or initial = 'equilibrium'"
            )
            raise SceneError(message, (table, name))
        return (touching | (opened <= TOGETHER)).astype(float)

    def _refuse_inside(self, system: StageEquations, opened: Array) -> None:
        """Refuse members that begin inside an obstacle, where they are said to be turned."""
        size, worst = system.model.scales.length, int(np.argmin(opened))
        deep = -float(opened[worst]) * size
        if deep > max(tolerances.CLOSED, self.accuracy) * self.scene.size:
            spot = system.unilateral.parts[worst].spot
            assert spot is not None
            message = f"found {spot.where} inside, by {deep:.3g} m at t = 0, accepted: members that begin outside"
            raise SceneError(message, ("contacts", spot.contact))

    @property
    def before(self) -> Equilibrium:
        """The equilibrium from which the motion starts, computed once."""
        if self._before is None:
            self._before = equilibrium_before(
                self.given, replace(self.settings, accuracy=0.1 * self.accuracy, accuracy_of=None)
            )
        return self._before

    _before: Equilibrium | None = None

    # -- all --------------------------------------------------------------------------------------------

    def motion(self) -> Trajectory:
        """The answer: runs on finer and finer discretisations until two agree to the accuracy."""
        analysis = self.scene.analysis
        mesh, error, coarser = self.mesh, None, None
        if self.scene.contacts and analysis.initial == "equilibrium":
            entries = (entry for name in self.scene.obstacles for entry in self.before.touched(name))
            mesh = ending_at(self.scene, mesh, ((e["member"], at) for e in entries for at in np.atleast_1d(e["at"])))
        apart: float | None = None
        run = self.run(mesh, 0)
        for _ in range(0 if analysis.step is None or self.prescribed else ROUNDS):
            # In steps that are given runs on finer meshes need not agree, but members must not dip into obstacles.
            if not run.dips or run.interrupted or run.failure is not None:
                break
            halved = self._without_dips(mesh, run)
            if halved.same(mesh):
                # Rigid members are not halved.
                break
            mesh, run = halved, self.run(halved, 0)
        for rounds in range(1, 1 + ROUNDS if analysis.step is None else 1):
            failed = run.failure is not None
            bent = run.failure is not None and run.failure.status in LIMITS
            if run.interrupted or bent or (failed and (self.prescribed or rounds > RESCUES)):
                break
            mesh = mesh if self.prescribed else self._ending_at(mesh.refined(), run)
            finer = self.run(mesh, rounds, run.count)
            if failed:
                # What a coarse mesh cannot follow a finer one may.
                run = finer
                continue
            if finer.interrupted or finer.failure is not None:
                # The whole way, though not judged, says more than a part of it.
                run.interrupted = finer.interrupted
                if finer.failure is not None:
                    why = finer.failure
                    run.failure = SolveError(why.status, f"{why.detail}; {ON_COARSER}", why.last)
                break
            before = apart
            apart, coarser, run = self._difference(run, finer), run, finer
            # Fronts that cross elements, and instants of yield within steps, leave no order by which errors fall.
            error = apart if self.scene.remembers else left(apart, before, self.accuracy)
            error = max(error, self._deepest(run))
            if error <= self.accuracy:
                break
        if error is not None and apart is not None and error > max(self.accuracy, apart, self._deepest(run)):
            run.notes = (*run.notes, SENSITIVE)
        return self._answer(run, error, () if coarser is None else tuple(coarser.instants))

    def _without_dips(self, mesh: Mesh, run: MeshRun) -> Mesh:
        """A mesh whose elements are halved where members dip into obstacles, and end at round ones where they do."""
        marks = {name: np.zeros(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
        for _, near in run.dips:
            marks[near.members[0]][mesh.element_at(near.members[0], near.at[0])] = True
        return self._ending_at(mesh.refined(marks), run)

    def _ending_at(self, mesh: Mesh, run: MeshRun) -> Mesh:
        """The mesh with ends of elements where members are deepest in round obstacles."""
        deepest = dict[PairKey, Near]()
        for _, near in run.dips:
            stop = self._closest.pairs[near.pair].stop
            if stop is not None and stop.kind == "round" and near.gap < getattr(deepest.get(near.pair), "gap", 0.0):
                deepest[near.pair] = near
        return ending_at(self.scene, mesh, ((near.members[0], near.at[0]) for near in deepest.values()))

    def _deepest(self, run: MeshRun) -> float:
        """How deep members dip into obstacles where that is more than is accepted, over the size."""
        return max((-near.gap for _, near in run.dips), default=0.0) / self.scene.size

    def _difference(self, coarse: MeshRun, fine: MeshRun) -> float:
        """How far runs are apart: distances of nodes and middles of members, over the size of the scene."""
        if self.quantity is not None:
            return apart_in(self.quantity, coarse.instants, fine.instants)
        scene, apart = self.scene, 0.0
        turning = coarse.instants[0].model.rotations.node_turn
        arms = {name: self._arm(coarse, name) for name in scene.nodes if turning[name] is not None}
        # What ends at a condition ends at times that differ a little: both ends are compared.
        ends = [(coarse.instants[-1], fine.instants[-1])]
        for one, other in (*zip(coarse.instants, fine.instants, strict=False), *ends):
            if one.time != other.time and one is not ends[0][0]:
                continue
            for node in scene.nodes:
                apart = max(apart, float(np.abs(one.position(node) - other.position(node)).max()))
            for node, arm in arms.items():
                a, b = one.quaternion(node), other.quaternion(node)
                assert a is not None
                assert b is not None
                # By the angle between, whichever signs the quaternions have.
                apart = max(apart, arm * 2.0 * float(np.linalg.norm(a - (1.0 if a @ b >= 0.0 else -1.0) * b)))
            for member in one.model.members:
                middle = np.array([0.5])
                moved = one.fields.positions(member, middle) - other.fields.positions(member, middle)
                apart = max(apart, float(np.abs(moved).max()))
        return apart / scene.size

    @staticmethod
    def _arm(run: MeshRun, name: str) -> float:
        """Arm, m, on which all mass would have the rotary inertia of what turns like a node: what its angle counts."""
        mover = run.instants[0].mover
        system, turn = mover.inertia.system, mover.model.rotations.node_turn[name]
        shares = [np.abs(group.mass).sum() for group in system.masses.observables if turn in group.turns]
        return float(np.sqrt(sum(shares) / system.axes)) * mover.model.scales.length

    def _answer(self, run: MeshRun, error: float | None, coarser: tuple[MotionState, ...]) -> Trajectory:
        short = error is not None and not error <= self.accuracy and self.asked
        status = Status.SHORT if short else Status.SOLVED
        if run.failure is not None:
            status = run.failure.status
        elif run.interrupted:
            status = Status.INTERRUPTED
        motion = Trajectory(
            scene=self.given,
            status=status,
            steps=tuple(run.instants),
            seconds=dict(self.seconds),
            integrator=self.name,
            count=run.count,
            error_estimate=error,
            error_of="" if self.quantity is None else self.quantity.text,
            violation={"norms": run.norm, "closings": run.gap},
            notes=(
                *run.notes,
                *self._unlikely(run),
                *self._dip_notes(run),
                *touched_notes(self.given),
                *self._superelement_notes(run),
                *self._law_notes(run),
            ),
            failure="" if run.failure is None else run.failure.detail,
            record=run.record,
            events=run.events,
            coarser=coarser,
        )
        if run.failure is not None:
            if motion.steps:
                run.failure.reached = motion
            raise run.failure
        return motion

    def _dip_notes(self, run: MeshRun) -> tuple[str, ...]:
        """Where members dip into obstacles the deepest, of all by more than is accepted; else what may be missed."""
        if not run.dips:
            missed = slips_between(self.scene, run.instants[0].fields.model.mesh) if run.instants else ""
            return (missed,) if missed else ()
        when, near = min(run.dips, key=lambda dip: dip[1].gap)
        where = f"members.{near.members[0]} at {near.at[0]:.3g} of its length is {-near.gap:.3g} m inside"
        return (f"at {when:.6g} s {where} contacts.{near.contact}, which stops ends of elements: take more of them",)

    def _superelement_notes(self, run: MeshRun) -> tuple[str, ...]:
        """Notes of small members where they bend most beyond linear elasticity."""
        if not self.superelements:
            return ()
        worst = max(run.instants, key=lambda instant: max(instant.fields.bent.values()), default=None)
        return (
            () if worst is None else tuple(f"at {worst.time:.6g} s {note}" for note in superelement_notes(worst.fields))
        )

    def _law_notes(self, run: MeshRun) -> tuple[str, ...]:
        """The first instant at which members bend beyond the laws of their sections."""
        return first_beyond_laws((f"at {instant.time:.6g} s", instant.fields) for instant in run.instants)

    def _unlikely(self, run: MeshRun) -> tuple[str, ...]:
        """Notes where a prescribed step, of which nothing estimates the error, is far too short or too long."""
        if self.scene.analysis.step is None or not run.instants:
            return ()
        short = "the step is so short that rounding decides the velocities"
        unit = run.instants[0].mover.time
        if self.scene.analysis.step < SHORTEST * unit:
            return (f"{short}: steps of {SHORTEST * unit:.2g} s or the whole span are taken instead",)
        if run.gap > DRIFTED:
            return (f"joints are off by {run.gap:.0e}: {short}",)
        kinetic, elastic, loads = np.array([instant.energies for instant in run.instants]).T
        total = kinetic + elastic + loads + np.array([instant.sample.lost for instant in run.instants])
        most = float(kinetic.max() + np.ptp(elastic) + np.ptp(loads))
        changed = float(np.abs(total - total[0]).max())
        if _keeps_energy(run.instants[0].model) and changed > LOST * most and most > RESTS:
            share = f"{100.0 * changed / most:.0f} % of what moves"
            return (f"nothing here gives or takes energy, but the total changes by {share}: the step is long for it",)
        return ()


def left(apart: float, before: float | None, accuracy: float) -> float:
    """Estimated relative error of the finest of several runs.

    Convergence by the order of the integrator is assumed where two runs agree to the accuracy itself, or where the
    differences fall accordingly; the error is then the sum of the geometric series of further differences.  Runs that
    have diverged from each other, as those of a chaotic motion do, say nothing about convergence.

    Parameters
    ----------
    apart : float
        Relative difference of the last two runs.
    before : float, optional
        Relative difference of the two runs before.
    accuracy : float
        Wanted relative error.

    Examples
    --------
    >>> [round(left(0.024, before, 0.01), 3) for before in (None, 0.5, 0.09, 0.025)]
    [0.024, 0.024, 0.009, 0.072]
    """
    if before is None or before > LOST_RUNS:
        return apart if apart > accuracy else apart / GAINED
    ratio = min(apart / before, UNSUPPORTED / (1.0 + UNSUPPORTED)) if before > 0.0 else 0.0
    return apart * max(ratio / (1.0 - ratio), 1.0 / GAINED)


RESTING = 0.01
"""Share of the accuracy within which places are on an obstacle in equilibrium, whose positions have a tenth of it."""

LOST_RUNS = 0.1
"""Difference of runs, relative, beyond which they do not follow the same motion to its end."""


def _keeps_energy(model: Model) -> bool:
    """Whether nothing changes the total energy: no history, motion, load without potential, drag or damping."""
    scene = model.scene
    given = bool(scene.histories_used) or bool(scene.motions)
    given = given or not model.has_potential
    taken = scene.relaxes or scene.remembers or any(part.damping or part.drag for part in scene.sections.values())
    taken = taken or any(spring.damping for spring in scene.springs.values())
    return not (given or taken or scene.rotating is not None or any(node.drag for node in scene.nodes.values()))


DRIFTED = 1e-11
"""Closings off by more than this, over the unit of length: usual are 1e-15."""

LOST = 0.05
"""Share of what moves that a total energy may change by without a note: Radau's methods damp waves by some percent."""


RESTS = 1e-11
"""Energy, dimensionless, that is none: what is closed is so to 1e-12 of the unit of length, under forces near one."""


class _Beginning:
    """What acts at the begin, without velocities and accelerations, dimensionless."""

    def __init__(self, system: StageEquations, touching: Array | None = None) -> None:
        n = system.layout
        touching = np.zeros(len(system.unilateral)) if touching is None else touching
        rows = system.unilateral.rows[touching == 0.0]
        self._touching, self._idle = touching, system.equations.unknowns + rows
        q, y, lam = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("lam", n.lam)
        factors, unwrapped = ca.MX.sym("factors", n.factors), ca.MX.sym("unwrapped", n.unwrapped)
        stage = system.stage(q, y, lam, ca.MX.zeros(n.x), factors, unwrapped)
        parts = [system.static_matrix(stage), system.coupling_matrix(stage, 0.0, 1.0)]
        parts += [system.coupling_matrix(stage, 1.0, 0.0), stage.residual]
        self._function = ca.Function("begin", [q, y, lam, factors, unwrapped], parts)
        self._equations, self._system = system.equations, system

    def __call__(self, state: State, lam: Array, factors: Array) -> tuple[Array, Array, Array, Array]:
        """Stiffness with closings, masses and dampers, (total, total) each, and the sum of all forces (total,)."""
        given = (state.q.T, state.y, lam, factors, self._system.counted(state, self._touching))
        stiffness, mass, damping, forces = (np.array(part) for part in self._function.call([ca.DM(x) for x in given]))
        # What does not act is a number of its own.
        stiffness[self._idle], stiffness[:, self._idle] = 0.0, 0.0
        stiffness[self._idle, self._idle] = 1.0
        return stiffness, mass, damping, forces.ravel()

    def check(self, state: State, factors: Array) -> None:
        """Refuse what the forces leave open, or would let jump."""
        n, lam = self._equations.unknowns, np.zeros(self._equations.rows)
        # Without loads, which are not yet in balance.
        stiffness, mass, _, _ = self(state, lam, 0.0 * factors)
        check_resisted(self._equations, stiffness + mass)
        stiffness, mass, damping, forces = self(state, lam, factors)
        parts = [mass[:n, :n], damping[:n, :n], stiffness[:n, n:]]
        check_balanced(self._equations, np.hstack(parts), forces[:n])

    def settled(self, state: State, factors: Array) -> State:
        """A state near balance with what has no mass in balance, while what has mass stays where it is."""
        n = self._equations.unknowns
        lam = np.zeros(self._equations.rows)
        for _ in range(SETTLING):
            stiffness, mass, _, forces = self(state, lam, factors)
            change = np.linalg.lstsq(stiffness + HELD * mass, -forces, rcond=None)[0]
            state, lam = self._equations.moved(state, np.append(change[:n], np.zeros(len(lam)))), lam + change[n:]
        return state


HELD = 1e8
"""Times their mass the stiffness by which masses are held, in the units of the model."""

SETTLING = 6
"""Iterations of Newton's method, from a state that has another mesh only."""


def _resistance(system: StageEquations, begun: InitialState) -> Array:
    """Stiffness, masses and closings at the begin, without loads, which are not yet in balance."""
    layout = system.layout
    stiffness, mass, _, _ = _Beginning(system)(begun.state, np.zeros(layout.lam), np.zeros(layout.factors))
    return np.asarray(stiffness + mass)


TAUT = (
    "a member is straight between places that come no closer, where one that keeps its length cannot bend: let it"
    " stretch (EA of its section, or stretch = true of its shape), or let one end slide"
)
"""What is said of a motion that is lost where closings of straight members are redundant."""

ALONG = "members that lie along each other, or touch at many places, are followed by the integrator 'stepping'"
"""What else to say where members that touch each other are not followed event by event."""

SNAPS = (
    "a flexible member without mass has no motion of its own: where it is drawn straight, or snaps, it would have to "
    "jump, accepted: a small rhoA"
)
"""What is said where a motion with such a member ends."""
