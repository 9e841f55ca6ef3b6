"""The shape at the begin of a motion, from rotations along members that the scene says.

Rotations of sections say the shape but for where it is: displacements follow from closings, and of a part that nothing
holds the first of its nodes stays at its place.  What closings of loops then miss is closed by the smallest change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.sections import evaluate
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, first_of_largest
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rotations import RotationFreedom
from ..mechanics.segments import elongation_of
from ..mechanics.tendon_chains import settle
from .projecting import closed

__all__ = ["shaped", "stretched"]

OPEN = 1e-3
"""Largest gap of closings, over the size of the scene or in rad, up to which a shape is closed by a small change."""

TOLD = 1e-9
"""Gap from which on a note tells of that change."""


def shaped(equations: Equations, state: State, loading: Loading) -> tuple[State, tuple[str, ...]]:
    """The state with the rotations that members are turned by, and notes.

    Raises
    ------
    SceneError
        Two members turn what they share by different rotations, a support or joint does not allow them, a member that
        is joined to a turned one does not say how it turns, or closings miss too much; the sentence says by how much.
    """
    model = equations.model
    q = _turned(model, state.q)
    state = replace(state, q=q, unwrapped=model.unwrapping.angles(q, state.unwrapped))
    state = stretched(equations, _placed(equations, state, loading), loading)
    gaps = np.abs(equations.at(state, loading).residual[equations.unknowns :])
    # Of elements in a row each has its share of what a loop misses.
    gap = float(gaps.sum())
    size = model.scene.size / model.scales.length
    if gap > OPEN * size:
        row = equations.row_names[first_of_largest(gaps)]
        where = next(("members", n, "turned") for n, m in model.scene.members.items() if m.turned is not None)
        missed = f"the shape at t = 0 misses what is joined ({row}) by {gap / size:.3g} of the size"
        raise SceneError(f"{missed}, accepted: rotations along members that close all loops and joints", where)
    state, _ = closed(equations, state, loading)
    settle(model, state.q, state.y)
    if gap > TOLD * size:
        return state, (f"the shape at t = 0 missed closings by {gap / size:.1e} of the size: it was changed to close",)
    return state, ()


def stretched(equations: Equations, state: State, loading: Loading) -> State:
    """The state with elastic tendons as long as their ways: what they are longer by has no inertia to keep it.

    Of those that rub the tensions along the way decide about it, which the first step finds.
    """
    model, y = equations.model, state.y.copy()
    gaps = equations.at(state, loading).residual[equations.unknowns :]
    for name, tendon in model.scene.tendons.items():
        if tendon.stiffness is not None and not tendon.rubs:
            longer = model.positions.retained[model.segments.place(elongation_of(name)), 0]
            y[longer] += gaps[equations.row_names.index(f"tendons.{name}")]
    return replace(state, y=y)


def _turned(model: Model, rest: Array) -> Array:
    """Rotations (rotations, components) as the members say, ``rest`` where none says any."""
    scene, q = model.scene, rest.copy()
    known: dict[int, str] = {}
    for name in model.members:
        member = scene.members[name]
        if member.turned is None:
            continue
        chain, x = model.chain(name), model.along(name)
        length = scene.center_lines[name].length
        vectors = np.stack([evaluate(part, x, length) for part in member.turned_about], axis=1)
        found = quaternion.from_rotation_vector(vectors) if model.space else vectors[:, 2:]
        shared = [i for i, number in enumerate(chain.tolist()) if number in known or _held(model, number)]
        # Both signs of a quaternion are the same rotation, but along a member they must not change.
        if model.space and shared and found[shared[0]] @ q[chain[shared[0]]] < 0.0:
            found = -found
        for number, value in zip(chain.tolist(), found, strict=True):
            if number in known or _held(model, number):
                _check_same(model, name, known.get(number, ""), q[number], value)
            else:
                _check_axis(model, name, number, value)
                q[number], known[number] = value, name
    for name in model.members:
        member, chain = scene.members[name], model.chain(name)
        if member.turned is not None or member.type == "rigid":
            continue
        for number in set(chain.tolist()) & set(known):
            if _angle(model, q[number], rest[number]) > tolerances.WRITTEN:
                message = f"the key 'turned' is missing: it is joined to the member {known[number]!r}, which is turned"
                raise SceneError(f"{message}, accepted: how it turns itself", ("members", name))
    return q


def _held(model: Model, number: int) -> bool:
    """Whether a rotation is held by a support or prescribed."""
    return bool(model.rotations.kind[number] == RotationFreedom.FIXED)


def _angle(model: Model, one: Array, other: Array) -> float:
    """Angle between two rotations, rad; in the plane whole turns count."""
    if not model.space:
        return float(abs(one - other)[0])
    return float(np.linalg.norm(quaternion.rotation_vector(quaternion.multiply(quaternion.conjugate(one), other))))


def _check_same(model: Model, name: str, before: str, one: Array, other: Array) -> None:
    angle = _angle(model, one, other)
    if angle > tolerances.WRITTEN:
        what = "what a support holds" if not before else f"what it shares with the member {before!r}"
        what = "a rigid member" if before == name else what
        message = f"turns {what} by {angle:.3g} rad from it, accepted: the same rotation there"
        raise SceneError(message, ("members", name, "turned"))


def _check_axis(model: Model, name: str, number: int, value: Array) -> None:
    """Refuse a rotation that is not about the axis of a hinge that holds it."""
    if model.space and model.rotations.kind[number] == RotationFreedom.AXIS:
        vector, axis = quaternion.rotation_vector(value), model.rotations.axis[number]
        across = float(np.linalg.norm(vector - (vector @ axis) * axis))
        if across > tolerances.WRITTEN:
            message = f"turns a hinge by {across:.3g} rad across its axis, accepted: a rotation about it"
            raise SceneError(message, ("members", name, "turned"))


def _placed(equations: Equations, state: State, loading: Loading) -> State:
    """The state with displacements of places that close what they can, strains as they are."""
    model, n = equations.model, equations.unknowns
    retained, first = model.positions.retained, equations.rotation_unknowns
    strains = retained[model.segments.strains[model.segments.strains >= 0]].ravel()
    moving = np.setdiff1d(np.arange(len(state.y)), strains)
    point = equations.at(state, loading)
    full = np.zeros((equations.total, equations.total))
    full[equations.row, equations.column] = point.entries
    rows = full[n:, first + moving]
    if not rows.size:
        return state
    _, sizes, axes = np.linalg.svd(rows)
    rank = int((sizes > tolerances.RANK * sizes[0]).sum()) if sizes.size else 0
    step = np.linalg.pinv(rows, rcond=tolerances.RANK) @ -point.residual[n:]
    free = axes[rank:].T
    for i in range(len(moving)):
        if not free.shape[1]:
            break
        # Of what nothing holds the first place stays.
        if np.abs(free[i]).max() > tolerances.RANK:
            share = free[i] / np.linalg.norm(free[i])
            step = step - free @ share * (step[i] / (free[i] @ share))
            left = np.linalg.svd(share[None, :])[2][1:].T
            free = free @ left
    y = state.y.copy()
    y[moving] += step
    return replace(state, y=y)
