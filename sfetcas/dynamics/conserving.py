"""A scheme that keeps energy and momentum: midpoint rule with discrete gradients.

Positions, section axes and strains are quadratic in quaternions, so that their derivatives at the mean of two states,
taken as it is and not of length one, are exact differences:

    X(q_1) - X(q_0) = X'(q_m) (q_1 - q_0),      q_m = (q_0 + q_1) / 2.

Elastic forces are those of the mean strain, loads those at the middle of the step.  With constant masses and dead
loads the energy is then kept exactly, and the momenta by the invariance of all terms.  In the plane the factor
``sin(d/2)/(d/2)`` does the same for vectors that turn by an angle d.  Springs with a free length, rotational springs
in space and the rows of universal joints and slides are taken at the mean state: with these the energy is kept to
second order only, without drift, as the scheme is reversible.

Source: Simo and Tarnow 1992; Gonzalez 1996 (discrete gradients, doi 10.1007/BF02440162); Betsch and Siebert 2009
(rigid bodies in quaternions); strains as quadratic invariants of quaternions are ours.
"""

from __future__ import annotations

import functools
from typing import final

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.interpolation import differentiation
from ..mathematics.quaternion import product, turned
from ..mechanics.elements import Element
from ..mechanics.joints import Connection, name_of
from .methods import Begin, Method
from .observed import Axes
from .stages import StageEquations

__all__ = ["Conserving"]


@final
class Conserving(Method):
    """Keeps energy, linear and angular momentum; order 2, no damping of its own."""

    name, order, kept = "conserving", 2, 1
    places = np.array([1.0])
    loaded = np.array([0.5, 1.0])

    def iteration(self, system: StageEquations, linear: str) -> ca.Function:
        """One for the end of the step; constants are the begin, h, and the loads in the middle and at the end.

        Raises
        ------
        SceneError
            A load follows what it acts on: it has no energy to keep.
        """
        model = system.model
        if any(group.follows for group in model.groups.values()):
            name = next(name for name, load in model.scene.loads.items() if load.frame != "fixed")
            message = "found a follower with the integrator 'conserving', accepted: loads with a potential"
            raise SceneError(message, ("loads", name))
        n = system.layout
        q, y, lam = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("lam", n.lam)
        begin = Begin(
            ca.MX.sym("q0", n.components, n.rotations),
            ca.MX.sym("y0", n.y),
            ca.MX.sym("x0", n.x),
            ca.MX.sym("rates", n.x),
            ca.MX.sym("near", n.near),
        )
        h, factors = ca.MX.sym("h"), ca.MX.sym("factors", n.factors, 2)
        found = _Middle(system, begin, h, factors, q, y, lam)
        step = system.solved(found.entries, found.residual, linear)
        (there,), shift, more, size = system.moved([q], step)
        constants = [begin.q, begin.y, begin.x, begin.rates, begin.near, h, factors]
        return ca.Function("middle", [q, y, lam, *constants], [there, y + shift, lam + more, size])

    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """The begin, h and the loads."""
        return [begin.q, begin.y, begin.x, begin.rates, begin.near, h, factors]

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """The velocity at the end: its mean with that at the begin is the mean velocity."""
        return 2.0 * moved / h - rates


class _Middle:
    """Residual and entries of a step, in the order of :meth:`StageEquations.solved` for one stage."""

    def __init__(
        self, system: StageEquations, begin: Begin, h: ca.MX, factors: ca.MX, q: ca.MX, y: ca.MX, lam: ca.MX
    ) -> None:
        model, n = system.model, len(system.model.positions.rows)
        middle, end = ca.horzsplit(factors)
        places, before = system.displacements(y, end), begin.x[: system.axes * system.places]
        moved = system.quantities(q, places, begin.near) - begin.x
        forces = system.forces(moved / h, 2.0 * (moved / h - begin.rates) / h)
        c, b = 1.0 / h, 2.0 / h**2
        linear = forces[: system.linear]
        on_places = system.times(system.by_place.T, linear) - system.times(system.force, middle)
        turning = -system.times(system.moment, middle)
        gaps = system.open_gaps(y, end)
        entries, full, coupled = [], [], []
        if system.elements:
            turns = model.rotations.turns.ravel().tolist()
            pull = system.times(system.pull, middle) + system.times(system.closing.T, lam[:n])
            pull += system.times(system.by_tangent.T, linear)
            pull = ca.reshape(pull, system.axes, system.elements * system.points)
            function = system.many(_element(model.element), system.elements)
            moments, stiffness, mean, spin = function(begin.q[:, turns], q[:, turns], *system.given, pull)
            gaps += system.times(system.closing, ca.vec(system.tangents(q)) - ca.DM(system.rest))
            turning += system.times(system.onto_rotations, ca.vec(moments))
            signs, picked = ca.DM(system.closed.value), system.closed.entry.tolist()
            entries += [ca.vec(stiffness), ca.vec(spin)[picked] * signs, ca.vec(mean)[picked] * signs]
            massive = system.massive_columns
            coupled += self._inner(system, mean[:, massive], spin[:, massive], c, b)
        rows = [gaps]
        for number, (group, sides) in enumerate(zip(model.connections, system.linked, strict=True)):
            count, width = len(group.data), group.kind.sizes[2]
            first = n + sum(len(g.rows) for g in model.connections[:number])
            own = ca.reshape(lam[first : first + count * width], width, count)
            given = system.sides(group, begin.q, before, begin.near), system.sides(group, q, places, begin.near)
            loads = [
                ca.reshape(system.times(system.loads[number], f), group.kind.sizes[4], count) for f in (middle, end)
            ]
            function = system.many(_between(group.kind), count)
            gradient, stiffness, values, mean, spin = function(*given[0][:2], *given[1], *loads, own)
            full.append((sides, gradient))
            entries.append(ca.vec(stiffness))
            if width:
                rows.append(ca.vec(values))
                entries += [ca.vec(spin), ca.vec(mean)]
        if system.twisting:
            # Moments that are dead do not change when what they act on turns.
            entries.append(ca.MX.zeros(9 * system.layout.rotations))
        observed = []
        for seen, sides, (first, last) in zip(system.masses.observables, system.observed, system.ranges, strict=True):
            count, width = len(seen.data), seen.kind.sizes[2]
            own = ca.reshape(forces[first:last], width, count)
            given = system.sides(seen, begin.q, before, begin.near), system.sides(seen, q, places, begin.near)
            nothing = ca.MX(0, count)
            function = system.many(_between(seen.kind), count)
            gradient, stiffness, _, mean, spin = function(*given[0][:2], *given[1], nothing, nothing, own)
            full.append((sides, gradient))
            entries.append(ca.vec(stiffness))
            weight = b * ca.DM(seen.mass.T) + c * ca.DM(seen.damping.T)
            observed.append(ca.vec(system.paired(width, mean.shape[1] // count, count)(mean, spin, weight)))
        self.residual = system.gathered(turning, on_places, full, lam[:n], rows)
        places_of = [b * system.place_mass.nz[:], c * system.place_drag.nz[:]]
        self.entries = [*entries, ca.MX(1), *observed, *coupled, *places_of]

    @staticmethod
    def _inner(system: StageEquations, mean: ca.MX, spin: ca.MX, c: ca.MX, b: ca.MX) -> list[ca.MX]:
        """What masses within elements add."""
        return system.hung(mean, spin, c, b) if len(system.massive) else []


# -- functions of single things, made once a process ---------------------------------------------------


def _basis(q: ca.SX) -> ca.SX:
    """Derivative of rotations (components, n), of any length, by rotation vectors about the fixed axes."""
    if q.shape[0] == 1:
        return ca.SX.eye(q.shape[1])
    blocks = []
    for k in range(q.shape[1]):
        columns = [product([0.0, *axis], ca.vertsplit(q[:, k])) for axis in np.eye(3).tolist()]
        blocks.append(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))
    return ca.diagcat(*blocks)


def _swept(before: ca.SX, after: ca.SX) -> ca.SX:
    """``sin(d/2)/(d/2)`` of the angles d between, to all digits also where they vanish."""
    half = 0.5 * (after - before)
    square = half**2
    near = 1.0 - square / 6.0 + square**2 / 120.0
    return ca.if_else(square < 1e-6, near, ca.sin(half) / ca.if_else(square < 1e-6, 1.0, half))


@functools.cache
def _element(element: Element) -> ca.Function:
    """(q0, q1, stiffness, tangent, pull) -> moments, their derivative, spins of the mean state and of the end."""
    n, axes, turns, space = element.order + 1, element.axes, element.turns, element.space
    q0, q1 = ca.SX.sym("q0", element.components, n), ca.SX.sym("q1", element.components, n)
    stiffness, tangent = ca.SX.sym("stiffness", element.stiffnesses, n), ca.SX.sym("tangent", axes, n)
    pull = ca.SX.sym("pull", axes, n)
    slopes = ca.DM(differentiation(element.nodes).T)
    if space:
        moments = _in_space(element, q0, q1, stiffness, tangent, pull, slopes)
    else:
        mean, swept = 0.5 * (q0 + q1), _swept(q0, q1)
        bent = ca.mtimes(mean, slopes)
        c, s = ca.cos(mean), ca.sin(mean)
        turning = [
            (-s[k] * tangent[0, k] - c[k] * tangent[1, k], c[k] * tangent[0, k] - s[k] * tangent[1, k])
            for k in range(n)
        ]
        work = [swept[k] * (pull[0, k] * x + pull[1, k] * y) for k, (x, y) in enumerate(turning)]
        moments = ca.mtimes(slopes, (stiffness * bent).T) + ca.vertcat(*work)
    basis = _basis(q1)
    changed = ca.densify(ca.mtimes(ca.jacobian(moments, ca.vec(q1)), basis))
    by_pull = ca.jacobian(moments, ca.vec(pull))
    mean_spin = ca.horzcat(*[by_pull[turns * k : turns * (k + 1), axes * k : axes * (k + 1)].T for k in range(n)])
    if space:
        ends = ca.horzcat(*[ca.vertcat(*turned(ca.vertsplit(q1[:, k]), ca.vertsplit(tangent[:, k]))) for k in range(n)])
    else:
        c, s = ca.cos(q1), ca.sin(q1)
        ends = ca.vertcat(c * tangent[0, :] - s * tangent[1, :], s * tangent[0, :] + c * tangent[1, :])
    spin = ca.mtimes(ca.jacobian(ca.sum2(ends), ca.vec(q1)), basis)
    results = [ca.densify(part) for part in (moments, changed, mean_spin, spin)]
    return ca.Function(f"conserving_{'space' if space else 'plane'}_{n}", [q0, q1, stiffness, tangent, pull], results)


def _in_space(
    element: Element, q0: ca.SX, q1: ca.SX, stiffness: ca.SX, tangent: ca.SX, pull: ca.SX, slopes: ca.DM
) -> ca.SX:
    """Moments about the fixed axes on the nodes of an element."""
    n = element.order + 1

    def strains(q: ca.SX) -> list[ca.SX]:
        """Half the curvature times the length at each node."""
        slope = ca.mtimes(q, slopes)
        pairs = [(ca.vertsplit(q[:, k]), ca.vertsplit(slope[:, k])) for k in range(n)]
        return [ca.vertcat(*product([a[0], -a[1], -a[2], -a[3]], b)[1:]) for a, b in pairs]

    q, efforts, work = ca.SX.sym("q", 4, n), [], ca.SX(0)
    for k, (before, after, here) in enumerate(zip(strains(q0), strains(q1), strains(q), strict=True)):
        c = ca.SX(ca.Sparsity.dense(3, 3))
        c[0, 0], c[0, 1], c[0, 2], c[1, 1], c[1, 2], c[2, 2] = ca.vertsplit(stiffness[:, k])
        c[1, 0], c[2, 0], c[2, 1] = c[0, 1], c[0, 2], c[1, 2]
        effort = ca.SX.sym(f"effort_{k}", 3)
        efforts.append((effort, 4.0 * ca.mtimes(c, 0.5 * (before + after))))
        work += ca.dot(effort, here)
        work += ca.dot(pull[:, k], ca.vertcat(*turned(ca.vertsplit(q[:, k]), ca.vertsplit(tangent[:, k]))))
    mean = 0.5 * (q0 + q1)
    gradient = ca.vec(ca.gradient(work, q))
    (gradient,) = ca.substitute(
        [gradient], [q, *(symbol for symbol, _ in efforts)], [mean, *(value for _, value in efforts)]
    )
    return ca.mtimes(_basis(mean).T, gradient)


@functools.cache
def _between(kind: Connection) -> ca.Function:
    """(q0, u0, q1, u1, data, load, load_end, lam) -> gradient, its derivative, rows at the end, both spins.

    The gradient is that of ``energy + lam.rows`` at the mean state, by rotations about the fixed axes and by
    displacements; spins are the derivatives of the rows, of the mean state (rows, width) and of the end.
    """
    turns, places, rows, data_size, loads = kind.sizes
    q0, q1 = ca.SX.sym("q0", kind.components, turns), ca.SX.sym("q1", kind.components, turns)
    u0, u1 = ca.SX.sym("u0", kind.axes, places), ca.SX.sym("u1", kind.axes, places)
    data, lam = ca.SX.sym("data", data_size), ca.SX.sym("lam", rows)
    load, load_end = ca.SX.sym("load", loads), ca.SX.sym("load_end", loads)

    def values(q: ca.SX, u: ca.SX, given: ca.SX) -> tuple[ca.SX, ca.SX]:
        sides = [ca.vertsplit(q[:, i]) for i in range(turns)], [ca.vertsplit(u[:, i]) for i in range(places)]
        return kind.energy(*sides, data, given), ca.vertcat(ca.SX(0, 1), *kind.residual(*sides, data, given))

    q, u = ca.SX.sym("q", kind.components, turns), ca.SX.sym("u", kind.axes, places)
    energy, found = values(q, u, load)
    x = ca.vertcat(ca.vec(q), ca.vec(u))
    derivative, jacobian = ca.gradient(energy, x), ca.jacobian(found, x)
    mean = [0.5 * (q0 + q1), 0.5 * (u0 + u1)]
    derivative, jacobian = ca.substitute([derivative, jacobian], [q, u], mean)
    basis = ca.diagcat(_basis(mean[0]), ca.SX.eye(u.numel()))
    if isinstance(kind, Axes) and not kind.space:
        basis *= _swept(q0, q1)
    mean_spin = ca.mtimes(jacobian, basis)
    gradient = ca.mtimes(basis.T, derivative) + ca.mtimes(mean_spin.T, lam)
    end, of_end = ca.vertcat(ca.vec(q1), ca.vec(u1)), ca.diagcat(_basis(q1), ca.SX.eye(u.numel()))
    there = values(q1, u1, load_end)[1]
    changed = ca.mtimes(ca.jacobian(gradient, end), of_end)
    spin = ca.mtimes(ca.jacobian(there, end), of_end)
    results = [ca.densify(part) for part in (gradient, changed, there, mean_spin, spin)]
    arguments = [q0, u0, q1, u1, data, load, load_end, lam]
    return ca.Function(f"between_{name_of(kind)}", arguments, results)
