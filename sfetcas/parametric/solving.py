"""Equilibria of a scene as functions of its numbers: solved again and again, with exact derivatives."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.records import counted, say, unknown, whole
from ..description.scene import Scene, check_scene
from ..description.showing import shown, stability_in_words, values_in_words
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations
from ..mechanics.expressions import Expressions
from ..mechanics.fields import transferred
from ..mechanics.inputs import Inputs
from ..mechanics.model import assemble
from ..processes import cores
from ..solvers.globalised import MEANINGS, NOT_DEFINED, Code, Globalised, Outcome
from ..solvers.prepared import Prepared
from ..solvers.program import Program
from .arguments import Argument, Asked, in_words
from .equilibrium import SOLVED, EquilibriumSolver, Place, equilibrium_solver, refuse_search, solved_steps
from .implicit import Implicit, Slopes
from .plain import PlainCases, plain_cases
from .results import Result, Results
from .touching import Touching

__all__ = ["ParametricAnswer", "ParametricAnswers", "ParametricEquilibrium", "Values", "parametric"]

Values = Mapping[str, ArrayLike]
"""Values of parameters by their names, in the units of the scene; those left out have their defaults."""

FAR = 0.3
"""Largest rotation, rad, for which the start of a solve is extrapolated by first derivatives."""


def parametric(
    scene: Scene,
    parameters: Asked = None,
    answers: Sequence[str] | None = None,
    *,
    places: Place | None = None,
    settings: Settings | None = None,
) -> ParametricEquilibrium:
    """The equilibrium of a scene as a function of some of its numbers.

    Parameters
    ----------
    scene : Scene
        The load factor is the last of its ``steps``; the mesh is the one that its accuracy needs with its own numbers.
    parameters : names of numbers, or mapping of names to ranges or to a :class:`Parameter`
        As ``loads.tip.value``, ``sections.strip.EI3``, ``springs.k.rest``, ``nodes.B.position.0``, ``factor``; a range
        ``(low, high)`` limits accepted values.  Default: load factor, loads and prescribed motions.
    answers : names
        As ``nodes.tip.position``, ``members.beam.moment``, ``reactions.A.force``, ``energy.elastic``,
        ``compliance.tip``.  Default: all quantities of nodes, reactions, springs and energies.
    places : mapping of members to fractions of their length
        Where answers along members are given.
    settings : Settings, optional
        As of :func:`~sfetcas.solve`.

    Raises
    ------
    SceneError
        A scene with friction where members touch, or members that lie along each other; a number or an answer that it
        does not have; a number that changes the structure of the model.
    """
    check_scene(scene, "parametric({}, ...)", steps=False)
    parameters = [parameters] if isinstance(parameters, str) else parameters
    answers = [answers] if isinstance(answers, str) else answers
    refuse_search(scene, "without derivatives", stopped=True, touching=True)
    if scene.analysis.type == "modes":
        raise SceneError("found 'modes', accepted: static, or path", ("analysis", "type"))
    try:
        solver = equilibrium_solver(
            scene,
            "equilibrium",
            arguments=parameters,
            results=answers,
            places=places,
            settings=settings,
            stopped=scene.stopped,
            touching=bool(scene.contacts),
        )
    except SceneError as error:
        raise _renamed(error) from None
    if not answers:
        own = [one.name for one in solver.results.results if not one.member]
        solver = solver.with_results(own)
    touching = Touching(solver, settings or Settings()) if scene.contacts else None
    return ParametricEquilibrium(solver, settings or Settings(), touching)


def _renamed(error: SceneError) -> SceneError:
    """The error with its place as the caller knows it."""
    names = {"arguments": "parameters", "results": "answers"}
    first, *others = error.where or ("",)
    return SceneError(error.bare, (names[first], *others)) if first in names else error


@dataclass(frozen=True, eq=False)
class ParametricEquilibrium:
    """The equilibrium of one scene on one mesh as a function of parameters; made by :func:`parametric`.

    Flat arrays (numbers,) have all numbers of all parameters in the order of :attr:`numbers`, in the units of the
    scene.

    Attributes
    ----------
    solver : EquilibriumSolver
    settings : Settings
    touching : Touching or None
        Where something may touch: the solvers of what else touches.
    """

    solver: EquilibriumSolver
    settings: Settings
    touching: Touching | None = None

    def __repr__(self) -> str:
        solver = self.solver
        return shown(self, [solver.model.size_in_words], in_words(solver.arguments, solver.results))

    @property
    def parameters(self) -> tuple[Argument, ...]:
        """The parameters, each with name, default, unit, meaning and range."""
        return self.solver.arguments.arguments

    @property
    def answers(self) -> tuple[Result, ...]:
        """The answers, each with name, shape, unit and meaning."""
        return self.solver.results.results

    @property
    def numbers(self) -> tuple[str, ...]:
        """A name for each number of the parameters, in the order of flat arrays."""
        return tuple(name for one in self.parameters for name in one.names)

    @property
    def defaults(self) -> dict[str, Array]:
        """The values of the parameters in the scene: a number, or (n,) for a list of n."""
        return self.by_parameter(self.solver.arguments.defaults)

    def by_parameter(self, numbers: Array) -> dict[str, Array]:
        """Split the last axis (numbers,) of an array by parameter; for single numbers that axis is dropped."""
        found, first = {}, 0
        for one in self.parameters:
            last = first + len(one.default)
            found[one.name] = numbers[..., first] if one.components is None else numbers[..., first:last]
            first = last
        return found

    def flat(self, values: Values | None = None) -> Array:
        """Values of the parameters as a flat array (numbers,); those not given have their defaults.

        Raises
        ------
        SceneError
            There is no such parameter, its length is another one, or it is out of its range.
        """
        values = values or {}
        known = [one.name for one in self.parameters]
        for name in values:
            if name not in known:
                raise SceneError(unknown(name, known, "such parameters"), ("values",))
        parts = [_given(one, values.get(one.name, one.default)) for one in self.parameters]
        return np.concatenate([np.zeros(0), *parts])

    def scene_at(self, values: Values | None = None) -> Scene:
        """The scene with these values, with a static analysis, for :func:`~sfetcas.solve`."""
        scene = self.solver.arguments.scene_at(self.flat(values))
        analysis = scene.analysis.model_copy(update={"type": "static", "equilibria": "one"})
        return scene.model_copy(update={"analysis": analysis})

    def solve(self, values: Values | None = None, start: ParametricAnswer | None = None) -> ParametricAnswer:
        """The equilibrium for values of the parameters.

        Parameters
        ----------
        values : mapping of names to numbers, or lists of them
            Those left out have their defaults.
        start : ParametricAnswer, optional
            An earlier answer from which to start: faster, and on the same branch of equilibria.

        Raises
        ------
        SceneError
            A value is not accepted.
        SolveError
            No equilibrium was found.
        """
        numbers = self.flat(values)
        if self.touching is not None:
            return self._touching(self.touching, numbers, start)
        return self._solved(numbers, start)

    def many(
        self,
        values: Values,
        *,
        warm: bool = False,
        threads: int | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> ParametricAnswers:
        """The equilibria for many values of parameters, most of them at once by the core, in threads.

        Those in which nothing out of the ordinary happens are the same as of :func:`~sfetcas.solve`: their loads are
        followed from zero, and each has an error estimate; see :func:`~sfetcas.sweep`.  All others are those of
        :meth:`solve`.

        Parameters
        ----------
        values : mapping
            A column (cases,) or (cases, k) for each parameter that changes, in the units of the scene.
        warm : bool
            Begin at the nearest case solved before: two to three times faster, but which of several stable equilibria
            is found depends on the order of the cases.
        threads : int, optional
            By default as many as there are processors.
        progress : callable, optional
            Called with the number of cases done since the last call.

        Raises
        ------
        SceneError
            Other names, columns of unlike length, or values that are no finite numbers.

        Examples
        --------
        >>> equilibrium = parametric(scene, ["loads.tip.value.1"], ["nodes.tip.position"])    # doctest: +SKIP
        >>> equilibrium.many({"loads.tip.value.1": [0, 5, 10]})["nodes.tip.position"]         # doctest: +SKIP
        """
        numbers = self._columns(values)
        threads = cores() if threads is None else whole(threads, 1, what="number of threads", name="threads")
        found = np.full((len(numbers), self.solver.results.size), np.nan)
        errors, residuals = np.full((2, len(numbers)), np.nan)
        left, failures, plain = np.arange(len(numbers)), dict[int, str](), self._plain
        if not isinstance(plain, str):
            answers = plain.solve(numbers, warm=warm, threads=threads, progress=progress)
            if answers.interrupted:
                raise KeyboardInterrupt
            found, errors, residuals = answers.numbers, answers.errors, answers.residuals
            left = np.flatnonzero(~answers.known)
        for i in left.tolist():
            try:
                own = self.solve(self.by_parameter(numbers[i]))
                found[i] = np.concatenate([np.zeros(0), *(answer.ravel() for answer in own.answers.values())])
                residuals[i] = own.residual
            except (SceneError, SolveError) as error:
                failures[i] = str(error)
            if progress is not None:
                progress(1)
        return ParametricAnswers(self, numbers, found, errors, residuals, failures)

    def _columns(self, values: Values) -> Array:
        """Values (cases, numbers) of all parameters."""
        names = [one.name for one in self.parameters]
        for name in values:
            if name not in names:
                raise SceneError(unknown(name, names, "such parameters"), ("values",))
        cases = max((len(np.atleast_1d(np.asarray(column, dtype=object))) for column in values.values()), default=1)
        found = np.repeat(self.solver.arguments.defaults[None, :], cases, axis=0)
        begin = 0
        for one in self.parameters:
            size = len(one.default)
            if one.name in values:
                found[:, begin : begin + size] = _column(one.name, values[one.name], (cases, size))
            begin += size
        return found

    @functools.cached_property
    def _plain(self) -> PlainCases | str:
        """What solves most cases at once; or what hinders it, in a few words."""
        solver = self.solver
        results = [one.name for one in solver.results.results]
        known, places = (solver.model.mesh, solver.model.assembly), solver.results.places
        asked = {"type": "static", "equilibria": "one"}
        scene = solver.scene.model_copy(update={"analysis": solver.scene.analysis.model_copy(update=asked)})
        return plain_cases(scene, solver.arguments.arguments, results, self.settings, places=places, known=known)

    def _touching(self, touching: Touching, numbers: Array, start: ParametricAnswer | None) -> ParametricAnswer:
        """The equilibrium in which nothing penetrates or pulls, with what touches in ``start`` if that may be so."""
        first = self if start is None else start.of
        try:
            answer = first._solved(numbers, start)
        except SolveError:
            pass
        else:
            known = touching.first.answer.fields
            if start is not None:
                known = touching.kept(first.solver, start.numbers, start.outcome).rest.fields
            if touching.may_stay(first.solver, numbers, answer.outcome, known):
                return answer
        solver, state = touching.anew(numbers)
        if solver not in touching.equilibria:
            touching.forget_lines()
            own = self if solver is self.solver else replace(self, solver=replace(solver, start=state, begun=numbers))
            touching.equilibria[solver] = own
        of = touching.equilibria[solver]
        near = ParametricAnswer(of, numbers, Outcome(Code.SOLVED, state, 0.0, 0, 0, solver.arguments.places))
        answer = of._solved(numbers, near)
        for what in touching.kept(solver, numbers, answer.outcome).changed():
            raise SolveError(Status.FAILED, f"{what}, where nothing else was found to touch", answer.outcome)
        return answer

    def _solved(self, numbers: Array, start: ParametricAnswer | None) -> ParametricAnswer:
        """The equilibrium for numbers, beginning with an earlier one, from afar, or with statics."""
        near = () if start is None else start.near(numbers)
        outcome = self.solver.found(numbers, *near)
        if outcome.code not in SOLVED and start is not None:
            outcome = self.solver.found(numbers)
        if outcome.code not in SOLVED and self.solver.switches is not None:
            outcome = self._from_statics(numbers) or outcome
        if outcome.code not in SOLVED:
            status = Status.ITERATIONS if outcome.code is Code.ITERATIONS else Status.FAILED
            said = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.numbers, numbers, strict=True))
            raise SolveError(status, f"{MEANINGS[outcome.code]}, at {said}", outcome)
        return ParametricAnswer(self, numbers, outcome)

    def _from_statics(self, numbers: Array) -> Outcome | None:
        """The equilibrium that begins with the answer of statics for numbers; None where there is none.

        Strings that act together on what is straight are beyond Newton's method from afar.
        """
        try:
            answer = solved_steps(self.scene_at(self.by_parameter(numbers)), self.settings).last
        except (SceneError, SolveError):
            return None
        return self.solver.found(numbers, transferred(answer.model, answer.state, self.solver.model).flat)

    @functools.cached_property
    def implicit(self) -> Implicit:
        """Evaluates derivatives by the implicit function theorem."""
        solver = self.solver
        return Implicit(
            solver.arguments, solver.results, solver.method.mass, unique=solver.unique, switches=solver.switches
        )


def _given(one: Argument, value: ArrayLike) -> Array:
    """The numbers of one parameter."""
    try:
        given = np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        given = np.zeros(0)
    count = len(one.default)
    if len(given) != count or not np.isfinite(given).all():
        accepted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SceneError(f"found {value!r}, accepted: {accepted}", ("values", one.name))
    for number, (low, high) in zip(given.tolist(), one.limits.tolist(), strict=True):
        if not low <= number <= high:
            usual = "zero or less" if high == 0.0 else "above zero" if low > 0.0 else "zero or more"
            accepted = f"{low:g} to {high:g}" if one.low is not None else usual
            raise SceneError(f"found {number:g}, accepted: {accepted}", ("values", one.name))
    return given


def _column(name: str, values: ArrayLike, shape: tuple[int, int]) -> Array:
    """The values of one parameter for all cases."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    own = shape if shape[1] > 1 else shape[:1]
    if found.shape not in (shape, own) or not np.isfinite(found).all():
        told = f"an array of shape {found.shape}" if found.size and np.isfinite(found).all() else say(values)
        accepted = f"finite numbers in an array of shape {own}, with as many cases as the others"
        raise SceneError(f"found {told}, accepted: {accepted}", ("values", name))
    return found.reshape(shape)


@dataclass(frozen=True, eq=False)
class ParametricAnswers:
    """Equilibria for many values of parameters, see :meth:`ParametricEquilibrium.many`.

    ``answers["nodes.tip.position"]`` are an answer of all cases by its name, (cases,) and its own shape.

    Attributes
    ----------
    of : ParametricEquilibrium
    numbers : ndarray (cases, numbers)
        Values of the parameters, in the units of the scene.
    results : ndarray (cases, results)
        Numbers of all answers; nan where there is none.
    errors : ndarray (cases,)
        Estimated errors of positions over the size of the scene; nan where a case was solved by itself.
    residuals : ndarray (cases,)
        Largest relative residuals.
    failures : mapping of int to str
        By their numbers, why cases have no answer.
    """

    of: ParametricEquilibrium
    numbers: Array
    results: Array
    errors: Array
    residuals: Array
    failures: Mapping[int, str]

    def __len__(self) -> int:
        return len(self.numbers)

    def __repr__(self) -> str:
        solved = len(self) - len(self.failures)
        told = [f"{counted(len(self), 'case')}, {solved} solved", f"errors up to {np.nanmax([0.0, *self.errors]):.1e}"]
        return shown(self, told, in_words(self.of.solver.arguments, self.of.solver.results))

    def __getitem__(self, name: str) -> Array:
        """An answer by its name, of all cases.

        Raises
        ------
        SceneError
            There is none of this name.
        """
        begin = 0
        for one in self.of.answers:
            if one.name == name:
                return self.results[:, begin : begin + one.size].reshape(len(self), *one.shape)
            begin += one.size
        raise SceneError(unknown(name, [one.name for one in self.of.answers], "such answers"), ("answers",))


@dataclass(frozen=True, eq=False)
class ParametricAnswer:
    """An equilibrium for values of parameters; derivatives are computed when they are first asked for.

    ``answer["nodes.tip.position"]`` is an answer by its name.

    Attributes
    ----------
    of : ParametricEquilibrium
    numbers : ndarray (numbers,)
        Values of the parameters, flat, in the units of the scene.
    outcome : Outcome
        State, residual, number of negative eigenvalues and iterations.
    """

    of: ParametricEquilibrium
    numbers: Array
    outcome: Outcome

    def __repr__(self) -> str:
        stable = stability_in_words(self.stable, self.outcome.negative)
        return shown(
            self,
            [stable, f"residual {self.residual:.1e}"],
            [
                *values_in_words(self.values, {one.name: one.unit for one in self.of.parameters}),
                *values_in_words(self.answers, {one.name: one.unit for one in self.of.answers}),
            ],
        )

    @property
    def values(self) -> dict[str, Array]:
        """Values of the parameters by their names."""
        return self.of.by_parameter(self.numbers)

    @property
    def residual(self) -> float:
        """Largest relative residual of all equations."""
        return self.outcome.residual

    @property
    def stable(self) -> bool | str:
        """Whether the second variation has no negative eigenvalue; "not defined" for loads without potential."""
        return "not defined" if self.outcome.negative == NOT_DEFINED else self.outcome.negative == 0

    @functools.cached_property
    def answers(self) -> dict[str, Array]:
        """The answers by their names, in their shapes, in SI units.

        Raises
        ------
        SolveError
            A stiffness or compliance that was asked for has no value, as the equilibrium is singular.
        """
        solver = self.of.solver
        given = solver.given(self._whole, self.outcome.state)
        try:
            return solver.by_name(np.array(solver.output(self._whole, self.outcome.state, given)).ravel())
        except RuntimeError:
            detail = "a stiffness or compliance that was asked for has no value"
            raise SolveError(Status.SINGULAR, detail) from None

    def __getitem__(self, name: str) -> Array:
        """An answer by its name."""
        return self.answers[self._known(name)]

    def _known(self, name: str) -> str:
        known = [one.name for one in self.of.answers]
        if name not in known:
            raise SceneError(unknown(name, known, "such answers"), ("answers",))
        return name

    @property
    def _whole(self) -> Array:
        """The numbers, and where lines end."""
        return np.append(self.numbers, self.outcome.places)

    def near(self, numbers: Array) -> tuple[Array, Array]:
        """A state (states,) to start from for other ``numbers``, and where lines end there (ends,).

        It is extrapolated where first derivatives are known already and rotations change little.
        """
        # What has been computed already costs nothing.
        slopes: Slopes | None = self.__dict__.get("_slopes")
        here = self.outcome.state, self.outcome.places
        if slopes is None:
            return here
        step = slopes.steps @ (numbers - self.numbers)
        rotation_unknowns = self.of.implicit.rotation_unknowns
        places = self.outcome.places + slopes.places @ (numbers - self.numbers)
        arguments = self.of.solver.arguments
        if not np.abs(step[:rotation_unknowns]).max(initial=0.0) <= FAR or not arguments.within(places):
            return here
        return np.array(arguments.program.move(self.outcome.state, step, 1.0)).ravel(), places

    # -- derivatives --------------------------------------------------------------------------------

    @functools.cached_property
    def _slopes(self) -> Slopes:
        if self.of.solver.switches is not None:
            self.of.solver.switches.refuse_doubt(self.outcome.state)
        if self.of.touching is not None:
            self.of.touching.refuse_doubt(self.of.solver, self.numbers, self.outcome)
        return self.of.implicit.slopes(self._whole, self.outcome.state)

    @property
    def flat_jacobian(self) -> Array:
        """Jacobian (answers, numbers): derivatives of all numbers of the answers by all numbers of the parameters.

        Raises
        ------
        SolveError
            The equilibrium is singular.
        """
        return self._slopes.jacobian

    @functools.cached_property
    def jacobian(self) -> dict[str, dict[str, Array]]:
        """First derivatives ``jacobian[answer][parameter]``: the shape of the answer, then (n,) for a list of n
        numbers.
        """
        found = {}
        for one, rows in self._rows():
            own = self.flat_jacobian[rows].reshape(*one.shape, -1)
            found[one.name] = self.of.by_parameter(own)
        return found

    def _rows(self) -> list[tuple[Result, slice]]:
        bounds = np.cumsum([0, *(one.size for one in self.of.answers)]).tolist()
        return [(one, slice(a, b)) for one, a, b in zip(self.of.answers, bounds, bounds[1:], strict=False)]

    def flat_hessian(self, weights: ArrayLike) -> Array:
        """Hessian (numbers, numbers) of the sum of all numbers of the answers times their ``weights`` (answers,).

        Raises
        ------
        SceneError
            There are more or fewer weights.
        SolveError
            The equilibrium is singular, or there are answers along a member that lies along an obstacle.
        """
        solver = self.of.solver
        if len(solver.model.mesh.line_ends) > len(solver.arguments.ends):
            detail = "second derivatives are not known beside answers along a member that lies along an obstacle"
            raise SolveError(Status.FAILED, f"{detail}, accepted: answers of nodes", self.outcome)
        given = np.asarray(weights, dtype=float).ravel()
        size = self.of.solver.results.size
        if len(given) != size:
            raise SceneError(f"found {len(given)} weights, accepted: {size}, one for each number", ("weights",))
        return self.of.implicit.second(self._whole, self.outcome.state, self._slopes, given)

    def hessian(self, answer: str) -> dict[str, dict[str, Array]]:
        """Second derivatives of one answer, ``hessian(answer)[parameter][parameter]``.

        Each array has the shape of the answer, then an axis for each of the two parameters that is a list.
        """
        self._known(answer)
        one, rows = next(pair for pair in self._rows() if pair[0].name == answer)
        unit = np.eye(self.of.solver.results.size)[rows]
        whole = np.stack([self.flat_hessian(weights) for weights in unit])
        whole = whole.reshape(*one.shape, *whole.shape[1:])
        first = self.of.by_parameter(np.moveaxis(whole, -2, -1))
        scalar = {parameter.name: parameter.components is None for parameter in self.of.parameters}
        return {
            name: self.of.by_parameter(part if scalar[name] else np.moveaxis(part, -1, -2))
            for name, part in first.items()
        }

    # -- how good it is -----------------------------------------------------------------------------

    def errors(self) -> dict[str, float]:
        """For each answer its largest change when all elements are halved, in its unit.

        The mesh is chosen for the numbers of the scene; for values far from these it may be too coarse, which shows
        here.

        Raises
        ------
        SolveError
            The finer mesh has no equilibrium nearby.
        """
        solver = self.of.solver
        program, state = self._halved() if self.of.touching is None else self._halved_touching(self.of.touching)
        given = program.given_of(program.model.loading(self.of.scene_at(self.values).analysis.steps[-1]))
        names = [one.name for one in self.of.answers]
        results = Results(program.model, names, solver.results.places, unique=solver.unique)
        outputs = results.expression(program, ca.MX(ca.DM(results.rest(program.model))))
        function = ca.Function("outputs", [program.state_symbol, program.symbol], [outputs])
        there = solver.by_name(np.array(function(state, given)).ravel())
        return {name: float(np.abs(there[name] - own).max(initial=0.0)) for name, own in self.answers.items()}

    def _halved(self) -> tuple[Program, Array]:
        """The program on half as long elements, and the state (states,) there."""
        solver, model = self.of.solver, self.of.solver.model
        scene = solver.arguments.scene_at(self.numbers)
        assembly: Any = model.assembly
        mesh = model.mesh.refined()
        if solver.switches is not None:
            mesh = replace(mesh, stops=solver.switches.stops(self.outcome.state), switched=False)
        finer = assemble(scene, mesh, assembly=assembly, scales=model.scales)
        program = Program(Expressions(Equations(finer, kernels="interpreted"), "interpreted"))
        prepared, loading = Prepared(finer), finer.loading(scene.analysis.steps[-1])
        start = transferred(model, solver.arguments.program.equations.state(self.outcome.state), finer)
        inputs = Inputs(prepared.equations)
        outcome = Globalised(inputs, prepared.weight, solver.rules)(inputs.of(loading), start.flat)
        if outcome.code not in SOLVED:
            raise SolveError(Status.FAILED, f"on half the elements: {MEANINGS[outcome.code]}", outcome)
        return program, outcome.state

    def _halved_touching(self, touching: Touching) -> tuple[Program, Array]:
        """As :meth:`_halved`, where what touches may have to be found anew."""
        found = touching.kept(self.of.solver, self.numbers, self.outcome).halved()
        if found is None:
            raise SolveError(Status.FAILED, "what touches was not found on half the elements", self.outcome)
        program = Program(Expressions(Equations(found.model, kernels="interpreted"), "interpreted"))
        return program, found.state.flat

    def certified(self) -> Equilibrium:
        """The equilibrium that :func:`~sfetcas.solve` finds for the same values, with its own mesh, branch and
        certificate.

        Raises
        ------
        SolveError
            No equilibrium was found.
        """
        scene = self.of.scene_at(self.values)
        return solved_steps(scene, self.of.settings).last
