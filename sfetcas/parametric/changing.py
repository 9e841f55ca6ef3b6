"""A scene with other numbers, by their names."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ..description.scene import Scene, check_scene
from ..errors import SceneError
from .arguments import FACTOR, single_numbers, with_numbers

__all__ = ["changed"]


def changed(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """The scene with other values of numbers, named as in the scene.

    ``changed(scene, {"sections.strip.EI3": 2.0, "loads.tip.value": [0, 3], "factor": 0.5})``; a list takes a list of as
    many numbers (in a plane scene those of the plane), or single ones by ``loads.tip.value.1``.  ``factor`` takes the
    place of all steps.  What was expected of the answers is left out.

    Raises
    ------
    SceneError
        The scene has no such number, or accepts no such value.
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
