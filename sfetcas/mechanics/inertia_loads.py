"""What acts on masses as loads along members: between the ends of rigid members, and on section axes.

Masses of a rigid member move its ends and turn it as a whole.  Along it what acts on them is spread: its shares at the
ends are taken back, so that its balance is as it was, and section forces are those of the masses where they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from .load_terms import pull_within
from .mesh import within_elements

__all__ = ["along_rigid", "couples_along", "put_moments", "without_rigid"]


def put_moments(at: Index | None, moments: Array, couple: Array, jump: Array) -> None:
    """Add moments (n, 3) in place to ``couple`` (places, 3) and ``jump`` (elements, 3).

    ``at`` says where, as that of :class:`~sfetcas.mechanics.masses.Observables`.
    """
    for sums, number in () if at is None else zip((couple, jump), at.T, strict=True):
        np.add.at(sums, number[number >= 0], moments[number >= 0])


def along_rigid(model: Any, mass: Array, pushes: Array) -> tuple[Array, Array]:
    """What masses along straight rigid members add to the distributed forces and to the pull, (elements, p + 1, axes).

    Their ends have the forces already: what is added is in balance, and changes section forces between the ends alone.

    Parameters
    ----------
    mass : ndarray (elements, p + 1)
        As of :class:`~sfetcas.mechanics.masses.RigidMasses`.
    pushes : ndarray (places, axes)
        Forces on a unit of mass at the places, between which they are linear.
    """
    spread = np.zeros((*mass.shape, pushes.shape[1]))
    pull = np.zeros_like(spread)
    for name, part in _rigid(model, mass):
        cuts, places = model.mesh.cuts[name], model.segments
        start, end = (pushes[places.place(places.ends[name, i])] for i in range(2))
        x = within_elements(cuts, model.element.nodes)[..., None]
        forces = mass[part][..., None] * ((1.0 - x) * start + x * end)
        on_element = forces.sum(axis=1)
        beyond = np.cumsum(on_element[::-1], axis=0)[::-1] - on_element
        at_end = (x * forces).sum(axis=(0, 1))
        spread[part], pull[part] = forces, pull_within(forces, model.element) + (at_end - beyond)[:, None]
    return spread, pull


def couples_along(model: Any, q: Array, spins: Array, forces: Array) -> Array:
    """Couples (elements, p + 1, turns) at the nodes of elements by what acts on axes that turn with them.

    Parameters
    ----------
    q : ndarray (rotations, components)
    spins : ndarray (elements, p + 1, 3, 3)
        As of :class:`~sfetcas.mechanics.masses.Masses`.
    forces : ndarray (rotations or 1, axes, axes)
        Matrices that give the force on a unit of mass from a turned axis.
    """
    axes, turns = forces.shape[-1], model.rotations.turns
    columns = np.swapaxes(quaternion.turned_by(q[:, None], np.eye(axes)), 1, 2)[turns]
    spread = np.einsum("ekij,ekjl,ekml->ekim", columns, spins[..., :axes, :axes], columns)
    across = np.einsum("ekjl,ekml->ekjm", spread, np.broadcast_to(forces, (len(q), axes, axes))[turns])
    pairs = ((1, 2), (2, 0), (0, 1)) if axes == 3 else ((0, 1),)
    return np.stack([across[..., j, k] - across[..., k, j] for j, k in pairs], axis=-1)


def without_rigid(model: Any, couples: Array, moment: Array, jump: Array) -> None:
    """Take couples (elements, p + 1, turns) along rigid members from the ``moment`` (rotations, 3) on these as wholes,
    and from the ``jump`` (elements, 3) at their starts, in place.
    """
    for name, part in _rigid(model, couples):
        total = np.pad(couples[part].sum(axis=(0, 1)), (3 - couples.shape[2], 0))
        moment[int(model.rotations.ends[name][0])] -= total
        jump[part.start] -= total


def _rigid(model: Any, along: Array) -> Iterator[tuple[str, slice]]:
    """Rigid members along which something is not zero, and their elements."""
    for name, member in model.scene.members.items():
        if member.type == "rigid" and along[model.elements_of(name)].any():
            yield name, model.elements_of(name)
