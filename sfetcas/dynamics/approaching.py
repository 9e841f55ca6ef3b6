"""Members that come near to each other in a motion: which rows there are, followed from one set of them to the next.

A system has a row for each two places that are nearest to each other and nearer than a reach.  Within that system
impacts, contact and release are those of all unilateral constraints, see :mod:`~sfetcas.dynamics.events`.  The system
is made anew with other rows, and the motion goes on in it from the same state, where

- a search finds members near to each other without a row; from one search to the next no member moves by half the
  room, the distance within which all have rows, so that what has no row yet is never touched;
- a place goes from one element to another, or to the end of its member, or leaves this end: that is located in the
  step.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..contact.closest import Closest
from ..contact.pairs import Near, Pair, penetrating
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.clearances import PARALLEL, Rows
from ..mechanics.equations import State
from ..mechanics.fields import Fields
from ..mechanics.mesh import Approach
from ..mechanics.model import Model
from .events import LOOKED, Events
from .integrating import SHORTEST, Passed, Stepper
from .motion import Mover
from .stages import StageEquations
from .taken import Memory, Taken

__all__ = ["Approaching"]

REACH = 4.0
"""Distance of surfaces at which members have a row, over the largest sum of radii."""

STRIDE = 0.25
"""How far members move in a step, over the room: two that had no row before it are then apart after it."""

WIDER = 2.0
"""How far is searched, over the room that was found before: where little is near, what is far is not looked for."""

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
        # How far members have to move, m, until something may touch that has no row; how far the next search goes.
        self._room = self._wide = self._reach
        self.system = mover.inertia.system
        self.over: Memory | None = None
        # The rows, and their numbers among those of the mesh.
        self._rows: list[Rows] = []
        self._order: list[int] = []
        self._events: Events | None = None
        self._there = np.zeros(0)

    # -- rows -----------------------------------------------------------------------------------------

    def renewed(self, memory: Memory) -> Memory:
        """The state in the system with the rows of what is near; those act that acted, or one in the place of each."""
        before = self.system
        acted = [
            part.spot
            for part, acts in zip(before.unilateral.parts, memory.acting, strict=True)
            if isinstance(part.spot, Approach) and acts
        ]
        found = self._searched(memory)
        self.system = self._build(tuple(found.values()))
        self._rows, self.over = list(Rows.of(self.system.model.connections, self.system.model.mesh)), None
        known = [near for rows in self._rows for near in rows.approaches]
        self._order = [known.index(near) for near in self.system.model.mesh.approaches]
        rows, kept = self.system.unilateral, len(before.unilateral) - len(before.model.mesh.approaches)
        lam = np.zeros(self.system.layout.lam)
        own = len(memory.lam) - len(before.model.mesh.approaches)
        lam[:own] = memory.lam[:own]
        acting, holding = np.zeros(len(rows)), np.zeros(len(rows))
        acting[:kept], holding[:kept] = memory.acting[:kept], memory.held[:kept]
        opened = self.system.openings(State(memory.q, memory.y, lam, memory.unwrapped), memory.t)
        on = self._going_on(acted, opened[kept:]) if memory.t > 0.0 else np.flatnonzero(opened[kept:] <= CLOSE)
        acting[kept + on] = 1.0
        holding[kept + on] = -rows.signs[kept + on] * opened[kept + on]
        return replace(memory, lam=lam, acting=acting, held=holding, last=None, unilateral=rows)

    def _going_on(self, acted: list[Approach], opened: Array) -> Index:
        """Numbers of the present rows that go on where others acted; ``opened`` (rows,) is how far they are open."""
        rows = self.system.model.mesh.approaches
        known = [near.key for near in rows]
        found = [known.index(near.key) for near in acted if near.key in known]
        for gone in (near for near in acted if near.key not in known):
            beside = [
                i
                for i, near in enumerate(rows)
                if i not in found and (near.contact, {*near.members}) == (gone.contact, {*gone.members})
            ]
            found += [i for i in sorted(beside, key=lambda i: abs(opened[i])) if opened[i] <= CLOSE][:1]
        return np.array(found, np.intp)

    def _searched(self, memory: Memory) -> dict[object, Approach]:
        """The rows of what is near in a state, by their keys."""
        self._there = self._relative(memory.position)
        fields, found = self._fields(memory), dict[object, Approach]()
        all_found = self.closest.found(fields, self._wide, self._between)
        free = min((near.gap for near in all_found), default=np.inf)
        self._room = max(min(self._wide, free), self._reach)
        self._wide = self._reach if free <= self._reach else max(min(WIDER * self._room, self._scene.size), self._reach)
        for near in all_found:
            if near.gap >= self._reach:
                continue
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
        seconds, detail = memory.t * self._mover.time, penetrating(near.members, near.at, -near.gap)
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
        return STRIDE * self._room / self._mover.model.scales.length / max(speed, TINY)

    def far(self, taken: Taken) -> bool:
        """Whether members have moved so far in a step that some without a row may have touched or passed each other."""
        begin, unit = self._relative(taken.begin.x), self._mover.model.scales.length
        # What turns round is back at the end of a step.
        moved = [np.linalg.norm(self._relative(x) - begin, axis=1).max(initial=0.0) for x in taken.x]
        # A step at constant speed is not refused for rounding.
        return float(max(moved)) * unit > 1.25 * STRIDE * self._room

    def within(self, taken: Taken) -> Passed | None:
        """What happens first in a step; after it the rows may have come to an end."""
        assert self._events is not None
        left, acts = self._left(taken)
        cut = left is not None and left < 1.0
        if left is not None and cut:
            (taken,) = self._events.advanced(taken, left)
        # What sweeps over all of a member within the shortest step is told by the next rows.
        passed = None if cut and not acts and taken.h <= SHORTEST else self._events.within(taken)
        steps, after = ([taken], taken.after) if passed is None else (passed.steps, passed.after)
        if (passed is None and acts) or self._is_stale(after):
            self.over = after
            return Passed(steps, after, over=True)
        return Passed(steps, after) if cut else passed

    def _is_stale(self, memory: Memory) -> bool:
        """Whether other rows are needed in a state that is far from that of the last search, or where one of the
        present ones no longer holds.
        """
        left = (self._beyond(memory)[0] > 0.0).any()
        moved = np.linalg.norm(self._relative(memory.position) - self._there, axis=1).max(initial=0.0)
        if moved * self._mover.model.scales.length < 0.125 * self._room and not left:
            return False
        known, found = {near.key for near in self.system.model.mesh.approaches}, self._searched(memory).keys()
        return found != known if left else not found <= known

    def _left(self, taken: Taken) -> tuple[float | None, bool]:
        """Share of a step after which the first place of a row leaves its element, None where none does; and whether
        it is one of a row that acts, of which that is located.
        """
        assert self._events is not None
        at, there = self._events.at, functools.partial(self._events.interpolated, taken)
        before, beside = self._beyond(taken.begin)
        acts = taken.begin.acting[len(taken.begin.acting) - len(before) :] > 0.0
        for low, high in pairwise(LOOKED.tolist()):
            beyond, now = self._beyond(taken.after if high == 1.0 else there(high))
            if (beyond[acts] > 0.0).any():
                return self._located(functools.partial(at, taken), acts, low, high), True
            # What is beyond from the begin is so by rounding.
            idle = (beyond > 0.0) & (before <= 0.0)
            if idle.any():
                share = self._located(there, idle, low, high)
                return min(max(share, SHORTEST / taken.h), 1.0), False
            passed = np.asarray(beside * now < 0.0).any(axis=1)
            swept = self._passing(taken, np.flatnonzero(passed), beside, low, high) if passed.any() else None
            if swept is not None:
                return swept, False
            beside = now
        return None, False

    def _located(self, there: Callable[[float], Memory], rows: Array, low: float, high: float) -> float:
        """Share of a step, between two of them, after which the first place of some rows leaves its element."""
        while high - low > WITHIN:
            share = 0.5 * (low + high)
            left = (self._beyond(there(share))[0][rows] > 0.0).any()
            low, high = (low, share) if left else (share, high)
        return high

    def _passing(self, taken: Taken, rows: Index, beside: Array, low: float, high: float) -> float | None:
        """Share of a step at which members are nearest between ends beside which some rows are, before and after it.

        None where there is none: what turns through the parallel in a plane is nearest at one end, then at the other.
        """
        assert self._events is not None
        while high - low > WITHIN:
            share = 0.5 * (low + high)
            beyond, now = self._beyond(self._events.interpolated(taken, share))
            if (beyond[rows] > 0.0).any():
                return share
            low, high = (low, share) if (beside * now < 0.0)[rows].any() else (share, high)
        return None

    def _beyond(self, memory: Memory) -> tuple[Array, Array]:
        """As of :func:`_beyond`, of all rows."""
        places, found = self._places(memory.x), [(np.zeros(0), np.zeros((0, 2)))]
        found += [_beyond(rows, memory.q, places, self.system.model) for rows in self._rows]
        beyond, beside = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return beyond[self._order], beside[self._order]

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


def _beyond(rows: Rows, q: Array, places: Array, model: Model) -> tuple[Array, Array]:
    """How far places (n,) are beyond where rows hold, fractions of elements; below zero where they do.

    Also beside which end (n, 2) of the members they would be if none were held: -1 before it, 1 behind it, else 0.
    """
    found, beside = np.full(len(rows.approaches), -np.inf), np.zeros((len(rows.approaches), 2))
    nearest, free = rows.located(q, places)
    # A place beside one that is held is where it is, not where it would be if none were held.
    there = np.where([near.held for near in rows.approaches], free, nearest)
    for i, near in enumerate(rows.approaches):
        sides = zip(near.members, near.elements, there[i].tolist(), near.held, strict=True)
        for side, (member, e, at, held) in enumerate(sides):
            rigid = model.scene.members[member].type == "rigid"
            last = 0 if rigid else len(model.mesh.cuts[member]) - 2
            if held:
                # Something between the ends is nearer.
                own = min(at, 1.0 - at) - EDGE
                beside[i, side] = 0.0 if own > 0.0 else np.sign(at - 0.5)
            else:
                own = max(-at - (MARGIN if e > 0 else EDGE), at - 1.0 - (MARGIN if e < last else EDGE))
            found[i] = max(found[i], own)
    return found, beside
