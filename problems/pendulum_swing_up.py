"""A flexible pendulum swung up by a motor that could not hold it level: it swings to and fro before it stands.

A slender rod hangs from a hinge with a motor whose torque is limited to less than half the moment of the rod's weight.
The torque is looked for that leaves the rod at rest upright, with least effort and a small cost of its rate; the search
begins with the motion of a rigid pendulum.

``python problems/pendulum_swing_up.py [PICTURE]`` prints the table and draws torques, angles, energies and the motion.

Sources: energy, in closed form (what the motor has worked is what the weight has gained, m g L); the replay by another
integrator on a finer mesh, up to the upright rest, which is unstable.
"""

from __future__ import annotations

import functools
import sys
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import CrossSection, Ipopt, Load, Member, Node, Scene, Trajectory
from sfetcas.trajectories.controlled_motion import Check, ControlledMotion
from sfetcas.trajectories.optimal_control import OptimalControl

LENGTH, STIFFNESS, DENSITY, GRAVITY = 1.0, 5.0, 1.0, 9.81

WEIGHT = DENSITY * GRAVITY * LENGTH**2 / 2.0
"""Moment of the weight of the level rod about the hinge, N m."""

LIMIT, TIME = 2.2, 3.0
"""Largest torque, N m, and time of the motion, s."""

RATE = 0.01
"""Weight of the squared rate of the torque beside the squared torque, s2."""

TORQUE = "loads.motor.value"

ELEMENTS, INTERVALS = 3, 60

TOLERANCE = 1e-2
"""Of the replay, over the length: near the unstable rest whatever is off grows as exp(3.8 t), t in s.  The energies
are met within 1e-3."""


class Swing(NamedTuple):
    """A motion, and the work of its motor, N m."""

    motion: ControlledMotion
    work: float


def pendulum(elements: int = ELEMENTS) -> Scene:
    """The hanging rod; a rigid one of no elements."""
    member = {"element": "SFET3", "elements": elements} if elements else {"type": "rigid"}
    return Scene(
        title="Flexible pendulum with a motor",
        gravity=[0, -GRAVITY],
        sections={"strip": CrossSection(EI3=STIFFNESS, rhoA=DENSITY)},
        nodes={"hinge": Node(position=[0, 0], support="hinge"), "tip": Node(position=[0, -LENGTH])},
        members={"rod": Member(nodes=["hinge", "tip"], section="strip", **member)},
        loads={"motor": Load(type="moment", node="hinge", value=0.0)},
    )


@functools.cache
def swing(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Swing:
    """The torque that swings the rod up."""
    problem = OptimalControl(pendulum(elements), {TORQUE: (-LIMIT, LIMIT)}, time=TIME, intervals=intervals)
    torque, angle, rate = problem.control(TORQUE), problem.answer("nodes.hinge.angle"), problem.rate(TORQUE)
    problem.subject_to(problem.at_t0(torque) == 0.0, name="torque at the begin")
    problem.subject_to(problem.at_tf(torque) == 0.0, name="torque at the end")
    problem.subject_to(problem.at_tf(angle) == np.pi, name="upright")
    problem.rest_at_end()
    problem.minimise(problem.integral(torque**2 + RATE * rate**2))
    # Of torque over angle, by parts; the torque vanishes at both ends.
    work = -problem.integral(rate * angle)
    motion = problem.solve(replay=False, ipopt=Ipopt(1e-8, 200))
    return Swing(motion, motion.value(work))


@functools.cache
def replay(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Check:
    """The torque in another integrator, on a finer mesh, up to the end."""
    given = {"tail": 0.0, "accuracy": 1e-4, "integrator": "radau-3", "halvings": 2}
    return swing(elements, intervals).motion.replayed(**given)


def check(elements: int = ELEMENTS, intervals: int = INTERVALS) -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    flexible, stiff = swing(elements, intervals), swing(0, intervals)
    gained = DENSITY * LENGTH * GRAVITY * LENGTH
    torque = np.abs(flexible.motion.control(TORQUE)).max()
    return {
        "replay against trajectory, over the length": replay(elements, intervals).difference,
        "replay of the rigid pendulum, over the length": replay(0, intervals).difference,
        "work of the motor against m g L": abs(flexible.work / gained - 1.0),
        "work of the rigid pendulum's motor against m g L": abs(stiff.work / gained - 1.0),
        "torque that holds it upright, over the limit": abs(flexible.motion.at_rest(TORQUE)) / LIMIT,
        "torque above its limit": max(float(torque) / LIMIT - 1.0, 0.0),
        # None but 0 or 1.
        "limit above half the moment of the weight": float(LIMIT >= WEIGHT / 2.0),
    }


def answer(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Trajectory:
    """The rod as it swings up."""
    return replay(elements, intervals).response.trajectory


def picture(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Figure:
    """Torques, angles at the hinge, energies, and the rod as it moves."""
    figure = Figure(figsize=(14.0, 3.8), layout="constrained")
    torques, angles, energies, shapes = figure.subplots(1, 4)
    for label, count in (("rigid", 0), ("flexible", elements)):
        motion = swing(count, intervals).motion
        torques.plot(motion.ends, motion.control(TORQUE), label=f"{label}, cost {motion.cost:.3f}")
        angles.plot(motion.times, motion.answer("nodes.hinge.angle").ravel(), label=label)
    told = replay(elements, intervals).response
    for kind in ("kinetic", "elastic"):
        energies.plot(told.times, told.energies(kind), label=kind)
    torques.set(xlabel="t, s", ylabel="torque, N m", title=f"Torques, |M| < {LIMIT:g} N m")
    angles.set(xlabel="t, s", ylabel="angle at the hinge, rad", title="Angles")
    energies.set(xlabel="t, s", ylabel="energy, N m", title="Energies, flexible")
    for axes in (torques, angles, energies):
        axes.grid(color="#EBEBEB")
        axes.legend(fontsize=8)
    _draw_shapes(shapes, elements, intervals)
    return figure


def _draw_shapes(axes: Axes, elements: int, intervals: int) -> None:
    told = replay(elements, intervals).response
    for i in range(0, intervals + 1, 3):
        x, y, _ = told.instants[i].along("rod", np.linspace(0.0, 1.0, 31))["position"].T
        shade = 0.85 - 0.75 * i / intervals
        axes.plot(x, y, color=(shade, shade, 0.9), linewidth=1.2)
    axes.plot(0.0, 0.0, "ko", markersize=4)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Rod, pale to dark")


def table(elements: int = ELEMENTS, intervals: int = INTERVALS) -> list[str]:
    """Cost and work, a line a pendulum."""
    lines = [f"{'pendulum':>9} {'iterations':>11} {'cost':>9} {'work, N m':>10} {'largest torque':>15} {'m g L/2':>8}"]
    for label, count in (("rigid", 0), ("flexible", elements)):
        one = swing(count, intervals)
        largest = np.abs(one.motion.control(TORQUE)).max()
        told = f"{one.motion.iterations:11d} {one.motion.cost:9.4f} {one.work:10.5f} {largest:15.4f} {WEIGHT:8.3f}"
        lines.append(f"{label:>9} {told}")
    return lines


if __name__ == "__main__":
    print(*table(), sep="\n")
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "pendulum_swing_up.png", dpi=150)
