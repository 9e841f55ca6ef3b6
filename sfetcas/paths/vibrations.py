"""Modes at the points of a path, and flutter points: where two frequencies meet and a motion starts to grow.

1. The points of the path are transferred to a mesh with a displacement at every end of an element, as masses need it,
   and corrected there.
2. Let ``z`` be the squares of the exponents (eigenvalues).  Of two that coincide ``(z1 - z2)^2`` is smooth in the load
   and changes its sign, while the exponents behave like a square root there.  With damping the real part of an exponent
   changes its sign.  Either gives a bracketed root along the path.
3. All elements are halved until frequencies and flutter points change by less than the accuracy, relative to
   themselves.

Source: Bolotin 1963, Nonconservative problems of the theory of elastic stability; Seyranian and Mailybaev 2003,
Multiparameter stability theory with mechanical applications.
"""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass, fields, replace

import numpy as np

from .. import tolerances
from ..dynamics.modes import HALVINGS, MOST_ELEMENTS, ORDER, carried, prepared_for_motion
from ..dynamics.small_motion import SmallMotion
from ..equilibria.settings import Settings
from ..equilibria.single import finished
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh, every_other
from ..mechanics.model import Model
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.between_states import turned_between
from ..solvers.critical import ONE_EVENT, sought
from ..solvers.prepared import Prepared
from .path import FLUTTER, NO_POTENTIAL, Branch, FlutterPoint, Path, PathPoint

__all__ = ["shaken", "with_modes"]

SAMPLES = 6
"""Points of each branch whose frequencies are compared between two meshes."""

COMPLEX = 1e-5
"""Share of an exponent that both its parts have to be without damping: double ones are known to the root of rounding.

The difference is squared where it is looked for, so that a flutter point is missed by 1e-10 of the factor.
"""

BEYOND, MET = 1e-6, 1e-3
"""So far beyond a meeting, over the way between two points of the path, the difference there is at most so large.

It grows in proportion to the way, and over the whole of that becomes about one.  Two that come among the lowest from
above have their difference at once.
"""

TRIES = 3
"""Times at most that more motions are looked for, until all that grow are among them."""


def with_modes(path: Path, settings: Settings) -> Path:
    """The path with the lowest modes at each point, on a mesh fine enough for them, and with flutter points.

    Raises
    ------
    SceneError
        Nothing has mass, or Gauss integration is asked for, which masses exclude.
    SolveError
        A point of the path could not be transferred to the mesh for masses.
    """
    if settings.gauss:
        raise SceneError("integration: found 'gauss', accepted: 'nodes' with modes, as masses stand at the nodes")
    begin, scene = time.perf_counter(), path.scene
    named = settings.element or any(member.element for member in scene.members.values())
    flexible = {name for name, member in scene.members.items() if member.type == "flexible"}
    fixed = {name for name in flexible if (settings.elements or scene.members[name].elements) is not None}
    accuracy = settings.accuracy or scene.analysis.accuracy
    mesh = replace(path.model.mesh, places=True)
    if not named:
        # Of higher order than that of the path: half the elements are enough to begin with.
        cuts = {n: c if n in fixed or n not in flexible else every_other(scene, n, c) for n, c in mesh.cuts.items()}
        mesh = replace(mesh, order=max(ORDER, mesh.order), cuts=cuts)
    level, error = _Level(path, prepared_for_motion(scene, mesh)), np.inf
    for _ in range(HALVINGS if flexible else 0):
        finer = _Level(path, prepared_for_motion(scene, _halved(mesh, fixed if fixed < flexible else set())))
        error = level.difference(finer, accuracy)
        mesh = finer.prepared.model.mesh
        if fixed == flexible or error <= accuracy or 2 * mesh.elements > MOST_ELEMENTS:
            break
        level = finer
    error = error if flexible else 0.0
    asked = settings.accuracy is not None or "accuracy" in scene.analysis.model_fields_set or fixed < flexible
    short = error > accuracy and asked and path.status is Status.SOLVED
    seconds = dict(path.seconds)
    branches = tuple(level.answered(i, error) for i in range(len(path.branches)))
    seconds["solve"] += time.perf_counter() - begin
    return replace(
        path,
        status=Status.SHORT if short else path.status,
        branches=branches,
        massive=level.prepared,
        error_estimate=None
        if path.error_estimate is None or not np.isfinite(error)
        else max(path.error_estimate, error),
        notes=tuple(FLUTTER if note == NO_POTENTIAL else note for note in path.notes),
        seconds=seconds,
    )


def shaken(path: Path, branch: Branch) -> Branch:
    """A branch with modes at its points, on the mesh for the modes of its path."""
    assert path.massive is not None
    return _Level(replace(path, branches=(branch,)), path.massive).answered(0, None)


def _halved(mesh: Mesh, fixed: set[str]) -> Mesh:
    return mesh.refined({name: np.full(len(cuts) - 1, name not in fixed) for name, cuts in mesh.cuts.items()})


@dataclass(frozen=True, eq=False)
class _Place:
    """A point of the path on the mesh of the masses, and exponents of its motions: growing, still, by frequency."""

    standing: Standing
    exponents: Array


@dataclass(frozen=True, eq=False)
class _Flutter:
    """A flutter point, its frequency, dimensionless, and how many motions start to grow there."""

    standing: Standing
    omega: float
    multiplicity: int = 1


class _Level:
    """The modes of a path on one mesh, each point when it is asked for."""

    def __init__(self, path: Path, prepared: Prepared) -> None:
        self.path, self.prepared = path, prepared
        self.curve = Curve(prepared, path.unit)
        self.count = path.scene.analysis.count_of_modes
        self._places: dict[tuple[int, int], _Place] = {}
        first = SmallMotion(self.place(0, 0).standing)
        self.time, self.damped = first.masses.time, bool(len(first.damping.value))
        # Energy makes exponents imaginary or real where nothing turns.
        self.steady = prepared.model.conservative and not len(first.gyroscopic.value)

    # -- points ---------------------------------------------------------------------------------

    def place(self, branch: int, number: int) -> _Place:
        """A point of a branch with its exponents."""
        key = branch, number
        if key not in self._places:
            standing = self._standing(branch, number)
            negative = self.path.branches[branch].points[number].negative
            self._places[key] = _Place(standing, self.exponents(standing, negative))
        return self._places[key]

    def _standing(self, branch: int, number: int) -> Standing:
        """The equilibrium of a point of the path on the mesh of the masses."""
        points = self.path.branches[branch].points
        point, curve = points[number], self.curve
        loading = curve.loading(point.factor)
        state = carried(curve.equations, transferred(self.path.model, point.state, self._model), loading)
        along = Tangent(np.zeros(curve.equations.total), 1.0 if points[-1].factor >= points[0].factor else -1.0)
        before = self._places.get((branch, number - 1))
        if before is not None:
            along.z[: curve.equations.rotation_unknowns] = turned_between(curve.equations, state, before.standing.state)
            along = replace(along, factor=point.factor - before.standing.factor)
        rough = curve.standing(state, point.factor, along, arc=point.arc)
        # Across the path, as at a limit point there may be nothing at the factor itself.
        found = curve.corrected(rough.state, point.factor, rough.tangent, point.arc)
        found = found or curve.at_factor(rough, point.factor)
        if found is None:
            detail = f"the point of the path at factor {point.factor:g} is none on the mesh of its masses"
            raise SolveError(Status.FAILED, detail, state)
        return found

    @property
    def _model(self) -> Model:
        return self.prepared.model

    def exponents(self, standing: Standing, negative: int = 0) -> Array:
        """Exponents of the lowest motions at an equilibrium, one more than asked for."""
        motion, wanted, unstable = SmallMotion(standing), self.count + 1, negative
        try:
            for _ in range(TRIES):
                found = motion.eigenmotions(wanted, unstable)
                if len(found.growing) >= negative and (len(found.exponents) == wanted or not len(found.growing)):
                    break
                unstable = max(2 * unstable, len(found.growing))
        except np.linalg.LinAlgError as error:
            detail = f"the frequencies at factor {standing.factor:g} could not be found: {error}"
            raise SolveError(Status.FAILED, detail, standing.state) from None
        alone = np.concatenate([found.growing[::-1], np.zeros(found.rigid)])
        return np.concatenate([alone, found.exponents])[:wanted]

    # -- flutter --------------------------------------------------------------------------------

    @functools.cached_property
    def flutter(self) -> dict[tuple[int, int], list[_Flutter]]:
        """Flutter points by branch and number of the point before them."""
        numbers = [(i, j) for i, branch in enumerate(self.path.branches) for j in range(len(branch.points) - 1)]
        return {} if self.steady else {key: found for key in numbers if (found := self.between(*key))}

    def between(self, branch: int, number: int) -> list[_Flutter]:
        """Flutter points between a point of a branch and the next one, in their order."""
        a, b = self.place(branch, number), self.place(branch, number + 1)
        before, after = self.growing(a.exponents), self.growing(b.exponents)
        met = [point for rank in range(before, after) if (point := self._met(a, b, rank, after)) is not None]
        apart, found = ONE_EVENT * (b.standing.arc - a.standing.arc), list[_Flutter]()
        for point in sorted(met, key=lambda point: point.standing.arc):
            if found and point.standing.arc - found[-1].standing.arc <= apart:
                found[-1] = replace(found[-1], multiplicity=found[-1].multiplicity + 1)
            else:
                found.append(point)
        return found

    def growing(self, exponents: Array) -> int:
        """Number of motions that grow while they oscillate."""
        sizes = np.abs(exponents)
        share = tolerances.REAL if self.damped else COMPLEX
        return int(((exponents.real > share * sizes) & (exponents.imag > COMPLEX * sizes)).sum())

    def _met(self, a: _Place, b: _Place, rank: int, after: int) -> _Flutter | None:
        """Where between two points more than so many motions start to grow; None where these came from above.

        ``after``: how many grow at the second point.
        """
        value = _Crossing(self, rank) if self.damped else _Meeting(self, rank, after)
        # The second point first: it says which two are to meet.
        value(b.standing)
        found = sought(self.curve, a.standing, b.standing, value)
        if found is None:
            return None
        way = b.standing.arc - a.standing.arc
        beyond = self.curve.between(a.standing, b.standing)(min(found.arc - a.standing.arc + BEYOND * way, way))
        # On this side there may be two others that are alike.
        if beyond is None or not -MET <= value(beyond) < 0.0:
            return None
        value(found)
        return _Flutter(found, value.omega)

    # -- comparing ------------------------------------------------------------------------------

    def difference(self, fine: _Level, enough: float) -> float:
        """Largest relative difference of sampled frequencies and, where that is small enough, of flutter points."""
        largest = 0.0
        for i, branch in enumerate(self.path.branches):
            plain = [j for j, point in enumerate(branch.points) if not point.kind]
            chosen = np.unique(np.linspace(0, len(plain) - 1, SAMPLES).round().astype(int)).tolist() if plain else []
            for j in chosen:
                largest = max(largest, self._apart(self.place(i, plain[j]), fine.place(i, plain[j])))
        if largest > enough:
            return largest
        for key, ours in self.flutter.items():
            theirs = fine.between(*key)
            if len(ours) != len(theirs):
                return np.inf
            for one, other in zip(ours, theirs, strict=True):
                factors = one.standing.factor, other.standing.factor
                largest = max(largest, abs(factors[0] - factors[1]) / max(map(abs, factors)))
        return largest

    @functools.cached_property
    def _least(self) -> float:
        """Square of the lowest frequency at the begin: near critical points relative differences say nothing."""
        squares = np.abs(self.place(0, 0).exponents) ** 2
        return float(squares[squares > 0.0].min(initial=np.inf))

    def _apart(self, one: _Place, other: _Place) -> float:
        """Half the difference of squares, relative: that of the frequencies, but for such as are nearly zero."""
        a, b = (place.exponents[: self.count] for place in (one, other))
        if len(a) != len(b):
            return np.inf
        sizes = np.maximum(np.abs(b) ** 2, self._least)
        return float((0.5 * np.abs(a**2 - b**2) / sizes).max(initial=0.0))

    # -- answers --------------------------------------------------------------------------------

    def answered(self, number: int, error: float | None) -> Branch:
        """The branch with its frequencies and flutter points."""
        branch = self.path.branches[number]
        points = tuple(self._point(point, self.place(number, i)) for i, point in enumerate(branch.points))
        found = [point for (i, _), points in self.flutter.items() if i == number for point in points]
        met = tuple(self._entry(point, error) for point in found)
        return replace(branch, points=points, flutter_points=met)

    def _point(self, point: PathPoint, place: _Place) -> PathPoint:
        exponents = place.exponents[: self.count]
        growth = np.where(np.abs(exponents.real) > tolerances.REAL * np.abs(exponents), exponents.real, 0.0)
        return replace(point, omega=exponents.imag / self.time, growth=growth / self.time)

    def _entry(self, point: _Flutter, error: float | None) -> FlutterPoint:
        at = point.standing
        estimate = error if error is not None and np.isfinite(error) else None
        count = point.multiplicity
        notes = (f"{count} motions start to grow at once",) if count > 1 else ()
        entry = finished(at, error_estimate=estimate, notes=notes)
        parts = {part.name: getattr(entry, part.name) for part in fields(entry)}
        return FlutterPoint(**parts, omega=point.omega / self.time)


class _Meeting:
    """Without damping: the square of the difference of two squared exponents, relative, below zero beyond the meeting.

    Attributes
    ----------
    omega : float
        Frequency in the middle of the two, of the last call.
    """

    def __init__(self, level: _Level, rank: int, after: int) -> None:
        self._level, self._rank, self._after = level, rank, after
        self._middle, self.omega = -np.inf, 0.0

    def __call__(self, standing: Standing) -> float:
        exponents = self._level.exponents(standing)
        squares, growing = exponents**2, self._level.growing(exponents)
        if growing > self._rank:
            sizes = np.abs(exponents)
            grow = (exponents.real > COMPLEX * sizes) & (exponents.imag > COMPLEX * sizes)
            # Of those that grow the last one is that which starts here.
            newest = squares[grow][np.argsort(-exponents[grow].real, kind="stable")[self._rank]]
            # What is beyond is to tell which two of those before are to meet.
            middle = self._middle = float(newest.real)
            value = -4.0 * float(newest.imag) ** 2
        else:
            real = np.sort(squares[np.abs(squares.imag) <= 2.0 * COMPLEX * np.abs(squares)].real)
            # Where several pairs meet at once, as in space, the halves of a group do.
            half = self._after - growing
            groups = np.lib.stride_tricks.sliding_window_view(real, 2 * half) if len(real) >= 2 * half else None
            if groups is None:
                return 1.0
            group = groups[np.argmin(np.abs(groups.mean(axis=1) - self._middle))]
            middle, value = float(group.mean()), float(group[half:].mean() - group[:half].mean()) ** 2
        self.omega = float(np.sqrt(max(-middle, 0.0)))
        return value / max(middle**2, TINY)


class _Crossing:
    """With damping: the real part of the exponent that starts to grow, relative to its size, below zero beyond that."""

    def __init__(self, level: _Level, rank: int) -> None:
        self._level, self._rank = level, rank
        self.omega = 0.0

    def __call__(self, standing: Standing) -> float:
        exponents = self._level.exponents(standing)
        waves = exponents[exponents.imag > COMPLEX * np.abs(exponents)]
        shares = -waves.real / np.abs(waves)
        if len(waves) <= self._rank:
            return 1.0
        chosen = np.argsort(shares, kind="stable")[self._rank]
        self.omega = float(waves[chosen].imag)
        return float(shares[chosen])
