"""Motions as optimal control: refusals, the order of the collocation, and answers against closed forms."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from sfetcas import (
    CrossSection,
    History,
    Ipopt,
    Load,
    Member,
    Motion,
    Node,
    Parameter,
    Scene,
    SceneError,
    Settings,
    SolveError,
    Spring,
    Status,
)
from sfetcas.dynamics.simulation import Simulation
from sfetcas.trajectories.optimal_control import OptimalControl
from sfetcas.trajectories.replay import respond

TORQUE = "loads.motor.value"
INERTIA = 0.1 + 1.0 / 3.0 + 0.2
"""Of the rigid arm about its hub, kg m2."""

ANGLE, TIME = np.pi / 2.0, 2.0
LEAST = 12.0 * INERTIA**2 * ANGLE**2 / TIME**3
"""Least integral of the squared torque that turns the rigid arm from rest to rest."""


def arm(elements=2, **more):
    """A hub with inertia, an arm, a mass at its tip; rigid of no elements."""
    member = {"element": "SFET3", "elements": elements} if elements else {"type": "rigid"}
    given = {
        "sections": {"strip": CrossSection(EI3=1.0, rhoA=1.0)},
        "nodes": {
            "hub": Node(position=[0, 0], support="hinge", inertia=[0, 0, 0.1]),
            "tip": Node(position=[1, 0], mass=0.2),
        },
        "members": {"arm": Member(nodes=["hub", "tip"], section="strip", **member)},
        "loads": {"motor": Load(type="moment", node="hub", value=0.0)},
    }
    return Scene(**(given | more))


def turning(scene, name=TORQUE, limit=5.0, intervals=10, unit=1.0, end=TIME, **more):
    """Least effort to turn the arm by 90 degrees, from rest to rest; `unit` of torque."""
    problem = OptimalControl(scene, {name: (-limit, limit)}, time=end, intervals=intervals, **more)
    problem.minimise(problem.integral((problem.control(name) / unit) ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.hub.angle")) == ANGLE, name="turned")
    problem.rest_at_end()
    return problem


def solved(problem, **more):
    return problem.solve(replay=False, ipopt=Ipopt(1e-9, 100), **more)


@pytest.fixture(scope="module")
def flexible():
    return solved(turning(arm()))


# -- what is refused ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: OptimalControl(arm(), {"loads.none.value": (-1, 1)}, time=1.0), "none"),
        (lambda: OptimalControl(arm(), {}, time=1.0), "controls: found none"),
        (
            lambda: OptimalControl(arm(), {TORQUE: (1, -1)}, time=1.0),
            "found the bounds 1 and -1, accepted: the lower one",
        ),
        (lambda: OptimalControl(arm(), {TORQUE: 3.0}, time=1.0), "found 3.0, accepted: a lower and an upper bound"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=-1.0), "a positive time"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0, intervals=0), "at least 1"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0, intervals=[1, -1]), "positive shares"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0, stages=4), "2 or 3 stages"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0, order=0, rates={TORQUE: 1}), "controls that jump"),
        (lambda: OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0, rates={"loads.moter.value": 1}), "moter"),
        (lambda: OptimalControl(arm(), {"sections.strip.EI3": (1, 2)}, time=1.0), "a component of the value of a load"),
        (lambda: OptimalControl(arm(gravity=[0, -9.81]), {"gravity.1": (-9, 9)}, time=1.0), "value of a load"),
    ],
)
def test_problems_that_cannot_be_are_refused(make, sentence):
    with pytest.raises(SceneError, match=sentence):
        make()


def test_loads_and_motions_that_nobody_controls_are_refused():
    history = {"histories": {"pulse": History(t=[0, 1], value=[0, 1])}}
    loads = {
        "motor": Load(type="moment", node="hub", value=0.0),
        "tip": Load(type="force", node="tip", value=[0, 1], history="pulse"),
    }
    with pytest.raises(SceneError, match=r"the history 'pulse'.*constant or controlled"):
        OptimalControl(arm(loads=loads, **history), {TORQUE: (-1, 1)}, time=1.0)
    history = {"histories": {"pulse": History(t=[0, 1], polynomial=[[0, 0, 0, 1]])}}
    moved = {"lift": Motion(node="hub", displacement=[0, 0.1], history="pulse")}
    with pytest.raises(SceneError, match="motions that stand still"):
        OptimalControl(arm(motions=moved, **history), {TORQUE: (-1, 1)}, time=1.0)


def test_what_is_asked_wrongly_is_refused():
    problem = OptimalControl(arm(), {TORQUE: (-1, 1)}, time=1.0)
    torque = problem.control(TORQUE)
    with pytest.raises(SceneError, match="what changes with time"):
        problem.minimise(torque**2)
    with pytest.raises(SceneError, match="tpi"):
        problem.answer("nodes.tpi.position")
    with pytest.raises(SceneError, match="did you mean 'loads"):
        problem.control("loads.moter.value")
    with pytest.raises(SceneError, match="accepted: none"):
        problem.variable("sections.strip.EI3")
    with pytest.raises(SceneError, match=r"torn: found 1 <= \.\.\. <= -1, accepted: the lower bound first"):
        problem.subject_to(1.0 <= (torque <= -1.0), name="torn")  # noqa: SIM300
    with pytest.raises(SceneError, match="line: "):
        problem.subject_to(torque, name="line")
    with pytest.raises(SceneError, match="minimise: found the symbol 'stranger'"):
        problem.minimise(ca.MX.sym("stranger"))
    with pytest.raises(SceneError, match="integral: found the symbol 'stranger'"):
        problem.integral(ca.MX.sym("stranger"))


def test_reactions_are_bounded_along_the_way():
    """Of the rigid arm: without a bound those of the closed form, then as large as allowed."""

    def hub(bound):
        problem = turning(arm(0), intervals=20)
        force = problem.answer("reactions.hub.force")
        problem.subject_to(-bound <= (force <= bound), name="bearing")
        return solved(problem)

    free = hub(10.0)
    share = free.times[1:] / TIME
    angle, speed = ANGLE * (3.0 * share**2 - 2.0 * share**3), 6.0 * ANGLE / TIME * (share - share**2)
    faster = 6.0 * ANGLE / TIME**2 * (1.0 - 2.0 * share)
    # The first moment of mass about the hub; accelerations in 20 intervals err by their square.
    wanted = 0.7 * (faster * [-np.sin(angle), np.cos(angle)] - speed**2 * [np.cos(angle), np.sin(angle)]).T
    told = free.answer("reactions.hub.force")
    assert np.isnan(told[0, :2]).all()
    assert told[1:, :2] == pytest.approx(wanted, abs=0.01 * np.abs(wanted).max())
    eased = hub(0.8 * np.abs(wanted).max())
    assert np.abs(eased.answer("reactions.hub.force")[1:]).max() == pytest.approx(0.8 * np.abs(wanted).max(), rel=1e-3)
    assert eased.cost > free.cost
    problem = turning(arm(0))
    problem.subject_to(problem.at_t0(problem.answer("reactions.hub.force")) == 0.0)
    with pytest.raises(SceneError, match=r"^answer.reactions.hub.force: found what .* exert, which is not known at t0"):
        solved(problem)


def test_a_constraint_that_nothing_changes_and_does_not_hold_is_refused():
    problem = turning(arm())
    # In a plane scene z of the tip is 0 at all times.
    problem.subject_to(problem.answer("nodes.tip.position")[2] == 1.0, name="height")
    with pytest.raises(SceneError, match=r"height: found 0, which nothing changes, accepted: 1"):
        problem.solve()


def test_too_short_a_time_is_told_with_the_last_iterate():
    # A rigid arm needs 1.45 N m for it.
    problem = turning(arm(0), limit=1.0)
    with pytest.raises(SolveError, match=r"turned by.*or 2 s be too short for the limits") as told:
        problem.solve(ipopt=Ipopt(1e-8, 60))
    last = told.value.last
    assert last.status is not None
    assert last.check is None
    # Not turned: no answer.
    assert np.abs(last.control(TORQUE)).max() <= 1.0 + 1e-6
    assert "violated most" in str(told.value)


# -- closed forms ---------------------------------------------------------------------------------------------


def test_effort_of_a_rigid_arm_is_that_of_the_closed_form():
    problem = turning(arm(0))
    problem.subject_to(problem.answer("energy.kinetic") <= 10.0)
    motion = solved(problem)
    # The best torque is linear in time, as controls are; the circle of the tip is met to order 5 in 10 intervals.
    assert motion.cost == pytest.approx(LEAST, rel=1e-5)
    torque = 6.0 * INERTIA * ANGLE / TIME**2 * (1.0 - 2.0 * motion.ends / TIME)
    np.testing.assert_allclose(motion.control(TORQUE), torque, atol=1e-4)
    angle = ANGLE * (3.0 * (motion.times / TIME) ** 2 - 2.0 * (motion.times / TIME) ** 3)
    np.testing.assert_allclose(motion.answer("nodes.hub.angle").ravel(), angle, atol=1e-4)
    speed = 6.0 * ANGLE / TIME * (motion.times / TIME - (motion.times / TIME) ** 2)
    np.testing.assert_allclose(motion.answer("energy.kinetic").ravel(), 0.5 * INERTIA * speed**2, atol=1e-4)


def test_effort_of_a_flexible_arm_tends_to_that_of_the_rigid_one(flexible):
    stiff = solved(turning(arm(sections={"strip": CrossSection(EI3=1e3, rhoA=1.0)})))
    assert flexible.cost > 1.1 * LEAST
    # What bends is the thousandth part.
    assert stiff.cost == pytest.approx(LEAST, rel=1e-3)


def test_impulse_and_work_of_a_motion_from_rest_to_rest_vanish(flexible):
    torque, size = flexible.control(TORQUE), 2.0 * TIME
    # Nothing asks for it: the arm's momentum is 0 at both ends, but for the vibrations too fast for 10 intervals.
    assert abs(np.trapezoid(torque, flexible.ends)) < 1e-3 * size


def test_limits_of_the_rate_of_a_torque_and_of_the_speed_of_the_tip_hold():
    free = 12.0 * INERTIA * ANGLE / TIME**3, 1.5 * ANGLE / TIME
    problem = turning(arm(0), rates={TORQUE: 4.0}, intervals=20)
    speed = problem.answer("nodes.tip.velocity")
    problem.subject_to(ca.sumsqr(speed) <= 1.0, name="speed")
    motion = solved(problem)
    rate = np.diff(motion.control(TORQUE)) / np.diff(motion.ends)
    assert free[0] < np.abs(rate).max() <= 4.0 + 1e-6
    fastest = np.linalg.norm(motion.answer("nodes.tip.velocity"), axis=1).max()
    assert fastest == pytest.approx(1.0, abs=1e-6)
    assert free[1] > 1.1
    assert motion.cost > 1.01 * LEAST


def test_least_time_of_a_rigid_arm():
    problem = OptimalControl(arm(0), {TORQUE: (-1, 1)}, time=(0.5, 6.0), intervals=10, order=0)
    problem.minimise(problem.time)
    problem.subject_to(problem.at_tf(problem.answer("nodes.hub.angle")) == ANGLE)
    problem.rest_at_end()
    motion = solved(problem, time=3.0)
    assert motion.time == pytest.approx(2.0 * np.sqrt(ANGLE * INERTIA), rel=1e-6)
    np.testing.assert_allclose(motion.control(TORQUE), [1.0] * 5 + [-1.0] * 5, atol=1e-4)


# -- the same problem told in other words ---------------------------------------------------------------------


def test_controlled_histories_cost_what_controlled_values_cost(flexible):
    loads = {"motor": Load(type="moment", node="hub", value=2.0, history="torque")}
    scene = arm(loads=loads, histories={"torque": History(t=[0, 1], value=[0, 0])})
    motion = solved(turning(scene, name="histories.torque", unit=0.5))
    # IPOPT's tolerance
    assert motion.cost == pytest.approx(flexible.cost, rel=1e-6)
    np.testing.assert_allclose(2.0 * motion.control("histories.torque"), flexible.control(TORQUE), atol=1e-4)


def test_units_do_not_matter(flexible):
    # Lengths in mm, forces in mN.
    mm, mn = 1e3, 1e3
    nodes = {
        "hub": Node(position=[0, 0], support="hinge", inertia=[0, 0, 0.1 * mn * mm]),
        "tip": Node(position=[mm, 0], mass=0.2 * mn / mm),
    }
    sections = {"strip": CrossSection(EI3=mn * mm**2, rhoA=mn / mm**2)}
    motion = solved(turning(arm(nodes=nodes, sections=sections), limit=5.0 * mn * mm, unit=mn * mm))
    assert motion.cost == pytest.approx(flexible.cost, rel=1e-6)


def to_the_side(scene, name):
    """Least effort to bring the tip from y = 0 to y = 0.8."""
    problem = OptimalControl(scene, {name: (-5, 5)}, time=TIME, intervals=10)
    problem.minimise(problem.integral(problem.control(name) ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.tip.position")[1]) == 0.8, name="side")
    problem.rest_at_end()
    return solved(problem)


def test_space_costs_what_the_plane_does():
    sections = {"strip": CrossSection(EI2=1.0, EI3=1.0, GJ=1.0, rhoA=1.0, rhoI=[2e-4, 1e-4, 1e-4])}
    scene = arm(
        1,
        dimension="space",
        sections=sections,
        nodes={
            "hub": Node(position=[0, 0, 0], support="hinge", axis=[0, 0, 1], inertia=[0, 0, 0.1]),
            "tip": Node(position=[1, 0, 0], mass=0.2),
        },
        loads={"motor": Load(type="moment", node="hub", value=[0, 0, 0])},
    )
    space, plane = to_the_side(scene, f"{TORQUE}.2"), to_the_side(arm(1, sections=sections), TORQUE)
    # Quaternions and angles between the nodes of the one element differ, by the error that either has.
    assert space.cost == pytest.approx(plane.cost, rel=3e-4)
    np.testing.assert_allclose(space.positions("tip"), plane.positions("tip"), atol=4e-3)


def test_a_spring_is_chosen_together_with_the_torque():
    spring = {"hub": Spring(node="hub", stiffness=1.0, axis=[0, 0, 1], between=["ground", "arm"])}
    scene = arm(0, springs=spring)
    costs = {}
    for low, high in ((0.5, 0.5), (0.6, 0.6), (0.1, 3.0)):
        problem = turning(scene, variables={"springs.hub.stiffness": (low, high)})
        motion = solved(problem)
        costs[motion.variables["springs.hub.stiffness"]] = motion.cost
    assert len(costs) == 3
    best = min(costs, key=costs.get)
    assert best not in (0.5, 0.6)
    assert 0.1 - 1e-6 <= best <= 3.0


# -- collocation and replay -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("stages", "order"), [(2, 3), (3, 5)])
def test_the_motion_errs_by_the_order_of_the_method(stages, order):
    # A rigid pendulum under gravity and a constant torque; nothing is left to choose.
    scene, torque = arm(0, gravity=[0, -9.81]), 3.0
    command = {TORQUE: History(t=[0.0, 1.0, 2.0], polynomial=[[torque], [0.0]])}
    exact = respond(scene, command, 1.0, times=np.array([0.0, 1.0]), integrator="radau-3", accuracy=1e-9, step=0.02)
    errors = []
    for intervals in (5, 10):
        fixed = {TORQUE: (torque, torque)}
        problem = OptimalControl(scene, fixed, time=1.0, intervals=intervals, stages=stages, order=0)
        motion = solved(problem, guess="rest")
        errors.append(np.linalg.norm(motion.positions("tip")[-1] - exact.positions("tip")[-1]))
    # Halved steps: the factor 2^order, reached to about half a power on grids as coarse as these.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.6)


def test_replay_agrees_and_names_its_integrator(flexible):
    check = flexible.replayed(tail=0.5, accuracy=1e-3, halvings=1)
    assert check.integrator == "conserving"
    # Two elements and 10 intervals of an effort that jumps at both ends: a few thousandths.
    assert check.difference < 2e-2
    assert check.response.after.sum() == 101


def test_a_known_answer_is_where_another_search_begins(flexible):
    with pytest.raises(SceneError, match="another grid or mesh"):
        solved(turning(arm(), intervals=12), guess=flexible)
    again = solved(turning(arm()), guess=flexible)
    # What vibrates too fast to be brought to rest is judged about the guess.
    assert again.cost == pytest.approx(flexible.cost, rel=1e-4)


def test_kinks_a_rounding_apart_are_one():
    end = 0.5
    near = np.nextafter(end, 0.0)
    command = {TORQUE: History(t=[0.0, 0.25, near], value=[0.0, 1.0, 0.0])}
    found = respond(arm(0), command, end, step=0.05, accuracy=1.0, halvings=1)
    assert np.isfinite(found.positions("tip")).all()
    scene = arm(
        0,
        loads={"motor": Load(type="moment", node="hub", value=1.0, history="h")},
        histories={"h": command[TORQUE]},
        analysis={"type": "dynamic", "end": end},
    )
    assert Simulation(scene, Settings())._breaks(1.0) == [0.25, end]


def test_a_search_that_broke_off_begins_again(flexible, monkeypatch):
    prepare = Ipopt.prepare

    def breaking(self, nlp):
        solve = prepare(self, nlp)
        if "neg_curv_test_tol" in self.extra:
            return solve
        return lambda *a, **more: replace(solve(*a, **more), status=Status.FAILED, message="Error_In_Step_Computation")

    monkeypatch.setattr(Ipopt, "prepare", breaking)
    motion = solved(turning(arm()), guess=flexible)
    assert any("began again" in note for note in motion.notes)
    # What vibrates too fast to be brought to rest is judged about another guess.
    assert motion.cost == pytest.approx(flexible.cost, rel=1e-4)


def bar(length):
    """A rigid arm whose least effort for 1.5 rad in 2 s is 12 J^2 1.5^2 / 8."""
    scene = Scene(
        sections={"bar": CrossSection(rhoA=1.0)},
        nodes={"hub": Node(position=[0, 0], support="hinge"), "tip": Node(position=[length, 0])},
        members={"arm": Member(nodes=["hub", "tip"], section="bar", type="rigid")},
        loads={"motor": Load(type="moment", member="arm", at=0.0, value=0.0)},
    )
    inertia = length**3 / 3.0
    problem = OptimalControl(scene, {TORQUE: (-8.0 * inertia, 8.0 * inertia)}, time=2.0, intervals=12)
    tip = problem.answer("nodes.tip.position")
    problem.subject_to(problem.at_tf(tip)[1] == length * np.sin(1.5))
    problem.rest_at_end()
    return problem, problem.integral(problem.control(TORQUE) ** 2), 12.0 * inertia**2 * 1.5**2 / 8.0


@pytest.mark.parametrize("length", [1e-6, 1e-2, 1.0, 1e3])
def test_the_least_effort_of_a_bar_does_not_depend_on_its_size(length):
    problem, effort, least = bar(length)
    problem.minimise(effort)
    motion = problem.solve(replay=False)
    # Torques that are linear in an interval are what the least effort takes; bounds of IPOPT give by 1e-8.
    assert motion.cost / least == pytest.approx(1.0, abs=2e-6)


def test_a_parameter_of_ones_own_is_a_variable():
    """A spring of twice and one of three times the same stiffness, which holds the arm back as little as it may."""
    springs = {name: Spring(node="hub", stiffness=share) for name, share in (("one", 2.0), ("other", 3.0))}
    scene = bar(1.0)[0].scene.replace(springs=springs)
    stiffness = Parameter(
        1.0, lambda k: {"springs.one.stiffness": 2.0 * k, "springs.other.stiffness": 3.0 * k}, 0.2, 5.0
    )
    problem = OptimalControl(scene, {TORQUE: (-9.0, 9.0)}, time=2.0, intervals=12, variables={"stiffness": stiffness})
    problem.subject_to(problem.at_tf(problem.answer("nodes.tip.position"))[1] == np.sin(0.5))
    problem.rest_at_end()
    problem.minimise(problem.integral(problem.control(TORQUE) ** 2))
    motion = problem.solve(replay=False)
    # Bounds of IPOPT give by 1e-8 of their distance.
    assert motion.variables["stiffness"] == pytest.approx(0.2, abs=1e-6)
    held = {name: spring.stiffness for name, spring in motion.scene.springs.items()}
    assert held == pytest.approx({"one": 0.4, "other": 0.6}, abs=3e-6)


@pytest.mark.parametrize("length", [1e-3, 1.0])
def test_a_bound_of_the_effort_holds_in_small_units(length):
    problem, effort, least = bar(length)
    problem.subject_to(effort <= 0.5 * least, name="effort")
    with pytest.raises(SolveError, match=r"meet all that is asked for .*effort by"):
        problem.solve(replay=False)


def test_an_answer_that_its_replay_contradicts_says_so():
    scene, _, _ = bar(1.0)[0].scene, None, None
    problem = OptimalControl(scene, {TORQUE: (-3.0, 3.0)}, time=2.0, intervals=1)
    problem.subject_to(problem.at_tf(problem.answer("nodes.tip.position"))[1] == np.sin(1.5))
    problem.rest_at_end()
    motion = problem.solve()
    assert motion.status is Status.SHORT
    assert "does not rest" in motion.notes[-1]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"intervals": 1.5}, "intervals: found 1.5"),
        ({"intervals": "a"}, "intervals: found 'a'"),
        ({"rates": {TORQUE: float("nan")}}, "rates: found nan"),
        ({"rates": {TORQUE: (-1, 1)}}, "rates: found"),
        ({"time": (3.0, 1.0)}, "time: found the bounds 3 and 1, accepted: the lower one first"),
    ],
)
def test_numbers_that_are_none_are_refused(given, sentence):
    with pytest.raises(SceneError, match=sentence):
        OptimalControl(arm(0), {TORQUE: (-1, 1)}, **{"time": 1.0, **given})


def test_commands_that_are_none_are_refused():
    with pytest.raises(SceneError, match=r"commands: found 3\.0 for loads\.motor\.value"):
        respond(arm(0), {TORQUE: 3.0}, 1.0)
    with pytest.raises(SceneError, match="tail of -1 s"):
        respond(arm(0), {TORQUE: History(t=[0, 1], value=[0, 1])}, 1.0, tail=-1.0)


def test_targets_that_are_no_numbers_are_refused():
    problem = OptimalControl(arm(0), {TORQUE: (-1, 1)}, time=1.0)
    with pytest.raises(SceneError, match="not a finite number as a bound"):
        problem.subject_to(problem.at_tf(problem.answer("nodes.hub.angle")) == float("nan"))
    with pytest.raises(SceneError, match="minimise: found 'x'"):
        problem.minimise("x")
