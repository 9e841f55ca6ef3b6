"""Inverse problems and design: against statics of the scene that was found, closed forms and finite differences."""

import casadi as ca
import numpy as np
import pytest

from sfetcas import (
    Analysis,
    Contact,
    CrossSection,
    Curvature,
    Design,
    Load,
    Member,
    Motion,
    Node,
    Parameter,
    Scene,
    SceneError,
    SolveError,
    Spring,
    Status,
    Table,
    changed,
    find,
    solve,
)
from sfetcas.description.shapes import end_of

CLOSE = 1e-7
"""Positions over the size: both sides are solved to 1e-8."""


def cantilever(force=(0, 1), **more):
    """1 m, 1 N m2, a force at the tip."""
    parts = {
        "sections": {"strip": CrossSection(EI3=1.0)},
        "nodes": {"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        "members": {"beam": Member(nodes=["root", "tip"], section="strip")},
        "loads": {"tip": Load(type="force", node="tip", value=force)},
        "analysis": Analysis(accuracy=1e-8),
    }
    return Scene(**{**parts, **more})


def stiffness_for(height, **more):
    """The stiffness at which the tip rises to a height."""
    design = Design(cantilever(**more), {"sections.strip.EI3": (0.1, 50.0)})
    design.subject_to(design.answer("", "nodes.tip.position")[1] == height)
    return design.solve()


# Inverse problems


def test_force_for_a_tip_position():
    answer = find(cantilever(), ["loads.tip.value"], {"nodes.tip.position": [0.6, 0.75]})
    assert solve(answer.scene()).last.position("tip")[:2] == pytest.approx([0.6, 0.75], abs=CLOSE)
    assert answer.stable
    assert answer.notes == ()
    assert answer.replayed() < CLOSE


def test_prescribed_angle_for_a_moment():
    nodes = {**cantilever().nodes, "tip": Node(position=[1, 0], support="clamped")}
    turn = {"turn": Motion(node="tip", displacement=[-0.2, 0.1], rotation=0.2)}
    held = cantilever(nodes=nodes, loads={}, motions=turn)
    design = Design(held, {"motions.turn.rotation": (-2.0, 2.0)})
    design.subject_to(design.answer("", "reactions.tip.moment")[2] == 3.0)
    assert solve(design.solve().scene()).last.reaction("tip")[1][2] == pytest.approx(3.0, abs=1e-6)


def test_spring_for_a_force():
    spring = Spring(type="translational", node="tip", anchor=[1, 1], stiffness=1.0, length=0.2)
    sprung = cantilever(springs={"pull": spring}, loads={})
    force = solve(changed(sprung, {"springs.pull.stiffness": 4.0})).last.spring("pull").to_dict()["force"]
    answer = find(sprung, {"springs.pull.stiffness": (0.1, 100.0)}, {"springs.pull.force": force})
    assert answer.values["springs.pull.stiffness"] == pytest.approx(4.0, rel=1e-6)


def test_rest_curvature_for_a_shape():
    shape = Curvature(kappa3=[0.1], length=1.0, start=[1, 0])
    nodes = {**cantilever().nodes, "tip": Node(position=end_of(shape, [0, 0, 0]).tolist())}
    bent = cantilever(nodes=nodes, members={"beam": Member(nodes=["root", "tip"], section="strip", shape=shape)})
    design = Design(bent, {"members.beam.shape.kappa3.0": (-1.0, 1.0)})
    design.subject_to(design.answer("", "nodes.tip.position")[1] == 0.0)
    answer = design.solve()
    assert solve(answer.scene()).last.position("tip")[1] == pytest.approx(0.0, abs=CLOSE)
    assert answer.values["members.beam.shape.kappa3.0"] < -0.5


def test_ends_of_shapes_take_free_nodes_along_and_no_others():
    shape = Curvature(kappa3=[0.0], length=1.0, start=[1, 0])
    members = {"beam": Member(nodes=["root", "tip"], section="strip", shape=shape)}
    there = changed(cantilever(members=members), {"members.beam.shape.kappa3": [np.pi]}).nodes["tip"].position
    # Half a circle of the length 1.
    assert there == pytest.approx([0.0, 2.0 / np.pi, 0.0], abs=1e-12)
    nodes = {**cantilever().nodes, "tip": Node(position=[1, 0], support="hinge")}
    with pytest.raises(SceneError, match="from the second node"):
        changed(cantilever(nodes=nodes, loads={}, members=members), {"members.beam.shape.kappa3": [np.pi]})


def test_large_rotations_in_space():
    rod = cantilever(
        dimension="space",
        sections={"strip": CrossSection(EI2=1.5, EI3=1.0, GJ=0.7)},
        loads={"tip": Load(type="moment", node="tip", value=[0, 0, 0.5])},
        analysis=Analysis(accuracy=1e-5),
    )
    # An arc of 5.5 rad by its energy M^2 L / 2 EI.
    answer = find(rod, {"loads.tip.value.2": (-10.0, 10.0)}, {"energy.elastic": 0.5 * 5.5**2})
    # The energy on the mesh is as far as its positions.
    assert answer.values["loads.tip.value.2"] == pytest.approx(5.5, abs=1e-4)


def test_curvature_is_that_of_statics():
    shape = Curvature(kappa3=[1.0, -0.5], kappa2=[0.3], twist=[0.4], length=1.0, start=[1, 0, 0])
    rod = cantilever(
        (0, 1, 0.5),
        sections={"strip": CrossSection(EI2=1.5, EI3=Table(at=[0, 1], value=[2.0, 1.0]), GJ=0.7)},
        nodes={**cantilever().nodes, "tip": Node(position=end_of(shape, [0, 0, 0]).tolist())},
        members={"beam": Member(nodes=["root", "tip"], section="strip", shape=shape)},
        analysis=Analysis(accuracy=1e-5),
    )
    design, at = Design(rod, {"sections.strip.EI3.value.0": (1.0, 4.0)}), (0.0, 0.3, 1.0)
    curvature = design.answer("", "members.beam.curvature", at=at)
    design.subject_to(curvature[0, 2] == 1.3)
    answer = design.solve()
    wanted = answer.cases[""].along("beam", at)["curvature"]
    # The same state on the same mesh, by Newton's method to rounding.
    assert answer.answers("", "members.beam.curvature", at) == pytest.approx(wanted, abs=1e-9)
    assert wanted[0, 2] == pytest.approx(1.3, abs=1e-9)


# Design


def test_two_cases_share_a_variable_and_a_bound_limits_it():
    cases = {"up": {"loads.tip.value": [0, 1]}, "down": {"loads.tip.value": [0, -3]}}
    design = Design(cantilever(), {"sections.strip.EI3": (0.2, 5.0)}, cases)
    moment = design.answer("down", "members.beam.moment", at=[0.0, 0.5])[:, 2]
    design.subject_to((moment <= 2.0) >= -2.0, name="moment")
    design.minimise(design.variable("sections.strip.EI3"))
    answer = design.solve()
    down = changed(cantilever(), {"sections.strip.EI3": answer.objective, "loads.tip.value": [0, -3]})
    # The more the strip bends the less moment its root takes: without the variable's bound there is no limit.
    assert answer.objective == pytest.approx(0.2, rel=1e-6)
    assert np.abs(solve(down).last.along("beam", [0.0])["moment"]).max() <= 2.0
    assert list(answer.cases) == ["up", "down"]
    assert all(case.certificate.error_estimate <= 1e-8 for case in answer.cases.values())


def test_largest_curvature_limits_how_soft_a_strip_may_be():
    design = Design(cantilever((0, 3)), {"sections.strip.EI3": (0.1, 5.0)})
    curvature = design.answer("", "members.beam.curvature")[:, 2]
    design.subject_to(curvature <= 2.0, name="curvature")
    design.minimise(design.variable("sections.strip.EI3"))
    answer = design.solve()
    along = solve(answer.scene()).last.along("beam", np.linspace(0.0, 1.0, 101))["curvature"]
    assert along.max() == pytest.approx(2.0, abs=1e-6)
    assert answer.objective > 0.2


def test_multipliers_are_what_a_bound_is_worth():
    def stiffness(bound):
        design = Design(cantilever((0, 3)), {"sections.strip.EI3": (0.1, 50.0)})
        design.subject_to(design.answer("", "nodes.tip.position")[1] <= bound, name="height")
        design.minimise(design.variable("sections.strip.EI3"))
        return design.solve()

    low, here, high = (stiffness(0.3 + step) for step in (-1e-4, 0.0, 1e-4))
    # A central difference over 1e-4 errs by its square and the third derivative, which is near 1e3.
    slope = (high.objective - low.objective) / 2e-4
    assert -here.multipliers["height"][0] == pytest.approx(slope, rel=1e-4)


def test_numbers_may_be_expressions_or_tied():
    wanted = stiffness_for(0.25).values["sections.strip.EI3"]
    section = {"strip": CrossSection(EI3=Table(at=[0, 0.5, 1], value=[1.0, 1.0, 1.0]))}
    design = Design(cantilever(sections=section))
    thickness = design.unknown("thickness", 1.0, 0.5, 2.0)
    design.set("sections.strip.EI3.value", ca.repmat(thickness**3, 3), between=(0.1, 8.0))
    design.subject_to(design.answer("", "nodes.tip.position")[1] == 0.25)
    assert design.solve().values["thickness"] ** 3 == pytest.approx(wanted, rel=1e-8)

    tied = Parameter(1.0, lambda x: {"sections.strip.EI3.value": [x, x, x]}, 0.1, 8.0)
    design = Design(cantilever(sections=section), {"even": tied})
    design.subject_to(design.answer("", "nodes.tip.position")[1] == 0.25)
    answer = design.solve()
    assert answer.values["even"] == pytest.approx(wanted, rel=1e-8)
    assert answer.scene().sections["strip"].EI3.value == pytest.approx([wanted] * 3, rel=1e-8)


def test_length_as_a_variable():
    # A long strip rises as far as a short one that is softer: by EI / L^2.
    answer = Design(cantilever(), {"nodes.tip.position.0": (0.5, 1.5)})
    answer.subject_to(answer.answer("", "nodes.tip.position")[1] / answer.variable("nodes.tip.position.0") == 0.2)
    length = answer.solve().values["nodes.tip.position.0"]
    assert 1.0 / length**2 == pytest.approx(stiffness_for(0.2).values["sections.strip.EI3"], rel=1e-7)


def test_each_case_may_have_an_input_of_its_own():
    heights = {"low": 0.1, "high": 0.4}
    design = Design(cantilever(), cases={case: {} for case in heights}, inputs={"loads.tip.value.1": (0.0, 50.0)})
    for case, height in heights.items():
        design.subject_to(design.answer(case, "nodes.tip.position")[1] == height)
    answer = design.solve()
    for case, height in heights.items():
        force = answer.values[f"{case}: loads.tip.value.1"]
        there = solve(changed(cantilever(), {"loads.tip.value.1": force})).last
        assert there.position("tip")[1] == pytest.approx(height, abs=CLOSE)


def test_meshes_are_refined_until_the_accuracy_is_reached():
    """The guess is nearly straight, the answer is not."""
    answer = find(cantilever(), ["loads.tip.value"], {"nodes.tip.position": [0.3, 0.85]})
    guess = solve(cantilever()).last
    assert answer.cases[""].model.mesh.elements > guess.model.mesh.elements // 2
    assert answer.cases[""].certificate.error_estimate <= 1e-8


# Stability


def column(margin):
    """The softest column that carries its load with a small bend, or with a margin."""
    pressed = cantilever((-2.0, 0.01), analysis=Analysis(accuracy=1e-8, unstable="stay"))
    design = Design(pressed, {"sections.strip.EI3": (0.1, 5.0)})
    design.subject_to(design.answer("", "nodes.tip.position")[1] <= 0.05)
    design.minimise(design.variable("sections.strip.EI3"))
    if margin is not None:
        design.stable(margin)
    return design.solve()


def test_margin_of_stability():
    free, kept = column(None), column(1.0)
    assert free.cases[""].certificate.smallest < 0.5
    # The eigenvalue of statics, N: IPOPT leaves 1e-8 of a bound.
    assert solve(kept.scene()).last.certificate.smallest == pytest.approx(1.0, abs=1e-6)
    # Nearly straight it is EI (pi / 2)^2 - P, here with a bend of 1 %.
    assert kept.objective == pytest.approx(3.0 * 4.0 / np.pi**2, rel=1e-3)


def test_what_is_unstable_is_said():
    answer = find(cantilever(), ["loads.tip.value"], {"nodes.tip.position": [0.98, 0.0]})
    assert not answer.stable
    assert answer.notes == ("unstable",)
    # Statics leave it.
    assert solve(answer.scene()).last.certificate.stable is True
    assert answer.replayed() > 0.1


# Bad input


def test_what_cannot_be_met_is_named_and_the_last_iterate_is_there():
    design = Design(cantilever(), {"sections.strip.EI3": (0.5, 5.0)})
    design.subject_to(design.answer("", "nodes.tip.position")[1] >= 0.9, name="too high")
    with pytest.raises(SolveError, match="most is missed at too high") as caught:
        design.solve()
    assert caught.value.status is Status.UNMET
    # As high as it gets: at the bound of the stiffness.
    assert caught.value.last.values["sections.strip.EI3"] == pytest.approx(0.5, rel=1e-3)
    assert caught.value.last.outputs["", "nodes.tip.position", None][1] < 0.9


def contradicted():
    design = Design(cantilever(), {"sections.strip.EI3": (0.5, 5.0)})
    design.subject_to(design.variable("sections.strip.EI3") == 7.0)
    return design.solve()


def contradicted_by_another():
    design = Design(cantilever(), {"sections.strip.EI3": (0.5, 5.0)})
    tip = design.answer("", "nodes.tip.position")
    design.subject_to(tip[1] <= 0.2, name="low")
    design.subject_to(tip[1] >= 0.3, name="high")
    return design.solve()


def out_of_the_plane():
    design = Design(cantilever(), {"sections.strip.EI3": (0.5, 5.0)})
    design.subject_to(design.answer("", "nodes.tip.position")[2] == 1.0)
    return design.solve()


SCENE = cantilever()
ROUGH = {"wall": Contact(member="beam", type="plane", point=[0, -1], normal=[0, 1], friction=0.2)}


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        (contradicted, "sections.strip.EI3: found 7, accepted: 0.5 to 5, which bounds"),
        (contradicted_by_another, "high: found 0.3 to inf, accepted: -inf to 0.2"),
        (out_of_the_plane, "found 0, which no unknown changes, where 1 is asked for"),
        (lambda: Design(SCENE, {"sections.strip.EI3": (5.0, 0.5)}), "found the bounds 5 and 0.5, accepted: the lower"),
        (lambda: Design(SCENE, {"sections.strip.EI9": (0.5, 5.0)}), "did you mean 'EI3'"),
        (lambda: Design(SCENE, {"sections.strip.EI3": (0, 5)}, guess={"EI": 1}), "found 'EI', accepted: sections"),
        (lambda: Design(SCENE, {"loads.tip.value": (0, 5)}, {"a": {"loads.tip.valu": 1}}), "did you mean 'value'"),
        (lambda: Design(SCENE, {"title": (0, 1)}), "found 'title', accepted: a number of the scene"),
        (lambda: Design(SCENE, cases={}), "found no case, accepted: one or more"),
        (lambda: Design(SCENE).answer("open", "nodes.tip.position"), "found 'open'"),
        (lambda: Design(SCENE).answer("", "nodes.tip.positon"), "did you mean 'position'"),
        (lambda: Design(SCENE).answer("", "members.beam.moment", at=[2.0]), "accepted: fractions of the length"),
        (lambda: Design(SCENE).subject_to(3.0), "accepted: a relation"),
        (lambda: Design(SCENE).subject_to(ca.MX.sym("y") <= 1), "found the symbol 'y'"),
        (lambda: Design(SCENE).minimise(ca.MX.sym("y", 2)), "found 2 numbers, accepted: one"),
        (lambda: Design(SCENE).stable(-1.0), "stable: found -1.0, accepted: zero or more"),
        (lambda: Design(SCENE).set("loads.tip.value", [1.0, 2.0, 3.0]), "found 3 numbers, accepted: 2 numbers"),
        (
            lambda: Design(SCENE, {"loads": Parameter(0.5, lambda x: {}, 0, 1)}),
            "accepted: a name that is none of the scene",
        ),
        (lambda: find(SCENE, ["loads.tip.value.0"], {"nodes.tip.position": [0, 1]}), "2 equations for 1 free number"),
        (
            lambda: find(SCENE, ["loads.tip.value"], {"nodes.tip.angle": 0.5}),
            "found 2 free numbers for 1 that are wanted",
        ),
        (lambda: find(SCENE, ["loads.tip.value"], {"nodes.tip.position": [0, 1, 2, 3]}), "found 4 numbers"),
        (lambda: Design(SCENE.replace(analysis=Analysis(type="path", range=[0, 1]))), "found 'path', accepted: static"),
        (lambda: Design(SCENE.replace(contacts=ROUGH)), "what sticks and slides depends on the steps before"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(action, sentence):
    with pytest.raises(SceneError) as caught:
        action()
    assert sentence in str(caught.value)


def test_a_number_of_unknowns_is_no_parameter():
    counted = cantilever(members={"beam": Member(nodes=["root", "tip"], section="strip", elements=4)})
    with pytest.raises(SceneError, match=r"members\.beam\.elements: found .*, accepted: a whole number"):
        find(counted, {"members.beam.elements": (1, 6)}, {"nodes.tip.angle": 1.0})


def test_a_guess_without_equilibrium_is_refused():
    hinged = {**cantilever().nodes, "tip": Node(position=[1, 0], support="hinge")}
    pulled = cantilever(nodes=hinged, loads={}, motions={"pull": Motion(node="tip", displacement=[0.5, 0.0])})
    with pytest.raises(SceneError, match=r"guess.*no equilibrium"):
        find(pulled, {"motions.pull.displacement.0": (0.4, 1.0)}, {"nodes.tip.angle": 1.0})
