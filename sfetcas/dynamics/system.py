"""A model in motion as CasADi expressions: the quantities X that carry mass or are damped, and their forces.

The quantities are those of :mod:`~sfetcas.mechanics.observed`: first positions, of the places (points whose
displacements the model knows) and of inner nodes of elements, then groups of observables such as section axes and
strains.  Everything is dimensionless.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..description.loads import History
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import by_axes, hanging, mapped, sparse, times
from ..mathematics.kernels import Kernels
from ..mathematics.linear import SparseMap
from ..mathematics.quaternion import cross_matrix
from ..mechanics import expressions
from ..mechanics.batches import GroupBatch
from ..mechanics.equations import Equations, State, turned_tangents
from ..mechanics.expressions import Expressions, Given, moved_by
from ..mechanics.inputs import Inputs
from ..mechanics.loading import Loading
from ..mechanics.masses import Masses, Observables
from ..mechanics.memory import Remembering
from ..mechanics.model import Model
from ..mechanics.rubbing import rubbing_of
from ..mechanics.singles import arms_product, weighted_product
from ..mechanics.terms import rows_of
from ..mechanics.unilateral import NONE, UnilateralRows

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Layout", "System"]


@dataclass(frozen=True)
class Layout(expressions.Layout):
    """Sizes of a model in motion: ``x`` is the number of quantities, the others are those of the model."""

    x: int


class System(Expressions):
    """Expressions of a model in motion that all integration methods use; Functions are built on demand.

    Parameters
    ----------
    equations : Equations
        They number the unknowns.
    masses : Masses
    kernels : str
        ``compiled``, ``interpreted`` or ``auto`` element functions.
    calls : float
        Expected number of calls, by which ``auto`` decides.
    unilateral : UnilateralRows
        Rows that are switched on and off in time; the model contains all of them.
    """

    layout: Layout

    def __init__(
        self,
        equations: Equations,
        masses: Masses,
        kernels: Kernels = "auto",
        calls: float = 1e4,
        unilateral: UnilateralRows = NONE,
    ) -> None:
        super().__init__(equations, kernels, calls)
        if len(self.model.positions.E.value):
            raise ValueError("motion needs the nodal assembly on a mesh with a place at every cut")
        self.masses, self.memory = masses, Remembering(self.model)
        self._memory = {number: (group, part) for number, group, part in self.memory.parts()}
        self.unilateral, self.rubbing = unilateral, rubbing_of(self.model, unilateral)
        self.observed = [self.tables.sides_of(group) for group in masses.observables]
        self._place()
        self._weigh()

    # -- linear maps --------------------------------------------------------------------------------

    def _place(self) -> None:
        """Positions that carry mass: of the places, then of the inner nodes of the elements."""
        model, axes, n = self.model, self.axes, self.points
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
        # What moves the points of an element: rotations, then strains.
        self._moving = (self.turns, axes) if self.model.element.strains else (self.turns,)
        width = sum(self._moving) * self.points
        self.massive_columns = (self.massive[:, None] * width + np.arange(width)).ravel().tolist()
        self.points_of_columns = np.concatenate([np.repeat(np.arange(self.points), width) for width in self._moving])
        arms = self._up_to
        self.inner_shares = [
            np.einsum("ek,kj,kl->elj", part[self.massive], arms, arms) for part in (masses.inner, masses.inner_drag)
        ]
        self.inner = [share.reshape(-1, self.points).T for share in self.inner_shares]
        self.first_shares = [part[self.massive] @ arms for part in (masses.inner, masses.inner_drag)]
        # One for each component of what moves: by axes, components of a point, points, elements.
        self.firsts = [np.repeat(first[:, self.points_of_columns], axes, axis=1).ravel() for first in self.first_shares]
        sizes = [group.kind.sizes[2] * len(group.data) for group in masses.observables]
        bounds = np.cumsum([self.linear, *sizes]).tolist()
        self.ranges = list(zip(bounds, bounds[1:], strict=False))
        # What members remember, what sticks and slides, and which unilateral constraints act and where, is given with
        # the angles that count turns, and changes as seldom.
        given = self.layout.unwrapped + self.memory.size + 2 * len(self.unilateral)
        given += 0 if self.rubbing is None else self.rubbing.size
        self.layout = Layout(**{**vars(self.layout), "unwrapped": given}, x=bounds[-1])

    def data(self, number: int, given: Given, unwrapped: ca.MX) -> ca.MX:
        """As of :meth:`.SymbolicTerms.data`, with what members remember from behind the angles in ``unwrapped``."""
        data, angles = super().data(number, given, unwrapped), self.model.unwrapping.count
        if self.rubbing is not None and number in self.rubbing.groups:
            told = self.rubbing.parts(self.rubs(unwrapped))[3][:, self.rubbing.groups[number].tolist()]
            return ca.vertcat(told, data[self.rubbing.told :, :])
        if number - 1 not in self._memory:
            return data
        group, part = self._memory[number - 1]
        columns = group.kind.memory_columns.tolist()
        own = unwrapped[angles + part.start : angles + part.stop]
        data[columns, :] = ca.reshape(own, len(columns), len(group.data))
        return data

    def counted(self, state: State, acting: Array | None = None) -> Array:
        """The angles that count turns in a state, what members remember at the begin, which unilateral constraints act.

        By default all do, and hold at zero.  What rubs does not slide.
        """
        count, rubbing = len(self.unilateral), self.rubbing
        acting = np.ones(count) if acting is None else acting
        rubs = np.zeros(0) if rubbing is None else rubbing.idle(rubbing.displacements(state.y)).flat
        return np.concatenate([state.unwrapped, self.memory.begun[: self.memory.size], rubs, acting, np.zeros(count)])

    def rubs(self, unwrapped: ca.MX) -> ca.MX:
        """What the places that rub do, as :attr:`.Rubs.flat`."""
        assert self.rubbing is not None
        end = self.layout.unwrapped - 2 * len(self.unilateral)
        return unwrapped[end - self.rubbing.size : end]

    @functools.cached_property
    def switching(self) -> Index:
        """Numbers of the rows that act at times: unilateral ones, then those that hold what sticks."""
        rows = self.unilateral.rows
        return rows if self.rubbing is None else np.concatenate([rows, self.rubbing.rows.ravel()])

    def switches(self, unwrapped: ca.MX) -> ca.MX:
        """For each row of :attr:`switching` whether it acts, 1 or 0."""
        acting = self.acting(unwrapped)
        if self.rubbing is None:
            return acting
        return ca.vertcat(acting, self.rubbing.parts(self.rubs(unwrapped))[1])

    def switched(self, rows: ca.MX, unwrapped: ca.MX) -> ca.MX:
        """Multipliers of the rows (rows,), zero where a unilateral constraint does not act."""
        count = len(self.unilateral)
        if not count:
            return rows
        acting = ca.MX.ones(self.layout.lam)
        acting[self.switching.tolist()] = self.switches(unwrapped)
        return rows * acting

    def missed(self, rows: ca.MX, unwrapped: ca.MX) -> ca.MX:
        """Values of the rows (rows,) over those that they are to have; zero where a unilateral constraint does not act.

        One that acts holds at the value that it had when it began to.
        """
        if not len(self.unilateral):
            return rows
        held = ca.MX.zeros(self.layout.lam)
        held[self.unilateral.rows.tolist()] = unwrapped[self.layout.unwrapped - len(self.unilateral) :]
        return self.switched(rows - held, unwrapped)

    def acting(self, unwrapped: ca.MX) -> ca.MX:
        """For each unilateral constraint whether it acts, 1 or 0."""
        end, count = self.layout.unwrapped, len(self.unilateral)
        return unwrapped[end - 2 * count : end - count]

    def _along(self, *, timed: bool) -> ca.Function:
        """(q, y, factors, unwrapped, step, faster) -> quantities and their derivative along a step of the unknowns.

        Where it is ``timed`` rates of the factors, ``faster``, have a share in the derivative, and gaps of all rows and
        their derivative follow.
        """
        n = self.layout
        q, y = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y)
        factors, unwrapped, step = (
            ca.MX.sym("factors", n.factors),
            ca.MX.sym("unwrapped", n.unwrapped),
            ca.MX.sym("step", self.total),
        )
        along, faster = ca.MX.sym("along"), ca.MX.sym("faster", n.factors)
        spin = self.spins(along * step)
        shift = along * step[self.equations.rotation_unknowns : self.equations.unknowns]
        given, turned = self.given(factors + along * faster if timed else factors), moved_by(self, q, spin)
        turned = self.with_prescribed_rotations(turned, given) if timed else turned
        seen = [self.moving(turned, y + shift, given, unwrapped)]
        if timed:
            seen.append(self.gaps(turned, y + shift, given, unwrapped))
        both = [part for x in seen for part in (x, ca.jtimes(x, along, ca.MX(1)))]
        arguments = [q, y, factors, unwrapped, step, faster]
        return ca.Function("rates", arguments, ca.substitute(both, [along], [ca.MX(0)]))

    @functools.cached_property
    def along_step(self) -> ca.Function:
        """(q, y, factors, unwrapped, step, faster) -> quantities and their derivative along a step of the unknowns, at
        factors that do not change, whatever their rates ``faster``.
        """
        return self._along(timed=False)

    @functools.cached_property
    def along_step_in_time(self) -> ca.Function:
        """The same at factors that change with rates ``faster``; gaps of all rows and their derivative follow."""
        return self._along(timed=True)

    def rates(self, state: State, factors: Array, step: Array) -> tuple[Array, Array]:
        """Quantities (quantities,) at a state, and their rates for the rates ``step`` (unknowns,) of the unknowns."""
        if not step.any():
            return self.seen(state, factors), np.zeros(self.layout.x)
        x, v = self._rated(self.interpreted.along_step, state, factors, step, np.zeros(self.layout.factors))
        return x, v

    def seen(self, state: State, factors: Array) -> Array:
        """Quantities (quantities,) at a state, as of :meth:`moving`, in numbers."""
        equations, loading = self.equations, self.loading(factors)
        places = equations.places(state, loading)
        parts = [mapped(self.by_place) @ places]
        if self.elements:
            gained = turned_tangents(self.model, state) - self.model.beams.tangent
            parts[0] = parts[0] + mapped(self.by_tangent) @ gained.ravel()
        for group in self.masses.observables:
            batch = GroupBatch(self.model, group, rows_of(group.kind), self.angles_of(group))
            parts.append(batch(state.q, places.reshape(-1, self.axes), state.unwrapped)[0].ravel())
        return np.concatenate(parts)

    def rates_in_time(
        self, state: State, factors: Array, step: Array, faster: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Quantities (quantities,) at a state with their rates, and gaps of all rows (rows,) with theirs.

        ``step`` (unknowns,) are rates of the unknowns, ``faster`` those of the factors.
        """
        x, v, gaps, opening = self._rated(self.interpreted.along_step_in_time, state, factors, step, faster)
        return x, v, gaps, opening

    def _rated(self, function: ca.Function, state: State, factors: Array, step: Array, faster: Array) -> list[Array]:
        full = np.concatenate([step, np.zeros(self.equations.rows)])
        found = function(state.q.T, state.y, factors, self.counted(state), full, faster)
        return [np.array(part).ravel() for part in found]

    @functools.cached_property
    def floating(self) -> tuple[Array, Array] | None:
        """Changes of displacement unknowns (y, axes) and quantities (x, axes) in a unit translation along each axis.

        None where the ground restrains anything, or where the position matters, as in rotating axes and at obstacles.
        """
        positions, axes = self.model.positions, self.axes
        grounded = (
            any((group.places < 0).any() for group in self.model.connections) or self.model.rotating_frame is not None
        )
        grounded = grounded or bool(self.model.mesh.spots)
        # Strains, angles of tubes and tensions are displacements by their numbers alone.
        moving = ~np.isin(positions.Y.row // axes, self.model.segments.without_position)
        free = self.places - len(self.model.segments.without_position)
        if grounded or moving.sum() != axes * free:
            return None
        y = np.zeros((self.layout.y, axes))
        y[positions.Y.column[moving], positions.Y.row[moving] % axes] = positions.Y.value[moving]
        if any(np.abs(positions.W @ column).max(initial=0.0) > 0.0 for column in y.T):
            return None
        q, flat = ca.DM.ones(self.layout.components, self.layout.rotations), np.zeros(self.layout.unwrapped)
        if self.model.space:
            q[1:, :] = 0
        arguments = [ca.MX.sym("y", self.layout.y)]
        x = self.moving(ca.MX(q), arguments[0], self.given(ca.MX.zeros(self.layout.factors)), ca.MX(flat))
        values = ca.Function("moved", arguments, [x])
        rest = np.array(values(np.zeros(self.layout.y))).ravel()
        return y, np.stack([np.array(values(column)).ravel() - rest for column in y.T], axis=1)

    @functools.cached_property
    def interpreted(self) -> Self:
        """This system with interpreted kernels: compiled functions cannot be differentiated by CasADi."""
        if self.kernels == "interpreted":
            return self
        return type(self)(self.equations, self.masses, "interpreted", unilateral=self.unilateral)

    @functools.cached_property
    def histories(self) -> tuple[History | None, ...]:
        """For each group of loads its history; None for a group whose factor is constantly 1."""
        known = self.model.scene.histories
        own = [None if name is None else known[name] for name in self.model.groups]
        return (*own, *([None] * (len(self.loadings) - len(own))))

    def factors(self, t: float) -> Array:
        """Factors (groups,) of the groups of loads at a dimensionless time."""
        seconds = t * self.masses.time
        return np.array([1.0 if history is None else history.factor(seconds) for history in self.histories])

    def loading(self, factors: Array) -> Loading:
        """Loads and prescribed motions for factors (groups,) of their groups, dimensionless."""
        groups = [loading.scaled(float(f)) for loading, f in zip(self.loadings, factors, strict=True)]
        return functools.reduce(Loading.plus, groups)

    @functools.cached_property
    def inputs(self) -> Inputs:
        """What is given at a stage of a step, as a row of numbers."""
        return Inputs(self.equations)

    @functools.cached_property
    def _rows(self) -> Array:
        return np.stack([self.inputs.of(loading) for loading in self.loadings])

    def rows(self, factors: Array) -> Array:
        """Rows of :attr:`inputs` (stages, numbers) for factors (stages, groups) of the groups of loads."""
        # In one order of the sums, so that they have the same bits on every machine.
        return np.asarray((factors[:, :, None] * self._rows).sum(axis=1))

    def loading_of(self, model: Model, t: float) -> Loading:
        """As :meth:`loading` at a dimensionless time, of a model of the same scene with another choice of them."""
        histories, seconds = model.scene.histories, t * self.masses.time
        factors = {name: 1.0 if name is None else histories[name].factor(seconds) for name in model.groups}
        groups = [loading.scaled(factors[name]) for name, loading in model.groups.items()]
        return functools.reduce(Loading.plus, [*groups, *model.standing])

    def state_of(self, model: Model, state: State) -> State:
        """A state without multipliers, as one of a model of the same scene with other unilateral constraints."""
        names, own = self.model.unwrapping.names, model.unwrapping.names
        unwrapped = state.unwrapped if own == names else state.unwrapped[[names.index(name) for name in own]]
        return State(state.q, state.y, np.zeros(len(model.row_names)), unwrapped)

    def openings(self, state: State, t: float) -> Array:
        """How far unilateral constraints (rows,) are open at a state and a dimensionless time; violated below zero."""
        return np.array(self._opening(state.q.T, state.y, self.factors(t), self.counted(state))).ravel()

    @functools.cached_property
    def _opening(self) -> ca.Function:
        """(q, y, factors, unwrapped) -> openings of the unilateral constraints."""
        n = self.layout
        q, y = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y)
        factors, unwrapped = ca.MX.sym("factors", n.factors), ca.MX.sym("unwrapped", n.unwrapped)
        given = self.given(factors)
        gaps = self.gaps(self.with_prescribed_rotations(ca.MX(q), given), y, given, unwrapped)
        return ca.Function("openings", [q, y, factors, unwrapped], [self.opened(gaps)])

    def opened(self, rows: ca.MX) -> ca.MX:
        """How far unilateral constraints are open, of values of all rows, or their rates."""
        return -ca.DM(self.unilateral.signs) * rows[self.unilateral.rows.tolist()]

    def paired(self, rows: int, width: int, n: int) -> ca.Function:
        """A function (A, B, w) -> A^T diag(w) B for each of n blocks of ``rows`` rows and ``width`` columns."""
        return self.many(weighted_product(rows, width), n)

    def hung(self, mine: ca.MX, its: ca.MX, c: ca.MX, b: ca.MX) -> list[ca.MX]:
        """Matrix entries of masses (times b) and drags (times c) of inner nodes of elements.

        An inner node hangs on the first place of its element: entries on the rotations, and coupled with that place.
        """
        shares = b * ca.DM(self.inner[0]) + c * ca.DM(self.inner[1])
        first = b * ca.DM(self.firsts[0]) + c * ca.DM(self.firsts[1])
        blocks = self.many(arms_product(self.axes, self._moving, self.points), len(self.massive))
        return [ca.vec(blocks(mine, its, shares)), ca.vec(mine) * first, ca.vec(its) * first]

    def quantities(self, q: ca.MX, places: ca.MX, given: Given, unwrapped: ca.MX) -> ca.MX:
        """All quantities X (quantities,) from rotations and displacements of the places."""
        parts = [times(self.by_place, places)]
        if self.elements:
            parts[0] += times(self.by_tangent, ca.vec(self.tangents(q, places, given)) - ca.vec(given.tangent))
        for group in self.masses.observables:
            n = len(group.data)
            sides = *self.sides(group, q, places), self.seen_data(group, unwrapped)
            parts.append(ca.vec(self.many(rows_of(group.kind), n)(*sides, ca.MX(0, n))))
        return ca.vertcat(*parts)

    def moving(self, q: ca.MX, y: ca.MX, given: Given, unwrapped: ca.MX) -> ca.MX:
        """All quantities X (quantities,) from rotations and displacement unknowns."""
        return self.quantities(q, self.displacements(q, y, given), given, unwrapped)

    def angles_of(self, group: Observables) -> Index | None:
        """Numbers of the turn-counting angles that belong to a group of observables; None where it has none."""
        part = None if group.spring is None else self.model.unwrapping.parts[group.spring]
        return None if part is None or group.numbers is None else part.start + group.numbers

    def seen_data(self, group: Observables, unwrapped: ca.MX) -> ca.MX:
        """Data of a group of observables; of those that count turns the last row is the value near which they do."""
        data, counted = ca.MX(ca.DM(group.data.T)), self.angles_of(group)
        return data if counted is None else ca.vertcat(data[:-1, :], unwrapped[counted.tolist()].T)

    # -- one Newton iteration ---------------------------------------------------------------------------

    def forces(self, rates: ca.MX, accelerations: ca.MX) -> ca.MX:
        """Inertia, damping and Coriolis forces (quantities, columns) for rates and accelerations of that shape."""
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
        """Matrix (axes, axes) of ``2 Omega x``, dimensionless, in rotating axes; None in fixed ones."""
        if self.model.rotating_frame is None:
            return None
        return cross_matrix(2.0 * self.masses.time * self.model.rotating_frame.omega)[: self.axes, : self.axes]

    @functools.cached_property
    def coriolis(self) -> ca.DM | None:
        """Matrix that gives the Coriolis forces from the rates, (quantities, quantities); None in fixed axes."""
        if self.crossing is None:
            return None
        weights, crosses = [self.mass], [ca.kron(ca.DM.eye(self.linear // self.axes), ca.DM(self.crossing))]
        for group in self.masses.observables:
            weights.append(ca.diag(ca.DM(group.mass.ravel())))
            crosses.append(ca.kron(ca.DM.eye(len(group.data)), ca.DM(self.turned_rows(group))))
        return ca.sparsify(ca.mtimes(ca.diagcat(*weights), ca.diagcat(*crosses)))

    def turned_rows(self, group: Observables) -> Array:
        """``2 Omega x`` on the rows of an observable, (rows, rows): on its leading vectors, not on later scalars."""
        assert self.crossing is not None
        found, count = np.zeros((group.kind.sizes[2],) * 2), group.kind.vectors
        found[: self.axes * count, : self.axes * count] = np.kron(np.eye(count), self.crossing)
        return found

    @functools.cached_property
    def place_weights(self) -> tuple[Index, Index, Array]:
        """Row, column and mass (dimensionless) of pairs of places; inner nodes hang on the first of their element."""
        mass = mapped(self.place_mass)
        first = mass.row % self.axes == 0
        return mass.row[first] // self.axes, mass.column[first] // self.axes, mass.value[first]
