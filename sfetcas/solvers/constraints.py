"""Constraint analysis before anything is solved: free motions and redundant constraints.

*Mobility* is the number of independent motions that strain nothing and that closings, joints and supports allow: the
null space of the elastic stiffness of the undeformed scene on the closings.  *Redundant* rows are combinations of
closings and joints that no rotation or displacement changes: their multipliers are not unique.  Both are found by
inverse iteration with the sparse matrix of the equations, so the effort grows with the scene as that of a solve does.

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
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from .newton import Iterate, Moving, newton
from .redundancy import loose_rows, rows_in

__all__ = ["Diagnosis", "contradiction", "diagnose", "free_motions", "in_words", "moves_nodes"]

MOST = 40
"""Largest number of free motions that is counted: that of a chain of as many links without any spring."""

ITERATIONS = 4
"""Inverse iterations: the error falls in each by the ratio of the shift to the softest stiffness, seven digits."""

SHARE = 0.05
"""Share of the largest rotation from which a member is named in a motion; likewise for rows that contradict."""


@dataclass(frozen=True)
class Diagnosis:
    """Free motions and redundant constraints of the undeformed scene.

    Attributes
    ----------
    mobility : int
        Number of independent motions that strain nothing.
    motions : tuple of str
        Each of them in words.
    redundant : tuple of str
        Names of the rows that take part in redundant combinations.
    excess : int
        Number of redundant combinations.
    drifts : tuple of tuple of float
        Unit vectors of the free motions in which all nodes move alike, along the fixed axes.
    """

    mobility: int
    motions: tuple[str, ...]
    redundant: tuple[str, ...]
    excess: int
    drifts: tuple[tuple[float, ...], ...] = ()

    @property
    def sentence(self) -> str:
        """Mobility and redundancy in one sentence for a report."""
        least = " or more" if self.mobility == MOST else ""
        free = f"mobility {self.mobility}{least}" + (f": {self.described(4)}" if self.motions else "")
        if not self.excess:
            return free
        redundant = ", ".join(dict.fromkeys(self.redundant))
        return f"{free}; {self.excess} redundant among {redundant}"

    def described(self, most: int) -> str:
        """Up to ``most`` motions in words, each sentence once, and how many more there are."""
        said = list(dict.fromkeys(self.motions))[:most]
        more = len(self.motions) - sum(motion in said for motion in self.motions)
        return "; ".join([*said, *([f"and {more} more"] if more else [])])


def diagnose(equations: Equations, motions: Array) -> Diagnosis:
    """Mobility and redundancy of a model in its undeformed state, from its :func:`free_motions` (unknowns, n) there."""
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
    """Motions that strain nothing at an unstrained state, columns (unknowns, n), dimensionless.

    Each has one unknown that is 1 in it and 0 in the others.  ``weight`` is that of the rotation unknowns.
    """
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
    """Lowest eigenvalues (count,) of the stiffness on the closings by the metric, and motions (unknowns, count)."""
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
    # The squared gaps count as stiffness: a vector that opens a closing is no free motion.
    values, turn = np.linalg.eigh(motions.T @ products + gaps.T @ gaps)
    return values, motions @ turn


def _told_apart(motions: Array) -> Array:
    """A basis of the same space in which each motion has an unknown that is 1 in it and 0 in the others."""
    basis = motions.copy()
    for i in range(basis.shape[1]):
        # Of unknowns that move equally, but for rounding, the first is taken.
        row = first_of_largest(np.abs(basis[:, i:]).max(axis=1))
        pivot = i + first_of_largest(basis[row, i:])
        basis[:, [i, pivot]] = basis[:, [pivot, i]]
        basis[:, i] /= basis[row, i]
        others = np.arange(basis.shape[1]) != i
        basis[:, others] -= np.outer(basis[:, i], basis[row, others])
    peak = np.abs(basis).max(axis=0, initial=0.0)
    return np.where(np.abs(basis) > tolerances.NEGLIGIBLE * peak, basis, 0.0)


def in_words(equations: Equations, motion: Array) -> str:
    """Words for a motion (unknowns,) of any scale: members that rotate or slide along nodes, and nodes that move."""
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
    """For each member with an end that slides along its node the travel (axes,) of the first such end from it."""
    model = equations.model
    found: dict[str, Array] = {}
    for (name, i), place in model.segments.ends.items():
        node = model.scene.members[name].nodes[i]
        if place != node:
            found.setdefault(name, travels[model.segments.place(place)] - travels[model.segments.place(node)])
    return found


def _alike(travels: Array) -> Array | None:
    """Unit vector (axes,) of travels (nodes, axes) that are all equal, largest component above zero; else None."""
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
    """Derivative of the displacements of nodes by the amplitude of a motion, (nodes, axes), by central differences."""
    state = _undeformed(equations) if state is None else state
    return _travels(equations, motion, state)[: len(equations.model.nodes)]


def _travels(equations: Equations, motion: Array, state: State) -> Array:
    """Derivative of the displacements of all places, (places, axes), nodes first, by the amplitude of a motion."""
    loading = equations.model.loading(0.0, 0.0)
    step = np.zeros(equations.total)
    step[: equations.unknowns] = STEP * motion
    ahead, behind = (equations.places(equations.moved(state, sign * step), loading) for sign in (1.0, -1.0))
    travel = (ahead - behind) / (2.0 * STEP)
    return np.asarray(travel.reshape(-1, equations.model.element.axes))


STEP = 1e-5
"""Amplitude of a motion in central differences: their error is 1e-10 of the derivative."""


STUCK = 0.01
"""Largest gradient of half the squared gaps, over their size, at which they count as least: no unknown closes them."""

DAMPED = 40
"""Largest number of Levenberg-Marquardt steps towards the smallest gaps."""


def contradiction(equations: Equations, state: State, loading: Loading) -> str:
    """Message naming prescribed motions that closings and joints do not allow; empty if that cannot be decided.

    From the state on the norm of the gaps is minimised.  If they do not vanish they form a combination of rows that no
    unknown changes to first order: the motions that change it contradict each other, or the rows of the combination.
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
    """A state near one with the least norm of gaps, by Levenberg-Marquardt; gaps (rows,); their largest gradient."""
    n, soft, moving = equations.unknowns, 1e-2, Moving(equations, loading)

    def step(here: Iterate) -> Array:
        primal, gaps = np.full(n, soft), here.point.residual[n:]
        equations.solver.factor(equations.regularised(equations.of_rows(here.point.entries), primal, 1.0))
        step = equations.solver.solve(np.concatenate([np.zeros(n), -gaps]))
        step[n:] = 0.0
        return step

    def after(here: Iterate, step: Array) -> Iterate:
        nonlocal soft
        there = moving(here, step)
        nearer = np.linalg.norm(there.point.residual[n:]) < np.linalg.norm(here.point.residual[n:])
        soft *= 0.3 if nearer else 10.0
        return there if nearer else here

    begin = moving.at(equations.holding(state, loading))
    here, _ = newton(begin, step, after, lambda here: False, DAMPED)
    slope, gaps = np.zeros(n), here.point.residual[n:]
    chosen, row, column = equations.jacobian_entries
    np.add.at(slope, column, here.point.entries[chosen] * gaps[row])
    return here.state, gaps, float(np.abs(slope).max(initial=0.0))


def _asked(equations: Equations, state: State, loading: Loading, name: str) -> Array:
    """Derivative (rows,) of the gaps by the factor of one prescribed motion, at fixed unknowns."""
    motion = equations.model.motion(name).scaled(STEP)
    ahead, behind = (loading.plus(motion.scaled(sign)) for sign in (1.0, -1.0))
    rows = [equations.at(equations.holding(state, at), at).residual[equations.unknowns :] for at in (ahead, behind)]
    return np.asarray(rows[0] - rows[1]) / (2.0 * STEP)


def moves_nodes(equations: Equations, motion: Array, state: State) -> bool:
    """Whether a motion (unknowns,) of any scale moves a node at a state, or in the plane rotates a member.

    In space the rotation of a member about its own axis moves none.
    """
    if not equations.model.space and np.abs(motion[: equations.rotation_unknowns]).max(initial=0.0) > 0.0:
        return True
    return bool(
        np.abs(_node_travels(equations, motion, state)).max(initial=0.0)
        > tolerances.NEGLIGIBLE * np.abs(motion).max(initial=1.0)
    )
