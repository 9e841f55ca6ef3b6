"""A flexible arm slewed in the least time: full torque in one direction or the other, and when it switches.

A hub with inertia carries a slender arm with a mass at its tip; a moment of limited size turns the hub and has to leave
the whole arm at rest.  A rigid arm needs one switch of the torque; each mode of vibration that is to be at rest as well
needs two more.

``python problems/slew_in_least_time.py [PICTURE]`` prints the table and draws torques and the motion.

Sources: a rigid arm in closed form, time = 2 sqrt(angle J / torque); a slew so small that the arm's theory is linear,
from its natural frequencies (Euler and Bernoulli) and the switches that leave two modes at rest, after Singh, Kabamba
and McClamroch, Planar, time-optimal, rest-to-rest slewing maneuvers of flexible spacecraft, J. Guidance 12 (1989).
"""

from __future__ import annotations

import functools
import sys

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import CrossSection, Ipopt, Load, Member, Node, Scene, Trajectory
from sfetcas.trajectories.controlled_motion import Check, ControlledMotion
from sfetcas.trajectories.optimal_control import OptimalControl

LENGTH, STIFFNESS, DENSITY = 1.0, 0.5, 1.0
HUB, TIP = 0.1, 0.2
"""Inertia of the hub, kg m2, and mass at the tip, kg."""

INERTIA = HUB + DENSITY * LENGTH**3 / 3.0 + TIP * LENGTH**2
"""Of the rigid arm about the hub, kg m2."""

ANGLE, LIMIT = np.pi / 2.0, 1.0
"""What the hub turns by, rad, and the largest torque, N m."""

SMALL = 0.05
"""Part of angle and torque in a slew of linear theory: it takes as long, and bends the arm by so much less."""

TORQUE = "loads.motor.value"

ELEMENTS, INTERVALS = 4, 40
"""Of the printed table and the picture."""

TOLERANCE = 1e-3
"""Torques are constant in 40 intervals, in which the switches fall as they do: the time is too long by some 1e-4.
Linear theory of small slews errs by the square of the deflection, 1e-4.  The time of the rigid arm, whose switch falls
between intervals, is within 1e-6."""


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


@functools.cache
def slew(elements: int = ELEMENTS, intervals: int = INTERVALS, part: float = 1.0) -> ControlledMotion:
    """The quickest slew from rest to rest by a part of the angle, with that part of the torque."""
    limit = part * LIMIT
    controls = {TORQUE: (-limit, limit)}
    problem = OptimalControl(arm(elements), controls, time=(0.5, 6.0), intervals=intervals, order=0)
    problem.subject_to(problem.at_tf(problem.answer("nodes.hub.angle")) == part * ANGLE, name="turned")
    problem.rest_at_end()
    problem.minimise(problem.time)
    return problem.solve(time=2.0, replay=False, ipopt=Ipopt(1e-8, 200))


@functools.cache
def replay(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Check:
    """The quickest slew in another integrator, on a finer mesh."""
    return slew(elements, intervals).replayed(accuracy=1e-4)


def switches(torque: np.ndarray) -> int:
    """How often the torque changes its sign."""
    return int((np.diff(np.sign(torque)) != 0.0).sum())


# -- independent times ----------------------------------------------------------------------------------------


def rigid_time() -> float:
    """Least time of the rigid arm, s."""
    return float(2.0 * np.sqrt(ANGLE * INERTIA / LIMIT))


def frequencies(number: int = 2) -> np.ndarray:
    """The first natural angular frequencies of the arm whose hub is free to turn, rad/s."""
    k = np.linspace(0.3, 12.0, 4001) / LENGTH
    values = np.array([_characteristic(each) for each in k])
    (at,) = np.nonzero(np.diff(np.sign(values)))
    at = at[:number]
    found = k[at] - values[at] * (k[at + 1] - k[at]) / (values[at + 1] - values[at])
    return found**2 * np.sqrt(STIFFNESS / DENSITY)


def _characteristic(k: float) -> float:
    """Vanishes at the wave numbers of w = A (cos kx - cosh kx) + B sin kx + C sinh kx."""
    c, s, ch, sh = (f(k * LENGTH) for f in (np.cos, np.sin, np.cosh, np.sinh))
    square = k**4 * STIFFNESS / DENSITY
    hub = [-2.0 * k**2 * STIFFNESS, square * HUB * k, square * HUB * k]
    moment = [-c - ch, -s, sh]
    w, third = (c - ch, s, sh), (s - sh, -c, ch)
    shear = [STIFFNESS * k**3 * b + square * TIP * a for a, b in zip(w, third, strict=True)]
    return float(np.linalg.det([hub, moment, shear]))


def linear_time() -> float:
    """Least time in linear theory with two modes, s: switches in the middle and at two distances to both sides of it.

    Over half the time a, with switches at s1 < s2 from the middle, each frequency w asks for
    1 - 2 cos(w s1) + 2 cos(w s2) - cos(w a) = 0, and the angle for a^2 - 2 s2^2 + 2 s1^2 = angle J / torque.
    """
    w, turned = frequencies(2), ANGLE * INERTIA / LIMIT

    def half(s: np.ndarray) -> float:
        return float(np.sqrt(turned + 2.0 * s[1] ** 2 - 2.0 * s[0] ** 2))

    def left(s: np.ndarray) -> np.ndarray:
        return 1.0 - 2.0 * np.cos(w * s[0]) + 2.0 * np.cos(w * s[1]) - np.cos(w * half(s))

    s = np.array([0.05, 0.25])
    for _ in range(20):
        slopes = np.column_stack([(left(s + d) - left(s - d)) / 2e-6 for d in 1e-6 * np.eye(2)])
        s = s - np.linalg.solve(slopes, left(s))
    if np.abs(left(s)).max() > 1e-9 or not 0.0 < s[0] < s[1] < half(s):
        raise ArithmeticError(f"no switches that leave two modes at rest: {s}")
    return 2.0 * half(s)


# -- what is told ---------------------------------------------------------------------------------------------


def check(elements: int = 3, intervals: int = 40) -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    found = slew(elements, intervals)
    torque = found.control(TORQUE)
    return {
        "rigid arm against 2 sqrt(angle J / torque)": abs(slew(0, 20).time / rigid_time() - 1.0),
        "small slew against linear theory": abs(slew(2, intervals, SMALL).time / linear_time() - 1.0),
        "replay against trajectory, over the length": replay(elements, intervals).difference / LENGTH,
        # These are none but 0 or 1.
        "switches against 5": float(switches(torque) != 5),
        "flexible arm quicker than the rigid one": float(found.time < rigid_time()),
        "torque above its limit": max(float(np.abs(torque).max()) / LIMIT - 1.0, 0.0),
    }


def answer(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Trajectory:
    """The quickest slew of the flexible arm."""
    return replay(elements, intervals).response.trajectory


def picture(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Figure:
    """The torques of the rigid and the flexible arm, and the motion of the flexible one."""
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    torques, shapes = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    for label, motion in (("rigid arm", slew(0, 20)), ("flexible arm", slew(elements, intervals))):
        text = f"{label}, {motion.time:.4f} s"
        torques.stairs(motion.control(TORQUE), motion.ends, label=text, baseline=None, linewidth=1.5)
    torques.set(xlabel="t, s", ylabel="torque, N m", title="Quickest slew by 90 degrees")
    torques.grid(color="#EBEBEB")
    torques.legend(fontsize=8)
    _draw_shapes(shapes, elements, intervals)
    return figure


def _draw_shapes(axes: Axes, elements: int, intervals: int) -> None:
    told = replay(elements, intervals).response
    for i in np.linspace(0, intervals, 13).astype(int):
        x, y, _ = told.instants[i].along("arm", np.linspace(0.0, 1.0, 41))["position"].T
        shade = 0.8 - 0.7 * i / intervals
        axes.plot(x, y, color=(shade, shade, 0.9), linewidth=1.4)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Flexible arm")


def table() -> list[str]:
    """Least times and switches, a line an arm."""
    lines = [f"{'arm':>22} {'time, s':>10} {'switches':>9}"]
    rows = (("rigid", slew(0, 20)), ("flexible", slew()), ("flexible, small slew", slew(part=SMALL)))
    lines += [f"{name:>22} {one.time:10.5f} {switches(one.control(TORQUE)):9d}" for name, one in rows]
    known = (("rigid, closed form", rigid_time(), 1), ("linear theory", linear_time(), 5))
    return lines + [f"{name:>22} {time:10.5f} {number:9d}" for name, time, number in known]


if __name__ == "__main__":
    print(*table(), sep="\n")
    for name, difference in check(ELEMENTS, INTERVALS).items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "slew_in_least_time.png", dpi=150)
