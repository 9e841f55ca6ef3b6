"""Programs put together of pieces: against the same programs written whole, and against known answers."""

import casadi as ca
import numpy as np
import pytest

from sfetcas.errors import Status
from sfetcas.mathematics.nlp import Ipopt
from sfetcas.mathematics.pieces import Pieces
from sfetcas.mathematics.relations import relation


def chain(units=1.0, kernels="interpreted"):
    """Rosenbrock's chain of 8 with a circle for each pair, and the last one held."""
    pieces = Pieces(kernels)
    x = pieces.unknowns("x", np.full(8, 0.5), low=-5.0, high=5.0, unit=units)
    w, c = ca.SX.sym("w", 2), ca.SX.sym("c")
    cost = ca.Function("cost", [w, c], [c * (w[1] - w[0] ** 2) ** 2 + (1.0 - w[0]) ** 2])
    pairs = np.stack([x.index[:-1], x.index[1:]], axis=1)
    pieces.add_cost("valley", cost, pairs, np.full((7, 1), 100.0))
    circle = ca.Function("circle", [w], [w[0] ** 2 + w[1] ** 2])
    pieces.add_rows("circle", circle, pairs, low=0.1, high=1.5, unit=units)
    pieces.add_expression("last", x.symbol[7] + x.symbol[0] ** 2, 0.8)
    return pieces


def whole():
    x = ca.MX.sym("x", 8)
    f = sum(100.0 * (x[i + 1] - x[i] ** 2) ** 2 + (1.0 - x[i]) ** 2 for i in range(7))
    g = ca.vertcat(*[x[i] ** 2 + x[i + 1] ** 2 for i in range(7)], x[7] + x[0] ** 2)
    return x, f, g


@pytest.mark.parametrize("units", [1.0, 0.1])
def test_derivatives_are_those_of_the_whole(units):
    nlp = chain(units).nlp()
    x, f, g = whole()
    scale = np.full(8, units)
    rows = np.append(np.full(7, units), 1.0)
    at, lam = np.linspace(-0.3, 0.9, 8), np.linspace(1.0, 2.0, 8)
    weight = ca.MX.sym("weight")
    multipliers = ca.MX.sym("multipliers", 8)
    found = ca.Function(
        "found",
        [nlp.x, nlp.p, weight, multipliers],
        [nlp.f, nlp.gradient, nlp.g, nlp.jacobian, nlp.hessian(weight, multipliers)],
    )
    own = 0.7 * f + ca.dot(lam / rows, g)
    wanted = ca.Function("wanted", [x], [f, ca.gradient(f, x), g, ca.jacobian(g, x), ca.hessian(own, x)[0]])
    a = [np.array(part) for part in found(at / units, nlp.p_value, 0.7, lam)]
    b = [np.array(part) for part in wanted(at)]
    b[1], b[2], b[3] = scale[:, None] * b[1], b[2] / rows[:, None], b[3] * scale[None, :] / rows[:, None]
    b[4] = b[4] * scale[:, None] * scale[None, :]
    for mine, other in zip(a, b, strict=True):
        # Rounding of sums of a few numbers of the size 1e3.
        np.testing.assert_allclose(mine, other, rtol=1e-12, atol=1e-11)


def test_answers_do_not_depend_on_units_and_are_those_of_the_whole():
    x, f, g = whole()
    other = ca.nlpsol(
        "other", "ipopt", {"x": x, "f": f, "g": g}, {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    )
    wanted = other(x0=np.full(8, 0.5), lbx=-5, ubx=5, lbg=[0.1] * 7 + [0.8], ubg=[1.5] * 7 + [0.8])["x"]
    for units in (1.0, 0.1):
        pieces = chain(units)
        result = Ipopt().solve(pieces.nlp())
        assert result.status is Status.SOLVED
        # The tolerance of IPOPT.
        np.testing.assert_allclose(pieces.value(pieces.blocks["x"], result.x), np.array(wanted).ravel(), atol=1e-6)


def test_an_unknown_may_stand_twice_in_an_instance():
    pieces = Pieces("interpreted")
    x = pieces.unknowns("x", [0.5, 2.0], unit=0.5)
    w = ca.SX.sym("w", 3)
    function = ca.Function("f", [w], [w[0] * w[1] * w[2] ** 2])
    pieces.add_cost("f", function, np.array([[0, 1, 0]]))
    nlp = pieces.nlp()
    hessian = ca.Function("h", [nlp.x], [nlp.hessian(ca.MX(1), ca.MX(0, 1))])(nlp.guess)
    a, b = 0.5, 2.0
    wanted = 0.25 * np.array([[6 * a * b, 3 * a**2], [3 * a**2, 0.0]])
    np.testing.assert_allclose(np.array(hessian), wanted, rtol=1e-14)
    assert x.index.tolist() == [0, 1]


def test_rows_have_names():
    names = chain().nlp().rows
    assert names[0] == "circle[0]"
    assert names[-1] == "last"
    assert len(names) == 8


def test_other_constants_and_guesses_need_no_other_program():
    pieces, symbol = Pieces("interpreted"), ca.MX.sym("mine", 2)
    x = pieces.unknowns("x", [1.0, 1.0], symbol=symbol)
    w, c = ca.SX.sym("w"), ca.SX.sym("c")
    function = ca.Function("cube", [w, c], [w**3 - c])
    pieces.add_rows("cube", function, x.index[:, None], np.array([[8.0], [27.0]]), labels=("one", "other"))
    pieces.add_term("nothing", 0.0 * symbol[0])
    assert pieces.row_names() == ["one", "other"]
    assert pieces.row_owners() == [("cube", "one"), ("cube", "other")]
    nlp = pieces.nlp()
    solve = Ipopt().prepare(nlp)
    np.testing.assert_allclose(solve().x, [2.0, 3.0], atol=1e-8)
    pieces.set_constants("cube", np.array([[-64.0], [125.0]]))
    # The tolerance of IPOPT.
    np.testing.assert_allclose(solve(p=pieces.constants(), guess=np.array([-3.0, 4.0])).x, [-4.0, 5.0], atol=1e-8)
    shifted = solve(lower=nlp.lower + 12.0, upper=nlp.upper + 12.0)
    np.testing.assert_allclose(shifted.x, np.cbrt([20.0, 39.0]), atol=1e-8)


def test_expressions_read_only_what_they_depend_on():
    pieces = Pieces()
    x = pieces.unknowns("x", np.zeros((3, 4)))
    _, index = pieces.function_of("corner", x.symbol[0, 1] * x.symbol[2, 3])
    assert sorted(index.ravel()) == sorted([x.index[0, 1], x.index[2, 3]])
    function, index = pieces.function_of("all", x.symbol)
    values = np.arange(12.0)
    flat = np.array(function(values[index.ravel()])).ravel()
    np.testing.assert_array_equal(flat.reshape(3, 4, order="F"), values[x.index])


def test_strange_symbols_are_refused():
    with pytest.raises(ValueError, match="'y', which stands for no unknown"):
        Pieces().add_expression("row", ca.MX.sym("y"))


def test_relations():
    x = ca.MX.sym("x", 2)
    for given, low, high in (
        (x == 2, 2, 2),
        (x <= 3, -np.inf, 3),
        (x >= 3, 3, np.inf),
        (1 <= (x <= 2), 1, 2),  # noqa: SIM300
        (x <= 2 * x, -np.inf, 0),
        (x == 2 * x, 0, 0),
    ):
        found = relation(given)
        np.testing.assert_array_equal(found.low, [low] * 2)
        np.testing.assert_array_equal(found.high, [high] * 2)
    np.testing.assert_array_equal(relation(x == ca.DM([1, 2])).low, [1, 2])


@pytest.mark.parametrize("given", [3.0, ca.MX.sym("x") + 1, ca.MX(1) <= ca.MX(2)])
def test_what_is_no_relation_is_refused(given):
    with pytest.raises(ValueError, match="accepted"):
        relation(given)
