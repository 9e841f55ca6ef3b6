"""Newton's method: the loop that all iterations of states share, and corrections to rounding.

What differs between its uses - the matrix of a step, the length of it, the end of the iteration - are functions given
to :func:`newton`.  :func:`correct` converges from a near state to an equilibrium of a :class:`System`: under given
loads, or with unknown factor, orthogonal to a direction of a curve.  :func:`descend` minimises from a far state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from ..mathematics.core import Border, doubles, integers
from ..mathematics.core import Limits as CoreLimits
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .redundancy import changed_by, loose_rows, met, redundant, with_sharing
from .residuals import EPSILON, LEAST_SCALE, balanced, relative_residual, rounded

__all__ = [
    "TURN",
    "AtLoads",
    "Balance",
    "Converged",
    "ForCore",
    "Iterate",
    "Limits",
    "Moving",
    "System",
    "correct",
    "descend",
    "largest_rotation",
    "limits_for_core",
    "newton",
    "newton_step",
]

TURN = 1.2
"""Largest rotation of a node, rad, in a step of :func:`descend` under forces."""

UNFELT = 1e-9
"""Size of a step, rad and dimensionless, by which no potential changes by more than its rounding, which must not decide
whether it falls.
"""


@dataclass(frozen=True, eq=False)
class Iterate:
    """A state that the loop has reached.

    Attributes
    ----------
    state : State
    point : Point
        The equations there, as the functions of steps take them.
    length : float
        Largest rotation of the full Newton step, before it was shortened, that led here, rad; infinite at first.
    count : int
        Steps taken so far.
    """

    state: State
    point: Point
    length: float = np.inf
    count: int = 0


Reached = TypeVar("Reached", bound=Iterate)


def newton(
    here: Reached,
    step: Callable[[Reached], Array],
    after: Callable[[Reached, Array], Reached | None],
    arrived: Callable[[Reached], bool],
    iterations: int,
) -> tuple[Reached, bool]:
    """The loop of Newton's method: its last iterate, and whether that one has converged.

    Parameters
    ----------
    here : Iterate
        The first iterate.
    step : callable
        Iterate -> change (total,) of all unknowns and multipliers; LinAlgError and values that are not finite end the
        loop.
    after : callable
        (iterate, change) -> next iterate, or None to end the loop.
    arrived : callable
        Iterate -> whether it has converged.
    iterations : int
        Largest number of steps.
    """
    for _ in range(iterations):
        if arrived(here):
            return here, True
        try:
            change = step(here)
        except np.linalg.LinAlgError:
            return here, False
        there = after(here, change) if np.isfinite(change).all() else None
        if there is None:
            return here, False
        here = there
    return here, arrived(here)


@dataclass(frozen=True)
class Moving:
    """The usual ``after`` of :func:`newton`: shortens steps, moves the state and evaluates the equations there.

    Attributes
    ----------
    equations : Equations
    loading : Loading
    longest : float
        Largest rotation of a node in a step, rad.
    convex : bool
        As of :meth:`.Equations.at`.
    """

    equations: Equations
    loading: Loading
    longest: float = np.inf
    convex: bool = False

    def at(self, state: State) -> Iterate:
        """The first iterate, at a state."""
        return Iterate(state, self.equations.at(state, self.loading, convex=self.convex))

    def __call__(self, here: Iterate, step: Array) -> Iterate:
        """The iterate after a step (total,)."""
        length = largest_rotation(self.equations, step)
        state = self.equations.moved(here.state, step * min(1.0, self.longest / max(length, TINY)))
        return replace(self.at(state), length=length, count=here.count + 1)


def largest_rotation(equations: Equations, step: Array) -> float:
    """Largest rotation of a step or rate (unknowns or more,), rad or rad by what it is a rate of."""
    return float(np.abs(step[: equations.rotation_unknowns]).max(initial=0.0))


def newton_step(equations: Equations, point: Point, weight: Array) -> Array:
    """Newton's step (total,), dimensionless, with a proximal term of a ``weight`` (rotation unknowns,).

    Multipliers of redundant rows do not change.
    """
    equations.solver.factor(equations.regularised(point.entries, tolerances.PROXIMAL * weight, tolerances.DUAL))
    if not redundant(equations, point):
        return equations.solver.solve(-point.residual)
    # Only the dual regularisation above limits the multipliers of redundant rows: that part has no meaning.
    rows, loose, right = slice(equations.unknowns, None), loose_rows(equations, point), -point.residual
    # Gaps that nothing closes lead to nothing else: the rounding of what they would lead to is large.
    idle = loose[:, np.linalg.norm(changed_by(equations, point, loose), axis=0) <= tolerances.RANK]
    right[rows] -= idle @ (idle.T @ right[rows])
    step = equations.solver.solve(right)
    step[rows] -= loose @ (loose.T @ step[rows])
    return step


# -- to an equilibrium, down to rounding --------------------------------------------------------------------


PLACED = 1e-9
"""Change in a step, over the unit of length, up to which a place that slides along a member is where it is."""


class System(Protocol):
    """Equations that :func:`correct` solves: those of an equilibrium, with or without an unknown factor of loads."""

    @property
    def equations(self) -> Equations:
        """The stationarity equations of the model."""

    def loading(self, factor: float) -> Loading:
        """Loads and motions at a factor."""

    def with_prescribed(self, state: State, loading: Loading) -> State:
        """The state with prescribed rotations at the values of a loading."""

    def seen(self, state: State, point: Point) -> Point:
        """The equations to be solved at a state, from the stationarity equations there."""

    def step(self, here: Balance) -> Array:
        """Newton's step, dimensionless: (total,), or (total + 1,) with the factor last where that is unknown."""

    def suffices(self, here: Balance) -> bool:
        """Whether the iterate is accurate enough for its purpose, before rounding is reached."""

    @property
    def complete(self) -> bool:
        """Whether :meth:`seen` adds no force, so that a solution is an equilibrium."""

    def for_core(self) -> ForCore | None:
        """What the core needs to solve it; None of a system that the core does not know."""


@dataclass(frozen=True)
class AtLoads:
    """An equilibrium under given loads and motions, dimensionless.

    Attributes
    ----------
    equations : Equations
    loads : Loading
    weight : ndarray (rotation unknowns,)
        Weight of the proximal term, see :class:`~sfetcas.solvers.stability.StabilityTest`.
    tangent : ndarray, optional
        Entries of the Newton matrix at the equilibrium under the loads before, for the first step: it then goes along
        the path, while the matrix under the new loads may already point away from it.
    flat : ndarray, optional
        Neutral modes, columns (rotation unknowns, modes): no step goes along them.
    drag : callable, optional
        Adds resisting moments to the equations, see :class:`~sfetcas.solvers.pseudo_transient.Drag`; the point that
        is returned has none.
    """

    equations: Equations
    loads: Loading
    weight: Array
    tangent: Array | None = None
    flat: Array | None = None
    drag: Callable[[State, Point], Point] | None = None

    def loading(self, factor: float) -> Loading:
        """The given loads, whatever the factor."""
        return self.loads

    def with_prescribed(self, state: State, loading: Loading) -> State:
        """The state with prescribed rotations at the values of a loading."""
        return self.equations.holding(state, loading)

    def seen(self, state: State, point: Point) -> Point:
        """The equations with drag and without the gaps of redundant rows, which no unknown closes."""
        point = met(self.equations, point)
        return point if self.drag is None else self.drag(state, point)

    def step(self, here: Balance) -> Array:
        """Newton's step (total,), dimensionless; the first one with the matrix of ``tangent`` if given."""
        point = here.point
        if self.tangent is None or here.count:
            return self._without_flat(newton_step(self.equations, point, self.weight))
        step = newton_step(self.equations, replace(point, entries=self.tangent), self.weight)
        turned = step[: self.equations.rotation_unknowns]
        resisted = tolerances.PROXIMAL * float(self.weight @ turned**2) <= 0.1 * abs(float(step @ point.residual))
        # The tangent of an unloaded mechanism of rigid members has little but the proximal term: it is not used then.
        return self._without_flat(step if resisted else newton_step(self.equations, point, self.weight))

    def _without_flat(self, step: Array) -> Array:
        if self.flat is not None:
            weighted, turning = self.weight[:, None] * self.flat, step[: self.equations.rotation_unknowns]
            turning -= self.flat @ np.linalg.lstsq(self.flat.T @ weighted, weighted.T @ turning, rcond=None)[0]
        return step

    def suffices(self, here: Balance) -> bool:
        """False: the iteration goes on to rounding."""
        return False

    @property
    def complete(self) -> bool:
        """Whether there is no drag."""
        return self.drag is None

    def for_core(self) -> ForCore | None:
        """What the core needs: it knows no drag and no neutral modes."""
        if self.drag is not None or self.flat is not None:
            return None
        return ForCore(self.weight, self.equations.given(self.loads), self.tangent)


@dataclass(frozen=True)
class Limits:
    """Limits of :func:`correct`; it gives up with the first step beyond one.

    Attributes
    ----------
    iterations : int
        Largest number of steps.
    most : float
        Largest rotation of a node in any step but the first, rad.
    slides : float
        Largest way along a member by which a place of contact moves in a step, over the unit of length: longer steps
        are shortened to that.
    contraction, short : float
        A step longer than ``short``, rad, must not exceed ``contraction`` times the one before.
    turned : float
        Largest sum of the largest rotations of all steps, rad.
    near : float
        Relative residual up to which ``most``, ``contraction`` and ``short`` do not apply; at least ``CONVERGED``.
    returns : bool
        Whether the first state is returned if it is in balance and the steps did not improve it or diverged.
    """

    iterations: int = 12
    most: float = np.inf
    slides: float = np.inf
    contraction: float = 1.0
    short: float = 0.05
    turned: float = np.inf
    near: float = 0.0
    returns: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Balance(Iterate):
    """An iterate of :func:`correct`, with its loading and relative residual.

    ``plain`` are the stationarity equations, ``point`` those that :meth:`System.seen` makes of them; ``over`` says that
    further steps cannot improve it, ``stalls`` that the last one did not, but moved a place of contact, ``shortened``
    that this one was shortened, so that it has not arrived.
    """

    plain: Point
    loading: Loading
    residual: float
    over: bool = False
    stalls: bool = False
    shortened: bool = False


class Converged(NamedTuple):
    """Result of :func:`correct`: the fields of a :class:`~sfetcas.solvers.prepared.Solved` besides its model."""

    state: State
    loading: Loading
    point: Point
    residual: float
    converged: bool
    iterations: int
    first: float
    second: float


def correct(system: System, state: State, *, factor: float = 1.0, limits: Limits | None = None) -> Converged:
    """Newton's method from a near state down to rounding: as long as a step reduces the residual to a fourth.

    A residual that rounding of the state explains counts as converged, too.  Multipliers of redundant rows follow the
    rule of :mod:`~sfetcas.solvers.sharing`.

    Parameters
    ----------
    system : System
    state : State
    factor : float
        First value of the factor; constant unless the system has an unknown one.
    limits : Limits, optional
    """
    limits = limits or Limits()
    found = _by_core(system, state, factor, limits) if system.equations.by_core else None
    return found or _Correction(system, limits)(state, factor)


class ForCore(NamedTuple):
    """What the core needs of a :class:`System`.

    Attributes
    ----------
    weight : ndarray (rotation unknowns,)
        That of the proximal term.
    given : ndarray, optional
        Loads and motions, of :meth:`.Equations.given`; None where there is a border.
    tangent : ndarray (entries,), optional
        Entries of the matrix for the first step.
    border : (ndarray, ndarray, ndarray, float, float, float), optional
        What is given at factor 0, its rate, the weighted direction (total,), its part along the factor, the change of
        that in differences (0 where loads act on nodes only), and the residual that suffices.
    """

    weight: Array
    given: Array | None = None
    tangent: Array | None = None
    border: tuple[Array, Array, Array, float, float, float] | None = None


def _by_core(system: System, state: State, factor: float, limits: Limits) -> Converged | None:
    """As :class:`_Correction` by the core, which takes the same decisions; None of what it does not know."""
    equations, known = system.equations, system.for_core()
    if known is None:
        return None
    loading = system.loading(factor)
    begin = system.with_prescribed(state, loading)
    if equations.rows and equations.redundant is None:
        redundant(equations, equations.at(begin, loading))
    if equations.rows and equations.redundant:
        return None
    controls, alive = limits_for_core(equations, limits, known.weight)
    border = None
    if known.border is not None:
        begun, rate, row, *numbers = known.border
        row = doubles(row)
        border = Border(begun.ctypes.data, rate.ctypes.data, row.ctypes.data, *numbers, factor)
    given = known.weight if known.given is None else known.given
    found = equations.corrected(begin, given, controls, tangent=known.tangent, border=border)
    del alive
    if found is None:
        return None
    there, point, report = found
    residual, good = report.residual, bool(report.good)
    if border is not None:
        loading = system.loading(border.factor)
    if good:
        there, point = with_sharing(equations, there, loading, point, max(report.tolerance, residual))
        residual = relative_residual(equations, point)
    lengths = [report.first, report.second][: report.steps]
    return Converged(there, loading, point, residual, good, report.iterations, *_first_two(lengths, good))


def limits_for_core(equations: Equations, limits: Limits, weight: Array) -> tuple[CoreLimits, tuple[Array, ...]]:
    """Limits as the core takes them, with the weight of the proximal term, and arrays that have to live as long."""
    known = equations.limits.get(limits)
    if known is not None and known[1][1] is weight:
        return known
    slides, weight = integers(equations.slid_places), doubles(weight)
    found = CoreLimits(
        iterations=limits.iterations,
        returns=limits.returns,
        slides=len(slides),
        slide=slides.ctypes.data,
        most=limits.most,
        slid=limits.slides,
        contraction=limits.contraction,
        brief=limits.short,
        turned=limits.turned,
        near=limits.near,
        converged=tolerances.CONVERGED,
        exact=tolerances.EXACT,
        balanced=tolerances.BALANCED,
        least=LEAST_SCALE,
        epsilon=EPSILON,
        placed=PLACED,
        proximal=tolerances.PROXIMAL,
        dual=tolerances.DUAL,
        weight=weight.ctypes.data,
    )
    equations.limits[limits] = found, (slides, weight)
    return equations.limits[limits]


def _first_two(lengths: list[float], good: bool) -> tuple[float, float]:
    """The lengths of the first two steps, rad: where nothing acts there is none; where none was possible it is inf."""
    first, second, *_ = [*lengths, 0.0 if lengths or good else np.inf, 0.0]
    return first, second


class _Correction:
    """One run of :func:`correct`, and the lengths of its steps, rad."""

    def __init__(self, system: System, limits: Limits) -> None:
        self.system, self.limits, self.equations = system, limits, system.equations
        self.tolerance = max(tolerances.CONVERGED, limits.near)
        self.lengths: list[float] = []
        self.refused = False

    def at(self, state: State, factor: float, length: float = np.inf, count: int = 0) -> Balance:
        """The iterate at a state whose prescribed rotations are those at the factor."""
        loading = self.system.loading(factor)
        plain = self.equations.at(state, loading)
        seen = self.system.seen(state, plain)
        residual = relative_residual(self.equations, seen)
        return Balance(state, seen, length, count, plain=plain, loading=loading, residual=residual)

    def arrived(self, here: Balance) -> bool:
        if here.over or here.residual == 0.0:
            return True
        # One step is always taken: under a tiny load the residual of the unloaded state is below rounding already.
        if not here.count or here.shortened:
            return False
        exact = here.residual <= tolerances.EXACT and balanced(self.equations, here.point)
        return exact or self.system.suffices(here)

    def after(self, here: Balance, step: Array) -> Balance | None:
        limits = self.limits
        slid = float(np.abs(step[self.equations.slid_places]).max(initial=0.0))
        share = min(1.0, limits.slides / max(slid, TINY))
        step = share * step
        length = largest_rotation(self.equations, step)
        self.lengths.append(length)
        grows = length > limits.most or length > max(limits.contraction * here.length, limits.short)
        if sum(self.lengths) > limits.turned or (here.count and here.residual > self.tolerance and grows):
            self.refused = True
            return None
        total, factor = self.equations.total, here.loading.factor
        moved = self.equations.moved(here.state, step[:total])
        if len(step) > total:
            factor += float(step[total])
            moved = self.system.with_prescribed(moved, self.system.loading(factor))
        there = replace(self.at(moved, factor, length, here.count + 1), shortened=share < 1.0)
        if not math.isfinite(there.residual):
            return None
        if there.shortened:
            return there
        if there.residual > 0.25 * here.residual and self._low(here):
            # Where a line ends is known to the root of the residual only: what is left of that goes in a further step.
            if not here.stalls and slid > PLACED:
                return replace(there, stalls=True)
            return replace(there if there.residual < here.residual else here, over=True)
        return there

    def _low(self, here: Balance) -> bool:
        """Whether a step that does not reduce the residual shows that rounding is reached."""
        if here.residual <= tolerances.CONVERGED:
            return here.count > 0 or (self.limits.returns and balanced(self.equations, here.point))
        return here.count > 0 and rounded(self.equations, here.state, here.point)

    def __call__(self, state: State, factor: float) -> Converged:
        begin = self.at(self.system.with_prescribed(state, self.system.loading(factor)), factor)
        here, _ = newton(begin, self.system.step, self.after, self.arrived, self.limits.iterations)
        tolerance, count = tolerances.CONVERGED, here.count
        if self.limits.returns and not here.residual <= tolerance and begin.residual <= tolerance:
            here = begin
        good, complete = here.residual <= tolerance or self.system.suffices(here), self.system.complete
        if not good and complete and not self.refused and rounded(self.equations, here.state, here.point):
            # Changed multipliers of redundant rows may have a little more rounding.
            tolerance, good = min(tolerances.BALANCED, 4.0 * here.residual), True
        found, point, residual = here.state, here.plain, here.residual
        if good and complete:
            found, point = with_sharing(self.equations, found, here.loading, point, max(tolerance, residual))
            residual = relative_residual(self.equations, point)
        return Converged(found, here.loading, point, residual, good, count, *_first_two(self.lengths, good))


# -- downhill ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class _Downhill(Iterate):
    """An iterate of :func:`descend`, and the share of the step that was taken."""

    share: float = 1.0


def descend(
    equations: Equations, state: State, loading: Loading, weight: Array, *, iterations: int = 30, most: float = TURN
) -> State:
    """Downhill towards a minimum of the potential on the closings, from any state.

    Newton steps with element matrices made positive, so that each points downhill, shortened until an l1 merit
    function (the potential, and the gaps with a weight above the multipliers) falls by a third of what the step
    promises.  No step rotates a node by more than ``most``, rad, so that forces do not wind a beam up; with moments,
    which may roll it up at once, the default does not apply.  Stops where steps have become short: the state is meant
    for IPOPT or Newton's method.  ``weight`` (rotation unknowns,) is that of the proximal term.
    """
    n = equations.unknowns
    most = np.inf if np.any(loading.moment) and most == TURN else most

    def at(state: State) -> Point:
        return equations.at(state, loading, convex=True)

    def after(here: _Downhill, step: Array) -> _Downhill:
        point, length = here.point, largest_rotation(equations, step)
        # Slope of the potential alone: the residual without the multipliers' share.
        lam = here.state.lam
        penalty = 2.0 * float(np.abs(lam + step[n:]).max(initial=0.0))
        gaps = np.abs(point.residual[n:]).sum()
        slope = float(point.residual[:n] @ step[:n]) + float(lam @ point.residual[n:]) - penalty * gaps
        slope, before = min(slope, 0.0), point.potential + penalty * gaps
        share, far = min(1.0, 4.0 * here.share, most / max(length, TINY)), float(np.abs(step[:n]).max(initial=0.0))
        for _ in range(40):
            trial = equations.moved(here.state, share * step)
            there = at(trial)
            fallen = there.potential + penalty * np.abs(there.residual[n:]).sum() - before
            if share * far <= UNFELT or fallen <= 0.3 * (share - 0.5 * share**2) * slope + 1e-12 * abs(before):
                break
            share *= 0.5
        return _Downhill(trial, there, length, here.count + 1, share=share)

    return newton(
        _Downhill(state, at(state)),
        lambda here: newton_step(equations, here.point, 1e4 * weight),
        after,
        lambda here: here.share == 1.0 and here.length < 0.02,
        iterations,
    )[0].state
