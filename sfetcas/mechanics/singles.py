"""CasADi functions of a single vector, rotation or set of rows, made once a process.

They are mapped over all elements, nodes or connections of a model, and may be compiled for that.
"""

from __future__ import annotations

import functools
from typing import TypeVar

import casadi as ca
import numpy as np

from ..mathematics.quaternion import product, turned

__all__ = [
    "arms_product",
    "counted_angle",
    "exponential",
    "fibre_strain",
    "moved_rotation",
    "rotation_between",
    "spin_of",
    "turned_vector",
    "weighted_product",
]

T = TypeVar("T", ca.SX, ca.MX)


def tag(space: bool) -> str:
    """The end of names of functions: ``space`` or ``plane``."""
    return "space" if space else "plane"


@functools.cache
def turned_vector(space: bool) -> ca.Function:
    """``(q, t) -> R(q) t``: a vector rotated by a unit quaternion, in the plane by an angle."""
    q, t = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("t", 3 if space else 2)
    if space:
        now = ca.vertcat(*turned(ca.vertsplit(q), ca.vertsplit(t)))
    else:
        c, s = ca.cos(q), ca.sin(q)
        now = ca.vertcat(c * t[0] - s * t[1], s * t[0] + c * t[1])
    return ca.Function(f"turned_{tag(space)}", [q, t], [now])


@functools.cache
def moved_rotation(space: bool) -> ca.Function:
    """``(q, phi) -> exp(phi / 2) q``, normalised: rotation followed by a rotation vector; in the plane ``q + phi``."""
    q, phi = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("phi", 3 if space else 1)
    if space:
        now = ca.vertcat(*product(ca.vertsplit(exponential(phi)), ca.vertsplit(q)))
        now /= ca.norm_2(now)
    else:
        now = q + phi
    return ca.Function(f"moved_{tag(space)}", [q, phi], [now])


def exponential(phi: T) -> T:
    """Unit quaternion of a rotation vector (3,), smooth at zero."""
    square = 0.25 * ca.dot(phi, phi)
    half = ca.sqrt(ca.fmax(square, 1e-30))
    # sin(x) / x to all digits also where the vector vanishes.
    ratio = ca.if_else(square < 1e-8, 1.0 - square / 6.0, ca.sin(half) / half)
    # As polynomial, so that second derivatives hold where the vector vanishes.
    cosine = ca.if_else(square < 1e-8, 1.0 - 0.5 * square, ca.cos(half))
    return ca.vertcat(cosine, 0.5 * ratio * phi)


@functools.cache
def rotation_between(space: bool) -> ca.Function:
    """``(q, p) ->`` rotation vector from q to p, of at most half a turn; in the plane ``p - q``."""
    q, p = ca.SX.sym("q", 4 if space else 1), ca.SX.sym("p", 4 if space else 1)
    if not space:
        return ca.Function(f"vectors_{tag(space)}", [q, p], [p - q])
    a = ca.vertsplit(q)
    r = ca.vertcat(*product(ca.vertsplit(p), [a[0], -a[1], -a[2], -a[3]]))
    r = ca.if_else(r[0] < 0.0, -1.0, 1.0) * r
    sine = ca.sqrt(ca.fmax(ca.dot(r[1:], r[1:]), 1e-30))
    # The angle over its half sine, to all digits also where it vanishes.
    share = ca.if_else(sine < 1e-6, 2.0, 2.0 * ca.atan2(sine, r[0]) / sine)
    return ca.Function(f"vectors_{tag(space)}", [q, p], [share * r[1:]])


@functools.cache
def spin_of() -> ca.Function:
    """``(q, slope) -> 2 conj(q) slope``: curvature in space of a unit quaternion and its derivative, as a vector."""
    q, slope = ca.SX.sym("q", 4), ca.SX.sym("slope", 4)
    spin = product([q[0], -q[1], -q[2], -q[3]], ca.vertsplit(slope))[1:]
    return ca.Function("spin", [q, slope], [2.0 * ca.vertcat(*spin)])


@functools.cache
def counted_angle() -> ca.Function:
    """``(a, b, axis, across, crossed, unwrapped) ->`` angle of side b relative to side a in space, nearest to
    ``unwrapped``.

    See :class:`~sfetcas.mechanics.unwrapping.Unwrapping`.
    """
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 4)
    axis, across, crossed, unwrapped = (
        ca.SX.sym("axis", 3),
        ca.SX.sym("across", 3),
        ca.SX.sym("crossed"),
        ca.SX.sym("unwrapped"),
    )
    q = ca.vertsplit(a)
    r = product([q[0], -q[1], -q[2], -q[3]], ca.vertsplit(b))
    seen = ca.vertcat(*turned(r, ca.vertsplit(across)))
    sine = ca.if_else(crossed, ca.dot(ca.cross(axis, across), seen), ca.dot(axis, ca.vertcat(*r[1:])))
    cosine = ca.if_else(crossed, ca.dot(across, seen), r[0])
    share = ca.if_else(crossed, 1.0, 2.0)
    raw, period = share * ca.atan2(sine, cosine), 2.0 * ca.pi * share
    angle = raw + period * ca.floor((unwrapped - raw) / period + 0.5)
    return ca.Function("counted_angle", [a, b, axis, across, crossed, unwrapped], [angle])


@functools.cache
def fibre_strain(round_section: bool) -> ca.Function:
    """``(change, reach) ->`` largest bending strain in the fibres of a section.

    ``change`` (3,) is the change of curvature about b1, b2, b3, ``reach`` (2,) the distances of the outermost fibre
    from the axes b2 and b3.  At a corner of a rectangle both bending strains add up, at the rim of a circle they add up
    as vectors.
    """
    change, reach = ca.SX.sym("change", 3), ca.SX.sym("reach", 2)
    if round_section:
        # With a derivative, zero, also where nothing is bent.
        square = ca.dot(change[1:], change[1:])
        strain = reach[0] * ca.sqrt(ca.fmax(square, 1e-300)) * (square > 0.0)
    else:
        strain = reach[0] * ca.fabs(change[1]) + reach[1] * ca.fabs(change[2])
    return ca.Function(f"fibre_{'round' if round_section else 'rectangle'}", [change, reach], [strain])


@functools.cache
def weighted_product(rows: int, width: int) -> ca.Function:
    """``(A, B, w) -> A^T diag(w) B`` for A, B (rows, width) and w (rows,)."""
    a, b, w = ca.SX.sym("a", rows, width), ca.SX.sym("b", rows, width), ca.SX.sym("w", rows)
    return ca.Function(f"pairs_{rows}_{width}", [a, b, w], [ca.densify(ca.mtimes(a.T, ca.repmat(w, 1, width) * b))])


@functools.cache
def arms_product(axes: int, widths: tuple[int, ...], points: int) -> ca.Function:
    """``(A, B, W) ->`` blocks ``W_jl A_j^T B_l`` for A, B with blocks of columns for each point.

    Of each of the ``widths`` there is a block for every point, then come those of the next one.
    """
    columns = np.concatenate([np.repeat(np.arange(points), width) for width in widths]).tolist()
    a, b = ca.SX.sym("a", axes, len(columns)), ca.SX.sym("b", axes, len(columns))
    w = ca.SX.sym("w", points, points)
    whole = ca.mtimes(a.T, b) * w[columns, columns]
    name = "_".join(str(size) for size in (axes, *widths, points))
    return ca.Function(f"inner_{name}", [a, b, w], [ca.densify(whole)])
