"""Where obstacles stop members in a motion: at the ends of their elements, and how near to each other these are.

Between two spots a member may dip into an obstacle.  On something round with the curvature ``1 / R`` a member of the
curvature ``k`` dips by ``h^2 (1 / R + k) / 8`` between spots that are ``h`` apart, as a chord does; on a floor by
``w h^4 / (384 EI)`` under a load ``w`` by length, as a beam that is clamped at both spots.  Elements are divided until
neither is more than what is accepted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.obstacles import Obstacle, members_of, takes_part
from ..description.scene import Scene
from ..description.structure import SLIDING
from ..mathematics.arrays import Array
from .carried import carried
from .mesh import Mesh, Spot, breaks_of
from .rotations import end_joints
from .segments import place_within

__all__ = ["ending_at", "fine_enough", "slips_between", "spots_of", "thinnest"]


def spots_of(scene: Scene, mesh: Mesh) -> tuple[Spot, ...]:
    """All places of members on a mesh that obstacles may push: each once, whichever members end there."""
    found: dict[tuple[str, str], Spot] = {}
    for contact, stop in scene.obstacles.items():
        record = scene.contacts[contact]
        for member in members_of(record, scene.members):
            for at, place in _places(scene, mesh, member, stop):
                found.setdefault((contact, place), Spot(contact, member, at, place, rubs=record.friction > 0.0))
    return tuple(found.values())


def _places(scene: Scene, mesh: Mesh, member: str, stop: Obstacle) -> list[tuple[float, str]]:
    """Fractions of the length of a member, and names, of its places that an obstacle can push."""
    found, free = [], False
    for at, (node, joint) in zip((0.0, 1.0), end_joints(scene, scene.members[member]), strict=True):
        if takes_part(node, scene.nodes[node], scene.motions.values(), stop):
            found.append((at, f"{node} at {member}" if joint in SLIDING else node))
            free = True
    # Of a rigid member that is held at both ends nothing moves.
    if free or scene.members[member].type == "flexible":
        found += [(at, place_within(member, at)) for at in mesh.cuts[member][1:-1].tolist()]
    return found


def fine_enough(scene: Scene, mesh: Mesh, accuracy: float, fixed: Collection[str]) -> Mesh:
    """The mesh with elements so short that members do not dip into obstacles by more than what is accepted.

    Of rigid members that is the accuracy; elements of flexible ones are halved until runs agree, and begin coarser.

    Parameters
    ----------
    accuracy : float
        Of positions, over the size of the scene.
    fixed : names of members whose number of elements is prescribed
    """
    if not scene.contacts:
        return mesh
    cuts, reaching = dict(mesh.cuts), carried(scene)
    for member in mesh.cuts:
        stops = [
            stop
            for contact, stop in scene.obstacles.items()
            if member in members_of(scene.contacts[contact], scene.members) and member not in fixed
        ]
        if not stops:
            continue
        line, rigid = scene.center_lines[member], scene.members[member].type == "rigid"
        dip = accuracy * scene.size * (1.0 if rigid else COARSER)
        curvature = max(1.0 / stop.distance if stop.kind == "round" and stop.sign > 0.0 else 0.0 for stop in stops)
        curvature += line.turning / line.length
        count = line.length * np.sqrt(curvature / (8.0 * dip))
        if not rigid:
            section = scene.sections[str(scene.members[member].section)]
            softest = float(np.nanmin(section.stiffness(np.linspace(0.0, 1.0, 5))))
            weight = reaching[member].force / line.length
            count = max(count, line.length * (weight / (384.0 * softest * dip)) ** 0.25)
        # Of something round whose diameter is less than the places are apart nothing would be seen.
        seen = min(line.length / (APART * thinnest(stops)), MOST_RIGID if rigid else MOST)
        cuts[member] = _shortened(mesh.cuts[member], 1.0 / max(min(count, MOST), seen, 1.0))
    return replace(mesh, cuts=cuts)


def thinnest(stops: Iterable[Obstacle]) -> float:
    """The smallest radius, m, of obstacles that are round and stop from outside; infinite where none is."""
    return min((stop.distance for stop in stops if stop.kind == "round" and stop.sign > 0.0), default=np.inf)


def slips_between(scene: Scene, mesh: Mesh) -> str:
    """Which obstacle may slip through between the places at which it stops a member, in words; empty where none may."""
    for contact, stop in scene.obstacles.items():
        for member in members_of(scene.contacts[contact], scene.members):
            apart = float(np.diff(mesh.cuts[member]).max()) * scene.center_lines[member].length
            if apart > 2.0 * thinnest([stop]) and list(_places(scene, mesh, member, stop)):
                message = f"contacts.{contact} stops {member!r} at places that are {apart:.3g} m apart, more than its"
                mended = "a larger radius" if scene.members[member].type == "rigid" else "more elements"
                return f"{message} diameter: it may slip through, and {mended} would show it"
    return ""


def ending_at(scene: Scene, mesh: Mesh, places: Iterable[tuple[str, float]]) -> Mesh:
    """The mesh with ends of elements where members touch obstacles in the equilibrium that a motion begins with.

    Parameters
    ----------
    places : iterable of (str, float)
        Members and fractions of their lengths.
    """
    cuts = dict(mesh.cuts)
    kept = {member: breaks_of(scene, member) for member in cuts}
    for member, at in places:
        own = cuts[member]
        near = int(np.argmin(np.abs(own - at)))
        fixed = np.abs(kept[member] - own[near]).min() <= tolerances.DECIMAL
        # The next place is not to move this one.
        kept[member] = np.append(kept[member], at)
        if abs(own[near] - at) <= tolerances.DECIMAL:
            continue
        movable = 0 < near < len(own) - 1 and not fixed
        # An end that is near is moved there: slivers gain nothing.
        if movable and abs(own[near] - at) < WITHIN * np.diff(own)[near - 1 : near + 1].min():
            own = np.delete(own, near)
        cuts[member] = np.sort(np.append(own, at))
    return replace(mesh, cuts=cuts)


def _shortened(cuts: Array, longest: float) -> Array:
    """Cuts between which there are equal parts that are no longer than a fraction of the length."""
    parts = np.maximum(1, np.ceil(np.diff(cuts) / longest * (1.0 - 1e-9))).astype(int)
    inner = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(cuts, cuts[1:], parts.tolist(), strict=False)]
    return np.concatenate([*inner, cuts[-1:]])


WITHIN = 0.4
"""Share of the shorter element beside an end of elements, within which it is moved to where a member touches."""

COARSER = 16.0
"""How much deeper flexible members may dip on the first mesh; halved twice, at what is round by no more than others."""

MOST, MOST_RIGID = 64, 256
"""Elements of a member at most that this asks for, and places of a rigid one that thin obstacles do: of more, motions
take too long.
"""

APART = 1.8
"""How far the places that are stopped may be apart at most, over the radius of what is round: its diameter, but for a
tenth.
"""
