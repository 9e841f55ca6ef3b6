"""Lines: members that lie along an obstacle, or along each other, and the places that stand for that on a mesh.

On an obstacle without friction each element has two forces that are spread along it, one that rises from its start and
one that falls towards its end, and each end of elements one that presses at a point, see
:mod:`~sfetcas.mechanics.contact_lines`.  Which of them push is solved for, see :mod:`~sfetcas.solvers.one_sided`; so
they make any pressure that is linear along elements, and the forces with which a line presses where it ends.  Then at
each end one force that slides takes the place of what presses on the last element: where a line ends is an unknown.
With friction both forces beside an end of elements are one; between members places at ends of elements stand for the
line, and elements are halved where it ends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Mesh, breaks_of
from ..mechanics.segments import SAME_CUT, standing
from ..solvers.prepared import Solved
from .closest import LIFTED, Closest
from .pairs import ONE, SAME, Near, Pair, PairKey

__all__ = [
    "AT_END",
    "LINE",
    "SHORT_LINE",
    "SLIVER",
    "Lines",
    "Points",
    "begun",
    "ends_of",
    "lies_along",
    "on_line",
    "points_of",
]

Points = tuple[ContactPoint, ...]

LINE, SHORT_LINE, SHORT, ROUND = 3, 2, 4.0, 0.2
"""Number of points of a pair of members from which on it is taken for a line, and where they cannot slide, parts into
which that is divided, and angle of something round along which a part is at most, rad.
"""

BESIDE, LOCATED = 2, 8.0
"""Elements on either side of the end of a line that are halved, until what the force there bends in one of them is less
than so many times the accuracy: an eighth of it is the rotation by a force that is off by half an element.
"""

FLAT = 1e-3
"""Gap between places where members touch each other, over the sum of the radii, up to which these are seen as one
line where they cannot slide: what members may penetrate each other by, too.
"""

LEVEL = 1e-3
"""Gap, over the size, up to which a member lies along an obstacle between two places at which it touches: on lines none
was found, and 2e-3 and 5e-3 where it touched a drum with both ends and in its middle.
"""

MORE = 3
"""Ends of elements beside a line that may become part of it at once."""

ASIDE, AHEAD = 4e-6, 0.2
"""How far beside a point it is seen how the member bends away: a fraction of its length, and a share of the element."""

NEXT = 1e-2
"""Length of an element on a line, over the unit of length, of which no halves are made: how far forces at its ends bend
it goes with its cube: rounding of gaps leaves a share of 1e-10 of these open here, and 1e-4 in a hundredth of it.
"""

MOSTLY = 0.9
"""Share of what presses on the last element of a line from which on that does so where it ends."""

SHARE = 0.25
"""As ``NEXT``, a share of short lines."""

SLIVER = 0.25
"""Share of an element up to which its end is moved to a place, rather than that another one is made there."""

BESIDE_NODE = 1e-3
"""Share of an element up to which no end of elements is made beside a node of several members: what a force bends there
is a millionth of what it bends in the element, and what is so short leaves rounding.
"""

AT_END, PARTED, FEW = 0.02, 1e-2, 3
"""Share of two elements up to which a place is where they meet; length, over the unit of length, of lines on the way up
to which a point is parted into their ends; ends of elements on so short a line up to which it is seen as a point.
"""


REACH = 0.02
"""Gap between members, over the size, up to which ends of elements on a line may begin to touch in one step."""


class Lines:
    """The lines of a scene.

    Parameters
    ----------
    scene : Scene
    closest : Closest
    fixed : collection of str
        Members whose mesh is prescribed.

    Attributes
    ----------
    keys : frozenset
        Contacts and members that touch along lines, at nodes of the first one.
    finer : float
        Share of the parts into which lines are divided that is taken.
    ending : frozenset
        Those with friction of which it is solved for where they end.
    """

    def __init__(self, scene: Scene, closest: Closest, fixed: Collection[str]) -> None:
        self.scene, self.closest, self.fixed = scene, closest, fixed
        self.keys: frozenset[PairKey] = frozenset()
        self.finer = 1.0
        self.ending: frozenset[PairKey] = frozenset()

    # -- places -----------------------------------------------------------------------------------

    def bends(self, member: str) -> bool:
        """Whether a member may lie along what it touches."""
        return self.scene.members[member].type != "rigid"

    def chosen(self, key: PairKey) -> bool:
        """Whether it is solved for where a line ends: on obstacles, with friction only where a way has ended."""
        return self.closest.pairs[key].stop is not None and (key in self.ending or not self.scene.rubs)

    def has(self, one: ContactPoint | Near) -> bool:
        """Whether a place is one of those along a line: not where the second member ends, which slides on the first,
        nor where a line ends.
        """
        return one.pair in self.keys and beside_ends(one) and not slides(one)

    def set_out(self, mesh: Mesh, points: Sequence[ContactPoint]) -> list[ContactPoint]:
        """Points with their numbers on a mesh, and whether they stand for what is spread along a line."""

        def spread(point: ContactPoint) -> bool:
            on_line = len(point.members) == 1 and self.has(point) and standing(mesh, point, 0) is not None
            return on_line and self.bends(point.members[0]) and not (self.chosen(point.pair) and all(point.sides))

        found = list[ContactPoint]()
        for i, point in enumerate(points):
            line = spread(point)
            same = point.number == i and point.line == line
            found.append(point if same else replace(point, number=i, line=line))
        return found

    def laid(self, near: Iterable[Near]) -> list[ContactPoint]:
        """The points of ends of elements that begin to touch along a line."""
        return [point for one in near for point in self._laid(begun(one))]

    def _laid(self, point: ContactPoint) -> Iterator[ContactPoint]:
        if not self.chosen(point.pair):
            yield point
            return
        at, ends = point.at[0], self.closest.pairs[point.pair].ends
        # Where it is held no obstacle presses at a point.
        if not (at in (0.0, 1.0) and not ends[int(at)]):
            yield point
        if at > 0.0:
            yield replace(point, sides=(True, False))
        if at < 1.0:
            yield replace(point, sides=(False, True))

    def ends_within(self, found: Solved) -> frozenset[PairKey]:
        """Lines on obstacles of which members lift off at an end."""
        fields, lines = found.fields, self.stretches(found)
        beyond = [(key, 0.0, own[0][0]) for key, own in lines.items() if own]
        beyond += [(key, own[-1][-1], 1.0) for key, own in lines.items() if own]
        lifted = (
            key for key, a, b in beyond if a < b and not self.closest.lies(fields, key, a, b, LIFTED * self.scene.size)
        )
        return frozenset(key for key in lifted if self.closest.pairs[key].stop is not None)

    def by_element(self, points: Iterable[ContactPoint]) -> Points:
        """Points with those that may press on one element alone for those of lines that press on two."""
        return tuple(
            one
            for p in points
            for one in (self._laid(replace(p, grip=None, line=False)) if p.line and self.chosen(p.pair) else [p])
        )

    def beside(
        self, mesh: Mesh, points: Sequence[ContactPoint], fields: Fields, between: bool = False
    ) -> list[ContactPoint]:
        """Places near those on lines on obstacles, or inside, that are none of given points; with ``between`` those on
        lines between members, too.
        """
        found, known = list[ContactPoint](), {(p.pair, p.at, p.sides) for p in points}
        for key in sorted(self.keys):
            pair = self.closest.pairs[key]
            cuts, own = mesh.cuts[pair.members[0]], [p.at[0] for p in points if p.pair == key]
            if pair.stop is None:
                if between:
                    about = self.closest.along(fields, pair, mesh, REACH * self.scene.size)
                    found += [begun(one) for one in about if one.at[0] not in own]
                continue
            ends = self._known_ends(mesh, points, key)
            near = {one.at[0]: one for one in self.closest.along(fields, pair, mesh, np.inf)}
            on = np.isin(cuts, own) | np.array([near[x].gap < 0.0 for x in cuts.tolist()])
            beyond = np.clip(np.searchsorted(cuts, ends), 1, len(cuts) - 1)
            on[beyond] = on[beyond - 1] = True
            apart = np.abs(np.arange(len(cuts))[:, None] - np.flatnonzero(on))
            laid = self.laid(near[x] for x in cuts[apart.min(axis=1, initial=len(cuts)) <= MORE].tolist())
            # Within a line nothing presses at a point.
            inner = {x for x in own if all((key, (x,), sides) in known for sides in ((True, False), (False, True)))}
            laid = [p for p in self.allowed(mesh, points, laid) if not (all(p.sides) and p.at[0] in inner)]
            found += [p for p in laid if (p.pair, p.at, p.sides) not in known]
        return found

    @staticmethod
    def _known_ends(mesh: Mesh, points: Iterable[ContactPoint], key: PairKey) -> list[float]:
        """Where a line on an obstacle ends of which that is known."""
        own = (p for p in points if p.pair == key and all(p.sides))
        return [p.at[0] for p in own if slides(p) or standing(mesh, p, 0) is None]

    def allowed(self, mesh: Mesh, points: Sequence[ContactPoint], laid: Iterable[ContactPoint]) -> list[ContactPoint]:
        """Of points that may begin to push those that do not stand for what is known: where lines end.

        There one point presses, and nothing is spread along the element within which it is.
        """
        allowed, taken = list[ContactPoint](), dict[PairKey, set[int]]()
        for point in laid:
            pair = point.pair
            if not all(point.sides):
                if pair not in taken:
                    taken[pair] = self._without_pressure(mesh, points, pair)
                found = self.element_of(mesh, point)
                no = found is not None and found[1] in taken[pair]
            else:
                at_node = point.at[0] in (0.0, 1.0)
                # At a node from which a member rises it may be pressed, wherever it lies beyond that.
                no = self.chosen(pair) and bool(self._known_ends(mesh, points, pair))
                no &= not at_node or self._lies_beside(mesh, points, pair, point.at[0])
                no |= at_node and self._node(point) in self._nodes(points, pair)
            allowed += [] if no else [point]
        return allowed

    @staticmethod
    def _lies_beside(mesh: Mesh, points: Iterable[ContactPoint], key: PairKey, end: float) -> bool:
        """Whether points of a line are on the element beside an end of its member, beyond that."""
        x = mesh.cuts[key[1][0]][1 if end == 0.0 else -2]
        reach = abs(x - end) + SAME_CUT
        return any(p.pair == key and p.at[0] != end and abs(p.at[0] - end) <= reach for p in points)

    @staticmethod
    def element_of(mesh: Mesh, point: ContactPoint) -> tuple[PairKey, int] | None:
        """What a point presses on along one element, and the number of that; None where it does not."""
        spread = not all(point.sides)
        return (point.pair, mesh.cut_at(point.members[0], point.at[0]) - point.sides[0]) if spread else None

    def _node(self, point: ContactPoint) -> str:
        """The node at an end of the first member of a point."""
        return self.scene.members[point.members[0]].nodes[int(point.at[0])]

    def _nodes(self, points: Iterable[ContactPoint], pair: PairKey) -> set[str]:
        """Nodes at which other members touch the obstacle of a pair."""
        others = (p for p in points if p.contact == pair[0] and p.pair != pair and all(p.sides) and len(p.at) == 1)
        return {self._node(p) for p in others if p.at[0] in (0.0, 1.0)}

    def _without_pressure(self, mesh: Mesh, points: Iterable[ContactPoint], key: PairKey) -> set[int]:
        """The elements within which a line ends of which that is known; where elements end there, those beyond it."""
        cuts, taken = mesh.cuts[key[1][0]], set[int]()
        own = [p for p in points if p.pair == key]
        pressed = {found[1] for found in (self.element_of(mesh, p) for p in own) if found}
        for x in self._known_ends(mesh, own, key):
            e = mesh.element_at(key[1][0], x)
            margin = AT_END * float(cuts[e + 1] - cuts[e])
            if cuts[e] + margin < x < cuts[e + 1] - margin:
                taken.add(e)
                continue
            cut = e if x - cuts[e] < cuts[e + 1] - x else e + 1
            within = {cut - 1, cut} & pressed
            taken |= {cut - 1, cut} - within if len(within) == 1 else set()
        # Beyond the ends of the member there are none.
        return taken & set(range(len(cuts) - 1))

    def deepest(self, fields: Fields, points: Sequence[ContactPoint], tolerance: float) -> list[Near]:
        """Of ends of elements on lines that penetrate, and are none of given points, those that do so more than the
        ones beside them; by more than ``tolerance``, m, but with friction on obstacles.
        """
        found: list[Near] = []
        for key in sorted(self.keys):
            pair = self.closest.pairs[key]
            cuts = fields.model.mesh.cuts[pair.members[0]]
            known = {p.at[0] for p in points if p.pair == pair.key}
            # What is within the element in which a line ends is seen when elements end there.
            taken = self._without_pressure(fields.model.mesh, points, key) if self.chosen(key) else set()
            known |= {float(cuts[i]) for e in taken for i in (e, e + 1)}
            along = self.closest.along(fields, pair, fields.model.mesh, 0.0)
            near = {one.at[0]: one for one in along if one.at[0] not in known}
            gaps = np.array([near[x].gap if x in near else 0.0 for x in cuts.tolist()])
            padded = np.concatenate([[0.0], gaps, [0.0]])
            # Where all of it is nearly at a gap of zero what is in by rounding would come and go.
            least = tolerance if pair.stop is None or self.chosen(key) else tolerances.CLOSED * self.scene.size
            deep = (gaps <= padded[:-2]) & (gaps <= padded[2:]) & (gaps < -least)
            found += [near[x] for x in cuts[deep].tolist()]
        return found

    # -- from points to lines and back ------------------------------------------------------------

    def lengthened(self, found: Solved, points: Points, least: int = LINE) -> tuple[Mesh, Points] | None:
        """Mesh and points where a pair that touches at so many places is a line from now on; None for none.

        ``points`` are those of the state, or those with which none was found near it.

        Members that touch each other become one where they are as near between the places, and with ``SHORT_LINE``
        alone: where these cannot slide.
        """
        for key, pair in self.closest.pairs.items():
            own = [p for p in points if p.pair == key and beside_ends(p)]
            if not own or pair.edge or not self.bends(pair.members[0]):
                continue
            places = [point.at[0] for point in own]
            # What touches at a node touches with all members there.
            places += [x for x in self._shared(pair, points) if x not in places]
            # Points that have slid to where others are, or begin there, make no line.
            apart = np.diff(np.sort(places)) * self.closest.lengths[pair.members[0]] >= ONE * SAME * pair.width
            count = 1 + int(apart.sum())
            if key in self.keys:
                stays = self.chosen(key) or not any(map(slides, own))
            elif pair.stop is None:
                flat = [] if least == LINE or count < LINE else self._flat(found, pair, places)
                stays, places = not flat, flat or places
            else:
                stays = count < least or (least == LINE and not self._level(found, pair, places))
            if stays:
                continue
            return self._as_line(found, found.model.mesh, pair, places)
        return None

    def _as_line(self, found: Solved, mesh: Mesh, pair: Pair, places: Sequence[float]) -> tuple[Mesh, Points]:
        """A mesh and points where a pair that touches at some places is a line from now on."""
        self.keys |= {pair.key}
        longest = self._longest(found.fields, pair, places)
        low, high = min(places) - longest, max(places) + longest
        mesh = self.divided(found.fields, replace(mesh, points=()), pair, places)
        near = self.closest.along(found.fields, pair, mesh, 0.1 * pair.width)
        own = [point for point in points_of(found) if point.pair == pair.key and beside_ends(point)]
        # What touches elsewhere does so at the nearest ends of elements.
        cuts = mesh.cuts[pair.members[0]]
        elsewhere = {float(cuts[mesh.cut_at(pair.members[0], p.at[0])]) for p in own if not low <= p.at[0] <= high}
        others = tuple(point for point in points_of(found) if point not in own)
        return mesh, (*others, *self.laid(one for one in near if low <= one.at[0] <= high or one.at[0] in elsewhere))

    def parallel(self, found: Solved, mesh: Mesh) -> tuple[Mesh, Points] | None:
        """The mesh and points where members that touch each other, and are as near between the places, are a line from
        now on; None for none.
        """
        for key, pair in self.closest.pairs.items():
            own = [p for p in points_of(found) if p.pair == key and beside_ends(p)]
            if pair.stop is not None or key in self.keys or len(own) < LINE or not self.bends(pair.members[0]):
                continue
            places = self._flat(found, pair, [point.at[0] for point in own])
            if places:
                return self._as_line(found, mesh, pair, places)
        return None

    def _flat(self, found: Solved, pair: Pair, places: Sequence[float]) -> list[float]:
        """Of places at which two members touch each other the most in succession, three or more, between which they
        are as near as there; none where there are none.
        """
        ordered = np.sort(places)
        middles = 0.5 * (ordered[1:] + ordered[:-1])
        near = {one.at[0] for one in self.closest.beside(found.fields, pair, middles, FLAT * pair.distance)}
        apart = [i + 1 for i, x in enumerate(middles.tolist()) if x not in near]
        longest = max(np.split(ordered, apart), key=len)
        return longest.tolist() if len(longest) >= LINE else []

    def _level(self, found: Solved, pair: Pair, places: Sequence[float]) -> bool:
        """Whether a member is near to an obstacle somewhere between two places at which it touches that."""
        middles = 0.5 * (np.sort(places)[1:] + np.sort(places)[:-1])
        gaps = (self.closest.gap_at(found.fields, pair.key, x) for x in middles.tolist())
        return min(gaps, default=0.0) < LEVEL * self.scene.size

    def _shared(self, pair: Pair, points: Points) -> list[float]:
        """Ends of the member of a pair on an obstacle that are nodes at which points of other members are."""
        nodes = self._nodes(points, pair.key)
        return [
            x for x, node in zip((0.0, 1.0), self.scene.members[pair.members[0]].nodes, strict=True) if node in nodes
        ]

    def _longest(self, fields: Fields, pair: Pair, places: Sequence[float]) -> float:
        """Longest part of the first member of a pair between places of a line, a fraction of its length."""
        member, length, turn = pair.members[0], self.closest.lengths[pair.members[0]], pair.turn
        if pair.stop is not None:
            # Along the axis of a cylinder members are not bent, however thin that is.
            _, tangents = fields.seen(pair.contact, np.zeros((1, 3)), fields.tangents(member, np.array(places)))
            turn /= max(float(((tangents @ pair.stop.across) ** 2).sum(axis=1).max()), TINY)
        longest = max((max(places) - min(places)) / SHORT, 0.5 * pair.width / length)
        return float(min(longest, ROUND * turn / length)) * self.finer

    def divided(self, fields: Fields, mesh: Mesh, pair: Pair, places: Sequence[float]) -> Mesh:
        """A mesh with elements of the first member that are not too long near the places of a line."""
        first, longest = pair.members[0], self._longest(fields, pair, places)
        low, high = min(places) - longest, max(places) + longest
        while first not in self.fixed:
            cuts = mesh.cuts[first]
            long = (np.diff(cuts) > longest) & (cuts[1:] > low) & (cuts[:-1] < high)
            if not long.any():
                return mesh
            marks = {name: np.zeros(len(c) - 1, bool) for name, c in mesh.cuts.items()}
            mesh = mesh.refined(marks | {first: long})
        return mesh

    def forget(self, found: Solved, mesh: Mesh, points: Iterable[ContactPoint]) -> None:
        """What touches at places that all slide, or will, is no line, unless a member lies between them in a state."""
        on = {p.pair for p in points if self.has(p) and standing(mesh, p, 0) is not None}
        lost = {key for key in self.keys - on if self.chosen(key)}
        lies = self.followed(found) if lost else {}
        self.keys -= {key for key in lost if all(len(stretch) == 1 for stretch in lies[key])}

    # -- ends -------------------------------------------------------------------------------------

    def stretches(self, found: Solved, lifted: float = 0.0) -> dict[PairKey, list[list[float]]]:
        """Of each line the stretches that touch: where they begin, ends of elements within, and where they end.

        Between them members are lifted by more than ``lifted``, m.
        """
        stretches: dict[PairKey, list[list[float]]] = {}
        mesh, points = found.model.mesh, points_of(found)
        for key in sorted(key for key in self.keys if self.bends(key[1][0])):
            cuts = mesh.cuts[key[1][0]]
            own = sorted(self._extent(cuts, p) for p in points if p.pair == key and beside_ends(p))
            spans = list[list[float]]()
            last, slid = -2.0, False
            for begin, end, low, high, ends in own:
                beside = begin <= last + 1.0 and not (ends and slid)
                # Also where nothing presses between: what is flat there may have no weight.
                if spans and (beside or self.closest.lies(found.fields, key, spans[-1][1], low, lifted)):
                    spans[-1][1] = max(spans[-1][1], high)
                else:
                    spans.append([low, high])
                last, slid = max(last, end), ends
            stretches[key] = [
                [low, *cuts[(cuts > low) & (cuts < high)].tolist(), *([high] if high > low else [])]
                for low, high in spans
            ]
        return stretches

    @staticmethod
    def _extent(cuts: Array, point: ContactPoint) -> tuple[float, float, float, float, bool]:
        """Of a point the first and the last number of ends of elements, half of one within an element, where it begins
        and ends, and whether it slides.
        """
        at = point.at[0]
        cut = int(np.argmin(np.abs(cuts - at)))
        if slides(point) and abs(cuts[cut] - at) > SAME_CUT:
            number = float(np.searchsorted(cuts, at)) - 0.5
            return number, number, at, at, True
        first, last = cut, cut
        if point.line and not all(point.sides):
            first, last = cut - point.sides[0], cut + point.sides[1]
            return float(first), float(last), float(cuts[first]), float(cuts[last]), False
        return float(cut), float(cut), at, at, slides(point)

    def with_sliding_ends(
        self, found: Solved, points: Sequence[ContactPoint], pushes: Array, lines: Mapping[PairKey, list[list[float]]]
    ) -> tuple[Points, int]:
        """Points of which one stands for all that presses on the last element at each end of lines, and none within
        presses at a point; how many are others.

        ``lines`` are those of :meth:`followed`.
        """
        kept, new, mesh = list(points), list[ContactPoint](), found.model.mesh
        force = {p.key: max(push, 0.0) for p, push in zip(points, pushes.tolist(), strict=True)}
        for key, stretches in lines.items():
            longest = PARTED * found.model.scales.length / self.closest.lengths[key[1][0]]
            for stretch in stretches:
                sides = [(stretch[0], stretch[1:2]), (stretch[-1], stretch[-2:-1])]
                if len(stretch) <= FEW and stretch[-1] - stretch[0] < longest:
                    # What is so short is seen as one point, see :meth:`parted`.
                    sides = [(stretch[0], stretch[-1:])]
                for end, beside in sides:
                    outer = self._within(mesh, kept, key, min([end, *beside]), max([end, *beside]))
                    pressed = sum(force[p.key] for p in outer)
                    if len(sides) > 1:
                        at_end = [p for p in outer if all(p.sides) and (slides(p) or p.at[0] == end)]
                        known = any(slides(p) or force[p.key] >= MOSTLY * pressed for p in at_end)
                    else:
                        known = all(all(p.sides) for p in outer) and (len(outer) == 1 or all(map(slides, outer)))
                    if known or pressed == 0.0 or (end in (0.0, 1.0) and self._lies_at(found.fields, key, end)):
                        continue
                    at = sum(force[p.key] * self._middle(mesh, p) for p in outer) / pressed
                    normal = self.closest.pairs[key].normal
                    # It stays until its force is known, as what begins to touch does.
                    still = ContactPoint(*key, (at,), (False,), outer[0].distance, normal=normal)
                    kept, new = [p for p in kept if p not in outer], [*new, still]
        ends, every = ends_of(lines), (*points, *new)
        points_within = (p for p in kept if all(p.sides) and self.has(p) and p.pair in lines)
        inner = [p for p in points_within if (p.pair, p.at[0]) not in ends and self._known_ends(mesh, every, p.pair)]
        # Where both ends of a stretch are known nothing says where between them a place slides.
        for key, own in lines.items():
            sliding = [p for p in kept if p.pair == key and self.ends_slide([p])]
            for stretch in own:
                first, last = (self._at(mesh, sliding, key, end) for end in (stretch[0], stretch[-1]))
                between = (p for p in sliding if stretch[0] < p.at[0] < stretch[-1])
                inner += [p for p in between if first and last and p not in (*first, *last)]
        return (*(p for p in kept if p not in inner), *new), len(new) + len(inner)

    @staticmethod
    def _at(mesh: Mesh, points: Iterable[ContactPoint], key: PairKey, end: float) -> list[ContactPoint]:
        """Those of points of a line that are where it ends, or beside the end of elements that was made for that."""
        e = mesh.element_at(key[1][0], end)
        margin = AT_END * float(np.diff(mesh.cuts[key[1][0]])[e])
        return [p for p in points if p.pair == key and abs(p.at[0] - end) <= margin]

    def _within(
        self, mesh: Mesh, points: Iterable[ContactPoint], key: PairKey, low: float, high: float
    ) -> list[ContactPoint]:
        """Points of a line between two places."""
        cuts = mesh.cuts[key[1][0]]
        own = ((p, self._extent(cuts, p)) for p in points if p.pair == key and beside_ends(p))
        return [p for p, (*_, a, b, _) in own if low - SAME_CUT <= a and b <= high + SAME_CUT]

    def _middle(self, mesh: Mesh, point: ContactPoint) -> float:
        """Where a point presses: what is spread along an element does so at a third of it from where it is largest."""
        *_, low, high, _ = self._extent(mesh.cuts[point.members[0]], point)
        return low + (high - low) * (0.5 if all(point.sides) else 2.0 / 3.0 if point.sides[0] else 1.0 / 3.0)

    def _lies_at(self, fields: Fields, key: PairKey, end: float) -> bool:
        """Whether a member is on an obstacle at its end."""
        return self.closest.gap_at(fields, key, end) < LIFTED * self.scene.size

    def ends_slide(self, points: Iterable[ContactPoint]) -> bool:
        """Whether it is known where a line ends."""
        return any(slides(p) and p.pair in self.keys and self.chosen(p.pair) for p in points)

    def without_sliding_ends(self, mesh: Mesh, points: Points, fields: Fields) -> Points:
        """Points with what may press at the ends of elements beside them for those that slide where lines end."""
        kept = [p for p in points if not self.ends_slide([p])]
        for p in (p for p in points if self.ends_slide([p])):
            cuts, pair = mesh.cuts[p.members[0]], self.closest.pairs[p.pair]
            i = int(np.clip(np.searchsorted(cuts, p.at[0]), 1, len(cuts) - 1))
            near = [n for n in self.closest.along(fields, pair, mesh, np.inf) if n.at[0] in (cuts[i - 1], cuts[i])]
            have = {(k.at, k.sides) for k in kept if k.pair == p.pair}
            kept += [k for k in self.allowed(mesh, kept, self.laid(near)) if (k.at, k.sides) not in have]
        return tuple(kept)

    def followed(self, found: Solved, times: float = 1.0) -> dict[PairKey, list[list[float]]]:
        """The stretches of lines whose ends slide: on obstacles, of members whose mesh is not prescribed.

        Within one a member may rise by so many times LIFTED of the size.
        """
        every = self.stretches(found, times * LIFTED * self.scene.size)
        return {key: own for key, own in every.items() if self.chosen(key)}

    def points_on(self, mesh: Mesh, found: Solved) -> Points:
        """The points of a state on another mesh, with those of lines at new ends of elements between old ones."""
        points = tuple(p for p in points_of(found) if all(p.sides) or standing(mesh, p, 0) is not None)
        for key, stretches in self.stretches(found).items():
            known = {(p.at[0], p.sides) for p in points if p.pair == key}
            near = self.closest.along(found.fields, self.closest.pairs[key], mesh, np.inf)
            laid = self.laid(one for one in near if any(s[0] <= one.at[0] <= s[-1] for s in stretches))
            ends = {x for stretch in stretches for x in (stretch[0], stretch[-1])}
            laid = self.allowed(mesh, points, laid)
            laid = [p for p in laid if not (self.chosen(key) and all(p.sides)) or p.at[0] in ends]
            points = (*points, *(p for p in laid if (p.at[0], p.sides) not in known))
        return points

    def fitted(
        self, mesh: Mesh, points: Points, *, prescribed: bool = False, sliver: float = SLIVER
    ) -> tuple[Mesh, Points]:
        """A mesh whose elements end where points slide, as members bend otherwise to both sides of a force, and points.

        An end of elements that is near, by a share ``sliver`` of an element, is moved there, and what presses there
        with it, else there is one more; never in a ``prescribed`` mesh, of which the nearest is moved.
        """
        cuts, moved = dict(mesh.cuts), dict[tuple[str, float], float]()
        for point in points:
            for member, x, free in zip(point.members, point.at, point.slides, strict=True):
                if free and 0.0 < x < 1.0 and not self.closest.stiff(member):
                    before = cuts[member]
                    keeps = prescribed or member in self.fixed
                    cuts[member] = after = self._with_end(before, member, x, keeps, sliver)
                    if len(after) == len(before):
                        moved |= {(member, float(before[i])): x for i in np.flatnonzero(after != before)}
        kept = tuple(
            p if slides(p) else replace(p, at=(moved.get((p.members[0], p.at[0]), p.at[0]), *p.at[1:])) for p in points
        )
        return replace(mesh, cuts=cuts, points=()), kept

    def off_ends(self, found: Solved) -> float:
        """How far, over the size, places that slide on what bends are from ends of elements, at most."""
        mesh, most = found.model.mesh, 0.0
        for point in points_of(found):
            for member, x, free in zip(point.members, point.at, point.slides, strict=True):
                if free and 0.0 < x < 1.0 and not self.closest.stiff(member):
                    off = abs(float(mesh.cuts[member][mesh.cut_at(member, x)]) - x)
                    most = max(most, off * self.closest.lengths[member])
        return most / self.scene.size

    def _with_end(self, cuts: Array, member: str, x: float, keeps: bool, sliver: float) -> Array:
        """Ends of elements of a member with one at a place; as many as before if it ``keeps`` their number."""
        near, e = int(np.argmin(np.abs(cuts - x))), int(np.searchsorted(cuts, x))
        if abs(cuts[near] - x) < SAME_CUT:
            return cuts
        moves = np.abs(breaks_of(self.scene, member) - cuts[near]).min() > SAME_CUT
        if moves and (keeps or abs(cuts[near] - x) < sliver * (cuts[e] - cuts[e - 1])):
            return np.where(np.arange(len(cuts)) == near, x, cuts)
        # Where another member goes on a line does, too.
        goes_on = [float(end) for end, node in enumerate(self.scene.members[member].nodes) if self._shares(node)]
        beside = cuts[near] in goes_on and abs(cuts[near] - x) < BESIDE_NODE * (cuts[e] - cuts[e - 1])
        return cuts if keeps or beside else np.insert(cuts, e, x)

    def _shares(self, node: str) -> bool:
        """Whether several members end at a node."""
        return sum(node in member.nodes for member in self.scene.members.values()) > 1

    def long(self, found: Solved) -> dict[str, Array]:
        """Marks of the elements, by member, that are not so short that what pushes at both ends is one force.

        Where members lie, two forces nearer to each other do what one does, to rounding.
        """
        mesh, unit = found.model.mesh, found.model.scales.length
        marks = {name: np.ones(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
        for (_, (member, *_)), stretches in self.stretches(found).items():
            cuts, length = mesh.cuts[member], self.scene.center_lines[member].length
            for stretch in stretches:
                least = min(NEXT * unit / length, SHARE * (stretch[-1] - stretch[0]))
                short = (np.diff(cuts) <= least) & (cuts[1:] > stretch[0]) & (cuts[:-1] < stretch[-1])
                marks[member] &= ~short
        return marks

    def straight(self, found: Solved) -> dict[str, Array]:
        """Marks of the elements, by member, that lie on a plane all along, or on a cylinder along its axis."""
        mesh, fields = found.model.mesh, found.fields
        marks = {name: np.zeros(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
        for key, stretches in self.stretches(found).items():
            stop, member = self.closest.pairs[key].stop, key[1][0]
            if stop is None:
                continue
            cuts = mesh.cuts[member]
            _, tangents = fields.seen(key[0], fields.positions(member, cuts), fields.tangents(member, cuts))
            along = np.linalg.norm(tangents @ stop.across, axis=1) < tolerances.PARALLEL
            for stretch in stretches:
                marks[member] |= (cuts[:-1] >= stretch[0]) & (cuts[1:] <= stretch[-1]) & along[:-1] & along[1:]
        return marks

    def rough_ends(self, found: Solved, accuracy: float) -> dict[str, Array]:
        """Marks of the elements, by member, in which lines end and where that is therefore not known well enough.

        There a force presses at a point, and where in the element is open: what that bends is an error of rotations.
        Not where a line ends at a place that slides.
        """
        fields, mesh = found.fields, found.model.mesh
        marks = {name: np.zeros(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
        pushes = {(p.pair, p.at[0]): fields.contact_point(p)["push"] for p in mesh.points}
        scales, sliding = found.model.scales, [p for p in points_of(found) if self.ends_slide([p])]
        for key, stretches in self.stretches(found).items():
            first = key[1][0]
            lengths = np.diff(mesh.cuts[first]) * self.closest.lengths[first] / scales.length
            for stretch in stretches:
                for at, inner in ((stretch[0], stretch[1:2]), (stretch[-1], stretch[-2:-1])):
                    if not 0.0 < at < 1.0 or self._at(mesh, sliding, key, at):
                        continue
                    force = sum(pushes.get((key, x), 0.0) for x in {at, *inner}) / scales.force
                    cut = mesh.cut_at(first, at)
                    near = slice(max(cut - BESIDE, 0), cut + BESIDE)
                    bends = force * lengths[near] ** 2 / fields.stiffness(first, at)
                    marks[first][near] |= bends > LOCATED * accuracy
        return marks

    def parted(
        self, found: Solved, deep: float, turned: float, known: Collection[PairKey] = ()
    ) -> tuple[Mesh, Points, PairKey | None] | None:
        """Mesh and points with the two ends of a short line in place of one point, and of which pair that is.

        From such a point a member bends into its obstacle, by more than ``deep``, m, or so that all beyond is turned by
        more than ``turned``, rad.  None where there is none, but of ``known`` pairs; at first a mesh with elements
        that end there, of no pair.
        """
        points = points_of(found)
        for i, point in enumerate(points):
            if point.pair in self.keys or point.pair in known or not self._turns_in(found, point, points):
                continue
            (member,), (at,), mesh = point.members, point.at, found.model.mesh
            cuts = mesh.cuts[member]
            cut = int(np.argmin(np.abs(cuts - at)))
            if not 0 < cut < len(cuts) - 1 or abs(cuts[cut] - at) > AT_END * (cuts[cut + 1] - cuts[cut - 1]):
                near = self.closest.found(found.fields, -deep, [self.closest.pairs[point.pair]])
                if any(abs(one.at[0] - at) < np.diff(cuts).max() for one in near):
                    return *self.fitted(mesh, points), None
                continue
            low, high, depth, angle = self._ends_of(found, point, cut)
            short = (high - low) * self.closest.lengths[member] < PARTED * found.model.scales.length
            turns = angle > turned or (short and depth > deep)
            inside = cuts[cut - 1] < low < at < high < cuts[cut + 1]
            if not (turns and inside) or self.closest.alike(point.pair, (low,), (high,)):
                continue
            moves = np.abs(breaks_of(self.scene, member) - cuts[cut]).min() > SAME_CUT
            ends = np.sort([*(np.delete(cuts, cut) if moves else cuts), low, high])
            # They stay until their force is known, as what begins to touch does.
            stays = replace(point, slides=(False,), normal=self.closest.pairs[point.pair].normal)
            both = replace(stays, at=(low,)), replace(stays, at=(high,))
            mesh = replace(mesh, cuts={**mesh.cuts, member: ends}, points=())
            return mesh, (*points[:i], *both, *points[i + 1 :]), point.pair
        return None

    def _ends_of(self, found: Solved, point: ContactPoint, cut: int) -> tuple[float, float, float, float]:
        """Ends of the line that a point at an end of elements stands for, where the curvature of the gap would be zero;
        how deep the member is in beside the point, m, and what the line turns it by, rad.
        """
        (member,), (at,) = point.members, point.at
        cuts, length = found.model.mesh.cuts[member], self.closest.lengths[member]
        ends, depth, angle = [at, at], 0.0, 0.0
        for side, way in enumerate((-1, 1)):
            grows, bends = self._curves(found.fields, point.pair, at, way, abs(float(cuts[cut + way]) - at))
            if bends < 0.0 < grows:
                apart = -bends / grows
                ends[side] += way * apart
                # The gap is g = bends s^2 / 2 + grows s^3 / 6.
                depth = max(depth, -2.0 / 3.0 * bends * (apart * length) ** 2)
                angle -= 0.5 * bends * apart * length
        return ends[0], ends[1], depth, angle

    def _turns_in(self, found: Solved, point: ContactPoint, points: Points) -> bool:
        """Whether a member bends into its obstacle where it slides on it, and that is no end of a short line."""
        if point.slides != (True,) or point.edge or not self.bends(point.members[0]) or point.members[0] in self.fixed:
            return False
        (at,), fields = point.at, found.fields
        others = (p.at[0] for p in points if p.pair == point.pair and p.at != point.at)
        turns = 0.0 < at < 1.0 and self.closest.bends(fields, point.pair, at) < 0.0
        return turns and not any(self.closest.lies(fields, point.pair, at, x) for x in others)

    def _curves(self, fields: Fields, key: PairKey, at: float, way: int, room: float) -> tuple[float, float]:
        """How the curvature of the gap grows away from a place on one side, 1/m, and what it is there, 1/m.

        It is seen over a share of the ``room`` there, a fraction of the length.
        """
        places = ASIDE + AHEAD * room * np.array([0.0, 0.5, 1.0])
        _, grows, bends = np.polyfit(places, [self.closest.bends(fields, key, at + way * x) for x in places], 2)
        return float(grows), float(bends)


def points_of(found: Solved) -> Points:
    """The points of a state, where they are now."""
    return found.fields.contact_points


def ends_of(lines: Mapping[PairKey, list[list[float]]]) -> set[tuple[PairKey, float]]:
    """Where lines begin and end."""
    return {(key, end) for key, own in lines.items() for stretch in own for end in (stretch[0], stretch[-1])}


def slides(one: ContactPoint | Near) -> bool:
    """Whether a place on the first member is an unknown."""
    return isinstance(one, ContactPoint) and one.slides[0]


def lies_along(points: Iterable[ContactPoint]) -> bool:
    """Whether some points stand for a line on an obstacle."""
    alone = (point for point in points if len(point.members) == 1 and not point.new)
    return any(point.line or (not point.slides[0] and 0.0 < point.at[0] < 1.0) for point in alone)


def on_line(point: ContactPoint) -> bool:
    """Whether a point stands for a line: it stays on the first of two members within that."""
    if len(point.members) == 1:
        return point.line
    return all(0.0 < x < 1.0 for x in point.at) and not point.slides[0] and not point.new


def beside_ends(one: ContactPoint | Near) -> bool:
    """Whether a place is not where the second member ends."""
    return all(0.0 < x < 1.0 for x in one.at[1:])


def begun(near: Near) -> ContactPoint:
    """A point that begins where surfaces are nearest to each other."""
    x, y, z = near.normal.tolist()
    still = (False,) * len(near.at)
    normal = (x, y, z)
    return ContactPoint(
        near.contact, near.members, near.at, still, near.distance, normal=normal, new=True, edge=near.edge
    )
