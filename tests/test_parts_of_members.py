"""Distributed loads on parts of members: as on members divided there, and together as on the whole."""

import re

import numpy as np
import pytest
from test_codegen import built, needs_compiler, said

from sfetcas import Load, Scene, SceneError, assemble, export, load, parametric, solve, solve_model
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.pictures.plotting import picture

ROUNDING = 1e-10
"""Of positions of about 1 m that Newton's method finds to its residual of 1e-12."""

SECTION = {"EI2": 0.7, "EI3": 1.0, "GJ": 0.6, "rhoA": 1.0, "rhoI": [0.02, 0.01, 0.01]}
PART = {"from": 0.25, "to": 0.75}


def whole(loads, kind="flexible", **more):
    """A clamped member of 1 m, of four elements where it is flexible."""
    member = {"nodes": ["A", "B"], "section": "s", "type": kind}
    member |= {"element": "SFET4", "elements": 4} if kind == "flexible" else {}
    table = {
        "sections": {"s": SECTION},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"m": member},
        "loads": loads,
    }
    return Scene.from_dict(table | more)


def divided(value, frame="fixed", profile=None, **more):
    """The same of three members, of which the middle one is loaded."""
    places = {"A": 0.0, "C": 0.25, "D": 0.75, "B": 1.0}
    member = {"section": "s", "element": "SFET4"}
    table = {
        "sections": {"s": SECTION},
        "nodes": {name: {"position": [x, 0, 0]} for name, x in places.items()},
        "members": {
            "one": {"nodes": ["A", "C"], "elements": 1, **member},
            "two": {"nodes": ["C", "D"], "elements": 2, **member},
            "three": {"nodes": ["D", "B"], "elements": 1, **member},
        },
        "loads": {"w": {"type": "distributed", "member": "two", "value": value, "frame": frame}},
    }
    table["nodes"]["A"]["support"] = "clamped"
    if profile is not None:
        table["loads"]["w"]["profile"] = profile
    return Scene.from_dict(table | more)


def spread(value, frame="fixed", **keys):
    return {"type": "distributed", "member": "m", "value": value, "frame": frame, **keys}


FRAMES = [(frame, value) for frame in ("fixed", "follower", "section") for value in ([1, 5], [0.5, 4, 1.5])]
each_frame = pytest.mark.parametrize(("frame", "value"), FRAMES)


@each_frame
def test_a_load_on_a_part_is_that_on_a_member_of_its_own(frame, value):
    one = solve(whole({"w": spread(value, frame, **PART)})).last
    other = solve(divided(value, frame)).last
    assert len(one.model.mesh.cuts["m"]) == 5
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=ROUNDING)
    np.testing.assert_allclose(one.reaction("A"), other.reaction("A"), atol=10 * ROUNDING)
    along = np.array([0.0, 0.2, 0.5, 0.8, 1.0])
    found = one.along("m", 0.25 + 0.5 * along)
    for key, values in other.along("two", along).items():
        # At the ends of the part what is told belongs to one of the two sides; forces do not jump there.
        if values is not None and key not in ("s", "element"):
            np.testing.assert_allclose(found[key], values, atol=1e-8, err_msg=key)


@each_frame
def test_parts_together_are_the_whole(frame, value):
    ends = [0.0, 0.2, 0.5, 1.0]
    parts = {f"w{i}": spread(value, frame, **{"from": a, "to": b}) for i, (a, b) in enumerate(zip(ends, ends[1:]))}
    scenes = [whole(parts), whole({"w": spread(value, frame)})]
    # On the mesh that ends where parts do.
    mesh = uniform_mesh(scenes[0], 3, 6)
    one, other = (solve_model(assemble(scene, mesh)) for scene in scenes)
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=ROUNDING)
    np.testing.assert_allclose(one.reaction("A"), other.reaction("A"), atol=10 * ROUNDING)


def test_a_profile_goes_along_the_whole_member():
    one = solve(whole({"w": spread([0, 5], profile={"polynomial": [1, -2]}, **PART)})).last
    # x = 1/4 + 1/2 of the fraction of the part: 1 - 2 x = 1/2 - fraction.
    other = solve(divided([0, 5], profile={"polynomial": [0.5, -1.0]})).last
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=ROUNDING)


@pytest.mark.parametrize("kind", ["rigid", "small"])
def test_a_load_on_a_part_of_a_body_is_its_resultant(kind):
    hinged = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "springs": {"k": {"type": "rotational", "node": "A", "stiffness": 2.0}},
    }
    stiff = {"s": {"EI3": 1e7}}
    part = solve(whole({"w": spread([0, 4], **{"from": 0.2, "to": 0.6})}, kind, sections=stiff, **hinged)).last
    point = {"type": "force", "member": "m", "at": 0.4, "value": [0, 1.6]}
    # A small member of 1e7 N m2 bends by 1e-7.
    tolerance = ROUNDING if kind == "rigid" else 1e-7
    other = solve(whole({"w": point}, kind, sections=stiff, **hinged)).last
    np.testing.assert_allclose(part.position("B"), other.position("B"), atol=tolerance)
    np.testing.assert_allclose(part.reaction("A"), other.reaction("A"), atol=10 * tolerance)


def test_parts_of_a_small_member_together_are_the_whole():
    ends = [0.0, 0.3, 1.0]
    profile = {"at": [0, 0.4, 1], "value": [1, 0, 2]}
    parts = {f"w{i}": spread([0, 1], profile=profile, **{"from": ends[i], "to": ends[i + 1]}) for i in range(2)}
    one, other = (solve(whole(loads, "small")).last for loads in (parts, {"w": spread([0, 1], profile=profile)}))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=ROUNDING)


@pytest.mark.parametrize("frame", ["fixed", "follower"])
def test_vibrations_and_motions_go_on_as_of_divided_members(frame):
    loads = {"w": spread([1, 5], frame, **PART)}
    modes = {"analysis": {"type": "modes", "modes": 4}}
    one, other = (solve(scene) for scene in (whole(loads, **modes), divided([1, 5], frame, **modes)))
    np.testing.assert_allclose(one.omega, other.omega, rtol=1e-8)
    moving = {"analysis": {"type": "dynamic", "end": 0.2, "step": 0.01}}
    one, other = (solve(scene).last for scene in (whole(loads, **moving), divided([1, 5], frame, **moving)))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-8)
    np.testing.assert_allclose(one.velocity("B"), other.velocity("B"), atol=1e-7)


def test_a_path_goes_on_as_of_divided_members():
    path = {"analysis": {"type": "path", "range": [0, 6], "steps": [2.0, 6.0]}}
    one, other = (solve(scene) for scene in (whole({"w": spread([0, -4], **PART)}, **path), divided([0, -4], **path)))
    for a, b in zip(one.steps, other.steps, strict=True):
        np.testing.assert_allclose(a.position("B"), b.position("B"), atol=1e-8)


@pytest.mark.parametrize("frame", ["fixed", "section"])
def test_a_part_whose_ends_move_has_derivatives(frame):
    scene = whole({"w": spread([0.5, 4], frame, **{"from": 0.3, "to": 0.6})})
    ranges = {"loads.w.from": (0.1, 0.4), "loads.w.to": (0.5, 0.9)}
    made = parametric(scene, ranges, ["nodes.B.position", "reactions.A.moment"])
    answer, h = made.solve(), 1e-4
    for name, at in (("loads.w.from", 0.3), ("loads.w.to", 0.6)):
        low, high = (made.solve({name: at + side * h}) for side in (-1, 1))
        for key in ("nodes.B.position", "reactions.A.moment"):
            # h^2 of third derivatives of about 10, also of the error of the mesh, which moves.
            np.testing.assert_allclose(answer.jacobian[key][name], (high[key] - low[key]) / (2 * h), atol=1e-6)
    # What is one number in the parameter is the other in the scene.
    changed = made.solve({"loads.w.from": 0.2})
    wanted = solve(scene.replace({"loads.w.from": 0.2, "analysis.accuracy": 1e-8})).last
    # The accuracy of the mesh, 1e-4 of 1 m.
    np.testing.assert_allclose(changed["nodes.B.position"], wanted.position("B"), atol=1e-4)


@needs_compiler
def test_a_part_whose_end_moves_in_c(tmp_path):
    scene = whole({"w": spread([0.5, 4], **PART)})
    arguments = {"loads.w.from": (0.1, 0.4), "loads.w.value": None}
    export(scene, tmp_path / "c", name="part", arguments=arguments, results=["nodes.B.position", "energy.elastic"])
    words = re.fullmatch(r"(\d+) of (\d+) cases agree, (\d+) of them to the last bit.*\n",
                         said(built(tmp_path / "c", "part")))  # fmt: skip
    assert words
    assert words[1] == words[2] == words[3]


def test_places_that_may_meet_are_refused():
    scene = whole({"w": spread([0.5, 4], **PART)})
    with pytest.raises(SceneError, match=r"found loads.w.from and loads.w.to, which may meet, accepted: ranges apart"):
        parametric(scene, ["loads.w.from", "loads.w.to"], ["nodes.B.position"])


def test_forces_beside_each_other_move_both():
    loads = {name: {"type": "force", "member": "m", "at": at, "value": [0, 1]} for name, at in (("a", 0.3), ("b", 0.6))}
    scene = whole(loads)
    made = parametric(scene, {"loads.a.at": (0.2, 0.4), "loads.b.at": (0.5, 0.8)}, ["reactions.A.moment"])
    # Of small moments: lever times force.
    moved = made.solve({"loads.a.at": 0.25, "loads.b.at": 0.7})
    wanted = solve(scene.replace({"loads.a.at": 0.25, "loads.b.at": 0.7, "analysis.accuracy": 1e-8})).last
    np.testing.assert_allclose(moved["reactions.A.moment"], wanted.reaction("A")[1], atol=1e-4)


def test_pressure_on_parts_that_cover_a_ring_has_a_potential():
    ring = load("problems/ring_normal_pressure.toml")
    name = next(iter(ring.loads))
    one = ring.loads[name]
    parts = {"a": one.replace(to=0.4), "b": one.replace(from_=0.4)}
    whole_ring = {key: value for key, value in ring.loads.items() if key != name}
    covered = ring.model_copy(update={"loads": whole_ring | parts})
    gap = ring.model_copy(update={"loads": whole_ring | {"a": parts["a"]}})
    models = [assemble(scene, uniform_mesh(scene, 3, 8)) for scene in (ring, covered, gap)]
    assert [model.conservative for model in models] == [True, True, False]


def test_arrows_stand_on_the_part():
    figure = picture(solve(whole({"w": spread([0, 0.01], **PART)})))
    (line,) = [one for one in figure.axes[0].lines if one.get_gid() == "load-w"]
    x = line.get_xdata()
    assert (x.min(), x.max()) == pytest.approx((0.25, 0.75), abs=0.02)


def test_keys_of_a_part_are_those_of_files_and_of_python():
    one = Load(type="distributed", member="m", value=[0, 1], from_=0.2, to=0.6)
    assert one == Load.from_dict({"type": "distributed", "member": "m", "value": [0, 1], "from": 0.2, "to": 0.6})
    assert one.to_dict()["from"] == 0.2
    assert one.replace(from_=0.1).part == (0.1, 0.6)
    scene = whole({"w": one.to_dict()})
    assert scene.replace({"loads.w.from": 0.3}).loads["w"].part == (0.3, 0.6)
    assert Scene.from_dict(scene.to_dict()) == scene


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"from": 0.6, "to": 0.2}, r"loads.w.to: found 0.6 to 0.2, accepted: an end after the beginning"),
        ({"from": -1}, r"loads.w.from: found -1, accepted: a fraction of the length, from 0 to 1"),
        ({"to": "x"}, r"loads.w.to: found 'x', accepted: a number"),
        ({"fro": 0.2}, r"loads.w: unknown key 'fro'; did you mean 'from'\?"),
        ({"at": 0.2}, r"loads.w.at: found 0.2, accepted: 'from' and 'to', between which a distributed load acts"),
        ({"type": "force", "at": 0.5, "to": 0.2}, r"loads.w.to: not accepted with a force; a distributed load begins"),
    ],
)
def test_wrong_parts_are_refused(keys, sentence):
    with pytest.raises(SceneError, match=f"^{sentence}"):
        whole({"w": {"type": "distributed", "member": "m", "value": [0, 1], **keys}})
