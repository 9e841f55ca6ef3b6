"""Final check of answers in contact: within a stretch no load may act that an obstacle cannot balance.

On a stretch the member has the shape of its obstacle.  An obstacle can push against a force that presses a member onto
it; it can neither pull nor exert a moment.  Where a load would need that the member would lift off around it, and the
answer is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mechanics.fields import Fields
from .touches import Touched

__all__ = ["refuse_lost_forces", "refuse_unbalanced"]

SHARE = 1e-5
"""Smallest forces and moments that count, share of the largest; errors of contact places are a thousandth of this."""


def refuse_unbalanced(fields: Fields) -> None:
    """Refuse an answer in contact with a tensile contact force or a contact moment within a stretch.

    Raises
    ------
    SolveError
        There is one; the message names the member and the obstacle.
    """
    for touch in fields.model.mesh.touches:
        if touch.to is None:
            continue
        lost = Touched.of(fields).opened(touch, SHARE)
        if lost is not None:
            where = f"at node {lost.node}" if lost.node else f"at {lost.at:.6g}"
            pulled = lost.pull > lost.couple / fields.model.scales.length
            what = f"pull with {lost.pull:.3g} N" if pulled else f"hold a moment of {lost.couple:.3g} N m"
            detail = f"{touch.member} lies on {touch.contact}, which would have to {what} {where} within the stretch"
            raise SolveError(Status.FAILED, f"{detail}; the member lifts off there, which was not found", fields.state)


def refuse_lost_forces(fields: Fields, pushes: Sequence[Any]) -> None:
    """Refuse an answer whose reactions and contact forces ``pushes``, (3,) or (n, 3) N each, do not balance the loads.

    Raises
    ------
    SolveError
        A force is missing; the message has its components.
    """
    scene = fields.model.scene
    if any(spring.type == "translational" and spring.to is None for spring in scene.springs.values()):
        return
    supported = [name for name, node in scene.nodes.items() if node.support != "free"]
    forces = [fields.reaction(name)[0] for name in supported]
    forces += [np.reshape(push, (-1, 3)).sum(axis=0) for push in pushes]
    missing = np.sum([*forces, fields.total_load], axis=0)
    # Tendons and natural curvature bend what nothing holds from outside: then all forces are rounding.
    least = tolerances.UNIT * fields.model.scales.force
    size = max([least, *(float(np.abs(force).max()) for force in [*forces, fields.total_load])])
    if float(np.abs(missing).max()) > SHARE * size:
        found = ", ".join(f"{entry:.3g}" for entry in missing)
        detail = f"a force of ({found}) N acts where a stretch lies on an obstacle, and was not brought into balance"
        raise SolveError(Status.FAILED, detail, fields.state)
