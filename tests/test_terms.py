"""A kind of energy that the library does not know is one class and one source, and works in every analysis."""

import re
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from motions import FLAT, THICK, Flight
from scenes import cantilever
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene
from sfetcas.dynamics import conserving
from sfetcas.mechanics import model
from sfetcas.mechanics.terms import One, Term
from sfetcas.solvers.globalised import Code

SIZE = 2.3
"""Dipole times field, N m."""


@dataclass(frozen=True)
class Dipole(Term):
    """A dipole that turns with a rotation, in a uniform field; data: the dipole, load: the field."""

    @property
    def sizes(self):
        return 1, 0, 0, self.axes, self.axes

    def energy(self, q, u, data, load):
        return -ca.dot(load, ca.vertcat(*self.forth(q[0], ca.vertsplit(data))))


@pytest.fixture(autouse=True)
def magnet(monkeypatch):
    """A dipole along x at the node B of every scene, in a field along y."""

    def source(parts):
        x, y = np.eye(parts.element.axes)[:2]
        field = SIZE / parts.scales.moment * y
        yield One(Dipole(parts.element.space), "magnet", "B", x, (parts.rotations.node_turn["B"],), loads={None: field})

    monkeypatch.setattr(model, "SOURCES", [*model.SOURCES, source])


def strip(**more):
    """A strip that nothing else loads: statics asks for a load."""
    return Scene.from_dict({**cantilever((0.0, 0.0)), **more})


def bent(size=SIZE, ei=1.0):
    """Angle at the end of a strip of one metre that the dipole bends to an arc: angle EI / L = m B cos(angle)."""
    angle = 0.5
    for _ in range(50):
        angle -= (angle * ei - size * np.cos(angle)) / (ei + size * np.sin(angle))
    return angle


def needle(tip=(0, 1), **analysis):
    """A rigid bar of 1 kg/m on a hinge, its dipole across it."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": list(tip)}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "rigid"}},
            "analysis": analysis,
        }
    )


MOTOR = {"motor": sfetcas.Load(type="moment", node="A", value=0.0)}
INERTIA = 1.0 / 3.0
"""Of the bar about its hinge, kg m2."""


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("solver", ["ipopt", "newton"])
def test_statics(dimension, solver):
    sections = {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0}}
    found = sfetcas.solve(strip(dimension=dimension, sections=sections), solver=solver, accuracy=1e-9).last
    angle = bent()
    exact = [np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle]
    np.testing.assert_allclose(found.position("B")[:2], exact, atol=1e-9)
    assert found.reaction("A")[1][2] == pytest.approx(-angle, abs=1e-8)
    assert found.potential == pytest.approx(0.5 * angle**2 - SIZE * np.sin(angle), abs=1e-8)
    assert found.certificate.stable


def test_path():
    path = sfetcas.solve(strip(analysis={"type": "path", "range": [0, 1.0]}))
    positions = path.positions("B")
    assert len(positions) > 3
    for factor, place in zip(path.main.factors, positions, strict=True):
        # The chord of an arc has half the angle of its end.
        assert np.arctan2(*place[1::-1]) == pytest.approx(0.5 * bent(SIZE * factor), abs=1e-5)


def test_modes():
    """A needle held by a spring swings by both: k + m B sin(angle), at the angle to which they bring it."""
    spring = sfetcas.Spring(type="rotational", node="A", stiffness=1.7)
    modes = sfetcas.solve(needle((1, 0), type="modes", modes=1).replace(loads=MOTOR, springs={"k": spring}))
    stiffness = 1.7 + SIZE * np.sin(bent(ei=1.7))
    assert modes.omega[0] == pytest.approx(np.sqrt(stiffness / INERTIA), rel=1e-9)


@pytest.mark.parametrize("integrator", ["radau-3", "conserving", "idas"])
def test_motion(integrator):
    """From rest across the field the needle swings as a pendulum does: its energy gives its speed at any angle."""
    scene = needle((1, 0), type="dynamic", end=0.9, integrator=integrator, accuracy=1e-5)
    motion = sfetcas.solve(scene)
    for instant in motion.steps[1:]:
        angle = np.arctan2(*instant.position("B")[1::-1])
        speed = np.linalg.norm(instant.velocity("B"))
        # The dipole lies along the bar, so that it has lost SIZE sin(angle).
        assert 0.5 * INERTIA * speed**2 == pytest.approx(SIZE * np.sin(angle), abs=2e-3)
        assert angle > 0.0


@pytest.mark.parametrize("section", [FLAT, THICK], ids=["plane", "space"])
def test_energy_kept(section, monkeypatch):
    """With derivatives at both ends of a step, exact for a vector that turns, no energy is lost; in the middle some."""
    scene, lost = {**cantilever((0.0, 0.0)), "sections": {"s": section}}, []
    for where in ("middle", "ends"):
        monkeypatch.setattr(Dipole, "discrete", where)
        conserving._between.cache_clear()
        flight = Flight(scene)
        lost.append(np.ptp([flight.energy(memory) for memory in flight.steps(0.005, 50)]))
    assert lost[1] < 1e-12 < 1e-6 < lost[0]


def test_parameters():
    """Derivatives of the angle at the end by the stiffness, from the equation that it solves."""
    family = sfetcas.parametric(strip(), ["sections.s.EI3"], ["nodes.B.angle"])
    answer = family.solve({"sections.s.EI3": 1.3})
    angle = bent(ei=1.3)
    assert answer["nodes.B.angle"] == pytest.approx(angle, abs=1e-6)
    slope = answer.jacobian["nodes.B.angle"]["sections.s.EI3"].item()
    assert slope == pytest.approx(-angle / (1.3 + SIZE * np.sin(angle)), abs=1e-5)


def test_design():
    """The stiffness that lets the end turn by half a radian."""
    found = sfetcas.find(strip(), {"sections.s.EI3": (0.5, 20.0)}, {"nodes.B.angle": 0.5})
    assert found.values["sections.s.EI3"] == pytest.approx(SIZE * np.cos(0.5) / 0.5, rel=1e-5)


def test_optimal_control():
    """A torque that turns the needle into the field gains what the field does not give."""
    scene = needle((1, 0)).replace(loads=MOTOR)
    problem = sfetcas.OptimalControl(scene, {"loads.motor.value": (-9, 9)}, time=1.5, intervals=12)
    problem.minimise(problem.integral(problem.control("loads.motor.value") ** 2))
    problem.subject_to(problem.at_tf(problem.answer("nodes.B.angle")) == 0.5 * np.pi, name="turned")
    problem.rest_at_end()
    found = problem.solve(replay=False)
    angle = found.answer("nodes.B.angle").ravel()
    work = np.trapezoid(found.control("loads.motor.value"), np.interp(found.ends, found.times, angle))
    assert work == pytest.approx(-SIZE, rel=2e-2)


@needs_compiler
def test_exported_code(tmp_path):
    """The process of the same functions has the answer, and the program in C agrees with it to the last digits."""
    solver = sfetcas.export(strip(), tmp_path / "c", name="c", arguments=["sections.s.EI3"], results=["nodes.B.angle"])
    outcome, results = solver.solve([1.3])
    assert outcome.code is Code.SOLVED
    assert results[0] == pytest.approx(bent(ei=1.3), abs=1e-5)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words
