"""All load cases, answers and constraints of a formulation assembled as one nonlinear program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, Index
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import NLP
from ..mathematics.pieces import Pieces, Unknown
from .equations import CaseEquations
from .formulation import Asked, Formulation, labelled

__all__ = ["REQUIRED", "Assembled", "Pair", "places_asked"]

STEPS, STATES, ENDS = "steps", "equilibria", "where lines end"
"""Names of blocks and pieces."""

REQUIRED = "required "
"""How the names of pieces begin that were asked for."""


@dataclass(frozen=True, eq=False)
class Pair:
    """A stability constraint: the lowest eigenvalue of a case, which has to stay above a margin.

    Attributes
    ----------
    case : int
    shape : ndarray (total,)
        Its eigenvector, dimensionless.
    value, margin : float
        Dimensionless.
    """

    case: int
    shape: Array
    value: float
    margin: float


def places_asked(formulation: Formulation) -> tuple[list[str], dict[str, tuple[float, ...]]]:
    """Names of all answers, and for each member all fractions of its length at which answers are needed."""
    asked = formulation.asked.values()
    names = list(dict.fromkeys(one.name for one in asked))
    places: dict[str, set[float]] = {}
    for one in asked:
        if one.member:
            places.setdefault(one.member, set()).update(one.at)
    return names, {name: tuple(sorted(x)) for name, x in places.items()}


class Assembled:
    """The program on one mesh.

    Parameters
    ----------
    formulation : Formulation
    equations : CaseEquations
    states : ndarray (cases, states)
        Reference states, near equilibria.
    places : ndarray (cases, ends)
        Where elements end with lines on obstacles in these states, fractions of the lengths of their members.
    values : mapping of str to ndarray
        Start values of the free numbers.
    pairs : sequence of Pair
        Stability constraints.
    kernels : str
        ``auto``, ``compiled`` or ``interpreted``.
    """

    def __init__(
        self,
        formulation: Formulation,
        equations: CaseEquations,
        states: Array,
        places: Array,
        values: Mapping[str, Array],
        pairs: Sequence[Pair] = (),
        kernels: Kernels = "auto",
    ) -> None:
        self.formulation, self.equations, self.states = formulation, equations, states
        self.pieces, self._pairs = Pieces(kernels), tuple(pairs)
        self.cases = len(formulation.cases)
        self._load = self._largest_load()
        self._free = {name: self._free_block(name, values[name]) for name in formulation.free}
        self._steps = self._step_block()
        self._names = [one.name for one in equations.arguments.arguments]
        self._fixed = self._defaults()
        self._numbers = np.concatenate([self._number_indices(values), self._end_indices(places)], axis=1)
        self._w = np.concatenate([self._steps.index, self._numbers], axis=1)
        self._c = np.concatenate([states, self._fixed[:, equations.fixed]], axis=1)
        self._add_equilibria()
        self._known: Array = np.zeros(0, dtype=bool)
        self._add_answers()
        self._add_pairs()
        self._add_required()
        self._add_objective()

    # -- unknowns -----------------------------------------------------------------------------------

    def _largest_load(self) -> float:
        """Unit of multipliers and of what is not in balance."""
        program = self.equations.program
        lam = [program.equations.state(flat).lam for flat in self.states]
        return max(1.0, float(np.abs(np.stack(lam)).max(initial=0.0)))

    def _free_block(self, name: str, guess: Array) -> Unknown:
        one = self.formulation.free[name]
        width = np.where(np.isfinite(one.high - one.low), one.high - one.low, 0.0)
        largest = np.maximum(np.abs(one.guess), 0.5 * width)
        unit = np.where(largest > 0.0, largest, 1.0)
        return self.pieces.unknowns(name, guess, one.low, one.high, unit, symbol=one.symbol)

    def _step_block(self) -> Unknown:
        equations = self.equations.program.equations
        unit = np.ones(self.equations.total)
        unit[equations.unknowns :] = self._load
        return self.pieces.unknowns(STEPS, np.zeros((self.cases, len(unit))), unit=unit)

    def _defaults(self) -> Array:
        """All numbers of all cases where they are no unknowns, (cases, numbers)."""
        found = np.tile(self.equations.arguments.defaults, (self.cases, 1))
        for i, setting in enumerate(self.formulation.settings):
            for name, one in setting.items():
                if not isinstance(one.value, ca.MX):
                    found[i, self._names.index(name)] = one.value
        return found

    def _number_indices(self, values: Mapping[str, Array]) -> Index:
        """Where the numbers that are unknown in some case stand, (cases, free)."""
        found = np.zeros((self.cases, len(self.equations.free)), dtype=np.intp)
        for k, number in enumerate(self.equations.free):
            name = self._names[number]
            for i in range(self.cases):
                found[i, k] = self._number_index(i, name, found[i, :k], values)
        return found

    def _number_index(self, case: int, name: str, before: Index, values: Mapping[str, Array]) -> int:
        setting = self.formulation.settings[case].get(name)
        label = labelled(self.formulation.cases[case], name)
        if setting is None or not isinstance(setting.value, ca.MX):
            value = self._fixed[case, self._names.index(name)]
            return int(self.pieces.unknowns(label, [value], value, value, abs(value) or 1.0).index[0])
        try:
            function, index = self.pieces.function_of(name, setting.value)
        except ValueError as error:
            raise SceneError(str(error)) from None
        if index.size == 1 and index[0, 0] not in before and _is_itself(function):
            return int(index[0, 0])
        start = float(self.formulation.value(setting.value, values)[0])
        low, high = setting.between or (-np.inf, np.inf)
        block = self.pieces.unknowns(label, [start], low, high, abs(start) or 1.0)
        self.pieces.add_expression(label, block.symbol - setting.value, unit=abs(start) or 1.0)
        return int(block.index[0])

    def _end_indices(self, places: Array) -> Index:
        """Where the places at which lines end stand, (cases, ends)."""
        if not places.size:
            return np.zeros(places.shape, dtype=np.intp)
        low, high = self.equations.room
        return self.pieces.unknowns(ENDS, places, low, high).index

    # -- rows -----------------------------------------------------------------------------------------

    def _add_equilibria(self) -> None:
        equations = self.equations.program.equations
        unit = np.ones(self.equations.total)
        unit[: equations.unknowns] = self._load
        labels = [labelled(name, "equilibrium") for name in self.formulation.cases]
        self.pieces.add_rows(STATES, self.equations.balance, self._w, self._c, unit=unit, labels=labels)
        if self.equations.ends:
            labels = [labelled(name, ENDS) for name in self.formulation.cases]
            self.pieces.add_rows(f"rows of {ENDS}", self.equations.beside, self._w, self._c, labels=labels)

    def _rows_of(self, asked: Asked) -> list[int]:
        """Which of all results an answer is."""
        results = self.equations.results
        first = 0
        for one in results.results:
            if one.name == asked.name:
                break
            first += one.size
        if not asked.member:
            return list(range(first, first + one.size))
        every = list(results.places[asked.member])
        width = one.size // len(every)
        return [first + every.index(x) * width + k for x in asked.at for k in range(width)]

    def _add_answers(self) -> None:
        values = self.outputs(np.zeros((self.cases, self.equations.total)))
        function = self.equations.outputs
        varies = np.zeros(function.numel_out(0), dtype=bool)
        varies[np.unique(np.array(function.jac_sparsity(0, 0).row(), dtype=np.intp))] = True
        blocks = []
        for number, asked in enumerate(self.formulation.asked.values()):
            rows = self._rows_of(asked)
            start = values[np.ix_(asked.cases, rows)]
            unit = self._unit(asked.unit, start)
            block = self.pieces.unknowns(f"answer {number}", start.reshape(asked.shape), unit=unit, symbol=asked.symbol)
            index = block.index.reshape(len(asked.cases), -1)
            cases = list(asked.cases)
            labels = [labelled(self.formulation.cases[i], asked.name) for i in cases]
            w = np.concatenate([self._w[cases], index], axis=1)
            self.pieces.add_rows(
                f"lifted {number}", self.equations.lifted(rows), w, self._c[cases], unit=unit, labels=labels
            )
            blocks.append((block, np.broadcast_to(varies[rows], index.shape).ravel()))
        self._blocks = blocks
        known = np.zeros(self.pieces.size, dtype=bool)
        for block, free in blocks:
            known[block.index.ravel()[~free]] = True
        for block in self.pieces.blocks.values():
            known[block.index.ravel()[(block.low == block.high).ravel()]] = True
        self._known = known

    def _unit(self, unit: str, start: Array) -> float:
        scales = self.equations.scales
        own = {"m": scales.length, "N": scales.force * self._load, "N m": scales.moment * self._load}
        own |= {"J": scales.moment, "1/m": 1.0 / scales.length, "rad": 1.0, "1": 1.0}
        return float(own.get(unit) or np.abs(start).max(initial=0.0) or 1.0)

    def _add_pairs(self) -> None:
        if not self._pairs:
            return
        cases = [pair.case for pair in self._pairs]
        shapes = self.pieces.unknowns("shapes", np.stack([pair.shape for pair in self._pairs]))
        margin = np.array([[pair.margin] for pair in self._pairs])
        start = np.maximum(np.array([[pair.value] for pair in self._pairs]), margin)
        values = self.pieces.unknowns("eigenvalues", start, low=margin)
        w = np.concatenate([self._w[cases], shapes.index, values.index], axis=1)
        labels = [labelled(self.formulation.cases[i], "stability") for i in cases]
        self.pieces.add_rows("stability", self.equations.eigen, w, self._c[cases], labels=labels)

    def _add_required(self) -> None:
        self.lines: dict[str, tuple[Index, Array]] = {}
        guess, units = self.pieces.guess, self.pieces.units
        for one in self.formulation.required:
            expression, low, high = one.relation.expression, one.relation.low, one.relation.high
            function, index = self.pieces.function_of(one.name, expression)
            slope = np.array(
                ca.Function("slope", [w := ca.MX.sym("w", index.shape[1])], [ca.jacobian(function(w), w)])(
                    guess[index[0]]
                )
            )
            depends = self._depending(function, index)
            self._refuse_false(one.name, function, guess[index[0]], low, high, depends)
            kept = np.flatnonzero(depends)
            size = np.linalg.norm(slope * units[index[0]], axis=1)[kept]
            unit = np.where(size > 0.0, size, 1.0)
            if len(kept):
                self.pieces.add_expression(REQUIRED + one.name, expression[kept.tolist()], low[kept], high[kept], unit)
            self.lines[one.name] = kept, unit

    def _depending(self, function: ca.Function, index: Index) -> Array:
        """Rows that any unknown moves: those of answers that never change are no rows."""
        pattern = function.jac_sparsity(0, 0)
        rows, columns = np.array(pattern.row(), dtype=np.intp), np.array(pattern.get_col(), dtype=np.intp)
        moves = ~self._known[index[0][columns]] if len(columns) else np.zeros(0, dtype=bool)
        found = np.zeros(function.numel_out(0), dtype=bool)
        found[rows[moves]] = True
        return found

    @staticmethod
    def _refuse_false(name: str, function: ca.Function, at: Array, low: Array, high: Array, depends: Array) -> None:
        values = np.array(function(at)).ravel()
        slack = tolerances.WRITTEN * np.maximum(1.0, np.abs(values))
        false = ~depends & ((values < low - slack) | (values > high + slack))
        if false.any():
            i = int(np.flatnonzero(false)[0])
            wanted = f"{low[i]:g} to {high[i]:g}" if low[i] < high[i] else f"{low[i]:g}"
            message = f"found {values[i]:g}, which no unknown changes, where {wanted} is asked for"
            raise SceneError(f"{message}, accepted: what some unknown moves", (name,))

    def _add_objective(self) -> None:
        objective = self.formulation.objective
        if not ca.symvar(objective):
            self.weight = 1.0
            return
        function, index = self.pieces.function_of("objective", objective)
        w, unit = ca.MX.sym("w", index.shape[1]), self.pieces.units[index[0]]
        bends, slopes = ca.hessian(function(w), w)
        both = ca.Function("both", [w], [ca.diag(bends), slopes])
        diagonal, slope = (np.array(part).ravel() for part in both(self.pieces.guess[index[0]]))
        # Where a first derivative vanishes a second one tells the size.
        size = float(max(np.abs(slope * unit).max(), np.abs(diagonal * unit**2).max()))
        self.weight = float(np.clip(1.0 / size, 1e-9, 1e9)) if np.isfinite(size) and size > 0.0 else 1.0
        self.pieces.add_term("objective", objective, self.weight)

    # -- numbers ----------------------------------------------------------------------------------------

    @property
    def freedom(self) -> tuple[int, int]:
        """Number of free numbers, and of equality constraints beside the equilibria."""
        free = sum(int((one.low < one.high).sum()) for one in self.formulation.free.values())
        rows = 0
        for one in self.formulation.required:
            kept = self.lines[one.name][0]
            rows += int((one.relation.low[kept] == one.relation.high[kept]).sum())
        return free, rows

    def nlp(self) -> NLP:
        """The nonlinear program."""
        return self.pieces.nlp()

    def recentre(self, states: Array) -> None:
        """Replace the reference states (cases, states), dimensionless constants of the program, which is kept."""
        self._c = np.concatenate([states, self._fixed[:, self.equations.fixed]], axis=1)
        self.states = states
        self.pieces.set_constants(STATES, self._c)
        if self.equations.ends:
            self.pieces.set_constants(f"rows of {ENDS}", self._c)
        for number, asked in enumerate(self.formulation.asked.values()):
            self.pieces.set_constants(f"lifted {number}", self._c[list(asked.cases)])
        if self._pairs:
            self.pieces.set_constants("stability", self._c[[pair.case for pair in self._pairs]])

    def recentred(self, x: Array) -> Array:
        """The solution x (n,) of the program about its own states as new references: its steps are zero."""
        self.recentre(self.arrived(x))
        found = x.copy()
        found[self._steps.index] = 0.0
        return found

    def outputs(self, steps: Array, values: Array | None = None) -> Array:
        """All results (cases, results), SI units, after steps (cases, total); ``values`` are all free numbers."""
        x = self.pieces.guess if values is None else values
        w = np.concatenate([steps, x[self._numbers]], axis=1)
        return np.stack([np.array(self.equations.outputs(a, b)).ravel() for a, b in zip(w, self._c, strict=True)])

    def unknowns(self, x: Array) -> Array:
        """All unknowns (n,) in their own units from a scaled solution x."""
        return np.asarray(x * self.pieces.units)

    def values(self, x: Array) -> dict[str, Array]:
        """The free numbers by name, in their own units, from a solution x (n,) of the program."""
        return {name: self.pieces.value(block, x) for name, block in self._free.items()}

    def numbers(self, x: Array) -> Array:
        """All numbers of the scene in all cases, (cases, numbers), in their own units."""
        found = self._fixed.copy()
        free = self.equations.free
        found[:, free] = self.unknowns(x)[self._numbers[:, : len(free)]]
        return found

    def places(self, x: Array) -> Array:
        """Where elements end with lines on obstacles, (cases, ends), fractions of the lengths of their members."""
        return np.asarray(self.unknowns(x)[self._numbers[:, len(self.equations.free) :]])

    def steps(self, x: Array) -> Array:
        """Steps from the reference states, (cases, total), dimensionless."""
        return self.pieces.value(self._steps, x)

    def turned(self, x: Array, y: Array) -> float:
        """Largest rotation of a node between two solutions, rad."""
        rotation_unknowns = self.equations.program.equations.rotation_unknowns
        return float(np.abs(self.steps(y) - self.steps(x))[:, :rotation_unknowns].max(initial=0.0))

    def arrived(self, x: Array) -> Array:
        """States after the steps, (cases, states), dimensionless."""
        w = np.concatenate([self.steps(x), self.unknowns(x)[self._numbers]], axis=1)
        return np.stack([np.array(self.equations.arrive(a, b)).ravel() for a, b in zip(w, self._c, strict=True)])

    def shapes(self, x: Array) -> Array:
        """Eigenvectors of the stability constraints, (pairs, total), dimensionless."""
        return self.pieces.value(self.pieces.blocks["shapes"], x)

    def eigenvalues(self, x: Array) -> Array:
        """Eigenvalues of the stability constraints, (pairs,), dimensionless."""
        return self.pieces.value(self.pieces.blocks["eigenvalues"], x).ravel()


def _is_itself(function: ca.Function) -> bool:
    """Whether a function of one number gives this number."""
    x = ca.MX.sym("x")
    slope = ca.Function("slope", [x], [ca.jacobian(function(x), x), ca.jacobian(ca.jacobian(function(x), x), x)])
    first, second = slope(0.37)
    return (
        float(function(0.0)) == 0.0
        and float(first) == 1.0
        and slope.sparsity_out(1).nnz() == 0
        and float(second) == 0.0
    )
