"""The entry point :func:`~sfetcas.solve`: runs the analysis that a scene asks for, and imports only what it needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .description.scene import Scene, check_loaded, check_scene
from .equilibria import statics, stops
from .equilibria.settings import Settings, settings_with
from .errors import SceneError, SolveError, Status
from .mechanics.resistance import check_resistance

if TYPE_CHECKING:
    from .checks import Answer

__all__ = ["LATER", "solve"]

LATER = (
    "sfetcas.dynamics.modes",
    "sfetcas.dynamics.simulation",
    "sfetcas.paths.paths",
    "sfetcas.paths.steps_along",
)
"""What :func:`~sfetcas.solve` imports for some analyses only; servers that start worker processes preload it."""


def solve(
    scene: Scene,
    settings: Settings | None = None,
    *,
    progress: Callable[[float], object] | None = None,
    **changes: Any,
) -> Answer:
    """Run the analysis that a scene asks for (static, path, modes or dynamic) and return its answer.

    Parameters
    ----------
    scene : Scene
    settings : Settings, optional
        Further keywords replace single settings: ``solve(scene, accuracy=1e-8)``.
    progress : callable, optional
        Dynamic analyses only: called with the time reached, in s, after each time step.  Times start anew with each
        run on a finer discretisation.  An exception that it raises ends the motion; after KeyboardInterrupt the
        answers up to that time are returned.

    Returns
    -------
    Solution, Path, Modes or Trajectory
        For ``static``, ``path``, ``modes`` and ``dynamic``.  All have ``steps``, ``last``, ``status``, ``to_dict``.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        There is no equilibrium that could be found; the sentence says why.

    Examples
    --------
    >>> scene = load("problems/cantilever_tip_force.toml")      # doctest: +SKIP
    >>> solve(scene).last.position("tip")                       # doctest: +SKIP
    """
    check_scene(scene, "solve({})")
    settings = settings_with(settings, changes)
    if settings.accuracy_of and scene.analysis.type in ("path", "modes"):
        raise SceneError(f"accuracy_of: found with type {scene.analysis.type!r}, accepted: static or dynamic")
    try:
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
        if not (scene.stopped or scene.reversed):
            return statics.solve(scene, settings)
        try:
            return stops.solve_stopped(scene, settings)
        except SolveError as error:
            if not stops.followable(scene, settings):
                raise
            from .paths.steps_along import steps_along

            return steps_along(scene, settings, error)
    except np.linalg.LinAlgError as error:
        raise SolveError(Status.FAILED, f"{FAR_APART}: {error}") from None


FAR_APART = "numbers of the scene are too far apart for matrices in double precision"
