"""Angles in space count turns: springs wound several times by loads, motions and drives, against the plane."""

import numpy as np
import pytest
from scenes import made

from sfetcas import SolveError, solve, solve_model
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.solvers.globalised import Code, Globalised

TILT = quat.from_rotation_vector([0.4, -0.7, 0.2])


def crank(dimension, *, stiffness=0.5, moment=0.0, **more):
    """A rigid crank on a hinge with a spring; in space about a tilted axis."""
    space = dimension == "space"
    axis, arm = (quat.rotate(TILT, v) if space else np.array(v) for v in ([0, 0, 1.0], [1.0, 0, 0]))
    return {
        "dimension": dimension,
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "hinge", "axis": axis.tolist()},
            "B": {"position": arm.tolist()},
        },
        "members": {"crank": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"node": "A", "stiffness": stiffness, "axis": axis.tolist()}},
        "loads": {"m": {"type": "moment", "node": "A", "value": (moment * axis).tolist()}},
    } | more


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("angle", [2.0, 3.2, 6.4, 8.0, 20.0, -40.0])
def test_angle_is_the_moment_over_the_stiffness(dimension, angle):
    step = solve(made(crank(dimension, moment=0.5 * angle))).last
    spring = step.spring("k")
    assert spring.travel == pytest.approx(angle, rel=1e-12)
    assert spring.effort == pytest.approx(-0.5 * angle, rel=1e-12)
    assert step.energy["elastic"] == pytest.approx(0.25 * angle**2, rel=1e-12)
    assert step.energy["loads"] == pytest.approx(-0.5 * angle**2, rel=1e-12)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_prescribed_turns_wind_a_spring(dimension):
    table = crank(dimension, motions={"turn": {"node": "A", "rotation": 20.0}})
    table["springs"]["k"]["rest"] = 9.0
    for step in solve(made(table | {"analysis": {"steps": [0.1, 1.0, -1.0]}})).steps:
        assert step.spring("k").travel == pytest.approx(20.0 * step.factor, rel=1e-12)
        moment = 0.5 * (20.0 * step.factor - 9.0)
        axis = quat.rotate(TILT, [0, 0, 1.0]) if dimension == "space" else [0, 0, 1.0]
        np.testing.assert_allclose(step.reaction("A")[1], moment * np.asarray(axis), atol=1e-12)


@pytest.mark.parametrize("driven", [False, True])
def test_paths_count_turns(driven):
    """Along the factor of a moment or of a motion, at crossings beyond one and three turns."""
    table = crank("space", moment=0.0 if driven else 0.5)
    table["motions"] = {"turn": {"node": "A", "rotation": 1.0}} if driven else {}
    table["analysis"] = {"type": "path", "range": [0, 21], "steps": [8, 20]}
    crossings = solve(made(table)).steps
    assert [step.spring("k").travel for step in crossings] == pytest.approx([8.0, 20.0], rel=1e-9)


def arms(dimension, *, drive=None, moment=0.0):
    """A flexible arm on a hinged crank, joined by a hinge with a spring; the arm's tip carries a moment."""
    table = crank(dimension, stiffness=0.3)
    space = dimension == "space"
    axis, far = (quat.rotate(TILT, v) if space else np.array(v) for v in ([0, 0, 1.0], [1.6, 0, 0]))
    table["nodes"]["B"] |= {"joint": "hinge", "axis": axis.tolist()}
    table["nodes"]["C"] = {"position": far.tolist()}
    table["members"]["arm"] = {"nodes": ["B", "C"], "section": "s"}
    table["springs"]["joint"] = {
        "node": "B", "stiffness": 0.2, "between": ["crank", "arm"], "axis": axis.tolist()
    }  # fmt: skip
    table["loads"] = {"m": {"type": "moment", "node": "C", "value": (moment * axis).tolist()}}
    if drive is not None:
        table["motions"] = {"drive": {"node": "B", "between": ["crank", "arm"], "rotation": drive}}
    return table


@pytest.mark.parametrize(("drive", "moment"), [(None, 2.5), (None, -4.0), (11.0, 1.0), (-20.0, -1.0)])
def test_mechanism_in_space_winds_its_springs_as_in_the_plane(drive, moment):
    """The same mechanism in a tilted plane: angles, moments and elastic energies agree."""
    plane, space = (solve(made(arms(d, drive=drive, moment=moment)), accuracy=1e-8).last for d in ("plane", "space"))
    for name in ("k", "joint"):
        assert space.spring(name).travel == pytest.approx(plane.spring(name).travel, rel=1e-10)
        assert space.spring(name).effort == pytest.approx(plane.spring(name).effort, rel=1e-9)
    assert plane.spring("k").travel == pytest.approx(moment / 0.3, rel=1e-9)
    if drive is None:
        assert plane.spring("joint").travel == pytest.approx(moment / 0.2, rel=1e-9)
    else:
        assert plane.spring("joint").travel == pytest.approx(drive, rel=1e-12)
    assert space.energy["elastic"] == pytest.approx(plane.energy["elastic"], rel=1e-9)


@pytest.mark.parametrize("by_core", [True, False])
def test_a_warm_solve_counts_the_turns_that_a_drive_makes(by_core, monkeypatch):
    """From one equilibrium to another by a turn and more, at once: the drive says where the angle is."""
    if not by_core:
        monkeypatch.setattr(Globalised, "_by_core", lambda *_, **__: None)
    solver = equilibrium_solver(made(arms("space", drive=1.0)), "c", arguments=["motions.drive.rotation"])
    first, results = solver.solve([1.0])
    assert float(solver.by_name(results)["springs.joint.angle"]) == pytest.approx(1.0, rel=1e-12)
    for drive in (8.0, -20.0):
        outcome, results = solver.solve([drive], start=first.state)
        assert outcome.code is Code.SOLVED
        assert float(solver.by_name(results)["springs.joint.angle"]) == pytest.approx(drive, rel=1e-12)


def test_forces_wind_a_spring_through_a_string_of_torsion():
    """A shaft clamped to a wheel that turns twice round winds the spring at its other end, as two springs in series."""
    turned, stiffness, torsion = 13.0, 0.7, 1.0
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 50.0, "EI3": 50.0, "GJ": torsion}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "hinge", "axis": [1, 0, 0]},
            "B": {"position": [1, 0, 0], "support": "slider", "direction": [1, 0, 0], "rotation": "hinge"},
        },
        "members": {"shaft": {"nodes": ["A", "B"], "section": "s"}},
        "springs": {"k": {"node": "A", "stiffness": stiffness, "axis": [1, 0, 0]}},
        "motions": {"wheel": {"node": "B", "rotation": turned}},
    }
    table["nodes"]["B"]["axis"] = [1, 0, 0]
    step = solve(made(table)).last
    moment = turned / (1.0 / stiffness + 1.0 / torsion)
    assert step.spring("k").travel == pytest.approx(moment / stiffness, rel=1e-9)
    np.testing.assert_allclose(step.reaction("B")[1], [moment, 0, 0], atol=1e-8)


def test_a_cold_solve_of_a_model_never_reports_a_wrapped_angle():
    """IPOPT alone does not follow: what it cannot tell from a turn less is counted right or refused by its name."""
    refused = []
    for drive in (1.0, 5.0, 8.0, 11.0, 20.0, -20.0):
        scene = made(arms("space", drive=drive))
        try:
            step = solve_model(assemble(scene, uniform_mesh(scene, 4, 2)))
        except SolveError as error:
            refused.append((drive, str(error)))
        else:
            assert step.spring("joint").travel == pytest.approx(drive, rel=1e-9)
    assert refused
    assert 1.0 not in dict(refused)
    assert all("springs.joint stands at" in sentence for _, sentence in refused)


def test_angle_of_a_ball_whose_axis_swings_half_round_is_refused():
    """Half a turn across the axis of a spring is any turn about it: there is no angle to report."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "springs": {"k": {"node": "A", "stiffness": 1.0, "axis": [1, 0, 0]}},
        "motions": {"over": {"node": "A", "rotation": [0, 0, np.pi]}},
    }
    with pytest.raises(SolveError, match=r"springs\.k: its axis has swung half round"):
        solve(made(table))
    table["motions"]["over"]["rotation"] = [0, 0, 2.9]
    assert solve(made(table)).last.spring("k").travel == pytest.approx(0.0, abs=1e-12)


def on_a_universal_support(stiffness, force, *, between=None, rest=(0.0, 0.0)):
    """A rigid arm on a universal support with a spring about each of its axes."""
    axes = quat.rotate(TILT, np.eye(3))
    arm = quat.rotate(TILT, np.array([0.3, -0.2, 1.0]))
    return axes[0], axes[1], arm, {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "universal", "axis": axes[0].tolist(), "axis2": axes[1].tolist()},
            "B": {"position": arm.tolist()},
        },
        "members": {"arm": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {
            name: {"node": "A", "stiffness": k, "axis": axis.tolist(), "rest": r}
            | ({"between": between} if between else {})
            for name, k, axis, r in zip(("one", "two"), stiffness, axes[:2], rest, strict=True)
        },
        "loads": {"f": {"type": "force", "node": "B", "value": force}},
    }  # fmt: skip


@pytest.mark.parametrize("between", [None, ["arm", "ground"]])
def test_universal_support_gives_no_moment_about_its_axes(between):
    """Springs act about the axes they are on, the ground about the normal of both.

    Two turns one after the other, by hand: the energy is least over the angles that the springs tell, the reaction
    does no work on them, and it balances the load and the springs.
    """
    stiffness, rest, force = (0.9, 1.4), (0.3, -0.2), np.array([1.1, -0.7, 0.4])
    one, two, arm, table = on_a_universal_support(stiffness, force.tolist(), between=between, rest=rest)
    step = solve(made(table)).last
    sign = 1.0 if between is None else -1.0
    angles = np.array([sign * step.spring(name).travel for name in ("one", "two")])
    assert np.abs(angles).min() > 0.2

    def place(angles):
        turned = quat.multiply(*(quat.from_rotation_vector(a * v) for a, v in zip(angles, (one, two), strict=True)))
        return turned, quat.rotate(turned, arm)

    def energy(angles):
        wound = angles - sign * np.array(rest)
        return 0.5 * float(np.asarray(stiffness) @ wound**2) - force @ place(angles)[1]

    turned, tip = place(angles)
    np.testing.assert_allclose(step.position("B"), tip, atol=1e-12)
    for unit in np.eye(2):
        # Central differences over 1e-5 leave 1e-10 of the energy.
        assert energy(angles + 1e-5 * unit) - energy(angles - 1e-5 * unit) == pytest.approx(0.0, abs=1e-14)
    moment = step.reaction("A")[1]
    carried = quat.rotate(turned, two)
    assert abs(moment @ one) < 1e-12
    assert abs(moment @ carried) < 1e-12
    efforts = [sign * step.spring(name).effort for name in ("one", "two")]
    np.testing.assert_allclose(moment + efforts[0] * one + efforts[1] * carried, -np.cross(tip, force), atol=1e-11)
    assert np.linalg.norm(moment) > 0.1


@pytest.mark.parametrize(
    "load",
    [{"value": [0, 0, 0]}, {"value": [0, 0.5, 0], "frame": "follower", "history": "late"}],
    ids=["no load", "follower with a dead time"],
)
def test_where_nothing_acts_an_angle_that_counts_turns_stays(load):
    """No correction is needed there, which is no sign of a step that is too long."""
    scene = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0, 0], "joint": "hinge", "axis": [0, 0, 1]},
            "C": {"position": [2, 0, 0]},
        },
        "members": {"a": {"nodes": ["A", "B"], "section": "s"}, "b": {"nodes": ["B", "C"], "section": "s"}},
        "springs": {"k": {"type": "rotational", "node": "B", "between": ["a", "b"], "stiffness": 1.0}},
        "loads": {"p": {"type": "force", "node": "C", **load}},
        "histories": {"late": {"t": [0, 0.5, 1], "value": [0, 0, 1]}} if "history" in load else {},
    }
    step = solve(made(scene)).last
    assert step.way == ("growing",)
    plane = {**scene, "dimension": "plane"}
    assert step.position("C") == pytest.approx(solve(made(plane)).last.position("C"), abs=1e-6)
