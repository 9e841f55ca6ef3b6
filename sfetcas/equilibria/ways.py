"""Strategies to find an equilibrium on the pilot mesh, in their order: IPOPT at full load, or growing the loads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..description.records import counted
from ..errors import LIMITS, SolveError, Status
from ..mechanics.equations import State
from ..mechanics.laws import law_of
from ..mechanics.loading import Loading
from ..mechanics.magnetism import where_fields_end
from ..solvers.continuation import CONTRACTION, JUMPED, between, follow, near_factor
from ..solvers.deflation import nearest
from ..solvers.prepared import BEYOND, Prepared, Solved
from ..solvers.redundancy import loose_rows
from ..solvers.sharing import SHARED
from .meshing import PILOT_ELEMENTS, EquilibriumResult, Meshing
from .single import cold
from .solution import refuse_large

__all__ = ["KEPT", "NO_ENERGY", "NO_POTENTIAL", "WAYS", "Ways"]

KEPT = "the loads growing from zero lead to this unstable equilibrium, and no way from it to a stable one was found"

PASSED = (
    "the loads growing from zero lead here through unstable equilibria, from which no way to a stable one was found"
)

NO_ENERGY = "loads without potential: no energy tells whether this is stable"

NO_POTENTIAL = (
    f"{NO_ENERGY}; the static tangent is regular all the way from zero load, and flutter would only show in dynamics"
)

DIVERGED = (
    f"{NO_ENERGY}; real eigenvalues of the static tangent are below zero: it was singular on the way from zero load, "
    "and other equilibria branch off there, which a path shows"
)

CARRIED = (
    "the loads could not be followed from zero; this is where the whole of them carries the undeformed state, "
    "and there may be others"
)

NEAREST = (
    "the loads could not be followed from zero; this is the minimum nearest to the start guess, and there may be others"
)

TAUT = (
    "straight between places that come no closer, where an inextensible member cannot bend and takes any force; "
    "let one end slide"
)

CRITICAL = (
    "the loads are beyond the critical ones of straight members, which would have to stretch to bend between places "
    f"that come no closer; {SHARED}"
)

SMALL_SHARES = 0.01, 0.03, 0.1
"""Of the loads, one after the other until one puts what has no place of its own somewhere: from there they grow.

Beside the stiffness of beams the smallest is the least well conditioned.
"""

STRAIGHT = 1e-6
"""Rotations below this, rad, are rounding of members that loads along them leave straight: others bend or diverge."""

IN_LINE = 1e-3
"""Share of the largest singular value of the closings below which links are in one line, but for rounding and steps."""

CHANGE_POINT = (
    "driven links begin in one line, or nearly: from such a change point they may go on in two ways, and this is one; "
    "begin away from it, or choose by start places of nodes"
)


WAYS = {
    "growing": "the loads grow from zero, or from those of the step before",
    "small share": "a small share of the loads puts what has no place without them; from there they grow",
    "minimum": "IPOPT from a start guess under the whole loads",
    "afar": "Newton's method from afar under the whole loads, where it is asked for",
    "beside": "Newton's method beside start places of nodes",
    "carried": "the whole loads carry the undeformed state downhill",
    "left": "an unstable equilibrium is left along its unstable mode",
    "finer": "one of these on a pilot mesh with a quarter of the element lengths",
    "search": "a search or a scan for all equilibria, which deflates those that are known",
    "refound": "IPOPT again on a finer mesh, where Newton's method did not converge",
    "no contact": "the loads grow from zero, or a minimum is found, past no obstacle",
    "in contact": "loads and touches grow from zero, or from those of the step before",
}
"""The ways to an equilibrium, in the words of ``Equilibrium.way``; in which order they
are tried say :meth:`Ways.result` and :meth:`Ways.on_pilot`."""


Allowed = Callable[[Solved, Solved], bool]
"""Whether a step may be taken: from one equilibrium to the next."""


class Ways:
    """The solution strategies on the pilot mesh, tried one after the other.

    Parameters
    ----------
    meshes : Meshing
        The scene with its settings and meshes.
    """

    def __init__(self, meshes: Meshing) -> None:
        self.meshes, self.scene = meshes, meshes.scene
        self.started = meshes.scene.started
        # Where loads turn the stiffness of laws with memory jumps: corrections may grow once, whatever the step.
        self._contraction = np.inf if meshes.scene.remembers else CONTRACTION

    # -- the order ------------------------------------------------------------------------------------

    def result(self, pilot: Prepared, factor: float, last: tuple[float, EquilibriumResult] | None) -> EquilibriumResult:
        """The equilibrium on the pilot mesh, or on one with elements a quarter as long where the pilot mesh has none.

        Parameters
        ----------
        factor : float
            Factor of the loads.
        last : (factor, EquilibriumResult) or None
            The load step before.

        Raises
        ------
        SolveError
            No strategy finds an equilibrium.
        """
        try:
            return _with_change_point(self.on_pilot(pilot, factor, last))
        except SolveError as error:
            finer = self._finer(pilot, error)
            if finer is None:
                raise
            try:
                return _with_change_point(_by("finer", self.on_pilot(finer, factor, None)))
            except SolveError:
                raise error from None

    def on_pilot(
        self, pilot: Prepared, factor: float, last: tuple[float, EquilibriumResult] | None
    ) -> EquilibriumResult:
        """The equilibrium on the pilot mesh; parameters and errors as of :meth:`result`.

        It is the one that the loads lead to as they grow from zero.  It is a minimum of the energy under the full loads
        where growing loads cannot be followed, where the branch does not matter, or where start positions choose it.
        """
        loading = pilot.model.loading(factor)
        if not pilot.model.minimisable:
            return self._without_minimum(pilot, factor, last)
        grows = self.meshes.settings.branch and not self.started
        # Where small members bend beyond sense on the way of the loads, nothing else is tried.
        grown = self._grown(pilot, factor, last) if grows and self.scene.limited_on_ways else None
        alone, failure = self._direct(pilot, loading)
        if not grows:
            return self._accepted(alone, failure)
        if not self.scene.limited_on_ways:
            grown = self._grown(pilot, factor, last)
        if grown is not None:
            return self._beside(grown, alone)
        zero = self._unloaded(pilot)
        straight = alone is None or pilot.distance(alone.solved.state, zero) < STRAIGHT
        if straight and pilot.lacks_slack and self._stays(pilot, zero, factor):
            raise SolveError(Status.FAILED, CRITICAL, zero)
        found = self._accepted(alone, failure)
        return replace(found, notes=(NEAREST, *found.notes))

    def _without_minimum(
        self, pilot: Prepared, factor: float, last: tuple[float, EquilibriumResult] | None
    ) -> EquilibriumResult:
        """Loads that cannot be minimised: the state that they lead to from zero, stable or not."""
        found = self._onward(pilot, factor, last)
        ways = [self._carried, self.grown_from_zero]
        # A mechanism has no place of its own without loads: growing from zero they put it anywhere, also upside down.
        for way in ways if pilot.diagnosis.mobility else ways[::-1]:
            found = found or way(pilot, factor)
        if found is None:
            detail = "the loads could not be followed from zero, and without a potential there is no other way"
            raise SolveError(Status.FAILED, detail)
        if not pilot.model.conservative:
            diverged = found.solved.diverged
            regular = diverged == 0 and CARRIED not in found.notes
            note = NO_POTENTIAL if regular else DIVERGED if diverged else NO_ENERGY
            found = replace(found, notes=(*found.notes, note))
        return found

    def _finer(self, pilot: Prepared, error: SolveError) -> Prepared | None:
        """A pilot with a quarter of the element lengths, where that may have what this one has not."""
        if pilot.model.mesh.elements > PILOT_ELEMENTS or self.meshes.fixed or pilot.diagnosis.mobility:
            return None
        # What falls on and on does so on a finer mesh too; one that is too coarse is left by other ways.
        if error.status in (Status.ITERATIONS, *LIMITS):
            return None
        mesh = pilot.model.mesh.refined().refined()
        return None if mesh.elements == pilot.model.mesh.elements else self.meshes.prepared(mesh)

    @staticmethod
    def _beside(grown: EquilibriumResult, alone: EquilibriumResult | None) -> EquilibriumResult:
        """What the loads lead to, with a note where another minimum is nearer to the start guess."""
        if alone is None:
            return grown
        pilot = grown.solved.prepared
        apart = pilot.distance(alone.solved.state, grown.solved.state) > 1e-3
        # What falls from its start guess is nearest to no minimum.
        restrained = pilot.diagnosis.mobility == 0
        notable = restrained and alone.solved.multipliers <= BEYOND and not grown.notes
        notes = grown.notes
        if notable and apart and alone.stability.negative == 0:
            notes += ("the loads growing from zero lead here, not to the minimum nearest to the start guess",)
        return replace(grown, iterations=alone.iterations, notes=notes)

    def named(self, pilot: Prepared, error: SolveError) -> SolveError:
        """The error with the names of unrestrained mechanisms and of members without slack, and hints of laws."""
        try:
            free, taut = pilot.diagnosis, pilot.lacks_slack
        except np.linalg.LinAlgError:
            return error
        details = [f"free to move: {free.described(3)}"] if free.mobility else []
        details += [error.detail] if error.detail else []
        if taut and error.status not in (Status.INFEASIBLE, Status.STRETCHED):
            rows = ", ".join(dict.fromkeys(free.redundant))
            details.append(f"{TAUT}: {rows}")
        details += [] if error.status in LIMITS else where_fields_end(pilot.model.scene)
        if error.status in (Status.FAILED, Status.ITERATIONS):
            laws = (law_of(pilot.model.scene, name) for name in pilot.model.members)
            details += dict.fromkeys(law.hint for law in laws if law is not None and law.hint)
        return SolveError(error.status, "; ".join(details), error.last)

    # -- single ways ----------------------------------------------------------------------------------

    def _direct(self, pilot: Prepared, loading: Loading) -> tuple[EquilibriumResult | None, SolveError | None]:
        """From the start guess at the full load."""
        near = nearest(pilot, loading) if self.started and not self.meshes.switch_branch else None
        if near is not None:
            return EquilibriumResult(near, way=("beside",)), None
        try:
            solved, iterations, way = cold(pilot, loading, self.meshes.settings.solver)
        except SolveError as error:
            return None, error
        return EquilibriumResult(solved, iterations=iterations, way=(way,)), None

    def _carried(self, pilot: Prepared, factor: float) -> EquilibriumResult | None:
        """Where the loads carry the undeformed state: slack has no place of its own from which to follow them.

        A small share of them first, as they grow; then all of them, which is one of the equilibria.
        """
        # Each step of these needs the eigenvalues.
        if self.scene.histories or not pilot.countable:
            return None
        zero = pilot.equations.start(pilot.model.loading(0.0, 0.0))
        for share, notes in ((SMALL_SHARES[0], ()), (1.0, (CARRIED,))):
            begin = share * factor
            there = pilot.downhill(zero, pilot.model.loading(begin))
            if there is None:
                continue
            found = self._followed(pilot, between(pilot.model, begin, factor), there.state, (begin, factor))
            if found is not None:
                way = "carried" if notes else "small share"
                return replace(found, notes=(*notes, *found.notes), way=(way, *found.way[1:]))
        return None

    def _accepted(self, alone: EquilibriumResult | None, failure: SolveError | None) -> EquilibriumResult:
        """What IPOPT found, an unstable state left if that is wanted."""
        if alone is None:
            assert failure is not None
            raise failure
        if alone.stability.negative == 0 or not self.meshes.switch_branch:
            return alone
        solved = alone.solved.prepared.switch_branch(alone.solved, alone.solved.loading)
        ways = counted(alone.stability.negative, "way out", "ways out")
        note = f"left an unstable equilibrium with {ways} along its unstable mode"
        return _by("left", EquilibriumResult(solved, notes=(note,), iterations=alone.iterations, way=alone.way))

    def _grown(
        self, pilot: Prepared, factor: float, last: tuple[float, EquilibriumResult] | None
    ) -> EquilibriumResult | None:
        """The state that the loads lead to from zero, or from the last factor where that lies on the way."""
        return self._onward(pilot, factor, last) or self.grown_from_zero(pilot, factor)

    def _onward(
        self, pilot: Prepared, factor: float, last: tuple[float, EquilibriumResult] | None
    ) -> EquilibriumResult | None:
        """The state that the loads lead to from the last factor, where that lies on the way from zero."""
        if last is None or last[0] * (factor - last[0]) < 0.0:
            return None
        return self._through(pilot, last[0], factor, last[1].solved.state)

    def grown_from_zero(
        self, pilot: Prepared, factor: float, allowed: Allowed | None = None, bent: Solved | None = None
    ) -> EquilibriumResult | None:
        """The state that the loads lead to from zero, by steps that ``allowed`` accepts; None where that fails.

        What has no place of its own without loads begins at ``bent``, by default at that of :meth:`bent`.
        """
        model = pilot.model
        zero = self._unloaded(pilot)
        if pilot.lacks_slack:
            # Straight members without slack: what acts along them alone leaves them straight, else they have to bend.
            if self._stays(pilot, zero, factor):
                found = self._through(pilot, 0.0, factor, zero, allowed)
                # What cannot bend leaves for a whole turn within one element, which only its mesh lets pass.
                return None if found is None or found.solved.multipliers > BEYOND else found
            return None if self.scene.histories else self._grown_from_bent(pilot, factor, allowed, bent)
        if pilot.model.minimisable and pilot.diagnosis.mobility and not self.scene.histories:
            # A mechanism has no place of its own without loads: the way begins where a small share of them puts it.
            return self._grown_from_bent(pilot, factor, allowed, bent)
        if model.loaded_at_zero:
            # Then the way leads through the factors, after the loads of factor 0 have grown.
            first = self._followed(pilot, lambda t: model.loading(0.0, t), zero, None, allowed)
            if first is None or factor == 0.0:
                return first
            zero = first.solved.state
        return self._through(pilot, 0.0, factor, zero, allowed)

    @staticmethod
    def _unloaded(pilot: Prepared) -> State:
        return pilot.equations.start(pilot.model.loading(0.0, 0.0))

    def _stays(self, pilot: Prepared, zero: State, factor: float) -> bool:
        """Whether straight members carry the loads all the way without bending: where they do not move at the end."""
        if pilot.model.loaded_at_zero or self.scene.histories:
            return False
        there = pilot.correct(zero, pilot.model.loading(factor))
        return there.converged and pilot.distance(there.state, zero) < STRAIGHT

    def grown_from(self, pilot: Prepared, begin: float, end: float, state: State) -> EquilibriumResult | None:
        """The state that the loads lead to from one factor, where ``state`` is an equilibrium, to another."""
        return self._through(pilot, begin, end, state)

    def _through(
        self, pilot: Prepared, begin: float, end: float, state: State, allowed: Allowed | None = None
    ) -> EquilibriumResult | None:
        """Follow from one factor to another, stopping where a history has a knot: no step jumps over one."""
        low, high = min(begin, end), max(begin, end)
        knots = {t for history in self.scene.histories.values() for t in history.knots if low < t < high}
        stops = [begin, *sorted(knots, reverse=end < begin), end]
        straight = all(history.interpolation == "linear" for history in self.scene.histories.values())
        found: EquilibriumResult | None = None
        for a, b in zip(stops, stops[1:], strict=False):
            part = self._followed(pilot, between(pilot.model, a, b), state, (a, b), allowed, proportional=straight)
            if part is None:
                return None
            found, state = replace(part, notes=(*(found.notes if found else ()), *part.notes)), part.solved.state
        return found

    def _grown_from_bent(
        self, pilot: Prepared, factor: float, allowed: Allowed | None, bent: Solved | None
    ) -> EquilibriumResult | None:
        """As :meth:`grown_from_zero`, from where a small share of the loads moves the structure to."""
        bent = bent or self.bent(pilot, factor)
        if bent is None:
            return None
        begin, state = bent.factor, bent.state
        found = self._followed(pilot, between(pilot.model, begin, factor), state, (begin, factor), allowed)
        return None if found is None else replace(found, way=("small share", *found.way[1:]))

    def bent(self, pilot: Prepared, factor: float) -> Solved | None:
        """The state to which a small share of a load factor moves what has no place of its own without loads."""
        # Without a potential each share is reached in many steps: only the first is tried.
        for share in SMALL_SHARES if pilot.model.minimisable else SMALL_SHARES[:1]:
            bent, _ = self._direct(pilot, pilot.model.loading(share * factor))
            if bent is not None:
                break
        if bent is None:
            return None
        if bent.stability.negative and self.meshes.switch_branch:
            try:
                return pilot.switch_branch(bent.solved, bent.solved.loading)
            except SolveError:
                return None
        return bent.solved

    def _followed(
        self,
        pilot: Prepared,
        way: Callable[[float], Loading],
        state: State,
        factors: tuple[float, float] | None,
        allowed: Allowed | None = None,
        *,
        proportional: bool | None = None,
    ) -> EquilibriumResult | None:
        """Where a way leads, from one factor to another or, with None, through the loads of factor 0."""
        switch_branch, energy_known = self.meshes.switch_branch and pilot.switches_branch, pilot.model.minimisable

        def refuse(there: Solved) -> None:
            refuse_large(there.fields)

        more: dict[str, Any] = {"allowed": allowed, "contraction": self._contraction, "proportional": proportional}
        if self.scene.limited_on_ways:
            more["refuse"] = refuse
        result = follow(pilot, way, state, switch_branch=switch_branch, **more)
        passed = not result.reached and switch_branch and not energy_known
        if passed:
            # What cannot be minimised has this one way: better an unstable state that says so than none.
            result = follow(pilot, way, state, switch_branch=False, **more)
        if not result.reached:
            return None
        solved = pilot.correct(result.state, way(1.0))
        notes = tuple(f"jumped {_at(part, factors)}: {JUMPED}" for part in result.left)
        if not energy_known and self.meshes.switch_branch and solved.stability.negative:
            notes += (KEPT,)
        elif passed:
            notes += (PASSED,)
        return EquilibriumResult(solved, notes=notes, way=("growing", *("left",) * bool(result.left)))


def _by(way: str, found: EquilibriumResult) -> EquilibriumResult:
    """The same, with a further way that it took."""
    return replace(found, way=(*found.way, way))


def _with_change_point(found: EquilibriumResult) -> EquilibriumResult:
    """The same, with a note where driven links begin in one line, or as good as that."""
    if not any(motion.rotation is not None for motion in found.solved.model.scene.motions.values()):
        return found
    equations, nothing = found.solved.equations, found.solved.model.loading(0.0, 0.0)
    begin = loose_rows(equations, equations.at(equations.start(nothing), nothing), IN_LINE)
    if begin.shape[-1] <= loose_rows(equations, found.solved.point, IN_LINE).shape[-1]:
        return found
    return replace(found, notes=(*found.notes, CHANGE_POINT))


def _at(part: float, factors: tuple[float, float] | None) -> str:
    """Where on a way something was, in words; parts of the way are known to a few percent of them."""
    if factors is None:
        return f"near {100.0 * part:.2g} % of the loads of factor 0"
    begin, end = factors
    return near_factor(begin + part * (end - begin))
