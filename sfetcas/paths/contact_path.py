"""Paths of equilibria of a scene with obstacles, to the accuracy asked for.

The path is followed on one mesh and again on the mesh with all elements halved, as paths without obstacles are (see
:mod:`~sfetcas.paths.paths`): what differs between the limit points, crossings and samples of the two is the estimate
of the error.  Each point has a mesh of its own, as elements end where something touches.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..contact.contact_balance import refuse_unbalanced
from ..contact.contact_statics import ContactRun
from ..contact.touches import COARSE
from ..description.scene import Scene
from ..equilibria import statics
from ..equilibria.force_balance import refuse_lost_forces
from ..equilibria.meshing import Meshing
from ..equilibria.settings import Settings
from ..equilibria.single import finished
from ..equilibria.solution import Equilibrium
from ..errors import SolveError, Status
from ..mechanics.accuracy import largest_difference
from ..mechanics.mesh import Mesh
from .contact_curve import Stood
from .contact_trace import Trace, Tracer
from .path import NO_POTENTIAL, Branch, Path, PathPoint, ending

__all__ = ["MARGIN", "STEADY", "follow_in_contact"]

LEVELS, MOST_ELEMENTS = 6, 1000
"""Most halvings of the first mesh, and elements of the finest."""

MARGIN = 16.0
"""A halving gains this many times less than its order promises, as far as estimates go."""

SAMPLES = 8
"""Points that are compared between two meshes, beside those that were asked for."""

DEEP = 1e-7
"""Share of the scene's size from which on a path sees what is inside: on its coarser mesh members waver by less."""

STEADY = 0.3
"""Share of the factor in the tangent from which on a point may be compared at its factor."""

BIFURCATIONS = "in contact: limit points are located, bifurcations and branches are not looked for"
"""A note."""


def follow_in_contact(scene: Scene, settings: Settings) -> Path:
    """Path analysis of a scene with obstacles.

    Raises
    ------
    SolveError
        There is no equilibrium to start from, or none next to it.
    """
    return ContactPath(scene, settings).path()


@dataclass
class _Level:
    """What was followed on one mesh."""

    tracer: Tracer
    trace: Trace
    crossings: list[Stood]

    def of_kind(self, kind: str) -> list[Stood]:
        return self.crossings if kind == "step" else [self.trace.points[i] for i in sorted(self.trace.limits)]


class ContactPath:
    """Path analysis in contact: the path on finer and finer meshes."""

    def __init__(self, scene: Scene, settings: Settings) -> None:
        self.span, self.analysis = scene.analysis.span, scene.analysis
        # Meshes for the loads at the ends of the range.
        analysis = scene.analysis.model_copy(update={"steps": tuple(factor for factor in self.span if factor)})
        self.meshes = Meshing(scene.model_copy(update={"analysis": analysis}), settings)
        self.scene, self.settings = scene, settings
        knots = {t for h in scene.histories.values() for t in h.knots if self.span[0] < t < self.span[1]}
        self.knots = tuple(sorted(knots))

    def path(self) -> Path:
        """The path on a mesh fine enough for the accuracy."""
        begin = time.perf_counter()
        base = self.meshes.target if self.meshes.prescribed else self.meshes.target.refined()
        coarse = self._level(base)
        gain = 1.0 if self.meshes.prescribed else max(1.0, 4.0**base.order / MARGIN)
        for _ in range(LEVELS):
            fine = self._level(self._halved(coarse.tracer.base))
            errors = {key: error / gain for key, error in self._errors(coarse, fine).items()}
            largest = max(errors.values())
            if (
                largest <= self.meshes.accuracy
                or self.meshes.prescribed
                or 2 * fine.tracer.base.elements > MOST_ELEMENTS
            ):
                break
            coarse = fine
        answer = self._answer(coarse if self.meshes.prescribed else fine, errors)
        self.meshes.seconds["solve"] = time.perf_counter() - begin - self.meshes.seconds["model"]
        return answer

    def _halved(self, mesh: Mesh) -> Mesh:
        marks = {
            n: np.full(len(c) - 1, self.meshes.prescribed or n not in self.meshes.fixed) for n, c in mesh.cuts.items()
        }
        return mesh.refined(marks)

    def _level(self, base: Mesh) -> _Level:
        run = ContactRun(self.scene, self.meshes.prepared, self.meshes.accuracy)
        run.reviser.limit = COARSE if self.meshes.prescribed else float(np.clip(run.fine, DEEP, COARSE))
        tracer = Tracer(run, base, self.span, self.knots)
        begun = tracer.begin(self._beside)
        if begun is None:
            raise SolveError(Status.FAILED, "no equilibrium in contact to start the path from at factor 0 or beside it")
        trace = tracer.traced(begun[0], self.analysis.points)
        if trace.limit is not None and len(trace.points) == 1:
            raise SolveError(trace.limit.status, trace.limit.detail, begun[0].standing.state)
        if len(trace.points) == 1:
            raise SolveError(Status.FAILED, trace.notes[-1], begun[0].standing.state)
        trace.notes[:0] = begun[1]
        return _Level(tracer, trace, tracer.crossings(trace, self.analysis.steps))

    def _beside(self, factor: float) -> Equilibrium:
        """The equilibrium at a factor by itself."""
        analysis = self.scene.analysis.model_copy(update={"type": "static", "steps": (factor,)})
        return statics.solve(self.scene.model_copy(update={"analysis": analysis}), self.settings).last

    # -- errors ---------------------------------------------------------------------------------

    def _errors(self, coarse: _Level, fine: _Level) -> dict[tuple[str, int], float]:
        """Differences between two meshes, by kind and number; infinite where they do not correspond."""
        errors: dict[tuple[str, int], float] = {("samples", 0): self._sampled(coarse, fine)}
        widest = max(map(abs, self.span))
        for kind in ("limit", "step"):
            ours, theirs = coarse.of_kind(kind), fine.of_kind(kind)
            if len(ours) != len(theirs):
                errors[kind, -1] = np.inf
            for j, (one, other) in enumerate(zip(ours, theirs, strict=False)):
                factor = abs(one.factor - other.factor) / max(abs(other.factor), tolerances.UNIT * widest)
                apart = largest_difference(one.held.touched.fields, other.held.touched.fields)
                errors[kind, j] = max(apart, factor)
        return errors

    @staticmethod
    def _sampled(coarse: _Level, fine: _Level) -> float:
        """Largest difference of points of a coarse path when they are settled on the fine mesh."""
        unit = coarse.tracer.curve.unit
        steady = [point for point in coarse.trace.points if abs(point.tangent.factor) >= STEADY * unit]
        chosen = np.unique(np.linspace(0, len(steady) - 1, SAMPLES).round().astype(int)).tolist() if steady else []
        largest = 0.0
        for i in chosen:
            found = fine.tracer.again(steady[i])
            if found is not None:
                largest = max(largest, largest_difference(steady[i].held.touched.fields, found.touched.fields))
        return largest

    # -- answers --------------------------------------------------------------------------------

    def _answer(self, level: _Level, errors: dict[tuple[str, int], float]) -> Path:
        trace, largest = level.trace, max(errors.values())
        prepared = trace.points[-1].held.prepared
        run = level.tracer.run
        points = [self._point(run, point, i in trace.limits) for i, point in enumerate(trace.points)]

        def entries(kind: str) -> tuple[Equilibrium, ...]:
            return tuple(self._entry(run, p, errors.get((kind, j))) for j, p in enumerate(level.of_kind(kind)))

        end = ending(trace.end, trace.points[-1].factor, len(trace.points) - len(trace.limits), str(trace.limit or ""))
        branch = Branch(tuple(points), entries("step"), entries("limit"), (), end)
        notes = (*trace.notes, BIFURCATIONS, *self._unexplained(trace, points))
        status = Status.SHORT if largest > self.meshes.accuracy and self.meshes.asked else Status.SOLVED
        return Path(
            scene=self.scene,
            status=Status.CUT if trace.end in ("lost", "bent") else status,
            prepared=prepared,
            branches=(branch,),
            unit=level.tracer.curve.unit,
            error_estimate=largest if np.isfinite(largest) else None,
            last=branch.steps[-1] if branch.steps else self._entry(run, trace.points[-1], None),
            notes=notes if prepared.model.conservative else (*notes, NO_POTENTIAL),
            seconds=self.meshes.seconds,
        )

    def _point(self, run: ContactRun, point: Stood, limit: bool) -> PathPoint:
        held = point.held
        stability, _ = run.certified(held, point.factor)
        negative = stability.negative if held.prepared.model.conservative else 0
        return PathPoint(
            point.factor,
            held.corrected.state,
            held.loading,
            negative,
            stability.stable,
            point.arc,
            "limit point" if limit else "",
            held.prepared,
        )

    def _entry(self, run: ContactRun, point: Stood, error: float | None) -> Equilibrium:
        held = point.held
        refuse_unbalanced(held.touched.fields)
        stability, notes = run.certified(held, point.factor)
        estimate = error if error is not None and np.isfinite(error) else None
        answer = finished(held.corrected, stability, error_estimate=estimate, notes=notes)
        refuse_lost_forces(answer)
        return answer

    @staticmethod
    def _unexplained(trace: Trace, points: list[PathPoint]) -> list[str]:
        """Changes of the stability between points that no limit point or change of what touches explains."""
        notes = []
        for i, (a, b) in enumerate(zip(points, points[1:], strict=False)):
            near = {i, i + 1} & trace.limits or i in trace.corners
            if a.negative != b.negative and not near:
                ways = f"from {a.negative} to {b.negative}"
                notes.append(f"between factors {a.factor:.6g} and {b.factor:.6g} the ways out change {ways}")
        return notes
