"""Optimal control of the motion of a scene: controls, costs, path constraints and end constraints."""

from __future__ import annotations

import copy
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.scene import Scene, check_scene
from ..equilibria.settings import Settings
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.nlp import NLP, Ipopt, NLPResult
from ..mathematics.statements import Bounds, Problem, bounds_of
from ..mathematics.threads import single_threaded
from ..mechanics.mesh import Mesh
from ..parametric.arguments import Parameter
from ..parametric.equilibrium import Place
from .controlled import ControlledSystem
from .controlled_motion import Check, ControlledMotion
from .statement import MotionStatement, controls_of, variable_of
from .transcription import GridMotion, Transcription
from .warm import at_rest, carried_over, restaged, rigid, straight

__all__ = ["OptimalControl", "moving"]


class OptimalControl(Problem):
    """An optimal control problem for the motion of a scene.

    Symbols of controls and answers, as :meth:`control` and :meth:`answer` give them, stand for functions of time.

    Parameters
    ----------
    scene : Scene
        Its initial state is that of its ``analysis``: undeformed, or in the equilibrium of its loads.
    controls : mapping of str to (low, high)
        Numbers of the scene that change with time, and their bounds: a component of the value of a load, as
        ``loads.motor.value`` or ``loads.tip.value.1``, or ``histories.NAME`` of a load.
    time : float or (float, float)
        End time, s, or its bounds.
    intervals : int or sequence of float
        Number of intervals, or their fractions of the time.
    order : int
        Controls in an interval: 1 linear and continuous, 0 constant with jumps.
    rates : mapping of str to float
        Largest rates of controls, in their unit per s.
    variables : mapping of str to (low, high) or Parameter
        Unknown numbers of the scene that are constant in time, with bounds: stiffness, loads, not masses.
    stages : int
        Stages of Radau IIA collocation in an interval: 3 (order 5) or 2 (order 3).
    places : mapping of str to sequence of float
        Fractions of the length at which answers along members are given.
    settings : Settings
        Accuracy or elements of the mesh.

    Raises
    ------
    SceneError
        The scene has no such numbers, they cannot be controlled, or arguments contradict each other.

    Examples
    --------
    >>> problem = OptimalControl(scene, {"loads.motor.value": (-5.0, 5.0)}, time=2.0)       # doctest: +SKIP
    >>> torque, angle = problem.control("loads.motor.value"), problem.answer("nodes.hub.angle")  # doctest: +SKIP
    >>> problem.minimise(problem.integral(torque**2))                                     # doctest: +SKIP
    >>> problem.subject_to(problem.at_tf(angle) == 1.57)                                  # doctest: +SKIP
    >>> problem.rest_at_end()                                                             # doctest: +SKIP
    >>> motion = problem.solve()                                                          # doctest: +SKIP
    >>> motion.check.difference, motion.check.residual_vibration                          # doctest: +SKIP
    """

    statement: MotionStatement

    def __init__(
        self,
        scene: Scene,
        controls: Mapping[str, tuple[float, float]],
        *,
        time: float | tuple[float, float],
        intervals: int | Sequence[float] = 60,
        order: Literal[0, 1] = 1,
        rates: Mapping[str, float] | None = None,
        variables: Mapping[str, Bounds | Parameter] | None = None,
        stages: Literal[2, 3] = 3,
        places: Place | None = None,
        settings: Settings | None = None,
    ) -> None:
        check_scene(scene, "OptimalControl({}, ...)", steps=False)
        duration = _duration(time)
        known = [variable_of(name, given) for name, given in (variables or {}).items()]
        if not controls and not known:
            raise SceneError("controls: found none, accepted: at least one number that changes the motion")
        if order not in (0, 1) or stages not in (2, 3):
            raise SceneError(f"found order {order} and {stages} stages, accepted: order 0 or 1, 2 or 3 stages")
        if order == 0 and rates:
            raise SceneError("rates: found rates of controls that jump, accepted: order = 1 with rates")
        self.statement = MotionStatement(
            controls_of(controls, rates or {}), known, duration, _shares(intervals), order, stages
        )
        self._settings, self._places = settings or Settings(), places or {}
        end = duration[1] if np.isfinite(duration[1]) else max(2.0 * duration[0], 1.0)
        self.scene = moving(scene, end)
        # A mesh of its own for all that follows; it also says how many numbers answers have.
        self._plain = self._system(self.scene, [])
        self._mesh: Mesh = self._plain.model.mesh

    def _system(self, scene: Scene, answers: Sequence[str], mesh: Mesh | None = None) -> ControlledSystem:
        s = self.statement
        return ControlledSystem(scene, s.controls, s.variables, answers, self._places, self._settings, mesh)

    # -- what a problem is made of ------------------------------------------------------------------------

    def control(self, name: str) -> ca.MX:
        """The symbol of a control, in its unit, as a function of time; SceneError if there is no such control."""
        self.statement.control(name)
        return self.statement.signal("control", name).along

    def rate(self, name: str) -> ca.MX:
        """The symbol of the rate of a control, in its unit per s; SceneError if controls jump (order 0)."""
        self.statement.control(name)
        if not self.statement.order:
            raise SceneError(f"rate of {name!r}: found controls that jump, accepted: order = 1")
        return self.statement.signal("rate", name).along

    def variable(self, name: str) -> ca.MX:
        """The symbol of a variable, in its unit; SceneError if there is none of this name."""
        known = self.statement.constants
        if name not in known:
            raise SceneError(f"variable {name!r}: accepted: {', '.join(known) or 'none, as there are none'}")
        return known[name]

    def answer(self, name: str) -> ca.MX:
        """The symbol of an answer as a function of time: ``nodes.tip.position`` (3,), ``energy.elastic``; SI units.

        A vector along a member is (places, 3).
        """
        result = self._plain.result(name)
        picked = self._plain.picked_of(result)
        own = self.statement.signal("answer", name, len(picked)).along
        whole = ca.MX(ca.Sparsity.dense(result.size, 1), 0.0)
        for k, i in enumerate(picked.tolist()):
            whole[i] = own[k]
        if len(result.shape) == 2:
            return ca.reshape(whole, result.shape[1], result.shape[0]).T
        return whole

    @property
    def t(self) -> ca.MX:
        """The symbol of time, s, as a function of time."""
        return self.statement.signal("time", "t").along

    @property
    def time(self) -> ca.MX:
        """The symbol of the end time, s."""
        return self.statement.end_time

    def at_t0(self, expression: ca.MX) -> ca.MX:
        """The value of an expression at the begin."""
        return self.statement.at(expression, "begin")

    def at_tf(self, expression: ca.MX) -> ca.MX:
        """The value of an expression at the end."""
        return self.statement.at(expression, "end")

    def integral(self, expression: ca.MX) -> ca.MX:
        """The integral of an expression over the time."""
        return self.statement.integral(expression)

    def rest_at_end(self) -> dict[str, ca.MX]:
        """Require rest at the end: zero velocity, and equilibrium under constant controls; returns their symbols.

        Vibrations too fast for the intervals are excepted; the replay shows what remains of them.

        Raises
        ------
        SceneError
            A member relaxes, which comes to rest only in infinite time.
        """
        if self.scene.relaxes:
            message = "rest_at_end: found members that relax, which come to rest in infinite time only"
            raise SceneError(f"{message}, accepted: conditions at the end for what is wanted there")
        self.statement.resting = True
        for one in self.statement.controls:
            self.statement.rest(one.name)
        return dict(self.statement.rests)

    # -- solution -----------------------------------------------------------------------------------------

    @single_threaded
    def solve(
        self,
        *,
        guess: Literal["rigid", "rest"] | ControlledMotion = "rigid",
        time: float | None = None,
        values: Mapping[str, ArrayLike] | None = None,
        replay: bool = True,
        ipopt: Ipopt | None = None,
    ) -> ControlledMotion:
        """Find a locally optimal motion.

        Parameters
        ----------
        guess : start: ``rigid``, the solution for the scene with rigid members, which is found first; ``rest``, the
            scene at rest; or an earlier solution
        time : start value of the end time, s
        values : start values of controls, at evenly spaced times, and of variables
        replay : check the solution by a replay
        ipopt : settings of IPOPT

        Raises
        ------
        SceneError
            The problem contradicts itself.
        SolveError
            IPOPT did not succeed; the message says what is violated, ``last`` is the last iterate.
        """
        solver = ipopt or Ipopt(1e-8, 150)
        solver = replace(solver, extra={**EXTRA, **solver.extra})
        names = [signal.name for signal in self.statement.signals.values() if signal.kind == "answer"]
        run = Search(self, solver, names)
        course = run.begun(guess, time, values or {})
        found = run.solved(self.scene, course)
        if replay:
            begin = clock.perf_counter()
            check = found.replayed()
            found = replace(found, check=check, seconds={**found.seconds, "replay": clock.perf_counter() - begin})
            notes = list(_short_of(check, self.scene.size, self.statement))
            if notes:
                found = replace(found, status=Status.SHORT, notes=(*found.notes, *notes))
        return found


EXTRA = {
    "mumps_pivot_order": 5,
    "mumps_pivtol": 1e-2,
    "perturb_always_cd": "yes",
    "dual_inf_tol": 1e-6,
}
"""Options of IPOPT (measured): nested dissection leaves half the fill of MUMPS' own choice on these chains, and larger
pivots keep the signs right that IPOPT counts: 5 iterations in the place of 24.

Rows that nearly depend on each other, as those of rest at the end of a straight arm in space, are always made slightly
soft: otherwise rounding decides whether they are.  Beside such rows IPOPT reported success at a large dual
infeasibility under one BLAS kernel; softness with a bound of that cured it (measured, not explained)."""

FAR = 1e-2
"""Distance of a replay over the size of the scene beyond which an answer is told to be short of what was asked."""

BROKEN = ("Error_In_Step_Computation", "Restoration_Failed", "Search_Direction_Becomes_Too_Small")
"""Messages of IPOPT after steps that regularisation has made nothing of: rounding had turned signs of pivots."""

UNCOUNTED = {"neg_curv_test_tol": 1e-11, "neg_curv_test_reg": "no"}
"""Options by which IPOPT judges curvature along its step, in the place of signs of pivots."""

ROUNDS = 4
"""Programs at most, each about the answer of the one before, until that stands."""

TURNED = 1.0
"""Rotations from the reference, rad, beyond which a program is made again about its answer."""

MOVED = 0.2
"""Rotations of the end since the guess, rad, beyond which its shapes of vibration are made again."""


@dataclass
class Search:
    """One solution process of an optimal control problem."""

    problem: OptimalControl
    solver: Ipopt
    names: list[str]

    def __post_init__(self) -> None:
        self.seconds = {"warm start": 0.0, "build": 0.0, "solve": 0.0}
        self.iterations = 0
        self.notes: list[str] = []

    # -- where it begins ----------------------------------------------------------------------------------

    def begun(self, guess: Any, end: float | None, values: Mapping[str, ArrayLike]) -> GridMotion:
        """The start of the search on the mesh of the scene; SceneError for a wrong guess or wrong values."""
        begin, problem = clock.perf_counter(), self.problem
        statement = problem.statement
        if isinstance(guess, ControlledMotion):
            course = guess.course
            if course.d.shape != (len(statement.shares) * statement.stages, problem._plain.total):
                raise SceneError("guess: found another grid or mesh, accepted: an answer of the same")
            return course
        if guess not in ("rigid", "rest"):
            raise SceneError(f"guess: found {guess!r}, accepted: 'rigid', 'rest', or an answer")
        end = _clipped(statement.duration, end)
        found = self._rigid(end, values) if guess == "rigid" else None
        self.seconds["warm start"] = clock.perf_counter() - begin
        if found is not None:
            return found
        rest = at_rest(statement, problem._plain, end, values)
        # What cannot move rigidly may still turn to what is asked.
        if guess == "rest":
            return rest
        return straight(statement, problem._system(problem.scene, self.names, problem._mesh), rest)

    def _rigid(self, end: float, values: Mapping[str, ArrayLike]) -> GridMotion | None:
        """The motion of the rigid scene, if it has one; where all is rigid, where its search would begin."""
        problem, statement = self.problem, self.problem.statement
        try:
            scene = rigid(problem.scene)
            if scene is None:
                own = problem._system(problem.scene, self.names, problem._mesh)
                return straight(statement, own, at_rest(statement, own, end, values))
            stiff = problem._system(scene, self.names)
            start = straight(statement, stiff, at_rest(statement, stiff, end, values))
            transcription = Transcription(statement, stiff, start)
            nlp = transcription.pieces.nlp()
            result = self.solver.solve(nlp)
        except SceneError as error:
            self.notes.append(f"the search does not begin with the rigid scene: {error}")
            return None
        if result.status is not Status.SOLVED:
            self.notes.append("the search does not begin with the rigid scene, of which no motion was found")
            return None
        return carried_over(statement, stiff, transcription.course(result.x), problem._plain)

    # -- rounds -------------------------------------------------------------------------------------------

    def solved(self, scene: Scene, course: GridMotion) -> ControlledMotion:
        """The solution, in rounds about the solution before until it no longer changes; SolveError if IPOPT fails."""
        problem = self.problem
        system = problem._system(scene, self.names, problem._mesh)
        for number in range(ROUNDS):
            transcription, nlp, result = self._searched(problem.statement, system, course)
            if number == 0 and problem.statement.stages > 2 and result.status in (Status.ITERATIONS, Status.FAILED):
                course = self._by_fewer_stages(system, course) or transcription.course(result.x)
                transcription, nlp, result = self._searched(problem.statement, system, course)
            found = self._motion(transcription, result)
            if result.status is not Status.SOLVED:
                status = Status.UNMET if result.status is Status.INFEASIBLE else result.status
                raise SolveError(status, _why(transcription, nlp, result, problem.statement), found)
            if self._stands(transcription, found.course) or number == ROUNDS - 1:
                break
            course = found.course
        return found

    def _searched(
        self, statement: MotionStatement, system: ControlledSystem, course: GridMotion
    ) -> tuple[Transcription, NLP, NLPResult]:
        """One program about a course, solved."""
        begin = clock.perf_counter()
        transcription = Transcription(statement, system, course)
        nlp = transcription.pieces.nlp()
        solve = self.solver.prepare(nlp)
        built = clock.perf_counter()
        result = solve()
        self.iterations += result.iterations
        if any(word in result.message for word in BROKEN):
            self.notes.append("IPOPT broke off, and began again without counting signs of pivots")
            extra = {**self.solver.extra, **UNCOUNTED}
            result = replace(self.solver, extra=extra).solve(nlp)
            self.iterations += result.iterations
        self.seconds["build"] += built - begin
        self.seconds["solve"] += clock.perf_counter() - built
        return transcription, nlp, result

    def _by_fewer_stages(self, system: ControlledSystem, course: GridMotion) -> GridMotion | None:
        """The motion of two stages in an interval, which is found more easily, at the stages that are asked for."""
        statement = self.problem.statement
        coarse = copy.copy(statement)
        coarse.stages = 2
        transcription, _, result = self._searched(coarse, system, restaged(coarse, system, course, statement.stages))
        if result.status is not Status.SOLVED:
            return None
        self.notes.append("the search began again with the motion of two stages in an interval")
        return restaged(statement, system, transcription.course(result.x), 2)

    def _stands(self, transcription: Transcription, after: GridMotion) -> bool:
        """Whether rotations are near what they are counted from, and the end is where its shapes are known."""
        rotation_unknowns = transcription.system.system.equations.rotation_unknowns
        turned = float(np.abs(after.d[:, :rotation_unknowns]).max(initial=0.0))
        if transcription.system.model.space and turned > TURNED:
            return False
        end = float(np.abs(after.d[-1, :rotation_unknowns]).max(initial=0.0))
        return not (transcription.statement.resting and end > MOVED)

    def _motion(self, transcription: Transcription, result: NLPResult) -> ControlledMotion:
        problem, statement = self.problem, self.problem.statement
        pieces = transcription.pieces
        values = [float(pieces.value(block, result.x).flat[0]) for block in transcription.variables]
        variables = dict(zip([one.name for one in statement.variables], values, strict=True))
        cost = sum((transcription.value(term, result.x) for term in statement.costs), 0.0)
        bare = ControlledMotion(
            status=result.status,
            scene=problem.scene,
            time=float(pieces.value(transcription.end, result.x)[0]),
            cost=cost,
            variables=variables,
            iterations=self.iterations,
            seconds=dict(self.seconds),
            notes=(*transcription.system.notes, *self.notes),
            transcription=transcription,
            x=result.x,
        )
        return replace(bare, scene=bare.with_variables(problem.scene))


def _short_of(check: Check, size: float, statement: MotionStatement) -> Iterator[str]:
    """What a replay says against an answer."""
    if check.difference > FAR:
        yield f"the replay is off by {check.difference:.2g} of the size: more intervals or elements are needed"
    left = check.residual_vibration / size
    if statement.resting and left > FAR:
        yield f"after the end the replay does not rest: nodes move by {left:.2g} of the size"


def _why(transcription: Transcription, nlp: NLP, result: NLPResult, statement: MotionStatement) -> str:
    """What IPOPT reported, what is violated most, and what may help."""
    worst = transcription.pieces.violated(nlp, result.x)
    # What was asked for first: equations are missed along with it.
    own = {one.name for one in statement.required} | {"rest at the end"}
    worst.sort(key=lambda item: item[0] not in own)
    message = "; ".join(f"{name} by {amount:.3g}" for name, amount in worst[:3])
    parts = [f"IPOPT: {result.message.replace('_', ' ')} after {result.iterations} iterations"]
    if message:
        parts.append(f"violated most, over their units: {message}")
    if statement.duration[0] == statement.duration[1] or result.status is Status.INFEASIBLE:
        high = statement.duration[1]
        parts.append(
            f"what is asked may contradict itself, or {high:.6g} s be too short for the limits of the controls"
        )
    return ", ".join(parts)


def _clipped(duration: tuple[float, float], given: float | None) -> float:
    low, high = duration
    middle = 0.5 * (low + high) if np.isfinite(high) else max(2.0 * low, 1.0)
    return float(np.clip(middle if given is None else given, low, high))


def _duration(given: Any) -> tuple[float, float]:
    """Bounds of the time of the end."""
    low, high = bounds_of("time", (given, given) if np.ndim(given) == 0 else given)
    if not (high > 0.0 and low >= 0.0) or np.isinf(low):
        raise SceneError(f"time: found {given!r} s, accepted: a positive time, or the shortest and the longest one")
    if low == 0.0:
        raise SceneError("time: found 0 s as shortest, accepted: a shortest time above zero")
    return low, high


def _shares(given: Any) -> Array:
    """Shares of the intervals in the time."""
    if isinstance(given, (int, float, np.number)) and not isinstance(given, bool):
        if not (np.isfinite(given) and given >= 1 and int(given) == given):
            raise SceneError(f"intervals: found {given}, accepted: a whole number, at least 1, or shares of the time")
        return np.full(int(given), 1.0 / int(given))
    try:
        shares = np.asarray(given, dtype=float).ravel()
    except (TypeError, ValueError):
        raise SceneError(f"intervals: found {given!r}, accepted: their number, or shares of the time") from None
    if not len(shares) or not np.isfinite(shares).all() or (shares <= 0.0).any():
        raise SceneError(f"intervals: found {given!r}, accepted: their number, or positive shares of the time")
    return np.asarray(shares / shares.sum())


def moving(scene: Scene, end: float) -> Scene:
    """The scene with a dynamic analysis up to an end time, s."""
    kept = ("accuracy", "initial", "cut", "release")
    given = {key: getattr(scene.analysis, key) for key in kept if key in scene.analysis.model_fields_set}
    if scene.analysis.type != "dynamic":
        given = {key: value for key, value in given.items() if key == "accuracy"}
    table = scene.to_dict()
    table["dimension"] = scene.resolved_dimension
    table["analysis"] = {**given, "type": "dynamic", "end": end}
    table.pop("expect", None)
    return Scene.from_dict(table)
