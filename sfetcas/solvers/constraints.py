"""Before anything is solved: what a structure is free to do, and what its joints hold twice.

*Mobility* is the number of motions that strain nothing and that closings, joints and supports allow; at the
undeformed scene they are the null space of the elastic stiffness on the closings.  *Redundant* rows are
combinations of closings and joints that no rotation or displacement changes: their multipliers are not unique.
Both are found by inverse iteration with the sparse matrix of the equations, so the effort grows with the scene as
that of a solve does.

Source: Maxwell 1864 and Calladine 1978 (counting), here by rank; theory of mechanisms calls it mobility.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import tolerances
from ..description.records import enumerated
from ..description.supports import along, upwards
from ..mathematics.arrays import Array, first_of_largest
from ..mathematics.linear import SparseMap, blurred
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .newton import Iterate, moving, newton
from .redundancy import loose_rows, rows_in

__all__ = ["Diagnosis", "contradiction", "diagnose", "free_motions", "in_words", "moves_nodes"]

MOST = 40
"""Free motions looked for at most: a chain of as many links without any spring."""

ITERATIONS = 4
"""Inverse iterations: each gains the ratio of the softest stiffness to the shift, seven digits."""

SHARE = 0.05
"""A member takes part in a motion when it turns by this share of the largest rotation."""


@dataclass(frozen=True)
class Diagnosis:
    """What the joints leave free and what they hold twice, in the undeformed scene.

    Attributes
    ----------
    mobility : int
        Independent motions that strain nothing.
    motions : tuple of str
        Each in words.
    redundant : tuple of str
        Names of the closings and joints that take part in redundant combinations.
    excess : int
        Number of redundant combinations.
    drifts : tuple of tuple of float
        Directions in which all nodes may move alike.
    """

    mobility: int
    motions: tuple[str, ...]
    redundant: tuple[str, ...]
    excess: int
    drifts: tuple[tuple[float, ...], ...] = ()

    @property
    def sentence(self) -> str:
        """One sentence for a report."""
        least = " or more" if self.mobility == MOST else ""
        free = f"mobility {self.mobility}{least}" + (f": {self.told(4)}" if self.motions else "")
        if not self.excess:
            return free
        held = ", ".join(dict.fromkeys(self.redundant))
        return f"{free}; {self.excess} redundant among {held}"

    def told(self, most: int) -> str:
        """The motions in words, each sentence once; how many are left out."""
        said = list(dict.fromkeys(self.motions))[:most]
        more = len(self.motions) - sum(motion in said for motion in self.motions)
        return "; ".join([*said, *([f"and {more} more"] if more else [])])


def diagnose(equations: Equations, motions: Array) -> Diagnosis:
    """Mobility and redundancy of a model at its undeformed state, from its :func:`free_motions` there."""
    state = _undeformed(equations)
    loose = loose_rows(equations, equations.at(state, equations.model.loading(0.0, 0.0)))
    names = tuple(equations.row_names[row] for row in rows_in(loose))
    words = tuple(in_words(equations, motion) for motion in motions.T)
    found = [_alike(_node_travels(equations, motion)) for motion in motions.T]
    drifts = tuple(tuple(direction.tolist()) for direction in found if direction is not None)
    return Diagnosis(motions.shape[1], words, names, loose.shape[1] if loose.size else 0, drifts)


def _undeformed(equations: Equations) -> State:
    return equations.start(equations.model.loading(0.0, 0.0))


def free_motions(equations: Equations, weight: Array, state: State) -> Array:
    """Motions that strain nothing at an unstrained state: columns (unknowns, n), each with one unknown of its own."""
    n, rotation_unknowns = equations.unknowns, equations.rotation_unknowns
    if n == 0:
        return np.zeros((0, 0))
    point = equations.at(state, equations.model.loading(0.0, 0.0))
    stiffness = point.entries
    metric = np.concatenate(
        [weight, np.full(n - rotation_unknowns, float(weight.mean()) if rotation_unknowns else 1.0)]
    )
    equations.solver.factor(equations.regularised(stiffness, 0.01 * tolerances.NEUTRAL * metric, tolerances.DUAL))
    chosen = (equations.row < n) & (equations.column < n)
    row, column = equations.row[chosen], equations.column[chosen]
    count = min(4, n)
    while True:
        values, vectors = _lowest(equations, stiffness, metric, count)
        free = vectors[:, values < tolerances.NEUTRAL + blurred(row, column, stiffness[chosen], vectors)]
        if free.shape[1] < count or count >= min(n, MOST):
            return _told_apart(free)
        count = min(4 * count, n, MOST)


def _lowest(equations: Equations, stiffness: Array, metric: Array, count: int) -> tuple[Array, Array]:
    """Lowest eigenvalues of the stiffness on the closings against the metric, and their motions."""
    n, root = equations.unknowns, np.sqrt(metric)[:, None]
    block = np.random.default_rng(1).standard_normal((n, count))
    loads = np.zeros((equations.total, count))
    for _ in range(ITERATIONS):
        loads[:n] = root * block
        block = np.linalg.qr(root * equations.solver.solve(loads)[:n])[0]
    motions = block / root
    chosen = equations.column < n
    matrix = SparseMap(equations.row[chosen], equations.column[chosen], stiffness[chosen], (equations.total, n))
    products, gaps = np.split(matrix @ motions, [n])
    # What opens a closing is no motion.
    values, turn = np.linalg.eigh(motions.T @ products + gaps.T @ gaps)
    return values, motions @ turn


def _told_apart(motions: Array) -> Array:
    """The same space with a basis in which each motion has an unknown that the others leave alone."""
    basis = motions.copy()
    for i in range(basis.shape[1]):
        # Of unknowns that move alike the first is taken, whatever rounding makes of them.
        row = first_of_largest(np.abs(basis[:, i:]).max(axis=1))
        pivot = i + first_of_largest(basis[row, i:])
        basis[:, [i, pivot]] = basis[:, [pivot, i]]
        basis[:, i] /= basis[row, i]
        others = np.arange(basis.shape[1]) != i
        basis[:, others] -= np.outer(basis[:, i], basis[row, others])
    peak = np.abs(basis).max(axis=0, initial=0.0)
    return np.where(np.abs(basis) > tolerances.NEGLIGIBLE * peak, basis, 0.0)


def in_words(equations: Equations, motion: Array) -> str:
    """Which members turn, and which slide along their nodes, and which nodes move, in a motion."""
    model = equations.model
    motion = np.where(np.abs(motion) > tolerances.NEGLIGIBLE * np.abs(motion).max(initial=0.0), motion, 0.0)
    turned = np.where(equations.number >= 0, motion[equations.number], 0.0)
    sizes = np.linalg.norm(turned, axis=1)
    by_member = {name: float(sizes[list(ends)].max()) for name, ends in model.rotations.ends.items()}
    largest = max(by_member.values(), default=0.0)
    turning = [name for name, size in by_member.items() if size > SHARE * largest > 0.0]
    places = _travels(equations, motion, _undeformed(equations))
    travels, least = places[: len(model.nodes)], tolerances.NEGLIGIBLE * max(largest, 1.0)
    moved = np.linalg.norm(travels, axis=1) > least
    moving = [name for name, moves in zip(model.nodes, moved, strict=True) if moves]
    slid = _slid(equations, places)
    sliding = [name for name, travel in slid.items() if np.linalg.norm(travel) > least]
    words = [f"{enumerated(turning, 'member')} turning"] if turning else []
    words += (
        [f"{enumerated(sliding, 'member')} sliding{_together(np.array([slid[n] for n in sliding]))}"] if sliding else []
    )
    words += [f"{enumerated(moving, 'node')} moving{_together(travels[moved])}"] if moving else []
    return " with ".join(words) or "a rotation that nothing is joined to"


def _slid(equations: Equations, travels: Array) -> dict[str, Array]:
    """How far the end of each member that slides along its node travels from it, the first end of two."""
    model = equations.model
    found: dict[str, Array] = {}
    for (name, i), place in model.segments.ends.items():
        node = model.scene.members[name].nodes[i]
        if place != node:
            found.setdefault(name, travels[model.segments.place(place)] - travels[model.segments.place(node)])
    return found


def _alike(travels: Array) -> Array | None:
    """The direction of nodes that travel alike, its largest component above zero; None of others."""
    size = float(np.linalg.norm(travels[0]))
    if np.abs(travels - travels[0]).max() > tolerances.PARALLEL * size or size < tolerances.PARALLEL:
        return None
    direction = np.where(np.abs(travels[0]) > tolerances.PARALLEL * size, travels[0] / size, 0.0)
    return upwards(direction)


def _together(travels: Array) -> str:
    """The direction in words, where all travel alike."""
    direction = _alike(travels)
    return "" if direction is None else f" along {along(direction)}"


def _node_travels(equations: Equations, motion: Array, state: State | None = None) -> Array:
    """Where each node travels per unit of a motion (nodes, axes), by a small step both ways."""
    state = _undeformed(equations) if state is None else state
    return _travels(equations, motion, state)[: len(equations.model.nodes)]


def _travels(equations: Equations, motion: Array, state: State) -> Array:
    """The same of all places, the nodes first."""
    loading = equations.model.loading(0.0, 0.0)
    step = np.zeros(equations.total)
    step[: equations.unknowns] = STEP * motion
    ahead, behind = (equations.places(equations.moved(state, sign * step), loading) for sign in (1.0, -1.0))
    travel = (ahead - behind) / (2.0 * STEP)
    return np.asarray(travel.reshape(-1, equations.model.element.axes))


STEP = 1e-5
"""Step of the central difference: 1e-10 of the motion is left out."""


STUCK = 0.01
"""Share of the gaps that an unknown takes away, to first order, where they are still said to be stuck."""

DAMPED = 40
"""Steps towards the smallest gaps."""


def contradiction(equations: Equations, state: State, loading: Loading) -> str:
    """Which motions ask for what closings and joints do not give, in words; empty where that cannot be told.

    From a state on, the gaps are made as small as can be.  What is left is a combination of rows that no unknown
    changes to first order: the motions that change it contradict each other, or the rows of the combination.
    """
    if not equations.model.scene.motions or not equations.rows:
        return ""
    state, gaps, slope = _nearest(equations, state, loading)
    size = float(np.linalg.norm(gaps))
    if not tolerances.CLOSED < size < np.inf or slope > STUCK * size:
        return ""
    stuck = gaps / size
    changes = {name: float(stuck @ _asked(equations, state, loading, name)) for name in equations.model.scene.motions}
    largest = max(map(abs, changes.values()), default=0.0)
    asking = [f"motions.{name}" for name, change in changes.items() if abs(change) > SHARE * largest > 0.0]
    if not asking:
        return ""
    shares = np.abs(stuck)
    names = [equations.row_names[i] for i in np.flatnonzero(shares > SHARE * shares.max())]
    against = [name for name in dict.fromkeys(names) if name not in asking]
    found = "contradict each other" if len(asking) > 1 else "asks for more than there is"
    return f"{' and '.join(asking)} {found}" + (f" in {', '.join(against[:4])}" if against else "")


def _nearest(equations: Equations, state: State, loading: Loading) -> tuple[State, Array, float]:
    """A state with the smallest gaps near one, by Levenberg and Marquardt, and the largest slope of their square."""
    n, soft = equations.unknowns, 1e-2

    def at(state: State) -> Point:
        return equations.at(state, loading)

    def step(here: Iterate) -> Array:
        primal, gaps = np.full(n, soft), here.point.residual[n:]
        equations.solver.factor(equations.regularised(equations.of_rows(here.point.entries), primal, 1.0))
        step = equations.solver.solve(np.concatenate([np.zeros(n), -gaps]))
        step[n:] = 0.0
        return step

    def after(here: Iterate, step: Array) -> Iterate:
        nonlocal soft
        there = moving(equations, at)(here, step)
        nearer = np.linalg.norm(there.point.residual[n:]) < np.linalg.norm(here.point.residual[n:])
        soft *= 0.3 if nearer else 10.0
        return there if nearer else here

    state = equations.holding(state, loading)
    here, _ = newton(Iterate(state, at(state)), step, after, lambda here: False, DAMPED)
    chosen = (equations.row >= n) & (equations.column < n)
    slope, gaps = np.zeros(n), here.point.residual[n:]
    np.add.at(slope, equations.column[chosen], here.point.entries[chosen] * gaps[equations.row[chosen] - n])
    return here.state, gaps, float(np.abs(slope).max(initial=0.0))


def _asked(equations: Equations, state: State, loading: Loading, name: str) -> Array:
    """Derivative of the rows by a motion, what it holds carried along."""
    motion = equations.model.motion(name).scaled(STEP)
    ahead, behind = (loading.plus(motion.scaled(sign)) for sign in (1.0, -1.0))
    rows = [equations.at(equations.holding(state, at), at).residual[equations.unknowns :] for at in (ahead, behind)]
    return np.asarray(rows[0] - rows[1]) / (2.0 * STEP)


def moves_nodes(equations: Equations, motion: Array, state: State) -> bool:
    """Whether a motion moves any node, or in the plane turns any member: a spin about its own axis does not."""
    if not equations.model.space and np.abs(motion[: equations.rotation_unknowns]).max(initial=0.0) > 0.0:
        return True
    return bool(
        np.abs(_node_travels(equations, motion, state)).max(initial=0.0)
        > tolerances.NEGLIGIBLE * np.abs(motion).max(initial=1.0)
    )
