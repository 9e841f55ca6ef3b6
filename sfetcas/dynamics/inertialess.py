"""What turns or moves without inertia: integrators of index 1 cannot take it, as nothing gives it an acceleration."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations
from .index_one import LINEAR

__all__ = ["check_inertia"]

SINGULAR = 1e-13
"""Of an equilibrated matrix: below this its smallest singular values are rounding."""

PART = 1e-3
"""Share of the largest from which an unknown takes part in what has no inertia."""

OTHERS = "radau-3, radau-2, generalised-alpha or conserving"


def check_inertia(equations: Equations, matrix: Array) -> None:
    """Refuse what leaves accelerations or multipliers open.

    Parameters
    ----------
    matrix : ndarray (total, total)
        Masses and closings, ``[M G^T; G 0]``.

    Raises
    ------
    SceneError
        Names sections, nodes or members without inertia, or closings that depend on each other.
    """
    null = _null(matrix)
    if null is None:
        return
    n = equations.unknowns
    open_ones = np.flatnonzero(null[:n] > PART)
    if len(open_ones):
        what = f"{_without_inertia(equations, open_ones)}, so that nothing gives them an acceleration"
    else:
        rows = [equations.row_names[i] for i in np.flatnonzero(null[n:] > PART)]
        what = f"closings that depend on each other ({', '.join(rows[:3])})"
    message = f"found 'idas' and {what}, accepted: {OTHERS}"
    raise SceneError(message, ("analysis", "integrator"))


def _null(matrix: Array) -> Array | None:
    """Absolute components, up to 1, of a vector that the matrix takes to rounding; None where there is none."""
    scale = np.ones(len(matrix))
    for _ in range(EQUILIBRATED):
        rows = np.abs(scale[:, None] * matrix * scale).max(axis=1, initial=0.0)
        scale /= np.sqrt(np.where(rows > 0.0, rows, 1.0))
    shifted = scale[:, None] * matrix * scale + SINGULAR * np.eye(len(matrix))
    right = np.random.default_rng(0).standard_normal(len(matrix))
    found = np.abs(np.array(ca.solve(ca.sparsify(ca.DM(shifted)), right, LINEAR)).ravel())
    largest = float(found.max(initial=0.0))
    if np.isfinite(largest) and largest * SINGULAR < 1e-2:
        return None
    unscaled = found * scale
    return np.asarray(unscaled / unscaled.max())


EQUILIBRATED = 8
"""Rounds that bring the largest entry of each row near to one."""


def _without_inertia(equations: Equations, unknowns: Array) -> str:
    """Sections without rotary inertia, or else the members and nodes whose rotations and places have none."""
    model, scene = equations.model, equations.model.scene
    turning = set(np.flatnonzero(np.isin(equations.number, unknowns).any(axis=1)).tolist())
    along = {name: model.chain(name).tolist() for name in model.members if name in model.beams.first}
    ends = model.rotations.ends
    members = [name for name in scene.members if turning & set(along.get(name, ends[name]))]
    sections = dict.fromkeys(str(scene.members[name].section) for name in members if scene.members[name].section)
    light = [name for name in sections if not scene.sections[name].inertia(np.linspace(0.0, 1.0, 3)).any()]
    if light:
        return f"sections without 'rhoI' ({', '.join(light)})"
    y, axes = model.positions.Y, model.element.axes
    moving = np.unique(y.row[np.isin(equations.turning_unknowns + y.column, unknowns)] // axes)
    names = [*members, *(model.segments.places[i] for i in moving)]
    return f"what has no inertia ({', '.join(names)})"
