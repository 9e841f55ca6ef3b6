"""What no load or stiffness holds, and stiffness that is nothing: one sentence each, and nothing is looked for."""

import math
from pathlib import Path

import numpy as np
import pytest
from scenes import made, textbook

import sfetcas
from sfetcas import SceneError, SolveError, Status, solve

HELD = "neither stiffness nor a load holds it, add a support, a spring or a motion"
ROUND = f"free to move: members crank, coupler, rocker turning with nodes B, C moving; {HELD}"
KINDS = ["rigid", "flexible", "small"]


def fourbar(kind, load, lengths=(1.0, 3.0, 2.5, 3.0), **scene):
    """Crank, coupler, rocker and ground with hinges: a crank that can turn round, a rocker that cannot."""
    crank, coupler, rocker, ground = lengths
    b = crank * math.cos(1.4), crank * math.sin(1.4)
    far = math.dist(b, (ground, 0.0))
    angle = math.atan2(-b[1], ground - b[0]) + math.acos((coupler**2 + far**2 - rocker**2) / (2.0 * coupler * far))
    c = b[0] + coupler * math.cos(angle), b[1] + coupler * math.sin(angle)
    pairs = {"crank": ["A", "B"], "coupler": ["B", "C"], "rocker": ["C", "D"]}
    return {
        "sections": {"s": {"EI2": 1e3, "EI3": 1e3, "GJ": 1e3, "rhoA": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": b, "joint": "hinge"},
            "C": {"position": c, "joint": "hinge"},
            "D": {"position": [ground, 0], "support": "hinge"},
        },
        "members": {name: {"nodes": ends, "type": kind, "section": "s"} for name, ends in pairs.items()},
        "loads": {"m": load},
        **scene,
    }


def moment(value, node="A"):
    return {"type": "moment", "node": node, "value": value}


def message(table):
    with pytest.raises(SceneError) as caught:
        sfetcas.solve(made(table))
    return str(caught.value)


# -- mechanisms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [1.0, -100.0])
def test_a_moment_on_a_crank_that_turns_round_is_held_by_nothing(kind, value):
    assert message(fourbar(kind, moment(value))) == ROUND


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_in_space_and_on_a_path(kind):
    assert message(fourbar(kind, moment([0, 0, 1.0]), dimension="space")) == ROUND
    assert message(fourbar(kind, moment(1.0), analysis={"type": "path", "range": [0, 2]})) == ROUND


def test_a_follower_that_drives_a_crank_round():
    load = {"type": "force", "member": "crank", "at": 0.5, "value": [-1.0, 0.1], "frame": "follower"}
    assert message(fourbar("rigid", load)) == ROUND


@pytest.mark.parametrize("kind", KINDS)
def test_a_moment_on_a_rocker_ends_where_crank_and_coupler_lie_in_line(kind):
    step = sfetcas.solve(made(fourbar(kind, moment(0.1, node="D")))).last
    (x, y, _), (u, v, _) = step.position("B"), step.position("C")
    # Rigid ones lie in line to rounding; others, which the moment bends by 1e-4, nearly.
    assert abs(x * v - y * u) < (1e-9 if kind == "rigid" else 1e-3)
    assert step.certificate.stable is True


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [0.0, 1.0])
def test_weight_holds_a_mechanism_also_against_a_small_moment(kind, value):
    step = sfetcas.solve(made(fourbar(kind, moment(value), gravity=[0, -9.81]))).last
    assert step.certificate.stable is True
    assert step.position("B")[1] < 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_moment_beyond_the_weight_names_the_free_motion_first(kind):
    with pytest.raises(SceneError if kind == "rigid" else SolveError) as caught:
        sfetcas.solve(made(fourbar(kind, moment(1000.0), gravity=[0, -9.81])))
    assert "free to move: members crank, coupler, rocker turning" in str(caught.value)
    if kind != "rigid":
        assert caught.value.detail.startswith("free to move: ")


def test_a_spring_that_winds_up_holds_a_crank():
    """Soft beside the moment: more than one turn, which a round of the free motion must not overlook."""
    table = fourbar("rigid", moment(1.0))
    del table["members"]["coupler"], table["members"]["rocker"], table["nodes"]["C"], table["nodes"]["D"]
    table["nodes"]["B"].pop("joint")
    table["springs"] = {"k": {"node": "A", "stiffness": 0.05}}
    # linear: right to rounding
    assert sfetcas.solve(made(table)).last.angle("A") == pytest.approx(20.0, rel=1e-12)


@pytest.mark.parametrize("rise", [1e-2, 1e-3, 2e-4, 1e-4])
def test_a_spring_holds_a_toggle_close_to_its_dead_point(rise):
    """By the square of the rise: next to nothing, but the closed form is met."""
    table = {
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [1, rise], "joint": "hinge"},
            "C": {"position": [2, 0], "support": "slider", "direction": [1, 0], "rotation": "ball"},
        },
        "members": {name: {"nodes": list(name), "type": "rigid"} for name in ("AB", "BC")},
        "springs": {"k": {"type": "translational", "node": "C", "direction": [1, 0], "stiffness": 1.0}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 0.3 * rise**3]}},
    }
    height = sfetcas.solve(made(table), accuracy=1e-10).last.position("B")[1]
    # At a height y the end travels by 2 sqrt(1 + rise^2 - y^2) - 2, times -2 y over the root for each height.
    root = math.sqrt(1.0 + rise**2 - height**2)
    force = 4.0 * (rise**2 - height**2) / (root + 1.0) * -height / root
    # Rounding of the places, 1e-16, over what the rise squared leaves of it.
    assert force == pytest.approx(0.3 * rise**3, rel=1e-13 / rise**2)


# -- sliding ----------------------------------------------------------------------------------------------------


def slots(load):
    """A rigid bar on two parallel slots."""
    return {
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped", "direction": [1, 0]},
            "B": {"position": [1, 0], "support": "clamped", "direction": [1, 0]},
        },
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "release": ["slot", "slot"]}},
        "loads": {"f": {"type": "force", "member": "m", "at": 0.5, "value": load}},
    }


def test_what_slides_is_refused_in_one_sentence_whoever_finds_it():
    """By the supports alone, by the loads that pull it on, and by an equilibrium that is neutral."""
    guided = {"support": "slider", "direction": [1, 0]}
    plain = {
        "nodes": {"A": {"position": [0, 0], **guided}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [1, 0]}},
    }
    assert message(plain) == f"free to move: nodes A, B moving along [1, 0]; {HELD}"
    for load in ([1, 0], [1, 1], [0, 1]):
        assert message(slots(load)) == f"free to move: member m sliding along [1, 0]; {HELD}"


# -- stiffness that is nothing ----------------------------------------------------------------------------------


def cantilever_of(stiffness, space=False):
    return {
        "dimension": "space" if space else "plane",
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "small", "stiffness": np.asarray(stiffness).tolist()}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, 1]}},
    }


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize(
    "matrix", [np.zeros((12, 12)), textbook(1.0, 1e5, 1.0, 0.0, 0.0), textbook(1.0, 1e5, 1.0, 1.0, 1e-300)]
)
def test_a_matrix_that_resists_nothing_names_the_motion(matrix, space):
    along = "[0, 1, 0]" if space else "[0, 1]"
    assert message(cantilever_of(matrix, space)) == f"free to move: node B moving along {along}; {HELD}"


@pytest.mark.parametrize("space", [False, True])
def test_a_matrix_of_next_to_nothing_is_refused_beside_the_loads(space):
    told = message(cantilever_of(1e-300 * textbook(1.0, 1e5, 1.0, 1.0, 1.0), space))
    assert told.startswith("members.m.stiffness: nothing resists its deformation: found a stiffness of 1e-295 N m")


def clamped(section, load, **scene):
    return {
        "sections": {"s": section},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"f": {"type": "force", "node": "B", "value": load}},
        **scene,
    }


def test_sections_and_springs_of_next_to_nothing_are_refused_beside_the_loads():
    assert message(clamped({"EI3": 1e-300}, [0, 1])) == (
        "members.m: nothing resists its bending: found a stiffness of 1e-300 N m beside loads of 1 N m, "
        "accepted: from 1e-20 of this on"
    )
    soft = {"EI2": 1.0, "EI3": 1.0, "GJ": 1e-300}
    assert message(clamped(soft, [0, 1, 1])).startswith("members.m: nothing resists its torsion: found")
    table = clamped({"EI3": 1.0}, [0, 1], springs={"k": {"node": "A", "stiffness": 1e-300}})
    table["nodes"]["A"]["support"] = "hinge"
    assert message(table).startswith("springs.k.stiffness: nothing resists its turn at node 'A': found")


@pytest.mark.parametrize("unit", [1e-300, 1e-100, 1e100, 1e300])
def test_small_and_large_units_alone_are_no_fault(unit):
    place = sfetcas.solve(made(clamped({"EI3": unit}, [0, unit]))).last.position("B")
    usual = sfetcas.solve(made(clamped({"EI3": 1.0}, [0, 1.0]))).last.position("B")
    # The same numbers but for the rounding of the unit.
    np.testing.assert_allclose(place, usual, atol=1e-13)


def test_an_angle_of_which_rounding_leaves_nothing_is_no_answer():
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"node": "A", "stiffness": 1e-12}},
        "loads": {"f": moment(1.0)},
    }
    with pytest.raises(SolveError, match=r"turns by 1\.0e\+12 rad, of which rounding leaves no angle"):
        sfetcas.solve(made(table))


def test_straight_member_between_clamps_is_refused_on_the_third_finer_mesh(monkeypatch):
    """It cannot bend: only coarse meshes have states under its weight, wound up, and each mesh others."""
    from sfetcas.equilibria.refinement import Refinement

    meshes = []
    onto = Refinement.onto
    monkeypatch.setattr(Refinement, "onto", lambda self, mesh, *rest: (meshes.append(mesh), onto(self, mesh, *rest))[1])
    scene = {
        "gravity": [0, -9.80665],
        "sections": {"s": {"shape": "circle", "radius": 0.01, "E": 1e4, "nu": 0.5, "rho": 636.62}},
        "nodes": {"a": {"position": [0, 0], "support": "clamped"}, "b": {"position": [1, 0], "support": "clamped"}},
        "members": {"m": {"nodes": ["a", "b"], "section": "s"}},
    }
    with pytest.raises(SolveError, match="fully stretched between held points"):
        sfetcas.solve(made(scene))
    assert len(meshes) < 20


def test_moment_that_drives_a_loop_on_and_on_is_given_up_soon(monkeypatch):
    """Hinges let the bar turn over and over, and nothing balances the moment: falls without end are not repeated."""
    from sfetcas.solvers.prepared import Prepared

    falls = []
    minimise = Prepared.minimise
    monkeypatch.setattr(Prepared, "minimise", lambda self, *rest: (falls.append(1), minimise(self, *rest))[1])
    scene = {
        "sections": {"soft": {"EI3": 0.242878}, "stiff": {"EI3": 1.869864}},
        "nodes": {
            "n0": {"position": [0.891992, -0.903388], "support": "hinge"},
            "n1": {"position": [0.734778, 1.035308], "joint": "hinge"},
            "n2": {"position": [-0.775804, 1.004932], "joint": "hinge"},
            "n3": {"position": [-1.205392, -0.398485], "support": "slider", "direction": [-0.326816, -0.945088]},
        },
        "members": {
            "m0": {"nodes": ["n0", "n1"], "section": "stiff"},
            "m1": {"nodes": ["n1", "n2"], "section": "soft"},
            "m2": {"nodes": ["n2", "n3"], "section": "stiff", "shape": {"type": "arc", "angle": 0.669984}},
            "m3": {"nodes": ["n3", "n0"], "section": "stiff", "shape": {"type": "arc", "angle": -0.263692}},
        },
        "loads": {"l": {"type": "moment", "member": "m1", "at": 0.75, "value": -11.037107}},
    }
    with pytest.raises(SolveError, match="used up its iterations"):
        sfetcas.solve(made(scene))
    assert len(falls) < 10


@pytest.mark.parametrize(("angle", "space"), [(0.3, False), (0.3, True), (-2.0, True)])
def test_a_clamp_that_cannot_turn_is_named_however_the_solver_ends(angle, space):
    """A bar straight between clamps at its own length has no other shape; in space IPOPT never noticed by itself."""
    table = {
        "sections": {"s": {"EI2": 2.0, "EI3": 1.0, "GJ": 1.5}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0.2, 0.1 if space else 0], "support": "clamped"},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "motions": {"turned": {"node": "A", "rotation": [0, 0, angle] if space else angle}},
    }
    with pytest.raises(SolveError, match=r"motions\.turned asks for more than there is") as info:
        solve(made(table))
    assert info.value.status is Status.INFEASIBLE


def test_numbers_that_are_too_far_apart_for_matrices_end_in_a_sentence():
    scene = sfetcas.load(Path(__file__).parent.parent / "problems" / "tendon_parallel.toml")
    (name,) = scene.tendons
    words = "numbers of the scene are too far apart for matrices in double precision"
    with np.errstate(all="ignore"), pytest.raises(SolveError, match=words):
        sfetcas.solve(scene.replace({f"tendons.{name}.way": [{"member": next(iter(scene.members)), "offset": 1e300}]}))
