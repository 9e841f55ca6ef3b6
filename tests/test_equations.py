"""The stationarity equations of whole models: derivatives of one Lagrangian, by differences."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import PLANE, ZOO, density, gauss_points, made, model_of
from systems import EVERY, EVERYTHING

from sfetcas.equilibria.statics import solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.mathematics.interpolation import differentiation, evaluation
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields
from sfetcas.mechanics.rotations import RotationFreedom
from sfetcas.solvers.prepared import Prepared
from sfetcas.solvers.residuals import relative_residual

CASES = [(name, assembly, False) for name in EVERY for assembly in ("closing", "nodal")]
CASES += [(name, "closing", True) for name in ("arch", "hinged_space", "linked_space")]
cases = pytest.mark.parametrize(("name", "assembly", "gauss"), CASES)


def trial(name, assembly="closing", gauss=False, order=2, elements=2):
    """A model of the zoo with loads at a random state: nothing is in balance, no closing is closed."""
    model = model_of(EVERYTHING[name](), elements, order, assembly=assembly, gauss=gauss)
    equations, loading = Equations(model), model.loading(0.8)
    rng = np.random.default_rng(7)
    start = equations.start(loading)
    start = replace(start, y=rng.normal(size=start.y.shape), lam=rng.normal(size=start.lam.shape))
    step = np.zeros(equations.total)
    step[: equations.rotation_unknowns] = 0.5 * rng.normal(size=equations.rotation_unknowns)
    return equations, loading, equations.moved(start, step)


def full(equations, point):
    matrix = np.zeros((equations.total, equations.total))
    matrix[equations.row, equations.column] = point.entries
    return matrix


def unit(i, n):
    e = np.zeros(n)
    e[i] = 1.0
    return e


@cases
def test_residual_is_the_gradient_of_the_lagrangian(name, assembly, gauss):
    equations, loading, state = trial(name, assembly, gauss)
    point, n, h = equations.at(state, loading), equations.unknowns, 1e-3

    def lagrangian(step):
        there = equations.at(equations.moved(state, step), loading)
        return there.potential + state.lam @ there.residual[n:]

    scale = max(1.0, np.abs(point.residual).max())
    for i in range(n):
        e = [lagrangian(k * h * unit(i, equations.total)) for k in (-2, -1, 1, 2)]
        slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
        # h^4 = 1e-12 of the fifth derivative; rounding of the energy over h.
        assert point.residual[i] == pytest.approx(slope, abs=1e-9 * scale)


@cases
def test_matrix_is_the_derivative_of_the_residual(name, assembly, gauss):
    """Away from balance the derivative by successive rotations has a skew part; its symmetric part is the matrix."""
    equations, loading, state = trial(name, assembly, gauss)
    matrix, total, h = full(equations, equations.at(state, loading)), equations.total, 1e-3
    derivative = np.zeros((total, total))
    for i in range(total):
        r = [equations.at(equations.moved(state, k * h * unit(i, total)), loading).residual for k in (-2, -1, 1, 2)]
        derivative[:, i] = (r[0] - 8 * r[1] + 8 * r[2] - r[3]) / (12 * h)
    scale = max(1.0, np.abs(matrix).max())
    np.testing.assert_allclose(matrix, 0.5 * (derivative + derivative.T), atol=1e-9 * scale)
    skew = 0.5 * (derivative - derivative.T)
    blocks = np.zeros((total, total), bool)
    for numbers in equations.number:
        used = numbers[numbers >= 0]
        blocks[np.ix_(used, used)] = True
    np.testing.assert_allclose(np.where(blocks, 0.0, skew), 0.0, atol=1e-9 * scale)
    if not equations.model.space:
        np.testing.assert_allclose(skew, 0.0, atol=1e-9 * scale)


@pytest.mark.parametrize("name", ZOO)
def test_strain_energy_is_the_integral_of_its_definition(name):
    """1/2 (kappa - kappa_0).D (kappa - kappa_0) from the scene and the nodal rotations, at the Lobatto points."""
    equations, loading, state = trial(name, order=3)
    model, scene = equations.model, equations.model.scene
    total, element = 0.0, model.element
    for member in model.members:
        line = scene.center_lines[member]
        for e, (a, b) in enumerate(zip(model.mesh.cuts[member], model.mesh.cuts[member][1:], strict=False)):
            x = a + (b - a) * element.nodes
            length = (b - a) * line.length
            q = state.q[model.rotations.turns[model.elements_of(member)][e]]
            slope = differentiation(element.nodes) @ q / length
            d = scene.sections[scene.members[member].section].stiffness(x)
            if model.space:
                # kappa of the product q l less kappa of l: the part from q', in the section's axes.
                frame = quat.matrix(line.quaternions(x))
                spin = 2.0 * quat.multiply(quat.conjugate(q), slope)[:, 1:]
                kappa = np.einsum("nji,nj->ni", frame, spin)
                density_ = (d * kappa**2).sum(axis=1)
            else:
                density_ = d[:, 2] * slope[:, 0] ** 2
            total += 0.5 * length * element.weights @ density_
    strain = equations.at(state, loading).strain * model.scales.moment
    assert strain == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("assembly", ["closing", "nodal"])
@pytest.mark.parametrize("name", ZOO)
def test_potential_of_the_loads_is_minus_their_work(name, assembly):
    """Sum of force times displacement, from the scene alone, at a state without gaps (an equilibrium)."""
    table = ZOO[name]()
    step = solve_model(model_of(table, 6, 6, assembly=assembly))
    scene = step.model.scene
    work = 0.0
    for load in scene.loads.values():
        if load.type == "moment":
            place = step.angle(load.node) if load.node else step.along(load.member, load.at)["angle"][0]
            work += load.vector[2] * place
        elif load.type == "force":
            if load.node:
                moved = step.position(load.node) - scene.nodes[load.node].position
            else:
                line = scene.center_lines[load.member]
                moved = step.along(load.member, load.at)["position"][0] - line.positions([load.at])[0]
            work += np.asarray(load.vector) @ moved
    for member in scene.members:
        line = scene.center_lines[member]
        x, w = gauss_points(step.model.mesh.cuts[member])
        moved = step.along(member, x)["position"] - line.positions(x)
        work += line.length * w @ (density(scene, member, x) * moved).sum(axis=1)
    # Discretisation of the place of the loads inside elements of order 6, 1e-9 or better on such smooth shapes.
    assert step.energy["loads"] == pytest.approx(-work, abs=2e-9 * (1 + abs(work)))
    assert step.energy["total"] == pytest.approx(step.energy["elastic"] + step.energy["loads"], rel=1e-14)


@pytest.mark.parametrize("name", ZOO)
def test_assemblies_are_the_same_mechanics(name):
    closing, nodal = (solve_model(model_of(ZOO[name](), 3, 5, assembly=a)) for a in ("closing", "nodal"))
    assert closing.model.unknowns <= nodal.model.unknowns
    assert closing.energy["total"] == pytest.approx(nodal.energy["total"], abs=1e-12)
    for node in closing.model.nodes:
        np.testing.assert_allclose(closing.position(node), nodal.position(node), atol=1e-11)
        if closing.model.scene.nodes[node].support != "free":
            # Multipliers: rounding times the stiffness of the matrix, 1e3 to 1e4.
            for a, b in zip(closing.reaction(node), nodal.reaction(node), strict=True):
                np.testing.assert_allclose(a, b, atol=2e-10)
    assert closing.certificate.negative == nodal.certificate.negative
    assert closing.certificate.smallest == pytest.approx(nodal.certificate.smallest, rel=1e-7)


@cases
def test_positive_part_and_elastic_entries(name, assembly, gauss):
    equations, loading, state = trial(name, assembly, gauss)
    convex = full(equations, equations.at(state, loading, convex=True))
    n = equations.rotation_unknowns
    values = np.linalg.eigvalsh(convex[:n, :n])
    hinged = bool(equations.model.connections)
    assert values.min() > -1e-11 * np.abs(values).max() or hinged  # a hinge's own part is left as it is
    elastic = np.zeros((equations.total, equations.total))
    elastic[equations.row, equations.column] = equations.elastic_entries()
    rest = equations.start(equations.model.loading(0.0))
    unloaded = replace(rest, y=0 * rest.y, lam=0 * rest.lam)
    plain = full(equations, equations.at(unloaded, equations.model.loading(0.0)))
    # Springs and small members act upon displacements too.
    part = np.concatenate([np.arange(n), equations.elastic_displacements])
    both = np.ix_(part, part)
    np.testing.assert_allclose(elastic[both], plain[both], atol=1e-13 * np.abs(plain).max())
    elastic[both] = 0.0
    assert np.abs(elastic).max(initial=0.0) == 0.0


@pytest.mark.parametrize("name", ZOO)
def test_holding_start_and_moved(name):
    equations, _, state = trial(name)
    held = equations.model.rotations.kind == RotationFreedom.FIXED
    moved = equations.moved(state, np.ones(equations.total))
    np.testing.assert_array_equal(moved.q[held], state.q[held])
    put = equations.holding(state, equations.model.loading(0.3))
    np.testing.assert_allclose(
        put.q[held], equations.model.prescribed_rotations(equations.model.loading(0.3).turn)[held], atol=0
    )
    np.testing.assert_array_equal(put.q[~held], state.q[~held])
    if equations.model.space:
        np.testing.assert_allclose(np.linalg.norm(moved.q, axis=1), 1.0, atol=1e-15)
        # Rotations about a held axis stay about it.
        about = equations.model.rotations.kind == RotationFreedom.AXIS
        vector = quat.multiply(moved.q[about], quat.conjugate(state.q[about]))[:, 1:]
        np.testing.assert_allclose(np.cross(vector, equations.model.rotations.axis[about]), 0.0, atol=1e-15)


@pytest.mark.parametrize("name", ZOO)
def test_mass_is_the_length(name):
    equations, _, _ = trial(name)
    total = sum(line.length for line in equations.model.scene.center_lines.values()) / equations.model.scales.length
    lumps = np.zeros(len(equations.model.rotations.kind))
    free = equations.number[:, 0] >= 0
    lumps[free] = equations.mass[equations.number[free, 0]]
    w = equations.model.beams.weight
    held = 1.0 - free
    at_held = (w * held[equations.model.rotations.turns]).sum()
    assert lumps.sum() + at_held == pytest.approx(total, rel=1e-13)


def test_node_jacobian_by_differences():
    equations, loading, state = trial("hinged_space", "nodal")
    chosen = np.arange(equations.model.positions.E.shape[0])
    _, jacobian = equations.node_jacobian(state, loading, chosen)
    h = 1e-4
    for i in range(equations.unknowns):
        a, b = (
            equations.node_jacobian(equations.moved(state, s * h * unit(i, equations.total)), loading, chosen)[0]
            for s in (1, -1)
        )
        np.testing.assert_allclose(jacobian[:, i], (a - b) / (2 * h), atol=1e-7)  # h^2


@pytest.mark.parametrize("name", ["arch", "tripod"])
def test_residual_is_relative_and_honest(name):
    """Half a percent of load more leaves a residual of that size: the measure is not zero by construction."""
    prepared = Prepared(model_of(ZOO[name](), 4, 5))
    step = solve_model(prepared)
    assert step.certificate.residual < 1e-12
    off = prepared.equations.at(step.state, prepared.model.loading(1.005))
    assert 1e-4 < relative_residual(prepared.equations, off) < 0.05


def test_positions_of_nodes_are_sums_along_any_path():
    """Positions of the nodes against the fields integrated along each member."""
    step = solve_model(model_of(ZOO["hinged_space"](), 3, 5))
    for name, member in step.model.scene.members.items():
        ends = step.along(name, [0.0, 1.0])["position"]
        np.testing.assert_allclose(ends, [step.position(n) for n in member.nodes], atol=1e-12)


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("name", ZOO)
def test_fields_inside_elements(name, gauss):
    """Slope of the positions is the turned tangent, and the moment is stiffness times curvature, everywhere."""
    step = solve_model(model_of(ZOO[name](), 8, 6, gauss=gauss))
    scene, model = step.model.scene, step.model
    for member in model.members:
        line, cuts = scene.center_lines[member], model.mesh.cuts[member]
        section = scene.sections[scene.members[member].section]
        nodes = (np.arange(9) + 0.5) / 9
        slope, mid = differentiation(nodes, [0.5])[0], evaluation(nodes, [0.5])[0]
        for e in (0, len(cuts) // 2, len(cuts) - 2):
            x = cuts[e] + (cuts[e + 1] - cuts[e]) * nodes
            length = (cuts[e + 1] - cuts[e]) * line.length
            found = step.along(member, x)
            q = quat.multiply(found["quaternion"], line.quaternions(x))
            here = mid @ q / np.linalg.norm(mid @ q)
            tangent = quat.rotate(here, [1.0, 0, 0])
            # Truncation of order 6 in elements of an eighth of a member.
            np.testing.assert_allclose(slope @ found["position"] / length, tangent, atol=3e-6)
            kappa = 2.0 * quat.multiply(quat.conjugate(here), slope @ q / length)[1:]
            strain = kappa - line.curvatures([cuts[e] + 0.5 * (cuts[e + 1] - cuts[e])])[0]
            d = np.nan_to_num(section.stiffness(x)[4])
            moment = quat.matrix(here) @ (d * strain)
            size = np.abs(found["moment"]).max() + 1.0
            np.testing.assert_allclose(mid @ found["moment"], moment, atol=2e-5 * size)
            np.testing.assert_allclose(mid @ found["curvature"], kappa, atol=2e-5 * size)


@pytest.mark.parametrize("name", PLANE)
def test_end_moments_are_gradients(name):
    step = solve_model(model_of(ZOO[name](), 3, 5))
    equations = Equations(step.model)
    fields = Fields(equations, step.state, step.loading)
    moments = equations.shares(step.state, step.loading)[0]
    for member, first in step.model.beams.first.items():
        start = fields.along(member, [0.0], dimensionless=True)["moment"][0]
        np.testing.assert_allclose(start[2], -moments[first, 0], atol=1e-13)


def test_scene_of_the_tests_is_what_it_says():
    assert {made(f()).resolved_dimension for f in PLANE.values()} == {"plane"}
    assert {made(ZOO[n]()).resolved_dimension for n in ZOO if n not in PLANE} == {"space"}
