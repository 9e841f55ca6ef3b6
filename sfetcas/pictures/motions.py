"""Pictures of motions: positions at several times over each other, histories of quantities, and energies.

Positions are pale at first and bold at the end; thin lines are the ways of free ends.  All is drawn from the states at
the time steps of the integrator (:meth:`.Trajectory.resampled`), however few answers were asked
for.  Loads are not drawn, as they change in time.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..description.answers import AnswerName
from ..description.records import nearest
from ..dynamics.motion import MotionState, Trajectory
from ..errors import SceneError
from ..mathematics.arrays import Array
from .curves import COMPONENTS, draw_panel, quantities_named, table_of, told
from .files import check_ending, save_figure
from .glyphs import sketch_supports
from .sheet import DOTTED, Sheet, axes_on, drawn_text, entitle, legend_above, name_upright, plot_line
from .showing import Picture, new_figure
from .sketch import REST, Ink, Sketch, course_of, prefix, unit_for, view_of

__all__ = ["draw_strobes", "evenly", "histories", "most_moving", "motion_picture", "save_histories", "save_motion"]

STROBES = 10
"""Positions drawn at most."""
MOST_WAYS = 4
"""Ways of nodes drawn at most."""
WAY = "#CC5FA0"
TIMES = LinearSegmentedColormap.from_list("times", ["#C6D8EA", "#5DA5D6", "#134B86", "#0B1F4B"])
ENERGIES = {"kinetic": "#D55E00", "elastic": "#009E73", "loads": "#0072B2", "total": "#222222"}
BEGUN = 2e-3
"""Apart by this much of the size the undeformed scene is drawn beside the first position."""


def save_motion(motion: Trajectory, file: str | os.PathLike[str], *, quantities: Sequence[str] | None = None) -> None:
    """Write :func:`motion_picture` of a motion to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`motion_picture`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_motion_picture(motion, quantities, shown=False), file)


def save_histories(
    motion: Trajectory,
    file: str | os.PathLike[str],
    nodes: Sequence[str] | None = None,
    *,
    quantities: Sequence[str] | None = None,
) -> None:
    """Write :func:`histories` of a motion to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`histories`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_histories(motion, nodes, quantities, shown=False), file)


def motion_picture(motion: Trajectory, *, quantities: Sequence[str] | None = None) -> Figure:
    """Positions over each other, beside curves over time; a figure of 11 inch.

    Parameters
    ----------
    motion : Trajectory
    quantities : sequence of str, optional
        Names as ``nodes.tip.velocity`` or ``members.beam.moment.z at 0``, a panel for each.  Default: the position of
        the node that moves most, and the energies.

    Raises
    ------
    SceneError
        There is no such quantity.
    """
    return _motion_picture(motion, quantities, shown=True)


def _motion_picture(motion: Trajectory, quantities: Sequence[str] | None, *, shown: bool) -> Picture:
    names = None if quantities is None else quantities_named(motion.scene, quantities)
    rows = 2 if names is None else len(names)
    fine = motion.resampled()
    figure = new_figure(11.0, max(5.5, 0.9 + 1.9 * rows), shown=shown, wspace=0.03)
    grid = figure.add_gridspec(rows, 2, width_ratios=[1.2, 1.0])
    paper, first = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    panels = [first, *(figure.add_subplot(grid[i, 1], sharex=first) for i in range(1, rows))]
    if names is None:
        _draw_history(panels[0], fine, most_moving(fine), "position")
        _draw_energies(panels[1], fine)
    else:
        _draw_quantities(panels, fine, names)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    _say_times(panels[-1], fine)
    entitle(figure, motion.scene.title)
    draw_strobes(figure, paper, motion, fine)
    return figure


def histories(
    motion: Trajectory, nodes: Sequence[str] | None = None, *, quantities: Sequence[str] | None = None
) -> Figure:
    """Positions and velocities of nodes, or any quantities, over time; a figure of 9 or 7 inch.

    Parameters
    ----------
    motion : Trajectory
    nodes : sequence of str, optional
        Default: the one that moves most.
    quantities : sequence of str, optional
        Instead of nodes names as ``springs.knee.moment``, a panel for each.

    Raises
    ------
    SceneError
        There is no such node or quantity, or both are given.
    """
    return _histories(motion, nodes, quantities, shown=True)


def _histories(
    motion: Trajectory, nodes: Sequence[str] | None, quantities: Sequence[str] | None, *, shown: bool
) -> Picture:
    if quantities is not None:
        if nodes is not None:
            raise SceneError("found nodes and quantities, accepted: one of them, as 'nodes.tip.position' is a quantity")
        names = quantities_named(motion.scene, quantities)
        figure = new_figure(7.0, 0.6 + 2.2 * len(names), shown=shown)
        panels = list(np.atleast_1d(figure.subplots(len(names), 1, sharex=True)))
        fine = motion.resampled()
        _draw_quantities(panels, fine, names)
        _say_times(panels[-1], fine)
        return figure
    chosen = None if nodes is None else list(nodes)
    for name in chosen or ():
        if name not in motion.last.model.nodes:
            raise SceneError(f"found node {name!r}; {nearest(name, motion.last.model.nodes)}")
    if chosen == []:
        raise SceneError("found none, accepted: names of nodes", ("nodes",))
    fine = motion.resampled()
    chosen = chosen or [most_moving(fine)]
    figure = new_figure(9.0, 0.6 + 2.4 * len(chosen), shown=shown)
    table = figure.subplots(len(chosen), 2, sharex=True, squeeze=False)
    for row, name in zip(table, chosen, strict=True):
        for axes, quantity in zip(row, ("position", "velocity"), strict=True):
            _draw_history(axes, fine, name, quantity)
    for axes in table[-1]:
        _say_times(axes, fine)
    return figure


def most_moving(motion: Trajectory) -> str:
    """The node that goes the farthest from where it began."""
    nodes = motion.last.model.nodes
    ways = [motion.positions(name) for name in nodes]
    return nodes[int(np.argmax([np.linalg.norm(way - way[0], axis=1).max() for way in ways]))]


def evenly(motion: Trajectory, count: int) -> list[MotionState]:
    """So many states evenly over the time; where the steps are not known the nearest answers, each once."""
    times = np.linspace(motion.times[0], motion.times[-1], count)
    if motion.record is not None:
        return list(motion.between(times if len(motion.steps) > 1 else times[:1]))
    return [motion.steps[i] for i in np.unique(np.abs(motion.times - times[:, None]).argmin(axis=1))]


# Over time


def _draw_quantities(panels: Sequence[Axes], motion: Trajectory, names: Sequence[AnswerName]) -> None:
    times, look = motion.times / _unit_of_time(motion)[0], _look_of_answers(motion)
    tables = [table_of(name, motion.steps) for name in names]
    for panel, name, table in zip(panels, names, tables, strict=True):
        draw_panel(panel, name, [replace(curve, look=look) for curve in told(name, times, table)])


def _look_of_answers(motion: Trajectory) -> dict[str, Any]:
    """Dots on the answers where nothing is known between them: straight lines there are none of the motion."""
    return {"marker": ".", "markersize": 4.0} if motion.record is None else {}


def _draw_history(axes: Axes, motion: Trajectory, node: str, quantity: str) -> None:
    values = motion.positions(node) if quantity == "position" else motion.velocities(node)
    letters = "xyz" if motion.last.model.space else "xy"
    factor, unit = unit_for(values[:, : len(letters)], "m" if quantity == "position" else "m/s")
    for i, name in enumerate(letters):
        _draw_values(axes, motion, values[:, i] / factor, name, COMPONENTS[i])
    _finish(axes, f"{quantity} of {node}, {unit}")


def _draw_energies(axes: Axes, motion: Trajectory) -> None:
    values = {kind: motion.energies(kind) for kind in ENERGIES}
    factor, unit = unit_for(np.array(list(values.values())), "N m")
    for kind, colour in ENERGIES.items():
        # Where one energy is nearly all, it is seen below the dashes of the total.
        _draw_values(axes, motion, values[kind] / factor, kind, colour, "--" if kind == "total" else "-")
    _finish(axes, f"energy, {unit}")


def _draw_values(axes: Axes, motion: Trajectory, values: Array, name: str, colour: str, dashes: str = "-") -> None:
    # A single answer is no line.
    style = {"marker": "o", "markersize": 4.0} if len(values) == 1 else _look_of_answers(motion)
    times = motion.times / _unit_of_time(motion)[0]
    axes.plot(times, values, color=colour, linewidth=1.5, linestyle=dashes, label=name, **style)


def _finish(axes: Axes, name: str) -> None:
    name_upright(axes, name)
    axes.grid(color="#EBEBEB", linewidth=0.6)
    axes.margins(x=0.01)
    legend_above(axes)


def _unit_of_time(motion: Trajectory) -> tuple[float, str]:
    return prefix(motion.last.time, 0.1)


def _say_times(axes: Axes, motion: Trajectory) -> None:
    axes.set_xlabel(f"time, {_unit_of_time(motion)[1]}s")


# Positions over each other


def draw_strobes(figure: Figure, paper: Axes, motion: Trajectory, fine: Trajectory) -> None:
    """Positions of a motion over each other, with ways of nodes through all states of its ``fine`` one."""
    chosen = evenly(motion, STROBES)
    scene = motion.last.model.scene
    course = course_of(scene, chosen)
    view = view_of(motion.last.model.space, [course.everything])
    sketch = Sketch(scene, chosen[-1], course, view)
    sketch_supports(sketch)
    _sketch_ways(sketch, fine)
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
    legend_above(paper, list(_legend(sketch, undeformed=undeformed)))
    Sheet(figure, axes, paper, sketch).finish(gravity=1.0)


def _legend(sketch: Sketch, *, undeformed: bool) -> Iterator[Line2D]:
    if undeformed:
        yield Line2D([], [], color=REST, linewidth=1.2, linestyle=DOTTED, label="undeformed")
    if any(mark.name.startswith("way-") for mark in sketch.marks):
        yield Line2D([], [], color=WAY, linewidth=0.9, label="trajectory of a node")


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
