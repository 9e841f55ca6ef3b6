"""Unloaded centre lines: identities that hold for every shape, closed forms, sentences of the errors."""

from __future__ import annotations

import functools
import math
from fractions import Fraction

import numpy as np
import pytest
from pydantic import TypeAdapter

from sfetcas.description.shapes import Arc, Curvature, Helix, Shape, Spline, Straight, place
from sfetcas.errors import SceneError
from sfetcas.mathematics.quaternion import conjugate, matrix, multiply

# A few hundred operations with numbers of size one.
ROUNDING = 1e-14

X = np.concatenate([np.linspace(0.0, 1.0, 41), [0.123456789, 0.987654321]])


def derivative(function, x, h=1e-3):
    """Central difference of order six: error h^6/140 of the seventh derivative, and rounding eps/h."""
    terms = [w * (function(x + k * h) - function(x - k * h)) for k, w in ((1, 45.0), (2, -9.0), (3, 1.0))]
    return sum(terms) / (60.0 * h)


def marched(shape, start, quaternion, steps=1500):
    """End of a member of given curvature by Runge-Kutta of order four: another route to the same law."""

    def rate(x, state):
        q = state[3:]
        kappa = [shape.length * np.polynomial.Polynomial(c)(x) for c in (shape.twist, shape.kappa2, shape.kappa3)]
        return np.concatenate([shape.length * matrix(q)[:, 0], 0.5 * multiply(q, [0.0, *kappa])])

    state, h = np.concatenate([start, quaternion]), 1.0 / steps
    for n in range(steps):
        a = rate(n * h, state)
        b = rate((n + 0.5) * h, state + 0.5 * h * a)
        c = rate((n + 0.5) * h, state + 0.5 * h * b)
        d = rate((n + 1) * h, state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return state[:3], state[3:]


BENT = Curvature(kappa3=[2.0, -6.0, 5.0], kappa2=[0.5, 0.0, -3.0], twist=[1.0, 2.0], length=1.3, start=[0, 0.6, 0.8])
# Its start frame: b2 = z x t = -x, b3 = t x b2
BENT_FIRST = np.column_stack([[0.0, 0.6, 0.8], [-1.0, 0.0, 0.0], [0.0, -0.8, 0.6]])
POINTS = [[0, 0, 0], [1, 0.5, 0.2], [2, 1.5, -0.1], [2.5, 3, 1]]


def quaternion_of(turn):
    """For rotations below half a turn."""
    real = 0.5 * math.sqrt(1.0 + np.trace(turn))
    axis = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    return np.array([real, *(np.array(axis) / (4.0 * real))])


def spline(points, **options):
    return place(Spline(points=points), points[0], points[-1], **options)


def helix_end(helix, start):
    axis = np.array(helix.axis) / np.linalg.norm(helix.axis)
    out = np.array(start) - helix.center
    out = out - (out @ axis) * axis
    angle = 2.0 * math.pi * helix.turns
    turned = math.cos(angle) * out + math.sin(angle) * np.cross(axis, out)
    return np.array(start) + turned - out + helix.turns * helix.pitch * axis


def wound(helix, start, **options):
    return place(helix, start, helix_end(helix, start), **options)


def bent():
    return place(BENT, [1, 2, 3], marched(BENT, [1.0, 2.0, 3.0], quaternion_of(BENT_FIRST))[0])


SLANTED = Helix(radius=math.sqrt(2.0), pitch=-0.7, turns=2.3, axis=[0, 0, 2], center=[1, 1, 9])

LINES = {
    "straight": lambda: place(Straight(), [1, 2, 3], [4, -2, 5]),
    "straight up": lambda: place(Straight(), [0, 0, 0], [0, 0, 2]),
    "straight with b2": lambda: place(Straight(), [0, 0, 0], [1, 1, 0], b2=[0.3, 0, -1]),
    "arc": lambda: place(Arc(angle=1.2), [0, 0, 0], [1, 2, 0]),
    "long arc backwards": lambda: place(Arc(angle=-5.5), [0, 0, 0], [1, 2, 0]),
    "arc across": lambda: place(Arc(angle=3.5, normal=[1, 1, 1]), [0, 0, 0], [1, -1, 0], b2=[1, 2, 0]),
    "helix": lambda: wound(SLANTED, [0, 0, 0]),
    "helix with b2": lambda: wound(SLANTED, [2, 0, 0], b2=[1, 1, 1]),
    "curvature": bent,
    "spline of two": lambda: spline(POINTS[:2]),
    "spline of three": lambda: spline(POINTS[:3]),
    "spline of four": lambda: spline(POINTS),
}


@functools.cache
def known(name):
    return LINES[name]()


@pytest.fixture(params=LINES)
def line(request):
    return known(request.param)


# Identities of every line


def test_quaternions_have_unit_length(line):
    assert np.linalg.norm(line.quaternions(X), axis=1) == pytest.approx(np.ones(len(X)), abs=ROUNDING)


def test_quaternions_are_continuous_in_sign(line):
    x = np.linspace(0.0, 1.0, 801)
    q = line.quaternions(x)
    # half the turning between two places, of 1/800 of it or a few times that where it is uneven
    assert np.linalg.norm(np.diff(q, axis=0), axis=1).max() <= 10.0 * line.turning / 800.0 + ROUNDING


def test_tangent_is_first_axis_of_the_frame(line):
    q0, q1, q2, q3 = line.quaternions(X).T
    expected = [q0**2 + q1**2 - q2**2 - q3**2, 2.0 * (q1 * q2 + q0 * q3), 2.0 * (q1 * q3 - q0 * q2)]
    assert line.tangents(X) == pytest.approx(np.column_stack(expected), abs=ROUNDING)


def test_tangent_is_the_derivative_of_position(line):
    x = np.linspace(0.01, 0.99, 23)
    expected = derivative(line.positions, x) / line.length
    # seventh derivatives up to (15 rad)^7 / 140 h^6 = 1e-12
    assert line.tangents(x) == pytest.approx(expected, abs=5e-12)


def test_curvature_is_twice_the_body_rate_of_the_quaternion(line):
    x = np.linspace(0.01, 0.99, 23)
    rate = 2.0 * multiply(conjugate(line.quaternions(x)), derivative(line.quaternions, x)) / line.length
    # as above; the quaternion changes half as fast, but its rounding is divided by the step
    assert line.curvatures(x) == pytest.approx(rate[:, 1:], abs=5e-12 * max(1.0, 1.0 / line.length))


def test_curvature_uses_the_rows_of_the_paper(line):
    x = np.array([0.37])
    l0, l1, l2, l3 = line.quaternions(x)[0]
    rows = np.array([[-l1, l0, l3, -l2], [-l2, -l3, l0, l1], [-l3, l2, -l1, l0]])
    expected = 2.0 * rows @ derivative(line.quaternions, x)[0] / line.length
    assert line.curvatures(x)[0] == pytest.approx(expected, abs=1e-11)


def test_lines_begin_and_end_at_the_nodes(line):
    assert line.positions([0.0])[0] == pytest.approx(line.start, abs=ROUNDING * line.length)
    # the end of the general line is known to order four only, see marched
    assert np.abs(line.end_gap).max() <= 1e-11 * line.length


def test_turning_is_the_integral_of_curvature(line):
    points, weights = np.polynomial.legendre.leggauss(60)
    size = np.linalg.norm(line.curvatures(0.5 * (points + 1.0)), axis=1)
    # curvature that nearly vanishes has a kink in its magnitude: quadratic convergence of the sum only
    assert line.turning == pytest.approx(0.5 * line.length * weights @ size, rel=1e-3, abs=ROUNDING)


def test_places_come_in_the_order_asked_for(line):
    order = np.random.default_rng(0).permutation(len(X))
    for values in (line.positions, line.quaternions, line.curvatures, line.tangents):
        assert values(X[order]) == pytest.approx(values(X)[order], abs=0.0)


def test_lines_cannot_be_changed(line):
    with pytest.raises(AttributeError):
        line.length = 1.0
    with pytest.raises(ValueError, match="read-only"):
        line.start[0] = 1.0


def test_no_shape_asks_for_a_break(line):
    assert line.breaks == ()


# Size


@pytest.mark.parametrize("size", [1e-9, 1e9])
@pytest.mark.parametrize("kind", ["straight", "arc", "helix", "curvature", "spline"])
def test_size_does_not_matter(kind, size):
    def made(scale):
        start, end = np.array([0.5, 0.25, 0.0]) * scale, np.array([1.5, -0.75, 0.0]) * scale
        match kind:
            case "straight":
                return place(Straight(), start, end)
            case "arc":
                return place(Arc(angle=2.0), start, end)
            case "helix":
                helix = Helix(
                    radius=scale,
                    pitch=0.1 * scale,
                    turns=3.5,
                    axis=[1, 2, 0],
                    center=[0.5 * scale, 0.25 * scale, scale],
                )
                return wound(helix, start)
            case "curvature":
                shape = Curvature(kappa3=[math.pi / scale], length=scale, start=[0, 1, 0])
                return place(shape, start, start - [2.0 * scale / math.pi, 0, 0])
        return spline([list(np.array(point) * scale) for point in POINTS])

    one, other = made(1.0), made(size)
    assert other.length / size == pytest.approx(one.length, rel=ROUNDING)
    assert other.positions(X) / size == pytest.approx(one.positions(X), abs=ROUNDING * one.length)
    assert other.quaternions(X) == pytest.approx(one.quaternions(X), abs=ROUNDING)
    # the cubics give curvature by differences: some units in the last place of 1/(spacing of the points)
    assert other.curvatures(X) * size == pytest.approx(one.curvatures(X), abs=1e-12)
    assert other.bending_axis == one.bending_axis


def test_line_far_from_the_origin_keeps_its_digits():
    offset = np.array([1e6, -1e6, 1e6])
    near, far = (
        place(Arc(angle=1.0), [0, 0, 0], [1, 0, 0]),
        place(Arc(angle=1.0), offset, [1e6 + 1, -1e6, 1e6]),
    )
    assert far.quaternions(X) == pytest.approx(near.quaternions(X), abs=ROUNDING)
    # one unit in the last place of 1e6
    assert far.positions(X) - offset == pytest.approx(near.positions(X), abs=2e-10)
    assert np.abs(far.end_gap).max() <= ROUNDING


# Straight


def test_straight_line():
    line = place(Straight(), [1, 2, 3], [4, -2, 15])
    assert line.length == pytest.approx(13.0, rel=ROUNDING)
    assert line.positions([0.25])[0] == pytest.approx([1.75, 1.0, 6.0], rel=ROUNDING)
    assert line.curvatures(X) == pytest.approx(np.zeros((len(X), 3)), abs=0.0)
    assert line.turning == 0.0


# Arc


@pytest.mark.parametrize("angle", [1e-9, 0.5, math.pi, 4.0, 6.2, -1.0, -math.pi, -6.0])
@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_arc_is_the_part_of_a_circle(angle, heading):
    chord = 2.0 * np.array([math.cos(heading), math.sin(heading), 0.0])
    line = place(Arc(angle=angle), [1, 1, 5], np.array([1, 1, 5]) + chord)
    radius = 1.0 / math.sin(0.5 * abs(angle))
    assert line.length == pytest.approx(radius * abs(angle), rel=ROUNDING)
    direction = heading - 0.5 * angle + angle * X
    assert line.tangents(X) == pytest.approx(
        np.column_stack([np.cos(direction), np.sin(direction), 0 * X]), abs=ROUNDING
    )
    turn = np.column_stack([np.sin(direction), -np.cos(direction)]) - [
        math.sin(direction[0]),
        -math.cos(direction[0]),
    ]
    # differences of a unit direction over a small angle lose digits in this formula, not in the line
    lost = ROUNDING * max(1.0, 0.1 / abs(angle))
    expected = np.array([1, 1]) + line.length / angle * turn
    assert line.positions(X)[:, :2] == pytest.approx(expected, abs=lost * line.length)
    assert line.positions(X)[:, 2] == pytest.approx(np.full(len(X), 5.0), abs=0.0)
    assert line.curvatures(X) == pytest.approx(np.tile([0, 0, angle / line.length], (len(X), 1)), abs=ROUNDING)
    assert line.end_gap == pytest.approx(np.zeros(3), abs=ROUNDING * line.length)
    assert line.turning == pytest.approx(abs(angle), rel=ROUNDING)
    assert (line.planar, line.bending_axis) == (True, 3)


def test_arc_turns_by_the_right_hand_about_its_normal():
    # a quarter from +x to +y turns about +z, so it starts to the right of its chord
    line = place(Arc(angle=0.5 * math.pi), [0, 0, 0], [1, 1, 0])
    assert line.tangents([0.0, 1.0]) == pytest.approx(np.array([[1, 0, 0], [0, 1, 0]]), abs=ROUNDING)
    under = place(Arc(angle=0.5 * math.pi, normal=[0, 0, -3]), [0, 0, 0], [1, 1, 0])
    assert under.tangents([0.0, 1.0]) == pytest.approx(np.array([[0, 1, 0], [1, 0, 0]]), abs=ROUNDING)


def test_arc_takes_a_start_that_agrees():
    line = place(Arc(angle=0.5 * math.pi, start=[7, 6e-6, 0]), [0, 0, 0], [1, 1, 0])
    assert line.tangents([0.0])[0] == pytest.approx([1, 0, 0], abs=ROUNDING)


# Helix


@pytest.mark.parametrize("pitch", [0.3, -0.3, 0.0])
@pytest.mark.parametrize("turns", [0.25, 3.3, 200.0])
def test_helix_closed_form(pitch, turns):
    helix = Helix(radius=0.5, pitch=pitch, turns=turns, axis=[0, 0, 7], center=[1, 0, -4])
    line = wound(helix, [1.5, 0, 2])
    # the rest of whole turns, without the rounding of large angles
    angle = 2.0 * math.pi * np.array([math.fmod(turns * n, 64.0) / 64.0 for n in range(65)])
    x = np.arange(65.0) / 64.0
    expected = np.column_stack([1 + 0.5 * np.cos(angle), 0.5 * np.sin(angle), 2 + pitch * turns * x])
    assert line.length == pytest.approx(turns * math.hypot(math.pi, pitch), rel=ROUNDING)
    # of turns n/64 above, 2e-15 times 2 pi are not exact
    assert line.positions(x) == pytest.approx(expected, abs=ROUNDING * max(1.0, line.length))
    climb = pitch / (2.0 * math.pi)
    size = 0.25 + climb**2
    expected = np.tile([climb / size, 0.0, 0.5 / size], (65, 1))
    assert line.curvatures(x) == pytest.approx(expected, abs=ROUNDING / 0.25)
    assert line.turning == pytest.approx(2.0 * math.pi * turns, rel=ROUNDING)
    inward = np.column_stack([-np.cos(angle), -np.sin(angle), 0.0 * angle])
    # the phase is known to rounding of x only where x itself is exact, as here
    assert matrix(line.quaternions(x))[:, :, 1] == pytest.approx(inward, abs=ROUNDING * max(1.0, 0.1 * turns))


def test_phase_of_a_helix_has_all_digits_at_any_place():
    turns = 217.37
    line = wound(Helix(radius=1, pitch=0.1, turns=turns, axis=[0, 0, 1], center=[0, 0, 0]), [1, 0, 0])
    rest = np.array([float((Fraction(turns) * Fraction(x)) % 1) for x in X])
    expected = np.column_stack([-np.cos(2.0 * math.pi * rest), -np.sin(2.0 * math.pi * rest)])
    # the product of turns and x, rounded, would be off by up to 3e-14 turns
    assert matrix(line.quaternions(X))[:, :2, 1] == pytest.approx(expected, abs=5e-15)


def test_helix_closes_exactly_after_whole_turns():
    helix = Helix(radius=1.0, pitch=0.1, turns=200, axis=[1, 2, 3], center=[0, 0, 0])
    start = np.cross([1.0, 2.0, 3.0], [0.0, 0.0, 1.0])
    start /= np.linalg.norm(start)
    line = place(helix, start, start + 20.0 * np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0))
    # no rounding of 400 pi: the phase at the end is that at the start
    assert line.quaternions([1.0]) == pytest.approx(line.quaternions([0.0]), abs=1e-15)
    assert np.linalg.norm(line.end_gap) <= 1e-15 * line.length


@pytest.mark.parametrize("turns", [0.8, 200.0])
def test_helix_is_a_line_of_constant_curvature_and_twist(turns):
    helix = wound(Helix(radius=0.3, pitch=-0.2, turns=turns, axis=[1, 1, 0], center=[0, 0, 0.3]), [0, 0, 0])
    twist, kappa2, kappa3 = helix.curvatures([0.0])[0]
    frame = matrix(helix.quaternions([0.0]))[0]
    shape = Curvature(kappa3=[kappa3], kappa2=[kappa2], twist=[twist], length=helix.length, start=frame[:, 0])
    line = place(shape, [0, 0, 0], helix.positions([1.0])[0], b2=frame[:, 1])
    # rounding of the curvature times the turning
    phase = ROUNDING + 4e-16 * helix.turning
    assert line.quaternions(X) == pytest.approx(helix.quaternions(X), abs=phase)
    assert line.positions(X) == pytest.approx(helix.positions(X), abs=ROUNDING * helix.length)
    assert line.turning == pytest.approx(helix.turning, rel=ROUNDING)


def test_b2_of_a_helix_is_towards_the_axis_unless_given():
    assert matrix(wound(SLANTED, [2, 0, 0]).quaternions([0.0]))[0, :, 1] == pytest.approx(
        [-math.sqrt(0.5), math.sqrt(0.5), 0], abs=ROUNDING
    )
    line = known("helix with b2")
    tangent, b2 = matrix(line.quaternions([0.0]))[0, :, :2].T
    expected = np.ones(3) - np.sum(tangent) * tangent
    assert b2 == pytest.approx(expected / np.linalg.norm(expected), abs=ROUNDING)
    # the frame keeps its angle against the direction to the axis
    assert line.curvatures(X) == pytest.approx(np.tile(line.curvatures([0.0]), (len(X), 1)), abs=ROUNDING)


# Given curvature


def test_s_curve_against_quadrature():
    shape = Curvature(kappa3=[8.0, -20.0, 3.0, 1.0], length=1.5, start=[math.cos(0.4), math.sin(0.4), 0])
    theta = 1.5 * np.polynomial.Polynomial(shape.kappa3).integ()
    points, weights = np.polynomial.legendre.leggauss(80)

    def place_at(x):
        direction = 0.4 + theta(0.5 * x * (points + 1.0))
        return 1.5 * 0.5 * x * np.array([weights @ np.cos(direction), weights @ np.sin(direction), 0.0])

    line = place(shape, [0, 0, 0], place_at(1.0))
    # 80 points integrate this to rounding
    assert line.positions(X) == pytest.approx(np.array([place_at(x) for x in X]), abs=ROUNDING)
    half = 0.5 * (0.4 + theta(X))
    expected = np.column_stack([np.cos(half), 0 * X, 0 * X, np.sin(half)])
    assert line.quaternions(X) == pytest.approx(expected, abs=ROUNDING)
    kappa = np.polynomial.Polynomial(shape.kappa3)(X)
    assert line.curvatures(X) == pytest.approx(np.column_stack([0 * X, 0 * X, kappa]), abs=1e-13)
    assert line.bending_axis == 3


def test_curvature_in_space_against_another_integrator():
    end, quaternion = marched(BENT, [1.0, 2.0, 3.0], quaternion_of(BENT_FIRST))
    line = known("curvature")
    # (turning of 5 rad / 3000 steps)^4 is 1e-11, its constant some hundredth
    assert line.positions([1.0])[0] == pytest.approx(end, abs=1e-11)
    assert matrix(line.quaternions([1.0])[0]) == pytest.approx(matrix(quaternion), abs=1e-11)
    assert line.quaternions([0.0])[0] == pytest.approx(quaternion_of(BENT_FIRST), abs=ROUNDING)


def test_curvature_is_the_polynomial_given():
    kappas = [np.polynomial.Polynomial(c)(X) for c in (BENT.twist, BENT.kappa2, BENT.kappa3)]
    # interpolation at 12 points of numbers up to 6
    assert known("curvature").curvatures(X) == pytest.approx(np.column_stack(kappas), abs=1e-13)


def test_high_powers_are_resolved():
    shape = Curvature(kappa3=[0.0] * 25 + [50.0], length=1.0, start=[1, 0, 0])
    points, weights = np.polynomial.legendre.leggauss(200)
    x = 0.5 * (points + 1.0)
    angle = 50.0 / 26.0 * x**26
    end = [0.5 * weights @ np.cos(angle), 0.5 * weights @ np.sin(angle), 0.0]
    line = place(shape, [0, 0, 0], end)
    # 200 points integrate a power of 26 and its square to rounding
    assert line.end_gap == pytest.approx(np.zeros(3), abs=ROUNDING)
    assert line.curvatures(X)[:, 2] == pytest.approx(50.0 * X**25, abs=50.0 * 3e-14)


def test_twist_alone_keeps_the_line_straight():
    line = place(Curvature(twist=[1.0, 2.0], length=2.0), [0, 0, 0], [0, 2, 0])
    assert line.positions(X) == pytest.approx(np.outer(X, [0, 2, 0]), abs=ROUNDING)
    # b2 = -x turns by 2 (x + x^2) about y
    angle = 2.0 * (X + X**2)
    expected = np.column_stack([-np.cos(angle), 0 * X, np.sin(angle)])
    assert matrix(line.quaternions(X))[:, :, 1] == pytest.approx(expected, abs=ROUNDING)
    assert (line.planar, line.bending_axis) == (False, 0)


def test_signs_of_curvature():
    quarter = {"length": 0.5 * math.pi, "start": [1, 0, 0]}
    about_b3 = place(Curvature(kappa3=[1.0], **quarter), [0, 0, 0], [1, 1, 0])
    assert about_b3.tangents([1.0])[0] == pytest.approx([0, 1, 0], abs=ROUNDING)
    # b2 = y: by the right hand about y, x turns to -z
    about_b2 = place(Curvature(kappa2=[1.0], **quarter), [0, 0, 0], [1, 0, -1])
    assert about_b2.tangents([1.0])[0] == pytest.approx([0, 0, -1], abs=ROUNDING)


def test_end_gap_is_kept_and_not_stretched_away():
    line = place(Curvature(length=2.0, start=[1, 0, 0]), [0, 0, 0], [2.0, 1e-6, -5e-7])
    assert line.end_gap == pytest.approx([0.0, 1e-6, -5e-7], abs=1e-15)
    assert line.positions([1.0])[0] == pytest.approx([2.0, 0, 0], abs=1e-15)


# Spline


def reference_spline(points):
    """Cubics over the sum of the chords from all conditions at once, as (knots, coefficients (m, 4, 3))."""
    points = np.array(points, float)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = len(knots) - 1
    rows, right = [], []

    def powers(t, order):
        return [math.perm(k, order) * t ** (k - order) if k >= order else 0.0 for k in range(4)]

    def condition(entries, value):
        row = np.zeros(4 * count)
        for piece, values in entries:
            row[4 * piece : 4 * piece + 4] += values
        rows.append(row)
        right.append(value)

    for k, h in enumerate(np.diff(knots)):
        condition([(k, powers(0.0, 0))], points[k])
        condition([(k, powers(h, 0))], points[k + 1])
    for k, h in enumerate(np.diff(knots)[:-1]):
        for order in (1, 2):
            condition([(k, powers(h, order)), (k + 1, np.negative(powers(0.0, order)))], np.zeros(3))
    for k in (0, count - 2):
        condition([(k, powers(0.0, 3)), (k + 1, np.negative(powers(0.0, 3)))], np.zeros(3))
    return knots, np.linalg.solve(np.array(rows), np.array(right)).reshape(count, 4, 3)


MANY = [[math.cos(t) * (1 + 0.2 * t), math.sin(t) + 0.01 * t**3, 0.3 * t] for t in (0, 0.4, 1.1, 1.7, 2.9, 3.3, 4.4)]


def test_spline_against_another_solution():
    knots, cubics = reference_spline(MANY)
    points, weights = np.polynomial.legendre.leggauss(40)
    line, arc = spline(MANY), 0.0
    places, fractions = [], []
    for h, c in zip(np.diff(knots), cubics, strict=True):
        curve = [np.polynomial.Polynomial(c[:, axis]) for axis in range(3)]
        for u in (0.0, 0.3, 0.8):
            t = 0.5 * u * h * (points + 1.0)
            speed = np.linalg.norm([p.deriv()(t) for p in curve], axis=0)
            places.append([p(u * h) for p in curve])
            fractions.append(arc + 0.5 * u * h * weights @ speed)
        t = 0.5 * h * (points + 1.0)
        arc += 0.5 * h * weights @ np.linalg.norm([p.deriv()(t) for p in curve], axis=0)
    # 40 points integrate the speed of these pieces to some 1e-14
    assert line.length == pytest.approx(arc, rel=1e-13)
    assert line.positions(np.array(fractions) / arc) == pytest.approx(np.array(places), abs=1e-13 * arc)


def fractions_of(line, points):
    """Where the line passes the points: the nearest of many, then Newton along the tangent."""
    found = []
    for point in points:
        x = np.linspace(0.0, 1.0, 2001)
        x = x[np.argmin(np.linalg.norm(line.positions(x) - point, axis=1))]
        for _ in range(20):
            x = x + (point - line.positions([x])[0]) @ line.tangents([x])[0] / line.length
        found.append(min(max(x, 0.0), 1.0))
    return np.array(found)


@pytest.mark.parametrize("points", [MANY, POINTS, POINTS[:3]])
def test_spline_passes_its_points(points):
    line = spline(points)
    x = fractions_of(line, points)
    assert line.positions(x) == pytest.approx(np.array(points), abs=ROUNDING * line.length)


def test_curvature_of_a_spline_is_continuous_and_has_no_twist():
    line = spline(MANY)
    x, h = fractions_of(line, MANY)[1:-1], 1e-9
    # the curvature changes by some 100/m over the length: 1e-7 over the step
    assert line.curvatures(x + h) == pytest.approx(line.curvatures(x - h), abs=1e-6)
    assert line.curvatures(X)[:, 0] == pytest.approx(np.zeros(len(X)), abs=0.0)


def test_spline_of_three_points_is_a_parabola():
    line = spline([[-1, 1, 0], [0, 0, 0], [1, 1, 0]])
    x, y, _ = line.positions(X).T
    assert y == pytest.approx(x**2, abs=ROUNDING)
    # arc length of y = x^2 up to x = 1
    assert line.length == pytest.approx(math.sqrt(5.0) + 0.5 * math.asinh(2.0), rel=ROUNDING)
    assert line.curvatures([0.5])[0] == pytest.approx([0, 0, 2.0], abs=1e-13)
    assert line.bending_axis == 3


def test_spline_through_points_on_a_line_is_straight():
    line = spline([[a, 0, 0] for a in range(6)])
    assert line.positions(X) == pytest.approx(np.outer(X, [5, 0, 0]), abs=ROUNDING)
    assert line.turning <= ROUNDING


def test_spline_with_very_uneven_points():
    points = [[0, 0, 0], [1e-6, 1e-7, 0], [1, 1, 0], [1.000001, 1, 0], [5, 2, 0]]
    line = spline(points)
    assert np.abs(line.end_gap).max() <= ROUNDING * line.length


def test_spline_is_moved_to_the_first_node():
    shift = np.array([1e-7, -2e-7, 0.0])
    line = place(Spline(points=POINTS), POINTS[0] + shift, POINTS[-1])
    assert line.positions([0.0])[0] == pytest.approx(shift, abs=1e-15)
    assert line.end_gap == pytest.approx(-shift, abs=1e-14)


# Frames and planes


@pytest.mark.parametrize("heading", [0.0, 0.3, 1.6, 3.0, -2.0, math.pi])
def test_b3_is_up_where_the_member_lies_in_x_y(heading):
    line = place(Straight(), [0, 0, 1], [math.cos(heading), math.sin(heading), 1])
    _, b2, b3 = matrix(line.quaternions([0.0]))[0].T
    assert b2 == pytest.approx([-math.sin(heading), math.cos(heading), 0], abs=ROUNDING)
    assert b3 == pytest.approx([0, 0, 1], abs=ROUNDING)
    assert (line.planar, line.bending_axis) == (True, 3)


@pytest.mark.parametrize("end", [[1, 2, 3], [1, 0, -4], [0, -1, 0.1]])
def test_b3_is_as_near_to_up_as_can_be(end):
    line = place(Straight(), [0, 0, 0], end)
    tangent, b2, b3 = matrix(line.quaternions([0.0]))[0].T
    nearest = np.array([0, 0, 1]) - tangent[2] * tangent
    assert b3 == pytest.approx(nearest / np.linalg.norm(nearest), abs=ROUNDING)
    assert b2[2] == pytest.approx(0.0, abs=ROUNDING)


@pytest.mark.parametrize("end", [[0, 0, 2], [0, 0, -3]])
def test_b2_is_y_where_the_member_is_along_z(end):
    line = place(Straight(), [0, 0, 0], end)
    assert matrix(line.quaternions([0.0]))[0, :, 1] == pytest.approx([0, 1, 0], abs=ROUNDING)
    assert (line.planar, line.bending_axis) == (False, 0)


def test_given_b2_is_made_normal_to_the_tangent():
    line = place(Straight(), [0, 0, 0], [1, 0, 0], b2=[5, 0, -2])
    _, b2, b3 = matrix(line.quaternions([0.5]))[0].T
    assert b2 == pytest.approx([0, 0, -1], abs=ROUNDING)
    assert b3 == pytest.approx([0, 1, 0], abs=ROUNDING)


def test_frame_from_a_nearly_parallel_b2_is_orthonormal():
    line = place(Straight(), [0, 0, 0], [1, 2, 3], b2=[1, 2, 3 + 1e-5])
    frame = matrix(line.quaternions([0.0]))[0]
    assert frame[:, 0] == pytest.approx(np.array([1, 2, 3]) / math.sqrt(14.0), abs=ROUNDING)


@pytest.mark.parametrize(
    ("b2", "axis"),
    [(None, 3), ([0, 1, 0], 3), ([0, -1, 0], 3), ([0, 0, 1], 2), ([0, 0, -1], 2), ([0, 1, 1], 0)],
)
def test_bending_axis_is_the_one_along_z(b2, axis):
    line = place(Straight(), [0, 0, 2], [1, 0, 2], b2=b2)
    assert (line.bending_axis, line.planar) == (axis, axis != 0)
    bowed = place(Arc(angle=1.0), [0, 0, 2], [1, 0, 2], b2=b2)
    assert (bowed.bending_axis, bowed.planar) == (axis, axis != 0)
    if axis:
        sign = 1.0 if b2 in (None, [0, 1, 0], [0, 0, 1]) else -1.0
        expected = [0.0, 0.0, 0.0]
        expected[axis - 1] = sign / bowed.length
        assert bowed.curvatures([0.3])[0] == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize(
    "make",
    [
        lambda: place(Straight(), [0, 0, 0], [1, 0, 1e-6]),
        lambda: place(Arc(angle=1.0, normal=[0, 1e-6, 1]), [0, 0, 0], [1, 0, 0]),
        lambda: place(Arc(angle=1.0, normal=[0, 1, 0]), [0, 0, 0], [1, 0, 0]),
        LINES["helix"],
        # whole turns from sample to sample, with the tangent in x-y at each
        lambda: wound(Helix(radius=1, pitch=0, turns=199.9, axis=[0, 1, 0], center=[0, 0, 1]), [0, 0, 0]),
        lambda: wound(Helix(radius=1, pitch=0, turns=200, axis=[0, 1, 0], center=[0, 0, 1]), [0, 0, 0]),
        lambda: spline(MANY),
        LINES["curvature"],
    ],
)
def test_lines_in_space_are_not_planar(make):
    line = make()
    assert (line.planar, line.bending_axis) == (False, 0)


def test_ring_and_plane_spline_are_planar():
    ring = Helix(radius=1, pitch=0, turns=0.7, axis=[0, 0, 1], center=[0, 0, 0])
    assert wound(ring, [1, 0, 3]).bending_axis == 3
    assert spline([[a, math.sin(3 * a), 0.1] for a in np.linspace(0, 2, 9)]).bending_axis == 3
    assert spline([[a, math.sin(3 * a), 0.1] for a in np.linspace(0, 2, 9)], b2=[0, 0, 1]).bending_axis == 2


# Errors


def test_shape_is_found_by_its_type():
    shapes = TypeAdapter(Shape)
    assert shapes.validate_python({"type": "arc", "angle": 1}) == Arc(angle=1)
    assert shapes.validate_python({"type": "straight"}) == Straight()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Arc(angle=0), "angle: found 0, accepted: an angle between -2 pi and 2 pi, not zero"),
        (lambda: Arc(angle=-2 * math.pi), r"angle: found -6\.28319, accepted: an angle between"),
        (lambda: Arc(angle=1, normal=[0, 0, 0]), "normal: found .*, accepted: a direction"),
        (lambda: Arc(angle=1, start=[0, 0]), "start: found .*, accepted: a direction"),
        (lambda: Arc(angle=1, radius=2), "unknown key 'radius'"),
        (
            lambda: Helix(radius=0, pitch=1, turns=1, axis=[0, 0, 1], center=[0, 0]),
            "radius: found 0, accepted",
        ),
        (
            lambda: Helix(radius=1, pitch=1, turns=-1, axis=[0, 0, 1], center=[0, 0]),
            "turns: found -1, accepted",
        ),
        (
            lambda: Helix(radius=1, pitch=1, turns=1, axis=[0, 0, 0], center=[0, 0]),
            "axis: found .*a direction",
        ),
        (lambda: Helix(radius=1, pitch=1, turns=1, axis=[0, 0, 1]), "the key 'center' is missing"),
        (lambda: Curvature(length=0), "length: found 0, accepted: a number above zero"),
        (lambda: Curvature(length=1, kappa3=1), "kappa3: found 1, accepted: a list of numbers"),
        (lambda: Curvature(length=1, twist=[]), "twist: found an empty list"),
        (lambda: Curvature(kappa3=[1]), "the key 'length' is missing"),
        (lambda: Spline(points=[[0, 0]]), "points: found 1, accepted: two points or more"),
        (
            lambda: Spline(points=[[0, 0], [1, 0], [1, 0], [2, 0]]),
            r"points: found points 2 and 3 at \[1, 0, 0\], accepted: each point once",
        ),
    ],
)
def test_wrong_shapes_are_refused(make, message):
    with pytest.raises(SceneError, match=message):
        make()


SPRING = Helix(radius=0.5, pitch=0.1, turns=2, axis=[0, 0, 1], center=[0, 0, 0])


@pytest.mark.parametrize(
    ("shape", "start", "end", "options", "message"),
    [
        (
            Straight(),
            [1, 2, 3],
            [1, 2, 3],
            {},
            r"shape: found both nodes at \[1, 2, 3\], accepted: nodes apart",
        ),
        (Arc(angle=1), [1, 2, 3], [1, 2, 3], {}, r"shape: found both nodes at \[1, 2, 3\]"),
        (Curvature(twist=[1], length=1), [1, 2, 3], [1, 2, 3], {}, "shape: found both nodes at"),
        (
            Arc(angle=1),
            [0, 0, 0],
            [0, 0, 1],
            {},
            r"shape\.normal: found both nodes on one line along the normal",
        ),
        (
            Arc(angle=1),
            [0, 0, 0],
            [3, 4, 0.01],
            {},
            r"shape: found its end at \[3, 4, 0\], 0\.01 m from the second node at \[3, 4, 0\.01\], "
            r"accepted: up to 1e-06 of its length of 5\.21457 m",
        ),
        (
            Arc(angle=0.5 * math.pi, start=[0, 1, 0]),
            [0, 0, 0],
            [1, 1, 0],
            {},
            r"shape\.start: found \[0, 1, 0\], 1\.57 rad off the tangent \[1, .*\] that angle and nodes give",
        ),
        (
            Arc(angle=0.5 * math.pi, start=[1, 2e-6, 0]),
            [0, 0, 0],
            [1, 1, 0],
            {},
            r"shape\.start: found .*, 2e-06 rad off the tangent",
        ),
        (
            SPRING,
            [0.6, 0, 0],
            [0.6, 0, 0.2],
            {},
            r"shape\.radius: found 0\.5, but the first node is 0\.6 m from the axis",
        ),
        (
            SPRING,
            [0, 0, 0],
            [0, 0, 0.2],
            {},
            r"shape\.radius: found 0\.5, but the first node is 0 m from the axis",
        ),
        (
            SPRING,
            [0.5, 0, 0],
            [0.5, 0, -0.2],
            {},
            r"shape: found its end at \[0\.5, .*, 0\.2\], 0\.4 m from the second",
        ),
        (
            Curvature(kappa3=[1], length=1),
            [0, 0, 0],
            [1, 0, 0],
            {},
            "shape: the key 'start' is missing, a bent line",
        ),
        (Curvature(kappa2=[1], length=1), [0, 0, 0], [1, 0, 0], {}, "shape: the key 'start' is missing"),
        (
            Curvature(length=2),
            [0, 0, 0],
            [1, 0, 0],
            {},
            r"shape: found its end at \[2, 0, 0\], 1 m from the second node",
        ),
        (
            Curvature(length=1, start=[1, 0, 0]),
            [0, 0, 0],
            [1, 1.01e-6, 0],
            {},
            r"shape: found its end at \[1, 0, 0\], 1\.01e-06 m from the second node",
        ),
        (
            Curvature(kappa3=[1e6], length=1, start=[1, 0, 0]),
            [0, 0, 0],
            [1, 0, 0],
            {},
            "shape: found a curvature of over 5000 rad along the member",
        ),
        (
            Spline(points=POINTS),
            [0, 0, 0.1],
            POINTS[-1],
            {},
            r"shape\.points: found the first point 0\.1 m from the first node at \[0, 0, 0\.1\]",
        ),
        (
            Spline(points=POINTS),
            POINTS[0],
            [2.5, 3, 1.5],
            {},
            r"shape: found its end at \[2\.5, 3, 1\], 0\.5 m from the second node at \[2\.5, 3, 1\.5\]",
        ),
        (
            Spline(points=[[0, 0], [1, 0], [0.5, 0]]),
            [0, 0, 0],
            [0.5, 0, 0],
            {},
            r"shape\.points: found a curve that turns back between points 1 and 2, accepted: points along",
        ),
        (
            Straight(),
            [0, 0, 0],
            [1, 0, 0],
            {"b2": [-2, 1e-6, 0]},
            r"b2: found \[-2, 1e-06, 0\], 5e-07 rad off the tangent at the first node \[1, 0, 0\]",
        ),
        (Straight(), [0, 0, 0], [1, 0, 0], {"b2": [0, 0, 0]}, "b2: found a vector of zero length"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(shape, start, end, options, message):
    with pytest.raises(SceneError, match=r"^members\.beam\." + message) as caught:
        place(shape, start, end, where=("members", "beam"), **options)
    assert caught.value.where[:2] == ("members", "beam")


def test_helix_around_its_first_node_is_refused_however_long_it_is():
    helix = Helix(radius=1e-4, pitch=1e3, turns=1, axis=[0, 0, 1], center=[0, 0, 0])
    with pytest.raises(SceneError, match=r"radius: found 0\.0001, but the first node is 0 m from the axis"):
        place(helix, [0, 0, 0], [0, 0, 1e3])


def test_only_shapes_can_be_placed():
    with pytest.raises(TypeError, match="'straight' is not a shape"):
        place("straight", [0, 0, 0], [1, 0, 0])
