"""Quantities of answers by their names: how they are read, and values that are known otherwise."""

import re

import numpy as np
import pytest

from sfetcas import Scene, SceneError, Settings, parametric, solve
from sfetcas.description.answers import ANSWERS, answer_name, check_answer
from sfetcas.equilibria.quantities import value_of
from sfetcas.mathematics import quaternion

# -- names --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("nodes.B.position", ("nodes.NAME.position", "B", None, {})),
        ("nodes.B.position.1", ("nodes.NAME.position", "B", 1, {})),
        ("nodes.B.position.y", ("nodes.NAME.position", "B", 1, {})),
        ("nodes.B.quaternion.x", ("nodes.NAME.quaternion", "B", 1, {})),
        ("members.my beam.curvature.b3 at 0.5", ("members.NAME.curvature", "my beam", 2, {"at": 0.5})),
        ("nodes.x at 2.angle step 1e-1", ("nodes.NAME.angle", "x at 2", None, {"step": 0.1})),
        ("factor limit_point 2", ("factor", "", None, {"limit_point": 2.0})),
        ("contacts.floor.at", ("contacts.NAME.at", "floor", None, {})),
        ("energy.elastic", ("energy.elastic", "", None, {})),
        ("stiffness.B", ("stiffness.NAME", "B", None, {})),
    ],
)
def test_names_are_read(text, read):
    name = answer_name(text)
    assert (name.kind.name, name.record, name.component, name.selectors) == read
    again = answer_name(name.text)
    assert (again.kind, again.record, again.component, again.selectors) == (name.kind, *read[1:])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (3, "found 3, accepted: a name"),
        ("node.B.position", "found 'node', accepted: certificate, .*; did you mean 'nodes'?"),
        ("nodes.B", "found 'nodes.B', accepted: nodes.NAME.KEY"),
        ("nodes.B.positon", "found 'positon', accepted: .*; did you mean 'position'?"),
        ("nodes.B.position.b1", "found the component 'b1', accepted: x, y, z, 0, 1, 2"),
        ("nodes.B.angle.z", "found the component 'z', accepted: none, as nodes.NAME.angle is one number"),
        ("nodes.B.position.y.0", "found 'nodes.B.position.y.0', accepted: nodes.NAME.KEY"),
        ("members.m.moment at half", "found 'members.m.moment at half', accepted: a number after 'at'"),
        ("factor limit_point 1.5", "found 'factor limit_point 1.5', accepted: a number after 'limit_point'"),
        ("factor.tip", "found 'factor.tip', accepted: factor"),
    ],
)
def test_what_is_no_name_is_refused(text, sentence):
    with pytest.raises(SceneError, match=re.escape(sentence).replace(re.escape(".*"), ".*")):
        answer_name(text)


def beam(section, dimension="space", **tables):
    table = {
        "dimension": dimension,
        "sections": {"s": section},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [2, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
    }
    return Scene.from_dict({**table, **tables})


STRIP = {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0}
TURNED = {"EI2": 2.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0, "rhoI": [0.02, 0.01, 0.01]}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("nodes.C.position", "found 'C', accepted: A, B"),
        ("nodes.B.angle", "found 'nodes.B.angle', accepted of 'B': position, quaternion, velocity, angular_velocity"),
        ("reactions.B.force", "node 'B' is free: no ground acts on it"),
        ("members.m.bending_stress at 0", "found 'members.m.bending_stress', accepted of 'm': position, "),
        ("springs.k.travel", "found 'springs.k.travel', accepted of 'k': angle, moment"),
        ("energy.kinetic", "found 'energy.kinetic', told of motion, steps only, accepted of statics: energy.elastic"),
        ("modes.omega", "found 'modes.omega', told of modes only, accepted of statics: factor, omega, nodes.*"),
    ],
)
def test_what_a_scene_does_not_have_is_refused(text, sentence):
    scene = beam(STRIP, springs={"k": {"node": "B", "stiffness": 1.0, "axis": [0, 0, 1]}})
    with pytest.raises(SceneError, match=re.escape(sentence)):
        check_answer(scene, answer_name(text))
    with pytest.raises(SceneError, match=r"expect\.0\.quantity: " + re.escape(sentence)):
        scene.replace(expect=[{"quantity": text, "value": True}])


def test_keys_of_an_expect_may_stand_behind_the_name():
    scene = beam(STRIP, expect=[{"quantity": "members.m.moment.z at 0.5 step 1", "value": 0.0, "tolerance": 1.0}])
    (expect,) = scene.expect
    assert (expect.quantity, expect.at, expect.step) == ("members.m.moment.z", 0.5, 1.0)
    with pytest.raises(SceneError, match="found 'at' behind the name and as a key, accepted: one of them"):
        beam(STRIP, expect=[{"quantity": "members.m.angle at 0.5", "at": 0.5, "value": True}])


# -- fibres and energies ------------------------------------------------------------------------------

MOMENT = np.array([0.0, -3.0, 4.0])
"""At the end of a cantilever: N m."""


@pytest.mark.parametrize(
    ("shape", "inertia", "strain"),
    [
        # Second moments about b2 and b3, and M h / 2 EI summed as the shape asks for.
        (
            {"shape": "rectangle", "width": 0.03, "height": 0.02},
            (0.02 * 0.03**3 / 12, 0.03 * 0.02**3 / 12),
            lambda k: 0.015 * abs(k[0]) + 0.01 * abs(k[1]),
        ),
        (
            {"shape": "circle", "radius": 0.01},
            (np.pi * 0.01**4 / 4, np.pi * 0.01**4 / 4),
            lambda k: 0.01 * np.hypot(*k),
        ),
        (
            {"shape": "tube", "outer": 0.02, "inner": 0.015},
            (np.pi * (0.02**4 - 0.015**4) / 4, np.pi * (0.02**4 - 0.015**4) / 4),
            lambda k: 0.02 * np.hypot(*k),
        ),
    ],
    ids=["rectangle", "circle", "tube"],
)
@pytest.mark.parametrize("plane", [True, False])
def test_bending_stress_of_a_cantilever_under_an_end_moment(shape, inertia, strain, plane):
    moment = MOMENT * ([0, 0, 1] if plane else 1.0)
    young = 2e11
    load = {"end": {"type": "moment", "node": "B", "value": moment.tolist()}}
    scene = beam({**shape, "E": young, "nu": 0.3}, "plane" if plane else "space", loads=load)
    step = solve(scene, accuracy=1e-10).last
    # The moment is the same everywhere; it bends by so little that sections stay along the axes to 1e-4 of it.
    bent = strain(moment[1:] / (young * np.array(inertia)))
    tolerance = 1e-10 if plane else 1e-4
    for at in (0.0, 0.3, 1.0):
        assert value_of(step, f"members.m.bending_strain at {at}") == pytest.approx(bent, rel=tolerance)
    assert value_of(step, "members.m.largest_bending_strain") == pytest.approx(bent, rel=tolerance)
    assert value_of(step, "members.m.largest_bending_stress") == pytest.approx(young * bent, rel=tolerance)


def test_largest_stress_between_nodes_is_found():
    """Under a load q x / L between hinges the moment is greatest at L / sqrt(3): q L^2 / (9 sqrt(3))."""
    young, radius, load = 1e9, 0.05, 1e-3
    scene = beam({"shape": "circle", "radius": radius, "E": young, "nu": 0.3}, "plane")
    nodes = {
        "A": {"position": [0, 0], "support": "hinge"},
        "B": {"position": [2, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
    }
    weight = {"q": {"type": "distributed", "member": "m", "value": [0, -load], "profile": {"polynomial": [0, 1]}}}
    members = {"m": {"nodes": ["A", "B"], "section": "s", "element": "SFET5", "elements": 3}}
    step = solve(scene.replace(nodes=nodes, loads=weight, members=members)).last
    wanted = load * 4.0 / (9.0 * np.sqrt(3.0)) * radius / (np.pi * radius**4 / 4)
    # A parabola through places a 48th of the length apart, of a cubic; the nearest of them alone is off by 1e-4.
    assert step.table("members", "m")["largest_bending_stress"] == pytest.approx(wanted, rel=1e-5)


def frame():
    """A flexible, a small and a rigid member, and springs of all kinds."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [1, 0]},
                "C": {"position": [1, 1]},
                "D": {"position": [2, 1]},
            },
            "members": {
                "a": {"nodes": ["A", "B"], "section": "s"},
                "b": {"nodes": ["B", "C"], "section": "s", "type": "small"},
                "c": {"nodes": ["C", "D"], "type": "rigid"},
            },
            "springs": {
                "turn": {"node": "B", "stiffness": 0.4},
                "pull": {"type": "translational", "node": "D", "anchor": [3, 2], "stiffness": 0.2},
                "slide": {"type": "translational", "node": "D", "direction": [0, 1], "stiffness": 0.1},
            },
            "motions": {"lift": {"node": "A", "displacement": [0, 0.1], "rotation": 0.05}},
            "loads": {"f": {"type": "force", "node": "D", "value": [0.1, -0.2]}},
        }
    )


def driven(dimension):
    """Two beams whose joint is turned by a motion, on a hinge that another one turns."""
    hinge = {"axis": [0, 0, 1]}
    return beam(
        STRIP,
        dimension,
        nodes={
            "A": {"position": [0, 0, 0], "support": "hinge", **hinge},
            "B": {"position": [1, 0, 0], "joint": "hinge", **hinge},
            "C": {"position": [2, 0, 0]},
        },
        members={"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["B", "C"], "section": "s"}},
        motions={"root": {"node": "A", "rotation": 0.3}, "knee": {"node": "B", "between": ["m", "n"], "rotation": 4.0}},
        loads={"f": {"type": "force", "node": "C", "value": [0.1, -0.2, 0.0]}},
    )


def test_energies_of_members_and_springs_add_up_to_the_strain_energy():
    scene = frame()
    step = solve(scene).last
    springs = sum(
        0.5 * scene.springs[name].stiffness * step.spring(name).travel ** 2 for name in ("turn", "pull", "slide")
    )
    members = [value_of(step, f"members.{name}.energy") for name in "ab"]
    assert min(members) > 1e-4
    assert sum(members) + springs == pytest.approx(step.energy["elastic"], rel=1e-12)
    assert "energy" not in step.table("members", "c")


def test_springs_that_are_strained_where_nothing_is_loaded_have_their_energy():
    """Half the stiffness times the squared way from rest: from the undeformed scene on, and none where they relax."""
    springs = {
        "turn": {"type": "rotational", "node": "A", "stiffness": 3.0, "rest": 0.2},
        "line": {"type": "translational", "node": "B", "stiffness": 50.0, "direction": [0, 1], "rest": 0.3},
        "rope": {"type": "translational", "node": "B", "stiffness": 8.0, "anchor": [1, -1], "length": 0.5},
    }
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "mass": 1.0}},
        "members": {"arm": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": springs,
    }
    motion = solve(Scene.from_dict({**table, "analysis": {"type": "dynamic", "end": 0.5, "output": 0.5}}))
    for state in motion.steps:
        x, y, angle = *state.position("B")[:2], state.angle("A")
        wanted = 1.5 * (angle - 0.2) ** 2 + 25.0 * (y - 0.3) ** 2 + 4.0 * (np.hypot(x - 1.0, y + 1.0) - 0.5) ** 2
        assert state.energy["elastic"] == pytest.approx(wanted, rel=1e-9)
    assert motion.steps[0].energy["elastic"] == pytest.approx(0.06 + 2.25 + 1.0, rel=1e-12)
    # Nothing is taken, from the first state on.
    assert motion.last.energy["total"] == pytest.approx(motion.steps[0].energy["total"], rel=1e-5)
    alone = solve(Scene.from_dict({**table, "springs": {"turn": springs["turn"]}, "analysis": {"steps": [1.0]}}))
    assert alone.steps[0].energy["elastic"] == pytest.approx(0.0, abs=1e-15)


def test_no_elastic_energy_is_below_zero_by_rounding():
    """Springs at their rest, whatever their lengths."""
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "mass": 1.0}},
        "members": {"arm": {"nodes": ["A", "B"], "type": "rigid"}},
    }
    lengths = np.linspace(0.1, 2.0, 20)
    springs = {
        f"s{i}": {"type": "translational", "node": "B", "stiffness": 1e5, "anchor": [1 + a, 1.3 * a]}
        | {"length": float(np.hypot(a, 1.3 * a))}
        for i, a in enumerate(lengths)
    }
    for name, spring in springs.items():
        state = solve(Scene.from_dict({**table, "springs": {name: spring}, "analysis": {"steps": [1.0]}})).last
        # Half the stiffness times the square of rounding of the length.
        assert 0.0 <= state.energy["elastic"] <= 0.5 * 1e5 * 1e-30 * 16.0


def test_expressions_say_what_answers_say():
    """Each name that both know, of a frame in the plane, of a bent rod in space, and of one that stretches."""
    square = {"shape": "rectangle", "width": 0.03, "height": 0.02, "E": 1e6, "nu": 0.3}
    force = {"f": {"type": "force", "node": "B", "value": [0, 0.002, 0.004]}}
    rod = beam(
        square,
        loads=force,
        springs={"k": {"node": "B", "stiffness": 1e-3, "axis": [0, 0, 1]}},
        tendons={"t": {"way": [{"member": "m", "offset": [0.01, 0.02]}], "tension": 0.02, "friction": 0.2}},
        actuations={"k": {"member": "m", "value": [0.3, -0.4, 0.5], "profile": {"polynomial": [1, 1]}}},
        fields={
            "even": {"value": [0.02, 0.03, -0.01]},
            "coil": {"type": "linear", "gradient": [[0.1, 0, 0.02], [0, -0.05, 0], [0.02, 0, -0.05]]},
            "magnet": {"type": "dipole", "position": [0.2, 0.4, -0.3], "moment": [100.0, 200.0, 50.0]},
        },
        magnets={
            "strip": {"member": "m", "moment_density": [0.1, 0.02, 0.03], "from": 0.1, "to": 0.9},
            "tip": {"node": "B", "moment": [0.05, 0, 0.02]},
        },
    )
    tube = {"members": "m", "section": "s", "start": -0.1, "length": 0.6, "curvature": 0.5, "angle": 0.7}
    sheath = beam(square, loads=force, tubes={"t": tube})
    eyelet = {"position": [1, 0, 0], "support": "clamped"}
    ringed = beam({**square, "stretch": True}, loads=force).to_dict()
    ringed |= {"rings": {"r": {"node": "R", "member": "m", "at": 0.5, "travel": -0.01}}}
    ringed = Scene.from_dict({**ringed, "nodes": {**ringed["nodes"], "R": eyelet}})
    drum = {"type": "circle", "center": [0.35, -0.3], "radius": 0.25, "members": "all"}
    pressed = beam(
        {"EI3": 1.0}, "plane", loads={"f": {"type": "force", "node": "B", "value": [0, -2]}}, contacts={"c": drum}
    )
    met = set()
    yielding = beam({**square, "stretch": True, "shear": True}, loads=force)
    stopped = beam(square, loads=force, springs={"k": {"node": "B", "stiffness": 1e-3, "stop": [-1e-3, 1e-3]}})
    for scene in (frame(), rod, yielding, driven("plane"), driven("space"), sheath, ringed, pressed, stopped):
        names = []
        for kind in (kind for kind in ANSWERS if {"statics", "parameters"} <= set(kind.where)):
            table = {"reactions": "nodes"}.get(kind.table, kind.table)
            for record in getattr(scene, table) if kind.named else [""]:
                text = kind.name.replace("NAME", record) + (" at 0.3" if kind.along else "")
                turns = kind.key in ("quaternion", "angle", "") and kind.table != "members"
                if turns and record in scene.nodes and scene.nodes[record].joint != "rigid":
                    continue
                if scene.tubes and kind.key in ("curvature", "bending_strain", "bending_stress"):
                    continue
                try:
                    check_answer(scene, answer_name(text))
                except SceneError:
                    continue
                if not kind.along or scene.members[record].type == "flexible":
                    names.append(text)
                    met.add(kind.name)
        mesh = Settings(element="SFET5", elements=4)
        answer, step = parametric(scene, ["loads.f.value"], names, settings=mesh).solve(), solve(scene, mesh).last
        for text in names:
            found, wanted = answer[text], value_of(step, text)
            # Both signs of a quaternion are the same rotation.
            sign = -1.0 if ".quaternion" in text and found @ wanted < 0.0 else 1.0
            # Of one mesh, both to the residuals of their solvers.
            assert sign * found == pytest.approx(wanted, rel=1e-8, abs=1e-11), text
    wanted = {kind.name for kind in ANSWERS if {"statics", "parameters"} <= set(kind.where)}
    assert met == wanted


# -- rates --------------------------------------------------------------------------------------------


def test_angular_velocity_is_the_derivative_of_the_rotation():
    """Against differences of quaternions along rotation vectors that turn about changing axes, small and large."""
    step = 1e-5
    for size in (1e-9, 1e-2, 2.0):
        phi, rate = size * np.array([0.3, -0.5, 0.8]), np.array([1.0, 0.4, -0.2])
        before, after = (quaternion.from_rotation_vector(phi + s * step * rate) for s in (-1, 1))
        here = quaternion.from_rotation_vector(phi)
        wanted = 2.0 * quaternion.multiply((after - before) / (2 * step), quaternion.conjugate(here))[1:]
        # The difference errs by the square of its step and by rounding over it.
        assert quaternion.angular_velocity(phi, rate) == pytest.approx(wanted, abs=1e-9)


def flying(dimension, integrator):
    """A rigid rod that flies and turns about z at 3 rad/s, its first end at rest at the begin."""
    spin = 3.0 if dimension == "plane" else [0, 0, 3.0]
    finely = {"accuracy": 1e-6} if integrator == "idas" else {"step": 0.01}
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {"rhoA": 2.0, "rhoI": [0.2, 0.1, 0.1]}},
            "nodes": {"A": {"position": [0, 0, 0], "velocity": [0, 0, 0]}, "B": {"position": [1, 0, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "s", "spin": spin}},
            "analysis": {"type": "dynamic", "end": 0.4, "output": 0.1, "integrator": integrator, **finely},
        }
    )


@pytest.mark.parametrize("integrator", ["radau-3", "idas"])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_free_rod_turns_evenly_and_moves_as_a_rigid_body(dimension, integrator):
    motion = solve(flying(dimension, integrator))
    turning = np.array([0.0, 0.0, 3.0])
    # No force acts: the angular velocity stays; 40 steps of order 5, or the accuracy asked for.
    for step in motion.steps:
        found = step.along("m", [0.0, 0.25, 1.0])
        assert step.angular_velocity("B") == pytest.approx(turning, abs=1e-5)
        assert found["angular_velocity"] == pytest.approx(np.tile(turning, (3, 1)), abs=1e-5)
        arms = found["position"] - step.position("A")
        assert found["velocity"] - step.velocity("A") == pytest.approx(np.cross(turning, arms), abs=1e-5)
        assert found["velocity"][-1] == pytest.approx(step.velocity("B"), abs=1e-5)
    assert motion.angular_velocities("A")[-1] == pytest.approx(turning, abs=1e-5)
    assert value_of(motion.last, "nodes.B.angular_velocity.z") == pytest.approx(3.0, abs=1e-5)
    assert value_of(motion.last, "members.m.velocity.y at 0") == pytest.approx(motion.last.velocity("A")[1], abs=1e-12)


@pytest.mark.parametrize("integrator", ["radau-3", "idas"])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_a_driven_hinge_turns_at_the_rate_of_its_history(dimension, integrator):
    finely = {"accuracy": 1e-4} if integrator == "idas" else {"step": 0.01}
    smooth = {"t": [0, 1], "polynomial": [[0, 0, 0, 10, -15, 6]]}
    scene = beam(
        TURNED,
        dimension,
        nodes={"A": {"position": [0, 0, 0], "support": "hinge"}, "B": {"position": [2, 0, 0]}},
        members={"m": {"nodes": ["A", "B"], "section": "s", "element": "SFET3", "elements": 2}},
        histories={"h": smooth},
        motions={"drive": {"node": "A", "rotation": 0.4, "history": "h"}},
        analysis={"type": "dynamic", "end": 0.6, "output": 0.1, "integrator": integrator, **finely},
    )
    for step in solve(scene).steps:
        rate = 0.4 * 30.0 * step.time**2 * (1.0 - step.time) ** 2
        # The angle is prescribed at the steps, its rate by a polynomial of degree 6 through these: 1e-2^6.
        assert step.angular_velocity("A") == pytest.approx([0, 0, rate], abs=1e-9)


def test_velocities_along_a_bent_beam_are_those_of_its_positions():
    """A whipping beam in space: differences of positions over the times; ends are those of the nodes."""
    spin = {"nodes": ["A", "B"], "section": "s", "spin": [0, 1.0, 2.0], "element": "SFET3", "elements": 3}
    held = {"A": {"position": [0, 0, 0], "support": "ball"}, "B": {"position": [2, 0, 0]}}
    analysis = {"type": "dynamic", "end": 0.02, "output": 1e-3, "step": 1e-3}
    motion = solve(beam(TURNED, nodes=held, members={"m": spin}, gravity=[0, 0, -9.81], analysis=analysis))
    at = [0.0, 0.37, 0.8, 1.0]
    places = np.array([step.along("m", at)["position"] for step in motion.steps])
    turned = np.array([step.along("m", at)["quaternion"] for step in motion.steps])
    k = 10
    # Central differences of order 4 over steps of 1 ms: the beam's own vibrations of this size change in 0.1 s.
    rates = [(8 * (f[k + 1] - f[k - 1]) - (f[k + 2] - f[k - 2])) / 12e-3 for f in (places, turned)]
    found = motion.steps[k].along("m", at)
    assert found["velocity"] == pytest.approx(rates[0], abs=1e-5)
    wanted = 2.0 * quaternion.multiply(rates[1], quaternion.conjugate(turned[k]))[:, 1:]
    assert np.linalg.norm(wanted, axis=1).min() > 1.0
    assert found["angular_velocity"] == pytest.approx(wanted, abs=1e-4)
