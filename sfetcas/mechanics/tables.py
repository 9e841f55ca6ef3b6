"""Index tables for assembly: numbers of the unknowns, and positions of the entries of terms in matrices.

*Full* coordinates are those of all rotations, the displacements of all places, and the multipliers, prescribed or not.
In one chart the coordinates of a rotation are a rotation vector about the fixed axes, in the other the components of
its quaternion; in the plane both are the angle.  Each full coordinate has at most one unknown and a weight: of a
rotation that is restrained to an axis the three components of a vector are one unknown times the components of the
axis.  Terms give moments, forces and second derivatives by full coordinates; weighted sums take them to the unknowns.
The numeric and the symbolic evaluation use the same tables.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from .model import Model
from .rotations import RotationFreedom

__all__ = ["Acting", "Closed", "Entries", "Pattern", "Places", "Tables"]

Places = tuple[Index, Index, Array, Index]
"""Row, column and weight of entries in a matrix of the unknowns, and which of the given numbers each is."""


class Acting(Protocol):
    """Interface of groups that act on rotations and places: of terms, or of quantities that carry mass."""

    @property
    def turns(self) -> Index:
        """Numbers of the rotations, (n, rotations)."""

    @property
    def places(self) -> Index:
        """Numbers of the places, (n, places)."""

    @property
    def data(self) -> Array:
        """Data, (n, data)."""


class Entries:
    """Positions of matrix entries in full coordinates, and in the unknowns."""

    def __init__(self, unknown: Index, weight: Array) -> None:
        self._unknown, self._weight = unknown, weight
        self._rows: list[Array] = []
        self._columns: list[Array] = []
        self.count = 0

    def add(self, rows: Array, columns: Array) -> None:
        """Append positions of entries in full coordinates, in the order in which their values will be given.

        ``rows`` and ``columns`` are arrays that broadcast; -1 is the ground.
        """
        rows, columns = np.broadcast_arrays(rows, columns)
        self._rows.append(rows.ravel())
        self._columns.append(columns.ravel())
        self.count += rows.size

    @functools.cached_property
    def places(self) -> Places:
        """Row, column and weight in the unknowns, and number, of the entries that are not on prescribed coordinates."""
        nothing = np.zeros(0, np.intp)
        rows = np.concatenate([nothing, *self._rows])
        columns = np.concatenate([nothing, *self._columns])
        # Held sides, of the ground too, have no unknown.
        r = np.where(rows < 0, -1, self._unknown[rows])
        c = np.where(columns < 0, -1, self._unknown[columns])
        keep = np.flatnonzero((r >= 0) & (c >= 0))
        return r[keep], c[keep], (self._weight[rows] * self._weight[columns])[keep], keep


@dataclass(frozen=True)
class Pattern:
    """Sparsity pattern of a matrix, the map that sums entries into it, and a permutation and its inverse."""

    pattern: ca.Sparsity
    sums: ca.DM
    order: list[int]
    back: list[int]


@dataclass(frozen=True)
class Closed:
    """Jacobian entries of loop closures by rotations, each array (entries,).

    ``row`` and ``cell`` are the full coordinates of multiplier and rotation, ``entry`` the index in the derivatives of
    the chords of elements, ``value`` the factor.
    """

    row: Index
    cell: Index
    entry: Index
    value: Array


class Tables:
    """Numbers of the unknowns of a model and positions of the entries of its terms.

    Parameters
    ----------
    model : Model
    components : bool
        The chart of rotations: components of quaternions instead of rotation vectors.

    Attributes
    ----------
    width : int
        Number of coordinates of a rotation.
    number : ndarray (rotations, width)
        Unknown of each coordinate of a rotation, -1 where it has none; of a rotation that is restrained to an axis the
        first is the angle, or the first two are the scalar and the vector's component along the axis.
    place_number : ndarray (places, axes)
        Unknown of each component of a displacement that is an unknown by itself, else -1.
    rotation_unknowns, displacement_unknowns, unknowns, rows, total : int
        Number of rotation and displacement unknowns, their sum, number of constraint rows, and the sum of all.
    of_places, of_rows, full : int
        Where displacements and multipliers begin among the full coordinates, and their number.
    unknown, weight : ndarray (full,)
        Unknown (or -1) and weight of each full coordinate.
    sides : list of ndarray (n, width)
        For each group of terms the full coordinates of its sides, -1 for the ground.
    labels : list of ndarray (n, rows)
        For each group the full coordinates of its multipliers; none for elements, which have no multipliers of their
        own.
    """

    def __init__(self, model: Model, *, components: bool = False) -> None:
        self.model, self._components = model, components
        self.width = model.element.components if components else model.element.turns
        self._number()
        self._full()
        self.sides = [self.sides_of(group) for group in model.terms]
        first = self.of_rows + len(model.positions.rows)
        self.labels = [np.zeros((len(model.terms[0].data), 0), np.intp)]
        self.labels += [first + group.labels for group in model.connections]

    def _number(self) -> None:
        model, turns = self.model, self.width
        about = 2 if self._components and model.space else 1
        count = np.where(
            model.rotations.kind == RotationFreedom.FREE,
            turns,
            np.where(model.rotations.kind == RotationFreedom.AXIS, about, 0),
        )
        ends = np.cumsum(count)
        self.number = np.full((len(count), turns), -1, dtype=np.intp)
        for i in range(turns):
            here = count > i
            self.number[here, i] = (ends - count)[here] + i
        self.rotation_unknowns = int(ends[-1]) if len(ends) else 0
        self.displacement_unknowns = len(model.positions.unknowns)
        retained = model.positions.retained
        self.place_number = np.where(retained < 0, -1, self.rotation_unknowns + retained)
        self.rows = len(model.row_names)
        self.unknowns = self.rotation_unknowns + self.displacement_unknowns
        self.total = self.unknowns + self.rows

    def _full(self) -> None:
        model, width, axes = self.model, self.width, self.model.element.axes
        rotations = len(model.rotations.kind)
        self.of_places = width * rotations
        self.of_rows = self.of_places + axes * len(model.segments.places)
        self.full = self.of_rows + self.rows
        unknown, weight = np.full(self.full, -1, np.intp), np.ones(self.full)
        unknown[: self.of_places] = self.number.ravel()
        for i in np.flatnonzero(model.rotations.kind == RotationFreedom.AXIS) if model.space else ():
            vector = slice(width * (i + 1) - 3, width * (i + 1))
            unknown[vector], weight[vector] = self.number[i, width - 3], model.rotations.axis[i]
        # What acts between places acts upon retained ones, and of these each component is one unknown.
        y = model.positions.Y
        unknown[self.of_places + y.row], weight[self.of_places + y.row] = self.rotation_unknowns + y.column, y.value
        unknown[self.of_rows :] = self.unknowns + np.arange(self.rows)
        self.unknown, self.weight = unknown, weight

    def place_cells(self, places: Index) -> Index:
        """Full coordinates (n, axes) of the displacements of places (n,)."""
        axes = self.model.element.axes
        return np.asarray(self.of_places + axes * places[:, None] + np.arange(axes))

    def sides_of(self, group: Acting) -> Index:
        """Full coordinates (n, width) of the sides of a group, -1 for the ground."""
        n = len(group.data)
        turning = self.width * group.turns[:, :, None] + np.arange(self.width)
        axes = self.model.element.axes
        moving = self.place_cells(group.places.ravel()).reshape(n, axes * group.places.shape[1])
        ground = np.repeat(group.places < 0, axes, axis=1)
        turning = np.where(group.turns[:, :, None] < 0, -1, turning).reshape(n, self.width * group.turns.shape[1])
        return np.concatenate([turning, np.where(ground, -1, moving)], axis=1)

    # -- loop closures ------------------------------------------------------------------------------

    @functools.cached_property
    def closed(self) -> Closed:
        """Jacobian of the loop closures by rotations of elements, from the derivatives of their chords."""
        model, axes = self.model, self.model.element.axes
        z, cells = model.positions.Z, self.sides[0]
        elements, repeated = self.elements_reached(z.column // axes)
        width = cells.shape[1]
        # Spins of elements stand by rows (axes) within columns (turns), element by element.
        entry = (elements[:, None] * width + np.arange(width)) * axes + (z.column % axes)[repeated][:, None]
        return Closed(
            row=self.of_rows + np.repeat(z.row[repeated], width),
            cell=cells[elements].ravel(),
            entry=entry.ravel(),
            value=np.repeat(z.value[repeated], width),
        )

    def elements_reached(self, segments: Index) -> tuple[Index, Index]:
        """All elements of given segments, and for each of them the index of its segment among those given."""
        first = np.searchsorted(self.model.segments.owner, np.arange(len(self.model.segments.parts) + 1))
        counts = first[segments + 1] - first[segments]
        repeated = np.repeat(np.arange(len(segments)), counts)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return first[segments][repeated] + within, repeated

    # -- Newton's matrix ----------------------------------------------------------------------------

    @functools.cached_property
    def static(self) -> Entries:
        """Positions of the entries of all terms, see :meth:`static_entries`."""
        return self.static_entries()

    def static_entries(self) -> Entries:
        """A new list of the entries of all terms: second derivatives, then Jacobian of the rows and transpose."""
        found = self.entries()
        for number in range(len(self.sides)):
            self._add_second(found, number)
            row, column = self._first(number)
            found.add(row, column)
            found.add(column, row)
        return found

    @functools.cached_property
    def second(self) -> Entries:
        """Positions of the entries of second derivatives alone, group by group."""
        found = self.entries()
        for number in range(len(self.sides)):
            self._add_second(found, number)
        return found

    @functools.cached_property
    def first(self) -> Entries:
        """Positions of the entries of the Jacobian of the rows alone, group by group."""
        found = self.entries()
        for number in range(len(self.sides)):
            found.add(*self._first(number))
        return found

    def _add_second(self, found: Entries, number: int) -> None:
        sides = self.sides[number]
        found.add(sides[:, None, :], sides[:, :, None])

    def _first(self, number: int) -> tuple[Index, Index]:
        """Rows and columns of the rows' derivatives of a group."""
        if number == 0:
            return self.closed.row, self.closed.cell
        sides, labels = self.sides[number], self.labels[number]
        row, column = np.broadcast_arrays(labels[:, None, :], sides[:, :, None])
        return row, column

    def entries(self) -> Entries:
        """A new, empty list of entries."""
        return Entries(self.unknown, self.weight)

    def tied(self, entries: Entries) -> Places:
        """The positions of entries, then those of displacements in loop closures, of one last entry, the number 1."""
        w = self.model.positions.W
        row, column, value, entry = entries.places
        r, c = self.unknowns + w.row, self.rotation_unknowns + w.column
        return (
            np.concatenate([row, r, c]),
            np.concatenate([column, c, r]),
            np.concatenate([value, np.tile(w.value, 2)]),
            np.concatenate([entry, np.full(2 * len(w.value), entries.count)]),
        )

    @functools.cached_property
    def whole(self) -> Places:
        """Positions of the entries of the terms, of displacements in loop closures, and of a diagonal of entry 0."""
        row, column, weight, entry = self.tied(self.static)
        every = np.arange(self.total)
        return (
            np.concatenate([row, every]),
            np.concatenate([column, every]),
            np.concatenate([weight, np.ones(self.total)]),
            np.concatenate([entry, np.full(self.total, self.static.count + 1)]),
        )
