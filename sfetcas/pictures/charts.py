"""Charts of paths: the factor against what moves most, or quantities over it, and deformed shapes along the way.

Stable stretches are drawn solid, unstable ones dashed; limit points are circles, bifurcations squares, and dots in
the colours of the shapes say where these are.  A bifurcation whose branches are not followed has its buckling mode,
drawn so large that it is well seen.  Where only motions are prescribed, the largest reaction at a moved
node stands over the factor instead.  Supports, joints, springs and obstacles are drawn with the shape at the end of
the path, as in pictures of answers; loads are not, as they grow along the way.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..description.answers import AnswerName
from ..mathematics.arrays import TINY, Array
from ..mechanics.displacements import Displacements
from ..paths.path import Branch, Path
from ..paths.paths import buckling_mode
from .curves import (
    FREQUENCIES,
    Curve,
    clipped,
    leave,
    one_or_several,
    quantities_named,
    said,
    shown_components,
    table_of,
)
from .files import check_ending, save_figure
from .glyphs import sketch_supports
from .looks import dashes_of
from .sheet import DOTTED, Sheet, axes_on, drawn_text, entitle, legend_above, name_upright, plot_line
from .showing import Picture, new_figure
from .sketch import REACH, REST, TWISTING, Course, Sketch, course_of, unit_for, view_of, with_prefix

__all__ = ["chart", "save_chart"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#8F3B76", "#CC9900", "#555555")
STYLES: dict[str, Any] = {"True": "-", "False": "--", "neutral": "-.", "not defined": ":"}
KINDS = ((True, "stable"), (False, "unstable"), ("neutral", "neutral"), ("not defined", "stability not defined"))
MARKS = {"limit point": "o", "bifurcation": "s", "transition": "^"}
FREQUENCY, FLUTTERING = "angular frequency", "d"
"""Of the lowest motions, and the mark where one of them starts to grow."""
LOADED = 5.0
"""A loaded node is told of unless another one moves by more than this many times as far."""

NARROW = 0.01
"""Half the width of the axis where nothing moves, over the size of the scene."""
SHAPES, OF_BRANCHES, OVER_EACH_OTHER = 5, 3, 2e-3
"""Deformed shapes of the path and of a branch at most, and how much they differ at least, over their size."""
BETWEEN = 8
"""Pieces of the curve between two points of a path."""
SAMPLES = np.linspace(0.0, 1.0, 61)
BUCKLING_MODES = 3
"""Bifurcations at most whose shapes are drawn, the first ones."""
SHADES = ("#0B1F4B", "#134B86", "#2A7AB8", "#5DA5D6", "#9CC7E8")
"""Of the shapes along the path, in this order."""


def save_chart(path: Path, file: str | os.PathLike[str], *, quantities: Sequence[str] | None = None) -> None:
    """Write :func:`chart` of a path to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`chart`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_chart(path, quantities, shown=False), file)


def chart(path: Path, quantity: str | None = None, *, quantities: Sequence[str] | None = None) -> Figure:
    """The chart of a path with its branches, and shapes at some of its points; a figure of 10 inch.

    Parameters
    ----------
    path : Path
    quantity : str, optional
        What is drawn over the load factor, as ``nodes.tip.position.y`` or ``reactions.root.force``; of a path with
        modes also ``modes.omega``.  Default: what moves most, under the factor, and of a path with modes the
        frequencies.
    quantities : sequence of str, optional
        Several of them, each component of a vector in a panel of its own.

    Raises
    ------
    SceneError
        There is no such quantity, or both are given.
    """
    return _chart(path, one_or_several(quantity, quantities), shown=True)


def _chart(path: Path, quantities: Sequence[str] | None, *, shown: bool) -> Picture:
    names = None if quantities is None else quantities_named(path.scene, quantities)
    found = [_telling(path)] if names is None else [one for name in names for one in _named(path, name)]
    if names is None and path.massive is not None:
        # What does not move says nothing beside the frequencies.
        found = [*([] if _still(path, found[0]) else found), _frequencies(path)]
    figure = new_figure(10.0, max(5.0, 0.9 + 2.2 * len(found)), shown=shown)
    grid = figure.add_gridspec(len(found), 2)
    panels = [figure.add_subplot(grid[i, 0]) for i in range(len(found))]
    right = figure.add_subplot(grid[:, 1])
    shapes = [*_shapes(path), *_buckling_modes(path)]
    for panel, quantity in zip(panels, found, strict=True):
        _draw_course(panel, path, quantity, shapes)
    if all(quantity.upright for quantity in found):
        for panel in panels[:-1]:
            panel.sharex(panels[-1])
            panel.tick_params(labelbottom=False)
            panel.set_xlabel("")
    legend_above(panels[0], list(_legend(path, frequencies=any(quantity.name == FREQUENCY for quantity in found))))
    entitle(figure, path.scene.title)
    _draw_shapes(right, path, shapes)
    return figure


@dataclass(frozen=True, eq=False)
class _Quantity:
    """What is drawn over the factor or, where not ``upright``, under it.

    Attributes
    ----------
    name, unit : str
    values : list of ndarray (points, curves)
        Of each branch, in the SI unit.
    node, axis
        Of a displacement: the node, or None, and the component.
    """

    name: str
    unit: str
    values: list[Array]
    node: str | None = None
    axis: int = 0
    upright: bool = False

    @property
    def every(self) -> Array:
        """All values."""
        return np.concatenate([values.ravel() for values in self.values])


def _named(path: Path, name: AnswerName) -> list[_Quantity]:
    """A quantity by its name, each component that is not zero throughout by itself."""
    if name.kind.name == FREQUENCIES:
        return [_frequencies(path)]
    tables = [table_of(name, [path.configuration(point) for point in branch.points]) for branch in path.branches]
    together = np.vstack(tables)
    if together.shape[1] == 1:
        return [_Quantity(said(name), name.kind.unit, tables, upright=True)]
    found = []
    for column in shown_components(together):
        one = replace(name, component=int(column))
        found.append(_Quantity(said(one), name.kind.unit, [t[:, [column]] for t in tables], upright=True))
    return found


def _frequencies(path: Path) -> _Quantity:
    """Angular frequencies of the lowest motions; those that do not oscillate have none."""
    count = max(len(point.omega) for branch in path.branches for point in branch.points if point.omega is not None)
    tables = []
    for branch in path.branches:
        table = np.full((len(branch.points), count), np.nan)
        for row, point in zip(table, branch.points, strict=True):
            if point.omega is not None:
                row[: len(point.omega)] = np.sort(point.omega)
        tables.append(table)
    return _Quantity(FREQUENCY, "rad/s", tables, upright=True)


def _telling(path: Path) -> _Quantity:
    """The component that changes most: of a reaction where only motions are prescribed, else of a displacement.

    A loaded node comes before others that do not move by far more, and there, of a path without branches, the
    direction of the load.  What tells the ends of branches apart comes before what does not, as mirrored branches
    lie on each other there.
    """
    scene = path.scene
    driven = scene.gravity is None and all(table == "motions" for table, _, _ in scene.driven)
    found = list(_reactions(path) if driven else _displacements(path))
    loaded = {load.node: np.abs(load.vector) for load in scene.loads.values() if load.type == "force"}

    def change(quantity: _Quantity) -> tuple[float, float]:
        change = 0.0 if _still(path, quantity) else float(np.ptp(quantity.every))
        ends = np.sort([float(values[-1, 0]) for values in quantity.values])
        if len(ends) > 1:
            # Each pair of ends that coincide counts.
            change *= 0.01 ** float((np.diff(ends) < 1e-3 * change).mean())
        if quantity.node is None or quantity.node not in loaded:
            return change, 0.0
        along = loaded[quantity.node]
        share = float(along[quantity.axis] / max(along.max(), TINY))
        return LOADED * change * (0.2 + 0.8 * share if len(ends) == 1 else 1.0), share

    return max(found, key=change)


def _displacements(path: Path) -> Iterator[_Quantity]:
    scene = path.scene
    moved = {motion.node for motion in scene.motions.values()}
    # Where nothing moves the first is told of: one that could.
    for name, node in sorted(scene.nodes.items(), key=lambda entry: entry[1].support != "free"):
        if name not in moved:
            rest = np.asarray(node.position)
            tables = [path.positions(name, i) - rest for i in range(len(path.branches))]
            yield from (replace(found, node=name) for found in _components(name, tables))
    for name in scene.members:
        rest = scene.center_lines[name].positions(np.array([0.5]))[0]
        yield from _components(f"middle of {name}", [_middles(path, branch, name) - rest for branch in path.branches])


def _middles(path: Path, branch: Branch, member: str) -> Array:
    half = np.array([0.5])
    return np.array([path.fields(point).along(member, half)["position"][0] for point in branch.points])


def _components(name: str, tables: list[Array]) -> Iterator[_Quantity]:
    for i, letter in enumerate("xyz"):
        yield _Quantity(f"displacement of {name} in {letter}", "m", [table[:, [i]] for table in tables], axis=i)


def _reactions(path: Path) -> Iterator[_Quantity]:
    for motion in path.scene.motions.values():
        number, kind, unit = (0, "force", "N") if motion.rotation is None else (1, "moment", "N m")
        tables = [
            np.array([path.fields(point).reaction(motion.node)[number] for point in branch.points])
            for branch in path.branches
        ]
        for i, letter in enumerate("xyz"):
            name = f"{kind} at {motion.node} {'in' if number == 0 else 'about'} {letter}"
            yield _Quantity(name, unit, [table[:, [i]] for table in tables], upright=True)


def _draw_course(axes: Axes, path: Path, quantity: _Quantity, shapes: Sequence[_Shape]) -> None:
    """Draw a quantity of all branches, and dots where the shapes are."""
    limits = clipped(quantity.every) if quantity.upright else None
    seen = quantity.every if limits is None else np.clip(quantity.every, *limits)
    unit, letters = unit_for(seen, quantity.unit)
    size = _size(path)
    if quantity.unit == "m" and (_still(path, quantity) or float(np.abs(seen).max()) > NARROW * size):
        # The unit of the axes beside it, on which the shapes are drawn.
        unit, letters = with_prefix(size, "m", 0.2)
    ends = list[Curve]()
    for number, branch in enumerate(path.branches):
        colour = _colour(number)
        for column in (quantity.values[number] / unit).T:
            _draw_branch(axes, branch, column, colour, upright=quantity.upright)
            ends.append(Curve(branch.factors, column * unit, colour))
        if quantity.name == FREQUENCY:
            for point in branch.flutter_points:
                axes.plot(point.factor, point.omega / unit, FLUTTERING, color=colour, markersize=7, gid="flutter point")
    for shape in shapes:
        point = quantity.values[shape.branch][shape.index] / unit
        factor = np.full(len(point), path.branches[shape.branch].factors[shape.index])
        places = (factor, point) if quantity.upright else (point, factor)
        axes.plot(*places, "o", color=shape.colour, markersize=5, zorder=3, gid="shape", clip_on=limits is not None)
    _calm(axes, path, quantity, unit)
    names = ("factor", f"{quantity.name}, {letters}".rstrip(", "))
    names = names if quantity.upright else names[::-1]
    axes.set_xlabel(drawn_text(names[0]), parse_math=False)
    name_upright(axes, names[1])
    axes.grid(color="#EBEBEB", linewidth=0.6)
    # More numbers like -0.0075 would run into each other.
    axes.locator_params(axis="x", nbins=6)
    if limits is not None:
        leave(axes, ends, limits, unit, quantity.unit)


def _draw_branch(axes: Axes, branch: Branch, values: Array, colour: str, *, upright: bool) -> None:
    """Draw values (points,) of a branch, stretch by stretch, with its critical points."""
    across, up = (branch.factors, values) if upright else (values, branch.factors)
    for stable, first, last in branch.stretches():
        label = dict(KINDS)[stable]
        line = _smooth(branch, first, last, np.column_stack([across, up]))
        axes.plot(*line.T, linestyle=STYLES[str(stable)], color=colour, linewidth=1.4, gid=label)
    for kind, mark in MARKS.items():
        here = [i for i, point in enumerate(branch.points) if point.kind == kind]
        axes.plot(across[here], up[here], mark, color=colour, fillstyle="none", markersize=7, gid=kind)


def _smooth(branch: Branch, first: int, last: int, places: Array) -> Array:
    """Places (n, 2) of the points from the ``first`` to the ``last``, with others on cubics over the arc between them.

    In contact, with memory, and where strings go slack or stops are reached, a path may have corners: lines are
    straight.
    """
    part = slice(first, last + 1)
    arcs = np.array([point.arc for point in branch.points])
    steps = np.diff(arcs)
    own = any(point.prepared is not None for point in branch.points)
    if own or len(arcs) < 3 or not (steps > 0.0).all() or not np.isfinite(places).all():
        return places[part]
    # SciPy's splines would take longer to import than the picture to draw.
    slopes = np.gradient(places, arcs, axis=0)[part]
    ends, step = places[part], steps[first:last, None, None]
    t = np.linspace(0.0, 1.0, BETWEEN, endpoint=False)[:, None]
    rise = 3.0 * t**2 - 2.0 * t**3
    between = ends[:-1, None] + rise * np.diff(ends, axis=0)[:, None]
    between += step * (t * (1.0 - t) ** 2 * slopes[:-1, None] - t**2 * (1.0 - t) * slopes[1:, None])
    return np.vstack([between.reshape(-1, 2), ends[-1:]])


def _calm(axes: Axes, path: Path, quantity: _Quantity, unit: float) -> None:
    """Where nothing moves rounding shall not fill the chart."""
    if _still(path, quantity):
        size, values = _size(path) / unit, quantity.every / unit
        axes.set_xlim(float(values.mean()) - NARROW * size, float(values.mean()) + NARROW * size)


def _still(path: Path, quantity: _Quantity) -> bool:
    """Whether a displacement is nowhere more than a ten-thousandth of the scene."""
    return not quantity.upright and float(np.ptp(quantity.every)) < 1e-4 * _size(path)


def _size(path: Path) -> float:
    """Largest extent of the undeformed scene along an axis, m."""
    points = np.vstack([line.positions(SAMPLES) for line in path.scene.center_lines.values()])
    return float(np.ptp(points, axis=0).max())


def _legend(path: Path, *, frequencies: bool) -> Iterator[Line2D]:
    seen = {stable for branch in path.branches for stable, _, _ in branch.stretches()}
    for stable, name in KINDS:
        if stable in seen:
            yield Line2D([], [], color="#333333", linestyle=STYLES[str(stable)], label=name)
    kinds = {point.kind for branch in path.branches for point in branch.points}
    for kind, mark in MARKS.items():
        if kind in kinds:
            yield Line2D([], [], color="#333333", marker=mark, linestyle="", fillstyle="none", label=kind)
    if frequencies and path.flutter_points:
        yield Line2D([], [], color="#333333", marker=FLUTTERING, linestyle="", label="flutter point")


@dataclass(frozen=True, eq=False)
class _Shape:
    """A deformed shape: of which branch and point, and how it looks; ``buckling``: drawn from there on, in any size."""

    branch: int
    index: int
    colour: str
    label: str
    dashes: Any
    buckling: Displacements | None = None


def _shapes(path: Path) -> list[_Shape]:
    """Shapes at the end and evenly along the path and its branches; none that looks like another."""
    count = len(path.points)
    chosen = list[tuple[int, int]]()
    for number, one in enumerate(path.branches):
        evenly = np.linspace(0, len(one.points) - 1, 1 + (OF_BRANCHES if number else SHAPES)).round().astype(int)
        chosen += [(number, int(i)) for i in np.unique(evenly)[1:]]
    rest = np.vstack([line.positions(SAMPLES) for line in path.scene.center_lines.values()])
    seen, found = [rest], list[_Shape]()
    for branch, index in chosen:
        point = path.branches[branch].points[index]
        line = np.vstack([path.fields(point).along(name, SAMPLES)["position"] for name in path.model.members])
        size = float(np.ptp(np.vstack([*seen, line]), axis=0).max())
        if min(float(np.abs(line - other).max()) for other in seen) > OVER_EACH_OTHER * size:
            seen.append(line)
            colour = SHADES[round(index * len(SHADES) / (count - 1)) - 1] if branch == 0 else _colour(branch)
            state = "" if point.stable is True else f", {dict(KINDS)[point.stable]}"
            where = f", branch {branch}" if branch else ""
            label = f"factor {point.factor:.4g}{where}{state}"
            if branch and index < len(path.branches[branch].points) - 1:
                # One entry of the legend for each branch.
                label, colour = "", _paler(colour)
            found.append(_Shape(branch, index, colour, label, dashes_of(point.stable)))
    return found


def _buckling_modes(path: Path) -> Iterator[_Shape]:
    """Shapes of the first bifurcations from which no branch was followed."""
    followed = {branch.bifurcation for branch in path.branches[1:]}
    indices = [i for i, point in enumerate(path.points) if point.kind == "bifurcation"]
    alone = [number for number in range(1, len(indices) + 1) if number not in followed]
    for place, number in enumerate(alone[:BUCKLING_MODES]):
        index, colour = indices[number - 1], _colour(len(path.branches) + place)
        label = f"buckling mode, factor {path.points[index].factor:.4g}"
        yield _Shape(0, index, colour, label, "-", buckling_mode(path, number))


def _buckled(course: Course, shapes: Sequence[_Shape]) -> Course:
    """The course with the lines of the buckling modes so far from their equilibria that they are well seen."""
    extent = float(np.ptp(course.everything, axis=0).max())
    earlier = list(course.earlier)
    for number, shape in enumerate(shapes):
        if shape.buckling is not None:
            lines = earlier[number]
            moved = [
                shape.buckling.along(name, np.linspace(0.0, 1.0, len(line)))
                for name, line in zip(course.members, lines, strict=True)
            ]
            largest, turned = (
                max(float(np.linalg.norm(found[key], axis=1).max()) for found in moved)
                for key in ("position", "rotation")
            )
            # What only twists moves no line.
            if largest > TWISTING * turned * extent * course.unit:
                scale = REACH * extent / largest
                earlier[number] = [line + scale * found["position"] for line, found in zip(lines, moved, strict=True)]
    return replace(course, earlier=earlier)


def _colour(branch: int) -> str:
    return COLOURS[branch % len(COLOURS)]


def _paler(colour: str) -> str:
    red, green, blue = (0.5 + 0.5 * share for share in to_rgb(colour))
    return to_hex((red, green, blue))


def _draw_shapes(paper: Axes, path: Path, shapes: list[_Shape]) -> None:
    """The shapes over the undeformed one, with what holds them as at the end of the path."""
    points = [*(path.branches[shape.branch].points[shape.index] for shape in shapes), path.points[-1]]
    course = _buckled(course_of(path.scene, [path.configuration(point) for point in points]), shapes)
    view = view_of(path.model.space, [course.everything])
    sketch = Sketch(path.scene, path.configuration(path.points[-1]), course, view)
    sketch_supports(sketch)
    assert isinstance(paper.figure, Figure)
    axes = axes_on(paper.figure, paper, sketch)
    _draw_lines(axes, course, shapes)
    columns = min(3, 1 + sum(bool(shape.label) for shape in shapes) // 5)
    below = -0.13 if axes is paper else 0.0
    handles, _ = axes.get_legend_handles_labels()
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, below)}
    if any(shape.buckling is not None for shape in shapes):
        place |= {"title": "buckling modes are drawn in an arbitrary size", "title_fontsize": 8}
    paper.legend(handles=handles, fontsize=8, ncols=columns, frameon=False, **place)
    Sheet(paper.figure, axes, paper, sketch).finish()


def _draw_lines(axes: Any, course: Course, shapes: list[_Shape]) -> None:
    """Undeformed and deformed lines, with entries for the legend."""
    text = (
        "undeformed" if any(shape.buckling is None for shape in shapes) else "undeformed; all equilibria look like it"
    )
    looks: list[tuple[list[Array], str, dict[str, Any]]] = [
        (course.rest, text, {"color": REST, "linewidth": 1.2, "linestyle": DOTTED, "gid": "undeformed"})
    ]
    for shape, lines in zip(shapes, course.earlier, strict=True):
        style = {"color": shape.colour, "linestyle": shape.dashes, "linewidth": 1.6, "gid": "shape"}
        looks.append((lines, shape.label, style))
    for lines, label, style in looks:
        for i, line in enumerate(lines):
            plot_line(axes, line, label=label if label and i == 0 else None, **style)
