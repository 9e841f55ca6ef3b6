"""Equilibria with given touches, and the places of contact along members from their conditions.

Places are fixed while the equilibrium is solved; they follow in an outer Newton iteration on their conditions, with a
Jacobian by differences and Broyden's updates.  The mesh moves with them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..mathematics.arrays import TINY, Array
from ..mechanics.equations import Equations, State
from ..mechanics.fields import Fields, transferred
from ..mechanics.loading import Loading
from ..mechanics.mesh import Mesh, Touch, breaks_of
from ..mechanics.model import Model
from ..solvers.prepared import Prepared, Solved
from ..solvers.pseudo_transient import Drag
from .touches import Touched

__all__ = [
    "ONE_PLACE",
    "OPEN",
    "SETTLED",
    "Held",
    "Ran",
    "Settler",
    "Way",
    "carried_over",
    "free_places",
    "moved",
    "placed",
    "stretched",
]

MAKES_WAY = 0.35
"""Distance from a place of contact within which element borders are removed, share of the element."""

ONE_PLACE = 1e-7
"""Distance of places from each other, or from the end of a member, that counts as none, fraction of the length."""

CLOSE = 1e-4
"""Distance from an end of a member within which rounding hides a double root, fraction of the length."""

TOGETHER = 1e-3
"""Value of :data:`CLOSE` before another touch, or for the end of a stretch: moments there fall with the square."""

SETTLED = 1e-11
"""Step of places at which their iteration has converged, fraction of the length."""

OPEN = 1e-9
"""Singular values of the conditions that count as zero, share of the largest; differences leave 1e-10 of it."""

MISSED = 1e-6
"""Largest value of a condition, dimensionless, that counts as fulfilled once steps are short."""

MOST_STEPS = 40
"""Largest number of steps of places."""

PATIENCE = 8
"""Successive steps near an end or another touch after which a place counts as having reached it."""

ARRIVING = 0.01
"""Ratio of a step to the one before from which on it converges to a root within the member, however near to an end."""

MOST_TURN = 0.8
"""Largest rotation of a node, rad, in a correction; with a larger one the step along the way is too long."""


@dataclass(frozen=True)
class Held:
    """An equilibrium in contact.

    Attributes
    ----------
    corrected : Solved
    slopes : ndarray (places, places), optional
        Derivative of the conditions by the free places, dimensionless.
    """

    corrected: Solved
    slopes: Array | None = None

    @functools.cached_property
    def touched(self) -> Touched:
        """Evaluates forces, conditions and gaps of contact."""
        return Touched.of(self.corrected.fields)

    @property
    def prepared(self) -> Prepared:
        """The model with its touches."""
        return self.corrected.prepared

    @property
    def loading(self) -> Loading:
        """Loads and motions."""
        return self.corrected.loading

    @property
    def mesh(self) -> Mesh:
        """The mesh with its touches."""
        return self.prepared.model.mesh


@dataclass(frozen=True)
class Way:
    """A point of a way: the loading of a model there, and the distances, m, by which obstacles are moved back.

    With ``drag`` rotations since the state ``since`` are resisted, see :mod:`~sfetcas.solvers.pseudo_transient`.
    """

    loading: Callable[[Model], Loading]
    offsets: Mapping[str, float]
    since: tuple[Model, State] | None = None
    drag: float = 0.0


@dataclass(frozen=True)
class Ran:
    """A place of contact that reached an end of its member, the other place of its stretch, or another touch.

    Attributes
    ----------
    touches : tuple of Touch
    touch, place : int
        Number of the touch, and of its place: 0 or 1.
    collapsed : bool
        Whether it reached the other place of its stretch.
    met : int, optional
        Number of the touch of the same obstacle that it reached.
    """

    touches: tuple[Touch, ...]
    touch: int
    place: int
    collapsed: bool
    met: int | None = None


def placed(scene: Scene, base: Mesh, touches: tuple[Touch, ...]) -> Mesh:
    """The mesh with an element border at each place of contact; borders too near to one are removed."""
    cuts = dict(base.cuts)
    for name in {touch.member for touch in touches}:
        places = sorted({x for touch in touches if touch.member == name for x in touch.places if 0.0 < x < 1.0})
        old, breaks = cuts[name], breaks_of(scene, name)
        keep = np.ones(len(old), bool)
        for x in places:
            e = int(np.clip(np.searchsorted(old, x) - 1, 0, len(old) - 2))
            keep &= np.abs(old - x) > MAKES_WAY * (old[e + 1] - old[e])
        keep |= np.isin(old, breaks)
        far = [x for x in places if np.abs(breaks - x).min() > ONE_PLACE]
        cuts[name] = np.unique(np.concatenate([old[keep], far]))
    return replace(base, cuts=cuts, touches=touches)


def free_places(touches: tuple[Touch, ...]) -> list[tuple[int, int]]:
    """Numbers (touch, 0 or 1 for its begin or end) of the places within members, which may slide."""
    return [(i, k) for i, touch in enumerate(touches) for k, x in enumerate(touch.places) if 0.0 < x < 1.0]


def moved(touch: Touch, k: int, x: float) -> Touch:
    """The touch with its begin (k = 0) or end (1) at another fraction of the length."""
    return replace(touch, at=x) if k == 0 else replace(touch, to=x)


def stretched(scene: Scene, mesh: Mesh, touches: tuple[Touch, ...]) -> Mesh | None:
    """The mesh with its places of contact moved and the borders between them in proportion; None if they cross."""
    cuts = dict(mesh.cuts)
    for name in {touch.member for touch in touches}:
        pairs = {x: x for x in breaks_of(scene, name)}
        for old, new in zip(mesh.touches, touches, strict=True):
            if old.member == name:
                pairs |= dict(zip(old.places, new.places, strict=True))
        before = np.array(sorted(pairs))
        after = np.array([pairs[x] for x in before])
        if (np.diff(after) < 0.2 * ONE_PLACE).any():
            return None
        cuts[name] = np.interp(cuts[name], before, after)
    return replace(mesh, cuts=cuts, touches=touches)


def balanced(equations: Equations, state: State, loading: Loading) -> State:
    """The state with the multipliers of least residual, by least squares; unchanged in large models."""
    n = equations.unknowns
    if not equations.rows or equations.rows * n > 4_000_000:
        return state
    nothing = replace(state, lam=np.zeros(equations.rows))
    point = equations.at(nothing, loading)
    chosen = (equations.row >= n) & (equations.column < n)
    rows = np.zeros((equations.rows, n))
    rows[equations.row[chosen] - n, equations.column[chosen]] = point.entries[chosen]
    return replace(state, lam=np.linalg.lstsq(rows.T, -point.residual[:n], rcond=tolerances.RANK)[0])


def _carried(source: tuple[Model, State], loading: Loading, model: Model, state: State) -> State:
    """The state with nodes in their former positions also where other displacements are unknowns than before."""
    retained, known = model.positions.retained[: len(model.nodes)], set(source[0].positions.unknowns)
    new = [
        i for i in np.flatnonzero((retained >= 0).all(axis=1)) if model.positions.unknowns[retained[i, 0]] not in known
    ]
    if not new:
        return state
    fields, y = Fields(Equations(source[0]), source[1], loading), state.y.copy()
    for i in new:
        start = np.asarray(model.scene.nodes[model.nodes[i]].position, dtype=float)
        moved_by = (fields.position(model.nodes[i]) - start) / model.scales.length
        y[retained[i]] = moved_by[: retained.shape[1]]
    return replace(state, y=y)


def carried_over(
    scene: Scene, source: tuple[Model, State], before: Loading, prepared: Prepared, loading: Loading
) -> State:
    """A state of one model as the start on another mesh: same positions of nodes, closings met, least residual."""
    state = _carried(source, before, prepared.model, transferred(source[0], source[1], prepared.model))
    known = {*source[0].positions.unknowns, *(f"{node}.{axis}" for node in scene.nodes for axis in "xyz")}
    equations = prepared.equations
    return balanced(equations, equations.closed(equations.holding(state, loading), loading, known), loading)


class Settler:
    """Equilibria of one scene with given touches.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.

    Attributes
    ----------
    solves : int
        Number of equilibria with fixed places that were solved so far.
    limit : float
        Number of them at which :meth:`settle` gives up.
    """

    def __init__(self, scene: Scene, prepare: Callable[[Mesh], Prepared]) -> None:
        self.scene, self.prepare = scene, prepare
        self.solves, self.limit = 0, np.inf

    def solved(self, mesh: Mesh, source: tuple[Model, State] | None, way: Way, *, same: bool = False) -> Held | None:
        """The equilibrium with the places of contact fixed; None if Newton's method does not converge.

        It starts from ``source``, a model and its state, carried over unless the mesh is the ``same``.
        """
        if _meet(mesh):
            return None
        touches = tuple(replace(t, offset=way.offsets.get(t.contact, 0.0)) for t in mesh.touches)
        self.solves += 1
        prepared = self.prepare(replace(mesh, touches=touches))
        loading = way.loading(prepared.model)
        if source is None:
            state = prepared.equations.start(loading)
        elif same:
            state = source[1]
        else:
            state = carried_over(self.scene, source, way.loading(source[0]), prepared, loading)
        drag = None
        if way.since is not None:
            drag = Drag(prepared.equations, transferred(*way.since, prepared.model), way.drag)
        corrected = prepared.correct(state, loading, iterations=30, most=MOST_TURN, drag=drag)
        if not corrected.converged and not corrected.residual <= tolerances.BALANCED:
            return None
        return Held(corrected)

    def settle(self, mesh: Mesh, source: tuple[Model, State] | None, way: Way) -> Held | Ran | None:
        """The equilibrium with fulfilled conditions, or the place that reached an end or a touch; None for neither."""
        held = self.solved(mesh, source, way)
        if held is None:
            return None
        slopes: Array | None = None
        end: Ran | None = None
        last, size, crowded = np.inf, np.inf, 0
        for _ in range(MOST_STEPS):
            free = free_places(held.mesh.touches)
            if not free:
                return held
            if self.solves > self.limit:
                return None
            here = held.touched.conditions
            slopes = self.slopes(held, way) if slopes is None else slopes
            if slopes is None:
                return None
            step = -np.linalg.lstsq(slopes, here, rcond=OPEN)[0]
            if not np.isfinite(step).all():
                return None
            step, ran, room = _shortened(held.mesh.touches, free, step)
            near = ran is not None or _nearest(held.mesh.touches, free) is not None
            crowded = crowded + 1 if near else 0
            end = ran or end
            if ran is not None and room < 10.0 * ONE_PLACE:
                return ran
            size, before = float(np.abs(step).max()), size
            if end is not None and crowded > PATIENCE and size > ARRIVING * before:
                return _nearest(held.mesh.touches, free) or replace(end, touches=held.mesh.touches)
            if size < SETTLED:
                # Where places have no say, as along a straight rigid member, no step is no answer.
                return replace(held, slopes=slopes) if np.abs(here).max() < MISSED else None
            there = self._stepped(held, free, step, way)
            if there is None:
                return ran
            change = there.touched.conditions - here
            taken = _places(there.mesh.touches, free) - _places(held.mesh.touches, free)
            slopes = slopes + np.outer(change - slopes @ taken, taken) / max(float(taken @ taken), TINY)
            now = float(np.abs(there.touched.conditions).max())
            if now > 0.5 * last:
                slopes = None
            held, last = there, now
        return None

    def _stepped(self, held: Held, free: list[tuple[int, int]], step: Array, way: Way) -> Held | None:
        for share in (1.0, 0.3, 0.1, 0.03):
            there = self._at_places(held, free, share * step, way)
            if there is not None:
                return there
        return None

    def _at_places(self, held: Held, free: list[tuple[int, int]], step: Array, way: Way) -> Held | None:
        touches = list(held.mesh.touches)
        for (i, k), change in zip(free, step, strict=True):
            touches[i] = moved(touches[i], k, self._beside(touches[i], k, touches[i].places[k] + float(change)))
        mesh = stretched(self.scene, held.mesh, tuple(touches))
        source = held.prepared.model, held.corrected.state
        if mesh is None:
            if any(min(x, 1.0 - x) < ONE_PLACE for i, k in free for x in [touches[i].places[k]]):
                return None
            if any(touch.to is not None and touch.to - touch.at < ONE_PLACE for touch in touches):
                return None
            mesh = placed(self.scene, replace(held.mesh, touches=()), tuple(touches))
            return self.solved(mesh, source, way)
        return self.solved(mesh, source, way, same=True)

    def _beside(self, touch: Touch, k: int, x: float) -> float:
        """A place, not nearer to a load or a kink of the section than its cut may be: on the side it comes from."""
        breaks = breaks_of(self.scene, touch.member)[1:-1]
        near = breaks[np.abs(breaks - x) < 2.0 * ONE_PLACE]
        return x if not len(near) else float(near[0] + np.copysign(2.0 * ONE_PLACE, touch.places[k] - near[0]))

    def slopes(self, held: Held, way: Way) -> Array | None:
        """Derivative (places, places) of the conditions by the free places, dimensionless, by differences.

        None if an equilibrium beside the state is not found.
        """
        free, here = free_places(held.mesh.touches), held.touched.conditions
        columns = []
        for j, (i, k) in enumerate(free):
            touch = held.mesh.touches[i]
            x = touch.places[k]
            size = min(1e-6, 0.1 * min(x, 1.0 - x), 1.0 if touch.to is None else 0.1 * (touch.to - touch.at))
            for sign in (1.0, -1.0):
                step = np.zeros(len(free))
                step[j] = sign * size
                there = self._at_places(held, free, step, way)
                if there is not None:
                    break
            if there is None:
                return None
            columns.append((there.touched.conditions - here) / step[j])
        return np.column_stack(columns) if columns else np.zeros((0, 0))


def _meet(mesh: Mesh) -> bool:
    """Whether places have crossed, or are so near to each other or to an end that they have no cut of their own."""
    cuts = [(t.member, mesh.cut_at(t.member, x)) for t in mesh.touches for x in t.places if 0.0 < x < 1.0]
    turned = any(t.to is not None and t.to <= t.at for t in mesh.touches)
    at_ends = turned or any(cut in (0, len(mesh.cuts[member]) - 1) for member, cut in cuts)
    return at_ends or len(set(cuts)) < len(cuts)


def _places(touches: tuple[Touch, ...], free: list[tuple[int, int]]) -> Array:
    return np.array([touches[i].places[k] for i, k in free])


def _ahead(touches: tuple[Touch, ...], i: int, k: int, sign: float) -> tuple[float, int | None]:
    """How far it is from a place to the end of its member, or to a touch of the same obstacle before it, and which."""
    touch, x = touches[i], touches[i].places[k]
    room, met = 1.0 - x if sign > 0.0 else x, None
    for j, other in enumerate(touches):
        if j != i and (other.contact, other.member) == (touch.contact, touch.member):
            for ahead in (sign * (y - x) for y in other.places):
                room, met = (ahead, j) if 0.0 < ahead < room else (room, met)
    return room, met


def _nearest(touches: tuple[Touch, ...], free: list[tuple[int, int]]) -> Ran | None:
    """The place nearest to an end of its member or to another touch, if rounding may lead it to and fro there."""
    found = []
    for i, k in free:
        touch = touches[i]
        for sign in (1.0, -1.0):
            room, met = _ahead(touches, i, k, sign)
            inwards = touch.to is not None and (touch.places[1 - k] > touch.places[k]) == (sign > 0.0)
            if inwards and met is not None:
                continue
            close = CLOSE if met is None and touch.to is None else TOGETHER
            found.append((room / close, Ran(touches, i, k, inwards, met)))
    share, ran = min(found, key=lambda pair: pair[0])
    return ran if share <= 1.0 else None


def _shortened(touches: tuple[Touch, ...], free: list[tuple[int, int]], step: Array) -> tuple[Array, Ran | None, float]:
    """The step, shortened so that places keep their order; the place that wants beyond what is next to it; its room."""
    factor, ran, least = 1.0, None, np.inf
    for (i, k), change in zip(free, step, strict=True):
        if abs(change) < SETTLED:
            continue
        touch, x = touches[i], touches[i].places[k]
        (room, met), collapsed = _ahead(touches, i, k, float(np.sign(change))), False
        # Towards the other place of its stretch, unless that is an end of the member on the same side.
        if touch.to is not None and (touch.places[1 - k] > x) == (change > 0.0):
            room, collapsed, met = abs(touch.places[1 - k] - x), True, None
        # Half of the room again and again: a double root at its end, as of a weight that hangs over.
        if (abs(change) > 0.4 * room or room < 10.0 * ONE_PLACE) and room < least:
            ran, least = Ran(touches, i, k, collapsed, met), room
        # Two places may both move towards each other.
        factor = min(factor, 0.45 * room / abs(change))
    return factor * step, ran, least
