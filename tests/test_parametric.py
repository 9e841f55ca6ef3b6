"""Equilibria as functions of numbers: derivatives against differences and literature, names, refusals."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest
import systems
from scenes import SOFT, cantilever, four_bar, helix

from sfetcas import Parameter, Scene, SceneError, SolveError, Status, changed, load, parametric, solve
from sfetcas.parametric import implicit
from sfetcas.parametric.implicit import Implicit


def tapered():
    """A cantilever with ten numbers of every simple kind."""
    table = cantilever([0.3, 4.0], gravity=[0, -2.0])
    table["sections"]["s"] = {**SOFT, "EI3": {"at": [0, 0.5, 1], "value": [2.0, 1.5, 1.0]}}
    table["loads"]["turn"] = {"type": "moment", "node": "B", "value": 0.3}
    table["motions"] = {"clamp": {"node": "A", "rotation": 0.2}}
    return table


def clamp_in_space():
    table = cantilever([0, 0.5, 0.3], dimension="space")
    table["motions"] = {"clamp": {"node": "A", "rotation": [0.2, 0.4, -0.3], "displacement": [0.1, 0, 0]}}
    return table


def rolled(kappa=0.8):
    """A strip curved as an arc of a circle, told by its curvature: its free end follows it."""
    table = cantilever([0.3, 2.0])
    table["members"]["m"]["shape"] = {"type": "curvature", "kappa3": [kappa], "length": 1.0, "start": [1, 0]}
    table["nodes"]["B"]["position"] = end(kappa)
    return table


def end(kappa):
    return [np.sin(kappa) / kappa, (1.0 - np.cos(kappa)) / kappa]


def curvature(kappa):
    return {"members.m.shape.kappa3": [kappa], "nodes.B.position": end(kappa)}


def rectangular():
    table = cantilever([0.3, 4.0], gravity=[0, -1.0])
    sizes = {"E": 1e5, "nu": 0.3, "rho": 10.0, "width": 0.1, "height": 0.05}
    return {**table, "sections": {"s": {"shape": "rectangle", **sizes}}}


TEN = (
    "sections.s.EI3.value",
    "sections.s.rhoA",
    "loads.tip.value",
    "loads.turn.value",
    "motions.clamp.rotation",
    "gravity.1",
    "factor",
)
PROBLEMS = Path(__file__).parent.parent / "problems"


def hinged_in_space():
    """A plane linkage in space: its hinges hold it more often than needed."""
    return load(PROBLEMS / "fourbar_hinges_in_space.toml").to_dict()


def turning():
    """A linkage in space in rotating axes, whose sections have inertia."""
    table = systems.linked_space()
    table["sections"]["s"] |= {"rhoA": 0.3, "rhoI": [0.03, 0.02, 0.01]}
    return {**table, "rotating": [0.3, 0.4, 0.5]}


CASES = {
    "tapered": (tapered, TEN),
    "springs": (
        systems.linked,
        ["foot.stiffness", "foot.rest", "rope.stiffness", "rope.length", "push.rest", "pull.anchor"],
    ),
    "joint place": (four_bar, {"nodes.C.position.0": (1.0, 1.4), "loads.wind.value.0": None}),
    "rest shape": (rolled, {"curvature": Parameter(0.8, curvature, 0.5, 1.1)}),
    "material": (rectangular, [f"sections.s.{key}" for key in ("E", "width", "height", "rho")]),
    "sections in space": (helix, ["sections.s.GJ", "sections.s.EI2", "sections.s.EI3"]),
    "turned clamp in space": (clamp_in_space, ["motions.clamp.rotation", "motions.clamp.displacement"]),
    "followers in space": (systems.following_space, None),
    "closings that depend on each other": (hinged_in_space, None),
    "rotating axes": (turning, ["rotating.0", "rotating.2", "sections.s.rhoA", "sections.s.rhoI.2"]),
}


@functools.cache
def case(name):
    table, parameters = CASES[name]
    if name == "springs":
        parameters = [f"springs.{key}" for key in parameters]
    return parametric(Scene.from_dict(table()), parameters)


def flat(answer):
    return np.concatenate([np.ravel(answer[one.name]) for one in answer.of.answers])


def along(answer, direction, share, values):
    """What some values of an answer do along a direction of all numbers, by Richardson's differences."""

    def there(t):
        numbers = answer.numbers + t * share * direction
        return values(answer.of.solve(answer.of.by_parameter(numbers), answer))

    near, far = ((there(h) - there(-h)) / (2.0 * h * share) for h in (0.5, 1.0))
    return (4.0 * near - far) / 3.0


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_differences(name):
    """First ones of answers, second ones of first ones."""
    equilibrium = case(name)
    answer = equilibrium.solve()
    random = np.random.default_rng(1)
    size = np.where(answer.numbers == 0.0, 1.0, np.abs(answer.numbers))
    direction = size * random.uniform(0.5, 1.0, len(size))
    wanted = along(answer, direction, 1e-3, flat)
    # Truncation of the fourth power of 1e-3 with large factors, and rounding of 1e-13 over it.
    assert answer.flat_jacobian @ direction == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())
    weights = random.standard_normal(len(wanted))
    found = answer.flat_hessian(weights) @ direction
    wanted = along(answer, direction, 1e-3, lambda other: weights @ other.flat_jacobian)
    assert found == pytest.approx(wanted, abs=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("name", ["tapered", "followers in space"])
def test_large_models_have_the_same_derivatives(name, monkeypatch):
    answer = case(name).solve()
    monkeypatch.setattr(implicit, "EXPANDED", 0)
    solver = case(name).solver
    large = Implicit(solver.arguments, solver.results, solver.method.mass)
    found = large.slopes(answer.numbers, answer.outcome.state)
    # The same sums in another order.
    scale = np.abs(answer.flat_jacobian).max()
    assert found.jacobian == pytest.approx(answer.flat_jacobian, abs=1e-11 * scale)
    assert found.answers == pytest.approx(flat(answer), abs=1e-12 * np.abs(found.answers).max())


def test_derivatives_of_stiffness_and_of_what_is_along_members():
    names = ["compliance.B", "members.m.moment", "members.m.angle"]
    answer = parametric(Scene.from_dict(cantilever([0.3, 4.0])), ["sections.s.EI3", "loads.tip.value"], names).solve()
    direction = np.array([1.0, 0.3, 2.0])
    wanted = along(answer, direction, 1e-3, flat)
    assert answer.flat_jacobian @ direction == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())
    # The compliance is itself the derivative of a displacement by a force.
    plain = parametric(Scene.from_dict(cantilever([0.3, 4.0])), ["loads.tip.value"], ["nodes.B.position"]).solve()
    by_force = plain.jacobian["nodes.B.position"]["loads.tip.value"][:2]
    assert answer["compliance.B"][:2, :2] == pytest.approx(by_force, rel=1e-9)


def test_derivatives_of_a_cantilever_with_a_small_load_are_those_of_linear_beams():
    equilibrium = parametric(Scene.from_dict(cantilever([0.0, 0.0])), ["loads.tip.value", "sections.s.EI3"])
    answer = equilibrium.solve()
    jacobian = answer.jacobian["nodes.B.position"]["loads.tip.value"]
    # F L^3 / 3 EI across, nothing along to first order; to second order 1/2 int theta^2 ds = F^2 L^5 / 15 EI^2.
    assert jacobian == pytest.approx(np.array([[0, 0], [0, 1 / 3], [0, 0]]), abs=1e-9)
    second = answer.hessian("nodes.B.position")
    assert second["loads.tip.value"]["loads.tip.value"][0] == pytest.approx(np.diag([0, -2 / 15]), abs=1e-9)
    assert second["loads.tip.value"]["sections.s.EI3"][1] == pytest.approx([0, -1 / 3], abs=1e-9)


def test_arrays_have_the_shape_of_the_answer_and_then_of_the_parameters():
    answer = case("tapered").solve()
    first, second = answer.jacobian, answer.hessian("nodes.B.position")
    assert first["nodes.B.position"]["sections.s.EI3.value"].shape == (3, 3)
    assert first["nodes.B.position"]["sections.s.rhoA"].shape == (3,)
    assert first["nodes.B.angle"]["loads.tip.value"].shape == (2,)
    assert second["sections.s.EI3.value"]["loads.tip.value"].shape == (3, 3, 2)
    assert second["sections.s.rhoA"]["loads.tip.value"].shape == (3, 2)
    mixed = second["sections.s.EI3.value"]["loads.tip.value"]
    other = second["loads.tip.value"]["sections.s.EI3.value"]
    assert mixed == pytest.approx(np.moveaxis(other, 1, 2), rel=1e-12)
    assert answer.of.numbers[:4] == (*(f"sections.s.EI3.value.{i}" for i in range(3)), "sections.s.rhoA")
    assert set(first["nodes.B.angle"]) == set(TEN)


def test_other_values_are_another_scene():
    equilibrium = case("tapered")
    values = {"sections.s.EI3.value": [1.7, 1.2, 1.1], "loads.tip.value": [0.2, 3.0], "factor": 0.9}
    answer = equilibrium.solve(values, equilibrium.solve())
    wanted = solve(equilibrium.scene_at(values)).last
    # The accuracy of the scene is 1e-4.
    assert answer["nodes.B.position"] == pytest.approx(wanted.position("B"), abs=1e-4)
    assert answer.certified().position("B") == pytest.approx(wanted.position("B"), abs=1e-12)
    assert answer.residual < 1e-10
    assert answer.stable is True
    assert answer.values["factor"] == 0.9


def test_known_derivatives_tell_where_to_begin():
    equilibrium = parametric(Scene.from_dict(tapered()), TEN)
    answer, values = equilibrium.solve(), {"loads.tip.value": [0.3, 4.05]}
    before = equilibrium.solve(values, answer)
    answer.flat_jacobian  # noqa: B018
    after = equilibrium.solve(values, answer)
    assert after.outcome.iterations < before.outcome.iterations
    # Both to rounding.
    assert flat(after) == pytest.approx(flat(before), abs=1e-11)
    # Far away first derivatives lead nowhere.
    far, _ = answer.near(answer.numbers + 100.0)
    assert far is answer.outcome.state


def test_what_has_a_history_goes_by_its_factor():
    table = cantilever([0.0, 2.0], histories={"on": {"t": [0, 1], "value": [0.0, 1.0]}})
    table["loads"]["tip"]["history"] = "on"
    table["analysis"] = {"steps": [0.5]}
    equilibrium = parametric(Scene.from_dict(table), ["histories.on"], ["nodes.B.position"])
    answer = equilibrium.solve({"histories.on": 0.8})
    wanted = solve(Scene.from_dict(cantilever([0.0, 1.6]))).last.position("B")
    # Both to the accuracy of 1e-4.
    assert answer["nodes.B.position"] == pytest.approx(wanted, abs=1e-4)
    assert answer.certified().position("B") == pytest.approx(wanted, abs=1e-4)


def test_a_changed_scene_expects_nothing_of_the_old_one():
    known = {"quantity": "nodes.B.position", "value": [1, 0, 0], "tolerance": 1.0, "step": 1.0}
    scene = Scene.from_dict({**cantilever([0.0, 1.0]), "expect": [known]})
    other = changed(scene, {"sections.s.EI3": 2.0, "loads.tip.value": [0.5, 0.0], "factor": 3.0})
    assert other.expect == ()
    assert other.analysis.steps == (3.0,)
    assert other.loads["tip"].vector == (0.5, 0.0, 0.0)
    assert other.sections["s"].EI3 == 2.0
    assert parametric(scene, ["factor"], ["nodes.B.position"]).solve().residual < 1e-10


def test_a_mesh_that_has_become_too_coarse_is_told():
    equilibrium = parametric(Scene.from_dict(cantilever([0.0, 0.1])), ["loads.tip.value"], ["nodes.B.position"])
    near, far = equilibrium.solve(), equilibrium.solve({"loads.tip.value": [0.0, 60.0]})
    assert near.errors()["nodes.B.position"] < 1e-4 < far.errors()["nodes.B.position"]
    true = solve(equilibrium.scene_at({"loads.tip.value": [0.0, 60.0]}), accuracy=1e-8).last.position("B")
    off = np.abs(far["nodes.B.position"] - true).max()
    # What halving leaves is little beside what it takes away.
    assert far.errors()["nodes.B.position"] == pytest.approx(off, rel=0.1)


def test_a_length_is_a_parameter_of_ones_own():
    def stretched(length):
        return {"nodes.B.position": [length, 0]}

    scene = Scene.from_dict(cantilever([0.0, 3.0]))
    equilibrium = parametric(scene, {"length": Parameter(1.0, stretched, 0.8, 1.2), "loads.tip.value": None})
    answer = equilibrium.solve({"length": 1.1})
    # A cantilever knows F L^2 / EI only.
    other = equilibrium.solve({"loads.tip.value": [0.0, 3.0 * 1.1**2]})
    assert answer["nodes.B.position"] == pytest.approx(1.1 * other["nodes.B.position"], rel=1e-9)


# -- what has no derivatives --------------------------------------------------------------------------


def column(share):
    """A clamped column under its critical load times a share."""
    return Scene.from_dict(cantilever([-share * np.pi**2 / 4, 0.0], analysis={"unstable": "stay"}))


def test_at_a_singular_equilibrium_there_are_no_derivatives():
    answer = parametric(column(1.0), ["loads.tip.value"], ["nodes.B.position"]).solve()
    with pytest.raises(SolveError, match=r"^the equilibrium is singular, where derivatives do not exist") as error:
        answer.flat_jacobian  # noqa: B018
    assert error.value.status is Status.SINGULAR
    near = parametric(column(0.99), ["loads.tip.value"], ["nodes.B.position"]).solve()
    by_force = near.jacobian["nodes.B.position"]["loads.tip.value"][1, 1]
    # tan(kL)/k^3 - L/k^2 over EI of a column under compression.
    k = np.sqrt(0.99) * np.pi / 2
    assert by_force == pytest.approx(np.tan(k) / k**3 - 1 / k**2, rel=1e-6)


def test_what_turns_freely_about_itself_has_derivatives():
    table = {
        "dimension": "space",
        "nodes": {"A": {"position": [0, 0, 0], "support": "ball"}, "B": {"position": [0.3, 0, -1]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {"w": {"type": "force", "node": "B", "value": [0.3, 0.1, -1]}},
    }
    answer = parametric(Scene.from_dict(table), ["loads.w.value"], ["nodes.B.position"]).solve()
    force, length = np.array([0.3, 0.1, -1.0]), np.hypot(0.3, 1.0)
    along, size = force / np.linalg.norm(force), np.linalg.norm(force)
    wanted = length * (np.eye(3) - np.outer(along, along)) / size
    # The softness of the free turn is 1e-10.
    assert answer.jacobian["nodes.B.position"]["loads.w.value"] == pytest.approx(wanted, abs=1e-8)


REFUSED = [
    (cantilever, [3], "parameters: found 3, accepted: names of numbers of the scene"),
    (cantilever, {"loads.tip.value": (0.0,)}, r"loads.tip.value: found \(0.0,\), accepted: a range from low to high"),
    (cantilever, {"sections.s.EI3": (0.1, np.inf)}, "EI3: found .*inf.*, accepted: a range from low to high"),
    (cantilever, {"L": Parameter(1.0, lambda x: x)}, "found 1.0, accepted: values of numbers of the scene by their na"),
    (cantilever, ["loads.tp.value"], "loads.tp.value of loads: found 'tp', accepted: tip"),
    (cantilever, ["members.m.elements"], "members.m.elements: found a number that changes the elements"),
    (cantilever, ["loads.tip.value", "loads.tip.value.1"], "parameters: found loads.tip.value.1 more than once"),
    (cantilever, ["analysis.accuracy"], "parameters.analysis.accuracy: found a number on which nothing depends"),
    (
        systems.small_plane,
        ["nodes.D.direction"],
        "nodes.D.direction: found a guide that turns with parameters",
    ),
    (systems.linked_space, ["springs.knee.axis"], "springs.knee.axis.0: found a number that turns an axis about which"),
    (
        cantilever,
        {"L": Parameter(1.0, lambda x: {"nodes.B.position.0": math.exp(x - 1.0)})},
        "parameters.L: found a function that takes plain numbers only .*, accepted: NumPy's functions, as np.sin",
    ),
    (
        cantilever,
        {"length": Parameter(1.1, lambda x: {"nodes.B.position.0": x})},
        "parameters.length: nodes.B.position.0 is 1 in the scene, but 1.1 where the parameter is 1.1, accepted: "
        "both the same: change that number of the scene, or the value of the parameter",
    ),
    (
        cantilever,
        {"my.length": Parameter(1.0, lambda x: {"nodes.B.position.0": x})},
        "found 'my.length' for a parameter of one's own, accepted: a name without dots",
    ),
]


@pytest.mark.parametrize(("table", "parameters", "sentence"), REFUSED)
def test_what_is_no_parameter_is_refused(table, parameters, sentence):
    with pytest.raises(SceneError, match=sentence):
        parametric(Scene.from_dict(table()), parameters)


def test_unknown_answers_are_refused():
    scene = Scene.from_dict(cantilever())
    with pytest.raises(SceneError, match=r"^answers: nodes\.C\.position: found 'C', accepted: A, B"):
        parametric(scene, ["loads.tip.value"], ["nodes.C.position"])
    answer = case("tapered").solve()
    with pytest.raises(SceneError, match=r"^answers: found 'nodes\.B\.positon'.*did you mean 'nodes\.B\.position'"):
        answer["nodes.B.positon"]
    with pytest.raises(SceneError, match=r"^weights: found 2 weights, accepted: \d+, one for each number"):
        answer.flat_hessian([1.0, 2.0])


VALUES = [
    ({"loads.tip.valu": 1.0}, "values: found 'loads.tip.valu', accepted: .* did you mean 'loads.tip.value'?"),
    ({"loads.tip.value": 1.0}, "values.loads.tip.value: found 1.0, accepted: 2 finite numbers"),
    ({"sections.s.rhoA": "much"}, "values.sections.s.rhoA: found 'much', accepted: a finite number"),
    ({"sections.s.rhoA": -1.0}, "values.sections.s.rhoA: found -1, accepted: zero or more"),
]


@pytest.mark.parametrize(("values", "sentence"), VALUES)
def test_wrong_values_are_refused(values, sentence):
    with pytest.raises(SceneError, match=sentence):
        case("tapered").solve(values)


def test_values_out_of_their_range_are_refused():
    with pytest.raises(SceneError, match=r"^values\.nodes\.C\.position\.0: found 2, accepted: 1 to 1\.4$"):
        case("joint place").solve({"nodes.C.position.0": 2.0})


def test_where_there_is_no_equilibrium_there_are_no_numbers():
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "ball"},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.4}}},
        "motions": {"d": {"node": "B", "displacement": [-0.1, 0]}},
    }
    equilibrium = parametric(Scene.from_dict(table), ["motions.d.displacement.0"], ["reactions.B.force"])
    with pytest.raises(SolveError, match=r"at motions\.d\.displacement\.0 = 0\.5") as error:
        equilibrium.solve({"motions.d.displacement.0": 0.5}, equilibrium.solve())
    assert error.value.last.residual > 1e-6


# -- supports that share a rigid body --------------------------------------------------------------------------------


def held_twice(space, value=0.7):
    """A rigid body on two guides that hold moments together, loaded at a node, within a member, and by an arm."""
    turns = {"rotation": "hinge", "axis": [0, 1, 0]} if space else {}

    def vector(x, y, z):
        return [x, y, z] if space else [x, y]

    def moment(x, y, z):
        return [x, y, z] if space else z

    table = {
        "dimension": "space" if space else "plane",
        "sections": {"s": {"EI3": 2.0, "EI2": 3.0, "GJ": 1.5}},
        "nodes": {
            "A": {"position": [0, 0], "support": "slider", "direction": [1, 0, 0], **turns},
            "B": {"position": [2, 0], "support": "slider", "direction": [0, 1, 0], **turns},
            "C": {"position": [1, 0]},
            "E": {"position": [1, 0.5]},
        },
        "members": {
            "r1": {"nodes": ["A", "C"], "type": "rigid"},
            "r2": {"nodes": ["C", "B"], "type": "rigid"},
            "arm": {"nodes": ["C", "E"], "section": "s"},
        },
        "loads": {
            "f": {"type": "force", "node": "E", "value": vector(0.3, value, -0.2)},
            "g": {"type": "force", "member": "r1", "at": 0.5, "value": vector(0.1, 0.3, 0.2)},
            "m": {"type": "moment", "node": "C", "value": moment(0.2, 0.4, 0.1)},
            "n": {"type": "moment", "member": "r2", "at": 0.5, "value": moment(0.1, -0.05, 0.25)},
        },
        "analysis": {"accuracy": 1e-9},
    }
    if space:
        table["springs"] = {"k": {"type": "rotational", "node": "A", "stiffness": 3.0}}
    return Scene.from_dict(table)


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_supports_of_one_rigid_body_share_its_moment(space):
    """As of the answer, where the smallest of all that balance are looked for state by state; and by differences."""
    names = [f"reactions.{node}.{key}" for node in "AB" for key in ("force", "moment")]
    found = parametric(held_twice(space), ["loads.f.value.1"], names).solve({"loads.f.value.1": 0.7})
    h = 1e-3
    before, here, after = (solve(held_twice(space, x)).last for x in (0.7 - h, 0.7, 0.7 + h))
    for name in names:
        _, node, key = name.split(".")
        one, value, other = (step.reaction(node)[key == "moment"] for step in (before, here, after))
        np.testing.assert_allclose(found[name], value, atol=1e-8)
        np.testing.assert_allclose(found.jacobian[name]["loads.f.value.1"], (other - one) / (2 * h), atol=1e-6)
    assert np.abs(found["reactions.B.moment"][2]) > 0.1


def test_a_number_that_a_section_is_given_without():
    table = cantilever()
    table["sections"]["s"] = {"shape": "rectangle", "width": 0.1, "height": 0.01, "E": 1e9}
    with pytest.raises(SceneError, match=r"sections\.s is given without EI3, accepted: E, width, height$"):
        parametric(Scene.from_dict(table), {"sections.s.EI3": None}, ["nodes.B.position"])


@pytest.mark.parametrize("member", ["r1", "r2"])
@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_moments_anywhere_on_a_rigid_body_reach_its_supports(member, at):
    """What the supports do to turn it changes by as much as the moment on it does, wherever that acts."""

    def total(value):
        table = held_twice(False).to_dict()
        table["loads"]["n"] |= {"member": member, "at": at, "value": value}
        step = solve(Scene.from_dict(table)).last
        return step.reaction("A")[1][2] + step.reaction("B")[1][2]

    assert total(0.0) - total(0.25) == pytest.approx(0.25, abs=1e-8)


def test_supports_of_one_rigid_body_hold_what_turning_axes_do_to_its_sections():
    """Nothing about the axis about which they let it turn, where the sections and the spring alone are in balance."""
    table = held_twice(True).to_dict()
    table["sections"]["s"] |= {"rhoA": 1.0, "rhoI": [0.3, 0.2, 0.1]}
    table["members"]["r1"]["section"] = table["members"]["r2"]["section"] = "s"
    step = solve(Scene.from_dict({**table, "rotating": [0.7, 0.5, 0.3]})).last
    for node in "AB":
        assert step.reaction(node)[1][1] == pytest.approx(0.0, abs=1e-9)
        assert np.abs(step.reaction(node)[1]).max() > 0.01
