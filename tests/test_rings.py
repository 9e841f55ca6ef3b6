"""Rings: nodes that slide along members, against knife edges, closed forms, other models of the same and each other."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError, SolveError, Status, parametric, solve
from sfetcas.codegen.timestep import time_step
from sfetcas.mechanics.elements import element_by_name
from sfetcas.mechanics.rings import up_to
from sfetcas.solvers.globalised import Code


def cantilever(changes=None, analysis=None, force=(0.0, -3.0), dimension="auto", **ring):
    """A clamped beam of length 1 through a ring that the ground holds at 0.6, with a force on its tip."""
    table = {
        "dimension": dimension,
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "R": {"position": [0.6, 0], "support": "ball"},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "rings": {"r": {"node": "R", "member": "m", **ring}},
        "loads": {"f": {"type": "force", "node": "B", "value": list(force)}},
        "analysis": {"accuracy": 1e-8, **(analysis or {})},
    }
    return Scene.from_dict(table).replace(changes or {})


def shot(force, at=0.6, length=1.0):
    """The same by shooting: place of the ring, its force on the beam, and position of the tip."""
    force = np.array(force)

    def march(pulled, bend, s):
        def rate(n):
            return lambda x, y: [np.cos(y[2]), np.sin(y[2]), y[3], -(np.cos(y[2]) * n[1] - np.sin(y[2]) * n[0])]

        tight = {"rtol": 1e-12, "atol": 1e-13}
        before = solve_ivp(rate(pulled), (0.0, s), [0.0, 0.0, 0.0, bend], **tight).y[:, -1]
        return before, solve_ivp(rate(force), (s, length), before, **tight).y[:, -1]

    def missed(unknown):
        before, after = march(unknown[:2], *unknown[2:])
        push = unknown[:2] - force
        return [before[0] - at, before[1], push @ [np.cos(before[2]), np.sin(before[2])], after[3]]

    start = solve(cantilever(force=force, analysis={"accuracy": 1e-4})).last
    ring, bend = start.ring("r"), start.along("m", 0.0)["moment"][0, 2]
    found = root(missed, [*(ring["force"][:2] + force), bend, ring["at"]], tol=1e-12)
    # Whether steps as small as rounding count as progress differs between processors; what is missed does not.
    assert np.abs(found.fun).max() < 1e-10
    return found.x[3], found.x[:2] - force, march(found.x[:2], *found.x[2:])[1][:2]


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("force", [(0.0, -3.0), (-4.0, 6.0)])
def test_a_beam_through_a_ring_by_shooting(force, dimension):
    """The force of the ring is normal to the beam, which slides through it as it bends, up or down."""
    step = solve(cantilever(force=force, dimension=dimension)).last
    at, push, tip = shot(force)
    ring = step.ring("r")
    assert ring["at"] == pytest.approx(at, abs=1e-8)
    # A hundred times the accuracy of positions.
    np.testing.assert_allclose(ring["force"][:2], push, atol=1e-6 * np.linalg.norm(push))
    np.testing.assert_allclose(step.position("B")[:2], tip, atol=1e-8)
    assert step.certificate.stable is True
    np.testing.assert_allclose(step.reaction("R")[0], ring["force"], atol=1e-9)


@pytest.mark.parametrize("stretch", [{}, {"sections.s.EA": 40.0}])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_section_forces_jump_by_the_force_of_the_ring(dimension, stretch):
    """Moments are continuous there, and follow from the forces on either side; so do those of parameters."""
    scene = cantilever(stretch, dimension=dimension)
    step = solve(scene).last
    s, push = step.ring("r")["at"], step.ring("r")["force"]
    beside = np.array([s - 1e-7, s + 1e-7])
    cut = step.along("m", beside)
    np.testing.assert_allclose(cut["force"][0] - cut["force"][1], push, atol=1e-6)
    np.testing.assert_allclose(cut["moment"][0], cut["moment"][1], atol=1e-5)
    x = np.array([0.0, 0.3, s - 1e-3, s + 1e-3, 0.8, 1.0])
    found = step.along("m", x)
    arms = step.position("B") - found["position"]
    load, ring = np.array([0.0, -3.0, 0.0]), step.position("R") - found["position"]
    moments = np.cross(arms, load) + np.where(x < s, 1.0, 0.0)[:, None] * np.cross(ring, push)
    np.testing.assert_allclose(found["moment"], moments, atol=1e-7)
    given = parametric(scene, ["loads.f.value.1"], ["members.m.force", "members.m.moment"], places={"m": x.tolist()})
    answers = given.solve().answers
    # Its mesh is that of one load, of which the accuracy is asked for.
    np.testing.assert_allclose(answers["members.m.moment"], found["moment"], atol=1e-6)
    np.testing.assert_allclose(answers["members.m.force"], found["force"], atol=1e-5)


def test_it_is_both_sides_of_a_knife_edge():
    """Where an edge pushes it pushes as a ring does."""
    ring = cantilever()
    edge = {"e": {"type": "point", "position": [0.6, 0], "side": [0, 1], "member": "m"}}
    table = ring.to_dict()
    table["nodes"].pop("R")
    table.pop("rings")
    one, other = solve(ring).last, solve(Scene.from_dict({**table, "contacts": edge})).last
    assert one.ring("r")["at"] == pytest.approx(other.contacts["e"]["at"], abs=1e-9)
    np.testing.assert_allclose(one.ring("r")["force"], other.contacts["e"]["force"], atol=1e-7)


def test_the_place_converges_with_the_mesh_whatever_the_order():
    """On meshes that do not end at the ring the error falls as the cube of the length of elements, or faster."""
    exact = solve(cantilever()).last.ring("r")["at"]
    errors = []
    for count in (4, 32):
        fixed = cantilever({"members.m.elements": count, "members.m.element": "SFET4"})
        errors.append(abs(solve(fixed).last.ring("r")["at"] - exact))
    # From halving to halving the ring lies elsewhere in its element: between second and fourth order over three.
    assert errors[1] < errors[0] / 64.0


@pytest.mark.parametrize("order", [1, 4, 8])
@pytest.mark.parametrize("gauss", [False, True])
def test_weights_up_to_a_place(order, gauss):
    """They are the integral of the polynomial through the points: of powers exactly, and all one at the end."""
    import casadi as ca

    element = element_by_name(f"SFET{order + 1}", False, gauss)
    here = ca.SX.sym("here")
    weights = ca.Function("weights", [here], [up_to(element, here)])
    np.testing.assert_allclose(weights(1.0).full().ravel(), 1.0, atol=1e-12)
    for x in (0.0, 0.3, 0.77):
        for power in range(order + 1):
            tangents = element.points**power * element.weights
            assert tangents @ weights(x).full().ravel() == pytest.approx(x ** (power + 1) / (power + 1), abs=1e-12)


def test_the_ring_rests_where_the_energy_is_least():
    """A weight on a heavy wire slides to the lowest place; on one with a slope it is held by none."""
    points = [[0, 0], [0.2, -0.15], [0.4, -0.2], [0.6, -0.15], [0.8, 0]]
    scene = Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "sections": {"s": {"EI3": 1e-2, "rhoA": 0.01}},
            "nodes": {
                "A": {"position": [0, 0], "support": "ball"},
                "B": {"position": [0.8, 0], "support": "ball"},
                "M": {"position": [0.2, -0.15], "mass": 0.5},
            },
            "members": {"w": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "spline", "points": points}}},
            "rings": {"r": {"node": "M", "member": "w"}},
            "analysis": {"accuracy": 1e-7},
        }
    )
    step = solve(scene).last
    assert step.ring("r")["at"] == pytest.approx(0.5, abs=1e-7)
    np.testing.assert_allclose(step.ring("r")["force"], [0.0, -0.5 * 9.81, 0.0], atol=1e-6)
    assert step.certificate.stable is True


def test_two_rings_beside_each_other():
    """A hundredth apart they nearly clamp the beam: meshes are divided at either."""
    near = {"nodes.S": {"position": [0.61, 0], "support": "ball"}, "rings.s": {"node": "S", "member": "m"}}
    step = solve(cantilever(near)).last
    table = cantilever().to_dict() | {"rings": {}}
    table["nodes"] = {"A": {"position": [0.61, 0], "support": "clamped"}, "B": {"position": [1, 0]}}
    clamped = solve(Scene.from_dict(table)).last
    assert step.ring("s")["at"] - step.ring("r")["at"] == pytest.approx(0.01, abs=1e-6)
    # A beam that is held over a hundredth of its length yields by some of that share.
    assert step.position("B")[1] == pytest.approx(clamped.position("B")[1], rel=0.05)


def test_a_ring_that_is_driven_off_its_member_beside_a_floor_is_told_as_without_it():
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0.1], "support": "clamped"},
            "B": {"position": [1, 0.1]},
            "R": {"position": [0.3, 0.1]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "rings": {"r": {"node": "R", "member": "m", "travel": 0.3}},
        "loads": {"F": {"type": "force", "node": "R", "value": [0, -1.0]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "m"}},
        "analysis": {"steps": [3]},
    }
    with pytest.raises(SolveError, match=r"a member slides out of a ring \(ring 'r' would be at the fraction 1\.0"):
        solve(Scene.from_dict(table))


def test_what_slides_off_is_told():
    """A bead on a beam that bends down, a beam that rests on two rings."""
    bead = {"nodes.R": {"position": [0.6, 0], "mass": 1.0}, "gravity": [0, -1]}
    with pytest.raises(SolveError, match="a member slides out of a ring") as error:
        solve(cantilever(bead, analysis={"accuracy": 1e-4}))
    assert error.value.status is Status.SLID
    assert "draw ring 'r' to an end of 'm'" in str(error.value)


# -- driven along ------------------------------------------------------------------------------------------


def test_what_drives_it_is_the_slope_of_the_energy():
    """And the jump of the axial force, as the moment is continuous: the force that acts on configurations."""
    travel, step = 0.1, 1e-4
    here = solve(cantilever(travel=travel)).last
    assert here.ring("r")["at"] == pytest.approx(0.7, abs=1e-12)
    beside = [solve(cantilever(travel=travel + way)).last.energy["total"] for way in (step, -step)]
    drive = here.ring("r")["drive"]
    # Differences of second order.
    assert drive == pytest.approx((beside[0] - beside[1]) / (2.0 * step), rel=1e-6)
    along = here.along("m", 0.7 + 1e-9)
    angle = along["angle"][0]
    assert drive == pytest.approx(-here.ring("r")["force"] @ [np.cos(angle), np.sin(angle), 0.0], rel=1e-6)


def test_a_history_drives_it():
    """As load steps over a history, to and fro."""
    table = {"histories.h": {"t": [0, 1, 2], "value": [0, 1, 0.2]}, "rings.r.history": "h"}
    found = solve(cantilever(table, travel=0.1, analysis={"steps": [0.5, 1.0, 2.0]}))
    assert [step.ring("r")["at"] for step in found.steps] == pytest.approx([0.65, 0.7, 0.62], abs=1e-12)


# -- other analyses ----------------------------------------------------------------------------------------


def test_vibrations_are_those_of_two_spans():
    """About the straight state a ring is a support that lets the beam slide."""
    still = cantilever({"loads": {}}, analysis={"type": "modes", "modes": 4})
    table = still.to_dict()
    table.pop("rings")
    table["nodes"]["R"] = {"position": [0.6, 0], "support": "slider", "direction": [1, 0], "rotation": "ball"}
    table["members"] = {name: {"nodes": list(name), "section": "s"} for name in ("AR", "RB")}
    # The accuracy asked for is that of the shapes, and of frequencies the relative one.
    np.testing.assert_allclose(solve(still).omega, solve(Scene.from_dict(table)).omega, rtol=1e-7)


def test_a_path_ends_where_the_beam_slides_out():
    """A beam pressed down between its ends slips out of the ring: the path says so, and load steps beyond refuse."""
    short = {
        "nodes.B.position": [0.62, 0],
        "loads": {"f": {"type": "force", "member": "m", "at": 0.5, "value": [0, -40]}},
    }
    path = solve(cantilever(short, analysis={"type": "path", "range": [0, 8], "accuracy": 1e-4}))
    assert "a member slides out of a ring (ring 'r' would be at the fraction 1." in path.branches[0].end
    last = path.branches[0].points[-1]
    assert last.factor < 8.0
    with pytest.raises(SolveError, match="a member slides out of a ring") as error:
        solve(cantilever(short, analysis={"steps": [0.5, 8.0]}))
    assert error.value.status is Status.SLID
    assert len(error.value.reached.steps) == 1


@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha", "conserving"])
def test_a_bead_slides_down_a_bar(integrator):
    """Along a straight bar at 30 degrees: half of g, and the bar carries the part of the weight across it."""
    end = np.array([np.cos(np.pi / 6), -0.5])
    scene = Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "sections": {"s": {"rhoA": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": (2.0 * end).tolist()},
                "M": {"position": (0.2 * end).tolist(), "mass": 0.3},
            },
            "members": {"bar": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
            "rings": {"r": {"node": "M", "member": "bar"}},
            "analysis": {"type": "dynamic", "end": 0.6, "output": 0.2, "accuracy": 1e-5, "integrator": integrator},
        }
    )
    answer = solve(scene).to_dict()
    times = np.array(answer["times"])
    # Ten times the accuracy asked for.
    np.testing.assert_allclose(answer["rings"]["r"]["at"], 0.1 + 0.25 * 9.81 * times**2 / 2.0, atol=1e-4)
    across = 0.3 * 9.81 * np.cos(np.pi / 6) * np.array([-end[1], end[0]]) * -1.0
    np.testing.assert_allclose(np.array(answer["rings"]["r"]["force"])[1:, :2], np.tile(across, (3, 1)), atol=1e-3)


def test_a_motion_ends_where_it_slides_off():
    """A bead that reaches the end of its bar: what was computed up to then is kept."""
    scene = Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "sections": {"s": {"rhoA": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [0, -1]},
                "M": {"position": [0, -0.5], "mass": 0.3},
            },
            "members": {"bar": {"nodes": ["A", "B"], "type": "rigid", "section": "s"}},
            "rings": {"r": {"node": "M", "member": "bar"}},
            "analysis": {"type": "dynamic", "end": 1.0, "output": 0.05, "accuracy": 1e-3},
        }
    )
    with pytest.raises(SolveError, match=r"slides out of a ring \(at 0.35 s") as error:
        solve(scene)
    # It is there after the square root of 2 * 0.5 / 9.81 s, 0.319 s.
    assert error.value.reached.times[-1] == pytest.approx(0.3)


def test_energy_of_a_swinging_beam_is_kept():
    """A beam that is let go through its ring, in steps that conserve: slides and bends."""
    scene = cantilever({"loads": {}, "gravity": [0, -9.81]}, analysis={"type": "dynamic", "end": 0.3, "accuracy": 1e-3})
    found = solve(scene.replace({"analysis.integrator": "conserving"}))
    total = np.array(found.to_dict()["energy"]["total"])
    assert np.ptp(np.array(found.to_dict()["rings"]["r"]["at"])) > 1e-3
    # Second order of its steps, as rows with a place are no quadratic functions: the accuracy asked for.
    assert np.ptp(total) < 1e-3 * max(found.to_dict()["energy"]["kinetic"])


def test_parameters_and_their_derivatives():
    """Against solve, and differences of second order."""
    names = ["nodes.B.position", "rings.r.at", "rings.r.force", "rings.r.drive"]
    scene = cantilever(travel=0.05)
    equilibrium = parametric(scene, ["loads.f.value.1", "rings.r.travel"], names)
    answer = equilibrium.solve({"loads.f.value.1": -4.0, "rings.r.travel": 0.08})
    step = solve(scene.replace({"loads.f.value": [0, -4.0], "rings.r.travel": 0.08})).last
    # The mesh is that of the default values, with an end of elements where the ring is then.
    np.testing.assert_allclose(answer["nodes.B.position"], step.position("B"), atol=1e-4)
    np.testing.assert_allclose(answer["rings.r.force"], step.ring("r")["force"], rtol=1e-3)
    assert 1e-6 < answer.errors()["nodes.B.position"] < 1e-3
    assert answer["rings.r.at"] == pytest.approx(0.68, abs=1e-12)
    slope = answer.jacobian["nodes.B.position"]["rings.r.travel"]
    near = [equilibrium.solve({"loads.f.value.1": -4.0, "rings.r.travel": 0.08 + h}) for h in (1e-4, -1e-4)]
    difference = (near[0]["nodes.B.position"] - near[1]["nodes.B.position"]) / 2e-4
    np.testing.assert_allclose(slope, difference, rtol=1e-4, atol=1e-6)


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C agrees with the process of the same functions, also where the ring goes to another element."""
    results = ["nodes.B.position", "rings.r.at", "members.m.moment at 0.65"]
    scene = cantilever(analysis={"accuracy": 1e-4})
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["loads.f.value"], results=results)
    for force in ([0.0, -3.0], [-6.0, -8.0]):
        outcome, found = solver.solve(force)
        assert outcome.code is Code.SOLVED
        step = solve(scene.replace({"loads.f.value": force}), accuracy=1e-7).last
        told = step.along("m", 0.65)["moment"][0]
        # Ten times the accuracy, of a mesh for the first force.
        np.testing.assert_allclose(found[:4], [*step.position("B"), step.ring("r")["at"]], atol=1e-3)
        np.testing.assert_allclose(found[4:], told, atol=1e-2)
    assert "cases agree" in said(built(tmp_path / "c", "c"))


def test_time_steps():
    """The step that is exported as C takes the same steps as the integrator."""
    step = 2e-3
    scene = cantilever(analysis={"type": "dynamic", "end": 0.01, "output": 0.01, "step": step, "accuracy": 1e-4})
    scene = scene.replace({"members.m.elements": 2})
    made = time_step(scene, "motion", results=["nodes.B.position", "rings.r.at"])
    state = made.begin
    for _ in range(5):
        state = made.step(state, step)
    last = solve(scene).last
    np.testing.assert_allclose(made.outputs(state), [*last.position("B"), last.ring("r")["at"]], atol=1e-9)


def test_picture():
    """A ring is drawn as a circle around its member."""
    pytest.importorskip("matplotlib").use("Agg")
    from test_plotting import drawn

    step = solve(cantilever()).last
    (line,) = drawn(step.plot(), "ring-r")
    np.testing.assert_allclose(np.mean(line[:-1], axis=0), [0.6, 0.0], atol=1e-6)


def test_report(capsys):
    """The report names where the ring is and what it does."""
    from sfetcas.reports import report

    report(solve(cantilever(travel=0.1)), 1.0)
    assert "ring r: at 0.7, force (-41.1" in capsys.readouterr().out


# -- what is refused -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rings.r.node": "X"}, "rings.r.node: found 'X', accepted: A, B, R"),
        ({"rings.r.member": "x"}, "rings.r.member: found 'x', accepted: m"),
        ({"rings.r.at": 1.2}, "rings.r.at: found 1.2, accepted"),
        ({"rings.r.at": 0.5}, "rings.r.node: found the node 'R', 0.1 m away from the place at the fraction 0.5"),
        ({"nodes.R.position": [0.6, 0.1]}, "rings.r.node: found the node 'R', 0.1 m away from the place"),
        (
            {"rings.q": {"node": "B", "member": "m"}},
            "rings.q.node: found an end of member 'm', accepted: a node that is not already there",
        ),
        ({"sections.s.EA": 10.0, "sections.s.GA2": 9.0}, "rings.r.member: found the member 'm', which shears, so that"),
        ({"members.m.type": "small"}, "rings.r.member: found the small member 'm', accepted: a flexible or rigid one"),
        ({"rings.r.history": "h", "histories.h": {"t": [0, 1], "value": [0, 1]}}, "rings.r.history: found without"),
        ({"rings.r.history": "h", "rings.r.travel": 0.1}, "rings.r.history: found 'h', but the scene has no"),
    ],
)
def test_refused(changes, words):
    """One sentence that names the key."""
    with pytest.raises(SceneError) as error:
        cantilever(changes)
    assert words in str(error.value)


def test_idas_is_refused():
    """Where a ring is has no inertia of its own."""
    with pytest.raises(
        SceneError, match="found 'idas', but where rings are has no inertia of its own, accepted: radau"
    ):
        solve(cantilever(analysis={"type": "dynamic", "end": 0.1, "integrator": "idas"}))


@pytest.mark.parametrize("name", ["rings.r.at", "nodes.R.position.0", "nodes.B.position.0"])
def test_where_it_begins_is_no_parameter(name):
    """Nodes have to be where the ring is: the undeformed scene would be another one."""
    with pytest.raises(
        SceneError, match=r"parameters\.rings\.r\.at: found a number that changes|found with rings\.r, whose node has"
    ):
        parametric(cantilever(), [name], ["nodes.B.position"])
