"""Stability against Euler's columns, closed forms and a second route."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import SOFT, ZOO, cantilever, made, model_of
from systems import EVERY, SYSTEMS

import sfetcas
from benchmarks.scenes import large
from sfetcas import tolerances
from sfetcas.equilibria.statics import pilot_of, solve_model
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.model import assemble
from sfetcas.solvers import redundancy
from sfetcas.solvers import stability as stability_module
from sfetcas.solvers.continuation import between
from sfetcas.solvers.prepared import Prepared, Solved
from sfetcas.solvers.stability import StabilityTest

EI = SOFT["EI3"]


def column(support_a="clamped", slider="ball", load=1.0, space=False, guided=True, gj=0.8):
    table = cantilever((-load, 0.0))
    table["sections"]["s"] = {**SOFT, "GJ": gj}
    table["nodes"]["A"]["support"] = support_a
    if guided:
        table["nodes"]["B"] |= {"support": "slider", "direction": [1, 0], "rotation": slider}
    table["dimension"] = "space" if space else "plane"
    return table


CRITICAL = {
    "clamped-free": (column(guided=False), np.pi**2 / 4),
    "pinned-pinned": (column("hinge"), np.pi**2),
    "clamped-clamped": (column(slider="fixed"), 4 * np.pi**2),
    # tan(x) = x, first root
    "clamped-pinned": (column(slider="ball"), 4.493409457909064**2),
}


def straight(table, load, elements=4, order=6):
    """The stability of the straight column under a load, without asking whether it is a minimum."""
    prepared = Prepared(model_of(table, elements, order))
    loading = prepared.model.loading(load)
    found = prepared.correct(prepared.equations.start(loading), loading)
    assert found.converged
    return found.stability, prepared


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("share", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("name", CRITICAL)
def test_neutral_is_what_the_test_calls_so(name, share, many, monkeypatch):
    """Also of models whose eigenvalues are counted by factors."""
    table, critical = CRITICAL[name]
    if many:
        monkeypatch.setattr(stability_module, "DENSE", 0)
        monkeypatch.setattr(stability_module, "MANY_ROWS", -1)
    prepared = Prepared(model_of(table, 8, 6))
    loading = prepared.model.loading(share * critical)
    found = prepared.correct(prepared.equations.start(loading), loading)
    assert found.neutral is (share == 1.0)
    assert (found.stability.stable == "neutral") is (share == 1.0)


@pytest.mark.parametrize("name", CRITICAL)
def test_smallest_eigenvalue_changes_sign_at_the_critical_load(name):
    table, critical = CRITICAL[name]
    below, prepared = straight(table, critical * (1 - 1e-6))
    above, _ = straight(table, critical * (1 + 1e-6))
    assert below.smallest > 0.0 > above.smallest
    assert (below.stable, below.negative) == (True, 0)
    assert (above.stable, above.negative) == (False, 1)
    # EI phi'^2 - P phi^2 over phi^2: the eigenvalue falls linearly with the load while the mode stays.
    unit = prepared.model.scales.force
    for share in (0.0, 0.5, 2.0):
        assert straight(table, share * critical)[0].smallest * unit == pytest.approx((1 - share) * critical, rel=1e-7)


def test_pinned_pinned_counts_its_modes():
    for load, count in ((0.9, 0), (3.0, 1), (5.0, 2), (10.0, 3)):
        assert straight(column("hinge"), load * np.pi**2)[0].negative == count


def test_unloaded_cantilever_has_the_eigenvalue_of_a_quarter_wave():
    """pi^2/4 EI/L^2 in N, in other units of length and force too."""
    for length, ei in ((1.0, 1.0), (25.0, 3e4)):
        table = cantilever((1e-9, 0.0))
        table["nodes"]["B"]["position"] = [length, 0]
        table["sections"]["s"] = {"EI3": ei}
        table["loads"]["tip"]["value"] = [ei / length**2 * 1e-12, 0.0]
        step = solve_model(model_of(table, 4, 6))
        assert step.certificate.smallest == pytest.approx(np.pi**2 / 4 * ei / length**2, rel=1e-8)
        assert step.certificate.stable is True


@pytest.mark.parametrize("name", ["clamped-free", "pinned-pinned", "clamped-clamped"])
def test_unstable_mode_is_the_mode(name):
    table, critical = CRITICAL[name]
    result, prepared = straight(table, 1.2 * critical)
    s = prepared.model.along("m")
    free = prepared.equations.number[prepared.model.chain("m"), 0]
    shape = np.where(free >= 0, result.shape[free], 0.0)
    mode = {"clamped-free": np.sin(0.5 * np.pi * s), "pinned-pinned": np.cos(np.pi * s)}.get(
        name, np.sin(2 * np.pi * s)
    )
    assert np.abs(shape).max() == pytest.approx(1.0)
    sign = np.sign(shape @ mode)
    # The peak of the mode need not be at a node: the scale is off by a per mille at most.
    scale = np.abs(mode).max()
    np.testing.assert_allclose(sign * shape, mode / scale, atol=1e-6)


def test_unstable_mode_by_name_in_the_certificate():
    step = sfetcas.solve(made(column(guided=False, load=5.0) | {"analysis": {"unstable": "stay"}})).last
    shape = step.certificate.escape["m"]
    s = step.model.along("m")
    assert len(shape) == len(s)
    np.testing.assert_allclose(np.abs(np.ravel(shape)), np.sin(0.5 * np.pi * s), atol=1e-4)


def test_column_beyond_euler_is_left_or_kept():
    table = column(guided=False, load=2 * np.pi**2 / 4)
    left = sfetcas.solve(made(table)).last
    assert left.certificate.stable is True
    assert any("left an unstable equilibrium" in note for note in left.notes)
    assert abs(left.position("B")[1]) > 0.5
    kept = sfetcas.solve(made(table | {"analysis": {"unstable": "stay"}})).last
    assert (kept.certificate.stable, kept.certificate.negative) == (False, 1)
    np.testing.assert_allclose(kept.position("B"), [1, 0, 0], atol=1e-12)
    assert left.energy["total"] < kept.energy["total"]
    # The buckled elastica: sqrt(P) = K(sin(a/2)); its tip by quadrature.
    a = left.angle("B")
    k = np.sin(0.5 * abs(a))
    phi, w = np.polynomial.legendre.leggauss(60)
    phi, w = 0.25 * np.pi * (phi + 1), 0.25 * np.pi * w
    assert (w / np.sqrt(1 - k**2 * np.sin(phi) ** 2)).sum() == pytest.approx(np.sqrt(2 * np.pi**2 / 4), rel=1e-4)


def test_isotropic_column_in_space_is_neutral_once_buckled():
    step = sfetcas.solve(made(column(guided=False, load=2 * np.pi**2 / 4, space=True))).last
    assert step.certificate.stable == "neutral"
    assert step.certificate.negative == 0
    # It may buckle to any side: neutral is the turn about the column's axis.
    assert np.hypot(*step.position("B")[1:]) > 0.5
    unlike = column(guided=False, load=2 * np.pi**2 / 4, space=True)
    unlike["sections"]["s"] = {**SOFT, "EI2": 1.7}
    assert sfetcas.solve(made(unlike)).last.certificate.stable is True


def test_beam_on_two_balls_spins_about_its_axis():
    table = column("ball", load=0.5 * np.pi**2, space=True)
    step = sfetcas.solve(made(table)).last
    assert step.certificate.stable == "neutral"
    table["nodes"]["A"]["support"] = "clamped"
    assert sfetcas.solve(made(table)).last.certificate.stable is True


def test_straight_column_in_space_buckles_about_both_axes():
    assert straight(column(guided=False, space=True), 5.0)[0].negative == 2
    assert straight(column(guided=False, space=True), 2.0)[0].negative == 0


@pytest.mark.parametrize("name", [*EVERY, "pinned", "fixed"])
@pytest.mark.parametrize("assembly", ["closing", "nodal"])
def test_sparse_count_is_the_dense_count(name, assembly, monkeypatch):
    """LDL^T and Schur complement against all eigenvalues on the null space, also far from stable."""
    table = {"pinned": column("hinge"), "fixed": column(slider="fixed")}.get(name) or EVERY[name]()
    factor = 90.0 if name in ("pinned", "fixed") else 1.0
    prepared = Prepared(model_of(table, 2, 4, assembly=assembly))
    loading = prepared.model.loading(factor)
    start = prepared.equations.start(loading)
    state = prepared.correct(start, loading).state if factor > 1 else solve_model(prepared).state
    points = [prepared.equations.at(state, loading)]
    if factor == 1.0:
        # The same state under a load turned round: no equilibrium, and for some scenes not convex.
        points.append(prepared.equations.at(state, loading.scaled(-6.0)))
    for point in points:
        monkeypatch.setattr(stability_module, "DENSE", 10_000)
        monkeypatch.setattr(stability_module, "DENSE_WITH_TRAVEL", 10_000)
        dense = prepared._test.test(point)
        monkeypatch.setattr(stability_module, "DENSE", 0)
        monkeypatch.setattr(stability_module, "DENSE_WITH_TRAVEL", 0)
        sparse = prepared._test.test(point)
        assert (sparse.stable, sparse.negative) == (dense.stable, dense.negative)
        # Inverse iteration stops when a step gains 1e-8; what is left where it converges slowly is a thousand steps.
        assert sparse.smallest == pytest.approx(dense.smallest, rel=1e-5, abs=1e-7)
        assert min(np.abs(sparse.shape - sign * dense.shape).max() for sign in (1, -1)) < 1e-3
    if factor > 1.0:
        assert dense.negative >= 2


@pytest.mark.parametrize("name", EVERY)
def test_count_is_that_of_the_bordered_matrix(name):
    """Inertia of [[H, A^T], [A, 0]] has one negative value a row more: another way to count."""
    prepared = Prepared(model_of(EVERY[name](), 2, 4, assembly="nodal"))
    state, equations = solve_model(prepared).state, prepared.equations
    for factor in (1.0, -8.0):
        point = equations.at(state, prepared.model.loading(1.0).scaled(factor))
        matrix = np.zeros((equations.total, equations.total))
        matrix[equations.row, equations.column] = point.entries
        negative = int((np.linalg.eigvalsh(matrix) < 0).sum())
        assert prepared._test.test(point).negative == negative - equations.rows


def test_smallest_eigenvalue_does_not_depend_on_the_mesh():
    values = [solve_model(model_of(ZOO["bend_45"](), n, p)).certificate.smallest for n, p in ((4, 4), (9, 5), (5, 7))]
    # Lumped mass and order 2p: six digits on the coarsest.
    np.testing.assert_allclose(values, values[-1], rtol=1e-5)


def test_what_the_leaving_finds_has_less_energy():
    """Shallow arch pushed beyond its limit point: the other side is the answer, and it is stable."""
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "ball"}, "B": {"position": [1, 0], "support": "ball"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -0.8}}},
        "loads": {"down": {"type": "force", "member": "m", "at": 0.5, "value": [0.0, -60.0]}},
    }
    left = sfetcas.solve(made(table)).last
    assert left.certificate.stable is True
    assert left.along("m", 0.5)["position"][0, 1] < -0.05


@pytest.mark.parametrize("name", ["four_bar", "tripod", "guided"])
def test_smallest_is_the_rayleigh_quotient_of_the_unstable_mode(name):
    """Second variation by the shape over the integral of its square, members of unlike stiffness and length."""
    prepared = Prepared(model_of(ZOO[name](), 2, 4, assembly="closing"))
    equations, step = prepared.equations, solve_model(prepared)
    point = equations.at(step.state, step.loading)
    matrix = np.zeros((equations.total, equations.total))
    matrix[equations.row, equations.column] = point.entries
    n = equations.rotation_unknowns
    shape = prepared._test.test(point).shape
    quotient = shape @ matrix[:n, :n] @ shape / (shape @ (equations.mass * shape))
    assert step.certificate.smallest == pytest.approx(quotient * step.model.scales.force, rel=1e-9)
    # An admissible variation: the closings do not open to first order.
    np.testing.assert_allclose(matrix[equations.unknowns :, :n] @ shape, 0.0, atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_leaving_goes_to_the_side_of_less_energy(side):
    """A straight column with a trifle across it is left to where the trifle pulls, whatever the sign of the shape."""
    table = column(guided=False, load=5.0)
    table["loads"]["tip"]["value"] = [-5.0, 0.3 * side]
    prepared = Prepared(model_of(table, 3, 4))
    loading = prepared.model.loading(1.0)
    straight_state = prepared.equations.start(loading)
    found = Solved(prepared, straight_state, loading, prepared.equations.at(straight_state, loading), 0.0)
    nudged = prepared.nudged(found, loading, 0.2)
    assert side * nudged.q[prepared.model.chain("m")[-1], 0] > 0.1


def test_what_is_asked_of_a_solved_equilibrium_is_computed_once(monkeypatch):
    asked, test = [], StabilityTest.test
    monkeypatch.setattr(StabilityTest, "test", lambda self, point: asked.append(point) or test(self, point))
    prepared = Prepared(model_of(cantilever((0, 1.0)), 2, 4))
    found = prepared.correct(prepared.equations.start(prepared.model.loading(0.7)), prepared.model.loading(0.7))
    assert not asked
    assert found.stability is found.stability
    assert found.fields is found.fields
    assert found.factor == 0.7
    # What is changed is another equilibrium.
    assert replace(found, residual=0.0).stability.smallest == found.stability.smallest
    assert len(asked) == 2


def test_a_way_between_factors_ends_exactly_at_the_second():
    """0.03 + (0.3 - 0.03) is not 0.3, and what is solved at the end of the way is told to be that of the factor."""
    model = model_of(cantilever((0, 1.0)), 2, 4)
    assert between(model, 0.03, 0.3)(1.0).factor == 0.3
    assert between(model, 0.03, 0.3)(0.0).factor == 0.03
    both = model.loading(0.5).plus(model.loading(0.25).scaled(-2.0))
    assert both.factor == np.abs(both.force).max() == 0.0


# -- springs and bodies ---------------------------------------------------------------------------------------


def sprung(stiffness=2.0, kind="flexible", space=False):
    """A column on a hinge with a rotational spring at its foot, its top free."""
    table = column("hinge", guided=False, space=space)
    table["members"]["m"]["type"] = kind
    table["springs"] = {"foot": {"node": "A", "stiffness": stiffness}}
    return table


@pytest.mark.parametrize("space", [False, True])
def test_column_on_a_spring_buckles_at_its_critical_load(space):
    """k/(EI) = x tan(x), x^2 = P/EI (Timoshenko and Gere 1961, ch. 2); a rigid one at k/L."""
    critical = 1.15965758239507
    x = np.sqrt(critical)
    assert x * np.tan(x) == pytest.approx(2.0, abs=1e-12)
    for share, negative in ((1 - 1e-6, 0), (1 + 1e-6, 1)):
        found, _ = straight(sprung(space=space), share * critical)
        assert found.negative == negative
        assert (found.smallest > 0.0) == (negative == 0)
        assert straight(sprung(kind="rigid"), share * 2.0)[0].negative == negative


def test_small_column_on_a_spring():
    """A body linear in its frame, turned by the mean rotation: its own critical load by two unknowns, by hand.

    Foot a, top b, deflection v of the top: U = k a^2/2 + the energy of a beam without loads between, and the force
    works on the shortening that the body has: that of a rigid bar at the frame (a + b)/2, and of v against it.
    """

    frame, way = np.array([0.5, 0.5, 0.0]), np.array([0.0, 0.0, 1.0])
    bent = way - frame
    # Ends turned against the frame by -r and r with r = (b - a)/2, the top moved by v - frame.
    half = np.array([-0.5, 0.5, 0.0])
    beam = np.array([[12, -6, -6], [-6, 4, 2], [-6, 2, 4]])
    e = np.array([bent, -half, half])
    elastic = 2.0 * np.outer([1, 0, 0], [1, 0, 0]) + e.T @ beam @ e
    shortening = np.outer(frame, frame) + np.outer(frame, bent) + np.outer(bent, frame)
    loads = np.linalg.eigvals(np.linalg.solve(elastic, shortening)).real
    critical = 1.0 / loads.max()
    assert 1.15965758239507 < critical < 1.4
    for share, negative in ((1 - 1e-6, 0), (1 + 1e-6, 1)):
        assert straight(sprung(kind="small"), share * critical)[0].negative == negative


@pytest.mark.parametrize("seed", range(6))
def test_bordered_count_is_the_dense_count_on_random_frames(seed, monkeypatch):
    """Grids with many closings and loads of any sign, with springs or without, at states that need not be stable."""
    rng = np.random.default_rng(seed)
    columns, levels = int(rng.integers(2, 4)), int(rng.integers(2, 4))
    nodes, members = {}, {}
    for i in range(columns):
        for j in range(levels):
            held = {"support": "clamped"} if j == 0 else {}
            place = [float(i + 0.1 * rng.normal()), float(j + 0.1 * rng.normal())]
            nodes[f"n{i}{j}"] = {"position": place, **held}
            if j:
                members[f"c{i}{j}"] = {"nodes": [f"n{i}{j - 1}", f"n{i}{j}"], "section": "s"}
            if i and j:
                members[f"b{i}{j}"] = {"nodes": [f"n{i - 1}{j}", f"n{i}{j}"], "section": "s",
                                       "shape": {"type": "arc", "angle": 0.5}}  # fmt: skip
    top = f"n0{levels - 1}"
    table = {"sections": {"s": {**SOFT}}, "nodes": nodes, "members": members, "dimension": ("plane", "space")[seed % 2],
             "loads": {"f": {"type": "force", "node": top, "value": [float(rng.normal()), -5.0]}}}  # fmt: skip
    if seed % 3 == 0:
        table["springs"] = {"k": {"type": "translational", "node": top, "stiffness": 3.0},
                            "r": {"node": "n11", "stiffness": 2.0}}  # fmt: skip
    prepared = Prepared(model_of(table, 2, 3))
    start = prepared.equations.start(prepared.model.loading(0.0))
    step = rng.normal(size=prepared.equations.total)
    # Internal forces of a hundred times EI/L^2, with any sign.
    step[: prepared.equations.unknowns] *= 0.2
    step[prepared.equations.unknowns :] *= 100.0
    state = prepared.equations.moved(start, step)
    counts = set()
    monkeypatch.setattr(StabilityTest, "_below_dense", None)  # the bordered matrix alone is meant
    # Of what is large more softness is tried where rounding breaks the factors.
    monkeypatch.setattr(stability_module, "FULL", 0)
    for factor in (0.0, 30.0, -100.0, 200.0):
        point = prepared.equations.at(state, prepared.model.loading(factor))
        monkeypatch.setattr(stability_module, "DENSE", 10_000)
        monkeypatch.setattr(stability_module, "DENSE_WITH_TRAVEL", 10_000)
        dense = prepared._test.negative(point)
        entries = prepared._test._weighted(point)
        limit = tolerances.NEUTRAL + stability_module.ENTRIES_BLUR * float(np.abs(entries).max())
        assert prepared._test._below_bordered(point, -limit) == dense
        counts.add(dense)
    assert max(counts) > 0


@pytest.mark.parametrize("soft", stability_module.BORDER_REGULARISATIONS)
@pytest.mark.parametrize("kind", ["all types", "lattice"])
def test_bordered_count_of_nets_is_the_dense_count(kind, soft, monkeypatch):
    """With each softness, at the answer and far from it, where hundreds of eigenvalues are negative."""
    prepared = Prepared(assemble(scene := large(kind, 60), pilot_of(scene), assembly="nodal"))
    equations, loading = prepared.equations, prepared.model.loading(1.0)
    found = prepared.correct(equations.start(loading), loading, iterations=30)
    assert found.converged
    monkeypatch.setattr(stability_module, "BORDER_REGULARISATION", soft)
    monkeypatch.setattr(stability_module, "BORDER_REGULARISATIONS", (soft,))
    monkeypatch.setattr(StabilityTest, "_below_dense", None)  # the bordered matrix alone is meant
    counts = []
    for factor in (1.0, 100.0, -100.0, -1000.0):
        state = replace(found.state, lam=factor * found.state.lam)
        point = equations.at(state, loading.scaled(factor))
        values = np.linalg.eigvalsh(
            prepared._test._projected(prepared._test._weighted(point), prepared._test._rows(point))[0]
        )
        # Between eigenvalues of the size of a member's, as far from them as can be.
        gaps, middles = np.diff(values), 0.5 * (values[1:] + values[:-1])
        near = np.argsort(np.where(np.abs(middles) < 100.0, np.abs(middles) / gaps, np.inf))[:3]
        for shift in middles[near]:
            counts.append(int((values < shift).sum()))
            assert prepared._test._below_bordered(point, float(shift)) == counts[-1]
    assert max(counts) > 10


def redundant():
    """Two four-bars of parallel hinges in space, rigid but for one member."""
    hinge = {"joint": "hinge"}
    return {
        "dimension": "space",
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0, 1]} | hinge,
            "C": {"position": [1.2, 1.1]} | hinge,
            "D": {"position": [1.2, 0], "support": "hinge"},
            "E": {"position": [2.2, 1.0]} | hinge,
            "F": {"position": [2.2, 0], "support": "hinge"},
        },
        "members": {n: {"nodes": list(n), "type": "rigid"} for n in ("BC", "CD", "CE", "EF")}
        | {"AB": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"f": {"type": "force", "node": "C", "value": [1.0, -0.5]}},
    }


def test_bordered_count_with_redundant_rows():
    """Rows that depend on others count as rows all the same, at states far from stable too."""
    prepared = Prepared(model_of(redundant(), 2, 3))
    rng, counts = np.random.default_rng(5), set()
    start = prepared.equations.start(prepared.model.loading(0.0))
    for size in (0.0, 30.0, 100.0, 300.0):
        lam = size * rng.normal(size=prepared.equations.rows)
        point = prepared.equations.at(replace(start, lam=lam), prepared.model.loading(1.0))
        counts.add(count := prepared._test._below_dense(point, -1e-6))
        assert prepared._test._below_bordered(point, -1e-6) == count
    assert len(counts) > 1


@pytest.mark.parametrize("name", [*SYSTEMS, "four_bar", "hinged_space", "redundant"])
def test_loose_rows_by_inverse_iteration_are_those_of_all_singular_values(name):
    """Four-bars of parallel hinges in space have rows that depend on others: both ways find as many, and the same."""
    table = redundant() if name == "redundant" else EVERY[name]()
    equations = Equations(model_of(table, 2, 3))
    state = equations.start(equations.model.loading(0.0))
    point = equations.at(state, equations.model.loading(1.0))
    if not equations.rows:
        return
    all_squares, all_left, largest = redundancy._all_singular(redundancy._products(equations, point))
    squares, left, _ = redundancy._smallest(equations, point)
    limit = redundancy.SLACK**2 * largest
    loose, few = all_left[:, all_squares < limit], left[:, squares < limit]
    assert loose.shape == few.shape
    assert (name == "redundant") == bool(loose.shape[1])
    # The same space: projections onto it are equal, to the twelve digits by which it stands out.
    np.testing.assert_allclose(few @ few.T, loose @ loose.T, atol=1e-6)


@pytest.mark.parametrize("name", [*SYSTEMS, "four_bar", "hinged_space", "redundant"])
def test_the_core_tells_of_rows_what_is_told_without_it(name):
    """In the undeformed state, of its rows as they are and of the same with one of them nearly as another one."""
    table = redundant() if name == "redundant" else EVERY[name]()
    equations = Equations(model_of(table, 2, 3))
    if not (equations.rows and equations.by_core):
        pytest.skip("no rows, or no core here")
    nothing, usual = equations.model.loading(0.0), redundancy.usual_square(equations)
    point, rng = equations.at(equations.start(nothing), nothing), np.random.default_rng(3)
    chosen, row, _ = equations.jacobian_entries
    told = []
    for size in (1.0, 1e-1, 1e-3, 1e-6):
        entries = point.entries.copy()
        entries[chosen[row == 0]] *= size
        entries[chosen] *= rng.uniform(0.5, 2.0) if size < 1.0 else 1.0
        here = replace(point, entries=entries)
        other = redundancy._clearly_independent(redundancy._products(equations, here), usual)
        told.append(equations.clearly_independent(entries, redundancy.ROUGHLY, usual))
        assert told[-1] == other
    assert told[0] == (name != "redundant")
    assert not told[-1]


@pytest.mark.parametrize("slack", [redundancy.SLACK, redundancy.NEARLY])
@pytest.mark.parametrize("name", [*SYSTEMS, "four_bar", "hinged_space", "redundant"])
def test_one_vector_shows_whether_rows_of_large_models_are_loose(name, slack, monkeypatch):
    """Also nearly loose ones: many rows and few give as many."""
    table = redundant() if name == "redundant" else EVERY[name]()
    equations = Equations(model_of(table, 2, 3))
    point = equations.at(equations.start(equations.model.loading(0.0)), equations.model.loading(1.0))
    few = redundancy.loose_rows(equations, point, slack)
    equations.loose, sought = [], list[int]()
    whole = redundancy._smallest

    def seen(*given):
        found = whole(*given)
        sought.append(found[1].shape[1])
        return found

    monkeypatch.setattr(redundancy, "MANY", -1)
    monkeypatch.setattr(redundancy, "_smallest", seen)
    # Of few rows the core tells at once.
    monkeypatch.setattr(Equations, "clearly_independent", lambda *_: False)
    many = redundancy.loose_rows(equations, point, slack)
    assert few.shape == many.shape
    np.testing.assert_allclose(many @ many.T, few @ few.T, atol=1e-6)
    # Of what is clearly apart one vector is enough, of what is loose it is not.
    if equations.rows and slack == redundancy.SLACK:
        assert (sought == [0]) != (name == "redundant")
