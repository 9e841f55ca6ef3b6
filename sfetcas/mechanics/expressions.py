"""A model as CasADi expressions of its rotations, displacements and multipliers, with loads and data as they are given.

The form of the equations is that of :class:`~sfetcas.mechanics.equations.Equations`, whose numbers of unknowns it has;
here all of it is one graph, of which time steps, vibrations and generated code are made.  *Full* coordinates are the
turns of all rotations, the displacements of all places, and the multipliers, held or not.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from ..mathematics.constants import by_axes, constant, sparse, times
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import SparseMap
from .connections import Group
from .entries import Closed
from .equations import Equations
from .masses import Observables
from .rotations import Turn
from .singles import (
    exponential,
    moved_rotation,
    rotation_between,
    rows_of,
    spread_change,
    turned_change,
    turned_vector,
)

__all__ = ["LOADS", "Expressions", "Given", "Layout", "moved_by"]


@dataclass(frozen=True)
class Layout:
    """Numbers of a model: rotations, displacements, multipliers, groups of loads.

    Attributes
    ----------
    components, rotations : int
        Rotations are (components, rotations).
    y, lam, factors : int
        Displacements, multipliers, and factors of the groups of loads.
    near : int
        Angles that count turns.
    """

    components: int
    rotations: int
    y: int
    lam: int
    factors: int
    near: int


@dataclass(frozen=True, eq=False)
class Given:
    """Data and loads of the equations, constant or not, dimensionless; all that is no unknown.

    Attributes
    ----------
    stiffness, tangent : (stiffnesses, points) and (axes, points) of all elements
    pull : (points * axes,)
        Minus the internal force that loads cause, forces on places that hang on segments included.
    force, shift : (places * axes,)
        Forces on places, prescribed displacements.
    moment, twist : (turns * rotations,)
        Moments on rotations, fixed and following.
    turn : (3 * rotations,)
        Prescribed rotation vectors.
    following, tangential, spread : (n * axes,) and (points * axes,)
        What turns with a rotation, and along elements; distributed forces that ``pull`` was made of.
    data, loads : tuples of (data, n) and (loads * n,)
        Of each group of connections.
    """

    stiffness: ca.MX
    tangent: ca.MX
    pull: ca.MX
    force: ca.MX
    shift: ca.MX
    moment: ca.MX
    twist: ca.MX
    turn: ca.MX
    following: ca.MX
    tangential: ca.MX
    spread: ca.MX
    data: tuple[ca.MX, ...]
    loads: tuple[ca.MX, ...]


class Expressions:
    """Everything of a model that its equations need; made once, Functions on demand.

    Parameters
    ----------
    equations : Equations
        Numbers the unknowns.
    kernels : str
        Compiled or interpreted element functions.
    calls : float
        How often they will be called, for ``auto``.
    """

    def __init__(self, equations: Equations, kernels: Kernels = "auto", calls: float = 1e4) -> None:
        self.equations, self.model = equations, equations.model
        model, element = self.model, self.model.element
        self.elements, self.points = model.rotations.turns.shape
        self.axes, self.turns = element.axes, element.turns
        self.places = len(model.segments.places)
        # Centrifugal forces are a load that no factor multiplies.
        self.loadings = [*model.groups.values(), *([model.spinning.loading] if model.spinning else [])]
        self._calls, self._kernels = calls, kernels
        self.layout = Layout(
            components=element.components,
            rotations=len(model.rotations.kind),
            y=equations.displacement_unknowns,
            lam=equations.rows,
            factors=len(self.loadings),
            near=model.winding.count,
        )
        self._number()
        self._close()
        starts = [model.segments.place(part.start) for part in model.segments.parts]
        self.start = np.array(starts, dtype=np.intp)[model.segments.owner]

    def many(self, function: ca.Function, n: int) -> ca.Function:
        """A function of single things for n of them, compiled where that pays."""
        return chosen(function, self._calls * n, self._kernels).map(n)

    # -- numbers ----------------------------------------------------------------------------------

    def _number(self) -> None:
        """Full coordinates (turns of all rotations, displacements of all places, multipliers) in the unknowns."""
        equations, model = self.equations, self.model
        rotations = self.layout.rotations
        self.of_places = self.turns * rotations
        self.of_rows = self.of_places + self.axes * self.places
        self.full = self.of_rows + equations.rows
        unknown, weight = np.full(self.full, -1, np.intp), np.ones(self.full)
        free = (model.rotations.kind == Turn.FREE)[:, None]
        unknown[: self.of_places] = np.where(free, equations.number, -1).ravel()
        for i in np.flatnonzero(model.rotations.kind == Turn.AXIS) if model.space else ():
            unknown[3 * i : 3 * i + 3], weight[3 * i : 3 * i + 3] = equations.number[i, 0], model.rotations.axis[i]
        self.total = equations.total
        turning = np.flatnonzero(unknown >= 0)
        # What acts between places acts upon kept ones, and of these each component is one unknown.
        y = model.positions.Y
        displacements = equations.turning_unknowns + y.column
        unknown[self.of_places + y.row], weight[self.of_places + y.row] = displacements, y.value
        rows = np.arange(equations.rows)
        unknown[self.of_rows :] = equations.unknowns + rows
        self.unknown, self.weight = unknown, weight
        # Residuals in full coordinates to those of the unknowns; changes of the unknowns to full ones.
        self.gather = sparse(
            np.concatenate([unknown[turning], displacements, equations.unknowns + rows]),
            np.concatenate([turning, self.of_places + y.row, self.of_rows + rows]),
            np.concatenate([weight[turning], y.value, np.ones(equations.rows)]),
            (self.total, self.full),
        )
        self._turning = self.gather.T[: self.of_places, :]
        cells = self.turns * model.rotations.turns[:, :, None] + np.arange(self.turns)
        self.cells = cells.reshape(self.elements, self.turns * self.points)
        moments, ones = np.arange(self.cells.size), np.ones(self.cells.size)
        self.onto_rotations = sparse(self.cells.ravel(), moments, ones, (self.of_places, self.cells.size))
        self.linked = [self.sides_of(group) for group in model.connections]
        self.link_rows, first = [], self.of_rows + len(model.positions.rows)
        for group in model.connections:
            self.link_rows.append(first + np.arange(len(group.rows)).reshape(len(group.names), -1))
            first += len(group.rows)

    def place_cells(self, places: Index) -> Index:
        """Full coordinates (n, axes) of displacements of places."""
        return np.asarray(self.of_places + self.axes * places[:, None] + np.arange(self.axes))

    def sides_of(self, group: Group | Observables) -> Index:
        """Full coordinates of the sides of a group (n, width), -1 of the ground."""
        n = len(group.data)
        turning = self.turns * group.turns[:, :, None] + np.arange(self.turns)
        moving = self.place_cells(group.places.ravel()).reshape(n, -1)
        ground = np.repeat(group.places < 0, self.axes, axis=1)
        turning = np.where(group.turns[:, :, None] < 0, -1, turning).reshape(n, -1)
        return np.concatenate([turning, np.where(ground, -1, moving)], axis=1)

    def onto_unknowns(self, sides: Index) -> ca.DM:
        """What takes values on sides to the unknowns."""
        flat = sides.ravel()
        unknown = np.where(flat < 0, -1, self.unknown[flat])
        used = np.flatnonzero(unknown >= 0)
        return sparse(unknown[used], used, self.weight[flat[used]], (self.total, len(flat)))

    # -- linear maps --------------------------------------------------------------------------------

    def _reached(self, reaches: SparseMap) -> tuple[Index, Index, Array, Index, Index]:
        """Entries of a map of the reaches of segments by elements: row, element, value, axis; all their points."""
        axes, owner = self.axes, self.model.segments.owner
        first = np.searchsorted(owner, np.arange(len(self.model.segments.parts) + 1))
        segment = reaches.column // axes
        counts = first[segment + 1] - first[segment]
        row, value, axis = (np.repeat(part, counts) for part in (reaches.row, reaches.value, reaches.column % axes))
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        element = np.repeat(first[segment], counts) + within
        points = ((element[:, None] * self.points + np.arange(self.points)) * axes + axis[:, None]).ravel()
        return row, element, value, axis, points

    def _by_tangents(self, reaches: SparseMap) -> ca.DM:
        """A map of the reaches of segments as one of the turned tangents of all points."""
        row, _, value, _, points = self._reached(reaches)
        shape = (reaches.shape[0], self.elements * self.points * self.axes)
        return sparse(np.repeat(row, self.points), points, np.repeat(value, self.points), shape)

    def _close(self) -> None:
        """Places and closings as linear maps of the turned tangents, and derivatives of closings by rotations."""
        positions = self.model.positions
        self.reaching, self.closing = self._by_tangents(positions.E), self._by_tangents(positions.Z)
        rows, elements, values, axis, _ = self._reached(positions.Z)
        width = self.turns * self.points
        # Spins of elements stand by columns (turns), then elements.
        entry = ((elements[:, None] * width + np.arange(width)) * self.axes + axis[:, None]).ravel()
        self.closed = Closed(
            row=self.of_rows + np.repeat(rows, width),
            cell=self.cells[elements].ravel(),
            entry=entry,
            value=np.repeat(values, width),
        )

    # -- what is given --------------------------------------------------------------------------------

    def columns(self, part: str) -> ca.DM:
        """A part of the loads, a column for each group; ``pull`` with forces on places that hang on segments."""
        found = [getattr(loading, part) for loading in self.loadings]
        if part in ("moment", "twist"):
            found = [moments[:, 3 - self.turns :] for moments in found]
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
        beams = self.model.beams
        return {
            "stiffness": ca.DM(beams.stiffness.reshape(-1, beams.stiffness.shape[-1]).T),
            "tangent": ca.DM(beams.tangent.reshape(-1, self.axes).T),
            "data": tuple(ca.DM(group.data.T) for group in self.model.connections),
        }

    def given(self, factors: ca.MX) -> Given:
        """What is given at factors of the groups of loads: data are those of the model, and constant."""
        parts: dict[str, Any] = {name: times(columns, factors) for name, columns in self._columns.items()}
        return Given(**self._data, **parts, loads=tuple(times(each, factors) for each in self._link_columns))

    def acts(self, part: str) -> bool:
        """Whether there is anything of a part of the loads."""
        return bool(self._columns[part].nnz())

    # -- what follows -------------------------------------------------------------------------------

    def _tangential(self, q: ca.MX, given: Given) -> ca.MX:
        """Distributed forces that turn with the sections, (axes, elements with such * points)."""
        elements = self.model.followers.elements
        columns = (elements[:, None] * self.points + np.arange(self.points)).ravel().tolist()
        forces = ca.reshape(given.tangential, self.axes, self.elements * self.points)[:, columns]
        turns = self.model.rotations.turns[elements].ravel().tolist()
        return self.many(turned_vector(self.model.space), len(columns))(q[:, turns], forces)

    def carried(self, q: ca.MX, given: Given) -> ca.MX:
        """Pull of distributed followers on the points of all elements."""
        elements = self.model.followers.elements
        if not len(elements):
            return ca.MX.zeros(self.elements * self.points * self.axes)
        return times(self._pulled(elements), ca.vec(self._tangential(q, given)))

    def _pulled(self, elements: Index) -> ca.DM:
        """What takes forces at the points of elements to the pull there: minus what acts beyond."""
        element, n = self.model.element, self.points
        weights = -element.to_points.T / element.weights[:, None]
        count = len(elements)
        row = elements[:, None, None] * n + np.arange(n)[:, None] + np.zeros((1, 1, n), np.intp)
        column = np.arange(count)[:, None, None] * n + np.zeros((1, n, 1), np.intp) + np.arange(n)
        value = np.broadcast_to(weights, (count, n, n))
        matrix = SparseMap(row.ravel(), column.ravel(), value.ravel(), (self.elements * n, count * n))
        return constant(by_axes(matrix, self.axes))

    def follower_cells(self) -> list[tuple[Index, Index]]:
        """Full coordinates of the rows and columns of what followers add to the matrix, see :meth:`followed`."""
        followers, turns = self.model.followers, np.arange(self.turns)
        cells = []
        if len(followers.places):
            rows = self.place_cells(followers.places)
            cells.append((rows[:, None, :], (self.turns * followers.turns[:, None] + turns)[:, :, None]))
        if len(followers.elements):
            along = self.cells[followers.elements]
            rows = np.concatenate([self.place_cells(self.start[followers.elements]), along], axis=1)
            cells.append((rows[:, None, :], along[:, :, None]))
        if self.twisting:
            each = 3 * np.arange(self.layout.rotations)[:, None] + np.arange(3)
            cells.append((each[:, None, :], each[:, :, None]))
        return cells

    @functools.cached_property
    def twisting(self) -> bool:
        """Whether moments in space turn what is free to turn: they have no potential."""
        return self.model.space and (self.acts("moment") or self.acts("twist"))

    def followed(self, q: ca.MX, given: Given) -> tuple[ca.MX, ca.MX, list[ca.MX]]:
        """Forces on places and moments on rotations of what follows, both as residuals, and entries of the matrix."""
        followers, space = self.model.followers, self.model.space
        on_places, entries = ca.MX.zeros(self.axes * self.places), []
        on_turns = ca.MX.zeros(self.of_places)
        if len(followers.places):
            n = len(followers.places)
            following = ca.reshape(given.following, self.axes, n)
            forces = self.many(turned_vector(space), n)(q[:, followers.turns.tolist()], following)
            on_places -= times(self._onto_places(followers.places), ca.vec(forces))
            entries.append(ca.vec(self.many(turned_change(space), n)(forces)))
        if len(followers.elements):
            n = len(followers.elements)
            forces = self._tangential(q, given)
            starts = np.repeat(self.start[followers.elements], self.points)
            on_places -= times(self._onto_places(starts), ca.vec(forces))
            columns = (followers.elements[:, None] * self.points + np.arange(self.points)).ravel().tolist()
            tangents = self.tangents(q, given)[:, columns]
            entries.append(ca.vec(self.many(spread_change(self.model.element), n)(forces, tangents)))
        if self.twisting:
            n = self.layout.rotations
            twist = self.many(turned_vector(True), n)(q, ca.reshape(given.twist, 3, n))
            moment = ca.reshape(given.moment, 3, n)
            on_turns -= ca.vec(twist)
            # The symmetric form of all moments counts these with minus and plus half of what they turn by.
            entries.append(0.5 * ca.vec(self.many(turned_change(True), n)(twist - moment)))
        return on_places, on_turns, entries

    def _onto_places(self, places: Index) -> ca.DM:
        """What takes forces (n * axes,) to the places that they act on."""
        at = (self.axes * places[:, None] + np.arange(self.axes)).ravel()
        return sparse(at, np.arange(len(at)), np.ones(len(at)), (self.axes * self.places, len(at)))

    # -- where things are -----------------------------------------------------------------------------

    def tangents(self, q: ca.MX, given: Given) -> ca.MX:
        """Turned tangents of all points, (axes, elements * points)."""
        element, turns = self.model.element, self.model.rotations.turns
        if element.gauss:
            return self.many(element.turned, self.elements)(q[:, turns.ravel().tolist()], given.tangent)
        at_points = q[:, turns.ravel().tolist()]
        return self.many(turned_vector(self.model.space), turns.size)(at_points, given.tangent)

    def displacements(self, q: ca.MX, y: ca.MX, given: Given) -> ca.MX:
        """Displacements of all places."""
        positions = self.model.positions
        moved = times(constant(positions.Y), y) + times(constant(positions.B), given.shift)
        if not self.reaching.nnz():
            return moved
        return moved + times(self.reaching, ca.vec(self.tangents(q, given)) - ca.vec(given.tangent))

    def open_gaps(self, y: ca.MX, given: Given) -> ca.MX:
        """The share of displacements in the closings."""
        positions = self.model.positions
        return times(constant(positions.W), y) + times(constant(positions.BZ), given.shift)

    def gaps(self, q: ca.MX, y: ca.MX, given: Given, near: ca.MX) -> ca.MX:
        """What is left open of the closings and of the rows of joints."""
        places, gaps = self.displacements(q, y, given), self.open_gaps(y, given)
        if self.elements:
            gaps += times(self.closing, ca.vec(self.tangents(q, given)) - ca.vec(given.tangent))
        parts = [gaps]
        for number, group in enumerate(self.model.connections):
            if group.rows:
                n = len(group.data)
                sides = *self.sides(group, q, places), self.data(number, given, near)
                parts.append(ca.vec(self.many(rows_of(group.kind), n)(*sides, self.link_load(number, given))))
        return ca.vertcat(*parts)

    def held(self, q: ca.MX, given: Given) -> ca.MX:
        """Rotations with those that motions prescribe at their values."""
        turn = ca.reshape(given.turn, 3, self.layout.rotations)
        driven = np.any([group.turn.any(axis=1) for group in self.model.groups.values()], axis=0)
        for i in np.flatnonzero(driven & (self.model.rotations.kind == Turn.HELD)).tolist():
            q[:, i] = exponential(turn[:, i]) if self.model.space else turn[2, i]
        return q

    def spins(self, step: ca.MX) -> ca.MX:
        """Vectors (turns, rotations) about the fixed axes by which changes of the unknowns turn all rotations."""
        return ca.reshape(times(self._turning[:, : step.shape[0]], step), self.turns, self.layout.rotations)

    def turned(self, q: ca.MX, there: ca.MX) -> ca.MX:
        """Rotation vectors (turns, rotations) from rotations to others."""
        return self.many(rotation_between(self.model.space), self.layout.rotations)(q, there)

    # -- connections ------------------------------------------------------------------------------------

    def sides(self, group: Group | Observables, q: ca.MX, places: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Rotations and displacements of the sides of a group, the ground being the last of both."""
        turns, at = group.turns, group.places
        rest = ca.DM([1.0, 0.0, 0.0, 0.0] if self.model.space else [0.0])
        q = ca.horzcat(q, rest) if (turns < 0).any() else q
        turned = q[:, np.where(turns < 0, self.layout.rotations, turns).ravel().tolist()]
        u = ca.reshape(places, self.axes, self.places)
        u = ca.horzcat(u, ca.DM.zeros(self.axes, 1)) if (at < 0).any() else u
        return turned, u[:, np.where(at < 0, self.places, at).ravel().tolist()]

    def data(self, number: int, given: Given, near: ca.MX) -> ca.MX:
        """Data of a group of connections; the last of those that count turns is the value near which they do."""
        part = self.model.winding.parts[number]
        data = ca.MX(given.data[number])
        return data if part is None else ca.vertcat(data[:-1, :], near[part.start : part.stop].T)

    def link_load(self, number: int, given: Given) -> ca.MX:
        """Loads of a group of connections, (loads, n)."""
        group = self.model.connections[number]
        return ca.reshape(given.loads[number], group.kind.sizes[4], len(group.data))

    def gathered(
        self, turning: ca.MX, on_places: ca.MX, full: list[tuple[Index, ca.MX]], lam: ca.MX, rows: list[ca.MX]
    ) -> ca.MX:
        """The residual of the unknowns and rows.

        From moments on all rotations, forces on all places, shares on sides, multipliers of the closings, and gaps.
        """
        residual = ca.mtimes(self.gather, ca.vertcat(turning, on_places, ca.MX.zeros(self.full - self.of_rows)))
        for sides, values in full:
            residual += times(self.onto_unknowns(sides), ca.vec(values))
        below = ca.vertcat(times(constant(self.model.positions.W).T, lam), *rows)
        return residual + ca.vertcat(ca.MX.zeros(self.equations.turning_unknowns), below)


LOADS = ("pull", "force", "shift", "moment", "twist", "turn", "following", "tangential", "spread")
"""Parts of the loads that are linear in the factors of their groups."""


def moved_by(expressions: Expressions, q: ca.MX, phi: ca.MX) -> ca.MX:
    """Rotations (components, rotations) after rotation vectors (turns, rotations)."""
    return expressions.many(moved_rotation(expressions.model.space), expressions.layout.rotations)(q, phi)
