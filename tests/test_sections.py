"""Cross-sections: what they tell along the member, and what they refuse in which words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sfetcas.description.records import Record
from sfetcas.description.sections import CrossSection, Polynomial, Table, Varying, breaks, evaluate
from sfetcas.errors import SceneError

X = np.array([0.0, 0.3, 0.5, 0.9, 1.0])

# A handful of operations with numbers of one size: some units in the last place.
ROUNDING = 1e-14


class _Holder(Record):
    quantity: Varying


def _varying(value):
    return _Holder(quantity=value).quantity


# Quantities along a member


def test_number_is_constant():
    assert evaluate(_varying(2), X) == pytest.approx(np.full(5, 2.0), abs=0.0)
    assert breaks(_varying(2)) == ()


def test_table_is_linear_between_its_points():
    table = _varying({"at": [0, 0.5, 1], "value": [1, -2, 0]})
    assert isinstance(table, Table)
    assert evaluate(table, X) == pytest.approx([1.0, -0.8, -2.0, -0.4, 0.0], abs=ROUNDING)
    assert breaks(table) == (0.5,)


def test_polynomial_rises_from_the_constant():
    varying = _varying({"polynomial": [1, -0.5, 3]})
    assert isinstance(varying, Polynomial)
    assert evaluate(varying, X) == pytest.approx(1.0 - 0.5 * X + 3.0 * X**2, abs=ROUNDING)
    assert breaks(varying) == ()


def test_quantities_are_kept_as_records():
    assert _varying(Table(at=[0, 1], value=[1, 2])) == Table(at=np.array([0.0, 1.0]), value=(1, 2))
    assert evaluate(3.0, 0.5).shape == (1,)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1 m", r"quantity: found '1 m', which is no formula"),
        (True, "quantity: found True, accepted: a number"),
        ([1, 2], r"quantity: found \[1, 2\], accepted: a number, a formula of x, \{at"),
        ({"x": 1}, r"quantity: found \{'x': 1\}, accepted: a number, a formula of x, \{at"),
        (math.inf, "quantity: found inf, accepted: a finite number"),
        ({"at": [0, 1]}, "quantity: the key 'value' is missing"),
        ({"at": [0], "value": [1]}, r"quantity\.at: found 1 fractions, accepted: two or more"),
        ({"at": [0, 1], "value": [1]}, r"quantity\.value: found 1 values at 2 fractions"),
        ({"at": [0, 0.5], "value": [1, 2]}, r"quantity\.at: found 0 to 0\.5, accepted: from 0 to 1"),
        ({"at": [0.1, 1], "value": [1, 2]}, r"quantity\.at: found 0\.1 to 1, accepted: from 0 to 1"),
        ({"at": [0, 0.5, 0.5, 1], "value": [1] * 4}, r"found 0\.5 after 0\.5, accepted: rising"),
        ({"at": [0, 1], "value": [1, 2], "unit": "m"}, "quantity: unknown key 'unit'"),
        ({"polynomial": []}, r"quantity\.polynomial: found an empty list"),
        ({"polynomial": [1, "x"]}, r"quantity\.polynomial.*found 'x', accepted: a number"),
    ],
)
def test_wrong_quantities_are_refused(value, message):
    with pytest.raises(SceneError, match=message):
        _varying(value)


# Sections of numbers


def test_stiffness_is_about_the_tangent_b2_b3():
    section = CrossSection(EI2=2, EI3={"polynomial": [1, 1]}, GJ={"at": [0, 1], "value": [3, 5]})
    expected = np.column_stack([3.0 + 2.0 * X, np.full(5, 2.0), 1.0 + X])
    assert section.stiffness(X) == pytest.approx(expected, rel=ROUNDING)


def test_what_is_not_given_is_nan_and_missing():
    section = CrossSection(EI3=1.0)
    assert np.isnan(section.stiffness(X)).tolist() == [[True, True, False]] * 5
    assert np.isnan(section.mass(X)).all()
    assert section.missing(["rhoA", "EI3", "GJ"]) == ["rhoA", "GJ"]


def test_mass_and_rotary_inertia():
    section = CrossSection(rhoA={"polynomial": [1, 2]}, rhoI=[0.02, {"polynomial": [0, 1]}, 0])
    assert section.mass(X) == pytest.approx(1.0 + 2.0 * X, rel=ROUNDING)
    assert section.inertia(X) == pytest.approx(np.column_stack([0.02 + 0.0 * X, X, 0.0 * X]), rel=ROUNDING)
    assert CrossSection(rhoA=1.0).inertia(X) == pytest.approx(np.zeros((5, 3)), abs=0.0)


def test_breaks_are_those_of_all_quantities():
    section = CrossSection(
        EI2={"at": [0, 0.6, 1], "value": [1, 2, 1]},
        GJ={"at": [0, 0.2, 0.6, 1], "value": [1, 2, 1, 1]},
        rhoI=[1, 1, {"at": [0, 0.7, 1], "value": [1, 2, 1]}],
    )
    assert section.breaks == (0.2, 0.6, 0.7)
    assert CrossSection(EI2=1).breaks == ()


@pytest.mark.parametrize("name", ["EI2", "EI3", "GJ"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (0, "found 0, accepted: a number above zero"),
        (-1.5, r"found -1\.5, accepted: a number above zero"),
        (
            {"at": [0, 0.5, 1], "value": [1, -2, 1]},
            r"found -2 at 0\.5 of the length, .* above zero everywhere",
        ),
        ({"polynomial": [1, -1]}, "found 0 at 1 of the length"),
        # lowest between the ends: 1 - 5 x + 6 x^2 at 5/12, where it is -1/24
        ({"polynomial": [1, -5, 6]}, r"found -0\.0416667 at 0\.416667 of the length"),
        # a minimum of fourth order, whose critical point is a triple root, and a double zero
        ({"polynomial": [0.0625, -0.5, 1.5, -2, 1]}, r"found 0 at 0\.(5|49999)"),
        ({"polynomial": [1, -6, 9]}, r"found 0 at 0\.333"),
    ],
)
def test_stiffness_is_above_zero_everywhere(name, value, message):
    with pytest.raises(SceneError, match=f"^{name}: {message}"):
        CrossSection(**{name: value})


def test_a_mass_may_be_zero_but_not_below():
    assert not CrossSection(EI3=1, rhoA=0).heavy
    assert CrossSection(EI3=1, rhoA={"polynomial": [1, -1]}).heavy
    with pytest.raises(SceneError, match=r"^rhoA: found -2 at 0\.5 of the length, .* zero or a number above zero"):
        CrossSection(rhoA={"at": [0, 0.5, 1], "value": [1, -2, 1]})


@pytest.mark.parametrize("value", [[1, -5, 6.26], [1e-9], [0.1, 0, 0, 5], [1, -2, 1.0001]])
def test_polynomials_above_zero_are_taken(value):
    assert CrossSection(EI2={"polynomial": value}).stiffness(np.linspace(0.0, 1.0, 999))[:, 1].min() > 0.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "found nothing in it, accepted: EI2, EI3, GJ, EA, GA2, GA3, stiffness, rhoA, rhoI or a shape"),
        ({"EI": 1}, "unknown key 'EI'; did you mean 'EI3'"),
        ({"rhoI": 1}, "rhoI: found 1, accepted: three numbers, about b1, b2 and b3"),
        ({"rhoI": [1, 2]}, "rhoI: found 2 numbers, accepted: three"),
        ({"rhoI": [1, 2, -1]}, "rhoI.*: found -1, accepted: zero or a number above zero"),
        ({"rhoI": [1, 2, {"polynomial": [1, -3]}]}, "rhoI.*: found -2 at 1 of the length"),
        (
            {"radius": 1, "EI2": 1},
            "found 'radius' without a shape, accepted: shape = rectangle | circle | tube",
        ),
        ({"E": 1}, "found 'E' without a shape"),
        ({"shape": "circl"}, "shape: found 'circl', accepted: .*did you mean 'circle'"),
        ({"shape": "circle", "E": 1, "radius": 1, "EI2": 1}, "found 'EI2' together with shape = 'circle'"),
        ({"shape": "circle", "E": 1, "radius": 1, "rhoA": 1}, "found 'rhoA' together with shape = 'circle'"),
        ({"shape": "circle", "E": 1, "radius": 1, "rhoI": [1, 1, 1]}, "found 'rhoI' together with shape"),
        ({"shape": "circle", "radius": 1}, "the key 'E' is missing, a circle needs radius and E"),
        ({"shape": "rectangle", "E": 1, "width": 1}, "the key 'height' is missing, a rectangle needs width"),
        (
            {"shape": "rectangle", "E": 1, "width": 1, "height": 1, "radius": 1},
            "found 'radius' for a rectangle, accepted: width and height",
        ),
        ({"shape": "circle", "E": 1, "radius": 0}, "radius: found 0, accepted: a number above zero"),
        ({"shape": "circle", "E": 1, "radius": 1, "nu": 0.3, "G": 1}, "found both nu and G, accepted: one"),
        ({"shape": "circle", "E": 1, "radius": 1, "nu": 0.6}, r"nu: found 0\.6, accepted: .*up to 0\.5"),
        ({"shape": "circle", "E": 1, "radius": 1, "nu": -1}, "nu: found -1, accepted: a number above -1"),
        ({"shape": "tube", "E": 1, "outer": 1, "inner": 1}, "found inner 1 and outer 1 at 0 of the length"),
        (
            # only at the kink is the wall gone
            {
                "shape": "tube",
                "E": 1,
                "outer": {"polynomial": [1, -1, 1]},
                "inner": {"at": [0, 0.4, 1], "value": [0.5, 0.8, 0.5]},
            },
            r"found inner 0\.8 and outer 0\.76 at 0\.4 of the length, accepted: inner below outer",
        ),
    ],
)
def test_wrong_sections_are_refused(values, message):
    with pytest.raises(SceneError, match=message):
        CrossSection(**values)


# Shapes


def _moments(width: float, height: float, inside, count: int = 2000):
    """Area, second moments about b2 and b3 by the midpoint rule: b2 along the height, b3 along the width."""
    z = (np.arange(count) + 0.5) / count - 0.5
    along_b2, along_b3 = np.meshgrid(height * z, width * z, indexing="ij")
    cell = inside(along_b2, along_b3) * width * height / count**2
    return cell.sum(), (cell * along_b3**2).sum(), (cell * along_b2**2).sum()


@pytest.mark.parametrize(
    ("shape", "box", "inside"),
    [
        ({"shape": "rectangle", "width": 0.03, "height": 0.01}, (0.03, 0.01), lambda a, b: a == a),
        ({"shape": "circle", "radius": 0.02}, (0.04, 0.04), lambda a, b: np.hypot(a, b) < 0.02),
        (
            {"shape": "tube", "outer": 0.02, "inner": 0.015},
            (0.04, 0.04),
            lambda a, b: (np.hypot(a, b) < 0.02) & (np.hypot(a, b) > 0.015),
        ),
    ],
)
def test_shapes_against_sums_over_small_squares(shape, box, inside):
    area, about_2, about_3 = _moments(*box, inside)
    section = CrossSection(E=7.0, G=3.0, rho=5.0, **shape)
    # 2000 squares across: boundary cells are wrong by some 1/2000 with random sign, smooth sums by 1e-7
    tolerance = 1e-4
    assert section.mass([0.5])[0] == pytest.approx(5.0 * area, rel=tolerance)
    expected = [5.0 * (about_2 + about_3), 5.0 * about_2, 5.0 * about_3]
    assert section.inertia([0.5])[0] == pytest.approx(expected, rel=tolerance)
    assert section.stiffness([0.5])[0, 1:] == pytest.approx([7.0 * about_2, 7.0 * about_3], rel=tolerance)


def test_width_is_along_b3_and_height_along_b2():
    section = CrossSection(shape="rectangle", width=0.03, height=0.01, E=12.0)
    expected = [0.01 * 0.03**3, 0.03 * 0.01**3]
    assert section.stiffness([0.0])[0, 1:] == pytest.approx(expected, rel=ROUNDING)


def test_circle_and_tube_closed_forms():
    circle = CrossSection(shape="circle", radius=0.2, E=1.0, G=1.0, rho=1.0)
    second = math.pi * 0.2**4 / 4.0
    assert circle.stiffness([0.0])[0] == pytest.approx([2.0 * second, second, second], rel=ROUNDING)
    tube = CrossSection(shape="tube", outer=0.2, inner=0.1, E=1.0, G=1.0, rho=1.0)
    hollow = math.pi * (0.2**4 - 0.1**4) / 4.0
    assert tube.stiffness([0.0])[0] == pytest.approx([2.0 * hollow, hollow, hollow], rel=ROUNDING)
    assert tube.mass([0.0])[0] == pytest.approx(math.pi * (0.2**2 - 0.1**2), rel=ROUNDING)


def test_thin_tube_keeps_its_digits():
    radius, wall = 1.0, 2.0**-40
    tube = CrossSection(shape="tube", outer=radius + wall, inner=radius, E=1.0)
    # pi r^3 t up to a relative wall of 1e-12
    assert tube.stiffness([0.0])[0, 1] == pytest.approx(math.pi * radius**3 * wall, rel=3e-12)


@pytest.mark.parametrize(("width", "height"), [(0.01277, 0.0032024), (0.0032024, 0.01277), (1.0, 1.0), (3.0, 0.01)])
def test_torsion_of_rectangles_against_the_plain_series(width, height):
    a, b = max(width, height), min(width, height)
    n = np.arange(1.0, 40001.0, 2.0)[::-1]
    series = np.sum(np.tanh(n * math.pi * a / (2.0 * b)) / n**5)
    expected = a * b**3 / 3.0 * (1.0 - 192.0 * b / (math.pi**5 * a) * series)
    section = CrossSection(shape="rectangle", width=width, height=height, E=1.0, G=1.0)
    # what the plain series lacks after 40000 is below 1e-18; the rest is rounding
    assert section.stiffness([0.0])[0, 0] == pytest.approx(expected, rel=ROUNDING)


def test_torsion_of_the_princeton_strip():
    section = CrossSection(shape="rectangle", width=0.01277, height=0.0032024, E=1.0, G=1.0)
    # all digits of the series; 30 terms of it would give 1.17701728363014e-10
    assert section.stiffness([0.0])[0, 0] == pytest.approx(1.1770172815106244e-10, rel=1e-13)


def test_torsion_of_a_square_is_the_tabulated_one():
    section = CrossSection(shape="rectangle", width=2.0, height=2.0, E=1.0, G=1.0)
    # Timoshenko and Goodier print 0.1406 for ratio 1
    assert section.stiffness([0.0])[0, 0] / 2.0**4 == pytest.approx(0.1406, abs=5e-5)


def test_shear_modulus_follows_from_poisson():
    by_ratio = CrossSection(shape="circle", radius=1.0, E=2.6, nu=0.3)
    by_modulus = CrossSection(shape="circle", radius=1.0, E=2.6, G=1.0)
    assert by_ratio.stiffness(X) == pytest.approx(by_modulus.stiffness(X), rel=ROUNDING)


def test_shape_without_shear_modulus_or_density():
    section = CrossSection(shape="circle", radius=1.0, E=1.0)
    assert np.isnan(section.stiffness([0.0])[0]).tolist() == [True, False, False]
    assert np.isnan(section.mass([0.0])).all()
    assert section.missing(["EI2", "EI3", "GJ", "rhoA"]) == ["GJ", "rhoA"]
    assert CrossSection(shape="circle", radius=1.0, E=1.0, nu=0.3, rho=1.0).missing(["GJ", "rhoA"]) == []


def test_tapered_shape_follows_its_dimensions():
    width = {"at": [0, 0.5, 1], "value": [0.1, 0.2, 0.1]}
    section = CrossSection(shape="rectangle", width=width, height=0.05, E=12.0, nu=0.25, rho=2.0)
    for x in X:
        local = CrossSection(
            shape="rectangle", width=np.interp(x, *width.values()), height=0.05, E=12.0, nu=0.25, rho=2.0
        )
        assert section.stiffness([x]) == pytest.approx(local.stiffness([0.0]), rel=ROUNDING)
        assert section.mass([x]) == pytest.approx(local.mass([0.0]), rel=ROUNDING)
    assert section.breaks == (0.5,)
