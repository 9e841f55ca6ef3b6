"""Members divided into segments between places, and which displacements have to be unknowns of their own.

A *place* is a node of the scene, an end of elements within a member whose displacement is needed (as under a follower
load), or the end of a member that slides along its node.  A *segment* is a run of elements of one member between two
places; most members are one segment.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..description.obstacles import carriers, members_of
from ..description.scene import Scene
from ..description.structure import SLIDING
from ..description.tendons import Hole, Piece
from ..mathematics.arrays import Array, Index
from .mesh import ContactPoint, Mesh
from .rotations import end_joints
from .terms import GROUND

__all__ = [
    "MOST_COUPLED",
    "SAME_CUT",
    "SIDES",
    "Segment",
    "Segments",
    "angle_of",
    "beside_line",
    "cut_members",
    "cuts_of_point",
    "elongation_of",
    "one_sided",
    "place_of_cut",
    "place_of_ring",
    "place_within",
    "pulled_place",
    "spanned",
    "standing",
    "stations_of_line",
    "switch_of",
    "tensions_of",
    "weights_towards",
]

MOST_COUPLED = 20
"""Rotations and strains at most that the length between two holes of a tendon couples: of more, places of the holes are
less work (measured).
"""


@dataclass(frozen=True)
class Segment:
    """A run of elements of a member between two places: member, slice of elements, names of the places."""

    member: str
    elements: slice
    start: str
    end: str


@dataclass(frozen=True, eq=False)
class Segments:
    """All segments and places of a model.

    Attributes
    ----------
    places : tuple of str
        Names: the nodes of the scene, then places within members and sliding ends.
    retained : frozenset of str
        Places whose displacement is prescribed or an unknown in either assembly.
    parts : tuple of Segment
        In the order of their elements.
    owner : ndarray (elements,)
        Number of the segment of each element.
    ends : mapping of (str, int) to str
        Place of the first (0) and the second end (1) of each member.
    strains : ndarray (elements, points)
        Numbers of the places that hold the scaled strains of the points of elements in place of a displacement, -1 in
        members that do not stretch; no points where none does.
    relaxing : ndarray (2, branches, elements, points)
        The same of the part of the changes of curvature (0) and of the strains (1) that has relaxed in each branch.
    strained : mapping of str to mapping of int to str
        Components that are unknown at each of these places, which are the last ones, with their names; places of
        rings, switches and contact points are among them.
    pulled : int
        Number of places before these that tell tensions and elongations of tendons.
    angles : mapping of str to ndarray (elements, nodes)
        For each tube, and each element along which it lies, numbers of the places whose first components are the angles
        by which it is twisted against the section at the nodes, since its base; of a base that is held the ground.
    """

    places: tuple[str, ...]
    retained: frozenset[str]
    parts: tuple[Segment, ...]
    owner: Index
    ends: Mapping[tuple[str, int], str]
    strains: Index
    relaxing: Index
    strained: Mapping[str, Mapping[int, str]]
    pulled: int
    angles: Mapping[str, Index]

    def alike(self, other: Segments) -> bool:
        """Whether other segments of the same scene join the same places by as many elements."""
        mine, its = ((one.places, one.retained, one.parts, one.strained) for one in (self, other))
        return mine == its

    @property
    def without_position(self) -> Index:
        """Numbers of the places that hold strains, or what tells of tendons."""
        return np.arange(len(self.places) - len(self.strained) - self.pulled, len(self.places))

    @property
    def of_tendons(self) -> Index:
        """Numbers of the places that hold what tells of tendons."""
        return self.without_position[: self.pulled]

    @property
    def first(self) -> Index:
        """Number of the first element of each segment."""
        return np.array([part.elements.start for part in self.parts], dtype=np.intp)

    @functools.cached_property
    def single(self) -> tuple[Index, Index]:
        """Numbers of the elements that are segments by themselves, and of the places at which these start."""
        alone = [part for part in self.parts if part.elements.stop - part.elements.start == 1]
        pairs = [(part.elements.start, self.place(part.start)) for part in alone]
        found = np.array(pairs, dtype=np.intp).reshape(-1, 2)
        return found[:, 0], found[:, 1]

    @functools.cached_property
    def longer(self) -> tuple[Segment, ...]:
        """All segments of several elements."""
        return tuple(part for part in self.parts if part.elements.stop - part.elements.start != 1)

    def place(self, name: str) -> int:
        """Number of a place, by its name."""
        return self._number[name]

    @functools.cached_property
    def _number(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.places)}


def standing(mesh: Mesh, point: ContactPoint, side: int) -> int | None:
    """Number of the end of elements at which a point of contact stays on a member; None where it is within one."""
    if point.slides[side]:
        return None
    at, member = point.at[side], point.members[side]
    near = mesh.cut_at(member, at)
    return near if abs(mesh.cuts[member][near] - at) < SAME_CUT else None


def beside_line(mesh: Mesh, point: ContactPoint) -> list[tuple[int, bool, float]]:
    """Of a point on a line the elements beside it: number along the member, whether they end there, and their share."""
    cut, cuts = standing(mesh, point, 0), mesh.cuts[point.members[0]]
    assert cut is not None
    elements = [i for i, taken in zip((cut - 1, cut), point.sides, strict=True) if taken and 0 <= i < len(cuts) - 1]
    lengths = [cuts[i + 1] - cuts[i] for i in elements]
    return [(i, i < cut, length / sum(lengths)) for i, length in zip(elements, lengths, strict=True)]


def stations_of_line(mesh: Mesh, point: ContactPoint) -> tuple[Array, Array]:
    """Of a point on a line the places (n,) at which the elements beside it are integrated, fractions of the length of
    the member, and their weights (n,) in its means, sum 1.
    """
    cuts, (points, weights) = mesh.cuts[point.members[0]], mesh.rule
    at, share = list[Array](), list[Array]()
    for i, ends, part in beside_line(mesh, point):
        at.append(cuts[i] + points * (cuts[i + 1] - cuts[i]))
        share.append(part * weights_towards(points if ends else 1.0 - points, weights))
    return np.concatenate(at), np.concatenate(share)


def weights_towards(points: Array, weights: Array) -> Array:
    """Weights of the points of an element in the mean that is taken with what rises evenly from its start to its end.

    Parameters
    ----------
    points, weights : ndarray (points,)
        Places in [0, 1] from the end at which it is zero, and the weights of integrals, sum 1.
    """
    return np.asarray(2.0 * weights * points)


def cuts_of_point(mesh: Mesh, point: ContactPoint, side: int) -> list[int]:
    """The ends of elements of a member whose places a point of contact needs; none where it is within an element."""
    if point.line:
        return [element for element, *_ in beside_line(mesh, point)]
    cut = standing(mesh, point, side)
    return [] if cut is None else [cut]


SAME_CUT = 1e-13
"""Fraction of a length within which a place is where elements end."""


def place_of_cut(mesh: Mesh, ends: Mapping[tuple[str, int], str], member: str, cut: int) -> str:
    """Name of the place where elements of a member end."""
    last = len(mesh.cuts[member]) - 1
    return ends[member, cut == last] if cut in (0, last) else place_within(member, mesh.cuts[member][cut])


def place_within(member: str, at: float) -> str:
    """Name of the place at a fraction of the length of a member where elements end."""
    return f"{member} at {at:.12g}"


def elongation_of(tendon: str) -> str:
    """Name of the place whose displacement is the elongation of an elastic tendon."""
    return f"elongation of tendons.{tendon}"


def pulled_place(scene: Scene, mesh: Mesh, tendon: str) -> str:
    """Name of the place whose first displacement tells how a tendon of given length is pulled; empty where none does.

    It is the elongation of one that stretches, the tension at the pulled end of one that rubs.
    """
    record = scene.tendons[tendon]
    if record.stiffness is not None:
        return elongation_of(tendon)
    taut = record.measured and (tendon, "slack") not in mesh.stops
    return f"tension of tendons.{tendon}" if record.rubs and taut else ""


SIDES = ("low", "high")
"""The two stops of a spring."""


def one_sided(scene: Scene) -> tuple[tuple[str, str, str], ...]:
    """Table, name and side of each unilateral constraint of a scene but its obstacles: strings ``slack``, stops of
    springs ``low`` and ``high``; tendons first, in the order of the scene.
    """
    strings = [("tendons", name, "slack") for name, tendon in scene.tendons.items() if tendon.may_be_slack]
    stopped = [name for name, spring in scene.springs.items() if spring.stop is not None]
    return (*strings, *(("springs", name, side) for name in stopped for side in SIDES))


def switch_of(table: str, name: str, side: str) -> str:
    """Name of the place with the opening of a unilateral constraint, and of the row that switches it."""
    return f"switch of {table}.{name}, {side}"


def angle_of(tube: str, number: int) -> str:
    """Name of the place that holds the angle of a tube at a node, counted from 0 at its base."""
    return f"tubes.{tube}, node {number + 1}"


def place_of_ring(ring: str) -> str:
    """Name of the place whose first displacement says how far a ring has moved along its member."""
    return f"place of rings.{ring}"


def tensions_of(scene: Scene, mesh: Mesh, tendon: str) -> tuple[str, ...]:
    """Names of the places whose displacements are the tension behind each part of a tendon that rubs, but the last.

    In the order from the pulled end: a part is a straight piece, a piece along a rigid member, or an element.
    """
    if not scene.tendons[tendon].rubs:
        return ()
    names: list[str] = []
    for i, piece in enumerate(scene.tendon_pieces[tendon]):
        if isinstance(piece, tuple) or scene.members[piece.member].type == "rigid":
            names.append(f"tension of tendons.{tendon} behind its piece {i + 1}")
            continue
        cuts = mesh.cuts[piece.member]
        inside = cuts[mesh.cut_at(piece.member, piece.start) : mesh.cut_at(piece.member, piece.end) + 1]
        ends = zip(inside, inside[1:], strict=False)
        found = [f"tension of tendons.{tendon} in its piece {i + 1}, {a:.12g} to {b:.12g}" for a, b in ends]
        names += found if piece.forwards else found[::-1]
    return tuple((names[::-1] if scene.tendons[tendon].pulled_at == "end" else names)[:-1])


def spanned(scene: Scene, mesh: Mesh, piece: Piece) -> range:
    """Numbers, along their member, of the elements between two holes of a tendon that need no places; else none.

    The holes are in one flexible member, with few elements between them, which integrate at their nodes and are
    strained by their own strains alone.
    """
    if mesh.places or mesh.gauss or scene.shifted or not isinstance(piece, tuple):
        return range(0)
    first, last = piece
    member = first.member
    if member is None or member != last.member or scene.members[member].type != "flexible":
        return range(0)
    between = range(*sorted(mesh.cut_at(member, hole.at) for hole in piece))
    coupled = len(between) * mesh.order + 1
    if scene.stretches:
        coupled += len(between) * (mesh.order + 1)
    return between if coupled <= MOST_COUPLED else range(0)


def _placed(scene: Scene, mesh: Mesh) -> Iterator[Hole]:
    """The holes of tendons that need places: the ends of straight pieces that are no function of rotations alone."""
    for name, pieces in scene.tendon_pieces.items():
        for piece in pieces:
            if isinstance(piece, tuple) and (scene.tendons[name].rubs or not spanned(scene, mesh, piece)):
                yield from piece


def _retained_cuts(scene: Scene, mesh: Mesh, member: str) -> list[int]:
    """Inner cuts of a member that are needed as places of their own: holes of tendons, and loads that turn with it."""
    cuts = mesh.cuts[member]
    inner = range(1, len(cuts) - 1)
    if member in _pushed(scene):
        return list(inner)
    following = [load for load in scene.loads_along.get(member, ()) if load.follows]
    spread = [load.part for load in following if load.type == "distributed"]
    wanted = {cut for a, b in spread for cut in range(_nearest(cuts, a), _nearest(cuts, b) + 1)}
    wanted |= {_nearest(cuts, load.at or 0.0) for load in following if load.type != "distributed"}
    wanted |= {_nearest(cuts, hole.at) for hole in _placed(scene, mesh) if hole.member == member}
    return [cut for cut in inner if cut in wanted]


def _nearest(cuts: Array, place: float) -> int:
    """Index of the cut that is nearest to a fraction of the length."""
    return int(np.argmin(np.abs(cuts - place)))


def _pushed(scene: Scene) -> set[str | None]:
    """Members and nodes whose magnets are in fields that are not uniform, so that their places matter."""
    if all(field.uniform for field in scene.fields.values()):
        return set()
    return {magnet.node if magnet.member is None else magnet.member for magnet in scene.magnets.values()}


def _sprung(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """Nodes whose displacement springs, tendons, small members and magnets act upon, and first nodes of what follows
    its section.
    """
    pushed = _pushed(scene)
    yield from (magnet.node for magnet in scene.magnets.values() if magnet.node in pushed and magnet.node is not None)
    for name in scene.members:
        if name in pushed:
            yield from scene.members[name].nodes
    for hole in _placed(scene, mesh):
        yield from [hole.node] if hole.node is not None else []
        yield from scene.members[hole.member].nodes if hole.member is not None else ()
    for ring in scene.rings.values():
        yield ring.node
    for spring in scene.springs.values():
        if spring.type == "translational":
            yield from (node for node in (spring.node, spring.to) if node is not None)
    for member in scene.members.values():
        if member.type == "small":
            yield from member.nodes
    for load in scene.loads.values():
        if load.follows and load.member is not None:
            yield from scene.members[load.member].nodes


def cut_members(scene: Scene, mesh: Mesh) -> Segments:
    """The segments of a scene on a mesh."""
    places, ends = list(scene.nodes), {}
    retained: set[str] = set()
    # Whatever of it acts, so that all choices have the same unknowns.
    stopped = set[str]()
    for contact in scene.contacts.values() if mesh.spots is not None else ():
        stopped |= set(members_of(contact, scene.members))
    # Of each point and side the ends of elements whose places it needs.
    pointed = [(m, cuts_of_point(mesh, p, side)) for p in mesh.points for side, m in enumerate(p.members)]
    parts: list[Segment] = []
    begin = 0
    for name, member in scene.members.items():
        for i, (node, joint) in enumerate(end_joints(scene, member)):
            ends[name, i] = node
            if joint in SLIDING:
                ends[name, i] = f"{node} at {name}"
                places.append(ends[name, i])
                retained |= {node, ends[name, i]}
        if name not in mesh.cuts:
            continue
        cuts = mesh.cuts[name]
        last = len(cuts) - 1
        every = name in stopped or (mesh.places and member.type == "flexible")
        inner = range(1, last) if every else _retained_cuts(scene, mesh, name)
        own = {cut for m, needed in pointed if m == name for cut in needed}
        stops = [0, *sorted({*inner, *own} - {0, last}), last]
        here = ends[name, 0]
        for a, b in zip(stops, stops[1:], strict=False):
            there = ends[name, 1] if b == len(cuts) - 1 else place_within(name, cuts[b])
            if b < len(cuts) - 1:
                places.append(there)
                retained.add(there)
            parts.append(Segment(name, slice(begin + a, begin + b), here, there))
            here = there
        begin += len(cuts) - 1
    told: list[str] = []
    for name in scene.tendons:
        told += [pulled_place(scene, mesh, name)] if pulled_place(scene, mesh, name) else []
        told += tensions_of(scene, mesh, name)
    places += told
    retained |= set(told)
    # Turning axes act upon all that has mass.
    retained |= set(scene.nodes) if scene.rotating is not None else set()
    retained |= {ends[ring.member, 0] for ring in scene.rings.values()} | carriers(scene.contacts)
    touched = {(touching, cut) for touching, needed in pointed for cut in needed or [0]}
    retained |= {place_of_cut(mesh, ends, *one) for one in touched}
    retained |= set(_sprung(scene, mesh)) | {load.node for load in scene.loads.values() if load.follows and load.node}
    sizes = [part.elements.stop - part.elements.start for part in parts]
    owner = np.repeat(np.arange(len(parts)), sizes)
    strains, strained = _strained(scene, mesh, len(places), len(owner))
    relaxing = _relaxing(scene, mesh, len(places), len(owner), strained)
    angles, twisted = _angles(scene, mesh, len(places) + len(strained))
    strained |= twisted | {place_of_ring(name): {0: "arc length"} for name in scene.rings}
    for one in one_sided(scene) if mesh.switched else ():
        strained[switch_of(*one)] = {0: "opening", 1: "idle"}
    axes = "xyz" if scene.resolved_dimension == "space" else "xy"
    for point in mesh.points:
        strained |= {point.place(side): {0: "arc length"} for side, free in enumerate(point.slides) if free}
        names = ("across", "along", "along too") if point.line else axes
        strained[point.between] = dict(enumerate(names[: point.components(len(axes))]))
        if point.grip is not None:
            strained[point.pressed] = dict(enumerate(("across", "along", "along too")[: len(axes)]))
    return Segments(
        (*places, *strained),
        frozenset(retained | set(strained)),
        tuple(parts),
        owner,
        ends,
        strains,
        relaxing,
        strained,
        len(told),
        angles,
    )


def _angles(scene: Scene, mesh: Mesh, first: int) -> tuple[dict[str, Index], dict[str, Mapping[int, str]]]:
    """:attr:`Segments.angles`, and the places with their one component; places are numbered from ``first``."""
    found, places = dict[str, Index](), dict[str, Mapping[int, str]]()
    for name, runs in scene.tube_runs.items():
        spans = ([mesh.cut_at(run.member, end) for end in (run.start, run.end)] for run in runs)
        count = sum(b - a for a, b in spans)
        numbers = mesh.order * np.arange(count)[:, None] + np.arange(mesh.order + 1)
        held = scene.tubes[name].start >= 0.0
        found[name] = np.where(held & (numbers == 0), GROUND, first + len(places) + numbers - held)
        places |= {angle_of(name, i): {0: "angle"} for i in range(int(held), mesh.order * count + 1)}
    return found, places


STRAINS = ("along", "across", "across b3")
"""Names of the components of a strain."""


def _strained(scene: Scene, mesh: Mesh, first: int, elements: int) -> tuple[Index, dict[str, Mapping[int, str]]]:
    """:attr:`Segments.strains` and :attr:`Segments.strained`; places are numbered from ``first``."""
    strained: dict[str, Mapping[int, str]] = {}
    if not scene.stretches:
        return np.zeros((elements, 0), np.intp), strained
    strains, begin = np.full((elements, mesh.order + 1), -1), 0
    points = mesh.rule[0]
    for name in mesh.cuts:
        cuts, member = mesh.cuts[name], scene.members[name]
        if member.stretches(scene.sections):
            components = _yielding(scene, name)
            for e in range(len(cuts) - 1):
                for k, point in enumerate(points):
                    strains[begin + e, k] = first + len(strained)
                    strained[f"strain of {name}, element {e + 1}, at {point:.6g} of it"] = components
        begin += len(cuts) - 1
    return strains, strained


def _yielding(scene: Scene, name: str) -> dict[int, str]:
    """Components in which a member stretches or shears."""
    yielding = scene.sections[str(scene.members[name].section)].compliance(np.array([0.5]))[0] > 0.0
    axes = scene.center_lines[name].strained_axes(scene.resolved_dimension == "space")
    return {i: STRAINS[i] for i in np.flatnonzero(yielding[axes]).tolist()}


def _relaxing(scene: Scene, mesh: Mesh, first: int, elements: int, strained: dict[str, Mapping[int, str]]) -> Index:
    """:attr:`Segments.relaxing`, with the places added to ``strained``: of motions and vibrations alone.

    In equilibrium everything has relaxed, so that nothing is unknown.
    """
    branches = {name: scene.members[name].branches(scene.sections) for name in mesh.cuts}
    count = max(map(len, branches.values()), default=0) if mesh.places else 0
    if scene.rotating is not None and not scene.analysis.moves:
        count = 0
    found, begin = np.full((2, count, elements, mesh.order + 1 if count else 0), -1), 0
    about = dict(enumerate(("b1", "b2", "b3"))) if scene.resolved_dimension == "space" else {0: "z"}
    for name, cuts in mesh.cuts.items() if count else ():
        kinds: list[tuple[str, Mapping[int, str]]] = [("bending", {i: f"about {axis}" for i, axis in about.items()})]
        if scene.members[name].stretches(scene.sections):
            kinds.append(("strain", _yielding(scene, name)))
        for kind, (what, components) in enumerate(kinds):
            for i in range(len(branches[name])):
                for e in range(len(cuts) - 1):
                    for k, point in enumerate(mesh.rule[0]):
                        found[kind, i, begin + e, k] = first + len(strained)
                        place = f"relaxed {what} {i + 1} of {name}, element {e + 1}, at {point:.6g} of it"
                        strained[place] = components
        begin += len(cuts) - 1
    return found
