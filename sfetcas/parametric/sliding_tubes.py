"""Places of tubes along their members as parameters: how far a tube may slide, and the ends of elements that go along.

A tube that slides takes along the ends of elements at its base, where it becomes curved, and at its front.  As long as
none of them meets another end of an element that something needs, the unknowns stay what they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from .. import tolerances
from ..description.scene import Scene
from ..errors import SceneError
from ..mechanics.mesh import breaks_of

__all__ = ["SLIDING", "carried_along", "reach_of", "slid_through"]

SLIDING = re.compile(r"tubes\.([^.]+)\.start")
"""Names of places of tubes, with which elements move."""


def reach_of(scene: Scene, name: str) -> tuple[float, float, float]:
    """How far back and forward a tube may lie, m, and where it does, between the two.

    Raises
    ------
    SceneError
        One of its places is where something else is, or its section varies.
    """
    tube = scene.tubes[SLIDING.fullmatch(name)[1]]  # type: ignore[index]
    where = ("arguments", name)
    if not scene.sections[tube.section].even:
        message = f"found a tube whose section {tube.section!r} varies along it, accepted: one with an even section"
        raise SceneError(message, where)
    beside, total = _beside(scene, name)
    low, high = -float("inf"), float("inf")
    for arc in _arcs(scene, name):
        near = next((other for other in beside if abs(other - arc) <= tolerances.WRITTEN * total), None)
        if near is not None:
            message = (
                f"found {tube.start:g}, with which the tube begins, ends or becomes curved at {near:.6g} m along its"
            )
            raise SceneError(f"{message} members, where something else does, accepted: places by themselves", where)
        low = max([low, *(other - arc for other in beside if other < arc)])
        high = min([high, *(other - arc for other in beside if other > arc)])
    return tube.start + low, tube.start, tube.start + high


def carried_along(scene: Scene, name: str, start: Any) -> Iterator[tuple[str, float, Any]]:
    """Member, fraction of its length, and that fraction when the tube begins at ``start``, m, which may be a symbol.

    Of each end of elements that the tube takes along.
    """
    tube = scene.tubes[SLIDING.fullmatch(name)[1]]  # type: ignore[index]
    for member, at, length in _within(scene, name):
        yield member, at, at + (start - tube.start) / length


def slid_through(scene: Scene, name: str, low: float, high: float) -> Iterator[tuple[str, float, float]]:
    """Member, and fractions of its length from which and to which an end of elements goes, in a range of ``start``."""
    tube = scene.tubes[SLIDING.fullmatch(name)[1]]  # type: ignore[index]
    for member, at, length in _within(scene, name):
        yield member, at + (low - tube.start) / length, at + (high - tube.start) / length


def _arcs(scene: Scene, name: str) -> list[float]:
    """Arc lengths along the members, m, of the base, the begin of the curvature and the front."""
    tube = scene.tubes[SLIDING.fullmatch(name)[1]]  # type: ignore[index]
    curved = [tube.start + tube.curved_from] if any(tube.vector) and 0.0 < tube.curved_from < tube.length else []
    return [tube.start, *curved, tube.start + tube.length]


def _beside(scene: Scene, name: str) -> tuple[list[float], float]:
    """Arc lengths along the members of a tube, m, at which elements end without it, and the length of these, m."""
    own = SLIDING.fullmatch(name)[1]  # type: ignore[index]
    others = Scene.model_construct(
        **{key: getattr(scene, key) for key in type(scene).model_fields if key != "tubes"},
        tubes={key: tube for key, tube in scene.tubes.items() if key != own},
    )
    found, arc = list[float](), 0.0
    for member in scene.tubes[own].members:
        length = scene.center_lines[member].length
        found += [arc + float(place) * length for place in breaks_of(others, member)]
        arc += length
    return found, arc


def _within(scene: Scene, name: str) -> Iterator[tuple[str, float, float]]:
    """Member, fraction of its length, and its length, m, of each place of a tube that is within a member."""
    tube = scene.tubes[SLIDING.fullmatch(name)[1]]  # type: ignore[index]
    begin = 0.0
    for member in tube.members:
        length = scene.center_lines[member].length
        for arc in _arcs(scene, name):
            if begin < arc < begin + length:
                yield member, (arc - begin) / length, length
        begin += length
