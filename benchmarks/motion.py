"""Motion measured: error against seconds, cost of a step, start-up; part of ``python -m benchmarks``.

Three problems for which other programs' figures are known, with finite rotary inertia: D1 a pendulum released from
rest, horizontal, L = 1, EI = 0.1, rhoA = 1, rhoI = 1e-4, for 1 s; D2 a beam in flight in the plane, L = 10, EI = 500,
rhoI = 10, pushed by a force and a couple for 2.5 s, for 10 s; D3 an elbow in space, legs of 10, EI = GJ = 1000, pushed
at the corner for 2 s, for 30 s.  All are inextensible here.  Errors are the largest over the time of the free end over
the length, against a far finer run.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sfetcas.description.scene import Analysis, History, Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.dynamics.beginning import at_rest
from sfetcas.dynamics.integrating import Stepper, integrate
from sfetcas.dynamics.methods import GeneralisedAlpha, Method, Radau
from sfetcas.dynamics.sampling import Sampler
from sfetcas.dynamics.stages import StageEquations
from sfetcas.dynamics.taken import Memory
from sfetcas.mathematics.arrays import Array
from sfetcas.mathematics.kernels import Kernels
from sfetcas.mechanics.elements import ELEMENTS
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.masses import masses_of
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble

from .saving import head, row

__all__ = ["PROBLEMS", "TOLERANCES", "motion", "pendulum", "run", "step_cost"]


def pendulum() -> Scene:
    """D1."""
    return Scene(
        gravity=[0, -9.81, 0],
        sections={"strip": CrossSection(EI3=0.1, rhoA=1.0, rhoI=[0, 0, 1e-4])},
        nodes={"hinge": Node(position=[0, 0], support="hinge"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["hinge", "tip"], section="strip")},
        analysis=Analysis(type="dynamic", end=1.0),
    )


def flight() -> Scene:
    """D2."""
    return Scene(
        sections={"strip": CrossSection(EI3=500.0, rhoA=1.0, rhoI=[0, 0, 10])},
        nodes={"low": Node(position=[6, 0]), "tip": Node(position=[0, 8])},
        members={"beam": Member(nodes=["low", "tip"], section="strip")},
        loads={
            "push": Load(type="force", node="low", value=[8, 0], history="pulse"),
            "turn": Load(type="moment", node="low", value=-80.0, history="pulse"),
        },
        histories={"pulse": History(t=[0, 2.5, 20], polynomial=[[1], [0]])},
        analysis=Analysis(type="dynamic", end=10.0),
    )


def elbow() -> Scene:
    """D3."""
    return Scene(
        dimension="space",
        sections={"strip": CrossSection(EI2=1e3, EI3=1e3, GJ=1e3, rhoA=1.0, rhoI=[20, 10, 10])},
        nodes={
            "root": Node(position=[0, 0], support="clamped"),
            "corner": Node(position=[10, 0]),
            "tip": Node(position=[10, 10]),
        },
        members={
            "first": Member(nodes=["root", "corner"], section="strip"),
            "second": Member(nodes=["corner", "tip"], section="strip"),
        },
        loads={"push": Load(type="force", node="corner", value=[0, 0, 50], history="pulse")},
        histories={"pulse": History(t=[0, 1, 2], value=[0, 1, 0])},
        analysis=Analysis(type="dynamic", end=30.0),
    )


PROBLEMS: dict[str, tuple[Callable[[], Scene], float, tuple[tuple[str, int], ...], tuple[str, int, float]]] = {
    "D1 pendulum": (
        pendulum,
        1.0,
        (("SFET4", 4), ("SFET5", 4), ("SFET7", 3), ("SFET7", 4), ("SFET7", 8)),
        ("SFET7", 16, 3e-6),
    ),
    "D2 flight": (flight, 10.0, (("SFET5", 4), ("SFET5", 8), ("SFET7", 8)), ("SFET7", 16, 1e-5)),
    "D3 elbow": (elbow, 10.0, (("SFET3", 4), ("SFET5", 2), ("SFET5", 4), ("SFET5", 8)), ("SFET5", 16, 1e-5)),
}
"""Scene, length, meshes (elements of each member), and mesh and tolerance of the reference."""

TOLERANCES = {"radau-3": (1e-2, 1e-3, 5e-4, 1e-4, 1e-5), "radau-2": (1e-3, 1e-4), "generalised-alpha": (1e-4, 1e-5)}
"""Of steps, relative to the unit of length."""

TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Errors of which the time is printed."""

METHODS: dict[str, Method] = {method.name: method for method in (Radau(3), Radau(2), GeneralisedAlpha())}


def _system(scene: Scene, element: str, elements: int, kernels: Kernels = "auto") -> StageEquations:
    order = ELEMENTS.index(element) + 1
    model = assemble(scene, replace(uniform_mesh(scene, order, elements), places=True), assembly="nodal")
    return StageEquations(Equations(model), masses_of(model), kernels)


def _memory(system: StageEquations, method: Method) -> Memory:
    """At rest, undeformed."""
    state = at_rest(system.model)
    x, _ = system.rates(state, system.factors(0.0), np.zeros(system.equations.unknowns))
    return Memory(0.0, state.q, state.y, state.lam, x, np.zeros((method.kept, len(x))), state.unwrapped)


def run(scene: Scene, name: str, mesh: tuple[str, int], tolerance: float) -> tuple[Array, float, float, int]:
    """Displacements of the tip at a hundred times, seconds to build and to solve, steps."""
    begin = time.perf_counter()
    system = _system(scene, *mesh)
    stepper, unit = Stepper(system, METHODS[name]), system.masses.time
    memory = _memory(system, METHODS[name])
    built = time.perf_counter()
    end = scene.analysis.duration
    kinks = {t for history in scene.histories.values() for t in history.kinks if t < end}
    sampler = Sampler(np.linspace(0.0, end, 101)[1:] / unit, stepper.method.stages)
    course = integrate(
        stepper,
        memory,
        [t / unit for t in sorted({*kinks, end} - {0.0})],
        tolerance=tolerance,
        first=1e-3 * end / unit,
        beyond=np.inf,
    )
    samples, count = [], 0
    for taken in course:
        count += 1
        samples += list(sampler.feed(taken))
    samples += list(sampler.close())
    solved = time.perf_counter()
    place, axes = system.model.segments.place("tip"), system.axes
    tips = np.array([sample.x[axes * place : axes * (place + 1)] for sample in samples])
    return tips * system.model.scales.length, built - begin, solved - built, count


def motion() -> None:
    """Errors against seconds of the problems of the module's docstring."""
    print("Error of motions against far finer runs, over the length; elements of each member; seconds\n")
    head("problem", "elements", "integrator", "tolerance", "error", "build", "integrate", "steps")
    reached = {}
    for name, (make, length, meshes, (element, elements, tolerance)) in PROBLEMS.items():
        exact = run(make(), "radau-3", (element, elements), tolerance)[0]
        best = dict.fromkeys(TARGETS, np.inf)
        for mesh in meshes:
            for method, tolerances in TOLERANCES.items():
                for each in tolerances:
                    tips, build, solve, steps = run(make(), method, mesh, each)
                    error = float(np.abs(tips - exact).max()) / length
                    for target in TARGETS:
                        best[target] = min(best[target], solve if error <= target else np.inf)
                    which = (name, f"{mesh[1]} {mesh[0]}", method, f"{each:.0e}")
                    row(*which, f"{error:.1e}", f"{build:.2f}", f"{solve:.3f}", steps)
        reached[name] = best
    print("\nLeast seconds of the integration to an error of\n")
    head("problem", *(f"{target:.0e}" for target in TARGETS))
    for name, best in reached.items():
        row(name, *(f"{seconds:.3f}" if np.isfinite(seconds) else "-" for seconds in best.values()))


def step_cost() -> None:
    """Milliseconds of a step of a spatial cantilever and of the elbow, and of many elements in the plane."""
    print("One step of a motion; medians\n")
    head("scene", "elements", "unknowns", "integrator", "kernels", "build, s", "ms a step", "iterations")
    cantilever = elbow().replace(
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[10, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="strip")},
        loads={"push": Load(type="force", node="tip", value=[0, 10, 30], history="pulse")},
    )
    strip = flight().replace(loads={"push": Load(type="force", node="tip", value=[0, 5])})
    cases: list[tuple[str, Scene, str, int, str, Kernels]] = [
        (scene_name, scene, "SFET5", count, method, kernels)
        for scene_name, scene, count in (("cantilever", cantilever, 8), ("elbow", elbow(), 4))
        for method in METHODS
        for kernels in ("core", "compiled", "interpreted")
    ]
    for n in (50, 500, 5000):
        cases += [
            ("plane strip", strip, "SFET3", n, "generalised-alpha", kernels) for kernels in ("core", "interpreted")
        ]
    for name, scene, element, elements, method, kernels in cases:
        begin = time.perf_counter()
        system = _system(scene, element, elements, kernels)
        stepper, memory = Stepper(system, METHODS[method]), _memory(system, METHODS[method])
        built = time.perf_counter() - begin
        h, spent, count = 0.02 / system.masses.time, [], 0
        for _ in range(20 if elements > 100 else 100):
            start = time.perf_counter()
            taken = stepper.step(memory, h)
            spent.append(time.perf_counter() - start)
            memory, count = taken.after, count + taken.iterations
        which = (name, f"{elements} {element}", system.total, method, kernels)
        row(*which, f"{built:.2f}", f"{1e3 * statistics.median(spent):.3f}", f"{count / len(spent):.1f}")
