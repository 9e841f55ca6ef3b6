"""What joints between members ask of two rotations.

A joint is a function of the two rotations since the undeformed scene and of directions fixed in it; the
derivatives by rotations about the fixed axes come from CasADi, once a process.  A ball asks nothing, a rigid
joint lets both sides share one rotation, and in the plane a hinge asks nothing; so in space the hinge is the
only joint with equations.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from .quaternion import product

__all__ = ["hinge", "hinge_rows"]


def hinge_rows(qa: list[ca.SX], qb: list[ca.SX], normals: ca.SX) -> ca.SX:
    """Twice the components of ``conj(qa) qb`` along two directions (3 x 2) normal to the axis: zero on a hinge."""
    relative = product([qa[0], -qa[1], -qa[2], -qa[3]], qb)[1:]
    return 2.0 * ca.mtimes(normals.T, ca.vertcat(*relative))


@functools.cache
def hinge() -> ca.Function:
    """(q (4 x 2), normals (3 x 2), lam (2)) -> rows (2), their spin (2 x 6), stiffness of lam.rows (6 x 6).

    Spin and stiffness by rotations about the fixed axes of the two sides, on unit quaternions.
    """
    q, normals, lam = ca.SX.sym("q", 4, 2), ca.SX.sym("normals", 3, 2), ca.SX.sym("lam", 2)
    sides = [ca.vertsplit(q[:, i]) for i in range(2)]
    rows = hinge_rows(sides[0], sides[1], normals)
    columns = [[ca.vertcat(*product([0.0, *a], side)) for a in np.eye(3).tolist()] for side in sides]
    spin = 0.5 * ca.diagcat(*[ca.horzcat(*c) for c in columns])
    hessian, gradient = ca.hessian(ca.dot(lam, rows), q)
    radial = [ca.dot(q[:, i], gradient[4 * i : 4 * i + 4]) for i in range(2)]
    stiffness = ca.mtimes(spin.T, ca.mtimes(hessian, spin)) - 0.25 * ca.diag(
        ca.vertcat(*[r for r in radial for _ in range(3)])
    )
    results = [rows, ca.densify(ca.mtimes(ca.jacobian(rows, q), spin)), ca.densify(stiffness)]
    return ca.Function("hinge", [q, normals, lam], results, ["q", "normals", "lam"], ["rows", "spin", "stiffness"])
