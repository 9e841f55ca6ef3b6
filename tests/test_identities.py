"""What must hold between answers, and between an answer and the laws of mechanics, whatever the scene."""

import copy

import numpy as np
import pytest
from scenes import (
    PLANE,
    SOFT,
    SPACE,
    UNLIKE,
    ZOO,
    arc_across,
    arch,
    bend_45,
    cantilever,
    density,
    gauss_points,
    guided,
    hinged_space,
    made,
    model_of,
    transformed,
    tripod,
    turned_about,
)
from systems import EVERY, PLANE_SYSTEMS, SYSTEMS

import sfetcas
from sfetcas.equilibria.statics import solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.solvers.prepared import Prepared

FLAT = [*PLANE, *PLANE_SYSTEMS]
PLACES = np.array([0.0, 0.1, 0.37, 0.5, 0.93, 1.0])
each = pytest.mark.parametrize("name", ZOO)
every = pytest.mark.parametrize("name", EVERY)
TILT = turned_about([1.0, 2.0, -0.7], 2.1)


def answer(table, elements=3, order=5, **options):
    return solve_model(model_of(table, elements, order, **options))


def held(step):
    return [n for n, node in step.model.scene.nodes.items() if node.support != "free"]


def compare(
    step, other, turn=None, shift=(0, 0, 0), length=1.0, force=1.0, tolerance=1e-9, nodes=None, members=None, hand=1
):
    """The other answer is the first one turned, moved and in other units."""
    turn, moment = np.eye(3) if turn is None else turn, force * length
    nodes, members = nodes or step.model.nodes, step.model.members if members is None else members
    largest = max(np.abs(step.along(m, PLACES)["force"]).max() for m in step.model.members) + 1.0
    for node in nodes:
        expected = length * (turn @ step.position(node) + np.asarray(shift))
        np.testing.assert_allclose(other.position(node), expected, atol=tolerance * length)
        if step.model.scene.nodes[node].support != "free":
            for a, b, unit, sign in zip(
                step.reaction(node), other.reaction(node), (force, moment), (1, hand), strict=True
            ):
                np.testing.assert_allclose(b, unit * sign * turn @ a, atol=10 * tolerance * unit * largest)
    for member in members:
        one, two = (s.along(member, PLACES) for s in (step, other))
        expected = length * (one["position"] @ turn.T + np.asarray(shift))
        np.testing.assert_allclose(two["position"], expected, atol=tolerance * length)
        np.testing.assert_allclose(two["force"], force * one["force"] @ turn.T, atol=10 * tolerance * force * largest)
        expected = moment * hand * one["moment"] @ turn.T
        np.testing.assert_allclose(two["moment"], expected, atol=10 * tolerance * moment * largest)
    for key, value in step.energy.items():
        assert other.energy[key] == pytest.approx(moment * value, abs=10 * tolerance * moment * largest)
    assert other.certificate.negative == step.certificate.negative
    smallest = step.certificate.smallest
    assert other.certificate.smallest == pytest.approx(force * smallest, rel=1e-5, abs=1e-6 * force)


# -- superposed motions, mirrors, order, division, direction, units -------------------------------------


@every
def test_rigid_motion_of_the_scene_turns_the_answer(name):
    turn = turned_about([0, 0, 1], 2.2) if name in FLAT else TILT
    shift = np.array([3.0, -2.0, 0.0 if name in FLAT else 5.0])
    table = EVERY[name]()
    moved = transformed(table, turn, shift)
    step, other = answer(table), answer(moved)
    # A load of gravity does work in a rigid motion of the scene, but displacements start at the moved scene.
    compare(step, other, turn, shift)


@pytest.mark.parametrize("name", ["arch", "four_bar"])
def test_plane_scene_tilted_into_space_gives_the_same_answer(name):
    table = ZOO[name]()
    step, other = answer(table, 4, 6), answer(transformed(table, TILT, (1, 2, 3)) | {}, 4, 6)
    assert (step.model.dimension, other.model.dimension) == ("plane", "space")
    # Different interpolation (angle, quaternion) of order 12 in members of 4 elements.
    for node in step.model.nodes:
        np.testing.assert_allclose(other.position(node), TILT @ step.position(node) + [1, 2, 3], atol=1e-8)
        if node in held(step):
            np.testing.assert_allclose(other.reaction(node)[0], TILT @ step.reaction(node)[0], atol=1e-6)


@every
def test_mirrored_scene_gives_the_mirrored_answer(name):
    mirror = np.diag([-1.0, 1.0, 1.0]) if name in FLAT else TILT @ np.diag([1.0, 1.0, -1.0])
    table = EVERY[name]()
    compare(answer(table), answer(transformed(table, mirror)), mirror, hand=-1)


@every
def test_order_of_names_does_not_matter(name):
    table = EVERY[name]()
    backwards = {
        key: dict(reversed(value.items())) if isinstance(value, dict) else value for key, value in table.items()
    }
    compare(answer(table), answer(backwards))


def reversed_member(table, name):
    """The same scene with one member drawn from its other end."""
    scene, table = made(table), copy.deepcopy(table)
    member = table["members"][name]
    frame = quat.matrix(scene.center_lines[name].quaternions([1.0]))[0]
    member["nodes"] = member["nodes"][::-1]
    member["release"] = member.get("release", ["rigid", "rigid"])[::-1]
    member["b2"] = frame[:, 1].tolist()
    shape = member.get("shape", {})
    if shape.get("type") == "arc":
        shape["normal"] = (-np.asarray(shape.get("normal", [0, 0, 1]))).tolist()
        shape["angle"] = shape["angle"]
    elif shape.get("type") == "helix":
        shape["axis"] = (-np.asarray(shape["axis"])).tolist()
    section = table["sections"][member["section"]]
    for key, value in section.items():
        if isinstance(value, dict):
            section[key] = {"at": [1 - a for a in value["at"][::-1]], "value": value["value"][::-1]}
    for load in table["loads"].values():
        if load.get("member") == name and "at" in load:
            load["at"] = 1 - load["at"]
        if load.get("member") == name and "profile" in load:
            c = np.polynomial.Polynomial(load["profile"]["polynomial"])(np.polynomial.Polynomial([1, -1]))
            load["profile"] = {"polynomial": c.coef.tolist()}
    return table


@pytest.mark.parametrize(("name", "member"), [(n, m) for n, f in ZOO.items() for m in f()["members"]])
def test_reversed_member_is_the_same_member(name, member):
    table = ZOO[name]()
    step, other = answer(table, 4), answer(reversed_member(table, member), 4)
    compare(step, other, members=[m for m in step.model.members if m != member])
    one, two = step.along(member, PLACES), other.along(member, 1 - PLACES)
    np.testing.assert_allclose(two["position"], one["position"], atol=1e-9)
    loaded = any(load.get("member") == member and "at" in load for load in table["loads"].values())
    if not loaded:  # at a point load the section force jumps, and the two ask for different sides
        np.testing.assert_allclose(two["force"], -one["force"], atol=1e-7)
        np.testing.assert_allclose(two["moment"], -one["moment"], atol=1e-7)


def split(table, name, at):
    """One member made two, with a free node between them."""
    scene, table = made(table), copy.deepcopy(table)
    line, member = scene.center_lines[name], table["members"].pop(name)
    frame = quat.matrix(line.quaternions([0.0, at]))
    table["nodes"]["cut"] = {"position": line.positions([at])[0].tolist()}
    first, second = copy.deepcopy(member), copy.deepcopy(member)
    a, b = member["nodes"]
    first["nodes"], second["nodes"] = [a, "cut"], ["cut", b]
    first["b2"], second["b2"] = frame[0, :, 1].tolist(), frame[1, :, 1].tolist()
    release = member.get("release", ["rigid", "rigid"])
    first["release"], second["release"] = [release[0], "rigid"], ["rigid", release[1]]
    shape = member.get("shape", {})
    key = {"arc": "angle", "helix": "turns"}.get(shape.get("type"))
    if key:
        first["shape"][key], second["shape"][key] = shape[key] * at, shape[key] * (1 - at)
    for load_name, load in list(table["loads"].items()):
        if load.get("member") == name:
            if load["type"] == "distributed":
                table["loads"][load_name] = load | {"member": f"{name}1"}
                table["loads"][f"{load_name}2"] = load | {"member": f"{name}2"}
            else:
                inside = load["at"] < at
                place = load["at"] / at if inside else (load["at"] - at) / (1 - at)
                table["loads"][load_name] = load | {"member": f"{name}{1 if inside else 2}", "at": place}
    table["members"] |= {f"{name}1": first, f"{name}2": second}
    return table


@pytest.mark.parametrize(
    ("name", "member"),
    [("arch", "m"), ("four_bar", "right"), ("guided", "one"), ("bend_45", "m"), ("tripod", "two"), ("helix", "m"),
     ("hinged_space", "four")],
)  # fmt: skip
def test_member_split_in_two_gives_the_same_answer(name, member):
    table, at = ZOO[name](), 0.75
    step = answer(table, 8, 6)
    parts = split(table, member, at)
    counts = dict.fromkeys(parts["members"], 8) | {f"{member}1": 6, f"{member}2": 2}
    scene = made(parts)
    # The same elements (a load inside adds a cut to both), so the same numbers to rounding.
    other = solve_model(sfetcas.assemble(scene, sfetcas.uniform_mesh(scene, 6, counts)))
    tolerance = 1e-7 if name in ("arch", "bend_45") else 1e-10
    for node in step.model.nodes:
        np.testing.assert_allclose(other.position(node), step.position(node), atol=tolerance)
        if node in held(step):
            np.testing.assert_allclose(other.reaction(node)[0], step.reaction(node)[0], atol=100 * tolerance)
            np.testing.assert_allclose(other.reaction(node)[1], step.reaction(node)[1], atol=100 * tolerance)
    np.testing.assert_allclose(other.position("cut"), step.along(member, at)["position"][0], atol=tolerance)
    assert other.energy["total"] == pytest.approx(step.energy["total"], abs=10 * tolerance)


@pytest.mark.parametrize(("length", "force"), [(1e-9, 1e9), (1e9, 1e-9), (1e-6, 1e-3), (1e3, 1e9), (1e-9, 1e-9)])
@pytest.mark.parametrize("name", ["plane_loads", "four_bar", "guided", "hinged_space", "helix", *SYSTEMS])
def test_units_do_not_matter(name, length, force):
    table = EVERY[name]()
    step, other = answer(table), answer(transformed(table, length=length, force=force))
    compare(step, other, length=length, force=force, tolerance=1e-10)


@pytest.mark.parametrize("name", ["arch", "hinged_space"])
def test_units_do_not_matter_for_the_whole_run(name):
    table = ZOO[name]()
    one, two = sfetcas.solve(made(table)), sfetcas.solve(made(transformed(table, length=1e-6, force=1e5)))
    compare(one.last, two.last, length=1e-6, force=1e5, tolerance=1e-9)
    assert one.last.certificate.error_estimate == pytest.approx(two.last.certificate.error_estimate, rel=1e-3)
    assert one.last.notes == two.last.notes


@every
def test_gauss_integration_gives_the_same_answer(name):
    nodes, gauss = (sfetcas.solve(made(EVERY[name]()), gauss=g, accuracy=1e-6).last for g in (False, True))
    bound = nodes.certificate.error_estimate + gauss.certificate.error_estimate + 1e-12
    for node in nodes.model.nodes:
        gap = np.linalg.norm(nodes.position(node) - gauss.position(node)) / nodes.model.scene.size
        assert gap <= bound
    assert bound < 3e-6


@pytest.mark.parametrize("name", PLANE)
def test_plane_scene_modelled_in_space(name):
    table = ZOO[name]()
    for load in list(table["loads"]):
        if table["loads"][load]["type"] == "moment":
            del table["loads"][load]  # moments in space are not there yet
    if name == "guided":
        table["motions"]["turn"]["rotation"] = [0, 0, table["motions"]["turn"]["rotation"]]
        flat = copy.deepcopy(table)
        flat["motions"]["turn"]["rotation"] = 0.4
    else:
        flat = table
    plane, space = answer(flat, 6, 6), answer({**table, "dimension": "space"}, 6, 6)
    # Interpolation of quaternions instead of angles, both of order 12.
    for node in plane.model.nodes:
        np.testing.assert_allclose(space.position(node), plane.position(node), atol=1e-9)
    for node in held(plane):
        np.testing.assert_allclose(space.reaction(node), plane.reaction(node), atol=1e-6)
    assert space.energy["total"] == pytest.approx(plane.energy["total"], abs=1e-9)
    # Four components instead of one angle a rotation; closings and displacements as the assembly has them.
    turning = plane.model.widths.sum()
    assert space.model.widths[space.model.rotations.kind == 2].sum() >= 4 * (turning - 4)
    assert space.model.unknowns > 3 * plane.model.unknowns


# -- balance ------------------------------------------------------------------------------------------


def loads_about_origin(step):
    """Resultant force and moment of all loads where they are now, from the scene and the positions."""
    scene, force, moment = step.model.scene, np.zeros(3), np.zeros(3)
    for load in scene.loads.values():
        vector = np.asarray(load.vector) * step.factor
        if load.type == "moment":
            moment += vector
        elif load.type == "force":
            place = step.position(load.node) if load.node else step.along(load.member, load.at)["position"][0]
            force, moment = force + vector, moment + np.cross(place, vector)
    for member in scene.members:
        x, w = gauss_points(step.model.mesh.cuts[member])
        f = density(scene, member, x) * scene.center_lines[member].length * w[:, None] * step.factor
        force = force + f.sum(axis=0)
        moment = moment + np.cross(step.along(member, x)["position"], f).sum(axis=0)
    return force, moment


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
@pytest.mark.parametrize("assembly", ["closing", "nodal"])
@each
def test_reactions_balance_the_loads(name, assembly, gauss):
    step = answer(ZOO[name](), 8, 6, assembly=assembly, gauss=gauss)
    force, moment = loads_about_origin(step)
    largest = 1.0
    for node in held(step):
        f, m = step.reaction(node)
        force, moment = force + f, moment + m + np.cross(step.position(node), f)
        largest = max(largest, np.abs(f).max())
    np.testing.assert_allclose(force, 0.0, atol=1e-10 * largest)
    # Loads spread along members meet positions between the nodes: truncation of 8 elements of order 6.
    spread = step.model.scene.gravity is not None or any(
        load.type == "distributed" for load in step.model.scene.loads.values()
    )
    np.testing.assert_allclose(moment, 0.0, atol=(5e-9 if spread else 1e-10) * largest)


@each
def test_supports_react_only_where_they_hold(name):
    step = answer(ZOO[name]())
    for name_, node in step.model.scene.nodes.items():
        if node.support == "free":
            continue
        force, moment = step.reaction(name_)
        if node.turn == "ball" or node.joint == "ball":
            np.testing.assert_allclose(moment, 0.0, atol=1e-10)
        if node.turn == "hinge":
            # The axis of a support stands still.
            assert moment @ np.asarray(node.axis) == pytest.approx(0.0, abs=1e-10)
        driven = any(m.node == name_ and m.displacement for m in step.model.scene.motions.values())
        if node.support == "slider" and not driven:
            assert force @ np.asarray(node.direction) == pytest.approx(0.0, abs=1e-10)
    free = next((n for n, node in step.model.scene.nodes.items() if node.support == "free"), None)
    if free:
        with pytest.raises(sfetcas.SceneError, match="free"):
            step.reaction(free)


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
@each
def test_section_forces_balance_every_piece_of_a_member(name, gauss):
    """n and m at any cut against those at the start and the loads between, by statics."""
    step = answer(ZOO[name](), 8, 6, gauss=gauss)
    scene = step.model.scene
    for member in scene.members:
        line = scene.center_lines[member]
        start = step.along(member, 0.0)
        for cut in (0.17, 0.45, 0.77, 1.0):
            cuts = step.model.mesh.cuts[member]
            x, w = gauss_points(np.unique([*cuts[cuts < cut], cut]))
            f = density(scene, member, x) * line.length * w[:, None]
            force, moment = f.sum(axis=0), np.cross(step.along(member, x)["position"], f).sum(axis=0)
            for load in scene.loads.values():
                if load.member == member and load.at is not None and load.at < cut:
                    vector = np.asarray(load.vector)
                    place = step.along(member, load.at)["position"][0]
                    force = force + (vector if load.type == "force" else 0.0)
                    moment = moment + (np.cross(place, vector) if load.type == "force" else vector)
            end = step.along(member, cut)
            np.testing.assert_allclose(end["force"] - start["force"] + force, 0.0, atol=1e-10)
            about = [e["moment"] + np.cross(e["position"], e["force"]) for e in (start, end)]
            # Positions of spread loads between the nodes, truncated: 8 elements of order 6.
            np.testing.assert_allclose(about[1] - about[0] + moment, 0.0, atol=2e-8 * (1 + np.abs(about[0]).max()))


@each
def test_every_node_is_in_balance(name):
    """End forces and moments of the members, loads and reactions at each node; released ends carry no moment."""
    step = answer(ZOO[name](), 4, 6)
    scene = step.model.scene
    for node_name, node in scene.nodes.items():
        force, moment = np.zeros(3), np.zeros(3)
        for load in scene.loads.values():
            if load.node == node_name:
                target = moment if load.type == "moment" else force
                target += load.vector
        if node.support != "free":
            f, m = step.reaction(node_name)
            force, moment = force + f, moment + m
        for name_, member in scene.members.items():
            for side, sign in ((0, 1.0), (1, -1.0)):
                if member.nodes[side] != node_name:
                    continue
                end = step.along(name_, float(side))
                force = force + sign * end["force"][0]
                moment = moment + sign * end["moment"][0]
                joint = node.joint if node.joint != "rigid" else member.release[side]
                if joint == "ball":
                    np.testing.assert_allclose(end["moment"][0], 0.0, atol=1e-10)
                elif joint == "hinge":
                    axis = quat.rotate(end["quaternion"][0], np.asarray(node.axis))
                    assert end["moment"][0] @ axis == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(force, 0.0, atol=1e-10)
        np.testing.assert_allclose(moment, 0.0, atol=1e-9)


@pytest.mark.parametrize("gauss", [False, True], ids=["nodes", "gauss"])
def test_hinges_keep_their_axes_together(gauss):
    step = answer(hinged_space(), gauss=gauss)
    for node, ends in {"B": (("one", 1.0), ("two", 0.0)), "C": (("two", 1.0), ("four", 1.0))}.items():
        axis = np.asarray(step.model.scene.nodes[node].axis)
        a, b = (quat.rotate(step.along(m, x)["quaternion"][0], axis) for m, x in ends)
        np.testing.assert_allclose(a, b, atol=1e-11)
        other = np.cross(axis, [0.3, 0.5, 0.8])
        a, b = (quat.rotate(step.along(m, x)["quaternion"][0], other) for m, x in ends)
        assert np.abs(a - b).max() > 1e-3, "the hinge turns"
    for node in ("A", "D"):
        axis = np.asarray(step.model.scene.nodes[node].axis)
        np.testing.assert_allclose(quat.rotate(step.quaternion(node), axis), axis, atol=1e-13)


# -- energy -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["plane_loads", "arch", "four_bar", "bend_45", "hinged_space"])
def test_elastic_energy_is_the_work_of_the_loads_on_the_way(name):
    """dU = factor times d(work of unit loads): Gauss quadrature over the factors, and its derivative form."""
    table = ZOO[name]()
    prepared = Prepared(model_of(table, 4, 5))

    def at(factor):
        return solve_model(prepared, factor)

    # total = U - factor W and dU = factor dW give d(total)/d(factor) = -W; a loop integral checks both.
    x, w = gauss_points([0, 0.5, 1.0], 8)
    work = sum(wi * at(xi).energy["loads"] / xi for xi, wi in zip(x, w, strict=True))
    # Gauss with 2 x 8 points on smooth curves.
    assert at(1.0).energy["total"] == pytest.approx(work, rel=1e-8)
    h = 1e-3
    e = [at(0.7 + k * h).energy["total"] for k in (-2, -1, 1, 2)]
    slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
    assert slope == pytest.approx(at(0.7).energy["loads"] / 0.7, rel=1e-9)


def motion_table(kind, change):
    if kind == "plane":
        table = arch()
        table["motions"] = {
            "m": {"node": "B", "displacement": [-0.1 + change[0], 0.05 + change[1]], "rotation": 0.3 + change[5]}
        }
        return table
    table = tripod()
    table["motions"]["foot"]["displacement"] = (np.array([0.02, 0.0, -0.03]) + change[:3]).tolist()
    # A rotation about the fixed axes on top of the prescribed one, as a rotation vector.
    turned = quat.multiply(quat.from_rotation_vector(change[3:]), quat.from_rotation_vector([0.1, -0.2, 0.3]))
    half = np.linalg.norm(turned[1:])
    table["motions"]["foot"]["rotation"] = (2 * np.arctan2(half, turned[0]) / half * turned[1:]).tolist()
    return table


@pytest.mark.parametrize("kind", ["plane", "space"])
def test_reaction_is_the_derivative_of_the_energy_by_the_motion(kind):
    node = "B" if kind == "plane" else "a"
    step = answer(motion_table(kind, np.zeros(6)), 4, 6)
    force, moment = step.reaction(node)
    h = 1e-3
    for i in (0, 1, 5) if kind == "plane" else range(6):
        e = [answer(motion_table(kind, k * h * np.eye(6)[i]), 4, 6).energy["total"] for k in (-2, -1, 1, 2)]
        slope = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
        # h^4 = 1e-12 times the fifth derivative of the energy.
        assert np.concatenate([force, moment])[i] == pytest.approx(slope, abs=1e-7)
    assert np.abs(moment).max() > 0.1


def test_driven_slider_and_driven_hinge_push_back():
    """The force along a driven guide and the moment about a driven hinge, by differences of the energy."""

    def at(travel, turn):
        table = guided()
        table["nodes"]["A"] |= {"support": "hinge"}
        table["motions"] = {
            "a": {"node": "A", "rotation": 0.4 + turn},
            "b": {"node": "B", "displacement": ((0.1 + travel) * np.array([-1, -0.3])).tolist()},
        }
        return answer(table, 4, 6)

    h, step = 1e-3, at(0, 0)
    slopes = []
    for pick in ((1, 0), (0, 1)):
        e = [at(*(k * h * np.array(pick))).energy["total"] for k in (-2, -1, 1, 2)]
        slopes.append((e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h))
    assert step.reaction("B")[0] @ [-1, -0.3, 0] == pytest.approx(slopes[0], abs=1e-7)
    assert step.reaction("A")[1][2] == pytest.approx(slopes[1], abs=1e-7)
    assert min(abs(s) for s in slopes) > 0.1


@pytest.mark.parametrize("vector", [[0.4, -0.3, 0.6], [0.0, 0.0, 3.5], [2.5, -1.0, 2.0]])
def test_moving_all_supports_together_moves_the_answer(vector):
    """A rigid motion prescribed at the only clamp turns an otherwise unloaded scene without strain."""
    table = bend_45()
    del table["gravity"], table["loads"]
    table["motions"] = {"m": {"node": "A", "rotation": vector, "displacement": [0.1, 0.2, 0.3]}}
    step = answer(table)
    end = np.asarray(table["nodes"]["B"]["position"])
    expected = quat.rotate(quat.from_rotation_vector(vector), end) + np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(step.position("B"), expected, atol=1e-12)
    assert step.energy["elastic"] == pytest.approx(0.0, abs=1e-20)
    np.testing.assert_allclose(np.concatenate(step.reaction("A")), 0.0, atol=1e-11)


def test_stiffness_acts_about_the_sections_axes():
    """Small tip forces on straight cantilevers in any direction: F L^3 / 3 EI about the right axis."""
    direction = np.array([2.0, 1.0, -2.0]) / 3.0
    b2 = np.cross([0.3, -1.0, 0.2], direction)
    b2 /= np.linalg.norm(b2)
    b3 = np.cross(direction, b2)
    for across, key in ((b2, "EI3"), (b3, "EI2")):
        table = cantilever()
        table["sections"]["s"] = {**UNLIKE}
        table["nodes"]["A"]["position"] = [0.5, 0.5, 0.5]
        table["nodes"]["B"]["position"] = (direction + 0.5).tolist()
        table["members"]["m"]["b2"] = (b2 + 0.4 * direction).tolist()
        table["loads"]["tip"]["value"] = (1e-5 * across).tolist()
        moved = answer(table, 2, 5).position("B") - direction - 0.5
        np.testing.assert_allclose(moved @ across, 1e-5 / (3 * UNLIKE[key]), rtol=1e-9)  # next term 1e-10


def test_twist_and_bending_of_a_quarter_ring():
    """Small out-of-plane tip force on a circular quarter: bending EI2 and torsion GJ by Castigliano."""
    radius, force = 1.3, 1e-6
    end = [radius, radius, 0.0]
    table = {
        "sections": {"s": {**UNLIKE}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": end}},
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s", "shape": arc_across([0, 0, 0], end, np.pi / 2, np.eye(3)[2])}
        },
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 0, force]}},
    }
    # With phi from the free end: bending F R sin(phi), torsion F R (1 - cos(phi)).
    bending, torsion = np.pi / 4, 3 * np.pi / 4 - 2
    expected = force * radius**3 * (bending / UNLIKE["EI2"] + torsion / UNLIKE["GJ"])
    assert answer(table, 3, 6).position("B")[2] == pytest.approx(expected, rel=1e-9)


def test_distributed_load_of_a_cantilever():
    """Small loads: w L^4 / 8 EI, and profile x/L: 11 w L^4 / 120 EI; gravity the same through the mass."""
    table = cantilever()
    spread = {"type": "distributed", "member": "m", "value": [0, 1e-6]}
    table["loads"] = {"q": spread}
    assert answer(table).position("B")[1] == pytest.approx(1e-6 / 8, rel=1e-9)
    table["loads"] = {"q": spread | {"profile": {"polynomial": [0, 1]}}}
    assert answer(table).position("B")[1] == pytest.approx(11e-6 / 120, rel=1e-9)
    table["loads"] = {}
    table["gravity"] = [0, 1e-6 / SOFT["rhoA"]]
    assert answer(table).position("B")[1] == pytest.approx(1e-6 / 8, rel=1e-9)


def test_histories_are_factors_of_their_own():
    table = cantilever((0.0, 4.0))
    table["loads"] |= {"side": {"type": "force", "node": "B", "value": [-2.0, 0.0], "history": "h"}}
    table["histories"] = {"h": {"t": [0, 1, 2], "value": [1.0, 3.0, 3.0]}}
    step = solve_model(model_of(table, 3, 5), 0.5)
    plain = cantilever((-2.0 * 2.0, 0.5 * 4.0))
    np.testing.assert_allclose(step.position("B"), answer(plain).position("B"), atol=1e-12)


def test_zoo_bends_a_lot():
    """The identities are tried where they are not linear: each turns somewhere by 0.15 rad or more."""
    for name, scene in {**PLANE, **SPACE}.items():
        step = answer(scene())
        turned = [
            2 * np.arccos(np.clip(np.abs(step.along(m, PLACES)["quaternion"][:, 0]), 0, 1)).max()
            for m in step.model.members
        ]
        assert max(turned) > 0.15, name
