"""What a scene asks for is what is done: statics, a path, modes or a motion; only that is imported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .description.scene import Scene, check_loaded, check_scene
from .equilibria import statics, stops
from .equilibria.statics import Settings
from .errors import SceneError
from .mechanics.resistance import check_resistance

if TYPE_CHECKING:
    from .checks import Answer

__all__ = ["LATER", "solve"]

LATER = ("sfetcas.dynamics.modes", "sfetcas.dynamics.simulation", "sfetcas.paths.paths")
"""Modules that :func:`solve` imports by the type of the analysis; for processes that solve they are imported once."""


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
    check_scene(scene, "solve({})")
    settings = replace(settings or Settings(), **changes)
    if settings.accuracy_of and scene.analysis.type in ("path", "modes"):
        raise SceneError(f"accuracy_of: found with type {scene.analysis.type!r}, accepted: static or dynamic")
    if scene.analysis.type == "dynamic":
        from .dynamics.simulation import simulate

        return simulate(scene, settings, progress)
    check_loaded(scene)
    check_resistance(scene)
    if scene.analysis.type == "path":
        from .paths.paths import follow_path

        return follow_path(scene, settings)
    if scene.analysis.type == "modes":
        from .dynamics.modes import find_modes

        return find_modes(scene, settings)
    stopped = any(spring.stop is not None for spring in scene.springs.values())
    return stops.solve_stopped(scene, settings) if stopped else statics.solve(scene, settings)
