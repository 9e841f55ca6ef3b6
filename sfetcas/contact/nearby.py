"""Where members are near to each other: local minima of the distance of their centre lines, of all pairs at once.

Each member is a chain of straight pieces.  A tree of their middles gives the pairs of pieces that may be near, so that
the effort grows with the number of members and of what is near, not with that of all pairs.  From each pair that is
nearer than those beside it, Newton's method leads to the minimum between the curves, see
:mod:`~sfetcas.mechanics.center_lines`.  The ends of elements that are near to another member are given as well: members
that are nearly parallel touch along lines, where a minimum says little.  Lengths are dimensionless.

A member is not near to itself, or to a member that continues it, over less than half a turn of the smallest circle that
its surface allows: no two places nearer to each other along the members can touch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.center_lines import Along, Curve, Lines
from .pairs import NEXT_TO, SAME, Pair

__all__ = ["ALIKE", "ITERATIONS", "Nearby", "Places"]

LEAST = 1e-6
"""Least curvature of half the square of the distance with which Newton's steps are made; it is one across a line."""

ITERATIONS, ARRIVED = 40, 1e-13
"""Newton's steps at most, and how little of the unit of length is as good as none."""

ALIKE = 1e-9
"""Share of a distance by which a shorter one is no other: rounding is far below, the curve of a member far above."""


@dataclass(frozen=True, eq=False)
class Places:
    """Pairs of places on two members that are near to each other.

    Attributes
    ----------
    pairs : ndarray (n,)
        Numbers of the pairs of members.
    one, other : Along
        The places on the first and the second member of each pair.
    held : ndarray (n,)
        Whether the place on the first (1) or the second member (2) stays where it is, or both (3); 0 where the distance
        is least.
    """

    pairs: Index
    one: Along
    other: Along
    held: Index

    def __len__(self) -> int:
        return len(self.pairs)

    def chosen(self, which: Array) -> Places:
        """Some of them, by numbers or by a mask."""
        return Places(self.pairs[which], self.one.chosen(which), self.other.chosen(which), self.held[which])

    def fixed(self) -> Places:
        """The same places, which stay where they are."""
        return replace(self, held=np.full(len(self), 3))

    def with_more(self, other: Places) -> Places:
        """These, then others."""
        pairs, held = (np.concatenate(part) for part in ((self.pairs, other.pairs), (self.held, other.held)))
        return Places(pairs, self.one.with_more(other.one), self.other.with_more(other.other), held)


class Nearby:
    """The search for what is near among the members of a scene.

    Parameters
    ----------
    lines : Lines
    pairs : iterable of Pair
        Members that may touch.
    samples : callable
        Name of a member -> fractions (n,) of its length between which it is nearly straight.

    Attributes
    ----------
    pairs : list of Pair
    distance : ndarray (pairs,)
        What the distance between the centre lines is where the surfaces touch.
    """

    def __init__(self, lines: Lines, pairs: Iterable[Pair], samples: Callable[[str], Array]) -> None:
        self.lines, self.pairs, unit = lines, list(pairs), lines.unit
        self.distance = np.array([pair.distance for pair in self.pairs]) / unit
        self._width = SAME * np.array([pair.width for pair in self.pairs]) / unit
        number = {name: k for k, name in enumerate(lines.members)}
        self._members = np.array([[number[m] for m in pair.members] for pair in self.pairs], np.intp).reshape(-1, 2)
        # Several records may say that the same members touch: each has a table of its own.
        self._tables: dict[str, Index] = {}
        for k, (pair, (a, b)) in enumerate(zip(self.pairs, self._members.tolist(), strict=True)):
            table = self._tables.setdefault(pair.contact, np.full((len(number),) * 2, -1, np.intp))
            table[a, b] = table[b, a] = k
        self._joined = self._joints()
        self._cut({k: samples(lines.members[k]) for k in np.unique(self._members).tolist()})

    def _joints(self) -> list[tuple[int, int, int]]:
        """Pairs of two members that end at the same node, and which ends these are."""
        members, found = self.lines.scene.members, list[tuple[int, int, int]]()
        for k, pair in enumerate(self.pairs):
            a, b = pair.members
            if a != b:
                ends = [(i, j) for i in (0, 1) for j in (0, 1) if members[a].nodes[i] == members[b].nodes[j]]
                found += [(k, i, j) for i, j in ends]
        return found

    def _cut(self, samples: dict[int, Array]) -> None:
        """The pieces of all members between which places are searched for, and the stations at ends of elements."""
        lines, stations = self.lines, list[Along]()
        begins, ends = list[Along](), list[Along]()
        for k, x in samples.items():
            within = lines.at(k, 0.5 * (x[1:] + x[:-1]))
            half = 0.5 * np.diff(x) * lines.whole[k]
            for found, by in ((begins, -half), (ends, half)):
                # A piece is within one element.
                xi = np.clip(within.xi + by / lines.length[within.elements], 0.0, 1.0)
                found.append(Along(within.elements, xi))
            own = np.arange(lines.first[k], lines.first[k + 1])
            stations.append(Along(np.append(own, own[-1]), np.append(np.zeros(len(own)), 1.0)))
        self._begin, self._end, self._stations = (together(part) for part in (begins, ends, stations))

    # -- search ---------------------------------------------------------------------------------------

    def found(self, curve: Curve, reach: float, *, ends: bool = True) -> Places:
        """All minima at which surfaces are nearer to each other than ``reach``, and with ``ends`` ends of elements."""
        from scipy.spatial import cKDTree

        if not self.pairs:
            nowhere = together([])
            return Places(nowhere.elements, nowhere, nowhere, nowhere.elements)
        p, r = self.lines.positions(curve, self._begin), self.lines.positions(curve, self._end)
        longest = float(np.linalg.norm(r - p, axis=1).max())
        tree = cKDTree(0.5 * (p + r))
        # A piece is at most half of it from its middle, and its arc rises above it by less than a quarter.
        limit = float(self.distance.max()) + reach + 1.5 * longest
        i, j = tree.query_pairs(limit, output_type="ndarray").T
        found = self._minima(curve, *self._candidates(p, r, i, j, reach + 0.5 * longest), longest)
        found = found.chosen(self.gaps(curve, found) < reach)
        if not ends:
            return found
        beside = self._beside(curve, tree, p, r, reach + 0.5 * longest, limit, longest)
        return found.with_more(beside.chosen(self.gaps(curve, beside) < reach))

    def gaps(self, curve: Curve, places: Places) -> Array:
        """Distances (n,) of the surfaces."""
        return np.asarray(np.linalg.norm(self.between(curve, places), axis=1) - self.distance[places.pairs])

    def between(self, curve: Curve, places: Places) -> Array:
        """Vectors (n, axes) from the places on the second members to those on the first."""
        return self.lines.positions(curve, places.one) - self.lines.positions(curve, places.other)

    def _numbered(self, one: Index, other: Index) -> list[tuple[Index, Index]]:
        """For each record those of two lists of members (n,) that may touch: indices, and numbers of the pairs."""
        found = []
        for table in self._tables.values():
            pairs = table[one, other]
            chosen = np.flatnonzero(pairs >= 0)
            found.append((chosen, pairs[chosen]))
        return found

    def _candidates(self, p: Array, r: Array, i: Index, j: Index, reach: float) -> tuple[Index, Along, Along]:
        """Pairs, and places on both members, where pieces i and j are nearer to each other than those beside them."""
        owner = self.lines.owner[self._begin.elements]
        pairs, first, second = list[Index](), list[Index](), list[Index]()
        for chosen, numbers in self._numbered(owner[i], owner[j]):
            swapped = self._members[numbers, 0] != owner[i[chosen]]
            pairs.append(numbers)
            first.append(np.where(swapped, j[chosen], i[chosen]))
            second.append(np.where(swapped, i[chosen], j[chosen]))
        k, i, j = (np.concatenate(part) for part in (pairs, first, second))
        s, t, distances = closest_on_pieces(p[i], r[i], p[j], r[j])
        # Between members numbers of pieces are left out, so that the last of one is not beside the first of the next.
        width = len(owner) + len(self.lines.members)
        layer = np.unique([pair.contact for pair in self.pairs], return_inverse=True)[1].ravel()[k] if len(k) else k
        least = locally_least(i + owner[i] + width * layer, j + owner[j], distances, width)
        least &= distances < self.distance[k] + reach
        one, other = (
            Along(self._begin.elements[at], self._begin.xi[at] + share * (self._end.xi - self._begin.xi)[at])
            for at, share in ((i[least], s[least]), (j[least], t[least]))
        )
        apart = ~self._next_to(k[least], one, other)
        return k[least][apart], one.chosen(apart), other.chosen(apart)

    def _next_to(self, pairs: Index, one: Along, other: Along) -> Array:
        """As of :class:`.Closest`: whether places are so near to each other along members that they cannot touch."""
        s, t = self.lines.lengths(one), self.lines.lengths(other)
        swapped = self.lines.owner[one.elements] != self._members[pairs, 0]
        s, t = np.where(swapped, t, s), np.where(swapped, s, t)
        limit = NEXT_TO * 0.5 * np.pi * self.distance[pairs]
        same = self._members[pairs, 0] == self._members[pairs, 1]
        found = same & (np.abs(s - t) < limit)
        if self._joined:
            total = self.lines.length
            whole = np.add.reduceat(total, self.lines.first[:-1])
            left = [np.stack([x, whole[self._members[pairs, n]] - x]) for n, x in enumerate((s, t))]
            for k, i, j in self._joined:
                found |= (pairs == k) & (left[0][i] + left[1][j] < limit)
        return np.asarray(found)

    # -- minima ---------------------------------------------------------------------------------------

    def _minima(self, curve: Curve, pairs: Index, one: Along, other: Along, longest: float) -> Places:
        """The minima between the curves from places on both, each once."""
        places = self.nearest(curve, Places(pairs, one, other, np.zeros(len(pairs), np.intp)), ITERATIONS, longest)
        bins = [np.rint(self.lines.lengths(x) / self._width[pairs]) for x in (places.one, places.other)]
        _, once = np.unique(np.stack([pairs, *bins]), axis=1, return_index=True)
        places = places.chosen(np.sort(once))
        return places.chosen(self.apart(places))

    def apart(self, places: Places) -> Array:
        """Which of them (n,), of bool, are so far from each other along the members that they can touch."""
        return ~self._next_to(places.pairs, places.one, places.other)

    def nearest(self, curve: Curve, places: Places, steps: int, longest: float) -> Places:
        """Places that are nearest to each other where they are not held, by so many steps of Newton's method.

        No step is longer than ``longest`` or a quarter of the distance.
        """
        lines, one, other = self.lines, places.one, places.other
        held = np.stack([(places.held & 1) > 0, (places.held & 2) > 0])
        for _ in range(steps):
            slope, curvature, apart = self.half_square(curve, one, other)
            # What is held, or at an end of its member, does not move.
            stays = held | np.stack([lines.end(one, -slope[0]), lines.end(other, -slope[1])])
            at = np.where(stays, np.where(slope > 0.0, 0.0, 1.0), 0.5)
            limit = np.maximum(0.25 * apart, longest)
            step = np.where(stays, 0.0, np.clip(downhill(slope, curvature, at), -limit, limit))
            one, other = lines.moved(one, step[0]), lines.moved(other, step[1])
            if np.abs(step).max(initial=0.0) < ARRIVED:
                break
        return replace(places, one=one, other=other)

    def half_square(self, curve: Curve, one: Along, other: Along) -> tuple[Array, Array, Array]:
        """Slope (2, n), curvature (2, 2, n) of half the square of the distance by both arc lengths; distance (n,)."""
        lines = self.lines
        d = lines.positions(curve, one) - lines.positions(curve, other)
        t, k = ([f(curve, x) for x in (one, other)] for f in (lines.slopes, lines.bends))

        def dot(a: Array, b: Array) -> Array:
            return np.einsum("ni,ni->n", a, b)

        slope = np.stack([dot(d, t[0]), -dot(d, t[1])])
        curvature = np.empty((2, 2, len(d)))
        curvature[0, 0] = dot(t[0], t[0]) + dot(d, k[0])
        curvature[1, 1] = dot(t[1], t[1]) - dot(d, k[1])
        curvature[0, 1] = curvature[1, 0] = -dot(t[0], t[1])
        return slope, curvature, np.maximum(np.linalg.norm(d, axis=1), TINY)

    # -- ends of elements -----------------------------------------------------------------------------

    def beside(self, curve: Curve, pair: Pair, at: Array, limit: float) -> tuple[Array, Places]:
        """Of places at fractions ``at`` (n,) of the first member of a pair those (k,) near to which the second one is,
        and both places (k,): whose distance is below a ``limit``, or little more.  The pair may be in the other order.

        Of a member beside itself each place counts with those that come later on it.
        """
        lines = self.lines
        a, b = (lines.members.index(name) for name in pair.members)
        pieces = np.flatnonzero(lines.owner[self._begin.elements] == b)
        begin, end, mine = self._begin.chosen(pieces), self._end.chosen(pieces), lines.at(a, at)
        p, r, here = (lines.positions(curve, along) for along in (begin, end, mine))
        out, chords = here[:, None, :] - p, r - p
        share = np.clip(np.einsum("npi,pi->np", out, chords) / np.einsum("pi,pi->p", chords, chords), 0.0, 1.0)
        distances = np.linalg.norm(out - share[:, :, None] * chords, axis=2)
        if a == b:
            far = lines.lengths(begin) + share * (end.xi - begin.xi) * lines.length[begin.elements]
            near = (
                far - lines.lengths(mine)[:, None]
                < NEXT_TO * 0.5 * np.pi * self.distance[self._tables[pair.contact][a, b]]
            )
            distances = np.where(near, np.inf, distances)
        best, longest = np.argmin(distances, axis=1), float(np.linalg.norm(chords, axis=1).max())
        chosen = np.flatnonzero(distances[np.arange(len(at)), best] < limit + 0.5 * longest)
        best, share = best[chosen], share[chosen, best[chosen]]
        there = Along(begin.elements[best], begin.xi[best] + share * (end.xi - begin.xi)[best])
        number = np.full(len(chosen), self._tables[pair.contact][a, b])
        held = np.ones(len(chosen), np.intp)
        found = self.nearest(curve, Places(number, mine.chosen(chosen), there, held), ITERATIONS, longest)
        apart = self.apart(found)
        return chosen[apart], found.chosen(apart)

    def _beside(
        self, curve: Curve, tree: object, p: Array, r: Array, reach: float, limit: float, longest: float
    ) -> Places:
        """Ends of elements, and the places of other members that are nearest to them."""
        from scipy.spatial import cKDTree

        here = self.lines.positions(curve, self._stations)
        near = cKDTree(here).sparse_distance_matrix(tree, limit, output_type="coo_matrix")
        i, j = near.row, near.col
        owners = self.lines.owner[self._stations.elements], self.lines.owner[self._begin.elements]
        found: list[Places] = []
        for chosen, pairs in self._numbered(owners[0][i], owners[1][j]):
            a, b = i[chosen], j[chosen]
            chord = r[b] - p[b]
            share = np.einsum("ni,ni->n", here[a] - p[b], chord) / np.maximum(np.einsum("ni,ni->n", chord, chord), TINY)
            share = np.clip(share, 0.0, 1.0)
            apart = np.linalg.norm(here[a] - p[b] - share[:, None] * chord, axis=1)
            there = Along(self._begin.elements[b], self._begin.xi[b] + share * (self._end.xi - self._begin.xi)[b])
            mine = self._stations.chosen(a)
            # Of a member beside itself each station counts with what comes later.
            same = self._members[pairs, 0] == self._members[pairs, 1]
            use = (apart < self.distance[pairs] + reach) & ~self._next_to(pairs, mine, there)
            use &= ~same | (self.lines.lengths(mine) < self.lines.lengths(there))
            use = np.flatnonzero(use)
            use = use[np.lexsort((apart[use], pairs[use], a[use]))]
            key = np.stack([a[use], pairs[use]])
            first = np.ones(len(use), bool)
            first[1:] = (key[:, 1:] != key[:, :-1]).any(axis=0)
            use = use[first]
            swapped = self._members[pairs[use], 0] != owners[0][a[use]]
            mine, there = mine.chosen(use), there.chosen(use)
            one, other = (
                Along(np.where(swapped, y.elements, x.elements), np.where(swapped, y.xi, x.xi))
                for x, y in ((mine, there), (there, mine))
            )
            found.append(Places(pairs[use], one, other, np.where(swapped, 2, 1)))
        whole = found[0]
        for more in found[1:]:
            whole = whole.with_more(more)
        whole = self.nearest(curve, whole, ITERATIONS, longest)
        return whole.chosen(self.apart(whole))


def together(parts: Iterable[Along]) -> Along:
    """Places of several lists, one after the other."""
    parts = list(parts)
    elements = np.concatenate([np.zeros(0, np.intp), *(part.elements for part in parts)])
    return Along(elements, np.concatenate([np.zeros(0), *(part.xi for part in parts)]))


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
