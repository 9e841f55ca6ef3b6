"""Members that stretch and shear: closed forms, differential equations solved by SciPy, and the limit of stiff ones."""

import re
from pathlib import Path

import numpy as np
import pytest
from scenes import cantilever
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ellipe, ellipk
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.mathematics import quaternion
from sfetcas.mechanics import terms
from sfetcas.mechanics.elements import Element
from sfetcas.mechanics.equations import gained_tangents
from sfetcas.mechanics.stations import Stations
from sfetcas.solvers.globalised import Code

PROBLEMS = Path(__file__).parent.parent / "problems"


def strip(ea=None, ga=None, value=(0.0, 10.0), **more):
    """A cantilever of EI = L = 1 with a force at its end."""
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 1.0}
    section |= {} if ea is None else {"EA": ea}
    section |= {} if ga is None else {"GA2": ga, "GA3": ga}
    return Scene.from_dict(cantilever(value, **{"sections": {"s": section}, **more}))


def bar(ea, ends=("clamped", "clamped"), **more):
    """A straight member of EI = L = 1 between two supports."""
    nodes = {"A": {"position": [0, 0], "support": ends[0]}, "B": {"position": [1, 0], "support": ends[1]}}
    if ends[1] == "slider":
        nodes["B"] |= {"direction": [1, 0], "rotation": "hinge"}
    table = {
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0, **({} if ea is None else {"EA": ea})}},
        "nodes": nodes,
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
    }
    return Scene.from_dict(table | more)


# -- the element ------------------------------------------------------------------------------------


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize("order", [1, 3])
def test_derivatives_put_together_of_points_are_those_of_the_whole(order, gauss):
    element, rng = Element(True, order, gauss, True), np.random.default_rng(order)
    turns, places, rows, data, load = element.sizes
    q = rng.normal(size=(4, turns)) * 0.2 + [[1.0], [0.0], [0.0], [0.0]]
    q /= np.linalg.norm(q, axis=0)
    given = [q, *(rng.normal(size=size) for size in ((3, places), data, load, rows))]
    for short, whole, arguments in (
        (element.rotation_gradient(), terms._rotation_gradient(element), given),
        (element.slopes(), terms._slopes(element), given[:4]),
        (element.curvatures(), terms._curvatures(element), [*given, 0.7]),
    ):
        for one, other in zip(short.call(arguments), whole.call(arguments), strict=True):
            # Sums of some hundred products of the size of one to ten.
            np.testing.assert_allclose(np.array(one), np.array(other), atol=1e-11)


@pytest.mark.parametrize("space", [False, True])
def test_rigid_motions_strain_nothing(space):
    element, rng = Element(space, 3, False, True), np.random.default_rng(5)
    turns, places, _, data, load = element.sizes
    numbers, strains = rng.normal(size=data), rng.normal(size=(element.axes, places))
    one = rng.normal(size=element.components)
    one = one / np.linalg.norm(one) if space else one
    energies = [
        float(terms.energies_of(element)(np.tile(q[:, None], turns), strains, numbers, np.zeros(load))[1])
        for q in (np.eye(4)[0] if space else np.zeros(1), one)
    ]
    assert energies[0] == pytest.approx(0.5 * (strains**2).sum(), rel=1e-14)
    assert energies[1] == pytest.approx(energies[0], rel=1e-13)


# -- statics ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
@pytest.mark.parametrize(
    ("ea", "ga", "tip"),
    [
        (100.0, 40.0, (0.4270824760, 0.9424536888, 1.3957770840)),
        (1e6, 4e5, (0.4450026553, 0.8106220370, 1.4302825315)),
        (1e16, 4e15, (0.4450044022, 0.8106090249, 1.4302855388)),
    ],
)
def test_cantilever_with_a_force_across(ea, ga, tip, solver, dimension):
    """Ten digits, from shooting of the differential equations; the last are those without stretch and shear."""
    found = sfetcas.solve(strip(ea, ga, dimension=dimension), solver=solver, accuracy=1e-9).last
    np.testing.assert_allclose(found.position("B")[:2], tip[:2], atol=1e-9)
    w, _, _, z = found.quaternion("B")
    assert 2.0 * np.arctan2(z, w) == pytest.approx(tip[2], abs=1e-9)
    assert found.certificate.stable is True


@pytest.mark.parametrize("ea", [10.0, 1e2, 1e4, 1e8, 1e12, 1e16])
def test_bar_that_is_shortened_is_one_solve_whatever_its_stiffness(ea):
    """It stays straight where it is soft, and buckles as an inextensible one where it is stiff."""
    scene = bar(ea, prescribed={"p": {"node": "B", "displacement": [-0.1, 0.0]}})
    solution = sfetcas.solve(scene, solver="newton", accuracy=1e-9)
    force = solution.last.reaction("B")[0][0]
    if 0.1 * ea < 4.0 * np.pi**2 * (1.0 - 0.1) ** 2:
        assert force == pytest.approx(-0.1 * ea, rel=1e-9)
    elif ea >= 1e12:
        # Four quarters of an elastica: P = 16 K^2 EI / L^2 with 2 E / K = 1.9.  The strain is 40 / EA.
        m = brentq(lambda m: 2.0 * ellipe(m) / ellipk(m) - 1.9, 1e-6, 0.9, xtol=1e-16)
        assert force == pytest.approx(-16.0 * ellipk(m) ** 2, rel=1e-10)
    assert solution.last.certificate.stable is True


def test_straight_members_between_held_points_carry_what_stretches_them():
    scene = bar(100.0, prescribed={"p": {"node": "B", "displacement": [0.1, 0.0]}})
    found = sfetcas.solve(scene).last
    np.testing.assert_allclose(found.reaction("B")[0], [10.0, 0.0, 0.0], atol=1e-10)
    np.testing.assert_allclose(found.along("m", [0.0, 0.3])["strain"], [[0.1, 0, 0]] * 2, atol=1e-12)
    assert found.table("members", "m")["energy"] == pytest.approx(0.5 * 100.0 * 0.1**2, rel=1e-10)


def plane_beam(ea, ga, ei, across, follower):
    """Tip (x, y, angle) and root (M, Fx, Fy) of a clamped beam of length 1 under a force per length."""

    def slopes(_, state):
        _, _, angle, _, fx, fy = state
        c, s = np.cos(angle), np.sin(angle)
        stretch, shear = (fx * c + fy * s) / ea, (-fx * s + fy * c) / ga
        dx, dy = (1.0 + stretch) * c - shear * s, (1.0 + stretch) * s + shear * c
        load = (-across * s, across * c) if follower else (0.0 * s, across + 0.0 * s)
        return np.vstack([dx, dy, state[3] / ei, fx * dy - fy * dx, -load[0], -load[1]])

    def ends(a, b):
        return np.concatenate([a[:3], b[3:]])

    found = solve_bvp(slopes, ends, np.linspace(0.0, 1.0, 40), np.zeros((6, 40)), tol=1e-10, max_nodes=50_000)
    assert found.success
    return found.y[:3, -1], found.y[3:, 0]


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("frame", ["fixed", "follower"])
def test_loads_along_a_member(frame, dimension):
    load = {"type": "distributed", "member": "m", "value": [0.0, 3.0], "frame": frame}
    scene = strip(20.0, 10.0, loads={"q": load}, dimension=dimension)
    found = sfetcas.solve(scene, accuracy=1e-9).last
    tip, root = plane_beam(20.0, 10.0, 1.0, 3.0, frame == "follower")
    # The accuracy of SciPy's solution.
    np.testing.assert_allclose(found.position("B")[:2], tip[:2], atol=2e-9)
    force, moment = found.reaction("A")
    np.testing.assert_allclose([moment[2], *force[:2]], -root, atol=1e-7)
    np.testing.assert_allclose(found.along("m", [0.0])["strain"][0, :2], [root[1] / 20.0, root[2] / 10.0], atol=1e-8)
    assert found.certificate.stable == (True if frame == "fixed" else "not defined")


def bend(force, yielding, radius=100.0, angle=np.pi / 4):
    """Tip of the bend of Bathe and Bolourchi by its differential equations, for EA, GA2, GA3."""
    ei = 1e7 / 12.0
    n, state = np.zeros(3), np.zeros((10, 60))
    s = np.linspace(0.0, radius * angle, 60)

    def slopes(_, state):
        q, m = state[3:7].T, state[7:10].T
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        inside = quaternion.conjugate(q)
        strain = quaternion.rotate(inside, np.broadcast_to(n, m.shape)) / yielding + [1.0, 0.0, 0.0]
        curvature = quaternion.rotate(inside, m) / ei + [0.0, 0.0, 1.0 / radius]
        tangent = quaternion.rotate(q, strain)
        about = 0.5 * np.hstack([np.zeros((len(m), 1)), curvature])
        return np.hstack([tangent, quaternion.multiply(q, about), -np.cross(tangent, n)]).T

    def ends(a, b):
        return np.concatenate([a[:3], a[3:7] - [1.0, 0.0, 0.0, 0.0], b[7:]])

    state[3], state[6] = np.cos(0.5 * s / radius), np.sin(0.5 * s / radius)
    for share in (0.25, 0.5, 0.75, 1.0):
        n[2] = share * force
        found = solve_bvp(slopes, ends, s, state, tol=1e-9, max_nodes=50_000)
        assert found.success
        s, state = found.x, found.y
    return found.y[:3, -1]


def test_bend_of_45_degrees_in_space():
    section = sfetcas.CrossSection(EI2=1e7 / 12, EI3=1e7 / 12, GJ=1e7 / 12, EA=1e5, GA2=5e4, GA3=4e4)
    scene = sfetcas.load(PROBLEMS / "bend_45_degrees.toml")
    scene = scene.replace({"sections.square": section, "analysis.steps": [600]}, expect=())
    found = sfetcas.solve(scene, accuracy=1e-9).last
    # SciPy's solution has a relative error of 1e-9 in each part.
    np.testing.assert_allclose(found.position("tip"), bend(600.0, [1e5, 5e4, 4e4]), atol=2e-7)


def lee_frame(ea, ga, ei=1440.0, side=120.0, at=24.0):
    """Limit load of Lee's frame: the largest load over prescribed ways of its point, by differential equations."""
    lengths = np.array([side, at, side - at])
    x = np.linspace(0.0, 1.0, 15)
    # Of each member x, y, angle and moment; then foot forces and the load.
    start = np.zeros((12, len(x)))
    start[1], start[2], start[5], start[9] = side * x, np.pi / 2, side, side
    start[4], start[8] = at * x, at + (side - at) * x
    memory = {"x": x, "y": start, "p": np.array([0.0, 1.0, 0.0])}

    def slopes(_, state, p):
        rows = []
        for i, (fx, fy) in enumerate(((p[0], p[1]), (p[0], p[1]), (p[0], p[1] - p[2]))):
            # The internal force of what is beyond on what is before is minus that of the foot, then the load comes.
            nx, ny = -fx, -fy
            angle, moment = state[4 * i + 2], state[4 * i + 3]
            c, s = np.cos(angle), np.sin(angle)
            stretch, shear = (nx * c + ny * s) / ea, (-nx * s + ny * c) / ga
            dx, dy = (1.0 + stretch) * c - shear * s, (1.0 + stretch) * s + shear * c
            rows += [
                length * row for length, row in ((lengths[i], r) for r in (dx, dy, moment / ei, nx * dy - ny * dx))
            ]
        return np.vstack(rows)

    def load(way):
        def ends(a, b, p):
            corner = [b[0] - a[4], b[1] - a[5], b[2] - a[6] - np.pi / 2, b[3] - a[7]]
            point = b[4:8] - a[8:12]
            return np.array([a[0], a[1], a[3], *corner, *point, b[8] - side, b[9] - side, b[11], b[5] - (side - way)])

        found = solve_bvp(slopes, ends, memory["x"], memory["y"], memory["p"], tol=1e-6, max_nodes=20_000)
        assert found.success
        memory.update(x=found.x, y=found.y, p=found.p)
        return found.p[2]

    for way in (2.0, 8.0, 16.0, 24.0, 32.0, 40.0, 46.0):
        load(way)
    return -minimize_scalar(lambda way: -load(way), bounds=(46.0, 51.0), method="bounded", options={"xatol": 1e-4}).fun


@pytest.mark.parametrize(("ea", "ga"), [(4320.0, 1384.6), (200.0, 100.0)])
def test_limit_load_of_a_frame(ea, ga):
    section = sfetcas.CrossSection(EI3=1440.0, EA=ea, GA2=ga)
    scene = sfetcas.load(PROBLEMS / "lee_frame.toml").replace({"sections.strip": section}, expect=())
    path = sfetcas.solve(scene)
    # At the limit point the load is flat: an error of 1e-4 of the way is none of the load.
    # SciPy's relative residuals are 1e-6.
    assert path.limit_points[0].factor == pytest.approx(lee_frame(ea, ga), rel=1e-6)


def test_pinned_column_buckles_at_the_load_of_the_formula():
    """P with pi^2 EI / L^2 = P (1 + (1/GA - 1/EA) P): it shortens before it buckles, and shear lets it lean."""
    for ea, ga, exact in ((100.0, 40.0, 8.727155702), (100.0, 100.0, 9.869604401), (None, 40.0, None)):
        if exact is None:
            exact = 0.5 * ga * (np.sqrt(1.0 + 4.0 * np.pi**2 / ga) - 1.0)
        section = {"EI3": 1.0, "GA2": ga} | ({} if ea is None else {"EA": ea})
        push = {"type": "force", "node": "B", "value": [-1.0, 0.0]}
        scene = bar(None, ("hinge", "slider"), sections={"s": section}, loads={"p": push})
        path = sfetcas.solve(scene.replace({"analysis": {"type": "path", "range": [0, 12], "accuracy": 1e-9}}))
        assert [entry.factor for entry in path.bifurcations] == pytest.approx([exact], rel=1e-9)


def test_turning_bar_is_stretched_by_what_turns_with_it():
    """EA u'' + rhoA w^2 (r + s + u) = 0: a cosine and a sine."""
    scene = bar(100.0, ("clamped", "free"), rotating=[0, 0, 3.0])
    scene = scene.replace({"nodes.A.position": [0.2, 0.0], "nodes.B.position": [1.2, 0.0]})
    k = 3.0 / 10.0
    exact = 0.2 * np.cos(k) + (1.0 + 0.2 * k * np.sin(k)) / (k * np.cos(k)) * np.sin(k)
    assert sfetcas.solve(scene, accuracy=1e-10).last.position("B")[0] == pytest.approx(exact, abs=1e-9)


def test_only_what_a_scene_asks_for_is_unknown():
    plain, both, one = (sfetcas.solve(strip(*given)).last.model for given in ((None, None), (9.0, 9.0), (9.0, None)))
    assert [block.name for block in plain.blocks] == ["angles"]
    sizes = [{block.name: block.size for block in model.blocks} for model in (both, one)]
    elements = [len(model.mesh.cuts["m"]) - 1 for model in (both, one)]
    points = [count * (model.mesh.order + 1) for count, model in zip(elements, (both, one), strict=True)]
    assert [size["strains"] for size in sizes] == [2 * points[0], points[1]]


def test_forces_that_turn_with_a_stretched_member_have_no_potential():
    """Pressure is a force per length of the unloaded member, while the area is that of the stretched curve."""
    ring = sfetcas.load(PROBLEMS / "ring_normal_pressure.toml")
    soft = {name: section.replace(EA=1e3) for name, section in ring.sections.items()}
    assert sfetcas.assemble(ring, sfetcas.uniform_mesh(ring, 3, 4)).conservative
    stretched = ring.replace({"sections": soft}, expect=())
    assert not sfetcas.assemble(stretched, sfetcas.uniform_mesh(stretched, 3, 4)).conservative


# -- small motions ----------------------------------------------------------------------------------


def test_axial_frequencies():
    modes = sfetcas.solve(bar(50.0, ("clamped", "free"), analysis={"type": "modes", "modes": 6, "accuracy": 1e-8}))
    axial = (np.array([1.0, 3.0, 5.0]) * np.pi / 2.0) * np.sqrt(50.0)
    for omega in axial[axial < modes.omega[-1]]:
        assert np.abs(modes.omega / omega - 1.0).min() < 1e-8


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_frequencies_of_a_hinged_beam_that_shears(dimension):
    """Without rotary inertia w^2 = (EI/rhoA) k^4 / (1 + EI k^2 / GA), k = n pi / L."""
    section = {"EI3": 1.0, "EI2": 1e4, "GJ": 1e4, "GA2": 30.0, "rhoA": 1.0}
    scene = bar(None, ("hinge", "slider"), sections={"s": section}, dimension=dimension)
    modes = sfetcas.solve(scene.replace({"analysis": {"type": "modes", "modes": 3, "accuracy": 1e-8}}))
    k = np.arange(1, 4) * np.pi
    np.testing.assert_allclose(modes.omega, k**2 / np.sqrt(1.0 + k**2 / 30.0), rtol=1e-7)


def test_damping_resists_stretch_too():
    """Kelvin and Voigt: the damping ratio of a mode is half the retardation time times its frequency."""
    section = {"EI3": 1e4, "EA": 50.0, "rhoA": 1.0, "damping": 1e-3}
    scene = bar(None, ("clamped", "free"), sections={"s": section})
    modes = sfetcas.solve(scene.replace({"analysis": {"type": "modes", "modes": 1, "accuracy": 1e-8}}))
    omega = np.pi / 2 * np.sqrt(50.0)
    ratio = 0.5e-3 * omega
    assert modes.omega[0] == pytest.approx(omega * np.sqrt(1.0 - ratio**2), rel=1e-8)
    assert modes.modes[0].damping == pytest.approx(ratio, rel=1e-7)


# -- motion -----------------------------------------------------------------------------------------


def struck(ea, integrator, **more):
    """A bar that a force along it pulls from t = 0 on: its end moves as a triangle between 0 and 2 F L / EA."""
    pull = {"type": "force", "node": "B", "value": [1.0, 0.0], "history": "on"}
    return bar(
        ea,
        ("clamped", "free"),
        loads={"pull": pull},
        histories={"on": {"t": [0, 1], "value": [1, 1]}},
        analysis={"type": "dynamic", "end": 1.0, "integrator": integrator, **more},
    )


@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha", "conserving"])
def test_wave_along_a_bar(integrator):
    motion = sfetcas.solve(struck(100.0, integrator, accuracy=1e-3))
    speed = 10.0
    for step in motion.steps:
        way = speed * step.time % 4.0
        exact = (way if way < 2.0 else 4.0 - way) / 100.0
        # The kinks of the triangle are rounded within an element.
        assert step.position("B")[0] - 1.0 == pytest.approx(exact, abs=1.5e-3)
    energies = [step.energy["total"] for step in motion.steps]
    if integrator == "conserving":
        # Of 1e-2 J that go to and fro; between its steps the motion is interpolated.
        assert np.ptp(energies) < 1e-6


def test_steps_that_do_not_resolve_the_waves():
    """A hundred times stiffer along than a step resolves, the beam moves as one that does not stretch."""

    def swing(ea):
        scene = strip(ea, None, (0.0, 1.0), histories={"on": {"t": [0, 0.2, 9], "value": [0, 1, 1]}})
        scene = scene.replace({"loads.tip.history": "on", "analysis": {"type": "dynamic", "end": 1.0}})
        return sfetcas.solve(scene, accuracy=1e-4)

    soft, stiff = swing(1e8), swing(None)
    np.testing.assert_allclose(soft.steps[-1].position("B"), stiff.steps[-1].position("B"), atol=3e-4)
    # No more steps: the waves are damped, not followed.
    assert soft.count < 2 * stiff.count


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_nothing_is_lost_in_free_flight(dimension):
    """A stretching rod thrown at one end: momentum and its moment stay, energy but for the integrator."""
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "EA": 60.0, "GA2": 40.0, "GA3": 40.0, "rhoA": 1.0}
    velocity = [0.0, 2.0] if dimension == "plane" else [0.3, 2.0, 0.5]
    nodes = {"A": {"position": [0, 0]}, "B": {"position": [1, 0], "velocity": velocity}}
    analysis = {"type": "dynamic", "end": 0.4}
    scene = bar(None, sections={"s": section}, nodes=nodes, dimension=dimension, analysis=analysis)
    motion = sfetcas.solve(scene, accuracy=1e-4)
    first, last = motion.steps[0], motion.steps[-1]
    for key in ("linear", "angular"):
        np.testing.assert_allclose(last.momentum[key], first.momentum[key], atol=1e-6)
    assert last.energy["total"] == pytest.approx(first.energy["total"], rel=1e-3)


# -- parameters, design, code -----------------------------------------------------------------------


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_derivatives_by_the_stiffness_against_stretch(dimension):
    names = ["sections.s.EA", "sections.s.GA2", "sections.s.EI3"]
    family = sfetcas.parametric(strip(100.0, 40.0, dimension=dimension), names, ["nodes.B.position"])
    values = np.array([100.0, 40.0, 1.0])
    found = family.solve(dict(zip(names, values, strict=True))).jacobian["nodes.B.position"]
    for i, name in enumerate(names):
        step = np.zeros(3)
        step[i] = 1e-5 * values[i]
        above, below = (
            family.solve(dict(zip(names, values + sign * step, strict=True)))["nodes.B.position"] for sign in (1, -1)
        )
        # A central difference with a step of 1e-5 keeps seven digits.
        np.testing.assert_allclose(np.ravel(found[name]), (above - below) / (2.0 * step[i]), atol=1e-8)


def test_a_stiffness_is_found_from_a_wanted_answer():
    found = sfetcas.find(strip(100.0, 40.0), {"sections.s.EA": (20.0, 1e4)}, {"nodes.B.position.1": 0.93})
    again = strip(found.values["sections.s.EA"], 40.0)
    assert sfetcas.solve(again).last.position("B")[1] == pytest.approx(0.93, abs=1e-6)


@needs_compiler
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_exported_code(dimension, tmp_path):
    arguments = ["sections.s.EA", "sections.s.EI3"]
    scene = strip(100.0, 40.0, dimension=dimension)
    solver = sfetcas.export(scene, tmp_path / "c", name="c", arguments=arguments, results=["nodes.B.position"])
    outcome, results = solver.solve([100.0, 1.0])
    assert outcome.code is Code.SOLVED
    np.testing.assert_allclose(results[:2], [0.4270824760, 0.9424536888], atol=1e-6)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


# -- contact ----------------------------------------------------------------------------------------


def test_contact_on_a_floor_goes_over_to_that_of_a_stiff_member():
    scene = sfetcas.load(PROBLEMS / "floor_heavy_cantilever.toml").replace(expect=())
    plain = sfetcas.solve(scene).last
    (name,) = scene.sections
    stiff = scene.sections[name].replace(EA=1e9)
    found = sfetcas.solve(scene.replace({f"sections.{name}": stiff})).last
    np.testing.assert_allclose(found.contacts["floor"]["at"], plain.contacts["floor"]["at"], atol=1e-7)
    np.testing.assert_allclose(found.contacts["floor"]["force"], plain.contacts["floor"]["force"], rtol=1e-6, atol=1e-9)


# -- actuators ----------------------------------------------------------------------------------------


def robot(first, second, discs):
    """The rod of Rao, Peyron, Lilge and Burgner-Kahrs 2021: two segments of 0.2 m, tendons 10 mm from the axis."""
    section = {"shape": "circle", "radius": 0.7e-3, "E": 54e9, "nu": 0.3}
    section |= {"stretch": True, "shear": True, "shear_factor": 1.0}

    def way(angle, *members):
        offset = [0.01 * np.cos(np.deg2rad(angle)), 0.01 * np.sin(np.deg2rad(angle))]
        return [{"member": m, "offset": offset, **({"discs": 10} if discs else {})} for m in members]

    tendons = {"short": {"way": way(90, "one"), "tension": first}} if first else {}
    tendons |= {"long": {"way": way(-30, "one", "two"), "tension": second}} if second else {}
    return Scene.from_dict(
        {
            "sections": {"rod": section},
            "nodes": {
                "A": {"position": [0, 0, 0], "support": "clamped"},
                "B": {"position": [0, 0, 0.2]},
                "C": {"position": [0, 0, 0.4]},
            },
            "members": {
                "one": {"nodes": ["A", "B"], "section": "rod", "b2": [1, 0, 0]},
                "two": {"nodes": ["B", "C"], "section": "rod", "b2": [1, 0, 0]},
            },
            "tendons": tendons,
        }
    )


@pytest.mark.parametrize(
    ("first", "second", "discs", "tip"),
    [
        (4.0, 0.0, False, (0.0, 0.2160533, 0.3214331)),
        (4.0, 0.0, True, (0.0, 0.2182687, 0.3195510)),
        (0.0, 2.0, False, (0.1292144, -0.0746020, 0.3600957)),
        (0.0, 2.0, True, (0.1299549, -0.0750295, 0.3595993)),
    ],
)
def test_tendons_on_a_rod_that_stretches_and_shears(first, second, discs, tip):
    """Published to seven digits; without stretch the last two differ."""
    found = sfetcas.solve(robot(first, second, discs), accuracy=1e-9).last
    np.testing.assert_allclose(found.position("C"), tip, atol=6e-8)


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_sections_carry_what_their_strains_ask_for(dimension):
    """Moment and force by balance beside those of the strains: tendon, natural curvature, field and load at once."""
    offset = 0.03 if dimension == "plane" else [0.03, 0.02]
    natural = 0.4 if dimension == "plane" else [0.3, -0.2, 0.4]
    scene = strip(
        60.0,
        40.0,
        (0.3, 0.8),
        dimension=dimension,
        tendons={"t": {"way": [{"member": "m", "offset": offset}], "tension": 6.0}},
        actuations={"k": {"member": "m", "value": natural}},
        fields={"B": {"type": "linear", "gradient": [[2.0, 0, 0], [0, -2.0, 0], [0, 0, 0]], "value": [0.1, 0.2]}},
        magnets={"m": {"member": "m", "moment_density": [1.0, 0.5]}},
    )
    found = sfetcas.solve(scene, accuracy=1e-10).last
    x = np.array([0.03, 0.2, 0.55, 0.91])
    told, fields = found.along("m", x), found.fields
    changes = fields._changes("m", x)
    axes = slice(None) if dimension == "space" else slice(2, 3)
    # Derivatives of rotations lose three of the digits of the positions.
    np.testing.assert_allclose(told["curvature"][:, axes], changes[:, axes], atol=1e-6)
    model = found.model
    gained = gained_tangents(model, found.state) / model.beams.weight[..., None]
    at = Stations(model.element, model.mesh.cuts["m"], x)
    strains = np.einsum("np,npa->na", at.at_points, gained[at.elements])
    np.testing.assert_allclose(told["strain"][:, : strains.shape[1]], strains, atol=1e-6)
    assert np.abs(strains).max() > 0.05


def test_gradient_field_pulls_a_magnet_long():
    """B = g x along a bar with the moment m per length pulls by m g per length: m g L^2 / (2 EA) at its end."""
    scene = bar(
        20.0,
        ("clamped", "free"),
        fields={"B": {"type": "linear", "gradient": [[3.0, 0, 0], [0, -3.0, 0], [0, 0, 0]]}},
        magnets={"m": {"member": "m", "moment_density": [2.0, 0.0]}},
    )
    found = sfetcas.solve(scene, accuracy=1e-10).last
    assert found.position("B")[0] == pytest.approx(1.0 + 2.0 * 3.0 / (2.0 * 20.0), abs=1e-10)
    assert found.reaction("A")[0][0] == pytest.approx(-6.0, abs=1e-8)


# -- wrong input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ({"EI3": 1.0, "EA": 0.0}, r"sections.s.EA: found 0, accepted: a number above zero"),
        ({"EI3": 1.0, "GA2": -2.0}, r"sections.s.GA2: found -2, accepted: a number above zero"),
        ({"EI3": 1.0, "stretch": True}, r"found 'stretch' without a shape, accepted: shape ="),
        ({"shape": "circle", "radius": 1.0, "E": 1.0, "EA": 1.0}, r"found 'EA' together with shape"),
        ({"shape": "circle", "radius": 1.0, "E": 1.0, "shear": True}, r"the key 'G' is missing, shear = true"),
        (
            {"shape": "circle", "radius": 1.0, "E": 1.0, "nu": 0.3, "shear_factor": 0.9},
            r"found 'shear_factor' without shear = true",
        ),
        (
            {"shape": "circle", "radius": 1.0, "E": 1.0, "nu": 0.3, "shear": True, "shear_factor": 1.2},
            r"shear_factor: found 1.2, accepted: a number above 0 and up to 1",
        ),
    ],
)
def test_wrong_sections(section, sentence):
    with pytest.raises(SceneError, match=sentence):
        bar(None, sections={"s": section})


def test_what_is_not_solved_is_refused():
    with pytest.raises(SceneError, match=r"sections.s.GA2: found with the integrator 'conserving', which cannot"):
        sfetcas.solve(
            strip(100.0, 40.0, (0.0, 0.0), analysis={"type": "dynamic", "end": 1, "integrator": "conserving"})
        )
    with pytest.raises(SceneError, match="'idas', but strains of members that stretch or shear have no inertia"):
        sfetcas.solve(struck(100.0, "idas"))
    floor = {"floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "member": "m"}}
    with pytest.raises(SceneError, match=r"contacts.floor: found the member 'm', which shears, accepted"):
        strip(100.0, 40.0, contacts=floor)


@pytest.mark.parametrize(("key", "words"), [("EA", "stretch"), ("GA2", "shear along b2")])
def test_a_section_so_soft_that_rounding_is_all_that_is_left_is_refused(key, words):
    scene = sfetcas.load(PROBLEMS / "cantilever_stretching.toml")
    with pytest.raises(SceneError, match=f"against {words} of 1e-300 times .* accepted: at least 1e-08 times"):
        scene.replace({f"sections.strip.{key}": 1e-300})


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {},
            "stretch and shear, which are left out, .*: stretch = true and shear = true of the section 's' count them",
        ),
        ({"stretch": True}, "shear, which is left out, .*: shear = true of the section 's' counts it"),
        ({"shear": True}, "stretch, which is left out, .*: stretch = true of the section 's' counts it"),
        ({"stretch": True, "shear": True}, None),
        ({"nu": None}, "stretch, which is left out, .*: stretch = true of the section 's' counts it"),
    ],
    ids=["none", "stretch", "shear", "both", "shear modulus unknown"],
)
def test_what_is_left_out_is_told_where_it_matters(given, told):
    """The estimate is near what the answer changes by where it is counted."""
    shape = {"shape": "rectangle", "width": 0.1, "height": 0.1, "E": 1e4, "nu": 0.3, **given}
    shape = {key: value for key, value in shape.items() if value is not None}
    scene = Scene.from_dict(cantilever((0.05, 0.05), sections={"s": shape}, dimension="plane"))
    found = sfetcas.solve(scene).last
    if told is None:
        assert not found.notes
        return
    (note,) = found.notes
    assert re.match(told, note)
    switches = {f"sections.s.{kind}": True for kind in re.findall(r"(\w+) = true", note)}
    moved = np.linalg.norm(sfetcas.solve(scene.replace(switches)).last.position("B") - found.position("B"))
    # An estimate of an order of magnitude, of one metre.
    assert 0.3 < float(re.search(r"by about (\S+) of the size", note)[1]) / moved < 3.0
