"""Pictures of mode shapes: a panel for each of the lowest modes, drawn over the equilibrium, with its frequency.

Shapes have no size of their own: each is drawn so large that it is well seen.  Where damping or follower loads make a
shape complex it is drawn at the phase where it is largest.  What only twists moves nothing: bars across the members
turn instead.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..dynamics.modes import Modes
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import TINY, Array
from .files import check_ending, save_figure
from .glyphs import sketch_supports
from .sheet import Sheet, entitle, title_of
from .showing import new_figure
from .sketch import REACH, REST, SUPPORT, TWISTING, Sketch, View, course_of, in_short, norm, view_of

__all__ = ["PHASES", "ModePanels", "mode_picture", "save_modes"]

MOST = 12
"""Modes drawn at most."""
TURN, BAR, BARS = 0.7, 0.04, 13
"""Of what only twists: largest angle drawn, rad, half the length of bars over the size, and their number."""
SAMPLES = 301
"""Points along a member at least: shapes of high modes bend where the equilibrium is straight."""
PHASES = 40
"""Frames of a period."""
SHAPE, LATER = "#134B86", "#A9C4DF"


def save_modes(modes: Modes, file: str | os.PathLike[str], *, count: int | None = None) -> None:
    """Write :func:`mode_picture` of modes to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`mode_picture`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(ModePanels(modes, shown=False, count=count).figure, file)


def mode_picture(modes: Modes, *, count: int | None = None) -> Figure:
    """The lowest mode shapes over the equilibrium, a panel for each; a figure of up to 11 inch.

    Parameters
    ----------
    modes : Modes
    count : int, optional
        How many, 12 at most.  Default: all that were asked for.

    Raises
    ------
    SceneError
        There are no so many modes.
    """
    return ModePanels(modes, shown=True, count=count).figure


@dataclass(frozen=True, eq=False)
class _Shape:
    """A mode in drawn units: complex displacements (n, 3) along each member, and ends of bars that turn, or none."""

    lines: list[Array]
    bars: list[tuple[Array, Array]]


class ModePanels:
    """A figure with a panel for each mode, which :meth:`show` puts to any phase.

    Parameters
    ----------
    modes : Modes
    shown : bool
        Whether the figure is registered with pyplot.
    count : int, optional
        How many modes.
    moving : bool
        Whether only one phase is drawn at a time.
    """

    def __init__(self, modes: Modes, *, shown: bool, count: int | None = None, moving: bool = False) -> None:
        found = len(modes.modes)
        if count is not None and not 1 <= count <= found:
            raise SceneError(f"found {count}, accepted: 1 to {found} modes", ("count",))
        self._modes, self._moving = modes, moving
        drawn = min(MOST, found if count is None else count)
        rest = modes.last
        course = course_of(modes.scene, [rest])
        places = [np.linspace(0.0, 1.0, max(SAMPLES, len(line))) for line in course.last]
        self._unit = course.unit
        self._base = [
            rest.along(name, x)["position"] / course.unit for name, x in zip(course.members, places, strict=True)
        ]
        raw = [self._shape_of(i, places) for i in range(drawn)]
        farthest = [
            line + sign * shape.real for one in raw for line, shape in zip(self._base, one.lines) for sign in (1, -1)
        ]
        self._view = view_of(rest.model.space, [*self._base, *farthest])
        self._sketch = Sketch(modes.scene, rest, course, self._view)
        size = self._sketch.size
        self._shapes = [self._scaled(one, size) for one in raw]
        sketch_supports(self._sketch)
        self._make(max(drawn, 1), shown)
        self._phase(0.0)

    # -- shapes -----------------------------------------------------------------------------------

    def _shape_of(self, number: int, places: list[Array]) -> _Shape:
        """Displacements at the phase where they are largest, and of what only twists bars across the members."""
        modes, scene = self._modes, self._modes.scene
        fields = [modes.along(number, name, x) for name, x in zip(scene.members, places, strict=True)]
        moved, turned = (
            np.concatenate([np.asarray(f[key], complex) for f in fields]) for key in ("position", "rotation")
        )
        extent = norm(np.ptp(np.vstack(self._base), axis=0)) * self._unit
        only = np.abs(moved).max() < TWISTING * np.abs(turned).max() * max(extent, TINY)
        of = turned if only else moved
        # The phase at which the sum of squares of the real parts is largest.
        phase = np.exp(-0.5j * np.angle((of**2).sum()))
        lines = [np.asarray(field["position"], complex) * phase for field in fields]
        return _Shape(lines, self._bars(number, phase) if only else [])

    def _bars(self, number: int, phase: complex) -> list[tuple[Array, Array]]:
        """Places (n, 3) of bars and, over their unit vectors, complex rotation vectors: (places, [axes, turns])."""
        modes, found = self._modes, []
        x = np.linspace(0.0, 1.0, BARS)
        for name, line in zip(modes.scene.members, self._base, strict=True):
            turns = np.asarray(modes.along(number, name, x)["rotation"], complex) * phase
            own = modes.scene.center_lines[name].quaternions(x)
            now = modes.last.along(name, x)["quaternion"]
            axes = quaternion.rotate(now, quaternion.rotate(own, np.tile([0.0, 0.0, 1.0], (BARS, 1))))
            rows = np.stack([np.interp(x, np.linspace(0.0, 1.0, len(line)), column) for column in line.T], axis=1)
            found.append((rows, np.stack([axes.astype(complex), turns])))
        return found

    def _scaled(self, shape: _Shape, size: float) -> _Shape:
        """The shape so large that it is well seen."""
        if shape.bars:
            largest = max(float(np.linalg.norm(found[1].real, axis=1).max()) for _, found in shape.bars)
            bars = [(rows, np.stack([found[0], found[1] * (TURN / largest)])) for rows, found in shape.bars]
            return _Shape([0.0 * line for line in shape.lines], bars)
        largest = max(float(np.linalg.norm(line.real, axis=1).max()) for line in shape.lines)
        return _Shape([line * (REACH * size / max(largest, TINY)) for line in shape.lines], [])

    def _at(self, shape: _Shape, phase: float) -> list[Array]:
        """Flat lines (n, 2) of a shape at a phase of its period, bars among them."""
        turn = np.exp(1j * phase)
        lines = [base + (line * turn).real for base, line in zip(self._base, shape.lines, strict=True)]
        for rows, (axes, turns) in shape.bars:
            half = (
                BAR
                * self._sketch.size
                * quaternion.rotate(quaternion.from_rotation_vector((turns * turn).real), axes.real)
            )
            lines += [np.array([row - one, row + one]) for row, one in zip(rows, half, strict=True)]
        return [self._view.flat(line) for line in lines]

    # -- panels -----------------------------------------------------------------------------------

    def _make(self, count: int, shown: bool) -> None:
        """The figure: so many panels that fit what is drawn, with supports, equilibrium, frequencies and a legend."""
        flat = [
            line
            for shape in self._shapes
            for phase in (0.0, 0.5, 1.0, 1.5)
            for line in self._at(shape, phase * math.pi)
        ]
        marks = [self._view.flat(mark.points[np.isfinite(mark.points).all(axis=1)]) for mark in self._sketch.marks]
        points = np.vstack([*flat, *(self._view.flat(line) for line in self._base), *marks])
        low, high = points.min(axis=0), points.max(axis=0)
        span = np.maximum(high - low, 0.15 * float((high - low).max()))
        columns, width, height = _grid(count, float(span[1] / span[0]))
        rows = -(-count // columns)
        text = self._modes.scene.title + self._others()
        title = title_of(text)
        top = 0.35 + 0.2 * title.count("\n") if title else 0.1
        self.figure = new_figure(columns * width, rows * (height + 0.35) + top + 0.45, shown=shown)
        entitle(self.figure, text)
        panels = np.atleast_1d(self.figure.subplots(rows, columns)).ravel()
        middle, half = 0.5 * (low + high), 0.56 * span
        self._lines: list[tuple[LineCollection, LineCollection | None]] = []
        for number, panel in enumerate(panels):
            if number >= count:
                panel.set_axis_off()
                continue
            panel.set(xticks=[], yticks=[], xlim=middle[0] + [-half[0], half[0]], ylim=middle[1] + [-half[1], half[1]])
            panel.set_aspect("equal", adjustable="box")
            panel.spines[:].set_color("#D5D5D5")
            self._rest(panel)
            if number < len(self._shapes):
                panel.set_title(self._said(number), fontsize=8.5, loc="left", parse_math=False, gid="frequency")
                later = None if self._moving else _collection(panel, "later", LATER, 1.1)
                self._lines.append((_collection(panel, "shape", SHAPE, 2.0), later))
            else:
                panel.set_title("no mode found", fontsize=8.5, loc="left")
        _triad(panels[0], self._view)
        handles = [Line2D([], [], color=REST, linewidth=1.0, label="equilibrium")]
        if self._shapes:
            handles.append(Line2D([], [], color=SHAPE, linewidth=2.0, label="mode shape"))
            if not self._moving:
                handles.append(Line2D([], [], color=LATER, linewidth=1.1, label="half a period later"))
        self.figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)

    def _rest(self, panel: Axes) -> None:
        """The equilibrium, and what holds it."""
        lines = [self._view.flat(line) for line in self._base]
        panel.add_collection(
            LineCollection(lines, colors=REST, linewidths=1.0, gid="equilibrium", zorder=2.0), autolim=False
        )
        sheet = Sheet(self.figure, panel, panel, self._sketch)
        for mark in self._sketch.marks:
            sheet.draw(mark).set_clip_on(True)

    def _others(self) -> str:
        """What there is beside the modes that are drawn."""
        rigid, growing = self._modes.rigid, len(self._modes.growing)
        said = [f"{rigid} rigid-body mode{'s' * (rigid > 1)}"] if rigid else []
        said += [f"{growing} growing without oscillation"] if growing else []
        return f" (besides: {', '.join(said)})" if said else ""

    def _said(self, number: int) -> str:
        mode = self._modes.modes[number]
        damping = f", damping ratio {mode.damping:.2g}" if mode.damping else ""
        grows = " (grows)" if mode.damping < 0.0 else ""
        return (
            f"{number + 1}: {in_short(mode.omega)} rad/s, {in_short(mode.omega / (2.0 * math.pi))} Hz{damping}{grows}"
        )

    # -- phases -----------------------------------------------------------------------------------

    def show(self, phase: float) -> None:
        """Put all modes to a phase of their periods, rad; at zero they are largest."""
        self._phase(phase)

    def _phase(self, phase: float) -> None:
        for (lines, later), shape in zip(self._lines, self._shapes, strict=True):
            lines.set_segments(self._at(shape, phase))
            if later is not None:
                later.set_segments(self._at(shape, phase + math.pi))


def _collection(panel: Axes, name: str, colour: str, width: float) -> LineCollection:
    found = LineCollection([], colors=colour, linewidths=width, capstyle="round", gid=name, zorder=3.0)
    panel.add_collection(found, autolim=False)
    return found


def _grid(count: int, slope: float) -> tuple[int, float, float]:
    """Columns of panels, and width and height of each in inch; ``slope``: height over width of what is drawn."""
    choices = []
    for columns in range(1, min(count, 4) + 1):
        width = min(7.0, 11.0 / columns)
        height = float(np.clip(width * slope, 1.1, 4.2))
        rows = -(-count // columns)
        total = rows * (height + 0.35) + 0.8
        # What is lost: empty cells, paper beside the contents, and sheets that are higher than wide.
        lost = (rows * columns - count) / count + abs(math.log(height / (width * slope)))
        choices.append((lost + 2.0 * abs(math.log(columns * width / total / 1.5)), columns, width, height))
    return min(choices)[1:]


def _triad(panel: Axes, view: View) -> None:
    """Directions of the fixed axes in the corner."""
    arrow = {"arrowstyle": "<-", "color": SUPPORT, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}
    style: dict[str, Any] = {"fontsize": 7, "color": SUPPORT, "ha": "center", "va": "center", "arrowprops": arrow}
    for (x, y), letter in zip(view.flat(np.eye(3)), "xyz", strict=True):
        # What points to the viewer is not seen.
        if math.hypot(x, y) > 0.2:
            end = (22.0 * x, 22.0 * y)
            panel.annotate(
                letter, (14.0, 12.0), xytext=end, xycoords="axes points", textcoords="offset points", **style
            )
