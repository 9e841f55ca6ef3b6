"""Changing a scene by the names of its keys, as a function."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..description.scene import Scene, check_scene

__all__ = ["changed"]


def changed(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """A scene with other values of some of its keys: :meth:`Scene.replace` as a function.

    ``changed(scene, {"sections.strip.EI3": 2.0, "loads.tip.value": [0, 3], "factor": 0.5})``

    Raises
    ------
    SceneError
        The scene has no such key, or does not accept the value.
    """
    check_scene(scene, "changed({}, ...)", steps=False)
    return scene.replace(values)
