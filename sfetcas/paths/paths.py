"""Paths of equilibria of a scene, to the accuracy asked for.

The path is followed on a first mesh and again on the mesh with all elements halved: what differs between their
limit points, bifurcations, crossings and samples is the estimate of the error, the finer path the answer; where the
error is too large, the elements are halved again.  All elements are halved alike: an unsymmetric mesh would tear the
bifurcations of a symmetric structure apart.
"""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.records import enumerated
from ..description.remembering import refuse_memory
from ..description.scene import Scene
from ..equilibria.settings import Settings, settings_with
from ..equilibria.solution import Equilibrium, equilibrium, touched_notes
from ..equilibria.statics import pilot_of, solve
from ..errors import SceneError, SolveError, Status
from ..mathematics.threads import single_threaded
from ..mechanics.accuracy import largest_difference
from ..mechanics.displacements import Displacements
from ..mechanics.fields import Fields
from ..mechanics.law_limits import first_beyond_laws
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model, assemble
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.beginning import check_slack
from ..solvers.critical import Event, at_factors, shapes_at
from ..solvers.prepared import Prepared
from ..solvers.redundancy import with_sharing
from ..solvers.residuals import relative_residual
from ..solvers.tracing import full_shape, passes, switched
from .conditions import Choice, Conditions, Stopping
from .memory_path import HILL, MISSING, chosen_of, left_along, refined_by_fronts, sampled_again, steps_of
from .path import NO_POTENTIAL, Branch, Path, PathPoint, TransitionPoint, ending
from .switching import Choices, First, Followed, Transition
from .touching import Touching
from .vibrations import shaken, with_modes

__all__ = ["buckling_mode", "follow_path", "switch"]

LEVELS = 10
"""Most halvings of the first mesh."""

MARGIN = 16.0
"""A halving gains this many times less than its order p promises, as far as estimates go, and no more than 2^p."""

STEADY = 0.3
"""Share of the factor in the tangent from which on a point may be compared at its factor."""

HOPED = 4.0
"""Times more than that is hoped for when meshes are skipped."""

PATIENCE = 5
"""After so many halvings one that does not halve the error is the last."""

LOW = 4
"""Order of elements that is relied on in contact."""

FEW_ELEMENTS = 16
"""A first mesh of so many elements costs less than to look whether fewer would do."""

AFFORDED = 20_000
"""Points times unknowns of a mesh after which one that did not halve the error is the last; once it was about 3 s."""

DEARER = 10
"""Times more that a point takes along lines."""

MOST_ELEMENTS = 3000
"""A mesh that the library chooses does not grow beyond this."""

SAMPLES = 8
"""Points of a stretch that are compared between two meshes, beside those that were asked for."""

WATCHED = 30
"""Points of a stretch at which fronts between elastic and inelastic parts are looked at, where laws have memory."""

EVALUATIONS = 500.0
"""About as often the equations are evaluated along a path."""

LYING = "limit points are located along obstacles on which members lie; bifurcations there are not looked for"
"""A note."""

RUBS = (
    "with friction: each point remembers what has slipped before it; limit points are located, bifurcations are not "
    "looked for"
)
"""A note."""

LEAST_WAY = 1e-3
"""A path that ends before this share of its range is none."""


@single_threaded
def follow_path(scene: Scene, settings: Settings | None = None, **changes: Any) -> Path:
    """Path analysis: the equilibria of a scene over its load factor.

    Parameters
    ----------
    scene : Scene
    settings : Settings, optional
        Further keywords replace single settings.

    Raises
    ------
    SceneError
        The scene cannot be modelled, or its analysis is no path.
    SolveError
        There is no equilibrium to start from, or none next to it.
    """
    if scene.analysis.type != "path":
        raise SceneError(f"found {scene.analysis.type!r}, accepted: 'path' to follow one", ("analysis", "type"))
    settings = settings_with(settings, changes)
    path = PathTracing(scene, settings).path()
    return with_modes(path, settings) if scene.analysis.count_of_modes else path


@single_threaded
def switch(path: Path, bifurcation: int = 1, side: int = 1, *, shape: int = 1, points: int | None = None) -> Branch:
    """The branch that crosses the path at one of its bifurcations, followed to one side on the mesh of the path.

    Parameters
    ----------
    path : Path
    bifurcation : int
        Number of the bifurcation on the path itself, 1 is the first.
    side : int
        Direction along the eigenvector, 1 or -1.
    shape : int
        Number of the eigenvector, from 1, where several eigenvalues vanish at once.
    points : int, optional
        Largest number of points; ``analysis.points`` by default.

    Raises
    ------
    SceneError
        There is no such bifurcation, side or shape, or the law of a section has memory.
    SolveError
        No branch was found there.
    """
    if isinstance(path, Path):
        refuse_memory(path.scene, "no branch of a path is followed, accepted: laws without memory")
    if side not in (1, -1):
        raise SceneError(f"side: found {side}, accepted: 1 or -1")
    curve, event = _bifurcation_of(path, bifurcation, shape)
    run = PathTracing(path.scene, Settings())
    choices = run.choices(curve.model.mesh, path.unit)
    found = run.branch(choices, curve, event, side, shape, points or path.scene.analysis.points)
    if found is None:
        raise SolveError(Status.FAILED, f"no branch found at bifurcation {bifurcation}")
    branch = run.answered(path.prepared, run.stretch(_Stretch(found, bifurcation, side), choices), {})
    return branch if path.massive is None else shaken(path, branch)


@single_threaded
def buckling_mode(path: Path, bifurcation: int = 1, *, shape: int = 1) -> Displacements:
    """The mode in which the structure buckles at a bifurcation of a path; its size is arbitrary.

    Parameters
    ----------
    path : Path
    bifurcation : int
        Number of the bifurcation on the path itself, 1 is the first.
    shape : int
        Number of the eigenvector, from 1, where several eigenvalues vanish at once.

    Raises
    ------
    SceneError
        There is no such bifurcation or shape.
    """
    curve, event = _bifurcation_of(path, bifurcation, shape)
    here = event.standing
    change = full_shape(curve, here, shapes_at(curve, event)[:, shape - 1]).z[: curve.equations.unknowns]
    return Displacements(curve.equations, here.state, here.loading, change)


def _bifurcation_of(path: Path, bifurcation: int, shape: int) -> tuple[Curve, Event]:
    """A bifurcation of a path by its number, from 1, which has a shape of this number."""
    if not isinstance(path, Path):
        accepted = "the answer of a scene whose analysis is a path, whole and not a branch of it"
        raise SceneError(f"path: found a {type(path).__name__}, accepted: {accepted}")
    count = len(path.main.bifurcations)
    if count == 0:
        raise SceneError("bifurcation: the path has none, accepted: a path with bifurcations")
    if not 1 <= bifurcation <= count:
        raise SceneError(f"bifurcation: found {bifurcation}, accepted: 1 to {count}, those of the path")
    number = [i for i, point in enumerate(path.points) if point.kind == "bifurcation"][bifurcation - 1]
    curve = Curve(path.points[number].prepared or path.prepared, path.unit)
    event = _event_at(curve, path, number)
    if not 1 <= shape <= event.multiplicity:
        raise SceneError(f"shape: found {shape}, accepted: 1 to {event.multiplicity}, those that vanish there")
    return curve, event


def _event_at(curve: Curve, path: Path, number: int) -> Event:
    """The bifurcation at a point of a path, its tangent taken from both sides."""
    points, along = path.points[number - 1 : number + 2], Tangent(np.zeros(curve.equations.total), 1.0)
    before, at, after = (
        curve.on(point.prepared or path.prepared).standing(point.state, point.factor, along) for point in points
    )
    if curve.inner(before.tangent, after.tangent) < 0.0:
        after = replace(after, tangent=after.tangent.back)
    mean = Tangent(before.tangent.z + after.tangent.z, before.tangent.factor + after.tangent.factor)
    return Event("bifurcation", replace(at, tangent=curve.normed(mean)), max(1, at.inertia.zero))


@dataclass
class _Stretch:
    """What was followed from the start or a bifurcation on, and the crossings of the factors asked for."""

    traced: Followed
    bifurcation: int = 0
    side: int = 0
    crossings: list[Standing] = field(default_factory=list)

    def leads_through(self, curve: Curve, point: Standing) -> bool:
        """Whether it leads through an equilibrium on a curve."""
        kind = Choice.of(curve.model.mesh).kind
        parts = [p for p in self.traced.parts if Choice.of(p.curve.model.mesh).kind == kind and not p.lies]
        return any(passes(p.curve, p.traced, point) for p in parts)

    def of_kind(self, kind: str) -> list[Standing]:
        if kind == "transition":
            return [transition.standing for transition in self.traced.transitions]
        return [event.standing for event in self.traced.events if event.kind == kind]


@dataclass
class _Level:
    """What was followed on one mesh."""

    choices: Choices
    curve: Curve
    stretches: list[_Stretch]
    notes: tuple[str, ...]

    @property
    def effort(self) -> int:
        """Points times unknowns, to which the time that it took is about proportional."""
        parts = [part for stretch in self.stretches for part in stretch.traced.parts]
        points = sum(len(part.points) * (DEARER if part.lies else 1) for part in parts)
        return points * self.curve.equations.unknowns


def _states(level: _Level) -> Iterator[tuple[str, Fields]]:
    """All points of a path, by what a note says of where they are."""
    for point in (point for part in level.stretches for point in part.traced.points):
        yield f"at factor {point.factor:.6g}", point.fields


class PathTracing:
    """One path with its branches, on finer and finer meshes.

    Parameters
    ----------
    scene, settings
    """

    def __init__(self, scene: Scene, settings: Settings) -> None:
        self.scene, self.settings, self.analysis = scene, settings, scene.analysis
        self.span = scene.analysis.span
        self.accuracy = settings.accuracy or scene.analysis.accuracy
        members = scene.members.items()
        self.fixed = {n for n, m in members if (settings.elements or m.elements) is not None}
        self.asked = settings.accuracy is not None or "accuracy" in scene.analysis.model_fields_set or not self.fixed
        self.seconds = {"model": 0.0, "solve": 0.0}
        self.assembly: Any = settings.assembly
        self.model: Model | None = None
        self.first = Choice()
        self.base: Mesh | None = None
        self.conditions: Conditions[Any] = Stopping(scene)
        if scene.contacts:
            self.conditions = Touching(scene, self._prepared, self.accuracy, self.fixed, self._beside)
        knots = {t for h in scene.histories.values() for t in h.knots if self.span[0] < t < self.span[1]}
        self.knots = tuple(sorted(knots))
        self.points = steps_of(scene.analysis) if scene.remembers else scene.analysis.points
        self.one_sequence = scene.remembers or scene.rubs
        self.levels = 0

    # -- meshes ---------------------------------------------------------------------------------

    def path(self) -> Path:
        """The path, with its branches, on a mesh fine enough for the accuracy."""
        begin = time.perf_counter()
        mesh, last = self._first_mesh(), np.inf
        self.base = None if self.one_sequence else mesh
        coarse = self._level(mesh)
        if self.fixed == set(self.scene.members):
            errors = self._errors(coarse, self._level(self._halved(mesh)), whose=coarse)
            return self._answer(coarse, errors, begin)
        gain, stalled = self._gain(mesh), 0
        for count in range(LEVELS):
            coarse = self._with_fronts(coarse)
            fine = self._level(self._halved(coarse.choices.mesh))
            errors = {key: error / gain for key, error in self._errors(coarse, fine).items()}
            largest = max(errors.values(), default=0.0)
            stalled = stalled + 1 if not largest <= 0.5 * last or not np.isfinite(largest) else 0
            hopeless = stalled and (count >= PATIENCE or stalled * fine.effort > AFFORDED)
            if largest <= self.accuracy or hopeless or 2 * fine.choices.mesh.elements > MOST_ELEMENTS:
                break
            coarse, last = self._next(fine, gain * largest, gain), largest
        fine.notes += _disagreement(coarse, fine) if not np.isfinite(largest) else ()
        return self._answer(fine, errors, begin)

    def _with_fronts(self, level: _Level) -> _Level:
        """The level on a mesh on which fronts leave little, if it is not that already."""
        while self.scene.remembers and 2 * level.choices.mesh.elements <= MOST_ELEMENTS:
            points = [point for part in level.stretches for point in self._watched(level.curve, part)]
            mesh = refined_by_fronts(level.curve, points, self.accuracy, self.fixed)
            if mesh is None:
                break
            level = self._level(mesh)
        return level

    @staticmethod
    def _watched(curve: Curve, part: _Stretch) -> list[Standing]:
        """Points at which fronts are looked at: limit points, crossings and samples."""
        return [*part.of_kind("limit"), *part.crossings, *chosen_of(curve, part.traced, 0.0, WATCHED)]

    def _next(self, fine: _Level, error: float, gain: float) -> _Level:
        """The next level to compare with its half: the fine one, or one that is finer by as much as the error asks.

        ``error`` is that of the level before the fine one.  That of the next may be so much above the accuracy as
        a halving is sure to gain; where what is hoped for until then does not come, one more halving follows.
        """
        hoped = max(2.0, HOPED * gain)
        wanted = np.log(max(error / (self.accuracy * gain), 1.0)) / np.log(hoped) if np.isfinite(error) else 0.0
        mesh = fine.choices.mesh
        for _ in range(min(int(np.ceil(wanted - 0.25)) - 1, 3)):
            mesh = self._halved(mesh) if 4 * mesh.elements <= MOST_ELEMENTS else mesh
        return fine if mesh is fine.choices.mesh else self._level(mesh)

    def _gain(self, mesh: Mesh) -> float:
        """What the error falls by in a halving: 4^p, of which less is taken for granted, and no more where forces of
        contact are kinks.
        """
        order = min(mesh.order, LOW) if self.scene.contacts else mesh.order
        return 1.0 if self.one_sequence else max(1.0, min(4.0**order / MARGIN, 2.0**order))

    def _first_mesh(self) -> Mesh:
        """The mesh for the largest factor; where that needs many elements, for the largest that is met, or the one
        without loads where samples of the path do not ask for more: loads need not bend what they act on.
        """
        plain, graded = self._mesh((1e-9 * self._widest,)), self._mesh(self.span)
        if graded.elements <= max(2 * plain.elements, FEW_ELEMENTS):
            return graded
        choices = self.choices(plain)
        first = choices.begin()[0]
        traced = choices.follow(first, self.points)
        met = [point.factor for point in traced.points]
        graded = self._mesh((max(1.5 * min(met), self.span[0]), min(1.5 * max(met), self.span[1])))
        if graded.elements <= 2 * plain.elements or self.one_sequence:
            return graded
        left = self._sampled(choices, first.curve, traced, self.choices(self._halved(plain)))
        return plain if left <= self._gain(plain) * self.accuracy else graded

    def _mesh(self, factors: tuple[float, ...]) -> Mesh:
        """The mesh that statics begins with at the given factors."""
        steps = tuple(factor for factor in factors if factor) or (self._widest,)
        analysis = self.analysis.model_copy(update={"steps": steps})
        return pilot_of(self.scene.model_copy(update={"analysis": analysis}), self.settings)

    def choices(self, mesh: Mesh, unit: float | None = None) -> Choices:
        """The models of a mesh, with the ``unit`` of a path that is known already."""
        base = mesh if self.base is None else self.base
        sizes = [(len(cuts) - 1) / (len(base.cuts[name]) - 1) for name, cuts in mesh.cuts.items()]
        times = int(np.log2(max(sizes, default=1.0)))
        finer = functools.partial(self._halved, times=times)
        # With friction steps are halved as well.
        halvings = max(self.levels - 1, 0) if self.scene.rubs else times
        found = Choices(mesh, self._prepared, self.span, self.knots, self.conditions, base, finer, halvings)
        found.unit = unit or found.unit
        return found

    def _prepared(self, mesh: Mesh) -> Prepared:
        begin = time.perf_counter()
        self.model = assemble(self.scene, mesh, assembly=self.assembly, like=self.model)
        prepared = Prepared(self.model, kernels=self.settings.kernels, evaluations=EVALUATIONS)
        self.assembly = self.model.assembly
        _ = prepared.equations
        self.seconds["model"] += time.perf_counter() - begin
        return prepared

    def _beside(self, factor: float) -> Equilibrium:
        """The equilibrium at a factor by itself."""
        analysis = self.analysis.model_copy(update={"type": "static", "steps": (factor,)})
        return solve(self.scene.model_copy(update={"analysis": analysis}), self.settings).last

    def _halved(self, mesh: Mesh, times: int = 1) -> Mesh:
        everything = self.fixed == set(self.scene.members)
        for _ in range(times):
            marks = {n: np.full(len(c) - 1, everything or n not in self.fixed) for n, c in mesh.cuts.items()}
            mesh = mesh.refined(marks)
        return mesh

    def _level(self, mesh: Mesh) -> _Level:
        self.levels += 1
        choices = self.choices(mesh)
        first, notes = choices.begin(self.first)
        main = _Stretch(choices.follow(first, self.points, MISSING * self.accuracy))
        curve, start = first.curve, first.begins or first.standing
        way = max(abs(point.factor - start.factor) for point in main.traced.points)
        if main.traced.end == "bent" and way < LEAST_WAY * self._widest:
            assert main.traced.limit is not None
            raise SolveError(main.traced.limit.status, main.traced.limit.detail, start.state)
        if main.traced.end == "lost" and way < LEAST_WAY * self._widest:
            detail = f"the path cannot be followed beyond factor {main.traced.points[-1].factor:.3g}"
            raise SolveError(Status.FAILED, detail, start.state)
        self.first = Choice.of(curve.model.mesh)
        for part in (part for part in main.traced.parts if len(part.traced.points) > 1 and not part.lies):
            check_slack(part.curve, part.traced)
        level = _Level(choices, curve, [main], notes)
        bends = [(part.curve, e) for part in main.traced.parts for e in part.traced.events if e.kind == "bifurcation"]
        for number, (on, event) in enumerate(bends[: self.analysis.branches], start=1):
            for side in (1, -1):
                self._add_branch(level, on, event, number, side)
        level.notes += (*_beside(main.traced.near), *(() if self.scene.rubs else _lying(level.stretches)))
        level.stretches = [self.stretch(part, choices) for part in level.stretches]
        return level

    def _add_branch(self, level: _Level, curve: Curve, event: Event, number: int, side: int) -> None:
        """Follow the branch at a bifurcation to one side, unless a stretch that was followed leads along there."""
        first = switched(curve, event, shapes_at(curve, event), side)
        if first is None:
            level.notes += (f"no branch was found at bifurcation {number} to the side {side}",)
            return
        if not self._in_range(first):
            level.notes += (f"bifurcation {number} to the side {side}: the branch leaves the range at once",)
            return
        along = next((part for part in level.stretches if part.leads_through(curve, first)), None)
        if along is not None:
            which = f"branch {level.stretches.index(along)}" if along.bifurcation else "the path itself"
            level.notes += (f"bifurcation {number} to the side {side}: {which} leads along there and is listed once",)
            return
        known = [standing for part in level.stretches for standing in part.of_kind("bifurcation")]
        followed = level.choices.follow(First(curve, first), self.analysis.points)
        level.stretches.append(_Stretch(followed.without(known), number, side))

    def branch(
        self, choices: Choices, curve: Curve, event: Event, side: int, shape: int, points: int
    ) -> Followed | None:
        """The branch at a bifurcation to one side; None where Newton's method finds none within the range."""
        first = switched(curve, event, shapes_at(curve, event), side, shape)
        if first is None or not self._in_range(first):
            return None
        return choices.follow(First(curve, first), points).without([event.standing])

    def _in_range(self, standing: Standing) -> bool:
        return self.span[0] <= standing.factor <= self.span[1]

    def stretch(self, part: _Stretch, choices: Choices) -> _Stretch:
        """A traced branch with the equilibria at the factors of ``analysis.steps`` added."""
        crossings = choices.crossings(part.traced, self.analysis.steps)
        fitted = [choices.again(point, point.factor) or point for point in crossings]
        return replace(part, traced=choices.located(part.traced), crossings=fitted)

    # -- errors ---------------------------------------------------------------------------------

    def _errors(
        self, coarse: _Level, fine: _Level, *, whose: _Level | None = None
    ) -> dict[tuple[int, str, int], float]:
        """Differences between two meshes, by stretch, kind and number; infinite where they do not correspond.

        Where laws have memory also what fronts, and steps, leave on one of the two, the fine one by default.
        """
        errors: dict[tuple[int, str, int], float] = {}
        if len(coarse.stretches) != len(fine.stretches):
            errors[0, "branches", 0] = np.inf
        for i, (a, b) in enumerate(zip(coarse.stretches, fine.stretches, strict=False)):
            for kind in ("limit", "bifurcation", "transition", "step"):
                ours, theirs = (s.crossings if kind == "step" else s.of_kind(kind) for s in (a, b))
                # Where places begin to yield steps are short: paths of so many points do not end at one place.
                cut = self.one_sequence and "points" in (a.traced.end, b.traced.end)
                if len(ours) != len(theirs) and not cut:
                    errors[i, kind, -1] = np.inf
                for j, (one, other) in enumerate(zip(ours, theirs, strict=False)):
                    factor = abs(one.factor - other.factor) / max(abs(other.factor), tolerances.UNIT * self._widest)
                    errors[i, kind, j] = max(largest_difference(one.fields, other.fields), factor)
            if not self.one_sequence:
                errors[i, "samples", 0] = self._sampled(coarse.choices, coarse.curve, a.traced, fine.choices)
                continue
            chosen = chosen_of(coarse.curve, a.traced, STEADY, SAMPLES)
            met_at = functools.partial(self._met_at, fine)
            errors[i, "samples", 0] = sampled_again(chosen, a.traced, b.traced, met_at)
            if not self.scene.remembers:
                continue
            level, part = (coarse, a) if whose is coarse else (fine, b)
            left = left_along(level.curve, self._watched(level.curve, part))
            errors[i, "fronts", 0], errors[i, "missed", 0] = left(np.inf), part.traced.missed
            for kind in ("limit", "bifurcation", "step"):
                for j, point in enumerate(part.crossings if kind == "step" else part.of_kind(kind)):
                    if (i, kind, j) in errors:
                        errors[i, kind, j] = max(errors[i, kind, j], left(point.arc))
        return errors

    def _met_at(self, level: _Level, points: list[Standing], factor: float) -> list[Standing]:
        """The points at a factor along a stretch of a path of which each point remembers the one before."""
        if self.scene.rubs:
            assert level.choices.lying is not None
            return level.choices.lying.crossings(points, (factor,))
        return at_factors(level.curve, points, (factor,))

    @property
    def _widest(self) -> float:
        return max(map(abs, self.span))

    @staticmethod
    def _sampled(coarse: Choices, curve: Curve, traced: Followed, fine: Choices) -> float:
        """Largest difference of points of a coarse stretch when they are corrected on the fine mesh."""
        largest = 0.0
        for point in chosen_of(curve, traced, STEADY, SAMPLES):
            own = coarse.again(point) or point
            found = fine.again(own, own.factor)
            if found is not None:
                largest = max(largest, largest_difference(own.fields, found.fields))
        return largest

    # -- answers --------------------------------------------------------------------------------

    def _answer(self, level: _Level, errors: dict[tuple[int, str, int], float], begin: float) -> Path:
        curve, largest = level.curve, max(errors.values(), default=0.0)
        branches = []
        for i, stretch in enumerate(level.stretches):
            own = {(kind, j): error for (k, kind, j), error in errors.items() if k == i}
            stretch = replace(stretch, traced=level.choices.fitted(stretch.traced))
            branches.append(self.answered(curve.prepared, stretch, own))
        status = Status.SHORT if largest > self.accuracy and self.asked else Status.SOLVED
        # A number of points that is given is asked for.
        given = "points" in self.scene.analysis.model_fields_set
        if level.stretches[0].traced.end in ("lost", "bent", "margin", *([] if given else ["points"])):
            status = Status.CUT
        final = level.stretches[-1].traced.points[-1]
        steps = [entry for branch in branches for entry in branch.steps]
        last = steps[-1] if steps else self._entry(final, None, ())
        self.seconds["solve"] = time.perf_counter() - begin - self.seconds["model"]
        return Path(
            scene=self.scene,
            status=status,
            prepared=curve.prepared,
            branches=tuple(branches),
            unit=curve.unit,
            error_estimate=largest if np.isfinite(largest) else None,
            last=last,
            notes=(*touched_notes(self.scene), *level.notes, *first_beyond_laws(_states(level)), *self._means(curve)),
            seconds=self.seconds,
        )

    def _means(self, curve: Curve) -> tuple[str, ...]:
        """What limit points and bifurcations mean, where that is not what they usually do."""
        rubs = (RUBS,) if self.scene.rubs else () if curve.model.conservative else (NO_POTENTIAL,)
        return (*rubs, *((HILL,) if self.scene.remembers else ()))

    def answered(self, prepared: Prepared, stretch: _Stretch, errors: dict[tuple[str, int], float]) -> Branch:
        """A traced branch as a :class:`Branch`, with the estimated errors of its points, on a path of ``prepared``."""
        traced = stretch.traced
        kinds: dict[int, str] = {id(event.standing): event.kind for event in traced.events}
        kinds |= {id(transition.standing): "transition" for transition in traced.transitions}
        energy = prepared.model.conservative
        points = tuple(_point(p, kinds.get(id(p), ""), energy, prepared) for p in traced.points)

        def entries(kind: str, standings: list[Standing], notes: list[tuple[str, ...]]) -> tuple[Equilibrium, ...]:
            numbered = zip(standings, notes, strict=True)
            return tuple(self._entry(s, errors.get((kind, j)), n) for j, (s, n) in enumerate(numbered))

        crossings = stretch.crossings
        bends, limits = ([e for e in traced.events if e.kind == kind] for kind in ("bifurcation", "limit"))
        return Branch(
            points=points,
            steps=entries("step", crossings, [()] * len(crossings)),
            limit_points=entries("limit", [e.standing for e in limits], [_said(e, energy) for e in limits]),
            bifurcations=entries("bifurcation", [e.standing for e in bends], [_said(e, energy) for e in bends]),
            end=ending(traced.end, traced.points[-1].factor, traced.count, traced.message),
            bifurcation=stretch.bifurcation,
            side=stretch.side,
            transitions=tuple(
                self._transition(t, errors.get(("transition", j))) for j, t in enumerate(traced.transitions)
            ),
        )

    def _transition(self, transition: Transition, error: float | None) -> TransitionPoint:
        entry = self._entry(transition.standing, error, transition.notes)
        parts = {part.name: getattr(entry, part.name) for part in fields(entry)}
        return TransitionPoint(**parts, changes=transition.changes, turns=transition.turns)

    @staticmethod
    def _entry(at: Standing, error: float | None, notes: tuple[str, ...]) -> Equilibrium:
        state, point = with_sharing(at.equations, at.state, at.loading, at.point, tolerances.BALANCED, reactions=True)
        found = replace(at, state=state, known=point, residual=relative_residual(at.equations, point))
        finite = error if error is not None and np.isfinite(error) else None
        return equilibrium(found, found.stability, error_estimate=finite, notes=notes)


def _disagreement(coarse: _Level, fine: _Level) -> tuple[str, ...]:
    """What two meshes do not agree on, a note."""
    sizes = " and ".join(str(level.choices.mesh.elements) for level in (coarse, fine))
    counts = [len(level.stretches) - 1 for level in (coarse, fine)]
    found = [f"{counts[0]} and {counts[1]} branches"] if counts[0] != counts[1] else []
    for i, parts in enumerate(zip(coarse.stretches, fine.stretches, strict=False)):
        where = f" of branch {i}" if i else ""
        for kind in ("limit", "bifurcation", "transition"):
            name = f"{kind} points" if kind == "limit" else f"{kind}s"
            a, b = (len(part.of_kind(kind)) for part in parts)
            found += [f"{a} and {b} {name}{where}"] if a != b else []
        a, b = (len(part.crossings) for part in parts)
        found += [f"{a} and {b} crossings of the factors asked for{where}"] if a != b else []
    return (f"meshes of {sizes} elements do not agree: they have {', '.join(found)}",) if found else ()


def _lying(stretches: Sequence[_Stretch]) -> tuple[str, ...]:
    """Notes on stretches along which members lie on obstacles."""
    notes = list[str]()
    for part in (part for stretch in stretches for part in stretch.traced.parts if part.lies):
        limits = {id(event.standing) for event in part.traced.events}
        for a, b in itertools.pairwise(part.traced.points):
            ways = [point.inertia.negative for point in (a, b)]
            if a.model.conservative and ways[0] != ways[1] and not limits & {id(a), id(b)}:
                change = f"the number of unstable directions changes from {ways[0]} to {ways[1]}"
                notes.append(f"between factors {a.factor:.6g} and {b.factor:.6g} {change}")
        notes.insert(0, LYING)
    return tuple(dict.fromkeys(notes))


def _beside(near: tuple[float, ...]) -> tuple[str, ...]:
    """A note on factors beyond which a path comes near to another curve."""
    factors = list(dict.fromkeys(f"{factor:.2g}" for factor in near))
    if not factors:
        return ()
    return (
        f"beyond factor {enumerated(factors)} the path comes close to another curve and turns beside it, as that of a "
        "structure with a small imperfection does beside a bifurcation; an uneven mesh is one, too",
    )


def _point(standing: Standing, kind: str, has_energy: bool, prepared: Prepared) -> PathPoint:
    negative, zero = (standing.inertia.negative, standing.inertia.zero) if has_energy else (0, 0)
    stable: bool | str = (False if negative else "neutral" if zero else True) if has_energy else "not defined"
    kind, at = {"limit": "limit point"}.get(kind, kind), float(standing.factor)
    own = None if standing.prepared is prepared else standing.prepared
    return PathPoint(at, standing.state, standing.loading, negative, stable, standing.arc, kind, own)


def _said(event: Event, has_energy: bool) -> tuple[str, ...]:
    """What has to be known of a point where the tangent is singular."""
    notes: tuple[str, ...] = () if has_energy else (DIVERGENCE,)
    if event.multiplicity > 1:
        notes += (
            f"{event.multiplicity} eigenvalues vanish at once: branches lead off along each combination of shapes, "
            "those along the first shape alone are followed; switch(path, ..., shape=...) follows another",
        )
    return notes


DIVERGENCE = (
    "static divergence: the static tangent is singular, another equilibrium is adjacent; without a potential the "
    "structure may have become unstable before by flutter, which the key 'modes' looks for"
)
