"""Moving pictures of answers: a motion in real time where that can be seen, steps and paths point by point, modes."""

from __future__ import annotations

import abc
import base64
import logging
import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as File
from subprocess import CalledProcessError
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.collections import LineCollection
from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

from ..description.scene import Scene
from ..dynamics.modes import Modes
from ..dynamics.motion import MotionState, Trajectory
from ..equilibria.solution import Configuration, Solution
from ..errors import SceneError
from ..paths.path import Path
from .colours import NONE, ColourQuantity, coloured
from .files import check_ending, check_folder
from .glyphs import sketch_carried, sketch_supports
from .modeshapes import PHASES, ModePanels
from .motions import evenly
from .sheet import DOTTED, Sheet, add_bar, axes_on, entitle, pieces_of, plot_line
from .showing import Picture, new_figure
from .sketch import REST, Mark, Sketch, course_of, in_short, prefix, view_of

__all__ = ["Animation", "animated", "animation", "check_animation", "save_animation"]

ENDINGS = (".gif", ".mp4")
MOST_FRAMES = 200
SLOWEST, FASTEST = 10.0, 25.0
"""Frames a second of a motion."""
QUICK_FRAMES = 101
"""Frames of a motion of less than a second, which is slowed down."""
LASTS = 5.0
"""Seconds that steps and paths take, where they are many."""
DPI = 100


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
    _check_moves(scene)


def _check_moves(scene: Scene) -> None:
    analysis = scene.analysis
    accepted = "accepted: a motion, modes, a path, or several steps with one equilibrium each"
    if analysis.equilibria == "all":
        raise SceneError(f"found equilibria = 'all' to animate, {accepted}")
    if analysis.type == "static" and len(analysis.steps) < 2:
        raise SceneError(f"found one step to animate, {accepted}")


def save_animation(
    answer: Solution | Path | Trajectory | Modes, file: str | os.PathLike[str], *, colour: str = NONE
) -> None:
    """Write :func:`animation` of an answer to a file, .gif or .mp4.

    Raises
    ------
    SceneError
        As :func:`check_animation` and :func:`animation`, there is no such folder, or ffmpeg fails.
    """
    check_animation(answer.scene, file)
    check_folder(file)
    animation(answer, colour=colour).save(file)


def animated(
    answer: Solution | Path | Trajectory | Modes, file: str | os.PathLike[str] | None = None, *, colour: str = NONE
) -> Animation | File:
    """Write :func:`animation` to a file, whose path is returned; without a file what notebooks show.

    Raises
    ------
    SceneError
        As :func:`save_animation`.
    """
    if file is None:
        return animation(answer, colour=colour)
    save_animation(answer, file, colour=colour)
    return File(file)


def animation(answer: Solution | Path | Trajectory | Modes, *, colour: str = NONE) -> Animation:
    """A moving picture of a motion, of modes, of steps or of the points of a path and then of its branches.

    At most 200 frames, evenly taken.  A motion has 10 to 25 frames a second and goes in real time where these are
    enough to see it; else the picture says how much slower or faster it goes.  Modes go through one period each.

    Parameters
    ----------
    answer : Solution, Path, Trajectory or Modes
    colour : str
        The quantity that colours tell, with one scale for all frames: one of
        ``colours.QUANTITIES``, or ``none``.  Modes have none.

    Raises
    ------
    SceneError
        Nothing moves, or there is no such colour.
    """
    _check_moves(answer.scene)
    if isinstance(answer, Modes):
        if colour != NONE:
            raise SceneError(f"found {colour!r}, accepted of modes: {NONE}", ("colour",))
        return Animation(_Waves(answer))
    if isinstance(answer, Trajectory):
        frames, rate, pace = _paced(float(answer.times[-1] - answer.times[0]))
        instants = evenly(answer, frames)
        steps: list[Configuration] = list(instants)
        texts = [f"{text}{pace}" for text in _times(instants)]
    else:
        every = _along_path(answer) if isinstance(answer, Path) else [("", step) for step in answer.steps]
        numbers = np.unique(np.linspace(0, len(every) - 1, min(MOST_FRAMES, len(every))).round().astype(int))
        rate = round(float(np.clip(len(numbers) / LASTS, 2.0, FASTEST)))
        steps = [every[i][1] for i in numbers]
        texts = [f"{every[i][0]}factor {in_short(every[i][1].factor)}" for i in numbers]
    gravity = 1.0 if isinstance(answer, Trajectory) else 0.0
    return Animation(_Film(steps, texts, rate, answer.scene.title, gravity=gravity, colour=colour))


def _along_path(path: Path) -> list[tuple[str, Configuration]]:
    """States at all points of a path and its branches, and what to say of where they are."""
    return [
        (f"branch {number}, " if number else "", path.configuration(point))
        for number, branch in enumerate(path.branches)
        for point in branch.points
    ]


class Film(abc.ABC):
    """A figure that shows one frame after the other: ``count`` of them, ``rate`` a second."""

    figure: Picture
    count: int
    rate: int

    @abc.abstractmethod
    def show(self, number: int) -> None:
        """Put the figure to a frame, counted from 0."""


class Animation:
    """A moving picture, which notebooks show.

    Parameters
    ----------
    film : Film
    """

    def __init__(self, film: Film) -> None:
        self._film = film

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write it to a file, .gif or .mp4.

        Raises
        ------
        SceneError
            Another ending, no such folder, no ffmpeg, or ffmpeg fails.
        """
        check_folder(file)
        film = self._film
        writer: Any = FFMpegWriter if check_ending(file, ENDINGS, "an animation") == ".mp4" else PillowWriter
        log = logging.getLogger("matplotlib.animation")
        before, log.disabled = log.disabled, True
        try:
            one = writer(fps=film.rate)
            with one.saving(film.figure, os.fspath(file), DPI):
                for number in range(film.count):
                    film.show(number)
                    one.grab_frame()
        except CalledProcessError as error:
            said = (error.stderr or "").split("\n")
            reason = next((line for line in reversed(said) if line.strip()), f"exit code {error.returncode}")
            raise SceneError(f"the program ffmpeg failed: {reason.strip()}") from None
        finally:
            log.disabled = before

    def _repr_html_(self) -> str:
        """What notebooks show: the picture itself, from nowhere else."""
        with tempfile.TemporaryDirectory() as folder:
            file = File(folder) / "animation.gif"
            self.save(file)
            content = base64.b64encode(file.read_bytes()).decode()
        return f'<img alt="animation" src="data:image/gif;base64,{content}">'


def _paced(span: float) -> tuple[int, int, str]:
    """How many frames a motion of so many seconds has, how many a second, and what to say of how fast that is."""
    count = min(MOST_FRAMES, 1 + int(span * FASTEST * (1.0 + 1e-9))) if span >= 1.0 else QUICK_FRAMES
    if span == 0.0:
        return 1, round(FASTEST), ""
    rate = round(float(np.clip((count - 1) / span, SLOWEST, FASTEST)))
    slowed = (count - 1) / rate / span
    if 0.9 < slowed < 1.1:
        return count, rate, ""
    return (
        count,
        rate,
        f" (slowed {_short(slowed)} times)" if slowed > 1.0 else f" (sped up {_short(1.0 / slowed)} times)",
    )


def _short(number: float) -> str:
    return f"{float(f'{number:.2g}'):.10g}"


def _times(instants: Sequence[MotionState]) -> list[str]:
    """Times in as many digits as tell them apart."""
    factor, letter = prefix(instants[-1].time, 0.1)
    times = np.array([instant.time for instant in instants]) / factor
    spacing = float(np.diff(times).min()) if len(times) > 1 else 1.0
    digits = int(np.clip(np.ceil(-np.log10(spacing) - 1e-9), 0, 6))
    return [f"time {time:.{digits}f} {letter}s" for time in times]


class _Waves(Film):
    """Modes, each through one period."""

    def __init__(self, modes: Modes) -> None:
        self._panels = ModePanels(modes, shown=False, moving=True)
        self.figure = self._panels.figure
        self.count, self.rate = PHASES, round(PHASES / 2.0)

    def show(self, number: int) -> None:
        """A phase of the period."""
        self._panels.show(2.0 * np.pi * number / self.count)


class _Film(Film):
    """A figure whose structure is put where it is at one of the steps; ``gravity``: so many times it is drawn."""

    def __init__(
        self,
        steps: Sequence[Configuration],
        texts: Sequence[str],
        rate: int,
        title: str,
        *,
        gravity: float,
        colour: str = NONE,
    ) -> None:
        self._steps, self._texts, self._scene = steps, texts, steps[-1].model.scene
        self.count, self.rate = len(steps), rate
        quantity = coloured(self._scene, colour)
        course = course_of(self._scene, steps, None if quantity is None else quantity.of, every=True)
        self._course, self._lines = course, [*course.earlier, course.last]
        self._view = view_of(steps[-1].model.space, [course.everything])
        self.figure = new_figure(7.0, 5.0, shown=False)
        entitle(self.figure, title)
        self._first = self._sketched(0)
        sketch_supports(self._first)
        self._paper = self.figure.add_subplot()
        self._paper.set_title(" ", fontsize=9, loc="left")
        axes = axes_on(self.figure, self._paper, self._first)
        for line in course.rest:
            plot_line(axes, line, color=REST, linewidth=1.2, linestyle=DOTTED, gid="undeformed")
        self._values = [*course.earlier_values, course.values]
        self._drawn: list[Any] = []
        self._pieces: Any = None
        if quantity is not None and any(self._values):
            self._colour(axes, quantity)
        else:
            look: dict[str, Any] = {"color": "#1F3A5F", "linewidth": 2.6, "solid_capstyle": "round", "gid": "deformed"}
            self._drawn = [plot_line(axes, line, **look) for line in self._lines[0]]
        self._sheet = Sheet(self.figure, axes, self._paper, self._first)
        self._sheet.finish(gravity=gravity)
        # What a frame shows shall not move the frame.
        self.figure.set_layout_engine("none")

    def _colour(self, axes: Any, quantity: ColourQuantity) -> None:
        """Draw the pieces of all members in the colours of their values, with one scale for all frames."""
        space = self._steps[-1].model.space
        # What is rounding in one frame is zero beside the others.
        self._values = [
            found or [np.zeros(len(line)) for line in lines]
            for found, lines in zip(self._values, self._lines, strict=True)
        ]
        kind = Line3DCollection if space else LineCollection
        self._pieces = kind([], gid="deformed", linewidths=2.6, capstyle="round", clip_on=not space, zorder=3.5)
        axes.add_collection(self._pieces, **({} if space else {"autolim": False}))
        every = np.concatenate([pieces_of(*one)[1] for one in zip(self._lines, self._values, strict=True)])
        self._unit = add_bar(self.figure, self._paper, [(self._pieces, every)], quantity, space=space)
        self._put_pieces(0)

    def _put_pieces(self, number: int) -> None:
        pieces, values = pieces_of(self._lines[number], self._values[number])
        self._pieces.set_segments(pieces if self._steps[-1].model.space else pieces[:, :, :2])
        self._pieces.set_array(np.ma.masked_invalid(values / self._unit))

    def _sketched(self, number: int) -> Sketch:
        """An empty sketch of a step."""
        course = replace(self._course, last=self._lines[number], earlier=self._lines)
        return Sketch(self._scene, self._steps[number], course, self._view)

    def show(self, number: int) -> None:
        """Put the structure where it is at a step."""
        self._paper.set_title(self._texts[number], fontsize=9, loc="left")
        if self._pieces is not None:
            self._put_pieces(number)
        for drawn, line in zip(self._drawn, self._lines[number] if self._drawn else (), strict=True):
            if hasattr(drawn, "set_data_3d"):
                drawn.set_data_3d(*line.T)
            else:
                drawn.set_data(*line[:, :2].T)
        for artist in self._sheet.drawn:
            artist.remove()
        self._sheet.drawn[:] = [self._sheet.draw(mark) for mark in self._marks(number)]

    def _marks(self, number: int) -> list[Mark]:
        """Marks at a step, of supports those of the first one, carried along."""
        sketch = self._sketched(number)
        sketch_carried(sketch, self._first)
        return sketch.marks
