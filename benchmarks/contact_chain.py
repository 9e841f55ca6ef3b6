"""Chains of rigid links: the scene of a contact problem as bodies that turn, springs, and a barrier at obstacles.

Nothing of the solver is used.  A flexible member is N rigid links with rotational springs EI/h between them (2 EI/h
against the nodes); rotations are angles in the plane and quaternions in space, all since the undeformed state.
Obstacles act on the links as segments, by an energy that grows without limit towards their width inside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sfetcas.mathematics.arrays import Array, Index

__all__ = ["QUARTERS", "Chain", "ChainState", "NotAChainError", "in_space", "member_points"]

Table = dict[str, Any]

QUARTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Fractions of members at which places are given."""


class NotAChainError(Exception):
    """What the scene has that this does not know, or that no state was found."""


# -- rotations: since the undeformed state, of bodies, in the plane and in space -----------------------------------


class _Plane:
    dim, dof = 2, 1

    @staticmethod
    def none(count: int) -> Array:
        return np.zeros((count, 1))

    @staticmethod
    def turned(turns: Array, by: Array) -> Array:
        return turns + by

    @staticmethod
    def directions(turns: Array, d0: Array) -> tuple[Array, Array]:
        """Directions (n, 2) and their derivatives (n, 2, 1)."""
        c, s = np.cos(turns[:, 0]), np.sin(turns[:, 0])
        d = np.column_stack([c * d0[:, 0] - s * d0[:, 1], s * d0[:, 0] + c * d0[:, 1]])
        return d, np.column_stack([-d[:, 1], d[:, 0]])[:, :, None]

    @staticmethod
    def bent(d: Array, g: Array) -> Array:
        """Second derivatives (n, 1, 1) of g . d."""
        return -np.einsum("ni,ni->n", d, g)[:, None, None]

    @staticmethod
    def springs(a: Array, b: Array, K: Array) -> tuple[float, Array, Array, Array, Array]:
        """Energy; gradient (n, 1) for b (that for a is its negative); Hessian blocks aa, ab, bb."""
        v = b - a
        m = np.einsum("nij,nj->ni", K, v)
        return 0.5 * float(np.sum(m * v)), m, K, -K, K


def _cross(v: Array) -> Array:
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return out - out.transpose(0, 2, 1)


def _product(a: Array, b: Array) -> Array:
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
    return np.hstack([w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])])


def _matrices(q: Array) -> Array:
    u, v = q[:, 0], q[:, 1:]
    across = _cross(v)
    return np.eye(3) + 2.0 * (u[:, None, None] * across + across @ across)


class _Space:
    """Unit quaternions; increments turn about the fixed axes."""

    dim, dof = 3, 3

    @staticmethod
    def none(count: int) -> Array:
        return np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))

    @staticmethod
    def turned(turns: Array, by: Array) -> Array:
        half = 0.5 * np.linalg.norm(by, axis=1, keepdims=True)
        q = _product(np.hstack([np.cos(half), 0.5 * np.sinc(half / np.pi) * by]), turns)
        return q / np.linalg.norm(q, axis=1, keepdims=True)

    @staticmethod
    def directions(turns: Array, d0: Array) -> tuple[Array, Array]:
        d = np.einsum("nij,nj->ni", _matrices(turns), d0)
        return d, -_cross(d)

    @staticmethod
    def bent(d: Array, g: Array) -> Array:
        outer = np.einsum("ni,nj->nij", g, d)
        return 0.5 * (outer + outer.transpose(0, 2, 1)) - np.einsum("ni,ni->n", d, g)[:, None, None] * np.eye(3)

    @staticmethod
    def springs(a: Array, b: Array, K: Array) -> tuple[float, Array, Array, Array, Array]:
        """The angle between two bodies by v = 2 vec(a* b), about the undeformed axes in which K is given."""
        r = _product(a * [1.0, -1.0, -1.0, -1.0], b)
        v = 2.0 * r[:, 1:]
        M = (r[:, :1, None] * np.eye(3) - _cross(r[:, 1:])) @ _matrices(a).transpose(0, 2, 1)
        m = np.einsum("nij,nj->ni", K, v)
        g = np.einsum("nji,nj->ni", M, m)
        H = M.transpose(0, 2, 1) @ K @ M - 0.25 * np.einsum("ni,ni->n", m, v)[:, None, None] * np.eye(3)
        return 0.5 * float(np.sum(m * v)), g, H, -H + 0.5 * _cross(g), H


# -- the chain -----------------------------------------------------------------------------------------------------


@dataclass
class ChainState:
    """Rotations of bodies, (bodies, 1) or (bodies, 4), and places of nodes over the size, (nodes, dim)."""

    turns: Array
    p: Array


@dataclass
class _Stop:
    """An obstacle by numbers, in units of the size."""

    name: str
    flat: bool
    place: Array
    normal: Array
    across: Array
    radius: float
    inside: bool
    points: list[int] = field(default_factory=list)
    links: list[int] = field(default_factory=list)


@dataclass
class _Gaps:
    """Near gaps: values (n,), derivatives (n, 2 dim) for start and direction of a link, second ones."""

    g: Array
    rows: Index
    links: Index
    along: Array
    first: Array
    second: Array


class Chain:
    """The scene as bodies with rotations, nodes with places, and what is linear in directions and places.

    Everything is in units of the size and of a bending stiffness: lengths over size, energies over EI/size.
    """

    def __init__(self, scene: Table, links: int) -> None:
        _known(scene)
        self.kind: Any = _Space if in_space(scene) else _Plane
        self.dim, self.dof = self.kind.dim, self.kind.dof
        self.names = list(scene["nodes"])
        given = {name: _vector(node["position"]) for name, node in scene["nodes"].items()}
        ends = {name: [given[k] for k in m["nodes"]] for name, m in scene["members"].items()}
        curves = {name: _Curve(m, *ends[name]) for name, m in scene["members"].items()}
        places = np.array(list(given.values()))
        distances = np.linalg.norm(places[:, None] - places[None], axis=2).max()
        self.size = float(max(distances, *(0.5 * c.length for c in curves.values())))
        stiffnesses = [float(s.get("EI3", 0.0)) for s in scene["sections"].values()]
        self.unit = max([*stiffnesses, *(float(s["stiffness"]) * self.size for s in scene.get("springs", {}).values())])
        self.p0 = places[:, : self.dim] / self.size
        self._bodies(scene, curves, links)
        self._loads(scene, curves)
        self._held(scene)
        self.stops = [self._stop(name, c, scene) for name, c in scene.get("contacts", {}).items()]
        rounds = [s.radius for s in self.stops if not s.flat]
        self.thin, self.longest = min(rounds, default=1.0), 1.0

    def start(self) -> ChainState:
        """The undeformed state."""
        return ChainState(self.kind.none(self.bodies), self.p0.copy())

    # -- building ---------------------------------------------------------------------------------------------------

    def _bodies(self, scene: Table, curves: dict[str, _Curve], links: int) -> None:
        """Body 0 is the ground; then nodes that have a rotation, then links; rigid members are their nodes' bodies."""
        parent: list[int] = [0]

        def new() -> int:
            parent.append(len(parent))
            return len(parent) - 1

        def root(i: int) -> int:
            while parent[i] != i:
                i = parent[i]
            return i

        def join(i: int, j: int) -> None:
            i, j = sorted((root(i), root(j)))
            parent[j] = i

        node_body = {}
        for name, node in scene["nodes"].items():
            node_body[name] = new() if node.get("joint", "rigid") == "rigid" else None
        driven = {m["node"]: m for m in scene.get("motions", {}).values() if "rotation" in m}
        for name, node in scene["nodes"].items():
            support = node.get("support", "free")
            fixed = support == "clamped" or (support == "slider" and node.get("rotation", "fixed") == "fixed")
            if fixed and name not in driven:
                if node_body[name] is None:
                    continue
                join(0, node_body[name])  # type: ignore[arg-type]
        self.member_ends: dict[str, list[int]] = {}
        pairs: list[tuple[int, int]] = []
        stiffness: list[Array] = []
        body: list[int] = []
        d0: list[Array] = []
        lengths: list[float] = []
        self.rows: dict[str, list[int]] = {}
        self.link_rows: list[int] = []
        self.link_of: dict[str, range] = {}
        sums: list[dict[int, float]] = []
        bases: list[int] = []
        for name, member in scene["members"].items():
            rigid = member.get("type", "flexible") == "rigid"
            n = 1 if rigid else links
            curve = curves[name]
            nodes = [node_body[k] for k in member["nodes"]]
            released = [r != "rigid" for r in member.get("release", ["rigid", "rigid"])]
            nodes = [None if r else k for k, r in zip(nodes, released)]
            firsts = len(body)
            self.link_of[name] = range(firsts, firsts + n)
            points = np.array([curve.at(i / n) for i in range(n + 1)])[:, : self.dim] / self.size
            chords = np.diff(points, axis=0)
            here = [new() for _ in range(n)]
            for i in range(n):
                length = float(np.linalg.norm(chords[i]))
                body.append(here[i])
                lengths.append(length)
                d0.append(chords[i] / length)
            if rigid:
                for k in nodes:
                    if k is not None:
                        join(k, here[0])
            else:
                h = curve.length / self.size / n
                for i in range(n + 1):
                    K = self._stiffness(scene["sections"][member["section"]], member, curve, i / n) / h
                    if 0 < i < n:
                        pairs.append((here[i - 1], here[i]))
                        stiffness.append(K)
                    elif nodes[0 if i == 0 else 1] is not None:
                        k = nodes[0 if i == 0 else 1]
                        assert k is not None
                        pairs.append((k, here[0]) if i == 0 else (here[-1], k))
                        stiffness.append(2.0 * K)
            self.member_ends[name] = [here[0], here[-1]]
            base = self.names.index(member["nodes"][0])
            rows = []
            for i in range(n + 1):
                rows.append(len(sums))
                sums.append({firsts + j: lengths[firsts + j] for j in range(i)})
                bases.append(base)
                if i < n:
                    self.link_rows.append(rows[-1])
            self.rows[name] = rows
        for spring in scene.get("springs", {}).values():
            one, two = ([*spring["between"], None] if "between" in spring else ["ground", None, None])[:2]
            a, b = (self._party(p, spring["node"], scene, node_body) for p in (one, two))
            pairs.append((a, b))
            stiffness.append(np.array([[float(spring["stiffness"]) * self.size / self.unit]]))
        self.bodies = len(parent)
        self.lengths, self.d0 = np.array(lengths), np.array(d0)
        self.link_body = np.array([root(i) for i in body])
        self.pairs = np.array([(root(a), root(b)) for a, b in pairs], dtype=int).reshape(-1, 2)
        self.K = np.array(stiffness).reshape(-1, self.dof, self.dof)
        self.node_body = {name: None if b is None else root(b) for name, b in node_body.items()}
        self.driven_bodies = {root(node_body[name]): m["rotation"] for name, m in driven.items()}  # type: ignore[arg-type]
        free = sorted({root(i) for i in range(self.bodies)} - {0} - set(self.driven_bodies))
        # A body that nothing turns (the rotation of a node between hinges) is left out.
        used = set(self.link_body.tolist()) | set(self.pairs.ravel().tolist())
        self.free = np.array([i for i in free if i in used], dtype=int)
        links_, count = len(lengths), len(self.names)
        self.X = np.zeros((len(sums), links_ + count))
        for r, (terms, base) in enumerate(zip(sums, bases)):
            self.X[r, links_ + base] = 1.0
            for j, length in terms.items():
                self.X[r, j] = length

    def _stiffness(self, section: Table, member: Table, curve: _Curve, at: float) -> Array:
        if self.dim == 2:
            return np.array([[float(section["EI3"]) / self.unit]])
        if section["EI2"] != section["EI3"]:
            raise NotAChainError("sections with EI2 other than EI3")
        t = curve.tangent(at)
        along = np.outer(t, t)
        return np.asarray((section["EI3"] * (np.eye(3) - along) + section["GJ"] * along) / self.unit)

    def _party(self, who: str | None, node: str, scene: Table, bodies: dict[str, int | None]) -> int:
        if who == "ground":
            return 0
        if who is None:
            found = bodies[node]
            if found is None:
                raise NotAChainError("a spring at a joint that names no member")
            return found
        member = scene["members"][who]
        return self.member_ends[who][0 if member["nodes"][0] == node else 1]

    def _loads(self, scene: Table, curves: dict[str, _Curve]) -> None:
        """Generalised forces on directions and places, and on bodies, at factor 1."""
        links, force = len(self.lengths), self.unit / self.size**2
        self.W = np.zeros((links + len(self.names), self.dim))
        self.moments = np.zeros(self.bodies)

        def put(member: str, link: int, value: Array) -> None:
            row = self.X[self.link_rows[link]].copy()
            row[link] += 0.5 * self.lengths[link]
            self.W[:] += np.outer(row, value)

        gravity = _vector(scene.get("gravity", [0.0, 0.0]))[: self.dim]
        for name, member in scene["members"].items():
            rho = float(scene["sections"][member["section"]].get("rhoA", 0.0)) if gravity.any() else 0.0
            for link in self.link_of[name]:
                put(name, link, rho * gravity * curves[name].length / len(self.link_of[name]) / force)
        for load in scene.get("loads", {}).values():
            if load["type"] == "moment":
                body = self.node_body[load["node"]]
                if self.dim == 3 or body is None:
                    raise NotAChainError("a moment in space or at a joint")
                value = np.atleast_1d(load["value"])[-1]
                self.moments[body] += float(value) * self.size / self.unit
                continue
            value = _vector(load["value"])[: self.dim] / force
            if load["type"] == "distributed":
                own = self.link_of[load["member"]]
                for link in own:
                    put(load["member"], link, value * curves[load["member"]].length / len(own))
            else:
                self.W[links + self.names.index(load["node"])] += value
        self.strength = max(1.0, float(np.abs(self.W[links:]).sum()), float(np.abs(self.moments).sum()))

    def _held(self, scene: Table) -> None:
        """Linear constraints C z = b0 + s b1 on directions and places: closed members, supports, motions."""
        links, nodes = len(self.lengths), len(self.names)
        rows: list[Array] = []
        start: list[float] = []
        ramp: list[float] = []
        moved = {
            m["node"]: _vector(m["displacement"]) for m in scene.get("motions", {}).values() if "displacement" in m
        }

        def add(at: Array, direction: Array, b0: float, b1: float) -> None:
            rows.append(np.kron(at, direction))
            start.append(b0)
            ramp.append(b1)

        eye = np.eye(self.dim)
        for name, member in scene["members"].items():
            at = self.X[self.rows[name][-1]].copy()
            at[links + self.names.index(member["nodes"][1])] -= 1.0
            for e in eye:
                add(at, e, 0.0, 0.0)
        for k, (name, node) in enumerate(scene["nodes"].items()):
            support = node.get("support", "free")
            if support == "free":
                continue
            at = np.zeros(links + nodes)
            at[links + k] = 1.0
            across = eye
            if support == "slider":
                u = _vector(node["direction"])[: self.dim]
                across = np.linalg.svd((u / np.linalg.norm(u))[None])[2][1:]
            by = moved.get(name, np.zeros(3))[: self.dim] / self.size
            for e in across:
                add(at, e, float(e @ self.p0[k]), float(e @ by))
        self.C, self.b0, self.b1 = np.array(rows), np.array(start), np.array(ramp)

    def _stop(self, name: str, contact: Table, scene: Table) -> _Stop:
        dim, place = self.dim, _vector(contact["point" if contact["type"] == "plane" else "center"])
        normal, across = np.zeros(dim), np.eye(dim)
        if contact["type"] == "plane":
            v = _vector(contact["normal"])
            if "side" in contact and _vector(contact["side"]) @ v < 0.0:
                v = -v
            normal = v[:dim] / np.linalg.norm(v)
        elif contact["type"] == "cylinder" and dim == 3:
            a = _vector(contact["axis"]) / np.linalg.norm(contact["axis"])
            across = np.eye(3) - np.outer(a, a)
        inside = contact.get("side") == "inside"
        stop = _Stop(
            name,
            contact["type"] == "plane",
            place[:dim] / self.size,
            normal,
            across,
            float(contact.get("radius", 0.0)) / self.size,
            inside,
        )
        if "member" in contact:
            touched = [contact["member"]]
        else:
            touched = list(scene["members"]) if contact["members"] == "all" else contact["members"]
        for member in touched:
            ends = scene["members"][member]["nodes"]
            rows = self.rows[member]
            if stop.flat or inside:
                free = [scene["nodes"][k].get("support", "free") in ("free", "slider") for k in ends]
                stop.points += rows[0 if free[0] else 1 : len(rows) if free[1] else -1]
            else:
                stop.links += list(self.link_of[member])
        return stop

    # -- evaluating -------------------------------------------------------------------------------------------------

    def gaps(self, stop: _Stop, x: Array, d: Array) -> _Gaps:
        """Of all points or links that an obstacle stops; derivatives of those that are entered."""
        dim = self.dim
        if stop.flat or stop.inside:
            rows = np.array(stop.points, dtype=int)
            if stop.flat:
                g = (x[rows] - stop.place) @ stop.normal
            else:
                g = stop.radius - np.linalg.norm((x[rows] - stop.place) @ stop.across, axis=1)
            links, tau = np.full(len(rows), -1), np.zeros(len(rows))
        else:
            links = np.array(stop.links, dtype=int)
            rows = np.array(self.link_rows, dtype=int)[links]
            w, e = (stop.place - x[rows]) @ stop.across, d[links] @ stop.across
            q = np.maximum(np.einsum("ni,ni->n", e, e), 1e-12)
            free = np.einsum("ni,ni->n", w, e) / q
            tau = np.clip(free, 0.0, self.lengths[links])
            g = np.linalg.norm(w - tau[:, None] * e, axis=1) - stop.radius
        near = np.flatnonzero(g < 0.0)
        first, second = np.zeros((len(near), 2 * dim)), np.zeros((len(near), 2 * dim, 2 * dim))
        if not len(near):
            return _Gaps(g, rows, links, tau, first, second)
        if stop.flat:
            first[:, :dim] = stop.normal
            return _Gaps(g, rows, links, tau, first, second)
        P, t = stop.across, tau[near]
        w = (stop.place - x[rows[near]]) @ P
        e = d[links[near]] @ P if not stop.inside else np.zeros_like(w)
        y = w - t[:, None] * e
        first[:, :dim], first[:, dim:] = -2.0 * y, -2.0 * t[:, None] * y
        second[:, :dim, :dim] = 2.0 * P
        second[:, :dim, dim:] = 2.0 * t[:, None, None] * P
        second[:, dim:, dim:] = 2.0 * (t**2)[:, None, None] * P
        if not stop.inside:
            inner = (free[near] == t).astype(float)[:, None, None] / q[near][:, None, None]
            f = y - t[:, None] * e
            second[:, :dim, :dim] -= 2.0 * inner * np.einsum("ni,nj->nij", e, e)
            second[:, :dim, dim:] += 2.0 * inner * np.einsum("ni,nj->nij", e, f)
            second[:, dim:, dim:] += 2.0 * inner * np.einsum("ni,nj->nij", t[:, None] * e - y, f)
        second[:, dim:, :dim] = second[:, :dim, dim:].transpose(0, 2, 1)
        r = np.linalg.norm(y, axis=1)[:, None, None]
        sign = -1.0 if stop.inside else 1.0
        second = sign * (second / (2.0 * r) - np.einsum("ni,nj->nij", first, first) / (4.0 * r**3))
        first = sign * first / (2.0 * r[:, 0])
        return _Gaps(g, rows, links, tau, first, second)

    def driven(self, state: ChainState, s: float) -> ChainState:
        """The same state with the prescribed rotations of a factor."""
        if not self.driven_bodies:
            return state
        turns = state.turns.copy()
        for body, value in self.driven_bodies.items():
            by = np.atleast_1d(np.asarray(value, dtype=float)) * s
            turns[body] = self.kind.turned(self.kind.none(1), by[None, -self.dof :])[0]
        return ChainState(turns, state.p)

    def directions(self, state: ChainState) -> tuple[Array, Array]:
        """Directions of links and their derivatives."""
        return self.kind.directions(state.turns[self.link_body], self.d0)

    def points(self, state: ChainState) -> Array:
        """Places (m, dim) of all ends of links."""
        return np.asarray(self.X @ np.vstack([self.directions(state)[0], state.p]))

    def potential(self, state: ChainState, s: float, width: float, barrier: bool = False) -> float:
        """Energy of springs and loads; with the barrier infinite where an obstacle is entered by its width."""
        d = self.directions(state)[0]
        z = np.vstack([d, state.p])
        a, b = self.pairs.T
        energy = self.kind.springs(state.turns[a], state.turns[b], self.K)[0] if len(a) else 0.0
        energy -= s * float(np.sum(self.W * z))
        if self.dim == 2:
            energy -= s * float(self.moments @ state.turns[:, 0])
        if not barrier:
            return float(energy)
        x = self.X @ z
        for stop in self.stops:
            g = self.gaps(stop, x, d).g
            g = g[g < 0.0]
            if (g <= -width).any():
                return math.inf
            energy -= self.strength / width * float(np.sum(g**2 * np.log1p(g / width)))
        return float(energy)

    def pushed(self, x: Array, d: Array, grown: Array, width: float) -> tuple[Array, Array]:
        """Gradient (links + nodes, dim) and Hessian of what else pushes links, here nothing.

        ``grown`` leads from the unknowns to directions and places.
        """
        total = grown.shape[1] // self.dim
        return np.zeros((self.X.shape[1], self.dim)), np.zeros((total, total))

    def residual(self, state: ChainState, s: float) -> Array:
        """How far the constraints are from met at a factor."""
        z = np.vstack([self.directions(state)[0], state.p])
        return np.asarray(self.C @ z.ravel() - self.b0 - s * self.b1)

    def system(self, state: ChainState, s: float, width: float) -> tuple[Array, Array, Array]:
        """Gradient, Hessian of the Lagrangian and gradients of the constraints, for bodies that turn and places."""
        dim, dof, nb = self.dim, self.dof, self.bodies
        d, Jd = self.directions(state)
        z = np.vstack([d, state.p])
        links, nodes = len(d), len(state.p)
        x = self.X @ z
        gz = -s * self.W.ravel()
        total = nb * dof + nodes * dim
        J: Array = np.zeros((links + nodes, dim, total))
        for k in range(dof):
            J[np.arange(links), :, self.link_body * dof + k] = Jd[:, :, k]
        for k in range(dim):
            J[links + np.arange(nodes), k, nb * dof + np.arange(nodes) * dim + k] = 1.0
        J = J.reshape(-1, total)
        H = np.zeros((total, total))
        grown = J.reshape(links + nodes, dim * total)
        more, bent = self.pushed(x, d, grown, width)
        gz += more.ravel()
        H += bent
        for stop in self.stops:
            found = self.gaps(stop, x, d)
            near = np.flatnonzero(found.g < 0.0)
            if not len(near):
                continue
            g, kappa = found.g[near], self.strength / width
            f1 = -kappa * (2.0 * g * np.log1p(g / width) + g**2 / (width + g))
            f2 = -kappa * (2.0 * np.log1p(g / width) + 4.0 * g / (width + g) - g**2 / (width + g) ** 2)
            h = f2[:, None, None] * np.einsum("ni,nj->nij", found.first, found.first) + f1[:, None, None] * found.second
            rows, at = found.rows[near], found.links[near]
            gl = f1[:, None] * found.first
            gz += (self.X[rows].T @ gl[:, :dim]).ravel()
            T = (self.X[rows] @ grown).reshape(len(near), dim, total)
            if stop.flat or stop.inside:
                h = h[:, :dim, :dim]
            else:
                np.add.at(gz.reshape(-1, dim), at, gl[:, dim:])
                T = np.concatenate([T, J.reshape(-1, dim, total)[at]], axis=1)
            H += T.reshape(-1, total).T @ (h @ T).reshape(-1, total)
        g = J.T @ gz
        if dim == 2:
            g[:nb] -= s * self.moments
        a, b = self.pairs.T
        if len(a):
            _, m, aa, ab, bb = self.kind.springs(state.turns[a], state.turns[b], self.K)
            blocks = H[: nb * dof, : nb * dof].reshape(nb, dof, nb, dof)
            for i, j, block in ((a, a, aa), (b, b, bb), (a, b, ab), (b, a, ab.transpose(0, 2, 1))):
                np.add.at(blocks.transpose(0, 2, 1, 3), (i, j), block)
            parts = g[: nb * dof].reshape(nb, dof)
            np.add.at(parts, b, m)
            np.add.at(parts, a, -m)
        kept = np.concatenate([(self.free[:, None] * dof + np.arange(dof)).ravel(), nb * dof + np.arange(nodes * dim)])
        A = (self.C @ J)[:, kept]
        multipliers = np.linalg.lstsq(A.T, -g[kept], rcond=1e-10)[0]
        pull = (gz + self.C.T @ multipliers).reshape(-1, dim)[:links]
        local = self.kind.bent(d, pull)
        blocks = H[: nb * dof, : nb * dof].reshape(nb, dof, nb, dof).transpose(0, 2, 1, 3)
        np.add.at(blocks, (self.link_body, self.link_body), local)
        return g[kept], H[np.ix_(kept, kept)], A

    def moved(self, state: ChainState, step: Array, s: float, pinv: Array) -> ChainState | None:
        """The state after a step, back on the constraints; None where they cannot be met."""
        for _ in range(12):
            count = len(self.free) * self.dof
            turns = state.turns.copy()
            turns[self.free] = self.kind.turned(turns[self.free], step[:count].reshape(-1, self.dof))
            state = ChainState(turns, state.p + step[count:].reshape(-1, self.dim))
            c = self.residual(state, s)
            if np.abs(c).max(initial=0.0) < 1e-12:
                return state
            step = -pinv @ c
        return state if np.abs(c).max(initial=0.0) < 1e-9 else None

    def shapes(self, state: ChainState) -> dict[str, Array]:
        """Places (5, dim) at the quarters of each member."""
        x = self.points(state)
        found = {}
        for name, rows in self.rows.items():
            at = np.array(QUARTERS) * (len(rows) - 1)
            low = np.minimum(at.astype(int), len(rows) - 2)
            part = (at - low)[:, None]
            found[name] = (1.0 - part) * x[np.array(rows)[low]] + part * x[np.array(rows)[low + 1]]
        return found

    def touches(self, state: ChainState, width: float) -> dict[str, list[tuple[str, float, float]]]:
        """Member, fraction and force of each place that an obstacle pushes."""
        out = {}
        d = self.directions(state)[0]
        x = self.X @ np.vstack([d, state.p])
        owners = {r: (name, i / (len(rows) - 1)) for name, rows in self.rows.items() for i, r in enumerate(rows)}
        for stop in self.stops:
            found = self.gaps(stop, x, d)
            listed = []
            for i in np.flatnonzero(found.g < 0.0):
                g = found.g[i]
                force = self.strength / width * (2.0 * g * np.log1p(g / width) + g**2 / (width + g))
                name, at = owners[int(found.rows[i])]
                count = len(self.rows[name]) - 1
                if found.links[i] >= 0:
                    at += found.along[i] / self.lengths[found.links[i]] / count
                listed.append((name, float(at), float(force) * self.unit / self.size**2))
            if listed:
                out[stop.name] = listed
        return out

    def travel(self, state: ChainState, step: Array) -> float:
        """How far the ends of links go in a step, about."""
        count = len(self.free) * self.dof
        _, Jd = self.directions(state)
        by = np.zeros((self.bodies, self.dof))
        by[self.free] = step[:count].reshape(-1, self.dof)
        change = np.vstack([np.einsum("nik,nk->ni", Jd, by[self.link_body]), step[count:].reshape(-1, self.dim)])
        return float(np.abs(self.X @ change).max())


# -- reading -------------------------------------------------------------------------------------------------------


def _vector(value: Sequence[float]) -> Array:
    return np.array([*value, 0.0][:3] if len(value) == 2 else value, dtype=float)


class _Curve:
    """The undeformed line of a member: straight or an arc."""

    def __init__(self, member: Table, first: Array, last: Array) -> None:
        shape = member.get("shape", {"type": "straight"})
        self.first, self.chord = first, last - first
        self.angle = float(shape.get("angle", 0.0)) if shape["type"] == "arc" else 0.0
        if shape["type"] not in ("straight", "arc") or (self.angle and member.get("type") == "rigid"):
            raise NotAChainError(f"shape {shape['type']}")
        self.normal = _vector(shape.get("normal", [0.0, 0.0, 1.0]))
        self.normal = self.normal / np.linalg.norm(self.normal)
        span, half = float(np.linalg.norm(self.chord)), 0.5 * self.angle
        self.length = span * half / math.sin(half) if self.angle else span

    def _rotated(self, angle: float) -> Array:
        return np.asarray(math.cos(angle) * self.chord + math.sin(angle) * np.cross(self.normal, self.chord))

    def tangent(self, t: float) -> Array:
        """Unit tangent at a fraction of the length."""
        turned = self._rotated(self.angle * (t - 0.5))
        return np.asarray(turned / np.linalg.norm(turned))

    def at(self, t: float) -> Array:
        """Place at a fraction of the length."""
        if not self.angle:
            return self.first + t * self.chord
        part = math.sin(0.5 * self.angle * t) / math.sin(0.5 * self.angle)
        return self.first + part * self._rotated(0.5 * self.angle * (t - 1.0))


KNOWN = {
    "nodes": {"position", "support", "joint", "direction", "rotation"},
    "members": {"nodes", "section", "type", "shape", "release"},
    "sections": {"EI2", "EI3", "GJ", "rhoA"},
    "springs": {"type", "node", "stiffness", "between"},
    "loads": {"type", "node", "member", "value"},
    "motions": {"node", "displacement", "rotation"},
    "contacts": {"type", "member", "members", "point", "normal", "side", "center", "radius", "axis"},
}
"""What is read of a scene; anything else is refused."""


def _known(scene: Table) -> None:
    other = set(scene) - set(KNOWN) - {"title", "dimension", "gravity", "analysis", "expect", "source"}
    for kind, keys in KNOWN.items():
        for item in scene.get(kind, {}).values():
            other |= {f"{kind}.{key}" for key in set(item) - keys}
    springs = [s for s in scene.get("springs", {}).values() if s["type"] != "rotational"]
    small = [m for m in scene["members"].values() if m.get("type", "flexible") == "small"]
    loads = [x for x in scene.get("loads", {}).values() if x["type"] != "distributed" and "node" not in x]
    stops = [c for c in scene.get("contacts", {}).values() if c["type"] in ("point", "line")]
    if in_space(scene):
        nodes = scene["nodes"].values()
        other |= {n["joint"] for n in nodes if n.get("joint", "rigid") not in ("rigid", "ball")}
        held = [n for n in nodes if n.get("support") != "slider" or n.get("rotation", "fixed") != "fixed"]
        other |= {n["support"] for n in held if n.get("support", "free") not in ("free", "clamped", "ball")}
        other |= set(scene.get("springs", {}))
    if other or springs or small or loads or stops:
        raise NotAChainError(f"not known here: {sorted(other) or (springs + small + loads + stops)[0]}")


def in_space(scene: Table) -> bool:
    """Whether a scene is one of space: by its word, or a node out of the plane."""
    out = any(_vector(node["position"])[2] != 0.0 for node in scene["nodes"].values())
    return out or bool(scene.get("dimension", "plane") == "space")


def member_points(scene: Table, count: int) -> Array:
    """Places (n, 3) along all undeformed members, m."""
    found = []
    for member in scene["members"].values():
        curve = _Curve(member, *(_vector(scene["nodes"][k]["position"]) for k in member["nodes"]))
        found += [curve.at(i / count) for i in range(count + 1)]
    return np.array(found)
