"""Final check of answers in contact: reactions, contact forces and what else acts from outside are in balance.

On a stretch the obstacle carries what presses the member onto it, whatever that is; a force that got lost there would
leave no other trace.
"""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from .solution import Equilibrium

__all__ = ["refuse_lost_forces"]


def refuse_lost_forces(answer: Equilibrium) -> None:
    """Refuse an answer whose reactions and contact forces do not balance what else acts from outside.

    Raises
    ------
    SolveError
        A force is missing; the message has its components.
    """
    scene = answer.model.scene
    forces = [answer.reaction(name)[0] for name, node in scene.nodes.items() if node.support != "free"]
    # What a node carries that pushes members is a part of the structure.
    fixed = [name for name, stop in scene.obstacles.items() if stop.carrier is None]
    forces += [np.reshape(answer.contacts[name]["force"], (-1, 3)).sum(axis=0) for name in fixed]
    forces.append(answer.fields.outer_force)
    missing = np.sum(forces, axis=0)
    # Tendons and natural curvature bend what nothing holds from outside: then all forces are rounding.
    least = tolerances.UNIT * answer.model.scales.force
    size = max([least, *(float(np.abs(force).max()) for force in forces)])
    if float(np.abs(missing).max()) > tolerances.LOST * size:
        found = ", ".join(f"{entry:.3g}" for entry in missing)
        detail = f"reactions, contact forces and loads are out of balance by ({found}) N"
        raise SolveError(Status.FAILED, detail, answer.state)
