"""Inertia of small members: masses of linear beam theory, or condensed ones, and how deformations displace them.

A body is taken as particles that its degrees of freedom ``w`` (displacements and rotations of its nodes) displace
linearly.  Rigid motions and small deformations, and the centrifugal forces on these, depend on the particles by

    sum m,   sum m x,   sum m x x^T,   sum m d(w),   sum m x d(w)^T,   sum m |d(w)|^2 = w^T M w.

From a section all follow by quadrature; rotary inertia is that of particles on the section axes with Euler's weights.
Of a condensed mass only M is known, and with it all but the symmetric part of ``sum m x d^T``, which determines
centrifugal forces that strain the body.  A strain is taken to displace particles as it displaces the nodes, which is
true of lumped masses and of all finite elements without rotations at their nodes that pass the patch test.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..description.matrices import rigid_motions
from ..description.scene import Scene
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers
from .bodies import BodyData, body_of, quadrature, shapes_along

__all__ = ["BodyMass", "body_mass", "euler_weights"]


@dataclass(frozen=True, eq=False)
class BodyMass:
    """Inertia of a small member in SI units and the fixed axes of the undeformed scene.

    Attributes
    ----------
    rest : ndarray (n, 3)
        Positions of the nodes relative to the first one, m.
    mass : float
        kg.
    centre : ndarray (3,)
        Centre of mass relative to the first node, m.
    spread : ndarray (3, 3)
        Sum of ``m x x^T`` about the centre, kg m2.
    shift : ndarray (3, 6 n)
        Displacement of the centre by the degrees of freedom.
    shear : ndarray (3, 3, 6 n)
        Sum of ``m x_a d_b`` about the centre, by the degrees of freedom.
    matrix : ndarray (6 n, 6 n)
        The mass matrix; kg, kg m, kg m2.
    """

    rest: Array
    mass: float
    centre: Array
    spread: Array
    shift: Array
    shear: Array
    matrix: Array


def euler_weights(inertia: Array) -> Array:
    """Weights of axes (..., 3) as particles that have the moments of inertia (..., 3) about them, in the same unit."""
    return numbers(0.5 * inertia.sum(axis=-1, keepdims=True) - inertia)


def body_mass(scene: Scene, name: str) -> BodyMass | None:
    """Inertia of a small member; None for one without mass."""
    body = body_of(scene, name)
    if body.weight is None or body.weight.total <= 0.0:
        return None
    if body.mass is None:
        return _from_section(scene, name, body)
    return _from_matrix(body.mass, body.rest, body.weight.total, body.weight.first / body.weight.total)


def _from_section(scene: Scene, name: str, body: BodyData) -> BodyMass:
    line, section = scene.center_lines[name], scene.sections[str(scene.members[name].section)]
    x, w = quadrature(scene, name)
    shapes = shapes_along(scene, name, x) @ _possible(body.stiff, body.rest)
    moved, turned = shapes[:, :3], shapes[:, 3:]
    share, places = section.mass(x) * w * line.length, line.positions(x) - line.positions(np.array([0.0]))[0]
    mass = float(share.sum())
    centre = share @ places / mass
    arms = places - centre
    # Rotary inertia: particles on the section axes, which turn with the section.
    inertia, axes = section.inertia(x) * (w * line.length)[:, None], quaternion.matrix(line.quaternions(x))
    weights = euler_weights(inertia)
    spins = np.cross(turned[:, :, None, :], axes[:, :, :, None], axis=1)
    return BodyMass(
        rest=body.rest,
        mass=mass,
        centre=centre,
        spread=np.einsum("n,na,nb->ab", share, arms, arms) + np.einsum("ni,nai,nbi->ab", weights, axes, axes),
        shift=np.einsum("n,nak->ak", share, moved) / mass,
        shear=np.einsum("n,na,nbk->abk", share, arms, moved) + np.einsum("ni,nai,nbik->abk", weights, axes, spins),
        matrix=np.einsum("n,nak,nal->kl", share, moved, moved)
        + np.einsum("ni,nai,nak,nbi,nbl->kl", inertia, axes, turned, axes, turned, optimize=True),
    )


def _possible(stiff: Array, rest: Array) -> Array:
    """What is left of the freedoms (6 n, 6 n) without deformations that do not exist, which moves as one."""
    size = float(np.abs(rest).max())
    unit = np.tile([size, size, size, 1.0, 1.0, 1.0], len(rest))
    rows = stiff * unit
    kept = np.eye(len(unit)) - np.linalg.pinv(rows, rcond=tolerances.RANK) @ rows
    return np.asarray(unit[:, None] * kept / unit)


def _from_matrix(matrix: Array, rest: Array, mass: float, centre: Array) -> BodyMass:
    motions = rigid_motions(rest)
    ends = motions.T @ matrix
    shift, across = ends[:3] / mass, np.cross(np.eye(3), centre).T
    # About the centre: moments of inertia, angular momentum of the freedoms, and the rotation that has the same.
    inertia = ends[3:] @ motions[:, 3:] - mass * across.T @ across
    momentum = ends[3:] - mass * across.T @ shift
    turning = np.linalg.pinv(inertia, rcond=tolerances.RANK, hermitian=True) @ momentum
    spread = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    spins = np.cross(turning[:, None, :], np.eye(3)[:, :, None], axis=0)
    shear = np.einsum("aj,bjk->abk", spread, spins)
    relative = matrix - mass * shift.T @ shift - momentum.T @ turning
    shear = shear + _strained(relative, spread, rest - centre)
    return BodyMass(rest, mass, centre, spread, shift, shear, matrix)


def _strained(relative: Array, spread: Array, arms: Array) -> Array:
    """Symmetric part of the shear (3, 3, 6 n): strains in the principal axes, which displace the nodes as all else.

    ``relative`` is the mass without rigid motions.  Of each strain it holds a mass k, and particles of this spread have
    another, c, the same where nodes and particles do move alike; the smaller one keeps the rest of the energy positive.
    """
    values, axes = np.linalg.eigh(spread)
    present = np.flatnonzero(values > tolerances.RANK * values[-1])
    shear, left = np.zeros((3, 3, len(relative))), relative
    for i, j in itertools.combinations_with_replacement(present, 2):
        dyad = np.outer(axes[:, i], axes[:, j])
        # A shear of particles beside the rotation that it has: their reduced spread.
        strain, own = (dyad, values[i]) if i == j else (dyad + dyad.T, 4.0 / (1.0 / values[i] + 1.0 / values[j]))
        moved = np.hstack([arms @ strain, np.zeros_like(arms)]).ravel()
        momentum = left @ moved
        momentum = momentum * own / max(own, float(moved @ momentum))
        shear += np.multiply.outer(strain if i == j else 0.5 * strain, momentum)
        left = left - np.outer(momentum, momentum) / own
    return shear
