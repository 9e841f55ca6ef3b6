"""Start states: supports, closings and motions satisfied as far as possible, straight chains bent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rotations import RotationFreedom
from .newton import TURN, Iterate, Moving, descend, newton
from .redundancy import loose_rows

__all__ = ["bends", "first_guess", "lacks_slack", "lead", "least", "restore"]

LEADING, SETTLING = 30, 10
"""Steps in which the targets of nodes move to their start places, and further steps with the targets at rest."""

LONGEST, CLOSING = 0.5, 60
"""Largest rotation of a node, rad, in a step that closes gaps or leads nodes; most steps to close gaps."""

SPRING = 300.0
"""Stiffness of the springs that lead nodes, EI/L^3 of the scene: stiffer than beams, soft enough to yield."""

SHORT_STEP = 0.3
"""Largest rotation of a node, rad, in a step downhill from a ``start`` of a user, so as not to leave its basin."""

NEAR_TARGET = 0.05
"""Distance from targets, dimensionless, up to which nodes count as at their start places."""

SAME_GAP = 1e-6
"""Gaps, dimensionless, that differ by less are the same: of such shapes that of less energy begins."""

SAME_ENERGY, ROUNDED = 1e-9, 1e-12
"""Energies that differ by less than this share of the largest, or dimensionless by what is rounding, are the same."""

SHARES, ALIKE = tuple(0.5**k for k in range(16)), 1.001
"""Shares of the bow that are tried, and the ratio of gaps that are as good as each other."""

BOW = 0.2
"""Largest slope (rad) of the bow: enough slack for the first closing step, little enough to choose no branch."""


def lacks_slack(equations: Equations) -> bool:
    """Whether straight members make rows redundant: they cannot shorten to first order.

    Redundant joints do not count: their rows stay redundant when the members are bent slightly.
    """
    state = equations.start(equations.model.loading(0.0, 0.0))
    nothing = equations.model.loading(0.0, 0.0)
    loose = loose_rows(equations, equations.at(state, nothing))
    if not loose.size:
        return False
    bowed = replace(state, q=_turned_by(equations, state, _bow(equations)))
    return bool(loose_rows(equations, equations.at(bowed, nothing)).shape[1] < loose.shape[1])


def restore(equations: Equations, state: State, loading: Loading, weight: Array) -> tuple[State, float]:
    """A state near the given one that satisfies closings, motions and joints, and its largest gap, dimensionless.

    Each step closes the linearised gaps with the least elastic energy by the stiffness of the undeformed scene, and is
    shortened to ``LONGEST``.  ``weight`` is that of the rotation unknowns; the multipliers of the state are zero.
    """
    state = replace(equations.holding(state, loading), lam=np.zeros(equations.rows))
    n, rows = equations.unknowns, equations.rows
    if rows == 0:
        return state, 0.0
    primal = np.concatenate([0.1 * weight, np.full(n - equations.rotation_unknowns, 1e-6)])
    metric = equations.regularised(equations.elastic_entries(), primal, tolerances.DUAL)

    def gap(here: Iterate) -> float:
        return float(np.abs(here.point.residual[n:]).max())

    def step(here: Iterate) -> Array:
        equations.solver.factor(metric + equations.of_rows(here.point.entries))
        step = equations.solver.solve(np.concatenate([np.zeros(n), -here.point.residual[n:]]))
        step[n:] = 0.0
        return step

    after = Moving(equations, loading, LONGEST)
    here, _ = newton(after.at(state), step, after, lambda here: gap(here) < tolerances.CLOSED, CLOSING)
    return here.state, gap(here)


def lead(equations: Equations, state: State, loading: Loading, weight: Array, targets: Array) -> tuple[State, float]:
    """The unloaded scene with springs between some nodes and targets, and the largest distance from these.

    ``targets`` (places * axes,) are displacements, dimensionless, nan for components without one; ``weight`` is that
    of the rotation unknowns.  The targets move to their places on straight lines, so that beams rotate the short way;
    the springs yield where a place cannot be reached.
    """
    unloaded = loading.unloaded()
    chosen = np.flatnonzero(np.isfinite(targets))
    begun = equations.node_jacobian(state, unloaded, chosen)[0]

    def step(here: Iterate) -> Array:
        nodal, jacobian = equations.node_jacobian(here.state, unloaded, chosen)
        wanted = begun + min(1.0, (here.count + 1) / LEADING) * (targets[chosen] - begun) - nodal
        border = np.zeros((equations.total, len(chosen)))
        border[: equations.unknowns] = jacobian.T
        equations.solver.factor(equations.regularised(here.point.entries, 1e-3 * weight, tolerances.DUAL))
        base = equations.solver.solve(np.column_stack([-here.point.residual, border]))
        pull = np.linalg.solve(border.T @ base[:, 1:] + np.eye(len(chosen)) / SPRING, wanted - border.T @ base[:, 0])
        return np.asarray(base[:, 0] + base[:, 1:] @ pull)

    after = Moving(equations, unloaded, LONGEST, convex=True)
    state = newton(after.at(state), step, after, lambda here: False, LEADING + SETTLING)[0].state
    return state, float(np.abs(targets[chosen] - equations.node_jacobian(state, unloaded, chosen)[0]).max())


def first_guess(equations: Equations, loading: Loading, weight: Array, *, settle: bool = True) -> tuple[State, float]:
    """A start state and its largest gap, dimensionless (lengths over that of the model, or rad).

    The undeformed scene with the prescribed rotations interpolated between their nodes; straight members bent where
    the closings would otherwise have no slack (a straight member cannot shorten to first order); then closings,
    motions and the ``start`` places of nodes satisfied as far as possible; then, with ``settle``, steps downhill in
    the potential.  ``weight`` (rotation unknowns,) is the one of the stability test.
    """
    state = equations.start(loading)
    if np.any(loading.turn):
        state = _carried(equations, loading)
    targets = _wished(equations)
    if equations.rows and targets is None and lacks_slack(equations):
        state = _bent(equations, state, loading, weight)
    if targets is not None:
        state = _placed(equations, state, loading, weight, targets)
    state, gap = restore(equations, state, loading, weight)
    if gap > tolerances.REACHED or not settle:
        return state, gap
    return descend(equations, state, loading, weight, most=TURN if targets is None else SHORT_STEP), gap


def _placed(equations: Equations, state: State, loading: Loading, weight: Array, targets: Array) -> State:
    """The state with its nodes near their targets, from two slightly bent shapes or, if needed, several curled ones."""

    def tried(turns: tuple[float, ...]) -> tuple[float, float, State]:
        sides = []
        for curl in _curls(equations, turns):
            bent = replace(state, q=_turned_by(equations, state, curl))
            placed, gap = lead(equations, bent, loading, weight, targets)
            sides.append((gap, equations.at(placed, loading.unloaded()).strain, placed))
        return least(sides, NEAR_TARGET)

    best = tried((0.5, -0.5))
    # With both ends fixed, curls would change the twist that motions prescribe.
    if best[0] > NEAR_TARGET and equations.rows <= equations.displacement_unknowns:
        best = least([best, tried((2.0, -2.0, 4.0, -4.0, 6.0, -6.0))], NEAR_TARGET)
    return replace(best[2], lam=np.zeros(equations.rows))


def _curls(equations: Equations, turns: tuple[float, ...]) -> list[Array]:
    """Fields of rotation vectors (rotations, 3), rad, growing with the distance from the ground to the given angles.

    They rotate about section axes of the member that comes first in the alphabet.
    """
    model = equations.model
    far = _distances(model)
    far /= far.max()
    frame = quaternion.matrix(model.scene.center_lines[min(model.members)].quaternions(np.array([0.0])))[0]
    axes = [frame[:, 2], frame[:, 1]] if model.space else [np.array([0.0, 0.0, 1.0])]
    return [turn * far[:, None] * axis for axis in axes for turn in turns]


def _distances(model: Model) -> Array:
    """Shortest length (rotations,) along members from the ground to each rotation, m; 0 where there is no way."""
    lengths = {name: line.length for name, line in model.scene.center_lines.items()}
    to_node = {name: 0.0 if node.support != "free" else np.inf for name, node in model.scene.nodes.items()}
    for _ in model.nodes:
        for name, member in model.scene.members.items():
            start, end = member.nodes[0], member.nodes[-1]
            to_node[start] = min(to_node[start], to_node[end] + lengths[name])
            to_node[end] = min(to_node[end], to_node[start] + lengths[name])
    distances = np.full(len(model.rotations.kind), np.inf)
    for name in model.members:
        part = model.along(name) * lengths[name]
        a, b = (to_node[node] for node in model.scene.members[name].nodes)
        chain = model.chain(name)
        distances[chain] = np.minimum(distances[chain], np.minimum(a + part, b + lengths[name] - part))
    return np.where(np.isfinite(distances), distances, 0.0)


def _turned_by(equations: Equations, state: State, vectors: Array) -> Array:
    """Rotations of a state after further rotation by vectors (rotations, 3), rad, of those that are free."""
    vectors = np.where((equations.model.rotations.kind == RotationFreedom.FREE)[:, None], vectors, 0.0)
    if equations.model.space:
        return quaternion.multiply(quaternion.from_rotation_vector(vectors), state.q)
    return np.asarray(state.q + vectors[:, 2:3])


def _wished(equations: Equations) -> Array | None:
    """Displacements (places * axes,) to the ``start`` places, dimensionless, nan for other nodes; None without any."""
    model = equations.model
    axes = model.element.axes
    targets = np.full((len(model.segments.places), axes), np.nan)
    for i, node in enumerate(model.scene.nodes.values()):
        if node.start is not None and (node.support == "free" or node.slides):
            targets[i] = (np.asarray(node.start) - np.asarray(node.position))[:axes] / model.scales.length
    return targets.ravel() if np.isfinite(targets).any() else None


def _carried(equations: Equations, loading: Loading) -> State:
    """The undeformed state with prescribed rotation vectors interpolated harmonically, members as conducting rods."""
    model = equations.model
    count = len(model.rotations.kind)
    names = tuple(name for name, ends in model.rotations.ends.items() if len(ends) == 2)
    ends = np.array([model.rotations.ends[name] for name in names])
    used, index = np.unique(ends, return_inverse=True)
    index = index.reshape(ends.shape)
    laplacian = np.zeros((len(used), len(used)))
    for a, b in index:
        laplacian[[a, b, a, b], [a, b, b, a]] += [1.0, 1.0, -1.0, -1.0]
    fixed = model.rotations.kind[used] == RotationFreedom.FIXED
    vectors = loading.turn[used]
    free = ~fixed
    if free.any():
        matrix = laplacian[np.ix_(free, free)] + 1e-9 * np.eye(int(free.sum()))
        vectors[free] = np.linalg.solve(matrix, -laplacian[np.ix_(free, fixed)] @ vectors[fixed])
    field = np.zeros((count, 3))
    for (a, b), (i, j), name in zip(ends, index, names, strict=True):
        field[a], field[b] = vectors[i], vectors[j]
        if name not in model.members:
            continue
        chain = model.chain(name)
        part = model.along(name)[:, None]
        field[chain] = (1.0 - part) * vectors[i] + part * vectors[j]
    about = model.rotations.kind == RotationFreedom.AXIS
    field[about] = (field[about] * model.rotations.axis[about]).sum(axis=1, keepdims=True) * model.rotations.axis[about]
    q = quaternion.from_rotation_vector(field) if model.space else field[:, 2:3]
    unwrapped = model.unwrapping.of_vectors(field)
    return equations.holding(replace(equations.start(loading), q=q, unwrapped=unwrapped), loading)


def _bent(equations: Equations, state: State, loading: Loading, weight: Array) -> State:
    """Straight members bent slightly, each by itself or chains as a whole, to the side of least potential."""
    sides = [
        (gap, equations.at(closed, loading).potential, bent)
        for bent, closed, gap in bends(equations, state, loading, weight)
    ]
    return least(sides)[2]


def bends(
    equations: Equations, state: State, loading: Loading, weight: Array, aside: float = 0.0
) -> Iterator[tuple[State, State, float]]:
    """A state with straight members bent slightly, each by itself or chains as a whole, to either side; with each what
    :func:`restore` makes of it, and the gap that is left.

    Ends of members are bent by up to a share ``aside`` less and more than their middles.
    """
    uneven = np.ones((len(equations.model.rotations.kind), 1))
    for name in equations.model.members:
        uneven[equations.model.chain(name), 0] += aside * (2.0 * equations.model.along(name) - 1.0)
    for vectors in (uneven * _bow(equations), uneven * _tent(equations)):
        share = _fitting(equations, state, loading, vectors)
        for sign in (share, -share):
            bent = replace(state, q=_turned_by(equations, state, sign * vectors))
            yield bent, *restore(equations, bent, loading, weight)


def _fitting(equations: Equations, state: State, loading: Loading, vectors: Array) -> float:
    """The largest share of a bend by vectors (rotations, 3), rad, that leaves the least gap; 1 where the least is best.

    Closing much more than it has to takes away a bend leaves short waves, which may lie on its other side.
    """

    def gap(share: float) -> float:
        bent = equations.holding(replace(state, q=_turned_by(equations, state, share * vectors)), loading)
        return float(np.abs(equations.at(bent, loading).residual[equations.unknowns :]).max())

    gaps = [gap(share) for share in SHARES]
    # Gaps that the bend does not change differ by rounding.
    best = next(share for share, one in zip(SHARES, gaps, strict=True) if one <= ALIKE * min(gaps))
    return best if best > SHARES[-1] else 1.0


def least(sides: list[tuple[float, float, Any]], near: float = 0.0) -> tuple[float, float, Any]:
    """The entry of least energy among those with a gap up to ``near``, or else of least gap; of equal ones the first.

    Mirror images differ by rounding only.
    """
    most = max(near, min(gap for gap, _, _ in sides) + SAME_GAP)
    closed = [side for side in sides if side[0] <= most]
    lowest, largest = min(energy for _, energy, _ in closed), max(abs(energy) for _, energy, _ in closed)
    return next(side for side in closed if side[1] <= lowest + SAME_ENERGY * largest + ROUNDED)


def _tent(equations: Equations) -> Array:
    """Rotation vectors (rotations, 3), rad, that raise the middle of chains between fixed nodes like a tent."""
    model, bow = equations.model, _bow(equations)
    far, vectors = _distances(model), np.zeros((len(equations.model.rotations.kind), 3))
    for name in model.members:
        chain = model.chain(name)
        direction = np.abs(bow[chain]).max(axis=0) * np.sign(bow[chain][1])
        slope = np.gradient(far[chain], model.along(name)) / model.scene.center_lines[name].length
        # The slope vanishes in the middle of a chain, but for rounding.
        vectors[chain] = np.sign(np.round(slope, 6))[:, None] * direction
    return vectors


def _bow(equations: Equations) -> Array:
    """Rotation vectors (rotations, 3), rad, of a slight bow of each straight member about its weak axis."""
    model = equations.model
    vectors = np.zeros((len(model.rotations.kind), 3))
    for name in model.members:
        member, line = model.scene.members[name], model.scene.center_lines[name]
        if line.turning > 0.05 or member.type == "rigid":
            continue
        section = model.scene.sections[str(member.section)]
        stiffness = section.stiffness(np.array([0.5]))[0]
        weak_2 = model.space and stiffness[1] < stiffness[2] * (1.0 - 1e-9)
        frame = quaternion.matrix(line.quaternions(np.array([0.0])))[0]
        axis = np.array([0.0, 0.0, 1.0]) if not model.space else (-frame[:, 1] if weak_2 else frame[:, 2])
        if model.space and section.coupled:
            # The axis in the section about which it is bent most easily.
            axis = frame[:, 1:] @ np.linalg.eigh(section.compliance_matrix(np.array([0.5]))[0, 1:, 1:])[1][:, -1]
        inner = model.chain(name)[1:-1]
        vectors[inner] = BOW * np.sin(2.0 * np.pi * model.along(name)[1:-1])[:, None] * axis
    return vectors
