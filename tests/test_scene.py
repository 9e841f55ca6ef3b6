"""The scene: what it accepts, the sentence for everything else, and why it is plane or in space."""

import copy
import pickle
import re

import numpy as np
import pytest
from pydantic import ValidationError

from sfetcas import solve
from sfetcas.description.answers import answer_name
from sfetcas.description.scene import Analysis, Expect, History, Load, Member, Motion, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.description.supports import drives
from sfetcas.errors import SceneError

MISSING = ...


def table(changes=()):
    """A clamped strip with a force at its tip as a plain table, with values set or left out by place."""
    values = {
        "sections": {"strip": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}, "thin": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "strip"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": [0, 1, 0]}},
    }
    for place, value in copy.deepcopy(dict(changes)).items():
        *outer, key = place.split("/")
        inner = values
        for part in outer:
            inner = inner.setdefault(part, {})
        if value is MISSING:
            del inner[key]
        else:
            inner[key] = value
    return values


def made(changes):
    return Scene.from_dict(table(changes))


def refused(changes, message):
    with pytest.raises(SceneError, match=f"^{re.escape(message)}"):
        made(changes)


HINGED = {"nodes/A/support": "hinge"}
GUIDED = {"nodes/A/support": "slider", "nodes/A/direction": [1, 0, 0]}
IN_SPACE = {"dimension": "space"}
DISTRIBUTED = {"loads/tip": {"type": "distributed", "member": "beam", "value": [0, 1]}}
THIRD = {"nodes/C": {"position": [2, 0]}, "members/more": {"nodes": ["B", "C"], "section": "strip"}}


@pytest.mark.parametrize(
    ("place", "sentence"),
    [
        ("spring", "unknown key 'spring'"),
        ("gravitty", "unknown key 'gravitty'; did you mean 'gravity'?"),
        ("nodes/A/suport", "nodes.A: unknown key 'suport'; did you mean 'support'?"),
        ("members/beam/sections", "members.beam: unknown key 'sections'; did you mean 'section'?"),
        ("members/beam/shape/kind", "members.beam.shape: "),
        ("loads/tip/valu", "loads.tip: unknown key 'valu'; did you mean 'value'?"),
        ("motions/m/rotations", "motions.m: unknown key 'rotations'; did you mean 'rotation'?"),
        ("histories/h/time", "histories.h: unknown key 'time'; accepted: interpolation, polynomial, t, value"),
        ("analysis/acuracy", "analysis: unknown key 'acuracy'; did you mean 'accuracy'?"),
        ("sections/strip/EI", "sections.strip: unknown key 'EI'; did you mean"),
    ],
)
def test_unknown_keys(place, sentence):
    refused({place: 1.0}, sentence)


@pytest.mark.parametrize(
    ("place", "value", "sentence"),
    [
        ("title", 3, "title: found 3, accepted: a text"),
        ("dimension", "flat", "dimension: found 'flat', accepted: auto, plane, space"),
        ("gravity", 9.81, "gravity: found 9.81, accepted: [x, y] or [x, y, z]"),
        ("gravity", [0, float("nan")], "gravity: found nan, accepted: a finite number"),
        ("nodes", [], "nodes: found [], accepted: a table"),
        ("nodes/A", 1, "nodes.A: found 1, accepted: a table"),
        (
            "nodes/",
            {"position": [0, 0]},
            "nodes: found the name '', accepted: a printable name without a dot",
        ),
        ("nodes/a\nb", {"position": [0, 0]}, r"nodes: found the name 'a\nb', accepted: a printable name"),
        ("analysis/steps", {1.0, 2.0}, "analysis.steps: found {1.0, 2.0}, accepted: a list of numbers"),
        (
            "members/beam/shape",
            {"type": "helix", "radius": 0, "pitch": 1, "turns": 1, "axis": [0, 0, 1], "center": [0, 0]},
            "members.beam.shape.radius: found 0, accepted: a number above zero",
        ),
        (
            "nodes/A.1",
            {"position": [0, 0]},
            "nodes: found the name 'A.1', accepted: a printable name without a dot",
        ),
        ("nodes/A/position", MISSING, "nodes.A: the key 'position' is missing"),
        ("nodes/A/position", "origin", "nodes.A.position: found 'origin', accepted: [x, y] or [x, y, z]"),
        (
            "nodes/A/position",
            [1, 2, 3, 4],
            "nodes.A.position: found [1.0, 2.0, 3.0, 4.0], accepted: [x, y] or [x, y, z]",
        ),
        ("nodes/A/position", [0, float("inf")], "nodes.A.position: found inf, accepted: a finite number"),
        ("nodes/A/position", [0, True], "nodes.A.position: found True, accepted: a number"),
        ("nodes/A/position", [0, 10**400], "nodes.A.position: found a whole number with over 300 digits"),
        (
            "nodes/A/support",
            "clampd",
            "nodes.A.support: found 'clampd', accepted: ball, clamped, cylindrical, free, hinge, slider,",
        ),
        ("nodes/A/support", 1, "nodes.A.support: found 1, accepted: free, clamped, hinge, ball, slider, cylindrical"),
        (
            "nodes/A/axis",
            [0, 0, 0],
            "nodes.A.axis: found [0.0, 0.0, 0.0], accepted: a direction, which is not",
        ),
        (
            "nodes/A/axis",
            [1, 0, 0],
            "nodes.A.axis: neither the support nor the joint nor a member end released",
        ),
        ("nodes/A/direction", [1, 0], "nodes.A.direction: only a slider has a direction"),
        ("nodes/A/rotation", "hinge", "nodes.A.rotation: found 'hinge', accepted: only for a slider"),
        ("nodes/A/rotation", "free", "nodes.A.rotation: found 'free', accepted: ball, fixed, hinge"),
        ("nodes/A/support", "slider", "nodes.A: the key 'direction' is missing: a slider needs"),
        ("nodes/A/joint", "slider", "nodes.A.joint: found 'slider', accepted: ball, hinge, rigid"),
        ("nodes/A/start", 1, "nodes.A.start: found 1, accepted: [x, y] or [x, y, z]"),
        ("nodes/C", {"position": [2, 0]}, "nodes.C: node without member, accepted:"),
        ("members", {}, "scene without members: a scene needs at least one member"),
        ("members", MISSING, "scene without members: a scene needs at least one member"),
        ("members/beam/nodes", ["A"], "members.beam.nodes: found ['A'], accepted: a list of two"),
        ("members/beam/nodes", "AB", "members.beam.nodes: found 'AB', accepted: a list of two"),
        (
            "members/beam/nodes",
            ["A", "A"],
            "members.beam.nodes: found 'A' at both ends, accepted: two different",
        ),
        ("members/beam/nodes", ["A", "D"], "members.beam.nodes: found 'D', accepted: A, B"),
        ("members/beam/nodes", ["A", 2], "members.beam.nodes.1: found 2, accepted: a text"),
        (
            "members/beam/section",
            "stripe",
            "members.beam.section: found 'stripe', accepted: strip, thin; did you mean 'strip'?",
        ),
        ("members/beam/section", MISSING, "members.beam: the key 'section' is missing"),
        ("sections", {}, "members.beam.section: found 'strip', but the scene has no sections"),
        (
            "members/beam/type",
            "flex",
            "members.beam.type: found 'flex', accepted: flexible, rigid, small; did you mean 'flexible'",
        ),
        ("members/beam/shape", {"type": "ark"}, "members.beam.shape.type: found 'ark', accepted: arc, "),
        ("members/beam/shape", {"angle": 1.0}, "members.beam.shape: the key 'type' is missing"),
        ("members/beam/shape", "arc", "members.beam.shape: found 'arc', accepted: a table"),
        ("members/beam/b2", [0, 0, 0], "members.beam.b2: found [0.0, 0.0, 0.0], accepted: a direction"),
        ("members/beam/element", "SFET1", "members.beam.element: found 'SFET1', accepted: SFET2, "),
        ("members/beam/element", "SFET10", "members.beam.element: found 'SFET10', accepted: SFET2, "),
        (
            "members/beam/elements",
            0,
            "members.beam.elements: found 0, accepted: a whole number from 1 to 1000000",
        ),
        ("members/beam/elements", 1000001, "members.beam.elements: found 1000001, accepted: a whole number"),
        ("members/beam/elements", True, "members.beam.elements: found True, accepted: a whole number"),
        ("members/beam/elements", 2.0, "members.beam.elements: found 2.0, accepted: a whole number"),
        ("members/beam/release", ["rigid"], "members.beam.release: found ['rigid'], accepted: a list of two"),
        (
            "members/beam/release",
            ["rigid", "ful"],
            "members.beam.release.1: found 'ful', accepted: ball, cylindrical, hinge, rigid, slider",
        ),
        ("sections/strip/EI3", 0.0, "sections.strip.EI3: found 0, accepted: a number above zero"),
        ("sections/strip/GJ", -1.0, "sections.strip.GJ: found -1, accepted: a number above zero"),
        ("sections/strip/EI3", float("nan"), "sections.strip.EI3: found nan, accepted: a finite number"),
        ("loads/tip/type", "push", "loads.tip.type: found 'push', accepted: distributed, force, moment"),
        ("loads/tip/node", "C", "loads.tip.node: found 'C', accepted: A, B"),
        ("loads/tip/node", MISSING, "loads.tip: neither node nor member is given, accepted: one of them"),
        ("loads/tip/member", "beam", "loads.tip: found node 'B' and member 'beam', accepted: one of them"),
        ("loads/tip/at", 0.5, "loads.tip.at: found 0.5, accepted: only with a member"),
        ("loads/tip/at", 1.5, "loads.tip.at: found 1.5, accepted: a fraction of the length, from 0 to 1"),
        (
            "loads/tip/value",
            1.0,
            "loads.tip.value: found 1, accepted: [x, y] or [x, y, z]; only a moment may be",
        ),
        ("loads/tip/value", "up", "loads.tip.value: found 'up', accepted: a number, [x, y] or [x, y, z]"),
        ("loads/tip/value", [1], "loads.tip.value: found [1.0], accepted: a number, [x, y] or [x, y, z]"),
        ("loads/tip/value", [0, float("inf")], "loads.tip.value: found inf, accepted: a finite number"),
        ("loads/tip/profile", 1.0, "loads.tip.profile: not accepted with a force; only a distributed load"),
        ("loads/tip/history", "ramp", "loads.tip.history: found 'ramp', but the scene has no histories"),
        ("motions/m", {"node": "A"}, "motions.m: neither displacement nor rotation is given"),
        ("motions/m", {"rotation": 1.0}, "motions.m: the key 'node' is missing"),
        ("motions/m", {"node": "Z", "rotation": 1.0}, "motions.m.node: found 'Z', accepted: A, B"),
        (
            "motions/m",
            {"node": "A", "rotation": 1.0, "history": "h"},
            "motions.m.history: found 'h', but the scene",
        ),
        (
            "motions/m",
            {"node": "A", "rotation": "half"},
            "motions.m.rotation: found 'half', accepted: a number, [x",
        ),
        (
            "motions/m",
            {"node": "A", "displacement": 1.0},
            "motions.m.displacement: found 1.0, accepted: [x, y]",
        ),
        (
            "motions/m",
            {"node": "B", "displacement": [1, 0]},
            "motions.m.node: found 'B', which is free and cannot be moved, accepted: a node with a support",
        ),
        (
            "analysis/type",
            "statics",
            "analysis.type: found 'statics', accepted: dynamic, modes, path, static; did you mean 'static'?",
        ),
        ("analysis/accuracy", 0, "analysis.accuracy: found 0, accepted: from 1e-14, what rounding leaves, to 0.1"),
        (
            "analysis/accuracy",
            1e-20,
            "analysis.accuracy: found 1e-20, accepted: from 1e-14, what rounding leaves, to 0.1",
        ),
        ("analysis/accuracy", 0.2, "analysis.accuracy: found 0.2, accepted: from 1e-14, what rounding leaves, to 0.1"),
        ("analysis/steps", [], "analysis.steps: found an empty list, accepted: a list of numbers"),
        ("analysis/steps", 1.0, "analysis.steps: found 1.0, accepted: a list of numbers"),
        ("analysis/steps", [1, float("nan")], "analysis.steps: found nan, accepted: a finite number"),
        ("analysis/unstable", "go", "analysis.unstable: found 'go', accepted: leave, stay"),
        ("analysis/equilibria", "two", "analysis.equilibria: found 'two', accepted: all, one"),
        ("histories/h", {"t": [0, 1]}, "histories.h: accepted: either value or polynomial, one of them"),
        (
            "histories/h",
            {"t": [0, 1], "value": [0]},
            "histories.h.value: found 1 numbers, accepted: 2, one for each",
        ),
        (
            "histories/h",
            {"t": [0, 0], "value": [0, 1]},
            "histories.h.t: found [0.0, 0.0], accepted: rising numbers",
        ),
        (
            "histories/h",
            {"t": [], "value": []},
            "histories.h.t: found an empty list, accepted: a list of numbers",
        ),
        (
            "histories/h",
            {"t": [0], "polynomial": []},
            "histories.h.polynomial: found 0 for 1 numbers t, accepted: one",
        ),
        ("expect", {"quantity": "factor"}, "expect: found {'quantity': 'factor'}, accepted: a list"),
        ("expect", [{"quantity": "factor"}], "expect.0: the key 'value' is missing"),
        ("expect", [{"quantity": "factor", "value": 1.5}], "expect.0: the key 'tolerance' is missing"),
        (
            "expect",
            [{"quantity": "factor", "value": None}],
            "expect.0.value: found None, accepted: a number",
        ),
        (
            "expect",
            [{"quantity": "x", "value": 1.5, "tolerance": -1}],
            "expect.0.tolerance: found -1, accepted: zero",
        ),
        (
            "expect",
            [{"quantity": "nodes.C.angle", "value": 1}],
            "expect.0.quantity: found 'C', accepted: A, B",
        ),
        (
            "expect",
            [{"quantity": "factor", "value": 1, "step": 2}],
            "expect.0.step: found 2, accepted: a factor of",
        ),
        (
            "expect",
            [{"quantity": "factor", "value": 1, "at": 2}],
            "expect.0.at: found 2, accepted: a fraction",
        ),
    ],
)
def test_values(place, value, sentence):
    refused({place: value}, sentence)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"loads/tip/node": MISSING, "loads/tip/member": "beam"}, "loads.tip: the key 'at' is missing"),
        (
            {"loads/tip/node": MISSING, "loads/tip/member": "b", "loads/tip/at": 1},
            "loads.tip.member: found 'b', acc",
        ),
        ({**DISTRIBUTED, "loads/tip/node": "B"}, "loads.tip.node: found 'B', accepted: a member"),
        (
            {**DISTRIBUTED, "loads/tip/member": MISSING},
            "loads.tip: the key 'member' is missing: a distributed load",
        ),
        (
            {**DISTRIBUTED, "loads/tip/at": 0.5},
            "loads.tip.at: found 0.5, accepted: 'from' and 'to'",
        ),
        ({**DISTRIBUTED, "loads/tip/value": 2.0}, "loads.tip.value: found 2, accepted: [x, y] or [x, y, z]"),
        (
            {**GUIDED, "nodes/A/direction": [0, 0]},
            "nodes.A.direction: found [0.0, 0.0, 0.0], accepted: a direction",
        ),
        (
            {"loads/tip/type": "moment", "nodes/B/joint": "hinge"},
            "loads.tip.node: node 'B' has no rotation of its own",
        ),
        (
            {"loads/tip/type": "moment", "nodes/B/joint": "ball"},
            "loads.tip.node: node 'B' has no rotation of its own",
        ),
    ],
)
def test_combinations(changes, sentence):
    refused(changes, sentence)


@pytest.mark.parametrize(
    ("changes", "motion", "sentence"),
    [
        (
            {"nodes/A/support": "ball"},
            1.0,
            "motions.m.rotation: node 'A' turns freely as a ball; only nodes that are",
        ),
        ({**GUIDED, "nodes/A/rotation": "ball"}, 1.0, "motions.m.rotation: node 'A' turns freely as a ball"),
        (
            {"nodes/A/joint": "hinge"},
            1.0,
            "motions.m.rotation: node 'A' has no rotation of its own, as its joint is a",
        ),
        (
            {"nodes/A/joint": "ball"},
            1.0,
            "motions.m.rotation: node 'A' has no rotation of its own, as its joint is a",
        ),
        (
            HINGED,
            [0, 0, 1],
            "motions.m.rotation: found [0.0, 0.0, 1.0], accepted: a number, the angle about the axis",
        ),
        (
            {**GUIDED, "nodes/A/rotation": "hinge"},
            [0, 0, 1],
            "motions.m.rotation: found [0.0, 0.0, 1.0], accepted: a n",
        ),
        (
            IN_SPACE,
            1.0,
            "motions.m.rotation: found 1.0, accepted: a rotation vector [x, y, z], as the scene is in",
        ),
        ({**GUIDED, "dimension": "space"}, 1.0, "motions.m.rotation: found 1.0, accepted: a rotation vector"),
    ],
)
def test_rotations_that_a_support_cannot_be_given(changes, motion, sentence):
    refused({**changes, "motions/m": {"node": "A", "rotation": motion}}, sentence)


@pytest.mark.parametrize(
    ("changes", "rotation"),
    [
        ({}, 1.0),
        ({}, [0, 0, 1]),
        (HINGED, 1.0),
        (IN_SPACE, [0, 1, 0]),
        ({**HINGED, **IN_SPACE, "nodes/A/axis": [0, 1, 0]}, 1.0),
        ({"nodes/B/support": "slider", "nodes/B/direction": [1, 0], "nodes/B/rotation": "hinge"}, 1.0),
    ],
)
def test_rotations_that_a_support_can_be_given(changes, rotation):
    node = "B" if "nodes/B/support" in changes else "A"
    assert "m" in made({**changes, "motions/m": {"node": node, "rotation": rotation}}).motions


@pytest.mark.parametrize("kind", [{"rotation": 1.0}, {"displacement": [1, 0]}])
def test_two_motions_of_one_kind_at_a_node(kind):
    (key,) = kind
    motions = {"one": {"node": "A", **kind}, "two": {"node": "A", **kind}}
    refused({"motions": motions}, f"motions.two.{key}: node 'A' has a {key} from motions.one already")


def test_a_displacement_and_a_rotation_of_one_node_may_be_two_motions():
    motions = {"one": {"node": "A", "rotation": 1.0}, "two": {"node": "A", "displacement": [1, 0]}}
    assert len(made({"motions": motions}).motions) == 2


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"nodes/A/support": "free"},
            "free to move: nodes A, B moving along x, y and turning; neither stiffness nor a load holds it, add",
        ),
        (
            {"nodes/A/support": "free", **IN_SPACE},
            "free to move: nodes A, B moving along x, y, z and turning; neither",
        ),
        (GUIDED, "free to move: nodes A, B moving along [1, 0]; neither stiffness nor a load holds it, add a support"),
        (
            {**GUIDED, "nodes/A/direction": [-3, 4]},
            "free to move: nodes A, B moving along [-0.6, 0.8]; neither",
        ),
        (
            {**GUIDED, **IN_SPACE, "nodes/B/support": "slider", "nodes/B/direction": [2, 0]},
            "free to move: nodes A, B moving along [1, 0, 0]; neither",
        ),
        (
            {
                "nodes/C": {"position": [0, 1]},
                "nodes/D": {"position": [1, 1]},
                "members/more": {"nodes": ["C", "D"], "section": "strip"},
            },
            "free to move: nodes C, D moving along x, y and turning; neither",
        ),
        (
            {**THIRD, "nodes/A/support": "free"},
            "free to move: nodes A, B, C moving along x, y and turning; neither",
        ),
        (
            {**GUIDED, "motions/m": {"node": "A", "displacement": [0, 1]}},
            "free to move: nodes A, B moving along [1, 0]; neither",
        ),
    ],
)
def test_structures_that_float(changes, sentence):
    refused(changes, sentence)


@pytest.mark.parametrize(
    "changes",
    [
        HINGED,
        {"members/beam/nodes": ["B", "A"]},
        {"nodes/A/support": "ball", **IN_SPACE},
        {**GUIDED, "nodes/B/support": "slider", "nodes/B/direction": [0, 1]},
        {**GUIDED, **IN_SPACE, "nodes/B/support": "slider", "nodes/B/direction": [0, 0, 1]},
        {**GUIDED, "nodes/B/support": "ball"},
        {**GUIDED, "motions/m": {"node": "A", "displacement": [-1, 1]}},
        THIRD,
    ],
)
def test_structures_that_are_held(changes):
    assert made(changes).resolved_dimension


def test_a_displacement_with_a_component_along_the_guide_drives_it():
    slider = Node(position=[0, 0], support="slider", direction=[1e-200, 1e-200])
    assert drives(slider, (1.0, 0.0, 0.0))
    assert not drives(slider, (1.0, -1.0, 0.0))
    assert not drives(slider, (0.0, 0.0, 0.0))
    assert not drives(Node(position=[0, 0], support="clamped"), (1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"sections/strip/EI3": MISSING},
            "the key 'EI3' is missing: members.beam needs it in plane (all positions",
        ),
        (
            {"members/beam/b2": [0, 0, 1], "sections/strip/EI2": MISSING},
            "the key 'EI2' is missing: members.beam needs",
        ),
        (
            {**IN_SPACE, "sections/strip/EI2": MISSING},
            "the key 'EI2' is missing: members.beam needs it in space",
        ),
        (
            {**IN_SPACE, "sections/strip/EI3": MISSING},
            "the key 'EI3' is missing: members.beam needs it in space",
        ),
        (
            {"loads/tip/value": [0, 0, 1], "sections/strip/GJ": MISSING},
            "the key 'GJ' is missing: members.beam needs it in space (loads.tip.value has a z component)",
        ),
        (
            {"gravity": [0, -9.81], "sections/strip/rhoA": MISSING},
            "the key 'rhoA' is missing: gravity acts on the mass",
        ),
    ],
)
def test_what_a_section_lacks(changes, sentence):
    refused(changes, f"sections.strip: {sentence}")


def test_a_section_needs_only_what_the_scene_asks_for():
    assert made({"members/beam/section": "thin"}).resolved_dimension == "plane"
    bare = {"sections/strip": {"EI2": 1.0}, "members/beam/b2": [0, 0, 1]}
    assert made(bare).resolved_dimension == "plane"


IN_PLANE = "all positions, shapes, axes, loads and motions lie in x-y"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"nodes/B/position": [1, 0, 0.5]}, "nodes.B.position has a z component"),
        ({"nodes/B/start": [1, 0, 0.5]}, "nodes.B.start has a z component"),
        (
            {"nodes/B/support": "slider", "nodes/B/direction": [1, 0, 1]},
            "nodes.B.direction has a z component",
        ),
        ({**HINGED, "nodes/A/axis": [0, 1, 0]}, "nodes.A.axis is not along z"),
        (
            {
                "nodes/B/support": "slider",
                "nodes/B/direction": [1, 0],
                "nodes/B/rotation": "hinge",
                "nodes/B/axis": [1, 0, 0],
            },
            "nodes.B.axis is not along z",
        ),
        ({"nodes/A/joint": "hinge", "nodes/A/axis": [0, 1, 1]}, "nodes.A.axis is not along z"),
        (
            {"members/beam/release": ["rigid", "hinge"], "nodes/B/axis": [1, 0, 0]},
            "nodes.B.axis is not along z",
        ),
        ({"members/beam/b2": [0, 1, 1]}, "members.beam.b2 is neither along z nor in x-y"),
        (
            {"members/beam/shape": {"type": "arc", "angle": 1.0, "normal": [0, 1, 0]}},
            "members.beam.shape leaves x-y",
        ),
        (
            {"members/beam/shape": {"type": "curvature", "length": 1.0, "twist": [1.0]}},
            "members.beam.shape twists",
        ),
        (
            {"nodes/B/position": [1, 0, 0.1], "nodes/A/position": [0, 0, 0.1]},
            "nodes.A.position has a z component",
        ),
        ({"loads/tip/value": [0, 0, 1]}, "loads.tip.value has a z component"),
        ({**DISTRIBUTED, "loads/tip/value": [0, 1, 1]}, "loads.tip.value has a z component"),
        ({"gravity": [0, -9.81, 0.1]}, "gravity has a z component"),
        ({"motions/m": {"node": "A", "displacement": [0, 0, 1]}}, "motions.m.displacement has a z component"),
        ({"motions/m": {"node": "A", "rotation": [0, 1, 0]}}, "motions.m.rotation is not about z"),
    ],
)
def test_what_makes_a_scene_spatial(changes, reason):
    found = made(changes)
    assert (found.resolved_dimension, found.dimension_reason) == ("space", reason)
    place = reason.split(" ")[0]
    refused({**changes, "dimension": "plane"}, f"{place}: dimension is set to 'plane', but {reason}")


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"nodes/B/position": [1, 0, 1e-17]},
        {"loads/tip/value": [0, 1, 1e-17]},
        {"nodes/A/joint": "hinge", "nodes/A/axis": [0, 0, -2]},
        {"nodes/B/joint": "ball", **THIRD},
        {"members/beam/b2": [0, 0, 1]},
        {"members/beam/b2": [0, -1, 0]},
        {"members/beam/shape": {"type": "arc", "angle": -1.0}},
        {"loads/tip": {"type": "moment", "node": "B", "value": 2.0}},
        {"loads/tip": {"type": "moment", "node": "B", "value": [0, 0, 2.0]}},
        {"gravity": [0, -9.81, 0]},
        {"motions/m": {"node": "A", "rotation": 1.0, "displacement": [1, 0, 0]}},
    ],
)
def test_what_keeps_a_scene_plane(changes):
    found = made(changes)
    assert (found.resolved_dimension, found.dimension_reason) == ("plane", IN_PLANE)
    assert made({**changes, "dimension": "plane"}).resolved_dimension == "plane"


def test_space_is_taken_where_it_is_asked_for():
    assert made(IN_SPACE).dimension_reason == "dimension is set to 'space'"
    assert made(IN_SPACE).resolved_dimension == "space"


def test_size_is_the_diagonal_of_the_undeformed_members():
    assert made({"nodes/B/position": [3, 4]}).size == pytest.approx(5.0, rel=1e-12)
    half = made({"nodes/B/position": [2, 0], "members/beam/shape": {"type": "arc", "angle": np.pi}})
    assert half.size == pytest.approx(np.hypot(2.0, 1.0), rel=1e-3)


def test_center_lines_by_name():
    line = made({"nodes/B/position": [3, 4]}).center_lines["beam"]
    assert line.length == pytest.approx(5.0, rel=1e-12)
    with pytest.raises(SceneError, match=r"^members\.beam\."):
        made({"nodes/B/position": [0, 0]})


def test_python_words_are_the_words_of_the_file():
    spoken = Scene(
        sections={"strip": CrossSection(EI2=1, EI3=1, GJ=1, rhoA=1), "thin": CrossSection(EI3=1)},
        nodes={"A": Node(position=np.zeros(3), support="clamped"), "B": Node(position=(1, 0))},
        members={"beam": Member(nodes=("A", "B"), section="strip")},
        loads={"tip": Load(type="force", node="B", value=np.array([0, 1]))},
    )
    assert spoken == made({})
    assert spoken != made({"title": "other"})
    assert spoken != 1


def test_arrays_and_their_scalars_are_numbers():
    found = made({"analysis/steps": np.linspace(0, 1, 3), "analysis/accuracy": np.float32(0.01)})
    assert found.analysis.steps == (0.0, 0.5, 1.0)
    assert made({"members/beam/elements": np.int64(4)}).members["beam"].elements == 4
    assert Load(type="moment", node="A", value=np.array(2.0)).value == 2.0


RICH = {
    "title": "rich",
    "nodes/B/support": "slider",
    "nodes/B/direction": [1, 0, 0],
    "nodes/B/rotation": "hinge",
    "members/beam/shape": {"type": "arc", "angle": 0.5},
    "members/beam/elements": 4,
    "members/beam/release": ["hinge", "rigid"],
    "loads/line": {
        "type": "distributed",
        "member": "beam",
        "value": [0, 1],
        "profile": {"polynomial": [1, -1]},
    },
    "loads/mid": {"type": "moment", "member": "beam", "at": 0.25, "value": 0.1, "history": "ramp"},
    "motions/m": {"node": "A", "rotation": 0.5, "history": "cubic"},
    "histories/ramp": {"t": [0, 1, 2], "value": [0, 1, 0]},
    "histories/cubic": {"t": [0, 2], "polynomial": [[0, 0, 3, -2]]},
    "analysis": {"accuracy": 1e-6, "steps": [0.5, 1], "unstable": "stay"},
    "expect": [
        {"quantity": "nodes.B.position", "value": [1, [2, 3]], "tolerance": 0.1, "step": 0.5},
        {"quantity": "certificate.stable", "value": True},
        {"quantity": "certificate.negative", "value": 0},
    ],
}


def test_round_trip_through_a_table():
    found = made(RICH)
    again = Scene.from_dict(found.to_dict())
    assert again == found
    assert again.to_dict() == found.to_dict()
    assert found.to_dict()["motions"] == {"m": {"node": "A", "rotation": 0.5, "history": "cubic"}}
    assert found.expect[1].value is True
    assert type(found.expect[2].value) is int


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda found: pickle.loads(pickle.dumps(found))])
def test_copies_are_equal(copied):
    found = made(RICH)
    assert copied(found) == found
    assert copied(found).resolved_dimension == "plane"


def test_a_table_is_needed():
    with pytest.raises(SceneError, match=r"^found \[\], accepted: a table"):
        Scene.from_dict([])


def test_replaced_values_are_checked():
    found = made({})
    changed = found.replace(analysis=Analysis(steps=[2.0]))
    assert changed.analysis.steps == (2.0,)
    assert changed.replace(analysis=Analysis()) == found
    assert found.nodes["B"].replace(support="ball").position == (1.0, 0.0, 0.0)
    with pytest.raises(SceneError, match="scene without members"):
        found.replace(members={})


def test_a_scene_without_load_can_be_looked_at_but_not_solved():
    unloaded = made({}).replace(loads={})
    with pytest.raises(SceneError, match=r"^scene without load: statics needs at least one load, "):
        solve(unloaded)


@pytest.mark.parametrize("pick", [lambda s: s, lambda s: s.nodes["A"], lambda s: s.loads["tip"], lambda s: s.analysis])
def test_records_are_frozen(pick):
    record = pick(made({}))
    key = next(iter(type(record).model_fields))
    with pytest.raises(ValidationError, match="frozen"):
        setattr(record, key, getattr(record, key))


@pytest.mark.parametrize("key", ["sections", "nodes", "members", "loads", "motions", "histories", "center_lines"])
def test_tables_are_read_only(key):
    with pytest.raises(TypeError, match="does not support item assignment"):
        getattr(made({}), key)["new"] = None


def test_a_scene_keeps_no_hold_of_what_it_was_made_from():
    values = table()
    found = Scene.from_dict(values)
    values["nodes"]["B"]["position"][0] = 7.0
    values["loads"].clear()
    assert found == made({})


def test_history_is_linear_between_and_constant_outside():
    history = History(t=[0, 1, 3], value=[1, 2, 0])
    found = [history.factor(t) for t in (-1, 0, 0.5, 1, 2, 3, 4)]
    assert found == pytest.approx([1, 1, 1.5, 2, 1, 0, 0], abs=1e-15)
    assert History(t=[1], value=[5]).factor(0) == History(t=[1], value=[5]).factor(2) == 5.0


def test_history_by_polynomials_in_the_fraction_of_the_interval():
    history = History(t=[0, 2, 3], polynomial=[[0, 0, 1], [4, -1]])
    found = [history.factor(t) for t in (-1, 0, 1, 2, 2.5, 3, 9)]
    assert found == pytest.approx([0, 0, 0.25, 4, 3.5, 3, 3], abs=1e-15)


def test_a_moment_by_one_number_is_about_z():
    assert Load(type="moment", node="B", value=2).vector == (0.0, 0.0, 2.0)
    assert Load(type="force", node="B", value=[1, 2]).vector == (1.0, 2.0, 0.0)


def test_keys_are_given_by_their_names():
    with pytest.raises(SceneError, match=r"^Member: found a value without a name, .* as Member\(nodes=\.\.\.\)$"):
        Member(["A", "B"], section="strip")
    with pytest.raises(SceneError, match=r"^Node: found 2 values without a name"):
        Node([0, 0], "clamped")


def test_how_the_ground_lets_a_node_turn():
    slider = Node(position=[0, 0], support="slider", direction=[1, 0], rotation="ball")
    assert [
        slider.turn,
        *(Node(position=[0, 0], support=s).turn for s in ("free", "clamped", "hinge", "ball")),
    ] == ["ball", "free", "fixed", "hinge", "ball"]


def test_expected_values_keep_their_type():
    assert Expect(quantity="x", value=np.array([1.0, 2.0]), tolerance=0).value == (1.0, 2.0)
    assert Expect(quantity="x", value="neutral").value == "neutral"
    assert Motion(node="A", rotation=1).rotation == 1.0


def test_standard_terms_are_other_names():
    lifted = {"node": "B", "displacement": [0, 0.1, 0]}
    held = {"nodes/B/support": "clamped", "members/beam/type": "superelement"}
    one, other = made({**held, "prescribed": {"lift": lifted}}), made({**held, "motions": {"lift": lifted}})
    assert one == other
    assert one.members["beam"].type == "small"
    assert answer_name("prescribed.lift.force.y").text == "motions.lift.force.1"
    both = {**held, "prescribed": {"lift": lifted}, "motions": {"lift": lifted}}
    refused(both, "found 'motions' and 'prescribed', which are the same table, accepted: one of them")
    refused({"members/beam/type": "superelements"}, "members.beam.type: found 'superelements', accepted: ")
