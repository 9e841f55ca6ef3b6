"""A heap of flexible rods that fall on each other and on a floor; part of ``python -m benchmarks``.

``python -m benchmarks heap [--rods 5 10 20] [--end 0.4] [--step 1e-3]`` prints a table in Markdown: a row for
each number of rods, of 20 elements each.  The rods lie above each other in columns of ten, crosswise, with gaps of a
quarter of a diameter to those of the next column; they are of rubber, 1 m long and 2 cm thick.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from sfetcas.analyses import solve
from sfetcas.description.scene import Scene
from sfetcas.dynamics.motion import Trajectory
from sfetcas.errors import SolveError

from .saving import head, row

__all__ = ["heap", "rods"]

RADIUS, ELEMENTS, COLUMN = 0.01, 20, 10
"""Radius of the rods, m; elements of a rod; rods of a column."""


def rods(count: int, end: float, step: float, elements: int = ELEMENTS) -> Scene:
    """The scene: so many rods, followed up to a time in steps of some length, s."""
    rng, nodes, members = np.random.default_rng(0), dict[str, Any](), dict[str, Any]()
    for k in range(count):
        column, layer = divmod(k, COLUMN)
        angle, tilt = rng.uniform(0.0, np.pi), rng.uniform(-0.002, 0.002)
        along, across = rng.uniform(-0.02, 0.02, 2)
        middle = np.array([0.55 * column + along, 0.03 + 0.025 * (2 * layer + column % 2), across])
        half = 0.5 * np.array([np.cos(angle), tilt, np.sin(angle)])
        nodes[f"a{k}"], nodes[f"b{k}"] = ({"position": (middle + s * half).tolist()} for s in (-1.0, 1.0))
        members[f"m{k}"] = {"nodes": [f"a{k}", f"b{k}"], "section": "rubber", "elements": elements}
    floor = {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0], "members": "all"}
    table = {
        "dimension": "space",
        "gravity": [0, -9.81, 0],
        "sections": {"rubber": {"shape": "circle", "radius": RADIUS, "E": 5e6, "nu": 0.3, "rho": 1000.0}},
        "nodes": nodes,
        "members": members,
        "contacts": {"rods": {"type": "members", "members": "all", "radius": RADIUS}, "floor": floor},
        "analysis": {"type": "dynamic", "end": end, "step": step, "output": end / 10, "integrator": "stepping"},
    }
    return Scene.from_dict(table)


def heap(words: list[str]) -> None:
    """Follow heaps and print what they cost, how much touches, and what is wrong with energy and gaps."""
    options = argparse.ArgumentParser(prog="python -m benchmarks heap", description=__doc__)
    options.add_argument("--rods", type=int, nargs="+", default=[5, 10, 20], help="numbers of rods")
    options.add_argument("--end", type=float, default=0.4, help="time, s")
    options.add_argument("--step", type=float, default=1e-3, help="step, s")
    given = options.parse_args(words)
    head("rods", "reached, s", "steps", "touches", "CPU seconds", "ms a step and rod", "gain of energy", "depth")
    for count in given.rods:
        begin = time.process_time()
        try:
            motion: object = solve(rods(count, given.end, given.step))
        except SolveError as error:
            motion = error.reached
            if motion is None:
                raise
        assert isinstance(motion, Trajectory)
        row(count, *_told(motion, count, time.process_time() - begin))


def _told(motion: Trajectory, count: int, seconds: float) -> list[str]:
    """The cells of a row."""
    energies, deepest = motion.energies(), 0.0
    for step in motion.steps:
        gaps = [step.contacts["rods"]["gap"]]
        deepest = max(deepest, *(-float(np.min(gap)) for gap in gaps if gap is not None), 0.0)
    size = max(float(np.ptp(energies)), 1e-300)
    last = motion.last.contacts
    touching = np.size(last["rods"]["at"]) if last["rods"]["member"] is not None else 0
    return [
        f"{motion.last.time:.3g}",
        str(motion.count),
        f"{touching + len(last['floor']['touching'])} at the end",
        f"{seconds:.0f}",
        f"{1e3 * seconds / max(motion.count, 1) / count:.1f}",
        f"{max(float(np.diff(energies).max()), 0.0) / size:.0e}",
        f"{deepest / RADIUS:.0e} radii",
    ]
