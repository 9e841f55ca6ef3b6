"""Where the strips of a cross-spring hinge have to cross so that its centre stays where it is.

Two equal strips at right angles are clamped to the ground and to a stage, which a moment turns.  The point where they
cross is at the fraction ``crossing`` of their length from the ground; the point of the stage that was there moves as
the stage turns: the parasitic shift of the hinge.  For small angles it vanishes in its first order at the crossing
1/2 - sqrt(5)/6 = 0.12732.  For angles that are not small the crossing with the least shift is another one.

``python problems/flexure_hinge_least_shift.py [PICTURE]`` prints the crossings and draws hinge and shifts.

Source of the check: Wittrick, The properties of crossed flexure pivots, and the influence of the point at which the
strips cross, Aeronautical Quarterly II, 1951, for small angles; statics of the finished scene for large ones.
"""

from __future__ import annotations

import functools
import sys

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import (
    CrossSection,
    Design,
    DesignAnswer,
    Load,
    Member,
    Node,
    Parameter,
    Scene,
    Solution,
    changed,
    find,
    solve,
)

LENGTH, EI = 0.1, 0.01
"""Of each strip, m and N m2."""

WITTRICK = 0.5 - np.sqrt(5.0) / 6.0

SMALL = np.radians([2.0, 1.0])
"""Angles at which the shift along the line of symmetry shall vanish: the crossing at zero is extrapolated."""

TURNED = {"10 degrees": np.radians(10.0), "20 degrees": np.radians(20.0)}

TOLERANCE = 1e-6
"""The crossing goes with the square of the angle; its fourth power leaves 1e-7 of two small angles.  Shifts over the
length on the mesh of the design are within 1e-8 of those of statics."""


def nodes(crossing: float) -> dict[str, np.ndarray]:
    """Ends of the strips for a crossing at the origin."""
    ways = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    found = {}
    for i, way in enumerate(ways, start=1):
        found[f"nodes.ground {i}.position"] = -crossing * LENGTH * way
        found[f"nodes.stage {i}.position"] = (1.0 - crossing) * LENGTH * way
    return found


def scene(crossing: float = 0.3) -> Scene:
    """The hinge; the stage is rigid from both strips to the point where they cross."""
    ends = {name.split(".")[1]: at.tolist() for name, at in nodes(crossing).items()}
    placed = {name: Node(position=at, support="clamped" if "ground" in name else "free") for name, at in ends.items()}
    strips = {f"strip {i}": Member(nodes=[f"ground {i}", f"stage {i}"], section="strip") for i in (1, 2)}
    stage = {f"arm {i}": Member(nodes=[f"stage {i}", "centre"], type="rigid") for i in (1, 2)}
    return Scene(
        title="Cross-spring hinge",
        sections={"strip": CrossSection(EI3=EI)},
        nodes={**placed, "centre": Node(position=[0, 0])},
        members={**strips, **stage},
        loads={"turn": Load(type="moment", node="centre", value=0.01)},
    )


def asked() -> tuple[Design, dict[str, ca.MX]]:
    """A hinge with an unknown crossing and an unknown moment in each case, and the shifts."""
    crossing = {"crossing": Parameter(0.25, nodes, 0.02, 0.48)}
    design = Design(
        scene(), crossing, {case: {} for case in TURNED}, inputs={"loads.turn.value": (0.0, 1.0)}, accuracy=1e-9
    )
    for case, angle in TURNED.items():
        design.subject_to(design.answer(case, "nodes.centre.angle") == angle)
    return design, {case: design.answer(case, "nodes.centre.position")[:2] / LENGTH for case in TURNED}


@functools.cache
def least() -> DesignAnswer:
    """The hinge with the least mean square of its shift at 10 and 20 degrees to either side: they are mirrored."""
    design, shifts = asked()
    design.minimise(sum(ca.sumsqr(shift) for shift in shifts.values()))
    return design.solve()


def crossing_without_shift(angle: float) -> float:
    """The crossing at which the shift along the line of symmetry vanishes at an angle."""
    design = Design(
        scene(),
        {"crossing": Parameter(0.25, nodes, 0.02, 0.48)},
        inputs={"loads.turn.value": (0.0, 1.0)},
        accuracy=1e-11,
    )
    design.subject_to(design.answer("", "nodes.centre.angle") == angle)
    design.subject_to(design.answer("", "nodes.centre.position")[1] / (LENGTH * angle**2) == 0)
    return float(design.solve().values["crossing"])


def shift(crossing: float, angle: float) -> float:
    """Of the centre over the length, at an angle."""
    moment = {"loads.turn.value": (0.0, 1.0)}
    turned = find(scene(crossing), moment, {"nodes.centre.angle": angle}, accuracy=1e-9).cases[""]
    return float(np.linalg.norm(turned.position("centre"))) / LENGTH


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    coarse, fine = (crossing_without_shift(float(angle)) for angle in SMALL)
    answer, crossing = least(), least().values["crossing"]
    moments = {case: answer.values[f"{case}: loads.turn.value"] for case in TURNED}
    turned = {
        case: solve(changed(scene(crossing), {"loads.turn.value": moment}), accuracy=1e-9).last
        for case, moment in moments.items()
    }
    angles = [abs(step.angle("centre") - TURNED[case]) for case, step in turned.items()]
    squares = sum(float(step.position("centre") @ step.position("centre")) / LENGTH**2 for step in turned.values())
    beside = [sum(shift(x, angle) ** 2 for angle in TURNED.values()) for x in (crossing - 0.002, crossing + 0.002)]
    return {
        "crossing for small angles against Wittrick": abs(fine + (fine - coarse) / 3.0 - WITTRICK),
        "angles of the design against statics": max(angles),
        "squares of the shifts against statics": abs(squares - answer.objective),
        "squares of the shifts beside the design below its own": max(0.0, squares - min(beside)),
    }


def answer() -> Solution:
    """The hinge with the least shift, turned by 20 degrees."""
    return solve(least().scene("20 degrees"))


def picture() -> Figure:
    """The hinge turned by 20 degrees, and its shift over the crossing."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_hinge(left)
    _draw_shifts(right)
    return figure


def _draw_hinge(axes: Axes) -> None:
    turned, fractions = least().cases["20 degrees"], np.linspace(0.0, 1.0, 31)
    for i in (1, 2):
        x, y, _ = 1e3 * turned.along(f"strip {i}", fractions)["position"].T
        axes.plot(x, y, color="C0")
        arm = 1e3 * np.stack([turned.position(f"stage {i}"), turned.position("centre")])
        axes.plot(*arm[:, :2].T, color="0.6", linewidth=3)
        axes.plot(*(1e3 * turned.position(f"ground {i}")[:2]), "s", color="0.3")
    axes.plot(0, 0, "+", color="C3", markersize=12)
    crossing = least().values["crossing"]
    axes.set(aspect="equal", xlabel="x, mm", ylabel="y, mm", title=f"Crossing at {crossing:.4f}, turned by 20 degrees")


def _draw_shifts(axes: Axes) -> None:
    crossings = [
        0.05,
        0.08,
        0.1,
        0.115,
        0.122,
        float(least().values["crossing"]),
        0.136,
        0.145,
        0.17,
        0.22,
        0.3,
        0.4,
        0.5,
    ]
    for name, angle in TURNED.items():
        axes.semilogy(crossings, [shift(x, angle) for x in crossings], label=name)
        axes.semilogy(least().values["crossing"], shift(least().values["crossing"], angle), "o", color="C3")
    axes.axvline(WITTRICK, color="0.7", linestyle="--", label="Wittrick, small angles")
    axes.set(xlabel="crossing, fraction of the length", ylabel="shift of the centre over the length")
    axes.legend(fontsize=8)


if __name__ == "__main__":
    print(f"crossing with least shift up to 20 degrees: {least().values['crossing']:.5f}, small angles: {WITTRICK:.5f}")
    for x in (0.5, WITTRICK, least().values["crossing"]):
        print(f"crossing {x:.5f}: shift at 20 degrees {shift(x, TURNED['20 degrees']):.2e} of the length")
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "flexure_hinge_least_shift.png", dpi=150)
