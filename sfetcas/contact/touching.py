"""Equilibria in contact: which places of members touch which obstacles, and where exactly.

1. *Settling*: the equilibrium with a given set of touches, and the places of contact from their conditions.
2. *Active set*: penetrating places are added, places in tension removed, places beside which the member penetrates
   become stretches, and stretches of no length places, until no condition is violated.
3. *Following*: both along a way of growing loads, or of obstacles that move to their places, from a state whose
   touches are known, so that the answer is the one that this way leads to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..description.scene import Scene
from ..errors import SolveError
from ..mechanics.mesh import Mesh, Touch
from ..solvers.continuation import NARROW
from ..solvers.prepared import Prepared
from .contact_stability import ContactStability, can_switch_branch
from .passing import Passing
from .revising import Reviser, Tried
from .settling import Held, Ran, Settler, Way, placed

__all__ = ["Toucher"]

CHANGES = 24
"""Largest number of changes of touches at one point of the way; with more the step counts as too long."""

SHORTEST = 2e-5, 5e-4
"""Shortest first and later step, parts of the way."""

SNAPS = 5e-3, 2e-2, 5e-2
"""Distances beyond a limit or bifurcation point at which a jump to another state is tried, parts of the way."""

MOST_SNAPS = 8
"""Largest number of jumps on one way."""

MOST_SOLVES, MOST_ON_WAY = 200, 3000
"""Largest number of equilibria with fixed places that are solved at one point of a way, and on all of it."""

TRIES = 500
"""Largest number of trial steps on a way."""

FALLS = 80
"""Largest number of steps of a fall, an overdamped motion from an unstable state."""

FIRST_DRAG, LEAST_DRAG, MOST_DRAG, DRAG_BEYOND = 1.0, 1e-6, 1e7, 2.0
"""Drag, dimensionless: first, least and largest; and least ratio of it to the size of the lowest eigenvalue."""

SLOW = 0.1
"""Rotation in a step of a fall, rad, below which the state may be near to rest."""

NEARER = 0.3
"""Factor by which the rotation of a step has to fall after a failed attempt before rest is tried again."""

NUDGE = 0.05
"""Rotation, rad, by which an unstable equilibrium is displaced along its unstable mode to begin a fall."""

SUDDEN, STEEP = 0.02, 4.0
"""A step is sudden with a larger rotation of a place, rad, that also is this multiple of what the rate before gives."""

DEPARTS = 0.15
"""A step is also sudden that differs by this rotation, rad, from extrapolation: another branch, or a corner passed."""

FIRST, AFTER_JUMP = 0.25, 0.05
"""Length of the first step, and of the one after a jump, parts of the way."""


class Toucher:
    """Solver of states in contact of one scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    limit : float
        Largest penetration that is accepted, over the size of the scene.
    sides : mapping of (contact, member) to float
        The allowed side of each edge, see :func:`~sfetcas.contact.touches.edge_sides`.

    Attributes
    ----------
    snapped : list of float
        Parts of the last way at which a state was left, or ceased to exist.
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
        self.stability = ContactStability(self.settler)
        self.passing = Passing(scene, scene.obstacles)
        self.switch_branch = scene.analysis.unstable == "leave"
        self.snapped: list[float] = []

    def resolved(
        self, base: Mesh, now: Held | None, touches: tuple[Touch, ...], way: Way, most: int | None = None
    ) -> Held | None:
        """The equilibrium at a point of the way with the right touches, starting from ``touches``; None if not found.

        ``most`` is the value of ``settler.solves`` at which the search gives up.
        """
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
                return None if self.passing.over(now, found) else found
            touches = wrong
            source = found.prepared.model, found.corrected.state
        return None

    def follow(self, base: Mesh, way: Callable[[float], Way], start: Held | tuple[Touch, ...]) -> Held | None:
        """The state at the end of a way, followed from one at its beginning or from touches of the undeformed scene.

        No step rotates a place by more than :data:`~sfetcas.contact.passing.STRIDE` or may have passed an obstacle, and
        a state that ceases to be stable is left at once if the scene asks for it.  None if the state is lost.

        Raises
        ------
        SolveError
            A small member bends beyond the range of its linear model on the way.
        """
        self.snapped = []
        most = self.settler.solves + MOST_ON_WAY
        now = start if isinstance(start, Held) else self.resolved(base, None, start, way(0.0))
        touches = start.mesh.touches if isinstance(start, Held) else start
        stands = now is not None and not self.unstable(now, way(0.0))
        done, step, barrier, rate = 0.0, FIRST, np.inf, np.inf
        since: tuple[float, Held] | None = None
        for _ in range(TRIES):
            if done >= 1.0:
                return now
            if self.settler.solves > most:
                return None
            # Beyond a place where it was seen to be unstable there is no use in trying; near to it that place is next.
            ahead = barrier - done
            step = min(step, ahead if ahead <= max(NARROW * barrier, SHORTEST[0]) else 0.5 * ahead)
            trial = min(1.0, done + step)
            there = self.resolved(base, now, touches, way(trial))
            turned = 0.0
            if there is not None and now is not None:
                turned = self.passing.turned(now, there)
                if self.passing.possible(now, there, way(trial).offsets):
                    there = None
            # What moves much faster than before either begins to, which short steps show, or has jumped.
            sudden = there is not None and turned > max(SUDDEN, STEEP * rate * (trial - done))
            if there is not None and now is not None and since is not None:
                share = (trial - done) / (done - since[0])
                sudden = sudden or self.passing.departed(since[1], now, there, share) > DEPARTS
            if sudden and 0.25 * step >= SHORTEST[1]:
                step *= 0.25
                continue
            stays = there is not None and not self.unstable(there, way(trial))
            falls = there is not None and stands and not stays
            if falls and trial - done > max(NARROW * trial, SHORTEST[0]):
                barrier = trial
                continue
            if there is None:
                step *= 0.25
                if step >= SHORTEST[done > 0.0]:
                    continue
            if there is None or falls:
                jump = self._jumped(base, there or now, trial if falls else done, way)
                if jump is None and there is None:
                    return None
                if jump is not None:
                    goes_on = STEEP * rate * (jump[0] - done) if there is None and np.isfinite(rate) else 0.0
                    trial, there = jump
                    stays = True
                    turned = np.inf if now is None else self.passing.turned(now, there)
                    # Where Newton's method is lost though the state goes on, nothing has jumped.
                    if turned > min(goes_on, SUDDEN):
                        self.snapped.append(trial)
                step, barrier = AFTER_JUMP, np.inf
            elif sudden:
                self.snapped.append(trial)
            assert there is not None
            beyond = there.touched.fields.beyond_limits()
            if beyond is not None:
                raise beyond
            jumped = falls or trial in self.snapped or now is None
            rate = np.inf if jumped else turned / (trial - done)
            since = None if jumped or now is None else (done, now)
            now, touches, done = there, there.mesh.touches, trial
            barrier = np.inf if done >= barrier else barrier
            stands = stays
            step *= 2.0
        return None

    # -- unstable states ------------------------------------------------------------------------

    def unstable(self, held: Held, way: Way) -> bool:
        """Whether a state is unstable, and the scene asks to leave such states."""
        return self.switch_branch and can_switch_branch(held) and self.stability.judged(held, way).negative > 0

    def left(self, base: Mesh, held: Held, way: Way) -> Held | None:
        """A stable state to which an unstable one leads without passing an obstacle; None if none is found."""
        pressing = self.stability.pressing(held, way)
        loose = tuple(replace(touch, flat=False) for touch in pressing.mesh.touches)
        source = pressing.prepared.model, pressing.corrected.state
        for start in (pressing, self.settler.solved(replace(pressing.mesh, touches=loose), source, way)):
            found = None if start is None else self._along_unstable_mode(start, way, loose)
            if found is not None and not self.unstable(found, way) and not self._passed(held, found, way):
                return found
        return self._fallen(base, self._nudged(pressing), loose, way)

    def _passed(self, held: Held, found: Held, way: Way) -> bool:
        """Whether a state may be beyond an obstacle: the ends of a jump may be far apart."""
        return self.passing.possible(held, found, way.offsets, stride=np.inf)

    def _jumped(
        self, base: Mesh, now: Held | None, done: float, way: Callable[[float], Way]
    ) -> tuple[float, Held] | None:
        """A part of the way shortly beyond one at which a state ceases to be, or to be stable, and where it goes."""
        if now is None or not self.switch_branch or not can_switch_branch(now) or len(self.snapped) >= MOST_SNAPS:
            return None
        ways_out = self.unstable(now, way(done))
        for beyond in SNAPS:
            trial = min(1.0, done + beyond)
            at = way(trial)
            there = self.resolved(base, now, now.mesh.touches, at) if ways_out else None
            if there is not None and self.passing.possible(now, there, at.offsets):
                there = None
            found = (
                self._along_unstable_mode(now, at, now.mesh.touches) if there is None else self.left(base, there, at)
            )
            if there is None and (found is None or self._passed(now, found, at)):
                found = self._fallen(base, now, now.mesh.touches, at)
            if found is not None:
                return trial, found
            if trial == 1.0:
                break
        return None

    def _along_unstable_mode(self, start: Held, way: Way, touches: tuple[Touch, ...]) -> Held | None:
        """Downhill from a state along its unstable mode, then what touches is looked at again."""
        prepared = start.prepared
        if way.offsets:
            mesh_touches = tuple(replace(t, offset=way.offsets.get(t.contact, 0.0)) for t in start.mesh.touches)
            prepared = self.prepare(replace(start.mesh, touches=mesh_touches))
        loading = way.loading(prepared.model)
        try:
            corrected = prepared.switch_branch(start.corrected, loading)
            there = Held(corrected)
            return self.resolved(replace(start.mesh, touches=()), there, touches, way)
        except SolveError:
            return None

    def _fallen(self, base: Mesh, now: Held, touches: tuple[Touch, ...], way: Way) -> Held | None:
        """Where a state falls to through something viscous, stopped by obstacles; None where it does not come to rest.

        Steps become longer as it slows down.  Drag stays beyond the lowest eigenvalue below zero, so that each step has
        one minimum.
        """
        drag, slow = FIRST_DRAG, SLOW
        for _ in range(FALLS):
            stability = self.stability.judged(now, way)
            drag = max(drag, -DRAG_BEYOND * stability.smallest if stability.negative > 0 else 0.0, LEAST_DRAG)
            since = now.prepared.model, now.corrected.state
            there = self.resolved(base, now, touches, replace(way, since=since, drag=drag))
            if there is None or self.passing.possible(now, there, way.offsets):
                drag *= 4.0
                if drag > MOST_DRAG:
                    return None
                continue
            turned = self.passing.turned(now, there)
            now, touches = there, there.mesh.touches
            if turned < slow and not self.unstable(now, way):
                rest = self.resolved(base, now, touches, way)
                stays = rest is not None and not self.passing.possible(now, rest, way.offsets)
                if rest is not None and stays and not self.unstable(rest, way):
                    return rest
                # Without drag Newton's method goes from here to where it fell from: nearer to rest it will not.
                slow = NEARER * turned
            drag *= 0.25 if turned < 0.5 * SLOW else 0.5 if turned < SLOW else 1.0
        return None

    @staticmethod
    def _nudged(held: Held) -> Held:
        """An unstable equilibrium moved along its unstable mode, so that it begins to fall."""
        prepared, loading = held.prepared, held.loading
        state = prepared.nudged(held.corrected, loading, NUDGE)
        corrected = replace(held.corrected, state=state, point=prepared.equations.at(state, loading))
        return Held(corrected)


def _alike(a: tuple[Touch, ...], b: tuple[Touch, ...]) -> bool:
    """Whether two sets of touches are the same but for rounding of the places."""

    def key(touches: tuple[Touch, ...]) -> Any:
        return [(t.contact, t.member, *(round(x, 6) for x in t.places)) for t in touches]

    return bool(key(a) == key(b))
