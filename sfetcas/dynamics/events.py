"""Events of a motion with unilateral constraints: when they begin and cease to act, and what impacts do to velocities.

Each constraint has an opening, which is not below zero, and a force, which is not either; one of them is zero.
Between events the motion is that of a system in which the rows that act are constraints, and the others are absent.

- The force of a row falls through zero: it ceases to act.  Velocities do not change.
- The opening of a row falls through zero: an impact, see :mod:`~sfetcas.dynamics.impacts`.
- Friction that holds a place on an obstacle grows beyond what it can be: the place slides.
- The speed of a place that slides falls through zero: it sticks, or slides back.

After each of them the rows that stay closed are those whose forces are not below zero at once.  Of the places that rest
on obstacles with friction those stick whose friction is enough for it; the others slide the way in which they start.
Between the two is a gap: what slides must need more friction than there is by a share that is beyond rounding.

Times are those at which a step from the begin of the present one ends at zero, so that they are as accurate as steps
are.  Forces are multipliers of rows, whose order in the length of the step is less than that of positions; where they
decide they are those of a short step from there, from velocities that the rows allow.

Where impacts come ever closer, as between two rows at an acute angle, the rows stay closed once the way between two of
them is next to nothing.

Places of a flexible member that an obstacle stops hit it and leave it again and again as waves run to and fro.  There
what happens soon after another event is found at the end of a short step, all of it at once, if nothing is then further
inside an obstacle than is accepted: a row that acts stays at the value that it has.

Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts (1996).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..description.scene import Scene
from ..errors import SolveError, Status
from ..mathematics.arrays import TINY, Array
from ..mathematics.interpolation import evaluation
from ..mechanics.equations import State
from ..mechanics.mesh import Approach, Spot
from ..mechanics.rubbing import STILL, Rubs
from ..mechanics.spots import thinnest
from ..mechanics.unilateral import Unilateral
from .impacts import Collision, Impacts
from .integrating import SHORTEST, Passed, Stepper
from .sampling import turned_by
from .taken import Memory, Taken

__all__ = ["LOOKED", "TOGETHER", "Event", "Events"]


@dataclass(frozen=True)
class Event:
    """What happens to a row; everything is dimensionless.

    Attributes
    ----------
    t : float
    part : Unilateral
        What its row is.
    acts : bool
        Whether it acts from then on.
    impulse : float
        Along the row.
    lost : float
        The energy that all impulses of that time take away, at the largest of them; else zero.
    sticks : bool
        Whether it is not the row that begins or ceases to act, but what holds its place along the obstacle.
    """

    t: float
    part: Unilateral
    acts: bool
    impulse: float
    lost: float
    sticks: bool = False


@dataclass(frozen=True, eq=False)
class Soon:
    """What a short step says of the instant at its begin.

    Attributes
    ----------
    h : float
        Its length.
    forces, opened : ndarray (rows,)
        Forces of the rows just after its begin, and openings at its end.
    rounding : float
        What of forces is rounding.
    friction : ndarray (m, axes)
        Forces just after its begin that hold what sticks.
    spare : ndarray (m,)
        What friction could be more of what sticks; infinite of others.
    speeds : ndarray (m,)
        Speeds at its end of what slides, in the direction of sliding; infinite of others.
    """

    h: float
    forces: Array
    opened: Array
    rounding: float
    friction: Array
    spare: Array
    speeds: Array


class Events:
    """Finds the events within time steps, and the states after them.

    Parameters
    ----------
    stepper : Stepper
        Of a system with unilateral constraints.
    span : float
        Dimensionless time of the whole motion.
    late : float
        How far members may be inside obstacles where events follow each other quickly, unit of length.
    before : Events or None
        Those of the motion up to now, in a system with other rows between members.

    Attributes
    ----------
    found : list of Event
    """

    def __init__(self, stepper: Stepper, span: float, late: float = 0.0, before: Events | None = None) -> None:
        self.stepper, self.system, self._span = stepper, stepper.system, span
        parts, unit = stepper.system.unilateral.parts, stepper.system.model.scales.length
        self._of_obstacles = np.array([part.spot is not None for part in parts], bool)
        between = [part.spot.distance / unit if isinstance(part.spot, Approach) else np.inf for part in parts]
        self._late = np.minimum(late, INSIDE * np.array(between))
        # Hops that were no further than is accepted, one after the other, of each row beside members that may touch.
        self._patience, self._brief = np.where(np.isfinite(between), CALM, 0), np.zeros(len(parts), int)
        self._rocks, self._small = bool(np.isfinite(between).any()), np.zeros(len(parts), int)
        self._accepted = np.where(self._of_obstacles, late, 0.0)
        self._narrow = np.array([_narrowness(stepper.system.model.scene, part.spot) for part in parts]) / unit
        self.rows, self.signs = self.system.unilateral.rows, self.system.unilateral.signs
        self._impacts, self.found = Impacts(self.system), list[Event]()
        # When it happened last, how often at the same time before, and how often each row has closed then.
        self._offset, self._last, self._again = np.zeros(len(self.rows)), -np.inf, 0
        self._hops = np.zeros(len(self.rows), int)
        # When each row was hit last, and how far inside it was when it happened last.
        self._hit = np.full(len(self.rows), -1e300)
        self._depth = self._offset
        # The places that rub, and their rows.
        self._rubbing = self.system.rubbing
        self._rough = np.zeros(0, np.intp) if self._rubbing is None else self._rubbing.of
        # Times of events; times and speeds of the last impacts, of all rows and of each.
        self._times: list[float] = []
        self._hits: dict[int, list[tuple[float, float]]] = {}
        if before is not None:
            self.found, self._times = before.found, before._times
            self._last, self._again = before._last, before._again

    # -- begin ----------------------------------------------------------------------------------------

    def begun(self, memory: Memory, h: float) -> Memory:
        """The state after what happens at the begin, where the rows that it calls acting are those that touch.

        ``h`` is the expected length of a step.
        """
        touching = memory.acting > 0.0
        if not len(touching):
            return memory
        idle, known = replace(memory, acting=np.zeros(len(self.rows))), len(self.found)
        after = self._after(idle, touching, np.zeros(len(self.rows), bool), h)
        self.found[known:] = [event for event in self.found[known:] if event.impulse]
        return after

    def resumed(self, memory: Memory, h: float) -> Memory:
        """The state from which the motion goes on in a system with other rows, with those of them that act.

        What is closed but moves has yet to be hit, or leaves.
        """
        nothing, touching = np.zeros(len(self.rows), bool), memory.acting > 0.0
        if not touching.any():
            return memory
        touching &= np.abs(self._impacts.at(memory).speeds(nothing, touching)) < RESTS
        return self._after(replace(memory, acting=touching.astype(float)), nothing, nothing, h)

    def longest(self, memory: Memory) -> float:
        """No step is too long."""
        return np.inf

    def far(self, taken: Taken) -> bool:
        """No step goes too far."""
        return False

    # -- within a step --------------------------------------------------------------------------------

    def within(self, taken: Taken) -> Passed | None:
        """What happens first in a step that was taken; None where nothing does."""
        closing, released, halted = self._closing(taken), self._released(taken), self._halted(taken)
        known = [one for one in (closing, released, halted) if one is not None]
        if not known:
            return None
        share, nothing = min(known), np.zeros(len(self.rows), bool)
        if share == 1.0 and halted == 1.0:
            return Passed([taken], self._after(taken.after, nothing, nothing, taken.h))
        if (together := self._together(taken, share)) is not None:
            return together
        self._refuse_endless(taken.begin)
        steps = self.advanced(taken, share) if share * taken.h > SHORTEST else []
        memory = steps[-1].after if steps else taken.begin
        acting = memory.acting > 0.0
        if halted is not None and share == halted:
            return Passed(steps, self._after(memory, nothing, nothing, taken.h))
        if released is None or share < released:
            # What closes within a step that is too short closes at once.
            ahead = memory if steps else self.advanced(taken, max(share, SHORTEST / taken.h))[-1].after
            opened = np.where(acting, np.inf, self._openings(ahead))
            # The first of them, and those that close with it.
            closes = opened <= max(TOGETHER, float(opened.min()))
            return Passed(steps, self._after(memory, closes, nothing, taken.h))
        soon = self._soon(self._consistent(memory), self._length(taken.h))
        least = np.concatenate([np.where(acting, soon.forces, np.inf), soon.spare])
        # The first of them, and those that cease with it, as far as that is located.
        before = np.abs(taken.begin.lam[self.rows]).max(initial=0.0)
        first = least <= least.min() + soon.rounding + RELEASED_WITH * before
        ceases, slips = first[: len(acting)], first[len(acting) :]
        return Passed(steps, self._after(memory, nothing, ceases, taken.h, slips))

    def _together(self, taken: Taken, share: float) -> Passed | None:
        """All that happens shortly after another event, at the end of a short step; None where that would be too late.

        ``share`` of the step that was taken is that after which the first of it happens.
        """
        if not self._of_obstacles.any():
            return None
        begin, first = taken.begin, taken.begin.t + share * taken.h - self._last
        # What is as deep as it may be goes no further, but creeps.
        deepest = np.maximum(self._late, self._depth + CREEPING * self._late)
        allowed = np.where(self._of_obstacles, deepest, TOGETHER)
        for soon in SOON * self._span:
            if soon < max(first, self._last + SHORTEST - begin.t):
                return None
            steps = self.advanced(taken, min((self._last + soon - begin.t) / taken.h, 1.0))
            memory = steps[-1].after
            opened = self._opened(memory.q, memory.y, memory.t, memory)
            if (opened >= -allowed).all() and self._speed(memory) > -BACK:
                break
        else:
            return None
        acting = memory.acting > 0.0
        closes = ~acting & (opened + self._offset < TOGETHER)
        ceases = np.zeros(len(acting), bool)
        if acting.any():
            now = self._soon(self._consistent(memory), self._length(taken.h))
            ceases = acting & (now.forces < -now.rounding)
        return Passed(steps, self._after(memory, closes, ceases, taken.h))

    def at(self, taken: Taken, share: float) -> Memory:
        """The state after a share of a step that was taken."""
        if share == 1.0 and self.stepper.method.stages > 1:
            return taken.after
        return self.advanced(taken, share)[-1].after if share * taken.h > SHORTEST else taken.begin

    def _refuse_endless(self, memory: Memory) -> None:
        """Refuse events that follow each other without an end of them in sight."""
        self._times.append(memory.t)
        if len(self._times) > MOST and memory.t - self._times[-MOST - 1] < BRIEF * self._span:
            seconds = memory.t * self.stepper.time
            names = ", ".join(dict.fromkeys(event.part.where for event in self.found[-MOST:]))
            detail = f"at {seconds:.9g} s one impact or release follows another, {MOST} of them, of {names}"
            # It knows no strings and stops.
            detail += ": 'stepping' takes many at once" if self._of_obstacles.all() else ""
            raise SolveError(Status.STOPPED, detail, memory)

    def _ebbing(self, t: float, speeds: Array) -> Array:
        """Rows (rows,) whose impacts are some of infinitely many that come ever closer: these stay closed.

        Those are impacts of one row, or of several between which something goes to and fro.
        """
        hit = speeds > 0.0
        if not hit.any():
            return hit
        if self._ebbs(ANY, t, float(speeds.max())):
            return hit
        own = [bool(hit[i]) and self._ebbs(i, t, float(speeds[i])) for i in range(len(hit))]
        return np.array(own)

    def _ebbs(self, row: int, t: float, speed: float) -> bool:
        """Whether an impact of a row, or of any, is the last of a series that counts."""
        hits = self._hits[row] = [*self._hits.get(row, [])[-REPEATED:], (t, speed)]
        times, speeds = np.array(hits).T
        falling = len(speeds) > REPEATED and bool((np.diff(speeds) < 0.0).all() and (np.diff(times, 2) < 0.0).all())
        return falling and speed * (times[-1] - times[-2]) < EBBED

    def advanced(self, taken: Taken, share: float) -> list[Taken]:
        """Steps from the begin of one that was taken over a share of it.

        Of a method with one stage it takes several, between which the motion can be interpolated.
        """
        count = 1 if self.stepper.method.stages > 1 else PARTS
        memory, steps = taken.begin, list[Taken]()
        for _ in range(count):
            steps.append(self.stepper.step(memory, share * taken.h / count))
            if not steps[-1].converged:
                seconds = taken.begin.t * self.stepper.time
                raise SolveError(Status.STOPPED, f"no event could be located after {seconds:.9g} s", taken.begin)
            memory = steps[-1].after
        return steps

    def _closing(self, taken: Taken) -> float | None:
        """Share of a step after which the first row closes; None where none does."""
        idle = taken.begin.acting == 0.0
        if not idle.any():
            return None
        shares, values = self._course(taken)
        missing = (values[:, idle] + self._offset[idle] + ROUNDING).min(axis=1)
        if missing[0] < 0.0:
            return 0.0
        nearest = self._dips(taken, shares, missing, idle)
        if nearest is None:
            return None

        def left(share: float) -> float:
            return float((self._openings(self.at(taken, share))[idle] + ROUNDING).min())

        low = 0.0
        for high in (*nearest, *shares[shares > nearest[-1]].tolist()):
            if left(high) < 0.0:
                return _root(left, low, high, XTOL) if left(low) > 0.0 else low
            low = high
        return None

    def _dips(self, taken: Taken, shares: Array, missing: Array, idle: Array) -> list[float] | None:
        """Shares of a step between which the first row closes, as interpolated; the begin is left out."""
        for k in range(1, len(shares)):
            if missing[k] < 0.0:
                return [*([shares[k - 1]] if k > 1 else []), shares[k]]
            if k < len(shares) - 1 and missing[k] < missing[k - 1] and missing[k] <= missing[k + 1]:
                # Between three of them the parabola through them says where it is least.
                at = _lowest(shares[k - 1 : k + 2], missing[k - 1 : k + 2])
                lowest = self._interpolated(taken, at)[idle] + self._offset[idle] + ROUNDING
                if lowest.min() < 0.0:
                    return [shares[k - 1], at] if k > 1 else [at]
        return None

    def _course(self, taken: Taken) -> tuple[Array, Array]:
        """Shares of a step (n,), and the interpolated openings (n, rows) there; nearer to each other where a place may
        have gone through something round.
        """
        shares, found = LOOKED, [self._interpolated(taken, share) for share in LOOKED[:-1].tolist()]
        values = np.array([*found, self._opened(taken.after.q, taken.after.y, taken.after.t, taken.after)])
        round_ones = np.flatnonzero(np.isfinite(self._narrow) & (taken.begin.acting == 0.0))
        for _ in range(FINER if len(round_ones) else 0):
            own, lengths = values[:, round_ones], np.diff(shares)[:, None]
            # No place moves faster than the fastest distance says, but for what it does across.
            moves = ACROSS * (np.abs(np.diff(own, axis=0)) / lengths).max(axis=0) * lengths
            through = (own[:-1] > 0.0) & (own[1:] > 0.0) & (own[:-1] + own[1:] < moves)
            between = np.flatnonzero((through & (moves > HIDDEN * self._narrow[round_ones])).any(axis=1))
            if not len(between):
                break
            middle = 0.5 * (shares[between] + shares[between + 1])
            more = np.array([self._interpolated(taken, share) for share in middle.tolist()])
            shares, values = np.insert(shares, between + 1, middle), np.insert(values, between + 1, more, axis=0)
        return shares, values

    def _interpolated(self, taken: Taken, share: float) -> Array:
        """The openings (rows,) at a share of a step, see :meth:`interpolated`."""
        there = self.interpolated(taken, share)
        return self._opened(there.q, there.y, there.t, there)

    @staticmethod
    def interpolated(taken: Taken, share: float) -> Memory:
        """The places at a share of a step, by the polynomial through its stages; all else is as at its begin."""
        begin, last = taken.begin, taken.begin.last
        nodes = np.array([0.0, *taken.places])
        parts = [taken.turns, taken.shifts, taken.x - begin.x]
        parts = [np.concatenate([np.zeros((1, *part.shape[1:])), part]) for part in parts]
        if len(taken.places) == 1 and last is not None:
            # One stage alone makes a line.
            nodes = np.array([-last.h / taken.h, *nodes])
            before = last.turns[-1:], last.shifts[-1:], last.x[-1:] - last.x[0]
            parts = [np.concatenate([-one, part]) for one, part in zip(before, parts, strict=True)]
        row = evaluation(nodes, np.array([share]))[0]
        turned, shift, moved = (np.einsum("n,n...->...", row, part) for part in parts)
        q = turned_by(begin.q, turned)
        return replace(begin, t=begin.t + share * taken.h, q=q, y=begin.y + shift, x=begin.x + moved)

    def _released(self, taken: Taken) -> float | None:
        """Share of a step after which the first row ceases to act; None where none does."""
        begin, h = taken.begin, taken.h
        acting = begin.acting > 0.0
        if not acting.any():
            return None
        at_stages = (self.signs * taken.lam[:, self.rows])[:, acting]
        before = (self.signs * begin.lam[self.rows])[acting]
        if begin.rubs is not None:
            spare = np.array([self._spare(begin, lam)[0] for lam in (*taken.lam, begin.lam)])
            spare = spare[:, begin.rubs.sticks > 0.0]
            at_stages, before = np.hstack([at_stages, spare[:-1]]), np.append(before, spare[-1])
        # Forces of stages are not as accurate as what decides: it is asked for also where they only come near to zero.
        doubtful = [
            float(place)
            for place, forces in zip(taken.places, at_stages, strict=True)
            if (forces < 0.0).any() or (place == 1.0 and (2.0 * forces < before).any())
        ]

        def left(share: float) -> float:
            return self._least(self.at(taken, share), h)

        for share in doubtful:
            if left(share) < 0.0:
                return _root(left, 0.0, share, RELEASED) if left(0.0) > 0.0 else 0.0
        return None

    def _least(self, memory: Memory, h: float) -> float:
        """The least force of a row that acts, over that which is rounding, or the least that friction has to spare."""
        soon = self._soon(self._consistent(memory), self._length(h))
        return min(float(soon.forces[memory.acting > 0.0].min()), float(soon.spare.min(initial=np.inf))) + soon.rounding

    def _spare(self, memory: Memory, lam: Array) -> tuple[Array, Array]:
        """What friction could be more of what sticks (m,), infinite of others, and what it is (m, axes)."""
        if self._rubbing is None or memory.rubs is None:
            return np.zeros(0), np.zeros((0, 0))
        friction = -np.einsum("mka,mk->ma", memory.rubs.frames, lam[self._rubbing.rows] * memory.rubs.holds)
        most = -self._rubbing.coefficients * lam[self._rubbing.gaps]
        spare = (1.0 + GAP) * most - np.linalg.norm(friction, axis=1)
        return np.where(memory.rubs.sticks > 0.0, spare, np.inf), friction

    def _speeds(self, memory: Memory) -> Array:
        """Speeds (m,) of what slides, in the direction of sliding; infinite of others."""
        if self._rubbing is None or memory.rubs is None:
            return np.zeros(0)
        u, v = self._rubbing.displacements(memory.y), self._rubbing.of_quantities(memory.rates[0])
        _, speeds = self._rubbing.directions(u, v, memory.rubs.ways)
        return np.where(memory.rubs.slides > 0.0, speeds, np.inf)

    def _speed(self, memory: Memory) -> float:
        return float(self._speeds(memory).min(initial=np.inf))

    def _halted(self, taken: Taken) -> float | None:
        """Share of a step after which the first place that slides stands still; None where none does.

        All of it where one has drifted that sticks and that no row held.
        """
        rubs = taken.begin.rubs
        if rubs is None or self._rubbing is None:
            return None
        if not rubs.slides.any() or self._speed(taken.after) >= -BACK:
            return 1.0 if rubs.drifted(self._rubbed_at(taken.after)) > DRIFTED else None
        # What begins to slide has no speed yet.
        begun = BACK if self._speed(taken.begin) <= BACK else 0.0

        def left(share: float) -> float:
            return self._speed(self.at(taken, share)) + begun

        if left(0.0) <= 0.0:
            return 0.0
        try:
            return _root(left, 0.0, 1.0, XTOL)
        except SolveError:
            return self._halting(taken)

    def _halting(self, taken: Taken) -> float:
        """As :meth:`_halted`, where the direction of sliding swings round too fast beside rest for steps to end there.

        What begins there is slower, and has shorter steps.
        """
        low, high = 0.0, 1.0
        while high - low > XTOL:
            share = 0.5 * (low + high)
            try:
                speed = self._speed(self.at(taken, share))
            except SolveError:
                speed = -np.inf
            low, high = (share, high) if speed > 0.0 else (low, share)
            if 0.0 < speed <= STILL:
                break
        return low

    # -- states ---------------------------------------------------------------------------------------

    def _after(self, memory: Memory, closes: Array, ceases: Array, h: float, slips: Array | None = None) -> Memory:
        """The state after an event at which rows close or cease to act, both (rows,) of bool.

        ``slips`` (m,) of bool are the places that stick no longer.
        """
        before = memory.acting > 0.0
        collision = self._impacts.at(memory)
        self._again = self._again + 1 if memory.t == self._last else 0
        # What closes again and again at one time hops for less than the shortest step.
        speeds = collision.speeds(before, closes)
        self._hops = np.where(closes, self._hops + 1, self._hops) if self._again else closes.astype(int)
        ebbing = self._ebbing(memory.t, speeds)
        ebbed = ebbing | (closes & (self._hops > HOPS))
        # What has hopped no further than is accepted does not rebound once more; between members, which may lie along
        # each other and hit with one end after the other, not for ever.
        hop = speeds * (memory.t - self._hit)
        self._brief = np.where(speeds > 0.0, np.where(hop < self._late, self._brief + 1, 0), self._brief)
        quiet = ebbed | (self._of_obstacles & (speeds > 0.0) & (self._brief > self._patience))
        if self._rocks:
            self._small = np.where(speeds > 0.0, np.where(hop < self._accepted, self._small + 1, 0), self._small)
            quiet |= closes & (self._small > CALM)
        self._hit = np.where(speeds > 0.0, memory.t, self._hit)
        # What goes back and forth between rows for ever rests on all of them.
        rests = closes & ((ebbing & (speeds < RESTS)) | (self._hops > ENDLESS))
        velocity, impulses, touching, lost = collision.solved(before | rests, closes & ~rests, quiet)
        lost += collision.held_back(before, rests)
        opened = self._opened(memory.q, memory.y, memory.t, memory)
        self._depth = np.maximum(-opened, 0.0)
        self._offset, self._last = self._depth.copy(), memory.t
        there = replace(memory, rates=_with_velocity(memory.rates, velocity), last=None, lost=memory.lost + lost)
        there = replace(there, held=-self.signs * opened)
        there, still = self._resting(there, touching, slips)
        acting, lam, rubs = self._settled(there, touching & ~ceases, touching, h, still)
        there = replace(there, acting=acting.astype(float), lam=lam, rubs=rubs)
        self._offset[acting] = 0.0
        hardest = int(np.argmax(impulses))
        for i in np.flatnonzero((acting != before) | (impulses > 0.0)).tolist():
            own = lost if i == hardest else 0.0
            self.found.append(
                Event(memory.t, self.system.unilateral.parts[i], bool(acting[i]), float(impulses[i]), own)
            )
        if rubs is not None and memory.rubs is not None:
            changed = (rubs.sticks != memory.rubs.sticks) & acting[self._rough]
            for k in np.flatnonzero(changed).tolist():
                self.found.append(
                    Event(
                        memory.t,
                        self.system.unilateral.parts[self._rough[k]],
                        bool(rubs.sticks[k]),
                        0.0,
                        0.0,
                        sticks=True,
                    )
                )
        return there

    def _resting(self, memory: Memory, touching: Array, slips: Array | None) -> tuple[Memory, Array]:
        """The state with what is next to standing still at rest, and which places (m,) of bool that are.

        Those are to stick, as is told in the state, but for those that slip; the others slide.
        """
        if self._rubbing is None or memory.rubs is None:
            return memory, np.zeros(0, bool)
        rubs, rubbing, touches = memory.rubs, self._rubbing, touching[self._rough]
        u = self._rubbed_at(memory)
        along = rubbing.along(u, rubbing.of_quantities(memory.rates[0]))
        speeds = np.linalg.norm(along, axis=1)
        still = touches & (speeds <= STILL)
        velocity = self._impacts.at(memory).nearest(touching, still)
        ways = np.where((touches & ~still)[:, None], along / np.maximum(speeds, STILL)[:, None], rubs.ways)
        if slips is not None and slips.any():
            # It slides against the friction that has held it.
            _, friction = self._spare(memory, memory.lam)
            ways = np.where(slips[:, None], _against(friction), ways)
        # What has been held so far stays where it is.
        stays, fresh = still & (rubs.holds.all(axis=1)), rubbing.idle(u)
        frames = np.where(stays[:, None, None], rubs.frames, fresh.frames)
        held = np.where(stays[:, None], rubs.held, fresh.held)
        sticks = still if slips is None else still & ~slips
        slides = (touches & ~sticks).astype(float)
        found = Rubs(sticks.astype(float), slides, 0.0 * held, ways, frames, held)
        return replace(memory, rates=_with_velocity(memory.rates, velocity), rubs=found), still

    def _rubbed_at(self, memory: Memory) -> Array:
        """Displacements (m, axes) of the places that rub, relative to obstacles that move."""
        assert self._rubbing is not None
        return self._rubbing.displacements(memory.y, self.system.loading(self.system.factors(memory.t)).shift)

    def _settled(
        self, memory: Memory, acting: Array, touching: Array, h: float, still: Array
    ) -> tuple[Array, Array, Rubs | None]:
        """Which of the rows that touch act from now on, (rows,) of bool, all multipliers, and what sticks and slides.

        ``still`` (m,) of bool are the places that may stick.
        """
        if not touching.any():
            return acting, np.zeros(len(memory.lam)), memory.rubs
        collision = None
        if memory.rubs is not None:
            acting, touching = np.append(acting, memory.rubs.sticks > 0.0), np.append(touching, still)
            collision = self._impacts.at(memory)
        # Where it did not hold at this time in a longer step, a shorter one is asked.
        h = max(self._length(h) * SHORTER**self._again, SHORTEST / SHORTER)
        if self._rocks and memory.rubs is None:
            # Of many choices the one for accelerations is right, or nearly so.
            idle = self._soon(replace(memory, acting=np.zeros(len(acting))), h)
            acting = self._impacts.at(memory).pressing(touching, 2.0 * idle.opened / idle.h**2)
        best, least = acting, len(acting) + 1
        while h > SHORTEST:
            tried: set[bytes] = set()
            now, fewest, patience = acting, len(acting) + 1, PATIENCE
            while now.tobytes() not in tried and len(tried) < TRIED * int(touching.sum()) + TRIED:
                tried.add(now.tobytes())
                wrong, lam, memory = self._tried(memory, now, touching, h, collision)
                if lam is not None:
                    return now[: len(self.rows)], lam, memory.rubs
                # All that is wrong is changed at once while less is wrong from time to time, then one row at a time.
                count = int(wrong.sum())
                best, least = (now, count) if count < least else (best, least)
                fewest, patience = (count, PATIENCE) if count < fewest else (fewest, patience - 1)
                now = now ^ (wrong if patience > 0 else np.arange(len(wrong)) == np.flatnonzero(wrong)[-1])
            # What goes from one choice to the next may go round: where there are few all are tried.
            for choice in _choices(touching):
                if choice.tobytes() in tried:
                    continue
                _, lam, memory = self._tried(memory, choice, touching, h, collision)
                if lam is not None:
                    return choice[: len(self.rows)], lam, memory.rubs
            # Waves that are shorter than the step make what is true at once untrue a little later.
            h *= SHORTER
        rows = touching[: len(self.rows)]
        if self._of_obstacles[rows].any():
            # Waves through places side by side: what is wrong is an event at once.
            chosen, rubs = self._chosen(memory, best, collision)
            return chosen, np.zeros(len(memory.lam)), rubs
        seconds = memory.t * self.stepper.time
        names = ", ".join(np.array(self.system.unilateral.names)[rows].tolist())
        raise SolveError(Status.STOPPED, f"at {seconds:.9g} s no choice of what acts holds, of {names}", memory)

    def _chosen(self, memory: Memory, choice: Array, collision: Collision | None) -> tuple[Array, Rubs | None]:
        """The rows (rows,) that act in a choice, of bool, and what sticks and slides."""
        acting, sticks = choice[: len(self.rows)], choice[len(self.rows) :]
        if memory.rubs is None or collision is None or self._rubbing is None:
            return acting, None
        pushed = acting[self._rough]
        sticks, slides = pushed & sticks, (pushed & ~sticks).astype(float)
        holds = collision.independent(acting, sticks, -memory.lam[self._rubbing.gaps])
        return acting, replace(memory.rubs, sticks=sticks.astype(float), slides=slides, holds=holds)

    def _tried(
        self, memory: Memory, choice: Array, touching: Array, h: float, collision: Collision | None
    ) -> tuple[Array, Array | None, Memory]:
        """What (rows + m,) a choice of rows that act and places that stick has wrong.

        Also all multipliers where there is nothing, and the state with the choice and the ways in which places would
        slide.
        """
        acting, rubs = self._chosen(memory, choice, collision)
        memory = replace(memory, acting=acting.astype(float), rubs=rubs)
        soon = self._soon(memory, h)
        wrong = np.where(acting, soon.forces < -soon.rounding, touching[: len(acting)] & (soon.opened < -ROUNDING))
        if rubs is not None and self._rubbing is not None:
            slips = soon.spare < -soon.rounding
            back = touching[len(acting) :] & (soon.speeds < -ROUNDED * float(np.finfo(float).eps) / h)
            wrong = np.concatenate([wrong, slips | back])
            # What does not hold slides against the friction that would.
            ways = np.where(slips[:, None], _against(soon.friction), rubs.ways)
            memory = replace(memory, rubs=replace(rubs, ways=ways))
        if wrong.any():
            return wrong, None, memory
        lam = np.zeros(len(memory.lam))
        lam[self.rows] = self.signs * np.where(acting, soon.forces, 0.0)
        if rubs is not None and self._rubbing is not None:
            lam[self._rubbing.rows] = -np.einsum("mka,ma->mk", rubs.frames, soon.friction) * rubs.holds
        return wrong, lam, memory

    def _consistent(self, memory: Memory) -> Memory:
        """The state with the nearest velocities that all acting rows allow."""
        acting = memory.acting > 0.0
        velocity = self._impacts.at(memory).nearest(acting)
        return replace(memory, rates=_with_velocity(memory.rates, velocity), last=None)

    @staticmethod
    def _length(h: float) -> float:
        """Length of a short step where steps have the length h."""
        return min(h, max(SHARE * h, LEAST))

    def _soon(self, memory: Memory, h: float) -> Soon:
        """What a short step from a state says; one that is so short that Newton's method converges."""
        short = self.stepper.starter
        fresh = replace(memory, last=None, rates=memory.rates[: short.method.kept])
        taken = short.step(fresh, h)
        while not taken.converged and h > SHORTEST:
            h *= SHORTER
            taken = short.step(fresh, h)
        if not taken.converged:
            seconds = memory.t * self.stepper.time
            raise SolveError(Status.STOPPED, f"Newton's method did not converge at {seconds:.6g} s", memory)
        lam = evaluation(taken.places, np.zeros(1))[0] @ taken.lam
        forces = self.signs * lam[self.rows]
        most = float(np.abs(forces * memory.acting).max(initial=0.0))
        rounding = float(np.finfo(float).eps) * ROUNDED / h**2 + RELATIVE * most
        spare, friction = self._spare(memory, lam)
        return Soon(h, forces, self._openings(taken.after), rounding, friction, spare, self._speeds(taken.after))

    def _openings(self, memory: Memory) -> Array:
        return self._opened(memory.q, memory.y, memory.t, memory) + self._offset

    def _opened(self, q: Array, y: Array, t: float, near: Memory) -> Array:
        """The openings (rows,) at a state; angles that count turns are those near a state."""
        return self.system.openings(State(q, y, near.lam, near.unwrapped), t)


def _narrowness(scene: Scene, spot: Spot | Approach | None) -> float:
    """Radius, m, of what is round and stops a place from outside; infinite of all else, which nothing goes through."""
    return thinnest([scene.obstacles[spot.contact]] if isinstance(spot, Spot) else [])


def _lowest(x: Array, y: Array) -> float:
    """Where the parabola through three points, of which the middle one is lowest, has its minimum."""
    before, after = x[1] - x[0], x[2] - x[1]
    falls, rises = (y[0] - y[1]) / before, (y[2] - y[1]) / after
    return float(x[1] + 0.5 * (falls * after - rises * before) / max(falls + rises, TINY))


def _root(function: Callable[[float], float], low: float, high: float, width: float) -> float:
    """Where a function changes its sign."""
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=width))


def _choices(touching: Array) -> Iterator[Array]:
    """All choices of rows that touch, those of most rows first; none where there are too many rows."""
    rows = np.flatnonzero(touching)
    for count in range(len(rows), -1, -1) if len(rows) <= FEW else ():
        for chosen in itertools.combinations(rows.tolist(), count):
            yield np.isin(np.arange(len(touching)), chosen)


def _against(friction: Array) -> Array:
    """Unit vectors (m, axes) against forces (m, axes), zero of those that are zero."""
    return np.asarray(-friction / np.maximum(np.linalg.norm(friction, axis=1, keepdims=True), 1e-300))


def _with_velocity(rates: Array, velocity: Array) -> Array:
    return np.vstack([velocity[None, :], rates[1:]])


SOON = 1e-3 * 0.25 ** np.arange(4)
"""Shares of the motion, the longest first, at whose end all is found together that follows an event."""

HOPS, ENDLESS = 4, 12
"""Times that a row closes at one time, after which it does not rebound, and after which it stays closed."""

RESTS = 1e-4
"""Speed of opening or closing, dimensionless, below which a row that is closed may act in place of another one: lines
beyond their elements differ by less; and below which what hops for less than the shortest step comes to rest.
"""

CALM = 3
"""Hops no further than is accepted, after which what rocks to and fro on other members and obstacles is at rest."""

CREEPING = 1e-3
"""Share of what is accepted by which a member may go further inside an obstacle from one event to the next."""

MOST, BRIEF = 200, 1e-3
"""Events that are too many within this share of the motion."""

PATIENCE = 3
"""Choices without one that has fewer rows wrong, after which one row is changed at a time.

Source: Judice and Pires, A block principal pivoting algorithm for large-scale strictly monotone linear complementarity
problems, Computers & Operations Research 21 (1994); one at a time, always the last, as Murty does.
"""

TRIED = 3
"""Choices that are tried at most for each row that touches."""

ANY = -1
"""In the place of a row: any of them."""

FEW = 5
"""Rows that touch at one time of which all choices are tried."""

REPEATED, EBBED = 4, 1e-8
"""Impacts, each weaker and sooner than the one before, and the way between them, unit of length or rad, at which
they are over.
"""

PARTS = 4
"""Steps of a method with one stage up to an event."""

LOOKED = np.linspace(0.0, 1.0, 9)
"""Shares of a step at which openings, and places, are looked at."""

FINER, ACROSS, HIDDEN = 10, 1.5, 0.5
"""Times that parts of a step are halved in which a place may have gone through something round; its largest speed over
that with which its distance changes; share of the radius beyond which what is round may be hidden in such a part.
"""

ROUNDING = 1e-12
"""Of openings, unit of length or rad."""

INSIDE = 1e-6
"""Share of the distance of touching centre lines by which members may be inside each other where events follow each
other quickly.
"""

TOGETHER = 1e-9
"""Opening, unit of length or rad, up to which a row closes at the same time as another one."""

XTOL, RELEASED = 1e-13, 1e-7
"""Shares of a step to which an impact is located, and a release: the force being near zero, that errs by their cube."""

RELEASED_WITH = 10.0 * RELEASED
"""Share of the force at the begin of a step by which others that cease with the first may be above it."""

SHARE, LEAST, SHORTER = 0.05, 3e-4, 0.2
"""Share of a step in which forces are found, its least length, dimensionless, for the sake of rounding, and by what it
is shorter where they tell nothing.
"""

ROUNDED, RELATIVE = 10.0, 1e-9
"""Forces that are rounding: rounding of places over the square of the step, and the share of the largest force."""

GAP = 1e-6
"""Share by which friction may be larger than it can before what sticks slides: beyond what rounding decides."""

DRIFTED = 1e-7
"""Unit of length by which what sticks may move, where what it is connected with seemed to hold it."""

BACK = 1e-8
"""Speed against the direction of sliding, dimensionless, at which what slides has come to rest."""
