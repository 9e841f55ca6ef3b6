"""What fronts between elastic and inelastic parts of members, which lie within elements, leave of the rotations."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array, values_of
from ..mathematics.forms import BOTH, Form
from ..mathematics.hysteresis import lasting, stiffness
from ..mathematics.potentials import derivatives_of
from .fields import Fields, rotations_along
from .laws import law_of
from .mesh import within_elements

__all__ = ["front_errors", "section_axes"]

NEWTON_STEPS = 40
"""At most, to the curvature at which a law gives a moment: finitely many pieces are quadratic."""

SHORTEST = 2.0**-20
"""Share of a step below which it is not shortened."""

LINEAR = 2
"""Degrees up to which the last but one Legendre coefficient is that of a straight line or less."""


def front_errors(fields: Fields) -> tuple[Array, Array, Array]:
    """What each element may turn too much or too little, (elements, 3), rad, about the axes of its section; in a fourth
    column by how much it may be too long or too short, over the size of the scene.

    And the present stiffness of the element over that at rest, (elements,): the harmonic mean over its points; and by
    which share of it stiffnesses at its points differ, (elements,), zero where no front crosses it.

    The curvature of an element is smooth; where a front crosses it that of the member has a kink.  Two estimates are
    added: the inelastic curvature at which the law gives the moments by balance, less that of the element; and the
    highest Legendre coefficients of the latter, which say what integration at the points leaves.  The same is said of
    the strain along where the law depends on it.
    """
    model = fields.model
    found, points = np.zeros((len(model.beams.weight), 4)), model.element.points
    present, mixed = np.ones(len(found)), np.zeros(len(found))
    degree = len(points) - 1
    coefficients = np.linalg.inv(legendre.legvander(2.0 * points - 1.0, degree))
    # A kink in the middle has none of every second degree.
    tails = coefficients[-2:] if degree > LINEAR else coefficients[-1:]
    for name in model.members:
        law, line, part = law_of(model.scene, name), model.scene.center_lines[name], model.elements_of(name)
        if law is None or not law.remembers:
            continue
        cuts = model.mesh.cuts[name]
        x = within_elements(cuts, points).ravel()
        own, balanced, soft = _inelastic(fields, name, x)
        shape = (len(cuts) - 1, len(points), own.shape[1])
        turned = np.diff(cuts)[:, None] * line.length
        rough = np.linalg.norm(np.einsum("tp,npa->nta", tails, own.reshape(shape)), axis=1)
        apart = np.einsum("p,npa->na", model.element.weights, np.abs(balanced - own).reshape(shape))
        found[part, : shape[2]] = turned * (rough + apart)
        soft = soft.reshape(shape[:2])
        present[part] = 1.0 / ((1.0 / soft) @ model.element.weights)
        mixed[part] = 1.0 - soft.min(axis=1) / soft.max(axis=1)
    return found / [1.0, 1.0, 1.0, model.scene.size], present, mixed


def section_axes(fields: Fields, member: str, x: Array) -> Array:
    """Section axes as columns (n, 3, 3) at fractions x (n,) of a member's length."""
    rotation = rotations_along(fields.model, fields.q, member, x)
    if not fields.model.space:
        rotation = quaternion.from_rotation_vector(np.pad(rotation, ((0, 0), (2, 0))))
    return quaternion.matrix(quaternion.multiply(rotation, fields.model.scene.center_lines[member].quaternions(x)))


@functools.cache
def _lasting(form: Form) -> ca.Function:
    x, p = ca.SX.sym("x", form.arguments), ca.SX.sym("p", form.size)
    results = [ca.densify(lasting(form, x, p)), stiffness(form, p)]
    return ca.Function(f"lasting_{form}", [x, p], results, {"cse": True})


def _inelastic(fields: Fields, member: str, x: Array) -> tuple[Array, Array, Array]:
    """Inelastic curvatures (n, 3), 1/m, and behind them strains where the law depends on them, at the points of all
    elements: of the elements, and of the moments and forces by balance.

    And the least of the slopes of the moments of the elements over those at rest, (n,).

    Points of an elastic part have none of both; as far as moments by balance go they stay elastic.
    """
    model = fields.model
    section, law = model.scene.sections[str(model.scene.members[member].section)], law_of(model.scene, member)
    assert law is not None
    form, values = law.form_in(section), values_of(law.values(section, x))
    memory = model.mesh.memory or {}
    if member in memory:
        values[:, values.shape[1] - form.memory :] = memory[member].variables.reshape(len(x), -1)
    unit, bent, p = values[:, 0], values[:, 1], values[:, 2:]
    axes = [*([1, 2] if form.about == BOTH else [form.about - 1]), *range(3, form.arguments)]
    function = _lasting(form).map(len(x))
    here = np.zeros((len(x), form.arguments))
    here[:, axes] = fields.near(member, x)[:, axes] / bent[:, None]
    found = fields.along(member, x, dimensionless=True)
    acting = np.concatenate([found["moment"] * model.scales.moment, found["force"] * model.scales.force], axis=1)
    about = section_axes(fields, member, x)
    acting = np.einsum("nij,nki->nkj", about, acting.reshape(-1, 2, 3)).reshape(-1, 6)
    if section.shifted:
        acting[:, :3] += np.einsum("nji,nj->ni", section.arms(x), acting[:, 3:])
    acting = acting[:, : form.arguments]
    firm = np.array(function(here.T, p.T)[1]).T
    there = _curvatures(form, here, acting * (bent / unit)[:, None], p, axes, firm)
    own, balanced = (np.array(function(each.T, p.T)[0]).T * bent[:, None] for each in (here, there))
    hessian = _scaled(np.array(derivatives_of(form).map(len(x))(here.T, p.T)[2]), axes, firm)
    return own, balanced, np.linalg.eigvalsh(hessian + np.eye(len(axes)))[:, 0]


def _scaled(hessian: Array, axes: list[int], firm: Array) -> Array:
    """Second derivatives of points beside each other, by what has the stiffnesses at rest (n, m), over these."""
    size, unit = len(hessian), np.sqrt(firm)
    chosen = hessian.T.reshape(-1, size, size)[:, axes][:, :, axes]
    return np.asarray(chosen / unit[:, :, None] / unit[:, None, :])


def _curvatures(form: Form, near: Array, moments: Array, p: Array, axes: list[int], firm: Array) -> Array:
    """Curvatures and strains (n, k) at which a form gives moments and forces (n, k), all dimensionless, about axes.

    By Newton's method downhill on the convex potential less the work of the moments, from curvatures ``near``; with the
    stiffnesses at rest (n, axes) of these.
    """
    here, derivatives = near.copy(), derivatives_of(form)
    # Over what stores one half at rest.
    active, root = np.arange(len(near)), np.sqrt(firm)

    def at(x: Array, which: Array) -> tuple[Array, Array, Array]:
        value, gradient, hessian = derivatives.map(len(which))(x.T, p[which].T)
        scaled, work = x[:, axes] * root[which], moments[which][:, axes] * x[:, axes]
        value = np.array(value).ravel() + 0.5 * (scaled**2).sum(axis=1) - work.sum(axis=1)
        miss = (moments[which][:, axes] - np.array(gradient).T[:, axes]) / root[which] - scaled
        return value, miss, _scaled(np.array(hessian), axes, firm[which]) + np.eye(len(axes))

    value, miss, slope = at(here, active)
    size = np.abs(moments[:, axes] / root).max(initial=1.0)
    for _ in range(NEWTON_STEPS):
        off = np.abs(miss).max(axis=1) > tolerances.DECIMAL * size
        active, value, miss, slope = active[off], value[off], miss[off], slope[off]
        if not len(active):
            break
        step, share = np.linalg.solve(slope, miss[..., None])[..., 0], np.ones(len(active))
        fall = (miss * step).sum(axis=1)
        while True:
            trial = here[active]
            trial[:, axes] += share[:, None] * step / root[active]
            there = at(trial, active)
            bad = (there[0] > value - 0.1 * share * fall + tolerances.DECIMAL * np.abs(value)) & (share > SHORTEST)
            if not bad.any():
                break
            share[bad] *= 0.5
        here[active] = trial
        value, miss, slope = there
    return here
