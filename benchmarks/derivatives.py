"""Derivatives by ten numbers against solves, and against differences; part of ``python -m benchmarks``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sfetcas.description.scene import Analysis, Load, Member, Motion, Node, Scene
from sfetcas.description.sections import CrossSection, Table
from sfetcas.description.shapes import Arc
from sfetcas.description.springs import Spring
from sfetcas.equilibria.statics import solve
from sfetcas.mathematics.arrays import Array
from sfetcas.parametric.solving import ParametricAnswer, parametric
from sfetcas.tradeoff.tables import markdown_table

from .timing import least

__all__ = ["derivatives"]

RUNS = 21

EXACT = Analysis(accuracy=1e-6)

POST, TOP = CrossSection(EI2=1.0, EI3=1.0, GJ=0.8), CrossSection(EI2=3.0, EI3=2.0, GJ=1.5)


def bar(dimension: str = "plane", **more: Any) -> Scene:
    """A cantilever with a force of 10 EI/L^2 across it, and what else it is given."""
    parts: dict[str, Any] = {
        "sections": {"unit": TOP},
        "nodes": {"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        "members": {"beam": Member(nodes=["root", "tip"], section="unit")},
        "loads": {"tip": Load(type="force", node="tip", value=[0, 10])},
    }
    return Scene(dimension=dimension, analysis=EXACT, **(parts | more))


def tapered() -> tuple[Scene, list[str]]:
    """A cantilever of varying stiffness with weight, a force and a moment."""
    section = CrossSection(EI3=Table(at=(0.0, 0.3, 0.6, 1.0), value=(2.0, 1.6, 1.2, 1.0)), rhoA=0.3)
    loads = {"turn": Load(type="moment", node="tip", value=0.5), "tip": Load(type="force", node="tip", value=[0, 10])}
    scene = bar(sections={"unit": section}, gravity=[0, -2.0], loads=loads)
    names = ["sections.unit.EI3.value", "sections.unit.rhoA", "loads.tip.value", "loads.turn.value", "gravity.1"]
    return scene, [*names, "factor"]


def turned() -> tuple[Scene, list[str]]:
    """A cantilever in space whose clamp turns."""
    tip = Load(type="force", node="tip", value=[0.3, 6, 3])
    clamp = Motion(node="root", rotation=[0.2, -0.3, 0.1])
    scene = bar("space", loads={"tip": tip}, motions={"clamp": clamp})
    names = [f"sections.unit.{key}" for key in ("EI2", "EI3", "GJ")]
    return scene, [*names, "loads.tip.value", "motions.clamp.rotation", "factor"]


def portal(dimension: str) -> tuple[Scene, list[str]]:
    """Two posts and a beam, with unlike sections and springs at the corners."""
    nodes = {
        "A": Node(position=[0, 0], support="clamped"),
        "B": Node(position=[0, 1]),
        "C": Node(position=[1, 1.1]),
        "D": Node(position=[1, 0], support="clamped"),
    }
    ends = {"left": ["A", "B"], "top": ["B", "C"], "right": ["D", "C"]}
    members = {name: Member(nodes=pair, section=name) for name, pair in ends.items()}
    sections = {"left": POST, "top": TOP, "right": POST}
    springs = {
        name: Spring(type="translational", node=name, direction=[1, 0], stiffness=1.0, rest=0.1) for name in ("B", "C")
    }
    loads = {
        "side": Load(type="force", node="B", value=[3, -1]),
        "down": Load(type="distributed", member="top", value=[0, -2]),
    }
    scene = bar(dimension, nodes=nodes, members=members, sections=sections, springs=springs, loads=loads)
    names = [f"sections.{name}.EI3" for name in sections]
    names += [f"springs.{name}.{key}" for name in springs for key in ("stiffness", "rest")]
    return scene, [*names, "loads.side.value.0", "loads.side.value.1", "loads.down.value.1"]


def linkage() -> tuple[Scene, list[str]]:
    """A crank, a flexible coupler and a flexible follower, with springs at all hinges."""
    nodes = {
        "A": Node(position=[0, 0], support="hinge"),
        "B": Node(position=[0, 0.6], joint="hinge"),
        "C": Node(position=[1, 0.8], joint="hinge"),
        "D": Node(position=[1.1, 0], support="hinge"),
    }
    members = {
        "crank": Member(nodes=["A", "B"], type="rigid"),
        "coupler": Member(nodes=["B", "C"], section="top"),
        "follower": Member(nodes=["D", "C"], section="left", shape=Arc(angle=0.4)),
    }
    springs = {
        "a": Spring(node="A", stiffness=1.0, rest=0.2),
        "b": Spring(node="B", stiffness=0.5, between=["crank", "coupler"]),
        "d": Spring(node="D", stiffness=0.7),
    }
    loads = {"push": Load(type="force", node="C", value=[0.6, -0.4])}
    sections = {"left": POST, "top": TOP}
    scene = bar(sections=sections, nodes=nodes, members=members, springs=springs, loads=loads)
    names = [f"springs.{name}.{key}" for name in springs for key in ("stiffness", "rest")]
    return scene, [*names, "loads.push.value", "sections.left.EI3", "sections.top.EI3"]


def bend() -> tuple[Scene, list[str]]:
    """The 45-degree bend under an oblique force."""
    end = [100.0 * np.sin(np.pi / 4), 100.0 * (1.0 - np.cos(np.pi / 4))]
    scene = bar(
        "space",
        sections={"unit": CrossSection(EI2=8e5, EI3=9e5, GJ=7e5, rhoA=0.01)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=end)},
        members={"beam": Member(nodes=["root", "tip"], section="unit", shape=Arc(angle=np.pi / 4))},
        loads={"tip": Load(type="force", node="tip", value=[20, -30, 500])},
        gravity=[1.0, -1.0, -3.0],
    )
    names = [f"sections.unit.{key}" for key in ("EI2", "EI3", "GJ", "rhoA")]
    return scene, [*names, "loads.tip.value", "gravity"]


CASES: dict[str, Callable[[], tuple[Scene, list[str]]]] = {
    "cantilever, plane": tapered,
    "portal, plane": lambda: portal("plane"),
    "linkage with springs, plane": linkage,
    "cantilever, turned clamp, space": turned,
    "45-degree bend, space": bend,
    "portal, space": lambda: portal("space"),
}


def _flat(answer: ParametricAnswer) -> Array:
    return np.concatenate([np.ravel(answer[one.name]) for one in answer.of.answers])


def _apart(answer: ParametricAnswer) -> tuple[float, float]:
    """Derivatives from differences, relative to the largest of each number: the worst first and second ones."""
    weights = np.linspace(0.5, 1.0, answer.of.solver.results.size)

    def difference(i: int, values: Callable[[ParametricAnswer], Array]) -> Array:
        found = []
        for share in (0.25, 0.5, 1.0):
            step = np.zeros(len(answer.numbers))
            step[i] = 1e-2 * share * (abs(answer.numbers[i]) or 1.0)
            ends = (answer.of.solve(answer.of.by_parameter(answer.numbers + side * step), answer) for side in (1, -1))
            ahead, behind = (values(end) for end in ends)
            found.append((ahead - behind) / (2.0 * step[i]))
        # Richardson's: what is left goes with the sixth power of the step.
        return (64.0 * found[0] - 20.0 * found[1] + found[2]) / 45.0

    numbers = range(len(answer.numbers))
    first = np.stack([difference(i, _flat) for i in numbers], axis=1)
    second = np.stack([difference(i, lambda end: weights @ end.flat_jacobian) for i in numbers], axis=1)
    off = [
        np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)
        for found, wanted in ((answer.flat_jacobian, first), (answer.flat_hessian(weights), second))
    ]
    return float(off[0].max()), float(off[1].max())


def _measured(scene: Scene, names: list[str]) -> tuple[str, ...]:
    equilibrium = parametric(scene, names)
    answer = equilibrium.solve()
    state, numbers = answer.outcome.state, answer.numbers
    near = equilibrium.by_parameter(1.01 * numbers)
    implicit, slopes = equilibrium.implicit, equilibrium.implicit.slopes(numbers, state)
    weights = np.eye(1, len(slopes.answers)).ravel()
    timed: tuple[Callable[[], object], ...] = (
        lambda: solve(scene),
        equilibrium.solve,
        lambda: equilibrium.solve(near, answer),
        lambda: implicit.slopes(numbers, state),
        lambda: implicit.second(numbers, state, slopes, weights),
    )
    times = [1e3 * least(call, RUNS)[0] for call in timed]
    first, second = _apart(answer)
    sizes = (implicit.total, len(numbers), len(slopes.answers))
    return (
        *map(str, sizes),
        *(f"{one:.2f}" for one in times),
        f"{times[3] / times[2]:.2f}",
        f"{first:.0e}",
        f"{second:.0e}",
    )


def derivatives() -> None:
    """Milliseconds of solves and of derivatives, and how far these are from differences."""
    print(f"Derivatives of all answers by ten numbers; milliseconds, least of {RUNS}; accuracy 1e-6\n")
    heads = (
        *("scene", "unknowns", "numbers", "answers", "`solve(scene)`", "cold", "warm"),
        *("first", "second, of one", "first / warm", "first off", "second off"),
    )
    print("\n".join(markdown_table(heads, [(name, *_measured(*made())) for name, made in CASES.items()])))
