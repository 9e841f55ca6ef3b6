"""Balance, work and limits of scenes with rigid and small members, springs and joints of every kind."""

import copy

import numpy as np
import pytest
from scenes import SOFT, UNLIKE, arc_across, cantilever, gauss_points, made, model_of, three
from systems import EVERY, EVERYTHING, PLANE_SYSTEMS, SYSTEMS, linked, linked_space, sliding_plane, sliding_space

import sfetcas
from sfetcas.equilibria.statics import solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics import joints, terms

systems = pytest.mark.parametrize("name", SYSTEMS)
SLIDES = ("slider", "cylindrical")


def answer(table, elements=4, order=6, **options):
    return solve_model(model_of(table, elements, order, **options))


def spring_wrench(step, name):
    """What a spring does to its second party: a force or a moment, from the answer and the scene."""
    spring, state = step.model.scene.springs[name], step.spring(name)
    if state.rotational:
        axis = np.asarray(step.model.scene.spring_axis(name))
        axis = axis / np.linalg.norm(axis)
        sides = np.array([rotation_of(step, spring, party) for party in spring.between or ("ground", spring.node)])
        data = np.array([*axis, spring.stiffness, spring.rest, state.travel])
        # Where the joint turns about other axes as well, the moment is not quite along the spring's.
        moment = -terms.rotation_gradient(joints.TurnSpring(True))(sides.T, [], data, [], [])[3].full()[3:, 0]
        assert moment @ quat.rotate(sides[0], axis) == pytest.approx(state.effort, abs=1e-9)
        return "moment", moment
    if spring.direction is not None:
        return "force", state.effort * np.asarray(spring.direction) / np.linalg.norm(spring.direction)
    other = spring.anchor or step.model.scene.nodes[spring.node].position
    gap = step.position(spring.node) - (np.asarray(other) if spring.to is None else step.position(spring.to))
    return "force", state.effort * gap / np.linalg.norm(gap)


def rotation_of(step, spring, party):
    """Rotation of a party of a spring since the undeformed scene, a quaternion."""
    if party == "ground":
        return np.array([1.0, 0, 0, 0])
    if party == spring.node:
        return step.quaternion(party)
    return step.along(party, float(step.model.scene.members[party].nodes.index(spring.node)))["quaternion"][0]


def on_node(step, node):
    """Force and moment about the node of all that is not a member: loads, reactions, springs."""
    scene, force, moment = step.model.scene, np.zeros(3), np.zeros(3)
    for load in scene.loads.values():
        if load.node == node:
            target = moment if load.type == "moment" else force
            target += load.vector
    if scene.nodes[node].support != "free":
        f, m = step.reaction(node)
        force, moment = force + f, moment + m
    for name, spring in scene.springs.items():
        kind, vector = spring_wrench(step, name)
        if kind == "moment" and node == spring.node:
            ground = spring.between is None or "ground" in spring.between
            moment = moment + (vector if ground else 0.0)
        elif kind == "force":
            force = force + vector * ((node == spring.node) - (node == spring.to))
    return force, moment


@systems
def test_every_node_is_in_balance(name):
    """Ends of all members, with the lever of those that slide, loads, reactions and springs at each node."""
    step = answer(SYSTEMS[name]())
    scene = step.model.scene
    for node in scene.nodes:
        force, moment = on_node(step, node)
        for name_, member in scene.members.items():
            for side, (at, release) in enumerate(zip(member.nodes, member.release, strict=True)):
                if at != node:
                    continue
                end, sign = step.along(name_, float(side)), 1.0 - 2.0 * side
                force = force + sign * end["force"][0]
                moment = moment + sign * end["moment"][0]
                if release in SLIDES:
                    moment = moment + sign * np.cross(end["position"][0] - step.position(node), end["force"][0])
        # Rounding times the stiffness of small members and short ends, 1e3 to 1e4.
        np.testing.assert_allclose(force, 0.0, atol=1e-10, err_msg=node)
        np.testing.assert_allclose(moment, 0.0, atol=1e-9, err_msg=node)


@systems
def test_reactions_and_springs_balance_the_loads(name):
    """Forces always; moments where no load lies inside a small member, whose inner places are approximate."""
    table = SYSTEMS[name]()
    small = [n for n, m in table["members"].items() if m.get("type") == "small"]
    if small:
        table["loads"] = {n: load for n, load in table["loads"].items() if load.get("member") not in small}
        del table["gravity"]
    step = answer(table, 8)
    scene, force, moment = step.model.scene, np.zeros(3), np.zeros(3)
    for node in scene.nodes:
        f, m = on_node(step, node)
        force, moment = force + f, moment + m + np.cross(step.position(node), f)
    for load in scene.loads.values():
        if load.member is None:
            continue
        if load.type == "moment":
            moment = moment + load.vector
        elif load.type == "force":
            force = force + load.vector
            moment = moment + np.cross(step.along(load.member, load.at)["position"][0], load.vector)
    for member, line in scene.center_lines.items():
        x, w = gauss_points(np.linspace(0, 1, 9))
        f = spread(scene, member, x) * line.length * w[:, None]
        force, moment = force + f.sum(axis=0), moment + np.cross(step.along(member, x)["position"], f).sum(axis=0)
    np.testing.assert_allclose(force, 0.0, atol=1e-10)
    # Loads spread along flexible members meet positions between the nodes: truncation of order 6.
    np.testing.assert_allclose(moment, 0.0, atol=5e-8)


def spread(scene, member, x):
    """Force per length of the undeformed member."""
    total = np.zeros((len(x), 3))
    for load in scene.loads.values():
        if load.type == "distributed" and load.member == member:
            total += np.asarray(load.vector)
    section = scene.members[member].section
    if scene.gravity is not None and section is not None:
        total += scene.sections[section].mass(x)[:, None] * np.asarray(scene.gravity)
    return total


def test_weight_of_a_small_member_is_carried():
    """The sum of all reactions is the weight and the loads, wherever along a small member they act."""
    for name in ("small_plane", "small_space"):
        step = answer(SYSTEMS[name]())
        scene, force = step.model.scene, np.zeros(3)
        for node in scene.nodes:
            force = force + on_node(step, node)[0]
        force = force + sum((np.asarray(load.vector) for load in scene.loads.values()
                             if load.member is not None and load.type == "force"), np.zeros(3))  # fmt: skip
        for member, line in scene.center_lines.items():
            x, w = gauss_points([0, 1])
            profile = 1.0 + x if name == "small_plane" and member == "three" else np.ones_like(x)
            for load in scene.loads.values():
                if load.type == "distributed" and load.member == member:
                    force = force + line.length * w @ (profile[:, None] * np.asarray(load.vector))
            mass = scene.sections[scene.members[member].section].mass(x)
            force = force + line.length * w @ mass * np.asarray(scene.gravity)
        np.testing.assert_allclose(force, 0.0, atol=1e-10)


@systems
def test_elastic_energy_is_the_work_of_the_loads_on_the_way(name):
    """d(total)/d(factor) is the potential of the unit loads, without motions, by differences."""
    table = SYSTEMS[name]()
    table.pop("motions", None)
    if name.startswith("sliding"):
        table["motions"] = {"stop": {"node": "B", "between": ["rail", "rod"], "displacement": [0, 0, 0]}}
    prepared = sfetcas.Prepared(model_of(table, 3, 5))

    # There are several minima; from the start guess any of them may be found.
    here, h = solve_model(prepared, 0.7), 1e-3
    e = [solve_model(prepared, 0.7 + k * h, start=here).energy["total"] for k in (-2, -1, 1, 2)]
    slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
    # h^4 = 1e-12 of the fifth derivative.
    assert slope == pytest.approx(here.energy["loads"] / 0.7, rel=1e-8)


@pytest.mark.parametrize("motion", ["collar", "elbow"])
@pytest.mark.parametrize("name", ["sliding_plane", "sliding_space"])
def test_driving_effort_is_the_derivative_of_the_energy(name, motion):
    """A driven joint pushes along its travel or about its axis with the change of the energy by that."""
    if name == "sliding_space" and motion == "elbow":
        motion, key = "collar", "rotation"
    else:
        key = "displacement" if motion == "collar" else "rotation"

    def at(change):
        table = SYSTEMS[name]()
        value = table["motions"][motion][key]
        size = np.linalg.norm(value)
        new = (np.asarray(value) * (size + change) / size).tolist()
        table["motions"][motion][key] = new
        return answer(table)

    h, step = 1e-3, at(0.0)
    e = [at(k * h).energy["total"] for k in (-2, -1, 1, 2)]
    slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
    node = step.model.scene.nodes["B" if motion == "collar" else "C"]
    first, second = step.model.scene.motions[motion].between
    base, driven = (step.along(m, float(step.model.scene.members[m].nodes.index(step.model.scene.motions[motion].node)))
                    for m in (first, second))  # fmt: skip
    axis = np.asarray(node.direction if motion == "collar" else (0, 0, 1.0))
    axis = quat.rotate(base["quaternion"][0], axis / np.linalg.norm(axis))
    # The second member starts at the joint: what is beyond, the member, does to the joint is minus the effort.
    effort = driven["force" if key == "displacement" else "moment"][0] @ axis
    assert -effort == pytest.approx(slope, abs=2e-8)
    assert step.motion(motion)["force" if key == "displacement" else "moment"] == pytest.approx(slope, abs=2e-8)
    assert abs(slope) > 1e-3


def driven_supports(dimension, *, against=False):
    """A bent beam between a support that is turned and one that is displaced, with a driven joint between."""
    space = dimension == "space"
    z = [0, 0.2, -1.0 if against else 1.0] if space else [0, 0, -1.0 if against else 1.0]
    return {
        "dimension": dimension,
        "sections": {"s": {"EI2": 1.0, "EI3": 1.3, "GJ": 0.8}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge", "axis": z},
            "B": {"position": [1, 0.3], "joint": "hinge", "axis": z},
            "C": {"position": [1.8, 0], "support": "clamped"},
        },
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s"},
            "n": {"nodes": ["B", "C"], "section": "s"},
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [0.2, -0.4], "history": "once"}},
        "histories": {"once": {"t": [0, 1], "value": [1, 1]}},
        "motions": {
            "turn": {"node": "A", "rotation": 0.4},
            "knee": {"node": "B", "between": ["m", "n"], "rotation": -0.7},
            "foot": {
                "node": "C", "displacement": [-0.1, 0.05, 0.03 if space else 0],
                "rotation": [0.1, -0.3, 0.2] if space else 0.3,
            },
        },
    }  # fmt: skip


@pytest.mark.parametrize("against", [False, True])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_what_makes_the_motions_does_the_work(dimension, against):
    """Moments and forces of all motions times these are the derivative of the energy by the factor of the motions.

    Loads stay, motions about one axis each grow: the difference over steps of 1e-3 leaves 1e-12 of the derivatives.
    """
    table = driven_supports(dimension, against=against)
    h, model = 1e-3, model_of(table, 4, 6)
    e = [solve_model(model, 1.0 + k * h).energy["total"] for k in (-2, -1, 1, 2)]
    slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
    step = solve_model(model)
    work, pairs = 0.0, (("moment", "rotation"), ("force", "displacement"))
    for name, motion in table["motions"].items():
        made_by = step.motion(name)
        assert set(made_by) == {key for key, of in pairs if of in motion}
        for key, of in pairs:
            if of in motion:
                work += float(np.dot(np.ravel(made_by[key])[: np.size(motion[of])], np.ravel(motion[of])))
    assert work == pytest.approx(slope, abs=1e-9)
    assert all(
        np.abs(np.ravel(value)).max() > 1e-2 for name in table["motions"] for value in step.motion(name).values()
    )
    np.testing.assert_allclose(step.motion("foot")["force"], step.reaction("C")[0])
    before, after = (step.along(name, at)["quaternion"][0] for name, at in (("m", 1.0), ("n", 0.0)))
    turned = quat.multiply(quat.conjugate(before), after)[1:]
    axis = np.asarray(table["nodes"]["B"]["axis"]) / np.linalg.norm(table["nodes"]["B"]["axis"])
    np.testing.assert_allclose(turned, np.sin(-0.35) * axis, atol=1e-12)
    assert np.ndim(step.motion("turn")["moment"]) == np.ndim(step.motion("knee")["moment"]) == 0


@systems
def test_members_in_the_other_order_give_the_same_answer(name):
    """Joints do not depend on which member comes first, but for those of universal joints, which say so."""
    table = SYSTEMS[name]()
    other = copy.deepcopy(table)
    other["members"] = dict(reversed(table["members"].items()))
    one, two = answer(table), answer(other)
    for node in one.model.nodes:
        np.testing.assert_allclose(two.position(node), one.position(node), atol=1e-10)
        if one.model.scene.nodes[node].support != "free":
            np.testing.assert_allclose(two.reaction(node), one.reaction(node), atol=1e-8)
    for name_ in one.model.scene.springs:
        assert two.spring(name_).effort == pytest.approx(one.spring(name_).effort, abs=1e-10)


@pytest.mark.parametrize("name", PLANE_SYSTEMS)
def test_plane_scene_modelled_in_space(name):
    table = copy.deepcopy(SYSTEMS[name]())  # its sections are shared with other tests, and changed below
    for load in table["loads"].values():
        if load["type"] == "moment":
            del table["loads"]["couple"]  # about a free rotation in space a moment has no potential
            break
    plane = answer(table, 6)
    for section in table["sections"].values():
        if "EI3" in section:
            section |= {"EI2": 3.0, "GJ": 2.0}
    space = answer({**table, "dimension": "space"}, 6)
    # Interpolation of quaternions instead of angles, of order 12 in elements of a sixth.
    for node in plane.model.nodes:
        np.testing.assert_allclose(space.position(node), plane.position(node), atol=2e-8)
        if plane.model.scene.nodes[node].support != "free":
            f, m = plane.reaction(node)
            np.testing.assert_allclose(space.reaction(node)[0], f, atol=1e-6)
            assert space.reaction(node)[1][2] == pytest.approx(m[2], abs=1e-6)
    for name_ in plane.model.scene.springs:
        assert space.spring(name_).travel == pytest.approx(plane.spring(name_).travel, abs=1e-8)
        assert space.spring(name_).effort == pytest.approx(plane.spring(name_).effort, abs=1e-7)
    assert space.energy["total"] == pytest.approx(plane.energy["total"], abs=1e-8)


# -- springs ------------------------------------------------------------------------------------------


def rod_on_spring(**more):
    """A rigid rod on a hinge at the origin with a rotational spring and a force across its tip."""
    return {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [2, 0]}},
        "members": {"rod": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"node": "A", "stiffness": 3.0, **more}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 1.2]}},
    }


def test_rest_angle():
    """3 (phi - rest) = 1.2 * 2 cos(phi); the spring says its angle, not that from rest."""
    for rest in (0.0, 0.6):
        step = sfetcas.solve(made(rod_on_spring(rest=rest))).last
        phi = step.angle("A")
        assert 3.0 * (phi - rest) == pytest.approx(2.4 * np.cos(phi), abs=1e-12)
        assert step.spring("k").travel == pytest.approx(phi, abs=1e-14)
        assert step.spring("k").effort == pytest.approx(-3.0 * (phi - rest), abs=1e-12)
        np.testing.assert_allclose(step.reaction("A"), [[0, -1.2, 0], [0, 0, 0]], atol=1e-12)


def test_prestressed_springs_are_a_load():
    """Without loads the rod goes to the rest angle, a rope of no free length pulls its tip."""
    table = rod_on_spring(rest=0.6)
    del table["loads"]
    assert sfetcas.solve(made(table)).last.angle("A") == pytest.approx(0.6, abs=1e-12)
    table["springs"] = {"rope": {"type": "translational", "node": "B", "anchor": [0, 3], "stiffness": 1, "length": 0}}
    step = sfetcas.solve(made(table)).last
    np.testing.assert_allclose(step.position("B"), [0, 2, 0], atol=1e-12)
    assert step.spring("rope").travel == pytest.approx(1.0, abs=1e-12)
    assert step.spring("rope").effort == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize("length", [None, 0.3, 0.0])
def test_translational_spring_pulls_by_its_elongation(length):
    """Slow pull on a stiff spring between a clamped node and the tip of a rigid rod: moments about the hinge."""
    table = rod_on_spring()
    table["nodes"]["C"] = {"position": [0, 2], "support": "clamped"}
    table["members"]["post"] = {"nodes": ["C", "D"], "type": "rigid"}
    table["nodes"]["D"] = {"position": [0.5, 2.0]}
    rope = {"type": "translational", "node": "B", "to": "D", "stiffness": 0.8}
    table["springs"] = {"rope": rope if length is None else rope | {"length": length}}
    step = sfetcas.solve(made(table)).last
    free = np.hypot(1.5, 2.0) if length is None else length
    gap = np.array([0.5, 2.0, 0.0]) - step.position("B")
    now = np.linalg.norm(gap)
    pull = 0.8 * (now - free) * gap / now
    assert step.spring("rope").travel == pytest.approx(now - free, abs=1e-12)
    assert np.cross(step.position("B"), np.add(pull, [0, 1.2, 0]))[2] == pytest.approx(0.0, abs=1e-11)
    # The other node is pulled back: its support takes it.
    np.testing.assert_allclose(step.reaction("C")[0], pull, atol=1e-11)
    np.testing.assert_allclose(step.reaction("C")[1], np.cross([0.5, 0, 0], pull), atol=1e-11)


def test_spring_along_a_direction():
    table = cantilever((0.0, 1.0))
    table["springs"] = {"k": {"type": "translational", "node": "B", "direction": [0, 2], "stiffness": 5, "rest": 0.1}}
    step = sfetcas.solve(made(table)).last
    travel = step.position("B")[1]
    assert step.spring("k").travel == pytest.approx(travel, abs=1e-14)
    assert step.spring("k").effort == pytest.approx(-5 * (travel - 0.1), abs=1e-12)
    np.testing.assert_allclose(step.reaction("A")[0], [0, 5 * (travel - 0.1) - 1.0, 0], atol=1e-11)


def test_stiff_spring_is_a_support_and_a_weld():
    """A spring to the ground or between members, ever stiffer, is a slider or a rigid joint; error as 1/stiffness."""
    table = cantilever((0.0, 6.0))
    held = copy.deepcopy(table)
    held["nodes"]["B"] |= {"support": "slider", "direction": [1, 0], "rotation": "ball"}
    held["loads"] = table["loads"] = {"f": {"type": "force", "member": "m", "at": 0.5, "value": [0, 6.0]}}
    limit = answer(held).position("B")
    errors = []
    for stiffness in (1e4, 1e5):
        table["springs"] = {"k": {"type": "translational", "node": "B", "direction": [0, 1], "stiffness": stiffness}}
        errors.append(np.linalg.norm(answer(table).position("B") - limit))
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=1e-2)
    hinged, rigid = linked_space(), linked_space()
    rigid["members"]["follower"]["release"] = ["rigid", "rigid"]
    for table in (hinged, rigid):
        del table["springs"]["knee"]
    del rigid["nodes"]["C"]["axis"]
    limit, errors = answer(rigid).position("B"), []
    for stiffness in (1e4, 1e5):
        hinged["springs"]["knee"] = linked_space()["springs"]["knee"] | {"stiffness": stiffness}
        errors.append(np.linalg.norm(answer(hinged).position("B") - limit))
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=1e-2)


def test_lumped_masses_have_weight():
    """A mass at the tip under gravity is a force there; also where the members have no mass."""
    table = cantilever()
    force = {"f": {"type": "force", "node": "B", "value": [0.3 * 2.0, -0.3 * 9.0]}}
    # The least mass that is accepted: its weight is below the tolerance.
    table["sections"]["s"] = SOFT | {"rhoA": 1e-16}
    other = copy.deepcopy(table)
    table["loads"], table["gravity"], table["nodes"]["B"]["mass"] = {}, [2.0, -9.0], 0.3
    other["loads"] = force
    one, two = answer(table), answer(other)
    np.testing.assert_allclose(one.position("B"), two.position("B"), atol=1e-13)
    assert one.energy["total"] == pytest.approx(two.energy["total"], abs=1e-13)
    np.testing.assert_allclose(one.reaction("A"), two.reaction("A"), atol=1e-11)


# -- joints between members -----------------------------------------------------------------------------


def test_driven_joints_reach_their_travel_and_angle():
    for name in ("sliding_plane", "sliding_space"):
        step = answer(SYSTEMS[name]())
        scene = step.model.scene
        motion, node = scene.motions["collar"], scene.nodes["B"]
        base, end = step.along("rail", 1.0), step.along("rod", 0.0)
        along = quat.rotate(base["quaternion"][0], np.asarray(node.direction) / np.linalg.norm(node.direction))
        gap = end["position"][0] - base["position"][0]
        np.testing.assert_allclose(gap, np.linalg.norm(motion.displacement) * along, atol=1e-11)
        relative = quat.multiply(quat.conjugate(base["quaternion"][0]), end["quaternion"][0])
        direction = np.asarray(node.direction) / np.linalg.norm(node.direction)
        turned = 2.0 * np.arctan2(relative[1:] @ direction, relative[0])
        if name == "sliding_space":
            assert turned == pytest.approx(0.3, abs=1e-11)
            np.testing.assert_allclose(np.cross(relative[1:], direction), 0.0, atol=1e-11)
        else:
            first, second = step.along("rod", 1.0), step.along("stay", 0.0)
            assert second["angle"][0] - first["angle"][0] == pytest.approx(0.3, abs=1e-12)


def test_universal_support_and_joint_keep_their_axes_normal():
    """The support holds one rotation only; its moment is normal to both axes."""
    step = answer(linked_space())
    node = step.model.scene.nodes["A"]
    a, b = np.asarray(node.axis), quat.rotate(step.quaternion("A"), np.asarray(node.axis2))
    assert a @ b == pytest.approx(0.0, abs=1e-12)
    moment = step.reaction("A")[1]
    assert np.linalg.norm(moment) > 1e-2
    # What the spring to the ground does is no reaction.
    assert moment @ a == pytest.approx(0.0, abs=1e-10)
    assert moment @ b == pytest.approx(0.0, abs=1e-10)
    step = answer(sliding_space())
    node = step.model.scene.nodes["C"]
    a = quat.rotate(step.along("rod", 1.0)["quaternion"][0], np.asarray(node.axis))
    b = quat.rotate(step.along("stay", 0.0)["quaternion"][0], np.asarray(node.axis2))
    assert a @ b == pytest.approx(0.0, abs=1e-11)
    moment = step.along("stay", 0.0)["moment"][0]
    assert np.linalg.norm(moment) > 1e-3
    assert moment @ a == pytest.approx(0.0, abs=1e-10)
    assert moment @ b == pytest.approx(0.0, abs=1e-10)


def test_universal_support_of_a_flexible_member():
    """Its moment is normal to the axis in the ground and to the one that the member carries; a ball holds the rest."""
    table = {
        "sections": {"s": {**UNLIKE}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "universal", "axis": [0, 0.2, 1], "axis2": [0, 1, -0.2]},
            "B": {"position": [1, 0.4, 0.3], "support": "ball"},
        },
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s", "shape": arc_across([0] * 3, [1, 0.4, 0.3], 1.2, [0, 0, 1])}
        },
        "loads": {"f": {"type": "force", "member": "m", "at": 0.4, "value": [0.5, -1.0, 4.0]}},
    }
    step = answer(table)
    (force, moment), node = step.reaction("A"), step.model.scene.nodes["A"]
    a, b = np.asarray(node.axis), quat.rotate(step.quaternion("A"), np.asarray(node.axis2))
    assert a @ b == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(moment) > 1e-2
    assert moment @ a == pytest.approx(0.0, abs=1e-10)
    assert moment @ b == pytest.approx(0.0, abs=1e-10)
    start = step.along("m", 0.0)
    np.testing.assert_allclose(start["moment"][0] + moment, 0.0, atol=1e-10)
    np.testing.assert_allclose(start["force"][0] + force, 0.0, atol=1e-10)


def test_unloaded_arm_on_a_universal_joint_follows_what_carries_it():
    """Nothing turns the arm, and nothing but rounding resists a turn of it about its joint's third axis."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.8, "EI3": 1.0, "GJ": 1.8}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"w": {"type": "distributed", "member": "m", "value": [2.0, -1.4, -0.3]}},
        "analysis": {"accuracy": 1e-6},
    }
    alone = sfetcas.solve(made(table)).last
    table["nodes"]["B"] |= {"joint": "universal", "axis": [0, 1, 0], "axis2": [0, 0, 1]}
    table["nodes"]["C"] = {"position": [1.4, 0.4, -0.1]}
    table["members"]["k"] = {"nodes": ["B", "C"], "type": "rigid"}
    table["springs"] = {
        name: {"node": "B", "between": ["m", "k"], "stiffness": 2.0, "axis": axis}
        for name, axis in (("y", [0, 1, 0]), ("z", [0, 0, 1]))
    }
    step = sfetcas.solve(made(table)).last
    # Both to the accuracy asked for.
    np.testing.assert_allclose(step.position("B"), alone.position("B"), atol=2e-6)
    for name in ("y", "z"):
        assert step.spring(name).to_dict()["angle"] == pytest.approx(0.0, abs=1e-9)


def test_cylindrical_support_holds_neither_along_nor_about_its_line():
    step = answer(SYSTEMS["small_space"]())
    line = np.asarray(step.model.scene.nodes["D"].direction)
    line = line / np.linalg.norm(line)
    force, moment = step.reaction("D")
    assert min(np.linalg.norm(force), np.linalg.norm(moment)) > 1e-2
    assert force @ line == pytest.approx(0.0, abs=1e-11)
    assert moment @ line == pytest.approx(0.0, abs=1e-11)
    moved = step.position("D") - step.model.scene.nodes["D"].position
    np.testing.assert_allclose(np.cross(moved, line), 0.0, atol=1e-12)
    np.testing.assert_allclose(quat.rotate(step.quaternion("D"), line), line, atol=1e-12)


def test_answers_have_every_name():
    """The JSON answer of every scene lists springs, reactions and members with finite numbers."""
    for name in (*SYSTEMS, "following", "following_space"):
        entry = sfetcas.solve(made(EVERYTHING[name]())).last.to_dict()
        table = EVERYTHING[name]()
        assert set(entry["members"]) == set(table["members"])
        assert set(entry.get("springs", {})) == set(table.get("springs", {}))
        assert set(entry.get("motions", {})) == set(table.get("motions", {}))
        assert all(np.isfinite(np.ravel(m["force"])).all() for m in entry["members"].values())
        assert set(entry["reactions"]) == {n for n, node in table["nodes"].items() if "support" in node}


def test_scenes_are_what_they_say():
    assert {made(f()).resolved_dimension for f in PLANE_SYSTEMS.values()} == {"plane"}
    assert {made(SYSTEMS[n]()).resolved_dimension for n in SYSTEMS if n not in PLANE_SYSTEMS} == {"space"}
    assert three([1, 2])[2] == 0.0
    assert len(EVERY) == len(SYSTEMS) + len(set(EVERY) - set(SYSTEMS))
    assert linked()["springs"].keys() >= {"foot", "pin", "rope", "push"}
    assert sliding_plane()["motions"]


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("type_", ["rigid", "flexible"])
def test_pin_in_a_slot_stays_on_its_line_and_pushes_across_it(type_, dimension):
    """A slotted lever on a spring, driven by the pin of a crank: its angle points to the pin."""
    table = {
        "dimension": dimension,
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "P": {"position": [1, 0], "direction": [1, 2]},
            "O": {"position": [0, -2], "support": "hinge"},
        },
        "members": {
            "lever": {"nodes": ["O", "P"], "type": "rigid"},
            "crank": {"nodes": ["A", "P"], "section": "s", "type": type_, "release": ["rigid", "slot"]},
        },
        "springs": {"k": {"node": "O", "stiffness": 0.5}},
        "motions": {"drive": {"node": "A", "rotation": 1.0}},
        "analysis": {"steps": [0.3, 1.0, -0.8], "accuracy": 1e-8},
    }
    for step in sfetcas.solve(made(table)).steps:
        tip = step.along("crank", [1.0])
        x, y = tip["position"][0][:2]
        turned = np.arctan2(y + 2.0, x) - np.arctan2(2.0, 1.0)
        # Closings are closed to rounding.
        assert step.spring("k").travel == pytest.approx(turned, abs=1e-12)
        along = np.array([x, y + 2.0, 0.0]) / np.hypot(x, y + 2.0)
        force = tip["force"][0]
        assert force @ along == pytest.approx(0.0, abs=1e-12)
        # The lever in balance: the pin's moment about its hinge is that of the spring.
        assert np.cross([x, y + 2.0, 0.0], force)[2] == pytest.approx(step.spring("k").effort, abs=1e-12)
