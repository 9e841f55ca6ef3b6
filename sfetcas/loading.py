"""Loads and motions of a scene on a mesh, in the units of the model.

Every load is a share of a :class:`Loading`; loads and motions with the same history are one of them, times a
factor.  What acts along a member is put to its first node, and the internal force that it causes on the way
there is the pull of the elements before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .arrays import Array
from .elements import Element
from .errors import SceneError
from .mesh import Mesh
from .rotations import Rotations
from .scene import Load, Motion, Scene
from .sections import evaluate
from .segments import Segments

__all__ = ["Beams", "Loading", "Scales", "unit_loadings"]


@dataclass(frozen=True)
class Scales:
    """Units of a model: length (m), force (N) and moment or energy (N m)."""

    length: float
    moment: float

    @property
    def force(self) -> float:
        """Unit of force, N."""
        return self.moment / self.length


@dataclass(frozen=True, eq=False)
class Beams:
    """What the elements of all members are made of, dimensionless.

    Attributes
    ----------
    stiffness : ndarray (elements, points, stiffnesses)
        Stiffness times weight over length, fixed axes of the undeformed scene.
    tangent : ndarray (elements, points, axes)
        Tangent of the unloaded centre line times weight times length.
    weight : ndarray (elements, points)
        Weight times length.
    first : dict
        Number of the first element of a member.
    """

    stiffness: Array
    tangent: Array
    weight: Array
    first: dict[str, int]


@dataclass(frozen=True)
class Loading:
    """Loads and motions of one load factor, dimensionless.

    Attributes
    ----------
    force : ndarray (places, axes)
        Dead forces on places, and the resultants of the loads along segments, put to their first places.
    own : ndarray (places, axes)
        The share of ``force`` that acts on the places themselves.
    couple : ndarray (rotations,)
        Moments about z on rotations; plane only.
    pull : ndarray (elements, points, axes)
        Minus the internal force at the integration points that the loads along the member cause.
    spread : ndarray (elements, points, axes)
        Distributed force times weight times length; what ``pull`` was made of, for section forces.
    shift : ndarray (places * axes,)
        Prescribed displacements, zero for places that are free.
    turn : ndarray (rotations, 3)
        Prescribed rotation vectors of held rotations.
    """

    force: Array
    own: Array
    couple: Array
    pull: Array
    spread: Array
    shift: Array
    turn: Array

    def scaled(self, factor: float) -> Loading:
        """All loads and motions times a factor."""
        return Loading(*(factor * getattr(self, name) for name in PARTS))

    def unloaded(self) -> Loading:
        """The motions alone."""
        zero = {name: np.zeros_like(getattr(self, name)) for name in ("force", "own", "couple", "pull", "spread")}
        return replace(self, **zero)

    def plus(self, other: Loading) -> Loading:
        """The sum of two loadings."""
        return Loading(*(getattr(self, name) + getattr(other, name) for name in PARTS))


PARTS = ("force", "own", "couple", "pull", "spread", "shift", "turn")


@dataclass(frozen=True, eq=False)
class _Writer:
    """Everything that it takes to turn a load into shares of a loading."""

    scene: Scene
    mesh: Mesh
    element: Element
    scales: Scales
    segments: Segments
    rotations: Rotations
    beams: Beams

    def empty(self) -> Loading:
        """No load and no motion."""
        places, turns = len(self.segments.places), len(self.rotations.kind)
        along = (*self.beams.weight.shape, self.element.axes)
        return Loading(
            force=np.zeros((places, self.element.axes)),
            own=np.zeros((places, self.element.axes)),
            couple=np.zeros(turns),
            pull=np.zeros(along),
            spread=np.zeros(along),
            shift=np.zeros(places * self.element.axes),
            turn=np.zeros((turns, 3)),
        )

    def elements_of(self, member: str) -> slice:
        start = self.beams.first[member]
        return slice(start, start + len(self.mesh.cuts[member]) - 1)

    def places(self, member: str) -> Array:
        """Fractions of the length of the integration points of a member, (elements, points)."""
        cuts = self.mesh.cuts[member]
        return np.asarray(cuts[:-1, None] + np.diff(cuts)[:, None] * self.element.points)

    def cut(self, load: Load) -> int:
        """Number of the cut of the member at which a load acts."""
        return int(np.argmin(np.abs(self.mesh.cuts[str(load.member)] - (load.at or 0.0))))

    def vector(self, vector: Any) -> Array:
        return np.asarray(vector, dtype=float)[: self.element.axes]

    def segments_of(self, member: str) -> list[tuple[int, slice]]:
        """Number of the first place and elements of each segment of a member."""
        parts = (part for part in self.segments.parts if part.member == member)
        return [(self.segments.place(part.start), part.elements) for part in parts]

    def push(self, group: Loading, place: int, force: Array) -> None:
        """Add a force on a place itself, N."""
        group.force[place] += force / self.scales.force
        group.own[place] += force / self.scales.force

    # -- loads ----------------------------------------------------------------------------------

    def add_load(self, group: Loading, name: str, load: Load) -> None:
        if load.type == "moment":
            self._add_moment(group, name, load)
        elif load.node is not None:
            self.push(group, self.segments.place(load.node), self.vector(load.vector))
        elif load.type == "force":
            self._add_point_force(group, load)
        else:
            x = self.places(str(load.member))
            profile = np.ones(x.shape) if load.profile is None else evaluate(load.profile, x.ravel()).reshape(x.shape)
            density = profile[..., None] * self.vector(load.vector)
            self.spread(group, str(load.member), density)

    def _add_moment(self, group: Loading, name: str, load: Load) -> None:
        if load.node is not None:
            number = self.rotations.node_turn[load.node]
            if number is None:
                message = f"nothing turns with node {load.node!r}, so no moment can act on it"
                raise SceneError(message, ("loads", name))
        else:
            chain = self.rotations.chain(self.elements_of(str(load.member)))
            number = int(chain[self.cut(load) * self.element.order])
        group.couple[number] += load.vector[2] / self.scales.moment

    def _add_point_force(self, group: Loading, load: Load) -> None:
        member = str(load.member)
        value = self.vector(load.vector) / self.scales.force
        cut = self.beams.first[member] + self.cut(load)
        for place, part in self.segments_of(member):
            if part.start <= cut < part.stop:
                group.pull[part.start : cut] -= value
                group.force[place] += value
                return
        self.push(group, self.segments.place(self.segments.ends[member, 1]), self.vector(load.vector))

    def add_weight(self, group: Loading, member: str) -> None:
        x = self.places(member)
        mass = self.scene.sections[self.scene.members[member].section].mass(x.ravel()).reshape(x.shape)
        self.spread(group, member, mass[..., None] * self.vector(self.scene.gravity))

    def spread(self, group: Loading, member: str, density: Array) -> None:
        """Add a force per length (elements, points, axes), N/m: the adjoint of summing up the displacements.

        The pull at a point is minus the load beyond it; within an element "beyond" is the transpose of the
        matrix that integrates the turned tangents, so that the discrete potential has exactly this gradient.
        """
        part = self.elements_of(member)
        forces = self.beams.weight[part][..., None] * density * (self.scales.length / self.scales.force)
        on_element = forces.sum(axis=1)
        inside = np.einsum("jk,eja->eka", self.element.to_points, forces) / self.element.weights[:, None]
        group.spread[part] += forces
        for place, segment in self.segments_of(member):
            here = slice(segment.start - part.start, segment.stop - part.start)
            beyond = np.cumsum(on_element[here][::-1], axis=0)[::-1] - on_element[here]
            group.pull[segment] -= beyond[:, None, :] + inside[here]
            group.force[place] += on_element[here].sum(axis=0)

    # -- motions --------------------------------------------------------------------------------

    def add_motion(self, group: Loading, motion: Motion) -> None:
        number, axes = self.segments.place(motion.node), self.element.axes
        if motion.displacement is not None:
            shift = self.vector(motion.displacement) / self.scales.length
            group.shift[number * axes : (number + 1) * axes] += shift
        if motion.rotation is not None:
            turn = self.rotations.node_turn[motion.node]
            assert turn is not None
            group.turn[turn] += self._rotation_vector(motion)

    def _rotation_vector(self, motion: Motion) -> Array:
        if isinstance(motion.rotation, tuple):
            return np.asarray(motion.rotation, dtype=float)
        assert motion.rotation is not None
        axis = np.asarray(self.scene.nodes[motion.node].axis, dtype=float)
        return np.asarray(motion.rotation * axis / np.linalg.norm(axis))


def unit_loadings(
    scene: Scene,
    mesh: Mesh,
    element: Element,
    scales: Scales,
    segments: Segments,
    rotations: Rotations,
    beams: Beams,
) -> dict[str | None, Loading]:
    """Loadings of factor 1, by the history that multiplies them; None is the load factor itself.

    Raises
    ------
    SceneError
        A moment on a node that nothing turns with.
    """
    writer = _Writer(scene, mesh, element, scales, segments, rotations, beams)
    groups: dict[str | None, Loading] = {None: writer.empty()}
    for name, load in scene.loads.items():
        writer.add_load(groups.setdefault(load.history, writer.empty()), name, load)
    if scene.gravity is not None and np.any(scene.gravity):
        for member in scene.members:
            writer.add_weight(groups[None], member)
    for motion in scene.motions.values():
        writer.add_motion(groups.setdefault(motion.history, writer.empty()), motion)
    return groups
