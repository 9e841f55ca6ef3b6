"""The equations of motion at the stages of a time step, and one Newton iteration of them, as CasADi Functions.

At each stage the equations are those of statics, with the same kernels, plus inertia and damping forces as further
loads: ``M X'' + C X'`` of the quantities ``X`` (see :mod:`~sfetcas.mechanics.observed`).  A method of integration says
how rates at its stages depend on the quantities there,

    X'_i = sum_j C_ij (X_j - X_0) + v_i,      X''_i = sum_j B_ij (X_j - X_0) + a_i,

with ``v``, ``a`` from what came before; nothing else here knows it.  Norms hold by construction, closings are
equations of every stage: index 3, with multipliers as internal forces.

Unknown changes are those of :class:`~sfetcas.mechanics.equations.Equations`: rotation vectors about the fixed axes,
displacements, multipliers; their matrix has the entries of statics on its diagonal blocks and those of inertia and
damping on all of them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TypeVar

import casadi as ca
import numpy as np

from ..description.loads import History
from ..mathematics.arrays import Array, Index
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import SparseMap, pattern
from ..mathematics.quaternion import product, turned
from ..mechanics.connections import Group
from ..mechanics.elements import Element
from ..mechanics.equations import Equations, State
from ..mechanics.joints import Connection, by_turning, name_of
from ..mechanics.loading import Loading
from ..mechanics.masses import Masses, Observables
from ..mechanics.rotations import Turn
from ..mechanics.spinning import vectors_of

__all__ = ["Layout", "StageEquations", "moved_by"]


def _constant(matrix: SparseMap) -> ca.DM:
    """A constant sparse matrix."""
    order = np.lexsort((matrix.row, matrix.column))
    row, column = matrix.row[order], matrix.column[order]
    starts = np.searchsorted(column, np.arange(matrix.shape[1] + 1))
    return ca.DM(ca.Sparsity(*matrix.shape, starts.tolist(), row.tolist()), matrix.value[order])


def _sparse(row: Array, column: Array, value: Array, shape: tuple[int, int]) -> ca.DM:
    return _constant(SparseMap(np.asarray(row, np.intp), np.asarray(column, np.intp), value, shape))


def _by_axes(matrix: SparseMap, axes: int) -> SparseMap:
    """A matrix of scalars that acts on every component of vectors."""
    each = np.arange(axes)
    row, column = ((part[:, None] * axes + each).ravel() for part in (matrix.row, matrix.column))
    return SparseMap(row, column, np.repeat(matrix.value, axes), (matrix.shape[0] * axes, matrix.shape[1] * axes))


T = TypeVar("T", ca.SX, ca.MX)


def _times(matrix: ca.DM, vector: ca.MX) -> ca.MX:
    """A product that leaves out what is not there."""
    return ca.densify(ca.mtimes(matrix, vector)) if matrix.nnz() else ca.MX.zeros(matrix.shape[0], vector.shape[1])


def _hanging(onto: ca.DM, matrix: ca.DM) -> ca.DM:
    """A matrix of positions in the displacements of places."""
    return ca.mtimes(onto.T, ca.mtimes(matrix, onto))


@dataclass(frozen=True)
class Layout:
    """Numbers of a system: rotations, displacements, multipliers, quantities, groups of loads.

    Attributes
    ----------
    components, rotations : int
        Rotations are (components, rotations).
    y, lam, x, factors : int
        Displacements, multipliers, quantities, and factors of the groups of loads.
    near : int
        Angles that count turns.
    """

    components: int
    rotations: int
    y: int
    lam: int
    x: int
    factors: int
    near: int


class _Entries:
    """Places of entries of a matrix in full coordinates, and the matrix that sums them up in the unknowns."""

    def __init__(self, unknown: Index, weight: Array) -> None:
        self._unknown, self._weight = unknown, weight
        self._rows: list[Array] = []
        self._columns: list[Array] = []
        self.count = 0

    def add(self, rows: Array, columns: Array) -> None:
        """Places of the next entries, in the order of what will be given."""
        rows, columns = np.broadcast_arrays(rows, columns)
        self._rows.append(rows.ravel())
        self._columns.append(columns.ravel())
        self.count += rows.size

    @functools.cached_property
    def places(self) -> tuple[Index, Index, Array, Index]:
        """Row, column and weight in the unknowns, and which entry each is."""
        nothing = np.zeros(0, np.intp)
        rows = np.concatenate([nothing, *self._rows])
        columns = np.concatenate([nothing, *self._columns])
        # Held sides, of the ground too, have no unknown.
        r = np.where(rows < 0, -1, self._unknown[rows])
        c = np.where(columns < 0, -1, self._unknown[columns])
        keep = np.flatnonzero((r >= 0) & (c >= 0))
        return r[keep], c[keep], (self._weight[rows] * self._weight[columns])[keep], keep


class StageEquations:
    """Everything of a model that stages of any method need; made once, Functions on demand.

    Parameters
    ----------
    equations : Equations
        Numbers the unknowns.
    masses : Masses
    kernels : str
        Compiled or interpreted element functions.
    """

    def __init__(self, equations: Equations, masses: Masses, kernels: Kernels = "auto", calls: float = 1e4) -> None:
        self.equations, self.model, self.masses = equations, equations.model, masses
        model, element = self.model, self.model.element
        self.elements, self.points = model.rotations.turns.shape
        self.axes, self.turns = element.axes, element.turns
        # Centrifugal forces are a load that no factor multiplies.
        self.loadings = [*model.groups.values(), *([model.spinning.loading] if model.spinning else [])]
        self._calls, self._kernels = calls, kernels
        self.given = [
            ca.DM(part.reshape(-1, part.shape[-1]).T) for part in (model.beams.stiffness, model.beams.tangent)
        ]
        self.rest = model.beams.tangent.ravel()
        self._number()
        self._place()
        self._close()
        self._weigh()
        self._load()

    def many(self, function: ca.Function, n: int) -> ca.Function:
        """A function of single things for n of them, compiled where that pays."""
        return chosen(function, self._calls * n, self._kernels).map(n)

    # -- numbers ----------------------------------------------------------------------------------

    def _number(self) -> None:
        """Full coordinates (turns of all rotations, displacements of all places, multipliers) in the unknowns."""
        equations, model = self.equations, self.model
        rotations, places = len(model.rotations.kind), len(model.segments.places)
        self.of_places = self.turns * rotations
        self.of_rows = self.of_places + self.axes * places
        self.full = self.of_rows + equations.rows
        unknown, weight = np.full(self.full, -1, np.intp), np.ones(self.full)
        free = (model.rotations.kind == Turn.FREE)[:, None]
        unknown[: self.of_places] = np.where(free, equations.number, -1).ravel()
        for i in np.flatnonzero(model.rotations.kind == Turn.AXIS) if model.space else ():
            unknown[3 * i : 3 * i + 3], weight[3 * i : 3 * i + 3] = equations.number[i, 0], model.rotations.axis[i]
        y = model.positions.Y
        unknown[self.of_places + y.row], weight[self.of_places + y.row] = equations.turning_unknowns + y.column, y.value
        unknown[self.of_rows :] = equations.unknowns + np.arange(equations.rows)
        self.unknown, self.weight, self.total = unknown, weight, equations.total
        used = np.flatnonzero(unknown >= 0)
        # Residuals in full coordinates to those of the unknowns; changes of the unknowns to full ones.
        self.gather = _sparse(unknown[used], used, weight[used], (self.total, self.full))
        self._turning = self.gather.T[: self.of_places, :]
        turns = np.arange(self.turns)
        cells = self.turns * model.rotations.turns[:, :, None] + turns
        self.cells = cells.reshape(self.elements, self.turns * self.points)
        moments = np.arange(self.cells.size)
        ones = np.ones(self.cells.size)
        self.onto_rotations = _sparse(self.cells.ravel(), moments, ones, (self.of_places, self.cells.size))
        self.linked = [self._sides(group) for group in model.connections]
        self.observed = [self._sides(group) for group in self.masses.observables]
        self.link_rows, first = [], self.of_rows + len(model.positions.rows)
        for group in model.connections:
            self.link_rows.append(first + np.arange(len(group.rows)).reshape(len(group.names), -1))
            first += len(group.rows)

    def place_cells(self, places: Index) -> Index:
        """Full coordinates (n, axes) of displacements of places."""
        return np.asarray(self.of_places + self.axes * places[:, None] + np.arange(self.axes))

    # -- what follows -------------------------------------------------------------------------------

    def _tangential(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """Distributed forces that turn with the sections, (axes, elements with such * points)."""
        elements = self.model.followers.elements
        columns = (elements[:, None] * self.points + np.arange(self.points)).ravel().tolist()
        given = ca.reshape(_times(self.tangential, factors), self.axes, self.elements * self.points)[:, columns]
        turns = self.model.rotations.turns[elements].ravel().tolist()
        return self.many(_turned(self.model.space), len(columns))(q[:, turns], given)

    def carried(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """Pull of distributed followers on the points of all elements."""
        elements = self.model.followers.elements
        if not len(elements):
            return ca.MX.zeros(self.elements * self.points * self.axes)
        forces = ca.vec(self._tangential(q, factors))
        return _times(self._pulled(elements), forces)

    def _pulled(self, elements: Index) -> ca.DM:
        """What takes forces at the points of elements to the pull there: minus what acts beyond."""
        element, n = self.model.element, self.points
        weights = -element.to_points.T / element.weights[:, None]
        count = len(elements)
        row = elements[:, None, None] * n + np.arange(n)[:, None] + np.zeros((1, 1, n), np.intp)
        column = np.arange(count)[:, None, None] * n + np.zeros((1, n, 1), np.intp) + np.arange(n)
        value = np.broadcast_to(weights, (count, n, n))
        matrix = SparseMap(row.ravel(), column.ravel(), value.ravel(), (self.elements * n, count * n))
        return _constant(_by_axes(matrix, self.axes))

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
        return self.model.space and bool(self.moment.nnz() or self.twist.nnz())

    def followed(self, q: ca.MX, factors: ca.MX) -> tuple[ca.MX, ca.MX, list[ca.MX]]:
        """Forces on places and moments on rotations of what follows, both as residuals, and entries of the matrix."""
        followers, space = self.model.followers, self.model.space
        on_places, entries = ca.MX.zeros(self.axes * self.places), []
        on_turns = ca.MX.zeros(self.of_places)
        if len(followers.places):
            n = len(followers.places)
            given = ca.reshape(_times(self.following, factors), self.axes, n)
            forces = self.many(_turned(space), n)(q[:, followers.turns.tolist()], given)
            at = (self.axes * followers.places[:, None] + np.arange(self.axes)).ravel()
            on_places -= _times(
                _sparse(at, np.arange(len(at)), np.ones(len(at)), (self.axes * self.places, len(at))), ca.vec(forces)
            )
            entries.append(ca.vec(self.many(_change(space), n)(forces)))
        if len(followers.elements):
            n = len(followers.elements)
            forces = self._tangential(q, factors)
            starts = np.repeat(self.start[followers.elements], self.points)
            at = (self.axes * starts[:, None] + np.arange(self.axes)).ravel()
            on_places -= _times(
                _sparse(at, np.arange(len(at)), np.ones(len(at)), (self.axes * self.places, len(at))), ca.vec(forces)
            )
            columns = (followers.elements[:, None] * self.points + np.arange(self.points)).ravel().tolist()
            tangents = self.tangents(q)[:, columns]
            entries.append(ca.vec(self.many(_spread_change(self.model.element), n)(forces, tangents)))
        if self.twisting:
            n = self.layout.rotations
            twist = self.many(_turned(True), n)(q, ca.reshape(_times(self.twist, factors), 3, n))
            moment = ca.reshape(_times(self.moment, factors), 3, n)
            on_turns -= ca.vec(twist)
            # The symmetric form of all moments counts these with minus and plus half of what they turn by.
            entries.append(0.5 * ca.vec(self.many(_change(True), n)(twist - moment)))
        return on_places, on_turns, entries

    def _sides(self, group: Group | Observables) -> Index:
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
        return _sparse(unknown[used], used, self.weight[flat[used]], (self.total, len(flat)))

    # -- linear maps --------------------------------------------------------------------------------

    def _place(self) -> None:
        """Positions that carry mass: of the places, then of the inner nodes of the elements."""
        model, axes, n = self.model, self.axes, self.points
        self.places = len(model.segments.places)
        starts = [model.segments.place(part.start) for part in model.segments.parts]
        self.start = np.array(starts, dtype=np.intp)[model.segments.owner]
        inner = np.argwhere((self.masses.inner > 0.0) | (self.masses.inner_drag > 0.0))
        count, places = len(inner), self.places
        # That of the first node of the element, and the integral up to there.
        weights = model.element.to_points / model.element.weights
        of_points = (inner[:, :1] * n + np.arange(n)).ravel()
        reach = SparseMap(
            np.repeat(np.arange(count), n), of_points, weights[inner[:, 1]].ravel(), (count, self.elements * n)
        )
        reach = _by_axes(reach, axes)
        self.linear = axes * (places + count)
        self.by_tangent = _sparse(
            reach.row + axes * places, reach.column, reach.value, (self.linear, self.elements * n * axes)
        )
        own = np.arange(axes * places)
        below = axes * places + np.arange(axes * count)
        at = (axes * self.start[inner[:, 0]][:, None] + np.arange(axes)).ravel()
        row, column = np.concatenate([own, below]), np.concatenate([own, at])
        self.by_place = _sparse(row, column, np.ones(len(row)), (self.linear, axes * places))
        self.inner_nodes, self._up_to = inner, weights

    def _close(self) -> None:
        """Closings as linear maps of the turned tangents, and their derivatives by rotations."""
        model, axes, n = self.model, self.axes, self.points
        z, owner = model.positions.Z, model.segments.owner
        if len(model.positions.E.value):
            raise ValueError("motion needs the nodal assembly on a mesh with a place at every cut")
        first = np.searchsorted(owner, np.arange(len(model.segments.parts) + 1))
        row, element, axis, value = [], [], [], []
        for r, c, v in zip(z.row, z.column, z.value, strict=True):
            segment = c // axes
            here = np.arange(first[segment], first[segment + 1])
            row.append(np.full(len(here), r))
            element.append(here)
            axis.append(np.full(len(here), c % axes))
            value.append(np.full(len(here), v))
        nothing = np.zeros(0, np.intp)
        rows, elements, component = (np.concatenate([nothing, *part]) for part in (row, element, axis))
        values = np.concatenate([np.zeros(0), *value])
        points = ((elements[:, None] * n + np.arange(n)) * axes + component[:, None]).ravel()
        shape = (len(model.positions.rows), self.elements * n * axes)
        self.closing = _sparse(np.repeat(rows, n), points, np.repeat(values, n), shape)
        width = self.turns * n
        # Spins of elements stand by columns (turns), then elements.
        entry = ((elements[:, None] * width + np.arange(width)) * axes + component[:, None]).ravel()
        self.closed = _Closed(
            row=self.of_rows + np.repeat(rows, width),
            cell=self.cells[elements].ravel(),
            entry=entry,
            value=np.repeat(values, width),
        )

    def _weigh(self) -> None:
        """Masses and drags of the positions, and what those within an element do to its rotations."""
        masses, axes = self.masses, self.axes
        inside = tuple(self.inner_nodes.T)
        own = np.arange(axes * self.places, self.linear)
        drag = SparseMap(np.arange(self.places), np.arange(self.places), masses.place_drag, (self.places,) * 2)
        found, here = [], []
        for of_places, inner in ((masses.places, masses.inner), (drag, masses.inner_drag)):
            each = _by_axes(of_places, axes)
            row, column = np.concatenate([each.row, own]), np.concatenate([each.column, own])
            value = np.concatenate([each.value, np.repeat(inner[inside], axes)])
            found.append(_sparse(row, column, value, (self.linear, self.linear)))
            # Inner nodes hang on the first place of their element.
            first = _hanging(self.by_place, found[-1])
            here.append(first)
        (self.mass, self.drag), (self.place_mass, self.place_drag) = found, here
        self.massive = np.unique(self.inner_nodes[:, 0])
        width = self.turns * self.points
        self.massive_columns = (self.massive[:, None] * width + np.arange(width)).ravel().tolist()
        arms = self._up_to
        shares = [
            np.einsum("ek,kj,kl->elj", part[self.massive], arms, arms) for part in (masses.inner, masses.inner_drag)
        ]
        self.inner = [share.reshape(-1, self.points).T for share in shares]
        firsts = [part[self.massive] @ arms for part in (masses.inner, masses.inner_drag)]
        # One for each component of the spins: by axes, turns of a point, points, elements.
        self.firsts = [np.repeat(first.ravel(), self.turns * axes) for first in firsts]
        sizes = [group.kind.sizes[2] * len(group.data) for group in masses.observables]
        bounds = np.cumsum([self.linear, *sizes]).tolist()
        self.ranges = list(zip(bounds, bounds[1:], strict=False))
        self.layout = Layout(
            components=self.model.element.components,
            rotations=len(self.model.rotations.kind),
            y=self.equations.displacement_unknowns,
            lam=self.equations.rows,
            x=bounds[-1],
            factors=len(self.loadings),
            near=self.model.winding.count,
        )

    def _load(self) -> None:
        """Loads and motions as linear maps of the factors of their groups."""
        loadings = self.loadings

        def columns(part: str) -> ca.DM:
            return ca.sparsify(ca.DM(np.stack([getattr(loading, part).ravel() for loading in loadings], axis=1)))

        self.pull, self.force, self.shift, self.turn = (columns(part) for part in ("pull", "force", "shift", "turn"))
        moments = np.stack([loading.moment[:, 3 - self.turns :].ravel() for loading in loadings], axis=1)
        self.moment = ca.sparsify(ca.DM(moments))
        self.twist, self.following, self.tangential = (columns(part) for part in ("twist", "following", "tangential"))
        numbers = range(len(self.model.connections))
        self.loads = [ca.DM(np.stack([group.loads[i].ravel() for group in loadings], axis=1)) for i in numbers]

    # -- arguments of the kernels ---------------------------------------------------------------------

    def tangents(self, q: ca.MX) -> ca.MX:
        """Turned tangents of all points, (axes, elements * points)."""
        at_points = q[:, self.model.rotations.turns.ravel().tolist()]
        given = ca.DM(self.model.beams.tangent.reshape(-1, self.axes).T)
        return self.many(_turned(self.model.space), self.elements * self.points)(at_points, given)

    def displacements(self, y: ca.MX, factors: ca.MX) -> ca.MX:
        """Displacements of all places."""
        positions = self.model.positions
        return _times(_constant(positions.Y), y) + _times(_constant(positions.B), _times(self.shift, factors))

    def held(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """Rotations with those that motions prescribe at their values."""
        turn = ca.reshape(_times(self.turn, factors), 3, self.layout.rotations)
        for i in np.flatnonzero(np.any([group.turn.any(axis=1) for group in self.model.groups.values()], axis=0)):
            if self.model.rotations.kind[i] == Turn.HELD:
                q[:, int(i)] = _exponential(turn[:, int(i)]) if self.model.space else turn[2, int(i)]
        return q

    @functools.cached_property
    def _rates(self) -> ca.Function:
        """(q, y, factors, near, step) -> quantities, and their derivative along a step of the unknowns."""
        n = self.layout
        q, y = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y)
        factors, near, step = ca.MX.sym("factors", n.factors), ca.MX.sym("near", n.near), ca.MX.sym("step", self.total)
        along = ca.MX.sym("along")
        spin = self.spins(along * step)
        shift = along * step[self.equations.turning_unknowns : self.equations.unknowns]
        x = self.quantities(moved_by(self, q, spin), self.displacements(y + shift, factors), near)
        rate = ca.substitute([x, ca.jtimes(x, along, ca.MX(1))], [along], [ca.MX(0)])
        return ca.Function("rates", [q, y, factors, near, step], rate)

    def spins(self, step: ca.MX) -> ca.MX:
        """Vectors (turns, rotations) about the fixed axes by which changes of the unknowns turn all rotations."""
        return ca.reshape(_times(self._turning[:, : step.shape[0]], step), self.turns, self.layout.rotations)

    def rates(self, state: State, factors: Array, step: Array) -> tuple[Array, Array]:
        """Quantities at a state, and their rates where the unknowns have the rates ``step``."""
        full = np.concatenate([step, np.zeros(self.equations.rows)])
        x, v = self.interpreted._rates(state.q.T, state.y, factors, state.wound, full)
        return np.array(x).ravel(), np.array(v).ravel()

    @functools.cached_property
    def floating(self) -> tuple[Array, Array] | None:
        """What all displacements (y, axes) and quantities (x, axes) gain when everything moves by one along each axis.

        None where the ground holds anything, or the place matters as in turning axes.
        """
        positions, axes = self.model.positions, self.axes
        grounded = any((group.places < 0).any() for group in self.model.connections) or self.model.spinning is not None
        if grounded or positions.Y.shape[0] != len(positions.Y.value):
            return None
        y = np.zeros((self.layout.y, axes))
        y[positions.Y.column, positions.Y.row % axes] = positions.Y.value
        if any(np.abs(positions.W @ column).max(initial=0.0) > 0.0 for column in y.T):
            return None
        q, flat = ca.DM.ones(self.layout.components, self.layout.rotations), np.zeros(self.layout.near)
        if self.model.space:
            q[1:, :] = 0
        arguments = [ca.MX.sym("y", self.layout.y)]
        x = self.quantities(ca.MX(q), self.displacements(arguments[0], ca.MX.zeros(self.layout.factors)), ca.MX(flat))
        values = ca.Function("moved", arguments, [x])
        rest = np.array(values(np.zeros(self.layout.y))).ravel()
        return y, np.stack([np.array(values(column)).ravel() - rest for column in y.T], axis=1)

    @functools.cached_property
    def interpreted(self) -> StageEquations:
        """The same of which nothing is compiled: compiled functions have no derivatives."""
        return self if self._kernels == "interpreted" else StageEquations(self.equations, self.masses, "interpreted")

    @functools.cached_property
    def histories(self) -> tuple[History | None, ...]:
        """Of the groups of loads; None of one whose factor is one."""
        known = self.model.scene.histories
        own = [None if name is None else known[name] for name in self.model.groups]
        return (*own, *([None] * (len(self.loadings) - len(own))))

    def factors(self, t: float) -> Array:
        """Factors of the groups of loads at a time, dimensionless."""
        seconds = t * self.masses.time
        return np.array([1.0 if history is None else history.factor(seconds) for history in self.histories])

    def loading(self, factors: Array) -> Loading:
        """Loads and motions at factors of their groups."""
        groups = [loading.scaled(float(f)) for loading, f in zip(self.loadings, factors, strict=True)]
        return functools.reduce(Loading.plus, groups)

    @staticmethod
    def times(matrix: ca.DM, vector: ca.MX) -> ca.MX:
        """A product with a constant sparse matrix, of full length."""
        return _times(matrix, vector)

    def open_gaps(self, y: ca.MX, factors: ca.MX) -> ca.MX:
        """The share of displacements in the closings."""
        positions = self.model.positions
        return _times(_constant(positions.W), y) + _times(_constant(positions.BZ), _times(self.shift, factors))

    def gathered(
        self, turning: ca.MX, on_places: ca.MX, full: list[tuple[Index, ca.MX]], lam: ca.MX, rows: list[ca.MX]
    ) -> ca.MX:
        """The residual of the unknowns and rows.

        From moments on all rotations, forces on all places, shares on sides, multipliers of the closings, and gaps.
        """
        residual = ca.mtimes(self.gather, ca.vertcat(turning, on_places, ca.MX.zeros(self.full - self.of_rows)))
        for sides, values in full:
            residual += _times(self.onto_unknowns(sides), ca.vec(values))
        below = ca.vertcat(_times(_constant(self.model.positions.W).T, lam), *rows)
        return residual + ca.vertcat(ca.MX.zeros(self.equations.turning_unknowns), below)

    def paired(self, rows: int, width: int, n: int) -> ca.Function:
        """(A, B, w) -> A^T diag(w) B of n groups of rows."""
        return self.many(_pairs(rows, width), n)

    def hung(self, mine: ca.MX, its: ca.MX, c: ca.MX, b: ca.MX) -> list[ca.MX]:
        """Entries of masses and drags within elements: on their rotations, and with their first places."""
        shares = b * ca.DM(self.inner[0]) + c * ca.DM(self.inner[1])
        first = b * ca.DM(self.firsts[0]) + c * ca.DM(self.firsts[1])
        blocks = self.many(_inner(self.axes, self.turns, self.points), len(self.massive))
        return [ca.vec(blocks(mine, its, shares)), ca.vec(mine) * first, ca.vec(its) * first]

    def gaps(self, q: ca.MX, y: ca.MX, factors: ca.MX, near: ca.MX) -> ca.MX:
        """What is left open of the closings and of the rows of joints."""
        places, gaps = self.displacements(y, factors), self.open_gaps(y, factors)
        if self.elements:
            gaps += _times(self.closing, ca.vec(self.tangents(q)) - ca.DM(self.rest))
        parts = [gaps]
        for number, group in enumerate(self.model.connections):
            if group.rows:
                n = len(group.data)
                load = ca.reshape(_times(self.loads[number], factors), group.kind.sizes[4], n)
                parts.append(ca.vec(self.many(_values(group.kind), n)(*self.sides(group, q, places, near), load)))
        return ca.vertcat(*parts)

    def turned(self, q: ca.MX, there: ca.MX) -> ca.MX:
        """Rotation vectors (turns, rotations) from rotations to others."""
        return self.many(_vectors(self.model.space), self.layout.rotations)(q, there)

    def quantities(self, q: ca.MX, places: ca.MX, near: ca.MX) -> ca.MX:
        """All quantities X."""
        parts = [_times(self.by_place, places)]
        if self.elements:
            parts[0] += _times(self.by_tangent, ca.vec(self.tangents(q)) - ca.DM(self.rest))
        for group in self.masses.observables:
            n = len(group.data)
            parts.append(ca.vec(self.many(_values(group.kind), n)(*self.sides(group, q, places, near), ca.MX(0, n))))
        return ca.vertcat(*parts)

    def sides(self, group: Observables | Group, q: ca.MX, places: ca.MX, near: ca.MX) -> list[ca.MX]:
        """Rotations and displacements of the sides of a group, the ground being the last of both, and its data."""
        turns, at = group.turns, group.places
        rest = ca.DM([1.0, 0.0, 0.0, 0.0] if self.model.space else [0.0])
        q = ca.horzcat(q, rest) if (turns < 0).any() else q
        turned = q[:, np.where(turns < 0, self.layout.rotations, turns).ravel().tolist()]
        u = ca.reshape(places, self.axes, self.places)
        u = ca.horzcat(u, ca.DM.zeros(self.axes, 1)) if (at < 0).any() else u
        moved = u[:, np.where(at < 0, self.places, at).ravel().tolist()]
        counted = self._counted(group)
        data = ca.MX(ca.DM(group.data.T))
        # The last of the data is the value near which an angle is counted.
        return [turned, moved, data if counted is None else ca.vertcat(data[:-1, :], near[counted].T)]

    def _counted(self, group: Observables | Group) -> list[int] | None:
        """Which of the angles that count turns those of a group are; None where they count by themselves."""
        number = group.spring if isinstance(group, Observables) else self.model.connections.index(group)
        part = None if number is None else self.model.winding.parts[number]
        if part is None or number is None:
            return None
        own = group.numbers if isinstance(group, Observables) else np.arange(len(group.data))
        return [int(i) for i in part.start + own]

    # -- one Newton iteration ---------------------------------------------------------------------------

    def iteration(self, stages: int, linear: str = "qr") -> ca.Function:
        """One Newton iteration of all stages of a step.

        ``(q, y, lam, x0, v, a, C, B, factors, near) -> (q, y, lam, size)``: q (components, rotations * stages), y, lam,
        v, a and factors with a column for each stage, C and B (stages, stages); ``size`` is the largest rotation or
        displacement by which anything changed.
        """
        n = self.layout
        q = ca.MX.sym("q", n.components, n.rotations * stages)
        y, lam = ca.MX.sym("y", n.y, stages), ca.MX.sym("lam", n.lam, stages)
        x0, v, a = ca.MX.sym("x0", n.x), ca.MX.sym("v", n.x, stages), ca.MX.sym("a", n.x, stages)
        c, b = ca.MX.sym("C", stages, stages), ca.MX.sym("B", stages, stages)
        factors, near = ca.MX.sym("factors", n.factors, stages), ca.MX.sym("near", n.near)
        parts = ca.horzsplit(q, n.rotations)
        places = [self.displacements(y[:, i], factors[:, i]) for i in range(stages)]
        x = ca.horzcat(*[self.quantities(parts[i], places[i], near) - x0 for i in range(stages)])
        rates, accelerations = ca.mtimes(x, c.T) + v, ca.mtimes(x, b.T) + a
        forces = self.forces(rates, accelerations)
        found = [
            _Stage(self, parts[i], y[:, i], lam[:, i], places[i], forces[:, i], factors[:, i], near)
            for i in range(stages)
        ]
        entries = [stage.entries for stage in found]
        for i, one in enumerate(found):
            entries += [one.coupled(other, c[i, j], b[i, j]) for j, other in enumerate(found)]
        inertia = [b[i, i] for i in range(stages)]
        step = self.solved(entries, inertia, ca.horzcat(*[stage.residual for stage in found]), linear)
        turned, shift, more, size = self.moved(parts, step)
        results = [ca.horzcat(*turned), y + shift, lam + more, size]
        names = ["q", "y", "lam", "x0", "v", "a", "C", "B", "factors", "near"]
        arguments = [q, y, lam, x0, v, a, c, b, factors, near]
        return ca.Function(f"iteration_{stages}", arguments, results, names, ["q_next", "y_next", "lam_next", "size"])

    def solved(self, entries: list[ca.MX], inertia: list[ca.MX], residual: ca.MX, linear: str) -> ca.MX:
        """Newton's step of all stages, (total, stages), for entries in the order of their places.

        ``inertia`` is what accelerations of each stage are multiplied by: beside the masses over it closings are
        slightly soft in the matrix, not in the equations, so that some may depend on each other.
        """
        stages = residual.shape[1]
        system = self._system(stages)
        soft = [-SOFT / part for part in inertia]
        matrix = ca.MX(system.pattern, ca.mtimes(system.sums, ca.vertcat(*entries, *soft)))
        left = ca.vec(residual.T)
        return -ca.reshape(ca.solve(matrix, left[system.order], linear)[system.back], stages, self.total).T

    def moved(self, q: list[ca.MX], step: ca.MX) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX]:
        """Rotations of all stages after a step, changes of displacements and multipliers, and the largest movement."""
        turning, unknowns = self.equations.turning_unknowns, self.equations.unknowns
        there, size = [], ca.MX(0)
        for i, part in enumerate(q):
            spin = self.spins(step[:, i])
            there.append(moved_by(self, part, spin))
            size = ca.fmax(size, ca.norm_inf(ca.vertcat(0.0, ca.vec(spin), step[turning:unknowns, i])))
        return there, step[turning:unknowns, :], step[unknowns:, :], size

    def forces(self, rates: ca.MX, accelerations: ca.MX) -> ca.MX:
        """Inertia and damping forces of all quantities."""
        linear = _times(self.mass, accelerations[: self.linear, :]) + _times(self.drag, rates[: self.linear, :])
        parts = [linear]
        for group, (begin, end) in zip(self.masses.observables, self.ranges, strict=True):
            force = ca.MX.zeros(end - begin, rates.shape[1])
            for weight, rate in ((group.mass, accelerations), (group.damping, rates)):
                if weight.any():
                    force += ca.repmat(ca.DM(weight.ravel()), 1, rates.shape[1]) * rate[begin:end, :]
            parts.append(force)
        return ca.vertcat(*parts) + (0.0 if self.coriolis is None else ca.mtimes(self.coriolis, rates))

    @functools.cached_property
    def crossing(self) -> Array | None:
        """Matrix (axes, axes) of ``2 Omega x`` of turning axes; None where they do not turn."""
        if self.model.spinning is None:
            return None
        x, y, z = 2.0 * self.model.spinning.omega
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])[: self.axes, : self.axes]

    @functools.cached_property
    def coriolis(self) -> ca.DM | None:
        """Coriolis forces on the quantities by their rates."""
        if self.crossing is None:
            return None
        weights, crosses = [self.mass], [ca.kron(ca.DM.eye(self.linear // self.axes), ca.DM(self.crossing))]
        for group in self.masses.observables:
            weights.append(ca.diag(ca.DM(group.mass.ravel())))
            crosses.append(ca.kron(ca.DM.eye(len(group.data)), ca.DM(self.turned_rows(group))))
        return ca.sparsify(ca.mtimes(ca.diagcat(*weights), ca.diagcat(*crosses)))

    def turned_rows(self, group: Observables) -> Array:
        """``2 Omega x`` on the rows of a quantity: on the vectors that they begin with; numbers behind do not turn."""
        assert self.crossing is not None
        found, count = np.zeros((group.kind.sizes[2],) * 2), vectors_of(group)
        found[: self.axes * count, : self.axes * count] = np.kron(np.eye(count), self.crossing)
        return found

    @functools.cached_property
    def place_weights(self) -> tuple[Index, Index, Array]:
        """Row, column and mass of each pair of places, inner nodes hanging on the first place of their element."""
        row, column = (np.array(part, dtype=np.intp) for part in self.place_mass.sparsity().get_triplet())
        first = row % self.axes == 0
        return row[first] // self.axes, column[first] // self.axes, np.array(self.place_mass.nz[:]).ravel()[first]

    def stage(self, q: ca.MX, y: ca.MX, lam: ca.MX, forces: ca.MX, factors: ca.MX, near: ca.MX) -> _Stage:
        """Residual and entries at given inertia and damping forces."""
        return _Stage(self, q, y, lam, self.displacements(y, factors), forces, factors, near)

    def static_matrix(self, stage: _Stage) -> ca.MX:
        """Derivative of a stage's residual by its unknowns at given inertia and damping forces, (total, total)."""
        return self._summed(self._static, stage.entries)

    def coupling_matrix(self, stage: _Stage, c: float, b: float) -> ca.MX:
        """Its derivative by rates (c) and accelerations (b) of the unknowns, (total, total)."""
        return self._summed(self._probe.coupled.places, stage.coupled(stage, ca.MX(c), ca.MX(b)))

    def _summed(self, places: tuple[Index, Index, Array, Index], entries: ca.MX) -> ca.MX:
        row, column, weight, entry = places
        cells, inverse = np.unique(column * self.total + row, return_inverse=True)
        sums = _sparse(inverse.ravel(), entry, weight, (len(cells), entries.shape[0]))
        return ca.MX(pattern(self.total, cells % self.total, cells // self.total), ca.mtimes(sums, entries))

    @functools.cached_property
    def _probe(self) -> _Places:
        return _Places(self)

    @functools.cached_property
    def _static(self) -> tuple[Index, Index, Array, Index]:
        """Places of the entries of a stage with those of the ties between displacements and rows."""
        probe, w = self._probe, self.model.positions.W
        row, column, value, entry = probe.static.places
        ties = len(w.value)
        r, c = self.equations.unknowns + w.row, self.equations.turning_unknowns + w.column
        return (
            np.concatenate([row, r, c]),
            np.concatenate([column, c, r]),
            np.concatenate([value, np.tile(w.value, 2)]),
            # The entries of the ties between displacements and rows are one number, 1, after those of the stage.
            np.concatenate([entry, np.full(2 * ties, probe.static.count)]),
        )

    def _system(self, stages: int) -> _System:
        """Pattern of the matrix of all stages, unknown by unknown, each with its stages."""
        probe, static = self._probe, self._static
        one, coupled = probe.static.count, probe.coupled.places
        rows, columns = (np.concatenate([static[k], coupled[k], np.arange(self.total)]) for k in (0, 1))
        both = np.unique(np.concatenate([columns * self.total + rows, rows * self.total + columns]))
        amd = pattern(self.total, both % self.total, both // self.total).amd()
        place = np.argsort(np.array(amd, dtype=np.intp))
        blocks = [(i, i, static, one + 1) for i in range(stages)]
        blocks += [(i, j, coupled, probe.coupled.count) for i in range(stages) for j in range(stages)]
        rows = np.arange(self.equations.unknowns, self.total)
        blocks += [(i, i, (rows, rows, np.ones(len(rows)), np.zeros(len(rows), np.intp)), 1) for i in range(stages)]
        size, first, flat, weights, entries = self.total * stages, 0, [], [], []
        for i, j, (r, c, weight, number), count in blocks:
            flat.append((place[c] * stages + j) * size + place[r] * stages + i)
            weights.append(weight)
            entries.append(first + number)
            first += count
        places, inverse = np.unique(np.concatenate(flat), return_inverse=True)
        sums = _sparse(inverse.ravel(), np.concatenate(entries), np.concatenate(weights), (len(places), first))
        # Unknown a of stage i stands at place[a] * stages + i of the system, at a * stages + i of the residual.
        back = (place[:, None] * stages + np.arange(stages)).ravel()
        found = pattern(size, places % size, places // size)
        return _System(found, sums, np.argsort(back).tolist(), back.tolist())


SOFT = 1e-10
"""Softness of closings in the matrix over the inverse of what resists them, the whole mass being one."""


@dataclass(frozen=True)
class _System:
    """Pattern of a matrix, how entries are summed up in it, and the order of its unknowns."""

    pattern: ca.Sparsity
    sums: ca.DM
    order: list[int]
    back: list[int]


@dataclass(frozen=True)
class _Closed:
    """Entries of closing rows by rotations: where they go in full coordinates, and which of the spins each is."""

    row: Index
    cell: Index
    entry: Index
    value: Array


class _Places:
    """Where the entries of a stage and of a pair of stages go, in the order in which :class:`_Stage` gives them."""

    def __init__(self, system: StageEquations) -> None:
        self.static = _Entries(system.unknown, system.weight)
        self.coupled = _Entries(system.unknown, system.weight)
        static, coupled, cells = self.static, self.coupled, system.cells
        static.add(cells[:, None, :], cells[:, :, None])
        static.add(system.closed.row, system.closed.cell)
        static.add(system.closed.cell, system.closed.row)
        for group, sides, labels in zip(system.model.connections, system.linked, system.link_rows, strict=True):
            static.add(sides[:, None, :], sides[:, :, None])
            if group.rows:
                static.add(labels[:, None, :], sides[:, :, None])
                static.add(sides[:, :, None], labels[:, None, :])
        for sides in system.observed:
            static.add(sides[:, None, :], sides[:, :, None])
            coupled.add(sides[:, None, :], sides[:, :, None])
        for rows, columns in system.follower_cells():
            static.add(rows, columns)
        inside = system.massive
        own, at = cells[inside], system.place_cells(system.start[inside])
        coupled.add(own[:, None, :], own[:, :, None])
        coupled.add(own[:, :, None], at[:, None, :])
        coupled.add(at[:, None, :], own[:, :, None])
        for matrix in (system.place_mass, system.place_drag):
            row, column = (np.array(part, dtype=np.intp) for part in matrix.sparsity().get_triplet())
            coupled.add(system.of_places + row, system.of_places + column)
        if system.crossing is None:
            return
        for sides in system.observed:
            coupled.add(sides[:, None, :], sides[:, :, None])
        if len(inside):
            coupled.add(own[:, None, :], own[:, :, None])
            coupled.add(own[:, :, None], at[:, None, :])
            coupled.add(at[:, None, :], own[:, :, None])
        row, column, _ = system.place_weights
        coupled.add(system.place_cells(row)[:, :, None], system.place_cells(column)[:, None, :])


class _Stage:
    """Residual and entries of one stage at given inertia and damping forces."""

    def __init__(
        self,
        system: StageEquations,
        q: ca.MX,
        y: ca.MX,
        lam: ca.MX,
        places: ca.MX,
        forces: ca.MX,
        factors: ca.MX,
        near: ca.MX,
    ) -> None:
        self._system, model = system, system.model
        closings = len(model.positions.rows)
        full, entries = [], []
        # What acts along the elements: loads, internal forces, inertia.
        linear = forces[: system.linear]
        on_places = _times(system.by_place.T, linear) - _times(system.force, factors)
        gaps = system.open_gaps(y, factors)
        turning = -_times(system.moment, factors)
        if system.elements:
            pull = _times(system.pull, factors) + _times(system.closing.T, lam[:closings, :])
            pull += _times(system.by_tangent.T, linear) + system.carried(q, factors)
            found = system.many(model.element.turning, system.elements)(
                q[:, model.rotations.turns.ravel().tolist()],
                system.given[0],
                system.given[1],
                ca.reshape(pull, system.axes, system.elements * system.points),
            )
            moments, stiffness, spin = found[2], found[3], found[5]
            gaps += _times(system.closing, ca.vec(system.tangents(q)) - ca.DM(system.rest))
            turning += _times(system.onto_rotations, ca.vec(moments))
            closed = ca.vec(spin)[system.closed.entry.tolist()] * ca.DM(system.closed.value)
            entries += [ca.vec(stiffness), closed, closed]
            self._spin = spin[:, system.massive_columns]
        else:
            self._spin = ca.MX(system.axes, 0)
        rows = [gaps]
        for number, (group, sides) in enumerate(zip(model.connections, system.linked, strict=True)):
            n, count = len(group.data), group.kind.sizes[2]
            first = closings + sum(len(g.rows) for g in model.connections[:number])
            own = ca.reshape(lam[first : first + n * count], count, n)
            load = ca.reshape(_times(system.loads[number], factors), group.kind.sizes[4], n)
            found = system.many(by_turning(group.kind), n)(*system.sides(group, q, places, near), load, own)
            full.append((sides, found[3]))
            entries.append(ca.vec(found[4]))
            if count:
                rows.append(ca.vec(found[2]))
                entries += [ca.vec(found[5]), ca.vec(found[5])]
        self._spins = []
        for observed, sides, (begin, end) in zip(
            system.masses.observables, system.observed, system.ranges, strict=True
        ):
            n, count = len(observed.data), observed.kind.sizes[2]
            own = ca.reshape(forces[begin:end], count, n)
            found = system.many(by_turning(observed.kind), n)(
                *system.sides(observed, q, places, near), ca.MX(0, n), own
            )
            full.append((sides, found[3]))
            entries.append(ca.vec(found[4]))
            self._spins.append(found[5])
        pushed, turned_by, followed = system.followed(q, factors)
        entries += followed
        turning, on_places = turning + turned_by, on_places + pushed
        self.residual = system.gathered(turning, on_places, full, lam[:closings, :], rows)
        self.entries = ca.vertcat(*entries, ca.MX(1))

    def coupled(self, other: _Stage, c: ca.MX, b: ca.MX) -> ca.MX:
        """Entries of this stage's residual by the quantities of another one."""
        system, entries = self._system, []
        for group, mine, its in zip(system.masses.observables, self._spins, other._spins, strict=True):
            n = len(group.data)
            weight = b * ca.DM(group.mass.T) + c * ca.DM(group.damping.T)
            entries.append(ca.vec(system.paired(group.kind.sizes[2], mine.shape[1] // n, n)(mine, its, weight)))
        if len(system.massive):
            entries += system.hung(self._spin, other._spin, c, b)
        entries += [b * system.place_mass.nz[:], c * system.place_drag.nz[:]]
        if system.crossing is not None:
            entries += self._turning(other, c)
        return ca.vertcat(*entries)

    def _turning(self, other: _Stage, c: ca.MX) -> list[ca.MX]:
        """What Coriolis forces add to these entries."""
        system, entries = self._system, []
        assert system.crossing is not None
        cross = ca.DM(system.crossing)
        for group, mine, its in zip(system.masses.observables, self._spins, other._spins, strict=True):
            n = len(group.data)
            turned_its = ca.mtimes(ca.DM(system.turned_rows(group)), its)
            function = system.paired(group.kind.sizes[2], mine.shape[1] // n, n)
            entries.append(ca.vec(function(mine, turned_its, c * ca.DM(group.mass.T))))
        if len(system.massive):
            of_mass = system.hung(self._spin, ca.mtimes(cross, other._spin), ca.MX(0), c)
            across = system.hung(ca.mtimes(cross.T, self._spin), other._spin, ca.MX(0), c)
            entries += [of_mass[0], across[1], of_mass[2]]
        return [*entries, c * ca.DM(np.outer(system.place_weights[2], cross.full()).ravel())]


# -- functions of single things, made once a process ---------------------------------------------------


def _tag(space: bool) -> str:
    return "space" if space else "plane"


@functools.cache
def _turned(space: bool) -> ca.Function:
    """(q, t) -> R(q) t."""
    q, t = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("t", 3 if space else 2)
    if space:
        now = ca.vertcat(*turned(ca.vertsplit(q), ca.vertsplit(t)))
    else:
        c, s = ca.cos(q), ca.sin(q)
        now = ca.vertcat(c * t[0] - s * t[1], s * t[0] + c * t[1])
    return ca.Function(f"turned_{_tag(space)}", [q, t], [now])


@functools.cache
def _change(space: bool) -> ca.Function:
    """(f) -> minus the derivative of a vector that turns, by its rotation."""
    f = ca.SX.sym("f", 3 if space else 2)
    return ca.Function(f"change_{_tag(space)}", [f], [ca.densify(ca.skew(f) if space else ca.vertcat(f[1], -f[0]))])


@functools.cache
def _spread_change(element: Element) -> ca.Function:
    """(forces, tangents) -> what turning distributed followers adds, on the first place and on the nodes."""
    n, axes, turns = element.order + 1, element.axes, element.turns
    f, t = ca.SX.sym("f", axes, n), ca.SX.sym("t", axes, n)
    whole = ca.SX(axes + turns * n, turns * n)
    for i in range(n):
        change = _change(element.space)(f[:, i])
        columns = slice(turns * i, turns * (i + 1))
        whole[:axes, columns] = change
        for j in range(n):
            arm = t[:, j] / element.weights[j]
            crossed = ca.skew(arm) if element.space else ca.horzcat(-arm[1], arm[0])
            rows = slice(axes + turns * j, axes + turns * (j + 1))
            whole[rows, columns] = element.to_points[i, j] * ca.mtimes(crossed, change)
    return ca.Function(f"spread_change_{_tag(element.space)}_{n}", [f, t], [ca.densify(whole)])


@functools.cache
def _moved(space: bool) -> ca.Function:
    """(q, phi) -> exp(phi / 2) q, of length one again."""
    q, phi = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("phi", 3 if space else 1)
    if space:
        now = ca.vertcat(*product(ca.vertsplit(_exponential(phi)), ca.vertsplit(q)))
        now /= ca.norm_2(now)
    else:
        now = q + phi
    return ca.Function(f"moved_{_tag(space)}", [q, phi], [now])


def _exponential(phi: T) -> T:
    """Unit quaternion of a rotation vector."""
    square = 0.25 * ca.dot(phi, phi)
    half = ca.sqrt(ca.fmax(square, 1e-30))
    # sin(x) / x to all digits also where the vector vanishes.
    ratio = ca.if_else(square < 1e-8, 1.0 - square / 6.0, ca.sin(half) / half)
    # As polynomial, so that second derivatives hold where the vector vanishes.
    cosine = ca.if_else(square < 1e-8, 1.0 - 0.5 * square, ca.cos(half))
    return ca.vertcat(cosine, 0.5 * ratio * phi)


def moved_by(system: StageEquations, q: ca.MX, phi: ca.MX) -> ca.MX:
    """Rotations (components, rotations) after rotation vectors (turns, rotations)."""
    return system.many(_moved(system.model.space), system.layout.rotations)(q, phi)


@functools.cache
def _vectors(space: bool) -> ca.Function:
    """(q, p) -> rotation vector from q to p, shorter than a turn."""
    q, p = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("p", 4 if space else 1)
    if not space:
        return ca.Function(f"vectors_{_tag(space)}", [q, p], [p - q])
    a = ca.vertsplit(q)
    r = ca.vertcat(*product(ca.vertsplit(p), [a[0], -a[1], -a[2], -a[3]]))
    r = ca.if_else(r[0] < 0.0, -1.0, 1.0) * r
    sine = ca.sqrt(ca.fmax(ca.dot(r[1:], r[1:]), 1e-30))
    # The angle over its half sine, to all digits also where it vanishes.
    share = ca.if_else(sine < 1e-6, 2.0, 2.0 * ca.atan2(sine, r[0]) / sine)
    return ca.Function(f"vectors_{_tag(space)}", [q, p], [share * r[1:]])


@functools.cache
def _values(kind: Connection) -> ca.Function:
    """(q, u, data, load) -> the rows of a kind."""
    turns, places, _, data, loads = kind.sizes
    q, u = ca.SX.sym("q", kind.components, turns), ca.SX.sym("u", kind.axes, places)
    given, load = ca.SX.sym("data", data), ca.SX.sym("load", loads)
    sides = [ca.vertsplit(q[:, i]) for i in range(turns)], [ca.vertsplit(u[:, i]) for i in range(places)]
    rows = ca.densify(ca.vertcat(*kind.residual(*sides, given, load)))
    return ca.Function(f"values_{name_of(kind)}", [q, u, given, load], [rows])


@functools.cache
def _pairs(rows: int, width: int) -> ca.Function:
    """(A, B, w) -> A^T diag(w) B."""
    a, b, w = ca.SX.sym("a", rows, width), ca.SX.sym("b", rows, width), ca.SX.sym("w", rows)
    return ca.Function(f"pairs_{rows}_{width}", [a, b, w], [ca.densify(ca.mtimes(a.T, ca.repmat(w, 1, width) * b))])


@functools.cache
def _inner(axes: int, turns: int, points: int) -> ca.Function:
    """(A, B, W) -> blocks W_jl A_j^T B_l, of arrays with a block of ``turns`` columns for each point."""
    a, b = ca.SX.sym("a", axes, turns * points), ca.SX.sym("b", axes, turns * points)
    w = ca.SX.sym("w", points, points)
    whole = ca.mtimes(a.T, b) * ca.kron(w, ca.SX.ones(turns, turns))
    return ca.Function(f"inner_{axes}_{turns}_{points}", [a, b, w], [ca.densify(whole)])
