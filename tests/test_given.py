"""What public functions are given: scenes, and names of files instead; numbers and truths of NumPy as Python's own."""

import json
from pathlib import Path

import numpy as np
import pytest

import sfetcas
from sfetcas import (
    Analysis,
    CrossSection,
    Expect,
    History,
    Load,
    Member,
    Node,
    Normal,
    Parameter,
    Scene,
    SceneError,
    Settings,
    Spring,
    changed,
    check,
    dump,
    load,
    parametric,
    sampled,
    solve,
    solve_model,
    sweep,
    uniform_mesh,
)
from sfetcas.description.records import whole
from sfetcas.trajectories.statement import controls_of

CALLS = {
    "solve": lambda scene: sfetcas.solve(scene),
    "check": lambda scene: sfetcas.check(scene, None),
    "dump": lambda scene: sfetcas.dump(scene, "scene.toml"),
    "changed": lambda scene: sfetcas.changed(scene, {}),
    "parametric": lambda scene: sfetcas.parametric(scene),
    "fit": lambda scene: sfetcas.fit(scene, [], []),
    "fitting": lambda scene: sfetcas.fitting(scene, [], []),
    "export": lambda scene: sfetcas.export(scene, "folder"),
    "sweep": lambda scene: sfetcas.sweep(scene, {}, []),
    "find": lambda scene: sfetcas.find(scene, [], {}),
    "Design": lambda scene: sfetcas.Design(scene),
    "QuasiStatic": lambda scene: sfetcas.QuasiStatic(scene, {}),
    "OptimalControl": lambda scene: sfetcas.OptimalControl(scene, {}, time=1.0),
    "motion_functions": lambda scene: sfetcas.motion_functions(scene),
    "respond": lambda scene: sfetcas.respond(scene, {}, 1.0),
    "first_mesh": lambda scene: sfetcas.first_mesh(scene, 3),
    "uniform_mesh": lambda scene: sfetcas.uniform_mesh(scene, 3, 1),
    "assemble": lambda scene: sfetcas.assemble(scene, None),
}


@pytest.mark.parametrize("name", CALLS)
def test_names_of_files_are_not_scenes(name):
    more = "" if name == "solve" else ", ..."
    for given, found in (("a.toml", "the text 'a.toml'"), (Path("a.toml"), "the path 'a.toml'")):
        with pytest.raises(SceneError) as refused:
            CALLS[name](given)
        assert str(refused.value) == (f"{name} takes a Scene, found {found}; accepted: {name}(load('a.toml'){more})")


def test_other_things_are_not_scenes():
    with pytest.raises(SceneError, match=r"^solve takes a Scene, found a table; accepted: solve\(Scene.from_dict\("):
        solve({})
    with pytest.raises(SceneError, match=r"^solve takes a Scene, found None; accepted: solve\(load\('FILE.toml'\)\)$"):
        solve(None)


def cantilever(force=1.0, **more):
    return Scene(
        sections={"strip": CrossSection(EI3=1.0)},
        nodes={"A": Node(position=[0, 0], support="clamped"), "B": Node(position=[1, 0])},
        members={"beam": Member(nodes=["A", "B"], section="strip")},
        loads={"tip": Load(type="force", node="B", value=[0, force])},
        **more,
    )


ONES = [np.float32(1), np.float64(1), np.int64(1), np.uint8(1), np.array(1.0), np.array(1)]
each_one = pytest.mark.parametrize("one", ONES, ids=lambda one: f"{one.dtype}-{np.ndim(one)}-{type(one).__name__}")


def records(one):
    """Records whose numbers are all one."""
    return (
        Node(position=[one, one], mass=one),
        Member(nodes=["A", "B"], section="s", elements=int(one)),
        Load(type="moment", node="B", value=one),
        CrossSection(EI3=one, rhoA={"polynomial": [one, one]}),
        Spring(node="A", stiffness=one, rest=one, stop=[-one, one] if one.dtype.kind != "u" else [-1, one]),
        History(t=[0, one], value=[one, one]),
        Analysis(type="path", range=[0, one], points=one + one, steps=[one], modes=one, branches=one),
        Expect(quantity="factor", value=one, tolerance=one, crossing=one, step=one),
    )


@each_one
def test_records_take_numbers_of_numpy(one):
    for record, same in zip(records(one), records(np.float64(1)), strict=True):
        assert record == same
        assert json.dumps(record.to_dict()) == json.dumps(same.to_dict()) or isinstance(record, Expect)


@pytest.mark.parametrize("one", [one for one in ONES if one.dtype.kind in "iu"], ids=str)
def test_whole_numbers_of_numpy_are_whole(one):
    assert Member(nodes=["A", "B"], section="s", elements=one).elements == 1
    assert type(whole(one, 1)) is int
    assert len(sampled(one, {"loads.tip.value.1": Normal(one, one)}, seed=one)) == 1
    assert solve(cantilever(), elements=one, runs=one).last.model.mesh.elements == 1


@pytest.mark.parametrize("wrong", [True, np.True_, 1.0, np.float64(1.0), "1", None, 0, 4])
def test_what_is_no_whole_number_is_refused(wrong):
    with pytest.raises(SceneError, match=r"^count: found .*, accepted: a number of cases from 1 to 3$"):
        whole(wrong, 1, 3, what="number of cases", name="count")


@each_one
def test_functions_take_numbers_of_numpy(one):
    scene = cantilever(one)
    plain = solve(cantilever(), accuracy=1e-3).last.position("B")
    step = solve(scene, Settings(accuracy=1e-3 * one)).last
    np.testing.assert_array_equal(step.position("B"), plain)
    np.testing.assert_array_equal(step.along("beam", [one])["position"], step.along("beam", [1.0])["position"])
    assert changed(scene, {"loads.tip.value.1": one}).loads == scene.loads
    assert solve_model(sfetcas.assemble(scene, uniform_mesh(scene, 4, 2)), one).factor == 1.0
    force = Parameter(one, lambda x: {"loads.tip.value.1": x}, low=0 * one, high=one)
    answer = parametric(scene, {"force": force, "sections.strip.EI3": (one, 2 * one)}, ["nodes.B.position"])
    assert answer.solve({"force": one})["nodes.B.position"][1] == pytest.approx(plain[1], abs=1e-3)
    assert controls_of({"u": (0 * one, one)}, {"u": one})[0].rate == 1.0


@pytest.mark.parametrize("count", [np.int64(1), np.array(1)])
def test_sweeps_take_numbers_of_numpy(count):
    found = sweep(cantilever(), {"loads.tip.value.1": np.float32([1, 2])}, ["nodes.B.position"], workers=count)
    assert found.solved.all()


@pytest.mark.parametrize("yes", [True, np.True_])
def test_truths_of_numpy_are_truths(yes, tmp_path):
    scene = cantilever(expect=[Expect(quantity="certificate.stable", value=yes)])
    (met,) = check(scene, solve(scene, gauss=yes, branch=yes))
    assert met.passed
    for ending in ("toml", "json"):
        dump(scene, tmp_path / f"scene.{ending}")
        assert load(tmp_path / f"scene.{ending}").expect[0].value is True
    for record, key in ((CrossSection, "EI3"), (Analysis, "accuracy")):
        with pytest.raises(SceneError, match=f"^{key}: found .*, accepted: a number"):
            record(**{key: yes})


@pytest.mark.parametrize(
    ("kind", "key", "unit"),
    [
        ({"type": "rotational"}, "stiffness", "N m"),
        ({"type": "translational"}, "stiffness", "N/m"),
        ({"type": "translational", "stiffness": 1.0}, "length", "m"),
        ({"type": "rotational", "stiffness": 1.0}, "damping", "N m s/rad"),
        ({"type": "translational", "stiffness": 1.0}, "damping", "N s/m"),
    ],
)
def test_springs_tell_the_unit_of_what_is_wrong(kind, key, unit):
    with pytest.raises(SceneError) as refused:
        Spring(node="A", **{**kind, key: -2999})
    assert str(refused.value) == f"{key}: found -2999, accepted: zero or a number above zero, {unit}"
