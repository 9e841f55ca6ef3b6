"""Scene.replace: any key of a scene by its name, validated as at construction."""

import numpy as np
import pytest

from sfetcas import Analysis, CrossSection, Curvature, Load, Scene, SceneError, changed, check, dump, load, solve
from sfetcas.description.records import Record

EXPECT = {"quantity": "nodes.tip.position", "value": [0.4, 0.8, 0.0], "tolerance": 1.0, "step": 1.0}

SCENE = Scene.from_dict(
    {
        "title": "strip",
        "sections": {"strip": {"EI3": 1.0, "rhoA": {"at": [0, 1], "value": [1.0, 2.0]}}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "tip": {"position": [1, 0]}},
        "members": {"a beam's": {"nodes": ["A", "tip"], "section": "strip", "elements": 4}},
        "springs": {"k": {"node": "A", "stiffness": 1.0}},
        "loads": {"tip": {"type": "force", "node": "tip", "value": [0, 1], "history": "on"}},
        "histories": {"on": {"t": [0, 1], "value": [0.0, 1.0]}},
        "contacts": {"floor": {"type": "plane", "point": [0, -3], "normal": [0, 1], "members": "all"}},
        "analysis": {"steps": [0.5, 1.0], "accuracy": 1e-3},
        "expect": [EXPECT],
    }
)
STRIP = SCENE.to_dict()


def keys(here, path=()):
    """Every key that is given, by its name with dots, with its value: whole tables, and single entries of lists."""
    if isinstance(here, Record):
        entries = [(key, getattr(here, key)) for key in here.model_fields_set]
    elif hasattr(here, "items"):
        entries = list(here.items())
    else:
        entries = [(str(i), entry) for i, entry in enumerate(here)] if isinstance(here, tuple) else []
    for key, entry in entries:
        yield ".".join((*path, key)), entry
        yield from keys(entry, (*path, key))


def test_every_key_is_reached_and_the_scene_stays_as_it_is():
    before, every = SCENE.to_dict(), dict(keys(SCENE))
    assert {"members.a beam's.elements", "sections.strip.rhoA.value.1", "expect.0.value.2"} < {*every}
    for name, value in every.items():
        assert SCENE.replace({name: value}) == SCENE, name
        assert SCENE.replace({name: value}).model_fields_set == SCENE.model_fields_set
    assert SCENE.to_dict() == before


@pytest.mark.parametrize(
    ("changes", "place", "found"),
    [
        ({"loads.tip.value": [0, 5]}, ("loads", "tip", "value"), [0.0, 5.0, 0.0]),
        ({"loads.tip.value": np.array([0, 5])}, ("loads", "tip", "value"), [0.0, 5.0, 0.0]),
        ({"loads.tip.value.1": np.float32(5)}, ("loads", "tip", "value"), [0.0, 5.0, 0.0]),
        ({"sections.strip.EI3": np.float64(2)}, ("sections", "strip", "EI3"), 2.0),
        ({"sections.strip.EI3": np.array([2.0])}, ("sections", "strip", "EI3"), 2.0),
        ({"sections.strip.rhoA": 3}, ("sections", "strip", "rhoA"), 3.0),
        ({"sections.strip.rhoA.value.0": 3}, ("sections", "strip", "rhoA", "value"), [3.0, 2.0]),
        ({"members.a beam's.elements": np.int64(8)}, ("members", "a beam's", "elements"), 8),
        ({"members.a beam's.shape": {"type": "arc", "angle": 1}}, ("members", "a beam's", "shape", "angle"), 1.0),
        (
            {"members.a beam's.shape.type": "arc", "members.a beam's.shape.angle": 1},
            ("members", "a beam's", "shape", "angle"),
            1.0,
        ),
        ({"nodes.A.support": "hinge"}, ("nodes", "A", "support"), "hinge"),
        ({"nodes.tip": {"position": [2, 0]}}, ("nodes", "tip", "position"), [2.0, 0.0, 0.0]),
        ({"analysis.accuracy": 1e-8}, ("analysis", "accuracy"), 1e-8),
        ({"analysis.steps": np.linspace(0.5, 2, 4)}, ("analysis", "steps"), [0.5, 1.0, 1.5, 2.0]),
        ({"factor": np.float64(2)}, ("analysis", "steps"), [2.0]),
        ({"analysis.type": "dynamic", "analysis.end": 1, "analysis.steps": None}, ("analysis", "end"), 1.0),
        ({"prescribed.turn": {"node": "A", "rotation": 0.1}}, ("motions", "turn", "rotation"), 0.1),
        ({"loads.more": Load(type="moment", node="tip", value=1)}, ("loads", "more", "value"), 1.0),
        ({"histories.on.t.1": 2}, ("histories", "on", "t"), [0.0, 2.0]),
        ({"gravity": [0, -9.81]}, ("gravity",), [0.0, -9.81, 0.0]),
    ],
)
def test_values_take_the_place_of_others(changes, place, found):
    # What has no history goes by the factor, and a motion in time would push into the floor.
    scene = SCENE.replace({"contacts.floor": None})
    there = scene.replace(changes).to_dict()
    for key in place:
        there = there[key]
    assert there == found
    assert changed(scene, changes) == scene.replace(changes)


def test_whole_keys_are_keywords():
    other = SCENE.replace({"loads.tip.value": [0, 2]}, title="other", analysis=Analysis(steps=[2]))
    assert (other.title, other.analysis.steps, other.loads["tip"].vector) == ("other", (2.0,), (0.0, 2.0, 0.0))
    assert SCENE.replace(sections={"strip": CrossSection(EI3=3)}).sections["strip"].EI3 == 3.0
    assert SCENE.replace() == SCENE


def test_none_removes_an_entry_and_sets_a_key_to_its_default():
    bare = SCENE.replace({"springs.k": None, "loads.tip.history": None, "analysis.accuracy": None, "title": None})
    assert not bare.springs
    assert bare.loads["tip"].history is None
    assert (bare.analysis.accuracy, bare.title) == (Analysis().accuracy, "")
    # As if it had not been given, so that it does not come back with other types of the analysis either.
    assert "title" not in bare.to_dict()
    assert SCENE.replace(contacts=None).contacts == {}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sections.strip.EI3": -1}, "sections.strip.EI3: found -1, accepted: a number above zero"),
        ({"sections.strip.EI3": None}, "sections.strip: the key 'EI3' is missing: members.a beam's needs it in plane"),
        ({"nodes.tip.position": None}, "nodes.tip: the key 'position' is missing"),
        ({"loads.tip.value": [0, "5"]}, "loads.tip.value: found '5', accepted: a number"),
        (
            {"loads.tipp.value": [0, 5]},
            "loads: found 'tipp', accepted: tip; did you mean 'tip'? (a new entry is given as a",
        ),
        ({"loads.tipp": None}, "loads: found 'tipp', accepted: tip; did you mean 'tip'?"),
        ({"loads.tip.valu": [0, 5]}, "loads.tip: found 'valu', accepted: "),
        ({"loads.tip.value.3": 5}, "loads.tip.value: found '3', accepted: 0, 1, 2"),
        ({"loads.tip.type.x": 5}, "loads.tip.type: found 'force' in the scene, which has no 'x', accepted: the whole"),
        ({"analysis.until.above": 5}, "analysis.until: found None in the scene, which has no 'above'"),
        ({"accuracy": 1e-8}, "unknown key 'accuracy'; did you mean 'analysis.accuracy'?"),
        ({"load": {}}, "found 'load', accepted: "),
        ({"loads": {}, "loads.tip.value": [0, 5]}, "loads.tip.value: found values for the whole and for a part"),
        ({"loads.tip.value.0": 1, "loads.tip.value": [0, 5]}, "loads.tip.value: found values for the whole and for a"),
        ({1: 2}, "found 1, accepted: the name of a key"),
        ([("title", "a")], "found [('title', 'a')], accepted: a table of values by their names"),
        ({"factor": "2"}, "factor: found '2', accepted: a number"),
        ({"members.a beam's.section": "stripe"}, "members.a beam's.section: found 'stripe', accepted: strip"),
        ({"analysis.type": "dynamic", "analysis.end": 1}, "analysis.steps: found type 'dynamic', accepted: type"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(changes, message):
    with pytest.raises(SceneError) as refused:
        SCENE.replace(changes)
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_a_value_is_given_once():
    with pytest.raises(SceneError, match=r"^title: found values for the whole"):
        SCENE.replace({"title": "a"}, title="b")


def test_a_factor_is_no_number_of_a_motion_in_time():
    motion = SCENE.replace(analysis=Analysis(type="dynamic", end=1.0), contacts=None)
    with pytest.raises(
        SceneError, match=r"^factor: found the analysis 'dynamic', in which loads go by their histories"
    ):
        motion.replace({"factor": 2.0})


@pytest.mark.parametrize(
    "changes",
    [
        {"title": "other"},
        {"analysis.accuracy": 1e-8},
        {"analysis": SCENE.analysis.replace(accuracy=1e-6)},
        {"members.a beam's.elements": 8},
        {"sections.strip.EI3": 1.0},
    ],
)
def test_known_values_stay_where_the_answer_does(changes):
    assert SCENE.replace(changes).expect == SCENE.expect


@pytest.mark.parametrize(
    "changes", [{"sections.strip.EI3": 2.0}, {"analysis.steps": [2.0]}, {"factor": 2.0}, {"springs": None}]
)
def test_known_values_of_another_scene_are_dropped(changes):
    other = SCENE.replace(changes)
    assert other.expect == ()
    assert not check(other, solve(other))
    kept = SCENE.replace({"expect": [{**EXPECT, "step": None}], **changes})
    assert len(kept.expect) == 1


def test_a_free_end_goes_where_its_shape_ends():
    curved = Curvature(kappa3=[0.0], length=1.0, start=[1, 0])
    scene = SCENE.replace({"members.a beam's.shape": curved})
    bent = scene.replace({"members.a beam's.shape.kappa3": [np.pi]})
    # A half circle of radius 1/pi.
    np.testing.assert_allclose(bent.nodes["tip"].position, [0, 2 / np.pi, 0], atol=1e-12)
    moved = scene.replace({"nodes.A.position": [1, 0]})
    np.testing.assert_allclose(moved.nodes["tip"].position, [2, 0, 0], atol=1e-12)
    # Nodes that are given stay there.
    with pytest.raises(SceneError, match=r"members.a beam's"):
        scene.replace({"nodes.A.position": [1, 0], "nodes.tip.position": [1, 0.5]})


def test_the_dimension_is_chosen_anew():
    scene = SCENE.replace({"sections.strip": CrossSection(EI2=1, EI3=1, GJ=1), "contacts": None})
    assert scene.resolved_dimension == "plane"
    assert scene.replace({"loads.tip.value.2": 1}).resolved_dimension == "space"
    with pytest.raises(SceneError, match=r"^sections.strip: the key 'EI2' is missing: .* space \(loads.tip"):
        SCENE.replace({"loads.tip.value.2": 1, "contacts": None})


def test_a_changed_scene_is_written_and_read(tmp_path):
    other = SCENE.replace({"loads.tip.value": np.array([0.0, 2.0]), "loads.more": {**STRIP["loads"]["tip"]}})
    dump(other, tmp_path / "other.json")
    assert load(tmp_path / "other.json") == other


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: solve(SCENE, acuracy=1e-5), "settings: found 'acuracy', accepted: accuracy, "),
        (
            lambda: solve(SCENE, steps=[1, 2]),
            "settings: found 'steps', a key of the analysis, accepted: in the scene, as",
        ),
        (lambda: solve(SCENE, 1e-5), "settings: found 1e-05, accepted: Settings(...), or keywords, as accuracy=1e-8"),
    ],
)
def test_settings_that_do_not_exist_are_told(call, message):
    with pytest.raises(SceneError) as refused:
        call()
    assert str(refused.value).startswith(message)
