"""Members that come near to each other in a motion: which rows there are, followed from one set of them to the next.

A system has a row for each two places that are nearest to each other and nearer than a reach.  Within that system
impacts, contact and release are those of all unilateral constraints, see :mod:`~sfetcas.dynamics.events`.  The system
is made anew with other rows, and the motion goes on in it from the same state, where

- a search finds members near to each other without a row; no member moves by more than a quarter of the reach from
  one search to the next, so that what has no row yet is never touched;
- a place goes from one element to another, or to the end of its member, or leaves this end: that is located in the
  step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ..contact.closest import Closest, Near, Pair
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import TINY, Array
from ..mechanics.clearances import PARALLEL, Rows
from ..mechanics.equations import State
from ..mechanics.fields import Fields
from ..mechanics.mesh import Approach
from ..mechanics.model import Model
from .events import Events
from .integrating import Memory, Passed, Stepper, Taken
from .motion import Mover
from .stages import StageEquations

__all__ = ["Approaching"]

REACH = 4.0
"""Distance of surfaces at which members have a row, over the largest sum of radii."""

STRIDE = 0.25
"""How far members move in a step, over the reach: two that had no row before it are then apart after it."""

MARGIN, EDGE = 0.02, 1e-7
"""How far places go beyond an element before another one takes over, and beyond the end of a member, fractions of it:
lines go on smoothly from element to element, so that the first does no harm.
"""

WITHIN = 1e-9
"""Share of a step to which it is located where a place leaves its element."""

DEEP = 1e-3
"""Share of a sum of radii by which members may penetrate where they are searched for, before the motion is refused."""


class Approaching:
    """Follows a motion from one set of rows to the next.

    Parameters
    ----------
    mover : Mover
        Of the model without rows between members.
    build : callable
        Makes the system with given rows.

    Attributes
    ----------
    system : StageEquations
        With the present rows.
    over : Memory or None
        The state at which the present rows have come to an end.
    """

    def __init__(self, mover: Mover, build: Callable[[tuple[Approach, ...]], StageEquations]) -> None:
        self._mover, self._build, self._scene = mover, build, mover.model.scene
        self.closest = Closest(self._scene)
        self._between = [pair for pair in self.closest.pairs.values() if pair.stop is None]
        self._reach = REACH * self.closest.largest
        self.system = mover.inertia.system
        self.over: Memory | None = None
        self._rows: list[Rows] = []
        self._events: Events | None = None
        self._there = np.zeros(0)

    # -- rows -----------------------------------------------------------------------------------------

    def renewed(self, memory: Memory) -> Memory:
        """The state in the system with the rows of what is near; those act that acted between the same members."""
        before, acted = self.system, {}
        for part, acts, held in zip(before.unilateral.parts, memory.acting, memory.held, strict=True):
            if isinstance(part.spot, Approach) and acts:
                acted[part.spot.contact, frozenset(part.spot.members)] = held
        found = self._searched(memory)
        self.system = self._build(tuple(found.values()))
        self._rows, self.over = list(Rows.of(self.system.model.connections, self.system.model.mesh)), None
        rows, kept = self.system.unilateral, len(before.unilateral) - len(before.model.mesh.approaches)
        lam = np.zeros(self.system.layout.lam)
        own = len(memory.lam) - len(before.model.mesh.approaches)
        lam[:own] = memory.lam[:own]
        acting, holding = np.zeros(len(rows)), np.zeros(len(rows))
        acting[:kept], holding[:kept] = memory.acting[:kept], memory.held[:kept]
        opened = self.system.openings(State(memory.q, memory.y, lam, memory.unwrapped), memory.t)
        for i, part in enumerate(rows.parts[kept:], kept):
            assert isinstance(part.spot, Approach)
            close = opened[i] <= CLOSE
            if close and (memory.t == 0.0 or (part.spot.contact, frozenset(part.spot.members)) in acted):
                acting[i], holding[i] = 1.0, -rows.signs[i] * opened[i]
        return replace(memory, lam=lam, acting=acting, held=holding, last=None, unilateral=rows)

    def _searched(self, memory: Memory) -> dict[object, Approach]:
        """The rows of what is near in a state, by their keys."""
        self._there = self._relative(memory.position)
        fields, found = self._fields(memory), dict[object, Approach]()
        for near in self.closest.found(fields, self._reach, self._between):
            pair = self.closest.pairs[near.pair]
            self._refuse_deep(near, memory)
            for one in (near, *self._ends(fields, pair)):
                approach = self._approach(fields, one)
                if approach is not None:
                    found.setdefault(approach.key, approach)
        return found

    def _ends(self, fields: Fields, pair: Pair) -> Iterator[Near]:
        """Ends of either member that are near to the other one."""
        a, b = pair.members
        for s, t in ((0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)) if a != b else ():
            between = fields.positions(a, np.array([s]))[0] - fields.positions(b, np.array([t]))[0]
            apart = float(np.linalg.norm(between))
            joined = self._scene.members[a].nodes[int(s)] == self._scene.members[b].nodes[int(t)]
            if apart < pair.distance + self._reach and not joined:
                yield Near(pair.contact, pair.members, (s, t), between / apart, apart - pair.distance, pair.distance)
        for members in ((a, b), (b, a)) if a != b else ((a, b),):
            yield from self.closest.beside(fields, replace(pair, members=members), np.array([0.0, 1.0]), self._reach)

    def _approach(self, fields: Fields, near: Near) -> Approach | None:
        """The row of a place where members are near; None where something beside it is nearer, or all is as near."""
        # What is held comes first.
        i, k = sorted((0, 1), key=lambda side: near.at[side] not in (0.0, 1.0))
        members, at = (near.members[i], near.members[k]), (near.at[i], near.at[k])
        held = at[0] in (0.0, 1.0), at[1] in (0.0, 1.0)
        slope, h = self.closest.half_square(fields, members, at)
        crossing = np.linalg.det(h) > PARALLEL * h[0, 0] * h[1, 1]
        if not any(held) and not crossing:
            return None
        if any(held) and crossing:
            free = np.array(at) - np.linalg.solve(h, slope) / [self.closest.lengths[m] for m in members]
            if all(EDGE < x < 1.0 - EDGE for x, one in zip(free, held, strict=True) if one):
                return None
        elements = []
        for member, x in zip(members, at, strict=True):
            cuts = fields.model.mesh.cuts[member]
            inside = int(np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2))
            elements.append(0 if self._scene.members[member].type == "rigid" else inside)
        return Approach(near.contact, members, (elements[0], elements[1]), at, held, near.distance)

    def _refuse_deep(self, near: Near, memory: Memory) -> None:
        """Refuse members that penetrate each other at the begin, or later where something has gone wrong."""
        if near.gap >= -DEEP * near.distance:
            return
        (a, b), (s, t), seconds = near.members, near.at, memory.t * self._mover.time
        detail = f"members {a!r} and {b!r} penetrate by {-near.gap:.3g} m at {s:.4g} and {t:.4g} of their lengths"
        if memory.t == 0.0:
            raise SceneError(f"{detail} at t = 0, accepted: members that do not", ("contacts", near.contact))
        raise SolveError(Status.STOPPED, f"at {seconds:.9g} s {detail}", memory)

    def _fields(self, memory: Memory) -> Fields:
        """The centre lines at a state."""
        equations, system = self._mover.free, self._mover.inertia.system
        state = system.state_of(equations.model, State(memory.q, memory.y, np.zeros(0), memory.unwrapped))
        return Fields(equations, state, system.loading_of(equations.model, memory.t))

    # -- in time --------------------------------------------------------------------------------------

    def watching(self, stepper: Stepper, span: float, late: float) -> Events:
        """What finds the events in the present system; it goes on from the last one."""
        self._events = Events(stepper, span, late, self._events)
        return self._events

    def longest(self, memory: Memory) -> float:
        """The longest step from a state in which nothing can be touched that has no row."""
        speed = float(np.linalg.norm(self._relative(memory.rates[0]), axis=1).max(initial=0.0))
        return STRIDE * self._reach / self._mover.model.scales.length / max(speed, TINY)

    def far(self, taken: Taken) -> bool:
        """Whether members have moved so far in a step that some without a row may have touched or passed each other."""
        moved = self._relative(taken.after.position) - self._relative(taken.begin.position)
        length = float(np.linalg.norm(moved, axis=1).max(initial=0.0)) * self._mover.model.scales.length
        # A step at constant speed is not refused for rounding.
        return length > 1.25 * STRIDE * self._reach

    def within(self, taken: Taken) -> Passed | None:
        """What happens first in a step; after it the rows may have come to an end."""
        assert self._events is not None
        left, flagged = self._left(taken)
        if left is not None:
            (taken,) = self._events.advanced(taken, left)
        passed = self._events.within(taken)
        steps, after = ([taken], taken.after) if passed is None else (passed.steps, passed.after)
        if (passed is None and left is not None) or self._is_stale(after, flagged):
            self.over = after
            return Passed(steps, after, over=True)
        return passed

    def _is_stale(self, memory: Memory, flagged: bool) -> bool:
        """Whether other rows are needed in a state that is far from that of the last search, or where it is ``flagged``
        that one no longer holds.
        """
        moved = np.linalg.norm(self._relative(memory.position) - self._there, axis=1).max(initial=0.0)
        if moved * self._mover.model.scales.length < 0.125 * self._reach and not flagged:
            return False
        known, found = {near.key for near in self.system.model.mesh.approaches}, self._searched(memory).keys()
        return found != known if flagged else not found <= known

    def _left(self, taken: Taken) -> tuple[float | None, bool]:
        """Share of a step after which the first place of a row that acts leaves its element, None where none does; and
        whether one of another row has left it at the end.
        """
        beyond = self._beyond(taken.after)
        if not (beyond > 0.0).any():
            return None, False
        assert self._events is not None
        acts = [
            part.spot.key
            for part, one in zip(self.system.unilateral.parts, taken.begin.acting, strict=True)
            if one and isinstance(part.spot, Approach)
        ]
        own = np.array([near.key in acts for rows in self._rows for near in rows.approaches])
        if not (beyond[own] > 0.0).any():
            return None, True
        events = self._events

        def left(share: float) -> float:
            return float(self._beyond(events.at(taken, share))[own].max())

        low, high = 0.0, 1.0
        while high - low > WITHIN:
            share = 0.5 * (low + high)
            low, high = (low, share) if left(share) > 0.0 else (share, high)
        return high, False

    def _beyond(self, memory: Memory) -> Array:
        """As of :func:`_beyond`, of all rows."""
        places = self._places(memory.x)
        found = [_beyond(rows, memory.q, places, self.system.model) for rows in self._rows]
        return np.concatenate([np.zeros(0), *found])

    def _places(self, x: Array) -> Array:
        """Displacements or velocities (places, axes) of all places among those of the quantities."""
        axes, count = self.system.axes, len(self.system.model.segments.places)
        return x[: axes * count].reshape(count, axes)

    def _relative(self, x: Array) -> Array:
        """As of :meth:`_places`, over those of their mean, of the places of members."""
        model = self.system.model
        names = [i for i, name in enumerate(model.segments.places) if name not in model.segments.strained]
        places = self._places(x)[names]
        return np.asarray(places - places.mean(axis=0))


CLOSE = 1e-6
"""Opening, unit of length, up to which a row begins as one that acts."""


def _beyond(rows: Rows, q: Array, places: Array, model: Model) -> Array:
    """How far places (n,) are beyond where rows hold, fractions of elements; below zero where they do."""
    found = np.full(len(rows.approaches), -np.inf)
    nearest, free = rows.located(q, places)
    # A place beside one that is held is where it is, not where it would be if none were held.
    there = np.where([near.held for near in rows.approaches], free, nearest)
    for i, near in enumerate(rows.approaches):
        for member, e, at, held in zip(near.members, near.elements, there[i].tolist(), near.held, strict=True):
            rigid = model.scene.members[member].type == "rigid"
            last = 0 if rigid else len(model.mesh.cuts[member]) - 2
            if held:
                # Something between the ends is nearer.
                own = min(at, 1.0 - at) - EDGE
            else:
                own = max(-at - (MARGIN if e > 0 else EDGE), at - 1.0 - (MARGIN if e < last else EDGE))
            found[i] = max(found[i], own)
    return found
