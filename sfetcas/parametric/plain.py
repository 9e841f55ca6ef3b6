"""Many equilibria of one scene by the core: those of cases in which nothing out of the ordinary happens.

Plain is a case whose loads are followed from zero, on a mesh that is accurate enough for the scene itself, along
equilibria all of whose eigenvalues are clearly above zero, and whose error on a mesh with half the elements is small
enough.  All others are left to :func:`~sfetcas.solve`.  Decisions are those of
:mod:`~sfetcas.solvers.continuation` and :mod:`~sfetcas.equilibria.refinement`; each case is independent of all others.
"""

from __future__ import annotations

import functools
import re
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..equilibria.refinement import DRIFT, TORN
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import sparse
from ..mathematics.core import Cases, doubles, integers
from ..mathematics.many import Many
from ..mechanics.accuracy import WITHIN, gain, remaining
from ..mechanics.equations import Equations, State
from ..mechanics.fields import transferred
from ..mechanics.inputs import Inputs
from ..mechanics.mesh import Mesh, breaks_of, within_elements
from ..mechanics.model import Model, assemble
from ..mechanics.stations import Stations
from ..solvers.continuation import FARTHEST, TRAVEL, plain_way
from ..solvers.newton import Limits, limits_for_core
from ..solvers.prepared import Prepared
from ..stopping import arrived
from .arguments import Argument, Arguments
from .equilibrium import asked_mesh, chosen_places
from .results import Results

__all__ = ["NO_CORE", "PlainAnswers", "PlainCases", "nearest_before", "plain_cases"]

NO_CORE = "no core, which needs a C compiler"
"""What hinders all cases where there is none: they are solved one by one then."""

SIMPLE = re.compile(
    r"factor|loads\.[^.]+\.value(\.\d)?|sections\.[^.]+\.(EI2|EI3|GJ|E)|springs\.[^.]+\.stiffness|"
    r"tendons\.[^.]+\.tension|gravity(\.\d)?|motions\.[^.]+\.(displacement|rotation)(\.\d)?"
)
"""Numbers that a scene accepts within their limits, whatever the others are, and that move no end of an element."""

MORE = ("coupling", "stiffness_", "law", "stretch_law")
"""What makes stiffness of a section more than its own numbers."""

EPSILON, SAME = 1e-12, 1e-9
"""What ends of elements may be beside kinks, fractions of a length; and data beside those of a model made anew."""

CHUNK = 512
"""Cases that a thread solves together: functions of all of them are evaluated at once."""

MESHES = 4
"""Meshes, each with twice the elements of the one before, of which the last two have to be near enough."""

LEFT_ALONE = 0.5
"""Share of the accuracy that errors of cases may have, so that none is near to where meshes are refined."""


@dataclass(frozen=True)
class PlainAnswers:
    """Answers of cases, in their order.

    Attributes
    ----------
    known : ndarray (cases,) of bool
        Which cases were plain.
    numbers : ndarray (cases, results)
        Results in the units of the scene; nan where there is none.
    errors : ndarray (cases,)
        Estimated errors of positions over the size of the scene.
    residuals : ndarray (cases,)
        Largest relative residuals.
    seconds : ndarray (cases,)
        Wall time of each, in its thread.
    interrupted : bool
        Whether it was interrupted, so that some were not looked at.
    """

    known: Array
    numbers: Array
    errors: Array
    residuals: Array
    seconds: Array
    interrupted: bool = False


def plain_cases(
    scene: Scene,
    arguments: Sequence[Argument],
    results: Sequence[str],
    settings: Settings,
    *,
    places: Mapping[str, Sequence[float]] | None = None,
    known: tuple[Mesh, Any] | None = None,
) -> PlainCases | str:
    """The cases of a scene with other numbers; or, where none of them is plain, why in a few words.

    Parameters
    ----------
    scene : Scene
        Its answer is that of the last step.
    arguments : sequence of Argument
        The numbers that change.
    results : sequence of str
        What is wanted of each answer.
    settings : Settings
        As of :func:`~sfetcas.solve`.
    places : mapping, optional
        Fractions of the lengths of members at which results along them are given.
    known : (Mesh, assembly), optional
        The mesh that the scene's accuracy asks for, where it has been found before.

    Raises
    ------
    SceneError
        The scene has no such numbers or answers, or is not one of statics.
    SolveError
        It has no equilibrium with its own numbers.
    """
    why = _extraordinary(scene, settings)
    if why:
        return why
    # Of several steps the last one is asked for, to which the loads of those before lead as well.
    last = scene.analysis.model_copy(update={"steps": scene.analysis.steps[-1:]})
    scene = scene.model_copy(update={"analysis": last})
    mesh, assembly = known or asked_mesh(scene, settings)[:2]
    flexible = [name for name, member in scene.members.items() if member.type == "flexible"]
    found = PlainCases(scene, arguments, results, settings, mesh, assembly, chosen_places(flexible, places or {}))
    return found.why or found


def _extraordinary(scene: Scene, settings: Settings) -> str:
    """What makes no case of a scene plain, in a few words."""
    asked = {
        "an analysis that is not static": scene.analysis.type != "static",
        "a search for all equilibria": scene.analysis.equilibria != "one",
        "contact": bool(scene.contacts),
        "stops or tendons that may be slack": scene.stopped,
        "friction of tendons": any(tendon.friction is not None for tendon in scene.tendons.values()),
        "laws with memory": scene.remembers,
        "laws with limits": scene.limited or scene.limited_on_ways,
        "histories": bool(scene.histories),
        "tubes": bool(scene.tubes),
        "relaxation": any(section.relaxation for section in scene.sections.values()),
        "start places": scene.started,
        "accuracy of a single quantity": bool(settings.accuracy_of or scene.analysis.accuracy_of),
        "a number of elements that is asked for": bool(
            settings.elements or any(member.elements for member in scene.members.values())
        ),
    }
    return next((what for what, is_so in asked.items() if is_so), "")


class PlainCases:
    """Cases of one scene, ready to be solved.

    Parameters
    ----------
    scene, arguments, results, settings, places
        As of :func:`plain_cases`.
    mesh, assembly
        Of the coarsest model.

    Attributes
    ----------
    why : str
        What makes no case plain, in a few words; else empty.
    """

    def __init__(
        self,
        scene: Scene,
        arguments: Sequence[Argument],
        results: Sequence[str],
        settings: Settings,
        mesh: Mesh,
        assembly: Any,
        places: Mapping[str, Sequence[float]],
    ) -> None:
        self.scene, self._arguments, self._results, self._places = scene, tuple(arguments), tuple(results), places
        self.accuracy = settings.accuracy or scene.analysis.accuracy
        self._assembly, self._levels, self._lock = assembly, list[_Level](), threading.Lock()
        self._meshes = [mesh]
        for _ in range(MESHES - 1):
            self._meshes.append(self._meshes[-1].refined())
        self._first = self._model(mesh)
        self.why = self._hindered(Prepared(self._first))

    def _model(self, mesh: Mesh) -> Model:
        like = self._levels[0].model.scales if self._levels else None
        return assemble(self.scene, mesh, assembly=self._assembly, scales=like)

    def _hindered(self, prepared: Prepared) -> str:
        """What makes no case of a model plain, in a few words."""
        model, loading = prepared.model, prepared.model.loading(self.scene.analysis.steps[0])
        equations = prepared.equations
        if not model.has_potential or not model.minimisable:
            return "loads without potential"
        if not np.isnan(model.unwrapping.prescribed(model.rotations.kind, loading)).all():
            return "angles that are counted and prescribed"
        if equations.apart() is None:
            return NO_CORE
        if prepared.diagnosis.mobility:
            return "a mechanism"
        if equations.rows:
            prepared.correct(equations.start(model.loading(0.0)), model.loading(0.0))
        if equations.redundant or prepared.lacks_slack:
            return "redundant closings"
        if prepared.counting is None:
            return "places that slide"
        # What it refuses is told before anything is solved.
        self._level(0)
        return ""

    def _level(self, number: int) -> _Level:
        """The cases on one of the meshes; those after the second are seldom needed."""
        # Threads share them.
        with self._lock:
            while len(self._levels) <= number:
                model = self._model(self._meshes[len(self._levels)]) if self._levels else self._first
                coarser = self._levels[-1].model if self._levels else None
                self._levels.append(_Level(self.scene, model, self._arguments, self._results, self._places, coarser))
            return self._levels[number]

    def _seen(self, level: _Level, number: int) -> Callable[[Array, Array], tuple[Array, Array]]:
        """What is compared of states on a level with those beside it, at places within the elements of one mesh."""
        with self._lock:
            return level.seen_at(self._meshes[number])

    @functools.cached_property
    def _simple(self) -> bool:
        """Whether the numbers that change may have any values within their limits, and move no end of an element."""
        plain = (
            section for section in self.scene.sections.items() if not any(getattr(section[1], key) for key in MORE)
        )
        known = {name for name, _ in plain}
        return all(
            one.numbers is None
            and SIMPLE.fullmatch(one.name) is not None
            and (not one.name.startswith("sections.") or one.name.split(".")[1] in known)
            for one in self._arguments
        )

    def _size_of(self, values: Array, row: Array) -> float:
        """The size of the scene with values (numbers,), m, if it accepts them and its model has the data of a row.

        Else nan.
        """
        first = self._level(0)
        try:
            scene = first.arguments.scene_at(values)
            model = assemble(scene, self._meshes[0], assembly=self._assembly, scales=first.model.scales)
            kinks = ((name, breaks_of(scene, name)) for name in model.members)
            ends = all(
                np.abs(cuts[:, None] - self._meshes[0].cuts[n]).min(axis=1).max() <= EPSILON for n, cuts in kinks
            )
            return scene.size if ends and first.is_of(model, scene.analysis.steps[-1], row) else np.nan
        except (SceneError, ArithmeticError, np.linalg.LinAlgError):
            return np.nan

    @property
    def sizes(self) -> list[int]:
        """How many numbers each result has."""
        return [one.size for one in self._level(0).results.results]

    def solve(
        self,
        values: Array,
        *,
        warm: bool = False,
        threads: int = 1,
        progress: Callable[[int], object] | None = None,
    ) -> PlainAnswers:
        """Solve cases with values (cases, numbers) in the units of the scene.

        Parameters
        ----------
        warm : bool
            Whether a case begins at the nearest one that was solved before, among a few hundred.
        threads : int
        progress : callable, optional
            Called with the number of cases that turned out to be plain since the last call.
        """
        count, width = len(values), sum(self.sizes)
        found = PlainAnswers(np.zeros(count, dtype=bool), np.full((count, width), np.nan), *np.full((3, count), np.nan))
        parts = np.split(np.arange(count), range(CHUNK, count, CHUNK))

        def solved(part: Index) -> tuple[Index, PlainAnswers]:
            return part, self._chunk(values[part], nearest_before(values[part]) if warm else None)

        with ThreadPoolExecutor(threads) as pool:
            running = [pool.submit(solved, part) for part in parts]
            try:
                for future in as_completed(running):
                    part, own = future.result()
                    for name in ("known", "numbers", "errors", "residuals", "seconds"):
                        getattr(found, name)[part] = getattr(own, name)
                    if progress is not None:
                        progress(int(own.known.sum()))
            except KeyboardInterrupt:
                arrived()
                for future in running:
                    future.cancel()
                return replace(found, interrupted=True)
        return found

    # Numbers beyond all bounds are no plain case; each thread has its own way with them.
    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def _chunk(self, values: Array, near: Array | None) -> PlainAnswers:
        """Solve cases together; ``near`` (cases,) are numbers of cases before, from which they begin, -1 for none."""
        begin = time.perf_counter()
        count, first = len(values), self._level(0)
        rows, sizes = first.rows(values), np.where(first.arguments.accepted(values), self.scene.size, np.nan)
        for i in () if self._simple else np.flatnonzero(np.isfinite(sizes)).tolist():
            sizes[i] = self._size_of(values[i], rows[i])
        accepted = np.isfinite(sizes)
        chosen = np.flatnonzero(accepted)
        if near is not None:
            # Numbers among those that are accepted.
            place = np.append(np.cumsum(accepted) - 1, -1)
            near = place[np.where(accepted[near], near, -1)][chosen]
        numbers = np.full((count, first.results.size), np.nan)
        errors, residuals, known = np.full(count, np.nan), np.full(count, np.nan), np.zeros(count, dtype=bool)
        states, residuals[chosen], found = first.followed(rows[chosen], near)
        chosen, here = chosen[found], states[found]
        p, coarse = values[chosen], first
        for number in range(MESHES - 1):
            finer = self._level(number + 1) if len(chosen) else None
            if finer is None or not finer.by_core:
                break
            begun = finer.begun_at(here)
            there, left, found = finer.corrected(finer.rows(p), begun)
            turned = finer.distance(begun, there)
            (shape, rough), (finer_shape, finer_rough) = (
                self._seen(level, number)(p, states) for level, states in ((coarse, here), (finer, there))
            )
            axes = first.model.element.axes
            apart = (finer_shape - shape).reshape(len(p), shape.shape[1] // axes, axes)
            difference = np.linalg.norm(apart, axis=2).max(axis=1, initial=0.0) / sizes[chosen]
            error = remaining(difference, gain(rough, finer_rough, finer.model.element.order))
            good = found & (turned <= DRIFT)
            smooth = finer_rough <= LEFT_ALONE * TORN
            done = good & smooth & (error <= LEFT_ALONE * self.accuracy)
            if done.any():
                told = finer.told(p[done], there[done])
                fine = np.isfinite(told).all(axis=1)
                solved = chosen[done][fine]
                known[solved], numbers[solved] = True, told[fine]
                errors[solved], residuals[solved] = error[done][fine], left[done][fine]
            going = good & ~done
            chosen, here, p, coarse = chosen[going], there[going], p[going], finer
        seconds = np.full(count, (time.perf_counter() - begin) / max(count, 1))
        return PlainAnswers(known, numbers, errors, residuals, seconds)


class _Level:
    """The cases on one mesh; ``coarser`` is the model on the one before."""

    def __init__(
        self,
        scene: Scene,
        model: Model,
        arguments: Sequence[Argument],
        results: Sequence[str],
        places: Mapping[str, Sequence[float]],
        coarser: Model | None,
    ) -> None:
        self.results = Results(model, results, places)
        self.arguments = Arguments(scene, model, arguments, self.results, "plain_", needed=False)
        # The one in which no entry vanishes by chance.
        self.model = model = self.arguments.model
        self.prepared = Prepared(model)
        equations = self.prepared.equations
        self._zero = equations.start(model.loading(0.0)).flat
        self._p = ca.MX.sym("arguments", self.arguments.size)
        # Numbers of the groups whose data vary; elements are the first.
        self._varying = self.arguments.program.varying
        self._inputs = Inputs(equations, self._varying)
        self._turned = integers(self._inputs.turned)
        self.rows = self._of_rows()
        rest = self.arguments.undeformed(self._p)
        self.told = self._told_by(self.results.expression(self.arguments.program, rest))
        self._coarser, self._weight, self._counting = coarser, self.prepared.weight, self.prepared.counting
        self.by_core = equations.apart() is not None
        self._shapes = dict[int, Many]()

    # -- functions ------------------------------------------------------------------------------------

    def _of_rows(self) -> Many:
        """(arguments) -> data that vary, then what is given, as the core takes them."""
        row = self.arguments.program.row(self.arguments.given(self._p))
        return Many(ca.Function("rows", [self._p], [row]))

    def _told_by(self, expression: ca.MX) -> Many:
        """A function of arguments and state, of an expression of the program."""
        program, state = self.arguments.program, ca.MX.sym("state", self.arguments.program.states)
        p = self._p
        inner = ca.Function("inner", [p, program.state_symbol, program.symbol], [ca.densify(expression)])
        return Many(ca.Function("told", [p, state], [inner(p, state, self.arguments.given(p))]))

    def seen_at(self, mesh: Mesh) -> Callable[[Array, Array], tuple[Array, Array]]:
        """Displacements (cases, axes * places), m, and largest roughness (cases,), of values and states.

        Places are nodes, ends of members, and within elements of a mesh as in :mod:`~sfetcas.mechanics.accuracy`.
        """
        if mesh.elements not in self._shapes:
            self._shapes[mesh.elements] = self._of_shape(mesh)
        function = self._shapes[mesh.elements]

        def seen(p: Array, states: Array) -> tuple[Array, Array]:
            found = function(p, states)
            return found[:, :-1], found[:, -1]

        return seen

    def _of_shape(self, mesh: Mesh) -> Many:
        """(arguments, state) -> displacements (m) of places and within elements, axes by axes, and roughness."""
        program, expressions, model = self.arguments.program, self.arguments.expressions, self.model
        (q, y, _, _), given, n = program.parts, program.given, expressions.points
        moved = ca.reshape(expressions.displacements(q, y, given), expressions.axes, expressions.places)
        # Of rigid members it is their ends that move farthest; strains have places of their own, which are none.
        nodes = [model.segments.place(name) for name in model.nodes]
        found, gained = (
            [moved[:, nodes]],
            expressions.tangents(q, expressions.retained_places(y, given), given) - given.tangent,
        )
        for name, member in model.scene.members.items():
            if member.type != "flexible":
                continue
            part, cuts = model.elements_of(name), mesh.cuts[name]
            within = within_elements(cuts, WITHIN).ravel()
            at = Stations(model.element, model.mesh.cuts[name], np.append(within, cuts[-1]))
            count = part.stop - part.start
            own = gained[:, part.start * n : part.stop * n]
            chords = ca.mtimes(own, ca.kron(ca.DM.eye(count), ca.DM.ones(n, 1)))
            begin = ca.cumsum(ca.horzcat(moved[:, model.segments.place(model.segments.ends[name, 0])], chords), 1)
            columns = np.repeat(np.arange(len(at.xi)), n)
            rows = (at.elements[:, None] * n + np.arange(n)).ravel()
            inside = sparse(rows, columns, at.gained.ravel(), (count * n, len(at.xi)))
            found.append(begin[:, at.elements.tolist()] + ca.mtimes(own, inside))
        shown = ca.vec(ca.horzcat(*found)) * model.scales.length
        return self._told_by(ca.vertcat(shown, program.roughness))

    # -- solving --------------------------------------------------------------------------------------

    @functools.cached_property
    def begun_at(self) -> _Refining:
        """Where corrections begin: states on the mesh before, of many cases, interpolated onto this one."""
        assert self._coarser is not None
        return _Refining(self._coarser, self.model)

    def distance(self, one: Array, other: Array) -> Array:
        """Largest rotations (cases,), rad, between states."""
        components = self.model.element.components
        n = components * len(self.model.rotations.kind)
        a, b = (part[:, :n].reshape(len(part), n // components, components) for part in (one, other))
        if not self.model.space:
            return np.abs(a - b).max(axis=(1, 2), initial=0.0)
        cosine = np.abs(np.einsum("cni,cni->cn", a, b)).clip(0.0, 1.0)
        return np.asarray(2.0 * np.arccos(cosine.min(axis=1, initial=1.0)))

    def is_of(self, model: Model, factor: float, row: Array) -> bool:
        """Whether a row is that of a model at a load factor, and the data that do not vary are its own."""
        if [len(group.data) for group in model.terms] != [len(group.data) for group in self.model.terms]:
            return False
        still = [i for i in range(len(model.terms)) if i not in self._varying]
        own = [self._inputs.of(model.loading(factor), Equations(model)), *(model.terms[i].data for i in still)]
        known = [row, *(self.model.terms[i].data for i in still)]
        mine, other = (np.concatenate([part.ravel() for part in parts]) for parts in (known, own))
        return mine.shape == other.shape and bool(np.allclose(mine, other, rtol=SAME, atol=SAME * np.abs(other).max()))

    def followed(self, rows: Array, near: Array | None) -> tuple[Array, Array, Array]:
        """States, residuals, and which were found, of loads that grow from zero or from near cases."""
        return self._solved(rows, np.repeat(self._zero[None, :], len(rows), axis=0), near, follows=True)

    def corrected(self, rows: Array, states: Array) -> tuple[Array, Array, Array]:
        """States, residuals, and which were found, from states beside them."""
        return self._solved(rows, states.copy(), None, follows=False)

    def _solved(self, rows: Array, states: Array, near: Array | None, *, follows: bool) -> tuple[Array, Array, Array]:
        equations = self.prepared.equations
        apart = equations.apart()
        assert apart is not None
        assert self._counting is not None
        core, system = apart
        way, on_way = plain_way()
        way.turning, way.turned = len(self._turned), self._turned.ctypes.data
        from_near = Limits(iterations=25, most=1.5)
        limits = [limits_for_core(equations, one, self._weight) for one in (on_way, from_near)]
        found, residuals = np.zeros(len(rows), np.intc), np.zeros(len(rows))
        longest, stiffer = self._longest(rows), self._stiffer(rows)
        begun = None if near is None else integers(near)
        rows, zero = doubles(rows), doubles(self._zero)
        cases = Cases(
            cases=len(rows),
            done=0,
            follows=follows,
            row=rows.ctypes.data,
            zero=zero.ctypes.data,
            near=None if begun is None else begun.ctypes.data,
            longest=longest.ctypes.data,
            stiffer=stiffer.ctypes.data,
            state=states.ctypes.data,
            found=found.ctypes.data,
            residual=residuals.ctypes.data,
        )
        both = (limits[0][0], limits[1][0])
        core.solve_cases(system, cases, way, both, self._counting[0], self._varying)
        return states, residuals, found > 0

    def _longest(self, rows: Array) -> Array:
        """The longest step (cases,) of the way of each case, which depends on how far motions lead."""
        model, parts = self.model, self._inputs.parts
        travel = np.abs(rows[:, parts["shift"]]).max(axis=1, initial=0.0)
        vectors = rows[:, parts["vectors"]].reshape(len(rows), len(self._turned), 3)
        turned = np.linalg.norm(vectors, axis=2).max(axis=1, initial=0.0)
        driven = np.clip(np.maximum(travel / TRAVEL, turned), 1.0, FARTHEST)
        return np.asarray(1.0 / np.maximum(driven, turned if model.space else 0.0))

    def _stiffer(self, rows: Array) -> Array:
        """By how much members are stiffer (cases,) than those of the scene, at most: eigenvalues are larger by that."""
        base = np.linalg.norm(self.model.beams.stiffness, axis=2)
        if 0 not in self._varying or not (base > 0.0).any():
            return np.ones(len(rows))
        element = self.model.element
        own = rows[:, : len(base) * element.sizes[3]].reshape(len(rows), len(base), element.sizes[3])
        own = own[:, :, : base.shape[1] * element.stiffnesses].reshape(len(rows), *base.shape, element.stiffnesses)
        sizes = np.linalg.norm(own, axis=3)[:, base > 0.0] / base[base > 0.0]
        return np.ascontiguousarray(sizes.max(axis=1))


def nearest_before(values: Array) -> Index:
    """For each row (rows, numbers) a near one before it, -1 for the first; columns count over their range."""
    from scipy.spatial import KDTree

    spread = np.ptp(values, axis=0)
    scaled = values / np.where(spread > 0.0, spread, 1.0)
    found = np.full(len(values), -1, dtype=np.intp)
    # Trees of 1, 2, 4, ... rows, each for as many that come after: few trees, and a nearest one is among many.
    for first in 2 ** np.arange(int(np.ceil(np.log2(max(len(values), 2))))):
        part = slice(first, 2 * first)
        if len(scaled[part]):
            found[part] = KDTree(scaled[:first]).query(scaled[part])[1]
    return found


class _Sums:
    """Sums of a few numbers with the weights of a matrix (sums, numbers), of many cases.

    Of each case in the same order, however many there are: products of large matrices are not.
    """

    def __init__(self, matrix: Array) -> None:
        most = int((matrix != 0.0).sum(axis=1).max(initial=1))
        self._chosen = np.argsort(matrix == 0.0, axis=1, kind="stable")[:, :most]
        self._weight = np.take_along_axis(matrix, self._chosen, axis=1)

    def __call__(self, numbers: Array) -> Array:
        """Sums (cases, sums, ...) of numbers (cases, numbers, ...)."""
        more = (1,) * (numbers.ndim - 2)
        found = np.zeros((len(numbers), len(self._chosen), *numbers.shape[2:]))
        for chosen, weight in zip(self._chosen.T, self._weight.T, strict=True):
            found += weight.reshape(-1, *more) * numbers[:, chosen]
        return found


class _Refining:
    """States of one model on the next finer mesh, of many at once."""

    def __init__(self, source: Model, target: Model) -> None:
        self._source, self._target = source, target
        n, m = len(source.rotations.kind), len(target.rotations.kind)
        turn = np.zeros((m, n))
        for name, ends in target.rotations.ends.items():
            for there, here in zip(ends, source.rotations.ends[name], strict=True):
                turn[there] = np.eye(n)[here]
        for name in target.members:
            at = Stations(source.element, source.mesh.cuts[name], target.along(name))
            turns = source.rotations.turns[source.elements_of(name)][at.elements]
            chain = target.chain(name)
            turn[chain] = 0.0
            for k in range(turns.shape[1]):
                turn[chain, turns[:, k]] += at.nodal[:, k]
        for name, number in target.rotations.node_turn.items():
            own = source.rotations.node_turn[name]
            if number is not None and own is not None:
                turn[number] = np.eye(n)[own]
        self._turn = _Sums(turn)
        sizes = [len(source.positions.unknowns), len(source.row_names), source.unwrapping.count]
        self._bounds = np.cumsum([source.element.components * n, *sizes]).tolist()
        self._others = _Sums(self._probed(sizes))

    def _probed(self, sizes: list[int]) -> Array:
        """Displacements, multipliers and angles of the target, (numbers, numbers of the source), which are linear."""
        q = np.zeros((len(self._source.rotations.kind), self._source.element.components))
        if self._source.space:
            q[:, 0] = 1.0
        columns = list[Array]()
        for unit in np.eye(sum(sizes)):
            y, lam, unwrapped = np.split(unit, np.cumsum(sizes)[:-1])
            found = transferred(self._source, State(q, y, lam, unwrapped), self._target)
            columns.append(np.concatenate([found.y, found.lam, found.unwrapped]))
        count = len(self._target.positions.unknowns) + len(self._target.row_names) + self._target.unwrapping.count
        return np.array(columns).reshape(sum(sizes), count).T

    def __call__(self, states: Array) -> Array:
        components = self._source.element.components
        q = states[:, : self._bounds[0]].reshape(len(states), -1, components)
        there = self._turn(q)
        if self._source.space:
            there /= np.linalg.norm(there, axis=2, keepdims=True)
        others = self._others(states[:, self._bounds[0] :])
        return np.ascontiguousarray(np.concatenate([there.reshape(len(states), -1), others], axis=1))
