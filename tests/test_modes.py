"""Frequencies and shapes: against each other, moved and turned, by a full route, and by what shapes have to be."""

import json
from pathlib import Path

import numpy as np
import pytest

from sfetcas import Analysis, Arc, CrossSection, Load, Member, Node, Scene, SceneError, Spring, Status, load, solve
from sfetcas.cli import main
from sfetcas.description.scenefile import dump

PROBLEMS = Path(__file__).parent.parent / "problems"

STRIP = CrossSection(EI2=1.0, EI3=1.0, GJ=0.8, rhoA=1.0, rhoI=[0.02, 0.01, 0.015])


def analysis(modes=4, accuracy=1e-8):
    return Analysis(type="modes", modes=modes, accuracy=accuracy)


def cantilever(**changes):
    parts = {
        "sections": {"strip": STRIP},
        "nodes": {"A": Node(position=[0, 0], support="clamped"), "B": Node(position=[1, 0])},
        "members": {"beam": Member(nodes=["A", "B"], section="strip")},
        "analysis": analysis(),
    }
    return Scene(**(parts | changes))


def bent(**changes):
    load = {"tip": Load(type="force", node="B", value=[-4, 1])}
    return cantilever(loads=load, **changes)


def squares_in_full(modes):
    """Squares of the frequencies by the null space of the constraints and full matrices: no shift, no Krylov space."""
    parts = {name: part.full() for name, part in modes.matrices().parts.items()}
    rows = parts["constraint"]
    _, sizes, right = np.linalg.svd(rows)
    basis = right[int((sizes > 1e-10 * sizes.max()).sum()) :].T
    stiffness, mass = (basis.T @ parts[name] @ basis for name in ("stiffness", "mass"))
    # The inverse of what is stiff, so that what has no mass gives zeros.
    factor = np.linalg.cholesky(0.5 * (stiffness + stiffness.T))
    inverse = np.linalg.solve(factor, np.linalg.solve(factor, mass).T)
    return 1.0 / np.sort(np.linalg.eigvalsh(0.5 * (inverse + inverse.T)))[::-1]


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_sparse_and_full_routes_agree(dimension):
    modes = solve(bent(dimension=dimension, analysis=analysis(6)), element="SFET7", elements=3)
    # Rounding of a full matrix of condition 1e6.
    assert np.sqrt(squares_in_full(modes)[:6]) == pytest.approx(modes.omega, rel=1e-9)


def test_undeformed_scene_needs_neither_load_nor_support():
    modes = solve(cantilever(nodes={"A": Node(position=[0, 0]), "B": Node(position=[1, 0])}))
    assert modes.rigid == 3
    assert modes.last.certificate.stable == "neutral"


@pytest.mark.parametrize(("dimension", "rigid"), [("plane", 3), ("space", 6)])
def test_rigid_motions_of_a_free_arc(dimension, rigid):
    nodes = {"A": Node(position=[1, 0]), "B": Node(position=[0, 1])}
    arc = {"beam": Member(nodes=["A", "B"], section="strip", shape=Arc(angle=np.pi / 2))}
    assert solve(cantilever(dimension=dimension, nodes=nodes, members=arc)).rigid == rigid


def test_moved_and_turned_scene_has_the_same_frequencies():
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    here = solve(bent(dimension="space", analysis=analysis(6, 1e-9)))
    nodes = {"A": Node(position=[5, -3, 2], support="clamped"), "B": Node(position=turn[:, 0] + [5, -3, 2])}
    members = {"beam": Member(nodes=["A", "B"], section="strip", b2=turn[:, 1])}
    loads = {"tip": Load(type="force", node="B", value=turn @ [-4, 1, 0])}
    there = solve(cantilever(nodes=nodes, members=members, loads=loads, analysis=analysis(6, 1e-9)))
    # Twice the accuracy: each of the two is as far off.
    assert there.omega == pytest.approx(here.omega, rel=2e-9)


def test_space_has_the_frequencies_of_the_plane_and_others():
    plane, space = (solve(bent(dimension=d, analysis=analysis(n, 1e-9))) for d, n in (("plane", 3), ("space", 8)))
    for omega in plane.omega:
        # Twice the accuracy: each of the two is as far off.
        assert np.abs(space.omega / omega - 1.0).min() < 2e-9


def test_shapes_are_orthogonal_and_have_the_mass_they_say():
    motion = solve(bent(dimension="space", analysis=analysis(6))).motion
    shapes = motion.eigenmotions(6).shapes
    products = shapes.T @ motion.mass.full() @ shapes
    sizes = np.sqrt(np.diag(products))
    # Shapes are known to the root of what their frequencies are.
    assert products / np.outer(sizes, sizes) == pytest.approx(np.eye(6), abs=1e-7)


def test_shape_of_a_pendulum():
    members = {"beam": Member(nodes=["A", "B"], section="strip", type="rigid")}
    nodes = {"A": Node(position=[0, 0], support="hinge"), "B": Node(position=[0, -2])}
    modes = solve(cantilever(nodes=nodes, members=members, gravity=[0, -9.81], analysis=analysis(1)))
    # A rod of length 2 and mass 2: inertia 8/3 and 2 * 0.015 about its hinge, weight at its middle.
    inertia = 8.0 / 3.0 + 2.0 * 0.015
    assert modes.omega == pytest.approx([np.sqrt(2.0 * 9.81 / inertia)], rel=1e-12)
    mode = modes.modes[0]
    assert np.abs(mode.nodes["B"]["position"]) == pytest.approx([1, 0, 0], abs=1e-8)
    assert np.abs(mode.nodes["B"]["rotation"]) == pytest.approx([0, 0, 0.5], abs=1e-8)
    assert mode.mass == pytest.approx(inertia / 4.0, rel=1e-7)


def test_rigid_member_is_a_very_stiff_one():
    def scene(members):
        nodes = {"A": Node(position=[0, 0], support="clamped"), "M": Node(position=[1, 0]), "B": Node(position=[2, 0])}
        sections = {"strip": STRIP, "stiff": STRIP.model_copy(update={"EI3": 1e4})}
        return cantilever(sections=sections, nodes=nodes, members=members)

    first = {"one": Member(nodes=["A", "M"], section="strip")}
    rigid = solve(scene(first | {"two": Member(nodes=["M", "B"], section="stiff", type="rigid")}), accuracy=1e-6)
    stiff = solve(scene(first | {"two": Member(nodes=["M", "B"], section="stiff")}), accuracy=1e-6)
    # The softness is 1e-4, and the second shape bends the stiff member more.
    assert stiff.omega[:2] == pytest.approx(rigid.omega[:2], rel=1e-3)


def test_frequencies_converge_twice_as_fast_as_the_order():
    exact = 22.0344915646668
    thin = {"strip": CrossSection(EI3=1.0, rhoA=1.0)}
    errors = []
    for elements in (4, 8):
        modes = solve(cantilever(sections=thin, analysis=analysis(2)), element="SFET4", elements=elements)
        errors.append(abs(modes.omega[1] / exact - 1.0))
    # Order 3: 2^6 a halving, with half a power for not being there yet.
    assert errors[0] / errors[1] > 2.0**5.5


def test_damping_in_the_section_is_that_of_each_mode():
    section = {"strip": CrossSection(EI3=1.0, rhoA=1.0, damping=0.01)}
    modes = solve(cantilever(sections=section, analysis=analysis(4)))
    # Of a uniform beam without damping; moments are stiffness times strain and 0.01 s times its rate.
    omega = np.array([3.51601526850015, 22.0344915646668, 61.6972144135491, 120.901916052306])
    ratio = 0.005 * omega
    assert [mode.damping for mode in modes.modes] == pytest.approx(ratio, rel=2e-8)
    assert modes.omega == pytest.approx(omega * np.sqrt(1.0 - ratio**2), rel=2e-8)


def test_drag_slows_all_modes_alike():
    free = {"A": Node(position=[0, 0]), "B": Node(position=[1, 0])}
    section = {"strip": CrossSection(EI3=1.0, rhoA=1.0, drag=0.1)}
    modes = solve(cantilever(sections=section, nodes=free))
    assert modes.rigid == 3
    size = np.array([np.hypot(mode.omega, mode.omega * mode.damping) for mode in modes.modes])
    # Half the drag over the mass, by the whole exponent.
    damping = np.array([mode.damping for mode in modes.modes])
    exponent = damping * modes.omega / np.sqrt(1.0 - damping**2)
    assert exponent == pytest.approx(np.full(4, 0.05), rel=1e-6)
    assert size[0] == pytest.approx(22.3732854480613, rel=1e-4)


def test_unstable_equilibrium_says_at_which_rate_it_is_left():
    nodes = {"A": Node(position=[0, 0], support="hinge"), "B": Node(position=[0, 2])}
    members = {"beam": Member(nodes=["A", "B"], section="strip", type="rigid")}
    still = Analysis(type="modes", modes=1, unstable="stay")
    modes = solve(cantilever(nodes=nodes, members=members, gravity=[0, -9.81], analysis=still))
    assert modes.growing == pytest.approx([np.sqrt(2.0 * 9.81 / (8.0 / 3.0 + 0.03))], rel=1e-9)
    assert not modes.modes


def test_flutter_beyond_the_load_of_beck():
    below, beyond = (
        solve(
            cantilever(
                sections={"strip": CrossSection(EI3=1.0, rhoA=1.0)},
                loads={"tip": Load(type="force", node="B", value=[-force, 0], frame="follower")},
                analysis=analysis(2),
            )
        )
        for force in (20.05, 20.052)
    )
    assert not any(mode.damping for mode in below.modes)
    assert min(mode.damping for mode in beyond.modes) < 0.0
    assert beyond.omega == pytest.approx([11.0156, 11.0156], rel=1e-4)


def test_forces_in_turning_axes_balance_those_on_the_masses():
    nodes = {"A": Node(position=[0.3, 0, 0], support="clamped"), "B": Node(position=[1, 0.4, 0.5], mass=0.3)}
    still = Analysis(accuracy=1e-9)
    bare = {"strip": STRIP.model_copy(update={"rhoI": None})}
    scene = cantilever(dimension="space", sections=bare, nodes=nodes, rotating=[0, 0, 3.0], analysis=still)
    answer = solve(scene).last
    x, w = np.polynomial.legendre.leggauss(30)
    length = scene.center_lines["beam"].length
    places = answer.along("beam", 0.5 * (x + 1.0))["position"]
    points = np.vstack([places, answer.position("B")])
    forces = np.append(0.5 * w * length, 0.3)[:, None] * 9.0 * points * [1, 1, 0]
    force, moment = answer.reaction("A")
    # The accuracy asked for, times the size of the forces.
    assert force == pytest.approx(-forces.sum(axis=0), abs=1e-7)
    assert moment == pytest.approx(-np.cross(points - [0.3, 0, 0], forces).sum(axis=0), abs=1e-7)
    assert answer.certificate.stable is True


def test_turning_pendulum_swings_out():
    """A rigid rod on a hinge turns with the speed at which it stands at 60 degrees to its axle."""
    square = 3.0 * 9.81 / (2.0 * 1.0 * 0.5)
    nodes = {
        "A": Node(position=[0, 0, 0], support="hinge", axis=[0, 1, 0]),
        "B": Node(position=[np.sin(1.0), 0, -np.cos(1.0)]),
    }
    members = {"rod": Member(nodes=["A", "B"], section="rod", type="rigid")}
    rod = {"rod": CrossSection(rhoA=1.0)}
    scene = Scene(sections=rod, nodes=nodes, members=members, gravity=[0, 0, -9.81], rotating=[0, 0, np.sqrt(square)])
    tip = solve(scene).last.position("B")
    assert tip == pytest.approx([np.sqrt(0.75), 0, -0.5], abs=1e-9)
    modes = solve(scene.model_copy(update={"analysis": analysis(1)}))
    # Second derivative of the potential by the angle over the inertia: Omega^2 sin^2.
    assert modes.omega == pytest.approx([np.sqrt(square * 0.75)], rel=1e-9)


def test_matrices_are_read_back(tmp_path):
    scene = bent(springs={"k": Spring(type="translational", node="B", stiffness=2.0, damping=0.1)})
    modes = solve(scene)
    file = tmp_path / "scene.json"
    dump(scene, file)
    assert main(["run", str(file), "--matrices", str(tmp_path / "all.npz")]) == 0
    assert main(["run", str(file), "--matrices", str(tmp_path / "folder")]) == 0
    with np.load(tmp_path / "all.npz") as arrays:
        for name, part in modes.matrices().parts.items():
            full = np.zeros(arrays[f"{name}.shape"])
            full[arrays[f"{name}.row"], arrays[f"{name}.column"]] = arrays[f"{name}.value"]
            np.testing.assert_array_equal(full, part.full())
            lines = (tmp_path / "folder" / f"{name}.mtx").read_text().splitlines()
            assert lines[1].split() == [str(n) for n in (*part.shape, len(part.value))]
            row, column, value = lines[2].split() if len(lines) > 2 else ("1", "1", str(part.full()[0, 0]))
            assert float(value) == pytest.approx(part.full()[int(row) - 1, int(column) - 1], rel=1e-12)
        assert len(arrays["unknowns"]) == arrays["mass.shape"][0]
        assert "B.x" in arrays["unknowns"]
        assert "B about z" in arrays["unknowns"]


def test_json_answer(tmp_path, capsys):
    file, out = tmp_path / "scene.json", tmp_path / "out.json"
    dump(cantilever(), file)
    assert main(["run", str(file), "--json", str(out)]) == 0
    answer = json.loads(out.read_text())
    modes = answer["modes"]
    assert len(modes["omega"]) == len(modes["shapes"]) == 4
    assert modes["rigid"] == 0
    assert len(answer["steps"]) == 1
    beam = modes["shapes"][0]["members"]["beam"]
    assert len(beam["s"]) == len(beam["position"])
    assert "mode 1: 3.39899419" in capsys.readouterr().out


def test_gauss_points_carry_no_masses():
    with pytest.raises(SceneError, match="accepted: 'nodes' with modes"):
        solve(cantilever(), gauss=True)


EXACT = 1e-10
"""Accuracy of the frequencies that others are compared with."""


@pytest.mark.parametrize(
    "name",
    [
        "clamped_free",
        "pinned_pinned",
        "bent_cantilever_1",
        "helix",
        "tip_mass",
        "stepped",
        "over_prop",
        "turning_4",
        "quarter_ring_loaded",
        "hanging_chain",
        "ring_in_plane",
    ],
)
def test_estimated_errors_are_those_of_the_frequencies(name):
    """Frequencies are within the estimate, which is not much too large."""
    scene = load(PROBLEMS / f"vibration_{name}.toml")
    exact = solve(scene, accuracy=EXACT).omega
    sharp = list[float]()
    for given in [{"accuracy": 10.0**-k} for k in (4, 5, 6, 7)]:
        found = solve(scene, **given)
        assert found.error_estimate <= given["accuracy"]
        error = float(np.abs(found.omega / exact - 1.0).max())
        # Of a smaller one rounding, of both, is a part.
        if error > 3.0 * EXACT:
            assert error <= found.error_estimate
            sharp.append(found.error_estimate / error)
    assert not sharp or np.median(sharp) < 60.0


def test_estimated_error_is_no_less_than_rounding():
    """A wing that is 100,000 times stiffer one way than the other: its frequencies lose a digit with each halving."""
    scene = load(PROBLEMS / "vibration_wing_mass_aside.toml")
    wanted = next(one.value for one in scene.expect if one.quantity == "modes.omega")
    found = solve(scene, accuracy=1e-6)
    error = np.abs(found.omega[: len(wanted)] / np.array(wanted) - 1.0).max()
    assert 0.0 < error <= found.error_estimate <= 1e-6


def test_only_rough_elements_are_halved():
    """Waves of a hanging chain shorten towards its free end, where hardly anything pulls."""
    found = solve(load(PROBLEMS / "vibration_hanging_chain.toml"), accuracy=1e-6)
    lengths = np.diff(found.motion.model.mesh.cuts["beam"])
    assert found.error_estimate <= 1e-6
    assert found.motion.model.mesh.elements < 32
    assert lengths[-1] < 0.2 * lengths[0]


def test_modes_begin_on_the_mesh_before_the_last_halving():
    scene = load(PROBLEMS / "vibration_bent_cantilever_2.toml")
    found = solve(scene, accuracy=1e-4)
    # Statics halved all elements to see its error, modes do so once themselves.
    assert found.motion.model.mesh.elements == found.last.model.mesh.elements


def test_what_rounding_alone_would_change_is_not_halved_further():
    found = solve(load(PROBLEMS / "vibration_wing_mass_aside.toml"), accuracy=1e-7)
    assert found.status is Status.SHORT
    assert found.motion.model.mesh.elements < 12
