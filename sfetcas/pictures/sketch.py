"""What a picture of an answer shows, before any of it is drawn: sampled centre lines, marks and labels in fixed axes.

Lengths are in drawn units, metres with an SI prefix, from the sampling on; ``flat`` coordinates (n, 2) are those
in the plane of the picture, which is x-y or faces the viewer.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ..description.scene import Scene
from ..equilibria.solution import Configuration
from ..mathematics import quaternion
from ..mathematics.arrays import Array

__all__ = [
    "BEHIND",
    "FIELD",
    "LOAD",
    "MAGNET",
    "MOTION",
    "NATURAL",
    "REACH",
    "REACTION",
    "REST",
    "SUPPORT",
    "TENDON",
    "TWISTING",
    "Course",
    "Ink",
    "Label",
    "Look",
    "Mark",
    "Sketch",
    "View",
    "broken",
    "course_of",
    "dense",
    "flat_unit",
    "in_short",
    "left_of",
    "norm",
    "prefix",
    "rounded",
    "tangents_of",
    "thinned",
    "turning_of",
    "unit_for",
    "view_of",
    "with_prefix",
]

LOAD, REACTION, MOTION = "#D55E00", "#0072B2", "#8F3B76"
MAGNET, FIELD = "#B22222", "#007A5E"
NATURAL = ("#C44E52", "#4C72B0")
TENDON = "#8C4A9E"
"""Colours of natural curvature to the left or in space, and to the right."""
REST, SUPPORT = "#8C8C8C", "#333333"
REACH = 0.13
"""How far the largest displacement of a mode is drawn, over the size of the structure."""
TWISTING = 1e-3
"""A mode shape whose displacements are below this share of its rotations times the size only twists."""
BEHIND = 1.5
"""Level of marks that are drawn behind the structure, also in space."""
PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T", 15: "P"}


def rounded(value: float) -> float:
    """A value in three digits."""
    return float(f"{value:.3g}")


def in_short(factor: float) -> str:
    """A factor in up to four digits."""
    return f"{float(f'{factor:.4g}'):g}"


def prefix(value: float, least: float = 0.1) -> tuple[float, str]:
    """Factor and letter of the SI prefix for a value: none from ``least`` to 9999, a power of ten beyond all."""
    value = abs(value)
    if value == 0.0 or least <= value < 1e4 or not math.isfinite(value):
        return 1.0, ""
    power = 3 * math.floor(math.log10(value / (least if value < least else 1.0)) / 3.0)
    return 10.0**power, PREFIXES.get(power, f"{_ten_to(power)} ")


def with_prefix(value: float, unit: str, least: float = 0.1) -> tuple[float, str]:
    """Factor and unit for a value: the unit with its SI prefix, or behind a power of ten where it takes none."""
    factor, letter = prefix(value, least)
    if (unit[:1].isalpha() and not unit.startswith("kg")) or not letter:
        return factor, f"{letter}{unit}"
    power = _ten_to(round(math.log10(factor)))
    return factor, f"{power}{unit[1:]}" if unit.startswith("1/") else f"{power} {unit}".rstrip()


def unit_for(values: Array, unit: str) -> tuple[float, str]:
    """Factor and unit for an axis on which values are drawn; of values far from zero that of differences."""
    known = values[np.isfinite(values)]
    size = float(np.abs(known).max(initial=0.0))
    spread = float(np.ptp(known)) if len(known) else 0.0
    return with_prefix(spread if ROUNDING * size < spread < OFFSET * size else size, unit)


ROUNDING, OFFSET = 1e-12, 1e-3
"""Values that differ by less than the first share of their size are the same; by less than the second, axes tell a
number to be added."""


def _ten_to(power: int) -> str:
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def amount(value: float, name: str) -> str:
    """A value with its unit in three digits, as ``1.5 kN``."""
    value = rounded(abs(value))
    factor, letter = prefix(value)
    return f"{rounded(value / factor):g} {letter}{name}"


# The centre lines


@dataclass(frozen=True, eq=False)
class Course:
    """Sampled centre lines, each (n, 3) in drawn units.

    Attributes
    ----------
    unit, letter : m, and the SI prefix of the drawn unit
    members : names, in the order of the lists
    rest, last : undeformed, and of the last step
    earlier : the same of the earlier steps, step by step
    values : (n,) in SI units along the lines of ``last``; empty where nothing is to be coloured
    earlier_values : the same of the earlier steps, where they are asked for
    largest_moment : of the sections of ``last``, N m
    """

    unit: float
    letter: str
    members: tuple[str, ...]
    rest: list[Array]
    last: list[Array]
    earlier: list[list[Array]]
    values: list[Array]
    earlier_values: list[list[Array]] = field(default_factory=list)
    largest_moment: float = 0.0

    @functools.cached_property
    def everything(self) -> Array:
        """All samples, (n, 3)."""
        return np.vstack([*self.rest, *self.last, *(line for lines in self.earlier for line in lines)])


Values = Callable[[Configuration, Mapping[str, Mapping[str, Array]], Mapping[str, Array]], list[Array]]
"""(state, fields of each member, fractions of its length) -> values (n,) along each, or nothing."""


def course_of(
    scene: Scene, steps: Sequence[Configuration], values: Values | None = None, *, every: bool = False
) -> Course:
    """Sampled centre lines of the undeformed scene and of states, with values of the last one (or ``every``)."""
    names = tuple(scene.members)
    places = [{name: _samples(step, name) for name in names} for step in steps]
    fields = [{name: step.along(name, x[name]) for name in names} for step, x in zip(steps, places, strict=True)]
    rest = [scene.center_lines[name].positions(places[-1][name]) for name in names]
    deformed = [[entry["position"] for entry in entries.values()] for entries in fields]
    extent = max(float(np.ptp(np.vstack(lines), axis=0).max()) for lines in (rest, *deformed))
    unit, letter = prefix(extent, 0.2)
    (first, last, *earlier) = [[line / unit for line in lines] for lines in (rest, deformed[-1], *deformed[:-1])]
    given = list(zip(steps, fields, places, strict=True))
    told = [] if values is None else [values(*one) for one in given[0 if every else -1 :]]
    largest = max(float(np.linalg.norm(entry["moment"], axis=1).max()) for entry in fields[-1].values())
    return Course(unit, letter, names, first, last, earlier, told[-1] if told else [], told[:-1], largest)


def _samples(step: Configuration, member: str) -> Array:
    """Fractions of the length where a member is drawn: at least 101, a step turning by 0.05 rad at most."""
    return np.linspace(0.0, 1.0, 1 + min(20_000, max(100, math.ceil(turning_of(step, member) / 0.05))))


def turning_of(step: Configuration, member: str) -> float:
    """How far the tangent of a member turns along it, rad: deformed, or undeformed where that is more."""
    tangents = tangents_of(step, member, step.model.along(member))
    turned = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    turning = float((2.0 * np.arcsin(np.clip(0.5 * turned, 0.0, 1.0))).sum())
    return max(turning, step.model.scene.center_lines[member].turning)


def tangents_of(step: Configuration, member: str, x: Array, fields: Mapping[str, Array] | None = None) -> Array:
    """Unit tangents (n, 3) at fractions (n,) of the length of a deformed member, fixed axes.

    ``fields`` are those there, as of :meth:`Configuration.along`, where they are known.
    """
    rest = step.model.scene.center_lines[member].tangents(x)
    return quaternion.rotate((fields or step.along(member, x))["quaternion"], rest)


# The point of view


@dataclass(frozen=True, eq=False)
class View:
    """Unit vectors (3,) to the right and up in the picture; in space elevation and azimuth of the view in degrees."""

    right: Array
    up: Array
    angles: tuple[float, float] | None = None

    def flat(self, points: Any) -> Array:
        """Points or vectors (..., 3) in fixed axes projected onto the picture, (..., 2), in the same unit."""
        return np.asarray(np.asarray(points, float) @ np.stack([self.right, self.up], axis=1))

    def raised(self, points: Any) -> Array:
        """Vectors (..., 2) in the picture as vectors (..., 3) in fixed axes, in the same unit."""
        return np.asarray(np.asarray(points, float) @ np.stack([self.right, self.up]))


def view_of(space: bool, lines: Sequence[Array]) -> View:
    """The x-y plane or, in space, of some usual views the one in which lines (n, 3), in drawn units, appear largest."""
    if not space:
        return View(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    points = np.vstack([line[:: max(1, len(line) // 100)] for line in lines])
    views = [_from(elevation, azimuth) for elevation in (22, 32) for azimuth in (-60, -45, -30, -120, -135, -150)]
    return max(views, key=lambda view: _breadth(view.flat(points - points.mean(axis=0))))


def _from(elevation: float, azimuth: float) -> View:
    e, a = math.radians(elevation), math.radians(azimuth)
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    up = np.array([-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)])
    return View(right, up, (elevation, azimuth))


def _breadth(flat: Array) -> float:
    values = np.linalg.eigvalsh(flat.T @ flat)
    # The shorter direction counts most; equal views are decided by the order, also after rounding.
    return rounded(float(values[0] + 0.05 * values[1]))


# What is sketched: marks and labels


@dataclass(frozen=True)
class Look:
    """How the lines of an equilibrium look, and what the legend says of them: nothing where ``text`` is empty."""

    colour: str
    dashes: Any
    text: str


@dataclass(frozen=True)
class Ink:
    """How the arrow of a load, a reaction or a motion looks; its name finds it again in the figure."""

    name: str
    colour: str
    width: float
    dotted: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Mark:
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
class Label:
    """A text beside an anchor (3,), in some direction ``away`` (2,) by preference, at least ``gap`` off.

    It may be left out where others in the same ``unit`` have larger values.
    """

    anchor: Array
    away: Array
    text: str
    colour: str
    name: str
    gap: float = 0.0
    value: float = math.inf
    unit: str = ""


@dataclass(eq=False)
class Sketch:
    """Marks and labels of one equilibrium, and what they must not hide.

    ``sides`` are those that arrows have chosen, by name and number: shared by several states they stay.
    """

    scene: Scene
    step: Configuration
    course: Course
    view: View
    marks: list[Mark] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    sides: dict[tuple[str, int], int] = field(default_factory=dict)

    @functools.cached_property
    def size(self) -> float:
        """Diagonal of what is drawn of the structure in the plane of the picture, drawn units."""
        return float(np.hypot(*np.ptp(self.view.flat(self.course.everything), axis=0)))

    @functools.cached_property
    def lines(self) -> Array:
        """Flat samples (n, 2) of the structure, undeformed and deformed."""
        lines = [self.view.flat(line) for line in (*self.course.rest, *self.course.last)]
        return thinned(np.vstack([dense(line, 0.005 * self.size) for line in lines]), 0.005 * self.size)

    @property
    def crowd(self) -> Array:
        """Flat samples (n, 2) of all that is sketched so far."""
        return np.vstack([self.lines, *(dense(self.view.flat(mark.points), 0.01 * self.size) for mark in self.marks)])

    def factor(self, history: str | None) -> float:
        """What multiplies loads and motions with a history, or, with None, those that grow with the load factor."""
        return self.step.factor if history is None else self.scene.histories[history].factor(self.step.factor)

    @functools.cached_property
    def largest_force(self) -> float:
        """Largest force of the loads on points and of the reactions, N; above zero."""
        step, scene = self.step, self.scene
        loads = [abs(self.factor(x.history)) * norm(x.vector) for x in scene.loads.values() if x.type == "force"]
        reactions = [norm(step.reaction(name)[0]) for name, node in scene.nodes.items() if node.support != "free"]
        pushes = [norm(force) for entry in step.contacts.values() for force in np.atleast_2d(entry["force"])]
        return max([*loads, *reactions, *pushes, 1e-10 * step.model.scales.force])

    def at(self, node: str) -> Array:
        """Place of a node (3,), drawn units."""
        return self.step.position(node) / self.course.unit

    def along(self, member: str, x: Array) -> Array:
        """Places (n, 3) along a deformed member, drawn units."""
        return self.step.along(member, x)["position"] / self.course.unit

    def line(self, points: Array, name: str, *, colour: str = SUPPORT, width: float = 1.2, level: float = 5.0) -> None:
        """Sketch a polyline (n, 3)."""
        self.marks.append(Mark(kind="line", points=points, name=name, colour=colour, width=width, level=level))

    def area(self, points: Array, name: str, fill: str = "white", level: float = 5.0) -> None:
        """Sketch a polygon (n, 3)."""
        mark = Mark(kind="area", points=points, name=name, colour=SUPPORT, width=1.2, fill=fill, level=level)
        self.marks.append(mark)

    def dot(self, point: Array, name: str) -> None:
        """Add a small circle at (3,), in drawn units."""
        mark = Mark(kind="dot", points=point[None, :], name=name, colour=SUPPORT, fill="white", level=8.0)
        self.marks.append(mark)

    def arrow(self, points: Array, ink: Ink) -> None:
        """Sketch an arrow along a polyline (n, 3)."""
        look: dict[str, Any] = {"name": ink.name, "colour": ink.colour, "width": ink.width, "dotted": ink.dotted}
        self.marks.append(Mark(kind="arrow", points=points, level=7.0, **look))

    def label(self, text: str, anchor: Array, away: Array, ink: Ink, gap: float = 0.0) -> None:
        """Add a text beside an anchor (3,), in drawn units."""
        label = Label(anchor=anchor, away=away, text=text, colour=ink.colour, name=ink.name, gap=gap)
        self.labels.append(label)

    def write_value(self, value: float, unit: str, anchor: Array, away: Array, ink: Ink, gap: float = 0.0) -> None:
        """Add a value with its unit beside an anchor (3,); it may be left out where larger ones need the space."""
        self.label(amount(value, unit), anchor, away, ink, gap)
        self.labels[-1] = replace(self.labels[-1], value=abs(value), unit=unit)

    def leaving(self, node: str) -> Array:
        """Unit tangents (k, 3) of the members that end at a node, out of it."""
        found = []
        for name, member in self.scene.members.items():
            if node in member.nodes:
                first, last = tangents_of(self.step, name, np.array([0.0, 1.0]))
                found.append(first if member.nodes[0] == node else -last)
        return np.array(found).reshape(-1, 3)

    def direction(self, node: str) -> Array:
        """Unit tangent (3,) of the first member at a node, out of it; along x where there is none, but an obstacle."""
        leaving = self.leaving(node)
        return np.asarray(leaving[0]) if len(leaving) else np.array([1.0, 0.0, 0.0])


def norm(vector: Any) -> float:
    """Length of a vector of any size."""
    return math.hypot(*vector)


def left_of(flat: Array) -> Array:
    """A vector (2,) of the picture rotated by a right angle to the left, in the same unit."""
    return np.array([-flat[1], flat[0]])


def flat_unit(flat: Array, otherwise: tuple[float, float]) -> Array:
    """Unit vector along a flat one; that of ``otherwise`` where it is seen end-on."""
    length = norm(flat)
    return flat / length if length > 0.05 else np.array(otherwise)


def broken(*lines: Array) -> Array:
    """Polylines (n, k) as one, with a row of nan after each."""
    return np.vstack([part for line in lines for part in (line, np.full((1, line.shape[1]), np.nan))])


def dense(flat: Array, spacing: float) -> Array:
    """Samples (n, 2) of a flat polyline that may be broken by nan."""
    finite = np.isfinite(flat.sum(axis=1))
    whole = finite[:-1] & finite[1:]
    first, steps = flat[:-1][whole], np.diff(flat, axis=0)[whole]
    counts = 1 + np.minimum(200, np.hypot(*steps.T) / spacing).astype(int)
    piece = np.repeat(np.arange(len(first)), counts)
    share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[piece]
    return np.vstack([flat[finite], first[piece] + share[:, None] * steps[piece]])


def thinned(flat: Array, spacing: float) -> Array:
    """One place (m, 2) for all samples (n, 2) in the same square of this width."""
    return np.asarray(np.unique((flat / spacing).round(), axis=0) * spacing)
