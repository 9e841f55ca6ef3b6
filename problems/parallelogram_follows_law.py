"""The moment that makes the output of a driven flexible parallelogram follow a law, and what the rigid links' would do.

The mechanism is that of ``flexible_parallelogram_motion.toml``: strips of spring steel, a moment on the crank, a spring
on the follower, which shall turn by 0.4 rad as 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, x = t/TIME.  With rigid links the
follower turns as the crank does, and the moment is that of one body on a spring.  Given to the flexible links it misses
the law by far.  The moment that meets it is looked for, with a small cost of its rate.

``python problems/parallelogram_follows_law.py [PICTURE]`` prints the table and draws moments, angles and the mechanism.

Sources: rigid links in closed form, moment = k beta + J beta'' with J of crank, follower and the coupler that moves
along; the replay of each moment by another integrator on a finer mesh.
"""

from __future__ import annotations

import functools
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import History, Ipopt, Scene, Trajectory, load
from sfetcas.trajectories.controlled_motion import Check, ControlledMotion
from sfetcas.trajectories.optimal_control import OptimalControl
from sfetcas.trajectories.replay import Response, respond

FILE = Path(__file__).parent / "flexible_parallelogram_motion.toml"

MOMENT, OUTPUT = "loads.crank.value", "springs.5.angle"

TURNED, TIME = 0.4, 0.5
"""What the follower turns by, rad, and in which time, s."""

LAW = (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0)
"""Coefficients of the powers of x: no velocity, acceleration and jerk at the begin and the end."""

RATE = 1e-8
"""Weight of the squared rate of the moment, beside the squared angle from the law."""

ELEMENTS, INTERVALS = 2, 60
"""Of each strip, of the printed table and the picture."""

TOLERANCE = 2e-3
"""Over the angle to be turned and the size of the mechanism.  Strips of one element, as in the check, err by 1e-3; two
by 1e-4.  The moment of the rigid links is met within 1e-5."""


def mechanism(elements: int = ELEMENTS) -> Scene:
    """The mechanism without its pulse; rigid links of no elements."""
    table = load(FILE).to_dict()
    for key in ("histories", "expect"):
        table.pop(key)
    table["loads"]["crank"] = {"type": "moment", "node": "1", "value": 0.0}
    for member in table["members"].values():
        member.update({"element": "SFET3", "elements": elements} if elements else {"type": "rigid"})
    return Scene.from_dict(table)


def law(x: Any) -> Any:
    """Angle of the follower, rad, at fractions of the time: numbers or an expression."""
    return TURNED * sum(factor * x**power for power, factor in enumerate(LAW) if factor)


@functools.cache
def rigid_moment() -> History:
    """The moment of rigid links: k beta + J beta'', exactly a polynomial."""
    scene = mechanism(0)
    strip = scene.sections["strip"]
    density = strip.rho * strip.width * strip.height
    # Crank and follower of the length 0.2 m turn, the coupler of 0.4 m moves along a circle of that radius.
    inertia = density * (2.0 * 0.2**3 / 3.0 + 0.4 * 0.2**2)
    held = np.array(LAW) * TURNED * scene.springs["5"].stiffness
    moved = np.append(np.polynomial.Polynomial(LAW).deriv(2).coef, [0.0, 0.0]) * TURNED * inertia / TIME**2
    last = float(held.sum() + moved.sum())
    return History(t=[0.0, TIME, 2.0 * TIME], polynomial=[(held + moved).tolist(), [last]])


@functools.cache
def found(elements: int = ELEMENTS, intervals: int = INTERVALS) -> ControlledMotion:
    """The moment by which the follower meets the law."""
    problem = OptimalControl(mechanism(elements), {MOMENT: (-1.0, 1.0)}, time=TIME, intervals=intervals)
    away = problem.answer(OUTPUT) - law(problem.t / TIME)
    problem.minimise(problem.integral(away**2) + RATE * problem.integral(problem.rate(MOMENT) ** 2))
    return problem.solve(replay=False, ipopt=Ipopt(1e-8, 100))


@functools.cache
def replay(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Check:
    """The moment in another integrator, on a finer mesh."""
    return found(elements, intervals).replayed(tail=0.0, accuracy=1e-4)


@functools.cache
def response(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> Response:
    """What a moment does: that of the rigid links to the rigid or the flexible ones, or the one that was found."""
    if command == "found":
        return replay(elements, intervals).response
    scene = mechanism(0 if command == "rigid links" else elements)
    times = np.linspace(0.0, TIME, intervals + 1)
    return respond(scene, {MOMENT: rigid_moment()}, TIME, times=times, step=TIME / 400.0, accuracy=1e-4)


def turned(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> np.ndarray:
    """Angle of the follower in a replay, rad, (intervals + 1,)."""
    return np.array([one.angle("5") for one in response(command, elements, intervals).instants])


def miss(command: str, elements: int = ELEMENTS, intervals: int = INTERVALS) -> float:
    """Largest angle of the follower from the law in a replay, over what it shall turn by."""
    wanted = law(np.linspace(0.0, 1.0, intervals + 1))
    return float(np.abs(turned(command, elements, intervals) - wanted).max()) / TURNED


def check(elements: int = 1, intervals: int = 24) -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    motion = found(elements, intervals)
    own = np.abs(motion.answer(OUTPUT).ravel() - law(motion.times / TIME)).max() / TURNED
    return {
        "law, in the trajectory": float(own),
        "law, in the replay": miss("found", elements, intervals),
        "replay against trajectory, over the size": replay(elements, intervals).difference,
        "law, of rigid links under k beta + J beta''": miss("rigid links", elements, intervals),
        # None but 0 or 1.
        "the rigid links' moment drives flexible ones within a tenth": float(miss("rigid", elements, intervals) < 0.1),
    }


COMMANDS = (("rigid links", "rigid links"), ("rigid", "flexible, moment of rigid links"), ("found", "flexible, found"))


def answer(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Trajectory:
    """The mechanism under the moment that was found."""
    return response("found", elements, intervals).trajectory


def picture(elements: int = ELEMENTS, intervals: int = INTERVALS) -> Figure:
    """Moments, angles of the follower, and the mechanism as it moves."""
    figure = Figure(figsize=(13.0, 4.0), layout="constrained")
    moments, angles, shapes = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.2))
    motion, t = found(elements, intervals), np.linspace(0.0, TIME, 201)
    moments.plot(t, [rigid_moment().factor(x) for x in t], "C1", label="of rigid links")
    moments.plot(motion.ends, motion.control(MOMENT), "C2", label="found")
    moments.set(xlabel="t, s", ylabel="moment on the crank, N m", title="Moments")
    angles.plot(t, law(t / TIME), "k--", linewidth=2.5, alpha=0.4, label="law")
    for command, label in COMMANDS:
        angles.plot(np.linspace(0.0, TIME, intervals + 1), turned(command, elements, intervals), label=label)
    angles.set(xlabel="t, s", ylabel="angle of the follower, rad", title="Output")
    for axes in (moments, angles):
        axes.grid(color="#EBEBEB")
        axes.legend(fontsize=8)
    _draw_shapes(shapes, response("found", elements, intervals))
    return figure


def _draw_shapes(axes: Axes, told: Response) -> None:
    for i in np.linspace(0, len(told.instants) - 1, 6).astype(int):
        shade = 0.8 - 0.7 * i / len(told.instants)
        for member in ("1-2", "2-3", "3-4", "4-5"):
            x, y, _ = told.instants[i].along(member, np.linspace(0.0, 1.0, 21))["position"].T
            axes.plot(x, y, color=(shade, shade, 0.9), linewidth=1.4)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Flexible links under the moment found")


def table(elements: int = ELEMENTS, intervals: int = INTERVALS) -> list[str]:
    """What each moment misses the law by, a line each."""
    crank = response("found", elements, intervals).instants[-1].angle("1")
    lines = [f"crank at {crank:.4f} rad when the follower is at {TURNED:g} rad"]
    lines += [f"{'links':>32} {'largest miss, rad':>18} {'over the angle':>15}"]
    for command, label in COMMANDS:
        part = miss(command, elements, intervals)
        lines.append(f"{label:>32} {part * TURNED:18.2e} {part:15.2e}")
    return lines


if __name__ == "__main__":
    print(*table(), sep="\n")
    for name, difference in check(ELEMENTS, INTERVALS).items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "parallelogram_follows_law.png", dpi=150)
