"""Numbers along members by formulas: as polynomials and closed forms say, read without running anything."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from sfetcas import CrossSection, Formula, Scene, SceneError, parametric, solve
from sfetcas.description.sections import breaks, evaluate
from sfetcas.description.shapes import Curvature, end_of
from sfetcas.mechanics.mesh import uniform_mesh


def beam(load=None, section=None, **more):
    table = {
        "sections": {"s": section or {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [2, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"w": {"type": "distributed", "member": "m", "value": [0, 0.5], **(load or {})}},
        "analysis": {"accuracy": 1e-7},
    }
    return Scene.from_dict(table | more)


X = np.linspace(0.0, 1.0, 7)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("2", lambda x, s: 2.0 + 0.0 * x),
        ("-x**2 + 3*(x - 1)/2", lambda x, s: -(x**2) + 1.5 * (x - 1)),
        ("+sin(pi*x) * cos(x) - tan(x/2)", lambda x, s: np.sin(np.pi * x) * np.cos(x) - np.tan(x / 2)),
        ("exp(-s/0.3) + sqrt(s) + log(1 + x)", lambda x, s: np.exp(-s / 0.3) + np.sqrt(s) + np.log(1 + x)),
        ("2**-x", lambda x, s: 2.0**-x),
        ("abs(x - 0.4)", lambda x, s: np.abs(x - 0.4)),
    ],
)
def test_formulas_are_those_of_arithmetic(text, wanted):
    # A length of 2.5 m; the operations are the same.
    np.testing.assert_array_equal(evaluate(Formula(formula=text), X, 2.5), wanted(X, 2.5 * X))


@pytest.mark.parametrize("text", ["1 - 2*x + x**2/2", "1 - s + s**2/8"])
def test_a_load_by_a_formula_is_that_by_its_polynomial(text):
    one, other = (solve(beam({"profile": profile})).last for profile in (text, {"polynomial": [1, -2, 0.5]}))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-12)


@pytest.mark.parametrize(("text", "terms"), [("2 - x", [2, -1]), ("1 + x*(1 - x)", [1, 1, -1])])
def test_a_section_by_a_formula_is_that_by_its_polynomial(text, terms):
    by_formula, by_terms = ({"EI3": each, "rhoA": each} for each in (text, {"polynomial": terms}))
    one, other = (solve(beam(section=section, gravity=[0, -0.2])).last for section in (by_formula, by_terms))
    np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-12)


def test_a_small_load_of_half_a_sine_bends_as_linear_beams_do():
    q, length = 1e-4, 2.0
    answer = solve(beam({"value": [0, q], "profile": "sin(pi*x)"})).last
    # v'' = M / EI of a cantilever: with k = pi / L the tip is at q / k^4 (k^3 L^3 / 3 - k L).
    k = math.pi / length
    wanted = q / k**4 * ((k * length) ** 3 / 3 - k * length)
    assert answer.position("B")[1] == pytest.approx(wanted, rel=1e-6)


def test_a_curvature_by_a_formula_is_that_by_its_coefficients():
    def bent(kappa3, twist):
        shape = {"type": "curvature", "kappa3": kappa3, "twist": twist, "length": 2.0, "start": [1, 0, 0]}
        return end_of(Curvature(**{key: value for key, value in shape.items() if key != "type"}), [0, 0, 0])

    np.testing.assert_allclose(bent("1 - x", "s"), bent([1, -1], [0, 2]), atol=1e-14)
    # The curve by the rule of midpoints, whose error is h^2 / 24 of second derivatives of about 10.
    x = (np.arange(20000) + 0.5) / 20000
    end = [np.mean(np.cos(np.sin(2.0 * x))), np.mean(np.sin(np.sin(2.0 * x))), 0.0]
    np.testing.assert_allclose(bent("cos(s)", [0]), 2.0 * np.array(end), atol=1e-8)


def test_members_of_a_formula_are_lines_of_a_scene():
    shape = {"type": "curvature", "kappa3": "cos(s)", "length": 2.0, "start": [1, 0]}

    end = end_of(Curvature(**{key: value for key, value in shape.items() if key != "type"}), [0, 0, 0])
    member = {"m": {"nodes": ["A", "B"], "section": "s", "shape": shape}}
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": end.tolist()}}
    assert solve(beam(nodes=nodes, members=member)).last.certificate.residual < 1e-9


TEXTS = {
    "1 + sin(20*x)": lambda x: 1 + np.sin(20 * x),
    "exp(-30*x)": lambda x: np.exp(-30 * x),
    "exp(-((x - 0.5)/0.02)**2)": lambda x: np.exp(-(((x - 0.5) / 0.02) ** 2)),
}


@pytest.mark.parametrize("text", TEXTS)
def test_rigid_and_small_members_integrate_formulas(text):
    wanted = [quad(lambda x, k=k: x**k * TEXTS[text](x), 0, 1, points=[0.5], epsabs=1e-13)[0] for k in range(3)]
    table = {
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "springs": {"k": {"type": "rotational", "node": "A", "stiffness": 3.0}},
    }
    stiff = {"EI3": 1e7, "rhoA": text}
    angle = brentq(lambda angle: 3.0 * angle - wanted[1] * math.cos(angle), -2, 2, xtol=1e-14)
    for kind in ("rigid", "small"):
        members = {"m": {"nodes": ["A", "B"], "section": "s", "type": kind}}
        loads = {"w": {"type": "distributed", "member": "m", "value": [0, 1], "profile": text}}
        weight = beam(section=stiff, members=members, loads={}, gravity=[0, 1], **table)
        for scene in (weight, beam(section={"EI3": 1e7}, members=members, loads=loads, **table)):
            answer = solve(scene).last
            # 64 elements of five nodes; a small member of 1e7 N m2 bends by 1e-7.
            np.testing.assert_allclose(answer.reaction("A")[0][1], -wanted[0], atol=1e-7)
            np.testing.assert_allclose(answer.position("B")[1], math.sin(angle), atol=1e-7)
        modes = {"type": "modes", "modes": 1}
        swing = solve(beam(section=stiff, members=members, loads={}, analysis=modes, **table)).omega[0]
        assert swing == pytest.approx(math.sqrt(3.0 / wanted[2]), rel=1e-6)


def test_a_motion_begins_with_a_spin_by_a_formula():
    member = {"nodes": ["A", "B"], "section": "s", "elements": 2}
    more = {"analysis": {"type": "dynamic", "end": 0.1, "step": 0.01}}
    ends = [
        solve(beam(members={"m": {**member, "spin": spin}}, **more)).last.position("B")
        for spin in ("0.5*s**2", {"polynomial": [0, 0, 2]})
    ]
    np.testing.assert_allclose(*ends, atol=1e-12)


def test_elements_end_where_an_absolute_value_has_its_kink():
    formula = Formula(formula="abs(x - 0.4) + abs(sin(2*pi*x))")
    assert breaks(formula) == pytest.approx((0.4, 0.5), abs=1e-15)
    assert breaks(Formula(formula="abs(s - 1)"), 2.5) == pytest.approx((0.4,), abs=1e-15)
    scene = beam({"profile": "abs(x - 0.4)"})
    assert 0.4 in uniform_mesh(scene, 3, 5).cuts["m"]


@pytest.mark.parametrize(("text", "most"), [("exp(-((x - 0.37)/0.005)**2)", 30), ("sin(400*x)", 300)])
def test_what_is_narrow_is_met_by_the_first_mesh(text, most):
    function = {"e": lambda x: np.exp(-(((x - 0.37) / 0.005) ** 2)), "s": lambda x: np.sin(400 * x)}[text[0]]
    wanted = quad(function, 0, 1, points=[0.37], limit=500, epsabs=1e-13)[0]
    answer = solve(beam({"profile": text, "value": [0, 10]}, analysis={})).last
    # 10 N/m along 2 m, by elements that miss the formula by a hundredth at most, to both sides.
    assert answer.reaction("A")[0][1] == pytest.approx(-20 * wanted, abs=2e-3 * 20 * abs(wanted))
    assert len(answer.model.mesh.cuts["m"]) < most
    assert Formula(formula="sin(pi*x)").edges() == ()


def test_a_formula_is_kept_in_files_and_texts():
    scene = beam({"profile": "exp(-s)"})
    assert scene.to_dict()["loads"]["w"]["profile"] == {"formula": "exp(-s)"}
    assert Scene.from_dict(scene.to_dict()) == scene
    assert scene.loads["w"].profile == Formula(formula="exp(-s)")


def test_parameters_go_past_formulas():
    scene = beam({"profile": "sin(pi*x)", "from": 0.25}, {"EI3": "2 - x", "rhoA": 1.0})
    made, h = parametric(scene, {"loads.w.from": (0.1, 0.5)}, ["nodes.B.position"]), 1e-4
    low, high = (made.solve({"loads.w.from": 0.25 + side * h})["nodes.B.position"] for side in (-1, 1))
    slope = made.solve().jacobian["nodes.B.position"]["loads.w.from"]
    # h^2 of third derivatives of about 10.
    np.testing.assert_allclose(slope, (high - low) / (2 * h), atol=1e-6)
    with pytest.raises(SceneError, match=r"found 'sections.s.EI3.formula', accepted: a number of the scene"):
        parametric(scene, ["sections.s.EI3.formula"], ["nodes.B.position"])


ACCEPTED = r"accepted: numbers, x, s, pi, \+ - \* / \*\* \( \) and sin, cos, tan, exp, sqrt, log, abs"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1/x", r"found '1/x', which is no finite number at 0 of the length, accepted: a finite number everywhere"),
        ("sqrt(x - 0.5)", r"found 'sqrt\(x - 0.5\)', which is no finite number at 0 of the length"),
        ("9**9**9", r"found '9\*\*9\*\*9', which is no finite number"),
        ("log(s)", r"found 'log\(s\)', which is no finite number at 0"),
        ("", rf"found '', which is no formula \(.*\), {ACCEPTED}"),
        ("(x", r"found '\(x', which is no formula \(.*\), accepted"),
        ("import os", r"found 'import os', which is no formula"),
        ("__import__('os').getcwd()", r"found .*, in which .* has no meaning, accepted"),
        ("x.real", r"found 'x.real', in which 'x.real' has no meaning"),
        ("y + 1", rf"found 'y \+ 1', in which 'y' has no meaning, {ACCEPTED}"),
        ("sin", r"found 'sin', in which 'sin' has no meaning"),
        ("sin(x, 1)", r"found 'sin\(x, 1\)', in which 'sin\(x, 1\)' has no meaning"),
        ("lambda: 1", r"found 'lambda: 1', in which 'lambda: 1' has no meaning"),
        ("x if x else 1", r"found 'x if x else 1', in which"),
        ("True", r"found 'True', in which 'True' has no meaning"),
        ("1j", r"found '1j', in which '1j' has no meaning"),
        ("1" * 400, r"found '1+\.\.\., with a number that is too large"),
        ("x+" * 300 + "x", r"found 'x.*, which has 601 characters, accepted: up to 500"),
    ],
)
def test_what_is_no_formula_is_refused(text, sentence):
    with pytest.raises(SceneError, match=rf"^loads\.w\.profile: {sentence}"):
        beam({"profile": text})


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("s", r"found 's' in a section, which members of different lengths may share, accepted: a formula of x"),
        ("x - 0.5", r"found -0.5 at 0 of the length, accepted: a number above zero everywhere"),
        ("0.001 - exp(-((x - 0.7312)/0.001)**2)", r"found -0.999 at 0.7312 of the length, accepted: a number above"),
    ],
)
def test_sections_by_wrong_formulas_are_refused(text, sentence):
    with pytest.raises(SceneError, match=f"^EI3: {sentence}"):
        CrossSection(EI3=text)
