"""Modal analysis: frequencies and mode shapes of small vibrations about the equilibrium of a scene.

1. The equilibrium of the loads is found by statics; a scene without loads is undeformed, supported or not.
2. It is transferred to a mesh on which every end of an element has a displacement, as masses need it, and corrected
   there by Newton's method.
3. All elements are halved until the estimated error of the frequencies is less than the accuracy.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import tolerances
from ..contact.kept import Kept
from ..description.records import counted, nearest
from ..description.scene import Scene, check_held
from ..description.showing import notes_in_words, number_in_words, shown
from ..equilibria import statics
from ..equilibria.meshing import Meshing
from ..equilibria.settings import Settings
from ..equilibria.single import finished, solved_from
from ..equilibria.solution import Equilibrium, Viewed, heading, heading_in_words, touched_notes
from ..equilibria.stops import solve_stopped
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import TINY, Array, first_of_largest
from ..mathematics.linear import SparseSolver, smallest
from ..mathematics.threads import single_threaded
from ..mechanics.accuracy import remaining_by_order, roughness, roughness_of_change
from ..mechanics.displacements import STEP, Displacements
from ..mechanics.equations import Equations, State
from ..mechanics.fields import transferred
from ..mechanics.loading import Loading
from ..mechanics.margins import undecided
from ..mechanics.mesh import Mesh, every_other
from ..mechanics.model import assemble
from ..solvers.prepared import Prepared, Solved
from ..solvers.sides import Sides
from ..solvers.stability import Stability
from .buckling import buckling_factors
from .matrices import Matrices, matrices_of
from .small_motion import Eigenmotions, SmallMotion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..pictures.animation import Animation

__all__ = [
    "HALVINGS",
    "MOST_ELEMENTS",
    "ORDER",
    "Mode",
    "Modes",
    "carried",
    "find_modes",
    "prepared_for_motion",
    "put_on",
]

ORDER = 6
"""Polynomial order p of the elements: each halving divides the error of a frequency by about 2^(2 p)."""

HALVINGS, LEVELS = 7, 40
"""Halvings of the whole mesh, and before of what is rough on it, at most."""

MOST_ELEMENTS = 4000
"""A mesh that is halved does not grow beyond this."""

GROWN = 0.3
"""Change of a frequency by which it is none of the structure: those of elements grow by three quarters as these are
halved.
"""

BLURRED = 2e-11
"""Relative error of a frequency that rounding leaves: 5e-12 to 2e-11 on meshes of 8 to 32 elements (measured)."""

ROUGH, EXPLAINED = 2.0, 4.0
"""Relative error of a frequency over the square of the roughness of its shape: such an estimate, and the most that it
explains.  0.03 to 0.6 are usual (measured, 90 of 100), 2.3 was the largest but where symmetry makes the highest
coefficients of elements vanish.
"""

YIELDS = 1e5
"""Exponent, dimensionless, from which on it is that of what sticks and hardly gives way: about 1e6."""

ENDS = 6
"""Times that ends of lines are moved on a mesh, at most: each time the error is about squared."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode shape, normalised to a largest displacement of 1 m, or a largest rotation of 1 rad where nothing moves.

    Of displacements that differ by less than a thousandth, the first in the alphabetical order of nodes, then members,
    counts as the largest.

    Attributes
    ----------
    omega : float
        Angular frequency, rad/s.
    damping : float
        Damping ratio; negative for motions that grow.
    mass : float
        Modal mass, kg: twice the kinetic energy at a modal velocity of 1/s.
    nodes : mapping
        For each node the displacement, called ``position``, (3,) m and, where it has a rotation of its own,
        ``rotation`` (3,) rad, both in the fixed axes; complex with damping.
    members : mapping
        For each member fractions of its length ``s`` (n,) and the displacement ``position`` (n, 3) m there.
    change : ndarray (unknowns,)
        The eigenvector, normalised in the same way, from which :meth:`.Modes.along` takes the shape anywhere.
    """

    omega: float
    damping: float
    mass: float
    nodes: Mapping[str, Mapping[str, Array]] = field(repr=False)
    members: Mapping[str, Mapping[str, Array]] = field(repr=False)
    change: Array = field(repr=False)

    def __repr__(self) -> str:
        damped = f"damping ratio {self.damping:.6g}" if self.damping else ""
        return shown(self, [f"omega={self.omega:.9g} rad/s", damped, f"mass {self.mass:.6g} kg"])

    def to_dict(self) -> dict[str, Any]:
        """The shape as an entry of ``shapes`` in the JSON answer; imaginary parts have keys of their own."""
        answer: dict[str, Any] = {"mass": self.mass}
        for kind, table in (("nodes", self.nodes), ("members", self.members)):
            answer[kind] = {name: _plain(entry) for name, entry in table.items()}
        return answer


def _plain(entry: Mapping[str, Array]) -> dict[str, Any]:
    """Real parts, and imaginary ones with their own names where there are any."""
    answer = {}
    for key, values in entry.items():
        answer[key] = values.real.tolist()
        if np.iscomplexobj(values):
            answer[f"{key}_imaginary"] = values.imag.tolist()
    return answer


@dataclass(frozen=True, eq=False)
class Modes(Viewed):
    """The answer of a scene whose analysis is ``modes``.

    Attributes
    ----------
    scene : Scene
    status : Status
        SOLVED, or SHORT where the frequencies do not have the accuracy that was asked for.
    last : Equilibrium
        The equilibrium about which the structure vibrates.
    modes : tuple of Mode
        By rising frequency, without rigid-body modes.
    rigid : int
        Number of rigid-body modes: motions with mass that no stiffness resists.
    growing : tuple of float
        Growth rates, 1/s, of motions that leave an unstable equilibrium without oscillating.
    error_estimate : float
        Largest estimated relative error of the frequencies.
    motion : SmallMotion
        The linearised equations of motion, dimensionless.
    buckling : ndarray (factors,)
        Buckling factors of the loads by linear analysis from factor 0: positive ones rising, then negative ones by
        size.  Empty without loads, and for loads without potential.
    notes : tuple of str
    seconds : mapping
        Wall time of assembling and of solving, s.
    """

    scene: Scene = field(repr=False)
    status: Status
    last: Equilibrium
    modes: tuple[Mode, ...]
    rigid: int
    growing: tuple[float, ...]
    error_estimate: float
    motion: SmallMotion = field(repr=False)
    buckling: Array
    notes: tuple[str, ...]
    seconds: Mapping[str, float]

    def __repr__(self) -> str:
        found = {
            "frequencies omega": (self.omega, "rad/s"),
            "grows at a rate of": (self.growing, "1/s"),
            "buckles at factors, linear estimate:": (self.buckling, ""),
        }
        return shown(
            self,
            [*heading_in_words(self, self.motion.model), counted(len(self.modes), "mode")],
            [
                *(f"{what} {number_in_words(values, unit)}" for what, (values, unit) in found.items() if len(values)),
                f"estimated relative error {self.error_estimate:.1e}",
                *notes_in_words(self.notes),
            ],
        )

    @property
    def steps(self) -> tuple[Equilibrium, ...]:
        """The equilibrium as a tuple of one, so that all answers have ``steps``."""
        return (self.last,)

    @property
    def omega(self) -> Array:
        """Angular frequencies (modes,), rad/s."""
        return np.array([mode.omega for mode in self.modes])

    @property
    def damped(self) -> bool:
        """Whether anything depends on velocities, or a mode has a damping ratio other than zero."""
        return not self.motion.plain or any(mode.damping for mode in self.modes)

    def matrices(self) -> Matrices:
        """Mass, damping, gyroscopic, stiffness and constraint matrices of the small motions, in SI units."""
        return matrices_of(self.motion)

    def along(self, number: int, member: str, at: ArrayLike) -> dict[str, Array]:
        """A mode shape at any places along a member.

        Parameters
        ----------
        number : int
            Of the mode, counted from 0.
        member : str
        at : (n,)
            Fractions of its length.

        Returns
        -------
        dict of ndarray
            The displacement ``position`` (n, 3) m and the ``rotation`` (n, 3) rad of the sections, fixed axes, for the
            shape as it is normalised in :class:`.Mode`; complex with damping.

        Raises
        ------
        SceneError
            There is no such mode or member.
        """
        if not 0 <= number < len(self.modes):
            raise SceneError(f"found mode {number}, accepted: 0 to {len(self.modes) - 1}")
        if member not in self.scene.members:
            raise SceneError(f"found member {member!r}; {nearest(member, self.scene.members)}")
        shape, places = self.modes[number].change, np.atleast_1d(np.asarray(at, dtype=float))
        tables = [change.along(member, places) for change in _changes(self.motion, shape)]
        return {key: _joined([table[key] for table in tables]) for key in tables[0]}

    def plot(self, *, count: int | None = None) -> Figure:
        """The lowest mode shapes over the equilibrium, see ``modeshapes.mode_picture``."""
        from ..pictures.modeshapes import mode_picture

        return mode_picture(self, count=count)

    def animate(self, file: str | os.PathLike[str] | None = None) -> Animation | File:
        """The mode shapes moving through one period, see :func:`~sfetcas.pictures.animation.animation`.

        The path of the ``file`` where one is given, ``.gif`` or ``.mp4``; else what notebooks show.
        """
        from ..pictures.animation import animated

        return animated(self, file)

    def values(self) -> dict[str, Any]:
        """The quantities under ``modes`` in the JSON answer, without the shapes."""
        answer: dict[str, Any] = {"omega": self.omega.tolist(), "rigid": self.rigid}
        if self.damped:
            answer["damping"] = [mode.damping for mode in self.modes]
        if self.growing:
            answer["growing"] = list(self.growing)
        return {**answer, "buckling": self.buckling.tolist(), "error_estimate": self.error_estimate}

    def to_dict(self) -> dict[str, Any]:
        """The JSON answer."""
        return {
            **heading(self, self.motion.model),
            "steps": [self.last.to_dict()],
            "modes": {**self.values(), "shapes": [mode.to_dict() for mode in self.modes], "notes": list(self.notes)},
        }


@single_threaded
def find_modes(scene: Scene, settings: Settings) -> Modes:
    """Modal analysis of a scene.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        The equilibrium or the frequencies could not be found.
    """
    return ModalAnalysis(scene, settings).modes()


class ModalAnalysis:
    """A modal analysis: the static equilibrium, then eigenvalues on meshes that are halved until the frequencies agree.

    Raises
    ------
    SceneError
        Gauss integration is asked for; masses need integration at the nodes of the elements.
    """

    def __init__(self, scene: Scene, settings: Settings) -> None:
        if settings.gauss:
            raise SceneError("integration: found 'gauss', accepted: 'nodes' with modes, as masses stand at the nodes")
        self.scene, self.settings = scene, settings
        self.meshing = Meshing(scene, settings)
        self.accuracy = self.meshing.accuracy
        self.count = scene.analysis.count_of_modes
        self.seconds = {"model": 0.0, "solve": 0.0}
        self.rest = self._equilibrium()
        self.kept = self._kept()
        self._flexible = {name for name, member in scene.members.items() if member.type == "flexible"}

    def _equilibrium(self) -> Equilibrium | None:
        """The equilibrium of the loads; None where there are none."""
        scene = self.scene
        sprung = any(spring.rest or spring.length is not None for spring in scene.springs.values())
        everywhere = scene.gravity is not None or scene.rotating is not None
        strung = scene.stopped or any(tendon.elastic_string for tendon in scene.tendons.values())
        if not any(scene.driven) and not everywhere and not sprung and not strung and not scene.contacts:
            return None
        if not scene.contacts:
            check_held(scene)
        found = (solve_stopped if scene.stopped else statics.solve)(scene, self.settings)
        self.seconds = dict(found.seconds)
        for what in undecided(found.last.fields):
            raise SolveError(Status.KINK, f"{what}, so that no vibration is", found.last.state)
        return found.last

    def _kept(self) -> Kept | None:
        """What touches at the equilibrium; None where there is nothing that could.

        Raises
        ------
        SolveError
            The smallest vibration would change what touches, or members lie along what is not kept.
        """
        if self.rest is None or not self.scene.contacts:
            return None
        prepare = partial(prepared_for_motion, self.scene)
        kept = Kept(self.scene, prepare, self.accuracy, self.meshing.fixed, solved_from(self.rest))
        for what in kept.lines():
            detail = f"{what}, accepted with modes: places that touch, and lines on obstacles without friction"
            raise SolveError(Status.FAILED, detail, self.rest.state)
        for what in kept.undecided():
            raise SolveError(Status.KINK, f"{what}, so that no vibration is", self.rest.state)
        return kept

    def _mesh(self) -> Mesh:
        mesh = self.meshing.target
        if self.rest is not None:
            mesh = replace(mesh, cuts=self._cuts(self.rest.model.mesh), stops=self.rest.model.mesh.stops)
        return replace(mesh, order=mesh.order if self.meshing.named else ORDER, places=True)

    def _cuts(self, mesh: Mesh) -> Mapping[str, Array]:
        """The ends of elements to begin with, from the mesh of the equilibrium."""
        if self.kept is not None:
            return self.kept.cuts()
        # All elements were halved at the end, to see the error.
        fixed = self.meshing.fixed
        return {n: cuts if n in fixed else every_other(self.scene, n, cuts) for n, cuts in mesh.cuts.items()}

    def modes(self) -> Modes:
        """The modes on the finest mesh that was needed, with their estimated error.

        Raises
        ------
        SolveError
            The equilibrium could not be transferred to a mesh, or the eigenvalue problem could not be solved.
        """
        begin = time.perf_counter()
        answer, rough = self._smooth(self._mesh())
        error, difference = np.inf, np.inf
        for _ in range(HALVINGS):
            (motion, found), last, before = answer, difference, rough
            mesh = motion.model.mesh
            if not self._flexible:
                error = 0.0
                break
            # Where all is prescribed the error is that beside a mesh which only estimates it.
            prescribed = self.meshing.fixed.issuperset(self._flexible)
            finer = self._found(mesh.refined(None if prescribed else self._halved(mesh)))
            difference, after = _difference(found, finer[1]), _roughness(*finer)
            left = _remaining(found, finer[1], before, after, mesh.order)
            # What gets no nearer is rounding: the coarser mesh has less of it.
            if prescribed or difference > last or left > error:
                error = difference
                break
            answer, rough, error = finer, after, left
            if error <= self.accuracy or 2 * finer[0].model.mesh.elements > MOST_ELEMENTS:
                break
        if self.kept is not None and GROWN < difference < np.inf:
            answer, error = self._of_structure(found, finer[1], answer)
        self.seconds["solve"] += time.perf_counter() - begin
        return self._answered(*answer, error)

    def _smooth(self, mesh: Mesh) -> tuple[tuple[SmallMotion, Eigenmotions], Array]:
        """The motions, and their roughness, on a mesh whose elements are halved where they are rough."""
        answer = self._found(mesh)
        rough = _roughness(*answer)
        # One halving of all elements is to be enough.
        enough = 2.0**mesh.order * np.sqrt(self.accuracy / ROUGH)
        for _ in range(LEVELS):
            model = answer[0].model
            worst, halved = rough.max(axis=0, initial=0.0) > enough, self._halved(model.mesh)
            marks = {name: worst[model.elements_of(name)] & chosen for name, chosen in halved.items()}
            if not any(own.any() for own in marks.values()) or 2 * model.mesh.elements > MOST_ELEMENTS:
                break
            answer = self._found(model.mesh.refined(marks))
            rough = _roughness(*answer)
        return answer, rough

    def _halved(self, mesh: Mesh) -> dict[str, Array]:
        """Elements (elements,) of each member that are halved where all are: not those prescribed, nor what rests."""
        still = self.meshing.fixed | mesh.rigid
        marks = {n: np.full(len(c) - 1, n not in still) for n, c in mesh.cuts.items()}
        if self.kept is not None:
            marks = {name: marks[name] & ~resting for name, resting in self.kept.resting(mesh).items()}
        return marks

    @staticmethod
    def _of_structure(
        coarse: Eigenmotions, fine: Eigenmotions, answer: tuple[SmallMotion, Eigenmotions]
    ) -> tuple[tuple[SmallMotion, Eigenmotions], float]:
        """The motions that there are whatever the mesh, and their largest difference: elements that lie along an
        obstacle have motions of their own within them, whose frequencies grow as elements are halved.
        """
        count = min(len(coarse.exponents), len(fine.exponents))
        changes = np.abs(coarse.exponents[:count] / fine.exponents[:count] - 1.0)
        count = int(np.argmax(changes > GROWN)) if (changes > GROWN).any() else count
        motion, found = answer
        kept = replace(found, exponents=found.exponents[:count], shapes=found.shapes[:, :count])
        return (motion, kept), float(changes[:count].max(initial=0.0))

    def _found(self, mesh: Mesh) -> tuple[SmallMotion, Eigenmotions]:
        rest = self._put_on(mesh)
        motion = SmallMotion(rest)
        negative = 0 if self.rest is None else self.rest.certificate.negative
        try:
            # One more: of those with the frequency of the last one that is asked for a rule takes the shape.
            more = int(motion.plain and motion.symmetric)
            found = motion.eigenmotions(self.count + more, negative)
            if self.kept is not None and self.kept.sticks:
                slow = np.abs(found.exponents) < YIELDS
                found = replace(found, exponents=found.exponents[slow], shapes=found.shapes[:, slow])
            return motion, _by_rule(motion, found, self.count)
        except np.linalg.LinAlgError as error:
            raise SolveError(Status.FAILED, f"the frequencies could not be found: {error}", rest.state) from None

    def _put_on(self, mesh: Mesh) -> Solved:
        """The equilibrium on a mesh, in which elements end where lines do."""
        rest = put_on(self.scene, mesh, self.rest, self.kept)
        for _ in range(ENDS):
            moved = None if self.kept is None else self.kept.with_moved_ends(rest)
            if moved is None:
                break
            rest = put_on(self.scene, moved, self.rest, self.kept)
        return rest

    def _buckling(self, prepared: Prepared) -> Array:
        """Buckling factors, none where the structure cannot be unloaded."""
        # Without its loads other strings may be slack, and other places touch.
        if self.rest is None or not prepared.model.conservative or self.scene.stopped or self.scene.contacts:
            return np.zeros(0)
        try:
            return buckling_factors(prepared, self.count)
        except (SceneError, SolveError, np.linalg.LinAlgError):
            return np.zeros(0)

    def _answered(self, motion: SmallMotion, found: Eigenmotions, error: float) -> Modes:
        notes = [*touched_notes(self.scene)]
        asked = self.meshing.asked
        status = Status.SOLVED if error <= self.accuracy or not asked else Status.SHORT
        if len(found.exponents) < self.count:
            notes.append(f"{len(found.exponents)} modes found: on this mesh nothing else with mass oscillates")
        if len(found.growing):
            notes.append("the equilibrium is unstable: some motions leave it without oscillating, at the rates listed")
        if motion.model.mesh.points:
            names = ", ".join(dict.fromkeys(f"contacts.{point.contact}" for point in motion.model.mesh.points))
            notes.append(f"vibrations so small that what touches keeps touching, and nothing else begins to: {names}")
        last = self.rest
        if last is None:
            last = _undeformed(motion, bool(found.rigid))
        modes = tuple(_mode(motion, found, i) for i in range(len(found.exponents)))
        growing = tuple((found.growing / motion.masses.time).tolist())
        buckling = self._buckling(motion.rest.prepared)
        return Modes(
            self.scene, status, last, modes, found.rigid, growing, error, motion, buckling, tuple(notes), self.seconds
        )


def _undeformed(motion: SmallMotion, free: bool) -> Equilibrium:
    """The undeformed scene as an equilibrium; what is free to move is neither stable nor unstable."""
    found, stability = replace(motion.rest, residual=0.0), None
    if free:
        equations = found.equations
        shapes = np.zeros(equations.rotation_unknowns), np.zeros(equations.displacement_unknowns)
        stability = Stability("neutral", 0, 0.0, *shapes)
    return finished(found, stability, error_estimate=0.0)


def _difference(coarse: Eigenmotions, fine: Eigenmotions) -> float:
    """Largest relative difference of frequencies; what a coarse mesh does not have is as far off as can be."""
    if len(coarse.omega) != len(fine.omega) or coarse.rigid != fine.rigid:
        return 1.0
    return float(_differences(coarse, fine).max(initial=0.0))


def _differences(coarse: Eigenmotions, fine: Eigenmotions) -> Array:
    """Relative differences (n,) of as many frequencies."""
    return np.asarray(np.abs(coarse.exponents - fine.exponents) / np.maximum(np.abs(fine.exponents), TINY))


def _roughness(motion: SmallMotion, found: Eigenmotions) -> Array:
    """Roughness (n, elements) of each motion, and of the equilibrium."""
    rest = roughness(motion.rest.fields)
    shapes = [roughness_of_change(_changes(motion, shape)) for shape in found.shapes.T]
    return rest + np.array(shapes).reshape(len(shapes), len(rest))


def _remaining(coarse: Eigenmotions, fine: Eigenmotions, before: Array, after: Array, order: int) -> float:
    """Largest estimated relative error of the frequencies on the fine mesh, from the roughness (n, elements) on both;
    ``order`` is that of the elements.
    """
    if not len(after) or len(after) != len(before) or coarse.rigid != fine.rigid:
        return _difference(coarse, fine)
    differences = _differences(coarse, fine)
    # What the order of frequencies, 2 p, leaves may be too little on coarse meshes, roughness where symmetry makes it
    # vanish: the larger one counts.
    before, after = before.max(axis=1, initial=0.0), after.max(axis=1, initial=0.0)
    left = np.maximum(np.maximum(ROUGH * after**2, remaining_by_order(differences, 2 * order)), BLURRED)
    left = np.minimum(left, differences)
    # What roughness does not explain is rounding beside stiffnesses that differ by much, which grows with the mesh.
    return float(np.maximum(left, 2.0 * (differences - EXPLAINED * before**2)).max())


# -- the equilibrium on a mesh with masses -------------------------------------------------------------


def prepared_for_motion(scene: Scene, mesh: Mesh) -> Prepared:
    """The assembled model of a scene with a displacement at every end of an element, as masses need it."""
    return Prepared(assemble(scene, replace(mesh, places=True), assembly="nodal"))


def put_on(scene: Scene, mesh: Mesh, rest: Equilibrium | None, kept: Kept | None = None) -> Solved:
    """An equilibrium, or the undeformed scene (None), transferred to a mesh for masses and corrected there.

    Parameters
    ----------
    scene : Scene
    mesh : Mesh
    rest : Equilibrium or None
    kept : Kept, optional
        What touches at the equilibrium.

    Raises
    ------
    SolveError
        Newton's method does not converge there.
    """
    prepared = prepared_for_motion(scene, mesh if kept is None else replace(mesh, points=kept.points(mesh)))
    loading = prepared.model.loading(1.0 if rest is None else rest.factor)
    state = prepared.equations.start(loading)
    if kept is not None:
        state = kept.start(prepared)
    elif rest is not None:
        state = carried(prepared.equations, transferred(rest.model, rest.state, prepared.model), loading)
    found = prepared.correct(state, loading, iterations=30)
    if not found.balanced:
        detail = f"the equilibrium is none on the mesh of its masses: Newton's method left {found.residual:.1e}"
        raise SolveError(Status.FAILED, detail, state)
    return found


def carried(equations: Equations, state: State, loading: Loading) -> State:
    """The state with displacements that meet the loop closures, and multipliers that balance it in least squares."""
    positions, unknowns = equations.model.positions, equations.unknowns
    state = equations.holding(state, loading)
    if len(positions.rows):
        gaps = equations.at(state, loading).residual[unknowns : unknowns + len(positions.rows)]
        state = replace(state, y=state.y + smallest(positions.W, -gaps, np.ones(len(state.y)))[0])
    state = replace(state, lam=np.zeros(equations.rows))
    point = equations.at(state, loading)
    entries = equations.regularised(equations.of_rows(point.entries), np.ones(unknowns), tolerances.DUAL)
    symmetric = equations.model.has_potential
    solver = SparseSolver(equations.total, equations.row, equations.column, equations.rows, symmetric=symmetric)
    solver.factor(entries)
    right = np.concatenate([-point.residual[:unknowns], np.zeros(equations.rows)])
    return replace(state, lam=solver.solve(right)[unknowns:])


# -- shapes -------------------------------------------------------------------------------------------


def _by_rule(motion: SmallMotion, found: Eigenmotions, count: int) -> Eigenmotions:
    """The first motions, the shapes of those with the same frequency as :mod:`~sfetcas.solvers.sides` takes them."""
    shapes = found.shapes
    if not np.iscomplexobj(shapes) and len(found.omega):
        metric = np.append(motion.equations.mass, np.zeros(motion.unknowns - motion.equations.rotation_unknowns))
        shapes = Sides(motion.equations).in_groups(found.omega, shapes, metric, 0.0)
    return replace(found, exponents=found.exponents[:count], shapes=shapes[:, :count])


def _mode(motion: SmallMotion, found: Eigenmotions, number: int) -> Mode:
    shape, exponent = found.shapes[:, number], complex(found.exponents[number])
    tables = [_displaced(motion, part) for part in _changes(motion, shape)]
    nodes, members = (
        {
            name: {key: _joined([table[kind][name][key] for table in tables]) for key in tables[0][kind][name]}
            for name in tables[0][kind]
        }
        for kind in (0, 1)
    )
    # In the order of the alphabet: of displacements that a symmetry makes alike the first is the largest.
    ends, lines = ([table[name] for name in sorted(table)] for table in (nodes, members))
    moved = np.concatenate([entry["position"].ravel() for entry in (*ends, *lines)])
    turned = np.concatenate([np.zeros(1), *(entry["rotation"] for entry in ends if "rotation" in entry)])
    # A shape that is nearly all twist has displacements that are rounding.
    values = moved if np.abs(moved).max() > STEP * motion.model.scales.length * np.abs(turned).max() else turned
    unit = values[first_of_largest(values, 1e-3)]
    kinetic = float((shape.conj() @ (motion.mass @ shape.real + 1j * (motion.mass @ shape.imag))).real)
    scales, masses = motion.model.scales, motion.masses
    size = abs(exponent)
    return Mode(
        omega=exponent.imag / masses.time,
        damping=-exponent.real / size if abs(exponent.real) > tolerances.REAL * size else 0.0,
        mass=masses.mass * scales.length**2 * kinetic / abs(unit) ** 2,
        nodes={n: {k: v / unit for k, v in e.items()} for n, e in nodes.items()},
        members={n: {"s": motion.model.along(n), "position": e["position"] / unit} for n, e in members.items()},
        change=shape / unit,
    )


def _joined(parts: list[Array]) -> Array:
    return parts[0] if len(parts) == 1 else parts[0] + 1j * parts[1]


def _changes(motion: SmallMotion, shape: Array) -> list[Displacements]:
    """The real and, where there is one, the imaginary part of a shape."""
    parts = [shape.real] + ([shape.imag] if np.iscomplexobj(shape) else [])
    return [Displacements(motion.equations, motion.state, motion.loading, part) for part in parts]


def _displaced(
    motion: SmallMotion, moved: Displacements
) -> tuple[dict[str, dict[str, Array]], dict[str, dict[str, Array]]]:
    """Displacements (m) and rotations of nodes, and displacements along members, of a change of the unknowns."""
    model = motion.model
    nodes: dict[str, dict[str, Array]] = {}
    for name in model.nodes:
        nodes[name] = {"position": moved.position(name)}
        turned = moved.rotation(name)
        if turned is not None:
            nodes[name]["rotation"] = turned
    members = {name: {"position": moved.along(name, model.along(name))["position"]} for name in model.scene.members}
    return nodes, members
