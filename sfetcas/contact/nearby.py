"""Where members are near to each other, of all members of a scene at once, for motions with many touches.

The minima are those of :mod:`~sfetcas.contact.closest`, found for all pairs of members in the same few operations of
arrays, along the polynomials of :mod:`~sfetcas.mechanics.center_lines`.  The ends of elements that are near to another
member are given as well: members that are nearly parallel touch along lines, where a minimum says little.  Lengths
are dimensionless.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.center_lines import Along, Curve, Lines
from .closest import NEXT_TO, SAME, Closest, closest_on_pieces, downhill, locally_least

__all__ = ["Nearby", "Places"]

PIECES, MOST_PIECES = 2, 50
"""Straight pieces of an element at least and at most."""

SLENDER = 2.0
"""Length of a piece at most, over the least radius of its member: chains then find minima some radii apart."""

LEAST = 1e-6
"""Least curvature of half the square of the distance with which Newton's steps are made; it is one across a line."""

ITERATIONS, ARRIVED = 40, 1e-12
"""Newton's steps at most, and how little of the unit of length is as good as none."""


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
    closest : Closest
        It says which members may touch.

    Attributes
    ----------
    pairs : list of Pair
    distance : ndarray (pairs,)
        What the distance between the centre lines is where the surfaces touch.
    """

    def __init__(self, lines: Lines, closest: Closest) -> None:
        self.lines, unit = lines, lines.model.scales.length
        self.pairs = [pair for pair in closest.pairs.values() if pair.stop is None]
        self.distance = np.array([pair.distance for pair in self.pairs]) / unit
        self._width = SAME * np.array([pair.width for pair in self.pairs]) / unit
        number = {name: k for k, name in enumerate(lines.members)}
        self._members = np.array([[number[m] for m in pair.members] for pair in self.pairs], np.intp).reshape(-1, 2)
        # Several records may say that the same members touch: each has a table of its own.
        self._tables: dict[str, Index] = {}
        for k, (pair, (a, b)) in enumerate(zip(self.pairs, self._members.tolist(), strict=True)):
            table = self._tables.setdefault(pair.contact, np.full((len(number),) * 2, -1, np.intp))
            table[a, b] = table[b, a] = k
        self._joined = self._joints(closest)
        self._cut(closest, unit)

    def _joints(self, closest: Closest) -> list[tuple[int, int, int]]:
        """Pairs of two members that end at the same node, and which ends these are."""
        members, found = closest.scene.members, list[tuple[int, int, int]]()
        for k, pair in enumerate(self.pairs):
            a, b = pair.members
            if a != b:
                ends = [(i, j) for i in (0, 1) for j in (0, 1) if members[a].nodes[i] == members[b].nodes[j]]
                found += [(k, i, j) for i, j in ends]
        return found

    def _cut(self, closest: Closest, unit: float) -> None:
        """The pieces of all members between which places are searched for, and the stations at ends of elements."""
        lines, elements, xi, stations = self.lines, list[Index](), list[Array](), list[tuple[int, float]]()
        taking = set(self._members.ravel().tolist())
        for k, name in enumerate(lines.members):
            own = np.arange(lines.first[k], lines.first[k + 1])
            if k not in taking:
                continue
            count = np.ceil(lines.length[own] * unit / (SLENDER * closest.least[name]))
            for e, n in zip(own.tolist(), np.clip(count, PIECES, MOST_PIECES).astype(int).tolist(), strict=True):
                elements.append(np.repeat(e, n))
                xi.append(np.arange(n) / n)
            stations += [(e, 0.0) for e in own.tolist()] + [(int(own[-1]), 1.0)]
        nothing = np.zeros(0)
        begin = Along(np.concatenate([nothing, *elements]).astype(np.intp), np.concatenate([nothing, *xi]))
        each = np.array([1.0 / len(part) for part in xi for _ in part])
        self._begin, self._end = begin, Along(begin.elements, np.minimum(begin.xi + each, 1.0))
        self._stations = Along(np.array([e for e, _ in stations], np.intp), np.array([x for _, x in stations]))

    # -- search ---------------------------------------------------------------------------------------

    def found(self, curve: Curve, reach: float, *, ends: bool = True) -> Places:
        """All minima at which surfaces are nearer to each other than ``reach``, and with ``ends`` ends of elements."""
        from scipy.spatial import cKDTree

        if not self.pairs:
            nowhere = Along(np.zeros(0, np.intp), np.zeros(0))
            return Places(np.zeros(0, np.intp), nowhere, nowhere, np.zeros(0, np.intp))
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
            slope, curvature, apart = self._half_square(curve, one, other)
            # What is held, or at an end of its member, does not move.
            stays = held | np.stack([lines.end(one, -slope[0]), lines.end(other, -slope[1])])
            at = np.where(stays, np.where(slope > 0.0, 0.0, 1.0), 0.5)
            limit = np.maximum(0.25 * apart, longest)
            step = np.where(stays, 0.0, np.clip(downhill(slope, curvature, at), -limit, limit))
            one, other = lines.moved(one, step[0]), lines.moved(other, step[1])
            if np.abs(step).max(initial=0.0) < ARRIVED:
                break
        return replace(places, one=one, other=other)

    def _half_square(self, curve: Curve, one: Along, other: Along) -> tuple[Array, Array, Array]:
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
