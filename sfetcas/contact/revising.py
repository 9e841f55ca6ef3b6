"""Active-set update: the touches to try next, from the violated conditions of a state in contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .. import tolerances
from ..description.obstacles import members_of, takes_part
from ..description.scene import Scene
from ..errors import SolveError, Status
from ..mathematics.arrays import TINY, first_of_largest
from ..mechanics.loading import Loading
from ..mechanics.mesh import Touch
from ..mechanics.model import Model
from .settling import ONE_PLACE, Held, Ran, Way, moved
from .touches import MOST_RISE, NOISE, Gap, Loose

__all__ = ["Reviser", "Tried"]

Touches = tuple[Touch, ...]

FLAT = 1e-7
"""Size of a negative curvature of the gap, times the length scale, from which a member penetrates beside a place."""


ROUNDED = 1e-14
"""Gap that rounding may leave, share of the size of the scene."""

LOADS = 1e-6
"""Load from which a stretch may open, share of the largest force or moment."""

CORNER = 1e-4
"""Slope, rad, from which a member leaves an obstacle at its end, whatever its curvature; below it is tangential."""


@dataclass
class Tried:
    """Changes of touches that failed at one point of the way, so that they are not tried again.

    Attributes
    ----------
    crossed : set of str
        Nodes that places of contact reached along their members.
    collapsed : set of (str, str)
        Contact and member of stretches whose length became zero.
    """

    crossed: set[str] = field(default_factory=set)
    collapsed: set[tuple[str, str]] = field(default_factory=set)


class Reviser:
    """Changes of the touches of one scene.

    Parameters
    ----------
    scene : Scene
    limit : float
        Largest penetration that is accepted, over the size of the scene.
    sides : mapping of (contact, member) to float
        The allowed side of each edge, see :func:`~sfetcas.contact.touches.edge_sides`.

    Attributes
    ----------
    noise : float
        Largest penetration accepted beside places where a member leaves an obstacle, over the size of the scene.
    """

    def __init__(self, scene: Scene, limit: float, sides: Mapping[tuple[str, str], float]) -> None:
        self.scene, self.limit, self.noise, self.sides = scene, limit, NOISE, sides

    def ended(self, ran: Ran, tried: Tried) -> Touches:
        """The touches after a place reached the end of its member or the other place of its stretch.

        It continues on the next member; at a node that was crossed before it stays.  ``tried`` is updated.
        """
        touches, i, k = ran.touches, ran.touch, ran.place
        touch, rest = touches[i], touches[:i] + touches[i + 1 :]
        if ran.met is not None:
            return self._met(touches, i, ran.met)
        if ran.collapsed:
            tried.collapsed.add((touch.contact, touch.member))
            middle = 0.5 * sum(touch.places)
            at = middle if min(touch.places) > 0.0 and max(touch.places) < 1.0 else float(round(middle))
            return self.numbered((*rest, replace(touch, at=at, to=None)))
        end = float(round(touch.places[k]))
        member = self.scene.members[touch.member]
        node = member.nodes[int(end)]
        if touch.to is not None:
            return self.numbered((*rest, moved(touch, k, end)))
        others = [n for n, m in self.scene.members.items() if node in m.nodes and n != touch.member]
        sharp = self.scene.contacts[touch.contact].type in ("point", "line")
        if not self.takes_part(touch.contact, node) or (sharp and not others):
            return self.numbered(rest)
        back = node in tried.crossed
        tried.crossed.add(node)
        for other in () if back else others:
            if self.scene.nodes[node].joint == "rigid" and self.scene.members[other].type == "flexible":
                at = 1e-3 if self.scene.members[other].nodes[0] == node else 1.0 - 1e-3
                return self.numbered((*rest, replace(touch, member=other, at=at)))
        return self.numbered((*rest, replace(touch, at=end)))

    def _met(self, touches: Touches, one: int, other: int) -> Touches:
        """Two touches that ran into each other as one: a stretch over both; of two places the one between them."""
        places = (*touches[one].places, *touches[other].places)
        rest = tuple(touch for i, touch in enumerate(touches) if i not in (one, other))
        low, high = min(places), max(places)
        joined = (
            replace(touches[one], at=low, to=high) if len(places) > 2 else replace(touches[one], at=0.5 * (low + high))
        )
        return self.numbered((*rest, joined))

    def lying_to_the_end(self, ran: Ran) -> Touches | None:
        """The touches with a stretch from a place to the end that it reached; None if there cannot be one."""
        if ran.met is not None:
            return None
        touches, i = ran.touches, ran.touch
        touch, end = touches[i], float(round(touches[i].places[ran.place]))
        node = self.scene.members[touch.member].nodes[int(end)]
        flat = self.scene.contacts[touch.contact].type not in ("point", "line") and not self._stiff(touch.member)
        if ran.collapsed or touch.to is not None or not flat or not self.takes_part(touch.contact, node):
            return None
        low, high = sorted((touch.at, end))
        return self.numbered((*touches[:i], replace(touch, at=low, to=high), *touches[i + 1 :])) if low < high else None

    def check(self, touches: Touches) -> None:
        """Refuse touches that cannot be modelled.

        Raises
        ------
        SolveError
            There is a stretch on a round obstacle in space.
        """
        space = self.scene.resolved_dimension == "space"
        for touch in touches:
            if touch.to is not None and space and self.scene.contacts[touch.contact].radius is not None:
                detail = f"member {touch.member!r} comes to lie along contacts.{touch.contact}: found a stretch on a "
                detail += f"{self.scene.contacts[touch.contact].type} in space, accepted: stretches on planes"
                raise SolveError(Status.FAILED, detail)

    def takes_part(self, contact: str, node: str) -> bool:
        """Whether an obstacle can exert a force on a node: supports and motions leave it free to move."""
        stop = self.scene.obstacles[contact]
        return takes_part(node, self.scene.nodes[node], self.scene.motions.values(), stop)

    def released(self, model: Model, loading: Loading, touches: Touches, way: Way) -> Touches:
        """The touches with stretches shortened that reach a fixed end which is off the obstacle."""
        if not any(touch.to is not None and {0.0, 1.0} & {*touch.places} for touch in touches):
            return touches
        shift = loading.shift.reshape(-1, model.element.axes) * model.scales.length
        found, stops = [], model.scene.obstacles
        for touch in touches:
            for k, x in enumerate(touch.places if touch.to is not None else ()):
                node = self.scene.members[touch.member].node_at(x)
                if not node or self.takes_part(touch.contact, node):
                    continue
                place = np.asarray(self.scene.nodes[node].position, dtype=float)
                place = place + np.pad(shift[model.nodes.index(node)], (0, 3 - model.element.axes))
                tangent = np.array([[1.0, 0.0, 0.0]])
                gap = stops[touch.contact].gaps(place[None, :], tangent, way.offsets.get(touch.contact, 0.0))[0]
                if gap > tolerances.DECIMAL * self.scene.size:
                    touch = moved(touch, k, x + (0.05 if k == 0 else -0.05) * (float(touch.to or 0.0) - touch.at))
            found.append(touch)
        return tuple(found)

    def wrong(self, held: Held, way: Way, tried: Tried | None = None) -> Touches | None:
        """The touches to try instead of those of this state, given the failures so far; None if no condition fails."""
        tried = tried or Tried()
        touched, touches = held.touched, held.mesh.touches
        smallest = tolerances.BALANCED * held.prepared.model.scales.force
        pulls = [(touched.push(touch), i) for i, touch in enumerate(touches) if touch.to is None]
        if pulls and min(pulls)[0] < -smallest:
            i = min(pulls)[1]
            return self.numbered(touches[:i] + touches[i + 1 :])
        for i, touch in enumerate(touches):
            loose = touched.loose_end(touch)
            if loose is not None:
                return self.numbered((*touches[:i], *self._loosened(held, touch, loose), *touches[i + 1 :]))
        flatter = self._opened(held) or self._flattened(held, way, tried) or self._joined(held, way)
        if flatter is not None:
            return flatter
        gaps = touched.inside(way.offsets, self.sides, self.limit * self.scene.size, self.noise * self.scene.size)
        if not gaps:
            return self._lifted(held)
        deepest = first_of_largest(np.minimum([gap.depth for gap in gaps], 0.0))
        return self.numbered(self._with(held, gaps[deepest]))

    def _loosened(self, held: Held, touch: Touch, loose: Loose) -> list[Touch]:
        """A stretch with an end that cannot lie there: shorter, or longer where the next member is pressed as well."""
        end, k = replace(touch, at=loose.at, to=None), int(loose.at)
        if loose.stays:
            beside = [
                part for part in (self._laid(held, other) for other in self._across_node(end)) if part is not None
            ]
            if beside:
                return [touch, *beside]
        shorter = moved(touch, k, touch.places[k] + (1.0 - 2.0 * k) * loose.risen)
        if loose.risen >= MOST_RISE * (float(touch.to or 0.0) - touch.at):
            # It would rise over more than its length: what is left is its other end.
            shorter = replace(touch, at=touch.places[1 - k], to=None)
        return [shorter, end] if loose.stays else [shorter]

    def _opened(self, held: Held) -> Touches | None:
        """A stretch that a load takes off its obstacle becomes two, at a node those of both members shorter."""
        touches = held.mesh.touches
        for i, touch in enumerate(touches):
            opened = None if touch.to is None else held.touched.opened(touch, LOADS)
            if opened is None:
                continue
            wide, rest = held.touched.hump(opened), touches[:i] + touches[i + 1 :]
            if opened.node is None:
                low = opened.at - min(wide, 0.9 * (opened.at - touch.at))
                high = opened.at + min(wide, 0.9 * (float(touch.to or 0.0) - opened.at))
                return self.numbered((*rest, replace(touch, to=low), replace(touch, at=high)))
            found = []
            for other in touches:
                nodes = self.scene.members[other.member].nodes
                ends = [x for x in other.places if x in (0.0, 1.0) and nodes[int(x)] == opened.node]
                if other.contact == touch.contact and other.to is not None and ends:
                    scale = self.scene.center_lines[touch.member].length / self.scene.center_lines[other.member].length
                    inwards = (1.0 - 2.0 * ends[0]) * min(scale * wide, 0.9 * (other.to - other.at))
                    other = moved(other, int(ends[0]), ends[0] + inwards)
                found.append(other)
            return self.numbered(tuple(found))
        return None

    def _flattened(self, held: Held, way: Way, tried: Tried) -> Touches | None:
        """A place beside which the member curves into a plane or a round obstacle becomes a stretch.

        It stays a place where the ends of that stretch met: where flattening has just begun they are no more than
        rounding apart.
        """
        touches = held.mesh.touches
        for i, touch in enumerate(touches):
            if touch.to is not None or held.touched.obstacles[touch.contact].kind == "sharp":
                continue
            if (touch.contact, touch.member) in tried.collapsed:
                continue
            beside = [touch, *self._across_node(touch)]
            if touch.at in (0.0, 1.0) and len(beside) == 1:
                continue
            lying = [None if self._humps(held, part, way) else self._laid(held, part) for part in beside]
            found = [part for part in lying if part is not None]
            if found:
                return self.numbered((*touches[:i], *found, *touches[i + 1 :]))
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
        if self._stiff(touch.member):
            return None
        scales = held.prepared.model.scales
        bent = held.touched.gap_curvature(touch) * scales.length
        if bent > -FLAT or self._leaves(held, touch):
            return None
        # The moment falls by half of the force to either side, down to what the obstacle's shape takes.
        push = max((held.touched.push(t) for t in held.mesh.touches if t.to is None), default=0.0) / scales.force
        stiff = held.touched.fields.stiffness(touch.member, touch.at)
        length = self.scene.center_lines[touch.member].length / scales.length
        reach = float(np.clip(-bent * stiff / max(push, TINY) / length, 1e-5, 0.1))
        low, high = max(0.0, touch.at - reach), min(1.0, touch.at + reach)
        return replace(touch, at=low, to=high, way=self._bend(held, touch))

    def _stiff(self, member: str) -> bool:
        """Whether a member cannot come to lie along an obstacle, but touches it at places only."""
        return self.scene.members[member].type == "rigid"

    @staticmethod
    def _leaves(held: Held, touch: Touch) -> bool:
        """Whether a member leaves the obstacle from its end at an angle, as beside a corner that touches."""
        if touch.at not in (0.0, 1.0):
            return False
        inwards = 1.0 - 2.0 * touch.at
        tangent = held.touched.fields.tangents(touch.member, np.array([touch.at]))[0]
        return bool(inwards * float(tangent @ held.touched.normal(touch, touch.at)) > CORNER)

    def _humps(self, held: Held, touch: Touch, way: Way) -> bool:
        """Whether a member rises from its end to come down again where it touches the obstacle next.

        As where a couple presses the end: it bends into the obstacle there, and lies nowhere beside it.
        """
        if touch.at not in (0.0, 1.0):
            return False
        here = [t for t in held.mesh.touches if (t.contact, t.member) == (touch.contact, touch.member)]
        others = [x for t in here for x in t.places if x != touch.at]
        if not others:
            return False
        x = np.linspace(touch.at, min(others, key=lambda x: abs(x - touch.at)), 12)[1:-1]
        gaps = held.touched.gaps(touch.contact, touch.member, x, way.offsets.get(touch.contact, 0.0))
        return bool(gaps.min() > ROUNDED * self.scene.size)

    def _joined(self, held: Held, way: Way) -> Touches | None:
        """Between two places of one obstacle without any gap between them the member lies on it."""
        touches, limit = held.mesh.touches, self.limit * self.scene.size
        for touch in touches:
            if held.touched.obstacles[touch.contact].kind == "sharp" or self._stiff(touch.member):
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
                # A member that rises over so short a way is nowhere inside.
                rounded = ROUNDED * self.scene.size
                if np.abs(gaps).max() > limit or (gaps.max() > rounded and gaps.min() > -rounded):
                    continue
                gone = next((t for t, x in others if x == there), None)
                low, high = min(*touch.places, there), max(*touch.places, there)
                low, high = (low, high) if gone is None else (min(low, *gone.places), max(high, *gone.places))
                lying = replace(touch, at=low, to=high, way=self._bend(held, touch))
                rest = tuple(t for t in touches if t is not touch and t is not gone)
                return self.numbered((*rest, lying))
        return None

    def _lifted(self, held: Held) -> Touches | None:
        """A stretch between whose ends the obstacle would have to pull becomes two."""
        for i, touch in enumerate(held.mesh.touches):
            if touch.to is None:
                continue
            x = np.linspace(touch.at, touch.to, 9)
            pressed = held.touched.pressures(touch, x)
            if pressed.min() < -tolerances.NEGLIGIBLE * max(np.abs(pressed).max(), held.prepared.model.scales.force):
                if pressed.max() <= 0.0:
                    # Pulled off all along it lies on the obstacle nowhere, but for what is beside it.
                    ends = (replace(touch, at=x, to=None) for x in touch.places)
                    return self.numbered((*held.mesh.touches[:i], *ends, *held.mesh.touches[i + 1 :]))
                j = int(np.argmin(pressed))
                rest = held.mesh.touches[:i] + held.mesh.touches[i + 1 :]
                halves = [(touch.at, float(x[j])), (float(x[j + 1]), float(touch.to))]
                parts = []
                for low, high in halves:
                    short = high - low < 0.05 * (touch.to - touch.at)
                    outer = low if low == touch.at else high
                    parts.append(replace(touch, at=outer if short else low, to=None if short else high))
                return self.numbered((*rest, *parts))
        return None

    def _with(self, held: Held, gap: Gap) -> Touches:
        """The touches with one that keeps a run of places out of an obstacle."""
        touches = held.mesh.touches
        width = max(gap.end - gap.begin, 1e-4)
        stiff = self._stiff(gap.member)
        for i, touch in enumerate(touches):
            if (touch.contact, touch.member) != (gap.contact, gap.member):
                continue
            # What is rigid touches at places only: it rolls off its end, or touches once more.
            beside = [] if stiff else [x for x in touch.places if gap.begin - width <= x <= gap.end + width]
            if not beside and touch.at in (0.0, 1.0) and touch.to is None and self._sinks(held, touch, gap.at):
                beside = [touch.at]
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
            at = float(np.clip(at, 2.0 * ONE_PLACE, 1.0 - 2.0 * ONE_PLACE))
        return (*touches, Touch(gap.contact, gap.member, at, way=gap.way))

    @staticmethod
    def _sinks(held: Held, touch: Touch, at: float) -> bool:
        """Whether a member is inside an obstacle all the way from where it touches to another place."""
        x = np.linspace(touch.at, at, 12)[1:]
        return bool(held.touched.gaps(touch.contact, touch.member, x, touch.offset, touch.way).max() < 0.0)

    @staticmethod
    def _bend(held: Held, touch: Touch) -> float:
        """To which side a round obstacle bends a member that lies on it."""
        x = np.array([touch.at])
        fields, stop = held.touched.fields, held.touched.obstacles[touch.contact]
        point, tangent = fields.positions(touch.member, x)[0], fields.tangents(touch.member, x)[0]
        return float(np.sign(stop.curvature(point, tangent))) or 1.0

    def numbered(self, touches: Touches) -> Touches:
        """The touches sorted, each place and node once, those of one member and obstacle numbered along the member."""
        count: dict[tuple[str, str], int] = {}
        found: list[Touch] = []
        lying: list[tuple[str, str, float | None]] = [
            (t.contact, t.member, x) for t in touches if t.to is not None for x in t.places
        ]
        for touch in sorted(touches, key=lambda t: (t.contact, t.member, t.at)):
            key = (touch.contact, touch.member)
            node = self.scene.members[touch.member].node_at(touch.at)
            sharp = self.scene.contacts[touch.contact].type in ("point", "line")
            at_node = (touch.contact, node, None) if node and not sharp else (*key, touch.at)
            if touch.to is None and ((*key, touch.at) in lying or at_node in lying):
                continue
            lying += [(*key, touch.at), at_node] if touch.to is None else []
            found.append(replace(touch, number=count.get(key, 0)))
            count[key] = count.get(key, 0) + 1
        return tuple(found)
