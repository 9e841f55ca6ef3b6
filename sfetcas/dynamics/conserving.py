"""A scheme that keeps energy and momentum: midpoint rule with discrete derivatives.

Between two states a rotation gains a Rodrigues vector ``psi`` (twice the tangent of half the angle, along the axis),
and vectors that turn with it gain exactly

    R_1 t - R_0 t = psi x (R_0 t + R_1 t) / 2.

Relative rotations ``p = conj(q_a) q_b``, of which strains and hinges are made, gain exactly a linear form of
``psi_b - psi_a``.  Forces by these derivatives, with elastic ones those of the mean strain, masses constant and loads
those in the middle of the step, keep the energy under dead loads, and the momenta, as no derivative sees a common
rotation.  Small members, universal joints, slides, rotational springs in space and springs with a free length are
taken at the mean state: with these the energy is kept to second order only, without drift, as the scheme is
reversible.

Source: Simo and Tarnow 1992; Gonzalez 1996 (discrete derivatives, doi 10.1007/BF02440162); Betsch and Steinmann 2001
(mean directors); the exact derivative of relative quaternions is ours.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import final

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.constants import picked, times
from ..mathematics.interpolation import differentiation
from ..mathematics.quaternion import product
from ..mechanics.elements import Element
from ..mechanics.terms import Side, Term, name_of
from .methods import Begin, Method
from .stages import StageEquations

__all__ = ["Conserving", "Middle", "check_conserving", "symbols_of_step"]


@final
class Conserving(Method):
    """Energy-momentum scheme: conserves energy, linear and angular momentum; order 2, no numerical damping."""

    name, order, kept = "conserving", 2, 1
    places = np.array([1.0])
    loaded = np.array([0.5, 1.0])
    polished = True

    def iteration(self, system: StageEquations) -> ca.Function:
        """One Newton iteration for the end of a step, as of :meth:`.Method.iteration`.

        Raises
        ------
        SceneError
            There is a follower load, which has no energy to conserve, or the axes rotate.
        """
        check_conserving(system, self.name)
        q, y, lam, begin, h, factors = symbols_of_step(system)
        found = Middle(system, begin, h, factors, q, y, lam)
        step = system.solved(found.entries, [2.0 / h**2], found.residual, begin.unwrapped)
        (there,), shift, more, size = system.moved([q], step)
        constants = [begin.q, begin.y, begin.x, begin.rates, begin.unwrapped, h, factors]
        return ca.Function("middle", [q, y, lam, *constants], [there, y + shift, lam + more, size])

    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """The state at the begin of the step, its length h, and the factors of loads in the middle and at the end."""
        return [begin.q, begin.y, begin.x, begin.rates, begin.unwrapped, h, factors]

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """The velocity at the end: its mean with the velocity at the begin is the mean velocity of the step."""
        return 2.0 * moved / h - rates


def symbols_of_step(system: StageEquations) -> tuple[ca.MX, ca.MX, ca.MX, Begin, ca.MX, ca.MX]:
    """Symbols of the rotations, displacements and multipliers at the end of a step, of the state at its begin, of its
    length, and of the factors of the loads at both.
    """
    n = system.layout
    q, y, lam = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("lam", n.lam)
    begin = Begin(
        ca.MX.sym("q0", n.components, n.rotations),
        ca.MX.sym("y0", n.y),
        ca.MX.sym("x0", n.x),
        ca.MX.sym("rates", n.x),
        ca.MX.sym("unwrapped", n.unwrapped),
    )
    return q, y, lam, begin, ca.MX.sym("h"), ca.MX.sym("factors", n.factors, 2)


class Middle:
    """Residual and entries of a step, in the order that the stage equations solve for one stage."""

    def __init__(
        self, system: StageEquations, begin: Begin, h: ca.MX, factors: ca.MX, q: ca.MX, y: ca.MX, lam: ca.MX
    ) -> None:
        model, n = system.model, len(system.model.positions.rows)
        middle, end = (system.given(part) for part in ca.horzsplit(factors))
        places, before = system.displacements(q, y, end), begin.x[: system.axes * system.places]
        moved = system.quantities(q, places, end, begin.unwrapped) - begin.x
        forces = system.forces(moved / h, 2.0 * (moved / h - begin.rates) / h)
        c, b = 1.0 / h, 2.0 / h**2
        linear, tables = forces[: system.linear], system.tables
        gaps, rows = system.open_gaps(y, end), list[tuple[int, ca.MX]]()
        entries, full, coupled = [], [], []
        for number, (group, sides) in enumerate(zip(model.terms, tables.sides, strict=True)):
            count, element = len(group.data), number == 0
            if not count:
                continue
            ends = zip(system.sides(group, begin.q, before), system.sides(group, q, places), strict=True)
            (q0, q1), (u0, u1) = ends
            loads = [system.load(number, given) for given in (middle, end)]
            if element:
                loads[0] += ca.reshape(times(system.by_tangent.T, linear), *loads[0].shape)
            function = system.many(_element(group.kind) if element else _between(group.kind), count)
            data, own = system.data(number, end, begin.unwrapped), system.multipliers(number, lam)
            gradient, stiffness, values, mean, rotation_jacobian = function(q0, u0, q1, u1, data, *loads, own)
            full.append((sides, gradient))
            entries.append(ca.vec(stiffness))
            if element:
                gaps += times(system.closing, ca.vec(values))
                signs, chosen = ca.DM(tables.closed.value), tables.closed.entry
                entries += [picked(ca.vec(part), chosen) * signs for part in (rotation_jacobian, mean)]
                massive = system.massive_columns
                coupled += self._inner(system, mean[:, massive], rotation_jacobian[:, massive], c, b)
            elif group.labels.size:
                rows.append((number, ca.vec(values)))
                entries += [ca.vec(rotation_jacobian), ca.vec(mean)]
        observed = []
        for seen, sides, (first, last) in zip(system.masses.observables, system.observed, system.ranges, strict=True):
            count, width = len(seen.data), seen.kind.sizes[2]
            own = ca.reshape(forces[first:last], width, count)
            sides_of = *system.sides(seen, begin.q, before), *system.sides(seen, q, places)
            nothing, data = ca.MX(0, count), system.seen_data(seen, begin.unwrapped)
            function = system.many(_between(seen.kind), count)
            gradient, stiffness, _, mean, rotation_jacobian = function(*sides_of, data, nothing, nothing, own)
            full.append((sides, gradient))
            entries.append(ca.vec(stiffness))
            weight = b * ca.DM(seen.mass.T) + c * ca.DM(seen.damping.T)
            observed.append(
                ca.vec(system.paired(width, mean.shape[1] // count, count)(mean, rotation_jacobian, weight))
            )
        on_places = times(system.by_place.T, linear) - middle.force
        self.residual = system.gathered(full, on_places, lam[:n, :], [gaps, system.stacked(rows)])
        places_of = [b * system.place_mass.nz[:], c * system.place_drag.nz[:]]
        self.entries = [*entries, ca.MX(1), *observed, *coupled, *places_of]

    @staticmethod
    def _inner(system: StageEquations, mean: ca.MX, rotation_jacobian: ca.MX, c: ca.MX, b: ca.MX) -> list[ca.MX]:
        """What masses within elements add."""
        return system.hung(mean, rotation_jacobian, c, b) if len(system.massive) else []


def check_conserving(system: StageEquations, integrator: str) -> None:
    """Refuse what the scheme cannot follow.

    Raises
    ------
    SceneError
        There is a follower load, which has no energy to conserve, the axes rotate, there are tubes, or sections that
        shear or carry mass off the line.
    """
    model = system.model
    if any(group.follows for group in model.groups.values()):
        name = next(name for name, load in model.scene.loads.items() if load.frame != "fixed")
        message = f"found a follower with the integrator {integrator!r}, accepted: loads with a potential"
        raise SceneError(message, ("loads", name))
    if model.rotating_frame is not None:
        message = f"found with the integrator {integrator!r}, accepted: radau-3, radau-2, generalised-alpha"
        raise SceneError(message, ("rotating",))
    for name in model.scene.tubes:
        message = f"found with the integrator {integrator!r}, which cannot follow a twist without inertia of its own"
        raise SceneError(f"{message}, accepted: radau-3, radau-2, generalised-alpha", ("tubes", name))
    for member in model.scene.members.values():
        section = str(member.section)
        if member.stretches(model.scene.sections) and model.scene.sections[section].compliance(0.5)[0, 1:].any():
            message = (
                f"found with the integrator {integrator!r}, which cannot follow shear without inertia of its own, "
                "accepted: radau-3, radau-2, generalised-alpha, or a section without shear"
            )
            own = model.scene.sections[section]
            key = "shear" if own.shear else "law" if own.law is not None and own.law.form.strains > 1 else "GA2"
            raise SceneError(message, ("sections", section, key))
    for member in model.scene.members.values():
        off = member.off_line(model.scene.sections)
        if off:
            message = f"found {off} with the integrator {integrator!r}, accepted: radau-3, radau-2, generalised-alpha"
            raise SceneError(message, ("sections", str(member.section)))


# -- functions of single things, made once a process ---------------------------------------------------


def _basis(q: ca.SX) -> ca.SX:
    """Derivative of rotations (components, n) by rotation vectors about the fixed axes."""
    if q.shape[0] == 1:
        return ca.SX.eye(q.shape[1])
    blocks = []
    for k in range(q.shape[1]):
        columns = [product([0.0, *axis], ca.vertsplit(q[:, k])) for axis in np.eye(3).tolist()]
        blocks.append(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))
    return ca.diagcat(*blocks)


def _conjugate(q: ca.SX) -> ca.SX:
    return ca.vertcat(q[0], -q[1:])


def _times(a: ca.SX, b: ca.SX) -> ca.SX:
    return ca.vertcat(*product(ca.vertsplit(a), ca.vertsplit(b)))


def _gained(before: ca.SX, after: ca.SX) -> ca.SX:
    """Rodrigues vector from a rotation to another one."""
    if before.shape[0] == 1:
        return 2.0 * ca.tan(0.5 * (after - before))
    r = _times(after, _conjugate(before))
    return 2.0 * r[1:] / r[0]


def _onward(a: ca.SX, b: ca.SX, of_a: ca.SX, of_b: ca.SX) -> ca.SX:
    """Derivative (4, 3) of ``conj(a) b`` by the difference of the spins of b and a, exact for Rodrigues vectors."""
    size = ca.sqrt((1.0 + 0.25 * ca.dot(of_a, of_a)) * (1.0 + 0.25 * ca.dot(of_b, of_b)))
    scalar = (1.0 + 0.25 * ca.dot(of_a, of_b)) / size
    vector = (0.5 * ca.SX.eye(3) - 0.25 * ca.skew(of_a)) / size
    # conj(r_a) r_b - 1: its scalar part is minus the square of its vector over one plus the scalar.
    gain = ca.mtimes(vector, of_b - of_a)
    whole = ca.vertcat(-ca.mtimes(gain.T, vector) / (1.0 + scalar), vector)
    return ca.horzcat(*[_times(_conjugate(a), _times(whole[:, i], b)) for i in range(3)])


def _relative(a0: ca.SX, a1: ca.SX, b0: ca.SX, b1: ca.SX) -> ca.SX:
    """The same, seen from both ends alike; in the plane the derivative of the relative angle."""
    of_a, of_b = _gained(a0, a1), _gained(b0, b1)
    if a0.shape[0] == 1:
        z = 0.5 * (of_b - of_a) / (1.0 + 0.25 * of_a * of_b)
        square = z**2
        small = square < 1e-6
        share = ca.if_else(small, 1.0 - square / 3.0 + square**2 / 5.0, ca.atan(z) / ca.if_else(small, 1.0, z))
        return share / (1.0 + 0.25 * of_a * of_b)
    return 0.5 * (_onward(a0, b0, of_a, of_b) + _onward(a1, b1, -of_a, -of_b))


def _vectors(element: Element, q: ca.SX, u: ca.SX, data: ca.SX) -> list[ca.SX]:
    """Turned and strained tangents of an element at rotations and strains."""
    _, tangent, compliance = element.split(data)
    found = []
    for k in range(q.shape[1]):
        strained = element.strained(tangent[:, k], compliance[:, k], u[:, k]) if element.strains else tangent[:, k]
        found.append(ca.vertcat(*element.forth(ca.vertsplit(q[:, k]), ca.vertsplit(strained))))
    return found


def _strained(element: Element, before: ca.SX, after: ca.SX, compliance: ca.SX) -> ca.SX:
    """Derivative (axes, axes) of the turned tangent of a point by its strains, exact between two states.

    With the change of the turned tangent by the rotation taken at the mean of the two it is ``(1 + w x / 2) R_0 S``,
    where ``w`` is the Rodrigues vector of the rotation between: angular momentum and energy are both kept.
    """
    gained, found = _gained(before, after), []
    for column in ca.horzsplit(ca.reshape(compliance, element.axes, element.axes)):
        v = ca.vertcat(*element.forth(ca.vertsplit(before), ca.vertsplit(column)))
        across = ca.cross(gained, v) if element.space else gained * ca.vertcat(-v[1], v[0])
        found.append(v + 0.5 * across)
    return ca.horzcat(*found)


def _crossed(a: ca.SX, b: ca.SX) -> ca.SX:
    """Moment of a force b at a."""
    return ca.cross(a, b) if a.shape[0] == 3 else a[0] * b[1] - a[1] * b[0]


@functools.cache
def _element(element: Element) -> ca.Function:
    """What :func:`_between` gives of an element: moments, their derivative, chord, rotation Jacobians (mean, end).

    The derivative is that of elastic moments at the mean state, which differs from the exact one by the square of what
    nodes turn in a step; that of all else is exact.
    """
    n, axes = element.order + 1, element.axes
    _, _, _, data_size, load_size = element.sizes
    q0, q1 = ca.SX.sym("q0", element.components, n), ca.SX.sym("q1", element.components, n)
    u0, u1 = ca.SX.sym("u0", axes, element.sizes[1]), ca.SX.sym("u1", axes, element.sizes[1])
    data, load, lam = ca.SX.sym("data", data_size), ca.SX.sym("load", load_size), ca.SX.sym("lam", axes)
    stiffness, tangent, compliance = element.split(data)
    pull = ca.reshape(load, axes, n) + ca.repmat(lam, 1, n)
    slopes = differentiation(element.nodes)
    means = [0.5 * (_strain(slopes[k], k, q0) + _strain(slopes[k], k, q1)) for k in range(n)]
    efforts = [_effort(element, mean, stiffness[:, k]) for k, mean in enumerate(means)]
    moments = _moments(element, q0, q1, efforts)
    before, after = _vectors(element, q0, u0, data), _vectors(element, q1, u1, data)
    mean = [0.5 * (a + b) for a, b in zip(before, after, strict=True)]
    work = ca.vertcat(*[_crossed(mean[k], pull[:, k]) for k in range(n)])
    strains = [
        0.5 * (u0[:, k] + u1[:, k]) + ca.mtimes(_strained(element, q0[:, k], q1[:, k], compliance[:, k]).T, pull[:, k])
        for k in range(element.sizes[1])
    ]
    end, basis = ca.vertcat(ca.vec(q1), ca.vec(u1)), ca.diagcat(_basis(q1), ca.SX.eye(u1.numel()))
    near = ca.mtimes(ca.jacobian(ca.vertcat(_at_mean(element, q0, q1, efforts) + work, *strains), end), basis)
    mean_rotation_jacobian = ca.jacobian(ca.vertcat(work, *strains), lam).T
    gained = ca.sum2(ca.horzcat(*after) - tangent)
    rotation_jacobian = ca.mtimes(ca.jacobian(gained, end), basis)
    gradient = ca.vertcat(moments + work, *strains)
    results = [ca.densify(part) for part in (gradient, near, gained, mean_rotation_jacobian, rotation_jacobian)]
    end = ca.SX.sym("load_end", load_size)
    return ca.Function(f"between_{name_of(element)}", [q0, u0, q1, u1, data, load, end, lam], results)


def _strain(row: Array, k: int, q: ca.SX) -> ca.SX:
    """Half the curvature times the length at node k, in the plane all of it."""
    if q.shape[0] == 1:
        return sum((float(row[j]) * (q[j] - q[k]) for j in range(len(row)) if j != k), ca.SX(0))
    parts = [float(row[j]) * _times(_conjugate(q[:, k]), q[:, j])[1:] for j in range(len(row)) if j != k]
    return sum(parts[1:], parts[0])


def _effort(element: Element, strain: ca.SX, stiffness: ca.SX) -> ca.SX:
    """Derivative of the strain energy of a point by that strain."""
    if not element.space:
        return stiffness * strain
    c = ca.vertsplit(stiffness)
    full = ca.vertcat(ca.horzcat(c[0], c[1], c[2]), ca.horzcat(c[1], c[3], c[4]), ca.horzcat(c[2], c[4], c[5]))
    return 4.0 * ca.mtimes(full, strain)


def _moments(element: Element, q0: ca.SX, q1: ca.SX, efforts: list[ca.SX]) -> ca.SX:
    """Moments on the nodes by the derivatives of an energy by the strains, exact between two states."""
    n, slopes = element.order + 1, differentiation(element.nodes)
    moments = [ca.SX.zeros(element.turns) for _ in range(n)]
    for k, effort in enumerate(efforts):
        for j in range(n):
            if j != k:
                gain = _relative(q0[:, k], q1[:, k], q0[:, j], q1[:, j])
                share = slopes[k, j] * (ca.mtimes(gain[1:, :].T, effort) if element.space else gain * effort)
                moments[j] += share
                moments[k] -= share
    return ca.vertcat(*moments)


def _at_mean(element: Element, q0: ca.SX, q1: ca.SX, values: list[ca.SX]) -> ca.SX:
    """Elastic moments by the derivatives of strains at the mean quaternions."""
    n, slopes = element.order + 1, differentiation(element.nodes)
    q, work = ca.SX.sym("q", element.components, n), ca.SX(0)
    efforts = [ca.SX.sym(f"effort_{k}", element.turns) for k in range(n)]
    for k, effort in enumerate(efforts):
        work += ca.dot(effort, _strain(slopes[k], k, q))
    middle = 0.5 * (q0 + q1)
    (gradient,) = ca.substitute([ca.vec(ca.gradient(work, q))], [q, *efforts], [middle, *values])
    return ca.mtimes(_basis(middle).T, gradient)


def _of_strains(kind: Term, q0: ca.SX, q1: ca.SX, data: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Moments of an energy that is linear in the strains of an element, and their derivative, nearly."""
    element, efforts = kind.efforts(data, load)
    # Strains here are half the curvature in space.
    columns = [(2.0 if element.space else 1.0) * effort for effort in ca.horzsplit(efforts)]
    near = ca.jacobian(_at_mean(element, q0, q1, columns), ca.vec(q1))
    return _moments(element, q0, q1, columns), ca.mtimes(near, _basis(q1))


def _sides(q: ca.SX, u: ca.SX) -> tuple[list[Side], list[Side]]:
    return [ca.vertsplit(one) for one in ca.horzsplit(q)], [ca.vertsplit(one) for one in ca.horzsplit(u)]


def _by_relative(values: Callable[[ca.SX], tuple[ca.SX, ca.SX]], q0: ca.SX, q1: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Gradient of the energy and derivative of the rows of what knows one relative rotation, at the mean of this."""
    components, sides = q0.shape
    ground = ca.SX([1.0, 0.0, 0.0, 0.0]) if components == 4 else ca.SX(0.0)
    (a0, b0), (a1, b1) = (ca.horzsplit(ca.horzcat(ground, q)[:, -2:]) for q in (q0, q1))
    mean = 0.5 * (b0 - a0 + b1 - a1 if components == 1 else _times(_conjugate(a0), b0) + _times(_conjugate(a1), b1))
    p = ca.SX.sym("p", components)
    known = ca.vertcat(*values(ca.horzcat(ground, p)[:, -sides:]))
    across = ca.mtimes(ca.substitute(ca.jacobian(known, p), p, mean), _relative(a0, a1, b0, b1))
    both = ca.horzcat(-across, across)[:, -sides * across.shape[1] :]
    return both[0, :].T, both[1:, :]


@functools.cache
def _between(kind: Term) -> ca.Function:
    """(q0, u0, q1, u1, data, load, load_end, lam) -> gradient, its derivative, rows at the end, both Jacobians.

    The gradient is that of ``energy + lam.rows``; Jacobians are the derivatives of the rows, mean ones (rows, width)
    and those at the end, by rotations about the fixed axes and displacements.
    """
    turns, places, rows, data_size, loads = kind.sizes
    q0, q1 = ca.SX.sym("q0", kind.components, turns), ca.SX.sym("q1", kind.components, turns)
    u0, u1 = ca.SX.sym("u0", kind.axes, places), ca.SX.sym("u1", kind.axes, places)
    data, lam = ca.SX.sym("data", data_size), ca.SX.sym("lam", rows)
    load, load_end = ca.SX.sym("load", loads), ca.SX.sym("load_end", loads)

    def values(q: ca.SX, u: ca.SX, given: ca.SX) -> tuple[ca.SX, ca.SX]:
        sides = _sides(q, u)
        return kind.energy(*sides, data, given), ca.vertcat(ca.SX(0, 1), *kind.residual(*sides, data, given))

    def derivatives(at: ca.SX, moved: ca.SX) -> tuple[ca.SX, ca.SX]:
        q, u = ca.SX.sym("q", *at.shape), ca.SX.sym("u", *moved.shape)
        energy, found = values(q, u, load)
        x, basis = ca.vertcat(ca.vec(q), ca.vec(u)), ca.diagcat(_basis(q), ca.SX.eye(u.numel()))
        results = [ca.mtimes(basis.T, ca.gradient(energy, x)), ca.mtimes(ca.jacobian(found, x), basis)]
        gradient, rotation_jacobian = ca.substitute(results, [q, u], [at, moved])
        return gradient, rotation_jacobian

    arguments = [q0, u0, q1, u1, data, load, load_end, lam]
    if kind.discrete == "strains":
        width = kind.turns * turns
        results = [*_of_strains(kind, q0, q1, data, load), ca.SX(0, 1), ca.SX(0, width), ca.SX(0, width)]
        return ca.Function(f"between_{name_of(kind)}", arguments, [ca.densify(part) for part in results])
    middle = 0.5 * (q0 + q1), 0.5 * (u0 + u1)
    if kind.space and turns:
        middle = ca.horzcat(*[side / ca.norm_2(side) for side in ca.horzsplit(middle[0])]), middle[1]
    if kind.discrete == "ends":
        derivative, mean_rotation_jacobian = (
            0.5 * (a + b) for a, b in zip(derivatives(q0, u0), derivatives(q1, u1), strict=True)
        )
    elif kind.discrete == "relative":
        derivative, mean_rotation_jacobian = _by_relative(lambda q: values(q, u0, load), q0, q1)
    else:
        derivative, mean_rotation_jacobian = derivatives(*middle)
    # Moments that are dead do not change when what they act on turns.
    forces = kind.forces(*_sides(*middle), data, load)
    derivative += ca.vertcat(*forces) if forces else 0.0
    gradient = derivative + ca.mtimes(mean_rotation_jacobian.T, lam)
    end, of_end = ca.vertcat(ca.vec(q1), ca.vec(u1)), ca.diagcat(_basis(q1), ca.SX.eye(u1.numel()))
    changed = ca.mtimes(ca.jacobian(gradient, end), of_end)
    results = [ca.densify(part) for part in (gradient, changed, values(q1, u1, load_end)[1], mean_rotation_jacobian)]
    rotation_jacobian = ca.densify(ca.mtimes(ca.jacobian(values(q1, u1, load_end)[1], end), of_end))
    return ca.Function(f"between_{name_of(kind)}", arguments, [*results, rotation_jacobian])
