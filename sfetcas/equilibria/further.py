"""All equilibria of a load step: what a scan or a search finds on one mesh, refined as the answer itself is."""

from __future__ import annotations

from dataclasses import replace

from ..description.records import counted
from ..errors import SceneError, SolveError
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.model import Model
from .meshing import EquilibriumResult, Meshing
from .quantities import WHERE
from .refinement import LEVELS, Refinement
from .scanning import Scan, scan
from .several import Search, long_elements, same, search
from .solution import Equilibrium

__all__ = ["FurtherEquilibria", "refuse_unsearched"]

FINER = 2
"""How often the mesh of a scan is halved, at most, where it lacks equilibria that the scan counted."""


class FurtherEquilibria:
    """The search for all equilibria of the load steps of a scene.

    Parameters
    ----------
    meshes, refinement
        Of the scene; they also make the answers that the search begins from.
    model : Model
        On the pilot mesh.

    Raises
    ------
    SceneError
        The energy, by which equilibria are sorted and told apart, is not defined or not evaluated.
    """

    def __init__(self, meshes: Meshing, refinement: Refinement, model: Model) -> None:
        self.meshes, self.refinement = meshes, refinement
        self.others: list[tuple[Model, State]] = []
        refuse_unsearched(meshes, model)

    def answers(self, found: EquilibriumResult, answer: Equilibrium) -> list[Equilibrium]:
        """The answer with a note about the search, then the further equilibria of its load factor by rising energy."""
        result = self._searched(found)
        answers, dropped = [replace(answer, notes=(*answer.notes, *result.family_note(0)))], 0
        for number, solved in enumerate(result.found[1:], start=1):
            notes = result.family_note(number)
            further = self._further(EquilibriumResult(solved, notes=notes, kept=True, way=("search",)))
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

    def _further(self, candidate: EquilibriumResult) -> Equilibrium | None:
        """The answer to what a search found; None where finer meshes do not have it."""
        try:
            answer = self.refinement.refined(candidate)
        except SolveError:
            return None
        short = (answer.certificate.error_estimate or 0.0) > self.meshes.accuracy
        return None if short and not self.meshes.prescribed else answer

    def _searched(self, found: EquilibriumResult) -> Search | Scan:
        """The scan or, where one number does not give all equilibria, the search.

        On a mesh fine enough for what is strongly curled, but for elements that are prescribed.
        """
        first = found
        if not self.meshes.prescribed:
            first = self.refinement.onto(self.refinement.halved(found), found)
        elif self.meshes.pilot_mesh is not self.meshes.target:
            first = self.refinement.onto(found.solved.model.mesh.refined(), found)
        for _ in range(LEVELS if first is not found else 0):
            long = long_elements(first.solved)
            marks = {name: marked & (name not in self.meshes.fixed) for name, marked in long.items()}
            if not any(marked.any() for marked in marks.values()):
                break
            first = self.refinement.onto(first.solved.model.mesh.refined(marks), first)
        begin = first.solved
        starts = [transferred(model, state, begin.model) for model, state in self.others]
        # Whoever gives the number of runs wants the search.
        scanned = scan(begin) if self.meshes.settings.runs is None else None
        for _ in range(0 if self.meshes.prescribed else FINER):
            if scanned is None or len(scanned.found) >= scanned.roots:
                break
            first = self.refinement.onto(self.refinement.halved(first), first)
            again = scan(first.solved)
            if again is None or len(again.found) <= len(scanned.found):
                break
            scanned = again
        result = scanned or search(begin, starts, self.meshes.settings.runs)
        self.others = [(other.model, other.state) for other in result.found]
        return result


def refuse_unsearched(meshes: Meshing, model: Model) -> None:
    """Refuse to search under loads whose energy is not there, or not known, or to the accuracy of a quantity.

    Raises
    ------
    SceneError
        Such loads, or such an accuracy.
    """
    if meshes.quantity is not None:
        why = "equilibria are told apart by the error of their positions"
        raise SceneError(f"found {meshes.quantity.text!r}, accepted with all equilibria: none, as {why}", WHERE)
    if model.has_potential:
        return
    why = "loads without potential have no energy to search by"
    if model.conservative:
        why = "the energy of pressure, by which equilibria are sorted and told apart, is not evaluated"
    raise SceneError(f"found 'all', accepted: 'one', as {why}", ("analysis", "equilibria"))
