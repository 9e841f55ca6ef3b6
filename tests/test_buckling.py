"""Buckling factors of the linear estimate: Euler's columns, bifurcations of paths, and where there are none."""

import json

import numpy as np
import pytest
from scenes import made

from sfetcas import SolveError, load, solve
from sfetcas.cli import main
from sfetcas.description.scenefile import dump

STRIP = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 1.0, "rhoI": [0.02, 0.01, 0.01]}


def column(load=None, **changes):
    return {
        "sections": {"strip": STRIP},
        "nodes": {"foot": {"position": [0, 0], "support": "clamped"}, "head": {"position": [1, 0]}},
        "members": {"column": {"nodes": ["foot", "head"], "section": "strip"}},
        "loads": {"weight": {"type": "force", "node": "head", "value": [-1, 0]} | (load or {})},
        "analysis": {"type": "modes", "modes": 3, "accuracy": 1e-8},
    } | changes


@pytest.mark.parametrize("ends", ["clamped_free", "clamped_clamped", "clamped_hinged", "hinged_hinged"])
def test_columns_of_euler(ends):
    table = load(f"problems/euler_column_{ends}.toml").to_dict()
    exact = [expect["value"] for expect in table.pop("expect") if expect["quantity"] == "factor"]
    table["sections"]["strip"]["rhoA"] = 1.0
    table["analysis"] = {"type": "modes", "modes": len(exact), "accuracy": 1e-8}
    # Straight columns are exact up to the mesh, which is chosen for frequencies to this accuracy.
    np.testing.assert_allclose(solve(made(table)).buckling, exact, rtol=1e-8)


def portal(analysis):
    nodes = {"A": [0, 0], "B": [0, 1], "C": [1, 1], "D": [1, 0]}
    return made(
        {
            "sections": {"strip": STRIP},
            "nodes": {n: {"position": p} | ({"support": "hinge"} if n in "AD" else {}) for n, p in nodes.items()},
            "members": {name: {"nodes": list(name), "section": "strip"} for name in ("AB", "BC", "CD")},
            "loads": {n: {"type": "force", "node": n, "value": [0, -1]} for n in "BC"},
            "analysis": {"accuracy": 1e-8} | analysis,
        }
    )


def test_frame_that_is_rigid_until_it_buckles():
    bends = solve(portal({"type": "path", "range": [0, 30]})).bifurcations
    buckling = solve(portal({"type": "modes", "modes": len(bends)})).buckling
    assert len(bends) == 3
    # Both to 1e-8.
    np.testing.assert_allclose(buckling, [point.factor for point in bends], rtol=2e-8)


def test_factors_do_not_depend_on_the_load_that_is_applied():
    heavy = solve(made(column({"value": [-1.5, 0]})))
    pulled = solve(made(column({"value": [1.5, 0]})))
    exact = (np.array([1, 3, 5]) * np.pi / 2) ** 2 / 1.5
    np.testing.assert_allclose(heavy.buckling, exact, rtol=1e-8)
    # A load turned round: nothing above zero, so the others are listed, by size.
    np.testing.assert_allclose(pulled.buckling, -exact, rtol=1e-8)


def test_square_column_in_space_buckles_to_all_sides():
    analysis = {"type": "modes", "modes": 4, "accuracy": 1e-8}
    found = solve(made(column(dimension="space", analysis=analysis))).buckling
    np.testing.assert_allclose(found, np.repeat([1, 9], 2) * np.pi**2 / 4, rtol=1e-8)


def test_loads_turned_round_come_last():
    scene = column()
    scene["nodes"] |= {"root": {"position": [0, 1], "support": "clamped"}, "end": {"position": [1, 1]}}
    scene["members"]["tie"] = {"nodes": ["root", "end"], "section": "strip"}
    scene["loads"]["pull"] = {"type": "force", "node": "end", "value": [0.5, 0]}
    # The tie has -4.9 and -44 among these.
    np.testing.assert_allclose(solve(made(scene)).buckling, (np.array([1, 3, 5]) * np.pi / 2) ** 2, rtol=1e-8)


def test_none_without_loads():
    assert len(solve(made(column(loads={}))).buckling) == 0


def test_none_without_a_potential():
    # Of which a share follows: it diverges, but what is linear in the factor is no energy.
    scene = column({"value": [-0.7, 0]})
    scene["loads"]["following"] = {"type": "force", "node": "head", "value": [-0.3, 0], "frame": "follower"}
    assert len(solve(made(scene)).buckling) == 0


def test_none_of_a_load_that_only_bends():
    """Across a cantilever linear theory has no factor: what rounding leaves are some 1e9 of the load."""
    table = column({"value": [0, 1]}, sections={"strip": {"EI3": 1.0, "rhoA": 1.0}})
    found = [solve(made({**table, "analysis": {"type": "modes", "modes": n}})).buckling for n in (2, 3, 4)]
    assert not any(map(len, found))


def test_none_of_a_mechanism_that_its_load_holds():
    nodes = {"foot": {"position": [0, 0], "support": "hinge"}, "head": {"position": [1, 0]}}
    modes = solve(made(column({"value": [1, 0]}, nodes=nodes)))
    assert len(modes.buckling) == 0
    assert len(modes.modes) == 3


def test_answer_report_and_expectation(tmp_path, capsys):
    file, out = tmp_path / "scene.json", tmp_path / "out.json"
    expect = {"quantity": "modes.buckling", "value": [np.pi**2 / 4, 9 * np.pi**2 / 4], "tolerance": 1e-7}
    dump(made(column(expect=[expect])), file)
    assert main(["run", str(file), "--json", str(out)]) == 0
    assert json.loads(out.read_text())["modes"]["buckling"][0] == pytest.approx(np.pi**2 / 4, rel=1e-8)
    assert "buckles at factors, linear estimate: 2.4674011, 22.20660" in capsys.readouterr().out


def ritz_of_a_column_held_twice(height, shapes=40):
    """First critical force at a height of a hinged column of EA the same everywhere: sines, forces as it stretches."""
    x = (np.arange(4000) + 0.5) / 4000
    numbers = np.pi * np.arange(1, shapes + 1)
    slopes = numbers[:, None] * np.cos(numbers[:, None] * x)
    pressed = np.where(x < height, 1.0 - height, -height)
    softening = (slopes * pressed) @ slopes.T / len(x)
    bending = 0.5 * numbers**4
    return 1.0 / np.linalg.eigvalsh(softening / np.sqrt(np.outer(bending, bending)))[-1]


def test_column_held_at_both_ends_shares_its_load_alike_in_all_analyses():
    """Three analyses, one rule for what is not determined without stretch, and a note of it in each."""
    critical = ritz_of_a_column_held_twice(0.3)

    def held(**analysis):
        hinge = {"support": "hinge"}
        places = {"a": {"position": [0, 0], **hinge}, "m": {"position": [0, 0.3]}, "b": {"position": [0, 1], **hinge}}
        table = {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": places,
            "members": {"l": {"nodes": ["a", "m"], "section": "s"}, "u": {"nodes": ["m", "b"], "section": "s"}},
            "loads": {"p": {"type": "force", "node": "m", "value": [0, -1]}},
            "analysis": analysis,
        }
        return made(table)

    below, modes = solve(held(steps=[0.9 * critical])).last, solve(held(type="modes"))
    path = solve(held(type="path", range=[0, 1.1 * critical], points=60))
    # The sums of the softening cut at the load are right to 1e-4; the mesh of a path to its accuracy of 1e-4.
    assert modes.buckling[0] == pytest.approx(critical, rel=2e-4)
    assert path.bifurcations[0].factor == pytest.approx(modes.buckling[0], rel=1e-4)
    assert below.certificate.stable is True
    for answer, factor, notes in ((below, 0.9 * critical, below.notes), (path.last, 1.0, path.notes)):
        assert answer.reaction("a")[0][1] == pytest.approx(0.7 * factor, rel=1e-9)
        assert answer.reaction("b")[0][1] == pytest.approx(0.3 * factor, rel=1e-9)
        assert any("critical loads, depend on it" in note for note in notes)
    assert any("critical loads, depend on it" in note for note in modes.last.notes)
    # Bent it would be shorter: beyond, nothing else is there, and this is unstable.
    with pytest.raises(SolveError, match="beyond the critical ones"):
        # Nearer to the critical load the same is found in three times as long.
        solve(held(steps=[2.0 * critical]))
    assert solve(held(steps=[1.1 * critical], unstable="stay")).last.certificate.negative == 1
