"""Load steps of scenes whose laws have memory: the whole sequence of steps on one mesh after another.

What members remember belongs to the integration points of one mesh, so no step goes from mesh to mesh by itself.  The
sequence is solved on the pilot mesh, on which each step is followed from the one before.  On finer meshes it is solved
again from the undeformed scene, each step beginning with the state of the coarser sequence.  Elements are halved where
any of the steps is not smooth, and the error of each is estimated from the difference of two sequences.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.keeping import kept
from ..mechanics.fields import transferred
from ..mechanics.fronts import front_errors, section_axes
from ..mechanics.memory import remembering
from ..mechanics.mesh import Mesh
from ..solvers.prepared import Prepared, Solved
from ..solvers.unrestrained import refuse_unrestrained
from .meshing import EquilibriumResult, Meshing
from .refinement import DRIFT, LEVELS, MOST_ELEMENTS, STALLS, Refinement
from .solution import Equilibrium
from .ways import NO_ENERGY, Ways

__all__ = ["MemorySteps", "left_by_fronts", "worst_fronts"]

NOT_FOLLOWED = (
    "the loads could not be followed from the step before; this is a minimum near it, of the energy with what members "
    "remember"
)

UNSTABLE = "an unstable equilibrium is kept, as what follows remembers it"

Sequence_ = tuple[EquilibriumResult, ...]


SHARP, MOST = 0.5, 0.1
"""Share of the accuracy that all fronts together may leave; share of the largest error of an element above which others
are halved with it."""


def left_by_fronts(found: Solved, across: Callable[[Array], Array] | None = None) -> Array:
    """What fronts within elements leave of rotations anywhere, (elements,), rad; of positions over the size, at most.

    Each element bends by its own error more, as by two opposite moments at its ends, and the structure answers with its
    present stiffness: near collapse by many times the error of the element.  Elements that no front crosses are smooth,
    and the comparison of meshes judges them.  ``across`` takes from the answers of the structure (total, n) what they
    have along a path, on which the factor gives way.
    """
    model, equations = found.model, found.equations
    errors, present, mixed = front_errors(found.fields)
    errors *= mixed[:, None]
    errors, longer = errors[:, :3], errors[:, 3]
    answered = np.linalg.norm(errors, axis=1)
    chosen = np.flatnonzero(answered > SMALL * answered.max(initial=0.0))
    if not len(chosen):
        return answered + longer
    moments = np.zeros((len(answered), 3))
    for name, cuts in model.mesh.cuts.items():
        section = model.scene.sections.get(str(model.scene.members[name].section))
        if section is not None:
            part, middles = model.elements_of(name), 0.5 * (cuts[1:] + cuts[:-1])
            firm = (
                np.nan_to_num(section.stiffness(middles))
                / (np.diff(cuts) * model.scene.center_lines[name].length)[:, None]
            )
            own = firm * present[part, None] * errors[part] / model.scales.moment
            moments[part] = np.einsum("nij,nj->ni", section_axes(found.fields, name, middles), own)
    tables, shape = equations.tables, equations.number.shape
    unknown, weight = (part[: tables.of_places].reshape(shape) for part in (tables.unknown, tables.weight))
    right, columns = np.zeros((equations.total, len(chosen))), np.arange(len(chosen))[:, None]
    for end, sign in ((0, 1.0), (-1, -1.0)):
        turns = model.rotations.turns[chosen, end]
        rows, given = unknown[turns], sign * moments[chosen][:, 3 - shape[1] :] * weight[turns]
        used = rows >= 0
        np.add.at(right, (rows[used], np.broadcast_to(columns, rows.shape)[used]), given[used])
    primal = tolerances.PROXIMAL * found.prepared.weight
    equations.solver.factor(equations.regularised(found.point.entries, primal, tolerances.DUAL))
    moved = equations.solver.solve(right)
    moved = moved if across is None else across(moved)
    turned = np.abs(moved[: equations.rotation_unknowns]).max(axis=0, initial=0.0)
    answered[chosen] = np.maximum(answered[chosen], turned)
    return answered + longer


def worst_fronts(fronts: Array, accuracy: float) -> Array:
    """Which elements (elements,) are to be halved, as their fronts leave most: none where all together leave little."""
    return np.asarray((fronts > MOST * fronts.max(initial=0.0)) & (fronts.sum() > SHARP * accuracy))


SMALL = 1e-3
"""Share of the largest error of an element below which its effect on others is not looked at."""


class MemorySteps:
    """The load steps of a scene whose laws have memory.

    Parameters
    ----------
    meshes, ways, refinement
        Of the scene, see :class:`~sfetcas.equilibria.statics.LoadSteps`.
    """

    def __init__(self, meshes: Meshing, ways: Ways, refinement: Refinement) -> None:
        self.meshes, self.ways, self.refinement, self.scene = meshes, ways, refinement, meshes.scene
        self.failed: tuple[float, int] = (0.0, 0)

    def answers(self) -> list[Equilibrium]:
        """The equilibria of all steps.

        Raises
        ------
        SceneError, SolveError
            Nothing holds the scene; a step has no equilibrium that could be found, ``failed`` says which.
        """
        now = self._sequence(self.meshes.pilot_mesh, ())
        if self.meshes.pilot_mesh is not self.meshes.target:
            now = self._sequence(self.meshes.target, now)
        if self.meshes.prescribed:
            finer = self._sequence(now[0].solved.model.mesh.refined(), now)
            # The error before the halving is what that changes and what it leaves.
            apart = [sum(self.refinement.difference(a, b)) for a, b in zip(now, finer, strict=True)]
            errors = [max(pair) for pair in zip(apart, self._left(now), strict=True)]
            return [self._answer(one, error, None) for one, error in zip(now, errors, strict=True)]
        return self._refined(now)

    def _refined(self, now: Sequence_) -> list[Equilibrium]:
        """As of :meth:`.Refinement.refined`, of all steps together."""
        accuracy, usual = self.meshes.accuracy, np.sqrt(self.meshes.accuracy)
        smooth, last, stalled = usual, np.inf, 0
        for _ in range(LEVELS):
            marked = self._marked(now, smooth)
            if any(marks.any() for marks in marked.values()):
                if now[0].solved.model.mesh.elements > MOST_ELEMENTS:
                    break
                now = self._sequence(now[0].solved.model.mesh.refined(marked), now)
                continue
            now, differences, errors = self._halved(now)
            stalled = stalled + 1 if max(errors) > 0.5 * last else 0
            if max(errors) <= accuracy or stalled == STALLS:
                return [self._answer(*each) for each in zip(now, errors, differences, strict=True)]
            last, smooth = max(errors), min(usual, 0.1 * smooth)
        now, differences, errors = self._halved(now)
        return [self._answer(*each) for each in zip(now, errors, differences, strict=True)]

    def _halved(self, now: Sequence_) -> tuple[Sequence_, list[float], list[float]]:
        """The sequence on halved elements, how far each step is from that before, and its estimated error."""
        finer = self._sequence(self.refinement.halved(now[0]), now)
        judged = [self.refinement.difference(a, b) for a, b in zip(now, finer, strict=True)]
        errors = [max(error, left) for (_, error), left in zip(judged, self._left(finer), strict=True)]
        if self.meshes.fixed:
            # What members contribute whose number of elements is asked for.
            twice = self._sequence(finer[0].solved.model.mesh.refined(), finer)
            left = [sum(self.refinement.difference(a, b)) for a, b in zip(finer, twice, strict=True)]
            errors = [max(pair) for pair in zip(errors, left, strict=True)]
        return finer, [difference for difference, _ in judged], errors

    def _marked(self, now: Sequence_, smooth: float) -> dict[str, Array]:
        """Elements to halve: those that are not smooth in some step, and those whose fronts leave most, if too much."""
        each = [self.refinement.marked(one, smooth) for one in now]
        model = now[0].solved.model
        for fronts in self._fronts(now):
            worst = worst_fronts(fronts, self.meshes.accuracy)
            each.append({n: worst[model.elements_of(n)] & (n not in self.meshes.fixed) for n in model.members})
        return {name: np.any([marks[name] for marks in each], axis=0) for name in each[0]}

    def _left(self, sequence: Sequence_) -> list[float]:
        """What fronts within elements leave of the rotations of each step, rad, and of positions over the size.

        What one step leaves is remembered by those that follow.
        """
        return list(itertools.accumulate((float(fronts.sum()) for fronts in self._fronts(sequence)), max))

    @kept(2)
    def _fronts(self, sequence: Sequence_) -> list[Array]:
        """As of :func:`left_by_fronts`, of each step."""
        return [left_by_fronts(one.solved) for one in sequence]

    def _sequence(self, mesh: Mesh, near: Sequence[EquilibriumResult]) -> Sequence_:
        """All steps on a mesh, one after the other; ``near`` are those of a coarser one."""
        found: list[EquilibriumResult] = []
        mesh = replace(mesh, memory={})
        for i, factor in enumerate(self.scene.analysis.steps):
            self.failed = factor, len(found)
            prepared = self.meshes.prepared(mesh)
            refuse_unrestrained(prepared, factor)
            step = self._beside(prepared, near[i]) if near else None
            found.append(step or self._step(prepared, factor, found))
            mesh = remembering(prepared.model, found[-1].solved.state.q, found[-1].solved.state.y)
        return tuple(found)

    def _beside(self, prepared: Prepared, near: EquilibriumResult) -> EquilibriumResult | None:
        """The step from its state on a coarser mesh, where Newton's method leads from that to one near it."""
        state = transferred(near.solved.model, near.solved.state, prepared.model)
        loading = prepared.model.loading(near.solved.factor)
        solved = prepared.correct(state, loading, iterations=25, most=1.5, contraction=np.inf)
        if not solved.converged or prepared.distance(state, solved.state) > DRIFT:
            return None
        return near.onto(solved)

    def _step(self, prepared: Prepared, factor: float, before: Sequence[EquilibriumResult]) -> EquilibriumResult:
        """The step from the one before, or from the undeformed scene.

        Raises
        ------
        SolveError
            The loads lead to no equilibrium.
        """
        begin = before[-1].solved if before else None
        if begin is None:
            found = self.ways.grown_from_zero(prepared, factor)
        else:
            found = self.ways.grown_from(prepared, begin.factor, factor, begin.state)
        if found is None:
            loading = prepared.model.loading(factor)
            state = prepared.guess(loading)[0] if begin is None else begin.state
            if not prepared.model.minimisable:
                raise SolveError(Status.FAILED, "the loads could not be followed from the step before", state)
            solved, iterations = prepared.minimise(loading, state)
            found = EquilibriumResult(solved, notes=(NOT_FOLLOWED,), iterations=iterations, way=("minimum",))
        notes = found.notes
        if not prepared.model.conservative:
            notes += (NO_ENERGY,)
        elif found.stability.negative > 0:
            notes += (UNSTABLE,)
        # What follows remembers this state: no finer mesh may leave it for another.
        return replace(found, kept=True, notes=notes)

    def _answer(self, found: EquilibriumResult, error: float, halved: float | None) -> Equilibrium:
        return self.refinement.answer(found, error, halved)
