"""Load steps of scenes with friction where members touch: the whole sequence of steps again and again, more finely.

What slides depends on all that was before, so that no step can be solved by itself, or refined by itself.  The sequence
is followed from the undeformed scene on one mesh with steps of one length, then on halved elements with steps of half
the length, until two sequences agree.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from ..contact.held_inside import refuse_held_inside
from ..contact.member_contact import MemberContact
from ..contact.pairs import PairKey
from ..description.inserting import stops_between
from ..errors import SolveError, Status
from ..mechanics.fields import Fields
from ..mechanics.mesh import Mesh
from ..solvers.prepared import Prepared, Solved
from ..solvers.redundancy import redundant
from .force_balance import refuse_lost_forces
from .member_contact_steps import on_way, undeformed
from .meshing import Meshing
from .refinement import MOST_ELEMENTS
from .single import finished
from .solution import Equilibrium, refuse_large

__all__ = ["RoughContactSteps", "lost_while"]

LEVELS = 6
"""Sequences at most."""

ROUGHLY = 1e-4
"""Least accuracy that the first sequence takes, a tenth of it in each further one: what lies along something round on a
coarse mesh cannot but be inside of it somewhere.
"""

NEARLY = 0.99
"""Share of the limit of friction from which on what touches is said to be about to slide."""

FINER = "a finer sequence of steps, which the accuracy asks for, was lost"
"""The begin of a note."""

ORDER_MATTERS = "with friction: what slides depends on the order of the steps"
"""A note."""


@dataclass
class _Sequence:
    """The states of steps, one after the other.

    Attributes
    ----------
    run : MemberContact
    steps : sequence of float
        The factors.
    found : list of Solved
    last_steps : list
        What :attr:`.MemberContact.last_step` is at each.
    notes : list of tuple of str
    """

    run: MemberContact
    steps: Sequence[float]
    found: list[Solved] = field(default_factory=list)
    last_steps: list[tuple[Fields | None, frozenset[PairKey]]] = field(default_factory=list)
    notes: list[tuple[str, ...]] = field(default_factory=list)

    @functools.cached_property
    def ended(self) -> list[Solved]:
        """The states with the places where lines end for unknowns, where that is found."""
        each = zip(self.found, self.steps, self.last_steps, strict=True)
        return [self.run.ended(found, on_way(factor, factor, 1.0), last) for found, factor, last in each]


class RoughContactSteps:
    """The load steps of a scene with friction where members touch.

    Parameters
    ----------
    meshes : Meshing
        Of the scene.
    """

    def __init__(self, meshes: Meshing) -> None:
        self.meshes, self.scene = meshes, meshes.scene
        self.failed: tuple[float, list[Equilibrium]] = (0.0, [])
        self._done = 0

    def answers(self, pilot: Prepared) -> list[Equilibrium]:
        """The equilibria of all steps.

        Raises
        ------
        SceneError, SolveError
            Members penetrate each other in the undeformed scene; a step has no equilibrium that could be found,
            ``failed`` says which, and has those of the steps before.
        """
        steps = self.scene.analysis.steps
        try:
            return self._answers(pilot, steps)
        except SolveError:
            factor, before = self.failed[0], steps[: self._done]
            if before:
                # They are what they are without the steps after them.
                with contextlib.suppress(SolveError):
                    self.failed = (factor, self._answers(pilot, before))
                self.failed = (factor, self.failed[1])
            raise

    def _answers(self, pilot: Prepared, steps: Sequence[float]) -> list[Equilibrium]:
        target = self.meshes.target
        mesh = target if self.meshes.fixed else replace(pilot.model.mesh, order=target.order)
        before: _Sequence | None = None
        judged: tuple[Sequence[Solved], Sequence[float], Sequence[tuple[str, ...]]] | None = None
        for level in range(LEVELS):
            try:
                now = self._sequence(mesh, level, steps)
            except SolveError as error:
                if judged is None:
                    raise
                # Two sequences that agree by less are an answer as well, though not to the accuracy.
                self.failed, lost = (0.0, []), f"{FINER}: {error.detail}"
                judged = (*judged[:2], [(*notes, lost) for notes in judged[2]])
                break
            if before is not None:
                errors = self._errors(now.run, before.found, now.found)
                kept = before.found if self.meshes.prescribed else now.found
                if not self.meshes.prescribed and max(errors) > self.meshes.accuracy:
                    # Where lines end is solved for only where the accuracy needs it.
                    kept, errors = now.ended, self._errors(now.run, before.ended, now.ended)
                judged, large = (kept, errors, now.notes), now.found[-1].model.mesh.elements > MOST_ELEMENTS
                if self.meshes.prescribed or max(errors) <= self.meshes.accuracy or large:
                    break
            before, mesh = now, mesh.refined()
        assert judged is not None
        return [self._answer(*each) for each in zip(*judged, strict=True)]

    def _errors(self, run: MemberContact, coarse: Sequence[Solved], fine: Sequence[Solved]) -> list[float]:
        """Estimated errors of states: of first order where what slides is decided, so that what is left is not less
        than what the halving changed; and how deep members are in what they touch.
        """
        judged = (self.meshes.judged(a, b) for a, b in zip(coarse, fine, strict=True))
        deep = (run.penetration(one.fields) / self.scene.size for one in fine)
        return [max(*pair, depth) for pair, depth in zip(judged, deep, strict=True)]

    def _sequence(self, mesh: Mesh, level: int, steps: Sequence[float]) -> _Sequence:
        """The states of steps, followed from the undeformed scene."""
        accuracy = max(self.meshes.accuracy, ROUGHLY * 0.1**level)
        run = MemberContact(self.scene, self.meshes.prepared, accuracy, self.meshes.fixed)
        run.stride, run.first = run.stride * 0.5**level, run.first * 0.5**level
        run.rough, run.lines.finer = run.rough * 0.1**level, 0.5**level
        prepared = self.meshes.prepared(mesh)
        zero = undeformed(prepared)
        run.redundant = redundant(prepared.equations, zero.point)
        run.refuse_penetrating(zero.fields)
        now, last = run.lying(zero), 0.0
        sequence = _Sequence(run, steps)
        self.failed, self._done = (0.0, []), 0
        if self.scene.histories:
            now = self._known(run, run.follow(lambda t: lambda model: model.loading(0.0, t), now), 0.0, 0.0)
        for self._done, factor in enumerate(steps):
            self.failed = (factor, [])
            refuse_held_inside(self.scene, prepared, factor)
            told: tuple[str, ...] = (ORDER_MATTERS,)
            for a, b in itertools.pairwise(stops_between(self.scene, last, factor)):
                now = self._known(run, run.follow(partial(on_way, a, b), now), a, b)
                told += run.notes(a, b)
            sequence.found.append(now)
            sequence.last_steps.append(run.last_step)
            sequence.notes.append(told)
            last = factor
        return sequence

    def _known(self, run: MemberContact, found: Solved | None, begin: float, end: float) -> Solved:
        """The state at the end of a way.

        Raises
        ------
        SolveError
            There is none; the message says how far it was followed, and whether all is about to slide there.
        """
        if found is not None:
            return found
        reached = begin + run.reached.part * (end - begin)
        raise SolveError(Status.FAILED, f"the loads were followed to the factor {reached:.5g}, {lost_while(run)}")

    def _answer(self, found: Solved, error: float, notes: tuple[str, ...]) -> Equilibrium:
        refuse_large(found.fields)
        answer = finished(
            found,
            found.stability,
            notes=notes,
            way=("in contact",),
            error_estimate=error,
            error_of=self.meshes.error_of,
        )
        refuse_lost_forces(answer)
        return answer


def lost_while(run: MemberContact) -> str:
    """Where a way with friction was lost: whether all that touched was about to slide, and on what."""
    last = run.reached.solved
    grips = [(point.grip, last.fields.contact_point(point)) for point in last.model.mesh.points if point.grip]
    slides = bool(grips) and all(told["rubs"] >= NEARLY * grip.coefficient * told["push"] for grip, told in grips)
    what = "where all that touches is about to slide" if slides else "and no further while members touch"
    what = "where friction locks what is driven on" if run.jammed else what
    return f"{what}: {', '.join(f'contacts.{name}' for name in run.scene.contacts)}"
