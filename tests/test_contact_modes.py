"""Vibrations about equilibria in which something touches: closed forms, statics beside them, and what is not linear."""

import numpy as np
import pytest
from scenes import CARRIED, CROSSING

from sfetcas import Scene, SceneError, SolveError, Status, solve
from sfetcas.dynamics.modes import BLURRED
from sfetcas.mechanics.displacements import Displacements

FLOOR = {"type": "plane", "point": [0, -0.3], "normal": [0, 1]}
DRUM = {"type": "circle", "center": [0.6, -0.5], "radius": 0.3}
PLUG = {"type": "circle", "center": [0.7, -0.5], "radius": 0.5}


def table(contact, load=(0, -2), height=0.0, modes=3, accuracy=1e-8, **more):
    """A cantilever of unit length with a force at its end, and an obstacle."""
    analysis = {"type": "modes", "modes": modes, "accuracy": accuracy}
    return {
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, height], "support": "clamped"}, "B": {"position": [1, height]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "B", "value": list(load)}},
        "contacts": {"c": {**contact, "members": "all"}},
        "analysis": analysis,
        **more,
    }


def modes_of(*given, **more):
    return solve(Scene.from_dict(table(*given, **more)))


def heavy(weight):
    return {"W": {"type": "distributed", "member": "beam", "value": [0, -weight]}}


def compliance(modes, node):
    """Displacements (3, 3) m of a node by forces at it, by the matrices of the linearised equations."""
    motion, n = modes.motion, modes.motion.unknowns
    rows = motion.equations.rows
    matrix = np.zeros((n + rows, n + rows))
    np.add.at(matrix, (motion.stiffness.row, motion.stiffness.column), motion.stiffness.value)
    np.add.at(matrix, (n + motion.constraints.row, motion.constraints.column), motion.constraints.value)
    matrix[:n, n:] = matrix[n:, :n].T
    moved = np.array(
        [Displacements(motion.equations, motion.state, motion.loading, shape).position(node) for shape in np.eye(n)]
    )
    scales = motion.model.scales
    right = np.vstack([moved / scales.length / scales.force, np.zeros((rows, 3))])
    return moved.T @ np.linalg.lstsq(matrix, right, rcond=1e-14)[0][:n]


def compliance_of_statics(parts, node, axes, step=1e-3):
    """The same along some axes by differences of equilibria, each found by itself."""

    def position(force):
        load = {"type": "force", "node": node, "value": force.tolist()}
        analysis = {"accuracy": parts["analysis"]["accuracy"]}
        return solve(Scene.from_dict({**parts, "loads": {**parts["loads"], "more": load}, "analysis": analysis}))

    columns = [
        (position(step * way).last.position(node) - position(-step * way).last.position(node)) / (2.0 * step)
        for way in np.eye(3)[axes]
    ]
    return np.array(columns).T


# -- closed forms -------------------------------------------------------------------------------------------


def test_cantilever_propped_at_its_tip():
    modes = modes_of({**PLUG, "center": [1, -0.5]}, load=(0, -1e-3))
    # tan x = tanh x; what the load bends changes the square of a frequency by the square of its rotation, none here.
    assert modes.omega[:2] == pytest.approx(np.square([3.926602312047919, 7.068582745628732]), rel=1e-8)
    assert modes.status is Status.SOLVED
    assert "contacts.c" in modes.notes[0]


def sagging(height, accuracy=1e-8):
    """A heavy cantilever that lies on a floor from 0.6 of its length on, as bending by little says."""
    weight = 72.0 * height / 0.6**4
    floor = {"type": "plane", "point": [0, 0], "normal": [0, 1]}
    return modes_of(floor, height=height, loads=heavy(weight), accuracy=accuracy)


def test_member_that_lies_is_clamped_where_it_does():
    low, high = (sagging(height).omega for height in (4e-3, 8e-3))
    # Between two clamps; what is left out goes with the square of the height, and then with its fourth power, which
    # leaves 1.3e-7, by the same for heights twice as large.
    exact = np.square([4.730040744862704, 7.853204624095838, 10.995607838001671]) / 0.36
    assert (4.0 * low - high) / 3.0 == pytest.approx(exact, rel=2e-7)


def test_ends_of_lines_are_found_whatever_statics_left_of_them():
    coarse, fine = sagging(0.05, 1e-3), sagging(0.05)
    assert abs(coarse.last.contacts["c"]["at"][0] - fine.last.contacts["c"]["at"][0]) > 1e-7
    assert coarse.omega == pytest.approx(fine.omega, rel=coarse.error_estimate + 1e-9)
    assert coarse.error_estimate < 1e-4


def test_place_that_sticks_is_a_hinge():
    modes = modes_of({**FLOOR, "friction": 0.9}, load=(0.1, -2))
    moved = modes.last.position("B") - [1, 0, 0]
    parts = table(FLOOR, load=(0.1, -2))
    parts["nodes"]["B"]["support"] = "hinge"
    held = solve(Scene.from_dict({**parts, "contacts": {}, "motions": {"m": {"node": "B", "displacement": moved}}}))
    # How far what sticks gives way is 1e-9 of the length under the loads.
    assert modes.omega == pytest.approx(held.omega, rel=1e-7)


def test_bead_in_a_hole_is_a_pendulum():
    nodes = {"A": {"position": [0, -0.7], "mass": 2.0}, "B": {"position": [0, -0.6], "mass": 1e-9}}
    parts = table({"type": "circle", "center": [0, 0], "radius": 0.7, "side": "inside"}, modes=1, loads={}, nodes=nodes)
    parts |= {"sections": {}, "members": {"bar": {"nodes": ["A", "B"], "type": "rigid"}}, "gravity": [0, -9.81]}
    # The other end, at rest above the first one, falls.
    assert solve(Scene.from_dict(parts)).omega == pytest.approx([np.sqrt(9.81 / 0.7)], rel=1e-8)


@pytest.mark.parametrize(("kind", "friction"), [("rigid", 0.0), ("rigid", 0.5), ("flexible", 0.0)])
def test_what_lies_as_a_whole_slides_or_sticks(kind, friction):
    bar = {"nodes": ["A", "B"], "type": kind} | ({"section": "s"} if kind == "flexible" else {})
    mass = {"mass": 1.0} if kind == "rigid" else {}
    floor = {"type": "plane", "point": [0, 0], "normal": [0, 1], "friction": friction}
    parts = table(floor, loads={}, accuracy=1e-6, members={"bar": bar}, gravity=[0, -9.81])
    parts["sections"]["s"]["rhoA"] = 2.0
    parts["nodes"] = {"A": {"position": [0, 0], **mass}, "B": {"position": [1, 0], **mass}}
    parts["springs"] = {"k": {"type": "translational", "node": "A", "direction": [1, 0], "stiffness": 8.0}}
    modes = solve(Scene.from_dict(parts))
    assert modes.omega == pytest.approx([] if friction else [2.0], rel=1e-8)
    assert f"{1 - bool(friction)} modes found" in modes.notes[0]
    assert modes.status is Status.SOLVED


# -- statics beside it ----------------------------------------------------------------------------------------

SPACE = {"sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 1.0}}, "dimension": "space"}
UPRIGHT = {"type": "plane", "point": [0, 0, -0.3], "normal": [0, 0, 1]}
LIFTED = table({"type": "plane", "point": [0, 0], "normal": [0, 1]}, (0, 1), accuracy=1e-7)
LIFTED["nodes"]["A"]["support"] = "hinge"
LIFTED["loads"] |= heavy(5.0)


@pytest.mark.parametrize(
    ("parts", "axes"),
    [
        (table(DRUM), [0, 1]),
        (table({**DRUM, "member_radius": 0.02}), [1]),
        (table({"type": "point", "position": [0.6, -0.1], "side": [0, 1]}), [1]),
        (table(UPRIGHT, (0.3, 0.2, -2), **SPACE), [1, 2]),
        (table({}, (0, -2), **CARRIED), [1]),
        (table({}, (0.05, 0.02, -1), **SPACE, **CROSSING), [2]),
        (LIFTED, [1]),
    ],
    ids=["drum", "radius", "edge", "plane in space", "carried", "crossing", "line"],
)
def test_stiffness_is_that_of_statics(parts, axes):
    found = compliance(solve(Scene.from_dict(parts)), "B")[:, axes]
    wanted = compliance_of_statics(parts, "B", axes)
    # Differences over steps of 1e-3 of positions that are known to 1e-8.
    assert found == pytest.approx(wanted, rel=1e-5, abs=1e-5 * np.abs(wanted).max())


def test_place_rolls_over_the_node_between_two_members():
    whole = table(DRUM, load=(0, -2))
    at = solve(Scene.from_dict(whole)).last.contacts["c"]["at"]
    nodes = {**whole["nodes"], "M": {"position": [at, 0]}}
    members = {"one": {"nodes": ["A", "M"], "section": "s"}, "two": {"nodes": ["M", "B"], "section": "s"}}
    parted = solve(Scene.from_dict({**whole, "nodes": nodes, "members": members}))
    assert parted.last.contacts["c"]["at"] in (0.0, 1.0)
    assert not len(parted.buckling)
    assert parted.omega == pytest.approx(solve(Scene.from_dict(whole)).omega, rel=1e-7)


def test_what_does_not_touch_moves_freely():
    far = modes_of({**FLOOR, "point": [0, -3]})
    free = solve(Scene.from_dict({**table(FLOOR), "contacts": {}}))
    # First meshes are graded towards what may be touched: rounding differs as that of frequencies on two meshes does.
    assert far.omega == pytest.approx(free.omega, rel=BLURRED)
    assert not far.notes


# -- what is not linear ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        (table({**PLUG, "center": [0.5, -0.5]}, loads={}), "contacts.c touches beam at 0.5 without a force"),
        (table({**FLOOR, "friction": 0.01}, (0.1, -2)), "contacts.c touches beam at 1 and slides there"),
        (table({**FLOOR, "point": [0, 0]}, (0, -1)), "contacts.c touches beam at 1 and begins to lie along it"),
    ],
    ids=["no force", "slides", "begins to lie"],
)
def test_kinks(parts, sentence):
    with pytest.raises(SolveError, match=f"{sentence}, so that no vibration is") as error:
        solve(Scene.from_dict(parts))
    assert error.value.status is Status.KINK


def test_part_of_a_line_on_which_nothing_presses():
    """Of what lies flat a part has no weight."""
    floor = {"type": "plane", "point": [0, 0], "normal": [0, 1]}
    weight = {"type": "distributed", "member": "beam", "value": [0, -40]}
    loads = {"W": {**weight, "from": 0.0, "to": 0.7}, "V": {**weight, "from": 0.9, "to": 1.0}}
    with pytest.raises(SolveError, match=r"contacts\.c touches beam from 0\.7\d* to 0\.[89]\d* without a force"):
        modes_of(floor, height=0.05, loads=loads)


def test_lines_with_friction_are_refused():
    floor = {"type": "plane", "point": [0, 0], "normal": [0, 1], "friction": 0.5}
    with pytest.raises(SolveError, match=r"member 'beam' lies along contacts\.c beside friction, accepted with modes"):
        modes_of(floor, loads=heavy(3.0), accuracy=1e-5)


def test_modes_along_paths_are_refused():
    parts = table(FLOOR) | {"analysis": {"type": "path", "range": [0, 1], "modes": 2}}
    with pytest.raises(SceneError, match=r"contacts\.c: found an obstacle with analysis\.modes on a path"):
        Scene.from_dict(parts)
