"""What touches at an equilibrium, kept as it is: for small motions about it.

Where all that touches pushes, and all else is apart, small changes leave it so (strict complementarity): the gaps of
what touches are rows that hold to both sides.  Places without friction slide, also from one member to the next where
these go on smoothly; what friction lets stick goes on sticking.

A member that lies along an obstacle stays there up to where its line ends.  To first order that place moves without
the member: what moves there is where its curvature ceases to be that of the obstacle.  So it is held there, as if it
were clamped but for what slides.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.margins import UNDECIDED
from ..mechanics.mesh import ContactPoint, Mesh, breaks_of
from ..mechanics.segments import SAME_CUT, beside_line
from ..solvers.prepared import Prepared, Solved
from ..solvers.redundancy import redundant
from .lines import Points, on_line, points_of
from .member_contact import MemberContact
from .pairs import Near, Pair, PairKey

__all__ = ["Kept"]

ROOM, ENDED = 0.7, 1e-11
"""Share of an element by which the end of a line is moved at most, and fraction of the length of its member by which it
may be off: rounding leaves less.
"""

SLIVER = 1e-6
"""Fraction of a length below which an element is a sliver, which gains nothing and leaves rounding."""

BESIDE = 0.1
"""Share of the shorter element beside it up to which an end of elements is that of a line."""

LASTING = 1e-10
"""Pull, dimensionless, that is rounding."""

NEAREST = 1e-3
"""Slope of the distance along a member from which on a place is not the nearest one, as where it does not push."""

LINES, IDLE = 1e-3, 0.1
"""Share of what is little at a place that is so of one of many along a line, and share of a line on which nothing
presses: less may be that of elements near its ends, where a force presses.
"""


class Kept:
    """What touches at an equilibrium.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared, of models on which it is to be kept.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    fixed : collection of str
        Members whose mesh is prescribed.
    rest : Solved
        The equilibrium.
    """

    def __init__(
        self,
        scene: Scene,
        prepare: Callable[[Mesh], Prepared],
        accuracy: float,
        fixed: Collection[str],
        rest: Solved,
    ) -> None:
        self.scene, self.rest, self.accuracy = scene, rest, accuracy
        self.run = run = MemberContact(scene, prepare, accuracy, fixed)
        self.closest = run.closest
        points = points_of(rest)
        run.lines.keys = frozenset(point.pair for point in points if on_line(point))
        # Where members roll over nodes they slide.
        rolling = points_of(run.rolling(rest, lambda model: model.loading(rest.factor)))
        single = (_firm(point) for point in rolling if point.pair not in run.lines.keys)
        self.single = tuple(sorted(single, key=lambda point: (point.contact, point.members, point.at)))
        self.stretches = run.lines.stretches(rest)

    @property
    def sticks(self) -> bool:
        """Whether there are places that stick."""
        return any(point.grip is not None for point in self.single)

    @functools.cached_property
    def mesh(self) -> Mesh:
        """The mesh with what touches where it does; on lines as it was found, with ends that slide."""
        on_lines = [point for point in points_of(self.rest) if point.pair in self.run.lines.keys]
        mesh = self.rest.model.mesh if on_lines else replace(self.rest.model.mesh, cuts=self.cuts())
        return replace(mesh, points=tuple(self.run.lines.set_out(mesh, [*self.single, *on_lines])))

    def halved(self) -> Solved | None:
        """The same on half as long elements, but for those so short that they gain nothing; None if it is lost."""
        mesh = replace(self.rest.model.mesh.refined(self.run.lines.long(self.rest)), points=())
        points = self.run.lines.points_on(mesh, self.rest)
        return self.run.resolved(mesh, points, self.rest, lambda model: model.loading(self.rest.factor))

    # -- on another mesh --------------------------------------------------------------------------

    def cuts(self) -> dict[str, Array]:
        """The ends of elements at the equilibrium, without those that points have left beside others."""
        found = dict[str, Array]()
        for name, cuts in self.rest.model.mesh.cuts.items():
            lines = [stretch for key, own in self.stretches.items() if key[1][0] == name for stretch in own]
            ends = np.unique([0.0, 1.0, *(x for stretch in lines for x in (stretch[0], stretch[-1]))])
            # Elements end where lines do up to the accuracy only: these ends are moved, not others made.
            share = BESIDE * np.minimum(np.diff(cuts, prepend=-1.0), np.diff(cuts, append=2.0))
            share[np.abs(cuts[:, None] - breaks_of(self.scene, name)).min(axis=1) < SAME_CUT] = 0.0
            others = cuts[np.abs(cuts[:, None] - ends).min(axis=1) >= np.maximum(share, SLIVER)]
            others = others[np.diff(others, prepend=-1.0) >= SLIVER]
            found[name] = np.sort(np.concatenate([ends, others]))
        return found

    def points(self, mesh: Mesh) -> Points:
        """The points on a mesh in which elements end where they do at the equilibrium."""
        points, nodes = list(self.single), set[tuple[str, str]]()
        for key, stretches in self.stretches.items():
            for stretch in stretches:
                points += self._laid(self.closest.pairs[key], mesh, (stretch[0], stretch[-1]), nodes)
        return tuple(self.run.lines.set_out(mesh, points))

    def _laid(
        self, pair: Pair, mesh: Mesh, span: tuple[float, float], nodes: set[tuple[str, str]]
    ) -> Iterator[ContactPoint]:
        """Points of a member that lies on an obstacle over a span; at a node, which is told of, one for all members."""
        (member,), cuts = pair.members, mesh.cuts[pair.members[0]]
        for x in cuts[(cuts >= span[0]) & (cuts <= span[1])].tolist():
            point = ContactPoint(*pair.key, (x,), (False,), pair.distance, normal=pair.normal)
            if x > span[0]:
                yield replace(point, sides=(True, False))
            if x < span[1]:
                yield replace(point, sides=(False, True))
            if x not in span:
                continue
            if 0.0 < x < 1.0:
                yield replace(point, tangent=span[0] < span[1])
                continue
            end = pair.contact, self.scene.members[member].nodes[int(x)]
            if pair.ends[int(x)] and end not in nodes:
                nodes.add(end)
                yield point

    def start(self, prepared: Prepared) -> State:
        """The equilibrium as a start on a mesh with these points."""
        # Seen without contact, as in statics.
        prepared.equations.redundant = self.redundant
        return self.run.carried(self.rest, prepared)

    @functools.cached_property
    def redundant(self) -> bool:
        """Whether rows of the scene without contact are redundant."""
        prepared = self.run.prepare(replace(self.rest.model.mesh, points=()))
        nothing = prepared.model.loading(0.0, 0.0)
        return redundant(prepared.equations, prepared.equations.at(prepared.equations.start(nothing), nothing))

    def with_moved_ends(self, found: Solved) -> Mesh | None:
        """A mesh whose elements end where lines do, as seen from a state on another one; None where they do there.

        The obstacle takes a moment where a line is held to a place short of its end or beyond it.  It falls with the
        force there, by which the line ends.
        """
        model, lam, moved = found.model, found.state.lam, dict[tuple[str, float], float]()
        rows = {name: i for i, name in enumerate(model.row_names)}
        for point in (point for point in model.mesh.points if point.tangent and point.members[0] not in self.run.fixed):
            (member,), (at,) = point.members, point.at
            cuts, cut = model.mesh.cuts[member], model.mesh.cut_at(member, at)
            force = -lam[rows[f"{point.name}, gap"]]
            missing = -lam[rows[f"{point.name}, tangent"]] * model.scales.length / self.closest.lengths[member]
            low, high = ROOM * (cuts[cut - 1] - at), ROOM * (cuts[cut + 1] - at)
            if force > 0.0 and abs(missing) > ENDED * force:
                moved[member, at] = at + float(np.clip(missing / force, low, high))
        if not moved:
            return None
        self.stretches = {
            key: [[moved.get((key[1][0], x), x) for x in stretch] for stretch in stretches]
            for key, stretches in self.stretches.items()
        }
        ends = {name: [moved.get((name, x), x) for x in xs.tolist()] for name, xs in model.mesh.cuts.items()}
        return replace(model.mesh, cuts={name: np.array(xs) for name, xs in ends.items()})

    def resting(self, mesh: Mesh) -> dict[str, Array]:
        """Elements on lines, bool (elements,) by member, that are no longer than the longest of all others.

        Nothing moves there; shorter ones would only be stiffer, and leave more rounding.
        """
        lengths = {name: np.diff(cuts) * self.scene.center_lines[name].length for name, cuts in mesh.cuts.items()}
        found = {name: np.zeros(len(each), bool) for name, each in lengths.items()}
        for (_, (member, *_)), stretches in self.stretches.items():
            for stretch in stretches:
                found[member][mesh.cut_at(member, stretch[0]) : mesh.cut_at(member, stretch[-1])] = True
        longest = max((float(lengths[name][~lies].max(initial=0.0)) for name, lies in found.items()), default=0.0)
        return {name: lies & (lengths[name] <= longest) for name, lies in found.items()}

    # -- whether they are kept ----------------------------------------------------------------------

    def undecided(self) -> Iterator[str]:
        """What may begin or cease to touch, slide or lie under the smallest change, as sentences."""
        fields, scales = self.rest.fields, self.rest.model.scales
        least = UNDECIDED * scales.force
        for point, begun in zip(points_of(self.rest), self.rest.model.mesh.points, strict=True):
            told = fields.contact_point(begun)
            if point.pair in self.stretches and point.grip is None:
                continue
            if told["push"] < least:
                yield f"{_where(point)} without a force"
            elif point.grip is not None and told["rubs"] > (1.0 - UNDECIDED) * point.grip.coefficient * told["push"]:
                yield f"{_where(point)} and slides there"
            elif self._flattens(point):
                yield f"{_where(point)} and begins to lie along it"
        for key, stretches in self.stretches.items():
            for stretch in stretches:
                yield from self._idle(key, stretch, least)
        for near in self.closest.found(fields, UNDECIDED * scales.length):
            if not self._known(near):
                yield f"{_where(near)} without a force"

    def changed(self) -> Iterator[str]:
        """What touches otherwise than the points say, as sentences; none where they are those of an equilibrium."""
        fields = self.rest.fields
        for point, begun in zip(points_of(self.rest), self.rest.model.mesh.points, strict=True):
            if fields.contact_point(begun)["push"] < -LASTING * self.rest.model.scales.force:
                yield f"contacts.{point.contact} leaves {_places(point)}"
            elif any(not -SLIVER <= x <= 1.0 + SLIVER for x in point.at):
                yield f"contacts.{point.contact} slides off {_places(point)}"
            elif any(point.slides) and not point.edge:
                slopes = self.closest.slopes(fields, point.pair, point.at)[list(point.slides)]
                if np.abs(slopes).max() > NEAREST:
                    yield f"contacts.{point.contact} is nearer beside {_places(point)}"
                elif point.pair in self.stretches and self._ends_beside(point):
                    yield f"contacts.{point.contact} touches {point.members[0]} from or up to within an element"
        for near in self.closest.found(fields, 0.0):
            if near.gap < -self.run.tolerance and not self._known(near):
                yield _where(near)

    def lines(self, *, smooth: bool = False) -> Iterator[str]:
        """Lines that are not kept, as sentences; with ``smooth`` also those that are, on obstacles without friction."""
        for contact, members in sorted(self.run.lines.keys):
            if len(members) > 1:
                yield f"members {' and '.join(map(repr, members))} lie along each other (contacts.{contact})"
            elif self.scene.rubs or smooth:
                yield f"member {members[0]!r} lies along contacts.{contact}{' beside friction' * self.scene.rubs}"

    def _ends_beside(self, point: ContactPoint) -> bool:
        """Whether a line ends so far from where elements do that what presses between is no single force there."""
        (member,), (at,), mesh, scales = point.members, point.at, self.rest.model.mesh, self.rest.model.scales
        cuts, cut, lines = mesh.cuts[member], mesh.cut_at(member, at), self.run.lines
        unit = self.scene.center_lines[member].length / scales.length
        pressure = dict[int, float]()
        for p in mesh.points:
            pair, element = lines.element_of(mesh, p) or (None, -1)
            if pair == point.pair and element in (cut - 1, cut):
                push = self.rest.fields.contact_point(p)["push"] / scales.force
                pressure[element] = pressure.get(element, 0.0) + push / (unit * (cuts[element + 1] - cuts[element]))
        # The moment that this misses bends what is beyond.
        missed = 0.5 * max(pressure.values(), default=0.0) * (unit * (at - cuts[cut])) ** 2
        return bool(missed > self.accuracy * self.rest.fields.stiffness(member, at))

    def _flattens(self, point: ContactPoint) -> bool:
        """Whether a point is where the gap does not grow beside it, of what may bend."""
        if point.edge or len(point.at) > 1 or not self.run.lines.bends(point.members[0]):
            return False
        fields, unit = self.rest.fields, self.rest.model.scales.length
        level = abs(float(self.closest.slopes(fields, point.pair, point.at)[0])) < UNDECIDED
        return level and self.closest.bends(fields, point.pair, point.at[0]) * unit < UNDECIDED

    def _idle(self, key: PairKey, stretch: list[float], least: float) -> Iterator[str]:
        """The first part of a line on which nothing presses, of those that are no rounding of elements at its ends."""
        mesh, pressed = self.rest.model.mesh, set[int]()
        for point in (p for p in mesh.points if p.pair == key and p.line):
            if self.rest.fields.contact_point(point)["push"] > least * LINES:
                pressed |= {element for element, *_ in beside_line(mesh, point)}
        cuts = mesh.cuts[key[1][0]]
        first, last = (mesh.cut_at(key[1][0], stretch[i]) for i in (0, -1))
        ends = [first, *(cut for e in range(first, last) if e in pressed for cut in (e, e + 1)), last]
        for a, b in zip(ends[::2], ends[1::2], strict=True):
            if cuts[b] - cuts[a] > IDLE * (stretch[-1] - stretch[0]):
                yield f"contacts.{key[0]} touches {key[1][0]} from {cuts[a]:.4g} to {cuts[b]:.4g} without a force"
                return

    def _known(self, near: Near) -> bool:
        """Whether a place that touches is one of the points, or on a line."""
        for stretch in self.stretches.get(near.pair, ()):
            if stretch[0] <= near.at[0] <= stretch[-1]:
                return True
        here = self._place(near)
        return any(
            point.contact == near.contact
            and np.linalg.norm(self._place(point) - here) < self.closest.pairs[near.pair].width
            for point in points_of(self.rest)
        )

    def _place(self, one: ContactPoint | Near) -> Array:
        """Position (3,) of a place of the first member, m."""
        return np.asarray(self.rest.fields.positions(one.members[0], np.clip(one.at[:1], 0.0, 1.0))[0])


def _firm(point: ContactPoint) -> ContactPoint:
    """A point that, if it sticks, hardly gives way: small motions are those of what does not."""
    return point if point.grip is None else replace(point, grip=replace(point.grip, yields=0.0))


def _where(one: ContactPoint | Near) -> str:
    """``contacts.peg touches beam at 0.5``."""
    return f"contacts.{one.contact} touches {_places(one)}"


def _places(one: ContactPoint | Near) -> str:
    """``beam at 0.5``."""
    return " and ".join(f"{member} at {x:.4g}" for member, x in zip(one.members, one.at, strict=True))
