"""Where members are nearest to each other and to obstacles: local minima of the distance from their centre lines.

Between members they are found for all pairs at once, see :mod:`~sfetcas.contact.nearby`.  The distance from an obstacle
is seen at samples along each member; from each that is nearer than those beside it Newton's method leads to a minimum.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.contacts import Contact, contact_radius, pairs_of
from ..description.obstacles import edge_side, members_of, takes_part
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.balance import three
from ..mechanics.center_lines import Along, Curve, Lines
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.model import Model
from ..mechanics.segments import standing, weights_towards
from ..mechanics.tables import Tables
from .nearby import ALIKE, ITERATIONS, Nearby, Places
from .pairs import SAME, Near, Pair, PairKey

__all__ = ["AT_END", "BEHIND_EDGE", "LIFTED", "Closest", "answers", "first_there"]

PIECES, COARSE = 4, 2
"""Straight pieces of an element at least, and how many times fewer and longer they are in a coarse search: chains then
find minima some radii apart.
"""

SLENDER = 1.0
"""Length of a piece at most, over the radius of its member: chains then find minima one radius apart."""

MOST_PIECES = 1_000
"""Straight pieces of a member at most, for which slender ones are longer."""

BEND = 1e-6
"""Fraction of a length over which tangents are differenced for the curvature of a centre line."""

ARRIVED = 1e-13
"""Fraction of the length of a member that is as good as none."""

LEVEL = 1e-13
"""Slope of the distance from an obstacle that is rounding, rad."""

NARROW = 1e-3
"""Share of the length of a member over which minima of its distance from an obstacle are one."""

BEHIND_EDGE = 0.2
"""Distance behind an edge from which a member is not in contact with it, share of the size of the scene."""

LYING, SAMPLES = (1e-8, 1e-6), 7
"""Shares of the size of the scene between which that is up to which a gap between touches is none, and number of places
where it is seen.
"""

LIFTED = 3e-6
"""Gap, over the size, from which on a line does not reach the end of a member, or is interrupted: on coarse elements
pressure may vanish somewhere within.
"""


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
        self._nearby = weakref.WeakKeyDictionary[Model, Nearby]()
        self._curves = weakref.WeakKeyDictionary[Fields, Curve]()
        self._minima = weakref.WeakKeyDictionary[Fields, dict[Any, list[Near]]]()
        self._apart = weakref.WeakKeyDictionary[Fields, dict[tuple[PairKey, float], float]]()
        self._sloping = weakref.WeakKeyDictionary[Fields, dict[Any, tuple[Array, Array]]]()
        self._courses = weakref.WeakKeyDictionary[Fields, dict[str, tuple[Array, Array, Array]]]()
        self._between = [pair for pair in pairs if pair.stop is None]
        self.members = sorted({member for pair in pairs for member in pair.members})
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
        return Pair(name, (member,), stop.distance, width, stop, (first, last), edge)

    def draw_back(self, by: float) -> None:
        """Draw back the surfaces of all obstacles and members from where they are by a length, m."""
        self.pairs = {key: pair.drawn_back(by) for key, pair in self._given.items()} if by else self._given
        self._nearby.clear()
        self._minima.clear()
        self._apart.clear()

    def back(self, point: ContactPoint) -> float:
        """How far the surfaces of a point are drawn back, m, from where the model has them."""
        given = point.distance if point.line else self._given[point.pair].distance
        return given - self.pairs[point.pair].distance

    def stiff(self, member: str) -> bool:
        """Whether a member is straight, and stays so."""
        return self.scene.members[member].type == "rigid" and self.scene.center_lines[member].turning == 0.0

    def samples(self, mesh: Mesh, member: str, coarse: int = 1) -> Array:
        """Fractions (n,) of the length of a member between which it is nearly straight."""
        cuts = mesh.cuts[member]
        if self.stiff(member) and coarse == 1:
            # What is straight, and stays so, needs no short pieces; between shorter ones fewer may be near.
            return np.linspace(0.0, 1.0, PIECES + 1)
        each = np.diff(cuts) * self.lengths[member] / (coarse * SLENDER * self.least[member])
        most = max(PIECES, MOST_PIECES // (len(cuts) - 1))
        counts = np.clip(np.ceil(each), PIECES // coarse, most).astype(int)
        parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(cuts, cuts[1:], counts, strict=False)]
        return np.append(np.concatenate(parts), 1.0)

    def found(self, fields: Fields, reach: float, pairs: Sequence[Pair] | None = None) -> list[Near]:
        """All minima, of given pairs or of all, at which surfaces are nearer to each other than ``reach``, m."""
        known = self._minima.setdefault(fields, {})
        key = reach, None if pairs is None else tuple(pair.key for pair in pairs), *self.sides.values()
        if key not in known:
            known[key] = self._found(fields, reach, list(self.pairs.values()) if pairs is None else pairs)
        return list(known[key])

    def _found(self, fields: Fields, reach: float, pairs: Sequence[Pair]) -> list[Near]:
        """As of :meth:`found`."""
        stopped = [pair for pair in pairs if pair.stop is not None]
        x = {member: self.samples(fields.model.mesh, member) for pair in stopped for member in pair.members}
        near, keys = self._beside_obstacles(fields, x, reach, stopped), {p.key for p in pairs if p.stop is None}
        if keys:
            nearby, curve = self.nearby(fields.model), self._curve(fields)
            found = nearby.found(curve, reach / fields.model.scales.length, ends=False)
            near += self._once_each(one for one in self._told(nearby, curve, found) if one.pair in keys)
        return near

    def on_way(self, before: Fields, after: Fields, share: float, reach: float) -> list[Near]:
        """Minima of the distance between members, of surfaces nearer to each other than ``reach``, m, at a share of the
        straight way between two states on the same elements.
        """
        nearby, curve = self.nearby(after.model), self._curve(before).mean(self._curve(after), share)
        return self._told(nearby, curve, nearby.found(curve, reach / after.model.scales.length, ends=False))

    def nearby(self, model: Model, tables: Tables | None = None) -> Nearby:
        """The search among the members of a model, coarse where the ``tables`` of a motion are given."""
        if model not in self._nearby:
            coarse = 1 if tables is None else COARSE

            def samples(member: str) -> Array:
                return self.samples(model.mesh, member, coarse)

            # In a motion all that moves counts.
            all_names = [name for name, member in self.scene.members.items() if member.type != "small"]
            names = self.members if tables is None else all_names
            between = (pair for pair in self.pairs.values() if pair.stop is None)
            self._nearby[model] = Nearby(Lines(model, names, tables), between, samples)
        return self._nearby[model]

    def _curve(self, fields: Fields) -> Curve:
        """The centre lines in a state."""
        if fields not in self._curves:
            self._curves[fields] = self.nearby(fields.model).lines.of(fields)
        return self._curves[fields]

    def _on_line(self, fields: Fields, member: str, x: Array) -> tuple[Lines, Curve, Along]:
        """The centre lines, their state, and places at fractions (n,) of the length of a member."""
        lines = self.nearby(fields.model).lines
        return lines, self._curve(fields), lines.at(lines.members.index(member), x)

    def _told(self, nearby: Nearby, curve: Curve, places: Places) -> list[Near]:
        """Places on two members, the nearest of each pair first."""
        vectors, unit = three(nearby.between(curve, places)), nearby.lines.unit
        apart = np.linalg.norm(vectors, axis=1)
        normals = vectors / np.maximum(apart, TINY)[:, None]
        at = np.stack([nearby.lines.fractions(along) for along in (places.one, places.other)], axis=1).tolist()
        pairs = [self.pairs[nearby.pairs[k].key] for k in places.pairs.tolist()]
        gaps = [unit * a - pair.distance for a, pair in zip(apart.tolist(), pairs, strict=True)]
        return [
            Near(pairs[i].contact, pairs[i].members, tuple(at[i]), normals[i], gaps[i], pairs[i].distance)
            for i in np.lexsort((apart, places.pairs)).tolist()
        ]

    def _once_each(self, found: Iterable[Near]) -> list[Near]:
        """Minima without those that are as good as nearer ones, also on members that end at the same node."""
        kept, at_node = dict[PairKey, list[Near]](), dict[tuple[str, str], list[Near]]()
        for near in found:
            known = kept.setdefault(near.pair, [])
            same = any(self.alike(near.pair, near.at, other.at) for other in known)
            if not same and self.known_at_node(near, at_node) is None:
                known.append(near)
        return [near for known in kept.values() for near in known]

    def known_at_node(self, near: Near, at_node: dict[tuple[str, str], list[Near]]) -> Near | None:
        """Of places by contact and node the one that a place is, too, as members end there; None where there is none,
        and then it is entered.
        """
        ends = [at_node.setdefault((near.contact, node), []) for node in self.nodes(near)]
        same = next((other for own in ends for other in own if self.one_place(near, other)), None)
        if same is None:
            for own in ends:
                own.append(near)
        return same

    def nodes(self, one: ContactPoint | Near) -> list[str]:
        """The nodes at which a place is."""
        found = (self._node(member, x) for member, x in zip(one.members, one.at, strict=True))
        return [node for node in found if node]

    def _node(self, member: str, x: float) -> str:
        """The node at a place of a member; none within it."""
        return self.scene.members[member].nodes[int(x)] if x in (0.0, 1.0) else ""

    def one_place(self, one: ContactPoint | Near, other: ContactPoint | Near) -> bool:
        """Whether places on two members each are one as members end at the same nodes there, or are the same."""
        if one.contact != other.contact or len(one.at) < 2 or len(other.at) < 2:
            return False
        pairs = (self.pairs.get(place.pair) or self.pairs[place.contact, place.members[::-1]] for place in (one, other))
        width = SAME * min(pair.width for pair in pairs)

        def same(i: int, k: int) -> bool:
            (a, x), (b, y) = (one.members[i], one.at[i]), (other.members[k], other.at[k])
            return (a == b and abs(x - y) * self.lengths[a] < width) or self._node(a, x) == self._node(b, y) != ""

        return (same(0, 0) and same(1, 1)) or (same(0, 1) and same(1, 0))

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
            if not len(i):
                continue
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
            x = self.samples(fields.model.mesh, member)
            lines, curve, at = self._on_line(fields, member, x)
            known[member] = x, lines.unit * three(lines.positions(curve, at)), three(lines.slopes(curve, at))
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
            slope, curvature = self._slopes(fields, pair, at, near=True)
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

    def lies_up_to(self, fields: Fields, pair: PairKey, begin: float, end: float, lifted: float = 0.0) -> bool:
        """Whether a member lies on an obstacle from a place where it touches up to an end of it: it does not turn.

        ``lifted`` as of :meth:`lies`.
        """
        slope, _ = self._slopes_at(fields, pair, (end,))
        level = abs(float(slope[0])) * self.scene.size < max(self.lying, lifted)
        return level and self.lies(fields, pair, min(begin, end), max(begin, end), lifted)

    def rests(self, fields: Fields, pair: PairKey, at: float, lifted: float = 0.0) -> bool:
        """Whether a member lies on an obstacle from the last place that presses, ``at``, up to an end, without a force.

        ``lifted`` as of :meth:`lies`.
        """
        return any(
            self.lies_up_to(fields, pair, at, end, lifted)
            and abs(self.bends(fields, pair, end)) * self.scene.size < AT_END
            for end in (0.0, 1.0)
            if end != at
        )

    def gap_at(self, fields: Fields, pair: PairKey, at: float) -> float:
        """Gap, m, between a place of a member and an obstacle."""
        known = self._apart.setdefault(fields, {})
        if (pair, at) not in known:
            known[pair, at] = float(self._gaps(fields, self.pairs[pair], np.array([at]))[0][0])
        return known[pair, at]

    def bends(self, fields: Fields, pair: PairKey, at: float) -> float:
        """Curvature, 1/m, of the gap between a place of a member and an obstacle by arc length."""
        return float(self._slopes_at(fields, pair, (at,))[1][0])

    def _slopes_at(self, fields: Fields, pair: PairKey, at: tuple[float, ...]) -> tuple[Array, Array]:
        """As of :meth:`_slopes`, at a place that is asked for several times."""
        known = self._sloping.setdefault(fields, {})
        if (pair, at) not in known:
            known[pair, at] = self._slopes(fields, self.pairs[pair], np.array(at))
        return known[pair, at]

    def _gaps(self, fields: Fields, pair: Pair, x: Array) -> tuple[Array, Array]:
        """Of places (n,) of the member gaps (n,), m, and normals (n, 3); at an edge for the side 1."""
        (member,), stop = pair.members, pair.stop
        assert stop is not None
        lines, curve, at = self._on_line(fields, member, x)
        places = lines.unit * three(lines.positions(curve, at))
        # Only across an edge the normal depends on the member.
        tangent = three(lines.slopes(curve, at)) if stop.kind == "sharp" else places
        places, tangent = fields.seen(pair.contact, places, tangent)
        normals = stop.normals(places, tangent)
        return np.einsum("ni,ni->n", (places - stop.place) @ stop.across, normals) - pair.distance, normals

    def _slopes(self, fields: Fields, pair: Pair, x: Array, *, near: bool = False) -> tuple[Array, Array]:
        """Of places (n,) of the member slopes (n,) and curvatures (n,), 1/m, of the gap by arc length.

        At an edge, which members may be at, slopes, m, and curvatures of half the square of the distance.  Where it is
        ``near`` enough for Newton's method, curvatures are those of the line, not of the rotations along it.
        """
        (member,), stop = pair.members, pair.stop
        assert stop is not None
        lines, curve, at = self._on_line(fields, member, x)
        bent = three(lines.bends(curve, at)) / lines.unit if near else self._curvature(fields, member, x)
        places, tangent = lines.unit * three(lines.positions(curve, at)), three(lines.slopes(curve, at))
        places, tangent, bent = (
            *fields.seen(pair.contact, places, tangent),
            fields.seen(pair.contact, places, bent)[1],
        )
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

    # -- between members --------------------------------------------------------------------------

    def along(self, fields: Fields, pair: Pair, mesh: Mesh, reach: float) -> list[Near]:
        """Of the ends of elements of the first member of a pair on some mesh those at which the second one is nearer
        than ``reach``, m, as of :meth:`beside`; gaps from obstacles are the means of lines.
        """
        cuts = mesh.cuts[pair.members[0]]
        if pair.stop is None:
            return self.beside(fields, pair, cuts, reach)
        normals = self._gaps(fields, pair, cuts)[1]
        (points, weights), lengths = mesh.rule, np.diff(cuts)
        within = self._gaps(fields, pair, (cuts[:-1, None] + lengths[:, None] * points).ravel())[0]
        rising, falling = (
            lengths * np.einsum("ek,k->e", within.reshape(-1, len(points)), weights_towards(towards, weights))
            for towards in (points, 1.0 - points)
        )
        # Of an end of elements those before and behind it; also at an end that is held, whose element is free to leave.
        sides = np.append(0.0, lengths) + np.append(lengths, 0.0)
        gaps = (np.append(0.0, rising) + np.append(falling, 0.0)) / sides
        return [
            Near(*pair.key, (x,), normal, gap, pair.distance)
            for x, normal, gap in zip(cuts.tolist(), normals, gaps.tolist(), strict=True)
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
        nearby, curve, unit = self.nearby(fields.model), self._curve(fields), fields.model.scales.length
        chosen, places = nearby.beside(curve, pair, stations, (pair.distance + reach) / unit)
        there, vectors = nearby.lines.fractions(places.other), three(nearby.between(curve, places)) * unit
        apart, first = np.linalg.norm(vectors, axis=1), stations[chosen]
        own = (apart < pair.distance + reach) & (there > 0.0) & (there < 1.0)
        if len(set(pair.members)) == 1:
            own &= first < there
        places_of = zip(first[own].tolist(), there[own].tolist(), vectors[own], apart[own].tolist(), strict=True)
        return [Near(*pair.key, (s, t), v / max(a, TINY), a - pair.distance, pair.distance) for s, t, v, a in places_of]

    def alike(self, pair: PairKey, one: tuple[float, ...], other: tuple[float, ...], share: float = 1.0) -> bool:
        """Whether two places of a pair are as good as one, or so near as a share of that."""
        along = (abs(p - r) * self.lengths[m] for p, r, m in zip(one, other, pair[1], strict=True))
        return max(along) < SAME * share * self.pairs[pair].width

    def slopes(self, fields: Fields, key: PairKey, at: tuple[float, ...]) -> Array:
        """Slopes (2,) or (1,) of the distance by the arc lengths at a place."""
        pair = self.pairs[key]
        if pair.stop is not None:
            return self._slopes_at(fields, key, at)[0]
        slope, _, apart = self._half_square(fields, pair.members, at)
        return np.asarray(slope / apart)

    def half_square(self, fields: Fields, members: tuple[str, str], at: tuple[float, float]) -> tuple[Array, Array]:
        """Slope (2,), m, and curvature (2, 2) of half the square of the distance of two members by both arc lengths."""
        slope, curvature, _ = self._half_square(fields, members, at)
        return slope, curvature

    def _half_square(
        self, fields: Fields, members: tuple[str, ...], at: tuple[float, ...]
    ) -> tuple[Array, Array, float]:
        """The same, and the distance, m."""
        nearby, unit = self.nearby(fields.model), fields.model.scales.length
        numbers = (nearby.lines.members.index(member) for member in members)
        one, other = (nearby.lines.at(number, np.array([x])) for number, x in zip(numbers, at, strict=True))
        slope, curvature, apart = nearby.half_square(self._curve(fields), one, other)
        return unit * slope[:, 0], curvature[:, :, 0], unit * float(apart[0])

    def _curvature(self, fields: Fields, member: str, x: Array) -> Array:
        """Vectors of curvature (n, 3) of a centre line, 1/m."""
        low, high = np.maximum(x - BEND, 0.0), np.minimum(x + BEND, 1.0)
        first, last = np.split(fields.tangents(member, np.concatenate([low, high])), 2)
        change = last - first
        return np.asarray(change / ((high - low) * self.lengths[member])[:, None])


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
            lifted = min(LYING[1] if error is None else error, LIFTED) * scene.size
            entries = _stretches(fields, closest, points, entries, lifted)
        for entry in entries:
            entry["member"], entry["at"] = first_there(scene, contact, entry["member"], entry["at"])
            if contact.between_members:
                entry["other"], entry["other_at"] = first_there(scene, contact, entry["other"], entry["other_at"])
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
        return {**entry, "other": point.members[1], "other_at": told["at"][1], "gap": gap}
    stop = fields.model.scene.obstacles[point.contact]
    seen = fields.seen(point.contact, places[0][None], fields.tangents(point.members[0], np.array(told["at"])))
    gap = stop.gaps(*seen, way=point.edge or 1.0)[0]
    return {**entry, "gap": float(gap) - fields.model.scene.contacts[point.contact].member_radius}


def first_there(scene: Scene, contact: Contact, member: str, x: Any) -> tuple[str, Any]:
    """A place of a member; at a node that of the first member of a contact that ends there, stretches as they are."""
    if isinstance(x, list) or x not in (0.0, 1.0):
        return member, x
    node, taking = scene.members[member].nodes[int(x)], members_of(contact, scene.members)
    ends = ((name, one.nodes) for name, one in scene.members.items() if name in taking and one.type != "small")
    name, nodes = next((name, nodes) for name, nodes in ends if node in nodes)
    return name, float(nodes.index(node))


def _stretches(
    fields: Fields,
    closest: Closest,
    points: Sequence[ContactPoint],
    entries: Sequence[dict[str, Any]],
    lifted: float,
) -> list[dict[str, Any]]:
    """Entries of points on an obstacle, those between which a member lies on it, or is ``lifted`` by so little, m, as
    one along a stretch.
    """
    mesh, found = fields.model.mesh, list[dict[str, Any]]()
    extents = [_extent(mesh, point, entry) for point, entry in zip(points, entries, strict=True)]
    for i in sorted(range(len(points)), key=lambda i: (points[i].members, extents[i])):
        entry, (begin, end) = entries[i], extents[i]
        if found and found[-1]["member"] == entry["member"]:
            before = found[-1]
            first, last = np.broadcast_to(before["at"], 2).tolist()
            if begin <= last or closest.lies(fields, points[i].pair, last, begin, lifted):
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


AT_END = 1e-4
"""Curvature of a gap, dimensionless, that is none but for errors of the mesh at a free end of a member."""

NEARBY = 1.0
"""Distance up to which the gap of members that do not touch is told, in sizes of the scene."""
