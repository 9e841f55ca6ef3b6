"""By which ways equilibria are found, counted over problems and random scenes; part of ``python -m benchmarks``.

``python -m benchmarks ways [--count 1000] [--seconds 30]`` prints how often each way of
:data:`sfetcas.equilibria.ways.WAYS` gave the answer of all problem files, of random scenes and of random scenes in
contact.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import load
from sfetcas.equilibria.settings import Settings
from sfetcas.equilibria.statics import solve
from sfetcas.equilibria.stops import solve_stopped
from sfetcas.equilibria.ways import WAYS
from sfetcas.errors import SceneError, SolveError

from .contact_scenes import FAMILIES, contact_scene
from .random_scenes import random_scene
from .worker import Worker

__all__ = ["ways"]

PROBLEMS = Path(__file__).parents[1] / "problems"


def ways(arguments: Sequence[str] = ()) -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks ways")
    parser.add_argument("--count", type=int, default=1000, help="random scenes; a quarter as many of contact")
    parser.add_argument("--seconds", type=float, default=30.0, help="for each scene")
    asked = parser.parse_args(arguments)
    each = max(1, asked.count // 4 // len(FAMILIES))
    sources = {
        "problems": [("problem", path.stem) for path in sorted(PROBLEMS.glob("*.toml"))],
        "random": [("random", str(seed)) for seed in range(asked.count)],
        "in contact": [(family, str(seed)) for family in FAMILIES for seed in range(each)],
    }
    counted = {name: _counted(names, asked.seconds) for name, names in sources.items()}
    print("| way | " + " | ".join(counted) + " | what it is |")
    print("|---|" + "---|" * (len(counted) + 1))
    for way in ("", *WAYS, "refused", "too slow"):
        numbers = " | ".join(str(count[way]) for count in counted.values())
        print(f"| {way or 'equilibria'} | {numbers} | {WAYS.get(way, '')} |")


def _counted(names: Iterable[tuple[str, str]], seconds: float) -> Counter[str]:
    """Equilibria (the empty word), and those that each way led to."""
    worker, found = Worker(seconds), Counter[str]()
    try:
        for kind, name in names:
            steps, otherwise = worker.ask(_ways, kind, name)
            found.update(steps or [otherwise])
    finally:
        worker.close()
    return found


def _ways(kind: str, name: str) -> list[str]:
    """The ways of all equilibria of a scene, each with an empty word."""
    try:
        scene = _scene(kind, name)
        if scene.analysis.type != "static":
            return ["no statics"]
        stopped = any(spring.stop is not None for spring in scene.springs.values())
        answer = solve_stopped(scene, Settings()) if stopped else solve(scene)
    except (SceneError, SolveError):
        return ["refused"]
    return [way for step in answer.steps for way in ("", *step.way)]


def _scene(kind: str, name: str) -> Scene:
    if kind == "problem":
        return load(PROBLEMS / f"{name}.toml")
    return random_scene(int(name)) if kind == "random" else Scene.from_dict(contact_scene(kind, int(name)))
