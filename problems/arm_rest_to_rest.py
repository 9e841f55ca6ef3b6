"""A flexible arm turned by 90 degrees from rest to rest: what three commands of the torque leave behind.

A hub with inertia carries a slender arm with a mass at its tip; a moment turns the hub, in the time of some two periods
of the arm's first vibration.  The torque that a rigid arm wants, full in one direction and then in the other, leaves
the flexible one swinging; so does, less, that of a smooth law of the rigid arm.  The third torque is looked for: the
one of least rate that brings the flexible arm to rest.

``python problems/arm_rest_to_rest.py [PICTURE]`` prints the table and draws torques, what is left, and the motion.

Sources: momenta and energy of a motion from rest to rest in closed form (the integrals of torque and power vanish);
least effort of a rigid arm, 12 J^2 angle^2 / time^3; the replay of each command by another integrator.
"""

from __future__ import annotations

import functools
import sys
import time as clock
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import CrossSection, History, Ipopt, Load, Member, Node, Scene, Trajectory
from sfetcas.trajectories.controlled_motion import Check, ControlledMotion
from sfetcas.trajectories.optimal_control import OptimalControl
from sfetcas.trajectories.replay import Response, respond

LENGTH, STIFFNESS, DENSITY = 1.0, 1.0, 1.0
HUB, TIP = 0.1, 0.2
"""Inertia of the hub, kg m2, and mass at the tip, kg."""

ANGLE, TIME = np.pi / 2.0, 1.5
"""What the hub turns by, rad, and in which time, s."""

TORQUE = "loads.motor.value"

ELEMENTS, INTERVALS = 8, 60
"""Of the printed table and the picture."""

TOLERANCE = 1e-3
"""Of what bang-bang leaves; balances and replay are within 1e-4 on the coarse grid of the check, and the effort of the
rigid arm within 1e-6."""


def arm(elements: int = ELEMENTS) -> Scene:
    """The arm along x; a rigid one of no elements."""
    member = {"element": "SFET3", "elements": elements} if elements else {"type": "rigid"}
    return Scene(
        title="Flexible arm on a hub",
        sections={"strip": CrossSection(EI3=STIFFNESS, rhoA=DENSITY)},
        nodes={
            "hub": Node(position=[0, 0], support="hinge", inertia=[0, 0, HUB]),
            "tip": Node(position=[LENGTH, 0], mass=TIP),
        },
        members={"arm": Member(nodes=["hub", "tip"], section="strip", **member)},
        loads={"motor": Load(type="moment", node="hub", value=0.0)},
    )


def inertia() -> float:
    """Of the rigid arm about the hub, kg m2."""
    return HUB + DENSITY * LENGTH**3 / 3.0 + TIP * LENGTH**2


def bang_bang() -> History:
    """Full torque in one direction, then in the other: the rigid arm comes to rest at the angle."""
    size = 4.0 * inertia() * ANGLE / TIME**2
    return History(t=[0.0, TIME / 2.0, TIME, 2.0 * TIME], polynomial=[[size], [-size], [0.0]])


def smooth() -> History:
    """The rigid arm's torque for the angle 10 x^3 - 15 x^4 + 6 x^5, x = t/TIME."""
    size = inertia() * ANGLE / TIME**2
    return History(t=[0.0, TIME, 2.0 * TIME], polynomial=[[0.0, 60.0 * size, -180.0 * size, 120.0 * size], [0.0]])


class EquilibriumResult(NamedTuple):
    """A motion that was looked for, and the work of its torque, N m."""

    motion: ControlledMotion
    work: float


@functools.cache
def optimal(elements: int = ELEMENTS, intervals: int = INTERVALS, effort: bool = False) -> EquilibriumResult:
    """The torque of least rate, 0 at both ends, or of least effort, that brings the arm to rest at the angle."""
    problem = OptimalControl(arm(elements), {TORQUE: (-5.0, 5.0)}, time=TIME, intervals=intervals)
    torque, angle = problem.control(TORQUE), problem.answer("nodes.hub.angle")
    problem.subject_to(problem.at_tf(angle) == ANGLE, name="turned")
    problem.rest_at_end()
    if effort:
        problem.minimise(problem.integral(torque**2))
    else:
        problem.subject_to(problem.at_t0(torque) == 0.0, name="torque at the begin")
        problem.subject_to(problem.at_tf(torque) == 0.0, name="torque at the end")
        problem.minimise(problem.integral(problem.rate(TORQUE) ** 2))
    # Of torque over angle, by parts.
    work = problem.at_tf(torque * angle) - problem.integral(problem.rate(TORQUE) * angle)
    motion = problem.solve(replay=False, ipopt=Ipopt(1e-9, 100))
    return EquilibriumResult(motion, motion.value(work))


@functools.cache
def replay(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Check:
    """The best torque in another integrator, on a finer mesh."""
    return optimal(elements, intervals).motion.replayed(accuracy=1e-4)


@functools.cache
def response(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> Response:
    """What a command does to the arm, followed for as long again after its end."""
    if command == "optimal":
        return replay(elements, intervals).response
    return respond(
        arm(elements), {TORQUE: history_of(command)}, TIME, tail=TIME, step=TIME / 100.0, accuracy=1e-2, halvings=1
    )


def check(elements: int = 4, intervals: int = 24) -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    found, again = optimal(elements, intervals), replay(elements, intervals)
    torque, angle = (found.motion.control(TORQUE), found.motion.answer("nodes.hub.angle"))
    largest = float(np.abs(torque).max())
    impulse = np.trapezoid(torque, found.motion.ends)
    stiff, least = optimal(0, intervals, effort=True).motion.cost, 12.0 * inertia() ** 2 * ANGLE**2 / TIME**3
    return {
        "left of optimal over left of bang-bang": residual("optimal", elements, intervals)
        / residual("bang-bang", elements, intervals),
        "replay against trajectory, over the length": again.difference / LENGTH,
        "impulse of the torque": abs(impulse) / (largest * TIME),
        "work of the torque": abs(found.work) / (largest * float(np.ptp(angle))),
        "effort of the rigid arm": abs(stiff / least - 1.0),
    }


def residual(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> float:
    """Largest distance of the tip from its mean place after the end, m."""
    return response(command, elements, intervals).residual_vibration("tip")


COMMANDS = ("bang-bang", "smooth", "optimal")


def answer(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Trajectory:
    """The motion under the best torque."""
    return response("optimal", elements, intervals).trajectory


def picture(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Figure:
    """Torques, distances of the tip from where it should stand after the end, and the best motion."""
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    torques, left, shapes = figure.subplots(1, 3, width_ratios=(1.1, 1.1, 1.0))
    for command in COMMANDS:
        told = response(command, elements, intervals)
        t = np.linspace(0.0, TIME, 601)[:-1]
        history = history_of(command, elements, intervals)
        torques.plot(t, [history.factor(x) for x in t], label=command)
        places = told.positions("tip")[told.after]
        away = np.linalg.norm(places - [0.0, LENGTH, 0.0], axis=1)
        left.semilogy(told.times[told.after], np.maximum(away, 1e-9) / LENGTH, label=command)
    torques.set(xlabel="t, s", ylabel="torque, N m", title="Commands")
    left.set(xlabel="t, s", ylabel="distance of the tip / length", title="What is left")
    for axes in (torques, left):
        axes.grid(color="#EBEBEB")
        axes.legend(fontsize=8)
    _draw_shapes(shapes, response("optimal", elements, intervals))
    return figure


def _draw_shapes(axes: Axes, told: Response) -> None:
    inside = [one for one, after in zip(told.instants, told.after, strict=True) if not after]
    chosen = [inside[i] for i in np.linspace(0, len(inside) - 1, 13).astype(int)]
    for i, instant in enumerate(chosen):
        x, y, _ = instant.along("arm", np.linspace(0.0, 1.0, 41))["position"].T
        axes.plot(x, y, color=(0.8 - 0.06 * i, 0.8 - 0.06 * i, 0.9), linewidth=1.4)
    x, y, _ = told.positions("tip").T
    axes.plot(x, y, "-", color="C2", linewidth=0.8)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Optimal motion")


def history_of(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> History:
    """A command as a history of the torque."""
    if command == "optimal":
        return optimal(elements, intervals).motion.commands[TORQUE]
    return {"bang-bang": bang_bang, "smooth": smooth}[command]()


def table(elements: int = ELEMENTS, intervals: int = INTERVALS) -> list[str]:
    """Largest torque and what is left, a line a command."""
    lines = [f"{'command':>10} {'torque, N m':>12} {'left at the tip / length':>26}"]
    for command in COMMANDS:
        history = history_of(command, elements, intervals)
        largest = max(abs(history.factor(t)) for t in np.linspace(0.0, TIME, 1001)[:-1])
        lines.append(f"{command:>10} {largest:12.4f} {residual(command, elements, intervals) / LENGTH:26.2e}")
    return lines


if __name__ == "__main__":
    begin = clock.perf_counter()
    motion = optimal().motion
    print(f"{motion.iterations} iterations, {clock.perf_counter() - begin:.1f} s")
    print(*table(), sep="\n")
    for name, difference in check(ELEMENTS, INTERVALS).items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "arm_rest_to_rest.png", dpi=150)
