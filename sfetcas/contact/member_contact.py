"""Equilibria in which members touch each other: which points touch, and the way of the loads from zero.

At given points of contact an equilibrium is a solution of one system, in which the places of the points are unknowns
and the gaps rows, see :mod:`~sfetcas.mechanics.contact_points`.  Which points there are is found by an active set:
where members penetrate a point is added, where they would pull each other it is removed, until neither is left.  A new
point first stays where it is and pushes along a given normal; once its force is known it slides.

The loads are followed from zero in steps so short that no member passes through another one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..errors import SceneError
from ..mathematics.arrays import Array, Index, numbers, unit
from ..mechanics.accuracy import roughness
from ..mechanics.contact_points import loads_on, undeformed_vectors
from ..mechanics.equations import Point, State
from ..mechanics.fields import Fields, transferred
from ..mechanics.loading import Loading
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.model import Model
from ..mechanics.segments import cuts_of_point, place_of_cut
from ..solvers.arclength import Curve, Tangent, bordered
from ..solvers.between_states import turned_between
from ..solvers.continuation import JUMPED, near_factor
from ..solvers.newton import Converged, Limits, correct
from ..solvers.one_sided import LASTING, OneSided
from ..solvers.prepared import Prepared, Solved
from ..solvers.pseudo_transient import Drag
from .closest import Closest
from .edges import Edges
from .gripping import CENTRED, FIRM, Gripping, Placed
from .lines import AT_END, LINE, SHORT_LINE, SLIVER, Lines, Points, begun, ends_of, points_of
from .pairs import ONE, Near, Pair, PairKey, penetrating
from .passing import Passing, tangents_turned
from .spread import Numbers, Spread

__all__ = ["FITS", "LESS", "MORE", "STRIDE", "MemberContact", "Way"]

Way = Callable[[Model], Loading]
"""The loading of a model."""

ROUNDS = 30
"""Changes of the points at one loading, at most."""

AGAIN, HARDLY = 6, 100.0
"""Digits to which places are the same where points come again with nothing wrong with them; how many times as far
members may then rise within a line.
"""

SOFTENED, LEAST_SOFTENED = 0.125, 1e-3
"""First and least step of the way on which what is rough ceases to give way, parts of it."""

JAMMED = 1e-5
"""How far what is rough may give way, over the size of the scene: under forces of some ten thousand times the loads."""

SLIPS = 0.1
"""Slip in a step, over the size, from which on a nearer state is looked for: a ladder stands, and would do so again
where it has slid down far.
"""

SLIPPED = 1e-6
"""Share of the limit of friction from which on a place slides on, and by which length, dimensionless."""

TURN, SLIDES, ITERATIONS, ACROSS = 0.6, 0.02, 30, 12
"""Largest rotation of a node in a step of Newton's method but the first, rad, and way of a place of contact, over
the unit of length: where members hardly bend away from what they touch it would go past the other places, and rods that
wind up were lost where one more begins to touch; half as much takes too many steps.  Steps at most, also across a
direction, where shorter steps along a path are another way.
"""

STRIDE = 0.5
"""Largest rotation in a step of the way, rad: members between are then near to where they are at its ends."""

SWUNG = 2.0
"""Rotation between two states from which on members may have swung through others unseen, rad."""

FIRST, SHORTEST, AIM = 0.25, 2.0**-14, 0.7
"""First and shortest step, parts of the way; share of a stride that steps aim at."""

TOUCHED = 4e-5
"""How far places may have moved along each other in a step before they touch, of the size, over the first step."""

SUDDEN = 3.0
"""How many times faster than in the step before what is followed may turn, where it turns by a little at all."""

ENOUGH = 64
"""Elements up to which all are halved where it is not found where lines end, which takes the square of their number."""

FITS = 3
"""Times that elements are made to end where points slide, at most: each time these move by a small share of that."""

PATIENT = 2.0**-6
"""Step down to which the ends of lines are followed; in shorter ones they are sought anew."""

NARROW, EARLIEST, SOONER = 2.0**-8, 2.0**-30, 1.0 / 16.0
"""Step below which a loss of stability is taken for located, part of the way; the same of the first step; what that is
multiplied by where it is too long, and share of what is behind that steps need not fall below at first.
"""

NEAREST = 1e-3
"""Slope of the distance along a member up to which a place is taken for the nearest one."""

LIES = 1e-9
"""Half the slope of the distance at the end of a member from which on places beside it are nearer, rad."""

SMOOTH = 1e-6
"""Slope of the distance, rad, up to which a member is tangential to an obstacle at its end, and how far a place slides
there at most, a fraction of the length.
"""

ALLOWED = 1e-3
"""Largest penetration over the sum of the radii, whatever accuracy is asked for."""

ROUGH, REFINED = 0.05, 8
"""Roughness, see :func:`~sfetcas.mechanics.accuracy.roughness`, from which elements are divided on the way, as what is
unstable on a coarse mesh may be stable; divisions at one state at most.
"""

BETWEEN = 0.1
"""Share of the sum of the radii by which members penetrate each other between the places of a line, from which on its
elements are divided on the way: else they pass each other there.
"""

NEARLY = 0.5
"""Share of the depth below at the begin of a step from which on a finer mesh, not a shorter step, is what it needs."""

WITHIN = 1e-3
"""Depth, over the size, to which members that lie along an obstacle may be inside of it between ends of elements in a
step of the way: pressure that is linear along coarse elements leaves some 2e-4, an element in which a line ends and no
place slides some 5e-3.
"""

LESS, MORE = 0.3, 4.0
"""What drag is multiplied by after a step of a fall, and after one that was not found."""

VAIN = 4
"""Rounds one after the other in which it is not found what pushes along lines, after which none is near."""

NUDGE = 0.02
"""Rotation, rad, by which an unstable state is moved along its unstable mode."""

FALLS, DRAGS, BEYOND, SLOW, STILL = 80, (1.0, 1e-11, 1e6), 1.5, 0.1, 1e-5
"""Steps of a fall at most; first, least and largest drag; drag over what makes a step unique; rotation in a step, rad,
below which it is looked whether it has come to rest, and below which it has, though it may be unstable there.
"""

TOLD = 0.05
"""Rotation, rad, from which on a fall is told where no equilibrium was near, and a sudden turn in the shortest step; in
so short a step a state that goes on turns by less than a fifth of that.
"""

MOST_FALLS = 12
"""Unstable states on a way that are left, and ends of branches, at most."""

CREEPS = 3
"""Falls from ends of branches one after the other without a step between, at most: they would go on to the end."""

BESIDE = "an unstable equilibrium is beside the way: what is a little imperfect may go to its other side"
"""What a note says where the way goes on that comes near to another branch."""

ENDED = "no equilibrium was near beyond it"
"""What a note says of a place on the way from which nothing led on but a fall."""


@dataclass(frozen=True, eq=False)
class _Step:
    """A state on a way from one loading to another."""

    part: float
    solved: Solved


class MemberContact:
    """Equilibria of a scene in which members touch each other.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    fixed : collection of str
        Members whose mesh is prescribed.

    Attributes
    ----------
    closest : Closest
    tolerance : float
        Penetration that is accepted, m.
    redundant : bool or None
        Whether rows of the scene without contact are redundant; None where that is not known.
    gripping : Gripping
        Friction.
    stride, first, rough : float
        As ``STRIDE``, ``FIRST`` and ``ROUGH``.
    lines : Lines
        The lines along which members touch.
    edges : Edges
    passing : Passing
    patient : bool
        Whether a step is rather given up than that ends of lines are sought anew.
    vain : int
        Rounds, the last ones, in which it was not found what pushes along lines.
    across : callable or None
        Model -> its curve and a direction on it: where it is given the factor of the loads is an unknown, from that of
        the near state on, and the equilibrium one across the direction, see :meth:`.Curve.corrected`.
    within : callable or None
        Whether an equilibrium is near enough to be the one that is looked for: with friction one may be far beyond.
    at_once : bool
        Whether it is found all at once, too, what pushes along lines between members.
    standing, stood : bool
        Whether what begins to touch between rough members stays on the first one, and did so in the last step.
    jammed : bool
        Whether in the last step something would have had to give way by much, as what friction locks.
    """

    def __init__(
        self, scene: Scene, prepare: Callable[[Mesh], Prepared], accuracy: float, fixed: Collection[str]
    ) -> None:
        self.scene, self.prepare, self.accuracy, self.fixed = scene, prepare, accuracy, fixed
        self.closest = Closest(scene, 0.1 * accuracy)
        radii = min((pair.distance for pair in self.closest.pairs.values() if pair.stop is None), default=np.inf)
        self.tolerance = min(max(0.1 * accuracy, tolerances.CLOSED) * scene.size, ALLOWED * radii)
        self.leaves = scene.analysis.unstable == "leave"
        self.gripping = Gripping(scene, self.closest)
        self.stride, self.first, self.rough = STRIDE, FIRST, ROUGH
        self.jumps: list[tuple[float, str]] = []
        self.beside: list[float] = []
        self.redundant: bool | None = None
        self._loose: frozenset[str] | None = None
        self.lines = Lines(scene, self.closest, fixed)
        self.falls, self.patient, self.vain = 0, False, 0
        self.edges = Edges(scene, self.closest, self.tolerance)
        self.passing = Passing(scene, self.closest, self.edges, self.tolerance)
        self.across: Callable[[Prepared], tuple[Curve, Tangent]] | None = None
        self.within: Callable[[Solved], bool] | None = None
        self.jammed = self.at_once = self.standing = self.stood = False

    def hold(self, fixed: Collection[str]) -> None:
        """Take the mesh of other members for prescribed."""
        self.fixed = self.lines.fixed = fixed

    # -- begin ------------------------------------------------------------------------------------

    def refuse_penetrating(self, fields: Fields) -> None:
        """Refuse members that penetrate each other in the undeformed scene.

        Raises
        ------
        SceneError
            Names them, where and how deep.
        """
        between = [pair for pair in self.closest.pairs.values() if pair.stop is None]
        deep = [near for near in self.closest.found(fields, 0.0, between) if near.gap < -self.tolerance]
        if not deep:
            return
        near = min(deep, key=lambda one: one.gap)
        message = (
            f"{penetrating(near.members, near.at, -near.gap)} in the undeformed scene, accepted: members that do not"
        )
        raise SceneError(message, ("contacts", near.contact))

    def clear(self, fields: Fields) -> bool:
        """Whether no members penetrate each other."""
        return self.penetration(fields) <= self.tolerance

    def penetration(self, fields: Fields, pairs: Sequence[Pair] | None = None) -> float:
        """How deep members of given pairs, or of all, are in what they touch at most, m: between the places of a line,
        where nothing stops them.
        """
        return max((-near.gap for near in self.closest.found(fields, 0.0, pairs)), default=0.0)

    def unstopped(self, before: Solved, after: Solved) -> bool:
        """Whether members neither penetrate nor pass each other from one state to another."""
        self.edges.begin(before.fields)
        near = self._swung(before, after) < STRIDE and self.clear(after.fields)
        fields = before.fields, after.fields
        return near and not (self.passing.passed(*fields) or self.passing.bulged(*fields))

    @staticmethod
    def _swung(before: Solved, after: Solved) -> float:
        """Largest rotation between two states, rad; in the plane whole turns count, which tangents do not show."""
        there = transferred(before.model, before.state, after.model)
        return float(np.abs(turned_between(after.prepared.equations, after.state, there, near=True)).max(initial=0.0))

    def lying(self, start: Solved) -> Solved:
        """An undeformed state with the points where members lie on obstacles."""
        fields, close, mesh = start.fields, tolerances.CLOSED * self.scene.size, start.model.mesh
        self.edges.reset()
        on = [pair for pair in self.closest.pairs.values() if pair.stop is not None]
        found = {(near.pair, near.at): near for near in self.closest.found(fields, close, on)}
        for pair in (pair for pair in on if not pair.edge):
            (member,) = pair.members
            cuts = mesh.cuts[member]
            # What is rigid touches with its ends, or where it is curved.
            along = self.closest.beside(fields, pair, cuts if self.lines.bends(member) else cuts[[0, -1]], close)
            lies = any(self.closest.lies(fields, pair.key, a, b) for a, b in itertools.pairwise(cuts.tolist()))
            if along and lies and self.lines.bends(member):
                self.lines.keys |= {pair.key}
                mesh = self.lines.divided(fields, mesh, pair, [near.at[0] for near in along])
                along = self.closest.along(fields, pair, mesh, close)
                # The line has what it ends at, not the member beside it.
                found = {key: near for key, near in found.items() if near.pair != pair.key}
                ends = {end for near in along for end in self._ends(near)}
                found = {key: near for key, near in found.items() if not ends.intersection(self._ends(near))}
            elif self.lines.bends(member):
                continue
            known = {end for near in found.values() for end in self._ends(near)}
            found |= {(near.pair, near.at): near for near in along if not known.intersection(self._ends(near))}
        if not found:
            return start
        points = list[ContactPoint]()
        for near in found.values():
            points += self.lines.laid([near]) if self.lines.has(near) else [begun(near)]
        prepared = self.prepare(replace(mesh, points=tuple(self.lines.set_out(mesh, points))))
        nothing = prepared.model.loading(0.0, 0.0)
        state = self.carried(start, prepared)
        return Solved.taken(prepared, state, nothing)

    def _ends(self, near: Near | ContactPoint) -> list[tuple[str, str]]:
        """The contact and the node, where a member touches an obstacle at its end."""
        member, at = near.members[0], near.at[0]
        return [(near.contact, self.scene.members[member].nodes[int(at)])] if at in (0.0, 1.0) else []

    # -- one loading ------------------------------------------------------------------------------

    def solved(
        self,
        mesh: Mesh,
        points: Points,
        source: Solved,
        way: Way,
        since: Solved | None = None,
        drag: float = 0.0,
        ends: bool = False,
    ) -> Solved | None:
        """The equilibrium with given points from a near state; None if Newton's method does not converge.

        With ``drag`` rotations since another state are resisted, see :class:`~sfetcas.solvers.pseudo_transient.Drag`.
        """
        numbered = self.lines.set_out(mesh, points)
        pressing, far = None, None
        for count, _ in enumerate(FIRM if self.scene.rubs and points else (1.0,)):
            # Another number seldom helps here, but where lines end.
            if self.lines.keys and (ends or not count):
                pressing = self._pressing(mesh, numbered, source, way, since, drag)
                self.vain = self.vain + 1 if pressing is None else 0
            if pressing is not None or not (ends and self.lines.keys):
                pushing, near = pressing or (numbered, source)
                set_up = self.gripping.set_up(near.fields, mesh, pushing)
                found = self._corrected(replace(mesh, points=set_up), near, way, since, drag)
                if found is not None and self._taken(found):
                    if self._slipped(found) <= SLIPS:
                        return found
                    # Another number may lead to a state that is nearer.
                    far = found if far is None else min(far, found, key=self._slipped)
            self.gripping.change()
        if far is not None:
            return far
        found = self._softly(mesh, numbered, source, way, since, drag) if self.scene.rubs and points else None
        return found if found is not None and self._taken(found) else None

    def _slipped(self, found: Solved) -> float:
        """How far places with friction have slipped since the last state of a way, over the size, at most."""
        rough = (point for point in found.model.mesh.points if point.grip is not None)
        slips = (float(np.linalg.norm(found.fields.contact_point(point)["slip"])) for point in rough)
        return max(slips, default=0.0) / self.scene.size

    def _taken(self, found: Solved) -> bool:
        """Whether an equilibrium is near enough, and what is rough neither holds by what resists a slide nor gives way
        by much: what is jammed between obstacles would.
        """
        scales = found.model.scales
        # What is new sticks, however hard that is.
        rough = [(p, grip) for p in found.model.mesh.points if (grip := p.grip) is not None and grip.firm > 0.0]
        size = loads_on(self.scene, scales) * scales.force if rough else 0.0
        for point, grip in rough:
            told = found.fields.contact_point(point)
            push = max(told["push"], 0.0)
            jams = grip.yields * scales.length * push / size > JAMMED * self.scene.size
            self.jammed |= jams
            if jams or told["rubs"] > grip.coefficient * push + SLIPPED * scales.force:
                return False
        return self.within is None or self.within(found)

    def _pressing(
        self, mesh: Mesh, points: list[ContactPoint], source: Solved, way: Way, since: Solved | None, drag: float
    ) -> tuple[list[ContactPoint], Solved] | None:
        """Those of given points, and of those beside them on lines, that push, and where; None if none is found."""
        every = self.lines.set_out(mesh, [*points, *self.lines.beside(mesh, points, source.fields, self.at_once)])
        on_lines = [self.at_once and point.pair in self.lines.keys for point in every]
        free = [i for i, p in enumerate(every) if (not any(p.slides) if len(p.members) == 1 else on_lines[i])]
        if not free:
            return points, source
        for i in free:
            every[i] = self._known(source.fields, every[i])
        every = list(self.gripping.set_up(source.fields, mesh, every))
        prepared = self.prepare(replace(mesh, points=tuple(every)))
        prepared.equations.redundant = False
        pushing = self.gaps(prepared, [every[i] for i in free])
        # What presses on an element does so with both its forces, if only rounding chooses.
        halves = {self.lines.element_of(mesh, point) for point in points}
        acting = np.array([i < len(points) or self.lines.element_of(mesh, every[i]) in halves - {None} for i in free])
        resisting = self._added(prepared, since, drag)
        loads, state = way(prepared.model), self.carried(source, prepared)
        border = None if self.across is None else bordered(*self.across(prepared))
        system = OneSided(
            prepared.equations, loads, prepared.weight, None, None, resisting, pushing, acting.copy(), border=border
        )
        found = self._by_newton(system, state, source.factor)
        rubs = self._rubbing(prepared, every)
        if not found.converged and len(rubs):
            # From where friction has not changed yet.
            known = replace(system, acting=acting, still=rubs, _past=[])
            found = self._by_newton(known, state, source.factor)
            system = replace(known, still=system.still, _past=[])
            found = self._by_newton(system, found.state, found.loading.factor) if found.converged else found
        if not found.converged:
            return None
        idle = {i for i, pushed in zip(free, system.pushed(found.state).tolist(), strict=True) if not pushed}
        pressed = Solved(prepared, *found)
        # Where those that slide are now: from there their pushes go on.
        kept = [
            self._freed(pressed.fields, point, ()) if len(point.members) == 2 and i in free else point
            for i, point in enumerate(points_of(pressed))
            if i not in idle
        ]
        return self.lines.set_out(mesh, kept), pressed

    def _by_newton(self, system: OneSided, state: State, factor: float) -> Converged:
        """Newton's method from a near state."""
        iterations = ITERATIONS if self.across is None else ACROSS
        limits = Limits(iterations=iterations, most=TURN, slides=SLIDES, contraction=2.0)
        with np.errstate(over="ignore", invalid="ignore"):
            return correct(system, state, factor=factor, limits=limits)

    @staticmethod
    def gaps(prepared: Prepared, points: Iterable[ContactPoint]) -> Index:
        """Numbers of the gaps of points among all residuals; with friction of their pushes, which are unknowns."""
        equations, own = prepared.equations, Numbers(prepared.model)
        rows, forces = equations.unknowns, equations.rotation_unknowns
        every = [forces + own.forces(p)[0] if p.grip else rows + own.multipliers(p)[-1] for p in points]
        return np.array(every, np.intp)

    @staticmethod
    def _rubbing(prepared: Prepared, points: Iterable[ContactPoint]) -> Index:
        """Numbers of the friction at points among all unknowns."""
        first, own = prepared.equations.rotation_unknowns, Numbers(prepared.model)
        return np.array([first + i for p in points for i in own.forces(p)[1:]], np.intp)

    def _known(self, fields: Fields, point: ContactPoint) -> ContactPoint:
        """A point that stays where it is, the gap of which is measured where it is now; between members, across both,
        as nothing says where a place slides to that does not push.
        """
        if len(point.members) == 2:
            one, other = (fields.positions(m, np.array([x]))[0] for m, x in zip(point.members, point.at, strict=True))
            x, y, z = unit(one - other).tolist()
            return replace(point, slides=(False, False), normal=(x, y, z), new=True)
        return point if point.edge else replace(point, normal=self.closest.pairs[point.pair].normal, new=False)

    def _softly(
        self, mesh: Mesh, points: list[ContactPoint], source: Solved, way: Way, since: Solved | None, drag: float
    ) -> Solved | None:
        """As :meth:`solved`, from what is rough but gives way."""
        now, part, step = source, -1.0, 1.0
        while part < 1.0 and step > LEAST_SOFTENED:
            after = min(1.0, part + step)
            self.gripping.soften(after)
            known = [replace(point, new=after <= 0.0) for point in points]
            set_up = self.gripping.set_up(now.fields, mesh, known)
            found = self._corrected(replace(mesh, points=set_up), now, way, since, drag)
            if found is None:
                step *= 0.5 if part >= 0.0 else 0.0
            else:
                now, part, step = found, after, SOFTENED if part < 0.0 else 1.5 * step
        self.gripping.soften(1.0)
        return now if part == 1.0 else None

    def _corrected(self, mesh: Mesh, source: Solved, way: Way, since: Solved | None, drag: float) -> Solved | None:
        """The equilibrium on a mesh with its points, as of :meth:`solved`."""
        prepared = self.prepare(mesh)
        loading = way(prepared.model)
        state = self.carried(source, prepared)
        # Seen without contact, whose rows depend on others only nearly, where places are beside each other.
        prepared.equations.redundant = self.redundant
        resisting = self._added(prepared, since, drag)
        # What is lost may overflow before it is told to be.
        with np.errstate(over="ignore", invalid="ignore"):
            if self.across is not None:
                curve, along = self.across(prepared)
                return curve.corrected(state, source.factor, along)
            limits: dict[str, Any] = {"iterations": ITERATIONS, "most": TURN, "slides": SLIDES, "contraction": 2.0}
            found = prepared.correct(state, loading, drag=resisting, **limits)
        return found if found.balanced else None

    def _added(self, prepared: Prepared, since: Solved | None, drag: float) -> Callable[[State, Point], Point] | None:
        """What the equations have beside those of the model: drag, and gaps of surfaces that are drawn back."""
        resisting = None if since is None else self.drag(prepared, since, drag)
        model = prepared.model
        back = np.array([self.closest.back(point) for point in model.mesh.points]) / model.scales.length
        if not back.any():
            return resisting
        rows = self.gaps(prepared, model.mesh.points)

        def added(state: State, point: Point) -> Point:
            residual = point.residual.copy()
            residual[rows] += back
            point = replace(point, residual=residual)
            return point if resisting is None else resisting(state, point)

        return added

    def drag(self, prepared: Prepared, since: Solved, size: float) -> Drag:
        """What resists all rotations, and displacements of nodes that are unknowns whatever touches: in each choice of
        points the same resists.  Where they are not, as of what is free, it resists those of all that are.
        """
        model, scene, moved = prepared.model, self.scene, list[int]()
        there = transferred(since.model, since.state, model)
        number = {name: i for i, name in enumerate(model.positions.unknowns)}
        y, loose = there.y.copy(), self.travels(model.mesh)
        loose = loose if loose <= number.keys() else frozenset(number)
        for name, node in scene.nodes.items():
            ways = {f"{name}.{c}": axis for c, axis in zip("xyz"[: model.element.axes], np.eye(3))}
            ways |= {f"travel of {name}": unit(numbers(node.direction))} if node.slides else {}
            for label in ways.keys() & number.keys() & loose:
                y[number[label]] = ways[label] @ (since.fields.position(name) - node.position) / model.scales.length
                moved.append(number[label])
        return Drag(prepared.equations, replace(there, y=y), size, np.array(moved, np.intp))

    def travels(self, mesh: Mesh) -> frozenset[str]:
        """Names of the displacements of nodes that are unknowns where nothing touches."""
        if self._loose is None:
            nodes = {f"{prefix}{name}" for name in self.scene.nodes for prefix in ("", "travel of ")}
            unknowns = self.prepare(replace(mesh, points=())).model.positions.unknowns
            self._loose = frozenset(one for one in unknowns if one in nodes or one.rpartition(".")[0] in nodes)
        return self._loose

    def carried(self, source: Solved, prepared: Prepared, *, rests: bool = True) -> State:
        """A state as the start on another mesh or with other points, which begin where they are now.

        What segments carry is known in a state that ``rests``.
        """
        target, before = prepared.model, source.model
        state = transferred(before, source.state, target)
        y, lam = state.y.copy(), np.zeros_like(state.lam)
        mine, its, spread = Numbers(target), Numbers(before), Spread(source)
        # Points have other numbers than before: rows of points by what they are, all others by their names.
        others = [i for i, name in enumerate(target.row_names) if not name.startswith("contacts.")]
        lam[others] = state.lam[others]
        if rests:
            # Segments end where points are.
            closing, forces = source.fields.carried_to(target)
            lam[closing] = forces
        unit, axes = target.scales.length, target.element.axes
        # Those that continue are where the points of the state are now, those that have slid beyond an end there.
        formers = {p.key: former for p, former in zip(points_of(source), before.mesh.points, strict=True)}
        single = [point for point in target.mesh.points if not point.line]
        vectors = zip(
            Placed(self.scene, source.fields, single).vectors, undeformed_vectors(self.scene, single), strict=True
        )
        apart = {point.name: both for point, both in zip(single, vectors, strict=True)}
        self._displaced(y, mine.unknowns, target, source.fields)
        for point in target.mesh.points:
            turn = source.fields.motion_of(point.contact)
            if point.line:
                # Nothing has slipped yet.
                change = np.array(point.grip.origin)[:axes] / unit if point.grip else np.zeros(1)
            else:
                now, begun = apart[point.name]
                change = ((now if turn is None else turn[0] @ now) - begun)[:axes] / unit
            names = ("across", "along", "along too") if point.line else "xyz"
            for k, moved in enumerate(change.tolist()):
                y[mine.unknowns[f"{point.between}, {names[k]}"]] = moved
            for side, free in enumerate(point.slides):
                if free:
                    y[mine.unknowns[f"{point.place(side)}, arc length"]] = 0.0
            if point.new:
                continue
            former = formers.get(point.key)
            going_on = spread.of(target.mesh, point) if point.line and (former is None or former.line) else None
            count = len(mine.multipliers(point))
            force = np.zeros(0)
            if going_on is not None and len(going_on) == count + len(mine.forces(point)):
                lam[mine.multipliers(point)], force = going_on[:count], going_on[count:]
            elif former is not None:
                # Of what has become a line, or ceases to be one, the push alone goes on.
                same = former.line == point.line
                had_rows = {row.removeprefix(former.name): its.rows[row] for row in former.rows(axes)}
                for row in point.rows(axes):
                    what = row.removeprefix(point.name)
                    if what in had_rows and (same or what.endswith("gap")):
                        lam[mine.rows[row]] = source.state.lam[had_rows[what]]
                if point.grip is not None and former.grip is not None:
                    force = source.state.y[its.forces(former)]
            if len(force) and point.grip is not None:
                y[mine.forces(point)] = force
                rubs = float(np.linalg.norm(force[1:]))
                if rubs >= (1.0 - SLIPPED) * point.grip.coefficient * force[0] > 0.0:
                    # What has slid slides on.
                    way = force[1:] if point.line else np.array(point.grip.frame).T @ force[1:]
                    way = way if point.line or turn is None else turn[0] @ way
                    parts = names[1:axes] if point.line else names[:axes]
                    slipped = [mine.unknowns[f"{point.between}, {name}"] for name in parts]
                    y[slipped] -= SLIPPED * way[: len(parts)] / rubs
        return replace(state, y=y, lam=lam)

    @staticmethod
    def _displaced(y: Array, numbers: dict[str, int], target: Model, fields: Fields) -> None:
        """Enter how far ends of elements that points need have moved, into displacements (n,) by their numbers."""
        mesh, cuts = target.mesh, dict[str, set[int]]()
        for point in mesh.points:
            for side, (member, free) in enumerate(zip(point.members, point.slides, strict=True)):
                cuts.setdefault(member, set()).update(() if free else cuts_of_point(mesh, point, side))
        for member, own in cuts.items():
            x = mesh.cuts[member][sorted(own)]
            moved = fields.positions(member, x) - target.scene.center_lines[member].positions(x)
            for cut, change in zip(sorted(own), (moved / target.scales.length).tolist(), strict=True):
                place = place_of_cut(mesh, target.segments.ends, member, cut)
                for axis, way in zip("xyz"[: target.element.axes], change, strict=False):
                    number = numbers.get(f"{place}.{axis}")
                    if number is not None:
                        y[number] = way

    def resolved(self, mesh: Mesh, points: Points, source: Solved, way: Way, drag: float = 0.0) -> Solved | None:
        """The equilibrium in which nothing penetrates or pulls, from a near state; None if it is not found.

        Where it is known where lines end these places go on sliding; where that leads nowhere, or is not known, forces
        at ends of elements show where they end, and these slide from there.  Members touch each other at places that
        slide; where these lead nowhere, and the members are as near between them, along a line.  Rough ones then touch
        at places that stay on the first member.
        """
        lines = self.lines.keys
        # Those that stood in the step before go on so.
        found = self._standing(mesh, points, source, way) if self.stood and not drag else None
        if found is not None:
            return found
        known = self.lines.ends_slide(points)
        if known:
            found = self._resolved(mesh, points, source, way, drag, True)
        if found is None and not (known and self.patient):
            self.lines.keys = lines
            if known:
                points = self.lines.without_sliding_ends(mesh, points, source.fields)
            found = self._resolved(mesh, points, source, way, drag, False)
            if found is not None and not drag and any(map(self.lines.chosen, self.lines.keys)):
                lines = self.lines.keys
                ended = self._resolved(replace(found.model.mesh, points=()), points_of(found), found, way, drag, True)
                if ended is None or tangents_turned(found.fields, ended.fields) > STRIDE:
                    self.lines.keys = lines
                else:
                    found = ended
        if found is None:
            # What was taken for a line on the way to nothing is none.
            self.lines.keys = lines
            lined = self.lines.parallel(source, mesh)
            found = None if lined is None else self._resolved(*lined, source, way, drag, False)
        between = frozenset(key for key in lines if len(key[1]) == 2)
        if found is None and between and not self.scene.rubs:
            # Where places that come and go a few at a time go round it is found all at once what pushes.
            self.lines.keys, self.at_once = lines, True
            try:
                found = self._resolved(mesh, points, source, way, drag, False)
            finally:
                self.at_once = False
        if found is None and between:
            # Members that bend away from each other touch at places that slide again.
            self.lines.keys = lines - between
            found = self._resolved(mesh, points, source, way, drag, False)
        self.lines.keys = lines if found is None else self.lines.keys
        if found is None and self.scene.rubs and not (drag or self.patient or self.stood):
            found = self._standing(mesh, points, source, way)
        return found

    def _standing(self, mesh: Mesh, points: Points, source: Solved, way: Way) -> Solved | None:
        """As :meth:`resolved`, with places that begin to touch between rough members staying on the first one.

        Along a line that begins at a point, as in the braid of a knot, places beside it would slide back to that.
        """
        lines, self.standing = self.lines.keys, True
        try:
            found = self._resolved(mesh, points, source, way, 0.0, False)
        finally:
            self.standing = False
        self.lines.keys, self.stood = lines if found is None else self.lines.keys, found is not None
        return found

    def _resolved(self, mesh: Mesh, points: Points, source: Solved, way: Way, drag: float, ends: bool) -> Solved | None:
        tried: set[object] = set()
        since, solved, several, least = source, False, False, LINE
        self.edges.begin(source.fields)
        careful, alone, short = False, set[object](), set[PairKey]()
        flat: Points = ()
        most: Points = ()
        self.vain = 0
        for _ in range(ROUNDS // 3 if ends else ROUNDS):
            found = self.solved(mesh, points, source, way, since if drag else None, drag, ends)
            if (found is None and ends) or self.vain == VAIN:
                return None
            if found is None:
                if solved and several:
                    # All at once is faster; where that leads nowhere, one after the other.
                    careful, found = True, source
                elif solved and least > SHORT_LINE:
                    # Places between which a member is flat may slide anywhere there.
                    flat = points if careful else ()
                    least, found, careful = SHORT_LINE, source, False
                else:
                    return None
            lined = None if careful else self.lines.lengthened(found, flat or points_of(found), least)
            flat = ()
            parted = None if careful or lined else self.lines.parted(found, self.tolerance, np.inf, short)
            if parted is not None:
                lined = parted[:2]
                short |= set() if parted[2] is None else {parted[2]}
            if lined is not None:
                (mesh, points), several = lined, False
            else:
                points, changes = self._changed(found, tried, careful, ends)
                if not changes and self._unseen(found):
                    points, changes = self._changed(found, tried, careful, ends)
                several = changes > 1 and not careful
                if ends:
                    self.lines.forget(found, mesh, points)
                if not changes:
                    return found
                if changes == 1:
                    # What changes alone for the second time goes round.
                    key = frozenset((p.key, p.slides, p.new) for p in points)
                    if key in alone:
                        if ends or least == SHORT_LINE:
                            return None
                        # Between the places of which one takes the place of the other a member is flat.
                        flat, least, most = most, SHORT_LINE, ()
                    alone.add(key)
                    most = max(most, points, key=len)
            source, solved = found, True
        return None

    def _unseen(self, found: Solved) -> bool:
        """Whether members are inside of what they touched along lines of which nothing touches: these are none, then,
        as between ends of elements nothing would be seen.
        """
        gone = self.lines.keys - {point.pair for point in found.model.mesh.points}
        if self.penetration(found.fields, [self.closest.pairs[key] for key in sorted(gone)]) <= self.tolerance:
            return False
        self.lines.keys -= gone
        return True

    def _changed(self, found: Solved, tried: set[object], careful: bool, ended: bool) -> tuple[Points, int]:
        """The points to try next, where they are now, and how many are others than before; at most one if careful.

        With ``ended`` points slide where lines end.
        """
        fields, points = found.fields, found.model.mesh.points
        told = [fields.contact_point(point) for point in points]
        now = [replace(point, at=entry["at"]) for point, entry in zip(points, told, strict=True)]
        pushes = np.array([entry["push"] for entry in told])
        lines = self.lines.followed(found) if ended else {}
        ends = ends_of(lines)
        light = frozenset(now[i] for i in np.flatnonzero(pushes < self.accuracy * pushes.max(initial=0.0)))
        wrong = self._wrong(found, now, pushes)
        more = self._penetrating(fields, [point for point, off in zip(now, wrong, strict=True) if not off])
        states = ["wrong" if off else "right" for off in wrong] + ["new"] * len(more)
        key = frozenset((p.key, now) for p, now in zip((*now, *more), states, strict=True))
        if (careful or key in tried) and (wrong.any() or more):
            # Also where all at once goes round.
            worst = int(np.argmin(np.where(wrong, pushes, np.inf))) if wrong.any() else -1
            kept = [point for i, point in enumerate(now) if i != worst]
            more = () if wrong.any() else more[:1]
            return (*(self._freed(fields, point, ends, light) for point in kept), *more), 1
        tried.add(key)
        if wrong.any() or more:
            kept = [point for point, off in zip(now, wrong, strict=True) if not off]
            slid = tuple(self._freed(fields, point, ends, light) for point in kept)
            # What begins to slide on an obstacle may do away with what penetrates beside it.
            begins = {p.pair for p, old in zip(slid, kept, strict=True) if p.slides != old.slides and len(p.at) == 1}
            more = tuple(point for point in more if point.pair not in begins)
            return (*slid, *more), int(wrong.sum()) + len(more) + len(begins)
        if ended:
            # Where a member is hardly lifted between two lines these may be one with other ends, and so on: then it is.
            same = frozenset((p.pair, p.slides, p.sides, *(round(x, AGAIN) for x in p.at)) for p in now)
            lines = self.lines.followed(found, HARDLY) if same in tried else lines
            new, count = self.lines.with_sliding_ends(found, now, pushes, lines)
            if count:
                tried.add(same)
                return new, 2
        kept = self._merged(now, pushes)
        slid = self.edges.joined(tuple(self._freed(fields, point, ends, light) for point in kept))
        moved = self.gripping.off_centre(fields, points, now)
        return slid, int(moved or slid != tuple(now))

    def _wrong(self, found: Solved, now: list[ContactPoint], pushes: Array) -> Array:
        """Whether points, where they are now, are where nothing is nearest, or would have to pull."""
        lost = np.array([self._lost(found.fields, point) for point in now], dtype=bool)
        rounding = LASTING * np.abs(pushes).max(initial=0.0)
        # What is rough and pushes, but has slid from where its normal was set up, is set up anew from where it is.
        lost &= ~((pushes > rounding) & np.array([len(p.at) == 2 and p.grip is not None for p in now], dtype=bool))
        # A corner on an edge is pushed between two normals.
        pushes = np.where([point.met and not any(point.slides) for point in now], 0.0, pushes)
        # Along a line what does not push is left; what slides there may have to stay until it is known.
        wrong = lost | (pushes < -rounding - 1e-12 * found.model.scales.force)
        wrong |= np.array([self.lines.has(p) and not self.lines.chosen(p.pair) for p in now], dtype=bool) & (
            pushes < rounding
        )
        # Within a line what slides and does not press is no end of it.
        ended = [any(p.slides) and p.pair in self.lines.keys and self.lines.chosen(p.pair) for p in now]
        wrong |= np.array(ended, dtype=bool) & (pushes < rounding)
        # What is new sticks, and may pull only because it does.
        return wrong & np.array([not (point.new and point.grip) for point in found.model.mesh.points], dtype=bool)

    def _lost(self, fields: Fields, point: ContactPoint) -> bool:
        """Whether a point is where members are not nearest: where it does not push, nothing else keeps it there."""
        if point.edge:
            return self.edges.left(fields, point)
        if not any(point.slides) or not all(0.0 <= x <= 1.0 for x in point.at):
            return False
        slopes = self.closest.slopes(fields, point.pair, point.at)
        return bool(np.abs(slopes[list(point.slides)]).max() > NEAREST)

    def _merged(self, points: list[ContactPoint], pushes: Array) -> list[ContactPoint]:
        """The points without those that have slid to where another one is."""
        kept: list[ContactPoint] = []
        for i in np.argsort(-pushes, kind="stable").tolist():
            point = points[i]
            if self.lines.has(point) or not any(self._same(point, one) for one in kept if not self.lines.has(one)):
                kept.append(point)
        return [point for point in points if point in kept]

    def _same(self, point: ContactPoint | Near, other: ContactPoint) -> bool:
        # What is new on an edge slides by more than its width.
        near = bool(other.edge) and other.new
        if point.pair != other.pair:
            return self.closest.one_place(point, other)
        return near or self.closest.alike(point.pair, point.at, other.at, ONE)

    def _freed(
        self,
        fields: Fields,
        point: ContactPoint,
        ends: Collection[tuple[PairKey, float]],
        light: Collection[ContactPoint] = (),
    ) -> ContactPoint:
        """A point as it slides from where it is, though not beyond ends; along a line it stays on the first member.

        ``ends`` are where lines end.  ``light`` points push so little that it does not matter where: they stay at ends
        of members, from which they would go any way where these lie along each other.
        """
        if point.edge:
            return self.edges.freed(fields, point)
        normal = self.closest.pairs[point.pair].normal
        at = tuple(min(max(x, 0.0), 1.0) for x in point.at)
        if at != point.at:
            slides = tuple(free and x == now for free, x, now in zip(point.slides, at, point.at, strict=True))
            return replace(point, at=at, slides=slides, normal=normal, new=False)
        free = [0.0 < x < 1.0 for x in at]
        stop = self.closest.pairs[point.pair].stop
        if stop is not None and stop.kind == "flat" and self.closest.stiff(point.members[0]):
            # What is straight and rigid touches a plane with its ends.
            free = [False]
        elif not all(free) and point not in light:
            slopes = self.closest.slopes(fields, point.pair, at)
            # At an end a point goes inwards where that is nearer; what lies there stays.  With friction it would go to
            # where that was before it was set up.
            lies = CENTRED if point.grip else LIES
            free = [0.0 < x < 1.0 or (0.5 - x) * slope < -lies for x, slope in zip(at, slopes.tolist(), strict=True)]
        ends_line = all(point.sides) and not point.line and (point.pair, point.at[0]) in ends
        slides = (free[0] and (ends_line or not self.lines.has(point)), *free[1:])
        if self.standing and point.grip is not None and len(at) == 2 and point.slides != (True, True):
            slides = (False, slides[1])
        stays = not point.new and slides == point.slides
        return point if stays else replace(point, slides=slides, normal=normal, new=False)

    def _penetrating(self, fields: Fields, points: list[ContactPoint]) -> Points:
        """New points where members penetrate each other, the deepest first."""
        found = self.lines.deepest(fields, points, self.tolerance)
        ends = {end for point in points if point.line or point.edge for end in self._ends(point)}
        for one in self.closest.found(fields, 0.0):
            deep = one.gap < -self.tolerance and not self.lines.has(one) and not ends.intersection(self._ends(one))
            if deep and not any(self._same(one, point) for point in points if not self.lines.has(point)):
                found.append(one)
        found.sort(key=lambda one: one.gap)
        mesh, lines = fields.model.mesh, self.lines
        laid = (lines.allowed(mesh, points, lines.laid([one])) if lines.has(one) else [begun(one)] for one in found)
        return tuple(itertools.chain.from_iterable(laid))

    # -- steps ------------------------------------------------------------------------------------

    def unstable(self, found: Solved, way: Way) -> bool:
        """Whether a state is unstable, and the scene asks to leave such states."""
        return self.leaves and found.model.minimisable and found.negative > 0 and self.rolling(found, way).negative > 0

    def rolling(self, found: Solved, way: Way) -> Solved:
        """The state in which places at nodes over which members go on smoothly slide, as where they roll they do.

        Of these the stability is that of the state, while what is at an end of a member stays there.
        """
        points = points_of(found)
        slid = tuple(replace(p, slides=(True,)) if self._rolls(found.fields, p) else p for p in points)
        if slid == points:
            return found
        numbered = self.lines.set_out(found.model.mesh, slid)
        there = self._corrected(replace(found.model.mesh, points=tuple(numbered)), found, way, None, 0.0)
        if there is None:
            return found
        moved = (abs(p.at[0] - now.at[0]) for p, now in zip(points, points_of(there), strict=True))
        return there if max(moved) < SMOOTH else found

    def _rolls(self, fields: Fields, point: ContactPoint) -> bool:
        """Whether a point is at a node and on an obstacle to which two members are tangential there."""
        if len(point.at) > 1 or point.edge or any(point.slides) or point.at[0] not in (0.0, 1.0):
            return False
        members, tangential = self.scene.members, 0
        node = members[point.members[0]].nodes[int(point.at[0])]
        for key, pair in self.closest.pairs.items():
            if key[0] == point.contact and pair.stop is not None and not self.closest.stiff(pair.members[0]):
                ends = [float(end) for end, name in enumerate(members[pair.members[0]].nodes) if name == node]
                tangential += sum(abs(float(self.closest.slopes(fields, key, (x,))[0])) < SMOOTH for x in ends)
        return tangential == 2

    def follow(self, way: Callable[[float], Way], start: Solved) -> Solved | None:
        """The state at the end of a way, ``way(1)``, from its begin; None if it is lost.

        Raises
        ------
        SolveError
            The way leads beyond what the scene describes, see :meth:`.Fields.beyond_limits`.
        """
        if self._dips(start.fields):
            # No step from there would be taken, however short it is.
            start = self._refined(start, way(0.0)) or start
        self.jumps, self.beside, self.falls, mesh = [], [], 0, replace(start.model.mesh, points=())
        self.stood = False
        unstable: _Step | None = None
        self.patient = False
        now, step, left, pace, creeps = _Step(0.0, start), self.first, -1.0, 0.0, 0
        # In space what is driven by a whole turn looks as if it were not.
        turn = way(1.0)(start.model).plus(way(0.0)(start.model).scaled(-1.0)).turned if start.model.space else 0.0
        while now.part < 1.0:
            self.reached = now
            # What is soft bends at the begin by small shares of the loads.
            narrow = min(NARROW, SOONER * now.part) if now.part > 0.0 else EARLIEST
            part, lines = min(1.0, now.part + min(step, 1.0 / max(turn, 1.0))), self.lines.keys
            self.patient = step > PATIENT
            there = self.stepped(mesh, now.solved, way(part))
            self.patient = False
            # Along lines places begin to touch all the time, near to where they do.
            single = [] if there is None else [p for p in there.model.mesh.points if p.pair not in self.lines.keys]
            begun = self.gripping.begins(single, TOUCHED * self.first)
            if begun is not None:
                # What begins to touch is where it was then: steps end there.
                step = begun * (part - now.part)
                if step >= SHORTEST:
                    self.lines.keys = lines
                    continue
            aside = there is not None and self.passing.bulged(now.solved.fields, there.fields)
            finer = None if there is None else self._refined(there, way(part))
            # In the shortest steps what no finer mesh has goes on as it is: the answer is refined all the same.
            there = there if finer is None and step <= narrow else finer
            mesh = mesh if there is None else replace(there.model.mesh, points=())
            turned = 0.0 if there is None else tangents_turned(now.solved.fields, there.fields)
            falling = there is not None and self.unstable(there, way(part))
            # What turns so much faster than before may have gone over to another branch.
            sudden = turned > max(TOLD, SUDDEN * pace * (part - now.part)) and pace > 0.0
            aside |= there is not None and self.passing.aside(now.solved.fields, there.fields)
            if there is None or ((falling or sudden or aside) and step > narrow):
                unstable = _Step(part, there) if there is not None and falling else unstable
                # What was taken for a line on the way to a state that is not taken is none.
                step, self.lines.keys = (0.5 if now.part > 0.0 else SOONER) * (part - now.part), lines
                if there is None and step < narrow and left < now.part:
                    # Where a branch of equilibria ends what moves on comes to rest on another one.
                    creeps += 1
                    if creeps > CREEPS:
                        return None
                    left, there = now.part, self._fallen_from(mesh, now, part, way(part))
                    now, step = (now, step) if there is None else (_Step(part, there), self.first)
                    mesh = mesh if there is None else replace(there.model.mesh, points=())
                elif there is None and (step < SHORTEST * narrow / NARROW or (self.jammed and step < NARROW)):
                    return None
                continue
            assert there is not None
            limit = there.fields.beyond_limits() if self.scene.limited_on_ways else None
            if limit is not None:
                raise limit
            if falling:
                rest = self._fallen_on(mesh, there, way(part))
                if rest is None:
                    return None
                self.jumps.append((part, JUMPED))
                there = rest
            elif sudden:
                self.jumps.append((part, ENDED))
            if unstable is not None and part >= unstable.part:
                # The way goes on beside what a longer step had found.
                near = tangents_turned(unstable.solved.fields, there.fields) < TOLD
                self.beside += [unstable.part] if near and not falling else []
                unstable = None
            # As long as turns by a little less than a stride.
            longer = min(2.0, AIM * self.stride / max(turned, 0.1 * self.stride))
            pace, creeps = turned / (part - now.part) if not falling else 0.0, 0
            now, step = _Step(part, there), longer * (part - now.part) if not falling else self.first
        return now.solved

    def stepped(self, mesh: Mesh, now: Solved, way: Way, near: Solved | None = None) -> Solved | None:
        """The state at the end of a step of a way; None where it is not found, or too far away.

        ``near`` is what is expected there, ``now`` by default.
        """
        near = near or now
        self.gripping.since, self.jammed = now.fields, False
        points = tuple(map(self.gripping.begun, points_of(near)))
        there = self.resolved(mesh, points, near, way)
        crossings = [] if there is None else self.passing.crossed(now.fields, there.fields)
        if crossings:
            # Members thinner than the step is long touch where they were nearest before.
            there = self.resolved(mesh, (*points, *map(begun, crossings)), near, way)
            crossings = [] if there is None else self.passing.crossed(now.fields, there.fields)
        if there is None or crossings:
            return None
        if self._dips(there.fields):
            # Where it nearly did so before, shorter steps would dip as deep: elements are too long.
            finer = self._refined(there, way) if self._dips(now.fields, NEARLY) else None
            if finer is None or self._dips(finer.fields):
                return None
            there = finer
        far = tangents_turned(now.fields, there.fields) > self.stride or self._swung(now, there) > SWUNG
        through = self.passing.swept(now.fields, there.fields) or bool(self.passing.crossed(there.fields, now.fields))
        return None if far or through else there

    def _dips(self, fields: Fields, share: float = 1.0) -> list[Near]:
        """Where members dip into what they lie along, between places where nothing stops them, by a share of what steps
        may leave or more.
        """
        lined = [self.closest.pairs[key] for key in sorted(self.lines.keys) if self.lines.chosen(key)]
        return [near for near in self.closest.found(fields, 0.0, lined) if near.gap < -share * WITHIN * self.scene.size]

    def _fallen_from(self, mesh: Mesh, now: _Step, part: float, way: Way) -> Solved | None:
        """Where a state comes to rest a little further on its way, where none is near to it; None where it does not."""
        if not (self.leaves and now.solved.model.minimisable) or self.falls == MOST_FALLS:
            return None
        rest = self.relaxed(mesh, now.solved, way)
        rest = None if rest is None else self._refined(rest, way)
        if rest is None or rest.negative > 0:
            return None
        turned = tangents_turned(now.solved.fields, rest.fields)
        far = turned > self.stride or self.passing.passed(now.solved.fields, rest.fields)
        self.falls += far
        if far or turned > TOLD:
            self.jumps.append((part, ENDED))
        return rest

    def _refined(self, found: Solved, way: Way) -> Solved | None:
        """The state on a mesh that is fine enough for what is decided on the way; None if it is not found there."""
        for _ in range(REFINED):
            rough, model = roughness(found.fields) > self.rough, found.model
            marks = {n: rough[model.elements_of(n)] & (n not in self.fixed) for n in model.members}
            between = [self.closest.pairs[key] for key in sorted(self.lines.keys) if len(key[1]) == 2]
            near_each_other = self.closest.found(found.fields, 0.0, between)
            deep = [near for near in near_each_other if near.gap < -BETWEEN * near.distance]
            for near in (*deep, *self._dips(found.fields)):
                if near.members[0] not in self.fixed:
                    marks[near.members[0]][model.mesh.element_at(near.members[0], near.at[0])] = True
            if not any(marked.any() for marked in marks.values()):
                return found
            mesh = replace(model.mesh.refined(marks, found.fields.kinks), points=())
            finer = self.resolved(mesh, self.lines.points_on(mesh, found), found, way)
            if finer is None or tangents_turned(found.fields, finer.fields) > STRIDE:
                return None
            found = finer
        return found

    def fitted(self, found: Solved, way: Way, times: int = FITS, *, prescribed: bool = False) -> Solved:
        """The state with elements that end where points slide, made to do so some times; as far as that is found.

        ``prescribed`` as of :meth:`.Lines.fitted`.
        """
        for _ in range(times):
            if self.lines.off_ends(found) < self.accuracy:
                break
            now, points = replace(found.model.mesh, points=()), points_of(found)
            there, tried, ended = None, now, self.lines.ends_slide(points)
            # What has become longer, for its end has moved, may not have the place that slides.
            for sliver in (SLIVER, AT_END) if ended else (SLIVER,):
                mesh, fitted = self.lines.fitted(now, points, prescribed=prescribed, sliver=sliver)
                if there is None and not mesh.same(tried):
                    there, tried = self.resolved(mesh, fitted, found, way), mesh
                    if there is not None and tangents_turned(found.fields, there.fields) > STRIDE:
                        there = None
                    if there is not None and ended and not self.lines.ends_slide(points_of(there)):
                        there = None
            if there is None:
                break
            found = there
        return found

    @property
    def last_step(self) -> tuple[Fields | None, frozenset[PairKey]]:
        """The state from which slip is measured, and the lines: what :meth:`ended` needs to know of the last step."""
        return self.gripping.since, self.lines.keys

    def ended(self, found: Solved, way: Way, last_step: tuple[Fields | None, frozenset[PairKey]]) -> Solved:
        """The state at the end of a way with friction with the places where lines end for unknowns, if it is found.

        ``last_step`` is what :attr:`last_step` was there.
        """
        self.gripping.since, self.lines.keys = last_step
        self.lines.ending = self.lines.ends_within(found)
        if not self.lines.ending:
            return found
        mesh, points, best, last = replace(found.model.mesh, points=()), points_of(found), found, 0
        while last < mesh.elements and (not last or mesh.elements <= ENOUGH):
            there, last = self.resolved(mesh, self.lines.by_element(points), found, way), mesh.elements
            if there is not None and tangents_turned(found.fields, there.fields) < STRIDE:
                if self.lines.ends_slide(points_of(there)):
                    best = self.fitted(there, way)
                    break
                best = there if best is found else best
            # On shorter elements a place that slides does not go so far from where forces say that it is.
            mesh = mesh.refined({name: np.full(len(x) - 1, name not in self.fixed) for name, x in mesh.cuts.items()})
            points = self.lines.points_on(mesh, found)
        self.lines.ending = frozenset()
        return best

    def as_lines(self, found: Solved, way: Way, turned: float) -> Solved | None:
        """The state with the two ends of each short line that one point stood for; None where there is none.

        ``turned`` as of :meth:`.Lines.parted`.
        """
        parted = self.lines.parted(found, self.tolerance, turned)
        there = None if parted is None else self.resolved(*parted[:2], found, way)
        return None if there is None or tangents_turned(found.fields, there.fields) > STRIDE else there

    def fallen(self, mesh: Mesh, found: Solved, way: Way, side: int = 0) -> Solved | None:
        """Where an unstable state falls to through something viscous; None where it does not come to rest.

        ``side`` is the sign of the unstable mode along which it falls, zero for that of lower energy.
        """
        return self.relaxed(mesh, self._nudged(found, side), way, max(-found.stability.smallest, 0.0))

    def relaxed(self, mesh: Mesh, now: Solved, way: Way, deep: float = 0.0) -> Solved | None:
        """Where a state that is none of rest comes to rest in something viscous; None where it does not.

        ``deep`` is minus its lowest eigenvalue, if that is below zero: drag beyond it leaves each step one minimum.
        """
        first, least, largest = DRAGS
        drag, little = max(first, BEYOND * deep), 0.0
        for _ in range(FALLS):
            there = self.resolved(mesh, points_of(now), now, way, drag)
            turned = np.inf if there is None else tangents_turned(now.fields, there.fields)
            if there is None or turned > STRIDE or self.passing.passed(now.fields, there.fields):
                little, drag = drag, drag * min(MORE, max(1.5, turned / (AIM * STRIDE)))
                if drag > largest * max(deep, 1.0):
                    return None
                continue
            now, mesh = there, replace(there.model.mesh, points=())
            # What is unstable is near to an equilibrium where it hardly moves.
            if turned < SLOW and drag <= first and (turned < STILL or not now.negative):
                rest = self.resolved(mesh, points_of(now), now, way)
                if rest is not None and self.near(now, rest):
                    if rest.negative == 0:
                        return rest
                    if turned < STILL:
                        return self._fallen_on(mesh, rest, way)
                if drag <= least:
                    return None
            # Less than what makes a step unique would lead back to the unstable state; what has just been too little
            # is so for a while.
            floor = BEYOND * max(-now.stability.smallest, 0.0) if now.negative else least
            drag, little = max(LESS * drag, np.sqrt(drag * little), floor), LESS * little
        return None

    def near(self, now: Solved, there: Solved, most: float = STRIDE) -> bool:
        """Whether members can have moved from one state to another in a step in which they turn by so much, rad."""
        small = tangents_turned(now.fields, there.fields) <= most
        return small and not self.passing.passed(now.fields, there.fields)

    def _fallen_on(self, mesh: Mesh, found: Solved, way: Way) -> Solved | None:
        """Where what has come to rest at an unstable state falls to from there."""
        self.falls += 1
        return self.fallen(mesh, found, way) if self.falls <= MOST_FALLS else None

    @staticmethod
    def _nudged(found: Solved, side: int = 0) -> Solved:
        """An unstable state moved along its unstable mode, to a side as of :meth:`fallen`.

        Where points are on members is no part of that: they are where members are nearest.
        """
        prepared, loading = found.prepared, found.loading
        state = prepared.beside(found, loading, side * NUDGE) if side else prepared.nudged(found, loading, NUDGE)
        slides = {f"{p.place(side)}, arc length" for p in found.model.mesh.points for side in range(len(p.members))}
        still = np.array([name in slides for name in found.model.positions.unknowns], dtype=bool)
        state = replace(state, y=np.where(still, found.state.y, state.y))
        return replace(found, state=state, known=None)

    def notes(self, begin: float, end: float) -> tuple[str, ...]:
        """What is said of the last way, between two factors."""
        jumps = (f"jumped {near_factor(begin + part * (end - begin))}: {how}" for part, how in self.jumps)
        beside = (f"{near_factor(begin + part * (end - begin))} {BESIDE}" for part in self.beside)
        return (*jumps, *beside)
