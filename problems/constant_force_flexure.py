"""A flexure that pushes back with the same force over a fifth of its length, by the profile of its thickness.

A slightly bent strip is clamped at its foot; its head is pinned to a slide that presses it together.  A strip of even
thickness pushes back the more the further it is pressed.  Six thicknesses, linear stiffness between, are chosen so
that at five travels the force is within the least possible band.

``python problems/constant_force_flexure.py [PICTURE]`` prints the forces and draws strips and curves.

Source of the check: statics of the finished scene, also at travels between those of the design, on meshes of its own.
"""

from __future__ import annotations

import functools
import sys

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import (
    Arc,
    CrossSection,
    Design,
    DesignAnswer,
    Member,
    Motion,
    Node,
    Scene,
    Solution,
    Table,
    changed,
    solve,
)

AT = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Fractions of the length at which the thickness is chosen."""

TRAVELS = tuple(np.linspace(0.1, 0.3, 5).tolist())
BETWEEN = tuple(np.linspace(0.125, 0.275, 4).tolist())

EI = 1.0
"""Of the even strip, N m2; the stiffness goes with the third power of the thickness."""

THINNEST, THICKEST = 0.4, 1.6

TOLERANCE = 1e-4
"""Forces on the mesh of the design, whose positions are within 1e-5 of the length, and on that of statics."""


def scene() -> Scene:
    """The even strip, 1 m long from foot to head."""
    return Scene(
        title="Strip pressed together between a clamp and a slide",
        sections={"strip": CrossSection(EI3=Table(at=AT, value=(EI,) * len(AT)))},
        nodes={
            "foot": Node(position=[0, 0], support="clamped"),
            "head": Node(position=[0, 1], support="slider", direction=[0, 1], rotation="ball"),
        },
        members={"strip": Member(nodes=["foot", "head"], section="strip", shape=Arc(angle=0.3))},
        motions={"press": Motion(node="head", displacement=[0, -TRAVELS[0]])},
    )


@functools.cache
def designed() -> DesignAnswer:
    """The strip whose force varies least."""
    cases = {f"{travel:g}": {"motions.press.displacement": [0, -travel]} for travel in TRAVELS}
    design = Design(scene(), cases=cases)
    thickness = design.unknown("thickness", np.ones(len(AT)), THINNEST, THICKEST)
    design.set("sections.strip.EI3.value", EI * thickness**3, between=(THINNEST**3, THICKEST**3))
    force, ripple = design.unknown("force", 20.0, 1.0, 100.0), design.unknown("ripple", 0.2, 0.0, 1.0)
    for case in cases:
        push = -design.answer(case, "reactions.head.force")[1]
        design.subject_to(push <= force * (1 + ripple), push >= force * (1 - ripple), name=f"{case}: band")
    design.minimise(ripple)
    return design.solve()


def force(strip: Scene, travel: float) -> float:
    """What the head pushes back with, N, by statics."""
    pressed = changed(strip, {"motions.press.displacement": [0, -travel]})
    return -float(solve(pressed, accuracy=1e-5).last.reaction("head")[0][1])


def ripple(forces: np.ndarray) -> float:
    """Half of the band over its middle."""
    return float((forces.max() - forces.min()) / (forces.max() + forces.min()))


def forces(strip: Scene, travels: tuple[float, ...]) -> np.ndarray:
    """At several travels."""
    return np.array([force(strip, travel) for travel in travels])


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    answer = designed()
    strip = answer.scene(f"{TRAVELS[0]:g}")
    wanted = np.array([-answer.answers(f"{x:g}", "reactions.head.force")[1] for x in TRAVELS])
    here, there = forces(strip, TRAVELS), forces(strip, BETWEEN)
    within = answer.values["ripple"]
    return {
        "forces of the design against statics": float(np.abs(here / wanted - 1.0).max()),
        "ripple between the travels of the design above that of the design": max(0.0, ripple(there) - within),
        # Of the even strip it is above 7 %.
        "ripple above a twentieth of that of the even strip": max(
            0.0, within - 0.05 * ripple(forces(scene(), TRAVELS))
        ),
    }


def answer() -> Solution:
    """The strip that was found, pressed as far as it goes."""
    return solve(designed().scene(f"{TRAVELS[-1]:g}"))


def picture() -> Figure:
    """The pressed strip, as thick as it is, and the forces of both strips."""
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.4))
    _draw_strips(left)
    _draw_forces(right)
    return figure


def _draw_strips(axes: Axes) -> None:
    answer, fractions = designed(), np.linspace(0.0, 1.0, 61)
    thick = np.cbrt(np.interp(fractions, AT, answer.values["thickness"] ** 3))
    for i, case in enumerate(answer.cases.values()):
        x, y, _ = case.along("strip", fractions)["position"].T
        axes.scatter(x, y, s=12.0 * thick**2, color=f"C{i}", label=f"{TRAVELS[i]:g} m", linewidths=0)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="As thick as drawn, not to scale")
    axes.set_xlim(-0.05, 0.45)
    axes.legend(fontsize=8, title="travel", loc="lower right")


def _draw_forces(axes: Axes) -> None:
    travels = tuple(np.linspace(0.05, 0.35, 13).tolist())
    strip = designed().scene(f"{TRAVELS[0]:g}")
    for name, one in (("even thickness", scene()), ("designed", strip)):
        pushed = forces(one, travels)
        axes.plot(travels, pushed / force(one, 0.2), label=name)
    axes.axvspan(TRAVELS[0], TRAVELS[-1], color="#EEEEEE", zorder=0, label="where it shall be constant")
    axes.set(xlabel="travel, m", ylabel="force over that at 0.2 m", title="Force")
    axes.legend(fontsize=8)


if __name__ == "__main__":
    found = designed()
    print("thickness:", np.round(found.values["thickness"], 4), "force, N:", round(found.values["force"], 4))
    print(f"ripple: even {ripple(forces(scene(), TRAVELS)):.2%}, designed {found.values['ripple']:.2%}")
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "constant_force_flexure.png", dpi=150)
