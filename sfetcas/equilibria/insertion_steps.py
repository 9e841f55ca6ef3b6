"""Load steps of scenes in which tubes and members are pushed out: each is followed from the one before.

At each load factor the scene is another one: elements end elsewhere, and members are longer.  A way from factor to
factor is followed on models of these scenes, whose states are carried from mesh to mesh.  A step is short enough that
Newton's method converges at once, and the state is stable at its end.  Where no step is short enough, or the state
ceases to be stable, the place is found by ever shorter steps, and the state beyond it is the one that lies downhill.

What is found at the factor of a load step is refined as any other equilibrium, and the next step begins there.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..description.inserting import gone_to, inserted, pushed, share_of, stops_between
from ..errors import SolveError, Status
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..solvers.continuation import CONTRACTION, JUMPED, STEP_ROTATION, advanced
from ..solvers.prepared import Prepared, Solved
from ..solvers.unrestrained import refuse_unrestrained
from .meshing import EquilibriumResult, Meshing
from .refinement import Refinement
from .settings import Settings
from .solution import Equilibrium, Solution, at_factor, refuse_large
from .ways import NO_ENERGY, Ways

__all__ = ["InsertionSteps"]

SHORT = 1e-3
"""Part of a way from which on steps are short: corrections may shrink slowly, as they do close to a snap."""

LOCATED = 1e-8
"""Part of a way to which the place of a snap is found."""

NEAR = 0.1
"""Rotation, rad, that a step of the length ``SHORT`` may bring; beside a snap it goes with the root of the step."""

LOST = 0.1
"""Share of the smallest eigenvalue away from a snap below which it is there: elsewhere Newton's method alone fails."""

BEYOND = 1e-3
"""Part of a way beyond a snap where the state after it is looked for: at the snap itself nothing drives it away."""

LONGEST = 0.1
"""A step pushes nothing by more than this, in sizes of the scene, and turns no base by more than a radian."""

TRIES = 400
"""Steps tried on a way between two knots of histories, and as many for each radian and each size of the scene."""

ENDS = (
    "the state ends there, and what lies downhill was not found, or was not to be looked for: unstable = 'leave' goes "
    "on with the state after a snap"
)


@dataclass(frozen=True, eq=False)
class _On:
    """An equilibrium on a way, and the part of the way that is done there."""

    found: Solved
    done: float


@dataclass(eq=False)
class _Way:
    """The way from one load factor to another between which no history has a knot.

    ``blocked`` is the nearest part of the way known to which no step led, ``longest`` the part that a step takes, and
    ``halved`` says whether the last one was halved.  ``regular`` is the last equilibrium that a step brought that was
    not short; ``snaps`` are the factors of those passed.
    """

    steps: InsertionSteps
    begin: float
    end: float
    blocked: float = np.inf
    longest: float = 1.0
    halved: bool = False
    regular: Solved | None = None
    snaps: list[float] = field(default_factory=list)

    def factor(self, done: float) -> float:
        """The load factor at a part of the way; at 1 exactly the last one."""
        return self.end if done == 1.0 else self.begin + done * (self.end - self.begin)

    def followed(self, found: Solved) -> Solved:
        """The equilibrium at the end of the way, from the one at its beginning.

        Raises
        ------
        SolveError
            The way ends before.
        """
        effort = self.effort
        self.longest = 1.0 / max(1.0, effort)
        tries = int(TRIES * (1.0 + effort))
        here, reached = advanced(_On(found, 0.0), 0.25, self.trial, lambda here: here.done >= 1.0, tries=tries)
        if not reached:
            detail = (
                f"what is pushed out could not be followed beyond {self.steps.place(self.factor(here.done))}: {ENDS}"
            )
            raise SolveError(Status.FAILED, detail, here.found.state)
        return here.found

    @property
    def effort(self) -> float:
        """How far things are pushed and turned on the way: in ``LONGEST`` of the size of the scene, and in radians."""
        scene, change = self.steps.scene, 0.0
        for record in (*scene.tubes.values(), *(member for _, _, member in pushed(scene))):
            for value, history in (
                (record.insertion / (LONGEST * scene.size), record.insertion_history),
                (getattr(record, "rotation", 0.0), getattr(record, "history", None)),
            ):
                begin, end = (
                    t if history is None else scene.histories[history].factor(t) for t in (self.begin, self.end)
                )
                change = max(change, abs(value * (end - begin)))
        return change

    def trial(self, here: _On, length: float) -> tuple[_On | None, float]:
        """The next point, None if the step is refused, and the length of the next step."""
        short = length <= SHORT
        if np.isfinite(self.blocked) and short:
            # Towards the place where it was lost, and at last onto it: from near it may be reached after all.
            apart = self.blocked - here.done
            length = apart if apart <= LOCATED else min(length, 0.5 * apart)
        length = min(length, self.longest, 1.0 - here.done)
        done = 1.0 if here.done + length > 1.0 - LOCATED else here.done + length
        there, linear = self._step(here.found, done, length)
        if there is not None:
            self.blocked = np.inf if done >= self.blocked else self.blocked
            self.regular = self.regular if short else there
            # What was just halved is not doubled at once.
            grown = length * (2.0 if linear and not self.halved else 1.0)
            self.halved = False
            return _On(there, done), grown
        self.blocked = min(self.blocked, done) if self.blocked > here.done else done
        if length > LOCATED:
            self.halved = True
            return None, 0.5 * length
        return self._snapped(here, done)

    def _step(self, found: Solved, done: float, length: float) -> tuple[Solved | None, bool]:
        """The equilibrium near a found one at a part of the way, if it is stable, and whether it was near enough."""
        prepared = self.steps.prepared(self.factor(done))
        state = transferred(found.model, found.state, prepared.model)
        short = length <= SHORT
        there = prepared.correct(
            state,
            prepared.model.loading(self.factor(done)),
            most=STEP_ROTATION,
            contraction=np.inf if short else CONTRACTION,
            iterations=ITERATIONS,
        )
        linear = there.second < CONTRACTION * there.first or there.first < LITTLE
        if not there.converged:
            return None, linear
        if short and _apart(prepared, state, there.state) > NEAR * np.sqrt(max(length, LOCATED) / SHORT):
            return None, linear
        if self.steps.leaves and there.negative:
            return None, linear
        return there, linear

    def _snapped(self, here: _On, done: float) -> tuple[_On | None, float]:
        """The state beyond the place where a branch ends or ceases to be stable, and the length of the next step."""
        fallen = self.regular is None or here.found.stability.smallest < LOST * self.regular.stability.smallest
        if not self.steps.leaves or not fallen:
            return None, 0.0
        self.snaps.append(self.factor(done))
        beyond = 1.0 if done + BEYOND > 1.0 else done + BEYOND
        prepared = self.steps.prepared(self.factor(beyond))
        loading = prepared.model.loading(self.factor(beyond))
        state = transferred(here.found.model, here.found.state, prepared.model)
        lost = replace(here.found, prepared=prepared, state=state, loading=loading, known=None)
        try:
            there = prepared.switch_branch(lost, loading)
        except SolveError:
            return None, 0.0
        self.blocked, self.regular = np.inf, None
        return _On(there, beyond), 0.1


ITERATIONS = 15
"""Iterations of Newton's method for a step."""

LITTLE = 1e-3
"""A first correction below this, rad, is no sign of a step that is too long."""


def _apart(prepared: Prepared, a: State, b: State) -> float:
    """Largest angle, rad, between the rotations of two states, or between the angles of tubes."""
    model, found = prepared.model, prepared.distance(a, b)
    for places in model.segments.angles.values():
        numbers = np.where(places < 0, -1, model.positions.retained[places, 0])
        numbers = numbers[numbers >= 0]
        found = max(found, float(np.abs(a.y[numbers] - b.y[numbers]).max(initial=0.0)))
    return found


class InsertionSteps:
    """The load steps of a scene in which tubes or members are pushed out.

    Parameters
    ----------
    scene, settings
        As of :func:`~sfetcas.equilibria.statics.solve`.
    """

    def __init__(self, scene: Any, settings: Settings) -> None:
        self.scene, self._settings = scene, settings
        self._seconds = {"model": 0.0, "solve": 0.0}
        self._known: tuple[float, Meshing] | None = None
        self.leaves = scene.analysis.unstable == "leave"

    def solution(self) -> Solution:
        """Solve all load steps, from the state at factor 0 on.

        Raises
        ------
        SceneError, SolveError
            A load step has no equilibrium that could be found; its ``reached`` has the steps before.
        """
        begin, steps = time.perf_counter(), list[Equilibrium]()
        factor, accuracy, asked = 0.0, 0.0, False
        try:
            found = self._first()
            for factor in self.scene.analysis.steps:
                found, snaps = self._onward(found, factor)
                meshes = self._meshes(factor)
                refined = replace(Refinement(meshes).refined(found), snaps=snaps)
                if self.scene.limited:
                    refuse_large(refined.fields)
                steps.append(refined)
                accuracy, asked = meshes.accuracy, meshes.asked
                found = self._carried(found, refined)
        except SolveError as error:
            self._seconds["solve"] = time.perf_counter() - begin - self._seconds["model"]
            raise at_factor(error, self.scene, factor, steps, self._seconds) from None
        self._seconds["solve"] = time.perf_counter() - begin - self._seconds["model"]
        reached = all((step.certificate.error_estimate or 0.0) <= accuracy for step in steps)
        return Solution(
            self.scene, Status.SOLVED if reached or not asked else Status.SHORT, tuple(steps), self._seconds
        )

    def prepared(self, factor: float) -> Prepared:
        """The model of the scene at a load factor on the mesh of the ways, ready to be solved."""
        meshes = self._meshes(factor)
        return meshes.prepared(meshes.pilot_mesh.refined())

    def place(self, factor: float) -> str:
        """Where a load factor is, in words: how far the tubes and members have gone and the tubes have turned."""
        scene = self.scene
        gone = [
            f"{table}.{name}.insertion {gone_to(scene, record, factor):.7g} m" for table, name, record in pushed(scene)
        ]
        turned = [
            f"tubes.{name}.rotation {tube.rotation * share_of(scene, tube.history, factor):.7g} rad"
            for name, tube in scene.tubes.items()
            if tube.rotation
        ]
        return f"factor {factor:.7g}, {', '.join(gone + turned)}"

    def _meshes(self, factor: float) -> Meshing:
        """The meshes of the scene at a load factor."""
        if self._known is None or self._known[0] != factor:
            before = self._known
            meshes = Meshing(inserted(self.scene, factor), self._settings)
            # A state goes from model to model with its multipliers.
            meshes.seconds = self._seconds
            meshes.assembly = meshes.assembly if before is None else before[1].assembly
            self._known = factor, meshes
        return self._known[1]

    def _first(self) -> EquilibriumResult:
        """The state at the load factor 0, from which all begins."""
        prepared = self.prepared(0.0)
        refuse_unrestrained(prepared, 0.0)
        ways = Ways(self._meshes(0.0))
        try:
            return ways.result(prepared, 0.0, None)
        except SolveError as error:
            raise ways.named(prepared, error) from None

    def _onward(self, found: EquilibriumResult, factor: float) -> tuple[EquilibriumResult, tuple[float, ...]]:
        """The state at another load factor, with notes on the snaps on the way there, and their factors."""
        solved, snaps = found.solved, list[float]()
        for begin, end in pairwise(stops_between(self.scene, solved.factor, factor)):
            if begin != end:
                way = _Way(self, begin, end)
                solved = way.followed(solved)
                snaps += way.snaps
        notes = tuple(f"snapped at {self.place(snap)}: {JUMPED}" for snap in snaps)
        way_there = ("growing", *("left",) * bool(snaps))
        # What is said of the tangent at factor 0 does not hold of the whole way.
        notes = (*found.notes, *notes) if solved.model.conservative else (NO_ENERGY,)
        return EquilibriumResult(solved, notes=notes, iterations=found.iterations, way=way_there), tuple(snaps)

    def _carried(self, found: EquilibriumResult, refined: Equilibrium) -> EquilibriumResult:
        """What the next step begins with: the answer of this one on the mesh of the ways."""
        prepared = found.solved.prepared
        state = transferred(refined.model, refined.state, prepared.model)
        solved = prepared.correct(state, found.solved.loading)
        solved = solved if solved.converged else found.solved
        return found.onto(solved, notes=(), iterations=0)
