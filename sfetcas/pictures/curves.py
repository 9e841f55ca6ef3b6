"""Curves of quantities, named as everywhere (:mod:`~sfetcas.description.answers`): over the load factor, or over time.

Each quantity has a panel.  Where a few values are far beyond all others, as reactions near a singular point, the axis
ends before them: triangles say where a curve leaves the panel, and a note how far it goes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..description.answers import AnswerName, answer_name, check_answer
from ..description.records import say
from ..description.scene import Scene
from ..equilibria.quantities import component_in, value_of
from ..equilibria.solution import Configuration, Solution
from ..errors import SceneError
from ..mathematics.arrays import Array
from .files import check_ending, save_figure
from .sheet import entitle, legend_above, name_upright
from .showing import Picture, new_figure
from .sketch import rounded, unit_for, with_prefix

__all__ = [
    "COMPONENTS",
    "FREQUENCIES",
    "Curve",
    "clipped",
    "curves",
    "draw_panel",
    "leave",
    "one_or_several",
    "quantities_named",
    "said",
    "save_curves",
    "shown_components",
    "table_of",
    "told",
]

FREQUENCIES = "modes.omega"
"""The quantity of a path with modes that its points tell beside those of equilibria."""
COMPONENTS = ("#0072B2", "#D55E00", "#009E73", "#8F3B76")
"""Colours of x, y, z, or w, x, y, z."""
NOWHERE = 1e-12
"""A component that is smaller than this share of the largest one is zero."""
FAR, KEPT, AROUND = 25.0, 0.5, 1.5
"""Values are far off where all span so many times what the middle four fifths do; at least this share of them is kept,
and the axis goes beyond the middle ones by this many times what they span."""
FEW = 8
"""Of fewer values none is far off."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve in a panel: abscissas (n,), values (n,) in SI units, and how it looks."""

    at: Array
    values: Array
    colour: str
    name: str = ""
    look: dict[str, Any] = field(default_factory=dict)


def save_curves(solution: Solution, file: str | os.PathLike[str], quantities: Sequence[str]) -> None:
    """Write :func:`curves` of an answer to a file, in the format of its ending.

    Raises
    ------
    SceneError
        As :func:`curves`, or the ending is none of ``files.ENDINGS``.
    """
    check_ending(file)
    save_figure(_drawn(solution, quantities, shown=False), file)


def curves(solution: Solution, quantities: Sequence[str]) -> Figure:
    """Quantities over the load factor, a panel for each; a figure of 7 inch.

    Parameters
    ----------
    solution : Solution
        An answer with several ``steps``.
    quantities : sequence of str
        Names as ``nodes.tip.position.y`` or ``members.beam.moment at 0.5``.

    Raises
    ------
    SceneError
        There is no such quantity.
    """
    return _drawn(solution, quantities, shown=True)


def _drawn(solution: Solution, quantities: Sequence[str], *, shown: bool) -> Picture:
    names = quantities_named(solution.scene, quantities)
    factors = np.array([step.factor for step in solution.steps])
    # Several equilibria of one factor are no curve.
    several = len(np.unique(factors)) < len(factors)
    look = {"marker": "o", "markersize": 4.0, "linestyle": "" if several else "-"}
    tables = [table_of(name, solution.steps) for name in names]
    figure = new_figure(7.0, 0.8 + 2.3 * len(names), shown=shown)
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for panel, name, table in zip(panels, names, tables, strict=True):
        draw_panel(panel, name, [replace(curve, look=look) for curve in told(name, factors, table)])
    panels[-1].set_xlabel("factor")
    entitle(figure, solution.scene.title)
    return figure


# Quantities by name


def one_or_several(quantity: str | None, quantities: Sequence[str] | None) -> Sequence[str] | None:
    """Names of quantities, given as one or as several of them; None where neither is.

    Raises
    ------
    SceneError
        Both are given.
    """
    if quantity is not None and quantities is not None:
        raise SceneError("found quantity and quantities, accepted: one of them")
    return quantities if quantity is None else [quantity]


def quantities_named(scene: Scene, quantities: Sequence[str]) -> list[AnswerName]:
    """The quantities of some names, which every state of the answers of a scene has as numbers.

    Raises
    ------
    SceneError
        There is no such quantity, or it is not made of numbers.
    """
    if isinstance(quantities, str) or not quantities:
        raise SceneError(
            f"found {say(quantities)}, accepted: a list of names, as 'nodes.tip.position'", ("quantities",)
        )
    found = []
    for text in quantities:
        name = answer_name(text, "quantities")
        kind, path = name.kind, scene.analysis.type == "path"
        if path and kind.name == FREQUENCIES and scene.analysis.count_of_modes:
            found.append(name)
            continue
        try:
            check_answer(scene, name)
        except SceneError as error:
            raise SceneError(error.bare, ("quantities",)) from None
        if not kind.numeric or kind.table == "modes" or kind.name == "omega":
            raise SceneError(f"found {text!r}, accepted: a quantity that is a number in each state", ("quantities",))
        if path and kind.table == "certificate":
            accepted = "a quantity of the state, as 'nodes.tip.position'"
            raise SceneError(f"found {text!r}, which is told of steps only, accepted: {accepted}", ("quantities",))
        if kind.along != (name.at is not None) or len(name.selectors) > kind.along:
            accepted = f"{name.bare} at 0.5, or another place" if kind.along else name.bare
            raise SceneError(f"found {text!r}, accepted: {accepted}", ("quantities",))
        found.append(name)
    return found


def table_of(name: AnswerName, states: Sequence[Configuration]) -> Array:
    """A quantity in states, (states, numbers) in its unit; nan where it is no number, as where nothing touches.

    Raises
    ------
    SceneError
        These states do not have it.
    """
    rows = []
    for state in states:
        value = component_in(value_of(state, replace(name, component=None)), name)
        try:
            rows.append(np.atleast_1d(np.asarray(value, dtype=float)).ravel())
        except (TypeError, ValueError):
            rows.append(np.array([np.nan]))
    width = max(map(len, rows))
    return np.array([row if len(row) == width else np.full(width, np.nan) for row in rows])


def told(name: AnswerName, at: Array, table: Array) -> list[Curve]:
    """The curves of a quantity over abscissas (n,): one for each component that is not zero throughout."""
    if table.shape[1] == 1:
        return [Curve(at, table[:, 0], COMPONENTS[0])]
    letters = name.kind.components or tuple(str(i) for i in range(table.shape[1]))
    return [Curve(at, table[:, i], COMPONENTS[i % len(COMPONENTS)], letters[i]) for i in shown_components(table)]


def shown_components(table: Array) -> list[int]:
    """Columns of a table (n, components) that are not zero throughout; the first where all are."""
    sizes = np.nanmax(np.abs(table), axis=0, initial=0.0)
    return np.flatnonzero(sizes > NOWHERE * sizes.max()).tolist() if sizes.max() > 0.0 else [0]


# Panels


def draw_panel(panel: Axes, name: AnswerName, found: Sequence[Curve]) -> None:
    """Draw the curves of a quantity, with its name and unit at the axis and a legend where it has components."""
    values = np.concatenate([curve.values for curve in found])
    limits = clipped(values)
    seen = values if limits is None else np.clip(values, *limits)
    factor, unit = unit_for(seen, name.kind.unit)
    for curve in found:
        style: dict[str, Any] = {"linewidth": 1.5, "color": curve.colour, "gid": f"curve-{name.text}", **curve.look}
        if len(curve.at) == 1:
            style |= {"marker": "o", "markersize": 4.0}
        panel.plot(curve.at, curve.values / factor, label=curve.name or None, **style)
    name_upright(panel, ", ".join(filter(None, (said(name), unit))))
    panel.grid(color="#EBEBEB", linewidth=0.6)
    panel.margins(x=0.01)
    if limits is not None:
        leave(panel, found, limits, factor, name.kind.unit)
    if any(curve.name for curve in found):
        legend_above(panel)


def said(name: AnswerName) -> str:
    """The name of a quantity with letters for components: ``nodes.tip.position.y``."""
    if name.component is None or name.component >= len(name.kind.components):
        return name.text
    return name.text.replace(name.bare, f"{name.quantity}.{name.kind.components[name.component]}", 1)


def clipped(values: Array) -> tuple[float, float] | None:
    """Limits of an axis for values some of which are far beyond all others; None where none are."""
    known = values[np.isfinite(values)]
    inside = known
    while len(inside) >= max(FEW, KEPT * len(known)):
        low, high = np.percentile(inside, [10.0, 90.0])
        if np.ptp(inside) <= FAR * (high - low):
            break
        spread = AROUND * (high - low)
        nearer = inside[(inside >= low - spread) & (inside <= high + spread)]
        if len(nearer) == len(inside) or high == low:
            break
        inside = nearer
    if len(inside) == len(known) or len(inside) < max(FEW, KEPT * len(known)):
        return None
    margin = 0.08 * float(np.ptp(inside))
    return float(inside.min()) - margin, float(inside.max()) + margin


def leave(panel: Axes, found: Sequence[Curve], limits: tuple[float, float], factor: float, unit: str) -> None:
    """End the axis at the limits, with triangles where curves go on and a note how far."""
    low, high = limits
    panel.set_ylim(low / factor, high / factor)
    extremes = []
    for curve in found:
        for beyond, edge, marker in ((curve.values > high, high, "^"), (curve.values < low, low, "v")):
            if beyond.any():
                # One triangle where it goes and one where it comes back.
                ends = np.flatnonzero(np.diff(np.concatenate([[0], beyond, [0]]).astype(int)))
                places = np.unique(np.clip(np.column_stack([ends[::2], ends[1::2] - 1]).ravel(), 0, len(beyond) - 1))
                style: dict[str, Any] = {"linestyle": "", "clip_on": False, "markersize": 5, "gid": "leaves"}
                panel.plot(curve.at[places], np.full(len(places), edge / factor), marker, color=curve.colour, **style)
                extremes.append(float(curve.values[beyond][np.argmax(np.abs(curve.values[beyond]))]))
    shown, si = with_prefix(max(map(abs, extremes)), unit)
    text = " and ".join(f"{rounded(value / shown):g}" for value in sorted({min(extremes), max(extremes)}))
    style = {"fontsize": 7.5, "ha": "center", "va": "top", "parse_math": False, "gid": "leaving", "zorder": 5.0}
    style["bbox"] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}
    panel.text(0.5, 0.97, f"leaves the axes: up to {text} {si}".rstrip(), transform=panel.transAxes, **style)
