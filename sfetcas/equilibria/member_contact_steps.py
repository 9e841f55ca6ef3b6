"""Load steps of scenes in which members touch each other: the way to each, and its mesh."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .. import tolerances
from ..contact.held_inside import refuse_held_inside
from ..contact.lines import points_of
from ..contact.member_contact import FITS, MemberContact
from ..contact.passing import tangents_turned
from ..description.inserting import stops_between
from ..description.scene import Scene
from ..description.supports import along
from ..errors import LIMITS, SolveError, Status
from ..mathematics.arrays import unit
from ..mechanics.accuracy import roughness
from ..mechanics.loading import Loading
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model
from ..solvers.continuation import between
from ..solvers.guess import bends, least
from ..solvers.prepared import Prepared, Solved
from ..solvers.redundancy import loose_rows, redundant
from .force_balance import refuse_lost_forces
from .meshing import Meshing
from .refinement import LEVELS, MOST_ELEMENTS, Refinement
from .single import finished
from .solution import Equilibrium, refuse_large
from .ways import NO_ENERGY, Ways

__all__ = ["MemberContactSteps", "on_way", "undeformed"]

NEAR = 0.5
"""Rotation, rad, from mesh to mesh up to which a state is the same."""

SMALL = 1e-3
"""Share of the loads under which a mechanism falls to where members hold each other, which has no place without loads.
"""

SHARES = (1.0, 1e-2, 1e-4)
"""Shares of small loads: what is straight between ends that come nearer moves aside by the root of them, and shall not
yet touch.
"""

BENT_OFF, OFF, ASIDE = (1.0, 0.3, 0.1, 0.03, 0.01), 1.5, 0.5
"""Shares of loads under which straight members on obstacles are pushed together and come to rest beside these; by how
much they may be bent, rad, as beyond they may have swung through something; and by how much more at one end, as a hump
in the middle would be in balance between its two ways down.
"""

POINTED = 0.1
"""Rotation, over the accuracy, up to which a short line is taken for a point."""

LEFT = "left an equilibrium that is unstable on the fine mesh only"
"""A note."""


class MemberContactSteps:
    """The load steps of a scene in which members may touch each other, one after the other.

    Parameters
    ----------
    meshes, ways, refinement
        Of the scene, see :class:`~sfetcas.equilibria.statics.LoadSteps`.
    kept : bool
        Whether an equilibrium is not to be replaced by another one, as that to which an unstable one falls.
    """

    def __init__(self, meshes: Meshing, ways: Ways, refinement: Refinement, *, kept: bool = False) -> None:
        self.meshes, self.ways, self.refinement, self.scene = meshes, ways, refinement, meshes.scene
        self.run = MemberContact(self.scene, meshes.prepared, meshes.accuracy, meshes.fixed)
        self.run.leaves &= not kept
        self.kept = kept
        self.last: tuple[float, Solved] | None = None
        self.checked = False
        self.moved: set[float] = set()

    def answer(self, pilot: Prepared, factor: float) -> Equilibrium:
        """The equilibrium at a load factor.

        Raises
        ------
        SceneError, SolveError
            Members penetrate each other in the undeformed scene; no equilibrium was found.
        """
        refuse_held_inside(self.scene, pilot, factor)
        zero = undeformed(pilot)
        if not self.checked:
            self.run.redundant = redundant(pilot.equations, zero.point)
            self.run.refuse_penetrating(zero.fields)
            refuse_unheld(self.scene, pilot)
            self.checked = True
        if self.last is None:
            alone = self._alone(pilot, factor, zero)
            if alone is not None:
                return alone
        notes: tuple[str, ...] = () if pilot.model.conservative else (NO_ENERGY,)
        found, more = self._reached(pilot, factor, zero)
        self.last = (factor, found)
        return self.refined(found, factor, (*notes, *more))

    def _begun(self, pilot: Prepared, factor: float, zero: Solved) -> Solved | None:
        """Where a small share of the loads puts what has no place without loads; None where that is not near."""
        for share in SHARES:
            bent = self.ways.bent(pilot, share * factor)
            if bent is None:
                return None
            if tangents_turned(zero.fields, bent.fields) < NEAR and self.run.unstopped(zero, bent):
                return bent
        return None

    def _bent_off(self, pilot: Prepared, factor: float, zero: Solved) -> tuple[float, Solved] | None:
        """Factor and state at which straight members on obstacles that are pushed together come to rest, bent off these
        before; None where they are not pushed together, or not bent off.

        The share of the factor is the largest at which members need not turn far.  From zero they could be followed in
        the smallest steps only: their thrust begins there with infinity.
        """
        if self.scene.rubs or not (self.run.leaves and pilot.model.minimisable and pilot.lacks_slack):
            return None
        equations = pilot.equations
        loose = loose_rows(equations, zero.point)
        for share in BENT_OFF:
            way = on_way(0.0, share * factor, 1.0)
            loading = way(pilot.model)
            gaps = equations.at(zero.state, loading).residual[equations.unknowns :]
            if np.abs(loose.T @ gaps).max() <= tolerances.CLOSED:
                return None
            for aside in (ASIDE, 0.0):
                bent = [
                    Solved.taken(pilot, closed, loading)
                    for _, closed, gap in bends(equations, zero.state, loading, pilot.weight, aside)
                    if gap <= tolerances.REACHED
                ]
                off = [one for one in bent if self.run.near(zero, one, OFF) and self.run.clear(one.fields)]
                fallen = [self.run.relaxed(pilot.model.mesh, one, way) for one in off]
                rests = [one for one in fallen if one is not None]
                if rests:
                    # Humps at either end may have one energy: of these rounding must not choose.
                    return share * factor, least([(0.0, one.point.potential, one) for one in rests])[2]
        return None

    def _alone(self, pilot: Prepared, factor: float, zero: Solved) -> Equilibrium | None:
        """The answer in which nothing touches, where the growing loads lead there; else None."""
        # What has no place without loads is led past what it may touch from where it can have come to.
        loose = pilot.lacks_slack or pilot.diagnosis.mobility > 0
        bent = self._begun(pilot, factor, zero) if loose else None
        if loose and bent is None:
            return None
        if pilot.model.mesh.stops:
            # A stop that is held all along is where it is at once.
            held = pilot.correct(zero.state, zero.loading)
            if not (held.converged and self.run.unstopped(zero, held)):
                return None
        try:
            found = self.ways.grown_from_zero(pilot, factor, self.run.unstopped, bent)
        except SolveError as error:
            if error.status in LIMITS:
                raise
            return None
        if found is None or (self.meshes.switch_branch and found.stability.negative > 0):
            return None
        answer = self.refinement.refined(replace(found, way=("no contact",)))
        return answer if self.run.clear(answer.fields) else None

    def _reached(self, pilot: Prepared, factor: float, zero: Solved) -> tuple[Solved, tuple[str, ...]]:
        """The state that the loads lead to, from the last factor where that lies on the way, and notes on it."""
        # On its way all divides as what touches asks for: where lines end is then known on a mesh that is prescribed.
        self.run.hold(())
        begin, start = 0.0, self.run.lying(zero)
        last = self.last if self.last is not None and self.last[0] * (factor - self.last[0]) >= 0.0 else None
        ways = list[Callable[[], tuple[float, Solved] | None]]()
        if start is not zero:
            ways.append(partial(self._bent_off, pilot, factor, zero))
        if last is not None:
            begin, start = last
            # What was followed from where it was is followed on.
            ways.insert(len(ways) if last[0] == 0.0 else 0, lambda: (begin, start))
        else:
            ways.append(partial(self._growing, pilot, factor, start is zero, start))
        for way in ways:
            first = way()
            led = None if first is None else self._led(first[1], first[0], factor)
            if led is not None:
                return led
        return self._known(None), ()

    def _growing(self, pilot: Prepared, factor: float, apart: bool, start: Solved) -> tuple[float, Solved]:
        """The factor and the state from which loads grow, where obstacles are ``apart`` without loads, or not."""
        if pilot.model.standing or any(pilot.model.factors(0.0).values()):
            # What acts already without the factor.
            found = self.run.follow(lambda t: lambda model: model.loading(0.0, t), start)
            return 0.0, self._known(found)
        if (pilot.lacks_slack or pilot.diagnosis.mobility) and apart:
            bent = self._begun(pilot, factor, start)
            if bent is not None:
                return bent.factor, bent
            if pilot.diagnosis.mobility:
                begin = SMALL * factor
                found = self.run.relaxed(pilot.model.mesh, start, lambda model: model.loading(begin))
                return begin, self._known(found)
        return 0.0, start

    def _led(self, start: Solved, begin: float, factor: float) -> tuple[Solved, tuple[str, ...]] | None:
        """The state that the loads lead to from one at another factor, and notes on the way; None where it is lost."""
        notes: tuple[str, ...] = ()
        stops = stops_between(self.scene, begin, factor) if begin != factor else ()
        for a, b in itertools.pairwise(stops):
            there = self.run.follow(partial(on_way, a, b), start)
            if there is None:
                return None
            start, notes = there, notes + self.run.notes(a, b)
        return start, notes

    def _known(self, found: Solved | None) -> Solved:
        if found is None:
            contacts = self.scene.contacts
            what = "each other" if any(one.between_members for one in contacts.values()) else "obstacles"
            detail = f"the loads growing from zero could not be followed while members touch {what}"
            raise SolveError(Status.FAILED, f"{detail}: {', '.join(f'contacts.{name}' for name in contacts)}")
        return found

    # -- accuracy -------------------------------------------------------------------------------

    def refined(self, found: Solved, factor: float, notes: tuple[str, ...]) -> Equilibrium:
        """The answer on a mesh that is fine enough for the accuracy.

        Raises
        ------
        SolveError
            What touches is not found on finer meshes, or forces are lost.
        """
        target, accuracy = self.meshes.target, self.meshes.accuracy
        self.run.hold(self.meshes.fixed)
        now = found
        if self.meshes.fixed:
            now = self._onto(self.run.lines.fitted(target, points_of(now), prescribed=True)[0], now, factor)
        elif now.model.mesh.order != target.order:
            now = self._onto(replace(now.model.mesh, order=target.order), now, factor)
        smooth, error, run = np.sqrt(accuracy), np.inf, self.run
        for _ in range(LEVELS):
            # Elsewhere than at ends of elements forces on them would be taken for roughness.
            now = self._fitted(now, factor)
            rough, model = roughness(now.fields) > smooth, now.model
            ends = run.lines.rough_ends(now, accuracy)
            fine = {n: long & (n not in self.meshes.fixed) for n, long in run.lines.long(now).items()}
            marks = {n: (rough[model.elements_of(n)] | ends[n]) & fine[n] for n in model.members}
            if any(marked.any() for marked in marks.values()):
                if model.mesh.elements > MOST_ELEMENTS:
                    break
                now = self._onto(model.mesh.refined(marks, now.fields.kinks), now, factor)
                continue
            now = self._fitted(now, factor)
            if not self.meshes.prescribed:
                now = run.as_lines(now, lambda model: model.loading(factor), POINTED * accuracy) or now
            marks = run.lines.long(now)
            if self.meshes.prescribed:
                marks = {name: np.ones(len(long), bool) for name, long in marks.items()}
            else:
                # What is straight by what it lies on is so on any mesh.
                straight = run.lines.straight(now)
                marks = {name: long & ~straight[name] for name, long in marks.items()}
            finer = self._onto(now.model.mesh.refined(marks, now.fields.kinks), now, factor)
            difference, error = self.meshes.judged(now, finer)
            if self.meshes.prescribed:
                error += difference
                break
            now = finer
            # What members penetrate each other by is an error of positions too.
            error = max(error, run.penetration(now.fields) / self.scene.size)
            if error <= accuracy:
                now = self._fitted(now, factor, FITS)
                break
            smooth *= 0.1
        refuse_large(now.fields)
        if run.unstable(now, lambda model: model.loading(factor)) and LEFT not in notes:
            rest = run.fallen(replace(now.model.mesh, points=()), now, lambda model: model.loading(factor))
            if rest is not None:
                return self.refined(rest, factor, (*notes, LEFT))
        if factor in self.moved and LEFT not in notes:
            notes = (*notes, LEFT)
        stability = run.rolling(now, lambda model: model.loading(factor)).stability
        more: dict[str, Any] = {"error_estimate": error, "error_of": self.meshes.error_of}
        answer = finished(now, stability, notes=notes, way=("in contact",), **more)
        refuse_lost_forces(answer)
        return answer

    def _fitted(self, now: Solved, factor: float, times: int = 1) -> Solved:
        """The state with elements that end where points slide; as far as that is found."""
        return self.run.fitted(now, lambda model: model.loading(factor), times, prescribed=self.meshes.prescribed)

    def _onto(self, mesh: Mesh, found: Solved, factor: float) -> Solved:
        """The same state on another mesh.

        Raises
        ------
        SolveError
            It is not found there.
        """
        mesh, run = replace(mesh, points=()), self.run
        there = run.resolved(mesh, run.lines.points_on(mesh, found), found, lambda model: model.loading(factor))
        if there is None or tangents_turned(found.fields, there.fields) > NEAR:
            there = None if self.kept else run.relaxed(mesh, found, lambda model: model.loading(factor))
            if there is not None and tangents_turned(found.fields, there.fields) > NEAR:
                self.moved.add(factor)
        if there is None:
            detail = "what touches on a coarse mesh was not found on a finer one"
            raise SolveError(Status.FAILED, detail, found.state)
        return there


def refuse_unheld(scene: Scene, pilot: Prepared) -> None:
    """Refuse a scene that neither supports nor planes without friction hold in some direction.

    Raises
    ------
    SolveError
        There is one; the message names the direction.
    """
    stops, axes = scene.obstacles, pilot.model.element.axes
    free = np.array(pilot.diagnosis.drifts).reshape(-1, axes)
    if not len(free) or scene.rubs or not stops or any(stop.kind != "flat" for stop in stops.values()):
        return
    nowhere = np.zeros((1, 3))
    normals = np.array([stop.normals(nowhere, nowhere)[0][:axes] for stop in stops.values()])
    _, sizes, ways = np.linalg.svd(free @ normals.T @ normals @ free.T)
    for way in ways[sizes < tolerances.PARALLEL**2]:
        names = ", ".join(f"contacts.{name}" for name in scene.contacts)
        detail = f"nothing holds it along {along(unit(way @ free))}, as {names} only pushes across it"
        raise SolveError(Status.FAILED, detail)


def undeformed(pilot: Prepared) -> Solved:
    """The undeformed scene as a state."""
    nothing = pilot.model.loading(0.0, 0.0)
    state = pilot.equations.start(nothing)
    return Solved.taken(pilot, state, nothing)


def on_way(begin: float, end: float, part: float) -> Callable[[Model], Loading]:
    """The loading of a model on the way from one factor to another."""
    return lambda model: between(model, begin, end)(part)
