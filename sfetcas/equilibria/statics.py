"""Static equilibria of a scene: from the undeformed state, in one go, to the accuracy asked for.

1. A coarse *pilot* mesh: IPOPT from a start guess at the full load, then Newton's method to rounding.
2. The branch is checked by following the loads from zero on the pilot (see :mod:`~sfetcas.solvers.continuation`), and
   an unstable equilibrium is left along its unstable mode.
3. The mesh is refined where the solution is not smooth enough; Newton's method goes on from the coarser state.
4. All elements are halved once more: the difference is the estimate of the error, the halved mesh the answer.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from ..contact.contact_balance import refuse_lost_forces, refuse_unbalanced
from ..contact.contact_statics import ContactRun, Pressed
from ..contact.settling import Held
from ..contact.touches import Touched
from ..description.records import counted
from ..description.scene import Scene
from ..errors import SceneError, SolveError, Status
from ..mathematics.threads import single_threaded
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model
from ..solvers.prepared import Prepared
from ..solvers.unsupported import refuse_unsupported
from .meshing import EquilibriumResult, Meshing
from .quantities import WHERE
from .refinement import LEVELS, Refinement
from .scanning import Scan, scan
from .settings import Settings
from .several import Search, long_elements, same, search
from .single import finished, solve_model, unjudged
from .solution import Equilibrium, Solution, at_factor, refuse_large
from .ways import NO_ENERGY, Ways

__all__ = ["LoadSteps", "Settings", "pilot_of", "solve", "solve_model"]


@single_threaded
def solve(
    scene: Scene, settings: Settings | None = None, *, stops: tuple[tuple[str, str], ...] = (), **changes: Any
) -> Solution:
    """Static analysis: equilibria of a scene for the load factors ``analysis.steps``.

    Parameters
    ----------
    scene : Scene
    settings : Settings, optional
        Further keywords replace single settings: ``solve(scene, accuracy=1e-8)``.
    stops : tuple of (str, str)
        Springs held at a stop: name, and ``low`` or ``high``; stops of other springs are ignored.  Which stops act is
        found by :mod:`~sfetcas.equilibria.stops`.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        A factor has no equilibrium that could be found; the sentence says why.

    Example
    -------
    >>> scene = load("problems/cantilever_tip_force.toml")      # doctest: +SKIP
    >>> solve(scene).last.position("tip")                       # doctest: +SKIP
    """
    settings = replace(settings or Settings(), **changes)
    return LoadSteps(scene, settings, stops).solution()


def pilot_of(scene: Scene, settings: Settings | None = None) -> Mesh:
    """The mesh of :func:`solve` before any refinement: chosen by the library, or prescribed."""
    return Meshing(scene, settings or Settings()).target


FINER = 2
"""How often the mesh of a scan is halved, at most, where it lacks equilibria that the scan counted."""


class LoadSteps:
    """The static analysis of a scene: its equilibria at the load factors of ``analysis.steps``, one after the other.

    Parameters
    ----------
    scene, settings, stops
        As of :func:`solve`.
    """

    def __init__(self, scene: Scene, settings: Settings, stops: tuple[tuple[str, str], ...] = ()) -> None:
        self.scene, self.meshes = scene, Meshing(scene, settings, stops)
        self.ways, self.refinement = Ways(self.meshes), Refinement(self.meshes)
        self.others: list[tuple[Model, State]] = []

    def solution(self) -> Solution:
        """Solve all load steps.

        Raises
        ------
        SceneError
            A search for all equilibria is asked for and the energy is not defined, or not evaluated.
        SolveError
            A load step has no equilibrium that could be found; its ``reached`` has the steps before.
        """
        begin = time.perf_counter()
        pilot = self.meshes.prepared(self.meshes.pilot_mesh)
        if self.scene.analysis.equilibria == "all":
            self._refuse_all(pilot.model)
        steps: list[Equilibrium] = []
        last: tuple[float, EquilibriumResult] | None = None
        contact = None
        if self.scene.contacts:
            contact = ContactRun(
                self.scene,
                self.meshes.prepared,
                self.meshes.accuracy,
                self.meshes.fixed,
                self._judged_in_contact,
            )
        for factor in self.scene.analysis.steps:
            refuse_unsupported(pilot, factor)
            try:
                if contact is not None:
                    contact.refuse_held_inside(pilot, factor)
                    steps.append(self._in_contact(contact, pilot, factor))
                    continue
                found = self.ways.result(pilot, factor, last)
                last = (factor, found) if found.prepared is pilot else None
                steps.append(self.refinement.refined(found, factor))
                if self.scene.analysis.equilibria == "all":
                    steps[-1:] = self._several(found, steps[-1], factor)
            except SolveError as error:
                self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
                raise at_factor(self.ways.named(pilot, error), self.scene, factor, steps, self.meshes.seconds) from None
        self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
        reached = all((step.certificate.error_estimate or 0.0) <= self.meshes.accuracy for step in steps)
        status = Status.SOLVED if reached or not self.meshes.asked else Status.SHORT
        return Solution(self.scene, status, tuple(steps), self.meshes.seconds)

    # -- several equilibria ---------------------------------------------------------------------

    def _several(self, found: EquilibriumResult, answer: Equilibrium, factor: float) -> list[Equilibrium]:
        """The answer, which tells of the search, then further equilibria of the same factor with rising energy."""
        result = self._searched(found, factor)
        answers, dropped = [replace(answer, notes=(*answer.notes, *result.family_note(0)))], 0
        for number, corrected in enumerate(result.found[1:], start=1):
            stability = result.prepared.stability(corrected)
            notes = result.family_note(number)
            candidate = EquilibriumResult(result.prepared, corrected, stability, notes, kept=True, way=("search",))
            further = self._further(candidate, factor)
            if further is None:
                dropped += 1
            elif not any(same(further, other) for other in answers):
                answers.append(further)
        note = result.sentence() + result.missing(answers)
        if dropped:
            coarse = counted(dropped, "equilibrium", "equilibria")
            note += f"; {coarse} of the mesh of the search not found on finer ones"
        answers[0] = replace(answers[0], notes=(*answers[0].notes, note))
        return [answers[0], *sorted(answers[1:], key=lambda other: other.potential)]

    def _refuse_all(self, model: Model) -> None:
        """Refuse to search under loads whose energy is not there, or not known, or to the accuracy of a quantity.

        Raises
        ------
        SceneError
            Such loads, or such an accuracy.
        """
        if self.meshes.quantity is not None:
            why = "equilibria are told apart by the error of their positions"
            raise SceneError(
                f"found {self.meshes.quantity.text!r}, accepted with all equilibria: none, as {why}", WHERE
            )
        if model.has_potential:
            return
        why = "loads without potential have no energy to search by"
        if model.conservative:
            why = "the energy of pressure, by which equilibria are sorted and told apart, is not evaluated"
        raise SceneError(f"found 'all', accepted: 'one', as {why}", ("analysis", "equilibria"))

    def _further(self, candidate: EquilibriumResult, factor: float) -> Equilibrium | None:
        """The answer to what a search found; None where finer meshes do not have it."""
        try:
            answer = self.refinement.refined(candidate, factor)
        except SolveError:
            return None
        short = (answer.certificate.error_estimate or 0.0) > self.meshes.accuracy
        return None if short and not self.meshes.prescribed else answer

    def _searched(self, found: EquilibriumResult, factor: float) -> Search | Scan:
        """The scan or, where one number does not give all equilibria, the search.

        On a mesh fine enough for what is strongly curled, but for elements that are prescribed.
        """
        first = found
        if not self.meshes.prescribed:
            first = self.refinement.onto(self.refinement.halved(found), found, factor)
        elif self.meshes.pilot_mesh is not self.meshes.target:
            first = self.refinement.onto(found.prepared.model.mesh.refined(), found, factor)
        for _ in range(LEVELS if first is not found else 0):
            long = long_elements(first.prepared, first.prepared.model.loading(factor), first.corrected)
            marks = {name: marked & (name not in self.meshes.fixed) for name, marked in long.items()}
            if not any(marked.any() for marked in marks.values()):
                break
            first = self.refinement.onto(first.prepared.model.mesh.refined(marks), first, factor)
        prepared, loading = first.prepared, first.prepared.model.loading(factor)
        starts = [transferred(model, state, prepared.model) for model, state in self.others]
        # Whoever gives the number of runs wants the search.
        scanned = scan(prepared, loading, first.corrected) if self.meshes.settings.runs is None else None
        for _ in range(0 if self.meshes.prescribed else FINER):
            if scanned is None or len(scanned.found) >= scanned.roots:
                break
            first = self.refinement.onto(self.refinement.halved(first), first, factor)
            again = scan(first.prepared, first.prepared.model.loading(factor), first.corrected)
            if again is None or len(again.found) <= len(scanned.found):
                break
            scanned = again
        result = scanned or search(prepared, loading, first.corrected, starts, self.meshes.settings.runs)
        self.others = [(result.prepared.model, other.state) for other in result.found]
        return result

    # -- contact --------------------------------------------------------------------------------

    def _in_contact(self, contact: ContactRun, pilot: Prepared, factor: float) -> Equilibrium:
        """The answer where obstacles may stop members."""
        base = self.meshes.pilot_mesh.refined()
        notes: tuple[str, ...] = () if pilot.model.conservative else (NO_ENERGY,)
        falls = bool(pilot.diagnosis.mobility) and not contact.first_touches
        known = pilot.model.minimisable and not (pilot.diagnosis.mobility or pilot.lacks_slack)
        if known and not (self.ways.started or contact.last or contact.first_touches):
            found = self._clear_all_the_way(contact, pilot, factor)
            if found is not None:
                return found
        unstopped, failure = self._unstopped(pilot, factor) if self.ways.started else (None, None)
        free = None
        if unstopped is not None:
            there = self.refinement.onto(base, unstopped, factor)
            notes += there.notes
            free = _as_held(there, factor)
            if contact.reviser.wrong(free, contact.at(factor)) is None:
                answer = self.refinement.refined(replace(unstopped, way=("no contact",)), factor)
                if contact.clear(answer.fields):
                    contact.last = (factor, free)
                    return answer
        ways = contact.reached(base, factor, free, falls=falls)
        return self._first_pressed(contact, ways, factor, notes, failure)

    def _clear_all_the_way(self, contact: ContactRun, pilot: Prepared, factor: float) -> Equilibrium | None:
        """The answer without obstacles, where the growing loads lead there past none of them; else None."""
        try:
            found = self.ways.grown_from_zero(pilot, factor, contact.unstopped(pilot))
        except SolveError as error:
            if error.status is Status.BENT:
                raise
            found = None
        if found is None or (self.meshes.switch_branch and found.stability.negative > 0):
            return None
        answer = self.refinement.refined(replace(found, way=("no contact",)), factor)
        return answer if contact.clear(answer.fields) else None

    def _first_pressed(
        self,
        contact: ContactRun,
        ways: Iterator[tuple[str, Held | None]],
        factor: float,
        notes: tuple[str, ...],
        failure: SolveError | None,
    ) -> Equilibrium:
        """The first stable answer among states in contact that were found in different ways; else the first."""
        refused: SolveError | None = None
        unstable: Equilibrium | None = None
        for way, held in ways:
            if held is None:
                continue
            try:
                pressed = contact.answered(held, factor, self.meshes.target, (*notes, *contact.jumped))
                answer = self._pressed(pressed, factor, (way,))
            except SolveError as error:
                refused = refused or error
                continue
            if not self.meshes.switch_branch or answer.certificate.negative == 0:
                return answer
            unstable = unstable or answer
        if unstable is not None:
            return unstable
        if refused is not None:
            raise refused
        contact.refuse_unsupported(self.meshes.prepared(self.meshes.pilot_mesh))
        detail = "no state in contact was found on the way of the loads from zero, on cushions, nor by obstacles coming"
        raise SolveError(Status.FAILED, f"{detail} back: {', '.join(contact.named(failure))}")

    def _judged_in_contact(self, coarse: Held, fine: Held, factor: float) -> tuple[float, float]:
        """How far two states in contact are apart, and the estimated error of the finer one."""
        one, other = (unjudged(held.prepared, held.corrected, held.loading, factor) for held in (coarse, fine))
        return self.meshes.judged(one, other)

    def _unstopped(self, pilot: Prepared, factor: float) -> tuple[EquilibriumResult | None, SolveError | None]:
        """The answer as if there were no obstacles; None where nothing else holds the structure."""
        try:
            return self.ways.on_pilot(pilot, factor, None), None
        except SolveError as error:
            return None, error

    def _pressed(self, found: Pressed, factor: float, way: tuple[str, ...]) -> Equilibrium:
        held = found.held
        refuse_unbalanced(held.touched.fields)
        refuse_large(held.touched.fields)
        answer = finished(
            held.prepared,
            held.corrected,
            held.loading,
            factor,
            found.stability,
            estimate=found.error,
            error_of=self.meshes.error_of,
            notes=found.notes,
            way=way,
        )
        refuse_lost_forces(held.touched.fields, [answer.contacts[name]["force"] for name in self.scene.contacts])
        return answer


def _as_held(found: EquilibriumResult, factor: float) -> Held:
    """An equilibrium without contact as one that may begin it."""
    loading = found.prepared.model.loading(factor)
    touched = Touched(found.prepared.equations, found.corrected.state, loading)
    return Held(found.prepared, found.corrected, loading, touched)
