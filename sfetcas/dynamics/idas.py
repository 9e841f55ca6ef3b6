"""IDAS (SUNDIALS) on the equations of index 1: backward differentiation with order and steps by the error.

Since the constraints are differentiated twice, norms of quaternions, constraints and their rates drift.  At every time
of the answer state and rates are projected back onto them by the smallest change, and the drift before is reported as
``violation``.  Every few answers, and at each knot of a history, IDAS is restarted from the projected state.

Source: Hindmarsh et al. 2005 (SUNDIALS, doi 10.1145/1089014.1089020); Eich 1993 (projection, doi 10.1137/0730076).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.quaternion import angular_velocity
from ..mechanics.equations import State
from ..mechanics.rotations import RotationFreedom
from ..stopping import noted
from .beginning import at_rest
from .index_one import LINEAR, IndexOne
from .inertialess import check_inertia
from .integrators import InitialState, Integrator, TimeGrid
from .projecting import closed, of_unit_length, shortest
from .sampling import Sample

__all__ = ["Idas"]

TOGETHER = 10
"""Answers from one fresh start to the next: a start costs about as many steps as two or three answers."""

STEPS = 100_000
"""Steps at most from one answer to the next."""

OF_STEP = 0.02
"""Tolerance of a step over the wanted error at the end, as errors of steps add up (measured: to 30 times and more)."""

FINER = 0.1
"""Tolerance of a finer run over that of the one before."""

USUAL = 100.0
"""Rates are as accurate as moves nothing by more than the tolerance in the whole time over this."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """What IDAS does without a fresh start: from a begin to some times, along one polynomial of each history.

    Attributes
    ----------
    begin : float
    ends : ndarray
    terms : list of tuple of float
        Coefficients of the factor of each group of loads in the fraction of the piece.
    """

    begin: float
    ends: Array
    terms: list[tuple[float, ...]]

    @property
    def end(self) -> float:
        """Of the piece."""
        return float(self.ends[-1])

    @property
    def length(self) -> float:
        """Of the piece."""
        return self.end - self.begin

    def parameters(self, degree: int) -> Array:
        """Those of :class:`IndexOne`: its length, and the coefficients by their powers."""
        padded = [[*terms, *[0.0] * (degree + 1 - len(terms))] for terms in self.terms]
        return np.concatenate([[self.length], np.array(padded).T.ravel()])

    @property
    def fractions(self) -> tuple[float, ...]:
        """Of the ends in the piece; pieces alike but for rounding have the same."""
        return tuple(np.round((self.ends - self.begin) / self.length, 12).tolist())

    def factors(self, s: float) -> Array:
        """Factors of the groups of loads at a fraction."""
        return np.array([sum(c * s**k for k, c in enumerate(terms)) for terms in self.terms])

    def rates(self, s: float) -> Array:
        """Rates of these factors."""
        slopes = [[k * c * s ** (k - 1) for k, c in enumerate(terms) if k] for terms in self.terms]
        return np.array([sum(terms) for terms in slopes]) / self.length


@final
class Idas(Integrator):
    """Integration by IDAS (variable-order backward differentiation formulas) through CasADi."""

    def samples(self, begun: InitialState, course: TimeGrid) -> Iterator[Sample]:
        """States at the times of the answer, projected onto the constraints; as of :meth:`.Integrator.samples`.

        Raises
        ------
        SceneError
            Something rotates or moves without inertia, which equations of index 1 exclude.
        SolveError
            IDAS cannot go on; the states before have been given.
        """
        pieces = self._pieces(course)
        degree = max(len(terms) for piece in pieces for terms in piece.terms) - 1
        one = IndexOne(self.system, degree)
        solver, projection = _Solver(one, course), _Projection(one)
        x, p = projection.packed(begun.state, begun.rates), pieces[0].parameters(degree)
        check_inertia(self.system.equations, np.array(one.matrix(x, 0.0, p)))
        wanted = set(course.times.tolist())
        if 0.0 in wanted:
            yield projection.projected(x, pieces[0], 0.0, p)[1]
        # What the beginning misses is not drift.
        projection.norm = projection.gap = 0.0
        while pieces:
            piece = pieces.pop(0)
            found = solver.solve(x, piece.parameters(degree), piece.fractions)
            if found is None:
                if len(piece.ends) == 1:
                    raise self._failed(piece)
                pieces[:0] = [
                    self._piece(begin, np.array([end])) for begin, end in pairwise([piece.begin, *piece.ends])
                ]
                continue
            self.count += solver.steps
            for t, reached in zip(piece.ends.tolist(), found, strict=True):
                try:
                    x, sample = projection.projected(reached, piece, t, piece.parameters(degree))
                except RuntimeError:
                    raise self._failed(piece) from None
                self.norm, self.gap = projection.norm, projection.gap
                if t in wanted:
                    yield sample
                self.proceed(t)

    def _pieces(self, course: TimeGrid) -> list[_Piece]:
        """Pieces up to the end."""
        unit, times, same = self.system.masses.time, course.times, tolerances.DECIMAL * course.end
        inside = {t / unit for history in self.system.histories if history is not None for t in history.t}
        knots = [0.0, *sorted(t for t in inside if same < t < course.end - same), course.end]
        found = []
        for begin, end in pairwise(knots):
            # What stands at a knot but for rounding is the knot.
            own, at = times[(times > begin + same) & (times < end - same)], times[np.abs(times - end) <= same]
            ends = np.append(own, at[:1] if len(at) else end)
            for first in range(0, len(ends), TOGETHER):
                found.append(self._piece(begin, ends[first : first + TOGETHER]))
                begin = found[-1].end
        return found

    def _piece(self, begin: float, ends: Array) -> _Piece:
        unit = self.system.masses.time
        span = begin * unit, float(ends[-1]) * unit
        terms = [(1.0,) if history is None else history.between(*span) for history in self.system.histories]
        return _Piece(begin, ends, terms)

    def _failed(self, piece: _Piece) -> SolveError:
        unit = self.system.masses.time
        span = f"between {piece.begin * unit:.6g} and {piece.end * unit:.6g} s"
        detail = f"IDAS did not get on {span}: steps became too short, more than {STEPS}, or joints singular"
        return SolveError(Status.STOPPED, detail)


class _Solver:
    """IDAS for any fractions of a piece at which answers are wanted."""

    def __init__(self, one: IndexOne, course: TimeGrid) -> None:
        self._one, self.steps = one, 0
        self._made: dict[tuple[float, ...], ca.Function] = {}
        tolerance = OF_STEP * FINER**course.rounds * course.accuracy
        rate = USUAL / course.end
        q, y, w, unwrapped = one.states
        a, lam = one.algebraic
        sizes, tolerances = (q, y, w, unwrapped, a, lam), (1.0, course.size, rate, 1.0, rate**2, rate**2)
        absolute = np.repeat(np.array(tolerances) * tolerance, sizes)
        self._options = {
            "reltol": tolerance,
            "abstolv": absolute.tolist(),
            "max_num_steps": STEPS,
            "linear_solver": LINEAR,
            "suppress_algebraic": True,
            "disable_internal_warnings": True,
        }

    def solve(self, x: Array, p: Array, fractions: tuple[float, ...]) -> list[Array] | None:
        """States at fractions of a piece, None where IDAS fails; ``steps`` are those that it took."""
        if fractions not in self._made:
            problem = self._one.problem
            self._made[fractions] = ca.integrator("idas", "idas", problem, 0.0, list(fractions), self._options)
        function = self._made[fractions]
        # CasADi takes an interrupt for a residual that cannot be evaluated, and forgets it.
        with noted(forward=True) as interrupted:
            try:
                z = self._one.answers(x, 0.0, p)[0]
                found = np.array(function(x0=x, z0=z, p=p)["xf"])
            except RuntimeError:
                if interrupted:
                    raise KeyboardInterrupt from None
                return None
        self.steps = int(function.stats()["nsteps"])
        return list(found.T) if np.isfinite(found).all() else None


class _Projection:
    """States of the index-1 form brought back to norms, closings and rates that these allow."""

    def __init__(self, one: IndexOne) -> None:
        self._one, self.norm, self.gap = one, 0.0, 0.0

    def packed(self, state: State, rates: Array) -> Array:
        """A state with its rates as differential unknowns."""
        return np.concatenate([state.q[self._one.turning].ravel(), state.y, rates, state.unwrapped])

    def _spin(self, rates: Array, turn: Array, faster: Array) -> Array:
        """Angular velocities (rotations, turns) of the rates of all unknowns, and of what motions turn."""
        system = self._one.system
        unknown, weight = (part[: system.of_places] for part in (system.unknown, system.weight))
        free = np.where(unknown >= 0, weight * rates[unknown], 0.0).reshape(-1, system.turns)
        driven = angular_velocity(turn, faster)[:, 3 - system.turns :]
        return free + np.where(system.model.rotations.kind[:, None] == RotationFreedom.FIXED, driven, 0.0)

    def projected(self, x: Array, piece: _Piece, t: float, p: Array) -> tuple[Array, Sample]:
        """The unknowns and the sample at a time; what norms and closings missed before is kept."""
        one, equations = self._one, self._one.system.equations
        q, y, w, unwrapped = np.split(x, np.cumsum(one.states)[:-1])
        s = 1.0 if t == piece.end else (t - piece.begin) / piece.length
        loading = one.system.loading(piece.factors(s))
        turned, norm = of_unit_length(q.reshape(len(one.turning), -1))
        rotations = at_rest(equations.model).q
        rotations[one.turning] = turned
        state = State(rotations, y, np.zeros(equations.rows), unwrapped)
        state, gap = closed(equations, equations.holding(state, loading), loading)
        state = replace(state, unwrapped=equations.model.unwrapping.angles(state.q, state.unwrapped))
        opening = np.array(one.answers(self.packed(state, w), s, p)[-1]).ravel()
        if equations.rows:
            w = w + shortest(equations, opening)
        x = self.packed(state, w)
        _, there, v, a, _ = (np.array(part).ravel() for part in one.answers(x, s, p))
        self.norm, self.gap = max(self.norm, norm), max(self.gap, gap)
        spin = self._spin(w, loading.turn, one.system.loading(piece.rates(s)).turn)
        return x, Sample(t, state.q, state.y, there, v, a, spin, state.unwrapped)
