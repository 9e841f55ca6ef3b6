"""What a scene asks for is what is done: statics, a path, modes or a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from .checks import Answer
from .description.scene import Scene, check_loaded
from .dynamics.modes import find_modes
from .dynamics.simulation import simulate
from .equilibria import statics, stops
from .equilibria.statics import Settings
from .errors import SceneError
from .mechanics.resistance import check_resistance
from .paths import paths

__all__ = ["solve"]


def solve(
    scene: Scene,
    settings: Settings | None = None,
    *,
    progress: Callable[[float], object] | None = None,
    **changes: Any,
) -> Answer:
    """The answer of a scene, by the type of its analysis.

    Parameters
    ----------
    scene : Scene
    settings : Settings, optional
        Further keywords replace single settings: ``solve(scene, accuracy=1e-8)``.
    progress : callable, optional
        Of a motion: told the time reached, s, after each step.  Times start anew with each finer run; what it raises
        ends the motion, and where that is KeyboardInterrupt the answers up to there are returned.

    Returns
    -------
    Solution, Path, Motion or Modes
        All have ``steps``, ``last``, ``status`` and ``to_dict``.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        There is no equilibrium that could be found; the sentence says why.

    Example
    -------
    >>> scene = load("problems/cantilever_tip_force.toml")      # doctest: +SKIP
    >>> solve(scene).last.position("tip")                       # doctest: +SKIP
    """
    settings = replace(settings or Settings(), **changes)
    if settings.accuracy_of and scene.analysis.type in ("path", "modes"):
        raise SceneError(f"accuracy_of: found with type {scene.analysis.type!r}, accepted: static or dynamic")
    if scene.analysis.type == "dynamic":
        return simulate(scene, settings, progress)
    check_loaded(scene)
    check_resistance(scene)
    if scene.analysis.type == "path":
        return paths.follow_path(scene, settings)
    if scene.analysis.type == "modes":
        return find_modes(scene, settings)
    stopped = any(spring.stop is not None for spring in scene.springs.values())
    return stops.solve_stopped(scene, settings) if stopped else statics.solve(scene, settings)
