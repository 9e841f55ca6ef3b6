"""Tendons and chambers: closed forms, shooting, published robots, energies, and every analysis."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError, SolveError
from sfetcas.equilibria import stops
from sfetcas.mathematics import quaternion
from sfetcas.solvers.globalised import Code

EI, T, D = 2.0, 3.0, 0.1
"""Bending stiffness, N m2, tension, N, and offset, m, of a rod of one metre."""

DIMENSIONS = pytest.mark.parametrize("dimension", ["plane", "space"])


def rod(way=None, dimension="auto", *, tendons=None, analysis=None, **pull):
    """A straight rod of one metre with one tendon, by default parallel to it."""
    way = [{"member": "m", "offset": D}] if way is None else way
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {"EI3": EI, "EI2": EI, "GJ": 1.5, "rhoA": 1.0, "rhoI": [0.002, 0.001, 0.001]}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "tendons": {"t": {"way": way, **(pull or {"tension": T})}} if tendons is None else tendons,
            "analysis": analysis or {},
        }
    )


def arc(curvature):
    """End of a rod bent to a circle."""
    return np.array([np.sin(curvature), 1.0 - np.cos(curvature), 0.0]) / curvature


def bent(step, member, x, h=1e-4):
    """Curvature (n, 3) about the axes of the sections from differences of the rotations alone."""
    line = step.model.scene.center_lines[member]
    low, high = (step.along(member, x + s * h)["quaternion"] for s in (-1.0, 1.0))
    here = step.along(member, x)["quaternion"]
    slope = (high - low) / (2.0 * h * line.length)
    spin = 2.0 * quaternion.multiply(quaternion.conjugate(here), slope)[:, 1:]
    return line.curvatures(x) + quaternion.rotate(quaternion.conjugate(line.quaternions(x)), spin)


# -- a tendon parallel to a rod ----------------------------------------------------------------------


@DIMENSIONS
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
@pytest.mark.parametrize(
    "pull",
    [
        {"tension": T},
        {"pull": T * D**2 / EI},
        {"length": 1.0 - T * D**2 / EI},
        {"pull": T * D**2 / EI + T / 600.0, "stiffness": 600.0},
    ],
    ids=["tension", "pull", "length", "stiffness"],
)
def test_circle(dimension, solver, pull):
    """The rod is a circle of the curvature T d / EI, and the tendon an arc inside it."""
    step = sfetcas.solve(rod(dimension=dimension, **pull), solver=solver, accuracy=1e-9).last
    curvature = T * D / EI
    np.testing.assert_allclose(step.position("B"), arc(curvature), atol=1e-9)
    found = step.tendon("t")
    assert found["tension"] == pytest.approx(T, abs=1e-9)
    assert found["length"] == pytest.approx(1.0 - D * curvature, abs=1e-12)
    assert found.get("slack", False) is False
    along = step.along("m", [0.0, 0.4, 1.0])
    np.testing.assert_allclose(along["moment"][:, 2], EI * curvature, atol=1e-9)
    np.testing.assert_allclose(along["curvature"][:, 2], curvature, atol=1e-9)
    # The section is pressed by the tension, and no support is needed for what pulls on itself.
    np.testing.assert_allclose(along["force"][1], -T * np.array([np.cos(0.06), np.sin(0.06), 0.0]), atol=1e-9)
    np.testing.assert_allclose(step.reaction("A"), 0.0, atol=1e-9)
    assert step.certificate.stable


def test_chamber():
    """A chamber bends to the other side, as a tendon that pushes."""
    step = sfetcas.solve(rod(pressure=3e5, area=1e-5), accuracy=1e-9).last
    np.testing.assert_allclose(step.position("B"), arc(T * D / EI) * [1, -1, 1], atol=1e-9)
    assert step.tendon("t")["tension"] == pytest.approx(-T)


@pytest.mark.parametrize("pull", [{"pull": -0.02}, {"pull": -0.02, "stiffness": 600.0}])
def test_slack(pull):
    """A tendon let out is slack, unless it pushes."""
    step = sfetcas.solve(rod(**pull)).last
    assert step.tendon("t") == {"tension": 0.0, "length": pytest.approx(1.0), "slack": True}
    np.testing.assert_allclose(step.position("B"), [1, 0, 0], atol=1e-12)
    step = sfetcas.solve(rod(pushes=True, **pull)).last
    assert step.tendon("t")["tension"] < 0.0
    assert "slack" not in step.tendon("t")
    assert step.position("B")[1] < -0.05


def test_what_is_not_settled_is_named(monkeypatch):
    """A search that comes back to a choice it has tried names all whose state changed, not only those of the last."""
    monkeypatch.setattr(stops, "next_stops", lambda answer, now: () if now else (("t", "slack"),))
    with pytest.raises(SolveError, match=r"no choice of stops and slack tendons holds: tendons\.t\b"):
        sfetcas.solve(rod(pull=0.01))


def test_antagonists():
    """Of two tendons of constant length the one that a load bends the rod towards is slack, the other one holds."""
    tendons = {name: {"way": [{"member": "m", "offset": y}], "pull": 0.0} for name, y in (("up", D), ("down", -D))}
    load = {"type": "moment", "node": "B", "value": 0.1}
    scene = Scene.from_dict({**rod(tendons=tendons).to_dict(), "loads": {"load": load}})
    step = sfetcas.solve(scene, accuracy=1e-9).last
    assert step.tendon("up") == {"tension": 0.0, "length": pytest.approx(1.0), "slack": True}
    assert step.tendon("down")["tension"] == pytest.approx(1.0)
    np.testing.assert_allclose(step.position("B"), [1, 0, 0], atol=1e-9)


def test_factor_and_history():
    """Tension and shortening grow with the factor of the loads, or with a history instead."""
    steps = {"steps": [0.5, 2.0]}
    for pull in ({"tension": T}, {"pull": T * D**2 / EI}):
        for step in sfetcas.solve(rod(analysis=steps, **pull), accuracy=1e-8).steps:
            np.testing.assert_allclose(step.position("B"), arc(step.factor * T * D / EI), atol=1e-8)
        history = {"h": {"t": [0, 2], "value": [0, 1]}}
        scene = rod(analysis=steps, **pull).replace({"histories": history, "tendons.t.history": "h"})
        for step in sfetcas.solve(scene, accuracy=1e-8).steps:
            np.testing.assert_allclose(step.position("B"), arc(0.5 * step.factor * T * D / EI), atol=1e-8)


# -- other ways ----------------------------------------------------------------------------------------


def test_bowstring():
    """A string between arms at both ends: what bends the rod is its force times its distance from the section."""
    way = [{"ground": [-0.1, 0.2]}, {"node": "A", "offset": [0, D]}, {"node": "B", "offset": [0, D]}]
    step = sfetcas.solve(rod(way), accuracy=1e-9).last
    turned = np.array(
        [[np.cos(step.angle("B")), -np.sin(step.angle("B"))], [np.sin(step.angle("B")), np.cos(step.angle("B"))]]
    )
    ends = np.array([[0.0, D], step.position("B")[:2] + turned @ [0.0, D]])
    pull = T * (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    x = np.linspace(0.0, 1.0, 5)
    along = step.along("m", x)
    arms = ends[0] - along["position"][:, :2]
    np.testing.assert_allclose(along["moment"][:, 2], arms[:, 1] * pull[0] - arms[:, 0] * pull[1], atol=1e-8)
    np.testing.assert_allclose(along["force"][:, :2], np.tile(-pull, (5, 1)), atol=1e-8)
    first = np.hypot(0.1, 0.1)
    assert step.tendon("t")["length"] == pytest.approx(first + np.linalg.norm(ends[1] - ends[0]), abs=1e-9)


def shot(way, tension, stiffness):
    """Positions of the end of a rod with a tendon, by shooting for the moment at the clamp, and no finite element.

    ``way`` gives offset and its derivative in the axes of the section at s; the tendon ends at the tip.  What goes
    through a cut, tendon and section together, is nothing: the moment of the section is minus that of the tendon.
    """

    def curvature(s):
        offset, slope = way(s)

        def missing(k):
            along = np.array([1.0, 0.0, 0.0]) + np.cross(k, offset) + slope
            return stiffness * k + np.cross(offset, tension * along / np.linalg.norm(along))

        return root(missing, np.zeros(3), tol=1e-14).x

    def rate(s, state):
        q, k = state[3:], curvature(s)
        spin = 0.5 * quaternion.multiply(q, np.array([0.0, *k]))
        return np.concatenate([quaternion.rotate(q, np.array([1.0, 0.0, 0.0])), spin])

    found = solve_ivp(rate, (0.0, 1.0), [0, 0, 0, 1, 0, 0, 0], rtol=1e-12, atol=1e-13, method="DOP853")
    return found.y[:3, -1]


def test_helix():
    """A tendon wound around a rod bends and twists it to what the differential equations say."""
    way = [{"member": "m", "helix": {"radius": 0.05, "turns": 1.5, "phase": 0.3}}]
    step = sfetcas.solve(rod(way, tension=12.0), accuracy=1e-10).last
    rate = 3.0 * np.pi

    def wound(s):
        angle = 0.3 + rate * s
        across = 0.05 * np.array([0.0, np.cos(angle), np.sin(angle)])
        return across, 0.05 * rate * np.array([0.0, -np.sin(angle), np.cos(angle)])

    exact = shot(wound, 12.0, np.array([1.5, EI, EI]))
    np.testing.assert_allclose(step.position("B"), exact, atol=1e-9)
    assert abs(exact[2]) > 0.01


def test_varying_offset():
    """Offsets that vary along the member, of both kinds, in space and in the plane."""
    profile = [0.1, -0.15, 0.08]
    way = [{"member": "m", "offset": {"polynomial": profile}}]
    exact = shot(
        lambda s: (
            np.array([0.0, np.polyval(profile[::-1], s), 0.0]),
            np.array([0.0, -0.15 + 0.16 * s, 0.0]),
        ),
        T,
        np.array([1.5, EI, EI]),
    )
    for dimension in ("plane", "space"):
        step = sfetcas.solve(rod(way, dimension), accuracy=1e-10).last
        np.testing.assert_allclose(step.position("B"), exact, atol=1e-9)
    linear = {"at": [0, 0.3, 1], "value": [0.1, 0.05, 0.05]}
    step = sfetcas.solve(rod([{"member": "m", "offset": [linear, 0.0]}]), accuracy=1e-9).last
    parts = [{"member": "m", "offset": {"polynomial": [0.1, -0.05 / 0.3]}, "from": 0, "to": 0.3}]
    other = sfetcas.solve(rod([*parts, {"member": "m", "offset": 0.05, "from": 0.3, "to": 1}]), accuracy=1e-9).last
    np.testing.assert_allclose(step.position("B"), other.position("B"), atol=1e-9)


@DIMENSIONS
def test_curved_member(dimension):
    """A bent rod is bent further by the same curvature, flexible or along a rigid part of it, whose length stays."""
    turned = 0.8
    scene = rod(dimension=dimension, tension=T).to_dict()
    scene["nodes"]["B"]["position"] = arc(turned).tolist()
    scene["members"]["m"]["shape"] = {"type": "arc", "angle": turned}
    step = sfetcas.solve(Scene.from_dict(scene), accuracy=1e-9).last
    np.testing.assert_allclose(step.position("B"), arc(turned + T * D / EI), atol=1e-9)
    assert step.tendon("t")["length"] == pytest.approx(1.0 - D * (turned + T * D / EI), abs=1e-12)
    np.testing.assert_allclose(step.along("m", [0.3])["moment"][0], [0.0, 0.0, T * D], atol=1e-8)
    scene["members"]["m"]["type"] = "rigid"
    scene["tendons"]["t"]["way"].append({"ground": [1.0, 1.5, 0.0]})
    stiff = sfetcas.solve(Scene.from_dict(scene)).last
    hole = arc(turned) + D * np.array([-np.sin(turned), np.cos(turned), 0.0])
    straight = np.linalg.norm(np.array([1.0, 1.5, 0.0]) - hole)
    assert stiff.tendon("t")["length"] == pytest.approx(1.0 - D * turned + straight, abs=1e-12)


def test_direction_and_parts():
    """Ways backwards, and in parts one after the other, are the same."""
    one = sfetcas.solve(rod(), accuracy=1e-9).last.position("B")
    for way in (
        [{"member": "m", "offset": D, "from": 1, "to": 0}],
        [{"member": "m", "offset": D, "from": 0, "to": 0.37}, {"member": "m", "offset": D, "from": 0.37, "to": 1}],
        [{"member": "m", "offset": [D, 0]}],
    ):
        np.testing.assert_allclose(sfetcas.solve(rod(way), accuracy=1e-9).last.position("B"), one, atol=1e-9)


def test_part_of_a_member():
    """Beyond the place where a tendon ends the rod is straight."""
    step = sfetcas.solve(rod([{"member": "m", "offset": D, "from": 0, "to": 0.5}]), accuracy=1e-9).last
    along = step.along("m", [0.25, 0.75])
    np.testing.assert_allclose(along["moment"][:, 2], [T * D, 0.0], atol=1e-9)
    np.testing.assert_allclose(along["force"][1], 0.0, atol=1e-9)
    assert step.angle("B") == pytest.approx(0.5 * T * D / EI)


# -- a robot with two segments -------------------------------------------------------------------------

OFFSETS = {
    angle: (0.01 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])).tolist() for angle in (90, -30)
}


def robot(discs, tensions=(4.0, 2.0), members=("one", "two"), analysis=None):
    """The robot of Rao, Peyron, Lilge and Burgner-Kahrs 2021, section 4, without stretch and shear."""
    more = {"discs": 10} if discs else {}
    segment = {"section": "s", "b2": [1, 0, 0]}
    ways = {
        "a": [{"member": "one", "offset": OFFSETS[90], **more}],
        "b": [{"member": name, "offset": OFFSETS[-30], **more} for name in members],
    }
    return Scene.from_dict(
        {
            "sections": {"s": {"shape": "circle", "radius": 0.7e-3, "E": 54e9, "nu": 0.3}},
            "nodes": {
                "base": {"position": [0, 0, 0], "support": "clamped"},
                "middle": {"position": [0, 0, 0.2]},
                "tip": {"position": [0, 0, 0.4]},
            },
            "members": {
                "one": {"nodes": ["base", "middle"], **segment},
                "two": {"nodes": ["middle", "tip"], **segment},
            },
            "tendons": {
                name: {"way": way, "tension": t} for (name, way), t in zip(ways.items(), tensions, strict=True)
            },
            "analysis": analysis or {},
        }
    )


ROBOT = {False: (0.1276122480, 0.1434736023, 0.3364237920), True: (0.1293873757, 0.1460646440, 0.3341542370)}
"""Tips with both tendons, m: the same differential equations solved by collocation, to ten digits."""

SINGLE = {
    (False, 4.0, 0.0): (0.0, 0.2160533, 0.3214331),
    (True, 4.0, 0.0): (0.0, 0.2182687, 0.3195510),
    (False, 0.0, 2.0): (0.1292144, -0.0746020, 0.3600957),
    (True, 0.0, 2.0): (0.1299549, -0.0750295, 0.3595993),
}
"""Tips of the source with stretch and shear, which are 1e-5 of the length here."""


@pytest.mark.parametrize("discs", [False, True], ids=["along", "discs"])
def test_robot(discs):
    step = sfetcas.solve(robot(discs), accuracy=1e-9).last
    # The last digit of the reference is rounded.
    np.testing.assert_allclose(step.position("tip"), ROBOT[discs], atol=1e-10)
    assert step.certificate.stable


@pytest.mark.parametrize("case", SINGLE)
def test_robot_of_the_source(case):
    """One tendon pulled, against the published tips."""
    discs, *tensions = case
    step = sfetcas.solve(robot(discs, tensions), accuracy=1e-7).last
    np.testing.assert_allclose(step.position("tip"), SINGLE[case], atol=2e-5)


@pytest.mark.parametrize("discs", [False, True], ids=["along", "discs"])
def test_section_moments(discs):
    """What is told along a member is what its sections carry: stiffness times the curvature that its rotations have."""
    step = sfetcas.solve(robot(discs), accuracy=1e-9).last
    x = np.linspace(0.03, 0.93, 9)
    found = step.along("one", x)["curvature"]
    # Rounding of the differences: 1e-16 over steps of 2e-5 m.
    np.testing.assert_allclose(found, bent(step, "one", x), atol=1e-6 * np.abs(found).max())
    assert step.along("one", [0.5])["force"][0] @ step.along("one", [0.5])["force"][0] > 4.0**2
    np.testing.assert_allclose(step.reaction("base"), 0.0, atol=1e-12)


@DIMENSIONS
def test_discs_tend_to_the_way_along(dimension):
    """More discs are nearer to the way along the member, with the square of their number."""
    exact = sfetcas.solve(rod(dimension=dimension), accuracy=1e-10).last.position("B")
    missed = []
    for discs in (4, 8):
        way = [{"member": "m", "offset": D, "discs": discs}]
        missed.append(np.linalg.norm(sfetcas.solve(rod(way, dimension), accuracy=1e-10).last.position("B") - exact))
    assert np.log2(missed[0] / missed[1]) == pytest.approx(2.0, abs=0.05)


# -- a finger ------------------------------------------------------------------------------------------

PHALANGES = (0.045, 0.028, 0.02)
JOINT = 0.02
"""Stiffness of the springs in the hinges, N m."""
HOLES = (0.25, 0.8)
"""Where each phalanx has an eyelet, 6 mm from its axis."""


def finger(dimension="plane", **pull):
    """Three rigid phalanges on hinges with springs, and a tendon from the ground through two eyelets of each."""
    x = np.concatenate([[0.0], np.cumsum(PHALANGES)])
    names = ["p0", "p1", "p2"]
    nodes = {f"n{i}": {"position": [float(at), 0.0, 0.0], "joint": "hinge"} for i, at in enumerate(x)}
    nodes["n0"] |= {"support": "hinge", "joint": "rigid"}
    nodes["n3"] |= {"joint": "rigid"}
    between = [["ground", "p0"], ["p0", "p1"], ["p1", "p2"]]
    springs = {f"k{i}": {"node": f"n{i}", "stiffness": JOINT, "between": pair} for i, pair in enumerate(between)}
    way = [{"ground": [-0.02, 0.006]}, *({"member": name, "offset": 0.006, "discs": list(HOLES)} for name in names)]
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0}},
            "nodes": nodes,
            "members": {n: {"nodes": [f"n{i}", f"n{i + 1}"], "type": "rigid"} for i, n in enumerate(names)},
            "springs": springs,
            "tendons": {"t": {"way": way, **pull}},
        }
    )


def eyelets(angles):
    """Places (7, 2) along the way, and of the joints (4, 2), by the relative angles of the hinges."""
    places, joints, total = [np.array([-0.02, 0.006])], [np.zeros(2)], 0.0
    for angle, length in zip(angles, PHALANGES, strict=True):
        total += angle
        along, across = np.array([np.cos(total), np.sin(total)]), np.array([-np.sin(total), np.cos(total)])
        places += [joints[-1] + at * length * along + 0.006 * across for at in HOLES]
        joints.append(joints[-1] + length * along)
    return np.array(places), np.array(joints)


def strings(angles):
    """Length of the way."""
    return np.linalg.norm(np.diff(eyelets(angles)[0], axis=0), axis=1).sum()


def bent_finger(tension):
    """Angles of the hinges by the balance of work: stiffness times angle = - tension times change of length."""

    def missing(angles, h=1e-6):
        steps = h * np.eye(3)
        pulled = np.array([(strings(angles + s) - strings(angles - s)) / (2.0 * h) for s in steps])
        return JOINT * angles + tension * pulled

    return root(missing, np.zeros(3), tol=1e-13).x


@DIMENSIONS
def test_finger(dimension):
    """Angles, lengths, and what a phalanx carries: all that pulls beyond the cut, the tendon's own force left out."""
    angles = bent_finger(2.0)
    places, joints = eyelets(angles)
    step = sfetcas.solve(finger(dimension, tension=2.0)).last
    # The derivatives of the lengths are differences, exact to 1e-10.
    for i, angle in enumerate(angles):
        assert step.spring(f"k{i}").travel == pytest.approx(angle, abs=1e-8)
    np.testing.assert_allclose(step.position("n3")[:2], joints[-1], atol=1e-9)
    assert step.tendon("t")["length"] == pytest.approx(strings(angles), abs=1e-10)
    units = np.diff(places, axis=0)
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    for name, at, first in (
        ("p0", 0.1, 0),
        ("p0", 0.5, 1),
        ("p0", 0.9, 2),
        ("p1", 0.5, 3),
        ("p2", 0.5, 5),
        ("p2", 0.9, 6),
    ):
        found = step.along(name, [at])
        # The string at the cut pulls what is beyond it back; without string there nothing does.
        pull = -2.0 * units[first] if first < 6 else np.zeros(2)
        np.testing.assert_allclose(found["force"][0, :2], pull, atol=1e-8)
        arm = places[min(first, 6)] - found["position"][0, :2]
        np.testing.assert_allclose(found["moment"][0, 2], arm[0] * pull[1] - arm[1] * pull[0], atol=1e-10)
    force, moment = step.reaction("n0")
    np.testing.assert_allclose(force[:2], -2.0 * -units[0], atol=1e-8)
    np.testing.assert_allclose(moment, 0.0, atol=1e-10)


@DIMENSIONS
def test_pulled_finger(dimension):
    """A given shortening needs the tension that gives this shortening."""
    pull = strings(np.zeros(3)) - strings(bent_finger(2.0))
    assert sfetcas.solve(finger(dimension, pull=float(pull))).last.tendon("t")["tension"] == pytest.approx(
        2.0, abs=1e-6
    )


@DIMENSIONS
def test_rigid_member_with_a_tendon_along_it(dimension):
    """A rigid bar is pressed by the tendon along it, and bent by its distance."""
    scene = rod(dimension=dimension, tension=T).to_dict()
    scene["members"]["m"]["type"] = "rigid"
    scene["nodes"]["A"]["support"] = "hinge"
    scene["springs"] = {"k": {"node": "A", "stiffness": 1.0}}
    scene["tendons"]["t"]["way"] = [{"ground": [-0.5, 0.5]}, {"member": "m", "offset": D}]
    scene["loads"] = {"f": {"type": "force", "node": "B", "value": [0.0, 0.3]}}
    step = sfetcas.solve(Scene.from_dict(scene)).last
    angle = np.arctan2(*step.position("B")[1::-1])
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    hole = D * across
    pull = T * (np.array([-0.5, 0.5]) - hole) / np.linalg.norm(np.array([-0.5, 0.5]) - hole)
    # About the hinge: the spring, the load, and the piece to the ground.
    assert angle == pytest.approx(0.3 * along[0] + hole[0] * pull[1] - hole[1] * pull[0], abs=1e-9)
    found = step.along("m", [0.4])
    np.testing.assert_allclose(found["force"][0, :2], [0.0, 0.3] - T * along, atol=1e-9)
    assert found["moment"][0, 2] == pytest.approx(0.3 * 0.6 * along[0] + T * D, abs=1e-9)
    assert step.tendon("t")["length"] == pytest.approx(1.0 + np.linalg.norm(np.array([-0.5, 0.5]) - hole), abs=1e-9)


# -- what hangs on strings alone -----------------------------------------------------------------------


@DIMENSIONS
@pytest.mark.parametrize("stiffness", [50.0, None])
def test_bar_on_strings(dimension, stiffness):
    """A bar that nothing but two strings hold: forces and moments of strings and weights are in balance."""
    points, rest, weights = np.array([[-0.3, 1.0], [1.5, 0.8]]), np.array([[0.0, 0.0], [1.0, 0.0]]), (1.0, 2.0)
    ways = {"l": [{"ground": [-0.3, 1.0]}, {"node": "B"}], "r": [{"node": "C"}, {"ground": [1.5, 0.8]}]}
    pull = {"pull": 0.0} if stiffness is None else {"pull": 0.0, "stiffness": stiffness}
    scene = Scene.from_dict(
        {
            "dimension": dimension,
            "nodes": {"B": {"position": [0, 0, 0]}, "C": {"position": [1, 0, 0]}},
            "members": {"m": {"nodes": ["B", "C"], "type": "rigid"}},
            "tendons": {name: {"way": way, **pull} for name, way in ways.items()},
            "loads": {n: {"type": "force", "node": n, "value": [0, -w]} for n, w in zip("BC", weights, strict=True)},
        }
    )
    step = sfetcas.solve(scene).last
    ends = np.array([step.position(name)[:2] for name in "BC"])
    lengths, free = np.linalg.norm(points - ends, axis=1), np.linalg.norm(points - rest, axis=1)
    tensions = np.array([step.tendon(name)["tension"] for name in "lr"])
    if stiffness is None:
        np.testing.assert_allclose(lengths, free, atol=1e-12)
    else:
        np.testing.assert_allclose(tensions, stiffness * (lengths - free), atol=1e-10)
    forces = tensions[:, None] * (points - ends) / lengths[:, None] - np.array([[0.0, w] for w in weights])
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-10)
    moments = ends[:, 0] * forces[:, 1] - ends[:, 1] * forces[:, 0]
    assert moments.sum() == pytest.approx(0.0, abs=1e-10)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(1.0)


# -- every analysis ------------------------------------------------------------------------------------


PULLS = {
    "tension": {"tension": T},
    "pull": {"pull": T * D**2 / EI, "pushes": True},
    "stiffness": {"pull": T * D**2 / EI + T / 600.0, "stiffness": 600.0},
}
"""The same circle by each of the ways to pull."""

KINDS = pytest.mark.parametrize("pull", PULLS.values(), ids=PULLS)


@KINDS
@DIMENSIONS
def test_path(dimension, pull):
    path = sfetcas.solve(rod(dimension=dimension, analysis={"type": "path", "range": [0, 3], "steps": [2.0]}, **pull))
    for factor, place in zip(path.main.factors, path.positions("B"), strict=True):
        np.testing.assert_allclose(place, arc(factor * T * D / EI) if factor else [1, 0, 0], atol=1e-4)


def test_buckling():
    """A string in the axis of a column does not buckle it; one between its ends does, at pi^2 EI: both ends swing."""
    along = rod([{"member": "m", "offset": 0.0}], "plane", tension=100.0)
    smallest = [sfetcas.solve(along.replace({"tendons.t.tension": t})).last.certificate.smallest for t in (100.0, 1e-3)]
    assert smallest[0] == pytest.approx(smallest[1], rel=1e-6)
    for tension, stable in ((0.99 * np.pi**2 * EI, True), (1.01 * np.pi**2 * EI, False)):
        scene = rod([{"node": "A"}, {"node": "B"}], "plane", tension=tension, analysis={"unstable": "stay"})
        assert sfetcas.solve(scene).last.certificate.stable is stable


@KINDS
def test_modes(pull):
    """Frequencies about the circle, plane against space; with a given length the stiff tendon raises the first one."""
    analysis = {"type": "modes", "modes": 2}
    plane = sfetcas.solve(rod(dimension="plane", analysis=analysis, **pull))
    space = sfetcas.solve(rod(dimension="space", analysis={"type": "modes", "modes": 6}, **pull))
    for omega in plane.omega:
        assert np.abs(np.array(space.omega) / omega - 1.0).min() < 1e-6
    free = sfetcas.solve(rod(dimension="plane", analysis=analysis, tension=T)).omega[0]
    assert plane.omega[0] >= free * (1.0 - 1e-9)


@pytest.mark.parametrize("pull", [{"tension": T}, {"pull": 0.0, "stiffness": 50.0}], ids=["tension", "stiffness"])
def test_motion(pull):
    """Let go from rest, a rod keeps the sum of its energies, to which the tendon belongs, by either integrator.

    Radau damps the waves of the jump at the begin, which the energy-momentum scheme keeps.
    """
    more = {} if "tension" in pull else {"loads": {"p": {"type": "moment", "node": "B", "value": 0.3}}}
    analysis = {"type": "dynamic", "end": 0.5, "accuracy": 1e-4, "output": 0.1}
    places = []
    for integrator, lost in (("radau-3", 5e-2), ("conserving", 5e-3)):
        scene = rod(dimension="plane", analysis={**analysis, "integrator": integrator}, **pull)
        motion = sfetcas.solve(Scene.from_dict({**scene.to_dict(), **more}))
        energies = [step.energy for step in motion.steps]
        largest = max(energy["kinetic"] for energy in energies)
        assert largest > 0.01
        np.testing.assert_allclose([energy["total"] for energy in energies], 0.0, atol=lost * largest)
        places.append(np.array([step.position("B") for step in motion.steps]))
        assert motion.steps[-1].tendon("t")["length"] != pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(*places, atol=2e-3)


@pytest.mark.parametrize("way", [{}, {"from": 0.2, "to": 0.8}])
@pytest.mark.parametrize("pull", [{"tension": T}, {"pull": 0.001, "stiffness": 50.0}], ids=["tension", "stiffness"])
def test_between_two_clamps(way, pull):
    """What is open where a rod cannot shorten is shared as between parts that hardly stretch."""

    def held(EA):
        scene = rod([{"member": "m", "offset": 0.0, **way}], **pull)
        table = scene.to_dict()
        table["nodes"]["B"]["support"] = "clamped"
        table["sections"]["s"] |= {} if EA is None else {"EA": EA}
        return sfetcas.solve(Scene.from_dict(table)).last

    stiff, stretched = held(None), held(1e9)
    # What a stiffness of 1e9 N lets it stretch, with room for the rounding of that.
    for end in "AB":
        np.testing.assert_allclose(stiff.reaction(end), stretched.reaction(end), atol=1e-6)
    x = [0.1, 0.5, 0.9]
    np.testing.assert_allclose(stiff.along("m", x)["force"], stretched.along("m", x)["force"], atol=1e-6)


def beside(tables, way=None, **pull):
    """The rod in the plane with further tables."""
    return Scene.from_dict({**rod(way, dimension="plane", **pull).to_dict(), **tables})


@pytest.mark.parametrize("initial", ["equilibrium", "undeformed"])
def test_an_elastic_tendon_begins_as_long_as_its_way(initial):
    """What it is longer by has no inertia, so it does not stand still at its value without loads."""
    load = {"loads": {"p": {"type": "moment", "node": "B", "value": 0.3}}}
    pulled = {"pull": 0.02, "stiffness": 50.0}
    analysis = {"type": "dynamic", "end": 0.002, "step": 0.001, "output": 0.002, "initial": initial}
    moved = sfetcas.solve(beside({**load, "analysis": analysis}, **pulled)).steps
    if initial == "undeformed":
        assert moved[0].energy["elastic"] == pytest.approx(0.5 * 50.0 * 0.02**2, rel=1e-9)
        return
    still = sfetcas.solve(beside(load, **pulled)).last
    for step in moved:
        # The accuracy of the motion.
        assert step.tendon("t")["tension"] == pytest.approx(still.tendon("t")["tension"], rel=1e-4)
        assert step.energy["elastic"] == pytest.approx(still.energy["elastic"], rel=1e-4)


FINE = {"analysis": {"accuracy": 1e-8}}


@pytest.mark.parametrize(
    ("pull", "way"),
    [
        ({"tension": 60.0}, {}),
        ({"pull": 0.05}, {}),
        ({"tension": 60.0, "friction": 0.1}, {}),
        ({"pull": 0.1, "stiffness": 1000.0}, {"discs": [0, 0.2, 0.4, 0.6, 0.8, 1]}),
    ],
    ids=["tension", "pull", "friction", "discs"],
)
def test_touching_an_obstacle(pull, way):
    """What an obstacle gives is a force, and given as a load it leaves everything where it was."""
    round_one = {"type": "circle", "center": [0.6, 0.25], "radius": 0.15, "member": "m"}
    way = [{"member": "m", "offset": 0.05, **way}]
    touching = sfetcas.solve(beside({"contacts": {"round": round_one}, **FINE}, way, **pull)).last
    found = touching.contacts["round"]
    force = {"type": "force", "member": "m", "at": found["at"], "value": found["force"][:2].tolist()}
    loaded = sfetcas.solve(beside({"loads": {"f": force}, **FINE}, way, **pull)).last
    assert np.linalg.norm(found["force"]) > 1.0
    # The accuracy asked for.
    np.testing.assert_allclose(touching.position("B"), loaded.position("B"), atol=1e-8)
    assert touching.tendon("t")["length"] == pytest.approx(loaded.tendon("t")["length"], abs=1e-8)


@pytest.mark.parametrize("friction", [{}, {"friction": 0.2}, {"friction": 0.2, "pulled_at": "end"}])
@pytest.mark.parametrize("kind", ["flexible", "rigid"])
def test_from_the_ground_to_what_touches_an_obstacle(kind, friction):
    """The pull of the ground is in the balance, and the contact force as a load leaves everything where it was."""
    if kind == "rigid":
        scene = sfetcas.load(Path(__file__).parent.parent / "problems" / "tendon_finger.toml").replace(expect=())
        scene = scene.replace({f"tendons.flexor.{key}": value for key, value in friction.items()})
        round_one, member, node = {"center": [0.055, 0.045], "radius": 0.02}, "distal", "tip"
    else:
        way = [{"ground": [-0.2, 0.08]}, {"member": "m", "offset": 0.08, "discs": 8}]
        scene = rod(way, pull=0.12, **friction)
        round_one, member, node = {"center": [0.6, 0.35], "radius": 0.2}, "m", "B"
    scene = scene.replace({"analysis.accuracy": 1e-8})
    touching = sfetcas.solve(scene.replace(contacts={"ball": {"type": "circle", **round_one, "members": "all"}})).last
    found = touching.contacts["ball"]
    assert found["member"] == member
    load = {"type": "force", "member": member, "at": found["at"], "value": found["force"][:2].tolist()}
    loaded = sfetcas.solve(scene.replace(loads={"f": load})).last
    # The accuracy asked for.
    np.testing.assert_allclose(touching.position(node), loaded.position(node), atol=1e-8)


def test_beside_an_obstacle_all_forces_are_rounding():
    """A rod that its own tendon bends and that touches nothing is refused for no force that is missing."""
    round_one = {"type": "circle", "center": [0.6, 0.25], "radius": 0.15, "member": "m"}
    way = [{"member": "m", "offset": 0.05, "discs": [0, 0.2, 0.4, 0.6, 0.8, 1]}]
    for tension in (0.5, 2.0, 12.0, 18.0):
        found = sfetcas.solve(beside({"contacts": {"r": round_one}, **FINE}, way, tension=tension, friction=0.1)).last
        assert found.contacts["r"]["at"] is None


def test_lying_on_an_obstacle():
    """A tendon along a member bends it as natural curvature does, also where it lies on a drum."""
    drum = {"type": "circle", "center": [0.4, 1.001], "radius": 1.0, "member": "m"}
    load = {"type": "force", "node": "B", "value": [-2.5, 1.5]}
    tables = {"contacts": {"drum": drum}, "loads": {"p": load}, **FINE}
    strung = sfetcas.solve(beside(tables, tension=14.0)).last
    without = beside(tables, tension=14.0).to_dict()
    del without["tendons"]
    without["actuations"] = {"a": {"member": "m", "value": 14.0 * D / EI}}
    bent = sfetcas.solve(Scene.from_dict(without)).last
    assert np.ptp(strung.contacts["drum"]["at"]) > 0.01
    np.testing.assert_allclose(strung.contacts["drum"]["at"], bent.contacts["drum"]["at"], atol=1e-8)
    np.testing.assert_allclose(strung.position("B"), bent.position("B"), atol=1e-8)


@pytest.mark.parametrize("pull", [{"tension": T}, {"pull": 0.01, "pushes": True}, {"pull": 0.05, "stiffness": 50.0}])
def test_motion_of_a_pull(pull):
    """Pulled slowly, against statics: at the end it is at rest but for what the begin left."""
    history = {"h": {"t": [0, 6], "polynomial": [[0, 0, 0, 10, -15, 6]]}}
    analysis = {"type": "dynamic", "end": 6.0, "accuracy": 1e-4, "output": 6.0}
    scene = {**rod(dimension="plane", history=None, **pull).to_dict(), "histories": history, "analysis": analysis}
    scene["tendons"]["t"]["history"] = "h"
    moved = sfetcas.solve(Scene.from_dict(scene)).steps[-1]
    still = sfetcas.solve(rod(dimension="plane", **pull)).last
    np.testing.assert_allclose(moved.position("B"), still.position("B"), atol=2e-3)
    assert moved.tendon("t")["tension"] == pytest.approx(still.tendon("t")["tension"], rel=5e-2)


@KINDS
@DIMENSIONS
def test_parameters(dimension, pull):
    """Answers and their derivatives by what pulls, against the circle."""
    name = "tendons.t.tension" if "tension" in pull else "tendons.t.pull"
    asked = [
        "nodes.B.position",
        "tendons.t.tension",
        "tendons.t.length",
        "members.m.moment at 0.3",
        "members.m.force at 0.3",
    ]
    family = sfetcas.parametric(rod(dimension=dimension, analysis={"accuracy": 1e-8}, **pull), [name], asked)
    (value,) = (v for k, v in pull.items() if k in name)
    answer = family.solve({name: 1.5 * value})
    curvature = 1.5 * T * D / EI
    np.testing.assert_allclose(np.ravel(answer["nodes.B.position"]), arc(curvature), atol=1e-8)
    assert answer["tendons.t.tension"] == pytest.approx(1.5 * T)
    assert answer["tendons.t.length"] == pytest.approx(1.0 - D * curvature)
    np.testing.assert_allclose(np.ravel(answer["members.m.moment at 0.3"])[2], EI * curvature, atol=1e-7)
    force = -1.5 * T * np.array([np.cos(0.3 * curvature), np.sin(0.3 * curvature), 0.0])
    np.testing.assert_allclose(np.ravel(answer["members.m.force at 0.3"]), force, atol=1e-6)
    slope = answer.jacobian["tendons.t.tension"][name].item()
    assert slope == pytest.approx(T / value, rel=1e-6)


def test_offset_as_parameter():
    """Where a tendon lies is a number of the scene as any other."""
    family = sfetcas.parametric(rod(analysis={"accuracy": 1e-8}), ["tendons.t.way.0.offset.0"], ["nodes.B.position"])
    answer = family.solve({"tendons.t.way.0.offset.0": 0.12})
    np.testing.assert_allclose(np.ravel(answer["nodes.B.position"]), arc(T * 0.12 / EI), atol=1e-8)


def test_parameters_of_the_robot():
    """The same answers by statics and by parametric solvers, in space, through discs and along the members."""
    for discs in (False, True):
        scene = robot(discs, analysis={"accuracy": 1e-8})
        asked = [
            "nodes.tip.position",
            "members.one.moment at 0.31",
            "members.one.force at 0.31",
            "members.one.curvature at 0.31",
        ]
        answer = sfetcas.parametric(scene, ["tendons.a.tension"], asked).solve({})
        step = sfetcas.solve(scene).last
        np.testing.assert_allclose(np.ravel(answer["nodes.tip.position"]), step.position("tip"), atol=1e-9)
        for key in ("moment", "force", "curvature"):
            told = step.along("one", [0.31])[key][0]
            np.testing.assert_allclose(np.ravel(answer[f"members.one.{key} at 0.31"]), told, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", ["tension", "pull"])
def test_design(name):
    """What turns the end by half a radian."""
    found = sfetcas.find(rod(**PULLS[name]), {f"tendons.t.{name}": (1e-3, 20.0)}, {"nodes.B.angle": 0.5})
    exact = {"tension": 0.5 * EI / D, "pull": 0.5 * D}[name]
    assert found.values[f"tendons.t.{name}"] == pytest.approx(exact, rel=1e-5)


def test_optimal_control():
    """A tendon swings a rigid bar about a hinge, with the work that the bar gets."""
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "tendons": {"t": {"way": [{"ground": [0, 0.5]}, {"member": "m", "discs": [0.6]}], "tension": 1.0}},
            "analysis": {"type": "dynamic", "end": 1.0},
        }
    )
    problem = sfetcas.OptimalControl(scene, {"tendons.t.tension": (0, 9)}, time=1.0, intervals=10)
    problem.minimise(problem.integral(problem.control("tendons.t.tension") ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.angle")) == 0.5, name="turned")
    found = problem.solve()
    angle = found.answer("nodes.B.angle").ravel()
    length = np.hypot(0.6 * np.cos(angle), 0.6 * np.sin(angle) - 0.5)
    pull = found.control("tendons.t.tension").ravel()
    work = -np.sum(pull * np.diff(np.interp(np.linspace(0, 1, len(pull) + 1), found.times, length)))
    speed = np.gradient(angle, found.times)[-1]
    assert work == pytest.approx(0.5 * speed**2 / 3.0, rel=5e-2)


@needs_compiler
@pytest.mark.parametrize("discs", [False, True], ids=["along", "discs"])
def test_exported_code(tmp_path, discs):
    """The program in C agrees with the process of the same functions."""
    scene = robot(discs, analysis={"accuracy": 1e-4})
    solver = sfetcas.export(
        scene, tmp_path / "c", name="c", arguments=["tendons.a.tension"], results=["nodes.tip.position"]
    )
    outcome, results = solver.solve([4.0])
    assert outcome.code is Code.SOLVED
    np.testing.assert_allclose(results, ROBOT[discs], atol=1e-4)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


@needs_compiler
@pytest.mark.parametrize("name", ["pull", "stiffness"])
def test_exported_pull(tmp_path, name):
    """Rows that several elements share are in the program in C too."""
    results = ["nodes.B.position", "tendons.t.tension", "members.m.moment at 0.3"]
    scene = rod(dimension="plane", **PULLS[name])
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["tendons.t.pull"], results=results)
    outcome, found = solver.solve([PULLS[name]["pull"]])
    assert outcome.code is Code.SOLVED
    curvature = T * D / EI
    np.testing.assert_allclose(found, [*arc(curvature), T, 0.0, 0.0, EI * curvature], atol=1e-5)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


def test_control_of_a_servo():
    """An elastic tendon that a servo shortens turns a bar; the replay by an integrator agrees."""
    elastic = {"stiffness": 40.0, "pushes": True}
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "tendons": {"t": {"way": [{"ground": [0, 0.5]}, {"member": "m", "discs": [0.6]}], "pull": 0.01, **elastic}},
            "analysis": {"type": "dynamic", "end": 1.0},
        }
    )
    problem = sfetcas.OptimalControl(scene, {"tendons.t.pull": (0.0, 0.5)}, time=1.0, intervals=8)
    problem.minimise(problem.integral(problem.control("tendons.t.pull") ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.angle")) == 0.3, name="turned")
    found = problem.solve()
    assert found.check.difference < 1e-4
    stiff = scene.replace({"tendons.t.stiffness": None, "tendons.t.pull": 0.0})
    with pytest.raises(SceneError, match=r"controls.tendons\.t: found a control of a length that has to be followed"):
        sfetcas.OptimalControl(stiff, {"tendons.t.pull": (0.0, 0.5)}, time=1.0, intervals=8).solve()


# -- pictures ------------------------------------------------------------------------------------------


def test_picture():
    """A tendon is drawn where it is: along the deformed member, and from hole to hole; a slack one is thinner."""
    pytest.importorskip("matplotlib").use("Agg")
    from test_plotting import drawn, named, texts

    tendons = {
        "along": {"way": [{"member": "m", "offset": D}], "tension": T},
        "holes": {"way": [{"ground": [0, -0.2]}, {"member": "m", "offset": -D, "discs": [0.5, 1.0]}], "pull": -0.1},
    }
    step = sfetcas.solve(rod(tendons=tendons)).last
    figure = step.plot()
    (along,) = drawn(figure, "tendon-along")
    radius = EI / T / D - D
    # A circle about the same centre; the mesh is that of the default accuracy.
    np.testing.assert_allclose(np.hypot(along[:, 0], along[:, 1] - EI / T / D), radius, atol=1e-4)
    first, last = drawn(figure, "tendon-holes")
    angle = T * D / EI
    hole = arc(angle)[:2] + D * np.array([np.sin(angle), -np.cos(angle)])
    np.testing.assert_allclose(last[-1], hole, atol=1e-4)
    np.testing.assert_allclose(first[0], [0.0, -0.2], atol=1e-12)
    thin, thick = (named(figure, f"tendon-{name}")[0].get_linewidth() for name in ("holes", "along"))
    assert thin < thick
    # The legend says what they are.
    assert "tendon" in texts(figure)
    assert "chamber" in texts(sfetcas.solve(rod(pressure=3e5, area=1e-5)).last.plot())


# -- what is refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pull", "words"),
    [
        ({"way": [{"node": "C"}, {"node": "B"}], "tension": 1.0}, "tendons.t.way.0.node: found 'C', accepted: A, B"),
        ({"way": [{"member": "n"}], "tension": 1.0}, "tendons.t.way.0.member: found 'n', accepted: m"),
        ({"way": [{"node": "A"}], "tension": 1.0}, "tendons.t.way: found a way without length"),
        ({"way": [{"node": "A"}, {"node": "A"}], "tension": 1.0}, "tendons.t.way: found a way without length"),
        ({"way": [], "tension": 1.0}, "tendons.t.way: found a way without length"),
        ({"way": [{"node": "A"}, {"ground": [0, 0]}], "tension": 1.0}, "piece without length at"),
        ({"way": [{"member": "m"}], "tension": -1.0}, "tendons.t.tension: found -1.0, accepted: zero or"),
        (
            {"way": [{"member": "m"}], "pressure": -1.0, "area": 1.0},
            "tendons.t.pressure: found -1.0, accepted: zero or",
        ),
        ({"way": [{"member": "m"}], "pressure": 1.0}, "'pressure' and 'area' together"),
        ({"way": [{"member": "m"}], "tension": 1.0, "pull": 0.1}, "found 'tension' and 'pull', accepted: one of"),
        ({"way": [{"member": "m"}]}, "tendons.t: accepted: one of 'tension'"),
        ({"way": [{"member": "m"}], "tension": 1.0, "stiffness": 2.0}, "tendons.t.stiffness: found with a tension"),
        ({"way": [{"member": "m", "node": "A"}], "tension": 1.0}, "way.0: found node and member, accepted: one of"),
        ({"way": [{"member": "m", "from": 0, "to": 2}], "tension": 1.0}, "way.0.to: found 2, accepted"),
        ({"way": [{"member": "m", "from": 0.5, "to": 0.5}], "tension": 1.0}, "way.0.to: found 0.5 to 0.5, accepted"),
        ({"way": [{"member": "m", "discs": 0}], "tension": 1.0}, "way.0.discs: found 0, accepted: a number of discs"),
        ({"way": [{"member": "m", "offset": [1, 2, 3]}], "tension": 1.0}, "way.0.offset: found three numbers"),
        (
            {"way": [{"member": "m", "offset": ["x", 0]}], "tension": 1.0},
            "way.0.offset: found the formula 'x', accepted",
        ),
        ({"way": [{"node": "A", "discs": 3}], "tension": 1.0}, "way.0.discs: not accepted with a node"),
        ({"way": [{"member": "m"}], "tension": 1.0, "history": "h"}, "tendons.t.history: found 'h'"),
    ],
)
def test_refused(pull, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        rod(tendons={"t": pull})


def test_pulled_too_far():
    """A shortening that no shape has is said to be impossible."""
    with pytest.raises(sfetcas.SolveError, match=r"no shape .* tendons\.t"):
        sfetcas.solve(rod(pull=5.0))


def test_slackness_is_not_searched_with_modes_on_a_path():
    with pytest.raises(SceneError, match=r"tendons\.t: found a length that is given with modes on a path, in which no"):
        rod(pull=0.01, analysis={"type": "path", "range": [0, 1], "modes": 2})


def test_generated_code_finds_where_a_string_is_slack(tmp_path):
    solver = sfetcas.export(rod(pull=0.01), tmp_path / "c", arguments=["tendons.t.pull"])
    solved = [solver.solve(np.array([pull])) for pull in (0.01, 0.02, -0.01)]
    assert [outcome.code.name for outcome, _ in solved] == ["SOLVED"] * 3
    tensions = [float(solver.by_name(results)["tendons.t.tension"]) for _, results in solved]
    assert tensions[1] > tensions[0] > tensions[2] == 0.0


@pytest.mark.parametrize("given", [{"pull": 0.1}, {"length": 0.9}])
def test_a_way_along_rigid_members_alone_has_no_length_to_give(given):
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "C": {"position": [2, 0]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "r": {"nodes": ["B", "C"], "type": "rigid"}},
        "tendons": {"t": {"way": [{"member": "r", "offset": 0.1}], **given}},
    }
    with pytest.raises(SceneError, match=r"tendons\.t\.way: found a way along rigid members alone, which is always"):
        Scene.from_dict(table)
    Scene.from_dict({**table, "tendons": {"t": {"way": [{"member": "r", "offset": 0.1}], "tension": 1.0}}})


def test_a_pull_does_not_jump():
    """A motion cannot follow a length that jumps."""
    with pytest.raises(SceneError, match=r"tendons\.t: the key 'history' is missing"):
        rod(pull=0.01, pushes=True, analysis={"type": "dynamic", "end": 1.0})


@pytest.mark.parametrize("turns", [1, 4, 8, 12])
def test_what_winds_around_a_member_is_in_space(turns):
    """However many of its samples lie in the plane."""
    coil = [{"member": "m", "helix": {"radius": 0.05, "turns": turns}}]
    assert rod(coil, tension=1.0).resolved_dimension == "space"
    with pytest.raises(SceneError, match=r"tendons\.t\.way\.0 leaves x-y"):
        rod(coil, tension=1.0, dimension="plane")


def test_a_factor_that_makes_a_string_push_is_told():
    step = sfetcas.solve(rod(tension=T, analysis={"steps": [-1.0]})).last
    assert step.notes == ("the tension of 't' is below zero, -3 N: it pushes, as no string does",)
    assert sfetcas.solve(rod(tension=T)).last.notes == ()
