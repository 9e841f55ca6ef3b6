"""The model of a scene on a mesh: element data, rotations, positions and loads as arrays.

Everything here is dimensionless: lengths by the longest member, energies by the largest bending stiffness over
that length, so that micrometres and kilometres are the same problem.  All displacements are from the undeformed
scene.  A model holds only what its scene requires; :attr:`Model.blocks` says what, how much and why.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from . import quaternion
from .arrays import Array, Index
from .elements import Element, element_by_name
from .loading import Beams, Loading, Scales, unit_loadings
from .mesh import Mesh
from .positions import Positions, entries, place_nodes
from .rotations import Rotations, Turn, number_rotations
from .scene import Scene
from .segments import Segments, cut_members

__all__ = ["Block", "Model", "assemble"]


@dataclass(frozen=True)
class Block:
    """One kind of unknowns or rows of a model: its number and why it is there."""

    name: str
    size: int
    why: str


@dataclass(frozen=True, eq=False)
class Model:
    """A scene on a mesh, ready to be solved any number of times; made by :func:`assemble`.

    Attributes
    ----------
    scene, mesh, element, scales, assembly
        What it was made of.
    beams : Beams
        Stiffness, tangents and weights of the elements.
    segments : Segments
        Members cut between places.
    rotations : Rotations
        Numbers and freedoms of the rotations.
    positions : Positions
        Displacements of nodes, closing equations.
    groups : mapping
        Loadings of factor 1, by history.
    """

    scene: Scene
    mesh: Mesh
    element: Element
    scales: Scales
    assembly: str
    beams: Beams
    segments: Segments
    rotations: Rotations
    positions: Positions
    groups: Mapping[str | None, Loading]

    @property
    def space(self) -> bool:
        """Quaternions and three axes, or angles and two."""
        return self.element.space

    @property
    def unknowns(self) -> int:
        """Unknowns of the minimisation: components of rotations, displacements kept; without multipliers."""
        return int(self.widths.sum()) + len(self.positions.unknowns)

    @property
    def dimension(self) -> str:
        """plane or space."""
        return self.scene.resolved_dimension

    @property
    def reason(self) -> str:
        """Why the model is in the plane or in space."""
        return self.scene.dimension_reason

    @functools.cached_property
    def blocks(self) -> tuple[Block, ...]:
        """What the model consists of, and why."""
        return _blocks(self)

    @functools.cached_property
    def widths(self) -> Index:
        """Unknown numbers of each rotation in the minimisation: 4, 2 or 0 in space; 1 or 0 in the plane."""
        table = np.array([0, 2, 4]) if self.space else np.array([0, 1, 1])
        return table[self.rotations.kind]

    @functools.cached_property
    def members(self) -> tuple[str, ...]:
        """Names of the members that are made of elements, in the order of these."""
        return tuple(self.beams.first)

    @functools.cached_property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes: the first places, in the order of the displacements."""
        return tuple(self.scene.nodes)

    def elements_of(self, member: str) -> slice:
        """The elements of a member, first to last."""
        start = self.beams.first[member]
        return slice(start, start + len(self.mesh.cuts[member]) - 1)

    def chain(self, member: str) -> Index:
        """Numbers of the rotations along a member, both ends included."""
        return self.rotations.chain(self.elements_of(member))

    def along(self, member: str) -> Array:
        """Fractions of the length at which the rotations of :meth:`chain` stand."""
        cuts = self.mesh.cuts[member]
        inner = cuts[:-1, None] + np.diff(cuts)[:, None] * self.element.nodes[:-1]
        return np.append(inner.ravel(), 1.0)

    def factors(self, factor: float) -> dict[str | None, float]:
        """Multiplier of each group of loads: the factor, or that of the history at the factor."""
        histories = self.scene.histories
        return {name: factor if name is None else histories[name].factor(factor) for name in self.groups}

    def loading(self, factor: float, share: float = 1.0) -> Loading:
        """Loads and motions at a load factor, all of them times ``share``."""
        parts = [self.groups[name].scaled(share * value) for name, value in self.factors(factor).items()]
        total = parts[0]
        for part in parts[1:]:
            total = total.plus(part)
        return total

    def held(self, loading: Loading) -> Array:
        """Rotations with the held ones at their prescribed values and all others at rest, (rotations, comps)."""
        if not self.space:
            return loading.turn[:, 2:3].copy()
        return quaternion.from_rotation_vector(loading.turn)


def assemble(
    scene: Scene,
    mesh: Mesh,
    *,
    assembly: Literal["auto", "closing", "nodal"] = "auto",
) -> Model:
    """The model of a scene on a mesh.

    Parameters
    ----------
    scene : Scene
    mesh : Mesh
        Element order, integration and cuts of each member.
    assembly : str
        ``closing`` (unknowns are rotations only), ``nodal`` (and displacements of macro-nodes), or ``auto``: the
        one whose stationarity equations have fewer entries.

    Raises
    ------
    SceneError
        A moment on a node that nothing turns with.
    """
    element = element_by_name(f"SFET{mesh.order + 1}", scene.resolved_dimension == "space", mesh.gauss)
    scales, rotations = _scales(scene), number_rotations(scene, mesh, element)
    beams, segments = _beams(scene, mesh, element, scales), cut_members(scene, mesh)
    both = {name: place_nodes(scene, segments, element.axes, name == "closing") for name in ("closing", "nodal")}
    if assembly == "auto":
        closing, nodal = (entries(both[name], segments, mesh) for name in ("closing", "nodal"))
        assembly = "closing" if closing <= nodal else "nodal"
    return Model(
        scene=scene,
        mesh=mesh,
        element=element,
        scales=scales,
        assembly=assembly,
        beams=beams,
        segments=segments,
        rotations=rotations,
        positions=both[assembly],
        groups=unit_loadings(scene, mesh, element, scales, segments, rotations, beams),
    )


def _scales(scene: Scene) -> Scales:
    length = max(line.length for line in scene.center_lines.values())
    x = np.linspace(0.0, 1.0, 5)
    stiffest = max(float(np.nanmax(scene.sections[m.section].stiffness(x))) for m in scene.members.values())
    return Scales(length, stiffest / length)


def _beams(scene: Scene, mesh: Mesh, element: Element, scales: Scales) -> Beams:
    stiffness, tangent, weight = [], [], []
    first: dict[str, int] = {}
    for name, member in scene.members.items():
        cuts, line = mesh.cuts[name], scene.center_lines[name]
        x = cuts[:-1, None] + np.diff(cuts)[:, None] * element.points
        length = line.length / scales.length * np.diff(cuts)
        w = length[:, None] * element.weights
        values = scene.sections[member.section].stiffness(x.ravel()) / (scales.moment * scales.length)
        frames = quaternion.matrix(line.quaternions(x.ravel()))
        # Integrals over xi of squares of derivatives by xi: weight over length.
        per_length = (element.weights / length[:, None])[..., None]
        stiffness.append(_in_fixed_axes(values, frames, element, line.bending_axis).reshape(*x.shape, -1) * per_length)
        tangent.append(frames[:, : element.axes, 0].reshape(*x.shape, -1) * w[..., None])
        weight.append(w)
        first[name] = sum(len(part) for part in weight[:-1])
    return Beams(np.concatenate(stiffness), np.concatenate(tangent), np.concatenate(weight), first)


def _in_fixed_axes(values: Array, frames: Array, element: Element, bending_axis: int) -> Array:
    """Stiffness (n, 3) about b1, b2, b3 in the fixed axes: upper triangles (n, 6), or about z (n, 1)."""
    if not element.space:
        return values[:, 1:2] if bending_axis == 2 else values[:, 2:3]
    full = np.einsum("nij,nj,nkj->nik", frames, values, frames)
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def _blocks(model: Model) -> tuple[Block, ...]:
    """What the model consists of, and why."""
    kind = model.rotations.kind
    free, about = int((kind == Turn.FREE).sum()), int((kind == Turn.AXIS).sum())
    blocks = []
    if model.space:
        blocks.append(Block("quaternions", 4 * free, f"4 for each of {free} free rotations: {model.reason}"))
        if about:
            blocks.append(Block("hinge rotations", 2 * about, "2 for each rotation held but for its hinge axis"))
        blocks.append(Block("norms", free + about, "a quaternion of a free rotation is unit; held ones need no row"))
    else:
        blocks.append(Block("angles", free, f"1 for each of {free} free rotations: {model.reason}"))
    if model.positions.unknowns:
        why = "nodal assembly" if model.assembly == "nodal" else "nothing but guides hold the structure"
        blocks.append(Block("displacements", len(model.positions.unknowns), f"{why}: positions are unknowns"))
    if model.positions.rows:
        why = "one for each member" if model.assembly == "nodal" else "one for each loop and further held direction"
        blocks.append(Block("closings", len(model.positions.rows), f"{why}; the multipliers are forces"))
    if len(model.rotations.hinges):
        blocks.append(
            Block("hinges", 2 * len(model.rotations.hinges), "a hinge between members keeps two directions together")
        )
    return tuple(blocks)
