"""Time steps by the core against the same equations as CasADi functions, and against runs that have no core."""

import gc
import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motions import FLAT, METHODS, THICK, cantilever
from scenes import made
from systems import EVERYTHING

import sfetcas
from sfetcas import Scene, assemble, uniform_mesh
from sfetcas.dynamics.beginning import at_rest
from sfetcas.dynamics.integrating import Stepper
from sfetcas.dynamics.stages import StageEquations
from sfetcas.dynamics.taken import Memory
from sfetcas.mathematics import core as c
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.masses import masses_of

PROBLEMS = Path(__file__).parent.parent / "problems"

PARTS = ("last_q", "last_y", "rows", "turns", "shifts", "there", "rates", "size", "iterations", "gap")

ROUNDING = 1e-10
"""Share of the largest of their kind by which results may differ: rounding of a step in unknowns times the condition
of what it solves, which stiff members under small masses make some 1e5."""


@pytest.fixture(autouse=True)
def library():
    if c.core() is None:
        pytest.skip("no core here, and no compiler that makes one")


def alike(memory, h, mine, other):
    """A step by the core is the one of the function."""
    mine, other = (dict(zip(PARTS, map(np.ravel, step), strict=True)) for step in (mine, other))
    assert np.isfinite(other["size"]).all() == np.isfinite(mine["size"]).all()
    if not np.isfinite(other["size"]).all():
        return
    assert mine["iterations"] == other["iterations"]
    # What is left of a last change may be rounding, which is that of unknowns.
    assert abs(mine["size"][0] - other["size"][0]) <= 1e-6 * other["size"][0] + ROUNDING
    assert abs(mine["gap"][0] - other["gap"][0]) <= 1e-12 + ROUNDING * other["gap"][0]
    # Rates are changes over lengths of steps, and forces accelerations times masses: rounding of places, some 5e-15
    # as the function does not refine, is divided, and multiplied by numbers of the method, up to a hundred.
    blurred = 5e-13 * max(1.0, float(np.abs(memory.x).max()))
    divided = {"rates": h ** -len(memory.rates), "rows": h**-2}
    for name in PARTS[:7]:
        size = max(1.0, float(np.abs(other[name]).max(initial=0.0)))
        rounded = blurred * divided.get(name, 1.0)
        # Forces of a step so short that they are rounding for the most part hang on the processor.
        if rounded > 0.1 * size:
            continue
        bound = ROUNDING * size + rounded
        assert np.abs(mine[name] - other[name]).max(initial=0.0) <= bound, name


def checked(monkeypatch, every):
    """Compares each so-many-th step that the core takes from now on; the list grows with them."""
    compared, step = [], Stepper.step

    def taken(self, memory, h):
        core = self._by_core
        assert core is not None
        if self.count % every:
            return step(self, memory, h)

        def both(*given):
            mine, other = core(*given), self._by_function(*given)
            compared.append(mine)
            alike(memory, h, mine, other)
            return mine

        monkeypatch.setattr(self, "_by_core", both)
        try:
            return step(self, memory, h)
        finally:
            monkeypatch.setattr(self, "_by_core", core)

    monkeypatch.setattr(Stepper, "step", taken)
    return compared


def motion_of(table):
    return made({**table, "analysis": {"type": "dynamic", "end": 1.0}})


def model_in_motion(table, order):
    """The model of a scene whose prescribed motions begin at rest."""
    driven = {key: {**motion, "history": "on"} for key, motion in table.get("motions", {}).items()}
    more = {"motions": driven, "histories": {"on": {"t": [0, 1], "polynomial": [[0, 0, 1]]}}} if driven else {}
    scene = motion_of({**table, **more})
    return assemble(scene, replace(uniform_mesh(scene, order, 2), places=True), assembly="nodal")


def begun(model, method):
    """A stepper and the state at rest."""
    system = StageEquations(Equations(model), masses_of(model))
    stepper, state = Stepper(system, METHODS[method]), at_rest(model)
    x, _ = system.rates(state, system.factors(0.0), np.zeros(system.equations.unknowns))
    rates = np.zeros((stepper.method.kept, len(x)))
    return stepper, Memory(0.0, state.q, state.y, state.lam, x, rates, state.unwrapped, remembered=system.memory.begun)


@pytest.mark.parametrize("method", ["radau-3", "radau-2", "generalised-alpha"])
@pytest.mark.parametrize("name", EVERYTHING)
def test_steps_are_those_of_the_function(name, method, monkeypatch):
    """Every kind of term: a step from rest under sudden loads, and a longer one from there."""
    stepper, memory = begun(model_in_motion(EVERYTHING[name](), 2), method)
    compared = checked(monkeypatch, 1)
    first = stepper.step(memory, 0.02)
    second = stepper.step(first.after, 0.025)
    assert second.converged
    assert len(compared) == 2
    # It moves, by a change that the second step is to expect from the first.
    assert np.abs(second.turns).max(initial=0.0) + np.abs(second.shifts).max(initial=0.0) > 1e-5


STRETCHING = {"EA": 400.0, "GA2": 150.0, "GA3": 180.0}
BRANCHES = [{"ratio": 0.3, "time": 0.2}, {"ratio": 0.2, "time": 1.0}]
LOOSE = {"type": "elastic-plastic", "stress": 1.0, "ratio": 0.05, "about": "b3"}
FIBRES = {"shape": "rectangle", "width": 0.2, "height": 0.4, "E": 1e3, "nu": 0.3, "rho": 1.0, "stretch": True}


def wheel(**more):
    """A rigid bar that a moment drives round against a spring and a damper in its hinge, beyond half a turn."""
    return {
        "sections": {"bar": {"rhoA": 2.0, "rhoI": [0.1, 0.1, 0.1]}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [0.5, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "bar"}},
        "springs": {"s": {"node": "A", "stiffness": 0.2, "damping": 0.1}},
        "loads": {"d": {"type": "moment", "node": "A", "value": 3.0}},
        **more,
    }


def yielding():
    """A light strip that its end force bends beyond yield at once."""
    table = cantilever({**FIBRES, "law": LOOSE}, (0.01, 0.05))
    del table["loads"]["tip"]["history"]
    return table


def bowl(kind):
    """A heavy point thrown aslant onto the inside of what is round and rough, on a short body."""
    place = [0.4, -0.9, 0.0]
    size = float(np.hypot(*place[:2]))
    aslant = {"velocity": [0.45, 0.2, 0.6]}
    return {
        "gravity": [0, -10.0],
        "nodes": {
            "B": {"position": place, "mass": 2.0, "inertia": [0.01, 0.02, 0.01], **aslant},
            "C": {"position": [0.35, -0.8, 0.0], **aslant},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}},
        "contacts": {
            "bowl": {
                "type": kind,
                "center": [0, 0],
                "radius": size,
                "side": "inside",
                "members": "all",
                "friction": 0.15,
            }
        },
        "dimension": "space",
    }


def between():
    """A bar thrown aslant, one end on a rough floor that moves, the other inside a rough ball."""
    aslant = {"velocity": [0.0, 0.0, 0.7], "inertia": [0.01, 0.02, 0.01]}
    rough = {"member": "bar", "friction": 0.2}
    return {
        "gravity": [0, -10.0],
        "nodes": {
            "B": {"position": [0.0, 0.0, 0.0], "mass": 2.0, **aslant},
            "C": {"position": [0.4, 0.3, 0.0], "mass": 1.0, **aslant},
            "motor": {"position": [0.3, -0.5, 0.0], "support": "clamped"},
            "D": {"position": [2.0, 1.0, 0.0], "support": "ball"},
            "E": {"position": [2.0, 0.8, 0.1], "mass": 1.0, "inertia": [0.01, 0.02, 0.01]},
        },
        "members": {"bar": {"nodes": ["B", "C"], "type": "rigid"}, "far": {"nodes": ["D", "E"], "type": "rigid"}},
        "contacts": {
            "ball": {"type": "sphere", "center": [0.0, 0.3], "radius": 0.4, "side": "inside", **rough},
            "belt": {"type": "plane", "point": [0, 0], "normal": [0, 1], "node": "motor", **rough},
            "post": {"type": "sphere", "center": [3.0, 0.0], "radius": 0.4, "member": "far", "friction": 0.1},
        },
        "motions": {"runs": {"node": "motor", "displacement": [1, 0, 0], "history": "on"}},
        "histories": {"on": {"t": [0, 1], "polynomial": [[0, 0, 1]]}},
        "dimension": "space",
    }


def on(value=(1.0, 2.0), **section):
    return cantilever({**FLAT, **section}, value)


MOTIONS = {
    "damped": (on(damping=0.05), 0.4),
    "dragged": (on(drag=0.5), 0.4),
    "relaxing": (on(relaxation=BRANCHES), 0.4),
    "stretching": (on(**STRETCHING, damping=0.05), 0.4),
    "space": (cantilever({**THICK, **STRETCHING, "relaxation": BRANCHES, "damping": 0.02}, (1.0, 2.0, 0.5)), 0.2),
    "memory": (yielding(), 0.2),
    "wheel": (wheel(), 0.8),
    "wheel in space": (wheel(dimension="space"), 0.8),
    "cylinder": (bowl("cylinder"), 0.4),
    "sphere": (bowl("sphere"), 0.4),
    "between": (between(), 0.2),
    "rotating": (on(damping=0.05) | {"rotating": [0, 0, 1.5]}, 0.4),
    "rotating in space": (
        cantilever({**THICK, **STRETCHING}, (1.0, 2.0, 0.5), rotating=[0.3, 0.5, 1.5], dimension="space"),
        0.2,
    ),
    "rotating bar": (wheel(dimension="space", rotating=[0.2, 1.0, 0.5]), 0.4),
    "rotating parts": (EVERYTHING["small_space"]() | {"rotating": [0.4, 0.6, 0.5]}, 0.1),
    "rough in rotating axes": (between() | {"rotating": [0.2, 0.3, 0.4], "gravity": [0, -30.0]}, 0.2),
}
PROBLEMS_WITH = {
    "bob_on_a_string": "what is slack at times",
    "ladder_leaves_wall": "places on obstacles",
    "bars_collide": "members that collide",
    "slider_crank_motion": "a crank that is driven round",
    "flying_rod": "what flies freely",
    "block_on_incline": "what slides and sticks",
    "belt_drags_block": "what a moving obstacle drags along",
    "ladder_on_rough_floor": "two places that slide",
}


@pytest.mark.parametrize("integrator", ["radau-3", "generalised-alpha"])
@pytest.mark.parametrize("name", MOTIONS)
def test_motions_are_those_of_the_function(name, integrator, monkeypatch):
    compared = checked(monkeypatch, 1)
    table, end = MOTIONS[name]
    scene = Scene.from_dict(
        {
            **table,
            "analysis": {"type": "dynamic", "end": end, "step": end / 16, "output": end, "integrator": integrator},
        }
    )
    assert sfetcas.solve(scene, element="SFET3", elements=2).status.name == "SOLVED"
    assert len(compared) >= 16


@pytest.mark.parametrize("name", PROBLEMS_WITH)
def test_problems_are_those_of_the_function(name, monkeypatch):
    compared = checked(monkeypatch, 9)
    scene = sfetcas.load(PROBLEMS / f"{name}.toml").replace({"analysis.accuracy": 1e-3})
    assert sfetcas.solve(scene).status.name == "SOLVED"
    assert len(compared) >= 3


def test_steps_from_what_is_no_state_do_not_converge():
    stepper, memory = begun(model_in_motion(on(), 2), "radau-3")
    for bad in (np.nan, np.inf):
        for name in ("q", "x", "rates"):
            there = replace(memory, **{name: np.full_like(getattr(memory, name), bad)})
            assert not stepper.step(there, 0.02).converged
    # Nothing of it is left.
    assert stepper.step(memory, 0.02).converged


def test_a_matrix_without_an_inverse_leaves_no_numbers():
    """Steps so short that masses over their square are beyond all numbers."""
    stepper, memory = begun(model_in_motion(on(), 2), "radau-3")
    taken = stepper.step(memory, 1e-200)
    assert not taken.converged
    assert not np.isfinite(taken.after.x).any()


WITHOUT = ["damped", "space", "wheel"]


@pytest.mark.parametrize("name", WITHOUT)
def test_motions_without_the_core(name, monkeypatch):
    """By the accuracy: the same steps, and the same answers to rounding that steps divide."""
    table, end = MOTIONS[name]
    scene = Scene.from_dict({**table, "analysis": {"type": "dynamic", "end": end, "output": end, "accuracy": 1e-4}})
    mine = sfetcas.solve(scene)
    monkeypatch.setenv("SFETCAS_CORE", "off")
    other = sfetcas.solve(scene)
    assert mine.status is other.status is sfetcas.Status.SOLVED
    np.testing.assert_allclose(mine.last.position("B"), other.last.position("B"), atol=1e-9)
    np.testing.assert_allclose(mine.last.velocity("B"), other.last.velocity("B"), atol=1e-7)


@pytest.mark.parametrize("name", [*EVERYTHING, "stretching", "wheel in space"])
def test_quantities_in_numbers_are_those_of_expressions(name):
    """At a state far from the undeformed one, with prescribed motions on their way."""
    table = MOTIONS[name][0] if name in MOTIONS else EVERYTHING[name]()
    model = model_in_motion(table, 3)
    system = StageEquations(Equations(model), masses_of(model))
    step, factors = np.random.default_rng(1).normal(size=system.equations.total), system.factors(0.4)
    state = system.equations.moved(at_rest(model), 0.3 * step)
    unknowns = step[: system.equations.unknowns]
    x, _ = system.rates(state, factors, unknowns)
    assert np.abs(x).max() > 0.1
    np.testing.assert_allclose(system.rates(state, factors, 0.0 * unknowns)[0], x, atol=1e-14)


@pytest.mark.parametrize("method", ["radau-3", "generalised-alpha"])
def test_steps_keep_nothing_of_those_long_before(method):
    stepper, memory = begun(model_in_motion(on(), 2), method)
    taken = stepper.step(memory, 0.02)
    first = weakref.ref(taken)
    memory = stepper.step(taken.after, 0.02).after
    del taken
    assert memory.last is not None
    gc.collect()
    assert first() is None
    memory = stepper.step(memory, 0.02).after
    assert memory.last.h == 0.02
