"""A flexible arm as plain CasADi functions in a user's own optimal control problem, written with casadi.Opti.

The arm turns by 90 degrees in a given time, from rest to rest, with the least effort.  Opti knows nothing of beams: it
takes states, their rates and outputs from functions with named inputs and outputs, and steps by the implicit midpoint
rule.  Source of the check: the same problem by :class:`sfetcas.OptimalControl`, whose form of the equations (positions
with closings of index 3, not accelerations), collocation and rest at the end are others.
"""

from __future__ import annotations

import functools
import sys
from typing import TYPE_CHECKING

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

from sfetcas import (
    ControlledMotion,
    CrossSection,
    Load,
    Member,
    MotionFunctions,
    Node,
    OptimalControl,
    Scene,
    Trajectory,
    motion_functions,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TIME, ANGLE, INTERVALS = 1.5, np.pi / 2, 60
TORQUE, TURNED, TIP = "loads.motor.value", "nodes.hub.angle", "nodes.tip.position"

STEPS = 3
"""Of the midpoint rule in an interval."""

TOLERANCE = 2e-3
"""The midpoint rule is of order 2: its waves are slower by (omega h)^2 / 12, 1e-3 of the one with 13 rad/s."""

QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


def scene() -> Scene:
    """An arm of length 1 m with a hub and a mass at its tip."""
    return Scene(
        title="Flexible arm",
        sections={"strip": CrossSection(EI3=5.0, rhoA=0.5, rhoI=[2e-3, 1e-3, 1e-3])},
        nodes={
            "hub": Node(position=[0, 0], support="hinge", inertia=[0, 0, 0.1]),
            "tip": Node(position=[1, 0], mass=0.5),
        },
        members={"arm": Member(nodes=["hub", "tip"], section="strip", element="SFET3", elements=1)},
        loads={"motor": Load(type="moment", node="hub", value=0.0)},
    )


@functools.cache
def functions() -> MotionFunctions:
    """x' = ode(x, z, u), 0 = alg(x, z, u) and y = outputs(x, u) of the arm."""
    return motion_functions(scene(), [TORQUE], [TURNED, TIP])


@functools.cache
def by_opti() -> tuple[float, np.ndarray, np.ndarray]:
    """Effort, torques in the intervals, and places of the tip at their ends, (intervals + 1, 2)."""
    steps = STEPS * INTERVALS
    model, h = functions(), TIME / steps
    opti = ca.Opti()
    x = opti.variable(model.sizes["x"], steps + 1)
    z = opti.variable(model.sizes["z"], steps)
    u = opti.variable(1, INTERVALS)
    held = ca.kron(u, ca.DM.ones(1, STEPS))
    ode, alg = model.dae.map(steps)(0.5 * (x[:, :-1] + x[:, 1:]), z, held, ca.DM(0, steps))
    opti.subject_to(ca.vec(x[:, 1:] - x[:, :-1] - h * ode) == 0)
    opti.subject_to(ca.vec(alg) == 0)
    opti.subject_to(x[:, 0] == model.begin)
    # Straight and at rest; displacements and their rates follow from closings.
    rotations = model.parts["q"]
    count = rotations.stop - rotations.start
    opti.subject_to(x[rotations, -1] == ANGLE)
    opti.subject_to(x[model.parts["w"], -1][:count] == 0)
    opti.minimize(h * ca.sumsqr(held))
    opti.set_initial(x, np.tile(model.begin[:, None], steps + 1))
    opti.solver("ipopt", QUIET)
    found = opti.solve()
    states = found.value(x)
    seen = [np.array(model.outputs_of(states[:, k], 0.0, [])).ravel() for k in range(0, steps + 1, STEPS)]
    return float(found.value(opti.f)), np.ravel(found.value(u)), np.array(seen)[:, 1:3]


@functools.cache
def by_collocation() -> ControlledMotion:
    """The same problem in the words of sfetcas."""
    problem = OptimalControl(scene(), {TORQUE: (-np.inf, np.inf)}, time=TIME, intervals=INTERVALS, order=0)
    problem.minimise(problem.integral(problem.control(TORQUE) ** 2))
    problem.subject_to(problem.at_tf(problem.answer(TURNED)) == ANGLE)
    problem.rest_at_end()
    return problem.solve(replay=False)


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    effort, _, tip = by_opti()
    motion = by_collocation()
    return {
        "effort": abs(effort - motion.cost) / motion.cost,
        "way of the tip": float(np.abs(tip - motion.positions("tip")[:, :2]).max()),
    }


def answer() -> Trajectory:
    """The motion under the torques of the collocation."""
    return by_collocation().replayed().response.trajectory


def picture() -> Figure:
    """Torques and ways of the tip of both."""
    _, torque, tip = by_opti()
    motion = by_collocation()
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    left.stairs(torque, motion.ends, label="casadi.Opti, midpoint rule")
    left.stairs(motion.control(TORQUE), motion.ends, label="collocation", linestyle="--")
    left.set_xlabel("time, s")
    left.set_ylabel("torque, N m")
    left.legend()
    right.plot(*tip.T, label="casadi.Opti")
    right.plot(*motion.positions("tip")[:, :2].T, "--", label="collocation")
    right.set_aspect("equal")
    right.set_xlabel("x, m")
    right.set_ylabel("y, m")
    right.set_title("tip")
    return figure


if __name__ == "__main__":
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    if len(sys.argv) > 1:
        picture().savefig(sys.argv[1])
