"""Limit and bifurcation points between two points of a curve of equilibria.

At a limit point the factor has an extremum along the curve; at any other point where an eigenvalue of the energy
on the closings changes its sign, branches cross.  Both are roots of a function of the arc length - the rate of the
factor, or the eigenvalue - which the two points bracket.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from .arclength import Curve, Standing, Tangent
from .sides import Sides

__all__ = ["LARGEST_PRIMAL_FACTOR", "ONE_EVENT", "Event", "at_factors", "events_between", "root", "shapes_at", "sought"]

SHARP = 1e-10
"""Accuracy of roots, share of the arc between the two points."""

ZERO = 1e-10
"""Values of a function that count as zero, share of the smaller of its values at the two points."""

BLUR = 1e-9
"""Accuracy of eigenvalues (dimensionless) beside a bifurcation, where Newton's method wanders along its mode."""

BLURRED = 100.0
"""Multiple of the blur below which a value suffices once the bracket is shorter than :data:`ONE_EVENT`.

For eigenvalues this is what counts as neutral.
"""

ONE_EVENT = 1e-6
"""Eigenvalues that vanish within this share of the arc between the two points vanish together."""

CLOSE = 0.1
"""Distance within which a point that was computed serves as start of the next, share of the arc between the two."""

ASIDE = 0.01
"""Distance from a bifurcation point of the two points that it is interpolated from, share of the arc."""

LARGEST_PRIMAL_FACTOR = 1e6
"""Factor of the proximal term that keeps the value along the critical mode at a bifurcation point."""

TRUSTED = 0.02
"""Largest correction of an interpolated point, rad; with a larger one the point is searched along the arc instead."""

TORN = 1e-4
"""Farther than this from the points beside it, rad, and than twice the way between these, nothing is on their curve.

Rounding moves bifurcation points by 1e-5; where a curve only comes near to another one it is 5e-4 and more.
"""

SETTLED = 1e-3
"""A bifurcation point is moved by less, rad, where rounding along its mode is taken out."""

LEAP = 1e-3
"""Share of an eigenvalue at the two points that is left of it at one of them where it vanishes there.

Rounding leaves 1e-4 where stiffnesses differ by 1e9; where the points belong to different curves it is 0.1 and more.
"""

ALONG = 0.8
"""Cosine of the angle by which a curve turns at most beside a bifurcation point, as from one point to the next.

A curve that only comes near to another one folds away from it: the cosine falls to 0.1; at bifurcations it is 0.99.
"""

AROUND_LIMIT = 1e-3
"""Share of the arc on both sides of a limit point in which bifurcations are not searched."""


@dataclass(frozen=True, eq=False)
class Event:
    """A limit or bifurcation point.

    Attributes
    ----------
    kind : str
        ``limit`` or ``bifurcation``.
    standing : Standing
        The point itself.
    multiplicity : int
        Number of eigenvalues that vanish there; 1 for a limit point.
    """

    kind: Literal["limit", "bifurcation"]
    standing: Standing
    multiplicity: int = 1


def events_between(curve: Curve, a: Standing, b: Standing) -> list[Event] | None:
    """Limit and bifurcation points between two neighbouring points of the curve, in the order of the arc length.

    None where the points belong to different curves: an eigenvalue changes its sign, but vanishes nowhere between.
    """
    if a.tangent.factor * b.tangent.factor >= 0.0:
        return _bifurcations(curve, a, b)
    limit = _limit(curve, a, b)
    if limit is None:
        return []
    if abs(b.inertia.negative - a.inertia.negative) == 1:
        return [Event("limit", limit)]
    at, arc, place = curve.between(a, b), b.arc - a.arc, limit.arc - a.arc
    left = at(place - min(AROUND_LIMIT * arc, 0.5 * place)) or a
    right = at(place + min(AROUND_LIMIT * arc, 0.5 * (arc - place))) or b
    before, after = _bifurcations(curve, a, left), _bifurcations(curve, right, b)
    return None if before is None or after is None else [*before, Event("limit", limit), *after]


def _limit(curve: Curve, a: Standing, b: Standing) -> Standing | None:
    return sought(curve, a, b, lambda standing: standing.tangent.factor)


def _bifurcations(curve: Curve, a: Standing, b: Standing) -> list[Event] | None:
    before, after = a.inertia.negative, b.inertia.negative
    found: list[Event] = []
    for rank in range(min(before, after), max(before, after)):
        value = _eigenvalue(curve, rank, min(a.inertia.zero, b.inertia.zero))
        # Two eigenvalues that vanish together have the same root but for rounding: no second search to the last digit.
        together = max(ONE_EVENT * abs(value(b) - value(a)), tolerances.NEUTRAL)
        same = next((e for e in found if abs(value(e.standing)) <= together), None)
        if same is not None:
            found[found.index(same)] = replace(same, multiplicity=same.multiplicity + 1)
            continue
        standing = sought(curve, a, b, value, BLUR)
        if standing is None:
            continue
        standing = _settled(curve, a, b, standing, value)
        if standing is None:
            return None
        twin = next((e for e in found if abs(e.standing.arc - standing.arc) <= ONE_EVENT * (b.arc - a.arc)), None)
        if twin is not None:
            found[found.index(twin)] = Event("bifurcation", twin.standing, twin.multiplicity + 1)
        else:
            found.append(Event("bifurcation", standing))
    # Two complex eigenvalues whose real parts change their signs together make nothing singular.
    met = [event for event in found if curve.prepared.singular(event.standing.point, event.multiplicity)]
    return sorted(met, key=lambda event: event.standing.arc)


def _settled(
    curve: Curve, a: Standing, b: Standing, found: Standing, value: Callable[[Standing], float]
) -> Standing | None:
    """A bifurcation point without the rounding errors along its critical mode, where the matrix is singular.

    State and tangent are interpolated from a point on either side, where the matrix is regular; Newton's method then
    removes the error of the interpolation without changing the value along the mode.  None where the curve does not
    lead from one side to the other, as where it only comes near to another one: comparisons are of what is far from
    rounding, also of eigenvalues of which stiff members leave few digits.
    """
    at, place = curve.between(a, b), found.arc - a.arc
    reach = min(ASIDE * (b.arc - a.arc), 0.5 * place, 0.5 * (b.arc - found.arc))
    if reach == 0.0:
        # One of the two itself, met by chance, or as there is nothing between them.
        one, two = value(a), value(b)
        leaps = one * two < 0.0 and abs(value(found)) > LEAP * max(abs(one), abs(two))
        return None if leaps else replace(found, tangent=_mean(curve, a, b))
    left, right = at(place - reach), at(place + reach)
    if left is None or right is None or not _connected(curve, a, (left, found, right), value):
        return None
    parted = abs(value(found)) > BLURRED * BLUR
    if parted:
        # Where an imperfection parts the curve from the one that crosses it, no point is near enough.
        place = _vanishes(at, place, reach, value)
        left, right = at(place - reach), at(place + reach)
        if left is None or right is None:
            return None
        found = replace(found, arc=a.arc + place)
    tangent = _mean(curve, left, right)
    # Positions between the two points are measured along the tangent of a, as in the search for the point.
    left, right = (replace(s, tangent=_per_way(s.tangent, curve.inner(s.tangent, a.tangent))) for s in (left, right))
    state, factor = curve.predicted(left, reach, curve.bend(left, right))
    settled = curve.corrected(state, factor, a.tangent, found.arc, primal_factor=LARGEST_PRIMAL_FACTOR)
    if parted:
        # What is between the two curves is an equilibrium but for the imperfection.
        found = curve.standing(state, factor, tangent, arc=found.arc)
    close = settled is not None and curve.prepared.distance(settled.state, found.state) < SETTLED
    return replace(settled if settled is not None and close else found, tangent=tangent)


def _vanishes(
    at: Callable[[float], Standing | None], place: float, reach: float, value: Callable[[Standing], float]
) -> float:
    """Where an eigenvalue vanishes beside a place, as points to both sides of it say; the place itself where these are
    none, or too far from it.
    """
    ways = reach * np.array([-2.0, -1.0, 1.0, 2.0])
    points = [at(place + way) for way in ways.tolist()]
    values = np.array([np.nan if point is None else value(point) for point in points])
    if not np.isfinite(values).all():
        return place
    cubic = np.polynomial.Polynomial.fit(ways, values, 3)
    roots = cubic.roots()
    near = roots[(np.abs(roots.imag) < SHARP * reach) & (np.abs(roots.real) <= reach)].real
    return place + float(near[np.argmin(np.abs(near))]) if len(near) else place


def _connected(
    curve: Curve, a: Standing, three: tuple[Standing, Standing, Standing], value: Callable[[Standing], float]
) -> bool:
    """Whether three neighbouring points beyond one of a curve are on it, too, and an eigenvalue vanishes there."""
    left, found, right = three
    values = [value(standing) for standing in three]
    apart = curve.prepared.distance(left.state, right.state)
    return (
        min(values) <= 0.0 <= max(values)
        and min(curve.inner(side.tangent, a.tangent) for side in (left, right)) >= ALONG
        and max(curve.prepared.distance(side.state, found.state) for side in (left, right)) <= TORN + 2.0 * apart
    )


def _per_way(tangent: Tangent, way: float) -> Tangent:
    return replace(tangent, z=tangent.z / way, factor=tangent.factor / way)


def _mean(curve: Curve, a: Standing, b: Standing) -> Tangent:
    mean = replace(a.tangent, z=a.tangent.z + b.tangent.z, factor=a.tangent.factor + b.tangent.factor)
    return curve.normed(mean)


def _eigenvalue(curve: Curve, rank: int, neutral: int) -> Callable[[Standing], float]:
    """The eigenvalue with ``rank`` smaller ones, without the ``neutral`` ones that vanish all along the curve."""

    def value(standing: Standing) -> float:
        first, values, _ = curve.prepared.around_zero(standing.point, sharp=False)
        rest = np.sort(values[np.argsort(np.abs(values))[neutral:]])
        if first <= rank < first + len(rest):
            return float(rest[rank - first])
        return float(np.abs(values).max()) * (1.0 if rank >= first else -1.0)

    return value


def sought(
    curve: Curve, a: Standing, b: Standing, value: Callable[[Standing], float], blur: float = 0.0
) -> Standing | None:
    """The point between two others at which a function of points vanishes; its values are accurate to ``blur``.

    One of the two if the function does not change its sign.
    """
    at, arc = curve.between(a, b), b.arc - a.arc
    found: dict[float, Standing] = {0.0: a, arc: b}

    def beside(length: float) -> Standing | None:
        """The point at a length, from the nearest one computed so far; None if none is near."""
        near = min(found, key=lambda place: abs(place - length))
        share = curve.inner(found[near].tangent, a.tangent)
        if near == arc or abs(length - near) > CLOSE * arc or share < 0.5:
            return None
        return curve.corrected(*curve.predicted(found[near], (length - near) / share), a.tangent, a.arc + length)

    def function(length: float) -> float:
        curve.searched += 1
        standing = beside(length) or at(length)
        if standing is None:
            return np.nan
        found[length] = standing
        return value(standing)

    place = root(function, 0.0, value(a), b.arc - a.arc, value(b), blur)
    return found.get(place)


def root(function: Callable[[float], float], a: float, fa: float, b: float, fb: float, blur: float = 0.0) -> float:
    """A root of a function between a and b, where its values are fa and fb; the better end without a change of sign.

    Inverse quadratic interpolation where it can be trusted; a straight line through the last two points on one side,
    where that shortens the step, as at the kink that the lower of two eigenvalues has where both vanish; bisection
    otherwise.  The search ends where the function is not finite, and where its value is within ``blur`` of zero.

    Source: Chandrupatla 1997, A new hybrid quadratic/bisection algorithm.
    """
    if a == b or fa * fb >= 0.0 or not np.isfinite(fa * fb):
        return a if abs(fa) < abs(fb) else b
    # b is the latest place, a the other end of the bracket.
    least_value = max(ZERO * min(abs(fa), abs(fb)), blur)
    tolerance, share = SHARP * abs(b - a), min(max(fa / (fa - fb), 0.05), 0.95)
    for _ in range(60):
        x = a + share * (b - a)
        fx = function(x)
        if not np.isfinite(fx):
            break
        if fx * fa >= 0.0:
            c, fc, a, fa = a, fa, x, fx
        else:
            c, fc, b, fb, a, fa = b, fb, a, fa, x, fx
        least = tolerance / max(abs(b - a), TINY)
        known = blur and abs(fa) <= BLURRED * blur and least > SHARP / ONE_EVENT
        if abs(fa) <= least_value or least > 0.5 or known:
            break
        line = fa / (fc - fa) * (a - c) / (b - a) if fc * fa > 0.0 and fc != fa else 1.0
        share = line if 0.0 < line * abs(b - a) < 0.5 * abs(a - c) else 0.5
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        if 1.0 - np.sqrt(1.0 - xi) < phi < np.sqrt(xi):
            share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        share = min(1.0 - least, max(least, share))
    return a if abs(fa) < abs(fb) else b


def at_factors(curve: Curve, points: list[Standing], factors: tuple[float, ...]) -> list[Standing]:
    """The points of a curve at given factors, in their order along the curve; a factor may occur several times."""
    met: list[Standing] = [points[0]] * any(points[0].factor == factor for factor in factors)
    for a, b in zip(points, points[1:], strict=False):
        low, high = min(a.factor, b.factor), max(a.factor, b.factor)
        here = [f for f in dict.fromkeys(factors) if low < f < high or f == b.factor]
        for factor in sorted(here, reverse=bool(b.factor < a.factor)):
            standing = b if factor == b.factor else _at_factor(curve.on(b.prepared), a, b, factor)
            if standing is not None:
                met.append(standing)
    return met


def _at_factor(curve: Curve, a: Standing, b: Standing, factor: float) -> Standing | None:
    """The point between two others at a factor: Newton's method from an interpolated one, or a root along the arc."""
    arc = b.arc - a.arc
    # The factor as the cubic over the arc that both points and tangents give.
    rise, left, right = b.factor - a.factor, arc * a.tangent.factor, arc * b.tangent.factor

    def missing(x: float) -> float:
        return a.factor - factor + x * (left + x * (3.0 * rise - 2.0 * left - right + x * (left + right - 2.0 * rise)))

    place = arc * root(missing, 0.0, missing(0.0), 1.0, missing(1.0))
    state, _ = curve.predicted(a, place, curve.bend(a, b))
    found = curve.at_factor(replace(a, state=state, arc=a.arc + place), factor, most=TRUSTED)
    if found is not None:
        return found
    near = sought(curve, a, b, lambda standing: standing.factor - factor)
    return None if near is None else curve.at_factor(near, factor)


def shapes_at(curve: Curve, event: Event) -> Array:
    """Modes whose eigenvalues vanish at a bifurcation, (rotation unknowns, multiplicity), largest entry 1 rad.

    Of several, the first is the one that :mod:`~sfetcas.solvers.sides` chooses of their space, the next that of the
    space orthogonal to it.
    """
    _, values, shapes = curve.prepared.around_zero(event.standing.point)
    weight = curve.prepared.weight
    neutral, count = event.standing.tangent.neutral, event.multiplicity
    if neutral is None:
        chosen = shapes[:, np.argsort(np.abs(values))[:count]]
    else:
        # Eigenvalues that vanish all along the curve are among the smallest: their modes are taken out.
        still, root = neutral.weighted[: len(weight)], np.sqrt(weight)[:, None]
        chosen = shapes[:, np.argsort(np.abs(values))[: count + still.shape[1]]]
        chosen = chosen - still / root**2 @ (still.T @ chosen)
        chosen = np.linalg.svd(root * chosen, full_matrices=False)[0][:, :count] / root
    root = np.sqrt(weight)[:, None]
    chosen = Sides(curve.equations).ordered(np.linalg.qr(root * chosen)[0] / root, weight)
    return np.asarray(chosen / np.abs(chosen).max(axis=0))
