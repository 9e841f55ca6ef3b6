"""The unloaded centre line of a member between its two nodes, as places and rotations along it.

A line of constant curvature about its own axes (straight, arc, helix) has a closed form; given curvature and
splines are polynomials on panels.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import cross, first_of_largest, fixed, length_of, numbers, values_of
from ..mathematics.curves import (
    FORWARD,
    POINTS,
    Curve,
    Screw,
    collocate,
    cubic_spline,
    derivatives,
    equal_arcs,
    refine,
)
from ..mathematics.interpolation import power_series
from ..mathematics.quaternion import matrix, rotate
from .formulas import Formula
from .records import Direction, Number, Positive, Record, Vector, listed_numbers
from .sections import quantity

__all__ = ["Arc", "CenterLine", "Curvature", "Helix", "Shape", "Spline", "Straight", "end_of", "place"]

Floats = NDArray[np.float64]

FITS = 1e-6
"""How far an end of a shape may be from its node, in units of its length: coordinates have seven digits and more."""

# Shapes as the user says them


@final
class Straight(Record):
    """Straight from the first node to the second."""

    type: Literal["straight"] = "straight"


@final
class Arc(Record):
    """Part of a circle; radius and length follow from the chord and the angle.

    Parameters
    ----------
    angle : rad
        Angle between the end tangents, below a full turn.  Above zero it turns right-handed about the normal.
    normal : (3,)
        Axis of the circle, of any length.
    start : (3,)
        Tangent at the first node.  It follows from the rest and is only checked.  Default: from the rest.
    """

    type: Literal["arc"] = "arc"
    angle: Number
    normal: Direction = (0.0, 0.0, 1.0)
    start: Direction | None = None

    @model_validator(mode="after")
    def _less_than_a_turn(self) -> Arc:
        if self.angle == 0.0 or abs(self.angle) >= 2.0 * math.pi:
            accepted = "an angle between -2 pi and 2 pi, not zero"
            raise SceneError(f"found {self.angle:g}, accepted: {accepted}", ("angle",))
        return self


@final
class Helix(Record):
    """Helix from the first node, by the right hand about its axis.

    Parameters
    ----------
    radius : m
        Radius of the cylinder that the helix lies on.
    pitch : m
        Advance along the axis in one turn; below zero it goes against the axis.
    turns : 1
        Number of turns.
    axis : (3,)
        Direction of the axis, of any length.  The helix turns right-handed about it, from the first node on.
    center : (3,), m
        Any point of the axis.
    """

    type: Literal["helix"] = "helix"
    radius: Positive
    pitch: Number
    turns: Positive
    axis: Direction
    center: Vector


def _coefficients(value: Any) -> Any:
    known = isinstance(value, (str, Formula)) or (isinstance(value, Mapping) and "formula" in value)
    return quantity(value) if known else listed_numbers(value)


Coefficients = Annotated[tuple[float, ...] | Formula, BeforeValidator(_coefficients)]
"""Coefficients of a polynomial in s/L, or a formula."""


@final
class Curvature(Record):
    """Given curvature about the axes of the section, as polynomials c0, c1, ... in s/L or as formulas.

    Parameters
    ----------
    kappa3 : (m,) or formula, 1/m
        Curvature about b3: coefficients in s/L, or a formula of ``x`` = s/L and ``s``.
    kappa2 : (m,) or formula, 1/m
        Curvature about b2.
    twist : (m,) or formula, 1/m
        Curvature about the tangent b1.
    length : m
        Length of the member.
    start : (3,)
        Tangent at the first node.  A straight line may do without.
    """

    type: Literal["curvature"] = "curvature"
    kappa3: Coefficients = (0.0,)
    kappa2: Coefficients = (0.0,)
    twist: Coefficients = (0.0,)
    length: Positive
    start: Direction | None = None


@final
class Spline(Record):
    """Smooth curve through points, of which the first and the last are the nodes.

    A cubic spline over the sum of the chords with continuous curvature and no knot at the second and the last
    but one point; two points give a straight line, three a parabola.  The sections have no twist.

    Parameters
    ----------
    points : (m, 3), m
        Points of a smooth curve; the first and the last are the nodes.
    """

    type: Literal["spline"] = "spline"
    points: tuple[Vector, ...]

    @model_validator(mode="after")
    def _distinct(self) -> Spline:
        if len(self.points) < 2:
            raise SceneError(f"found {len(self.points)}, accepted: two points or more", ("points",))
        total = sum(math.dist(a, b) for a, b in pairwise(self.points))
        for number, (a, b) in enumerate(pairwise(self.points), start=1):
            if math.dist(a, b) <= tolerances.DECIMAL * total:
                found = f"found points {number} and {number + 1} at {_say(b)}"
                raise SceneError(f"{found}, accepted: each point once", ("points",))
        return self


Shape = Annotated[Straight | Arc | Helix | Curvature | Spline, Field(discriminator="type")]
"""Any of the shapes, told apart by ``type``."""


# The line between the nodes


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CenterLine:
    """Centre line of a member: places and rotations over the fraction x = s/L, in any order of x.

    Attributes
    ----------
    start : (3,) m
        The first node.
    length : m
    end_gap : (3,) m
        The second node minus the end of the line: what the line was not stretched by.
    bending_axis : int
        3 or 2 where the whole line lies in a plane z = const, with b3 or b2 along z; else 0.
    turning : rad
        Integral of the magnitude of the curvature, twist included.
    breaks : tuple of float
        Fractions where the line should be cut into elements; none, since no shape has a jump of curvature.
    """

    start: Floats
    length: float
    end_gap: Floats
    bending_axis: int
    turning: float
    breaks: tuple[float, ...] = ()
    _curve: Curve = field(repr=False)

    @property
    def planar(self) -> bool:
        """Whether the whole line lies in a plane z = const, with b2 in it or across it."""
        return self.bending_axis != 0

    def strained_axes(self, space: bool) -> list[int]:
        """Numbers of the section axes along which it may be strained: all, or in the plane b1 and the one across."""
        return [0, 1, 2] if space else [0, 2 if self.bending_axis == 2 else 1]

    def positions(self, x: ArrayLike) -> Floats:
        """Places (n, 3) in m, fixed axes, at the fractions x (n,)."""
        return numbers(self.start + self.length * self._curve.positions(_row(x)))

    def quaternions(self, x: ArrayLike) -> Floats:
        """Unit quaternions (n, 4), scalar first, at the fractions x (n,); continuous in sign along x."""
        return self._curve.quaternions(_row(x))

    def curvatures(self, x: ArrayLike) -> Floats:
        """Curvature (n, 3) in 1/m about b1 (twist), b2, b3 at the fractions x (n,)."""
        return self._curve.curvatures(_row(x)) / self.length

    def tangents(self, x: ArrayLike) -> Floats:
        """Unit tangents b1 (n, 3), fixed axes, at the fractions x (n,)."""
        return rotate(self.quaternions(x), FORWARD)


def place(
    shape: Straight | Arc | Helix | Curvature | Spline,
    start: ArrayLike,
    end: ArrayLike,
    b2: ArrayLike | None = None,
    where: tuple[str, ...] = (),
) -> CenterLine:
    """The centre line of a member between its nodes.

    Parameters
    ----------
    shape : Straight, Arc, Helix, Curvature or Spline
        What the user says of it.
    start, end : (3,) m
        Positions of the first and the second node.
    b2 : (3,), optional
        Direction whose part across the tangent is b2 at the start; default: towards the axis of a helix, else
        such that b3 is as near to z as can be (b2 = z x tangent), and y where the tangent is along z.
    where : tuple of str
        Place of the member in the scene, for errors.

    Raises
    ------
    SceneError
        The shape does not fit the nodes, has no length or no tangent somewhere, or b2 is along the tangent.
    """
    first, chord = numbers(start), numbers(end) - numbers(start)
    across = None if b2 is None else numbers(b2)
    try:
        length, curve = _curve_of(shape, first, chord, across)
        return _line(first, chord, length, curve)
    except SceneError as error:
        raise error.within(*where) from None


def end_of(shape: Any, start: ArrayLike, b2: ArrayLike | None = None) -> Floats | None:
    """Where a shape ends that says so by itself: a given curvature, a helix, a spline; None of others.

    Parameters
    ----------
    shape : Straight, Arc, Helix, Curvature or Spline
    start : (3,) m
        Position of the first node.
    b2 : (3,), optional
    """
    if isinstance(shape, Spline):
        return numbers(shape.points[-1])
    if not isinstance(shape, Helix) and not (isinstance(shape, Curvature) and shape.start is not None):
        return None
    first, across = numbers(start), None if b2 is None else numbers(b2)
    # Of the chord only its not being zero is asked.
    length, curve = _curve_of(shape, first, np.ones(3), across)
    return numbers(first + length * curve.positions(np.ones(1))[0])


def _curve_of(shape: Any, start: Floats, chord: Floats, b2: Floats | None) -> tuple[float, Curve]:
    match shape:
        case Straight():
            return _straight(start, chord, b2)
        case Arc():
            return _arc(shape, start, chord, b2)
        case Helix():
            return _helix(shape, start, b2)
        case Curvature():
            return _given_curvature(shape, start, chord, b2)
        case Spline():
            return _spline(shape, start, b2)
    raise TypeError(f"{shape!r} is not a shape")


def _line(start: Floats, chord: Floats, length: float, curve: Curve) -> CenterLine:
    reached = length * curve.positions(np.ones(1))[0]
    gap = chord - reached
    if _norm(gap) > FITS * length:
        found = f"found its end at {_say(start + reached)}, {_norm(gap):.3g} m from the second node"
        accepted = f"up to {FITS:g} of its length of {length:.6g} m"
        raise SceneError(f"{found} at {_say(start + chord)}, accepted: {accepted}", ("shape",))
    return CenterLine(
        start=fixed(start),
        length=length,
        end_gap=fixed(gap),
        bending_axis=_bending_axis(curve),
        turning=float(values_of(curve.turning)),
        _curve=curve,
    )


def _bending_axis(curve: Curve) -> int:
    x = curve.samples
    rotations = values_of(curve.quaternions(x))
    if np.abs(values_of(curve.positions(x))[:, 2]).max() > tolerances.DECIMAL:
        return 0
    if values_of(curve.turning):
        # This also holds between the samples of a helix that meet it always at the same phase.
        bending = np.abs(rotate(rotations, values_of(curve.curvatures(x))))
        if bending[:, :2].max() / max(1.0, float(bending.max())) > tolerances.DECIMAL:
            return 0
    frames = matrix(rotations)
    out_of_plane = np.abs(frames[:, 2, 1:]).max(axis=0)
    return 3 if out_of_plane[0] <= tolerances.DECIMAL else 2 if out_of_plane[1] <= tolerances.DECIMAL else 0


# Vectors


def _row(x: ArrayLike) -> Floats:
    return np.atleast_1d(numbers(x))


def _norm(v: Floats) -> Any:
    return length_of(v)


def _unit(v: ArrayLike) -> Floats:
    v = numbers(v)
    return numbers(v / _norm(v))


def _say(v: Iterable[float]) -> str:
    return "[" + ", ".join(f"{entry:.6g}" for entry in v) + "]"


def _frame(tangent: Floats, b2: Floats | None) -> Floats:
    """Quaternion (4,) of the frame with this tangent and b2 as :func:`place` says."""
    if b2 is None:
        b2 = numbers([-tangent[1], tangent[0], 0.0])
        if _norm(b2) <= tolerances.PARALLEL:
            b2 = np.array([0.0, 1.0, 0.0])
    elif not b2.any():
        raise SceneError("found a vector of zero length, accepted: a direction across the member", ("b2",))
    elif (angle := _norm(cross(tangent, _unit(b2)))) <= tolerances.PARALLEL:
        found = f"found {_say(b2)}, {angle:.3g} rad off the tangent at the first node {_say(tangent)}"
        raise SceneError(f"{found}, accepted: a direction across the member", ("b2",))
    for _ in range(2):  # once more, since a first projection of a nearly parallel vector loses digits
        b2 = _unit(b2)
        b2 = _unit(b2 - (b2 @ tangent) * tangent)
    return _quaternion(np.column_stack([tangent, b2, cross(tangent, b2)]))


def _quaternion(turn: Floats) -> Floats:
    """Unit quaternion (4,) of a rotation matrix (3, 3): the largest row of 4 l l^T, free of cancellation."""
    (a, b, c), (d, e, f), (g, h, i) = turn
    rows = numbers(
        [
            [1.0 + a + e + i, h - f, c - g, d - b],
            [h - f, 1.0 + a - e - i, b + d, c + g],
            [c - g, b + d, 1.0 - a + e - i, f + h],
            [d - b, c + g, f + h, 1.0 - a - e + i],
        ]
    )
    return _unit(rows[first_of_largest(np.diag(rows))])


# One function a shape: length and curve


def _chord_length(start: Floats, chord: Floats) -> float:
    length = _norm(chord)
    if length <= 1e-15 * (_norm(start) + _norm(start + chord)):
        found = f"found both nodes at {_say(start)}"
        raise SceneError(f"{found}, accepted: nodes apart from each other", ("shape",))
    return length


def _straight(start: Floats, chord: Floats, b2: Floats | None) -> tuple[float, Curve]:
    length = _chord_length(start, chord)
    return length, Screw(first=_frame(_unit(chord), b2), axis=np.zeros(3), turns=0.0)


def _arc(shape: Arc, start: Floats, chord: Floats, b2: Floats | None) -> tuple[float, Curve]:
    distance = _chord_length(start, chord)
    normal = _unit(shape.normal)
    chord = chord - (chord @ normal) * normal
    if _norm(chord) <= FITS * distance:
        raise SceneError(
            "found both nodes on one line along the normal, accepted: nodes across it", ("shape", "normal")
        )
    half = 0.5 * shape.angle
    direction = _unit(chord)
    tangent = np.cos(half) * direction - np.sin(half) * cross(normal, direction)
    if shape.start is not None:
        _check_start(values_of(numbers(shape.start)), values_of(tangent))
    first = _frame(_unit(tangent), b2)
    length = _norm(chord) * half / np.sin(half)
    return length, Screw(first=first, axis=normal, turns=shape.angle / (2.0 * math.pi))


def _check_start(start: Floats, tangent: Floats) -> None:
    angle = math.atan2(_norm(cross(_unit(start), tangent)), _unit(start) @ tangent)
    if angle > tolerances.PARALLEL:
        found = f"found {_say(start)}, {angle:.3g} rad off the tangent {_say(tangent)} that angle and nodes give"
        raise SceneError(f"{found}, accepted: up to {tolerances.PARALLEL:g} rad, or no start", ("shape", "start"))


def _helix(shape: Helix, start: Floats, b2: Floats | None) -> tuple[float, Curve]:
    axis = _unit(shape.axis)
    outward = start - numbers(shape.center)
    outward = outward - (outward @ axis) * axis
    length = shape.turns * np.hypot(2.0 * math.pi * shape.radius, shape.pitch)
    if abs(_norm(outward) - shape.radius) > min(FITS * length, 0.5 * shape.radius):
        found = f"found {shape.radius:.9g}, but the first node is {_norm(outward):.9g} m from the axis"
        raise SceneError(f"{found}, accepted: the same to {FITS:g} of the length", ("shape", "radius"))
    round_about = 2.0 * math.pi * shape.radius * cross(axis, _unit(outward))
    tangent = _unit(round_about + shape.pitch * axis)
    first = _frame(tangent, -outward if b2 is None else b2)
    return length, Screw(first=first, axis=axis, turns=shape.turns)


def _given_curvature(shape: Curvature, start: Floats, chord: Floats, b2: Floats | None) -> tuple[float, Curve]:
    if shape.start is None:
        if any(isinstance(terms, Formula) or any(terms) for terms in (shape.kappa3, shape.kappa2)):
            needed = "a bent line needs its tangent at the first node"
            raise SceneError(f"the key 'start' is missing, {needed}", ("shape",))
        _chord_length(start, chord)
    first = _frame(_unit(chord if shape.start is None else shape.start), b2)
    given = (shape.twist, shape.kappa2, shape.kappa3)
    for key, terms in zip(("twist", "kappa2", "kappa3"), given, strict=True):
        if isinstance(terms, Formula):
            terms.check_finite(shape.length, "shape", key)

    def series(x: Floats, terms: Any) -> Floats:
        return terms.at(x, shape.length) if isinstance(terms, Formula) else power_series(x, terms)

    def sample(left: Floats, right: Floats) -> tuple[Floats, Floats, Floats]:
        x = left[:, None] + (right - left)[:, None] * POINTS
        rates = numbers([shape.length * series(x, c) for c in given])
        return right - left, np.moveaxis(rates, 0, 2), np.ones((*x.shape, 1))

    def known(left: Floats, right: Floats) -> tuple[Floats, Floats, Floats]:
        widths, rates, more = sample(left, right)
        return widths, values_of(rates), more

    edges, good = refine(known, np.array([0.0, 1.0]))
    if not good.all():
        raise SceneError("found a curvature of over 5000 rad along the member, accepted: less", ("shape",))
    widths, rates, _ = sample(edges[:-1], edges[1:])
    return shape.length, collocate(widths, rates, first, fixed_axes=False)


def _spline(shape: Spline, start: Floats, b2: Floats | None) -> tuple[float, Curve]:
    points = numbers(shape.points)
    scale = math.fsum(math.dist(a, b) for a, b in pairwise(values_of(points)))
    cubics = cubic_spline(np.diff(points, axis=0) / scale)

    def sample(left: Floats, right: Floats, cubics: Floats) -> tuple[Floats, Floats, Floats]:
        arcs, speeds, at = equal_arcs(cubics, left, right)
        slope, bend = derivatives(cubics, np.floor(left).astype(int), at)
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.linalg.norm(slope, axis=2, keepdims=True)
            rates = arcs.sum() * cross(slope, bend) / speed**3
            even = speeds / speeds.mean(axis=1, keepdims=True)
        return arcs / arcs.sum(), rates, even[:, :, None]

    known = functools.partial(sample, cubics=values_of(cubics))
    knots, good = refine(known, np.arange(float(len(points))))
    arcs, _, at = equal_arcs(cubics, knots[:-1], knots[1:])
    slope, _ = derivatives(cubics, np.floor(knots[:-1]).astype(int), at)
    _check_smooth(values_of(slope), good, knots)
    length = scale * arcs.sum()
    if (gap := _norm(points[0] - start)) > FITS * length:
        found = f"found the first point {gap:.3g} m from the first node at {_say(start)}"
        accepted = f"up to {FITS:g} of the length of {length:.6g} m"
        raise SceneError(f"{found}, accepted: {accepted}", ("shape", "points"))
    first = _frame(_unit(cubics[0, 0]), b2)
    widths, rates, _ = sample(knots[:-1], knots[1:], cubics)
    return length, collocate(widths, rates, first, fixed_axes=True)


def _check_smooth(slope: Floats, good: Floats, knots: Floats) -> None:
    """Refuse a curve that stands still: some panel is not good, or tangents (m, k, 3) are reversed."""
    flat = slope.reshape(-1, 3)
    back = np.einsum("nc,nc->n", flat[1:], flat[:-1]) <= 0.0
    if back.any() or not good.all():
        panel = int(np.argmin(good)) if not good.all() else int(np.argmax(back)) // slope.shape[1]
        point = 1 + math.floor(knots[panel])
        found = f"found a curve that turns back between points {point} and {point + 1}"
        raise SceneError(f"{found}, accepted: points along a smooth curve", ("shape", "points"))
