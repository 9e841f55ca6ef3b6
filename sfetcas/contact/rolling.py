"""Rolling on a plane: its share in the second variation of the energy.

The contact force acts where a member touches, and as it rolls that place moves.  Let a member touch a plane with the
force f and with the curvature kappa away from it.  Rotated by a small angle a it would enter the plane beside the place
by ``a**2 / (2 kappa)``: the place has to rise by this much against the force, so that rolling adds
``f a**2 / (2 kappa)`` to the energy, as a rotational spring of stiffness ``f / kappa`` would.  At a node through which
two members continue smoothly the larger of two curvatures counts.

Source: elimination of the place s from the Lagrangian ``Pi - f g(x, s)``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.mesh import Touch
from ..mechanics.rotations import STIFF, end_joints
from ..solvers.prepared import Solved
from .settling import Held

__all__ = ["rolling"]


def rolling(held: Held) -> Solved:
    """The state with the stiffness of rolling added to the entries of the Newton matrix, for tests of stability."""
    corrected, equations = held.corrected, held.prepared.equations
    entries = corrected.point.entries.copy()
    for turn, axis, stiffness in _rolled(held):
        tables = equations.tables
        cells = slice(tables.width * turn, tables.width * (turn + 1))
        unknowns, about = tables.unknown[cells], tables.weight[cells] * axis[3 - tables.width :]
        for i, a in zip(unknowns, about, strict=True):
            for j, b in zip(unknowns, about, strict=True):
                if i >= 0 and j >= 0:
                    entries[(equations.row == i) & (equations.column == j)] += stiffness * a * b
    return replace(corrected, point=replace(corrected.point, entries=entries))


def _rolled(held: Held) -> Iterator[tuple[int, Array, float]]:
    """Number of the rotation, axis (3,) and dimensionless stiffness for each place that rolls on a plane."""
    touched, model = held.touched, held.prepared.model
    flat = [t for t in held.mesh.touches if t.to is None and touched.obstacles[t.contact].kind == "flat" and not t.flat]
    for touch in flat:
        if 0.0 < touch.at < 1.0 and model.scene.members[touch.member].type == "flexible":
            cut = int(np.argmin(np.abs(held.mesh.cuts[touch.member] - touch.at)))
            turn = int(model.chain(touch.member)[cut * held.mesh.order])
            yield from _resisting(held, turn, touch, touched.gap_curvature(touch), touched.push(touch))
    nodes = {id(t): model.scene.members[t.member].node_at(t.at) for t in flat}
    for contact, node in sorted({(t.contact, node) for t in flat if (node := nodes[id(t)])}):
        touches = [t for t in flat if (t.contact, nodes[id(t)]) == (contact, node)]
        sides = _smooth(held, touches[0], node)
        turn_of_node = model.rotations.node_turn[node]
        if sides and turn_of_node is not None:
            curvature = max(touched.gap_curvature(side) for side in sides)
            yield from _resisting(held, turn_of_node, touches[0], curvature, sum(touched.push(t) for t in touches))


def _resisting(
    held: Held, turn: int, touch: Touch, curvature: float, push: float
) -> Iterator[tuple[int, Array, float]]:
    if curvature > 0.0 < push:
        tangent = held.touched.fields.tangents(touch.member, np.array([touch.at]))[0]
        axis = np.cross(tangent, held.touched.normal(touch, touch.at))
        yield turn, axis, push / curvature / held.prepared.model.scales.moment


def _smooth(held: Held, touch: Touch, node: str) -> list[Touch]:
    """The touch on both members that go on through a node along the obstacle; none at a corner or an end."""
    touched, scene = held.touched, held.prepared.model.scene
    sides = [
        replace(touch, member=name, at=float(i))
        for name, member in scene.members.items()
        for i, at in enumerate(member.nodes)
        if at == node and member.type == "flexible" and end_joints(scene, member)[i][1] in STIFF
    ]
    if len(sides) != 2:
        return []
    normal = touched.normal(touch, touch.at)
    tangents = [touched.fields.tangents(side.member, np.array([side.at]))[0] for side in sides]
    out = [(1.0 - 2.0 * side.at) * tangent for side, tangent in zip(sides, tangents, strict=True)]
    along = np.linalg.norm(out[0] + out[1]) < tolerances.PARALLEL and abs(float(out[0] @ normal)) < tolerances.PARALLEL
    return sides if along else []
