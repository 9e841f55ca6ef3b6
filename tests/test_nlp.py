"""Nonlinear programs on textbook problems: no mechanics here."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from sfetcas.errors import Status
from sfetcas.mathematics.nlp import NLP, Ipopt, Solver

QUIET_SQP = Solver(
    "sqpmethod",
    {
        "qpsol": "qrqp",
        "print_time": False,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "error_on_fail": False,
        "max_iter": 200,
        "qpsol_options": {"print_iter": False, "print_header": False, "error_on_fail": False},
    },
)
SOLVERS = pytest.mark.parametrize("solver", [Ipopt(), QUIET_SQP], ids=["ipopt", "sqpmethod"])


def program(f, guess, g=None, lower=(), upper=(), bounds=(-np.inf, np.inf), p=()):
    """A record of expressions f(x, p) and g(x, p) with derivatives by CasADi."""
    x, symbol = ca.MX.sym("x", len(guess)), ca.MX.sym("p", len(p))
    objective = f(x, symbol)
    rows = g(x, symbol) if g else ca.MX(0, 1)
    return NLP(
        x=x,
        p=symbol,
        f=objective,
        g=rows,
        lower=np.asarray(lower, float),
        upper=np.asarray(upper, float),
        x_lower=np.full(len(guess), bounds[0]),
        x_upper=np.full(len(guess), bounds[1]),
        guess=np.asarray(guess, float),
        p_value=np.asarray(p, float),
        rows=tuple(f"row {i}" for i in range(rows.numel())),
        gradient=ca.gradient(objective, x),
        jacobian=ca.jacobian(rows, x),
        hessian=lambda lam_f, lam_g: ca.hessian(lam_f * objective + ca.dot(lam_g, rows), x)[0],
    )


def rosenbrock(guess=(-1.2, 1.0), a=1.0):
    return program(lambda x, p: (p[0] - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2, guess, p=[a])


def hs71():
    return program(
        lambda x, p: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        [1, 5, 5, 1],
        lambda x, p: ca.vertcat(x[0] * x[1] * x[2] * x[3], ca.dot(x, x)),
        [25, 40],
        [np.inf, 40],
        (1, 5),
    )


HS71 = [1.0, 4.74299963, 3.82114998, 1.37940829]  # Hock and Schittkowski, problem 71, to the digits printed there


@SOLVERS
def test_rosenbrock(solver):
    result = solver.solve(rosenbrock())
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.x, [1, 1], atol=1e-6)  # tolerances of the solvers, valley of curvature 0.4
    assert result.f == pytest.approx(0.0, abs=1e-10)
    assert result.iterations > 3
    assert result.lam.shape == (0,)


@SOLVERS
def test_hs71_with_multipliers(solver):
    nlp = hs71()
    result = solver.solve(nlp)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.x, HS71, atol=1e-6)
    assert result.f == pytest.approx(17.0140173, abs=1e-6)
    # grad f + J^T lam = 0 in the unknowns that stand at no bound: all but the first.
    stationarity = ca.Function("s", [nlp.x, nlp.p], [nlp.gradient, nlp.jacobian])
    gradient, jacobian = (a.full() for a in stationarity(result.x, []))
    np.testing.assert_allclose((gradient.ravel() + jacobian.T @ result.lam)[1:], 0.0, atol=1e-6)
    assert result.lam[0] < -0.1  # a lower bound that holds has a multiplier below zero
    assert result.lam[1] == pytest.approx(0.16147, abs=1e-4)


@SOLVERS
def test_parameters_guess_and_prepared_solver(solver):
    solve = solver.prepare(rosenbrock())
    np.testing.assert_allclose(solve(p=np.array([2.0])).x, [2, 4], atol=1e-5)
    np.testing.assert_allclose(solve().x, [1, 1], atol=1e-6)
    near = solve(guess=np.array([1.0, 1.0]))
    assert near.iterations <= 1


@SOLVERS
def test_rows_and_terms_are_added(solver):
    base = rosenbrock(guess=(0.5, 0.5))
    more = base.with_term(3.0 * base.x[0]).with_row("line", base.x[0] + base.x[1], 1.0)
    more = more.with_row("box", base.x, [-0.5, -5.0], [0.4, 5.0])
    assert more.rows == ("line", "box[0]", "box[1]")
    assert base.rows == ()
    # On x + y = 1 the objective is f(t) of one unknown; its minimum on t <= 0.4 by a fine search.
    t = np.linspace(-0.5, 0.4, 900_001)
    expected = t[np.argmin((1 - t) ** 2 + 100 * (1 - t - t**2) ** 2 + 3 * t)]
    result = solver.solve(more)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.x, [expected, 1 - expected], atol=2e-6)
    np.testing.assert_allclose(result.lam.shape, (3,))


def test_derivatives_of_an_extended_record_are_those_of_its_expressions():
    base = hs71()
    more = base.with_term(ca.sin(base.x[1]) * base.x[2]).with_row(
        "a", ca.vertcat(base.x[0] ** 3, base.x[1] * base.x[3])
    )
    rng = np.random.default_rng(0)
    x, lam_f, lam_g = rng.uniform(1, 5, 4), 0.7, rng.normal(size=4)
    f, g = ca.MX.sym("f"), ca.MX.sym("g", 4)
    own = ca.Function("own", [more.x, more.p, f, g], [more.gradient, more.jacobian, more.hessian(f, g)])
    automatic = ca.Function(
        "ad",
        [more.x, more.p, f, g],
        [
            ca.gradient(more.f, more.x),
            ca.jacobian(more.g, more.x),
            ca.hessian(f * more.f + ca.dot(g, more.g), more.x)[0],
        ],
    )
    for a, b in zip(own(x, [], lam_f, lam_g), automatic(x, [], lam_f, lam_g), strict=True):
        np.testing.assert_allclose(a.full(), b.full(), rtol=1e-13, atol=1e-12)


def test_infeasible_rows_are_told():
    nlp = program(
        lambda x, p: ca.dot(x, x), [1.0, 2.0], lambda x, p: ca.vertcat(x[0] ** 2 + x[1] ** 2, x[0]), [1, 3], [1, 3]
    )
    assert Ipopt().solve(nlp).status is Status.INFEASIBLE


def test_unbounded_objective_is_told():
    nlp = program(lambda x, p: x[1] ** 2 - x[0] ** 2, [-1.0, 0.5])
    assert Ipopt().solve(nlp).status is Status.UNBOUNDED


def test_iterations_used_up_are_told():
    result = Ipopt(iterations=2).solve(rosenbrock())
    assert result.status is Status.ITERATIONS
    assert result.iterations == 2


def test_objective_scale_and_extra_options_reach_ipopt():
    scaled = Ipopt(objective_scale=1e-3).solve(hs71())
    np.testing.assert_allclose(scaled.x, HS71, atol=1e-5)
    assert scaled.lam[1] == pytest.approx(0.16147, abs=1e-3)  # multipliers are those of the unscaled objective
    assert Ipopt(extra={"max_iter": 1}).solve(rosenbrock()).status is Status.ITERATIONS


def test_derivatives_can_be_left_to_casadi():
    nlp = rosenbrock()
    lying = replace(nlp, gradient=0.0 * nlp.gradient + 1.0)
    options = {"print_time": False, "error_on_fail": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 100}}
    exact = Solver("ipopt", options, exact=False).solve(lying)
    np.testing.assert_allclose(exact.x, [1, 1], atol=1e-6)
    assert Solver("ipopt", options).solve(lying).status is not Status.SOLVED
