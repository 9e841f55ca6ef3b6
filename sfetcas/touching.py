"""Equilibria in contact: which places of members touch which obstacles, and where exactly.

1. *Settling*: with a given set of touches the equilibrium is solved with each place held, and the places follow from
   their conditions by Newton's method (differences once, then Broyden's updates).
2. *Which touches*: what gets inside an obstacle begins to touch it, what would be pulled leaves it, a place that the
   member penetrates beside becomes a stretch, a stretch without length a place, until nothing is wrong.
3. *Following*: both along a way of loads or of obstacles that come to their places, from a state whose touches are
   known, so that the answer is the one that this way leads to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .arrays import Array
from .equations import Equations, State
from .errors import SolveError, Status
from .fields import transferred
from .loading import Loading
from .mesh import SAME, Mesh, Touch, breaks_of
from .model import Model
from .newton import Corrected
from .obstacles import members_of, obstacle, takes_part
from .prepared import Prepared
from .scene import Scene
from .touches import Gap, Touched, obstacles_of

__all__ = ["Held", "Toucher", "Way", "can_leave", "placed"]

NEAR = 0.35
"""Cuts nearer to a place of contact than this share of their element make way for it."""

APART = 1e-7
"""Places nearer to each other, or to the end of a member, are the same: fractions of the length."""

SETTLED = 1e-11
"""Steps of places shorter than this have arrived: fractions of the length."""

FLAT = 1e-7
"""Curvature of a gap (times the length of the scene) below minus this gets inside: rounding of moments is less."""

MOST_TURN = 0.8
"""A step along the way is too long when its corrections turn a node by more, rad."""

CHANGES = 24
"""Changes of what touches at one point of the way before the step is taken to be too long."""

SHORTEST = 2e-5, 5e-4
"""First and later steps below this part of the way end the search."""

SNAP = 2e-3
"""Part of the way beyond a limit point at which a state is left for another."""

MOST_SNAPS = 4
"""Snaps on one way."""

MOST_SOLVES = 800
"""Equilibria with places held that are solved on one way."""

TRIES = 60
"""Steps tried before giving up."""


@dataclass(frozen=True)
class Held:
    """An equilibrium in contact; ``slopes`` is the derivative of the conditions by the places."""

    prepared: Prepared
    corrected: Corrected
    loading: Loading
    touched: Touched
    slopes: Array | None = None

    @property
    def mesh(self) -> Mesh:
        """The mesh with its touches."""
        return self.prepared.model.mesh


@dataclass(frozen=True)
class Way:
    """A point of a way: the loading of a model there, and how far obstacles have stepped back, m."""

    loading: Callable[[Model], Loading]
    offsets: Mapping[str, float]


@dataclass(frozen=True)
class _Change:
    """Another set of touches to try."""

    touches: tuple[Touch, ...]


def placed(scene: Scene, base: Mesh, touches: tuple[Touch, ...]) -> Mesh:
    """A mesh with an element border at each place of contact; cuts that are too near make way."""
    cuts = dict(base.cuts)
    for name in {touch.member for touch in touches}:
        places = sorted({x for touch in touches if touch.member == name for x in touch.places if 0.0 < x < 1.0})
        old, breaks = cuts[name], breaks_of(scene, name)
        keep = np.ones(len(old), bool)
        for x in places:
            e = int(np.clip(np.searchsorted(old, x) - 1, 0, len(old) - 2))
            keep &= np.abs(old - x) > NEAR * (old[e + 1] - old[e])
        keep |= np.isin(old, breaks)
        far = [x for x in places if np.abs(breaks - x).min() > APART]
        cuts[name] = np.unique(np.concatenate([old[keep], far]))
    return replace(base, cuts=cuts, touches=touches)


def _free_places(touches: tuple[Touch, ...]) -> list[tuple[int, int]]:
    """(touch, 0 or 1 for the begin or end) of each place within a member."""
    return [(i, k) for i, touch in enumerate(touches) for k, x in enumerate(touch.places) if 0.0 < x < 1.0]


def _moved(touch: Touch, k: int, x: float) -> Touch:
    return replace(touch, at=x) if k == 0 else replace(touch, to=x)


def _stretched(scene: Scene, mesh: Mesh, touches: tuple[Touch, ...]) -> Mesh | None:
    """The mesh with its places of contact moved and the cuts between them in proportion; None where they cross."""
    cuts = dict(mesh.cuts)
    for name in {touch.member for touch in touches}:
        pairs = {x: x for x in breaks_of(scene, name)}
        for old, new in zip(mesh.touches, touches, strict=True):
            if old.member == name:
                pairs |= dict(zip(old.places, new.places, strict=True))
        before = np.array(sorted(pairs))
        after = np.array([pairs[x] for x in before])
        if (np.diff(after) < 0.2 * APART).any():
            return None
        cuts[name] = np.interp(cuts[name], before, after)
    return replace(mesh, cuts=cuts, touches=touches)


def balanced(equations: Equations, state: State, loading: Loading) -> State:
    """The state with the multipliers that leave the least out of balance."""
    n = equations.unknowns
    if not equations.rows or equations.rows * n > 4_000_000:
        return state
    nothing = replace(state, lam=np.zeros(equations.rows))
    point = equations.at(nothing, loading)
    chosen = (equations.row >= n) & (equations.column < n)
    rows = np.zeros((equations.rows, n))
    rows[equations.row[chosen] - n, equations.column[chosen]] = point.entries[chosen]
    return replace(state, lam=np.linalg.lstsq(rows.T, -point.residual[:n], rcond=1e-12)[0])


class Toucher:
    """Contact of one scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    limit : float
        How deep a place may be inside an obstacle, over the size of the scene.
    """

    def __init__(self, scene: Scene, prepare: Callable[[Mesh], Prepared], limit: float) -> None:
        self.scene, self.prepare, self.limit = scene, prepare, limit
        self.ways: dict[tuple[str, str], float] = {}
        self.leave = scene.analysis.unstable == "leave"
        self.snapped: list[float] = []
        self.solves = 0

    # -- settling -------------------------------------------------------------------------------

    def solved(self, mesh: Mesh, source: tuple[Model, State] | None, way: Way, *, same: bool = False) -> Held | None:
        """The equilibrium with places held; None where Newton's method does not get there."""
        touches = tuple(replace(t, offset=way.offsets.get(t.contact, 0.0)) for t in mesh.touches)
        self.solves += 1
        prepared = self.prepare(replace(mesh, touches=touches))
        loading = way.loading(prepared.model)
        if source is None:
            state = prepared.equations.start(loading)
        elif same:
            state = source[1]
        else:
            state = transferred(source[0], source[1], prepared.model)
            state = balanced(prepared.equations, prepared.equations.holding(state, loading), loading)
        corrected = prepared.correct(state, loading, iterations=30, most=MOST_TURN)
        if not corrected.converged and corrected.residual > 1e-9:
            return None
        return Held(prepared, corrected, loading, Touched(prepared.equations, corrected.state, loading))

    def settle(self, mesh: Mesh, source: tuple[Model, State] | None, way: Way) -> Held | _Change | None:
        """The equilibrium with the places of contact where their conditions hold."""
        held = self.solved(mesh, source, way)
        if held is None:
            return None
        slopes: Array | None = None
        last = np.inf
        for _ in range(30):
            free = _free_places(held.mesh.touches)
            if not free:
                return held
            here = held.touched.conditions
            if slopes is None:
                slopes = self.slopes(held, way)
                if slopes is None:
                    return None
            step = -np.linalg.lstsq(slopes, here, rcond=1e-14)[0]
            if not np.isfinite(step).all():
                return None
            step, blocked = _shortened(held.mesh.touches, free, step)
            if blocked is not None:
                return self._ended(held.mesh.touches, *blocked)
            if np.abs(step).max() < SETTLED:
                return replace(held, slopes=slopes)
            there = self._stepped(held, free, step, way)
            if there is None:
                return None
            change = there.touched.conditions - here
            taken = _places(there.mesh.touches, free) - _places(held.mesh.touches, free)
            slopes = slopes + np.outer(change - slopes @ taken, taken) / max(float(taken @ taken), 1e-300)
            now = float(np.abs(there.touched.conditions).max())
            if now > 0.5 * last:
                slopes = None
            held, last = there, now
        return None

    def _stepped(self, held: Held, free: list[tuple[int, int]], step: Array, way: Way) -> Held | None:
        for share in (1.0, 0.3, 0.1, 0.03):
            there = self._at_places(held, free, share * step, way)
            if there is not None:
                return there
        return None

    def _at_places(self, held: Held, free: list[tuple[int, int]], step: Array, way: Way) -> Held | None:
        touches = list(held.mesh.touches)
        for (i, k), change in zip(free, step, strict=True):
            touches[i] = _moved(touches[i], k, touches[i].places[k] + float(change))
        mesh = _stretched(self.scene, held.mesh, tuple(touches))
        source = held.prepared.model, held.corrected.state
        if mesh is None:
            if any(min(x, 1.0 - x) < APART for i, k in free for x in [touches[i].places[k]]):
                return None
            if any(touch.to is not None and touch.to - touch.at < APART for touch in touches):
                return None
            mesh = placed(self.scene, replace(held.mesh, touches=()), tuple(touches))
            return self.solved(mesh, source, way)
        return self.solved(mesh, source, way, same=True)

    def slopes(self, held: Held, way: Way) -> Array | None:
        """Derivative of the conditions by the places, by differences."""
        free, here = _free_places(held.mesh.touches), held.touched.conditions
        columns = []
        for j, (i, k) in enumerate(free):
            touch = held.mesh.touches[i]
            x = touch.places[k]
            size = min(1e-6, 0.1 * min(x, 1.0 - x), 1.0 if touch.to is None else 0.1 * (touch.to - touch.at))
            for sign in (1.0, -1.0):
                step = np.zeros(len(free))
                step[j] = sign * size
                there = self._at_places(held, free, step, way)
                if there is not None:
                    break
            if there is None:
                return None
            columns.append((there.touched.conditions - here) / step[j])
        return np.column_stack(columns) if columns else np.zeros((0, 0))

    def _ended(self, touches: tuple[Touch, ...], i: int, k: int, where: str) -> _Change:
        """What becomes of a touch one of whose places ran to the end of its member or met the other one."""
        touch = touches[i]
        rest = touches[:i] + touches[i + 1 :]
        if where == "collapsed":
            middle = 0.5 * sum(touch.places)
            at = middle if min(touch.places) > 0.0 and max(touch.places) < 1.0 else float(round(middle))
            return _Change(_numbered((*rest, replace(touch, at=at, to=None))))
        end = float(round(touch.places[k]))
        member = self.scene.members[touch.member]
        node = member.nodes[int(end)]
        if touch.to is not None:
            return _Change(_numbered((*rest, _moved(touch, k, end))))
        others = [n for n, m in self.scene.members.items() if node in m.nodes and n != touch.member]
        sharp = self.scene.contacts[touch.contact].type in ("point", "line")
        if not self._takes_part(touch.contact, node) or (sharp and not others):
            return _Change(_numbered(rest))
        for other in others:
            if self.scene.nodes[node].joint == "rigid" and self.scene.members[other].type == "flexible":
                at = 1e-3 if self.scene.members[other].nodes[0] == node else 1.0 - 1e-3
                return _Change(_numbered((*rest, replace(touch, member=other, at=at))))
        return _Change(_numbered((*rest, replace(touch, at=end))))

    # -- which touches --------------------------------------------------------------------------

    def resolved(self, base: Mesh, now: Held | None, touches: tuple[Touch, ...], way: Way) -> Held | None:
        """The equilibrium at a point of the way with nothing wrong about its touches."""
        source = None if now is None else (now.prepared.model, now.corrected.state)
        seen: list[tuple[Touch, ...]] = []
        for _ in range(CHANGES):
            if sum(_alike(touches, other) for other in seen) > 1:
                return None
            seen.append(touches)
            self._accepted(touches)
            touches = self._released(base, now, touches, way)
            found = self.settle(placed(self.scene, base, touches), source, way)
            if found is None:
                return None
            if isinstance(found, _Change):
                touches = found.touches
                continue
            wrong = self.wrong(found, way)
            if wrong is None:
                return found
            touches = wrong.touches
            source = found.prepared.model, found.corrected.state
        return None

    def _accepted(self, touches: tuple[Touch, ...]) -> None:
        """Refuse what cannot be modelled.

        Raises
        ------
        SolveError
            A stretch on a round obstacle in space.
        """
        space = self.scene.resolved_dimension == "space"
        for touch in touches:
            if touch.to is not None and space and self.scene.contacts[touch.contact].radius is not None:
                detail = f"member {touch.member!r} comes to lie along contacts.{touch.contact}: found a stretch on a "
                detail += f"{self.scene.contacts[touch.contact].type} in space, accepted: stretches on planes"
                raise SolveError(Status.FAILED, detail)

    def _takes_part(self, contact: str, node: str) -> bool:
        stop = obstacle(self.scene.contacts[contact], self.scene.resolved_dimension == "space")
        return takes_part(node, self.scene.nodes[node], self.scene.motions.values(), stop)

    def _released(self, base: Mesh, now: Held | None, touches: tuple[Touch, ...], way: Way) -> tuple[Touch, ...]:
        """Stretches that reach a held end which is lifted off the obstacle end before it."""
        if not any(touch.to is not None and {0.0, 1.0} & {*touch.places} for touch in touches):
            return touches
        model = (self.prepare(base) if now is None else now.prepared).model
        shift = way.loading(model).shift.reshape(-1, model.element.axes) * model.scales.length
        found, stops = [], obstacles_of(model)
        for touch in touches:
            for k, x in enumerate(touch.places if touch.to is not None else ()):
                node = self.scene.members[touch.member].nodes[int(x)] if x in (0.0, 1.0) else ""
                if not node or self._takes_part(touch.contact, node):
                    continue
                place = np.asarray(self.scene.nodes[node].position, dtype=float)
                place = place + np.pad(shift[model.nodes.index(node)], (0, 3 - model.element.axes))
                tangent = np.array([[1.0, 0.0, 0.0]])
                gap = stops[touch.contact].gaps(place[None, :], tangent, way.offsets.get(touch.contact, 0.0))[0]
                if gap > SAME * self.scene.size:
                    touch = _moved(touch, k, x + (0.05 if k == 0 else -0.05) * (float(touch.to or 0.0) - touch.at))
            found.append(touch)
        return tuple(found)

    def wrong(self, held: Held, way: Way) -> _Change | None:
        """What has to touch otherwise at this state; None where all is right."""
        touched, touches = held.touched, held.mesh.touches
        smallest = 1e-9 * held.prepared.model.scales.force
        pulls = [(touched.push(touch), i) for i, touch in enumerate(touches) if touch.to is None]
        if pulls and min(pulls)[0] < -smallest:
            i = min(pulls)[1]
            return _Change(_numbered(touches[:i] + touches[i + 1 :]))
        for i, touch in enumerate(touches):
            k = touched.loose_end(touch)
            if k is not None:
                inner = touch.places[k] + (0.05 if k == 0 else -0.05) * (float(touch.to or 0.0) - touch.at)
                return _Change(_numbered((*touches[:i], _moved(touch, k, inner), *touches[i + 1 :])))
        flatter = self._flattened(held) or self._joined(held, way)
        if flatter is not None:
            return flatter
        gaps = touched.inside(way.offsets, self.ways, self.limit * self.scene.size)
        if not gaps:
            return self._lifted(held)
        return _Change(_numbered(self._with(held, min(gaps, key=lambda gap: gap.depth))))

    def _flattened(self, held: Held) -> _Change | None:
        """A place beside which the member curves into a plane or a round obstacle becomes a stretch."""
        touches = held.mesh.touches
        for i, touch in enumerate(touches):
            if touch.to is not None or held.touched.obstacles[touch.contact].kind == "sharp":
                continue
            beside = [touch, *self._across_node(touch)]
            if touch.at in (0.0, 1.0) and len(beside) == 1:
                continue
            lying = [self._laid(held, part) for part in beside]
            found = [part for part in lying if part is not None]
            if found:
                return _Change(_numbered((*touches[:i], *found, *touches[i + 1 :])))
        return None

    def _across_node(self, touch: Touch) -> list[Touch]:
        """The same place on the other members where a member ends."""
        if touch.at not in (0.0, 1.0):
            return []
        node = self.scene.members[touch.member].nodes[int(touch.at)]
        others = [(n, m) for n, m in self.scene.members.items() if node in m.nodes and n != touch.member]
        allowed = members_of(self.scene.contacts[touch.contact], self.scene.members)
        flexible = [(n, m) for n, m in others if m.type == "flexible" and n in allowed]
        return [replace(touch, member=n, at=float(m.nodes.index(node))) for n, m in flexible]

    def _laid(self, held: Held, touch: Touch) -> Touch | None:
        """The stretch that a place becomes; None where the member curves away from the obstacle."""
        scales = held.prepared.model.scales
        bent = held.touched.gap_curvature(touch) * scales.length
        if bent > -FLAT:
            return None
        # The moment falls by half of the force to either side, down to what the obstacle's shape takes.
        push = max((held.touched.push(t) for t in held.mesh.touches if t.to is None), default=0.0) / scales.force
        stiff = held.touched.fields.stiffness(touch.member, touch.at)
        length = self.scene.center_lines[touch.member].length / scales.length
        reach = float(np.clip(-bent * stiff / max(push, 1e-300) / length, 1e-5, 0.1))
        low, high = max(0.0, touch.at - reach), min(1.0, touch.at + reach)
        return replace(touch, at=low, to=high, way=self._bend(held, touch))

    def _joined(self, held: Held, way: Way) -> _Change | None:
        """Between two places of one obstacle without any gap between them the member lies on it."""
        touches, limit = held.mesh.touches, self.limit * self.scene.size
        for touch in touches:
            if held.touched.obstacles[touch.contact].kind == "sharp":
                continue
            others = [
                (t, x)
                for t in touches
                if t.contact == touch.contact and t.member == touch.member and t is not touch
                for x in t.places
            ]
            for k, sign in ((-1, 1.0), (0, -1.0)):
                here = touch.places[k]
                beside = sorted((x for _, x in others if (x - here) * sign > 0.0), key=lambda x: abs(x - here))
                there = beside[0] if beside else 0.5 + 0.5 * sign
                if abs(there - here) < 1e-5:
                    continue
                x = np.linspace(here, there, 12)[1:]
                gaps = held.touched.gaps(touch.contact, touch.member, x, way.offsets.get(touch.contact, 0.0))
                if np.abs(gaps).max() > limit:
                    continue
                gone = next((t for t, x in others if x == there), None)
                low, high = min(*touch.places, there), max(*touch.places, there)
                low, high = (low, high) if gone is None else (min(low, *gone.places), max(high, *gone.places))
                lying = replace(touch, at=low, to=high, way=self._bend(held, touch))
                rest = tuple(t for t in touches if t is not touch and t is not gone)
                return _Change(_numbered((*rest, lying)))
        return None

    def _lifted(self, held: Held) -> _Change | None:
        """A stretch between whose ends the obstacle would have to pull becomes two."""
        for i, touch in enumerate(held.mesh.touches):
            if touch.to is None:
                continue
            x = np.linspace(touch.at, touch.to, 9)
            pressed = held.touched.pressures(touch, x)
            if pressed.min() < -1e-6 * max(np.abs(pressed).max(), held.prepared.model.scales.force):
                j = int(np.argmin(pressed))
                rest = held.mesh.touches[:i] + held.mesh.touches[i + 1 :]
                halves = [(touch.at, float(x[j])), (float(x[j + 1]), float(touch.to))]
                parts = []
                for low, high in halves:
                    short = high - low < 0.05 * (touch.to - touch.at)
                    outer = low if low == touch.at else high
                    parts.append(replace(touch, at=outer if short else low, to=None if short else high))
                return _Change(_numbered((*rest, *parts)))
        return None

    def _with(self, held: Held, gap: Gap) -> tuple[Touch, ...]:
        """The touches with one that keeps a run of places out of an obstacle."""
        touches = held.mesh.touches
        width = max(gap.end - gap.begin, 1e-4)
        for i, touch in enumerate(touches):
            if (touch.contact, touch.member) != (gap.contact, gap.member):
                continue
            beside = [x for x in touch.places if gap.begin - width <= x <= gap.end + width]
            if not beside:
                continue
            rest = touches[:i] + touches[i + 1 :]
            if touch.at in (0.0, 1.0):
                # It rolls off its end; where the end does not stay off, it comes back as a stretch.
                return (*rest, replace(touch, at=float(np.clip(gap.at, 1e-4, 1.0 - 1e-4))))
            if touch.to is None:
                low, high = max(0.0, touch.at - 0.5 * width), min(1.0, touch.at + 0.5 * width)
                low, high = (
                    min(low, gap.begin) if gap.begin == 0.0 else low,
                    max(high, gap.end) if gap.end == 1.0 else high,
                )
                return (*rest, replace(touch, at=low, to=high, way=self._bend(held, touch)))
            low, high = min(touch.at, gap.begin), max(touch.to, gap.end)
            return (*rest, replace(touch, at=low, to=high))
        at = gap.at
        if 0.0 < at < 1.0:
            at = float(np.clip(at, 2.0 * APART, 1.0 - 2.0 * APART))
        return (*touches, Touch(gap.contact, gap.member, at, way=gap.way))

    @staticmethod
    def _bend(held: Held, touch: Touch) -> float:
        """To which side a round obstacle bends a member that lies on it."""
        x = np.array([touch.at])
        fields, stop = held.touched.fields, held.touched.obstacles[touch.contact]
        point, tangent = fields.positions(touch.member, x)[0], fields.tangents(touch.member, x)[0]
        return float(np.sign(stop.curvature(point, tangent))) or 1.0

    # -- following ------------------------------------------------------------------------------

    def follow(self, base: Mesh, way: Callable[[float], Way], start: Held | tuple[Touch, ...]) -> Held | None:
        """Follow from the begin of a way to its end; from a state there, or from the undeformed scene."""
        now = start if isinstance(start, Held) else None
        touches = start.mesh.touches if isinstance(start, Held) else start
        done, step = 0.0, 0.5
        most = self.solves + MOST_SOLVES
        for _ in range(TRIES):
            if done >= 1.0:
                return now
            if self.solves > most:
                return None
            trial = min(1.0, done + step)
            there = self.resolved(base, now, touches, way(trial))
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
            step *= 2.0
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
        return self.resolved(base, there, touches, way)


def can_leave(held: Held) -> bool:
    """Whether there is an energy and anything left to move."""
    equations = held.prepared.equations
    return held.prepared.model.minimisable and equations.rows < equations.unknowns


def _places(touches: tuple[Touch, ...], free: list[tuple[int, int]]) -> Array:
    return np.array([touches[i].places[k] for i, k in free])


def _shortened(
    touches: tuple[Touch, ...], free: list[tuple[int, int]], step: Array
) -> tuple[Array, tuple[int, int, str] | None]:
    """The step, shortened so that places keep their order; or the place that has nowhere to go, and why."""
    factor, blocked = 1.0, None
    for (i, k), change in zip(free, step, strict=True):
        touch, x = touches[i], touches[i].places[k]
        beside = [1.0 if change > 0.0 else 0.0]
        if touch.to is not None:
            other = touch.places[1 - k]
            beside += [other] if (other > x) == (change > 0.0) else []
        room = min(abs(y - x) for y in beside)
        if abs(change) < SETTLED:
            continue
        if room < 10.0 * APART:
            met = (
                touch.to is not None
                and room == abs(touch.places[1 - k] - x)
                and touch.places[1 - k] not in ((1.0,) if change > 0.0 and touch.places[1 - k] == x else ())
            )
            return step, (i, k, "collapsed" if met and len(beside) > 1 else "end")
        # Two places of a stretch may both move towards each other.
        factor = min(factor, 0.45 * room / abs(change)) if abs(change) > 0.45 * room else factor
    return factor * step, blocked


def _numbered(touches: tuple[Touch, ...]) -> tuple[Touch, ...]:
    """Touches of the same two told apart by numbers, in the order of their places."""
    count: dict[tuple[str, str], int] = {}
    found = []
    for touch in sorted(touches, key=lambda t: (t.contact, t.member, t.at)):
        key = (touch.contact, touch.member)
        found.append(replace(touch, number=count.get(key, 0)))
        count[key] = count.get(key, 0) + 1
    return tuple(found)


def _alike(a: tuple[Touch, ...], b: tuple[Touch, ...]) -> bool:
    """Whether two sets of touches are the same but for rounding of the places."""

    def key(touches: tuple[Touch, ...]) -> Any:
        return [(t.contact, t.member, *(round(x, 6) for x in t.places)) for t in touches]

    return bool(key(a) == key(b))
