"""Mesh refinement: from an equilibrium on the pilot mesh to an answer of the wanted accuracy, and its error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.records import counted
from ..description.supports import free_to_move
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.linear import blurred
from ..mechanics.accuracy import roughness
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.loading import Loading
from ..mechanics.mesh import Mesh, every_other
from ..solvers.constraints import in_words, moves_nodes
from ..solvers.deflation import deflated
from ..solvers.prepared import BEYOND, Prepared, Solved
from ..solvers.redundancy import loose_rows, named_in, stretched
from ..solvers.residuals import LEAST_SCALE, relative_residual
from ..solvers.sharing import SHARED, SMALLEST, shared, stretches
from ..solvers.stability import LIGHT
from .meshing import EquilibriumResult, Meshing
from .mirrors import has_twin
from .single import finished
from .solution import Equilibrium, refuse_large
from .ways import KEPT

__all__ = ["DRIFT", "LEVELS", "MOST_ELEMENTS", "STALLS", "TORN", "Refinement"]

HUGE = 2000
"""From this many elements on the error is estimated from the mesh with half the elements, not with twice."""

LEVELS = 40
"""Most refinements of a mesh: a boundary layer of 1e-8 of a member needs about 27."""

STALLS = 3
"""Halvings of all elements in a row that leave more than half of the error: what is left is rounding."""

MOST_FURTHER = 300
"""Elements at most for what a search found: an equilibrium that needs more is seldom one of a beam."""

DRIFT = 1.0
"""Largest rotation, rad, from an equilibrium on a mesh to one on a finer mesh with which the two count as the same."""

ELSEWHERE = (
    "on a finer mesh the equilibrium is not near that of a coarser one, on which the loads were followed from zero: "
    "it may be another one"
)

DRIFTS = 3
"""So many finer meshes without the same equilibrium show that there is none; one alone may be too coarse."""

MOST_ELEMENTS = 20_000
"""A mesh that the library chooses does not grow beyond this."""

TORN = 0.5
"""Roughness of an element, rad, that no refinement has made smooth: meshes that follow errors leave 0.01 and less."""

MOST_TURNED = 1e8
"""Largest angle of an answer, rad: rounding leaves 1e-8 of it."""

TURN_LOST = 1.5
"""Rotations along a mesh that is asked for further than this, rad, from those on the pilot: a turn may be lost."""

COARSE = 0.1
"""Share of the largest section moment by which moments of two meshes may differ without a note."""

RESISTED = 2e-9
"""Eigenvalues above this, in those of the softest member, and above rounding hold a mechanism, if barely."""

LOOSE = 1e-6
"""Share of what acts that redundant multipliers carry, on next to nothing: rounding of what hardly acts is far less."""

LARGE = 1e3
"""Multipliers over the loads above which that is looked at."""

ALONG_MODE = "along its unstable mode"
"""What notes say of unstable states that were left."""

TWIN = (
    "its mirror image is an equilibrium as well; which of the two is a rule: the unstable mode turns the first ends of "
    "members towards +z, in space +b3, the first names in the alphabet most"
)
"""What is said where the energy does not tell one side from the other."""


class Refinement:
    """Refines meshes from the pilot until the estimated error meets the accuracy asked for.

    Parameters
    ----------
    meshes : Meshing
        The scene with its settings and meshes.
    """

    def __init__(self, meshes: Meshing) -> None:
        self.meshes = meshes

    def onto(self, mesh: Mesh, source: EquilibriumResult) -> EquilibriumResult:
        """The equilibrium carried over to another mesh and corrected there by Newton's method.

        Raises
        ------
        SolveError
            Newton's method does not converge there.
        """
        if mesh.same(source.solved.model.mesh):
            # Without flexible members nothing is halved.
            return source
        prepared = self.meshes.prepared(mesh)
        loading = prepared.model.loading(source.solved.factor)
        state = self._placed(source.solved, prepared, loading)
        solved = self._corrected(prepared, state, loading, source.neutral)
        if source.kept and not solved.converged:
            solved = deflated(prepared, state, loading, ()) or solved
        if source.kept and (not solved.converged or prepared.distance(state, solved.state) > DRIFT):
            raise SolveError(Status.FAILED, "an equilibrium of a coarse mesh only", state)
        drifts, way = source.drifts, source.way
        if not solved.converged:
            way = way if "refound" in way else (*way, "refound")
            try:
                solved, _ = prepared.minimise(loading, state)
            except SolveError as error:
                raise SolveError(error.status, error.detail + more_than(mesh, source), error.last) from None
            drifts += prepared.distance(state, solved.state) > DRIFT
            if drifts == DRIFTS:
                detail = f"each of {DRIFTS} finer meshes has another equilibrium, far from that of the mesh before"
                raise SolveError(Status.FAILED, detail, state)
        apart = prepared.distance(state, solved.state) > DRIFT and ELSEWHERE not in source.notes
        notes = (*source.notes, ELSEWHERE) if apart else source.notes
        return source.onto(solved, notes=notes, drifts=drifts, way=way)

    @staticmethod
    def _placed(source: Solved, prepared: Prepared, loading: Loading) -> State:
        """The state on another mesh, where holes of tendons may need places that it has not."""
        state, segments = transferred(source.model, source.state, prepared.model), prepared.model.segments
        told = {*source.model.segments.retained, *(segments.places[i] for i in segments.without_position)}
        if not source.model.scene.tendons or segments.retained <= told:
            return state
        state = prepared.equations.holding(state, loading)
        return prepared.equations.closed(state, loading, {*source.model.positions.unknowns})

    @staticmethod
    def _corrected(prepared: Prepared, state: State, loading: Loading, flat: bool) -> Solved:
        """Newton's method; along a flat energy rounding of 1e-14 leads it 1e-5 rad astray from mesh to mesh."""
        near = prepared.correct(state, loading, iterations=25, most=1.5)
        if not flat or not near.converged:
            return near
        _, values, shapes = prepared.around_zero(near.point)
        still = shapes[:, np.abs(values) <= near.stability.limit]
        across = prepared.correct(state, loading, iterations=25, most=1.5, flat=still)
        return across if across.converged else near

    def refined(self, pilot: EquilibriumResult) -> Equilibrium:
        """The answer that is found on a pilot mesh, on one that is fine enough.

        Raises
        ------
        SceneError, SolveError
            Nothing holds it, or finer meshes do not have it.
        """
        if not pilot.kept:
            if pilot.solved.multipliers > BEYOND:
                # What no finite force holds straight may look balanced, by rounding, and free along the rest.
                _with_unique_reactions(pilot)
            # What nothing holds on a coarse mesh no finer one holds.
            _refuse_free(pilot.solved)
        if self.meshes.scene.limited_on_ways:
            refuse_large(pilot.solved.fields)
        if self.meshes.prescribed:
            return self._on_target(pilot)
        mesh = pilot.solved.model.mesh
        own = mesh is not self.meshes.pilot_mesh and mesh.order == self.meshes.target.order and not self.meshes.fixed
        there = mesh is self.meshes.target or own
        now = pilot if there else self._onto_target(pilot)
        usual = np.sqrt(self.meshes.accuracy)
        # Of one quantity a mesh may be right that is too coarse for all positions.
        smooth, last, stalled = usual if self.meshes.quantity is None else max(usual, 0.5 * TORN), np.inf, 0
        for _ in range(LEVELS):
            marked = self._marked(now, smooth)
            if not any(m.any() for m in marked.values()):
                finer = self.onto(self.halved(now), now)
                difference, error = self._difference(now, finer)
                now = finer
                if error <= self.meshes.accuracy:
                    return self._answer(now, max(error, self._of_fixed(now)), difference)
                stalled = stalled + 1 if error > 0.5 * last else 0
                if stalled == STALLS:
                    return self._answer(now, max(error, self._of_fixed(now)), difference)
                last, smooth = error, min(usual, 0.1 * smooth)
            elif now.solved.model.mesh.elements > (MOST_FURTHER if now.kept else MOST_ELEMENTS):
                break
            else:
                now = self.onto(_divided(now, marked), now)
        finer = self.onto(self.halved(now), now)
        difference, error = self._difference(now, finer)
        return self._answer(finer, max(error, self._of_fixed(finer)), difference)

    def _of_fixed(self, now: EquilibriumResult) -> float:
        """What members contribute whose number of elements is asked for, and which the halving left as they were."""
        if not self.meshes.fixed:
            return 0.0
        return sum(self._difference(now, self.onto(now.solved.model.mesh.refined(), now)))

    def halved(self, now: EquilibriumResult) -> Mesh:
        """The mesh with all elements halved, but those of members whose number of elements is prescribed."""
        mesh = now.solved.model.mesh
        marks = {n: np.full(len(c) - 1, n not in self.meshes.fixed) for n, c in mesh.cuts.items()}
        return _divided(now, marks)

    def _on_target(self, pilot: EquilibriumResult) -> Equilibrium:
        """Everything was prescribed: solve there, and estimate the error from a mesh beside it."""
        mesh = self.meshes.target
        if mesh.elements > HUGE:
            half = replace(mesh, cuts={n: every_other(self.meshes.scene, n, c) for n, c in mesh.cuts.items()})
            coarse = self.onto(half, pilot)
            now = self.onto(mesh, coarse)
            # The error falls by 4^p a halving; twice that share for not being there yet.
            difference, _ = self._difference(coarse, now)
            return self._answer(now, difference * 2.0 / (4.0**mesh.order - 1.0), difference)
        now = pilot if self.meshes.pilot_mesh is mesh else self._onto_target(pilot)
        finer = self.onto(mesh.refined(), now)
        # The error before the halving is what that changes and what it leaves.
        error = sum(self._difference(now, finer))
        return self._answer(_with_coarse_moments(now, finer), error)

    def _onto_target(self, pilot: EquilibriumResult) -> EquilibriumResult:
        """The same on the mesh that is asked for.

        Raises
        ------
        SolveError
            That is too coarse for it.
        """
        now = self.onto(self.meshes.target, pilot)
        if not now.solved.model.space:
            return now
        fine, state = pilot.solved.prepared, now.solved.state
        apart = fine.distance(transferred(now.solved.model, state, fine.model), pilot.solved.state)
        few, many = (counted(n, "element", "elements") for n in (self.meshes.target.elements, fine.model.mesh.elements))
        if apart > TURN_LOST:
            detail = f"{few} asked for turn {apart:.2g} rad away from what was found on {many}" + more_than(
                self.meshes.target, pilot
            )
            raise SolveError(Status.FAILED, detail, state)
        if now.solved.negative > 0 and pilot.stability.negative == 0:
            detail = f"{few} asked for snap away from what is stable on {many}" + more_than(self.meshes.target, pilot)
            raise SolveError(Status.FAILED, detail, state)
        return now

    def _answer(self, found: EquilibriumResult, error: float, halved: float | None = None) -> Equilibrium:
        """The answer with its estimated error, and how far it is from that before all elements were halved."""
        found = self._accepted(found)
        leaves = self.meshes.switch_branch and not found.kept and KEPT not in found.notes
        if leaves and found.solved.stability.negative > 0 and found.solved.prepared.switches_branch:
            solved = found.solved.prepared.switch_branch(found.solved, found.solved.loading)
            note = "left an equilibrium that is unstable on the fine mesh only"
            notes, way = (*found.notes, note), (*found.way, "left")
            found = replace(found, solved=solved, found=None, notes=notes, way=way)
            # The error and the difference were those of the state that was left.
            error, halved = sum(self._difference(found, self.onto(solved.model.mesh.refined(), found))), None
            found = self._accepted(found)
        solved = found.solved
        twin = any(ALONG_MODE in note for note in found.notes) and has_twin(solved)
        return finished(
            solved,
            error_estimate=error,
            halved=halved,
            error_of=self.meshes.error_of,
            notes=(*found.notes, TWIN) if twin else found.notes,
            iterations=found.iterations,
            way=found.way,
        )

    def _accepted(self, found: EquilibriumResult) -> EquilibriumResult:
        """The same with unique reactions, where it is an equilibrium of the scene and not of the mesh only.

        Raises
        ------
        SceneError, SolveError
            Nothing holds it, or angles or forces have no meaning.
        """
        found = _with_unique_reactions(found)
        _refuse_many_turns(found.solved)
        self._refuse_torn(found.solved)
        if not found.kept:
            _refuse_free(found.solved)
        return found

    def _refuse_torn(self, found: Solved) -> None:
        """Refuse rotations that jump within an element, however short: a full turn there bends no beam.

        Between q and -q elements pass by without a place moved or, at their nodes, a moment: no estimate sees it.

        Raises
        ------
        SolveError
            Names the member.
        """
        rough = roughness(found.fields)
        for name in found.model.members:
            worst = float(rough[found.model.elements_of(name)].max(initial=0.0))
            if name not in self.meshes.fixed and worst > TORN:
                detail = f"an equilibrium of the mesh only: member {name!r} turns by a jump within an element"
                raise SolveError(Status.FAILED, detail, found.state)

    def _difference(self, coarse: EquilibriumResult, fine: EquilibriumResult) -> tuple[float, float]:
        """How far two answers are apart in what the accuracy is of, and the estimated error of the finer one."""
        return self.meshes.judged(coarse.solved, fine.solved)

    def answer(self, found: EquilibriumResult, error: float, halved: float | None) -> Equilibrium:
        """The answer of a step that others remember, with its estimated error and how far it is from a coarser one."""
        return self._answer(found, error, halved)

    def difference(self, coarse: EquilibriumResult, fine: EquilibriumResult) -> tuple[float, float]:
        """How far two answers are apart in what the accuracy is of, and the estimated error of the finer one."""
        return self._difference(coarse, fine)

    def marked(self, found: EquilibriumResult, smooth: float) -> dict[str, Array]:
        """Elements to halve: those rougher than ``smooth``, of members whose mesh is not prescribed."""
        return self._marked(found, smooth)

    def _marked(self, found: EquilibriumResult, smooth: float) -> dict[str, Array]:
        """Elements to halve: those that are not smooth, of members whose mesh is not prescribed."""
        rough, model = roughness(found.solved.fields) > smooth, found.solved.model
        return {n: rough[model.elements_of(n)] & (n not in self.meshes.fixed) for n in model.members}


def _divided(now: EquilibriumResult, marked: Mapping[str, Array]) -> Mesh:
    """The mesh with marked elements halved, or divided where a ring pushes them."""
    return now.solved.model.mesh.refined(marked, now.solved.fields.kinks)


def more_than(mesh: Mesh, source: EquilibriumResult) -> str:
    """The advice to take more elements, where fewer were asked for than an equilibrium was found on."""
    return ": take more" if mesh.elements < source.solved.model.mesh.elements else ""


def _with_coarse_moments(now: EquilibriumResult, finer: EquilibriumResult) -> EquilibriumResult:
    """The same, with a note where section moments are far from those on twice the elements, wherever positions are."""
    most = apart = 0.0
    for name, cuts in now.solved.model.mesh.cuts.items():
        middles = 0.5 * (cuts[1:] + cuts[:-1])
        coarse, fine = (side.solved.fields.along(name, middles)["moment"] for side in (now, finer))
        most = max(most, float(np.linalg.norm(fine, axis=1).max(initial=0.0)))
        apart = max(apart, float(np.linalg.norm(fine - coarse, axis=1).max(initial=0.0)))
    if apart <= COARSE * most:
        return now
    share = f"by {100.0 * apart / most:.0f} % of the largest" if most > 0.0 else "from none"
    return replace(
        now, notes=(*now.notes, f"section moments differ {share} from those on twice the elements asked for")
    )


def _refuse_many_turns(found: Solved) -> None:
    """Refuse angles that count so many turns that rounding leaves little of where they point.

    Raises
    ------
    SolveError
        Says how far.
    """
    state = found.state
    turned = np.abs(np.append(state.unwrapped, 0.0) if found.model.space else state.q).max(initial=0.0)
    if turned > MOST_TURNED:
        detail = f"something turns by {turned:.1e} rad, of which rounding leaves no angle: next to nothing resists it"
        raise SolveError(Status.FAILED, detail, state)


def _refuse_free(found: Solved) -> None:
    """Refuse a mechanism of which neither stiffness nor loads hold some motion.

    Raises
    ------
    SceneError
        Names the motion.
    """
    # What rounding hides may be held or free: a note says so.
    if not found.neutral or found.stability.hidden or not found.prepared.diagnosis.mobility:
        return
    stability = found.stability
    equations, shape = found.equations, np.concatenate([stability.shape, stability.travel])
    inside = (equations.row < equations.unknowns) & (equations.column < equations.unknowns)
    row, column, entries = equations.row[inside], equations.column[inside], found.point.entries[inside]
    size = float(np.append(equations.mass, np.full(len(stability.travel), LIGHT)) @ shape**2)
    if (
        stability.smallest
        > RESISTED * found.prepared.softest + float(blurred(row, column, entries, shape[:, None])[0]) / size
    ):
        return
    if moves_nodes(equations, shape, found.state):
        raise SceneError(free_to_move(in_words(equations, shape)))


def _with_unique_reactions(found: EquilibriumResult) -> EquilibriumResult:
    """The same, with the smallest reactions and a note where closings are redundant.

    Raises
    ------
    SolveError
        Members stretched between held points: no finite reaction holds an inextensible member straight.
    """
    solved, equations, loading = found.solved, found.solved.equations, found.solved.loading
    loose = loose_rows(equations, solved.point)
    if not loose.size:
        message = stretched(equations, solved.point) if solved.multipliers > LARGE else ""
        if message:
            raise SolveError(Status.STRETCHED, message, solved.state)
        return found
    state = shared(equations, solved.state, loading, loose, reactions=True)
    point = equations.at(state, loading)
    residual = relative_residual(equations, point)
    note = SHARED if stretches(equations, state, loading, loose) else SMALLEST
    # Springs and motions act as loads do: beside all that does, and what was left before, loose rows carry nothing.
    acting, left = (p[: equations.unknowns] for p in (point.scale - equations.noise, solved.point.residual))
    carried = np.abs(point.residual[: equations.unknowns] - left).max(initial=0.0)
    needed = carried > LOOSE * acting.max(initial=LEAST_SCALE) and carried > np.abs(left).max(initial=0.0)
    if residual <= tolerances.BALANCED and not needed:
        solved = replace(solved, state=state, known=point, residual=residual)
    elif solved.multipliers > BEYOND or needed:
        raise SolveError(Status.STRETCHED, stretched(equations, solved.point, loose), solved.state)
    else:
        # Where straight bars are all that acts, rounding of large multipliers is much beside what is in balance.
        note = "reactions are not unique, one set of many is given"
    note += f"; redundant: {named_in(equations, loose)}"
    return found.onto(solved, notes=(*found.notes, note))
