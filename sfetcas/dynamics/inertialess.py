"""Checks for unknowns without inertia: index-1 integrators cannot treat them, others need stiffness against them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations

__all__ = ["check_inertia", "check_resisted"]

SHIFT = 1e-13
"""Shift of an equilibrated matrix: what its entries have of rounding, or less."""

PART = 1e-3
"""Share of the largest from which an unknown takes part in what has no inertia."""

OTHERS = "radau-3, radau-2, generalised-alpha or conserving"


def check_inertia(equations: Equations, matrix: Array) -> None:
    """Refuse a model whose accelerations or multipliers are not determined.

    Parameters
    ----------
    matrix : ndarray (total, total)
        Mass and constraint matrices, ``[M G^T; G 0]``, dimensionless.

    Raises
    ------
    SceneError
        Names sections, nodes or members without inertia, or constraints that depend on each other.
    """
    if equations.model.scene.stretches:
        message = "found 'idas', but strains of members that stretch or shear have no inertia of their own"
        raise SceneError(f"{message}, accepted: radau-3, radau-2, generalised-alpha", ("analysis", "integrator"))
    null = _null(matrix)
    if null is None:
        return
    n = equations.unknowns
    open_ones = np.flatnonzero(null[:n] > PART)
    if len(open_ones):
        why, accepted = _without_inertia(equations, open_ones)
    else:
        rows = [equations.row_names[i] for i in np.flatnonzero(null[n:] > PART)]
        why = f"closings depend on each other ({', '.join(rows[:3])})"
        accepted = "joints and supports of which none repeats what others hold"
    raise SceneError(f"found 'idas', but {why}, accepted: {accepted}", ("analysis", "integrator"))


def check_resisted(equations: Equations, matrix: Array) -> None:
    """Refuse a model with motions that have neither inertia nor stiffness, so that they are not determined.

    Parameters
    ----------
    matrix : ndarray (total, total)
        Stiffness, mass and constraint matrices, ``[K + M G^T; G 0]``, dimensionless.

    Raises
    ------
    SceneError
        Names sections, nodes or members.
    """
    null = _null(matrix)
    if null is None:
        return
    open_ones = np.flatnonzero(null[: equations.unknowns] > PART)
    if len(open_ones):
        why, accepted = _without_inertia(equations, open_ones)
        accepted = accepted.split(",")[0] if accepted.startswith("'rhoI'") else "a mass, an inertia or a spring there"
        raise SceneError(f"{why}, and no stiffness either, accepted: {accepted}")


def _null(matrix: Array) -> Array | None:
    """Absolute components, up to 1, of a vector that the matrix takes to rounding; None where there is none."""
    if not len(matrix):
        return None
    scale = np.ones(len(matrix))
    for _ in range(EQUILIBRATED):
        rows = np.abs(scale[:, None] * matrix * scale).max(axis=1, initial=0.0)
        scale /= np.sqrt(np.where(rows > 0.0, rows, 1.0))
    shifted = scale[:, None] * matrix * scale + SHIFT * np.eye(len(matrix))
    # Inverse iteration, twice: a vector that is almost lost comes out as long as the shift is small.
    found = np.random.default_rng(0).standard_normal(len(matrix))
    for _ in range(2):
        found = np.array(ca.solve(ca.sparsify(ca.DM(shifted)), found / np.linalg.norm(found), "csparse")).ravel()
    if np.linalg.norm(found) * SHIFT < LOST:
        return None
    unscaled = np.abs(found) * scale
    return np.asarray(unscaled / unscaled.max())


LOST = 1e-2
"""Shift over the smallest singular value from which the value is zero but for rounding."""


EQUILIBRATED = 8
"""Rounds that bring the largest entry of each row near to one."""


def _without_inertia(equations: Equations, unknowns: Array) -> tuple[str, str]:
    """What has none, sections without rotary inertia or else members and nodes, and what is accepted instead."""
    model, scene = equations.model, equations.model.scene
    turning = set(np.flatnonzero(np.isin(equations.number, unknowns).any(axis=1)).tolist())
    along = {name: model.chain(name).tolist() for name in model.members if name in model.beams.first}
    ends = model.rotations.ends
    members = [name for name in scene.members if turning & set(along.get(name, ends[name]))]
    sections = dict.fromkeys(str(scene.members[name].section) for name in members if scene.members[name].section)
    light = [name for name in sections if not scene.sections[name].inertia(np.linspace(0.0, 1.0, 3)).any()]
    if light:
        sections_of = "section" if len(light) == 1 else "sections"
        return (
            f"without 'rhoI' of the {sections_of} {', '.join(light)} some rotations have no inertia",
            f"'rhoI', or {OTHERS}",
        )
    y, axes = model.positions.Y, model.element.axes
    moving = np.unique(y.row[np.isin(equations.rotation_unknowns + y.column, unknowns)] // axes)
    names = [*members, *(model.segments.places[i] for i in moving)]
    return f"what turns or moves at {', '.join(names)} has no inertia", OTHERS
