"""Pictures of controlled motions: controls over time with their bounds, beside positions of nodes.

Curves of positions are those of the trajectory, by the polynomials of its collocation.  Where it was replayed, thin
black lines are the replay, also after the end, which a dotted line marks.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..description.records import unknown
from ..dynamics.motion import Trajectory
from ..errors import SceneError
from ..trajectories.controlled_motion import ControlledMotion
from .curves import COMPONENTS
from .files import check_ending, save_figure
from .sheet import entitle, legend_above, name_upright
from .showing import Picture, new_figure
from .sketch import SUPPORT, prefix, unit_for, with_prefix

__all__ = ["control_picture", "save_controls"]

BOUND = "#B03A2E"
MOST_NODES = 3
"""Nodes drawn unless some are asked for."""
MOVED = 1e-3
"""Nodes that move by less than this share of the size stand still."""


def save_controls(
    motion: ControlledMotion, file: str | os.PathLike[str], *, nodes: Sequence[str] | None = None
) -> None:
    """Write :func:`control_picture` of a controlled motion to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`control_picture`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_drawn(motion, nodes, shown=False), file)


def control_picture(motion: ControlledMotion, *, nodes: Sequence[str] | None = None) -> Figure:
    """Controls with their bounds over time, beside positions of nodes; a figure of 11 inch.

    Parameters
    ----------
    motion : ControlledMotion
    nodes : sequence of str, optional
        Default: the three that move most.

    Raises
    ------
    SceneError
        There is no such node.
    """
    return _drawn(motion, nodes, shown=True)


def _drawn(motion: ControlledMotion, nodes: Sequence[str] | None, *, shown: bool) -> Picture:
    names = list(motion.transcription.system.model.nodes)
    for name in nodes or ():
        if name not in names:
            raise SceneError(unknown(name, names, "nodes"), ("nodes",))
    chosen = _moving(motion, names) if not nodes else list(nodes)
    controls = motion.transcription.statement.controls
    rows = max(len(controls), len(chosen))
    figure = new_figure(11.0, max(3.6, 0.9 + 2.2 * rows), shown=shown, wspace=0.03)
    grid = figure.add_gridspec(1, 2)
    columns = []
    for cell, count in ((grid[0], len(controls)), (grid[1], len(chosen))):
        part = cell.subgridspec(count, 1)
        columns.append([figure.add_subplot(part[row]) for row in range(count)])
    time, letter = prefix(motion.time)
    for panel, one in zip(columns[0], controls, strict=True):
        _draw_control(panel, motion, one.name, (one.low, one.high), time)
    replay = None if motion.check is None else motion.trajectory.resampled()
    for panel, name in zip(columns[1], chosen, strict=True):
        _draw_positions(panel, motion, replay, name, time)
    for column in columns:
        for panel in column[:-1]:
            panel.sharex(column[-1])
            panel.tick_params(labelbottom=False)
        column[-1].set_xlabel(f"time, {letter}s")
    entitle(figure, motion.scene.title)
    return figure


def _moving(motion: ControlledMotion, names: Sequence[str]) -> list[str]:
    """The nodes that move most, in their order."""
    ways = {name: motion.positions(name) for name in names}
    long = {name: float(np.linalg.norm(way - way[0], axis=1).max()) for name, way in ways.items()}
    most = sorted(names, key=lambda name: -long[name])[:MOST_NODES]
    least = MOVED * motion.scene.size
    return [name for name in names if name in most and long[name] > least] or most[:1]


def _draw_control(panel: Axes, motion: ControlledMotion, name: str, bounds: tuple[float, float], time: float) -> None:
    """A control over time, steps where it is constant in the intervals, and the bounds that it comes near."""
    values, ends = motion.control(name), motion.ends
    size = float(np.abs(values).max())
    factor, unit = with_prefix(size, _unit(motion, name))
    if len(values) < len(ends):
        panel.stairs(values / factor, ends / time, baseline=None, color=COMPONENTS[0], linewidth=1.6, gid="control")
    else:
        panel.plot(ends / time, values / factor, color=COMPONENTS[0], linewidth=1.6, gid="control")
    label = "bound"
    for bound in bounds:
        # One far away would flatten the curve.
        if np.isfinite(bound) and abs(bound) <= 3.0 * max(size, np.finfo(float).tiny):
            panel.axhline(bound / factor, color=BOUND, linewidth=0.9, linestyle="--", gid="bound", label=label)
            label = "_"
    _finish(panel, f"{name}, {unit}".rstrip(", "))


def _unit(motion: ControlledMotion, name: str) -> str:
    """Unit of a control; a history has that of what it multiplies, which is none of its own."""
    found = next(one for one in motion.transcription.system.arguments.arguments if one.name == name)
    return "" if found.unit == "1" else found.unit


def _draw_positions(panel: Axes, motion: ControlledMotion, replay: Trajectory | None, node: str, time: float) -> None:
    """Components of the position of a node over time."""
    times, way = motion.interpolated(node)
    factor, unit = unit_for(way, "m")
    axes = 3 if motion.transcription.system.model.space else 2
    for i, letter in enumerate("xyz"[:axes]):
        panel.plot(times / time, way[:, i] / factor, color=COMPONENTS[i], linewidth=2.2, label=letter, gid="position")
    if replay is not None:
        label = "replay"
        for column in replay.positions(node).T[:axes]:
            style: dict[str, Any] = {"color": "black", "linewidth": 0.7, "gid": "replay", "label": label}
            panel.plot(replay.times / time, column / factor, **style)
            label = "_"
        if replay.times[-1] > times[-1] * (1.0 + 1e-9):
            panel.axvline(times[-1] / time, color=SUPPORT, linewidth=0.8, linestyle=":", gid="end")
    _finish(panel, f"position of {node}, {unit}")


def _finish(panel: Axes, name: str) -> None:
    name_upright(panel, name)
    panel.grid(color="#EBEBEB", linewidth=0.6)
    panel.margins(x=0.01)
    legend_above(panel)
