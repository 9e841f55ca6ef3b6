"""Frequencies along paths, and flutter points: against closed forms, and against what certifies the equilibria."""

import json

import numpy as np
import pytest
from scenes import made

from sfetcas import SceneError, solve, switch
from sfetcas.cli import main
from sfetcas.description.scenefile import dump


def ziegler(damping, **analysis):
    """Two rigid links without mass, 2 kg between them and 1 kg at the tip, under a force along the last."""
    spring = {"stiffness": 1.0, "damping": damping}
    return made(
        {
            "nodes": {
                "O": {"position": [0, 0], "support": "hinge"},
                "M": {"position": [1, 0], "joint": "hinge", "mass": 2.0},
                "T": {"position": [2, 0], "mass": 1.0},
            },
            "members": {
                "lower": {"nodes": ["O", "M"], "type": "rigid"},
                "upper": {"nodes": ["M", "T"], "type": "rigid"},
            },
            "springs": {
                "foot": {**spring, "node": "O", "between": ["ground", "lower"]},
                "knee": {**spring, "node": "M", "between": ["lower", "upper"]},
            },
            "loads": {"push": {"type": "force", "node": "T", "value": [-1, 0], "frame": "follower"}},
            "analysis": {"type": "path", "range": [0, 4], "modes": 2, "accuracy": 1e-8} | analysis,
        }
    )


def column(head="slider", feet="hinge", **changes):
    """A column that is pressed along itself, hinged at both ends."""
    support = {"support": "slider", "direction": [1, 0], "rotation": "hinge"} if head == "slider" else {}
    return {
        "sections": {"strip": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"foot": {"position": [0, 0], "support": feet}, "head": {"position": [1, 0], **support}},
        "members": {"column": {"nodes": ["foot", "head"], "section": "strip"}},
        "loads": {"weight": {"type": "force", "node": "head", "value": [-1, 0]}},
        "analysis": {"type": "path", "range": [0, 30], "modes": 3, "accuracy": 1e-8},
    } | changes


def test_frequencies_meet_without_damping():
    """Two equal springs, 2 kg and 1 kg: (7/2 - sqrt 2) c/l (Ziegler 1952)."""
    path = solve(ziegler(0.0))
    (point,) = path.flutter_points
    # Roots of the double eigenvalue 1/sqrt 2 of the squares; 1e-10 is the accuracy of the root along the path.
    assert point.factor == pytest.approx(3.5 - np.sqrt(2.0), rel=1e-9)
    assert point.omega == pytest.approx(2.0**-0.25, rel=1e-9)
    assert point.certificate.stable == "not defined"
    for here in path.points:
        assert (here.growth.max() > 1e-3) == (here.factor > point.factor)


@pytest.mark.parametrize("damping", [0.05, 0.5])
def test_damping_brings_flutter_earlier(damping):
    """41/28 c/l + b^2/(2 m l^3) (Herrmann and Jong 1965)."""
    (point,) = solve(ziegler(damping)).flutter_points
    # Of the real part 1e-10 is rounding, and the slope of the real part in the load is about 0.01.
    assert point.factor == pytest.approx(41.0 / 28.0 + 0.5 * damping**2, rel=1e-8)
    assert point.omega == pytest.approx(np.sqrt(2.0 / 7.0), rel=1e-7)


@pytest.mark.parametrize("stiffness", [(0.01, 0.01), (0.01, 0.03)])
def test_motions_that_come_among_the_lowest_do_not_meet_there(stiffness):
    """Pendulums that are pulled get ahead of the two that have met: these are then among the lowest, as one pair."""
    alone = ziegler(0.0).to_dict()
    for number, name in enumerate(("left", "right")):
        x = 5.0 + number
        alone["nodes"] |= {
            f"{name} foot": {"position": [x, 0], "support": "hinge"},
            f"{name} end": {"position": [x, 1], "mass": 1.0},
        }
        alone["members"][name] = {"nodes": [f"{name} foot", f"{name} end"], "type": "rigid"}
        alone["springs"][name] = {"node": f"{name} foot", "stiffness": stiffness[number], "between": ["ground", name]}
        alone["loads"][name] = {"type": "force", "node": f"{name} end", "value": [0, 0.23]}
    flutter = 3.5 - np.sqrt(2.0)
    few, all_four = (
        solve(made({**alone, "analysis": {**alone["analysis"], "range": [0, 3.5], "modes": modes}})) for modes in (1, 4)
    )
    assert [point.factor for point in all_four.flutter_points] == pytest.approx([flutter], rel=1e-9)
    assert few.points[-1].growth.max() > 0.1
    assert few.flutter_points == ()


def test_square_column_flutters_to_all_sides_at_once():
    scene = column(head="free", feet="clamped", dimension="space")
    scene["sections"] = {"strip": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 1.0, "rhoI": [0.02, 0, 0]}}
    scene["loads"]["weight"] |= {"value": [-10, 0], "frame": "follower"}
    scene["members"]["column"] |= {"element": "SFET5", "elements": 2}
    scene["analysis"] |= {"range": [0, 2.5], "modes": 4, "accuracy": 1e-4}
    (point,) = solve(made(scene)).flutter_points
    # The accuracy asked for.
    assert point.factor == pytest.approx(2.00509536189738, rel=1e-4)
    assert point.omega == pytest.approx(11.0155576409229, rel=1e-4)
    assert "2 motions start to grow at once" in point.notes


def test_squares_of_frequencies_of_a_hinged_column_fall_with_the_load():
    path = solve(made(column()))
    for point in path.points:
        rank = np.arange(1, 4) * np.pi
        exact = rank**4 - rank**2 * point.factor
        # Twice the accuracy of the frequencies, where they vanish relative to the first without load.
        assert point.omega**2 - point.growth**2 == pytest.approx(np.sort(exact), rel=2e-8, abs=2e-8 * np.pi**4)
    assert path.flutter_points == ()


def test_lowest_square_changes_its_sign_with_the_certificate():
    scene = {
        "sections": {"strip": {"EI3": 1.0, "rhoA": 1.0, "rhoI": [0, 0, 1e-3]}},
        "nodes": {
            "left": {"position": [-1, 0], "support": "hinge"},
            "crown": {"position": [0, 0.3]},
            "right": {"position": [1, 0], "support": "hinge"},
        },
        "members": {
            name: {"nodes": ends, "section": "strip", "shape": {"type": "arc", "angle": -0.6}}
            for name, ends in (("rise", ["left", "crown"]), ("fall", ["crown", "right"]))
        },
        "loads": {"press": {"type": "force", "node": "crown", "value": [0, -1]}},
        "analysis": {"type": "path", "range": [0, 40], "modes": 2, "branches": 1},
    }
    path = solve(made(scene))
    assert path.limit_points
    assert path.bifurcations
    for branch in path.branches:
        for point in branch.points:
            if not point.kind:
                assert (point.growth > 0.0).sum() == min(point.negative, 2)
            else:
                # A square that is zero to 1e-6 of the others leaves 1e-3.
                sizes = np.hypot(point.omega, point.growth)
                assert sizes.min() < 1e-3 * sizes.max()
    branch = switch(path, 1, -1, points=5)
    assert all(len(point.omega) == 2 for point in branch.points)


def test_answer_and_report(tmp_path, capsys):
    file, out = tmp_path / "scene.json", tmp_path / "out.json"
    expect = {"quantity": "omega", "value": 2.0**-0.25, "tolerance": 1e-8, "flutter_point": 1}
    table = ziegler(0.0).to_dict() | {"expect": [expect]}
    dump(made(table), file)
    assert main(["run", str(file), "--json", str(out)]) == 0
    answer = json.loads(out.read_text())
    path = answer["path"]
    assert [len(row) for row in path["omega"]] == [2] * len(path["factor"])
    assert np.shape(path["growth"]) == np.shape(path["omega"])
    assert answer["flutter_points"][0]["factor"] == pytest.approx(3.5 - np.sqrt(2.0), rel=1e-9)
    assert answer["flutter_points"][0]["omega"] == pytest.approx(2.0**-0.25, rel=1e-9)
    printed = capsys.readouterr().out
    assert "flutter point 1: factor 2.0857864376" in printed
    assert "omega flutter point 1" in printed


def test_expected_flutter_point_that_is_none(tmp_path):
    file = tmp_path / "scene.json"
    expect = {"quantity": "factor", "value": 2.0, "tolerance": 1.0, "flutter_point": 2}
    dump(made(ziegler(0.0).to_dict() | {"expect": [expect]}), file)
    assert main(["check", str(file)]) == 2


def test_masses_do_not_stand_at_gauss_points():
    with pytest.raises(SceneError, match="accepted: 'nodes' with modes"):
        solve(made(column()), gauss=True)


def test_contacts_are_refused():
    floor = {"floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "members": "all"}}
    with pytest.raises(SceneError, match=r"found an obstacle with analysis\.modes on a path"):
        made(column(contacts=floor))
