"""Answers of path analyses: equilibria over the load factor, critical points, branches and frequencies."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ..description.records import counted, enumerated
from ..description.showing import error_in_words, few, first_lines, notes_in_words, shown, stability_in_words
from ..equilibria.solution import Configuration, Equilibrium, Viewed, heading, heading_in_words
from ..errors import Status
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..solvers.prepared import Prepared

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..pictures.animation import Animation

__all__ = ["FLUTTER", "NO_POTENTIAL", "Branch", "FlutterPoint", "Path", "PathPoint", "TransitionPoint", "ending"]

NO_POTENTIAL = (
    "loads without potential: no energy tells what is stable; limit points and bifurcations are where the static "
    "tangent is singular (divergence), and flutter would only show with the key 'modes'"
)
"""A note on what limit points and bifurcations mean for loads without potential."""

FLUTTER = (
    "loads without potential: no energy tells what is stable; limit points and bifurcations are where the static "
    "tangent is singular (divergence), flutter points where one of the modes asked for starts to grow"
)
"""A note as :data:`NO_POTENTIAL` where modes are asked for, which find flutter points."""


@dataclass(frozen=True, eq=False)
class FlutterPoint(Equilibrium):
    """An equilibrium at which a motion starts to grow while it oscillates; without damping two frequencies coincide
    there.

    Attributes
    ----------
    omega : float
        Angular frequency of that motion, rad/s.
    """

    omega: float = field(kw_only=True)

    def __repr__(self) -> str:
        head = [f"factor={self.factor:.9g}", f"omega={self.omega:.9g} rad/s", self.certificate.in_words]
        return shown(self, head, self.lines())

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """As :meth:`.Equilibrium.table`; the table of the whole state also has the frequency ``omega``."""
        found = super().table(kind, name)
        return found if kind else {**found, "omega": self.omega}

    def to_dict(self) -> dict[str, Any]:
        """As an entry of ``flutter_points`` in the JSON answer."""
        return {**super().to_dict(), "omega": self.omega}


@dataclass(frozen=True, eq=False)
class TransitionPoint(Equilibrium):
    """An equilibrium at which strings go slack or become taut, stops are reached or left, or members touch, leave,
    stick or slide: the path has a corner.

    Attributes
    ----------
    changes : tuple of str
        What happens along the path, as ``tendons.cable goes slack``.
    turns : bool
        Whether the factor turns there, as at a limit point.
    """

    changes: tuple[str, ...] = field(kw_only=True)
    turns: bool = field(kw_only=True)

    def __repr__(self) -> str:
        head = [f"factor={self.factor:.9g}", enumerated(self.changes), self.certificate.in_words]
        return shown(self, head, self.lines())

    def to_dict(self) -> dict[str, Any]:
        """As an entry of ``transitions`` in the JSON answer."""
        return {**super().to_dict(), "changes": list(self.changes), "turns": self.turns}


@dataclass(frozen=True, eq=False)
class PathPoint:
    """One equilibrium of a path.

    Attributes
    ----------
    factor : float
        Factor of the loads and prescribed motions.
    state, loading
        Unknowns and loads, dimensionless.
    negative : int
        Number of negative eigenvalues of the tangent stiffness on the constraints.
    stable : bool, "neutral", or "not defined" for loads without potential
    arc : float
        Arc length from the start, see :class:`Path`.
    kind : str
        ``""``, ``"limit point"``, ``"bifurcation"`` or ``"transition"``, after which comes the same point again with
        what is taut or at a stop from there on.
    prepared : Prepared, optional
        Its own model where that differs from the one of the path: in contact elements end at the contacts, tendons that
        are slack and stops that are reached make other equations, and with memory it knows what the points before have
        left.
    omega, growth : ndarray (modes,), optional
        Where modes are asked for: angular frequencies, rad/s, and growth rates, 1/s, of the lowest motions.  Those that
        leave the equilibrium without oscillating come first, with frequency zero; a negative rate means decay.
    """

    factor: float
    state: State = field(repr=False)
    loading: Loading = field(repr=False)
    negative: int
    stable: bool | str
    arc: float
    kind: str = ""
    prepared: Prepared | None = field(repr=False, default=None)
    omega: Array | None = field(repr=False, default=None)
    growth: Array | None = field(repr=False, default=None)

    def __repr__(self) -> str:
        stable = self.kind or stability_in_words(self.stable, self.negative)
        return shown(self, [f"factor={self.factor:.9g}", stable, f"arc {self.arc:.6g}"])


@dataclass(frozen=True, eq=False)
class Branch:
    """A connected sequence of equilibria: the path itself, or a branch that crosses it at a bifurcation.

    Attributes
    ----------
    points : tuple of PathPoint
        Limit and bifurcation points among them.
    steps, limit_points, bifurcations : tuple of Equilibrium
        Crossings of the factors asked for, and the points of these kinds, in the order in which they are met.
    end : str
        Why it ends, a sentence.
    bifurcation, side : int
        The bifurcation of the path from which it starts (1 is the first, 0: it is the path itself), and its side, 1 or
        -1.
    flutter_points : tuple of FlutterPoint
        Where modes are asked for: points beyond which one more motion grows while it oscillates.
    transitions : tuple of TransitionPoint
        Where tendons go slack or become taut, and where stops of springs are reached or left.
    """

    points: tuple[PathPoint, ...] = field(repr=False)
    steps: tuple[Equilibrium, ...]
    limit_points: tuple[Equilibrium, ...]
    bifurcations: tuple[Equilibrium, ...]
    end: str
    bifurcation: int = 0
    side: int = 0
    flutter_points: tuple[FlutterPoint, ...] = ()
    transitions: tuple[TransitionPoint, ...] = ()

    def __repr__(self) -> str:
        return shown(self, [self.name, counted(len(self.points), "point")], self.lines())

    @property
    def name(self) -> str:
        """``path``, or from which bifurcation it starts and to which side."""
        return f"branch at bifurcation {self.bifurcation}, side {self.side:+d}" if self.side else "path"

    def lines(self) -> list[str]:
        """Range, critical points and end in words."""
        lines = [f"factors {self.factors.min():.6g} to {self.factors.max():.6g}; {self.end}"]
        for kind in ("limit_points", "bifurcations", "flutter_points"):
            factors = [f"{entry.factor:.9g}" for entry in getattr(self, kind)]
            if factors:
                number = counted(len(factors), kind.replace("_", " ")[:-1])
                lines.append(f"{number}: factor {few(factors)}")
        told = [f"{enumerated(entry.changes)} at factor {entry.factor:.9g}" for entry in self.transitions]
        return [*lines, few(told)] if told else lines

    @property
    def factors(self) -> Array:
        """Load factors of the points, (points,), dimensionless."""
        return np.array([point.factor for point in self.points])

    def stretches(self) -> list[tuple[bool | str, int, int]]:
        """Sections of equal stability: what ``stable`` is there, index of the first and of the last point."""
        found: list[tuple[bool | str, int, int]] = []
        for i, point in enumerate(self.points):
            if point.kind and i and found:
                # What vanishes at the point itself says nothing of either side.
                found[-1] = (found[-1][0], found[-1][1], i)
            elif found and found[-1][0] == point.stable:
                found[-1] = (point.stable, found[-1][1], i)
            else:
                found.append((point.stable, found[-1][2] if found else i, i))
        return found


@dataclass(frozen=True, eq=False)
class Path(Viewed):
    """The answer of a scene whose analysis is a path.

    Attributes
    ----------
    status : Status
        SOLVED, SHORT where an accuracy that was asked for is not reached, or CUT where Newton's method could not
        follow the path to the end of its range.
    branches : tuple of Branch
        The path itself, then those that were followed from its bifurcations.
    prepared : Prepared
        Discretisation of the points.
    unit : float
        Change of the factor that counts as much as 1 rad in arc lengths, which are root mean squares of rotations, rad,
        and of the factor over this unit.
    error_estimate : float
        Largest estimated error along the path: of positions over the size of the scene, of the factors of limit
        points and bifurcations, of frequencies and of the factors of flutter points relative to themselves.
    last : Equilibrium
        The equilibrium at the last point of the path.
    notes : tuple of str
    seconds : mapping
        Wall time of assembling and of solving, s.
    massive : Prepared, optional
        Discretisation for the modes, where these are asked for.
    """

    scene: Any = field(repr=False)
    status: Status
    prepared: Prepared = field(repr=False)
    branches: tuple[Branch, ...]
    unit: float
    error_estimate: float | None
    last: Equilibrium
    notes: tuple[str, ...]
    seconds: Mapping[str, float]
    massive: Prepared | None = field(repr=False, default=None)

    def __repr__(self) -> str:
        branches = first_lines(self.branches[1:], lambda branch: f"{branch.name}: {'; '.join(branch.lines())}")
        return shown(
            self,
            [*heading_in_words(self, self.model), counted(len(self.points), "point")],
            [*self.main.lines(), *branches, error_in_words(self.error_estimate), *notes_in_words(self.notes)],
        )

    @property
    def model(self) -> Model:
        """The model that the points belong to; with contact the last one."""
        return self.prepared.model

    @property
    def main(self) -> Branch:
        """The path itself, without the branches."""
        return self.branches[0]

    @property
    def points(self) -> tuple[PathPoint, ...]:
        """The points of the path itself."""
        return self.main.points

    @property
    def steps(self) -> tuple[Equilibrium, ...]:
        """Equilibria where the path, then its branches, cross the factors of ``analysis.steps``."""
        return tuple(entry for branch in self.branches for entry in branch.steps)

    @property
    def limit_points(self) -> tuple[Equilibrium, ...]:
        """Limit points of the path, then of the branches."""
        return tuple(entry for branch in self.branches for entry in branch.limit_points)

    @property
    def bifurcations(self) -> tuple[Equilibrium, ...]:
        """Bifurcation points of the path, then of the branches."""
        return tuple(entry for branch in self.branches for entry in branch.bifurcations)

    @property
    def flutter_points(self) -> tuple[FlutterPoint, ...]:
        """Flutter points of the path, then of the branches."""
        return tuple(entry for branch in self.branches for entry in branch.flutter_points)

    @property
    def transitions(self) -> tuple[TransitionPoint, ...]:
        """Transitions of the path, then of the branches."""
        return tuple(entry for branch in self.branches for entry in branch.transitions)

    def fields(self, point: PathPoint) -> Fields:
        """Positions, forces and moments at a point of the path or a branch, by name."""
        return Fields((point.prepared or self.prepared).equations, point.state, point.loading)

    def configuration(self, point: PathPoint) -> Configuration:
        """The state at a point with positions, forces and reactions by name: an equilibrium without a certificate."""
        fields = self.fields(point)
        return Configuration(point.factor, fields)

    def positions(self, node: str, branch: int = 0) -> Array:
        """Positions of a node along the path or a branch, (points, 3) m."""
        return np.array([self.fields(point).position(node) for point in self.branches[branch].points])

    def plot(self, quantity: str | None = None, *, quantities: Sequence[str] | None = None) -> Figure:
        """The course of the path beside shapes along it, see :func:`~sfetcas.pictures.charts.chart`."""
        from ..pictures.charts import chart

        return chart(self, quantity, quantities=quantities)

    def animate(self, file: str | os.PathLike[str] | None = None, *, colour: str = "none") -> Animation | File:
        """A moving picture of the shapes along the path, then along its branches, see ``animation.animation``.

        The path of the ``file`` where one is given, ``.gif`` or ``.mp4``; else what notebooks show.
        """
        from ..pictures.animation import animated

        return animated(self, file, colour=colour)

    def to_dict(self) -> dict[str, Any]:
        """The JSON answer as nested dictionaries."""
        answer: dict[str, Any] = {**heading(self, self.model), "path": self._arrays(self.main)}
        for kind in ("steps", "limit_points", "bifurcations", "flutter_points", "transitions"):
            entries = [
                {**entry.to_dict(), "branch": i}
                for i, branch in enumerate(self.branches)
                for entry in getattr(branch, kind)
            ]
            answer[kind] = entries
        answer["branches"] = [
            {"bifurcation": branch.bifurcation, "side": branch.side, "path": self._arrays(branch)}
            for branch in self.branches[1:]
        ]
        return {**answer, "error_estimate": self.error_estimate, "notes": list(self.notes)}

    def _arrays(self, branch: Branch) -> dict[str, Any]:
        """Arrays over the points."""
        model, points = self.model, branch.points
        fields = [self.fields(point) for point in points]
        nodes: dict[str, Any] = {}
        for name in model.nodes:
            nodes[name] = {"position": [here.position(name).tolist() for here in fields]}
            if model.rotations.node_turn[name] is not None:
                key = "quaternion" if model.space else "angle"
                turned = [here.rotation(name) for here in fields]
                nodes[name][key] = [t.tolist() if model.space else float(t[0]) for t in turned if t is not None]
        # What points have beside their states.
        moving: dict[str, Any] = {}
        for key in ("omega", "growth"):
            courses = [getattr(point, key) for point in points]
            moving |= {key: [course.tolist() for course in courses]} if self.massive is not None else {}
        if self.scene.remembers:
            moving["dissipated"] = [sum(here.dissipated.values()) for here in fields]
        return {
            "factor": branch.factors.tolist(),
            "nodes": nodes,
            "stable": [point.stable for point in points],
            "negative": [point.negative for point in points],
            "arc": [float(point.arc) for point in points],
            "kind": [point.kind for point in points],
            **moving,
            "end": branch.end,
        }


def ending(end: str, factor: float, count: int, message: str) -> str:
    """A sentence on why a branch of ``count`` points ends at a factor; ``message``: what is beyond its limits there."""
    return {
        "range": f"the factor leaves the range at {factor:g}",
        "points": f"{count} points",
        "closed": "it closes on itself",
        "away": f"from factor {factor:.9g} on what touches slides away under the same loads",
        "lost": f"it could not be followed beyond factor {factor:.6g}",
        "margin": f"it ends at factor {factor:.6g}: {message}",
        "bent": f"beyond factor {factor:.6g} {message}",
    }[end]
