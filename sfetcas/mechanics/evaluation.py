"""A model as tables for the core in C, which evaluates and assembles its equations.

Everything here follows from :class:`~sfetcas.mechanics.layout.Layout`; :mod:`~sfetcas.mechanics.equations` has the same
evaluation in NumPy, for where there is no core.  Results of all terms stand in a row of numbers, group by group and
term by term; weighted sums take them to residuals and to the entries of the matrix.
"""

from __future__ import annotations

import copy
import ctypes
import functools
import threading
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..mathematics import core as c
from ..mathematics.arrays import Array, Index
from ..mathematics.linear import NO_ROOM, CoreSystem, SparseMap
from ..mathematics.tapes import Tape, tape_of
from .layout import Layout
from .model import Model
from .tables import Acting
from .terms import rotation_gradient

__all__ = [
    "BLOCK",
    "UNLOADED",
    "CoreLayout",
    "CoreModel",
    "CorePoint",
    "Handed",
    "Parts",
    "Search",
    "cells",
    "core_layout",
    "core_model",
    "handed",
]

UNLOADED = 1e-6
"""Share of the largest forces of a model below which forces at a node are rounding: 1e-16 of them is 1e-10 of this."""

BLOCK = 4
"""How many of the lowest eigenvalues the core finds at once, ``SF_BLOCK``."""

StateParts = tuple[Array, Array, Array, Array]
"""Rotations, displacements, multipliers, and values near which angles count, see :class:`~.equations.State`."""

Parts = list[list[Array]]
"""For each group its results, as of :func:`~sfetcas.mechanics.terms.rotation_gradient`, each (n, ...)."""


def core_model(layout: Layout, model: Model, noise: Array) -> CoreModel | None:
    """The model for the core; None where there is no core, or a kind of term has operations that it does not know.

    ``noise`` (total,) is what rounding leaves of each residual; it may be set later on.
    """
    library = c.core()
    found = None if library is None else handed(layout, model, noise)
    return None if library is None or found is None else CoreModel(library, found)


def handed(layout: Layout, model: Model, noise: Array) -> Handed | None:
    """The model as the core takes it; None where a kind of term has operations that it does not know."""
    found = core_layout(layout, model)
    return Handed(found, model, noise) if found.known else None


def core_layout(layout: Layout, model: Model, copies: int = 1) -> CoreLayout:
    """What the core takes of the structure of a model, or of so many copies of it beside each other."""
    found: CoreLayout | None = layout.of_core.get(copies)
    if found is None:
        found = layout.of_core[copies] = CoreLayout(layout, model, copies)
    return found


class CorePoint:
    """What the core says of a state: arrays that are made anew for each, see ``sf_point``.

    Attributes
    ----------
    potential, stored : float
    residual, scale : ndarray (total,)
    entries : ndarray (entries,)
    """

    def __init__(self, model: CoreModel) -> None:
        total = model.total
        numbers = np.empty(2 * total + model.entry_count)
        self.residual, self.scale, self.entries = numbers[:total], numbers[total : 2 * total], numbers[2 * total :]
        begin = numbers.ctypes.data
        self._point = c.Point(0.0, 0.0, begin, begin + 8 * total, begin + 16 * total, *model.shared)

    @property
    def potential(self) -> float:
        """Potential energy, dimensionless."""
        return float(self._point.potential)

    @property
    def stored(self) -> float:
        """Strain energy, dimensionless."""
        return float(self._point.stored)

    @property
    def address(self) -> Any:
        """What the core is given."""
        return ctypes.addressof(self._point)


class CoreLayout:
    """What the core takes that follows from the structure of a model alone, see :class:`~.layout.Layout`.

    Copies stand beside each other within each part: all rotations, then all displacements, and so on.

    Parameters
    ----------
    layout : Layout
    model : Model
    copies : int
        Of how many copies of the model; of several the core is not told of which contributions the matrix is the sum.

    Attributes
    ----------
    known : bool
        Whether all kinds of terms have tapes.
    model : Model
        The structure for the core, without the numbers of a model.
    groups : array of Group
        The groups for the core, without their data.
    tapes : list of Tape
        Of the groups; ``tables`` are the same as the core takes them.
    arrays : dict
        What the structures point to, by addresses.
    begins : ndarray (groups + 1,)
        Where the results of each group begin.
    """

    def __init__(self, layout: Layout, model: Model, copies: int = 1) -> None:
        self._layout, self._tables, self.copies = layout, layout.tables, copies
        tapes = [tape_of(rotation_gradient(group.kind)) for group in model.terms]
        self.tapes = [tape for tape in tapes if tape is not None]
        self.known, self._element = len(self.tapes) == len(tapes), model.element if len(model.terms[0].data) else None
        self.arrays: dict[int, Any] = {}
        self.tables = list[c.TapeTable]()
        self._rotations, self._places = len(model.rotations.kind), len(model.segments.places)
        self._closings = len(model.positions.rows)
        if self.known:
            self._terms = [len(group.data) for group in model.terms]
            sizes = (copies * n * tape.results for n, tape in zip(self._terms, self.tapes, strict=True))
            self.begins = np.cumsum([0, *sizes])
            self._make(model)

    @functools.cached_property
    def convex(self) -> tuple[c.TapeTable, list[Array]] | None:
        """The tape of the positive matrices of elements; None where there are none, or it cannot be one."""
        tape = None if self._element is None else tape_of(self._element.convex)
        return None if tape is None else c.table_of(tape)

    def set_convex(self, rules: c.Rules) -> None:
        """Say in the rules of a search where the positive matrices of elements are, if there are any."""
        if self.convex is not None:
            rules.convex, rules.stiffness = ctypes.addressof(self.convex[0]), self.tapes[0].parts[4]

    @property
    def searchable(self) -> bool:
        """Whether the globalised Newton method can be run by the core."""
        return self._element is None or self.convex is not None

    # -- numbers in copies --------------------------------------------------------------------------------

    def copied(self, numbers: Index, size: int) -> Index:
        """Numbers (n, ...) of some of ``size`` things, those of all copies one after the other; -1 is none."""
        if self.copies == 1:
            return numbers
        shift = size * np.arange(self.copies).reshape(-1, *[1] * numbers.ndim)
        return self._flat(np.where(numbers < 0, -1, numbers + shift))

    def lines(self, numbers: Index) -> Index:
        """The same of multipliers: closings stand before all other rows."""
        return self.blocks(numbers, [0, self._closings, self._tables.rows])

    def unknowns(self, numbers: Index) -> Index:
        """The same of unknowns and multipliers."""
        tables = self._tables
        ends = [tables.rotation_unknowns, tables.unknowns, tables.unknowns + self._closings, tables.total]
        return self.blocks(numbers, [0, *ends])

    def blocks(self, numbers: Index, bounds: Sequence[int]) -> Index:
        """The same of things that stand in blocks with these bounds, each with all of its copies."""
        if self.copies == 1:
            return numbers
        begins, sizes = np.array(bounds[:-1]), np.diff(bounds)
        block = np.clip(np.searchsorted(begins, numbers, side="right") - 1, 0, None)
        first, size = begins[block], sizes[block]
        number = np.arange(self.copies).reshape(-1, *[1] * numbers.ndim)
        found = self.copies * first + number * size + (numbers - first)
        return self._flat(np.where(numbers < 0, -1, found))

    @staticmethod
    def _flat(values: Index) -> Index:
        """Values (copies, n, ...) as (copies * n, ...)."""
        return values.reshape(values.shape[0] * values.shape[1], *values.shape[2:])

    def beside(self) -> CoreLayout:
        """The same, which keeps what else is made with it for itself."""
        found = copy.copy(self)
        found.arrays, found.tables = dict[int, Any](), list[c.TapeTable]()
        return found

    def repeated(self, values: Array) -> Array:
        """Values (n, ...) once for each copy."""
        return np.concatenate([values] * self.copies) if self.copies > 1 else values

    # -- tables -------------------------------------------------------------------------------------------

    def _make(self, model: Model) -> None:
        layout, tables, maps, element = self._layout, self._tables, model.positions, model.element
        along, n = (len(model.segments.owner), element.order + 1), self.copies
        slides = [np.concatenate([unknown[:, None], rows], axis=1) for unknown, rows in layout.sliding]
        slide = np.concatenate([np.zeros((0, 1 + element.axes), np.intp), *slides])
        slide = np.concatenate([self.unknowns(slide[:, :1]), self.lines(slide[:, 1:])], axis=1)
        of_rotations = slice(0, tables.of_places)
        sides, side_of = self._sides()
        given = layout.given
        begins = {"given": n * given["force"].stop, **{name: n * part.start for name, part in given.items()}}
        self.groups = (c.Group * len(model.terms))(*self._groups(model, begins))
        angles = model.unwrapping.count if n == 1 else 0
        pattern = [part if n == 1 else part[:0] for part in (layout.row, layout.column, layout.diagonal)]
        entries = self.sums(len(layout.row), *self._sources()) if n == 1 else c.Sums(0)
        unknown = self.unknowns(tables.unknown[of_rotations])
        self.model = c.Model(
            *(int(element.space), element.components, element.turns, element.axes),
            *(n * self._rotations, n * self._places, n * tables.displacement_unknowns),
            *(n * tables.rows, n * self._closings, angles),
            *(n * tables.unknowns, n * tables.rotation_unknowns, n * tables.total),
            *(n * along[0], along[1], n * len(model.segments.first), len(model.terms)),
            None,
            self.kept(c.integers(self.copied(model.segments.owner, len(model.segments.first)))),
            None,
            *(self.map(one) for one in (maps.Y, maps.Z, maps.Z.T, maps.W, maps.W.T)),
            *(self.map(one.T.absolute) for one in (maps.W, maps.Y)),
            *(begins[name] for name in ("given", "pull", "shift", "opening", "beside", "force")),
            int(self.begins[-1]) + 1,
            entries,
            sides,
            sides,
            side_of,
            None,
            n * len(layout.retained),
            self.kept(c.integers(self.unknowns(layout.retained))),
            len(slide),
            self.kept(c.integers(slide)),
            UNLOADED,
            self.kept(c.integers(unknown)),
            self.kept(c.doubles(self.repeated(tables.weight[of_rotations]))),
            None,
            None,
            len(pattern[0]),
            *(self.kept(c.integers(part)) for part in pattern),
        )

    def kept(self, array: Array) -> int:
        """Address of an array that lives as long as this."""
        # Of those that begin at one place the longest has all that the others have.
        known = self.arrays.get(address := int(array.ctypes.data))
        self.arrays[address] = array if known is None or known.size < array.size else known
        return address

    def map(self, matrix: SparseMap) -> c.Map:
        """A matrix for the core, of all copies."""
        rows, columns = matrix.shape
        order = np.argsort(matrix.row, kind="stable")
        row, column = self.copied(matrix.row[order], rows), self.copied(matrix.column[order], columns)
        start = np.searchsorted(row, np.arange(self.copies * rows + 1))
        parts = (c.integers(start), c.integers(column), c.doubles(self.repeated(matrix.value[order])))
        return c.Map(self.copies * rows, self.copies * columns, *(self.kept(part) for part in parts))

    def sums(self, count: int, onto: Array, source: Array, weight: Array) -> c.Sums:
        """Sums of numbers times weights, each onto one of ``count``, in the order in which they are given."""
        order = np.argsort(onto, kind="stable")
        start = np.searchsorted(onto[order], np.arange(count + 1))
        parts = (c.integers(start), c.integers(source[order]), c.doubles(weight[order]))
        return c.Sums(count, *(self.kept(part) for part in parts))

    def _groups(self, model: Model, begins: dict[str, int]) -> Iterator[c.Group]:
        for i, (group, tape) in enumerate(zip(model.terms, self.tapes, strict=True)):
            part = model.unwrapping.parts[i]
            found = self.group(
                group,
                tape,
                row=self.lines(self._layout.rows[i]),
                rows=group.kind.sizes[2] if i else 0,
                loads=group.kind.sizes[4],
                result=int(self.begins[i]),
            )
            found.angle = -1 if part is None else self.copies * part.start
            found.load = begins[f"loads {i - 1}"] if i else begins["pull"]
            found.proportional = int(group.kind.proportional)
            yield found

    def group(
        self, group: Acting, tape: Tape, *, row: Index | None = None, rows: int = 0, loads: int = 0, result: int
    ) -> c.Group:
        """Terms of one kind for the core, of all copies, without their data.

        ``row`` (n,) are multipliers, ``rows`` how many of them a term has, ``loads`` how many loads; ``result`` says
        where its results begin.
        """
        table, arrays = c.table_of(tape)
        self.tables.append(table)
        self.arrays |= {ctypes.addressof(table): table, **{array.ctypes.data: array for array in arrays}}
        sides = (self.copied(group.turns, self._rotations), self.copied(group.places, self._places))
        derivatives = (tape.parts[2], tape.parts[3], tape.parts[5]) if len(tape.parts) > 5 else (0, 0, 0)
        return c.Group(
            ctypes.addressof(table),
            *(self.copies * len(group.data), group.turns.shape[1], group.places.shape[1], group.data.shape[1]),
            *(loads, rows),
            *(self.kept(c.integers(part)) for part in sides),
            None,
            -1,
            None if row is None else self.kept(c.integers(row)),
            0,
            result,
            *derivatives,
            0,
        )

    def _cells(self, number: int, part: int) -> Array:
        """Places (n, width) of a result of a group among all results."""
        return cells(self.tapes[number], int(self.begins[number]), self.copies * self._terms[number], part)

    def _sources(self) -> tuple[Array, Array, Array]:
        """Contributions to the matrix: entries, the results that they are, and weights."""
        layout = self._layout
        places, factors = self.contributions()
        # Ties are one times their weight; the diagonal alone adds nothing.
        places, factors = np.append(places, [self.begins[-1], 0]), np.append(factors, [1.0, 0.0])
        used = layout.entry < len(places) - 1
        entry = layout.entry[used]
        return layout.to_entry[used], places[entry], layout.weight[used] * factors[entry]

    def contributions(self, copied: int = 0) -> tuple[Index, Array]:
        """Which results the contributions of the terms to the matrix are, in the order of the tables, with factors.

        Those of one of the copies.
        """
        source, factor, closed = list[Array](), list[Array](), self._tables.closed
        for number, count in enumerate(self._terms):
            own = slice(copied * count, (copied + 1) * count)
            stiffness, jacobian = (self._cells(number, part)[own].ravel() for part in (4, 5))
            value = np.ones(jacobian.size)
            if number == 0:
                jacobian, value = jacobian[closed.entry], closed.value
            source += [stiffness, jacobian, jacobian]
            factor += [np.ones(stiffness.size), value, value]
        return np.concatenate([np.zeros(0, np.intp), *source]), np.concatenate([np.zeros(0), *factor])

    def _sides(self) -> tuple[c.Sums, int]:
        """Sums of moments and forces on the sides of terms onto the unknowns, and the element of each."""
        layout, first, n = self._layout, self._tables.sides[0], self.copies
        source, elements = list[Array](), n * self._terms[0]
        for number in range(n):
            parts = (self._cells(i, 3)[number * k : (number + 1) * k] for i, k in enumerate(self._terms))
            source.append(np.concatenate([part.ravel() for part in parts])[layout.used])
        element = np.full(sum(part.size for part in self._tables.sides), -1)
        element[: first.size] = np.repeat(np.arange(len(first)), first.shape[1])
        element = self.copied(element[layout.used], elements // n)
        onto, weight = self.unknowns(layout.onto), self.repeated(layout.share)
        order = np.argsort(onto, kind="stable")
        sums = self.sums(n * self._tables.total, onto, np.concatenate(source), weight)
        return sums, self.kept(c.integers(element[order]))


def cells(tape: Tape, begin: int, terms: int, part: int) -> Index:
    """Places (terms, width) of a part of the results of terms among all results, of which theirs begin somewhere."""
    return begin + tape.results * np.arange(terms)[:, None] + np.arange(tape.parts[part], tape.parts[part + 1])


class Handed:
    """One model as the core takes it.

    Parameters
    ----------
    layout : CoreLayout
    model : Model
    noise : ndarray (total,)
        What rounding leaves of each residual, of all copies.

    Attributes
    ----------
    structure : Model
    groups : array of Group
    data : list of ndarray (terms, data)
        Of each group.
    arrays : dict
        What these point to, by addresses.
    """

    def __init__(self, layout: CoreLayout, model: Model, noise: Array) -> None:
        self.layout, angles = layout, model.unwrapping
        numbers, sides = np.zeros((angles.count, 8)), np.zeros((angles.count, 3))
        if angles.count:
            crossed = np.asarray(angles.across.any(axis=1))
            numbers[:, :3], numbers[:, 3:6], numbers[:, 6] = angles.axis, angles.across, np.where(crossed, 1.0, 2.0)
            sides = np.concatenate([angles.sides, crossed[:, None]], axis=1)
        self._own = [c.doubles(layout.repeated(model.beams.weight)), noise, numbers, c.integers(sides)]
        self._take(model)

    def _take(self, model: Model) -> None:
        self.structure = structure = c.Model.from_buffer_copy(self.layout.model)
        own = (part.ctypes.data for part in self._own)
        structure.weight, structure.noise, structure.counted, structure.counting = own
        self.groups = type(self.layout.groups).from_buffer_copy(self.layout.groups)
        self.data = [c.doubles(self.layout.repeated(group.data)) for group in model.terms]
        for group, data in zip(self.groups, self.data, strict=True):
            group.datum = data.ctypes.data
        structure.group = ctypes.addressof(self.groups)

    def of(self, model: Model) -> Handed:
        """The same of a model that differs by the data of terms alone."""
        found = copy.copy(self)
        found._take(model)
        return found

    @property
    def arrays(self) -> dict[int, Any]:
        """What the structures point to, by addresses."""
        return self.layout.arrays | {part.ctypes.data: part for part in (*self._own, *self.data)}

    @property
    def along(self) -> tuple[int, int, int]:
        """Elements, points of each, and axes."""
        return self.structure.elements, self.structure.points, self.structure.axes


class Search:
    """The globalised Newton method of one model, which keeps what the core is given alive.

    Parameters
    ----------
    model : CoreModel
    system : CoreSystem
    rules, inputs
        As the core takes them.
    arrays : list of ndarray
        What these point to.
    """

    def __init__(
        self, model: CoreModel, system: CoreSystem, rules: c.Rules, inputs: c.Inputs, arrays: list[Array]
    ) -> None:
        self._model, self._system, self._rules, self._inputs, self._arrays = model, system, rules, inputs, arrays
        self._point, self._memory = CorePoint(model), np.empty(model.library.sf_find_size(*self._addresses))
        # One call at a time has this memory.
        self._lock = threading.Lock()

    @property
    def _addresses(self) -> tuple[int, int, int]:
        return self._model.address, ctypes.addressof(self._rules), ctypes.addressof(self._inputs)

    def __call__(self, row: Array, state: Array, begins: int) -> c.Sought | None:
        """Search for a row (inputs,) from a state (states,), which is changed: see ``sf_find`` for how it begins.

        None where the seed of the rules is missing.
        """
        model, sought, row = self._model, c.Sought(), c.doubles(row)
        address, *controls = self._addresses
        given = (*controls, row.ctypes.data, begins, state.ctypes.data)
        rest = (self._point.address, self._memory.ctypes.data, ctypes.addressof(sought))
        with self._lock:
            while (ended := model.library.sf_find(address, self._system.address, *given, *rest)) == NO_ROOM:
                self._system.make_room()
        return None if ended else sought


class CoreModel:
    """One model for the core, the memory that evaluating takes, and calls.

    Parameters
    ----------
    library : CDLL
        The core.
    handed : Handed

    Attributes
    ----------
    library : CDLL
    address : int
        Where the core finds it.
    places : ndarray (places, axes)
        Displacements of retained places at the last state.
    pull : ndarray (elements, points, axes)
        Minus the internal forces at the last state.
    shared : tuple of int
        Where the core finds the memory that all points share.
    """

    def __init__(self, library: ctypes.CDLL, handed: Handed) -> None:
        self.library, self._handed, self._layout = library, handed, handed.layout
        self.total, self.entry_count = handed.structure.total, handed.structure.entry_count
        self.address = ctypes.addressof(handed.structure)
        self._results, self.pull = np.zeros(handed.structure.results), np.zeros(handed.along)
        self.places = np.zeros((handed.structure.places, handed.structure.axes))
        self._work = np.zeros(max(1, library.sf_work_size(self.address)))
        self.shared = tuple(part.ctypes.data for part in (self._results, self.places, self.pull, self._work))
        self._scratch = CorePoint(self)

    def of(self, model: Model) -> CoreModel:
        """The same of a model that differs by the data of terms alone, with memory of its own."""
        return CoreModel(self.library, self._handed.of(model))

    # -- calls ----------------------------------------------------------------------------------------

    @functools.cached_property
    def _bounds(self) -> tuple[int, int, int]:
        """Where displacements, multipliers and angles begin in the numbers of a state."""
        own = self._handed.structure
        begin = own.components * own.rotations
        return begin, begin + own.displacements, begin + own.displacements + own.rows

    def _handed_over(self, numbers: Array) -> c.State:
        """The numbers (states,) of a state as the core takes them."""
        begin, bounds = numbers.ctypes.data, self._bounds
        return c.State(begin, *(begin + 8 * bound for bound in bounds))

    def _parted(self, numbers: Array) -> StateParts:
        a, b, e = self._bounds
        return numbers[:a].reshape(-1, self._handed.structure.components), numbers[a:b], numbers[b:e], numbers[e:]

    @staticmethod
    def _numbers(state: StateParts) -> Array:
        """A copy of a state as its numbers, one after the other."""
        q, y, lam, unwrapped = state
        return np.concatenate([q.ravel(), y, lam, unwrapped], dtype=float)

    def evaluate(self, state: StateParts, given: Array) -> Parts:
        """Results of all terms at a state; they are overwritten by the next call."""
        handed = self._handed_over(numbers := self._numbers(state))
        self.library.sf_evaluate(self.address, ctypes.addressof(handed), given.ctypes.data, self._scratch.address)
        del numbers
        return self.parts

    @property
    def parts(self) -> Parts:
        """Results of all terms at the last state."""
        found = list[list[Array]]()
        layout = self._layout
        for number, tape in enumerate(layout.tapes):
            rows = self._results[layout.begins[number] : layout.begins[number + 1]].reshape(-1, tape.results)
            found.append([rows[:, a:b] for a, b in zip(tape.parts[:-1], tape.parts[1:], strict=True)])
        return found

    def at(self, state: StateParts, given: Array) -> CorePoint:
        """The equations at a state."""
        point, handed = CorePoint(self), self._handed_over(numbers := self._numbers(state))
        self.library.sf_at(self.address, ctypes.addressof(handed), given.ctypes.data, point.address)
        del numbers
        return point

    def moved(self, state: StateParts, step: Array) -> StateParts:
        """The state after an increment (total,)."""
        numbers = self._numbers(state)
        there, step = np.empty_like(numbers), c.doubles(step)
        handed, target = self._handed_over(numbers), self._handed_over(there)
        self.library.sf_move(self.address, ctypes.addressof(handed), step.ctypes.data, 1.0, ctypes.addressof(target))
        return self._parted(there)

    def slope(self, state: StateParts, rate: Array) -> Array:
        """Derivative of the residual (total,) along a rate of what is given, at a state."""
        point, slope = self._scratch, np.empty(self.total)
        handed = self._handed_over(numbers := self._numbers(state))
        rest = (rate.ctypes.data, point.address, slope.ctypes.data, self._sloping.ctypes.data)
        # Of the point the derivatives of chords are read: they are those of the state.
        self.library.sf_evaluate(self.address, ctypes.addressof(handed), self._still.ctypes.data, point.address)
        self.library.sf_slope(self.address, ctypes.addressof(handed), *rest)
        del numbers
        return slope

    @functools.cached_property
    def _sloping(self) -> Array:
        return np.zeros(self._layout.model.results)

    @functools.cached_property
    def _still(self) -> Array:
        """No loads and no motions."""
        return np.zeros(self._layout.model.given)

    def correct(
        self,
        system: CoreSystem,
        state: StateParts,
        given: Array,
        tangent: Array | None,
        border: c.Border | None,
        limits: c.Limits,
    ) -> tuple[StateParts, CorePoint, c.Report]:
        """Newton's method from a state: the last state, the equations there, and how it ended.

        Parameters
        ----------
        system : CoreSystem
            Solves for its steps.
        state : tuple of ndarray
        given : ndarray (given,)
        tangent : ndarray (entries,), optional
            Entries of the matrix for the first step.
        border : Border, optional
            With it the factor is unknown, too, and changed there.
        limits : Limits
        """
        there, point, report = self._numbers(state), CorePoint(self), c.Report()
        handed = self._handed_over(there)
        addresses = (system.address, given.ctypes.data, None if tangent is None else tangent.ctypes.data)
        of_structures = (
            None if border is None else ctypes.addressof(border),
            *(ctypes.addressof(limits), ctypes.addressof(handed), point.address),
        )
        memory = (self._correcting.ctypes.data, ctypes.addressof(report))
        while self.library.sf_correct(self.address, *addresses, *of_structures, *memory) == NO_ROOM:
            system.make_room()
        return self._parted(there), point, report

    def follow(
        self,
        system: CoreSystem,
        state: StateParts,
        tangent: Array,
        way: c.Way,
        limits: c.Limits,
        counting: c.Counting | None,
    ) -> tuple[StateParts, bool]:
        """Follow growing loads from a state: the last equilibrium, and whether the way ends.

        Parameters
        ----------
        system : CoreSystem
            Solves for the steps.
        state : tuple of ndarray
            An equilibrium where the way begins.
        tangent : ndarray (entries,)
            Entries of the matrix there.
        way : Way
            Changed: how far it was followed, and the next step.
        limits : Limits
            Of the corrections.
        counting : Counting, optional
            How eigenvalues are counted; else none are.
        """
        point, report, begun = CorePoint(self), c.Report(), c.Way.from_buffer_copy(way)
        counted = None if counting is None else ctypes.addressof(counting)
        addresses = (ctypes.addressof(way), ctypes.addressof(limits), counted, tangent.ctypes.data)
        rest = (point.address, self._following.ctypes.data, ctypes.addressof(report))
        while True:
            handed = self._handed_over(there := self._numbers(state))
            addressed = (*addresses, ctypes.addressof(handed), *rest)
            ended = self.library.sf_follow(self.address, system.address, *addressed)
            if ended != NO_ROOM:
                return self._parted(there), not ended
            # From the beginning: the matrix of the last step is not known any more.
            system.make_room()
            ctypes.pointer(way)[0] = begun

    def lowest(
        self, system: CoreSystem, entries: Array, weight: Array, shift: float, least: float, dual: float
    ) -> tuple[Array, Array] | None:
        """The lowest eigenvalues (n,) and their vectors (n, total), see ``sf_lowest``; None where not found."""
        values, vectors = np.empty(BLOCK), np.empty((BLOCK, self.total))
        memory = np.empty(self.library.sf_lowest_size(self.address))
        given = (system.address, entries.ctypes.data, weight.ctypes.data)
        found = (values.ctypes.data, vectors.ctypes.data, memory.ctypes.data)
        while (broken := self.library.sf_lowest(self.address, *given, shift, least, dual, *found)) == NO_ROOM:
            system.make_room()
        return None if broken else (values, vectors)

    def independent(self, columns: Sequence[Array], entries: Array, roughly: float, usual: float) -> bool:
        """Whether rows clearly do not depend on each other, see ``sf_independent``.

        ``columns`` are as of :attr:`.Equations.jacobian_columns`.
        """
        addresses = (part.ctypes.data for part in (*columns, entries))
        rest = (roughly, usual, self._products.ctypes.data)
        return bool(self.library.sf_independent(self.address, *addresses, *rest))

    @functools.cached_property
    def _products(self) -> Array:
        """Memory that finding out about rows takes."""
        rows = self._handed.structure.rows
        return np.zeros(rows * (rows + 1))

    def trace(self, system: CoreSystem, curve: c.Curve, limits: c.Limits, counting: c.Counting) -> None:
        """Plain steps along a curve, which are written to it, see ``sf_trace``.

        Parameters
        ----------
        system : CoreSystem
            Solves for the steps.
        curve : Curve
            Changed: its points, and the length of the next step.
        limits : Limits
            Of the corrections.
        counting : Counting
        """
        point, report, given = CorePoint(self), c.Report(), (limits, counting)
        rest = (*map(ctypes.addressof, given), point.address, self._tracing.ctypes.data, ctypes.addressof(report))
        while self.library.sf_trace(self.address, system.address, ctypes.addressof(curve), *rest) == NO_ROOM:
            system.make_room()

    @functools.cached_property
    def _tracing(self) -> Array:
        """Memory that a curve takes."""
        return np.zeros(self.library.sf_trace_size(self.address))

    def search(
        self, system: CoreSystem, rules: c.Rules, inputs: c.Inputs, varying: Sequence[int], arrays: list[Array]
    ) -> Search:
        """The globalised Newton method, ready to be called; ``arrays`` are what rules and inputs point to.

        The data of groups that vary are overwritten, so that this model is no other's.
        """
        self._layout.set_convex(rules)
        known = self._own(varying)
        inputs.groups, inputs.count, inputs.datum = len(varying), known[0].ctypes.data, known[1].ctypes.data
        return Search(self, system, rules, inputs, [*arrays, *known])

    def _own(self, varying: Sequence[int]) -> tuple[Array, Array]:
        """Sizes and addresses of the data of groups, which are copied, so that they can be overwritten."""
        data, groups = self._handed.data, self._handed.groups
        for number in varying:
            data[number] = data[number].copy()
            groups[number].datum = data[number].ctypes.data
        own = [data[number] for number in varying]
        places = np.array([part.ctypes.data for part in own], dtype=np.uintp)
        return c.integers(np.array([part.size for part in own])), places

    @property
    def searchable(self) -> bool:
        """Whether it can run the globalised Newton method."""
        return self._layout.searchable

    def negative(self, system: CoreSystem, entries: Array, counting: c.Counting) -> int | None:
        """Number of negative eigenvalues of a matrix; None where one is near zero, or factors do not tell."""
        addresses = (system.address, entries.ctypes.data, ctypes.addressof(counting), self._following.ctypes.data)
        found = int(self.library.sf_negative(self.address, *addresses))
        return None if found < 0 else found

    def solve_cases(
        self,
        system: CoreSystem,
        cases: c.Cases,
        way: c.Way,
        limits: tuple[c.Limits, c.Limits],
        counting: c.Counting,
        varying: Sequence[int],
    ) -> None:
        """Solve many cases, see ``sf_solve_cases``; they are changed.

        Parameters
        ----------
        system : CoreSystem
        cases : Cases
            Without what says where data that vary stand.
        way : Way
            How loads are followed from zero, and which rotations are prescribed.
        limits : (Limits, Limits)
            Of corrections on the way, and from near states.
        counting : Counting
        varying : sequence of int
            Numbers of the groups whose data vary: they are overwritten, so that this model is no other's.
        """
        counts, places = self._own(varying)
        cases.groups, cases.count, cases.datum = len(varying), counts.ctypes.data, places.ctypes.data
        addresses = [ctypes.addressof(part) for part in (cases, way, *limits, counting)]
        rest = (*addresses, self._scratch.address, self._following.ctypes.data)
        while self.library.sf_solve_cases(self.address, system.address, *rest) == NO_ROOM:
            system.make_room()

    @functools.cached_property
    def _following(self) -> Array:
        """Memory that a way takes."""
        return np.zeros(self.library.sf_follow_size(self.address))

    @functools.cached_property
    def _correcting(self) -> Array:
        """Memory that a correction takes."""
        return np.zeros(self.library.sf_correct_size(self.address))
