"""Centres of mass that are off the line of a member, and masses of elements whose tangents change with the curvature.

With the arm ``a`` of the centre of mass in the axes ``R_0`` of the section, that of a node is at ``x + R(q) R_0 a``.
There its weight acts, which is the potential ``-m g.(R(q) - 1) R_0 a`` beside that of the same weight on the line, and
there it has its inertia: the places of the centres are quantities whose rates count (see
:mod:`~sfetcas.mechanics.observed`), one vector for each node of an element,

    X_k = x_k + u_1 + sum_j w_kj (t_j - t_j0) + R(q_k) R_0 a_k,

with the turned and strained tangents ``t_j`` of the points, the weights of their integrals to the nodes, and the
displacement ``u_1`` of the place at the start of the element.

What acts at the centre is on the line the same force, and a couple along the element.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, numbers
from .elements import Element
from .load_terms import carried
from .loading import Loading
from .mesh import within_elements
from .parts import Parts
from .terms import Discrete, One, Side, Term

__all__ = ["CentredWeight", "MassPoints", "along_elements", "arms_of", "center_weights_in"]


@final
@dataclass(frozen=True)
class MassPoints(Term):
    """Points that the nodes of an element carry, at the ends of arms that turn with them; see :meth:`arms`.

    Data: of each node its place relative to the start of the element in the undeformed scene and its arm, then tangents
    and compliances of the element; dimensionless, fixed axes.

    Attributes
    ----------
    element : Element
        The element, which integrates at its nodes.
    """

    along_element: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """All rotations of the element, the place at its start, and its strains; a row for each component."""
        n, strains, *_ = self.element.sizes
        return n, 1 + strains, n * self.axes, 2 * n * self.axes + self.element.line_data, 0

    @property
    def vectors(self) -> int:
        """One for each node."""
        return self.element.order + 1

    @property
    def from_place(self) -> int:
        """All of them."""
        return self.vectors

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Where the points are, relative to the undeformed start of the element."""
        n, axes = self.vectors, self.axes
        rest, line = ca.reshape(data[: n * axes], axes, n), data[2 * n * axes :]
        gained = ca.horzcat(*self.element.tangents(q, u[1:], line)) - self.element.line(line)[0]
        onto = ca.DM(self.element.to_points / self.element.weights)
        # The first node is the place itself.
        moved = rest + ca.repmat(ca.vertcat(*u[0]), 1, n) + ca.mtimes(gained, ca.sparsify(onto.T))
        return ca.vertsplit(ca.vec(moved + ca.horzcat(*self.arms(q, data))))

    def arms(self, q: list[Side], data: ca.SX) -> list[ca.SX]:
        """The turned arms of the nodes."""
        n, axes = self.vectors, self.axes
        arms = ca.reshape(data[n * axes : 2 * n * axes], axes, n)
        return [ca.vertcat(*self.forth(q[k], ca.vertsplit(arms[:, k]))) for k in range(n)]


@final
@dataclass(frozen=True)
class CentredWeight(Term):
    """What the weight of an element does to its rotations as it acts at the centre of mass, beside that on the line.

    Data: masses times arms of the nodes, fixed axes of the undeformed scene; load: gravity.

    Attributes
    ----------
    nodes : int
    """

    is_load: ClassVar[bool] = True
    along_element: ClassVar[bool] = True

    nodes: int

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element."""
        return self.nodes, 0, 0, self.axes * self.nodes, self.axes

    @property
    def discrete(self) -> Discrete:
        """Vectors that turn with the nodes."""
        return "ends"

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus the weight times what the centres move by turning."""
        found = ca.SX(0)
        for now, rest in self._arms(q, data):
            found -= ca.dot(now - rest, load)
        return found

    def densities(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
        """Couples at the nodes, and no forces beside those on the line."""
        couples = [
            ca.cross(now, load) if self.space else now[0] * load[1] - now[1] * load[0] for now, _ in self._arms(q, data)
        ]
        return [ca.SX.zeros(self.axes * self.nodes)], couples

    def _arms(self, q: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        """Masses times arms, turned and as they were."""
        parts = [data[self.axes * k : self.axes * (k + 1)] for k in range(self.nodes)]
        turned = [ca.vertcat(*self.forth(side, ca.vertsplit(part))) for side, part in zip(q, parts, strict=True)]
        return list(zip(turned, parts, strict=True))


def arms_of(scene: Any, member: str, x: Array) -> Array:
    """Arms (n, 3), m, of the centre of mass at fractions x (n,) of a member, fixed axes of the undeformed scene."""
    section = scene.sections[str(scene.members[member].section)]
    return quaternion.rotate(scene.center_lines[member].quaternions(x), section.mass_arm(x))


def center_weights_in(parts: Parts) -> Iterator[One]:
    """A term for each element of a member whose centre of mass is off its line, where there is gravity.

    Raises
    ------
    SceneError
        The elements do not integrate at their nodes.
    """
    scene, element = parts.scene, parts.element
    if scene.gravity is None or not any(scene.gravity):
        return
    for name, member in scene.members.items():
        if not member.overhangs(scene.sections):
            continue
        if element.gauss:
            raise SceneError("centres of mass off the line need integration at the nodes, found Gauss integration")
        cuts, first = parts.mesh.cuts[name], parts.beams.first[name]
        x = within_elements(cuts, element.points)
        mass = scene.sections[str(member.section)].mass(x.ravel())
        lever = (mass[:, None] * arms_of(scene, name, x.ravel()))[:, : element.axes].reshape(*x.shape, -1)
        kind, unit = CentredWeight(element.space, element.order + 1), parts.scales.length / parts.scales.moment
        gravity = numbers(scene.gravity)[: element.axes]
        for e in range(len(x)):
            data = (lever[e] * (parts.beams.weight[first + e] * unit)[:, None]).ravel()
            turns = tuple(parts.rotations.turns[first + e].tolist())
            yield One(kind, f"element {first + e}", "", data, turns, loads={None: gravity}, element=first + e)


def along_elements(model: Any, q: Array, loading: Loading, shares: Sequence[tuple[Index, Array, Array]]) -> Loading:
    """The loads with forces at the ends of arms along elements added, dimensionless.

    Parameters
    ----------
    q : ndarray (rotations, components)
    loading : Loading
    shares : of numbers (n,) of elements, arms (n, nodes, axes) and forces (n, nodes, axes)
    """
    if not shares:
        return loading
    spread, torque = np.zeros_like(loading.spread), loading.torque.copy()
    for elements, arms, forces in shares:
        a = quaternion.turned_by(q[model.rotations.turns[elements]], arms)
        in_plane = (a[..., 0] * forces[..., 1] - a[..., 1] * forces[..., 0])[..., None]
        np.add.at(spread, elements, forces)
        np.add.at(torque, elements, np.cross(a, forces) if model.space else in_plane)
    pull, on_places = carried(spread, model.segments, model.element)
    return replace(
        loading,
        force=loading.force + on_places,
        spread=loading.spread + spread,
        pull=loading.pull + pull,
        torque=torque,
    )
