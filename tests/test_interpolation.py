"""Quadrature and interpolation against polynomials, whose integrals and derivatives are known."""

import numpy as np
import pytest
from numpy.polynomial import polynomial

from sfetcas.mathematics import interpolation as ip

SIZES = range(2, 10)


def monomials(x, degree):
    return np.stack([np.asarray(x) ** k for k in range(degree + 1)], axis=-1)


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize(("rule", "exact"), [(ip.gauss, lambda n: 2 * n - 1), (ip.lobatto, lambda n: 2 * n - 3)])
def test_degree_of_exactness(rule, exact, n):
    x, w = rule(n)
    degree = exact(n)
    found = w @ monomials(x, degree + 1)
    expected = 1.0 / np.arange(1.0, degree + 3.0)
    np.testing.assert_allclose(found[:-1], expected[:-1], atol=1e-15 * n)  # rounding of n summands
    # One degree more is integrated wrongly: the rule is not another one of higher order.
    assert abs(found[-1] - expected[-1]) > 1e-12


@pytest.mark.parametrize("n", SIZES)
def test_points_are_symmetric_and_fixed(n):
    for rule in (ip.gauss, ip.lobatto):
        x, w = rule(n)
        np.testing.assert_allclose(x, 1.0 - x[::-1], atol=2e-16)
        np.testing.assert_allclose(w, w[::-1], atol=1e-15)
        with pytest.raises(ValueError, match="read-only"):
            x[0] = 0.5
    assert ip.lobatto(n)[0][[0, -1]].tolist() == [0.0, 1.0]


def test_known_points():
    s = np.sqrt(1 / 5)
    np.testing.assert_allclose(ip.lobatto(4)[0], [0, 0.5 - 0.5 * s, 0.5 + 0.5 * s, 1], atol=1e-16)
    np.testing.assert_allclose(ip.lobatto(4)[1], [1 / 12, 5 / 12, 5 / 12, 1 / 12], atol=1e-16)
    np.testing.assert_allclose(ip.lobatto(3)[1], [1 / 6, 2 / 3, 1 / 6], atol=1e-16)


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("rule", [ip.gauss, ip.lobatto])
def test_matrices_are_exact_for_polynomials(rule, n):
    nodes = rule(n)[0]
    x = np.array([0.0, 0.13, 0.5, nodes[1], 0.987, 1.0])
    c = np.random.default_rng(n).normal(size=n)
    values = polynomial.polyval(nodes, c)
    tolerance = 1e-13 * n**2  # slopes of degree n - 1 grow like n^2
    np.testing.assert_allclose(ip.evaluation(nodes, x) @ values, polynomial.polyval(x, c), atol=tolerance)
    slope = polynomial.polyder(c)
    np.testing.assert_allclose(ip.differentiation(nodes, x) @ values, polynomial.polyval(x, slope), atol=tolerance)
    np.testing.assert_allclose(ip.differentiation(nodes) @ values, polynomial.polyval(nodes, slope), atol=tolerance)
    area = polynomial.polyint(c)
    np.testing.assert_allclose(ip.integration(nodes, x) @ values, polynomial.polyval(x, area), atol=tolerance)


@pytest.mark.parametrize("n", SIZES)
def test_integration_ends_with_the_weights(n):
    """The last row of the integration matrix of Lobatto points are the weights: transposed it would not be."""
    x, w = ip.lobatto(n)
    np.testing.assert_allclose(ip.integration(x, x)[-1], w, atol=1e-15)
    np.testing.assert_array_equal(ip.integration(x, x)[0], np.zeros(n))


@pytest.mark.parametrize("n", SIZES)
def test_legendre_tail(n):
    nodes = ip.lobatto(n)[0]
    top = np.polynomial.legendre.Legendre.basis(n - 1)(2 * nodes - 1)
    lower = np.polynomial.legendre.Legendre.basis(n - 2)(2 * nodes - 1)
    assert ip.legendre_tail(nodes) @ top == pytest.approx(1.0, abs=1e-13)
    assert ip.legendre_tail(nodes) @ lower == pytest.approx(0.0, abs=1e-13)
