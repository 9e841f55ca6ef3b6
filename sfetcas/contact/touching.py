"""Equilibria in contact: which places of members touch which obstacles, and where exactly.

1. *Settling*: with a given set of touches the equilibrium, and the places of contact from their conditions.
2. *Which touches*: what gets inside an obstacle begins to touch it, what would be pulled leaves it, a place that the
   member penetrates beside becomes a stretch, a stretch without length a place, until nothing is wrong.
3. *Following*: both along a way of loads or of obstacles that come to their places, from a state whose touches are
   known, so that the answer is the one that this way leads to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..description.scene import Scene
from ..errors import SolveError
from ..mechanics.mesh import Mesh, Touch
from ..solvers.prepared import Prepared
from .revising import Reviser, Tried
from .settling import Held, Ran, Settler, Way, placed
from .touches import Touched

__all__ = ["Toucher", "can_leave"]

CHANGES = 24
"""Changes of what touches at one point of the way before the step is taken to be too long."""

SHORTEST = 2e-5, 5e-4
"""First and later steps below this part of the way end the search."""

SNAP = 2e-3
"""Part of the way beyond a limit point at which a state is left for another."""

MOST_SNAPS = 4
"""Snaps on one way."""

MOST_SOLVES = 200
"""Equilibria with places held that are solved on one way."""

TRIES = 60
"""Steps tried before giving up."""


class Toucher:
    """Contact of one scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    limit : float
        How deep a place may be inside an obstacle, over the size of the scene.
    sides : mapping
        Of each edge and member where it is allowed, see :func:`~sfetcas.contact.touches.edge_sides`.
    """

    def __init__(
        self,
        scene: Scene,
        prepare: Callable[[Mesh], Prepared],
        limit: float,
        sides: Mapping[tuple[str, str], float],
    ) -> None:
        self.scene, self.prepare = scene, prepare
        self.settler, self.reviser = Settler(scene, prepare), Reviser(scene, limit, sides)
        self.leave = scene.analysis.unstable == "leave"
        self.snapped: list[float] = []

    def resolved(
        self, base: Mesh, now: Held | None, touches: tuple[Touch, ...], way: Way, most: int | None = None
    ) -> Held | None:
        """The equilibrium at a point of the way with nothing wrong about its touches; by ``most`` solves in all."""
        self.settler.limit = self.settler.solves + MOST_SOLVES if most is None else most
        try:
            return self._resolved(base, now, touches, way)
        finally:
            self.settler.limit = np.inf

    def _resolved(self, base: Mesh, now: Held | None, touches: tuple[Touch, ...], way: Way) -> Held | None:
        source = None if now is None else (now.prepared.model, now.corrected.state)
        seen: list[tuple[Touch, ...]] = []
        tried = Tried()
        for _ in range(CHANGES):
            if sum(_alike(touches, other) for other in seen) > 1:
                return None
            seen.append(touches)
            self.reviser.check(touches)
            model = (self.prepare(base) if now is None else now.prepared).model
            touches = self.reviser.released(model, way.loading(model), touches, way)
            found = self.settler.settle(placed(self.scene, base, touches), source, way)
            if found is None:
                return None
            if isinstance(found, Ran):
                touches = self.reviser.ended(found, tried)
                if any(_alike(touches, other) for other in seen):
                    touches = self.reviser.lying_to_the_end(found) or touches
                continue
            wrong = self.reviser.wrong(found, way, tried)
            if wrong is None:
                return None if self.reviser.ran_over(now, found) else found
            touches = wrong
            source = found.prepared.model, found.corrected.state
        return None

    def follow(
        self, base: Mesh, way: Callable[[float], Way], start: Held | tuple[Touch, ...], longest: float = 1.0
    ) -> Held | None:
        """Follow from the begin of a way to its end; from a state there, or from the undeformed scene.

        No step is longer than ``longest``, a part of the way.

        ``snapped``, an attribute, is then the parts of the way at which a state was left that ceased to be.
        """
        self.snapped = []
        now = start if isinstance(start, Held) else None
        touches = start.mesh.touches if isinstance(start, Held) else start
        done, step = 0.0, min(0.5, longest)
        most = self.settler.solves + MOST_SOLVES
        for _ in range(TRIES):
            if done >= 1.0:
                return now
            if self.settler.solves > most:
                return None
            trial = min(1.0, done + step)
            there = self.resolved(base, now, touches, way(trial), most)
            if there is None:
                step *= 0.25
                if step >= SHORTEST[done > 0.0]:
                    continue
                trial = min(1.0, done + SNAP)
                there = self._snapped(base, now, way(trial))
                if there is None:
                    return None
                self.snapped.append(trial)
                step = 0.05
            now, touches, done = there, there.mesh.touches, trial
            step = min(2.0 * step, longest)
        return None

    def _snapped(self, base: Mesh, now: Held | None, way: Way) -> Held | None:
        """Where a state that ceases to be goes to: downhill on what touches, then what touches is looked at again."""
        if now is None or not self.leave or not can_leave(now) or len(self.snapped) >= MOST_SNAPS:
            return None
        touches = tuple(replace(t, offset=way.offsets.get(t.contact, 0.0)) for t in now.mesh.touches)
        prepared = self.prepare(replace(now.mesh, touches=touches))
        loading = way.loading(prepared.model)
        stability = now.prepared.stability(now.corrected)
        try:
            corrected, _ = prepared.leave(now.corrected.state, stability, loading)
        except SolveError:
            return None
        there = Held(prepared, corrected, loading, Touched(prepared.equations, corrected.state, loading))
        found = self.resolved(base, there, touches, way)
        return None if found is None or self.reviser.ran_over(now, found) else found


def can_leave(held: Held) -> bool:
    """Whether there is an energy and anything left to move."""
    equations = held.prepared.equations
    return held.prepared.model.minimisable and equations.rows < equations.unknowns


def _alike(a: tuple[Touch, ...], b: tuple[Touch, ...]) -> bool:
    """Whether two sets of touches are the same but for rounding of the places."""

    def key(touches: tuple[Touch, ...]) -> Any:
        return [(t.contact, t.member, *(round(x, 6) for x in t.places)) for t in touches]

    return bool(key(a) == key(b))
