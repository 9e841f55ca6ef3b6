"""What a page shows of an answer: members, symbols and values of each of its states, as tables for the viewer.

Lengths are metres in fixed axes.  Places and values along members are packed as little-endian numbers, in double
precision where there are few of them.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from ..description.answers import outlined
from ..description.records import plain
from ..dynamics.modes import Modes
from ..dynamics.motion import Trajectory
from ..equilibria.solution import Configuration, Solution
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..paths.path import FlutterPoint, Path
from ..pictures.colours import QUANTITIES, ColourQuantity
from ..pictures.glyphs import STANDING, sketch_carried, sketch_loads, sketch_supports
from ..pictures.sketch import (
    LOAD,
    MOTION,
    REACH,
    REACTION,
    TWISTING,
    Course,
    Sketch,
    View,
    in_short,
    prefix,
    turning_of,
    view_of,
)

__all__ = ["MOST_STATES", "Shown", "content_of"]

Shown: TypeAlias = Solution | Path | Trajectory | Modes
"""An answer that a page shows."""

MOST_STATES, FEWEST_STATES = 200, 24
"""States of a path or a motion on a page, and of large scenes; with more, some are passed over."""

TOLD_LENGTH = 50
"""What is told of a node takes as much room as so many numbers along members."""

MOST_NUMBERS, EXACT_NUMBERS = 200_000, 40_000
"""Numbers along members on a page, about 1 MB, and how many of them have double precision."""

TURNING, FEWEST, MOST_PLACES = 0.06, 9, 401
"""Turning, rad, between two places of a curved member, and places along a member, at least and at most."""

LOOKED_AT = 4
"""States at which it is looked how far members turn."""

SMOOTH = 25
"""Places along a member whose values change, where there is room."""

LISTED = 20
"""States up to which members are told at the places of the JSON answer as well."""

LASTS, LONGEST, SLOWEST = 5.0, 20.0, 2.0
"""Seconds for which steps, paths and motions play, those up to which motions go in real time, and states a second at
least.
"""

DIGITS = 1e-5
"""Places of symbols are rounded to this share of the size."""

ALONG = 0.9
"""Share of gravity along an axis from which on that is downwards in the view."""

DRAWN = ("moment", "twist", "curvature", "tension", "shear", "stress")
"""Quantities along members by which a page colours them."""


@dataclass(frozen=True, eq=False)
class _State:
    """A state that a page shows, what is said of where it is, and what the JSON answer tells of it."""

    text: str
    step: Configuration
    told: dict[str, Any]
    branch: int = 0
    kind: str = ""
    stable: bool | str | None = None
    omega: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Numbers:
    """Packs arrays of numbers in one precision."""

    bits: int

    def packed(self, values: Any) -> str:
        """An array as text."""
        return base64.b64encode(np.ascontiguousarray(values, f"<f{self.bits // 8}").tobytes()).decode()


def content_of(answer: Shown, source: str = "", said: str = "", *, most: int = MOST_STATES) -> dict[str, Any]:
    """All that the viewer needs, as tables, lists, texts and numbers that JSON has.

    Parameters
    ----------
    answer : Solution, Path, Trajectory or Modes
    source : str
        The text of the scene file.
    said : str
        What is said of the answer in short.
    most : int
        States of a path or a motion at most, besides critical points and factors that were asked for.

    Raises
    ------
    SceneError
        The scene has no member that could be seen.
    """
    scene = answer.scene
    states = list(_states_of(answer, min(most, _room_for(answer))))
    if not scene.members:
        raise SceneError("members: found none, accepted: at least one member that a page can show")
    space = states[-1].step.model.space
    quantities = {
        key: QUANTITIES[key]
        for key in DRAWN
        if (space or key != "twist") and (key != "stress" or any(outlined(scene, m) for m in scene.members.values()))
    }
    places = _places(states, len(quantities))
    count = sum(map(len, places.values())) * len(states) * (3 + len(quantities))
    numbers = _Numbers(64 if count <= EXACT_NUMBERS else 32)
    fields = [{name: state.step.along(name, x) for name, x in places.items()} for state in states]
    lines = [[found["position"] for found in one.values()] for one in fields]
    rest = [scene.center_lines[name].positions(x) for name, x in places.items()]
    shapes = _Shapes(answer, places, lines[0]) if isinstance(answer, Modes) else None
    everything = np.vstack([*rest, *(line for one in lines for line in one), *(shapes.farthest if shapes else ())])
    view = _upright(scene.gravity, everything) if space else view_of(space, [everything])
    symbols = _Symbols(states, lines, rest, view, isinstance(answer, Trajectory))
    found: dict[str, Any] = {
        "title": scene.title,
        "kind": scene.analysis.type,
        "status": answer.status.value,
        "plane": not space,
        "all": scene.analysis.equilibria == "all",
        "bits": numbers.bits,
        "view": {"right": view.right.tolist(), "up": view.up.tolist()},
        "seconds": _seconds(answer, states),
        "gravity": plain(scene.gravity) if scene.gravity and any(scene.gravity) else None,
        "members": [
            {"name": name, "type": scene.members[name].type, "nodes": list(scene.members[name].nodes), "x": x.tolist()}
            for name, x in places.items()
        ],
        "quantities": [
            {"key": key, "label": one.label(space), "unit": one.unit, "signed": one.diverging(space)}
            for key, one in quantities.items()
        ],
        "rest": numbers.packed(np.vstack(rest)),
        "states": [],
        "modes": [] if shapes is None else shapes.packed(numbers),
        "symbols": symbols.known,
        "inks": {"load": LOAD, "reaction": REACTION, "motion": MOTION},
        "report": said,
        "scene": source,
    }
    for number, state in enumerate(states):
        entry = {
            "text": state.text,
            "at": state.step.factor,
            "branch": state.branch,
            "kind": state.kind,
            "stable": state.stable,
            **({"omega": state.omega} if state.omega else {}),
            "lines": numbers.packed(np.vstack(lines[number])),
            "values": _values(state.step, quantities, fields[number], places, numbers),
            "told": state.told,
            **symbols.of(number),
        }
        found["states"].append(entry)
    return found


def _upright(gravity: Sequence[float] | None, points: Array) -> View:
    """The view in space that shows points (n, 3) well; gravity is downwards where it is nearly along an axis."""
    pull = np.zeros(3) if gravity is None else np.asarray(gravity, float)
    down = int(np.abs(pull).argmax())
    if abs(pull[down]) <= ALONG * np.linalg.norm(pull) or (down == 2 and pull[2] < 0.0):
        return view_of(True, [points])
    # Axes whose third is upwards.
    up, first = -np.sign(pull[down]) * np.eye(3)[down], np.eye(3)[(down + 1) % 3]
    axes = np.stack([first, np.cross(up, first), up])
    view = view_of(True, [points @ axes.T])
    return replace(view, right=view.right @ axes, up=view.up @ axes)


# -- states ------------------------------------------------------------------------------------------------------------


def _room_for(answer: Shown) -> int:
    """How many states of a path or a motion there is room for."""
    scene = answer.scene
    each = len(scene.members) * FEWEST * (3 + len(DRAWN)) + len(answer.last.model.nodes) * TOLD_LENGTH
    return int(np.clip(MOST_NUMBERS // max(each, 1), min(FEWEST_STATES, MOST_STATES), MOST_STATES))


def _states_of(answer: Shown, most: int) -> Iterator[_State]:
    """The states of an answer, in the order in which they are played."""
    if isinstance(answer, Path):
        yield from _along_path(answer, most)
    elif isinstance(answer, Trajectory):
        yield from _in_time(answer, most)
    elif isinstance(answer, Modes):
        yield _State("equilibrium", answer.last, _without_courses(answer.last.to_dict()))
    else:
        steps = answer.steps
        for number, step in enumerate(steps, 1):
            same = sum(other.factor == step.factor for other in steps)
            own = sum(other.factor == step.factor for other in steps[:number])
            which = f", equilibrium {own} of {same}" if same > 1 else ""
            stable = step.certificate.stable
            told = _without_courses(step.to_dict())
            yield _State(f"factor {in_short(step.factor)}{which}", step, told, stable=stable)


def _along_path(path: Path, most: int) -> Iterator[_State]:
    """Points of a path and its branches, and the equilibria that were asked for."""
    every = [(number, point) for number, branch in enumerate(path.branches) for point in branch.points]
    thinned = set(np.unique(np.linspace(0, len(every) - 1, min(most, len(every))).round().astype(int)).tolist())
    entries = {
        (number, kind): iter(getattr(branch, f"{kind.replace(' ', '_')}s"))
        for number, branch in enumerate(path.branches)
        for kind in ("limit point", "bifurcation", "transition")
    }
    for index, (number, point) in enumerate(every):
        entry = next(entries.get((number, point.kind), iter(())), None)
        if index not in thinned and not point.kind:
            continue
        where = f"branch {number}, " if number else ""
        step: Configuration = path.configuration(point)
        told = _without_courses(entry.to_dict()) if entry is not None else _told(step, "reactions")
        text = f"{where}factor {in_short(point.factor)}{', ' if point.kind else ''}{point.kind}"
        omega = () if point.omega is None else tuple(point.omega.tolist())
        yield _State(text, step, told, number, point.kind, point.stable, omega)
    for number, branch in enumerate(path.branches):
        where = f"branch {number}, " if number else ""
        for kind, entries_of in (("flutter point", branch.flutter_points), ("step", branch.steps)):
            for one in entries_of:
                text = f"{where}factor {in_short(one.factor)}, {'as asked for' if kind == 'step' else kind}"
                known = branch.points[0].omega
                omega = (one.omega,) * len(known) if isinstance(one, FlutterPoint) and known is not None else ()
                yield _State(text, one, _without_courses(one.to_dict()), number, kind, one.certificate.stable, omega)


def _in_time(motion: Trajectory, most: int) -> Iterator[_State]:
    """States of a motion: its answers, and others so that it plays evenly."""
    own = motion.times
    answers = own[np.unique(np.linspace(0, len(own) - 1, min(most, len(own))).round().astype(int))]
    if motion.record is None or len(own) < 2:
        steps = [step for step in motion.steps if step.factor in set(answers.tolist())]
    else:
        times = np.union1d(answers, np.linspace(own[0], own[-1], max(most - len(answers), 2)))
        steps = list(motion.between(times))
    factor, letter = prefix(float(own[-1]), 0.1)
    known = set(own.tolist())
    for step in steps:
        told = plain(step.to_dict()) if step.time in known else _told(step)
        yield _State(
            f"time {step.time / factor:.4g} {letter}s", step, told, kind="answer" if step.time in known else ""
        )


def _told(step: Configuration, *more: str) -> dict[str, Any]:
    """What a page tells of a state that is no entry of the JSON answer, under the same keys."""
    return {"factor": step.factor, **plain(step.tables("nodes", *more))}


def _without_courses(entry: dict[str, Any]) -> dict[str, Any]:
    """An entry of the JSON answer without what is told along members, which has its own place on a page."""
    found = dict(entry)
    for kind in ("members", "tubes"):
        if kind in found:
            found[kind] = {
                name: {key: value for key, value in table.items() if not isinstance(value, list)}
                for name, table in found[kind].items()
            }
    return plain(found)


def _seconds(answer: Shown, states: Sequence[_State]) -> float:
    """How long all states are played: a motion in real time where that can be seen, all else for some seconds."""
    span = states[-1].step.factor - states[0].step.factor if isinstance(answer, Trajectory) else 0.0
    return span if 1.0 <= span <= LONGEST else min(LASTS, len(states) / SLOWEST)


# -- along members -----------------------------------------------------------------------------------------------------


def _places(states: Sequence[_State], quantities: int) -> dict[str, Array]:
    """Fractions of the length of each member at which it is shown, the same in all states."""
    scene, looked_at = states[-1].step.model.scene, states[:: max(1, len(states) // LOOKED_AT)]
    wanted = {}
    for name, member in scene.members.items():
        straight = member.type == "rigid" and scene.center_lines[name].turning == 0.0
        turning = 0.0 if straight else max(turning_of(state.step, name) for state in (*looked_at, states[-1]))
        wanted[name] = 2 if straight else int(np.clip(1 + math.ceil(turning / TURNING), SMOOTH, MOST_PLACES))
    room = MOST_NUMBERS / (len(states) * (3 + quantities) * max(sum(wanted.values()), 1))
    found = {}
    for name, count in wanted.items():
        few = min(count, max(FEWEST, int(room * count)))
        x = np.linspace(0.0, 1.0, few)
        if len(states) <= LISTED and room >= 2.0:
            x = np.union1d(x, states[-1].step.places(name))
        found[name] = x
    return found


def _values(
    step: Configuration,
    quantities: Mapping[str, ColourQuantity],
    fields: Mapping[str, Mapping[str, Array]],
    places: Mapping[str, Array],
    numbers: _Numbers,
) -> dict[str, str | None]:
    """Values along all members, of each quantity; None where all are rounding."""
    found: dict[str, str | None] = {}
    for key, quantity in quantities.items():
        values = quantity.of(step, fields, places)
        found[key] = numbers.packed(np.concatenate(values)) if values else None
    return found


class _Shapes:
    """Mode shapes along members, so large that they are well seen."""

    def __init__(self, modes: Modes, places: Mapping[str, Array], base: Sequence[Array]) -> None:
        self._modes, self._base = modes, base
        size = float(np.linalg.norm(np.ptp(np.vstack(base), axis=0)))
        self._shapes, self._scales = list[list[Array]](), list[float]()
        for number in range(len(modes.modes)):
            found = [modes.along(number, name, x) for name, x in places.items()]
            moved, turned = (
                max(float(np.abs(own[key]).max(initial=0.0)) for own in found) for key in ("position", "rotation")
            )
            # What only twists moves by rounding.
            scale = REACH * size / moved if moved > TWISTING * turned * size else 0.0
            self._scales.append(scale)
            self._shapes.append([scale * np.asarray(own["position"], complex) for own in found])
        self.farthest = [
            line + sign * moved.real
            for shape in self._shapes
            for line, moved in zip(base, shape, strict=True)
            for sign in (1.0, -1.0)
        ]

    def packed(self, numbers: _Numbers) -> list[dict[str, Any]]:
        """A table for each mode."""
        found = []
        for number, (mode, shape) in enumerate(zip(self._modes.modes, self._shapes, strict=True), 1):
            damping = f", damping ratio {mode.damping:.3g}" if mode.damping else ""
            scale = self._scales[number - 1]
            damping += "" if scale else ", only twists"
            lines = np.vstack(shape)
            entry = {
                "text": f"mode {number}: {mode.omega:.6g} rad/s, {mode.omega / (2.0 * math.pi):.6g} Hz{damping}",
                "scale": scale,
                "real": numbers.packed(lines.real),
                "imaginary": numbers.packed(lines.imag) if np.any(lines.imag) else None,
                "told": {"omega": mode.omega, "damping": mode.damping, "mass": float(mode.mass)},
            }
            found.append(entry)
        return found


# -- symbols -----------------------------------------------------------------------------------------------------------


class _Symbols:
    """Supports, joints, obstacles, loads and reactions of all states, each symbol once."""

    def __init__(
        self,
        states: Sequence[_State],
        lines: Sequence[Sequence[Array]],
        rest: Sequence[Array],
        view: View,
        moving: bool,
    ) -> None:
        self.known: list[dict[str, Any]] = []
        self._numbers: dict[Any, int] = {}
        self._moving = moving
        scene = states[-1].step.model.scene
        extent = float(np.ptp(np.vstack([*rest, *(line for one in lines for line in one)]), axis=0).max())
        self._unit, letter = prefix(extent, 0.2)
        drawn = [[line / self._unit for line in one] for one in lines]
        still = [line / self._unit for line in rest]
        course = Course(self._unit, letter, tuple(scene.members), still, drawn[-1], drawn, [])
        self._sketches = [
            Sketch(scene, state.step, replace(course, last=own), view) for state, own in zip(states, drawn, strict=True)
        ]
        self._first = replace(self._sketches[0], marks=[], labels=[])
        sketch_supports(self._first)
        # One frame shows all states, in which arrows keep their sides.
        for sketch in self._sketches:
            sketch.size, sketch.sides = self._first.size, self._first.sides
        if not moving:
            # Arrows of all states have one scale.
            largest = max(sketch.largest_force for sketch in self._sketches)
            for sketch in self._sketches:
                sketch.largest_force = largest

    def of(self, number: int) -> dict[str, Any]:
        """Numbers of the symbols of a state, and its labels."""
        sketch = self._sketches[number]
        sketch_carried(sketch, self._first)
        holding = len(sketch.marks)
        if not self._moving:
            sketch_loads(sketch)
        size = sketch.size * self._unit
        labels = [
            {
                "at": self._rounded(label.anchor, size),
                "away": np.asarray(label.away, float).round(3).tolist(),
                "text": label.text,
                "colour": label.colour,
            }
            for label in sketch.labels
        ]
        numbers = [self._number(mark, size, acts=i >= holding) for i, mark in enumerate(sketch.marks)]
        return {"symbols": numbers, "labels": labels}

    def _carriers(self, name: str) -> list[str | None]:
        """Nodes that carry a symbol, with None for the ground; nothing for what goes with the members beside it."""
        kind, _, record = name.partition("-")
        if kind == "support":
            return [record]
        springs = self._first.scene.springs
        if kind == "spring" and record in springs and springs[record].type != "rotational":
            return [springs[record].node, springs[record].to]
        return []

    def _rounded(self, points: Array, size: float) -> list[float | None]:
        """Places (n, 3) in drawn units as a list in metres, with None for what is not a number."""
        grid = DIGITS * size
        values = np.round(np.asarray(points, float).ravel() * self._unit / grid) * grid
        return [float(f"{value:.7g}") if math.isfinite(value) else None for value in values.tolist()]

    def _number(self, mark: Any, size: float, *, acts: bool) -> int:
        points, stands = self._rounded(mark.points, size), mark.name.startswith(STANDING)
        carriers = [] if acts else self._carriers(mark.name)
        key = (
            *(mark.kind, stands, acts, *carriers),
            mark.colour,
            mark.fill,
            mark.width,
            mark.dotted,
            tuple(points),
        )
        if key not in self._numbers:
            self._numbers[key] = len(self.known)
            entry = {
                "kind": mark.kind,
                "points": points,
                "colour": mark.colour,
                "width": mark.width,
                "level": mark.level,
            }
            entry |= {"fill": mark.fill} if mark.kind in ("area", "dot") else {}
            entry |= {"dotted": True} if mark.dotted else {}
            entry |= {"stands": True} if stands else {}
            entry |= {"acts": True} if acts else {}
            entry |= {"carriers": carriers} if carriers else {}
            entry |= {"obstacle": True} if mark.name.startswith("contact-") else {}
            self.known.append(entry)
        return self._numbers[key]
