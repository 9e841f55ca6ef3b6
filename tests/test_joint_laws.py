"""Laws of sections that couple curvature and stretch: sections in closed form, cantilevers by SciPy, every analysis."""

import re

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import CrossSection, Potential, Scene, SceneError, SolveError
from sfetcas.mathematics.forms import Form
from sfetcas.mathematics.potentials import derivatives_of
from sfetcas.mechanics.laws import AlongElement
from sfetcas.mechanics.terms import Term

pytestmark = pytest.mark.usefixtures("interpreted")

E, WIDTH, HEIGHT = 7e10, 0.004, 0.002
STRAINS, STRESSES = [-0.06, -0.01, 0.0, 0.008, 0.05], [-9e8, -7e8, 0.0, 5.6e8, 6e8]
UNEQUAL = {"type": "stress-strain", "strain": STRAINS, "stress": STRESSES}
FLAT = {"shape": "rectangle", "width": WIDTH, "height": HEIGHT, "E": E, "nu": 0.3, "rho": 2700.0, "stretch": True}
STRIP = {**FLAT, "law": {**UNEQUAL, "about": "b3"}}
WIRE = {"shape": "circle", "radius": 0.001, "E": E, "nu": 0.3, "stretch": True, "law": UNEQUAL}
TUBE = {"shape": "tube", "outer": 0.001, "inner": 0.0007, "E": E, "nu": 0.3, "stretch": True, "law": UNEQUAL}
PULLED = {"type": "force", "node": "B", "value": [-20.0, 1.5]}
BENT = {"type": "moment", "node": "B", "value": 2.2}


def scene(section, load, length=1.0, **more):
    """A cantilever along x."""
    return Scene.from_dict(
        {
            "sections": {"s": section},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [length, 0]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {f"load{i}": one for i, one in enumerate(load if isinstance(load, list) else [load])},
            **more,
        }
    )


POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)


def resultants(strain, curvature):
    """Axial force and moment about b3 of the strip with their derivatives, on pieces of the height without kinks."""
    ends = [-HEIGHT / 2, HEIGHT / 2]
    if curvature:
        ends = np.unique(np.clip([*ends, *((strain - np.array(STRAINS)) / curvature)], *ends))
    size = np.diff(ends)[:, None]
    y = (ends[:-1, None] if curvature else np.array([[ends[0]]])) + 0.5 * size * (1.0 + POINTS)
    area = 0.5 * size * WIDTH * WEIGHTS
    stress, slope = stress_of(strain - curvature * y)
    forces = np.array([np.sum(area * stress), -np.sum(area * stress * y)])
    across = -np.sum(area * slope * y)
    return forces, np.array([[np.sum(area * slope), across], [across, np.sum(area * slope * y**2)]])


def stress_of(strain):
    """Stress and its slope: linear between, and on beyond the ends."""
    at = np.clip(np.searchsorted(STRAINS, strain) - 1, 0, len(STRAINS) - 2)
    slope = (np.diff(STRESSES) / np.diff(STRAINS))[at]
    return np.array(STRESSES)[at] + slope * (strain - np.array(STRAINS)[at]), slope


def strains_at(force, moment, near=(0.0, 0.0)):
    """Strain along and curvature at which the strip carries a force and a moment, by Newton's method."""
    x = np.array(near, dtype=float)
    for _ in range(40):
        forces, slopes = resultants(*x)
        step = np.linalg.solve(slopes, [force - forces[0], moment - forces[1]])
        x += step
        if np.abs(step * [1.0, HEIGHT]).max() < 1e-13:
            return x
    raise AssertionError("not found")


def told(section, strain, curvature):
    """Axial force and moment about b3 by the potential of the law."""
    made, at = CrossSection(**section), np.zeros(1)
    values = made.law.values(made, at)[0]
    x = np.array([0.0, 0.0, curvature, strain]) / values[1]
    slopes = derivatives_of(made.law.form_in(made))(x, values[2:])[1].full().ravel() * values[0] / values[1]
    return np.array([strain / made.compliance(at)[0, 0] + slopes[3], made.stiffness(at)[0, 2] * curvature + slopes[2]])


# -- sections ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("section", [STRIP, WIRE, TUBE], ids=["rectangle", "circle", "tube"])
def test_resultants_are_those_of_fibres(section):
    count = 100_000
    y = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    y, chord = (y * HEIGHT / 2, np.full(count, WIDTH)) if section is STRIP else (y * 0.001, None)
    if chord is None:
        inner = section.get("inner", 0.0)
        chord = 2.0 * (np.sqrt(0.001**2 - y**2) - np.sqrt(np.maximum(inner**2 - y**2, 0.0)))
    area = chord * (y[1] - y[0])
    size = E * 1e-3 * np.array([area.sum(), area.sum() * 1e-3])
    for strain, curvature in ((0.003, 5.0), (-0.02, 20.0), (0.01, -30.0), (0.0, 3.0), (0.02, 0.0), (-0.05, 1e-9)):
        stress = stress_of(strain - curvature * y)[0]
        # Sums over fibres with chords that end steeply.
        expected = [stress @ area, -(stress * y) @ area]
        np.testing.assert_allclose(told(section, strain, curvature) / size, expected / size, rtol=1e-7, atol=1e-7)


def test_ideal_plastic_rectangle():
    """Force and moment over those that the section carries alone: m + n^2 = 1 less a third of the squared core."""
    section = {**FLAT, "law": {"type": "plateau", "stress": 6e8}}
    begin = 2.0 * 6e8 / E / HEIGHT
    for n, core in ((0.0, 0.5), (0.3, 0.1), (-0.6, 0.01), (0.9, 1e-3)):
        strain = n * HEIGHT / 2 * begin / core
        force, moment = told(section, strain, begin / core) / [6e8 * WIDTH * HEIGHT, 6e8 * WIDTH * HEIGHT**2 / 4]
        assert force == pytest.approx(n, abs=1e-9)
        assert moment == pytest.approx(1.0 - n**2 - core**2 / 3.0, rel=1e-9)


def opened(c, soft):
    """Force over E b h^2 k, and its lever over h, of two triangles of stress where a share c is pressed."""
    if c > 1.0:
        force = 0.5 * (c**2 - (c - 1.0) ** 2)
        return force, 1.0 / 12.0 / force
    pressed, pulled = 0.5 * c**2, 0.5 * soft * (1.0 - c) ** 2
    force = pressed - pulled
    return force, (pressed * (0.5 - c / 3.0) + pulled * (0.5 - (1.0 - c) / 3.0)) / force


def test_block_that_hardly_carries_tension():
    """Pressed outside of its kern it opens: without tension over 3 (h/2 - a) of its height, at a lever a."""
    stress, softness = [-7e8, 0.0, 7.0, 7.0 + 7e5], 1e-3
    law = {"type": "stress-strain", "strain": [-0.01, 0.0, 1e-10, 0.01 + 1e-10], "stress": stress, "about": "b3"}
    for soft, lever in ((softness, 0.3), (softness, 0.45), (softness, 0.1), (1e-9, 0.3)):
        stress[3] = 7.0 + soft * 7e8
        c = brentq(lambda c, soft=soft, lever=lever: opened(c, soft)[1] - lever, max(0.04, 1.6 * soft**0.5), 5.0)
        if soft == 1e-9:
            assert c == pytest.approx(3.0 * (0.5 - lever), rel=1e-6)
        load = [
            {"type": "force", "node": "B", "value": [-1000.0, 0.0]},
            {"type": "moment", "node": "B", "value": 1000.0 * lever * HEIGHT},
        ]
        # So short that the deflection is no lever.
        found = sfetcas.solve(scene({**FLAT, "law": law}, load, 1e-6)).last.along("beam", 0.5)
        curvature = 1000.0 / (E * WIDTH * HEIGHT**2 * opened(c, soft)[0])
        # What is left of tension in the corner of the curve.
        assert found["curvature"][0, 2] == pytest.approx(curvature, rel=1e-6)
        assert found["strain"][0, 0] == pytest.approx(-(c - 0.5) * HEIGHT * curvature, rel=1e-6)


# -- equilibria ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dimension", "solver"), [("plane", "ipopt"), ("plane", "newton"), ("space", "newton")])
def test_bending_without_a_force(dimension, solver):
    """The neutral axis moves to where there is no force, as where the section does not stretch and a table says so."""
    found = sfetcas.solve(scene(STRIP, BENT, dimension=dimension), solver=solver).last.along("beam", [0.0, 0.4])
    strain, curvature = strains_at(0.0, 2.2)
    np.testing.assert_allclose(found["curvature"][:, 2], curvature, rtol=1e-9)
    np.testing.assert_allclose(found["strain"][:, 0], strain, rtol=1e-8)
    if solver == "ipopt":
        table = sfetcas.solve(scene({**STRIP, "stretch": False}, BENT)).last.along("beam", 0.4)
        # Cubics between 64 knots.
        assert table["curvature"][0, 2] == pytest.approx(curvature, rel=3e-7)


def shot(force, angle, length=1.0):
    """Place and angle of the root as seen from the tip, by SciPy from there, with the angle there and a dead force."""
    last = np.zeros(2)

    def slopes(_, state):
        _, _, angle, moment = state
        c, s = np.cos(angle), np.sin(angle)
        last[:] = strain, curvature = strains_at(force[0] * c + force[1] * s, moment, last)
        long = 1.0 + strain
        return [-long * c, -long * s, -curvature, long * (c * force[1] - s * force[0])]

    return solve_ivp(slopes, (0.0, length), [0.0, 0.0, angle, 0.0], "DOP853", rtol=1e-10, atol=1e-12).y[:3, -1]


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize(
    ("value", "follows"), [([-3.0, 2.0], False), ([8.0, 2.6], False), ([-1.0, 2.2], True)], ids=["push", "pull", "turn"]
)
def test_cantilever_by_shooting(value, follows, dimension):
    """Forces across and along that strain fibres beyond the kinks of the curve on both sides."""
    load = {**PULLED, "value": value, "frame": "follower" if follows else "fixed"}
    found = sfetcas.solve(scene(STRIP, load, dimension=dimension), accuracy=1e-8).last
    tip = found.angle("B") if dimension == "plane" else 2.0 * np.arctan2(*found.quaternion("B")[[3, 0]])
    c, s = np.cos(tip), np.sin(tip)
    dead = [c * value[0] - s * value[1], s * value[0] + c * value[1]] if follows else value
    *root, angle = shot(dead, tip)
    # What the accuracy asked for leaves of angles at the tip grows by some powers of ten on the way of the integration.
    np.testing.assert_allclose(-found.position("B")[:2], root, atol=1e-7)
    assert angle == pytest.approx(0.0, abs=1e-7)


def test_centre_off_the_line():
    """Fibres are counted from the centre of tension: as a cantilever through it with a rigid arm at its end."""
    aside, load = 0.003, {**PULLED, "value": [-2.0, 1.2]}
    moved = sfetcas.solve(scene({**STRIP, "tension_center": [aside, 0.0]}, load), accuracy=1e-8).last
    arm = scene(STRIP, load).replace(
        {
            "nodes.A.position": [0.0, aside, 0.0],
            "nodes.B.position": [1.0, 0.0, 0.0],
            "nodes.C": {"position": [1.0, aside, 0.0]},
            "members.beam.nodes": ["A", "C"],
            "members.arm": {"nodes": ["C", "B"], "type": "rigid"},
        }
    )
    through = sfetcas.solve(arm, accuracy=1e-8).last
    np.testing.assert_allclose(moved.position("B"), through.position("B"), atol=1e-8)
    ours, theirs = (one.along("beam", 0.2) for one in (moved, through))
    assert ours["curvature"][0, 2] == pytest.approx(theirs["curvature"][0, 2], rel=1e-6)
    # The fibre along the line is the strain there.
    at_line = theirs["strain"][0, 0] + aside * theirs["curvature"][0, 2]
    assert ours["strain"][0, 0] == pytest.approx(at_line, rel=1e-6)


def test_path_leads_to_the_same_state():
    asked = {"analysis": {"type": "path", "range": [0, 1], "steps": [1.0]}}
    one = scene(STRIP, {**PULLED, "value": [-3.0, 2.0]})
    (found,) = (step for step in sfetcas.solve(one.replace(asked)).steps if step.factor == 1.0)
    np.testing.assert_allclose(found.position("B"), sfetcas.solve(one).last.position("B"), atol=1e-6)


def test_end_of_the_curve_is_told():
    found = sfetcas.solve(scene(STRIP, {"type": "force", "node": "B", "value": [4810.0, 0.0]})).last
    assert any("ends at a strain of -0.06" in note or "ends at a strain of 0.05" in note for note in found.notes)
    assert not any("ends" in note for note in sfetcas.solve(scene(STRIP, BENT)).last.notes)
    # Where it is exceeded only near the clamped end, and is far from it elsewhere.
    heavy = {"type": "distributed", "member": "beam", "value": [5000.0, 0.0]}
    (note,) = (note for note in sfetcas.solve(scene(STRIP, heavy)).last.notes if "ends" in note)
    assert "ends at a strain of 0.05, and a fibre of member 'beam' has 0." in note
    table = {"type": "table", "strain": [-0.1, 0.0, 0.02], "force": [-100.0, 0.0, 20.0]}
    bar = scene({"EI3": 1.0, "stretch_law": table}, {**heavy, "value": [22.0, 0.0]})
    assert any("ends at a strain of 0.02, and member 'beam'" in note for note in sfetcas.solve(bar).last.notes)


def test_more_than_the_plastic_force_is_refused():
    """Beyond it nothing holds: what is in balance to rounding at strains of 1e20 is no equilibrium."""
    section = {**FLAT, "law": {"type": "plateau", "stress": 6e8}}
    pulled = scene(section, {"type": "force", "node": "B", "value": [4801.0, 0.0]})
    with pytest.raises(SolveError, match="the energy falls without bound"):
        sfetcas.solve(pulled, element="SFET2", elements=1)


# -- potentials of curvatures and strains ---------------------------------------------------------------

MATRIX = np.diag([2000.0, 300.0, 200.0, 1.0, 3.0, 1.5])
for _i, _j, _value in ((0, 3, 25.0), (2, 5, 9.0), (1, 4, -10.0), (0, 5, 20.0), (3, 4, 0.3), (0, 1, 50.0)):
    MATRIX[_i, _j] = MATRIX[_j, _i] = _value
ORDER = [3, 4, 5, 0, 1, 2]
PLANE = MATRIX * np.logical_not(np.logical_xor.outer(*[np.isin(np.arange(6), [0, 1, 5])] * 2))
INERTIA = {"rhoA": 1.0, "rhoI": [0.01, 0.01, 0.01]}


def quadratic(matrix):
    """The potential of a stiffness matrix."""
    own = ca.DM(matrix[np.ix_(ORDER, ORDER)])
    return Potential(strains=3, potential=lambda k: 0.5 * ca.dot(k, ca.mtimes(own, k)))


def pairs(matrix, load, **more):
    """The same scene by a potential and by the matrix."""
    return [scene({**one, **INERTIA}, load, **more) for one in ({"law": quadratic(matrix)}, {"stiffness": matrix})]


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_quadratic_potential_is_a_matrix(dimension):
    """Statics, modes and motion of a section whose forces and moments are coupled by a matrix."""
    matrix, force = (PLANE, [-3.0, 2.0]) if dimension == "plane" else (MATRIX, [-3.0, 2.0, 1.2])
    two = pairs(matrix, {**PULLED, "value": force}, dimension=dimension)
    ours, theirs = (sfetcas.solve(one, accuracy=1e-6).last for one in two)
    np.testing.assert_allclose(ours.position("B"), theirs.position("B"), atol=1e-9)
    for name in ("curvature", "strain", "moment"):
        np.testing.assert_allclose(ours.along("beam", 0.3)[name], theirs.along("beam", 0.3)[name], atol=1e-7)
    assert ours.energy["elastic"] == pytest.approx(theirs.energy["elastic"], rel=1e-9)
    mesh = {"members.beam.elements": 1, "members.beam.element": "SFET4"}
    modes = [sfetcas.solve(one.replace({"analysis": {"type": "modes", "modes": 3}, **mesh})).omega for one in two]
    np.testing.assert_allclose(*modes, rtol=1e-9)
    motion = {"type": "dynamic", "end": 0.1, "step": 0.01, "output": 0.1, "integrator": "generalised-alpha"}
    ends = [sfetcas.solve(one.replace({"analysis": motion, **mesh})).last.position("B") for one in two]
    np.testing.assert_allclose(*ends, atol=1e-9)


def test_gauss_points_and_both_solvers():
    one, other = pairs(MATRIX, {**PULLED, "value": [-3.0, 2.0, 1.2]})
    settings = {"element": "SFET3", "elements": 2, "gauss": True}
    found = [
        sfetcas.solve(each, solver=solver, **settings).last for each, solver in ((one, "ipopt"), (other, "newton"))
    ]
    np.testing.assert_allclose(*(each.position("B") for each in found), atol=1e-8)


COUPLED = {"type": "potential", "strains": 1, "parameters": [40.0]}
COUPLED["potential"] = lambda k, p: (
    0.5 * (k[0] ** 2 + k[1] ** 2 + k[2] ** 2) + 50.0 * k[3] ** 2 + p[0] * k[3] * k[2] ** 2
)


def test_potential_in_closed_form():
    """W = k^2/2 + 50 e^2 + p e k^2: a moment M bends and stretches a bar with N = 0, so that e = -p k^2 / 100."""
    load = {"type": "moment", "node": "B", "value": 0.3}
    for dimension in ("plane", "space"):
        found = sfetcas.solve(scene({"law": {**COUPLED, "parameters": [5.0]}}, load, dimension=dimension)).last
        curvature = brentq(lambda k: k - 2.0 * 5.0**2 / 100.0 * k**3 - 0.3, 0.0, 0.6)
        told = found.along("beam", 0.5)
        assert told["curvature"][0, 2] == pytest.approx(curvature, rel=1e-8)
        assert told["strain"][0, 0] == pytest.approx(-5.0 * curvature**2 / 100.0, rel=1e-8)


def test_lost_convexity_is_told():
    pressed = {"type": "force", "node": "B", "value": [-1.4, 0.0]}
    found = sfetcas.solve(scene({"law": COUPLED}, pressed, dimension="plane", analysis={"unstable": "stay"})).last
    assert any("is not convex at changes" in note and "and strains of" in note for note in found.notes), found.notes


# -- derivatives ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "gauss"),
    [(Form("curve", 3, 2, strains=1), True), (Form("sliders", 0, 3, spread=True, strains=1), False)],
    ids=["curve", "sliders"],
)
def test_derivatives_of_points_are_those_of_the_whole(form, gauss):
    """In space the functions put together of points are those of the expression of the whole element."""
    rng = np.random.default_rng(3)
    kind = AlongElement(True, 3, gauss, 0, form)
    q = rng.normal(size=(4, 3)) * 0.2 + [[1.0], [0], [0], [0]]
    data = rng.uniform(0.5, 2.0, kind.sizes[3])
    given = [q / np.linalg.norm(q, axis=0), rng.normal(size=(3, 3)), data, np.zeros(0), np.zeros(0)]
    for name, count, more in (
        ("rotation_gradient", 5, []),
        ("rotation_forces", 5, []),
        ("slopes", 4, []),
        ("curvatures", 5, [0.7]),
    ):
        arguments = [*given[:count], *more]
        ours, theirs = (getattr(owner, name)(kind).call(arguments) for owner in (AlongElement, Term))
        for one, other in zip(ours, theirs, strict=True):
            assert one.shape == other.shape
            # Rounding of sums of numbers of size one to a hundred.
            np.testing.assert_allclose(one.full(), other.full(), atol=1e-11, rtol=1e-11)


def test_forces_are_slopes_of_the_energy():
    """The strain energy that forces of a growing factor put into a strip is their work."""
    one = scene(STRIP, {**PULLED, "value": [-3.0, 2.0]}).replace(
        {"members.beam.elements": 2, "members.beam.element": "SFET4"}
    )
    points, weights = np.polynomial.legendre.leggauss(3)
    ends = [sfetcas.solve(one.replace({"factor": factor})).last for factor in (0.9, 1.0)]
    between = [sfetcas.solve(one.replace({"factor": 0.95 + 0.05 * x})).last for x in points]
    # The work is F.dx = d(F.x) - x.dF.
    force = np.array([-3.0, 2.0, 0.0])
    work = np.diff([f * force @ end.position("B") for f, end in zip((0.9, 1.0), ends, strict=True)])[0]
    work -= 0.05 * weights @ [force @ each.position("B") for each in between]
    # Kinks of the stress within sections have fourth derivatives that jump.
    assert ends[1].energy["elastic"] - ends[0].energy["elastic"] == pytest.approx(work, rel=1e-6)


def test_parameters():
    """Numbers of the curve itself are parameters of a section that stretches."""
    one = scene(STRIP, {**PULLED, "value": [-3.0, 2.6]})
    mesh = sfetcas.Settings(element="SFET4", elements=2)
    names = ["sections.s.law.stress.4", "sections.s.height"]
    answer = sfetcas.parametric(one, names, ["nodes.B.position"], settings=mesh).solve({})
    for name, value in zip(names, (6e8, HEIGHT), strict=True):
        h, ends = 1e-3 * value, []
        for now in (value - h, value + h):
            key = {name: now} if name.endswith("height") else {"sections.s.law.stress": [*STRESSES[:4], now]}
            ends.append(sfetcas.solve(one.replace(key), mesh).last.position("B"))
        slope = (ends[1] - ends[0]) / (2.0 * h)
        np.testing.assert_allclose(answer.jacobian["nodes.B.position"][name].ravel()[:2], slope[:2], rtol=1e-3)


def test_design():
    """A bar whose force is given: its stress is that of the curve at the strain."""
    bar = scene(STRIP, {"type": "force", "node": "B", "value": [4600.0, 0.0]})
    found = sfetcas.find(bar, {"sections.s.law.stress.4": (5.7e8, 7e8)}, {"nodes.B.position.x": 1.03})
    stress = 5.6e8 + (found.values["sections.s.law.stress.4"] - 5.6e8) * (0.03 - 0.008) / (0.05 - 0.008)
    assert stress * WIDTH * HEIGHT == pytest.approx(4600.0, rel=1e-6)


@needs_compiler
def test_in_c(tmp_path):
    """The program in C agrees with the functions of CasADi to the last digits."""
    one = scene(STRIP, BENT).replace({"members.beam.elements": 1, "members.beam.element": "SFET3"})
    sfetcas.export(one, tmp_path / "c", name="c", arguments=["loads.load0.value"], results=["nodes.B.angle"])
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


@pytest.mark.parametrize("integrator", ["radau-3", "conserving"])
def test_motion_keeps_energy(integrator):
    """A strip under a sudden force along and across; its energies sum to what they were."""
    law = {**COUPLED, "parameters": [5.0]}
    analysis = {"type": "dynamic", "end": 0.2, "integrator": integrator, "accuracy": 1e-4, "output": 0.1}
    one = scene({"law": law, **INERTIA}, {**PULLED, "value": [-1.0, 0.5]}, analysis=analysis)
    motion = sfetcas.solve(one.replace({"members.beam.elements": 1, "members.beam.element": "SFET4"}))
    energies = np.array([instant.energies for instant in motion.steps]).T
    assert energies[:2].max() > 0.005
    # Ten times the accuracy of the positions.
    assert np.abs(energies.sum(axis=0)).max() < 1e-3


# -- what is not accepted --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (
            {**STRIP, "stretch_law": {"type": "table", "strain": [0, 1], "force": [0, 1]}, "stretch": False},
            None,
        ),
        (
            {**STRIP, "law": {**UNEQUAL, "strain": STRAINS[:3], "stress": STRESSES[:3], "about": "b3"}},
            "law.strain: found [-0.06, -0.01, 0.0], accepted: numbers from 0 on, or of both signs with 0",
        ),
        (
            {**STRIP, "stretch_law": {"type": "bilinear", "force": 1.0, "ratio": 0.5}},
            "stretch_law: found beside the law 'stress-strain', which says the axial force of a section that stretches",
        ),
        ({"law": COUPLED, "EA": 10.0}, "law: found 'EA' beside the law 'potential', which says that stiffness"),
        (
            {"law": {**COUPLED, "strains": 2}},
            "law.strains: found 2, accepted: 0, 1 or 3",
        ),
        (
            {"law": {**COUPLED, "strains": 3}},
            "found second derivatives at rest of [1.0, 1.0, 1.0, 100.0, 0.0, 0.0], accepted: a potential",
        ),
        (
            {"law": {"type": "potential", "strains": 1, "potential": lambda k: ca.sumsqr(k) + 3.0 * k[2] * k[3]}},
            "found second derivatives at rest with an eigenvalue of -0.5 beside a diagonal of ones, accepted",
        ),
        (
            {"law": {"type": "potential", "strains": 1, "potential": lambda k: ca.sumsqr(k) + 3.0 * k[3]}},
            "found moments and forces of [0.0, 0.0, 0.0, 3.0] N m and N at rest, accepted: none",
        ),
        (
            {"law": {"type": "potential", "strains": 1, "potential": 3.0}},
            "found 3.0, accepted: a function of the three changes of curvature (twist, about b2, about b3) and the",
        ),
        ({"law": quadratic(MATRIX), "damping": 0.1}, "law: found a potential that couples strains with others at rest"),
    ],
)
def test_refused(section, words):
    if words is None:
        # A law of stretch beside a law of bending that does not know it, as ever.
        assert scene(section, BENT).sections["s"].stretches
        return
    with pytest.raises(SceneError, match=re.escape(words)):
        scene(section, BENT)


def test_curvatures_of_parametric_solvers_are_refused():
    """One moment alone does not say the curvature."""
    for quantity in ("curvature", "strain"):
        with pytest.raises(
            SceneError, match=f"found the {quantity} along a member whose law 'stress-strain' depends on"
        ):
            sfetcas.parametric(scene(STRIP, BENT), ["loads.load0.value"], [f"members.beam.{quantity} at 0.5"])


def test_files(tmp_path):
    """What is written is read again, also a potential with strains."""
    for law in ({"law": COUPLED}, STRIP):
        one = scene(law, BENT)
        sfetcas.dump(one, tmp_path / "a.json")
        assert sfetcas.load(tmp_path / "a.json") == one
