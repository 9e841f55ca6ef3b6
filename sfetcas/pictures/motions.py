"""Pictures of motions: positions at several times over each other, histories of a node, and energies.

Positions are pale at first and bold at the end; thin lines are the ways of free ends.  Loads are not drawn, as they
change in time.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from ..description.records import nearest
from ..dynamics.motion import MotionState, Trajectory
from ..errors import SceneError
from ..mathematics.arrays import Array
from .files import DPI, check_ending, save_figure
from .glyphs import sketch_supports
from .sheet import DOTTED, Sheet, axes_on, drawn_text, plot_line, title_of
from .sketch import REST, Ink, Sketch, course_of, prefix, view_of

__all__ = ["histories", "most_moving", "motion_picture", "save_histories", "save_motion"]

STROBES = 10
"""Positions drawn at most."""
MOST_WAYS = 4
"""Ways of nodes drawn at most."""
WAY = "#CC5FA0"
TIMES = LinearSegmentedColormap.from_list("times", ["#C6D8EA", "#5DA5D6", "#134B86", "#0B1F4B"])
COMPONENTS = ("#0072B2", "#D55E00", "#009E73")
ENERGIES = {"kinetic": "#D55E00", "elastic": "#009E73", "loads": "#0072B2", "total": "#222222"}
BEGUN = 2e-3
"""Apart by this much of the size the undeformed scene is drawn beside the first position."""


def save_motion(motion: Trajectory, file: str | os.PathLike[str]) -> None:
    """Write :func:`motion_picture` of a motion to a file, in the format of its ending.

    Raises
    ------
    SceneError
        The ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(motion_picture(motion), file)


def save_histories(motion: Trajectory, file: str | os.PathLike[str], nodes: Sequence[str] | None = None) -> None:
    """Write :func:`histories` of a motion to a file, in the format of its ending.

    Raises
    ------
    SceneError
        The ending is none of ``files.ENDINGS``, or there is no such node.
    """
    check_ending(file)
    save_figure(histories(motion, nodes), file)


def motion_picture(motion: Trajectory) -> Figure:
    """Positions over each other, the history of the node that moves most, and energies; a figure of 11 x 5.5 inch."""
    figure = Figure(figsize=(11.0, 5.5), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08, wspace=0.03))
    grid = figure.add_gridspec(2, 2, width_ratios=[1.2, 1.0])
    paper, above = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, 1], sharex=above)
    _draw_history(above, motion, most_moving(motion), "position")
    _draw_energies(below, motion)
    above.tick_params(labelbottom=False)
    _say_times(below, motion)
    title = title_of(motion.scene.title)
    if title:
        figure.suptitle(title, fontsize=11, parse_math=False)
    _draw_strobes(figure, paper, motion)
    return figure


def histories(motion: Trajectory, nodes: Sequence[str] | None = None) -> Figure:
    """Positions and velocities of nodes over time; a figure of 9 inch.

    Parameters
    ----------
    motion : Trajectory
    nodes : sequence of str, optional
        Default: the one that moves most.

    Raises
    ------
    SceneError
        There is no such node.
    """
    names = [most_moving(motion)] if nodes is None else list(nodes)
    for name in names:
        if name not in motion.last.model.nodes:
            raise SceneError(f"found node {name!r}; {nearest(name, motion.last.model.nodes)}")
    if not names:
        raise SceneError("found none, accepted: names of nodes", ("nodes",))
    figure = Figure(figsize=(9.0, 0.6 + 2.4 * len(names)), dpi=DPI, layout="constrained")
    table = figure.subplots(len(names), 2, sharex=True, squeeze=False)
    for row, name in zip(table, names, strict=True):
        for axes, quantity in zip(row, ("position", "velocity"), strict=True):
            _draw_history(axes, motion, name, quantity)
    for axes in table[-1]:
        _say_times(axes, motion)
    return figure


def most_moving(motion: Trajectory) -> str:
    """The node that goes the farthest from where it began."""
    nodes = motion.last.model.nodes
    ways = [motion.positions(name) for name in nodes]
    return nodes[int(np.argmax([np.linalg.norm(way - way[0], axis=1).max() for way in ways]))]


# Over time


def _draw_history(axes: Axes, motion: Trajectory, node: str, quantity: str) -> None:
    values = motion.positions(node) if quantity == "position" else motion.velocities(node)
    factor, letter = prefix(float(np.abs(values).max()), 0.1)
    for i, name in enumerate("xyz" if motion.last.model.space else "xy"):
        _draw_values(axes, motion, values[:, i] / factor, name, COMPONENTS[i])
    unit = "m" if quantity == "position" else "m/s"
    _finish(axes, f"{quantity} of {node}, {letter}{unit}")


def _draw_energies(axes: Axes, motion: Trajectory) -> None:
    values = {kind: motion.energies(kind) for kind in ENERGIES}
    factor, letter = prefix(max(float(np.abs(column).max()) for column in values.values()), 0.1)
    for kind, colour in ENERGIES.items():
        # Where one energy is nearly all, it is seen below the dashes of the total.
        _draw_values(axes, motion, values[kind] / factor, kind, colour, "--" if kind == "total" else "-")
    _finish(axes, f"energy, {letter}N m")


def _draw_values(axes: Axes, motion: Trajectory, values: Array, name: str, colour: str, dashes: str = "-") -> None:
    # A single answer is no line.
    style: dict[str, Any] = {"marker": "o", "markersize": 4} if len(values) == 1 else {}
    times = motion.times / _unit_of_time(motion)[0]
    axes.plot(times, values, color=colour, linewidth=1.5, linestyle=dashes, label=name, **style)


def _finish(axes: Axes, name: str) -> None:
    axes.set_ylabel(drawn_text(name), parse_math=False)
    axes.grid(color="#EBEBEB", linewidth=0.6)
    axes.margins(x=0.01)
    # Above the frame it hides nothing.
    axes.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 0.98), fontsize=8, frameon=False, borderaxespad=0.2)


def _unit_of_time(motion: Trajectory) -> tuple[float, str]:
    return prefix(motion.last.time, 0.1)


def _say_times(axes: Axes, motion: Trajectory) -> None:
    axes.set_xlabel(f"time, {_unit_of_time(motion)[1]}s")


# Positions over each other


def _draw_strobes(figure: Figure, paper: Axes, motion: Trajectory) -> None:
    chosen = _chosen(motion)
    scene = motion.last.model.scene
    course = course_of(scene, chosen, "none")
    view = view_of(motion.last.model.space, [course.everything])
    sketch = Sketch(scene, chosen[-1], course, view)
    sketch_supports(sketch)
    _sketch_ways(sketch, motion)
    axes = axes_on(figure, paper, sketch)
    unit, letter = _unit_of_time(motion)
    first, last = chosen[0].time / unit, chosen[-1].time / unit
    shades = Normalize(first, last if last > first else first + 1.0)
    begun = [line for step in (course.earlier or [course.last])[:1] for line in step]
    apart = max(float(np.abs(a - b).max()) for a, b in zip(course.rest, begun, strict=True))
    undeformed = apart > BEGUN * float(np.ptp(course.everything, axis=0).max())
    if undeformed:
        for line in course.rest:
            plot_line(axes, line, color=REST, linewidth=1.2, linestyle=DOTTED, gid="undeformed")
    for i, (lines, step) in enumerate(zip((*course.earlier, course.last), chosen, strict=True)):
        style = {"color": TIMES(shades(step.time / unit)), "linewidth": 1.1 + 1.3 * (i + 1) / len(chosen)}
        for line in lines:
            plot_line(axes, line, gid="strobe", **style)
    if last > first:
        bar = figure.colorbar(ScalarMappable(shades, TIMES), ax=paper, shrink=0.85, aspect=32, pad=0.02)
        bar.set_label(f"time of the position, {letter}s")
    handles = list(_legend(sketch, undeformed=undeformed))
    if handles:
        place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.985), "borderaxespad": 0.2}
        paper.legend(handles=handles, fontsize=8, ncols=3, frameon=False, **place)
    Sheet(figure, axes, paper, sketch).finish(gravity=1.0)


def _legend(sketch: Sketch, *, undeformed: bool) -> Iterator[Line2D]:
    if undeformed:
        yield Line2D([], [], color=REST, linewidth=1.2, linestyle=DOTTED, label="undeformed")
    if any(mark.name.startswith("way-") for mark in sketch.marks):
        yield Line2D([], [], color=WAY, linewidth=0.9, label="way of a node")


def _chosen(motion: Trajectory) -> list[MotionState]:
    """Answers evenly over the time."""
    wanted = np.linspace(motion.times[0], motion.times[-1], STROBES)
    return [motion.steps[i] for i in np.unique(np.abs(motion.times - wanted[:, None]).argmin(axis=1))]


def _sketch_ways(sketch: Sketch, motion: Trajectory) -> None:
    """Ways of the free ends that move the farthest, or of the node that does, with their names."""
    scene, course = sketch.scene, sketch.course
    ends = [
        name
        for name, node in scene.nodes.items()
        if node.support == "free" and sum(name in member.nodes for member in scene.members.values()) == 1
    ]
    ways = {name: motion.positions(name) / course.unit for name in ends or [most_moving(motion)]}
    long = {name: float(np.linalg.norm(way - way[0], axis=1).max()) for name, way in ways.items()}
    for name in sorted(ways, key=lambda name: -long[name])[:MOST_WAYS]:
        if long[name] > 0.02 * sketch.size:
            sketch.line(ways[name], f"way-{name}", colour=WAY, width=0.9, level=2.2)
            away = sketch.view.flat(sketch.leaving(name)).sum(axis=0)
            sketch.label(drawn_text(name), ways[name][-1], -away, Ink(f"way-{name}", WAY, 0.9))
