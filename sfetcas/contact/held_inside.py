"""Nodes that are held inside obstacles, where nothing can move them out."""

from __future__ import annotations

import numpy as np

from ..description.obstacles import members_of
from ..description.scene import Scene
from ..errors import SolveError, Status
from ..mechanics.balance import three
from ..solvers.prepared import Prepared

__all__ = ["refuse_held_inside"]

DEEP = 1e-6
"""How deep inside a node may be held, share of the size of the scene: a motion that ends on an obstacle is rounded."""


def refuse_held_inside(scene: Scene, pilot: Prepared, factor: float) -> None:
    """Refuse a node that a support or a motion fixes inside an obstacle at a factor.

    Raises
    ------
    SolveError
        There is one; the message names it and the obstacle.
    """
    model = pilot.model
    axes = model.element.axes
    shifts = model.loading(factor).shift.reshape(-1, axes) * model.scales.length
    for contact, stop in scene.obstacles.items():
        members = [scene.members[name] for name in members_of(scene.contacts[contact], scene.members)]
        for node in dict.fromkeys(n for member in members for n in member.nodes):
            record = scene.nodes[node]
            if stop.kind == "sharp" or record.support == "free" or record.slides:
                continue
            place = three(np.asarray(record.position)[:axes] + shifts[model.segments.place(node)])
            gap = float(stop.gaps(place[None, :], np.zeros((1, 3)))[0]) - scene.contacts[contact].member_radius
            if gap < -DEEP * scene.size:
                detail = f"node {node} is held {-gap:.3g} m inside contacts.{contact}"
                raise SolveError(Status.INFEASIBLE, detail)
