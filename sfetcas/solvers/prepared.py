"""A model made ready for any number of solves: IPOPT, Newton's method and the stability test."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.records import counted
from ..errors import SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from ..mathematics.keeping import kept
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import Ipopt, NLPResult
from ..mechanics.equations import Equations, Point, State
from ..mechanics.expressions import Expressions
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from .constraints import Diagnosis, contradiction, diagnose, free_motions
from .divergence import TangentTest
from .globalised import Code, Globalised, Rules
from .guess import first_guess, lacks_slack, restore
from .newton import AtLoads, Corrected, Limits, correct
from .problem import EquilibriumProblem
from .program import Program
from .pseudo_transient import Drag, flow
from .redundancy import loose_rows, stretched
from .sharing import shared
from .stability import Inertia, Stability, StabilityTest

__all__ = ["BEYOND", "Prepared"]

MOST_COUNTED = 600
"""Up to this many unknowns the eigenvalues of a tangent, all of them, take less than a second."""

STALLED = {"acceptable_tol": 1e-4, "acceptable_iter": 100}
"""Where IPOPT gets no nearer, as in the valley of a spin that next to nothing resists, Newton's method goes on."""

ITERATIONS = 250
"""Of IPOPT at most: what needs more lies in such a valley too, or there is no equilibrium at all."""

BEYOND = 1e4
"""Multipliers above this many times the loads are those of a stretched member, which has none that is finite."""

PRESTRESSED = 1e-3
"""Two states nearer than this, rad, are the same but for what a prestress bends."""

MOST_SWITCHES, FALLEN = 8, 400
"""Unstable equilibria that are left in a row before giving up, and iterations of falls that end nowhere."""


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

    @functools.cached_property
    def equations(self) -> Equations:
        """The stationarity equations in rotations."""
        return Equations(self.model, kernels=self.kernels, evaluations=self._evaluations)

    @functools.cached_property
    def diagnosis(self) -> Diagnosis:
        """What the undeformed structure is free to do, and what its joints hold twice."""
        return diagnose(self.equations, self.motions)

    @functools.cached_property
    def motions(self) -> Array:
        """What the undeformed structure is free to do, see :func:`~sfetcas.solvers.constraints.free_motions`."""
        undeformed = self.equations.start(self.model.loading(0.0, 0.0))
        return free_motions(self.equations, self._test.weight, undeformed)

    @functools.cached_property
    def lacks_slack(self) -> bool:
        """Whether straight members keep the closings from giving way, as :func:`~sfetcas.solvers.guess.lacks_slack`."""
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

    @kept(8)
    def _solvers(self, scale: float) -> Callable[..., NLPResult]:
        return Ipopt(iterations=ITERATIONS, objective_scale=1.0 / scale, extra=STALLED).prepare(self._problem.nlp)

    def guess(self, loading: Loading, *, settle: bool = True) -> tuple[State, float]:
        """A state to start from, downhill from the ``start`` places unless it is not to ``settle``, and its gap."""
        return first_guess(self.equations, loading, self._test.weight, settle=settle)

    @property
    def started(self) -> bool:
        """Whether ``start`` places of nodes choose among equilibria."""
        return any(node.start is not None for node in self.model.scene.nodes.values())

    def correct(
        self,
        state: State,
        loading: Loading,
        *,
        tangent: Array | None = None,
        flat: Array | None = None,
        drag: Drag | None = None,
        **limits: Any,
    ) -> Corrected:
        """Newton's method from a near state, see :class:`~sfetcas.solvers.newton.AtLoads`, within ``Limits``."""
        system = AtLoads(self.equations, loading, self._test.weight, tangent, flat, drag)
        return correct(system, state, limits=Limits(**limits))

    @functools.cached_property
    def _tangent(self) -> TangentTest:
        return TangentTest(self.equations, self._test.softest)

    @property
    def _tester(self) -> StabilityTest | TangentTest:
        return self._test if self.model.conservative else self._tangent

    def stability(self, found: Corrected) -> Stability:
        """The stability test at a state; without a potential no energy tells stable from unstable."""
        return self._tester.test(found.point)

    def inertia(self, point: Point, *, doubtful: bool = True) -> Inertia:
        """Numbers of negative and of vanishing eigenvalues, these only where it is ``doubtful``; paths ask here.

        Without a potential of those of the tangent, see :class:`~sfetcas.solvers.divergence.TangentTest`.
        """
        return self._test.inertia(point, doubtful=doubtful) if self.model.conservative else self._tangent.inertia(point)

    def around_zero(self, point: Point, *, sharp: bool = True) -> tuple[int, Array, Array]:
        """Eigenvalues around zero as :class:`~sfetcas.solvers.stability.StabilityTest`; real ones without potential."""
        return self._tester.around_zero(point, sharp=sharp)

    def singular(self, point: Point, count: int) -> bool:
        """Whether so many eigenvalues vanish where their real parts do: always where there is an energy."""
        return self.model.conservative or self._tangent.singular(point, count)

    def negative(self, found: Corrected) -> int:
        """Number of negative eigenvalues at a state; none is counted where :attr:`switches_branch` is false."""
        if not self.switches_branch:
            return 0
        if self.model.conservative:
            return self._test.negative(found.point)
        return self._tangent.inertia(found.point).negative

    def diverged(self, found: Corrected) -> int | None:
        """Real eigenvalues of the tangent below zero, loads without potential; None where it is too large for them."""
        return self._tangent.below(found.point) if self.countable else None

    @property
    def countable(self) -> bool:
        """Whether all eigenvalues of a tangent, without a potential, are found in less than a second."""
        return self.equations.unknowns <= MOST_COUNTED

    @property
    def switches_branch(self) -> bool:
        """Whether unstable states can be left: there is an energy and, where its value is not known, not too much."""
        return self.model.minimisable or (self.model.conservative and self.countable)

    def spectrum(self, found: Corrected, count: int) -> tuple[Array, Array]:
        """Eigenvalues and lowest shapes at a state, see :meth:`StabilityTest.spectrum`."""
        return self._test.spectrum(found.point, count)

    @property
    def weight(self) -> Array:
        """Weight of the rotation unknowns, see :class:`~sfetcas.solvers.stability.StabilityTest`."""
        return self._test.weight

    @property
    def softest(self) -> float:
        """The size of eigenvalues in what the softest member does, see the same."""
        return self._test.softest

    def minimise(self, loading: Loading, state: State) -> tuple[Corrected, int]:
        """IPOPT from a state, then Newton's method to rounding; the equilibrium and IPOPT's iterations.

        Raises
        ------
        SolveError
            No equilibrium: what IPOPT says of it.
        """
        if not self.model.minimisable:
            mesh = counted(self.model.mesh.elements, "element", "elements")
            detail = f"Newton's method did not converge on {mesh}, and loads without potential cannot be minimised"
            raise SolveError(Status.FAILED, detail, state)
        if not self.equations.unknowns or len(self.model.row_names) > self.model.unknowns - self._norms:
            # IPOPT takes no more equations than unknowns; redundant ones leave little to minimise, held scenes nothing.
            found = self.downhill(state, loading) or self.correct(state, loading, iterations=50)
            if not found.converged:
                detail = f"Newton's method on redundant closings left a residual of {found.residual:.1e}"
                told = contradiction(self.equations, state, loading)
                raise SolveError(Status.INFEASIBLE if told else Status.FAILED, told or detail, state)
            return found, 0
        problem = self._problem
        scale = max(1.0, float(np.abs(loading.force).max(initial=0.0)), float(np.abs(loading.pull).max(initial=0.0)))
        result = self._ipopt(scale)(
            p=problem.parameters(loading, state),
            guess=problem.unknowns(state),
            lam=problem.multipliers(state) / scale,
        )
        self._spent += result.iterations
        trial = problem.state(result.x, result.lam, loading, state)
        if not np.all(np.isfinite(trial.q)):
            raise SolveError(Status.FAILED, result.message, state)
        polished = self.correct(trial, loading)
        if not polished.residual <= tolerances.BALANCED and result.status not in (Status.INFEASIBLE, Status.UNBOUNDED):
            # Quaternions leave a long valley by short steps only, rotations by long ones.
            polished = self.downhill(trial, loading) or polished
        # What falls without end has no finite residual, which no comparison would find too large.
        if not polished.converged and not polished.residual <= tolerances.BALANCED:
            status = result.status if result.status is not Status.SOLVED else Status.FAILED
            detail = f"IPOPT: {result.message}, {counted(result.iterations, 'iteration')}"
            if result.status is Status.SOLVED:
                detail = f"IPOPT came to rest after {counted(result.iterations, 'iteration')}"
            # What IPOPT notices of closings that cannot be, or only by members drawn straight, hangs on rounding.
            told = contradiction(self.equations, state, loading)
            if told:
                status, detail = Status.INFEASIBLE, told
            elif status is Status.FAILED:
                told = stretched(self.equations, polished.point)
                left = f"{detail}; Newton's method left a residual of {polished.residual:.1e}"
                status, detail = (Status.STRETCHED, told) if told else (status, left)
            raise SolveError(status, detail, trial)
        return self._without_prestress(polished, loading), result.iterations

    def _without_prestress(self, found: Corrected, loading: Loading) -> Corrected:
        """The same equilibrium with the multipliers of members that stretch alike where closings are redundant.

        Of these IPOPT leaves what happens to come out, up to what buckles members: with such a prestress, which
        nobody applied, what is stable would look unstable.
        """
        loose = loose_rows(self.equations, found.point)
        if not loose.size:
            return found
        self.equations.redundant = True
        without = shared(self.equations, found.state, loading, loose)
        if self.multipliers(found) > BEYOND:
            # Where only multipliers without bound hold it, it is in balance further down.
            return self.downhill(without, loading) or found
        least = self.correct(without, loading)
        return least if least.converged and self.distance(least.state, found.state) < PRESTRESSED else found

    def multipliers(self, found: Corrected) -> float:
        """The largest multiplier over the loads, or over the unit of force."""
        return float(np.abs(found.state.lam).max(initial=0.0)) / max(1.0, self._load_size)

    @functools.cached_property
    def _globalised(self) -> Globalised:
        expressions = Expressions(self.equations, self.kernels, self._evaluations)
        return Globalised(Program(expressions), self.weight, Rules(escapes=0))

    def globalised(self, loading: Loading) -> tuple[Corrected | None, int]:
        """The equilibrium by Newton's method from afar, stable or not, and its iterations; None where it fails."""
        method = self._globalised
        start = None
        if self.lacks_slack or self.started:
            start = method.program.flat(self.guess(loading)[0])
        outcome = method(method.program.given_of(loading), start)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return None, outcome.iterations
        found = self.correct(method.program.state(outcome.state), loading)
        return (found if found.residual <= tolerances.BALANCED else None), outcome.iterations

    def downhill(self, state: State, loading: Loading) -> Corrected | None:
        """The equilibrium below a state, or where its forces carry it without an energy; None where they do not rest.

        Its tangent has no eigenvalue with a real part below zero.
        """
        try:
            there, steps = flow(self.equations, state, loading, self._tester.depth)
        except SolveError:
            # Nothing rests where forces without bound act.
            return None
        self._spent += steps
        found = None if there is None else self.correct(there, loading)
        return found if found is not None and found.converged else None

    def switch_branch(self, state: State, stability: Stability, loading: Loading) -> tuple[Corrected, Stability]:
        """Leave an unstable equilibrium along its unstable mode to a stable or neutral one.

        Raises
        ------
        SolveError
            None was found.
        """
        amplitude, lost = 0.2, 0
        for _ in range(MOST_SWITCHES):
            begun = self._spent
            try:
                found = self._fallen(self.nudged(state, stability, loading, amplitude), loading)
            except SolveError:
                lost += self._spent - begun
                # The flow leads down from wherever it begins: where it finds no rest a longer step finds none, but
                # the other side of the shape may lead elsewhere.
                if lost >= FALLEN or (not self.model.minimisable and amplitude < 0.0):
                    break
                amplitude *= 1.7 if self.model.minimisable else -1.0
                continue
            there = self.stability(found)
            if there.negative == 0:
                return found, there
            same = self.distance(found.state, state) < tolerances.SAME_STATE
            amplitude = 1.7 * amplitude if same else 0.2
            state, stability = found.state, there
        raise SolveError(Status.FAILED, "no stable equilibrium found along the unstable modes", state)

    def _fallen(self, state: State, loading: Loading) -> Corrected:
        """The equilibrium below a state."""
        # Where closings are redundant IPOPT lets multipliers hold what falls, and leads across to the other side.
        flows = not self.model.minimisable or bool(self.equations.redundant)
        found = self.downhill(state, loading) if flows else None
        if found is not None:
            return found
        if self.model.minimisable:
            return self.minimise(loading, state)[0]
        raise SolveError(Status.FAILED, "the way downhill did not come to rest", state)

    def nudged(self, state: State, stability: Stability, loading: Loading, amplitude: float) -> State:
        """The state moved along the unstable mode to the side of lower energy, closings restored."""
        equations = self.equations
        sides = []
        for sign in (1.0, -1.0):
            step = np.zeros(equations.total)
            step[: equations.rotation_unknowns] = sign * amplitude * stability.shape
            step[equations.rotation_unknowns : equations.unknowns] = sign * amplitude * stability.travel
            moved = replace(equations.moved(state, step), lam=state.lam)
            if equations.rows:
                moved = replace(restore(equations, moved, loading, self._test.weight)[0], lam=state.lam)
            sides.append((equations.at(moved, loading), moved))
        # A symmetric pair differs by rounding only: then the first side, so that answers repeat.  Loads that follow
        # are not in the potential: from an unstable state both sides go down.
        (up, first), (down, second) = sides
        if not self.model.has_potential:
            return first
        # Near where it becomes unstable what a load gives is nearly what the strain takes.
        size = max(abs(up.potential), abs(down.potential), up.strain, down.strain)
        return second if up.potential - down.potential > tolerances.LEVEL * size else first

    @functools.cached_property
    def _load_size(self) -> float:
        """Largest load, dimensionless."""
        loading = self.model.loading(1.0)
        return max(float(np.abs(part).max(initial=0.0)) for part in (loading.force, loading.pull, loading.moment))

    def distance(self, a: State, b: State) -> float:
        """Largest angle between the rotations of two states, rad."""
        if not self.model.space:
            return float(np.abs(a.q - b.q).max(initial=0.0))
        turns = quaternion.rotation_vector(quaternion.multiply(quaternion.conjugate(a.q), b.q))
        return float(np.linalg.norm(turns, axis=-1).max(initial=0.0))
