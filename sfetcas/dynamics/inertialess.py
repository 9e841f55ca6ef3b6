"""Checks for unknowns without inertia: index-1 integrators cannot treat them, others need stiffness against them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..description.sections import HEAVY
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations
from ..mechanics.rotations import end_joints

__all__ = ["check_balanced", "check_inertia", "check_resisted", "refuse_spinning", "spinning"]

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
    if equations.model.scene.relaxes:
        message = "found 'idas', but what relaxes in members has no inertia of its own"
        raise SceneError(f"{message}, accepted: {OTHERS}", ("analysis", "integrator"))
    scene = equations.model.scene
    for found, what in ((scene.tubes, "the twist of tubes has"), (scene.rings, "where rings are has")):
        if found:
            message = f"found 'idas', but {what} no inertia of its own"
            raise SceneError(f"{message}, accepted: {OTHERS}", ("analysis", "integrator"))
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


def check_balanced(equations: Equations, matrix: Array, forces: Array) -> None:
    """Refuse a motion that begins with forces on what has neither inertia nor damping, which would have to jump.

    Parameters
    ----------
    matrix : ndarray (unknowns, any)
        Mass, damping and transposed constraint matrices side by side, dimensionless.
    forces : ndarray (unknowns,)
        Sum of the other forces at the beginning.

    Raises
    ------
    SceneError
        Names members or nodes.
    """
    sizes = np.abs(matrix).max(axis=0, initial=0.0)
    columns = matrix[:, sizes > 0.0] / sizes[sizes > 0.0]
    left = forces - columns @ np.linalg.lstsq(columns, forces, rcond=None)[0]
    open_ones = np.flatnonzero(np.abs(left) > UNBALANCED * np.abs(forces).max(initial=0.0))
    if len(open_ones):
        names = ", ".join(_where(equations, open_ones))
        accepted = "accepted: a mass there, initial = 'equilibrium', or loads with a history that begins with zero"
        raise SceneError(f"forces at t = 0 act on what has no inertia, at {names}, and it would jump, {accepted}")


UNBALANCED = 1e-6
"""Share of the largest force at the beginning above which a force is not in balance: equilibria are to 1e-9."""


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
    scene = equations.model.scene
    found = [scene.members[name] for name in _where(equations, unknowns) if name in scene.members]
    sections = dict.fromkeys(str(member.section) for member in found if member.section)
    light = [name for name in sections if not scene.sections[name].inertia(np.linspace(0.0, 1.0, 3)).any()]
    if light:
        sections_of = "section" if len(light) == 1 else "sections"
        return (
            f"without 'rhoI' of the {sections_of} {', '.join(light)} some rotations have no inertia",
            f"'rhoI', or {OTHERS}",
        )
    return f"what turns or moves at {', '.join(_where(equations, unknowns))} has no inertia", OTHERS


def _where(equations: Equations, unknowns: Array) -> list[str]:
    """Members along which unknowns turn, and places that they move."""
    model, scene = equations.model, equations.model.scene
    turning = set(np.flatnonzero(np.isin(equations.number, unknowns).any(axis=1)).tolist())
    along = {name: model.chain(name).tolist() for name in model.members if name in model.beams.first}
    members = [name for name in scene.members if turning & set(along.get(name, model.rotations.ends[name]))]
    y, axes = model.positions.Y, model.element.axes
    moving = np.unique(y.row[np.isin(equations.rotation_unknowns + y.column, unknowns)] // axes)
    # Strains stand for their member.
    segments = model.segments
    owners = {
        segments.places[i]: part.member
        for part in segments.parts
        for i in [*segments.strains[part.elements].flat, *segments.relaxing[:, :, part.elements].flat]
        if i >= 0
    }
    places = [model.segments.places[i] for i in moving]
    return list(dict.fromkeys([*members, *(owners.get(name, name) for name in places)]))


def spinning(scene: Scene) -> list[str]:
    """Straight members that impacts would spin about themselves without inertia, in space.

    What resists is a clamp, or a body at a node, to which they are rigidly joined, and members in other directions.
    """
    held = {name for name, node in scene.nodes.items() if node.support == "clamped" or any(node.inertia or ())}
    stiff = {
        name: [node for node, joint in end_joints(scene, member) if joint == "rigid"]
        for name, member in scene.members.items()
    }
    along = {name: scene.center_lines[name].tangents(np.array([0.5]))[0] for name in stiff}
    for name, ends in stiff.items():
        if scene.center_lines[name].turning > LEVEL:
            held |= set(ends)
        others = (other for other in stiff if set(ends) & set(stiff[other]))
        if any(np.linalg.norm(np.cross(along[name], along[other])) > LEVEL for other in others):
            held |= set(ends)
    fixed = set[str]()
    while more := {name for name, ends in stiff.items() if name not in fixed and held & set(ends)}:
        fixed |= more
        held |= {node for name in more for node in stiff[name]}
    light = list[str]()
    for name, member in scene.members.items():
        section = scene.sections.get(str(member.section))
        bent = scene.center_lines[name].turning > LEVEL
        if not (name in fixed or bent or section is None or (section.inertia(HEAVY)[:, 0] > 0.0).all()):
            light.append(name)
    return light


def refuse_spinning(scene: Scene) -> None:
    """Refuse a scene in space with members that impacts would spin about themselves.

    Raises
    ------
    SceneError
        Names the section of the first.
    """
    for name in spinning(scene)[:1] if scene.resolved_dimension == "space" else []:
        message = "found one without inertia about its axis, about which impacts would spin the member, accepted:"
        raise SceneError(f"{message} a section with rhoI, or with a shape and rho", ("members", name, "section"))


LEVEL = 1e-6
"""Angle between members, rad, that is none."""
