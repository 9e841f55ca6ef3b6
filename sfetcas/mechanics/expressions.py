"""A model as CasADi expressions of its rotations, displacements and multipliers, with loads and data as arguments.

The equations and their unknowns are those of :class:`~sfetcas.mechanics.equations.Equations`; here they form one graph,
from which time steps, vibrations and generated code are made.  *Full* coordinates are the components of all rotations,
the displacements of all places, and the multipliers, prescribed or not.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics.arrays import Index
from ..mathematics.constants import added, sparse, times
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import SparseMap
from .equations import Equations
from .model import Model
from .rotations import RotationFreedom
from .singles import exponential, moved_rotation, rotation_between, turned_vector
from .tables import Acting, Tables
from .terms import energies_of, rows_of

__all__ = ["LOADS", "Expressions", "Given", "Layout", "SymbolicTerms", "data_of", "moved_by"]


@dataclass(frozen=True)
class Layout:
    """Sizes of a model: rotations, displacements, multipliers, groups of loads.

    Attributes
    ----------
    components, rotations : int
        Rotations are an array (components, rotations).
    y, lam, factors : int
        Number of displacement unknowns, of multipliers, and of factors of the groups of loads.
    unwrapped : int
        Number of angles that count turns.
    """

    components: int
    rotations: int
    y: int
    lam: int
    factors: int
    unwrapped: int


@dataclass(frozen=True, eq=False)
class Given:
    """Data and loads of the equations, constant or symbolic, dimensionless: everything that is not an unknown.

    Attributes
    ----------
    stiffness, tangent, compliance : (stiffnesses, points), (axes, points) and (axes * axes or 0, points)
        Of all elements.
    pull : (points * axes,)
        Minus the internal force that loads cause, including forces on places whose displacement follows from segments.
    force, shift : (places * axes,)
        Forces on places, prescribed displacements.
    turn : (3 * rotations,)
        Prescribed rotation vectors.
    spread : (points * axes,)
        Distributed forces, from which ``pull`` is computed.
    data, loads : tuples of (data, n) and (loads * n,)
        For each group of connections.
    """

    stiffness: ca.MX
    tangent: ca.MX
    compliance: ca.MX
    pull: ca.MX
    force: ca.MX
    shift: ca.MX
    turn: ca.MX
    spread: ca.MX
    data: tuple[ca.MX, ...]
    loads: tuple[ca.MX, ...]


class SymbolicTerms:
    """The terms of a model as expressions of rotations, displacements and multipliers, in either chart of rotations.

    Parameters
    ----------
    tables : Tables
        The chart, and the numbers of the unknowns.
    kernels : str
        ``compiled``, ``interpreted`` or ``auto`` functions of terms.
    calls : float
        Expected number of calls, by which ``auto`` decides.
    """

    def __init__(self, tables: Tables, kernels: Kernels = "auto", calls: float = 1e4) -> None:
        self.tables, self.model = tables, tables.model
        self.elements, self.points = self.model.rotations.turns.shape
        self.axes, self.turns = self.model.element.axes, self.model.element.turns
        self.places, self.rotations = len(self.model.segments.places), len(self.model.rotations.kind)
        self._calls, self.kernels = calls, kernels

    def many(self, function: ca.Function, n: int) -> ca.Function:
        """A function of a single term mapped over n terms, compiled where that pays."""
        return chosen(function, self._calls * n, self.kernels).map(n)

    # -- linear maps --------------------------------------------------------------------------------

    @functools.cached_property
    def reaching(self) -> ca.DM:
        """Matrix from the rotated tangents of all points to the displacements of the places."""
        return self._by_tangents(self.model.positions.E)

    def onto_unknowns(self, sides: Index) -> ca.DM:
        """Matrix that sums generalised forces on sides into the residual (unknowns + rows,)."""
        return self._onto(sides, absolute=False)

    def sizes_onto_unknowns(self, sides: Index) -> ca.DM:
        """As :meth:`onto_unknowns` with absolute weights, to sum magnitudes."""
        return self._onto(sides, absolute=True)

    def _onto(self, sides: Index, *, absolute: bool) -> ca.DM:
        flat = sides.ravel()
        unknown = np.where(flat < 0, -1, self.tables.unknown[flat])
        used = np.flatnonzero(unknown >= 0)
        weight = self.tables.weight[flat[used]]
        return sparse(unknown[used], used, np.abs(weight) if absolute else weight, (self.tables.total, len(flat)))

    def _by_tangents(self, reaches: SparseMap) -> ca.DM:
        """A map of the reaches of segments as one of the turned tangents of all points."""
        axes, n = self.axes, self.points
        elements, repeated = self.tables.elements_reached(reaches.column // axes)
        points = (elements[:, None] * n + np.arange(n)) * axes + (reaches.column % axes)[repeated][:, None]
        row, value = (np.repeat(part[repeated], n) for part in (reaches.row, reaches.value))
        return sparse(row, points.ravel(), value, (reaches.shape[0], self.elements * n * axes))

    # -- where things are -----------------------------------------------------------------------------

    def tangents(self, q: ca.MX, places: ca.MX, given: Given) -> ca.MX:
        """Turned and strained tangents of all points, (axes, elements * points).

        ``places`` are the displacements of retained places, (places * axes,).
        """
        element, turns = self.model.element, self.model.rotations.turns
        if element.gauss or element.yielding:
            sides = self.sides(self.model.terms[0], q, places)
            return self.many(element.turned, self.elements)(*sides, self.data(0, given, ca.MX()))
        at_points = q[:, turns.ravel().tolist()]
        return self.many(turned_vector(self.model.space), turns.size)(at_points, given.tangent)

    def displacements(self, q: ca.MX, y: ca.MX, given: Given) -> ca.MX:
        """Displacements of all places, (places * axes,)."""
        moved = self.retained_places(y, given)
        if not self.reaching.nnz():
            return moved
        return moved + times(self.reaching, ca.vec(self.tangents(q, moved, given)) - ca.vec(given.tangent))

    def retained_places(self, y: ca.MX, given: Given) -> ca.MX:
        """Displacements of retained places (unknown or prescribed), (places * axes,); undefined for others."""
        positions = self.model.positions
        return added((positions.Y, y), (positions.B, given.shift))

    def open_gaps(self, y: ca.MX, given: Given) -> ca.MX:
        """The part of the gaps of loop closures that unknown and prescribed displacements contribute."""
        positions = self.model.positions
        return added((positions.W, y), (positions.BZ, given.shift))

    def gaps(self, q: ca.MX, y: ca.MX, given: Given, unwrapped: ca.MX) -> ca.MX:
        """Gaps of the loop closures, then of the rows of joints, (rows,)."""
        return self.gaps_of(self.every(q, self.retained_places(y, given), given, unwrapped), y, given)

    def gaps_of(self, arguments: list[list[ca.MX]], y: ca.MX, given: Given) -> ca.MX:
        """As :meth:`gaps`, from the arguments that :meth:`every` gives."""
        closed, rows = self.open_gaps(y, given), list[tuple[int, ca.MX]]()
        for number, (group, own) in enumerate(zip(self.model.terms, arguments, strict=True)):
            if not len(group.data) or not (group.labels.size if number else self.model.positions.rows):
                continue
            found = ca.vec(self.many(rows_of(group.kind), len(group.data))(*own))
            if number == 0:
                closed += times(self.closing, found)
            else:
                rows.append((number, found))
        return ca.vertcat(closed, self.stacked(rows))

    def with_prescribed_rotations(self, q: ca.MX, given: Given) -> ca.MX:
        """The rotations with prescribed ones set to their values."""
        turn = ca.reshape(given.turn, 3, self.rotations)
        driven = np.any([group.turn.any(axis=1) for group in self.model.groups.values()], axis=0)
        for i in np.flatnonzero(driven & (self.model.rotations.kind == RotationFreedom.FIXED)).tolist():
            q[:, i] = exponential(turn[:, i]) if self.model.space else turn[2, i]
        return q

    # -- terms ------------------------------------------------------------------------------------------

    @functools.cached_property
    def closing(self) -> ca.DM:
        """Matrix from the changes of the chords of elements, (axes, elements), to the gaps of the loop closures."""
        z, axes = self.model.positions.Z, self.axes
        elements, repeated = self.tables.elements_reached(z.column // axes)
        columns = elements * axes + (z.column % axes)[repeated]
        return sparse(z.row[repeated], columns, z.value[repeated], (z.shape[0], self.elements * axes))

    def sides(self, group: Acting, q: ca.MX, places: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Rotations and displacements of the sides of a group of terms; the ground is the last column of both."""
        turns, at = group.turns, group.places
        rest = ca.DM([1.0, 0.0, 0.0, 0.0] if self.model.space else [0.0])
        q = ca.horzcat(q, rest) if (turns < 0).any() else q
        turned = q[:, np.where(turns < 0, self.rotations, turns).ravel().tolist()]
        u = ca.reshape(places, self.axes, self.places)
        u = ca.horzcat(u, ca.DM.zeros(self.axes, 1)) if (at < 0).any() else u
        return turned, u[:, np.where(at < 0, self.places, at).ravel().tolist()]

    def data(self, number: int, given: Given, unwrapped: ca.MX) -> ca.MX:
        """Data of a group of terms; the last row of those that count turns is the value near which they do."""
        if number == 0:
            parts = (given.stiffness, given.tangent, given.compliance)
            return ca.vertcat(*(ca.reshape(part, part.shape[0] * self.points, self.elements) for part in parts))
        part = self.model.unwrapping.parts[number]
        data = ca.MX(given.data[number - 1])
        return data if part is None else ca.vertcat(data[:-1, :], unwrapped[part.start : part.stop].T)

    def load(self, number: int, given: Given) -> ca.MX:
        """Loads of a group of terms, (loads, n); for elements their pulls."""
        group = self.model.terms[number]
        flat = given.loads[number - 1] if number else given.pull
        return ca.reshape(flat, group.kind.sizes[4], len(group.data))

    def multipliers(self, number: int, lam: ca.MX) -> ca.MX:
        """Multipliers of the rows of a group, (rows, n); for elements combinations of those of loop closures."""
        group = self.model.terms[number]
        if number == 0:
            return ca.reshape(times(self.closing.T, lam[: self.closing.shape[0], :]), self.axes, self.elements)
        labels = self.tables.labels[number].ravel() - self.tables.of_rows
        first = int(labels[0]) if labels.size else 0
        own = lam[labels.tolist(), :] if group.shared else lam[first : first + labels.size, :]
        return ca.reshape(own, group.kind.sizes[2], len(group.data))

    def stacked(self, rows: list[tuple[int, ca.MX]]) -> ca.MX:
        """Rows beside the loop closures from those of groups of terms, by their numbers; shared ones are added up."""
        if not any(self.model.terms[number].shared for number, _ in rows):
            return ca.vertcat(ca.MX(0, 1), *(values for _, values in rows))
        first = len(self.model.positions.rows)
        labels = np.concatenate([self.tables.labels[n].ravel() - self.tables.of_rows - first for n, _ in rows])
        adder = sparse(labels, np.arange(len(labels)), np.ones(len(labels)), (self.tables.rows - first, len(labels)))
        return times(adder, ca.vertcat(*(values for _, values in rows)))

    def arguments(self, number: int, q: ca.MX, places: ca.MX, given: Given, unwrapped: ca.MX) -> list[ca.MX]:
        """Rotations, displacements, data and loads of the terms of a group, as their functions take them."""
        sides = self.sides(self.model.terms[number], q, places)
        return [*sides, self.data(number, given, unwrapped), self.load(number, given)]

    def every(self, q: ca.MX, places: ca.MX, given: Given, unwrapped: ca.MX) -> list[list[ca.MX]]:
        """Arguments of all groups of terms, with :meth:`retained_places`; an empty list for a group without terms."""
        groups = enumerate(self.model.terms)
        return [self.arguments(i, q, places, given, unwrapped) if len(group.data) else [] for i, group in groups]

    def energies(self, arguments: list[list[ca.MX]]) -> tuple[ca.MX, ca.MX]:
        """Energy of all terms, and its elastic part, from the arguments that :meth:`every` gives."""
        total, stored = ca.MX(0), ca.MX(0)
        for group, own in zip(self.model.terms, arguments, strict=True):
            if own:
                energy, elastic = self.many(energies_of(group.kind), len(group.data))(*own)
                total, stored = total + ca.sum2(energy), stored + ca.sum2(elastic)
        return total, stored


class Expressions(SymbolicTerms):
    """The equations of a model in rotation vectors as CasADi expressions; Functions are built on demand.

    Parameters
    ----------
    equations : Equations
        They number the unknowns.
    kernels, calls
        As of :class:`SymbolicTerms`.
    """

    def __init__(self, equations: Equations, kernels: Kernels = "auto", calls: float = 1e4) -> None:
        super().__init__(equations.tables, kernels, calls)
        self.equations, model = equations, self.model
        # Centrifugal forces and the misfit of tubes are loads that no factor multiplies.
        self.loadings = [*model.groups.values(), *model.standing]
        self.layout = Layout(
            components=model.element.components,
            rotations=self.rotations,
            y=equations.displacement_unknowns,
            lam=equations.rows,
            factors=len(self.loadings),
            unwrapped=model.unwrapping.count,
        )
        self._number()
        starts = [model.segments.place(part.start) for part in model.segments.parts]
        self.start = np.array(starts, dtype=np.intp)[model.segments.owner]

    # -- numbers ----------------------------------------------------------------------------------

    def _number(self) -> None:
        """Maps between full coordinates and the unknowns, see :class:`~sfetcas.mechanics.tables.Tables`."""
        tables, equations = self.tables, self.equations
        self.of_places, self.of_rows, self.full = tables.of_places, tables.of_rows, tables.full
        self.unknown, self.weight, self.total = tables.unknown, tables.weight, equations.total
        turning, rows = np.flatnonzero(self.unknown[: self.of_places] >= 0), np.arange(self.of_rows, self.full)
        y = self.model.positions.Y
        # Residuals in full coordinates to those of the unknowns; changes of the unknowns to full ones.
        self.gather = sparse(
            np.concatenate([self.unknown[turning], equations.rotation_unknowns + y.column, self.unknown[rows]]),
            np.concatenate([turning, self.of_places + y.row, rows]),
            np.concatenate([self.weight[turning], y.value, self.weight[rows]]),
            (self.total, self.full),
        )
        self._turning = self.gather.T[: self.of_places, :]

    # -- what is given --------------------------------------------------------------------------------

    def columns(self, part: str) -> ca.DM:
        """A part of the loads, a column for each group; ``pull`` includes forces on places hanging on segments."""
        found = [getattr(loading, part) for loading in self.loadings]
        if part == "pull":
            hung = (self.reaching.T @ ca.DM(loading.force.ravel()) for loading in self.loadings)
            found = [pull.ravel() - more.full().ravel() for pull, more in zip(found, hung, strict=True)]
        return ca.sparsify(ca.DM(np.stack([values.ravel() for values in found], axis=1)))

    @functools.cached_property
    def _columns(self) -> dict[str, ca.DM]:
        return {part: self.columns(part) for part in LOADS}

    @functools.cached_property
    def _link_columns(self) -> list[ca.DM]:
        numbers = range(len(self.model.connections))
        return [ca.DM(np.stack([group.loads[i].ravel() for group in self.loadings], axis=1)) for i in numbers]

    @functools.cached_property
    def _data(self) -> dict[str, Any]:
        return data_of(self.model)

    def given(self, factors: ca.MX) -> Given:
        """Data of the model, as constants, and its loads for factors (groups,) of their groups."""
        parts: dict[str, Any] = {name: times(columns, factors) for name, columns in self._columns.items()}
        return Given(**self._data, **parts, loads=tuple(times(each, factors) for each in self._link_columns))

    def loaded(self) -> dict[str, bool]:
        """For each part of the loads whether it is present; those of connections are ``loads_0``, ``loads_1``, ..."""
        found = {name: bool(columns.nnz()) for name, columns in self._columns.items()}
        return found | {f"loads_{i}": bool(ca.sparsify(each).nnz()) for i, each in enumerate(self._link_columns)}

    def spins(self, step: ca.MX) -> ca.MX:
        """Rotation vectors (turns, rotations), fixed axes, of an increment of the unknowns."""
        return ca.reshape(times(self._turning[:, : step.shape[0]], step), self.turns, self.layout.rotations)

    def turned(self, q: ca.MX, there: ca.MX) -> ca.MX:
        """Rotation vectors (turns, rotations), fixed axes, from rotations ``q`` to rotations ``there``."""
        return self.many(rotation_between(self.model.space), self.layout.rotations)(q, there)

    def gathered(self, shares: list[tuple[Index, ca.MX]], force: ca.MX, lam: ca.MX, rows: list[ca.MX]) -> ca.MX:
        """The residual (unknowns + rows,).

        It is summed from generalised forces on sides, forces on all places as a residual, multipliers of the loop
        closures, and gaps.
        """
        onto = self.gather[:, self.of_places : self.of_rows]
        residual = times(onto, force)
        for sides, values in shares:
            residual += times(self.onto_unknowns(sides), ca.vec(values))
        below = ca.vertcat(times(self.model.positions.W.T, lam), *rows)
        return residual + ca.vertcat(ca.MX.zeros(self.equations.rotation_unknowns), below)


def data_of(model: Model) -> dict[str, Any]:
    """Data of the terms of a model as constants, by their names in :class:`Given`."""
    beams, element = model.beams, model.element
    return {
        "stiffness": ca.DM(beams.stiffness.reshape(-1, element.stiffnesses).T),
        "tangent": ca.DM(beams.tangent.reshape(-1, element.axes).T),
        "compliance": ca.DM(beams.compliance.reshape(beams.weight.size, beams.compliance.shape[-1]).T),
        "data": tuple(ca.DM(group.data.T) for group in model.connections),
    }


LOADS = ("pull", "force", "shift", "turn", "spread")
"""Parts of the loads that are linear in the factors of their groups."""


def moved_by(expressions: Expressions, q: ca.MX, phi: ca.MX) -> ca.MX:
    """Rotations (components, rotations) rotated further by rotation vectors (turns, rotations), fixed axes."""
    return expressions.many(moved_rotation(expressions.model.space), expressions.layout.rotations)(q, phi)
