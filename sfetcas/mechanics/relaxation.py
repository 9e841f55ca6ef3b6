"""Relaxation of members as terms: branches of a spring in series with a damper, beside the stiffness of the section.

Each branch has at each integration point the part of the change of curvature that has relaxed, ``kappa_r``, and where
the member stretches or shears that of the strains.  With the stiffness ``K`` of the branch and its time ``tau``

    stored: 1/2 (kappa - kappa_r).K (kappa - kappa_r),      dissipated: 1/2 tau kappa_r'.K kappa_r',

so that its moment ``m = K (kappa - kappa_r)`` obeys ``m' + m / tau = K kappa'``.  What has relaxed is scaled by a root
of the stiffness, ``xi = A kappa_r`` with ``A^T A = K`` times weight and length: the energy is ``1/2 |A kappa - xi|^2``,
and the damper the same for all components.  In equilibrium ``xi = A kappa``: there branches are left out.

Source: Simo and Hughes 1998, Computational Inelasticity, chapter 10 (generalised Maxwell solid).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.relaxation import shares_of
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers, values_of
from .elements import element_by_name
from .mesh import within_elements
from .parts import Parts
from .terms import One, Side, Term, name_of

__all__ = ["Bending", "Straining", "carried", "relax", "relaxations_in", "strain_units"]


@final
@dataclass(frozen=True)
class Bending(Term):
    """One branch along an element; data: the matrices ``A`` of its points over its length, column by column.

    Attributes
    ----------
    nodes : int
        Nodes of the element.
    gauss : bool
        Whether the element integrates at Gauss points.
    """

    along_element: ClassVar[bool] = True
    strains_member: ClassVar[bool] = True

    nodes: int
    gauss: bool

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, and for each point a place that holds what has relaxed."""
        return self.nodes, self.nodes, 0, self.nodes * self.turns**2, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Sum over the points."""
        left = [ca.vertcat(*side)[: self.turns] for side in u]
        return sum((0.5 * ca.sumsqr(a - b) for a, b in zip(self.strains(q, data), left, strict=True)), ca.SX(0))

    def strains(self, q: list[Side], data: ca.SX) -> list[ca.SX]:
        """Scaled changes of the curvature (turns,) at each point, which in equilibrium have relaxed."""
        roots = ca.reshape(data, self.turns**2, self.nodes)
        element = element_by_name(f"SFET{self.nodes}", self.space, self.gauss)
        bent = element.changes(q)
        return [ca.mtimes(ca.reshape(roots[:, k], self.turns, self.turns), one) for k, one in enumerate(bent)]

    @functools.cached_property
    def relaxed(self) -> ca.Function:
        """``(q, data) ->`` :meth:`strains`, (turns, points)."""
        q, data = ca.SX.sym("q", self.components, self.nodes), ca.SX.sym("data", self.sizes[3])
        found = ca.horzcat(*self.strains([ca.vertsplit(side) for side in ca.horzsplit(q)], data))
        return ca.Function(f"relaxed_{name_of(self)}", [q, data], [ca.densify(found)])


@final
@dataclass(frozen=True)
class Straining(Term):
    """One branch of stretch and shear at a point: the places hold scaled strains, and what of them has relaxed.

    Data: root of the stiffness of the branch over that of the section.
    """

    strains_member: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Two places."""
        return 0, 2, 0, 1, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the square of what has not relaxed."""
        strain, left = (ca.vertcat(*side) for side in u)
        return 0.5 * ca.sumsqr(data[0] * strain - left)


def relaxations_in(parts: Parts) -> Iterator[One]:
    """The terms of all branches of a model for motions or vibrations; none where everything is in equilibrium."""
    relaxing = parts.segments.relaxing
    for name, first in parts.beams.first.items():
        branches = parts.scene.members[name].branches(parts.scene.sections)
        count, element = len(parts.mesh.cuts[name]) - 1, parts.element
        if not branches or not relaxing.shape[1]:
            continue
        kind, straining = Bending(element.space, element.order + 1, element.gauss), Straining(element.space)
        roots = _roots(parts, name)
        for i, share in enumerate(shares_of(branches)):
            root = np.sqrt(numbers(share))
            for e in range(first, first + count):
                turns, places = tuple(parts.rotations.turns[e].tolist()), tuple(relaxing[0, i, e].tolist())
                data = numbers((roots[e - first] * root).reshape(-1))
                yield One(kind, name, "", data, turns, places, element=e)
                if relaxing[1, i, e, 0] < 0:
                    continue
                for pair in zip(parts.segments.strains[e].tolist(), relaxing[1, i, e].tolist(), strict=True):
                    yield One(straining, name, "", np.reshape(root, (1,)), (), pair, element=e)


def _roots(parts: Parts, name: str) -> Array:
    """Transposed roots of the stiffness of a member's section, (elements, points, turns, turns), dimensionless.

    They give scaled changes of the curvature from those times the length of the element, about the fixed axes.
    """
    scene, element, scales = parts.scene, parts.element, parts.scales
    cuts, line = parts.mesh.cuts[name], scene.center_lines[name]
    section = scene.sections[str(scene.members[name].section)]
    x = within_elements(cuts, element.points).ravel()
    length = (line.length / scales.length * np.diff(cuts))[:, None]
    weights = np.sqrt(((element.weights / length) / (scales.moment * scales.length)).ravel())
    size = len(cuts) - 1, len(element.points), element.turns, element.turns
    if not element.space:
        own = np.sqrt(section.stiffness(x)[:, line.bending_axis - 1])
        return numbers((own * weights).reshape(size))
    frames = quaternion.matrix(line.quaternions(x))
    roots = _cholesky(section.stiffness_matrix(x)) if section.coupled else _diagonal(np.sqrt(section.stiffness(x)))
    return numbers((np.einsum("nij,njk->nik", frames, roots) * weights[:, None, None]).reshape(size))


def _diagonal(values: Array) -> Array:
    return values[:, :, None] * np.eye(3)


def _cholesky(matrices: Array) -> Array:
    """Lower triangles (n, 3, 3) whose products with their transposes are given matrices, by formulas."""
    a, b, c = (matrices[:, i, 0] for i in range(3))
    first = np.sqrt(a)
    across, last = b / first, c / first
    second = np.sqrt(matrices[:, 1, 1] - across**2)
    mixed = (matrices[:, 2, 1] - last * across) / second
    third = np.sqrt(matrices[:, 2, 2] - last**2 - mixed**2)
    nothing = 0.0 * first
    rows = (first, nothing, nothing, across, second, nothing, last, mixed, third)
    return numbers(np.stack(rows, axis=1).reshape(len(first), 3, 3))


def relax(model: Any, q: Array, y: Array) -> None:
    """Set what has relaxed, among the displacement unknowns ``y`` of a model, to its equilibrium, in place.

    ``q`` are rotations (rotations, components); strains are those of ``y``.
    """
    retained, axes = model.positions.retained, model.element.axes
    for group in model.connections:
        kind = group.kind
        if isinstance(kind, Bending):
            found = kind.relaxed.map(len(group.data))(q[group.turns].reshape(-1, q.shape[1]).T, values_of(group.data).T)
            places = retained[group.places].reshape(-1, axes)[:, : kind.turns]
            y[places] = found.full().T
        elif isinstance(kind, Straining):
            strain, left = retained[group.places].transpose(1, 0, 2)
            y[left[left >= 0]] = (np.append(y, 0.0)[strain] * values_of(group.data))[left >= 0]


def carried(model: Any, member: str, q: Array, y: Array) -> tuple[Array, Array] | None:
    """What the branches of a member carry at its integration points; None in equilibrium, where they carry nothing.

    Returns
    -------
    moment : (elements, points, 3)
        Of all branches, fixed axes of the undeformed scene, dimensionless.
    strain : (elements, points, 3)
        What the section forces of all branches would strain the section of the long-term stiffness, along its axes.
    """
    if not model.segments.relaxing.shape[1]:
        return None
    part = model.elements_of(member)
    weight, unit = model.beams.weight[part], strain_units(model, member)
    moment, strain = np.zeros((*weight.shape, 3)), np.zeros((*weight.shape, 3))
    values = np.append(y, 0.0)[model.positions.retained]
    for group in model.connections:
        kind, own = group.kind, np.flatnonzero((group.elements >= part.start) & (group.elements < part.stop))
        e = group.elements[own] - part.start
        if isinstance(kind, Bending) and len(own):
            turns, data = kind.turns, values_of(group.data)[own]
            scaled = kind.relaxed.map(len(own))(q[group.turns[own]].reshape(-1, q.shape[1]).T, data.T).full().T
            left = scaled.reshape(len(own), -1, turns) - values[group.places[own]][:, :, :turns]
            # Matrices stand column by column.
            matrices = data.reshape(len(own), -1, turns, turns)
            share = weight / weight.sum(axis=1, keepdims=True)
            np.add.at(moment[..., 3 - turns :], e, np.einsum("nkji,nki->nkj", matrices, left) / share[e][..., None])
        elif isinstance(kind, Straining) and len(own):
            eta, left = values[group.places[own]].transpose(1, 0, 2)
            root = values_of(group.data)[own]
            point = np.argmax(model.segments.strains[part][e] == group.places[own][:, :1], axis=1)
            chosen = model.scene.center_lines[member].strained_axes(model.space)
            np.add.at(strain, (e[:, None], point[:, None], chosen), root * (root * eta - left) * unit[e, point])
    return moment, strain


def strain_units(model: Any, member: str) -> Array:
    """Strains (elements, points, axes) of a member for scaled strains of one."""
    cuts, line = model.mesh.cuts[member], model.scene.center_lines[member]
    x = within_elements(cuts, model.element.points)
    section = model.scene.sections[str(model.scene.members[member].section)]
    compliance = section.compliance(x.ravel())[:, line.strained_axes(model.space)] * model.scales.force
    weight = model.beams.weight[model.elements_of(member)]
    return np.asarray(np.sqrt(compliance.reshape(*x.shape, -1) / weight[..., None]))
