"""Penalty contact: a first state in contact, from which the touches are read.

Penalty forces (*cushions*) at many places of the members grow smoothly as the gap closes, so that the loads can be
followed from zero as without obstacles.  The cushions are then made thin and stiff; the places where they push become
touches and stretches.  That state is no answer but the start for the equilibrium with inequality constraints (see
:mod:`~sfetcas.contact.touching`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..description.obstacles import members_of, swept, takes_part
from ..description.scene import Scene
from ..errors import SolveError
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from ..mechanics.mesh import Cushion, Mesh, Touch
from ..mechanics.model import Model
from ..solvers.continuation import between, follow
from ..solvers.newton import descend
from ..solvers.prepared import Prepared, Solved
from .settling import Held
from .touches import Touched

__all__ = ["Cushioned", "Cushions"]

PLACES, LEAST, MOST = 48, 12, 64
"""Numbers of elements: along the longest member, fewest and most along any; a cushion stands at each of their ends."""

FINENESS = 0.25
"""Largest distance of cushions, share of the radius of an obstacle."""

ORDER = 3
"""Order of the elements."""

THICKEST, THINNEST = 3e-3, 3e-7
"""First and last thickness of the cushions, share of the size of the scene."""

SHRINK, LEAST_SHRINK = 0.1, 0.8
"""Ratio of the thickness from stage to stage, and the ratio at which making cushions thinner is given up."""

PUSHED = 1e-3
"""Force of a cushion from which its place counts as touching, share of the largest."""

NEARLY = 0.9
"""Share of the force on a run of places from which the force on its end node counts as all of it."""

UNPRESSED = 1e-6
"""Force assigned to places that lie on a round obstacle without pressure, share of the largest."""

NEARBY = 0.5
"""Largest rotation, rad, between states on thicker and thinner cushions that count as the same."""

REACH = 30.0
"""Gap over the thickness of a cushion from which its force is negligible."""

FALLS, FALL = 60, (4, 0.1)
"""Largest number of rounds of a fall; steps of each, after which passing of obstacles is checked, and their rad."""

FAR = 1e3
"""Displacement, in lengths of the scene, beyond which a structure has fallen past all obstacles."""

BEGIN = 0.01
"""Share of the loads under which the first state of a mechanism is computed, which has none without loads."""


@dataclass(frozen=True)
class Cushioned:
    """A state of penalty contact, without touches, and the touches that are read from it."""

    held: Held
    touches: tuple[Touch, ...]


class Cushions:
    """Penalty contact for the obstacles of one scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    sides : mapping of (contact, member) to float
        The allowed side of each edge, see :func:`~sfetcas.contact.touches.edge_sides`.

    Attributes
    ----------
    obstacles : mapping of str to Obstacle
    left : list of float
        Factors at which the last search left an unstable state.
    """

    def __init__(
        self, scene: Scene, prepare: Callable[[Mesh], Prepared], sides: Mapping[tuple[str, str], float]
    ) -> None:
        self.scene, self.prepare, self.sides = scene, prepare, sides
        self.obstacles = scene.obstacles
        self.left: list[float] = []
        self._parts: tuple[float, ...] = ()

    # -- the state ------------------------------------------------------------------------------

    def found(self, base: Mesh, factors: Sequence[float]) -> Cushioned | None:
        """The state of penalty contact followed through load factors, and its touches; None if it is lost."""
        self.left = []
        mesh, loading = self._divided(base), lambda model: model.loading(factors[-1])
        # What is free to move without obstacles; cushions themselves count as springs.
        bare = self.prepare(base)
        falls = bool(bare.diagnosis.mobility) or bare.lacks_slack
        prepared = self.prepare(self._cushioned(mesh, THICKEST, loading))
        found = self._grown(prepared, factors, falls) or self._direct(prepared, factors[-1])
        if found is None:
            return None
        cushioned, rolled = self._thinned(mesh, found, loading)
        self.left += [factors[-1]] if rolled else []
        return cushioned

    def _thinned(self, mesh: Mesh, found: Solved, loading: Callable[[Model], Loading]) -> tuple[Cushioned, bool]:
        """The state on thin cushions, and whether it was left there as unstable."""
        thickness, shrink, rolled = THICKEST, SHRINK, False
        while thickness > 1.01 * THINNEST and shrink < LEAST_SHRINK:
            trial = max(shrink * thickness, THINNEST)
            stiffer = self.prepare(self._cushioned(mesh, trial, loading))
            there = self._settled(stiffer, found.state, loading(stiffer.model))
            if there is None:
                shrink = np.sqrt(shrink)
                continue
            # What soft cushions hold thin ones may not: it rolls away over them, which what touches at places cannot.
            away = self._rolled(there)
            found, thickness, rolled = away, trial, rolled or away is not there
        held = Held(found)
        return Cushioned(held, self._touches(held)), rolled

    def _grown(self, prepared: Prepared, factors: Sequence[float], falls: bool) -> Solved | None:
        """Loads growing through the factors from the undeformed scene."""
        model = prepared.model
        state, first = prepared.equations.start(model.loading(0.0, 0.0)), factors[0]
        if falls:
            first = factors[0] + BEGIN * (factors[1] - factors[0])
            begun = self._fallen(prepared, first)
            if begun is None:
                return None
            state = begun.state
        elif self.scene.histories:
            began = self._followed(prepared, lambda t: model.loading(factors[0], t), state)
            if began is None:
                return None
            state = began
        for a, b in zip((first, *factors[1:]), factors[1:], strict=False):
            reached = self._followed(prepared, between(model, a, b), state)
            if reached is None:
                return None
            self.left += [a + part * (b - a) for part in self._parts]
            state = reached
        return self._settled(prepared, state, model.loading(factors[-1]))

    def _followed(self, prepared: Prepared, way: Callable[[float], Loading], state: State) -> State | None:
        switch_branch = self.scene.analysis.unstable == "leave" and prepared.model.minimisable

        def allowed(before: Solved, after: Solved) -> bool:
            return self._passes(prepared, before.state, after.state, after.loading, before.loading)

        result = follow(prepared, way, state, switch_branch=switch_branch, allowed=allowed)
        self._parts = result.left
        return result.state if result.reached else None

    def _passes(
        self, prepared: Prepared, before: State, after: State, loading: Loading, at: Loading | None = None
    ) -> bool:
        """Whether no member runs over an obstacle from one state, ``at`` another loading if so, to the next."""
        states = (before, loading if at is None else at), (after, loading)
        courses = [self._courses(prepared, state, loading) for state, loading in states]
        return not any(
            swept(stop, courses[0][member], courses[1][member])
            for name, stop in self.obstacles.items()
            for member in members_of(self.scene.contacts[name], self.scene.members)
        )

    def _courses(self, prepared: Prepared, state: State, loading: Loading) -> dict[str, Array]:
        touched = Touched(prepared.equations, state, loading)
        return {name: touched.course(name) for name in prepared.model.members}

    def _fallen(self, prepared: Prepared, factor: float) -> Solved | None:
        """Downhill from the undeformed scene in short steps, to where obstacles and supports hold what falls."""
        if not prepared.model.minimisable:
            return None
        loading = prepared.model.loading(factor)
        state = prepared.equations.start(loading)
        for _ in range(FALLS):
            # What falls past everything overflows within a few steps.
            with np.errstate(over="ignore", invalid="ignore"):
                lower = descend(prepared.equations, state, loading, prepared.weight, iterations=FALL[0], most=FALL[1])
            if not np.abs(lower.y).max(initial=0.0) <= FAR or not self._passes(prepared, state, lower, loading):
                return None
            near = prepared.distance(state, lower) < FALL[1]
            state = lower
            if near:
                break
        return self._settled(prepared, state, loading)

    def _direct(self, prepared: Prepared, factor: float) -> Solved | None:
        """Downhill from the start guess."""
        model, loading = prepared.model, prepared.model.loading(factor)
        if not prepared.model.minimisable:
            return None
        try:
            state, gap = prepared.guess(loading)
            found = prepared.minimise(loading, state)[0] if gap < 0.2 else None
        except SolveError:
            return None
        start = prepared.equations.start(model.loading(0.0, 0.0))
        return found if found is not None and self._passes(prepared, start, found.state, loading) else None

    def _rolled(self, found: Solved) -> Solved:
        """Where an unstable state goes to, if that is not over an obstacle; else the state."""
        prepared, loading = found.prepared, found.loading
        switch_branch = self.scene.analysis.unstable == "leave" and prepared.model.minimisable
        if not switch_branch or not found.negative:
            return found
        try:
            there = prepared.switch_branch(found, loading)
        except SolveError:
            return found
        return there if self._passes(prepared, found.state, there.state, loading) else found

    def _settled(self, prepared: Prepared, state: State, loading: Loading) -> Solved | None:
        """The equilibrium near a state; downhill from there where Newton's method does not find it, if not far."""

        def near(found: Solved) -> bool:
            there = found.state
            return prepared.distance(state, there) < NEARBY and self._passes(prepared, state, there, loading)

        # The first step may be long: what lies on soft cushions turns over with little resistance.
        found = prepared.correct(state, loading, iterations=25, most=0.8)
        if found.converged and near(found):
            return found
        try:
            found = prepared.minimise(loading, state)[0]
        except SolveError:
            return None
        return found if near(found) else None

    # -- where cushions stand -------------------------------------------------------------------

    def _divided(self, base: Mesh) -> Mesh:
        """A mesh as fine as cushions have to be, with the borders of the one given."""
        lines = {name: self.scene.center_lines[name] for name in base.cuts}
        longest = max(line.length for line in lines.values())
        radii = [stop.radius for stop in self.obstacles.values() if stop.kind == "round"]
        cuts = {}
        for name, old in base.cuts.items():
            count = max(LEAST, PLACES * lines[name].length / longest)
            count = max(count, *(lines[name].length / (FINENESS * radius) for radius in radii), 0.0)
            each = np.ceil(np.diff(old) * min(count, MOST)).astype(int)
            parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(old, old[1:], each, strict=False)]
            cuts[name] = np.append(np.concatenate(parts), 1.0)
        return replace(base, order=ORDER, cuts=cuts, touches=())

    def _cushioned(self, mesh: Mesh, thickness: float, loading: Callable[[Model], Loading]) -> Mesh:
        """The mesh with its cushions."""
        bare = self.prepare(mesh).model
        thick = thickness * self.scene.size
        stiffness = self._largest_force(loading(bare)) * bare.scales.force / thick
        found: list[Cushion] = []
        for contact in self.obstacles:
            seen: set[str] = set()
            for member in members_of(self.scene.contacts[contact], self.scene.members):
                cuts, record = mesh.cuts[member], self.scene.members[member]
                edge = float(np.diff(cuts).max()) * self.scene.center_lines[member].length
                for at in cuts.tolist():
                    node = record.node_at(at)
                    if node and (node in seen or not self._takes_part(node, contact)):
                        continue
                    seen |= {node} if node else set()
                    found.append(Cushion(contact, member, at, stiffness, thick, edge))
        return replace(mesh, cushions=tuple(found))

    def _takes_part(self, node: str, contact: str) -> bool:
        return takes_part(node, self.scene.nodes[node], self.scene.motions.values(), self.obstacles[contact])

    @staticmethod
    def _largest_force(loading: Loading) -> float:
        """Size of the forces that obstacles may have to take, dimensionless."""
        loads = float(np.linalg.norm(loading.force.sum(axis=0))), float(np.abs(loading.force).max(initial=0.0))
        return max(1.0, *loads, float(np.abs(loading.moment).max(initial=0.0)))

    # -- what touches ---------------------------------------------------------------------------

    def _touches(self, held: Held) -> tuple[Touch, ...]:
        """Runs of places that are pushed."""
        touched = held.touched
        pushes = {c: self._push(touched, c) for c in held.mesh.cushions}
        largest = max(pushes.values(), default=0.0)
        found: list[Touch] = []
        for contact, stop in self.obstacles.items():
            pushed = {c: push for c, push in pushes.items() if c.contact == contact and push > PUSHED * largest}
            if stop.kind == "sharp":
                found += self._on_edge(held, contact, {c.member for c in pushed})
                continue
            runs = [
                run
                for member in members_of(self.scene.contacts[contact], self.scene.members)
                for run in self._runs(held, contact, member, pushed)
            ]
            members = self.scene.members
            lying = {members[run.member].node_at(x) for run in runs if run.to is not None for x in run.places}
            # A place beside a node counts the push on the node too: the farthest from it stands for all of them.
            beside = [(run, *self._beside(held, run)) for run in runs]
            for run, near, _ in sorted(beside, key=lambda entry: -entry[2]):
                if run.to is None and near is not None and near in lying:
                    continue
                lying |= {near} if run.to is None and near else set()
                found.append(replace(run, way=self._way(touched, run)))
        return tuple(found)

    def _beside(self, held: Held, touch: Touch) -> tuple[str | None, float]:
        """The node within one element of a place, and how far it is, m."""
        member, cuts = self.scene.members[touch.member], held.mesh.cuts[touch.member]
        length = self.scene.center_lines[touch.member].length
        if member.type != "rigid" and touch.at <= cuts[1]:
            return member.nodes[0], touch.at * length
        if member.type != "rigid" and touch.at >= cuts[-2]:
            return member.nodes[-1], (1.0 - touch.at) * length
        return member.node_at(touch.at), 0.0

    def _runs(self, held: Held, contact: str, member: str, pushed: Mapping[Cushion, float]) -> Iterator[Touch]:
        """Places of a member next to each other that are pushed; a node counts for each member that ends there.

        An end that a support holds on the obstacle has no cushion, and goes with what is beside it.
        """
        at_nodes = {self.scene.members[c.member].node_at(c.at): push for c, push in pushed.items()}
        inner = {c.at: push for c, push in pushed.items() if c.member == member}
        cuts = held.mesh.cuts[member]
        nodes = self.scene.members[member].nodes
        push = np.array([inner.get(x, 0.0) for x in cuts.tolist()])
        push[0], push[-1] = at_nodes.get(nodes[0], 0.0), at_nodes.get(nodes[-1], 0.0)
        reach = REACH * max((c.thickness for c in pushed), default=0.0)
        for i, beside in ((0, 1), (-1, -2)):
            gap = held.touched.gaps(contact, member, cuts[[i]], 0.0)[0]
            if not self._takes_part(nodes[i], contact) and push[beside] > 0.0 and gap < reach:
                push[i] = push[beside]
        if self.obstacles[contact].kind == "round":
            # Along something round a member may lie without pressure between the ends of the stretch.
            near = held.touched.gaps(contact, member, cuts, 0.0) < reach
            first, last = np.flatnonzero(push > 0.0)[[0, -1]] if push.any() else (0, 0)
            if near[first : last + 1].all():
                push[first : last + 1] = np.maximum(push[first : last + 1], push.max() * UNPRESSED)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], push > 0.0, [False]]).astype(int)))
        for number, (a, b) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
            if self.scene.members[member].type == "rigid":
                yield from self._of_rigid(contact, member, cuts[a:b], push[a:b])
            elif b - a <= 2:
                most = float(cuts[a:b][np.argmax(push[a:b])])
                at = float(np.average(cuts[a:b], weights=push[a:b]))
                # Nearly all on a node is on the node.
                on_node = most in (0.0, 1.0) and push[a:b].max() > NEARLY * push[a:b].sum()
                yield Touch(contact, member, most if on_node else at, number=number)
            else:
                yield Touch(contact, member, float(cuts[a]), float(cuts[b - 1]), number=number)

    def _of_rigid(self, contact: str, member: str, x: Array, push: Array) -> Iterator[Touch]:
        """A rigid member touches where it is pushed most, or at both ends of the run where it is straight."""
        line = self.scene.center_lines[member]
        straight = line.turning == 0.0 and self.obstacles[contact].kind == "flat"
        if not straight:
            yield Touch(contact, member, float(x[np.argmax(push)]))
            return
        spacing = float(np.diff(x).max(initial=0.0))
        ends = [e for e in (0.0, 1.0) if np.abs(x - e).min() <= spacing]
        yield from (Touch(contact, member, e, number=int(e)) for e in ends)

    def _on_edge(self, held: Held, contact: str, members: set[str]) -> list[Touch]:
        """The place that is nearest to an edge, of the members that it pushes."""
        touched, found = held.touched, []
        for member in members:
            way = self.sides[contact, member]
            for x in touched.passing(contact, member):
                gap = float(touched.gaps(contact, member, np.array([x]), 0.0, way)[0])
                found.append((abs(gap), Touch(contact, member, x, way=way)))
        return [min(found, key=lambda pair: pair[0])[1]] if found else []

    def _push(self, touched: Touched, cushion: Cushion) -> float:
        """Force of a cushion, N; zero where it only reaches a place from afar."""
        gap = float(touched.gaps(cushion.contact, cushion.member, np.array([cushion.at]), 0.0)[0])
        if self.obstacles[cushion.contact].kind == "sharp":
            x = np.array([cushion.at])
            out = touched.fields.positions(cushion.member, x)[0] - self.obstacles[cushion.contact].place
            gap = float(np.linalg.norm(self.obstacles[cushion.contact].across @ out)) - cushion.edge
        if gap > REACH * cushion.thickness:
            return 0.0
        root = float(np.hypot(gap, cushion.thickness))
        depth = 0.5 * (root - gap)
        return cushion.stiffness * depth**2 / root

    @staticmethod
    def _way(touched: Touched, touch: Touch) -> float:
        """To which side something round bends what lies on it."""
        x = np.array([touch.at])
        stop = touched.obstacles[touch.contact]
        point, tangent = touched.fields.positions(touch.member, x)[0], touched.fields.tangents(touch.member, x)[0]
        return float(np.sign(stop.curvature(point, tangent))) or 1.0
