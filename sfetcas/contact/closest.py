"""Where members are nearest to each other and to obstacles: local minima of the distance from their centre lines.

Each member is sampled as a chain of straight pieces.  A tree of their middles gives the pairs of pieces that may be
near, so that the effort grows with the number of members and of what is near, not with that of all pairs.  From each
pair that is nearer than those beside it, Newton's method leads to the minimum between the curves.

A member is not near to itself, or to a member that continues it, over less than half a turn of the smallest circle that
its surface allows: no two places nearer to each other along the members can touch.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.contacts import contact_radius, pairs_of
from ..description.obstacles import Obstacle, edge_side, members_of, takes_part
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.segments import standing, stations_of_line

__all__ = [
    "BEHIND_EDGE",
    "NEXT_TO",
    "ONE",
    "SAME",
    "Closest",
    "Near",
    "Pair",
    "PairKey",
    "answers",
    "closest_on_pieces",
    "downhill",
    "locally_least",
]

PIECES = 4
"""Straight pieces of an element at least."""

SLENDER = 1.0
"""Length of a piece at most, over the radius of its member: chains then find minima one radius apart."""

MOST_PIECES = 1_000
"""Straight pieces of a member at most, for which slender ones are longer."""

LEAST = 1e-6
"""Least curvature of half the square of the distance with which Newton's steps are made; it is one across a line."""

BEND = 1e-6
"""Fraction of a length over which tangents are differenced for the curvature of a centre line."""

ITERATIONS, ARRIVED = 40, 1e-13
"""Newton's steps at most, and fraction of the length of the longer member that is as good as none."""

SAME = 0.5
"""Minima nearer to each other than this part of the distance of the centre lines are one, along both members."""

ONE = 0.2
"""As ``SAME``, a share of that, of points that touch: such points are one."""

ALIKE = 1e-9
"""Share of a distance by which a shorter one is no other: rounding is far below, the curve of a member far above."""

LEVEL = 1e-13
"""Slope of the distance from an obstacle that is rounding, rad."""

NEXT_TO = 0.95
"""Part of half a turn of the smallest circle within which places along members are not near to each other."""


NARROW = 1e-3
"""Share of the length of a member over which minima of its distance from an obstacle are one."""

BEHIND_EDGE = 0.2
"""Distance behind an edge from which a member is not in contact with it, share of the size of the scene."""

LEFT = 1e-3
"""Share of the distance of what is round, or of two members, that is left where these are drawn back."""

LYING, SAMPLES = (1e-8, 1e-6), 7
"""Shares of the size of the scene between which that is up to which a gap between touches is none, and number of places
where it is seen.
"""

PairKey = tuple[str, tuple[str, ...]]
"""Name of a contact, and the members that touch each other, or the one that touches its obstacle."""


@dataclass(frozen=True)
class Near:
    """A local minimum of the distance between two members, or of a member from an obstacle.

    Attributes
    ----------
    contact : str
    members : (str, str) or (str,)
    at : tuple of float
        Fractions of their lengths.
    normal : ndarray (3,)
        Unit vector from the second centre line, or the obstacle, to the first, as an obstacle that moves sees it.
    gap : float
        Distance of the surfaces, m; below zero where they penetrate.
    distance, edge : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    """

    contact: str
    members: tuple[str, ...]
    at: tuple[float, ...]
    normal: Array
    gap: float
    distance: float
    edge: float = 0.0

    @property
    def pair(self) -> PairKey:
        """What it is a minimum of."""
        return self.contact, self.members


@dataclass(frozen=True)
class Pair:
    """Two members that may touch, one that may touch itself, or one that may touch an obstacle.

    Attributes
    ----------
    contact : str
    members : (str, str) or (str,)
    distance : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    width : float
        Length along the members within which minima are one, over ``SAME``, m.
    stop : Obstacle or None
        It is where it is in the undeformed scene: of one that moves what touches it is seen from it.
    ends : (bool, bool)
        Whether an obstacle can push the ends of the member.
    edge : float
        As of :class:`~sfetcas.mechanics.mesh.ContactPoint`.
    """

    contact: str
    members: tuple[str, ...]
    distance: float
    width: float
    stop: Obstacle | None = None
    ends: tuple[bool, bool] = (True, True)
    edge: float = 0.0

    @property
    def key(self) -> PairKey:
        """Its name."""
        return self.contact, self.members

    @property
    def turn(self) -> float:
        """Radius of what a member may be bent round, m: of an obstacle, or of its own surface on an edge."""
        if self.stop is None or self.stop.kind != "round":
            return np.inf
        return self.stop.radius or self.distance

    @property
    def passable(self) -> bool:
        """Whether members may have passed each other or the obstacle: what is beyond a plane is inside of it."""
        return self.stop is None or (self.stop.kind == "round" and self.stop.sign > 0.0)

    def drawn_back(self, by: float) -> Pair:
        """The same where surfaces are drawn back by a length, m: members are on one side of what is round as before.

        An edge, which has no inside, stays.
        """
        most = 0.0 if self.edge else (1.0 - LEFT) * self.distance if self.passable else np.inf
        return replace(self, distance=self.distance - min(by, most))

    @property
    def normal(self) -> tuple[float, float, float] | None:
        """The direction along which the distance is always measured; None where that is another one at each place."""
        if self.stop is None or self.stop.kind != "flat":
            return None
        x, y, z = self.stop.normal.tolist()
        return x, y, z


class Closest:
    """The search for what is near among the members and obstacles of a scene.

    Attributes
    ----------
    sides : dict
        Of each edge and member the side where that is: 1, -1, or zero, where it may be on either; at first as the scene
        says.
    """

    def __init__(self, scene: Scene, error: float = LYING[1]) -> None:
        self.scene, self.lying = scene, float(np.clip(error, *LYING)) * scene.size
        pairs: list[Pair] = []
        for name, contact in scene.contacts.items():
            names = [m for m in members_of(contact, scene.members) if scene.members[m].type != "small"]
            if contact.between_members:
                radii = {m: contact_radius(contact, scene.members[m], scene.sections) or 0.0 for m in names}
                for a, b in pairs_of(names, scene.members):
                    # Where they touch along a line places are those of the nodes of the first one.
                    a, b = (b, a) if scene.members[a].type == "rigid" else (a, b)
                    pairs.append(Pair(name, (a, b), radii[a] + radii[b], radii[a] + radii[b]))
            else:
                pairs += [self._against(name, member) for member in names]
        self.pairs = self._given = {pair.key: pair for pair in pairs}
        self.sides = {pair.key: pair.edge for pair in pairs if pair.edge}
        # A state is looked at as the end of a step, and as the begin of another one.
        self._passing = weakref.WeakKeyDictionary[Fields, dict[PairKey, tuple[Array, Array, Array]]]()
        self._courses = weakref.WeakKeyDictionary[Fields, dict[str, tuple[Array, Array, Array]]]()
        self._between = [pair for pair in pairs if pair.stop is None]
        self.members = sorted({member for pair in pairs for member in pair.members})
        self._tree_members = sorted({member for pair in self._between for member in pair.members})
        self.lengths = {member: scene.center_lines[member].length for member in self.members}
        self.least = dict.fromkeys(self.members, np.inf)
        for pair in pairs:
            size = 0.5 * pair.distance if pair.stop is None else pair.turn
            self.least |= {member: min(self.least[member], size) for member in pair.members}
        self.largest = max((pair.distance for pair in self._between), default=0.0)

    def _against(self, name: str, member: str) -> Pair:
        """A member and an obstacle."""
        scene, stop = self.scene, self.scene.obstacles[name]
        radius, nodes = scene.contacts[name].member_radius, scene.members[member].nodes
        first, last = (takes_part(node, scene.nodes[node], scene.motions.values(), stop) for node in nodes)
        width = max(radius, NARROW * scene.center_lines[member].length)
        line = scene.center_lines[member]
        edge = edge_side(stop, line.positions, line.tangents) if stop.kind == "sharp" else 0.0
        return Pair(name, (member,), radius + stop.sign * stop.radius, width, stop, (first, last), edge)

    def draw_back(self, by: float) -> None:
        """Draw back the surfaces of all obstacles and members from where they are by a length, m."""
        self.pairs = {key: pair.drawn_back(by) for key, pair in self._given.items()} if by else self._given

    def back(self, point: ContactPoint) -> float:
        """How far the surfaces of a point are drawn back, m, from where the model has them."""
        given = point.distance if point.line else self._given[point.pair].distance
        return given - self.pairs[point.pair].distance

    def stiff(self, member: str) -> bool:
        """Whether a member is straight, and stays so."""
        return self.scene.members[member].type == "rigid" and self.scene.center_lines[member].turning == 0.0

    def samples(self, fields: Fields, member: str) -> Array:
        """Fractions (n,) of the length of a member between which it is nearly straight."""
        cuts = fields.model.mesh.cuts[member]
        if self.stiff(member):
            # What is straight, and stays so, needs no short pieces; between shorter ones fewer may be near.
            return np.linspace(0.0, 1.0, PIECES + 1)
        each = np.diff(cuts) * self.lengths[member] / (SLENDER * self.least[member])
        most = max(PIECES, MOST_PIECES // (len(cuts) - 1))
        counts = np.clip(np.ceil(each), PIECES, most).astype(int)
        parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(cuts, cuts[1:], counts, strict=False)]
        return np.append(np.concatenate(parts), 1.0)

    def found(self, fields: Fields, reach: float, pairs: Sequence[Pair] | None = None) -> list[Near]:
        """All minima, of given pairs or of all, at which surfaces are nearer to each other than ``reach``, m."""
        pairs = list(self.pairs.values()) if pairs is None else pairs
        if not pairs:
            return []
        x = {member: self.samples(fields, member) for member in self.members}
        near = self._beside_obstacles(fields, x, reach, [pair for pair in pairs if pair.stop is not None])
        between = [pair for pair in pairs if pair.stop is None]
        if not between:
            return near
        points = {member: fields.positions(member, x[member]) for member in self._tree_members}
        longest = max(float(np.linalg.norm(np.diff(p, axis=0), axis=1).max()) for p in points.values())
        for pair, at in self._candidates(points, x, reach, between, longest):
            near += self._minima(fields, pair, at, reach, longest)
        return near

    def gap(self, fields: Fields, contact: str) -> float | None:
        """Smallest distance of the surfaces of a contact, m; None of members that are nowhere near to each other."""
        pairs = [pair for pair in self.pairs.values() if pair.contact == contact]
        if not self.scene.contacts[contact].between_members:
            # An edge that is before or beyond a member has no distance from it.
            along = [pair for pair in pairs if not pair.edge]
            ends = [float(self._gaps(fields, pair, np.array([0.0, 1.0]))[0].min()) for pair in along]
            # What has slid off an edge may be behind it.
            near = (abs(one.gap) if one.edge else one.gap for one in self.found(fields, np.inf, pairs))
            return min([*ends, *near], default=None)
        # Far fewer are near than would be looked at all at once.
        reach = self.largest
        while reach < 2.0 * NEARBY * self.scene.size:
            if gaps := [near.gap for near in self.found(fields, min(reach, NEARBY * self.scene.size), pairs)]:
                return min(gaps)
            reach *= 2.0
        return None

    # -- obstacles --------------------------------------------------------------------------------

    def _beside_obstacles(self, fields: Fields, x: dict[str, Array], reach: float, pairs: Sequence[Pair]) -> list[Near]:
        """The minima of the distance of members from obstacles; a node where several members end is one place."""
        found, nodes = list[Near](), set[tuple[str, str]]()
        for pair in pairs:
            (member,) = pair.members
            if pair.edge:
                found += self._over_edge(fields, pair, reach, nodes)
                continue
            # What is straight and rigid is nearest to a plane with an end.
            ends = pair.stop is not None and pair.stop.kind == "flat" and self.stiff(member)
            places = x[member][[0, -1]] if ends else x[member]
            gaps, _ = self._gaps(fields, pair, places)
            padded = np.concatenate([[np.inf], gaps, [np.inf]])
            # Of a member that lies along a plane rounding shall not make a minimum of each sample.
            rounding = max(ALIKE * np.abs(gaps).max(), tolerances.DECIMAL * self.scene.size)
            before, after = padded[:-2], padded[2:]
            # Of a stretch at one distance both ends.
            least = ((gaps < before - rounding) & (gaps <= after + rounding)) | (
                (gaps <= before + rounding) & (gaps < after - rounding)
            )
            least &= gaps < reach + self.lengths[member] * np.diff(places).max()
            i = np.flatnonzero(least)
            low, high = places[np.maximum(i - 1, 0)], places[np.minimum(i + 1, len(places) - 1)]
            at = places[i] if ends else self._least(fields, pair, low, places[i], high)
            gaps, normals = self._gaps(fields, pair, at)
            found += self._once(pair, at, gaps, normals, reach, nodes)
        return found

    def _once(
        self, pair: Pair, at: Array, gaps: Array, normals: Array, reach: float, nodes: set[tuple[str, str]]
    ) -> Iterator[Near]:
        """Minima that are near enough, at nodes that are none of those known, which are told of."""
        for s, gap, normal in zip(at.tolist(), gaps.tolist(), normals, strict=True):
            if gap >= reach:
                continue
            if s in (0.0, 1.0):
                end = pair.contact, self.scene.members[pair.members[0]].nodes[int(s)]
                if not pair.ends[int(s)] or end in nodes:
                    continue
                nodes.add(end)
            yield Near(pair.contact, pair.members, (s,), normal, gap, pair.distance)

    def course(self, fields: Fields, member: str) -> tuple[Array, Array, Array]:
        """Fractions (n,) of the length of a member, and positions (n, 3), m, and slopes (n, 3) there."""
        known = self._courses.setdefault(fields, {})
        if member not in known:
            x = self.samples(fields, member)
            known[member] = x, fields.positions(member, x), fields.slopes(member, x)
        return known[member]

    def _passes(self, fields: Fields, pair: Pair) -> tuple[Array, Array, Array]:
        """Where a member passes an edge, (n,), and gaps (n,), m, and normals (n, 3) there, for the side 1."""
        known = self._passing.setdefault(fields, {})
        if pair.key not in known:
            (member,), stop = pair.members, pair.stop
            assert stop is not None
            x, places, tangents = self.course(fields, member)
            slope = np.einsum("ni,ni->n", (places - stop.place) @ stop.across, tangents)
            before = slope <= LEVEL * self.scene.size
            i = np.flatnonzero(before[:-1] & ~before[1:])
            low, high = x[i], x[i + 1]
            at = self._least(fields, pair, low, low - slope[i] / (slope[i + 1] - slope[i]) * (high - low), high)
            known[pair.key] = (at, *self._gaps(fields, pair, at))
        return known[pair.key]

    def _over_edge(self, fields: Fields, pair: Pair, reach: float, nodes: set[tuple[str, str]]) -> Iterator[Near]:
        """Where a member passes an edge that it is not far behind."""
        at, gaps, normals = self._passes(fields, pair)
        side = self.sides[pair.key]
        sides = np.copysign(1.0, gaps) if side == 0.0 else np.full(len(gaps), side)
        gaps, normals = sides * gaps, sides[:, None] * normals
        beside = gaps > -BEHIND_EDGE * self.scene.size
        for near in self._once(pair, at[beside], gaps[beside], normals[beside], reach, nodes):
            yield replace(near, edge=float(sides[at == near.at[0]][0]))

    def _least(self, fields: Fields, pair: Pair, low: Array, at: Array, high: Array) -> Array:
        """Places (n,) of the minima between others."""
        (member,) = pair.members
        for _ in range(ITERATIONS):
            slope, curvature = self._slopes(fields, pair, at)
            low, high = np.where(slope < 0.0, at, low), np.where(slope > 0.0, at, high)
            after = at - slope / (np.maximum(np.abs(curvature), TINY) * self.lengths[member])
            outside = ((after <= low) & (low > 0.0)) | ((after >= high) & (high < 1.0))
            after = np.clip(np.where(outside, 0.5 * (low + high), after), 0.0, 1.0)
            # Where a member lies along an obstacle each place is as good.
            after = np.where(np.abs(slope) < LEVEL, at, after)
            moved, at = np.abs(after - at).max(initial=0.0), after
            if moved < ARRIVED:
                break
        return at

    def lies(self, fields: Fields, pair: PairKey, begin: float, end: float, lifted: float = 0.0) -> bool:
        """Whether a member lies on an obstacle between two fractions of its length, or is lifted by so little, m."""
        if self.pairs[pair].stop is None or self.pairs[pair].edge:
            return False
        x = np.linspace(begin, end, SAMPLES + 2)[1:-1]
        return bool(np.abs(self._gaps(fields, self.pairs[pair], x)[0]).max() < max(self.lying, lifted))

    def lies_up_to(self, fields: Fields, pair: PairKey, begin: float, end: float) -> bool:
        """Whether a member lies on an obstacle from a place where it touches up to an end of it: it does not turn."""
        slope, _ = self._slopes(fields, self.pairs[pair], np.array([end]))
        level = abs(float(slope[0])) * self.scene.size < self.lying
        return level and self.lies(fields, pair, min(begin, end), max(begin, end))

    def gap_at(self, fields: Fields, pair: PairKey, at: float) -> float:
        """Gap, m, between a place of a member and an obstacle."""
        return float(self._gaps(fields, self.pairs[pair], np.array([at]))[0][0])

    def bends(self, fields: Fields, pair: PairKey, at: float) -> float:
        """Curvature, 1/m, of the gap between a place of a member and an obstacle by arc length."""
        return float(self._slopes(fields, self.pairs[pair], np.array([at]))[1][0])

    def _gaps(self, fields: Fields, pair: Pair, x: Array) -> tuple[Array, Array]:
        """Of places (n,) of the member gaps (n,), m, and normals (n, 3); at an edge for the side 1."""
        (member,), stop = pair.members, pair.stop
        assert stop is not None
        places = fields.positions(member, x)
        # Only across an edge the normal depends on the member.
        tangent = fields.slopes(member, x) if stop.kind == "sharp" else places
        places, tangent = fields.seen(pair.contact, places, tangent)
        normals = stop.normals(places, tangent)
        return np.einsum("ni,ni->n", (places - stop.place) @ stop.across, normals) - pair.distance, normals

    def _slopes(self, fields: Fields, pair: Pair, x: Array) -> tuple[Array, Array]:
        """Of places (n,) of the member slopes (n,) and curvatures (n,), 1/m, of the gap by arc length.

        At an edge, which members may be at, slopes, m, and curvatures of half the square of the distance.
        """
        (member,), stop = pair.members, pair.stop
        assert stop is not None
        places, tangent = fields.seen(pair.contact, fields.positions(member, x), fields.slopes(member, x))
        _, bent = fields.seen(pair.contact, places, self._curvature(fields, member, x))
        out = (places - stop.place) @ stop.across
        towards = out if pair.edge else stop.normals(places, tangent)
        slope, curvature = np.einsum("ni,ni->n", towards, tangent), np.einsum("ni,ni->n", towards, bent)
        along = np.einsum("ni,ni->n", tangent @ stop.across, tangent)
        if pair.edge:
            return slope, curvature + along
        if stop.kind == "round":
            apart = np.maximum(np.linalg.norm(out, axis=1), TINY)
            curvature += stop.sign * (along - slope**2) / apart
        return slope, curvature

    # -- pieces -----------------------------------------------------------------------------------

    def _candidates(
        self, points: dict[str, Array], x: dict[str, Array], reach: float, pairs: Sequence[Pair], longest: float
    ) -> Iterator[tuple[Pair, Array]]:
        """For each pair of members places (2, n) on both where pieces are nearer to each other than those beside them.

        Pieces of one member that follow each other are among those that are compared: beside them nothing is nearest.
        """
        from scipy.spatial import cKDTree

        middles = [0.5 * (points[member][1:] + points[member][:-1]) for member in self._tree_members]
        starts = np.concatenate([[0], np.cumsum([len(part) for part in middles])])
        owners = np.repeat(np.arange(len(middles)), np.diff(starts))
        # A piece is at most half of it from its middle, and its arc rises above it by less than a quarter.
        limit = self.largest + reach + 1.5 * longest
        found = cKDTree(np.concatenate(middles)).query_pairs(limit, output_type="ndarray")
        one, other = owners[found[:, 0]], owners[found[:, 1]]
        number = {member: k for k, member in enumerate(self._tree_members)}
        for pair in pairs:
            (a, b), (first, second) = (number[m] for m in pair.members), pair.members
            chosen = found[(np.minimum(one, other) == min(a, b)) & (np.maximum(one, other) == max(a, b))]
            if not len(chosen):
                continue
            # The tree gives the lower number first.
            i, j = (chosen if a <= b else chosen[:, ::-1]).T - np.array([[starts[a]], [starts[b]]])
            p, r = points[first], points[second]
            s, t, distances = closest_on_pieces(p[i], p[i + 1], r[j], r[j + 1])
            least = locally_least(i, j, distances, len(r)) & (distances < pair.distance + reach + 0.5 * longest)
            at = np.array([x[first][i] + s * (x[first][i + 1] - x[first][i]), x[second][j] + t * np.diff(x[second])[j]])
            least &= ~self._next_to(pair, *at)
            if least.any():
                yield pair, at[:, least]

    def _next_to(self, pair: Pair, s: Array, t: Array) -> Array:
        """Whether places (n,) on both members are so near to each other along the members that they cannot touch."""
        a, b = pair.members
        limit = NEXT_TO * 0.5 * np.pi * pair.distance
        if a == b:
            return np.asarray(np.abs(s - t) * self.lengths[a] < limit)
        found = np.zeros(len(s), bool)
        one, other = self.scene.members[a].nodes, self.scene.members[b].nodes
        for i, node in enumerate(one):
            for k, same in enumerate(other):
                if node == same:
                    along = np.abs(s - i) * self.lengths[a] + np.abs(t - k) * self.lengths[b]
                    found |= along < limit
        return found

    # -- curves -----------------------------------------------------------------------------------

    def _minima(self, fields: Fields, pair: Pair, at: Array, reach: float, longest: float) -> Iterator[Near]:
        """Minima between the curves from places (2, n) on both, in steps of some length (m) at most; each once."""
        a, b = pair.members
        lengths = np.array([[self.lengths[a]], [self.lengths[b]]])
        at = np.clip(at, 0.0, 1.0)
        begin = at.copy()
        for _ in range(ITERATIONS):
            slope, curvature, apart = self._half_square(fields, pair, at)
            step = downhill(slope, curvature, at) / lengths
            # As long as the pieces at most: a minimum is not far from where pieces are nearest.
            limit = np.maximum(0.25 * apart, longest) / lengths
            step = np.clip(step, -limit, limit)
            after = np.clip(at + step, 0.0, 1.0)
            moved, at = np.abs(after - at).max(initial=0.0), after
            if moved < ARRIVED:
                break
        slope, curvature, apart, normals = self._distance(fields, pair, at)
        known: list[tuple[float, float]] = []
        order = np.argsort(apart, kind="stable")
        far = np.abs(at - begin).max(axis=0, initial=0.0) if at.size else np.zeros(0)
        for i in order.tolist():
            if apart[i] >= pair.distance + reach or far[i] > 0.5:
                continue
            if self._next_to(pair, at[0, [i]], at[1, [i]])[0]:
                continue
            place = (float(at[0, i]), float(at[1, i]))
            if any(self.alike(pair.key, place, other) for other in known):
                continue
            known.append(place)
            yield Near(pair.contact, pair.members, place, normals[i], float(apart[i]) - pair.distance, pair.distance)

    def along(self, fields: Fields, pair: Pair, mesh: Mesh, reach: float) -> list[Near]:
        """Of the ends of elements of the first member of a pair on some mesh those at which the second one is nearer
        than ``reach``, m, as of :meth:`beside`; gaps from obstacles are the means of lines.
        """
        cuts = mesh.cuts[pair.members[0]]
        if pair.stop is None:
            return self.beside(fields, pair, cuts, reach)
        normals = self._gaps(fields, pair, cuts)[1]
        points = [ContactPoint(*pair.key, (x,), (False,), pair.distance, line=True) for x in cuts.tolist()]
        at, share = zip(*(stations_of_line(mesh, point) for point in points), strict=True)
        starts = np.cumsum([0, *map(len, at[:-1])])
        # Also at an end that is held, whose element is free to leave.
        gaps = np.add.reduceat(self._gaps(fields, pair, np.concatenate(at))[0] * np.concatenate(share), starts)
        return [
            Near(*pair.key, point.at, normal, gap, pair.distance)
            for point, normal, gap in zip(points, normals, gaps.tolist(), strict=True)
            if gap < reach
        ]

    def beside(self, fields: Fields, pair: Pair, stations: Array, reach: float) -> list[Near]:
        """Of places (n,) of the first member of a pair those at which the second one, or the obstacle, is nearer than
        ``reach``, m.

        Beyond the ends of the second one there are none.  Where a member is beside itself each place counts with those
        that come later on it.
        """
        if pair.stop is not None:
            gaps, normals = self._gaps(fields, pair, stations)
            held = np.array([x in (0.0, 1.0) and not pair.ends[int(x)] for x in stations.tolist()])
            return [
                Near(pair.contact, pair.members, (float(stations[i]),), normals[i], float(gaps[i]), pair.distance)
                for i in np.flatnonzero((gaps < reach) & ~held).tolist()
            ]
        first, second = pair.members
        x = self.samples(fields, second)
        here, points = fields.positions(first, stations), fields.positions(second, x)
        begin, chords = points[:-1], np.diff(points, axis=0)
        out = here[:, None, :] - begin[None, :, :]
        share = np.clip(np.einsum("npi,pi->np", out, chords) / np.einsum("pi,pi->p", chords, chords), 0.0, 1.0)
        t = x[:-1] + share * np.diff(x)
        distances = np.linalg.norm(out - share[:, :, None] * chords, axis=2)
        if first == second:
            near = (t - stations[:, None]) * self.lengths[first] < NEXT_TO * 0.5 * np.pi * pair.distance
            distances = np.where(near, np.inf, distances)
        best = np.argmin(distances, axis=1)
        longest = float(np.linalg.norm(chords, axis=1).max())
        close = distances[np.arange(len(best)), best] < pair.distance + reach + 0.5 * longest
        at = np.array([stations, t[np.arange(len(best)), best]])[:, close]
        if not at.size:
            return []
        length = self.lengths[second]
        for _ in range(ITERATIONS):
            slope, curvature, _ = self._half_square(fields, pair, at)
            step = -slope[1] / np.maximum(np.abs(curvature[1, 1]), LEAST)
            step = np.clip(step, -longest, longest) / length
            after = np.clip(at[1] + step, 0.0, 1.0)
            moved, at[1] = np.abs(after - at[1]).max(), after
            if moved < ARRIVED:
                break
        _, _, apart, normals = self._distance(fields, pair, at)
        chosen = (apart < pair.distance + reach) & ~self._next_to(pair, *at) & (at[1] > 0.0) & (at[1] < 1.0)
        if first == second:
            chosen &= at[0] < at[1]
        return [
            Near(pair.contact, pair.members, (float(s), float(t)), n, float(a) - pair.distance, pair.distance)
            for s, t, n, a in zip(at[0][chosen], at[1][chosen], normals[chosen], apart[chosen], strict=True)
        ]

    def alike(self, pair: PairKey, one: tuple[float, ...], other: tuple[float, ...], share: float = 1.0) -> bool:
        """Whether two places of a pair are as good as one, or so near as a share of that."""
        along = (abs(p - r) * self.lengths[m] for p, r, m in zip(one, other, pair[1], strict=True))
        return max(along) < SAME * share * self.pairs[pair].width

    def slopes(self, fields: Fields, key: PairKey, at: tuple[float, ...]) -> Array:
        """Slopes (2,) or (1,) of the distance by the arc lengths at a place."""
        pair = self.pairs[key]
        if pair.stop is not None:
            return self._slopes(fields, pair, np.array(at))[0]
        return self._distance(fields, pair, np.array(at)[:, None])[0][:, 0]

    def _distance(self, fields: Fields, pair: Pair, at: Array) -> tuple[Array, Array, Array, Array]:
        """Slope (2, n) and curvature (2, 2, n) of the distance by both arc lengths, distance (n,), normals (n, 3)."""
        a, b = pair.members
        r = [fields.positions(m, x) for m, x in zip((a, b), at, strict=True)]
        t = [fields.slopes(m, x) for m, x in zip((a, b), at, strict=True)]
        k = [self._curvature(fields, m, x) for m, x in zip((a, b), at, strict=True)]
        between = r[0] - r[1]
        apart = np.maximum(np.linalg.norm(between, axis=1), TINY)
        n = between / apart[:, None]
        along = np.stack([np.einsum("ni,ni->n", t[0], n), -np.einsum("ni,ni->n", t[1], n)])
        both = np.einsum("ni,ni->n", t[0], t[1])
        curvature = np.empty((2, 2, len(apart)))
        first, second = (np.einsum("ni,ni->n", one, one) for one in t)
        curvature[0, 0] = (first - along[0] ** 2) / apart + np.einsum("ni,ni->n", n, k[0])
        curvature[1, 1] = (second - along[1] ** 2) / apart - np.einsum("ni,ni->n", n, k[1])
        curvature[0, 1] = curvature[1, 0] = (-both - along[0] * along[1]) / apart
        return along, curvature, apart, n

    def half_square(self, fields: Fields, members: tuple[str, str], at: tuple[float, float]) -> tuple[Array, Array]:
        """Slope (2,), m, and curvature (2, 2) of half the square of the distance of two members by both arc lengths."""
        pair = Pair("", members, 0.0, 0.0)
        slope, curvature, _ = self._half_square(fields, pair, np.array(at)[:, None])
        return slope[:, 0], curvature[:, :, 0]

    def _half_square(self, fields: Fields, pair: Pair, at: Array) -> tuple[Array, Array, Array]:
        """Slope (2, n), m, and curvature (2, 2, n) of half the square of the distance, and the distance (n,), m.

        Its minima are those of the distance, which has a corner where centre lines cross.
        """
        slope, curvature, apart, _ = self._distance(fields, pair, at)
        return apart * slope, apart * curvature + slope[:, None] * slope[None, :], apart

    def _curvature(self, fields: Fields, member: str, x: Array) -> Array:
        """Vectors of curvature (n, 3) of a centre line, 1/m."""
        low, high = np.maximum(x - BEND, 0.0), np.minimum(x + BEND, 1.0)
        first, last = np.split(fields.tangents(member, np.concatenate([low, high])), 2)
        change = last - first
        return np.asarray(change / ((high - low) * self.lengths[member])[:, None])


def downhill(slope: Array, curvature: Array, at: Array) -> Array:
    """Steps (2, n) in both arc lengths, m, towards the minimum; none beyond an end of a member.

    Downhill also where the distance is curved the other way, or not at all: of the curvatures the sizes are taken.
    """
    free = ~(((at <= 0.0) & (slope > 0.0)) | ((at >= 1.0) & (slope < 0.0)))
    both = free.all(axis=0)
    mean, half = 0.5 * (curvature[0, 0] + curvature[1, 1]), 0.5 * (curvature[0, 0] - curvature[1, 1])
    across = np.where(both, curvature[0, 1], 0.0)
    root = np.hypot(half, across)
    sizes = np.maximum(np.abs([mean + root, mean - root]), LEAST)
    angle = 0.5 * np.arctan2(across, half)
    c, s = np.cos(angle), np.sin(angle)
    first, second = (c * slope[0] + s * slope[1]) / sizes[0], (c * slope[1] - s * slope[0]) / sizes[1]
    together = -np.array([c * first - s * second, s * first + c * second])
    alone = -slope / np.maximum(np.abs([curvature[0, 0], curvature[1, 1]]), LEAST)
    return np.where(both, together, np.where(free, alone, 0.0))


def locally_least(i: Index, j: Index, distances: Array, columns: int) -> Array:
    """Of pairs of pieces those that are not farther apart than any pair beside them; of equal ones the first."""
    width = columns + 2
    keys = (i + 1) * width + j + 1
    order = np.argsort(keys)
    ordered, values = keys[order], distances[order]
    least = np.ones(len(keys), bool)
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            if di or dj:
                wanted = keys + di * width + dj
                place = np.clip(np.searchsorted(ordered, wanted), 0, len(ordered) - 1)
                beside = np.where(ordered[place] == wanted, values[place], np.inf)
                # Where members are parallel, rounding shall not make a minimum of each piece.
                earlier = di < 0 or (di == 0 and dj < 0)
                least &= distances < beside * (1.0 - ALIKE) if earlier else distances <= beside * (1.0 + ALIKE)
    return least


def closest_on_pieces(p: Array, p_end: Array, r: Array, r_end: Array) -> tuple[Array, Array, Array]:
    """Where straight pieces (n, 3) are nearest to each other, fractions (n,) of both, and the distance (n,).

    Source: Ericson 2005, Real-Time Collision Detection, section 5.1.9.
    """
    d1, d2, w = p_end - p, r_end - r, p - r
    a, e = np.einsum("ni,ni->n", d1, d1), np.einsum("ni,ni->n", d2, d2)
    b, c, f = np.einsum("ni,ni->n", d1, d2), np.einsum("ni,ni->n", d1, w), np.einsum("ni,ni->n", d2, w)
    det = a * e - b * b
    # Pieces in one direction are nearest all along: their middles stand for them.
    parallel = det <= 1e-12 * a * e
    s = np.where(parallel, 0.5, np.clip((b * f - c * e) / np.where(parallel, 1.0, det), 0.0, 1.0))
    t = np.clip((b * s + f) / np.maximum(e, TINY), 0.0, 1.0)
    s = np.clip((b * t - c) / np.maximum(a, TINY), 0.0, 1.0)
    return s, t, np.linalg.norm(w + s[:, None] * d1 - t[:, None] * d2, axis=1)


def answers(fields: Fields, error: float | None = None) -> dict[str, dict[str, Any]]:
    """For each contact the ``force`` (3,) N on the member, ``at``, ``gap`` in m, ``member``; lists for several places.

    Where gaps are less than the relative ``error`` of positions members lie on obstacles.  Between members ``other``
    and ``other_at`` are of the second one.  With friction also ``friction`` (3,) N, the part of the force along the
    surfaces, and whether it is ``sticking``.
    """
    scene, found = fields.model.scene, dict[str, dict[str, Any]]()
    closest = Closest(scene, LYING[1] if error is None else error)
    for name, contact in scene.contacts.items():
        points = sorted((p for p in fields.model.mesh.points if p.contact == name), key=lambda p: (p.members, p.at))
        further = ["other", "other_at"] if contact.between_members else []
        further += ["friction", "sticking"] if contact.friction else []
        if not points:
            gap = closest.gap(fields, name)
            found[name] = {"force": np.zeros(3), "at": None, "gap": gap, "member": None, **dict.fromkeys(further)}
            found[name] |= {"friction": np.zeros(3)} if contact.friction else {}
            continue
        entries = [_entry(fields, point) for point in points]
        if not contact.between_members:
            entries = _stretches(fields, closest, points, entries)
        found[name] = entries[0] if len(entries) == 1 else {key: [e[key] for e in entries] for key in entries[0]}
    return found


def _entry(fields: Fields, point: ContactPoint) -> dict[str, Any]:
    """What is told of one point."""
    told = fields.contact_point(point)
    places = [fields.positions(m, np.array([x]))[0] for m, x in zip(point.members, told["at"], strict=True)]
    entry = {"force": told["force"], "at": told["at"][0], "member": point.members[0]}
    entry |= {"friction": told["friction"], "sticking": told["sticks"]} if point.grip is not None else {}
    if len(places) == 2:
        gap = float(np.linalg.norm(places[0] - places[1])) - point.distance
        return {**entry, "gap": gap, "other": point.members[1], "other_at": told["at"][1]}
    stop = fields.model.scene.obstacles[point.contact]
    seen = fields.seen(point.contact, places[0][None], fields.tangents(point.members[0], np.array(told["at"])))
    gap = stop.gaps(*seen, way=point.edge or 1.0)[0]
    return {**entry, "gap": float(gap) - fields.model.scene.contacts[point.contact].member_radius}


def _stretches(
    fields: Fields, closest: Closest, points: Sequence[ContactPoint], entries: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Entries of points on an obstacle, those between which a member lies on it as one along a stretch."""
    mesh, found = fields.model.mesh, list[dict[str, Any]]()
    extents = [_extent(mesh, point, entry) for point, entry in zip(points, entries, strict=True)]
    for i in sorted(range(len(points)), key=lambda i: (points[i].members, extents[i])):
        entry, (begin, end) = entries[i], extents[i]
        if found and found[-1]["member"] == entry["member"]:
            before = found[-1]
            first, last = np.broadcast_to(before["at"], 2).tolist()
            if begin <= last or closest.lies(fields, points[i].pair, last, begin):
                begin, end = first, max(end, last)
                gap = max(before["gap"], entry["gap"], key=abs)
                entry = {**entry, "force": before["force"] + entry["force"], "gap": gap}
                if "friction" in entry:
                    entry["friction"] = before["friction"] + entry["friction"]
                    entry["sticking"] = before["sticking"] and entry["sticking"]
                found.pop()
        found.append({**entry, "at": [begin, end] if end > begin else begin})
    rough = fields.model.scene.contacts[points[0].contact].friction > 0.0
    for end in () if rough else (0, 1):
        # Of each member the first one, or the last; with friction the place of a force matters.
        for entry in {entry["member"]: entry for entry in (found if end else found[::-1])}.values():
            _up_to_end(fields, closest, points[0].contact, entry, end)
    return found


def _up_to_end(fields: Fields, closest: Closest, contact: str, entry: dict[str, Any], end: int) -> None:
    """Lengthen an entry up to an end of its member, where that lies on the obstacle without a force."""
    span = np.broadcast_to(entry["at"], 2).tolist()
    if span[end] != end and closest.lies_up_to(fields, (contact, (entry["member"],)), span[end], float(end)):
        span[end] = float(end)
        entry["at"] = span


def _extent(mesh: Mesh, point: ContactPoint, entry: dict[str, Any]) -> tuple[float, float]:
    """Between which fractions of the length of a member a point pushes."""
    cut, cuts = standing(mesh, point, 0), mesh.cuts[point.members[0]]
    if cut is None or not point.line or all(point.sides):
        return entry["at"], entry["at"]
    return float(cuts[cut - point.sides[0]]), float(cuts[cut + point.sides[1]])


NEARBY = 1.0
"""Distance up to which the gap of members that do not touch is told, in sizes of the scene."""
