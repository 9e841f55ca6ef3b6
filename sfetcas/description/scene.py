"""The scene: what the user says, as frozen records that are checked when they are made."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, values_of
from ..mathematics.quaternion import matrix
from .actuation import Actuation, Magnet, MagneticField
from .answers import answer_name, check_answer
from .changes import FACTOR, Branch, branch_of, carry_ends, with_entries
from .contacts import Contact, contact_radius, pairs_of
from .dimension import out_of_plane
from .formulas import Formula
from .inserting import check_insertion, pushed, refuse_insertion
from .loads import History, Load, Motion
from .matrices import check_inertia, check_rigid_motion
from .moving import (
    check_beginning,
    check_contact,
    check_driving,
    check_masses,
    check_no_contact,
    check_unilateral,
    check_velocities,
)
from .obstacles import Obstacle, carriers, check_start, members_of, obstacle
from .records import Named, Record, Vector, brief, counted, enumerated, number, say, unknown
from .remembering import check_memory, refuse_memory, remembering_section
from .rings import Ring, begins_at, check_ring
from .sections import CrossSection
from .shapes import CenterLine, place
from .showing import named, number_in_words, shown
from .sliding import check_sliding, let_out, let_out_at, shortening_of
from .springs import Spring
from .structure import SLIDING, Member, Node, released, unit
from .supports import check_driven_joint, check_floating, check_motion, check_motions_once
from .task import Analysis, Expect, Until
from .tendons import Piece, Stretch, Tendon, Way, check_pieces, check_way, pieces_of
from .tubes import Run, Tube, check_tube, check_turns, runs_of

__all__ = [
    "Actuation",
    "Analysis",
    "Contact",
    "Expect",
    "History",
    "Load",
    "Magnet",
    "MagneticField",
    "Member",
    "Motion",
    "Node",
    "Ring",
    "Scene",
    "Spring",
    "Tendon",
    "Tube",
    "Until",
    "Way",
    "check_held",
    "check_loaded",
    "check_scene",
    "too_sharp",
]

PRESCRIBED = "prescribed"
"""Another name of the table ``motions``."""


class Scene(Record):
    """A structure of members between nodes, with its supports, loads and prescribed motions, and its analysis.

    Parameters
    ----------
    title : text
        Free text.
    source : text
        Free text: where the scene is from.
    dimension : text
        ``plane`` (x-y), ``space``, or ``auto``: plane where everything lies in x-y.  Buckling out of the plane
        is seen in ``space`` only.
    gravity : (3,), m/s², fixed axes
        Acceleration, multiplied by the load factor of the step.  It needs masses, as ``rhoA`` of sections.
    rotating : (3,), rad/s, fixed axes
        Angular velocity with which the axes turn about the origin.  Answers are in these rotating axes.  The
        load factor does not multiply it.  It needs ``rhoA``.
    sections : table by name
        ``[sections.NAME]``: cross-sections.
    nodes : table by name
        ``[nodes.NAME]``: where members end, are joined and are supported.
    members : table by name
        ``[members.NAME]``: at least one.
    springs : table by name
        ``[springs.NAME]``: springs, dampers and stops.
    tendons : table by name
        ``[tendons.NAME]``: tendons that pull along their ways, and chambers that push.
    tubes : table by name
        ``[tubes.NAME]``: tubes that share the centre line of members, and turn and slide on it.
    rings : table by name
        ``[rings.NAME]``: nodes that slide along members.
    loads : table by name
        ``[loads.NAME]``: forces, moments and distributed loads.
    motions : table by name
        ``[motions.NAME]``, or ``[prescribed.NAME]``: prescribed displacements and rotations.
    histories : table by name
        ``[histories.NAME]``: factors of loads and motions, over the load factor or the time.
    actuations : table by name
        ``[actuations.NAME]``: natural curvature and twist of members.
    fields : table by name
        ``[fields.NAME]``: magnetic fields.
    magnets : table by name
        ``[magnets.NAME]``: magnetised members and magnetic dipoles.
    contacts : table by name
        ``[contacts.NAME]``: obstacles, and members that touch each other.
    analysis : table
        ``[analysis]``: what is to be computed.
    expect : list of tables
        ``[[expect]]``: known values of the answer, with which ``sfetcas check`` compares.

    Raises
    ------
    SceneError
        Anything that is not accepted: one sentence with its place.

    Examples
    --------
    >>> strip = CrossSection(EI3=1.0)
    >>> nodes = {"A": Node(position=[0, 0], support="clamped"), "B": Node(position=[1, 0])}
    >>> beam = Member(nodes=["A", "B"], section="strip")
    >>> tip = Load(type="force", node="B", value=[0, 1])
    >>> scene = Scene(sections={"strip": strip}, nodes=nodes, members={"beam": beam}, loads={"tip": tip})
    >>> scene.resolved_dimension
    'plane'
    """

    model_config = ConfigDict(validate_default=True)

    title: str = ""
    source: str = ""
    dimension: Literal["auto", "plane", "space"] = "auto"
    gravity: Vector | None = None
    rotating: Vector | None = None
    sections: Named[CrossSection] = Field(default_factory=dict)
    nodes: Named[Node] = Field(default_factory=dict)
    members: Named[Member] = Field(default_factory=dict)
    springs: Named[Spring] = Field(default_factory=dict)
    tendons: Named[Tendon] = Field(default_factory=dict)
    tubes: Named[Tube] = Field(default_factory=dict)
    rings: Named[Ring] = Field(default_factory=dict)
    loads: Named[Load] = Field(default_factory=dict)
    motions: Named[Motion] = Field(default_factory=dict)
    histories: Named[History] = Field(default_factory=dict)
    actuations: Named[Actuation] = Field(default_factory=dict)
    fields: Named[MagneticField] = Field(default_factory=dict)
    magnets: Named[Magnet] = Field(default_factory=dict)
    contacts: Named[Contact] = Field(default_factory=dict)
    analysis: Analysis = Analysis()
    expect: tuple[Expect, ...] = ()

    def __repr__(self) -> str:
        return shown(
            self,
            [brief(self.title) if self.title else "", self.resolved_dimension, self.analysis.type],
            [
                *(named(getattr(self, table), *kind) for table, kind in _TABLES.items()),
                *(f"{key}: {number_in_words(v, unit)}" for key, unit in _UNITS.items() if (v := getattr(self, key))),
                repr(self.analysis) if self.analysis != Analysis() else "",
                counted(len(self.expect), "known value") if self.expect else "",
            ],
        )

    __str__ = __repr__

    @model_validator(mode="before")
    @classmethod
    def _prescribed(cls, values: Any) -> Any:
        """Prescribed displacements and rotations by their other name."""
        if not isinstance(values, Mapping) or PRESCRIBED not in values:
            return values
        if "motions" in values:
            raise SceneError("found 'motions' and 'prescribed', which are the same table, accepted: one of them")
        return {("motions" if key == PRESCRIBED else key): table for key, table in values.items()}

    @model_validator(mode="after")
    def _check(self) -> Scene:
        for rule in _RULES:
            rule(self)
        return self

    def replace(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> Scene:
        """A scene with other values of any of its keys, validated as a new one; this scene stays as it is.

        ``scene.replace({"loads.tip.value": [0, 5], "analysis.accuracy": 1e-8}, title="as measured")``

        Parameters
        ----------
        changes : mapping, optional
            Values by the names of the keys, with dots: ``sections.strip.EI3``, one entry of a list as
            ``loads.tip.value.1``, a whole entry of a table as ``loads.extra``, which may be a new one.  None removes
            an entry, and sets a key to its default.  ``factor`` stands for all of ``analysis.steps``.
        keys
            Whole keys of the scene: ``title="..."``, ``gravity=[0, -9.81]``, ``analysis=Analysis(...)``.

        Returns
        -------
        Scene
            A free node at the end of a member whose changed shape says where it ends (a curvature with a ``start``, a
            helix, a spline) moves along.  Values in ``expect`` are known of this scene: they are kept where only texts
            or numerical settings change (``accuracy``, ``accuracy_of``, ``step``, ``integrator``, ``element``,
            ``elements``), and dropped where the answer may change, unless ``expect`` is given.

        Raises
        ------
        SceneError
            There is no such key, or the scene does not accept the value; the sentence begins with the key.

        Examples
        --------
        >>> strip, nodes = {"EI3": 1.0}, {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}}
        >>> beam, tip = {"nodes": ["A", "B"], "section": "strip"}, {"type": "force", "node": "B", "value": [0, 1]}
        >>> scene = Scene(sections={"strip": strip}, nodes=nodes, members={"beam": beam}, loads={"tip": tip})
        >>> stronger = scene.replace({"loads.tip.value": [0, 5], "analysis.accuracy": 1e-6})
        >>> stronger.loads["tip"].value, stronger.analysis.accuracy
        ((0.0, 5.0, 0.0), 1e-06)
        """
        new = branch_of({} if changes is None else changes, keys)
        if PRESCRIBED in new:
            new = branch_of(new, {"motions": new.pop(PRESCRIBED)})
        factor = new.pop(FACTOR, None)
        if factor is not None and self.analysis.type == "dynamic":
            message = "found the analysis 'dynamic', in which loads go by their histories, accepted: any other analysis"
            raise SceneError(message, (FACTOR,))
        for key in new:
            if key not in type(self).model_fields and key in Analysis.model_fields:
                raise SceneError(f"unknown key {key!r}; did you mean 'analysis.{key}'?")
        carry_ends(self, new, _remade)
        known = None if "expect" in new else self.expect
        found = with_entries(self, Branch(new, expect=()) if known else new, _remade)
        if factor is not None:
            try:
                steps = (number(factor),)
            except ValueError as error:
                raise SceneError(str(error), (FACTOR,)) from None
            found = found.model_copy(update={"analysis": found.analysis.model_copy(update={"steps": steps})})
        return Record.replace(found, expect=known) if known and _answers_alike(self, found) else found

    @cached_property
    def center_lines(self) -> Mapping[str, CenterLine]:
        """The unloaded centre line of each member, by name."""
        lines = {}
        for name, member in self.members.items():
            start, end = (self.nodes[node].position for node in (member.nodes[0], member.nodes[-1]))
            lines[name] = place(member.shape, start, end, member.b2, ("members", name))
        return MappingProxyType(lines)

    @cached_property
    def obstacles(self) -> Mapping[str, Obstacle]:
        """The obstacles that stop members, in numbers, by name."""
        space = self.resolved_dimension == "space"
        stops = {name: obstacle(one, space) for name, one in self.contacts.items() if not one.between_members}
        return MappingProxyType(stops)

    @cached_property
    def tendon_pieces(self) -> Mapping[str, tuple[Piece, ...]]:
        """The straight pieces and the stretches along members of the way of each tendon, by name."""
        ways = {name: pieces_of(t, self.nodes, self.members, self.center_lines) for name, t in self.tendons.items()}
        return MappingProxyType(ways)

    @cached_property
    def tube_runs(self) -> Mapping[str, tuple[Run, ...]]:
        """The parts of members along which each tube lies, by name."""
        return MappingProxyType({name: runs_of(tube, self.center_lines) for name, tube in self.tubes.items()})

    @cached_property
    def ring_places(self) -> Mapping[str, float]:
        """Fraction of the length of its member at which each ring is in the undeformed scene, by name."""
        lines, nodes = self.center_lines, self.nodes
        found = {name: begins_at(ring, nodes[ring.node], lines[ring.member]) for name, ring in self.rings.items()}
        return MappingProxyType(found)

    @cached_property
    def tubed(self) -> frozenset[str]:
        """Names of the members along which tubes lie."""
        return frozenset(run.member for runs in self.tube_runs.values() for run in runs)

    @property
    def loads_along(self) -> Mapping[str, tuple[Load, ...]]:
        """The loads along each member that has some, by name."""
        # A copy with other loads has what this keeps, too.
        kept = self.__dict__.get("_loads_along")
        if kept is None or kept[0] is not self.loads:
            found = dict[str, list[Load]]()
            for load in self.loads.values():
                if load.member is not None:
                    found.setdefault(load.member, []).append(load)
            kept = self.loads, MappingProxyType({name: tuple(own) for name, own in found.items()})
            self.__dict__["_loads_along"] = kept
        along: Mapping[str, tuple[Load, ...]] = kept[1]
        return along

    @property
    def started(self) -> bool:
        """Whether nodes have ``start`` places, which choose among equilibria."""
        return any(node.start is not None for node in self.nodes.values())

    @property
    def stopped(self) -> bool:
        """Whether springs have stops or tendons may be slack, so that it has to be found which of them act."""
        springs = any(spring.stop is not None for spring in self.springs.values())
        return springs or any(tendon.may_be_slack for tendon in self.tendons.values())

    @property
    def rubs(self) -> bool:
        """Whether there is friction where members touch, so that the order of the steps matters."""
        return any(contact.friction > 0.0 for contact in self.contacts.values())

    @property
    def hits(self) -> bool:
        """Whether there may be impacts in a motion: on obstacles, at stops, of strings."""
        return self.stopped or bool(self.contacts)

    @property
    def limited(self) -> bool:
        """Whether there is what answers must not go beyond: small members, rings, magnets in fields that are tables."""
        tables = bool(self.magnets) and any(field.table is not None for field in self.fields.values())
        return tables or self.limited_on_ways

    @property
    def limited_on_ways(self) -> bool:
        """Whether the loads growing from zero must not lead beyond it either: small members, or rings."""
        return bool(self.rings) or any(member.type == "small" for member in self.members.values())

    @property
    def reversed(self) -> bool:
        """Whether tendons with friction are let out at a load factor, so that each factor has equations of its own."""
        return any(self.released_at_steps())

    @cached_property
    def shortenings(self) -> Mapping[str, float | None]:
        """By how much the tendons with friction are shorter at factor 1, m; None where their force is given."""
        rubbing = {name: tendon for name, tendon in self.tendons.items() if tendon.rubs}
        found = {n: shortening_of(t, self.tendon_pieces[n], self.center_lines) for n, t in rubbing.items()}
        return MappingProxyType(found)

    @cached_property
    def released(self) -> frozenset[str]:
        """Names of the tendons with friction that are let out in a path or a motion, and at the first of steps."""
        given = self.analysis, self.histories
        return frozenset(n for n, by in self.shortenings.items() if let_out(self.tendons[n], by, *given))

    def released_at_steps(self) -> tuple[frozenset[str], ...]:
        """Names of the tendons with friction that are let out at each load factor of ``analysis.steps``."""
        steps, found = self.analysis.steps, dict[str, tuple[bool, ...]]()
        for name, by in self.shortenings.items() if self.analysis.type == "static" else ():
            found[name] = let_out_at(self.tendons[name], by, steps, self.histories)
        return tuple(frozenset(name for name, out in found.items() if out[i]) for i in range(len(steps)))

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box of the undeformed members, m."""
        samples = np.linspace(0.0, 1.0, 65)
        points = np.vstack([line.positions(samples) for line in self.center_lines.values()])
        return math.hypot(*np.ptp(points, axis=0))

    def spring_axis(self, name: str) -> tuple[float, float, float]:
        """Axis (3,) of a rotational spring, fixed axes of the undeformed scene: its own, or that of its joint."""
        spring = self.springs[name]
        return self.nodes[spring.node].joint_axis if spring.axis is None else spring.axis

    @cached_property
    def stretches(self) -> bool:
        """Whether any member stretches or shears."""
        return any(member.stretches(self.sections) for member in self.members.values())

    @cached_property
    def shifted(self) -> bool:
        """Whether the section of any flexible member couples forces with moments."""
        return any(member.shifted(self.sections) for member in self.members.values())

    @cached_property
    def relaxes(self) -> bool:
        """Whether any member relaxes."""
        return any(member.branches(self.sections) for member in self.members.values())

    @cached_property
    def remembers(self) -> bool:
        """Whether the law of any member's section has memory, so that each step has to come after another."""
        return bool(remembering_section(self))

    @cached_property
    def inserts(self) -> bool:
        """Whether tubes or members are pushed out as the load factor grows, so that each step comes after another."""
        return any(pushed(self))

    @property
    def resolved_dimension(self) -> Literal["plane", "space"]:
        """How the scene is modelled: plane or space."""
        return "plane" if self.dimension != "space" and self._out_of_plane is None else "space"

    @property
    def dimension_reason(self) -> str:
        """Why the scene is modelled in the plane or in space."""
        if self.dimension == "space":
            return "dimension is set to 'space'"
        if self._out_of_plane is None:
            return "all positions, shapes, axes, loads and motions lie in x-y"
        where, what = self._out_of_plane
        return f"{'.'.join(where)} {what}"

    @cached_property
    def _out_of_plane(self) -> tuple[tuple[str, ...], str] | None:
        return out_of_plane(
            self.nodes,
            self.center_lines,
            self.loads,
            self.motions,
            self.springs,
            self.gravity,
            self.members,
            self.contacts,
            self.rotating,
            self.sections,
            self.actuations,
            self.fields,
            self.magnets,
            self.tendons,
            self.tubes,
        )

    @property
    def driven(self) -> Iterator[tuple[str, str, Any]]:
        """Table, name and record of all that grows with the load factor or has a history; gravity grows too."""
        for table in DRIVEN:
            for name, record in getattr(self, table).items():
                if table != "rings" or record.driven:
                    yield table, name, record

    @property
    def histories_used(self) -> set[str]:
        """Names of the histories that something has."""
        pushing = {record.insertion_history for _, _, record in pushed(self)}
        return {name for name in (*pushing, *(one.history for _, _, one in self.driven)) if name is not None}


DRIVEN = ("loads", "tendons", "tubes", "rings", "motions", "actuations", "fields")
"""Tables of what grows with the load factor, or with a history."""

_TABLES = {
    "sections": ("section",),
    "nodes": ("node",),
    "members": ("member",),
    "springs": ("spring",),
    "tendons": ("tendon",),
    "tubes": ("tube",),
    "rings": ("ring",),
    "loads": ("load",),
    "motions": ("prescribed motion",),
    "histories": ("history", "histories"),
    "actuations": ("actuation",),
    "fields": ("magnetic field",),
    "magnets": ("magnet",),
    "contacts": ("contact",),
}
"""Tables of a scene in their order, with what one of their entries is."""

_UNITS = {"gravity": "m/s2", "rotating": "rad/s"}
"""What acts everywhere, with its unit."""


def _remade(record: Record, entries: Mapping[str, Any]) -> Record:
    # That of a scene takes keys with dots.
    return Record.replace(record, **entries) if isinstance(record, Scene) else record.replace(**entries)


_NUMERICAL = {"analysis": ("accuracy", "accuracy_of", "step", "integrator"), "members": ("element", "elements")}
"""Keys that say how an answer is computed, not what it is."""


def _answers_alike(scene: Scene, other: Scene) -> bool:
    """Whether two scenes differ only in what the answer depends on no more than by the error of computing it."""

    def bare(record: Record, table: str) -> Record:
        return record.model_copy(update=dict.fromkeys(_NUMERICAL[table]))

    for key in set(Scene.model_fields) - {"title", "source", "dimension", "expect"}:
        one, two = getattr(scene, key), getattr(other, key)
        if key == "analysis":
            one, two = bare(one, key), bare(two, key)
        elif key == "members" and one != two:
            one, two = ({name: bare(member, key) for name, member in table.items()} for table in (one, two))
        if one != two:
            return False
    return scene.resolved_dimension == other.resolved_dimension


def _check_members(scene: Scene) -> None:
    if not scene.members:
        raise SceneError("scene without members: a scene needs at least one member between two nodes")
    for name, member in scene.members.items():
        for node in member.nodes:
            _known(node, scene.nodes, "nodes", "members", name, "nodes")
        _known(member.section, scene.sections, "sections", "members", name, "section")
    for name, ring in scene.rings.items():
        _known(ring.node, scene.nodes, "nodes", "rings", name, "node")
        _known(ring.member, scene.members, "members", "rings", name, "member")
    used = {node for member in scene.members.values() for node in member.nodes}
    used |= {ring.node for ring in scene.rings.values()}
    for name, contact in scene.contacts.items():
        _known(contact.node, scene.nodes, "nodes", "contacts", name, "node")
    held = {name for name in carriers(scene.contacts) if scene.nodes[name].support != "free"}
    for name in scene.nodes:
        if name not in used | held:
            message = "node without member, accepted: a node where at least one member ends, of a ring, or with a"
            raise SceneError(f"{message} support and an obstacle", ("nodes", name))


def check_loaded(scene: Scene) -> None:
    """Refuse a static scene without any load; it can be displayed, but there is nothing to solve.

    Raises
    ------
    SceneError
        There are no loads, prescribed motions, tendons, tubes, gravity, rotation of the axes or preloaded springs.
    """
    if scene.analysis.type in ("modes", "dynamic"):
        return
    pressed = any(spring.rest or spring.length is not None for spring in scene.springs.values())
    everywhere = scene.gravity is not None or scene.rotating is not None
    if not any(scene.driven) and not everywhere and not pressed:
        raise SceneError(
            "scene without load: statics needs at least one load, one motion, one tendon, gravity or turning axes"
        )


def _check_driven(scene: Scene) -> None:
    for name, load in scene.loads.items():
        _known(load.node, scene.nodes, "nodes", "loads", name, "node")
        _known(load.member, scene.members, "members", "loads", name, "member")
        _known(load.history, scene.histories, "histories", "loads", name, "history")
    for name, motion in scene.motions.items():
        _known(motion.node, scene.nodes, "nodes", "motions", name, "node")
        _known(motion.history, scene.histories, "histories", "motions", name, "history")
    for name, actuation in scene.actuations.items():
        _known(actuation.member, scene.members, "members", "actuations", name, "member")
        _known(actuation.history, scene.histories, "histories", "actuations", name, "history")
    for name, field in scene.fields.items():
        _known(field.history, scene.histories, "histories", "fields", name, "history")
    for name, magnet in scene.magnets.items():
        _known(magnet.member, scene.members, "members", "magnets", name, "member")
        _known(magnet.node, scene.nodes, "nodes", "magnets", name, "node")


def _check_tendons(scene: Scene) -> None:
    for name, tendon in scene.tendons.items():
        _known(tendon.history, scene.histories, "histories", "tendons", name, "history")
        try:
            check_way(tendon, scene.nodes, scene.members)
            check_pieces(scene.tendon_pieces[name], scene.center_lines)
        except SceneError as error:
            raise error.within("tendons", name) from None
        pieces = scene.tendon_pieces[name]
        if tendon.measured and all(isinstance(p, Stretch) and scene.members[p.member].type == "rigid" for p in pieces):
            message = "found a way along rigid members alone, which is always as long, accepted: one that changes"
            raise SceneError(f"{message}, or a tension", ("tendons", name, "way"))
        if tendon.rubs:
            check_sliding(name, tendon, scene.shortenings[name], scene.analysis, scene.histories)
        for way in tendon.way:
            section = None if way.member is None else scene.members[way.member].section
            law = None if section is None else scene.sections[section].law
            if way.member is not None and not way.holes and scene.members[way.member].shifted(scene.sections):
                off = scene.members[way.member].off_line(scene.sections)
                message = (
                    f"found the member {way.member!r}, whose section has {off}, accepted: discs, or a member without"
                )
                raise SceneError(message, ("tendons", name))
            if law is not None and not way.holes:
                found = f"found the member {way.member!r}, whose section has the law {law.type!r}"
                raise SceneError(f"{found}, accepted: discs, or a member without a law", ("tendons", name))
            if section is not None and not way.holes and scene.sections[section].stretch_law is not None:
                found = f"found the member {way.member!r}, whose section has a law of stretch"
                raise SceneError(f"{found}, accepted: discs, or a member without one", ("tendons", name))
            if way.member is not None and not way.holes and scene.members[way.member].branches(scene.sections):
                found = f"found the member {way.member!r}, whose section relaxes"
                raise SceneError(f"{found}, accepted: discs, or a member that does not", ("tendons", name))
        if tendon.may_be_slack and scene.analysis.type == "path" and scene.analysis.count_of_modes:
            message = "found a length that is given with modes on a path, in which no tendon becomes slack, accepted:"
            more = "pushes = true, with which it is kept as long, a stiffness, or type = 'modes'"
            raise SceneError(f"{message} {more}", ("tendons", name))


def _check_tubes(scene: Scene) -> None:
    for name, tube in scene.tubes.items():
        _known(tube.history, scene.histories, "histories", "tubes", name, "history")
        try:
            check_tube(tube, scene.nodes, scene.members, scene.sections, scene.center_lines)
            history = None if tube.history is None else scene.histories[tube.history]
            check_turns(tube, scene.analysis.steps if history is None else history.factor(np.array(history.t)))
        except SceneError as error:
            raise error.within("tubes", name) from None
        if scene.rotating is not None:
            raise SceneError("found with tubes, accepted: without them, in axes that do not turn", ("rotating",))
        if scene.analysis.type == "dynamic" and scene.analysis.initial == "undeformed":
            message = "found 'undeformed', where tubes of different curvature are not at rest in each other, accepted:"
            raise SceneError(f"{message} 'equilibrium'", ("analysis", "initial"))
        strung = {
            piece.member for pieces in scene.tendon_pieces.values() for piece in pieces if isinstance(piece, Stretch)
        }
        for member in (member for member in tube.members if member in strung):
            message = f"found the member {member!r}, along which a tendon goes, accepted: tendons through discs"
            raise SceneError(message, ("tubes", name, "members"))
        section = scene.sections[tube.section]
        if scene.analysis.moves and (section.damping or section.drag):
            message = "found a section with damping or drag, accepted: both at the member alone, for all its tubes"
            raise SceneError(message, ("tubes", name, "section"))
        if _massive(scene) and section.missing(["rhoA"]):
            why = _need_of_mass(scene, f"tubes.{name}", "its mass per length")
            raise SceneError(f"the key 'rhoA' is missing: {why}", ("sections", tube.section))


def _check_rings(scene: Scene) -> None:
    for name, ring in scene.rings.items():
        _known(ring.history, scene.histories, "histories", "rings", name, "history")
        node, member, line = scene.nodes[ring.node], scene.members[ring.member], scene.center_lines[ring.member]
        try:
            check_ring(ring, node, member, line, scene.ring_places[name])
        except SceneError as error:
            raise error.within("rings", name) from None
        if _shears(scene, member):
            message = f"found the member {ring.member!r}, which shears, so that its line has a corner at the ring"
            raise SceneError(f"{message}, accepted: {UNSHEARED}", ("rings", name, "member"))


def _known(word: str | None, table: Iterable[str], kind: str, *where: str) -> None:
    if word is not None and word not in table:
        raise SceneError(unknown(word, table, kind), where)


def _check_lengths(scene: Scene) -> None:
    for name, line in scene.center_lines.items():
        if not SHORTEST <= line.length <= LONGEST:
            accepted = f"{SHORTEST:g} to {LONGEST:g} m, whose squares are still numbers"
            raise SceneError(f"found a length of {line.length:.6g} m, accepted: {accepted}", ("members", name))


SHORTEST, LONGEST = 1e-100, 1e100
"""Smallest and largest length of a member, m."""


def _check_releases(scene: Scene) -> None:
    for name, member in scene.members.items():
        for node, release in zip(member.nodes, member.release, strict=True):
            joint = scene.nodes[node].joint
            if release not in ("rigid", joint) and joint != "rigid":
                message = (
                    f"found {release!r} at node {node!r}, whose joint is {joint!r}, accepted: with a rigid joint only"
                )
                raise SceneError(message, ("members", name, "release"))


def _check_axes(scene: Scene) -> None:
    hinges, slides, universals = (
        released(scene.nodes, scene.members, ends) for ends in (("hinge",), SLIDING, ("universal",))
    )
    for name, node in scene.nodes.items():
        used = name in hinges or name in universals or node.has_hinge
        if node.axis != (0.0, 0.0, 1.0) and not used:
            message = "neither the support nor the joint nor a member end released here is a hinge with this axis"
            raise SceneError(message, ("nodes", name, "axis"))
        if node.direction is not None and not node.slides and name not in slides:
            message = f"only a slider has a direction, and the support is {node.support!r}"
            raise SceneError(message, ("nodes", name, "direction"))
        if node.direction is None and name in slides:
            message = "the key 'direction' is missing: a member end slides along its node"
            raise SceneError(message, ("nodes", name))
        if node.support != "slider" and node.rotation != "fixed":
            found = f"found {node.rotation!r}, accepted: only for a slider, and the support is {node.support!r}"
            raise SceneError(found, ("nodes", name, "rotation"))
        if node.support == "cylindrical" and node.joint == "hinge" and node.direction is not None:
            _check_axis_of_guide(name, node)
        _check_universal(name, node, name in universals)


def _check_axis_of_guide(name: str, node: Node) -> None:
    """A node without rotation of its own cannot turn about its guide, and members about another axis in it."""
    if np.linalg.norm(np.cross(unit(node.axis), unit(node.turn_axis))) > tolerances.PARALLEL:
        accepted = f"along the direction of the cylindrical support, {say(node.direction)}, or a joint that is no hinge"
        raise SceneError(f"found {say(node.axis)}, accepted: {accepted}", ("nodes", name, "axis"))


def _check_universal(name: str, node: Node, end: bool) -> None:
    if not node.is_universal and not end:
        if node.axis2 is not None:
            message = "neither the support nor the joint nor a member end released here is a universal joint"
            raise SceneError(message, ("nodes", name, "axis2"))
        return
    if node.axis2 is None:
        raise SceneError("the key 'axis2' is missing: a universal joint has an axis on either side", ("nodes", name))
    if abs(np.dot(unit(node.axis), unit(node.axis2))) > tolerances.WRITTEN:
        message = f"found {say(node.axis2)}, accepted: a direction normal to the key 'axis', {say(node.axis)}"
        raise SceneError(message, ("nodes", name, "axis2"))


def _check_dimension(scene: Scene) -> None:
    if scene.resolved_dimension == "space" and scene.dimension == "plane":
        where = scene._out_of_plane[0] if scene._out_of_plane else ()
        raise SceneError(f"dimension is set to 'plane', but {scene.dimension_reason}", where)


def _check_sections(scene: Scene) -> None:
    for name, member in scene.members.items():
        missing = [] if member.section is None else list(scene.sections[member.section].missing(_needed(scene, name)))
        if missing:
            key, why = missing[0], f"members.{name} needs it in {scene.resolved_dimension} ({scene.dimension_reason})"
            if key == "rhoA":
                outlined = scene.sections[str(member.section)].shape is not None
                key, why = "rho" if outlined else key, _need_of_mass(scene, f"members.{name}", "the mass per length")
            raise SceneError(f"the key {key!r} is missing: {why}", ("sections", str(member.section)))
        law = None if member.section is None else scene.sections[member.section].law
        if law is not None and member.type != "flexible":
            message = f"found a section with the law {law.type!r} of a {member.type} member"
            raise SceneError(f"{message}, accepted: of flexible members", ("members", name, "section"))
        if member.type == "small" and member.section is not None and scene.sections[member.section].relaxation:
            message = "found a section that relaxes of a small member, accepted: of flexible members"
            raise SceneError(message, ("members", name, "section"))
        softened = member.section is not None and scene.sections[member.section].stretch_law is not None
        if softened and member.type != "flexible":
            message = f"found a section with a law of stretch of a {member.type} member, accepted: of flexible members"
            raise SceneError(message, ("members", name, "section"))
        if member.stiffness is not None and member.mass is None and _massive(scene):
            why = _need_of_mass(scene, "the member", "the member")
            raise SceneError(f"the key 'mass' is missing: {why}", ("members", name))
    if scene.analysis.moves or scene.rotating is not None:
        check_masses(scene.nodes, scene.members, scene.sections)


def _massive(scene: Scene) -> bool:
    """Whether masses count."""
    return scene.gravity is not None or scene.rotating is not None or scene.analysis.moves


def _need_of_mass(scene: Scene, what: str, mass: str) -> str:
    if scene.gravity is not None:
        return f"gravity acts on {mass}"
    return f"{what} moves" if scene.analysis.moves else f"turning axes act on {mass}"


def _needed(scene: Scene, member: str) -> tuple[str, ...]:
    in_plane = ("EI3",) if scene.center_lines[member].bending_axis == 3 else ("EI2",)
    stiffness = in_plane if scene.resolved_dimension == "plane" else ("EI2", "EI3", "GJ")
    needed: tuple[str, ...] = () if scene.members[member].type == "rigid" else stiffness
    return (*needed, "rhoA") if _massive(scene) else needed


def _check_soft(scene: Scene) -> None:
    """Refuse stretch and shear that are so soft beside bending that positions are nothing but rounding."""
    for name, member in scene.members.items():
        if not member.stretches(scene.sections):
            continue
        key, line = str(member.section), scene.center_lines[name]
        section = scene.sections[key]
        bending = values_of(section.stiffness_matrix(MIDDLE)).max()
        soft = values_of(section.compliance(MIDDLE))[0] * bending / line.length**2
        worst = int(np.argmax(soft))
        if soft[worst] > SOFTEST:
            what = ("stretch", "shear along b2", "shear along b3")[worst]
            found = f"found a stiffness against {what} of {soft[worst] ** -1.0:.3g} times that against bending over the"
            message = f"{found} squared length of the member {name!r}, accepted: at least {1.0 / SOFTEST:g} times"
            raise SceneError(message, ("sections", key))


MIDDLE = np.array([0.5])
SOFTEST = 1e8
"""Compliance times bending stiffness over squared length: the most with which equilibria were found (1e10 were not)."""


def _check_off_line(scene: Scene) -> None:
    """Refuse centres off the line of members that are not flexible."""
    for name, member in scene.members.items():
        section = None if member.section is None else scene.sections[member.section]
        if section is None or member.type == "flexible":
            continue
        key = section.off_line if member.type == "small" else section.mass_center and "mass_center"
        if key:
            message = (
                f"found the {member.type} member {name!r}, whose section {member.section!r} has {key!r}, accepted:"
            )
            more = " flexible members" if member.type == "small" else " its mass at nodes, or a flexible member"
            raise SceneError(message + more, ("members", name))


def _check_bodies(scene: Scene) -> None:
    for name, member in scene.members.items():
        if member.stiffness is None:
            continue
        try:
            places = np.array([scene.nodes[node].position for node in member.nodes])
            frame = matrix(scene.center_lines[name].quaternions(np.array([0.0])))[0]
            rest = (places - places[0]) @ frame
            check_rigid_motion(member.stiffness, rest)
            if member.mass is not None:
                check_inertia(member.mass, rest)
        except SceneError as error:
            raise error.within("members", name) from None


def _check_loads(scene: Scene) -> None:
    for name, load in scene.loads.items():
        kind = "flexible" if load.member is None else scene.members[load.member].type
        condensed = load.member is not None and scene.members[load.member].stiffness is not None
        if kind == "small" and (condensed or load.type == "moment" or load.frame != "fixed"):
            accepted = "a node there, or a fixed force or distributed load on a small member with a section"
            raise SceneError(f"found the small member {load.member!r}, accepted: {accepted}", ("loads", name, "member"))
        if isinstance(load.profile, Formula):
            load.profile.check_finite(scene.center_lines[str(load.member)].length, "loads", name, "profile")
        joint = "rigid" if load.node is None else scene.nodes[load.node].joint
        if joint != "rigid" and load.type == "moment":
            message = f"node {load.node!r} has no rotation of its own for a moment, as its joint is a {joint}"
            raise SceneError(message, ("loads", name, "node"))
        if joint != "rigid" and load.frame == "follower":
            message = f"node {load.node!r} has no rotation of its own to follow, as its joint is a {joint}"
            raise SceneError(message, ("loads", name, "node"))


def _check_actuated(scene: Scene) -> None:
    for name, actuation in scene.actuations.items():
        kind = scene.members[actuation.member].type
        if kind != "flexible":
            message = f"found the {kind} member {actuation.member!r}, accepted: a flexible one, which bends"
            raise SceneError(message, ("actuations", name, "member"))
        if scene.members[actuation.member].shifted(scene.sections):
            off = scene.members[actuation.member].off_line(scene.sections)
            message = f"found the member {actuation.member!r}, whose section has {off}, accepted: one without"
            raise SceneError(message, ("actuations", name, "member"))
        law = scene.sections[str(scene.members[actuation.member].section)].law
        if law is not None:
            message = f"found the member {actuation.member!r}, whose section has the law {law.type!r}, accepted: one"
            raise SceneError(f"{message} without a law", ("actuations", name, "member"))
        if scene.members[actuation.member].branches(scene.sections):
            message = f"found the member {actuation.member!r}, whose section relaxes, accepted: one that does not"
            raise SceneError(message, ("actuations", name, "member"))
    if scene.magnets and not scene.fields:
        raise SceneError("found magnets without a field, accepted: with [fields.NAME]", ("magnets",))
    if scene.fields and not scene.magnets:
        raise SceneError("found a field without magnets on which it acts, accepted: with [magnets.NAME]", ("fields",))
    for name, magnet in scene.magnets.items():
        if magnet.member is not None and scene.members[magnet.member].type == "small":
            accepted = "a flexible or rigid one, or dipoles at its nodes"
            found = f"found the small member {magnet.member!r}"
            raise SceneError(f"{found}, accepted: {accepted}", ("magnets", name, "member"))
        if magnet.node is not None and scene.nodes[magnet.node].joint != "rigid":
            joint = scene.nodes[magnet.node].joint
            message = (
                f"node {magnet.node!r} has no rotation of its own that a dipole turns with, as its joint is a {joint}"
            )
            raise SceneError(message, ("magnets", name, "node"))
        _check_apart(scene, name, magnet)


def _check_apart(scene: Scene, name: str, magnet: Magnet) -> None:
    """Refuse the field of a dipole at its own place, where it has no bounds."""
    for field in (field for field in scene.fields if scene.fields[field].type == "dipole"):
        place = np.array(scene.fields[field].position)
        if magnet.member is None:
            apart = float(np.linalg.norm(np.array(scene.nodes[str(magnet.node)].position) - place))
        else:
            apart = _distance(scene.center_lines[magnet.member], magnet.part, place)
        if apart < tolerances.WRITTEN * scene.size:
            message = f"found a place on the magnet {name!r}, where the field has no bounds, accepted: one beside it"
            raise SceneError(message, ("fields", field, "position"))


def _distance(line: CenterLine, span: tuple[float, float], place: NDArray[np.float64]) -> float:
    """Distance, m, of a place from a part of a centre line: from samples, then again and again from those beside."""
    low, high = span
    for _ in range(8):
        x = np.linspace(low, high, 65)
        apart = np.linalg.norm(line.positions(x) - place, axis=1)
        nearest = int(np.argmin(apart))
        low, high = x[max(nearest - 1, 0)], x[min(nearest + 1, 64)]
    return float(apart[nearest])


def _check_springs(scene: Scene) -> None:
    for name, spring in scene.springs.items():
        _known(spring.node, scene.nodes, "nodes", "springs", name, "node")
        _known(spring.to, scene.nodes, "nodes", "springs", name, "to")
        for party in spring.between or ():
            ends = [n for n, m in scene.members.items() if spring.node in m.nodes]
            if party not in ("ground", spring.node, *ends):
                message = unknown(party, ("ground", spring.node, *ends), "parties")
                raise SceneError(message, ("springs", name, "between"))
        own = spring.between is None or spring.node in spring.between
        if spring.type == "rotational" and own and scene.nodes[spring.node].joint != "rigid":
            joint = scene.nodes[spring.node].joint
            message = f"node {spring.node!r} has no rotation of its own, as its joint is a {joint}; name the members"
            raise SceneError(message, ("springs", name, "between"))
        if spring.axis is not None:
            _check_spring_axis(name, spring, scene.nodes[spring.node])


def _check_spring_axis(name: str, spring: Spring, node: Node) -> None:
    """A hinge turns about its own axis only: a spring about another one would do nothing."""
    parties = set(spring.between or ("ground", spring.node))
    hinged = node.turn == "hinge" if parties == {"ground", spring.node} else node.joint == "hinge"
    if not hinged or spring.axis is None or ("ground" in parties and spring.node not in parties):
        return
    if np.linalg.norm(np.cross(unit(spring.axis), unit(node.joint_axis))) > tolerances.PARALLEL:
        accepted = f"along the axis of the hinge at node {spring.node!r}, {say(node.joint_axis)}, or left out"
        raise SceneError(f"found {say(spring.axis)}, accepted: {accepted}", ("springs", name, "axis"))


def _check_motions(scene: Scene) -> None:
    reason = f"the scene is in space ({scene.dimension_reason})"
    for name, motion in scene.motions.items():
        try:
            if motion.between is not None:
                check_driven_joint(motion, scene.nodes[motion.node], scene.members)
                continue
            check_motion(motion, scene.nodes[motion.node], scene.resolved_dimension, reason)
        except SceneError as error:
            raise error.within("motions", name) from None
    check_motions_once(scene.motions)


def _check_supports(scene: Scene) -> None:
    # What obstacles hold is known when it is found where members touch them; what moves needs no support, but for an
    # equilibrium that it begins with.
    free = scene.analysis.type in ("modes", "dynamic") and scene.analysis.initial == "undeformed"
    if not scene.contacts and not free:
        check_held(scene)


def check_held(scene: Scene) -> None:
    """Refuse a scene with a part that supports do not hold in every direction.

    Raises
    ------
    SceneError
        Names the nodes of the part and how it can move.
    """
    dimension = scene.resolved_dimension
    check_floating(scene.nodes, scene.members, scene.springs, scene.motions, dimension, scene.tendons, scene.rings)


def _check_moving(scene: Scene) -> None:
    analysis = scene.analysis
    space = f"the scene is in space ({scene.dimension_reason})" if scene.resolved_dimension == "space" else None
    check_velocities(scene.nodes, scene.members, scene.motions, analysis, space)
    for name, member in scene.members.items():
        if isinstance(member.spin, Formula):
            member.spin.check_finite(scene.center_lines[name].length, "members", name, "spin")
        for part in member.turned_about:
            if isinstance(part, Formula):
                part.check_finite(scene.center_lines[name].length, "members", name, "turned")
    check_beginning(analysis, scene.nodes, scene.loads)
    if analysis.moves:
        check_no_contact(analysis, scene.contacts, scene.springs)
    if analysis.type == "dynamic":
        tables = scene.contacts, scene.nodes, scene.members, scene.motions, scene.sections
        check_contact(analysis, *tables, scene.resolved_dimension == "space")
        check_unilateral(analysis, scene.springs, scene.tendons, scene.contacts)
        check_driving(analysis, scene.nodes, scene.members, scene.motions, scene.histories, scene.tendons)


def _bend_where_touched(scene: Scene) -> None:
    """Take small members with a section that may touch something for flexible ones.

    What pushes a member between its ends bends it there, which no condensed stiffness tells.
    """
    touched = set[str]()
    for contact in scene.contacts.values():
        named = members_of(contact, scene.members)
        if contact.between_members and contact.members == "all":
            # Those whose surface nothing tells are left out of all.
            named = [m for m in named if contact_radius(contact, scene.members[m], scene.sections) is not None]
        touched |= set(named)
    members = dict(scene.members)
    for name, member in members.items():
        if name in touched and member.type == "small" and member.section is not None:
            members[name] = member.taken_for("flexible")
        elif name not in touched and member.was_small:
            members[name] = member.taken_for("small")
    # The record is frozen; this is still its validation.
    scene.__dict__["members"] = MappingProxyType(members)


def _check_contacts(scene: Scene) -> None:
    space = scene.resolved_dimension == "space"
    if scene.contacts and scene.analysis.type == "path":
        accepted = "with contacts on a path, accepted: with analysis.type = 'static' and steps"
        for name, spring in scene.springs.items():
            if spring.stop is not None:
                raise SceneError(f"found a stop {accepted}", ("springs", name, "stop"))
        for name, tendon in scene.tendons.items():
            if tendon.may_be_slack:
                raise SceneError(f"found one that may be slack {accepted}, or pushes = true", ("tendons", name))
    if scene.rubs and scene.analysis.equilibria == "all":
        rough = next(name for name, contact in scene.contacts.items() if contact.friction)
        message = f"found 'all' with contacts.{rough}.friction, accepted: 'one', as what slides depends on the order"
        raise SceneError(f"{message} of steps, and where it sticks equilibria are continua", ("analysis", "equilibria"))
    uneven = [name for name, field in scene.fields.items() if not field.uniform]
    if scene.contacts and uneven:
        message = "found a field with a gradient and contacts, accepted: a uniform field, or no contacts"
        raise SceneError(message, ("fields", uneven[0], "type"))
    magnetised = {magnet.member: name for name, magnet in scene.magnets.items()}
    for name, contact in scene.contacts.items():
        _known(contact.member, scene.members, "members", "contacts", name, "member")
        for member in contact.members if isinstance(contact.members, tuple) else ():
            _known(member, scene.members, "members", "contacts", name, "members")
        if contact.type == "point" and space:
            message = f"found a point, accepted in space: a line, as {scene.dimension_reason}"
            raise SceneError(message, ("contacts", name, "type"))
        if contact.between_members:
            _check_between_members(scene, name)
            continue
        if contact.node is not None:
            _check_carried(scene, name, contact.node)
        if contact.radius is not None and contact.radius > FLATTEST * scene.size:
            # Gaps are differences from the centre, which rounding would decide.
            message = (
                f"found {contact.radius:g} m, accepted: up to {FLATTEST:g} times the size of the scene; a plane is flat"
            )
            raise SceneError(message, ("contacts", name, "radius"))
        if contact.center is not None:
            first = next(iter(scene.nodes.values())).position
            away = float(np.abs(np.asarray(contact.center) - np.asarray(first)).max())
            if away > FLATTEST * scene.size:
                message = f"found a centre {away:g} m away, accepted: up to {FLATTEST:g} times the size of the scene"
                raise SceneError(message, ("contacts", name, "center"))
        for member in members_of(contact, scene.members):
            if member in magnetised:
                message = (
                    f"found {member!r}, which may touch {name!r}, accepted: a member that touches nothing, or dipoles"
                )
                raise SceneError(f"{message} at its nodes", ("magnets", magnetised[member], "member"))
            if scene.members[member].type == "small":
                raise SceneError(f"found the small member {member!r}, {SHAPELESS}", ("contacts", name))
            if _shears(scene, scene.members[member]):
                raise SceneError(
                    f"found the member {member!r}, which shears, accepted: {UNSHEARED}", ("contacts", name)
                )
            off = scene.members[member].off_line(scene.sections)
            if off:
                message = f"found the member {member!r}, whose section has {off}, accepted: members without touch"
                raise SceneError(f"{message} obstacles", ("contacts", name))
            line = scene.center_lines[member]
            try:
                check_start(scene.obstacles[name], line.positions, line.tangents, scene.size, contact.member_radius)
            except SceneError as error:
                raise SceneError(f"member {member!r} {error}", ("contacts", name)) from None


SHAPELESS = (
    "whose stiffness tells nothing of its shape between its nodes, accepted: members with a section, as a rigid one"
    " that ends at a node that touches"
)

FLATTEST = 1e9
"""Radius of something round, and how far its centre is away, over the size, at which gaps are known to 1e-7 of it."""


def _check_carried(scene: Scene, name: str, node: str) -> None:
    """Refuse an obstacle on a node that cannot turn it, or that carries it along with all of a member that it stops."""
    joint = scene.nodes[node].joint
    if joint != "rigid":
        message = f"node {node!r} has no rotation of its own that an obstacle turns with, as its joint is a {joint}"
        raise SceneError(message, ("contacts", name, "node"))
    for member in members_of(scene.contacts[name], scene.members):
        if scene.members[member].type == "rigid" and node in scene.members[member].nodes:
            message = f"found {node!r}, an end of the rigid member {member!r}, which moves with the obstacle, accepted:"
            raise SceneError(f"{message} a node of another member", ("contacts", name, "node"))


def _check_points(scene: Scene) -> None:
    """Refuse what is not solved together with contact whose places are unknowns."""
    reasons = ((name, _why_points(scene, name)) for name in scene.contacts)
    name, what = next(((name, why) for name, why in reasons if why), ("", ""))
    if not what:
        return
    where, found = ("contacts", name), f"found {what}"
    if scene.analysis.type not in ("static", "modes", "path"):
        message = f"{found} with analysis.type = {scene.analysis.type!r}"
        raise SceneError(f"{message}, accepted: with 'static' or 'path'", where)
    for edge, stop in scene.obstacles.items():
        if stop.kind == "sharp" and scene.contacts[edge].friction > 0.0:
            raise SceneError("found friction on an edge, accepted: with 'member_radius', or none", ("contacts", edge))
    if scene.rubs and scene.stopped:
        # What is taut and at a stop is found for each step by itself, friction is that of all steps before it.
        where = ("contacts", next(name for name, contact in scene.contacts.items() if contact.friction > 0.0))
        raise SceneError("found friction beside stops or tendons that may be slack, accepted: one of these", where)


def _why_points(scene: Scene, name: str) -> str:
    """What of a contact makes it an unknown where members touch; nothing where it does not."""
    contact = scene.contacts[name]
    if contact.between_members and scene.analysis.type != "dynamic":
        return "contact between members"
    if contact.member_radius > 0.0 and scene.analysis.type != "dynamic":
        return "a radius of members on an obstacle"
    if contact.friction > 0.0 and scene.analysis.type != "dynamic":
        return "friction"
    if contact.node is not None and scene.analysis.type != "dynamic":
        return "an obstacle that a node carries"
    members = (m for m in members_of(contact, scene.members) if _of_points(scene, contact, m))
    return next((f"an obstacle of {member!r}, which has a law or stretches" for member in members), "")


def _check_between_members(scene: Scene, name: str) -> None:
    """Refuse contact between members whose surfaces are not known, or that no search is for."""
    contact, where = scene.contacts[name], ("contacts", name)
    names = members_of(contact, scene.members)
    if contact.members == "all":
        names = [member for member in names if scene.members[member].type != "small"]
    if not pairs_of(names, scene.members):
        message = f"found {enumerated(names) or 'no member'}, accepted: two members or more, or one that is flexible"
        raise SceneError(message, where)
    for member in names:
        record = scene.members[member]
        if record.type == "small":
            raise SceneError(f"found the small member {member!r}, {SHAPELESS}", where)
        if contact_radius(contact, record, scene.sections) is None:
            message = f"found the member {member!r}, whose section has no radius, accepted: the key 'radius'"
            raise SceneError(f"{message}, or a section with shape = 'circle' or 'tube' of one radius", where)
        if scene.analysis.type == "dynamic" and record.type == "rigid" and scene.center_lines[member].turning:
            message = f"found the curved rigid member {member!r} in a motion, accepted: straight or flexible ones"
            raise SceneError(message, where)
        if record.off_line(scene.sections):
            message = f"found the member {member!r}, whose section has {record.off_line(scene.sections)}"
            raise SceneError(f"{message}, accepted: members without touch each other", where)
        if _shears(scene, record):
            raise SceneError(f"found the member {member!r}, which shears, accepted: {UNSHEARED}", where)
        if record.type == "flexible" and (sharp := too_sharp(scene, name, member)):
            raise SceneError(f"{sharp} in the undeformed scene, accepted: a radius below that of its curvature", where)


def too_sharp(scene: Scene, contact: str, member: str, bent: Callable[[Array], Array] | None = None) -> str:
    """Where a member is bent more sharply than its surface in a contact allows, in words; empty where it is not.

    Parameters
    ----------
    scene : Scene
    contact, member : str
        Names.
    bent : callable, optional
        Fractions (n,) of the length to curvatures (n, 3), 1/m; by default those of the undeformed member.
    """
    line = scene.center_lines[member]
    radius = contact_radius(scene.contacts[contact], scene.members[member], scene.sections)
    x = np.union1d(np.linspace(0.0, 1.0, SEEN_BENDS[bent is not None]), np.array(line.breaks))
    bends = np.linalg.norm(values_of((bent or line.curvatures)(x))[:, 1:], axis=1)
    worst, radius = int(np.argmax(bends)), float(values_of(radius))
    if not bends[worst] * radius > SHARPEST:
        return ""
    found = f"the member {member!r} of the radius {radius:.3g} m is bent to a radius of {1.0 / bends[worst]:.3g} m"
    return f"{found} at {x[worst]:.3g} of its length"


SHARPEST, SEEN_BENDS = 1.0 + 1e-9, (1025, 129)
"""Curvature times radius beyond which the inner side of a member would be turned inside out, but for rounding, and the
number of places where it is looked at, undeformed and deformed.
"""


def _shears(scene: Scene, member: Member) -> bool:
    """Whether the sections of a member do not stay across its centre line."""
    if not member.stretches(scene.sections):
        return False
    return bool(scene.sections[str(member.section)].compliance(0.5)[0, 1:].any())


UNSHEARED = "members that do not shear: a section without GA2, GA3 and shear"
"""What is accepted where members slide."""


def _of_points(scene: Scene, contact: Contact, member: str) -> bool:
    """Whether a member has a law that is known where it touches an obstacle at points only."""
    record = scene.members[member]
    if record.section is None:
        return False
    section = scene.sections[record.section]
    curved = record.stretches(scene.sections) and (contact.radius is not None or section.stretch_law is not None)
    return curved or section.law is not None


def _check_quantity(scene: Scene, quantity: str, at: float | None, *where: str) -> None:
    """Refuse a quantity that answers of this scene do not have."""
    try:
        name = answer_name(quantity)
        check_answer(scene, name)
    except SceneError as error:
        raise SceneError(error.bare, (*where, "quantity")) from None
    if name.kind.along and at is None and name.at is None:
        raise SceneError(f"found {quantity!r}, accepted: with the key 'at'", (*where, "quantity"))


_ANSWERS = {
    "step": ("static", "path", "modes"),
    "time": ("dynamic",),
    "crossing": ("path",),
    "limit_point": ("path",),
    "bifurcation": ("path",),
    "flutter_point": ("path",),
    "transition": ("path",),
}
"""Types of the analysis that have an answer of this kind."""


def _check_expect(scene: Scene) -> None:
    if scene.analysis.until is not None:
        _check_quantity(scene, scene.analysis.until.quantity, None, "analysis", "until")
    for i, expect in enumerate(scene.expect):
        if expect.equilibrium is not None and scene.analysis.equilibria != "all":
            message = "found with analysis.equilibria = 'one', accepted: with analysis.equilibria = 'all'"
            raise SceneError(message, ("expect", str(i), "equilibrium"))
        _check_quantity(scene, expect.quantity, expect.at, "expect", str(i))
        for key, types in _ANSWERS.items():
            if getattr(expect, key) is not None and scene.analysis.type not in types:
                accepted = " or ".join(map(repr, types))
                message = f"found the analysis {scene.analysis.type!r}, accepted: {accepted} with this key"
                raise SceneError(message, ("expect", str(i), key))
        if expect.time is not None and not 0.0 <= expect.time <= scene.analysis.duration:
            accepted = f"from 0 to the end of the analysis at {scene.analysis.duration:g} s"
            raise SceneError(f"found {expect.time:g} s, accepted: {accepted}", ("expect", str(i), "time"))
        if expect.step is not None and not any(math.isclose(expect.step, f) for f in scene.analysis.steps):
            accepted = f"a factor of analysis.steps, {say(scene.analysis.steps)}"
            raise SceneError(f"found {expect.step:g}, accepted: {accepted}", ("expect", str(i), "step"))


def check_scene(value: object, call: str, *, steps: bool = True) -> None:
    """Refuse an argument that is no scene.

    Parameters
    ----------
    value : the argument
    call : the call for the message, with braces for the argument: ``check({}, ...)``
    steps : whether its steps come one after the other, else laws with memory and insertions are refused

    Raises
    ------
    SceneError
        For names of files and for tables the message shows how to make a scene of them.
    """
    if isinstance(value, Scene):
        if not steps:
            message = f"{call.partition('(')[0]} knows no steps, accepted: solve(scene)"
            refuse_memory(value, message)
            refuse_insertion(value, message)
        return
    found, made = say(value), "load('FILE.toml')"
    if isinstance(value, (str, os.PathLike)):
        name = say(os.fspath(value))
        found, made = f"the {'text' if isinstance(value, str) else 'path'} {name}", f"load({name})"
    elif isinstance(value, Mapping):
        found, made = "a table", "Scene.from_dict(...)"
    raise SceneError(f"{call.partition('(')[0]} takes a Scene, found {found}; accepted: {call.format(made)}")


_RULES: tuple[Callable[[Scene], None], ...] = (
    _check_members,
    _bend_where_touched,
    _check_lengths,
    _check_tendons,
    _check_tubes,
    _check_rings,
    _check_driven,
    _check_axes,
    _check_dimension,
    _check_sections,
    _check_soft,
    _check_releases,
    _check_bodies,
    _check_off_line,
    _check_loads,
    _check_actuated,
    _check_springs,
    _check_motions,
    _check_supports,
    _check_moving,
    _check_contacts,
    _check_points,
    check_memory,
    check_insertion,
    _check_expect,
)
