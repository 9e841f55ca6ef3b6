"""Lines: members that lie along an obstacle, or along each other, and the places that stand for that on a mesh.

On an obstacle without friction each element has two forces that are spread along it, one that rises from its start and
one that falls towards its end, and each end of elements has one that presses at a point, see
:mod:`~sfetcas.mechanics.contact_lines`.  Which of them push is solved for, see :mod:`~sfetcas.solvers.one_sided`; so
they make any pressure that is linear along elements, and the forces with which a line presses where it ends.  Elements
are made to end there.  With friction both forces beside an end of elements are one; between members places at ends of
elements stand for the line, and elements are halved where it ends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Mesh, breaks_of
from ..mechanics.segments import SAME_CUT, standing
from ..solvers.prepared import Solved
from .closest import Closest, Near, Pair, PairKey

__all__ = ["FEWEST", "LINE", "SHORT_LINE", "Lines", "Points", "begun", "points_in", "points_of"]

Points = tuple[ContactPoint, ...]

LINE, SHORT_LINE, SHORT, ROUND = 3, 2, 4.0, 0.2
"""Number of points of a pair of members from which on it is taken for a line, and where they cannot slide, parts into
which that is divided, and angle of something round along which a part is at most, rad.
"""

BESIDE, LOCATED = 2, 8.0
"""Elements on either side of the end of a line that are halved, until what the force there bends in one of them is less
than so many times the accuracy: an eighth of it is the rotation by a force that is off by half an element.
"""

MORE = 3
"""Ends of elements beside a line that may become part of it at once."""

LEAST = 1e-2
"""Gap, over the unit of length, up to which it is looked where it is least."""

ASIDE, AHEAD, ROOM = 4e-6, 0.3, 0.7
"""How far beside the end of a line it is seen how the member bends away, fraction of its length, and share of the room
that elements have to be moved after which it is seen again; share of an element that is room.
"""

NEXT = 2e-4
"""Length of an element, over the unit of length, of which no halves are made: what it yields goes with its cube."""

SLIVER = 0.25
"""Share of an element up to which its end is moved to a place, rather than that another one is made there."""

SHARES = 0.2, 3.0
"""Of how far an end is moved what is missing falls by, between which that is taken for the rest as well."""

AT_END, PARTED = 0.02, 1e-2
"""Share of two elements up to which a place is where they meet; length, over the unit of length, of lines on the way up
to which a point is parted into their ends.
"""

SLENDEREST = 0.05
"""Length of an element beside the end of a line at least, over the shorter one before."""

FEWEST, SPREAD = 2, 1e-2
"""Ends of elements on a line up to which it may be a point, and share of what presses along it up to which its ends may
stand for it: a twelfth of that, and of its length, is what they move by.
"""


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
    """

    def __init__(self, scene: Scene, closest: Closest, fixed: Collection[str]) -> None:
        self.scene, self.closest, self.fixed = scene, closest, fixed
        self.keys: frozenset[PairKey] = frozenset()
        self.finer = 1.0

    # -- places -----------------------------------------------------------------------------------

    def bends(self, member: str) -> bool:
        """Whether a member may lie along what it touches."""
        return self.scene.members[member].type != "rigid"

    def chosen(self, key: PairKey) -> bool:
        """Whether it is solved for which places of a line push: on obstacles without friction."""
        return self.closest.pairs[key].stop is not None and not self.scene.rubs

    def has(self, one: ContactPoint | Near) -> bool:
        """Whether a place is one of those along a line: not where the second member ends, which slides on the first."""
        return one.pair in self.keys and beside_ends(one)

    def set_out(self, mesh: Mesh, points: Sequence[ContactPoint]) -> list[ContactPoint]:
        """Points with their numbers on a mesh, and whether they stand for what is spread along a line."""

        def spread(point: ContactPoint) -> bool:
            on_line = len(point.members) == 1 and self.has(point) and standing(mesh, point, 0) is not None
            return on_line and self.bends(point.members[0]) and not (self.chosen(point.pair) and all(point.sides))

        return [replace(point, number=i, line=spread(point)) for i, point in enumerate(points)]

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

    def beside(self, mesh: Mesh, points: Sequence[ContactPoint], fields: Fields) -> list[ContactPoint]:
        """Places near those on lines on obstacles, or inside, that are none of given points."""
        found, known = list[ContactPoint](), {(p.pair, p.at, p.sides) for p in points}
        for key in sorted(self.keys):
            pair = self.closest.pairs[key]
            if pair.stop is None:
                continue
            cuts, own = mesh.cuts[pair.members[0]], [p.at[0] for p in points if p.pair == key]
            near = {one.at[0]: one for one in self.closest.along(fields, pair, mesh, np.inf)}
            on = np.isin(cuts, own) | np.array([near[x].gap < 0.0 for x in cuts.tolist()])
            apart = np.abs(np.arange(len(cuts))[:, None] - np.flatnonzero(on))
            laid = self.laid(near[x] for x in cuts[apart.min(axis=1, initial=len(cuts)) <= MORE].tolist())
            # Within a line nothing presses at a point.
            inner = {x for x in own if all((key, (x,), sides) in known for sides in ((True, False), (False, True)))}
            laid = [p for p in laid if not (all(p.sides) and p.at[0] in inner)]
            found += [p for p in laid if (p.pair, p.at, p.sides) not in known]
        return found

    def deepest(self, fields: Fields, points: Sequence[ContactPoint], tolerance: float) -> list[Near]:
        """Of ends of elements on lines that penetrate, and are none of given points, those that do so more than the
        ones beside them; by more than ``tolerance``, m, but with friction on obstacles.
        """
        found: list[Near] = []
        for key in sorted(self.keys):
            pair = self.closest.pairs[key]
            cuts = fields.model.mesh.cuts[pair.members[0]]
            known = {p.at[0] for p in points if p.pair == pair.key}
            along = self.closest.along(fields, pair, fields.model.mesh, 0.0)
            near = {one.at[0]: one for one in along if one.at[0] not in known}
            gaps = np.array([near[x].gap if x in near else 0.0 for x in cuts.tolist()])
            padded = np.concatenate([[0.0], gaps, [0.0]])
            # Where all of it is nearly at a gap of zero what is in by rounding would come and go.
            least = tolerance if pair.stop is None or self.chosen(key) else tolerances.DECIMAL * pair.width
            deep = (gaps <= padded[:-2]) & (gaps <= padded[2:]) & (gaps < -least)
            found += [near[x] for x in cuts[deep].tolist()]
        return found

    # -- from points to lines and back ------------------------------------------------------------

    def lengthened(self, found: Solved, least: int = LINE) -> tuple[Mesh, Points] | None:
        """Mesh and points where a pair that touches at so many places is a line from now on; None for none."""
        points, mesh = points_of(found), replace(found.model.mesh, points=())
        for key, pair in self.closest.pairs.items():
            own = [p for p in points if p.pair == key and beside_ends(p)]
            if not own or pair.edge or not self.bends(pair.members[0]):
                continue
            places = [point.at[0] for point in own]
            # What touches at a node touches with all members there.
            places += [x for x in self._shared(pair, points) if x not in places]
            needed = least if pair.stop is not None else LINE
            if len(places) < needed if key not in self.keys else not any(point.slides[0] for point in own):
                continue
            self.keys |= {key}
            longest = self._longest(pair, places)
            low, high = min(places) - longest, max(places) + longest
            mesh = self.divided(mesh, pair, places)
            near = self.closest.along(found.fields, pair, mesh, 0.1 * pair.width)
            others = tuple(point for point in points if point not in own)
            return mesh, (*others, *self.laid(one for one in near if low <= one.at[0] <= high))
        return None

    def _shared(self, pair: Pair, points: Points) -> list[float]:
        """Ends of the member of a pair on an obstacle that are nodes at which points of other members are."""
        members = self.scene.members
        others = [p for p in points if p.contact == pair.contact and len(p.members) == 1 and p.at[0] in (0.0, 1.0)]
        nodes = {members[p.members[0]].nodes[int(p.at[0])] for p in others}
        return [x for x, node in zip((0.0, 1.0), members[pair.members[0]].nodes, strict=True) if node in nodes]

    def _longest(self, pair: Pair, places: Sequence[float]) -> float:
        """Longest part of the first member of a pair between places of a line, a fraction of its length."""
        length = self.closest.lengths[pair.members[0]]
        longest = max((max(places) - min(places)) / SHORT, 0.5 * pair.width / length)
        return float(min(longest, ROUND * pair.turn / length)) * self.finer

    def divided(self, mesh: Mesh, pair: Pair, places: Sequence[float]) -> Mesh:
        """A mesh with elements of the first member that are not too long near the places of a line."""
        first, longest = pair.members[0], self._longest(pair, places)
        low, high = min(places) - longest, max(places) + longest
        while first not in self.fixed:
            cuts = mesh.cuts[first]
            long = (np.diff(cuts) > longest) & (cuts[1:] > low) & (cuts[:-1] < high)
            if not long.any():
                return mesh
            marks = {name: np.zeros(len(c) - 1, bool) for name, c in mesh.cuts.items()}
            mesh = mesh.refined(marks | {first: long})
        return mesh

    def shortened(self, found: Solved, tolerance: float) -> tuple[frozenset[PairKey], list[Near]]:
        """Lines on obstacles for which points may stand, and where these are.

        Where the force is, of lines of one element; both ends of those on which so little is spread that it neither
        bends the member between them by more than ``tolerance``, m, nor moves them.
        """
        fields, scales, near = found.fields, found.model.scales, list[Near]()
        told = [(point, fields.contact_point(point)["push"]) for point in found.model.mesh.points]
        short = set[PairKey]()
        for key, stretches in self.stretches(found).items():
            own = [(point, max(push, 0.0)) for point, push in told if point.pair == key]
            pressed = sum(push for point, push in own if point.line)
            # As a beam that is clamped at both ends.
            softness = self.closest.lengths[key[1][0]] ** 3 / (384.0 * scales.force * scales.length**2)
            sag = max(pressed * (s[-1] - s[0]) ** 3 / fields.stiffness(key[1][0], s[0]) for s in stretches) * softness
            little = sag < tolerance and pressed < SPREAD * sum(push for _, push in own)
            if not self.chosen(key) or not (little or all(len(stretch) <= FEWEST for stretch in stretches)):
                continue
            short.add(key)
            places = list[float]()
            for stretch in stretches:
                if len(stretch) > FEWEST:
                    places += [stretch[0], stretch[-1]]
                    continue
                at, pushes = np.array([(p.at[0], push) for p, push in own if p.at[0] in stretch]).T
                if pushes.any():
                    middle = float(at @ pushes / pushes.sum())
                    # What lies beside an end of its member may slide there only from where it may go both ways.
                    places.append(middle if 0.0 < middle < 1.0 else 0.5 * (stretch[0] + stretch[-1]))
            near += self.closest.beside(fields, self.closest.pairs[key], np.array(places), np.inf)
        return frozenset(short), near

    # -- ends -------------------------------------------------------------------------------------

    def stretches(self, found: Solved) -> dict[PairKey, list[list[float]]]:
        """Of each line the ends of elements that touch, those together that follow each other: fractions, rising."""
        stretches: dict[PairKey, list[list[float]]] = {}
        mesh, points = found.model.mesh, points_of(found)
        for key in sorted(key for key in self.keys if self.bends(key[1][0])):
            cuts, own = mesh.cuts[key[1][0]], set[int]()
            for point in (point for point in points if point.pair == key and self.has(point)):
                cut = mesh.cut_at(key[1][0], point.at[0])
                # What is spread is so along all of the element.
                spread = point.line and not all(point.sides)
                own |= {cut, cut + (-1 if point.sides[0] else 1)} if spread else {cut}
            last = -2
            for number in sorted(own):
                # Also where nothing presses between: what is flat there may have no weight.
                if number != last + 1 and not (
                    last >= 0 and self.closest.lies(found.fields, key, float(cuts[last]), float(cuts[number]))
                ):
                    stretches.setdefault(key, []).append([])
                    last = number - 1
                stretches[key][-1] += cuts[last + 1 : number + 1].tolist()
                last = number
        return stretches

    def points_on(self, mesh: Mesh, found: Solved) -> Points:
        """The points of a state on a finer mesh, with those of lines at new ends of elements between old ones."""
        points = points_of(found)
        for key, stretches in self.stretches(found).items():
            known = {(p.at[0], p.sides) for p in points if p.pair == key}
            near = self.closest.along(found.fields, self.closest.pairs[key], mesh, np.inf)
            laid = self.laid(one for one in near if any(s[0] <= one.at[0] <= s[-1] for s in stretches))
            ends = {x for stretch in stretches for x in (stretch[0], stretch[-1])}
            laid = [p for p in laid if not (self.chosen(key) and all(p.sides)) or p.at[0] in ends]
            points = (*points, *(p for p in laid if (p.at[0], p.sides) not in known))
        return points

    def fitted(self, mesh: Mesh, points: Points, *, prescribed: bool = False) -> Mesh:
        """A mesh whose elements end where points slide, as members bend otherwise to both sides of a force.

        An end of elements that is near is moved there, else there is one more; never in a ``prescribed`` mesh, of
        which the nearest is moved.
        """
        cuts = dict(mesh.cuts)
        for point in points:
            for member, x, slides in zip(point.members, point.at, point.slides, strict=True):
                if slides and 0.0 < x < 1.0 and not self.closest.stiff(member):
                    cuts[member] = self._with_end(cuts[member], member, x, prescribed or member in self.fixed)
        return replace(mesh, cuts=cuts)

    def _with_end(self, cuts: Array, member: str, x: float, keeps: bool) -> Array:
        """Ends of elements of a member with one at a place; as many as before if it ``keeps`` their number."""
        near, e = int(np.argmin(np.abs(cuts - x))), int(np.searchsorted(cuts, x))
        if abs(cuts[near] - x) < SAME_CUT:
            return cuts
        moves = np.abs(breaks_of(self.scene, member) - cuts[near]).min() > SAME_CUT
        if moves and (keeps or abs(cuts[near] - x) < SLIVER * (cuts[e] - cuts[e - 1])):
            return np.where(np.arange(len(cuts)) == near, x, cuts)
        return cuts if keeps else np.insert(cuts, e, x)

    def long(self, found: Solved) -> dict[str, Array]:
        """Marks of the elements, by member, that are not so short that what pushes at both ends is one force.

        Where members lie, two forces nearer to each other do what one does, to rounding.
        """
        mesh, unit = found.model.mesh, found.model.scales.length
        lie = {key[1][0] for key in self.keys}
        return {
            name: (np.diff(cuts) * self.scene.center_lines[name].length > NEXT * unit) | (name not in lie)
            for name, cuts in mesh.cuts.items()
        }

    def rough_ends(self, found: Solved, accuracy: float) -> dict[str, Array]:
        """Marks of the elements, by member, in which lines end and where that is therefore not known well enough.

        There a force presses at a point, and where in the element is open: what that bends is an error of rotations.
        Not of lines whose ends elements follow.
        """
        fields, mesh = found.fields, found.model.mesh
        marks = {name: np.zeros(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
        pushes = {(p.pair, p.at[0]): fields.contact_point(p)["push"] for p in mesh.points}
        scales = found.model.scales
        for key, stretches in self.stretches(found).items():
            first = key[1][0]
            lengths = np.diff(mesh.cuts[first]) * self.closest.lengths[first] / scales.length
            for stretch in stretches if not self.chosen(key) else ():
                for at, inner in ((stretch[0], stretch[1:2]), (stretch[-1], stretch[-2:-1])):
                    if not 0.0 < at < 1.0:
                        continue
                    force = sum(pushes.get((key, x), 0.0) for x in {at, *inner}) / scales.force
                    cut = mesh.cut_at(first, at)
                    near = slice(max(cut - BESIDE, 0), cut + BESIDE)
                    bends = force * lengths[near] ** 2 / fields.stiffness(first, at)
                    marks[first][near] |= bends > LOCATED * accuracy
        return marks

    def with_moved_ends(
        self, found: Solved, least: tuple[float, float], before: dict[tuple[str, int], tuple[float, float]]
    ) -> tuple[Mesh, Points] | None:
        """Mesh and points where elements end where lines on obstacles do; None where they do well enough.

        ``least`` are how far, over the unit of length, and by which rotation, rad, that moves anything at least;
        ``before`` has what was missing at each end of elements the last time, and how far it was moved; of this one
        then.
        """
        mesh, moved = found.model.mesh, dict[tuple[str, float], float]()
        for key, stretches in self.stretches(found).items():
            member, follows = key[1][0], self.chosen(key) and key[1][0] not in self.fixed
            breaks = breaks_of(self.scene, member)
            for stretch in stretches if follows else ():
                for at, way in ((stretch[0], -1), (stretch[-1], 1)):
                    if 0.0 < at < 1.0 and np.abs(breaks - at).min() > SAME_CUT and (member, at) not in moved:
                        there = self._end(found, key, at, way if len(stretch) > 1 else 0, least, before)
                        moved |= {} if there == at else {(member, at): there}
        if not moved:
            return None
        cuts = {m: np.array([moved.get((m, x), x) for x in c.tolist()]) for m, c in mesh.cuts.items()}
        points = tuple(
            replace(p, at=tuple(moved.get((m, x), x) for m, x in zip(p.members, p.at, strict=True)))
            for p in points_of(found)
        )
        return replace(mesh, cuts=cuts, points=()), points

    def parted(
        self, found: Solved, deep: float, turned: float, known: Collection[PairKey] = ()
    ) -> tuple[Mesh, Points, PairKey] | None:
        """Mesh and points with the two ends of a short line in place of one point, and what touches there.

        From such a point a member bends into its obstacle, by more than ``deep``, m, or so that all beyond is turned by
        more than ``turned``, rad.  None where there is none, but of ``known`` ones; at first the mesh with elements
        that end there.
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
                    return replace(self.fitted(mesh, (point,)), points=()), points, ("", ())
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
        places = ASIDE + AHEAD * ROOM * room * np.array([0.0, 0.5, 1.0])
        _, grows, bends = np.polyfit(places, [self.closest.bends(fields, key, at + way * x) for x in places], 2)
        return float(grows), float(bends)

    def _end(
        self,
        found: Solved,
        key: PairKey,
        at: float,
        way: int,
        moving: tuple[float, float],
        known: dict[tuple[str, int], tuple[float, float]],
    ) -> float:
        """Where a line ends that has its last end of elements at a place, on the side ``way`` of it, 1 or -1.

        Beyond it the curvature of the gap grows from zero, which it is along the line: the end is where that
        begins.  What touches alone, ``way`` 0, does so where the gap is least.
        """
        member, fields, unit = key[1][0], found.fields, found.model.scales.length
        cuts, length = found.model.mesh.cuts[member], self.closest.lengths[member] / unit
        cut = found.model.mesh.cut_at(member, at)
        before, beyond = float(cuts[cut - 1]) - at, float(cuts[cut + 1]) - at
        grows, bends = self._curves(fields, key, at, way, beyond if way > 0 else -before)
        if way == 0:
            # Half of the way: where the force goes what is nearest goes on.
            nearest = [near.at[0] for near in self.closest.found(fields, LEAST * unit, [self.closest.pairs[key]])]
            apart = 0.5 * min((x - at for x in nearest), key=abs, default=0.0)
        else:
            # Where it does not grow the end is far away: back where the member bends away, else onwards.
            apart = -way * bends / grows if grows > 0.0 else -way * float(np.sign(bends))
        missing, (former, moved) = apart, known.get((member, cut), (0.0, 0.0))
        # Where it ends moves on as elements are moved: by secants.
        if moved and SHARES[0] < (former - missing) / moved < SHARES[1]:
            apart *= moved / (former - missing)
        # Elements do not become too short: what is in less than one is a point.
        least = SLENDEREST * min(beyond, -before)
        low, high = max(ROOM * before, min(before + least, 0.0)), min(ROOM * beyond, max(beyond - least, 0.0))
        apart = min(max(apart, low), high)
        known[member, cut] = missing, apart
        far = abs(apart) * length > moving[0] and abs(bends * unit * apart) * length > moving[1]
        return at + apart if far else at


def points_of(found: Solved) -> Points:
    """The points of a state, where they are now."""
    return points_in(found.fields)


def points_in(fields: Fields) -> Points:
    """As :func:`points_of`."""
    return tuple(
        replace(point, at=fields.contact_point(point)["at"]) if any(point.slides) else point
        for point in fields.model.mesh.points
    )


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
