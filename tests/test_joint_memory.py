"""Laws with memory of the fibres of sections that stretch: loops of force and moment, steps and motions."""

import numpy as np
import pytest
from scipy.optimize import root

import sfetcas
from sfetcas import Scene

pytestmark = pytest.mark.usefixtures("interpreted")

E, WIDTH, HEIGHT, YIELD = 200e9, 0.02, 0.04, 300e6
AREA = WIDTH * HEIGHT
LENGTH = 3e-6
"""So short that deflections are no lever, a hundred times shorter beside the height would be refused."""
LOOSE = {"type": "elastic-plastic", "stress": YIELD, "ratio": 0.01, "about": "b3"}
FLAT = {"shape": "rectangle", "width": WIDTH, "height": HEIGHT, "E": E, "nu": 0.3, "rho": 7800.0, "stretch": True}
STEEL = {**FLAT, "law": LOOSE}
ROUND = {"shape": "circle", "radius": 0.02, "E": E, "nu": 0.3, "rho": 7800.0, "stretch": True}
FORCE, MOMENT = YIELD * AREA, YIELD * AREA * HEIGHT / 6.0


def scene(section, loads, length=LENGTH, **more):
    """A clamped member."""
    return Scene.from_dict(
        {
            "sections": {"s": section},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [length, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "loads": loads,
            **more,
        }
    )


def loops(section, forces, moments, dimension="plane", **more):
    """A force and a moment that go from value to value, as steps."""
    t = list(range(len(forces) + 1))
    histories = {key: {"t": t, "value": [0.0, *course]} for key, course in (("n", forces), ("m", moments))}
    loads = {
        "n": {"type": "force", "node": "B", "value": [1.0, 0.0], "history": "n"},
        "m": {"type": "moment", "node": "B", "value": 1.0, "history": "m"},
    }
    asked = {"steps": t[1:], "accuracy": 1e-6}
    # All that a uniform section asks for.
    member = {"m": {"nodes": ["A", "B"], "section": "s", "elements": 1, "element": "SFET2"}}
    one = scene(section, loads, histories=histories, analysis=asked, dimension=dimension, members=member, **more)
    return sfetcas.solve(one).steps


class Fibres:
    """A rectangle of fibres with linear kinematic hardening, each by its own return to the yield stress."""

    def __init__(self, count=24, ratio=0.01):
        # Middles of equal parts, spread so that area and second moment are exact.
        self.y = ((np.arange(count) + 0.5) / count - 0.5) * HEIGHT / np.sqrt(1.0 - 1.0 / count**2)
        self.area, self.hardening = AREA / count, E * ratio / (1.0 - ratio)
        self.plastic, self.strains, self.dissipated = np.zeros(count), np.zeros(2), 0.0

    def stress(self, strain, plastic):
        trial = E * (strain - plastic) - self.hardening * plastic
        grown = np.sign(trial) * np.maximum(np.abs(trial) - YIELD, 0.0) / (E + self.hardening)
        return E * (strain - plastic - grown), plastic + grown

    def step(self, force, moment):
        def miss(x):
            stress = self.stress((x[0] - self.y / HEIGHT * x[1]) * 1e-3, self.plastic)[0]
            return [self.area * stress.sum() / FORCE - force / FORCE, (-self.area * stress @ self.y - moment) / MOMENT]

        found = root(miss, self.strains * [1e3, 1e3 * HEIGHT], tol=1e-14)
        assert np.abs(miss(found.x)).max() < 1e-11
        self.strains = found.x * [1e-3, 1e-3 / HEIGHT]
        strain = self.strains[0] - self.y * self.strains[1]
        stress, now = self.stress(strain, self.plastic)
        self.dissipated += self.area * YIELD * np.abs(now - self.plastic).sum()
        self.plastic = now
        stored = 0.5 * self.area * (stress @ stress / E + self.hardening * now @ now)
        return *self.strains, stored, self.dissipated


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_loops_of_force_and_moment(dimension):
    """Pulled, bent, let go and bent back: strains and energies per length are those of fibres."""
    forces = FORCE * np.array([0.5, 0.5, 0.2, -0.6, 0.0])
    moments = MOMENT * np.array([0.0, 1.25, 0.2, -0.9, 0.0])
    found = loops(STEEL, forces.tolist(), moments.tolist(), dimension)
    # One fibre of fifty times as many: what 24 leave.
    fibres, fine = Fibres(), Fibres(1200)
    for step, force, moment in zip(found, forces, moments, strict=True):
        strain, curvature, stored, lost = fibres.step(force, moment)
        told = step.along("m", 0.5)
        np.testing.assert_allclose(told["strain"][0, 0], strain, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(told["curvature"][0, 2], curvature, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(step.energy["elastic"], stored * LENGTH, rtol=1e-8)
        np.testing.assert_allclose(step.energy["dissipated"], lost * LENGTH, rtol=1e-8, atol=1e-12)
        many = fine.step(force, moment)
        assert lost == pytest.approx(many[3], rel=0.02, abs=1e-3 * FORCE * 1e-3)


@pytest.mark.parametrize("n", [0.0, 0.4, -0.7])
def test_ideal_plastic_rectangle(n):
    """Force and moment over those that the section carries alone: at m + n^2 = 1 a small one more bends it without end.

    Of 24 fibres one yields in part: a 24th of the squared plastic moment.
    """
    law = {**LOOSE, "ratio": 1e-4}
    full, ratio = 1.5 * MOMENT, 1.0 - n**2
    steps = loops({**FLAT, "law": law}, [n * FORCE] * 3, [0.0, 0.985 * ratio * full, 1.03 * ratio * full])
    begin = 2.0 * YIELD / E / HEIGHT
    before, beyond = (step.along("m", 0.5)["curvature"][0, 2] / begin for step in steps[1:])
    assert before < 12.0
    assert beyond > 50.0


UP_AND_DOWN = {"type": "superelastic", "stress": YIELD, "strain": 0.01, "unloading": 0.4 * YIELD, "ratio": 0.05}


@pytest.mark.parametrize(
    "section",
    [{**ROUND, "law": {**LOOSE, "ratio": 0.05, "about": "both"}}, {**FLAT, "law": UP_AND_DOWN}],
    ids=["plastic", "superelastic"],
)
def test_bar(section):
    """A force alone goes through the loop of the material; its work is stored or dissipated."""
    area = np.pi * 0.02**2 if section["shape"] == "circle" else AREA
    forces = [0.9, 1.1, 1.2, 0.0, -1.1]
    found = loops(section, [f * YIELD * area for f in forces], [0.0] * len(forces))
    strains = np.array([step.along("m", 0.5)["strain"][0, 0] for step in found])
    begin = YIELD / E
    # Beyond the begin the slope is a twentieth.
    np.testing.assert_allclose(strains[:3], begin * np.array([0.9, 1.0 + 0.1 / 0.05, 1.0 + 0.2 / 0.05]), rtol=1e-9)
    if section["shape"] == "circle":
        np.testing.assert_allclose(strains[3], begin * (1.0 + 0.2 / 0.05 - 1.2), rtol=1e-9)
    else:
        assert abs(strains[3]) < 1e-12
        assert strains[4] == pytest.approx(-strains[1], rel=1e-9)
    first = LENGTH * YIELD * area * (0.5 * begin + 1.05 * (strains[1] - begin))
    assert found[1].energy["elastic"] + found[1].energy["dissipated"] == pytest.approx(first, rel=1e-9)


def test_cantilever_does_work():
    """A force across and along does what is stored and dissipated, on the way up and on the way back."""
    factors = [*np.linspace(0.1, 1.0, 10), *np.linspace(0.9, 0.0, 7)]
    value = [-0.02 * FORCE, 1.35 * MOMENT]
    histories = {"h": {"t": list(range(len(factors) + 1)), "value": [0.0, *map(float, factors)]}}
    loads = {"f": {"type": "force", "node": "B", "value": value, "history": "h"}}
    asked = {"steps": list(range(1, len(factors) + 1)), "accuracy": 1e-3}
    members = {"m": {"nodes": ["A", "B"], "section": "s", "elements": 2, "element": "SFET4"}}
    one = scene(STEEL, loads, 1.0, histories=histories, analysis=asked, members=members)
    steps = sfetcas.solve(one).steps
    places = np.array([[1.0, 0.0], *(step.position("B")[:2] for step in steps)])
    forces = np.outer([0.0, *factors], value)
    work = np.cumsum(np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(places, axis=0), axis=1))
    kept = np.array([step.energy["elastic"] + step.energy["dissipated"] for step in steps])
    assert steps[-1].energy["dissipated"] > 0.1 * kept.max()
    # Trapezoids of ten steps.
    np.testing.assert_allclose(kept, work, atol=0.01 * work.max())


def test_moments_with_memory_beside_stretch():
    """A law of the moment itself does not know the axial force, which strains as EA says."""
    law = {"type": "elastic-plastic", "moment": 1.0, "ratio": 0.2}
    bent, rest = loops({"EI3": 1.0, "EA": 1e4, "law": law}, [50.0, 50.0], [1.5, 0.0], length=1e-3)
    # Moment 1 and beyond it a fifth; elastic unloading.
    for step, curvature in ((bent, 1.0 + 0.5 / 0.2), (rest, 3.5 - 1.5)):
        told = step.along("m", 0.5)
        assert told["curvature"][0, 2] == pytest.approx(curvature, rel=1e-3)
        assert told["strain"][0, 0] == pytest.approx(50.0 / 1e4, rel=1e-5)


def test_motion():
    """A mass that is suddenly pulled along and across: what the force does is motion, stored and dissipated."""
    found, section = [], {**STEEL, "law": {**LOOSE, "ratio": 0.05}}
    loads = {"f": {"type": "force", "node": "B", "value": [0.4 * FORCE, 8.0 * MOMENT]}}
    members = {"m": {"nodes": ["A", "B"], "section": "s", "elements": 1, "element": "SFET4"}}
    one = scene(section, loads, 1.0, members=members).replace({"nodes.B.mass": 100.0})
    for integrator in ("radau-3", "radau-2", "generalised-alpha"):
        asked = {"type": "dynamic", "end": 0.02, "step": 2e-4, "output": 0.002, "integrator": integrator}
        motion = sfetcas.solve(one.replace({"analysis": asked}))
        parts = [step.energy for step in motion.steps]
        balance = np.array([e["kinetic"] + e["elastic"] + e["dissipated"] + e["loads"] for e in parts])
        dissipated = np.array([e["dissipated"] for e in parts])
        size = max(e["elastic"] for e in parts)
        # Of steps of 0.2 ms of integrators of second and third order; 5e-5 of radau-3.
        assert np.abs(balance).max() < 5e-3 * size
        assert dissipated[-1] > 0.1 * size
        assert (np.diff(dissipated) > -1e-9 * size).all()
        found.append((motion.last.position("B"), dissipated[-1]))
    for position, lost in found[1:]:
        np.testing.assert_allclose(position, found[0][0], atol=5e-5)
        assert lost == pytest.approx(found[0][1], rel=0.02)


def test_error_of_a_bar_is_told():
    """Pulled along its length it yields up to some place: in closed form, a kink of the strain within an element."""
    load = {"type": "distributed", "member": "m", "value": [1.7 * FORCE, 0.0]}
    section = {**STEEL, "law": {**LOOSE, "ratio": 0.05}}
    exact = 1.0 + (0.5 * 1.7 + 19.0 * 0.5 * 0.7**2 / 1.7) * FORCE / (E * AREA)
    for accuracy in (1e-4, 1e-6):
        asked = {"steps": [1.0], "accuracy": accuracy}
        found = sfetcas.solve(scene(section, {"q": load}, 1.0, analysis=asked)).last
        error = abs(found.position("B")[0] - exact)
        assert error <= found.certificate.error_estimate <= accuracy
