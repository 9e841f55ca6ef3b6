"""Loads and prescribed motions of a scene on a mesh, in the units of the model.

Loads and motions with the same history form one :class:`Loading`, multiplied by one factor.  Loads along a member are
moved to its first node; the internal force that they cause in the elements before them is the pull of these.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..description.scene import Load, Motion, Scene
from ..description.sections import evaluate
from ..description.tubes import mass_of_tubes
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers, plus, unit, values_of
from ..mathematics.interpolation import pieces
from .beams import Beams, Scales
from .bodies import Lever, body_of, lever_along, quadrature
from .connections import freedoms
from .elements import Element
from .load_terms import carried, cut_of, inner_cut
from .mesh import Mesh, within_elements
from .parts import Parts
from .rotations import Rotations
from .segments import Segments
from .terms import Group, Term

__all__ = ["Dampers", "Loading", "unit_loadings"]


@dataclass(frozen=True, eq=False)
class Dampers:
    """What dampers in sections do at the points of elements, dimensionless: a part of what sections carry.

    Attributes
    ----------
    torque : ndarray (elements, points, turns)
        Their share of the ``torque`` of :class:`Loading`: no couples from outside.
    moment : ndarray (elements, points, 3)
        Their moments, fixed axes of the undeformed scene.
    strain : ndarray (elements, points, 3)
        The strains of an undamped section by their forces, section axes.
    """

    torque: Array
    moment: Array
    strain: Array


@dataclass(frozen=True)
class Loading:
    """Loads and prescribed motions, dimensionless.

    Attributes
    ----------
    force : ndarray (places, axes)
        Dead forces on places, and the resultants of the loads along segments, put to their first places.
    own : ndarray (places, axes)
        The share of ``force`` that acts on the places themselves.
    moment : ndarray (rotations, 3)
        Moments on rotations, about the fixed axes.
    further : ndarray (rotations, 3)
        The share of ``moment`` that is in no term: of followers evaluated at a state, and of inertia.
    jump : ndarray (elements, 3)
        The share of ``moment`` that acts at the start of an element, within a member.
    couple : ndarray (places, 3)
        The share of ``moment`` that acts on nodes themselves.
    pull : ndarray (elements, points, axes)
        Minus the internal force at the integration points that the loads along the member cause.
    spread : ndarray (elements, points, axes)
        Distributed force times weight times length, from which ``pull`` is computed; for section forces.
    torque : ndarray (elements, points, turns)
        Couples along elements, times weight and length, that are in no term: of what turns, evaluated at a state.
    shift : ndarray (places * axes,)
        Prescribed displacements, zero for other places.
    turn : ndarray (rotations, 3)
        Prescribed rotation vectors, rad; zero for other rotations.
    loads : tuple of ndarray (n, loads)
        For each group of connections the data that grow with the load factor, as moments and followers.
    kinds : tuple of Term
        The kinds of these groups.
    factor : float
        The load factor at which they are; of sums and multiples the sum and the multiple.
    before : tuple of ndarray (n, loads)
        Where ``loads`` that turn are evaluated at a state, and so dead: what they were; else empty.
    dampers : Dampers or None
        Of the dampers that are among these loads.
    """

    force: Array
    own: Array
    moment: Array
    further: Array
    jump: Array
    couple: Array
    pull: Array
    spread: Array
    torque: Array
    shift: Array
    turn: Array
    loads: tuple[Array, ...]
    kinds: tuple[Term, ...]
    factor: float
    before: tuple[Array, ...] = ()
    dampers: Dampers | None = None

    def scaled(self, factor: float) -> Loading:
        """All loads and prescribed motions times a factor."""
        return self if factor == 1.0 else Loading.combined([(self, factor)])

    @staticmethod
    def combined(parts: Sequence[tuple[Loading, float]]) -> Loading:
        """The sum of loadings, each times a factor."""
        first, found, loads = parts[0][0], dict[str, Any](), list(parts[0][0].loads)
        # What is zero is left out: of most loadings all but one or two parts.
        names = frozenset[str]().union(*(one._parts for one, _ in parts))
        numbers = frozenset[int]().union(*(one._loaded for one, _ in parts))
        for name in names:
            terms = [factor * getattr(one, name) for one, factor in parts if name in one._parts]
            found[name] = sum(terms[1:], terms[0])
        for i in numbers:
            terms = [factor * one.loads[i] for one, factor in parts if i in one._loaded]
            loads[i] = sum(terms[1:], terms[0])
        total = sum(factor * one.factor for one, factor in parts)
        # Loads are added up so often that making the record anew would take as long as the sums.
        made = copy.copy(first)
        vars(made).update(found, loads=tuple(loads), factor=total)
        return made._known(names, numbers)

    def _known(self, names: frozenset[str], numbers: frozenset[int]) -> Loading:
        """The same, of which it is known which parts and loads of groups may not be zero."""
        self.__dict__.update(_parts=names, _loaded=numbers)
        return self

    @functools.cached_property
    def _parts(self) -> frozenset[str]:
        """Names of the parts that are not zero."""
        return frozenset(name for name in (*LOADS, *MOTIONS) if getattr(self, name).any())

    @functools.cached_property
    def _loaded(self) -> frozenset[int]:
        """Numbers of the groups of connections whose loads are not zero."""
        return frozenset(i for i, load in enumerate(self.loads) if load.any())

    def unloaded(self) -> Loading:
        """The prescribed motions without the loads; driven joints are motions."""
        zero: dict[str, Any] = {name: np.zeros_like(getattr(self, name)) for name in LOADS}
        loads = tuple(
            load if kind.drives else np.zeros_like(load) for kind, load in zip(self.kinds, self.loads, strict=True)
        )
        return replace(self, **zero, loads=loads)

    def plus(self, other: Loading) -> Loading:
        """The sum of two loadings."""
        return Loading.combined([(self, 1.0), (other, 1.0)])

    def of(self, chosen: Callable[[Term], bool]) -> float:
        """Largest load of the groups whose kind ``chosen`` accepts, dimensionless."""
        pairs = zip(self.kinds, self.loads, strict=True)
        return max((float(np.abs(load).max(initial=0.0)) for kind, load in pairs if chosen(kind)), default=0.0)

    @property
    def nodal(self) -> bool:
        """Whether it consists only of displacements of places, forces on them, and loads of terms."""
        return not (self.pull.any() or self.of(lambda kind: not kind.proportional))

    @property
    def driven(self) -> float:
        """Largest angle (rad) or displacement of a driven joint, dimensionless."""
        return self.of(lambda kind: bool(kind.drives))

    @property
    def turned(self) -> float:
        """Largest prescribed rotation, rad, or angle or displacement of a driven joint."""
        return max(float(np.linalg.norm(self.turn, axis=1).max(initial=0.0)), self.driven)

    @property
    def follows(self) -> bool:
        """Whether it has follower forces or moments."""
        return bool(self.of(lambda kind: kind.follows))


LOADS = (
    "force",
    "own",
    "moment",
    "further",
    "jump",
    "couple",
    "pull",
    "spread",
    "torque",
)
MOTIONS = ("shift", "turn")


@dataclass(frozen=True, eq=False)
class _Sums:
    """Arrays of a loading while shares are added to them."""

    parts: dict[str, Array]
    loads: list[Array]
    names: set[str] = field(default_factory=set)
    numbers: set[int] = field(default_factory=set)

    def add(self, name: str, key: Any, value: Any) -> None:
        """A share of an array."""
        self.parts[name] = plus(self.parts[name], key, value)
        self.names.add(name)

    def load(self, group: int, key: Any, value: Any) -> None:
        """A share of what grows in a group of connections."""
        self.loads[group] = plus(self.loads[group], key, value)
        self.numbers.add(group)

    def loading(self, connections: tuple[Group, ...], factor: float) -> Loading:
        """The sum of all shares."""
        kinds = tuple(group.kind for group in connections)
        found = Loading(loads=tuple(self.loads), kinds=kinds, factor=factor, **self.parts)  # type: ignore[arg-type]
        return found._known(frozenset(self.names), frozenset(self.numbers))


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
    connections: tuple[Group, ...]

    def empty(self) -> _Sums:
        """No load and no motion."""
        places, turns = len(self.segments.places), len(self.rotations.kind)
        along = (*self.beams.weight.shape, self.element.axes)
        shapes = {
            "force": (places, self.element.axes),
            "own": (places, self.element.axes),
            "moment": (turns, 3),
            "further": (turns, 3),
            "jump": (len(self.beams.weight), 3),
            "couple": (places, 3),
            "pull": along,
            "spread": along,
            "torque": (*self.beams.weight.shape, self.element.turns),
            "shift": (places * self.element.axes,),
            "turn": (turns, 3),
        }
        parts = {name: np.zeros(shape) for name, shape in shapes.items()}
        return _Sums(parts, [np.zeros((len(group.names), group.kind.sizes[4])) for group in self.connections])

    def elements_of(self, member: str) -> slice:
        start = self.beams.first[member]
        return slice(start, start + len(self.mesh.cuts[member]) - 1)

    def places(self, member: str) -> Array:
        """Fractions of the length of the integration points of a member, (elements, points)."""
        cuts = self.mesh.cuts[member]
        return within_elements(cuts, self.element.points)

    def terms(self, name: str, chosen: Callable[[Term], bool]) -> Iterator[tuple[int, int, Term]]:
        """Group, number in it, and kind of the terms of a name whose kind is chosen."""
        for i, group in enumerate(self.connections):
            if chosen(group.kind) and name in group.names:
                yield i, group.names.index(name), group.kind

    def vector(self, vector: Any) -> Array:
        return numbers(vector)[: self.element.axes]

    def segments_of(self, member: str) -> list[tuple[int, slice]]:
        """Number of the first place and elements of each segment of a member."""
        parts = (part for part in self.segments.parts if part.member == member)
        return [(self.segments.place(part.start), part.elements) for part in parts]

    def push(self, group: _Sums, place: int, force: Array) -> None:
        """Add a force on a place itself, N."""
        group.add("force", place, force / self.scales.force)
        group.add("own", place, force / self.scales.force)

    # -- loads ----------------------------------------------------------------------------------

    def add_load(self, group: _Sums, name: str, load: Load) -> None:
        if load.type == "moment":
            self._add_moment(group, name, load)
        elif load.follows and load.type == "force":
            ((i, number, _),) = self.terms(f"loads.{name}", lambda kind: kind.is_load)
            group.load(i, number, self.vector(load.vector) / self.scales.force)
        elif load.node is not None:
            self.push(group, self.segments.place(load.node), self.vector(load.vector))
        elif self.scene.members[str(load.member)].type == "small":
            self._add_on_body(group, load)
        elif load.type == "force":
            self._add_point_force(group, load)
        else:
            x = self.places(str(load.member))
            profile = self._profile(load, x.ravel()).reshape(x.shape)
            # An element is within its part as a whole or not at all: elements end there.
            within = load.inside(values_of(x).mean(axis=1))[:, None]
            density = (profile * within)[..., None] * self._along(load, x)
            self.spread(group, str(load.member), density, follows=load.follows)

    def _profile(self, load: Load, x: Array) -> Array:
        """Factor of a distributed load at fractions x (n,) of its member."""
        if load.profile is None:
            return np.ones(len(x))
        return evaluate(load.profile, x, self.scene.center_lines[str(load.member)].length)

    def _along(self, load: Load, x: Array) -> Array:
        """Value of a distributed load at places of its member, fixed axes of the undeformed scene."""
        if load.frame != "section":
            return self.vector(load.vector)
        turned = self.scene.center_lines[str(load.member)].quaternions(x.ravel())
        return quaternion.rotate(turned, numbers(load.vector))[:, : self.element.axes].reshape(*x.shape, -1)

    def _add_moment(self, group: _Sums, name: str, load: Load) -> None:
        value = numbers(load.vector) / self.scales.moment
        ((i, number, kind),) = self.terms(f"loads.{name}", lambda kind: kind.is_load)
        turn = self.connections[i].turns[number, -1]
        group.load(i, number, value[3 - kind.sizes[4] :])
        if kind.follows:
            return
        group.add("moment", turn, value)
        node = self.connections[i].nodes[number]
        inner = None if node else inner_cut(self.mesh, self.beams.first, load)
        if node:
            group.add("couple", self.segments.place(node), value)
        elif inner is not None:
            group.add("jump", inner, value)

    def _add_point_force(self, group: _Sums, load: Load) -> None:
        member = str(load.member)
        value = self.vector(load.vector) / self.scales.force
        cut = self.beams.first[member] + cut_of(self.mesh, load)
        for place, part in self.segments_of(member):
            if part.start <= cut < part.stop:
                group.add("pull", slice(part.start, cut), -value)
                group.add("force", place, value)
                return
        self.push(group, self.segments.place(self.segments.ends[member, 1]), self.vector(load.vector))

    def add_weight(self, group: _Sums, member: str) -> None:
        if self.scene.members[member].type == "small":
            weight = body_of(self.scene, member).weight
            assert weight is not None
            self._add_lever(group, member, weight, numbers(self.scene.gravity))
            return
        section = self.scene.members[member].section
        if section is None:
            return
        x = self.places(member)
        mass = self.scene.sections[section].mass(x.ravel()).reshape(x.shape) + mass_of_tubes(self.scene, member, x)
        line = self.scene.center_lines[member]
        if self.scene.members[member].type == "rigid" and line.turning > 0.0:
            self._add_weight_of_chord(group, member)
            return
        self.spread(group, member, mass[..., None] * self.vector(self.scene.gravity))

    def _add_weight_of_chord(self, group: _Sums, member: str) -> None:
        """The mass of a rigid member is spread over the straight line between its nodes, whatever its shape."""
        section = self.scene.sections[str(self.scene.members[member].section)]
        x, w = pieces(section.panels, 9)
        start, end = (numbers(self.scene.nodes[n].position) for n in self.scene.members[member].nodes)
        share = section.mass(x) * w * np.linalg.norm(end - start)
        weight = self.vector(self.scene.gravity)
        self.push(group, self.segments.place(self.segments.ends[member, 0]), (share @ (1.0 - x)) * weight)
        self.push(group, self.segments.place(self.segments.ends[member, 1]), (share @ x) * weight)

    def add_mass(self, group: _Sums, node: str) -> None:
        """Weight of a lumped mass."""
        weight = self.scene.nodes[node].mass * self.vector(self.scene.gravity)
        self.push(group, self.segments.place(node), weight)

    def spread(self, group: _Sums, member: str, density: Array, *, follows: bool = False) -> None:
        """Add a force per length (elements, points, axes), N/m."""
        part = self.elements_of(member)
        along = self.beams.weight[part][..., None] * density * (self.scales.length / self.scales.force)
        forces = plus(np.zeros((*self.beams.weight.shape, self.element.axes)), part, along)
        if follows:
            for i, turned in enumerate(self.connections):
                if turned.kind.along_element and turned.kind.follows:
                    group.load(i, slice(None), forces[turned.elements].reshape(len(turned.data), -1))
            return
        pull, on_places = carried(forces, self.segments, self.element)
        group.add("spread", part, forces[part])
        group.add("pull", part, pull[part])
        group.add("force", slice(None), on_places)

    # -- small members ----------------------------------------------------------------------------

    def _add_on_body(self, group: _Sums, load: Load) -> None:
        member = str(load.member)
        if load.type == "force":
            length = self.scene.center_lines[member].length
            lever = lever_along(self.scene, member, np.ones(1) / length, numbers([load.at or 0.0]), np.ones(1))
        else:
            x, w = quadrature(self.scene, member)
            profile = self._profile(load, x) * load.inside(x)
            lever = lever_along(self.scene, member, profile, x, w)
        self._add_lever(group, member, lever, numbers(load.vector))

    def _add_lever(self, group: _Sums, member: str, lever: Lever, vector: Array) -> None:
        """A profile times a vector: force, first moment and consistent forces as the body's kernel takes them."""
        ((i, number, kind),) = self.terms(member, lambda kind: kind.table == "members")
        axes, nodes = self.element.axes, len(self.scene.members[member].nodes)
        value = vector[:axes] / self.scales.force
        chosen = freedoms(nodes, kind.space)
        unit = np.tile([self.scales.length] * 3 + [1.0] * 3, nodes)
        ends = (lever.ends * unit / self.scales.length)[:axes, chosen]
        first = np.outer(value, lever.first[:axes] / self.scales.length)
        tensor = np.einsum("a,bj->abj", value, ends)
        parts = [lever.total * value, first.T.ravel(), tensor.transpose(2, 1, 0).ravel()]
        group.load(i, number, np.concatenate(parts))

    # -- motions --------------------------------------------------------------------------------

    def add_motion(self, group: _Sums, name: str, motion: Motion) -> None:
        number, axes = self.segments.place(motion.node), self.element.axes
        if motion.between is not None:
            self._add_drive(group, name, motion)
            return
        if motion.displacement is not None:
            shift = self.vector(motion.displacement) / self.scales.length
            group.add("shift", slice(number * axes, (number + 1) * axes), shift)
        if motion.rotation is not None:
            turn = self.rotations.node_turn[motion.node]
            assert turn is not None
            group.add("turn", turn, self._rotation_vector(motion))

    def _add_drive(self, group: _Sums, name: str, motion: Motion) -> None:
        """Angle or travel of a driven joint."""
        for i, number, kind in self.terms(name, lambda kind: bool(kind.drives) and kind.table == "motions"):
            if kind.drives == "angle":
                group.load(i, number, motion.rotation)
            else:
                along = unit(self.scene.nodes[motion.node].direction)
                travel = np.dot(numbers(motion.displacement), along)
                group.load(i, number, travel / self.scales.length)

    def _rotation_vector(self, motion: Motion) -> Array:
        if isinstance(motion.rotation, tuple):
            return numbers(motion.rotation)
        assert motion.rotation is not None
        return numbers(motion.rotation * unit(self.scene.nodes[motion.node].turn_axis))


def unit_loadings(parts: Parts, connections: tuple[Group, ...]) -> dict[str | None, Loading]:
    """Loadings at factor 1, by the name of the history that multiplies them; None: multiplied by the load factor.

    Raises
    ------
    SceneError
        A moment on a node without a rotation of its own.
    """
    scene, writer = parts.scene, _Writer(connections=connections, **vars(parts))
    groups: dict[str | None, _Sums] = {None: writer.empty()}

    def of(history: str | None) -> _Sums:
        if history not in groups:
            groups[history] = writer.empty()
        return groups[history]

    for name, load in scene.loads.items():
        writer.add_load(of(load.history), name, load)
    if scene.gravity is not None and any(scene.gravity):
        for member in scene.members:
            writer.add_weight(groups[None], member)
        for node in scene.nodes:
            writer.add_mass(groups[None], node)
    for name, motion in scene.motions.items():
        writer.add_motion(of(motion.history), name, motion)
    for i, terms in enumerate(connections):
        for history, more in terms.loads.items():
            of(history).load(i, slice(None), more)
    return {history: sums.loading(connections, float(history is None)) for history, sums in groups.items()}
