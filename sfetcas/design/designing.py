"""Design and inverse problems over several load cases, with numbers of a scene as unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.records import counted
from ..description.records import unknown as not_known
from ..description.scene import Scene, check_scene
from ..description.showing import first_lines, notes_in_words, shown, values_in_words
from ..description.task import FINEST
from ..equilibria.solution import Equilibrium
from ..equilibria.statics import solve
from ..errors import SceneError, SolveError
from ..mathematics.arrays import Array
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import Ipopt
from ..mathematics.statements import Bounds
from ..parametric.arguments import Parameter
from .formulation import Cases, Formulation, labelled
from .solving import Iterate, Optimum, Solving

__all__ = ["Design", "DesignAnswer", "DesignIterate", "find"]

Outputs = Mapping[tuple[str, str, tuple[float, ...] | None], Array]
"""Answers by case, name and places."""

ONE = ""
"""The name of the case of a problem that names none."""


@dataclass(frozen=True, eq=False)
class DesignIterate:
    """The last iterate of a problem that did not converge; not a solution.

    Attributes
    ----------
    values : mapping of str to ndarray
        All unknowns, in the units of the scene; inputs of a case are called ``case: name``.
    outputs : mapping of (case, name, places) to ndarray
        The answers that expressions use.
    objective : float
    iterations : int
        Of IPOPT.
    """

    values: Mapping[str, Array]
    outputs: Outputs
    objective: float
    iterations: int


@dataclass(frozen=True, eq=False)
class DesignAnswer:
    """A design, or the solution of an inverse problem.

    Attributes
    ----------
    values : mapping of str to ndarray or float
        All unknowns, in the units of the scene; inputs of a case are called ``case: name``.
    objective : float
    cases : mapping of str to Equilibrium
        The equilibrium of each case, with its certificate.
    multipliers : mapping of str to ndarray
        Multipliers of each constraint, by its name.
    notes : tuple of str
    iterations : int
        Of IPOPT.
    """

    values: Mapping[str, Any]
    objective: float
    cases: Mapping[str, Equilibrium] = field(repr=False)
    multipliers: Mapping[str, Array] = field(repr=False)
    notes: tuple[str, ...]
    iterations: int
    outputs: Outputs = field(repr=False)
    scenes: Mapping[str, Scene] = field(repr=False)

    def __repr__(self) -> str:
        proofs = {name or "equilibrium": case.certificate.in_words for name, case in self.cases.items()}
        cases = first_lines(proofs, lambda name: f"{name}: {proofs[name]}")
        return shown(
            self,
            [f"objective={self.objective:.9g}", counted(self.iterations, "iteration")],
            [*values_in_words(self.values), *cases, *notes_in_words(self.notes)],
        )

    @property
    def stable(self) -> bool:
        """Whether all cases are certified as stable."""
        return all(case.certificate.stable is True for case in self.cases.values())

    def answers(self, case: str, name: str, at: Sequence[float] | None = None) -> Array:
        """The value of an answer that the objective or the constraints use; shapes as of :meth:`Design.answer`.

        Raises
        ------
        SceneError
            They do not use it.
        """
        key = case, name, None if at is None else tuple(at)
        if key not in self.outputs:
            known = [labelled(one, what) for one, what, _ in self.outputs]
            raise SceneError(not_known(labelled(case, name), known, "answers"), ("answers",))
        return self.outputs[key]

    def scene(self, case: str = ONE) -> Scene:
        """The scene of a case with the values found, for instance for ``solve(answer.scene("open"))``.

        Raises
        ------
        SceneError
            There is no such case.
        """
        if case not in self.scenes:
            raise SceneError(not_known(case, list(self.scenes), "cases"), ("cases",))
        return self.scenes[case]

    def replayed(self, case: str = ONE) -> float:
        """Largest distance of nodes from the equilibrium that ``solve`` finds for the case, over the size of the scene.

        Where there are several equilibria under the same loads, that may be another one.
        """
        here = self.cases[case]
        error = here.certificate.error_estimate
        there = solve(self.scene(case), accuracy=max(error, FINEST) if error else None).last
        apart = [np.linalg.norm(here.position(n) - there.position(n)) for n in self.scene(case).nodes]
        return float(max(apart)) / self.scene(case).size


class Design(Cases):
    """A design problem: numbers of a scene that minimise an objective under constraints, in several load cases.

    Parameters
    ----------
    scene : Scene
        Static; where members touch something, the same in all cases.
    variables : mapping of str to (low, high) or Parameter
        Numbers of the scene that are unknown and the same in all cases, with their bounds (possibly infinite).
    cases : mapping of str to mapping of str to numbers
        For each case the numbers that differ from the scene; left out: a single case.
    inputs : mapping of str to (low, high)
        Numbers that are unknown in each case by itself: loads, prescribed displacements.
    guess : mapping of str to numbers
        Start values of variables and inputs; by default those of the scene or the case.
    accuracy : float, optional
        Wanted error of positions over the size of the scene; by default that of the scene.
    kernels : str
        ``auto``, ``compiled`` or ``interpreted`` derivatives.

    Raises
    ------
    SceneError
        Numbers that the scene does not have, bounds that contradict each other, a scene with friction or in motion.

    Examples
    --------
    >>> design = Design(scene, variables={"sections.strip.EI3": (0.2, 5.0)})          # doctest: +SKIP
    >>> design.subject_to(design.answer("", "nodes.tip.position")[1] == 0.3)         # doctest: +SKIP
    >>> design.solve().values["sections.strip.EI3"]                                 # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        variables: Mapping[str, Bounds | Parameter] | None = None,
        cases: Mapping[str, Mapping[str, ArrayLike]] | None = None,
        *,
        inputs: Mapping[str, Bounds] | None = None,
        guess: Mapping[str, ArrayLike] | None = None,
        accuracy: float | None = None,
        kernels: Kernels = "auto",
    ) -> None:
        check_scene(scene, "Design({}, ...)", steps=False)
        cases = cases if cases is not None else {ONE: {}}
        self.statement, self._kernels = Formulation(scene, list(cases), accuracy), kernels
        self._guess = dict(guess or {})
        for case, numbers in cases.items():
            for name, value in numbers.items():
                self.set(name, value, case=case)
        for name, bounds in (variables or {}).items():
            self._vary(name, name, bounds, None, self._guess.pop(name, None))
        for name, bounds in (inputs or {}).items():
            start = self._guess.pop(name, None)
            for case in cases:
                label = labelled(case, name)
                self._vary(label, name, bounds, case, self._guess.pop(label, start))
        if self._guess:
            known = [*(variables or {}), *(inputs or {})]
            raise SceneError(not_known(next(iter(self._guess)), known, "unknowns"), ("guess",))

    def _vary(
        self, label: str, name: str, bounds: Bounds | Parameter, case: str | None, guess: ArrayLike | None
    ) -> None:
        low, high = self.statement.bounds(label, name, bounds, guess)
        known = self.statement.numbers(name)
        start = np.array(known.default, dtype=float)
        if case is not None:
            set_to = self.statement.settings[self.statement.number(case)]
            start = np.array([_number(set_to.get(n), x) for n, x in zip(known.names, start, strict=True)])
        if guess is not None:
            start = np.broadcast_to(np.asarray(guess, dtype=float), start.shape).copy()
        elif low < high:
            # A number of the scene outside of the bounds is as good a guess as the bound that is nearest.
            start = np.clip(start, low, high)
        symbol = self.statement.unknown(label, start, low, high)
        self.statement.set(name, symbol, case=case, between=(low, high))

    # -- expressions --------------------------------------------------------------------------------

    def set(
        self, name: str, value: ArrayLike | ca.MX, *, case: str | None = None, between: Bounds | None = None
    ) -> None:
        """Set a number of the scene, in one case or in all, to a value or an expression of unknowns, in its unit.

        ``design.set("sections.strip.EI3", E * b * thickness**3 / 12)``; ``between`` bounds the value.
        """
        self.statement.set(name, value, case=case, between=between)

    def variable(self, name: str, case: str | None = None) -> ca.MX:
        """An unknown by its name; of an input with its case.

        Raises
        ------
        SceneError
            There is none of this name.
        """
        return self._free(labelled(case or ONE, name))

    def answer(self, case: str, name: str, at: Sequence[float] | None = None) -> ca.MX:
        """An answer of a case by its name: ``design.answer("open", "nodes.tip.position")``.

        Parameters
        ----------
        case : name of a case, "" where there is only one
        name : as for :func:`~sfetcas.parametric`: positions, rotations, reactions, section forces, springs, energies
        at : fractions of the length, of members; by default 21 evenly spaced ones

        Returns
        -------
        casadi.MX - a column, along members a row for each place

        Raises
        ------
        SceneError
            No such case or answer.
        """
        number = self.statement.number(case)
        return self.statement.ask(name, [number], labelled(case, name), at)

    # -- the answer -----------------------------------------------------------------------------------

    def solve(self, solver: Ipopt | None = None) -> DesignAnswer:
        """Solve the problem and certify the equilibrium of each case.

        Raises
        ------
        SceneError
            Bounds and constraints contradict each other.
        SolveError
            No solution was found; ``last`` is a :class:`.DesignIterate`.
        """
        solving = Solving(self.statement, solver, self._kernels)
        try:
            return self._answered(solving.solve(), solving.iterations)
        except SolveError as error:
            last = error.last
            if isinstance(last, Iterate):
                last = DesignIterate(last.values, self._outputs(last), last.objective, solving.iterations)
            raise SolveError(error.status, error.detail, last) from None

    def _outputs(self, iterate: Iterate) -> Outputs:
        cases = self.statement.cases
        return {(cases[key[1][0]], key[0], key[2]): value for key, value in iterate.asked.items()}

    def _answered(self, optimum: Optimum, iterations: int) -> DesignAnswer:
        formulation, iterate = self.statement, optimum.iterate
        names = formulation.cases
        return DesignAnswer(
            values={n: float(x[0]) if x.shape == (1,) else x for n, x in iterate.values.items()},
            objective=iterate.objective,
            cases={name: case.equilibrium for name, case in zip(names, optimum.cases, strict=True)},
            multipliers=optimum.multipliers,
            notes=optimum.notes,
            iterations=iterations,
            outputs=self._outputs(iterate),
            scenes={name: formulation.case_scene(i, iterate.values) for i, name in enumerate(names)},
        )


def _number(setting: Any, default: float) -> float:
    return default if setting is None or isinstance(setting.value, ca.MX) else setting.value


def find(
    scene: Scene,
    unknown: Mapping[str, Bounds] | Sequence[str],
    wanted: Mapping[str, ArrayLike],
    *,
    guess: Mapping[str, ArrayLike] | None = None,
    accuracy: float | None = None,
) -> DesignAnswer:
    """Solve an inverse problem: numbers of a scene for which answers have wanted values.

    ``find(scene, ["loads.tip.value"], {"nodes.tip.position": [0.8, 0.3]})``: the force for a tip position.

    Parameters
    ----------
    unknown : names of numbers, or a mapping of them to bounds
    wanted : values of answers by name, SI units; of vectors in a plane scene two components
    guess, accuracy : as of :class:`Design`

    Raises
    ------
    SceneError
        No such numbers or answers, or not as many wanted as unknown.
    SolveError
        There are no such numbers.
    """
    check_scene(scene, "find({}, ...)", steps=False)
    free = (-np.inf, np.inf)
    bounds = unknown if isinstance(unknown, Mapping) else dict.fromkeys(unknown, free)
    design = Design(scene, bounds, guess=guess, accuracy=accuracy)
    count = 0
    for name, value in wanted.items():
        expression = design.answer(ONE, name)
        try:
            values = np.atleast_1d(np.asarray(value, dtype=float)).ravel()
        except (TypeError, ValueError):
            raise SceneError(f"found {value!r}, accepted: numbers", ("wanted", name)) from None
        flat = ca.vec(expression)
        if scene.resolved_dimension == "plane" and flat.numel() == 3 and len(values) == 2:
            flat = flat[:2]
        if flat.numel() != len(values):
            message = f"found {len(values)} numbers, accepted: {flat.numel()}"
            raise SceneError(message, ("wanted", name))
        design.subject_to(flat == ca.DM(values), name=name)
        count += len(values)
    most = sum(len(design.statement.numbers(name).default) for name in bounds)
    if most > count:
        accepted = "as many, or a Design, which makes something least"
        raise SceneError(f"found {most} free numbers for {count} that are wanted, accepted: {accepted}", ("unknown",))
    return design.solve()
