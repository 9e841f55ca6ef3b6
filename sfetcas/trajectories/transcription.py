"""A controlled motion as a nonlinear program: direct collocation at the stages of Radau IIA.

Unknowns are, at each stage of each interval, rotations, displacements and multipliers ``d``, quantities ``x``, rates
``v`` and accelerations ``a``.  In an interval of length h

    h v_i = sum_j D_ij x_j,      h a_i = sum_j D_ij v_j,      0 = balance(d_i, v_i, a_i),      x_i = X(d_i)

where j = 0 is the last stage before: x and v are continuous, and the index-3 equations are met at the stages, as in the
integrators of the same name.  Everything nonlinear is the function of one stage.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..dynamics.methods import RADAU
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array, Index
from ..mathematics.interpolation import differentiation, integration
from ..mathematics.pieces import Pieces, Unknown
from ..mathematics.relations import Relation
from .controlled import ControlledSystem
from .statement import MotionStatement, Signal

__all__ = ["GridMotion", "Transcription"]


@dataclass(frozen=True, eq=False)
class GridMotion:
    """A motion on the grid of a transcription, as a start or as a solution; dimensionless but for ``end`` and controls.

    Attributes
    ----------
    end : float
        Time at the end, s.
    q : ndarray (stages of all intervals, rotations, components)
    d : ndarray (stages, total)
        Displacements and multipliers in their positions; the entries of rotation vectors are not used.
    x, v, a : ndarray (stages, quantities)
    unwrapped : ndarray (stages, angles that count turns)
    controls : ndarray (points, controls)
        At the ends of intervals, where they are linear; in the intervals, where they are constant.
    variables : ndarray (variables,)
    """

    end: float
    q: Array
    d: Array
    x: Array
    v: Array
    a: Array
    unwrapped: Array
    controls: Array
    variables: Array


class Transcription:
    """The nonlinear program of one statement on one system.

    Parameters
    ----------
    statement : MotionStatement
    system : ControlledSystem
    guess : GridMotion
        The start; rotations are counted from its rotations.
    """

    def __init__(self, statement: MotionStatement, system: ControlledSystem, guess: GridMotion) -> None:
        self.statement, self.system, self.guess = statement, system, guess
        self.places = RADAU[statement.stages]
        self.intervals, self.stages = len(statement.shares), statement.stages
        self.pieces = Pieces()
        self._lifted: dict[str, Unknown] = {}
        self.resting: dict[str, Unknown] = {}
        self._unknowns()
        self._move()
        self._control()
        self._add_equations()
        self._ask()

    # -- unknowns ---------------------------------------------------------------------------------------

    def _unknowns(self) -> None:
        system, guess, statement, pieces = self.system, self.guess, self.statement, self.pieces
        shape = (self.intervals, self.stages)
        low, high = statement.duration
        unit = max(guess.end, TINY)
        self.end = pieces.unknowns("end time", guess.end, low, high, unit)
        rotation_unknowns = system.system.equations.rotation_unknowns
        d = guess.d.copy()
        # Rotations are counted from those of the guess.
        d[:, :rotation_unknowns] = 0.0
        self.references = np.hstack([guess.q.reshape(len(d), -1), guess.unwrapped])
        self.d = pieces.unknowns("d", d.reshape(*shape, -1))
        self.x, self.v, self.a = (
            pieces.unknowns(name, getattr(guess, name).reshape(*shape, -1)) for name in ("x", "v", "a")
        )
        begin = system.begin
        # What is known is no unknown: equal bounds.
        self.x0 = pieces.unknowns("x at t0", begin.x, begin.x, begin.x)
        self.v0 = pieces.unknowns("v at t0", begin.v, begin.v, begin.v)
        self.controls, self.variables = [], []
        for k, one in enumerate(statement.controls):
            size = self._unit_of(one.low, one.high, system.arguments.defaults[k])
            values = guess.controls[:, k]
            self.controls.append(pieces.unknowns(f"control {one.name}", values, one.low, one.high, size))
        for k, variable in enumerate(statement.variables):
            default = system.arguments.defaults[len(statement.controls) + k]
            size = self._unit_of(variable.low, variable.high, default)
            value = guess.variables[k]
            self.variables.append(
                pieces.unknowns(f"variable {variable.name}", value, variable.low, variable.high, size)
            )

    @staticmethod
    def _unit_of(low: float, high: float, default: float) -> float:
        sizes = [abs(x) for x in (low, high, default) if np.isfinite(x) and x != 0.0]
        return max(sizes, default=1.0)

    # -- motion -----------------------------------------------------------------------------------------

    @functools.cached_property
    def _slopes(self) -> Array:
        """Derivatives at the stages by the values at the begin and the stages, (stages, 1 + stages)."""
        return differentiation(np.append(0.0, self.places))[1:]

    def _before(self, block: Unknown, begin: Unknown) -> Index:
        """Places of a quantity before each interval, (intervals, n)."""
        return np.vstack([begin.index[None, :], block.index[:-1, -1]])

    def _move(self) -> None:
        """Collocation, and the equations of the stages."""
        n, s = self.system.quantities, self.stages
        w, c = ca.SX.sym("w", s + 3), ca.SX.sym("c", s + 2)
        # rate, value before, values at the stages, end time; share of it in the unit of time, slopes
        row = w[s + 2] * c[0] * w[0] - ca.dot(c[1:], w[1 : s + 2])
        linear = ca.Function("collocation", [w, c], [row])
        slopes, shares = self._slopes, self.statement.shares / self.system.time
        first = np.repeat(shares, s * n)
        constants = np.hstack([first[:, None], np.tile(np.repeat(slopes, n, axis=0), (self.intervals, 1))])
        for name, rate, value, begin in (("v", self.v, self.x, self.x0), ("a", self.a, self.v, self.v0)):
            before = np.broadcast_to(self._before(value, begin)[:, None, :], rate.index.shape)
            inside = [np.broadcast_to(value.index[:, j, None, :], rate.index.shape) for j in range(s)]
            end = np.broadcast_to(self.end.index, rate.index.shape)
            index = np.stack([rate.index, before, *inside, end], axis=-1).reshape(-1, s + 3)
            self.pieces.add_rows(f"collocation of {name}", linear, index, constants)

    # -- controls ---------------------------------------------------------------------------------------

    def _control(self) -> None:
        """Controls at the stages, and their rates."""
        self.at_stages: list[Index] = []
        statement, order = self.statement, self.statement.order
        shape = (self.intervals, self.stages)
        w, c = ca.SX.sym("w", 3), ca.SX.sym("c")
        between = ca.Function("between", [w, c], [w[2] - (1.0 - c) * w[0] - c * w[1]])
        z = ca.SX.sym("z", 4)
        slope = ca.Function("slope", [z, c], [c * z[3] * z[2] - (z[1] - z[0])])
        self.rates: dict[str, Unknown] = {}
        for one, block in zip(statement.controls, self.controls, strict=True):
            if order == 0:
                self.at_stages.append(np.broadcast_to(block.index[:, None], shape))
                continue
            values, unit = self.guess.controls[:, len(self.at_stages)], block.unit.flat[0]
            ends = block.index[:-1], block.index[1:]
            inside = values[:-1, None] + np.diff(values)[:, None] * self.places
            lifted = self.pieces.unknowns(f"control {one.name} at stages", inside, unit=unit)
            index = np.stack([*(np.repeat(e, self.stages) for e in ends), lifted.index.ravel()], axis=1)
            places = np.tile(self.places, self.intervals)[:, None]
            self.pieces.add_rows(f"control {one.name}", between, index, places, unit=unit)
            self.at_stages.append(lifted.index)
            if np.isfinite(one.rate) or ("rate", one.name) in statement.signals:
                span = self.guess.end * statement.shares
                size = unit / self.guess.end
                rate = self.pieces.unknowns(f"rate of {one.name}", np.diff(values) / span, -one.rate, one.rate, size)
                end = np.full(self.intervals, self.end.index.flat[0])
                places = np.stack([*ends, rate.index, end], axis=1)
                self.pieces.add_rows(f"rate of {one.name}", slope, places, statement.shares[:, None], unit=unit)
                self.rates[one.name] = rate

    # -- answers ----------------------------------------------------------------------------------------

    def _add_equations(self) -> None:
        """The equations of the stages, with the answers that are asked for as unknowns of their own."""
        system, shape = self.system, (self.intervals, self.stages)
        numbers = [*self.at_stages, *(np.broadcast_to(block.index, shape) for block in self.variables)]
        self.numbers = np.stack(numbers, axis=-1) if numbers else np.zeros((*shape, 0), np.intp)
        outputs, first, parts, chosen, units = self._guessed(), 0, [], [], []
        for one in system.results.results:
            own = first + system.picked[one.name]
            unit = system.unit(one.name)
            block = self.pieces.unknowns(one.name, outputs[:, own].reshape(*shape, -1), unit=unit)
            self._lifted[one.name] = block
            parts.append(block.index)
            chosen.append(own)
            units.append(np.full(len(own), unit))
            first += one.size
        blocks = [self.d.index, self.x.index, self.v.index, self.a.index, self.numbers, *parts]
        index = np.concatenate([block.reshape(self.intervals * self.stages, -1) for block in blocks], axis=1)
        of_rows = np.concatenate([np.ones(system.total + system.quantities), *units])
        function = self._stage_rows(np.concatenate([np.zeros(0, np.intp), *chosen]))
        self.pieces.add_rows("equations of motion", function, index, self.references, unit=of_rows)

    def _stage_rows(self, chosen: Index) -> ca.Function:
        """(unknowns of a stage and its answers, reference) -> what has to vanish."""
        system, stage = self.system, self.system.stage
        sizes = [system.total, *[system.quantities] * 3, len(system.arguments.defaults), len(chosen)]
        w, reference = ca.MX.sym("w", sum(sizes)), ca.MX.sym("reference", stage.size1_in("reference"))
        d, x, v, a, numbers, outputs = ca.vertsplit(w, np.cumsum([0, *sizes]).tolist())
        balance, quantities, answers = stage(d, v, a, numbers, reference)
        rows = [balance, quantities - x, answers[chosen.tolist()] - outputs]
        return ca.Function("stage_rows", [w, reference], [ca.vertcat(*rows)])

    def _guessed(self) -> Array:
        """Answers of the guess, (stages of all intervals, numbers of answers)."""
        guess, n = self.pieces.guess, self.intervals * self.stages
        parts = [guess[block.index].reshape(n, -1).T for block in (self.d, self.v, self.a)]
        given = guess[self.numbers].reshape(n, -1).T
        return np.array(self.system.stage.map(n)(*parts, given, self.references.T)[2]).T

    # -- what is asked ----------------------------------------------------------------------------------

    def _ask(self) -> None:
        statement = self.statement
        self.integrals: dict[int, Index] = {}
        cost, summed = self._split_cost()
        bounded = {symbol.__hash__() for one in statement.required for symbol in ca.symvar(one.relation.expression)}
        bounded |= {symbol.__hash__() for symbol in ca.symvar(cost)}
        for number, (symbol, _) in enumerate(statement.integrals):
            if symbol.__hash__() in bounded:
                self._integrate(number, symbol)
        for one in statement.required:
            name, varying = one.name, _varying(one.name, one.relation)
            if not len(varying.low):
                continue
            function, index = self.expression(name, varying.expression)
            unit = self._sizes(function, index)
            self.pieces.add_rows(name, function, index, None, varying.low, varying.high, unit)
        self._cost(cost, summed)
        if statement.resting:
            self._rest()

    def _sizes(self, function: ca.Function, index: Index) -> Array:
        """By how much rows change when any unknown that they read changes by its unit, (rows,)."""
        w = ca.MX.sym("w", index.shape[1])
        slopes = ca.Function("slopes", [w], [ca.densify(ca.jacobian(function(w), w))])
        guess, units = self.pieces.guess, self.pieces.units
        seen = [np.abs(np.array(slopes(guess[row]))) * units[row] for row in index]
        size = np.max([each.max(axis=1, initial=0.0) for each in seen], axis=0)
        return np.asarray(np.where(size > 0.0, size, 1.0))

    def _split_cost(self) -> tuple[ca.MX, dict[int, float]]:
        """The cost without the integrals that stand in it linearly, and by what these are multiplied.

        An integral that is an unknown of its own would hide from the solver that its integrand is convex.
        """
        cost = self.statement.objective
        symbols = [symbol for symbol, _ in self.statement.integrals]
        slopes = {i: ca.jacobian(cost, symbol) for i, symbol in enumerate(symbols)}
        linear = {i: slope for i, slope in slopes.items() if not ca.symvar(slope)}
        summed = {i: float(ca.evalf(ca.densify(slope))) for i, slope in linear.items()}
        chosen = [symbols[i] for i in linear]
        return ca.substitute([cost], chosen, [ca.MX(0)] * len(chosen))[0], {i: x for i, x in summed.items() if x}

    def _cost(self, cost: ca.MX, summed: dict[int, float]) -> None:
        """What is to be least, over its size: all pieces by the same."""
        shares = self.statement.shares[:, None]
        pieces: list[tuple[ca.Function, Index, Array | None, float]]
        pieces = [(*self._quadrature(i), shares, x) for i, x in summed.items()]
        if ca.symvar(cost):
            pieces.append((*self.expression("cost", cost), None, 1.0))
        size = self._size(pieces)
        for function, index, constants, factor in pieces:
            self.pieces.add_cost("cost", function, index, constants, weight=COST * factor / size)

    def _size(self, pieces: Sequence[tuple[ca.Function, Index, Array | None, float]]) -> float:
        """Size of a sum of pieces: as in the guess, or by how much it changes when all unknowns do by their units."""
        first = second = 0.0
        guess, units = self.pieces.guess, self.pieces.units
        for function, index, constants, factor in pieces:
            for k, row in enumerate(index):
                more = [] if constants is None else [constants[k]]
                first += factor * float(function(guess[row], *more))
                second += factor * float(function(guess[row] + units[row], *more))
        return max(abs(first), abs(second - first)) or 1.0

    def _quadrature(self, number: int) -> tuple[ca.Function, Index]:
        """(unknowns of an interval and the end time, share) -> integral over it, and places (intervals, w)."""
        weights = integration(self.places, np.array([1.0]))[0]
        function, index = self.expression("integral", self.statement.integrals[number][1])
        n, width = self.intervals, index.shape[1]
        index = np.broadcast_to(index, (n * self.stages, width)).reshape(n, -1)
        w, c = ca.MX.sym("w", index.shape[1] + 1), ca.MX.sym("c")
        parts = [w[i * width : (i + 1) * width] for i in range(self.stages)]
        gained = sum((weights[i] * function(part) for i, part in enumerate(parts)), ca.MX(0))
        places = np.concatenate([index, np.full((n, 1), self.end.index.flat[0])], axis=1)
        return ca.Function("integral", [w, c], [w[-1] * c * gained]), places

    def _integrate(self, number: int, symbol: ca.MX) -> None:
        """A running integral by the quadrature of the stages, exact as the motion is."""
        gained, index = self._quadrature(number)
        n, name = self.intervals, f"integral {number}"
        unit = self._size([(gained, index, self.statement.shares[:, None], 1.0)])
        values = self.pieces.unknowns(name, np.zeros(n), unit=unit)
        before = np.append(self._constant(f"{name} at t0", np.zeros(1)).index, values.index[:-1])
        w, c = ca.MX.sym("w", index.shape[1] + 2), ca.MX.sym("c")
        row = w[-1] - w[-2] - gained(w[:-2], c)
        places = np.concatenate([index, np.stack([before, values.index], axis=1)], axis=1)
        shares = self.statement.shares[:, None]
        self.pieces.add_rows(name, ca.Function("integral", [w, c], [row]), places, shares, unit=unit)
        self.integrals[symbol.__hash__()] = values.index[-1:]

    def _rest(self) -> None:
        """At rest at the end: no momentum, and an equilibrium under controls that stay."""
        system = self.system
        numbers = []
        for k, one in enumerate(self.statement.controls):
            size = self._unit_of(one.low, one.high, system.arguments.defaults[k])
            guess = float(np.clip(0.0, one.low, one.high))
            block = self.pieces.unknowns(f"{one.name} at rest", guess, one.low, one.high, size)
            self.statement.rest(one.name)
            self._lifted[f"{one.name} at rest"] = self.resting[one.name] = block
            numbers.append(block.index.ravel())
        numbers += [block.index.ravel() for block in self.variables]
        rows, free = system.system.layout.lam, system.system.equations.unknowns
        impulse = self.pieces.unknowns("impulse at rest", np.zeros(rows))
        lam = self.pieces.unknowns("multipliers at rest", np.zeros(rows))
        momenta, forces = self._unresolved()
        left = self.pieces.unknowns("momenta left", np.zeros(momenta.shape[1]))
        bent = self.pieces.unknowns("shapes left", np.zeros(forces.shape[1]))
        parts = [self.d.index[-1, -1, :free], self.v.index[-1, -1], np.concatenate([np.zeros(0, np.intp), *numbers])]
        parts += [block.index.ravel() for block in (impulse, lam, left, bent)]
        index = np.concatenate(parts)
        w, reference = ca.MX.sym("w", len(index)), ca.MX.sym("reference", self.references.shape[1])
        d, v, given, pushed, fixed, momentum, shape = ca.vertsplit(w, np.cumsum([0, *map(len, parts)]).tolist())
        found = system.rest(ca.vertcat(d, ca.MX.zeros(rows)), v, reference, given, pushed, fixed)
        balanced = [found[0] - ca.mtimes(ca.DM(momenta), momentum), found[1] - ca.mtimes(ca.DM(forces), shape)]
        function = ca.Function("rest", [w, reference], [ca.vertcat(*balanced)])
        self.pieces.add_rows("rest at the end", function, index[None, :], self.references[-1:])

    def _unresolved(self) -> tuple[Array, Array]:
        """Momenta and elastic forces of the shapes that vibrate too fast for the intervals.

        No control can bring them to rest, and the method damps them; so they are left out of what rest asks for.
        """
        end = len(self.references) - 1
        d = self.guess.d[end].copy()
        d[: self.system.system.equations.rotation_unknowns] = 0.0
        numbers = self.pieces.guess[self.numbers[-1, -1]]
        omega, momenta, forces = self.system.shapes(d, self.references[end], numbers)
        step = self.statement.shares[-1] * self.guess.end / self.system.time
        fast = omega * step > RESOLVED
        massive = fast & np.isfinite(omega)
        self.resolved = int((~fast).sum())
        return _scaled(momenta[:, massive]), _scaled(forces[:, fast])

    # -- expressions ------------------------------------------------------------------------------------

    def _places_of(self, symbol: ca.MX) -> Index | None:
        """Places of a symbol, (instances, size): one for each stage, or one instance."""
        key, statement, n = symbol.__hash__(), self.statement, self.intervals * self.stages
        if key == statement.end_time.__hash__():
            return self.end.index.reshape(1, 1)
        if key in self.integrals:
            return self.integrals[key][None, :]
        for name, one in statement.constants.items():
            if key == one.__hash__():
                number = [variable.name for variable in statement.variables].index(name)
                return self.variables[number].index.reshape(1, 1)
        for name, one in statement.rests.items():
            if key == one.__hash__() and f"{name} at rest" in self._lifted:
                return self._lifted[f"{name} at rest"].index.reshape(1, 1)
        for signal in statement.signals.values():
            keys = [one.__hash__() for one in (signal.along, signal.begin, signal.end)]
            if key in keys:
                which = keys.index(key)
                return self._signal(signal)[which]().reshape(n if which == 0 else 1, -1)
        return None

    def _signal(self, signal: Signal) -> tuple[Callable[[], Index], ...]:
        """What gives the places of a signal at all stages, at the begin and at the end."""
        shape = (self.intervals, self.stages, 1)
        if signal.kind == "time":
            block = self._time()
            return (
                lambda: block.index[..., None],
                lambda: self._constant("time at t0", 0.0).index,
                lambda: self.end.index,
            )
        if signal.kind == "control":
            number = [one.name for one in self.statement.controls].index(signal.name)
            own = self.controls[number].index
            return lambda: self.at_stages[number][..., None], lambda: own[:1], lambda: own[-1:]
        if signal.kind == "rate":
            own = self.rates[signal.name].index
            return lambda: np.broadcast_to(own[:, None, None], shape), lambda: own[:1], lambda: own[-1:]
        block = self._lifted[signal.name]
        return lambda: block.index, lambda: self._begun(signal.name).index, lambda: block.index[-1, -1]

    def _time(self) -> Unknown:
        if "time" not in self._lifted:
            fractions = self.statement.fractions
            block = self.pieces.unknowns("time", self.guess.end * fractions, unit=self.guess.end)
            w, c = ca.SX.sym("w", 2), ca.SX.sym("c")
            function = ca.Function("time", [w, c], [w[0] - c * w[1]])
            index = np.stack([block.index.ravel(), np.full(fractions.size, self.end.index.flat[0])], axis=1)
            self.pieces.add_rows("time", function, index, fractions.reshape(-1, 1), unit=self.guess.end)
            self._lifted["time"] = block
        return self._lifted["time"]

    def _constant(self, name: str, value: float | Array) -> Unknown:
        if name not in self._lifted:
            self._lifted[name] = self.pieces.unknowns(name, value, value, value)
        return self._lifted[name]

    def _begun(self, name: str) -> Unknown:
        """An answer at the begin, which is known.

        Raises
        ------
        SceneError
            It hangs on forces of constraints or inertia, which controls change at once.
        """
        values = self._begun_values(name)
        if np.isnan(values).any():
            message = "found what constraints or inertia exert, which is not known at t0, accepted: at later times, or"
            raise SceneError(f"{message} positions, velocities, energies, springs", ("answer", name))
        return self._constant(f"{name} at t0", values[self.system.picked[name]])

    def _begun_values(self, name: str) -> Array:
        """An answer at the begin; nan where it is not known then."""
        system, results = self.system, self.system.results.results
        first = int(np.sum([one.size for one in results[: [one.name for one in results].index(name)]], dtype=int))
        size = next(one.size for one in results if one.name == name)
        if not system.known_at_rates(name):
            return np.full(size, np.nan)
        zeros = np.zeros(system.quantities)
        outputs = system.stage(system.start, system.begin.v, zeros, system.arguments.defaults, system.reference)[2]
        return np.array(outputs).ravel()[first : first + size]

    def expression(self, name: str, expression: ca.MX) -> tuple[ca.Function, Index]:
        """An expression as a function of its unknowns, and the indices of these (instances, w)."""
        symbols = ca.symvar(expression)
        places = []
        for symbol in symbols:
            found = self._places_of(symbol)
            assert found is not None, symbol
            places.append(found)
        n = max((len(part) for part in places), default=1)
        index = np.concatenate(
            [np.zeros((n, 0), np.intp), *(np.broadcast_to(p, (n, p.shape[1])) for p in places)], axis=1
        )
        w = ca.MX.sym("w", index.shape[1])
        bounds = np.cumsum([0, *(symbol.numel() for symbol in symbols)]).tolist()
        reads = ca.Function("reads", symbols, [ca.densify(ca.vec(expression))])
        values = reads.call(ca.vertsplit(w, bounds) if symbols else [])
        return ca.Function("expression", [w], values), index

    # -- answers ------------------------------------------------------------------------------------------

    def course(self, x: Array) -> GridMotion:
        """The motion of a solution x (n,) of the program."""
        value, n = self.pieces.value, self.intervals * self.stages
        d = value(self.d, x).reshape(n, -1)
        q, unwrapped = self.rotations(d, x)
        controls = [value(block, x) for block in self.controls]
        return GridMotion(
            end=float(value(self.end, x)[0]),
            q=q,
            d=d,
            x=value(self.x, x).reshape(n, -1),
            v=value(self.v, x).reshape(n, -1),
            a=value(self.a, x).reshape(n, -1),
            unwrapped=unwrapped,
            controls=np.stack(controls, axis=1) if controls else np.zeros((self.intervals + self.statement.order, 0)),
            variables=np.array([value(block, x)[0] for block in self.variables]),
        )

    def value(self, expression: ca.MX, x: Array) -> float:
        """The value of an expression that does not depend on time, in a solution x (n,) of the program."""
        physical = x * self.pieces.units
        known, values = [], []
        for number, (symbol, _) in enumerate(self.statement.integrals):
            function, index = self._quadrature(number)
            shares = self.statement.shares
            known.append(symbol)
            values.append(ca.MX(sum(float(function(physical[row], c)) for row, c in zip(index, shares, strict=True))))
        function, index = self.expression("value", ca.substitute([ca.MX(expression)], known, values)[0])
        return float(function(physical[index[0]]))

    def rotations(self, d: Array, x: Array) -> tuple[Array, Array]:
        """Rotations (stages, rotations, components) and angles that count turns, in a solution x (n,)."""
        n = self.system.system.layout
        numbers = (x * self.pieces.units)[self.numbers].reshape(len(d), -1)
        turned = np.array(self.system.turned.map(len(d))(d.T, numbers.T, self.references.T)).T
        size = n.components * n.rotations
        return turned[:, :size].reshape(len(d), n.rotations, n.components), turned[:, size:]

    def answer(self, name: str, x: Array) -> Array:
        """An answer at the begin and all stages, (1 + stages, size), SI units, in a solution x (n,).

        It is nan at the begin where it hangs on forces of constraints or inertia.
        """
        result = next(one for one in self.system.results.results if one.name == name)
        found = np.zeros((1 + self.intervals * self.stages, result.size))
        picked = self.system.picked[name]
        inside = self.pieces.value(self._lifted[name], x)
        found[0, picked] = self._begun_values(name)[picked]
        found[1:, picked] = inside.reshape(len(found) - 1, -1)
        return found


COST = 5.0
"""Size of a cost as IPOPT sees it."""

RESOLVED = 2.0
"""Turns in rad of a vibration in an interval up to which it is followed: Radau IIA of three stages then keeps it."""


def _scaled(columns: Array) -> Array:
    """Columns of length one."""
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), TINY))


def _varying(name: str, found: Relation) -> Relation:
    """The rows of a relation in which anything stands that may change.

    Raises
    ------
    SceneError
        One of the others does not hold.
    """
    symbols = ca.symvar(found.expression)
    whole = ca.vertcat(ca.MX(0, 1), *(ca.vec(symbol) for symbol in symbols))
    pattern = ca.jacobian_sparsity(ca.densify(found.expression), whole)
    varying = np.unique(np.array(pattern.row(), dtype=np.intp))
    fixed = np.setdiff1d(np.arange(len(found.low)), varying)
    if len(fixed):
        zeros = [ca.DM.zeros(*symbol.shape) for symbol in symbols]
        values = np.array(ca.Function("fixed", symbols, [ca.densify(found.expression)]).call(zeros)[0]).ravel()[fixed]
        off = (values < found.low[fixed]) | (values > found.high[fixed])
        if off.any():
            i = int(off.argmax())
            low, high = found.low[fixed][i], found.high[fixed][i]
            wanted = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            raise SceneError(f"{name}: found {values[i]:g}, which nothing changes, accepted: {wanted}")
    return Relation(found.expression[varying.tolist()], found.low[varying], found.high[varying])
