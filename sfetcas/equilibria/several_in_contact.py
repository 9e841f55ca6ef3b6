"""All equilibria of a load step where members may touch obstacles and each other.

The search is that of :mod:`~sfetcas.equilibria.several`, in which obstacles stop the ends of elements, see
:mod:`~sfetcas.contact.stopped_ends`: each run may end at an equilibrium that touches nothing or at one that touches.
What it finds is the start from which it is found what touches really, between ends of elements, edges and other members
too; then it is refined as a single answer is, but kept where it is unstable.
"""

from __future__ import annotations

import contextlib
import weakref
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ..contact.lines import points_of
from ..contact.member_contact import MemberContact, Way
from ..contact.pairs import PairKey
from ..contact.stopped_ends import StoppedEnds, brought_in, stops_ends
from ..description.records import counted
from ..errors import SceneError, SolveError
from ..mathematics.arrays import Array
from ..mechanics.accuracy import largest_difference
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.loading import Loading
from ..mechanics.mesh import Mesh
from ..mechanics.model import Model
from ..solvers.prepared import Solved
from .further import refuse_unsearched
from .member_contact_steps import MemberContactSteps
from .meshing import EquilibriumResult, Meshing
from .mirrors import mirrored, mirrors
from .refinement import LEVELS, Refinement
from .several import Search, Waiting, long_elements, same, wound
from .single import solved_from
from .solution import Equilibrium
from .ways import Ways

__all__ = ["SeveralInContact"]

RUNS, FEWEST_RUNS, EFFORT = 60, 30, 6_000
"""As of :mod:`~sfetcas.equilibria.several`: each run costs some times as much as one without contact."""

FREE = 40
"""Runs without contact at most, of which what is found is brought in."""

ENDS, LONGEST = 8, 1.0
"""Elements at least of members that obstacles may touch, and length of these over the radius of what is round, at most,
as far as the mesh of a search is refined.
"""

MOST, MOST_ELEMENTS = 16, 48
"""Parts into which a member is divided at most, and elements of the mesh of a search, for contact."""

ALIKE = 2e-3
"""Difference of positions, over the size, up to which rough equilibria with as many unstable modes are one."""

LASTING = 1e-9
"""Share of the loads up to which a push is rounding."""

FALLS = 6
"""Unstable equilibria whose ways downhill are followed in contact, at most, where ends of elements are not all that may
touch.
"""


KINDS = ("given", "brought in", "mirrored", "downhill", "bent", "half-way", "nudged", "farther")
"""Kinds of starts in the order of what they bring for their cost (measured): deflated runs cost most."""


@dataclass(eq=False)
class SearchInContact(Search):
    """A search in which obstacles stop the ends of elements; attributes besides those of the class:

    Attributes
    ----------
    ends : StoppedEnds
    alone : int
        Number of runs without contact before.
    """

    ends: StoppedEnds = field(kw_only=True)
    alone: int = 0
    waiting: Waiting = field(default_factory=lambda: {kind: deque() for kind in KINDS})
    _held: weakref.WeakKeyDictionary[Solved, Solved] = field(default_factory=weakref.WeakKeyDictionary)

    @property
    def before(self) -> str:
        """What was done before, in words."""
        return f"after {self.alone} without contact"

    def held(self, found: Solved) -> Solved:
        """The same with ends of elements that are pushed as rows."""
        return self._held.get(found, found)

    def _downhill(self, found: Solved, shape: Array) -> State:
        deep = max(-self.held(found).stability.smallest, 0.0)
        return self.ends.downhill(self.moved(found.state, shape), deep)

    def go_on(self) -> bool:
        """As of :meth:`.Search.go_on`, past states far from rest whose stability has no answer."""
        try:
            return super().go_on()
        except SolveError:
            return True

    def _arrived(self, start: State, known: Sequence[State]) -> Solved | None:
        found = self.ends.arrived(start, known)
        if found is None:
            return None
        free, self._held[found[0]] = found
        return free


@dataclass(frozen=True, eq=False)
class Rough:
    """An equilibrium that the search found.

    Attributes
    ----------
    found : Solved
    lines : frozenset
        Contacts and members that touch along lines.
    notes : tuple of str
    """

    found: Solved
    lines: frozenset[PairKey]
    notes: tuple[str, ...]


class SeveralInContact:
    """The search for all equilibria of the load steps of a scene with contact.

    Parameters
    ----------
    meshes, ways, refinement
        Of the scene, see :class:`~sfetcas.equilibria.statics.LoadSteps`.
    model : Model
        On the pilot mesh.

    Raises
    ------
    SceneError
        As of :class:`~sfetcas.equilibria.further.FurtherEquilibria`.
    """

    def __init__(self, meshes: Meshing, ways: Ways, refinement: Refinement, model: Model) -> None:
        refuse_unsearched(meshes, model)
        self.meshes, self.refinement, self.scene = meshes, refinement, meshes.scene
        self.steps = MemberContactSteps(meshes, ways, refinement, kept=True)
        self.run = self.steps.run
        self.others: list[Solved] = []

    def answers(self, answer: Equilibrium, single: MemberContact) -> list[Equilibrium]:
        """The answer with a note about the search, then the further equilibria of its load factor by rising energy.

        ``single`` is the search for what touches that found the answer.
        """
        self.run.redundant = single.redundant
        first = Rough(solved_from(answer), single.lines.keys if answer.model.mesh.points else frozenset(), ())

        def way(model: Model) -> Loading:
            return model.loading(first.found.factor)

        result = self._searched(first.found, way)
        rough = self._brought_in(result, first, way)
        self.others = [one.found for one in rough]
        answers, dropped = [answer], 0
        for one in rough[1:]:
            further = self._further(one)
            if further is None:
                dropped += 1
            elif not any(same(further, other) for other in answers):
                answers.append(further)
        note = result.sentence()
        if dropped:
            note += f"; {counted(dropped, 'equilibrium', 'equilibria')} of coarse meshes not found on finer ones"
        answers[0] = replace(answer, notes=(*answer.notes, note))
        return [answers[0], *sorted(answers[1:], key=lambda other: other.potential)]

    # -- on the mesh of the search -------------------------------------------------------------------

    def _searched(self, first: Solved, way: Way) -> SearchInContact:
        free = self.meshes.prepared(self._mesh(first))
        ends = StoppedEnds(self.run, free, way)
        begun = [transferred(one.model, one.state, free.model) for one in (first, *self.others)]
        runs = self.meshes.settings.runs
        if runs is None:
            effort = max(1, free.equations.unknowns * (2 if free.model.space else 1))
            runs = max(FEWEST_RUNS, min(RUNS, EFFORT // effort))
        images, loading = mirrors(free.model), way(free.model)
        result = SearchInContact(free, loading, runs, images, ends=ends)
        if not free.equations.rotation_unknowns:
            return result
        result.offer("given", *(partial(result.closed, state) for state in begun), deflate=False)
        alone = Search(free, loading, min(FREE, runs), images)
        alone.look()
        result.alone = alone.total
        for one in alone.found:
            starts = (partial(result.closed, one.state), partial(ends.downhill, one.state))
            result.offer("brought in", *starts, deflate=False)
        result.look()
        return result

    def _mesh(self, first: Solved) -> Mesh:
        """Elements so short that their ends may stand for what touches, and for what is strongly curled."""
        mesh = self.meshes.pilot_mesh
        shortest: dict[str, float] = {}
        for pair in filter(stops_ends, self.run.closest.pairs.values()):
            (member,), length = pair.members, self.run.closest.lengths[pair.members[0]]
            if self.run.lines.bends(member):
                shortest[member] = min(shortest.get(member, length / ENDS), max(LONGEST * pair.turn, length / MOST))
        while mesh.elements < MOST_ELEMENTS:
            marks = {name: np.zeros(len(cuts) - 1, bool) for name, cuts in mesh.cuts.items()}
            for name, longest in shortest.items():
                marks[name] = np.diff(mesh.cuts[name]) * self.run.closest.lengths[name] > longest
            if not any(marked.any() for marked in marks.values()):
                break
            mesh = mesh.refined(marks)
        for _ in range(LEVELS):
            prepared = self.meshes.prepared(mesh)
            state = transferred(first.model, first.state, prepared.model)
            loading = prepared.model.loading(first.factor)
            marks = long_elements(Solved.taken(prepared, state, loading))
            if not any(marked.any() for marked in marks.values()):
                break
            mesh = mesh.refined(marks)
        return mesh

    # -- what touches --------------------------------------------------------------------------------

    def _brought_in(self, result: SearchInContact, first: Rough, way: Way) -> list[Rough]:
        """The first, and what the search found with what really touches, each once, with mirror images and what lies
        downhill.
        """
        run, rough = self.run, [first]

        def add(found: Solved | None, notes: tuple[str, ...] = ()) -> None:
            # What only just touches is an equilibrium without contact.
            if found is None or (found.model.mesh.points and not pushed(found)):
                return
            with contextlib.suppress(SolveError):
                if not any(alike(found, other.found) for other in rough):
                    rough.append(Rough(found, run.lines.keys, notes))

        for number, found in enumerate(result.found):
            add(brought_in(run, result.held(found), way), result.family_note(number))
        # The search itself goes downhill where ends of elements are all that may touch.
        falls = 0 if all(map(stops_ends, run.closest.pairs.values())) else FALLS
        for one in rough:
            for image in self._images(result, one.found, rough):
                add(brought_in(run, image, way))
            for side in (1, -1) if falls and one.found.negative else ():
                falls -= side > 0
                self._at(one)
                add(run.fallen(replace(one.found.model.mesh, points=()), one.found, way, side))
        return rough

    @staticmethod
    def _images(result: SearchInContact, found: Solved, known: Sequence[Rough]) -> Iterator[Solved]:
        """Mirror images that are none of the known ones, which may become more, and have as much energy: with what ends
        of elements touch there and, where that is not enough, without.
        """
        free = result.prepared
        state = transferred(found.model, found.state, free.model)
        energy = Solved.taken(free, state, result.loading).point.potential
        for image in result.images:
            there = Solved.taken(free, result.closed(mirrored(free.model, state, image)), result.loading)
            # Displacements that are unknowns, which an image has not, are found with what touches.
            level = len(free.model.positions.unknowns) > 0
            level |= abs(there.point.potential - energy) <= ALIKE * max(abs(energy), there.point.strain)
            arrived = None
            if level and not any(beside(there, other.found) for other in known):
                arrived = result.ends.arrived(there.state, ())
                yield there if arrived is None else arrived[1]
            if arrived is not None and not any(beside(there, other.found) for other in known):
                yield there

    def _at(self, one: Rough) -> None:
        """Begin at what the search found: see lines and sides of edges as they are there."""
        self.run.lines.keys, self.run.falls = one.lines, 0
        self.run.edges.begin(one.found.fields)

    def _further(self, one: Rough) -> Equilibrium | None:
        """The answer to what the search found; None where finer meshes do not have it."""
        found = one.found
        try:
            if found.model.mesh.points:
                self._at(one)
                answer = self.steps.refined(found, found.factor, one.notes)
                answer = replace(answer, way=("search", *answer.way))
            else:
                free = EquilibriumResult(found, notes=one.notes, kept=True, way=("search", "no contact"))
                answer = self.refinement.refined(free)
                if not self.run.clear(answer.fields):
                    return None
        except (SolveError, SceneError):
            return None
        short = (answer.certificate.error_estimate or 0.0) > self.meshes.accuracy
        return None if short and not self.meshes.prescribed else answer


def pushed(found: Solved) -> bool:
    """Whether something pushes by more than rounding."""
    forces = (found.fields.contact_point(point)["push"] for point in found.model.mesh.points)
    return max(forces) > LASTING * found.model.scales.force * max(1.0, found.prepared.load_size)


def alike(one: Solved, other: Solved) -> bool:
    """Whether two rough equilibria are one."""
    if one.negative != other.negative or {p.pair for p in points_of(one)} != {p.pair for p in points_of(other)}:
        return False
    return beside(one, other)


def beside(one: Solved, other: Solved) -> bool:
    """Whether two states are in the same places, with springs wound up by the same turns."""
    return largest_difference(one.fields, other.fields) < ALIKE and not wound(one.point.strain, other.point.strain)
