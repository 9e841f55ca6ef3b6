"""Load steps of scenes with unilateral constraints along a path, where the search among choices finds no step.

That search takes each step by itself, and may go round in circles.  A path goes from factor 0 over each change of what
is taut or at a stop, so it comes to the equilibrium that growing loads lead to.
"""

from __future__ import annotations

from dataclasses import replace

from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium, Solution
from ..errors import SceneError, SolveError, Status
from .path import Path
from .paths import follow_path

__all__ = ["steps_along"]

FOLLOWED = "found along a path from factor 0, over each change of what is taut or at a stop"
"""A note on such a step."""


def steps_along(scene: Scene, settings: Settings, error: SolveError) -> Solution:
    """The load steps of a static scene: for each the first equilibrium along a path that is no unstable one.

    Raises
    ------
    SolveError
        The ``error`` of the load steps, where a path is refused, has no beginning, or does not come to all factors.
    """
    factors, status = scene.analysis.steps, Status.SOLVED
    found: dict[float, Equilibrium] = {}
    seconds = {"model": 0.0, "solve": 0.0}
    for sign in (1.0, -1.0):
        wanted = sorted({factor for factor in factors if factor * sign > 0.0})
        if not wanted:
            continue
        path = _path(scene, settings, wanted, sign, error)
        seconds = {key: seconds[key] + path.seconds[key] for key in seconds}
        status = Status.SHORT if path.status is Status.SHORT else status
        for step in reversed(path.steps):
            if step.certificate.stable is not False:
                found[step.factor] = step
    if not set(factors) <= found.keys():
        raise error
    steps = tuple(replace(found[factor], notes=(*found[factor].notes, FOLLOWED)) for factor in factors)
    return Solution(scene, status, steps, seconds)


def _path(scene: Scene, settings: Settings, wanted: list[float], sign: float, error: SolveError) -> Path:
    """The path from factor 0 to the farthest of the factors ``wanted``, all of one sign."""
    end = max(wanted, key=abs)
    analysis = {
        "type": "path",
        "range": [0.0, end] if sign > 0.0 else [end, 0.0],
        "steps": wanted,
        "accuracy": scene.analysis.accuracy,
    }
    try:
        return follow_path(scene.replace({"analysis": analysis}), settings)
    except (SceneError, SolveError):
        raise error from None
