"""Equilibria on one mesh where obstacles stop the ends of elements: where a search looks for what may touch.

Which ends are pushed is solved for with all else, see :mod:`~sfetcas.solvers.one_sided`, in a model that has a row for
each end and obstacle, so that a run from any state costs little more than one without contact.  Where a state is inside
of obstacles these are drawn back by as much, and come in again within the first steps.  Equilibria are rough: members
may penetrate between ends of elements, touch each other, or pass edges; where they touch really is found from here, see
:func:`brought_in`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.equations import Point, State
from ..mechanics.fields import transferred
from ..mechanics.mesh import ContactPoint, Mesh
from ..solvers.between_states import turned_between
from ..solvers.deflation import deflated
from ..solvers.newton import Balance, Iterate, Limits, correct
from ..solvers.one_sided import OneSided
from ..solvers.prepared import Prepared, Solved
from ..solvers.pseudo_transient import Drag
from .lines import Points, begun, points_of
from .member_contact import LESS, MORE, MemberContact, Way
from .pairs import Pair
from .passing import tangents_turned

__all__ = ["StoppedEnds", "brought_in", "stops_ends"]

COMING = 10
"""Steps in which obstacles that were drawn back come in again."""

HELD = 1e-3
"""Drag in these steps on each of them, for what nothing but obstacles holds."""

SHORTEST, LONGER = 0.05, 1.5
"""Shortest part of the way on which obstacles come in that is taken at once, and how much longer each part is."""

INSIDE = 1.01
"""How far obstacles are drawn back, over how deep a state is inside."""

HOLDING = 100.0
"""Drag that holds a state until it is known how hard it is pushed."""

DRAG, MOST_DRAG, BEYOND = 1.0, 1e6, 4.0
"""First and largest drag of the way downhill, and drag over what makes a step unique."""

DOWN, STEPS, STRIDE, STILL = 30, 15, 0.5, 0.02
"""Steps downhill at most, and of Newton's method in each; largest rotation, rad, in a step, and
that below which the state is near to where it comes to rest.
"""


class StoppedEnds:
    """The model on a mesh in which obstacles stop the ends of elements.

    Parameters
    ----------
    run : MemberContact
    free : Prepared
        On the mesh, without contact.
    way : callable
        The loading of a model.
    """

    def __init__(self, run: MemberContact, free: Prepared, way: Way) -> None:
        self.run, self.free, self.way = run, free, way
        mesh = free.model.mesh
        stopped = dict[tuple[object, ...], ContactPoint]()
        for pair in filter(stops_ends, run.closest.pairs.values()):
            for x in mesh.cuts[pair.members[0]].tolist():
                if x not in (0.0, 1.0) or pair.ends[int(x)]:
                    # A node where several members end is one place.
                    node = run.scene.members[pair.members[0]].nodes[int(x)] if x in (0.0, 1.0) else (pair.members, x)
                    point = ContactPoint(*pair.key, (x,), (False,), pair.distance, normal=pair.normal)
                    stopped.setdefault((pair.contact, node), point)
        self.points = [replace(point, number=i) for i, point in enumerate(stopped.values())]
        self.prepared = run.prepare(replace(mesh, points=tuple(self.points)))
        self.prepared.equations.redundant = False
        self.loading = way(self.prepared.model)
        self.gaps = run.gaps(self.prepared, self.points)

    def taken(self, state: State) -> Solved:
        """A state of the model without contact."""
        return Solved.taken(self.free, state, self.way(self.free.model))

    def arrived(self, start: State, known: Sequence[State]) -> tuple[Solved, Solved] | None:
        """The equilibrium to which a run from a state without contact leads that keeps away from known ones, without
        what touches and with the ends of elements that are pushed as rows; None where it leads to none.
        """
        state, inside = self._begun(start)
        held = self._drag(state, HELD)
        coming = 1.0

        def added(state: State, point: Point) -> Point:
            return replace(held, since=state)(state, self._drawn_back(point, coming * inside)) if coming else point

        system = self._system(added)

        def step(here: Iterate) -> Array:
            nonlocal coming
            coming = max(0.0, 1.0 - here.count / COMING)
            return system.step(Balance(here.state, here.point, plain=here.point, loading=self.loading, residual=np.inf))

        def settled(near: State) -> Solved:
            nonlocal coming
            coming = 0.0
            return self._corrected(system, near, Limits())

        least = COMING if inside else 0
        found = deflated(self.prepared, state, self.loading, known, step=step, correct=settled, least=least)
        if found is None:
            return None
        return self._held(found, system.pushed(found.state))

    def downhill(self, start: State, deep: float = 0.0) -> State:
        """Where a state without contact comes to on its way downhill through something viscous.

        ``deep`` is minus the lowest eigenvalue beside it, dimensionless, where that is below zero.
        """
        (state, inside), drag, acting = self._begun(start), max(DRAG, BEYOND * deep), None
        part = 0.0 if inside else 1.0
        for _ in range(DOWN):
            ahead = min(1.0, part + 1.0 / COMING)
            resisting, back = self._drag(state, drag), (1.0 - ahead) * inside

            def added(here: State, point: Point, resisting: Drag = resisting, back: float = back) -> Point:
                return resisting(here, self._drawn_back(point, back))

            system = self._system(added, acting)
            found = self._corrected(system, state, Limits(iterations=STEPS))
            turned = float(np.abs(turned_between(found.equations, found.state, state, near=True)).max(initial=0.0))
            if not found.converged or turned > STRIDE:
                drag *= MORE
                if drag > MOST_DRAG * max(deep, 1.0):
                    break
                continue
            state, acting, drag, part = found.state, system.acting, LESS * drag, ahead
            if turned < STILL and drag < DRAG and part == 1.0:
                break
        return self._without(state)

    def _begun(self, start: State) -> tuple[State, float]:
        """A state without contact as one of the model, and how far obstacles are to be drawn back, dimensionless."""
        state = self.run.carried(self.taken(start), self.prepared, rests=False)
        gaps = self.prepared.equations.at(state, self.loading).residual[self.gaps]
        return state, INSIDE * max(0.0, -float(gaps.min(initial=0.0)))

    def _drag(self, state: State, size: float) -> Drag:
        return self.run.drag(self.prepared, Solved.taken(self.prepared, state, self.loading), size)

    def _drawn_back(self, point: Point, by: float) -> Point:
        residual = point.residual.copy()
        residual[self.gaps] += by
        return replace(point, residual=residual)

    def _system(self, added: Callable[[State, Point], Point], acting: Array | None = None) -> OneSided:
        acting = np.zeros(len(self.gaps), bool) if acting is None else acting.copy()
        more: dict[str, Any] = {"drag": added, "pushing": self.gaps, "acting": acting}
        return OneSided(self.prepared.equations, self.loading, self.prepared.weight, **more)

    def _corrected(self, system: OneSided, near: State, limits: Limits) -> Solved:
        with np.errstate(over="ignore", invalid="ignore"):
            return Solved(self.prepared, *correct(system, near, limits=limits))

    def _without(self, state: State) -> State:
        return transferred(self.prepared.model, state, self.free.model)

    def _held(self, found: Solved, pushed: Array) -> tuple[Solved, Solved]:
        free = self.taken(self._without(found.state))
        if not pushed.any():
            return free, free
        points = [point for point, pushes in zip(self.points, pushed.tolist(), strict=True) if pushes]
        numbered = tuple(replace(point, number=i) for i, point in enumerate(points))
        prepared = self.run.prepare(replace(self.free.model.mesh, points=numbered))
        return free, Solved.taken(prepared, self.run.carried(found, prepared), self.way(prepared.model))


def stops_ends(pair: Pair) -> bool:
    """Whether what a member may touch stops ends of elements: an obstacle that is no edge."""
    return pair.stop is not None and not pair.edge


def brought_in(run: MemberContact, source: Solved, way: Way) -> Solved | None:
    """The equilibrium near to a state that may be inside of obstacles and members; None where none is found.

    These are drawn back by how deep it is inside, and come in step by step.
    """
    closest, mesh = run.closest, replace(source.model.mesh, points=())
    run.lines.keys, run.falls, run.patient = frozenset(), 0, False
    run.edges.begin(source.fields)
    within = [pair for pair in closest.pairs.values() if not pair.edge]
    deep = max((-near.gap for near in closest.found(source.fields, 0.0, within)), default=0.0)
    deep = INSIDE * deep if deep > run.tolerance else 0.0
    now, part, step, points = source, 0.0, 1.0, _resultants(run, source)
    if not points and not deep:
        points = tuple(map(begun, closest.found(source.fields, run.tolerance)))
    try:
        while part < 1.0:
            ahead, lines = min(1.0, part + step), run.lines.keys
            closest.draw_back(deep * (1.0 - ahead))
            points = tuple(replace(p, distance=closest.pairs[p.pair].distance) for p in points)
            there = run.resolved(mesh, points, now, way)
            if there is None and points and now is source:
                there = _held_back(run, mesh, points, now, way)
            if there is None or tangents_turned(now.fields, there.fields) > run.stride:
                step, run.lines.keys = 0.5 * step, lines
                if step < SHORTEST or not deep:
                    return None
                continue
            now, part, step = there, ahead, LONGER * step
            mesh, points = replace(now.model.mesh, points=()), points_of(now)
    finally:
        closest.draw_back(0.0)
    return now


def _held_back(run: MemberContact, mesh: Mesh, points: Points, now: Solved, way: Way) -> Solved | None:
    """What is near to a state, from where it comes to with drag: there it is known how hard and where points push."""
    there = run.resolved(mesh, points, now, way, HOLDING)
    return None if there is None else run.resolved(replace(there.model.mesh, points=()), points_of(there), there, way)


def _resultants(run: MemberContact, source: Solved) -> Points:
    """The ends of elements that are pushed; in place of two that follow each other the middle of their forces."""
    ends, mesh, fields = list[list[tuple[int, ContactPoint]]](), source.model.mesh, source.fields
    for point in sorted(points_of(source), key=lambda one: (one.pair, one.at)):
        cut = mesh.cut_at(point.members[0], point.at[0])
        follows = ends and ends[-1][-1][1].pair == point.pair and ends[-1][-1][0] == cut - 1
        ends[-1:] = [[*ends[-1], (cut, point)]] if follows else [*ends[-1:], [(cut, point)]]
    found = list[ContactPoint]()
    for group in ends:
        own = [point for _, point in group]
        if len(own) == 2:
            pushes = np.array([fields.contact_point(point)["push"] for point in own])
            at = float(pushes @ [point.at[0] for point in own] / pushes.sum())
            own = [replace(own[0], at=(at,))]
        found += [replace(p, normal=tuple(_normal(run, source, p).tolist()), new=True) for p in own]
    return tuple(found)


def _normal(run: MemberContact, source: Solved, point: ContactPoint) -> Array:
    """Direction (3,) in which an obstacle pushes at a place."""
    (near,) = run.closest.beside(source.fields, run.closest.pairs[point.pair], np.array(point.at), np.inf)
    return near.normal
