"""Whether members may have passed an obstacle between two states, though neither of them is inside it.

The path of a place from one state to the next lies in a tube about the chord between its positions, as thick as an arc
over the chord that turns as much as the members do.  Where the tube stays out of an obstacle nothing was passed;
otherwise the step is too long to decide, and a shorter one has a thinner tube.
"""

from __future__ import annotations

import functools
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..description.obstacles import Obstacle, members_of, swept
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from .settling import Held
from .touches import Touched

__all__ = ["STRIDE", "Course", "Passing"]

FINENESS, LEAST, MOST = 0.25, 64, 400
"""Largest distance of the places examined, share of the smallest radius; fewest and most intervals of a member."""

STRIDE = 0.5
"""Largest rotation of a place in a step, rad."""

DEVIATION = 0.2
"""How far a path of given length deviates from its chord over length times turn: 1/8 for an arc, 1/4 for a corner."""

PASSED = 1e-3
"""Share of the size of the scene, and of a radius times 50, up to which a tube may be inside: what dips in by so little
is pushed out again to where it came from."""

BEHIND = 1e-3
"""Distance, share of the size of the scene, by which an edge is moved back for a member that leaves it."""

ALONG = 0.25
"""Depth of a tube, share of the radius, allowed for a member that touches before and after, as it slides along."""

FLAT = 0.02
"""Depth of a tube in a plane or hollow obstacle, share of the size of the scene; nothing passes these.

The limit keeps the order in which places begin to touch.
"""


@dataclass(frozen=True)
class Course:
    """Positions (n, 3), m, and tangents (n, 3) of each member of a state at fixed fractions of the length."""

    positions: Mapping[str, Array]
    tangents: Mapping[str, Array]

    def turned(self, other: Course) -> float:
        """Largest angle between the tangents of the same place in two states, rad."""
        cosines = [
            np.einsum("ni,ni->n", self.tangents[name], other.tangents[name]).min(initial=1.0) for name in self.tangents
        ]
        return float(np.arccos(np.clip(min(cosines, default=1.0), -1.0, 1.0)))


class Passing:
    """The check of steps for the obstacles of one scene.

    Parameters
    ----------
    scene : Scene
    obstacles : mapping of str to Obstacle
    """

    def __init__(self, scene: Scene, obstacles: Mapping[str, Obstacle]) -> None:
        self.scene, self.obstacles = scene, obstacles
        # A state is looked at as the end of one step and the begin of the next.
        self._courses: weakref.WeakKeyDictionary[Touched, Course] = weakref.WeakKeyDictionary()
        self.pairs = [
            (contact, member) for contact in obstacles for member in members_of(scene.contacts[contact], scene.members)
        ]
        radius = min((stop.radius for stop in obstacles.values() if stop.kind == "round"), default=np.inf)
        counts = {m: scene.center_lines[m].length / (FINENESS * radius) for _, m in self.pairs}
        self.fractions = {m: np.linspace(0.0, 1.0, int(np.clip(n, LEAST, MOST)) + 1) for m, n in counts.items()}

    def course(self, touched: Touched) -> Course:
        """Positions and tangents of the members of a state."""
        known = self._courses.get(touched)
        if known is None:
            fields = touched.fields
            known = self._courses[touched] = Course(
                {name: fields.positions(name, x) for name, x in self.fractions.items()},
                {name: fields.tangents(name, x) for name, x in self.fractions.items()},
            )
        return known

    def departed(self, first: Held, before: Held, after: Held, share: float) -> float:
        """Largest angle, rad, between the tangents of a state and their linear extrapolation from two earlier ones.

        The step from ``before`` to ``after`` is ``share`` times that from ``first`` to ``before``.
        """
        one, other, there = (self.course(held.touched).tangents for held in (first, before, after))
        on = {name: other[name] + share * (other[name] - one[name]) for name in other}
        unit = {name: t / np.maximum(np.linalg.norm(t, axis=1, keepdims=True), TINY) for name, t in on.items()}
        return Course({}, unit).turned(Course({}, there))

    def turned(self, before: Held, after: Held) -> float:
        """Largest angle between the tangents of the same place in two states, rad."""
        return self.course(before.touched).turned(self.course(after.touched))

    def possible(self, before: Held, after: Held, offsets: Mapping[str, float], stride: float = STRIDE) -> bool:
        """Whether an obstacle may have been passed between two states, or they are more than ``stride``, rad, apart.

        ``offsets`` are the distances, m, by which obstacles are moved back.
        """
        one, other = self.course(before.touched), self.course(after.touched)
        if self._over(before, after, one, other):
            return True
        touching = [{(t.contact, t.member) for t in held.mesh.touches} for held in (before, after)]
        turned = one.turned(other)
        return turned > stride or any(
            self._passed(pair, one, other, turned, pair in touching[0] & touching[1], offsets.get(pair[0], 0.0))
            for pair in self.pairs
        )

    def over(self, before: Held | None, after: Held) -> bool:
        """Whether a step certainly leads across an obstacle or an edge; it begins at the undeformed scene for None."""
        return self._over(before, after, self._undeformed if before is None else self.course(before.touched))

    def _over(self, before: Held | None, after: Held, here: Course, there: Course | None = None) -> bool:
        touched = {touch.contact for touch in after.mesh.touches}
        there = there or self.course(after.touched)
        for contact, member in self.pairs:
            stop = self.obstacles[contact]
            # On an edge itself no side can be told.
            if stop.kind == "sharp" and contact in touched:
                continue
            if swept(self._behind(before, contact, member, stop), here.positions[member], there.positions[member]):
                return True
        return False

    @functools.cached_property
    def _undeformed(self) -> Course:
        lines = {name: (self.scene.center_lines[name], x) for name, x in self.fractions.items()}
        return Course(
            {name: line.positions(x) for name, (line, x) in lines.items()},
            {name: line.tangents(x) for name, (line, x) in lines.items()},
        )

    def _behind(self, before: Held | None, contact: str, member: str, stop: Obstacle) -> Obstacle:
        """An edge that a member begins to leave a little behind where it is: on the edge itself no side can be told."""
        if before is None or stop.kind != "sharp":
            return stop
        for touch in before.mesh.touches:
            if (touch.contact, touch.member) == (contact, member):
                shift = BEHIND * self.scene.size * before.touched.normal(touch, touch.at)
                return replace(stop, place=stop.place - shift)
        return stop

    def _passed(
        self, pair: tuple[str, str], one: Course, other: Course, turned: float, slides: bool, offset: float
    ) -> bool:
        contact, member = pair
        stop, size = self.obstacles[contact], self.scene.size
        before, after = one.positions[member], other.positions[member]
        if stop.kind == "sharp":
            return False
        chords = after - before
        tube = DEVIATION * turned * np.linalg.norm(chords, axis=1)
        depth = float((tube - _closest(stop, before, chords) - offset).max())
        if stop.kind == "flat" or stop.sign < 0.0:
            return depth > FLAT * size
        if slides:
            return depth > ALONG * stop.radius
        return depth > PASSED * min(size, 50.0 * stop.radius)


def _closest(stop: Obstacle, begin: Array, chords: Array) -> Array:
    """Smallest gaps (n,) on the chords from places (n, 3)."""
    nothing = np.zeros_like(begin)
    ends = np.minimum(stop.gaps(begin, nothing), stop.gaps(begin + chords, nothing))
    if stop.kind == "flat" or stop.sign < 0.0:
        return np.asarray(ends)
    out, along = (begin - stop.place) @ stop.across, chords @ stop.across
    share = -np.einsum("ni,ni->n", out, along) / np.maximum(np.einsum("ni,ni->n", along, along), TINY)
    nearest = begin + np.clip(share, 0.0, 1.0)[:, None] * chords
    return np.minimum(ends, stop.gaps(nearest, nothing))
