"""A user's own constraints: the tip of a loaded cantilever kept on a line, its curvature limited.

The equilibrium is taken as an open nonlinear program; rows are added in CasADi by the names of the scene.  The
first row is a support in disguise, so the same answer must come from a scene with a slider there, and the
multiplier of the row must be the slider's force.  Source of the check: that second scene.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from sfetcas import (
    CrossSection,
    Load,
    Member,
    Motion,
    Node,
    OpenAnswer,
    Scene,
    Solution,
    Solver,
    assemble,
    equilibrium_nlp,
    solve,
    uniform_mesh,
)

HEIGHT = 0.2
LIMIT = 2.0

TOLERANCE = 1e-7
"""IPOPT stops at 1e-9 of a residual; the slider scene is solved to 1e-9 of its size."""

ELEMENTS = 8

QUIET_SQP = {
    "qpsol": "qrqp",
    "qpsol_options": {"print_iter": False, "print_header": False},
    "print_header": False,
    "print_iteration": False,
    "print_time": False,
}


def scene() -> Scene:
    """A cantilever of length 1 m and stiffness 1 N m2 under 5 N across its tip."""
    return Scene(
        title="Cantilever with its tip on a line",
        sections={"strip": CrossSection(EI3=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="strip")},
        loads={"tip": Load(type="force", node="tip", value=[0, 5])},
    )


def with_slider() -> Scene:
    """The same cantilever held by a slider on the line."""
    tip = Node(position=[1, 0], support="slider", direction=[1, 0], rotation="ball")
    lift = Motion(node="tip", displacement=[0, HEIGHT])
    return scene().replace(nodes={**scene().nodes, "tip": tip}, motions={"lift": lift})


def on_the_line(solver: Solver | None = None) -> OpenAnswer:
    """The equilibrium with the tip at y = 0.2 m."""
    problem = equilibrium_nlp(assemble(scene(), uniform_mesh(scene(), 4, ELEMENTS)))
    _, y = ca.vertsplit(problem.position("tip"))
    return problem.with_row("line", y, HEIGHT).solve(solver)


def with_limited_curvature() -> OpenAnswer:
    """The equilibrium of least energy with no more curvature than 2 1/m at 21 places."""
    problem = equilibrium_nlp(assemble(scene(), uniform_mesh(scene(), 4, ELEMENTS)))
    curvature = ca.vertcat(*[problem.curvature("beam", float(at)) for at in np.linspace(0.0, 1.0, 21)])
    return problem.with_row("curvature", curvature, -LIMIT, LIMIT).solve()


def answer() -> Solution:
    """The cantilever that a slider holds on the line."""
    return solve(with_slider())


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    answer, held = on_the_line(), solve(with_slider(), accuracy=1e-9).last
    sqp = on_the_line(Solver("sqpmethod", QUIET_SQP))
    limited = with_limited_curvature()
    largest = max(
        float(abs(limited.value(limited.problem.curvature("beam", float(at))))) for at in np.linspace(0.0, 1.0, 21)
    )
    return {
        "tip against slider": float(np.abs(answer.position("tip") - held.position("tip")).max()),
        # grad f + J^T lam = 0: the row pushes with minus its multiplier, as the slider does.
        "multiplier against slider force": abs(-float(answer.multiplier("line")[0]) - held.reaction("tip")[0][1]),
        "IPOPT against SQP": float(np.abs(answer.position("tip") - sqp.position("tip")).max()),
        "curvature above its limit": max(0.0, largest - LIMIT),
    }


if __name__ == "__main__":
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
