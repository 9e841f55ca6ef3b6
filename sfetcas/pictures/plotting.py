"""Pictures of answers: the deformed structure over the undeformed one, with supports, loads and reactions.

The order of the stages: centre lines are sampled, all else is sketched as marks and labels in fixed axes
(``pictures.sketch``, ``pictures.glyphs``); axes are made and filled, marks are drawn and
labels put where they hide least (``pictures.sheet``).  How lines tell steps or equilibria apart stands in
``pictures.looks``.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..description.records import listed, say
from ..equilibria.solution import Solution
from ..errors import SceneError
from .colours import coloured
from .files import check_ending, save_figure
from .glyphs import sketch_all
from .looks import looks_of_equilibria, looks_of_steps, number_of
from .sheet import sheet_of
from .sketch import Sketch, course_of, view_of

__all__ = ["picture", "save_picture"]

MOST_STEPS = 40
"""Steps drawn at most."""


def save_picture(solution: Solution, path: str | os.PathLike[str], **how: Any) -> None:
    """Write :func:`picture` of an answer to a file, in the format of its ending.

    Parameters
    ----------
    solution : Solution
    path : path
    how : as of :func:`picture`

    Raises
    ------
    SceneError
        As :func:`picture`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(path)
    save_figure(_drawn(solution, shown=False, **how), path)


def picture(solution: Solution, *, steps: Sequence[int] | None = None, colour: str = "moment") -> Figure:
    """The deformed structure over the undeformed one, ready for a report.

    Parameters
    ----------
    solution : Solution
    steps : sequence of int, optional
        Numbers of the steps to draw, as indices of ``solution.steps``; the last one is drawn bold and in colour, with
        its loads and reactions, the others thin.  Default: all; where all equilibria are asked for those of the last
        factor, the first of them bold.
    colour : str
        The quantity that colours tell: one of ``colours.QUANTITIES``, or ``none``.

    Returns
    -------
    Figure
        matplotlib figure, 7 x 5 inch; it shows itself in notebooks and by ``pyplot.show()``.

    Raises
    ------
    SceneError
        There is no such step or colour.
    """
    return _drawn(solution, shown=True, steps=steps, colour=colour)


def _drawn(solution: Solution, *, shown: bool, steps: Sequence[int] | None = None, colour: str = "moment") -> Figure:
    quantity = coloured(solution.scene, colour)
    numbers = _chosen(solution, steps)
    chosen = [solution.steps[number] for number in numbers]
    course = course_of(solution.scene, chosen, None if quantity is None else quantity.of)
    view = view_of(chosen[-1].model.space, [*course.rest, *course.last])
    sketch = Sketch(solution.scene, chosen[-1], course, view)
    sketch_all(sketch)
    several = solution.scene.analysis.equilibria == "all"
    looks = looks_of_equilibria(sketch, solution, numbers) if several else looks_of_steps(chosen)
    sheet = sheet_of(sketch, looks, quantity, shown=shown)
    sheet.finish(gravity=sketch.step.factor)
    return sheet.figure


def _chosen(solution: Solution, steps: Sequence[int] | None) -> list[int]:
    """Indices of the steps to draw, the bold one last."""
    count = len(solution.steps)
    accepted = f"a list of numbers of steps from 0 to {count - 1}, or from the end: -1"
    try:
        numbers = list(range(count)) if steps is None else [operator.index(step) for step in listed(steps, accepted)]
    except (TypeError, ValueError):
        numbers = []
    if not numbers or any(not -count <= number < count for number in numbers):
        raise SceneError(f"found {say(steps)}, accepted: {accepted}", ("steps",))
    if steps is None and solution.scene.analysis.equilibria == "all":
        first = count - number_of(solution, count - 1)
        numbers = [*range(first + 1, count), first]
    thinned = np.unique(np.linspace(0, len(numbers) - 1, min(len(numbers), MOST_STEPS)).round().astype(int))
    return [numbers[i] % count for i in thinned]
