"""The equilibrium of a model as a nonlinear program that a user can extend.

Unknowns are the components of the quaternions (angles in the plane) of all rotations that are not fixed, and the
displacements retained as unknowns; rows are the norms of the quaternions, the closings and the joints.  The terms are
those of Newton's method, differentiated by components: each function once for its kind, mapped over all terms of the
kind and scattered by constant matrices, so the effort of building does not grow with their number.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from .. import tolerances
from ..mathematics import interpolation, quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import added, picked, sparse, times
from ..mathematics.kernels import Kernels
from ..mathematics.nlp import NLP
from ..mathematics.quaternion import product
from ..mechanics.beams import ELEMENT_DATA
from ..mechanics.equations import State
from ..mechanics.expressions import Given, SymbolicTerms
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rings import reach_of_rings
from ..mechanics.rotations import RotationFreedom
from ..mechanics.stationarity import summed
from ..mechanics.tables import Tables
from ..mechanics.terms import curvatures_of, slopes_of

__all__ = ["EquilibriumProblem"]

CALLS = 12.0
"""Expected number of evaluations until IPOPT has found an equilibrium, by which ``auto`` compiles functions or not."""


class EquilibriumProblem:
    """The nonlinear program of a model, with expressions for further terms.

    Parameters
    ----------
    model : Model
    loading : Loading
        Gives the parameters their values.
    guess : State
        Start of the iteration.
    kernels : str
        ``auto``, ``compiled`` or ``interpreted`` functions of terms.

    Attributes
    ----------
    row_names : tuple of str
        Names of all rows: norms, then closings and joints.
    """

    def __init__(self, model: Model, loading: Loading, guess: State, *, kernels: Kernels = "auto") -> None:
        self.model = model
        self._loading, self._guess, self._guessed_unwrapped = loading, guess, guess.unwrapped
        self._tables, self._kernels = Tables(model, components=True), kernels
        norms = [f"norm of rotation {i}" for i in self._unit]
        self.row_names = (*norms, *model.row_names)

    # What only a program to be built takes is made when it is asked for.

    @functools.cached_property
    def nlp(self) -> NLP:
        """The program of the loading; its objective is the potential energy over ``model.scales.moment``."""
        gaps = self.terms.gaps_of(self._arguments, self._y, self._given)
        lower, upper = self.limits
        return NLP(
            x=self.x,
            p=self.p,
            f=self._objective(),
            g=ca.vertcat(self._norms(), gaps),
            lower=np.zeros(len(self.row_names)),
            upper=np.zeros(len(self.row_names)),
            x_lower=lower,
            x_upper=upper,
            guess=self.unknowns(self._guess),
            p_value=self.parameters(self._loading),
            rows=self.row_names,
            gradient=self._gradient(),
            jacobian=self._jacobian(),
            hessian=self._hessian,
        )

    @functools.cached_property
    def terms(self) -> SymbolicTerms:
        """The terms of the model as expressions."""
        return SymbolicTerms(self._tables, self._kernels, CALLS)

    @property
    def limits(self) -> tuple[Array, Array]:
        """Least and largest values of the unknowns: beyond the end of its member a ring would fall for ever."""
        low, high = (np.full(self._tables.unknowns, side) for side in (-np.inf, np.inf))
        first = self._tables.rotation_unknowns
        for number, least, most in reach_of_rings(self.model):
            low[first + number], high[first + number] = least, most
        return low, high

    def slid_off(self, x: Array) -> str:
        """A sentence on a ring that unknowns keep at an end of its member; empty where none is."""
        first = self._tables.rotation_unknowns
        for name, (number, low, high) in zip(self.model.scene.rings, reach_of_rings(self.model), strict=True):
            if min(x[first + number] - low, high - x[first + number]) < tolerances.REACHED * (high - low):
                return f"the loads draw ring {name!r} to an end of {self.model.scene.rings[name].member!r}"
        return ""

    # -- symbols --------------------------------------------------------------------------------

    @functools.cached_property
    def x(self) -> ca.MX:
        """The unknowns (unknowns,), dimensionless."""
        return ca.MX.sym("x", self._tables.unknowns)

    @functools.cached_property
    def p(self) -> ca.MX:
        """The parameters (parameters,), dimensionless: loads, motions, values near which angles count, and data."""
        return ca.MX.sym("p", sum(self._sizes))

    @functools.cached_property
    def _y(self) -> ca.MX:
        return ca.vertsplit(self.x, [0, self._tables.rotation_unknowns, self._tables.unknowns])[1]

    @functools.cached_property
    def _sizes(self) -> tuple[int, ...]:
        """Numbers of the parameters, part by part: as in :meth:`parameters`."""
        model, tables = self.model, self._tables
        return (
            model.beams.weight.size * model.element.axes,
            tables.of_places,
            model.positions.B.shape[1],
            model.positions.B.shape[1],
            model.unwrapping.count,
            *(len(group.data) * group.kind.sizes[4] for group in model.connections),
            *(part.size for part in self._data),
        )

    @property
    def _data(self) -> list[Array]:
        """Data of all elements and of each group of connections, part by part."""
        beams = self.model.beams
        return [*(getattr(beams, name) for name in ELEMENT_DATA), *(group.data for group in self.model.connections)]

    @functools.cached_property
    def _parts(self) -> tuple[ca.MX, Given, ca.MX]:
        """Prescribed rotations, what is given, and values near which angles count."""
        element, beams, count = self.model.element, self.model.beams, len(self.model.connections)
        pull, rest, force, shift, unwrapped, *more = ca.vertsplit(self.p, np.cumsum([0, *self._sizes]).tolist())
        loads, own, data = more[:count], more[count : count + len(ELEMENT_DATA)], more[count + len(ELEMENT_DATA) :]
        widths = (element.stiffnesses, element.axes, beams.compliance.shape[-1])
        points = beams.weight.size
        groups = zip(data, self.model.connections, strict=True)
        given = Given(
            **{name: ca.reshape(own[i], widths[i], points) for i, name in enumerate(ELEMENT_DATA)},
            data=tuple(ca.reshape(part, group.kind.sizes[3], len(group.data)) for part, group in groups),
            pull=pull,
            force=force,
            shift=shift,
            turn=ca.MX(),
            spread=ca.MX(),
            loads=tuple(loads),
        )
        return rest, given, unwrapped

    @property
    def _given(self) -> Given:
        return self._parts[1]

    @functools.cached_property
    def _q(self) -> ca.MX:
        """Components of all rotations, (components, rotations)."""
        rest, tables = self._parts[0], self._tables
        turned = rest + times(self._spread, self.x) if tables.of_places else rest
        return ca.reshape(turned, self.model.element.components, len(self.model.rotations.kind))

    @functools.cached_property
    def _places(self) -> ca.MX:
        return self.terms.retained_places(self._y, self._given)

    @functools.cached_property
    def _arguments(self) -> list[list[ca.MX]]:
        return self.terms.every(self._q, self._places, self._given, self._parts[2])

    @functools.cached_property
    def _spread(self) -> ca.DM:
        """Matrix from the unknowns to the components of all rotations; zero rows for fixed ones."""
        unknown = self._tables.unknown[: self._tables.of_places]
        used = np.flatnonzero(unknown >= 0)
        shape = (self._tables.of_places, self._tables.unknowns)
        return sparse(used, unknown[used], self._tables.weight[used], shape)

    @functools.cached_property
    def _unit(self) -> list[int]:
        """Numbers of the rotations whose quaternions have a norm as constraint."""
        return np.flatnonzero(self.model.rotations.kind != RotationFreedom.FIXED).tolist() if self.model.space else []

    @functools.cached_property
    def _norm_parts(self) -> tuple[Index, Index]:
        """Rows and unknowns (entries,) of the components in the norms."""
        numbers = self._tables.number[self._unit]
        rows = np.broadcast_to(np.arange(len(numbers))[:, None], numbers.shape)
        return rows[numbers >= 0], numbers[numbers >= 0]

    # -- functions and first derivatives ---------------------------------------------------------

    def _objective(self) -> ca.MX:
        energy, _ = self.terms.energies(self._arguments)
        return energy - ca.dot(self._given.force, self._places)

    @functools.cached_property
    def _slopes(self) -> list[tuple[ca.MX, ca.MX]]:
        """Gradients of the energy and derivatives of the rows for each group of terms."""
        found = []
        for number, group in enumerate(self.model.terms):
            slopes = (ca.MX(0, 1), ca.MX(0, 1))
            if len(group.data):
                gradient, rows = self.terms.many(slopes_of(group.kind), len(group.data)).call(self._arguments[number])
                slopes = gradient, rows
            found.append(slopes)
        return found

    def _gradient(self) -> ca.MX:
        tables, onto = self._tables, self.terms.onto_unknowns
        parts = [(onto(sides), ca.vec(own)) for sides, (own, _) in zip(tables.sides, self._slopes, strict=True)]
        gradient = added(*parts)[: tables.unknowns]
        if not len(self.model.positions.Y.row):
            return gradient
        loads = times(self.model.positions.Y.T, self._given.force)
        return gradient - ca.vertcat(ca.MX.zeros(tables.rotation_unknowns), loads)

    def _norms(self) -> ca.MX:
        if not self._unit:
            return ca.MX(0, 1)
        rows, columns = self._norm_parts
        adder = sparse(rows, columns, np.ones(len(rows)), (len(self._unit), self.x.numel()))
        return times(adder, self.x**2) - 1.0

    def _jacobian(self) -> ca.MX:
        tables, w = self._tables, self.model.positions.W
        if not self.row_names:
            return ca.MX(0, tables.unknowns)
        closed = tables.closed
        chords = ca.vec(self._slopes[0][1])
        values = [picked(chords, closed.entry) * ca.DM(closed.value)]
        values += [ca.vec(rows) for _, rows in self._slopes[1:]]
        row, column, weight, entry = tables.first.places
        count, norms = tables.first.count, len(self._unit)
        norm_rows, norm_columns = self._norm_parts
        places = (
            np.concatenate([norms + row - tables.unknowns, norms + w.row, norm_rows]),
            np.concatenate([column, tables.rotation_unknowns + w.column, norm_columns]),
            np.concatenate([weight, w.value, np.full(len(norm_rows), 2.0)]),
            np.concatenate([entry, np.full(len(w.row), count), count + 1 + np.arange(len(norm_rows))]),
        )
        given = ca.vertcat(*values, ca.MX(1), picked(self.x, norm_columns))
        return summed((norms + tables.rows, tables.unknowns), places, given)

    def _hessian(self, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        tables, norms = self._tables, len(self._unit)
        lam, values = lam_g[norms:, :], []
        for number, group in enumerate(self.model.terms):
            n = len(group.data)
            if n:
                arguments = [*self._arguments[number], self.terms.multipliers(number, lam), ca.repmat(lam_f, 1, n)]
                values.append(ca.vec(self.terms.many(curvatures_of(group.kind), n)(*arguments)))
        row, column, weight, entry = tables.second.places
        norm_rows, norm_columns = self._norm_parts
        places = (
            np.concatenate([row, norm_columns]),
            np.concatenate([column, norm_columns]),
            np.concatenate([weight, np.full(len(norm_rows), 2.0)]),
            np.concatenate([entry, tables.second.count + norm_rows]),
        )
        return summed((tables.unknowns,) * 2, places, ca.vertcat(ca.MX(0, 1), *values, lam_g[:norms, :]))

    # -- expressions by place ---------------------------------------------------------------------

    def displacement(self, node: int) -> ca.MX:
        """Displacement (axes,) of a node by its number, dimensionless."""
        axes = self.model.element.axes
        moved = self.terms.displacements(self._q, self._y, self._given)
        return ca.densify(moved[node * axes : (node + 1) * axes])

    def rotation(self, number: int) -> ca.MX:
        """Components of a rotation by its number: a quaternion (4,), scalar first, or an angle, rad."""
        return self._q[:, number]

    def strain(self, member: str, at: float) -> ca.MX:
        """Curvature minus that of the unloaded member at a fraction of its length, dimensionless.

        One number in the plane, (3,) about the section's axes in space.
        """
        model, element = self.model, self.model.element
        cuts = model.mesh.cuts[member]
        e = int(np.clip(np.searchsorted(cuts, at, side="right") - 1, 0, len(cuts) - 2))
        length = model.beams.weight[model.elements_of(member)][e].sum()
        xi = np.array([(at - cuts[e]) / (cuts[e + 1] - cuts[e])])
        q = self._q[:, model.rotations.turns[model.elements_of(member).start + e].tolist()]
        here = ca.mtimes(q, ca.DM(interpolation.evaluation(element.nodes, xi).T))
        slope = ca.mtimes(q, ca.DM(interpolation.differentiation(element.nodes, xi).T)) / length
        if not model.space:
            return slope
        parts = ca.vertsplit(here)
        spin = product([parts[0], -parts[1], -parts[2], -parts[3]], ca.vertsplit(slope))[1:]
        frame = quaternion.matrix(model.scene.center_lines[member].quaternions(np.array([at])))[0]
        return ca.mtimes(ca.DM(frame.T), 2.0 * ca.vertcat(*spin)) / ca.dot(here, here)

    # -- numbers --------------------------------------------------------------------------------

    def parameters(self, loading: Loading, near: State | None = None) -> Array:
        """Values (parameters,) of the parameters for a loading; angles that count turns are those near a state's."""
        model, positions = self.model, self.model.positions
        rest = np.where(
            (model.rotations.kind == RotationFreedom.FIXED)[:, None], model.prescribed_rotations(loading.turn), 0.0
        )
        hanging = (positions.E.T @ loading.force.ravel()).reshape(-1, model.element.axes)
        pull = loading.pull - hanging[model.segments.owner][:, None, :]
        unwrapped = self._guessed_unwrapped if near is None else near.unwrapped
        loads = [load.ravel() for load in loading.loads]
        parts = [pull.ravel(), rest.ravel(), loading.force.ravel(), loading.shift, unwrapped, *loads]
        return np.concatenate([*parts, *(part.ravel() for part in self._data)])

    def parameters_by(self, given: Given, unwrapped: Array) -> ca.MX:
        """The parameters (parameters,) as an expression of what is given.

        ``unwrapped`` (angles,), rad, are the values near which angles count turns.
        """
        still = np.zeros((self.model.element.components, len(self.model.rotations.kind)))
        fixed = (self.model.rotations.kind == RotationFreedom.FIXED).astype(float)
        if self.model.space:
            # Fixed rotations without a prescribed motion are identities.
            still[0] = fixed
        turned = self.terms.with_prescribed_rotations(ca.MX(ca.DM(still)), given)
        data = [*(getattr(given, name) for name in ELEMENT_DATA), *given.data]
        loads = [given.pull, ca.vec(turned), given.force, given.shift, ca.MX(ca.DM(unwrapped)), *given.loads]
        return ca.vertcat(*loads, *(ca.vec(part) for part in data))

    def unknowns(self, state: State) -> Array:
        """The unknowns (unknowns,) of the program at a state, dimensionless."""
        x, tables = np.zeros(self._tables.unknowns), self._tables
        unknown, weight = tables.unknown[: tables.of_places], tables.weight[: tables.of_places]
        used = unknown >= 0
        np.add.at(x, unknown[used], (weight * state.q.ravel())[used])
        x[tables.rotation_unknowns :] = state.y
        return x

    def state(self, x: Array, lam: Array, loading: Loading, near: State | None = None) -> State:
        """The state of a solution of the program.

        Parameters
        ----------
        x : ndarray (unknowns,)
        lam : ndarray (rows of the program,)
            Multipliers.
        loading : Loading
            Gives the fixed rotations.
        near : State, optional
            Angles that count turns are counted near those of this state; by default near the guess.

        Returns
        -------
        State
            With exactly normalised quaternions; nan for a quaternion that is zero.
        """
        model, tables = self.model, self._tables
        rest = np.where(
            (model.rotations.kind == RotationFreedom.FIXED)[:, None], model.prescribed_rotations(loading.turn), 0.0
        )
        unknown, weight = tables.unknown[: tables.of_places], tables.weight[: tables.of_places]
        q = rest + (weight * np.append(x, 0.0)[unknown]).reshape(rest.shape)
        if model.space:
            # A zero quaternion has no direction and becomes nan, which callers refuse.
            with np.errstate(divide="ignore", invalid="ignore"):
                q = q / np.linalg.norm(q, axis=-1, keepdims=True)
        unwrapped = model.unwrapping.angles(q, self._guessed_unwrapped if near is None else near.unwrapped)
        return State(q, x[tables.rotation_unknowns :].copy(), lam[self.rows_of_equations], unwrapped)

    @property
    def rows_of_equations(self) -> slice:
        """The rows that are also rows of the stationarity equations: closings and joints."""
        return slice(len(self._unit), len(self.row_names))

    def multipliers(self, state: State) -> Array:
        """Multipliers (rows of the program,) at a state, zero for the norms, dimensionless."""
        return np.concatenate([np.zeros(len(self._unit)), state.lam])
