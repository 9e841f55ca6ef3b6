"""Changing numbers of a scene by their names."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ..description.scene import Scene, check_scene
from ..errors import SceneError
from .arguments import FACTOR, single_numbers, with_numbers

__all__ = ["changed"]


def changed(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """A scene with other values of some of its numbers.

    ``changed(scene, {"sections.strip.EI3": 2.0, "loads.tip.value": [0, 3], "factor": 0.5})``.  Names are those of the
    keys of the scene, values in its units.  A list takes a list of the same length (in a plane scene two components),
    or single entries by ``loads.tip.value.1``.  ``factor`` replaces all ``steps``.  The expectations of the scene are
    dropped.

    Raises
    ------
    SceneError
        The scene has no such number, or does not accept the value.
    """
    check_scene(scene, "changed({}, ...)")
    single = single_numbers(scene, values)
    factor = single.pop(FACTOR, None)
    if any(name.startswith("histories.") and name.count(".") == 1 for name in single):
        raise SceneError(
            f"{', '.join(single)}: found a whole history, accepted: its numbers, as histories.NAME.value.0"
        )
    found = with_numbers(scene, single)
    if factor is None:
        return found
    return found.model_copy(update={"analysis": found.analysis.model_copy(update={"steps": (factor,)})})
