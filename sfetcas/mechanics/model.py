"""The model of a scene on a mesh: element data, rotations, positions and loads as arrays.

Everything here is dimensionless: lengths are over that of the longest member, energies over the largest stiffness
divided by that length, so that micrometres and kilometres are the same problem.  All displacements are from the
undeformed scene.  A model has only the unknowns that its scene requires; :attr:`.Model.blocks` lists them with reasons.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..description.inserting import refuse_insertion
from ..description.records import brief, counted, enumerated
from ..description.remembering import refuse_memory
from ..description.scene import Scene, check_scene
from ..description.showing import named, shown
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.keeping import kept
from .actuation import actuations_in
from .beams import ELEMENT_DATA, Beams, Scales, beams_of, scales_of
from .clearances import clearances_in
from .connections import connections_in, stopped_in
from .contact_points import contact_points_in
from .elements import Element, element_by_name
from .laws import laws_in
from .load_terms import loads_in
from .loading import Loading, unit_loadings
from .magnetism import magnets_in
from .mass_centers import center_weights_in
from .mesh import Mesh, within_elements
from .parts import Parts
from .positions import Assembly, Positions, place_nodes
from .pressure import is_pressure
from .relaxation import relaxations_in
from .rings import rings_in
from .rotating_frame import RotatingFrame, with_rotating_frame
from .rotations import RotationFreedom, Rotations, number_rotations
from .segments import Segments, cut_members, one_sided
from .stretch_laws import stretch_laws_in
from .switches import switches_in
from .tendon_chains import rubbing_in
from .tendon_terms import tendons_in
from .terms import ALWAYS, Group, One, grouped
from .tubes import tubes_in
from .unwrapping import Unwrapping, unwrapping_of

__all__ = ["SOURCES", "Block", "Model", "assemble"]


SOURCES: list[Callable[[Parts], Iterable[One]]] = [
    connections_in,
    stopped_in,
    laws_in,
    stretch_laws_in,
    relaxations_in,
    loads_in,
    actuations_in,
    magnets_in,
    center_weights_in,
    tendons_in,
    switches_in,
    rubbing_in,
    tubes_in,
    rings_in,
    contact_points_in,
    clearances_in,
]
"""Functions that make the terms beside the elements; a further kind of energy is one more function."""

SHARED_ROWS = {"rings": "ring", "contacts": "point of contact", "tendons": "length of tendon"}
"""What rows are called to which several terms add their shares, by the tables of these; else by their kind."""

KNOWS_NO_STEPS = "a model by itself knows no steps, accepted: solve(scene)"
"""What is said of scenes whose load steps come one after the other."""


@dataclass(frozen=True)
class Block:
    """A block of unknowns or constraint rows of a model: its name, its size and a sentence why it is there."""

    name: str
    size: int
    why: str


@dataclass(frozen=True, eq=False)
class Model:
    """A scene on a mesh, ready to be solved any number of times; made by :func:`assemble`.

    Attributes
    ----------
    scene, mesh, element, scales, assembly
        What it was made of: scene, mesh, element type, units, ``closing`` or ``nodal``.
    beams : Beams
        Stiffness, tangents and weights of the elements.
    segments : Segments
        Members divided at the places whose displacements matter.
    rotations : Rotations
        Rotations of the nodes of elements, and how each is restrained.
    positions : Positions
        Linear maps for displacements and loop closures.
    connections : tuple of Group
        Terms of joints, springs, small members, loads and tendons.
    groups : mapping
        Loadings at factor 1, by the name of their history; None: multiplied by the load factor.
    constant : Loading or None
        What no factor multiplies, as the misfit of tubes.
    rotating_frame : RotatingFrame or None
        Centrifugal terms in rotating axes.
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
    connections: tuple[Group, ...]
    groups: Mapping[str | None, Loading]
    constant: Loading | None = None
    rotating_frame: RotatingFrame | None = None

    @property
    def space(self) -> bool:
        """Whether it is in space (quaternions, three axes) or in the plane (angles, two axes)."""
        return self.element.space

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the nonlinear program: components of rotations, displacements; without multipliers."""
        return int(self.widths.sum()) + len(self.positions.unknowns)

    @property
    def dimension(self) -> str:
        """``plane`` or ``space``."""
        return self.scene.resolved_dimension

    @property
    def reason(self) -> str:
        """A sentence why it is in the plane or in space."""
        return self.scene.dimension_reason

    @property
    def elements_in_words(self) -> str:
        """The elements of flexible members, ``4 elements SFET5``: a rigid or small one is cut into none."""
        cuts, members = self.mesh.cuts, self.scene.members
        count = sum(len(cuts[name]) - 1 for name, member in members.items() if member.type == "flexible")
        return f"{counted(count, 'element')} {self.element.name}" if count else "no flexible member"

    @property
    def size_in_words(self) -> str:
        """``4 elements SFET5, 12 unknowns, closing assembly``."""
        return f"{self.elements_in_words}, {counted(self.unknowns, 'unknown')}, {self.assembly} assembly"

    def __repr__(self) -> str:
        title = brief(self.scene.title) if self.scene.title else ""
        return shown(self, [title, self.dimension, self.size_in_words], [named(self.nodes, "node")])

    @functools.cached_property
    def terms(self) -> tuple[Group, ...]:
        """All terms of the Lagrangian, grouped by kind: the elements, then the connections."""
        data = self.beams.flat(*ELEMENT_DATA)
        unnamed = ("",) * len(data)
        elements = Group(self.element, self.rotations.turns, self.segments.strains, data, (), unnamed, unnamed)
        return (elements, *self.connections)

    @functools.cached_property
    def unwrapping(self) -> Unwrapping:
        """The angles that count turns in space."""
        return unwrapping_of(self.terms, self.space)

    @functools.cached_property
    def row_names(self) -> tuple[str, ...]:
        """Names of the constraint rows: loop closures, then joints."""
        return (*self.positions.rows, *(row for group in self.connections for row in group.rows))

    @functools.cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of unknowns and rows, each with a sentence why it is there."""
        return _blocks(self)

    @functools.cached_property
    def widths(self) -> Index:
        """For each rotation its unknowns in the nonlinear program: 4, 2 or 0 in space, 1 or 0 in the plane."""
        table = np.array([0, 2, 4]) if self.space else np.array([0, 1, 1])
        return table[self.rotations.kind]

    @functools.cached_property
    def has_potential(self) -> bool:
        """Whether all loads have a potential: there is no follower, and in space no moment on a free rotation."""
        return not any(self._works(group, i) for i, group in enumerate(self.connections))

    def _works(self, group: Group, number: int) -> bool:
        """Whether a group of connections has loads without potential; a moment on what is held does no work."""
        if group.kind.has_potential:
            return False
        if not group.kind.is_load:
            return True
        fixed = (self.rotations.kind[group.turns] == RotationFreedom.FIXED).all(axis=1) & (group.places.shape[1] == 0)
        return any(loading.loads[number][~fixed].any() for loading in self.groups.values())

    @functools.cached_property
    def conservative(self) -> bool:
        """Whether there is a potential energy: as :attr:`has_potential`, or all followers are pressure."""
        return self.has_potential or is_pressure(self.scene)

    @property
    def loaded_at_zero(self) -> bool:
        """Whether there may be loads at factor 0: from histories, or in rotating axes."""
        return bool(self.scene.histories) or bool(self.standing)

    @property
    def standing(self) -> list[Loading]:
        """Loadings that are there at every factor."""
        turning = None if self.rotating_frame is None else self.rotating_frame.loading
        return [loading for loading in (self.constant, turning) if loading is not None]

    @functools.cached_property
    def minimisable(self) -> bool:
        """Whether equilibria are minima of the nonlinear program; it does not contain moments in space."""
        turning = self.space and any(group.moment.any() for group in self.groups.values())
        return self.has_potential and not turning

    @property
    def downhill(self) -> bool:
        """Whether equilibria are found downhill from the undeformed state: not where something touches."""
        return self.minimisable and not self.mesh.points

    def check_complete(self) -> None:
        """Refuse a model whose scene has conditions that the model does not contain.

        Raises
        ------
        SceneError
            The scene has contacts, springs with stops or tendons that may be slack; which of them are active only
            :func:`sfetcas.solve` finds.
        """
        scene = self.scene
        refuse_memory(scene, KNOWS_NO_STEPS)
        if scene.contacts and not self.mesh.points:
            message = "a model by itself knows no contact, accepted: the scene without contacts, or solve(scene)"
            raise SceneError(message, ("contacts",))
        stopped = [name for name, spring in scene.springs.items() if spring.stop is not None]
        if stopped and not self.mesh.stops:
            message = "a model by itself knows no stops, accepted: the spring without stop, or solve(scene)"
            raise SceneError(message, ("springs", stopped[0], "stop"))
        for name, tendon in scene.tendons.items():
            if tendon.may_be_slack and not self.mesh.stops:
                message = "a model by itself does not find whether a tendon is slack, accepted: pushes = true, or"
                raise SceneError(f"{message} solve(scene)", ("tendons", name))

    @functools.cached_property
    def members(self) -> tuple[str, ...]:
        """Names of the flexible and rigid members, in the order of their elements."""
        return tuple(self.beams.first)

    @functools.cached_property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, which are the first places, in the order of the displacements."""
        return tuple(self.scene.nodes)

    def elements_of(self, member: str) -> slice:
        """Numbers of the elements of a member, as a slice."""
        start = self.beams.first[member]
        return slice(start, start + len(self.mesh.cuts[member]) - 1)

    def chain(self, member: str) -> Index:
        """Numbers of the rotations along a member, both ends included."""
        return self.rotations.chain(self.elements_of(member))

    def along(self, member: str) -> Array:
        """Fractions of a member's length at which the rotations of :meth:`chain` are; of a small member its ends."""
        if member not in self.mesh.cuts:
            return np.array([0.0, 1.0])
        cuts = self.mesh.cuts[member]
        inner = within_elements(cuts, self.element.nodes[:-1])
        return np.append(inner.ravel(), 1.0)

    def factors(self, factor: float) -> dict[str | None, float]:
        """Factor of each group of loads at a load factor: this, or the value of its history there."""
        histories = self.scene.histories
        return {name: factor if name is None else histories[name].factor(factor) for name in self.groups}

    def loading(self, factor: float, share: float = 1.0) -> Loading:
        """Loads and prescribed motions at a load factor, multiplied by ``share``; dimensionless."""
        return self._loading(float(factor), float(share))

    # One factor is asked for several times in a row: by a step, its equations, and what comes after it.
    @kept(4)
    def _loading(self, factor: float, share: float) -> Loading:
        parts = [(self.groups[name], share * value) for name, value in self.factors(factor).items()]
        return Loading.combined([*parts, *((loading, share) for loading in self.standing)])

    def motion(self, name: str) -> Loading:
        """The prescribed displacements and rotations of one motion at factor 1, dimensionless."""
        motions = {name: self.scene.motions[name]}
        scene = self.scene.model_copy(update={"motions": motions, "loads": {}, "gravity": None})
        parts = Parts(scene, self.mesh, self.element, self.scales, self.beams, self.segments, self.rotations)
        return unit_loadings(parts, self.connections)[motions[name].history].unloaded()

    def prescribed_rotations(self, vectors: Array) -> Array:
        """Rotations (n, components) by vectors (n, 3), rad, of motions: zero for all that are undeformed."""
        return quaternion.from_rotation_vector(vectors) if self.space else vectors[:, 2:3].copy()

    def with_data(self, data: Mapping[int, Array]) -> Model:
        """The model with other data (n, width) of groups of terms, by their numbers."""
        connections, beams = list(self.connections), self.beams
        for number, own in data.items():
            if number:
                connections[number - 1] = replace(connections[number - 1], data=own)
            else:
                sizes = [getattr(beams, name)[:1].size for name in ELEMENT_DATA]
                parts = zip(ELEMENT_DATA, np.split(own, np.cumsum(sizes)[:-1], axis=1), strict=True)
                beams = replace(beams, **{name: part.reshape(getattr(beams, name).shape) for name, part in parts})
        return replace(self, connections=tuple(connections), beams=beams)


def assemble(
    scene: Scene,
    mesh: Mesh,
    *,
    assembly: Assembly = "auto",
    scales: Scales | None = None,
    like: Model | None = None,
) -> Model:
    """The model of a scene on a mesh.

    Parameters
    ----------
    scene : Scene
    mesh : Mesh
        Element order, integration and cuts of each member.
    assembly : str
        ``closing`` (unknowns are rotations, and few displacements), ``nodal`` (also displacements of nodes), or
        ``auto``: the one whose Newton matrix has fewer entries.  In rotating axes it is ``nodal``, with displacements
        at every end of an element, as masses need.
    scales : Scales, optional
        Units of the model; by default chosen for the scene.
    like : Model, optional
        A model of the same scene, whose units are taken, and whose numbering where only lengths of elements differ.

    Raises
    ------
    SceneError
        A moment acts on a node without a rotation of its own.
    """
    check_scene(scene, "assemble({}, ...)")
    if mesh.memory is None:
        refuse_memory(scene, KNOWS_NO_STEPS)
    refuse_insertion(scene, KNOWS_NO_STEPS)
    if scene.rotating is not None:
        mesh, assembly = replace(mesh, places=True), "nodal"
    space = scene.resolved_dimension == "space"
    element = element_by_name(f"SFET{mesh.order + 1}", space, mesh.gauss, scene.stretches, scene.shifted)
    scales = scales or (scales_of(scene) if like is None else like.scales)
    beams, segments = beams_of(scene, mesh, element, scales), cut_members(scene, mesh)
    if like is not None and like.element is element and like.assembly == assembly and segments.alike(like.segments):
        rotations, positions = like.rotations, like.positions
    else:
        rotations = number_rotations(scene, mesh, element)
        bodies = {name: ends[0] for name, ends in rotations.ends.items() if scene.members[name].type == "rigid"}
        positions, assembly = place_nodes(scene, segments, element.axes, bodies, mesh, assembly)
    parts = Parts(scene, mesh, element, scales, beams, segments, rotations)
    connections = grouped(one for source in SOURCES for one in source(parts))
    groups = unit_loadings(parts, connections)
    model = Model(
        scene=scene,
        mesh=mesh,
        element=element,
        scales=scales,
        assembly=assembly,
        beams=beams,
        segments=segments,
        rotations=rotations,
        positions=positions,
        connections=connections,
        constant=groups.pop(ALWAYS, None),
        groups=groups,
    )
    return model if scene.rotating is None else with_rotating_frame(model)


def _blocks(model: Model) -> tuple[Block, ...]:
    """What the model consists of, and why."""
    kind = model.rotations.kind
    free, about = int((kind == RotationFreedom.FREE).sum()), int((kind == RotationFreedom.AXIS).sum())
    blocks = []
    if model.space:
        blocks.append(Block("quaternions", 4 * free, f"4 for each of {counted(free, 'free rotation')}: {model.reason}"))
        if about:
            blocks.append(Block("hinge rotations", 2 * about, "2 for each rotation held but for its hinge axis"))
        blocks.append(Block("norms", free + about, "a quaternion of a free rotation is unit; held ones need no row"))
    else:
        blocks.append(Block("angles", free, f"1 for each of {counted(free, 'free rotation')}: {model.reason}"))
    angles = sum(int(np.unique(part[part >= 0]).size) for part in model.segments.angles.values())
    relaxing = {model.segments.places[i] for i in model.segments.relaxing.flat if i >= 0}
    rings = len(model.scene.rings)
    points = sum(sum(point.slides) + model.element.axes for point in model.mesh.points)
    switches = 2 * len(one_sided(model.scene)) if model.mesh.switched else 0
    others = angles + rings + points + switches
    strains = sum(len(part) for name, part in model.segments.strained.items() if name not in relaxing) - others
    if strains:
        blocks.append(
            Block("strains", strains, "stretch and shear at the integration points of members that have them")
        )
    if relaxing:
        count = sum(len(model.segments.strained[name]) for name in relaxing)
        blocks.append(Block("relaxed strains", count, "at the integration points, for each branch of what relaxes"))
        strains += count
    if angles:
        blocks.append(Block("angles of tubes", angles, "how each tube is twisted against the member at its nodes"))
    if rings:
        blocks.append(Block("places of rings", rings, "how far each ring has moved along its member"))
    if switches:
        blocks.append(Block("openings", switches, "how far each string and stop is from acting"))
    if points:
        why = f"where members touch at {counted(len(model.mesh.points), 'point')}, and the vectors there"
        blocks.append(Block("points of contact", points, why))
    if len(model.positions.unknowns) > strains + others:
        why = "nodal assembly" if model.assembly == "nodal" else "nothing but guides hold the structure"
        if model.assembly != "nodal" and model.segments.retained:
            why = "springs, tendons, rings, small members, slides or followers act upon places"
        count = len(model.positions.unknowns) - strains - others
        blocks.append(Block("displacements", count, f"{why}: positions are unknowns"))
    if model.positions.rows:
        why = "one for each member" if model.assembly == "nodal" else "one for each loop and further held direction"
        blocks.append(Block("closings", len(model.positions.rows), f"{why}; the multipliers are forces"))
    for group in model.connections:
        if group.rows:
            name = SHARED_ROWS.get(group.kind.table, "") if group.kind.shares_row else ""
            name = name or type(group.kind).__name__.lower()
            blocks.append(Block(f"{name} rows", len(group.rows), enumerated(tuple(dict.fromkeys(group.names)))))
    return tuple(blocks)
