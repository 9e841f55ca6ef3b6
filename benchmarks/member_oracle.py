"""Members that touch each other by another way: chains of rigid links.  Nothing of the solver is used.

The links of :mod:`.contact_chain` are round rods with round ends: pairs of them push each other by the same stiff
barrier as obstacles, which nothing can pass.  The loads are followed from zero by descent as in
:mod:`.contact_oracle`, or the energy is minimised from where an answer has its members, a little disturbed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sfetcas.equilibria.solution import Equilibrium
from sfetcas.mathematics.arrays import Array, Index
from sfetcas.mathematics.threads import single_threaded

from .contact_chain import Chain, ChainState, NotAChainError
from .contact_oracle import WIDTHS, emerged, followed, settled

__all__ = ["LINKS", "MemberChain", "RodAnswer", "near_answer", "rods_in_contact"]

Table = dict[str, Any]

LINKS = {2: 20, 3: 14}
"""Links of a flexible member in the coarser of the two chains, in the plane and in space."""

DISTURBED = 0.005
"""Rotations, rad, by which the links of an answer are disturbed."""

THINNER = 0.9
"""Share of the radii from which members of an answer, whose chords may penetrate, grow to their own."""


@dataclass(frozen=True)
class RodAnswer:
    """What chains of rods find.

    Attributes
    ----------
    members : dict of str to ndarray (5, 3)
        Places at QUARTERS of the length, m, extrapolated from N and 2 N links.
    error : float
        Largest difference of these places between N and 2 N links, m.
    size : float
        Largest distance of two nodes, or half of the longest member's length, m.
    forces : dict of (str, str) to float
        Sum of the sizes of the forces between two members, N; extrapolated.
    force_error : float
        Largest difference of these forces between N and 2 N links, N.
    energy : float
        Of 2 N links, J, zero in the undeformed state.
    snaps : tuple of float
        Factors at which stability was lost, of 2 N links.
    """

    members: dict[str, Array]
    error: float
    size: float
    forces: dict[tuple[str, str], float]
    force_error: float
    energy: float
    snaps: tuple[float, ...]


class MemberChain(Chain):
    """A chain whose links are rods that push each other."""

    def __init__(self, scene: Table, links: int) -> None:
        super().__init__({**scene, "contacts": {}}, links)
        self.grown = 1.0
        one, other, distance = list[int](), list[int](), list[float]()
        owners = {link: name for name, own in self.link_of.items() for link in own}
        for contact in scene["contacts"].values():
            if contact["type"] != "members" or "radius" not in contact:
                raise NotAChainError("an obstacle, or a contact without a radius")
            named = contact.get("members", [contact.get("member")])
            names = list(scene["members"]) if named == "all" else named
            both = 2.0 * float(contact["radius"]) / self.size
            for k, a in enumerate(names):
                for b in names[k:]:
                    pairs = [(i, j) for i in self.link_of[a] for j in self.link_of[b] if a != b or i < j]
                    pairs = [(i, j) for i, j in pairs if self._along(scene, owners, i, j) > 0.45 * math.pi * both]
                    one += [i for i, _ in pairs]
                    other += [j for _, j in pairs]
                    distance += [both] * len(pairs)
        self.one, self.other, self.distance = np.array(one, int), np.array(other, int), np.array(distance)
        self.owners, self.thin = owners, 0.5 * min(distance, default=1.0)
        # What is led does not pass through anything in one increment.
        led = [np.linalg.norm(m["displacement"]) for m in scene.get("motions", {}).values() if "displacement" in m]
        self.longest = self.thin * self.size / max(led, default=self.thin * self.size)

    def _along(self, scene: Table, owners: dict[int, str], i: int, j: int) -> float:
        """Length between two links along members that are one or have a common node."""
        a, b = owners[i], owners[j]
        own = 0.5 * float(self.lengths[i] + self.lengths[j])
        places = [(k - self.link_of[m].start + 0.5) * self.lengths[k] for k, m in ((i, a), (j, b))]
        if a == b:
            return float(abs(places[0] - places[1])) - own
        whole = [float(self.lengths[list(self.link_of[m])].sum()) for m in (a, b)]
        found = math.inf
        for s, node in zip((places[0], whole[0] - places[0]), scene["members"][a]["nodes"]):
            for t, same in zip((places[1], whole[1] - places[1]), scene["members"][b]["nodes"]):
                found = min(found, s + t - own) if node == same else found
        return found

    # -- rods ---------------------------------------------------------------------------------------------------------

    def apart(self, x: Array, d: Array) -> tuple[Index, Array, Array, Array]:
        """Pairs that penetrate: their numbers (n,), gaps (n,), and arc lengths (n,) on both links."""
        begin = x[np.array(self.link_rows)]
        middle = begin + 0.5 * self.lengths[:, None] * d
        distance = self.grown * self.distance
        reach = distance + 0.5 * (self.lengths[self.one] + self.lengths[self.other])
        near = np.flatnonzero(np.linalg.norm(middle[self.one] - middle[self.other], axis=1) < reach)
        i, j = self.one[near], self.other[near]
        s, t = _closest(begin[i], d[i], self.lengths[i], begin[j], d[j], self.lengths[j])
        y = begin[i] + s[:, None] * d[i] - begin[j] - t[:, None] * d[j]
        gap = np.linalg.norm(y, axis=1) - distance[near]
        deep = gap < 0.0
        return near[deep], gap[deep], s[deep], t[deep]

    def potential(self, state: ChainState, s: float, width: float, barrier: bool = False) -> float:
        """Energy of springs and loads; with the barrier infinite where links enter each other by its width."""
        energy = super().potential(state, s, width)
        if not barrier:
            return energy
        g = self.apart(self.points(state), self.directions(state)[0])[1]
        if (g <= -width).any():
            return math.inf
        return energy - self.strength / width * float(np.sum(g**2 * np.log1p(g / width)))

    def pushed(self, x: Array, d: Array, grown: Array, width: float) -> tuple[Array, Array]:
        """Gradient (links + nodes, dim) and Hessian of the barrier; ``grown`` leads from unknowns to places."""
        dim, total = self.dim, grown.shape[1] // self.dim
        gz, H = np.zeros((self.X.shape[1], dim)), np.zeros((total, total))
        pairs, g, s, t = self.apart(x, d)
        if not len(pairs):
            return gz, H
        i, j = self.one[pairs], self.other[pairs]
        rows = np.array(self.link_rows)
        y = x[rows[i]] + s[:, None] * d[i] - x[rows[j]] - t[:, None] * d[j]
        ones, eye = np.ones(len(pairs)), np.eye(dim)
        B = np.concatenate([w[:, None, None] * eye for w in (ones, s, -ones, -t)], axis=2)
        first = np.einsum("nik,ni->nk", B, y)
        second = np.einsum("nik,nil->nkl", B, B)
        # The places on both links follow, where they are not at ends.
        free = np.stack([(s > 0.0) & (s < self.lengths[i]), (t > 0.0) & (t < self.lengths[j])], axis=1)
        by = np.stack([np.einsum("nik,ni->nk", B, d[i]), -np.einsum("nik,ni->nk", B, d[j])], axis=2)
        by[:, dim : 2 * dim, 0] += y
        by[:, 3 * dim :, 1] -= y
        both = -np.einsum("ni,ni->n", d[i], d[j])
        P = np.broadcast_to(np.eye(2), (len(pairs), 2, 2)).copy()
        P[:, 0, 1] = P[:, 1, 0] = np.where(free.all(axis=1), np.clip(both, -1.0 + 1e-6, 1.0 - 1e-6), 0.0)
        by = by * free[:, None, :]
        second -= by @ np.linalg.solve(P, by.transpose(0, 2, 1))
        r = np.linalg.norm(y, axis=1)[:, None, None]
        second = second / r - np.einsum("ni,nj->nij", first, first) / r**3
        first = first / r[:, 0]
        kappa = self.strength / width
        f1 = -kappa * (2.0 * g * np.log1p(g / width) + g**2 / (width + g))
        f2 = -kappa * (2.0 * np.log1p(g / width) + 4.0 * g / (width + g) - g**2 / (width + g) ** 2)
        h = f2[:, None, None] * np.einsum("ni,nj->nij", first, first) + f1[:, None, None] * second
        parts = (f1[:, None] * first).reshape(len(pairs), 4, dim)
        for at, k in ((i, 0), (j, 2)):
            gz += self.X[rows[at]].T @ parts[:, k]
            np.add.at(gz, at, parts[:, k + 1])
        ends = [(self.X[rows[at]] @ grown).reshape(len(pairs), dim, total) for at in (i, j)]
        J = grown.reshape(-1, dim, total)
        T = np.concatenate([ends[0], J[i], ends[1], J[j]], axis=1)
        return gz, T.reshape(-1, total).T @ (h @ T).reshape(-1, total)

    def between(self, state: ChainState, width: float) -> dict[tuple[str, str], float]:
        """Sums of the forces between members, N."""
        found: dict[tuple[str, str], float] = {}
        pairs, g, *_ = self.apart(self.points(state), self.directions(state)[0])
        for k, gap in zip(pairs, g, strict=True):
            force = self.strength / width * (2.0 * gap * np.log1p(gap / width) + gap**2 / (width + gap))
            key = (self.owners[int(self.one[k])], self.owners[int(self.other[k])])
            found[key] = found.get(key, 0.0) + float(force) * self.unit / self.size**2
        return found


def _closest(p: Array, d: Array, a: Array, r: Array, e: Array, b: Array) -> tuple[Array, Array]:
    """Arc lengths (n,) at which links, from p along d with length a, and r, e, b, are nearest to each other.

    The least of the inner place and of those at the four ends.
    """
    w, c = p - r, np.einsum("ni,ni->n", d, e)
    dw, ew = np.einsum("ni,ni->n", d, w), np.einsum("ni,ni->n", e, w)
    det = np.maximum(1.0 - c * c, 1e-14)
    zero = np.zeros(len(a))
    s0 = np.clip((c * ew - dw) / det, 0.0, a)
    tries = [(s0, np.clip(c * s0 + ew, 0.0, b))]
    tries += [(s, np.clip(c * s + ew, 0.0, b)) for s in (zero, a)]
    tries += [(np.clip(c * t - dw, 0.0, a), t) for t in (zero, b)]
    S, T = np.array([s for s, _ in tries]), np.array([t for _, t in tries])
    apart = np.linalg.norm(w + S[:, :, None] * d - T[:, :, None] * e, axis=2)
    best, k = np.argmin(apart, axis=0), np.arange(len(a))
    return S[best, k], T[best, k]


# -- answers ----------------------------------------------------------------------------------------------------------


@single_threaded
def rods_in_contact(scene: Table, links: int | None = None) -> RodAnswer:
    """Follow the loads of a scene, a dictionary as in its file, from zero to factor 1.

    Raises
    ------
    NotAChainError
        What is not known here.
    """
    chains = _chains(scene, links)
    ends = [followed(chain) for chain in chains]
    return _answer(chains, [state for state, _ in ends], tuple(ends[1][1]))


@single_threaded
def near_answer(scene: Table, step: Equilibrium, links: int | None = None, seed: int = 0) -> RodAnswer:
    """Minimise the energy from where an answer at factor 1 has its members, disturbed at random.

    Raises
    ------
    NotAChainError
        What is not known here.
    """
    chains = _chains(scene, links)
    return _answer(chains, [_relaxed(chain, step, seed) for chain in chains], ())


def _chains(scene: Table, links: int | None) -> list[MemberChain]:
    links = links or LINKS[3 if scene.get("dimension") == "space" else 2]
    return [MemberChain(scene, links), MemberChain(scene, 2 * links)]


def _relaxed(chain: MemberChain, step: Equilibrium, seed: int) -> ChainState:
    rng, state = np.random.default_rng(seed), chain.start()
    for name, body in chain.node_body.items():
        if body is not None and body != 0 and (turned := step.quaternion(name)) is not None:
            state.turns[body] = turned if chain.dim == 3 else step.angle(name)
    for name, own in chain.link_of.items():
        there = step.along(name, (np.arange(len(own)) + 0.5) / len(own))
        state.turns[chain.link_body[list(own)]] = there["quaternion"] if chain.dim == 3 else there["angle"][:, None]
    by = DISTURBED * rng.normal(size=(len(chain.free), chain.dof))
    state.turns[chain.free] = chain.kind.turned(state.turns[chain.free], by)
    state.p[:] = np.array([step.position(name)[: chain.dim] for name in chain.names]) / chain.size
    state, chain.grown = chain.driven(state, 1.0), THINNER
    A = chain.system(state, 1.0, WIDTHS[0])[2]
    projected = chain.moved(state, np.zeros(A.shape[1]), 1.0, np.linalg.pinv(A, rcond=1e-10))
    if projected is None:
        raise NotAChainError("the answer does not meet the constraints")
    state = projected
    count = int(np.ceil((1.0 - THINNER) * chain.distance.max(initial=0.0) / (0.5 * WIDTHS[0]))) + 1
    growing = [(share, WIDTHS[0], WIDTHS[0]) for share in np.linspace(THINNER, 1.0, count + 1)]
    for grown, before, width in growing + [(1.0, *both) for both in zip(WIDTHS, WIDTHS[1:])]:
        chain.grown = grown
        state = emerged(chain, state, before, width)
        found = settled(chain, state, 1.0, width, True)[0]
        if found is None:
            raise NotAChainError(f"no state found from the answer, at {grown:g} of the radii and {width:g}")
        state = found
    return state


def _answer(chains: list[MemberChain], states: list[ChainState], snaps: tuple[float, ...]) -> RodAnswer:
    (one, two), fine, width = [c.shapes(x) for c, x in zip(chains, states)], chains[1], WIDTHS[-1]
    size = fine.size
    error = max(float(np.linalg.norm(one[name] - two[name], axis=1).max()) for name in two)
    places = {name: size * (two[name] + (two[name] - one[name]) / 3.0) for name in two}
    forces = [chain.between(state, width) for chain, state in zip(chains, states)]
    pairs = {pair: [force.get(pair, 0.0) for force in forces] for pair in forces[0] | forces[1]}
    energy = fine.potential(states[1], 1.0, width) - fine.potential(fine.start(), 1.0, width)
    return RodAnswer(
        {name: np.pad(p, ((0, 0), (0, 3 - fine.dim))) for name, p in places.items()},
        size * error,
        size,
        {pair: b + (b - a) / 3.0 for pair, (a, b) in pairs.items()},
        max((abs(b - a) for a, b in pairs.values()), default=0.0),
        energy * fine.unit / size,
        snaps,
    )
