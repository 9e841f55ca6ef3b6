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
from ..mathematics.arrays import Array
from ..mathematics.linear import NO_ROOM, CoreSystem, SparseMap
from ..mathematics.tapes import tape_of
from .layout import Layout
from .model import Model
from .terms import rotation_gradient

__all__ = ["UNLOADED", "CoreModel", "CorePoint", "Handed", "Parts", "Search", "core_model", "handed"]

UNLOADED = 1e-6
"""Share of the largest forces of a model below which forces at a node are rounding: 1e-16 of them is 1e-10 of this."""

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
    if layout.of_core is None:
        layout.of_core = CoreLayout(layout, model)
    found: CoreLayout = layout.of_core
    return Handed(found, model, noise) if found.known else None


class CorePoint:
    """What the core says of a state: arrays that are made anew for each, see ``sf_point``.

    Attributes
    ----------
    potential, stored : float
    residual, scale : ndarray (total,)
    entries : ndarray (entries,)
    """

    def __init__(self, model: CoreModel) -> None:
        self.residual, self.scale = np.empty(model.total), np.empty(model.total)
        self.entries = np.empty(model.entry_count)
        self._point = c.Point(
            0.0,
            0.0,
            self.residual.ctypes.data,
            self.scale.ctypes.data,
            self.entries.ctypes.data,
            *model.shared,
        )

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

    def __init__(self, layout: Layout, model: Model) -> None:
        self._layout, self._tables = layout, layout.tables
        tapes = [tape_of(rotation_gradient(group.kind)) for group in model.terms]
        self.tapes = [tape for tape in tapes if tape is not None]
        self.known, self._element = len(self.tapes) == len(tapes), model.element if len(model.terms[0].data) else None
        self.arrays: dict[int, Any] = {}
        self.tables = list[c.TapeTable]()
        if self.known:
            self._terms = [len(group.data) for group in model.terms]
            sizes = (n * tape.results for n, tape in zip(self._terms, self.tapes, strict=True))
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

    def _make(self, model: Model) -> None:
        layout, tables, maps, element = self._layout, self._tables, model.positions, model.element
        places, along = len(model.segments.places), (len(model.segments.owner), element.order + 1)
        slides = [np.concatenate([unknown[:, None], rows], axis=1) for unknown, rows in layout.sliding]
        of_rotations = slice(0, tables.of_places)
        sides, side_of = self._sides()
        given = layout.given
        begins = {"given": given["force"].stop, **{name: part.start for name, part in given.items()}}
        self.groups = (c.Group * len(model.terms))(*self._groups(model, begins))
        angles = model.unwrapping.count
        self.model = c.Model(
            *(int(element.space), element.components, element.turns, element.axes),
            *(len(model.rotations.kind), places, tables.displacement_unknowns, tables.rows, len(maps.rows), angles),
            *(tables.unknowns, tables.rotation_unknowns, tables.total),
            *(*along, len(model.segments.first), len(model.terms)),
            None,
            self._kept(c.integers(model.segments.owner)),
            None,
            *(self._map(one) for one in (maps.Y, maps.Z, maps.Z.T, maps.W, maps.W.T)),
            *(self._map(one.T.absolute) for one in (maps.W, maps.Y)),
            *(begins[name] for name in ("given", "pull", "shift", "opening", "beside", "force")),
            int(self.begins[-1]) + 1,
            self._sums(len(layout.row), *self._sources()),
            sides,
            sides,
            side_of,
            None,
            len(layout.retained),
            self._kept(c.integers(layout.retained)),
            sum(len(part) for part in slides),
            self._kept(c.integers(np.concatenate([np.zeros((0, 1 + element.axes)), *slides]))),
            UNLOADED,
            self._kept(c.integers(tables.unknown[of_rotations])),
            self._kept(c.doubles(tables.weight[of_rotations])),
            None,
            None,
            len(layout.row),
            *(self._kept(c.integers(part)) for part in (layout.row, layout.column, layout.diagonal)),
        )

    def _kept(self, array: Array) -> int:
        """Address of an array that lives as long as this."""
        # Of those that begin at one place the longest has all that the others have.
        known = self.arrays.get(address := int(array.ctypes.data))
        self.arrays[address] = array if known is None or known.size < array.size else known
        return address

    def _map(self, matrix: SparseMap) -> c.Map:
        start = np.searchsorted(matrix.row, np.arange(matrix.shape[0] + 1))
        parts = (c.integers(start), c.integers(matrix.column), c.doubles(matrix.value))
        return c.Map(*matrix.shape, *(self._kept(part) for part in parts))

    def _sums(self, count: int, onto: Array, source: Array, weight: Array) -> c.Sums:
        """Sums of numbers times weights, each onto one of ``count``, in the order in which they are given."""
        order = np.argsort(onto, kind="stable")
        start = np.searchsorted(onto[order], np.arange(count + 1))
        parts = (c.integers(start), c.integers(source[order]), c.doubles(weight[order]))
        return c.Sums(count, *(self._kept(part) for part in parts))

    def _groups(self, model: Model, begins: dict[str, int]) -> Iterator[c.Group]:
        for i, (group, tape) in enumerate(zip(model.terms, self.tapes, strict=True)):
            table, arrays = c.table_of(tape)
            self.tables.append(table)
            self.arrays |= {ctypes.addressof(table): table, **{array.ctypes.data: array for array in arrays}}
            part = model.unwrapping.parts[i]
            turns, places, rows, data, loads = group.kind.sizes
            yield c.Group(
                ctypes.addressof(table),
                *(len(group.data), turns, places, data, loads, rows if i else 0),
                *(self._kept(c.integers(one)) for one in (group.turns, group.places)),
                None,
                -1 if part is None else part.start,
                self._kept(c.integers(self._layout.rows[i])),
                begins[f"loads {i - 1}"] if i else begins["pull"],
                int(self.begins[i]),
                *(tape.parts[2], tape.parts[3], tape.parts[5], int(group.kind.proportional)),
            )

    def _cells(self, number: int, part: int) -> Array:
        """Places (n, width) of a result of a group among all results."""
        tape = self.tapes[number]
        rows = self.begins[number] + tape.results * np.arange(self._terms[number])[:, None]
        return np.asarray(rows + np.arange(tape.parts[part], tape.parts[part + 1]))

    def _sources(self) -> tuple[Array, Array, Array]:
        """Contributions to the matrix: entries, the results that they are, and weights."""
        source, factor, layout = list[Array](), list[Array](), self._layout
        closed = self._tables.closed
        for number in range(len(self.tapes)):
            stiffness, jacobian = (self._cells(number, part).ravel() for part in (4, 5))
            value = np.ones(jacobian.size)
            if number == 0:
                jacobian, value = jacobian[closed.entry], closed.value
            source += [stiffness, jacobian, jacobian]
            factor += [np.ones(stiffness.size), value, value]
        # Ties are one times their weight; the diagonal alone adds nothing.
        places = np.concatenate([*source, [self.begins[-1], 0]]).astype(np.intp)
        factors = np.concatenate([*factor, [1.0, 0.0]])
        used = layout.entry < len(places) - 1
        entry = layout.entry[used]
        return layout.to_entry[used], places[entry], layout.weight[used] * factors[entry]

    def _sides(self) -> tuple[c.Sums, int]:
        """Sums of moments and forces on the sides of terms onto the unknowns, and the element of each."""
        layout, first = self._layout, self._tables.sides[0]
        source = np.concatenate([self._cells(number, 3).ravel() for number in range(len(self.tapes))])
        element = np.full(len(source), -1)
        element[: first.size] = np.repeat(np.arange(len(first)), first.shape[1])
        order = np.argsort(layout.onto, kind="stable")
        sums = self._sums(self._tables.total, layout.onto, source[layout.used], layout.share)
        return sums, self._kept(c.integers(element[layout.used][order]))


class Handed:
    """One model as the core takes it.

    Parameters
    ----------
    layout : CoreLayout
    model : Model
    noise : ndarray (total,)
        What rounding leaves of each residual.

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
        self._own = [c.doubles(model.beams.weight), noise, numbers, c.integers(sides)]
        self._take(model)

    def _take(self, model: Model) -> None:
        self.structure = structure = c.Model.from_buffer_copy(self.layout.model)
        own = (part.ctypes.data for part in self._own)
        structure.weight, structure.noise, structure.counted, structure.counting = own
        self.groups = type(self.layout.groups).from_buffer_copy(self.layout.groups)
        self.data = [c.doubles(group.data) for group in model.terms]
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

    def _state(self, q: Array, y: Array, lam: Array, unwrapped: Array) -> tuple[c.State, tuple[Array, ...]]:
        arrays = tuple(c.doubles(part) for part in (q, y, lam, unwrapped))
        return c.State(*(part.ctypes.data for part in arrays)), arrays

    @staticmethod
    def _changed(state: tuple[Array, Array, Array, Array]) -> tuple[c.State, tuple[Array, Array, Array, Array]]:
        """A copy of a state that the core changes."""
        q, y, lam, unwrapped = (np.array(part, dtype=float) for part in state)
        return c.State(*(part.ctypes.data for part in (q, y, lam, unwrapped))), (q, y, lam, unwrapped)

    def evaluate(self, state: tuple[Array, Array, Array, Array], given: Array) -> Parts:
        """Results of all terms at a state (q, y, lam, unwrapped); they are overwritten by the next call."""
        handed, arrays = self._state(*state)
        self.library.sf_evaluate(self.address, ctypes.addressof(handed), given.ctypes.data, self._scratch.address)
        del arrays
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

    def at(self, state: tuple[Array, Array, Array, Array], given: Array) -> CorePoint:
        """The equations at a state (q, y, lam, unwrapped)."""
        point = CorePoint(self)
        handed, arrays = self._state(*state)
        self.library.sf_at(self.address, ctypes.addressof(handed), given.ctypes.data, point.address)
        del arrays
        return point

    def moved(self, state: tuple[Array, Array, Array, Array], step: Array) -> tuple[Array, Array, Array, Array]:
        """The state (q, y, lam, unwrapped) after an increment (total,)."""
        handed, arrays = self._state(*state)
        q, y, lam, unwrapped = there = tuple(np.empty(part.shape) for part in arrays)
        target = c.State(*(part.ctypes.data for part in there))
        step = c.doubles(step)
        self.library.sf_move(self.address, ctypes.addressof(handed), step.ctypes.data, 1.0, ctypes.addressof(target))
        return q, y, lam, unwrapped

    def slope(self, state: tuple[Array, Array, Array, Array], rate: Array) -> Array:
        """Derivative of the residual (total,) along a rate of what is given, at a state (q, y, lam, unwrapped)."""
        point, slope = self._scratch, np.empty(self.total)
        handed, arrays = self._state(*state)
        rest = (rate.ctypes.data, point.address, slope.ctypes.data, self._sloping.ctypes.data)
        # Of the point the derivatives of chords are read: they are those of the state.
        self.library.sf_evaluate(self.address, ctypes.addressof(handed), self._still.ctypes.data, point.address)
        self.library.sf_slope(self.address, ctypes.addressof(handed), *rest)
        del arrays
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
        state: tuple[Array, Array, Array, Array],
        given: Array,
        tangent: Array | None,
        border: c.Border | None,
        limits: c.Limits,
    ) -> tuple[tuple[Array, Array, Array, Array], CorePoint, c.Report]:
        """Newton's method from a state (q, y, lam, unwrapped): the last state, the equations there, and how it ended.

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
        (handed, there), point, report = self._changed(state), CorePoint(self), c.Report()
        addresses = (system.address, given.ctypes.data, None if tangent is None else tangent.ctypes.data)
        of_structures = (
            None if border is None else ctypes.addressof(border),
            *(ctypes.addressof(limits), ctypes.addressof(handed), point.address),
        )
        memory = (self._correcting.ctypes.data, ctypes.addressof(report))
        while self.library.sf_correct(self.address, *addresses, *of_structures, *memory) == NO_ROOM:
            system.make_room()
        return there, point, report

    def follow(
        self,
        system: CoreSystem,
        state: tuple[Array, Array, Array, Array],
        tangent: Array,
        way: c.Way,
        limits: c.Limits,
        counting: c.Counting | None,
    ) -> tuple[tuple[Array, Array, Array, Array], bool]:
        """Follow growing loads from a state (q, y, lam, unwrapped): the last equilibrium, and whether the way ends.

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
            handed, there = self._changed(state)
            addressed = (*addresses, ctypes.addressof(handed), *rest)
            ended = self.library.sf_follow(self.address, system.address, *addressed)
            if ended != NO_ROOM:
                return there, not ended
            # From the beginning: the matrix of the last step is not known any more.
            system.make_room()
            ctypes.pointer(way)[0] = begun

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
