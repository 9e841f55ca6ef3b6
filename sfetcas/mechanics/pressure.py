"""Detection of follower loads that have a potential: uniform pressure in the plane.

A force per length p across a member works by p times the area that the member sweeps, less what its ends sweep seen
from the origin.  Where members with the same pressure meet, these shares cancel; where a support fixes the end or
guides it along a line, they follow from its position: pressure on closed rings and on chains with fixed ends has a
potential, a follower on a free end has none.
"""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..description.formulas import Formula
from ..description.loads import Load
from ..description.scene import Scene
from ..description.sections import Table
from ..mathematics.quaternion import conjugate, rotate
from .rotations import end_joints

__all__ = ["is_pressure"]


def is_pressure(scene: Scene) -> bool:
    """Whether all follower loads of a scene are such pressure."""
    # Followers are forces per length of the undeformed member, which is not that of the curve where it stretches.
    if scene.resolved_dimension == "space" or scene.stretches or scene.shifted:
        return False
    # Friction has none.
    if scene.rubs or any(tendon.rubs for tendon in scene.tendons.values()):
        return False
    # By history, of what ends at a node, or within a member at a fraction of its length.
    left: dict[tuple[str | None, str | tuple[str, float]], float] = {}
    size = 0.0
    for load in scene.loads.values():
        if load.frame == "fixed" or load.type == "moment":
            continue
        pressure = _pressure(scene, load)
        if pressure is None:
            return False
        size = max(size, abs(pressure))
        joints = end_joints(scene, scene.members[str(load.member)])
        for (node, joint), at, whole, way in zip(joints, load.part, (0.0, 1.0), (-1.0, 1.0), strict=True):
            if joint == "slot" or joint == "slider":
                return False
            end = node if at == whole else (str(load.member), at)
            left[load.history, end] = left.get((load.history, end), 0.0) + way * pressure
    return all(
        abs(p) <= tolerances.DECIMAL * size or (isinstance(end, str) and scene.nodes[end].support != "free")
        for (_, end), p in left.items()
    )


def _pressure(scene: Scene, load: Load) -> float | None:
    """Force per length to the left of the axis, N/m; None where it is not even or not across the axis alone."""
    member = scene.members[str(load.member)] if load.member is not None else None
    if load.type != "distributed" or member is None or member.type != "flexible":
        return None
    if isinstance(load.profile, Table):
        profile = load.profile.value if len(set(load.profile.value)) == 1 else None
    elif load.profile is None or isinstance(load.profile, float):
        profile = (1.0 if load.profile is None else load.profile,)
    elif isinstance(load.profile, Formula):
        profile = None
    else:
        profile = load.profile.polynomial if not any(load.profile.polynomial[1:]) else None
    line = scene.center_lines[str(load.member)]
    if profile is None or (load.frame == "follower" and line.turning > tolerances.DECIMAL):
        return None
    value, turned = np.asarray(load.vector), line.quaternions(np.zeros(1))
    b2, b3 = (rotate(turned, axis)[0] for axis in np.eye(3)[1:])
    along = value if load.frame == "section" else rotate(conjugate(turned), value)[0]
    if abs(along[0]) > tolerances.DECIMAL * float(np.linalg.norm(along)):
        return None
    left = np.cross([0.0, 0.0, 1.0], rotate(turned, np.eye(3)[0])[0])
    return float(profile[0] * (along[1] * (b2 @ left) + along[2] * (b3 @ left)))
