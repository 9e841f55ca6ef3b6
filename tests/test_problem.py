"""The nonlinear program: two ways to its derivatives, two ways to its solution, and a chain of rigid links."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scenes import arch, bend_45, cantilever, model_of
from systems import EVERY

from sfetcas.equilibria.statics import solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.mathematics.nlp import Ipopt
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields
from sfetcas.solvers.prepared import Prepared
from sfetcas.solvers.problem import EquilibriumProblem

# Terms and tables are those of the equations, which both assemblies of every scene are tested of: here by turns.
CASES = [(name, ("closing", "nodal")[i % 2], False) for i, name in enumerate(EVERY)]
CASES += [("guided", "nodal", True), ("hinged_space", "closing", True)]
cases = pytest.mark.parametrize(("name", "assembly", "gauss"), CASES)


def posed(name, assembly, gauss):
    model = model_of(EVERY[name](), 2, 2, assembly=assembly, gauss=gauss)
    equations, loading = Equations(model), model.loading(0.7)
    return equations, loading, EquilibriumProblem(model, loading, equations.start(loading))


def anywhere(equations, loading, seed=0):
    rng = np.random.default_rng(seed)
    start = equations.start(loading)
    step = np.concatenate([0.5 * rng.normal(size=equations.unknowns), rng.normal(size=equations.rows)])
    return equations.moved(start, step)


def functions(nlp):
    """(x, p, lam_f, lam_g) -> value, rows and the derivatives: of the record, and by differentiating it again."""
    f, g = ca.MX.sym("f"), ca.MX.sym("g", nlp.g.numel())
    lagrangian = f * nlp.f + ca.dot(g, nlp.g)
    arguments = [nlp.x, nlp.p, f, g]
    own = ca.Function("own", arguments, [nlp.f, nlp.g, nlp.gradient, nlp.jacobian, nlp.hessian(f, g)])
    again = [nlp.f, nlp.g, ca.gradient(nlp.f, nlp.x), ca.jacobian(nlp.g, nlp.x), ca.hessian(lagrangian, nlp.x)[0]]
    return own, ca.Function("again", arguments, again)


@cases
def test_derivatives_against_automatic_differentiation(name, assembly, gauss):
    equations, loading, problem = posed(name, assembly, gauss)
    own, again = functions(problem.nlp)
    rng = np.random.default_rng(3)
    x = problem.unknowns(anywhere(equations, loading)) + 0.1 * rng.normal(size=problem.nlp.x.numel())
    lam_f, lam_g = 1.3, rng.normal(size=problem.nlp.g.numel())
    for a, b in zip(*(f(x, problem.nlp.p_value, lam_f, lam_g) for f in (own, again)), strict=True):
        a, b = a.full(), b.full()
        assert a.shape == b.shape
        # The same formulas in another order: rounding times the largest entry.
        np.testing.assert_allclose(a, b, atol=1e-13 * max(1.0, np.abs(b).max(initial=0.0)))
    hessian = own(x, problem.nlp.p_value, lam_f, lam_g)[4].full()
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-13 * np.abs(hessian).max())


@cases
def test_program_and_equations_are_one_problem(name, assembly, gauss):
    """Values up to a constant, rows, gradients and curvature along rotations: written twice, found equal."""
    equations, loading, problem = posed(name, assembly, gauss)
    own, _ = functions(problem.nlp)
    one, two = (anywhere(equations, loading, seed) for seed in (1, 2))
    norms = len(problem.row_names) - equations.rows
    lam = np.concatenate([np.zeros(norms), one.lam])
    first, second = (equations.at(replace(s, lam=one.lam), loading) for s in (one, two))
    at_one, at_two = (own(problem.unknowns(s), problem.nlp.p_value, 1.0, lam) for s in (one, two))
    scale = max(1.0, abs(first.potential), abs(second.potential))
    assert float(at_one[0] - at_two[0]) == pytest.approx(first.potential - second.potential, abs=1e-12 * scale)
    rows = at_one[1].full().ravel()
    np.testing.assert_allclose(rows[:norms], 0.0, atol=1e-14)
    np.testing.assert_allclose(rows[norms:], first.residual[equations.unknowns :], atol=1e-13)
    gradient, jacobian = at_one[2].full().ravel(), at_one[3].full()
    total, h = equations.total, 1e-3

    def along(i):
        step = np.zeros(total)
        step[i] = h
        x = [problem.unknowns(equations.moved(one, k * step)) for k in (-2, -1, 1, 2)]
        return (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h)

    slope = np.array([along(i) for i in range(equations.unknowns)])
    # h^4 times the fifth derivative of a quaternion, 1/32.
    np.testing.assert_allclose(
        slope @ (gradient + jacobian.T @ lam), first.residual[: equations.unknowns], atol=1e-11 * scale
    )
    # Curvature of the norms with their own multipliers is the radial term of the equations.
    x = problem.unknowns(one)
    radial = np.zeros(norms)
    for r, i in enumerate(problem._unit):
        numbers = problem.terms.tables.number[i]
        part = numbers[numbers >= 0]
        radial[r] = -0.5 * x[part] @ (gradient + jacobian.T @ lam)[part]
    hessian = own(x, problem.nlp.p_value, 1.0, np.concatenate([radial, one.lam]))[4].full()
    matrix = np.zeros((total, total))
    matrix[equations.row, equations.column] = first.entries
    n = equations.unknowns
    size = max(1.0, np.abs(matrix).max())
    np.testing.assert_allclose(slope @ hessian @ slope.T, matrix[:n, :n], atol=1e-11 * size)
    np.testing.assert_allclose(jacobian[norms:] @ slope.T, matrix[n:, :n], atol=1e-11 * size)


@cases
def test_states_go_there_and_back(name, assembly, gauss):
    equations, loading, problem = posed(name, assembly, gauss)
    state = anywhere(equations, loading)
    back = problem.state(problem.unknowns(state), problem.multipliers(state), loading)
    np.testing.assert_allclose(back.q, equations.holding(state, loading).q, atol=1e-15)
    np.testing.assert_allclose(back.y, state.y, atol=0)
    np.testing.assert_allclose(back.lam, state.lam, atol=0)
    assert len(problem.row_names) == problem.nlp.g.numel() == len(problem.nlp.rows)


def by_newton(model, factor=1.0, parts=20):
    """Root finding alone: Newton's method from the undeformed scene in small steps."""
    prepared = Prepared(model)
    state = prepared.equations.start(model.loading(0.0))
    for part in np.linspace(0, factor, parts + 1)[1:]:
        found = prepared.correct(state, model.loading(part), iterations=30)
        assert found.converged
        state = found.state
    return prepared.equations, state


def by_minimisation(model):
    """IPOPT alone, without the Newton steps that the library adds."""
    prepared = Prepared(model)
    loading = model.loading(1.0)
    guess, _ = prepared.guess(loading)
    problem = EquilibriumProblem(model, loading, guess)
    result = Ipopt(tolerance=1e-11).solve(problem.nlp)
    return prepared.equations, problem.state(result.x, result.lam, loading)


@pytest.mark.parametrize("name", EVERY)
def test_minimum_is_the_root(name):
    model = model_of(EVERY[name](), 3, 4)
    answers = []
    for route in (by_newton, by_minimisation):
        equations, state = route(model)
        fields = Fields(equations, state, model.loading(1.0))
        answers.append(np.concatenate([fields.position(n) for n in model.nodes] + [state.lam]))
    # IPOPT stops at a dual infeasibility of 1e-11 or a bit above; the smallest curvature is near 1e-1.
    np.testing.assert_allclose(answers[0][: 3 * len(model.nodes)], answers[1][: 3 * len(model.nodes)], atol=1e-8)
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-5)


# -- a chain of rigid links with springs between them, in numpy alone -----------------------------------


def plane_chain(n, rest, ei, forces, couple=0.0, end=None):
    """Angles of n links of length 1/n, clamped at the start and, with ``end``, at the end as well.

    Half a link lies between a clamp and the first spring's other side, so that spring is twice as stiff.
    """
    h = 1.0 / n
    s = (np.arange(n) + 0.5) * h
    theta0, k = rest(s), np.zeros((n, n))
    for i in range(n - 1):
        k[i : i + 2, i : i + 2] += ei / h * np.array([[1, -1], [-1, 1]])
    k[0, 0] += 2 * ei / h
    if end is not None:
        k[-1, -1] += 2 * ei / h
    beyond = np.cumsum(forces[:0:-1], axis=0)[::-1]
    load = np.zeros(n)
    load[-1] = couple
    theta, lam = theta0.copy(), np.zeros(2)
    for part in np.linspace(0, 1, 11)[1:]:
        for _ in range(30):
            t = np.stack([np.cos(theta), np.sin(theta)])
            across = np.stack([-t[1], t[0]])
            pull = part * beyond.T - (lam[:, None] if end is not None else 0.0)
            residual = k @ (theta - theta0) - part * load - h * (pull * across).sum(axis=0)
            matrix = k + np.diag(h * (pull * t).sum(axis=0))
            if end is not None:
                gap = h * t.sum(axis=1) - end
                matrix = np.block([[matrix, h * across.T], [h * across, np.zeros((2, 2))]])
                residual = np.concatenate([residual, gap])
            step = np.linalg.solve(matrix, -residual)
            theta, lam = theta + step[:n], lam + (step[n:] if end is not None else 0.0)
            if np.abs(step[:n]).max() < 1e-12:
                break
        else:
            pytest.fail("the chain of links did not converge")
    joints = np.vstack([np.zeros(2), h * np.cumsum(np.stack([np.cos(theta), np.sin(theta)], axis=1), axis=0)])
    return joints, lam


def extrapolated(values):
    """Richardson: errors in powers of h^2, each value of half the step of the one before."""
    values = [np.asarray(v) for v in values]
    power = 4.0
    while len(values) > 1:
        values = [(power * b - a) / (power - 1) for a, b in zip(values, values[1:], strict=False)]
        power *= 4.0
    return values[0]


COUNTS = (20, 40, 80, 160)


def test_links_converge_with_the_square_of_their_length():
    tips = [plane_chain(n, np.zeros_like, 1.0, tip_force(n, [0, 5.0]))[0][-1] for n in (*COUNTS, 320)]
    gaps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    np.testing.assert_allclose(gaps[:-1] / gaps[1:], 4.0, rtol=0.02)


def tip_force(n, force):
    forces = np.zeros((n + 1, 2))
    forces[-1] = force
    return forces


def test_cantilever_against_links():
    table = cantilever((-3.0, 8.0))
    table["loads"] |= {"c": {"type": "moment", "node": "B", "value": -2.0}, "mid": {
        "type": "force", "member": "m", "at": 0.4, "value": [1.0, -4.0]}}  # fmt: skip
    step = solve_model(model_of(table, 6, 7))
    tips = []
    for n in COUNTS:
        forces = tip_force(n, [-3.0, 8.0])
        forces[n * 2 // 5] += [1.0, -4.0]
        tips.append(plane_chain(n, np.zeros_like, 1.0, forces, -2.0)[0][-1])
    # What is left after three extrapolations from 20 to 160 links: h^8 with constants of order 1e4.
    np.testing.assert_allclose(step.position("B")[:2], extrapolated(tips), atol=1e-8)


def test_arch_against_links():
    table = arch()
    del table["gravity"]
    chord = np.array([1.0, 0.2])
    angle = -2.0
    length = np.linalg.norm(chord) * 0.5 * angle / np.sin(0.5 * angle)
    first = np.arctan2(chord[1], chord[0]) - 0.5 * angle
    force = np.array([4.0, -30.0])
    crowns, reactions = [], []
    for n in COUNTS:
        forces = np.zeros((n + 1, 2))
        forces[n * 2 // 5] = force * length**2  # lengths by that of the arch
        joints, lam = plane_chain(n, lambda s: first + angle * s, 1.0, forces, end=chord / length)
        crowns.append(joints[n * 2 // 5] * length)
        reactions.append(-lam / length**2)
    step = solve_model(model_of(table, 6, 7))
    np.testing.assert_allclose(step.along("m", 0.4)["position"][0, :2], extrapolated(crowns), atol=1e-8)
    np.testing.assert_allclose(step.reaction("B")[0][:2], extrapolated(reactions), atol=1e-6)


def space_chain(n, line, stiffness, forces):
    """Quaternions of n links with springs about the section's axes; the first is clamped at its start."""
    h = line.length / n
    s = (np.arange(n) + 0.5) / n
    rest = np.vstack([line.quaternions([0.0]), line.quaternions(s)])
    width = np.array([0.5 * h, *[h] * (n - 1)])
    relative0 = 2.0 * quat.multiply(quat.conjugate(rest[:-1]), rest[1:])[:, 1:]
    beyond = np.cumsum(forces[:0:-1], axis=0)[::-1]

    def residual(q, part):
        full = np.vstack([rest[:1], q])
        strain = 2.0 * quat.multiply(quat.conjugate(full[:-1]), full[1:])[:, 1:] - relative0
        moment = strain * stiffness / width[:, None]
        out = np.zeros((n, 3))
        for axis in range(3):
            turn = quat.multiply(quat.multiply(quat.conjugate(full[:-1]), [0.0, *np.eye(3)[axis]]), full[1:])[:, 1:]
            work = (turn * moment).sum(axis=1)
            out[:, axis] += work
            out[:-1, axis] -= work[1:]
        return (out - h * np.cross(quat.rotate(q, [1.0, 0, 0]), part * beyond)).ravel()

    def turned(q, phi):
        return quat.multiply(quat.from_rotation_vector(phi.reshape(n, 3)), q)

    q, small = rest[1:].copy(), 1e-6
    for part in np.linspace(0, 1, 6)[1:]:
        for _ in range(30):
            now, matrix = residual(q, part), np.zeros((3 * n, 3 * n))
            for colour in range(9):  # a link touches its neighbours only: every third at once
                phi = np.zeros((n, 3))
                phi[colour // 3 :: 3, colour % 3] = small
                change = (residual(turned(q, phi), part) - residual(turned(q, -phi), part)) / (2 * small)
                for i in range(colour // 3, n, 3):
                    rows = slice(3 * max(i - 1, 0), 3 * min(i + 2, n))
                    matrix[rows, 3 * i + colour % 3] = change[rows]
            step = np.linalg.solve(matrix, -now)
            q = turned(q, step)
            if np.abs(step).max() < 1e-10:
                break
        else:
            pytest.fail("the chain of links did not converge")
    return h * quat.rotate(q, [1.0, 0, 0]).sum(axis=0)


def test_bend_in_space_against_links():
    table = bend_45()
    del table["gravity"], table["loads"]["spread"]
    step = solve_model(model_of(table, 6, 6))
    line = step.model.scene.center_lines["m"]
    tips = []
    for n in (12, 24, 48):
        forces = np.zeros((n + 1, 3))
        forces[-1], forces[n // 2] = [0.5, 1.0, 4.0], [1.0, 0.0, 1.0]
        tips.append(space_chain(n, line, np.array([0.7, 3.0, 1.0]), forces))
    # Two extrapolations from 12 to 48 links leave h^6 of order 1e-7.
    np.testing.assert_allclose(step.position("B"), extrapolated(tips), atol=2e-6)
    assert np.linalg.norm(tips[-1] - step.position("B")) > 2e-5, "the links alone are not that near"
