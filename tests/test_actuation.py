"""Natural curvature and twist, magnetised members and dipoles, against closed forms and integration of their own."""

import re

import numpy as np
import pytest
from motions import FLAT, THICK, Flight
from scenes import cantilever
from scipy.integrate import solve_bvp
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError, Settings
from sfetcas.mathematics import quaternion
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.solvers.globalised import Code

STIFF = {"EI2": 3.0, "EI3": 2.0, "GJ": 1.5, "rhoA": 0.7}
BOTH = pytest.mark.parametrize("dimension", ["plane", "space"])
SHARP = 1e-9


def strip(**more):
    """A clamped strip of one metre without loads."""
    found = {**cantilever(), "sections": {"s": STIFF}, **more}
    return Scene.from_dict(
        {"loads": {}} | {key: part for key, part in found.items() if key != "loads"} | more_loads(more)
    )


def more_loads(more):
    return {"loads": more.get("loads", {})}


def actuated(value, *, dimension="plane", more=None, **keys):
    return strip(dimension=dimension, actuations={"k": {"member": "m", "value": value, **keys}}, **(more or {}))


def magnetised(value, density=(4.0, 0.0, 0.0), **more):
    """A strip whose magnetisation is along it, in a uniform field."""
    magnets = {"core": {"member": "m", "moment_density": list(density)}}
    return strip(fields={"B": {"value": list(value)}}, magnets=magnets, **more)


def screwed(natural, length=1.0):
    """Position and rotation vector at the end of a rod along x that is bent and twisted alike all along it."""
    w = np.array(natural)
    size, across = np.linalg.norm(w), quaternion.cross_matrix(w)
    turn = size * length
    mean = np.eye(3) * length + (1 - np.cos(turn)) / size**2 * across
    mean = mean + (turn - np.sin(turn)) / size**3 * across @ across
    return mean[:, 0], w * length


# -- natural curvature ----------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
def test_strip_closes_to_a_circle_and_stores_nothing(dimension, solver):
    scene = actuated([0, 0, 2 * np.pi], dimension=dimension)
    found = sfetcas.solve(scene, accuracy=SHARP, solver=solver).last
    np.testing.assert_allclose(found.position("B"), 0.0, atol=SHARP)
    # Energy in units of EI/L, of which the parts are 4 pi^2.
    assert found.energy["elastic"] == pytest.approx(0.0, abs=1e-11)
    assert found.energy["loads"] == pytest.approx(0.0, abs=1e-11)
    assert found.table("members", "m")["energy"] == pytest.approx(0.0, abs=1e-11)
    fields = found.along("m", np.linspace(0, 1, 5))
    np.testing.assert_allclose(fields["curvature"][:, 2], 2 * np.pi, rtol=1e-9)
    np.testing.assert_allclose(fields["moment"], 0.0, atol=1e-9)


@BOTH
def test_strip_held_at_both_ends_stays_straight_and_carries_the_whole_moment(dimension):
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}}
    found = sfetcas.solve(actuated([0, 0, 1.2], dimension=dimension, more={"nodes": nodes})).last
    fields = found.along("m", np.linspace(0, 1, 7))
    np.testing.assert_allclose(fields["moment"][:, 2], -2.0 * 1.2, rtol=1e-12)
    np.testing.assert_allclose(fields["position"][:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(fields["curvature"], 0.0, atol=1e-11)
    assert found.reaction("A")[1][2] == pytest.approx(2.4)
    assert found.energy["elastic"] == pytest.approx(0.5 * 2.0 * 1.2**2)
    assert found.table("members", "m")["energy"] == pytest.approx(0.5 * 2.0 * 1.2**2)


@pytest.mark.parametrize("natural", [[4.0, 0.0, 9.0], [-3.0, 5.0, 2.0]])
def test_constant_curvature_and_twist_make_a_helix(natural):
    found = sfetcas.solve(actuated(natural, dimension="space"), accuracy=SHARP).last
    position, turn = screwed(natural)
    np.testing.assert_allclose(found.position("B"), position, atol=SHARP)
    wanted = quaternion.from_rotation_vector(turn)
    assert abs(found.quaternion("B") @ wanted) == pytest.approx(1.0, abs=1e-12)
    assert found.energy["elastic"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("dimension", "natural", "force"),
    [("plane", [0, 0, 2.2], [3.0, -4.0, 0]), ("space", [1.5, -0.8, 2.0], [1.0, -2.0, 3.0])],
)
def test_actuated_strip_is_one_that_was_made_so(dimension, natural, force):
    """The same curvature by actuation and by the shape of the member: the same place, forces and energy."""
    loads = {"tip": {"type": "force", "node": "B", "value": force}}
    one = sfetcas.solve(actuated(natural, dimension=dimension, more={"loads": loads}), accuracy=SHARP).last
    keys = dict(zip(("twist", "kappa2", "kappa3"), ([entry] for entry in natural), strict=True))
    shape = {"type": "curvature", "length": 1.0, "start": [1, 0, 0], **keys}
    place, _ = screwed(natural)
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": place.tolist()}}
    members = {"m": {"nodes": ["A", "B"], "section": "s", "shape": shape}}
    bent = strip(dimension=dimension, nodes=nodes, members=members, loads=loads)
    other = sfetcas.solve(bent, accuracy=SHARP).last
    x = np.array([0.0, 0.23, 0.5, 1.0])
    for key in ("position", "moment", "force", "curvature"):
        np.testing.assert_allclose(one.along("m", x)[key], other.along("m", x)[key], atol=2e-8)
    assert one.energy["elastic"] == pytest.approx(other.energy["elastic"], rel=1e-8)
    np.testing.assert_allclose(np.hstack(one.reaction("A")), np.hstack(other.reaction("A")), atol=1e-8)


def test_part_of_a_member_and_a_profile():
    """A free strip turns by the integral of its natural curvature, also where several actuations meet."""
    profile = {"at": [0, 0.5, 1], "value": [1, 2, 0]}
    table = {
        "one": {"member": "m", "value": 1.1, "from": 0.25, "to": 0.75, "profile": profile},
        "two": {"member": "m", "value": [0, 0, -0.4], "profile": {"polynomial": [0, 0, 3]}},
    }
    found = sfetcas.solve(strip(actuations=table), accuracy=SHARP).last
    assert found.angle("B") == pytest.approx(1.1 * (0.25 * (1.5 + 2) / 2 + 0.25 * (2 + 1) / 2) - 0.4, abs=1e-10)
    # On both sides of where the first begins.
    curvature = found.along("m", [0.2, 0.3])["curvature"][:, 2]
    np.testing.assert_allclose(curvature, [-0.4 * 3 * 0.04, 1.1 * 1.6 - 0.4 * 3 * 0.09], rtol=1e-9)


def test_stress_is_that_of_what_is_not_natural():
    shape = {"shape": "rectangle", "width": 0.02, "height": 0.004, "E": 1e9, "rho": 1000.0}
    free = sfetcas.solve(actuated(3.0, more={"sections": {"s": shape}})).last
    # Against E h/2 k, what bending by as much strains.
    assert abs(free.along("m", 0.5)["bending_stress"][0]) < 1e-6 * 1e9 * 0.002 * 3.0
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}}
    held = sfetcas.solve(actuated(0.3, more={"sections": {"s": shape}, "nodes": nodes})).last
    assert held.along("m", 0.5)["bending_stress"][0] == pytest.approx(1e9 * 0.002 * 0.3)


def test_histories_and_factors():
    """Each actuation by its own history: half of one, and the factor times the other."""
    table = {"a": {"member": "m", "value": 1.0, "history": "h"}, "b": {"member": "m", "value": 0.3}}
    history = {"h": {"t": [0, 4], "value": [0, 2]}}
    scene = strip(actuations=table, histories=history, analysis={"steps": [1, 2]})
    steps = sfetcas.solve(scene).steps
    assert [step.angle("B") for step in steps] == pytest.approx([0.5 + 0.3, 1.0 + 0.6], abs=1e-9)


FLOOR = {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "m"}}


def test_strip_that_curls_into_the_floor_is_pressed_there_by_its_end():
    """Small curvature k: the force at the end is 3/2 EI k / L, as the deflection there is zero."""
    found = sfetcas.solve(actuated(-0.05, more={"contacts": FLOOR}), accuracy=1e-8).last
    assert found.contacts["floor"]["at"] == 1.0
    # Of what is small the square is left out.
    assert found.contacts["floor"]["force"][1] == pytest.approx(1.5 * 2.0 * 0.05, rel=1e-4)


@BOTH
def test_heavy_strip_that_curls_off_the_floor_lies_as_one_that_was_made_so(dimension):
    more = {"contacts": FLOOR, "gravity": [0, -9.81]}
    one = sfetcas.solve(actuated(0.8, dimension=dimension, more=more), accuracy=1e-6).last
    place, _ = screwed([0, 0, 0.8])
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": place.tolist()}}
    shape = {"type": "curvature", "length": 1.0, "start": [1, 0, 0], "kappa3": [0.8]}
    members = {"m": {"nodes": ["A", "B"], "section": "s", "shape": shape}}
    made = strip(nodes=nodes, members=members, dimension=dimension, **more)
    other = sfetcas.solve(made, accuracy=1e-6).last
    assert one.contacts["floor"]["at"][1] > 0.2
    np.testing.assert_allclose(one.contacts["floor"]["at"], other.contacts["floor"]["at"], atol=1e-5)
    x = np.array([0.0, 0.1, 0.5, 0.9])
    for key in ("position", "moment", "force", "curvature"):
        np.testing.assert_allclose(one.along("m", x)[key], other.along("m", x)[key], atol=1e-5)


# -- magnets in uniform fields --------------------------------------------------------------------

ELASTICA = {1: (0.94356676, 0.30172077), 5: (0.61237164, 0.71379152), 10: (0.44500440, 0.81060902)}
"""Places of the end by m B L^2 / EI, Wang et al. 2020."""


@BOTH
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
@pytest.mark.parametrize("strength", [1, 5, 10])
def test_strip_across_a_field_is_the_elastica(strength, solver, dimension):
    scene = magnetised([0, 0.5 * strength], dimension=dimension)
    found = sfetcas.solve(scene, accuracy=SHARP, solver=solver).last
    # Printed with eight digits.
    np.testing.assert_allclose(found.position("B")[:2], ELASTICA[strength], atol=6e-9)
    force = sfetcas.solve(strip(dimension=dimension, loads={"f": tip(2.0 * strength)}), accuracy=SHARP).last
    np.testing.assert_allclose(found.position("B"), force.position("B"), atol=2e-9)
    # The couples along it are what the force would carry: the same moment everywhere.
    x = np.array([0.0, 0.11, 0.5, 0.83, 1.0])
    np.testing.assert_allclose(found.along("m", x)["moment"], force.along("m", x)["moment"], atol=1e-8 * strength)
    np.testing.assert_allclose(found.along("m", x)["curvature"], force.along("m", x)["curvature"], atol=1e-8 * strength)
    assert np.abs(found.along("m", x)["force"]).max() < 1e-9
    told = found.magnet("core")
    assert told["torque"][2] == pytest.approx(-found.reaction("A")[1][2], rel=1e-9)
    assert told["energy"] == pytest.approx(found.energy["loads"], rel=1e-9)
    assert found.certificate.stable


def tip(force):
    return {"type": "force", "node": "B", "value": [0, force]}


@BOTH
def test_buckling_against_the_field(dimension):
    """A strip whose end points into the field leaves its straight line at m B L^2 / EI = pi^2 / 4."""
    more = {"analysis": {"type": "path", "range": [0, 4.0]}, "dimension": dimension}
    path = sfetcas.solve(magnetised([-0.5, 0.0], **more), accuracy=SHARP)
    assert path.bifurcations[0].factor == pytest.approx(np.pi**2 / 4, rel=1e-8)


def test_members_and_dipoles_and_rigid_ones_turn_alike():
    """A rigid bar on a spring in a field across it: magnetised along it, or with a dipole at its end."""

    def bar(magnet):
        return Scene.from_dict(
            {
                "sections": {"s": {"EI3": 1.0}},
                "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [2, 0]}},
                "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
                "springs": {"k": {"node": "A", "stiffness": 1.7}},
                "fields": {"B": {"value": [0, 0.5]}},
                "magnets": {"magnet": magnet},
            }
        )

    along, at = ({"member": "m", "moment_density": [2.3, 0]}, {"node": "B", "moment": [4.6, 0]})
    angles = [sfetcas.solve(bar(magnet), accuracy=1e-10).last for magnet in (along, at)]
    for found in angles:
        angle = found.angle("B")
        assert 1.7 * angle == pytest.approx(2.3 * np.cos(angle), rel=1e-10)
        assert found.magnet("magnet")["torque"][2] == pytest.approx(1.7 * angle, rel=1e-10)
        assert found.along("m", 1.0)["moment"][0, 2] == pytest.approx(
            0.0 if found is angles[0] else 1.7 * angle, abs=1e-9
        )


def test_modes_against_buckling():
    """The factor at which a linear estimate says that a straight magnetised strip buckles is the exact one."""
    analysis = {"type": "modes", "modes": 2}
    modes = sfetcas.solve(magnetised([-0.5, 0.0], analysis=analysis), accuracy=1e-8)
    assert modes.buckling[0] == pytest.approx(np.pi**2 / 4, rel=1e-6)
    rest = sfetcas.solve(strip(analysis=analysis), accuracy=1e-8)
    held = sfetcas.solve(magnetised([0.5, 0.0], analysis=analysis), accuracy=1e-8)
    # Against the field the strip is softer, with it stiffer.
    assert modes.omega[0] < rest.omega[0] < held.omega[0]


# -- fields that change with the place ------------------------------------------------------------

LINEAR = {
    "type": "linear",
    "value": [0.1, 0.4],
    "position": [0.3, 0.2],
    "gradient": [[0.4, -0.7, 0], [-0.7, 0.2, 0], [0, 0, -0.6]],
}
POLE = {"type": "dipole", "position": [1.1, 0.8], "moment": [2e5, -3e5]}


def pushed(field, **more):
    magnets = {"core": {"member": "m", "moment_density": [2.0, 0.7, 0]}, "end": {"node": "B", "moment": [0.3, -0.2, 0]}}
    return strip(fields={"B": field}, magnets=magnets, **more)


def integrated(field, density=(2.0, 0.7), end=(0.3, -0.2), ei=2.0):
    """Tip by collocation: x' = cos, y' = sin, EI angle' = M, M' = -t x N - couple, N' = -force."""

    def moments(angle, vector):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])

    def of(places):
        return field.of(np.column_stack([*places, np.zeros(places.shape[1])]))[:, :2].T

    def pull(places, m):
        step, slopes = 1e-5, []
        for axis in range(2):
            shift = np.zeros((2, 1))
            shift[axis] = step
            slopes.append(((of(places + shift) - of(places - shift)) / (2 * step) * m).sum(axis=0))
        return np.array(slopes)

    def rate(s, z):
        x, y, angle, bend, n1, n2 = z
        m, b = moments(angle, density), of(np.array([x, y]))
        force, couple = pull(np.array([x, y]), m), m[0] * b[1] - m[1] * b[0]
        c, s_ = np.cos(angle), np.sin(angle)
        return np.array([c, s_, bend / ei, -(c * n2 - s_ * n1) - couple, -force[0], -force[1]])

    def ends(a, b):
        place, m = b[:2].reshape(2, 1), moments(b[2], end).reshape(2, 1)
        force, here = pull(place, m)[:, 0], of(place)[:, 0]
        couple = float(m[0, 0] * here[1] - m[1, 0] * here[0])
        return np.array([a[0], a[1], a[2], b[3] - couple, b[4] - force[0], b[5] - force[1]])

    s = np.linspace(0, 1, 41)
    found = solve_bvp(rate, ends, s, np.array([s, 0 * s, 0 * s, 0 * s, 0 * s, 0 * s]), tol=1e-10, max_nodes=100000)
    assert found.success
    return found.sol


@pytest.mark.parametrize("field", [LINEAR, POLE], ids=["linear", "dipole"])
def test_forces_and_couples_of_gradients_against_collocation(field):
    scene = pushed(field)
    found, wanted = sfetcas.solve(scene, accuracy=SHARP).last, integrated(scene.fields["B"])
    np.testing.assert_allclose(found.position("B")[:2], wanted(1.0)[:2], atol=2e-8)
    x = np.array([0.0, 0.31, 0.7, 1.0])
    fields = found.along("m", x)
    # Differences of the field limit what is known of the forces there.
    np.testing.assert_allclose(fields["moment"][:, 2], wanted(x)[3], atol=1e-7)
    np.testing.assert_allclose(fields["force"][:, :2].T, wanted(x)[4:], atol=1e-7)


@BOTH
@pytest.mark.parametrize("field", [LINEAR, POLE], ids=["linear", "dipole"])
@pytest.mark.parametrize("elements", [1, 3])
def test_forces_of_gradients_are_in_balance_with_reactions(field, elements, dimension):
    """On any mesh: what the fields do to the magnets, the ground does back; the moment about the origin, too."""
    found = sfetcas.solve(pushed(field, dimension=dimension), Settings(element="SFET3", elements=elements)).last
    force, moment = found.reaction("A")
    told = [found.magnet(name) for name in ("core", "end")]
    np.testing.assert_allclose(force + sum(one["force"] for one in told), 0.0, atol=1e-10)
    # Section forces and moments are integrated from the clamped end; at the other one they are what the dipole takes.
    last = found.along("m", 1.0)
    np.testing.assert_allclose(last["force"][0], told[1]["force"], atol=1e-10)
    np.testing.assert_allclose(last["moment"][0], told[1]["torque"], atol=1e-10)
    assert np.abs(moment).max() > 0.1


@BOTH
def test_rigid_arcs_are_pulled_as_all_of_them(dimension):
    """A bent rigid magnet on a strip in two fields: forces, and the moment that its free end must not have."""
    table = {
        "dimension": dimension,
        "sections": {"s": {**STIFF, "rhoI": [0.02, 0.01, 0.01]}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "H": {"position": [0.5, 0]},
            "B": {"position": [1.5, 0]},
        },
        "members": {
            "strip": {"nodes": ["A", "H"], "section": "s"},
            "m": {"nodes": ["H", "B"], "section": "s", "type": "rigid", "shape": {"type": "arc", "angle": 1.8}},
        },
        "fields": {"B": LINEAR, "pole": POLE},
        "magnets": {"core": {"member": "m", "moment_density": [1.0, 0.5]}},
    }
    found = sfetcas.solve(Scene.from_dict(table), accuracy=1e-8).last
    assert len(found.model.mesh.cuts["m"]) > 3
    told = found.magnet("core")
    assert np.linalg.norm(told["force"]) > 0.3
    np.testing.assert_allclose(found.reaction("A")[0] + told["force"], 0.0, atol=1e-12)
    last = found.along("m", 1.0)
    np.testing.assert_allclose([last["moment"][0], last["force"][0]], 0.0, atol=1e-11)
    joined = found.along("strip", 1.0)["moment"] - found.along("m", 0.0)["moment"]
    np.testing.assert_allclose(joined, 0.0, atol=1e-11)
    still = {"type": "dynamic", "end": 0.05, "initial": "equilibrium", "accuracy": 1e-3, "output": 0.05}
    moving = sfetcas.solve(Scene.from_dict({**table, "analysis": still})).steps[-1]
    np.testing.assert_allclose(moving.reaction("A"), found.reaction("A"), atol=1e-4)


def test_places_of_prescribed_motions_matter_on_paths():
    """A dipole that a motion carries along a gradient, against single solutions."""
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}}
    push = {"push": {"node": "B", "displacement": [-0.1, 0.05]}}
    scene = pushed(LINEAR, nodes=nodes, motions=push, analysis={"type": "path", "range": [0, 1.0], "steps": [1.0]})
    path = sfetcas.solve(scene, accuracy=1e-8)
    single = sfetcas.solve(scene.replace({"analysis": {"steps": [1.0]}}), accuracy=1e-8)
    np.testing.assert_allclose(
        path.steps[-1].along("m", 0.4)["position"], single.last.along("m", 0.4)["position"], atol=1e-6
    )


def sloping(x):
    """The field :data:`LINEAR`."""
    apart = [x[0] - 0.3, x[1] - 0.2]
    return [0.1 + 0.4 * apart[0] - 0.7 * apart[1], 0.4 - 0.7 * apart[0] + 0.2 * apart[1], -0.6 * x[2]]


@BOTH
def test_field_as_a_function_of_the_place(dimension, tmp_path):
    """The same field by its numbers and as a function, in answers, parameters, and the exported program."""
    scene = pushed({"type": "function", "function": sloping}, dimension=dimension)
    one, other = (sfetcas.solve(each, accuracy=SHARP).last for each in (scene, pushed(LINEAR, dimension=dimension)))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-9)
    for key in ("energy", "torque", "force"):
        np.testing.assert_allclose(one.magnet("core")[key], other.magnet("core")[key], atol=1e-8)
    family = sfetcas.parametric(scene, ["factor", "magnets.end.moment"], ["nodes.B.position"])
    # To the accuracy that both ask for by default.
    np.testing.assert_allclose(family.solve()["nodes.B.position"], other.position("B"), atol=1e-3)
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=["factor"], results=["nodes.B.position"])
    np.testing.assert_allclose(solver.solve()[1], family.solve()["nodes.B.position"], atol=1e-6)


def test_fields_that_are_functions_are_told_wrong_ones():
    for function, sentence in (
        (lambda x: x[:2], "fields.B.function: found 2 components, accepted"),
        (lambda x: [np.linalg.inv(x), 0, 0], "fields.B.function: found a function that fails"),
        ("sloping", "fields.B.function: found 'sloping', accepted: a Python function"),
    ):
        with pytest.raises(SceneError, match=re.escape(sentence)):
            pushed({"type": "function", "function": function})
    with pytest.raises(SceneError, match=r"fields\.B\.function: found a Python function, which no file holds"):
        sfetcas.dump(pushed({"type": "function", "function": sloping}), "scene.toml")
    with pytest.raises(SceneError, match="found a field whose function takes numbers only"):
        sfetcas.solve(pushed({"type": "function", "function": lambda x: [float(x[0]), 0, 0]}))
    # What leaves the plane makes the scene one in space.
    leaving = pushed({"type": "function", "function": lambda x: [0.1, 0.2, 0.3 * x[0]]})
    assert leaving.resolved_dimension == "space"


def test_path_of_natural_curvature():
    """The chord of an arc has half the angle of its end."""
    path = sfetcas.solve(actuated(3.0, more={"analysis": {"type": "path", "range": [0, 1.0]}}))
    places = path.positions("B")
    assert len(places) > 3
    for factor, place in zip(path.main.factors, places, strict=True):
        assert np.arctan2(place[1], place[0]) == pytest.approx(1.5 * factor, abs=1e-5)


def test_uniform_field_as_one_without_gradient():
    flat = {"type": "linear", "value": [0.2, 0.4], "gradient": np.zeros((3, 3)).tolist()}
    one, other = (sfetcas.solve(pushed(field), accuracy=SHARP).last for field in (flat, {"value": [0.2, 0.4]}))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-9)
    x = np.array([0.0, 0.4, 1.0])
    np.testing.assert_allclose(one.along("m", x)["moment"], other.along("m", x)["moment"], atol=1e-8)


# -- derivatives by loads and parameters ----------------------------------------------------------


@pytest.mark.parametrize("space", [False, True])
def test_derivative_of_the_residual_by_the_factor(space):
    """What arc lengths take, against differences; energies are quadratic in natural curvature, residuals linear."""
    scene = actuated(
        [0.4, 0.3, 1.2] if space else 1.2,
        dimension="space" if space else "plane",
        more={
            "fields": {"B": {"value": [0.2, 0.5]}},
            "magnets": {"core": {"member": "m", "moment_density": [2, 1, 0]}, "end": {"node": "B", "moment": [1, 0.5]}},
            "loads": {"f": tip(0.7)},
        },
    )
    model = assemble(scene, uniform_mesh(scene, 3, 2))
    equations, loading = Equations(model), model.loading(1.0)
    rng = np.random.default_rng(0)
    state = equations.moved(equations.start(loading), 0.3 * rng.standard_normal(equations.total))
    assert loading.nodal
    low, high = (equations.at(state, model.loading(factor)).residual for factor in (0.9, 1.1))
    slope = equations.slope(state, equations.at(state, loading), model.groups[None])
    np.testing.assert_allclose(slope, (high - low) / 0.2, atol=1e-12)


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("field", [{"value": [0.2, 0.5]}, LINEAR, POLE], ids=["uniform", "linear", "dipole"])
def test_residual_is_the_derivative_of_the_potential(field, space):
    scene = actuated(
        [0.4, 0.3, 1.2] if space else 1.2,
        dimension="space" if space else "plane",
        more={
            "fields": {"B": field},
            "magnets": {"core": {"member": "m", "moment_density": [2, 1, 0]}, "end": {"node": "B", "moment": [1, 0.5]}},
        },
    )
    model = assemble(scene, uniform_mesh(scene, 2, 2), assembly="nodal")
    equations, loading = Equations(model), model.loading(1.3)
    n, rng = equations.unknowns, np.random.default_rng(1)
    step = np.zeros(equations.total)
    step[:n] = 0.2 * rng.standard_normal(n)
    state = equations.moved(equations.start(loading), step)
    point, h = equations.at(state, loading), 1e-5
    for way in rng.standard_normal((4, n)):
        along = np.zeros(equations.total)
        along[:n] = way
        ends = [equations.at(equations.moved(state, sign * h * along), loading) for sign in (1, -1)]
        slope = (ends[0].potential - ends[1].potential) / (2 * h)
        # Central differences.
        assert float(point.residual[:n] @ way) == pytest.approx(slope, abs=1e-7 * max(1.0, abs(slope)))


def test_parameters():
    scene = actuated(
        1.3,
        more={
            "fields": {"B": {"value": [0.1, 0.4]}},
            "magnets": {"core": {"member": "m", "moment_density": [2.0, 0.3]}},
        },
    )
    names = ["actuations.k.value", "fields.B.value", "magnets.core.moment_density", "sections.s.EI3"]
    family = sfetcas.parametric(scene, names, ["nodes.B.position", "magnets.core.torque", "energy.elastic"])
    answer = family.solve()
    h = 1e-4
    numbers = {
        "actuations.k.value": 1.3,
        "fields.B.value": [0.1, 0.4],
        "magnets.core.moment_density": [2.0, 0.3],
        "sections.s.EI3": 2.0,
    }
    for name, value in numbers.items():
        for i in range(np.size(value)):
            ends = []
            for sign in (1, -1):
                moved = np.atleast_1d(np.array(value, dtype=float))
                moved[i] += sign * h
                ends.append(family.solve({name: moved if np.size(value) > 1 else moved.item()}))
            for result in ("nodes.B.position", "magnets.core.torque", "energy.elastic"):
                slope = (np.asarray(ends[0][result]) - np.asarray(ends[1][result])) / (2 * h)
                found = np.asarray(answer.jacobian[result][name]).reshape(np.size(slope), -1)[:, i]
                np.testing.assert_allclose(found, np.ravel(slope), atol=1e-6)


def test_design_finds_field_and_curvature():
    """The field that brings the end where it is for 5, and the natural curvature that turns it by one radian."""
    target = sfetcas.solve(magnetised([0, 2.5]), accuracy=1e-8).last.position("B")
    found = sfetcas.find(
        magnetised([0, 1.0]), {"fields.B.value.1": (0.1, 6.0)}, {"nodes.B.position.y": float(target[1])}
    )
    assert found.values["fields.B.value.1"] == pytest.approx(2.5, rel=1e-4)
    found = sfetcas.find(actuated(0.2), ["actuations.k.value"], {"nodes.B.angle": 1.0})
    assert found.values["actuations.k.value"] == pytest.approx(1.0, rel=1e-6)


@needs_compiler
@pytest.mark.parametrize("field", [{"value": [0.1, 0.4, 0.05]}, POLE], ids=["uniform", "dipole"])
def test_exported_code(field, tmp_path):
    more = {"fields": {"B": field}, "magnets": {"core": {"member": "m", "moment_density": [1.0, 0.3, 0.1]}}}
    scene = actuated([0.5, 0.2, 0.8], dimension="space", more=more)
    asked = ["actuations.k.value", "fields.B.value" if "value" in field else "fields.B.moment"]
    results = ["nodes.B.position", "magnets.core.torque", "members.m.moment at 0.4"]
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=asked, results=results)
    outcome, values = solver.solve()
    assert outcome.code is Code.SOLVED
    found = sfetcas.solve(scene).last
    wanted = [*found.position("B"), *found.magnet("core")["torque"], *found.along("m", 0.4)["moment"][0]]
    # Both meshes have the accuracy of the scene.
    np.testing.assert_allclose(values, wanted, atol=2e-3)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


# -- motion ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("section", [FLAT, THICK], ids=["plane", "space"])
@pytest.mark.parametrize("what", ["curvature", "member", "dipole"])
def test_energy_is_kept(section, what):
    natural = [1.0, 0.5, 2.0] if section is THICK else [0, 0, 2.0]
    tables = {
        "curvature": {"actuations": {"k": {"member": "m", "value": natural}}},
        "member": {"magnets": {"core": {"member": "m", "moment_density": [2.0, 0.5, 0]}}},
        "dipole": {"magnets": {"end": {"node": "B", "moment": [2.0, 0.5]}}},
    }[what]
    tables |= {"fields": {"B": {"value": [0.1, 0.8]}}} if "magnets" in tables else {}
    flight = Flight({**cantilever((0.0, 0.0)), "sections": {"s": section}, "loads": {}, **tables})
    # Rounding; what moves has energies of one.
    assert np.ptp([flight.energy(memory) for memory in flight.steps(0.005, 50)]) < 1e-11


def test_sudden_curvature_moves_a_strip_as_the_moment_at_its_end_does():
    """Both do the same work on it; what it stores is counted from another shape."""
    analysis = {"type": "dynamic", "end": 0.4, "accuracy": 1e-3, "output": 0.1}
    natural = sfetcas.solve(actuated(0.3, more={"analysis": analysis}))
    loads = {"end": {"type": "moment", "node": "B", "value": 2.0 * 0.3}}
    pushed_round = sfetcas.solve(strip(analysis=analysis, loads=loads))
    stored = 0.5 * 2.0 * 0.3**2
    assert natural.steps[0].energy["elastic"] == pytest.approx(stored, rel=1e-9)
    for one, other in zip(natural.steps, pushed_round.steps, strict=True):
        np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-9)
        assert one.energy["total"] == pytest.approx(other.energy["total"] + stored, abs=1e-9)
        # Inside the end, where one has no moment and the other all of it.
        moments = [state.along("m", 0.6)["moment"][0, 2] for state in (one, other)]
        assert moments[0] == pytest.approx(moments[1] - 2.0 * 0.3, abs=1e-6)
    assert natural.steps[-1].energy["kinetic"] > 1e-3


@pytest.mark.parametrize("field", [{"value": [0.1, 0.7]}, LINEAR], ids=["uniform", "linear"])
def test_what_begins_in_balance_stays_there(field):
    """Motions tell the same as statics, of section moments with couples along the member, and of magnets."""
    analysis = {"type": "dynamic", "end": 0.1, "accuracy": 1e-3, "output": 0.05, "initial": "equilibrium"}
    tables = {"actuations": {"k": {"member": "m", "value": 0.4}}}
    moving = sfetcas.solve(pushed(field, analysis=analysis, **tables)).steps[-1]
    still = sfetcas.solve(pushed(field, **tables), accuracy=1e-6).last
    np.testing.assert_allclose(moving.position("B"), still.position("B"), atol=1e-4)
    x = np.array([0.0, 0.3, 0.8, 1.0])
    for key in ("moment", "force", "curvature"):
        np.testing.assert_allclose(moving.along("m", x)[key], still.along("m", x)[key], atol=2e-3)
    np.testing.assert_allclose(moving.reaction("A")[1], still.reaction("A")[1], atol=2e-3)
    for name in ("core", "end"):
        for key in ("energy", "torque", "force"):
            np.testing.assert_allclose(moving.magnet(name)[key], still.magnet(name)[key], atol=1e-3)


def needle():
    """A rigid bar on a hinge, magnetised along itself, in a field along it."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "fields": {"B": {"value": [0.3, 0]}},
            "magnets": {"core": {"member": "m", "moment_density": [2.0, 0]}},
        }
    )


def bending():
    """A strip of one element."""
    return actuated(0.0).replace({"members.m.element": "SFET3", "members.m.elements": 1})


@pytest.mark.parametrize(
    ("scene", "control"), [(needle, "fields.B.value.1"), (bending, "actuations.k.value")], ids=["field", "curvature"]
)
def test_optimal_control(scene, control):
    """What brings a needle, or a strip, to another angle; its history drives the same motion by other steps."""
    problem = sfetcas.OptimalControl(scene(), {control: (-9, 9)}, time=1.5, intervals=12)
    problem.minimise(problem.integral(problem.control(control) ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.angle")) == 0.3, name="turned")
    found = problem.solve(replay=False)
    assert found.answer("nodes.B.angle").ravel()[-1] == pytest.approx(0.3, abs=1e-6)
    # Controls are linear in each interval.
    history = sfetcas.History(t=found.ends, value=np.ravel(found.control(control)))
    driven = sfetcas.respond(scene(), {control: history}, 1.5, integrator="radau-3", accuracy=1e-3)
    # Twelve intervals of collocation with one element.
    assert driven.instants[-1].angle("B") == pytest.approx(0.3, abs=2e-2)


# -- what is refused ------------------------------------------------------------------------------


def natural(**keys):
    return {"actuations": {"k": {"member": "m", **keys}}}


def magnet(**keys):
    return {"magnets": {"c": keys}, "fields": {"B": {"value": [1, 0]}}}


def field(**keys):
    return {"fields": {"B": keys}}


ZERO = "found [0.0, 0.0, 0.0], accepted: a direction"
SADDLE = [[1, 0, 0], [0, -1, 0], [0, 0, 0]]
WELL = [[1, 0, 0], [0, 1, 0], [0, 0, 0]]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (natural(value=1.0, member="n"), "actuations.k.member: found 'n', accepted: m"),
        (natural(), "actuations.k: the key 'value' is missing"),
        (natural(value=1.0, history="h"), "actuations.k.history: found 'h', but the scene has no histories"),
        (natural(value=1.0, from_=0.5, to=0.2), "actuations.k.to: found 0.5 to 0.2, accepted: an end after"),
        (natural(value=1.0, begin=0.2), "actuations.k: unknown key 'begin'"),
        ({"magnets": {"c": {"member": "m", "moment_density": [1, 0]}}}, "magnets: found magnets without a field"),
        (field(value=[1, 0]), "fields: found a field without magnets"),
        (magnet(member="q", moment_density=[1, 0]), "magnets.c.member: found 'q', accepted: m"),
        (magnet(node="q", moment=[1, 0]), "magnets.c.node: found 'q', accepted: A, B"),
        (magnet(member="m", moment_density=[0, 0]), f"magnets.c.moment_density: {ZERO}"),
        (magnet(member="m", moment=[1, 0]), "magnets.c: the key 'moment_density' is missing: the magnet is along"),
        (magnet(node="B", moment=[1, 0], from_=0, to=0.5), "magnets.c.from: not accepted: the magnet is at a node"),
        (magnet(moment=[1, 0]), "magnets.c: neither member nor node is given"),
        (field(type="dipole", moment=[0, 0]), f"fields.B.moment: {ZERO}"),
        (
            {**magnet(node="B", moment=[1, 0]), **field(type="dipole", position=[1, 0], moment=[0, 1])},
            "fields.B.position: found a place on the magnet 'c', where the field has no bounds",
        ),
        (field(type="linear", value=[0, 1]), "fields.B: the key 'gradient' is missing"),
        (field(value=[0, 1], gradient=SADDLE), "fields.B.gradient: not accepted: the field is of type 'uniform'"),
        (field(type="linear", gradient=WELL), "fields.B.gradient: found [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]"),
        (field(), "fields.B: the key 'value' is missing"),
        (
            {"contacts": FLOOR, **magnet(member="m", moment_density=[1, 0])},
            "magnets.c.member: found 'm', which may touch",
        ),
        (
            {"contacts": FLOOR, **magnet(node="B", moment=[1, 0]), **field(type="linear", gradient=SADDLE)},
            "fields.B.type: found a field with a gradient and contacts",
        ),
        ({"dimension": "plane", **natural(value=[1, 0, 0])}, "actuations.k.value: dimension is set to 'plane'"),
    ],
)
def test_what_is_not_accepted(change, sentence):
    with pytest.raises(SceneError, match=re.escape(sentence)):
        strip(**change)


def test_rigid_members_have_no_natural_curvature_and_gauss_points_no_magnets():
    rigid = {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}}
    with pytest.raises(
        SceneError, match=r"actuations\.k\.member: found the rigid member 'm', accepted: a flexible one"
    ):
        actuated(1.0, more={"members": rigid})
    with pytest.raises(SceneError, match="magnetised members need integration at the nodes"):
        sfetcas.solve(magnetised([0, 1.0]), Settings(gauss=True))
    bent = sfetcas.solve(actuated(1.5), Settings(gauss=True), accuracy=SHARP).last
    assert bent.angle("B") == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize("name", ["actuations.k.from", "actuations.k.to"])
def test_where_an_actuation_begins_is_no_parameter(name):
    with pytest.raises(SceneError, match="changes the elements"):
        sfetcas.parametric(actuated(1.0, from_=0.2, to=0.6), [name], ["nodes.B.angle"])


@pytest.mark.parametrize("width", [0.01, 0.002])
def test_a_narrow_profile_is_not_lost(width):
    """A bump far narrower than the elements that its strip would have without it."""
    profile = f"exp(-((x-0.3337)/{width})**2)"
    bump = {"k": {"member": "m", "value": 0.3 / width, "profile": profile}}
    found = sfetcas.solve(Scene.from_dict({**cantilever((0.0, 0.0)), "loads": {}, "actuations": bump}), accuracy=1e-6)
    # The accuracy asked for, of an angle.
    assert found.last.angle("B") == pytest.approx(0.3 * np.sqrt(np.pi), abs=1e-5)


@pytest.mark.parametrize("at", [0.5, 0.3333, 0.123456])
def test_a_dipole_on_a_magnet_is_refused_wherever_it_is(at):
    scene = {**cantilever((0.0, 0.0)), "magnets": {"k": {"member": "m", "moment_density": [1, 0]}}}
    with pytest.raises(SceneError, match=r"fields\.u\.position: found a place on the magnet 'k'"):
        Scene.from_dict({**scene, "fields": {"u": {"type": "dipole", "position": [at, 0], "moment": [1, 0]}}})
