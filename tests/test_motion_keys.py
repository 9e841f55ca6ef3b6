"""Keys of modes and dynamics: what a scene needs for them, the sentence for what it may not have, and their files."""

import copy
import re

import pytest

import sfetcas
from sfetcas import Analysis, History, SceneError, Until
from sfetcas.description.scene import Scene, check_loaded
from sfetcas.description.sections import Polynomial

DYNAMIC = {"type": "dynamic", "end": 5.0}
SMOOTH = {"t": [0, 1], "polynomial": [[0, 0, 3, -2]]}
"""From 0 to 1, at rest at both ends."""


def table(changes=()):
    """A clamped strip with mass, and a hinge in its middle that something may drive, with values set by place."""
    values = {
        "sections": {"strip": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}, "light": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 1]}},
        "analysis": dict(DYNAMIC),
    }
    for place, value in copy.deepcopy(dict(changes)).items():
        *outer, key = place.split("/")
        inner = values
        for part in outer:
            inner = inner.setdefault(part, {})
        inner[key] = value
    return values


def made(changes=()):
    return Scene.from_dict(table(changes))


def refused(changes, message):
    with pytest.raises(SceneError, match=f"^{re.escape(message)}"):
        made(changes)


def of_type(kind, **keys):
    needed = {"path": {"range": [0, 1]}, "dynamic": {"end": 5.0}}
    return {"analysis": {"type": kind, **needed.get(kind, {}), **keys}}


# -- what is asked for ------------------------------------------------------------------------------------------

OWN = {
    "steps": ([0.5], "static path"),
    "range": ([0, 2], "path"),
    "points": (50, "path"),
    "branches": (1, "path"),
    "modes": (3, "modes path"),
    "end": (2.0, "dynamic"),
    "output": (0.1, "dynamic"),
    "step": (0.1, "dynamic"),
    "integrator": ("radau-3", "dynamic"),
    "initial": ("equilibrium", "dynamic"),
    "cut": ([], "dynamic"),
    "release": ([], "dynamic"),
    "until": ({"quantity": "energy.kinetic", "above": 1.0}, "dynamic"),
}


@pytest.mark.parametrize("kind", ["static", "path", "modes", "dynamic"])
@pytest.mark.parametrize("key", OWN)
def test_keys_belong_to_types(key, kind):
    value, types = OWN[key]
    if kind in types.split():
        assert key in made(of_type(kind, **{key: value})).analysis.model_fields_set
    else:
        accepted = " or ".join(map(repr, types.split()))
        refused(
            of_type(kind, **{key: value}),
            f"analysis.{key}: found type {kind!r}, accepted: type {accepted} with this key",
        )


@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha", "conserving", "idas"])
def test_integrators(integrator):
    assert made({"analysis/integrator": integrator}).analysis.integrator == integrator


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("type", "dynamics", "type: found 'dynamics', accepted: dynamic, modes, path, static; did you mean 'dynamic'?"),
        ("end", 0, "end: found 0, accepted: a number above zero"),
        ("output", 6, "output: found 6 s, accepted: up to the span of 5 s"),
        ("output", 1e-9, "output: found 1e-09 s, which gives 5e+09 answers, accepted: at most 1000000"),
        ("output", 0, "output: found 0, accepted: a number above zero"),
        ("step", 7, "step: found 7 s, accepted: up to the span of 5 s"),
        ("step", -1, "step: found -1, accepted: a number above zero"),
        ("integrator", "radau-4", "integrator: found 'radau-4', accepted: conserving, generalised-alpha, idas, radau"),
        ("initial", "rest", "initial: found 'rest', accepted: equilibrium, undeformed"),
        ("cut", ["tip"], "cut: found initial = 'undeformed', accepted: 'equilibrium' with this key"),
        ("release", ["A"], "release: found initial = 'undeformed', accepted: 'equilibrium' with this key"),
        ("cut", "tip", "cut: found 'tip', accepted: a list of names"),
        ("equilibria", "all", "equilibria: found 'all', accepted: 'one' with type 'dynamic'"),
        ("until", {"quantity": "factor"}, "until: accepted: either above or below, one of them"),
        ("until", {"quantity": "factor", "above": 1, "below": 0}, "until: accepted: either above or below"),
        ("until", {"above": 1}, "until: the key 'quantity' is missing"),
        (
            "until",
            {"quantity": "nodes.B.position", "component": 3, "above": 1},
            "until.component: found 3, accepted: a whole number from 0 to 2",
        ),
        (
            "until",
            {"quantity": "nodes.Q.position", "component": 0, "above": 1},
            "until.quantity: found 'Q', accepted: A, B",
        ),
    ],
)
def test_values_of_dynamics(key, value, sentence):
    refused({f"analysis/{key}": value}, f"analysis.{sentence}")


def test_a_span_is_needed_and_spacings_up_to_it_are_accepted():
    refused({"analysis": {"type": "dynamic"}}, "analysis: the key 'end' is missing: a motion is followed up to a time")
    for key in ("output", "step"):
        assert getattr(made({f"analysis/{key}": 5.0}).analysis, key) == made().analysis.duration == 5.0
    assert made({"analysis/output": 5e-6}).analysis.output == 5e-6


def test_what_acts_at_the_beginning_only():
    begun = {"analysis/initial": "equilibrium"}
    found = made({**begun, "analysis/cut": ["tip"], "analysis/release": ["A"]}).analysis
    assert (found.cut, found.release) == (("tip",), ("A",))
    refused({**begun, "analysis/cut": ["tp"]}, "analysis.cut: found 'tp', accepted: tip; did you mean 'tip'?")
    refused({**begun, "analysis/release": ["C"]}, "analysis.release: found 'C', accepted: A, B")
    refused(
        {**begun, "analysis/release": ["B"]},
        "analysis.release: found 'B', which is free, accepted: a node with a support",
    )


def test_an_end_before_its_time():
    found = made({"analysis/until": {"quantity": "nodes.B.position", "component": 1, "below": -0.5}}).analysis.until
    assert found == Until(quantity="nodes.B.position", component=1, below=-0.5)


def test_how_many_modes():
    assert made(of_type("modes")).analysis.count_of_modes == 8
    assert made(of_type("modes", modes=3)).analysis.count_of_modes == 3
    assert made(of_type("path", modes=2)).analysis.count_of_modes == 2
    assert [made(of_type(kind)).analysis.count_of_modes for kind in ("path", "static", "dynamic")] == [0, 0, 0]
    refused(of_type("modes", modes=0), "analysis.modes: found 0, accepted: a whole number from 1 to 100000")
    refused(of_type("modes", modes=1.5), "analysis.modes: found 1.5, accepted: a whole number from 1 to 100000")
    refused(of_type("modes", equilibria="all"), "analysis.equilibria: found 'all', accepted: 'one' with type 'modes'")
    assert made(of_type("modes", unstable="stay")).analysis.unstable == "stay"


EXPECTED = {"quantity": "nodes.B.position", "value": 1}


@pytest.mark.parametrize(
    ("kind", "key", "value", "accepted"),
    [
        ("static", "time", 1.0, "'dynamic'"),
        ("path", "time", 1.0, "'dynamic'"),
        ("dynamic", "step", 1.0, "'static' or 'path' or 'modes'"),
        ("dynamic", "limit_point", 1, "'path'"),
        ("static", "flutter_point", 1, "'path'"),
        ("modes", "flutter_point", 1, "'path'"),
    ],
)
def test_answers_that_an_analysis_does_not_have(kind, key, value, accepted):
    changes = {**of_type(kind), "expect": [{**EXPECTED, key: value}]}
    refused(changes, f"expect.0.{key}: found the analysis {kind!r}, accepted: {accepted} with this key")


def test_answers_at_times_and_flutter_points():
    for time in (0.0, 2.5, 5.0):
        assert made({"expect": [{**EXPECTED, "time": time}]}).expect[0].time == time
    for time in (-0.1, 5.1):
        refused(
            {"expect": [{**EXPECTED, "time": time}]},
            f"expect.0.time: found {time} s, accepted: from 0 to the end of the analysis at 5 s",
        )
    assert made({**of_type("path"), "expect": [{**EXPECTED, "flutter_point": 2}]}).expect[0].flutter_point == 2
    assert made({**of_type("modes"), "expect": [{**EXPECTED, "step": 1}]}).expect[0].step == 1.0
    refused(
        {"expect": [{**EXPECTED, "time": 1, "flutter_point": 1}]},
        "expect.0: accepted: one of the keys step, time, limit_point, bifurcation, flutter_point, transition",
    )


# -- masses -----------------------------------------------------------------------------------------------------

LIGHT = {"members/beam/section": "light"}
SMALL = [[float(12 * (i == j)) for j in range(12)] for i in range(12)]
MOVING = [of_type("modes"), of_type("dynamic"), of_type("path", modes=2)]


@pytest.mark.parametrize("analysis", MOVING)
def test_what_moves_has_mass(analysis):
    assert made(analysis)
    refused({**analysis, **LIGHT}, "sections.light: the key 'rhoA' is missing: members.beam moves")
    refused(
        {**analysis, **LIGHT, "members/beam/type": "small"},
        "sections.light: the key 'rhoA' is missing: members.beam moves",
    )
    outlined = {"shape": "circle", "radius": 0.01, "E": 1e9}
    refused(
        {**analysis, "sections/light": outlined, **LIGHT},
        "sections.light: the key 'rho' is missing: members.beam moves",
    )


def test_what_rests_needs_none():
    assert made({**of_type("path"), **LIGHT})
    assert made({**of_type("static"), **LIGHT})


def body(**more):
    """A small member with a spring between its ends, which rigid motions do not strain."""
    stiffness = [[0.0] * 12 for _ in range(12)]
    for i in range(3, 6):
        stiffness[i][i] = stiffness[i + 6][i + 6] = 1.0
        stiffness[i][i + 6] = stiffness[i + 6][i] = -1.0
    return {"members/beam": {"nodes": ["A", "B"], "type": "small", "stiffness": stiffness, **more}}


@pytest.mark.parametrize("analysis", MOVING)
def test_a_condensed_member_has_its_own_mass(analysis):
    refused({**analysis, **body()}, "members.beam: the key 'mass' is missing: the member moves")
    assert made({**analysis, **body(mass=SMALL)})
    assert made({**of_type("static"), **body()})


@pytest.mark.parametrize("analysis", [*MOVING, {**of_type("static"), "rotating": [0, 0, 1]}])
def test_something_has_mass(analysis):
    rigid = {**analysis, "members/beam": {"nodes": ["A", "B"], "type": "rigid"}}
    refused(
        rigid,
        "scene without mass, which could not be set in motion, accepted: at least a section with 'rhoA', a node with "
        "'mass' or 'inertia', or a small member with 'mass'",
    )
    assert made({**rigid, "nodes/B/mass": 1.0})
    assert made({**rigid, "nodes/B/inertia": [0, 0, 1.0]})
    assert made({**rigid, "members/beam/section": "strip"})


def test_turning_axes_need_masses():
    turning = {**of_type("static"), "rotating": [0, 0, 3.5]}
    assert made(turning).rotating == (0.0, 0.0, 3.5)
    refused({**turning, **LIGHT}, "sections.light: the key 'rhoA' is missing: turning axes act on the mass per length")
    refused({**turning, **body()}, "members.beam: the key 'mass' is missing: turning axes act on the member")
    assert made({**turning, "analysis": DYNAMIC})
    refused({"rotating": 3.5}, "rotating: found 3.5, accepted: [x, y] or [x, y, z]")


def test_axes_that_turn_out_of_the_plane_make_a_scene_spatial():
    found = made({"rotating": [0, 1, 0]})
    assert (found.resolved_dimension, found.dimension_reason) == ("space", "rotating is not along z")
    refused({"rotating": [0, 1, 0], "dimension": "plane"}, "rotating: dimension is set to 'plane', but rotating is not")
    assert made({"rotating": [0, 0, 1]}).resolved_dimension == "plane"


def test_turning_axes_are_a_load_and_what_moves_needs_none():
    check_loaded(made({**of_type("static"), "rotating": [0, 0, 1], "loads": {}}))
    check_loaded(made({**of_type("modes"), "loads": {}}))
    check_loaded(made({"loads": {}}))
    with pytest.raises(SceneError, match=r"^scene without load: "):
        check_loaded(made({**of_type("path", modes=2), "loads": {}}))


def test_inertia_is_of_three_numbers_at_a_node_that_turns():
    assert made({"nodes/B/inertia": [0, 0, 1]}).nodes["B"].inertia == (0.0, 0.0, 1.0)
    accepted = "accepted: three numbers of zero or above, about x, y and z"
    refused({"nodes/B/inertia": [1, 2]}, f"nodes.B.inertia: found [1.0, 2.0], {accepted}")
    refused({"nodes/B/inertia": [0, 0, -1]}, f"nodes.B.inertia: found [0.0, 0.0, -1.0], {accepted}")
    refused({"nodes/B/inertia": 1.0}, f"nodes.B.inertia: found 1.0, {accepted}")
    refused(
        {"nodes/B/inertia": [0, 0, 1], "nodes/B/joint": "hinge"},
        "nodes.B.inertia: the node has no rotation of its own, as its joint is a hinge",
    )


# -- what moves is not stopped, and need not be held ------------------------------------------------------------

FLOOR = {"contacts/floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "members": "all"}}
STOPPED = {"springs/k": {"node": "A", "stiffness": 1.0, "stop": [-1, 1]}}


def test_obstacles_are_refused():
    refused(
        {**of_type("path"), "analysis/modes": 1, **FLOOR},
        "contacts.floor: found an obstacle with analysis.modes on a path, accepted: with 'static', 'modes', 'dynamic', "
        "or 'path' without modes",
    )
    assert made({**of_type("modes"), **FLOOR})
    assert made({**of_type("static"), **FLOOR, **STOPPED})
    assert made({**of_type("dynamic"), **FLOOR, **STOPPED})
    assert made({**of_type("modes"), "springs/k": {"node": "A", "stiffness": 1.0}})


@pytest.mark.parametrize("kind", ["modes", "dynamic"])
def test_stops_are_accepted(kind):
    assert made({**of_type(kind), **STOPPED})


def test_structures_may_float_where_no_equilibrium_is_asked_for():
    loose = {"nodes/A/support": "free"}
    assert made({**of_type("modes"), **loose})
    assert made({**of_type("dynamic"), **loose})
    for analysis in (of_type("static"), of_type("path", modes=2), of_type("dynamic", initial="equilibrium")):
        refused({**analysis, **loose}, "free to move: nodes A, B moving along x, y and turning; ")


# -- damping and drag -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "place", ["nodes/B/drag", "sections/strip/drag", "sections/strip/damping", "springs/k/damping"]
)
def test_damping_and_drag_are_not_negative(place):
    spring = {"springs/k": {"node": "A", "stiffness": 1.0}}
    kind, name, key = place.split("/")
    assert getattr(getattr(made({**spring, place: 0.5}), kind)[name], key) == 0.5
    assert getattr(getattr(made(spring), kind)[name], key) == 0.0
    where = place.replace("/", ".")
    refused({**spring, place: -0.5}, f"{where}: found -0.5, accepted: zero or a number above zero")
    refused({**spring, place: "some"}, f"{where}: found 'some', accepted: a number")


def test_damping_alone_is_no_section():
    refused({"sections/strip": {"damping": 1.0}}, "sections.strip: found nothing in it")


# -- velocities -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["static", "path", "modes"])
@pytest.mark.parametrize(("place", "value"), [("nodes/B/velocity", [0, 1]), ("members/beam/spin", 1.0)])
def test_velocities_belong_to_dynamics(kind, place, value):
    where = place.replace("/", ".")
    refused({**of_type(kind), place: value}, f"{where}: found the analysis {kind!r}, accepted: 'dynamic' with this key")
    assert made({place: value})


def test_spins_in_the_plane():
    for spin in (2, {"polynomial": [1, 2]}, {"at": [0, 1], "value": [0, 2]}, [0, 0, 2]):
        found = made({"members/beam/spin": spin})
        assert found.resolved_dimension == "plane"
        assert Scene.from_dict(found.to_dict()) == found
    assert made({"members/beam/spin": {"polynomial": [1]}}).members["beam"].spin == Polynomial(polynomial=[1])
    refused({"members/beam/spin": "fast"}, "members.beam.spin: found 'fast', in which 'fast' has no meaning, accepted:")
    refused({"members/beam/spin": {"at": [0, 2], "value": [0, 1]}}, "members.beam.spin.at: found 0 to 2, accepted:")


def test_spins_and_velocities_in_space():
    for place, value, reason in (
        ("members/beam/spin", [1, 0, 0], "members.beam.spin is not about z"),
        ("nodes/B/velocity", [0, 0, 1], "nodes.B.velocity has a z component"),
    ):
        found = made({place: value})
        assert (found.resolved_dimension, found.dimension_reason) == ("space", reason)
    space = "the scene is in space (dimension is set to 'space')"
    for spin, said in ((2.0, "2.0"), ({"polynomial": [1.0]}, "{'polynomial': [1.0]}")):
        refused(
            {"dimension": "space", "members/beam/spin": spin},
            f"members.beam.spin: found {said}, accepted: a vector [x, y, z], as {space}",
        )
    assert made({"dimension": "space", "members/beam/spin": [0, 0, 1]}).members["beam"].spin == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("support", ["clamped", "hinge"])
def test_what_the_ground_holds_has_no_velocity(support):
    held = {"nodes/A/support": support, "nodes/A/velocity": [1, 0]}
    refused(held, f"nodes.A.velocity: found [1.0, 0.0, 0.0], accepted: zero, as the support is {support!r}")
    assert made({**held, "nodes/A/velocity": [0, 0]})
    moved = {"histories/h": {**SMOOTH, "polynomial": [[0, 1]], "t": [0, 5]}, **motion(displacement=[5, 0])}
    assert made({**held, **moved})


def test_what_slides_may_have_a_velocity():
    assert made({"nodes/A": {"position": [0, 0], "support": "slider", "direction": [1, 0], "velocity": [1, 0]}})


# -- histories of motions ---------------------------------------------------------------------------------------


def motion(**keys):
    return {"motions/crank": {"node": "A", "rotation": 0.5, "history": "h", **keys}}


def driven(history, **changes):
    return {**motion(), "histories/h": history, **changes}


def test_motions_that_begin_and_end_at_rest():
    assert made(driven(SMOOTH))
    halves = {"t": [0, 0.5, 1], "polynomial": [[0, 0, 0.5], [0.5, 1, -0.5]]}
    assert made(driven(halves))
    assert made(driven({"t": [1, 2], "polynomial": [[0, 0, 3, -2]]}))
    # Jumps after the end, before the beginning and of what rests are of no account.
    assert made(driven({"t": [0, 10], "polynomial": [[0, 0, 1]]}))
    assert made(driven({"t": [0, 5], "polynomial": [[0, 0, 1]]}))
    assert made(driven({"t": [-3, -2, -1], "value": [0, 1, 0]}))
    assert made({**driven({"t": [0, 1, 2], "value": [1, 3, 0]}), **motion(rotation=0.0, displacement=[0, 0])})


@pytest.mark.parametrize(
    ("history", "sentence"),
    [
        (
            {"t": [0, 1], "polynomial": [[0, 0, 1]]},
            "ends at 1 s with a rate of 2 1/s, so that the motion 'crank' would stop with a jump, accepted: a history "
            "until the end of the analysis at 5 s or one that ends at rest",
        ),
        (
            {"t": [0, 1, 2], "polynomial": [[0, 0, 3, -2], [1.3]]},
            "jumps by 0.3 at t = 1 s, so that the motion 'crank' would jump too, accepted: intervals whose values meet",
        ),
        (
            {"t": [0, 1, 5], "polynomial": [[0, 0, 1], [1, 2]]},
            "its rate jumps by -1.5 1/s at t = 1 s, so that the velocity of the motion 'crank' would jump, accepted: "
            "intervals whose rates meet, as polynomials can",
        ),
        ({"t": [0, 1, 2, 5], "value": [0, 0, 1, 1]}, "its rate jumps by 1 1/s at t = 1 s, so that the velocity"),
        ({"t": [1, 6], "value": [0, 1]}, "its rate jumps by 0.2 1/s at t = 1 s, so that the velocity"),
        (
            {"t": [0, 5], "value": [0, 1]},
            "begins with a rate of 0.2 1/s, so that the motion 'crank' would start with a jump, accepted: a history "
            "that begins at rest, as with interpolation = 'spline', or a scene that begins with velocities",
        ),
        (
            {"t": [0, 5], "polynomial": [[0, 1]]},
            "begins with a rate of 0.2 1/s, so that the motion 'crank' would start with a jump, accepted: a history "
            "that begins at rest, or a scene that begins with velocities",
        ),
        ({"t": [-1, 5], "polynomial": [[0, 0, 1, -1]]}, "begins with 0.0231481, so that the motion 'crank' would jump"),
        (
            {"t": [0], "value": [1]},
            "begins with 1, so that the motion 'crank' would jump at t = 0, accepted: a history that begins with 0, or "
            "initial = 'equilibrium'",
        ),
    ],
)
def test_motions_that_would_jump(history, sentence):
    refused(driven(history), f"histories.h: {sentence}")
    # Loads may: they need no velocity. Statics and paths know no time.
    assert made({"loads/tip/history": "h", "histories/h": history})
    assert made(driven(history, **of_type("static")))


def test_displacements_and_driven_joints_are_judged_as_rotations_are():
    jumping = {"t": [0, 5], "value": [0, 1]}
    refused({**driven(jumping), **motion(rotation=None, displacement=[1, 0])}, "histories.h: begins with a rate")
    joined = {
        "nodes/B/joint": "hinge",
        "nodes/C": {"position": [2, 0]},
        "members/more": {"nodes": ["B", "C"], "section": "strip"},
    }
    between = motion(node="B", between=["beam", "more"])
    refused({**joined, **driven(jumping), **between}, "histories.h: begins with a rate")
    assert made({**joined, **driven(SMOOTH), **between})


def test_a_motion_from_an_equilibrium_may_begin_anywhere_but_at_rest():
    begun = {"analysis/initial": "equilibrium"}
    constant = {"motions/crank": {"node": "A", "rotation": 0.5}}
    refused(
        constant,
        "motions.crank: the key 'history' is missing: without one the motion would jump at t = 0, accepted: a history "
        "that begins with 0, or initial = 'equilibrium'",
    )
    assert made({**constant, **begun})
    assert made({**driven({"t": [0, 1], "polynomial": [[1, 0, -3, 2]]}), **begun})
    refused({**driven({"t": [0, 5], "value": [0, 1]}), **begun}, "histories.h: begins with a rate of 0.2 1/s, so that")


def test_a_motion_of_a_scene_that_moves_may_begin_with_a_rate():
    assert made({**driven({"t": [0, 5], "value": [0, 1]}), "members/beam/spin": 0.1})
    assert made({**driven({"t": [0, 5], "value": [0, 1]}), "nodes/B/velocity": [0, 0.1]})
    for still in (0.0, {"polynomial": [0, 0]}, {"at": [0, 1], "value": [0, 0]}, [0, 0, 0]):
        begun = {"members/beam/spin": still, "nodes/B/velocity": [0, 0]}
        refused({**driven({"t": [0, 5], "value": [0, 1]}), **begun}, "histories.h: begins with a rate of 0.2 1/s")
    for spin in ({"polynomial": [0, 1]}, {"at": [0, 1], "value": [0, 1]}, [0, 0, 1]):
        assert made({**driven({"t": [0, 5], "value": [0, 1]}), "members/beam/spin": spin})


def test_a_motion_is_at_rest_but_for_rounding():
    """At t = 0, within the interval, value and rate are sums that vanish but for rounding."""
    x, a = 0.4 / (0.4 + 0.7), 0.7
    history = {"t": [-0.4, 0.7], "polynomial": [[-a * x**3, 3 * a * x * x, -3 * a * x, a]]}
    found = made({**driven(history), "analysis/end": 0.7}).histories["h"]
    assert 0.0 < abs(found.factor(0.0)) < 1e-14
    assert 0.0 < abs(found.rate(0.0)) < 1e-14


def test_a_motion_of_what_is_released_ends_with_it():
    released = {"analysis/initial": "equilibrium", "analysis/release": ["A"]}
    assert made({**driven({"t": [0, 5], "value": [0, 1]}), **released})


def test_rates_of_histories():
    linear = History(t=[0, 1, 3], value=[1, 2, 0])
    assert [linear.rate(t) for t in (-1, 0, 0.5, 1, 2, 3, 4)] == [0, 1, 1, -1, -1, 0, 0]
    assert [linear.rate(t, -1) for t in (-1, 0, 0.5, 1, 2, 3, 4)] == [0, 0, 1, 1, -1, -1, 0]
    cubic = History(t=[0, 2, 3], polynomial=[[0, 0, 1], [4, -1]])
    assert [cubic.rate(t) for t in (0, 1, 2, 2.5)] == [0, 0.5, -1, -1]
    assert cubic.rate(2, -1) == 1.0
    assert History(t=[1], value=[5]).rate(1) == History(t=[1], value=[5]).rate(0, -1) == 0.0


def test_jumps_of_histories():
    assert list(History(t=[0, 1, 3], value=[1, 2, 0]).jumps()) == [(0, 0, 1), (1, 0, -2), (3, 0, 1)]
    assert list(History(t=[0, 2, 3], polynomial=[[0, 0, 1], [4, -1]]).jumps()) == [(2, 3, -2), (3, 0, 1)]
    assert list(History(**SMOOTH).jumps()) == list(History(t=[1], value=[5]).jumps()) == []
    # The intervals of one third and two thirds meet but for the rounding of their coefficients.
    third = 1.0 / 3.0
    sliced = [[0, 0, third**2], [third**2, 4 * third**2, 4 * third**2]]
    assert [t for t, *_ in History(t=[0, third, 1], polynomial=sliced).jumps()] == [1.0]


# -- files ------------------------------------------------------------------------------------------------------

RICH = {
    "rotating": [0, 0, 2],
    "nodes/B/velocity": [0, 0.5],
    "nodes/B/drag": 0.1,
    "nodes/B/mass": 1.0,
    "nodes/B/inertia": [0, 0, 0.1],
    "members/beam/spin": {"polynomial": [0, 1]},
    "sections/strip/damping": 0.01,
    "sections/strip/drag": 0.2,
    "springs/k": {"node": "A", "stiffness": 1.0, "damping": 0.3},
    **driven(SMOOTH),
    "analysis": {
        **DYNAMIC,
        "output": 0.5,
        "step": 0.01,
        "integrator": "generalised-alpha",
        "initial": "equilibrium",
        "cut": ["tip"],
        "release": ["A"],
        "until": {"quantity": "nodes.B.position", "component": 1, "below": -0.5},
    },
    "expect": [{**EXPECTED, "time": 0.25}],
}


@pytest.mark.parametrize("ending", ["toml", "json"])
@pytest.mark.parametrize(
    "changes",
    [RICH, of_type("modes", modes=3), {**of_type("path", modes=3), "expect": [{**EXPECTED, "flutter_point": 1}]}],
)
def test_round_trip_through_a_file(tmp_path, ending, changes):
    found = made(changes)
    path = tmp_path / f"scene.{ending}"
    sfetcas.dump(found, path)
    assert sfetcas.load(path) == found
    assert {"type", *changes.get("analysis", {})} <= found.to_dict()["analysis"].keys()


def test_python_words_are_the_words_of_the_file():
    until = Until(quantity="nodes.B.position", component=1, below=-0.5)
    spoken = {**RICH["analysis"], "until": until}
    assert Analysis(**spoken) == made(RICH).analysis
