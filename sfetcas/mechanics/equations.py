"""The stationarity equations of a model in rotations about the fixed axes, and their Newton matrix.

Unknown increments are a rotation vector for each free rotation (an angle in the plane, one number about the axis of a
hinge to the ground), the displacement unknowns, and the multipliers of loop closures and joints.  Rotations are updated
by ``q <- exp(phi/2) q``, so that quaternions keep their norm and need neither constraints nor multipliers.

IPOPT solves the same problem in another form, with quaternion components and norms as constraints; Newton's method, the
certificate and continuation use this one.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import tolerances
from ..mathematics import interpolation, quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.core import Border, Counting, Curve, Limits, Report, Way, doubles, integers
from ..mathematics.kernels import Kernels, chosen
from ..mathematics.linear import CoreSystem, SparseSolver
from .batches import GroupBatch, at_rest
from .evaluation import UNLOADED, CoreModel, CorePoint, core_model
from .inertia_loads import along_rigid, couples_along, put_moments, without_rigid
from .layout import Layout, layout_of
from .load_terms import present
from .loading import Loading
from .model import Model
from .reactions import Reactions
from .rotations import RotationFreedom
from .terms import Group, pulls_of, rotation_gradient

__all__ = [
    "MOST_ROWS",
    "Equations",
    "Point",
    "State",
    "gained_tangents",
    "scaled_strains",
    "turned_points",
    "turned_tangents",
    "yielded",
]

MOST_CLOSED = 4_000_000
"""Entries of a matrix of closings up to which displacements are chosen by them."""

MOST_ROWS = 100
"""Up to so many rows the core finds whether they depend on each other, which takes the third power of their number."""


@dataclass(frozen=True)
class State:
    """A trial state, dimensionless.

    Attributes
    ----------
    q : ndarray (rotations, 4 or 1)
        Unit quaternions or angles since the undeformed scene.
    y : ndarray (displacement unknowns,)
    lam : ndarray (rows,)
        Multipliers of the loop closures, then of the rows of joints.
    unwrapped : ndarray (angles,)
        Reference values, rad, by which the turns of angles are counted, see
        :class:`~sfetcas.mechanics.unwrapping.Unwrapping`.
    """

    q: Array
    y: Array
    lam: Array
    unwrapped: Array

    @property
    def flat(self) -> Array:
        """All of it as one vector (states,), see :meth:`Equations.state`."""
        return np.concatenate([self.q.ravel(), self.y, self.lam, self.unwrapped])


@dataclass(frozen=True)
class Point:
    """The equations evaluated at a state, dimensionless.

    Attributes
    ----------
    potential, strain : float
        Potential energy (that of loads zero in the undeformed scene) and its elastic part.
    residual : ndarray (unknowns + rows,)
        Out-of-balance moments and forces, then gaps of the constraints.
    scale : ndarray (unknowns + rows,)
        Reference for the rounding error of each residual: the sum of the magnitudes of moments and forces at the node,
        plus a hundredth of its stiffness; 1 for gaps.
    entries : ndarray
        Entries of the Newton matrix, in the order of ``Equations.row`` and ``Equations.column``.
    rotation_jacobian : ndarray (elements, moments of the nodes, axes), optional
        Derivatives of the chords of elements by rotations of their nodes; the core keeps these to itself.
    """

    potential: float
    strain: float
    residual: Array
    scale: Array
    entries: Array
    rotation_jacobian: Array | None = None


class Equations:
    """The stationarity equations of one model, prepared for repeated evaluation.

    Attributes
    ----------
    unknowns, rows, total : int
        Number of rotation and displacement unknowns, of constraint rows, and their sum.
    rotation_unknowns, displacement_unknowns : int
    number : ndarray (rotations, width)
        Unknown of each component of a rotation, see :class:`~sfetcas.mechanics.tables.Tables`.
    layout : Layout
        What the structure alone says of the equations.
    row, column, diagonal : ndarray
        Rows and columns of the entries of the Newton matrix; which of them are on the diagonal.
    noise : ndarray (total,)
        Reference for rounding errors of each residual in the unloaded scene: a hundredth of stiffness; 1 for gaps.
    """

    def __init__(self, model: Model, *, kernels: Kernels = "auto", evaluations: float = 12.0) -> None:
        self.model = model
        # Whether rows depend on each other where Newton's method began; looked for when it does.
        self.redundant: bool | None = None
        # The last entries of the matrix for which that was asked, how exactly, and what was found, each time.
        self.loose: list[tuple[Array, float, Array]] = []
        self.layout = layout = layout_of(model)
        self.tables = tables = layout.tables_of(model)
        self.row, self.column, self.diagonal = layout.row, layout.column, layout.diagonal
        self.number, self.place_number = tables.number, tables.place_number
        self.rotation_unknowns, self.displacement_unknowns = tables.rotation_unknowns, tables.displacement_unknowns
        self.unknowns, self.rows, self.total = tables.unknowns, tables.rows, tables.total
        self._owner, self._first = model.segments.owner, model.segments.first
        # Elements are what there may be thousands of: their functions alone are worth compiling.
        self._terms = [
            _Terms(layout, model, number, kernels if number == 0 else "interpreted", evaluations)
            for number in range(len(model.terms))
        ]
        self._given: list[tuple[Loading, Array]] = []
        # Limits of corrections as the core takes them, and what these point to.
        self.limits: dict[Any, tuple[Limits, tuple[Array, ...]]] = {}
        self.noise = np.zeros(self.total)
        self._core = core_model(layout, model, self.noise) if kernels in ("auto", "core") else None
        self._judge()

    def _judge(self) -> None:
        """What rounding leaves of each residual in the unloaded scene."""
        # A hundredth of the stiffness against turning a node: 1e-14 of it is what rounding of rotations leaves.
        self.noise[...] = np.abs(self._elastic_diagonal()) * 0.01
        for group in self._terms[1:]:
            group.add_noise(self.noise)
        # Sections turn: about any fixed axis rounding is that of the stiffest one, also where nothing resists a turn.
        free = self.number[(self.number >= 0).all(axis=1)]
        self.noise[free] = self.noise[free].max(axis=1, keepdims=True)
        retained = self.layout.retained
        self.noise[retained] = self.noise[retained].max(axis=1, keepdims=True)
        self.noise[self.unknowns :] = 1.0

    def remembering(self, model: Model) -> Equations:
        """The same equations of a model that differs by what its members remember alone."""
        return self._with(model, [i for i, group in enumerate(model.terms) if group.kind.memory])

    def with_data(self, data: Mapping[int, Array]) -> Equations:
        """The same equations with other data (n, width) of groups of terms, by their numbers."""
        return self._with(self.model.with_data(data), data)

    def _with(self, model: Model, changed: Collection[int]) -> Equations:
        """The same equations of a model that differs by the data of groups of terms."""
        found = copy.copy(self)
        for made in ("_convex", "undeformed_entries"):
            found.__dict__.pop(made, None)
        found.model, found.tables, found._given = model, self.layout.tables_of(model), []
        found._core = None if self._core is None else self._core.of(model)
        found._terms = [
            _Terms(self.layout, model, i, "interpreted", 1.0) if i in changed else terms
            for i, terms in enumerate(self._terms)
        ]
        return found

    @functools.cached_property
    def elastic_displacements(self) -> Index:
        """Indices of the displacement unknowns that springs, small members and joints act on."""
        return self._acted_upon(lambda group: group.kind.has_potential)

    @functools.cached_property
    def worked_displacements(self) -> Index:
        """Indices of the displacement unknowns with entries in the second variation.

        Those of :attr:`elastic_displacements`, and with pressure also those that it does work on.
        """
        every = self.model.conservative and not self.model.has_potential
        return self._acted_upon(lambda group: every or group.kind.has_potential)

    def _acted_upon(self, chosen: Callable[[Group], bool]) -> Index:
        tables = self.tables
        sides = [part for group, part in zip(self.model.terms, tables.sides, strict=True) if chosen(group)]
        unknown = tables.unknown[np.concatenate([part[part >= 0] for part in sides])]
        return np.unique(unknown[unknown >= self.rotation_unknowns])

    def symmetric(self, point: Point) -> Point:
        """The point with the symmetric part of the Newton matrix; only under pressure is that another matrix."""
        if self.model.has_potential:
            return point
        return replace(point, entries=0.5 * (point.entries + point.entries[self.layout.transposed]))

    @functools.cached_property
    def mass(self) -> Array:
        """Length of member at each rotation unknown (n,), dimensionless: weights for mesh-independent norms."""
        model = self.model
        lump = np.zeros(len(model.rotations.kind))
        w = model.beams.weight
        if model.element.gauss:
            w = w.sum(axis=1, keepdims=True) * interpolation.lobatto(model.element.order + 1)[1]
        np.add.at(lump, model.rotations.turns.ravel(), w.ravel())
        for name, member in model.scene.members.items():
            if member.type == "small":
                share = model.scene.center_lines[name].length / model.scales.length / len(member.nodes)
                np.add.at(lump, list(model.rotations.ends[name]), share)
        # What turns with nothing that has a length.
        lump = np.maximum(lump, 1e-6)
        mass = np.zeros(self.rotation_unknowns)
        used = self.number >= 0
        mass[self.number[used]] = np.broadcast_to(lump[:, None], self.number.shape)[used]
        return mass

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the constraint rows: loop closures, then joints."""
        return self.model.row_names

    # -- sums -----------------------------------------------------------------------------------

    def _matrix(self, values: list[Array], ties: float = 1.0) -> Array:
        """Entries of the matrix from those that the terms give, in the order of their tables.

        After them come the ties between displacements and loop closures, and the whole diagonal.
        """
        layout = self.layout
        given = np.concatenate([*(part.ravel() for part in values), [ties, 0.0]])
        # Without any unknown the sum is of whole numbers.
        found = np.bincount(layout.to_entry, weights=given[layout.entry] * layout.weight, minlength=len(self.row))
        return found.astype(float, copy=False)

    def _gathered(self, parts: list[Array]) -> Array:
        """What the terms give on their sides, added up on the unknowns."""
        given = np.concatenate([part.ravel() for part in parts])[self.layout.used]
        return self._added(given * self.layout.share)

    def _added(self, given: Array) -> Array:
        """Numbers on the used sides added up on the unknowns; without any the sum is of whole numbers."""
        return np.bincount(self.layout.onto, weights=given, minlength=self.total).astype(float, copy=False)

    # -- evaluation -----------------------------------------------------------------------------

    def state(self, flat: Array) -> State:
        """The state of a vector (states,): rotations, displacements, multipliers, values near which angles count."""
        count, components = len(self.model.rotations.kind), self.model.element.components
        q, y, lam, unwrapped = np.split(flat, self.parts)
        return State(q.reshape(count, components), y, lam, unwrapped)

    @property
    def parts(self) -> list[int]:
        """Where displacements, multipliers, and values near which angles count begin in the vector of a state."""
        count, components = len(self.model.rotations.kind), self.model.element.components
        return np.cumsum([count * components, self.displacement_unknowns, self.rows]).tolist()

    def start(self, loading: Loading) -> State:
        """The undeformed state, with prescribed rotations at their values."""
        unwrapping = self.model.unwrapping
        unwrapped = unwrapping.prescribed(self.model.rotations.kind, loading)
        unwrapped = np.where(np.isnan(unwrapped), unwrapping.of_vectors(loading.turn), unwrapped)
        return State(
            self.model.prescribed_rotations(loading.turn),
            np.zeros(self.displacement_unknowns),
            np.zeros(self.rows),
            unwrapped,
        )

    def holding(self, state: State, loading: Loading) -> State:
        """The state with prescribed rotations set to their values."""
        q = np.where(
            (self.model.rotations.kind == RotationFreedom.FIXED)[:, None],
            self.model.prescribed_rotations(loading.turn),
            state.q,
        )
        if not self.model.unwrapping.count:
            return replace(state, q=q)
        unwrapped = self.model.unwrapping.prescribed(self.model.rotations.kind, loading)
        return replace(state, q=q, unwrapped=np.where(np.isnan(unwrapped), state.unwrapped, unwrapped))

    def closed(self, state: State, loading: Loading, known: Collection[str]) -> State:
        """The state with displacements chosen such that the closings are met best; those of ``known`` names stay."""
        n, positions = self.unknowns, self.model.positions
        rows, new = len(positions.rows), [i for i, name in enumerate(positions.unknowns) if name not in known]
        if not rows or not new or rows * len(new) > MOST_CLOSED:
            return state
        gaps = self.at(state, loading).residual[n : n + rows]
        y = state.y.copy()
        y[new] -= np.linalg.lstsq(positions.W.full()[:, new], gaps, rcond=tolerances.RANK)[0]
        return replace(state, y=y)

    @functools.cached_property
    def slid_places(self) -> Index:
        """Numbers of the unknowns that say where on a member something slides."""
        names = enumerate(self.model.positions.unknowns)
        return np.array([self.rotation_unknowns + i for i, name in names if name.endswith(", arc length")], np.intp)

    def segment_pulls(self, lam: Array, loading: Loading) -> Array:
        """Minus the constant part of the internal force of each segment, (segments, axes), dimensionless."""
        return self._closing_pulls(lam) - self._hanging_pulls(loading)

    def strings(self, state: State, loading: Loading, *, along: bool = False) -> Array:
        """What strings between nodes of elements take over from these, as a pull, (elements, axes), dimensionless.

        Of what is ``along`` single elements at their starts, as rings; it is linear in the loads and the multipliers.
        """
        model = self.model
        found, first = np.zeros((len(self._owner), model.element.axes)), len(model.positions.rows)
        if not self._strings[along]:
            return found
        places = self.retained_places(state, loading)
        for number, batch in self._strings[along].items():
            group = model.connections[number]
            lam = state.lam[first + group.labels.ravel()]
            pull = batch(state.q, places, state.unwrapped, loading.loads[number], lam)[0]
            for k in range(group.kind.spans or 1):
                np.add.at(found, group.elements + k, pull)
        return found

    @functools.cached_property
    def _strings(self) -> tuple[dict[int, GroupBatch], dict[int, GroupBatch]]:
        """Functions of the pulls of what spans elements, and of what pulls along them, by number of group."""
        groups = list(enumerate(self.model.connections))
        spanning = {i: GroupBatch(self.model, group, pulls_of(group.kind)) for i, group in groups if group.kind.spans}
        along = {i: GroupBatch(self.model, group, pulls_of(group.kind)) for i, group in groups if group.kind.pulls}
        return spanning, along

    def _closing_pulls(self, lam: Array) -> Array:
        positions = self.model.positions
        return np.asarray(
            (positions.Z.T @ lam[: len(positions.rows)]).reshape(len(self._first), self.model.element.axes)
        )

    def _hanging_pulls(self, loading: Loading) -> Array:
        """What forces on places do that hang on segments."""
        return np.asarray(
            (self.model.positions.E.T @ loading.force.ravel()).reshape(len(self._first), self.model.element.axes)
        )

    def displacements(self, state: State, loading: Loading, gained: Array) -> tuple[Array, Array]:
        """Displacements of the places (places * axes,) and gaps of the loop closures (closings,), dimensionless.

        ``gained`` (elements, axes) are the changes of the chords of the elements.
        """
        positions, delta = self.model.positions, self._chords(gained)
        nodal = positions.E @ delta + positions.Y @ state.y + positions.B @ loading.shift
        return nodal, positions.Z @ delta + positions.W @ state.y + positions.BZ @ loading.shift

    def _chords(self, gained: Array) -> Array:
        """Changes of the chords of the segments, (segments * axes,)."""
        return np.add.reduceat(gained, self._first, axis=0).ravel() if len(gained) else np.zeros(0)

    def retained_places(self, state: State, loading: Loading) -> Array:
        """Displacements (places, axes), dimensionless, of retained places, unknown or prescribed; else undefined."""
        return self._retained(state, self.given(loading))

    def _retained(self, state: State, given: Array) -> Array:
        moved = self.model.positions.Y @ state.y + given[self.layout.given["shift"]]
        return np.asarray(moved.reshape(len(self.model.segments.places), self.model.element.axes))

    def _pulls(self, given: Array) -> Array:
        """Minus the internal forces (elements, points, axes) that loads cause."""
        return given[self.layout.given["pull"]].reshape(*self.model.beams.weight.shape, self.model.element.axes)

    def _evaluated(self, state: State, given: Array) -> _Results:
        """Results of the terms of all groups at a state; to be read before they are evaluated again."""
        if self._core is not None:
            return _Results(self._core.evaluate(_arrays(state), given), self._core.places, self._core.pull)
        places, pull = self._retained(state, given), self._pulls(given)
        constant = self._closing_pulls(state.lam)[self._owner]
        found = [
            group(state, places, pull if number == 0 else self._loads(number - 1, given), constant)
            for number, group in enumerate(self._terms)
        ]
        return _Results(found, places, pull + constant[:, None, :])

    def _loads(self, number: int, given: Array) -> Array:
        """Loads (n, width) of a group of connections."""
        group = self.model.connections[number]
        return given[self.layout.given[f"loads {number}"]].reshape(len(group.data), group.kind.sizes[4])

    def at(self, state: State, loading: Loading, *, convex: bool = False) -> Point:
        """Evaluate the equations at a state.

        With ``convex`` the stiffness matrices of terms without constraint rows are replaced by positive semidefinite
        ones.
        """
        return self.under(state, self.given(loading), convex=convex)

    def under(self, state: State, given: Array, *, convex: bool = False) -> Point:
        """As :meth:`at`, under loads and motions in a row, of :meth:`given`."""
        if self._core is not None:
            return self._point_of(self._core.at(_arrays(state), given), convex=convex)
        positions, rotation_unknowns, part_of = self.model.positions, self.rotation_unknowns, self.layout.given
        results = self._evaluated(state, given)
        found, force, nodal = results.groups, given[part_of["force"]], results.places.ravel()
        potential = sum(float(part[0].sum()) for part in found) - float(force @ nodal)
        stored = sum(float(part[1].sum()) for part in found)
        residual = self._gathered([part[3] for part in found]) + given[part_of["beside"]]
        scale = self._gathered_sizes([part[3] for part in found], results.pull) + self.noise
        lam = state.lam[: len(positions.rows)]
        if self.displacement_unknowns:
            displacement = slice(rotation_unknowns, self.unknowns)
            residual[displacement] += positions.W.T @ lam
            sums = positions.W.T.absolute @ np.abs(lam) + positions.Y.T.absolute @ np.abs(force)
            # A node at which next to nothing acts is judged by a millionth of what acts elsewhere.
            scale[displacement] += sums + UNLOADED * sums.max(initial=0.0) + 1e-12
        if self.rows:
            gap = positions.Z @ self._chords(found[0][2]) + positions.W @ state.y + given[part_of["opening"]]
            residual[self.unknowns : self.unknowns + len(gap)] = gap
            for group, part in zip(self._terms[1:], found[1:], strict=True):
                # Several terms may share a row.
                np.add.at(residual, self.unknowns + group.rows, part[2].ravel())
        retained = self.layout.retained
        if len(retained):
            # A component along which nothing acts is judged by what acts across it.
            scale[retained] = scale[retained].max(axis=1, keepdims=True)
        for unknown, rows in self.layout.sliding:
            # What slides is judged by the whole force on it: across a member rounding leaves of it what tangents have.
            np.maximum.at(scale, unknown, np.linalg.norm(state.lam[rows], axis=1))
        rotation_jacobian = found[0][5].reshape(*self.tables.sides[0].shape, self.model.element.axes).copy()
        return Point(potential, stored, residual, scale, self._of_parts(found, convex=convex), rotation_jacobian)

    def _of_parts(self, parts: list[list[Array]], *, convex: bool) -> Array:
        """Entries of the matrix from the results of all terms."""
        pairs = zip(self._terms, parts, strict=True)
        return self._matrix([group.entries(part, convex=convex) for group, part in pairs])

    def _point_of(self, found: CorePoint, *, convex: bool = False) -> Point:
        """What the core has evaluated last."""
        assert self._core is not None
        entries = self._of_parts(self._core.parts, convex=True) if convex else found.entries
        return Point(found.potential, found.stored, found.residual, found.scale, entries)

    def corrected(
        self,
        state: State,
        given: Array,
        limits: Limits,
        *,
        tangent: Array | None = None,
        border: Border | None = None,
    ) -> tuple[State, Point, Report] | None:
        """Newton's method by the core: the last state, the equations there, and how it ended.

        None where there is no core for these equations.

        Parameters
        ----------
        state : State
            With prescribed rotations at their values.
        given : ndarray
            Loads and motions, of :meth:`given`.
        limits : Limits
            What controls the method, as the core takes it.
        tangent : ndarray (entries,), optional
            Entries of the Newton matrix for the first step.
        border : Border, optional
            The factor as a further unknown; it is changed there.
        """
        if self._with_system is None:
            return None
        core, system = self._with_system
        there, point, report = core.correct(system, _arrays(state), given, tangent, border, limits)
        return State(*there), self._point_of(point), report

    @property
    def _with_system(self) -> tuple[CoreModel, CoreSystem] | None:
        """The core's model and its system for the Newton matrix; None where one of them is not there."""
        system = self.solver.of_core
        return None if system is None or self._core is None else (self._core, system)

    def followed(
        self, state: State, tangent: Array, way: Way, limits: Limits, counting: Counting | None
    ) -> tuple[State, bool] | None:
        """Growing loads followed by the core: the last equilibrium, and whether the way ends; None without a core.

        Arguments are those of :meth:`.CoreModel.follow`.
        """
        if self._with_system is None:
            return None
        core, system = self._with_system
        there, reached = core.follow(system, _arrays(state), doubles(tangent), way, limits, counting)
        return State(*there), reached

    def trace(self, curve: Curve, limits: Limits, counting: Counting) -> None:
        """Plain steps along a curve by the core, which are written to it; it has to be one that solves for them.

        Arguments are those of :meth:`.CoreModel.trace`.
        """
        assert self._with_system is not None
        core, system = self._with_system
        core.trace(system, curve, limits, counting)

    def for_search(self, varying: Sequence[int]) -> tuple[CoreModel, CoreSystem] | None:
        """The core's model and its system for the globalised Newton method, with data of their own where these vary.

        None without a core.
        """
        if self._core is None or not self._core.searchable:
            return None
        system = (self._new_solver() if varying else self.solver).whole
        core = self._core.of(self.model) if varying else self._core
        return None if system is None else (core, system)

    def clearly_negative(self, entries: Array, counting: Counting) -> int | None:
        """Number of negative eigenvalues by the core; None without one, where one is near zero, or nobody knows."""
        if self._with_system is None:
            return None
        core, system = self._with_system
        return core.negative(system, doubles(entries), counting)

    def lowest(
        self, entries: Array, weight: Array, shift: float, least: float, dual: float
    ) -> tuple[Array, Array] | None:
        """The lowest eigenvalues (n,) of a matrix by the core, and their vectors (n, total); None without one, or where
        they are not found.  Arguments are those of :meth:`.CoreModel.lowest`.
        """
        if self._with_system is None:
            return None
        core, system = self._with_system
        return core.lowest(system, doubles(entries), weight, shift, least, dual)

    @property
    def solved_by_core(self) -> bool:
        """Whether the core solves for steps with the matrix of these equations, too: not where it has many entries."""
        return self._with_system is not None

    @property
    def by_core(self) -> bool:
        """Whether the core evaluates these equations."""
        return self._core is not None

    def given(self, loading: Loading) -> Array:
        """Loads and motions in a row, as the core takes them and linear in them: see ``sf_model``."""
        # One loading comes many times, and two of them in turns.
        for known, given in self._given:
            if known is loading:
                return given
        positions, beside = self.model.positions, np.zeros(self.total)
        force = loading.force.ravel()
        if loading.further.any():
            beside -= self._of_moments(loading.further)
        if loading.torque.any():
            beside -= self._of_torque(loading.torque)
        if self.displacement_unknowns:
            beside[self.rotation_unknowns : self.unknowns] -= positions.Y.T @ force
        pull = loading.pull - self._hanging_pulls(loading)[self._owner][:, None, :]
        shift = loading.shift
        shifts = (positions.B @ shift, positions.BZ @ shift) if shift.any() else (shift, np.zeros(len(positions.rows)))
        parts = [pull, *loading.loads, *shifts, beside]
        given = np.concatenate([part.ravel() for part in (*parts, force)])
        self._given = [(loading, given), *self._given[:1]]
        return given

    def _of_moments(self, moments: Array) -> Array:
        """Moments about the fixed axes (rotations, 3) on the unknowns."""
        tables = self.tables
        unknown = tables.unknown[: tables.of_places]
        used, given = unknown >= 0, moments[:, 3 - tables.width :].ravel() * tables.weight[: tables.of_places]
        found = np.bincount(unknown[used], weights=given[used], minlength=self.total)
        return found.astype(float, copy=False)

    def _of_torque(self, torque: Array) -> Array:
        """Couples along elements, which integrate at their nodes, on the unknowns."""
        moments = np.zeros((len(self.model.rotations.kind), 3))
        width = torque.shape[2]
        np.add.at(moments[:, 3 - width :], self.model.rotations.turns.ravel(), torque.reshape(-1, width))
        return self._of_moments(moments)

    def _gathered_sizes(self, gradients: list[Array], pull: Array) -> Array:
        """What a node adds up: moments of its terms, and within elements the forces times the length they act on."""
        sizes = np.abs(np.concatenate([part.ravel() for part in gradients]))
        carried = np.einsum("epa,ep->e", np.abs(pull), self.model.beams.weight)
        sizes[: gradients[0].size].reshape(gradients[0].shape)[...] += carried[:, None]
        return self._added(sizes[self.layout.used] * self.layout.absolute_share)

    def convex_entries(self, state: State, given: Array) -> Array:
        """Entries of the Newton matrix with the positive matrices of elements of :attr:`.Element.convex`.

        ``given`` are loads and motions in a row, of :meth:`given`.
        """
        parts = [[*part] for part in self._evaluated(state, given).groups]
        if len(parts[0][4]):
            constant = self._closing_pulls(state.lam)[self._owner]
            places, pull = self._retained(state, given), self._pulls(given)
            parts[0][4] = self._convex(state.q, places, state.unwrapped, pull, constant)[0]
        return self._of_parts(parts, convex=False)

    @functools.cached_property
    def _convex(self) -> GroupBatch:
        return GroupBatch(self.model, self.model.terms[0], self.model.element.convex)

    def slope(self, state: State, point: Point, rate: Loading) -> Array:
        """Derivative of the residual, (unknowns + rows,), along a rate of nodal loads and prescribed displacements."""
        if self._core is not None:
            return self._core.slope(_arrays(state), self.given(rate))
        given, part_of = self.given(rate), self.layout.given
        assert point.rotation_jacobian is not None
        # Forces at places pull at all segments that lead there.
        parts = [np.einsum("eca,ea->ec", point.rotation_jacobian, self._pulls(given)[:, 0])]
        places = self._retained(state, given)
        for number, group in enumerate(self._terms[1:]):
            # What loads do is linear in them.
            linear = group.kind.proportional
            load = self._loads(number, given)
            found = group(state, places, load, np.zeros(0))[3] if linear else np.zeros(group.sides.shape)
            parts.append(found.copy())
        slope = self._gathered(parts) + given[part_of["beside"]]
        slope[self.unknowns : self.unknowns + len(self.model.positions.rows)] += given[part_of["opening"]]
        return slope

    def places(self, state: State, loading: Loading) -> Array:
        """Displacements of all places at a state, (places * axes,), dimensionless."""
        gained = (turned_tangents(self.model, state) - self.model.beams.tangent).sum(axis=1)
        return self.displacements(state, loading, gained)[0]

    def shares(self, state: State, loading: Loading) -> list[Array]:
        """Generalised forces that the terms take from their surroundings at a state, dimensionless.

        For each group (n, width): moments on the rotations, then forces on the places; zero for loads.  Elements take
        the couples along them, too.
        """
        acting = self.acting(state, loading)
        found = self._evaluated(state, self.given(acting)).groups
        pairs = zip(found, self.model.terms, strict=True)
        shares = [np.zeros_like(part[3]) if group.kind.is_load else part[3].copy() for part, group in pairs]
        width = int(np.prod(acting.torque.shape[1:]))
        shares[0][:, :width] -= acting.torque.reshape(len(acting.torque), width)
        return shares

    def outer_force(self, state: State, loading: Loading) -> Array:
        """Resultant (axes,) of what acts on the system from outside but for supports and obstacles, dimensionless:
        loads, weights, and the pulls of springs, tendons and fields.
        """
        on_places, moments = self.acting(state, loading).force.copy(), np.zeros((len(self.model.rotations.kind), 3))
        for terms, share in zip(self._terms, self.shares(state, loading), strict=True):
            # Forces between members add up to zero, those of obstacles are left out.
            if terms.kind.table != "contacts":
                terms.add_forces(-share, moments, on_places)
        on_places[self.model.segments.without_position] = 0.0
        return np.asarray(on_places.sum(axis=0))

    @functools.cached_property
    def reactions(self) -> Reactions:
        """Linear maps from the forces of the terms to the reactions of the ground."""
        return Reactions(self.tables)

    def node_jacobian(self, state: State, loading: Loading, chosen: Index) -> tuple[Array, Array]:
        """Chosen displacement components of nodes (chosen,) and their derivatives (chosen, unknowns), dimensionless."""
        positions, tables = self.model.positions, self.tables
        found = self._evaluated(state, self.given(loading)).groups[0]
        sides = tables.sides[0]
        rotation_jacobian = found[5].reshape(*sides.shape, self.model.element.axes)
        maps = (
            positions.E.rows(chosen)
            .full()
            .reshape(len(chosen), len(self._first), self.model.element.axes)[:, self._owner]
        )
        values = (
            np.einsum("rea,eca->rec", maps, rotation_jacobian).reshape(len(chosen), sides.size)
            * tables.weight[sides.ravel()]
        )
        jacobian = np.zeros((len(chosen), self.unknowns))
        unknown = tables.unknown[sides.ravel()]
        np.add.at(jacobian.T, unknown[unknown >= 0], values.T[unknown >= 0])
        jacobian[:, self.rotation_unknowns :] = positions.Y.rows(chosen).full()
        return self.displacements(state, loading, found[2])[0][chosen], jacobian

    def _at_rest(self) -> tuple[State, Loading]:
        nothing = self.model.loading(0.0, 0.0)
        return replace(self.start(nothing), q=at_rest(self.model.element, len(self.model.rotations.kind))), nothing

    def _elastic_diagonal(self) -> Array:
        """The diagonal of :meth:`elastic_entries`, to which constraints add nothing."""
        entries = self.elastic_entries() if self._core is None else self.undeformed_entries
        return entries[self.diagonal]

    @functools.cached_property
    def undeformed_entries(self) -> Array:
        """Entries of the Newton matrix in the undeformed state without loads."""
        rest, nothing = self._at_rest()
        return self.at(rest, nothing).entries

    def elastic_entries(self) -> Array:
        """Entries of the Newton matrix for the strain energy of the elements alone in the undeformed state."""
        rest, nothing = self._at_rest()
        pairs = zip(self._terms, self._evaluated(rest, self.given(nothing)).groups, strict=True)
        return self._matrix([group.entries([*part[:5], 0.0 * part[5]]) for group, part in pairs], ties=0.0)

    def effective(self, state: State, loading: Loading) -> Loading:
        """The loading with follower loads evaluated at the state, as dead loads."""
        return present(self.model, state.q, self.retained_places(state, loading), loading)

    def acting(self, state: State, loading: Loading) -> Loading:
        """The effective loading, in rotating axes with the centrifugal forces."""
        found, frame = self.effective(state, loading), self.model.rotating_frame
        if frame is None:
            return found
        moment, force, couple, jump = (
            np.zeros_like(part) for part in (found.moment, found.force, found.couple, found.jump)
        )
        u, turns = self.places(state, loading).reshape(force.shape), self.model.element.turns
        for number, at in zip(frame.groups, frame.at, strict=True):
            group = self._terms[1 + number]
            forces = -group(state, u, loading.loads[number], np.zeros(0))[3]
            group.add_forces(forces, moment, force)
            put_moments(at, np.pad(forces[:, :turns], ((0, 0), (3 - turns, 0))), couple, jump)
        spread, pull, torque, rigid = found.spread, found.pull, found.torque, frame.rigid
        if rigid.mass.any():
            # What rigid members have at their ends is of the first of these groups.
            matrix = loading.loads[frame.groups[0]][0].reshape(u.shape[1], -1)
            more = along_rigid(self.model, rigid.mass, (frame.rest + u) @ matrix)
            couples = couples_along(self.model, state.q, rigid.spins, matrix[None])
            without_rigid(self.model, couples, moment, jump)
            spread, pull, torque = spread + more[0], pull + more[1], torque + couples
        return replace(
            found,
            spread=spread,
            pull=pull,
            torque=torque,
            moment=found.moment + moment,
            couple=found.couple + couple,
            jump=found.jump + jump,
            force=found.force + force,
            own=found.own + force,
        )

    # -- steps ----------------------------------------------------------------------------------

    @functools.cached_property
    def solver(self) -> SparseSolver:
        """Sparse solver for the Newton matrix."""
        return self._new_solver()

    def apart(self) -> tuple[CoreModel, CoreSystem] | None:
        """The model and a system for the core with memory of their own, for another thread; None without a core."""
        system = self._new_solver().of_core
        return None if system is None or self._core is None else (self._core.of(self.model), system)

    def _new_solver(self) -> SparseSolver:
        symmetric = self.model.has_potential
        # What lies without a force has none to rounding only with pivots: softness leaves some.
        return SparseSolver(
            self.total, self.row, self.column, self.rows, symmetric=symmetric, pivoted=bool(self.model.mesh.points)
        )

    def regularised(self, entries: Array, primal: Array, dual: float) -> Array:
        """Entries of the Newton matrix with a primal and a dual regularisation on its diagonal.

        Parameters
        ----------
        entries : ndarray
        primal : ndarray (n,)
            Added to the diagonal of the first n unknowns.
        dual : float
            Subtracted from the diagonal of all constraint rows.
        """
        found = entries.copy()
        found[self.diagonal[: len(primal)]] += primal
        found[self.diagonal[self.unknowns :]] -= dual
        return found

    @functools.cached_property
    def jacobian_entries(self) -> tuple[Index, Index, Index]:
        """Of the entries that are the Jacobian of the constraints their numbers, rows and unknowns, (n,) each."""
        chosen = np.flatnonzero((self.row >= self.unknowns) & (self.column < self.unknowns))
        return chosen, self.row[chosen] - self.unknowns, self.column[chosen]

    @functools.cached_property
    def jacobian_columns(self) -> tuple[Index, Index, Index]:
        """The Jacobian of the constraints by unknowns: where those of each begin (unknowns + 1,), rows, and entries."""
        chosen, row, column = self.jacobian_entries
        order = np.argsort(column, kind="stable")
        begins = np.searchsorted(column[order], np.arange(self.unknowns + 1))
        return integers(begins), integers(row[order]), integers(chosen[order])

    def clearly_independent(self, entries: Array, roughly: float, usual: float) -> bool:
        """Whether the core tells of a matrix that rows do not depend on each other; it is asked where these are few."""
        if self._core is None or self.rows > MOST_ROWS:
            return False
        return self._core.independent(self.jacobian_columns, doubles(entries), roughly, usual)

    def of_rows(self, entries: Array) -> Array:
        """Entries of the Newton matrix that belong to the Jacobian of the constraints; zero in place of all others."""
        return np.where((self.row >= self.unknowns) != (self.column >= self.unknowns), entries, 0.0)

    def spins(self, step: Array) -> Array:
        """Rotation vectors (rotations, turns), rad, fixed axes, of an increment of the unknowns (unknowns or more,)."""
        unknown, weight = self._of_rotations
        # What is fixed, number -1, turns by the zero at the end.
        return np.asarray(np.append(step[: self.rotation_unknowns], 0.0)[unknown] * weight)

    @functools.cached_property
    def _of_rotations(self) -> tuple[Index, Array]:
        """Unknown of each component of a rotation, -1 for none, and its weight, (rotations, turns)."""
        tables, shape = self.tables, self.number.shape
        return tables.unknown[: tables.of_places].reshape(shape), tables.weight[: tables.of_places].reshape(shape)

    def moved(self, state: State, step: Array) -> State:
        """The state after an increment (unknowns + rows,) of all unknowns and multipliers."""
        if self._core is not None:
            return State(*self._core.moved(_arrays(state), step))
        turn = self.spins(step)
        if self.model.space:
            q = quaternion.multiply(quaternion.from_rotation_vector(turn), state.q)
            q /= np.linalg.norm(q, axis=-1, keepdims=True)
        else:
            q = state.q + turn
        y = state.y + step[self.rotation_unknowns : self.unknowns]
        unwrapped = self.model.unwrapping.moved(state.q, state.unwrapped, turn, q)
        return State(q, y, state.lam + step[self.unknowns :], unwrapped)


def _arrays(state: State) -> tuple[Array, Array, Array, Array]:
    return state.q, state.y, state.lam, state.unwrapped


def turned_tangents(model: Model, state: State) -> Array:
    """Turned and strained tangents times weight and length at the integration points, (elements, points, axes),
    dimensionless.
    """
    q = turned_points(model, state.q)
    return quaternion.turned_by(q, model.beams.tangent + gained_tangents(model, state))


def turned_points(model: Model, q: Array) -> Array:
    """Rotations (elements, points, components) at the integration points."""
    element, q = model.element, q[model.rotations.turns]
    if element.gauss:
        q = np.einsum("kj,ejc->ekc", interpolation.evaluation(element.nodes, element.points), q)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True) if model.space else q)


def gained_tangents(model: Model, state: State) -> Array:
    """What strains, and where it does the curvature, add to the tangents before they are turned, times weight and
    length, (elements, points, axes), dimensionless.
    """
    element = model.element
    if not element.yielding:
        return np.zeros((1, 1, element.axes))
    by = scaled_strains(model, state.y) if element.strains else np.zeros((*model.beams.weight.shape, 0))
    if element.shifted:
        by = np.concatenate([by, curvature_changes(model, state.q)], axis=2)
    return yielded(model, by)


def yielded(model: Model, by: Array, part: slice = slice(None)) -> Array:
    """Changes (elements, points, axes) of the tangents before they are turned by strains and changes of the curvature
    (elements, points, numbers), see :attr:`.Element.yielding`.
    """
    matrices = model.beams.compliance[part]
    return np.asarray(np.einsum("ekca,ekc->eka", matrices.reshape(*by.shape, model.element.axes), by))


def curvature_changes(model: Model, q: Array) -> Array:
    """Changes of the curvature times length at the integration points, (elements, points, turns), about the fixed axes
    of the undeformed scene.
    """
    element, nodal = model.element, q[model.rotations.turns]
    slope = np.einsum("kj,ejc->ekc", interpolation.differentiation(element.nodes, element.points), nodal)
    if not model.space:
        return np.asarray(slope)
    here = np.einsum("kj,ejc->ekc", interpolation.evaluation(element.nodes, element.points), nodal)
    spin = 2.0 * quaternion.multiply(quaternion.conjugate(here), slope)[..., 1:]
    return np.asarray(spin / np.einsum("ekc,ekc->ek", here, here)[..., None])


def scaled_strains(model: Model, y: Array) -> Array:
    """Scaled strains (elements, points, axes) among the displacement unknowns; zero where a member has none."""
    retained = np.vstack([model.positions.retained, np.full((1, model.element.axes), -1)])
    return np.asarray(np.append(y, 0.0)[retained[model.segments.strains]])


@dataclass(frozen=True)
class _Results:
    """Results of the terms by groups, displacements (places, axes) that they saw, and the whole pull of elements."""

    groups: list[list[Array]]
    places: Array
    pull: Array


class _Terms:
    """The terms of one group, evaluated all at once."""

    def __init__(self, layout: Layout, model: Model, number: int, kernels: Kernels, evaluations: float) -> None:
        self.group, tables = model.terms[number], layout.tables
        self.kind, self.sides, self._unknown = self.group.kind, tables.sides[number], layout.unknown[number]
        self._closed = tables.closed if number == 0 else None
        # Elements have their multipliers from those of the loop closures.
        self.rows = layout.rows[number]
        self._of = (model, number, kernels, evaluations * len(self.group.data))

    @functools.cached_property
    def _batch(self) -> GroupBatch:
        """The terms on CasADi's machine; the core does without."""
        model, number, kernels, calls = self._of
        function = chosen(rotation_gradient(self.kind), calls, kernels)
        return GroupBatch(model, self.group, function, model.unwrapping.parts[number])

    def add_noise(self, noise: Array) -> None:
        """Judge the sides of what is stiff in some directions by the stiffest one."""
        largest, used = self.kind.stiffest(self.group.data), self._unknown >= 0
        if largest is not None:
            np.maximum.at(noise, self._unknown[used], (0.01 * largest[:, None] * used)[used])

    def __call__(self, state: State, places: Array, load: Array, constant: Array) -> list[Array]:
        """Results of :func:`~sfetcas.mechanics.terms.rotation_gradient` at a state.

        ``places`` are the displacements (places, axes), ``constant`` the multipliers of elements.
        """
        lam = constant if self._closed is not None else state.lam[self.rows]
        return self._batch(state.q, places, state.unwrapped, load, lam)

    def entries(self, found: list[Array], *, convex: bool = False) -> Array:
        """What it adds to Newton's matrix, in the order of its tables."""
        stiffness, rotation_jacobian = found[4], found[5]
        if convex and not self.kind.has_potential:
            stiffness = np.zeros_like(stiffness)
        elif convex and not self.group.labels.size:
            width = self.sides.shape[1]
            stiffness = _positive_part(stiffness.reshape(-1, width, width))
        closed = self._closed
        rotation_jacobian = (
            rotation_jacobian.ravel() if closed is None else rotation_jacobian.ravel()[closed.entry] * closed.value
        )
        return np.concatenate([stiffness.ravel(), rotation_jacobian, rotation_jacobian])

    def add_forces(self, forces: Array, moments: Array, on_places: Array) -> None:
        """Add moments and forces (n, width) on the sides to those of rotations (rotations, 3) and places, in place."""
        group, axes = self.group, on_places.shape[1]
        width = (forces.shape[1] - axes * group.places.shape[1]) // max(group.turns.shape[1], 1)
        for i, turns in enumerate(group.turns.T):
            used = turns >= 0
            np.add.at(moments[:, 3 - width :], turns[used], forces[used, i * width : (i + 1) * width])
        first = forces.shape[1] - axes * group.places.shape[1]
        for i, places in enumerate(group.places.T):
            used = places >= 0
            np.add.at(on_places, places[used], forces[used, first + i * axes : first + (i + 1) * axes])


def _positive_part(matrices: Array) -> Array:
    """Symmetric matrices (n, k, k) with the absolute values of their eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    if (values >= 0.0).all():
        return matrices
    return np.asarray(np.einsum("nij,nj,nkj->nik", vectors, np.abs(values), vectors))
