"""Final check of answers in contact: reactions, contact forces, pulls of the ground and loads are in balance.

On a stretch the obstacle carries what presses the member onto it, whatever that is; a force that got lost there would
leave no other trace.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .. import tolerances
from ..description.tendons import Hole, Stretch
from ..errors import SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from .solution import Equilibrium

__all__ = ["refuse_lost_forces"]


def refuse_lost_forces(answer: Equilibrium) -> None:
    """Refuse an answer whose reactions, contact forces and pulls of the ground do not balance its loads.

    Raises
    ------
    SolveError
        A force is missing; the message has its components.
    """
    scene = answer.model.scene
    if any(spring.type == "translational" and spring.to is None for spring in scene.springs.values()):
        return
    forces = [answer.reaction(name)[0] for name, node in scene.nodes.items() if node.support != "free"]
    # What a node carries that pushes members is a part of the structure.
    fixed = [name for name, stop in scene.obstacles.items() if stop.carrier is None]
    forces += [np.reshape(answer.contacts[name]["force"], (-1, 3)).sum(axis=0) for name in fixed]
    forces += [pull for name in scene.tendons for pull in _pulls_of_ground(answer, name)]
    forces.append(answer.fields.total_load)
    missing = np.sum(forces, axis=0)
    # Tendons and natural curvature bend what nothing holds from outside: then all forces are rounding.
    least = tolerances.UNIT * answer.model.scales.force
    size = max([least, *(float(np.abs(force).max()) for force in forces)])
    if float(np.abs(missing).max()) > tolerances.LOST * size:
        found = ", ".join(f"{entry:.3g}" for entry in missing)
        detail = f"reactions, contact forces and loads are out of balance by ({found}) N"
        raise SolveError(Status.FAILED, detail, answer.state)


def _pulls_of_ground(answer: Equilibrium, name: str) -> Iterator[Array]:
    """Forces (3,), N, with which a tendon pulls the system towards points of the ground that are on its way."""
    scene, found = answer.model.scene, answer.tendon(name)
    pieces, tendon = scene.tendon_pieces[name], scene.tendons[name]
    tensions = found.get("tensions") or [found["tension"]] * len(pieces)
    for piece, tension in zip(pieces, reversed(tensions) if tendon.pulled_at == "end" else tensions, strict=True):
        if isinstance(piece, Stretch):
            continue
        first, last = (hole.node is None and hole.member is None for hole in piece)
        way = _place(answer, piece[1]) - _place(answer, piece[0])
        length = float(np.linalg.norm(way))
        if first != last and length > 0.0:
            yield (1.0 if last else -1.0) * tension / length * way


def _place(answer: Equilibrium, hole: Hole) -> Array:
    """Where a hole of a tendon is, (3,) m."""
    turned: Array | None = None
    base = hole.position
    if hole.node is not None:
        turned, base = answer.quaternion(hole.node), answer.position(hole.node)
    elif hole.member is not None:
        found = answer.along(hole.member, np.array([hole.at]))
        turned, base = found["quaternion"][0], found["position"][0]
    return np.asarray(base + (hole.arm if turned is None else quaternion.rotate(turned, hole.arm)))
