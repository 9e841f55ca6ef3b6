"""Pictures of answers: the deformed structure over the undeformed one, with supports, loads and reactions.

The order of the stages: centre lines are sampled (:class:`_Course`); all else is sketched as marks and labels
in fixed axes (:class:`_Sketch`); axes are made and filled; marks are drawn and labels put where they hide least.
Lengths are in drawn units, metres with an SI prefix, from the sampling on; ``flat`` coordinates (n, 2) are those
in the plane of the picture, which is x-y or faces the viewer.
"""

from __future__ import annotations

import functools
import itertools
import math
import os
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, MultipleLocator
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

from . import quaternion
from .errors import SceneError
from .loads import Load, Motion
from .obstacles import Obstacle, obstacle
from .records import say
from .scene import Scene
from .sections import evaluate
from .solution import Equilibrium, Solution
from .structure import Node, unit

Array = np.ndarray[Any, np.dtype[np.float64]]
Colour = Literal["moment", "magnitude", "none"]

__all__ = ["ENDINGS", "picture", "save_picture"]

ENDINGS = (".pdf", ".png", ".svg", ".jpg", ".jpeg", ".webp")
"""Endings of the files that :func:`save_picture` writes."""

COLOURS = ("moment", "magnitude", "none")
WIDTH, HEIGHT, DPI = 7.0, 5.0, 150
LOAD, REACTION, MOTION = "#D55E00", "#0072B2", "#8F3B76"
REST, SUPPORT = "#8C8C8C", "#333333"
ARROW = 0.12
"""Length of the longest arrow over the size of the picture; the other constants are meant like this."""
SYMBOL = 0.03
TURNS = {LOAD: 0.05, REACTION: 0.063, MOTION: 0.076}
"""Radii of circular arrows."""
MOST_STEPS = 40
"""Steps drawn at most."""
MANY = 14
"""Labels; of more than that, those with the same text as another are left out."""
FONT = 9.0
"""Height of labels, points."""

SIGNED = LinearSegmentedColormap.from_list("signed", ["#5E1A70", "#9970AB", "#D8D8D8", "#5AAE61", "#126B33"])
SIZES = LinearSegmentedColormap.from_list("sizes", ["#D8D8D8", "#7FBF9B", "#2A788E", "#404688", "#4B0C5C"])
PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T", 15: "P"}


def save_picture(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write :func:`picture` of an answer to a file, in the format of its ending.

    Raises
    ------
    SceneError
        The ending is none of :data:`ENDINGS`.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        found = f"found the ending {ending!r}" if ending else "found no ending"
        raise SceneError(f"{found} of a picture, accepted: {', '.join(ENDINGS)}")
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    picture(solution).savefig(path, dpi=DPI, metadata=dates.get(ending))


def picture(solution: Solution, *, steps: Sequence[int] | None = None, colour: Colour = "moment") -> Figure:
    """The deformed structure over the undeformed one, ready for a report.

    Parameters
    ----------
    solution : Solution
    steps : sequence of int, optional
        Numbers of the steps to draw, as indices of ``solution.steps``; the last one is drawn in colour, with its
        loads and reactions, the others pale.  Default: all.
    colour : str
        ``moment``: bending moment, in the plane about z with its sign; ``magnitude``: its magnitude; ``none``.

    Returns
    -------
    Figure
        matplotlib figure without pyplot, 7 x 5 inch.

    Raises
    ------
    SceneError
        There is no such step or colour.
    """
    if colour not in COLOURS:
        raise SceneError(f"found {say(colour)}, accepted: {', '.join(COLOURS)}", ("colour",))
    chosen = _chosen(solution, steps)
    course = _course(solution.scene, chosen, colour)
    view = _view(chosen[-1].model.space, [*course.rest, *course.last])
    sketch = _Sketch(solution.scene, chosen[-1], course, view)
    _sketch_all(sketch)
    sheet = _sheet(sketch, chosen, colour)
    sheet.finish()
    return sheet.figure


def _chosen(solution: Solution, steps: Sequence[int] | None) -> list[Equilibrium]:
    count = len(solution.steps)
    numbers = list(range(count)) if steps is None else list(steps)
    if not numbers or any(not -count <= number < count for number in numbers):
        accepted = f"numbers of steps from 0 to {count - 1}, or from the end: -1"
        raise SceneError(f"found {say(numbers)}, accepted: {accepted}", ("steps",))
    thinned = np.unique(np.linspace(0, len(numbers) - 1, min(len(numbers), MOST_STEPS)).round().astype(int))
    return [solution.steps[numbers[i]] for i in thinned]


# Amounts and their units


def _round(value: float) -> float:
    return float(f"{value:.3g}")


def _say(factor: float) -> str:
    return f"{float(f'{factor:.4g}'):g}"


def _prefix(value: float, least: float = 0.1) -> tuple[float, str]:
    """Factor and letter of the SI prefix for a value: none from ``least`` to 9999, a power of ten beyond all."""
    value = abs(value)
    if value == 0.0 or least <= value < 1e4:
        return 1.0, ""
    power = 3 * math.floor(math.log10(value / (least if value < least else 1.0)) / 3.0)
    return 10.0**power, PREFIXES.get(power, f"$10^{{{power}}}$ ")


def _amount(value: float, name: str) -> str:
    """A value with its unit in three digits, as ``1.5 kN``."""
    value = _round(abs(value))
    factor, letter = _prefix(value)
    return f"{_round(value / factor):g} {letter}{name}"


# The centre lines


@dataclass(frozen=True, eq=False)
class _Course:
    """Sampled centre lines, each (n, 3) in drawn units.

    Attributes
    ----------
    unit, letter : m, and the SI prefix of the drawn unit
    members : names, in the order of the lists
    rest, last : undeformed, and of the last step
    earlier : the same of the earlier steps, step by step
    values : (n,) N m along the lines of ``last``; empty where nothing is to be coloured
    """

    unit: float
    letter: str
    members: tuple[str, ...]
    rest: list[Array]
    last: list[Array]
    earlier: list[list[Array]]
    values: list[Array]

    @functools.cached_property
    def everything(self) -> Array:
        """All samples, (n, 3)."""
        return np.vstack([*self.rest, *self.last, *(line for lines in self.earlier for line in lines)])


def _course(scene: Scene, steps: Sequence[Equilibrium], colour: str) -> _Course:
    names = tuple(scene.members)
    last = {name: steps[-1].along(name, _samples(steps[-1], name)) for name in names}
    deformed = [last[name]["position"] for name in names]
    rest = [scene.center_lines[name].positions(_samples(steps[-1], name)) for name in names]
    earlier = [[step.along(name, _samples(step, name))["position"] for name in names] for step in steps[:-1]]
    extent = max(float(np.ptp(np.vstack(lines), axis=0).max()) for lines in (rest, deformed, *earlier))
    unit, letter = _prefix(extent, 0.2)
    values = [_bending(steps[-1], name, last[name], colour) for name in names] if colour != "none" else []
    if values and max(float(np.abs(value).max()) for value in values) <= _noise(steps[-1], last.values()):
        values = []
    scaled = [[line / unit for line in lines] for lines in (rest, deformed, *earlier)]
    return _Course(unit, letter, names, scaled[0], scaled[1], scaled[2:], values)


def _samples(step: Equilibrium, member: str) -> Array:
    """Fractions of the length where a member is drawn: at least 101, a step turning by 0.05 rad at most."""
    line = step.model.scene.center_lines[member]
    tangents = _tangents(step, member, step.model.along(member))
    turned = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    turning = float((2.0 * np.arcsin(np.clip(0.5 * turned, 0.0, 1.0))).sum())
    return np.linspace(0.0, 1.0, 1 + min(20_000, max(100, math.ceil(max(turning, line.turning) / 0.05))))


def _tangents(step: Equilibrium, member: str, x: Array) -> Array:
    rest = step.model.scene.center_lines[member].tangents(x)
    return quaternion.rotate(step.along(member, x)["quaternion"], rest)


def _bending(step: Equilibrium, member: str, fields: dict[str, Array], colour: str) -> Array:
    """Bending moment (n,) in N m: about z with its sign, or the magnitude of what is across the tangent."""
    moment = fields["moment"]
    if not step.model.space:
        return moment[:, 2] if colour == "moment" else np.abs(moment[:, 2])
    tangents = _tangents(step, member, np.linspace(0.0, 1.0, len(moment)))
    twist = np.einsum("ni,ni->n", moment, tangents)
    return np.asarray(np.linalg.norm(moment - twist[:, None] * tangents, axis=1))


def _noise(step: Equilibrium, fields: Iterable[dict[str, Array]]) -> float:
    """Moments up to this many N m are rounding."""
    scales = step.model.scales
    largest = max(float(np.linalg.norm(field["force"], axis=1).max()) for field in fields)
    return max(1e-9 * largest * scales.length, 1e-12 * scales.moment)


# The point of view


@dataclass(frozen=True, eq=False)
class _View:
    """Directions (3,) to the right and up in the picture; elevation and azimuth in degrees in space."""

    right: Array
    up: Array
    angles: tuple[float, float] | None = None

    def flat(self, points: Any) -> Array:
        """Points or vectors (..., 3) in the plane of the picture, (..., 2)."""
        return np.asarray(np.asarray(points, float) @ np.stack([self.right, self.up], axis=1))

    def raised(self, points: Any) -> Array:
        """Vectors (..., 2) of the plane of the picture in fixed axes, (..., 3)."""
        return np.asarray(np.asarray(points, float) @ np.stack([self.right, self.up]))


def _view(space: bool, lines: Sequence[Array]) -> _View:
    """The plane; in space that of some usual views which shows the lines the broadest."""
    if not space:
        return _View(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    points = np.vstack([line[:: max(1, len(line) // 100)] for line in lines])
    views = [_from(elevation, azimuth) for elevation in (22, 32) for azimuth in (-60, -45, -30, -120, -135, -150)]
    return max(views, key=lambda view: _breadth(view.flat(points - points.mean(axis=0))))


def _from(elevation: float, azimuth: float) -> _View:
    e, a = math.radians(elevation), math.radians(azimuth)
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    up = np.array([-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)])
    return _View(right, up, (elevation, azimuth))


def _breadth(flat: Array) -> float:
    values = np.linalg.eigvalsh(flat.T @ flat)
    # The shorter direction counts most; equal views are decided by the order, also after rounding.
    return _round(float(values[0] + 0.05 * values[1]))


# What is sketched: marks and labels


@dataclass(frozen=True)
class _Ink:
    """How the arrow of a load, a reaction or a motion looks; its name finds it again in the figure."""

    name: str
    colour: str
    width: float
    dotted: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class _Mark:
    """A drawn thing: ``line``, ``area``, ``arrow`` (head at the last point) or ``dot``; points (n, 3)."""

    kind: Literal["line", "area", "arrow", "dot"]
    points: Array
    name: str
    colour: str
    width: float = 1.0
    fill: str = "white"
    dotted: bool = False
    level: float = 6.0


@dataclass(frozen=True, eq=False, kw_only=True)
class _Label:
    """A text beside an anchor (3,), in some direction ``away`` (2,) by preference, at least ``gap`` off."""

    anchor: Array
    away: Array
    text: str
    colour: str
    name: str
    gap: float = 0.0


@dataclass(eq=False)
class _Sketch:
    """Marks and labels of one equilibrium, and what they must not hide."""

    scene: Scene
    step: Equilibrium
    course: _Course
    view: _View
    marks: list[_Mark] = field(default_factory=list)
    labels: list[_Label] = field(default_factory=list)

    @functools.cached_property
    def size(self) -> float:
        """Diagonal of what is drawn of the structure in the plane of the picture, drawn units."""
        return float(np.hypot(*np.ptp(self.view.flat(self.course.everything), axis=0)))

    @functools.cached_property
    def lines(self) -> Array:
        """Flat samples (n, 2) of the structure, undeformed and deformed."""
        lines = [self.view.flat(line) for line in (*self.course.rest, *self.course.last)]
        return _thinned(np.vstack([_dense(line, 0.005 * self.size) for line in lines]), 0.005 * self.size)

    @property
    def crowd(self) -> Array:
        """Flat samples (n, 2) of all that is sketched so far."""
        return np.vstack([self.lines, *(_dense(self.view.flat(mark.points), 0.01 * self.size) for mark in self.marks)])

    def at(self, node: str) -> Array:
        """Place of a node (3,), drawn units."""
        return self.step.position(node) / self.course.unit

    def along(self, member: str, x: Array) -> Array:
        """Places (n, 3) along a deformed member, drawn units."""
        return self.step.along(member, x)["position"] / self.course.unit

    def line(self, points: Array, name: str, *, colour: str = SUPPORT, width: float = 1.2, level: float = 5.0) -> None:
        """Sketch a polyline (n, 3)."""
        self.marks.append(_Mark(kind="line", points=points, name=name, colour=colour, width=width, level=level))

    def area(self, points: Array, name: str, fill: str = "white", level: float = 5.0) -> None:
        """Sketch a polygon (n, 3)."""
        mark = _Mark(kind="area", points=points, name=name, colour=SUPPORT, width=1.2, fill=fill, level=level)
        self.marks.append(mark)

    def dot(self, point: Array, name: str, fill: str = "white") -> None:
        """Sketch a small circle at (3,)."""
        mark = _Mark(kind="dot", points=point[None, :], name=name, colour=SUPPORT, fill=fill, level=8.0)
        self.marks.append(mark)

    def arrow(self, points: Array, ink: _Ink) -> None:
        """Sketch an arrow along a polyline (n, 3)."""
        look: dict[str, Any] = {"name": ink.name, "colour": ink.colour, "width": ink.width, "dotted": ink.dotted}
        self.marks.append(_Mark(kind="arrow", points=points, level=7.0, **look))

    def label(self, text: str, anchor: Array, away: Array, ink: _Ink, gap: float = 0.0) -> None:
        """Ask for a text."""
        label = _Label(anchor=anchor, away=away, text=text, colour=ink.colour, name=ink.name, gap=gap)
        self.labels.append(label)

    def leaving(self, node: str) -> Array:
        """Unit tangents (k, 3) of the members that end at a node, out of it."""
        found = []
        for name, member in self.scene.members.items():
            if node in member.nodes:
                first, last = _tangents(self.step, name, np.array([0.0, 1.0]))
                found.append(first if member.nodes[0] == node else -last)
        return np.array(found)


def _sketch_all(sketch: _Sketch) -> None:
    """Sketch everything but the centre lines; what comes first has the free choice of place."""
    scene, largest = sketch.scene, _largest_force(sketch)
    for name, node in scene.nodes.items():
        _sketch_support(sketch, name, node)
        if node.joint != "rigid":
            sketch.dot(sketch.at(name), f"joint-{name}")
    _sketch_releases(sketch)
    for name, motion in scene.motions.items():
        _sketch_motion(sketch, name, motion)
    for name, load in scene.loads.items():
        _sketch_load(sketch, name, load, largest)
    for name, node in scene.nodes.items():
        if node.support != "free":
            _sketch_reaction(sketch, name, largest)
    for name, contact in scene.contacts.items():
        _sketch_contact(sketch, name, obstacle(contact, sketch.step.model.space), largest)


def _factor(step: Equilibrium, history: str | None) -> float:
    return step.factor if history is None else step.model.scene.histories[history].factor(step.factor)


def _norm(vector: Any) -> float:
    return math.hypot(*vector)


def _across(flat: Array) -> Array:
    """A flat vector turned left by a right angle."""
    return np.array([-flat[1], flat[0]])


def _flat_unit(flat: Array, otherwise: tuple[float, float]) -> Array:
    """Unit vector along a flat one; that of ``otherwise`` where it is seen end-on."""
    length = _norm(flat)
    return flat / length if length > 0.05 else np.array(otherwise)


def _broken(*lines: Array) -> Array:
    """Polylines (n, k) as one, with a row of nan after each."""
    return np.vstack([part for line in lines for part in (line, np.full((1, line.shape[1]), np.nan))])


def _dense(flat: Array, spacing: float) -> Array:
    """Samples (n, 2) of a flat polyline that may be broken by nan."""
    finite = np.isfinite(flat.sum(axis=1))
    whole = finite[:-1] & finite[1:]
    first, steps = flat[:-1][whole], np.diff(flat, axis=0)[whole]
    counts = 1 + np.minimum(200, np.hypot(*steps.T) / spacing).astype(int)
    piece = np.repeat(np.arange(len(first)), counts)
    share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[piece]
    return np.vstack([flat[finite], first[piece] + share[:, None] * steps[piece]])


def _thinned(flat: Array, spacing: float) -> Array:
    """One place (m, 2) for all samples (n, 2) in the same square of this width."""
    return np.asarray(np.unique((flat / spacing).round(), axis=0) * spacing)


def _circle(radius: float, centre: tuple[float, float]) -> Array:
    angle = np.linspace(0.0, 2.0 * math.pi, 33)
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1)


# Supports and joints


@dataclass(frozen=True, eq=False)
class _Symbol:
    """Where a support's symbol is drawn: its own axes go along the ground and, from the node, towards it."""

    sketch: _Sketch
    node: str
    down: Array

    def put(self, shape: Any) -> Array:
        """Points (n, 2) of the symbol, in units of the size of symbols, in fixed axes (n, 3)."""
        flat = np.asarray(shape, float) @ np.stack([_across(self.down), self.down])
        return self.sketch.at(self.node) + self.sketch.view.raised(SYMBOL * self.sketch.size * flat)

    def line(self, shape: Any) -> None:
        """Draw a polyline of the symbol."""
        self.sketch.line(self.put(shape), f"support-{self.node}")

    def area(self, shape: Any) -> None:
        """Draw a polygon of the symbol."""
        self.sketch.area(self.put(shape), f"support-{self.node}")

    def ground(self, depth: float, half: float = 1.25, side: float = 1.0) -> None:
        """Draw a hatched line."""
        self.line([[-half, depth], [half, depth]])
        strokes = np.linspace(-half, half, 7)[1:]
        hatch = [np.array([[x, depth], [x - 0.4, depth + 0.4 * side]]) for x in strokes]
        self.sketch.line(self.put(_broken(*hatch)), f"support-{self.node}", width=0.8)

    def triangle(self, half: float, height: float) -> None:
        """Draw a triangle with a pin in the node."""
        self.area([[0, 0], [-half, height], [half, height]])
        self.sketch.dot(self.sketch.at(self.node), f"support-{self.node}")


def _sketch_support(sketch: _Sketch, name: str, node: Node) -> None:
    symbol = _Symbol(sketch, name, _below(sketch, name, [(0, -1), (0, 1), (-1, 0), (1, 0)]))
    if node.support == "clamped":
        _sketch_clamp(sketch, name)
    elif node.support == "hinge":
        if sketch.view.angles is not None:
            _sketch_rod(sketch, name, node.axis, 1.8)
        symbol.triangle(0.75, 1.2)
        symbol.ground(1.2)
    elif node.support == "ball":
        symbol.area(_circle(0.5, (0.0, 0.5)))
        symbol.ground(1.0)
    elif node.direction is not None:
        _sketch_slider(sketch, name, node, unit(node.direction))


def _below(sketch: _Sketch, node: str, directions: Sequence[Any]) -> Array:
    """The first of the directions (2,) that no member takes, or the freest."""
    leaving = sketch.view.flat(sketch.leaving(node))
    blocked = [max(0.72, float((leaving @ np.array(direction)).max())) for direction in directions]
    return np.array(directions[int(np.argmin(blocked))], float)


def _sketch_clamp(sketch: _Sketch, name: str) -> None:
    """A hatched wall across the members; in space a plate."""
    into = -sketch.leaving(name).sum(axis=0)
    if sketch.view.angles is None:
        _Symbol(sketch, name, _flat_unit(sketch.view.flat(into), (0.0, -1.0))).ground(0.0, half=1.4)
        return
    normal = into / _norm(into) if _norm(into) > 0.05 else np.array([0.0, 0.0, 1.0])
    one, two = _pair_across(normal, np.array([0.0, 0.0, 1.0]))
    corners = np.array([one + two, one - two, -one - two, two - one])
    sketch.area(sketch.at(name) + SYMBOL * sketch.size * corners, f"support-{name}", "#BBBBBBB0", 2.0)


def _pair_across(normal: Array, near: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that form a right-handed frame with a normal, the first as near as can be to ``near``."""
    for first in (near, *np.eye(3)):
        across = first - (first @ normal) * normal
        if _norm(across) > 0.05 * _norm(first) > 0.0:
            one = across / _norm(across)
            break
    return one, np.cross(normal, one)


def _sketch_rod(sketch: _Sketch, name: str, direction: Iterable[float], half: float) -> None:
    """A line through a node: the axis of a hinge or the guide of a slider in space."""
    along = half * SYMBOL * sketch.size * np.array(unit(direction))
    sketch.line(sketch.at(name) + np.array([-along, along]), f"support-{name}", width=1.6, level=4.0)


def _sketch_slider(sketch: _Sketch, name: str, node: Node, direction: tuple[float, float, float]) -> None:
    along = _flat_unit(sketch.view.flat(direction), (1.0, 0.0))
    normal = _across(along) * (1.0 if along[0] < 0.0 or (along[0] == 0.0 and along[1] < 0.0) else -1.0)
    symbol = _Symbol(sketch, name, _below(sketch, name, [normal, -normal]))
    if sketch.view.angles is not None:
        _sketch_rod(sketch, name, direction, 3.0)
        symbol.area(
            [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] if node.rotation == "fixed" else _circle(0.5, (0, 0))
        )
    elif node.rotation == "fixed":
        symbol.ground(0.6, half=1.6)
        symbol.ground(-0.6, half=1.6, side=-1.0)
    else:
        symbol.triangle(0.65, 1.0)
        for x in (-0.4, 0.4):
            symbol.area(_circle(0.2, (x, 1.2)))
        symbol.ground(1.4)


def _sketch_releases(sketch: _Sketch) -> None:
    """A small circle in the member, just beside the node."""
    for name, line in zip(sketch.course.members, sketch.course.last, strict=True):
        for end, points in zip((0, 1), (line, line[::-1]), strict=True):
            if sketch.scene.members[name].release[end] != "rigid":
                beside = np.linalg.norm(points - points[0], axis=1) > 0.02 * sketch.size
                sketch.dot(points[int(np.argmax(beside))], f"joint-{name}")


# Motions, loads and reactions


def _sketch_motion(sketch: _Sketch, name: str, motion: Motion) -> None:
    factor, node = _factor(sketch.step, motion.history), sketch.scene.nodes[motion.node]
    old, new = np.array(node.position) / sketch.course.unit, sketch.at(motion.node)
    if motion.displacement is not None and _norm(new - old) > 0.02 * sketch.size:
        ink = _Ink(f"motion-{name}", MOTION, 1.4, dotted=True)
        sketch.arrow(np.array([old, new]), ink)
        away = _flat_unit(_across(sketch.view.flat(new - old) / _norm(new - old)), (0.0, 1.0))
        text = _amount(_norm(new - old) * sketch.course.unit, "m")
        sketch.label(text, 0.5 * (old + new), away, ink)
    if motion.rotation is not None:
        turn = motion.rotation
        about = np.array(unit(node.axis)) if node.turn == "hinge" else np.array([0.0, 0.0, 1.0])
        vector = factor * (turn * about if isinstance(turn, float) else np.array(turn))
        ink = _Ink(f"motion-{name}", MOTION, 1.2, dotted=True)
        _sketch_turn(sketch, new, sketch.leaving(motion.node)[0], vector, "rad", ink)


def _largest_force(sketch: _Sketch) -> float:
    """Largest force of the loads on points and of the reactions, N; above zero."""
    step, scene = sketch.step, sketch.scene
    loads = [
        abs(_factor(step, load.history)) * _norm(load.vector) for load in scene.loads.values() if load.type == "force"
    ]
    reactions = [_norm(step.reaction(name)[0]) for name, node in scene.nodes.items() if node.support != "free"]
    pushes = [_norm(force) for entry in step.contacts.values() for force in np.atleast_2d(entry["force"])]
    return max([*loads, *reactions, *pushes, 1e-10 * step.model.scales.force])


def _sketch_load(sketch: _Sketch, name: str, load: Load, largest: float) -> None:
    value = _factor(sketch.step, load.history) * np.array(load.vector)
    if not value.any():
        return
    if load.type == "distributed":
        return _sketch_distributed(sketch, name, load, value)
    ink = _Ink(f"load-{name}", LOAD, 1.8)
    if load.node is not None:
        point, along, turned = sketch.at(load.node), sketch.leaving(load.node)[0], sketch.step.quaternion(load.node)
    else:
        assert load.member is not None
        x = np.array([load.at])
        point, along = sketch.along(load.member, x)[0], _tangents(sketch.step, load.member, x)[0]
        turned = sketch.step.along(load.member, x)["quaternion"][0]
    if load.frame == "follower" and turned is not None:
        value = quaternion.rotate(turned, value)
    if load.type == "moment":
        _sketch_turn(sketch, point, along, value, "N m", ink)
    else:
        _sketch_force(sketch, point, value, largest, ink)


def _sketch_reaction(sketch: _Sketch, name: str, largest: float) -> None:
    force, moment = sketch.step.reaction(name)
    point, arm = sketch.at(name), sketch.step.model.scales.length
    moments = [largest * arm, _norm(moment), *(float(np.abs(values).max()) for values in sketch.course.values)]
    ink = _Ink(f"reaction-{name}", REACTION, 1.1)
    if _norm(force) > 1e-6 * max(largest, max(moments) / arm):
        _sketch_force(sketch, point, force, largest, ink, pushing=True)
    if _norm(moment) > 1e-6 * max(moments):
        _sketch_turn(sketch, point, sketch.leaving(name)[0], moment, "N m", ink)


def _sketch_contact(sketch: _Sketch, name: str, stop: Obstacle, largest: float) -> None:
    """An obstacle as far as it is near the structure, in the plane, and what it pushes with."""
    unit, everything = sketch.course.unit, sketch.course.everything
    middle, reach = everything.mean(axis=0), 0.6 * sketch.size
    if stop.kind == "flat":
        foot = middle - ((middle - stop.place / unit) @ stop.normal) * stop.normal
        along = np.cross([0.0, 0.0, 1.0], stop.normal)
        outline = foot + np.linspace(-reach, reach, 41)[:, None] * along
    elif stop.kind == "round":
        angle = np.linspace(0.0, 2.0 * math.pi, 181)
        turns = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        outline = (stop.place + stop.radius * turns) / unit
    else:
        outline = stop.place[None, :] / unit
    if not sketch.step.model.space:
        if len(outline) == 1:
            sketch.dot(outline[0], f"contact-{name}", SUPPORT)
        near = np.linalg.norm(outline - middle, axis=1) <= 1.3 * reach
        if near.sum() > 1:
            sketch.line(np.where(near[:, None], outline, np.nan), f"contact-{name}")
    entry = sketch.step.contacts[name]
    several = isinstance(entry["member"], list)
    for member, at, force in zip(
        *([entry[k]] if not several else entry[k] for k in ("member", "at", "force")), strict=True
    ):
        if at is not None and _norm(force) > 1e-6 * largest:
            point = sketch.along(member, np.array([np.mean(at)]))[0]
            _sketch_force(sketch, point, force, largest, _Ink(f"push-{name}", REACTION, 1.1), pushing=True)


def _sketch_force(
    sketch: _Sketch, point: Array, value: Array, largest: float, ink: _Ink, *, pushing: bool = False
) -> None:
    """An arrow that starts at the point or, ``pushing``, ends there; the other way round where that hides less."""
    direction = value / _norm(value)
    length = ARROW * max(0.45, _norm(value) / largest) * sketch.size
    pulled = point + np.outer([0.012 * sketch.size, length], direction)
    pushed = pulled - (length + 0.012 * sketch.size) * direction
    ways = [(pushed, 0), (pulled, 1)] if pushing else [(pulled, 1), (pushed, 0)]
    points, free = min(ways, key=lambda way: _hidden(sketch, way[0], point))
    sketch.arrow(points, ink)
    away = _flat_unit(sketch.view.flat(points[free] - point) / length, (0.0, 1.0))
    sketch.label(_amount(_norm(value), "N"), points[free], away, ink)


def _hidden(sketch: _Sketch, points: Array, point: Array) -> int:
    """How much of an arrow (2, 3) is near what is sketched, besides what is at its point."""
    flat, here, crowd = sketch.view.flat(points), sketch.view.flat(point), sketch.crowd
    crowd = crowd[np.linalg.norm(crowd - here, axis=1) > 0.03 * sketch.size]
    path = _dense(flat, 0.005 * sketch.size)
    apart = np.hypot(*(crowd[None, :, :] - path[:, None, :]).transpose(2, 0, 1))
    return int((apart.min(axis=1, initial=np.inf) < 0.015 * sketch.size).sum())


def _sketch_turn(sketch: _Sketch, point: Array, along: Array, vector: Array, letters: str, ink: _Ink) -> None:
    """A circular arrow about a vector, open towards the member, whose tangent is ``along``."""
    size = _norm(vector)
    if size == 0.0:
        return
    radius = TURNS[ink.colour]
    one, two = _pair_across(vector / size, along)
    angle = np.radians(np.linspace(50.0, 310.0, 60))[:, None]
    sketch.arrow(point + radius * sketch.size * (np.cos(angle) * one + np.sin(angle) * two), ink)
    away = _flat_unit(-sketch.view.flat(one), (0.0, 1.0))
    sketch.label(_amount(size, letters), point, away, ink, gap=radius)


def _sketch_distributed(sketch: _Sketch, name: str, load: Load, value: Array) -> None:
    """Small arrows onto the member with a line over their ends."""
    assert load.member is not None
    x = np.linspace(0.0, 1.0, 49)
    profile = np.ones(len(x)) if load.profile is None else evaluate(load.profile, x)
    peak = float(np.abs(profile).max())
    if peak == 0.0:
        return
    places = sketch.along(load.member, x)
    values = np.broadcast_to(value, places.shape)
    if load.frame == "section":
        values = quaternion.rotate(sketch.step.model.scene.center_lines[load.member].quaternions(x), values)
    if load.frame != "fixed":
        values = quaternion.rotate(sketch.step.along(load.member, x)["quaternion"], values)
    ends = places - 0.6 * ARROW * sketch.size * (profile / peak)[:, None] * values / _norm(value)
    ink = _Ink(f"load-{name}", LOAD, 1.0)
    sketch.line(ends, ink.name, colour=LOAD, width=0.8)
    for i in range(0, len(x), 6):
        if abs(profile[i]) > 0.2 * peak:
            sketch.arrow(np.array([ends[i], places[i]]), ink)
    top = _label_place(np.abs(profile))
    away = _flat_unit(sketch.view.flat(ends[top] - places[top]) / (0.6 * ARROW * sketch.size), (0.0, 1.0))
    sketch.label(_amount(peak * _norm(value), "N/m"), ends[top], away, ink)


def _label_place(profile: Array) -> int:
    """Index of the largest value; the middle one of several."""
    largest = np.flatnonzero(profile >= profile.max() * (1.0 - 1e-9))
    return int(largest[len(largest) // 2])


# The sheet: axes, layout, and the places of labels


def _sheet(sketch: _Sketch, steps: Sequence[Equilibrium], colour: Colour) -> _Sheet:
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    paper = figure.add_subplot()
    axes = paper if sketch.view.angles is None else _space_axes(figure, paper, sketch)
    if axes is paper:
        _fill_plane(axes, sketch)
    lines, values = _add_lines(axes, sketch)
    if values is not None:
        _add_bar(figure, paper, lines, values, sketch, colour)
    title = _title(sketch.scene.title)
    if title:
        figure.suptitle(title, fontsize=11, parse_math=False)
    handles = _legend(sketch, steps)
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=min(4, len(handles)), fontsize=8, frameon=False
        )
    return _Sheet(figure, axes, paper, sketch)


def _title(text: str) -> str:
    """The title in up to three lines of about the same length; a white box for what the font does not have."""
    font = get_font(findfont(FontProperties()))
    known = " ".join("".join(c if c.isspace() or font.get_char_index(ord(c)) else "\ufffd" for c in text).split())
    lines = math.ceil(len(known) / 68)
    even = (textwrap.wrap(known, width) for width in range(max(20, len(known) // max(1, lines)), 69))
    fitting = (wrapped for wrapped in even if len(wrapped) <= min(3, lines))
    return "\n".join(next(fitting, textwrap.wrap(known, 68, max_lines=3, placeholder=" ...")))


def _fill_plane(axes: Axes, sketch: _Sketch) -> None:
    flat = sketch.view.flat(sketch.course.everything)
    middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    axes.set_xlim(middle[0] - sketch.size, middle[0] + sketch.size)
    axes.set_ylim(middle[1] - sketch.size, middle[1] + sketch.size)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(f"x, {sketch.course.letter}m")
    axes.set_ylabel(f"y, {sketch.course.letter}m")
    axes.grid(color="#EBEBEB", linewidth=0.6)
    axes.set_axisbelow(True)


def _space_axes(figure: Figure, paper: Axes, sketch: _Sketch) -> Any:
    """Axes in space below the paper, on which marks and labels are drawn."""
    assert sketch.view.angles is not None
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    paper.set_axis_off()
    paper.set_zorder(axes.get_zorder() + 1)
    axes.set_proj_type("ortho")
    axes.view_init(*sketch.view.angles)
    low, high = sketch.course.everything.min(axis=0), sketch.course.everything.max(axis=0)
    half = 0.52 * np.maximum(high - low, 0.3 * float((high - low).max()))
    middle = 0.5 * (low + high)
    axes.set(xlim=_interval(middle, half, 0), ylim=_interval(middle, half, 1), zlim=_interval(middle, half, 2))
    for axis, letter in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_label_text(f"{letter}, {sketch.course.letter}m")
        axis.set_rotate_label(False)
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
    axes.set_box_aspect(half)
    return axes


def _interval(middle: Array, half: Array, i: int) -> tuple[float, float]:
    return (middle[i] - half[i], middle[i] + half[i])


def _add_lines(axes: Any, sketch: _Sketch) -> tuple[Any, Array | None]:
    """Undeformed, earlier and last lines; the last ones, and the values (n,) N m to colour their pieces by."""
    course, space = sketch.course, sketch.view.angles is not None

    def add(lines: Sequence[Array], name: str, **style: Any) -> Any:
        kind = Line3DCollection if space else LineCollection
        found = kind(lines if space else [line[:, :2] for line in lines], gid=name, clip_on=not space, **style)
        axes.add_collection(found, **({} if space else {"autolim": False}))
        return found

    add(course.rest, "undeformed", colors=REST, linewidths=1.0, linestyles=(0, (5, 3)), zorder=2)
    for lines, shade in zip(course.earlier, _shades(len(course.earlier)), strict=True):
        add(lines, "earlier", colors=shade, linewidths=1.3, zorder=2.5)
    add(course.last, "outline", colors="#222222", linewidths=3.8, capstyle="round", zorder=3)
    style: dict[str, Any] = {"linewidths": 2.4, "capstyle": "round", "zorder": 3.5}
    if not course.values:
        return add(course.last, "deformed", colors="#7F8FA6", **style), None
    pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in course.last])
    values = np.concatenate([0.5 * (value[:-1] + value[1:]) for value in course.values])
    return add(list(pieces), "deformed", **style), values


def _add_bar(figure: Figure, paper: Axes, lines: Any, values: Array, sketch: _Sketch, colour: Colour) -> None:
    """Colour the pieces by the values (n,) in N m, and say so in a colour bar from zero to the extremes."""
    plane = sketch.view.angles is None
    signed = plane and colour == "moment"
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    largest = max(high, -low)
    factor, letter = _prefix(largest, 0.2)
    lines.set(cmap=SIGNED if signed else SIZES, norm=Normalize(-largest / factor if signed else 0.0, largest / factor))
    lines.set_array(values / factor)
    bar = figure.colorbar(lines, ax=paper, shrink=0.85, aspect=32, pad=0.02)
    bar.ax.set_ylim(low / factor, high / factor)
    name = "bending moment about z" if signed else "bending moment" if colour == "moment" else "size of bending moment"
    bar.set_label(f"{name}, {letter}N m")


def _shades(count: int) -> list[tuple[float, float, float]]:
    """Colours of earlier steps, paler the earlier."""
    pale, firm = np.array([0.80, 0.85, 0.90]), np.array([0.42, 0.53, 0.65])
    shares = np.linspace(0.0, 1.0, count) if count > 1 else np.ones(count)
    return [tuple(float(c) for c in pale + share * (firm - pale)) for share in shares]  # type: ignore[misc]


def _legend(sketch: _Sketch, steps: Sequence[Equilibrium]) -> list[Line2D]:
    """What the lines and arrows are; the last line only where there is something to say about it."""
    last, drawn = steps[-1], {mark.name.partition("-")[0] for mark in sketch.marks if mark.kind == "arrow"}
    handles = [Line2D([], [], color=REST, linewidth=1.0, linestyle=(0, (5, 3)), label="undeformed")]
    handles += _legend_of_steps([step.factor for step in steps[:-1]])
    stable = {False: ", unstable", "neutral": ", neutral"}.get(last.certificate.stable, "")
    if len(steps) > 1 or last.factor != 1.0 or stable:
        handles.append(Line2D([], [], color="#222222", linewidth=3.0, label=f"factor {_say(last.factor)}{stable}"))
    arrows = {"load": (LOAD, "load"), "reaction": (REACTION, "reaction"), "motion": (MOTION, "prescribed motion")}
    for name, (colour, text) in arrows.items():
        if name in drawn:
            line = Line2D([], [], color=colour, marker=">", markersize=5, label=text)
            line.set_linestyle(":" if name == "motion" else "-")
            handles.append(line)
    return handles


def _legend_of_steps(factors: Sequence[float]) -> list[Line2D]:
    shades = _shades(len(factors))
    if len(factors) <= 5:
        texts = [f"factor {_say(factor)}" for factor in factors]
    else:
        shades, texts = (
            [shades[len(shades) // 2]],
            [f"{len(factors)} other factors, {_say(min(factors))} to {_say(max(factors))}"],
        )
    return [Line2D([], [], color=c, linewidth=1.3, label=text) for c, text in zip(shades, texts, strict=True)]


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
    return 0.6 * FONT * len(text.replace("$", ""))


def _arrow(points: Array, mark: _Mark, style: dict[str, Any]) -> FancyArrowPatch:
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
class _Sheet:
    """A figure with its axes, the same where marks are drawn on, and what is to be drawn."""

    figure: Figure
    axes: Any
    paper: Axes
    sketch: _Sketch
    zoom: float = 1.0

    def finish(self) -> None:
        """Fit the axes to all that is drawn, and draw it."""
        for _ in range(4 if self.axes is self.paper else 6):
            self.figure.draw_without_rendering()
            self._fit()
        self.figure.draw_without_rendering()
        if self.axes is not self.paper:
            self._hide_colliding()
        for mark in self.sketch.marks:
            self._draw(mark)
        gravity = self._gravity()
        for label, box in self._placed(gravity):
            self._write(box.centre, label.text, label.colour, label.name)

    def pixels(self, points: Array) -> Array:
        """Places (n, 2) on the sheet of points (n, 3) in drawn units."""
        return np.asarray(self.axes.transData.transform(self._projected(points)))

    def _projected(self, points: Array) -> Array:
        if self.axes is self.paper:
            return points[:, :2]
        x, y, _ = proj3d.proj_transform(*points.T, self.axes.get_proj())
        return np.stack([np.asarray(x), np.asarray(y)], axis=1)

    def _point(self) -> float:
        return float(self.figure.dpi) / 72.0

    def _size(self) -> float:
        """Size of the picture in pixels."""
        middle = self.sketch.course.everything[0]
        ends = self.pixels(np.array([middle, middle + self.sketch.size * self.sketch.view.right]))
        return _norm(ends[1] - ends[0])

    # -- layout -----------------------------------------------------------------------------------

    def _content(self) -> Array:
        """Corners (2, 2) in pixels of the structure, the marks and the labels."""
        sketch = self.sketch
        parts = [self.pixels(sketch.course.everything)]
        parts += [self.pixels(mark.points[np.isfinite(mark.points).all(axis=1)]) for mark in sketch.marks]
        parts += [box.corners for _, box in self._placed([])]
        pixels = np.vstack(parts)
        margin = 9.0 * self._point()
        return np.array([pixels.min(axis=0) - margin, pixels.max(axis=0) + margin])

    def _fit(self) -> None:
        content = self._content()
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

    def _fit_space(self, content: Array) -> None:
        cell, renderer = self.paper.get_window_extent(), FigureCanvasAgg(self.figure).get_renderer()  # type: ignore[no-untyped-call]
        limits = np.array([self.axes.get_xlim(), self.axes.get_ylim(), self.axes.get_zlim()])
        ticks = [axis.get_tightbbox(renderer) for axis in self._axes_in_space()]
        corners = self.pixels(np.array(list(itertools.product(*limits))))
        low = np.min([content[0], corners.min(axis=0), *(box.min for box in ticks)], axis=0)
        high = np.max([content[1], corners.max(axis=0), *(box.max for box in ticks)], axis=0)
        self.zoom *= float((cell.size / (high - low)).min())
        self.axes.set_box_aspect(limits @ [-0.5, 0.5], zoom=self.zoom)
        left, bottom, width, height = self.axes.get_position(original=True).bounds
        shift = (0.5 * (cell.min + cell.max - low - high)) / self.figure.bbox.size
        self.axes.set_position((left + shift[0], bottom + shift[1], width, height))
        for axis in self._axes_in_space():
            self._space_out(axis)

    def _axes_in_space(self) -> tuple[Any, Any, Any]:
        return self.axes.xaxis, self.axes.yaxis, self.axes.zaxis

    def _space_out(self, axis: Any) -> None:
        """Ticks some way apart; their labels, and that of the axis, at a fixed distance of the axis on the sheet."""
        line = self.axes.transData.transform(np.stack(axis.line.get_data(), axis=1))
        length, point = np.abs(line[1] - line[0]), self._point()
        width = 6.5 * max([4, *(len(label.get_text()) for label in self._tick_labels(axis))])
        # Labels along the axis are apart when they are either beside or above each other.
        bins = min(6, max(1, int((length / (point * np.array([width + 10.0, 20.0]))).max())))
        axis.set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10], min_n_ticks=min(2, bins)))
        off = self.axes.transData.transform(axis.label.get_position()) - line.mean(axis=0)
        across = np.abs(off) / _norm(off)
        tick = 5.0 + float(across @ [0.48 * width, 5.0])
        per_pad = _norm(off) / (point * (axis.labelpad + 21.0))
        axis.set_tick_params(pad=tick / per_pad - 8.0)
        axis.labelpad = (2.0 * tick + float(across @ [24.0, 8.0])) / per_pad - 21.0

    # -- marks ------------------------------------------------------------------------------------

    def _draw(self, mark: _Mark) -> None:
        points = self._projected(mark.points)
        style: dict[str, Any] = {
            "transform": self.axes.transData,
            "zorder": mark.level,
            "gid": mark.name,
            "clip_on": False,
        }
        if mark.kind == "area":
            patch = Polygon(points, facecolor=mark.fill, edgecolor=mark.colour, linewidth=mark.width, **style)
            self.paper.add_patch(patch)
        elif mark.kind == "arrow":
            self.paper.add_patch(_arrow(points, mark, style))
        else:
            if mark.kind == "dot":
                style |= {"marker": "o", "markersize": 5.5, "markerfacecolor": mark.fill}
            line = Line2D(points[:, 0], points[:, 1], color=mark.colour, linewidth=mark.width, **style)
            self.paper.add_line(line)

    def _gravity(self) -> list[_Box]:
        """Draw gravity in the corner that is the emptiest; what it covers."""
        gravity = self.sketch.scene.gravity
        factor = self.sketch.step.factor
        if gravity is None or not any(gravity) or factor == 0.0:
            return []
        text, point = f"gravity {_round(abs(factor) * _norm(gravity)):g} m/s²", self._point()
        half = np.array([0.5 * _text_width(text) + 4.0, 28.0]) * point
        box = min(self._corners(half), key=lambda corner: int(corner.holds(self._crowd()[0]).sum()))
        direction = _flat_unit(self.sketch.view.flat(math.copysign(1.0, factor) * np.array(unit(gravity))), (0.0, -1.0))
        middle = box.centre + np.array([0.0, 7.0 * point])
        ends = np.array([middle - 17.0 * point * direction, middle + 17.0 * point * direction])
        points = self.paper.transAxes.inverted().transform(ends)
        mark = _Mark(kind="arrow", points=points, name="gravity", colour=LOAD, width=1.8)
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
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": FONT, "zorder": 9.0, "gid": name}
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
            (4.0, [self.pixels(mark.points) for mark in sketch.marks]),
        ]
        parts = [
            (cost, _thinned(np.vstack([_dense(line, spacing) for line in lines]), spacing))
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

    def _placed(self, taken: Sequence[_Box]) -> list[tuple[_Label, _Box]]:
        """The labels in turn where they hide least; of many alike only the first."""
        labels, crowd, found = self.sketch.labels, self._crowd(), []
        boxes = [*taken, *self._writings()]
        if len(labels) > MANY:
            labels = list({(label.text, label.colour): label for label in reversed(labels)}.values())[::-1]
        for label in labels:
            choices = [
                (cost + self._cost(box, crowd, boxes), i, box) for i, (cost, box) in enumerate(self._choices(label))
            ]
            box = min(choices)[2]
            boxes.append(box)
            found.append((label, box))
        return found

    def _cost(self, box: _Box, crowd: tuple[Array, Array], boxes: Sequence[_Box]) -> float:
        return float(crowd[1][box.holds(crowd[0])].sum()) + 80.0 * sum(box.meets(other) for other in boxes)

    def _choices(self, label: _Label) -> Iterator[tuple[float, _Box]]:
        """Places round the anchor, the preferred ones first and cheap."""
        point, half = self._point(), self._half(label.text)
        anchor, clear = self.pixels(label.anchor[None, :])[0], label.gap * self._size()
        preferred = math.atan2(label.away[1], label.away[0])
        for ring in (0, 1, 2):
            for turn in (0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6):
                angle = preferred + turn * math.pi / 6.0
                towards = np.array([math.cos(angle), math.sin(angle)])
                reach = float(np.abs(towards) @ half) * (1.0 - 0.25 * abs(math.sin(2.0 * angle)))
                gap = clear + (2.0 + 9.0 * ring) * point
                yield 0.3 * abs(turn) + 4.0 * ring, _Box(anchor + (reach + gap) * towards, half)

    def _half(self, text: str) -> Array:
        return np.array([0.5 * _text_width(text) + 1.0, 0.7 * FONT]) * self._point()
