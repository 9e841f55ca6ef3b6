"""The whole way from a scene to a certified answer of the accuracy asked for."""

import json

import numpy as np
import pytest
from scenes import SOFT, UNLIKE, ZOO, arch, bend_45, cantilever, elastica, guided, helix, made, model_of

import sfetcas
from benchmarks.scenes import lattice, of_all_types
from sfetcas import SceneError, SolveError, Status
from sfetcas.cli import main
from sfetcas.equilibria import meshing
from sfetcas.equilibria.statics import Settings, pilot_of, solve, solve_model
from sfetcas.mechanics.fields import Fields, transferred
from sfetcas.solvers.prepared import Prepared


def together(travel, *, space=False, **analysis):
    """A straight member clamped at both ends, one of which is moved towards the other."""
    table = cantilever()
    del table["loads"]
    table["nodes"]["B"]["support"] = "clamped"
    table["motions"] = {"shorten": {"node": "B", "displacement": [-travel, 0]}}
    if space:
        table["dimension"] = "space"
        table["sections"]["s"] = {**UNLIKE}
    return table | {"analysis": analysis}


def clamped_elastica(travel):
    """(height of the middle, force) of a clamped-clamped elastica with ends moved together: quarter waves."""
    x, w = np.polynomial.legendre.leggauss(80)
    phi, w = 0.25 * np.pi * (x + 1), 0.25 * np.pi * w

    def integrals(k):
        root = np.sqrt(1 - (k * np.sin(phi)) ** 2)
        return (w / root).sum(), (w * root).sum()

    low, high = 1e-6, 1 - 1e-9
    for _ in range(200):
        k = 0.5 * (low + high)
        first, second = integrals(k)
        low, high = (k, high) if 2 - 2 * second / first < travel else (low, k)
    # A quarter of the length is K / sqrt(P); its rise is 2 k / sqrt(P) in two quarters.
    return k / first, (4 * first) ** 2


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_ends_moved_together_by_half(space):
    """From the straight member, whose closing has no slack to first order; by the scene alone."""
    step = solve(made(together(0.5, space=space, accuracy=1e-7))).last
    height, force = clamped_elastica(0.5)
    middle = step.along("m", 0.5)["position"][0]
    assert np.hypot(*middle[1:]) == pytest.approx(height, abs=1e-7)
    ei = min(SOFT["EI3"], UNLIKE["EI3"])
    np.testing.assert_allclose(step.reaction("B")[0], [-ei * force, 0, 0], atol=1e-4)
    assert step.certificate.stable is True
    assert step.certificate.residual < 1e-12


@pytest.mark.parametrize("travel", [1e-6, 1e-3, 0.1, 0.9])
def test_ends_moved_together_by_any_part(travel):
    step = solve(made(together(travel, accuracy=1e-6))).last
    height, force = clamped_elastica(travel)
    assert abs(step.along("m", 0.5)["position"][0, 1]) == pytest.approx(height, abs=1e-6)
    # By symmetry the force is that of 4 x quarter waves; near-critical for small travel.
    assert -step.reaction("B")[0][0] == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize("turns", [1, 5, 20])
def test_roll_up_is_exact(turns):
    """M = 2 pi n EI/L: the tip comes back to the root; the angle is linear, so any element is exact in it."""
    table = cantilever()
    table["loads"] = {"m": {"type": "moment", "node": "B", "value": 2 * np.pi * turns * SOFT["EI3"]}}
    table["analysis"] = {"accuracy": 1e-9}
    step = solve(made(table)).last
    np.testing.assert_allclose(step.position("B"), 0.0, atol=1e-9)
    assert step.angle("B") == pytest.approx(2 * np.pi * turns, rel=1e-12)
    assert step.energy["elastic"] == pytest.approx(0.5 * (2 * np.pi * turns) ** 2, rel=1e-12)
    np.testing.assert_allclose(step.reaction("A")[1], [0, 0, -2 * np.pi * turns], rtol=1e-10)
    x = np.linspace(0, 1, 23)
    circle = np.stack([np.sin(2 * np.pi * turns * x), 1 - np.cos(2 * np.pi * turns * x)], axis=1) / (2 * np.pi * turns)
    np.testing.assert_allclose(step.along("m", x)["position"][:, :2], circle, atol=2e-8)
    assert step.certificate.stable is True


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
@pytest.mark.parametrize("alpha", [1e-6, 1e-3, 0.1, 1.0, 10.0, 100.0, 1e4, 1e6, 1e8])
def test_cantilever_under_any_load(alpha, space):
    """One step, the branch that the growing load leads to, compared with elliptic integrals."""
    table = cantilever((0.0, alpha), dimension="space" if space else "plane", analysis={"accuracy": 1e-8})
    step = solve(made(table)).last
    tip = [1.0, alpha / 3.0] if alpha <= 1e-3 else elastica(alpha)
    # F L^2/EI = 1e-3 leaves 1e-7 of 1 - x and 1e-7 times 1e-3 of y.
    np.testing.assert_allclose(step.position("B")[:2], tip, atol=1e-8 if alpha > 1e-3 else 1e-7)
    if alpha <= 1e-3:
        assert step.position("B")[1] == pytest.approx(alpha / 3, rel=1e-6)
    assert step.certificate.stable is True
    assert step.certificate.error_estimate <= 1e-8


@pytest.mark.parametrize("load", [5.0, 50.0, 1e4])
def test_oblique_pull_and_push(load):
    """A nearly axial push of any size ends turned round, without loops: angles stay within half a turn."""
    step = solve(made(cantilever((-load, 1e-3 * load), analysis={"accuracy": 1e-6}))).last
    angles = step.along("m", np.linspace(0, 1, 41))["angle"]
    # Below the accuracy asked for, interpolation may waver.
    assert np.all(np.diff(angles) > -1e-5)
    assert 0.5 < angles[-1] < np.pi
    assert step.certificate.stable is True


SCENES = {
    **ZOO,
    "stiff": lambda: cantilever((0.0, 1e3)),
    "long way": lambda: cantilever((-30.0, 1.0)),
    "moved": lambda: together(0.3),
    "column": lambda: cantilever((-5.0, 0.0)),
    "spatial": lambda: cantilever((0.0, 40.0), dimension="space"),
}


def reference(table, step):
    """The same branch on elements of order 7 that are four times as fine: from the answer's own state."""
    mesh = step.model.mesh
    finer = sfetcas.Mesh(7, mesh.refined().refined().cuts)
    prepared = Prepared(sfetcas.assemble(step.model.scene, finer, assembly=step.model.assembly))
    from_there = transferred(step.model, step.state, prepared.model)
    found = prepared.correct(from_there, prepared.model.loading(step.factor), iterations=30)
    assert found.residual < 1e-10  # many small elements: rounding of their stiffness
    return Fields(prepared.equations, found.state, prepared.model.loading(step.factor))


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("name", SCENES)
def test_estimate_bounds_the_error_and_the_accuracy_is_reached(name, accuracy):
    table = SCENES[name]()
    solution = solve(made(table), accuracy=accuracy)
    step = solution.last
    estimate, size = step.certificate.error_estimate, step.model.scene.size
    assert solution.status is Status.SOLVED
    assert estimate <= accuracy
    fine = reference(table, step)
    x = np.linspace(0.0, 1.0, 33)
    error = max(
        np.linalg.norm(step.along(m, x)["position"] - fine.along(m, x)["position"], axis=1).max()
        for m in step.model.members
    )
    # Rounding of the fine answer itself, 1e-13 to 1e-12 with stiffness over force up to 1e3.
    assert error / size <= max(estimate, 2e-12)


@pytest.mark.parametrize("element", ["SFET2", "SFET3", "SFET5", "SFET9"])
@pytest.mark.parametrize("gauss", [False, True])
def test_element_and_number_asked_for_are_used_exactly(element, gauss):
    solution = solve(made(cantilever((0, 3.0))), element=element, elements=3, gauss=gauss)
    model = solution.last.model
    assert model.element.name == element
    assert model.element.gauss is gauss
    np.testing.assert_allclose(model.mesh.cuts["m"], [0, 1 / 3, 2 / 3, 1], atol=1e-15)
    # The estimate is that of this mesh: it contains the difference to the elastica.
    error = np.linalg.norm(solution.last.position("B")[:2] - elastica(3.0)) / solution.last.model.scene.size
    assert error <= 1.5 * solution.last.certificate.error_estimate
    assert solution.status is Status.SOLVED  # no accuracy was asked for


def test_the_finest_accuracy_accepted_is_reached():
    solution = solve(made(cantilever((0, 30.0))), accuracy=1e-14)
    assert solution.status is Status.SOLVED
    assert solution.last.certificate.error_estimate <= 1e-14


def test_accuracy_not_reached_on_a_given_mesh_is_told():
    solution = solve(made(cantilever((0, 30.0))), element="SFET2", elements=2, accuracy=1e-6)
    assert solution.status is Status.SHORT
    assert solution.last.certificate.error_estimate > 1e-6


def test_members_keep_their_own_numbers_of_elements():
    table = ZOO["four_bar"]()
    for name, count in (("left", 2), ("top", 3), ("right", 5)):
        table["members"][name] |= {"element": "SFET4", "elements": count}
    model = solve(made(table)).last.model
    assert {n: len(c) - 1 for n, c in model.mesh.cuts.items()} == {"left": 2, "top": 3, "right": 5}
    assert model.element.name == "SFET4"
    table["members"]["top"]["element"] = "SFET5"
    with pytest.raises(sfetcas.SceneError, match="one for all members"):
        solve(made(table))


def test_many_elements_are_estimated_from_half_of_them():
    solution = solve(made(cantilever((0, 10.0))), element="SFET2", elements=2050)
    error = np.linalg.norm(solution.last.position("B")[:2] - elastica(10.0)) / solution.last.model.scene.size
    assert solution.last.model.mesh.elements == 2050
    estimate = solution.last.certificate.error_estimate
    assert error <= estimate < 5 * error


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("accuracy", 0.0),
        ("accuracy", 1e-20),
        ("accuracy", 0.2),
        ("element", "SFET1"),
        ("elements", 0),
        ("assembly", "both"),
    ],
)
def test_settings_refuse_in_sentences(word, value):
    with pytest.raises(sfetcas.SceneError, match=f"{word}: found .*, accepted: "):
        Settings(**{word: value})


def test_start_chooses_among_equilibria():
    """A clamped arch, unloaded but for a trifle: its own shape, or snapped through where ``start`` says so."""
    heights = []
    for start in ([0.5, 0.4], [0.5, -0.4]):
        table = together(0.5)
        table["nodes"]["M"] = {"position": [0.5, 0], "start": [start[0] - 0.25, start[1]]}
        table["members"] = {
            "left": {"nodes": ["A", "M"], "section": "s"},
            "right": {"nodes": ["M", "B"], "section": "s"},
        }
        step = solve(made(table)).last
        heights.append(step.position("M")[1])
        assert step.certificate.stable is True
    height = clamped_elastica(0.5)[0]
    np.testing.assert_allclose(heights, [height, -height], atol=1e-4)


def test_steps_are_answers_of_their_own():
    factors = [0.1, 1.0, 10.0, 100.0, -10.0]
    solution = solve(made(cantilever((0, 1.0), analysis={"steps": factors, "accuracy": 1e-7})))
    assert [step.factor for step in solution.steps] == factors
    for step in solution.steps:
        tip = elastica(abs(step.factor)) * [1, np.sign(step.factor)]
        np.testing.assert_allclose(step.position("B")[:2], tip, atol=1e-7)
    assert solution.last is solution.steps[-1]


def test_turns_are_counted_along_steps_in_any_order():
    table = cantilever((0.0, 1.0))
    table["loads"] = {"m": {"type": "moment", "node": "B", "value": 2 * np.pi}}
    table["analysis"] = {"steps": [1.0, 3.0, 2.0]}
    angles = [step.angle("B") for step in solve(made(table)).steps]
    np.testing.assert_allclose(angles, 2 * np.pi * np.array([1.0, 3.0, 2.0]), rtol=1e-10)


def test_histories_replace_the_factor():
    table = cantilever((0.0, 4.0))
    table["loads"] |= {"dead": {"type": "force", "node": "B", "value": [-1.0, 0.0], "history": "always"}}
    table["histories"] = {"always": {"t": [0.0, 1.0], "value": [1.0, 1.0]}}
    table["analysis"] = {"steps": [0.0, 0.5, 1.0], "accuracy": 1e-8}
    solution = solve(made(table))
    np.testing.assert_allclose(solution.steps[0].position("B"), [1, 0, 0], atol=1e-8)  # below Euler's load
    for step, force in zip(solution.steps[1:], (2.0, 4.0), strict=True):
        plain = solve(made(cantilever((-1.0, force), analysis={"accuracy": 1e-8}))).last
        np.testing.assert_allclose(step.position("B"), plain.position("B"), atol=3e-8)


@pytest.mark.parametrize("space", [False, True])
def test_ends_farther_apart_than_the_member_is_long(space):
    with pytest.raises(SolveError) as caught:
        solve(made(together(-0.1, space=space)))
    assert caught.value.status is Status.INFEASIBLE
    assert "no shape of the members" in str(caught.value)


def test_fully_stretched_member_is_refused():
    """An arch pulled to exactly its length: no finite reaction holds an inextensible member straight."""
    table = arch()
    line = made(table).center_lines["m"].length
    chord = np.array([1.0, 0.2])
    table["motions"] = {"pull": {"node": "B", "displacement": ((line / np.linalg.norm(chord) - 1) * chord).tolist()}}
    with pytest.raises(SolveError, match=r"motions\.pull asks for more than there is in closing of m, x"):
        solve(made(table))


def test_straight_member_between_balls_under_a_load_across_is_refused():
    table = cantilever()
    table["nodes"]["A"]["support"] = table["nodes"]["B"]["support"] = "ball"
    table["loads"] = {"q": {"type": "distributed", "member": "m", "value": [0, -1.0]}}
    with pytest.raises(SolveError, match="stretched"):
        solve(made(table))


def test_a_solve_that_fails_returns_no_numbers(monkeypatch):
    """Whatever IPOPT claims, an answer without balance is an error."""

    def lying(self, loading, state):
        found = self.correct(state, loading, iterations=0)
        raise SolveError(Status.ITERATIONS, "IPOPT: pretended", found.state)

    monkeypatch.setattr(Prepared, "minimise", lying)
    with pytest.raises(SolveError, match="pretended"):
        solve_model(model_of(cantilever((0, 10.0))))


def test_every_answer_has_a_certificate():
    for table in ZOO.values():
        step = solve(made(table())).last
        certificate = step.certificate
        assert certificate.residual < 1e-12
        assert certificate.stable is True
        assert certificate.negative == 0
        assert certificate.smallest > 0
        assert 0 <= certificate.error_estimate <= 1e-4
        shapes = [np.abs(shape).max() for shape in certificate.escape.values()]
        assert max(shapes) == pytest.approx(1.0, abs=1e-12)


def test_prepared_model_solves_again_and_warm():
    prepared = Prepared(model_of(bend_45(), 4, 5))
    first = solve_model(prepared, 1.0)
    warm = solve_model(prepared, 1.05, start=first)
    cold = solve_model(prepared, 1.05)
    assert warm.iterations == 0
    np.testing.assert_allclose(warm.position("B"), cold.position("B"), atol=1e-11)
    again = solve_model(prepared, 1.0)
    np.testing.assert_allclose(again.position("B"), first.position("B"), atol=1e-12)


def test_pilot_is_coarser_than_the_answer():
    scene = made(cantilever((0, 1e4)))
    assert pilot_of(scene).elements <= solve(scene, accuracy=1e-9).last.model.mesh.elements


def test_redundant_supports_are_told():
    """Two parallel guides across a rigid bar of members in space leave a multiplier without meaning."""
    table = ZOO["four_bar"]()
    table["dimension"] = "space"
    table["nodes"]["C"]["axis"] = [0, 0, 1]
    table["nodes"]["D"] |= {"support": "hinge"}
    step = solve(made(table)).last
    # In the plane the same structure is determinate in the plane: positions agree.
    plane = solve(made(ZOO["four_bar"]())).last
    np.testing.assert_allclose(step.position("B"), plane.position("B"), atol=2e-4)


@pytest.mark.parametrize("factory", [guided, helix])
def test_branch_check_can_be_left_out(factory):
    table = factory()
    with_check, without = (solve(made(table), branch=b, accuracy=1e-7).last for b in (True, False))
    for node in with_check.model.nodes:
        np.testing.assert_allclose(without.position(node), with_check.position(node), atol=1e-6)


def test_energies_and_answer_as_plain_data():
    solution = solve(made(ZOO["hinged_space"]()))
    answer = solution.to_dict()
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    step = answer["steps"][0]
    assert set(step["nodes"]) == set(solution.last.model.nodes)
    assert set(step["reactions"]) == {"A", "D", "E"}
    assert answer["unknowns"] == solution.last.model.unknowns
    assert "quaternion" not in step["nodes"]["B"]  # a hinge joint has no rotation of its own
    assert step["nodes"]["C"]["quaternion"] == solution.last.quaternion("C").tolist()


def test_names_that_are_not_there():
    step = solve(made(cantilever())).last
    with pytest.raises(sfetcas.SceneError, match="found node 'tipp'"):
        step.position("tipp")
    with pytest.raises(sfetcas.SceneError, match="found member 'n'"):
        step.along("n", 0.5)


def test_checks_compare_with_the_answer():
    table = cantilever((0, 10.0), analysis={"accuracy": 1e-8, "steps": [0.5, 1.0]})
    table["expect"] = [
        {"quantity": "nodes.B.position", "value": elastica(10.0).tolist(), "tolerance": 1e-8},
        {"quantity": "nodes.B.position", "value": elastica(5.0).tolist(), "tolerance": 1e-8, "step": 0.5},
        {"quantity": "members.m.moment", "at": 0.0, "value": -10 * elastica(10.0)[0], "tolerance": 1e-6},
        {"quantity": "members.m.moment", "at": 0.0, "value": 10 * elastica(10.0)[0], "tolerance": 1e-6},
        {"quantity": "certificate.stable", "value": True},
        {"quantity": "certificate.stable", "value": "neutral"},
        {"quantity": "certificate.negative", "value": 0},
        {"quantity": "reactions.A.force", "value": [0, -10, 0], "tolerance": 1e-9},
        {"quantity": "nodes.B.position", "value": [0.445, 0.81], "tolerance": 1e-4},
    ]
    scene = made(table)
    results = sfetcas.check(scene, solve(scene))
    passed = [r.passed for r in results]
    # The moment of what is beyond on what is before at the root is that of the force at the tip: above zero.
    assert passed == [True, True, False, True, True, False, True, True, False]
    assert results[8].error == pytest.approx(0.81060902 - 0.81, abs=1e-6)
    table["expect"] = [{"quantity": "energy.elastik", "value": 1.0, "tolerance": 1.0}]
    with pytest.raises(sfetcas.SceneError, match="did you mean 'elastic'"):
        made(table)


def _strip(nodes, members, **rest):
    section = sfetcas.CrossSection(EI3=1.0)
    beams = {name: sfetcas.Member(nodes=pair, section="strip") for name, pair in members.items()}
    return sfetcas.Scene(sections={"strip": section}, nodes=nodes, members=beams, **rest)


def two_bars(rise, *, length=1.0, force=1.0, turned=0.0, kinds=("rigid", "rigid")):
    """Two bars between hinges, loaded across where they meet, the joint by ``rise`` off their line."""
    x, y = np.array([np.cos(turned), np.sin(turned)]), np.array([-np.sin(turned), np.cos(turned)])
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": (x + rise * y).tolist(), "joint": "hinge"},
            "C": {"position": ((1.0 + length) * x).tolist(), "support": "hinge"},
        },
        "members": {
            "a": {"nodes": ["A", "B"], "type": kinds[0], "section": "s"},
            "b": {"nodes": ["B", "C"], "type": kinds[1], "section": "s"},
        },
        "loads": {"F": {"type": "force", "node": "B", "value": (force * y).tolist()}},
    }


@pytest.mark.parametrize("force", [1e-5, 1.0, 100.0])
@pytest.mark.parametrize(("length", "turned"), [(1.0, 0.7), (0.5, 0.0)])
@pytest.mark.parametrize("kinds", [("rigid", "rigid"), ("rigid", "flexible"), ("flexible", "flexible")])
def test_no_finite_force_holds_two_straight_bars(kinds, length, turned, force):
    """Newton's method halves their rise and doubles their forces until rounding stops it: that is no equilibrium."""
    with pytest.raises(SolveError, match=r"no finite force holds .*fully stretched between held points"):
        solve(made(two_bars(0.0, length=length, force=force, turned=turned, kinds=kinds)))


@pytest.mark.parametrize("rise", [1e-2, 1e-4, 1e-5])
def test_two_bars_that_are_nearly_straight_are_held_by_large_forces(rise):
    force = solve(made(two_bars(rise))).last.reaction("A")[0]
    # Rounding of the closings, the spacing of numbers of the size of one, moves the joint by that over its rise.
    rounding = np.finfo(float).eps / rise**2
    np.testing.assert_allclose(force, [-0.5 / rise, -0.5, 0.0], rtol=rounding + 1e-12, atol=1e-9)


def test_slider_across_a_straight_member_is_refused():
    nodes = {
        "a": sfetcas.Node(position=[0, 0], support="clamped"),
        "b": sfetcas.Node(position=[1, 0], support="slider", direction=[0, 1]),
    }
    force = sfetcas.Load(type="force", node="b", value=[0, -1])
    with pytest.raises(SolveError, match=r"no finite force holds the members .fully stretched"):
        solve(_strip(nodes, {"beam": ["a", "b"]}, loads={"f": force}))


@pytest.mark.parametrize("force", [1.0, -1.0, 5.0])
def test_a_chain_pushed_together_buckles_to_the_side_of_its_load(force):
    nodes = {
        "a": sfetcas.Node(position=[0, 0], support="hinge"),
        "c": sfetcas.Node(position=[1, 0]),
        "b": sfetcas.Node(position=[2, 0], support="hinge"),
    }
    load = sfetcas.Load(type="force", node="c", value=[0, force])
    push = sfetcas.Motion(node="b", displacement=[-0.4, 0])
    scene = _strip(nodes, {"first": ["a", "c"], "second": ["c", "b"]}, loads={"f": load}, motions={"m": push})
    step = solve(scene).last
    assert step.certificate.stable is True
    # Half a metre of deflection at 20 % of shortening: anything near the axis or below it is the other side.
    assert np.sign(force) * step.position("c")[1] > 0.4


@pytest.mark.parametrize("steps", [[0.01, 0.05, 0.1], [0.05], [1e-5]], ids=str)
def test_a_column_shortened_under_a_load_across_bends_to_its_side_at_any_step(steps):
    """Where closing takes away most of the bend of the start guess, that had short waves to the other side."""
    scene = sfetcas.Scene.from_dict(
        {
            "sections": {"strip": {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "hinge"},
                "B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
            },
            "members": {"strip": {"nodes": ["A", "B"], "section": "strip"}},
            "motions": {"shorter": {"node": "B", "displacement": [-0.12, 0]}},
            "loads": {"up": {"type": "force", "member": "strip", "at": 0.4, "value": [0, 1]}},
            "analysis": {"steps": steps},
        }
    )
    for up in (1.0, -1.0):
        load = scene.loads["up"].model_copy(update={"value": (0.0, up, 0.0)})
        for step in solve(scene.model_copy(update={"loads": {"up": load}})).steps:
            assert np.sign(step.along("strip", [0.5])["position"][0, 1]) == up
            # The load takes a part of the push that bends to its side.
            assert step.reaction("A")[0][0] < np.pi**2 * (1.0 + 0.12 * step.factor)


def test_a_stiff_tip_turns_with_the_soft_root_it_stands_on():
    nodes = {
        "a": sfetcas.Node(position=[0, 0], support="clamped"),
        "b": sfetcas.Node(position=[1, 0]),
        "c": sfetcas.Node(position=[2, 0]),
    }
    load = sfetcas.Load(type="force", node="c", value=[0, -1])
    scene = _strip(nodes, {"root": ["a", "b"], "tip": ["b", "c"]}, loads={"f": load})
    angles = []
    for stiffness in (1e6, 1e10):
        stiff = {**scene.members, "tip": sfetcas.Member(nodes=["b", "c"], section="stiff")}
        sections = {**scene.sections, "stiff": sfetcas.CrossSection(EI3=stiffness)}
        angles.append(solve(scene.replace(members=stiff, sections=sections), accuracy=1e-8).last.angle("b"))
    # The tip bends by about F L^2 / (2 EI) = 5e-7 rad in the softer case.
    assert angles[0] == pytest.approx(angles[1], abs=1e-6)
    assert angles[0] < -0.5


def test_an_arc_turned_far_at_its_clamp_is_found_on_a_finer_pilot():
    nodes = {
        "a": sfetcas.Node(position=[0, 0], support="clamped"),
        "b": sfetcas.Node(position=[0.8, 0], support="clamped"),
    }
    arc = sfetcas.Member(nodes=["a", "b"], section="strip", shape=sfetcas.Arc(angle=1.0))
    turn = sfetcas.Motion(node="a", rotation=3.0)
    scene = _strip(nodes, {"beam": ["a", "b"]}, motions={"m": turn}).replace(members={"beam": arc})
    step = solve(scene).last
    assert step.certificate.stable is True
    # The same on a prescribed fine mesh; the tension is -1729 N, and both estimates are below 1e-4 of the size.
    fine = solve(scene, elements=32).last
    np.testing.assert_allclose(step.along("beam", [0.5])["position"], fine.along("beam", [0.5])["position"], atol=1e-4)


def test_without_flexible_members_nothing_is_assembled_twice(monkeypatch):
    """Their meshes cannot be refined: the answer is on the pilot, and its error is zero."""
    assembled, assemble = [], meshing.assemble
    monkeypatch.setattr(meshing, "assemble", lambda *args, **options: assembled.append(1) or assemble(*args, **options))
    assert solve(lattice(12)).last.certificate.error_estimate == 0.0
    assert len(assembled) == 1
    assert solve(of_all_types(12)).last.certificate.error_estimate > 0.0
    assert len(assembled) == 3


def test_failing_step_is_named_and_the_steps_before_it_are_kept(tmp_path, capsys):
    """A guide that pulls the tip farther than the beam is long: the first two steps are solved."""
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0.5, 0.5], "support": "slider", "direction": [1, 0]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "motions": {"pull": {"node": "B", "displacement": [0.4, 0]}},
        "analysis": {"steps": [-0.5, -0.25, 1.0], "accuracy": 1e-5},
    }
    with pytest.raises(sfetcas.SolveError, match=r"at factor 1:? .*2 steps before it solved") as caught:
        sfetcas.solve(made(table))
    reached = caught.value.reached
    assert [step.factor for step in reached.steps] == [-0.5, -0.25]
    # What a motion prescribes holds to rounding.
    assert reached.last.position("B")[0] == pytest.approx(0.4, abs=1e-12)
    file, answer = tmp_path / "scene.json", tmp_path / "answer.json"
    file.write_text(json.dumps(table))
    assert main(["run", str(file), "--json", str(answer)]) == 3
    told = json.loads(answer.read_text())
    assert told["status"] == reached.status.value != "solved"
    assert told["failure"].startswith("at factor 1")
    assert len(told["steps"]) == 2
    assert "no solution" in capsys.readouterr().err


def test_taut_member_that_joints_would_bend_is_named():
    """A straight shaft between universal joints that cannot come closer: it would have to bend."""
    bend = [0.242535625, -0.9701425, 0]
    table = {
        "sections": {"s": {"EI2": 13.0, "EI3": 13.0, "GJ": 10.0}},
        "nodes": {
            "in": {"position": [0, 0, 0], "support": "hinge", "axis": [1, 0, 0]},
            "u1": {"position": [0.1, 0, 0], "joint": "universal", "axis": [0, 0, 1], "axis2": [0, 1, 0]},
            "u2": {"position": [0.3, 0.05, 0], "joint": "universal", "axis": [0, 0, 1], "axis2": bend},
            "out": {"position": [0.4, 0.05, 0], "support": "hinge", "axis": [1, 0, 0]},
        },
        "members": {
            "a": {"nodes": ["in", "u1"], "type": "rigid"},
            "b": {"nodes": ["u1", "u2"], "section": "s"},
            "c": {"nodes": ["u2", "out"], "type": "rigid"},
        },
        "springs": {"load": {"node": "out", "stiffness": 5.0}},
        "motions": {"drive": {"node": "in", "rotation": 0.3}},
    }
    with pytest.raises(sfetcas.SolveError, match=r"inextensible member .*closing of b, x"):
        sfetcas.solve(made(table))


@pytest.mark.parametrize("factor", [0.3, 1.0, 3.0])
def test_straight_bars_held_twice_share_forces_as_if_they_stretched_alike_and_stay_where_they_are(factor):
    """A node on three bars from the ground: of their forces one combination is free, which nothing applies."""
    places = {"A": [0.0, 0.0], "B": [0.2, 0.0], "D": [0.1, 0.0]}
    scene = {
        "sections": {"s": {"EI3": 0.01}},
        "nodes": {name: {"position": place, "support": "hinge"} for name, place in places.items()}
        | {"C": {"position": [0.1, 0.1]}},
        "members": {name: {"nodes": [name, "C"], "section": "s"} for name in places},
        "loads": {"f": {"type": "force", "node": "C", "value": [0.3 * factor, -factor]}},
    }
    step = solve(made(scene)).last
    ways = np.array([np.subtract([0.1, 0.1], place) for place in places.values()])
    lengths = np.linalg.norm(ways, axis=1)
    ways /= lengths[:, None]
    # By hand in bars of one EA; multipliers of straight members are balanced to rounding.
    moved = np.linalg.solve((ways.T / lengths) @ ways, [-0.3 * factor, factor])
    for name, force in zip(places, ways * (ways @ moved / lengths)[:, None], strict=True):
        np.testing.assert_allclose(step.reaction(name)[0][:2], force, atol=1e-9 * factor)
    # Hinged bars buckle at 4.9 N and more: none is near, and nothing is left.
    assert step.certificate.stable is True
    assert len(step.notes) == 1
    assert "members that stretch alike (equal EA); what is stable, and critical loads, depend on it" in step.notes[0]
    np.testing.assert_allclose(step.position("C"), [0.1, 0.1, 0.0], atol=1e-12)


def root(function, low, high):
    """Where a rising function vanishes."""
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return low


def test_cable_hangs_as_a_catenary_and_says_that_it_was_not_followed():
    """From an arch turned over it cannot be followed: EI is 1e-12 of its weight times the span cubed."""
    half = 0.5 * 1.001
    angle = root(lambda a: a / (2.0 * np.sin(a / 2.0)) - 1.001, 1e-3, 1.0)
    table = {
        "gravity": [0, -9.81],
        "sections": {"s": {"EI3": 1e-11, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "support": "hinge"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -angle}}},
    }
    step = solve(made(table)).last
    reach = root(lambda c: half - c * np.sinh(0.5 / c), 0.1, 100.0)
    sag = reach * (np.cosh(0.5 / reach) - 1.0)
    # Bending counts over sqrt(EI / H) = 1e-6 of the span at both ends.
    assert step.along("m", 0.5)["position"][0, 1] == pytest.approx(-sag, rel=1e-5)
    assert any("could not be followed from zero" in note for note in step.notes)


@pytest.mark.parametrize("load", [1e-3, 3.0])
@pytest.mark.parametrize("count", [3, 5])
def test_lattice_of_straight_bars_shares_forces_as_if_they_stretched_alike(count, load):
    """Straight bars carry axial forces only: of all that balance at the nodes those of bars with one EA."""
    grid = [(i, j) for i in range(count) for j in range(count)]
    name = {place: "n{}{}".format(*place) for place in grid}
    pairs = [
        ((i, j), (i + di, j + dj)) for i, j in grid for di, dj in ((1, 0), (0, 1), (1, 1)) if (i + di, j + dj) in name
    ]
    nodes = {name[p]: {"position": [0.1 * p[0], 0.1 * p[1]]} for p in grid}
    held = [name[i, 0] for i in range(count)]
    for node in held:
        nodes[node]["support"] = "hinge"
    corner = name[count - 1, count - 1]
    table = {
        "sections": {"s": {"EI3": 0.01}},
        "nodes": nodes,
        "members": {name[a] + name[b]: {"nodes": [name[a], name[b]], "section": "s"} for a, b in pairs},
        "loads": {"F": {"type": "force", "node": corner, "value": [load, -load]}},
    }
    step = solve(made(table)).last
    assert step.certificate.stable is True
    assert "members that stretch alike" in step.notes[0]
    # Each column: what a tension of one in a bar does to the nodes.
    number = {name[p]: k for k, p in enumerate(grid)}
    pulls = np.zeros((2 * len(grid), len(pairs)))
    for k, (a, b) in enumerate(pairs):
        way = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        pulls[2 * number[name[a]] : 2 * number[name[a]] + 2, k] = way
        pulls[2 * number[name[b]] : 2 * number[name[b]] + 2, k] = -way
    ground = np.concatenate([[2 * number[node], 2 * number[node] + 1] for node in held])
    free = np.setdiff1d(np.arange(len(pulls)), ground)
    applied = np.zeros(len(pulls))
    applied[2 * number[corner] : 2 * number[corner] + 2] = [load, -load]
    lengths = np.array([np.linalg.norm(np.subtract(b, a)) for a, b in pairs])
    moved = np.linalg.solve((pulls[free] / lengths) @ pulls[free].T, -applied[free])
    least = pulls[free].T @ moved / lengths
    found = np.concatenate([step.reaction(node)[0][:2] for node in held])
    np.testing.assert_allclose(found, -pulls[ground] @ least, atol=1e-7 * load)  # rounding of the multipliers


@pytest.mark.parametrize("at", [1.5, [0.5, -1e-3], np.nan, []])
def test_a_place_beyond_the_ends_of_a_member_is_refused(at):
    step = solve(made(cantilever())).last
    with pytest.raises(SceneError, match="accepted: fractions of the length, from 0 to 1"):
        step.along("m", at)


def test_a_name_where_the_scene_has_none_is_refused_in_a_whole_sentence():
    step = solve(made(cantilever())).last
    with pytest.raises(SceneError, match="found spring 'x'; the scene has no spring"):
        step.spring("x")


@pytest.mark.parametrize("stiffness", [0.3315, 0.05, 0.7])
def test_what_next_to_nothing_resists_turns_to_the_nearest_side(stiffness):
    """A bar on a weak spring goes where the force draws it, not whole turns on, where the spring would hold it too."""
    force = np.array([8.7818, 12.8141])
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"b": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"type": "rotational", "node": "A", "stiffness": stiffness}},
        "loads": {"f": {"type": "force", "node": "B", "value": force.tolist()}},
    }
    low, high = 0.0, 0.5 * np.pi
    for _ in range(60):
        middle = 0.5 * (low + high)
        moment = force[1] * np.cos(middle) - force[0] * np.sin(middle) - stiffness * middle
        low, high = (middle, high) if moment > 0.0 else (low, middle)
    assert solve(made(table)).last.angle("A") == pytest.approx(low, abs=1e-9)
