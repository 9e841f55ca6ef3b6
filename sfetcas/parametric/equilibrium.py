"""An equilibrium solver of CasADi functions, ready to be exported as C, with the meaning of its inputs and outputs."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..contact.kept import Kept
from ..description.scene import Scene, check_scene
from ..description.showing import shown
from ..equilibria.settings import Settings
from ..equilibria.single import solved_from
from ..equilibria.solution import Equilibrium, Solution
from ..equilibria.statics import solve
from ..equilibria.stops import followable, solve_stopped
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.kernels import Direct
from ..mechanics.contact_points import undeformed_vectors
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.inputs import Inputs
from ..mechanics.mesh import Mesh, every_other
from ..mechanics.model import Model, assemble
from ..mechanics.unilateral import all_stops
from ..paths.steps_along import steps_along
from ..solvers.globalised import MEANINGS, NOT_DEFINED, Code, Globalised, Outcome, Rules
from ..solvers.prepared import Prepared, Solved
from .arguments import Arguments, Asked, asked_for, in_words
from .results import Results, default_results
from .switched import Switches
from .watching import watched_of

__all__ = [
    "SOLVED",
    "EquilibriumSolver",
    "Place",
    "asked_mesh",
    "chosen_places",
    "equilibrium_solver",
    "in_contact",
    "kept_of",
    "refuse_search",
    "solved_steps",
    "touching_mesh",
    "what_touches",
]

Place = Mapping[str, Sequence[float]]
"""Fractions of the length of members."""

USUAL_PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Default fractions of the length at which results along members are given."""


@dataclass(frozen=True, eq=False)
class EquilibriumSolver:
    """The equilibrium solver of one scene on one mesh, made of CasADi functions that are the same in generated C.

    Arguments (numbers,) and results (results,) are flat arrays in the units of the scene; the state (states,) and the
    data and loads ``given`` are dimensionless.

    Attributes
    ----------
    name : str
        Prefix of all names in C.
    scene : Scene
    arguments : Arguments
    results : Results
    rules : Rules
        Settings of the algorithm.
    start : ndarray or None
        State from which a solve begins; None for the undeformed one.
    answer : Equilibrium
        The static answer for the last step of the scene on a finer mesh, by which the accuracy was checked.
    margins : Function or None
        Of a scene with contacts what is looked at, see :func:`~sfetcas.parametric.watching.watched_of`.
    switches : Switches or None
        Of a scene with stops or strings that may be slack, where it is found which of them act.
    begun : ndarray (numbers,) or None
        Where something touches the arguments of which ``start`` is the equilibrium.
    """

    name: str
    scene: Scene
    arguments: Arguments
    results: Results
    rules: Rules
    start: Array | None
    answer: Equilibrium
    margins: ca.Function | None = None
    switches: Switches | None = None
    begun: Array | None = None

    def __repr__(self) -> str:
        return shown(self, [self.name, self.model.size_in_words], in_words(self.arguments, self.results))

    @property
    def model(self) -> Model:
        """The model, assembled at values of the arguments at which no entry vanishes by chance."""
        return self.arguments.model

    @functools.cached_property
    def method(self) -> Globalised:
        """The globalised Newton method."""
        prepared = Prepared(self.model)
        inputs = Inputs(prepared.equations, self.arguments.program.varying)
        return Globalised(inputs, prepared.weight, self.rules, self.followed_from)

    @property
    def followed_from(self) -> tuple[Array, Array] | None:
        """The row of inputs at the start, and its state, where equilibria are not followed from zero."""
        if self.begun is None or self.start is None:
            return None
        given = self._called(self.prepare, np.append(self.begun, self.arguments.places))
        given = given if self.switches is None else self.switches.given(given, self.switches.default)
        return self._called(self.arguments.program.row, given), self.start

    @functools.cached_property
    def prepare(self) -> ca.Function:
        """``(arguments) -> given``: data and loads of the equations.

        Arguments are here and in other functions followed by the places where lines end.
        """
        return self.arguments.prepare(f"{self.name}_prepare")

    @functools.cached_property
    def output(self) -> ca.Function:
        """``(arguments, state, given) -> results``."""
        program = self.arguments.program
        p = ca.MX.sym("arguments", self.arguments.size)
        outputs = self.results.expression(program, self.arguments.undeformed(p))
        names = ["arguments", "state", "given"]
        symbols = [p, program.state_symbol, program.symbol]
        return ca.Function(f"{self.name}_results", symbols, [ca.densify(outputs)], names, ["results"])

    @functools.cached_property
    def error(self) -> ca.Function:
        """``(state, given) ->`` about the largest error of positions over the size of the scene.

        It is the square of the roughness of the elements: that of superconvergent elements is 1.5 to 15 times their
        error (measured for loads that bend members).  It does not see how data that vary along a member count where
        loads are small.  Not a number where there are tubes.
        """
        program = self.arguments.program
        error = ca.MX(np.nan) if self.scene.tubes else program.roughness**2
        names = ["state", "given"]
        symbols = [program.state_symbol, program.symbol]
        return ca.Function(f"{self.name}_error", symbols, [error], names, ["error"])

    @functools.cached_property
    def places(self) -> ca.Function:
        """``(arguments, state, given) ->`` where lines end (ends,), fractions of the lengths of their members."""
        program, p = self.arguments.program, ca.MX.sym("arguments", self.arguments.size)
        found = self.results.touches(program, self.arguments.undeformed(p), self.arguments.ends)
        symbols = [p, program.state_symbol, program.symbol]
        return ca.Function(f"{self.name}_places", symbols, [found], ["arguments", "state", "given"], ["places"])

    @functools.cached_property
    def sensitivities(self) -> ca.Function:
        """``(arguments, state, given) ->`` derivatives (results, arguments) of all results, flat row by row.

        By the implicit function theorem, with the solution of one linear system for each argument.
        """
        program, ends = self.arguments.program, self.arguments.ends
        p, state, given = ca.MX.sym("arguments", self.arguments.size), program.state_symbol, program.symbol
        undeformed = self.arguments.undeformed(p)
        outputs = ca.vertcat(
            self.results.expression(program, undeformed), self.results.touches(program, undeformed, ends)
        )
        # Along the arguments only: whole derivatives by states would be a hundred times the code.
        given_by_p = ca.densify(ca.jacobian(self.arguments.given(p), p))
        residual = program.stationarity.residual
        # What motions prescribe turns held nodes, too.
        held_by_p = ca.densify(ca.jtimes(program.prescribed_expression, given, given_by_p))
        out = ca.jtimes(residual, given, given_by_p) + ca.jtimes(residual, state, held_by_p)
        step = -ca.solve(program.matrix, ca.densify(out), "qr", {"eps": 1e-300})
        changed = ca.densify(held_by_p + ca.mtimes(program.moving, step))
        found = ca.jacobian(outputs, p) + ca.jtimes(outputs, given, given_by_p) + ca.jtimes(outputs, state, changed)
        if ends:
            # Lines end where elements do: c = s(p, c).
            n, count = self.results.size, len(self.arguments.defaults)
            of_ends = ca.solve(ca.DM.eye(len(ends)) - found[n:, count:], found[n:, :count], "qr", {"eps": 1e-300})
            found = found[:n, :count] + ca.mtimes(found[:n, count:], of_ends)
        names = ["arguments", "state", "given"]
        flat = ca.vec(ca.densify(found).T)
        return ca.Function(f"{self.name}_sensitivity", [p, state, given], [flat], names, ["sensitivities"])

    def solve(self, arguments: Array | None = None, start: Array | None = None) -> tuple[Outcome, Array]:
        """The equilibrium for values of the arguments, and its results (results,): nan where none was found.

        Parameters
        ----------
        arguments : (numbers,), by default those of the scene
        start : (states,), state to begin with, for a warm start

        Raises
        ------
        ValueError
            Arguments, or the start, have another shape.
        """
        defaults = self.arguments.defaults
        p = defaults if arguments is None else np.atleast_1d(np.asarray(arguments, dtype=float))
        if p.shape != defaults.shape:
            names = ", ".join(one.name for one in self.arguments.arguments)
            raise ValueError(f"arguments: found an array of shape {p.shape}, accepted: {defaults.shape}, for {names}")
        outcome = self.found(p, start)
        nothing = np.full(self.results.size, np.nan)
        if outcome.code not in SOLVED:
            return outcome, nothing
        p, state = np.append(p, outcome.places), outcome.state
        given = self.given(p, state)
        # A stiffness of what is singular is not a number either.
        outputs = self._called(self.output, p, state, given)
        if not np.isfinite(outputs).all():
            return replace(outcome, code=Code.NOT_FINITE, negative=NOT_DEFINED), nothing
        if self.margins is not None and not self._called(self.margins, p, state, given).min(initial=0.0) >= 0.0:
            return replace(outcome, code=Code.TOUCHES, negative=NOT_DEFINED), nothing
        return replace(outcome, error=float(self._called(self.error, state, given)[0])), outputs

    def given(self, p: Array, state: Array) -> Array:
        """What is given for all numbers (size,), with what acts of strings and stops at an equilibrium (states,)."""
        given = self._called(self.prepare, p)
        return given if self.switches is None else self.switches.given(given, self.switches.acting(state))

    def _called(self, function: ca.Function, *arguments: Array) -> Array:
        """The result of one of this solver's functions, flat; nan where it cannot be computed."""
        known = self._calls.get(function.name())
        if known is None:
            known = self._calls[function.name()] = Direct(function)
        return known(*arguments)

    @functools.cached_property
    def _calls(self) -> dict[str, Direct]:
        return {}

    def found(self, arguments: Array, start: Array | None = None, places: Array | None = None) -> Outcome:
        """The equilibrium for arguments (numbers,), on elements that end where lines do, with what acts of strings and
        stops.

        Parameters
        ----------
        start : (states,), state to begin with, for a warm start
        places : (ends,), where elements end then
        """
        if self.switches is None:
            return self._fitted(arguments, start, places)
        acting = self.switches.default if start is None else self.switches.acting(start)
        iterations, others = 0, [*self.switches.beginnings]
        for _ in range(self.switches.most):
            outcome = self._fitted(arguments, start, places, acting)
            iterations += outcome.iterations
            outcome = replace(outcome, iterations=iterations)
            if outcome.code not in SOLVED:
                if not others or outcome.code is Code.BAD_ARGUMENT:
                    return outcome
                acting, start = others.pop(0), None
                continue
            there = self.switches.switched(outcome.state, acting)
            if there is None:
                return replace(outcome, state=self.switches.exact(outcome.state, acting))
            acting, start = there, outcome.state
        return outcome if outcome.code not in SOLVED else replace(outcome, code=Code.TOUCHES, negative=NOT_DEFINED)

    def _fitted(
        self, arguments: Array, start: Array | None, places: Array | None, acting: Array | None = None
    ) -> Outcome:
        """The same with what acts (constraints,) as it is given."""
        known, iterations = self.arguments, 0
        state, ends = self.start if start is None else start, known.places if places is None else places
        warm, good = start is not None, known.accepted(arguments)
        for _ in range(FITS):
            p = np.append(arguments, ends)
            given = self._called(self.prepare, p)
            if self.switches is not None and acting is not None:
                given = self.switches.given(given, acting)
            row = self._called(known.program.row, given)
            outcome = self.method(row if good else row * np.nan, state, warm=warm)
            iterations += outcome.iterations
            outcome = replace(outcome, iterations=iterations, places=ends)
            if outcome.code not in SOLVED or not len(ends):
                return outcome
            there = self._called(self.places, p, outcome.state, given)
            if np.abs(there - ends).max() <= FITTED:
                return outcome
            if not known.within(there):
                return replace(outcome, code=Code.TOUCHES)
            ends, state, warm = there, outcome.state, True
        return replace(outcome, code=Code.STALLED)

    @property
    def unique(self) -> bool:
        """Whether reactions and section forces are unique: not where constraints depend on each other."""
        return not any(note.startswith(NOT_UNIQUE) for note in self.answer.notes)

    def with_results(self, names: Sequence[str]) -> EquilibriumSolver:
        """This solver with other results, given by their names."""
        outputs = Results(self.model, names, self.results.places, unique=self.unique)
        return replace(self, results=outputs)

    def by_name(self, results: Array) -> dict[str, Array]:
        """The results (results,) by their names, each in its shape and unit."""
        bounds = np.cumsum([0, *(result.size for result in self.results.results)]).tolist()
        parts = zip(self.results.results, bounds, bounds[1:], strict=False)
        return {one.name: results[a:b].reshape(one.shape) for one, a, b in parts}


SOLVED = (Code.SOLVED, Code.UNSTABLE)
"""Outcomes with an equilibrium."""

FITS, FITTED = 12, 1e-9
"""Meshes at most, of which the last ends elements where lines end; how far these may be apart, fractions of a length.

What presses between is one force: it is off by the square of that.
"""


def equilibrium_solver(
    scene: Scene,
    name: str,
    *,
    arguments: Asked = None,
    results: Sequence[str] | None = None,
    places: Place | None = None,
    settings: Settings | None = None,
    stopped: bool = False,
    touching: bool = False,
    watched: bool = False,
) -> EquilibriumSolver:
    """The solver of a scene, on the mesh that its accuracy asks for.

    Parameters
    ----------
    scene : Scene
    name : str
        Prefix of all names in C.
    arguments : names of numbers of the scene, or a mapping of them to ranges; by default load factor, loads, motions
    results : names of results; by default those of :func:`~sfetcas.parametric.results.default_results`
    places : fractions of the length at which results along members are given
    settings : as of :func:`~sfetcas.equilibria.statics.solve`
    stopped : whether it may find what is taut and at a stop; else such scenes are refused
    touching : whether it is for what touches in the answer of statics only; else such scenes are refused
    watched : whether a solve then looks whether the same touches

    Raises
    ------
    SceneError
        A scene that cannot be exported, a number or a result that it does not have.
    SolveError
        The solver does not find what touches for the arguments of the scene.
    """
    check_scene(scene, "export({}, ...)", steps=False)
    refuse_search(scene, stopped=stopped, touching=touching)
    if scene.analysis.type == "modes":
        message = "found 'modes', accepted: static or path, whose equilibria are exported, or dynamic"
        raise SceneError(message, ("analysis", "type"))
    mesh, assembly, answer = asked_mesh(scene, settings or Settings(), lines=not watched)
    acting = mesh.stops
    mesh = replace(mesh, stops=all_stops(scene), switched=True) if scene.stopped else mesh
    base = assemble(scene, mesh, assembly=assembly)
    prepared = Prepared(base)
    members = [n for n, member in scene.members.items() if member.type == "flexible"]
    unique = not any(note.startswith(NOT_UNIQUE) for note in answer.notes)
    names = results or default_results(base, unique=unique)
    if not results and mesh.lies:
        # Elements move with the ends of lines.
        names = [name for name in names if not name.startswith("members.")]
    outputs = Results(base, names, chosen_places(members, places or {}), unique=unique)
    outputs.refuse_places()
    known = Arguments(scene, base, asked_for(scene, arguments), outputs, f"{name}_")
    start = None
    if prepared.lacks_slack or any(node.start is not None for node in scene.nodes.values()):
        # Straight members without slack bend to no side by themselves; a start chooses one.
        start = prepared.guess(base.loading(scene.analysis.steps[-1]))[0].flat
    rules = Rules() if scene.analysis.unstable == "leave" else replace(Rules(), escapes=0)
    margins = watched_of(f"{name}_margins", base, known) if watched and scene.contacts else None
    switches = Switches.of(known.program, acting) if scene.stopped else None
    solver = EquilibriumSolver(name, scene, known, outputs, rules, start, answer, margins, switches)
    if mesh.points:
        # What touches does so near its answer alone.
        begun = in_contact(kept_of(scene, settings or Settings(), solved_from(answer)), solver.model)
        solver = replace(solver, start=begun.flat, begun=known.defaults)
        return _found(solver) if watched else solver
    solver = solver if start is not None or _same(solver) else replace(solver, start=_answered(solver))
    return _found(solver) if watched and scene.stopped else solver


def _found(solver: EquilibriumSolver) -> EquilibriumSolver:
    """The solver, if it finds what touches for the arguments of the scene."""
    outcome, _ = solver.solve()
    if outcome.code not in SOLVED:
        detail = f"the solver that would be written says for the arguments of the scene: {MEANINGS[outcome.code]}"
        raise SolveError(Status.FAILED, detail)
    return solver


def _answered(solver: EquilibriumSolver) -> Array:
    """The answer of statics as a state to begin with."""
    return transferred(solver.answer.model, solver.answer.state, solver.model).flat


def _same(solver: EquilibriumSolver) -> bool:
    """Whether a cold solve of the defaults leads to the answer of statics, on another mesh or not."""
    outcome, _ = solver.solve()
    if outcome.code not in SOLVED:
        return False
    found, wanted = (solver.arguments.program.equations.state(flat) for flat in (outcome.state, _answered(solver)))
    return Prepared(solver.model).distance(found, wanted) < ELSEWHERE


ELSEWHERE = 0.05
"""Rotations that differ by more, rad, are those of another equilibrium: meshes differ by less."""

NOT_UNIQUE = "reactions are not unique"
"""How a note of statics begins where closings depend on each other."""


def refuse_search(
    scene: Scene,
    lacking: str = "not exported",
    *,
    stopped: bool = False,
    touching: bool = False,
    moving: bool = False,
) -> None:
    """Refuse a scene whose equilibrium needs a search (contacts, stops, ...), which is not exported, or is ``lacking``.

    With ``stopped`` what is taut and at a stop may have to be found, with ``touching`` what touches; ``moving`` if that
    is not for an equilibrium but in steps of a motion.

    Raises
    ------
    SceneError
        Names it, and what is possible instead.
    """
    instead = "accepted: the scene without"
    if scene.contacts and not touching:
        raise SceneError(f"contact is found by a search that is {lacking}, {instead}", ("contacts",))
    for name, contact in scene.contacts.items():
        if contact.friction > 0.0:
            message = f"what sticks and slides depends on the steps before, and is {lacking}, accepted: 0"
            raise SceneError(message, ("contacts", name, "friction"))
        if contact.between_members and moving:
            message = f"where members are near to each other is found by a search that is {lacking}"
            raise SceneError(f"{message}, accepted: obstacles", ("contacts", name))
    for name, spring in scene.springs.items():
        if spring.stop is not None and not stopped:
            message = f"which stops act is found by a search that is {lacking}, {instead}"
            raise SceneError(message, ("springs", name, "stop"))
    for name, tendon in scene.tendons.items():
        if tendon.may_be_slack and (not stopped or tendon.friction is not None):
            lacking = "without friction" if stopped else lacking
            message = f"whether a tendon is slack is found by a search that is {lacking}, accepted: pushes = true, with"
            raise SceneError(f"{message} which it is kept as long as given, or a stiffness", ("tendons", name))


def solved_steps(scene: Scene, settings: Settings) -> Solution:
    """The load steps of a static scene as of :func:`sfetcas.solve`.

    Raises
    ------
    SceneError, SolveError
        The scene cannot be modelled, or has no equilibrium that could be found.
    """
    if not scene.stopped:
        return solve(scene, settings)
    try:
        return solve_stopped(scene, settings)
    except SolveError as error:
        if not followable(scene, settings):
            raise
        return steps_along(scene, settings, error)


def asked_mesh(scene: Scene, settings: Settings, *, lines: bool = False) -> tuple[Mesh, Any, Equilibrium]:
    """The mesh that the accuracy requires, the assembly, and the static answer; ``lines`` as of :func:`touching_mesh`.

    Raises
    ------
    SceneError, SolveError
        The scene cannot be modelled, or has no equilibrium that could be found.
    """
    static = scene.analysis.model_copy(update={"type": "static", "equilibria": "one"})
    still = scene.model_copy(update={"analysis": static})
    try:
        solution = solved_steps(still, settings)
    except SolveError as error:
        raise SceneError(f"the scene itself has no equilibrium: {error}, accepted: one that has") from None
    if scene.contacts:
        mesh = touching_mesh(still, settings, solution.last, lines=lines)
        return mesh, solution.last.model.assembly, solution.last
    model = max((step.model for step in solution.steps), key=lambda one: one.mesh.elements)
    asked = [settings.elements or member.elements for member in scene.members.values() if member.type == "flexible"]
    # Tendons with friction are pulled or let out as at the first step.
    stops = tuple(stop for stop in solution.last.model.mesh.stops if stop[1] not in ("released", "pulled"))
    mesh = model.mesh if model.mesh.stops == stops else replace(model.mesh, stops=stops)
    halved = max(step.certificate.halved or 0.0 for step in solution.steps)
    if not any(asked) and halved <= (settings.accuracy or scene.analysis.accuracy):
        # Half the elements are as near as was asked for.
        flexible = [n for n, member in scene.members.items() if member.type == "flexible"]
        mesh = replace(mesh, cuts={n: every_other(scene, n, c) if n in flexible else c for n, c in mesh.cuts.items()})
    return mesh, model.assembly, solution.last


def touching_mesh(scene: Scene, settings: Settings, answer: Equilibrium, *, lines: bool) -> Mesh:
    """The mesh of an answer of statics with what touches where it does, also where places roll over nodes.

    Raises
    ------
    SceneError
        Members lie along each other, or beside friction; without ``lines`` also along obstacles.
    """
    kept = kept_of(scene, settings, solved_from(answer))
    for what in kept.lines(smooth=not lines):
        accepted = "members that touch at places" + ", or lie along obstacles without friction" * lines
        raise SceneError(f"{what}, accepted: {accepted}", ("contacts",))
    return kept.mesh


def kept_of(scene: Scene, settings: Settings, found: Solved) -> Kept:
    """What touches in a state of a scene."""
    model = found.model

    def prepare(mesh: Mesh) -> Prepared:
        return Prepared(assemble(scene, mesh, assembly=model.assembly, scales=model.scales))  # type: ignore[arg-type]

    return Kept(scene, prepare, settings.accuracy or scene.analysis.accuracy, (), found)


def in_contact(kept: Kept, model: Model) -> State:
    """An answer of statics in contact as a state of a model in which the same touches.

    Places begin elsewhere along their members there, and units may be others.
    """
    scene, mesh, points = kept.scene, model.mesh, kept.mesh.points
    state = kept.start(kept.run.prepare(replace(mesh, points=points)))
    y, number = state.y.copy(), {name: i for i, name in enumerate(model.positions.unknowns)}
    unit, target = kept.rest.model.scales, model.scales
    begins = zip(undeformed_vectors(scene, points), undeformed_vectors(scene, mesh.points), strict=True)
    for now, point, (here, there) in zip(points, mesh.points, begins, strict=True):
        for side, member in enumerate(point.members):
            if point.slides[side]:
                moved = (now.at[side] - point.at[side]) * scene.center_lines[member].length
                y[number[f"{point.place(side)}, arc length"]] += moved / unit.length
        if point.line:
            continue
        for k in range(model.element.axes):
            y[number[f"{point.between}, {'xyz'[k]}"]] += (here - there)[k] / unit.length
    return replace(state, y=y * unit.length / target.length, lam=state.lam * unit.force / target.force)


def what_touches(mesh: Mesh) -> list[tuple[Any, ...]]:
    """What touches on a mesh, and whether it slides there; where that is it finds itself.

    Of lines it is that they end, not what stands for what presses between.
    """
    return [
        (p.contact, p.members, p.slides, p.edge, [x for x, free in zip(p.at, p.slides, strict=True) if not free])
        for p in mesh.points
        if not p.line
    ]


def chosen_places(members: Sequence[str], given: Place) -> dict[str, tuple[float, ...]]:
    """The fractions of the length at which results along each flexible member are given.

    Raises
    ------
    SceneError
        A place is not between 0 and 1, or belongs to no flexible member.
    """
    for name, places in given.items():
        if name not in members:
            raise SceneError(f"found {name!r}, accepted: a flexible member", ("places",))
        outside = [x for x in places if not 0.0 <= x <= 1.0]
        if outside or not places:
            raise SceneError(f"found {outside or 'none'}, accepted: fractions from 0 to 1", ("places", name))
    return {name: tuple(given.get(name, USUAL_PLACES)) for name in members}
