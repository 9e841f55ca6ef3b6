"""Solution of a formulation: all equilibria at once by IPOPT, in rounds that refine meshes and ensure stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from .. import tolerances
from ..contact.kept import Kept
from ..description.records import counted
from ..equilibria.settings import Settings
from ..equilibria.single import solved_from
from ..equilibria.solution import touched_notes
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import NLP, Ipopt, NLPResult
from ..mathematics.threads import single_threaded
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh
from ..parametric.equilibrium import asked_mesh, in_contact, kept_of, what_touches
from ..solvers.continuation import advanced
from ..solvers.prepared import Solved
from .assembled import REQUIRED, Assembled, Pair, places_asked
from .bounds import refuse_contradictions
from .certifying import Certified, certified
from .equations import CaseEquations
from .formulation import Formulation, labelled

__all__ = ["Iterate", "Optimum", "Solving"]

ROUNDS = 6
"""Meshes, references and sets of eigenvalues that are tried one after the other."""

TURN = 0.5
"""Rotation of a node, rad, in one step of the way at most: a step that turns more may have left its branch."""

FAR = 1.0
"""Rotation from a reference, rad, beyond which the next step of the way begins from another one."""

FIRST, LEAST = 0.2, 1e-3
"""Share of the way from the guess in the first step, and in the last one before giving up."""

SHORT = 60
"""Iterations at most from one step to the next."""

ENOUGH = {"acceptable_tol": 1e-7, "acceptable_constr_viol_tol": 1e-9, "acceptable_iter": 5}
"""Of objectives rounding leaves less than of rows."""

WARM = {"mu_init": 1e-4, "bound_push": 1e-6, "bound_frac": 1e-6, "warm_start_init_point": "yes"}
"""IPOPT begun near a solution."""

PILOTS = 5
"""Cases that are solved from the undeformed state, spread over all; the others follow from their neighbours."""

ELSEWHERE = 1e-2
"""Distance of nodes, over the size, from which on an equilibrium is another one."""

VIOLATED = 1e-6
"""Rows that miss by less, in their units, are not named."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of a program.

    Attributes
    ----------
    values : mapping of str to ndarray
        All unknowns by their names, in their units.
    asked : mapping
        Answers in the shapes of their symbols.
    states : ndarray (cases, states)
    objective : float
    message : str
        Return status of IPOPT.
    iterations : int
    """

    values: Mapping[str, Array]
    asked: Mapping[Any, Array]
    states: Array
    objective: float
    message: str
    iterations: int


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solution of a formulation.

    Attributes
    ----------
    iterate : Iterate
    cases : tuple of Certified
    multipliers : mapping of str to ndarray
        Multipliers of the constraints: decrease of the objective where an upper bound is raised by one unit.
    notes : tuple of str
    mesh : Mesh
    equations : CaseEquations
    numbers : ndarray (cases, numbers)
    places : ndarray (cases, ends)
        Where lines on obstacles end, fractions of the lengths of their members.
    """

    iterate: Iterate
    cases: tuple[Certified, ...]
    multipliers: Mapping[str, Array]
    notes: tuple[str, ...]
    mesh: Mesh
    equations: CaseEquations
    numbers: Array
    places: Array


@dataclass(frozen=True, eq=False)
class _Along:
    """A solution on the way from the guess: its share of the way, unknowns, constants and multipliers."""

    share: float
    x: Array
    p: Array
    lam: Array | None = None
    result: NLPResult | None = None


class Solving:
    """The solution of one formulation, in rounds.

    Parameters
    ----------
    formulation : Formulation
    solver : Ipopt
    kernels : str
    """

    def __init__(self, formulation: Formulation, solver: Ipopt | None = None, kernels: Kernels = "auto") -> None:
        self.formulation, self._kernels = formulation, kernels
        self._solver = solver or Ipopt(tolerance=1e-11, iterations=300, extra=ENOUGH)
        self.iterations = 0
        self._meshes: list[Mesh] = []
        self._found: dict[int, Solved] = {}

    # -- the beginning ------------------------------------------------------------------------------

    def _pilots(self, values: Mapping[str, Array], *, apart: bool = False) -> dict[int, Solved]:
        """Equilibria of some cases for values of the unknowns; along lines that of the first one.

        ``apart`` leaves out what touches.

        Raises
        ------
        SceneError
            A case has no equilibrium.
        SolveError
            In one case something else touches than in another.
        """
        settings, chosen = Settings(accuracy=self.formulation.accuracy), self._chosen
        found: dict[int, Solved] = {}
        self._meshes = []
        for i in chosen:
            scene = self._scene(i, values)
            scene = scene.model_copy(update={"contacts": {}}) if apart else scene
            try:
                mesh, self._assembly, answer = asked_mesh(scene, settings, lines=True)
            except SceneError as error:
                raise SceneError(labelled(self.formulation.cases[i], str(error)), ("guess",)) from None
            found[i] = solved_from(answer)
            self._meshes.append(mesh)
            if what_touches(mesh) != what_touches(self._meshes[0]):
                names = " and ".join(labelled(self.formulation.cases[k], "").rstrip(": ") for k in (chosen[0], i))
                detail = f"something else touches in the cases {names}, accepted: the same in all cases"
                raise SolveError(Status.FAILED, detail)
        if self._meshes[0].lies:
            # What stands for a line is another number of points in each case; elements follow where it ends.
            self._meshes, found = self._meshes[:1], {0: found[0]}
        return found

    def _scene(self, case: int, values: Mapping[str, Array]) -> Any:
        try:
            return self.formulation.case_scene(case, values)
        except SceneError as error:
            raise SceneError(labelled(self.formulation.cases[case], str(error))) from None

    def _equations(self, mesh: Mesh) -> CaseEquations:
        arguments, unknown = self.formulation.varying()
        names, places = places_asked(self.formulation)
        free = np.flatnonzero(unknown).tolist()
        for name in sorted({point.members[0] for point in mesh.line_ends} & places.keys()):
            message = "found an answer along a member that lies along an obstacle"
            raise SceneError(
                f"{message}, accepted: answers of nodes, reactions and contacts beside it", ("members", name)
            )
        return CaseEquations(self.formulation.scene, mesh, self._assembly, arguments, free, names, places)

    def _begun(
        self, equations: CaseEquations, pilots: Mapping[int, Solved], values: Mapping[str, Array]
    ) -> tuple[Array, Array]:
        """Equilibria for values of the unknowns, those without a pilot from the case before, and where lines end."""
        formulation, program = self.formulation, equations.program
        names = [one.name for one in equations.arguments.arguments]
        states, ends, every = list[Array](), [equations.arguments.places], list[Array]()
        for i, case in enumerate(formulation.cases):
            own = formulation.numbers_of(i, values)
            defaults = equations.arguments.defaults
            every.append(np.array([own.get(name, x) for name, x in zip(names, defaults, strict=True)]))
            found, places = None, ends[-1]
            if i in pilots:
                found, places = equations.fitted(every[i], self._start(i, values, pilots[i], equations), places)
            if found is None and states:
                found, places = equations.led(every[-2], every[-1], program.equations.state(states[-1]), ends[-1])
            if found is None:
                detail = labelled(case, "no equilibrium was found at the guess, accepted: a guess that has one")
                raise SolveError(Status.FAILED, detail)
            states.append(found)
            ends.append(places)
        return np.stack(states), np.stack(ends[1:])

    def _start(self, case: int, values: Mapping[str, Array], pilot: Solved, equations: CaseEquations) -> State:
        """A pilot as a state of the equations."""
        if not equations.mesh.points:
            return transferred(pilot.model, pilot.state, equations.model)
        return in_contact(self._kept(case, values, pilot), equations.model)

    def _kept(self, case: int, values: Mapping[str, Array], found: Solved) -> Kept:
        """What touches in a state of a case."""
        return kept_of(self._scene(case, values), Settings(accuracy=self.formulation.accuracy), found)

    # -- rounds -------------------------------------------------------------------------------------

    @single_threaded
    def solve(self) -> Optimum:
        """Solve the formulation; where something else touches in the solution, again with that, from there.

        Raises
        ------
        SceneError
            Constraints contradict each other, or are more than there are unknowns.
        SolveError
            No solution was found; ``last`` is the last :class:`Iterate`.
        """
        refuse_contradictions(self.formulation)
        values: Mapping[str, Array] = self.formulation.guesses
        pilots, tried, lost = self._pilots(values), list[Any](), None
        while True:
            try:
                optimum, error = self._solved(values, pilots)
            except SolveError as failed:
                # What touches at the guess may be what cannot be met: all of it is let go, once.
                if lost is not None or tried or not what_touches(self._meshes[0]):
                    raise lost or failed from None
                lost = failed
                try:
                    pilots = self._pilots(values, apart=True)
                except SceneError:
                    # It rests only as something stops it.
                    raise lost from None
                continue
            changed, values = self._changed(optimum), optimum.iterate.values
            if not changed and error <= self.formulation.accuracy:
                changed = self._elsewhere(optimum)
                if not changed:
                    return optimum
            tried.append(what_touches(optimum.mesh))
            pilots = self._pilots(values)
            if what_touches(self._meshes[0]) in tried:
                detail = (
                    "what touches does not settle, as where a solution is just where something begins to touch: "
                    f"{changed or 'statics finds something else'}"
                )
                raise SolveError(Status.FAILED, f"{detail}, in the solution for another touch", optimum.iterate)

    def _changed(self, optimum: Optimum) -> str:
        """What touches otherwise in a solution than it was found for, as a sentence; empty where nothing does."""
        for i, case in enumerate(optimum.cases if self.formulation.scene.contacts else ()):
            for what in self._kept(i, optimum.iterate.values, case.solved).changed():
                return labelled(self.formulation.cases[i], what)
        return ""

    def _elsewhere(self, optimum: Optimum) -> str:
        """Where the loads growing from zero lead to another equilibrium than that of a solution, as on the other side
        of an obstacle, in words; empty where they do not, or where nothing may touch.
        """
        settings = Settings(accuracy=self.formulation.accuracy)
        for i in self._chosen if self.formulation.scene.contacts else ():
            scene, here = self._scene(i, optimum.iterate.values), optimum.cases[i].solved.fields
            try:
                there = asked_mesh(scene, settings, lines=True)[2].fields
            except SceneError:
                continue
            apart = max(float(np.linalg.norm(here.position(node) - there.position(node))) for node in scene.nodes)
            if apart > ELSEWHERE * scene.size:
                what = "the loads growing from zero lead to another equilibrium"
                return labelled(self.formulation.cases[i], f"{what}, {apart:.3g} m away")
        return ""

    @property
    def _chosen(self) -> list[int]:
        """Numbers of the cases that are looked at by statics."""
        count = len(self.formulation.cases)
        return sorted({round(x) for x in np.linspace(0, count - 1, min(PILOTS, count))})

    def _solved(self, values: Mapping[str, Array], pilots: dict[int, Solved]) -> tuple[Optimum, float]:
        """The solution with what touches in pilots for values of the unknowns, from these, and its error; where
        something else touches there the error may be larger than it was asked for.
        """
        mesh = _united(self._meshes)
        equations = self._equations(mesh)
        states, places = self._begun(equations, pilots, values)
        pairs: list[Pair] = []
        for rounds in range(ROUNDS):
            program = Assembled(self.formulation, equations, states, places, values, pairs, self._kernels)
            self._refuse_too_many(program)
            result, cases = self._best(program)
            states, values, places = program.arrived(result.x), program.values(result.x), program.places(result.x)
            error = max(case.error for case in cases)
            if error > self.formulation.accuracy:
                fitted = self._fitted(values) if mesh.points and not (rounds or mesh.lies) else None
                if fitted and what_touches(fitted) != what_touches(mesh):
                    return self._answer(program, result, cases), error
                halved = self._halved(values, cases[0]) if mesh.lies else None
                mesh = fitted or halved or mesh.refined()
                finer = self._equations(mesh)
                if fitted or halved:
                    states, places = self._begun(finer, self._found, values)
                else:
                    states = _onto(equations, finer, states)
                equations, pairs = finer, []
                continue
            more = self._unstable(cases, program, result, pairs)
            if not more:
                return self._answer(program, result, cases), error
            pairs = more
        if error > self.formulation.accuracy:
            detail = f"positions differ by {error:.1e} on half the elements after {counted(ROUNDS, 'mesh', 'meshes')}"
            raise SolveError(Status.FAILED, detail, self._iterate(program, result))
        cases_kept = dict.fromkeys(self.formulation.cases[pair.case] for pair in pairs)
        detail = labelled(", ".join(cases_kept), "cannot be kept stable")
        raise SolveError(Status.UNMET, detail, self._iterate(program, result))

    def _fitted(self, values: Mapping[str, Array]) -> Mesh:
        """A mesh in which elements end where places touch for values of the unknowns."""
        self._found = self._pilots(values)
        return _united(self._meshes)

    def _halved(self, values: Mapping[str, Array], case: Certified) -> Mesh | None:
        """A mesh of half as long elements with what touches in the first case there; None where that is lost."""
        finer = self._kept(0, values, case.solved).halved()
        if finer is None:
            return None
        self._found = {0: finer}
        return self._kept(0, values, finer).mesh

    def _refuse_too_many(self, program: Assembled) -> None:
        free, rows = program.freedom
        if rows > free:
            found = f"found {counted(rows, 'equation')} for {counted(free, 'free number')}"
            raise SceneError(f"{found}, accepted: no more equations than free numbers, or their squares minimised")

    def _best(self, program: Assembled) -> tuple[NLPResult, list[Certified]]:
        """The solution in one go; step by step from the guess where that fails or leads to what is unstable.

        Under the same loads there may be several equilibria: a program takes any, a path of small steps the one that
        the guess belongs to.
        """
        nlp = program.nlp()
        method = self._solver.prepare(nlp)
        rows = ca.Function("rows", [nlp.x, nlp.p], [nlp.g])
        result = method()
        self.iterations += result.iterations
        if result.status is Status.SOLVED:
            cases = self._certified(program, result)
            if self.formulation.margin is not None or not _unstable(cases):
                return result, cases
        begun = program.states
        followed = self._followed(program, nlp, rows)
        if followed is not None:
            along = self._certified(program, followed)
            if result.status is not Status.SOLVED or _unstable(along) < _unstable(cases):
                return followed, along
        program.recentre(begun)
        if result.status is not Status.SOLVED:
            lines = np.array(rows(result.x, nlp.p_value)).ravel()
            self._refuse(program, result, np.maximum(lines - nlp.upper, nlp.lower - lines))
        return result, cases

    def _followed(self, program: Assembled, nlp: NLP, rows: ca.Function) -> NLPResult | None:
        """The solution along programs whose bounds go from what the guess fulfils to what is asked for."""
        method = replace(self._solver, iterations=SHORT, extra={**self._solver.extra, **WARM}).prepare(nlp)
        first = np.array(rows(nlp.guess, nlp.p_value)).ravel()
        missed = np.clip(first, nlp.lower, nlp.upper) - first

        def trial(here: _Along, step: float) -> tuple[_Along | None, float]:
            share = min(1.0, here.share + step)
            rest = (1.0 - share) * missed
            result = method(p=here.p, guess=here.x, lam=here.lam, lower=nlp.lower - rest, upper=nlp.upper - rest)
            self.iterations += result.iterations
            if result.status is not Status.SOLVED or program.turned(here.x, result.x) > TURN:
                return None, 0.5 * step
            x, p = result.x, here.p
            if share < 1.0 and program.turned(nlp.guess, x) > FAR:
                x, p = program.recentred(x), program.pieces.constants()
            return _Along(share, x, p, result.lam, result), 1.5 * step

        begin = _Along(0.0, nlp.guess, nlp.p_value)
        there, arrived = advanced(begin, FIRST, trial, lambda here: here.share == 1.0, shortest=LEAST)
        return there.result if arrived else None

    def _refuse(self, program: Assembled, result: NLPResult, missed: Array) -> None:
        """Say what could not be met.

        Raises
        ------
        SolveError
            Always.
        """
        found = zip(missed.tolist(), program.pieces.row_owners(), strict=True)
        # What was asked for by name comes first: what answers miss follows from it.
        named = sorted((not piece.startswith(REQUIRED), -x, label) for x, (piece, label) in found if not x <= VIOLATED)
        worst = list(dict.fromkeys(label.removeprefix(REQUIRED) for _, _, label in named))[:3]
        last = self._iterate(program, result)
        status = Status.UNMET if result.status is Status.INFEASIBLE else result.status
        detail = f"IPOPT: {result.message} after {counted(result.iterations, 'iteration')}"
        if worst:
            detail = f"most is missed at {'; '.join(worst)}; {detail}"
        raise SolveError(status, detail, last)

    def _certified(self, program: Assembled, result: NLPResult) -> list[Certified]:
        equations, found = program.equations, []
        states, values, places = program.arrived(result.x), program.values(result.x), program.places(result.x)
        for i, case in enumerate(self.formulation.cases):
            state, scene = equations.program.equations.state(states[i]), self._scene(i, values)
            try:
                found.append(certified(scene, equations, state, case, places[i], self.formulation.accuracy))
            except SolveError as error:
                raise SolveError(error.status, error.detail, self._iterate(program, result)) from None
        return found

    # -- stability ------------------------------------------------------------------------------------

    def _unstable(
        self, cases: Sequence[Certified], program: Assembled, result: NLPResult, pairs: Sequence[Pair]
    ) -> list[Pair]:
        """Eigenvalues to keep above the margin: those kept up to now, and those found below; none where all are."""
        if self.formulation.margin is None:
            return []
        margin = self.formulation.margin / program.equations.scales.force
        new = []
        for i, case in enumerate(cases):
            if case.equilibrium.certificate.stable == "not defined":
                message = "found a margin of stability, accepted: none, as its loads have no potential"
                raise SceneError(message, ("stable", self.formulation.cases[i]))
            if case.solved.stability.smallest < margin - VIOLATED * max(margin, 1.0):
                new.append(self._pair(i, case, program, margin))
        if not new:
            return []
        kept = (
            [
                replace(pair, shape=shape, value=float(value))
                for pair, shape, value in zip(
                    pairs, program.shapes(result.x), program.eigenvalues(result.x), strict=True
                )
            ]
            if pairs
            else []
        )
        return [*kept, *new]

    @staticmethod
    def _pair(number: int, case: Certified, program: Assembled, margin: float) -> Pair:
        mass, stability = program.equations.mass, case.solved.stability
        mode, shape = np.concatenate([stability.shape, stability.travel]), np.zeros(len(mass))
        shape[: len(mode)] = mode
        shape /= np.sqrt(shape @ (mass * shape))
        return Pair(number, shape, stability.smallest, margin)

    # -- the answer -----------------------------------------------------------------------------------

    def _iterate(self, program: Assembled, result: NLPResult) -> Iterate:
        answers = {
            key: program.pieces.value(program.pieces.blocks[f"answer {i}"], result.x)
            for i, key in enumerate(self.formulation.asked)
        }
        return Iterate(
            values=program.values(result.x),
            asked=answers,
            states=program.arrived(result.x),
            objective=result.f / program.weight,
            message=result.message,
            iterations=self.iterations,
        )

    def _answer(self, program: Assembled, result: NLPResult, cases: Sequence[Certified]) -> Optimum:
        multipliers: dict[str, Array] = {}
        pieces = np.array([piece for piece, _ in program.pieces.row_owners()])
        for one in self.formulation.required:
            kept, unit = program.lines[one.name]
            found = np.zeros(len(one.relation.low))
            found[kept] = result.lam[pieces == REQUIRED + one.name] / unit / program.weight
            multipliers[one.name] = found
        unstable = [self.formulation.cases[i] for i, c in enumerate(cases) if c.equilibrium.certificate.stable is False]
        listed = [*unstable[:3], *([counted(len(unstable) - 3, "other", "others")] if unstable[3:] else [])]
        notes = [labelled(", ".join(listed), "unstable")] if unstable else []
        return Optimum(
            iterate=self._iterate(program, result),
            cases=tuple(cases),
            multipliers=multipliers,
            notes=(*touched_notes(self.formulation.scene), *notes),
            mesh=program.equations.mesh,
            equations=program.equations,
            numbers=program.numbers(result.x),
            places=program.places(result.x),
        )


def _unstable(cases: Sequence[Certified]) -> int:
    """How many cases are unstable."""
    return sum(case.equilibrium.certificate.stable is False for case in cases)


def _united(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh with the cuts of all."""
    first = max(meshes, key=lambda mesh: mesh.elements)
    cuts = {}
    for name in first.cuts:
        every = np.unique(np.concatenate([mesh.cuts[name] for mesh in meshes]))
        cuts[name] = every[np.append(True, np.diff(every) > tolerances.DECIMAL)]
    return replace(first, cuts=cuts)


def _onto(coarse: CaseEquations, fine: CaseEquations, states: Array) -> Array:
    """States on another mesh."""
    source = coarse.program.equations
    return np.stack([transferred(coarse.model, source.state(flat), fine.model).flat for flat in states])
