"""Load steps of scenes with obstacles: the ways to a state in contact, in their order, and the answers they give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ..contact.contact_balance import refuse_unbalanced
from ..contact.contact_statics import ContactRun, Pressed
from ..contact.held_inside import refuse_held_inside
from ..contact.settling import Held
from ..errors import LIMITS, SolveError, Status
from ..solvers.prepared import Prepared
from .force_balance import refuse_lost_forces
from .meshing import EquilibriumResult, Meshing
from .refinement import Refinement
from .single import finished, unjudged
from .solution import Equilibrium, refuse_large
from .ways import NO_ENERGY, Ways

__all__ = ["ContactSteps"]


class ContactSteps:
    """The load steps of a scene with obstacles, one after the other.

    Parameters
    ----------
    meshes, ways, refinement
        Of the scene, see :class:`~sfetcas.equilibria.statics.LoadSteps`.
    """

    def __init__(self, meshes: Meshing, ways: Ways, refinement: Refinement) -> None:
        self.meshes, self.ways, self.refinement, self.scene = meshes, ways, refinement, meshes.scene
        self.run = ContactRun(self.scene, meshes.prepared, meshes.accuracy, meshes.fixed, self._judged)

    def answer(self, pilot: Prepared, factor: float) -> Equilibrium:
        """The equilibrium at a load factor, in contact where obstacles stop members.

        Raises
        ------
        SceneError, SolveError
            A held node is inside an obstacle; no equilibrium was found.
        """
        refuse_held_inside(self.scene, pilot, factor)
        return self._answer(pilot, factor)

    def _answer(self, pilot: Prepared, factor: float) -> Equilibrium:
        contact = self.run
        base = self.meshes.pilot_mesh.refined()
        notes: tuple[str, ...] = () if pilot.model.conservative else (NO_ENERGY,)
        # Without an energy nothing can be let fall: then growing loads are the way of mechanisms too.
        falls = bool(pilot.diagnosis.mobility) and pilot.model.minimisable and not contact.first_touches
        known = not pilot.model.minimisable or not (pilot.diagnosis.mobility or pilot.lacks_slack)
        if known and not (self.ways.started or contact.last or contact.first_touches):
            found = self._clear_all_the_way(pilot, factor)
            if found is not None:
                return found
        unstopped, failure = self._unstopped(pilot, factor) if self.ways.started else (None, None)
        free = None
        if unstopped is not None:
            there = self.refinement.onto(base, unstopped)
            notes += there.notes
            free = Held(there.solved)
            if contact.reviser.wrong(free, contact.at(factor)) is None:
                answer = self.refinement.refined(replace(unstopped, way=("no contact",)))
                if contact.clear(answer.fields):
                    contact.last = (factor, free)
                    return answer
        ways = contact.reached(base, factor, free, falls=falls)
        return self._first_pressed(ways, factor, notes, failure)

    def _clear_all_the_way(self, pilot: Prepared, factor: float) -> Equilibrium | None:
        """The answer without obstacles, where the growing loads lead there past none of them; else None."""
        try:
            found = self.ways.grown_from_zero(pilot, factor, self.run.unstopped)
        except SolveError as error:
            if error.status in LIMITS:
                raise
            found = None
        if found is None or (self.meshes.switch_branch and found.stability.negative > 0):
            return None
        answer = self.refinement.refined(replace(found, way=("no contact",)))
        return answer if self.run.clear(answer.fields) else None

    def _first_pressed(
        self,
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
                pressed = self.run.answered(held, factor, self.meshes.target, (*notes, *self.run.jumped))
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
        self.run.refuse_unrestrained(self.meshes.prepared(self.meshes.pilot_mesh))
        detail = "no state in contact was found on the way of the loads from zero, on cushions, nor by obstacles coming"
        raise SolveError(Status.FAILED, f"{detail} back: {', '.join(self.run.named(failure))}")

    def _judged(self, coarse: Held, fine: Held, factor: float) -> tuple[float, float]:
        """How far two states in contact are apart, and the estimated error of the finer one."""
        return self.meshes.judged(unjudged(coarse.corrected), unjudged(fine.corrected))

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
            held.corrected,
            found.stability,
            error_estimate=found.error,
            error_of=self.meshes.error_of,
            notes=found.notes,
            way=way,
        )
        refuse_lost_forces(answer)
        return answer
