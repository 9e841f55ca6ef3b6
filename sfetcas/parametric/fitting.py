"""Identification: parameters of a scene from measurements, by weighted least squares, with confidence bounds.

The sum of squares of all residuals over their standard deviations is minimised (the likelihood of normal noise is
maximised).  With the Jacobian ``J`` of these residuals ``r`` the covariance is ``(J^T J)^-1``, or, as second
derivatives are exact, ``(J^T J + sum r r'')^-1``: both agree where residuals are small or the model is nearly linear.
Unknown deviations are taken as equal and estimated from the residuals; bounds are then those of Student's distribution.

Source: Seber and Wild 2003, sections 2.1, 2.8 and 5.1 (estimation, confidence regions, intervals).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..description.answers import AnswerName, answer_name
from ..description.records import counted
from ..description.scene import Scene, check_scene
from ..description.showing import few, first_lines, notes_in_words, shown
from ..equilibria.settings import Settings
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import TINY, Array
from .arguments import Asked, argument, limits_of
from .solving import ParametricAnswer, ParametricEquilibrium, Values, parametric

__all__ = ["Fit", "Fitting", "Measurement", "fit", "fitting"]


@dataclass(frozen=True)
class Measurement:
    """A measured quantity of one load case.

    Attributes
    ----------
    quantity : str
        As in the answer: ``nodes.tip.position``, ``springs.k.angle``, ``reactions.A.force``; along a member with a
        place, ``members.beam.position at 0.5``; one component by its number, ``nodes.tip.position.1``.
    value : number or list of numbers
        SI units; two components of a vector are enough in a plane scene; ``nan`` where nothing was measured.
    deviation : number, list or None
        Standard deviation of the noise, in the same unit.  None: unknown, for all measurements alike, and equal.
    case : mapping
        Numbers of the scene that differ in this load case: ``{"loads.tip.value": [0, 3]}``.
    """

    quantity: str
    value: ArrayLike
    deviation: ArrayLike | None = None
    case: Values = field(default_factory=dict)


def fit(
    scene: Scene,
    parameters: Asked,
    measurements: Sequence[Measurement],
    *,
    start: Values | None = None,
    settings: Settings | None = None,
) -> Fit:
    """Fit parameters of a scene to measurements, by weighted least squares.

    Parameters
    ----------
    scene : Scene
        Its numbers are the start of the search, and determine the mesh.
    parameters : as of :func:`~sfetcas.parametric`
        Ranges are bounds of the search.
    measurements : sequence of Measurement
    start : mapping, optional
        Values of parameters to start from instead.
    settings : Settings, optional

    Raises
    ------
    SceneError
        The scene has no such parameter or measured quantity; fewer measured numbers than parameters.
    SolveError
        No equilibrium at the start, no convergence, or parameters that the measurements do not determine.
    """
    check_scene(scene, "fit({}, ...)", steps=False)
    return fitting(scene, parameters, measurements, settings=settings).fit(start=start)


def fitting(
    scene: Scene, parameters: Asked, measurements: Sequence[Measurement], *, settings: Settings | None = None
) -> Fitting:
    """Prepare a fit, as :func:`fit` does, for repeated use with other measured values of the same quantities.

    Raises
    ------
    SceneError
        As :func:`fit`.
    """
    check_scene(scene, "fitting({}, ...)", steps=False)
    if not measurements:
        raise SceneError("found none, accepted: one or more", ("measurements",))
    for i, one in enumerate(measurements):
        if not isinstance(one, Measurement):
            raise SceneError(f"found {one!r}, accepted: a Measurement", ("measurements", str(i)))
    parameters = [parameters] if isinstance(parameters, str) else parameters
    asked = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters or ())
    if not asked:
        raise SceneError("found none, accepted: names of numbers of the scene", ("parameters",))
    spans = _spans(scene, measurements)
    twice = sorted(asked.keys() & spans.keys())
    if twice:
        raise SceneError(f"found {twice[0]} in a case, accepted: parameters that no case gives", ("parameters",))
    measured = [_named(one.quantity, i) for i, one in enumerate(measurements)]
    names, places = dict.fromkeys(name.quantity for name in measured), dict[str, list[float]]()
    for name in measured:
        own = places.setdefault(name.record, []) if name.at is not None else []
        own += [name.at] if name.at is not None and name.at not in own else []
    equilibrium = parametric(scene, asked | spans, list(names), places=places, settings=settings)
    chosen = [i for i, one in enumerate(equilibrium.parameters) if one.name in asked]
    return Fitting(equilibrium, tuple(measurements), tuple(equilibrium.parameters[i].name for i in chosen))


def _spans(scene: Scene, measurements: Sequence[Measurement]) -> dict[str, tuple[float, float] | None]:
    """Numbers that cases give, with the range that they have there."""
    values: dict[str, list[float]] = {}
    for i, one in enumerate(measurements):
        for name, value in one.case.items():
            known = argument(scene, name)
            given = _numbers(value, ("measurements", str(i), name))
            values.setdefault(name, list(known.default)).extend(given.tolist())
    ends = {name: (min(given), max(given)) for name, given in values.items()}
    return {name: span if span[0] < span[1] else None for name, span in ends.items()}


def _numbers(value: ArrayLike, where: tuple[str, ...]) -> Array:
    """Numbers in one array."""
    try:
        return np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        raise SceneError(f"found {value!r}, accepted: numbers", where) from None


def _named(quantity: str, number: int) -> AnswerName:
    """What was measured: along a member with a place."""
    where = ("measurements", str(number), "quantity")
    name = answer_name(quantity, *where)
    if set(name.selectors) != ({"at"} if name.kind.along else set()):
        accepted = f"{name.kind.name} at FRACTION" if name.kind.along else name.bare
        raise SceneError(f"found {quantity!r}, accepted: {accepted}", where)
    return name


class Fitting:
    """Measurements of a scene and its equilibrium as a function of parameters; made by :func:`fitting`.

    Attributes
    ----------
    equilibrium : ParametricEquilibrium
        The model, as a function of the parameters and of the numbers that load cases change.
    measurements : tuple of Measurement
    parameters : tuple of str
        Names of the parameters that are fitted.
    cases : tuple of mapping
        The distinct load cases.
    values : ndarray (measured,)
        The measured numbers, SI units.
    """

    def __init__(
        self, equilibrium: ParametricEquilibrium, measurements: tuple[Measurement, ...], parameters: tuple[str, ...]
    ) -> None:
        self.equilibrium, self.measurements, self.parameters = equilibrium, measurements, parameters
        self.cases: tuple[Values, ...] = ()
        rows: list[list[int]] = []
        values: list[list[float]] = []
        deviations: list[list[float]] = []
        self._case: list[int] = []
        for i, one in enumerate(measurements):
            chosen, value, deviation = self._measured(one, i)
            self._case += [self._case_of(one)] * len(chosen)
            rows, values, deviations = [*rows, chosen], [*values, value], [*deviations, deviation]
        self.values, self._deviations = np.concatenate(values), np.concatenate(deviations)
        self._row, self._cases = np.concatenate(rows).astype(np.intp), np.array(self._case)
        self._own = self._columns()
        self._check()

    def __repr__(self) -> str:
        measured = f"{counted(len(self.values), 'measured number')} of {counted(len(self.cases), 'load case')}"
        return shown(self, [measured, *(f"fits {few(self.numbers)}",)])

    # -- what was measured --------------------------------------------------------------------------

    def _case_of(self, one: Measurement) -> int:
        flat = {name: np.asarray(x, dtype=float).ravel().tolist() for name, x in sorted(one.case.items())}
        for i, known in enumerate(self.cases):
            if known == flat:
                return i
        self.cases = (*self.cases, flat)
        return len(self.cases) - 1

    def _measured(self, one: Measurement, number: int) -> tuple[list[int], list[float], list[float]]:
        """Rows of the flat answers, values and deviations of one measurement."""
        where = ("measurements", str(number))
        name, first = _named(one.quantity, number), 0
        for answer in self.equilibrium.answers:
            if answer.name == name.quantity:
                break
            first += answer.size
        size = answer.size
        if name.at is not None:
            places = self.equilibrium.solver.results.places[name.record]
            size //= len(places)
            first += size * places.index(name.at)
        value = _numbers(one.value, (*where, "value"))
        chosen = list(range(size)) if name.component is None else [name.component]
        if len(value) == 2 and len(chosen) == 3 and not self.equilibrium.solver.model.space:
            chosen = [0, 1]
        if len(value) != len(chosen):
            raise SceneError(f"found {one.value!r}, accepted: {len(chosen)} numbers", (*where, "value"))
        deviation = _numbers(np.nan if one.deviation is None else one.deviation, (*where, "deviation"))
        spread = np.broadcast_to(deviation, value.shape) if np.size(deviation) in (1, len(value)) else np.zeros(1)
        if one.deviation is not None and not (np.isfinite(spread) & (spread > 0.0)).all():
            raise SceneError(f"found {one.deviation!r}, accepted: above zero", (*where, "deviation"))
        if np.isinf(value).any():
            raise SceneError(f"found {one.value!r}, accepted: numbers, nan of what was not measured", (*where, "value"))
        there = np.flatnonzero(np.isfinite(value)).tolist()
        return [first + chosen[i] for i in there], value[there].tolist(), spread[there].tolist()

    def _columns(self) -> list[int]:
        """Of all numbers of the equilibrium those that are fitted."""
        first = 0
        own: list[int] = []
        for one in self.equilibrium.parameters:
            own += range(first, first + len(one.default)) if one.name in self.parameters else []
            first += len(one.default)
        return own

    def _check(self) -> None:
        """Refuse too few measurements, and deviations of some only."""
        unknown, count = np.isnan(self._deviations), len(self._own)
        if unknown.any() and not unknown.all():
            raise SceneError("found deviations of some, accepted: of all, or of none", ("measurements",))
        if len(self.values) < count + bool(unknown.any()):
            more = "" if not unknown.any() else ", and one more as their deviation is not known"
            message = f"found {len(self.values)} numbers, accepted: as many as parameters, {count}{more}"
            raise SceneError(message, ("measurements",))
        units = {answer.unit for answer in self.equilibrium.answers}
        if unknown.any() and len(units) > 1:
            accepted = "a deviation of each, as they are of different units"
            raise SceneError(f"found {' and '.join(sorted(units))}, accepted: {accepted}", ("measurements",))

    @property
    def known(self) -> bool:
        """Whether the standard deviations of the measurements are known."""
        return not np.isnan(self._deviations).any()

    @property
    def deviations(self) -> Array:
        """Standard deviations of the measured numbers, (measured,), SI units; 1 where they are not known."""
        return self._deviations if self.known else np.ones(len(self._deviations))

    @property
    def numbers(self) -> tuple[str, ...]:
        """A name for each fitted number."""
        return tuple(self.equilibrium.numbers[i] for i in self._own)

    # -- the fit ------------------------------------------------------------------------------------

    def limits(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the fitted numbers, (numbers,) each, in the units of the scene."""
        known = [one for one in self.equilibrium.parameters if one.name in self.parameters]
        ends = limits_of(known).T
        return ends[:, 0], ends[:, 1]

    def fit(self, values: ArrayLike | None = None, start: Values | None = None) -> Fit:
        """Fit the parameters.

        Parameters
        ----------
        values : (measured,), SI units, optional
            Replace the measured numbers, in the order of ``values``.
        start : mapping, optional
            Start of the search; by default the numbers of the scene.

        Raises
        ------
        SceneError
            There are more or fewer values, or they are not finite.
        SolveError
            No equilibrium at the start, no convergence, or parameters that are not determined.
        """
        from scipy.optimize import least_squares

        measured = self.values if values is None else np.asarray(values, dtype=float).ravel()
        if measured.shape != self.values.shape or not np.isfinite(measured).all():
            raise SceneError(f"found {values!r}, accepted: {len(self.values)} finite numbers", ("values",))
        begin = self.equilibrium.flat(start)[self._own]
        low, high = self.limits()
        width = np.where(np.isfinite(high - low), high - low, 0.0)
        scale = np.maximum(np.abs(begin), width)
        scale = np.where(scale > 0.0, scale, 1.0)
        search = _Search(self, measured, scale, (low > 0.0) & (low < TINY))
        bounds = low / scale, high / scale
        # Of steps that rounding decides the sum of squares does not fall: only their length tells when to end.
        ends = {"ftol": None, "xtol": SHORT, "gtol": None, "max_nfev": MOST}
        found = least_squares(
            search.residuals, np.clip(begin / scale, *bounds), search.jacobian, bounds, "dogbox", x_scale="jac", **ends
        )
        if not found.success:
            raise SolveError(Status.ITERATIONS, f"{found.nfev} steps towards the least sum of squares", search)
        answer = Fit(self, measured, scale, found, tuple(search.reached))
        _refuse_undetermined(answer)
        return answer


class _Search:
    """Residuals over their deviations at scaled numbers; each case begins where it was last accepted.

    No step takes a number that has to be ``positive`` below a fifth of itself.
    """

    def __init__(self, fitting: Fitting, measured: Array, scale: Array, positive: Array) -> None:
        self._of, self._measured, self._scale, self._positive = fitting, measured, scale, positive
        self._here = np.zeros(len(scale))
        self._tried: list[ParametricAnswer] = []
        self.reached: list[ParametricAnswer] = []

    def residuals(self, x: Array) -> Array:
        """Residuals at x, infinite where there is no equilibrium: the step is then shortened.

        Raises
        ------
        SolveError
            There is none at the start.
        """
        nothing = np.full(len(self._measured), np.inf)
        if (self._positive & (x < 0.2 * self._here)).any():
            return nothing
        starts: Sequence[ParametricAnswer | None] = self.reached or [None] * len(self._of.cases)
        try:
            found = [self._solved(x, case, start) for case, start in zip(self._of.cases, starts, strict=True)]
            outputs = np.stack([np.concatenate([np.ravel(a) for a in one.answers.values()]) for one in found])
        except SolveError:
            if not self.reached:
                raise
            return nothing
        self._tried = found
        return np.asarray((outputs[self._of._cases, self._of._row] - self._measured) / self._of.deviations)

    def _solved(self, x: Array, case: Values, start: ParametricAnswer | None) -> ParametricAnswer:
        equilibrium = self._of.equilibrium
        numbers = equilibrium.flat(case)
        numbers[self._of._own] = x * self._scale
        return equilibrium.solve(equilibrium.by_parameter(numbers), start)

    def jacobian(self, x: Array) -> Array:
        """Derivatives of the residuals by x, which was accepted after the residuals there."""
        self._here, self.reached = x.copy(), self._tried
        whole = np.stack([one.flat_jacobian[:, self._of._own] for one in self.reached])
        rows = whole[self._of._cases, self._of._row] * self._scale
        return np.asarray(rows / self._of.deviations[:, None])


SHORT = 1e-8
"""Length of a step, of numbers over their sizes, from which on the search has come to its end."""

MOST = 100
"""Steps of a search."""

UNDETERMINED = 1e-7
"""Share of the largest singular value, of parameters over their size, below which a direction is not determined."""


def _refuse_undetermined(found: Fit) -> None:
    """Refuse what no measurement depends on, alone or together."""
    free, names = np.flatnonzero(~found.held), found.of.numbers
    if not len(free):
        return
    _, values, vectors = np.linalg.svd(found.minimum.jac[:, free], full_matrices=False)
    if values[-1] > UNDETERMINED * values[0]:
        return
    shares = np.abs(vectors[-1])
    taking = [names[free[i]] for i in np.flatnonzero(shares > 0.1 * shares.max())]
    said = f"nothing that was measured depends on {taking[0]}"
    if len(taking) > 1:
        said = f"{', '.join(taking[:-1])} and {taking[-1]} may change together so that nothing that was measured does"
    raise SolveError(Status.UNDETERMINED, said, found)


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted parameters with their confidence bounds, in the units of the scene.

    Attributes
    ----------
    of : Fitting
    measured : ndarray (measured,)
        The measured numbers, SI units.
    scale : ndarray (numbers,)
        Scales of the fitted numbers.
    minimum : scipy.optimize.OptimizeResult
        End of the search: ``x``, numbers over their scales; ``fun``, residuals over deviations; ``jac``, derivatives.
    answers : tuple of ParametricAnswer
        The equilibrium of each load case at the fitted parameters.
    """

    of: Fitting
    measured: Array
    scale: Array
    minimum: Any
    answers: tuple[ParametricAnswer, ...]

    def __repr__(self) -> str:
        deviations = dict(zip(self.of.numbers, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))
        return shown(
            self,
            [f"chi_square={self.chi_square:.6g}", f"freedom={self.freedom}"],
            [
                *first_lines(
                    self.estimates, lambda name: f"{name}: {self.estimates[name]:.6g} +- {deviations[name]:.2g}"
                ),
                *notes_in_words(self.notes),
            ],
        )

    @property
    def estimates(self) -> dict[str, float]:
        """The fitted numbers by their names."""
        return dict(zip(self.of.numbers, (self.minimum.x * self.scale).tolist(), strict=True))

    @property
    def residuals(self) -> Array:
        """Computed less measured values, (measured,), SI units."""
        return np.asarray(self.minimum.fun * self.of.deviations)

    @property
    def held(self) -> Array:
        """Which fitted numbers are at an active bound, (numbers,) of bool."""
        return np.asarray(self.minimum.active_mask * self.minimum.grad < 0.0)

    @property
    def freedom(self) -> int:
        """Degrees of freedom: number of measured numbers less that of fitted numbers at no active bound."""
        return len(self.measured) - int((~self.held).sum())

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals over deviations; with known deviations near :attr:`freedom` for a correct model."""
        return float(self.minimum.fun @ self.minimum.fun)

    @property
    def probability(self) -> float | None:
        """Probability that noise alone gives a larger :attr:`chi_square`; None where deviations are not known."""
        from scipy.special import chdtrc

        return float(chdtrc(self.freedom, self.chi_square)) if self.of.known and self.freedom else None

    @property
    def deviation(self) -> float | None:
        """Standard deviation of the noise estimated from the residuals, SI unit; None where deviations are known."""
        return None if self.of.known else float(np.sqrt(self.chi_square / self.freedom))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the reader on bounds and residuals."""
        found = []
        for name, held in zip(self.of.numbers, self.held, strict=True):
            if held:
                found.append(
                    f"{name} is at an end of its range: it has no bounds, and those of others take it as known"
                )
        if self.probability is not None and self.probability < UNLIKELY:
            share = self.chi_square / self.freedom
            found.append(f"residuals are {np.sqrt(share):.3g} times as large as their deviations say")
        return tuple(found)

    # -- confidence ---------------------------------------------------------------------------------

    @property
    def covariance(self) -> Array:
        """Covariance matrix (numbers, numbers) by first derivatives; nan for numbers at an active bound."""
        return self._inverse(self.minimum.jac.T @ self.minimum.jac)

    @functools.cached_property
    def full_covariance(self) -> Array:
        """Covariance matrix (numbers, numbers) by first and second derivatives; nan for numbers at an active bound."""
        size = len(self.minimum.x)
        curved: Array = np.zeros((size, size))
        shares = self.minimum.fun / self.of.deviations
        for i, answer in enumerate(self.answers):
            weights = np.zeros(self.of.equilibrium.solver.results.size)
            np.add.at(weights, self.of._row[self.of._cases == i], shares[self.of._cases == i])
            curved += answer.flat_hessian(weights)[np.ix_(self.of._own, self.of._own)]
        curved *= np.outer(self.scale, self.scale)
        return self._inverse(self.minimum.jac.T @ self.minimum.jac + curved)

    def _inverse(self, information: Array) -> Array:
        free = np.ix_(~self.held, ~self.held)
        found = np.full(information.shape, np.nan)
        size = np.sqrt(np.diag(information[free]))
        found[free] = np.linalg.inv(information[free] / np.outer(size, size)) / np.outer(size, size)
        share = 1.0 if self.of.known else self.chi_square / self.freedom
        return np.asarray(share * found * np.outer(self.scale, self.scale))

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the fitted numbers, by name."""
        return dict(zip(self.of.numbers, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """Correlation matrix (numbers, numbers) of the fitted numbers."""
        size = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(size, size))

    def bounds(self, confidence: float = 0.95, *, full: bool = False) -> dict[str, tuple[float, float]]:
        """Confidence interval (low, high) of each fitted number by itself.

        ``full`` uses second derivatives as well.  SceneError unless ``confidence`` is between 0 and 1.
        """
        if not 0.0 < confidence < 1.0:
            raise SceneError(f"found {confidence:g}, accepted: between 0 and 1", ("confidence",))
        from scipy.special import ndtri, stdtrit

        p = 0.5 * (1.0 + confidence)
        wide = ndtri(p) if self.of.known else stdtrit(self.freedom, p)
        size = wide * np.sqrt(np.diag(self.full_covariance if full else self.covariance))
        middle = self.minimum.x * self.scale
        pairs = zip((middle - size).tolist(), (middle + size).tolist(), strict=True)
        return dict(zip(self.of.numbers, pairs, strict=True))

    def ellipse(self, first: str, second: str, confidence: float = 0.95, points: int = 100) -> Array:
        """Points (points, 2) on the boundary of the joint confidence region of two fitted numbers."""
        places = [self._place(name) for name in (first, second)]
        tail = 1.0 - confidence
        # Chi-square of two degrees of freedom, and twice Fisher's distribution of two and as many as there are.
        n = self.freedom
        square = -2.0 * np.log(tail) if self.of.known else n * (tail ** (-2.0 / n) - 1.0)
        turn = np.linspace(0.0, 2.0 * np.pi, points)
        circle = np.sqrt(square) * np.column_stack([np.cos(turn), np.sin(turn)])
        covariance = self.covariance[np.ix_(places, places)]
        return np.asarray((self.minimum.x * self.scale)[places] + circle @ np.linalg.cholesky(covariance).T)

    def _place(self, name: str) -> int:
        if name not in self.of.numbers:
            raise SceneError(f"found {name!r}, accepted: {', '.join(self.of.numbers)}", ("parameters",))
        return self.of.numbers.index(name)


UNLIKELY = 1e-3
"""Probability below which residuals are too large for their deviations."""
