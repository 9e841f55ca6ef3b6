"""The equilibrium of a model as expressions of flat vectors, for results, derivatives, designs and generated C.

A *state* is one vector (states,): rotations (quaternions or angles), displacements retained as unknowns, multipliers,
and the values near which angles count turns.  What is *given* is another vector (given,): loads, motions, and data of
the equations that vary.  All of it is dimensionless.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics.active import applied
from ..mathematics.arrays import Array, numbers
from ..mathematics.constants import sparse, times
from ..mathematics.interpolation import legendre_tail
from ..mechanics.beams import ELEMENT_DATA
from ..mechanics.expressions import LOADS, Expressions, Given, moved_by
from ..mechanics.inputs import Inputs
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rotations import RotationFreedom
from ..mechanics.singles import counted_angle, turned_vector
from ..mechanics.stationarity import Stationarity, summed
from ..mechanics.terms import GROUND, energies_of

__all__ = ["Program", "data_of", "is_data"]


class Program:
    """The functions of one model.

    Parameters
    ----------
    expressions : Expressions
    varying : mapping of str to bool, optional
        Which parts of :class:`~sfetcas.mechanics.expressions.Given` are not constant; by default the loads that the
        model has.
    prefix : str
        Prefix of the names of all functions.

    Attributes
    ----------
    prefix : str
    states : int
        Length of a state.
    sizes : mapping of str to int
        Lengths of the parts that vary, in their order in what is given.
    symbol : MX (given,)
        What is given, as a symbol.
    given : Given
        All data and loads, as expressions of ``symbol``.
    """

    def __init__(
        self, expressions: Expressions, varying: Mapping[str, bool] | None = None, *, prefix: str = ""
    ) -> None:
        self.prefix = prefix
        self.expressions, self.model = expressions, expressions.model
        self.equations = expressions.equations
        n = expressions.layout
        self.states = n.components * n.rotations + n.y + n.lam + n.unwrapped
        self._bounds = np.cumsum([0, n.components * n.rotations, n.y, n.lam, n.unwrapped]).tolist()
        still = expressions.given(ca.MX.zeros(n.factors))
        parts = self._parts(still)
        varying = varying if varying is not None else expressions.loaded()
        self.sizes = {name: part.numel() for name, part in parts.items() if varying.get(name)}
        self.symbol = ca.MX.sym("given", sum(self.sizes.values()))
        self._all = parts
        self.given = self.given_by(self.symbol)

    @staticmethod
    def _parts(given: Given) -> dict[str, ca.MX]:
        """All parts of data and loads by name; data and loads of the i-th group are ``data_i`` and ``loads_i``."""
        parts: dict[str, ca.MX] = {name: getattr(given, name) for name in ELEMENT_DATA}
        parts |= {f"data_{i}": part for i, part in enumerate(given.data)}
        parts |= {name: getattr(given, name) for name in LOADS}
        return parts | {f"loads_{i}": part for i, part in enumerate(given.loads)}

    def given_by(self, flat: ca.MX) -> Given:
        """All data and loads, with the parts that vary taken from a vector (given,)."""
        bounds = np.cumsum([0, *self.sizes.values()]).tolist()
        cut = dict(zip(self.sizes, ca.vertsplit(flat, bounds), strict=True)) if self.sizes else {}
        found: dict[str, Any] = {}
        for name, part in self._all.items():
            value = ca.reshape(cut[name], *part.shape) if name in cut else part
            base, _, number = name.partition("_")
            if number:
                found[base] = (*found.get(base, ()), value)
            else:
                found[name] = value
        return Given(**{"data": (), "loads": ()} | found)

    def given_of(self, loading: Loading) -> Array:
        """The vector (given,) of a loading, with the data of the model, dimensionless."""
        data = data_of(self.model)
        parts = [data[name] if name in data else self._load(name, loading) for name in self.sizes]
        return np.concatenate([np.zeros(0), *parts])

    def _load(self, name: str, loading: Loading) -> Array:
        base, _, number = name.partition("_")
        part = loading.loads[int(number)] if number else getattr(loading, base)
        if base == "pull" and self.expressions.reaching.nnz():
            return numbers(part.ravel() - applied(self.expressions.reaching.T, loading.force.ravel()))
        return numbers(part.ravel())

    # -- states -----------------------------------------------------------------------------------

    def _split(self, state: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        q, y, lam, unwrapped = ca.vertsplit(state, self._bounds)
        return ca.reshape(q, self.expressions.layout.components, self.expressions.layout.rotations), y, lam, unwrapped

    @functools.cached_property
    def _symbols(self) -> tuple[ca.MX, tuple[ca.MX, ca.MX, ca.MX, ca.MX]]:
        state = ca.MX.sym("state", self.states)
        return state, self._split(state)

    @property
    def parts(self) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """Rotations (components, rotations), displacements, multipliers and counted angles of the state's symbol."""
        return self._symbols[1]

    @property
    def state_symbol(self) -> ca.MX:
        """The symbol (states,) of the state in all expressions."""
        return self._symbols[0]

    def moved_expression(self, step: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Rotations (components, rotations), displacements and multipliers after a step (total,)."""
        q, y, lam, _ = self.parts
        bounds = [0, self.equations.rotation_unknowns, self.equations.unknowns, self.expressions.total]
        _, shift, more = ca.vertsplit(step, bounds)
        return moved_by(self.expressions, q, self.expressions.spins(step)), y + shift, lam + more

    @functools.cached_property
    def matrix(self) -> ca.MX:
        """Newton's matrix, (total, total)."""
        entries, tables = self.stationarity.entries, self.expressions.tables
        # With its whole diagonal, for regularisation.
        return summed((self.expressions.total,) * 2, tables.whole, ca.vertcat(*entries, ca.MX(1), ca.MX(0)))

    @functools.cached_property
    def _energies(self) -> tuple[ca.MX, ca.MX]:
        return self.expressions.energies(self._arguments)

    @functools.cached_property
    def _arguments(self) -> list[list[ca.MX]]:
        q, _, _, unwrapped = self.parts
        return self.expressions.every(q, self._places, self.given, unwrapped)

    @functools.cached_property
    def _places(self) -> ca.MX:
        return self.expressions.retained_places(self.parts[1], self.given)

    @functools.cached_property
    def strains(self) -> ca.MX:
        """Elastic energy of each element, (1, elements), over ``model.scales.moment``."""
        expressions = self.expressions
        if not expressions.elements:
            return ca.MX(1, 0)
        found = ca.MX(1, expressions.elements)
        for number, group in enumerate(self.model.terms):
            if number and not group.kind.strains_member:
                continue
            n = len(group.data)
            energies = expressions.many(energies_of(group.kind), n)(*self._arguments[number])[1]
            onto = sparse(group.elements, np.arange(n), np.ones(n), (expressions.elements, n)) if number else None
            found += energies if onto is None else times(onto, energies.T).T
        return found

    @property
    def strain(self) -> ca.MX:
        """Elastic energy of all terms, over ``model.scales.moment``."""
        return self._energies[1]

    @functools.cached_property
    def roughness(self) -> ca.MX:
        """Largest of :func:`~sfetcas.mechanics.accuracy.roughness`, without that of twisted tubes."""
        expressions, element = self.expressions, self.model.element
        if not expressions.elements:
            return ca.MX(0)
        q, turns = self.parts[0], self.model.rotations.turns
        tail = ca.DM(legendre_tail(element.nodes))
        width = q.shape[0]
        by_element = ca.reshape(q[:, turns.ravel().tolist()], width * turns.shape[1], len(turns))
        angles = ca.sqrt(ca.sum1(ca.mtimes(ca.kron(tail.T, ca.DM.eye(width)), by_element) ** 2))
        points, axes = ca.DM(legendre_tail(element.points) / element.weights), expressions.axes
        tangents = expressions.tangents(q, self._places, self.given)
        by_element = ca.reshape(tangents, axes * expressions.points, len(turns))
        chord = ca.sqrt(ca.sum1(ca.mtimes(ca.kron(points.T, ca.DM.eye(axes)), by_element) ** 2))
        chord = chord * (self.model.scales.length / self.model.scene.size)
        return ca.mmax((2.0 if self.model.space else 1.0) * angles + chord)

    def _function(self, name: str, arguments: Mapping[str, ca.MX], results: Mapping[str, ca.MX]) -> ca.Function:
        return ca.Function(
            self.prefix + name, list(arguments.values()), list(results.values()), list(arguments), list(results)
        )

    # -- counted turns ------------------------------------------------------------------------------

    def counted(self, q: ca.MX, unwrapped: ca.MX) -> ca.MX:
        """The angles (angles,) that count turns, rad: of those that differ by whole turns the nearest to ``unwrapped``.

        ``q`` are rotations (components, rotations).
        """
        unwrapping = self.model.unwrapping
        if not unwrapping.count:
            return unwrapped
        sides = np.where(unwrapping.sides == GROUND, self.expressions.layout.rotations, unwrapping.sides)
        q = ca.horzcat(q, ca.DM([1.0, 0.0, 0.0, 0.0]))
        crossed = np.asarray(unwrapping.across.any(axis=1), dtype=float)
        function = self.expressions.many(counted_angle(), unwrapping.count)
        a, b = (q[:, side.tolist()] for side in sides.T)
        return function(
            a, b, ca.DM(unwrapping.axis.T), ca.DM(unwrapping.across.T), ca.DM(crossed[None, :]), unwrapped.T
        ).T

    def _unwrapped(self, q: ca.MX, unwrapped: ca.MX, phi: ca.MX, there: ca.MX) -> ca.MX:
        """The angles (angles,), rad, after rotation by vectors ``phi`` (3, rotations) about the fixed axes."""
        unwrapping = self.model.unwrapping
        if not unwrapping.count:
            return unwrapped
        sides = np.where(unwrapping.sides == GROUND, self.expressions.layout.rotations, unwrapping.sides)
        q_all, phi_all = ca.horzcat(q, ca.DM([1.0, 0.0, 0.0, 0.0])), ca.horzcat(phi, ca.DM.zeros(3))
        carried = self.expressions.many(turned_vector(True), unwrapping.count)(
            q_all[:, sides[:, 0].tolist()], ca.DM(unwrapping.axis.T)
        )
        apart = phi_all[:, sides[:, 1].tolist()] - phi_all[:, sides[:, 0].tolist()]
        gained = ca.sum1(carried * apart).T
        return self.counted(there, self.counted(q, unwrapped) + gained)

    def _prescribed(self) -> ca.MX:
        """Angles (angles,), rad, that the prescribed rotation vectors give, each about one axis."""
        unwrapping, n = self.model.unwrapping, self.expressions.layout
        turn = ca.horzcat(ca.reshape(self.given.turn, 3, n.rotations), ca.DM.zeros(3))
        sides = np.where(unwrapping.sides == GROUND, n.rotations, unwrapping.sides)
        apart = turn[:, sides[:, 1].tolist()] - turn[:, sides[:, 0].tolist()]
        about = ca.sum1(apart * ca.DM(unwrapping.axis.T)).T
        return ca.sign(about) * ca.sqrt(ca.sum1(apart**2)).T

    def _prescribed_unwrapped(self, unwrapped: ca.MX) -> ca.MX:
        """Values (angles,), rad, near which angles count turns: the prescribed ones where motions fix them."""
        unwrapping = self.model.unwrapping
        fixed = np.append(self.model.rotations.kind == RotationFreedom.FIXED, True)[unwrapping.sides].all(axis=1)
        known, prescribed = [unwrapped[i] for i in range(unwrapping.count)], self._prescribed()
        for i in np.flatnonzero(fixed).tolist():
            known[i] = prescribed[i]
        for angle, group, number, sign in unwrapping.driven:
            known[angle] = sign * self.given.loads[group][number]
        return ca.vertcat(*known)

    # -- functions ----------------------------------------------------------------------------------

    @functools.cached_property
    def prescribed_expression(self) -> ca.MX:
        """The state (states,) with fixed rotations at their prescribed values, quaternions normalised."""
        q, y, lam, unwrapped = self.parts
        unwrapped = self._prescribed_unwrapped(unwrapped) if self.expressions.layout.unwrapped else unwrapped
        if self.model.space:
            # A start of a user may have quaternions that are not normalised.
            q = q / ca.repmat(ca.sqrt(ca.sum1(q**2)), 4, 1)
        return ca.vertcat(ca.vec(self.expressions.with_prescribed_rotations(ca.MX(q), self.given)), y, lam, unwrapped)

    @property
    def moving(self) -> ca.MX:
        """Derivative (states, total) of the state by a step of all unknowns and multipliers, at step zero."""
        step = ca.MX.sym("step", self.expressions.total)
        there, y, lam = self.moved_expression(step)
        moved = ca.vertcat(ca.vec(there), y, lam, self.parts[3])
        return ca.substitute([ca.jacobian(moved, step)], [step], [ca.DM.zeros(self.expressions.total)])[0]

    @functools.cached_property
    def hold(self) -> ca.Function:
        """(state, given) -> the state with fixed rotations at their prescribed values."""
        state, there = self._symbols[0], self.prescribed_expression
        return self._function("hold", {"state": state, "given": self.symbol}, {"held": there})

    @functools.cached_property
    def move(self) -> ca.Function:
        """(state, step, share) -> the state after ``share`` times a step (total,) of all unknowns and multipliers."""
        state, (q, _, _, unwrapped) = self._symbols
        step, share = ca.MX.sym("step", self.expressions.total), ca.MX.sym("share")
        there, y, lam = self.moved_expression(share * step)
        phi = self.expressions.spins(share * step)
        moved = ca.vertcat(ca.vec(there), y, lam, self._unwrapped(q, unwrapped, phi, there))
        return self._function("move", {"state": state, "step": step, "share": share}, {"moved": moved})

    @functools.cached_property
    def stationarity(self) -> Stationarity:
        """The stationarity equations at :attr:`parts`, with the entries of the Newton matrix."""
        return self._stationarity(entries=True)

    @functools.cached_property
    def forces(self) -> Stationarity:
        """The stationarity equations at :attr:`parts` without entries of the matrix, to be differentiated."""
        return self._stationarity(entries=False)

    def _stationarity(self, *, entries: bool) -> Stationarity:
        _, (q, y, lam, unwrapped) = self._symbols
        return Stationarity(self.expressions, q, y, lam, self.given, unwrapped, entries=entries)

    @functools.cached_property
    def potential(self) -> ca.MX:
        """Potential energy over ``model.scales.moment``, of loads zero in the undeformed scene.

        Loads without potential do not count.
        """
        return self._energies[0] - ca.dot(self.given.force, self._places)

    @property
    def slice_of_loads(self) -> slice:
        """Positions of loads and motions in what is given: after all data."""
        data = sum(size for name, size in self.sizes.items() if is_data(name))
        return slice(data, self.symbol.shape[0])

    # -- rows of inputs -----------------------------------------------------------------------------

    @functools.cached_property
    def varying(self) -> list[int]:
        """Numbers of the groups of terms whose data are part of what is given."""
        names = [ELEMENT_DATA, *((f"data_{i}",) for i in range(len(self.model.connections)))]
        return [i for i, own in enumerate(names) if any(name in self.sizes for name in own)]

    @functools.cached_property
    def inputs(self) -> Inputs:
        """What an equilibrium depends on, with the data that vary."""
        return Inputs(self.equations, self.varying)

    @functools.cached_property
    def row(self) -> ca.Function:
        """(given) -> the row of :attr:`inputs`."""
        angles = ca.MX(0, 1)
        if self.expressions.layout.unwrapped:
            angles = self._prescribed_unwrapped(self._prescribed())
        row = self.inputs.expression(self.expressions, self.given, angles)
        return self._function("row", {"given": self.symbol}, {"row": row})


def data_of(model: Model) -> dict[str, Array]:
    """The data of a model by name, each as a vector, dimensionless; those of the i-th group are ``data_i``."""
    found = {name: getattr(model.beams, name).ravel() for name in ELEMENT_DATA}
    return found | {f"data_{i}": group.data.ravel() for i, group in enumerate(model.connections)}


def is_data(name: str) -> bool:
    """Whether the name of a part of what is given is that of data, not of loads or motions."""
    return name in ELEMENT_DATA or name.startswith("data_")
