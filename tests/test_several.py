"""The search for several equilibria: counts from theory, certificates, distinctness, and what is said of it."""

import functools
import itertools
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scenes import cantilever

from sfetcas import Scene, SceneError, assemble, solve, uniform_mesh
from sfetcas.checks import check
from sfetcas.cli import main
from sfetcas.equilibria.mirrors import mirrored, mirrors
from sfetcas.equilibria.scanning import scan
from sfetcas.equilibria.several import Search, search
from sfetcas.equilibria.single import cold
from sfetcas.equilibria.statics import Settings
from sfetcas.mathematics import quaternion
from sfetcas.solvers.between_states import free_parts, turned_between
from sfetcas.solvers.deflation import deflated
from sfetcas.solvers.prepared import Prepared

FIRST_LOAD = 0.25 * math.pi**2
"""Critical load of a clamped-free column of unit length and stiffness."""

INCLINED = {
    (5.0, 135): [(1.766888, 0)],
    (20.0, 135): [(-3.789483, 0), (-2.026523, 1), (2.295082, 0)],
    (30.0, 150): [(-3.621574, 0), (-2.280189, 1), (2.592324, 0)],
    (50.0, 100): [(-4.523283, 0), (-3.927696, 1), (0.003191, 2), (0.506136, 1), (1.742161, 0)],
    (50.0, 170): [(-3.308709, 0), (-2.520369, 1), (0.066620, 2), (2.110728, 1), (2.960834, 0)],
    (100.0, 90): [(-4.711512, 0), (-4.498103, 1), (0.589367, 2), (1.174645, 1), (1.570646, 0)],
    (3.0, 180): [(-1.224524, 0), (0.0, 1), (1.224524, 0)],
    (25.0, 180): [(-3.087643, 0), (-0.961451, 1), (0.0, 2), (0.961451, 1), (3.087643, 0)],
}
"""All equilibria of a cantilever under a force at an angle from its axis: tip angle and ways out.

Elliptic integrals, all roots of the end condition; ways out by Legendre-Ritz.
"""


def inclined(force, degrees, expect=(), **analysis):
    # Exactly along the axis where the angle says so: a rounded side load would choose a side.
    side = 0.0 if degrees == 180 else force * math.sin(math.radians(degrees))
    table = cantilever((force * math.cos(math.radians(degrees)), side))
    return Scene(**table | {"analysis": {"equilibria": "all", **analysis}, "expect": list(expect)})


def column(times, **changes):
    return inclined(times * FIRST_LOAD, 180, **changes)


def tips(solution):
    return sorted((step.angle("B"), step.certificate.negative) for step in solution.steps)


@pytest.mark.parametrize(("force", "degrees"), INCLINED)
def test_all_equilibria_under_an_inclined_force_and_no_other(force, degrees):
    found, known = tips(solve(inclined(force, degrees))), INCLINED[force, degrees]
    assert [negative for _, negative in found] == [negative for _, negative in known]
    # The default accuracy is 1e-4 of the positions; angles at the free end are ten times less right.
    np.testing.assert_allclose([tip for tip, _ in found], [tip for tip, _ in known], atol=1e-3)


@pytest.mark.parametrize("times", [0.5, 1.5, 26.0])
def test_column_has_a_pair_for_each_critical_load_that_it_is_beyond(times):
    found = tips(solve(column(times)))
    pairs = sum((2 * n - 1) ** 2 < times for n in range(1, 9))
    # The n-th pair leaves the straight state after n - 1 others and keeps their ways out.
    ways = [*range(pairs), pairs, *reversed(range(pairs))]
    assert sorted(negative for _, negative in found) == sorted(ways)
    straight = [negative for tip, negative in found if abs(tip) < 1e-9]
    assert straight == [pairs]
    np.testing.assert_allclose([tip for tip, _ in found], [-tip for tip, _ in reversed(found)], atol=1e-3)


def cosine_over_delta(u, g):
    """Jacobi's function cd by descending Landen transformations, of the complementary modulus g."""
    m = 1.0 - g * g
    a, c, scales, first = 1.0, math.sqrt(m), [], g
    while abs(c) > 1e-16:
        a, g, c = 0.5 * (a + g), math.sqrt(a * g), 0.5 * (a - g)
        scales.append((a, c))
    phi = 2.0 ** len(scales) * a * u
    for a_n, c_n in reversed(scales):
        phi = 0.5 * (phi + math.asin(c_n / a_n * math.sin(phi)))
    return math.cos(phi) / math.hypot(math.cos(phi), first * math.sin(phi))


def tips_by_elliptic_functions(force, degrees, samples=800):
    """Tip angles of all equilibria of a cantilever: a pendulum that begins at rest, all roots at the clamp."""

    # Against the direction of the force the clamp stands at this angle.
    clamp = math.remainder(math.pi - math.radians(degrees), 2.0 * math.pi)
    found = []
    for side in (1.0, -1.0):

        def missed(left, side=side):
            # The amplitude is what is left to half a turn: next to it the pendulum stays upright for long.
            swing = math.cos(0.5 * left) * cosine_over_delta(math.sqrt(force), math.sin(0.5 * left))
            return side * 2.0 * math.asin(swing) - clamp

        places = np.concatenate([np.geomspace(1e-9, 0.05, samples // 4), np.linspace(0.05, math.pi, samples)[1:]])
        values = np.array([missed(left) for left in places])
        for i in np.flatnonzero(values[1:] * values[:-1] < 0.0):
            low, high = places[i], places[i + 1]
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if missed(middle) * values[i] > 0.0 else (low, middle)
            found.append(side * (math.pi - 0.5 * (low + high)) - clamp)
    return sorted(found)


def scanned(scene):
    """Tip angles of what a scan finds on a mesh that is fine enough for it."""
    prepared = Prepared(assemble(scene, uniform_mesh(scene, 5, 32)))
    loading = prepared.model.loading(1.0)
    result = scan(cold(prepared, loading)[0])
    end = prepared.model.chain("m")[-1]
    return result, sorted(float(found.state.q[end, 0]) for found in result.found)


@pytest.mark.parametrize(("force", "degrees", "count"), [(150.0, 100, 7), (150.0, 150, 9)])
def test_scan_has_all_equilibria_of_the_elastica(force, degrees, count):
    known = tips_by_elliptic_functions(force, degrees)
    result, found = scanned(inclined(force, degrees))
    assert (len(known), result.roots, result.grazing) == (count, count, 0)
    np.testing.assert_allclose(found, known, atol=1e-4)


def tips_by_shooting(n, stiffness, rest, jump, span=40.0, samples=4_001, steps=200):
    """Tip angles of a beam from the moments at its clamp, by Runge-Kutta steps; the moment jumps where half is past."""
    angle, moment, h = np.zeros(samples), np.linspace(-span, span, samples), 1.0 / steps

    def rate(s, angle, moment):
        x, y = n(s)
        return rest + moment / stiffness(s), x * np.sin(angle) - y * np.cos(angle)

    for i in range(steps):
        moment = moment - (jump if 2 * i == steps else 0.0)
        a = rate(i * h, angle, moment)
        b = rate((i + 0.5) * h, angle + 0.5 * h * a[0], moment + 0.5 * h * a[1])
        c = rate((i + 0.5) * h, angle + 0.5 * h * b[0], moment + 0.5 * h * b[1])
        d = rate((i + 1) * h, angle + h * c[0], moment + h * c[1])
        angle = angle + h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        moment = moment + h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    over = moment - 1.5
    here = np.flatnonzero(over[1:] * over[:-1] < 0.0)
    share = over[here] / (over[here] - over[here + 1])
    return sorted(angle[here] + share * (angle[here + 1] - angle[here]) - rest)


def test_scan_of_a_bent_beam_with_loads_everywhere():
    """Weight, forces and moments at the tip and the middle, a stiffness that falls: against shooting from the clamp."""
    table = cantilever((-30.0, 5.0)) | {"gravity": [-20.0, 3.0], "analysis": {"equilibria": "all"}}
    table["sections"] = {"s": {"EI3": {"at": [0, 1], "value": [2.0, 0.8]}, "rhoA": 1.0}}
    name = next(iter(table["members"]))
    table["members"] = {name: {"nodes": ["A", "B"], "section": "s"}}
    table["members"][name]["shape"] = {"type": "curvature", "kappa3": [0.7], "length": 1.0, "start": [1, 0]}
    table["nodes"]["B"]["position"] = [math.sin(0.7) / 0.7, (1.0 - math.cos(0.7)) / 0.7]
    table["loads"] |= {
        "end": {"type": "moment", "node": "B", "value": 1.5},
        "middle": {"type": "moment", "member": name, "at": 0.5, "value": -2.0},
    }
    known = tips_by_shooting(
        lambda s: (-30.0 - 20.0 * (1.0 - s), 5.0 + 3.0 * (1.0 - s)), lambda s: 2.0 - 1.2 * s, 0.7, -2.0
    )
    result, found = scanned(Scene(**table))
    assert result.roots == len(known) == 3
    # Tip angles of the reference are interpolated between samples.
    np.testing.assert_allclose(found, known, atol=5e-3)


def shot(moment, force, degrees, steps=2000):
    """Tip position and end moment of a cantilever whose root moment is given, by Runge-Kutta steps."""
    fx, fy = force * math.cos(math.radians(degrees)), force * math.sin(math.radians(degrees))

    def rate(z):
        return np.array([math.cos(z[2]), math.sin(z[2]), z[3], fx * math.sin(z[2]) - fy * math.cos(z[2])])

    z, h = np.array([0.0, 0.0, 0.0, moment]), 1.0 / steps
    for _ in range(steps):
        a = rate(z)
        b = rate(z + 0.5 * h * a)
        c = rate(z + 0.5 * h * b)
        z = z + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(z + h * c))
    return z[:2], z[3]


def test_each_entry_solves_the_differential_equation_of_the_beam():
    solution = solve(inclined(20.0, 135), accuracy=1e-8)
    assert len(solution.steps) == 3
    for step in solution.steps:
        position, end_moment = shot(step.along("m", [0.0])["moment"][0, 2], 20.0, 135)
        # An error of the root grows by e^sqrt(20), about 90, on its way to the tip.
        np.testing.assert_allclose(position, step.position("B")[:2], atol=1e-6)
        assert abs(end_moment) < 1e-5
        assert step.certificate.residual < 1e-9


def test_the_default_answer_is_first_and_the_others_follow_with_rising_energy():
    several, one = solve(inclined(50.0, 100)), solve(inclined(50.0, 100, equilibria="one"))
    np.testing.assert_array_equal(several.steps[0].position("B"), one.last.position("B"))
    energies = [step.energy["total"] for step in several.steps[1:]]
    assert energies == sorted(energies)
    assert len(energies) == 4


def test_equilibria_are_distinct():
    solution = solve(column(10.0))
    places = [step.along("m", np.linspace(0.1, 1.0, 10))["position"] for step in solution.steps]
    assert len(places) == 5
    assert all(np.abs(a - b).max() > 0.1 for a, b in itertools.combinations(places, 2))


def test_equilibria_do_not_depend_on_the_mesh():
    scene = inclined(10.0, 170)
    fine = tips(solve(scene, accuracy=1e-9))
    for settings in (Settings(), Settings(element="SFET4", elements=16), Settings(element="SFET8", elements=8)):
        other = tips(solve(scene, settings))
        assert [negative for _, negative in other] == [negative for _, negative in fine]
        np.testing.assert_allclose([tip for tip, _ in other], [tip for tip, _ in fine], atol=1e-3)


def test_the_same_search_gives_the_same_answer_twice():
    first, second = (solve(inclined(20.0, 100)) for _ in range(2))
    assert [step.to_dict() for step in first.steps] == [step.to_dict() for step in second.steps]


def test_each_factor_is_searched():
    solution = solve(inclined(50.0, 170, steps=[0.02, 0.1, 1.0]))
    factors = [step.factor for step in solution.steps]
    # 1 below the first limit point; 3 at FL^2/EI = 5 and 5 at 50 by shooting from the tip.
    assert [factors.count(factor) for factor in (0.02, 0.1, 1.0)] == [1, 3, 5]
    assert factors == sorted(factors)


def test_notes_say_how_the_search_was_done_and_that_it_may_not_be_complete():
    note = solve(column(1.5), runs=100).steps[0].notes[-1]
    assert "Newton runs" in note
    assert "deflated" in note
    assert "mirrored" in note
    assert "there may be more equilibria" in note
    assert "do not balance" not in note
    assert "there are no others" in solve(column(1.5)).steps[0].notes[-1]


def test_the_scan_of_what_keeps_its_length_is_not_of_what_stretches():
    (key,) = column(1.5).sections
    note = solve(column(1.5).replace({f"sections.{key}.EA": 50.0}), runs=10).steps[0].notes[-1]
    assert "there may be more equilibria" in note


def test_ways_out_that_do_not_balance_are_told():
    # The straight column is unstable; without a run only the stable state is known, and one alone balances.
    assert "do not balance" not in solve(column(1.5), runs=0).last.notes[-1]
    scene = column(1.5, unstable="stay")
    (alone,) = solve(scene, runs=0).steps
    assert alone.certificate.negative == 1
    assert "at least one more exists" in alone.notes[-1]


def test_staying_at_an_unstable_equilibrium_has_no_meaning_beyond_the_first_entry():
    stay, leave = solve(column(2.0, unstable="stay")), solve(column(2.0))
    assert stay.steps[0].certificate.negative == 1
    assert leave.steps[0].certificate.stable is True
    assert [negative for _, negative in tips(stay)] == [negative for _, negative in tips(leave)]


# -- structures with loops, and space -------------------------------------------------------------


def right_angled_frame(force):
    ball = {"support": "ball"}
    table = {
        "sections": {"s": {"EI3": 1440.0}},
        "nodes": {
            "A": {"position": [0, 0], **ball},
            "C": {"position": [0, 120]},
            "D": {"position": [120, 120], **ball},
        },
        "members": {
            "column": {"nodes": ["A", "C"], "section": "s"},
            "beam": {"nodes": ["C", "D"], "section": "s"},
        },
        "loads": {"down": {"type": "force", "member": "beam", "at": 0.2, "value": [0, -force]}},
        "analysis": {"equilibria": "all"},
    }
    return Scene(**table)


FRAME = {
    1.5: [(8.006508, -25.829074), (51.585579, -59.866927), (85.995933, -92.012479)],
    -0.5: [(81.647761, -50.778616), (93.768954, -76.662764)],
}
"""Displacements of the loaded point by force, along the path of a collocated boundary value problem."""


@functools.cache
def frame_steps(force):
    return solve(right_angled_frame(force)).steps


@pytest.mark.parametrize("force", FRAME)
def test_equilibria_of_a_frame_beyond_limit_points(force):
    found = [step.along("beam", [0.2])["position"][0, :2] for step in frame_steps(force)]
    for u, v in FRAME[force]:
        # Twice the default accuracy, 1e-4 of the scene's size of 170: the reference is exact, the estimate is not.
        assert min(np.linalg.norm(place - (24.0 + u, 120.0 + v)) for place in found) < 0.04


def test_whole_turns_of_what_nothing_holds_are_no_further_equilibria():
    steps = frame_steps(-0.5)
    x = np.linspace(0.05, 0.95, 10)
    places = [np.vstack([step.along(name, x)["position"] for name in ("column", "beam")]) for step in steps]
    # Half a percent of the size: neighbours on a path are at least that far apart at this load.
    assert all(np.abs(a - b).max() > 0.5 for a, b in itertools.combinations(places, 2))
    assert all(abs(step.along("beam", x)["angle"]).max() < 2.0 * math.pi for step in steps)


def test_both_equilibria_of_a_deep_arch_below_its_limit_load():
    half = math.radians(107.5)
    foot = [100.0 * math.sin(half), 100.0 * math.cos(half)]
    table = {
        "sections": {"s": {"EI3": 1e6}},
        "nodes": {
            "A": {"position": [-foot[0], foot[1]], "support": "ball"},
            "B": {"position": foot, "support": "clamped"},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -2.0 * half}}},
        "loads": {"down": {"type": "force", "member": "m", "at": 0.5, "value": [0, -800.0]}},
        "analysis": {"equilibria": "all"},
    }
    found = [step.along("m", [0.5])["position"][0, :2] for step in solve(Scene(**table)).steps]
    for u, w in ((-56.349516, 94.594361), (-63.932375, 119.315902)):
        # Twice the default accuracy, 1e-4 of the scene's size of 230.
        assert min(np.linalg.norm(place - (u, 100.0 - w)) for place in found) < 0.05


def column_in_space(stiffer, times):
    table = cantilever((-times * FIRST_LOAD, 0.0), dimension="space", analysis={"equilibria": "all"})
    table["sections"]["s"] = {"EI2": stiffer, "EI3": 1.0, "GJ": 0.8}
    return Scene(**table)


def test_column_in_space_buckles_about_both_axes():
    # Critical loads 1 and 2 times the first; both pairs are plane elasticas.
    steps = solve(column_in_space(2.0, 3.0)).steps
    assert sorted(step.certificate.negative for step in steps) == [0, 0, 1, 1, 2]
    weak = [step for step in steps if step.certificate.negative == 0]
    stiff = [step for step in steps if step.certificate.negative == 1]
    assert all(abs(step.position("B")[2]) < 1e-6 < abs(step.position("B")[1]) for step in weak)
    assert all(abs(step.position("B")[1]) < 1e-6 < abs(step.position("B")[2]) for step in stiff)


def test_of_a_continuous_family_one_is_listed():
    steps = solve(column_in_space(1.0, 1.5)).steps
    assert [step.certificate.stable for step in steps] == ["neutral", False]
    assert "continuous family" in steps[0].notes[-2]
    assert not any("continuous family" in note for note in steps[1].notes)


# -- the parts of the search ----------------------------------------------------------------------


def prepared(table, factor=1.0):
    scene = Scene(**table)
    ready = Prepared(assemble(scene, uniform_mesh(scene, 4, 4)), kernels="interpreted")
    return ready, ready.model.loading(factor)


def test_deflation_keeps_newtons_method_away_from_what_is_known():
    ready, loading = prepared(cantilever((-10.0 * FIRST_LOAD, 0.0)))
    straight = ready.equations.start(loading)
    nudged = ready.equations.moved(straight, np.full(ready.equations.total, 0.02))
    plain = deflated(ready, nudged, loading, ())
    away = deflated(ready, nudged, loading, [straight])
    assert plain is not None
    assert away is not None
    assert ready.distance(plain.state, straight) < 1e-9
    assert ready.distance(away.state, straight) > 0.1
    assert away.residual < 1e-12


def test_rotations_between_states_in_space_and_plane():
    rng = np.random.default_rng(5)
    for dimension, support in (("plane", "clamped"), ("space", "clamped"), ("space", "hinge")):
        table = cantilever(dimension=dimension)
        table["nodes"]["A"] |= {"support": support, "axis": [0, 1, 1]} if support == "hinge" else {}
        table["nodes"]["B"]["support"] = "ball" if support == "hinge" else "free"
        ready, loading = prepared(table)
        equations = ready.equations
        step = np.zeros(equations.total)
        step[: equations.rotation_unknowns] = 0.3 * rng.standard_normal(equations.rotation_unknowns)
        state = equations.start(loading)
        between = turned_between(equations, equations.moved(state, step), state)
        np.testing.assert_allclose(between, step[: equations.rotation_unknowns], atol=1e-12)


def test_a_whole_turn_counts_only_where_something_holds():
    for support, turn in (("clamped", 2.0 * math.pi), ("ball", 0.0)):
        table = cantilever()
        table["nodes"]["A"]["support"] = support
        table["nodes"]["B"]["support"] = "ball" if support == "ball" else "free"
        ready, loading = prepared(table)
        state = ready.equations.start(loading)
        step = np.zeros(ready.equations.total)
        step[: ready.equations.rotation_unknowns] = 2.0 * math.pi
        between = turned_between(ready.equations, ready.equations.moved(state, step), state)
        np.testing.assert_allclose(between, turn, atol=1e-12)
        assert bool(free_parts(ready.model)) == (support == "ball")


def test_mirror_images_of_an_equilibrium_of_a_symmetric_scene_are_equilibria():
    table = cantilever((-4.0 * FIRST_LOAD, 0.0), dimension="space")
    table["sections"]["s"] = {"EI2": 2.0, "EI3": 1.0, "GJ": 0.8}
    ready, loading = prepared(table)
    start = ready.equations.start(loading)
    shapes = ready.correct(start, loading).spectrum(2)[1]
    assert len(shapes) == 2
    for shape in shapes:
        step = np.zeros(ready.equations.total)
        step[: len(shape)] = 1.5 * shape
        found = deflated(ready, ready.equations.moved(start, step), loading, [start])
        assert found is not None
        images = 0
        for mirror in mirrors(ready.model):
            # Those that keep the clamp in its place: the others turn the column over.
            if mirror.matrix[0, 0] > 0.0:
                image = mirrored(ready.model, found.state, mirror)
                point = ready.equations.at(ready.equations.holding(image, loading), loading)
                assert np.abs(point.residual).max() < 1e-9
                images += 1
        assert images == 3


@pytest.mark.parametrize(("dimension", "count"), [("plane", 3), ("space", 7)])
def test_mirrored_rotations_turn_tangents_into_mirrored_tangents(dimension, count):
    ready, loading = prepared(cantilever(dimension=dimension))
    state = ready.equations.start(loading)
    rng = np.random.default_rng(3)
    state = ready.equations.moved(state, rng.standard_normal(ready.equations.total))
    chain = ready.model.chain("m")

    def tangents(q):
        if dimension == "space":
            return quaternion.rotate(q[chain], np.array([1.0, 0.0, 0.0]))
        return np.stack([np.cos(q[chain, 0]), np.sin(q[chain, 0]), 0.0 * q[chain, 0]], axis=-1)

    for mirror in mirrors(ready.model):
        image = tangents(mirrored(ready.model, state, mirror).q)
        source = tangents(state.q) @ mirror.matrix.T
        # A line that runs against its image has the opposite tangent there.
        (_, backwards), sign = mirror.images["m"], mirror.matrix[0, 0]
        np.testing.assert_allclose(image, sign * (source[::-1] if backwards else source), atol=1e-12)
    assert len(mirrors(ready.model)) == count


def test_whole_turns_are_taken_back_where_nothing_holds():
    scene = right_angled_frame(0.5)
    ready = Prepared(assemble(scene, uniform_mesh(scene, 4, 4)), kernels="interpreted")
    loading = ready.model.loading(1.0)
    start = ready.equations.start(loading)
    wound = replace(start, q=start.q + 6.0 * math.pi)
    found = []
    for state in (start, wound):
        result = Search(ready, loading, 1, ())
        assert result.run("given", state, deflate=False)
        found.append(result.found[0].state.q)
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)


def test_mirrors_of_an_arc_and_of_a_crooked_frame():
    bow = {"type": "arc", "angle": 1.0}
    arc = cantilever()
    arc["members"]["m"]["shape"] = bow
    assert len(mirrors(prepared(arc)[0].model)) == 1
    crooked = cantilever()
    crooked["nodes"]["C"] = {"position": [1.0, 0.4]}
    crooked["members"]["n"] = {"nodes": ["B", "C"], "section": "s"}
    assert len(mirrors(prepared(crooked)[0].model)) == 0


def test_a_search_keeps_to_its_number_of_runs():
    ready, loading = prepared(cantilever((-10.0 * FIRST_LOAD, 0.0)))
    first = ready.correct(ready.equations.start(loading), loading)
    result = search(first, runs=20)
    assert result.total + result.smaller == 20
    assert result.exhausted
    assert "largest number of runs" in result.sentence()
    assert result.found[0] is first


# -- expectations, command line, input ------------------------------------------------------------


def with_expects(*expects):
    return inclined(20.0, 135, expects)


def angle(value, **more):
    return {"quantity": "nodes.B.angle", "value": value, "tolerance": 1e-3, **more}


def ways(value, **more):
    return {"quantity": "certificate.negative", "value": value, **more}


@pytest.fixture(scope="module")
def three():
    return solve(inclined(20.0, 135))


def passed(three, *expects):
    return [found.passed for found in check(with_expects(*expects), three)]


def test_numbers_of_expects_are_free(three):
    known = [tip for tip, _ in INCLINED[20.0, 135]]
    for order in itertools.permutations(known):
        assert all(passed(three, *(angle(tip, equilibrium=n) for n, tip in enumerate(order, start=1))))


def test_all_expects_of_one_number_are_about_one_entry(three):
    assert passed(three, angle(-2.026523, equilibrium=1), ways(1, equilibrium=1)) == [True, True]
    assert passed(three, angle(-2.026523, equilibrium=1), ways(0, equilibrium=1)).count(True) == 1


def test_numbers_go_to_different_entries(three):
    # Two entries have no way out: greedy choice of the first would leave the second number without its entry.
    assert all(passed(three, ways(0, equilibrium=1), angle(2.295082, equilibrium=2), ways(0, equilibrium=2)))
    assert all(passed(three, ways(0, equilibrium=1), angle(-3.789483, equilibrium=2)))
    assert passed(three, ways(1, equilibrium=1), ways(1, equilibrium=2)) == [True, False]
    assert passed(three, *(ways(0, equilibrium=n) for n in (1, 2, 3))).count(True) == 2


def test_more_numbers_than_entries_fail(three):
    exact = [{"quantity": "factor", "value": 1.0, "tolerance": 1e-12, "equilibrium": n} for n in range(1, 5)]
    assert passed(three, *exact) == [True, True, True, False]


def test_an_expect_without_number_is_about_the_default_answer(three):
    assert passed(three, angle(2.295082), angle(-3.789483)) == [True, False]
    assert passed(three, angle(2.295082, step=1.0)) == [True]


@pytest.mark.parametrize(
    ("expect", "sentence"),
    [
        (ways(0, equilibrium=0), "expect.0.equilibrium: found 0, accepted: a whole number from 1 to 100000"),
        (ways(0, equilibrium=1.5), "expect.0.equilibrium: found 1.5, accepted: a whole number from 1 to 100000"),
        (ways(0, equilibrium="a"), "expect.0.equilibrium: found 'a', accepted: "),
    ],
)
def test_numbers_of_equilibria_are_whole(expect, sentence):
    with pytest.raises(SceneError) as caught:
        with_expects(expect)
    assert str(caught.value).startswith(sentence)


def test_a_number_needs_a_search():
    table = cantilever() | {"expect": [ways(0, equilibrium=1)]}
    sentence = (
        "expect.0.equilibrium: found with analysis.equilibria = 'one', accepted: with analysis.equilibria = 'all'"
    )
    with pytest.raises(SceneError, match=f"^{re.escape(sentence)}"):
        Scene(**table)


def test_runs_are_checked():
    with pytest.raises(SceneError, match="runs: found -1, accepted: 0 to 1000000"):
        Settings(runs=-1)


def test_report_and_json_show_every_equilibrium(tmp_path, capsys):
    file = tmp_path / "column.json"
    file.write_text(json.dumps(cantilever((-1.5 * FIRST_LOAD, 0.0), analysis={"equilibria": "all"})))
    assert main(["run", str(file), "--json", str(tmp_path / "out.json")]) == 0
    report = capsys.readouterr().out
    for line in ("factor 1, equilibrium 1 of 3", "factor 1, equilibrium 3 of 3", "unstable (1 way out)"):
        assert report.count(line) == 1
    steps = json.loads((tmp_path / "out.json").read_text())["steps"]
    assert [step["factor"] for step in steps] == [1.0, 1.0, 1.0]
    assert sorted(step["certificate"]["negative"] for step in steps) == [0, 0, 1]


def test_check_prints_the_number(tmp_path, capsys):
    file = tmp_path / "column.json"
    table = cantilever((-1.5 * FIRST_LOAD, 0.0), analysis={"equilibria": "all"}, expect=[ways(1, equilibrium=4)])
    file.write_text(json.dumps(table))
    assert main(["check", str(file)]) == 0
    assert "certificate.negative equilibrium 4" in capsys.readouterr().out
