"""What tendons along a member carry at its sections, beside what the sections carry themselves.

Equilibrium gives the moment and the force of all that goes through a cut, tendons among them.  With the tension ``T``
and the unit vector ``tau`` along the tendon it carries the force ``T tau`` and the moment ``d x T tau`` about the
centre line.  ``tau`` depends on the curvature, which is that of the moment of the section alone: the curvature ``k``
solves

    C (k - k_0) + sum d x T tau(k) = moment through the cut,

the condition of a minimum of a convex function, from the derivative of the interpolated rotations in a few steps of
Newton's method, so that the answer is as accurate as the moment.  Where the member stretches, ``tau`` depends on its
strain, too, which is interpolated from the points.  All vectors are in the axes of the undeformed scene
that turn with the sections.
"""

from __future__ import annotations

import functools
from typing import Any

import casadi as ca
import numpy as np

from ..description.tendons import Stretch, tangent
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers
from .beams import in_fixed_axes
from .stations import Stations

__all__ = ["NEWTON_STEPS", "section_data", "share_of", "stretches_of"]

NEWTON_STEPS = 3
"""Newton steps from the interpolated curvature: each squares its error."""


def stretches_of(scene: Any, member: str) -> list[tuple[str, Stretch]]:
    """The stretches of tendons along a member, with the names of the tendons."""
    return [
        (name, piece)
        for name, pieces in scene.tendon_pieces.items()
        for piece in pieces
        if isinstance(piece, Stretch) and piece.member == member
    ]


def section_data(model: Any, member: str, x: Array, scales: Any) -> Array:
    """Data (n, numbers) of :func:`share_of` at fractions x (n,) of a member, dimensionless.

    The stiffness of the section, then for each stretch the derivative of its places, its arm, and 1 where it is there.
    """
    scene, axes = model.scene, model.element.axes
    line, cuts = (
        scene.center_lines[member],
        np.asarray(getattr(model.mesh.cuts[member], "values", model.mesh.cuts[member])),
    )
    at = Stations(model.element, cuts, x)
    middle = 0.5 * (cuts[at.elements] + cuts[at.elements + 1])
    values = np.zeros((len(x), 3))
    if scene.members[member].type == "flexible":
        section = scene.sections[str(scene.members[member].section)]
        values = section.stiffness_matrix(x) if section.coupled and model.space else section.stiffness(x)
        values = values / (scales.moment * scales.length)
    frames = quaternion.matrix(line.quaternions(x))
    parts = [in_fixed_axes(values, frames, model.element, line.bending_axis)]
    for _, piece in stretches_of(scene, member):
        forward, arm = tangent(piece.way, line, x, middle)
        there = ((middle > piece.start) & (middle < piece.end)).astype(float)
        parts += [forward[:, :axes], arm[:, :axes] / scales.length, there[:, None]]
    return numbers(np.concatenate(parts, axis=1))


@functools.cache
def share_of(space: bool, count: int, steps: int) -> ca.Function:
    """``(moment, guess, natural, strain, data, tensions) ->`` moment and force of the tendons at a section,
    dimensionless.

    ``moment`` is that through the cut and ``guess`` the change of the curvature, from which so many steps begin;
    without steps it is the change of the curvature itself.  ``natural`` is what actuations add to the natural curvature
    and ``strain`` what stretch and shear add to the tangent, in the axes before the rotation.
    """
    turns, axes, stiff = (3, 3, 6) if space else (1, 2, 1)
    moment, guess = ca.SX.sym("moment", turns), ca.SX.sym("guess", turns)
    natural, strain = ca.SX.sym("natural", turns), ca.SX.sym("strain", axes)
    data, tensions = ca.SX.sym("data", stiff + count * (2 * axes + 1)), ca.SX.sym("tensions", count)
    c = ca.vertsplit(data[:stiff])
    section = data[0]
    if space:
        rows = ([c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]])
        section = ca.vertcat(*(ca.horzcat(*row) for row in rows))

    def carried(bent: ca.SX) -> tuple[ca.SX, ca.SX]:
        about, along = ca.SX.zeros(turns), ca.SX.zeros(axes)
        for i in range(count):
            own = data[stiff + i * (2 * axes + 1) : stiff + (i + 1) * (2 * axes + 1)]
            forward, arm, there = own[:axes], own[axes : 2 * axes], own[2 * axes]
            way = forward + strain + (ca.cross(bent, arm) if space else bent * ca.vertcat(-arm[1], arm[0]))
            force = tensions[i] * there * way / ca.norm_2(way)
            about += ca.cross(arm, force) if space else arm[0] * force[1] - arm[1] * force[0]
            along += force
        return about, along

    bent = ca.SX.sym("bent", turns)
    missing = ca.mtimes(section, bent - natural) + carried(bent)[0] - moment
    slope = ca.jacobian(missing, bent)
    given = [moment, natural, strain, data, tensions]
    step = ca.Function("step", [bent, *given], [bent - ca.solve(slope, missing)])
    here = guess
    for _ in range(steps):
        here = step(here, *given)
    results = [ca.densify(part) for part in carried(here)]
    name = f"share_{'space' if space else 'plane'}_{count}_{steps}"
    return ca.Function(name, [moment, guess, natural, strain, data, tensions], results, {"cse": True})
