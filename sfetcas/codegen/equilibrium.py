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
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model, assemble
from ..solvers.globalised import Code, Globalised, Outcome, Rules
from ..solvers.prepared import Prepared
from .arguments import Argument, Arguments, argument, default_arguments
from .results import Results, default_results

__all__ = ["EquilibriumSolver", "Place", "equilibrium_solver"]

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
        program, total = self.arguments.program, self.arguments.expressions.total
        p, state, given = ca.MX.sym("arguments", len(self.arguments.defaults)), program.state_symbol, program.symbol
        told = self.results.expression(program, self.arguments.undeformed(p))
        by_p, by_state, by_given = (ca.jacobian(told, x) for x in (p, state, given))
        given_by_p = ca.jacobian(self.arguments.given(p), p)
        held = ca.jacobian(program.held_expression, given)
        residual = program.stationarity.residual
        # What motions prescribe turns held nodes, too.
        out = ca.jacobian(residual, given) + ca.mtimes(ca.jacobian(residual, state), held)
        step = -ca.solve(program.matrix, ca.densify(ca.mtimes(out, given_by_p)), "qr", {"eps": 1e-300})
        moves = program.moving(total)
        changed = ca.mtimes(held, given_by_p) + ca.mtimes(moves, step)
        found = by_p + ca.mtimes(by_given, given_by_p) + ca.mtimes(by_state, changed)
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
        finite = bool(np.isfinite(p).all())
        outcome = self.method(given if finite else given * np.nan, self.start if start is None else start)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return outcome, np.full(self.results.size, np.nan)
        return outcome, np.array(self.tell(p, outcome.state, given)).ravel()

    def by_name(self, results: Array) -> dict[str, Array]:
        """The results by their names, in their shapes."""
        bounds = np.cumsum([0, *(result.size for result in self.results.results)]).tolist()
        parts = zip(self.results.results, bounds, bounds[1:], strict=False)
        return {one.name: results[a:b].reshape(one.shape) for one, a, b in parts}


def equilibrium_solver(
    scene: Scene,
    name: str,
    *,
    arguments: Sequence[str] | Mapping[str, tuple[float, float] | None] | None = None,
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
    _refuse(scene)
    mesh, assembly, answer = _mesh(scene, settings or Settings())
    base = assemble(scene, mesh, assembly=assembly)
    prepared = Prepared(base)
    members = [n for n, member in scene.members.items() if member.type == "flexible"]
    told = Results(base, results or default_results(base), _places(members, places or {}))
    chosen = arguments if arguments is not None else default_arguments(scene)
    spans = chosen if isinstance(chosen, Mapping) else dict.fromkeys(chosen)
    own: list[Argument] = [argument(scene, n, span) for n, span in spans.items()]
    known = Arguments(scene, base, own, told.rest, f"{name}_")
    start = None
    if prepared.lacks_slack or any(node.start is not None for node in scene.nodes.values()):
        # Straight members without slack bend to no side by themselves; a start chooses one.
        start = known.program.flat(prepared.guess(base.loading(scene.analysis.steps[-1]))[0])
    rules = Rules() if scene.analysis.unstable == "leave" else replace(Rules(), escapes=0)
    return EquilibriumSolver(name, scene, known, told, rules, start, answer)


def _refuse(scene: Scene) -> None:
    """Refuse what this solver does not hold.

    Raises
    ------
    SceneError
        Says what, and what can be exported instead.
    """
    instead = "accepted: the scene without"
    if scene.contacts:
        raise SceneError(f"contact is found by a search that is not exported, {instead}", ("contacts",))
    for name, spring in scene.springs.items():
        if spring.stop is not None:
            message = f"which stops act is found by a search that is not exported, {instead}"
            raise SceneError(message, ("springs", name, "stop"))
    if scene.rotating is not None:
        raise SceneError(f"turning axes are not exported, {instead}", ("rotating",))
    if scene.analysis.type == "modes":
        raise SceneError("found 'modes', accepted: static or path, whose equilibria are exported", ("analysis", "type"))


def _mesh(scene: Scene, settings: Settings) -> tuple[Mesh, Any, Equilibrium]:
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
    if not any(asked):
        # The answer of statics is on twice the elements that its accuracy asks for.
        flexible = [n for n, member in scene.members.items() if member.type == "flexible"]
        mesh = replace(mesh, cuts={n: every_other(c) if n in flexible else c for n, c in mesh.cuts.items()})
    return mesh, model.assembly, solution.last


def _places(members: Sequence[str], given: Place) -> dict[str, tuple[float, ...]]:
    for name, places in given.items():
        if name not in members:
            raise SceneError(f"found {name!r}, accepted: a flexible member", ("places",))
        outside = [x for x in places if not 0.0 <= x <= 1.0]
        if outside or not places:
            raise SceneError(f"found {outside or 'none'}, accepted: fractions from 0 to 1", ("places", name))
    return {name: tuple(given.get(name, USUAL_PLACES)) for name in members}
