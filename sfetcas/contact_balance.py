"""A last look at answers in contact: what acts within a stretch has to be something that an obstacle can hold.

A stretch that lies on an obstacle has its shape from that.  An obstacle can push against a force that presses a
member onto it; it cannot pull, and it cannot hold a moment.  Where one acts within a stretch the member would lift
off around it, and the answer is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .arrays import Array
from .errors import SolveError, Status
from .fields import Fields
from .mesh import Touch
from .rotations import STIFF, end_joints

__all__ = ["refuse_lost_forces", "refuse_unbalanced"]

SHARE = 1e-5
"""Forces and moments beside the largest ones that count: contact places leave a thousandth of this."""


def refuse_unbalanced(fields: Fields) -> None:
    """Refuse an answer in contact whose obstacles would have to pull or to hold a moment within a stretch.

    Raises
    ------
    SolveError
        Names the member and the obstacle.
    """
    for touch in fields.model.mesh.touches:
        if touch.to is None:
            continue
        lost = _lost_within(fields, touch)
        if lost:
            detail = f"{touch.member} lies on {touch.contact}, which would have to {lost} within the stretch"
            raise SolveError(Status.FAILED, f"{detail}; the member lifts off there, which was not found", fields.state)


def refuse_lost_forces(fields: Fields, pushes: Sequence[Any]) -> None:
    """Refuse an answer whose reactions and contact forces (N) do not carry the loads.

    Raises
    ------
    SolveError
        Says what is missing.
    """
    scene = fields.model.scene
    if any(spring.type == "translational" and spring.to is None for spring in scene.springs.values()):
        return
    supported = [name for name, node in scene.nodes.items() if node.support != "free"]
    forces = [fields.reaction(name)[0] for name in supported]
    forces += [np.reshape(push, (-1, 3)).sum(axis=0) for push in pushes]
    missing = np.sum([*forces, fields.total_load], axis=0)
    size = max(float(np.abs(force).max()) for force in [*forces, fields.total_load])
    if float(np.abs(missing).max()) > SHARE * size:
        found = ", ".join(f"{entry:.3g}" for entry in missing)
        detail = f"a force of ({found}) N acts where a stretch lies on an obstacle, and was not brought into balance"
        raise SolveError(Status.FAILED, detail, fields.state)


def _lost_within(fields: Fields, touch: Touch) -> str:
    """What the obstacle would have to do, in words; empty where all is well."""
    model, scene = fields.model, fields.model.scene
    cuts, part = model.mesh.cuts[touch.member], model.elements_of(touch.member)
    inner = cuts[1:-1][(cuts[1:-1] > touch.at) & (cuts[1:-1] < float(touch.to or 0.0))]
    forces = np.diff(
        fields.load_before(touch.member, np.stack([np.nextafter(inner, 0.0), inner], axis=1).ravel()), axis=0
    )[::2]
    size = _size(fields)
    for at, force in zip(inner, forces, strict=True):
        normal = fields.obstacle_normal(touch, float(at))
        if float(force @ normal) > SHARE * size:
            return f"pull with {float(force @ normal) * model.scales.force:.3g} N at {at:.6g}"
    turned = model.rotations.turns[part][1:, 0]
    for at, turn in zip(cuts[1:-1], turned, strict=True):
        if touch.at < at < float(touch.to or 0.0) and fields.moment_on(int(turn)) > SHARE * size:
            return f"hold a moment of {fields.moment_on(int(turn)) * model.scales.moment:.3g} N m at {at:.6g}"
    for i, at in enumerate((0.0, 1.0)):
        node = scene.members[touch.member].nodes[i]
        if at not in touch.places or scene.nodes[node].turn not in ("free", "ball"):
            continue
        left = _left_at(fields, node)
        if left > SHARE * size:
            return f"hold a moment of {left * model.scales.moment:.3g} N m at node {node}"
    return ""


def _size(fields: Fields) -> float:
    """Largest force or moment of the scene, dimensionless."""
    found = [1e-12]
    for name in fields.model.members:
        along = fields.along(name, np.array([0.0, 0.5, 1.0]), dimensionless=True)
        found += [float(np.abs(along["force"]).max()), float(np.abs(along["moment"]).max())]
    return max([*found, fields.largest_load])


def _left_at(fields: Fields, node: str) -> float:
    """Moment that nothing at a free node takes, of the members joined to it rigidly, dimensionless."""
    scene, total = fields.model.scene, -fields.own_moment(node)
    for name, member in scene.members.items():
        for i, (at, joint) in enumerate(end_joints(scene, member)):
            if at == node and joint in STIFF and name in fields.model.members:
                moment: Array = fields.along(name, np.array([float(i)]), dimensionless=True)["moment"][0]
                total = total + (2.0 * i - 1.0) * moment
    return float(np.linalg.norm(total + fields.balance.spring_moment(node)))
