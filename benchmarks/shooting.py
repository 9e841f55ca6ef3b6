"""The tip of a cantilever that stretches and shears, exactly: its boundary value problem solved by shooting.

Other programs give beams a finite axial and shear stiffness.  Their answers are compared with the exact solution of
that model, which uses nothing of the elements of the package.

Source: J. C. Simo, A finite strain beam formulation, part I, 1985.
"""

from __future__ import annotations

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.equilibria.statics import solve
from sfetcas.mathematics import quaternion
from sfetcas.mathematics.arrays import Array

__all__ = ["exact_tip"]

ROUNDING = 1e-13
"""Tolerance of the integration, relative and absolute, all quantities dimensionless."""


def exact_tip(scene: Scene, axial: float = np.inf, shear: float = np.inf) -> Array:
    """Position (3,) of the tip in m, of a cantilever with one uniform member under a dead force at its tip.

    The equations are integrated from the tip, where the moment is zero, to the root.  The unknown is the rotation of
    the tip; it is right when the root has the rotation of the clamp.  The answer of the package for the inextensible
    beam is the first guess and so chooses the equilibrium.

    Parameters
    ----------
    scene : Scene
        One member from the clamped node to the loaded one.
    axial, shear : float
        EA and GA in N; infinite for an inextensible and for an unshearable beam.
    """
    # Parts of SciPy take long to import.
    from scipy.integrate import solve_ivp
    from scipy.optimize import fsolve

    ((name, member),) = scene.members.items()
    (load,) = scene.loads.values()
    line, section = scene.center_lines[name], scene.sections[str(member.section)]
    begin, length = line.quaternions([0.0])[0], line.length
    bending = np.array([section.GJ or section.EI3, section.EI2 or section.EI3, section.EI3], float)
    unit = bending[2] / length**2
    compliance, flexibility = unit / np.array([axial, shear, shear]), bending[2] / bending
    force, initial = np.array(load.vector) / unit, length * line.curvatures([0.0])[0]

    def rates(_: float, y: Array) -> Array:
        axes = quaternion.matrix(y[None, 3:7])[0]
        tangent = axes @ (np.array([1.0, 0.0, 0.0]) + compliance * (axes.T @ force))
        bent = initial + flexibility * (axes.T @ y[7:])
        turning = 0.5 * quaternion.multiply(y[3:7], np.append(0.0, bent))
        return np.concatenate([tangent, turning, -np.cross(tangent, force)])

    def root(turned: Array) -> Array:
        """Position, quaternion and moment at the root, of a beam whose tip is at the origin."""
        end = quaternion.multiply(guess, quaternion.from_rotation_vector(turned))
        start = np.concatenate([np.zeros(3), end, np.zeros(3)])
        found = solve_ivp(rates, (1.0, 0.0), start, "DOP853", rtol=ROUNDING, atol=ROUNDING)
        return np.asarray(found.y[:, -1])

    def gap(turned: Array) -> Array:
        return quaternion.multiply(quaternion.conjugate(begin), root(turned)[3:7])[1:]

    guess = solve(scene, accuracy=1e-9).last.along(name, [1.0])["quaternion"][0]
    turned, _, code, words = fsolve(gap, np.zeros(3), xtol=ROUNDING, full_output=True)
    # Close to rounding fsolve may say that it no longer improves.
    if np.abs(gap(turned)).max() > 1e3 * ROUNDING:
        raise ArithmeticError(f"shooting ended with code {code}: {words}")
    return line.start - length * root(turned)[:3]
