"""Time steps by the core: the stage equations of a system as tables.

The same equations stand as expressions in :mod:`~sfetcas.dynamics.stages`, from which steps are made where there is no
core, and for generated C.
"""

from __future__ import annotations

import ctypes
import functools
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..mathematics import core as c
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import mapped
from ..mathematics.linear import NO_ROOM, CoreSystem, SparseMap, last_rows
from ..mathematics.tapes import Tape, tape_of
from ..mechanics.evaluation import CoreModel, Handed, cells, core_layout
from ..mechanics.rubbing import Sliding, sliding_term
from ..mechanics.terms import rotation_gradient, rows_of
from .methods import Method, StageMethod
from .stages import DUAL_REGULARISATION, StageEquations
from .steps import ITERATIONS, LAST_CHANGE, LOST

if TYPE_CHECKING:
    from .taken import Memory

__all__ = ["CoreStep", "core_step"]


def core_step(system: StageEquations, method: Method) -> CoreStep | None:
    """Steps of a method by the core; None where there is none, or something acts that it does not know."""
    if c.core() is None or not isinstance(method, StageMethod) or method.polished:
        return None
    layout, model = system.equations.layout, system.model
    copies = core_layout(layout, model, method.stages)
    if not copies.known:
        return None
    elements = len(model.terms[0].data)
    turning = tape_of(model.element.turned) if elements else None
    kinds = [group.kind for group in system.masses.observables]
    rows = [group.kind if len(group.data) and group.labels.size else None for group in model.connections]
    sliding = [] if system.rubbing is None else system.rubbing.sliding()
    found = [
        *(tape_of(rows_of(kind)) for kind in kinds),
        *(tape_of(rotation_gradient(kind)) for kind in kinds),
        *(tape_of(rows_of(kind)) for kind in rows if kind is not None),
        *(tape_of(sliding_term(group.kind)) for group in sliding),
    ]
    tapes = [tape for tape in found if tape is not None]
    if len(tapes) < len(found) or (elements and turning is None):
        return None
    return CoreStep(system, method, turning, tapes)


class CoreStep:
    """Steps of one system by one method.

    Parameters
    ----------
    system : StageEquations
    method : StageMethod
    turning : Tape or None
        Turned tangents of an element; None where there are no elements.
    tapes : list of Tape
        Of the observables their values, then these with derivatives; of the groups of connections that have rows these;
        of places that slide their forces.

    Attributes
    ----------
    handed : Handed
        The model of all stages; ``motion`` is what the core takes beside it.
    inputs : Inputs
        What is given at a stage.
    turning : Group
        Turned tangents of the elements.
    seen, rows, observables : arrays of Group and Observables
        Values of the observables, rows of the groups of terms of the model, the observables.
    pattern : tuple
        Number of unknowns of all stages, positions of the entries of their matrix, and the order of elimination.
    """

    def __init__(self, system: StageEquations, method: StageMethod, turning: Tape | None, tapes: list[Tape]) -> None:
        library = c.core()
        assert library is not None
        self._system, self._method, self._library, self._lock = system, method, library, threading.Lock()
        known = core_layout(system.equations.layout, system.model, method.stages)
        self._layout = layout = known.beside()
        total = layout.model.total
        self.handed = Handed(known, system.model, np.zeros(total))
        # Within a step angles are counted from what they are at its begin.
        self.handed.structure.angles = 0
        self._model = CoreModel(library, self.handed)
        # What the tables point to.
        self._arrays = list[Any]()
        self.motion = motion = c.Motion(
            stages=method.stages,
            kept=method.kept,
            quantities=system.layout.x,
            linear=system.linear,
            groups=len(system.masses.observables),
            iterations=ITERATIONS,
            dual=DUAL_REGULARISATION,
            last_change=LAST_CHANGE,
            lost=LOST,
        )
        self._number()
        self._relate()
        self._group(turning, tapes)
        self._map()
        self._weigh()
        self._solver = self._matrix()
        self._residual, self._results = np.zeros(total), np.zeros(motion.couples + self._coupled)
        places = (self._residual.ctypes.data, None, None, self._results.ctypes.data, *self._model.shared[1:])
        self._point = c.Point(0.0, 0.0, *places)
        self._memory = np.zeros(library.sf_advance_size(self._model.address, ctypes.addressof(motion)))
        self._hand_over()

    # -- tables ---------------------------------------------------------------------------------------

    def _kept(self, values: Array) -> int:
        """Address of numbers, whole ones or not, that live as long as this."""
        return self._layout.kept((c.integers if values.dtype.kind in "iub" else c.doubles)(values))

    def _number(self) -> None:
        """Where what belongs to each stage stands among that of all of them, and what is given by a unit of factors."""
        system, layout, stages = self._system, self._layout, self._method.stages
        model, given = system.model, system.equations.layout.given
        every = layout.unknowns(np.arange(system.total)).reshape(stages, -1)
        self._unknown = every
        at = [
            stages * part.start
            + (every if name == "beside" else np.arange(stages * (part.stop - part.start)).reshape(stages, -1))
            for name, part in given.items()
        ]
        self._given_at = np.concatenate(at, axis=1)
        self.inputs = inputs = system.inputs
        self._given = slice(inputs.data, inputs.data + self._given_at.shape[1])
        self.motion.driven = stages * len(inputs.turned)
        self.motion.drive = self._kept(layout.copied(inputs.turned, len(model.rotations.kind)))
        self._row_at = layout.lines(np.arange(system.layout.lam)).reshape(stages, -1)
        parts = [part for part in model.unwrapping.parts if part is not None]
        angles = [np.tile(np.arange(part.start, part.stop), stages) for part in parts]
        self._angle_of = np.concatenate([np.zeros(0, np.intp), *angles])

    def _relate(self) -> None:
        """The numbers of the method."""
        motion, given = self.motion, self._method.relations
        motion.at = self._kept(self._method.places)
        for name in ("velocity", "acceleration", "after", "velocity_kept", "acceleration_kept", "after_kept"):
            setattr(motion, name, self._kept(getattr(given, name)))
        motion.power = self._kept(given.powers)

    def _group(self, turning: Tape | None, tapes: list[Tape]) -> None:
        """Groups of terms beside those of the model: tangents, observables, rows."""
        system, layout, motion, stages = self._system, self._layout, self.motion, self._method.stages
        model, count, end = system.model, len(system.masses.observables), int(layout.begins[-1]) + 1
        self._varying = [self._own_data(number) for number in self.inputs.varying]
        self._remembering = list[tuple[Array, Index, slice]]()
        for number, group, part in system.memory.parts():
            own = self._own_data(number + 1)
            self._remembering.append((own.reshape(stages, *group.data.shape), group.kind.memory_columns, part))
        self._told = list[tuple[Array, Index]]()
        for number, members in () if system.rubbing is None else system.rubbing.groups.items():
            own = self._own_data(number)
            self._told.append((own.reshape(stages, len(members), -1), members))
        seen, weighed, groups = (c.Group * count)(), (c.Observables * count)(), (c.Group * len(model.terms))()
        self.seen, self.observables, self.rows, turned = seen, weighed, groups, c.Group()
        if turning is not None:
            turned = layout.group(model.terms[0], turning, result=end)
            turned.datum, end = self.handed.data[0].ctypes.data, end + turned.terms * turning.results
        self.turning = turned
        self._stiff = list[tuple[Tape, int]]()
        first = 0
        values, derivatives, others = tapes[:count], tapes[count : 2 * count], iter(tapes[2 * count :])
        for i, observed in enumerate(system.masses.observables):
            seen[i] = layout.group(observed, values[i], result=end)
            end += seen[i].terms * values[i].results
            row = first + np.arange(stages * observed.mass.size)
            first += len(row)
            weighed[i].group = layout.group(observed, derivatives[i], row=row, rows=observed.mass.shape[1], result=end)
            self._stiff.append((derivatives[i], end))
            end += weighed[i].group.terms * derivatives[i].results
            seen[i].datum = weighed[i].group.datum = self._kept(layout.repeated(observed.data))
            if (counted := system.angles_of(observed)) is not None:
                seen[i].angle = weighed[i].group.angle = len(self._angle_of)
                self._angle_of = np.append(self._angle_of, np.tile(counted, stages))
            weighed[i].mass, weighed[i].damping = (
                self._kept(layout.repeated(part)) for part in (observed.mass, observed.damping)
            )
            weighed[i].vectors = observed.kind.vectors
        for number, group in enumerate(model.connections, start=1):
            if len(group.data) and group.labels.size:
                its, tape = self.handed.groups[number], next(others)
                found = groups[number] = layout.group(group, tape, loads=group.kind.sizes[4], result=end)
                found.datum, found.load, found.angle = its.datum, its.load, its.angle
                groups[number], end = found, end + found.terms * tape.results
        end = self._slide(list(others), end)
        motion.turning, motion.tangent = ctypes.addressof(turned), model.beams.flat("stiffness").shape[1]
        motion.seen, motion.rows, motion.observables = (ctypes.addressof(part) for part in (seen, groups, weighed))
        motion.part = self._kept(np.array([0, system.linear, *(stop for _, stop in system.ranges)]))
        motion.couples = end

    def _own_data(self, number: int) -> Array:
        """Data of a group of terms that may be changed."""
        own = self.handed.data[number] = self.handed.data[number].copy()
        self.handed.groups[number].datum = own.ctypes.data
        return own

    def _slide(self, tapes: list[Tape], end: int) -> int:
        """Groups of the places that may slide, whose results begin at ``end``; where those of others begin."""
        rubbing, layout, motion = self._system.rubbing, self._layout, self.motion
        self._sliding = list[tuple[Sliding, Tape, int]]()
        self._slid = list[tuple[Array, Index]]()
        if rubbing is None:
            return end
        found, given = (c.Group * len(tapes))(), layout.model.given
        for i, (group, tape) in enumerate(zip(rubbing.sliding(), tapes, strict=True)):
            own, row = np.array(layout.repeated(group.data)), layout.lines(group.gaps)
            found[i] = layout.group(group, tape, row=row, rows=1, loads=rubbing.axes, result=end)
            found[i].datum, found[i].load = own.ctypes.data, given
            given += found[i].terms * rubbing.axes
            self._sliding.append((group, tape, end))
            self._slid.append((own.reshape(self._method.stages, *group.data.shape), group.members))
            self._arrays.append(own)
            end += found[i].terms * tape.results
        self._arrays.append(found)
        motion.sliding, motion.further = len(tapes), given - layout.model.given
        motion.slide = ctypes.addressof(found)
        return end

    def _map(self) -> None:
        """Positions of what has mass or drag, their forces on places and elements, and masses and drags."""
        system, layout, motion = self._system, self._layout, self.motion
        y = system.model.positions.Y
        by_place, by_tangent = mapped(system.by_place), mapped(system.by_tangent)
        onto_places = SparseMap(*_product(y, by_place), (y.shape[1], system.linear))
        for name, matrix in {
            "by_place": by_place,
            "by_tangent": by_tangent,
            "onto_pull": by_tangent.T,
            "onto_places": onto_places,
            "mass": mapped(system.mass),
            "drag": mapped(system.drag),
        }.items():
            setattr(motion, name, layout.map(matrix))

    def _weigh(self) -> None:
        """Weights of what moves with inner nodes of elements, and of places."""
        system, motion = self._system, self.motion
        mass, drag = (part.nonzeros() for part in (system.place_mass, system.place_drag))
        motion.masses, motion.drags = len(mass), len(drag)
        motion.place_mass, motion.place_drag = self._kept(np.array(mass)), self._kept(np.array(drag))
        motion.massive, motion.inside = len(system.massive), self._kept(system.massive)
        motion.point_of = self._kept(system.points_of_columns)
        motion.inner_mass, motion.inner_drag = (self._kept(part) for part in system.inner_shares)
        motion.first_mass, motion.first_drag = (self._kept(part) for part in system.first_shares)
        if system.crossing is not None:
            motion.cross, motion.coriolis = self._kept(system.crossing), self._crossed()
            weight = system.place_weights[2]
            motion.weights, motion.weight = len(weight), self._kept(weight)

    def _crossed(self) -> c.Map:
        """Coriolis forces of the rates of the quantities of all stages, each part of which has its stages together."""
        system, stages = self._system, self._method.stages
        assert system.coriolis is not None
        one, parts = mapped(system.coriolis), [(0, system.linear), *system.ranges]
        at = np.zeros((stages, system.layout.x), np.intp)
        for begin, end in parts:
            at[:, begin:end] = stages * begin + np.arange(stages * (end - begin)).reshape(stages, -1)
        row, column = (at[:, part].ravel() for part in (one.row, one.column))
        order, count = np.lexsort((column, row)), at.size
        start = np.searchsorted(row[order], np.arange(count + 1))
        value = np.tile(one.value, stages)[order]
        return c.Map(count, count, *(self._kept(part) for part in (start, column[order], value)))

    def _matrix(self) -> CoreSystem:
        """Of which numbers the entries of the matrix of all stages are sums, and what solves with it."""
        system, layout, motion, stages = self._system, self._layout, self.motion, self._method.stages
        static, coupled = system.entry_places.static, system.entry_places.coupled
        one, both, total = system.tables.tied(static), coupled.places, layout.model.total
        parts = list[tuple[Index, Index, Array, Index]]()
        for i in range(stages):
            at, factor = layout.contributions(i)
            for (tape, begin), group in zip(self._stiff, system.masses.observables, strict=True):
                n = len(group.data)
                at = np.append(at, cells(tape, begin, stages * n, 4)[i * n : (i + 1) * n])
            at = np.concatenate([at, *self._by_place_and_gap(i)])
            at, factor = np.append(at, layout.begins[-1]), np.append(factor, np.ones(len(at) + 1 - len(factor)))
            row, column, weight, number = one
            parts.append((self._unknown[i, row], self._unknown[i, column], weight * factor[number], at[number]))
        row, column, weight, number = both
        number = self._of_sliding(coupled.count)[number]
        for k in range(stages * stages):
            i, j = divmod(k, stages)
            at = motion.couples + k * coupled.count + number
            parts.append((self._unknown[i, row], self._unknown[j, column], weight, at))
        rows = np.arange(layout.model.rows)
        first = motion.couples + stages * stages * coupled.count
        self._coupled = stages * stages * coupled.count + len(rows)
        parts.append((layout.model.unknowns + rows, layout.model.unknowns + rows, np.ones(len(rows)), first + rows))
        row, column, weight, source = (np.concatenate(part) for part in zip(*parts, strict=True))
        keys, inverse = np.unique(column * total + row, return_inverse=True)
        motion.entries = layout.sums(len(keys), inverse.ravel(), source, weight)
        motion.entry_count = len(keys)
        none = (np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
        onto, source, weight = (np.concatenate(part) for part in zip(none, *self._shares(), strict=True))
        motion.shares = layout.sums(total, onto, source, weight)
        row, column, last = keys % total, keys // total, last_rows(len(rows))
        found = CoreSystem(self._library, total, row, column, np.zeros(total), last, False)
        self.pattern = (total, row, column, found.order)
        return found

    def _by_place_and_gap(self, stage: int) -> Iterator[Index]:
        """Where derivatives of the forces of places that slide are, by their displacements, then by multipliers."""
        for part in (1, 2) if self._sliding else ():
            found = [
                (group.members, cells(tape, begin, self._method.stages * len(group.members), part))
                for group, tape, begin in self._sliding
            ]
            members = np.concatenate([one for one, _ in found])
            own = [at[stage * len(one) : (stage + 1) * len(one)] for one, at in found]
            yield np.concatenate(own)[np.argsort(members)].ravel()

    def _of_sliding(self, count: int) -> Index:
        """Of numbers that couple stages where the core has them: those of places that slide are in its own order."""
        found = np.arange(count)
        if self._sliding:
            members = np.concatenate([group.members for group, _, _ in self._sliding])
            first, size = self._system.entry_places.sliding, len(members) * self._system.axes**2
            own = found[first : first + size].reshape(len(members), -1)
            own[members] = own.copy()
        return found

    def _shares(self) -> Iterator[tuple[Index, Index, Array]]:
        """Forces of observables, and on what slides, onto the unknowns: which, the results that they are, weights."""
        tables, layout, stages = self._system.tables, self._layout, self._method.stages
        pairs = zip(self._stiff, self._system.masses.observables, self._system.observed, strict=True)
        for (tape, begin), group, sides in pairs:
            unknown = np.where(sides < 0, -1, tables.unknown[sides]).ravel()
            used = np.flatnonzero(unknown >= 0)
            source = cells(tape, begin, stages * len(group.data), 3).reshape(stages, -1)
            weight = tables.weight[sides.ravel()[used]]
            yield layout.unknowns(unknown[used]), source[:, used].ravel(), layout.repeated(weight)
        for sliding, tape, begin in self._sliding:
            own = tables.place_cells(sliding.places[:, 0]).ravel()
            used = np.flatnonzero(tables.unknown[own] >= 0)
            source = cells(tape, begin, stages * len(sliding.members), 0).reshape(stages, -1)
            onto = layout.unknowns(tables.unknown[own[used]])
            yield onto, source[:, used].ravel(), layout.repeated(tables.weight[own[used]])

    # -- steps ----------------------------------------------------------------------------------------

    def _hand_over(self) -> None:
        """Memory for what a step takes and finds: always the same, so that the core is told only once where it is."""
        system, n, stages, kept = self._system, self._system.layout, self._method.stages, self._method.kept
        rotations, unilateral = (n.rotations, n.components), len(system.unilateral)
        self._taken = taken = {
            "given": np.zeros(self._given_at.size),
            "vector": np.zeros((stages, 3 * len(self.inputs.turned))),
            "q": np.zeros(rotations),
            "y": np.zeros(n.y),
            "lam": np.zeros(self._row_at.size),
            "turn": np.zeros((stages, n.rotations, system.turns)),
            "shift": np.zeros((stages, n.y)),
            "x": np.zeros(n.x),
            "rate": np.zeros((kept, n.x)),
            "unwrapped": np.zeros(self._angle_of.size),
        }
        if unilateral:
            # Rows act, and hold at zero, unless they act at times.
            taken["acting"], taken["held"] = np.ones(self._row_at.size), np.zeros(self._row_at.size)
            self._switched = self._row_at[:, system.switching]
            self._holding = self._row_at[:, system.unilateral.rows]
        sizes = {
            "last_q": taken["q"].size,
            "last_y": n.y,
            "rows": taken["lam"].size,
            "turns": taken["turn"].size,
            "shifts": taken["shift"].size,
            "there": stages * n.x,
            "rates": taken["rate"].size,
        }
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self._found = np.zeros(ends[-1])
        self._parts = [slice(*ends[i : i + 2]) for i in range(len(sizes))]
        addresses = {name: part.ctypes.data for name, part in taken.items()}
        addresses |= {
            name: self._found.ctypes.data + part.start * self._found.itemsize
            for name, part in zip(sizes, self._parts, strict=True)
        }
        self._step = c.Advance(**addresses)
        last = (ctypes.addressof(self._step), ctypes.addressof(self._point), self._memory.ctypes.data)
        self._handed_over = (self._model.address, ctypes.addressof(self.motion), self._solver.address, *last)

    def __call__(
        self, memory: Memory, h: float, ratio: float, factors: Array, turns: Array, shifts: Array
    ) -> tuple[Array, ...]:
        """As the function of :func:`~sfetcas.dynamics.steps.step_function`, its results as arrays.

        Parameters
        ----------
        memory : Memory
        h, ratio : float
            Length of the step, and over that of the step before; 0 for a restart.
        factors : ndarray (stages, groups)
            Of the loads.
        turns : ndarray (stages, rotations, turns)
        shifts : ndarray (stages, displacements)
            What was gained in the step before.
        """
        taken = self._taken
        for data, columns, part in self._remembering:
            data[:, :, columns] = memory.remembered[part].reshape(-1, len(columns))
        rows = self._system.rows(factors)
        taken["given"][self._given_at] = rows[:, self._given]
        taken["vector"][...] = rows[:, self.inputs.parts["vectors"]]
        taken["lam"][self._row_at] = memory.lam
        begun = {"q": memory.q, "y": memory.y, "x": memory.x, "rate": memory.rates, "turn": turns, "shift": shifts}
        for name, values in begun.items():
            taken[name][...] = values
        taken["unwrapped"][...] = memory.unwrapped[self._angle_of]
        if len(self._system.unilateral):
            switches, rubs, rubbing = memory.acting, memory.rubs, self._system.rubbing
            if rubbing is not None and rubs is not None:
                switches = np.concatenate([switches, rubs.holds.ravel()])
                sliding = rubbing.sliding_of(rubs)
                for data, members in self._told:
                    data[:, :, : rubbing.told] = rubs.told[members]
                for data, members in self._slid:
                    data[:, :, -sliding.shape[1] :] = sliding[members]
            taken["acting"][self._switched], taken["held"][self._holding] = switches, memory.held
        step = self._step
        step.h, step.ratio = h, ratio
        while (broken := self._library.sf_advance(*self._handed_over)) == NO_ROOM:
            self._solver.make_room()
        if broken:
            # Stopped by a matrix without an inverse, a step leaves no numbers.
            self._found[...] = np.nan
        found = self._found.copy()
        parts = [found[own] for own in self._parts]
        parts[2] = parts[2][self._row_at]
        return *parts, np.array([step.size]), np.array([step.iterations]), np.array([step.gap])

    # -- flat states ----------------------------------------------------------------------------------

    @functools.cached_property
    def flat(self) -> c.Flat:
        """What the core takes of rows of inputs and flat states."""
        stages, inputs = self._method.stages, self.inputs
        sizes = [data.size // stages for data in self._varying]
        addresses = (ctypes.c_void_p * len(sizes))(*(data.ctypes.data for data in self._varying))
        self._arrays.append(addresses)
        return c.Flat(
            *(inputs.size, len(sizes), self._kept(np.array(sizes, np.intp)), ctypes.addressof(addresses)),
            *(self._kept(self._given_at), self._kept(self._row_at)),
            *(self._system.model.unwrapping.count, len(self._angle_of), self._kept(self._angle_of)),
        )

    def prefer_pivots_of(self, rows: Array, h: float, state: Array) -> None:
        """Try the pivots of a step first in all steps of flat states: to look for them takes a third of their time."""
        self.flat.pivots = None
        self.after(rows, h, state)
        self.flat.pivots = None if (found := self._solver.pivots) is None else self._kept(found)

    @property
    def groups(self) -> list[c.Group]:
        """All groups of terms."""
        return [*self.handed.groups, *self.rows, *self.seen, *(one.group for one in self.observables), self.turning]

    @property
    def arrays(self) -> dict[int, Any]:
        """What the structures point to, by addresses."""
        return self.handed.arrays | self._layout.arrays

    @property
    def results(self) -> int:
        """How many numbers the terms give, and what couples stages."""
        return len(self._results)

    @property
    def room(self) -> int:
        """Numbers of memory that a step of a flat state takes."""
        own = self._library.sf_take_step_size(*self._handed_over[:2], ctypes.addressof(self.flat))
        return int(own + self._library.sf_work_size(self._model.address))

    def after(self, rows: Array, h: float, state: Array) -> tuple[Array, float, int, float]:
        """The flat state (numbers,) after a step of h, and of Newton's method the last change, iterations, largest gap.

        A state has rotations, displacements, multipliers, what the first two gained in the stages of the last step,
        quantities, their rates, angles that count turns, and the length of the last step, 0 for a fresh start; ``rows``
        are those of :attr:`.System.inputs` at the stages.  It is nan where a matrix has no inverse.
        """
        library, solver, rows, state = self._library, self._solver, c.doubles(rows), c.doubles(state)
        model, motion = self._handed_over[:2]
        tables = (model, motion, ctypes.addressof(self.flat))
        found, step, memory = np.empty(len(state)), c.Advance(), np.empty(library.sf_take_step_size(*tables))
        numbers = (h, rows.ctypes.data, state.ctypes.data, found.ctypes.data)
        room = (ctypes.addressof(self._point), memory.ctypes.data, ctypes.addressof(step))
        # One call at a time has the memory of the model.
        with self._lock:
            while (broken := library.sf_take_step(*tables, solver.address, *numbers, *room)) == NO_ROOM:
                solver.make_room()
        if broken:
            found[...], step.size, step.gap = np.nan, np.nan, np.nan
        return found, step.size, step.iterations, step.gap


def _product(y: SparseMap, by_place: SparseMap) -> tuple[Index, Index, Array]:
    """Entries of ``y^T by_place^T``; each row of y has one entry at most."""
    of_row, value = np.full(y.shape[0], -1), np.zeros(y.shape[0])
    of_row[y.row], value[y.row] = y.column, y.value
    used = np.flatnonzero(of_row[by_place.column] >= 0)
    place = by_place.column[used]
    return of_row[place], by_place.row[used], value[place] * by_place.value[used]
