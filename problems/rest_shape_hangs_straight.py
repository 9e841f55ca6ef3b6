"""The rest shape of a heavy clamped strip that gravity makes straight.

A strip clamped level at one end, of even stiffness and weight w per length, shall be straight under its weight.  Its
rest curvature is asked for as a polynomial of degree two, so that the strip is level at three places.  Straight it
carries the moment -w (L - s)^2 / 2, so that the exact answer is (w / 2 EI) (L - s)^2, of this degree.

``python problems/rest_shape_hangs_straight.py [PICTURE]`` prints the coefficients and draws both shapes.

Source of the check: that closed form.
"""

from __future__ import annotations

import functools
import sys

import numpy as np
from matplotlib.figure import Figure

from sfetcas import Analysis, CrossSection, Curvature, Design, DesignAnswer, Member, Node, Scene, Solution, solve

LENGTH, EI, WEIGHT, GRAVITY = 1.0, 1.0, 0.2, 9.81
"""m, N m2, N/m, m/s2: a straight strip of these would sink by 2.5 % of its length."""

PLACES = (1 / 3, 2 / 3, 1.0)

EXACT = WEIGHT * LENGTH**2 / (2.0 * EI) * np.array([1.0, -2.0, 1.0])

TOLERANCE = 1e-8
"""Positions of the mesh are within 1e-12 of the length; coefficients are hundred times as far, as they cancel."""


def scene() -> Scene:
    """The strip without rest curvature."""
    shape = Curvature(kappa3=[0.0, 0.0, 0.0], length=LENGTH, start=[1, 0])
    return Scene(
        title="Heavy strip, clamped level",
        sections={"strip": CrossSection(EI3=EI, rhoA=WEIGHT / GRAVITY)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[LENGTH, 0])},
        members={"strip": Member(nodes=["root", "tip"], section="strip", shape=shape)},
        gravity=[0, -GRAVITY],
        analysis=Analysis(accuracy=1e-12),
    )


@functools.cache
def designed() -> DesignAnswer:
    """The rest curvature for which the strip is level at three places."""
    bounds = {0: (0.0, 0.25), 1: (-0.5, 0.0), 2: (0.0, 0.25)}
    design = Design(scene(), {f"members.strip.shape.kappa3.{i}": pair for i, pair in bounds.items()})
    design.subject_to(design.answer("", "members.strip.position", at=PLACES)[:, 1] == 0, name="level")
    return design.solve()


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    answer = designed()
    found = np.array([answer.values[f"members.strip.shape.kappa3.{i}"] for i in range(3)])
    along = solve(answer.scene()).last.along("strip", np.linspace(0.0, 1.0, 41))["position"]
    return {
        "coefficients against the closed form": float(np.abs(found - EXACT).max()),
        "height of the strip by statics": float(np.abs(along[:, 1]).max()),
    }


def answer() -> Solution:
    """The rest shape under its weight."""
    return solve(designed().scene())


def picture() -> Figure:
    """The rest shape, and the strip that hangs straight."""
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    axes, answer, x = figure.subplots(), designed(), np.linspace(0.0, 1.0, 41)
    rest = answer.scene().center_lines["strip"].positions(x)
    sunk = solve(scene()).last.along("strip", x)["position"]
    axes.plot(*rest[:, :2].T, "--", label="rest shape")
    axes.plot(*answer.cases[""].along("strip", x)["position"][:, :2].T, label="under its weight")
    axes.plot(*sunk[:, :2].T, ":", color="0.5", label="a straight strip under its weight")
    axes.set(xlabel="x, m", ylabel="y, m, enlarged")
    axes.legend(fontsize=8, loc="lower left")
    return figure


if __name__ == "__main__":
    print("kappa3:", [designed().values[f"members.strip.shape.kappa3.{i}"] for i in range(3)], "exact:", EXACT.tolist())
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "rest_shape_hangs_straight.png", dpi=150)
