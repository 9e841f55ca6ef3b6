"""Newton's method on the stationarity equations, and states that satisfy the closings to start from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import quaternion
from .equations import Equations, Point, State
from .model import Loading, Model, Turn

Array = np.ndarray[Any, np.dtype[np.float64]]

__all__ = ["Corrected", "correct", "descend", "first_guess", "lead", "redundant_rows", "relative_residual", "restore"]

PROXIMAL = 1e-10
"""Weight of the proximal term: it makes neutral directions harmless and costs no digit elsewhere."""

SHORT = 0.05
"""Steps shorter than this, rad, need not shrink yet."""

ROUNDING = 3e-15
"""Relative residual at which there is nothing left to gain."""

DUAL = 1e-12
"""Softness of the closings in the matrix (not in the equations), against redundant ones."""


@dataclass(frozen=True)
class Corrected:
    """Where Newton's method arrived.

    ``first`` and ``second`` are the largest rotations (rad) of the first two steps: how far the equations were
    from linear.
    """

    state: State
    point: Point
    converged: bool
    iterations: int
    first: float
    second: float
    residual: float


def relative_residual(equations: Equations, point: Point) -> float:
    """Largest out-of-balance moment or force over the largest one that was added up, or largest gap."""
    n = equations.unknowns
    off = np.abs(point.residual)
    balance = float(off[:n].max(initial=0.0))
    gap = float(off[n:].max(initial=0.0))
    # An unloaded scene is balanced: nothing is added up that a residual could be compared with.
    return max(balance / point.scale if balance > 1e-15 else 0.0, gap)


def newton_step(equations: Equations, point: Point, weight: Array) -> Array:
    """The step of all unknowns and multipliers."""
    entries = point.entries.copy()
    n, total = equations.turning_unknowns, equations.total
    diagonal = equations.diagonal
    entries[diagonal[:n]] += PROXIMAL * weight
    entries[diagonal[equations.unknowns : total]] -= DUAL
    equations.solver.factor(entries)
    return equations.solver.solve(-point.residual)


def correct(
    equations: Equations,
    state: State,
    loading: Loading,
    weight: Array,
    *,
    tolerance: float = 1e-12,
    iterations: int = 12,
    most: float = np.inf,
    contraction: float = 1.0,
    tangent: Array | None = None,
) -> Corrected:
    """Newton's method from a near state down to rounding.

    Parameters
    ----------
    weight : ndarray
        Weight of the proximal term, see :class:`~sfetcas.stability.StabilityTest`.
    tolerance : float
        Relative residual that counts as converged; iterations go on while they still gain a factor of 4.
    most : float
        Give up when a later step than the first turns any node by more, rad.
    contraction : float
        Give up when a step is not shorter than this times the one before (or than 0.05 rad).
    tangent : ndarray, optional
        Entries of the Newton matrix of the equilibrium that is left, for the first step: then it goes along the
        path, while the matrix under the new load may already point away from it.
    """
    state = equations.holding(state, loading)
    point = equations.at(state, loading)
    residual = relative_residual(equations, point)
    first = second = last = np.inf
    count = 0
    for count in range(iterations):
        if residual <= ROUNDING:
            break
        try:
            here = replace(point, entries=tangent) if tangent is not None and count == 0 else point
            step = newton_step(equations, here, weight)
        except np.linalg.LinAlgError:
            break
        length = float(np.abs(step[: equations.turning_unknowns]).max(initial=0.0))
        if not np.isfinite(length):
            break
        if count == 0:
            first = length
        elif count == 1:
            second = length
        if count and residual > tolerance and (length > most or length > max(contraction * last, SHORT)):
            return Corrected(state, point, False, count, first, second, residual)
        last = length
        trial = equations.moved(state, step)
        there = equations.at(trial, loading)
        gained = relative_residual(equations, there)
        if residual <= tolerance and gained > 0.25 * residual:
            if gained < residual:
                state, point, residual = trial, there, gained
            break
        state, point, residual = trial, there, gained
        if not np.isfinite(residual):
            break
    second = 0.0 if second == np.inf else second
    return Corrected(state, point, residual <= tolerance, count, first, second, residual)


def descend(equations: Equations, state: State, loading: Loading, weight: Array, *, iterations: int = 30, most: float = 1.2) -> State:
    """Downhill towards a minimum of the potential on the closings, from any state.

    Newton steps with convex element matrices, so that each points downhill, shortened until the potential (with
    the gaps, weighted beyond the multipliers) falls by a third of what the step promises.  Forces turn no node
    by more than ``most`` in a step, so that they do not wind a beam up; a moment may roll it up at once.  Stops where steps have become short; the
    state is meant as a start for IPOPT or Newton's method.
    """
    scale = 1.0
    most = np.inf if np.any(loading.couple) and most == TURN else most
    point = equations.at(state, loading, convex=True)
    for _ in range(iterations):
        try:
            step = newton_step(equations, point, 1e4 * weight)
        except np.linalg.LinAlgError:
            return state
        n = equations.unknowns
        length = float(np.abs(step[: equations.turning_unknowns]).max(initial=0.0))
        if not np.isfinite(length):
            return state
        # Slope of the potential alone: the residual without the multipliers' share.
        lam = state.lam + step[n:]
        penalty = 2.0 * float(np.abs(lam).max(initial=0.0))
        gaps = np.abs(point.residual[n:]).sum()
        slope = float(point.residual[:n] @ step[:n]) + float(state.lam @ point.residual[n:]) - penalty * gaps
        slope = min(slope, 0.0)
        before = point.potential + penalty * gaps
        scale = min(1.0, 4.0 * scale, most / max(length, 1e-30))
        for _ in range(40):
            trial = equations.moved(state, np.concatenate([scale * step[:n], scale * step[n:]]))
            there = equations.at(trial, loading, convex=True)
            after = there.potential + penalty * np.abs(there.residual[n:]).sum()
            if after - before <= 0.3 * (scale - 0.5 * scale**2) * slope + 1e-12 * abs(before):
                break
            scale *= 0.5
        state, point = trial, there
        if scale == 1.0 and length < 0.02:
            break
    return state


def restore(equations: Equations, state: State, loading: Loading, weight: Array) -> tuple[State, float]:
    """A state near the given one that satisfies closings, motions and joints, and the gap that is left.

    Each step is the smallest change in the elastic energy of the undeformed scene that closes the linearised
    gaps, shortened to 0.5 rad.
    """
    state = replace(equations.holding(state, loading), lam=np.zeros(equations.rows))
    n, rows = equations.unknowns, equations.rows
    if rows == 0:
        return state, 0.0
    metric = equations.elastic_entries()
    metric[equations.diagonal[: equations.turning_unknowns]] += 0.1 * weight
    metric[equations.diagonal[equations.turning_unknowns : n]] += 1e-6
    metric[equations.diagonal[n:]] -= 1e-9
    coupling = (equations.row >= n) != (equations.column >= n)
    gap = np.inf
    for _ in range(60):
        point = equations.at(state, loading)
        gap = float(np.abs(point.residual[n:]).max())
        if gap < 1e-9:
            break
        equations.solver.factor(np.where(coupling, point.entries, metric))
        step = equations.solver.solve(np.concatenate([np.zeros(n), -point.residual[n:]]))
        step[n:] = 0.0
        length = np.abs(step[: equations.turning_unknowns]).max(initial=0.0)
        state = equations.moved(state, step * min(1.0, 0.5 / max(length, 1e-30)))
    return state, gap


def lead(equations: Equations, state: State, loading: Loading, weight: Array, targets: Array) -> tuple[State, float]:
    """The unloaded scene with some nodes pulled towards places, and how far they stay from them.

    ``targets`` (nodes * axes, nan where none) are displacements.  Springs pull the nodes along straight ways, so
    that beams take the short turn, and yield where a place cannot be reached.
    """
    unloaded = loading.unloaded()
    chosen = np.flatnonzero(np.isfinite(targets))
    begun, missing = None, np.zeros(0)
    for count in range(LEADING + SETTLING):
        point = equations.at(state, unloaded, convex=True)
        nodal, jacobian = equations.node_jacobian(state, unloaded, chosen)
        begun = nodal if begun is None else begun
        missing = targets[chosen] - nodal
        wanted = begun + min(1.0, (count + 1) / LEADING) * (targets[chosen] - begun) - nodal
        entries = point.entries.copy()
        entries[equations.diagonal[: equations.turning_unknowns]] += 1e-3 * weight
        entries[equations.diagonal[equations.unknowns :]] -= 1e-9
        border = np.zeros((equations.total, len(chosen)))
        border[: equations.unknowns] = jacobian.T
        equations.solver.factor(entries)
        base = equations.solver.solve(np.column_stack([-point.residual, border]))
        pull = np.linalg.solve(
            border.T @ base[:, 1:] + np.eye(len(chosen)) / SPRING, wanted - border.T @ base[:, 0]
        )
        step = base[:, 0] + base[:, 1:] @ pull
        length = np.abs(step[: equations.turning_unknowns]).max(initial=0.0)
        state = equations.moved(state, step * min(1.0, 0.5 / max(length, 1e-30)))
    return state, float(np.abs(missing).max())


def first_guess(equations: Equations, loading: Loading, weight: Array) -> tuple[State, float]:
    """A state to start from, and the gap of the closings that is left.

    The undeformed scene, its rotations carried along by the prescribed ones; straight members bent where the
    closings would otherwise have no slack (a straight member cannot shorten to first order); then closings,
    motions and the ``start`` places of nodes satisfied as far as possible.
    """
    model = equations.model
    state = equations.start(loading)
    if np.any(loading.turn):
        state = _carried(equations, loading)
    targets = _wished(equations)
    if equations.rows and targets is None and redundant_rows(equations, equations.at(state, loading)):
        state = _bent(equations, state, loading)
    if targets is not None:
        state = _placed(equations, state, loading, weight, targets)
    state, gap = restore(equations, state, loading, weight)
    if gap > 1e-6:
        return state, gap
    return descend(equations, state, loading, weight, most=TURN if targets is None else NEAR), gap


def _placed(equations: Equations, state: State, loading: Loading, weight: Array, targets: Array) -> State:
    """The state with its nodes near their targets, of two slight bows or, if need be, of several ways to curl up."""

    def tried(turns: tuple[float, ...]) -> tuple[float, float, State]:
        sides = []
        for curl in _curls(equations, turns):
            bent = replace(state, q=_turned_by(equations, state, curl))
            placed, gap = lead(equations, bent, loading, weight, targets)
            sides.append((round(gap, 1), equations.at(placed, loading.unloaded()).strain, placed))
        return min(sides, key=lambda side: side[:2])

    best = tried((0.5, -0.5))
    # Where both ends are held, curls would change the twist that motions prescribe.
    if best[0] > 0.0 and not equations.rows:
        best = min(best, tried((2.0, -2.0, 4.0, -4.0, 6.0, -6.0)), key=lambda side: side[:2])
    return replace(best[2], lam=np.zeros(equations.rows))


def _curls(equations: Equations, turns: tuple[float, ...]) -> list[Array]:
    """Rotation vectors growing with the distance from the ground to the given turns, rad, about section axes."""
    model = equations.model
    far = _distances(model)
    far /= far.max()
    frame = quaternion.matrix(model.scene.center_lines[model.members[0]].quaternions(np.array([0.0])))[0]
    axes = [frame[:, 2], frame[:, 1]] if model.space else [np.array([0.0, 0.0, 1.0])]
    return [turn * far[:, None] * axis for axis in axes for turn in turns]


def _distances(model: Model) -> Array:
    """Shortest length along members from the ground to each rotation."""
    lengths = {name: model.scene.center_lines[name].length for name in model.members}
    to_node = {name: 0.0 if node.support != "free" else np.inf for name, node in model.scene.nodes.items()}
    for _ in model.nodes:
        for name, member in model.scene.members.items():
            a, b = member.nodes
            to_node[a] = min(to_node[a], to_node[b] + lengths[name])
            to_node[b] = min(to_node[b], to_node[a] + lengths[name])
    distances = np.full(len(model.kind), np.inf)
    for name, member in model.scene.members.items():
        part, (a, b) = model.along(name) * lengths[name], (to_node[n] for n in member.nodes)
        chain = model.chain(name)
        distances[chain] = np.minimum(distances[chain], np.minimum(a + part, b + lengths[name] - part))
    return np.where(np.isfinite(distances), distances, 0.0)


def _turned_by(equations: Equations, state: State, vectors: Array) -> Array:
    """Rotations of a state turned further by rotation vectors where they are free."""
    vectors = np.where((equations.model.kind == Turn.FREE)[:, None], vectors, 0.0)
    if equations.model.space:
        return quaternion.multiply(quaternion.from_rotation_vector(vectors), state.q)
    return np.asarray(state.q + vectors[:, 2:3])


def _wished(equations: Equations) -> Array | None:
    """Displacements to the ``start`` places, dimensionless, nan where none is given."""
    model = equations.model
    axes = model.element.axes
    targets = np.full((len(model.nodes), axes), np.nan)
    for i, node in enumerate(model.scene.nodes.values()):
        if node.start is not None and node.support in ("free", "slider"):
            targets[i] = (np.asarray(node.start) - np.asarray(node.position))[:axes] / model.scales.length
    return targets.ravel() if np.isfinite(targets).any() else None


def redundant_rows(equations: Equations, point: Point) -> list[int]:
    """Rows that depend on others to first order at this state; empty where the multipliers are unique."""
    n = equations.unknowns
    if not equations.rows:
        return []
    chosen = (equations.row >= n) & (equations.column < n)
    rows = np.zeros((equations.rows, n))
    rows[equations.row[chosen] - n, equations.column[chosen]] = point.entries[chosen]
    squares, left = np.linalg.eigh(rows @ rows.T)
    loose = left[:, squares < SLACK**2 * squares[-1]]
    return np.flatnonzero((np.abs(loose) > 0.1).any(axis=1)).tolist()


def _carried(equations: Equations, loading: Loading) -> State:
    """Prescribed rotation vectors spread over the scene like heat, members being rods."""
    model = equations.model
    count = len(model.kind)
    ends = np.array([model.ends[name] for name in model.members])
    used, index = np.unique(ends, return_inverse=True)
    index = index.reshape(ends.shape)
    laplacian = np.zeros((len(used), len(used)))
    for a, b in index:
        laplacian[[a, b, a, b], [a, b, b, a]] += [1.0, 1.0, -1.0, -1.0]
    held = model.kind[used] == Turn.HELD
    vectors = loading.turn[used]
    free = ~held
    if free.any():
        matrix = laplacian[np.ix_(free, free)] + 1e-9 * np.eye(int(free.sum()))
        vectors[free] = np.linalg.solve(matrix, -laplacian[np.ix_(free, held)] @ vectors[held])
    field = np.zeros((count, 3))
    for (a, b), (i, j), name in zip(ends, index, model.members, strict=True):
        chain = model.chain(name)
        part = model.along(name)[:, None]
        field[chain] = (1.0 - part) * vectors[i] + part * vectors[j]
        field[a], field[b] = vectors[i], vectors[j]
    about = model.kind == Turn.AXIS
    field[about] = (field[about] * model.axis[about]).sum(axis=1, keepdims=True) * model.axis[about]
    q = quaternion.from_rotation_vector(field) if model.space else field[:, 2:3]
    return equations.holding(replace(equations.start(loading), q=q), loading)


def _bent(equations: Equations, state: State, loading: Loading) -> State:
    """Straight members bent by a slight bow about their weak axis, to the side that the loads prefer."""
    up, down = (replace(state, q=_bow(equations, state, sign)) for sign in (1.0, -1.0))
    difference = equations.at(up, loading).potential - equations.at(down, loading).potential
    return down if difference > 1e-12 else up


def _bow(equations: Equations, state: State, sign: float) -> Array:
    """Rotations of a state with a slight bow of the straight members."""
    model = equations.model
    vectors = np.zeros((len(model.kind), 3))
    for name, member in model.scene.members.items():
        line = model.scene.center_lines[name]
        if line.turning > 0.05:
            continue
        stiffness = model.scene.sections[member.section].stiffness(np.array([0.5]))[0]
        weak_2 = model.space and stiffness[1] < stiffness[2] * (1.0 - 1e-9)
        frame = quaternion.matrix(line.quaternions(np.array([0.0])))[0]
        axis = np.array([0.0, 0.0, 1.0]) if not model.space else (-frame[:, 1] if weak_2 else frame[:, 2])
        inner = model.chain(name)[1:-1]
        vectors[inner] = BOW * np.sin(2.0 * np.pi * model.along(name)[1:-1])[:, None] * axis
    return _turned_by(equations, state, sign * vectors)


SLACK = 1e-6
"""Singular values of the closings below this share of the largest: no slack to first order."""

LEADING, SETTLING = 30, 10
"""Steps in which nodes are led to the places wished for them, and in which they settle there."""

SPRING = 300.0
"""Stiffness of the springs that lead nodes, EI/L^3 of the scene: stiffer than beams, soft enough to yield."""

TURN = 1.2
"""Largest rotation (rad) of a step downhill under forces."""

NEAR = 0.3
"""The same, rad, from a ``start`` that a user gave: the basin it lies in is not to be left."""

BOW = 0.2
"""Largest slope (rad) of the bow: enough slack for the first closing step, little enough to choose no branch."""
