"""Elements of all orders, in plane and space, with both integrations: identities and closed forms."""

import casadi as ca
import numpy as np
import pytest
from scenes import cantilever, elastica, made, turned_about

from sfetcas.mathematics import quaternion as quat
from sfetcas.mathematics.interpolation import differentiation, evaluation
from sfetcas.mechanics.elements import ELEMENTS, Element, element_by_name
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.mechanics.terms import curvatures_of, energies_of, rotation_gradient, rows_of, slopes_of
from sfetcas.solvers.prepared import Prepared

ALL = [Element(space, p, gauss) for p in range(1, 9) for space in (False, True) for gauss in (False, True)]
IDS = [f"{e.name}-{'space' if e.space else 'plane'}-{'gauss' if e.gauss else 'nodes'}" for e in ALL]
each = pytest.mark.parametrize("element", ALL, ids=IDS)


def data(element, seed=0):
    """Random stiffness (positive), tangents and pulls at the points, and a random smooth rotation."""
    rng = np.random.default_rng(seed)
    n, axes = element.order + 1, element.axes
    if element.space:
        root = rng.normal(size=(n, 3, 3))
        full = root @ root.transpose(0, 2, 1) + np.eye(3)
        stiffness = full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]].T
    else:
        stiffness = rng.uniform(0.5, 2.0, size=(1, n))
    tangent = rng.normal(size=(axes, n))
    pull = rng.normal(size=(axes, n))
    return field(element, rng), stiffness, tangent, pull


def field(element, rng):
    x = element.nodes[:, None]
    phi = rng.normal(size=3) * 0.4 + x * rng.normal(size=3) + x**2 * rng.normal(size=3) * 0.3
    return quat.from_rotation_vector(phi).T if element.space else phi[:, 2:].T


def moved(element, q, phi):
    """Nodal rotations turned further by phi (turns, n) about the fixed axes."""
    if not element.space:
        return q + phi
    return quat.multiply(quat.from_rotation_vector(phi.T), q.T).T


CONSTANT = np.array([0.3, -0.7, 0.4])
"""A share of the pull that is given as the multiplier of the chord."""


def arguments(element, q, stiffness, tangent, pull):
    """Rotations, displacements, data, loads and multipliers, which together pull as given."""
    constant = CONSTANT[: element.axes]
    data = np.concatenate([stiffness.ravel(order="F"), tangent.ravel(order="F")])
    return q, np.zeros((element.axes, 0)), data, (pull - constant[:, None]).ravel(order="F"), constant


def evaluated(element, q, stiffness, tangent, pull):
    """Strain energy, work of the pull, moments, stiffness, chord and its derivative."""
    given = arguments(element, q, stiffness, tangent, pull)
    energy, strain, gained, moments, matrix, rotation_jacobian = rotation_gradient(element)(*given)
    work = float(energy - strain) + CONSTANT[: element.axes] @ gained.full().ravel() + (pull * tangent).sum()
    return strain, ca.DM(work), moments, matrix, gained + tangent.sum(axis=1), rotation_jacobian


def energy_of(element, q, stiffness, tangent, pull):
    """Strain energy and work of the pull."""
    given = arguments(element, q, stiffness, tangent, pull)
    energy, gained = energies_of(element)(*given[:4])[0], rows_of(element)(*given[:4])
    return float(energy) + given[4] @ gained.full().ravel() + (pull * tangent).sum()


def gradient_of(element, q, stiffness, tangent, pull):
    """Its derivative by the components."""
    given = arguments(element, q, stiffness, tangent, pull)
    gradient, jacobian = slopes_of(element)(*given[:4])
    return (gradient + jacobian.T @ given[4]).full().ravel()


def hessian_of(element, q, stiffness, tangent, pull):
    """Its second derivative by the components, where the energy has a weight, too."""
    *given, lam = arguments(element, q, stiffness, tangent, pull)
    return curvatures_of(element)(*given, 1.7 * lam, 1.7).full() / 1.7


def chord(element, q, tangent):
    data = np.concatenate([np.zeros(element.stiffnesses * (element.order + 1)), tangent.ravel(order="F")])
    nothing = np.zeros((element.axes, 0)), data, np.zeros(tangent.size)
    return rows_of(element)(q, *nothing).full().ravel() + tangent.sum(axis=1)


@each
def test_rigid_rotation_of_an_unloaded_element_costs_nothing(element):
    _, stiffness, tangent, pull = data(element)
    one = quat.from_rotation_vector([0.7, -1.1, 2.0]) if element.space else np.array([2.0])
    q = np.tile(one[:, None], element.order + 1)
    out = evaluated(element, q, stiffness, tangent, 0.0 * pull)
    # The differentiation matrix annihilates constants up to rounding, which grows with the order.
    scale = np.abs(stiffness).max()
    assert float(out[0]) == pytest.approx(0.0, abs=1e-22 * scale)
    np.testing.assert_allclose(out[2].full(), 0.0, atol=1e-12 * scale)
    expected = quat.rotate(one, tangent.T).T if element.space else turned_about([0, 0, 1], 2.0)[:2, :2] @ tangent
    np.testing.assert_allclose(out[4].full().ravel(), expected.sum(axis=1), atol=1e-13)


@each
def test_undeformed_element_has_no_strain_and_its_own_chord(element):
    _, stiffness, tangent, pull = data(element, 3)
    q = np.zeros((element.components, element.order + 1))
    q[0] = 1.0 if element.space else 0.0
    out = evaluated(element, q, stiffness, tangent, pull)
    assert float(out[0]) == pytest.approx(0.0, abs=1e-25)  # squares of rounding
    np.testing.assert_allclose(out[4].full().ravel(), tangent.sum(axis=1), atol=1e-14)
    assert float(out[1]) == pytest.approx((pull * tangent).sum(), abs=1e-13)


@each
def test_gradient_and_hessian_against_complex_and_central_differences(element):
    q, stiffness, tangent, pull = data(element, 1)
    gradient = gradient_of(element, q, stiffness, tangent, pull)
    hessian = hessian_of(element, q, stiffness, tangent, pull)
    size, h = q.size, 1e-5
    by_energy, by_gradient = np.zeros(size), np.zeros((size, size))
    for i in range(size):
        step = np.zeros(size)
        step[i] = h
        step = step.reshape(q.shape, order="F")
        # Fourth order: h^4 times a fifth derivative of order 1e3 stays below 1e-16.
        e = [energy_of(element, q + k * step, stiffness, tangent, pull) for k in (-2, -1, 1, 2)]
        g = [gradient_of(element, q + k * step, stiffness, tangent, pull) for k in (-2, -1, 1, 2)]
        by_energy[i] = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
        by_gradient[i] = (g[0] - 8 * g[1] + 8 * g[2] - g[3]) / (12 * h)
    # Rounding of the energy over h: 1e-16 / 1e-5, relative to the size of the entries.
    np.testing.assert_allclose(gradient, by_energy, atol=1e-8 * max(1.0, np.abs(gradient).max()))
    np.testing.assert_allclose(hessian, by_gradient, atol=1e-8 * max(1.0, np.abs(hessian).max()))


@each
def test_turning_is_the_derivative_along_rotations(element):
    """Gradient and Hessian of phi -> energy(exp(phi) q) by differences, and through E of gradient and hessian."""
    q, stiffness, tangent, pull = data(element, 2)
    strain, work, moments, matrix, length, rotation_jacobian = (
        a.full() for a in evaluated(element, q, stiffness, tangent, pull)
    )
    n, turns = element.order + 1, element.turns

    def energy(vector):
        return energy_of(element, moved(element, q, vector.reshape(turns, n, order="F")), stiffness, tangent, pull)

    assert strain[0, 0] + work[0, 0] == pytest.approx(energy(np.zeros(turns * n)), rel=1e-14)
    assert work[0, 0] == pytest.approx((pull * turned_tangents(element, q, tangent)).sum(), rel=1e-12, abs=1e-13)
    np.testing.assert_allclose(length.ravel(), turned_tangents(element, q, tangent).sum(axis=1), atol=1e-13)
    h, rng = 1e-3, np.random.default_rng(5)
    for _ in range(3):
        v = rng.normal(size=turns * n)
        v /= np.linalg.norm(v)
        e = [energy(k * h * v) for k in range(-3, 4)]
        first = (-e[0] + 9 * e[1] - 45 * e[2] + 45 * e[4] - 9 * e[5] + e[6]) / (60 * h)
        second = (2 * e[0] - 27 * e[1] + 270 * e[2] - 490 * e[3] + 270 * e[4] - 27 * e[5] + 2 * e[6]) / (180 * h**2)
        # Sixth order: h^6 = 1e-18 of the seventh derivative; rounding 1e-16/h and 1e-16/h^2 of the energy.
        scale = max(1.0, np.abs(matrix).max())
        assert v @ moments.ravel() == pytest.approx(first, abs=1e-11 * scale)
        assert v @ matrix @ v == pytest.approx(second, abs=1e-8 * scale)
        reached = [
            chord(element, moved(element, q, (k * h * v).reshape(turns, n, order="F")), tangent) for k in (-2, -1, 1, 2)
        ]
        slope = (reached[0] - 8 * reached[1] + 8 * reached[2] - reached[3]) / (12 * h)
        np.testing.assert_allclose(rotation_jacobian @ v, slope, atol=1e-10)
    gradient = gradient_of(element, q, stiffness, tangent, pull)
    hessian = hessian_of(element, q, stiffness, tangent, pull)
    e_map, radial = basis_of(element, q), np.repeat((q * gradient.reshape(q.shape, order="F")).sum(axis=0), 3)
    expected = e_map.T @ hessian @ e_map - (0.25 * np.diag(radial) if element.space else 0.0)
    size = max(1.0, np.abs(hessian).max())
    np.testing.assert_allclose(moments.ravel(), e_map.T @ gradient, atol=1e-14 * size)
    np.testing.assert_allclose(matrix, expected, atol=1e-14 * size)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-14 * size)
    jacobian = slopes_of(element)(*arguments(element, q, stiffness, tangent, pull)[:4])[1]
    np.testing.assert_allclose(jacobian.full() @ e_map, rotation_jacobian, atol=1e-13)


def turned_tangents(element, q, tangent):
    at = evaluation(element.nodes, element.points) @ q.T
    if element.space:
        return quat.rotate(at / np.linalg.norm(at, axis=1, keepdims=True), tangent.T).T
    c, s = np.cos(at[:, 0]), np.sin(at[:, 0])
    return np.stack([c * tangent[0] - s * tangent[1], s * tangent[0] + c * tangent[1]])


def basis_of(element, q):
    """dq/dphi: half of (0, phi) q at each node."""
    n = element.order + 1
    if not element.space:
        return np.eye(n)
    e = np.zeros((4 * n, 3 * n))
    for k in range(n):
        for i, axis in enumerate(np.eye(3)):
            e[4 * k : 4 * k + 4, 3 * k + i] = 0.5 * quat.multiply([0.0, *axis], q[:, k])
    return e


@each
def test_strain_energy_by_its_definition(element):
    """Half kappa.C kappa of the normalised interpolation, summed over the points, in numpy."""
    q, stiffness, tangent, pull = data(element, 8)
    here = evaluation(element.nodes, element.points) @ q.T
    slope = differentiation(element.nodes, element.points) @ q.T
    if element.space:
        full = np.zeros((len(here), 3, 3))
        for row, (i, j) in zip(stiffness, [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)], strict=True):
            full[:, i, j] = full[:, j, i] = row
        size = np.linalg.norm(here, axis=1, keepdims=True)
        unit = here / size
        rate = (slope - unit * (unit * slope).sum(axis=1, keepdims=True)) / size
        kappa = 2.0 * quat.multiply(quat.conjugate(unit), rate)[:, 1:]
        expected = 0.5 * np.einsum("ni,nij,nj->", kappa, full, kappa)
    else:
        expected = 0.5 * (stiffness[0] * slope[:, 0] ** 2).sum()
    assert energy_of(element, q, stiffness, tangent, 0.0 * pull) == pytest.approx(expected, rel=1e-12)


@each
def test_strain_energy_does_not_see_a_superposed_rotation(element):
    q, stiffness, tangent, pull = data(element, 4)
    turn = quat.from_rotation_vector([1.3, 0.4, -0.9]) if element.space else 1.7
    turned = quat.multiply(turn, q.T).T if element.space else q + turn
    matrix = quat.matrix(turn) if element.space else turned_about([0, 0, 1], 1.7)[:2, :2]
    before = evaluated(element, q, stiffness, tangent, pull)
    after = evaluated(element, turned, stiffness, tangent, matrix @ pull)
    # The rotated scene with rotated pulls: same energies, turned moments and chord; rounding only.
    scale = np.abs(stiffness).max() * element.order**2
    assert float(after[0]) == pytest.approx(float(before[0]), rel=1e-12)
    assert float(after[1]) == pytest.approx(float(before[1]), abs=1e-13 * scale)
    np.testing.assert_allclose(after[4].full(), matrix @ before[4].full(), atol=1e-13)
    m = before[2].full().reshape(-1, element.turns)
    expected = m @ quat.matrix(turn).T if element.space else m
    np.testing.assert_allclose(after[2].full().reshape(m.shape), expected, atol=1e-13 * scale)


@each
def test_sum_of_moments_is_the_moment_of_the_pulls(element):
    """A common small rotation does no elastic work: the moments at the nodes add up to sum t x pull."""
    q, stiffness, tangent, pull = data(element, 6)
    moments = evaluated(element, q, stiffness, tangent, pull)[2].full().reshape(-1, element.turns).sum(axis=0)
    t = turned_tangents(element, q, tangent)
    expected = np.cross(t.T, pull.T).sum(axis=0) if element.space else (t[0] * pull[1] - t[1] * pull[0]).sum()
    np.testing.assert_allclose(
        moments, np.atleast_1d(expected), atol=1e-12 * np.abs(stiffness).max() * element.order**2
    )


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("p", range(1, 9))
def test_energy_of_a_uniformly_bent_plane_element(p, gauss):
    """1/2 EI kappa^2 h exactly: the angle is linear along the element."""
    element, h, ei, turn = Element(False, p, gauss), 0.7, 2.5, 1.1
    stiffness = (ei * element.weights / h)[None, :]
    energy = energy_of(element, (turn * element.nodes)[None, :], stiffness, np.zeros((2, p + 1)), np.zeros((2, p + 1)))
    assert energy == pytest.approx(0.5 * ei * turn**2 / h, rel=1e-13)


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("p", range(1, 9))
def test_energy_of_a_uniformly_bent_element_in_space(p, axis, gauss):
    """1/2 D kappa^2 h about each axis; the quaternion (cos, sin) is interpolated, so of order 2p in the angle."""
    h, stiff = 0.7, np.array([0.9, 2.5, 1.6])
    errors = []
    element = Element(True, p, gauss)
    for turn in (0.8, 0.4):
        phi = turn * element.nodes[:, None] * np.eye(3)[axis]
        stiffness = np.zeros((6, p + 1))
        stiffness[[0, 3, 5]] = stiff[:, None] * element.weights / h
        zero = np.zeros((3, p + 1))
        energy = energy_of(element, quat.from_rotation_vector(phi).T, stiffness, zero, zero)
        errors.append(abs(energy / (0.5 * stiff[axis] * turn**2 / h) - 1.0))
    # Halving the angle divides the error by 4^p; below 1e-12 it is rounding.  Constants: (turn/2)^2p / (2p)!.
    assert errors[0] < 0.2 * 0.8**2 * 0.2 ** (2 * (p - 1))
    assert errors[1] < max(errors[0] * 4.0**-p * 1.3, 1e-13)


def test_cross_terms_of_the_stiffness():
    """Entries 12, 13 and 23 of the upper triangle couple the curvatures; p = 1 at the nodes, checked by hand."""
    element = Element(True, 1)
    rng = np.random.default_rng(0)
    q = field(element, rng)
    slope = q[:, 1] - q[:, 0]
    for position, (i, j) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        stiffness = np.zeros((6, 2))
        stiffness[position] = [1.0, 3.0]
        full = np.zeros((3, 3))
        full[i, j] = full[j, i] = 1.0
        zero = np.zeros((3, 2))
        k = [2.0 * quat.multiply(quat.conjugate(q[:, n]), slope)[1:] for n in (0, 1)]
        expected = 0.5 * (k[0] @ full @ k[0] + 3.0 * k[1] @ full @ k[1])
        assert energy_of(element, q, stiffness, zero, zero) == pytest.approx(expected, rel=1e-13)


def tip(order, gauss, elements, space=False):
    scene = made({**cantilever((0.0, 10.0)), "dimension": "space" if space else "plane"})
    prepared = Prepared(assemble(scene, uniform_mesh(scene, order, elements, gauss)))
    loading = prepared.model.loading(1.0)
    state = prepared.equations.start(loading)
    for part in (0.05, 0.2, 0.5, 1.0):
        state = prepared.correct(state, prepared.model.loading(part), iterations=30).state
    found = prepared.correct(state, loading)
    assert found.converged
    return found.fields.position("B")[:2]


REFERENCE = elastica(10.0)


def test_reference_of_the_elastica():
    # Digits of the elliptic integrals, computed elsewhere to 16 places.
    np.testing.assert_allclose(REFERENCE, [0.445004402246249, 0.810609024880296], atol=3e-15)
    # Small loads: w = F L^3 / 3 EI (1 - 4 alpha^2 / 35), the next term is of relative size alpha^4.
    assert elastica(1e-2)[1] == pytest.approx(1e-2 / 3 * (1 - 4e-4 / 35), rel=1e-8)
    # The two formulas agree where one takes over from the other.
    np.testing.assert_allclose(elastica(1999.999999), elastica(2000.000001), atol=1e-10)


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
@pytest.mark.parametrize("p", range(1, 7))
def test_order_of_the_tip_is_twice_that_of_the_element(p, gauss):
    counts = {1: (16, 32, 64), 2: (16, 32), 3: (8, 16), 4: (6, 12), 5: (4, 8), 6: (3, 5)}[p]
    errors = [np.abs(tip(p, gauss, n) - REFERENCE).max() for n in counts]
    orders = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(np.array(counts[1:]) / counts[:-1])
    # Asymptotic within 15 %; an order lower would be 1/p or more off.
    assert errors[-1] > 1e-14, "rounding: too fine to measure an order"
    assert 2 * p * 0.85 < orders[-1] < 2 * p * 1.35


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_few_elements_of_order_six_reach_machine_precision(space):
    four, eight = (np.abs(tip(6, False, n, space) - REFERENCE).max() for n in (4, 8))
    assert four < 1e-9
    assert eight < 1e-13


def test_names():
    assert ELEMENTS == ("SFET2", "SFET3", "SFET4", "SFET5", "SFET6", "SFET7", "SFET8", "SFET9")
    for i, name in enumerate(ELEMENTS):
        element = element_by_name(name, True, True)
        assert (element.name, element.order, element.space, element.gauss) == (name, i + 1, True, True)
        assert element_by_name(name, True, True) is element
    plane, space = element_by_name("SFET3", False), element_by_name("SFET3", True)
    assert (plane.components, plane.turns, plane.axes, plane.stiffnesses) == (1, 1, 2, 1)
    assert (space.components, space.turns, space.axes, space.stiffnesses) == (4, 3, 3, 6)


def test_functions_are_made_once():
    element = element_by_name("SFET4", True)
    assert rotation_gradient(element) is rotation_gradient(element)
    assert isinstance(rotation_gradient(element), ca.Function)


@pytest.mark.filterwarnings("error")
def test_places_next_to_a_node_are_the_node():
    nodes = np.array([0.0, 0.5, 1.0])
    np.testing.assert_array_equal(evaluation(nodes, [1e-310, 1e-210]), evaluation(nodes, [0.0, 0.0]))
