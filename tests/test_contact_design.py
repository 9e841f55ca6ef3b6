"""Inverse problems and designs where members touch something: against statics, and where something else touches."""

import casadi as ca
import pytest
from scenes import DRUM, FLOOR, IN_PIPE, ON_DRUM, ON_FLOOR

from sfetcas import Design, QuasiStatic, Scene, SceneError, SolveError, find, parametric, solve


def pressed(contacts, load=(0, -2), **more):
    """A cantilever of unit length with a force at its end, and obstacles."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"F": {"type": "force", "node": "B", "value": list(load)}},
            "contacts": {name: {**contact, "members": "all"} for name, contact in contacts.items()},
            "analysis": {"accuracy": 1e-8},
            **more,
        }
    )


def design(scene, variables, **more):
    return Design(scene, variables, kernels="interpreted", **more)


def test_force_for_a_place_is_found():
    wanted = [0.93, -0.34]
    found = find(pressed({"c": DRUM}), ["loads.F.value"], {"nodes.B.position": wanted})
    step = solve(found.scene()).last
    assert step.position("B")[:2] == pytest.approx(wanted, abs=1e-7)
    assert step.contacts["c"]["at"] is not None
    # The place has moved by a tenth, and elements end where it is now.
    assert found.replayed() < 1e-10


def test_obstacle_for_a_force():
    problem = design(pressed({"c": DRUM}), {"contacts.c.radius": (0.2, 0.4)})
    problem.minimise((problem.answer("", "contacts.c.force")[1] - 1.5) ** 2)
    radius = problem.solve().values["contacts.c.radius"]
    step = solve(pressed({"c": {**DRUM, "radius": radius}})).last
    # The force changes by ten times the radius, and is known to a hundred times the accuracy.
    assert step.contacts["c"]["force"][1] == pytest.approx(1.5, abs=1e-5)


@pytest.mark.parametrize("goal", [-0.05, 0.05])
def test_what_touches_at_the_guess_only_is_let_go(goal):
    """A tip that the floor stops at the guess cannot be moved while it touches."""
    low = {"type": "plane", "point": [0, -0.1], "normal": [0, 1]}
    problem = design(pressed({"floor": low}), {"loads.F.value": (-9, 9)})
    force = problem.variable("loads.F.value")
    problem.subject_to(problem.answer("", "nodes.B.position")[1] >= goal)
    problem.subject_to(force[0] == 0)
    problem.minimise((force[1] + 0.5 * (goal < 0)) ** 2)
    answer = problem.solve()
    step = solve(answer.scene()).last
    assert step.position("B")[1] == pytest.approx(goal, abs=1e-7)
    # Small deflections, to their square.
    assert answer.values["loads.F.value"][1] == pytest.approx(3.0 * goal, rel=5e-3)


def test_numbers_of_what_is_let_go_stay_unknown():
    low = {"type": "plane", "point": [0, -0.1], "normal": [0, 1]}
    problem = design(
        pressed({"floor": low}, load=(0, -2)), {"loads.F.value.1": (-9, 9), "contacts.floor.point.1": (-1, 0)}
    )
    force, height = problem.variable("loads.F.value.1"), problem.variable("contacts.floor.point.1")
    problem.subject_to(problem.answer("", "nodes.B.position")[1] == -0.05)
    problem.minimise((height + 0.2) ** 2 + (force + 0.15) ** 2)
    values = problem.solve().values
    assert values["contacts.floor.point.1"] == pytest.approx(-0.2, abs=1e-6)
    assert values["loads.F.value.1"] == pytest.approx(-0.15, rel=5e-3)  # small deflections


def beside_a_peg(force):
    """A peg below the end of a cantilever, which a force pushes down."""
    return pressed({"peg": {"type": "circle", "center": [0.9, -0.1], "radius": 0.05}}, load=(0, force))


@pytest.mark.parametrize("force", [-0.1, -0.4], ids=["apart", "touching"])
def test_parameters_do_not_lead_past_an_obstacle(force):
    """Where it is only the loads growing from zero that the peg stops."""
    known = parametric(beside_a_peg(force), ["loads.F.value"], ["nodes.B.position"])
    found = known.solve({"loads.F.value": [0, -4]})["nodes.B.position"]
    assert found == pytest.approx(solve(beside_a_peg(-4)).last.position("B"), abs=1e-7)


@pytest.mark.parametrize("force", [-2.0, 0.05], ids=["touching", "apart"])
def test_a_design_is_on_the_side_to_which_the_loads_lead(force):
    """Beyond the peg it would be at -0.6."""
    problem = design(beside_a_peg(force), {"loads.F.value": (-30, 30)}, accuracy=1e-6)
    problem.subject_to(problem.variable("loads.F.value")[0] == 0)
    problem.subject_to(problem.answer("", "nodes.B.position")[1] == -0.6)
    with pytest.raises(SolveError):
        problem.solve()


def test_what_cannot_be_met_with_or_without_touch_is_told():
    low = {"type": "plane", "point": [0, -0.1], "normal": [0, 1]}
    problem = design(pressed({"floor": low}), {"loads.F.value": (-9, 9)})
    problem.subject_to(problem.answer("", "nodes.B.position")[1] == -0.2)
    with pytest.raises(SolveError, match=r"most is missed at nodes\.B\.position"):
        problem.solve()


def two():
    low = {"type": "circle", "center": [0.8, -0.45], "radius": 0.1}
    return pressed({"c": {**DRUM, "center": [0.4, -0.3], "radius": 0.25}, "d": low})


@pytest.mark.parametrize(("goal", "touching"), [(-0.3832, 2), (0.2, 0)], ids=["more", "nothing"])
def test_what_else_touches_is_found(goal, touching):
    problem = design(two(), {"loads.F.value": (-9, 9)}, accuracy=1e-7)
    sideways = problem.variable("loads.F.value")[0]
    problem.minimise((problem.answer("", "nodes.B.position")[1] - goal) ** 2 + 1e-6 * sideways**2)
    answer = problem.solve()
    step = solve(answer.scene()).last
    assert step.position("B")[1] == pytest.approx(goal, abs=1e-6)
    assert sum(entry["at"] is not None for entry in step.contacts.values()) == touching


def test_solution_where_something_begins_to_touch_is_refused():
    """Less force pays as long as the beam is pressed on the drum, more as long as it is not."""
    problem = design(pressed({"c": DRUM}), {"loads.F.value.1": (-9.0, -0.1)})
    problem.minimise(6.0 * problem.answer("", "nodes.B.position")[1] - problem.variable("loads.F.value.1"))
    with pytest.raises(
        SolveError, match=r"what touches does not settle, as where .* begins to touch: contacts\.c (leaves|touches)"
    ):
        problem.solve()


def test_cases_touch_the_same():
    loads = {"soft": {"loads.F.value": [0, -2]}, "hard": {"loads.F.value": [0, -8]}}
    problem = design(two(), {"sections.s.EI3": (0.5, 2.0)}, cases=loads)
    problem.minimise(problem.answer("soft", "nodes.B.position")[1] ** 2)
    with pytest.raises(SolveError, match="something else touches in the cases soft and hard, accepted: the same"):
        problem.solve()
    near = {"soft": {"loads.F.value": [0, -2]}, "hard": {"loads.F.value": [0, -3]}}
    problem = design(pressed({"c": DRUM}), {"sections.s.EI3": (0.5, 2.0)}, cases=near, accuracy=1e-7)
    fall = problem.answer("soft", "nodes.B.position")[1] - problem.answer("hard", "nodes.B.position")[1]
    problem.subject_to(fall == 0.0057)
    answer = problem.solve()
    apart = [solve(answer.scene(case)).last.position("B")[1] for case in near]
    assert apart[0] - apart[1] == pytest.approx(0.0057, abs=1e-6)


def test_friction_is_refused():
    with pytest.raises(SceneError, match=r"contacts\.c\.friction: what sticks .* no part of a design"):
        find(pressed({"c": {**FLOOR, "friction": 0.3}}), ["sections.s.EI3"], {"reactions.A.moment.z": 1.0})


# -- along lines -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "number", "bounds", "moment"),
    [
        ("floor", "sections.s.EI3", (0.5, 1.5), 3.6),
        ("drum", "contacts.c.radius", (0.2, 0.4), 0.76),
        ("pipe", "loads.W.value.1", (-300, -100), 10.6),
    ],
    ids=["floor", "drum", "pipe"],
)
def test_along_a_line(kind, number, bounds, moment):
    """The number for a moment at the clamp, and how it changes with that, against statics and its derivatives."""
    scene = Scene.from_dict({"floor": ON_FLOOR, "drum": ON_DRUM, "pipe": IN_PIPE}[kind])
    problem = design(scene, {number: bounds}, accuracy=1e-5)
    problem.subject_to(problem.answer("", "reactions.A.moment")[2] == moment, name="clamp")
    problem.minimise(problem.variable(number))
    answer = problem.solve()
    assert answer.stable
    function = parametric(answer.scene(), [number], ["reactions.A.moment"])
    there = function.solve()
    assert function.solver.model.mesh.lies
    # Elements end where lines do, to the tolerance of the program; forces are known to ten times that.
    assert there["reactions.A.moment"][2] == pytest.approx(moment, rel=1e-6)
    slope = there.jacobian["reactions.A.moment"][number][2]
    assert answer.multipliers["clamp"] * slope == pytest.approx(-1.0, rel=1e-4)


def test_answers_along_a_member_that_lies_are_refused():
    problem = design(Scene.from_dict(ON_FLOOR), {"sections.s.EI3": (0.5, 1.5)})
    problem.subject_to(problem.answer("", "members.beam.moment", [0.1])[0] == 3.0)
    with pytest.raises(SceneError, match=r"members\.beam: found an answer along a member that lies along an obstacle"):
        problem.solve()


def test_along_a_line_that_ends_elsewhere_in_each_case():
    loads = {"soft": {"loads.W.value.1": -60.0}, "hard": {"loads.W.value.1": -150.0}}
    problem = design(Scene.from_dict(ON_FLOOR), {"sections.s.EI3": (0.5, 1.5)}, cases=loads)
    problem.subject_to(problem.answer("hard", "reactions.A.moment")[2] == 5.5)
    answer = problem.solve()
    soft, hard = (solve(answer.scene(case)).last for case in loads)
    assert hard.reaction("A")[1][2] == pytest.approx(5.5, rel=1e-6)
    ends = [step.contacts["c"]["at"][0] for step in (soft, hard)]
    assert ends[0] - ends[1] == pytest.approx(0.12, abs=0.01)


def test_a_path_along_a_line():
    problem = QuasiStatic(Scene.from_dict(ON_FLOOR), {"loads.W.value.1": (-200, -20)}, points=3, kernels="interpreted")
    problem.subject_to(problem.answer("reactions.A.moment")[:, 2] == 3.5 + problem.s)
    problem.minimise(ca.sumsqr(problem.input("loads.W.value.1")) * 1e-6)
    answer = problem.solve()
    assert answer.stable
    assert not answer.jumps
    assert solve(answer.scene(2)).last.reaction("A")[1][2] == pytest.approx(4.5, rel=1e-6)


def test_a_path_of_equilibria_that_touch():
    problem = QuasiStatic(pressed({"c": DRUM}), {"loads.F.value": (-20, 20)}, points=3, kernels="interpreted")
    force, tip = problem.input("loads.F.value"), problem.answer("nodes.B.position")
    problem.subject_to(tip[:, 1] == -0.347 - 0.003 * problem.s)
    problem.minimise(ca.sumsqr(force[:, 0]))
    answer = problem.solve()
    assert answer.stable
    assert solve(answer.scene(2)).last.position("B")[1] == pytest.approx(-0.35, abs=1e-7)
