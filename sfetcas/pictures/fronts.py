"""Work-precision pictures of a trade: error over time, what the library chooses, the front, other programs."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from ..tradeoff.trading import Row, Trade, again, whole
from .files import check_ending, save_figure
from .looks import PALETTE
from .sheet import drawn_text, entitle
from .showing import new_figure

__all__ = ["front_picture", "save_front"]

CHOSEN, FRONT, PEER = "#D55E00", "#222222", "#777777"
LEAST = 1e-16
"""What is exact is drawn here."""


def save_front(trade: Trade, file: str | os.PathLike[str]) -> None:
    """Write :func:`front_picture` of a trade to a file, in the format of its ending.

    Raises
    ------
    SceneError
        The ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_drawn(trade, shown=False), file)


def front_picture(trade: Trade) -> Figure:
    """Errors over seconds of whole runs and, where there are such, of repeated solves alone; 11 or 7 x 5.5 inch."""
    return _drawn(trade, shown=True)


def _drawn(trade: Trade, *, shown: bool) -> Figure:
    costs: list[tuple[str, Callable[[Row], float]]] = [("a whole run", whole)]
    if any(np.isfinite(row.again) for row in trade.rows):
        costs.append(("a repeated solve alone", again))
    figure = new_figure(7.0 if len(costs) == 1 else 11.0, 5.5, shown=shown)
    papers = np.atleast_1d(figure.subplots(1, len(costs), sharey=True))
    for paper, (label, cost) in zip(papers, costs, strict=True):
        _draw(paper, trade, cost)
        paper.set_xlabel(label)
    papers[0].set_ylabel(f"error of the {trade.kind}, relative", parse_math=False)
    handles, labels = papers[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=8, frameon=False)
    entitle(figure, trade.scene.title)
    return figure


def _draw(paper: Axes, trade: Trade, cost: Callable[[Row], float]) -> None:
    groups: dict[str, list[Row]] = {}
    for row in trade.rows:
        if np.isfinite(row.error) and np.isfinite(cost(row)) and not row.measurement.variant.chosen:
            variant = row.measurement.variant
            groups.setdefault(variant.integrator or variant.element, []).append(row)
    for colour, (name, rows) in zip(PALETTE * 3, groups.items(), strict=False):
        nodes = [row for row in rows if row.measurement.variant.integration == "nodes"]
        gauss = [row for row in rows if row.measurement.variant.integration == "gauss"]
        _points(paper, nodes, cost, marker="o", color=colour, label=name, markersize=4, alpha=0.75)
        _points(paper, gauss, cost, marker="o", color=colour, label=f"{name}, gauss", markersize=4, fillstyle="none")
    chosen = [row for row in trade.rows if row.measurement.variant.chosen and np.isfinite(cost(row))]
    _points(paper, chosen, cost, marker="*", color=CHOSEN, label="accuracy asked for", markersize=10)
    front = trade.front(cost)
    x, y = [cost(row) for row in front], [max(row.error, LEAST) for row in front]
    paper.plot(x, y, color=FRONT, lw=1.2, drawstyle="steps-post", label="best", zorder=1)
    for peer in trade.peers:
        seconds = peer.seconds if cost is whole else peer.again
        if seconds is not None and np.isfinite(peer.error):
            paper.plot([seconds], [max(peer.error, LEAST)], "x", color=PEER, label="other programs")
            paper.annotate(
                drawn_text(peer.label), (seconds, max(peer.error, LEAST)), fontsize=7, color=PEER, parse_math=False
            )
    if trade.against == "refined" and trade.reference.estimate:
        paper.axhspan(LEAST, trade.reference.estimate, color="#EEEEEE", zorder=0, label="error of the reference")
    paper.set_xscale("log")
    paper.set_yscale("log")
    paper.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    paper.xaxis.set_major_formatter(EngFormatter("s"))
    paper.xaxis.set_minor_formatter(NullFormatter())
    paper.yaxis.set_major_locator(LogLocator(base=100.0, numticks=12))
    paper.grid(True, color="#E6E6E6", lw=0.6)


def _points(paper: Axes, rows: list[Row], cost: Callable[[Row], float], label: str, **look: object) -> None:
    if rows:
        x, y = [cost(row) for row in rows], [max(row.error, LEAST) for row in rows]
        paper.plot(x, y, linestyle="none", label=label, **look)  # type: ignore[arg-type]
