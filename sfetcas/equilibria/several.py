"""A search for further equilibria under the same loads.

Newton runs, with and without deflation (see :mod:`~sfetcas.solvers.deflation`), begin at the undeformed scene, at its
lowest shapes, at known equilibria nudged along their lowest shapes, mirrored, or half-way to each other.  From each
unstable equilibrium the energy falls to both sides of its unstable mode: what lies down there is found as well, as
is what larger and reversed loads lead to when they come back.  What the search does not find may still exist: it
counts what it did, and says so.
"""

from __future__ import annotations

import functools
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from .. import tolerances
from ..description.records import counted
from ..mathematics.arrays import TINY, Array
from ..mechanics.accuracy import largest_difference
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from ..solvers.between_states import free_parts, turned_between
from ..solvers.continuation import follow
from ..solvers.deflation import deflated
from ..solvers.guess import restore
from ..solvers.newton import descend
from ..solvers.prepared import Prepared, Solved
from .mirrors import Mirror, mirrored, mirrors
from .solution import Equilibrium

__all__ = ["Search", "Waiting", "alike", "long_elements", "missing", "same", "search", "wound"]

RUNS, FEWEST_RUNS, EFFORT = 300, 60, 40_000
"""Newton runs at most by default, fewer (but some) where runs times unknowns, twice in space, are more."""

SHAPES = 4
"""Lowest shapes, of each equilibrium and of the undeformed scene, along which states are moved."""

NUDGE, FARTHER_NUDGE = 0.5, 1.5
"""Largest rotation of a nudge, rad, and of one when all else was tried."""

BENT = (2.0, -2.0, 4.0, -4.0, 6.5, -6.5)
"""Largest rotations of the shapes of the undeformed scene that a run begins with, rad."""

SHARES, FARTHER = (0.1, 0.3162), 3.162
"""Shares of the loads at which the search begins, since fewer equilibria are easier to find, and their ratio."""

KINK = 1.3
"""A larger rotation from node to node within an element, rad, is an artefact of the mesh."""

LARGE = 700
"""From this many unknowns on all eigenvalues cost more than they bring: nudges along the unstable mode alone."""

FAMILY = "one of a continuous family of neutral equilibria with the same energy, of which no other is listed"

LAYERS = 1.2
"""Longest element of the search in ``sqrt(EI / force)``, within which a beam turns over."""

MOST_ELEMENTS = 80
"""The mesh of the search is not refined beyond this."""

DOWN = 0.3
"""Largest rotation of the step off an unstable equilibrium, to where the energy falls, rad."""

DESCENT = 60
"""Steps downhill at most."""

BEYOND = (3.162, 10.0, -1.0, -10.0)
"""Shares of the loads from which states come back: larger ones snap, reversed ones snap to the other side."""

WOUND = 0.05
"""Share of elastic energies by which those differ that whole turns are in: errors of places make far less."""

KINDS = ("carried", "returned", "given", "mirrored", "downhill", "nudged", "bent", "half-way", "farther")
"""Kinds of starts in the order of what they bring for their cost (measured)."""


Waiting = dict[str, deque[tuple[Callable[[], State], bool]]]
"""For each kind the starts still to be tried, with deflation or without."""


@dataclass(eq=False)
class Search:
    """A search for several equilibria under the same loads, with its results and its statistics.

    Attributes
    ----------
    found : list of Solved
        Distinct equilibria; the first is the one that the search was given.
    counts : dict
        Number of Newton runs for each kind of start.
    deflated, arrived : int
        Number of runs with deflation, and of runs that converged, to a new equilibrium or a known one.
    family : set of int
        Indices in ``found`` of the equilibria that stand for a continuous family.
    exhausted : bool
        Whether the permitted number of runs was used up before all starts were tried.
    smaller : int
        Number of runs under smaller loads before.
    waiting : dict
        Starts still to be tried, for each kind.
    """

    prepared: Prepared
    loading: Loading
    runs: int
    images: tuple[Mirror, ...]
    found: list[Solved] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    deflated: int = 0
    arrived: int = 0
    family: set[int] = field(default_factory=set)
    exhausted: bool = False
    smaller: int = 0
    waiting: Waiting = field(default_factory=lambda: {kind: deque() for kind in KINDS})

    def sentence(self) -> str:
        """A sentence on what the search did, for the notes of the answer."""
        kinds = ", ".join(f"{n} {kind}" for kind, n in self.counts.items())
        end = "stopped at its largest number of runs" if self.exhausted else "went through all its starts"
        return (
            f"searched by {counted(self.total, 'Newton run')}, {self.deflated} of them deflated ({kinds}), of which "
            f"{self.arrived} arrived, {self.before}; the search {end}; there may be more equilibria"
        )

    @property
    def before(self) -> str:
        """What was done before, in words."""
        return f"after {self.smaller} under smaller loads"

    def family_note(self, number: int) -> tuple[str, ...]:
        """Notes for an equilibrium that stands for a continuous family; empty for others."""
        return (FAMILY,) if number in self.family else ()

    def missing(self, answers: Sequence[Equilibrium]) -> str:
        """What is said of equilibria that were not found, as :func:`missing`."""
        return missing(answers)

    # -- one run --------------------------------------------------------------------------------

    def run(self, kind: str, start: State, *, deflate: bool) -> bool:
        """Run Newton's method from a start, with or without deflation; True where it finds a new equilibrium."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        self.deflated += deflate
        there = self._arrived(start, [f.state for f in self.found] if deflate else ())
        if there is None:
            return False
        self.arrived += 1
        if self._known(there.state) or self._kinked(there.state) or self._in_family(there):
            return False
        self.found.append(there)
        return True

    def _arrived(self, start: State, known: Sequence[State]) -> Solved | None:
        """Where a run from a start leads that is kept away from known states; None where it does not converge."""
        there = deflated(self.prepared, start, self.loading, known)
        return there and self._unwrapped_back(there)

    def held(self, found: Solved) -> Solved:
        """The same with all that holds it as rows, for its stability: here itself."""
        return found

    def _unwrapped_back(self, there: Solved) -> Solved:
        """The same without whole turns of parts that nothing holds."""
        turns = there.state.q.copy()
        parts = () if self.prepared.model.space else free_parts(self.prepared.model)
        for part in parts:
            turns[part] -= 2.0 * np.pi * np.round(turns[part].mean() / (2.0 * np.pi))
        if np.array_equal(turns, there.state.q):
            return there
        return self.prepared.correct(replace(there.state, q=turns), self.loading)

    def _known(self, state: State) -> bool:
        equations = self.prepared.equations
        return any(
            np.abs(turned_between(equations, state, f.state)).max(initial=0.0) <= tolerances.SAME_STATE
            for f in self.found
        )

    def _kinked(self, state: State) -> bool:
        q = state.q[self.prepared.model.rotations.turns]
        if self.prepared.model.space:
            cosine = np.abs((q[:, 1:] * q[:, :-1]).sum(axis=-1))
            return bool((cosine < np.cos(0.5 * KINK)).any())
        return bool((np.abs(np.diff(q[..., 0], axis=1)) > KINK).any())

    def _in_family(self, there: Solved) -> bool:
        """Whether an equilibrium is a neighbour of a known one in all but a neutral direction."""
        if not self._neutral(there):
            return False
        for i, other in enumerate(self.found):
            size = max(abs(other.point.strain), abs(other.point.potential), 1e-12)
            near = abs(there.point.potential - other.point.potential) <= tolerances.LEVEL * size
            if (
                near
                and abs(there.point.strain - other.point.strain) <= tolerances.LEVEL * size
                and self._neutral(other)
            ):
                self.family.add(i)
                return True
        return False

    def _neutral(self, there: Solved) -> bool:
        there = self.held(there)
        if self.prepared.equations.rotation_unknowns > LARGE:
            return there.stability.stable == "neutral"
        return bool((there.spectrum(0)[0] == 0.0).any())

    # -- starts ---------------------------------------------------------------------------------

    @functools.cached_property
    def begin(self) -> State:
        """The undeformed state, corrected so that prescribed displacements and constraints are met."""
        return self.closed(self.prepared.equations.start(self.loading))

    def closed(self, state: State) -> State:
        """A state corrected so that prescribed displacements and constraints are met."""
        equations = self.prepared.equations
        state = equations.holding(state, self.loading)
        if not equations.rows:
            return state
        lam = state.lam
        return replace(restore(equations, state, self.loading, self.prepared.weight)[0], lam=lam)

    def moved(self, state: State, shape: Array) -> State:
        """A state displaced along a shape (rotation unknowns,), rad, then corrected to meet the constraints."""
        step = np.zeros(self.prepared.equations.total)
        step[: len(shape)] = shape
        return self.closed(self.prepared.equations.moved(state, step))

    def _mirrored(self, state: State, image: Mirror) -> State:
        return self.closed(mirrored(self.prepared.model, state, image))

    def _downhill(self, found: Solved, shape: Array) -> State:
        """Where the energy falls to from an unstable equilibrium moved along a shape."""
        equations, begin = self.prepared.equations, self.moved(found.state, shape)
        return descend(equations, begin, self.loading, self.prepared.weight, iterations=DESCENT)

    def _shapes(self, found: Solved, count: int) -> Array:
        found = self.held(found)
        if self.prepared.equations.rotation_unknowns > LARGE:
            return found.stability.shape[None, :]
        return found.spectrum(count)[1]

    def offer(self, kind: str, *starts: Callable[[], State], deflate: bool) -> None:
        """Add starts of a kind to the queue; each is a function that makes the state when its turn comes."""
        self.waiting[kind].extend((start, deflate) for start in starts)

    def offer_bent(self) -> None:
        """Add starts: the undeformed state displaced along its softest modes."""
        unloaded = self.loading.scaled(0.0)
        rest = self.prepared.correct(self.prepared.equations.start(unloaded), unloaded, iterations=0)
        shapes = self._shapes(rest, SHAPES)
        starts = [partial(self.moved, self.begin, size * shape) for size in BENT for shape in shapes]
        self.offer("bent", *starts, deflate=False)

    def offer_around(self, found: Solved) -> None:
        """Add starts from a new equilibrium: mirror images, steps along its softest modes, midpoints to known ones."""
        equations, state = self.prepared.equations, found.state
        for image in self.images:
            self.offer("mirrored", partial(self._mirrored, state, image), deflate=False)
        shapes = self._shapes(found, SHAPES)
        if self.held(found).negative:
            sides = (partial(self._downhill, found, size * shapes[0]) for size in (DOWN, -DOWN))
            self.offer("downhill", *sides, deflate=False)
        for kind, size in (("nudged", NUDGE), ("farther", FARTHER_NUDGE)):
            sides = (partial(self.moved, state, way * shape) for shape in shapes for way in (size, -size))
            self.offer(kind, *sides, deflate=True)
        for other in self.found:
            if other is not found:
                half = 0.5 * turned_between(equations, other.state, state)
                self.offer("half-way", partial(self.moved, state, half), deflate=True)

    def look(self) -> None:
        """Run the search: begin at the undeformed state, go on until no starts or no permitted runs are left."""
        for deflate in (False, True):
            self.offer("given", partial(self.closed, self.begin), deflate=deflate)
        self.offer_bent()
        while self.go_on():
            pass

    @property
    def total(self) -> int:
        """Number of runs done."""
        return sum(self.counts.values())

    def go_on(self) -> bool:
        """Try the next start; False where there is none, or no permitted run is left."""
        kind = next((kind for kind, queue in self.waiting.items() if queue), None)
        if kind is None:
            return False
        if self.total >= self.runs:
            self.exhausted = True
            return False
        make, deflate = self.waiting[kind].popleft()
        start = make()
        if kind == "mirrored" and self._known(start):
            return True
        if self.run(kind, start, deflate=deflate):
            self.offer_around(self.found[-1])
        return True


def search(first: Solved, starts: Sequence[State] = (), runs: int | None = None) -> Search:
    """Look for further equilibria under the loads of a known one.

    Parameters
    ----------
    first : Solved
        The known one.
    starts : sequence of State
        Further states to begin with, such as equilibria under other loads.
    runs : int, optional
        Newton runs at most; the default falls with the number of unknowns.
    """
    prepared, loading = first.prepared, first.loading
    if runs is None:
        effort = max(1, prepared.equations.unknowns * (2 if prepared.model.space else 1))
        runs = max(FEWEST_RUNS, min(RUNS, EFFORT // effort))
    images = mirrors(prepared.model)
    if not prepared.equations.rotation_unknowns:
        return Search(prepared, loading, runs, images, [first])
    carried: list[State] = []
    left = runs
    for share in SHARES:
        part = Search(prepared, loading.scaled(share), runs // 5, images)
        part.offer("carried", *(partial(part.closed, state) for state in carried), deflate=False)
        part.look()
        left -= part.total
        carried = _carried(part, loading.scaled(share * FARTHER))
    result = Search(prepared, loading, left, images, [first])
    result.offer_around(first)
    returned = _returned(first) if left else []
    for kind, states in (("carried", carried), ("returned", returned), ("given", starts)):
        result.offer(kind, *(partial(result.closed, state) for state in states), deflate=False)
    result.smaller = runs - left
    result.look()
    return result


def _carried(smaller: Search, loading: Loading) -> list[State]:
    """Equilibria followed from smaller loads to larger ones, as far as their branches go."""
    change = loading.plus(smaller.loading.scaled(-1.0))
    states = []
    for found in smaller.found:
        followed = follow(
            smaller.prepared, lambda t: smaller.loading.plus(change.scaled(t)), found.state, switch_branch=False
        )
        if followed.reached:
            states.append(followed.state)
    return states


def _returned(first: Solved) -> list[State]:
    """What larger and reversed loads lead to by a jump, as far as it stays when they come back; motions keep."""
    alone = first.loading.plus(first.loading.unloaded().scaled(-1.0))
    found = (_there_and_back(first, alone.scaled(share - 1.0)) for share in BEYOND)
    return [state for state in found if state is not None]


def _there_and_back(first: Solved, more: Loading) -> State | None:
    out = follow(first.prepared, lambda t: first.loading.plus(more.scaled(t)), first.state)
    if not (out.reached and out.left):
        return None
    back = follow(first.prepared, lambda t: first.loading.plus(more.scaled(1.0 - t)), out.state, switch_branch=False)
    return back.state if back.reached else None


def long_elements(found: Solved) -> dict[str, Array]:
    """For each member a boolean array (elements,): elements so long that a beam under these loads may fold within one.

    These are halved for the search: an unstable straight member has equilibria that are curled anywhere, not just at
    its ends.
    """
    model, loading = found.model, found.loading
    pulls = np.abs(found.equations.segment_pulls(found.state.lam, loading)).max(initial=0.0)
    force = (pulls + np.abs(loading.pull).max(initial=0.0)) * model.scales.force
    marks = {}
    for name in model.members:
        if model.scene.members[name].type == "rigid":
            marks[name] = np.zeros(len(model.mesh.cuts[name]) - 1, dtype=bool)
            continue
        section = model.scene.sections[str(model.scene.members[name].section)]
        softest = float(np.nanmin(section.stiffness(np.linspace(0.0, 1.0, 5))))
        longest = LAYERS * np.sqrt(softest / max(force, TINY)) / model.scene.center_lines[name].length
        marks[name] = np.diff(model.mesh.cuts[name]) > longest
    return marks if model.mesh.elements <= MOST_ELEMENTS else {name: m & False for name, m in marks.items()}


def same(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two answers, on any meshes, agree within their estimated errors and have as many negative eigenvalues."""
    return one.certificate.negative == other.certificate.negative and alike(one, other)


def alike(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two answers, on any meshes, agree within their estimated errors."""
    errors = (one.certificate.error_estimate or 0.0) + (other.certificate.error_estimate or 0.0)
    apart = largest_difference(one.fields, other.fields)
    return apart <= 2.0 * errors + 1e-9 and not wound(one.strain, other.strain)


def wound(one: float, other: float) -> bool:
    """Whether states in the same places differ by whole turns of springs, told by their elastic energies."""
    return abs(one - other) > WOUND * (one + other) + tolerances.LEVEL


def missing(answers: Sequence[Equilibrium]) -> str:
    """A remark on equilibria that were not found, concluded from the numbers of negative eigenvalues; may be empty.

    Rotations of an open chain that is held somewhere form a contractible space, on which the energy grows to all sides:
    equilibria with even numbers of negative eigenvalues are one more than those with odd numbers (Morse).
    """
    model = answers[0].model
    neutral = any(answer.certificate.stable == "neutral" for answer in answers)
    if model.space or neutral or len(model.positions.rows) or free_parts(model):
        return ""
    balance = sum((-1) ** answer.certificate.negative for answer in answers)
    return "" if balance == 1 else "; their numbers of ways out do not balance, so at least one more exists"
