"""Quaternions against rotation matrices, Rodrigues' formula and the matrices G of the source."""

import numpy as np

from sfetcas.mathematics import quaternion as quat
from sfetcas.mathematics.arrays import cross

RNG = np.random.default_rng(1)
PHI = RNG.normal(size=(20, 3))
Q = quat.from_rotation_vector(PHI)
P = quat.from_rotation_vector(RNG.normal(size=(20, 3)))
V = RNG.normal(size=(20, 3))
ROUNDING = 1e-14  # some ten operations on numbers of order one


def rodrigues(phi):
    angle = np.linalg.norm(phi)
    k = phi / angle
    matrix = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * matrix + (1 - np.cos(angle)) * matrix @ matrix


def test_rotation_vector_is_rodrigues_formula():
    expected = np.array([rodrigues(phi) for phi in PHI])
    np.testing.assert_allclose(quat.matrix(Q), expected, atol=ROUNDING)
    np.testing.assert_allclose(quat.rotate(Q, V), np.einsum("nij,nj->ni", expected, V), atol=ROUNDING)


def test_product_turns_by_the_second_factor_first():
    both = np.einsum("nij,njk->nik", quat.matrix(Q), quat.matrix(P))
    np.testing.assert_allclose(quat.matrix(quat.multiply(Q, P)), both, atol=ROUNDING)


def test_units_multiply_as_hamilton_says():
    one, i, j, k = np.eye(4)
    for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
        np.testing.assert_array_equal(quat.multiply(a, b), c)
        np.testing.assert_array_equal(quat.multiply(b, a), -c)
        np.testing.assert_array_equal(quat.multiply(a, a), -one)


def test_conjugate_is_the_inverse():
    np.testing.assert_allclose(quat.multiply(Q, quat.conjugate(Q)), np.tile([1.0, 0, 0, 0], (20, 1)), atol=ROUNDING)


def test_turned_is_homogeneous_of_degree_two():
    scaled = quat.turned(list(3.0 * Q.T), list(V.T))
    np.testing.assert_allclose(np.array(scaled).T, 9.0 * quat.rotate(Q, V), atol=1e-13)


def test_tangent_of_the_source():
    l0, l1, l2, l3 = Q.T
    b1 = np.stack([l0**2 + l1**2 - l2**2 - l3**2, 2 * (l1 * l2 + l0 * l3), 2 * (l1 * l3 - l0 * l2)], axis=-1)
    np.testing.assert_allclose(quat.rotate(Q, [1.0, 0, 0]), b1, atol=ROUNDING)


def test_body_and_fixed_spin_of_the_source():
    """conj(q) q' and q' conj(q) are the matrices G and G1 of the source times q'."""
    rate = RNG.normal(size=(20, 4))
    l0, l1, l2, l3 = Q.T
    body = np.array([[-l1, l0, l3, -l2], [-l2, -l3, l0, l1], [-l3, l2, -l1, l0]])
    fixed = np.array([[-l1, l0, -l3, l2], [-l2, l3, l0, -l1], [-l3, -l2, l1, l0]])
    for g, spin in ((body, quat.multiply(quat.conjugate(Q), rate)), (fixed, quat.multiply(rate, quat.conjugate(Q)))):
        np.testing.assert_allclose(spin[:, 1:], np.einsum("ijn,nj->ni", g, rate), atol=ROUNDING)


def test_small_and_large_rotation_vectors():
    np.testing.assert_array_equal(quat.from_rotation_vector([0.0, 0.0, 0.0]), [1, 0, 0, 0])
    tiny = quat.from_rotation_vector([1e-9, -2e-9, 3e-9])
    np.testing.assert_allclose(tiny[1:], [0.5e-9, -1e-9, 1.5e-9], rtol=1e-15)
    # More than half a turn keeps its sign: a continuous field stays continuous.
    np.testing.assert_allclose(quat.from_rotation_vector([0, 0, 2 * np.pi]), [-1, 0, 0, 0], atol=ROUNDING)
    field = quat.from_rotation_vector(np.linspace(0, 20, 400)[:, None] * np.array([0.6, 0.0, 0.8]))
    assert np.linalg.norm(np.diff(field, axis=0), axis=1).max() < 0.5 * 20 / 399 * 1.001


def test_rotation_vectors_are_read_back():
    rng = np.random.default_rng(5)
    phi = rng.normal(size=(40, 3))
    phi *= rng.uniform(0.0, 3.1, 40)[:, None] / np.linalg.norm(phi, axis=1, keepdims=True)
    phi[:3] *= [[0.0], [1e-9], [1e-200]]
    q = quat.from_rotation_vector(phi)
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(quat.rotation_vector(sign * q), phi, rtol=1e-14, atol=4 * ROUNDING)


def test_cross_matrices_multiply_as_cross_products():
    v, w = np.random.default_rng(6).normal(size=(2, 5, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", quat.cross_matrix(v), w), np.cross(v, w), atol=4 * ROUNDING)


def test_single_ones_are_turned_as_many_are():
    """To the last bit: formulas are the same, with floats instead of arrays."""
    rng = np.random.default_rng(3)
    for q, p in rng.standard_normal((200, 2, 4)):
        assert np.array_equal(quat.multiply(q, p), quat.multiply(q[None], p[None])[0])
        assert np.array_equal(quat.rotate(q, p[1:]), quat.rotate(q[None], p[None, 1:])[0])
        assert np.array_equal(cross(q[1:], p[1:]), np.cross(q[1:], p[1:]))
    vectors = rng.standard_normal((2, 5, 3))
    assert np.array_equal(cross(*vectors), np.cross(*vectors))
