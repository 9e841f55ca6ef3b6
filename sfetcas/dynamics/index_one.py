"""The equations of motion with constraints differentiated twice (index 1), for integrators that need this form.

Differential unknowns are rotations that may change (quaternions or angles), displacements, the rates of both (angular
velocities about the fixed axes) and the angles that count turns; algebraic ones are accelerations and multipliers.
Inertia and static forces are those of :mod:`~sfetcas.dynamics.stages`; rates of quantities and of constraints are
derivatives along the trajectory,

    q' = 1/2 (0, omega) q,      q'' = 1/2 (0, omega') q - 1/4 |omega|^2 q,

so that what motions prescribe enters with the exact rates of its factors.

The matrix for Newton's method leaves out how centripetal accelerations change with rotations and velocities: beside
the rest it is of the order of the turn in a step, and steps are short against a turn for the sake of accuracy.
"""

from __future__ import annotations

import functools
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics.quaternion import product, turned
from ..mechanics.rotations import RotationFreedom
from .stages import StageEquations

__all__ = ["LINEAR", "IndexOne"]


class IndexOne:
    """Index-1 form of the equations of motion of a system.

    Parameters
    ----------
    system : StageEquations
    degree : int
        Degree of the polynomials in time by which the factors of loads and motions are given.

    Attributes
    ----------
    turning : ndarray of int
        Numbers of the rotations that may change.
    """

    def __init__(self, system: StageEquations, degree: int) -> None:
        self.system, self.degree = system, degree
        model, n = system.model, system.layout
        self.turning = np.flatnonzero(model.rotations.kind != RotationFreedom.FIXED)
        self.unknowns = system.equations.unknowns
        self.q_size = n.components * len(self.turning)
        self.states = [self.q_size, n.y, self.unknowns, n.unwrapped]
        self.algebraic = [self.unknowns, n.lam]
        self.parameters = 1 + n.factors * (degree + 1)

    # -- along the curve ------------------------------------------------------------------------------

    def _full(self, q: ca.MX, factors: ca.MX) -> ca.MX:
        """All rotations: those that may change, and those that are held or driven."""
        n = self.system.layout
        still = ca.DM([1.0, 0.0, 0.0, 0.0] if self.system.model.space else [0.0])
        columns = np.full(n.rotations, len(self.turning))
        columns[self.turning] = np.arange(len(self.turning))
        q = ca.horzcat(ca.reshape(q, n.components, len(self.turning)), still)[:, columns.tolist()]
        return self.system.with_prescribed_rotations(q, self.system.given(factors))

    @functools.cached_property
    def _seen(self) -> ca.Function:
        """(place, rate, acceleration, unwrapped) -> quantities and gaps with their rates and accelerations."""
        system, n = self.system.interpreted, self.system.layout
        size = self.q_size + n.y + n.factors
        at, rate, second = (ca.MX.sym(name, size) for name in ("at", "rate", "second"))
        unwrapped = ca.MX.sym("unwrapped", n.unwrapped)
        q, y, factors = ca.vertsplit(at, np.cumsum([0, self.q_size, n.y, n.factors]).tolist())
        q, given = self._full(q, factors), system.given(factors)
        seen = ca.vertcat(system.moving(q, y, given, unwrapped), system.gaps(q, y, given, unwrapped))
        first = ca.jtimes(seen, at, rate)
        bend = ca.jtimes(first, ca.vertcat(at, rate), ca.vertcat(rate, second))
        return ca.Function("seen", [at, rate, second, unwrapped], [seen, first, bend])

    def _curve(self, q: ca.MX, w: ca.MX, a: ca.MX) -> tuple[ca.MX, ca.MX]:
        """First and second derivatives of the rotations."""
        system, n = self.system, self.system.layout
        columns = self.turning.tolist()
        spin, faster = (system.spins(part)[:, columns] for part in (w, a))
        if not columns:
            return ca.MX(0, 1), ca.MX(0, 1)
        q = ca.reshape(q, n.components, len(columns))
        first, second = _turning(system.model.space).map(len(columns))(q, spin, faster)
        return ca.vec(first), ca.vec(second)

    # -- balance --------------------------------------------------------------------------------------

    @functools.cached_property
    def balance(self) -> ca.Function:
        """``(q, y, w, unwrapped, a, lam, f, f1, f2) ->`` residual of the equations of motion, then accelerations of the
        constraints.

        q rotations, y displacements, w their rates, near the angles that count turns, a accelerations, lam multipliers,
        f, f1, f2 the factors of the loads and their rates; dimensionless.
        """
        system = self.system
        names = ["q", "y", "w", "unwrapped", "a", "lam", "f", "f1", "f2"]
        sizes = [*self.states, *self.algebraic, *[system.layout.factors] * 3]
        symbols = [ca.MX.sym(name, size) for name, size in zip(names, sizes, strict=True)]
        q, y, w, unwrapped, a, lam, f, f1, f2 = symbols
        n, first = system.layout, slice(0, self.unknowns)
        spin, faster = self._curve(q, w, a)
        moved = slice(system.equations.rotation_unknowns, self.unknowns)
        seen = self._seen(
            ca.vertcat(q, y, f), ca.vertcat(spin, w[moved], f1), ca.vertcat(faster, a[moved], f2), unwrapped
        )
        forces = system.forces(seen[1][: n.x], seen[2][: n.x])
        stage = system.stage(self._full(q, f), y, lam, forces, f, unwrapped)
        out = ca.vertcat(stage.residual[first], seen[2][n.x :])
        static = system.static_matrix(stage)
        mass, damping = (system.coupling_matrix(stage, *weights)[first, first] for weights in ((0.0, 1.0), (1.0, 0.0)))
        rows = n.lam
        by_place = ca.mtimes(static[first, first], self._turns_of(q))
        blocks = {
            "q": _above(by_place[:, : self.q_size], rows),
            "y": _above(by_place[:, self.q_size :], rows),
            "w": _above(damping, rows),
            "a": ca.vertcat(mass, static[self.unknowns :, first]),
            "lam": static[:, self.unknowns :],
        }
        total = self.unknowns + rows
        matrices = [blocks.get(name, ca.MX(total, size)) for name, size in zip(names, sizes, strict=True)]
        given = [*symbols, ca.MX.sym("out_missed", ca.Sparsity(total, 1))]
        jacobian = ca.Function(
            "jac_balance", given, matrices, [*names, "out_missed"], [f"jac_missed_{name}" for name in names]
        )
        options: dict[str, Any] = {
            "custom_jacobian": jacobian,
            "never_inline": True,
            "enable_forward": False,
            "enable_reverse": False,
        }
        return ca.Function("balance", symbols, [out], names, ["missed"], options)

    def _turns_of(self, q: ca.MX) -> ca.MX:
        """Changes of the unknowns by those of the components of rotations and of displacements."""
        system, equations, n = self.system, self.system.equations, self.system.layout
        count = len(self.turning)
        still = ca.MX.eye(n.y)
        if not count:
            return still
        if not system.model.space:
            return ca.diagcat(ca.MX.eye(count), still)
        blocks = _turns().map(count)(ca.reshape(q, 4, count))
        rows = (3 * self.turning[:, None, None] + np.arange(3)[None, None, :]) + np.zeros((1, 4, 1), np.intp)
        columns = np.arange(4 * count).reshape(count, 4, 1) + np.zeros((1, 1, 3), np.intp)
        unknown, weight = system.unknown[rows.ravel()], system.weight[rows.ravel()]
        size = equations.rotation_unknowns
        places, entry = np.unique(columns.ravel() * size + unknown, return_inverse=True)
        sums = ca.DM.triplet(
            entry.ravel().tolist(), np.arange(entry.size).tolist(), ca.DM(weight), len(places), entry.size
        )
        pattern = ca.Sparsity.triplet(size, 4 * count, (places % size).tolist(), (places // size).tolist())
        return ca.diagcat(ca.MX(pattern, ca.mtimes(sums, ca.vec(blocks))), still)

    # -- in time --------------------------------------------------------------------------------------

    def factors(self, s: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Factors of loads and motions and their first two rates at fraction s of an interval with parameters p."""
        count = self.system.layout.factors
        length, terms = p[0], ca.reshape(p[1:], count, self.degree + 1)
        value, first, second = (ca.MX.zeros(count) for _ in range(3))
        for k in reversed(range(self.degree + 1)):
            second = second * s + 2.0 * first
            first = first * s + value
            value = value * s + terms[:, k]
        return value, first / length, second / length**2

    @functools.cached_property
    def problem(self) -> dict[str, ca.MX]:
        """The DAE over the fraction of an interval, as :func:`casadi.integrator` takes it: x, z, p, t, ode, alg."""
        x, z = ca.MX.sym("x", sum(self.states)), ca.MX.sym("z", sum(self.algebraic))
        s, p = ca.MX.sym("s"), ca.MX.sym("p", self.parameters)
        q, y, w, unwrapped = ca.vertsplit(x, np.cumsum([0, *self.states]).tolist())
        a, lam = ca.vertsplit(z, np.cumsum([0, *self.algebraic]).tolist())
        factors = self.factors(s, p)
        rates = ca.vertcat(self._curve(q, w, a)[0], w[self.system.equations.rotation_unknowns :], a)
        rates = ca.vertcat(rates, self._counted(q, w, *factors[:2]))
        missed = self.balance(q, y, w, unwrapped, a, lam, *factors)
        return {"x": x, "z": z, "p": p, "t": s, "ode": p[0] * rates, "alg": missed}

    @functools.cached_property
    def _counted(self) -> ca.Function:
        """(q, w, f, f1) -> rates of the angles that count turns."""
        system, n, unwrapping = self.system, self.system.layout, self.system.model.unwrapping
        q, w = ca.MX.sym("q", self.q_size), ca.MX.sym("w", self.unknowns)
        f, rate = ca.MX.sym("f", n.factors), ca.MX.sym("f1", n.factors)
        if not n.unwrapped:
            return ca.Function("counted", [q, w, f, rate], [ca.MX(0, 1)])
        driven = self._full(q, f)
        turned = ca.reshape(ca.jtimes(driven, f, rate), driven.shape)
        still, ground = ca.DM([1.0, 0.0, 0.0, 0.0]), ca.DM.zeros(3)
        spin = ca.horzcat(_spins().map(n.rotations)(driven, turned) + system.spins(w), ground)
        sides = np.where(unwrapping.sides < 0, n.rotations, unwrapping.sides).T.tolist()
        here = ca.horzcat(driven, still)[:, sides[0]]
        rates = _about().map(n.unwrapped)(here, ca.DM(unwrapping.axis.T), spin[:, sides[1]] - spin[:, sides[0]])
        return ca.Function("counted", [q, w, f, rate], [rates.T])

    @functools.cached_property
    def answers(self) -> ca.Function:
        """``(x, s, p) ->`` z, quantities, their rates and accelerations, and the rates of the constraints."""
        x, s, p = ca.MX.sym("x", sum(self.states)), ca.MX.sym("s"), ca.MX.sym("p", self.parameters)
        n = self.system.layout
        q, y, w, unwrapped = ca.vertsplit(x, np.cumsum([0, *self.states]).tolist())
        factors = self.factors(s, p)
        z = -ca.solve(self.matrix(x, s, p), self._missed(x, ca.MX.zeros(sum(self.algebraic)), s, p), LINEAR)
        a = z[: self.unknowns]
        spin, faster = self._curve(q, w, a)
        moved = slice(self.system.equations.rotation_unknowns, self.unknowns)
        at = (
            ca.vertcat(q, y, factors[0]),
            ca.vertcat(spin, w[moved], factors[1]),
            ca.vertcat(faster, a[moved], factors[2]),
        )
        seen = self._seen(*at, unwrapped)
        parts = [z, *(part[: n.x] for part in seen), seen[1][n.x :]]
        return ca.Function("answers", [x, s, p], parts, ["x", "s", "p"], ["z", "quantities", "v", "a", "opening"])

    @functools.cached_property
    def matrix(self) -> ca.Function:
        """``(x, s, p) ->`` matrix of the accelerations and multipliers, ``[M G^T; G 0]``."""
        problem = self.problem
        matrix = ca.jacobian(problem["alg"], problem["z"])
        still = ca.substitute(matrix, problem["z"], ca.MX.zeros(problem["z"].shape))
        return ca.Function("matrix", [problem["x"], problem["t"], problem["p"]], [still])

    @functools.cached_property
    def _missed(self) -> ca.Function:
        problem = self.problem
        return ca.Function("missed", [problem[name] for name in ("x", "z", "t", "p")], [problem["alg"]])


LINEAR = "qr"
"""Linear solver of CasADi, with pivots: as fast as any here (measured)."""


def _above(matrix: ca.MX, rows: int) -> ca.MX:
    """A matrix with rows of nothing below."""
    return ca.vertcat(matrix, ca.MX(rows, matrix.shape[1]))


# -- functions of single things, made once a process ---------------------------------------------------


@functools.cache
def _turning(space: bool) -> ca.Function:
    """(q, omega, omega') -> first and second derivative of a rotation."""
    q, w, a = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("w", 3 if space else 1), ca.SX.sym("a", 3 if space else 1)
    if not space:
        return ca.Function("turning", [q, w, a], [w, a])
    first, faster = (0.5 * ca.vertcat(*product([0.0, *ca.vertsplit(s)], ca.vertsplit(q))) for s in (w, a))
    return ca.Function("turning", [q, w, a], [first, faster - 0.25 * ca.dot(w, w) * q])


@functools.cache
def _turns() -> ca.Function:
    """(q) -> rotation vectors, columns, of changes of the components of a rotation."""
    q = ca.SX.sym("q", 4)
    a = ca.vertsplit(q)
    back = [a[0], -a[1], -a[2], -a[3]]
    columns = [2.0 * ca.vertcat(*product(e, back)[1:]) for e in np.eye(4).tolist()]
    return ca.Function("turns", [q], [ca.horzcat(*columns)])


@functools.cache
def _spins() -> ca.Function:
    """(q, q') -> angular velocity about the fixed axes."""
    q, rate = ca.SX.sym("q", 4), ca.SX.sym("rate", 4)
    return ca.Function("spins", [q, rate], [ca.mtimes(_turns()(q), rate)])


@functools.cache
def _about() -> ca.Function:
    """(q, axis, omega) -> omega about the turned axis."""
    q, axis, w = ca.SX.sym("q", 4), ca.SX.sym("axis", 3), ca.SX.sym("w", 3)
    return ca.Function("about", [q, axis, w], [ca.dot(ca.vertcat(*turned(ca.vertsplit(q), ca.vertsplit(axis))), w)])
