"""The mechanism of two loops of Figure 1b, its links all rigid, of small deformation, and very flexible.

Macro-elements 1-2 (the crank), 2-3, 3-4 and 3-5 are joined by hinges; 1 and 4 are hinges on the ground, 5 slides along
an inclined direction.  A force pushes the slider inwards while the crank is turned.  The three kinds of links give
three answers at three prices, and the same answer where the links are stiff: the difference from rigid links falls
like 1/stiffness, that between small and flexible links like 1/stiffness^2.

Links between two hinges only carry forces along themselves, so the crank alone bends.  To first order it acts like a
rigid crank that is turned further, by F L^2/(3 EI) with the force F across its end.  The angle of that second, rigid
scene needs no beam, and its answer differs by the order 1/stiffness^2 only: this is the check.

The scenes are ``mechanism_two_loops_flexible.toml`` and its two companions; ``python problems/mechanism_two_loops.py``
prints the tables.

Source: Barraco and Munteanu, Part 1, Figure 1b (its dimensions are not printed; those of the scene are chosen).
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sfetcas import Equilibrium, Prepared, Scene, Solution, load, solve, solve_model

KINDS = ("rigid", "small", "flexible")

TURNS = (2, 3, 5, 6)
"""Factors at which the crank is turned by 20, 40, -20 and -40 degrees under the whole push."""

STIFFER = tuple(10.0 * 4.0**i for i in range(5))
"""Stiffness of the links over that of the scene: from 10 on the crank bends by less than two percent."""

RUNS = 7
"""Solves of which the median is the time."""

TOLERANCE = 2e-3
"""Of an order: the next term of the series is smaller by the bending of the crank, here F L^2/(3 EI) < 2e-4 rad, times
a number of the geometry up to ten.  Rounding, 1e-15 m in the smallest difference of 4e-10 m, does not count."""


def scene(kind: str = "flexible", stiffer: float = 1.0) -> Scene:
    """The mechanism with links of a kind, so many times as stiff."""
    base = load(Path(__file__).parent / "mechanism_two_loops_flexible.toml")
    members = {name: member.replace(type=kind) for name, member in base.members.items()}
    sections = {name: section.replace(EI3=stiffer * section.EI3) for name, section in base.sections.items()}
    return base.replace(members=members, sections=sections, expect=())


def answers(kind: str, stiffer: float = 1.0, further: tuple[float, ...] = (0.0,) * len(TURNS)) -> list[Equilibrium]:
    """Equilibria at the turns of the crank, each turned further by so many radians."""
    asked = scene(kind, stiffer)
    unit, crank = asked.motions["crank"].rotation, asked.histories["crank"]
    degrees = {turn: crank.factor(turn) + extra / unit for turn, extra in zip(TURNS, further, strict=True)}
    turned = crank.replace(t=list(degrees), value=list(degrees.values()))
    analysis = asked.analysis.replace(steps=TURNS)
    return list(solve(asked.replace(histories={**asked.histories, "crank": turned}, analysis=analysis)).steps)


def travels(steps: list[Equilibrium]) -> np.ndarray:
    """Travel of the slider along its guide, (turns,) m."""
    node = scene().nodes["5"]
    return np.array([(step.position("5") - node.position) @ node.direction for step in steps])


def bending(steps: list[Equilibrium], stiffer: float) -> tuple[float, ...]:
    """Angles F L^2/(3 EI) by which the end of a rigid crank would deflect if it bent; F is what is across it."""
    found = []
    for step in steps:
        arm = step.position("2") - step.position("1")
        force = step.along("1-2", [1.0])["force"][0]
        across = (arm[0] * force[1] - arm[1] * force[0]) / np.linalg.norm(arm)
        stiffness = stiffer * float(scene().sections["crank"].EI3)
        found.append(float(across * (arm @ arm) / (3.0 * stiffness)))
    return tuple(found)


def differences() -> dict[str, np.ndarray]:
    """Largest difference of the slider's travel over the turns, for each stiffness, m."""
    rigid = answers("rigid")
    rows = []
    for stiffer in STIFFER:
        small, flexible = (travels(answers(kind, stiffer)) for kind in ("small", "flexible"))
        turned = travels(answers("rigid", further=bending(rigid, stiffer)))
        pairs = ((small, travels(rigid)), (flexible, travels(rigid)), (small, flexible), (flexible, turned))
        rows.append([float(np.abs(one - other).max()) for one, other in pairs])
    names = ("small - rigid", "flexible - rigid", "small - flexible", "flexible - rigid turned further")
    return dict(zip(names, np.array(rows).T, strict=True))


def orders(falling: np.ndarray) -> np.ndarray:
    """Power of 1/stiffness between neighbours."""
    return np.log(falling[:-1] / falling[1:]) / np.log(STIFFER[1] / STIFFER[0])


def answer() -> Solution:
    """The mechanism with flexible links."""
    return solve(scene())


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE: of the orders from those of the theory."""
    wanted = {"small - rigid": 1, "flexible - rigid": 1, "small - flexible": 2, "flexible - rigid turned further": 2}
    found = differences()
    return {f"order of {name}": abs(float(orders(found[name])[-1]) - order) for name, order in wanted.items()}


def _milliseconds(call: Callable[[], Equilibrium]) -> float:
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1e3 * statistics.median(times)


def side_by_side() -> list[str]:
    """Answers and prices of the three kinds, a line a kind."""
    lines = [
        f"{'links':>9} {'unknowns':>9} {'cold, ms':>9} {'warm, ms':>9}   travel of 5, m, and driving moment, N m, "
        "at 20, 40, -20, -40 degrees"
    ]
    for kind in KINDS:
        steps = answers(kind)
        prepared = Prepared(steps[0].model)
        near = solve_model(prepared, TURNS[0])
        cold = _milliseconds(lambda prepared=prepared: solve_model(prepared, TURNS[1]))
        warm = _milliseconds(lambda prepared=prepared, near=near: solve_model(prepared, TURNS[1], start=near))
        moments = (step.reaction("1")[1][2] for step in steps)
        figures = "  ".join(f"{s:.4f} {m:.4f}" for s, m in zip(travels(steps), moments, strict=True))
        lines.append(f"{kind:>9} {prepared.model.unknowns:9d} {cold:9.2f} {warm:9.2f}   {figures}")
    return lines


def agreement() -> list[str]:
    """Differences of the slider's travel over the stiffness with the orders between neighbours, a line a stiffness."""
    found = differences()
    lines = ["stiffness   " + "".join(f"{name + ', m':>36}" for name in found)]
    for i, stiffer in enumerate(STIFFER):
        cells = (f"{falling[i]:21.2e}  order {orders(falling)[i - 1]:5.3f}  " for falling in found.values())
        first = (f"{falling[i]:21.2e}{'':15}" for falling in found.values())
        lines.append(f"{stiffer:9g}   " + "".join(cells if i else first))
    return lines


if __name__ == "__main__":
    print(*side_by_side(), "", *agreement(), sep="\n")
    for name, difference in check().items():
        print(f"{name}: off by {difference:.1e}")
