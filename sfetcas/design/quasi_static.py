"""Quasi-static trajectories: inputs that move a mechanism through a path of equilibria, found all at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .. import tolerances
from ..description.records import counted
from ..description.records import unknown as not_known
from ..description.scene import Scene, check_scene
from ..description.showing import few, notes_in_words, ranges_in_words, shown, values_in_words
from ..equilibria.solution import Equilibrium
from ..errors import SceneError, SolveError
from ..mathematics.arrays import Array
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import Ipopt
from ..mathematics.statements import Bounds
from ..mechanics.equations import State
from ..parametric.arguments import Parameter
from ..solvers.prepared import Solved
from .certifying import prepared_case
from .formulation import Cases, Formulation
from .solving import Iterate, Optimum, Solving

__all__ = ["QuasiStatic", "QuasiStaticAnswer", "QuasiStaticIterate"]

SHARES = (0.25, 0.5, 0.75, 1.0)
"""Fractions of the way between two points that are tried one after the other where one step does not arrive."""


@dataclass(frozen=True, eq=False)
class QuasiStaticIterate:
    """The last iterate of a problem that did not converge; not a solution.

    Attributes
    ----------
    inputs : mapping of str to ndarray (points, n)
        In the units of the scene.
    values : mapping of str to ndarray
        All other unknowns.
    outputs : mapping of str to ndarray (points, n)
        The answers that expressions use, SI units.
    objective : float
    iterations : int
    """

    inputs: Mapping[str, Array]
    values: Mapping[str, Array]
    outputs: Mapping[str, Array]
    objective: float
    iterations: int


@dataclass(frozen=True, eq=False)
class QuasiStaticAnswer:
    """A path through equilibria.

    Attributes
    ----------
    s : ndarray (points,)
        The path parameter from 0 to 1.
    inputs : mapping of str to ndarray (points, n)
        In the units of the scene.
    values : mapping of str to ndarray
        Variables that are the same at all points.
    outputs : mapping of str to ndarray (points, n)
        The answers that expressions use, SI units.
    objective : float
    cases : tuple of Equilibrium
        The equilibrium of each point, with its certificate.
    jumps : tuple of int
        Indices of points that do not follow continuously from their predecessor: the mechanism would snap there.
    multipliers : mapping of str to ndarray
    notes : tuple of str
    iterations : int
    """

    s: Array = field(repr=False)
    inputs: Mapping[str, Array] = field(repr=False)
    values: Mapping[str, Array] = field(repr=False)
    outputs: Mapping[str, Array] = field(repr=False)
    objective: float
    cases: tuple[Equilibrium, ...] = field(repr=False)
    jumps: tuple[int, ...]
    multipliers: Mapping[str, Array] = field(repr=False)
    notes: tuple[str, ...]
    iterations: int
    scenes: tuple[Scene, ...] = field(repr=False)

    def __repr__(self) -> str:
        jumps = f"jumps at the points {few(map(str, self.jumps))}" if self.jumps else "no jumps"
        return shown(
            self,
            [f"objective={self.objective:.9g}", counted(len(self.s), "point"), counted(self.iterations, "iteration")],
            [
                *ranges_in_words(self.inputs),
                *values_in_words(self.values),
                f"{'all points stable' if self.stable else 'not all points stable'}, {jumps}",
                *notes_in_words(self.notes),
            ],
        )

    @property
    def stable(self) -> bool:
        """Whether all points are certified as stable."""
        return all(case.certificate.stable is True for case in self.cases)

    def answers(self, name: str) -> Array:
        """The values (points, n) of an answer that the objective or constraints use; along members place by place.

        Raises
        ------
        SceneError
            They do not use it.
        """
        if name not in self.outputs:
            raise SceneError(not_known(name, list(self.outputs), "answers"), ("answers",))
        return self.outputs[name]

    def scene(self, point: int) -> Scene:
        """The scene with the values found at a point, given by its index."""
        return self.scenes[point]


class QuasiStatic(Cases):
    """Inputs that lead a mechanism along a path of equilibria, slowly.

    Parameters
    ----------
    scene : Scene
        Static; where members touch something, the same everywhere.
    inputs : mapping of str to (low, high)
        Numbers of the scene that are unknown at each point of the path, with their bounds.
    points : int
        Points of the path, evenly spaced from 0 to 1.
    variables : mapping of str to (low, high) or Parameter
        Numbers of the scene that are unknown, but the same everywhere.
    guess : mapping of str to numbers
        Start values: of an input (n,) or (points, n); by default the values of the scene.
    accuracy, kernels : as of :class:`~sfetcas.design.designing.Design`

    Attributes
    ----------
    s : ndarray (points,)

    Raises
    ------
    SceneError
        Numbers that the scene does not have, contradictory bounds, fewer than three points.

    Examples
    --------
    >>> path = QuasiStatic(scene, {"loads.tip.value": (-50.0, 50.0)}, points=21)    # doctest: +SKIP
    >>> tip = path.answer("nodes.tip.position")                                     # doctest: +SKIP
    >>> path.subject_to(tip[:, 1] == 0.2 + 0.3 * path.s)                            # doctest: +SKIP
    >>> path.smooth("loads.tip.value")                                              # doctest: +SKIP
    >>> path.solve().inputs["loads.tip.value"]                                      # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        inputs: Mapping[str, Bounds],
        points: int = 21,
        *,
        variables: Mapping[str, Bounds | Parameter] | None = None,
        guess: Mapping[str, ArrayLike] | None = None,
        accuracy: float | None = None,
        kernels: Kernels = "auto",
    ) -> None:
        check_scene(scene, "QuasiStatic({}, ...)", steps=False)
        if points < 3:
            raise SceneError(f"found {points}, accepted: three or more", ("points",))
        if not inputs:
            raise SceneError("found none, accepted: one number of the scene or more", ("inputs",))
        self.s = np.linspace(0.0, 1.0, points)
        self.statement = Formulation(scene, [f"s = {x:.4g}" for x in self.s], accuracy)
        self._kernels, self._inputs = kernels, list(inputs)
        starts = dict(guess or {})
        for name, bounds in inputs.items():
            self._vary(name, bounds, starts.pop(name, None), everywhere=False)
        for name, given in (variables or {}).items():
            self._vary(name, given, starts.pop(name, None), everywhere=True)
        if starts:
            known = [*inputs, *(variables or {})]
            raise SceneError(not_known(next(iter(starts)), known, "unknowns"), ("guess",))

    def _vary(self, name: str, bounds: Bounds | Parameter, guess: ArrayLike | None, *, everywhere: bool) -> None:
        low, high = self.statement.bounds(name, name, bounds, guess)
        known = self.statement.numbers(name)
        start = np.array(known.default, dtype=float)
        shape = start.shape if everywhere else (len(self.s), len(start))
        if guess is not None:
            start = np.asarray(guess, dtype=float)
        elif low < high:
            start = np.clip(start, low, high)
        symbol = self.statement.unknown(name, np.broadcast_to(start, shape), low, high)
        self.set(name, symbol, between=(low, high))

    # -- expressions --------------------------------------------------------------------------------

    def set(self, name: str, value: ArrayLike | ca.MX, *, between: Bounds | None = None) -> None:
        """Set a number of the scene to a value or an expression of unknowns: the same everywhere, or (points, n).

        Raises
        ------
        SceneError
            The scene has no such number, or there are more or fewer values.
        """
        count, points = len(self.statement.numbers(name).names), len(self.s)
        shape = value.shape if isinstance(value, ca.MX) else np.shape(value)
        every = shape in ((points, count), *([(points,), (points, 1)] if count == 1 else []))
        for i, case in enumerate(self.statement.cases):
            own: ArrayLike | ca.MX = value
            if every:
                own = value[i, :] if isinstance(value, ca.MX) else np.asarray(value)[i]
            self.statement.set(name, own, case=case, between=between)

    def input(self, name: str) -> ca.MX:
        """The symbol of an input, (points, n), in its unit; SceneError where it is no input."""
        if name not in self._inputs:
            raise SceneError(not_known(name, self._inputs, "inputs"), ("inputs",))
        return self.statement.free[name].symbol

    def variable(self, name: str) -> ca.MX:
        """The symbol of an unknown by its name, in the shape of its guess."""
        return self._free(name)

    def answer(self, name: str, at: Sequence[float] | None = None) -> ca.MX:
        """An answer along the path, (points, n), SI units; of members the numbers place by place."""
        return self.statement.ask(name, range(len(self.s)), name, at, rows=True)

    def at(self, expression: ca.MX, place: float) -> ca.MX:
        """The value of an expression (points, n) at the path parameter ``place``, from 0 to 1, as a column (n, 1).

        Raises
        ------
        SceneError
            There is no point of the path.
        """
        number = int(np.argmin(np.abs(self.s - place)))
        if abs(self.s[number] - place) > tolerances.WRITTEN:
            spacing = 1.0 / (len(self.s) - 1)
            raise SceneError(f"found {place:g}, accepted: a multiple of {spacing:g} from 0 to 1", ("at",))
        return expression[number, :].T

    def rate(self, expression: ca.MX) -> ca.MX:
        """Derivative of an expression (points, n) by the path parameter, between the points, (points - 1, n)."""
        return ca.diff(expression, 1, 0) * (len(self.s) - 1)

    def smooth(self, name: str, weight: float = 1.0, order: int = 2) -> None:
        """Add to the objective ``weight`` times the mean square of a derivative of an input by the path parameter.

        Raises
        ------
        SceneError
            The order is not 1 or 2.
        """
        if order not in (1, 2):
            raise SceneError(f"found {order}, accepted: 1 or 2", ("smooth", name))
        derivative = self.rate(self.input(name))
        if order == 2:
            derivative = self.rate(derivative)
        self.statement.minimise(weight * ca.sumsqr(derivative) / derivative.shape[0])

    # -- the answer -----------------------------------------------------------------------------------

    def solve(self, solver: Ipopt | None = None) -> QuasiStaticAnswer:
        """Solve the problem and certify the equilibrium of each point.

        Raises
        ------
        SceneError
            Bounds and constraints contradict each other.
        SolveError
            No solution was found; ``last`` is a :class:`.QuasiStaticIterate`.
        """
        solving = Solving(self.statement, solver, self._kernels)
        try:
            return self._answered(solving.solve(), solving.iterations)
        except SolveError as error:
            last = error.last
            if isinstance(last, Iterate):
                inputs, values = self._parted(last)
                outputs = self._outputs(last)
                last = QuasiStaticIterate(inputs, values, outputs, last.objective, solving.iterations)
            raise SolveError(error.status, error.detail, last) from None

    def _parted(self, iterate: Iterate) -> tuple[dict[str, Array], dict[str, Array]]:
        inputs = {name: x for name, x in iterate.values.items() if name in self._inputs}
        return inputs, {name: x for name, x in iterate.values.items() if name not in self._inputs}

    def _outputs(self, iterate: Iterate) -> dict[str, Array]:
        return {key[0]: value for key, value in iterate.asked.items()}

    def _answered(self, optimum: Optimum, iterations: int) -> QuasiStaticAnswer:
        inputs, values = self._parted(optimum.iterate)
        jumps = tuple(i for i in range(1, len(self.s)) if not self._leads(optimum, i))
        notes = list(optimum.notes)
        if jumps:
            places = ", ".join(f"{self.s[i]:.4g}" for i in jumps)
            notes.append(f"the equilibrium at s = {places} is not the one that the point before leads to")
        count = len(self.s)
        return QuasiStaticAnswer(
            s=self.s,
            inputs=inputs,
            values=values,
            outputs=self._outputs(optimum.iterate),
            objective=optimum.iterate.objective,
            cases=tuple(case.equilibrium for case in optimum.cases),
            jumps=jumps,
            multipliers=optimum.multipliers,
            notes=tuple(notes),
            iterations=iterations,
            scenes=tuple(self.statement.case_scene(i, optimum.iterate.values) for i in range(count)),
        )

    def _leads(self, optimum: Optimum, i: int) -> bool:
        """Whether the equilibrium before leads to this one: at once, or by smaller steps of all numbers."""
        here, state = optimum.cases[i].solved, optimum.cases[i - 1].solved.state
        if _arrives(state, here):
            return True
        if optimum.equations.ends:
            begin, end = optimum.numbers[i - 1 : i + 1]
            led, _ = optimum.equations.led(begin, end, state, optimum.places[i - 1])
            if led is None:
                return False
            return (
                here.prepared.distance(optimum.equations.program.equations.state(led), here.state)
                < tolerances.SAME_STATE
            )
        names = [one.name for one in optimum.equations.arguments.arguments]
        for share in SHARES:
            numbers = (1.0 - share) * optimum.numbers[i - 1] + share * optimum.numbers[i]
            scene = self.statement.scene_with(dict(zip(names, numbers.tolist(), strict=True)))
            mesh = optimum.equations.arguments.mesh_at(scene, optimum.mesh)
            prepared = prepared_case(scene, optimum.equations, mesh)
            found = prepared.correct(state, prepared.model.loading(here.factor), most=1.0)
            if not found.converged:
                return False
            state = found.state
        return here.prepared.distance(state, here.state) < tolerances.SAME_STATE


def _arrives(state: State, here: Solved) -> bool:
    found = here.prepared.correct(state, here.loading, most=1.0)
    return found.converged and here.prepared.distance(found.state, here.state) < tolerances.SAME_STATE
