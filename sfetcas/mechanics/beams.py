"""Units of a model, and the data of its elements."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..description.scene import Scene
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from .elements import Element
from .mesh import Mesh

__all__ = ["ELEMENT_DATA", "Beams", "Scales", "beams_of", "in_fixed_axes", "load_size", "scales_of"]


@dataclass(frozen=True)
class Scales:
    """Units of a model, by which its dimensionless numbers are multiplied: length (m), moment or energy (N m)."""

    length: float
    moment: float

    @property
    def force(self) -> float:
        """Unit of force, N."""
        return self.moment / self.length

    def of(self, unit: str) -> float:
        """The SI value of the dimensionless number 1 of a quantity in ``m``, ``N``, ``N m``, ``J`` or ``rad``."""
        return {"m": self.length, "N": self.force, "N m": self.moment, "J": self.moment, "rad": 1.0, "1": 1.0}[unit]


@dataclass(frozen=True, eq=False)
class Beams:
    """Data of the elements of all flexible and rigid members, dimensionless.

    Attributes
    ----------
    stiffness : ndarray (elements, points, stiffnesses)
        Stiffness times weight over length at the integration points, fixed axes of the undeformed scene: the upper
        triangle of a symmetric 3 x 3 matrix, in the plane one number.
    tangent : ndarray (elements, points, axes)
        Tangent of the unloaded centre line times weight times length.
    weight : ndarray (elements, points)
        Weight of the integration point times length of the element.
    compliance : ndarray (elements, points, axes * axes or more)
        Changes of the tangent by the scaled strains of a point, fixed axes of the undeformed scene, column by column:
        along the member, then across it; zero where it is stiff.  Of length zero where nothing stretches.  Where a
        section couples forces with moments, columns follow for the change of the curvature times length.
    first : dict
        Number of the first element of each member.
    """

    stiffness: Array
    tangent: Array
    weight: Array
    compliance: Array
    first: dict[str, int]

    def flat(self, *names: str) -> Array:
        """Data of all elements by their names, one after the other, (elements, data)."""
        parts = (getattr(self, name) for name in names)
        return np.hstack([part.reshape(len(part), int(np.prod(part.shape[1:]))) for part in parts])


ELEMENT_DATA = ("stiffness", "tangent", "compliance")
"""Data of the elements, in the order in which their functions take them."""


def scales_of(scene: Scene) -> Scales:
    """Units for a scene, from its longest member and its largest stiffness (else springs, loads, or its speed)."""
    length = max(line.length for line in scene.center_lines.values())
    x = np.linspace(0.0, 1.0, 5)
    found = []
    for name, member in scene.members.items():
        if member.section is not None and member.type != "rigid":
            found.append(float(np.nanmax(scene.sections[member.section].stiffness(x))) / length)
        elif member.stiffness is not None:
            turning = np.abs(np.diag(np.asarray(member.stiffness)).reshape(-1, 2, 3)[:, 1]).max()
            found.append(float(turning) * scene.center_lines[name].length / length)
    for tube in scene.tubes.values():
        found.append(float(np.nanmax(scene.sections[tube.section].stiffness(x))) / length)
    found = found or [spring.stiffness for spring in scene.springs.values() if spring.type == "rotational"]
    found = found or [spring.stiffness * length**2 for spring in scene.springs.values()]
    found = found or [tendon.stiffness * length**2 for tendon in scene.tendons.values() if tendon.stiffness is not None]
    moment = max(found, default=0.0) or load_size(scene, length) or moving_size(scene, length) or 1.0
    return Scales(length, moment)


def load_size(scene: Scene, length: float) -> float:
    """Magnitude of the loads as moments, N m, with a length in m as lever; zero without loads."""
    # No squares: a load may be as large as any number.
    forces, moments, spread = (
        [math.hypot(*load.vector) for load in scene.loads.values() if load.type == kind]
        for kind in ("force", "moment", "distributed")
    )
    strength = sum(field.size for field in scene.fields.values())
    moments += [
        strength * math.hypot(*magnet.vector) * (1.0 if magnet.member is None else length)
        for magnet in scene.magnets.values()
    ]
    forces += [abs(tendon.force) for tendon in scene.tendons.values() if not tendon.measured]
    weight = 0.0 if scene.gravity is None else _heaviest(scene) * math.hypot(*scene.gravity)
    return max([*(force * length for force in [*forces, weight]), *moments, *(q * length**2 for q in spread)])


def moving_size(scene: Scene, length: float) -> float:
    """Energy, N m, at the largest speed at the begin, or at that of a length, m, in the whole motion; else zero."""
    if scene.analysis.type != "dynamic":
        return 0.0
    speeds = [math.hypot(*node.velocity) for node in scene.nodes.values() if node.velocity is not None]
    spins = (member.spin for member in scene.members.values() if isinstance(member.spin, float | tuple))
    speeds += [length * float(np.linalg.norm(np.atleast_1d(spin))) for spin in spins]
    return _heaviest(scene) * (max(speeds, default=0.0) or length / scene.analysis.duration) ** 2


def _heaviest(scene: Scene) -> float:
    """The largest mass of a node or a member, kg."""
    masses = [node.mass for node in scene.nodes.values()]
    for name, member in scene.members.items():
        if member.section is not None:
            masses.append(
                float(scene.sections[member.section].mass(np.array([0.5]))[0]) * scene.center_lines[name].length
            )
    return max(masses, default=0.0)


def beams_of(scene: Scene, mesh: Mesh, element: Element, scales: Scales) -> Beams:
    """Data of the elements of all members; small members have no elements."""
    members = {name: member for name, member in scene.members.items() if member.type != "small"}
    cuts = {name: mesh.cuts[name] for name in members}
    lengths = {name: scene.center_lines[name].length / scales.length * np.diff(own) for name, own in cuts.items()}
    along = {name: own[:-1, None] + np.diff(own)[:, None] * element.points for name, own in cuts.items()}
    counts, n = [len(own) for own in lengths.values()], element.order + 1
    first = dict(zip(members, np.cumsum([0, *counts])[:-1].tolist(), strict=True))
    length = np.concatenate([np.zeros(0), *lengths.values()])
    weight = length[:, None] * element.weights
    turned = [np.zeros((0, 4)), *(scene.center_lines[name].quaternions(x.ravel()) for name, x in along.items())]
    frames = quaternion.matrix(np.concatenate(turned))
    # Integrals over xi of squares of derivatives by xi: weight over length.
    per_length = (element.weights / length[:, None])[..., None]
    stiffness = _stiffness(scene, along, frames, element, scales.moment * scales.length)
    compliance, begin = [np.zeros((0, n, element.compliances))], 0
    for name, x in along.items():
        own = slice(begin, begin + x.size)
        begin += x.size
        compliance.append(np.zeros((*x.shape, element.compliances)))
        if element.yielding and (members[name].stretches(scene.sections) or members[name].shifted(scene.sections)):
            w = weight[first[name] : first[name] + len(x)].ravel()
            columns = _columns(scene, name, x.ravel(), frames[own], element, scales, w)
            compliance[-1] = columns.transpose(0, 2, 1).reshape(*x.shape, -1)
    return Beams(
        stiffness=stiffness.reshape(-1, n, element.stiffnesses) * per_length,
        tangent=frames[:, : element.axes, 0].reshape(-1, n, element.axes) * weight[..., None],
        weight=weight,
        compliance=np.concatenate(compliance),
        first=first,
    )


def _stiffness(scene: Scene, along: Mapping[str, Array], frames: Array, element: Element, unit: float) -> Array:
    """Stiffness (points, numbers), over a unit, N m2, of members at fractions of their lengths, in the fixed axes.

    Sections are asked once for all of their members; what is rigid has none.
    """
    members, shared = scene.members, dict[tuple[str, int], list[str]]()
    for name in along:
        if members[name].type == "flexible":
            axis = 0 if element.space else scene.center_lines[name].bending_axis
            shared.setdefault((str(members[name].section), axis), []).append(name)
    found = {name: np.zeros((x.size, element.stiffnesses)) for name, x in along.items()}
    begins = dict(zip(along, np.cumsum([0, *(x.size for x in along.values())]).tolist(), strict=False))
    for (key, axis), names in shared.items():
        section, x = scene.sections[key], np.concatenate([along[name].ravel() for name in names])
        values = section.stiffness_matrix(x) if element.space and section.coupled else section.stiffness(x)
        own = np.concatenate([begins[name] + np.arange(along[name].size) for name in names])
        turned = in_fixed_axes(values / unit, frames[own], element, axis)
        ends = np.cumsum([0, *(along[name].size for name in names)]).tolist()
        found |= {name: turned[a:b] for name, (a, b) in zip(names, itertools.pairwise(ends), strict=True)}
    return np.concatenate([np.zeros((0, element.stiffnesses)), *found.values()])


def _columns(
    scene: Scene, name: str, x: Array, frames: Array, element: Element, scales: Scales, weight: Array
) -> Array:
    """Changes of the tangents of a member (points, axes, numbers), as of :attr:`Beams.compliance`."""
    section, line = scene.sections[str(scene.members[name].section)], scene.center_lines[name]
    strained, found = line.strained_axes(element.space), list[Array]()
    onto = frames[:, : element.axes, strained]
    if element.strains:
        if section.matrix:
            soft = section.compliance_of_forces(x)[:, strained][:, :, strained] * scales.force
            found.append(np.einsum("nij,njk->nik", onto, _root(weight[:, None, None] * soft)))
        else:
            found.append(
                onto * np.sqrt(weight[:, None] * section.compliance(x)[:, strained] * scales.force)[:, None, :]
            )
    if element.shifted and section.shifted:
        arms = (
            section.arms(x)[:, strained]
            * (np.tile(element.weights, len(x) // len(element.weights)) / scales.length)[:, None, None]
        )
        about = frames[:, 3 - element.turns :]
        found.append(np.einsum("nij,njk,nlk->nil", onto, arms, about))
    elif element.shifted:
        found.append(np.zeros((len(x), element.axes, element.turns)))
    return np.concatenate(found, axis=2)


def _root(matrices: Array) -> Array:
    """Lower triangular roots (n, k, k) of positive definite matrices: ``L L^T``; of two or three rows, also symbols."""
    size, nothing = matrices.shape[1], np.zeros(len(matrices))
    rows: list[list[Array]] = []
    for i in range(size):
        row: list[Array] = []
        for j in range(i + 1):
            other = row if i == j else rows[j]
            rest = sum((row[k] * other[k] for k in range(j)), nothing)
            rest = matrices[:, i, j] - rest
            row.append(np.sqrt(rest) if i == j else rest / rows[j][j])
        rows.append([*row, *[nothing] * (size - i - 1)])
    return np.stack([entry for row in rows for entry in row], axis=1).reshape(len(matrices), size, size)


def in_fixed_axes(values: Array, frames: Array, element: Element, bending_axis: int) -> Array:
    """Stiffness (n, 3) or (n, 3, 3) about b1, b2, b3 in the fixed axes: upper triangles (n, 6), or about z (n, 1)."""
    if not element.space:
        return values[:, 1:2] if bending_axis == 2 else values[:, 2:3]
    if values.ndim == 3:
        full = np.einsum("nij,njl,nkl->nik", frames, values, frames)
    else:
        full = np.einsum("nij,nj,nkj->nik", frames, values, frames)
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
