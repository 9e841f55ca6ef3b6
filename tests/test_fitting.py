"""Parameters from measurements: what is found, how sure it is, and what is refused."""

import functools
import math

import numpy as np
import pytest
from scenes import cantilever

from sfetcas import (
    Fit,
    Measurement,
    ParametricEquilibrium,
    Scene,
    SceneError,
    SolveError,
    Status,
    fit,
    fitting,
    parametric,
)

NAMES = ["sections.s.EI3", "sections.s.rhoA"]
TRUTH = {"sections.s.EI3": 1.3, "sections.s.rhoA": 0.25}
FORCES = ([0.0, 0.0], [0.0, 2.0])
PLACES = (0.5, 1.0)
NOISE = 2e-3


def scene():
    return Scene.from_dict(cantilever([0.0, 1.0], gravity=[0.0, -9.81]))


@functools.cache
def exact():
    """Points of the strip on the mesh of the fit: what is found has to be the truth."""
    equilibrium = parametric(scene(), [*NAMES, "loads.tip.value"], ["members.m.position"], places={"m": PLACES})
    found = []
    for force in FORCES:
        answer = equilibrium.solve({**TRUTH, "loads.tip.value": force})
        for place, point in zip(PLACES, answer["members.m.position"], strict=True):
            found.append(Measurement(f"members.m.position at {place}", point[:2], NOISE, {"loads.tip.value": force}))
    return tuple(found)


@functools.cache
def prepared():
    return fitting(scene(), NAMES, exact())


def disturbed(size=1.0):
    return prepared().values + size * NOISE * np.random.default_rng(3).standard_normal(len(prepared().values))


def without_deviations():
    return [Measurement(one.quantity, one.value, None, one.case) for one in exact()]


def test_exact_points_give_back_what_made_them():
    found = prepared().fit()
    # Steps shorter than 1e-8 have converged, the next would square them.
    assert found.estimates == pytest.approx(TRUTH, rel=1e-9)
    assert found.chi_square == pytest.approx(0.0, abs=1e-12)
    assert len(prepared().cases) == len(FORCES)
    assert found.notes == ()


def test_least_sum_of_squares_is_least():
    found = prepared().fit(disturbed(5.0))
    here = np.array(list(found.estimates.values()))

    def squares(numbers):
        values = dict(zip(NAMES, numbers, strict=True))
        parts = []
        for force in FORCES:
            point = prepared().equilibrium.solve({**values, "loads.tip.value": force})["members.m.position"]
            parts.append(point[:, :2].ravel())
        return float((((np.concatenate(parts) - found.measured) / NOISE) ** 2).sum())

    assert squares(here) == pytest.approx(found.chi_square, rel=1e-9)
    steps = 1e-3 * np.diag(here)
    for step in steps:
        assert min(squares(here + step), squares(here - step)) > found.chi_square
    # The whole covariance is that of half the second derivatives; by differences, which err by the step squared.
    second = np.array(
        [
            [sum(a * b * squares(here + a * one + b * other) for a in (1, -1) for b in (1, -1)) for other in steps]
            for one in steps
        ]
    )
    second /= 8.0 * np.outer(1e-3 * here, 1e-3 * here)
    assert np.linalg.inv(found.full_covariance) == pytest.approx(second, rel=1e-4)
    # Residuals of five deviations are seen in it.
    assert np.abs(found.covariance / found.full_covariance - 1.0).max() > 1e-3


def test_bounds_of_known_deviations_are_those_of_the_propagated_noise():
    # One number from one point: what noise does is its size over the derivative.
    point = Measurement("nodes.B.position.1", 0.2, NOISE)
    found = fit(scene(), ["loads.tip.value.1"], [point])
    wide = NOISE / abs(found.answers[0].jacobian["nodes.B.position"]["loads.tip.value.1"][1])
    name = "loads.tip.value.1"
    assert found.deviations[name] == pytest.approx(wide, rel=1e-12)
    low, high = found.bounds(0.95)[name]
    assert high - low == pytest.approx(2 * 1.959963985 * wide, rel=1e-9)
    assert found.estimates[name] == pytest.approx(0.5 * (low + high), rel=1e-12)
    assert found.probability is None


def test_unknown_deviations_are_estimated_and_bounds_are_students():
    known, unknown = prepared().fit(disturbed()), fitting(scene(), NAMES, without_deviations()).fit(disturbed())
    assert unknown.estimates == pytest.approx(known.estimates, rel=1e-7)
    freedom = len(known.measured) - 2
    assert unknown.deviation == pytest.approx(NOISE * math.sqrt(known.chi_square / freedom), rel=1e-7)
    # Student's distribution of six degrees of freedom and the normal one, from tables.
    ratio = unknown.deviation / NOISE * 2.446912 / 1.959963985
    for name in NAMES:
        one, other = (np.diff(each.bounds()[name])[0] for each in (unknown, known))
        assert one / other == pytest.approx(ratio, rel=1e-6)
    # Chi-square of six degrees of freedom, in closed form.
    half = 0.5 * known.chi_square
    assert known.probability == pytest.approx(math.exp(-half) * (1.0 + half + 0.5 * half**2), rel=1e-12)


@pytest.mark.parametrize("known", [True, False])
def test_ellipse_has_the_squares_of_its_confidence(known):
    one = prepared() if known else fitting(scene(), NAMES, without_deviations())
    found = one.fit(disturbed())
    curve = found.ellipse(*NAMES, confidence=0.9, points=7) - np.array(list(found.estimates.values()))
    squares = np.einsum("ij,jk,ik->i", curve, np.linalg.inv(found.covariance), curve)
    # Chi-square 2, 90 %; twice F(2, 6), 90 %, from tables to their digits.
    assert squares == pytest.approx(4.60517 if known else 2 * 3.4633, rel=1e-4)
    assert np.diag(found.correlation) == pytest.approx(1.0, rel=1e-12)
    assert abs(found.correlation[0, 1]) < 1.0


def test_what_measurements_do_not_determine_is_named():
    with pytest.raises(SolveError, match=r"do not determine all parameters \(.*rhoA and gravity\.1 may change") as one:
        fit(scene(), [*NAMES, "gravity.1"], exact())
    assert one.value.status is Status.UNDETERMINED
    still = [Measurement("nodes.A.position", [0.0, 0.0], NOISE)]
    with pytest.raises(SolveError, match=r"\(nothing that was measured depends on sections\.s\.EI3\)"):
        fit(scene(), ["sections.s.EI3"], still)


def test_what_ends_at_its_range_has_no_bounds():
    found = fit(scene(), {"sections.s.EI3": (0.5, 1.2), "sections.s.rhoA": None}, exact())
    assert found.estimates["sections.s.EI3"] == pytest.approx(1.2, rel=1e-12)
    assert np.isnan(found.bounds()["sections.s.EI3"]).all()
    assert np.isfinite(found.bounds()["sections.s.rhoA"]).all()
    assert found.notes[0].startswith("sections.s.EI3 is at an end of its range")
    assert found.notes[1].endswith("times as large as their deviations say")
    assert isinstance(found, Fit)


def test_what_was_not_measured_counts_for_nothing():
    whole = exact()[:3]
    third = Measurement(exact()[3].quantity, [np.nan, exact()[3].value[1]], NOISE, exact()[3].case)
    component = Measurement("members.m.position.1 at 1.0", exact()[3].value[1], NOISE, exact()[3].case)
    one, other = fit(scene(), NAMES, [*whole, third]), fit(scene(), NAMES, [*whole, component])
    assert len(one.measured) == len(other.measured) == 7
    assert one.covariance == pytest.approx(other.covariance, rel=1e-9)


TIP = "nodes.B.position"
REFUSED = [
    (NAMES, [("nodes.B.position", [0, 0])], "measurements.0: found .*, accepted: a Measurement"),
    (NAMES, [Measurement("nodes.B.position", "far", 1)], "measurements.0.value: found 'far', accepted: numbers"),
    (NAMES, [], "measurements: found none, accepted: one or more"),
    ([], [Measurement(TIP, [0, 0], 1)], "parameters: found none, accepted: names of numbers of the scene"),
    (NAMES, [Measurement("nodes.C.position", [0, 0], 1)], "answers: nodes.C.position: found 'C', accepted: A, B"),
    (NAMES, [Measurement("members.m.position", [0, 0], 1)], "accepted: members.NAME.position at FRACTION"),
    (NAMES, [Measurement("members.m.position at x", [0, 0], 1)], "accepted: a number after 'at'"),
    (NAMES, [Measurement(TIP, [0, 0, 0, 0], 1)], "measurements.0.value: found .*, accepted: 3 numbers"),
    (NAMES, [Measurement(f"{TIP}.7", 0, 1)], "found the component '7', accepted: x, y, z, 0, 1, 2"),
    (NAMES, [Measurement(TIP, [0, 0], -1)], "measurements.0.deviation: found -1, accepted: above zero"),
    (NAMES, [Measurement(TIP, [0, 0])], "found 2 numbers, accepted: as many as parameters, 2, and one more"),
    (NAMES, [Measurement(TIP, [0, 0], 1), Measurement(TIP, [0, 0])], "deviations of some, accepted: of all, or of no"),
    (NAMES, [Measurement(TIP, [0, 0]), Measurement("nodes.B.angle", 0)], "found m and rad, accepted: a deviation of"),
    (NAMES, [Measurement(TIP, [0, 0], 1, {"sections.s.EI3": 1})], "parameters: found sections.s.EI3 in a case"),
    (NAMES, [Measurement(TIP, [0, 0], 1, {"loads.tip.value": "x"})], "measurements.0.loads.tip.value: found 'x'"),
]


@pytest.mark.parametrize(("names", "measurements", "sentence"), REFUSED)
def test_what_cannot_be_fitted_is_refused(names, measurements, sentence):
    with pytest.raises(SceneError, match=sentence):
        fit(scene(), names, measurements)


def test_other_values_have_to_be_as_many():
    with pytest.raises(SceneError, match=r"^values: found \[1\.0\], accepted: 8 finite numbers$"):
        prepared().fit([1.0])


def test_where_there_is_no_equilibrium_steps_are_shortened(monkeypatch):
    """The search comes to the truth all the same, and says so where there is none at its start."""
    solve, refused = ParametricEquilibrium.solve, []

    def without_far(self, values, start=None):
        if values["sections.s.EI3"] < 1.25:
            refused.append(values)
            raise SolveError(Status.FAILED, "too soft")
        return solve(self, values, start)

    monkeypatch.setattr(ParametricEquilibrium, "solve", without_far)
    found = prepared().fit(start={"sections.s.EI3": 1.9})
    assert refused
    assert found.estimates == pytest.approx(TRUTH, rel=1e-9)
    with pytest.raises(SolveError, match="too soft"):
        prepared().fit()


def test_no_step_leads_through_zero(monkeypatch):
    """What has to be above zero is not asked for below a fifth of what was accepted."""
    solve, asked = ParametricEquilibrium.solve, []

    def noted(self, values, start=None):
        asked.append(float(values["sections.s.EI3"]))
        return solve(self, values, start)

    monkeypatch.setattr(ParametricEquilibrium, "solve", noted)
    found = prepared().fit(start={"sections.s.EI3": 12.0})
    assert found.estimates == pytest.approx(TRUTH, rel=1e-9)
    assert min(asked) > 0.2
