"""An equilibrium solver ready to be written as C: its functions, tables and what they mean."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium
from ..equilibria.statics import solve
from ..errors import SceneError, SolveError
from ..mathematics.arrays import Array
from ..mechanics.accuracy import every_other
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model, assemble
from ..solvers.globalised import Code, Globalised, Outcome, Rules
from ..solvers.prepared import Prepared
from .arguments import Arguments, Asked, asked_for
from .results import Results, default_results

__all__ = ["EquilibriumSolver", "Place", "asked_mesh", "chosen_places", "equilibrium_solver", "refuse_search"]

Place = Mapping[str, Sequence[float]]
"""Fractions of the length of members."""

USUAL_PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where members are told of without a word about it."""


@dataclass(frozen=True, eq=False)
class EquilibriumSolver:
    """The solver of one scene on one mesh; every function of it is CasADi's, in process as in C.

    Attributes
    ----------
    name : str
        Beginning of all names in C.
    scene : Scene
    arguments : Arguments
    results : Results
    rules : Rules
    start : ndarray or None
        State that a cold solve begins with; None for the undeformed one.
    answer : Equilibrium
        That of statics for the last step of the scene, on a finer mesh: what the accuracy was checked by.
    """

    name: str
    scene: Scene
    arguments: Arguments
    results: Results
    rules: Rules
    start: Array | None
    answer: Equilibrium

    @property
    def model(self) -> Model:
        """The model, at values of the arguments where nothing vanishes by chance."""
        return self.arguments.model

    @functools.cached_property
    def method(self) -> Globalised:
        """The algorithm."""
        return Globalised(self.arguments.program, Prepared(self.model).weight, self.rules)

    @functools.cached_property
    def prepare(self) -> ca.Function:
        """(arguments) -> given."""
        return self.arguments.prepare(f"{self.name}_prepare")

    @functools.cached_property
    def tell(self) -> ca.Function:
        """(arguments, state, given) -> results."""
        program = self.arguments.program
        p = ca.MX.sym("arguments", len(self.arguments.defaults))
        told = self.results.expression(program, self.arguments.undeformed(p))
        names = ["arguments", "state", "given"]
        symbols = [p, program.state_symbol, program.symbol]
        return ca.Function(f"{self.name}_results", symbols, [ca.densify(told)], names, ["results"])

    @functools.cached_property
    def sensitivities(self) -> ca.Function:
        """(arguments, state, given) -> derivatives of all results by all arguments, (results, arguments).

        By the implicit function theorem: what the state does is the solution of one linear system for each argument.
        """
        program = self.arguments.program
        p, state, given = ca.MX.sym("arguments", len(self.arguments.defaults)), program.state_symbol, program.symbol
        told = self.results.expression(program, self.arguments.undeformed(p))
        # Along the arguments only: whole derivatives by states would be a hundred times the code.
        given_by_p = ca.densify(ca.jacobian(self.arguments.given(p), p))
        residual = program.stationarity.residual
        # What motions prescribe turns held nodes, too.
        held_by_p = ca.densify(ca.jtimes(program.held_expression, given, given_by_p))
        out = ca.jtimes(residual, given, given_by_p) + ca.jtimes(residual, state, held_by_p)
        step = -ca.solve(program.matrix, ca.densify(out), "qr", {"eps": 1e-300})
        changed = ca.densify(held_by_p + ca.mtimes(program.moving, step))
        found = ca.jacobian(told, p) + ca.jtimes(told, given, given_by_p) + ca.jtimes(told, state, changed)
        names = ["arguments", "state", "given"]
        flat = ca.vec(ca.densify(found).T)
        return ca.Function(f"{self.name}_sensitivity", [p, state, given], [flat], names, ["sensitivities"])

    def solve(self, arguments: Array | None = None, start: Array | None = None) -> tuple[Outcome, Array]:
        """The equilibrium for values of the arguments, and the results: not a number where there is none.

        Parameters
        ----------
        arguments : (numbers,), the defaults without
        start : state to begin with, for a warm start
        """
        p = self.arguments.defaults if arguments is None else np.asarray(arguments, dtype=float)
        given = np.array(self.prepare(p)).ravel()
        good = self.arguments.accepted(p)
        outcome = self.method(given if good else given * np.nan, self.start if start is None else start)
        nothing = np.full(self.results.size, np.nan)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return outcome, nothing
        try:
            told = np.array(self.tell(p, outcome.state, given)).ravel()
        except RuntimeError:
            # A stiffness of what is singular.
            told = nothing
        return (outcome, told) if np.isfinite(told).all() else (replace(outcome, code=Code.NOT_FINITE), nothing)

    @property
    def unique(self) -> bool:
        """Whether reactions and section forces are: not where closings depend on each other."""
        return not any(note.startswith(NOT_UNIQUE) for note in self.answer.notes)

    def with_results(self, names: Sequence[str]) -> EquilibriumSolver:
        """The same solver with other results."""
        told = Results(self.model, names, self.results.places, unique=self.unique)
        return replace(self, results=told)

    def by_name(self, results: Array) -> dict[str, Array]:
        """The results by their names, in their shapes."""
        bounds = np.cumsum([0, *(result.size for result in self.results.results)]).tolist()
        parts = zip(self.results.results, bounds, bounds[1:], strict=False)
        return {one.name: results[a:b].reshape(one.shape) for one, a, b in parts}


def equilibrium_solver(
    scene: Scene,
    name: str,
    *,
    arguments: Asked = None,
    results: Sequence[str] | None = None,
    places: Place | None = None,
    settings: Settings | None = None,
) -> EquilibriumSolver:
    """The solver of a scene, on the mesh that its accuracy asks for.

    Parameters
    ----------
    scene : Scene
    name : str
        Beginning of all names in C.
    arguments : names of numbers of the scene, or a mapping of them to ranges; the usual ones without
    results : names of results; the usual ones without
    places : fractions of the length at which members are told of
    settings : as of :func:`~sfetcas.equilibria.statics.solve`

    Raises
    ------
    SceneError
        A scene that cannot be exported, a number or a result that it does not have.
    """
    refuse_search(scene)
    if scene.analysis.type == "modes":
        message = "found 'modes', accepted: static or path, whose equilibria are exported, or dynamic"
        raise SceneError(message, ("analysis", "type"))
    mesh, assembly, answer = asked_mesh(scene, settings or Settings())
    base = assemble(scene, mesh, assembly=assembly)
    prepared = Prepared(base)
    members = [n for n, member in scene.members.items() if member.type == "flexible"]
    unique = not any(note.startswith(NOT_UNIQUE) for note in answer.notes)
    names = results or default_results(base, unique=unique)
    told = Results(base, names, chosen_places(members, places or {}), unique=unique)
    known = Arguments(scene, base, asked_for(scene, arguments), told, f"{name}_")
    start = None
    if prepared.lacks_slack or any(node.start is not None for node in scene.nodes.values()):
        # Straight members without slack bend to no side by themselves; a start chooses one.
        start = known.program.flat(prepared.guess(base.loading(scene.analysis.steps[-1]))[0])
    rules = Rules() if scene.analysis.unstable == "leave" else replace(Rules(), escapes=0)
    solver = EquilibriumSolver(name, scene, known, told, rules, start, answer)
    return solver if start is not None or _same(solver) else replace(solver, start=_answered(solver))


def _answered(solver: EquilibriumSolver) -> Array:
    """The answer of statics as a state to begin with."""
    return solver.arguments.program.flat(transferred(solver.answer.model, solver.answer.state, solver.model))


def _same(solver: EquilibriumSolver) -> bool:
    """Whether a cold solve of the defaults leads to the answer of statics, on another mesh or not."""
    outcome, _ = solver.solve()
    if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
        return False
    found, wanted = (solver.arguments.program.state(flat) for flat in (outcome.state, _answered(solver)))
    return Prepared(solver.model).distance(found, wanted) < ELSEWHERE


ELSEWHERE = 0.05
"""Rotations that differ by more, rad, are those of another equilibrium: meshes differ by less."""

NOT_UNIQUE = "reactions are not unique"
"""How a note of statics begins where closings depend on each other."""


def refuse_search(scene: Scene, lacking: str = "not exported") -> None:
    """Refuse what takes a search that is not exported, or is ``lacking`` otherwise.

    Raises
    ------
    SceneError
        Says what, and what is possible instead.
    """
    instead = "accepted: the scene without"
    if scene.contacts:
        raise SceneError(f"contact is found by a search that is {lacking}, {instead}", ("contacts",))
    for name, spring in scene.springs.items():
        if spring.stop is not None:
            message = f"which stops act is found by a search that is {lacking}, {instead}"
            raise SceneError(message, ("springs", name, "stop"))
    if scene.rotating is not None:
        raise SceneError(f"turning axes are {lacking}, {instead}", ("rotating",))


def asked_mesh(scene: Scene, settings: Settings) -> tuple[Mesh, Any, Equilibrium]:
    """The mesh that the accuracy asks for, the assembly, and the answer of statics."""
    static = scene.analysis.model_copy(update={"type": "static", "equilibria": "one"})
    still = scene.model_copy(update={"analysis": static})
    try:
        solution = solve(still, settings)
    except SolveError as error:
        raise SceneError(f"the scene itself has no equilibrium: {error}, accepted: one that has") from None
    model = max((step.model for step in solution.steps), key=lambda one: one.mesh.elements)
    asked = [settings.elements or member.elements for member in scene.members.values() if member.type == "flexible"]
    mesh = model.mesh
    halved = max(step.certificate.halved or 0.0 for step in solution.steps)
    if not any(asked) and halved <= (settings.accuracy or scene.analysis.accuracy):
        # Half the elements are as near as was asked for.
        flexible = [n for n, member in scene.members.items() if member.type == "flexible"]
        mesh = replace(mesh, cuts={n: every_other(c) if n in flexible else c for n, c in mesh.cuts.items()})
    return mesh, model.assembly, solution.last


def chosen_places(members: Sequence[str], given: Place) -> dict[str, tuple[float, ...]]:
    """Where each member is told of.

    Raises
    ------
    SceneError
        A place that is none, or of what is no flexible member.
    """
    for name, places in given.items():
        if name not in members:
            raise SceneError(f"found {name!r}, accepted: a flexible member", ("places",))
        outside = [x for x in places if not 0.0 <= x <= 1.0]
        if outside or not places:
            raise SceneError(f"found {outside or 'none'}, accepted: fractions from 0 to 1", ("places", name))
    return {name: tuple(given.get(name, USUAL_PLACES)) for name in members}
