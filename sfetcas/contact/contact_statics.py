"""Static equilibria of a scene with obstacles: the way to a state in contact, its mesh and its stability."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from .. import tolerances
from ..description.obstacles import members_of, nearest
from ..description.scene import Scene
from ..description.supports import along
from ..errors import SolveError, Status
from ..mathematics.arrays import Array, unit
from ..mechanics.accuracy import halving, roughness
from ..mechanics.fields import Fields
from ..mechanics.mesh import Mesh, Touch
from ..solvers.continuation import JUMPED, between, near_factor
from ..solvers.prepared import Prepared, Solved
from ..solvers.stability import Stability
from .settling import Held, Way, placed
from .touches import COARSE, NOISE, Touched, edge_sides
from .touching import Toucher

__all__ = ["ContactRun", "Pressed"]

STAYS = "unstable, and no stable equilibrium was found along its unstable mode"
"""Note of an unstable answer."""

LEFT = "left an unstable equilibrium in contact along its unstable mode"
"""Note of an answer that was reached from an unstable equilibrium."""

ELSEWHERE = (
    "the loads growing from zero could not be followed in contact all the way: this is a state in contact that "
    "soft obstacles becoming hard led to, and there may be others"
)
"""A note of answers that were found in another way."""

LEVELS, MOST_ELEMENTS = 40, 20_000
"""Largest numbers of refinements of a mesh, and of elements."""


@dataclass(frozen=True)
class Pressed:
    """An answer: the state, its stability, the estimated error over the size of the scene, and notes for the user."""

    held: Held
    stability: Stability
    error: float
    notes: tuple[str, ...]


class ContactRun:
    """States in contact at the load factors of a scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    fixed : set of str
        Members whose mesh is prescribed.
    judge : callable, optional
        (state, state on half the element lengths, factor) -> their difference, and the estimated error of the second;
        by default of the positions, over the size of the scene.
    """

    def __init__(
        self,
        scene: Scene,
        prepare: Callable[[Mesh], Prepared],
        accuracy: float,
        fixed: set[str],
        judge: Callable[[Held, Held, float], tuple[float, float]] | None = None,
    ) -> None:
        self.scene, self.accuracy, self.fixed, self.judge = scene, accuracy, fixed, judge or _judge
        self.toucher = Toucher(scene, prepare, COARSE, edge_sides(scene))
        self.settler, self.reviser = self.toucher.settler, self.toucher.reviser
        self.stability = self.toucher.stability
        self.cushions = self.toucher.cushions
        self.fine = max(tolerances.CLOSED, 0.1 * accuracy)
        self.prepare = prepare
        self.last: tuple[float, Held] | None = None
        self.jumps: list[float] = []
        self.elsewhere = ""

    # -- ways -----------------------------------------------------------------------------------

    def continued(self, base: Mesh, factor: float) -> Held | None:
        """The state followed from that of the last factor, if that has contact and lies between zero and this one."""
        self.jumps = []
        if self.last is None or self.last[0] * (factor - self.last[0]) < 0.0 or not self.last[1].mesh.touches:
            return None
        begin, start = self.last
        return self._through(base, begin, factor, start)

    def grown(self, base: Mesh, factor: float) -> Held | None:
        """The state followed from the undeformed scene, loads and motions growing together; None if it is lost."""
        start: Held | tuple[Touch, ...] = self.first_touches
        if self.scene.histories and factor != 0.0:
            held = self.toucher.follow(base, lambda t: Way(lambda model: model.loading(0.0, t), {}), start)
            if held is None:
                return None
            start = held
        return self._through(base, 0.0, factor, start)

    def _factors(self, begin: float, end: float) -> list[float]:
        """Factors from one to another, where histories have knots."""
        low, high = min(begin, end), max(begin, end)
        knots = {t for history in self.scene.histories.values() for t in history.knots if low < t < high}
        return [begin, *sorted(knots, reverse=end < begin), end]

    def _through(self, base: Mesh, begin: float, end: float, start: Held | tuple[Touch, ...]) -> Held | None:
        stops = self._factors(begin, end)
        held: Held | None = None
        for a, b in zip(stops, stops[1:], strict=False):
            way = _between(a, b)
            held = self.toucher.follow(base, way, start)
            if held is None:
                return None
            self.jumps += [a + part * (b - a) for part in self.toucher.snapped]
            start = held
        return held

    @property
    def jumped(self) -> tuple[str, ...]:
        """Notes about the last way, and the factors at which it jumped to another state."""
        notes = (self.elsewhere,) if self.elsewhere else ()
        return notes + tuple(dict.fromkeys(f"jumped {near_factor(factor)}: {JUMPED}" for factor in self.jumps))

    def retracted(self, base: Mesh, factor: float, free: Held) -> Held | None:
        """The state followed from ``free``, without obstacles, as they move from outside of it to their places."""
        gaps = free.touched.inside({}, self.reviser.sides, 0.0)
        depths: dict[str, float] = {}
        for gap in gaps:
            depths[gap.contact] = max(depths.get(gap.contact, 0.0), -gap.depth)

        def way(t: float) -> Way:
            return Way(lambda model: model.loading(factor), {n: (1.0 - t) * depth for n, depth in depths.items()})

        return self.toucher.follow(base, way, free)

    def cushioned(self, base: Mesh, factor: float) -> Held | None:
        """The state near that of penalty contact (:mod:`~sfetcas.contact.cushions`); None if either is not found."""
        found = self.cushions.found(base, self._factors(0.0, factor))
        if found is None:
            return None
        self.jumps = list(self.cushions.left)
        return self.toucher.read(base, found, self.at(factor))

    @functools.cached_property
    def first_touches(self) -> tuple[Touch, ...]:
        """The touches in the undeformed scene."""
        found: list[Touch] = []
        for contact, stop in self.cushions.obstacles.items():
            for member in members_of(self.scene.contacts[contact], self.scene.members):
                line = self.scene.center_lines[member]
                x = np.linspace(0.0, 1.0, 257)
                if stop.kind == "sharp":
                    way = self.reviser.sides[contact, member]
                    places = np.array(nearest(stop, line.positions, line.tangents, x))
                    gaps = stop.gaps(line.positions(places), line.tangents(places), 0.0, way) if len(places) else places
                    found += [
                        Touch(contact, member, float(p), way=way)
                        for p, gap in zip(places, gaps, strict=True)
                        if abs(gap) < tolerances.CLOSED * self.scene.size
                    ]
                    continue
                gaps = stop.gaps(line.positions(x), line.tangents(x))
                found += self._lying(contact, member, x, gaps)
        return self.reviser.numbered(tuple(found))

    def _lying(self, contact: str, member: str, x: Array, gaps: Array) -> Iterator[Touch]:
        """Places and stretches of the undeformed member at no distance."""
        near = np.abs(gaps) < tolerances.CLOSED * self.scene.size
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        nodes = self.scene.members[member].nodes
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            low, high = float(x[a]), float(x[b - 1])
            if b - a == 1:
                if 0.0 < low < 1.0 or self.reviser.takes_part(contact, nodes[int(low)]):
                    yield Touch(contact, member, low)
                continue
            yield Touch(contact, member, low, high)

    def at(self, factor: float) -> Way:
        """The loads at a factor as a point of a way."""
        return Way(lambda model: model.loading(factor), {})

    def unstopped(self, before: Solved, after: Solved) -> bool:
        """Whether a step from one equilibrium without obstacles to another meets none of them."""
        held, there = (Held(found) for found in (before, after))
        if there.touched.inside({}, self.reviser.sides, tolerances.CLOSED * self.scene.size):
            return False
        return not self.toucher.passing.possible(held, there, {})

    def clear(self, fields: Fields) -> bool:
        """Whether no obstacle is in the way of a state."""
        return not Touched.of(fields).inside({}, self.reviser.sides, self.fine * self.scene.size)

    def reached(
        self, base: Mesh, factor: float, free: Held | None, *, falls: bool
    ) -> Iterator[tuple[str, Held | None]]:
        """States in contact (None for failure) by the name of the way to them, preferred ones first.

        Usually that of growing loads; near the state without obstacles, ``free``, where start places choose it.  A
        structure that ``falls`` onto obstacles, as nothing else supports it, has no state under small loads.
        """
        ways: list[tuple[str, Callable[[], Held | None]]] = [("in contact", lambda: self.continued(base, factor))]
        if free is not None:
            ways.append(("retreat", lambda: self.retracted(base, factor, free)))
        if not falls:
            ways.append(("in contact", lambda: self.grown(base, factor)))
        ways.append(("cushions", lambda: self.cushioned(base, factor)))
        for name, way in ways:
            self.jumps, self.elsewhere = [], ELSEWHERE if name == "cushions" and not falls else ""
            yield name, way()

    def refuse_unrestrained(self, pilot: Prepared) -> None:
        """Refuse a scene that neither supports nor plane obstacles hold in some direction.

        Raises
        ------
        SolveError
            There is one; the message names the direction.
        """
        stops, axes = self.scene.obstacles, pilot.model.element.axes
        free = np.array(pilot.diagnosis.drifts).reshape(-1, axes)
        if not len(free) or any(stop.kind != "flat" for stop in stops.values()):
            return
        normals = np.array([stop.normals(np.zeros((1, 3)), np.zeros((1, 3)))[0][:axes] for stop in stops.values()])
        _, sizes, ways = np.linalg.svd(free @ normals.T @ normals @ free.T)
        for way in ways[sizes < tolerances.PARALLEL**2]:
            direction = unit(way @ free)
            detail = f"nothing holds it along {along(direction)}, not the frictionless {', '.join(self.named(None))}"
            raise SolveError(Status.FAILED, detail)

    def named(self, failure: SolveError | None) -> list[str]:
        """Obstacles, and the failure if any, as the list of causes in a message."""
        return [*(f"contacts.{name}" for name in self.scene.contacts), *([str(failure)] if failure else [])]

    # -- accuracy -------------------------------------------------------------------------------

    def answered(self, held: Held, factor: float, target: Mesh, notes: tuple[str, ...]) -> Pressed:
        """The state on a mesh that is fine enough for the accuracy, with its stability and notes.

        Raises
        ------
        SolveError
            The touches of the coarse mesh are not found on a finer one.
        """
        way = self.at(factor)
        held, left = self._settled(held, way)
        self.last = (factor, held)
        now = held
        if held.mesh.order != target.order or self.fixed:
            now = self._onto(placed(self.scene, target, held.mesh.touches), held, way)
        smooth, error = np.sqrt(self.accuracy), np.inf
        for _ in range(LEVELS):
            marks = self._marked(now, smooth)
            if not any(marked.any() for marked in marks.values()):
                finer = self._onto(now.mesh.refined(), now, way)
                difference, error = self.judge(now, finer, factor)
                if self._all_fixed:
                    error += difference
                    break
                now = finer
                if error <= self.accuracy:
                    break
                smooth *= 0.1
            elif now.mesh.elements > MOST_ELEMENTS:
                break
            else:
                now = self._onto(now.mesh.refined(marks), now, way)
        now = self._checked(now, way, error)
        stability, more = self._stability(now, way)
        if stability.negative <= 0 and left == (STAYS,):
            left = ()
        return Pressed(now, stability, error, (*notes, *left, *more))

    def _checked(self, held: Held, way: Way, error: float) -> Held:
        """The state on its fine mesh with what touches looked at as finely as the error of positions allows."""
        self.reviser.limit = max(self.fine, error)
        self.reviser.noise = min(NOISE, self.accuracy) if self.fine >= COARSE else 0.0
        try:
            if self.reviser.wrong(held, way) is None:
                return held
            return self._onto(held.mesh, held, way, anew=True)
        finally:
            self.reviser.limit, self.reviser.noise = COARSE, NOISE

    @property
    def _all_fixed(self) -> bool:
        return self.fixed == {n for n, m in self.scene.members.items() if m.type == "flexible"}

    def _marked(self, held: Held, smooth: float) -> dict[str, Array]:
        rough, model = roughness(held.touched.fields) > smooth, held.prepared.model
        return {n: rough[model.elements_of(n)] & (n not in self.fixed) for n in model.members}

    def _onto(self, mesh: Mesh, held: Held, way: Way, *, anew: bool = False) -> Held:
        """The state on another mesh with the same touches, or with ``anew`` touches that are determined again."""
        if not anew:
            found = self.settler.settle(mesh, (held.prepared.model, held.corrected.state), way)
            if isinstance(found, Held):
                return found
        there = self.toucher.resolved(replace(mesh, touches=()), held, held.mesh.touches, way)
        if there is None:
            raise SolveError(Status.FAILED, f"contact found on a coarse mesh was lost on a finer one: {_told(held)}")
        return there

    # -- stability ------------------------------------------------------------------------------

    def _stability(self, held: Held, way: Way) -> tuple[Stability, list[str]]:
        """Stability with what touches held on its obstacles, free to slide along them."""
        notes: list[str] = []
        touched, touches = held.touched, held.mesh.touches
        stability = self.stability.judged(held, way)
        if touches:
            notes.append(f"in contact: {_told(held)}; stability is that with these places held on their obstacles")
        pushes = {touch.name: float(np.linalg.norm(touched.force(touch))) for touch in touches}
        largest = max([held.prepared.model.scales.force, *pushes.values()])
        weak = [name for name, push in pushes.items() if push < tolerances.BALANCED * largest]
        if weak:
            notes.append(f"touches without force: {', '.join(weak)}")
        return stability, notes

    def certified(self, held: Held, factor: float) -> tuple[Stability, tuple[str, ...]]:
        """Stability of a state on its mesh, with sliding places counted in both directions, and notes."""
        way = self.at(factor)
        stability, notes = self._stability(held, way)
        return self.stability.strictly(held, way) or stability, tuple(notes)

    def _settled(self, held: Held, way: Way) -> tuple[Held, tuple[str, ...]]:
        """An unstable state left for a stable one, where that is wanted and found."""
        if not self.toucher.unstable(held, way):
            return held, ()
        there = self.toucher.left(held.mesh, held, way)
        return (held, (STAYS,)) if there is None else (there, (LEFT,))


def _judge(one: Held, other: Held, factor: float) -> tuple[float, float]:
    return halving(one.touched.fields, other.touched.fields)


def _between(a: float, b: float) -> Callable[[float], Way]:
    return lambda t: Way(lambda model: between(model, a, b)(t), {})


def _told(held: Held) -> str:
    parts = []
    for touch in held.mesh.touches:
        where = f"at {touch.at:.6g}" if touch.to is None else f"from {touch.at:.6g} to {touch.to:.6g}"
        parts.append(f"{touch.member} on {touch.contact} {where}")
    return ", ".join(parts)
