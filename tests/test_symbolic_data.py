"""Numbers of scenes as symbols in the data of their models: arrays of such numbers, and every number of many scenes."""

import math

import casadi as ca
import numpy as np
import pytest
from scenes import cantilever
from systems import EVERYTHING

from sfetcas import Parameter, Scene, SceneError, assemble, first_mesh, parametric, solve
from sfetcas.mathematics import quaternion
from sfetcas.mathematics.active import Active
from sfetcas.mathematics.arrays import normals, numbers, plus, scattered, unit
from sfetcas.mathematics.interpolation import evaluation, legendre_values, power_series
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.expressions import Expressions
from sfetcas.parametric import arguments as module
from sfetcas.parametric.arguments import FACTOR, Arguments, argument, asked_for, with_cuts, with_numbers
from sfetcas.parametric.results import Results, default_results
from sfetcas.solvers.program import Program

ROUNDING = 1e-12
"""Of the largest number of a part: sums of some hundred terms in another order."""

# -- arrays ---------------------------------------------------------------------------------------------

VALUES = np.array([0.3, 1.2, -0.7])
A, M = np.random.default_rng(0).normal(size=(4, 3)), np.random.default_rng(1).normal(size=(5, 3, 3))
TURNED = unit([1.0, 2.0, 3.0, 4.0])


def with_entries(x):
    found = np.zeros_like(np.outer(x, x))
    found[1] = x
    found[:, 2] += 2.0 * x
    return found


FUNCTIONS = {
    "sums": lambda x: 1.0 - A * x + x / 2.0 - (x**2).sum(),
    "sums along axes": lambda x: (A * x).sum(axis=0) + (A * x).mean(axis=0, keepdims=True)[0],
    "products": lambda x: A @ x,
    "products of matrices": lambda x: np.outer(x, x) @ A.T,
    "products of stacks": lambda x: M @ np.outer(x, x) @ x,
    "einsum": lambda x: np.einsum("nij,nj,nkj->nik", M, np.stack([x] * 5), M),
    "einsum with dots": lambda x: np.einsum("k,ek...->e...", x, M),
    "cross products": lambda x: np.cross(x[None, None, :], np.eye(3)[None]) + np.cross(A[:3], x),
    "lengths": lambda x: np.linalg.norm(A * x, axis=1, keepdims=True),
    "unit vectors": lambda x: unit(A * x),
    "cumulative sums": lambda x: np.cumsum(A * x, axis=1),
    "cumulative sums of nothing": lambda x: np.cumsum((A * x)[:0], axis=0),
    "differences": lambda x: np.diff(A * x, axis=0),
    "inverse": lambda x: np.linalg.inv(3.0 * np.eye(3) + np.outer(x, A[0])),
    "choices": lambda x: np.where(A > 0.0, x, 2.0 * x),
    "places in tables": lambda x: np.interp(x, [-2.0, 0.0, 1.0, 3.0], [1.0, 2.0, 0.0, 5.0]),
    "values in tables": lambda x: np.interp([0.1, 0.9], [0.0, 0.5, 1.0], x),
    "functions": lambda x: np.sin(x) * np.cos(x) + np.arctan2(x, 2.0) + np.sinc(x) + np.hypot(x, 1.0),
    "rotations": lambda x: quaternion.rotate(TURNED, x),
    "matrices of rotations": lambda x: quaternion.matrix(unit(np.concatenate([x, [1.0]]))),
    "repeated": lambda x: np.tile(x, (4, 1)) + np.moveaxis(M * x, 0, 2)[0, 0, :4, None],
    "diagonals": lambda x: np.diag(x) + np.diag(np.diag(np.outer(x, x))),
    "normals": normals,
    "blocks": lambda x: np.kron(np.eye(2), np.outer(x, x)),
    "columns": lambda x: np.column_stack([x, np.outer(x, x)]),
    "entries": with_entries,
    "lists": lambda x: numbers([[x[0], 1.0], [2.0, x[1]]]),
    "shares": lambda x: plus(np.ones((2, 3)), 1, x),
    "sums by index": lambda x: scattered(3, np.array([0, 2, 2, 0]), A * x),
    "interpolation": lambda x: evaluation(np.array([0.0, 0.5, 1.0]), x),
    "Legendre": lambda x: legendre_values(x, 4),
    "powers": lambda x: power_series(x, [1.0, x[0], 3.0]),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arrays_of_symbols_are_arrays(name):
    function, symbol = FUNCTIONS[name], ca.SX.sym("x", 3)
    found = function(Active(VALUES, symbol))
    assert found.values == pytest.approx(function(VALUES), rel=1e-13)
    there = VALUES + np.array([0.02, -0.03, 0.01])
    told = np.array(ca.Function("f", [symbol], [found.expression])(there)).reshape(found.shape)
    assert told == pytest.approx(function(there), rel=1e-12, abs=1e-14)


LOST = {
    "a float": lambda x: float(x[0]),
    "math": lambda x: math.sin(x[0]),
    "an array of floats": lambda x: np.asarray(x, dtype=float),
    "a list": lambda x: np.array([x[0], 1.0], dtype=float),
    "an entry": lambda x: np.zeros(3).__setitem__(0, x[0]),
    "entries": lambda x: np.zeros((2, 3)).__setitem__(1, x),
}


@pytest.mark.parametrize("name", LOST)
def test_what_would_lose_symbols_is_refused(name):
    with pytest.raises((TypeError, ValueError)):
        LOST[name](Active(VALUES, ca.SX.sym("x", 3)))


# -- scenes ---------------------------------------------------------------------------------------------


def leaves(value, path=()):
    """Names of all numbers, and of lists of numbers."""
    if isinstance(value, dict):
        for key, entry in value.items():
            yield from leaves(entry, (*path, key))
    elif isinstance(value, list) and not all(isinstance(entry, (int, float)) for entry in value):
        for i, entry in enumerate(value):
            yield from leaves(entry, (*path, str(i)))
    elif isinstance(value, (int, float, list)) and not isinstance(value, bool):
        yield ".".join(path)


def prepared(scene):
    base = assemble(scene, first_mesh(scene, 3))
    places = {name: [0.3, 1.0] for name, member in scene.members.items() if member.type == "flexible"}
    curved = [f"members.{name}.curvature" for name in places]
    return base, Results(base, default_results(base, unique=False) + curved, places)


def told(known, values):
    """Parts of what is given for values of the numbers, and what is told of the undeformed scene."""
    p = ca.MX.sym("p", len(values))
    given, rest = ca.Function("told", [p], [known.given(p), known.undeformed(p)])(values)
    bounds = np.cumsum([0, *known.program.sizes.values()])
    return [*np.split(np.array(given).ravel(), bounds[1:-1]), np.array(rest).ravel()]


def assembled(scene, numbers, known, base, results):
    """The same of a scene with these numbers, assembled by itself; the loads at their defaults."""
    mesh = with_cuts(base.scene, base.mesh, numbers)
    model = assemble(scene, mesh, assembly=base.assembly, scales=base.scales)
    program = Program(Expressions(Equations(model, kernels="interpreted"), "interpreted"), known.program.sizes)
    found, first = 0.0, program.slice_of_loads.start
    for history, loading in model.groups.items():
        factor = argument(scene, FACTOR if history is None else f"histories.{history}").default[0]
        part = program.given_of(loading)
        part[first:] *= factor
        part[:first] *= history is None
        found = found + part
    bounds = np.cumsum([0, *program.sizes.values()])
    return [*np.split(found, bounds[1:-1]), results.rest(model)]


@pytest.mark.parametrize("name", EVERYTHING)
def test_every_number_is_a_symbol_or_refused(name):
    scene, random, count = Scene.from_dict(EVERYTHING[name]()), np.random.default_rng(3), 0
    base, results = prepared(scene)
    table = {key: entry for key, entry in scene.to_dict().items() if key not in ("analysis", "expect", "histories")}
    for path in leaves(table):
        try:
            (one,) = asked_for(scene, [path])
            known = Arguments(scene, base, [one], results)
            values = known.defaults * (1.0 + random.uniform(-0.03, 0.03, len(known.defaults)))
            single = dict(zip(one.names, values.tolist(), strict=True))
            other = with_numbers(scene, single)
        except SceneError:
            # What moves nothing, or cannot move alone.
            continue
        count += 1
        for here, there in zip(told(known, values), assembled(other, single, known, base, results), strict=True):
            size = max(np.abs(there).max(initial=0.0), np.finfo(float).tiny)
            assert np.abs(here - there).max(initial=0.0) <= ROUNDING * size, path
    assert count > 4


def test_a_model_is_assembled_once_more(monkeypatch):
    calls = []

    def counted(*args, **kwargs):
        calls.append(args)
        return assemble(*args, **kwargs)

    monkeypatch.setattr(module, "assemble", counted)
    scene = Scene.from_dict(cantilever([0.0, 3.0]))
    length = Parameter(1.0, lambda x: {"nodes.B.position": [x, 0.0]})
    solver = parametric(scene, {"length": length, "sections.s.EI3": None, "loads.tip.value": None})
    assert len(calls) == 1
    # Far from where it was assembled: a cantilever knows F L^2 / EI only.
    long, stiff = solver.solve({"length": 3.0, "sections.s.EI3": 9.0}), solver.solve()
    assert long["nodes.B.position"] == pytest.approx(3.0 * stiff["nodes.B.position"], rel=1e-9)
    assert len(calls) == 1


def loaded_within(at, **more):
    """A cantilever with a force within it, and another one where ``more`` says."""
    table = cantilever([0.0, 0.3])
    table["loads"]["inner"] = {"type": "force", "member": "m", "at": at, "value": [0.5, 2.0]}
    for name, place in more.items():
        table["loads"][name] = {"type": "force", "member": "m", "at": place, "value": [0.1, -0.3]}
    return Scene.from_dict(table)


def test_a_load_moves_along_its_member():
    solver = parametric(loaded_within(0.4, other=0.8), ["loads.inner.at"], ["nodes.B.position", "energy.elastic"])
    answer = solver.solve({"loads.inner.at": 0.6})
    there = solve(loaded_within(0.6, other=0.8), accuracy=1e-9).last
    # Elements that move with the load are as fine as where they were made, at an accuracy of 1e-4 and better.
    assert answer["nodes.B.position"] == pytest.approx(there.position("B"), abs=1e-6)
    h = 1e-4
    sides = [solver.solve({"loads.inner.at": 0.6 + k * h}, answer)["energy.elastic"] for k in (1, -1)]
    # Differences of second order.
    slope = (sides[0] - sides[1]) / (2.0 * h)
    assert answer.jacobian["energy.elastic"]["loads.inner.at"] == pytest.approx(slope, rel=1e-6)
    with pytest.raises(SceneError, match=r"values.loads.inner.at: found 0.9, accepted: 8e-07 to 0.799999"):
        solver.solve({"loads.inner.at": 0.9})


PLACES = [
    (loaded_within(0.4, other=0.4), None, "found 0.4, where a kink, another load or an end is, accepted: a place by"),
    (loaded_within(1.0), None, "found 1, where a kink, another load or an end is"),
    (loaded_within(0.4), (0.2, 1.2), "found 0.2 to 1.2, accepted: a range between 0 and 1"),
]


@pytest.mark.parametrize(("scene", "span", "sentence"), PLACES)
def test_loads_stay_between_what_is_beside_them(scene, span, sentence):
    with pytest.raises(SceneError, match=sentence):
        parametric(scene, {"loads.inner.at": span}, ["nodes.B.position"])


def test_where_elements_move_nothing_is_told_along_them():
    with pytest.raises(
        SceneError, match=r"found members\.m\.moment, along a member on which a load or a tube moves, accepted"
    ):
        parametric(loaded_within(0.4), ["loads.inner.at"], ["members.m.moment"])
