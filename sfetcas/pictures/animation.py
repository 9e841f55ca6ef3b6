"""Moving pictures of answers: a motion in real time where that can be seen, steps and paths one after the other."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import replace
from subprocess import CalledProcessError
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ..description.scene import Scene
from ..dynamics.motion import Trajectory
from ..equilibria.solution import Configuration, Solution
from ..errors import SceneError
from ..mathematics.arrays import Array, Index
from ..paths.path import Path
from .files import check_ending
from .glyphs import sketch_supports
from .sheet import DOTTED, Sheet, axes_on, plot_line, title_of
from .sketch import REST, Mark, Sketch, course_of, in_short, prefix, view_of

__all__ = ["check_animation", "save_animation"]

ENDINGS = (".gif", ".mp4")
MOST_FRAMES = 200
SLOWEST, FASTEST = 10.0, 25.0
"""Frames a second of a motion."""
LASTS = 5.0
"""Seconds that steps and paths take, where they are many."""
DPI = 100
STANDING = ("support-", "contact-")
"""Marks that do not turn with the structure."""


def check_animation(scene: Scene, file: str | os.PathLike[str]) -> None:
    """Whether answers of a scene can be animated into a file, before they are known.

    Raises
    ------
    SceneError
        The ending is neither .gif nor .mp4, there is no ffmpeg for the latter, or nothing moves.
    """
    ending = check_ending(file, ENDINGS, "an animation")
    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        raise SceneError("found the ending '.mp4', but no program ffmpeg that writes it, accepted: .gif")
    analysis = scene.analysis
    accepted = "accepted: a motion, a path, or several steps with one equilibrium each"
    if analysis.type not in ("static", "path", "dynamic"):
        raise SceneError(f"found type {analysis.type!r} to animate, {accepted}")
    if analysis.equilibria == "all":
        raise SceneError(f"found equilibria = 'all' to animate, {accepted}")
    if analysis.type == "static" and len(analysis.steps) < 2:
        raise SceneError(f"found one step to animate, {accepted}")


def save_animation(answer: Solution | Path | Trajectory, file: str | os.PathLike[str]) -> None:
    """Write a moving picture of a motion, of steps or of the points of a path (without its branches).

    At most 200 frames, evenly taken.  A motion has 10 to 25 frames a second and goes in real time where these are
    enough to see it; else the picture says how much slower or faster it goes.

    Raises
    ------
    SceneError
        As :func:`check_animation`, or ffmpeg fails.
    """
    check_animation(answer.scene, file)
    if isinstance(answer, Trajectory):
        chosen, rate, pace = _paced(answer.times)
        steps: list[Configuration] = [answer.steps[i] for i in chosen]
        texts = [f"{text}{pace}" for text in _times(answer, chosen)]
    else:
        every = [answer.configuration(p) for p in answer.points] if isinstance(answer, Path) else list(answer.steps)
        numbers = np.unique(np.linspace(0, len(every) - 1, min(MOST_FRAMES, len(every))).round().astype(int))
        steps, rate = [every[i] for i in numbers], round(float(np.clip(len(numbers) / LASTS, 2.0, FASTEST)))
        texts = [f"factor {in_short(step.factor)}" for step in steps]
    film = _Film(steps, answer.scene.title, gravity=1.0 if isinstance(answer, Trajectory) else 0.0)
    writer: Any = (FFMpegWriter if check_ending(file, ENDINGS) == ".mp4" else PillowWriter)(fps=rate)
    log = logging.getLogger("matplotlib.animation")
    before, log.disabled = log.disabled, True
    try:
        with writer.saving(film.figure, os.fspath(file), DPI):
            for number, text in enumerate(texts):
                film.show(number, text)
                writer.grab_frame()
    except CalledProcessError as error:
        said = (error.stderr or "").split("\n")
        reason = next((line for line in reversed(said) if line.strip()), f"exit code {error.returncode}")
        raise SceneError(f"the program ffmpeg failed: {reason.strip()}") from None
    finally:
        log.disabled = before


def _paced(times: Array) -> tuple[Index, int, str]:
    """Which answers of a motion, how many a second, and what to say of how fast that is."""
    span, count = float(times[-1] - times[0]), min(len(times), MOST_FRAMES)
    if span * FASTEST >= FASTEST:
        # Longer than a second: more frames than are shown in real time would slow it down.
        count = min(count, 1 + int(span * FASTEST))
    wanted = np.linspace(times[0], times[-1], count)
    chosen = np.unique(np.abs(times - wanted[:, None]).argmin(axis=1))
    rate = round(float(np.clip((len(chosen) - 1) / span if span > 0.0 else FASTEST, SLOWEST, FASTEST)))
    slowed = (len(chosen) - 1) / rate / span if span > 0.0 else 1.0
    if 0.9 < slowed < 1.1:
        return chosen, rate, ""
    return (
        chosen,
        rate,
        f" (slowed {_short(slowed)} times)" if slowed > 1.0 else f" (sped up {_short(1.0 / slowed)} times)",
    )


def _short(number: float) -> str:
    return f"{float(f'{number:.2g}'):.10g}"


def _times(motion: Trajectory, chosen: Index) -> list[str]:
    """Times in as many digits as tell them apart."""
    factor, letter = prefix(motion.last.time, 0.1)
    times = motion.times[chosen] / factor
    spacing = float(np.diff(times).min()) if len(times) > 1 else 1.0
    digits = int(np.clip(np.ceil(-np.log10(spacing) - 1e-9), 0, 6))
    return [f"time {time:.{digits}f} {letter}s" for time in times]


class _Film:
    """A figure whose structure is put where it is at one of the steps; ``gravity``: so many times it is drawn."""

    def __init__(self, steps: Sequence[Configuration], title: str, *, gravity: float) -> None:
        self._steps, self._scene = steps, steps[-1].model.scene
        course = course_of(self._scene, steps, "none")
        self._course, self._lines = course, [*course.earlier, course.last]
        self._view = view_of(steps[-1].model.space, [course.everything])
        layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08)
        self.figure = Figure(figsize=(7.0, 5.0), dpi=DPI, layout=layout)
        if title_of(title):
            self.figure.suptitle(title_of(title), fontsize=11, parse_math=False)
        self._first = self._sketched(0)
        self._paper = self.figure.add_subplot()
        self._paper.set_title(" ", fontsize=9, loc="left")
        axes = axes_on(self.figure, self._paper, self._first)
        for line in course.rest:
            plot_line(axes, line, color=REST, linewidth=1.2, linestyle=DOTTED, gid="undeformed")
        look: dict[str, Any] = {"color": "#1F3A5F", "linewidth": 2.6, "solid_capstyle": "round", "gid": "deformed"}
        self._drawn = [plot_line(axes, line, **look) for line in self._lines[0]]
        self._sheet = Sheet(self.figure, axes, self._paper, self._first)
        self._sheet.finish(gravity=gravity)
        # What a frame shows shall not move the frame.
        self.figure.set_layout_engine("none")

    def _sketched(self, number: int) -> Sketch:
        """What holds the structure at a step."""
        course = replace(self._course, last=self._lines[number], earlier=self._lines)
        sketch = Sketch(self._scene, self._steps[number], course, self._view)
        sketch_supports(sketch)
        return sketch

    def show(self, number: int, text: str) -> None:
        """Put the structure where it is at a step."""
        self._paper.set_title(text, fontsize=9, loc="left")
        for drawn, line in zip(self._drawn, self._lines[number], strict=True):
            if hasattr(drawn, "set_data_3d"):
                drawn.set_data_3d(*line.T)
            else:
                drawn.set_data(*line[:, :2].T)
        for artist in self._sheet.drawn:
            artist.remove()
        self._sheet.drawn[:] = [self._sheet.draw(mark) for mark in self._marks(number)]

    def _marks(self, number: int) -> list[Mark]:
        """Marks at a step: supports as at the first one, only carried along, so that they keep their sides."""
        sketch = self._sketched(number)
        moving = [mark for mark in sketch.marks if not mark.name.startswith(STANDING)]
        nodes = {f"support-{name}": sketch.at(name) - self._first.at(name) for name in self._scene.nodes}
        standing = [mark for mark in self._first.marks if mark.name.startswith(STANDING)]
        return [replace(mark, points=mark.points + nodes.get(mark.name, 0.0)) for mark in standing] + moving
