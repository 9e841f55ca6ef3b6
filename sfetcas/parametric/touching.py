"""Equilibria as functions of parameters where members touch obstacles or each other.

With what touches an equilibrium is one of a model like any other.  For other numbers they are kept; then it is
looked whether they all push, and nothing else touches.  Where that is not so what touches is found anew, as statics
finds it for these numbers, and has a solver of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from ..contact.kept import Kept
from ..equilibria.settings import Settings
from ..equilibria.single import solved_from
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.fields import Fields
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from ..mechanics.unilateral import all_stops
from ..solvers.globalised import Outcome
from ..solvers.prepared import Prepared, Solved
from .arguments import Arguments
from .equilibrium import EquilibriumSolver, in_contact, kept_of, solved_steps, touching_mesh, what_touches
from .results import Results
from .switched import Switches

__all__ = ["Touching"]


@dataclass(frozen=True, eq=False)
class Touching:
    """The solvers of one scene, by what touches.

    Attributes
    ----------
    first : EquilibriumSolver
        That of the answer of statics.
    settings : Settings
    equilibria : dict
        What is kept of each solver by who asks for it.
    """

    first: EquilibriumSolver
    settings: Settings
    equilibria: dict[EquilibriumSolver, Any] = field(default_factory=dict)

    def kept(self, solver: EquilibriumSolver, numbers: Array, outcome: Outcome) -> Kept:
        """What touches at an equilibrium for numbers (numbers,)."""
        model, arguments = solver.model, solver.arguments
        scene = arguments.scene_at(numbers)
        mesh = arguments.mesh_at(scene, model.mesh, outcome.places)
        own = Prepared(assemble(scene, mesh, assembly=model.assembly, scales=model.scales))  # type: ignore[arg-type]
        loading, state = own.model.loading(scene.analysis.steps[-1]), arguments.program.equations.state(outcome.state)
        return kept_of(scene, self.settings, Solved.taken(own, state, loading))

    def may_stay(self, solver: EquilibriumSolver, numbers: Array, outcome: Outcome, start: Fields) -> bool:
        """Whether all that touches at an equilibrium pushes, nothing else touches, and from a state that is known
        no member has passed through anything on the straight way.
        """
        kept = self.kept(solver, numbers, outcome)
        return not any(kept.changed()) and not kept.run.passing.passed(start, kept.rest.fields)

    def refuse_doubt(self, solver: EquilibriumSolver, numbers: Array, outcome: Outcome) -> None:
        """Refuse derivatives where they differ to the sides of a change.

        Raises
        ------
        SolveError
            Something touches without a force; names it.
        """
        for what in self.kept(solver, numbers, outcome).undecided():
            raise SolveError(Status.KINK, f"{what}, and derivatives differ to either side")

    def anew(self, numbers: Array) -> tuple[EquilibriumSolver, Array]:
        """The solver of what touches as statics finds it for numbers (numbers,), and the state there (states,).

        Raises
        ------
        SolveError
            Statics finds no equilibrium, or one in which members lie along each other.
        """
        scene = self.first.arguments.scene_at(numbers)
        static = scene.analysis.model_copy(update={"type": "static", "equilibria": "one"})
        scene = scene.model_copy(update={"analysis": static})
        answer = solved_steps(scene, self.settings).last
        try:
            mesh = touching_mesh(scene, self.settings, answer, lines=True)
        except SceneError as error:
            raise SolveError(Status.FAILED, error.bare, answer.state) from None
        solver = self._solver(mesh)
        begun = in_contact(kept_of(scene, self.settings, solved_from(answer)), solver.model)
        return solver, begun.flat

    def forget_lines(self) -> None:
        """Forget the solvers of lines, which end elsewhere for each number, but for the first."""
        for solver in [one for one in self.equilibria if one.model.mesh.lies]:
            del self.equilibria[solver]

    def _solver(self, mesh: Mesh) -> EquilibriumSolver:
        """The solver in which the same touches, on whatever mesh."""
        for solver in (self.first, *self.equilibria):
            if not mesh.lies and what_touches(solver.model.mesh) == what_touches(mesh):
                return solver
        first = self.first
        switched = mesh if first.switches is None else replace(mesh, stops=all_stops(first.scene), switched=True)
        base = assemble(first.scene, switched, assembly=first.model.assembly, scales=first.model.scales)  # type: ignore[arg-type]
        names = [one.name for one in first.results.results]
        results = Results(base, names, first.results.places, unique=first.unique)
        arguments = Arguments(first.scene, base, first.arguments.arguments, results, f"{first.name}_", needed=False)
        switches = None if first.switches is None else Switches.of(arguments.program, mesh.stops)
        return replace(first, arguments=arguments, results=results, start=None, switches=switches)
