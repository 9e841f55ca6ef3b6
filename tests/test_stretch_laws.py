"""Laws of stretch: bars in closed form, heavy cords by SciPy, oscillators, and every analysis."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_bvp, solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError

pytestmark = pytest.mark.usefixtures("interpreted")

BILINEAR = {"type": "bilinear", "force": 2.0, "ratio": 0.25}
STRAINS, FORCES = [-0.3, -0.1, 0.0, 0.1, 0.3, 0.6], [-0.4, -0.2, 0.0, 1.0, 4.0, 12.0]
TABLE = {"type": "table", "strain": STRAINS, "force": FORCES}
CURVE = PchipInterpolator(STRAINS, FORCES)
STIFFENING = {"type": "potential", "potential": lambda e, p: 5.0 * e**2 + p[0] * e**4, "parameters": [20.0]}


def force_of(law, strain):
    """Axial force by other formulas."""
    if law is BILINEAR:
        return np.sign(strain) * (min(10.0 * abs(strain), 2.0) + 2.5 * max(abs(strain) - 0.2, 0.0))
    return float(CURVE(strain)) if law is TABLE else 10.0 * strain + 80.0 * strain**3


def strain_of(law, force):
    return brentq(lambda e: force_of(law, e) - force, -0.3, 0.8 if law is not TABLE else 0.6, xtol=1e-15)


def bar(law, force=3.0, dimension="plane", **more):
    """A straight member of EI = L = 1 that is clamped and pulled."""
    section = {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0, "rhoA": 1.0, "stretch_law": law}
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {**section, **({"EA": 10.0} if law is BILINEAR else {})}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [force, 0]}},
            **more,
        }
    )


LAWS = pytest.mark.parametrize("law", [BILINEAR, TABLE, STIFFENING], ids=["bilinear", "table", "given"])

# -- equilibria ---------------------------------------------------------------------------------------


@LAWS
@pytest.mark.parametrize(("dimension", "force", "solver"), [("plane", 3.0, "ipopt"), ("space", -0.15, "newton")])
def test_bar_has_the_strain_of_its_law(law, dimension, force, solver):
    found = sfetcas.solve(bar(law, force, dimension), solver=solver).last
    strain = strain_of(law, force)
    assert found.position("B")[0] == pytest.approx(1.0 + strain, abs=1e-10)
    np.testing.assert_allclose(found.along("m", [0.0, 0.4])["strain"][:, 0], strain, atol=1e-10)
    # The work of a force that grows as the law says.
    points, weights = np.polynomial.legendre.leggauss(60)
    energy = 0.5 * strain * (weights @ [force_of(law, 0.5 * strain * (1.0 + x)) for x in points])
    # Kinks lie between the points of the sum.
    assert found.table("members", "m")["energy"] == pytest.approx(energy, rel=1e-3)
    assert found.certificate.stable


@LAWS
def test_heavy_cord_between_hinges(law):
    """Straight when it has no weight, with some bending stiffness: the differential equations by SciPy."""
    weight, bending = 2.0, 0.05
    curve = CURVE if law is TABLE else None
    grid = np.linspace(-0.1, 0.6, 4001)
    forces = np.array([force_of(law, e) for e in grid])

    def strains(n):
        if law is BILINEAR:
            return np.sign(n) * (np.minimum(np.abs(n), 2.0) / 10.0 + np.maximum(np.abs(n) - 2.0, 0.0) / 2.5)
        e = np.interp(n, forces, grid)
        for _ in range(3):
            value, slope = (curve(e), curve(e, 1)) if curve else (10.0 * e + 80.0 * e**3, 10.0 + 240.0 * e**2)
            e = e - (value - n) / slope
        return e

    def slopes(_, state):
        _, _, angle, moment, fx, fy = state
        c, s = np.cos(angle), np.sin(angle)
        long = 1.0 + strains(fx * c + fy * s)
        return np.vstack([long * c, long * s, moment / bending, long * (fx * s - fy * c), 0.0 * fx, 0.0 * fy + weight])

    def ends(a, b):
        return np.array([a[0], a[1], a[3], b[0] - 1.0, b[1], b[3]])

    x = np.linspace(0.0, 1.0, 41)
    start = np.vstack([x, -0.4 * x * (1 - x), -0.4 * (1 - 2 * x), 0.0 * x, 0.0 * x + 1.0, weight * (x - 0.5)])
    exact = solve_bvp(slopes, ends, x, start, tol=1e-8, max_nodes=50_000)
    assert exact.success
    nodes = {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "support": "hinge"}}
    loads = {"w": {"type": "distributed", "member": "m", "value": [0.0, -weight]}}
    scene = bar(law, nodes=nodes, loads=loads).replace({"sections.s.EI3": bending})
    found = sfetcas.solve(scene, accuracy=1e-7).last
    along = found.along("m", [0.3, 0.5])
    np.testing.assert_allclose(along["position"][:, :2], exact.sol([0.3, 0.5])[:2].T, atol=1e-6)
    assert found.reaction("B")[0][0] == pytest.approx(exact.y[4, -1], rel=1e-5)
    np.testing.assert_allclose(along["moment"][:, 2], exact.sol([0.3, 0.5])[3], atol=1e-6)
    assert along["strain"][1, 0] == pytest.approx(strain_of(law, exact.y[4, -1]), rel=1e-5)


def test_tables_tell_where_they_end():
    found = sfetcas.solve(bar(TABLE, 14.0)).last
    assert any("the law of stretch 'table' of section 's' ends at a strain of 0.6" in note for note in found.notes)


def test_what_is_not_convex_is_told():
    """Its force falls beyond 1/sqrt(6) = 0.41: the state to which a displacement leads is kept, and told."""
    law = {"type": "potential", "potential": lambda e: 0.5 * e**2 - 0.5 * e**4}
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0], "support": "clamped"}}
    motions = {"pull": {"node": "B", "displacement": [0.45, 0.0]}}
    scene = bar(law, nodes=nodes, loads={}, motions=motions, analysis={"unstable": "stay"})
    found = sfetcas.solve(scene, element="SFET2", elements=1).last
    assert any("is not convex at a strain of" in note for note in found.notes)


# -- the other analyses -------------------------------------------------------------------------------


def test_parameters_and_design():
    """Strain F0/EA + (F - F0)/(ratio EA)."""
    names = ["sections.s.stretch_law.force", "sections.s.stretch_law.ratio", "sections.s.EA"]
    answer = sfetcas.parametric(bar(BILINEAR), names, ["nodes.B.position"]).solve({})
    slopes = [answer.jacobian["nodes.B.position"][name][0] for name in names]
    np.testing.assert_allclose(slopes, [0.1 - 0.4, -1.0 / 2.5 / 0.25, -0.06], rtol=1e-8)
    # The third value of the table, of both signs.
    at, h = "sections.s.stretch_law.force.4", 1e-4
    slope = sfetcas.parametric(bar(TABLE), [at], ["nodes.B.position"]).solve({}).jacobian["nodes.B.position"][at][0]
    ends = [
        sfetcas.solve(bar({**TABLE, "force": [*FORCES[:4], 4.0 + step, 12.0]})).last.position("B")[0]
        for step in (-h, h)
    ]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2.0 * h), rel=1e-5)
    found = sfetcas.find(bar(STIFFENING), {"sections.s.stretch_law.parameters.0": (1, 90)}, {"members.m.energy": 0.2})
    (p,) = found.values.values()
    strain = brentq(lambda e: 10.0 * e + 4.0 * p * e**3 - 3.0, 0.0, 1.0)
    assert 5.0 * strain**2 + p * strain**4 == pytest.approx(0.2, rel=1e-6)


def test_modes_have_the_tangent():
    """A mass at the end of a pulled bar without mass: it moves along with W''."""
    scene = bar(STIFFENING, 6.0).replace(
        {"sections.s.rhoA": 0.0, "nodes.B.mass": 2.0, "analysis": {"type": "modes", "modes": 2}}
    )
    strain = strain_of(STIFFENING, 6.0)
    along = np.sqrt((10.0 + 240.0 * strain**2) / 2.0)
    assert np.abs(sfetcas.solve(scene).omega / along - 1.0).min() < 1e-6


@pytest.mark.parametrize("integrator", ["radau-3", "conserving"])
def test_mass_on_a_cord(integrator):
    """A mass that is pulled suddenly, against its own differential equation."""
    steps = {"radau-3": 0.02, "conserving": 0.002}[integrator]
    analysis = {"type": "dynamic", "end": 1.5, "output": 0.5, "step": steps, "integrator": integrator}
    mass = 0.0 if integrator == "radau-3" else 1e-6
    scene = bar(STIFFENING).replace({"sections.s.rhoA": mass, "nodes.B.mass": 1.0, "analysis": analysis})
    found = sfetcas.solve(scene, element="SFET2", elements=1)

    def rates(_, state):
        return [state[1], 3.0 - force_of(STIFFENING, state[0])]

    exact = solve_ivp(rates, (0, 1.5), [0.0, 0.0], "DOP853", t_eval=found.times, rtol=1e-11, atol=1e-12).y[0]
    np.testing.assert_allclose(found.positions("B")[:, 0] - 1.0, exact, atol=2e-5)
    assert np.ptp(found.energies()) < 2e-5


@needs_compiler
def test_in_c(tmp_path):
    """The program in C agrees with the functions of CasADi to the last digits."""
    scene = bar(TABLE).replace({"members.m.elements": 1, "members.m.element": "SFET3"})
    at = "sections.s.stretch_law.force.4"
    sfetcas.export(scene, tmp_path / "c", name="c", arguments=[at], results=["nodes.B.position"])
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words


# -- wrong input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        ({"type": "table", "strain": [0, 0.1, 0.2], "force": [0, 1]}, "force: found 2 entries beside 3 of 'strain'"),
        ({"type": "table", "strain": [0.1, 0.2], "force": [0, 1]}, "strain: found .0.1, 0.2., accepted: two or more"),
        ({"type": "table", "strain": [0, 0.1], "force": [0, -1]}, "force: found -1 after 0, accepted: rising numbers"),
        ({"type": "potential", "potential": 3}, "potential: found 3, accepted: a function of the strain that gives"),
        ({"type": "potential", "potential": lambda e: -(e**2)}, "found a second derivative of -2 N at strain 0"),
        ({"type": "potential", "potential": lambda e: e + e**2}, "found a force of 1 N at strain 0, accepted: none"),
        ({"type": "potential", "potential": lambda e, p: e**2}, "parameters: found 0 numbers, accepted: 16"),
    ],
)
def test_wrong_laws(law, sentence):
    with pytest.raises(SceneError, match=rf"sections.s.stretch_law.*{sentence}"):
        bar(law)


def test_what_is_not_solved_is_refused():
    scene = bar(TABLE)
    with pytest.raises(SceneError, match="found 'EA' beside the law 'table', which says that stiffness"):
        scene.replace({"sections.s.EA": 3.0})
    with pytest.raises(SceneError, match="the law 'bilinear' begins with a stiffness, accepted: with the key 'EA'"):
        scene.replace({"sections.s.stretch_law": BILINEAR})
    with pytest.raises(SceneError, match="stretch_law: found beside 'relaxation', accepted: one of them"):
        scene.replace({"sections.s.relaxation": [{"ratio": 0.3, "time": 1.0}]})
    with pytest.raises(SceneError, match="found the member 'm', whose section has a law of stretch, accepted: discs"):
        scene.replace({"tendons.t": {"way": [{"member": "m", "offset": 0.1}], "tension": 1.0}})
    with pytest.raises(SceneError, match="found a section with a law of stretch of a rigid member"):
        scene.replace({"members.m.type": "rigid"})


def test_a_table_that_is_too_steep_is_refused():
    with pytest.raises(SceneError, match=r"found slopes from .* up to 1e\+12 times the smallest"):
        sfetcas.CrossSection(EI3=1.0, stretch_law={"type": "table", "strain": [0, 1e-30, 0.1], "force": [0, 1.0, 60.0]})
