"""A model made ready for any number of solves by IPOPT and Newton's method, and the equilibria that they find."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.records import counted
from ..description.showing import shown
from ..errors import SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from ..mathematics.core import Counting, Way, integers
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import Ipopt, NLPResult
from ..mechanics.equations import Equations, Point, State
from ..mechanics.fields import Fields
from ..mechanics.inputs import Inputs
from ..mechanics.loading import Loading
from ..mechanics.memory import Remembering
from ..mechanics.model import Model
from .constraints import Diagnosis, contradiction, diagnose, free_motions
from .divergence import TangentTest
from .globalised import Code, Globalised, Rules
from .guess import first_guess, lacks_slack, restore
from .newton import AtLoads, Limits, correct, limits_for_core
from .problem import EquilibriumProblem
from .pseudo_transient import flow
from .redundancy import loose_rows, stretched
from .sharing import shared
from .stability import Inertia, Stability, StabilityTest

__all__ = ["BEYOND", "Prepared", "Solved"]

MOST_COUNTED = 600
"""Largest number of unknowns for which all eigenvalues of an unsymmetric tangent take less than a second."""

STALLED = {"acceptable_tol": 1e-4, "acceptable_iter": 100}
"""Options that stop IPOPT where it converges slowly, as along rotations with little resistance; Newton continues."""

ITERATIONS = 250
"""Largest number of iterations of IPOPT: with more it converges as slowly, or there is no equilibrium."""

BEYOND = 1e4
"""Ratio of multipliers to loads above which straight members would need an infinite force to hold the state."""

FARTHEST = 1e12
"""Displacements over the longest member, and scaled strains, beside which loads are rounding, so that what seems to be
in balance there falls without end (1e20 was found); those of stiff members reach 1e7.
"""

PRESTRESSED = 1e-3
"""Largest rotation, rad, between an equilibrium and the same one without prestress of redundant members."""

PROGRAMS = 8
"""Programs that are kept for models of one structure: one for each power of ten of the loads."""

MOST_SWITCHES, FALLEN = 8, 400
"""Largest number of attempts to leave unstable equilibria, and of iterations spent on those that fail."""


class Prepared:
    """Solvers of one model; each is made when it is first needed.

    Parameters
    ----------
    model : Model
    kernels : str
        ``auto`` compiles element functions where that pays in one run; ``compiled`` always, for many solves;
        ``interpreted`` never.  Without a compiler everything is interpreted.
    evaluations : float
        How often the equations will be evaluated, for ``auto``.
    """

    def __init__(self, model: Model, *, kernels: Kernels = "auto", evaluations: float = 12.0) -> None:
        self.model = model
        self._evaluations = evaluations
        self.kernels: Kernels = kernels
        self._spent = 0

    def __repr__(self) -> str:
        return shown(self, [f"kernels={self.kernels!r}"], repr(self.model).splitlines())

    @functools.cached_property
    def equations(self) -> Equations:
        """The stationarity equations in rotations."""
        return Equations(self.model, kernels=self.kernels, evaluations=self._evaluations)

    def remembering(self, state: State) -> Prepared:
        """The same for the step after that to a state; itself where no member remembers anything."""
        if not self.model.scene.remembers:
            return self
        memory, found = Remembering(self.model), copy.copy(self)
        found.model = memory.model_with(memory.after(state.q, state.y, memory.begun))
        # What is made of the equations is made anew; what is known of the undeformed structure stays.
        for made in ("_test", "_tangent", "_problem", "_globalised"):
            found.__dict__.pop(made, None)
        found.equations = self.equations.remembering(found.model)
        return found

    @functools.cached_property
    def diagnosis(self) -> Diagnosis:
        """Free motions and redundant constraints of the undeformed structure."""
        return diagnose(self.equations, self.motions)

    @functools.cached_property
    def motions(self) -> Array:
        """Motions (unknowns, n) of the undeformed structure that strain nothing, dimensionless.

        See :func:`~sfetcas.solvers.constraints.free_motions`.
        """
        equations = self.equations
        if self._test.is_held:
            return np.zeros((equations.unknowns, 0))
        return free_motions(equations, self._test.weight, equations.start(self.model.loading(0.0, 0.0)))

    @functools.cached_property
    def lacks_slack(self) -> bool:
        """Whether straight members make closings redundant, see :func:`~sfetcas.solvers.guess.lacks_slack`."""
        return lacks_slack(self.equations)

    @property
    def _norms(self) -> int:
        return int((self.model.widths >= 2).sum()) if self.model.space else 0

    @functools.cached_property
    def _test(self) -> StabilityTest:
        return StabilityTest(self.equations)

    @functools.cached_property
    def _problem(self) -> EquilibriumProblem:
        loading = self.model.loading(1.0)
        return EquilibriumProblem(self.model, loading, self.equations.start(loading), kernels=self.kernels)

    def _ipopt(self, scale: float) -> Callable[..., NLPResult]:
        return self._solvers(10.0 ** round(np.log10(scale)))

    def _solvers(self, scale: float) -> Callable[..., NLPResult]:
        """IPOPT for models of this structure, whose data are parameters of one program."""
        known, key = self.equations.layout.programs, (self.kernels, scale)
        if key not in known:
            method = Ipopt(iterations=ITERATIONS, objective_scale=1.0 / scale, extra=STALLED)
            known[key] = method.prepare(self._problem.nlp)
            while len(known) > PROGRAMS:
                del known[next(iter(known))]
        return known[key]

    def guess(self, loading: Loading, *, settle: bool = True) -> tuple[State, float]:
        """A start state and its largest gap, dimensionless, see :func:`~sfetcas.solvers.guess.first_guess`."""
        return first_guess(self.equations, loading, self._test.weight, settle=settle)

    @property
    def started(self) -> bool:
        """Whether nodes have ``start`` places, which choose among equilibria."""
        return self.model.scene.started

    def correct(
        self,
        state: State,
        loading: Loading,
        *,
        tangent: Array | None = None,
        flat: Array | None = None,
        drag: Callable[[State, Point], Point] | None = None,
        **limits: Any,
    ) -> Solved:
        """Newton's method from a near state to the equilibrium under a loading.

        Parameters
        ----------
        state : State
        loading : Loading
        tangent, flat, drag
            Dimensionless, see :class:`~sfetcas.solvers.newton.AtLoads`.
        **limits
            Fields of :class:`~sfetcas.solvers.newton.Limits`.
        """
        system = AtLoads(self.equations, loading, self._test.weight, tangent, flat, drag)
        return Solved(self, *correct(system, state, limits=Limits(**limits)))

    def followed(
        self, begin: Solved, rate: Loading, way: Way, limits: Limits, *, counted: bool
    ) -> tuple[State, bool] | None:
        """Growing loads followed by the core from an equilibrium, as far as it can: see :meth:`.Equations.followed`.

        Parameters
        ----------
        begin : Solved
        rate : Loading
            What is added to its loading along the way, in proportion.
        way : Way
            Changed; what is given is set here.
        limits : Limits
            Of the corrections.
        counted : bool
            Whether eigenvalues are counted, so that the way ends where one is not clearly above zero.
        """
        equations, counting = self.equations, self.counting if counted else None
        if not equations.by_core or (equations.rows and equations.redundant) or (counted and counting is None):
            return None
        turned = integers(np.flatnonzero(rate.turn.any(axis=1)))
        begun, along = (
            np.concatenate([equations.given(loading), loading.turn[turned].ravel()])
            for loading in (begin.loading, rate)
        )
        way.begun, way.rate = begun.ctypes.data, along.ctypes.data
        way.turning, way.turned = len(turned), turned.ctypes.data
        controls, alive = limits_for_core(equations, limits, self._test.weight)
        found = equations.followed(begin.state, begin.point.entries, way, controls, counting and counting[0])
        del alive
        return found

    @functools.cached_property
    def _tangent(self) -> TangentTest:
        return TangentTest(self.equations, self._test.softest)

    @property
    def _tester(self) -> StabilityTest | TangentTest:
        return self._test if self.model.conservative else self._tangent

    def inertia(self, point: Point, *, doubtful: bool = True) -> Inertia:
        """Numbers of negative and of zero eigenvalues, in large models the latter only if ``doubtful``; for paths.

        For loads without potential those of the tangent, see :class:`~sfetcas.solvers.divergence.TangentTest`.
        """
        return self._test.inertia(point, doubtful=doubtful) if self.model.conservative else self._tangent.inertia(point)

    def around_zero(self, point: Point, *, sharp: bool = True) -> tuple[int, Array, Array]:
        """Eigenvalues (n,) around zero, dimensionless, and shapes, see :meth:`.StabilityTest.around_zero`.

        For loads without potential their real parts, see :meth:`.TangentTest.around_zero`.
        """
        return self._tester.around_zero(point, sharp=sharp)

    def singular(self, point: Point, count: int) -> bool:
        """Whether the ``count`` eigenvalues nearest to the imaginary axis are real: always with a potential."""
        return self.model.conservative or self._tangent.singular(point, count)

    @property
    def countable(self) -> bool:
        """Whether the model is small enough for all eigenvalues of an unsymmetric tangent."""
        return self.equations.unknowns <= MOST_COUNTED

    @property
    def switches_branch(self) -> bool:
        """Whether unstable states can be left: a potential exists, and it is computed or the model is not large."""
        return self.model.minimisable or (self.model.conservative and self.countable)

    @property
    def weight(self) -> Array:
        """Weight (rotation unknowns,), dimensionless, see :class:`~sfetcas.solvers.stability.StabilityTest`."""
        return self._test.weight

    @property
    def counting(self) -> tuple[Counting, Array] | None:
        """How the core counts eigenvalues, see :attr:`.StabilityTest.counting`."""
        return self._test.counting

    @property
    def softest(self) -> float:
        """Ratio of :attr:`weight` to :attr:`.Equations.mass`, see :attr:`.StabilityTest.softest`."""
        return self._test.softest

    def minimise(self, loading: Loading, state: State) -> tuple[Solved, int]:
        """IPOPT from a state, then Newton's method to rounding; the equilibrium and the number of IPOPT's iterations.

        Raises
        ------
        SolveError
            Loads have no potential, or no equilibrium was found; the message says what IPOPT reported.
        """
        if not self.model.minimisable:
            mesh = counted(self.model.mesh.elements, "element", "elements")
            detail = f"Newton's method did not converge on {mesh}, and loads without potential cannot be minimised"
            raise SolveError(Status.FAILED, detail, state)
        if not self.equations.unknowns or len(self.model.row_names) > self.model.unknowns - self._norms:
            # IPOPT accepts no more equations than unknowns: Newton's method for redundant rows, or if nothing can move.
            found = self.downhill(state, loading) or self.correct(state, loading, iterations=50)
            if not found.converged:
                detail = f"Newton's method on redundant closings left a residual of {found.residual:.1e}"
                message = contradiction(self.equations, state, loading)
                raise SolveError(Status.INFEASIBLE if message else Status.FAILED, message or detail, state)
            return found, 0
        problem = self._problem
        scale = max(1.0, float(np.abs(loading.force).max(initial=0.0)), float(np.abs(loading.pull).max(initial=0.0)))
        result = self._ipopt(scale)(
            p=problem.parameters(loading, state),
            guess=problem.unknowns(state),
            lam=problem.multipliers(state) / scale,
            within=problem.limits,
        )
        self._spent += result.iterations
        trial = problem.state(result.x, result.lam, loading, state)
        if not np.all(np.isfinite(trial.q)):
            raise SolveError(Status.FAILED, result.message, state)
        polished = self.correct(trial, loading)
        if np.abs(polished.state.y).max(initial=0.0) > FARTHEST:
            detail = f"IPOPT: {result.message}, {counted(result.iterations, 'iteration')}"
            raise SolveError(Status.UNBOUNDED, detail, trial)
        if not polished.residual <= tolerances.BALANCED and result.status not in (Status.INFEASIBLE, Status.UNBOUNDED):
            # Along a long flat valley steps in quaternions are short; increments of rotations allow long ones.
            polished = self.downhill(trial, loading) or polished
        # A structure that falls without end has residual nan, for which every comparison is false: hence the "not".
        if not polished.balanced:
            slid = problem.slid_off(result.x)
            if slid:
                raise SolveError(Status.SLID, slid, trial)
            status = result.status if result.status is not Status.SOLVED else Status.FAILED
            detail = f"IPOPT: {result.message}, {counted(result.iterations, 'iteration')}"
            if result.status is Status.SOLVED:
                detail = f"IPOPT came to rest after {counted(result.iterations, 'iteration')}"
            # Whether IPOPT detects closings that are infeasible, or need stretched members, depends on rounding.
            message = contradiction(self.equations, state, loading)
            if message:
                status, detail = Status.INFEASIBLE, message
            elif status is Status.FAILED:
                message = stretched(self.equations, polished.point)
                left = f"{detail}; Newton's method left a residual of {polished.residual:.1e}"
                status, detail = (Status.STRETCHED, message) if message else (status, left)
            raise SolveError(status, detail, trial)
        return self._without_prestress(polished), result.iterations

    def _without_prestress(self, found: Solved) -> Solved:
        """The equilibrium with the multipliers of redundant rows by the rule of :mod:`~sfetcas.solvers.sharing`.

        IPOPT leaves arbitrary values of these, large enough to buckle members: with such a prestress, which nobody
        applied, a stable equilibrium would look unstable.
        """
        loose = loose_rows(self.equations, found.point)
        if not loose.size:
            return found
        self.equations.redundant = True
        without = shared(self.equations, found.state, found.loading, loose)
        if found.multipliers > BEYOND:
            # A state that only unbounded multipliers hold is left for an equilibrium of lower energy.
            return self.downhill(without, found.loading) or found
        least = self.correct(without, found.loading)
        return least if least.converged and self.distance(least.state, found.state) < PRESTRESSED else found

    @functools.cached_property
    def _globalised(self) -> Globalised:
        return Globalised(Inputs(self.equations), self.weight, Rules(escapes=0))

    def globalised(self, loading: Loading) -> tuple[Solved | None, int]:
        """The equilibrium by the globalised Newton method, stable or not, and its iterations; None if it fails."""
        method, start = self._globalised, None
        if self.lacks_slack or self.started:
            start = self.guess(loading)[0].flat
        outcome = method(method.inputs.of(loading), start)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return None, outcome.iterations
        found = self.correct(self.equations.state(outcome.state), loading)
        return (found if found.residual <= tolerances.BALANCED else None), outcome.iterations

    def downhill(self, state: State, loading: Loading) -> Solved | None:
        """The equilibrium to which pseudo-transient continuation leads from a state; None if it does not converge.

        No eigenvalue of its tangent has a negative real part.
        """
        try:
            there, steps = flow(self.equations, state, loading, self._tester.depth)
        except SolveError:
            # The stability test failed on a stiffness without bound: there is no equilibrium near.
            return None
        self._spent += steps
        found = None if there is None else self.correct(there, loading)
        return found if found is not None and found.converged else None

    def switch_branch(self, found: Solved, loading: Loading) -> Solved:
        """Leave an unstable equilibrium along its unstable mode to a stable or neutral one under a loading.

        Raises
        ------
        SolveError
            No stable or neutral equilibrium was found.
        """
        amplitude, lost = 0.2, 0
        for _ in range(MOST_SWITCHES):
            begun = self._spent
            try:
                there = self._fallen(self.nudged(found, loading, amplitude), loading)
            except SolveError:
                lost += self._spent - begun
                # The flow leads downhill from any start: if it finds no equilibrium, a longer step finds none either,
                # but the other side of the mode may lead elsewhere.
                if lost >= FALLEN or (not self.model.minimisable and amplitude < 0.0):
                    break
                amplitude *= 1.7 if self.model.minimisable else -1.0
                continue
            if there.stability.negative == 0:
                return there
            same = self.distance(there.state, found.state) < tolerances.SAME_STATE
            amplitude = 1.7 * amplitude if same else 0.2
            found = there
        raise SolveError(Status.FAILED, "no stable equilibrium found along the unstable modes", found.state)

    def _fallen(self, state: State, loading: Loading) -> Solved:
        """The equilibrium downhill from a state, by pseudo-transient continuation or minimisation."""
        # With redundant rows IPOPT may stop at states that only large multipliers hold, or jump to the other side; what
        # falls without stiffness it may turn by whole turns more.
        flows = not self.model.minimisable or bool(self.equations.redundant) or self.diagnosis.mobility > 0
        found = self.downhill(state, loading) if flows else None
        if found is not None:
            return found
        if self.model.minimisable:
            return self.minimise(loading, state)[0]
        raise SolveError(Status.FAILED, "the way downhill did not come to rest", state)

    def nudged(self, found: Solved, loading: Loading, amplitude: float) -> State:
        """A state displaced along its unstable mode to the side of lower energy, with its gaps closed again.

        ``amplitude`` is the largest rotation, rad; its sign chooses the side where energies are equal or not computed.
        """
        equations = self.equations
        sides = [
            (equations.at(moved, loading), moved)
            for moved in (self.beside(found, loading, sign * amplitude) for sign in (1.0, -1.0))
        ]
        # A symmetric pair differs by rounding only: then the first side, so that answers repeat.  Loads that follow
        # are not in the potential: from an unstable state both sides go down.
        (up, first), (down, second) = sides
        if not self.model.has_potential:
            return first
        # Near a bifurcation the work of the load and the strain energy nearly cancel: strain gives the size as well.
        size = max(abs(up.potential), abs(down.potential), up.strain, down.strain)
        return second if up.potential - down.potential > tolerances.LEVEL * size else first

    def beside(self, found: Solved, loading: Loading, amplitude: float) -> State:
        """A state displaced along its unstable mode by a largest rotation, rad, to the side of its sign, with its gaps
        closed again.
        """
        equations, state, stability = self.equations, found.state, found.stability
        step = np.zeros(equations.total)
        step[: equations.rotation_unknowns] = amplitude * stability.shape
        step[equations.rotation_unknowns : equations.unknowns] = amplitude * stability.travel
        moved = replace(equations.moved(state, step), lam=state.lam)
        if equations.rows:
            moved = replace(restore(equations, moved, loading, self._test.weight)[0], lam=state.lam)
        return moved

    @functools.cached_property
    def load_size(self) -> float:
        """Largest load of factor 1, dimensionless."""
        loading = self.model.loading(1.0)
        return max(float(np.abs(part).max(initial=0.0)) for part in (loading.force, loading.pull, loading.moment))

    def distance(self, a: State, b: State) -> float:
        """Largest angle between the rotations of two states, rad; plane angles count whole turns."""
        if not self.model.space:
            return float(np.abs(a.q - b.q).max(initial=0.0))
        turns = quaternion.rotation_vector(quaternion.multiply(quaternion.conjugate(a.q), b.q))
        return float(np.linalg.norm(turns, axis=-1).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Solved:
    """An equilibrium as Newton's method left it; what else is asked of it is computed when asked, and once.

    Attributes
    ----------
    prepared : Prepared
    state, loading
        The state, loads and motions.
    known : Point or None
        The equations there, if they have been evaluated.
    residual : float
        Largest out-of-balance entry relative to the scale of the equations, see :mod:`~sfetcas.solvers.residuals`.
    converged : bool
        Whether Newton's method came down to rounding.
    iterations : int
        Its steps.
    first, second : float
        Largest rotations, rad, of its first two steps: their ratio shows how nonlinear the equations were.
    """

    prepared: Prepared
    state: State
    loading: Loading
    known: Point | None
    residual: float
    converged: bool = True
    iterations: int = 0
    first: float = 0.0
    second: float = 0.0

    @classmethod
    def taken(cls, prepared: Prepared, state: State, loading: Loading) -> Solved:
        """A state that is taken for an equilibrium, without looking whether it is one."""
        return cls(prepared, state, loading, None, 0.0)

    @functools.cached_property
    def point(self) -> Point:
        """The equations at the state."""
        return self.equations.at(self.state, self.loading) if self.known is None else self.known

    @property
    def balanced(self) -> bool:
        """Whether it is an equilibrium: Newton's method has converged, or came as near as answers need."""
        return self.converged or self.residual <= tolerances.BALANCED

    @property
    def equations(self) -> Equations:
        """The stationarity equations of the model."""
        return self.prepared.equations

    @property
    def model(self) -> Model:
        """The assembled model."""
        return self.prepared.model

    @property
    def factor(self) -> float:
        """Factor of loads and prescribed motions."""
        return self.loading.factor

    @functools.cached_property
    def fields(self) -> Fields:
        """Evaluates positions, rotations and forces."""
        return Fields(self.equations, self.state, self.loading)

    @functools.cached_property
    def stability(self) -> Stability:
        """The stability test; "not defined" for loads without potential."""
        return self.prepared._tester.test(self.point)

    @property
    def neutral(self) -> bool:
        """Whether :attr:`stability` calls it neutral, at less cost where no eigenvalue is near zero."""
        if not self.model.conservative or "stability" in self.__dict__:
            return self.stability.stable == "neutral"
        found = self.prepared.inertia(self.point)
        return found.negative == 0 and found.zero > 0

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues, at less cost; 0 if :attr:`.Prepared.switches_branch` is false."""
        return self.prepared._test.negative(self.point) if self.prepared.switches_branch else 0

    @property
    def diverged(self) -> int | None:
        """Number of negative real eigenvalues of the tangent, for loads without potential; None if not countable."""
        return self.prepared._tangent.below(self.point) if self.prepared.countable else None

    def spectrum(self, count: int) -> tuple[Array, Array]:
        """All eigenvalues, dimensionless, and lowest shapes, see :meth:`.StabilityTest.spectrum`."""
        return self.prepared._test.spectrum(self.point, count)

    @property
    def multipliers(self) -> float:
        """Largest multiplier over the largest load of factor 1, or over the unit of force if that is larger."""
        return float(np.abs(self.state.lam).max(initial=0.0)) / max(1.0, self.prepared.load_size)
