"""Places where members touch each other or obstacles, without friction, as conditions along a path.

While the same places touch, where they are on the members are unknowns like any other, see
:mod:`~sfetcas.mechanics.contact_points`.  The margins are the gaps where members are nearest to something and do not
touch; the pushes where they do; how far a place is from the ends of its member or, where it stays at one, how much the
gap grows beside it; and the curvature of the gap, without which a member begins to lie along what it touches.

What begins to touch pushes with no force, which is nowhere: at first it stays where it is and pushes along a given
normal, which is right to first order.  A little farther on it slides.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from .. import tolerances
from ..contact.closest import AT_END
from ..contact.held_inside import refuse_held_inside
from ..contact.lines import LINE, lies_along, points_of
from ..contact.member_contact import MemberContact
from ..contact.pairs import ONE, Near, doing
from ..description.records import enumerated
from ..description.scene import Scene
from ..equilibria.member_contact_steps import on_way, undeformed
from ..equilibria.rough_contact_steps import lost_while
from ..equilibria.single import solved_from
from ..equilibria.solution import Equilibrium
from ..errors import LIMITS, SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.fields import Fields
from ..mechanics.mesh import ContactPoint, Mesh
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.beginning import begin_path, begun_at, beside_zero
from ..solvers.prepared import Prepared, Solved
from ..solvers.redundancy import redundant
from .conditions import NEAR, Begun, Choice, Conditions, Way
from .lying import Lying, Piece
from .rubbing import Rubbing

__all__ = ["Touching"]

REACH = 0.1
"""Gaps that are larger are as good as this, sizes of the scene: what is far from touching is not looked for."""

ONWARD = 1e-4
"""Arc length beyond which what has begun to touch slides: its place is known to so many digits less than its force."""

LEFT = 1e-8
"""Push at which something ceases to touch, dimensionless: with none its place is not known, and with less the place is
no direction in which the Lagrangian is clearly largest.
"""

STRAIGHT = 1e-6
"""Curvature of a gap, dimensionless, below which a member begins to lie along something: where it is zero the place is
not known.
"""

OPEN = 1.0
"""Margin of what is no condition in a choice."""


@dataclass(frozen=True)
class _At:
    """A place of a contact.

    Attributes
    ----------
    contact : str
    members : (str, str) or (str,)
    at : tuple of float
        Fractions of their lengths.
    """

    contact: str
    members: tuple[str, ...]
    at: tuple[float, ...]

    @property
    def pair(self) -> tuple[str, tuple[str, ...]]:
        """The record and its members."""
        return self.contact, self.members

    def told(self, verb: str) -> str:
        """What it does in a sentence: ``contacts.peg touches beam at 0.5``."""
        return doing(self.contact, self.members, self.at, verb)


@dataclass(frozen=True)
class _Touch(_At):
    """A place where something is nearest.

    Attributes
    ----------
    active : bool
        Whether it touches.
    normal : vector
    edge : float
        As of :class:`~sfetcas.contact.closest.Near`.
    """

    active: bool
    normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    edge: float = 0.0


@dataclass(frozen=True)
class _End(_At):
    """A place that touches at an end of a member, on which it may slide, or stay where it ends.

    Attributes
    ----------
    side : int
        Whether it is that on the first or the second member.
    member : str
        The one on which it may slide: that of the place or another one with the same node.
    end : int
        Which end of it this is, 0 or 1.
    """

    side: int
    member: str
    end: int


@dataclass(frozen=True)
class _Flat(_At):
    """A place where the gap is not curved."""


@dataclass(frozen=True)
class _Driven(_At):
    """A node that is held, and is led onto an obstacle."""


class Touching(Conditions[_At]):
    """Places of a scene that touch.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    fixed : collection of str
        Members whose mesh is prescribed.
    beside : callable
        The equilibrium at a factor by itself, on a mesh of its own.
    """

    kinds: ClassVar[str] = "places that touch"
    choosing: ClassVar[str] = "what touches"

    def __init__(
        self,
        scene: Scene,
        prepare: Callable[[Mesh], Prepared],
        accuracy: float,
        fixed: Collection[str],
        beside: Callable[[float], Equilibrium],
    ) -> None:
        self.scene, self.accuracy, self.beside = scene, accuracy, beside
        self.run = MemberContact(scene, prepare, accuracy, fixed)
        self.closest = self.run.closest
        self.reach = REACH * scene.size

    @property
    def any(self) -> bool:
        """As of :class:`.Conditions`."""
        return bool(self.closest.pairs)

    def made(self, prepared: Prepared) -> Prepared:
        """As of :class:`.Conditions`."""
        # Seen without contact, as in statics.
        prepared.equations.redundant = self.run.redundant
        return prepared

    # -- begin ----------------------------------------------------------------------------------

    @property
    def remembers(self) -> bool:  # type: ignore[override]
        """As of :class:`.Conditions`: with friction."""
        return self.scene.rubs

    def begin(self, prepared: Callable[[Choice], Prepared], span: tuple[float, float], first: Choice) -> Begun:
        """As of :class:`.Conditions`: without contact if nothing penetrates then, else as statics finds it."""
        pilot = prepared(Choice())
        zero = undeformed(pilot)
        self.run.redundant = redundant(pilot.equations, zero.point)
        self.made(pilot)
        self.run.refuse_penetrating(zero.fields)
        if self.remembers:
            return self._begun_by_steps(zero, span)
        try:
            found = begin_path(pilot, span)
        except SolveError as error:
            if error.status in LIMITS:
                raise
        else:
            if self.run.unstopped(zero, found[1]):
                return found
        try:
            return self._begun(prepared, span, 0.0, ())
        except (SceneError, SolveError):
            # Without loads what only contact holds up is nowhere, or free to move.
            factor = beside_zero(span)
            note = f"at factor 0 nothing tells which way the path goes: it starts at factor {factor:g}"
            return self._begun(prepared, span, factor, (note,))

    def _begun(
        self, prepared: Callable[[Choice], Prepared], span: tuple[float, float], factor: float, notes: tuple[str, ...]
    ) -> Begun:
        """The first point at a factor at which something touches already."""
        near, mesh = self.beside(factor), prepared(Choice()).model.mesh
        source = solved_from(near)
        points = points_of(source)
        if lies_along(points):
            return begun_at(source.prepared, near.state, factor, notes, span)
        found = self.run.resolved(mesh, points, source, lambda model: model.loading(factor))
        lines = [point for point in points if self.run.lines.has(point)]
        if lines:
            raise SolveError(Status.FAILED, _lying(lines), near.state)
        if found is None:
            detail = f"what touches at factor {factor:g} was not found on the mesh of the path"
            raise SolveError(Status.FAILED, detail, near.state)
        return begun_at(prepared(Choice.of(found.model.mesh)), found.state, factor, notes, span)

    def _begun_by_steps(self, zero: Solved, span: tuple[float, float]) -> Begun:
        """The first point of a path with friction: loads have grown from zero to those at the begin of the range."""
        begin = float(np.clip(0.0, *span))
        refuse_held_inside(self.scene, zero.prepared, begin)
        now = self.run.lying(zero)
        ways = [lambda t: lambda model: model.loading(0.0, t)] if self.scene.histories else []
        ways += [functools.partial(on_way, 0.0, begin)] if begin else []
        for way in ways:
            there = self.run.follow(way, now)
            if there is None:
                how_far = f"to {self.run.reached.part:.3g} of themselves, {lost_while(self.run)}"
                detail = f"the loads with which the path begins were followed {how_far}"
                raise SolveError(Status.FAILED, detail, now.state)
            now = there
        return begun_at(now.prepared, now.state, begin, (), span)

    # -- margins --------------------------------------------------------------------------------

    def watched(self, fields: Fields) -> Array:
        """As of :class:`.Conditions`."""
        return np.array([margin for _, margin in self._margins(fields)])

    def near(self, fields: Fields, crossed: Sequence[int] = ()) -> list[_At]:
        """As of :class:`.Conditions`."""
        found, points = self._margins(fields), fields.contact_points
        close = [one for one, margin in found if abs(margin) <= NEAR and not isinstance(one, _Driven)]
        close += [_touch(one) for one in self._free(fields, points, NEAR * fields.model.scales.length)]
        close += [end for point in points for end, margin in self._beyond(fields, point) if abs(margin) <= NEAR]
        wanted = [found[i][0] for i in crossed] + close
        new = [one for one in wanted if isinstance(one, _End) or (isinstance(one, _Touch) and not one.active)]
        wanted += [_Flat(*one.pair, one.at) for one in new if self._bend(fields, one) <= AT_END]
        return list(dict.fromkeys(wanted))

    def margin(self, fields: Fields, which: Sequence[_At]) -> Array:
        """As of :class:`.Conditions`."""
        points = fields.contact_points
        return np.array([self._margin(fields, points, one) for one in which])

    def _margins(self, fields: Fields) -> list[tuple[_At, float]]:
        """Conditions and their margins, as many in each state with the same places."""
        points, scales = fields.contact_points, fields.model.scales
        nearest: dict[tuple[str, tuple[str, ...]], Near] = {}
        for near in self._free(fields, points, self.reach):
            if near.pair not in nearest or near.gap < nearest[near.pair].gap:
                nearest[near.pair] = near
        found = list[tuple[_At, float]]()
        for key in self.closest.pairs:
            one = nearest.get(key)
            gap = self.reach if one is None else one.gap
            found.append((_Touch(*key, (), False) if one is None else _touch(one), gap / scales.length))
        found += [(one, gap / scales.length) for one, gap in self._held(fields)]
        found += list(self._clamped(fields))
        for point, begun in zip(points, fields.model.mesh.points, strict=True):
            push = fields.contact_point(begun)["push"]
            found.append((_Touch(*point.pair, point.at, True), push / scales.force - LEFT))
            found += list(self._own_ends(fields, point))
            if any(point.slides):
                found.append((_Flat(*point.pair, point.at), self._bend(fields, point) - STRAIGHT))
        return found

    def _margin(self, fields: Fields, points: Sequence[ContactPoint], one: _At) -> float:
        """The margin of a condition at a state near to that at which it was told."""
        scales = fields.model.scales
        there = [i for i, point in enumerate(points) if self._same_place(point, one)]
        if isinstance(one, _Touch):
            if there:
                return float(fields.contact_point(fields.model.mesh.points[there[0]])["push"] / scales.force)
            found = self.closest.found(fields, self.reach, [self.closest.pairs[one.pair]])
            lengths = [self.closest.lengths[member] for member in one.members]

            def apart(near: Near) -> float:
                return max(abs(x - y) * length for x, y, length in zip(near.at, one.at, lengths, strict=True))

            gap = min(found, key=apart).gap if found else self.reach
            return float(gap / scales.length)
        if isinstance(one, _End) and there:
            point = points[there[0]]
            side = _side(point.members, one)
            if not point.slides[side]:
                return self._inward(fields, point, one)
            if point.members[side] == one.member:
                return self._from_end(fields, point, side, one.end)
        return OPEN

    def _same_place(self, point: ContactPoint, one: _At) -> bool:
        """Whether a point is at a place, or has gone over from there to another member with the same node."""
        if point.pair == one.pair:
            return self.closest.alike(one.pair, point.at, one.at)
        return isinstance(one, _End) and point.contact == one.contact and one.member in point.members

    def _free(self, fields: Fields, points: Sequence[ContactPoint], reach: float) -> list[Near]:
        """Where something is nearer than ``reach``, m, and none of the points is."""
        return [n for n in self.closest.found(fields, reach) if not any(self._same(fields, n, p) for p in points)]

    def _same(self, fields: Fields, near: Near, point: ContactPoint) -> bool:
        """Whether something is nearest where a point is: also where the member of the one ends at that of the other."""
        if near.contact != point.contact:
            return False
        if near.pair == point.pair:
            # What is new on an edge stays while the member slides on it.
            return (bool(point.edge) and point.new) or self.closest.alike(near.pair, near.at, point.at, ONE)
        return self._meet(near, point)

    def _meet(self, one: Near | ContactPoint, other: Near | ContactPoint) -> bool:
        """Whether places of a contact on other members are one, as these members have the same nodes there."""
        if one.contact != other.contact:
            return False
        width = ONE * self.closest.pairs[one.pair].width

        def alike(i: int, k: int) -> bool:
            m, n, x, y = one.members[i], other.members[k], one.at[i], other.at[k]
            node = self._node(m, x)
            same = node is not None and node == self._node(n, y)
            return same or (m == n and abs(x - y) * self.closest.lengths[m] < width)

        ways = [(0, 1), (1, 0)] if len(one.members) == 2 else [(0,)]
        return any(all(alike(i, k) for i, k in enumerate(way)) for way in ways)

    def _node(self, member: str, at: float) -> str | None:
        """The node at a place of a member, if there is one."""
        end = round(at)
        return self.scene.members[member].nodes[end] if abs(at - end) < SAME_END and end in (0, 1) else None

    # -- ends -----------------------------------------------------------------------------------

    def _own_ends(self, fields: Fields, point: ContactPoint) -> Iterator[tuple[_End, float]]:
        """Ends of the members of a point: how far it is from where it slides to, and what keeps it where it stays."""
        for side, (member, x) in enumerate(zip(point.members, point.at, strict=True)):
            if point.slides[side]:
                for end in (0, 1):
                    one = _End(*point.pair, point.at, side, member, end)
                    yield one, self._from_end(fields, point, side, end)
            elif x in (0.0, 1.0):
                for one in self._at_node(point, side):
                    yield one, self._inward(fields, point, one)

    def _beyond(self, fields: Fields, point: ContactPoint) -> Iterator[tuple[_End, float]]:
        """What goes on beyond ends of members that a point has come to, and how the gap grows there."""
        for side, x in enumerate(point.at):
            end = round(x)
            if point.slides[side] and abs(self._from_end(fields, point, side, end)) <= NEAR:
                at = tuple(float(end) if i == side else y for i, y in enumerate(point.at))
                there = replace(point, at=at)
                for one in self._at_node(there, side):
                    if one.member != point.members[side]:
                        yield replace(one, at=point.at), self._inward(fields, there, one)

    def _at_node(self, point: ContactPoint, side: int) -> Iterator[_End]:
        """The members on which a point at an end of one of its members may slide."""
        node = self._node(point.members[side], point.at[side])
        for name in self.closest.members:
            for end, other in enumerate(self.scene.members[name].nodes):
                if other == node and self._on(point, side, name, end) is not None:
                    yield _End(*point.pair, point.at, side, name, end)

    def _on(self, point: ContactPoint, side: int, member: str, end: int) -> ContactPoint | None:
        """A point at the end of another member of the same node; None where that cannot touch."""
        members = tuple(member if i == side else m for i, m in enumerate(point.members))
        at = tuple(float(end) if i == side else x for i, x in enumerate(point.at))
        slides = point.slides
        if (point.contact, members) not in self.closest.pairs:
            members, at, slides = members[::-1], at[::-1], slides[::-1]
        pair = self.closest.pairs.get((point.contact, members))
        if pair is None:
            return None
        # Where the other one runs back an edge is on its other side.
        back = member != point.members[side] and end == round(point.at[side])
        edge = -point.edge if back else point.edge
        return replace(point, members=members, at=at, slides=slides, distance=pair.distance, edge=edge)

    def _from_end(self, fields: Fields, point: ContactPoint, side: int, end: int) -> float:
        """How far a point is from an end of a member, below zero beyond it."""
        share = 1.0 - point.at[side] if end else point.at[side]
        return share * self.closest.lengths[point.members[side]] / fields.model.scales.length

    def _inward(self, fields: Fields, point: ContactPoint, one: _End) -> float:
        """Slope of the gap from an end of a member to its inside; of an edge how much its push is not into that."""
        there = self._on(point, one.side, one.member, one.end)
        assert there is not None
        if point.edge:
            return self.run.edges.outwards(fields, point, self.closest.pairs[there.pair], one.end)
        slope = self.closest.slopes(fields, there.pair, there.at)[_side(there.members, one)]
        return float(-slope if one.end else slope)

    def _held(self, fields: Fields) -> Iterator[tuple[_Driven, float]]:
        """Ends of members that no obstacle can push, and their gaps, m."""
        for pair in self.closest.pairs.values():
            if pair.stop is None or pair.edge:
                continue
            nodes = self.scene.members[pair.members[0]].nodes
            for end, free in enumerate(pair.ends):
                if not free and nodes[end] != pair.stop.carrier:
                    yield _Driven(*pair.key, (float(end),)), self.closest.gap_at(fields, pair.key, float(end))

    def _clamped(self, fields: Fields) -> Iterator[tuple[_Flat, float]]:
        """Ends of members that no obstacle can push, and how much the members bend away from where they are on one."""
        on = {point.pair for point in fields.model.mesh.points}
        for key, pair in self.closest.pairs.items():
            if pair.stop is None or pair.edge or not self.run.lines.bends(pair.members[0]):
                continue
            for end in (float(end) for end, free in enumerate(pair.ends) if not free):
                apart = self.closest.gap_at(fields, key, end) > tolerances.CLOSED * self.scene.size
                apart = apart or abs(float(self.closest.slopes(fields, key, (end,))[0])) > NEAR
                one = _Flat(*key, (end,))
                yield one, OPEN if apart or key in on else self._bend(fields, one) - STRAIGHT

    def _bend(self, fields: Fields, one: _At | ContactPoint) -> float:
        """Least curvature of the gap along what a place slides on, or begins to slide on, dimensionless."""
        if self.closest.pairs[one.pair].edge:
            return OPEN
        at = np.clip(one.at, 0.0, 1.0)
        slopes = self.closest.slopes(fields, one.pair, tuple(at.tolist()))
        free = np.flatnonzero(((at > 0.0) & (at < 1.0)) | (np.abs(slopes) <= NEAR))
        if not len(free):
            return OPEN
        if len(one.members) == 1:
            return self.closest.bends(fields, one.pair, float(at[0])) * fields.model.scales.length
        (first, second), (x, y) = one.members, at.tolist()
        curvature = self.closest.half_square(fields, (first, second), (x, y))[1]
        return float(np.linalg.eigvalsh(curvature[np.ix_(free, free)])[0])

    # -- changes --------------------------------------------------------------------------------

    def where(self, one: _At) -> str:
        """As of :class:`.Conditions`."""
        return f"contacts.{one.contact}"

    def active(self, one: _At, fields: Fields) -> bool:
        """As of :class:`.Conditions`."""
        return isinstance(one, _Touch) and one.active

    def becomes(self, one: _At, fields: Fields) -> str:
        """As of :class:`.Conditions`."""
        if isinstance(one, _End):
            comes = self._slides(one, fields.contact_points)
            return f"contacts.{one.contact} {'comes to the end of' if comes else 'goes on along'} {one.member}"
        return one.told("leaves" if self.active(one, fields) else "touches")

    def told(self, one: _At, choice: Choice) -> str:
        """As of :class:`.Conditions`."""
        if isinstance(one, _End):
            slides = self._slides(one, choice.points)
            return f"contacts.{one.contact} {'along' if slides else 'at the end of'} {one.member}"
        touches = any(self._same_place(point, one) for point in choice.points)
        return f"contacts.{one.contact} {'touching' if touches else 'apart'}"

    def _slides(self, one: _End, points: Sequence[ContactPoint]) -> bool:
        """Whether a place, one of some points, slides on the member of a condition."""
        there = [(point, _side(point.members, one)) for point in points if self._same_place(point, one)]
        return any(point.slides[side] and point.members[side] == one.member for point, side in there)

    def convex(self, which: Sequence[_At]) -> bool:
        """As of :class:`.Conditions`: what stays at an end of a member may be unstable while what slides is not."""
        return all(isinstance(one, _Touch) for one in which)

    def refused(self, fields: Fields, near: Sequence[_At]) -> str:
        """As of :class:`.Conditions`."""
        for one in near:
            if isinstance(one, _Driven):
                return f"node {self._node(one.members[0], one.at[0])} is led into contacts.{one.contact}"
        for one in near:
            if isinstance(one, _End) and self.run.edges.slides_off(self.closest.pairs[one.pair], one.end):
                return f"{one.member} slides off contacts.{one.contact} with its end"
        flat = [one for one in near if isinstance(one, _Flat) and len(one.members) == 2]
        flat += [_Flat(*one.pair, one.at) for one in near if isinstance(one, _Touch) and self._lies(fields, one)]
        return _lying(flat) if flat else ""

    def _lies(self, fields: Fields, new: _Touch) -> bool:
        """Whether a place that begins to touch makes a line with others of two members, as in statics."""
        beside = [point for point in fields.contact_points if point.pair == new.pair and len(point.members) == 2]
        near = any(self.closest.alike(new.pair, new.at, point.at) for point in beside)
        return not new.active and (near or len(beside) + 1 >= LINE)

    def flat(self, fields: Fields, near: Sequence[_At] = ()) -> list[ContactPoint]:
        """As of :class:`.Conditions`: the gap is not curved there."""
        points = fields.contact_points
        points += tuple(self._new(one) for one in near if isinstance(one, _Touch) and one.at and not one.active)
        clamped = [one for one, bend in self._clamped(fields) if bend <= NEAR]
        points += tuple(
            ContactPoint(*one.pair, one.at, (False,), self.closest.pairs[one.pair].distance) for one in clamped
        )
        return [point for point in points if len(point.members) == 1 and self._is_flat(fields, point, points)]

    def _is_flat(self, fields: Fields, point: ContactPoint, points: Sequence[ContactPoint]) -> bool:
        """Whether a member begins to lie along an obstacle at a place, one of some points."""
        if point.edge or not self.run.lines.bends(point.members[0]):
            return False
        beside = (other.at[0] for other in points if other.pair == point.pair and other is not point)
        if any(self.closest.lies(fields, point.pair, *sorted((x, point.at[0]))) for x in beside):
            return True
        at = min(max(point.at[0], 0.0), 1.0)
        # What is beyond the last place that presses may lie there without a force.
        if self.closest.rests(fields, point.pair, at):
            return True
        if at in (0.0, 1.0):
            (slope,) = self.closest.slopes(fields, point.pair, (at,)).tolist()
            if (1.0 - 2.0 * at) * slope > NEAR:
                return False
        least = STRAIGHT if 0.0 < at < 1.0 else AT_END
        return self.closest.bends(fields, point.pair, at) * fields.model.scales.length <= least + NEAR

    def flats(self, fields: Fields) -> tuple[int, ...]:
        """As of :class:`.Conditions`."""
        return tuple(i for i, (one, _) in enumerate(self._margins(fields)) if isinstance(one, _Flat))

    def may_be_flat(self, fields: Fields) -> bool:
        """As of :class:`.Conditions`: the curvature is told to what a force within an element changes it by."""
        model, found = fields.model, False
        for begun, point in zip(model.mesh.points, fields.contact_points, strict=True):
            if len(point.members) > 1 or point.edge or not (point.slides[0] and self.run.lines.bends(point.members[0])):
                continue
            (member,), at, cuts = point.members, point.at[0], model.mesh.cuts[point.members[0]]
            element = model.mesh.element_at(member, at)
            length = (cuts[element + 1] - cuts[element]) * self.closest.lengths[member] / model.scales.length
            bends = fields.contact_point(begun)["push"] / model.scales.force * length / fields.stiffness(member, at)
            found |= bool(self._bend(fields, point) <= bends + STRAIGHT)
        return found

    def lying(self, mesh: Mesh, span: tuple[float, float], piece: Piece, finer: float) -> Lying:
        """As of :class:`.Conditions`."""
        return (Rubbing if self.remembers else Lying)(self.run, mesh, span, piece, finer)

    def _new(self, one: _Touch) -> ContactPoint:
        """A place that begins to touch."""
        distance, still = self.closest.pairs[one.pair].distance, (False,) * len(one.at)
        return ContactPoint(*one.pair, one.at, still, distance, normal=one.normal, new=True, edge=one.edge)

    def switched(self, fields: Fields, which: Sequence[_At]) -> Choice | None:
        """As of :class:`.Conditions`: the places begin where they are now."""
        touches = [one for one in which if isinstance(one, _Touch)]
        ends = [one for one in which if isinstance(one, _End)]
        kept: list[ContactPoint] = []
        for point in fields.contact_points:
            if any(one.active and self._same_place(point, one) for one in touches):
                continue
            own = [one for one in ends if one.pair == point.pair and one.at == point.at]
            moved = self._at_ends(point, own)
            if moved is None:
                return None
            kept.append(moved)
        kept += [self._new(one) for one in touches if not one.active]
        return Choice(points=tuple(self.run.lines.set_out(fields.model.mesh, kept)))

    def _at_ends(self, point: ContactPoint, ends: Sequence[_End]) -> ContactPoint | None:
        """A point that leaves members at their ends or goes on along others; None where it would do so along two."""
        turned = False
        for side in range(len(point.members)):
            own, place = [one for one in ends if one.side == side], 1 - side if turned else side
            enter = [one for one in own if not (point.slides[place] and point.members[place] == one.member)]
            if len(enter) > 1:
                return None
            if own:
                one = (enter or own)[0]
                there = self._on(point, place, one.member, one.end)
                assert there is not None
                after = place if there.members[place] == one.member else 1 - place
                turned ^= after != place
                slides = tuple(bool(enter) if i == after else free for i, free in enumerate(there.slides))
                point = replace(there, slides=slides)
        return point

    def carried(self, at: Standing, prepared: Prepared) -> State:
        """As of :class:`.Conditions`."""
        state, axes = self.run.carried(at, prepared), prepared.model.element.axes
        rows, known = ({name: i for i, name in enumerate(m.row_names)} for m in (prepared.model, at.model))
        lam = state.lam.copy()
        for former, now in zip(at.model.mesh.points, points_of(at), strict=True):
            for point in prepared.model.mesh.points:
                if point.pair != now.pair and self._meet(point, now):
                    # The force goes over to another member with the place.
                    forces = at.state.lam[[known[row] for row in former.rows(axes)]]
                    forces[:-1] *= -1.0 if len(now.members) == 2 and point.members[0] == now.members[1] else 1.0
                    lam[[rows[row] for row in point.rows(axes)]] = forces
        return replace(state, lam=lam)

    def onward(
        self, way: Way, curve: Callable[[Choice], Curve], span: tuple[float, float]
    ) -> tuple[Curve, Standing] | None:
        """As of :class:`.Conditions`."""
        if not any(point.new for point in way.choice.points):
            return None
        here = way.standing
        there = way.curve.corrected(*way.curve.predicted(here, ONWARD), here.tangent, here.arc + ONWARD)
        if there is None or not span[0] <= there.factor <= span[1]:
            return None
        free = [self._freed(there.fields, point) if point.new else point for point in points_of(there)]
        onward = curve(Choice(points=tuple(self.run.lines.set_out(there.model.mesh, free))))
        along = Tangent(np.zeros(onward.equations.total), there.tangent.factor)
        rest = onward.standing(self.run.carried(there, onward.prepared), there.factor, along, arc=there.arc)
        found = onward.corrected(rest.state, rest.factor, rest.tangent, there.arc)
        return None if found is None else (onward, found)

    def fitted(self, mesh: Mesh, fields: Fields) -> Mesh:
        """As of :class:`.Conditions`."""
        fitted, _ = self.run.lines.fitted(mesh, fields.contact_points)
        return mesh if mesh.same(fitted) else fitted

    def _freed(self, fields: Fields, point: ContactPoint) -> ContactPoint:
        """A point that has begun to touch as it slides."""
        if point.edge:
            return replace(point, slides=(True,), new=False)
        ends = [(i, x) for i, x in enumerate(point.at) if x in (0.0, 1.0)]
        at_end = {
            i: self._inward(fields, point, _End(*point.pair, point.at, i, point.members[i], int(x))) for i, x in ends
        }
        slides = tuple(at_end.get(i, -1.0) < 0.0 for i in range(len(point.at)))
        return replace(point, slides=slides, normal=self.closest.pairs[point.pair].normal, new=False)

    def passed(self, before: Standing, after: Standing) -> bool:
        """As of :class:`.Conditions`."""
        self.run.edges.begin(before.fields)
        return self.run.passing.passed(before.fields, after.fields)


SAME_END = 1e-9
"""Fractions of a length by which a place is off the end at which it is: they are compared to nine digits."""


def _side(members: tuple[str, ...], one: _End) -> int:
    """Which of the members of a point is that of a condition, or took its place: pairs have an order."""
    other = len(members) - 1 - one.side
    return other if members[one.side] != one.member and members[other] == one.member else one.side


def _touch(near: Near) -> _Touch:
    x, y, z = near.normal.tolist()
    return _Touch(*near.pair, near.at, False, (x, y, z), near.edge)


def _lying(places: Sequence[_At | ContactPoint]) -> str:
    """Why a path does not go on where members lie along something."""
    names = enumerated(sorted({f"contacts.{one.contact}" for one in places}))
    return f"members begin to lie along each other: {names}, accepted on a path: members that touch at places only"
