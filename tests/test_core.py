"""The core in C against the evaluator in Python, LAPACK and CasADi; what it is given, and libraries that are not it."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scenes import cantilever, model_of
from systems import EVERY, EVERYTHING

import sfetcas
from sfetcas.core import building
from sfetcas.mathematics import core as c
from sfetcas.mathematics import linear, tapes
from sfetcas.mathematics.linear import CoreSystem, InertiaSolver, SparseSolver
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.inputs import Inputs
from sfetcas.mechanics.mesh import first_mesh
from sfetcas.mechanics.terms import rotation_gradient
from sfetcas.solvers import continuation, newton, tracing
from sfetcas.solvers.globalised import Code, Globalised, Rules
from sfetcas.solvers.prepared import Prepared

PROBLEMS = Path(__file__).parent.parent / "problems"

ROUNDING = 1e-12
"""What sums in another order leave, share of the largest of their kind: some hundred terms, each with 1e-16."""


@pytest.fixture(autouse=True)
def library():
    found = c.core()
    if found is None:
        pytest.skip("no core here, and no compiler that makes one")
    return found


def both(model):
    """The equations by the core, and in Python."""
    by_core, python = Equations(model, kernels="core"), Equations(model, kernels="interpreted")
    assert by_core._core is not None
    assert python._core is None
    return by_core, python


def trial(equations, model, size=0.5):
    """Loads, and a state in which nothing is in balance."""
    loading, rng = model.loading(0.8), np.random.default_rng(7)
    start = equations.start(loading)
    start = replace(start, y=rng.normal(size=start.y.shape), lam=rng.normal(size=start.lam.shape))
    return loading, start, size * rng.normal(size=equations.total)


def alike(a, b, rounding=ROUNDING):
    assert np.abs(np.asarray(a) - b).max(initial=0.0) <= rounding * max(1.0, float(np.abs(b).max(initial=0.0)))


CASES = [(name, assembly, False) for name in EVERY for assembly in ("closing", "nodal")]
CASES += [(name, "closing", True) for name in ("arch", "hinged_space", "linked_space")]


@pytest.mark.parametrize(("name", "assembly", "gauss"), CASES)
def test_equations_are_those_of_python(name, assembly, gauss):
    model = model_of(EVERYTHING[name](), 2, 2, assembly=assembly, gauss=gauss)
    by_core, python = both(model)
    loading, start, step = trial(python, model)
    states = [one.moved(start, step) for one in (by_core, python)]
    for mine, other in zip(*(vars(state).values() for state in states), strict=True):
        alike(mine, other)
    for convex in (False, True):
        mine, other = (one.at(states[1], loading, convex=convex) for one in (by_core, python))
        # The core keeps the derivatives of chords to itself.
        jacobian = by_core._core.parts[0][5].reshape(other.rotation_jacobian.shape)
        for part in vars(mine):
            alike(jacobian if part == "rotation_jacobian" else getattr(mine, part), getattr(other, part))
    for mine, other in zip(by_core.shares(states[1], loading), python.shares(states[1], loading), strict=True):
        alike(mine, other)


@pytest.mark.parametrize("name", ["spatial_fourbar", "spatial_loop_hinge"])
def test_scales_of_hinges_about_any_axis(name):
    """The components of a moment have weights of both signs in the angle about an axis aslant; sizes add up."""
    scene = sfetcas.load(PROBLEMS / f"{name}.toml")
    by_core, python = both(sfetcas.assemble(scene, first_mesh(scene, 4, turning=1.0)))
    loading, start, _ = trial(python, python.model)
    alike(by_core.at(start, loading).scale, python.at(start, loading).scale)


@pytest.mark.parametrize("name", ["arch", "hinged_space", "linked", "linked_space"])
def test_slope_is_that_of_python(name):
    """By a rate of loads on nodes and of prescribed displacements."""
    model = model_of(EVERYTHING[name](), 2, 2)
    by_core, python = both(model)
    loading, start, step = trial(python, model)
    state = python.moved(start, step)
    rng, rate = np.random.default_rng(1), loading.scaled(0.0)
    loads = tuple(
        rng.normal(size=load.shape) * kind.proportional for kind, load in zip(rate.kinds, rate.loads, strict=True)
    )
    force, shift = (rng.normal(size=part.shape) for part in (rate.force, rate.shift))
    rate = replace(rate, force=force, shift=shift, loads=loads)
    mine, other = (one.slope(state, one.at(state, loading), rate) for one in (by_core, python))
    alike(mine, other)


SOLVED = [
    "lee_frame",
    "arch_145_degrees",
    "bend_45_degrees",
    "portal_frame",
    "fourbar_hinges_in_space",
    "tendon_finger",
    "cantilever_follower_force",
]


@pytest.mark.parametrize("name", SOLVED)
def test_newton_takes_the_decisions_of_python(name, monkeypatch):
    """Every correction of a whole analysis: whether it converges, in how many steps, how long they were, and where."""
    compared, by_core = [], newton._by_core

    def checked(system, state, factor, limits):
        known = system.equations.redundant
        mine = by_core(system, state, factor, limits)
        if mine is None:
            return None
        after, system.equations.redundant = system.equations.redundant, known
        other = newton._Correction(system, limits)(state, factor)
        system.equations.redundant = after
        compared.append(mine)
        assert mine.converged == other.converged
        # Whether the last step is rounding differs with rounding.
        assert abs(mine.iterations - other.iterations) <= 1
        assert mine.first == pytest.approx(other.first, rel=1e-6, abs=1e-9)
        if mine.converged:
            alike(mine.state.q, other.state.q, 1e-9)
            assert mine.loading.factor == pytest.approx(other.loading.factor, rel=1e-9)
        return mine

    monkeypatch.setattr(newton, "_by_core", checked)
    sfetcas.solve(sfetcas.load(PROBLEMS / f"{name}.toml"))
    assert len(compared) > 3 or name == "fourbar_hinges_in_space"


def test_signs_of_eigenvalues_where_rows_depend_on_each_other():
    """Straight columns beside each other beyond their critical load: the pivot of a row is rounding there."""
    places = {"a": -0.5, "b": 0.0, "c": 0.5}
    held = {name: {"position": [x, -1], "support": "hinge"} for name, x in places.items()}
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"top": {"position": [0, 0]}} | held,
        "members": {name: {"nodes": ["top", name], "section": "s"} for name in places},
        "loads": {"p": {"type": "force", "node": "top", "value": [0, -1]}},
    }
    told = 0
    for elements in (1, 2, 3, 4):
        prepared = Prepared(model_of(table, elements))
        equations, test = prepared.equations, prepared._test
        for factor in np.linspace(0.0, 60.0, 25):
            loading = equations.model.loading(factor)
            point = prepared.correct(equations.start(loading), loading).point
            equations.redundant = None
            found = test._clearly_negative(point.entries)
            known = test._all(point, test._weighted(point), test._limit(test._weighted(point)))
            if found is not None:
                told += 1
                assert found == int((known[0] < -known[1]).sum())
    # Where the core does not tell, all eigenvalues are computed.
    assert told < 100


def beside_each_other(count):
    """So many equal cantilevers, which know nothing of each other."""
    nodes = {f"a{i}": {"position": [0, i], "support": "clamped"} for i in range(count)}
    nodes |= {f"b{i}": {"position": [1, i]} for i in range(count)}
    return {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": nodes,
        "members": {f"m{i}": {"nodes": [f"a{i}", f"b{i}"], "section": "s"} for i in range(count)},
        "loads": {f"p{i}": {"type": "force", "node": f"b{i}", "value": [-1.0, 0.5]} for i in range(count)},
    }


ALIKE = {"one": 1, "two": 2, "three": 3, "four": None, "linked": 1, "hinged_space": 1, "linked_space": 1}
"""Eigenvalues that equal the lowest one; where there are as many as the core finds at once it does not tell."""


@pytest.mark.parametrize("name", ALIKE)
def test_lowest_eigenvalues_are_those_of_all(name):
    counts = {"one": 1, "two": 2, "three": 3, "four": 4}
    table = beside_each_other(counts[name]) if name in counts else EVERYTHING[name]()
    prepared = Prepared(model_of(table, 3, 3))
    loading, test = prepared.model.loading(0.2), prepared._test
    solved = prepared.correct(prepared.equations.start(loading), loading)
    assert solved.converged
    entries = test._weighted(solved.point)
    limit = test._limit(entries)
    mine, other = test._lowest(solved.point, limit), test._dense(solved.point, entries, limit)
    if ALIKE[name] is None:
        assert mine is None
        return
    assert mine[1].shape[1] == other[1].shape[1] == ALIKE[name]
    # Of all eigenvalues rounding leaves 1e-16 of the largest one.
    rounding = 1e-14 * other[0][-1] + 1e-11 * other[0][0]
    assert np.abs(mine[0][: ALIKE[name]] - other[0][: ALIKE[name]]).max() <= rounding
    np.testing.assert_allclose(np.linalg.svd(mine[1].T @ other[1], compute_uv=False), 1.0, atol=1e-9)


def test_lowest_eigenvalues_of_what_is_unstable_are_not_told():
    prepared = Prepared(model_of(cantilever((-10.0, 0.0)), 2))
    loading = prepared.model.loading(1.0)
    point = prepared.equations.at(prepared.equations.start(loading), loading)
    assert prepared._test._dense(point, prepared._test._weighted(point), 1e-9)[2] == 1
    assert prepared._test._lowest(point, 1e-9) is None


AFAR = [
    "cantilever_tip_force",
    "bend_45_degrees",
    "portal_frame",
    "cantilever_rolled_up",
    "cantilever_compressed_straight",
    "euler_column_beyond_second_load",
    "tendon_finger",
]


@pytest.mark.parametrize("name", AFAR)
def test_newton_from_afar_takes_the_decisions_of_python(name, monkeypatch):
    """Code, eigenvalues, iterations and state of each solve of an analysis without IPOPT."""
    compared, solve, by_core = [], Globalised.__call__, Globalised._by_core

    def checked(method, row, start=None, **more):
        mine = solve(method, row, start, **more)
        with monkeypatch.context() as python:
            python.setattr(Globalised, "_by_core", lambda *_, **__: None)
            other = solve(method, row, start, **more)
        compared.append(mine)
        assert (mine.code, mine.negative) == (other.code, other.negative)
        # Whether the last step is rounding differs with rounding; what is unstable is found once more and left.
        assert abs(mine.iterations - other.iterations) <= 2
        alike(mine.state, other.state, 1e-9)
        return mine

    monkeypatch.setattr(Globalised, "__call__", checked)
    sought = []
    monkeypatch.setattr(
        Globalised, "_by_core", lambda *given, **more: sought.append(by_core(*given, **more)) or sought[-1]
    )
    sfetcas.solve(sfetcas.load(PROBLEMS / f"{name}.toml"), solver="newton")
    # Loads without potential are followed, by whole steps with pivots.
    scene = sfetcas.load(PROBLEMS / "cantilever_follower_force.toml")
    follower = Prepared(sfetcas.assemble(scene, first_mesh(scene, 4, turning=1.0)))
    assert follower.globalised(follower.model.loading(2.0))[0] is not None
    assert len(compared) > 1
    assert all(found is not None for found in sought)


@pytest.mark.parametrize("name", EVERYTHING)
def test_rows_are_solved_as_in_python(name, monkeypatch):
    """Cold, from an equilibrium for other loads, and on the way from one: codes, eigenvalues and states."""
    model = model_of(EVERYTHING[name](), 1, 3)
    prepared = Prepared(model)
    inputs = Inputs(prepared.equations)
    rows = [inputs.of(model.loading(factor)) for factor in (0.3, 1.0)]
    method = Globalised(inputs, prepared.weight, Rules(escapes=0))
    cold = [solved_twice(method, row) for row in rows]
    if Code.SOLVED not in {found.code for found in cold[:1]}:
        return
    solved_twice(method, rows[1], cold[0].state, warm=True)
    assert solved_twice(method, rows[0], cold[0].state, warm=True).iterations <= 3
    # However large quaternions of a start are.
    large, turns = cold[0].state.copy(), prepared.equations.start(model.loading(0.0)).q.size
    large[:turns] *= 1e200 if model.space else 1.0
    alike(solved_twice(method, rows[0], large, warm=True).state, cold[0].state, 1e-8)
    # Where whole steps are too long what is given becomes another little by little.
    counted = Counted(Globalised._followed)
    monkeypatch.setattr(Globalised, "_followed", counted)
    monkeypatch.setattr(type(model), "downhill", property(lambda _: False))
    rules = Rules(escapes=0, far=FAR.get(name, 0.1), near=0.01)
    way = Globalised(inputs, prepared.weight, rules, begun=(rows[0], cold[0].state))
    found = solved_twice(way, rows[1], cold[0].state, warm=True)
    assert counted.calls
    assert found.code is Code.SOLVED


FAR = {"tripod": 0.02}
"""Longest step of each scene, rad, with which it does not get there at once; by default a tenth."""


def test_a_start_of_another_length_is_refused():
    prepared = Prepared(model_of(EVERYTHING["linked"](), 1, 3))
    method = Globalised(Inputs(prepared.equations), prepared.weight)
    row = method.inputs.of(prepared.model.loading(1.0))
    for size in (0, method.states - 1, method.states + 1):
        with pytest.raises(
            ValueError, match=rf"start: found an array of shape \({size},\), accepted: \({method.states},\)"
        ):
            method(row, np.zeros(size))


class Counted:
    """A method that counts how often it is called."""

    def __init__(self, method):
        self.calls, self._method = 0, method

    def __get__(self, one, _):
        def called(*given):
            self.calls += 1
            return self._method(one, *given)

        return called


def solved_twice(method, row, start=None, *, warm=False):
    mine, other = method(row, start, warm=warm), method._step_by_step(row, start, warm=warm)
    assert mine.code == other.code
    assert abs(mine.iterations - other.iterations) <= 2
    if mine.code in (Code.SOLVED, Code.UNSTABLE):
        assert mine.negative == other.negative
        alike(mine.state, other.state, 1e-8)
    return mine


FOLLOWED = {
    "cantilever_tip_force": True,
    "portal_frame": True,
    "bend_45_degrees": True,
    "tendon_robot_along": True,
    "frame_snaps": False,
    "column": False,
}
"""Whether the core follows all ways to their ends."""


@pytest.mark.parametrize("name", FOLLOWED)
def test_ways_of_loads_are_those_of_python(name, monkeypatch):
    """The same steps, tried and taken, to the same states, and the end of a way where it is not plain any more."""
    compared, by_core = [], continuation._Following.plainly

    def checked(self, begin, whole, tries):
        here, step, left = by_core(self, begin, whole, tries)
        count = 0

        def counted(point, length):
            nonlocal count
            count += 1
            return self.trial(point, length)

        if here.done > 0.0:
            # Not by the whole part of the way: where it is left is no multiple of steps.
            other, reached = continuation.advanced(
                begin, continuation.FIRST, counted, lambda there: there.done >= here.done, tries=tries
            )
            assert reached
            assert other.done == here.done
            # At the end of what is plain come the steps that it refused.
            assert count == tries - left or (here.done < 1.0 and count < tries - left)
            alike(here.found.state.q, other.found.state.q, 1e-9)
            alike(here.found.state.lam, other.found.state.lam, 1e-9)
        if self.proportional:
            compared.append(here.done)
        return here, step, left

    monkeypatch.setattr(continuation._Following, "plainly", checked)
    if name == "frame_snaps":
        scene = sfetcas.load(PROBLEMS / "lee_frame.toml").replace({"analysis": sfetcas.Analysis(steps=[1.9])})
    elif name == "column":
        # Beyond its critical load a straight column is left to its side.
        scene = sfetcas.Scene.from_dict(cantilever((-3.0, 0.0)))
    else:
        scene = sfetcas.load(PROBLEMS / f"{name}.toml")
    sfetcas.solve(scene.replace({"expect": ()}))
    assert compared
    assert (min(compared) == 1.0) == FOLLOWED[name]


TRACED = {
    "lee_frame": 150,
    "arch_145_degrees": 80,
    "heavy_column_clamped_free": 40,
    "heavy_column_in_space": 60,
    "strip_lateral_buckling": 60,
    "arch_caught_by_a_string": 30,
}
"""Points that the core finds at least: under loads on nodes and along members, in space, and with something watched."""


@pytest.mark.parametrize("name", TRACED)
def test_curves_are_those_of_python(name, monkeypatch):
    """The same steps to the same points, with their tangents, eigenvalues and the length of the next step."""
    compared, by_core, never = [], tracing._Piece.plainly, 10**9

    def checked(self, now, length):
        if self.waits > 1000:
            return length
        own = {"more": self.more, "points": [*self.points], "before": self.before}
        own |= {name: getattr(self, name) for name in ("curve", "span", "stride", "budget", "watch", "passed")}
        count, after = len(self.points), by_core(self, now, length)
        python, here = tracing._Piece(**own, waits=never), now
        while len(python.points) < len(self.points):
            there, length = python.trial(here, length)
            here = there or here
        for mine, other in zip(self.points[count:], python.points[count:], strict=True):
            assert mine.factor == pytest.approx(other.factor, rel=1e-8)
            assert mine.arc == pytest.approx(other.arc, rel=1e-8)
            assert mine.inertia == other.inertia
            assert mine.doubtful == other.doubtful
            alike(mine.state.q, other.state.q, 1e-8)
            alike(mine.tangent.z, other.tangent.z, 1e-6)
            assert mine.residual <= 1e-9
        if len(self.points) > count:
            # Where it ended it may have found that shorter steps are needed.
            assert after <= length * (1.0 + 1e-6)
            assert (self.more, self.before.factor) == (python.more, pytest.approx(python.before.factor, rel=1e-8))
        compared.append(len(self.points) - count)
        return after

    monkeypatch.setattr(tracing._Piece, "plainly", checked)
    sfetcas.solve(sfetcas.load(PROBLEMS / f"{name}.toml"))
    assert sum(compared) >= TRACED[name]


WITHOUT = ["cantilever_tip_force", "portal_frame", "bend_45_degrees", "tendon_robot_along"]


@pytest.mark.parametrize("name", WITHOUT)
def test_answers_without_the_core(name, monkeypatch):
    scene = sfetcas.load(PROBLEMS / f"{name}.toml")
    mine = sfetcas.solve(scene)
    monkeypatch.setenv("SFETCAS_CORE", "off")
    assert c.core() is None
    other = sfetcas.solve(scene)
    assert mine.status is other.status is sfetcas.Status.SOLVED
    for one, two in zip(mine.steps, other.steps, strict=True):
        assert one.certificate.stable == two.certificate.stable
        for node in scene.nodes:
            # Both are converged to rounding; what that leaves is multiplied by how soft the structure is.
            np.testing.assert_allclose(one.position(node), two.position(node), atol=1e-9 * scene.size)


# -- tapes ----------------------------------------------------------------------------------------------------


def run(library, function, arguments):
    """Results of a function by the core, for arguments (n, ...)."""
    tape = tapes.tape_of(function)
    table, kept = c.table_of(tape)
    given = np.ascontiguousarray(np.concatenate(arguments, axis=1))
    results = np.zeros((len(given), tape.results))
    work = np.zeros(library.sf_tape_work(ctypes.addressof(table)))
    library.sf_run(ctypes.addressof(table), len(given), given.ctypes.data, results.ctypes.data, work.ctypes.data)
    del kept
    return np.split(results, tape.parts[1:-1], axis=1)


def test_operations_are_those_of_casadi(library):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    unary = "sqrt sin cos tan asin acos atan exp log expm1 log1p sinh cosh tanh asinh atanh fabs sign floor ceil erf"
    found = [getattr(ca, name)(x) for name in unary.split()] + [ca.acosh(1.0 + x), 1.0 / x, -x, x * x, x + x]
    pairs = "atan2 hypot copysign fmin fmax fmod remainder"
    found += [getattr(ca, name)(x, y) for name in pairs.split()]
    found += [x + y, x - y, x * y, x / y, x**y, x**3.3, x < y, x <= y, x == y, x != y]
    found += [ca.if_else(x < y, 2.0 * x, 3.0), ca.logic_and(x < y, x < 0.4), ca.logic_or(x < y, x < 0.4)]
    found += [ca.logic_not(x < y)]
    function = ca.Function("every", [x, y], [ca.densify(ca.vertcat(*found))])
    rng = np.random.default_rng(3)
    given = [rng.uniform(0.05, 0.95, size=(11, 1)) for _ in range(2)]
    (mine,) = run(library, function, given)
    for row, a, b in zip(mine, *given, strict=True):
        # Functions of the math library may be others than those that CasADi was built with: by a last digit.
        np.testing.assert_allclose(row, function(a, b).full().ravel(), rtol=1e-15, atol=1e-15)
    used = set(tapes.tape_of(function).code[:, 0].tolist())
    assert {tapes.NAMES[i] for i in used} >= set(tapes.NAMES) - {"ASSIGN", "INV", "SPLINE"}


@pytest.mark.parametrize("count", [1, 2, 4, 5, 8, 9, 17])
def test_a_term_has_the_same_bits_in_any_lane(library, count):
    function = rotation_gradient(sfetcas.mechanics.elements.element_by_name("SFET3", True))
    rng = np.random.default_rng(count)
    given = [rng.normal(size=(count, function.nnz_in(i))) for i in range(function.n_in())]
    whole = run(library, function, given)
    for i in range(count):
        for mine, other in zip(run(library, function, [part[i : i + 1] for part in given]), whole, strict=True):
            np.testing.assert_array_equal(mine[0], other[i])


@pytest.mark.parametrize("name", ["SFET5", "SFET3"])
def test_operations_of_a_kind_stand_together(library, name):
    """In few stretches, and in hardly more memory than in the order of CasADi."""
    tape = tapes.tape_of(rotation_gradient(sfetcas.mechanics.elements.element_by_name(name, True)))
    table, (stretch, code, *_) = c.table_of(tape)
    assert stretch[:, 1].sum() == len(tape.code) == len(code)
    assert len(stretch) == table.stretches < len(tape.code) / 20
    assert table.slots < 1.5 * tape.slots
    kinds, counts = np.unique(tape.code[:, 0], return_counts=True)
    assert [stretch[stretch[:, 0] == kind, 1].sum() for kind in kinds] == counts.tolist()


def test_functions_with_other_operations_have_no_tape():
    x = ca.MX.sym("x")
    spline = ca.interpolant("table", "bspline", [np.linspace(0, 1, 9)], np.sin(np.linspace(0, 1, 9)))
    assert tapes.tape_of(ca.Function("looks_up", [x], [spline(x)])) is None


# -- linear systems -------------------------------------------------------------------------------------------


def pattern_of(matrix):
    column, row = np.nonzero(((matrix != 0.0) | np.eye(len(matrix), dtype=bool)).T)
    return row, column


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_systems_are_solved(library, symmetric, seed):
    """Matrices with zeros on the diagonal, which have no factors without pivots."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 90))
    matrix = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.2)
    matrix = matrix + matrix.T if symmetric else matrix
    matrix[np.diag_indices(n)] += rng.normal(size=n) * (rng.random(n) < 0.6)
    matrix[np.arange(n), (np.arange(n) + 1) % n] += 3.0
    matrix[(np.arange(n) + 1) % n, np.arange(n)] += 3.0
    row, column = pattern_of(matrix)
    system = CoreSystem(library, n, row, column, np.full(n, 1e-8), 0, symmetric)
    # Too little room: it has to grow.
    system.make_room(n)
    b = rng.normal(size=(n, 3))
    size = np.abs(matrix).max()
    for _ in range(4):
        x = system.solved(matrix[row, column], b)
        assert np.abs(matrix @ x - b).max() <= 1e-14 * n * size * np.abs(x).max()
        one = system.solved(matrix[row, column], b[:, 0])
        np.testing.assert_allclose(one, x[:, 0], rtol=1e-6, atol=1e-9 * np.abs(x).max())


@pytest.mark.parametrize("seed", range(4))
def test_pivots_serve_the_next_matrices(library, seed):
    """Kept for matrices near the last one; chosen anew where one has become nothing, and by whoever asks alone."""
    rng, n = np.random.default_rng(seed), 40
    matrix = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.15)
    matrix[np.arange(n), (np.arange(n) + 1) % n] += 3.0
    row, column = pattern_of(matrix)
    system = CoreSystem(library, n, row, column, np.zeros(n), 0, False)
    b, work = rng.normal(size=n), np.zeros(4 * n)
    rows = (ctypes.c_int * n).from_address(system._pivoted.row_of)

    def solved_again(matrix):
        entries, x = np.ascontiguousarray(matrix[row, column]), np.zeros(n)
        given = (entries.ctypes.data, 1, b.ctypes.data, x.ctypes.data, work.ctypes.data)
        assert library.sf_solve(system.address, *given) == 0
        assert np.abs(matrix @ x - b).max() <= 1e-13 * n * np.abs(matrix).max() * np.abs(x).max()
        return list(rows)

    system.solved(matrix[row, column], b)
    chosen = list(rows)
    # A pivot that is no more the largest of its column, nor a tenth of that.
    k = next(k for k in range(n) if chosen[k] != system.order[k] and matrix[chosen[k], system.order[k]] != 0.0)
    smaller = matrix.copy()
    smaller[chosen[k], system.order[k]] *= 0.05
    assert solved_again(smaller) == chosen
    system.solved(smaller[row, column], b)
    assert list(rows) != chosen
    system.solved(matrix[row, column], b)
    none = matrix.copy()
    none[chosen[0], system.order[0]] = 0.0
    assert solved_again(none) != chosen


@pytest.mark.parametrize("seed", range(4))
def test_factors_serve_matrices_near_theirs(library, seed):
    """Where asked, and where refinement leaves as little as their own do."""
    rng, n = np.random.default_rng(seed), 30
    matrix = rng.normal(size=(n, n)) + n * np.eye(n)
    row, column = pattern_of(matrix)
    system = CoreSystem(library, n, row, column, np.zeros(n), 0, False)
    b, x, work = rng.normal(size=n), np.zeros(n), np.zeros(4 * n)
    pivots = (ctypes.c_double * n).from_address(system._pivoted.pivot)
    system.solved(matrix[row, column], b)
    for change, serve in ((1e-3, True), (0.0, True), (0.9, False)):
        known, entries = list(pivots), (matrix + change * n * rng.normal(size=(n, n)))[row, column]
        system._pivoted.known = 2
        assert library.sf_solve(system.address, entries.ctypes.data, 1, *(a.ctypes.data for a in (b, x, work))) == 0
        there = np.zeros((n, n))
        there[row, column] = entries
        assert np.abs(there @ x - b).max() <= 1e-14 * np.abs(there).max() * np.abs(x).max() * n
        assert (list(pivots) == known) == serve


def test_singular_systems_are_refused():
    matrix = np.ones((3, 3))
    row, column = pattern_of(matrix)
    solver = SparseSolver(3, row, column)
    solver.factor(np.zeros(9))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        solver.solve(np.ones(3))
    solver.factor(np.full(9, np.nan))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        solver.solve(np.ones(3))


def test_signs_of_pivots_are_those_of_eigenvalues():
    rng = np.random.default_rng(0)
    for n in (1, 5, 60):
        matrix = rng.normal(size=(n, n))
        matrix = matrix + matrix.T
        row, column = pattern_of(matrix)
        solver = InertiaSolver(n, row, column)
        solver.factor(matrix[row, column])
        assert solver.negative() == (np.linalg.eigvalsh(matrix) < 0.0).sum()


def test_numbers_that_are_none_do_not_converge():
    """A state that is not finite: Newton's method ends, and says that it has not arrived."""
    prepared = Prepared(model_of(EVERYTHING["arch"](), 2, 2))
    loading = prepared.model.loading(1.0)
    state = prepared.equations.start(loading)
    for bad in (np.nan, np.inf, 1e300):
        found = prepared.correct(replace(state, q=np.full_like(state.q, bad)), loading)
        assert not found.converged


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
def test_no_state_is_solved_that_is_none():
    """Random states, some with what is no number, under loads of any size: what converges is finite."""
    rng, converged = np.random.default_rng(4), 0
    for name in ("arch", "hinged_space", "linked", "linked_space"):
        prepared = Prepared(model_of(EVERYTHING[name](), 2, 2))
        equations = prepared.equations
        for count in range(60):
            loading = prepared.model.loading([0.0, 0.3, -5.0, 1e3, 1e300, np.nan, np.inf][count % 7])
            _, state, step = trial(equations, prepared.model, size=10.0 ** rng.integers(-6, 3))
            state = equations.moved(state, step)
            if count % 4 == 0:
                q = state.q.copy()
                q.flat[rng.integers(q.size)] = rng.choice([np.nan, np.inf, 1e308])
                state = replace(state, q=q)
            found = newton.correct(newton.AtLoads(equations, loading, prepared.weight), state)
            converged += found.converged
            assert not found.converged or all(np.isfinite(part).all() for part in vars(found.state).values())
    assert converged > 20


# -- libraries ------------------------------------------------------------------------------------------------


@pytest.fixture
def apart(tmp_path, monkeypatch):
    """The sources alone in a folder, another one as cache."""
    sources = tmp_path / "core"
    shutil.copytree(building.SOURCES, sources, ignore=shutil.ignore_patterns(f"*{building.SUFFIX}", "__pycache__"))
    monkeypatch.setattr(building, "SOURCES", sources)
    monkeypatch.setattr(c, "SOURCES", sources)
    monkeypatch.setenv("SFETCAS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("SFETCAS_CORE", raising=False)
    # The same bits in a ninth of the time that compiling takes.
    monkeypatch.setattr(building, "FLAGS", (*building.FLAGS, "-O0"))
    c._found.cache_clear()
    yield sources, tmp_path / "cache"
    c._found.cache_clear()


@pytest.fixture
def compiler():
    if building.compiler() is None:
        pytest.skip("no compiler here")


def made(cache):
    return sorted(path.name for path in cache.glob(f"core-*{building.SUFFIX}"))


def test_a_core_that_is_missing_is_compiled_once(apart, compiler, monkeypatch):
    assert c.core() is not None
    assert len(made(apart[1])) == 1
    monkeypatch.setattr(building.subprocess, "run", lambda *a, **k: pytest.fail("compiled again"))
    c._found.cache_clear()
    assert c.core() is not None


@pytest.mark.parametrize("how", ["truncated", "emptied", "another", "a folder"])
@pytest.mark.parametrize("beside", [True, False])
def test_a_library_that_is_not_what_was_compiled_is_never_loaded(how, beside, apart, compiler):
    sources, cache = apart
    assert c.core() is not None
    (name,) = made(cache)
    content = (cache / name).read_bytes()
    if beside:
        (cache / name).rename(sources / name)
    path = (sources if beside else cache) / name
    path.unlink()
    if how == "a folder":
        path.mkdir()
    else:
        path.write_bytes({"truncated": content[: len(content) // 2], "emptied": b"", "another": b"\x7fELF" * 99}[how])
    c._found.cache_clear()
    # It is made anew in the cache; where even its name is taken there is none.
    found = c.core()
    assert found is None if how == "a folder" and not beside else found is not None
    if found is not None:
        assert Path(found._name).read_bytes() == content


def test_other_sources_make_another_library(apart, compiler):
    sources, cache = apart
    assert c.core() is not None
    with (sources / "core.h").open("a") as file:
        file.write("/* changed */\n")
    c._found.cache_clear()
    assert c.core() is not None
    assert len(made(cache)) == 2


def test_a_core_of_another_version_is_not_used(apart, compiler, monkeypatch):
    monkeypatch.setattr(c, "VERSION", c.VERSION + 1)
    assert c.core() is None


def test_a_cache_that_others_may_write_to_is_not_used(apart, compiler):
    cache = apart[1]
    assert c.core() is not None
    cache.chmod(0o777)
    c._found.cache_clear()
    with pytest.warns(UserWarning, match="others may write to it"):
        assert c.core() is None


def test_without_a_compiler_there_is_none(apart, monkeypatch):
    monkeypatch.setattr(building, "compiler", lambda: None)
    assert c.core() is None
    assert sfetcas.solve(sfetcas.load(PROBLEMS / "portal_frame.toml")).status is sfetcas.Status.SOLVED


def test_nothing_is_compiled_where_that_is_not_wanted(apart, monkeypatch):
    monkeypatch.setenv("SFETCAS_KERNELS", "interpreted")
    assert c.core() is None
    assert not made(apart[1])


def test_a_core_that_is_asked_for_and_not_there_is_refused(monkeypatch):
    scene = sfetcas.load(PROBLEMS / "portal_frame.toml")
    assert sfetcas.solve(scene, kernels="core").status is sfetcas.Status.SOLVED
    monkeypatch.setenv("SFETCAS_CORE", "off")
    with pytest.raises(sfetcas.SceneError, match="kernels: found 'core', and there is none here, accepted: auto"):
        sfetcas.solve(scene, kernels="core")


def test_a_compiler_that_fails_leaves_nothing(apart, monkeypatch):
    monkeypatch.setattr(building, "compiler", lambda: sys.executable)
    assert c.core() is None
    assert not list(apart[1].iterdir())


def test_core_compiles_without_warnings(tmp_path, compiler):
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1"]
    command = [building.compiler(), *strict, "-c", "-o", str(tmp_path / "core.o"), str(building.SOURCES / "core.c")]
    subprocess.run(command, check=True)
    assert os.path.getsize(tmp_path / "core.o") > 0


# -- elementary functions -------------------------------------------------------------------------------------


CLOSE = {"sin": 2, "cos": 2, "exp": 2, "log": 2, "atan": 2, "log1p": 4, "expm1": 6, "tan": 6, "asin": 6, "acos": 6}
"""Units in the last digit by which the core's functions may be off: one of its own, and one of the math library."""


@pytest.mark.parametrize("name", [*CLOSE, "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"])
def test_elementary_functions_are_right_to_last_digits(library, name):
    """Against NumPy, over all that they take."""
    rng, x = np.random.default_rng(5), ca.SX.sym("x")
    given = np.concatenate([rng.uniform(-1, 1, 4000), rng.uniform(-30, 30, 4000), rng.uniform(-1e6, 1e6, 2000)])
    given = {
        "log": np.abs(given), "log1p": np.abs(given), "acosh": 1.0 + np.abs(given), "exp": given[:8000],
        "expm1": given[:8000], "asin": given[:4000], "acos": given[:4000], "atanh": given[:4000],
        "sinh": given[:8000], "cosh": given[:8000], "tan": given[:4000],
    }.get(name, given)  # fmt: skip
    (mine,) = run(library, ca.Function("one", [x], [getattr(ca, name)(x)]), [given[:, None]])
    numpy = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh"}
    right = getattr(np, numpy.get(name, {"atanh": "arctanh"}.get(name, name)))(given)
    assert (np.abs(mine[:, 0] - right) <= CLOSE.get(name, 8) * np.spacing(np.abs(right))).all()


def test_functions_of_what_is_no_number(library):
    x = ca.SX.sym("x")
    names = ["sin", "cos", "exp", "log", "atan", "sinh", "tanh", "asinh", "erf", "sqrt", "log1p"]
    function = ca.Function("every", [x], [ca.vertcat(*(getattr(ca, name)(x) for name in names))])
    given = np.array([0.0, np.nan, np.inf, -np.inf, -1.0, 1e308, 5e-324])
    (mine,) = run(library, function, [given[:, None]])
    right = np.array([function(value).full().ravel() for value in given])
    # The sine of 1e308 is what the next number makes of it, too.
    huge = np.abs(given) == 1e308
    np.testing.assert_allclose(mine[~huge], right[~huge], rtol=1e-15)
    assert np.isfinite(mine[huge][:, :2]).all()


def bits(library, monkeypatch):
    """Of states, residuals, matrices and steps of two models, evaluated by a library."""
    for module in (c, linear):
        monkeypatch.setattr(module, "core", lambda: library)
    content = hashlib.sha256()
    for name in ("arch", "linked_space"):
        prepared = Prepared(model_of(EVERYTHING[name](), 2, 2), kernels="core")
        equations = prepared.equations
        loading, start, step = trial(equations, prepared.model)
        state = equations.moved(start, step)
        point = equations.at(state, loading)
        found = prepared.correct(equations.start(loading), loading)
        for part in (state.q, point.residual, point.entries, found.state.q, found.state.lam):
            content.update(part.tobytes())
    return content.hexdigest()


OTHERWISE = [["-O0"], ["-O2", "-march=native"], ["-O3", "-funroll-loops"]]


@pytest.mark.parametrize("flags", OTHERWISE, ids=" ".join)
def test_bits_do_not_depend_on_the_compiler(flags, library, tmp_path, compiler, monkeypatch):
    """With every instruction that this processor has, and with none but the simplest."""
    path = tmp_path / "core.so"
    command = [building.compiler(), *building.FLAGS, *flags, "-o", str(path), str(building.SOURCES / "core.c"), "-lm"]
    subprocess.run(command, check=True)
    other = c._declared(ctypes.CDLL(str(path)))
    assert bits(other, monkeypatch) == bits(library, monkeypatch)


@pytest.mark.parametrize("by_core", [True, False])
def test_what_is_in_balance_needs_no_step(by_core, monkeypatch):
    """Rounding may have no Newton step that is found; a state that is out of balance needs one."""
    if not by_core:
        monkeypatch.setattr(Globalised, "_by_core", lambda *_, **__: None)
    prepared = Prepared(model_of(EVERYTHING["following"](), 1, 3))
    inputs = Inputs(prepared.equations)
    row = inputs.of(prepared.model.loading(1.0))
    found = Globalised(inputs, prepared.weight, Rules())(row)
    assert found.code is Code.SOLVED
    # No solution of a linear system is good enough.
    strict = Globalised(inputs, prepared.weight, replace(Rules(), left=-1.0))
    again = strict(row, found.state, warm=True)
    assert (again.code, again.iterations) == (Code.SOLVED, 1)
    np.testing.assert_array_equal(again.state, found.state)
    assert strict(row, found.state + 1e-6, warm=True).code is not Code.SOLVED
