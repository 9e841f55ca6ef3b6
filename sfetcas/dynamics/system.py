"""A model in motion as CasADi expressions: its quantities, loads, closings, and the forces of inertia and damping.

Numbers of unknowns are those of :class:`~sfetcas.mechanics.equations.Equations`; *full* coordinates are the turns of
all rotations, the displacements of all places, and the multipliers, held or not.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..description.loads import History
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import by_axes, constant, hanging, sparse, times
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import SparseMap
from ..mechanics.connections import Group
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from ..mechanics.masses import Masses, Observables
from ..mechanics.rotations import Turn
from ..mechanics.spinning import vectors_of
from .entries import Closed
from .singles import (
    arms_product,
    exponential,
    moved_rotation,
    rotation_between,
    rows_of,
    spread_change,
    turned_change,
    turned_vector,
    weighted_product,
)

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Layout", "System", "moved_by"]


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


class System:
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
        self.gather = sparse(unknown[used], used, weight[used], (self.total, self.full))
        self._turning = self.gather.T[: self.of_places, :]
        turns = np.arange(self.turns)
        cells = self.turns * model.rotations.turns[:, :, None] + turns
        self.cells = cells.reshape(self.elements, self.turns * self.points)
        moments = np.arange(self.cells.size)
        ones = np.ones(self.cells.size)
        self.onto_rotations = sparse(self.cells.ravel(), moments, ones, (self.of_places, self.cells.size))
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
        given = ca.reshape(times(self.tangential, factors), self.axes, self.elements * self.points)[:, columns]
        turns = self.model.rotations.turns[elements].ravel().tolist()
        return self.many(turned_vector(self.model.space), len(columns))(q[:, turns], given)

    def carried(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """Pull of distributed followers on the points of all elements."""
        elements = self.model.followers.elements
        if not len(elements):
            return ca.MX.zeros(self.elements * self.points * self.axes)
        forces = ca.vec(self._tangential(q, factors))
        return times(self._pulled(elements), forces)

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
        return self.model.space and bool(self.moment.nnz() or self.twist.nnz())

    def followed(self, q: ca.MX, factors: ca.MX) -> tuple[ca.MX, ca.MX, list[ca.MX]]:
        """Forces on places and moments on rotations of what follows, both as residuals, and entries of the matrix."""
        followers, space = self.model.followers, self.model.space
        on_places, entries = ca.MX.zeros(self.axes * self.places), []
        on_turns = ca.MX.zeros(self.of_places)
        if len(followers.places):
            n = len(followers.places)
            given = ca.reshape(times(self.following, factors), self.axes, n)
            forces = self.many(turned_vector(space), n)(q[:, followers.turns.tolist()], given)
            at = (self.axes * followers.places[:, None] + np.arange(self.axes)).ravel()
            on_places -= times(
                sparse(at, np.arange(len(at)), np.ones(len(at)), (self.axes * self.places, len(at))), ca.vec(forces)
            )
            entries.append(ca.vec(self.many(turned_change(space), n)(forces)))
        if len(followers.elements):
            n = len(followers.elements)
            forces = self._tangential(q, factors)
            starts = np.repeat(self.start[followers.elements], self.points)
            at = (self.axes * starts[:, None] + np.arange(self.axes)).ravel()
            on_places -= times(
                sparse(at, np.arange(len(at)), np.ones(len(at)), (self.axes * self.places, len(at))), ca.vec(forces)
            )
            columns = (followers.elements[:, None] * self.points + np.arange(self.points)).ravel().tolist()
            tangents = self.tangents(q)[:, columns]
            entries.append(ca.vec(self.many(spread_change(self.model.element), n)(forces, tangents)))
        if self.twisting:
            n = self.layout.rotations
            twist = self.many(turned_vector(True), n)(q, ca.reshape(times(self.twist, factors), 3, n))
            moment = ca.reshape(times(self.moment, factors), 3, n)
            on_turns -= ca.vec(twist)
            # The symmetric form of all moments counts these with minus and plus half of what they turn by.
            entries.append(0.5 * ca.vec(self.many(turned_change(True), n)(twist - moment)))
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
        return sparse(unknown[used], used, self.weight[flat[used]], (self.total, len(flat)))

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
        reach = by_axes(reach, axes)
        self.linear = axes * (places + count)
        self.by_tangent = sparse(
            reach.row + axes * places, reach.column, reach.value, (self.linear, self.elements * n * axes)
        )
        own = np.arange(axes * places)
        below = axes * places + np.arange(axes * count)
        at = (axes * self.start[inner[:, 0]][:, None] + np.arange(axes)).ravel()
        row, column = np.concatenate([own, below]), np.concatenate([own, at])
        self.by_place = sparse(row, column, np.ones(len(row)), (self.linear, axes * places))
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
        self.closing = sparse(np.repeat(rows, n), points, np.repeat(values, n), shape)
        width = self.turns * n
        # Spins of elements stand by columns (turns), then elements.
        entry = ((elements[:, None] * width + np.arange(width)) * axes + component[:, None]).ravel()
        self.closed = Closed(
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
            each = by_axes(of_places, axes)
            row, column = np.concatenate([each.row, own]), np.concatenate([each.column, own])
            value = np.concatenate([each.value, np.repeat(inner[inside], axes)])
            found.append(sparse(row, column, value, (self.linear, self.linear)))
            # Inner nodes hang on the first place of their element.
            first = hanging(self.by_place, found[-1])
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
        return self.many(turned_vector(self.model.space), self.elements * self.points)(at_points, given)

    def displacements(self, y: ca.MX, factors: ca.MX) -> ca.MX:
        """Displacements of all places."""
        positions = self.model.positions
        return times(constant(positions.Y), y) + times(constant(positions.B), times(self.shift, factors))

    def held(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """Rotations with those that motions prescribe at their values."""
        turn = ca.reshape(times(self.turn, factors), 3, self.layout.rotations)
        for i in np.flatnonzero(np.any([group.turn.any(axis=1) for group in self.model.groups.values()], axis=0)):
            if self.model.rotations.kind[i] == Turn.HELD:
                q[:, int(i)] = exponential(turn[:, int(i)]) if self.model.space else turn[2, int(i)]
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
        return ca.reshape(times(self._turning[:, : step.shape[0]], step), self.turns, self.layout.rotations)

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
    def interpreted(self) -> Self:
        """The same of which nothing is compiled: compiled functions have no derivatives."""
        return self if self._kernels == "interpreted" else type(self)(self.equations, self.masses, "interpreted")

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

    def open_gaps(self, y: ca.MX, factors: ca.MX) -> ca.MX:
        """The share of displacements in the closings."""
        positions = self.model.positions
        return times(constant(positions.W), y) + times(constant(positions.BZ), times(self.shift, factors))

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

    def paired(self, rows: int, width: int, n: int) -> ca.Function:
        """(A, B, w) -> A^T diag(w) B of n groups of rows."""
        return self.many(weighted_product(rows, width), n)

    def hung(self, mine: ca.MX, its: ca.MX, c: ca.MX, b: ca.MX) -> list[ca.MX]:
        """Entries of masses and drags within elements: on their rotations, and with their first places."""
        shares = b * ca.DM(self.inner[0]) + c * ca.DM(self.inner[1])
        first = b * ca.DM(self.firsts[0]) + c * ca.DM(self.firsts[1])
        blocks = self.many(arms_product(self.axes, self.turns, self.points), len(self.massive))
        return [ca.vec(blocks(mine, its, shares)), ca.vec(mine) * first, ca.vec(its) * first]

    def gaps(self, q: ca.MX, y: ca.MX, factors: ca.MX, near: ca.MX) -> ca.MX:
        """What is left open of the closings and of the rows of joints."""
        places, gaps = self.displacements(y, factors), self.open_gaps(y, factors)
        if self.elements:
            gaps += times(self.closing, ca.vec(self.tangents(q)) - ca.DM(self.rest))
        parts = [gaps]
        for number, group in enumerate(self.model.connections):
            if group.rows:
                n = len(group.data)
                load = ca.reshape(times(self.loads[number], factors), group.kind.sizes[4], n)
                parts.append(ca.vec(self.many(rows_of(group.kind), n)(*self.sides(group, q, places, near), load)))
        return ca.vertcat(*parts)

    def turned(self, q: ca.MX, there: ca.MX) -> ca.MX:
        """Rotation vectors (turns, rotations) from rotations to others."""
        return self.many(rotation_between(self.model.space), self.layout.rotations)(q, there)

    def quantities(self, q: ca.MX, places: ca.MX, near: ca.MX) -> ca.MX:
        """All quantities X."""
        parts = [times(self.by_place, places)]
        if self.elements:
            parts[0] += times(self.by_tangent, ca.vec(self.tangents(q)) - ca.DM(self.rest))
        for group in self.masses.observables:
            n = len(group.data)
            parts.append(ca.vec(self.many(rows_of(group.kind), n)(*self.sides(group, q, places, near), ca.MX(0, n))))
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

    def forces(self, rates: ca.MX, accelerations: ca.MX) -> ca.MX:
        """Inertia and damping forces of all quantities."""
        linear = times(self.mass, accelerations[: self.linear, :]) + times(self.drag, rates[: self.linear, :])
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


def moved_by(system: System, q: ca.MX, phi: ca.MX) -> ca.MX:
    """Rotations (components, rotations) after rotation vectors (turns, rotations)."""
    return system.many(moved_rotation(system.model.space), system.layout.rotations)(q, phi)
