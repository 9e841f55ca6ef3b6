"""Members that relax: closed forms of the standard linear solid, its complex modulus, energy, and orders."""

import numpy as np
import pytest
from motions import FLAT, SMOOTH, THICK, moved, tip
from motions import cantilever as pushed
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import root
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.codegen.timestep import time_step

pytestmark = pytest.mark.usefixtures("interpreted")

BRANCHES = [{"ratio": 0.3, "time": 0.1}, {"ratio": 0.2, "time": 0.7}]
LIGHT = 1e-7
"""Mass per length beside EI = L = 1: frequencies are above 1e4, so that what is loaded in a second is at rest."""


def shares(branches=BRANCHES):
    """Stiffness of branches over the long-term one."""
    left = 1.0 - sum(one["ratio"] for one in branches)
    return [one["ratio"] / left for one in branches]


def strip(dimension="plane", section=None, mass=LIGHT, **more):
    own = {"EI3": 1.0, "EI2": 1.0, "GJ": 0.8, "rhoA": mass, "relaxation": BRANCHES, **(section or {})}
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": own},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "histories": {"on": SMOOTH},
            **more,
        }
    )


def ramp(t):
    """The history ``on`` and its rate."""
    t = np.clip(t, 0.0, 1.0)
    value = np.polynomial.Polynomial(SMOOTH["polynomial"][0])
    return value(t), value.deriv()(t)


def relaxing(times, branches=BRANCHES):
    """Moment over the long-term stiffness for the strain of the history, by SciPy."""

    def rates(t, m):
        return [k * ramp(t)[1] - one / b["time"] for one, b, k in zip(m, branches, shares(branches), strict=True)]

    found = solve_ivp(rates, (0, times[-1]), np.zeros(len(branches)), "DOP853", t_eval=times, rtol=1e-11, atol=1e-12)
    return ramp(times)[0] + found.y.sum(axis=0)


def creeping(times, branches=BRANCHES):
    """Strain times the long-term stiffness for the moment of the history: kappa = (m + sum k xi) / (1 + sum k)."""
    own = shares(branches)

    def strain(t, left):
        return (ramp(t)[0] + np.dot(own, left)) / (1.0 + sum(own))

    def rates(t, left):
        return [(strain(t, left) - one) / b["time"] for one, b in zip(left, branches, strict=True)]

    found = solve_ivp(rates, (0, times[-1]), np.zeros(len(branches)), "DOP853", t_eval=times, rtol=1e-11, atol=1e-12)
    return np.array([strain(t, left) for t, left in zip(times, found.y.T, strict=True)])


# -- quasi-static motions -----------------------------------------------------------------------------


def test_moment_relaxes_at_constant_curvature():
    """Both ends are turned within a second and held: the arc stays, and its moment fades."""
    ends = {
        "A": {"position": [0, 0], "support": "hinge"},
        "B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
    }
    motions = {name: {"node": name, "rotation": angle, "history": "on"} for name, angle in (("A", -0.6), ("B", 0.6))}
    analysis = {"type": "dynamic", "end": 2.5, "output": 0.5, "accuracy": 1e-4}
    found = sfetcas.solve(strip("space", nodes=ends, motions=motions, analysis=analysis), element="SFET3")
    exact = relaxing(found.times)
    for state, moment in zip(found.steps, exact, strict=True):
        bent = state.along("m", [0.3])
        assert bent["moment"][0, 2] == pytest.approx(1.2 * moment, abs=2e-4)
        assert bent["curvature"][0, 2] == pytest.approx(1.2 * ramp(state.time)[0], abs=2e-4)
    # It is more than a tenth above the long-term one when the ends stop, and then falls towards it.
    assert exact[2] > 1.1 > exact[-1] > 1.0


@pytest.mark.parametrize("integrator", ["radau-2", "generalised-alpha", "conserving"])
def test_curvature_creeps_at_constant_moment(integrator):
    """The tip goes where the arc of the strain ends that SciPy finds; what has relaxed does not depend on masses."""
    load = {"tip": {"type": "moment", "node": "B", "value": 0.8, "history": "on"}}
    analysis = {"type": "dynamic", "end": 2.5, "output": 0.5, "step": 0.02, "integrator": integrator}
    found = sfetcas.solve(strip(mass=1e-4, loads=load, analysis=analysis), element="SFET4", elements=1)
    bent = 0.8 * creeping(found.times)[1:]
    exact = np.stack([np.sin(bent) / bent, (1.0 - np.cos(bent)) / bent], axis=1)
    np.testing.assert_allclose(found.positions("B")[1:, :2], exact, atol=1e-4)
    # It ends near, but below, what statics says.
    assert 0.75 < bent[-1] < 0.8


def test_force_relaxes_at_constant_stretch():
    """A bar is pulled within a second and held: its force and its strain, from what the ground takes."""
    ends = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}}
    motions = {"pull": {"node": "B", "displacement": [0.2, 0.0], "history": "on"}}
    analysis = {"type": "dynamic", "end": 2.5, "output": 0.5, "step": 0.02}
    own = {"section": {"EA": 20.0}, "nodes": ends, "motions": motions, "analysis": analysis}
    found = sfetcas.solve(strip(**own), element="SFET3", elements=1)
    for state, force in zip(found.steps, relaxing(found.times), strict=True):
        assert state.reaction("B")[0][0] == pytest.approx(4.0 * force, abs=1e-6)
        assert state.along("m", [0.3])["strain"][0, 0] == pytest.approx(0.2 * ramp(state.time)[0], abs=1e-7)


def test_stress_is_that_of_the_moment():
    """M y / I of a rectangle, and the strain y times the curvature."""
    section = {"EI3": None, "EI2": None, "GJ": None, "rhoA": None, "shape": "rectangle", "width": 0.02, "height": 0.01}
    section |= {"E": 6e8, "rho": 1e-3}
    load = {"tip": {"type": "moment", "node": "B", "value": 0.8, "history": "on"}}
    analysis = {"type": "dynamic", "end": 1.2, "output": 0.3, "step": 0.02}
    found = sfetcas.solve(strip(section=section, loads=load, analysis=analysis), element="SFET4", elements=1)
    for state, bent in zip(found.steps, 0.8 * creeping(found.times), strict=True):
        told, moment = state.along("m", 0.5), 0.8 * ramp(state.time)[0]
        assert told["bending_stress"][0] == pytest.approx(moment * 0.005 / (0.02 * 0.01**3 / 12.0), rel=1e-4, abs=1.0)
        assert told["bending_strain"][0] == pytest.approx(0.005 * bent, rel=1e-4, abs=1e-8)


# -- oscillation --------------------------------------------------------------------------------------


def exponent(stiffness, branches, near):
    """The exponent s of s^2 + stiffness (1 + sum k s tau / (1 + s tau)) = 0 near one without branches."""

    def missed(parts):
        s = complex(*parts)
        modulus = 1.0 + sum(k * s * b["time"] / (1.0 + s * b["time"]) for b, k in zip(branches, shares(branches)))
        value = s**2 + stiffness * modulus
        return [value.real, value.imag]

    return complex(*root(missed, [near.real, near.imag], tol=1e-12).x)


@pytest.mark.parametrize(
    ("dimension", "section", "waves", "accuracy"),
    [
        ("plane", {}, ((1.0, 1.875104068711961), (1.0, 4.694091132974175)), 1e-7),
        # Bending about axes between b2 and b3, with the eigenvalues of the stiffness.
        ("space", {"coupling": [0.0, 0.0, 0.2]}, ((0.8, 1.875104068711961), (1.2, 1.875104068711961)), 1e-7),
        # The stretch adds of the order of EI / (EA L^2).
        ("plane", {"EA": 1e8}, ((1.0, 1.875104068711961),), 1e-6),
    ],
)
def test_modes_have_the_complex_modulus(dimension, section, waves, accuracy):
    """Of a cantilever of L = rhoA = 1: s^2 = -beta^4 EI times the modulus at s over the long-term one."""
    analysis = {"type": "modes", "modes": len(waves), "accuracy": 1e-8}
    found = sfetcas.solve(strip(dimension, section=section, mass=1.0, analysis=analysis))
    for mode, (stiffness, beta) in zip(found.modes, waves, strict=True):
        s = exponent(stiffness * beta**4, BRANCHES, 1j * np.sqrt(stiffness) * beta**2)
        assert mode.omega == pytest.approx(s.imag, rel=accuracy)
        assert mode.damping == pytest.approx(-s.real / abs(s), rel=accuracy)


def test_a_short_strip_with_a_heavy_end_swings_with_the_complex_modulus():
    """Small motions of a mass at a cantilever, 3 EI / (m L^3): from their decay over some periods."""
    branches = [{"ratio": 0.3, "time": 0.4}]
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "mass": 1.0}}
    load = {"tip": {"type": "force", "node": "B", "value": [0.0, 1e-3]}}
    analysis = {"type": "dynamic", "end": 6.0, "output": 0.5, "step": 0.02, "initial": "equilibrium"}
    analysis["cut"] = ["tip"]
    section = {"relaxation": branches, "rhoA": 0.0}
    found = sfetcas.solve(
        strip(section=section, nodes=nodes, loads=load, analysis=analysis), element="SFET3", elements=1
    )

    def rates(_, state):
        y, v, left = state
        share = shares(branches)[0]
        return [v, -3.0 * (y + share * (y - left)), (y - left) / branches[0]["time"]]

    start = 1e-3 / 3.0
    exact = solve_ivp(rates, (0, 6), [start, 0.0, start], "DOP853", t_eval=found.times, rtol=1e-11, atol=1e-15).y[0]
    np.testing.assert_allclose(found.positions("B")[:, 1], exact, atol=1e-8)
    assert np.abs(exact[-3:]).max() < 0.4 * start


# -- energy and orders --------------------------------------------------------------------------------


TABLES = {
    "plane": pushed(FLAT | {"relaxation": BRANCHES}),
    "space": pushed(THICK | {"relaxation": BRANCHES}, (0.5, 1, 1.5)),
}


def test_what_is_lost_is_what_the_dampers_take():
    """After the load stays constant, the energy falls by the integral of tau |xi'|^2."""
    found = moved(TABLES["space"], 1.5, 1 / 32, element="SFET3", output=1 / 32)
    states = [state for state in found.steps if state.time >= 1.0]
    inertia = states[0].mover.inertia
    power, masses = [], inertia.system.masses
    for state in states:
        parts = [state.sample.v[a:b] for a, b in inertia.system.ranges]
        power.append(sum(float(g.damping.ravel() @ v**2) for g, v in zip(masses.observables, parts, strict=True)))
    unit = states[0].model.scales.moment / states[0].mover.time
    total = np.array([state.energy["total"] for state in states])
    lost = simpson(np.array(power) * unit, x=[state.time for state in states])
    assert total[0] - total[-1] == pytest.approx(lost, rel=1e-3)
    assert lost > 0.02 * total.max()


ORDERS = {"generalised-alpha": (2, 32), "conserving": (2, 32), "radau-2": (3, 32), "radau-3": (5, 16)}


@pytest.fixture(scope="module")
def exact_tip():
    return tip(moved(TABLES["plane"], 1.3, 1 / 200, element="SFET3"))


@pytest.mark.parametrize("integrator", ORDERS)
def test_orders_in_time_are_those_without_relaxation(integrator, exact_tip):
    expected, steps = ORDERS[integrator]
    ends = [tip(moved(TABLES["plane"], 1.3, 1 / (steps * k), integrator, element="SFET3")) for k in (1, 2)]
    errors = [np.abs(end - exact_tip).max() for end in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(expected, abs=0.25)


def test_fast_and_slow_branches_are_springs():
    """One that relaxes at once has the long-term stiffness, one that never does the instantaneous one."""
    found = [
        tip(moved(pushed(FLAT | section), 1.0, 1 / 32, "conserving", element="SFET3"))
        for section in (
            {"relaxation": [{"ratio": 0.3, "time": 1e-8}]},
            {},
            {"relaxation": [{"ratio": 0.3, "time": 1e8}]},
            {"EI3": 1.0 / 0.7},
        )
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-7)
    # The conserving scheme takes the moments of branches at the mean state of a step, to second order.
    np.testing.assert_allclose(found[2], found[3], atol=1e-5)


# -- the other analyses -------------------------------------------------------------------------------

TIP = {"tip": {"type": "force", "node": "B", "value": [0.5, 1.0]}}


def test_equilibria_have_the_long_term_stiffness_and_no_unknown_more():
    relaxed, plain = (sfetcas.solve(strip(section=s, loads=TIP)).last for s in ({}, {"relaxation": []}))
    assert relaxed.model.unknowns == plain.model.unknowns
    np.testing.assert_array_equal(relaxed.position("B"), plain.position("B"))


@pytest.mark.parametrize(("dimension", "turning"), [("plane", None), ("space", [0.0, 0.0, 2.0])])
def test_a_motion_that_begins_in_equilibrium_stays_there(dimension, turning):
    """Stretched, bent and coupled, at rest in fixed and in turning axes: everything has relaxed."""
    section = {"EA": 50.0, "GA2": 40.0, "GA3": 40.0, **({"coupling": [0.1, 0, 0]} if dimension == "space" else {})}
    analysis = {"type": "dynamic", "end": 0.4, "initial": "equilibrium", "step": 0.1, "output": 0.4, "accuracy": 1e-5}
    own = {"section": section, "mass": 1.0, "loads": TIP, "analysis": analysis}
    scene = strip(dimension, **own, **({"rotating": turning} if turning else {}))
    found = sfetcas.solve(scene, element="SFET3", elements=2)
    # The mesh of the motion has an equilibrium of its own, a little beside that of statics.
    np.testing.assert_allclose(found.velocities("B"), 0.0, atol=1e-4)
    if not turning:
        moment = np.cross(found.last.position("B"), [0.5, 1.0, 0.0])[2]
        assert found.last.reaction("A")[1][2] == pytest.approx(-moment, abs=1e-4)
        assert found.last.along("m", 0.0)["moment"][0, 2] == pytest.approx(moment, abs=1e-4)
    strains, curvatures = ([state.along("m", 0.4)[key][0] for state in found.steps] for key in ("strain", "curvature"))
    np.testing.assert_allclose(strains[1], strains[0], atol=1e-4)
    np.testing.assert_allclose(curvatures[1], curvatures[0], atol=1e-3)


def test_thrown_things_begin_relaxed():
    """A cantilever whose end is struck: the velocities bend it, and no branch relaxes yet."""
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "velocity": [0.0, 1.0]}}
    analysis = {"type": "dynamic", "end": 0.2, "step": 0.02, "output": 0.02}
    found = sfetcas.solve(strip(mass=1.0, nodes=nodes, analysis=analysis))
    first = found.steps[0]
    system = first.mover.inertia.system
    (_, (begin, end)) = zip(system.masses.observables, system.ranges, strict=True).__next__()
    np.testing.assert_allclose(first.sample.v[begin:end], 0.0, atol=1e-12)
    assert found.energies()[-1] < found.energies()[0]


def test_optimal_control():
    """A force brings a heavy end to rest somewhere; the integrator finds the same motion."""
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "mass": 1.0}}
    scene = strip(mass=0.02, loads=TIP, nodes=nodes).replace({"members.m.elements": 1, "members.m.element": "SFET3"})
    problem = sfetcas.OptimalControl(scene, {"loads.tip.value.1": (-9, 9)}, time=2.0, intervals=6, order=1)
    problem.minimise(problem.integral(problem.control("loads.tip.value.1") ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.position")[1]) == 0.3, name="there")
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.velocity")[1]) == 0.0, name="still")
    found = problem.solve()
    assert found.check.difference < 1e-3
    with pytest.raises(SceneError, match="rest_at_end: found members that relax, which come to rest in infinite time"):
        problem.rest_at_end()


@needs_compiler
def test_steps_in_c(tmp_path):
    """Time steps as a program in C, to the last bit, and the steps of the simulation; the ratio is an argument."""
    analysis = {"type": "dynamic", "end": 0.2, "integrator": "generalised-alpha", "step": 0.01, "output": 0.2}
    scene = strip(mass=1.0, loads=TIP, analysis=analysis)
    scene = scene.replace({"members.m.elements": 1, "members.m.element": "SFET3"})
    ratio = "sections.s.relaxation.0.ratio"
    made = time_step(scene, "motion", arguments=[ratio], results=["nodes.B.position"])
    state = made.begin
    for _ in range(20):
        state = made.step(state, 0.01)
    np.testing.assert_allclose(made.outputs(state), tip(sfetcas.solve(scene)), atol=1e-9)
    sfetcas.export(scene, tmp_path / "c", name="motion", arguments=[ratio])
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


# -- wrong input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("relaxation", "sentence"),
    [
        ([{"ratio": 0.6, "time": 1}, {"ratio": 0.4, "time": 2}], "relaxation: found ratios that add up to 1, accepted"),
        ([{"ratio": 0.6, "time": 0}], r"relaxation.0.time: found 0, accepted: a number above zero"),
        ({"ratio": 0.6, "time": 1}, r"accepted: a list of branches, as \{ratio = 0.3, time = 0.1\}"),
        ([{"ratio": 0.6}], r"relaxation.0: the key 'time' is missing"),
    ],
)
def test_wrong_branches(relaxation, sentence):
    with pytest.raises(SceneError, match=sentence):
        strip(section={"relaxation": relaxation})


def test_what_is_not_solved_is_refused():
    with pytest.raises(SceneError, match=r"sections.s.law: found a law beside 'relaxation', accepted: one of them"):
        strip(section={"law": {"type": "bilinear", "moment": 1.0, "ratio": 0.2}})
    with pytest.raises(SceneError, match=r"actuations.k.member: found the member 'm', whose section relaxes, accepted"):
        strip(actuations={"k": {"member": "m", "value": 0.4}})
    with pytest.raises(SceneError, match=r"tendons.t: found the member 'm', whose section relaxes, accepted: discs"):
        strip(tendons={"t": {"way": [{"member": "m", "offset": 0.1}], "tension": 1.0}})
    with pytest.raises(SceneError, match=r"members.m.section: found a section that relaxes of a small member"):
        strip(members={"m": {"nodes": ["A", "B"], "section": "s", "type": "small"}})
    with pytest.raises(SceneError, match="'idas', but what relaxes in members has no inertia of its own"):
        sfetcas.solve(strip(mass=1.0, loads=TIP, analysis={"type": "dynamic", "end": 1.0, "integrator": "idas"}))
    with pytest.raises(SceneError, match="motion_functions: found members that relax"):
        sfetcas.motion_functions(strip(mass=1.0, loads=TIP), ["loads.tip.value"])
