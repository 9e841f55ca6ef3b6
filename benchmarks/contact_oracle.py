"""Contact by another way: chains of rigid links, followed from zero load by descent.  Nothing of the solver is used.

A flexible member is N rigid links with rotational springs EI/h between them (2 EI/h against the nodes); obstacles act
on the links as segments by a stiff barrier that nothing can pass: steps are shorter than obstacles, and a step into
the barrier's end is shortened.  Loads grow from zero together; after every increment the energy is minimised from the
last state.  Where an increment, however small, moves the state by much, it has lost stability: descent leads on to the
next stable state and the answer says so.  N and 2 N links together estimate the error.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sfetcas.mathematics.arrays import Array
from sfetcas.mathematics.threads import single_threaded

from .contact_chain import Chain, ChainState, NotAChainError, in_space

__all__ = ["NARROW", "WIDTHS", "ChainAnswer", "chain_contact", "emerged", "followed", "free_way", "settled"]

Table = dict[str, Any]

LINKS = {2: 20, 3: 12}
"""Links of a flexible member in the coarser of the two chains, in the plane and in space."""

WIDTHS, NARROW = (2e-3, 5e-4, 1.2e-4, 3e-5), (1.2e-4, 3e-5)
"""Depths over the scene's size by which obstacles can be entered: on the way, and narrower ones at its end; those for
scenes near to a limit load, which shifts by ten times the depth.
"""

FIRST_STEP, LAST_STEP = 1.0 / 24.0, 3e-4
"""Increments of the factor: at first, and the smallest, at which a state that still moves far has snapped."""

FAR, FAR_UNSTABLE = 0.08, 0.02
"""Motions over the size in one increment beyond which the increment is halved: of all, and of those that pass where
the energy is not convex.  The smallest increment moving by more than the second is a snap."""

CAP = 0.03
"""Motion over the size in one step of descent at most; also a third of the smallest radius."""

ITERATIONS = 400
"""Steps of one descent."""


@dataclass(frozen=True)
class ChainAnswer:
    """What a chain of links finds at factor 1.

    Attributes
    ----------
    nodes : dict of str to ndarray (3,)
        Positions, m, extrapolated from N and 2 N links.
    members : dict of str to ndarray (5, 3)
        Places at QUARTERS of the length, of rigid members too, m.
    error : float
        Largest difference of these places between N and 2 N links, m.
    size : float
        Largest distance of two nodes, or half of the longest member's length, m.
    energy : float
        Elastic and of the loads, the latter zero in the undeformed state, of 2 N links, J.
    touches : dict of str to list of (str, float, float)
        Of each obstacle that is touched: member, fraction of its length, force in N; of 2 N links.
    snaps : tuple of float
        Factors at which stability was lost, of 2 N links.
    agree : bool
        N and 2 N links end within a fiftieth of the size of each other.
    """

    nodes: dict[str, Array]
    members: dict[str, Array]
    error: float
    size: float
    energy: float
    touches: dict[str, list[tuple[str, float, float]]]
    snaps: tuple[float, ...]
    agree: bool

    @property
    def snapped(self) -> bool:
        """Whether stability was lost on the way."""
        return bool(self.snaps)


@single_threaded
def chain_contact(scene: Table, links: int | None = None, widths: Sequence[float] = WIDTHS) -> ChainAnswer:
    """Follow the loads of a scene, a dictionary as in its file, from zero to factor 1.

    Parameters
    ----------
    scene : dict
        Plane or space; straight members and arcs, flexible and rigid; rigid, hinge and ball joints; supports
        clamped, hinge, ball and slider; rotational springs without rest in the plane; forces, distributed loads and
        gravity, moments in the plane, prescribed motions; planes, circles, spheres and cylinders.
    links : int, optional
        N, of a flexible member.
    widths : sequence of float
        As ``WIDTHS``.

    Raises
    ------
    NotAChainError
        What is not known here.
    """
    links = links or LINKS[3 if in_space(scene) else 2]
    coarse, fine = Chain(scene, links), Chain(scene, 2 * links)
    first, _ = followed(coarse, widths)
    second, snaps = followed(fine, widths)
    size = fine.size
    one, two = coarse.shapes(first), fine.shapes(second)
    error = max(float(np.linalg.norm(one[name] - two[name], axis=1).max()) for name in two)
    places = {name: size * (two[name] + (two[name] - one[name]) / 3.0) for name in two}
    places = {name: np.pad(p, ((0, 0), (0, 3 - fine.dim))) for name, p in places.items()}
    ends = {node: (name, i) for name, m in scene["members"].items() for node, i in zip(m["nodes"], (0, -1))}
    energy = fine.potential(second, 1.0, widths[-1]) - fine.potential(fine.start(), 1.0, widths[-1])
    return ChainAnswer(
        {node: places[ends[node][0]][ends[node][1]] for node in fine.names},
        places,
        size * error,
        size,
        energy * fine.unit / size,
        fine.touches(second, widths[-1]),
        tuple(snaps),
        error < 0.02,
    )


@single_threaded
def free_way(scene: Table, links: int = 8) -> Array:
    """Places (n, 3), m, that a chain passes from zero to factor 1 where no obstacle stops it.

    Raises
    ------
    NotAChainError
        What is not known here.
    """
    chain, seen = Chain({**scene, "contacts": {}}, links), list[Array]()
    followed(chain, seen=seen)
    return np.pad(chain.size * np.vstack(seen), ((0, 0), (0, 3 - chain.dim)))


def followed(
    chain: Chain, widths: Sequence[float] = WIDTHS, seen: list[Array] | None = None
) -> tuple[ChainState, list[float]]:
    """From zero to factor 1: the state there, and factors at which it snapped."""
    state, s, step, snaps = chain.start(), 0.0, FIRST_STEP, []
    width = widths[0]
    while s < 1.0:
        step = min(step, 1.0 - s, chain.longest)
        last = step <= LAST_STEP
        tried, count, unstable = settled(chain, state, s + step, width, last)
        far = math.inf
        if tried is not None:
            far = float(np.abs(chain.points(tried) - chain.points(state)).max())
        if (tried is None or far > (FAR_UNSTABLE if unstable else FAR)) and not last:
            step = max(0.25 * step if tried is None else 0.5 * step, LAST_STEP)
            continue
        if tried is None:
            raise NotAChainError(f"no state found at factor {s + step:.6g}")
        s += step
        if last and far > FAR_UNSTABLE:
            snaps.append(s)
            step = FIRST_STEP / 8.0
        elif count < 12 and far < 0.5 * FAR:
            step = min(2.0 * step, 2.0 * FIRST_STEP)
        state = tried
        if seen is not None:
            seen.append(chain.points(state))
    before = chain.points(state)
    for wider, width in itertools.pairwise(widths):
        narrower = emerged(chain, state, wider, width)
        found = settled(chain, narrower, 1.0, width, True)[0]
        if found is None:
            raise NotAChainError("no state found for the narrowest obstacles")
        state = found
    if np.abs(chain.points(state) - before).max() > FAR_UNSTABLE:
        snaps.append(1.0)
    return state, snaps


def emerged(chain: Chain, state: ChainState, before: float, width: float) -> ChainState:
    """The same state, where it is deeper in obstacles than their new width allows pushed out by a harder barrier."""
    own = chain.strength
    try:
        for _ in range(12):
            if math.isfinite(chain.potential(state, 1.0, width, True)):
                return state
            chain.strength *= 8.0
            found = settled(chain, state, 1.0, before, True)[0]
            if found is None:
                break
            state = found
    finally:
        chain.strength = own
    raise NotAChainError("no state found for narrower obstacles")


def settled(
    chain: Chain, state: ChainState, s: float, width: float, patient: bool
) -> tuple[ChainState | None, int, bool]:
    """Descent of the energy at a factor: the state (None without), the steps, whether it passed what is not convex.

    Without patience it gives up where something hard shows.
    """
    state = chain.driven(state, s)
    energy = chain.potential(state, s, width, True)
    unstable = False
    kicks = concave = 0
    limit = ITERATIONS if patient else 25
    for count in range(limit):
        g, H, A = chain.system(state, s, width)
        m = len(A)
        Q, _ = np.linalg.qr(A.T, mode="complete")
        Z = Q[:, m:]
        c = chain.residual(state, s)
        pinv = np.linalg.pinv(A, rcond=1e-10)
        normal = np.zeros(len(g))
        if np.abs(c).max(initial=0.0) > 1e-11:
            normal = -pinv @ c
        gr = Z.T @ (g + H @ normal)
        Hr = Z.T @ H @ Z
        Hr = 0.5 * (Hr + Hr.T)
        small = np.abs(gr).max(initial=0.0) < 1e-8 * chain.strength and not normal.any()
        try:
            L = np.linalg.cholesky(Hr)
            step = -np.linalg.solve(L.T, np.linalg.solve(L, gr))
            convex = True
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(Hr)
            convex = bool(values[0] > -1e-6)
            if not convex:
                unstable = True
                concave += 1
                if concave > 2 and not patient:
                    return None, count, True
            step = -vectors @ ((vectors.T @ gr) / np.maximum(np.abs(values), 1e-3))
            if small and not convex:
                kicks += 1
                if kicks > 5 or not patient:
                    return None, count, True
                pushed = []
                for way in (1e-3, -1e-3):
                    new = chain.moved(state, way * (Z @ vectors[:, 0]), s, pinv)
                    if new is not None:
                        pushed.append((chain.potential(new, s, width, True), way, new))
                pushed = [p for p in pushed if math.isfinite(p[0])]
                if not pushed:
                    return None, count, True
                energy, _, state = min(pushed, key=lambda p: p[0])
                continue
        if small and convex:
            return state, count, unstable
        full = normal + Z @ step
        turned = np.abs(full[: len(chain.free) * chain.dof]).max(initial=0.0)
        J = chain.travel(state, full)
        scale = min(1.0, 0.4 / max(turned, 1e-300), min(CAP, chain.thin / 3.0) / max(J, 1e-300))
        slope = float(gr @ step)
        accepted = None
        for _ in range(8 if normal.any() else 40):
            new = chain.moved(state, scale * full, s, pinv)
            if new is not None:
                value = chain.potential(new, s, width, True)
                if math.isfinite(value) and (
                    normal.any() or value <= energy + 1e-4 * scale * slope + 1e-13 * (1.0 + abs(energy))
                ):
                    accepted = (new, value)
                    break
            scale *= 0.5
        if accepted is None:
            if np.abs(gr).max(initial=0.0) < 1e-5 * chain.strength and convex and not normal.any():
                return state, count, unstable
            return None, count, unstable
        state, energy = accepted
    return None, limit, unstable
