"""Meshes: the ends of the elements of each member, as fractions of its length."""

from __future__ import annotations

import bisect
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np

from .. import tolerances
from ..description.formulas import Formula
from ..description.records import brief, counted
from ..description.scene import Scene, check_scene
from ..description.sections import FINE
from ..description.sections import breaks as kinks
from ..description.showing import first_lines, shown
from ..description.tendons import kinks_along
from ..description.tubes import tube_breaks
from ..mathematics import interpolation
from ..mathematics.arrays import Array, first_of_largest
from .carried import carried, loose_ends, magnetic, natural_turning

__all__ = [
    "YIELDING",
    "Approach",
    "ContactPoint",
    "Grip",
    "Mesh",
    "Remembered",
    "Spot",
    "Vector",
    "breaks_of",
    "cut",
    "every_other",
    "first_mesh",
    "uniform_mesh",
    "within_elements",
]


Vector = tuple[float, float, float]


YIELDING = 1e-9
"""How far what is rough gives way under the loads, dimensionless: what is shared among several places of something
rigid, or that keeps its length, is shared evenly.
"""


@dataclass(frozen=True)
class Grip:
    """Friction at a point of contact since the last state of a way.

    Attributes
    ----------
    coefficient : float
        Coulomb's.
    firm : float
        Force over slip, dimensionless, of :mod:`~sfetcas.mechanics.contact_points`; zero where it sticks anyhow.
    yields : float
        How far what sticks gives way under the loads, dimensionless.
    frame : tuple of vectors
        Directions across the normal, one in the plane and two in space.
    origin : vector
        The vector of the point, as of :class:`ContactPoint`, between the same places of the members in the last state,
        or when they began to touch, m.
    before, now : tuple of vectors
        Unit tangents of the members there, in the last state and now.
    touched : vector
        How far the places had moved along each other since the last state when they began to touch, m.
    share : float
        Of the step from the last state, after which they began to touch.
    along : tuple of vectors
        On a line directions across the normal at each point of the elements beside it, those of a point together;
        ``frame`` and ``origin`` are then components of the means, see :mod:`~sfetcas.mechanics.contact_lines`.
    """

    coefficient: float
    firm: float
    frame: tuple[Vector, ...]
    origin: Vector
    before: tuple[Vector, ...]
    now: tuple[Vector, ...]
    touched: Vector = (0.0, 0.0, 0.0)
    share: float = 0.0
    along: tuple[Vector, ...] = ()
    yields: float = YIELDING


@dataclass(frozen=True)
class ContactPoint:
    """A place where two members touch, a member touches itself, or a member touches an obstacle.

    Elements need not end there: where it is on the members are unknowns.

    Attributes
    ----------
    contact : str
        Name of the record.
    members : (str, str) or (str,)
        The first and the second member, the same one twice where it touches itself; the one that touches an obstacle.
    at : tuple of float
        Where the search for it begins, fractions of their lengths.
    slides : tuple of bool
        Whether its place on each member is an unknown; else it stays.
    distance : float
        What the distance between the centre lines is, or from the plane, the centre or the axis of an obstacle to the
        centre line, m; negative inside of what is round.
    number : int
        Distinguishes the points of one record.
    normal : vector, optional
        Direction along which the distance is measured: that of a plane; of what is new.  Of an obstacle that a node
        carries all directions and vectors of a point turn with it: they are those of the undeformed scene.
    new : bool
        Whether it is not yet known how hard it pushes: where it is is no unknown, and the normal is a given one.
    grip : Grip, optional
        Friction, where there is any.
    line : bool
        Whether it is the end of elements along which a member lies on an obstacle, and stands for what presses there,
        see :mod:`~sfetcas.mechanics.contact_lines`.
    sides : (bool, bool)
        Whether it does so on the element before it, and on the one beyond.
    edge : float
        On an edge 1 or -1, the sign of (edge x tangent) on the side where its member is; else zero.
    tangent : bool
        Whether the member also stays tangential to the obstacle there, as where a line ends; elements do so, too.
    """

    contact: str
    members: tuple[str, ...]
    at: tuple[float, ...]
    slides: tuple[bool, ...]
    distance: float
    number: int = 0
    normal: Vector | None = None
    new: bool = False
    grip: Grip | None = None
    line: bool = False
    sides: tuple[bool, bool] = (True, True)
    edge: float = 0.0
    tangent: bool = False

    @functools.cached_property
    def name(self) -> str:
        """Name of its rows, and of its places."""
        return f"contacts.{self.contact}, point {self.number + 1}"

    @functools.cached_property
    def key(self) -> tuple[object, ...]:
        """What tells it from other points of a state: what touches, where, and what it stands for."""
        at = tuple(round(min(max(x, 0.0), 1.0), 9) for x in self.at)
        return self.contact, self.members, at, self.line and self.sides

    @functools.cached_property
    def pair(self) -> tuple[str, tuple[str, ...]]:
        """The record and its members: what it is a point of."""
        return self.contact, self.members

    def place(self, side: int) -> str:
        """Name of the place whose first displacement says how far it has moved along its first or second member."""
        return f"place of {self.name} on its {('first', 'second')[side]} member"

    def rows(self, axes: int) -> list[str]:
        """Names of its rows in the plane (two axes) or in space: of the vector between centre lines, and the gap.

        On a line these are means instead of the vector: of the gap alone without friction.
        """
        gap, count = [] if self.grip else [f"{self.name}, gap"], self.components(axes)
        gap = [f"{self.name}, beside", *gap] if self.met else gap
        gap += [f"{self.name}, tangent"] if self.tangent else []
        return [*([f"{self.name}, {i + 1} of {count}" for i in range(count)] if count > 1 else [self.name]), *gap]

    def components(self, axes: int) -> int:
        """Number of components of the vector between centre lines, or of the means along a line."""
        return 1 if self.line and self.grip is None else axes

    @property
    def met(self) -> bool:
        """Whether its place is where the edge is, which takes two rows: of what is new the distance is one."""
        return bool(self.edge) and not self.new

    @property
    def pressed(self) -> str:
        """Name of the place whose displacements are its forces across and along, where there is friction."""
        return f"forces of {self.name}"

    @functools.cached_property
    def between(self) -> str:
        """Name of the place that is the vector from the second centre line, or the obstacle, to the first."""
        return f"distance of {self.name}"


@dataclass(frozen=True)
class Spot:
    """A place that an obstacle stops in a motion: an end of a member, or of elements within one.

    Attributes
    ----------
    contact, member : str
        Names of the obstacle and the member; of several members that end there the first.
    at : float
        Fraction of the length of the member.
    place : str
        Name of the place among those of the model: of the node, or of the end of elements.
    rubs : bool
        Whether the model also has rows that hold it along the obstacle.
    """

    contact: str
    member: str
    at: float
    place: str
    rubs: bool = False

    @property
    def name(self) -> str:
        """Name of its constraint row."""
        return f"contacts.{self.contact} at {self.place}"

    @property
    def along(self) -> str:
        """Name of the rows that hold it along the obstacle."""
        return f"{self.name} along it"

    @property
    def where(self) -> str:
        """Where it is in the scene: ``nodes.tip``, or ``members.rod at 0.25`` of its length."""
        return f"members.{self.member} at {self.at:.6g}" if 0.0 < self.at < 1.0 else f"nodes.{self.place}"


@dataclass(frozen=True)
class Approach:
    """Two members that are near to each other in a motion, where nothing else is nearer.

    Attributes
    ----------
    contact : str
        Name of the record.
    members : (str, str)
        The same one twice where it comes near to itself.
    elements : (int, int)
        The elements of the members on which these places are, counted from 0; a rigid member is one.
    at : (float, float)
        Fractions of the lengths of the members near to which the places are.
    held : (bool, bool)
        Whether the place stays at the end of its member; else it is where the distance is least.
    distance : float
        What the distance between the centre lines is where the surfaces touch, m.
    """

    rubs: ClassVar[bool] = False

    contact: str
    members: tuple[str, str]
    elements: tuple[int, int]
    at: tuple[float, float]
    held: tuple[bool, bool]
    distance: float

    @property
    def key(self) -> tuple[str, tuple[object, ...], tuple[object, ...]]:
        """What tells it from others; where exactly it is changes with the motion."""
        one, other = (
            (member, at if held else element, held)
            for member, element, at, held in zip(self.members, self.elements, self.at, self.held, strict=True)
        )
        return self.contact, one, other

    @property
    def name(self) -> str:
        """Name of its constraint row."""
        parts = (
            f"the {'end' if at else 'begin'} of {member}" if held else f"element {element + 1} of {member}"
            for member, element, at, held in zip(self.members, self.elements, self.at, self.held, strict=True)
        )
        return f"contacts.{self.contact}, {' and '.join(parts)}"

    @property
    def where(self) -> str:
        """What it is in the scene: ``members.rod and members.post``."""
        return " and ".join(f"members.{member}" for member in self.members)


@dataclass(frozen=True, eq=False)
class Remembered:
    """What a member whose law has memory remembers of the steps before, on one mesh.

    Attributes
    ----------
    variables : ndarray (elements, points, variables)
        Internal variables at the integration points, dimensionless.
    dissipated : float
        What it has dissipated since it was undeformed, J.
    """

    variables: Array
    dissipated: float = 0.0


WITHIN = 0.4
"""Share of an element's length, from its middle, within which it is divided at a kink: slivers gain nothing."""


@dataclass(frozen=True)
class Mesh:
    """A mesh: element type, and the elements of each member.

    Attributes
    ----------
    order : int
        Polynomial order p of all elements; p = 1 is SFET2.
    cuts : mapping of str to ndarray (n + 1,)
        For each flexible or rigid member the ends of its n elements: fractions of its length, rising from 0 to 1.
    gauss : bool
        Gauss integration instead of integration at the nodes.
    rigid : frozenset of str
        Members whose elements are never halved.
    stops : tuple of (str, str)
        Springs that are held at a stop: name, and ``low`` or ``high``; tendons that are slack: name, and ``slack``.
    switched : bool
        Whether all unilateral constraints are in the model, ``stops`` among them, each with a switch in its data.
    points : tuple of ContactPoint
        Where members touch each other or obstacles, and it is an unknown where.
    places : bool
        Whether every end of an element of a flexible member has displacement unknowns, as masses need.
    spots : tuple of Spot, or None
        Where obstacles stop members in a motion; None where it is no mesh of one with contact.
    approaches : tuple of Approach
        Where members are near to each other in a motion.
    memory : mapping of str to Remembered, or None
        What members remember whose laws have memory, nothing before the first step; None where no step is known to
        come after another.
    """

    order: int
    cuts: Mapping[str, Array]
    gauss: bool = False
    rigid: frozenset[str] = frozenset()
    stops: tuple[tuple[str, str], ...] = ()
    switched: bool = False
    points: tuple[ContactPoint, ...] = ()
    places: bool = False
    spots: tuple[Spot, ...] | None = None
    approaches: tuple[Approach, ...] = ()
    memory: Mapping[str, Remembered] | None = field(default=None, compare=False, repr=False)

    def __repr__(self) -> str:
        cuts = first_lines(self.cuts, lambda name: f"{brief(name)}: {counted(len(self.cuts[name]) - 1, 'element')}")
        return shown(self, [f"order={self.order}", counted(self.elements, "element")], cuts)

    @property
    def sliding(self) -> int:
        """Number of places that slide along what they touch, in which the Lagrangian is largest, not least."""
        # On an edge the place is given by where the edge is.
        return sum(sum(point.slides) for point in self.points if not point.edge)

    @property
    def lies(self) -> bool:
        """Whether a member lies along an obstacle."""
        return any(point.line for point in self.points)

    @property
    def line_ends(self) -> tuple[ContactPoint, ...]:
        """The points at which lines on obstacles end that slide."""
        on_lines = {point.pair for point in self.points if point.line}
        return tuple(point for point in self.points if point.pair in on_lines and point.slides == (True,))

    @property
    def elements(self) -> int:
        """Number of elements of all members."""
        return sum(len(cuts) - 1 for cuts in self.cuts.values())

    @property
    def rule(self) -> tuple[Array, Array]:
        """Places in [0, 1] and weights, sum 1, of the points (p + 1,) at which elements are integrated."""
        return (interpolation.gauss if self.gauss else interpolation.lobatto)(self.order + 1)

    def refined(
        self, marked: Mapping[str, Array] | None = None, kinks: Mapping[str, Sequence[float]] | None = None
    ) -> Mesh:
        """The mesh with marked elements halved: boolean arrays (elements,) by member; None marks all.

        An element with a kink, a fraction of the length of its member, is divided there instead, unless that is near to
        its end.  The mesh remembers nothing: what is remembered belongs to the points of one mesh.
        """
        cuts = {}
        for name, old in self.cuts.items():
            chosen = np.ones(len(old) - 1, bool) if marked is None else marked[name]
            chosen = chosen & (name not in self.rigid)
            inner = 0.5 * (old[1:] + old[:-1])
            for x in (kinks or {}).get(name, ()):
                e = int(np.clip(np.searchsorted(old, x) - 1, 0, len(inner) - 1))
                if abs(x - 0.5 * (old[e] + old[e + 1])) < WITHIN * (old[e + 1] - old[e]):
                    inner[e] = x
            cuts[name] = np.sort(np.concatenate([old, inner[chosen]]))
        return replace(self, cuts=cuts, memory=None if self.memory is None else {})

    def same(self, other: Mesh) -> bool:
        """Whether another mesh of the same scene is equal to this one."""
        # What differs most often, and is compared soonest, comes first.
        alike = len(self.points) == len(other.points)
        alike = alike and all(np.array_equal(cuts, other.cuts[name]) for name, cuts in self.cuts.items())
        return alike and replace(self, cuts={}) == replace(other, cuts={})

    def cut_at(self, member: str, place: float) -> int:
        """Index in ``cuts`` of the end of elements that is nearest to a fraction of a member's length."""
        cuts = self._listed[member]
        i = min(max(bisect.bisect_left(cuts, place), 1), len(cuts) - 1)
        return i if cuts[i] - place < place - cuts[i - 1] else i - 1

    @functools.cached_property
    def _listed(self) -> dict[str, list[float]]:
        """The ends of elements as lists, in which a single one is found faster."""
        return {member: cuts.tolist() for member, cuts in self.cuts.items()}

    def element_at(self, member: str, place: float) -> int:
        """The element, counted from 0, in which a fraction of a member's length is; of two that meet, the first."""
        cuts = self.cuts[member]
        return int(np.clip(np.searchsorted(cuts, place) - 1, 0, len(cuts) - 2))


def breaks_of(scene: Scene, member: str) -> Array:
    """Fractions (n,) of a member's length at which its solution has a kink, so that an element has to end there."""
    section = scene.members[member].section
    places = [0.0, 1.0, *scene.center_lines[member].breaks]
    if section is not None:
        places += scene.sections[section].breaks
    for load in scene.loads_along.get(member, ()):
        places += list(load.part) if load.type == "distributed" else [] if load.at is None else [load.at]
        places += [] if load.profile is None else list(kinks(load.profile, scene.center_lines[member].length))
    for table in (scene.actuations, scene.magnets):
        for acting in table.values():
            places += acting.breaks if acting.member == member else ()
    for part in scene.members[member].turned_about:
        places += kinks(part, scene.center_lines[member].length)
    for tendon in scene.tendons.values():
        places += kinks_along(tendon, member)
    for name, runs in scene.tube_runs.items():
        for run in runs:
            if run.member == member:
                places += tube_breaks(scene.tubes[name], run, scene.center_lines[member])
    places = sorted(places)
    keep = [a for a, b in zip(places, places[1:], strict=False) if b - a > tolerances.DECIMAL]
    return np.array([*keep, 1.0])


def within_elements(cuts: Array, shares: Array) -> Array:
    """Fractions (elements, n) of the length of a member at shares (n,) of its elements, which end at ``cuts``."""
    found: Array = cuts[:-1, None] + np.diff(cuts)[:, None] * shares
    return found


def every_other(scene: Scene, member: str, cuts: Array) -> Array:
    """The ends of elements (n,) of a mesh with half as many on a member, where elements need not end."""
    kept = np.abs(cuts[:, None] - breaks_of(scene, member)).min(axis=1) < tolerances.DECIMAL
    kept[::2] = True
    return cuts[kept]


def _divided(breaks: Array, elements: int) -> Array:
    """About ``elements`` equal elements with a cut at each break, at least one a stretch."""
    lengths = np.diff(breaks)
    counts = np.maximum(1, np.floor(lengths * elements + 0.5).astype(int))
    while counts.sum() > elements and (counts > 1).any():
        counts[first_of_largest(np.where(counts > 1, counts / lengths, 0.0))] -= 1
    while counts.sum() < elements:
        counts[first_of_largest(lengths / counts)] += 1
    stretches = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks, breaks[1:], counts, strict=False)]
    return np.concatenate([*stretches, [1.0]])


def uniform_mesh(scene: Scene, order: int, elements: int | Mapping[str, int], gauss: bool = False) -> Mesh:
    """A mesh of ``elements`` equal elements on each member; more where loads or kinks of a section need ends of
    elements.

    Parameters
    ----------
    order : int
        Polynomial order p of the elements.
    elements : int or mapping of str to int
        Number for all flexible members, or for each by name.
    gauss : bool
        Integrate at Gauss points instead of at the nodes.
    """
    check_scene(scene, "uniform_mesh({}, ...)")
    counts = elements if isinstance(elements, Mapping) else dict.fromkeys(scene.members, elements)
    cuts = {name: _divided(breaks_of(scene, name), counts.get(name, 1)) for name in cut(scene)}
    cuts |= {name: rigid_cuts(scene, name) for name in rigid(scene)}
    return Mesh(order, cuts, gauss, rigid(scene))


def cut(scene: Scene) -> list[str]:
    """Names of the members that are made of elements: all but small ones."""
    return [name for name, member in scene.members.items() if member.type != "small"]


def rigid(scene: Scene) -> frozenset[str]:
    """Names of the rigid members."""
    return frozenset(name for name, member in scene.members.items() if member.type == "rigid")


def rigid_cuts(scene: Scene, member: str) -> Array:
    """Ends (n + 1,) of the elements of a rigid member, which share one rotation and integrate loads along its shape."""
    turning = scene.center_lines[member].turning
    # These elements are never halved: what they integrate they integrate at once.
    fine = len(FINE) + 1 if _formulas(scene, member) else 1
    return _divided(breaks_of(scene, member), max(fine, int(np.ceil(4.0 * turning))))


def first_mesh(scene: Scene, order: int, turning: float = 2.0) -> Mesh:
    """A coarse first mesh of elements of polynomial order ``order``.

    No element is expected to turn by more than ``turning`` rad by its unloaded shape, prescribed rotations and end
    moments.  Under forces far above EI/L^2 a member is straight but for boundary layers as thin as
    ``sqrt(EI / force)`` at loads and at its ends, unless nothing bends it there; towards these the elements are halved
    again and again.
    """
    check_scene(scene, "first_mesh({}, ...)")
    rotations = [np.linalg.norm(m.rotation) for m in scene.motions.values() if m.rotation is not None]
    reaching, loose, follows = carried(scene), loose_ends(scene), any(load.follows for load in scene.loads.values())
    cuts, middle = {}, np.linspace(0.0, 1.0, 5)
    bent = {str(member.section) for member in scene.members.values() if member.type == "flexible"}
    soft = {name: float(np.nanmin(scene.sections[name].stiffness(middle))) for name in bent}
    for name in cut(scene):
        line, section = scene.center_lines[name], scene.sections.get(str(scene.members[name].section))
        if scene.members[name].type == "rigid" or section is None:
            cuts[name] = rigid_cuts(scene, name)
            continue
        most = reaching[name].force + magnetic(scene, name)
        softest = soft[str(scene.members[name].section)]
        expected = line.turning + max(rotations, default=0.0) + reaching[name].moment * line.length / softest
        expected += natural_turning(scene, name)
        # What turns with its load may bend to and fro all along; waves are as long as the layers are thick.
        waves = line.length * np.sqrt(most / softest) if follows else 0.0
        count = int(min(max(2.0, np.ceil((expected + waves) / turning)), 2000.0))
        layer = np.sqrt(softest / most) / line.length if most > 0.0 else np.inf
        breaks = breaks_of(scene, name)
        cuts[name] = _graded(_divided(breaks, count), breaks, layer, loose[name])
        edges = [x for formula in _formulas(scene, name) for x in formula.edges(line.length)]
        beside = np.array([np.abs(cuts[name] - x).min() for x in edges])
        cuts[name] = np.unique([*cuts[name], *np.array(edges)[beside > NEXT]])
    return Mesh(order, cuts, rigid=rigid(scene))


NEXT = 1e-3
"""Fraction of the length by which an edge of a formula is apart from an end of an element, or there is no further end:
elements that are much shorter than those beside them are slivers."""


def _formulas(scene: Scene, member: str) -> list[Formula]:
    """Formulas of the section of a member and of what acts along it."""
    loads = [load.profile for load in scene.loads_along.get(member, ())]
    loads += [one.profile for one in scene.actuations.values() if one.member == member]
    loads += [one.profile for one in scene.magnets.values() if one.member == member]
    section = scene.sections.get(str(scene.members[member].section))
    return [one for one in (*loads, *(section.varying if section else ())) if isinstance(one, Formula)]


def _graded(cuts: Array, breaks: Array, layer: float, loose: tuple[bool, bool]) -> Array:
    """The cuts, and further ones at twice, four times, ... the layer from each break but the ends that are loose."""
    places, last = [cuts], len(breaks) - 2
    for i, (left, right) in enumerate(pairwise(breaks)):
        steps = int(np.floor(np.log2(max(0.25 * (right - left) / layer, 0.5)))) + 1
        distances = np.maximum(layer, 1e-13) * 2.0 ** np.arange(min(steps, 40))
        places += [] if i == 0 and loose[0] else [left + distances]
        places += [] if i == last and loose[1] else [right - distances]
    merged = np.unique(np.concatenate(places))
    # Cuts that nearly meet others would make slivers; breaks stay, and elements that turning needs shorter than layers.
    least = 0.3 * min(layer, float(np.median(np.diff(cuts)))) if np.isfinite(layer) else tolerances.DECIMAL
    sliver = np.diff(merged, prepend=-1.0) < least
    return merged[~sliver | np.isin(merged, breaks)]
