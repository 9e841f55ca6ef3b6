"""What each piece of a model costs: the same structure with it and without; part of ``python -m benchmarks``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sfetcas.description.scene import Analysis, Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.description.springs import Spring
from sfetcas.dynamics.beginning import at_rest
from sfetcas.dynamics.integrating import Stepper
from sfetcas.dynamics.methods import Radau
from sfetcas.dynamics.stages import StageEquations
from sfetcas.dynamics.taken import Memory
from sfetcas.equilibria.single import solve_model
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.masses import masses_of
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import Model, assemble
from sfetcas.solvers.prepared import Prepared
from sfetcas.tradeoff.tables import markdown_table

from .timing import least

__all__ = ["pieces"]


ORDER, ELEMENTS = 4, 8
"""SFET5, elements of each flexible member."""

RUNS = 21


def bar(dimension: str = "plane", **loads: Load) -> Scene:
    """A cantilever with a force of 10 EI/L^2 across it, and further loads."""
    tip = Load(type="force", node="tip", value=[0, 10])
    return Scene(
        dimension=dimension,
        sections={"unit": CrossSection(EI2=1.0, EI3=1.0, GJ=1.0, rhoA=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="unit")},
        loads={"tip": tip, **loads},
    )


def loop(kind: str = "flexible", joint: str = "rigid", dimension: str = "plane") -> Scene:
    """Two clamped posts and a beam between them, of a kind and with joints of a kind, pushed aside."""
    nodes = {
        "A": Node(position=[0, 0], support="clamped"),
        "B": Node(position=[0, 1], joint=joint),
        "C": Node(position=[1, 1.1], joint=joint),
        "D": Node(position=[1, 0], support="clamped"),
    }
    members = {
        "left": Member(nodes=["A", "B"], section="unit"),
        "top": Member(nodes=["B", "C"], section="unit", type=kind),
        "right": Member(nodes=["D", "C"], section="unit"),
    }
    side = Load(type="force", node="B", value=[3, -1])
    return bar(dimension).replace(nodes=nodes, members=members, loads={"side": side})


def _modelled(scene: Scene, assembly: str = "auto", places: bool = False) -> Callable[[], Model]:
    mesh = replace(uniform_mesh(scene, ORDER, ELEMENTS), places=places)
    return lambda: assemble(scene, mesh, assembly=assembly)


def _static(make: Callable[[], Model]) -> tuple[str, ...]:
    """Unknowns, milliseconds of the model, of a solve from the start guess and of one from a near answer."""
    built = least(lambda: Prepared(make()).equations, RUNS)[0]
    prepared = Prepared(make())
    near = solve_model(prepared, 0.97)
    cold = least(lambda: solve_model(prepared), RUNS)[0]
    warm = least(lambda: solve_model(prepared, start=near), RUNS)[0]
    return str(prepared.model.unknowns), *(f"{1e3 * seconds:.2f}" for seconds in (built, cold, warm))


def _moving(inertia: tuple[float, float, float] | None, dimension: str) -> tuple[str, ...]:
    """Unknowns and milliseconds of a step of radau-3 of the cantilever, with and without rotary inertia."""
    section = CrossSection(EI2=1.0, EI3=1.0, GJ=1.0, rhoA=1.0, **({} if inertia is None else {"rhoI": inertia}))
    scene = bar(dimension).replace(sections={"unit": section}, analysis=Analysis(type="dynamic", end=1.0))
    model = assemble(scene, replace(uniform_mesh(scene, ORDER, ELEMENTS), places=True), assembly="nodal")
    system = StageEquations(Equations(model), masses_of(model))
    method = Radau(3)
    stepper, state = Stepper(system, method), at_rest(model)
    x, _ = system.rates(state, system.factors(0.0), np.zeros(system.equations.unknowns))
    memory = Memory(0.0, state.q, state.y, state.lam, x, np.zeros((method.kept, len(x))), state.unwrapped)
    stepper.step(memory, 0.01)
    seconds, _ = least(lambda: stepper.step(memory, 0.01), RUNS)
    return str(system.total), "", "", f"{1e3 * seconds:.2f}"


def pieces() -> None:
    """Unknowns and milliseconds with each piece and without."""
    print(f"What each piece costs, SFET5, {ELEMENTS} elements a member; milliseconds, least of {RUNS}\n")
    weight = Load(type="distributed", member="beam", value=[0, -1])
    follower = Load(type="force", node="tip", value=[1, 0], frame="follower")
    spring = {"spring": Spring(node="B", between=["left", "top"], stiffness=1.0)}
    cases: dict[str, tuple[str, ...]] = {
        "cantilever, plane: bending": _static(_modelled(bar())),
        "the same in space: bending both ways and torsion": _static(_modelled(bar("space"))),
        "positions of all cuts as unknowns, plane": _static(_modelled(bar(), "nodal", True)),
        "positions of all cuts as unknowns, space": _static(_modelled(bar("space"), "nodal", True)),
        "a distributed load, plane": _static(_modelled(bar(weight=weight))),
        "a load without potential, plane": _static(_modelled(bar(push=follower))),
        "portal, closing assembly": _static(_modelled(loop(), "closing")),
        "portal, nodal assembly": _static(_modelled(loop(), "nodal")),
        "portal in space, closing assembly": _static(_modelled(loop(dimension="space"), "closing")),
        "portal in space, nodal assembly": _static(_modelled(loop(dimension="space"), "nodal")),
        "its top small": _static(_modelled(loop("small"))),
        "its top rigid": _static(_modelled(loop("rigid"))),
        "hinges at its top": _static(_modelled(loop(joint="hinge"))),
        "hinges and a spring": _static(_modelled(loop(joint="hinge").replace(springs=spring))),
        "a step of the cantilever, plane, no rotary inertia": _moving(None, "plane"),
        "with rotary inertia": _moving((2e-4, 1e-4, 1e-4), "plane"),
        "a step in space, no rotary inertia": _moving(None, "space"),
        "in space with rotary inertia": _moving((2e-4, 1e-4, 1e-4), "space"),
    }
    heads = ("piece", "unknowns", "model", "cold solve", "warm solve or step")
    print("\n".join(markdown_table(heads, [(name, *cells) for name, cells in cases.items()])))
