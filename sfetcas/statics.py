"""Static equilibria of a scene: from the undeformed state, in one go, to the accuracy asked for.

1. A coarse *pilot* mesh: IPOPT from a start guess at the full load, then Newton's method to rounding.
2. The branch is checked by following the loads from zero on the pilot (see :mod:`~sfetcas.continuation`), and
   an unstable equilibrium is left along its escape shape.
3. The mesh is refined where the solution is not smooth enough; Newton's method goes on from the coarser state.
4. All elements are halved once more: the difference is the estimate of the error, the halved mesh the answer.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from .accuracy import every_other, largest_difference, roughness
from .arrays import Array
from .contact_balance import refuse_lost_forces, refuse_unbalanced
from .contact_statics import ContactRun, Pressed
from .continuation import follow
from .deflation import deflated
from .doctor import in_words, moves_nodes
from .elements import ELEMENTS
from .equations import State
from .errors import SceneError, SolveError, Status
from .fields import Fields, transferred
from .loading import Loading
from .mesh import Mesh, first_mesh, uniform_mesh
from .model import Model, assemble
from .newton import Corrected, loose_rows, relative_residual, rows_in
from .prepared import SOLVED, Prepared
from .scene import Scene
from .settling import Held
from .several import Search, long_elements, missing, same, search
from .solution import Equilibrium, Solution, equilibrium
from .stability import Stability
from .threads import single_threaded
from .touches import Touched

__all__ = ["Settings", "pilot_of", "solve", "solve_model"]

FINE = 1e-8
"""Below this accuracy elements of order 6 need fewer unknowns than those of order 4 (measured)."""

PILOT_ELEMENTS = 60
"""A mesh that was asked for is its own pilot up to this many elements."""

PILOT_ORDER = 4
"""Coarse meshes of lower order have equilibria that no beam has."""

HUGE = 2000
"""From this many elements on the error is estimated from the mesh with half the elements, not with twice."""

LEVELS = 40
"""Most refinements of a mesh: a boundary layer of 1e-8 of a member needs about 27."""

MOST_FURTHER = 300
"""The same for what a search found: what needs more is seldom an equilibrium of a beam."""

DRIFT = 1.0
"""An equilibrium that turns by more than this from a mesh to a finer one, rad, is not the same."""

MOST_ELEMENTS = 20_000
"""A mesh that the library chooses does not grow beyond this."""


@dataclass(frozen=True)
class Settings:
    """How to solve; everything has a default that suits.

    Attributes
    ----------
    accuracy : float or None
        Wanted error of the positions over the size of the scene; None takes that of the scene.
    element, elements : str, int or None
        Element of all members and number of elements of each; None takes those of the members, or chooses.
    gauss : bool
        Gauss integration with the norm divided out instead of integration at the nodes.
    assembly : str
        ``auto``, ``closing`` or ``nodal``.
    branch : bool
        Check the branch by following the loads from zero.
    runs : int or None
        Newton runs at most in a search for several equilibria, for each factor; None takes what suits the size.
    """

    accuracy: float | None = None
    element: str | None = None
    elements: int | None = None
    gauss: bool = False
    assembly: Literal["auto", "closing", "nodal"] = "auto"
    branch: bool = True
    runs: int | None = None

    def __post_init__(self) -> None:
        if self.accuracy is not None and not 0.0 < self.accuracy <= 0.1:
            raise SceneError(f"accuracy: found {self.accuracy:g}, accepted: a number above 0 and up to 0.1")
        if self.element is not None and self.element not in ELEMENTS:
            raise SceneError(f"element: found {self.element!r}, accepted: {', '.join(ELEMENTS)}")
        if self.elements is not None and not 1 <= self.elements <= 1_000_000:
            raise SceneError(f"elements: found {self.elements}, accepted: 1 to 1000000")
        if self.runs is not None and not 0 <= self.runs <= 1_000_000:
            raise SceneError(f"runs: found {self.runs}, accepted: 0 to 1000000")
        if self.assembly not in ("auto", "closing", "nodal"):
            raise SceneError(f"assembly: found {self.assembly!r}, accepted: auto, closing, nodal")


@single_threaded
def solve_model(model: Any, factor: float = 1.0, *, start: Equilibrium | None = None) -> Equilibrium:
    """One equilibrium of a prepared model: IPOPT from the start guess, or Newton's method from a near answer.

    Parameters
    ----------
    model : Model or Prepared
        Pass the same :class:`Prepared` for repeated solves: nothing is built again.
    factor : float
        Factor of loads and motions.
    start : Equilibrium, optional
        Answer of the same model for a near factor.

    Raises
    ------
    SceneError
        The scene has contacts or stops of springs, which only :func:`solve` looks for.
    SolveError
        No equilibrium was found.
    """
    prepared = model if isinstance(model, Prepared) else Prepared(model)
    prepared.model.check_complete()
    loading = prepared.model.loading(factor)
    found, iterations = _warm(prepared, start, loading) if start is not None else None, 0
    if found is None:
        found, iterations = _cold(prepared, loading)
    return _finished(prepared, found, loading, factor, prepared.stability(found), iterations=iterations)


def _warm(prepared: Prepared, start: Equilibrium, loading: Loading) -> Corrected | None:
    found = prepared.correct(start.state, loading, iterations=20, most=2.0)
    return found if found.converged else None


def _cold(prepared: Prepared, loading: Loading) -> tuple[Corrected, int]:
    if not prepared.model.minimisable:
        start = prepared.equations.start(prepared.model.loading(0.0, 0.0))
        followed = follow(prepared, loading.scaled, start, leave=False)
        if not followed.reached:
            raise SolveError(Status.FAILED, "the loads could not be followed from zero", followed.state)
        return prepared.correct(followed.state, loading), 0
    state, gap = prepared.guess(loading)
    if gap > 0.2:
        equations = prepared.equations
        rows = np.abs(equations.at(state, loading).residual[equations.unknowns :])
        worst = ", ".join(equations.row_names[i] for i in np.flatnonzero(rows > 0.3 * rows.max())[:4])
        detail = f"the closings miss by {gap * prepared.model.scales.length:.3g} m at {worst}"
        raise SolveError(Status.INFEASIBLE, detail, state)
    return prepared.minimise(loading, state)


def _finished(
    prepared: Prepared,
    found: Corrected,
    loading: Loading,
    factor: float,
    stability: Stability,
    *,
    estimate: float | None = None,
    notes: tuple[str, ...] = (),
    iterations: int = 0,
) -> Equilibrium:
    return equilibrium(
        prepared.equations,
        found.state,
        loading,
        factor,
        found.point,
        found.residual,
        stability,
        error_estimate=estimate,
        notes=notes,
        iterations=iterations,
    )


@single_threaded
def solve(
    scene: Scene, settings: Settings | None = None, *, stops: tuple[tuple[str, str], ...] = (), **changes: Any
) -> Solution:
    """Equilibria of a scene for the load factors of its analysis.

    Parameters
    ----------
    scene : Scene
    settings : Settings, optional
        Further keywords replace single settings: ``solve(scene, accuracy=1e-8)``.
    stops : tuple of (str, str)
        Springs that stand at a stop, ``low`` or ``high``; others pass theirs (see :mod:`~sfetcas.stops`).

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        A factor has no equilibrium that could be found; the sentence says why.

    Example
    -------
    >>> scene = load("problems/cantilever_tip_force.toml")      # doctest: +SKIP
    >>> solve(scene).last.position("tip")                       # doctest: +SKIP
    """
    settings = replace(settings or Settings(), **changes)
    return _Run(scene, settings, stops).solution()


def pilot_of(scene: Scene, settings: Settings | None = None) -> Mesh:
    """The mesh that :func:`solve` begins with."""
    return _Run(scene, settings or Settings()).target


@dataclass
class _Found:
    """An equilibrium on the way: where it stands and what was said about it; one that is ``kept`` is no other."""

    prepared: Prepared
    corrected: Corrected
    stability: Stability
    notes: tuple[str, ...] = ()
    iterations: int = 0
    left: tuple[float, ...] = ()
    kept: bool = False


class _Run:
    """One run over the load factors of a scene."""

    def __init__(self, scene: Scene, settings: Settings, stops: tuple[tuple[str, str], ...] = ()) -> None:
        self.scene, self.settings, self.stops = scene, settings, stops
        self.accuracy = settings.accuracy or scene.analysis.accuracy
        self.asked = settings.accuracy is not None or "accuracy" in scene.analysis.model_fields_set
        self.seconds = {"model": 0.0, "solve": 0.0}
        self.assembly: Any = settings.assembly
        self.leave = scene.analysis.unstable == "leave"
        self.creeping = False
        self.started = any(node.start is not None for node in scene.nodes.values())
        self.others: list[tuple[Model, State]] = []
        self._choose_meshes()
        # Where the mesh is the library's own, its default accuracy is a promise as well.
        self.asked = self.asked or not self.fixed

    # -- meshes ---------------------------------------------------------------------------------

    def _choose_meshes(self) -> None:
        scene, settings = self.scene, self.settings
        names: set[str] = {m.element for m in scene.members.values() if m.element is not None}
        if settings.element is not None:
            names = {settings.element}
        if len(names) > 1:
            raise SceneError(f"members: found the elements {', '.join(sorted(names))}, accepted: one for all members")
        name = next(iter(names), "SFET7" if self.accuracy < FINE else "SFET5")
        order = ELEMENTS.index(name) + 1
        # A coarser turning an element for low orders: they need more elements to be near at all.
        mesh = first_mesh(scene, order, turning=min(2.0, 0.5 * order))
        flexible = {n: m for n, m in scene.members.items() if m.type == "flexible"}
        counts = {n: settings.elements or m.elements for n, m in flexible.items()}
        self.fixed = {n for n, count in counts.items() if count is not None}
        equal = uniform_mesh(scene, order, {n: count or 1 for n, count in counts.items()})
        cuts = {n: (equal if n in self.fixed else mesh).cuts[n] for n in mesh.cuts}
        self.target = Mesh(order, cuts, settings.gauss, mesh.rigid, stops=self.stops)
        if order >= PILOT_ORDER and (self.target.elements <= PILOT_ELEMENTS or not self.fixed):
            self.pilot_mesh = self.target
        else:
            self.pilot_mesh = replace(first_mesh(scene, max(order, PILOT_ORDER), turning=1.0), stops=self.stops)

    @property
    def _prescribed(self) -> bool:
        """Whether the meshes of all flexible members are asked for."""
        return self.fixed == {n for n, m in self.scene.members.items() if m.type == "flexible"}

    def _prepared(self, mesh: Mesh) -> Prepared:
        begin = time.perf_counter()
        prepared = Prepared(assemble(self.scene, mesh, assembly=self.assembly))
        # A state goes from mesh to mesh with its multipliers: all meshes share the assembly of the first.
        self.assembly = prepared.model.assembly
        _ = prepared.equations
        self.seconds["model"] += time.perf_counter() - begin
        return prepared

    # -- the run --------------------------------------------------------------------------------

    def solution(self) -> Solution:
        """All steps."""
        begin = time.perf_counter()
        pilot = self._prepared(self.pilot_mesh)
        steps: list[Equilibrium] = []
        last: tuple[float, _Found] | None = None
        contact = ContactRun(self.scene, self._prepared, self.accuracy, self.fixed) if self.scene.contacts else None
        for factor in self.scene.analysis.steps:
            if contact is not None:
                steps.append(self._in_contact(contact, pilot, factor))
                continue
            found = self._found(pilot, factor, last)
            last = (factor, found) if found.prepared is pilot else None
            steps.append(self._refined(found, factor))
            if self.scene.analysis.equilibria == "all":
                steps[-1:] = self._several(found, steps[-1], factor)
        self.seconds["solve"] = time.perf_counter() - begin - self.seconds["model"]
        reached = all((step.certificate.error_estimate or 0.0) <= self.accuracy for step in steps)
        status = Status.SOLVED if reached or not self.asked else Status.SHORT
        return Solution(self.scene, status, tuple(steps), self.seconds)

    def _named(self, pilot: Prepared, error: SolveError) -> SolveError:
        """The error with the motions that nothing holds, where there are any."""
        try:
            free = pilot.diagnosis
        except (RuntimeError, np.linalg.LinAlgError):
            return error
        if not free.mobility:
            return error
        detail = f"{error.detail}; free to move without load: {'; '.join(free.motions[:3])}"
        return SolveError(error.status, detail, error.last)

    def _found(self, pilot: Prepared, factor: float, last: tuple[float, _Found] | None) -> _Found:
        """The answer on the pilot, or on one with a quarter of its element lengths where that has none."""
        try:
            return self._on_pilot(pilot, factor, last)
        except SolveError as found:
            error = self._named(pilot, found)
            if pilot.model.mesh.elements > PILOT_ELEMENTS or self.fixed or pilot.diagnosis.mobility:
                raise error from None
            try:
                return self._on_pilot(self._prepared(pilot.model.mesh.refined().refined()), factor, None)
            except SolveError:
                raise error from None

    def _on_pilot(self, pilot: Prepared, factor: float, last: tuple[float, _Found] | None) -> _Found:
        loading = pilot.model.loading(factor)
        if not pilot.model.minimisable:
            return self._only_grown(pilot, factor, last)
        alone, failure = self._direct(pilot, loading)
        if self.started or not self.settings.branch:
            return self._accepted(pilot, alone, failure, loading)
        reached = self._grown(pilot, factor, last)
        if reached is None:
            return self._accepted(pilot, alone, failure, loading)
        if alone is not None:
            reached.iterations = alone.iterations
            apart = pilot.distance(alone.corrected.state, reached.corrected.state) > 1e-3
            if apart and not reached.notes and alone.stability.negative == 0:
                reached.notes += (
                    "the loads growing from zero lead here, not to the minimum nearest to the start guess",
                )
        return reached

    def _only_grown(self, pilot: Prepared, factor: float, last: tuple[float, _Found] | None) -> _Found:
        """Loads that cannot be minimised: the state that they lead to from zero, stable or not."""
        found = self._grown(pilot, factor, last)
        if found is None:
            detail = "the loads could not be followed from zero, and without a potential there is no other way"
            raise SolveError(Status.FAILED, detail)
        if not pilot.model.conservative:
            found.notes += (NO_POTENTIAL,)
        return found

    def _direct(self, pilot: Prepared, loading: Loading) -> tuple[_Found | None, SolveError | None]:
        """IPOPT from the start guess."""
        try:
            corrected, iterations = _cold(pilot, loading)
        except SolveError as error:
            return None, error
        return _Found(pilot, corrected, pilot.stability(corrected), iterations=iterations), None

    def _accepted(self, pilot: Prepared, alone: _Found | None, failure: SolveError | None, loading: Loading) -> _Found:
        """What IPOPT found, an unstable state left if that is wanted."""
        if alone is None:
            assert failure is not None
            raise failure
        if alone.stability.negative == 0 or not self.leave:
            return alone
        corrected, stability = pilot.leave(alone.corrected.state, alone.stability, loading)
        note = f"left an unstable equilibrium with {alone.stability.negative} ways out along its escape shape"
        return _Found(pilot, corrected, stability, (note,), alone.iterations)

    def _grown(self, pilot: Prepared, factor: float, last: tuple[float, _Found] | None) -> _Found | None:
        """The state that the loads lead to from zero, or from the last factor where that lies on the way."""
        model = pilot.model
        if last is not None and last[0] * (factor - last[0]) >= 0.0:
            found = self._through(pilot, last[0], factor, last[1].corrected.state)
            if found is not None:
                return found
        zero = pilot.equations.start(model.loading(0.0, 0.0))
        if pilot.lacks_slack:
            # Straight members without slack: no way leads from here but the one that motions make.
            moved = np.any(model.loading(factor).shift) and not self.scene.histories
            return self._grown_from_bent(pilot, factor) if moved else None
        if pilot.model.minimisable and pilot.diagnosis.mobility and not self.scene.histories:
            # A mechanism has no place of its own without loads: the way begins where a small share of them puts it.
            return self._grown_from_bent(pilot, factor)
        if self.scene.histories and factor != 0.0:
            # With histories the way leads through the factors, after the loads of factor 0 have grown.
            first = self._followed(pilot, lambda t: model.loading(0.0, t), zero)
            if first is None:
                return None
            zero = first.corrected.state
        return self._through(pilot, 0.0, factor, zero)

    def _through(self, pilot: Prepared, begin: float, end: float, state: State) -> _Found | None:
        """Follow from one factor to another, stopping where a history has a knot: no step jumps over one."""
        knots = {
            t for history in self.scene.histories.values() for t in history.t if min(begin, end) < t < max(begin, end)
        }
        stops = [begin, *sorted(knots, reverse=end < begin), end]
        found: _Found | None = None
        for a, b in zip(stops, stops[1:], strict=False):
            part = self._followed(pilot, lambda t, a=a, b=b: pilot.model.loading(a + t * (b - a)), state)
            if part is None:
                return None
            found, state = replace(part, notes=(*(found.notes if found else ()), *part.notes)), part.corrected.state
        return found

    def _grown_from_bent(self, pilot: Prepared, factor: float) -> _Found | None:
        """As :meth:`_grown` where straight members have no slack to begin with: from a slightly moved state."""
        begin = 0.01 * factor
        bent, _ = self._direct(pilot, pilot.model.loading(begin))
        if bent is None:
            return None
        state = bent.corrected.state
        if bent.stability.negative and self.leave:
            try:
                state = pilot.leave(state, bent.stability, pilot.model.loading(begin))[0].state
            except SolveError:
                return None
        return self._followed(pilot, lambda t: pilot.model.loading(begin + t * (factor - begin)), state)

    def _followed(self, pilot: Prepared, way: Any, state: State) -> _Found | None:
        result = follow(pilot, way, state, leave=self.leave and pilot.model.minimisable)
        if not result.reached:
            return None
        corrected = pilot.correct(result.state, way(1.0))
        notes = tuple(
            f"left an unstable equilibrium along its escape shape at {100.0 * part:.3g} % of the way to these loads"
            for part in result.left
        )
        return _Found(pilot, corrected, pilot.stability(corrected), notes, left=result.left)

    # -- several equilibria ---------------------------------------------------------------------

    def _several(self, found: _Found, answer: Equilibrium, factor: float) -> list[Equilibrium]:
        """The answer, then further equilibria of the same factor with rising energy."""
        if not found.prepared.model.minimisable:
            accepted = "'one', as loads without potential have no energy to search by"
            raise SceneError(f"found 'all', accepted: {accepted}", ("analysis", "equilibria"))
        result = self._searched(found, factor)
        answers, dropped = [replace(answer, notes=(*answer.notes, *result.family_note(0)))], 0
        for number, corrected in enumerate(result.found[1:], start=1):
            stability = result.prepared.stability(corrected)
            candidate = _Found(result.prepared, corrected, stability, result.family_note(number), kept=True)
            further = self._further(candidate, factor)
            if further is None:
                dropped += 1
            elif not any(same(further, other) for other in answers):
                answers.append(further)
        note = result.sentence() + missing(answers)
        if dropped:
            note += f"; {dropped} of the mesh of the search are none on finer ones"
        answers[1:] = sorted(answers[1:], key=lambda other: other.potential)
        return [replace(other, notes=(*other.notes, note)) for other in answers]

    def _further(self, candidate: _Found, factor: float) -> Equilibrium | None:
        """The answer to what a search found; None where finer meshes do not have it."""
        try:
            answer = self._refined(candidate, factor)
        except SolveError:
            return None
        short = (answer.certificate.error_estimate or 0.0) > self.accuracy
        return None if short and not self._prescribed else answer

    def _searched(self, found: _Found, factor: float) -> Search:
        """The search, on a mesh fine enough for what is strongly curled, but for elements that are prescribed."""
        first = found
        if not self._prescribed:
            first = self._onto(self._halved(found), found, factor)
        elif self.pilot_mesh is not self.target:
            first = self._onto(found.prepared.model.mesh.refined(), found, factor)
        for _ in range(LEVELS if first is not found else 0):
            long = long_elements(first.prepared, first.prepared.model.loading(factor), first.corrected)
            marks = {name: marked & (name not in self.fixed) for name, marked in long.items()}
            if not any(marked.any() for marked in marks.values()):
                break
            first = self._onto(first.prepared.model.mesh.refined(marks), first, factor)
        prepared, loading = first.prepared, first.prepared.model.loading(factor)
        starts = [transferred(model, state, prepared.model) for model, state in self.others]
        result = search(prepared, loading, first.corrected, starts, self.settings.runs)
        self.others = [(prepared.model, other.state) for other in result.found]
        return result

    # -- contact --------------------------------------------------------------------------------

    def _in_contact(self, contact: ContactRun, pilot: Prepared, factor: float) -> Equilibrium:
        """The answer where obstacles may stop members."""
        base = self.pilot_mesh.refined()
        notes: tuple[str, ...] = ()
        held = contact.continued(base, factor)
        falls = bool(pilot.diagnosis.mobility) and not contact.first_touches(base)
        if held is None or not held.mesh.touches:
            free, failure = self._unstopped(pilot, factor)
            if free is not None and free.left and not self.creeping and not self.scene.histories:
                return self._crept(contact, pilot, factor, free.left[0])
            held = None
            if free is not None:
                there = self._onto(base, free, factor)
                held, notes = _as_held(there, factor), there.notes
                free_way = contact.reviser.wrong(held, contact.at(factor)) is None
                if free_way and not contact.reviser.ran_over(None, held):
                    answer = self._refined(free, factor)
                    if contact.clear(answer.fields):
                        contact.last = (factor, held)
                        return answer
            ways = contact.reached(base, factor, held, nearer=self.started or bool(notes), falls=falls)
            return self._first_pressed(contact, ways, factor, notes, failure)
        return self._pressed(contact.answered(held, factor, self.target, notes), factor)

    def _first_pressed(
        self,
        contact: ContactRun,
        ways: Iterator[Held | None],
        factor: float,
        notes: tuple[str, ...],
        failure: SolveError | None,
    ) -> Equilibrium:
        """The first answer among states in contact that were found in different ways."""
        refused: SolveError | None = None
        for held in ways:
            if held is None:
                continue
            try:
                return self._pressed(contact.answered(held, factor, self.target, notes), factor)
            except SolveError as error:
                refused = refused or error
        if refused is not None:
            raise refused
        detail = "no state in contact was found on the way of the loads from zero, on cushions, nor by obstacles coming"
        raise SolveError(Status.FAILED, f"{detail} back: {', '.join(contact.named(failure))}")

    def _crept(self, contact: ContactRun, pilot: Prepared, factor: float, unstable: float) -> Equilibrium:
        """The same by small steps from where the loads would make it jump: nothing jumps over an obstacle."""
        self.creeping = True
        try:
            beyond = unstable
            for growth in CREEP:
                beyond *= growth
                if beyond >= 1.0:
                    break
                self._in_contact(contact, pilot, beyond * factor)
            return self._in_contact(contact, pilot, factor)
        finally:
            self.creeping = False

    def _unstopped(self, pilot: Prepared, factor: float) -> tuple[_Found | None, SolveError | None]:
        """The answer as if there were no obstacles; None where nothing else holds the structure."""
        try:
            return self._on_pilot(pilot, factor, None), None
        except SolveError as error:
            return None, error

    def _pressed(self, found: Pressed, factor: float) -> Equilibrium:
        held = found.held
        refuse_unbalanced(held.touched.fields)
        answer = _finished(
            held.prepared,
            held.corrected,
            held.loading,
            factor,
            found.stability,
            estimate=found.error,
            notes=found.notes,
        )
        refuse_lost_forces(held.touched.fields, [answer.contacts[name]["force"] for name in self.scene.contacts])
        return answer

    # -- accuracy -------------------------------------------------------------------------------

    def _onto(self, mesh: Mesh, source: _Found, factor: float) -> _Found:
        """The same equilibrium on another mesh."""
        prepared = self._prepared(mesh)
        loading = prepared.model.loading(factor)
        state = transferred(source.prepared.model, source.corrected.state, prepared.model)
        corrected = prepared.correct(state, loading, iterations=25, most=1.5)
        if source.kept and not corrected.converged:
            corrected = deflated(prepared, state, loading, ()) or corrected
        if source.kept and (not corrected.converged or prepared.distance(state, corrected.state) > DRIFT):
            raise SolveError(Status.FAILED, "an equilibrium of a coarse mesh only", state)
        if not corrected.converged:
            corrected, _ = prepared.minimise(loading, state)
        return replace(source, prepared=prepared, corrected=corrected)

    def _refined(self, pilot: _Found, factor: float) -> Equilibrium:
        if self._prescribed:
            return self._on_target(pilot, factor)
        mesh = pilot.prepared.model.mesh
        own = mesh is not self.pilot_mesh and mesh.order == self.target.order and not self.fixed
        there = mesh is self.target or own
        now = pilot if there else self._onto(self.target, pilot, factor)
        smooth = np.sqrt(self.accuracy)
        loading = now.prepared.model.loading(factor)
        for _ in range(LEVELS):
            marked = self._marked(now, loading, smooth)
            if not any(m.any() for m in marked.values()):
                finer = self._onto(self._halved(now), now, factor)
                error = self._difference(now, finer, factor)
                now = finer
                if error <= self.accuracy:
                    return self._answer(now, factor, error)
                smooth *= 0.1
            elif now.prepared.model.mesh.elements > (MOST_FURTHER if now.kept else MOST_ELEMENTS):
                break
            else:
                now = self._onto(now.prepared.model.mesh.refined(marked), now, factor)
            loading = now.prepared.model.loading(factor)
        finer = self._onto(self._halved(now), now, factor)
        return self._answer(finer, factor, self._difference(now, finer, factor))

    def _halved(self, now: _Found) -> Mesh:
        cuts = now.prepared.model.mesh.cuts
        marks = {n: np.full(len(c) - 1, n not in self.fixed) for n, c in cuts.items()}
        return now.prepared.model.mesh.refined(marks)

    def _on_target(self, pilot: _Found, factor: float) -> Equilibrium:
        """Everything was prescribed: solve there, and estimate the error from a mesh beside it."""
        mesh = self.target
        if mesh.elements > HUGE:
            half = replace(mesh, cuts={n: every_other(c) for n, c in mesh.cuts.items()})
            coarse = self._onto(half, pilot, factor)
            now = self._onto(mesh, coarse, factor)
            # The error falls by 4^p a halving; twice that share for not being there yet.
            error = self._difference(coarse, now, factor) * 2.0 / (4.0**mesh.order - 1.0)
            return self._answer(now, factor, error)
        now = pilot if self.pilot_mesh is mesh else self._onto(mesh, pilot, factor)
        finer = self._onto(mesh.refined(), now, factor)
        return self._answer(now, factor, self._difference(now, finer, factor))

    def _answer(self, found: _Found, factor: float, error: float) -> Equilibrium:
        prepared = found.prepared
        found = _with_unique_reactions(found, prepared.model.loading(factor))
        stability = prepared.stability(found.corrected)
        loading = prepared.model.loading(factor)
        if not found.kept:
            _refuse_free(prepared, found.corrected, stability)
        if stability.negative > 0 and self.leave and prepared.model.minimisable and not found.kept:
            corrected, stability = prepared.leave(found.corrected.state, stability, loading)
            note = "left an equilibrium that is unstable on the fine mesh only"
            found = replace(found, corrected=corrected, notes=(*found.notes, note))
        return _finished(
            prepared,
            found.corrected,
            loading,
            factor,
            stability,
            estimate=error,
            notes=found.notes,
            iterations=found.iterations,
        )

    def _difference(self, coarse: _Found, fine: _Found, factor: float) -> float:
        sides = [
            Fields(f.prepared.equations, f.corrected.state, f.prepared.model.loading(factor)) for f in (coarse, fine)
        ]
        return largest_difference(*sides)

    def _marked(self, found: _Found, loading: Loading, smooth: float) -> dict[str, Array]:
        """Elements to halve: those that are not smooth, of members whose mesh is not prescribed."""
        rough = roughness(Fields(found.prepared.equations, found.corrected.state, loading)) > smooth
        model = found.prepared.model
        return {n: rough[model.elements_of(n)] & (n not in self.fixed) for n in model.members}


def _refuse_free(prepared: Prepared, found: Corrected, stability: Stability) -> None:
    """Refuse a mechanism of which neither stiffness nor loads hold some motion.

    Raises
    ------
    SceneError
        Names the motion.
    """
    if stability.stable != "neutral" or not prepared.diagnosis.mobility:
        return
    shape = np.concatenate([stability.shape, stability.travel])
    if moves_nodes(prepared.equations, shape, found.state):
        motion = in_words(prepared.equations, shape)
        message = f"free to move: {motion}; neither stiffness nor a load holds it, add a support, a spring or a motion"
        raise SceneError(message)


def _as_held(found: _Found, factor: float) -> Held:
    """An equilibrium without contact as one that may begin it."""
    loading = found.prepared.model.loading(factor)
    touched = Touched(found.prepared.equations, found.corrected.state, loading)
    return Held(found.prepared, found.corrected, loading, touched)


def _with_unique_reactions(found: _Found, loading: Loading) -> _Found:
    """The same, with the smallest multipliers and a note where closings are redundant.

    Raises
    ------
    SolveError
        Members stretched between held points: no finite reaction holds an inextensible member straight.
    """
    equations, corrected = found.prepared.equations, found.corrected
    loose = loose_rows(equations, corrected.point)
    if not loose.size:
        return found
    names = ", ".join(equations.row_names[row] for row in rows_in(loose))
    lam = corrected.state.lam - loose @ (loose.T @ corrected.state.lam)
    state = replace(corrected.state, lam=lam)
    point = equations.at(state, loading)
    residual = relative_residual(equations, point)
    if residual <= SOLVED:
        corrected = replace(corrected, state=state, point=point, residual=residual)
    elif np.abs(corrected.state.lam).max() > BEYOND * max(1.0, found.prepared.load_size(corrected)):
        detail = f"fully stretched between held points, where an inextensible member takes any force: {names}"
        raise SolveError(Status.INFEASIBLE, detail, corrected.state)
    note = f"reactions are not unique, the smallest are given; redundant: {names}"
    return replace(found, corrected=corrected, notes=(*found.notes, note))


NO_POTENTIAL = (
    "loads without potential: no energy tells whether this is stable; the static tangent is regular all the way "
    "from zero load, and flutter would only show in dynamics"
)

CREEP = (1.002, 1.01, 1.03, *(1.1 + 0.1 * i for i in range(40)))
"""Growth of the loads from step to step where a structure between obstacles becomes unstable."""

BEYOND = 1e4
"""Multipliers above this many times the loads are those of a stretched member, which has none that is finite."""
