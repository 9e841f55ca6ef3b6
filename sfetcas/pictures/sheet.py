"""The sheet of a picture: axes, what is drawn on them, layout, and the places where labels hide least."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch, Polygon
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, MultipleLocator
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]

from ..description.structure import unit
from ..mathematics.arrays import TINY, Array
from .colours import ColourQuantity
from .showing import new_figure
from .sketch import (
    BEHIND,
    FIELD,
    LOAD,
    MAGNET,
    MOTION,
    NATURAL,
    REACTION,
    REST,
    SUPPORT,
    TENDON,
    Label,
    Look,
    Mark,
    Sketch,
    dense,
    flat_unit,
    norm,
    rounded,
    thinned,
    with_prefix,
)

__all__ = [
    "DOTTED",
    "Sheet",
    "add_bar",
    "axes_on",
    "drawn_text",
    "entitle",
    "legend_above",
    "name_upright",
    "pieces_of",
    "plot_line",
    "sheet_of",
    "title_of",
]

DOTTED = (0, (1, 2))
"""Of the undeformed structure; dashes are for what is unstable."""
WIDTH, HEIGHT = 7.0, 5.0
MANY = 14
"""Labels; of more than that, those with the same text as another are left out."""
MOST_HIDDEN = 25.0
"""What a label may hide where there are too many: about half its width of a line in colour."""
FONT = 9.0
"""Height of labels, points."""
PLAIN = "#7F8FA6"
"""Of members without a value."""

SIGNED = LinearSegmentedColormap.from_list(
    "signed", ["#5E1A70", "#9970AB", "#D8D8D8", "#5AAE61", "#126B33"]
).with_extremes(bad=PLAIN)
SIZES = LinearSegmentedColormap.from_list(
    "sizes", ["#D8D8D8", "#7FBF9B", "#2A788E", "#404688", "#4B0C5C"]
).with_extremes(bad=PLAIN)


def sheet_of(sketch: Sketch, looks: Sequence[Look], quantity: ColourQuantity | None, *, shown: bool) -> Sheet:
    """A figure with axes, centre lines, colour bar, title and legend; :meth:`Sheet.finish` draws the sketch on it.

    Parameters
    ----------
    looks : those of the earlier lines and of the last
    quantity : what the values of the sketch are
    shown : whether the figure is registered with pyplot
    """
    figure = new_figure(WIDTH, HEIGHT, shown=shown)
    paper = figure.add_subplot()
    axes = axes_on(figure, paper, sketch)
    lines, values = _add_lines(axes, sketch, looks)
    if values is not None and quantity is not None:
        add_bar(figure, paper, [(lines, values)], quantity, space=sketch.step.model.space)
    entitle(figure, sketch.scene.title)
    handles = _legend(sketch, looks)
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=min(4, len(handles)), fontsize=8, frameon=False
        )
    return Sheet(figure, axes, paper, sketch)


def axes_on(figure: Figure, paper: Axes, sketch: Sketch) -> Any:
    """Axes for the lines of a sketch: those that are given, or in space others below them."""
    if sketch.view.angles is not None:
        return _space_axes(figure, paper, sketch)
    _fill_plane(paper, sketch)
    return paper


def plot_line(axes: Any, line: Array, **style: Any) -> Any:
    """Draw a centre line (n, 3) in drawn units on axes that :func:`axes_on` made, whose limits stay; what it is."""
    seen = line if hasattr(axes, "get_zlim") else line[:, :2]
    (drawn,) = axes.plot(*seen.T, scalex=False, scaley=False, **style)
    return drawn


def drawn_text(text: str) -> str:
    """A text on one line, a white box for what the font does not have."""
    font = get_font(findfont(FontProperties()))
    return " ".join("".join(c if c.isspace() or font.get_char_index(ord(c)) else "\ufffd" for c in text).split())


def title_of(text: str) -> str:
    """The title in up to three lines of about the same length."""
    known = drawn_text(text)
    lines = math.ceil(len(known) / 68)
    even = (textwrap.wrap(known, width) for width in range(max(20, len(known) // max(1, lines)), 69))
    fitting = (wrapped for wrapped in even if len(wrapped) <= min(3, lines))
    return "\n".join(next(fitting, textwrap.wrap(known, 68, max_lines=3, placeholder=" ...")))


def entitle(figure: Figure, text: str) -> None:
    """Write the title over a figure as :func:`title_of` breaks it; nothing for an empty one."""
    title = title_of(text)
    if title:
        figure.suptitle(title, fontsize=11, parse_math=False)


def legend_above(axes: Axes, handles: Sequence[Any] | None = None, columns: int = 4) -> None:
    """The legend above the frame, where it hides nothing; at its left axes tell numbers to be added."""
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    given = axes.get_legend_handles_labels()[0] if handles is None else handles
    if given:
        axes.legend(handles=given, ncols=columns, fontsize=8, frameon=False, **place)


def name_upright(axes: Axes, text: str) -> None:
    """Write what an upright axis tells, in as many lines as its height asks for, three at most."""
    part = axes.get_subplotspec()
    rows = 1 if part is None else part.get_gridspec().nrows
    letters = max(12, int(72.0 * (axes.figure.bbox.height / axes.figure.dpi / rows - NO_FRAME) / (0.6 * FONT)))
    lines = textwrap.wrap(drawn_text(text), letters, max_lines=3, placeholder=" ...")
    axes.set_ylabel("\n".join(lines), parse_math=False, fontsize=FONT)


UNSEEN = 0.5
"""Change of a layout, pixels, that nobody sees."""

NO_FRAME = 0.6
"""Inch of the height of a panel that its frame does not have."""


def _fill_plane(axes: Axes, sketch: Sketch) -> None:
    flat = sketch.view.flat(sketch.course.everything)
    middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    axes.set_xlim(middle[0] - sketch.size, middle[0] + sketch.size)
    axes.set_ylim(middle[1] - sketch.size, middle[1] + sketch.size)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(f"x, {sketch.course.letter}m")
    axes.set_ylabel(f"y, {sketch.course.letter}m")
    axes.grid(color="#EBEBEB", linewidth=0.6)
    axes.set_axisbelow(True)


def _space_axes(figure: Figure, paper: Axes, sketch: Sketch) -> Any:
    """Axes in space below the paper, on which marks and labels are drawn."""
    assert sketch.view.angles is not None
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    # They are as large as the figure: what else is in it shall be seen through them.
    axes.patch.set_visible(False)
    paper.set_axis_off()
    paper.set_zorder(axes.get_zorder() + 1)
    axes.set_proj_type("ortho")
    axes.view_init(*sketch.view.angles)
    behind = [mark.points[np.isfinite(mark.points[:, 0])] for mark in sketch.marks if mark.level <= BEHIND]
    shown = np.vstack([sketch.course.everything, *behind])
    low, high = shown.min(axis=0), shown.max(axis=0)
    half = 0.52 * np.maximum(high - low, 0.3 * float((high - low).max()))
    middle = 0.5 * (low + high)
    axes.set(xlim=_interval(middle, half, 0), ylim=_interval(middle, half, 1), zlim=_interval(middle, half, 2))
    for axis, letter in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_label_text(f"{letter}, {sketch.course.letter}m")
        axis.set_rotate_label(False)
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        # Axes in space take no other word for the look of their grid.
        axis._axinfo["grid"].update(color="#DCDCDC", linewidth=0.6)
    axes.set_box_aspect(half)
    return axes


def _interval(middle: Array, half: Array, i: int) -> tuple[float, float]:
    return (middle[i] - half[i], middle[i] + half[i])


def _add_lines(axes: Any, sketch: Sketch, looks: Sequence[Look]) -> tuple[Any, Array | None]:
    """Undeformed, earlier and last lines; the last ones, and the values (n,) N m to colour their pieces by."""
    course, space = sketch.course, sketch.view.angles is not None

    def add(lines: Sequence[Array], name: str, **style: Any) -> Any:
        kind = Line3DCollection if space else LineCollection
        found = kind(lines if space else [line[:, :2] for line in lines], gid=name, clip_on=not space, **style)
        axes.add_collection(found, **({} if space else {"autolim": False}))
        return found

    add(course.rest, "undeformed", colors=REST, linewidths=1.2, linestyles=DOTTED, zorder=2)
    for lines, look in zip(course.earlier, looks[:-1], strict=True):
        add(lines, "earlier", colors=look.colour, linewidths=1.3, linestyles=look.dashes, zorder=2.5)
    add(course.last, "outline", colors="#222222", linewidths=3.8, capstyle="round", zorder=3)
    style: dict[str, Any] = {"linewidths": 2.4, "capstyle": "round", "zorder": 3.5}
    if not course.values:
        return add(course.last, "deformed", colors=PLAIN, **style), None
    pieces, values = pieces_of(course.last, course.values)
    return add(list(pieces), "deformed", **style), values


def pieces_of(lines: Sequence[Array], values: Sequence[Array]) -> tuple[Array, Array]:
    """Pieces (n, 2, 3) of lines, and the mean values (n,) on them."""
    pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
    return pieces, np.concatenate([0.5 * (value[:-1] + value[1:]) for value in values])


def add_bar(
    figure: Figure, paper: Axes, coloured: Sequence[tuple[Any, Array]], quantity: ColourQuantity, *, space: bool
) -> float:
    """Colour pieces by their values (n,) in SI units, with a colour bar from zero to the extremes; its unit.

    ``coloured`` are collections of lines with their values, all on one scale.
    """
    every = np.concatenate([values for _, values in coloured])
    known, signed = every[np.isfinite(every)], quantity.diverging(space)
    low, high = min(0.0, float(known.min())), max(0.0, float(known.max()))
    largest = max(high, -low)
    factor, unit = with_prefix(largest, quantity.unit, 0.2)
    norm = Normalize(-largest / factor if signed else 0.0, largest / factor)
    for lines, values in coloured:
        lines.set(cmap=SIGNED if signed else SIZES, norm=norm)
        lines.set_array(np.ma.masked_invalid(values / factor))
    bar = figure.colorbar(coloured[-1][0], ax=paper, shrink=0.85, aspect=32, pad=0.02)
    bar.ax.set_ylim(low / factor, high / factor)
    bar.set_label(f"{quantity.label(space)}, {unit}")
    return factor


def _legend(sketch: Sketch, looks: Sequence[Look]) -> list[Any]:
    """What the lines and arrows are; the last line only where there is something to say about it."""
    handles: list[Any] = [Line2D([], [], color=REST, linewidth=1.2, linestyle=DOTTED, label="undeformed")]
    said: dict[str, Any] = {}
    for look, width in zip(looks, [*[1.3] * (len(looks) - 1), 3.0], strict=True):
        said.setdefault(
            look.text, Line2D([], [], color=look.colour, linewidth=width, linestyle=look.dashes, label=look.text)
        )
    said.pop("", None)
    handles += said.values()
    drawn = {mark.name.partition("-")[0] for mark in sketch.marks}
    arrows = {"load": (LOAD, "load"), "reaction": (REACTION, "reaction"), "motion": (MOTION, "prescribed motion")}
    arrows |= {"field": (FIELD, "magnetic field"), "magnet": (MAGNET, "magnet, to its north pole")}
    for name, (colour, text) in arrows.items():
        if name in drawn:
            line = Line2D([], [], color=colour, marker=">", markersize=5, label=text)
            line.set_linestyle(":" if name == "motion" else "-")
            handles.append(line)
    if "actuation" in drawn:
        handles.append(Line2D([], [], color=NATURAL[0], linewidth=2.2, label="natural curvature"))
    if "tendon" in drawn:
        kinds = {"chamber" if tendon.pressure is not None else "tendon" for tendon in sketch.scene.tendons.values()}
        text = " or ".join(sorted(kinds, reverse=True))
        handles.append(Line2D([], [], color=TENDON, linewidth=1.4, label=text))
    if "contact" in drawn:
        handles.append(Patch(facecolor="white", edgecolor=SUPPORT, hatch="////", linewidth=0.7, label="obstacle"))
    return handles


@dataclass(frozen=True, eq=False)
class _Box:
    """A text's place: centre and half its width and height, pixels."""

    centre: Array
    half: Array

    @property
    def corners(self) -> Array:
        """(2, 2)."""
        return np.array([self.centre - self.half, self.centre + self.half])

    def holds(self, points: Array) -> Any:
        """Which of the points (n, 2) are inside."""
        return (np.abs(points - self.centre) < self.half).all(axis=1)

    def meets(self, other: _Box) -> bool:
        """Whether the boxes overlap."""
        return bool((np.abs(self.centre - other.centre) < self.half + other.half).all())


def _box_of(text: Text, margin: float = 0.0) -> _Box:
    extent = text.get_window_extent()
    low, high = np.array(extent.min), np.array(extent.max)
    return _Box(0.5 * (low + high), 0.5 * (high - low) + margin)


def _text_width(text: str) -> float:
    """Estimated width of a label, points."""
    return 0.6 * FONT * len(text)


def _arrow(points: Array, mark: Mark, style: dict[str, Any]) -> FancyArrowPatch:
    head = 7.0 + 2.5 * mark.width
    look: dict[str, Any] = {
        "arrowstyle": "-|>",
        "mutation_scale": head,
        "shrinkA": 0,
        "shrinkB": 0,
        "color": mark.colour,
    }
    look |= {"linewidth": mark.width, "linestyle": ":" if mark.dotted else "-", "joinstyle": "miter"}
    return FancyArrowPatch(path=Outline(points), fill=True, **look, **style)


@dataclass(eq=False)
class Sheet:
    """A figure with its axes, the same where marks are drawn on, and what is to be drawn; ``drawn``: its marks."""

    figure: Figure
    axes: Any
    paper: Axes
    sketch: Sketch
    zoom: float = 1.0
    drawn: list[Artist] = field(default_factory=list)

    def finish(self, *, gravity: float = 0.0) -> None:
        """Fit the axes to all that is drawn, and draw it, with so many times the gravity."""
        self._fit_drawn()
        if self.axes is not self.paper:
            self._hide_colliding()
        left_out = len(self._labels()) - len(self._placed([]))
        if left_out:
            self._tell_left_out(left_out)
            self._laid_out()
            self._fit(self._content())
            self._laid_out()
        self.drawn += [self.draw(mark) for mark in self.sketch.marks]
        placed = self._placed(self._gravity(gravity))
        self._tell_left_out(len(self._labels()) - len(placed))
        for label, box in placed:
            self._write(box.centre, label.text, label.colour, label.name)

    def _fit_drawn(self) -> None:
        """Fit the axes until that changes little, and leave them laid out."""
        self._laid_out()
        if self.axes is not self.paper:
            # What else is laid out axes in space do not change.
            self._fitted(6)
            return
        # Where nothing but limits changes the layout stays; other tick labels change it once more.
        for _ in range(2):
            self._fitted(4)
            laid = np.array(self.axes.get_window_extent().extents)
            self._laid_out()
            if np.abs(np.array(self.axes.get_window_extent().extents) - laid).max() < UNSEEN:
                break

    def _fitted(self, times: int) -> None:
        """Fit the axes to what is on them until that changes little, so many times at most."""
        content = self._content()
        for _ in range(times):
            before = content
            self._fit(before)
            self._place_ticks()
            content = self._content()
            if np.abs(content - before).max() < UNSEEN:
                break

    def _laid_out(self) -> None:
        """Give all parts of the figure their places, without drawing them."""
        layout = self.figure.get_layout_engine()
        if layout is not None:
            layout.execute(self.figure)
        self._place_ticks()

    def _place_ticks(self) -> None:
        """Ticks in space stand where they were drawn last: draw them."""
        if self.axes is not self.paper:
            self.axes.draw(self._renderer())

    def _tell_left_out(self, count: int) -> None:
        text = f"{count} values are not written for lack of room; the largest are" if count else ""
        self.paper.set_title(text, fontsize=8, color=SUPPORT, gid="left-out")

    def pixels(self, points: Array) -> Array:
        """Places (n, 2) on the sheet of points (n, 3) in drawn units."""
        return np.asarray(self.axes.transData.transform(self._projected(points)))

    def _projected(self, points: Array) -> Array:
        if self.axes is self.paper:
            return self.sketch.view.flat(points)
        x, y, _ = proj3d.proj_transform(*points.T, self.axes.get_proj())
        return np.stack([np.asarray(x), np.asarray(y)], axis=1)

    def _point(self) -> float:
        return float(self.figure.dpi) / 72.0

    def _size(self) -> float:
        """Size of the picture in pixels."""
        middle = self.sketch.course.everything[0]
        ends = self.pixels(np.array([middle, middle + self.sketch.size * self.sketch.view.right]))
        return norm(ends[1] - ends[0])

    # -- layout -----------------------------------------------------------------------------------

    def _content(self) -> Array:
        """Corners (2, 2) in pixels of the structure, the marks and the labels."""
        sketch = self.sketch
        parts = [self.pixels(sketch.course.everything)]
        parts += [self.pixels(mark.points[np.isfinite(mark.points).all(axis=1)]) for mark in sketch.marks]
        parts += [box.corners for _, box in self._placed([], framed=False)]
        pixels = np.vstack(parts)
        margin = 9.0 * self._point()
        return np.array([pixels.min(axis=0) - margin, pixels.max(axis=0) + margin])

    def _fit(self, content: Array) -> None:
        """Fit the axes to corners (2, 2) in pixels of what is on them."""
        if self.axes is self.paper:
            self._fit_plane(content)
        else:
            self._fit_space(content)

    def _fit_plane(self, content: Array) -> None:
        size = np.array(self.axes.get_position(original=True).size) * self.figure.bbox.size
        half = 0.5 * size * float(((content[1] - content[0]) / size).max())
        middle = content.mean(axis=0)
        (left, low), (right, high) = self.axes.transData.inverted().transform([middle - half, middle + half])
        self.axes.set_xlim(left, right)
        self.axes.set_ylim(low, high)
        ticks = MaxNLocator(nbins=10, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, max(right - left, 1.2 * (high - low)))
        for axis in (self.axes.xaxis, self.axes.yaxis):
            axis.set_major_locator(MultipleLocator(float(ticks[1] - ticks[0])))
        self.axes.apply_aspect()

    def _fit_space(self, content: Array) -> None:
        cell, renderer = self.paper.get_window_extent(), self._renderer()
        limits = np.array([self.axes.get_xlim(), self.axes.get_ylim(), self.axes.get_zlim()])
        ticks = [axis.get_tightbbox(renderer) for axis in self._axes_in_space()]
        corners = self.pixels(np.array(list(itertools.product(*limits))))
        low = np.min([content[0], corners.min(axis=0), *(box.min for box in ticks)], axis=0)
        high = np.max([content[1], corners.max(axis=0), *(box.max for box in ticks)], axis=0)
        self.zoom *= float((cell.size / (high - low)).min())
        self.axes.set_box_aspect(limits @ [-0.5, 0.5], zoom=self.zoom)
        left, bottom, width, height = self.axes.get_position(original=True).bounds
        shift = (0.5 * (cell.min + cell.max - low - high)) / self.figure.bbox.size
        for axis in self._axes_in_space():
            self._space_out(axis)
        # Last: up to the next drawing a new position is that of axes as wide as the figure.
        self.axes.set_position((left + shift[0], bottom + shift[1], width, height))

    def _renderer(self) -> Any:
        """What measures texts, on the canvas that the figure has or on one for a moment."""
        canvas = self.figure.canvas
        renderer = FigureCanvasAgg(self.figure).get_renderer()  # type: ignore[no-untyped-call]
        self.figure.set_canvas(canvas)
        return renderer

    def _axes_in_space(self) -> tuple[Any, Any, Any]:
        return self.axes.xaxis, self.axes.yaxis, self.axes.zaxis

    def _space_out(self, axis: Any) -> None:
        """Ticks some way apart; their labels, and that of the axis, at a fixed distance of the axis on the sheet."""
        line = self.axes.transData.transform(np.stack(axis.line.get_data(), axis=1))
        length, point = np.abs(line[1] - line[0]), self._point()
        width = 6.5 * max([4, *(len(label.get_text()) for label in self._tick_labels(axis))])
        # Labels along the axis are apart when they are either beside or above each other.
        bins = min(6, max(2, int((length / (point * np.array([width + 10.0, 20.0]))).max())))
        axis.set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10], min_n_ticks=2))
        off = self.axes.transData.transform(axis.label.get_position()) - line.mean(axis=0)
        across = np.abs(off) / norm(off)
        tick = 5.0 + float(across @ [0.42 * width, 5.0])
        per_pad = norm(off) / (point * (axis.labelpad + 21.0))
        axis.set_tick_params(pad=tick / per_pad - 8.0)
        axis.labelpad = (2.0 * tick + float(across @ [18.0, 8.0])) / per_pad - 21.0

    # -- marks ------------------------------------------------------------------------------------

    def draw(self, mark: Mark) -> Artist:
        """Draw a mark; what it is in the figure."""
        if mark.level <= BEHIND and self.axes is not self.paper:
            return self._draw_behind(mark)
        points = self._projected(mark.points)
        style: dict[str, Any] = {
            "transform": self.axes.transData,
            "zorder": mark.level,
            "gid": mark.name,
            "clip_on": False,
        }
        if mark.kind == "area":
            patch = Polygon(points, facecolor=mark.fill, edgecolor=mark.colour, linewidth=mark.width, **style)
            return self.paper.add_patch(patch)
        if mark.kind == "arrow":
            return self.paper.add_patch(_arrow(points, mark, style))
        if mark.kind == "dot":
            style |= {"marker": "o", "markersize": 5.5, "markerfacecolor": mark.fill}
        line = Line2D(points[:, 0], points[:, 1], color=mark.colour, linewidth=mark.width, **style)
        return self.paper.add_line(line)

    def _draw_behind(self, mark: Mark) -> Artist:
        """Draw among the lines in space, which the paper is in front of."""
        style: dict[str, Any] = {"zorder": mark.level, "gid": mark.name, "clip_on": False, "linewidth": mark.width}
        if mark.kind == "area":
            area = Poly3DCollection([mark.points], facecolor=mark.fill, edgecolor=mark.colour, **style)
            self.axes.add_collection3d(area, autolim=False)
            return area
        (line,) = self.axes.plot(*mark.points.T, color=mark.colour, **style)
        return line

    def _gravity(self, factor: float) -> list[_Box]:
        """Draw gravity in the corner that is the emptiest; what it covers."""
        gravity = self.sketch.scene.gravity
        if gravity is None or not any(gravity) or factor == 0.0:
            return []
        text, point = f"gravity {rounded(abs(factor) * norm(gravity)):g} m/s²", self._point()
        half = np.array([0.5 * _text_width(text) + 4.0, 28.0]) * point
        crowd, writings = self._crowd()[0], self._writings()

        def hidden(corner: _Box) -> int:
            return int(corner.holds(crowd).sum()) + sum(len(crowd) * corner.meets(box) for box in writings)

        box = min(self._corners(half), key=hidden)
        direction = flat_unit(self.sketch.view.flat(math.copysign(1.0, factor) * np.array(unit(gravity))), (0.0, -1.0))
        middle = box.centre + np.array([0.0, 7.0 * point])
        ends = np.array([middle - 17.0 * point * direction, middle + 17.0 * point * direction])
        points = self.paper.transAxes.inverted().transform(ends)
        mark = Mark(kind="arrow", points=points, name="gravity", colour=LOAD, width=1.8)
        self.paper.add_patch(_arrow(points, mark, {"transform": self.paper.transAxes, "gid": "gravity", "zorder": 7.0}))
        self._write(box.centre - np.array([0.0, 20.0 * point]), text, LOAD, "gravity")
        return [box]

    def _corners(self, half: Array) -> Iterator[_Box]:
        frame = self.paper.get_window_extent()
        margin = half + 4.0 * self._point()
        for x in (frame.x1 - margin[0], frame.x0 + margin[0]):
            for y in (frame.y1 - margin[1], frame.y0 + margin[1]):
                yield _Box(np.array([x, y]), half)

    # -- labels -----------------------------------------------------------------------------------

    def _write(self, centre: Array, text: str, colour: str, name: str) -> None:
        x, y = self.paper.transAxes.inverted().transform(centre)
        style: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontsize": FONT,
            "zorder": 9.0,
            "gid": name,
            "parse_math": False,
        }
        style |= {"color": colour, "path_effects": [withStroke(linewidth=2.0, foreground="white")]}
        self.paper.text(x, y, text, transform=self.paper.transAxes, **style).set_in_layout(False)

    def _crowd(self) -> tuple[Array, Array]:
        """Samples (n, 2) in pixels of what labels should not hide, and how bad it is to hide one (n,)."""
        sketch, spacing = self.sketch, 3.0 * self._point()
        earlier = [line for lines in sketch.course.earlier for line in lines]
        kinds = [
            (1.0, [self.pixels(line) for line in (*sketch.course.rest, *earlier)]),
            (2.5, [self.pixels(line) for line in sketch.course.last]),
            (1.5, [self.axes.transData.transform(line) for line in self._axis_lines()]),
            (4.0, [self.pixels(mark.points) for mark in sketch.marks if mark.level > BEHIND]),
            (0.5, [self.pixels(mark.points) for mark in sketch.marks if mark.level <= BEHIND]),
        ]
        parts = [
            (cost, thinned(np.vstack([dense(line, spacing) for line in lines]), spacing))
            for cost, lines in kinds
            if lines
        ]
        return np.vstack([part for _, part in parts]), np.concatenate(
            [np.full(len(part), cost) for cost, part in parts]
        )

    def _axis_lines(self) -> list[Array]:
        if self.axes is self.paper:
            return []
        return [np.stack(axis.line.get_data(), axis=1) for axis in self._axes_in_space()]

    def _tick_labels(self, axis: Any) -> list[Text]:
        """Those that were drawn last; asking the axis itself would move them."""
        low, high = sorted(axis.get_view_interval())
        ticks = axis.majorTicks[: len(axis.get_majorticklocs())]
        return [tick.label1 for tick in ticks if low <= tick.get_loc() <= high and tick.label1.get_visible()]

    def _writings(self) -> list[_Box]:
        """Boxes of the tick labels and axis labels in space, which are among the lines."""
        if self.axes is self.paper:
            return []
        texts = [text for axis in self._axes_in_space() for text in (axis.label, *self._tick_labels(axis))]
        return [_box_of(text) for text in texts]

    def _hide_colliding(self) -> None:
        """Hide tick labels in space over others or close to those of another axis, sooner on an axis that has many."""
        shown: list[_Box] = []
        for labels in sorted(map(self._tick_labels, self._axes_in_space()), key=len):
            own: list[_Box] = []
            for label in labels:
                box, tight = _box_of(label, 2.0 * self._point()), _box_of(label, -1.0 * self._point())
                label.set_visible(not any(box.meets(other) for other in shown) and not any(map(tight.meets, own)))
                own += [tight] if label.get_visible() else []
            shown += own

    def _placed(self, taken: Sequence[_Box], *, framed: bool = True) -> list[tuple[Label, _Box]]:
        """The labels where they hide least, and within the frame where there is one.

        Where some would overlap the largest values come first, and what still meets others is left out.
        """
        cell = self.paper.get_window_extent()
        inside = framed and self.axes is self.paper
        frame = np.array([cell.min, cell.max]) if inside else np.array([[-np.inf], [np.inf]])
        labels, crowd, boxes = self._labels(), self._crowd(), [*taken, *self._writings()]
        tried = self._tried(labels, crowd, boxes, frame)
        if any(met for _, _, met in tried):
            largest: dict[str, float] = {}
            for label in labels:
                largest[label.unit] = max(label.value, largest.get(label.unit, TINY))
            # What has no value, as the number of an equilibrium, is never left out.
            order = sorted(labels, key=lambda label: -label.value / largest[label.unit] if label.unit else -math.inf)
            tried = self._tried(order, crowd, boxes, frame, thin=True)
        return [(label, box) for label, box, _ in tried]

    def _tried(
        self,
        labels: Sequence[Label],
        crowd: tuple[Array, Array],
        taken: Sequence[_Box],
        frame: Array,
        *,
        thin: bool = False,
    ) -> list[tuple[Label, _Box, bool]]:
        """Labels in turn with their best places, and whether they meet others there.

        ``thin``: only those that do not, hide little and stand beside their anchors, and the first of each kind.
        """
        found, boxes, kinds = list[tuple[Label, _Box, bool]](), list(taken), set[tuple[str, str]]()
        for label in labels:
            half = self._half(label.text)
            may_go = thin and bool(label.unit) and (label.unit, label.colour) in kinds
            kinds.add((label.unit, label.colour))
            choices = list(self._choices(label, half, rings=1 if may_go else 3))
            centres = np.array([centre for _, centre in choices])
            hidden, met, outside = self._costs(centres, half, crowd, boxes, frame)
            best = int(np.argmin(np.array([cost for cost, _ in choices]) + hidden + 80.0 * met + 40.0 * outside))
            if not (may_go and (met[best] or hidden[best] > MOST_HIDDEN)):
                boxes.append(_Box(centres[best], half))
                found.append((label, boxes[-1], bool(met[best])))
        return found

    def _labels(self) -> list[Label]:
        """The labels that are asked for; of many alike one."""
        labels = self.sketch.labels
        if len(labels) <= MANY:
            return labels
        return list({(label.text, label.colour): label for label in reversed(labels)}.values())[::-1]

    @staticmethod
    def _costs(
        centres: Array, half: Array, crowd: tuple[Array, Array], boxes: Sequence[_Box], frame: Array
    ) -> tuple[Array, Array, Array]:
        """Of boxes at places (k, 2): how bad what they hide is, how many others they meet, which are outside."""
        low, high = centres - half, centres + half
        points, prices = crowd
        near = ((points >= low.min(axis=0)) & (points <= high.max(axis=0))).all(axis=1)
        inside = (np.abs(points[near] - centres[:, None]) < half).all(axis=2)
        others = np.array([[box.centre, box.half] for box in boxes]).reshape(-1, 2, 2)
        met = (np.abs(centres[:, None] - others[:, 0]) < half + others[:, 1]).all(axis=2).sum(axis=1)
        return inside @ prices[near], met, ((low < frame[0]) | (high > frame[1])).any(axis=1)

    def _choices(self, label: Label, half: Array, rings: int) -> Iterator[tuple[float, Array]]:
        """Places round the anchor, the preferred ones first and cheap."""
        point = self._point()
        anchor, clear = self.pixels(label.anchor[None, :])[0], label.gap * self._size()
        preferred = math.atan2(label.away[1], label.away[0])
        for ring in range(rings):
            for turn in (0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6):
                angle = preferred + turn * math.pi / 6.0
                towards = np.array([math.cos(angle), math.sin(angle)])
                reach = float(np.abs(towards) @ half) * (1.0 - 0.25 * abs(math.sin(2.0 * angle)))
                gap = clear + (2.0 + 9.0 * ring) * point
                yield 0.3 * abs(turn) + 4.0 * ring, anchor + (reach + gap) * towards

    def _half(self, text: str) -> Array:
        return np.array([0.5 * _text_width(text) + 1.0, 0.7 * FONT]) * self._point()
