"""Static equilibria of a scene: from the undeformed state, in one go, to the accuracy asked for.

1. A coarse *pilot* mesh: IPOPT from a start guess at the full load, then Newton's method to rounding.
2. The branch is checked by following the loads from zero on the pilot (see :mod:`~sfetcas.solvers.continuation`), and
   an unstable equilibrium is left along its unstable mode.
3. The mesh is refined where the solution is not smooth enough; Newton's method goes on from the coarser state.
4. All elements are halved once more: the difference is the estimate of the error, the halved mesh the answer.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from ..description.scene import Scene
from ..errors import SolveError, Status
from ..mathematics.threads import single_threaded
from ..mechanics.mesh import Mesh
from ..solvers.prepared import Prepared
from ..solvers.unrestrained import refuse_unrestrained
from .meshing import EquilibriumResult, Meshing
from .refinement import Refinement
from .settings import Settings, settings_with
from .single import solve_model
from .solution import Equilibrium, Solution, at_factor, refuse_large
from .ways import Ways

if TYPE_CHECKING:
    from .further import FurtherEquilibria
    from .member_contact_steps import MemberContactSteps
    from .several_in_contact import SeveralInContact

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

    Examples
    --------
    >>> scene = load("problems/cantilever_tip_force.toml")      # doctest: +SKIP
    >>> solve(scene).last.position("tip")                       # doctest: +SKIP
    """
    settings = settings_with(settings, changes)
    if scene.inserts:
        from .insertion_steps import InsertionSteps

        return InsertionSteps(scene, settings).solution()
    return LoadSteps(scene, settings, stops).solution()


def pilot_of(scene: Scene, settings: Settings | None = None) -> Mesh:
    """The mesh of :func:`solve` before any refinement: chosen by the library, or prescribed."""
    return Meshing(scene, settings or Settings()).target


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
        if self.scene.remembers:
            return self._remembered(begin)
        pilot = self.meshes.prepared(self.meshes.pilot_mesh)
        if self.scene.rubs:
            return self._rubbed(pilot, begin)
        further, contact = self._further(pilot), self._contact()
        touching = self._several_in_contact(pilot)
        steps: list[Equilibrium] = []
        last: tuple[float, EquilibriumResult] | None = None
        for factor in self.scene.analysis.steps:
            refuse_unrestrained(pilot, factor)
            try:
                if contact is not None:
                    steps.append(contact.answer(pilot, factor))
                    if touching is not None:
                        steps[-1:] = touching.answers(steps[-1], contact.run)
                    continue
                found = self.ways.result(pilot, factor, last)
                last = (factor, found) if found.solved.prepared is pilot else None
                refined = self.refinement.refined(found)
                if self.scene.limited:
                    refuse_large(refined.fields)
                steps.append(refined)
                if further is not None:
                    steps[-1:] = further.answers(found, steps[-1])
            except SolveError as error:
                self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
                raise at_factor(self.ways.named(pilot, error), self.scene, factor, steps, self.meshes.seconds) from None
        return self._solved(steps, begin)

    def _solved(self, steps: list[Equilibrium], begin: float) -> Solution:
        self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
        reached = all((step.certificate.error_estimate or 0.0) <= self.meshes.accuracy for step in steps)
        status = Status.SOLVED if reached or not self.meshes.asked else Status.SHORT
        return Solution(self.scene, status, tuple(steps), self.meshes.seconds)

    def _rubbed(self, pilot: Prepared, begin: float) -> Solution:
        """The load steps where there is friction."""
        from .rough_contact_steps import RoughContactSteps

        sequence = RoughContactSteps(self.meshes)
        try:
            return self._solved(sequence.answers(pilot), begin)
        except SolveError as error:
            self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
            raise at_factor(error, self.scene, *sequence.failed, self.meshes.seconds) from None

    def _remembered(self, begin: float) -> Solution:
        """The load steps where laws have memory."""
        from .memory_steps import MemorySteps

        sequence = MemorySteps(self.meshes, self.ways, self.refinement)
        try:
            return self._solved(sequence.answers(), begin)
        except SolveError as error:
            self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
            raise at_factor(error, self.scene, sequence.failed[0], (), self.meshes.seconds) from None

    # Most scenes need neither of these: what they import would take longer than a small scene does.

    def _further(self, pilot: Prepared) -> FurtherEquilibria | None:
        """The search for all equilibria, where the scene asks for it."""
        if self.scene.analysis.equilibria != "all" or self.scene.contacts:
            return None
        from .further import FurtherEquilibria

        return FurtherEquilibria(self.meshes, self.refinement, pilot.model)

    def _contact(self) -> MemberContactSteps | None:
        """The load steps of a scene with obstacles, or in which members touch each other."""
        if not self.scene.contacts:
            return None
        from .member_contact_steps import MemberContactSteps

        return MemberContactSteps(self.meshes, self.ways, self.refinement)

    def _several_in_contact(self, pilot: Prepared) -> SeveralInContact | None:
        """The search for all equilibria of a scene with contact, where it asks for it."""
        if self.scene.analysis.equilibria != "all" or not self.scene.contacts:
            return None
        from .several_in_contact import SeveralInContact

        return SeveralInContact(self.meshes, self.ways, self.refinement, pilot.model)
