"""What obstacles and members do to members in motion that touch them: forces, places and gaps, by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.clearances import Rows
from ..mechanics.fields import Fields
from ..mechanics.mesh import Approach, Spot
from .closest import Closest, first_there
from .pairs import Near

__all__ = ["pressed", "push_at"]

Touch = tuple[Near, Array, Array, bool]
"""Where members touch, the forces (3,) across and along the surfaces on the first one, N, and whether it sticks."""


def push_at(fields: Fields, spot: Spot, force: float | None = None) -> Array:
    """Force (3,) of an obstacle on a member at a place where it stops it in a motion, across it, N.

    ``force`` is how large it is, by default what balances the state.
    """
    at, model = np.array([spot.at]), fields.model
    normal = fields.obstacle(spot.contact).normals(fields.positions(spot.member, at), fields.tangents(spot.member, at))
    force = -float(fields.state.lam[model.row_names.index(spot.name)]) * model.scales.force if force is None else force
    return np.asarray(force * normal[0])


def pressed(
    fields: Fields,
    contacts: Sequence[str],
    friction: Mapping[str | Approach, tuple[Array, bool]],
    pushed: Mapping[str | Approach, float],
) -> dict[str, dict[str, Any]]:
    """For each contact between members what :func:`~sfetcas.contact.closest.answers` gives.

    ``friction`` has, for approaches, the force (3,) of friction on the first member, N, and whether it sticks;
    ``pushed`` that across surfaces, N, where it is not what balances the state.
    """
    scene, found = fields.model.scene, dict[str, dict[str, Any]]()
    closest = Closest(scene)
    touches = _once_each(closest, _touches(fields, friction, pushed))
    for name in contacts:
        contact = scene.contacts[name]
        own = list[dict[str, Any]]()
        for near, across, along, sticks in touches:
            if near.contact == name:
                places = zip(near.members, near.at, strict=True)
                (member, at), (other, other_at) = (first_there(scene, contact, *place) for place in places)
                told = {"force": across + along, "at": at, "gap": near.gap, "member": member}
                told |= {"friction": along, "sticking": sticks} if contact.friction else {}
                own.append({**told, "other": other, "other_at": other_at})
        if not own:
            gap = closest.gap(fields, name)
            nothing = {"force": np.zeros(3), "at": None, "gap": gap, "member": None}
            found[name] = {**nothing, "other": None, "other_at": None}
            if contact.friction:
                found[name] |= {"friction": np.zeros(3), "sticking": None}
            continue
        found[name] = own[0] if len(own) == 1 else {key: [e[key] for e in own] for key in own[0]}
    return found


def _touches(
    fields: Fields, friction: Mapping[str | Approach, tuple[Array, bool]], pushed: Mapping[str | Approach, float]
) -> list[Touch]:
    """Where members touch, as approaches have it."""
    model, found = fields.model, list[Touch]()
    number = {name: i for i, name in enumerate(model.row_names)}
    for rows in Rows.of(model.connections, model.mesh):
        places, _ = rows.located(fields.state.q, fields.displaced)
        for near, at in zip(rows.approaches, places, strict=True):
            one_at, other_at = (_along(fields, near, side, float(at[side])) for side in (0, 1))
            one, other = (
                fields.positions(member, np.array([x]))[0]
                for member, x in zip(near.members, (one_at, other_at), strict=True)
            )
            apart = float(np.linalg.norm(one - other))
            normal = (one - other) / apart
            force = pushed.get(near, -float(fields.state.lam[number[near.name]]) * model.scales.force)
            across = force * normal
            place = Near(near.contact, near.members, (one_at, other_at), normal, apart - near.distance, near.distance)
            found.append((place, across, *friction.get(near, (np.zeros(3), False))))
    return found


def _once_each(closest: Closest, touches: Iterable[Touch]) -> list[Touch]:
    """Touches by members and places; where members end at the same node, they are one, with the sum of their forces."""
    found, at_node = dict[int, Touch](), dict[tuple[str, str], list[Near]]()
    # Few touch at nodes: all the others are looked at once.
    for near, across, along, sticks in sorted(touches, key=lambda one: (one[0].contact, one[0].members[0], one[0].at)):
        same = closest.known_at_node(near, at_node)
        if same is None:
            found[id(near)] = near, across, along, sticks
        else:
            known, pushes, rubs, stuck = found[id(same)]
            # Where the first member of one is the second one of the other it feels the opposite.
            sign = float(np.sign(near.normal @ known.normal))
            found[id(same)] = known, pushes + sign * across, rubs + sign * along, stuck and sticks
    return list(found.values())


def _along(fields: Fields, near: Approach, side: int, at: float) -> float:
    """A fraction of an element as one of the length of its member."""
    member, e = near.members[side], near.elements[side]
    if fields.model.scene.members[member].type == "rigid":
        return float(np.clip(at, 0.0, 1.0))
    begin, end = fields.model.mesh.cuts[member][e : e + 2]
    return float(np.clip(begin + at * (end - begin), 0.0, 1.0))
