"""Loads without potential: followers and moments in space."""

import copy

import numpy as np
import pytest
from scenes import SOFT, UNLIKE, cantilever, gauss_points, made, model_of
from systems import EVERYTHING, FOLLOWING, following, following_space
from test_equations import full, trial, unit

import sfetcas
from sfetcas import SceneError, equilibrium_nlp
from sfetcas.equilibria.statics import solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics.fields import Fields


def answer(table, elements=4, order=6, **options):
    return solve_model(model_of(table, elements, order, **options))


def solved(table, **options):
    return sfetcas.solve(made(table), accuracy=1e-8, **options).last


@pytest.mark.parametrize("assembly", ["closing", "nodal"])
@pytest.mark.parametrize("name", EVERYTHING)
def test_matrix_is_the_derivative_with_its_skew_part(name, assembly):
    """The derivative by successive rotations is the matrix less half the commutator of the moment at each node."""
    equations, loading, state = trial(name, assembly)
    point, total, h = equations.at(state, loading), equations.total, 1e-3
    derivative = np.zeros((total, total))
    for i in range(total):
        r = [equations.at(equations.moved(state, k * h * unit(i, total)), loading).residual for k in (-2, -1, 1, 2)]
        derivative[:, i] = (r[0] - 8 * r[1] + 8 * r[2] - r[3]) / (12 * h)
    if equations.model.space:
        for numbers in equations.number[(equations.number >= 0).all(axis=1)]:
            x, y, z = point.residual[numbers]
            derivative[np.ix_(numbers, numbers)] += 0.5 * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = full(equations, point)
    # h^4 = 1e-12 of the fifth derivative.
    np.testing.assert_allclose(derivative, matrix, atol=2e-9 * max(1.0, np.abs(matrix).max()))
    if name in FOLLOWING:
        assert np.abs(matrix - matrix.T).max() > 0.1, "the loads have no potential"


# -- follower forces ------------------------------------------------------------------------------------------

ELLIPTIC = {
    # F L^2/EI: x, y, theta of the tip, moment at the root; Jacobi functions, cf. Shvartsman 2007
    1.0: (0.935645669480693, 0.320641994675014, 0.495884642422655, 0.975510043969534),
    5.0: (0.172277875399106, 0.780690142778105, 2.09815723994098, 2.93962278316855),
    10.0: (-0.0921231811893664, 0.546983264593714, 2.99271481623538, 1.72237322696258),
    30.0: (0.476141237130961, -0.201690840109248, 1.69085771110615, -7.71803583380646),
    60.0: (0.0662863271039502, -0.435312194898782, 0.0543351416521104, 2.55284335413646),
}


def pushed(space=False):
    table = cantilever((0.0, 1.0))
    table["loads"]["tip"]["frame"] = "follower"
    return table | ({"dimension": "space"} if space else {})


@pytest.mark.parametrize("space", [False, True])
def test_follower_force_against_elliptic_functions(space):
    table = pushed(space) | {"analysis": {"steps": list(ELLIPTIC), "accuracy": 1e-8}}
    for step, (x, y, theta, moment) in zip(sfetcas.solve(made(table)).steps, ELLIPTIC.values(), strict=True):
        # The accuracy asked for, times ten for angles and a hundred for moments of this size.
        np.testing.assert_allclose(step.position("B"), [x, y, 0], atol=1e-8)
        q = step.quaternion("B")
        assert np.cos(2 * np.arctan2(q[3], q[0]) - theta) == pytest.approx(1.0, abs=1e-14)
        assert step.reaction("A")[1][2] == pytest.approx(-moment, abs=1e-6)
        assert step.certificate.stable == "not defined"
        assert any("without potential" in note for note in step.notes)


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_order_of_convergence_under_a_follower(order, space):
    """2p, as under dead forces."""
    x, y, *_ = ELLIPTIC[5.0]
    errors = []
    for elements in (8, 16):
        prepared = sfetcas.Prepared(model_of(pushed(space), elements, order))
        errors.append(np.linalg.norm(followed(prepared, 5.0).position("B")[:2] - [x, y]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * order, abs=0.35)


def followed(prepared, factor, parts=10):
    """The answer on one mesh by Newton's method in steps from zero."""
    state = prepared.equations.start(prepared.model.loading(0.0))
    for part in np.linspace(0, factor, parts + 1)[1:]:
        found = prepared.correct(state, prepared.model.loading(part), iterations=30)
        assert found.converged
        state = found.state
    return Fields(prepared.equations, state, prepared.model.loading(factor))


def carried_cantilever(along, across, steps=4000):
    """Tip and root of a cantilever under a follower load per length: integrated from the tip in its own frame.

    From the tip nothing is unknown: n' = kappa q - along, q' = -kappa n - across, m' = -q; classical Runge-Kutta.
    """

    def slope(y):
        n, q, m, theta, _, _ = y
        return np.array([m * q - along, -m * n - across, -q, m, np.cos(theta), np.sin(theta)])

    y, h = np.zeros(6), -1.0 / steps
    for _ in range(steps):
        k1 = slope(y)
        k2 = slope(y + 0.5 * h * k1)
        k3 = slope(y + 0.5 * h * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + h * k3))
    turn = -y[3]
    c, s = np.cos(turn), np.sin(turn)
    tip = np.array([[c, -s], [s, c]]) @ -y[4:]
    return tip, turn, y[:3]


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("value", [(0.0, 2.0), (0.0, 12.0), (-3.0, 4.0)])
def test_follower_load_along_a_cantilever(value, space):
    table = pushed(space)
    table["loads"] = {"p": {"type": "distributed", "member": "m", "value": list(value), "frame": "follower"}}
    step = solved(table)
    tip, turn, (n, q, m) = carried_cantilever(*value)
    np.testing.assert_allclose(step.position("B")[:2], tip, atol=2e-8)
    if not space:
        assert step.angle("B") == pytest.approx(turn, abs=1e-7)
    np.testing.assert_allclose(step.reaction("A")[0], [-n, -q, 0], atol=2e-6)
    assert step.reaction("A")[1][2] == pytest.approx(-m, abs=2e-6)


def dead(table, step):
    """The scene with every follower force put to the direction it has in an answer, and dead."""
    table = copy.deepcopy(table)
    for name, load in table["loads"].items():
        if load.get("frame") != "follower":
            continue
        q = step.quaternion(load["node"]) if "node" in load else step.along(load["member"], load["at"])["quaternion"][0]
        vector = quat.rotate(q, np.pad(load["value"], (0, 3 - len(load["value"]))))
        table["loads"][name] = {**load, "value": vector.tolist(), "frame": "fixed"}
    return table


@pytest.mark.parametrize("scene", [following, following_space])
def test_follower_is_the_dead_force_of_its_last_direction(scene):
    table = scene()
    table["loads"] = {n: load for n, load in table["loads"].items() if load["type"] != "distributed"}
    one = solved(table)
    two = solved(dead(table, one))
    for node in one.model.nodes:
        # Two meshes, each right to 1e-8.
        np.testing.assert_allclose(two.position(node), one.position(node), atol=5e-8)
    np.testing.assert_allclose(two.reaction("A"), one.reaction("A"), atol=1e-5)
    assert one.certificate.stable == "not defined"


def slack():
    """A bar hung by a ball from a clamped one, a follower at its end: without loads it has no place of its own."""
    return {
        "dimension": "space",
        "gravity": [0, 0, -1],
        "sections": {"s": {**UNLIKE, "rhoA": 0.5}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0, 0.1], "joint": "ball"},
            "C": {"position": [1.7, 0.2, 0]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "s"}},
        "springs": {
            "k": {"type": "translational", "node": "C", "stiffness": 2.0, "anchor": [1.7, 1.2, 0.3], "length": 0.5}
        },
        "loads": {"F": {"type": "force", "node": "C", "value": [0.3, 0.2, 0.1], "frame": "follower"}},
    }


def test_what_hangs_slack_goes_where_its_followers_carry_it():
    """There the follower may be dead: that scene has an energy, and the same state is a minimum of it."""
    one = solved(slack())
    two = solved(dead(slack(), one))
    assert one.certificate.stable == "not defined"
    for node in one.model.nodes:
        np.testing.assert_allclose(two.position(node), one.position(node), atol=5e-8)  # two meshes, each to 1e-8


@pytest.mark.parametrize("height", [-0.9, 0.5, 0.99])
def test_followers_do_not_put_a_pendulum_upside_down(height):
    """A unit mass under a follower of a tenth of its weight: it hangs aside, from wherever it begins."""
    beside = float(np.sqrt(1.0 - height**2))
    table = {
        "gravity": [0, -1],
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [beside, height], "mass": 1.0},
        },
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 0.1], "frame": "follower"}},
    }
    # The lever of the follower is that of the undeformed scene; rigid: right to rounding, what Newton's method leaves.
    aside = 0.1 * beside
    np.testing.assert_allclose(solved(table).position("B"), [aside, -np.sqrt(1.0 - aside**2), 0.0], atol=1e-12)


@pytest.mark.parametrize(("dead", "diverged"), [(2.4, False), (2.5, True)])
def test_a_column_beyond_divergence_is_told_as_such(dead, diverged):
    """A dead force beyond pi^2/4 = 2.467 beside next to nothing that follows."""
    table = cantilever((-dead, 0.0))
    table["loads"]["follows"] = {"type": "force", "node": "B", "value": [-1e-6, 0.0], "frame": "follower"}
    told = " ".join(solved(table).notes)
    assert ("real eigenvalues of the static tangent are below zero" in told) is diverged
    assert ("the static tangent is regular all the way" in told) is not diverged


def test_spins_that_next_to_nothing_resists_are_found():
    """Bars between balls on springs: IPOPT creeps along the valley of their spins, and forces balance all the same."""
    rng = np.random.default_rng(3)
    places = {"b": [1, 0, 0], "c": [1.4, 0.1, 0.2], "d": [1.9, 0, 0]}
    springs = {}
    for name, place in places.items():
        stiffness = float(rng.uniform(1, 4))
        anchor = (np.array(place) + rng.uniform(-1, 1, 3)).tolist()
        springs[name] = {"type": "translational", "node": name, "stiffness": stiffness, "anchor": anchor, "length": 1.0}
    table = {
        "dimension": "space",
        "gravity": [0, 0, -1],
        "sections": {"s": {"EI2": 1.3, "EI3": 0.7, "GJ": 1.55, "rhoA": 0.1}},
        "nodes": {
            "a": {"position": [0, 0, 0], "support": "clamped"},
            **{n: {"position": p} for n, p in places.items()},
        },
        "members": {p + q: {"nodes": [p, q], "section": "s"} for p, q in ("ab", "bc", "cd")},
        "springs": springs,
        "loads": {n: {"type": "force", "node": n, "value": rng.uniform(-1, 1, 3).tolist()} for n in ("d", "c")},
    }
    for name in "bc":
        table["nodes"][name]["joint"] = "ball"
    step = solved(table)
    assert step.certificate.stable is True
    assert step.certificate.residual < 1e-9
    total = step.reaction("a")[0] + sum(np.array(load["value"]) for load in table["loads"].values())
    for name, spring in springs.items():
        pull = np.array(spring["anchor"]) - step.position(name)
        total = total + spring["stiffness"] * pull * (1.0 - spring["length"] / np.linalg.norm(pull))
    course = [[0, 0, 0], *places.values()]
    length = sum(np.linalg.norm(np.subtract(p, q)) for p, q in zip(course, course[1:]))
    np.testing.assert_allclose(total, [0.0, 0.0, 0.1 * length], atol=1e-7)  # ten times the accuracy of positions


def test_follower_where_two_members_meet_and_inside_a_member_are_one():
    inside = pushed()
    inside["loads"] = {"f": {"type": "force", "member": "m", "at": 0.5, "value": [1.0, 4.0], "frame": "follower"}}
    split = pushed()
    split["nodes"]["M"] = {"position": [0.5, 0]}
    split["members"] = {"a": {"nodes": ["A", "M"], "section": "s"}, "b": {"nodes": ["M", "B"], "section": "s"}}
    split["loads"] = {"f": {"type": "force", "node": "M", "value": [1.0, 4.0], "frame": "follower"}}
    one, two = solved(inside), solved(split)
    np.testing.assert_allclose(one.position("B"), two.position("B"), atol=5e-8)
    np.testing.assert_allclose(one.along("m", 0.5)["position"][0], two.position("M"), atol=5e-8)


def test_followers_on_a_rigid_rod_turn_it_in_proportion():
    """About the hinge a follower has a constant moment: F L/2, w L^2/2 and F L over the stiffness of the spring."""
    for load, moment in (
        ({"type": "force", "member": "rod", "at": 0.5, "value": [0, 1.2]}, 1.2),
        ({"type": "force", "node": "B", "value": [0.4, 0.7]}, 1.4),
        ({"type": "distributed", "member": "rod", "value": [0.3, 0.8]}, 1.6),
    ):
        table = {
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [2, 0]}},
            "members": {"rod": {"nodes": ["A", "B"], "type": "rigid"}},
            "springs": {"k": {"node": "A", "stiffness": 0.5}},
            "loads": {"f": {**load, "frame": "follower"}},
        }
        step = solved(table)
        assert step.angle("A") == pytest.approx(moment / 0.5, abs=1e-10)
        table["dimension"] = "space"
        table["springs"]["k"]["stiffness"] = 2.0
        q = solved(table).quaternion("A")
        assert 2 * np.arctan2(q[3], q[0]) == pytest.approx(moment / 2.0, abs=1e-10)


@pytest.mark.parametrize("name", FOLLOWING)
def test_reactions_balance_loads_where_they_are_now(name):
    step = solved(FOLLOWING[name]())
    scene, force, moment = step.model.scene, np.zeros(3), np.zeros(3)
    for load in scene.loads.values():
        if load.type == "distributed":
            x, w = gauss_points(np.linspace(0, 1, 17))
            found = step.along(load.member, x)
            f = quat.rotate(found["quaternion"], np.asarray(load.vector))
            f = f * (scene.center_lines[load.member].length * w)[:, None]
            force, moment = force + f.sum(axis=0), moment + np.cross(found["position"], f).sum(axis=0)
            continue
        at = None if load.node else step.along(load.member, load.at)
        q = step.quaternion(load.node) if at is None else at["quaternion"][0]
        place = step.position(load.node) if at is None else at["position"][0]
        vector = quat.rotate(q, np.asarray(load.vector)) if load.frame == "follower" else np.asarray(load.vector)
        if load.type == "moment":
            moment = moment + vector
        else:
            force, moment = force + vector, moment + np.cross(place, vector)
    for node, record in scene.nodes.items():
        if record.support != "free":
            f, m = step.reaction(node)
            force, moment = force + f, moment + m + np.cross(step.position(node), f)
    # Spread followers are taken at the nodes, positions and directions between them to the accuracy asked for.
    np.testing.assert_allclose(force, 0.0, atol=1e-6)
    np.testing.assert_allclose(moment, 0.0, atol=1e-6)


def test_plane_followers_modelled_in_space():
    table = following()
    plane = solved(table)
    table["sections"]["s"] = {**SOFT, "EI2": 2.0}
    space = solved({**table, "dimension": "space"})
    for node in plane.model.nodes:
        np.testing.assert_allclose(space.position(node), plane.position(node), atol=5e-8)
    np.testing.assert_allclose(space.reaction("A"), plane.reaction("A"), atol=1e-5)


def test_follower_along_a_member_needs_integration_at_the_nodes():
    with pytest.raises(sfetcas.SceneError, match="integration at the nodes, found Gauss"):
        sfetcas.solve(made(following()), gauss=True)


# -- moments ------------------------------------------------------------------------------------------------

HELIX = {
    # moment: place of the tip; the curvature of an isotropic rod turns about the moment (Love 1944, par. 270)
    (1.0, 2.0, 0.0): (0.481475926300558, 0.25926203684972, -0.64690915058287),
    (3.0, 0.0, 5.0): (0.209602439004351, 0.0147833235296364, 0.474238536597387),
    (2.0, -4.0, 8.0): (0.0742956293665232, 0.0947139355196125, 0.278783060418175),
}


def wound(moment):
    table = cantilever()
    table["sections"]["s"] = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}
    table["loads"] = {"m": {"type": "moment", "node": "B", "value": list(moment)}}
    return table


@pytest.mark.parametrize("moment", HELIX)
def test_moment_about_a_fixed_axis_winds_a_helix(moment):
    step = solved(wound(moment))
    np.testing.assert_allclose(step.position("B"), HELIX[moment], atol=2e-8)
    np.testing.assert_allclose(step.reaction("A")[1], -np.array(moment), atol=1e-9)
    # The moment is the same all along.
    found = step.along("m", np.linspace(0, 1, 7))["moment"]
    np.testing.assert_allclose(found, np.tile(moment, (7, 1)), atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_order_of_convergence_under_a_moment_in_space(order):
    errors = []
    for elements in (8, 16):
        prepared = sfetcas.Prepared(model_of(wound((3.0, 0.0, 5.0)), elements, order))
        errors.append(np.linalg.norm(followed(prepared, 1.0).position("B") - HELIX[3.0, 0.0, 5.0]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * order, abs=0.35)


def test_following_moment_is_the_fixed_one_of_its_last_direction():
    table = wound((0.6, 0.8, -0.5))
    table["sections"]["s"] = {**UNLIKE}
    table["loads"]["m"]["frame"] = "follower"
    one = solved(table)
    other = copy.deepcopy(table)
    vector = quat.rotate(one.quaternion("B"), np.array([0.6, 0.8, -0.5]))
    other["loads"]["m"] = {"type": "moment", "node": "B", "value": vector.tolist()}
    two = solved(other)
    np.testing.assert_allclose(two.position("B"), one.position("B"), atol=5e-8)
    np.testing.assert_allclose(one.reaction("A")[1], -vector, atol=1e-8)


def test_moments_of_the_plane_follow_or_not_alike():
    table = cantilever()
    table["loads"] = {"m": {"type": "moment", "node": "B", "value": 3.0}}
    fixed = answer(table)
    table["loads"]["m"]["frame"] = "follower"
    follower = answer(table)
    np.testing.assert_array_equal(follower.position("B"), fixed.position("B"))
    assert follower.certificate.stable is True


def test_moment_about_the_axis_of_a_held_hinge_has_a_potential():
    """The certificate says stable; across the axis a moment goes to the support."""
    axis = np.array([0.2, 1.0, 0.3]) / np.linalg.norm([0.2, 1.0, 0.3])
    table = wound((0, 0, 0))
    table["sections"]["s"] = {**UNLIKE}
    table["nodes"]["B"] |= {"support": "hinge", "axis": axis.tolist()}
    table["members"]["m"]["shape"] = {"type": "arc", "angle": 1.0}
    table["loads"]["m"] = {"type": "moment", "node": "B", "value": (0.9 * axis).tolist()}
    step = solved(table)
    assert step.certificate.stable is True
    q = step.quaternion("B")
    angle = 2 * np.arctan2(q[1:] @ axis, q[0])
    assert abs(angle) > 0.1
    assert step.energy["loads"] == pytest.approx(-0.9 * angle, abs=1e-10)
    assert step.reaction("B")[1] @ axis == pytest.approx(0.0, abs=1e-10)
    across = np.cross(axis, [0, 0, 1.0])
    table["loads"]["more"] = {"type": "moment", "node": "B", "value": across.tolist()}
    other = solved(table)
    np.testing.assert_allclose(other.position("B"), step.position("B"), atol=1e-9)
    np.testing.assert_allclose(other.reaction("B")[1] - step.reaction("B")[1], -across, atol=1e-7)


def test_models_by_themselves_follow_what_cannot_be_minimised():
    table = cantilever((0.0, 10.0))
    table["loads"] = {"f": {"type": "force", "node": "B", "value": [0, 10], "frame": "follower"}}
    model = model_of(table, 8, 5)
    step = solve_model(model)
    np.testing.assert_allclose(step.position("B")[:2], [-0.0921231811893664, 0.546983264593714], atol=1e-6)
    with pytest.raises(SceneError, match="loads that follow and moments in space have no energy"):
        equilibrium_nlp(model)


@pytest.mark.parametrize("key", ["contacts", "springs"])
def test_models_by_themselves_refuse_what_only_a_whole_run_finds(key):
    table = cantilever((0.0, 1.0))
    more = {
        "contacts": {"c": {"type": "plane", "point": [0, -1], "normal": [0, 1], "member": "m"}},
        "springs": {"k": {"node": "B", "stiffness": 1.0, "stop": [-0.1, 0.1]}},
    }
    table[key] = more[key]
    for attempt in (solve_model, equilibrium_nlp):
        with pytest.raises(SceneError, match="a model by itself knows no"):
            attempt(model_of(table, 2, 4))
