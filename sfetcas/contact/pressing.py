"""What obstacles and members do to members in motion that touch them: forces, places and gaps, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.clearances import Rows
from ..mechanics.fields import Fields
from ..mechanics.mesh import Approach, Spot
from .closest import Closest

__all__ = ["pressed", "push_at"]


def push_at(fields: Fields, spot: Spot) -> Array:
    """Force (3,) of an obstacle on a member at a place where it stops it in a motion, across it, N."""
    at, model = np.array([spot.at]), fields.model
    normal = fields.obstacle(spot.contact).normals(fields.positions(spot.member, at), fields.tangents(spot.member, at))
    return np.asarray(-fields.state.lam[model.row_names.index(spot.name)] * normal[0] * model.scales.force)


def pressed(
    fields: Fields, contacts: Sequence[str], friction: Mapping[str | Approach, tuple[Array, bool]]
) -> dict[str, dict[str, Any]]:
    """For each contact between members what :func:`~sfetcas.contact.closest.answers` gives.

    ``friction`` has, for approaches, the force (3,) of friction on the first member, N, and whether it sticks.
    """
    model, found = fields.model, dict[str, dict[str, Any]]()
    entries = sorted(_entries(fields, friction), key=lambda entry: (entry[0], entry[1]["member"], entry[1]["at"]))
    closest = Closest(model.scene)
    for name in contacts:
        own = [entry for contact, entry in entries if contact == name]
        if not own:
            gap = closest.gap(fields, name)
            nothing = {"force": np.zeros(3), "at": None, "gap": gap, "member": None}
            found[name] = {**nothing, "other": None, "other_at": None}
            if model.scene.contacts[name].friction:
                found[name] |= {"friction": np.zeros(3), "sticking": None}
            continue
        found[name] = own[0] if len(own) == 1 else {key: [e[key] for e in own] for key in own[0]}
    return found


def _entries(fields: Fields, friction: Mapping[str | Approach, tuple[Array, bool]]) -> list[tuple[str, dict[str, Any]]]:
    """The contact and what is told of each place where members touch."""
    model, found = fields.model, list[tuple[str, dict[str, Any]]]()
    number = {name: i for i, name in enumerate(model.row_names)}
    for rows in Rows.of(model.connections, model.mesh):
        places, _ = rows.located(fields.state.q, fields.displaced)
        for near, at in zip(rows.approaches, places, strict=True):
            at_members = [_along(fields, near, side, float(at[side])) for side in (0, 1)]
            one, other = (
                fields.positions(member, np.array([x]))[0] for member, x in zip(near.members, at_members, strict=True)
            )
            apart = float(np.linalg.norm(one - other))
            force = -fields.state.lam[number[near.name]] * (one - other) / apart * model.scales.force
            told = {"force": force, "at": at_members[0], "gap": apart - near.distance, "member": near.members[0]}
            if model.scene.contacts[near.contact].friction:
                along, sticks = friction.get(near, (np.zeros(3), False))
                told |= {"force": force + along, "friction": along, "sticking": sticks}
            found.append((near.contact, {**told, "other": near.members[1], "other_at": at_members[1]}))
    return found


def _along(fields: Fields, near: Approach, side: int, at: float) -> float:
    """A fraction of an element as one of the length of its member."""
    member, e = near.members[side], near.elements[side]
    if fields.model.scene.members[member].type == "rigid":
        return float(np.clip(at, 0.0, 1.0))
    begin, end = fields.model.mesh.cuts[member][e : e + 2]
    return float(np.clip(begin + at * (end - begin), 0.0, 1.0))
